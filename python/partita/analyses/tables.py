"""A kinematic study as labelled arrays: xarray and pandas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..extras import extra
from ..result_view import MotionView
from ..results.content import Content
from ..results.table import columns
from ..results.variables import Axis, Variable, axes_of_motion, of_motion, sensors

if TYPE_CHECKING:
    import pandas
    import xarray

POSE = "pose"


class StudyView(MotionView, Protocol):
    """A kinematic study as it is stored; `Kinematics` documents each item."""

    @property
    def reached(self) -> NDArray[np.bool_]: ...
    @property
    def margin(self) -> NDArray[np.float64]: ...
    @property
    def goals(self) -> Mapping[Any, NDArray[np.float64]]: ...
    @property
    def notes(self) -> tuple[str, ...]: ...


def to_xarray(k: StudyView) -> xarray.Dataset:
    """See `Kinematics.to_xarray`."""
    xarray = extra("xarray", "xarray", "to_xarray")
    content = _content(k)
    variables: dict[str, Any] = {v.name: ([POSE, *v.axes[1:]], v.values, _about(v)) for v in content.variables}
    labels: dict[str, Any] = {POSE: np.arange(len(k.reached))}
    for key, values in k.goals.items():
        if values.ndim == 1 and str(key) not in variables:
            labels[str(key)] = (POSE, values)
    for axis in content.axes.values():
        labels[axis.name] = (axis.name, np.array(axis.labels, dtype=str))
        if any(axis.units):
            labels[f"{axis.name}_unit"] = (axis.name, np.array(axis.units, dtype=str))
    return xarray.Dataset(variables, coords=labels, attrs={"title": k.title, "notes": "; ".join(k.notes)})


def to_pandas(k: StudyView) -> pandas.DataFrame:
    """See `Kinematics.to_pandas`."""
    pandas = extra("pandas", "pandas", "to_pandas")
    found = columns(_content(k))
    frame = pandas.DataFrame({c.name: c.values for c in found}, index=pandas.RangeIndex(len(k.reached), name=POSE))
    frame.attrs["units"] = {c.name: c.unit for c in found}
    frame.attrs["title"] = k.title
    return frame


def _content(k: StudyView) -> Content:
    own = [
        Variable("reached", k.reached, (POSE,), "1", "1 where the pose was reached on the branch"),
        Variable("margin", k.margin, (POSE,), "1", "0 where the goals do not determine the motion, 1 at best"),
    ]
    found = tuple(_contiguous(v) for v in [*of_motion(k), *own])
    used = {name for v in found for name in v.axes}
    known: dict[str, Axis] = {**axes_of_motion(k), **{axis.name: axis for _, axis in sensors(k) if axis is not None}}
    return Content({"summary": dict(k.summary)}, found, {name: axis for name, axis in known.items() if name in used})


def _contiguous(v: Variable) -> Variable:
    return Variable(v.name, np.ascontiguousarray(v.values), v.axes, v.unit, v.text)


def _about(v: Variable) -> dict[str, str]:
    return {"units": v.unit, "long_name": v.text} if v.unit else {"long_name": v.text}
