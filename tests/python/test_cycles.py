"""Periodic motions: closed forms, other programs' numbers, and what is said where there is none."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.special import ellipk

import partita as pt
from partita.errors import ArgumentError, DescriptionError, EvaluationError
from partita.mechanism import monodromy

Array = NDArray[np.float64]
G = 9.81
CLOSE = 1e-9


def unbalance(rate: float = 3.0, stiffness: float = 8.0, damping: float = 0.8) -> pt.Mechanism:
    """A rotor off its centre on a sprung foundation: 2 x'' + c x' + k x = 0.25 W^2 cos(W t)."""
    m = pt.Mechanism("unbalance", gravity=None)
    base = m.add_body("base", mass=1.0, inertia=(1, 1, 1))
    rotor = m.add_rod("rotor", start=(0, 0, 0), end=(0.5, 0, 0), mass=1.0)
    m.add_prismatic("S", m.ground, base, axis=(1, 0, 0))
    m.add_revolute("R", base, rotor, point=(0, 0, 0))
    m.add_torsion_spring("S", stiffness=stiffness, damping=damping, name="s")
    m.add_drive("R", velocity=rate, name="motor")
    return m


def answer(w: float, k: float, c: float) -> complex:
    """x = Re(answer exp(i w t))."""
    return 0.25 * w**2 / (k - 2.0 * w**2 + 1j * c * w)


def test_a_driven_oscillator_in_closed_form() -> None:
    w, k, c = 3.0, 8.0, 0.8
    found = unbalance(w, k, c).cycle()
    x = answer(w, k, c)
    assert found.period == pytest.approx(2.0 * np.pi / w, rel=1e-15)
    assert found.state.position("S") == pytest.approx(x.real, abs=1e-12)
    assert found.state.velocity("S") == pytest.approx((1j * w * x).real, abs=1e-12)
    decay = np.exp(np.roots([2.0, c, k]) * found.period)
    assert sorted(found.multipliers, key=np.imag) == pytest.approx(sorted(decay, key=np.imag), abs=CLOSE)
    assert found.stable and found.kind == "driven" and found.error < CLOSE and found.method == "exact"
    assert found.words.startswith("stable: largest multiplier 0.6578")


def test_derivatives_of_a_driven_oscillator() -> None:
    w, k, c = 3.0, 8.0, 0.8
    found = unbalance(w, k, c).cycle(by=["s.stiffness", "s.damping", "motor.velocity"]).by
    h = 1e-6

    def start(*at: float) -> Array:
        x = answer(*at)
        return np.array([x.real, (1j * at[0] * x).real])

    for name, step in (("motor.velocity", (h, 0, 0)), ("s.stiffness", (0, h, 0)), ("s.damping", (0, 0, h))):
        ahead, back = (start(*(np.array([w, k, c]) + sign * np.array(step))) for sign in (1.0, -1.0))
        assert found[name].start[:, 0] == pytest.approx((ahead - back) / (2.0 * h), abs=1e-8)
    assert found["motor.velocity"].period[0] == pytest.approx(-2.0 * np.pi / w**2, abs=1e-8)
    assert found["s.damping"].period[0] == 0.0


def test_where_damping_vanishes_a_pair_crosses_the_unit_circle() -> None:
    family = unbalance().cycle(along={"s.damping": [0.3, -0.3]})
    (one,) = family.neimark_sackers
    assert one.value == pytest.approx(0.0, abs=CLOSE)
    assert one.multiplier == pytest.approx(np.exp(2j * 2.0 * np.pi / 3.0).conjugate(), abs=CLOSE)
    assert (one.before, one.after) == (0, 2)
    assert family.stable.tolist() == [True, False] and "Neimark-Sacker" in family[1].words


# a five-bar, AB driven at a constant rate, a torsion spring at the other ground pin


@cache
def five_bar(**motion: Any) -> pt.Mechanism:
    """Uniform bars of 1 kg/m: AB 0.2, BC 0.7, DC 0.75, ED 0.45, ground 0.8 m; spring 40 N m/rad at rest where ED is
    at 1.2 rad."""
    m = pt.Mechanism("five-bar")
    b = np.array([0.2, 0.0, 0.0])
    d = np.array([0.8 + 0.45 * np.cos(1.2), 0.45 * np.sin(1.2), 0.0])
    far = float(np.linalg.norm(d - b))
    turn = np.arctan2(d[1], d[0] - 0.2) + np.arccos((0.7**2 + far**2 - 0.75**2) / (2.0 * 0.7 * far))
    c = b + 0.7 * np.array([np.cos(turn), np.sin(turn), 0.0])
    ab = m.add_rod("AB", start=(0, 0, 0), end=b, mass=0.2)
    bc = m.add_rod("BC", start=b, end=c, mass=0.7)
    dc = m.add_rod("DC", start=d, end=c, mass=0.75)
    ed = m.add_rod("ED", start=(0.8, 0, 0), end=d, mass=0.45)
    m.add_revolute("A", m.ground, ab, point=(0, 0, 0))
    m.add_revolute("B", ab, bc, point=b)
    m.add_revolute("E", m.ground, ed, point=(0.8, 0, 0))
    m.add_revolute("D", ed, dc, point=d)
    m.add_revolute("C", bc, dc, point=c)
    m.add_torsion_spring("E", stiffness=40.0, damping=0.05, name="spring")
    m.add_drive("A", **(motion or {"velocity": 20.0}), name="motor")
    return m


def turning(t: float) -> float:
    return 20.0 * t


def five_bar_at(angle: float, rate: float) -> pt.State:
    return five_bar().assemble({"A": 0.0, "E": angle - 1.2}, rates={"E": rate})


# Computed once by a program of its own in 128 bits (absolute coordinates of the four bars with multipliers,
# extrapolated midpoint rule, dual numbers): rate, angle and rate of ED at the start, multipliers.
KNOWN = [
    (18.0, 1.15295802625668608, -0.641983860452213692, (-0.621710270180191234, 0.736442318712642192)),
    (22.0, 1.15261311809818365, -0.498045569497287648, None),
]


@pytest.mark.parametrize(("rate", "angle", "speed", "pair"), KNOWN)
def test_a_five_bar_against_another_program(rate: float, angle: float, speed: float, pair: Any) -> None:
    found = five_bar().cycle("motor", initial=five_bar_at(1.15, -0.5), parameters={"motor.velocity": rate})
    assert found.state.position("E") + 1.2 == pytest.approx(angle, abs=1e-11)
    # the reference has 13 digits of the rate at 22 rad/s
    assert found.state.velocity("E") == pytest.approx(speed, abs=CLOSE)
    if pair is None:
        assert found.multipliers.real == pytest.approx([-1.72473803601257522, -0.545809204188112548], abs=CLOSE)
        assert not found.multipliers.imag.any() and found.stable is False
        assert "past a period doubling" in found.words
    else:
        assert found.multipliers[0] == pytest.approx(complex(*pair), abs=CLOSE)
        assert found.stable is True


def test_derivatives_of_steps_are_those_of_differences() -> None:
    m = five_bar()
    start = five_bar_at(1.15, -0.5)

    def at(x: float) -> dict[str, Any]:
        return {"motor.velocity": [x]}

    setting = monodromy.Setting(
        m,
        lambda x: m.compile().with_parameters(at(x)),
        at,
        lambda x: 2.0 * np.pi / x,
        along=(("motor.velocity", [1.0]),),
    )
    variables = monodromy.chart(m.compile(), start)
    found = monodromy.monodromy(setting, start, variables, 20.0, np.pi / 10.0, by_x=True)
    other = monodromy.by_differences(setting, found.run, start, variables, 20.0, np.pi / 10.0, by_x=True)
    assert (found.method, other.method) == ("exact", "differences")
    assert found.matrix == pytest.approx(other.matrix, abs=CLOSE)
    assert found.by == pytest.approx(other.by, abs=CLOSE)


def test_the_determinant_is_that_of_the_divergence() -> None:
    """And a prescribed position gives the same motion as its rate."""
    m = five_bar(position=turning)
    found = m.cycle(initial=m.assemble({"E": -0.05}, rates={"E": -0.5}))
    other = five_bar().cycle(initial=five_bar_at(1.15, -0.5))
    assert found.state.q == pytest.approx(other.state.q, abs=1e-12)
    assert found.matrix == pytest.approx(other.matrix, abs=CLOSE)
    states = found.result.state(found.result.t[:-1])
    traces = [np.trace(m.linearize(state, independent=["E"], outputs=()).A) for state in states]
    # equally spaced sums are exact for periodic functions
    expected = np.exp(found.period * np.mean(traces))
    assert np.linalg.det(found.matrix) == pytest.approx(expected, rel=1e-8)


@cache
def doubling_family() -> Any:
    return five_bar().cycle(along={"motor.velocity": [19.9, 20.2]}, initial=five_bar_at(1.15, -0.5))


def test_a_period_doubling_is_located() -> None:
    family = doubling_family()
    (one,) = family.period_doublings
    assert family.bifurcations == (one,)
    assert one.value == pytest.approx(20.0340519360705780, abs=CLOSE)
    assert one.cycle.multipliers == pytest.approx([-1.0, -0.935829435255295192], abs=CLOSE)
    assert one.cycle.state.position("E") + 1.2 == pytest.approx(1.15288302624059558, abs=CLOSE)
    assert one.cycle.state.velocity("E") == pytest.approx(-0.544646103498690558, abs=1e-8)
    assert one.cycle.words.startswith("period doubling: a multiplier at -1.000")
    assert family.stable.tolist() == [True, False]


def test_the_branch_of_twice_the_period() -> None:
    branch = doubling_family().period_doublings[0].branch([20.1, 20.6])
    found = branch.at(20.6)[0]
    pair = complex(0.457191980710767747, 0.815954550222511464)
    assert found.multipliers[0] == pytest.approx(pair, abs=CLOSE)
    assert found.periods == 2 and found.period == pytest.approx(4.0 * np.pi / 20.6, rel=1e-14)
    # the reference begins half of the cycle later
    half = found.result.state(0.5 * found.period)
    starts = [state.position("E") + 1.2 for state in (found.state, half)]
    assert min(abs(x - 1.39237605637110631) for x in starts) < CLOSE
    assert branch.stable.tolist() == [True, True]


def test_a_motion_of_two_periods_from_its_start() -> None:
    start = five_bar_at(1.39, -4.08)
    found = five_bar().cycle(periods=2, initial=start, parameters={"motor.velocity": 20.6})
    assert found.state.position("E") + 1.2 == pytest.approx(1.39237605637110631, abs=1e-11)
    assert found.state.velocity("E") == pytest.approx(-4.08141566916250328, abs=1e-10)


# free motions


def van_der_pol(stiffness: float = 1.0, mu: float = 1.0) -> pt.Mechanism:
    m = pt.Mechanism("van der Pol", gravity=None)
    mass = m.add_body("mass", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, mass, axis=(1, 0, 0))
    m.add_torsion_spring("S", stiffness=stiffness, name="s")

    def push(t: float, state: Any) -> float:
        return mu * (1.0 - state.position("S") ** 2) * state.velocity("S")

    m.add_force(mass, (push, 0, 0), name="push")
    return m


def test_a_self_excited_motion_finds_its_period() -> None:
    m = van_der_pol()
    found = m.cycle(initial=m.assemble({"S": 1.0}))
    # Andersen and Geer, SIAM J. Appl. Math. 42 (1982), and many since
    assert found.period == pytest.approx(6.663286859323130, abs=1e-11)
    assert found.kind == "free" and np.abs(found.trivial - 1.0).max() < CLOSE
    x = found.result.joint("S").position[:-1]
    expected = np.exp(found.period * np.mean(1.0 - x**2))
    assert found.multipliers == pytest.approx([expected], rel=1e-6) and found.stable
    with pytest.raises(ArgumentError, match="begins at rest in an equilibrium"):
        m.cycle()


def test_a_family_of_free_rotations() -> None:
    """A constant torque turns a damped pendulum over and over: its work in a turn is that of the damper."""
    m = pendulum()
    m.add_torsion_spring("A", stiffness=0.0, damping=0.5, name="d")
    m.add_torque("A", 6.0, name="push")
    family = m.cycle(along={"push.value": [6.0, 8.0]}, initial=m.assemble(rates={"A": 12.0}))
    for one, torque in zip(family, (6.0, 8.0), strict=True):
        rate = one.result.joint("A").velocity[:-1, 0] if one.result.joint("A").velocity.ndim > 1 else None
        rate = one.result.joint("A").velocity[:-1] if rate is None else rate
        assert 0.5 * one.period * np.mean(rate**2) == pytest.approx(2.0 * np.pi * torque, rel=CLOSE)
        assert one.multipliers == pytest.approx([np.exp(-0.5 * 3.0 * one.period)], abs=CLOSE)
    assert family.stable.all() and not family.bifurcations


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


@pytest.mark.parametrize("amplitude", [0.5, 2.5])
def test_a_free_pendulum_keeps_its_energy(amplitude: float) -> None:
    m = pendulum()
    found = m.cycle(initial=m.assemble({"A": amplitude}))
    assert found.period == pytest.approx(4.0 * ellipk(np.sin(0.5 * amplitude) ** 2) / np.sqrt(1.5 * G), rel=1e-11)
    assert found.kind == "conservative" and found.stable is None and "family over its energy" in found.words
    assert len(found.trivial) == 2 and np.abs(found.trivial - 1.0).max() < 1e-4  # a double one: the root of the error


def test_the_motion_of_a_given_period() -> None:
    m = pendulum()
    found = m.cycle(2.0, initial=m.assemble({"A": 1.7}))
    amplitude = np.abs(found.result.joint("A").angle).max()
    assert 4.0 * ellipk(np.sin(0.5 * amplitude) ** 2) / np.sqrt(1.5 * G) == pytest.approx(2.0, abs=1e-6)


def test_a_motion_that_dies_out_is_no_cycle() -> None:
    m = pendulum()
    m.add_torsion_spring("A", stiffness=0.0, damping=1.0)
    with pytest.raises(ArgumentError, match="dies out"):
        m.cycle(initial=m.assemble({"A": 1.0}))


# stability


def upside_down(amplitude: float, rate: float = 40.0, damping: float = 0.0) -> pt.Mechanism:
    m = pt.Mechanism("upside-down pendulum")
    base = m.add_body("base", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("lift", m.ground, base, axis=(0, 1, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    m.add_revolute("A", base, rod, point=(0, 0, 0))
    m.add_torsion_spring("A", stiffness=0.0, damping=damping)
    m.add_drive("lift", position=lambda t: amplitude * np.cos(rate * t))
    return m


@pytest.mark.parametrize(
    ("amplitude", "damping", "stable"), [(0.05, 0.0, False), (0.15, 0.0, None), (0.15, 0.05, True)]
)
def test_shaking_holds_a_pendulum_upright(amplitude: float, damping: float, stable: bool | None) -> None:
    found = upside_down(amplitude, damping=damping).cycle(settle=0)
    assert found.period == pytest.approx(2.0 * np.pi / 40.0, rel=1e-12)

    def hill(t: float, y: Array) -> list[float]:
        push = 1.5 * (G - amplitude * 40.0**2 * np.cos(40.0 * t))
        return [y[1], push * y[0] - 3.0 * damping * y[1], y[3], push * y[2] - 3.0 * damping * y[3]]

    ends = solve_ivp(hill, (0.0, found.period), [1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    expected = np.linalg.eigvals(ends.reshape(2, 2).T)
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex(expected), abs=1e-8)
    assert found.stable is stable


def test_a_spinning_pendulum_leaves_its_axis() -> None:
    """At W^2 = 3 g / (2 L) it swings out: a branch point, at which the parameter does not turn back."""
    m = pt.Mechanism("spinning pendulum")
    post = m.add_body("post", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("spin", m.ground, post, point=(0, 0, 0), axis=(0, 1, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -0.5, 0), mass=1.0)
    m.add_revolute("swing", post, rod, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_torsion_spring("swing", stiffness=0.0, damping=0.02)
    m.add_drive("spin", velocity=5.0, name="motor")
    family = m.cycle(along={"motor.velocity": [5.0, 6.0]})
    (one,) = family.branch_points
    assert one.value == pytest.approx(np.sqrt(1.5 * G / 0.5), abs=CLOSE)
    with pytest.raises(ArgumentError, match="only those of a period doubling"):
        one.branch()


# a pendulum on a crank pin: its resonance bends over

RADIUS, LENGTH, DRAG = 0.03, 0.5, 0.02


def on_a_pin(rate: float) -> pt.Mechanism:
    m = pt.Mechanism("pendulum on a crank pin")
    disc = m.add_body("disc", mass=1.0, inertia=(1, 1, 1))
    rod = m.add_rod("rod", start=(RADIUS, 0, 0), end=(RADIUS, -LENGTH, 0), mass=1.0)
    m.add_revolute("A", m.ground, disc, point=(0, 0, 0))
    m.add_revolute("B", disc, rod, point=(RADIUS, 0, 0))
    m.add_torsion_spring("B", stiffness=0.0, damping=DRAG)
    m.add_drive("A", velocity=rate, name="motor")
    return m


def pin_map(x: Array, rate: float) -> tuple[Array, Array]:
    """Angle from the vertical and its rate after one turn, by SciPy; and their derivatives."""
    moment = LENGTH**2 / 3.0

    def rates(t: float, y: Array) -> list[float]:
        sine, cosine = np.sin(y[0]), np.cos(y[0])
        ax, ay = -RADIUS * rate**2 * np.cos(rate * t), -RADIUS * rate**2 * np.sin(rate * t)
        a = 0.5 * LENGTH
        bend = (-G * a * sine - a * (cosine * ax + sine * ay) - DRAG * (y[1] - rate)) / moment
        slope = (-G * a * cosine - a * (-sine * ax + cosine * ay)) / moment
        return [
            y[1], bend,
            y[3], slope * y[2] - DRAG / moment * y[3],
            y[5], slope * y[4] - DRAG / moment * y[5],
        ]  # fmt: skip

    y = solve_ivp(rates, (0.0, 2.0 * np.pi / rate), [*x, 1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y[:2], y[2:].reshape(2, 2).T


def test_folds_of_a_resonance() -> None:
    m = on_a_pin(5.2)
    family = m.cycle(along={"motor.velocity": [5.2, 4.9, 4.6]})
    assert len(family.at(4.9)) == 3 and len(family.at(4.6)) == 1
    assert [one.stable for one in family.at(4.9)] == [True, False, True]

    def conditions(x: Array) -> list[float]:
        end, matrix = pin_map(x[:2], x[2])
        return [*(end - x[:2]), np.linalg.det(matrix - np.eye(2))]

    assert len(family.folds) == 2
    for one in family.folds:
        angle = one.cycle.state.position("B") + one.cycle.state.position("A")
        speed = one.cycle.state.velocity("B") + one.value
        expected = fsolve(conditions, [angle, speed, one.value + 1e-4], xtol=1e-13)
        assert one.value == pytest.approx(expected[2], abs=CLOSE)
        assert angle == pytest.approx(expected[0], abs=1e-5)
        assert one.multiplier == pytest.approx(1.0, abs=1e-7)
        with pytest.raises(ArgumentError, match="branches of a fold"):
            one.branch()


# impacts


def test_a_ball_that_bounces_on_a_shaken_table() -> None:
    """Once in each period, in closed form: it leaves at g T / 2, the table moves at (1 - e) / (1 + e) of that."""
    period, e = 0.5, 0.8
    w, leaving = 2.0 * np.pi / period, 0.5 * G * period
    across, up = 0.03, leaving * (1.0 - e) / (1.0 + e) / w
    size, phase = np.hypot(across, up), np.arctan2(across, up)

    def lift(t: float) -> float:
        return size * np.sin(w * t + phase + np.pi)

    m = pt.Mechanism("bouncing ball")
    table = m.add_body("table", mass=1.0, inertia=(1, 1, 1))
    ball = m.add_body("ball", mass=0.3, inertia=(1, 1, 1))
    m.add_prismatic("lift", m.ground, table, axis=(0, 1, 0))
    m.add_prismatic("gap", table, ball, axis=(0, 1, 0))
    m.add_stop("gap", lower=0.0, restitution=e)
    m.add_drive("lift", position=lift)
    gap, rate = across + G * period**2 / 8.0 - lift(0.0), size * w * np.cos(phase)
    found = m.cycle(initial=m.assemble({"gap": 1.02 * gap}, rates={"gap": rate}))
    assert found.state.position("gap") == pytest.approx(gap, abs=1e-10)
    assert found.state.velocity("gap") == pytest.approx(rate, abs=CLOSE)
    assert [event.t for event in found.result.events] == pytest.approx([0.5 * period], abs=1e-10)
    trace = 1.0 + (1.0 + e) ** 2 * (-across * w**2) / G + e**2
    expected = np.roots([1.0, -trace, e**2])
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex(expected), abs=1e-6)


# periods


def slider(**motion: Any) -> pt.Mechanism:
    """A mass on a spring, beside one that is driven."""
    m = unbalance()
    carriage = m.add_body("carriage", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("T", m.ground, carriage, axis=(1, 0, 0))
    m.add_drive("T", **motion, name="push")
    return m


BEATS: list[tuple[Any, float]] = [
    ({"position": lambda t: 0.1 * np.sin(4.5 * t)}, 2.0 * np.pi / 1.5),
    ({"position": lambda t: 0.1 * np.cos(1.5 * t) ** 2}, 2.0 * np.pi / 3.0),
    ({"velocity": lambda t: np.sin(6.0 * t + 0.3)}, 2.0 * np.pi / 3.0),
    ({"position": (2.0 * np.pi / 3.0 * np.linspace(0, 1, 9), np.sin(2 * np.pi * np.linspace(0, 1, 9)))}, 2 * np.pi / 3),
]


@pytest.mark.parametrize(("motion", "period"), BEATS)
def test_the_common_period_of_drives(motion: Any, period: float) -> None:
    found = slider(**motion).cycle()
    assert found.period == pytest.approx(period, rel=1e-11)
    assert np.abs(found.multipliers[0]) == pytest.approx(np.exp(-0.2 * period), abs=1e-8)


def test_gears_come_back_after_two_turns() -> None:
    m = pt.Mechanism("gears", gravity=None)
    small, large = (m.add_body(name, mass=1.0, inertia=(1, 1, 1)) for name in ("small", "large"))
    m.add_revolute("A", m.ground, small, point=(0, 0, 0))
    m.add_revolute("B", m.ground, large, point=(3, 0, 0))
    m.add_gear("mesh", "A", "B", ratio=-2.0)
    m.add_drive("B", velocity=3.0)
    with pytest.raises(ArgumentError, match=r"A is -?3\.14.* from where it began.*number of periods="):
        m.cycle()
    found = m.cycle(periods=2)
    assert found.period == pytest.approx(4.0 * np.pi / 3.0) and found.stable and not len(found.multipliers)


def test_what_does_not_repeat_is_named() -> None:
    with pytest.raises(ArgumentError, match="no common period"):
        slider(position=lambda t: np.sin(np.sqrt(7.0) * t)).cycle()
    with pytest.raises(ArgumentError, match='drive "push" moves on in one direction'):
        slider(velocity=1.0).cycle()
    with pytest.raises(ArgumentError, match="ends 1 from where it begins"):
        slider(position=([0.0, 1.0], [0.0, 1.0])).cycle()
    with pytest.raises(ArgumentError, match="no time was found after which its motion repeats"):
        slider(position=lambda t: 0.1 * np.tanh(t)).cycle()
    with pytest.raises(ArgumentError, match=r"after 1.9 s R is -0.583.* from where it began"):
        unbalance().cycle(1.9)
    m = unbalance()
    m.add_force("base", (lambda t, state: np.cos(4.5 * t), 0, 0))
    with pytest.raises(ArgumentError, match=r"do not repeat after 2.094\d* s: .* the acceleration of S is"):
        m.cycle()
    with pytest.raises(ArgumentError, match='nothing drives "S"'):
        unbalance().cycle("S")
    m = pendulum()
    m.add_torsion_spring("A", stiffness=1.0)
    m.add_drive("A", velocity=1.0)
    with pytest.raises(ArgumentError, match="with A whole turns further on"):
        m.cycle()


def test_arguments_are_checked() -> None:
    m = unbalance()
    with pytest.raises(DescriptionError, match="no such parameter"):
        m.cycle(along={"spring": [1.0, 2.0]})
    with pytest.raises(ArgumentError, match="periods"):
        m.cycle(periods=0)
    with pytest.raises(ArgumentError, match="settle"):
        m.cycle(settle=-1)
    with pytest.raises(DescriptionError, match="no such parameter"):
        m.cycle(by=["nothing"])
    with pytest.raises(ArgumentError, match="by must be a list"):
        m.cycle(by="s.stiffness")
    with pytest.raises(ArgumentError, match="periods counts those of drives"):
        pendulum().cycle(periods=2)


# what is shown


def test_what_a_cycle_shows(tmp_path: Path) -> None:
    found = unbalance().cycle(by=["s.stiffness"])
    assert repr(found).startswith("<Cycle of 2.0944 s, driven: stable: largest multiplier 0.6578; a pair -0.")
    assert "comes back within" in found._repr_html_()
    data = found.to_xarray()
    assert data["matrix"].shape == (2, 2) and data.attrs["kind"] == "driven"
    found.plot(path=tmp_path / "cycle.png")
    assert (tmp_path / "cycle.png").stat().st_size > 5000
    assert "S: " in repr(found.by["s.stiffness"])


def test_what_a_family_shows(tmp_path: Path) -> None:
    family = doubling_family()
    assert repr(family) == (
        "<CycleFamily over motor.velocity: 2 cycles for 2 values, 1 stable; period doubling at 20.0341>"
    )
    assert "period doubling" in family._repr_html_()
    assert family.to_xarray()["what"].values.tolist() == ["period doubling"]
    assert repr(family.period_doublings[0]).startswith("<period doubling at 20.03405194: multiplier -1; 0 outside")
    family.plot("E", path=tmp_path / "family.png")
    assert (tmp_path / "family.png").stat().st_size > 5000
    assert family.missed.size == 0 and len(list(family)) == 2 and family[-1] is family.cycles[1]
    with pytest.raises(ArgumentError, match="none of the values asked for"):
        family.at(3.0)


def test_the_example_meets_its_known_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the picture of docs/cycles.md is the one that it draws."""
    root = Path(__file__).parents[2]
    spec = importlib.util.spec_from_file_location("cycles_example", root / "examples" / "cycles.py")
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    assert example.main(tmp_path) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 5 and max(float(line.split()[-1]) for line in lines) < CLOSE
    drawn, shown = ((folder / "cycles.svg").read_text("utf-8") for folder in (tmp_path, root / "docs" / "pictures"))
    assert 0.8 < len(drawn) / len(shown) < 1.25 and len(shown) < 250_000


def test_a_period_that_is_none_is_refused() -> None:
    """Loads that change over seconds, and times within which nothing does; a run that would not end."""
    m = pt.Mechanism("shaken mass", gravity=None)
    mass = m.add_body("mass", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, mass, axis=(1, 0, 0))
    m.add_torsion_spring("S", stiffness=4.0, damping=0.4)
    m.add_force(mass, (lambda t, state: np.cos(3.0 * t), 0, 0))
    for period in (1e-12, 1e-30):
        with pytest.raises(ArgumentError, match="nothing changes within"):
            m.cycle(period)
    with pytest.raises(ArgumentError, match="nothing moves in that time"):
        m.cycle(1e-308)
    with (
        pt.limits.raised(cycle_steps=2000),
        pytest.raises(EvaluationError, match=r"is that its period.*cycle_steps=20000"),
    ):
        m.cycle(1e9)
