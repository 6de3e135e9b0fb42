"""Tables: one row for each output, one column for each number (CSV, Parquet, pandas)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..numeric import shown
from ..result_view import ResultView
from ..units import convert
from .content import TYPES, Content, content_of

if TYPE_CHECKING:
    import pandas

TITLES = {
    "multipliers": "multiplier",
    "measure": "rho",
    "kinetic": "energy.kinetic",
    "potential": "energy.potential",
    "work": "energy.work",
    "joint_position": "joint.{}.position",
    "joint_velocity": "joint.{}.velocity",
    "joint_acceleration": "joint.{}.acceleration",
    "drive": "joint.{}.drive",
    "force": "joint.{}.force",
    "moment": "joint.{}.moment",
    "joint_point": "joint.{}.point",
    "joint_rotation": "joint.{}.rotation",
    "determined_world": "joint.{}.determined.world",
    "determined_joint": "joint.{}.determined.joint",
    "determined_drive": "joint.{}.determined.drive",
    "determined_effort": "effort.{}.determined",
    "body_position": "body.{}.position",
    "body_velocity": "body.{}.velocity",
    "body_angular_velocity": "body.{}.angular_velocity",
    "body_rotation": "body.{}.rotation",
    "residuals": "body.{}.residual",
}
"""Column name of an array where it differs from the array's name; the other labels follow, separated by points."""

GROUPS = (
    ("t",),
    ("q",),
    ("v",),
    ("vdot",),
    ("multipliers",),
    ("measure",),
    *((name,) for name in ("closure", "velocity_closure", "sigma", "sqrt_mu")),
    *((name,) for name in ("kinetic", "potential", "work")),
    *((name,) for name in ("joint_position", "joint_velocity", "joint_acceleration", "drive", "effort")),
    ("force", "moment"),
    ("body_position", "body_velocity", "body_angular_velocity"),
)
"""The most used arrays, in this order; those of one group are listed together, joint by joint. Others follow."""

TOTAL = "energy.total"
"""A column that is computed from others, for convenience."""

ArrayPart = tuple[str, str, str, tuple[int, ...]]


@dataclass(frozen=True)
class Column:
    """One number over time: its name, its unit ("" where not known) and its nt values."""

    name: str
    unit: str
    values: NDArray[Any]


def columns(content: Content) -> list[Column]:
    """Columns of the table, time first: `q.A`, `v.A`, `joint.A.force.x`, `body.crank.position.x`, ...; of all arrays,
    the most used first."""
    values = {v.name: v.values for v in content.variables}
    return [Column(name, unit, _picked(values, array, at)) for name, unit, array, at in _plan(content.header())]


def column_names(header: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and unit of every column, from the header alone."""
    return [(name, unit) for name, unit, _, _ in _plan(header)]


def gathered(values: Mapping[str, Any], header: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Arrays from the columns of a table, by name."""
    arrays: dict[str, NDArray[Any]] = {}
    for name, about in header["arrays"].items():
        kind = TYPES[about["type"]]
        arrays[name] = np.zeros([int(n) for n in about["shape"]], kind if kind.kind == "i" else float)
    for name, _, array, at in _plan(header):
        if array != TOTAL:
            arrays[array][_column(at)] = values[name]
    return arrays


def _picked(values: Mapping[str, NDArray[Any]], array: str, at: tuple[int, ...]) -> NDArray[Any]:
    if array == TOTAL:
        return values["kinetic"] + values["potential"]
    return values[array][_column(at)]


def _column(at: tuple[int, ...]) -> Any:
    """The index in an array of the item `at` after the time axis."""
    return (slice(None), *at)


def _plan(header: Mapping[str, Any]) -> list[ArrayPart]:
    """Name, unit, array and place in it of every column."""
    arrays = header["arrays"]
    present = [[name for name in group if name in arrays] for group in GROUPS]
    known = {name for group in present for name in group}
    plan: list[ArrayPart] = []
    sensors = header["account"]["summary"].get("sensors", ())
    titles = {item["variable"]: f"sensor.{item['name']}" for item in sensors}
    for group in [*present, *([name] for name in arrays if name not in known)]:
        plan += _together([list(_columns_of(name, header, titles.get(name))) for name in group])
        if group == ["potential"] and "kinetic" in arrays:
            plan.append((TOTAL, "J", TOTAL, ()))
    return _distinct(plan)


def _columns_of(name: str, header: Mapping[str, Any], title: str | None) -> Iterator[ArrayPart]:
    """Columns of one array; `title` is the first word of each where it is a sensor's."""
    about = header["arrays"][name]
    along = about["axes"][1:]
    pattern = TITLES.get(name, name) if title is None else ""
    units = _units(name, about, header)
    for at in itertools.product(*(range(n) for n in about["shape"][1:])):
        labels = [str(header["axes"][axis]["labels"][i]) for axis, i in zip(along, at, strict=True)]
        inside = pattern.count("{}")
        words = [title or pattern.format(*labels[:inside]), *labels[inside:]]
        yield ".".join(words), units[at[0]] if units else about["unit"], name, at


def _units(name: str, about: Mapping[str, Any], header: Mapping[str, Any]) -> list[str]:
    """Units of the columns where they differ along the first axis."""
    if about["unit"] or len(about["axes"]) < 2:
        return []
    units: list[str] = list(header["axes"][about["axes"][1]]["units"])
    if name in ("vdot", "joint_acceleration"):
        return [f"{unit}^2" if unit else "" for unit in units]
    if name == "drive":
        return ["N" if unit == "m/s" else "N m" for unit in units]
    return units


def _together(found: Sequence[list[ArrayPart]]) -> list[ArrayPart]:
    """Columns of several arrays over the same axis, one joint or body after the other."""
    if len(found) < 2:
        return [column for group in found for column in group]
    count = 1 + max((at[0] for group in found for *_, at in group), default=-1)
    return [column for i in range(count) for group in found for column in group if column[3][0] == i]


def _distinct(plan: list[ArrayPart]) -> list[ArrayPart]:
    """The same with every name once: conditions may share a name, and a joint's may be made to look like another's."""
    seen: dict[str, int] = {}
    apart = []
    for name, unit, array, at in plan:
        seen[name] = seen.get(name, 0) + 1
        apart.append((name if seen[name] == 1 else f"{name} ({seen[name]})", unit, array, at))
    return apart


def to_pandas(result: ResultView, units: Mapping[str, str] | None = None) -> pandas.DataFrame:
    """See `Result.to_pandas`."""
    pandas = extra("pandas", "pandas", "to_pandas")
    wanted = units if units is not None else {}
    if not isinstance(wanted, Mapping):
        raise ArgumentError(f"units must be a mapping such as {{'rad': 'deg'}}, not {shown(units)}", argument="units")
    for unit, other in wanted.items():
        convert(1.0, unit, other)
    found = columns(content_of(result))
    known = {c.unit for c in found}
    if missing := [unit for unit in wanted if unit not in known]:
        raise ArgumentError(
            f"units: no column is in {missing[0]!r}; there are {', '.join(sorted(known - {''}))}", argument="units"
        )
    found = [
        Column(c.name, wanted[c.unit], np.asarray(convert(c.values, c.unit, wanted[c.unit]))) if c.unit in wanted else c
        for c in found
    ]
    frame = pandas.DataFrame({c.name: c.values for c in found[1:]}, index=pandas.Index(found[0].values, name="t"))
    frame.attrs["units"] = {c.name: c.unit for c in found}
    frame.attrs["title"] = result.title
    return frame
