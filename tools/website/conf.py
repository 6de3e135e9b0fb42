"""Sphinx's settings for the site. It is run on the folder that `stage` puts together."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import partita
from website import texts

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
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Array", "FloatArray", "Points")}
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

# Signs that docstrings use as they are and that mean something to docutils: bars, stars, underscores at a word's end.
_CODE = re.compile(r"(``.+?``|`[^`]+`)")
_SIGNS = re.compile(r"(?<!\\)([*|]|_(?=\W|$))")


def literal(line: str) -> str:
    """A line of prose with those signs said literally; what stands between backticks is left alone."""
    pieces = _CODE.split(line)
    return "".join(p if n % 2 else _SIGNS.sub(r"\\\1", p) for n, p in enumerate(pieces))


def plain(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """Prose of a docstring with those signs said literally; examples and code are left alone."""
    example = False
    for i, line in enumerate(lines):
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example and not line.lstrip().startswith((":", "..")) and not line.lstrip().startswith("* "):
            lines[i] = literal(line)


# What stands before a colon in the words about an attribute is no type, as napoleon would have it.
_COLON = "\ue000"


def hide(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """Colons of attributes, before napoleon."""
    if what in ("attribute", "property") and lines:
        lines[0] = lines[0].replace(":", _COLON)


def show(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """And behind it."""
    lines[:] = [line.replace(_COLON, ":") for line in lines]


# Classes that users make; of the others the arguments are nobody's business.
_MADE = ("Mechanism", "System", "TangentVelocities", "Coordinate", "Distance", "Along", "Cosine")


def signature(app: Any, what: str, name: str, *rest: Any) -> tuple[str, None] | None:
    """No arguments for what only Partita makes."""
    hidden = what == "class" and name.rpartition(".")[2] not in _MADE
    return ("", None) if hidden else None


# Ways in for the package itself; nobody calls them.
INSIDE = ("from_run", "from_core", "from_account")


def skipped(app: Any, what: str, name: str, obj: object, skip: bool, options: Any) -> bool | None:
    """Whether a member is left out; None: as usual."""
    return True if name in INSIDE else None


def finished(app: Any, exception: Exception | None) -> None:
    """The texts of all pages, for a search from disk."""
    if exception is None and app.builder.name == "html":
        texts.write(Path(app.outdir))


# A number and its unit, "N = 40": one word to the lines of a table's cell.
_QUANTITY = re.compile(r"(?<=\d) (?=(?:[nµm]?s|min|h|[kMG]?B|[mk]?m|k?g|[kM]?N|N m|k?W|J|rad|deg|Hz|rpm)\b)")
_EQUAL = re.compile(r"\b(\w) = (?=\d)")


def together(app: Any, doctree: Any, *rest: Any) -> None:
    """Quantities in cells of tables are not broken between two lines."""
    from docutils import nodes  # there where Sphinx is

    for cell in doctree.findall(nodes.entry):
        for text in list(cell.findall(nodes.Text)):
            if not isinstance(text.parent, nodes.literal):
                joined = _EQUAL.sub("\\1\u00a0=\u00a0", _QUANTITY.sub("\u00a0", str(text)))
                text.parent.replace(text, nodes.Text(joined))


def setup(app: Any) -> None:
    """Docstrings before and after napoleon reads them, signatures, and what is made of the rendered pages."""
    app.connect("build-finished", finished)
    app.connect("doctree-resolved", together)
    app.connect("autodoc-skip-member", skipped)
    app.connect("autodoc-process-docstring", plain, priority=400)
    app.connect("autodoc-process-docstring", hide, priority=410)
    app.connect("autodoc-process-docstring", show, priority=600)
    app.connect("autodoc-process-signature", signature)
