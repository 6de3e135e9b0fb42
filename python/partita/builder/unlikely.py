"""What is possible but unlikely in a drawing: contacts that begin deep, joints far off their bodies, lengths in another
unit. Lengths are compared with lengths of the same drawing, masses with that of air."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..products import norm
from .bodies import to_world
from .checks import Array
from .gaps import FAR, point_of, size_of
from .records import GROUND, Description, JointRecord, LoadRecord

FAR_OFF = 10.0
"""A joint farther from its body is probably given in another unit. Scale: multiples of all else that is drawn.
Reason: a factor of 1000 lies between millimetre and metre."""
SLIDING = ("free", "prismatic", "planar", "cylindrical", "screw")
AIR = 1.2
"""Density of air [kg/m^3]."""
SLENDER = 300.0
"""A body lighter than a bar of air, thinner by this, is probably drawn in another unit. Scale: length over thickness.
Reason: a wire of steel so thin would weigh six thousand times as much."""


def unlikely(d: Description) -> Iterator[str]:
    """A sentence for each contact that begins deep and for a joint far off its body: the same in all units."""
    yield from _deep(d)
    if found := _off(d, _Points.of(d)):
        yield found[1]


def light(d: Description) -> Iterator[str]:
    """A sentence for each body lighter than air; of one that a joint lies far off the length is not known."""
    points = _Points.of(d)
    found = _off(d, points)
    yield from _light(d, points, {d.joints[found[0]].parent, d.joints[found[0]].child} if found else set())


def _deep(d: Description) -> Iterator[str]:
    for force in d.forces.values():
        if not isinstance(force, LoadRecord) or force.kind not in ("contact", "tyre"):
            continue
        data = force.means
        depth, radius = _tyre(d, data) if force.kind == "tyre" else _contact(d, data)
        allowed = radius or FAR * size_of(d)
        if not depth > allowed > 0.0:
            continue
        pressed = ""
        if force.kind == "contact" and isinstance(data["stiffness"], int | float):
            with np.errstate(over="ignore"):
                force_there = float(data["stiffness"]) * np.float64(depth) ** float(data["exponent"])
            pressed = f" and is pushed out with {force_there:.3g} N"
        what = f"its radius is {radius:.4g} m" if radius else f"all that is drawn measures {size_of(d):.4g} m"
        yield (
            f'{force.kind} "{force.name}" begins {depth:.4g} m deep{pressed}, where {what}; draw the body outside, or '
            "turn the normal towards the free side"
        )


def _contact(d: Description, data: Mapping[str, Any]) -> tuple[float, float]:
    """Depth of a contact as drawn, and the radius of its sphere, the smaller of two [m]."""
    first, second = (to_world(d, data[f"body{i}"], np.array(data[f"point{i}"], dtype=float)) for i in (1, 2))
    radius = float(data.get("radius1") or 0.0)
    if data.get("normal") is not None:
        return _under(d, data["body2"], data["normal"], first - second, radius), radius
    other = float(data.get("radius2") or 0.0)
    return radius + other - norm(first - second), min(radius, other)


def _tyre(d: Description, data: Mapping[str, Any]) -> tuple[float, float]:
    """The same of a tyre on a road."""
    road, radius = data.get("ground") or GROUND, float(data["radius"])
    centre = to_world(d, data["body"], np.array(data["center"], dtype=float))
    point = to_world(d, road, np.zeros(3) if data.get("point") is None else np.array(data["point"], dtype=float))
    return _under(d, road, data["normal"], centre - point, radius), radius


def _under(d: Description, body: str, normal: Any, above: Array, radius: float) -> float:
    """Depth of a sphere under a plane across a normal in the axes of a body."""
    direction = to_world(d, body, np.array(normal, dtype=float)) - to_world(d, body, np.zeros(3))
    return radius - float(np.sum(direction * above)) / (norm(direction) or 1.0)


@dataclass(frozen=True)
class _Points:
    """All points that are drawn, in the world: centres of mass, ends of rods, points of joints."""

    where: Array  # (n, 3)
    body: NDArray[np.int64]  # (n,) index of the body; -1: the ground
    joint: NDArray[np.int64]  # (n,) index of the joint; -1: none

    @classmethod
    def of(cls, d: Description) -> _Points:
        index = {name: i for i, name in enumerate(d.bodies)} | {GROUND: -1}
        bodies = list(d.bodies.values())
        rotation = np.array([body.rotation for body in bodies]).reshape(-1, 3, 3)
        position = np.array([body.position for body in bodies]).reshape(-1, 3)
        com = np.array([body.com for body in bodies]).reshape(-1, 3)
        rods = [(i, body.rod[2]) for i, body in enumerate(bodies) if body.rod is not None]
        own = [i for i, _ in rods]
        far = position[own] + rotation[own, :, 0] * np.array([length for _, length in rods]).reshape(-1, 1)
        held = [
            (index[body], j, point)
            for j, joint in enumerate(d.joints.values())
            for body, point in zip((joint.parent, joint.child), _ends(d, joint), strict=True)
        ]
        return cls(
            np.concatenate(
                [
                    position + np.einsum("nij,nj->ni", rotation, com),
                    position[own],
                    far,
                    np.array([point for _, _, point in held]).reshape(-1, 3),
                ]
            ),
            np.array([*range(len(bodies)), *own, *own, *(body for body, _, _ in held)], dtype=np.int64),
            np.array([*[-1] * (len(bodies) + 2 * len(own)), *(j for _, j, _ in held)], dtype=np.int64),
        )


def _ends(d: Description, joint: JointRecord) -> tuple[Array, Array]:
    """Points of a joint on its parent and its child."""
    point = point_of(d, joint)
    return point, point if joint.child_point is None else joint.child_point


def _size(points: Array) -> float:
    """Diagonal of the box around points."""
    return norm(np.ptp(points, axis=0)) if len(points) else 0.0


def _off(d: Description, points: _Points) -> tuple[str, ...]:
    """The joint whose point lies far from a body and from all else that is drawn, and a sentence on it; () without one.

    There is at most one: of two the other would belong to all else.
    """
    if not len(points.where) or not d.joints:
        return ()
    with np.errstate(over="ignore"):
        away = np.linalg.norm(points.where - np.median(points.where, axis=0), axis=1)
    farthest = int(points.joint[np.argmax(np.where(points.joint >= 0, away, -1.0))])
    name, joint = list(d.joints.items())[farthest]
    if joint.kind in SLIDING or joint.point is None:
        return ()  # a point of a joint that slides may lie anywhere along it
    others = points.joint != farthest
    rest = _size(points.where[others])
    for body, point in zip((joint.parent, joint.child), _ends(d, joint), strict=True):
        if body == GROUND:
            continue
        near = points.where[others & (points.body == list(d.bodies).index(body))]
        gap = norm(np.maximum(0.0, np.maximum(near.min(axis=0) - point, point - near.max(axis=0))))
        if gap > FAR_OFF * rest > 0.0:
            words = (
                f'joint "{name}": its point lies {gap:.4g} m off "{body}", where all else that is drawn measures '
                f"{rest:.4g} m; check its unit and its coordinates"
            )
            return name, words
    return ()


def _light(d: Description, points: _Points, off: set[str]) -> Iterator[str]:
    """Bodies lighter than air; not those `off` which a joint lies, whose length is not known."""
    count = len(d.bodies)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    of_bodies = points.body >= 0
    np.minimum.at(low, points.body[of_bodies], points.where[of_bodies])
    np.maximum.at(high, points.body[of_bodies], points.where[of_bodies])
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(high - low, axis=1)
        bars = 0.25 * np.pi * AIR * lengths * (lengths / SLENDER) ** 2
    masses = np.array([body.mass for body in d.bodies.values()])
    names = list(d.bodies)
    for i in np.flatnonzero((masses > 0.0) & (masses < bars)):
        if names[i] not in off:
            yield (
                f'body "{names[i]}" is {lengths[i]:.4g} m long and has {masses[i]:.4g} kg, less than a thin bar of air '
                f'of that length ({bars[i]:.3g} kg); lengths are metres: give "{lengths[i]:g} mm" if millimetres are '
                "meant"
            )
