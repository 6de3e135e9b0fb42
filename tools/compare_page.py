"""The page docs/compare.md: its tables are those of `partita compare`, its figures are drawn with the pages.

The front page has some rows and columns of one of them.

python tools/compare_page.py --write    run the comparisons anew and put their tables on the page

Costs differ from machine to machine and from run to run, so the tables are not rewritten with the pages. Which rows and
columns they have, and how each run ended, does not differ: the tests hold that against a fresh run.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from partita import catalogue
from partita.comparison import Comparison
from partita.comparison.table import grid

FRONT = Path(__file__).parents[1] / "README.md"
PAGE = FRONT.parent / "docs" / "compare.md"
TABLES = ("four-bar", "n-four-bar", "andrews-squeezer")
FIGURES = ("four-bar", "andrews-squeezer")
BLOCK = re.compile(r"(<!-- measured ([\w-]+) -->\n```text\n)(.*?)(```\n)", flags=re.DOTALL)
EXCERPT = re.compile(r"(<!-- some rows of ([\w-]+) -->\n```text\n)(.*?)(```\n)", flags=re.DOTALL)
ROWS = (
    "projective",
    "projective: determinant",
    "wehage-haug",
    "explicit-closing",
    "svd",
    "gram-schmidt",
    "multipliers",
)
COLUMNS = ("formulation", "evals", "switches", "|Phi|", "energy", "error", "sigma", "us/eval")
SHORT: dict[str, Any] = {"formulations": ["projective", "multipliers"], "selections": ["collective"]}


def main() -> None:
    """Do what the arguments say."""
    parser = argparse.ArgumentParser(description="Tables of docs/compare.md.")
    parser.add_argument(
        "--write", action="store_true", required=True, help="run the comparisons and rewrite the tables"
    )
    parser.parse_args()
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(BLOCK.sub(lambda part: f"{part[1]}{compared(part[2])}\n{part[4]}", text), encoding="utf-8")
    FRONT.write_text(front(), encoding="utf-8")


def compared(name: str, **options: Any) -> Comparison:
    """What `partita compare NAME` prints."""
    entry = catalogue.entry(name)
    mechanism = entry.mechanism()
    found: Comparison = mechanism.compare(entry.duration, initial=entry.initial(mechanism), **options)
    return found


def tables() -> dict[str, str]:
    """The tables on the page by the name of their mechanism."""
    return {name: text for _, name, text, _ in BLOCK.findall(PAGE.read_text(encoding="utf-8"))}


def front() -> str:
    """The front page with its excerpt as the page has it."""
    shown = tables()
    return EXCERPT.sub(lambda part: f"{part[1]}{excerpt(shown[part[2]])}\n{part[4]}", FRONT.read_text(encoding="utf-8"))


def excerpt(text: str) -> str:
    """`ROWS` and `COLUMNS` of a table."""
    cells = [re.split(r" {2,}", line) for line in text.splitlines()]
    headings = next(row for row in cells if row[0] == COLUMNS[0])
    places = [headings.index(column) for column in COLUMNS]
    named = {row[0]: row for row in cells if len(row) == len(headings)}
    return grid(COLUMNS, [[named[name][place] for place in places] for name in ROWS], 1)


def outline(text: str) -> dict[str, Any]:
    """What of a table is the same everywhere: caption, columns, rows with their ends, notes without their numbers."""
    caption, *lines = text.strip().splitlines()
    rule = next(place for place, line in enumerate(lines) if set(line) == {"-", " "})
    cells = [re.split(r" {2,}", line) for line in lines]
    rows = next(place for place, line in enumerate(lines) if line.startswith("cond C_D"))
    return {
        "caption": caption,
        "columns": cells[rule - 1],
        "rows": [tuple(row[:2]) for row in cells[rule + 1 : rows]],
        "notes": [note_head(line) for line in lines[rows:]],
    }


def note_head(line: str) -> str:
    """A note up to its reason."""
    head = re.match(r"(projective: )?[^:]+: (not run|failed|[a-z-]+):", line)
    return head[0] if head else line


def draw(name: str, folder: Path, short: bool, tolerances: Sequence[float] = (1e-5, 1e-8)) -> None:
    """Error against work as `partita compare NAME --work-precision` draws it; `short`: two formulations, two runs."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.png"
    if short:
        compared(name, **SHORT).work_precision(tolerances).plot(path)
    else:
        compared(name, selections=["collective"]).work_precision().plot(path)


if __name__ == "__main__":
    main()
