"""Parquet: a table for pandas, Polars, DuckDB and Spark."""

from __future__ import annotations

from typing import Any

from ...extras import extra
from ...files import BLANK, Allowance, sealed
from ..content import Content, header_within
from ..table import column_names, columns, gathered

PACKAGES = ("pyarrow",)
ACCOUNT = b"partita"


def write(content: Content) -> bytes:
    """One column for each number; a column's unit is in the metadata of its field, the description in those of the
    schema. Sealed, and with checksums of its pages for other readers."""
    pyarrow = extra("pyarrow", "parquet", "saving to Parquet")
    parquet = extra("pyarrow.parquet", "parquet", "saving to Parquet")
    found = columns(content)
    schema = pyarrow.schema(
        [pyarrow.field(c.name, pyarrow.from_numpy_dtype(c.values.dtype), metadata={"unit": c.unit}) for c in found],
        metadata={
            "title": str(content.account["summary"].get("name") or "system"),
            "status": content.account["status"],
            ACCOUNT: content.text(checksum=BLANK),
        },
    )
    table = pyarrow.table([pyarrow.array(c.values) for c in found], schema=schema)
    stream = pyarrow.BufferOutputStream()
    parquet.write_table(table, stream, write_page_checksum=True)
    return sealed(stream.getvalue().to_pybytes())


def read(content: bytes, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    pyarrow = extra("pyarrow", "parquet", "reading Parquet")
    parquet = extra("pyarrow.parquet", "parquet", "reading Parquet")
    file = parquet.ParquetFile(pyarrow.BufferReader(content))
    groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
    room.take(sum(max(group.total_byte_size, 8 * group.num_rows * group.num_columns, 0) for group in groups))
    table = file.read()
    account = table.schema.metadata[ACCOUNT]
    room.text(account)
    header = header_within(room, account.decode("ascii"))
    names = [name for name, _ in column_names(header)]
    if table.column_names != names:
        raise ValueError("its columns differ from its description")
    return header, gathered({name: table.column(name).to_numpy() for name in names}, header)
