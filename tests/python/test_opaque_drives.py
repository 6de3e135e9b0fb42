"""Drives and followers by functions that only Python can evaluate: as right as with derivatives, at three times the
calls."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from drawings import four_bar
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

import partita as pt
from partita.builder.motion import Motion
from partita.builder.pieces import Pieces, first_interval
from partita.builder.taylor import Jet

POINTS = ((0, 0), (0.4, 0), (1.2, 0.8), (1.1, 0))
TIMES = np.linspace(-1.0, 4.0, 51)
CUBIC, PCHIP = CubicSpline(TIMES, 0.3 * np.sin(3.0 * TIMES)), PchipInterpolator(TIMES, 0.3 * np.sin(3.0 * TIMES))

Function = Callable[[float], float]


class Course(NamedTuple):
    """A function with its derivatives, and when it is run."""

    functions: tuple[Function, Function, Function]
    begin: float = 0.0
    duration: float = 1.0
    off: float = 1e-8
    """Allowed error of accelerations, as a fraction of the largest."""
    longest: float = 1e3
    """Longest step."""


def sine(size: float, rate: float, zero: float = 0.0) -> tuple[Function, Function, Function]:
    return (
        lambda t: size * math.sin(rate * (t - zero)),
        lambda t: size * rate * math.cos(rate * (t - zero)),
        lambda t: -size * rate**2 * math.sin(rate * (t - zero)),
    )


def bump(at: float, width: float) -> tuple[Function, Function, Function]:
    """A sine, and a bell on it."""

    def bell(t: float) -> tuple[float, float, float]:
        x = (t - at) / width
        y = 0.01 * math.exp(-x * x)
        return y, -2.0 * x * y / width, (4.0 * x * x - 2.0) * y / width**2

    base = sine(0.3, 0.3)
    return tuple(lambda t, k=k: base[k](t) + bell(t)[k] for k in range(3))  # type: ignore[return-value]


def spline(curve: Any) -> tuple[Function, Function, Function]:
    return tuple(lambda t, k=k: float(curve(t, k)) for k in range(3))  # type: ignore[return-value]


def parted(t: float) -> float:
    """A motion whose acceleration jumps from -1 to 1."""
    return t + 0.5 * math.fabs(t - 0.31) * (t - 0.31)


def only_within(f: Function, end: float) -> Function:
    def function(t: float) -> float:
        if not 0.0 <= t <= end:
            raise ValueError("outside")
        return f(t)

    return function


JUMPING = (parted, lambda t: 1.0 + math.fabs(t - 0.31), lambda t: math.copysign(1.0, t - 0.31))
ROUNDED = (lambda t: round(0.3 * math.sin(3.0 * t), 12), *sine(0.3, 3.0)[1:])
COURSES = {
    "sine": Course(sine(0.3, 3.0), 0.0, 3.0),
    "slow and long": Course(sine(0.3, 0.03), 0.0, 400.0),
    "fast": Course(sine(0.05, 200.0), 0.0, 0.2),
    "late": Course(sine(0.3, 3.0, 1e3), 1e3, 2.0),
    "late, with its own rounding": Course(sine(0.3, 3.0), 1e3, 2.0, 1e-7),
    "before zero": Course(sine(0.3, 3.0), -2.0, 3.0),
    "spline": Course(spline(CUBIC), 0.03, 1.0),
    "acceleration jumps": Course(JUMPING),
    "twelve digits": Course(ROUNDED, 0.0, 1.0, 1e-6),
    "ends with the run": Course((only_within(sine(0.3, 3.0)[0], 0.7), *sine(0.3, 3.0)[1:]), 0.0, 0.7),
    "bell": Course(bump(0.5, 0.01), 0.0, 1.0, 1e-8, 0.02),
    "a bell between samples": Course(bump(27.1, 0.01), 26.0, 3.0, 1e-8, 0.02),
}


def counted(f: Function, calls: list[float]) -> Function:
    def function(t: float) -> float:
        calls.append(t)
        return f(t)

    return function


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", COURSES)
def test_as_right_as_the_closed_form_at_three_times_its_calls(name: str, coordinates: str) -> None:
    course, runs, counts = COURSES[name], [], []
    outputs = course.begin + course.duration * np.linspace(0.0, 1.0, 24)  # none at a jump
    for given in (True, False):
        m, calls = four_bar(POINTS), list[float]()
        f, *derivatives = course.functions
        more = dict(zip(("velocity", "acceleration"), derivatives, strict=True)) if given else {}
        m.add_drive("A", position=counted(f, calls), **more)
        start = m.assemble(t=course.begin, coordinates=coordinates)
        calls.clear()
        runs.append(m.simulate(course.duration, initial=start, t_eval=outputs, max_step=course.longest))
        counts.append(len(calls))
    closed, opaque = runs
    assert closed.success and opaque.success, opaque.message
    assert counts[1] <= 3 * counts[0]
    for what in ("position", "velocity", "acceleration", "drive"):
        right, found = (np.asarray(getattr(run.joint("A"), what)) for run in runs)
        allowed = {"position": 1e-9, "velocity": 1e-9}.get(what, course.off)
        assert np.abs(found - right).max() <= allowed * np.abs(right).max(), what


def second(f: Function, t: float) -> float | None:
    """The second derivative, by pieces that were asked for nothing else."""
    found = Pieces(lambda s: np.array([f(s)]), np.zeros(1)).at(t, np.array([f(t)]))
    return None if found is None else float(found.second[0])


@pytest.mark.parametrize("power", [0, 1, 2, 3])
@pytest.mark.parametrize("at", [0.3, 0.5, 1.7, -0.3, 1000.3])
def test_breaks_are_found_wherever_they_are(at: float, power: int) -> None:
    """What is added from a place on: a jump, a kink, and jumps of the second and the third derivative."""

    def f(t: float) -> float:
        return math.sin(t) + (0.1 * (t - at) ** power if t > at else 0.0)

    pieces = Pieces(lambda s: np.array([f(s)]), np.zeros(1))
    for apart in (-1e-2, -1e-5, 1e-5, 1e-2):
        t = at + apart
        found = pieces.at(t, np.array([f(t)]))
        added = 0.1 * power * (power - 1) * apart ** (power - 2) if apart > 0.0 and power > 1 else 0.0
        assert found is not None
        assert found.second[0] == pytest.approx(-math.sin(t) + added, abs=1e-6 if at < 100.0 else 1e-4)


def test_a_piece_does_not_depend_on_what_was_asked_before() -> None:
    f = bump(27.1, 0.01)[0]
    pieces = Pieces(lambda s: np.array([f(s)]), np.zeros(1))
    times = [27.1, 3.0, 27.11, 0.2, 27.0, 26.0]
    together = [pieces.at(t, np.array([f(t)])) for t in times]
    for t, found in zip(times, together, strict=True):
        assert found is not None and found.second[0] == second(f, t)


def test_a_pulse_between_samples_is_seen_where_it_is_evaluated() -> None:
    def f(t: float) -> float:
        return 0.01 * (1.0 - math.cos(40.0 * math.pi * (t - 37.123))) if 37.123 < t < 37.173 else 0.0

    pieces = Pieces(lambda s: np.array([f(s)]), np.zeros(1))
    assert pieces.at(33.0, np.zeros(1)) is not None
    for t in (37.13, 37.15, 37.17):
        found = pieces.at(t, np.array([f(t)]))
        right = 0.01 * (40.0 * math.pi) ** 2 * math.cos(40.0 * math.pi * (t - 37.123))
        assert found is not None and found.second[0] == pytest.approx(right, abs=1e-5)


def test_memory_is_bounded_and_pieces_grow_with_time() -> None:
    assert first_interval(3.9) == (0.0, 4.0) and first_interval(1e6) == (2.0**19, 2.0**20)
    assert first_interval(-5.0) == (-8.0, -4.0)
    calls = list[float]()
    slow = counted(lambda t: math.sin(1e-4 * t), calls)
    pieces = Pieces(lambda s: np.array([slow(s)]), np.zeros(1))
    for t in np.linspace(0.0, 1e6, 2000).tolist():
        assert pieces.at(t, np.array([math.sin(1e-4 * t)])) is not None
    assert len(calls) < 10_000
    fast = Pieces(lambda s: np.array([math.sin(2e4 * s)]), np.zeros(1))
    for t in np.linspace(0.0, 1.0, 800).tolist():
        fast.at(t, np.array([math.sin(2e4 * t)]))
    assert len(fast._kept) < 5_000


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_pose_by_rotations_of_scipy(coordinates: str) -> None:
    calls = list[float]()

    def turned(t: float) -> Any:
        calls.append(t)
        spin = Rotation.from_rotvec([0.0, math.pi * t, 0.0]) * Rotation.from_rotvec([0.3 * math.sin(2.0 * t), 0, 0])
        return [0.1 * math.sin(t), 0.0, 0.2 * t], spin

    def exact(t: Any) -> Any:
        calls.append(0.0)
        c, s, u = np.cos(np.pi * t), np.sin(np.pi * t), 0.3 * np.sin(2.0 * t)
        cu, su = np.cos(u), np.sin(u)
        return [0.1 * np.sin(t), 0.0, 0.2 * t], [[c, s * su, s * cu], [0, cu, -su], [-s, c * su, c * cu]]

    found: list[NDArray[np.float64]] = []
    counts = []
    for pose in (exact, turned):
        m = pt.Mechanism("body", gravity=(0, 0, -9.81))
        body = m.add_body("body", mass=1.0, inertia=(1, 2, 3))
        m.add_drive(body, pose=pose)
        calls.clear()
        run = m.simulate(1.5, t_eval=np.linspace(0.0, 1.5, 7), coordinates=coordinates)
        counts.append(len(calls))
        assert run.success
        found.append(np.hstack([run.joint("pose of body").moment, run.joint("pose of body").force]))
    assert np.abs(found[1] - found[0]).max() < 1e-8 * np.abs(found[0]).max()
    assert counts[1] < 4 * counts[0]


@pytest.mark.parametrize(("begin", "most"), [(0.0, 3_000), (50.0, 15_000)])
def test_an_acceleration_is_integrated_without_calls_for_every_rate(begin: float, most: int) -> None:
    """Some twenty for each eighth of a second from zero on, and those of the acceleration itself."""
    m, calls = four_bar(POINTS), list[float]()
    m.add_drive("A", acceleration=counted(lambda t: math.sin(3.0 * t), calls))
    start = m.assemble(t=begin)
    run = m.simulate(1.0, initial=start, t_eval=[begin, begin + 1.0])
    assert run.success and len(calls) < most
    right = (math.cos(0.0) - np.cos(3.0 * run.t)) / 3.0
    assert run.joint("A").velocity[:, 0] == pytest.approx(right, abs=1e-12)


def test_exact_derivatives_are_asked_for_where_the_function_has_them() -> None:
    """Of a function that has them in part, wherever it has, and of another one once in an eighth of a second."""
    m, seen = four_bar(POINTS), list[Any]()

    def mixed(t: Any) -> Any:
        seen.append(t)
        return np.sin(t) if t < 1.0 else math.sin(t)

    m.add_drive("A", position=mixed)
    (drive,) = m._description.drives.values()
    motion = drive.motion.call  # type: ignore[union-attr]
    assert isinstance(motion, Motion)
    assert motion(0.3) == (np.sin(0.3), np.cos(0.3), -np.sin(0.3))
    for t in np.linspace(1.3, 2.0, 50).tolist():
        assert motion(t) == pytest.approx((math.sin(t), math.cos(t), -math.sin(t)), abs=1e-9)
    assert sum(not isinstance(t, float) for t in seen) < 20


def test_copies_have_their_own_pieces_and_the_same_numbers() -> None:
    m = four_bar(POINTS)
    m.add_drive("A", position=lambda t: 0.3 * math.sin(3.0 * t))
    (drive,) = m._description.drives.values()
    motion = drive.motion.call  # type: ignore[union-attr]
    assert isinstance(motion, Motion)
    twin = copy.deepcopy(motion)
    assert twin._derived is None and twin(0.7) == motion(0.7)
    assert [note for note in m.simulate(0.1).notes if "good to about" in str(note)]


LAWS: dict[str, tuple[Function, Function, Function]] = {
    "sine": sine(0.1, 1.5),
    "exponential": (lambda x: 0.05 * math.expm1(-x), lambda x: -0.05 * math.exp(-x), lambda x: 0.05 * math.exp(-x)),
    "spline": spline(CubicSpline(np.linspace(-4.0, 4.0, 33), 0.1 * np.sin(np.linspace(-4.0, 4.0, 33)))),
}


class Known:
    """A law with its derivatives, for numbers that carry theirs."""

    def __init__(self, functions: tuple[Function, Function, Function]) -> None:
        self.functions = functions

    def __call__(self, x: Any) -> Any:
        if isinstance(x, Jet):
            return x.chain(*(f(x.x) for f in self.functions))
        return self.functions[0](x)


def follower(where: str, law: Any) -> pt.Mechanism:
    """A crank under its weight, and what follows it: a slide by a cam, or along an axis of its joint."""
    m = pt.Mechanism("follower")
    m.add_rod("crank", start=(0, 0, 0), end=(0.3, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_body("slide", mass=0.5, inertia=(0.1, 0.1, 0.1))
    if where == "cam":
        m.add_prismatic("B", m.ground, "slide", axis=(1, 0, 0))
        m.add_cam("B", "A", law)
    else:
        m.add_custom_joint("B", "crank", "slide", point=(0, 0, 0), free=["rz"], follows={"x": law})
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("where", ["cam", "joint"])
@pytest.mark.parametrize("name", LAWS)
def test_what_follows_by_an_opaque_law_does_so_at_three_times_its_calls(
    name: str, where: str, coordinates: str
) -> None:
    functions, counts, ends = LAWS[name], list[int](), list[Any]()
    begins = functions[0](0.0)  # zero as drawn
    for known in (True, False):
        calls = list[float]()
        law = counted(lambda x: functions[0](x) - begins, calls)
        m = follower(where, Known((law, *functions[1:])) if known else law)
        start = m.assemble(rates={"A": 1.0, "B.rz": 2.0} if where == "joint" else {"A": 1.0}, coordinates=coordinates)
        calls.clear()
        run = m.simulate(0.6, initial=start, t_eval=np.linspace(0.0, 0.6, 13))
        assert run.success, run.message
        counts.append(len(calls))
        ends.append(run.joint("B").position[-1])
        lead = run.joint("A" if where == "cam" else "B")
        x, rate, change = (getattr(lead, what)[:, -1] for what in ("position", "velocity", "acceleration"))
        f, first, second = (np.array([g(value) for value in x.tolist()]) for g in functions)
        led = run.joint("B")
        assert led.position[:, 0] == pytest.approx(f - begins, abs=1e-9)
        assert led.velocity[:, 0] == pytest.approx(first * rate, abs=1e-9)
        assert led.acceleration[:, 0] == pytest.approx(second * rate**2 + first * change, abs=1e-7)
    assert counts[1] <= 3 * counts[0]
    assert ends[1] == pytest.approx(ends[0], abs=1e-6)


def test_a_law_of_one_number_travels_and_has_pieces_of_its_own() -> None:
    m = follower("cam", math.sin)
    (coupling,) = m._description.couplings.values()
    call = coupling.data["function"].call
    right = [0.2 - math.sin(0.7), 0.0, math.sin(0.7) * 9.0, 1.0, -math.cos(0.7)]
    for law in (call, copy.deepcopy(call), pickle.loads(pickle.dumps(call))):
        assert law(0.0, [0.2, 0.7], [1.0, 3.0]) == pytest.approx(right, abs=1e-8)
        assert len(law.notes) == 1 and "good to about" in law.notes[0]
    assert call._derived is not copy.deepcopy(call)._derived
