"""Where a run starts: closed, at any time, from numbers that are rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError
from partita.results import Result

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
BOTH = ["relative", "absolute"]


def opened(s: pt.State, by: float, seed: int) -> pt.State:
    """The state with coordinates off by up to `by`; quaternions stay of length one to rounding."""
    rng = np.random.default_rng(seed)
    q = s.q + by * rng.uniform(-1.0, 1.0, s.q.size)
    return pt.State(s.t, q, s.v, s.names, s.velocity_names)


def again(r: Result, s: pt.State, i: int = 0) -> pt.State:
    return pt.State(float(r.t[i]), r.q[i], r.v[i], s.names, s.velocity_names)


# ---------------------------------------------------------------- off the constraints


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "macpherson"])
@pytest.mark.parametrize(("by", "t0"), [(1e-7, 0.0), (1e-4, 0.7), (3e-3, 0.0)])
def test_a_start_off_its_closure_is_where_the_run_starts(name: str, coordinates: str, by: float, t0: float) -> None:
    """The run goes on from the state that it reports as corrected: it is the run of that state."""
    m = pt.catalogue.load(name)
    s = m.assemble(coordinates=coordinates, t=t0)
    start = opened(s, by * (0.1 if name == "macpherson" else 1.0), 3)
    for outputs in ([t0, t0 + 0.2], np.linspace(t0, t0 + 0.2, 12)):
        run = m.simulate(0.2, initial=start, t_eval=outputs, coordinates=coordinates, **TIGHT)
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings
        assert any("the run starts from the corrected state" in note for note in run.notes)
        other = m.simulate(0.2, initial=again(run, s), t_eval=outputs, coordinates=coordinates, **TIGHT)
        assert not any("corrected state" in note for note in other.notes)
        assert np.abs(run.q - other.q).max() < 1e-11 and np.abs(run.v - other.v).max() < 1e-9


@pytest.mark.parametrize("formulation", ["wehage-haug", "svd", "tangent-space", "multipliers"])
def test_every_formulation_starts_closed(formulation: str) -> None:
    m = pt.catalogue.load("four-bar")
    s = m.assemble()
    run = m.simulate(0.2, initial=opened(s, 1e-4, 5), solver=pt.Solver(formulation), **TIGHT)
    other = m.simulate(0.2, initial=again(run, s), solver=pt.Solver(formulation), **TIGHT)
    assert run.success and np.abs(run.q - other.q).max() < 1e-10


def test_a_rate_off_its_constraint_is_where_the_run_starts() -> None:
    m = pt.catalogue.load("four-bar")
    s = m.assemble()
    start = pt.State(0.0, s.q, s.v + 1e-3 * np.arange(1, s.v.size + 1), s.names, s.velocity_names)
    run = m.simulate(0.3, initial=start, **TIGHT)
    other = m.simulate(0.3, initial=again(run, s), **TIGHT)
    assert run.success and np.abs(run.q - other.q).max() < 1e-12
    assert any("velocities by up to" in note for note in run.notes)


def test_steppers_and_ensembles_start_closed_too() -> None:
    m = pt.catalogue.load("four-bar")
    s = m.assemble()
    start = opened(s, 1e-4, 7)
    sim = m.stepper(1e-3, initial=start)
    closed = pt.State(0.0, sim.q, sim.v, s.names, s.velocity_names)
    assert np.abs(m.compile().constraints(sim.q)).max() < 1e-12
    ticks = [sim.step().q for _ in range(20)]
    assert any("corrected state" in note for note in sim.result().notes)
    other = m.stepper(1e-3, initial=closed)
    assert np.abs(np.array(ticks) - [other.step().q for _ in range(20)]).max() < 1e-12
    other.reset(start)
    assert np.abs(np.array(ticks) - [other.step().q for _ in range(20)]).max() < 1e-12
    many = m.ensemble(states=[start, closed] * 40, t_eval=[0.0, 0.2])
    assert set(many.status) == {"finished"}
    assert np.abs(many.q[0::2] - many.q[1::2]).max() < 1e-9


def test_a_formulation_that_corrects_no_positions_keeps_them() -> None:
    m = pt.catalogue.load("four-bar")
    s = m.assemble()
    start = opened(s, 1e-7, 1)
    run = m.simulate(0.1, initial=start, correction="none")
    assert np.array_equal(run.q[0], start.q)
    assert any("positions kept" in note for note in run.notes)


# ---------------------------------------------------------------- first steps


@pytest.mark.parametrize("t0", [0.0, 0.3, -2.0, 1e3])
@pytest.mark.parametrize("noise", [1e-17, 1e-16, 1e-13, 1e-10])
def test_a_start_at_rest_whose_coordinates_are_rounding(t0: float, noise: float) -> None:
    """It runs like the exact one, at any time, in as many steps."""
    for name, rtol, seed in (("four-bar", 1e-10, 1), ("four-bar", 1e-8, 2), ("slider-crank", 1e-12, 3)):
        m = pt.catalogue.load(name)
        s = m.assemble(t=t0)
        options = {"rtol": rtol, "atol": 1e-2 * rtol, "t_eval": [t0, t0 + 0.3]}
        exact = m.simulate(0.3, initial=pt.State(t0, s.q, 0 * s.v, s.names, s.velocity_names), **options)
        q = s.q + noise * np.random.default_rng(seed).normal(size=s.q.size)
        run = m.simulate(0.3, initial=pt.State(t0, q, 0 * s.v, s.names, s.velocity_names), **options)
        assert run.success, run.message
        assert np.abs(run.q[-1] - exact.q[-1]).max() < 1e3 * max(noise, rtol)
        assert run.counters["steps"] < exact.counters["steps"] + 15


# ---------------------------------------------------------------- far from t = 0


def pendulum(torque: bool = False) -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0), axis=(0, 1, 0))
    if torque:
        m.add_torque("A", lambda t, s: math.cos(t))
    return m


@pytest.mark.parametrize("method", ["dop853", "tsit5", "adams"])
@pytest.mark.parametrize("coordinates", BOTH)
def test_motions_do_not_depend_on_the_time_at_which_they_start(method: str, coordinates: str) -> None:
    """Steps end at times as rounded, and are as long as these are apart."""
    m = pendulum()
    s = m.assemble(coordinates=coordinates)
    options = {"coordinates": coordinates, "method": method, **TIGHT}
    for t0 in (-1e6, 1e6, 1e9, 1e11):
        start = pt.State(t0, s.q, s.v, s.names, s.velocity_names)
        try:
            run = m.simulate(2.0, initial=start, t_eval=[t0, t0 + 2.0], **options)
        except ArgumentError:
            raise AssertionError(f"{t0:g}") from None
        span = float(run.t[-1] - run.t[0])  # exact
        near = m.simulate(span, initial=s, t_eval=[0.0, span], **options)
        if t0 < 1e10:
            assert run.success, run.message
        if run.success:
            assert np.abs(run.q[-1] - near.q[-1]).max() < 1e-8, t0
        else:
            assert "times so far from 0" in run.message


def test_loads_see_the_time_itself() -> None:
    m = pendulum(torque=True)
    s = m.assemble()
    turns = 2.0 * math.pi * round(1e6 / (2.0 * math.pi))
    near = m.simulate(2.0, initial=s, t_eval=[0.0, 2.0], **TIGHT)
    far = m.simulate(2.0, initial=pt.State(turns, s.q, s.v, s.names, s.velocity_names), t_eval=[turns + 2.0], **TIGHT)
    assert far.success and np.abs(far.q[-1] - near.q[-1]).max() < 3e-8


def test_ticks_and_ensembles_far_from_zero() -> None:
    m = pendulum()
    s = m.assemble()
    near = m.stepper(2.0**-8, initial=s)
    far = m.stepper(2.0**-8, initial=pt.State(2.0**30, s.q, s.v, s.names, s.velocity_names))
    for _ in range(64):
        assert np.abs(near.step().q - far.step().q).max() < 1e-12
    # t_eval is exact there, so that both spans are
    for t0 in (2.0**20, 2.0**33, 2.0**43):
        state = pt.State(t0, s.q, s.v, s.names, s.velocity_names)
        many = m.ensemble(states=[state] * 70, t_eval=[t0 + 0.5, t0 + 1.0])
        exact = m.simulate(1.0, initial=s, t_eval=[0.5, 1.0])
        for status, q in zip(many.status, many.q, strict=True):
            assert (status == "finished" and np.abs(q - exact.q).max() < 1e-6) or status == "step-too-small"


def test_a_run_that_its_times_cannot_resolve_is_refused() -> None:
    m = pendulum()
    s = m.assemble()
    for t0 in (1e15, 1e16, -1e17):
        state = pt.State(t0, s.q, s.v, s.names, s.velocity_names)
        with pytest.raises(ArgumentError, match="nearer to t = 0"):
            m.simulate(0.1, initial=state)
        with pytest.raises(ArgumentError, match="nearer to t = 0"):
            m.stepper(1e-3, initial=state)
        with pytest.raises(ArgumentError, match="nearer to t = 0"):
            pt.simulate(oscillator(), 0.1, q0=[1.0], v0=[0.0], t0=t0)


def oscillator() -> pt.System:
    return pt.System(1, np.eye(1), lambda t, q, v: -q)
