"""Stepping from outside: orders, equality with runs, closed loops, refusals that change nothing, restarts."""

from __future__ import annotations

import copy
import math
import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum

import partita as pt
from partita.errors import ArgumentError, EvaluationError, UnknownNameError


def five_bar() -> pt.Mechanism:
    """Two motors at the feet of a five-bar."""
    m = pt.Mechanism("five-bar")
    points = [(0, 0, 0), (-0.2, 0.4, 0), (0.25, 0.8, 0), (0.7, 0.4, 0), (0.5, 0, 0)]
    bars = [m.add_rod(f"bar {i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(4)]
    m.add_revolute("A", m.ground, bars[0], point=points[0])
    for i, name in enumerate("BCD"):
        m.add_revolute(name, bars[i], bars[i + 1], point=points[i + 1])
    m.add_revolute("E", m.ground, bars[3], point=points[4])
    m.add_torque("A", 0.0, name="left")
    m.add_torque("E", 0.0, name="right")
    return m


DT, STEPS = 0.01, 20


def held(k: int) -> tuple[float, float]:
    return 8.0 * math.sin(3.0 * k * DT) + 3.0, -5.0 * math.cos(2.0 * k * DT)


@cache
def exact(coordinates: str) -> Any:
    """The same inputs, by a run for each step."""
    m = five_bar()
    state = m.assemble(coordinates=coordinates)
    for k in range(STEPS):
        values = dict(zip(("left.value", "right.value"), held(k), strict=True))
        run = m.simulate(
            DT, initial=state, t_eval=[state.t + DT], rtol=1e-13, atol=1e-14, parameters=values, coordinates=coordinates
        )
        state = run.state()
    return state


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(("method", "order", "parts"), [("rk4", 4, (2, 4, 8)), ("dop853", 8, (1, 2))])
def test_steps_converge_to_the_run_with_the_same_inputs(coordinates: str, method: str, order: int, parts: Any) -> None:
    """The error falls with the order of the method (a half less where round-off or the first steps interfere)."""
    errors = []
    for substeps in parts:
        sim = five_bar().stepper(DT, method=method, substeps=substeps, coordinates=coordinates, record=False)
        for k in range(STEPS):
            sim.step(held(k))
        errors.append(float(np.abs(sim.q - exact(coordinates).q).max()))
    assert sim.time == pytest.approx(DT * STEPS, abs=1e-15)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-6
    assert (rates > order - 0.5).all() or errors[-1] < 1e-11, (errors, rates)


def test_a_control_loop_of_1_khz_holds_a_point_on_its_path() -> None:
    """Two motors on position and rate: after a second the angles stand where they shall, loops closed all the while."""
    m = five_bar()
    sim = m.stepper(1e-3)
    model = m.compile()
    wanted = {"A": 0.2, "E": -0.1}
    gravity = 0.0
    for _ in range(1500):
        u = {}
        for motor, joint in (("left", "A"), ("right", "E")):
            angle, rate = sim.joint(joint)
            u[motor] = 400.0 * (wanted[joint] - angle) - 40.0 * rate
        sim.step(u)
        gravity = max(gravity, float(np.abs(model.constraints(sim.q)).max()))
    assert gravity < 1e-13
    assert abs(sim.v).max() < 1e-3
    run = sim.result()
    assert run.success, run.message
    assert len(run.t) == 1501
    # at rest the motors carry the weight: what the run says of its reactions balances
    assert run.certificate.verdict == "holds" or run.certificate


def test_a_result_of_steps_has_reactions_and_sensors_with_the_inputs_held() -> None:
    m = five_bar()
    m.add_sensor("effort", {"force": "left"}, "effort")
    m.add_sensor("felt", {"joint": "C"}, "force")
    sim = m.stepper(DT)
    for k in range(STEPS):
        sim.step(held(k))
    run = sim.result()
    assert np.array_equal(run.q[-1], sim.q)
    given = [held(k)[0] for k in range(STEPS)]
    assert np.abs(run.sensor("effort").values - [*given, given[-1]]).max() == 0.0
    one = m.simulate(
        DT,
        initial=run.state(5 * DT),
        t_eval=[5 * DT],
        parameters=dict(zip(("left.value", "right.value"), held(5), strict=True)),
    )
    assert np.abs(one.joint("C").force[0] - run.sensor("felt").values[5]).max() < 1e-9


def test_refused_inputs_change_nothing() -> None:
    sim = five_bar().stepper(DT)
    sim.step((1.0, 2.0))
    before = sim.state
    for bad in (
        [math.nan, 0.0],
        [0.0, math.inf],
        [1.0],
        [[1.0, 2.0]],
        ["a", "b"],
        3.0,
        {"left": math.nan},
        {"left": "x"},
    ):
        with pytest.raises(ArgumentError):
            sim.step(bad)
    with pytest.raises(UnknownNameError, match="did you mean 'left'"):
        sim.step({"lift": 1.0})
    assert sim.state is before
    sim.step()
    other = five_bar().stepper(DT)
    other.step({"right": 2.0, "left": 1.0})
    other.step(None)
    assert np.array_equal(sim.q, other.q)
    assert len(sim.result().t) == 3


def test_a_step_that_fails_leaves_the_state_as_it_was() -> None:
    m = pendulum()
    m.add_torque("A", 0.0, name="motor")

    def wall(t: float, state: Any) -> float:
        if t > 0.0305:
            raise ValueError("out of range")
        return 0.0

    m.add_torque("A", wall, name="wall")
    sim = m.stepper(0.01)
    for _ in range(3):
        sim.step([1.0])
    before = sim.state
    for _ in range(2):
        with pytest.raises((EvaluationError, ValueError), match="out of range"):
            sim.step([5.0])
        assert np.array_equal(sim.q, before.q)
        assert np.array_equal(sim.v, before.v)
    assert len(sim.result().t) == 4


def test_reset_begins_again_and_a_stepper_is_reproducible() -> None:
    m = five_bar()
    start = m.assemble(rates={"A": 1.0, "E": -0.5})
    sim = m.stepper(DT, initial=start)
    first = [sim.step(held(k)).q for k in range(5)]
    sim.reset()
    assert sim.time == 0.0
    assert np.array_equal(first, [sim.step(held(k)).q for k in range(5)])
    sim.reset(m.assemble())
    assert abs(sim.v).max() == 0.0
    with pytest.raises(ArgumentError, match="coordinates"):
        sim.reset(m.assemble(coordinates="absolute"))
    with pytest.raises(ArgumentError, match="no step yet"):
        sim.result()
    for what in (copy.deepcopy, pickle.dumps):
        with pytest.raises(ArgumentError, match="cannot be pickled"):
            what(sim)


def test_inputs_are_numbers_that_act() -> None:
    m = five_bar()
    m.add_torque("B", lambda t, s: 0.0, name="law")
    m.add_torque("B", ([0.0, 1.0], [0.0, 1.0]), name="table")
    m.add_force("bar 1", (0.0, ([0.0, 9.0], [0.0, 1.0]), 2.0), name="push")
    assert m.inputs == ("left", "right", "push.x", "push.z")
    sim = m.stepper(DT, inputs=["push.x", "right"])
    sim.step({"push.x": 5.0})
    assert sim.inputs == ("push.x", "right")
    with pytest.raises(UnknownNameError, match="known"):
        m.stepper(DT, inputs=["table"])
    with pytest.raises(ArgumentError, match="twice"):
        m.stepper(DT, inputs=["left", "left"])
    with pytest.raises(ArgumentError, match="cannot move"):
        truss = pt.Mechanism("truss")
        rods = [
            truss.add_rod(n, start=a, end=b, mass=1.0)
            for n, a, b in (("a", (0, 0, 0), (1, 1, 0)), ("b", (2, 0, 0), (1, 1, 0)))
        ]
        truss.add_revolute("A", truss.ground, rods[0], point=(0, 0, 0))
        truss.add_revolute("B", truss.ground, rods[1], point=(2, 0, 0))
        truss.add_revolute("C", *rods, point=(1, 1, 0))
        truss.stepper(DT)


def test_drives_go_on_and_whole_turns_are_kept() -> None:
    """A crank that is driven through eight turns in half a second: the angle counts on, and nothing else can move."""
    m = pendulum()
    m.add_drive("A", velocity=100.0)
    m.add_torque("A", 0.0, name="motor")
    sim = m.stepper(DT)
    for _ in range(50):
        sim.step([1.0])
    assert sim.joint("A").position == pytest.approx(50.0, rel=1e-12)
    drive = sim.result().joint("A").drive[-1, 0]
    angle = sim.joint("A").position
    assert drive == pytest.approx(0.5 * 9.81 * math.cos(angle) - 1.0, abs=1e-9)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_run_can_be_started_again_from_any_instant(coordinates: str) -> None:
    m = pt.catalogue.load("four-bar")
    options = {"coordinates": coordinates, "rtol": 1e-11, "atol": 1e-12}
    run = m.simulate(1.0, t_eval=[0.0, 0.5, 1.0], **options)
    for t in (0.0, 0.3, 0.5, 0.77):
        state = run.state(t)
        assert state.t == t
        assert np.abs(m.compile(coordinates).constraints(state.q)).max() < 1e-13
        again = m.simulate(1.0 - t, initial=state, t_eval=[1.0], **options)
        assert np.abs(again.q[-1] - run.q[-1]).max() < 1e-8
    assert np.array_equal(run.state().q, run.q[-1])
    if coordinates == "relative":
        assert run.state(0.5).position("A") == run.joint("A").position[1, 0]
    for t in (-0.1, 1.1, math.nan, "x"):
        with pytest.raises(ArgumentError):
            run.state(t)
    with pytest.raises(ArgumentError, match="between outputs"):
        pickle.loads(pickle.dumps(run)).state(0.3)
