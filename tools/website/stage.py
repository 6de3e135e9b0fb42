"""The folder that Sphinx renders: the pages of docs/ with figures, reference, gallery and notebooks beside them."""

from __future__ import annotations

import importlib
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from . import gallery, notebooks
from .outline import PARTS, REFERENCE

HERE = Path(__file__).parent
DOCS = HERE.parents[1] / "docs"

STYLE = "partita.css"
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
</ul>
"""


def stage(folder: Path, draw: Callable[[Path], None], only: tuple[str, ...] | None = None) -> None:
    """Put the sources of the site into an empty `folder`; `draw` makes the figures, `only` some of the gallery."""
    for page in sorted(DOCS.rglob("*.md")):
        target = folder / page.relative_to(DOCS)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(page, target)
    for name in ("conf.py", STYLE):
        target = folder / ("_static" if name == STYLE else ".") / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(HERE / name, target)
    for notebook in sorted((DOCS / "notebooks").glob("*.ipynb")):
        beside, files = folder / "notebooks", folder / "_extra" / "files"
        beside.mkdir(parents=True, exist_ok=True)
        files.mkdir(parents=True, exist_ok=True)
        (beside / f"{notebook.stem}.md").write_text(notebooks.page(notebook, beside), encoding="utf-8")
        shutil.copy(notebook, files)
    reference(folder / "reference")
    gallery.build(folder / "gallery", folder / "_extra" / "live", only)
    draw(folder)
    contents(folder)


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


def reference(folder: Path) -> None:
    """Pages of the reference, from docstrings."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rust.md").write_text(RUST, encoding="utf-8")
    for page, (title, sentence, names) in REFERENCE.items():
        blocks = [directive(name) for name in names]
        if page == "errors":
            blocks = [".. automodule:: partita.errors\n   :members:\n   :show-inheritance:"]
        if page == "units":
            blocks.insert(0, ".. automodule:: partita.units\n   :no-members:")
        text = "\n\n".join(blocks)
        body = f"# {title}\n\n{sentence}\n\n```{{eval-rst}}\n{text}\n```\n"
        (folder / f"{page}.md").write_text(body, encoding="utf-8")


def directive(name: str) -> str:
    """What asks Sphinx for one class or function, with the members that it inherits."""
    if isinstance(found(name), type):
        return f".. autoclass:: partita.{name}\n   :members:\n   :inherited-members: tuple, str, Mapping"
    return f".. autofunction:: partita.{name}"


def found(name: str) -> object:
    """What is called `name` under `partita`."""
    room, _, last = name.rpartition(".")
    return getattr(importlib.import_module(f"partita.{room}" if room else "partita"), last)
