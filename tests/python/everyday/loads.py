"""What acts on everyday mechanisms: efforts and forces by tables and functions over time, coordinates and measurements.

Each builds itself through the public face by `call`, and says in `act` what it does (`oracle.forces.Scene`). Times of
tables and functions count from `t0`, the start of the run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from oracle.curves import Monotone, Spline
from oracle.drawing import GROUND, Array, Load, Spring
from oracle.forces import Call, Contact, Scene

import partita as pt

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Reading:
    """What a table is read at: a coordinate of a joint, a distance, a displacement or a cosine."""

    of: str
    joint: str = ""
    body1: str = ""
    point1: Point = (0.0, 0.0, 0.0)
    axis1: Point = (0.0, 0.0, 0.0)
    body2: str = ""
    point2: Point = (0.0, 0.0, 0.0)
    axis2: Point = (0.0, 0.0, 0.0)

    def measure(self) -> Any:
        if self.of == "joint":
            return self.joint
        if self.of == "distance":
            return pt.Distance(self.body1, self.point1, self.body2, self.point2)
        if self.of == "along":
            return pt.Along(self.body1, self.point1, self.axis1, self.body2, self.point2)
        return pt.Cosine(self.body1, self.axis1, self.body2, self.axis2)

    def value(self, at: Scene) -> float:
        if self.of == "joint":
            return at.joint(self.joint, 0)[0]
        turn1, turn2 = at.axes(self.body1)[0], at.axes(self.body2)[0]
        if self.of == "cosine":
            return float((turn1 @ np.array(self.axis1)) @ (turn2 @ np.array(self.axis2)))
        gap = at.motion_of(self.body2, np.array(self.point2))[0] - at.motion_of(self.body1, np.array(self.point1))[0]
        return float(np.linalg.norm(gap)) if self.of == "distance" else float((turn1 @ np.array(self.axis1)) @ gap)

    def moved(self, turn: Array, by: Array) -> Reading:
        changed = {}
        for i in "12":
            if getattr(self, f"body{i}") == GROUND:
                changed[f"point{i}"] = numbers(turn @ np.array(getattr(self, f"point{i}")) + by)
                changed[f"axis{i}"] = numbers(turn @ np.array(getattr(self, f"axis{i}")))
        return replace(self, **changed)


@dataclass(frozen=True)
class TableTorque:
    """Along a coordinate, by a table over time (`over` None) or a reading."""

    name: str
    joint: str
    coordinate: int
    curve: Monotone
    over: Reading | None
    t0: float = 0.0

    def call(self) -> Call:
        named: dict[str, Any] = {"coordinate": self.coordinate, "name": self.name}
        if self.over is None:
            return "add_torque", (self.joint, (self.curve.x + self.t0, self.curve.y)), named
        named |= {"over": self.over.measure(), "periodic": self.curve.periodic}
        return "add_torque", (self.joint, (self.curve.x, self.curve.y)), named

    def act(self, at: Scene) -> None:
        x = at.t - self.t0 if self.over is None else self.over.value(at)
        at.along(self.joint, self.coordinate, self.curve.value(x))


@dataclass(frozen=True)
class Law:
    """An effort as a function f(t, state): a swing over time, a bump over a coordinate, and a damper on it."""

    joint: str
    swing: tuple[float, float, float] = (0.0, 1.0, 0.0)
    bump: tuple[float, float, float] = (0.0, 0.0, 1.0)
    damping: float = 0.0
    t0: float = 0.0

    def of(self, t: Any, x: Any, rate: Any) -> Any:
        (a, w, p), (b, c, width) = self.swing, self.bump
        return a * np.cos(w * (t - self.t0) + p) + b * np.exp(-(((x - c) / width) ** 2)) - self.damping * rate

    def __call__(self, t: Any, state: Any) -> Any:
        return self.of(t, state.position(self.joint), state.velocity(self.joint))

    def __repr__(self) -> str:
        (a, w, p), (b, c, width) = self.swing, self.bump
        terms = [f"{a!r} * np.cos({w!r} * (t - {self.t0!r}) + {p!r})"] if a else []
        terms += [f"{b!r} * np.exp(-(((s.position({self.joint!r}) - {c!r}) / {width!r}) ** 2))"] if b else []
        terms += [f"-{self.damping!r} * s.velocity({self.joint!r})"] if self.damping else []
        return "lambda t, s: " + (" + ".join(terms) or "0.0")


@dataclass(frozen=True)
class FunctionTorque:
    """Along a coordinate, by a function of time and of a coordinate."""

    name: str
    joint: str
    coordinate: int
    law: Law

    def call(self) -> Call:
        return "add_torque", (self.joint, self.law), {"coordinate": self.coordinate, "name": self.name}

    def act(self, at: Scene) -> None:
        at.along(self.joint, self.coordinate, float(self.law.of(at.t, *at.joint(self.law.joint, 0))))


@dataclass(frozen=True)
class TableForce:
    """On a point, by a table over time along one direction of the world or of the body."""

    name: str
    body: str
    point: Point
    direction: Point
    curve: Monotone
    axes: str
    t0: float = 0.0

    def call(self) -> Call:
        values = np.outer(self.curve.y, self.direction)
        named = {"point": self.point, "axes": self.axes, "name": self.name}
        return "add_force", (self.body, (self.curve.x + self.t0, values)), named

    def act(self, at: Scene) -> None:
        # curves that go up and down with their entries are no sums: each component is a curve of its own
        force = np.array([
            Monotone(self.curve.x, self.curve.y * x).value(at.t - self.t0) for x in self.direction
        ])  # fmt: skip
        force = at.axes(self.body)[0] @ force if self.axes == "body" else force
        at.add_load(self.body, at.motion_of(self.body, np.array(self.point))[0], force)

    def moved(self, turn: Array, by: Array) -> TableForce:
        return replace(self, direction=numbers(turn @ np.array(self.direction))) if self.axes == "world" else self


@dataclass(frozen=True)
class Course:
    """A drive: rate s + amplitude (1 - cos(frequency s)), s = t - t0; `given`: with its derivatives."""

    name: str
    joint: str
    coordinate: int
    rate: float
    amplitude: float
    frequency: float
    given: bool = False
    t0: float = 0.0

    def __call__(self, t: Any) -> Any:
        s = t - self.t0
        return self.rate * s + self.amplitude * (1.0 - np.cos(self.frequency * s))

    def __repr__(self) -> str:
        t = f"(t - {self.t0!r})" if self.t0 else "t"
        return f"lambda t: {self.rate!r} * {t} + {self.amplitude!r} * (1 - np.cos({self.frequency!r} * {t}))"

    def position(self, t: float) -> float:
        return float(self(t))

    def derivatives(self, t: float) -> tuple[float, float]:
        a, w, s = self.amplitude, self.frequency, t - self.t0
        return self.rate + a * w * float(np.sin(w * s)), a * w**2 * float(np.cos(w * s))

    @property
    def course(self) -> dict[str, Any]:
        a, w = self.amplitude, self.frequency
        more = {
            "velocity": Wave(self.rate, a * w, w, "sin", self.t0),
            "acceleration": Wave(0.0, a * w * w, w, "cos", self.t0),
        }
        return {"position": self, **(more if self.given else {})}


@dataclass(frozen=True)
class Wave:
    """start + amplitude sin or cos(frequency (t - t0)), as a function and as its text."""

    start: float
    amplitude: float
    frequency: float
    of: str
    t0: float

    def __call__(self, t: Any) -> Any:
        return self.start + self.amplitude * getattr(np, self.of)(self.frequency * (t - self.t0))

    def __repr__(self) -> str:
        return f"lambda t: {self.start!r} + {self.amplitude!r} * np.{self.of}({self.frequency!r} * (t - {self.t0!r}))"


@dataclass(frozen=True)
class TableCourse:
    """A drive by a table over time, of positions or velocities; what is between the entries is Partita's own."""

    name: str
    joint: str
    coordinate: int
    level: str
    x: Array
    y: Array
    t0: float = 0.0

    @property
    def course(self) -> dict[str, Any]:
        return {self.level: (self.x + self.t0, self.y)}


def numbers(x: Array) -> Point:
    a, b, c = (float(value) for value in x)
    return a, b, c


def moved(f: Any, turn: Array, by: Array) -> Any:
    """A force on a mechanism that is turned, then shifted."""
    if isinstance(f, Spring):
        ends = {f"point{i}": turn @ getattr(f, f"point{i}") + by for i in "12" if getattr(f, f"body{i}") == GROUND}
        return replace(f, **ends)
    if isinstance(f, Contact):
        changed: dict[str, Any] = {}
        for i in "12":
            if getattr(f, f"body{i}") == GROUND:
                changed[f"point{i}"] = turn @ getattr(f, f"point{i}") + by
        if f.normal is not None and f.body2 == GROUND:
            changed["normal"] = turn @ f.normal
        return replace(f, **changed)
    if isinstance(f, Load):
        return replace(f, force=turn @ f.force) if f.axes == "world" else f
    if isinstance(f, TableTorque) and f.over is not None:
        return replace(f, over=f.over.moved(turn, by))
    return f.moved(turn, by) if hasattr(f, "moved") else f


def later(f: Any, by: float) -> Any:
    """A force or drive whose times begin later."""
    if hasattr(f, "law"):
        return replace(f, law=replace(f.law, t0=f.law.t0 + by))
    return replace(f, t0=f.t0 + by) if hasattr(f, "t0") else f


def renamed(f: Any, names: dict[str, str]) -> Any:
    """With bodies, joints and itself under other names."""
    keys = [key for key in ("name", "joint", "body", "body1", "body2") if hasattr(f, key)]
    f = replace(f, **{key: names.get(getattr(f, key), getattr(f, key)) for key in keys})
    for inner in ("over", "law"):
        if getattr(f, inner, None) is not None and not isinstance(getattr(f, inner), str):
            part = getattr(f, inner)
            changed = {
                k: names.get(getattr(part, k), getattr(part, k))
                for k in ("joint", "body1", "body2")
                if hasattr(part, k)
            }
            f = replace(f, **{inner: replace(part, **changed)})
    return f


def is_function(f: Any) -> bool:
    """Whether it is a Python function, which no file holds."""
    return isinstance(f, FunctionTorque | Course) or (isinstance(f, Load) and f.swing != 0.0)


__all__ = ["Monotone", "Spline"]
