"""The quantities of bodies, points, joints, measures and forces, from any source of their motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from .records import AT_ONCE, OF_FORCE, OF_MOUNTED, Data

Array = NDArray[Any]


class Moving(NamedTuple):
    """A body: origin, axes as columns, velocity of the origin and angular velocity, in world axes."""

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array


class Signals(Protocol):
    """Source of the numbers of sensors."""

    @property
    def t(self) -> Any:
        """Time."""

    @property
    def gravity(self) -> Array:
        """Acceleration of gravity (..., 3), world axes."""

    def body(self, name: str) -> Moving:
        """A body, or the ground."""

    def body_acceleration(self, name: str) -> tuple[Array, Array]:
        """Acceleration of its origin, and angular acceleration."""

    def joint(self, name: str) -> tuple[Array, Array]:
        """Coordinates and velocities of a joint (..., n)."""

    def joint_acceleration(self, name: str) -> Array:
        """Derivatives of the velocities."""

    def joint_wrench(self, name: str, reads: str, axes: str) -> Array:
        """Force, moment (..., 3) or efforts of drives (..., n) of a joint."""

    def load(self, name: str) -> Mapping[str, Array]:
        """`power`, `potential`, `effort`, and `point`, `force`, `moment` (..., bodies, 3) of an applied force."""

    def ends(self, name: str) -> Sequence[tuple[str, Array]]:
        """The two points of a spring, each with its body."""

    def condition(self, kind: str, name: str) -> Array:
        """Efforts of a drive or a coupling (..., rows)."""


def _cross(a: Array, b: Array) -> Array:
    return np.cross(a, b)


def _turned(rotation: Array, x: Any) -> Array:
    return np.asarray(np.einsum("...ij,...j->...i", rotation, np.asarray(x, dtype=float)))


def point_motion(signals: Signals, body: str, point: Any, reads: str) -> Array:
    """Position, velocity or acceleration in world axes of a point given in body axes."""
    at = signals.body(body)
    arm = _turned(at.rotation, point)
    if reads == "position":
        return at.position + arm
    if reads == "velocity":
        return at.velocity + _cross(at.angular_velocity, arm)
    acceleration, spin = signals.body_acceleration(body)
    return acceleration + _cross(spin, arm) + _cross(at.angular_velocity, _cross(at.angular_velocity, arm))


def _of_mounted(signals: Signals, data: Data, point: Any) -> Array:
    """What a sensor fixed to a body measures at a point: the acceleration less that of gravity."""
    return _along(signals, data, point_motion(signals, data["body"], point, "acceleration") - signals.gravity)


def _along(signals: Signals, data: Data, values: Array) -> Array:
    """A vector in world axes along the requested axes."""
    axes = data.get("axes", "world")
    if axes == "world":
        return values
    return np.asarray(np.einsum("...ji,...j->...i", signals.body(axes).rotation, values))


def _of_point(signals: Signals, data: Data) -> Array:
    if data["reads"] in OF_MOUNTED:
        return _of_mounted(signals, data, data["point"])
    return _along(signals, data, point_motion(signals, data["body"], data["point"], data["reads"]))


def _of_body(signals: Signals, data: Data) -> Array:
    reads, body = data["reads"], data["body"]
    if reads in OF_MOUNTED:
        return _of_mounted(signals, data, (0.0, 0.0, 0.0))
    if reads == "rotation":
        return signals.body(body).rotation
    if reads == "angular_velocity":
        return _along(signals, data, signals.body(body).angular_velocity)
    if reads == "angular_acceleration":
        return _along(signals, data, signals.body_acceleration(body)[1])
    return _along(signals, data, point_motion(signals, body, (0.0, 0.0, 0.0), reads))


def _of_joint(signals: Signals, data: Data) -> Array:
    reads, joint = data["reads"], data["joint"]
    if reads in ("force", "moment"):
        return signals.joint_wrench(joint, reads, data.get("axes", "world"))
    if reads == "drive":
        found = signals.joint_wrench(joint, reads, "world")
    elif reads == "acceleration":
        found = signals.joint_acceleration(joint)
    else:
        found = signals.joint(joint)[0 if reads == "position" else 1]
    if found.shape[-1] == 1:
        return found[..., 0]
    return found if data.get("coordinate") is None else found[..., data["coordinate"]]


def _of_measure(signals: Signals, data: Data) -> Array:
    return measured(signals, data["measure"], data["reads"])


def measured(signals: Signals, measure: Data, reads: str) -> Array:
    """Value, rate or second derivative of a measure."""
    if measure["of"] == "joint":
        return _of_joint(signals, {**measure, "reads": reads})
    ends = [(measure[f"body{i}"], measure.get(f"point{i}", (0.0, 0.0, 0.0))) for i in (1, 2)]
    if measure["of"] == "cosine":
        first, second = (_axis(signals, measure[f"body{i}"], measure[f"axis{i}"], reads) for i in (1, 2))
        return _product_rule(first, second, reads)
    order = 1 + AT_ONCE.index(reads) if reads in AT_ONCE[:2] else 3
    words = ("position", "velocity", "acceleration")[:order]
    gaps = [np.subtract(*(point_motion(signals, *end, word) for end in reversed(ends))) for word in words]
    if measure["of"] == "along":
        return _product_rule(_axis(signals, measure["body1"], measure["axis"], reads), gaps, reads)
    return _distance(gaps)


def _axis(signals: Signals, body: str, axis: Any, reads: str) -> list[Array]:
    """A unit axis of a body and the required number of its derivatives."""
    at = signals.body(body)
    unit = np.asarray(axis, dtype=float)
    found = [_turned(at.rotation, unit / np.linalg.norm(unit))]
    if reads != "position":
        found.append(_cross(at.angular_velocity, found[0]))
    if reads == "acceleration":
        spin = signals.body_acceleration(body)[1]
        found.append(_cross(spin, found[0]) + _cross(at.angular_velocity, found[1]))
    return found


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _product_rule(a: Sequence[Array], b: Sequence[Array], reads: str) -> Array:
    """Derivatives of a . b."""
    if reads == "position":
        return _dot(a[0], b[0])
    if reads == "velocity":
        return _dot(a[1], b[0]) + _dot(a[0], b[1])
    return _dot(a[2], b[0]) + 2.0 * _dot(a[1], b[1]) + _dot(a[0], b[2])


def _distance(gaps: Sequence[Array]) -> Array:
    """Length of a gap, or its derivative; NaN where the points coincide, since the direction is undefined."""
    length = np.sqrt(_dot(gaps[0], gaps[0]))
    if len(gaps) == 1:
        return length
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = gaps[0] / length[..., None]
        rate = _dot(unit, gaps[1])
        if len(gaps) == 2:
            return rate
        return _dot(unit, gaps[2]) + (_dot(gaps[1], gaps[1]) - rate * rate) / length


def _of_force(signals: Signals, data: Data) -> Array:
    reads, name = data["reads"], data["force"]
    if reads in ("length", "rate"):
        (b1, p1), (b2, p2) = signals.ends(name)
        ends = {"of": "distance", "body1": b1, "point1": p1, "body2": b2, "point2": p2}
        return measured(signals, ends, "position" if reads == "length" else "velocity")
    load = signals.load(name)
    if reads == "effort":
        return load["effort"]
    if reads in OF_FORCE:
        return load["power" if reads == "power" else "potential"]
    if data["form"] == "spring":
        gap = load["point"][..., 1, :] - load["point"][..., 0, :]
        length = np.sqrt(_dot(gap, gap))
        return _dot(load["force"][..., 0, :], gap) / np.where(length > 0.0, length, 1.0)
    word = "point" if reads == "position" else reads
    return _along(signals, data, load[word][..., data.get("body", 0), :])


def _of_drive(signals: Signals, data: Data) -> Array:
    effort = signals.condition("drive", data["drive"])
    if data["reads"] == "effort":
        return effort[..., 0] if effort.shape[-1] == 1 else effort
    return effort[..., 0] * measured(signals, data["measure"], "velocity")


def _of_coupling(signals: Signals, data: Data) -> Array:
    effort = signals.condition("coupling", data["coupling"])
    return effort[..., 0] if effort.shape[-1] == 1 else effort


FORMS: dict[str, Callable[[Signals, Data], Array]] = {
    "point": _of_point,
    "body": _of_body,
    "joint": _of_joint,
    "measure": _of_measure,
    "force": _of_force,
    "drive": _of_drive,
    "coupling": _of_coupling,
}
