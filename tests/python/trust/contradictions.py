"""Contradictory constraints

Drives, welds and loops that no motion can satisfy together are refused with the names of those that contradict each
other; if they become incompatible only later, the run ends there. Redundant constraints that agree are accepted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from drawings import EVERY, GENERAL, Array, four_bar, parallelogram, pendulum, slider_crank, stroke
from scipy.integrate import solve_ivp

import partita as pt
from partita.errors import AssemblyError, ContradictionError, DescriptionError

from .case import Case, Held, done, no_success, refused, right, suspect


def driven(**rates: float) -> pt.Mechanism:
    m = four_bar(GENERAL)
    for joint, rate in rates.items():
        m.add_drive(joint, position=lambda t, rate=rate: rate * t)
    return m


@refused(
    "four-bar, drives A: 2 t and D: 2 t", ContradictionError, 'the drive of D contradicts the drive of A and joint "C"'
)
def two_drives() -> Iterator[Held]:
    done(driven(A=2.0, D=2.0).simulate(1.0))
    yield from ()


@refused("the same with all velocities as unknowns", ContradictionError, "the drive of D contradicts")
def two_drives_multipliers() -> Iterator[Held]:
    done(driven(A=2.0, D=2.0).simulate(1.0, solver=pt.Solver("multipliers")))
    yield from ()


@refused(
    "a crank that is welded to the ground and driven", ContradictionError, 'the drive of A contradicts joint "weld"'
)
def welded() -> Iterator[Held]:
    m = driven(A=2.0)
    m.add_fixed("weld", m.ground, "crank", point=(0, 0, 0))
    done(m.simulate(1.0))
    yield from ()


def truss() -> pt.Mechanism:
    m = pt.Mechanism("truss")
    one = m.add_rod("one", start=(0, 0, 0), end=(1, 1, 0), mass=1.0)
    other = m.add_rod("other", start=(2, 0, 0), end=(1, 1, 0), mass=1.0)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, other, point=(1, 1, 0))
    m.add_revolute("C", m.ground, other, point=(2, 0, 0))
    return m


@refused("a drive on a truss", ContradictionError, "the drive of A contradicts")
def driven_truss() -> Iterator[Held]:
    m = truss()
    m.add_drive("A", position=lambda t: 2.0 * t)
    done(m.simulate(1.0))
    yield from ()


@right(
    "a truss whose drive says that it stands still",
    "statics by hand, with the share of the motor that least squares gives it; what is open is said to be",
)
def resting_truss() -> Iterator[Held]:
    m = truss()
    m.add_drive("A", position=lambda t: 0.0 * t)
    run = done(m.simulate(1.0))
    # with an idle motor, about the top: the foot's upward m g at 1 m against the rod's weight at 0.5 m leaves m g / 2
    # sideways: (1/2, 1) m g in A, (1/2, 0) in B, (-1/2, 1) in C. A torque -2^(1/2) s of the motor adds s u, u = (-1, 1)
    # over 2^(1/2), to C and takes it off A and B; the sum of squares is least, with L = 2^(1/2), the length of a rod,
    # at s = -3 m g / (8 2^(1/2))
    weight = 9.81
    yield Held("force in C", run.joint("C").force, [-5 / 16 * weight, 13 / 16 * weight, 0.0], 1e-10)
    yield Held("force in A", run.joint("A").force, [5 / 16 * weight, 19 / 16 * weight, 0.0], 1e-10)
    yield Held("torque of the motor", run.joint("A").drive, 0.375 * weight, 1e-10)
    # across the rod, along (1, 1), the force of C is unique; in x and y it is not
    yield Held("force in C across", run.joint("C").force @ (1.0, 1.0, 0.0), 0.5 * weight, 1e-10)
    open_ = [run.joint("A").drive_determined[0], *run.joint("C").determined[:2]]
    yield Held("what is unique of the torque and of C", open_, [False, False, False], 0.0)
    yield Held("position", run.q, 0.0 * run.q, 1e-15)


@refused("three drives on the two degrees of freedom of a five-bar", ContradictionError, "the drive of B contradicts")
def three_drives() -> Iterator[Held]:
    m = pt.Mechanism("five-bar")
    points = [(0.0, 0.0, 0.0), (-0.3, 1.0, 0.0), (1.0, 1.8, 0.0), (2.2, 1.0, 0.0), (2.0, 0.0, 0.0)]
    rods = [m.add_rod(f"rod{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(4)]
    m.add_revolute("A", m.ground, rods[0], point=points[0])
    for i, name in enumerate("BCD"):
        m.add_revolute(name, rods[i], rods[i + 1], point=points[i + 1])
    m.add_revolute("E", m.ground, rods[3], point=points[4])
    for joint, rate in (("A", 1.0), ("E", -1.0), ("B", 0.5)):
        m.add_drive(joint, position=lambda t, rate=rate: rate * t)
    done(m.simulate(1.0))
    yield from ()


Of = Callable[[float], float]


def user_defined(off: Of, rate: Of, bias: Of) -> pt.System:
    """x + y = 0, and its double with `off` on top."""
    return pt.System(
        n=2,
        mass=np.eye(2),
        forces=lambda t, q, v: np.array([0.0, -1.0]),
        constraints=lambda t, q: np.array([q[0] + q[1], 2 * q[0] + 2 * q[1] + off(t)]),
        jacobian=lambda t, q: np.array([[1.0, 1.0], [2.0, 2.0]]),
        constraint_rate=lambda t, q: np.array([0.0, rate(t)]),
        bias=lambda t, q, v: np.array([0.0, bias(t)]),
    )


def constant(value: float) -> Of:
    return lambda t: value


NOTHING = constant(0.0)


def rows(name: str, title: str, off: Of, rate: Of, bias: Of) -> Case:
    @refused(title, ContradictionError, "constraint 1 contradicts constraint 0")
    def ask() -> Iterator[Held]:
        done(pt.simulate(user_defined(off, rate, bias), 1.0, [0.0, 0.0], [0.0, 0.0]))
        yield from ()

    return replace(ask, name=name)


CASES = [
    rows("rows_by_value", "rows by hand, x + y = 0 and 2 x + 2 y + 0.1 = 0", constant(0.1), NOTHING, NOTHING),
    rows("rows_by_rate", "rows by hand, the second with 0.1 t on top", lambda t: 0.1 * t, constant(0.1), NOTHING),
    rows(
        "rows_by_second_rate",
        "rows by hand, the second with 0.1 t^2 on top",
        lambda t: 0.1 * t**2,
        lambda t: 0.2 * t,
        constant(0.2),
    ),
]


@right("rows by hand, the second twice the first", "closed form: x = -y = t^2 / 4")
def rows_that_agree() -> Iterator[Held]:
    run = done(pt.simulate(user_defined(NOTHING, NOTHING, NOTHING), 1.0, [0.0, 0.0], [0.0, 0.0]))
    yield Held("x, y", run.q, 0.25 * run.t[:, None] ** 2 * [1.0, -1.0], 1e-9)


@no_success(
    "drives A and D: t^4 / 10, which part later only", "contradiction", "the drive of D contradicts the drive of A"
)
def parting() -> Iterator[Held]:
    m = four_bar(GENERAL)
    for joint in "AD":
        m.add_drive(joint, position=lambda t: 0.1 * t**4)
    run = m.simulate(1.0)
    # what was computed until then closes and follows the first drive
    yield Held("A", run.joint("A").position[:, 0], 0.1 * run.t**4, 1e-6)
    yield Held("closure", run.closure, 0.0 * run.t, 3e-6)
    done(run)


def two_hinges(second: Callable[[Array], Array]) -> pt.Mechanism:
    """A parallelogram whose cranks are both driven, the second by `second`."""
    m = parallelogram(gravity=9.81)
    m.add_drive("A", position=lambda t: 2.0 * t)
    m.add_drive("D", position=second)
    return m


@right(
    "both cranks of a parallelogram driven alike, over two change points",
    "closed form: the coupler only shifts, every joint turns 2 t",
)
def driven_alike() -> Iterator[Held]:
    run = done(two_hinges(lambda t: 2.0 * t).simulate(3.0))
    angle = 1.0 + 2.0 * run.t
    yield Held("C", run.joint("C").point[:, :2], np.stack([1 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)], 1), 1e-12)


@no_success("the same, the second drive faster by 1e-6", "contradiction", "the drive of D contradicts")
def nearly_alike() -> Iterator[Held]:
    run = two_hinges(lambda t: 2.0 * t + 1e-6 * t**2).simulate(3.0)
    yield Held("A", run.joint("A").position[:, 0], 2.0 * run.t, 1e-6)
    done(run)


@suspect("the same, the second drive off by 1e-8 t^2", "the closing of the drive of D is off by")
def hardly_off() -> Iterator[Held]:
    run = two_hinges(lambda t: 2.0 * t + 1e-8 * t**2).simulate(0.8)
    yield Held("A", run.joint("A").position[:, 0], 2.0 * run.t, 1e-7)
    done(run)


@right("crank and slider both driven, the slider by the function of the crank", "closed form of the slider's way")
def slider_driven_twice() -> Iterator[Held]:
    m = slider_crank()
    m.add_drive("main", position=lambda t: 3.0 * t)
    m.add_drive("bore", position=lambda t: 0.1 * np.cos(3.0 * t) + (0.09 - (0.1 * np.sin(3.0 * t)) ** 2) ** 0.5 - 0.4)
    run = done(m.simulate(3.0))
    yield Held("slider", run.joint("bore").position[:, 0], stroke(3.0 * run.t) - 0.4, 1e-12)


@refused("crank and slider both driven, to places that do not fit", AssemblyError, "the lengths do not fit")
def slider_driven_elsewhere() -> Iterator[Held]:
    m = slider_crank()
    m.add_drive("main", position=lambda t: 0.5 + 3.0 * t)
    m.add_drive("bore", position=lambda t: 0.4 - stroke(0.5 + 3.0 * t))
    done(m.simulate(1.0))
    yield from ()


@refused("two drives on one coordinate", DescriptionError, "is already driven by")
def driven_twice() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=lambda t: t)
    m.add_drive("A", position=lambda t: t, name="again")
    yield from ()


def rockers(off: float) -> pt.Mechanism:
    """A platform on three parallel rockers, the third too long by `off`: closed as drawn, and to first order.

    Every digit of the drawing is meant.
    """
    m = pt.Mechanism("rockers", gravity=(0, -9.81, 0), drawing_tolerance=0.0)
    platform = m.add_rod("platform", start=(0, 0, 0), end=(4, 0, 0), mass=1.0)
    for i, x in enumerate((0.0, 2.0, 4.0)):
        length = 1.0 + off * (i == 2)
        foot = (x - 0.6 * length, -0.8 * length, 0.0)
        rod = m.add_rod(f"rod{i}", start=foot, end=(x, 0, 0), mass=0.5)
        m.add_revolute(f"foot{i}", m.ground, rod, point=foot)
        m.add_revolute(f"top{i}", rod, platform, point=(x, 0, 0))
    return m


@right("a platform on three parallel rockers", "its one equation of motion by hand, integrated by SciPy")
def three_rockers() -> Iterator[Held]:
    run = done(rockers(0.0).simulate(0.3, rtol=1e-10))
    # three rods of 0.5 kg about their feet (m/3 each), the platform of 1 kg on their ends; theta from the horizontal
    inertia, moment = 3 * 0.5 / 3 + 1.0, (3 * 0.5 / 2 + 1.0) * 9.81
    y = solve_ivp(
        lambda t, y: [y[1], -moment / inertia * np.cos(y[0])], (0, 0.3), [np.arctan2(0.8, 0.6), 0.0],
        t_eval=run.t, rtol=1e-12, atol=1e-13,
    ).y[0]  # fmt: skip
    yield Held("turn", run.joint("foot0").position[:, 0], y - y[0], 1e-9)


@no_success("the same, one rocker too long by a millimetre", "contradiction", 'joint "top1" contradicts joint "top2"')
def long_rocker() -> Iterator[Held]:
    done(rockers(1e-3).simulate(0.4))
    yield from ()


@no_success("the same, one rocker too long by 0.03 mm", "contradiction", 'joint "top1" contradicts joint "top2"')
def slightly_long_rocker() -> Iterator[Held]:
    done(rockers(3e-5).simulate(0.4))
    yield from ()


@right("the crank of a four-bar driven in every formulation", "Freudenstein: the rocker's angle in closed form")
def driven_everywhere() -> Iterator[Held]:
    for formulation in EVERY:
        run = done(driven(A=2.0).simulate(0.5, t_eval=np.linspace(0, 0.5, 11), solver=pt.Solver(formulation)))
        yield Held(formulation, run.joint("D").position[:, 0], rocker(2.0 * run.t), 1e-9)


def rocker(turned: Array) -> Array:
    """Turn of the rocker of GENERAL for a turn of its crank: where the circles about B and D meet."""
    _, b0, c0, d = (np.array(p) for p in GENERAL)
    crank, coupler, length = np.hypot(*b0), np.hypot(*(c0 - b0)), np.hypot(*(c0 - d))
    angle = np.arctan2(b0[1], b0[0]) + turned
    to_b = crank * np.stack([np.cos(angle), np.sin(angle)], -1) - d
    r = np.hypot(to_b[..., 0], to_b[..., 1])
    middle = np.arctan2(to_b[..., 1], to_b[..., 0])
    beside = np.arccos((length**2 + r**2 - coupler**2) / (2 * length * r))
    return middle - beside - np.arctan2(*(c0 - d)[::-1])
