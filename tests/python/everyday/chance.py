"""Everyday cases by chance: a mechanism, what acts on it, how it is drawn, started and run."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from oracle.chance import rotation
from oracle.curves import Monotone
from oracle.drawing import GROUND, Drawing, Spring, Torque, Torsion
from oracle.forces import Contact, Stop

from .case import Case, moved, off, rounded, shaken
from .kinds import KINDS, Kind
from .loads import Course, FunctionTorque, Law, Reading, TableCourse, TableForce, TableTorque, numbers

METHODS = ("dop853", "dopri5", "tsit5", "adams")
FORMULATIONS = ("wehage-haug", "explicit-closing", "multipliers", "sparse-multipliers", "range-space", "svd", "qr",
                "zero-eigenvalue", "gram-schmidt", "tangent-space")  # fmt: skip
OTHERWISE = (
    {"correction": "kantorovich"}, {"correction": "mass-orthogonal"}, {"selection": "greedy"},
    {"selection": "geometric"}, {"selection": "persistence", "window": 0.05}, {"switch_threshold": 1.0},
    {"switch_threshold": 3.0}, {"compiled": True}, {"compiled": False},
)  # fmt: skip
"""Options that no motion depends on."""
TOLERANCES = (1e-6, 1e-6, 1e-8)


@dataclass(frozen=True)
class Ranges:
    """How far chance goes. `error`: of drawings, as a power of ten; `narrow`: of features, as a fraction of what they
    are read at (a turn, the time of the run); `exact`: the part of drawings that have no error; `starts`: times at
    which a run begins, `rest`: those of a run from rest; `large`: drawings of more bodies have no error;
    `options`: whether other formulations and rules of choice are drawn as well."""

    error: tuple[float, float] = (-12.0, -9.0)
    narrow: tuple[float, float] = (-1.5, -0.5)
    exact: float = 0.5
    starts: tuple[float, ...] = (0.0, 0.3, -5.0)
    rest: tuple[float, ...] = (0.0,)
    large: int = 5
    options: bool = False


TEST = Ranges()
MID = Ranges(error=(-12.0, -9.0), narrow=(-3.0, -0.5), exact=0.7, options=True)
EVER = (0.0, 0.3, -5.0, 1e3, 1e6)
WIDE = Ranges(error=(-12.0, -4.0), narrow=(-3.0, -0.5), exact=0.35, starts=EVER, rest=EVER, large=99, options=True)


class Chance:
    """A case under way."""

    def __init__(self, kind: Kind, rng: Any, ranges: Ranges, duration: float, speeds: dict[str, float]) -> None:
        self.kind, self.rng, self.ranges, self.duration, self.speeds = kind, rng, ranges, duration, speeds
        self.forces: list[Any] = []
        self.drives: list[Any] = []
        self.finest = 0.02 * duration
        # of a large mechanism a reference may take fewer steps
        self.shortest = duration * (1 + len(kind.drawing.bodies)) / 8000.0
        weights = [b.mass for b in kind.drawing.bodies]
        self.mass = float(np.mean(weights))
        arm = max(float(np.linalg.norm(p)) for _, p in kind.tips) or 0.1
        pace = max([abs(x) for x in speeds.values()] + [1.0])
        self.effort = float(f"{self.mass * max(9.81 * arm, (arm * pace) ** 2 * 0.1):.2g}")
        self.arm = arm

    def number(self, low: float, high: float) -> float:
        return float(f"{self.rng.uniform(low, high):.3g}")

    def maybe(self, chance: float) -> bool:
        return bool(self.rng.random() < chance)

    def one(self, of: Any) -> Any:
        return of[int(self.rng.integers(len(of)))]

    def moving(self) -> tuple[str, float]:
        """A joint that may be moved, and how fast."""
        joint, pace = self.one(self.kind.inputs)
        return joint, max(abs(self.speeds.get(joint, 0.0)), pace, 0.5)

    def is_slide(self, joint: str) -> bool:
        return next(j for j in self.kind.drawing.joints if j.name == joint).kind == "prismatic"

    def tip(self) -> tuple[str, Any]:
        return self.one(self.kind.tips)

    def feature(self, start: float, end: float, low: float, high: float) -> tuple[Any, Any, float]:
        """Zero but for a bump, a step or a comb between `low` and `high`; and how wide its flanks are."""
        extent = high - low
        width = float(f"{extent * 10.0 ** self.rng.uniform(*self.ranges.narrow):.2g}")
        c = self.number(low + 0.1 * extent, high - 0.1 * extent)
        what = self.one(["bump", "bump", "step", "comb"])
        if what == "step":
            x, y = [start, c - 0.5 * width, c + 0.5 * width, end], [0.0, 0.0, 1.0, 1.0]
        elif what == "comb":
            x, y = [start], [0.0]
            for k in range(3):
                at = c + 3.0 * width * k
                if at + width < end:
                    x += [at - width, at - 0.3 * width, at + 0.3 * width, at + width]
                    y += [0.0, 1.0, 1.0, 0.0]
            x, y = [*x, end], [*y, 0.0]
        else:
            x = [start, c - width, c - 0.5 * width, c + 0.5 * width, c + width, end]
            y = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
        kept = [i for i in range(len(x)) if start <= x[i] <= end and (i == 0 or x[i] > max(x[:i]) + 1e-12)]
        return np.array([x[i] for i in kept]), np.array([y[i] for i in kept]), 0.3 * width

    def wave(self, start: float, end: float, low: float, high: float, closed: bool = False) -> tuple[Any, Any, float]:
        """Values by chance at some places."""
        inner = np.sort(np.round(self.rng.uniform(low, high, size=int(self.rng.integers(3, 8))), 3))
        x = np.unique(np.concatenate([[start], inner[(inner > start) & (inner < end)], [end]]))
        y = np.round(self.rng.uniform(-1.0, 1.0, size=len(x)), 2)
        y[0] = 0.0
        y[-1] = 0.0 if closed else y[-1]
        return x, y, 0.3 * float(np.diff(x).min())

    def resolved(self, width: float, speed: float) -> None:
        """The reference takes steps within this width passed at this speed."""
        self.finest = min(self.finest, max(self.shortest, 0.5 * width / max(speed, 1e-3)))

    def table_torque(self, name: str) -> None:
        joint, _ = self.moving()
        over = self.one(["time", "own", "own", "other", "distance", "along", "cosine"])
        reading, periodic = None, False
        size = self.arm
        if over == "time":
            start, end, low, high, speed = -1.0, 10.0, 0.0, self.duration, 1.0
        elif over in ("own", "other"):
            at, pace = (joint, self.moving()[1]) if over == "own" else self.moving()
            reading = Reading("joint", joint=at)
            span = 1.5 * pace * self.duration
            if self.is_slide(at):
                start, end, low, high, speed = -200.0, 200.0, -span, span, pace
            else:
                periodic, speed = self.maybe(0.6), pace
                start, end, low, high = (-400.0, 400.0, -span, span)
                if periodic:
                    period = self.one([2.0 * np.pi, np.pi, 2.0 * np.pi / 3.0, self.number(0.5, 7.0)])
                    start = self.one([0.0, 0.0, -np.pi, self.number(-9.0, 9.0)])
                    end = start + period
                    low, high = start, end
        else:
            body, point = self.tip()
            speed = self.moving()[1] * size
            named = {"body2": body, "point2": numbers(point)}
            named |= {"body1": GROUND, "point1": numbers(self.place_of(body, point) + self.direction(size))}
            if over == "distance":
                start, end, low, high = 0.0, 60.0 * size, 0.2 * size, 2.0 * size
            elif over == "along":
                named["axis1"] = numbers(self.one(np.eye(3)[:2]))
                start, end, low, high = -60.0 * size, 60.0 * size, -size, size
            else:
                named |= {"axis1": (1.0, 0.0, 0.0), "axis2": (1.0, 0.0, 0.0)}
                named |= {"point1": (0.0, 0.0, 0.0), "point2": (0.0, 0.0, 0.0)}
                start, end, low, high, speed = -1.5, 1.5, -0.9, 0.9, self.moving()[1]
            reading = Reading(over, **named)
        x, y, width = (
            self.feature(start, end, low, high) if self.maybe(0.7) else self.wave(start, end, low, high, periodic)
        )
        if periodic:
            y[-1] = y[0]
        self.resolved(width, 2.0 * speed)
        curve = Monotone(x, y * self.effort * self.number(-1.0, 1.0), periodic)
        self.forces.append(TableTorque(name, joint, 0, curve, reading))

    def place_of(self, body: str, point: Any) -> Any:
        return next(b for b in self.kind.drawing.bodies if b.name == body).position + point

    def direction(self, length: float) -> Any:
        x = self.rng.normal(size=3)
        return np.round(length * x / np.linalg.norm(x), 3)

    def function_torque(self, name: str) -> None:
        joint, pace = self.moving()
        at, at_pace = self.moving()
        swing, bump, damping = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.0
        what = self.one(["swing", "bump", "damping"])
        if what == "swing":
            swing = self.effort * self.number(-0.5, 0.5), self.number(1.0, 15.0) / self.duration, self.number(0, 6)
        elif what == "bump":
            extent = at_pace * self.duration
            bump = self.effort * self.number(-0.5, 0.5), self.number(-extent, extent), self.number(0.2, 0.5) * extent
        else:
            damping = self.effort / pace * self.number(0.05, 0.3)
            at = joint
        self.forces.append(FunctionTorque(name, joint, 0, Law(at, swing, bump, damping)))

    def table_force(self, name: str) -> None:
        body, point = self.tip()
        x, y, width = (self.feature if self.maybe(0.6) else self.wave)(-1.0, 10.0, 0.0, self.duration)
        self.resolved(width, 1.0)
        curve = Monotone(x, y * self.effort / self.arm * self.number(-1.0, 1.0))
        direction = numbers(np.round(self.direction(1.0), 3))
        self.forces.append(TableForce(name, body, numbers(point), direction, curve, self.one(["world", "body"])))

    def spring(self, name: str) -> None:
        body, point = self.tip()
        at = self.place_of(body, point)
        anchor = np.round(at + self.direction(self.number(0.5, 1.5) * self.arm), 3)
        stiffness = self.effort / self.arm**2 * self.number(0.3, 3.0)
        damping = stiffness * self.number(0.0, 0.1) if self.maybe(0.5) else 0.0
        self.forces.append(Spring(name, body, point, GROUND, anchor, stiffness, damping, self.number(0.3, 1.2)))

    def torsion(self, name: str) -> None:
        joint, pace = self.moving()
        stiffness = self.effort / max(pace * self.duration, 0.3) * self.number(0.1, 2.0)
        self.forces.append(Torsion(name, joint, 0, stiffness, 0.0, self.number(-0.5, 0.5)))

    def torque(self, name: str) -> None:
        self.forces.append(Torque(name, self.moving()[0], 0, self.effort * self.number(-0.5, 0.5)))

    def stop(self, name: str) -> None:
        """Passed at speed: somewhere on the way."""
        joint, pace = self.moving()
        rate = self.speeds.get(joint, 0.0)
        at = self.number(0.2, 0.9) * max(abs(rate), 0.5) * self.duration
        arm = 1.0 if self.is_slide(joint) else self.arm
        inertia = self.mass * arm**2
        stiffness = float(f"{inertia * (10.0 ** self.rng.uniform(1.3, 3.0)) ** 2:.2g}")
        self.touches(inertia, stiffness)
        upper, lower = (at, None) if rate >= 0.0 else (None, -at)
        if self.maybe(0.3):
            upper, lower = at, -at
        damping, exponent = self.one([0.0, 0.0, 0.3 / pace]), self.one([1.0, 1.0, 1.5])
        self.forces.append(Stop(name, joint, 0, lower, upper, stiffness, damping, exponent))

    def touches(self, mass: float, stiffness: float) -> None:
        time = float(np.pi * np.sqrt(mass / stiffness))
        self.finest = min(self.finest, max(self.shortest, 0.1 * time))

    def contact(self, name: str) -> None:
        """A tip against the ground's plane, or two tips that strike."""
        stiffness = float(f"{self.mass * (10.0 ** self.rng.uniform(1.5, 3.0)) ** 2:.2g}")
        self.touches(0.3 * self.mass, stiffness)
        body, point = self.tip()
        law = {"stiffness": stiffness, "exponent": self.one([1.0, 1.5]), "damping": self.one([0.0, 0.0, 0.1]),
               "friction": 0.0, "static": 0.0, "slow": 1.0}  # fmt: skip
        if self.kind.pairs and self.maybe(0.7):
            one, other = self.one(self.kind.pairs)
            ends = dict(self.kind.tips)
            self.forces.append(
                Contact(name, one, ends[one], other, ends[other], 0.02, None, self.number(0.02, 0.06), **law)
            )
            return
        normal = -self.direction(1.0) * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(normal))
        normal = np.array([0.0, 1.0, 0.0]) if length < 0.1 else np.round(normal / length, 3)
        normal = normal / np.linalg.norm(normal)
        radius = self.number(0.01, 0.05)
        at = self.place_of(body, point) - (radius + self.number(0.02, 0.6) * self.arm) * normal
        self.forces.append(Contact(name, body, point, GROUND, at, radius, normal, None, **law))

    def drive(self) -> None:
        """One joint by a function or a table, on its way from where it is drawn."""
        joint, pace = self.moving()
        pace = min(pace, 4.0) * (0.3 if self.is_slide(joint) else 1.0)
        if self.kind.words in ("scissor lift", "parallelogram"):
            pace = min(pace, 0.3)
        if self.maybe(0.5):
            drive: Any = Course(
                "drive", joint, 0, self.number(-0.5, 0.5) * pace, self.number(-0.2, 0.2) * pace * self.duration,
                self.number(2.0, 8.0) / self.duration, self.maybe(0.8),
            )  # fmt: skip
        else:
            x = np.round(np.linspace(0.0, 1.2 * self.duration, int(self.rng.integers(3, 7))), 4)
            y = np.round(self.rng.uniform(-0.4, 0.4, size=len(x)) * pace, 3)
            level = self.one(["position", "velocity"])
            if level == "position":
                y = np.round(y * self.duration, 4)
                y[0] = 0.0
            self.resolved(0.2 * float(np.diff(x).min()), 1.0)
            drive = TableCourse("drive", joint, 0, level, x, y)
        self.drives.append(drive)


LOADS = (
    Chance.table_torque, Chance.table_torque, Chance.table_torque, Chance.function_torque, Chance.table_force,
    Chance.spring, Chance.torsion, Chance.torque, Chance.stop, Chance.stop, Chance.contact,
)  # fmt: skip


def case(seed: int, ranges: Ranges = TEST) -> Case:
    """The case of a number."""
    rng = np.random.default_rng([seed, 57])
    kind = KINDS[seed % len(KINDS)](rng)
    rest = rng.random() < 0.25
    rates = {}
    if not rest:
        chosen = kind.inputs if kind.mobility == len(kind.inputs) else kind.inputs[:1]
        rates = {joint: float(f"{pace * rng.uniform(0.3, 1.5) * rng.choice([-1, 1]):.3g}") for joint, pace in chosen}
    nudged = [joint for joint, _ in kind.inputs][: kind.mobility]
    pace = max([abs(x) for x in rates.values()] + [kind.inputs[0][1] * 0.3])
    slow = kind.words in ("scissor lift", "parallelogram")
    duration = float(f"{min((0.5 if slow else 3.0) / pace, 2.0) * rng.uniform(0.4, 1.0):.3g}")
    made = Chance(kind, rng, ranges, duration, rates)
    for k in range(int(rng.integers(1, 4))):
        made.one(LOADS)(made, f"load {k}")
    mobility = kind.mobility
    if rng.random() < 0.2:
        made.drive()
        mobility -= 1
        driven = made.drives[0].joint
        rates = {name: x for name, x in rates.items() if name != driven} if mobility else {}
        nudged = [name for name in nudged if name != driven][:mobility]
    size = max(float(np.linalg.norm(p)) for _, p in kind.tips)
    d = replace(
        kind.drawing, forces=tuple(made.forces), drives=tuple(made.drives), size=size, mass=made.mass,
        time=1.0 / pace, seed=seed,
    )  # fmt: skip
    if rng.random() < 0.6:
        d = moved(d, rotation(rng), np.round(rng.normal(size=3), 2))
    exact, error = d, 0.0
    if rng.random() >= ranges.exact and len(d.bodies) <= ranges.large:
        power = rng.uniform(*ranges.error)
        digits = round(-power)
        d = rounded(d, digits) if digits <= 9 and rng.random() < 0.5 else shaken(d, 10.0**power, rng)
        error = off(d, exact)
    options: dict[str, Any] = {"rtol": float(rng.choice(TOLERANCES))}
    options["atol"] = options["rtol"] / 100.0
    if rng.random() < 0.4:
        options["method"] = str(rng.choice(METHODS))
    if rng.random() < 0.4:
        options["coordinates"] = "absolute"
    if ranges.options and rng.random() < 0.25:
        options["formulation"] = str(rng.choice(FORMULATIONS))
    elif ranges.options and rng.random() < 0.3:
        options |= OTHERWISE[int(rng.integers(len(OTHERWISE)))]
    made_case = Case(
        d, exact, error, mobility, tuple(rates.items()), 0.0, duration, made.finest, pace, options,
        int(rng.choice([2, 2, 7, 101])), seed, tuple(nudged),
    )  # fmt: skip
    starts = ranges.starts if rates else ranges.rest
    return replace(made_case.later(float(rng.choice(starts))), starts=starts)


def kinds_of(d: Drawing) -> Counter[str]:
    """What there is in a drawing."""
    found = Counter(type(x).__name__ for x in (*d.forces, *d.drives, *d.couplings))
    for f in d.forces:
        if isinstance(f, TableTorque):
            found[f"table over {f.over.of if f.over else 'time'}"] += 1
    return found
