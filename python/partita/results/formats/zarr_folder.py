"""Zarr: a folder of chunks, for long runs that are read in parts or from object stores; format 2, which all read."""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ...extras import extra
from ...files import BLANK, Allowance
from ..content import Content
from ..dataset import as_header, dataset, unfilled

LEVEL = 5
METADATA = ".zmetadata"
"""Of all arrays, gathered."""
PACKAGES = ("xarray", "zarr")


def write(content: Content) -> dict[str, bytes]:
    """The files of the folder by their names: the dataset of `to_xarray` and its seal, not yet put in."""
    import tempfile  # slow to import, and few write folders

    found = dataset(content)
    found.attrs["checksum"] = BLANK  # in text, twice: the second time among the metadata gathered for quick opening
    with tempfile.TemporaryDirectory() as folder:
        # zlib: what is damaged is an error there, and in Blosc may end the process
        packed = {"compressors": [extra("numcodecs", "zarr", "saving to Zarr").Zlib(LEVEL)]}
        encoding = {name: {**about, **packed} for name, about in unfilled(found).items()}
        found.to_zarr(folder, mode="w", zarr_format=2, consolidated=True, encoding=encoding)
        root = Path(folder)
        return {p.relative_to(root).as_posix(): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def read(folder: Path, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    room.text((folder / METADATA).read_bytes())
    for name, about in json.loads((folder / METADATA).read_bytes())["metadata"].items():
        if name.endswith(".zarray"):
            _check(folder / name.rpartition("/")[0], about, room)
    xarray = extra("xarray", "zarr", "reading Zarr")
    with xarray.open_zarr(folder, chunks=None, consolidated=True) as found:
        return as_header(found, room)


def _check(folder: Path, about: dict[str, Any], room: Allowance) -> None:
    """Refuse an array that is packed by what does not bear damage, or whose chunks unpack to more than they are for."""
    kind = np.dtype(about["dtype"])
    if about["filters"] or about["compressor"] not in (None, {"id": "zlib", "level": LEVEL}) or kind.hasobject:
        raise ValueError(f"the array {folder.name} is not packed as results are")
    whole, chunk = (math.prod(abs(int(size)) for size in about[key]) * kind.itemsize for key in ("shape", "chunks"))
    room.take(max(whole, chunk))
    for part in folder.iterdir() if about["compressor"] else ():
        if not part.name.startswith("."):
            inflate = zlib.decompressobj()
            size = len(inflate.decompress(part.read_bytes(), chunk + 1))
            if size != chunk or not inflate.eof:
                raise ValueError(f"a chunk of {folder.name} has {size} bytes instead of {chunk}")
