"""The step beside

Ordinary things done in an unusual way: starts at another time, joints said twice, no joints at all, functions that jump
or pulse, shafts bent almost to a right angle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from drawings import GENERAL, G, four_bar, pendulum, swing
from scipy.integrate import solve_ivp

import partita as pt
from partita.errors import ArgumentError, DescriptionError

from .case import Case, Held, done, no_success, refused, right


def slide(gravity: float = 0.0) -> pt.Mechanism:
    """A body of 1 kg that slides along x."""
    m = pt.Mechanism("slide", gravity=(0, -gravity, 0))
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "b", axis=(1, 0, 0))
    return m


@right("a drive begun at t = 5 s", "the function itself; torque by Newton and Euler")
def later() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=np.sin)
    run = done(m.simulate(1.0, initial=m.assemble(t=5.0)))
    yield Held("times", run.t[[0, -1]], [5.0, 6.0], 1e-15)
    angle = np.sin(run.t)
    yield Held("angle", run.q[:, 0], angle, 1e-14)
    yield Held("torque", run.joint("A").drive[:, 0], -angle / 3 + 0.5 * G * np.sin(angle), 1e-10)


@right("bodies without joints", "closed form: both fall")
def falling() -> Iterator[Held]:
    m = pt.Mechanism("two")
    m.add_body("a", mass=1.0, inertia=(1, 1, 1))
    m.add_body("b", mass=1e6, inertia=(1, 2, 2), position=(1, 0, 0))
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(1.0, coordinates=coordinates))
        for body in "ab":
            yield Held(body, run.body(body).position[:, 1], -0.5 * 9.81 * run.t**2, 1e-9)


def twins(off: float) -> Case:
    @right(
        f"two hinges on one axis through one point, apart by {off:g} m",
        "elliptic functions; they share every load but none is unique",
    )
    def ask() -> Iterator[Held]:
        m = pendulum(drawn=1.0)
        m.add_revolute("twin", m.ground, "rod", point=(off, 0, 0))
        run = done(m.simulate(2.0, rtol=1e-10, atol=1e-12))
        yield Held("angle", run.joint("A").position[:, 0] + 1.0, swing(run.t, 1.0), 1e-8)
        both = run.joint("A").force + run.joint("twin").force
        alone = done(pendulum(drawn=1.0).simulate(2.0, rtol=1e-10, atol=1e-12)).joint("A").force
        yield Held("sum", both, alone, 1e-8)
        for name in ("A", "twin"):
            yield Held(f"determined in {name}", run.joint(name).determined[:3], False, 0.0)

    return replace(ask, name=f"twins_{off:g}".replace("-", "_"))


CASES = [twins(off) for off in (0.0, 1e-16, 1e-13)]


@right("a door on two hinges whose axes miss each other by 1e-13 m", "elliptic functions of the one hinge")
def door_hinges() -> Iterator[Held]:
    m = pt.Mechanism("door", gravity=(0, -G, 0))
    m.add_body("leaf", mass=3.0, inertia=(0.3, 0.3, 0.25), com=(0.5 * np.sin(1.0), -0.5 * np.cos(1.0), 0.2))
    m.add_revolute("low", m.ground, "leaf", point=(0, 0, -0.8))
    m.add_revolute("high", m.ground, "leaf", point=(1e-13, 0, 0.8))
    run = done(m.simulate(2.0, rtol=1e-10, atol=1e-12))
    # (I + m r^2) / (m r) in place of 2 L / 3
    length = 1.5 * (0.25 + 3.0 * 0.25) / (3.0 * 0.5)
    yield Held("angle", run.joint("low").position[:, 0] + 1.0, swing(run.t, 1.0, length), 1e-7)


@right("a force that changes its sign in a jump at 0.3 s", "closed form: two parabolas")
def jump() -> Iterator[Held]:
    m = slide()
    m.add_torque("S", lambda t, state: 1.0 if t < 0.3 else -1.0)
    run = done(m.simulate(1.0))
    after = run.t - 0.3
    known = np.where(after < 0, 0.5 * run.t**2, 0.045 + 0.3 * after - 0.5 * after**2)
    yield Held("way", run.q[:, 0], known, 1e-7)


@right("a force of 1 s in a run of 10 s, with steps of 0.1 s at the most", "closed form: it gains 1 m/s")
def pulse() -> Iterator[Held]:
    m = slide()
    m.add_torque("S", lambda t, state: 1.0 if 5.0 < t < 6.0 else 0.0)
    run = done(m.simulate(10.0, max_step=0.1))
    yield Held("rate", run.v[:, 0], np.clip(run.t - 5.0, 0.0, 1.0), 1e-7)


@no_success(
    "a drive that jerks for a hundredth of a second in a run of 10 s",
    "invalid",
    "times as fast as the ends of steps explain",
)
def jerk() -> Iterator[Held]:
    m = pendulum(gravity=0.0)
    m.add_drive("A", position=lambda t: 0.1 * np.exp(-(((t - 5.0) / 0.01) ** 2)))
    run = m.simulate(10.0, t_eval=np.linspace(0, 10, 1001))
    yield Held("angle", run.q[:, 0], 0.1 * np.exp(-(((run.t - 5.0) / 0.01) ** 2)), 1e-12)
    done(run)


@right("the same with steps of 2 ms at the most", "the function itself; the work is what it has in motion")
def jerk_seen() -> Iterator[Held]:
    m = pendulum(gravity=0.0)
    m.add_drive("A", position=lambda t: 0.1 * np.exp(-(((t - 5.0) / 0.01) ** 2)))
    run = done(m.simulate(10.0, t_eval=np.linspace(4.9, 5.1, 101), max_step=2e-3))
    yield Held("work", run.energy.work, run.v[:, 0] ** 2 / 6, 1e-6)


@refused("a drive given with a velocity that is half of it", DescriptionError, "the velocity given is 0.5")
def half_velocity() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=np.sin, velocity=lambda t: 0.5 * np.cos(t), acceleration=lambda t: -np.sin(t))
    done(m.simulate(2.0))
    yield from ()


@refused(
    "a drive given with an acceleration of zero, which it has at the start",
    DescriptionError,
    "the acceleration given is 0",
)
def no_acceleration() -> Iterator[Held]:
    m = four_bar(GENERAL)
    m.add_drive("A", position=np.sin, velocity=np.cos, acceleration=lambda t: 0.0 * t)
    done(m.simulate(2.0))
    yield from ()


@no_success("a torque of noise: another number at every call", "max-steps", "allow more with max_steps")
def noise() -> Iterator[Held]:
    rng = np.random.default_rng(0)
    m = pendulum()
    m.add_torque("A", lambda t, state: float(rng.normal()))
    done(m.simulate(1.0, max_steps=2000))
    yield from ()


@right(
    "a Cardan shaft bent by 86 degrees",
    "closed form of the joint: the rate between cos and 1 / cos of the bend; energy",
)
def bent() -> Iterator[Held]:
    bend = 1.5
    along, beside = np.array([np.cos(bend), np.sin(bend), 0]), (-np.sin(bend), np.cos(bend), 0)
    m = pt.Mechanism("Cardan", gravity=(0, 0, 0))
    m.add_body("in", mass=1.0, inertia=(0.2, 0.1, 0.1))
    m.add_body("out", mass=1.0, inertia=(0.2, 0.1, 0.1), orientation=np.array([along, beside, (0, 0, 1)]).T)
    m.add_revolute("A", m.ground, "in", point=(0, 0, 0), axis=(1, 0, 0))
    m.add_universal("U", "in", "out", point=(0, 0, 0), axis1=(0, 0, 1), axis2=beside)
    m.add_revolute("B", m.ground, "out", point=along, axis=along)
    run = done(m.simulate(4.0, initial=m.assemble(rates={"A": 3.0}), rtol=1e-10, atol=1e-12))
    angle, rate = run.joint("A").position[:, 0], run.joint("A").velocity[:, 0]
    ratio = np.cos(bend) / (1 - np.sin(bend) ** 2 * np.sin(angle) ** 2)
    yield Held("ratio", run.joint("B").velocity[:, 0] / rate, ratio, 1e-8)
    # constant: 0.2 (w^2 + (ratio w)^2) / 2
    known = solve_ivp(
        lambda t, x: [
            3.0
            * np.sqrt((1 + np.cos(bend) ** 2) / (1 + (np.cos(bend) / (1 - np.sin(bend) ** 2 * np.sin(x[0]) ** 2)) ** 2))
        ],
        (0, 4),
        [0.0],
        t_eval=run.t,
        rtol=1e-12,
        atol=1e-13,
    ).y[0]
    yield Held("angle", angle, known, 1e-7)


@right("every joint said to be cut, or none where it can be helped", "the same four-bar, as it chooses itself")
def cuts() -> Iterator[Held]:
    known = done(four_bar(GENERAL).simulate(1.0, rtol=1e-10, atol=1e-12)).body("coupler").position
    for chosen in "ABCD":
        m = pt.Mechanism("four-bar", gravity=(0, -G, 0))
        a, b, c, d = [(*p, 0.0) for p in GENERAL]
        m.add_rod("crank", a, b, 0.3)
        m.add_rod("coupler", b, c, 0.5)
        m.add_rod("rocker", d, c, 0.4)
        for name, parent, child, point in (
            ("A", "ground", "crank", a),
            ("B", "crank", "coupler", b),
            ("C", "coupler", "rocker", c),
            ("D", "ground", "rocker", d),
        ):
            m.add_revolute(name, parent, child, point=point, cut="always" if name == chosen else "never")
        run = done(m.simulate(1.0, rtol=1e-10, atol=1e-12))
        yield Held(f"cut at {chosen}", run.body("coupler").position, known, 1e-7)


@refused("everything welded to everything", DescriptionError, "nothing can move: every body is fixed to the ground")
def welded() -> Iterator[Held]:
    m = pt.Mechanism("block", gravity=(0, -G, 0))
    for i in range(2):
        m.add_body(f"b{i}", mass=1.0, inertia=(1, 1, 1), position=(float(i), 0, 0))
        m.add_fixed(f"foot{i}", m.ground, f"b{i}", point=(float(i), -1, 0))
    m.add_fixed("weld", "b0", "b1", point=(0.5, 0, 0))
    done(m.simulate(1.0))
    yield from ()


@refused("a start at rest at another time than its drive allows", ArgumentError, "has a closure error of")
def wrong_time() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=lambda t: 0.5 * t)
    start = m.assemble()
    done(
        m.simulate(1.0, initial=pt.State(4.0, start.q, start.v, names=start.names, velocity_names=start.velocity_names))
    )
    yield from ()
