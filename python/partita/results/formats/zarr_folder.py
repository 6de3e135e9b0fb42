"""Zarr: a folder of chunks, for long runs that are read in parts or from object stores; format 2, which all read."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...extras import extra
from ...files import BLANK, Room
from ..content import Content
from ..dataset import as_header, dataset, unfilled

METADATA = ".zmetadata"
"""Of all arrays, gathered."""
PACKAGES = ("xarray", "zarr")


def write(content: Content) -> dict[str, bytes]:
    """The files of the folder by their names: the dataset of `to_xarray` and its seal, not yet put in."""
    import tempfile  # slow to import, and few write folders

    found = dataset(content)
    found.attrs["checksum"] = BLANK  # in text, twice: the second time among the metadata gathered for quick opening
    with tempfile.TemporaryDirectory() as folder:
        found.to_zarr(folder, mode="w", zarr_format=2, consolidated=True, encoding=unfilled(found))
        root = Path(folder)
        return {p.relative_to(root).as_posix(): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def read(folder: Path, room: Room) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    room.text((folder / METADATA).read_bytes())
    for name, about in json.loads((folder / METADATA).read_bytes())["metadata"].items():
        if name.endswith(".zarray"):
            shapes = [[int(size) for size in about[key]] for key in ("shape", "chunks")]
            room.take(max(math.prod(map(abs, shape)) for shape in shapes) * np.dtype(about["dtype"]).itemsize)
    xarray = extra("xarray", "zarr", "reading Zarr")
    with xarray.open_zarr(folder, chunks=None, consolidated=True) as found:
        return as_header(found, room)
