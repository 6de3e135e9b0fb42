"""Large, small, stiff, long, short

Units, masses, stiffnesses, durations and tolerances far from one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from drawings import EVERY, G, four_bar, pendulum, swing

import partita as pt

from .case import Case, Held, done, no_success, right, suspect
from .contradictions import rocker
from .in_the_plane import double_known


def sized(length: float) -> Case:
    @right(f"a pendulum of {length:g} m, five periods, both coordinates", "elliptic functions")
    def ask() -> Iterator[Held]:
        m = pendulum(length, drawn=1.5)
        span = 10.0 * np.pi * np.sqrt(length / G)
        for coordinates in ("relative", "absolute"):
            run = done(m.simulate(span, rtol=1e-11, atol=1e-13, coordinates=coordinates))
            yield Held(coordinates, run.joint("A").position[:, 0] + 1.5, swing(run.t, 1.5, length), 1e-7)

    return replace(ask, name=f"size_{length:g}".replace("-", "_").replace("+", ""))


CASES = [sized(length) for length in (1e-6, 1e3, 1e7)]


def weighing(mass: float) -> Case:
    @right(f"a pendulum of {mass:g} kg", "elliptic functions; the pull by Newton")
    def ask() -> Iterator[Held]:
        m = pendulum(mass=mass, drawn=1.5)
        run = done(m.simulate(3.0, rtol=1e-11, atol=1e-13))
        angle = swing(run.t, 1.5)
        yield Held("angle", run.q[:, 0] + 1.5, angle, 1e-8)
        # along the rod: weight and half of m L w^2, with w^2 = 3 g (cos - cos 1.5) / L
        pull = mass * (G * np.cos(angle) + 1.5 * G * (np.cos(angle) - np.cos(1.5)))
        inwards = np.stack([-np.sin(angle), np.cos(angle)], 1)
        found = (run.joint("A").force[:, :2] * inwards).sum(axis=1)
        yield Held("pull", found / mass, pull / mass, 1e-6)

    return replace(ask, name=f"mass_{mass:g}".replace("-", "_").replace("+", ""))


CASES += [weighing(mass) for mass in (1e-12, 1e12)]


def tolerance(rtol: float) -> Case:
    @right(f"a pendulum at rtol {rtol:.0e}, 3 s", "elliptic functions, to a thousand tolerances")
    def ask() -> Iterator[Held]:
        for formulation in EVERY:
            run = done(pendulum(drawn=1.5).simulate(3.0, rtol=rtol, atol=0.01 * rtol, solver=pt.Solver(formulation)))
            yield Held(
                formulation, run.q[:, 0] + 1.5, swing(run.t, 1.5), max(1e3 * rtol, 1e-11) if rtol < 1e-2 else 0.3
            )

    return replace(ask, name=f"rtol_{rtol:.0e}".replace("-", "_"))


CASES += [tolerance(rtol) for rtol in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)]


@right("a pendulum for 1000 s, some 450 periods", "elliptic functions")
def long_run() -> Iterator[Held]:
    run = done(pendulum(drawn=1.5).simulate(1000.0, rtol=1e-12, atol=1e-14, t_eval=np.linspace(0, 1000, 501)))
    # the phase is off by the energy's error times the periods
    yield Held("angle", run.q[:, 0] + 1.5, swing(run.t, 1.5), 1e-6)


@right("a mass on a spring for 1000 s", "closed form: a cosine")
def long_spring() -> Iterator[Held]:
    m = pt.Mechanism("spring", gravity=(0, 0, 0))
    m.add_body("b", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "b", axis=(1, 0, 0))
    m.add_torsion_spring("S", stiffness=8.0, angle=0.5)
    run = done(m.simulate(1000.0, rtol=1e-12, atol=1e-14))
    yield Held("way", run.q[:, 0], 0.5 - 0.5 * np.cos(2.0 * run.t), 1e-7)


@right("a pendulum for a nanosecond", "the first terms of its power series")
def short_run() -> Iterator[Held]:
    m = pendulum(drawn=1.5)
    run = done(m.simulate(1e-9, initial=m.assemble(rates={"A": 3.0})))
    second = -1.5 * G * np.sin(1.5)
    # what is left is the third term, 1e-27
    yield Held("angle", run.q[:, 0] / 1e-9, (3.0 * run.t + 0.5 * second * run.t**2) / 1e-9, 1e-6)
    yield Held("rate", (run.v[:, 0] - 3.0) / 1e-9, second * run.t / 1e-9, 1e-5)


def ratio(name: str, masses: tuple[float, float]) -> Case:
    @right(
        f"a double pendulum of {masses[0]:g} and {masses[1]:g} kg", "Lagrange's equations by hand, integrated by SciPy"
    )
    def ask() -> Iterator[Held]:
        m = pt.Mechanism("double", gravity=(0, -G, 0))
        one = m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=masses[0])
        two = m.add_rod("two", start=(1, 0, 0), end=(1.7, 0, 0), mass=masses[1])
        m.add_revolute("A", m.ground, one, point=(0, 0, 0))
        m.add_revolute("B", one, two, point=(1, 0, 0))
        t = np.linspace(0, 1, 11)
        known = double_known(t, masses, (1.0, 0.7))
        for coordinates in ("relative", "absolute"):
            run = done(m.simulate(1.0, t_eval=t, rtol=1e-10, atol=1e-12, coordinates=coordinates))
            a, b = run.joint("A").position[:, 0], run.joint("B").position[:, 0]
            yield Held(coordinates, np.stack([a, a + b], 1), known, 1e-6)

    return replace(ask, name=name)


CASES += [ratio("heavy_first", (1e9, 1.0)), ratio("heavy_last", (1.0, 1e9))]


@right("a point mass on a rod without mass", "elliptic functions of the simple pendulum")
def massless_rod() -> Iterator[Held]:
    m = pt.Mechanism("simple", gravity=(0, -G, 0))
    end = (np.sin(1.5), -np.cos(1.5), 0)
    m.add_rod("rod", start=(0, 0, 0), end=end, mass=0.0)
    m.add_body("bob", mass=3.0, inertia=(0, 0, 0), position=end)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
    m.add_fixed("weld", "rod", "bob", point=end)
    run = done(m.simulate(3.0, rtol=1e-10, atol=1e-12))
    yield Held("angle", run.q[:, 0] + 1.5, swing(run.t, 1.5, 1.5), 1e-7)


def light(mass: float) -> pt.Mechanism:
    """A crank of 1 kg; a coupler of `mass` and a nearly massless rocker hang on it."""
    b = (0.5 * np.sin(1.0), -0.5 * np.cos(1.0))
    return four_bar([(0, 0), b, (b[0] + 2.0, b[1] - 0.5), (2.0, -1.5)], masses=(1.0, mass, 1e-12))


@right(
    "a four-bar whose coupler and rocker weigh 1e-12 kg", "the crank alone is a pendulum; the coupler carries no force"
)
def light_bodies() -> Iterator[Held]:
    run = done(light(1e-12).simulate(2.0, rtol=1e-10, atol=1e-12))
    yield Held("angle", run.joint("A").position[:, 0] + 1.0, swing(run.t, 1.0, 0.5), 1e-6)
    yield Held("force", run.joint("B").force[:, :2], 0.0, 1e-9)


@right("the same with a coupler of no mass, which leads the tree", "the same")
def massless_coupler() -> Iterator[Held]:
    run = done(light(0.0).simulate(2.0, rtol=1e-10, atol=1e-12))
    yield Held("angle", run.joint("A").position[:, 0] + 1.0, swing(run.t, 1.0, 0.5), 1e-6)
    yield Held("force", run.joint("B").force[:, :2], 0.0, 1e-9)


@right("a mass on springs of 1 and 1e9 N/m in a row", "closed form of both modes, by NumPy's eigenvectors")
def stiff() -> Iterator[Held]:
    m = pt.Mechanism("stiff", gravity=(0, 0, 0))
    for name in "ab":
        m.add_body(name, mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("A", m.ground, "a", axis=(1, 0, 0))
    m.add_prismatic("B", "a", "b", axis=(1, 0, 0))
    m.add_torsion_spring("A", stiffness=1.0)
    m.add_torsion_spring("B", stiffness=1e9)
    start = m.assemble(targets={"A": 1.0})
    run = done(m.simulate(0.01, initial=start, rtol=1e-11, atol=1e-13))
    stiffness = np.array([[1.0 + 1e9, -1e9], [-1e9, 1e9]])
    squares, modes = np.linalg.eigh(stiffness)
    positions = (modes * np.cos(np.outer(run.t, np.sqrt(squares)))[:, None, :]) @ (modes.T @ [1.0, 1.0])
    # the soft root of the stiff matrix is only known to 1e-7
    soft = np.cos(np.sqrt(0.5) * run.t)
    yield Held("place", run.q[:, 0], soft, 1e-6)
    yield Held("as by modes", positions[:, 0], soft, 1e-5)


@right(
    "overdamped: 1 kg, damper of 1e4 N s/m, spring of 1 N/m, drawn out by 1 m",
    "closed form: two exponentials; the damper's work",
)
def overdamped() -> Iterator[Held]:
    m = pt.Mechanism("damped", gravity=(0, 0, 0))
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "b", axis=(1, 0, 0))
    m.add_torsion_spring("S", stiffness=1.0, damping=1e4)
    start = m.assemble(targets={"S": 1.0}, rates={"S": 5.0})
    run = done(m.simulate(0.1, initial=start, rtol=1e-10, atol=1e-12))
    fast, slow = np.roots([1.0, 1e4, 1.0])
    first = (5.0 - slow) / (fast - slow)
    yield Held("way", run.q[:, 0], first * np.exp(fast * run.t) + (1 - first) * np.exp(slow * run.t), 1e-9)
    rate = first * fast * np.exp(fast * run.t) + (1 - first) * slow * np.exp(slow * run.t)
    yield Held("rate", run.v[:, 0], rate, 1e-6)
    yield Held("work", run.energy.work, 0.5 * rate**2 + 0.5 * run.q[:, 0] ** 2 - 13.0, 1e-6)


@right("a hundred carts on springs", "closed form: standing waves")
def hundred_dof() -> Iterator[Held]:
    n = 100
    m = pt.Mechanism("carts", gravity=(0, 0, 0))
    for i in range(n):
        m.add_body(f"cart{i}", mass=1.0, inertia=(1, 1, 1), position=(i + 1.0, 0, 0))
        m.add_prismatic(f"S{i}", m.ground, f"cart{i}", axis=(1, 0, 0))
    ends = ["ground", *(f"cart{i}" for i in range(n)), "ground"]
    for i in range(n + 1):
        first = (0, 0, 0)
        last = (n + 1.0, 0, 0) if i == n else (0, 0, 0)
        m.add_spring(f"k{i}", ends[i], first, ends[i + 1], last, stiffness=100.0)
    shape = np.sin(np.pi * 3 * np.arange(1, n + 1) / (n + 1))
    start = m.assemble(targets={f"S{i}": 0.2 * shape[i] for i in range(n)})
    run = done(m.simulate(5.0, initial=start, t_eval=np.linspace(0, 5, 11), rtol=1e-10, atol=1e-12))
    pace = 2 * np.sqrt(100.0) * np.sin(0.5 * np.pi * 3 / (n + 1))
    yield Held("places", run.q, 0.2 * np.cos(pace * run.t)[:, None] * shape, 1e-7)


@right(
    "sixty pendulums coupled in pairs by rods, each pair a parallelogram", "elliptic functions: every loop swings alike"
)
def sixty_loops() -> Iterator[Held]:
    m = pt.Mechanism("row", gravity=(0, -G, 0))
    drawn, count = 1.0, 30
    end = np.array([np.sin(drawn), -np.cos(drawn), 0.0])
    for i in range(count):
        for side in "lr":
            foot = np.array([3.0 * i + (side == "r"), 0.0, 0.0])
            m.add_rod(f"rod{i}{side}", start=foot, end=foot + end, mass=1.0)
            m.add_revolute(f"A{i}{side}", m.ground, f"rod{i}{side}", point=foot)
        left, right_ = (np.array([3.0 * i + x, 0, 0]) + end for x in (0.0, 1.0))
        m.add_rod(f"bar{i}", start=left, end=right_, mass=1.0)
        m.add_revolute(f"B{i}", f"rod{i}l", f"bar{i}", point=left)
        m.add_revolute(f"C{i}", f"rod{i}r", f"bar{i}", point=right_)
    run = done(m.simulate(1.0, t_eval=np.linspace(0, 1, 6), rtol=1e-10, atol=1e-12))
    # two rods of 1/3 and a bar of 1 at the end: moment 2 m g L, inertia 5/3: 6/5 in place of 3/2
    known = swing(run.t, drawn, length=1.25) - drawn
    for i in (0, count // 2, count - 1):
        yield Held(f"loop {i}", run.joint(f"A{i}l").position[:, 0], known, 1e-7)
        yield Held(f"loop {i}, right", run.joint(f"A{i}r").position[:, 0], known, 1e-7)


@right("rest without gravity: a four-bar, both coordinates, every formulation", "nothing moves and nothing pulls")
def at_rest() -> Iterator[Held]:
    m = four_bar([(0, 0), (0.5, 1.0), (2.5, 1.6), (2.2, 0.0)], gravity=0.0)
    for coordinates in ("relative", "absolute"):
        for formulation in EVERY:
            if (coordinates, formulation) == ("absolute", "explicit-closing"):
                continue
            run = done(m.simulate(1.0, coordinates=coordinates, solver=pt.Solver(formulation), t_eval=[0, 0.5, 1.0]))
            yield Held("places", run.joint("A").position, 0.0, 1e-12)
            yield Held("forces", run.joint("B").force, 0.0, 1e-12)


@right("a hinge whose axis is off by 1e-6 rad", "closed form: gravity across the axis falls by 5e-13 of itself")
def tilted_axis() -> Iterator[Held]:
    m = pt.Mechanism("tilted", gravity=(0, -G, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(np.sin(1.5), -np.cos(1.5), 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0), axis=(0, 1e-6, 1.0))
    run = done(m.simulate(3.0, rtol=1e-11, atol=1e-13))
    # the axis stands across the rod but for 1e-6, whose square is lost
    yield Held("angle", run.q[:, 0] + 1.5, swing(run.t, 1.5), 1e-8)
    # the weight has a part along the axis that the hinge carries
    along = run.joint("A").in_frame("joint").force[:, 2]
    yield Held("force along the axis", along, 1e-6 * G, 1e-5)


def crooked(off: float, **options: Any) -> pt.Mechanism:
    m = pt.Mechanism("crooked", **options)
    a, b, c, d = (0, 0, 0), (0.5, 1.0, 0), (2.5, 1.6, 0), (2.2, 0, 0)
    crank = m.add_rod("crank", start=a, end=b, mass=0.3)
    coupler = m.add_rod("coupler", start=b, end=c, mass=0.5)
    rod = m.add_rod("rocker", start=d, end=c, mass=0.4)
    m.add_revolute("A", m.ground, crank, point=a)
    m.add_revolute("B", crank, coupler, point=b)
    m.add_revolute("C", coupler, rod, point=c)
    m.add_revolute("D", m.ground, rod, point=d, axis=(off, 0, 1.0))
    return m


@right(
    "a four-bar whose last hinge is off by 1e-3 rad",
    "a closed chain of four hinges across each other is a truss: it stays",
)
def crooked_truss() -> Iterator[Held]:
    m = crooked(1e-3)
    yield Held("mobility", m.compile().mobility, 0, 0.0)
    yield Held("places", done(m.simulate(1.0)).q, 0.0, 1e-15)


def moved_as_repaired(off: float) -> Iterator[Held]:
    """Within the drawing tolerance it moves as intended, with a closure error of at most its geometric error."""
    run = done(crooked(off).simulate(1.0))
    yield Held("opens by the misalignment", run.closure.max() < 3.0 * off, True, 0.0)
    yield Held("geometric error reported", 0.0 < run.certificate.geometric_error < 3.0 * off, True, 0.0)
    gap = run.joint("D").position[:, 0] - rocker(run.joint("A").position[:, 0])
    yield Held("rocker", gap - 2 * np.pi * np.round(gap / (2 * np.pi)), 0.0, 3.0 * off)


@right(
    "the same off by 1e-5 rad, within what a drawing may be off", "closed form of the rocker, within the misalignment"
)
def crooked_between() -> Iterator[Held]:
    yield from moved_as_repaired(1e-5)


@right("the same off by 1e-6 rad", "closed form of the rocker, within the misalignment")
def crooked_little() -> Iterator[Held]:
    yield from moved_as_repaired(1e-6)


@right("the same off by 1e-5 rad, every digit intended: a structure", "it holds still")
def crooked_to_the_digit() -> Iterator[Held]:
    run = done(crooked(1e-5, drawing_tolerance=0.0).simulate(1.0))
    yield Held("angles", run.q - run.q[0], 0.0, 1e-12)


@right("the same off by 1e-10 rad", "closed form of the rocker")
def crooked_least() -> Iterator[Held]:
    run = done(crooked(1e-10).simulate(1.0))
    off = run.joint("D").position[:, 0] - rocker(run.joint("A").position[:, 0])
    yield Held("rocker", off - 2 * np.pi * np.round(off / (2 * np.pi)), 0.0, 1e-9)


@right("fixed steps of 0.01 s, order 4", "elliptic functions")
def fixed_steps() -> Iterator[Held]:
    run = done(pendulum(drawn=1.5).simulate(10.0, step=0.01, method="rk4"))
    yield Held("angle", run.q[:, 0] + 1.5, swing(run.t, 1.5), 1e-6)


@suspect("fixed steps of 0.3 s, far too long", "the energy balance is off by")
def long_steps() -> Iterator[Held]:
    done(pendulum(drawn=1.5).simulate(10.0, step=0.3, method="rk4"))
    yield from ()


@no_success("fixed steps of 1 s, longer than half a swing", "invalid", "the energy balance is off by")
def absurd_steps() -> Iterator[Held]:
    done(pendulum(drawn=1.5).simulate(10.0, step=1.0, method="rk4"))
    yield from ()


@no_success(
    "a spring and a damper of 1e12 in a run of 1000 steps at the most", "max-steps", "allow more with max_steps"
)
def too_stiff() -> Iterator[Held]:
    m = pt.Mechanism("stiff", gravity=(0, -G, 0))
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "b", axis=(0, 1, 0))
    m.add_torsion_spring("S", stiffness=1e12, damping=1e3)
    run = m.simulate(1.0, max_steps=1000, t_eval=np.linspace(0, 1, 100001))
    rate, decay = np.sqrt(1e12 - 250e3), 500.0
    known = -G / 1e12 * (1 - np.exp(-decay * run.t) * (np.cos(rate * run.t) + decay / rate * np.sin(rate * run.t)))
    # it moves by 1e-11 m, which `atol` does not look at; its rate by 1e-5 m/s, of which it leaves five digits
    yield Held("until then", run.q[:, 0] * 1e12, known * 1e12, 1e-2)
    done(run)


@right(
    "a spring of half a metre drawn through its own anchor",
    "closed form in pieces: two springs pushed one way and the other",
)
def through_the_anchor() -> Iterator[Held]:
    m = pt.Mechanism("through", gravity=(0, 0, 0))
    m.add_body("b", mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0))
    m.add_prismatic("S", m.ground, "b", axis=(1, 0, 0))
    m.add_spring("k", m.ground, (0, 0, 0), "b", (0, 0, 0), stiffness=4.0, length=0.5)
    run = done(m.simulate(1.5, initial=m.assemble(rates={"S": -3.0}), rtol=1e-10, atol=1e-12))
    # x = 0.5 + r cos(2 t + p) until it is at the anchor, then about -0.5 with the speed that it has there
    size, phase = np.hypot(0.5, 1.5), np.arctan2(1.5, 0.5)
    there = (np.arccos(-0.5 / size) - phase) / 2
    speed = -2 * size * np.sin(2 * there + phase)
    after = run.t - there
    known = np.where(
        after < 0,
        0.5 + size * np.cos(2 * run.t + phase),
        -0.5 + 0.5 * np.cos(2 * after) + speed / 2 * np.sin(2 * after),
    )
    yield Held("place", run.q[:, 0] + 1.0, known, 1e-7)
