"""xarray: labelled arrays in memory, and what NetCDF and Zarr store."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extras import extra
from ..files import Allowance
from ..result_view import ResultView
from .certificate import Certificate
from .content import Content, content_of, header_within
from .record import read_exact

if TYPE_CHECKING:
    import xarray

TIME = "t"
"""The axis, and the coordinate along it, as everywhere."""
LONGEST = 20_000
"""Letters of an attribute: HDF5 holds no more than 64 kB in one."""


def to_xarray(result: ResultView) -> xarray.Dataset:
    """See `Result.to_xarray`."""
    extra("xarray", "xarray", "to_xarray")
    return dataset(content_of(result))


def dataset(content: Content) -> xarray.Dataset:
    """Every array with its axes, `units` and `long_name`; labels as coordinates; events; model and account as texts."""
    xarray = extra("xarray", "xarray", "a dataset")
    header = content.header()
    account = header["account"]
    plain = read_exact(account)
    variables: dict[str, Any] = {
        v.name: ([TIME, *v.axes[1:]], v.values, _attributes(v.unit, v.text)) for v in content.variables if v.name != "t"
    }
    about = "the mechanism as built, as JSON"
    variables["model"] = ((), _text(account["spec"]), {"long_name": about})
    header["account"] = {key: value for key, value in account.items() if key != "spec"}
    about = "provenance of the result and description of its arrays, as JSON"
    variables["account"] = ((), _text(header), {"long_name": about})
    t = next(v for v in content.variables if v.name == "t")
    labels: dict[str, Any] = {TIME: (TIME, t.values, _attributes(t.unit, t.text))}
    variables |= _events(plain["events"].get("records", ()))
    for axis in content.axes.values():
        if len(set(axis.labels)) == len(axis.labels):
            labels[axis.name] = (axis.name, np.array(axis.labels, dtype=str))
            if any(axis.units):
                labels[f"{axis.name}_unit"] = (axis.name, np.array(axis.units, dtype=str))
    attributes = {
        "Conventions": "CF-1.8",
        "title": str(plain["summary"].get("name") or "system"),
        "source": f"partita {plain['version']}",
        "status": plain["status"],
        "message": plain["message"][:LONGEST],
        "settings": json.dumps(account["options"])[:LONGEST],
        "certificate": str(Certificate.from_account(plain["certificate"]))[:LONGEST],
    }
    return xarray.Dataset(variables, coords=labels, attrs=attributes)


def _events(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """A table of the events, which readers may use; `as_header` reads the account, which has their states too."""
    if not records:
        return {}
    columns = {
        "event_t": ("t", float, _attributes("s", "time of the event")),
        "event_name": ("name", str, {"long_name": "name of the event"}),
        "event_direction": ("direction", int, {"long_name": "1 where it rises through the value, -1 where it falls"}),
    }
    return {
        name: ("event", np.array([record[key] for record in records], dtype=kind), about)
        for name, (key, kind, about) in columns.items()
    }


def as_header(found: xarray.Dataset, room: Allowance) -> tuple[dict[str, Any], dict[str, Any]]:
    """Header and arrays of a dataset made by `dataset`."""
    account, model = (str(found[name].values[()]) for name in ("account", "model"))
    for text in (account, model):
        room.text(text.encode())
    header = header_within(room, account)
    header["account"]["spec"] = read_exact(model)
    # sizes first: a damaged file must not make room for numbers that it does not have
    for name, about in header["arrays"].items():
        if list(found[name].shape) != about["shape"]:
            raise ValueError(f"the shape of {name} differs from its description")
    return header, {name: found[name].values for name in header["arrays"]}


def unfilled(found: xarray.Dataset) -> dict[str, dict[str, Any]]:
    """Encoding for files: no number represents a missing one."""
    return {str(name): {"_FillValue": None} for name in found.variables}


def _text(value: Any) -> Any:
    return np.array(json.dumps(value, separators=(",", ":")))


def _attributes(unit: str, text: str) -> dict[str, str]:
    return {"units": unit, "long_name": text} if unit else {"long_name": text}
