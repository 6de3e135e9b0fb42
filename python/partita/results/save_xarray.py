"""xarray: labelled arrays in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..readable import Readable
from .save_table import missing
from .variables import axes, variables

if TYPE_CHECKING:
    import xarray


def to_xarray(result: Readable) -> xarray.Dataset:
    """See `Result.to_xarray`."""
    try:
        import xarray
    except ImportError as error:
        raise missing("xarray", "xarray", "to_xarray") from error
    found = variables(result)
    used = {name for v in found for name in v.axes}
    labels: dict[str, Any] = {"t": ("t", result.t, {"units": "s"})}
    for axis in axes(result).values():
        if axis.name in used and len(set(axis.labels)) == len(axis.labels):
            labels[axis.name] = (axis.name, list(axis.labels))
            if any(axis.units):
                labels[f"{axis.name}_unit"] = (axis.name, list(axis.units))
    return xarray.Dataset(
        {v.name: (v.axes, v.values, _attributes(v.unit, v.text)) for v in found if v.name != "t"},
        coords=labels,
        attrs={"title": result.title, "status": result.status, "message": result.message},
    )


def _attributes(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text} if unit else {"long_name": text}
