"""Actuators by name: coordinates of joints, drives, springs' lines, torques, components of forces."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, UnknownNameError
from ..naming import index_of
from ..numeric import floats, is_list, shown
from ..options import si
from .joints import scalars
from .measures import measure_unit
from .records import (
    Description,
    DriveRecord,
    ForceRecord,
    Handle,
    LoadRecord,
    TorqueRecord,
)

FloatArray = NDArray[np.float64]
_AXES = "xyz"


class Actuator(NamedTuple):
    """One actuator: what its effort acts along, for the core, and units of the effort and of its rate."""

    name: str
    along: list[dict[str, Any]]
    effort: str
    rate: bool = False
    axis: tuple[str, list[float]] | None = None
    silent: tuple[str, int | None] | None = None
    """The force whose given effort it replaces, and the component."""

    @property
    def speed(self) -> str:
        """Unit of the rate along it."""
        return "m/s" if self.effort == "N" else "rad/s"


def actuators_of(d: Description, summary: Mapping[str, Any], wanted: Any) -> list[Actuator]:
    """The requested actuators of a description and the summary of its model; None: its drives."""
    if wanted is None:
        if not d.drives:
            raise ArgumentError(
                "actuators: the mechanism has no drives, so name the actuators: joints or their coordinates, springs, "
                "torques or components of forces, such as actuators=('A', 'C.slide', 'push.x')",
                argument="actuators",
            )
        found = [each for record in d.drives.values() for each in _drive(record, d, summary)]
    else:
        if isinstance(wanted, Handle) or not is_list(wanted):
            raise ArgumentError(
                f"actuators must be a list of names such as ('A', 'C.slide'), not {shown(wanted)}", argument="actuators"
            )
        found = [_one(key, d, summary) for key in wanted]
        if not found:
            raise ArgumentError("actuators is empty; name at least one", argument="actuators")
    names = [each.name for each in found]
    if twice := next((name for i, name in enumerate(names) if name in names[:i]), None):
        raise ArgumentError(f"actuators names {twice!r} twice; name each once", argument="actuators")
    return found


def for_core(description: str, actuators: list[Actuator]) -> tuple[str, list[tuple[int, int | None]]]:
    """The actuators as JSON, and the forces whose efforts they replace, by their numbers in the description (JSON)."""
    plain = [
        {
            "name": each.name,
            "along": each.along,
            "rate": each.rate,
            **({} if each.axis is None else {"axis": each.axis}),
        }
        for each in actuators
    ]
    silent = [each.silent for each in actuators if each.silent is not None]
    numbers = {force["name"]: i for i, force in enumerate(json.loads(description)["forces"])} if silent else {}
    return json.dumps(plain), [(numbers[name], component) for name, component in silent]


def _one(key: Any, d: Description, summary: Mapping[str, Any]) -> Actuator:
    """The actuator of a name or a handle. Joints come before drives, and drives before forces."""
    name = str(key)
    table = key.table if isinstance(key, Handle) else None
    joints = summary["joints"]
    for joint in joints if table in (None, "joints") else ():
        axes, own = joint["axes"], joint["name"]
        if name == own:
            if not axes:
                raise _none(name, "the joint allows no motion")
            if len(axes) > 1:
                known = ", ".join(f"{own}.{axis}" for axis in axes)
                raise _none(name, f"the joint has {len(axes)} coordinates; name one of them: {known}")
            return _coordinate(name, joint, 0, d)
        if len(axes) > 1 and name.startswith(f"{own}.") and name[len(own) + 1 :] in axes:
            return _coordinate(name, joint, axes.index(name[len(own) + 1 :]), d)
    if table in (None, "drives") and name in d.drives:
        found = _drive(d.drives[name], d, summary)
        if len(found) > 1:
            raise _none(name, f"the drive has {len(found)} coordinates; name them: {', '.join(x.name for x in found)}")
        return found[0]._replace(name=name)
    if table in (None, "forces"):
        force, _, component = name.rpartition(".")
        for own, part in ((name, ""), (force, component)):
            if own in d.forces and part in ("", *_AXES):
                return _force(name, d.forces[own], part, d)
    coordinates = [_label(joint, i) for joint in joints for i in range(len(joint["axes"]))]
    try:
        index_of(name, [*coordinates, *d.drives, *d.forces], "actuator")
    except UnknownNameError as error:
        raise UnknownNameError(
            f"actuators: {error.message}; an actuator is a joint with one coordinate, a coordinate such as 'C.slide', "
            "a drive, a spring, a torque, or a component of a force such as 'push.x'",
            **error.fields,
        ) from None
    raise _none(name, "it can exert no effort")


def _none(name: str, why: str) -> ArgumentError:
    return ArgumentError(f"actuators: {name!r} is not an actuator: {why}", argument="actuators")


def _coordinate(name: str, joint: Mapping[str, Any], i: int, d: Description) -> Actuator:
    along = {"of": "joint", "joint": joint["name"], "coordinate": i}
    return Actuator(name, [along], _effort(along, d), rate=i >= scalars(d.joints[joint["name"]]))


def _effort(measure: Mapping[str, Any], d: Description) -> str:
    """Unit of the effort along a measure; of a cosine it is a moment."""
    return "N" if measure_unit(d, measure) == "m" else "N m"


def _drive(record: DriveRecord, d: Description, summary: Mapping[str, Any]) -> list[Actuator]:
    """The actuators in place of a drive: one, or one for each coordinate of a pose."""
    if record.level != "pose":
        along = dict(record.measure)
        if along["of"] == "joint":
            joint = next(x for x in summary["joints"] if x["name"] == along["joint"])
            return [_coordinate(_label(joint, along["coordinate"]), joint, along["coordinate"], d)]
        return [Actuator(record.name, [along], _effort(along, d))]
    joint = next(x for x in summary["joints"] if x["name"] == record.measure["joint"])
    return [_coordinate(_label(joint, i), joint, i, d) for i in range(record.slides + 3)]


def _label(joint: Mapping[str, Any], i: int) -> str:
    return joint["name"] if len(joint["axes"]) == 1 else f"{joint['name']}.{joint['axes'][i]}"


def _force(name: str, record: Any, part: str, d: Description) -> Actuator:
    match record:
        case TorqueRecord() if not part:
            along = {"of": "joint", "joint": record.joint, "coordinate": record.coordinate}
            ball = record.coordinate >= scalars(d.joints[record.joint])
            return Actuator(name, [along], _effort(along, d), rate=ball, silent=(record.name, None))
        case LoadRecord(kind="spring") if not part:
            ends = {"point1": record["point1"].tolist(), "point2": record["point2"].tolist()}
            along = {"of": "distance", "body1": record["body1"], "body2": record["body2"], **ends}
            return Actuator(name, [along], "N")
        case ForceRecord() if part:
            i = _AXES.index(part)
            unit = [[float(i == j) for j in range(3)] for i in range(3)]
            ends = {"body1": "ground", "point1": [0.0] * 3, "body2": record.body, "point2": record.point.tolist()}
            axes = [{"of": "along", **ends, "axis": axis} for axis in unit]
            silent = (record.name, i)
            if record.axes == "world":
                return Actuator(name, [axes[i]], "N", silent=silent)
            return Actuator(name, axes, "N", axis=(record.body, unit[i]), silent=silent)
        case ForceRecord():
            raise _none(name, f"the force has three components; name one of them: {name}.x, {name}.y, {name}.z")
        case LoadRecord(kind="gas_spring" | "torsion_spring") if not part:
            along = {"of": "joint", "joint": record["joint"], "coordinate": record["coordinate"]}
            return Actuator(name, [along], _effort(along, d))
    raise _none(
        name,
        "its force follows from the motion; name the joint that it acts in, or a spring, a torque or a component of a "
        "force",
    )


def numbers(what: str, given: Any, actuators: list[Actuator], units: list[str], missing: float) -> FloatArray:
    """One number for each actuator, from a dict by names; `missing` for those that are not named."""
    found = np.full(len(actuators), missing)
    for i, value in entries(what, given, actuators).items():
        number = _array(what, actuators[i].name, value, units[i])
        if number.shape != ():
            raise ArgumentError(f"{what}[{actuators[i].name!r}] must be a number, not {shown(value)}", argument=what)
        found[i] = float(number)
    return found


def entries(what: str, given: Any, actuators: list[Actuator]) -> dict[int, Any]:
    """Values by the index of their actuator."""
    if not isinstance(given, Mapping):
        raise ArgumentError(f"{what} must be a dict such as {{'A': 1.0}}, not {shown(given)}", argument=what)
    names = [each.name for each in actuators]
    return {index_of(str(key), names, "actuator"): value for key, value in given.items()}


def _array(what: str, name: str, value: Any, unit: str) -> FloatArray:
    try:
        found = floats(si(f"{what}[{name!r}]", value, unit))
    except TypeError as error:
        raise ArgumentError(f"{what}[{name!r}] must be made of numbers, not {shown(value)}", argument=what) from error
    if not np.isfinite(found).all():
        raise ArgumentError(f"{what}[{name!r}] is not finite: {shown(value)}", argument=what)
    return found


def limits_of(given: Any, actuators: list[Actuator]) -> FloatArray | None:
    """(s, 2): lower and upper limit of each effort."""
    if given is None:
        return None
    known = entries("limits", given, actuators)
    if missing := [each.name for i, each in enumerate(actuators) if i not in known]:
        raise ArgumentError(
            f"limits: none is given for {', '.join(missing)}; give one for every actuator", argument="limits"
        )
    found = np.empty((len(actuators), 2))
    for i, value in known.items():
        name = actuators[i].name
        pair = _array("limits", name, value, actuators[i].effort)
        if pair.shape not in ((), (2,)):
            raise ArgumentError(
                f"limits[{name!r}] must be a number (the largest effort either way) or (lower, upper), not "
                f"{shown(value)}",
                argument="limits",
            )
        found[i] = (-float(pair), float(pair)) if pair.shape == () else pair
        if not found[i, 0] < 0.0 < found[i, 1]:
            raise ArgumentError(
                f"limits[{name!r}] = {shown(value)} must leave room for efforts both ways: lower < 0 < upper",
                argument="limits",
            )
    return found


def preload_of(given: Any, actuators: list[Actuator], nt: int) -> FloatArray:
    """(nt, s): efforts to which the least are added."""
    found = np.zeros((nt, len(actuators)))
    for i, value in entries("preload", {} if given is None else given, actuators).items():
        name = actuators[i].name
        array = _array("preload", name, value, actuators[i].effort)
        if array.shape not in ((), (nt,)):
            raise ArgumentError(
                f"preload[{name!r}] has shape {array.shape}; give one number, or one for each of the {nt} times",
                argument="preload",
            )
        found[:, i] = array
    return found


def weights_of(given: Any, actuators: list[Actuator]) -> FloatArray:
    """(s,): weights of the squares."""
    if given is None or isinstance(given, str):
        return np.ones(len(actuators))
    found = numbers("weights", given, actuators, [""] * len(actuators), 1.0)
    for each, weight in zip(actuators, found, strict=True):
        if weight <= 0.0:
            raise ArgumentError(f"weights[{each.name!r}] = {weight:g} must be greater than 0", argument="weights")
    return found
