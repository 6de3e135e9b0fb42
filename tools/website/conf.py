"""Sphinx's settings for the site. It is run on the folder that `stage` puts together."""

from __future__ import annotations

import inspect
import itertools
import re
from pathlib import Path
from typing import Any

import partita
from website import docstrings, texts

project = "Partita"
author = "the authors of Partita"
release = partita.__version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "website.formulas",
]
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

html_theme = "furo"
html_title = f"Partita {release}"
html_static_path = ["_static"]
html_favicon = "_static/favicon.svg"
html_css_files = ["partita.css"]
html_js_files = ["from_disk.js", "search_field.js"]
html_extra_path = ["_extra"]
html_show_sphinx = False
html_show_sourcelink = False
html_copy_source = False
html_show_copyright = False
html_domain_indices = False  # two modules alone are documented as such
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5c8c", "color-brand-content": "#0b5c8c"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f2", "color-brand-content": "#7cc4f2"},
}
html_math_renderer = "mathml"
html_search_scorer = str(Path(__file__).with_name("scorer.js"))
pygments_style = "default"
pygments_dark_style = "github-dark"

smartquotes = False
highlight_language = "none"
default_role = "code"  # docstrings write code between single backticks
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
# What people may give or get in a word; spelt out it would be half a page.
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Array", "FloatArray", "Points", "Course")}
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
copybutton_selector = "div:not(.highlight-output):not(.highlight-none) > div.highlight > pre"
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True


def prepare(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """A docstring before napoleon reads it; in the words about an attribute nothing before a colon is a type."""
    lines[:] = docstrings.sections(docstrings.plain(lines))
    if what in ("attribute", "property") and lines:
        lines[0] = lines[0].replace(":", docstrings.COLON)


def restore(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """And behind it."""
    lines[:] = [docstrings.restored(line) for line in lines]


# Classes that users make; of the others the arguments are nobody's business.
_MADE = ("Mechanism", "System", "TangentVelocities", "Coordinate", "Distance", "Along", "Cosine")


def signature(app: Any, what: str, name: str, *rest: Any) -> tuple[str, None] | None:
    """No arguments for what only Partita makes."""
    hidden = what == "class" and name.rpartition(".")[2] not in _MADE
    return ("", None) if hidden else None


def internal(owner: type, member: object) -> bool:
    """Whether a member is for the package alone: a constructor of a class that only Partita makes."""
    return isinstance(member, classmethod) and owner.__name__ not in _MADE


def skipped(app: Any, what: str, name: str, obj: object, skip: bool, options: Any) -> bool | None:
    """Whether a member is left out; None: as usual."""
    owner = getattr(obj, "__self__", None)
    return True if isinstance(owner, type) and internal(owner, inspect.getattr_static(owner, name)) else None


def finished(app: Any, exception: Exception | None) -> None:
    """The texts of all pages, for a search from disk."""
    if exception is None and app.builder.name == "html":
        texts.write(Path(app.outdir))


# A number and its unit, "N = 40": one word to the lines of a table's cell.
_QUANTITY = re.compile(r"(?<=\d) (?=(?:[nµm]?s|min|h|[kMG]?B|[mk]?m|k?g|[kM]?N|N m|k?W|J|rad|deg|Hz|rpm)\b)")
_EQUAL = re.compile(r"\b(\w) = (?=\d)")
# What is surely the path of a file in plain words: "m/s" is none.
_PATH = re.compile(r"[\w.-]+(?:/[\w.-]+)*/[\w-]+\.[a-z]+\b")


def together(app: Any, doctree: Any, *rest: Any) -> None:
    """Quantities in cells of tables are not broken between two lines, paths only behind a folder; names of one entry
    stand side by side."""
    from docutils import nodes  # there where Sphinx is

    for text in list(doctree.findall(nodes.Text)):
        if docstrings.SPACE in text or text == " -- ":
            shown = str(text).replace(docstrings.SPACE, " ").replace(" -- ", " – ")
            text.parent.replace(text, nodes.Text(shown))
    for cell in doctree.findall(nodes.entry):
        for text in list(cell.findall(nodes.Text)):
            shown = str(text)
            if isinstance(text.parent, nodes.literal):
                folders = [i + 1 for i, sign in enumerate(shown[:-1]) if sign == "/"]
            else:
                shown = _EQUAL.sub("\\1\u00a0=\u00a0", _QUANTITY.sub("\u00a0", shown))
                folders = [
                    path.start() + i + 1
                    for path in _PATH.finditer(shown)
                    for i, sign in enumerate(path.group())
                    if sign == "/"
                ]
            # a path may go on below behind each of its folders
            pieces = []
            for begin, end in itertools.pairwise([0, *folders, len(shown)]):
                pieces += [nodes.raw("", "<wbr>", format="html"), nodes.Text(shown[begin:end])]
            text.parent.replace(text, pieces[1:])


def types(*modules: Any) -> None:
    """Have these modules of Sphinx write types with short names of arrays."""
    for module in modules:
        written = module.stringify_annotation
        module.stringify_annotation = lambda *args, written=written, **more: docstrings.short(written(*args, **more))


def setup(app: Any) -> None:
    """Docstrings before and after napoleon reads them, signatures, and what is made of the rendered pages."""
    import sphinx.ext.autodoc
    import sphinx.ext.napoleon.docstring
    import sphinx.util.inspect
    from sphinx.domains.python._object import PyObject

    types(sphinx.ext.autodoc, sphinx.ext.napoleon.docstring, sphinx.util.inspect)
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"  # as the docstrings say
    app.connect("build-finished", finished)
    app.connect("doctree-resolved", together)
    app.connect("autodoc-skip-member", skipped)
    app.connect("autodoc-process-docstring", prepare, priority=400)
    app.connect("autodoc-process-docstring", restore, priority=600)
    app.connect("autodoc-process-signature", signature)
