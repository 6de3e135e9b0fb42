"""CSV: one row for each output, for spreadsheets and everything else."""

from __future__ import annotations

import csv
from array import array
from io import BytesIO, StringIO, TextIOWrapper
from itertools import chain
from typing import Any

import numpy as np

from ...files import BLANK, Allowance, sealed
from ..content import Content, header_within
from ..table import column_names, columns, gathered

_PER_ENTRY = 66
"""Bytes of memory of a short text in a list."""
ACCOUNT = "partita"
"""The last column: its first entry holds the description, the others are empty."""


def write(content: Content) -> bytes:
    """Comma separated, one header line with units in brackets, numbers to full precision; sealed."""
    found = columns(content)
    file = StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([*(_titled(c.name, c.unit) for c in found), ACCOUNT])
    rows = [list(map(_written, row)) for row in zip(*(c.values.tolist() for c in found), strict=True)]
    for i, row in enumerate(rows or [[""] * len(found)]):
        writer.writerow([*row, "" if i else content.text(checksum=BLANK)])
    return sealed(file.getvalue().encode("utf-8"))


def read(content: bytes, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    room.take(_PER_ENTRY * max((line.count(b",") for line in BytesIO(content)), default=0), "its longest line")
    before = csv.field_size_limit(len(content) + 1)
    try:
        rows = csv.reader(TextIOWrapper(BytesIO(content), "utf-8", newline=""))
        titles, first = next(rows), next(rows)
        room.text(first[-1].encode())
        header = header_within(room, first[-1])
        units = column_names(header)
        if titles != [*(_titled(name, unit) for name, unit in units), ACCOUNT]:
            raise ValueError("its columns differ from its description")
        numbers = array("d")
        for row in chain([first], rows):
            if len(row) != len(titles):
                raise ValueError(f"a line has {len(row)} entries instead of {len(titles)}")
            if row[0]:
                numbers.extend(map(float, row[:-1]))
    finally:
        csv.field_size_limit(before)
    table = np.frombuffer(numbers, dtype=float).reshape(-1, len(units)) if numbers else np.zeros((0, len(units)))
    return header, gathered({name: table[:, i] for i, (name, _) in enumerate(units)}, header)


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def _written(value: Any) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)
