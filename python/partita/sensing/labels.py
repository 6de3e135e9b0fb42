"""Units and long names of sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..naming import joint_units
from .records import READS, Data, SensorRecord

_EFFORTS = {"m": "N", "rad": "N m"}
_PER_TIME = {"position": "", "velocity": "/s", "acceleration": "/s^2"}


def unit_of(record: SensorRecord, sensors: Mapping[str, SensorRecord], joints: Sequence[Mapping[str, Any]]) -> str:
    """The unit of a sensor's readings; "" where its columns differ or it is unknown."""
    if record.unit is not None:
        return record.unit
    data = record.data
    if data["of"] == "expression":
        return _unit_of_tree(data["expression"], lambda name: unit_of(sensors[name], sensors, joints))
    if data["of"] == "function":
        return ""
    unit = READS[data.get("form", data["of"])][data["reads"]]
    if unit:
        return unit
    per_second = _PER_TIME.get(data["reads"])
    along = data if data["of"] == "joint" else data.get("measure")
    if along is None:
        return ""
    kind = _kind(along, joints)
    if per_second is None:
        return _EFFORTS.get(kind, "")
    return f"{kind}{per_second}" if kind not in ("", "1") else kind if not per_second else f"1{per_second}" * bool(kind)


def _kind(measure: Data, joints: Sequence[Mapping[str, Any]]) -> str:
    """ "m", "rad", "1" or "" where coordinates differ."""
    if measure["of"] != "joint":
        return "1" if measure["of"] == "cosine" else "m"
    about = next(joint for joint in joints if joint["name"] == measure["joint"])
    q_units, v_units = joint_units(about)
    units = q_units if measure.get("reads") == "position" else v_units
    i = measure.get("coordinate")
    if i is not None:
        return units[i] if i < len(units) else ""
    return units[0] if len(set(units)) == 1 else ""


def _unit_of_tree(tree: Any, unit: Callable[[str], str]) -> str:
    if isinstance(tree, str):
        return unit(tree)
    if not isinstance(tree, list | tuple):
        return "1"
    parts = [_unit_of_tree(part, unit) for part in (tree[1:2] if tree[0] == "component" else tree[1:])]
    if tree[0] in ("norm", "component"):
        return parts[0]
    if tree[0] == "sum":
        return parts[0] if len(set(parts)) == 1 else ""
    if "" in parts:
        return ""
    if tree[0] == "quotient":
        return parts[0] if parts[1] == "1" else f"{parts[0]}/({parts[1]})" if " " in parts[1] else "/".join(parts)
    named = [part for part in parts if part != "1"]
    return " ".join(named) or "1"


def text_of(record: SensorRecord) -> str:
    """The readings of a sensor, in words."""
    if record.text is not None:
        return record.text
    data, of = record.data, record.data["of"]
    if of == "expression":
        return _text_of_tree(data["expression"])
    if of == "function":
        return f"function of {', '.join(data['sensors'])}"
    axes = data.get("axes", "world")
    along = ""
    if (of in ("point", "body") and data["reads"] != "rotation") or axes != "world":
        along = f", {axes} axes"
    what = {
        "point": lambda: f"point ({', '.join(f'{x:g}' for x in data['point'])}) of {data['body']}",
        "body": lambda: f"body {data['body']}",
        "joint": lambda: (
            f"joint {data['joint']}" + ("" if data.get("coordinate") is None else f".{data['coordinate']}")
        ),
        "measure": lambda: data["measure"]["of"],
        "force": lambda: str(data["force"]),
        "drive": lambda: f"drive {data['drive']}",
        "coupling": lambda: f"coupling {data['coupling']}",
    }[of]()
    return f"{data['reads'].replace('_', ' ')} of {what}{along}"


def _text_of_tree(tree: Any) -> str:
    if not isinstance(tree, list | tuple):
        return str(tree) if isinstance(tree, str) else f"{tree:g}"
    if tree[0] in ("norm", "dot", "component"):
        return f"{tree[0]}({', '.join(map(_text_of_tree, tree[1:]))})"
    sign = {"sum": " + ", "product": " * ", "quotient": " / "}[tree[0]]
    return f"({sign.join(map(_text_of_tree, tree[1:]))})"
