"""Drives

A prescribed motion is followed, its effort satisfies Newton's and Euler's equations, and its work is subject to step
control even if no degree of freedom is left. A drive that jumps or whose table ends stops the run there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from drawings import EVERY, GENERAL, G, four_bar, parallelogram, pendulum, slider_crank, stroke
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline

import partita as pt
from partita.errors import AssemblyError

from .branches_kept import crossed, crossed_angle
from .case import Held, done, no_success, refused, right


@no_success("a drive that jumps by 0.4 rad at 0.5 s", "evaluation-failed", "the drive of A jumps by 0.4 at")
def jump() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=lambda t: 0.0 if t < 0.5 else 0.4)
    run = m.simulate(1.0)
    yield Held("until then", run.joint("A").position, 0.0, 1e-12)
    yield Held("it ends before", run.t[-1] <= 0.5, True, 0.0)
    done(run)


@no_success("the same on the crank of a four-bar", "evaluation-failed", "the drive of A jumps by 0.4 at")
def jump_in_loop() -> Iterator[Held]:
    m = four_bar(GENERAL)
    m.add_drive("A", position=lambda t: 0.0 if t < 0.5 else 0.4)
    run = m.simulate(1.0)
    yield Held("until then", run.joint("A").position, 0.0, 1e-12)
    done(run)


@no_success(
    "a drive whose rate jumps by 1 rad/s: the blow is no motion with finite forces",
    "evaluation-failed",
    "the rate of the drive of A jumps by 1/s at t = 0.5",
)
def kink() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=lambda t: 0.0 * t if t < 0.5 else t - 0.5)
    run = m.simulate(1.0)
    yield Held("until then", run.joint("A").position[run.t < 0.5], 0.0, 1e-9)
    done(run)


@no_success("a table to 3 s and a run to 3.001 s", "evaluation-failed", "the table of the drive of A ends at 3 s")
def table_ends() -> Iterator[Held]:
    m = pendulum()
    t = np.linspace(0.0, 3.0, 61)
    m.add_drive("A", position=(t, np.sin(t)), interpolation="spline")
    run = m.simulate(3.001)
    yield Held("until then", run.joint("A").position[:, 0], CubicSpline(t, np.sin(t))(run.t), 1e-12)
    yield Held("it ends near the end", run.t[-1] > 2.98, True, 0.0)
    done(run)


@right("the same table and a run to 3 s", "the spline by SciPy and the torque by Newton and Euler")
def table() -> Iterator[Held]:
    m = pendulum()
    t = np.linspace(0.0, 3.0, 61)
    m.add_drive("A", position=(t, np.sin(t)), interpolation="spline")
    spline = CubicSpline(t, np.sin(t))
    run = done(m.simulate(3.0))
    yield Held("angle", run.joint("A").position[:, 0], spline(run.t), 1e-12)
    torque = spline(run.t, 2) / 3 + 0.5 * G * np.sin(spline(run.t))
    yield Held("torque", run.joint("A").drive[:, 0], torque, 1e-9)


@right(
    "work of a drive where no degree of freedom is left, every formulation, rtol 1e-6 to 1e-12",
    "quadrature of torque times rate",
)
def work() -> Iterator[Held]:
    def power(t: float) -> float:
        angle, rate, second = 2 * t + 0.5 * np.sin(3 * t), 2 + 1.5 * np.cos(3 * t), -4.5 * np.sin(3 * t)
        return (second / 3 + 0.5 * G * np.sin(angle)) * rate

    exact = quad(power, 0, 2, epsabs=1e-13, epsrel=1e-13)[0]
    for formulation in EVERY:
        for rtol in (1e-6, 1e-12):
            m = pendulum()
            m.add_drive("A", position=lambda t: 2.0 * t + 0.5 * np.sin(3.0 * t))
            run = done(m.simulate(2.0, rtol=rtol, atol=1e-2 * rtol, solver=pt.Solver(formulation), t_eval=[0.0, 2.0]))
            yield Held(f"{formulation}, {rtol:g}", run.energy.work[-1], exact, 100 * rtol + 1e-11)


@right(
    "a crank driven by t^2 against a load on the slider",
    "closed form of the way; power of drive and load is the change of energy",
)
def loaded_slider() -> Iterator[Held]:
    m = slider_crank()
    m.add_drive("main", position=lambda t: 5.0 * t**2)
    m.add_force("piston", lambda t, state: (-30.0 * np.cos(4.0 * t), 0.0, 0.0))
    run = done(m.simulate(1.0, rtol=1e-10, atol=1e-12))
    angle, rate = 5.0 * run.t**2, 10.0 * run.t
    yield Held("slider", run.joint("bore").position[:, 0] + 0.4, stroke(angle), 1e-11)
    speed = run.joint("bore").velocity[:, 0]
    power = run.joint("main").drive[:, 0] * rate - 30.0 * np.cos(4.0 * run.t) * speed
    energy = CubicSpline(run.t, run.energy.total)
    # derivative of a cubic spline through 201 points: cube of the spacing times the fourth derivative
    inner = slice(10, -10)
    yield Held("power", power[inner], energy(run.t, 1)[inner], 2e-2)
    whole = CubicSpline(run.t, power).antiderivative()(run.t)
    yield Held("energy", whole, run.energy.total - run.energy.total[0], 1e-4)


@right(
    "a pendulum on a turntable driven at 4 rad/s",
    "its one equation by hand, integrated by SciPy; the drive's moment from the spin",
)
def turntable() -> Iterator[Held]:
    spin = 4.0
    m = pt.Mechanism("governor", gravity=(0, -G, 0))
    m.add_body("table", mass=1.0, inertia=(0.1, 0.2, 0.1))
    m.add_body("arm", mass=1.0, inertia=(0.0, 0.0, 0.0), com=(0, -0.5, 0))
    m.add_revolute("axle", m.ground, "table", point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("hinge", "table", "arm", point=(0, 0, 0), axis=(0, 0, 1))
    m.add_drive("axle", position=lambda t: spin * t)
    start = m.assemble(targets={"hinge": 0.3})
    run = done(m.simulate(3.0, initial=start, rtol=1e-10, atol=1e-12))
    y = solve_ivp(
        lambda t, y: [y[1], spin**2 * np.sin(y[0]) * np.cos(y[0]) - G / 0.5 * np.sin(y[0])], (0, 3), [0.3, 0.0],
        t_eval=run.t, rtol=1e-12, atol=1e-13,
    ).y  # fmt: skip
    yield Held("angle", run.joint("hinge").position[:, 0], y[0], 1e-7)
    moment = 2 * 0.25 * np.sin(y[0]) * np.cos(y[0]) * y[1] * spin
    yield Held("moment of the drive", run.joint("axle").drive[:, 0], moment, 1e-6)


@right(
    "every joint of a parallelogram driven, as it turns anyway",
    "closed form: nothing is left to move, the coupler only shifts",
)
def all_driven() -> Iterator[Held]:
    m = parallelogram(gravity=G)
    for name, sign in (("A", 1), ("B", -1), ("D", 1)):
        m.add_drive(name, position=lambda t, sign=sign: sign * np.sin(t))
    run = done(m.simulate(1.5))
    angle = 1.0 + np.sin(run.t)
    yield Held("C", run.joint("C").point[:, :2], np.stack([1 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)], 1), 1e-12)


@refused("a crank driven to where the loop does not reach", AssemblyError, "the lengths do not fit")
def out_of_reach() -> Iterator[Held]:
    # links 1, 0.6 and 1 on ground 2: the crank cannot point backwards
    m = four_bar([(0, 0), (1, 0.0), (1.3, 0.52), (2.0, 0)])
    m.add_drive("A", position=lambda t: np.pi - 0.1 * t)
    done(m.simulate(1.0))
    yield from ()


@no_success(
    "a crank driven towards where the loop does not reach", "singular", "a drive exceeds what the joints allow: A = "
)
def towards_the_limit() -> Iterator[Held]:
    m = four_bar([(0, 0), (1, 0.0), (1.3, 0.52), (2.0, 0)])
    m.add_drive("A", position=lambda t: 1.0 * t)
    done(m.simulate(3.0))
    yield from ()


@right(
    "one crank of a parallelogram driven through its change points, closing and full-velocity formulations",
    "closed form: the coupler only shifts; the drive carries the weights",
)
def through_change_points() -> Iterator[Held]:
    for formulation in ("projective", "svd", "wehage-haug", "explicit-closing", "multipliers"):
        m = parallelogram(gravity=G)
        m.add_drive("A", position=lambda t: 2.0 * t)
        run = done(m.simulate(3.0, solver=pt.Solver(formulation)))
        angle = 1.0 + 2.0 * run.t
        points = np.stack([1 + 0.5 * np.cos(angle), 0.5 * np.sin(angle)], 1)
        yield Held(f"C, {formulation}", run.joint("C").point[:, :2], points, 1e-11)
        # two cranks by their middles, the coupler by the pins; masses of `four_bar`
        torque = (0.5 * (0.3 + 0.4) + 0.5) * G * 0.5 * np.cos(angle)
        yield Held(f"torque, {formulation}", run.joint("A").drive[:, 0], torque, 1e-7)


@right("the crank of a crossed parallelogram driven through its change points", "closed form of the rocker")
def crossed_driven() -> Iterator[Held]:
    for formulation in ("projective", "wehage-haug"):
        m = crossed()
        m.add_drive("A", position=lambda t: 2.0 * t)
        run = done(m.simulate(6.0, solver=pt.Solver(formulation)))
        r = run.body("rocker").rotation
        known = crossed_angle(1.0 + 2.0 * run.t)
        yield Held(formulation, r[:, :2, 0], np.stack([np.cos(known), np.sin(known)], 1), 1e-11)


@right("a prescribed shake of a table with a spring on it", "closed form of the forced vibration, beat included")
def shaken() -> Iterator[Held]:
    m = pt.Mechanism("shaker", gravity=(0, 0, 0))
    m.add_body("table", mass=5.0, inertia=(1, 1, 1))
    m.add_body("mass", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "table", axis=(0, 1, 0))
    m.add_prismatic("T", "table", "mass", axis=(0, 1, 0))
    m.add_torsion_spring("T", stiffness=50.0)
    m.add_drive("S", position=lambda t: 0.01 * np.sin(4.0 * t))
    start = m.assemble(rates={"T": -0.04})  # the mass at rest in the world
    run = done(m.simulate(10.0, initial=start, rtol=1e-10, atol=1e-12))
    own, forced = 5.0, 4.0
    share = 0.01 * forced**2 / (own**2 - forced**2)
    rate = (-0.04 - share * forced) / own
    known = share * np.sin(forced * run.t) + rate * np.sin(own * run.t)
    yield Held("stretch", run.joint("T").position[:, 0], known, 1e-8)
    effort = -5.0 * 0.16 * np.sin(forced * run.t) - 50.0 * known
    yield Held("effort", run.joint("S").drive[:, 0], effort, 1e-6)


@right("a pulse of a table after a long rest, a second of ten and a millisecond of ten", "its impulse over the mass")
def pulse() -> Iterator[Held]:
    for width in (1.0, 1e-3):
        m = pt.Mechanism("cart", gravity=(0, 0, 0))
        cart = m.add_body("cart", mass=2.0, inertia=(1, 1, 1))
        m.add_prismatic("S", m.ground, cart, point=(0, 0, 0), axis=(1, 0, 0))
        corners = 5.0 + width * np.array([0.0, 0.1, 0.9, 1.0])
        m.add_torque("S", ([0.0, *corners, 10.0], [0.0, 0.0, 3.0, 3.0, 0.0, 0.0]))
        run = done(m.simulate(10.0, t_eval=[0.0, 4.5, 7.0, 10.0], rtol=1e-9, atol=1e-11))
        # the table's cubics are as large on either side of the middle of a ramp
        yield Held("speed after it", run.joint("S").velocity[-1, 0], 3.0 * 0.9 * width / 2.0, 1e-8)
