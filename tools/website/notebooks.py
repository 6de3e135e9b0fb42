"""Notebooks as pages: their cells are run here, without a notebook server, and what they show is put behind them."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

from partita.viewer import LiveView

NOTE = "<!-- made from {name}.ipynb -->"


@dataclass
class Cell:
    """One cell: its text, and of code what it printed, what its last line was worth and the figures it left."""

    kind: str
    text: str
    printed: str = ""
    value: object = None
    figures: list[Any] = field(default_factory=list)


def run(path: Path) -> Iterator[Cell]:
    """The cells of a notebook in order, each run when it is asked for; an exception of a cell is raised as it is."""
    names: dict[str, Any] = {"__name__": path.stem}
    for number, cell in enumerate(json.loads(path.read_text("utf-8"))["cells"], start=1):
        found = Cell(cell["cell_type"], "".join(cell["source"]))
        if found.kind == "code":
            _execute(found, f"{path.name}, cell {number}", names)
        yield found


def _execute(cell: Cell, source: str, names: dict[str, Any]) -> None:
    import matplotlib.pyplot as plt

    tree = ast.parse(cell.text, source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = StringIO()
    with redirect_stdout(printed):
        exec(compile(tree, source, "exec"), names)
        if isinstance(last, ast.Expr) and not cell.text.rstrip().endswith(";"):
            cell.value = eval(compile(ast.Expression(last.value), source, "eval"), names)
        elif isinstance(last, ast.Expr):
            eval(compile(ast.Expression(last.value), source, "eval"), names)
    cell.printed = printed.getvalue()
    cell.figures = [plt.figure(number) for number in plt.get_fignums()]
    plt.close("all")


def page(path: Path, figures: Path) -> str:
    """The notebook as a page of Markdown; its figures are written into the folder `figures`, beside the page."""
    parts = [NOTE.format(name=path.stem)]
    count = 0
    for cell in run(path):
        if cell.kind == "markdown":
            parts.append(cell.text)
            continue
        parts.append(f"```python\n{cell.text}\n```")
        if cell.printed:
            parts.append(f"```output\n{cell.printed.rstrip()}\n```")
        shown = [*cell.figures]
        if hasattr(cell.value, "savefig"):
            shown = [f for f in shown if f is not cell.value] + [cell.value]
        elif cell.value is not None:
            parts.append(_value(cell.value))
        for drawn in shown:
            count += 1
            name = f"{path.stem}-{count}.svg"
            drawn.savefig(figures / name, bbox_inches="tight")
            parts.append(f"![figure {count}]({name})")
    parts.append(f'<p><a href="../files/{path.name}" download>This page as a notebook</a></p>')
    return "\n\n".join([*parts, ""])


def _value(value: Any) -> str:
    if isinstance(value, LiveView):
        return "*Here stands the live view, for as long as the notebook runs.*"
    if callable(getattr(value, "_repr_html_", None)):
        return f'<div class="shown table-wrapper">{" ".join(value._repr_html_().split())}</div>'
    return f"```output\n{value!r}\n```"
