"""The page docs/compare.md: its tables are those of `partita compare`, its figures are drawn with the pages.

The front page has some rows and columns of one of them.

python tools/compare_page.py --write    run the comparisons anew and put their tables on the page

Costs differ from machine to machine and from run to run, so the tables are not rewritten with the pages. Which rows and
columns they have, and how each run ended, does not differ: the tests hold that against a fresh run.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from partita import Mechanism, catalogue
from partita.comparison import Comparison
from partita.comparison.table import grid

FRONT = Path(__file__).parents[1] / "README.md"
PAGE = FRONT.parent / "docs" / "compare.md"
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
    PAGE.write_text(BLOCK.sub(lambda part: f"{part[1]}{TABLES[part[2]].compare()}\n{part[4]}", text), encoding="utf-8")
    FRONT.write_text(front(), encoding="utf-8")


@dataclass(frozen=True)
class CompareCase:
    """A table: a mechanism with its start, and the arguments of `compare`."""

    name: str
    coordinates: str = "relative"
    duration: float | None = None
    mechanism: Callable[[], Mechanism] | None = None
    """Where the catalogue has none of that name."""
    stabilised: bool = True
    """Whether the loops are to be closed after Baumgarte, too. It takes thousands of steps."""

    def compare(self, **options: Any) -> Comparison:
        """What `partita compare NAME` prints, with the coordinates and with what rows need that ask for it."""
        if self.mechanism is not None:
            m, duration = self.mechanism(), self.duration or 1.0
            start = m.assemble(coordinates=self.coordinates)
        else:
            entry = catalogue.entry(self.name)
            m, duration = entry.mechanism(), self.duration or entry.duration
            start = entry.initial(m)
            if self.coordinates != "relative":
                start = m.convert(start, self.coordinates)
        # a twentieth of the run to look back over, and loops that close two hundred times in it
        rates = (200.0 / duration, 200.0 / duration) if self.stabilised else None
        given = {"window": duration / 20.0, "baumgarte": rates}
        found: Comparison = m.compare(duration, initial=start, coordinates=self.coordinates, **{**given, **options})
        return found


def rod() -> Mechanism:
    """A rod let go at 2.2 rad from the way down: on its way it lies level, and hangs."""
    m = Mechanism("rod pendulum", gravity=(0.0, -9.81, 0.0))
    end = (math.sin(2.2), -math.cos(2.2), 0.0)
    m.add_revolute("A", m.ground, m.add_rod("rod", start=(0.0, 0.0, 0.0), end=end, mass=2.0), point=(0.0, 0.0, 0.0))
    return m


TABLES = {
    "four-bar": CompareCase("four-bar"),
    "reference-four-bar": CompareCase("reference-four-bar", "absolute"),
    "rod-pendulum": CompareCase("rod-pendulum", "absolute", duration=5.0, mechanism=rod),
    "three-rrr": CompareCase("three-rrr", duration=3.0),
    "rssr": CompareCase("rssr"),
    "n-four-bar": CompareCase("n-four-bar", stabilised=False),
    "andrews-squeezer": CompareCase("andrews-squeezer"),
    "bennett": CompareCase("bennett", duration=2.0),
    "bricard": CompareCase("bricard", duration=2.0),
    "exechon-like": CompareCase("exechon-like", duration=2.0),
    "scissor-lift": CompareCase("scissor-lift", duration=2.0),
    "delta": CompareCase("delta", duration=2.0),
}


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
    indices = [headings.index(column) for column in COLUMNS]
    named = {row[0]: row for row in cells if len(row) == len(headings)}
    return grid(COLUMNS, [[named[name][index] for index in indices] for name in ROWS], 1)


def outline(text: str) -> dict[str, Any]:
    """What of a table is the same everywhere: caption, columns, rows with their ends, notes without their numbers."""
    caption, *lines = text.strip().splitlines()
    rule = next(index for index, line in enumerate(lines) if set(line) == {"-", " "})
    cells = [re.split(r" {2,}", line) for line in lines]
    rows = next(index for index, line in enumerate(lines) if line.startswith("cond C_D"))
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
        TABLES[name].compare(**SHORT).work_precision(tolerances).plot(path)
    else:
        TABLES[name].compare(selections=["collective"]).work_precision().plot(path)


if __name__ == "__main__":
    main()
