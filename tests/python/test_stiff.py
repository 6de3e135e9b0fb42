"""Stiff mechanisms: the implicit method, against known numbers and with everything that a run may meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawings import bushing_wishbone
from test_rounding import RIGHT

import partita as pt

METHODS = ("radau", "auto")


def work(run: pt.Result, dof: int) -> int:
    """Evaluations, a matrix of Newton's method counted as one for each degree of freedom."""
    return run.counters["evaluations"] + dof * run.counters["jacobians"]


def off(run: pt.Result) -> float:
    """Distance from the right numbers of the wishbone."""
    upright, worst = run.body("upright"), 0.0
    for i, right in enumerate(RIGHT.values()):
        found = (*upright.position[1 + i, :2], upright.velocity[1 + i, 1])
        worst = max(worst, float(np.abs(np.subtract(found, (*right[:2], right[3]))).max()))
    return worst


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("method", METHODS)
def test_a_wishbone_on_bushings_is_right_to_ten_digits(method: str, coordinates: str) -> None:
    run = bushing_wishbone().simulate(
        0.05, t_eval=[0.0, *RIGHT], method=method, coordinates=coordinates, rtol=1e-12, atol=1e-12
    )
    assert run.success, run.message
    upright = run.body("upright")
    for i, (x, y, _, vy) in enumerate(RIGHT.values()):
        assert upright.position[1 + i, :2] == pytest.approx((x, y), rel=1e-10)
        assert upright.velocity[1 + i, 1] == pytest.approx(vy, rel=1e-9)


def test_a_description_that_was_saved_has_the_same_run(tmp_path: Any) -> None:
    m = bushing_wishbone()
    m.save(tmp_path / "wishbone.toml")
    runs = [x.simulate(0.01, method="radau") for x in (m, pt.load(tmp_path / "wishbone.toml"))]
    assert np.array_equal(runs[0].q, runs[1].q)
    assert runs[0].counters["jacobians"] == runs[1].counters["jacobians"] > 0


def test_work_falls_by_orders_where_forces_are_stiff() -> None:
    # as exact as the explicit run, whose steps are as short as the bushings demand
    runs = {
        method: bushing_wishbone(1e10, 1e6).simulate(0.02, t_eval=[0.0, 0.02], method=method, rtol=1e-5, atol=1e-7)
        for method in ("dop853", "radau", "auto")
    }
    explicit = work(runs["dop853"], 5)
    assert work(runs["radau"], 5) < explicit / 50
    assert work(runs["auto"], 5) < explicit / 20
    for method in METHODS:
        assert runs[method].q == pytest.approx(runs["dop853"].q, abs=1e-6)


def test_two_digits_more_cost_two_times_as_much() -> None:
    # the estimate has order five, and none of its own rounding stops it
    runs = [
        bushing_wishbone().simulate(0.05, t_eval=[0.0, *RIGHT], method="radau", rtol=rtol, atol=rtol)
        for rtol in (1e-8, 1e-10, 1e-12)
    ]
    counts = [work(run, 5) for run in runs]
    assert counts[1] < 3 * counts[0] and counts[2] < 3 * counts[1]
    assert off(runs[1]) < 1e-8 and off(runs[2]) < 1e-9


def test_an_explicit_run_says_what_limits_it_and_auto_what_it_did() -> None:
    stiff = bushing_wishbone(1e10, 1e6)
    advice = [note for note in stiff.simulate(0.004).notes if "stability, not accuracy" in note]
    assert len(advice) == 1 and 'method="radau"' in advice[0] and "per second" in advice[0]
    changed = [note for note in stiff.simulate(0.02, method="auto").notes if "changes to radau" in note]
    assert changed and "per second" in changed[0]
    for method in ("dop853", "auto"):
        plain = pt.catalogue.load("four-bar").simulate(2.0, method=method)
        assert not [note for note in plain.notes if "method" in note]


def test_auto_takes_the_same_steps_where_nothing_is_stiff() -> None:
    runs = [pt.catalogue.load("four-bar").simulate(2.0, method=method) for method in ("dop853", "auto")]
    assert np.array_equal(runs[0].q, runs[1].q)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("mu", "t", "x", "v"),
    # of mu = 1 by SciPy's DOP853 at 1e-13; of mu = 1000: E. Hairer's and G. Wanner's test set, eps = 1e-6
    [(1.0, 20.0, 2.00814976, -0.04250888), (1000.0, 2000.0, 1.706167732170483, -0.8928097010247975e-3)],
)
def test_van_der_pol(method: str, mu: float, t: float, x: float, v: float) -> None:
    m = pt.Mechanism("van der Pol", gravity=(0, 0, 0))
    body = m.add_body("body", mass=1.0, inertia=(1, 1, 1))
    slide = m.add_prismatic("slide", m.ground, body, point=(0, 0, 0), axis=(1, 0, 0))
    m.add_force_law("f", lambda t, s: ((mu * (1 - s.position**2) * s.rate - s.position), 0, 0), on=[body], sees=[slide])
    start = m.assemble({"slide": 2.0}, rates={"slide": 0.0})
    run = m.simulate(t, initial=start, method=method, rtol=1e-9, atol=1e-11, t_eval=[0.0, t])
    assert run.success
    assert run.q[-1, 0] == pytest.approx(x, rel=1e-6)
    assert run.v[-1, 0] == pytest.approx(v, rel=1e-6)
    if mu > 1:
        assert run.counters["evaluations"] < 30_000
        # the law is a function of Python: it is differenced, and the counters say so
        assert run.counters["differenced_jacobians"] > 0


def striker(stop: bool = True) -> pt.Mechanism:
    """A rod whose tip slides along it on a spring of 1e8 N/m, and a stop that it falls on."""
    m = pt.Mechanism("striker", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", (0, 0, 0), (1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    tip = m.add_body("tip", mass=0.2, inertia=(1e-4, 1e-4, 1e-4), position=(1, 0, 0))
    m.add_prismatic("P", rod, tip, point=(1, 0, 0), axis=(1, 0, 0))
    m.add_spring("S", rod, (0.2, 0, 0), tip, (0, 0, 0), stiffness=1e8, damping=2e5, length=0.8)
    if stop:
        m.add_stop("stop", "A", lower=-1.0, restitution=0.5)
    return m


def falls_for(angle: float) -> float:
    """Time after which a pendulum that falls from the horizontal, as rigid as the spring nearly, is at an angle below.

    By its energy, and a quadrature that removes the root at the start.
    """
    inertia, weight = 1.0 / 3.0 + 0.2 + 1e-4, 9.81 * (0.5 + 0.2)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s = 0.5 * np.sqrt(angle) * (nodes + 1)
    rate = np.sqrt(2 * weight * np.sin(s * s) / inertia)
    return float((0.5 * np.sqrt(angle) * weights * 2 * s / rate).sum())


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("method", METHODS)
def test_impacts_rest_and_locks_within_stiff_runs(method: str, coordinates: str) -> None:
    m, time = striker(), falls_for(1.0)
    run = m.simulate(2.0, method=method, coordinates=coordinates, t_eval=[0.0, 1.0, 2.0])
    assert run.success, run.message
    first = run.events[0]
    assert first.kind == "impact" and first.t == pytest.approx(time, rel=1e-6)
    assert first.energy_lost > 0
    # it comes to rest on the stop, and does not creep there by thousands of steps
    assert run.joint("A").position[-1] == pytest.approx(-1.0, abs=1e-9)
    assert run.counters["evaluations"] < 60_000
    # what happens in every segment is told twice
    assert len([note for note in run.notes if "changes to radau" in note]) <= 2
    caught = m.simulate(
        1.0,
        method=method,
        coordinates=coordinates,
        events=[pt.Event("low", "A", value=-0.5, then=pt.Lock("A"))],
        t_eval=[0.0, 1.0],
    )
    assert caught.success
    assert caught.joint("A").position[-1] == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.parametrize("solver", ["fixed", "qr", "multipliers", "sparse-multipliers"])
def test_other_formulations_take_implicit_steps(solver: str) -> None:
    run, other = (
        bushing_wishbone().simulate(0.02, method="radau", coordinates="absolute", solver=s)
        for s in (None, pt.Solver(solver))
    )
    assert other.success
    assert other.q == pytest.approx(run.q, abs=1e-6)
    assert other.counters["evaluations"] < 10_000


def test_fixed_steps_and_steppers_stay_stable() -> None:
    stiff = bushing_wishbone(1e10, 1e6)
    right = stiff.simulate(0.1, t_eval=np.linspace(0, 0.1, 11), method="radau", rtol=1e-10, atol=1e-10)
    run = stiff.simulate(0.1, t_eval=right.t, method="radau", step=1e-3)
    assert run.success and run.q == pytest.approx(right.q, abs=1e-5)
    stepper = stiff.stepper(1e-3, method="radau")
    for i in range(100):
        tick = stepper.step()
        if i % 10 == 9:
            assert tick.q == pytest.approx(right.q[(i + 1) // 10], abs=1e-5)


def test_states_between_outputs_are_as_exact_as_the_outputs() -> None:
    m = bushing_wishbone()
    run = m.simulate(0.05, method="radau", t_eval=[0.0, 0.05], rtol=1e-9, atol=1e-9)
    dense = m.simulate(0.05, method="radau", t_eval=np.linspace(0, 0.05, 301), rtol=1e-9, atol=1e-9)
    # outputs do not change the steps
    assert np.array_equal(run.q[-1], dense.q[-1])
    exact = m.simulate(0.05, method="radau", t_eval=dense.t, rtol=1e-12, atol=1e-12)
    assert dense.q == pytest.approx(exact.q, abs=1e-8)
    assert run.state(0.0213).q == pytest.approx(dense.state(0.0213).q, abs=1e-9)


def test_a_run_goes_on_from_a_result() -> None:
    m = bushing_wishbone()
    whole = m.simulate(0.04, method="radau", t_eval=[0.0, 0.02, 0.04])
    second = m.simulate(0.02, initial=whole.state(0.02), method="radau", t_eval=[0.02, 0.04])
    assert second.q[-1] == pytest.approx(whole.q[-1], abs=1e-7)


def test_energy_is_accounted_for() -> None:
    run = bushing_wishbone(1e10, 1e6).simulate(0.1, method="radau", rtol=1e-9, atol=1e-9)
    # what the dampers take is integrated beside the motion, whose steps do not follow it
    assert run.success
    assert run.energy.work[-1] < -1.0
    assert abs(run.energy.relative_balance) < 1e-6


def test_members_of_ensembles_with_stiff_forces_run_one_by_one() -> None:
    m, times = bushing_wishbone(1e10, 1e6), np.linspace(0, 0.004, 3)
    found = m.ensemble(parameters={"upright.mass": np.linspace(30, 40, 100)}, t_eval=times)
    assert any("stiff forces" in note for note in found.notes)
    run = m.simulate(0.004, t_eval=times, parameters={"upright.mass": 40.0}, method="radau", rtol=1e-10, atol=1e-12)
    assert found.q[-1] == pytest.approx(run.q, abs=1e-8)


def test_a_damped_governor_finds_its_height() -> None:
    # a ball of a governor at constant speed, its sleeve in a stiff dashpot: h = g (m + 2 M) / (m w^2)
    ball, weight, length, speed = 2.0, 5.0, 0.3, 20.0
    m = pt.Mechanism("governor", gravity=(0, 0, -9.81))
    spindle = m.add_body("spindle", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.add_revolute("R", m.ground, spindle, point=(0, 0, 0), axis=(0, 0, 1))
    tip, low = (length * np.sin(0.9), 0, -length * np.cos(0.9)), (0, 0, -2 * length * np.cos(0.9))
    arm = m.add_body("arm", mass=ball, inertia=(0, 0, 0), position=tip)
    link = m.add_body("link", mass=0.0, inertia=(0, 0, 0), position=tip)
    sleeve = m.add_body("sleeve", mass=weight, inertia=(0.01, 0.01, 0.01), position=low)
    m.add_revolute("A", spindle, arm, point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("B", arm, link, point=tip, axis=(0, 1, 0))
    m.add_revolute("C", link, sleeve, point=low, axis=(0, 1, 0))
    m.add_prismatic("S", spindle, sleeve, point=low, axis=(0, 0, 1))
    m.add_spring("dashpot", spindle, (0, 0, 0), sleeve, (0, 0, 0), stiffness=0.0, damping=1e3, length=1.0)
    m.add_drive("R", velocity=speed)
    run = m.simulate(60.0, method="radau", t_eval=[0.0, 60.0], rtol=1e-7, atol=1e-9)
    assert run.success, run.message
    height = 9.81 * (ball + 2 * weight) / (ball * speed**2)
    assert run.body("sleeve").position[-1, 2] == pytest.approx(-2 * height, abs=2e-6)
    assert run.counters["steps"] < 3000
