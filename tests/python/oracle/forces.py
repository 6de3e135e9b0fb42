"""Contacts, tyres, bushings, loads along joints and loads by tables, as their documentation gives them.

Each builds itself through the public face, by `call`, and says in `act` what it does to bodies and joints where these
are. Rates of a depth or of a displacement are derivatives of its definition, not velocities of points in contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

import partita as pt

from .curves import Monotone
from .drawing import Array, unit

Call = tuple[str, tuple[Any, ...], dict[str, Any]]


class Scene(Protocol):
    """What forces see and where they act, at one instant; all in the world."""

    t: float

    def motion_of(self, body: str, point: Array) -> tuple[Array, Array]:
        """A point of a body, and its velocity."""

    def axes(self, body: str) -> tuple[Array, Array]:
        """Rotation and angular velocity of a body."""

    def joint(self, name: str, coordinate: int) -> tuple[float, float]:
        """A coordinate of a joint, and its rate."""

    def add_load(self, body: str, point: Array, force: Array, moment: Any = 0.0) -> None:
        """A force at a place, and a moment."""

    def along(self, joint: str, coordinate: int, effort: float) -> None:
        """An effort along a coordinate."""


def pair(at: Scene, one: str, other: str, point: Array, force: Array, moment: Any = 0.0) -> None:
    """On the first body, and the opposite at the same place on the other one."""
    at.add_load(one, point, force, moment)
    at.add_load(other, point, -force, -np.asarray(moment))


def carried(at: Scene, body: str, point: Array) -> Array:
    """Velocity that a body gives to a place in the world."""
    spin = at.axes(body)[1]
    x, u = at.motion_of(body, np.zeros(3))
    return u + np.cross(spin, point - x)


def pressed(depth: float, rate: float, stiffness: float, damping: float, exponent: float) -> float:
    """Hunt and Crossley: nothing before the first touch, never a pull."""
    return stiffness * depth**exponent * max(1.0 + damping * rate, 0.0) if depth > 0.0 else 0.0


def sliding(speed: float, dynamic: float, static: float, slow: float) -> float:
    """Resistance at a speed."""
    u = speed / slow
    return dynamic * 4.0 * u / np.sqrt(1.0 + 16.0 * u * u) + (static - dynamic) * u / (0.75 + 0.25 * u * u) ** 2


@dataclass(frozen=True)
class Contact:
    """A sphere on one body against a plane (`normal`) or a sphere (`radius2`) on another."""

    name: str
    body1: str
    point1: Array
    body2: str
    point2: Array
    radius1: float
    normal: Array | None
    radius2: float | None
    stiffness: float
    exponent: float
    damping: float
    friction: float
    static: float
    slow: float

    @property
    def bodies(self) -> tuple[str, ...]:
        return self.body1, self.body2

    def call(self) -> Call:
        shape = {"radius2": self.radius2} if self.normal is None else {"normal": self.normal}
        law = {"stiffness": self.stiffness, "exponent": self.exponent, "damping": self.damping}
        if self.friction or self.static:
            law |= {"friction": self.friction, "static_friction": self.static, "stick_velocity": self.slow}
        where = (self.name, self.body1, self.point1, self.body2, self.point2)
        return "add_contact", where, {"radius1": self.radius1, **shape, **law}

    def act(self, at: Scene) -> None:
        (x1, u1), (x2, u2) = at.motion_of(self.body1, self.point1), at.motion_of(self.body2, self.point2)
        gap, opening = x1 - x2, u1 - u2
        if self.normal is not None:
            turn, spin = at.axes(self.body2)
            n = turn @ unit(self.normal)
            height = float(n @ gap)
            rate = -float(np.cross(spin, n) @ gap + n @ opening)
            depth, point = self.radius1 - height, x1 - height * n
        else:
            assert self.radius2 is not None
            far, n = float(np.linalg.norm(gap)), unit(gap)
            rate, depth = -float(n @ opening), self.radius1 + self.radius2 - far
            # midway between where each sphere ends on the line of the centres
            point = 0.5 * (x1 - self.radius1 * n + x2 + self.radius2 * n)
        normal_force = pressed(depth, rate, self.stiffness, self.damping, self.exponent)
        force = normal_force * n
        if normal_force and (self.friction or self.static):
            slip = carried(at, self.body1, point) - carried(at, self.body2, point)
            slip = slip - n * (n @ slip)
            speed = float(np.linalg.norm(slip))
            if speed > 0.0:
                force = force - normal_force * sliding(speed, self.friction, self.static, self.slow) / speed * slip
        pair(at, self.body1, self.body2, point, force)


@dataclass(frozen=True)
class Tyre:
    """A wheel's disc on a road."""

    name: str
    body: str
    center: Array
    axis: Array
    radius: float
    road: str
    point: Array
    normal: Array
    stiffness: float
    damping: float
    friction: float
    longitudinal: float
    lateral: float
    slow: float

    @property
    def bodies(self) -> tuple[str, ...]:
        return self.body, self.road

    def call(self) -> Call:
        where = {"center": self.center, "axis": self.axis, "radius": self.radius, "ground": self.road}
        where |= {"point": self.point, "normal": self.normal, "stiffness": self.stiffness, "damping": self.damping}
        slips = {"friction": self.friction, "longitudinal": self.longitudinal, "lateral": self.lateral}
        return (
            "add_tyre",
            (self.name, self.body),
            {**where, **(slips | {"slow_speed": self.slow} if self.friction else {})},
        )

    def act(self, at: Scene) -> None:
        (c, u), (r, v) = at.motion_of(self.body, self.center), at.motion_of(self.road, self.point)
        (wheel, w), (ground, wg) = at.axes(self.body), at.axes(self.road)
        a, n = wheel @ unit(self.axis), ground @ unit(self.normal)
        a1, n1 = np.cross(w, a), np.cross(wg, n)
        steep = n - a * (a @ n)
        steep1 = n1 - a1 * (a @ n) - a * (a1 @ n + a @ n1)
        lean = float(np.linalg.norm(steep))
        height = float(n @ (c - r))
        depth = self.radius * lean - height
        rate = self.radius * float(steep @ steep1) / lean - float(n1 @ (c - r) + n @ (u - v))
        load = pressed(depth, rate, self.stiffness, self.damping, 1.0)
        if not load:
            return
        down = -steep / lean
        # the normal force has the depth for its potential: it acts at the lowest point of the disc
        pair(at, self.body, self.road, c + self.radius * down, load * n)
        if not self.friction:
            return
        patch = c + down * (height / lean)
        forward = unit(np.cross(a, n))
        aside = np.cross(n, forward)
        slip = carried(at, self.body, patch) - carried(at, self.road, patch)
        pace = float(forward @ (u - carried(at, self.road, c)))
        z = np.array([self.longitudinal * forward @ slip, self.lateral * aside @ slip]) / np.hypot(pace, self.slow)
        z = -z / np.sqrt(1.0 + float(z @ z) / (self.friction * load) ** 2)
        pair(at, self.body, self.road, patch, z[0] * forward + z[1] * aside)


@dataclass(frozen=True)
class Bushing:
    """Stiffness and damping between two frames that coincide as drawn; `ends`, `frames`: their origin and axes on each
    body."""

    name: str
    body1: str
    body2: str
    point: Array
    axes: Array
    stiffness: Array
    damping: Array
    ends: tuple[Array, Array]
    frames: tuple[Array, Array]

    @property
    def bodies(self) -> tuple[str, ...]:
        return self.body1, self.body2

    def call(self) -> Call:
        law = {"stiffness": self.stiffness, "damping": self.damping, "frame": self.axes}
        return "add_bushing", (self.name, self.body1, self.body2, self.point), law

    def act(self, at: Scene) -> None:
        (x1, u1), (x2, u2) = (at.motion_of(b, p) for b, p in zip(self.bodies, self.ends, strict=True))
        (turn1, w1), (turn2, w2) = at.axes(self.body1), at.axes(self.body2)
        frame, gap = turn1 @ self.frames[0], x2 - x1
        theta = rotation_vector(frame.T @ turn2 @ self.frames[1])
        angle = float(np.linalg.norm(theta))
        k = np.array([[0.0, -theta[2], theta[1]], [theta[2], 0.0, -theta[0]], [-theta[1], theta[0], 0.0]])
        # theta' = slope @ (relative angular velocity in the first frame)
        part = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
        slope = np.eye(3) - 0.5 * k + part * k @ k
        x = np.concatenate([frame.T @ gap, theta])
        rate = np.concatenate([frame.T @ (u2 - u1 - np.cross(w1, gap)), slope @ frame.T @ (w2 - w1)])
        effort = -(self.stiffness @ x + self.damping @ rate)
        pair(at, self.body2, self.body1, x2, frame @ effort[:3], frame @ slope.T @ effort[3:])


def rotation_vector(r: Array) -> Array:
    """Axis times angle, of turns below half a turn."""
    v = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine, cosine = float(np.linalg.norm(v)), 0.5 * (float(np.trace(r)) - 1.0)
    return v if sine < 1e-12 else v / sine * float(np.arctan2(sine, cosine))


@dataclass(frozen=True)
class Friction:
    """Along a coordinate, with magnitudes over time: a number or a table."""

    name: str
    joint: str
    coordinate: int
    dynamic: float | Monotone
    static: float | None
    slow: float

    def call(self) -> Call:
        value = (self.dynamic.x, self.dynamic.y) if isinstance(self.dynamic, Monotone) else self.dynamic
        law = {"stick_velocity": self.slow, "static": self.static}
        return "add_friction", (self.joint, value), {**law, "coordinate": self.coordinate, "name": self.name}

    def act(self, at: Scene) -> None:
        rate = at.joint(self.joint, self.coordinate)[1]
        dynamic = self.dynamic.value(at.t) if isinstance(self.dynamic, Monotone) else self.dynamic
        static = dynamic if self.static is None else self.static
        at.along(self.joint, self.coordinate, -sliding(rate, dynamic, static, self.slow))


@dataclass(frozen=True)
class BearingFriction:
    """Along a coordinate, with a magnitude that follows the reaction of the joint; `turn`: it is an angle."""

    name: str
    joint: str
    coordinate: int
    turn: bool
    coefficient: float
    static: float | None
    slow: float
    radius: float | None
    length: float | None
    collar: float | None
    preload: float

    def call(self) -> Call:
        law = {"stick_velocity": self.slow, "coefficient": self.coefficient, "static_coefficient": self.static}
        bearing = {"radius": self.radius, "length": self.length, "collar": self.collar, "preload": self.preload}
        return "add_friction", (self.joint,), {**law, **bearing, "coordinate": self.coordinate, "name": self.name}

    def act(self, at: Scene) -> None:
        """Nothing: without accelerations there is no reaction."""

    def effort(self, rate: float, force: Array, moment: Array, axis: Array) -> float:
        """With this force and moment of the joint, at a rate along or about an axis."""
        across = force - axis * (axis @ force)
        sideways = np.cross(moment, axis) / self.length if self.length else np.zeros(3)
        normal = float(np.linalg.norm(0.5 * across + sideways) + np.linalg.norm(0.5 * across - sideways)) + self.preload
        if self.turn:
            assert self.radius is not None
            normal = self.radius * normal + (self.collar or 0.0) * abs(float(axis @ force))
        elif self.radius:
            normal += abs(float(axis @ moment)) / self.radius
        static = self.coefficient if self.static is None else self.static
        return -sliding(rate, self.coefficient * normal, static * normal, self.slow)


@dataclass(frozen=True)
class Stop:
    """Ends of a coordinate; None: no end there."""

    name: str
    joint: str
    coordinate: int
    lower: float | None
    upper: float | None
    stiffness: float
    damping: float
    exponent: float

    def call(self) -> Call:
        law = {"lower": self.lower, "upper": self.upper, "stiffness": self.stiffness, "damping": self.damping}
        return "add_stop", (self.joint,), {**law, "exponent": self.exponent, "coordinate": self.coordinate,
                                           "name": self.name}  # fmt: skip

    def act(self, at: Scene) -> None:
        x, rate = at.joint(self.joint, self.coordinate)
        law = self.stiffness, self.damping, self.exponent
        effort = 0.0
        if self.upper is not None:
            effort -= pressed(x - self.upper, rate, *law)
        if self.lower is not None:
            effort += pressed(self.lower - x, -rate, *law)
        at.along(self.joint, self.coordinate, effort)


@dataclass(frozen=True)
class GasSpring:
    """A column of gas that grows with the coordinate, or shrinks where its force is negative."""

    name: str
    joint: str
    coordinate: int
    force: float
    length: float
    exponent: float

    def call(self) -> Call:
        law = {"force": self.force, "length": self.length, "exponent": self.exponent}
        return "add_gas_spring", (self.joint,), {**law, "coordinate": self.coordinate, "name": self.name}

    def act(self, at: Scene) -> None:
        x = at.joint(self.joint, self.coordinate)[0]
        column = 1.0 + np.sign(self.force) * x / self.length
        at.along(self.joint, self.coordinate, self.force / column**self.exponent)


@dataclass(frozen=True)
class TableEffort:
    """An effort by a table over time (`over` None), over a coordinate of a joint (two entries), or over the distance of
    two points (four)."""

    name: str
    joint: str
    coordinate: int
    curve: Monotone
    over: tuple[Any, ...] | None

    def call(self) -> Call:
        named: dict[str, Any] = {"coordinate": self.coordinate, "name": self.name}
        if self.over is not None:
            named["over"] = (pt.Coordinate if len(self.over) == 2 else pt.Distance)(*self.over)
            named["periodic"] = self.curve.periodic
        return "add_torque", (self.joint, (self.curve.x, self.curve.y)), named

    def act(self, at: Scene) -> None:
        if self.over is None:
            x = at.t
        elif len(self.over) == 2:
            x = at.joint(*self.over)[0]
        else:
            one, p, other, q = self.over
            x = float(np.linalg.norm(at.motion_of(other, q)[0] - at.motion_of(one, p)[0]))
        at.along(self.joint, self.coordinate, self.curve.value(x))


@dataclass(frozen=True)
class TableLoad:
    """A force on a point by tables over time, one of each component or (`whole`) one of all."""

    name: str
    body: str
    curves: tuple[Monotone, Monotone, Monotone]
    point: Array
    axes: str
    whole: bool

    @property
    def bodies(self) -> tuple[str, ...]:
        return (self.body,)

    def call(self) -> Call:
        tables: tuple[Any, ...] = tuple((c.x, c.y) for c in self.curves)
        if self.whole:
            tables = (self.curves[0].x, np.column_stack([c.y for c in self.curves]))
        return "add_force", (self.body, tables), {"point": self.point, "axes": self.axes, "name": self.name}

    def act(self, at: Scene) -> None:
        force = np.array([c.value(at.t) for c in self.curves])
        force = at.axes(self.body)[0] @ force if self.axes == "body" else force
        at.add_load(self.body, at.motion_of(self.body, self.point)[0], force)
