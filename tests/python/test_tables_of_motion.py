"""Tables over what a mechanism reads: periodic ones over angles, and over distances, displacements and cosines.

Closed forms: a torque over the angle of a wheel does the work that the table says, however narrow its features, however
long the steps, and wherever a period begins.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

import partita as pt

Array = NDArray[np.float64]
BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])


def wheel() -> pt.Mechanism:
    """A wheel of 1 kg m^2 on a hinge A."""
    m = pt.Mechanism("wheel", gravity=(0, 0, 0))
    m.add_body("w", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_revolute("A", m.ground, "w", point=(0, 0, 0))
    return m


def trapezoid(at: float, half: float, height: float, period: float) -> tuple[list[float], list[float]]:
    """Zero but for a bump, over one period."""
    x = [0.0, at - half, at - half / 2, at, at + half / 2, at + half, period]
    return x, [0.0, 0.0, height, height, height, 0.0, 0.0]


@BOTH
@pytest.mark.parametrize("outputs", [2, 201])
def test_a_flywheel_is_braked_at_every_passage(coordinates: str, outputs: int) -> None:
    m = wheel()
    m.add_torque("A", trapezoid(5.5, 0.1, -300.0, 2 * pi), over="A", periodic=True)
    start = m.assemble(rates={"A": 60.0}, coordinates=coordinates)
    r = m.simulate(3.0, initial=start, t_eval=np.linspace(0, 3, outputs), coordinates=coordinates)
    # each passage does the work -1.5 * 0.1 * 300 = -45 J; 23 of them lie within three seconds
    assert r.success and r.certificate.verdict == "valid"
    assert r.joint("A").velocity[-1, 0] == pytest.approx(sqrt(3600 - 90 * 23), rel=1e-5)


def test_narrow_features_of_any_period_act_at_every_passage() -> None:
    rng = np.random.default_rng(12)
    for trial in range(30):
        turns, sense = rng.integers(1, 4), 1.0 if rng.random() < 0.5 else -1.0
        period = 2 * pi / turns
        at, half = rng.uniform(0.1, 0.9) * period, 10 ** rng.uniform(-2.5, -1.2) * period
        begin = rng.uniform(-10, 10)
        m = wheel()
        x, y = trapezoid(at, half, rng.uniform(5, 60), period)
        m.add_torque("A", ([begin + x for x in x], y), over="A", periodic=True)
        coordinates: str = "relative" if rng.random() < 0.5 else "absolute"
        t0, length = rng.uniform(0, 5), rng.uniform(1, 3)
        start = m.assemble(rates={"A": sense * rng.uniform(10, 30)}, t=t0, coordinates=coordinates)
        r = m.simulate(length, initial=start, t_eval=[t0, t0 + length], coordinates=coordinates)
        angle, rate = r.joint("A").position[:, 0], r.joint("A").velocity[:, 0]
        assert r.success, (trial, r.message)

        def work(a: float, x: list[float] = x, y: list[float] = y, begin: float = begin, p: float = period) -> float:
            whole, rest = divmod(a - begin, p)
            points = np.append(np.array(x)[np.array(x) < rest], rest)
            of_one = float(np.trapezoid(y, x))
            return float(whole) * of_one + float(np.trapezoid(np.interp(points, x, y), points))

        expected = sqrt(rate[0] ** 2 + 2 * (work(float(angle[1])) - work(float(angle[0]))))
        assert abs(rate[1]) == pytest.approx(expected, rel=2e-5), trial


@BOTH
@pytest.mark.parametrize("what", ["cosine", "along", "distance"])
def test_a_reading_that_swings_within_a_step_is_followed(what: str, coordinates: str) -> None:
    m = wheel()
    x = [0.9, 1.95, 1.975, 2.025, 2.05, 3.1] if what == "distance" else [-1.1, 0.45, 0.475, 0.525, 0.55, 1.1]
    over = {
        "cosine": pt.Cosine(m.ground, (1, 0, 0), "w", (1, 0, 0)),
        "along": pt.Along(m.ground, (0, 0, 0), (1, 0, 0), "w", (1, 0, 0)),
        "distance": pt.Distance(m.ground, (2, 0, 0), "w", (1, 0, 0)),
    }[what]
    m.add_torque("A", (x, [0, 0, 40, 40, 0, 0]), over=over)
    start = m.assemble(rates={"A": 20.0}, coordinates=coordinates)
    r = m.simulate(1.5, initial=start, t_eval=[0, 1.5], coordinates=coordinates)
    turn = np.linspace(0, float(r.joint("A").position[-1, 0]), 400_001)
    read = np.sqrt(5 - 4 * np.cos(turn)) if what == "distance" else np.cos(turn)
    work = np.trapezoid(PchipInterpolator(x, [0, 0, 40, 40, 0, 0])(read), turn)
    assert r.success and r.certificate.verdict == "valid"
    assert r.joint("A").velocity[-1, 0] == pytest.approx(sqrt(400 + 2 * work), rel=1e-5)


def test_narrow_features_of_measurements_act_at_every_passage() -> None:
    rng = np.random.default_rng(5)
    for trial in range(16):
        m = wheel()
        centre, extent = rng.uniform(1.2, 3.0), rng.uniform(0.3, 1.0)
        at = centre + rng.uniform(-0.98, 0.98) * extent
        half = 10 ** rng.uniform(-2.3, -1) * extent
        x = [centre - extent - 0.2, at - half, at - half / 2, at + half / 2, at + half, centre + extent + 0.2]
        if np.any(np.diff(x) <= 0):
            continue
        y = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
        height = rng.uniform(5, 40)
        m.add_torque("A", (x, [height * y for y in y]), over=pt.Distance(m.ground, (centre, 0, 0), "w", (extent, 0, 0)))
        coordinates: str = "relative" if rng.random() < 0.5 else "absolute"
        t0, length = rng.uniform(0, 5), rng.uniform(0.5, 1.5)
        start = m.assemble(rates={"A": rng.uniform(-25, 25)}, t=t0, coordinates=coordinates)
        r = m.simulate(length, initial=start, t_eval=[t0, t0 + length], coordinates=coordinates)
        angle, rate = r.joint("A").position[:, 0], r.joint("A").velocity[:, 0]
        turn = np.linspace(float(angle[0]), float(angle[1]), 400_001)
        read = np.sqrt(centre**2 + extent**2 - 2 * centre * extent * np.cos(turn))
        work = np.trapezoid(height * PchipInterpolator(x, y)(read), turn)
        assert r.success, (trial, r.message)
        energy = 0.5 * rate[1] ** 2 - 0.5 * rate[0] ** 2
        assert energy == pytest.approx(work, rel=1e-5, abs=2e-5 * (rate[0] ** 2 + height)), trial


@pytest.mark.parametrize("height", [100.0, 800.0])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_a_trial_that_leaves_the_table_is_repeated_shorter(height: float, rtol: float) -> None:
    m = pt.Mechanism("slide", gravity=(0, 0, 0))
    m.add_body("s", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "s", axis=(1, 0, 0))
    x, y = [0, 0.50, 0.51, 0.53, 0.54, 3.0], [0, 0, height, height, 0, 0]
    m.add_torque("S", (x, y), over=pt.Distance(m.ground, (1.0, 0.1, 0), "s", (0, 0, 0)))
    r = m.simulate(0.2, initial=m.assemble(rates={"S": 10.0}), t_eval=[0, 0.2], rtol=rtol)
    assert r.success, r.message
    path = np.linspace(0, float(r.joint("S").position[-1, 0]), 400_001)
    work = np.trapezoid(PchipInterpolator(x, y)(np.hypot(path - 1, 0.1)), path)
    assert r.joint("S").velocity[-1, 0] == pytest.approx(sqrt(100 + 2 * work), rel=1e-4)


@BOTH
def test_a_motion_that_leaves_the_table_stops_there_and_says_so(coordinates: str) -> None:
    m = wheel()
    m.add_torque(
        "A", ([-1.0, 0.0, 1.0], [0.0, 1.0, 0.0]), over=pt.Along(m.ground, (0, 0, 0), (0, 1, 0), "w", (2, 0, 0))
    )
    start = m.assemble(rates={"A": 1.0}, coordinates=coordinates)
    r = m.simulate(2.0, initial=start, coordinates=coordinates)
    assert not r.success and r.status == "evaluation-failed"
    assert "outside [-1, 1]" in r.message and "torque on A" in r.message
    # twice the sine of the angle is 1
    assert r.t[-1] < 0.55


def test_members_of_an_ensemble_stop_where_the_table_ends() -> None:
    """A table of one piece has no breakpoint, but ends: side by side nothing would tell."""
    m = wheel()
    m.add_torque("A", ([-1.0, 1.0], [0.0, 1.0]), over=pt.Along(m.ground, (0, 0, 0), (0, 1, 0), "w", (2, 0, 0)))
    states = [m.assemble(rates={"A": rate}) for rate in np.linspace(0.01, 1.0, 40)]
    found = m.ensemble(states=states, t_eval=[0.0, 1.0])
    for i, state in enumerate(states):
        alone = m.simulate(1.0, initial=state, t_eval=[0.0, 1.0])
        assert found.status[i] == alone.status, i
    assert {"finished", "evaluation-failed"} == set(found.status)
