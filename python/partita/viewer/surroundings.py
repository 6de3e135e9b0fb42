"""What a mechanism meets and what moves it: floors and balls of contacts, tyres, stops, drives, torsion springs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS, NEARLY_ALONG, NEGLIGIBLE
from .motion import Motion

FloatArray = NDArray[np.float64]

MARGIN = 0.12
"""A floor extends so far beyond what moves over it, relative to the size of the mechanism."""
STOP = 0.06
"""Length of the mark of a stop, relative to that size."""


@dataclass
class Surroundings:
    """Pictures of loads; points in axes of the body they move with, -1 the ground."""

    floors: list[dict[str, Any]] = field(default_factory=list)
    """Rectangles of planes that are touched: their corners, their normal towards the free side."""
    parts: list[dict[str, Any]] = field(default_factory=list)
    """Solids beside the shape of a body: balls of contacts, wheels of tyres."""
    stops: list[dict[str, Any]] = field(default_factory=list)
    """Marks across a slide, or rays from a hinge, at which a stop acts."""
    coils: list[int] = field(default_factory=list)
    """Joints with a torsion spring."""
    motors: list[int] = field(default_factory=list)
    """Joints with a drive or an applied torque."""


@dataclass(frozen=True)
class _Plane:
    """A plane on a body, and what moves over it: the path (nt, 3) of a centre in axes of that body, and its radius."""

    body: int
    point: FloatArray
    normal: FloatArray
    path: FloatArray
    radius: float


def surroundings(
    spec: Mapping[str, Any],
    names: Sequence[str],
    joints: Sequence[Mapping[str, Any]],
    coordinates: Mapping[str, FloatArray],
    motion: Motion,
) -> Surroundings:
    """Pictures of the contacts, tyres, stops, torsion springs and drives of a description.

    `coordinates` are the coordinates (nt,) of joints with one, by name.
    """
    found = Surroundings()
    body = {name: i for i, name in enumerate(names)} | {"ground": -1}
    number = {joint["name"]: j for j, joint in enumerate(joints)}
    coms = [np.array(record["com"], dtype=float) for record in spec.get("bodies", ())]
    planes: list[_Plane] = []
    for force in spec.get("forces", ()):
        kind = force.get("kind")
        if kind == "contact":
            planes += _contact(force, body, motion, found)
        elif kind == "tyre":
            planes.append(_tyre(force, body, motion, found))
        elif kind == "stop" and force["joint"] in coordinates:
            found.stops += _stops(
                force, joints[number[force["joint"]]], float(coordinates[force["joint"]][0]), motion, coms
            )
        elif kind == "torsion_spring" and force["joint"] in number:
            found.coils.append(number[force["joint"]])
        elif kind == "torque" and force["joint"] in number:
            found.motors.append(number[force["joint"]])
    for drive in spec.get("drives", ()):
        measure = drive.get("measure", {})
        if measure.get("of") == "joint" and measure.get("joint") in number:
            found.motors.append(number[measure["joint"]])
    found.motors = sorted(set(found.motors))
    found.coils = sorted(set(found.coils))
    found.floors = list(_floors(planes, motion.size))
    return found


def _contact(
    force: Mapping[str, Any], body: Mapping[str, int], motion: Motion, found: Surroundings
) -> Iterator[_Plane]:
    first, second = body[force["body1"]], body[force["body2"]]
    centre, other = (np.array(force[word], dtype=float) for word in ("point1", "point2"))
    ends = [(first, centre, force.get("radius1") or 0.0), (second, other, force.get("radius2") or 0.0)]
    for at, point, radius in ends:
        part = {"kind": "ball", "radius": float(radius), "center": point.tolist()}
        if radius and {"body": at, "part": part} not in found.parts:
            found.parts.append({"body": at, "part": part})
    if force.get("normal") is not None:
        path = motion.on_body(second, motion.placed(first, centre))
        yield _Plane(second, other, _unit(force["normal"]), path, ends[0][2])


def _tyre(force: Mapping[str, Any], body: Mapping[str, int], motion: Motion, found: Surroundings) -> _Plane:
    wheel, road = body[force["body"]], body[force.get("ground") or "ground"]
    centre, radius = np.array(force["center"], dtype=float), float(force["radius"])
    part = {"kind": "wheel", "radius": radius, "length": 0.3 * radius, "center": centre.tolist(),
            "axis": _unit(force["axis"]).tolist()}  # fmt: skip
    found.parts.append({"body": wheel, "part": part})
    path = motion.on_body(road, motion.placed(wheel, centre))
    return _Plane(road, np.array(force.get("point") or (0.0, 0.0, 0.0)), _unit(force["normal"]), path, radius)


def _floors(planes: Sequence[_Plane], size: float) -> Iterator[dict[str, Any]]:
    """One rectangle for each plane, as large as all that moves over it needs."""
    groups: list[list[_Plane]] = []
    for plane in planes:
        for group in groups:
            same = group[0]
            off = abs(float((plane.point - same.point) @ same.normal))
            level = plane.normal @ same.normal > 1.0 - EQUAL and off < EQUAL_IN_SIX_DIGITS * size
            if plane.body == same.body and level:
                group.append(plane)
                break
        else:
            groups.append([plane])
    for group in groups:
        normal, origin = group[0].normal, group[0].point
        across = [_across(normal), np.cross(normal, _across(normal))]
        spare = MARGIN * size + max(plane.radius for plane in group)
        paths = np.concatenate([plane.path[np.isfinite(plane.path).all(axis=1)] for plane in group])
        if not len(paths):
            continue
        ranges = [((paths - origin) @ axis) for axis in across]
        (a, b), (c, d) = ((float(x.min()) - spare, float(x.max()) + spare) for x in ranges)
        corners = [origin + u * across[0] + w * across[1] for u, w in ((a, c), (b, c), (b, d), (a, d))]
        yield {"body": group[0].body, "normal": normal.tolist(), "points": [corner.tolist() for corner in corners]}


def _stops(
    force: Mapping[str, Any], joint: Mapping[str, Any], place: float, motion: Motion, coms: Sequence[FloatArray]
) -> Iterator[dict[str, Any]]:
    """Where the coordinate of a slide or a hinge meets its ends, in axes of the parent; `place` is it at the start."""
    parent, child, size = joint["parent"], joint["child"], motion.size
    if joint["axis"] is None or not 0 <= child < len(coms):
        return
    axis = _unit(joint["axis"])
    point, middle = (motion.on_body(parent, motion.placed(child, at))[0] for at in (np.array(joint["at"]), coms[child]))
    arm = middle - point - ((middle - point) @ axis) * axis
    for end in (force.get("lower"), force.get("upper")):
        if end is None or not np.isfinite(end):
            continue
        if joint["kind"] == "prismatic":
            at, across = point + (end - place) * axis, STOP * size * _across(axis)
            ends = [at - across, at + across]
        elif joint["kind"] == "revolute" and np.linalg.norm(arm) > NEGLIGIBLE * size:
            turn, out = end - place, _unit(arm)
            ends = [point, point + 3.0 * STOP * size * (np.cos(turn) * out + np.sin(turn) * np.cross(axis, out))]
        else:
            continue
        yield {"body": parent, "points": [corner.tolist() for corner in ends]}


def _unit(vector: Any) -> FloatArray:
    found = np.array(vector, dtype=float)
    return found / np.linalg.norm(found)


def _across(direction: FloatArray) -> FloatArray:
    """A direction perpendicular to another: horizontal in the plane of x and y where it can be."""
    axis = (0.0, 0.0, 1.0) if abs(direction[2]) < NEARLY_ALONG else (1.0, 0.0, 0.0)
    return _unit(np.cross(axis, direction))
