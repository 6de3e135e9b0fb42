"""Joints of USD as joints of ours: which directions of their frames are free, and where they are drawn.

A coordinate of USD is zero where the two frames coincide, ours as drawn; so slides that separate the frames move the
first one, along axes that it keeps, and rotations turn the second one back, about its own origin. What is left opens
the joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .robot import Array, inverse, placed, turned
from .usd_mass import axis_of
from .usd_stage import Prim
from .usd_table import AXES

_WORDS = ("x", "y", "z", "rx", "ry", "rz")


class Frames(NamedTuple):
    """The frames of a joint on its two sides, in the world."""

    here: Array
    there: Array


@dataclass(frozen=True)
class Kind:
    """A kind of joint; its axes in the first frame, what is free of x, y, z, rx, ry, rz, and which coordinate each axis
    of a drive is."""

    word: str
    axis: Array | None
    second: Array | None
    free: tuple[str, ...]
    coordinates: dict[str, int]
    drawn: tuple[tuple[str, float], ...] = ()


def kind_of(prim: Prim) -> Kind:
    """The joint that a prim is."""
    if prim.tag == "PhysicsFixedJoint":
        return Kind("fixed", None, None, (), {})
    if prim.tag == "PhysicsRevoluteJoint":
        axis = axis_of(prim, "X", "physics:axis")
        return Kind("revolute", axis, None, (_WORDS[3 + int(np.argmax(axis))],), {"angular": 0})
    if prim.tag == "PhysicsPrismaticJoint":
        axis = axis_of(prim, "X", "physics:axis")
        return Kind("prismatic", axis, None, (_WORDS[int(np.argmax(axis))],), {"linear": 0})
    if prim.tag == "PhysicsSphericalJoint":
        return Kind("spherical", None, None, _WORDS[3:], {})
    if prim.tag == "PhysicsDistanceJoint":
        return Kind("distance", None, None, _WORDS, {})
    return _chosen(prim)


def _chosen(prim: Prim) -> Kind:
    """A joint of which each direction is free, unless it is locked."""
    free = tuple(word for axis, word in zip(AXES, _WORDS, strict=True) if not _locked(prim, axis))
    order = {axis: free.index(word) for axis, word in zip(AXES, _WORDS, strict=True) if word in free}
    slides, rotations = [w for w in free if len(w) == 1], [w for w in free if len(w) == 2]
    if len(rotations) == 2:
        if slides:
            prim.fail(
                f"leaves {', '.join(free)} free: two rotations beside slides have no order in USD; "
                "divide it into two joints with a body between them"
            )
        return _universal(prim, rotations)
    if len(rotations) == 3:
        order = {axis: i for axis, i in order.items() if axis.startswith("trans")}
        word = ("spherical", "generic", "generic", "free")[len(slides)]
        return Kind(word, None, None, free, order)
    if len(slides) == len(rotations) == 1 and rotations == [f"r{slides[0]}"]:
        return Kind("cylindrical", np.eye(3)["xyz".index(slides[0])], None, free, order)
    if len(free) == 1:
        axis = np.eye(3)["xyz".index(free[0][-1])]
        return Kind("prismatic" if slides else "revolute", axis, None, free, order)
    return Kind("generic" if free else "fixed", None, None, free, order)


def _universal(prim: Prim, rotations: list[str]) -> Kind:
    """Two rotations: with the twist about x, the swing comes first, as PhysX has it."""
    if "rx" not in rotations:
        prim.fail(
            "leaves ry and rz free and locks rx: programs read it as a constant-velocity or as a universal joint; "
            "let rx be free with one of them, for a universal joint"
        )
    swing = next(word for word in rotations if word != "rx")
    names = {f"rot{swing[1].upper()}": 0, "rotX": 1}
    return Kind("universal", np.eye(3)["xyz".index(swing[1])], np.eye(3)[0], tuple(rotations), names)


def _locked(prim: Prim, axis: str) -> bool:
    """Whether a direction is locked: its lower limit is above the upper one, or both are 0."""
    if not prim.has(f"PhysicsLimitAPI:{axis}"):
        return False
    low, high = prim.real(f"limit:{axis}:physics:low", -np.inf), prim.real(f"limit:{axis}:physics:high", np.inf)
    if low == high != 0.0:
        prim.fail(f"locks {axis} at {low:g}, away from its frames: move a frame there, and lock it at 0")
    return low > high or low == high == 0.0


def limited(prim: Prim) -> list[tuple[str, float, float]]:
    """Directions with limits, which are free otherwise."""
    found = []
    for axis in AXES:
        low, high = prim.real(f"limit:{axis}:physics:low", -np.inf), prim.real(f"limit:{axis}:physics:high", np.inf)
        if prim.has(f"PhysicsLimitAPI:{axis}") and low < high and not (low == -np.inf and high == np.inf):
            found.append((axis, low, high))
    return found


def split(at: Prim, kind: Kind, frames: Frames, size: float) -> tuple[Frames, dict[str, float]]:
    """The frames without the motion that separates them as drawn, and that motion by the axes of drives."""
    here, there = frames
    if kind.word == "universal":
        return _crossed(at, kind, frames, size)
    between = matmul(inverse(here), there)
    shift, turn = between[:3, 3].copy(), between[:3, :3]
    drawn: dict[str, float] = {}
    rotations = [word for word in kind.free if len(word) == 2]
    if len(rotations) == 3:
        turn = np.eye(3)
    elif len(rotations) == 1:
        axis = np.eye(3)["xyz".index(rotations[0][1])]
        angle = _twist(turn, axis)
        drawn[f"rot{rotations[0][1].upper()}"] = angle
        turn = matmul(turn, turned(-angle * axis))
    slid = np.zeros(3)
    for word in kind.free:
        if len(word) == 1:
            i = "xyz".index(word)
            drawn[f"trans{word.upper()}"], slid[i] = float(shift[i]), shift[i]
    if set(kind.coordinates) <= {"angular", "linear"}:
        drawn = dict(zip(kind.coordinates, drawn.values(), strict=False))
    if norm(slid) > EQUAL_IN_SIX_DIGITS * (size + float(norm(here[:3, 3]))):
        here = matmul(here, placed(slid, np.eye(3)))
    frames = Frames(here, matmul(here, placed(shift - slid, turn)))
    gap, angle = apart(frames, size)
    return (frames if max(gap, angle) > EQUAL_IN_SIX_DIGITS else Frames(here, here)), drawn


def _crossed(at: Prim, kind: Kind, frames: Frames, size: float) -> tuple[Frames, dict[str, float]]:
    """A universal joint: one axis of the first frame, one of the second."""
    here, there = frames
    assert kind.axis is not None and kind.second is not None
    first = matmul(here[:3, :3], kind.axis)
    second = matmul(there[:3, :3], kind.second)
    second = second - float(matmul(second, first)) * first
    if not norm(second) > EQUAL_IN_SIX_DIGITS:
        at.fail("has parallel axes of rotation as drawn; a universal joint has two that are perpendicular")
    second /= norm(second)
    third = np.cross(kind.axis, kind.second)
    local, world = (
        np.column_stack([kind.axis, kind.second, third]),
        np.column_stack([first, second, np.cross(first, second)]),
    )
    turn = matmul(world, local.T)
    angle = _twist(matmul(here[:3, :3].T, turn), kind.axis)
    spin = _twist(matmul(turn.T, there[:3, :3]), kind.second)
    drawn = dict(zip(kind.coordinates, (angle, spin), strict=True))
    frames = Frames(placed(here[:3, 3], turn), placed(there[:3, 3], turn))
    return (frames if apart(frames, size)[0] > EQUAL_IN_SIX_DIGITS else Frames(frames.here, frames.here)), drawn


def apart(frames: Frames, size: float) -> tuple[float, float]:
    """How far two frames are apart: distance, in parts of the size of the mechanism and the distance from the origin,
    whose rounding in single precision both have, and angle [rad]."""
    between = matmul(inverse(frames.here), frames.there)
    cosine = np.clip(0.5 * (np.trace(between[:3, :3]) - 1.0), -1.0, 1.0)
    sine = 0.5 * norm(between[:3, :3] - between[:3, :3].T) / np.sqrt(2.0)
    far = size + float(norm(frames.here[:3, 3]))
    return float(norm(between[:3, 3])) / (far or 1.0), float(np.arctan2(sine, cosine))


def _twist(turn: Array, axis: Array) -> float:
    """The angle of a rotation about an axis."""
    k = int(np.argmax(np.abs(axis)))
    i, j = (k + 1) % 3, (k + 2) % 3
    return float(np.arctan2(turn[j, i] - turn[i, j], turn[i, i] + turn[j, j]))
