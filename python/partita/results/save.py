"""Writing a result to a file, by the ending of its name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ..errors import FileFormatError, MissingFileError
from ..readable import Readable
from .save_json import write_json
from .save_mat import write_mat
from .save_netcdf import write_netcdf
from .save_table import write_csv, write_parquet

WRITERS: dict[str, Callable[[Readable, Path], None]] = {
    ".nc": write_netcdf,
    ".parquet": write_parquet,
    ".csv": write_csv,
    ".mat": write_mat,
    ".json": write_json,
}


def checked_path(path: str | os.PathLike[str]) -> Path:
    """`path` when a result can be written there: known ending, existing folder. See `Result.save`."""
    target = Path(path)
    if target.suffix.lower() not in WRITERS:
        raise FileFormatError(
            f"cannot save to {str(target)!r}: the ending {target.suffix!r} is not known; "
            f"use one of {', '.join(WRITERS)}",
            path=str(target),
            line=None,
        )
    if not target.parent.is_dir():
        raise MissingFileError(
            f"cannot save to {str(target)!r}: the folder {str(target.parent)!r} does not exist; make it first",
            path=str(target.parent),
        )
    if target.is_dir():
        raise FileFormatError(
            f"cannot save to {str(target)!r}: it is a folder; give a file", path=str(target), line=None
        )
    return target


def save(result: Readable, path: str | os.PathLike[str]) -> Path:
    """Write `result` beside `path` first and put it in place when complete, so no half file is left."""
    target = checked_path(path)
    draft = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        WRITERS[target.suffix.lower()](result, draft)
        os.replace(draft, target)
    finally:
        draft.unlink(missing_ok=True)
    return target
