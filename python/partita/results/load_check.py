"""Whether a file contains a result: every array of a consistent shape, and names in their places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .partition_log import partition_changes
from .record import Record
from .variables import ACCELERATIONS, DETERMINED, OBSERVED, REACTIONS, RUN

_JOINT_WORDS = ("name", "kind", "parent", "child")
_SENSOR_WORDS = ("name", "variable", "unit", "text")


_NEEDED = {"q": "coordinate", "v": "velocity", "vdot": "velocity", "multipliers": "multiplier", "measure": "velocity"}
"""Arrays that every run has, and what each has entries for."""


def check(record: Record, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise `ValueError` (or an error from malformed data) for the first inconsistency."""
    summary, nt = record.summary, len(record.arrays["t"])
    joints = summary["joints"]
    if "t" not in arrays:
        raise ValueError("there are no times of outputs")
    sizes = {
        "t": nt,
        "coordinate": _names(summary, "coordinates"),
        "velocity": _names(summary, "velocities"),
        "multiplier": int(summary["rows"]),
        "condition": int(summary["rows"]) - int(summary.get("closing_rows", 0)),
        "body": len({str(body["name"]) for body in summary["bodies"]}),
        "joint": len({str(joint["name"]) for joint in joints}),
        "joint_coordinate": sum(int(joint["q"][1]) for joint in joints),
        "joint_freedom": sum(int(joint["v"][1]) for joint in joints),
        "axis": 3,
        "body_axis": 3,
        "joint_axis": 3,
        "component": 6,
    }
    for name, (axes, _, _) in {**RUN, **OBSERVED, **ACCELERATIONS, **REACTIONS}.items():
        _fits(name, arrays, ("t", *axes), sizes)
    for name, axis in _NEEDED.items():
        if nt and sizes[axis] and record.arrays[name].size == 0:
            raise ValueError(f"there is no {name}")
    _spans(joints, sizes)
    first, beyond = int(summary.get("closing_rows", 0)), sizes["multiplier"]
    for rows in (summary.get("drive_rows", ()), *(item["rows"] for item in summary.get("couplings", ()))):
        if not all(first <= row < beyond for row in rows):
            raise ValueError(f"the rows {rows} of drives or couplings are none of {first} to {beyond - 1}")
    if "kinetic" in arrays and len(record.arrays["work"]) != nt:
        raise ValueError("the work is missing")
    for name in DETERMINED:
        _fits(name, arrays, ("t", "joint", "component"), sizes)
    for item in summary.get("sensors", ()):
        if not all(isinstance(item[word], str) for word in _SENSOR_WORDS):
            raise ValueError(f"the sensor {item['name']!r} is not described in words")
        read = arrays.get(item["variable"])
        if read is not None and (read.ndim == 0 or len(read) != nt):
            raise ValueError(f"the sensor {item['name']!r} has the shape {read.shape} for {nt} outputs")
        if read is None and nt:
            raise ValueError(f"the readings of the sensor {item['name']!r} are missing")
    bodies = {"ground", *(body["name"] for body in summary["bodies"])}
    for joint in joints:
        if not all(isinstance(joint[word], str) for word in _JOINT_WORDS):
            raise ValueError(f"the joint {joint['name']!r} is not described in words")
        for word in ("parent", "child"):
            if joint[word] not in bodies:
                raise ValueError(f"the {word} {joint[word]!r:.60} of the joint {joint['name']!r:.60} is no body")
    t = record.arrays["t"]
    if not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
        raise ValueError("the times of the outputs do not increase")
    chosen = record.arrays["independent"]
    if chosen.size and not (chosen.min() >= -1 and chosen.max() < sizes["velocity"]):
        raise ValueError("an independent coordinate is not among the velocities")
    partition_changes(record.partitions, summary["velocities"])
    for event in record.events.get("records", ()):
        shapes = len(event["q"]), len(event["v"])
        if shapes != (sizes["coordinate"], sizes["velocity"]):
            raise ValueError(f"the state of the event {event['name']!r:.60} has {shapes} numbers")
        if event["direction"] not in (1, -1) or not np.isfinite(event["t"]):
            raise ValueError(f"the event {event['name']!r:.60} has no time or no direction")
    if not isinstance(record.success, bool) or not isinstance(record.options, dict):
        raise ValueError("the description of the run has entries of the wrong type")


def _spans(joints: Sequence[Mapping[str, Any]], sizes: Mapping[str, int]) -> None:
    """Positions of a joint's coordinates and velocities among those of all joints and in the state."""
    limits = {"q": "joint_coordinate", "v": "joint_freedom", "state_q": "coordinate", "state_v": "velocity"}
    for joint in joints:
        for key, axis in limits.items():
            if joint[key] is not None and sum(joint[key]) > sizes[axis]:
                raise ValueError(f"{key} of the joint {joint['name']!r} exceeds the number {sizes[axis]} of entries")
        if joint.get("drawn") and joint["v"][1] < 3:
            raise ValueError(f"the joint {joint['name']!r} has axes of rotations that it does not make")


def _names(summary: Mapping[str, Any], key: str) -> int:
    words = summary[key]
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise ValueError(f"{key} are not a list of names")
    return len(words)


def _fits(name: str, arrays: Mapping[str, NDArray[Any]], axes: tuple[str, ...], sizes: Mapping[str, int]) -> None:
    """Shape of an array that exists; arrays without entries are omitted from files."""
    array = arrays.get(name)
    if array is None:
        return
    wanted = tuple(sizes.get(axis) for axis in axes)
    if len(wanted) != array.ndim or any(w not in (None, s) for w, s in zip(wanted, array.shape, strict=True)):
        raise ValueError(f"{name} has the shape {array.shape} instead of {wanted}")
