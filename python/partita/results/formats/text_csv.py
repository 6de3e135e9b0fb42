"""CSV: one row for each output, for spreadsheets and everything else."""

from __future__ import annotations

import csv
from io import StringIO
from typing import Any

from ...files import BLANK, sealed
from ..content import Content, read_header
from ..table import column_names, columns, gathered

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


def read(content: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    before = csv.field_size_limit(len(content) + 1)
    try:
        titles, *rows = csv.reader(StringIO(content.decode("utf-8"), newline=""))
    finally:
        csv.field_size_limit(before)
    header = read_header(rows[0][-1])
    outputs = [row for row in rows if row[0]]
    units = column_names(header)
    if titles != [*(_titled(name, unit) for name, unit in units), ACCOUNT]:
        raise ValueError("its columns differ from its description")
    numbers = [[float(entry) for entry in row[:-1]] for row in outputs]
    values = {name: [row[i] for row in numbers] for i, (name, _) in enumerate(units)}
    return header, gathered(values, header)


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def _written(value: Any) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)
