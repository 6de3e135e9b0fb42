"""Writing a result to a file, by the ending of its name."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from ..extras import wanted
from ..files import Allowance, put, put_folder, target
from ..result_view import ResultView
from .content import Content, content_of
from .formats import matlab, netcdf, parquet, text_csv, text_json, zarr_folder


@dataclass(frozen=True)
class Format:
    """Writer and reader of a content, and the packages required besides NumPy and SciPy."""

    name: str
    write: Callable[[Content], Any]
    read: Callable[[Any, Allowance], tuple[dict[str, Any], Any]]
    packages: tuple[str, ...] = ()
    extra: str = ""

    def check(self, doing: str) -> None:
        """`MissingDependencyError` where a package is missing."""
        wanted(self.packages, self.extra, f"{doing} {self.name}")


FORMATS = {
    ".nc": Format("NetCDF", netcdf.write, netcdf.read, netcdf.PACKAGES, "netcdf"),
    ".zarr": Format("Zarr", zarr_folder.write, zarr_folder.read, zarr_folder.PACKAGES, "zarr"),
    ".parquet": Format("Parquet", parquet.write, parquet.read, parquet.PACKAGES, "parquet"),
    ".csv": Format("CSV", text_csv.write, text_csv.read),
    ".mat": Format("MAT", matlab.write, matlab.read),
    ".json": Format("JSON", text_json.write, text_json.read),
}
FOLDER = ".zarr"


def checked_path(path: str | os.PathLike[str]) -> Path:
    """`path` when a result can be written there: known ending, existing folder, packages installed. See
    `Result.save`."""
    where = target(path, folder=FOLDER)
    format_of(where, f"cannot save to {str(where)!r}").check("saving to")
    return where


def format_of(path: Path, failing: str) -> Format:
    """The format given by the ending of `path`; `FileFormatError` where it is not known."""
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise FileFormatError(
            f"{failing}: the ending {ending!r} is not known; use one of {', '.join(FORMATS)}", path=str(path), line=None
        )
    return FORMATS[ending]


def save(result: ResultView, path: str | os.PathLike[str]) -> Path:
    """Write `result` to `path`; a file there is replaced only when the new one is complete."""
    where = checked_path(path)
    written = FORMATS[where.suffix.lower()].write(content_of(result))
    return put_folder(where, written) if isinstance(written, dict) else put(where, written)
