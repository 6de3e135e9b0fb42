"""Mechanisms drawn by chance with every element: joints of all kinds, contacts, tyres, loads along joints, tables.

Joints of other kinds are in a mechanism before it is loaded, turned and scaled; what depends on where bodies are drawn
comes on top.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import partita as pt

from . import chance, forces
from .comparison import Verdict, compare
from .curves import Monotone, Spline, Straight, Wave
from .drawing import GROUND, Array, Body, Coupling, Drawing, Joint, Rotor, TableDrive, unit

KINDS = (
    "screw", "pin_slot", "custom", "constant_velocity", "point_on_line", "point_on_plane", "parallel", "perpendicular",
    "orientation",
)  # fmt: skip
IN_A_PLANE = ("pin_slot", "custom", "point_on_line")


def wave(rng: Any, count: int) -> Wave:
    """A function of some numbers, 0 where all are 0."""
    bend = 0.3 * rng.normal(size=(count, count))
    return Wave(
        0.5 * rng.normal(size=count), bend + bend.T, rng.uniform(0.5, 1.5, size=count), 0.4 * float(rng.normal()),
        float(rng.uniform(0.0, 6.0)), np.zeros(count), np.ones(count), 0.0, 1.0,
    )  # fmt: skip


def special(rng: Any, name: str, ends: tuple[str, str], point: Array, planar: bool) -> Joint:
    """A joint of one of the kinds beside those of `chance`."""
    parent, child = ends if rng.random() < 0.5 else ends[::-1]
    kind = str(rng.choice(IN_A_PLANE if planar else (*KINDS, "custom", "screw", "pin_slot", "constant_velocity")))
    axes = chance.rotation(rng)
    if planar:
        axes = chance.about(np.array([0.0, 0.0, 1.0]), float(rng.uniform(0.0, 6.0)))
    if kind == "pin_slot":
        return Joint(name, kind, parent, child, point, axes[:, [0, 2]])
    if kind != "custom":
        pitch = float(rng.uniform(0.5, 3.0) * rng.choice([-1.0, 1.0])) if kind == "screw" else 0.0
        return Joint(name, kind, parent, child, point, axes, pitch=pitch)
    directions = ("x", "y", "rz") if planar else ("x", "y", "z", *rng.permutation(["rx", "ry", "rz"])[:2])
    chosen = [str(x) for x in rng.permutation(directions)]
    count = int(rng.integers(1, 3)) if len(chosen) > 3 else 1
    follow = chosen[count : count + int(rng.integers(1, 3))]
    free = tuple(sorted(chosen[:count], key=chance.DIRECTIONS.index))
    return Joint(name, kind, parent, child, point, axes, free, follows=tuple((x, wave(rng, len(free))) for x in follow))


def jointed(rng: Any, d: Drawing) -> Drawing:
    """With joints of other kinds in the place of some, bodies that hang by such, and a loop closed by one."""
    planar = d.words == "in a plane"
    joints, bodies = list(d.joints), list(d.bodies)
    if d.words in ("in space", "in a plane", "many"):
        for i, j in enumerate(joints):
            if rng.random() < 0.25:
                joints[i] = special(rng, j.name, (j.parent, j.child), j.point, planar)
    for k in range(int(rng.integers(1, 3))):
        at = rng.normal(size=3)
        inner = str(rng.choice([GROUND, *(b.name for b in bodies)]))
        bodies.append(chance.body(rng, f"e{k}", at))
        joints.append(special(rng, f"x{k}", (inner, f"e{k}"), at + 0.3 * rng.normal(size=3), planar))
    if rng.random() < 0.4:
        one, other = (str(x) for x in rng.choice([GROUND, *(b.name for b in bodies)], size=2, replace=False))
        joints.append(special(rng, "closing", (one, other), rng.normal(size=3), planar))
    return replace(d, bodies=tuple(bodies), joints=tuple(joints))


class Chance:
    """What is added to a closed drawing of any size."""

    def __init__(self, d: Drawing, rng: Any) -> None:
        self.d, self.rng = d, rng
        self.forces, self.couplings, self.drives = list(d.forces), list[Coupling](), list(d.drives)
        self.bodies = {b.name: b for b in d.bodies}
        self.scalars = [(j, i) for j in d.joints for i in range(j.coordinates[0])]

    def drawing(self) -> Drawing:
        return replace(self.d, forces=tuple(self.forces), couplings=tuple(self.couplings), drives=tuple(self.drives))

    def number(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def maybe(self, part: float) -> bool:
        return bool(self.rng.random() < part)

    def one(self, of: Any) -> Any:
        return of[int(self.rng.integers(len(of)))]

    def two(self) -> tuple[str, str]:
        """Two bodies, or one and the ground, in any order."""
        first = self.one(list(self.bodies))
        ends = first, self.one([x for x in [GROUND, *self.bodies] if x != first])
        return ends if self.maybe(0.5) else ends[::-1]

    def point(self) -> Array:
        return 0.5 * self.d.size * self.rng.normal(size=3)

    def direction(self) -> Array:
        return unit(self.rng.normal(size=3))

    def there(self, body: str, point: Array) -> Array:
        """A point of a body, in the world as drawn."""
        b = self.bodies.get(body)
        return point if b is None else b.position + b.rotation @ point

    def here(self, body: str, point: Array) -> Array:
        """A point of the world as drawn, in axes of a body."""
        b = self.bodies.get(body)
        return point if b is None else b.rotation.T @ (point - b.position)

    def axes(self, body: str) -> Array:
        b: Body | None = self.bodies.get(body)
        return np.eye(3) if b is None else b.rotation

    @property
    def units(self) -> tuple[float, float, float]:
        return self.d.size, self.d.mass, self.d.time

    @property
    def pull(self) -> float:
        """A force of the drawing's own size."""
        size, mass, time = self.units
        return mass * size / time**2

    # forces

    def contact(self, name: str) -> None:
        size, mass, time = self.units
        one, other = self.two()
        exponent, n, depth = self.number(1.0, 2.0), self.direction(), size * self.number(-0.05, 0.25)
        plane = self.maybe(0.5)
        radius = size * self.number(0.2, 0.6) * (0.0 if plane and self.maybe(0.3) else 1.0)
        point = self.point()
        centre = self.there(one, point)
        normal, radius2 = None, None
        if plane:
            normal = self.axes(other).T @ n * self.number(0.5, 2.0)
            there = centre - (radius - depth) * n + np.cross(n, self.point())
        else:
            radius2 = size * self.number(0.2, 0.6)
            there = centre + (radius + radius2 - depth) * n
        friction = self.number(0.1, 0.8) * self.maybe(0.7)
        self.forces.append(forces.Contact(
            name, one, point, other, self.here(other, there), radius, normal, radius2,
            self.number(5.0, 30.0) * mass * size ** (1.0 - exponent) / time**2, exponent,
            self.number(0.0, 0.5) * time / size * self.maybe(0.7), friction, friction * self.number(1.0, 1.6),
            self.number(0.05, 0.5) * size / time,
        ))  # fmt: skip

    def tyre(self, name: str) -> None:
        size, mass, time = self.units
        one, other = self.two()
        if one == GROUND:
            one, other = other, one
        point, n, axis = self.point(), self.direction(), self.direction()
        while abs(n @ axis) > 0.9:
            axis = self.direction()
        radius, depth = size * self.number(0.3, 0.8), size * self.number(-0.02, 0.2)
        lean = float(np.linalg.norm(n - axis * (axis @ n)))
        road = self.there(one, point) - (radius * lean - depth) * n + np.cross(n, self.point())
        slips = self.maybe(0.8)
        self.forces.append(forces.Tyre(
            name, one, point, self.axes(one).T @ axis * self.number(0.5, 2.0), radius, other, self.here(other, road),
            self.axes(other).T @ n * self.number(0.5, 2.0), self.number(5.0, 30.0) * mass / time**2,
            self.number(0.0, 0.5) * time / size * self.maybe(0.7), self.number(0.3, 1.0) * slips,
            self.number(1.0, 5.0) * self.pull * slips, self.number(1.0, 5.0) * self.pull * slips * self.maybe(0.8),
            self.number(0.1, 0.5) * size / time,
        ))  # fmt: skip

    def bushing(self, name: str) -> None:
        one, other = self.two()
        point, axes = self.there(one, self.point()), chance.rotation(self.rng)
        size, mass, time = self.units
        scale = np.repeat([1.0, size], 3)
        k, c = (roots @ roots.T * np.outer(scale, scale) for roots in self.rng.normal(size=(2, 6, 6)))
        self.forces.append(forces.Bushing(
            name, one, other, point, axes, k * mass / time**2, 0.3 * c * mass / time,
            (self.here(one, point), self.here(other, point)), (self.axes(one).T @ axes, self.axes(other).T @ axes),
        ))  # fmt: skip

    def coordinate(self) -> tuple[Joint, int, float]:
        """A slide or an angle, and its unit."""
        j, i = self.one(self.scalars)
        return j, i, self.unit_of(j, i)

    def unit_of(self, j: Joint, i: int) -> float:
        return 1.0 if self.is_turn(j, i) else self.d.size

    @staticmethod
    def is_turn(j: Joint, i: int) -> bool:
        return i >= len(j.motions(j.some)[0])

    def friction(self, name: str) -> None:
        j, i, x = self.coordinate()
        effort = self.pull * self.d.size / x
        dynamic: Any = effort * self.number(0.1, 1.0)
        if self.maybe(0.4):
            curve = self.over_time(effort)
            dynamic = Monotone(curve.x, np.abs(curve.y))
        static = None if self.maybe(0.5) else effort * self.number(1.0, 1.5)
        slow = self.number(0.05, 0.5) * x / self.d.time
        self.forces.append(forces.Friction(name, j.name, i, dynamic, static, slow))

    def bearing(self, name: str) -> None:
        """Friction that follows the reaction of its joint."""
        j, i, x = self.coordinate()
        turn, size = self.is_turn(j, i), self.d.size
        coefficient = self.number(0.05, 0.25)
        self.forces.append(forces.BearingFriction(
            name, j.name, i, turn, coefficient, None if self.maybe(0.5) else coefficient * self.number(1.0, 1.4),
            self.number(0.05, 0.5) * x / self.d.time,
            size * self.number(0.05, 0.3) if turn else size * self.number(0.3, 1.0) if self.maybe(0.5) else None,
            size * self.number(0.5, 2.0) if self.maybe(0.5) else None,
            size * self.number(0.05, 0.3) if turn and self.maybe(0.5) else None,
            self.pull * self.number(0.0, 0.5) * self.maybe(0.5),
        ))  # fmt: skip

    def stop(self, name: str) -> None:
        j, i, x = self.coordinate()
        upper, e = x * self.number(-0.15, 0.1), self.number(1.0, 2.0)
        ends: list[float | None] = [upper - x * self.number(0.2, 1.0), upper]
        if self.maybe(0.3):
            ends[int(self.rng.integers(2))] = None
        stiffness = self.number(3.0, 20.0) * self.pull * self.d.size / x ** (1.0 + e)
        damping = self.number(0.0, 0.5) * self.d.time / x
        self.forces.append(forces.Stop(name, j.name, i, ends[0], ends[1], stiffness, damping, e))

    def gas(self, name: str) -> None:
        j, i, x = self.coordinate()
        force = self.number(0.5, 2.0) * float(self.rng.choice([-1.0, 1.0])) * self.pull * self.d.size / x
        self.forces.append(forces.GasSpring(name, j.name, i, force, x * self.number(2.0, 4.0), self.number(1.1, 1.6)))

    def over_time(self, height: float) -> Monotone:
        count = int(self.rng.integers(2, 9))
        return Monotone(self.times(count), height * self.rng.normal(size=count))

    def times(self, count: int) -> Array:
        """From before the start to after the end of a short run."""
        steps = np.cumsum(self.rng.uniform(0.3, 1.0, size=count))
        return self.d.time * (-0.05 + 0.5 * (steps - steps[0]) / (steps[-1] - steps[0]))

    def grid(self, low: float, high: float) -> Array:
        steps = np.cumsum(self.rng.uniform(0.3, 1.0, size=int(self.rng.integers(4, 12))))
        return low + (high - low) * (steps - steps[0]) / (steps[-1] - steps[0])

    def table_effort(self, name: str) -> None:
        j, i, x = self.coordinate()
        effort = self.pull * self.d.size / x
        what = self.rng.random()
        over: tuple[Any, ...] | None = None
        curve = self.over_time(effort)
        if what < 0.5:
            k, c, y = self.coordinate()
            over = k.name, c
            periodic = y == 1.0 and self.maybe(0.6)
            start = self.number(-6.0, 0.0) if periodic else -4.0 * y
            grid = self.grid(start, start + (2.0 * np.pi if periodic else 8.0 * y))
            values = effort * self.rng.normal(size=len(grid))
            if periodic:
                grid[-1], values[-1] = grid[0] + 2.0 * np.pi, values[0]
            curve = Monotone(grid, values, periodic)
        elif what < 0.7:
            one, other = self.two()
            p, q = self.point(), self.point()
            over = one, p, other, q
            drawn = float(np.linalg.norm(self.there(one, p) - self.there(other, q)))
            grid = self.grid(0.0, 2.0 * drawn + 3.0 * self.d.size)
            curve = Monotone(grid, effort * self.rng.normal(size=len(grid)))
        self.forces.append(forces.TableEffort(name, j.name, i, curve, over))

    def table_load(self, name: str) -> None:
        first = self.over_time(self.pull)
        whole = self.maybe(0.5)
        more = [
            Monotone(first.x, self.pull * self.rng.normal(size=len(first.x))) if whole else self.over_time(self.pull)
            for _ in range(2)
        ]
        body, axes = self.one(list(self.bodies)), self.one(["world", "body"])
        self.forces.append(forces.TableLoad(name, body, (first, more[0], more[1]), self.point(), axes, whole))

    def table_drive(self, name: str) -> None:
        taken = {(x.joint, x.coordinate) for x in self.drives}
        free = [(j, i) for j, i in self.scalars if (j.name, i) not in taken]
        if not free:
            return
        j, i = self.one(free)
        x, level = self.unit_of(j, i), self.one(["position", "velocity", "acceleration"])
        count = int(self.rng.integers(2, 9))
        times = self.times(count)
        power = ("position", "velocity", "acceleration").index(level)
        values = self.rng.normal(size=count) * x / self.d.time**power * (0.1 if level == "position" else 0.5)
        by_default = Monotone if level == "position" else Straight
        curve: Any = Spline if count % 2 and level != "acceleration" else by_default
        if level == "position":
            values = values - curve(times, values).derivatives(0.0)[0]
        start = self.number(-0.5, 0.5) * x / self.d.time if level == "acceleration" else 0.0
        self.drives.append(TableDrive(name, j.name, i, level, curve(times, values), start))

    # couplings

    def measure(self) -> tuple[Any, dict[str, Any], float, float]:
        """Something that is measured: as it is given, in the words of a description, its value as drawn, its unit."""
        kind = self.one(["joint", "along", "cosine", "distance"] if self.scalars else ["along", "cosine", "distance"])
        if kind == "joint":
            j, i, x = self.coordinate()
            return pt.Coordinate(j.name, i), {"of": "joint", "joint": j.name, "coordinate": i}, 0.0, x
        one, other = self.two()
        if kind == "cosine":
            a, b = self.direction(), self.direction()
            item = {"of": "cosine", "body1": one, "axis1": a, "body2": other, "axis2": b}
            return pt.Cosine(one, a, other, b), item, float((self.axes(one) @ a) @ (self.axes(other) @ b)), 1.0
        p, q, size = self.point(), self.point(), self.d.size
        item = {"of": kind, "body1": one, "point1": p, "body2": other, "point2": q}
        gap = self.there(other, q) - self.there(one, p)
        if kind == "distance":
            return pt.Distance(one, p, other, q), item, float(np.linalg.norm(gap)), size
        a = self.direction()
        return pt.Along(one, p, a, other, q), {**item, "axis": a}, float((self.axes(one) @ a) @ gap), size

    def wave(self, found: list[Any], start: float, height: float) -> Wave:
        """A function of measures, with a value where they are drawn."""
        return replace(
            wave(self.rng, len(found)), origin=np.array([x[2] for x in found]), unit=np.array([x[3] for x in found]),
            start=start, height=height,
        )  # fmt: skip

    def through(self, x0: float, y0: float, x: float, y: float, periodic: bool = False) -> Spline:
        """A table that passes through a point, so far as x."""
        grid = self.grid(x0 - x * self.number(0.8, 1.2), x0 + x)
        if periodic:
            start = x0 - self.number(0.0, 6.0)
            grid = self.grid(start, start + 2.0 * np.pi)
            grid[-1] = grid[0] + 2.0 * np.pi
        values = 0.3 * y * self.rng.normal(size=len(grid))
        values[-1] = values[0] if periodic else values[-1]
        return Spline(grid, values - Spline(grid, values, periodic).derivatives(x0)[0] + y0, periodic)

    def constraint(self, name: str) -> None:
        of = [self.measure() for _ in range(int(self.rng.integers(2, 4)))]
        swings = self.maybe(0.4)
        a, w, p = (
            0.1 * of[0][3] * self.number(-1.0, 1.0) * swings,
            self.number(0.5, 3.0) / self.d.time,
            self.number(0, 6),
        )
        law = self.wave(of[1:], of[0][2], of[0][3])

        def function(t: Any, first: Any, *more: Any) -> Any:
            return first - law(*more) - a * (np.sin(w * t + p) - np.sin(p))

        data = {"terms": [x[1] for x in of], "law": law, "swing": (a, w, p)}
        call = ("add_constraint", (name, function), {"of": [x[0] for x in of]})
        self.couplings.append(Coupling(name, "follower", data, call))

    def rates(self, name: str) -> None:
        of = [self.measure() for _ in range(int(self.rng.integers(2, 4)))]
        unit0, drifts = of[0][3], self.maybe(0.4)
        starts = [*(self.number(0.5, 1.5) * unit0 / x[3] for x in of)]
        laws = [self.wave(of, start, 0.5 * start) for start in starts]
        if drifts:
            laws.append(self.wave(of, 0.3 * unit0 / self.d.time, 0.3 * unit0 / self.d.time))
        call = ("add_constraint", (name, lambda t, *x: [law(*x) for law in laws]),
                {"of": [x[0] for x in of], "level": "velocity"})  # fmt: skip
        self.couplings.append(Coupling(name, "rates", {"terms": [x[1] for x in of], "laws": laws}, call))

    def cam(self, name: str) -> None:
        """By a table, with a coordinate of a joint as its cam if there is one."""
        lift, lead = self.measure(), self.measure()
        turns = [(j, i) for j, i in self.scalars if self.is_turn(j, i)]
        if turns and self.maybe(0.4):
            j, i = self.one(turns)
            lead = pt.Coordinate(j.name, i), {"of": "joint", "joint": j.name, "coordinate": i}, 0.0, 1.0
        periodic = lead[1]["of"] == "joint" and lead[3] == 1.0 and self.maybe(0.6)
        curve = self.through(lead[2], lift[2], 4.0 * lead[3], lift[3], periodic)
        data = {"terms": [lift[1], lead[1]], "law": curve.derivatives, "counted": True}
        call = ("add_cam", (lift[0], lead[0], (curve.x, curve.y)), {"periodic": periodic, "name": name})
        self.couplings.append(Coupling(name, "cam", data, call))

    def curve(self, name: str) -> None:
        """A point on a curve, by a function, a table or a closed outline."""
        size = self.d.size
        one, other = self.two()
        origin, q = self.point(), self.point()
        a, b = self.direction(), self.direction()
        gap = self.there(other, q) - self.there(one, origin)
        x0, y0 = (float((self.axes(one) @ axis) @ gap) for axis in (a, b))
        items = [
            {"of": "along", "body1": one, "point1": origin, "axis": axis, "body2": other, "point2": q}
            for axis in (a, b)
        ]
        named: dict[str, Any] = {"origin": origin, "x_axis": 2.0 * a, "y_axis": b}
        what = self.one(["function", "table", "outline"])
        given: Any
        if what == "outline":
            angle, far = float(np.arctan2(y0, x0)), float(np.hypot(x0, y0))
            shape = self.through(angle, far, 0.0, far, periodic=True)
            radii = far * (2.0 + np.tanh(shape.y / far))
            closed = Spline(shape.x, radii, periodic=True)
            closed = Spline(closed.x, radii * far / closed.derivatives(angle)[0], periodic=True)
            if closed.y.min() <= 0.0:
                return
            given, named["polar"] = (closed.x, closed.y), True
            made = Coupling(name, "outline", {"terms": items, "curve": closed})
        elif what == "table":
            curve = self.through(x0, y0, 3.0 * size, size)
            given = curve.x, curve.y
            made = Coupling(name, "cam", {"terms": items[::-1], "law": curve.derivatives, "counted": True})
        else:
            law = self.wave([(None, None, x0, size)], y0, size)
            given = law
            made = Coupling(name, "follower", {"terms": items[::-1], "law": law, "swing": (0.0, 1.0, 0.0)})
        call = ("add_point_on_curve", (name, one, other, q, given), named)
        self.couplings.append(replace(made, call=call))


FORCES: tuple[Callable[[Chance, str], None], ...] = (
    Chance.contact, Chance.contact, Chance.tyre, Chance.tyre, Chance.bushing, Chance.table_load,
)  # fmt: skip
ALONG: tuple[Callable[[Chance, str], None], ...] = (
    Chance.friction, Chance.bearing, Chance.stop, Chance.gas, Chance.table_effort, Chance.table_effort,
)  # fmt: skip
COUPLINGS: tuple[Callable[[Chance, str], None], ...] = (
    Chance.constraint, Chance.rates, Chance.cam, Chance.cam, Chance.curve, Chance.curve,
)  # fmt: skip


EVERY = (
    *KINDS, "Contact", "Tyre", "Bushing", "TableLoad", "Friction", "BearingFriction", "Stop", "GasSpring",
    "TableEffort", "TableDrive", "follower of add_constraint", "rates of add_constraint", "cam of add_cam",
    "periodic cam", "follower of add_point_on_curve", "cam of add_point_on_curve", "outline of add_point_on_curve",
    "Rotor",
)  # fmt: skip
"""Everything that `kinds_of` may find beside what `chance` draws."""


def mechanism(seed: int) -> Drawing:
    """The mechanism of a number, closed as drawn."""
    rng = np.random.default_rng([seed, 24])
    family = chance.FAMILIES[int(rng.integers(len(chance.FAMILIES)))]
    d = chance.finished(rng, jointed(rng, family(rng)), seed)
    d = replace(d, joints=tuple(replace(j, child_point=None, child_axis=None) for j in d.joints))
    made = Chance(d, rng)
    for k in range(int(rng.integers(1, 4))):
        made.one(FORCES)(made, f"force {k}")
    if made.scalars:
        for k in range(int(rng.integers(0, 3))):
            made.one(ALONG)(made, f"along {k}")
        if rng.random() < 0.2:
            made.table_drive("by a table")
    for k in range(int(rng.integers(0, 3)) if rng.random() < 0.6 else 0):
        made.one(COUPLINGS)(made, f"coupling {k}")
    return rotating(made.drawing(), seed)


def rotating(d: Drawing, seed: int) -> Drawing:
    """With rotors on some joints, in every third mechanism."""
    rng = np.random.default_rng([seed, 26])
    scalars = [(j, i) for j in d.joints for i in range(j.coordinates[0])]
    if not scalars or seed % 3:
        return d
    rotors = []
    for k in range(int(rng.integers(1, 4))):
        j, i = scalars[int(rng.integers(len(scalars)))]
        ratio = float(rng.uniform(1.0, 50.0) * rng.choice([-1.0, 1.0]))
        moved = d.mass * float(rng.uniform(0.02, 2.0)) * (1.0 if i < len(j.motions(j.some)[0]) else d.size**2)
        rotors.append(Rotor(f"rotor {k}", j.name, i, moved / ratio**2, ratio))
    return replace(d, rotors=tuple(rotors))


def kinds_of(d: Drawing) -> Counter[str]:
    """What there is in a drawing, by name."""
    found = Counter(j.kind for j in d.joints) + Counter(type(f).__name__ for f in (*d.forces, *d.drives, *d.rotors))
    for c in d.couplings:
        method, _, named = c.call or ("", (), {})
        found["periodic cam" if named.get("periodic") else f"{c.kind} of {method}"] += 1
    return found


def compare_elements(seed: int) -> tuple[Verdict, Counter[str]]:
    """Both coordinates against the independent program; and what there was."""
    drawing = mechanism(seed)
    return compare(drawing), kinds_of(drawing)
