"""A mechanism as a readable TOML text from which the same numbers are read back."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..builder import Builder
from ..builder.checks import Array, Element
from ..builder.poses import Held, PoseFunction, PoseTable
from ..builder.records import (
    DRAWING_TOLERANCE,
    BodyRecord,
    CouplingRecord,
    DriveRecord,
    ForceLike,
    ForceRecord,
    JointRecord,
    LoadRecord,
    TorqueRecord,
)
from ..builder.spec import VERSION
from ..builder.values import BY_DEFAULT, Constant, Cubics, Function, Table, Value
from ..sensing import OF_MOUNTED, SensorRecord
from ..shapes import plain_of

_WIDTH = 110
Entries = dict[str, Any]


def document(mechanism: Builder, folder: Path | None = None) -> str:
    """The text of a file in this folder, or in the working folder: files of meshes are named as seen from there. Raises
    `DescriptionError`, which names the first Python function found."""
    d = mechanism._description
    changing, element = d.changing_gravity, Element("mechanism", d.name)
    gravity = d.gravity if changing is None else _vector(element, changing)
    tolerance = None if d.drawing_tolerance == DRAWING_TOLERANCE else d.drawing_tolerance
    entries = {"partita": VERSION, "name": d.name, "gravity": gravity, "drawing_tolerance": tolerance}
    head = _table("[mechanism]", entries)
    return "\n".join([head, *_tables(mechanism, Path.cwd() if folder is None else folder)])


def _tables(mechanism: Builder, folder: Path) -> Iterator[str]:
    d = mechanism._description
    for body in d.bodies.values():
        kind, entries = _of_body(body, folder)
        yield _table(f"[[{kind}]]", entries)
    for joint in d.joints.values():
        yield _table("[[joint]]", _joint(joint))
    for coupling in d.couplings.values():
        yield _coupling(coupling)
    for joint in d.joints.values():
        if joint.compliance is not None:
            along, about = joint.compliance[:3], joint.compliance[3:]
            yield _table("[[compliance]]", {"joint": joint.name, "translation": along, "rotation": about})
    for rotor in d.rotors.values():
        ratio = None if rotor.ratio == 1.0 else rotor.ratio
        yield _table("[[rotor]]", {**asdict(rotor), "coordinate": rotor.coordinate or None, "ratio": ratio})
    for drive in d.drives.values():
        yield _table("[[drive]]", _drive(drive))
    for force in d.forces.values():
        yield _force(force)
    for sensor in d.sensors.values():
        yield _table("[[sensor]]", _sensor(sensor))


def numbers_of(record: BodyRecord) -> str:
    """The table of a body by its mass and its inertia, whatever it is made of."""
    return _table("[[body]]", _body(record))


def _sensor(record: SensorRecord) -> Entries:
    data = record.data
    of: Entries
    match data["of"]:
        case "function":
            Element("sensor", record.name).fail(
                "it is a Python function, which a file cannot contain; write it as an expression, or keep it in Python"
            )
        case "point":
            of = {"body": data["body"], "point": data["point"]}
        case "expression":
            of = {"expression": data["expression"]}
        case kind:
            of = {kind: data[kind]}
    coordinate = data.get("coordinate") if data["of"] == "joint" else data.get("body") if "force" in data else None
    axes = data.get("axes")
    if axes == (data["body"] if data.get("reads") in OF_MOUNTED else "world"):
        axes = None  # as it is by default
    entries = {"reads": data.get("reads"), "axes": axes, "coordinate": coordinate}
    return {"name": record.name, "of": of, **entries, "unit": record.unit, "text": record.text}


def _of_body(record: BodyRecord, folder: Path) -> tuple[str, Entries]:
    """The table of a body, and its entries."""
    if record.solid is not None:

        def called(file: Path) -> str:
            try:
                return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
            except ValueError:
                Element("body", record.name).fail(
                    f'its mesh "{file}" is on another drive than the model file; put it into the folder of the file'
                )

        of = {record.solid.word: record.solid.value}
        return "solid", {"name": record.name, "shape": plain_of(record.solid.shape, called), **of, **_pose_of(record)}
    return ("body", _body(record)) if record.rod is None else ("rod", _rod(record))


def _body(record: BodyRecord) -> Entries:
    diagonal = np.diag(record.inertia)
    return {
        "name": record.name,
        "mass": record.mass,
        "inertia": diagonal if np.array_equal(record.inertia, np.diag(diagonal)) else record.inertia,
        "com": record.com if np.any(record.com) else None,
        **_pose_of(record),
    }


def _pose_of(record: BodyRecord) -> Entries:
    return {
        "position": record.position if np.any(record.position) else None,
        "orientation": None if np.array_equal(record.rotation, np.eye(3)) else record.rotation,
        "gravity": None if record.gravity else False,
    }


def _rod(record: BodyRecord) -> Entries:
    start, end, _ = record.rod if record.rod is not None else (None, None, 0.0)
    return {
        "name": record.name,
        "start": start,
        "end": end,
        "mass": record.mass,
        "gravity": None if record.gravity else False,
    }


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
        "child_frame": record.child_frame,
        "pitch": record.pitch,
        "cut": None if record.cut == "auto" else record.cut,
    }


def _drive(record: DriveRecord) -> Entries:
    element = Element("drive", record.name)
    what = record.measure
    entries: Entries = {"joint": what}
    if what["of"] == "joint":
        entries = {"joint": what["joint"], "coordinate": what["coordinate"] or None}
    rate = record.rate or None
    if isinstance(record.motion, Held | PoseTable | PoseFunction):
        return {"name": record.name, "joint": what["joint"], "pose": _pose(element, record)}
    return {"name": record.name, **entries, record.level: _value(element, record.motion, record.level), "rate": rate}


def _pose(element: Element, record: DriveRecord) -> Entries:
    """A pose that is held, or a table; a Python function cannot be written."""
    match record.motion:
        case Held(slides, matrix):
            return {**({"position": slides} if record.slides else {}), "orientation": matrix}
        case PoseTable(times, slides, matrices, curve):
            positions = {"positions": slides} if record.slides else {}
            word = {} if curve == BY_DEFAULT["position"] else {"interpolation": curve}
            return {"times": times, **positions, "orientations": matrices, **word}
    element.fail(
        "its pose is a Python function, which a file cannot contain; sample it into a table (times, positions, "
        "orientations) before saving"
    )


def _coupling(record: CouplingRecord) -> str:
    data, word = dict(record.data), {"word": record.word}
    method, arguments = record.call
    if method in ("add_gear", "add_belt", "add_rack", "add_distance"):
        # coordinates that are the default, and an uncrossed belt, are omitted
        entries = {
            key: value or None if key in ("coordinate1", "coordinate2", "crossed") else value
            for key, value in arguments.items()
        }
        length = {"length": data["offset"]} if method == "add_distance" else {}
        return _table(f"[[{method.removeprefix('add_')}]]", {"name": record.name, **entries, **length})
    if method == "add_point_on_curve":
        return _table("[[point_on_curve]]", _on_curve(record, arguments))
    match record.kind:
        case "linear":
            return _table("[[coupler]]", {"name": record.name, "terms": list(record.terms), **data, **word})
        case "curve":
            curve = data["curve"]
            ends = {"follower": record.terms[0], "cam": record.terms[1]}
            law = {"law": {"x": curve.times, "y": curve.values}, "periodic": data["periodic"] or None}
            return _table("[[cam]]", {"name": record.name, **ends, **law, **word})
        case "roll":
            ball, slips = (True if value else None for value in (data["axis"] is None, data["slips"]))
            return _table("[[rolling]]", {"name": record.name, **data, "slips": slips, "ball": ball})
    return str(_value(Element("coupling", record.name), data["function"]))


def _on_curve(record: CouplingRecord, arguments: Mapping[str, Any]) -> Entries:
    """Axes that are the default are omitted."""
    usual = {"origin": (0.0, 0.0, 0.0), "x_axis": (1.0, 0.0, 0.0), "y_axis": (0.0, 1.0, 0.0)}
    entries = {
        key: None if key in usual and np.array_equal(value, usual[key]) else value
        for key, value in arguments.items()
        if key != "curve"
    }
    if "polar" in arguments:
        x, y = arguments["curve"]
    elif record.kind == "curve":
        x, y = record.data["curve"].times, record.data["curve"].values
    else:
        _value(Element(record.word, record.name), record.data["function"])
    return {"name": record.name, **entries, "curve": {"x": x, "y": y}}


def _force(record: ForceLike) -> str:
    element = Element("force", record.name)
    match record:
        case TorqueRecord():
            where = {"name": record.name, "joint": record.joint, "coordinate": record.coordinate or None}
            over = {"over": record.over, "periodic": record.periodic or None}
            return _table("[[torque]]", {**where, "value": _value(element, record.value), **over})
        case ForceRecord():
            force = _vector(element, record.value)
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
        case LoadRecord():
            arguments = {key: _argument(element, value) for key, value in record.arguments.items()}
            return _table(f"[[{record.kind}]]", {"name": record.name, **arguments})


def _argument(element: Element, value: Any) -> Any:
    """The form in which an argument was given."""
    return _value(element, value) if isinstance(value, Constant | Table | Function) else value


def _vector(element: Element, value: Any) -> Any:
    """Three values, or one function for all."""
    return _value(element, value) if isinstance(value, Function) else [_value(element, item) for item in value]


def _value(element: Element, value: Value, level: str = "") -> Any:
    """A number or a table; a Python function cannot be written."""
    match value:
        case Constant():
            return value.value
        case Cubics():
            element.fail("it was made by an integral, which a file cannot contain")
        case Table():
            word = {} if value.curve == BY_DEFAULT.get(level, "monotone") else {"interpolation": value.curve}
            return {"times": value.times, "values": value.values, **word}
        case Function():
            element.fail(
                "it is a Python function, which a file cannot contain; sample it with partita.table(f, start, end) "
                "before saving"
            )


def _table(head: str, entries: Entries) -> str:
    """A table; entries that are None are left out."""
    return "\n".join([head, *(f"{key} = {_text(value)}" for key, value in entries.items() if value is not None), ""])


def _text(value: Any) -> str:
    """A value in TOML. `repr` of a float is the shortest text that gives the same number back."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_text(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | np.ndarray):
        return _list([_text(item) for item in _items(value)])
    return repr(value) if isinstance(value, int) else repr(float(value))


def _items(value: list[Any] | Array) -> list[Any]:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _list(items: list[str]) -> str:
    """On one line if it fits, else wrapped; line breaks are allowed inside lists, even in inline tables."""
    one_line = "[" + ", ".join(items) + "]"
    if len(one_line) <= _WIDTH:
        return one_line
    lines, line = [], ""
    for item in items:
        if line and len(line) + len(item) > _WIDTH:
            lines.append(line)
            line = ""
        line += f"{item}, "
    return "[\n" + "\n".join(f"    {text.rstrip()}" for text in [*lines, line]) + "\n]"
