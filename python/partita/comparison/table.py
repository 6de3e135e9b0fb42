"""Rows as aligned text, as CSV, and for pandas."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..extras import extra
from ..files import put, target
from .row import Row

if TYPE_CHECKING:
    import pandas

PathLike = str | os.PathLike[str]
CONDITION_NOTE = (
    "cond C_D is in the units of the coordinates, sigma and sqrt(mu) have none; energy is drift over exchange."
)


def _count(value: Any) -> str:
    return "-" if value is None else str(value)


def _small(value: Any) -> str:
    return "-" if value is None else f"{value:.1e}"


def _quality(value: Any) -> str:
    return "-" if value is None else f"{value:.3f}"


def _scaled(factor: float, digits: int) -> Callable[[Any], str]:
    return lambda value: "-" if value is None else f"{factor * value:.{digits}f}"


# heading: (field, how it is written)
COLUMNS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "formulation": ("name", str),
    "status": ("status", str),
    "evals": ("evaluations", _count),
    "steps": ("steps", _count),
    "rejected": ("rejected", _count),
    "switches": ("switches", _count),
    "renewals": ("renewals", _count),
    "|Phi|": ("closure", _small),
    "|Cv+a|": ("velocity_closure", _small),
    "energy": ("energy_drift", _small),
    "error": ("error", _small),
    "cond C_D": ("condition", _small),
    "sigma": ("sigma", _quality),
    "sqrt(mu)": ("sqrt_mu", _quality),
    "us/eval": ("time_per_evaluation", _scaled(1e6, 2)),
    "bare [s]": ("time_without_outputs", _scaled(1.0, 4)),
    "time [s]": ("time", _scaled(1.0, 4)),
}
WORDS = 2
"""Leading columns of words, aligned left; numbers are aligned right."""


def aligned(rows: Sequence[Row]) -> str:
    """The whole table."""
    return grid(list(COLUMNS), [[write(getattr(row, f)) for f, write in COLUMNS.values()] for row in rows], WORDS)


def grid(headings: Sequence[str], cells: Sequence[Sequence[str]], words: int) -> str:
    """Cells under headings, the first `words` columns to the left, the others to the right."""
    lines = [list(headings), *map(list, cells)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(headings))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i < words else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def notes(rows: Sequence[Row]) -> list[str]:
    """Why runs are missing, failed or stopped, one line each."""
    return [f"{row.name}: {row.status}: {row.message}" for row in rows if row.message]


def write_csv(rows: Sequence[Row], path: PathLike) -> Path:
    """One line per row under the names of its fields; unknown values are empty."""
    return write_lines([field.name for field in fields(Row)], [list(asdict(row).values()) for row in rows], path)


def write_lines(headings: Sequence[str], lines: Sequence[Sequence[Any]], path: PathLike) -> Path:
    """Comma-separated values; `MissingFileError` when the folder does not exist."""
    where = target(path)
    file = StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows([["" if value is None else value for value in line] for line in lines])
    return put(where, file.getvalue().encode("utf-8"))


def to_pandas(rows: Sequence[Row], caption: str) -> pandas.DataFrame:
    """See `Comparison.to_pandas`."""
    pandas = extra("pandas", "pandas", "to_pandas")
    frame = pandas.DataFrame([asdict(row) for row in rows], columns=[field.name for field in fields(Row)])
    frame = frame.set_index("name")
    frame.attrs["caption"] = caption
    return frame
