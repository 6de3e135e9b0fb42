"""What is drawn twice, by chance: hinges of doors, bearings of a shaft, balls in one centre, both sides of a lift or of
a bonnet. Within the drawing tolerance it moves as the exact drawing, or is refused by name; beyond it, it is a
structure. It never counts as locked within the tolerance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from thorough import either

import partita as pt

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)
BOTH = ("relative", "absolute")
WITHIN = 3e-5
"""Of the drawing tolerance of 1e-4: what two joints are off adds up."""


class Sketch:
    """A mechanism in any place and attitude, joints shifted and tilted by up to `error`."""

    def __init__(self, seed: int, error: float, size: float = 1.0) -> None:
        self.rng = np.random.default_rng([11, seed])
        self.m = pt.Mechanism("doubled", gravity=(0.3, -9.81, 0.7))
        self.error, self.size = error, size
        self.shifts: dict[str, Array] = {}
        """What some joints are off by besides."""
        self.joints: list[tuple[str, str, str, str, dict[str, Any]]] = []
        turn, _ = np.linalg.qr(self.rng.normal(size=(3, 3)))
        self.turn = turn * np.sign(np.linalg.det(turn)) if seed % 2 else np.eye(3)
        self.origin = self.rng.normal(size=3) if seed % 4 > 1 else np.zeros(3)

    def place(self, p: ArrayLike) -> tuple[float, ...]:
        return tuple(self.turn @ (self.size * np.asarray(p, dtype=float)) + self.origin)

    def body(self, name: str, at: ArrayLike) -> str:
        inertia = self.size**2 * np.array([0.1, 0.12, 0.15])
        self.m.add_body(name, 1.0 + self.rng.random(), tuple(inertia), position=self.place(at))
        return name

    def off(self, often: float) -> Array:
        away = self.rng.uniform(-1.0, 1.0, 3) / np.sqrt(3.0)
        return self.error * away if self.rng.random() < often else np.zeros(3)

    def joint(
        self, kind: str, name: str, parent: str, child: str, point: ArrayLike, axis: ArrayLike | None = Z
    ) -> None:
        there = self.place(np.asarray(point) + self.shifts.get(name, np.zeros(3)) + self.off(0.7))
        options: dict[str, Any] = {"point": there}
        if axis is not None:
            direction = np.asarray(axis) + self.off(0.3)
            options["normal" if kind == "planar" else "axis"] = tuple(self.turn @ direction)
        self.joints.append((kind, name, parent, child, options))

    def hinge(self, name: str, parent: str, child: str, point: ArrayLike, axis: ArrayLike = Z) -> None:
        self.joint("revolute", name, parent, child, point, axis)

    def made(self) -> pt.Mechanism:
        for i in self.rng.permutation(len(self.joints)):
            kind, name, parent, child, options = self.joints[i]
            getattr(self.m, f"add_{kind}")(name, parent, child, **options)
        return self.m


def door(s: Sketch) -> int:
    s.body("door", (0.4, 0.1, 0.0))
    s.hinge("low", "ground", "door", (0, 0, -0.8))
    s.hinge("up", "ground", "door", (0, 0, 0.8))
    return 1


def three_hinges(s: Sketch) -> int:
    door(s)
    s.hinge("between", "ground", "door", (0, 0, 0.1))
    return 1


def beside(kind: str, axis: ArrayLike | None = Z) -> Callable[[Sketch], int]:
    def made(s: Sketch) -> int:
        s.body("door", (0.4, 0.1, 0.0))
        s.hinge("low", "ground", "door", (0, 0, -0.8))
        s.joint(kind, "up", "ground", "door", (0, 0, 0.8), axis)
        return 1

    return made


def two_cylinders(s: Sketch) -> int:
    s.body("rod", (0.4, 0.1, 0.0))
    s.joint("cylindrical", "low", "ground", "rod", (0, 0, -0.8))
    s.joint("cylindrical", "up", "ground", "rod", (0, 0, 0.8))
    return 2


def balls(*heights: float) -> Callable[[Sketch], int]:
    def made(s: Sketch) -> int:
        s.body("rod", (0.4, 0.1, 0.0))
        for i, z in enumerate(heights):
            s.joint("spherical", f"ball{i}", "ground", "rod", (0, 0, z), None)
        return 3 if len(set(heights)) == 1 else 1

    return made


def gyroscope(s: Sketch) -> int:
    """Rings in two bearings each."""
    for name in ("outer", "inner", "rotor"):
        s.body(name, (0, 0, 0))
    for k, side in (("1", 1.0), ("2", -1.0)):
        s.hinge("O" + k, "ground", "outer", (0, 0.5 * side, 0), Y)
        s.hinge("I" + k, "outer", "inner", (0.45 * side, 0, 0), X)
        s.hinge("R" + k, "inner", "rotor", (0, 0, 0.35 * side), Z)
    return 3


def pendulum_on_a_shaft(s: Sketch) -> int:
    s.body("shaft", (0, 0, 0))
    s.body("pendulum", (0, -0.3, 0.1))
    s.hinge("a", "ground", "shaft", (0, 0, -0.5))
    s.hinge("b", "ground", "shaft", (0, 0, 0.5))
    s.hinge("pivot", "shaft", "pendulum", (0, 0, 0.1), X)
    return 2


def slider_crank(s: Sketch) -> int:
    """Its crank in two bearings."""
    crank = np.array([0.2 * np.cos(0.7), 0.2 * np.sin(0.7), 0.0])
    piston = np.array([crank[0] + np.sqrt(0.36 - crank[1] ** 2), 0.0, 0.0])
    for name, at in (("crank", crank / 2), ("rod", (crank + piston) / 2), ("piston", piston)):
        s.body(name, at)
    s.hinge("A1", "ground", "crank", (0, 0, -0.1))
    s.hinge("A2", "ground", "crank", (0, 0, 0.1))
    s.hinge("B", "crank", "rod", crank)
    s.hinge("C", "rod", "piston", piston)
    s.joint("prismatic", "P", "ground", "piston", piston, X)
    return 1


def lid(s: Sketch) -> int:
    """On two hinges and a strut, which spins."""
    foot, head = np.array([0.1, -0.4, 0.4]), np.array([0.35, 0.0, 0.4])
    for name, at in (("lid", (0.4, 0.1, 0)), ("tube", foot + 0.3 * (head - foot)), ("rod", foot + 0.7 * (head - foot))):
        s.body(name, at)
    s.hinge("h1", "ground", "lid", (0, 0, -0.4))
    s.hinge("h2", "ground", "lid", (0, 0, 0.4))
    s.joint("spherical", "s1", "ground", "tube", foot, None)
    s.joint("prismatic", "slide", "tube", "rod", (foot + head) / 2, head - foot)
    s.joint("spherical", "s2", "rod", "lid", head, None)
    return 2


def bonnet(s: Sketch) -> int:
    """On equal four-bar hinges left and right."""
    points = [np.array(p) for p in ((0, 0, 0), (0.1, 0.3, 0), (0.6, 0.35, 0), (0.55, 0, 0))]
    s.body("bonnet", (0.35, 0.4, 0.45))
    for k in (0, 1):
        a, b, c, d = (p + 0.9 * k * Z for p in points)
        s.body(f"crank{k}", (a + b) / 2)
        s.body(f"rocker{k}", (c + d) / 2)
        s.hinge(f"A{k}", "ground", f"crank{k}", a)
        s.hinge(f"B{k}", f"crank{k}", "bonnet", b)
        s.hinge(f"C{k}", "bonnet", f"rocker{k}", c)
        s.hinge(f"D{k}", "ground", f"rocker{k}", d)
    return 1


def lift(stages: int, sides: int) -> Callable[[Sketch], int]:
    """A platform on scissors, each side on a fixed hinge and a shoe above and below."""
    wide, high, deep = 0.8, 0.4, 0.5

    def made(s: Sketch) -> int:
        s.body("platform", (wide / 2, stages * high, deep / 2))
        for k in range(sides):
            at = lambda x, y, k=k: np.array([x, y, deep * k])  # noqa: E731
            for i in range(stages):
                for arm in "ab":
                    s.body(f"{arm}{i}{k}", at(wide / 2, (i + 0.5) * high))
                s.hinge(f"X{i}{k}", f"a{i}{k}", f"b{i}{k}", at(wide / 2, (i + 0.5) * high))
                if i:
                    s.hinge(f"L{i}{k}", f"b{i - 1}{k}", f"a{i}{k}", at(0, i * high))
                    s.hinge(f"R{i}{k}", f"a{i - 1}{k}", f"b{i}{k}", at(wide, i * high))
            last = stages - 1
            s.hinge(f"A{k}", "ground", f"a0{k}", at(0, 0))
            s.hinge(f"T{k}", f"b{last}{k}", "platform", at(0, stages * high))
            for name, arm, carrier, y in (("S", "b0", "ground", 0.0), ("H", f"a{last}", "platform", stages * high)):
                s.body(f"shoe {name}{k}", at(wide, y))
                s.hinge(f"{name}{k}", f"shoe {name}{k}", f"{arm}{k}", at(wide, y))
                s.joint("prismatic", f"P{name}{k}", carrier, f"shoe {name}{k}", at(wide, y), X)
        return 1

    return made


PAIRS: dict[str, Callable[[Sketch], int]] = {
    "door": door,
    "three hinges": three_hinges,
    "hinge and cylinder": beside("cylindrical"),
    "hinge and ball": beside("spherical", None),
    "hinge and point on a line": beside("point_on_line"),
    "two cylinders": two_cylinders,
    "two balls in one centre": balls(0.0, 0.0),
    "two balls": balls(-0.7, 0.5),
    "three balls in line": balls(-0.7, 0.0, 0.5),
    "gyroscope": gyroscope,
    "pendulum on a shaft": pendulum_on_a_shaft,
    "slider-crank": slider_crank,
}
SIDES: dict[str, Callable[[Sketch], int]] = {
    "lid": lid,
    "bonnet": bonnet,
    "lift": lift(1, 2),
    "lift of two stages": lift(2, 2),
    "tall lift": lift(5, 2),
}


def off(seed: int) -> float:
    return float(10.0 ** np.random.default_rng([12, seed]).uniform(-12.0, np.log10(WITHIN)))


@pytest.mark.parametrize("seed", range(either(4, 40)))
@pytest.mark.parametrize("name", PAIRS)
def test_joints_side_by_side_leave_what_one_line_leaves(name: str, seed: int) -> None:
    """None is refused: what is right needs no search."""
    error = 0.0 if seed == 0 else off(seed)
    s = Sketch(seed, error, size=(1.0, 0.03, 40.0, 1.0)[seed % 4])
    # errors are fractions of the size
    mobility = PAIRS[name](s)
    m, coordinates = s.made(), BOTH[seed % 2]
    assert m.compile(coordinates=coordinates).mobility == mobility, (name, error)
    if seed < 2:
        run = m.simulate(0.02, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", (run.message, run.certificate.findings)


@pytest.mark.parametrize("seed", range(either(2, 20)))
@pytest.mark.parametrize("name", SIDES)
def test_both_sides_move_as_one(name: str, seed: int) -> None:
    s = Sketch(seed, off(seed + 50))
    mobility = SIDES[name](s)
    assert s.made().compile(coordinates=BOTH[seed % 2]).mobility == mobility, (name, s.error)


ONE_STAGE = {"S1": (0, -1, 0), "H1": (0, 1, 0)}
TWO_STAGES = {"X11": (0.4, 1, 0.1), "R11": (0, 0.6, -1), "T1": (0, 1, 0.9), "S1": (0, 1, 0), "A0": (-1, 0, 0)}


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize(("stages", "shifts"), [(1, ONE_STAGE), (2, TWO_STAGES), (3, TWO_STAGES), (8, ONE_STAGE)])
@pytest.mark.parametrize("error", [1e-8, 1e-6, 2e-5])
def test_some_points_of_one_side_are_off(
    error: float, stages: int, shifts: dict[str, tuple[float, ...]], coordinates: str
) -> None:
    s = Sketch(0, 0.0)
    s.shifts = {name: error * np.array(by) for name, by in shifts.items()}
    lift(stages, 2)(s)
    assert s.made().compile(coordinates=coordinates).mobility == 1


@pytest.mark.parametrize("name", ["door", "hinge and ball", "three balls in line"])
def test_beyond_the_tolerance_it_is_a_structure(name: str) -> None:
    s = Sketch(0, 0.02)
    PAIRS[name](s)
    run = s.made().simulate(0.02)
    assert s.m.compile().mobility == 0 and any("structure" in note for note in run.notes)


def path(m: pt.Mechanism, body: str, coordinates: str) -> Array:
    start = m.assemble(t=2.0, coordinates=coordinates)
    run = m.simulate(0.3, t_eval=2.0 + np.linspace(0.0, 0.3, 4), initial=start, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid", (run.message, run.certificate.findings)
    stepper = m.stepper(0.03, initial=start, coordinates=coordinates)
    for _ in range(10):
        stepper.step()
    positions = np.asarray(run.body(body).position)
    assert np.abs(stepper.result().body(body).position[-1] - positions[-1]).max() < 1e-6
    return positions


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("name", ["door", "gyroscope", "bonnet", "lift of two stages"])
def test_it_moves_as_the_exact_drawing(name: str, coordinates: str) -> None:
    make = (PAIRS | SIDES)[name]
    drawings = [Sketch(1, error) for error in (0.0, 1e-6)]
    for s in drawings:
        make(s)
    body = next(iter(drawings[0].m.bodies))
    exact, near = (path(s.made(), body, coordinates) for s in drawings)
    assert np.abs(near - exact).max() < 1e-4


@pytest.mark.parametrize("digits", [4, 5, 6])
def test_motors_left_and_right_have_one_zero(digits: int) -> None:
    """A bonnet drawn to a few digits, both cranks driven alike: the repair leaves them one zero."""
    m = pt.Mechanism("bonnet", gravity=(0, -9.81, 0))
    m.add_body("bonnet", 10.0, (0.1, 0.12, 0.15), position=(0.35, 0.4, 0.45))
    rng = np.random.default_rng(digits)
    points = [np.array(p) for p in ((0, 0, 0), (0.1, 0.3, 0), (0.6, 0.35, 0), (0.55, 0, 0))]
    shaken = lambda p: tuple(p + 10.0**-digits * rng.uniform(-0.5, 0.5, 3))  # noqa: E731
    for k in (0, 1):
        a, b, c, d = (p + 0.9 * k * Z for p in points)
        m.add_body(f"crank{k}", 1.0, (0.01, 0.01, 0.01), position=(a + b) / 2)
        m.add_body(f"rocker{k}", 1.0, (0.01, 0.01, 0.01), position=(c + d) / 2)
        for name, parent, child, p in (
            (f"A{k}", m.ground, f"crank{k}", a),
            (f"B{k}", f"crank{k}", "bonnet", b),
            (f"C{k}", "bonnet", f"rocker{k}", c),
            (f"D{k}", m.ground, f"rocker{k}", d),
        ):
            m.add_revolute(name, parent, child, shaken(p), (0, 0, 1))
        m.add_drive(f"A{k}", position=lambda t: 0.3 * t)
    run = m.simulate(0.5)
    assert run.success and run.certificate.verdict == "valid", (run.message, run.certificate.findings)
    assert max(abs(run.joint(name).angle[-1] - 0.15) for name in ("A0", "A1")) < 1e-9
