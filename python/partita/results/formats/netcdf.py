"""NetCDF 4: read by xarray, MATLAB, Panoply and the tools of the geosciences; an HDF5 file with named axes."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np

from ...extras import extra
from ...files import BLANK, Allowance, sealed
from ..content import Content
from ..dataset import as_header, dataset, unfilled

PACKAGES = ("xarray", "h5py", "h5netcdf")


def write(content: Content) -> bytes:
    """The dataset of `to_xarray`, and its seal: an array of bytes, which HDF5 itself does not check."""
    found = dataset(content)
    found["checksum"] = ((), np.array(BLANK.encode()))
    stream = BytesIO()
    found.to_netcdf(stream, engine="h5netcdf", encoding=unfilled(found))
    return sealed(bytes(stream.getbuffer()))


def read(content: bytes, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays."""
    h5py = extra("h5py", "netcdf", "reading NetCDF")
    with h5py.File(BytesIO(content)) as file:
        for item in file.values():  # before anything is read: a coordinate is so by opening alone
            if isinstance(item, h5py.Dataset):
                room.take((item.size or 0) * item.dtype.itemsize)
    xarray = extra("xarray", "netcdf", "reading NetCDF")
    with xarray.open_dataset(BytesIO(content), engine="h5netcdf") as found:
        return as_header(found, room)
