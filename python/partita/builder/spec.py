"""From the records to the description that the core compiles (version 1): plain lists and numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from typing import Any

import numpy as np

from ..products import norm
from ..sensing import Senses
from ..shapes import drawn, has_mesh, plain_of
from ..state import Layout
from .bodies import to_world
from .integrals import rate_of
from .joints import CHOSEN, scalars
from .motion import Motion
from .poses import Held, PoseFunction, PoseTable, PoseValue, slide_of, turning_of
from .records import (
    GROUND,
    BodyRecord,
    CouplingRecord,
    Description,
    DriveRecord,
    ForceLike,
    ForceRecord,
    JointRecord,
    LoadRecord,
    TorqueRecord,
)
from .values import Constant, Cubics, Function, Table, Value

VERSION = 1
# Joints keep the user's word for their direction; the core calls each of these "axis".
_AXIS_WORDS = {"axis": "axis", "normal": "axis", "axis1": "axis", "axis2": "axis2", "frame": "frame"}


class Writer:
    """Writes one description; collects the Python functions in it."""

    def __init__(self, description: Description, layout: Layout) -> None:
        self.description, self.layout = description, layout
        self.functions: list[Any] = []
        self.notes: list[list[str]] = []

    def spec(self) -> dict[str, Any]:
        """The whole description."""
        lists = {name: list(records) for name, records in self._lists().items()}
        return {**self._head(), **lists}

    def text(self) -> str:
        """The same as JSON, written record by record: of many thousands only one at a time exists as plain data."""
        lists = (f"{json.dumps(name)}: [{', '.join(map(json.dumps, items))}]" for name, items in self._lists().items())
        return f"{json.dumps(self._head())[:-1]}, {', '.join(lists)}}}"

    def _head(self) -> dict[str, Any]:
        d = self.description
        return {
            "partita": VERSION,
            "name": d.name,
            "gravity": d.gravity.tolist(),
            "drawing_tolerance": d.drawing_tolerance,
            **self._sights(),
        }

    def _sights(self) -> dict[str, Any]:
        """Quantities that functions of the state read for their sensors; nothing where there are none."""
        d = self.description
        if not d.sensors:
            return {}
        senses = Senses(d.sensors, {name: scalars(record) for name, record in d.joints.items()})
        self.layout.senses = senses
        bodies = [{"body": name} for name in senses.bodies]
        joints = [{"joint": [name, i]} for name, count in senses.joints.items() for i in range(count)]
        return {"sights": bodies + joints}

    def _lists(self) -> dict[str, Iterator[dict[str, Any]]]:
        d = self.description
        return {
            "bodies": map(_body, d.bodies.values()),
            "joints": map(self._joint, d.joints.values()),
            "couplings": map(self._coupling, d.couplings.values()),
            **({"rotors": map(asdict, d.rotors.values())} if d.rotors else {}),
            "drives": chain.from_iterable(map(self._drive, d.drives.values())),
            "forces": chain(map(self._force, d.forces.values()), self._gravity()),
        }

    def _joint(self, record: JointRecord) -> dict[str, Any]:
        point = record.point if record.point is not None else self._origin(record.child, record.parent)
        spec: dict[str, Any] = {
            "name": record.name,
            "kind": record.kind,
            "parent": record.parent,
            "child": record.child,
            "point": point.tolist(),
        }
        for word, value in record.geometry.items():
            spec[_AXIS_WORDS[word]] = value.tolist() if word == "frame" else (value / norm(value)).tolist()
        if record.kind in CHOSEN:
            spec["free"] = [direction for direction in record.free if direction not in record.follows]
        if record.follows:
            relations = {direction: self._value(relation) for direction, relation in record.follows.items()}
            spec["followers"] = [{"direction": direction, **relation} for direction, relation in relations.items()]
        if record.child_point is not None:
            spec["child_point"] = record.child_point.tolist()
        if record.child_axis is not None:
            spec["child_axis"] = (record.child_axis / norm(record.child_axis)).tolist()
        if record.child_frame is not None:
            spec["child_frame"] = record.child_frame.tolist()
        if record.pitch is not None:
            spec["pitch"] = record.pitch
        if record.compliance is not None:
            spec["compliance"] = record.compliance.tolist()
        return {**spec, "cut": record.cut}

    def _origin(self, child: str, parent: str) -> Any:
        """The child's origin as drawn (the parent's where the child is the ground)."""
        return to_world(self.description, parent if child == GROUND else child, np.zeros(3))

    def _coupling(self, record: CouplingRecord) -> dict[str, Any]:
        data = dict(record.data)
        if record.kind == "curve":
            data["curve"] = data["curve"].spec()["table"]
        if record.kind == "function":
            data["function"] = self._value(data["function"])["function"]
        given = {} if record.kind == "roll" else {"word": record.word, "terms": [dict(term) for term in record.terms]}
        return {"kind": record.kind, "name": record.name, **given, **data, **_numbers_of(record)}

    def _drive(self, record: DriveRecord) -> Iterator[dict[str, Any]]:
        """One drive of the core for each driven coordinate."""
        motion = record.motion
        if isinstance(motion, Held | PoseTable | PoseFunction):
            yield from self._pose(record, motion)
            return
        yield {
            "name": record.name,
            "measure": dict(record.measure),
            "motion": self._value(
                _as_cubics(rate_of(motion, record.rate) if record.level == "acceleration" else motion)
            ),
            "level": "position" if record.level == "position" else "velocity",
        }

    def _pose(self, record: DriveRecord, pose: PoseValue) -> Iterator[dict[str, Any]]:
        """The translations, then the three rotations, each a component of the same orientation."""
        found = turning_of(pose)
        turning = self._value(found) if isinstance(found, Function) else found
        for i in range(record.slides + 3):
            yield {
                "name": f"{record.name}, {'slide' if i < record.slides else 'turn'} {i}",
                "measure": {**record.measure, "coordinate": i},
                "motion": self._value(slide_of(pose, i) if i < record.slides else Constant(0.0)),
                "level": "position",
                **({"turning": turning} if i >= record.slides else {}),
            }

    def _gravity(self) -> Iterator[dict[str, Any]]:
        """Elements that are forces of the core: time-dependent gravity, and bodies without gravity."""
        d = self.description
        if d.changing_gravity is not None:
            yield {"kind": "gravity", "name": "gravity", "value": self._plain(d.changing_gravity)}
        for body in d.bodies.values():
            if not body.gravity:
                yield {"kind": "weightless", "name": f"no gravity on {body.name}", "body": body.name}

    def _plain(self, value: Any) -> Any:
        """Numbers and texts, and the values among them, as plain data."""
        if isinstance(value, Constant | Table | Function):
            return self._value(value)
        if isinstance(value, np.ndarray):
            return value.tolist()
        if isinstance(value, tuple | list):
            return [self._plain(item) for item in value]
        return {key: self._plain(item) for key, item in value.items()} if isinstance(value, dict) else value

    def _force(self, record: ForceLike) -> dict[str, Any]:
        match record:
            case TorqueRecord():
                return {
                    "kind": "torque",
                    "name": record.name,
                    "joint": record.joint,
                    "coordinate": record.coordinate,
                    "value": self._value(record.value),
                    **({} if record.over is None else {"over": dict(record.over), "periodic": record.periodic}),
                }
            case ForceRecord():
                value = record.value
                return {
                    "kind": "force",
                    "name": record.name,
                    "body": record.body,
                    "point": record.point.tolist(),
                    "value": self._value(value)
                    if isinstance(value, Function)
                    else [self._value(item) for item in value],
                    "axes": record.axes,
                }
            case LoadRecord():
                entries = {key: self._plain(item) for key, item in record.means.items() if item is not None}
                return {"kind": record.kind, "name": record.name, **entries}

    def _value(self, value: Value) -> dict[str, Any]:
        match value:
            case Constant():
                return {"constant": value.value}
            case Table() | Cubics():
                return value.spec()
            case Function():
                self.notes.append(value.call.notes)
                self.functions.append(value.call.bind(self.layout))
                return {"function": len(self.functions) - 1}


def _as_cubics(motion: Value) -> Value:
    """A function made of cubics, as these cubics."""
    if isinstance(motion, Function) and isinstance(motion.call, Motion):
        return motion.call.cubics() or motion
    return motion


def _body(record: BodyRecord) -> dict[str, Any]:
    return {
        "name": record.name,
        "mass": record.mass,
        "com": record.com.tolist(),
        "inertia": record.inertia.tolist(),
        "position": record.position.tolist(),
        "orientation": record.rotation.tolist(),
        "shape": _shape(record),
    }


def _shape(record: BodyRecord) -> dict[str, Any]:
    """How it looks, where that is known."""
    if record.solid is not None:
        shape = record.solid.shape
        picture = {"drawn": drawn(shape)} if has_mesh(shape) else {}  # whoever reads this may not have its file
        return {"kind": "solid", "form": plain_of(shape), **picture}
    return {"kind": "auto"} if record.rod is None else {"kind": "rod", "length": record.rod[2]}


def _numbers_of(record: CouplingRecord) -> dict[str, Any]:
    """The numbers that define a sum instead of its factors: they are its parameters."""
    match record.call:
        case ("add_gear", {"ratio": number}):
            return {"said": {"ratio": number}}
        case ("add_rack", {"radius": number}):
            return {"said": {"radius": number}}
        case ("add_belt", given):
            return {"said": {"radii": {key: given[key] for key in ("radius1", "radius2", "crossed")}}}
        case ("add_distance", _):
            return {"said": "length"}
        case _:
            return {}
