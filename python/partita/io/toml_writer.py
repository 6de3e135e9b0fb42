"""A mechanism as a TOML text that people can read and that gives the same numbers back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..builder import Builder
from ..builder.checks import Array, Element
from ..builder.records import (
    DRAWING_TOLERANCE,
    BodyRecord,
    DriveRecord,
    ForceLike,
    ForceRecord,
    JointRecord,
    SpringRecord,
    TorqueRecord,
    TorsionSpringRecord,
)
from ..builder.spec import VERSION
from ..builder.values import Constant, Function, Table, Value

_WIDTH = 110
Entries = dict[str, Any]


def document(mechanism: Builder) -> str:
    """The whole file. Raises `DescriptionError` that names the first Python function met."""
    d = mechanism._description
    tolerance = None if d.drawing_tolerance == DRAWING_TOLERANCE else d.drawing_tolerance
    entries = {"partita": VERSION, "name": d.name, "gravity": d.gravity, "drawing_tolerance": tolerance}
    head = _table("[mechanism]", entries)
    return "\n".join([head, *_tables(mechanism)])


def _tables(mechanism: Builder) -> Iterator[str]:
    d = mechanism._description
    for body in d.bodies.values():
        yield _table("[[body]]", _body(body)) if body.rod is None else _table("[[rod]]", _rod(body))
    for joint in d.joints.values():
        yield _table("[[joint]]", _joint(joint))
    for drive in d.drives.values():
        yield _table("[[drive]]", _drive(drive))
    for force in d.forces.values():
        yield _force(force)


def _body(record: BodyRecord) -> Entries:
    diagonal = np.diag(record.inertia)
    return {
        "name": record.name,
        "mass": record.mass,
        "inertia": diagonal if np.array_equal(record.inertia, np.diag(diagonal)) else record.inertia,
        "com": record.com if np.any(record.com) else None,
        "position": record.position if np.any(record.position) else None,
        "orientation": None if np.array_equal(record.rotation, np.eye(3)) else record.rotation,
    }


def _rod(record: BodyRecord) -> Entries:
    start, end, _ = record.rod if record.rod is not None else (None, None, 0.0)
    return {"name": record.name, "start": start, "end": end, "mass": record.mass}


def _joint(record: JointRecord) -> Entries:
    geometry = {
        word: None if word == "frame" and np.array_equal(value, np.eye(3)) else value
        for word, value in record.geometry.items()
    }
    return {
        "name": record.name,
        "type": record.kind,
        "parent": record.parent,
        "child": record.child,
        "point": record.point,
        "free": list(record.free) if record.kind == "generic" else None,
        **geometry,
        "child_point": record.child_point,
        "child_axis": record.child_axis,
        "cut": None if record.cut == "auto" else record.cut,
    }


def _drive(record: DriveRecord) -> Entries:
    element = Element("drive", record.name)
    return {
        "name": record.name,
        "joint": record.joint,
        "coordinate": record.coordinate or None,
        "position": _value(element, record.motion),
    }


def _force(record: ForceLike) -> str:
    element = Element("force", record.name)
    match record:
        case SpringRecord():
            ends = {
                "body1": record.body1,
                "point1": record.point1,
                "body2": record.body2,
                "point2": record.point2,
            }
            law = {"stiffness": record.stiffness, "damping": record.damping or None, "length": record.length}
            return _table("[[spring]]", {"name": record.name, **ends, **law})
        case TorsionSpringRecord():
            where = {"name": record.name, "joint": record.joint, "coordinate": record.coordinate or None}
            law = {
                "stiffness": record.stiffness,
                "damping": record.damping or None,
                "angle": record.angle or None,
            }
            return _table("[[torsion_spring]]", {**where, **law})
        case TorqueRecord():
            where = {"name": record.name, "joint": record.joint, "coordinate": record.coordinate or None}
            return _table("[[torque]]", {**where, "value": _value(element, record.value)})
        case ForceRecord():
            value = record.value
            force = _value(element, value) if isinstance(value, Function) else [_value(element, item) for item in value]
            axes = None if record.axes == "world" else record.axes
            return _table(
                "[[force]]",
                {
                    "name": record.name,
                    "body": record.body,
                    "force": force,
                    "point": record.point,
                    "axes": axes,
                },
            )


def _value(element: Element, value: Value) -> Any:
    """A number or a table; a Python function cannot be written."""
    match value:
        case Constant():
            return value.value
        case Table():
            return {"times": value.times, "values": value.values}
        case Function():
            element.fail(
                "it is a Python function, which a file cannot hold; sample it into a table (times, "
                "values) before saving"
            )


def _table(head: str, entries: Entries) -> str:
    """A table; entries that are None are left out."""
    return "\n".join([head, *(f"{key} = {_text(value)}" for key, value in entries.items() if value is not None), ""])


def _text(value: Any) -> str:
    """A value in TOML. `repr` of a float is the shortest text that gives the same number back."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | np.ndarray):
        return _list([_text(item) for item in _items(value)])
    return repr(value) if isinstance(value, int) else repr(float(value))


def _items(value: list[Any] | Array) -> list[Any]:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _list(items: list[str]) -> str:
    """On one line if it fits, else wrapped; line breaks are allowed inside lists, even in inline tables."""
    flat = "[" + ", ".join(items) + "]"
    if len(flat) <= _WIDTH:
        return flat
    lines, line = [], ""
    for item in items:
        if line and len(line) + len(item) > _WIDTH:
            lines.append(line)
            line = ""
        line += f"{item}, "
    return "[\n" + "\n".join(f"    {text.rstrip()}" for text in [*lines, line]) + "\n]"
