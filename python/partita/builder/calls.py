"""From a record back to the call that makes it: the method, and its arguments in SI.

Making the same call again gives the same record, to the last bit: an element can be drawn again with one argument
changed (`changes`), and its arguments can be read by the names with which they were given.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from ..sensing import SensorRecord, uses
from .callbacks import Callback
from .joints import CHOSEN
from .laws import LawCall
from .motion import Motion
from .records import (
    BodyRecord,
    Call,
    CouplingRecord,
    Description,
    DriveRecord,
    ForceRecord,
    JointRecord,
    LoadRecord,
    Ref,
    RotorRecord,
    Solid,
    TorqueRecord,
)
from .sampled import JoinedTable, SampledTable
from .sensors import Expression, Sensor
from .values import BY_DEFAULT, Constant, Function, Table

_BODIES = {"parent", "child", "body", "body1", "body2", "ground"}
_JOINTS = {"joint", "joint1", "joint2", "pulley1", "pulley2", "pinion", "slide"}
"""Arguments that name bodies and joints, in calls and in measures."""


def call_of(record: Any) -> Call:
    """The call that makes a record; default arguments are omitted."""
    match record:
        case BodyRecord(solid=Solid(shape, basis, value)):
            pose = {"position": record.position, "orientation": record.rotation, "gravity": record.gravity}
            return "add_solid", {"shape": shape, basis: value, **pose}
        case BodyRecord(rod=None):
            arguments = {
                "mass": record.mass,
                "inertia": record.inertia,
                "com": record.com,
                "position": record.position,
                "orientation": record.rotation,
            }
            return "add_body", {**arguments, "gravity": record.gravity}
        case BodyRecord(rod=(start, end, _)):
            return "add_rod", {"start": start, "end": end, "mass": record.mass, "gravity": record.gravity}
        case JointRecord():
            return _joint(record)
        case CouplingRecord():
            return record.call
        case DriveRecord():
            return "add_drive", _drive(record)
        case RotorRecord():
            return "add_rotor", {word: getattr(record, word) for word in ("joint", "inertia", "ratio", "coordinate")}
        case TorqueRecord():
            words = ("joint", "coordinate", "over", "periodic", "interpolation")
            value = _given(record.value, record.interpolation)
            return "add_torque", {"value": value, **{word: getattr(record, word) for word in words}}
        case ForceRecord():
            word, given = record.interpolation, record.value
            each = given if isinstance(given, tuple) else ()
            force = _given(given) if isinstance(given, Function) else tuple(_given(item, word) for item in each)
            point = None if record.at_center else record.point
            arguments = {"body": record.body, "force": force, "point": point, "axes": record.axes}
            return "add_force", {**arguments, "interpolation": word}
        case LoadRecord():
            arguments = {word: _given(value) for word, value in record.arguments.items() if value is not None}
            if record.kind == "law":
                arguments["function"] = arguments.pop("value")
                return "add_force_law", arguments
            return f"add_{record.kind}", arguments
        case SensorRecord():
            return "add_sensor", _sensor(record)
    raise TypeError(f"{type(record).__name__} is not an element")


def kind_of(record: Any) -> str:
    """The word for its kind: "rod", "revolute", "spring", "gear", "drive"."""
    if isinstance(record, JointRecord):
        return record.kind
    return call_of(record)[0].removeprefix("add_").replace("_", " ")


def words_of(builder: type, record: Any) -> Mapping[str, Any]:
    """The arguments that the call may have, with their defaults."""
    return _parameters(getattr(builder, call_of(record)[0]))


@cache
def _parameters(method: Callable[..., Any]) -> dict[str, Any]:
    found = inspect.signature(method).parameters.values()
    return {p.name: None if p.default is p.empty else p.default for p in found if p.name not in ("self", "name")}


def references(record: Any) -> Iterator[tuple[str, str]]:
    """Table and name of every element that it refers to; some more than once."""
    if isinstance(record, DriveRecord) and record.arguments is not None and "carrier" in record.arguments:
        yield "joints", record.arguments["carrier"]
    if isinstance(record, SensorRecord):
        yield from (("sensors", name) for name in uses(record))
    yield from _named(call_of(record)[1])


def _named(argument: Any) -> Iterator[tuple[str, str]]:
    match argument:
        case Ref(table, name):
            yield table, name
        case Mapping():
            for word, value in argument.items():
                if isinstance(value, str) and word in _BODIES | _JOINTS | {"on"}:
                    yield "joints" if word in _JOINTS else "bodies", value
                else:
                    yield from _named(value)
        case (str() as body, np.ndarray()):
            yield "bodies", body
        case list() | tuple():
            for item in argument:
                yield from _named(item)


def referring(d: Description, table: str, name: str) -> list[tuple[str, str]]:
    """Table and name of the elements that refer to one, in the order in which they are made."""
    found = []
    for other in ("joints", "couplings", "rotors", "drives", "forces", "sensors"):
        records: Mapping[str, Any] = getattr(d, other)
        found += [(other, own) for own, record in records.items() if (table, name) in references(record)]
    return found


def readers(d: Description, sensor: str) -> list[tuple[str, str]]:
    """Table and name of the forces whose functions call `state.sensor(...)` with this name, as far as their code shows.
    A name that is created while a function runs is reported by the run that does not find it."""
    forces: Mapping[str, Any] = d.forces
    return [
        ("forces", own)
        for own, record in forces.items()
        if any(_says(function, sensor) for function in _functions(call_of(record)[1]))
    ]


def _functions(value: Any) -> Iterator[FunctionType]:
    if isinstance(value, FunctionType):
        yield value
    elif isinstance(value, Mapping | list | tuple):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from _functions(item)


def _says(function: FunctionType, sensor: str) -> bool:
    codes = [function.__code__]
    for code in codes:
        codes += [item for item in code.co_consts if isinstance(item, CodeType)]
    if not any("sensor" in code.co_names for code in codes):
        return False
    around = inspect.getclosurevars(function)
    names = [item for code in codes for item in code.co_consts]
    names += [*around.nonlocals.values(), *around.globals.values(), *(function.__defaults__ or ())]
    return any(isinstance(item, str | Sensor) and str(item) == sensor for item in names)


def _sensor(record: SensorRecord) -> dict[str, Any]:
    data, of = record.data, record.data["of"]
    arguments: dict[str, Any] = {"unit": record.unit, "text": record.text}
    match of:
        case "function":
            return {"of": [Ref("sensors", name) for name in data["sensors"]], "function": record.function, **arguments}
        case "expression":
            return {"of": Expression(data["expression"]), **arguments}
        case "point":
            arguments["of"] = data["body"], np.array(data["point"])
        case "measure":
            arguments["of"] = {"measure": data["measure"]}
        case _:
            arguments["of"] = Ref({"body": "bodies", "joint": "joints"}.get(of, f"{of}s"), data[of])
    arguments |= {
        "reads": data["reads"],
        "coordinate": data.get("coordinate", data.get("body") if of == "force" else None),
    }
    axes = data.get("axes")
    if axes is not None:
        arguments["axes"] = axes if axes in ("world", "joint") else Ref("bodies", axes)
    return arguments


def _joint(record: JointRecord) -> Call:
    arguments: dict[str, Any] = {"parent": record.parent, "child": record.child, "point": record.point}
    if record.kind in CHOSEN:
        arguments["free"] = tuple(direction for direction in record.free if direction not in record.follows)
    if record.follows:
        arguments["follows"] = {direction: _followed(relation.call) for direction, relation in record.follows.items()}
    if record.kind != "orientation":  # whose frame is that of the world
        arguments |= record.geometry
    more = ("child_point", "child_axis", "child_frame", "pitch")
    arguments |= {word: getattr(record, word) for word in more if getattr(record, word) is not None}
    if record.kind != "constant_velocity":
        arguments["cut"] = record.cut
    special = {"generic": "add_joint", "custom": "add_custom_joint"}
    return special.get(record.kind, f"add_{record.kind}"), arguments


def _followed(relation: Any) -> Any:
    """The user function of a dependent direction."""
    return relation.function.law


def _drive(record: DriveRecord) -> dict[str, Any]:
    if record.arguments is not None:
        return {word: value for word, value in record.arguments.items() if word != "carrier"}
    measure = record.measure
    arguments: dict[str, Any] = {"joint": measure}
    if measure["of"] == "joint":
        arguments = {"joint": measure["joint"], "coordinate": measure["coordinate"]}
    motion = record.motion
    arguments[record.level] = _given(motion, record.interpolation, BY_DEFAULT[record.level])
    if isinstance(motion, Function) and isinstance(motion.call, Motion) and record.level == "position":
        arguments |= {"velocity": motion.call.velocity, "acceleration": motion.call.acceleration}
    return {**arguments, "rate": record.rate, "interpolation": record.interpolation}


def _given(value: Any, interpolation: str | None = None, default: str = "monotone") -> Any:
    """A number, a table or a function, as the user gives one beside this word; `default`: how a table is joined
    without one."""
    match value:
        case Constant(number):
            return number
        case Table(times, values, curve):
            if curve == (interpolation or default):
                return times, values
            return SampledTable(times, values) if curve == "spline" else JoinedTable(times, values, curve)
        case Function(call) if isinstance(call, (Callback, LawCall)):
            return call.function
        case Function(call) if isinstance(call, Motion):
            return call.position
    return value
