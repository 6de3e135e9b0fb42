"""NetCDF (classic format, 64-bit offsets): what oceans of tools read, written with SciPy alone."""

from __future__ import annotations

import json
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import BLANK, sealed
from ..readable import Readable
from .save_json import VERSION
from .variables import Axis, Variable, axes, variables

if TYPE_CHECKING:
    from scipy import io


def as_netcdf(result: Readable) -> bytes:
    """All arrays, sealed, with `units` and `long_name`; names along an axis `body` stand in `body_name`.

    The format knows no empty dimension, so arrays without columns are left out (the reader puts them
    back), and no booleans or 64-bit integers, which become bytes and 32-bit integers.
    """
    from scipy import io  # slow to import, and few write files

    stream = BytesIO()
    with io.netcdf_file(stream, "w", version=2) as file:
        _describe(file, checksum=BLANK, Conventions="CF-1.8", title=result.title, source="partita")
        _describe(file, partita_result=VERSION, partita_account=json.dumps(result.record.account()))
        stored = [v for v in variables(result) if v.values.size]
        sizes = {name: size for v in stored for name, size in zip(v.axes, v.values.shape, strict=True)}
        for name, size in sizes.items():
            file.createDimension(name, size)
        for axis in axes(result).values():
            if axis.name in sizes:
                _write_axis(file, axis)
        for variable in stored:
            _write_variable(file, variable)
        file.flush()
        content = stream.getvalue()
    return sealed(content)


def _write_variable(file: io.netcdf_file, variable: Variable) -> None:
    values = variable.values
    if values.dtype == bool:
        values = values.astype(np.int8)
    elif values.dtype.kind == "i":
        values = values.astype(np.int32)
    stored = file.createVariable(variable.name, values.dtype, variable.axes)
    stored[:] = values
    _describe(stored, long_name=variable.text)
    if variable.unit:
        _describe(stored, units=variable.unit)


def _write_axis(file: io.netcdf_file, axis: Axis) -> None:
    _write_words(file, f"{axis.name}_name", axis.name, axis.labels, f"names along the axis {axis.name}")
    if any(axis.units):
        _write_words(file, f"{axis.name}_unit", axis.name, axis.units, f"units along the axis {axis.name}")


def _write_words(file: io.netcdf_file, name: str, axis: str, words: tuple[str, ...], text: str) -> None:
    """Words as rows of characters (UTF-8), padded with blanks: the format has no strings."""
    coded = [word.encode("utf-8") for word in words]
    width = max(1, *map(len, coded))
    rows = np.frombuffer(b"".join(word.ljust(width) for word in coded), dtype="S1").reshape(len(words), width)
    file.createDimension(f"{name}_length", width)
    stored = file.createVariable(name, "c", (axis, f"{name}_length"))
    stored[:] = rows
    _describe(stored, long_name=text)


def _describe(target: Any, **attributes: str | int) -> None:
    """Set attributes; texts in UTF-8, and a blank for an empty one, which the format cannot hold."""
    for name, value in attributes.items():
        setattr(target, name, np.int32(value) if isinstance(value, int) else value.encode("utf-8") or b" ")
