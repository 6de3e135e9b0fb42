"""Writing a result to a file, by the ending of its name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ..errors import FileFormatError
from ..files import put, target
from ..readable import Readable
from .save_json import as_json
from .save_mat import as_mat
from .save_netcdf import as_netcdf
from .save_table import as_csv, as_parquet

WRITERS: dict[str, Callable[[Readable], bytes]] = {
    ".nc": as_netcdf,
    ".parquet": as_parquet,
    ".csv": as_csv,
    ".mat": as_mat,
    ".json": as_json,
}


def checked_path(path: str | os.PathLike[str]) -> Path:
    """`path` when a result can be written there: known ending, existing folder. See `Result.save`."""
    where = target(path)
    if where.suffix.lower() not in WRITERS:
        raise FileFormatError(
            f"cannot save to {str(where)!r}: the ending {where.suffix!r} is not known; use one of {', '.join(WRITERS)}",
            path=str(where),
            line=None,
        )
    return where


def save(result: Readable, path: str | os.PathLike[str]) -> Path:
    """Write `result` to `path`; a file there is replaced only when the new one is complete."""
    where = checked_path(path)
    return put(where, WRITERS[where.suffix.lower()](result))
