"""The folder that Sphinx renders: the pages of docs/ with changelog, figures, reference, gallery and notebooks."""

from __future__ import annotations

import importlib
import inspect
import os
import re
import shutil
from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stdout
from html import escape
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FunctionType
from typing import Any

from partita import catalogue
from partita.errors import MissingFileError
from partita.sketch import static_page

from . import conf, docstrings, gallery, labels, notebooks
from .outline import MEMBERS, PARTS, REFERENCE
from .tilt import tilt_page

HERE = Path(__file__).parent
DOCS = HERE.parents[1] / "docs"

NOTEBOOK = re.compile(r"(\]\((?:\.\./)?notebooks/[\w-]+)\.ipynb\)")
PAGE = re.compile(r"(?<!`)\bdocs/([\w/-]+\.md)")  # as the changelog names pages
STATIC = ("partita.css", "favicon.svg", "from_disk.js", "search_field.js")
# The reference of the core is made by cargo and put beside the site.
RUST = """# The core, in Rust

The mathematics is written in Rust, in crates that know only those below them. Their reference has every item,
private ones included, with the labels of the equations:

<ul>
<li><a href="../rust/partita_math/index.html">partita_math</a>: small matrices, eliminations, spatial algebra</li>
<li><a href="../rust/partita_system/index.html">partita_system</a>: constrained systems, choice of coordinates</li>
<li><a href="../rust/partita_integrate/index.html">partita_integrate</a>: methods, steps, runs</li>
<li><a href="../rust/partita_model/index.html">partita_model</a>: bodies, joints, forces, loops</li>
<li><a href="../rust/partita_analysis/index.html">partita_analysis</a>: mobility, redundancy, unique reactions</li>
<li><a href="../rust/partita_web/index.html">partita_web</a>: the core inside pages</li>
</ul>
"""


def stage(folder: Path, draw: Callable[[Path], None], only: tuple[str, ...] | None = None) -> None:
    """Put the sources of the site into an empty `folder`; `draw` makes the figures, `only` some of the gallery."""
    known = {label: (page, heading) for label, page, heading in labels.targets()}
    for page in sorted(DOCS.rglob("*.md")):
        target = folder / page.relative_to(DOCS)
        target.parent.mkdir(parents=True, exist_ok=True)
        # notebooks and the changelog are pages of the site, beside the others
        text = NOTEBOOK.sub(r"\1.md)", page.read_text(encoding="utf-8"))
        text = labels.linked(text, page, known) if labels.cites(page) else text
        target.write_text(text.replace("](../CHANGELOG.md)", "](changelog.md)"), encoding="utf-8")
        for picture in SHOWN.findall(text):
            if (file := page.parent / picture).is_file():  # the others are drawn for the site
                (folder / picture).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, folder / picture)
    changes = (DOCS.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    changes = PAGE.sub(r"[\1](\1)", changes.replace("](docs/", "]("))
    (folder / "changelog.md").write_text(changes, encoding="utf-8")
    for name in ("CONTRIBUTING", "ARCHITECTURE"):
        text = (DOCS.parent / f"{name}.md").read_text(encoding="utf-8").replace("](docs/", "](")
        text = text.replace("](ARCHITECTURE.md)", "](architecture.md)").replace("](CHANGELOG.md)", "](changelog.md)")
        (folder / f"{name.lower()}.md").write_text(text, encoding="utf-8")
    for name in ("conf.py", "scorer.js", *STATIC):
        target = folder / ("_static" if name in STATIC else ".") / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(HERE / name, target)
    for notebook in sorted((DOCS / "notebooks").glob("*.ipynb")):
        beside, files = folder / "notebooks", folder / "_extra" / "files"
        beside.mkdir(parents=True, exist_ok=True)
        files.mkdir(parents=True, exist_ok=True)
        (beside / f"{notebook.stem}.md").write_text(notebooks.page(notebook, beside), encoding="utf-8")
        shutil.copy(notebook, files)
    animate(folder)
    tile(folder)
    reference(folder / "reference")
    gallery.build(folder / "gallery", folder / "_extra" / "live", only)
    draw(folder)
    contents(folder)


# Pictures on pages of docs/, beside which they stand.
SHOWN = re.compile(r"!\[[^\]]*\]\(([\w/.-]+)\)")
# Where a page of docs/ shows a mechanism in motion: what its own code left in `run`, or a mechanism of the catalogue.
# With "bare" the drawing alone, as wide as the page; with "playground" one that the reader changes; with "page" one
# of PAGES.
LIVE = re.compile(r"^<!-- live: ([\w-]+)(?: (bare|playground|page))? -->$", flags=re.MULTILINE)
PAGES: dict[str, Callable[[], str]] = {"draw": static_page, "tilt": tilt_page}
MISSING = (
    "*This site was built without Rust's target for pages, wasm32-unknown-unknown, so the page that stands here is "
    "missing.*"
)
CODE = re.compile(r"^```python\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)


def animate(folder: Path) -> None:
    """Animated pages in the places that ask for them."""
    pages = folder / "_extra" / "live"
    pages.mkdir(parents=True, exist_ok=True)
    for page in sorted(folder.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        if not LIVE.search(text):
            continue
        name = page.relative_to(folder).with_suffix("").as_posix().replace("/", "-")
        up = "../" * (len(page.relative_to(folder).parts) - 1)

        def shown(mark: re.Match[str], text: str = text, name: str = name, up: str = up) -> str:
            if mark[2] == "page":
                return alone(mark[1], pages, up)
            if mark[2] == "playground":
                catalogue.load(mark[1]).to_playground(pages / f"{name}.html")
            else:
                run = ran(text[: mark.start()])["run"] if mark[1] == "run" else catalogue.entry(mark[1]).simulate()
                run.to_html(pages / f"{name}.html")
            kind, part = {"bare": (" bare", "?bare#play"), "playground": ("", "")}.get(mark[2], ("", "#play"))
            more = f' · <a href="{up}gallery/index.html">All mechanisms of the gallery</a>' if mark[2] == "bare" else ""
            return (
                f'<iframe class="live{kind}" src="{up}live/{name}.html{part}" loading="lazy" '
                f'title="the mechanism of this page in motion"></iframe>\n'
                f'<p><a href="{up}live/{name}.html">The animated page alone</a>{more}</p>'
            )

        page.write_text(LIVE.sub(shown, text), encoding="utf-8")


def tile(folder: Path) -> None:
    """Moving tiles on the first page, each of which opens its animated page, playing."""
    page, pictures = folder / "index.md", folder / "_extra" / "tiles"
    pictures.mkdir(parents=True)
    cards = []
    for drawn in sorted((DOCS / "pictures").glob("tile-*.svg")):
        name = drawn.stem.removeprefix("tile-")
        shutil.copy(drawn, pictures)
        title = catalogue.entry(name).title
        picture = f'<img src="tiles/tile-{name}.svg" alt="" width="300" height="220">'
        cards.append(f'<a class="card" href="live/{name}.html#play">{picture}<span>{escape(title)}</span></a>')
    shown = f'<div class="gallery tiles">\n{"".join(cards)}\n</div>'
    page.write_text(page.read_text(encoding="utf-8").replace("<!-- tiles -->", shown), encoding="utf-8")


def alone(name: str, pages: Path, up: str) -> str:
    """One of PAGES, in a frame as high as it needs, and by itself."""
    try:
        (pages / f"page-{name}.html").write_text(PAGES[name](), encoding="utf-8")
    except MissingFileError:
        return MISSING
    return (
        f'<iframe class="live page" src="{up}live/page-{name}.html" loading="lazy" title="it computes here"></iframe>\n'
        f'<p><a href="{up}live/page-{name}.html">The page alone</a>: save it, and it works without a network.</p>'
    )


def ran(text: str) -> dict[str, Any]:
    """The names that the code of a page leaves, run in an empty folder."""
    names: dict[str, Any] = {"__name__": "page"}
    here = Path.cwd()
    with TemporaryDirectory() as empty, redirect_stdout(StringIO()):
        os.chdir(empty)
        try:
            for block in CODE.findall(text):
                exec(compile(block, "page", "exec"), names)
        finally:
            os.chdir(here)
    return names


def contents(folder: Path) -> None:
    """The sidebar, as tables of contents that no page shows."""
    with (folder / "index.md").open("a", encoding="utf-8") as index:
        for part, pages in PARTS.items():
            index.write("\n" + toctree(part, pages))
    decisions = sorted(path.stem for path in (folder / "decisions").glob("[0-9]*.md"))
    with (folder / "decisions" / "README.md").open("a", encoding="utf-8") as page:
        page.write("\n" + toctree("", decisions))


def toctree(caption: str, pages: Iterable[str]) -> str:
    """A table of contents for the sidebar alone."""
    lines = ["```{toctree}", ":hidden:", *([f":caption: {caption}"] if caption else []), "", *pages, "```", ""]
    return "\n".join(lines)


LOOKED_UP = "For users of the Python interface who look up a name, its arguments, units and errors."


def reference(folder: Path) -> None:
    """Pages of the reference, from docstrings: one for each class or function below one for each part."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rust.md").write_text(RUST, encoding="utf-8")
    for page, (title, sentence, names) in REFERENCE.items():
        body = f"# {title}\n\n{LOOKED_UP} {sentence}\n\n"
        blocks = [".. automodule:: partita.units\n   :no-members:"] if page == "units" else []
        if page == "errors":
            blocks = [".. automodule:: partita.errors\n   :members:\n   :show-inheritance:"]
        if names:
            blocks += list(listed(names))
            body += toctree("", [f"{page}/{own}" for own in page_names(names).values()]) + "\n"
            for name, own in page_names(names).items():
                one(name, folder / page / f"{own}.md")
        (folder / f"{page}.md").write_text(body + directives(blocks), encoding="utf-8")


def directives(blocks: Iterable[str]) -> str:
    """Directives of Sphinx in a page of Markdown."""
    text = "\n\n".join(blocks)
    return f"```{{eval-rst}}\n{text}\n```\n"


def page_names(names: Iterable[str]) -> dict[str, str]:
    """Name -> name of its page; in small letters, since disks may not tell them from large ones."""
    pages: dict[str, str] = {}
    for name in names:
        own = name.rpartition(".")[2].lower()
        pages[name] = (
            own if own not in pages.values() else f"{own}-{'class' if isinstance(found(name), type) else 'function'}"
        )
    return pages


def listed(names: Iterable[str]) -> Iterable[str]:
    """Tables of classes and functions, each with its first sentence."""
    known = {name: found(name) for name in names}
    for what, wanted in (("Classes", True), ("Functions", False)):
        rows = [
            row(name.rpartition(".")[2], name, kind)
            for name, kind in known.items()
            if isinstance(kind, type) == wanted and inspect.getdoc(kind)
        ]
        if rows:
            yield table(what, rows)


def one(name: str, page: Path) -> None:
    """The page of a class or a function; a class with many members has them on pages below."""
    page.parent.mkdir(parents=True, exist_ok=True)
    last, kind = name.rpartition(".")[2], found(name)
    groups = MEMBERS.get(name)
    if groups is None or not isinstance(kind, type):
        page.write_text(f"# {last}\n\n{directives([directive(name)])}", encoding="utf-8")
        return
    blocks = [f".. autoclass:: partita.{name}"]
    for title, sentence, members in groups.values():
        rows = [row(member, f"{name}.{member}", inspect.getattr_static(kind, member)) for member in members]
        blocks.append(table(f"{title}: {sentence[0].lower()}{sentence[1:]}", rows))
    below = toctree("", [f"{page.stem}-{own}" for own in groups])
    page.write_text(f"# {last}\n\n{below}\n{directives(blocks)}", encoding="utf-8")
    for own, (title, sentence, members) in groups.items():
        shown = [f".. auto{kind_of(kind, member)}:: partita.{name}.{member}" for member in members]
        text = f"# {title}\n\n{LOOKED_UP} {sentence}\n\n{directives(shown)}"
        (page.parent / f"{page.stem}-{own}.md").write_text(text, encoding="utf-8")


def kind_of(owner: type, member: str) -> str:
    """The word of Sphinx for a member."""
    there = inspect.getattr_static(owner, member)
    if isinstance(there, property):
        return "property"
    return "method" if isinstance(there, (FunctionType, classmethod, staticmethod)) else "attribute"


def directive(name: str) -> str:
    """The directive for one class or function, with inherited members."""
    kind = found(name)
    if isinstance(kind, type):
        reported = f".. autoclass:: partita.{name}\n   :members:\n   :inherited-members: tuple, str, Mapping, ndarray"
        return "\n\n".join([*overview(name, kind), reported])
    return f".. autofunction:: partita.{name}"


MANY = 8
"""A class with so many members is opened by a table of them."""


def overview(name: str, kind: type) -> list[str]:
    """The members of a large class in one table, each with its first sentence, in the order of the page."""
    order = dict.fromkeys(own for base in kind.__mro__ for own in vars(base))
    rows = []
    for member in order:
        there = inspect.getattr_static(kind, member)
        reported = (
            inspect.getdoc(there) if isinstance(there, (FunctionType, property, classmethod, staticmethod)) else None
        )
        hidden = member.startswith("_") or conf.internal(kind, there) or hasattr(Mapping, member)
        if reported and not hidden:
            rows.append(row(member, f"{name}.{member}", there))
    return [table(f"What a {kind.__name__} has", rows)] if len(rows) >= MANY else []


def row(word: str, name: str, what: object) -> str:
    """A row of a table: a name that leads to its place, and its first sentence."""
    return f"   * - :py:obj:`{word} <partita.{name}>`\n     - {first(inspect.getdoc(what) or '')}"


def table(title: str, rows: Iterable[str]) -> str:
    """Such a table."""
    return f".. list-table:: {title}\n   :widths: auto\n   :class: members\n\n" + "\n".join(rows)


def first(text: str) -> str:
    """The first sentence of a docstring, without its full stop."""
    paragraph = " ".join(text.split("\n\n")[0].split())
    return docstrings.literal(re.split(r"(?<=\.)\s", paragraph)[0].removesuffix("."))


def found(name: str) -> object:
    """What is called `name` under `partita`."""
    room, _, last = name.rpartition(".")
    return getattr(importlib.import_module(f"partita.{room}" if room else "partita"), last)
