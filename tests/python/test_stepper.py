"""Stepping from outside: orders, equality with runs, closed loops, refusals that change nothing, restarts."""

from __future__ import annotations

import copy
import math
import os
import pickle
from functools import cache
from threading import Thread
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum
from drawings import four_bar

import partita as pt
from partita.errors import ArgumentError, EvaluationError, SingularityError, UnknownNameError


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
    assert run.certificate.verdict == "valid" or run.certificate


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


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_constant_loads_act_until_they_are_changed(coordinates: str) -> None:
    m = five_bar()
    m.forces["left"].value, m.forces["right"].value = 3.0, -2.0
    m.add_force("bar 1", (1.0, lambda t, state: 2.0, 0.0), name="push")
    start = m.assemble(coordinates=coordinates)
    for parameters in (None, {"left.value": 5.0}):
        run = m.simulate(0.2, initial=start, coordinates=coordinates, rtol=1e-11, parameters=parameters)
        sim = m.stepper(1e-2, initial=start, coordinates=coordinates, parameters=parameters, substeps=10)
        for _ in range(20):
            sim.step()
        assert np.abs(sim.state.q - run.state().q).max() < 1e-9
        sim.reset()
        for _ in range(20):
            sim.step({"push.x": 1.0})
        assert np.abs(sim.state.q - run.state().q).max() < 1e-9


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
    with pytest.raises(ArgumentError, match="no step has been taken yet"):
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


# ---------------------------------------------------------------- drives as inputs


def driven(level: str) -> pt.Mechanism:
    m = pt.catalogue.load("four-bar")
    m.add_drive("A", **{level: 0.0}, name="crank")
    m.add_sensor("angle", "A", "position")
    m.add_sensor("rate", "A", "velocity")
    m.add_sensor("growth", "A", "acceleration")
    m.add_sensor("effort", "A", "drive")
    m.add_sensor("tip", ("coupler", ("100 mm", 0, 0)), "position")
    m.add_sensor("borne", "D", "force")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("level", ["position", "velocity", "acceleration"])
def test_a_drive_moves_without_a_jump_as_commanded(level: str, coordinates: str) -> None:
    """Positions are met, rates too, with what lies between them in closed form; and the effort is that of a run whose
    drive is the table of what was given."""
    m = driven(level)
    assert m.inputs == ("crank",) and m.stepper(DT).inputs == ()
    sim = m.stepper(DT, inputs=[m.drives["crank"]], coordinates=coordinates, substeps=4)
    x, rate = sim.sensor("angle"), 0.0
    reported = [0.3 * math.sin(0.4 * k) for k in range(1, STEPS + 1)]
    for u in reported:
        if level == "position":
            growth = (u - x) / DT
            x, jump, rate = u, growth - rate, growth
            last = -2.0 * jump / DT  # (4 - 6) jump / h at the end of the cubic
        else:
            last = (u - rate) / DT if level == "velocity" else u
            x += (rate + 0.5 * last * DT) * DT
            rate += last * DT
        sim.step({"crank": u})
        assert sim.sensor("angle") == pytest.approx(x, abs=1e-10)  # a rate alone is integrated
        assert sim.sensor("rate") == pytest.approx(rate, abs=1e-12)
    assert sim.sensor("growth") == pytest.approx(last, rel=1e-9)
    run = sim.result()
    assert run.success, run.message
    for name in ("tip", "effort", "borne", "growth"):  # at the last output that of the step that led there
        assert np.abs(run.sensor(name).values[-1] - sim.sensor(name)).max() < 1e-12 * max(1.0, abs(last))
    # an independent way to the effort: the model without the drive, its torque added to the forces
    free = pt.catalogue.load("four-bar")
    free.add_torque("A", run.sensor("effort").values[-1], name="motor")
    state = free.assemble({"A": x}, rates={"A": rate})
    bare = free.simulate(1e-3, initial=state, t_eval=[0.0])
    assert bare.joint("A").acceleration[0, 0] == pytest.approx(last, rel=1e-6, abs=1e-6)


def test_a_drive_of_a_measure_is_an_input_and_reset_begins_again() -> None:
    """A rope pulls a pendulum up at a rate; its length is the integral of that input."""
    m = pendulum()
    m.add_drive(pt.Distance("ground", (0, 2, 0), "rod", (1, 0, 0)), velocity=0.0, name="rope")
    m.add_torque("A", 0.0, name="rope")  # another kind of thing by the same name
    m.add_sensor("length", pt.Distance("ground", (0, 2, 0), "rod", (1, 0, 0)), "position")
    assert m.inputs == ("rope", "drive rope")
    sim = m.stepper(DT, inputs=[m.drives["rope"]])
    first = sim.sensor("length")
    assert first == pytest.approx(math.sqrt(5.0), abs=1e-14)
    states = [sim.step([-0.5]).q for _ in range(20)]
    assert sim.sensor("length") == pytest.approx(first - 0.5 * 19.5 * DT, abs=1e-9)
    sim.reset()
    assert sim.sensor("length") == first
    assert np.array_equal(states, [sim.step([-0.5]).q for _ in range(20)])


# ---------------------------------------------------------------- positions that cannot be passed or reached


def parallelogram(driven: bool) -> pt.Mechanism:
    m = pt.Mechanism("parallelogram", gravity=(0, 0, 0))
    points = [(0, 0, 0), (0, 1, 0), (2, 1, 0), (2, 0, 0)]
    bars = [m.add_rod(name, start=points[i], end=points[i + 1], mass=1.0) for i, name in enumerate("abc")]
    for name, parent, child, point in zip(
        "ABCD", (m.ground, *bars[:2], m.ground), (*bars, bars[2]), points, strict=True
    ):
        m.add_revolute(name, parent, child, point=point)
    if driven:
        m.add_drive("A", velocity=1.0, name="crank")
    m.add_sensor("borne", "C", "force")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("is_driven", [False, True])
def test_change_points_are_stepped_over_or_refused(coordinates: str, is_driven: bool) -> None:
    """Steps near a change point stay on their branch, where both cranks are parallel; one that ends in it is refused,
    and the state before it is kept."""
    m = parallelogram(is_driven)
    start = m.assemble(rates=None if is_driven else {"A": 1.0}, coordinates=coordinates)
    given = list(m.inputs)
    sim = m.stepper(0.1, initial=start, coordinates=coordinates, inputs=given, record=False)
    for _ in range(50):  # over two change points
        sim.step()
    assert sim.joint("A").position == pytest.approx(5.0, abs=1e-4)
    assert sim.joint("D").position == pytest.approx(sim.joint("A").position, abs=1e-9)
    sim = m.stepper(math.pi / 20, initial=start, coordinates=coordinates, inputs=given)
    for _ in range(9):
        sim.step()
    before = sim.state
    for _ in range(2):
        with pytest.raises(SingularityError, match=r"singular position.*substeps"):
            sim.step()
        assert np.array_equal(sim.q, before.q) and np.array_equal(sim.v, before.v) and sim.time == before.t
    assert sim.result().success
    other = m.stepper(0.1, initial=sim.state, coordinates=coordinates, inputs=given)  # the words of the error
    for _ in range(10):
        other.step()
    assert other.joint("D").position == pytest.approx(other.joint("A").position, abs=1e-7)


def test_a_start_in_a_change_point_is_refused() -> None:
    m = parallelogram(False)
    stretched = m.assemble({"A": -math.pi / 2})
    with pytest.raises(SingularityError, match="2 branches meet"):
        m.stepper(0.1, initial=stretched)
    sim = m.stepper(0.1)
    with pytest.raises(SingularityError):
        sim.reset(stretched)
    assert abs(sim.q).max() < 1e-15


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("level", ["position", "velocity"])
def test_a_drive_past_the_reach_of_the_links_is_refused(level: str, coordinates: str) -> None:
    """The rocker turns until the other two links are in line: at 4 + 1 + 4 cos = (a + b)^2, and no further."""
    m = pt.Mechanism("rocker")
    points = [(0, 0, 0), (0.5, 1, 0), (2, 1, 0), (2, 0, 0)]
    bars = [m.add_rod(name, start=points[i], end=points[i + 1], mass=1.0) for i, name in enumerate("abc")]
    for name, parent, child, point in zip(
        "ABCD", (m.ground, *bars[:2], m.ground), (*bars, bars[2]), points, strict=True
    ):
        m.add_revolute(name, parent, child, point=point)
    m.add_drive("D", **{level: 0.0}, name="push")
    limit = 1.5 * math.pi - math.acos(((math.hypot(0.5, 1.0) + 1.5) ** 2 - 5.0) / 4.0)
    dt = 0.05
    sim = m.stepper(dt, inputs=["push"], coordinates=coordinates)
    u = 1.0
    with pytest.raises(SingularityError, match="the step fails at t"):
        for k in range(100):
            before = sim.state
            sim.step([dt * (k + 1) if level == "position" else u])
    assert limit - 2 * dt < sim.joint("D").position < limit
    assert np.array_equal(sim.q, before.q)


# ---------------------------------------------------------------- many degrees of freedom, large and small


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_sensors_at_all_scales(size: float) -> None:
    """A pendulum of size L under gravity g L: the same motion, lengths times L and forces of mass one times L."""
    m = pt.Mechanism("pendulum", gravity=(0, -9.81 * size, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(size, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_torque("A", 0.0, name="motor")
    tip = m.add_sensor("tip", (rod, (size, 0, 0)), "acceleration")
    m.add_sensor("held", "A", "force")
    m.add_sensor("g", tip.norm() / (9.81 * size))
    sim = m.stepper(1e-3)
    assert sim.sensor("g") == pytest.approx(1.5, rel=1e-12)
    assert np.abs(sim.sensor("held") - [0.0, 0.25 * 9.81 * size, 0.0]).max() < 1e-12 * size
    sim.step([0.5 * 9.81 * size**2])  # carries the weight: it stays
    assert sim.sensor("g") < 1e-9 and abs(sim.q).max() < 1e-12


def test_sensors_of_a_chain_of_a_hundred_dof() -> None:
    """What the stepper reads at its start is what a run says there, to round-off of a hundred links."""
    m = pt.Mechanism("chain")
    parent: Any = m.ground
    for i in range(100):
        rod = m.add_rod(f"rod {i}", start=(i, 0, 0), end=(i + 1, 0, 0), mass=1.0)
        m.add_revolute(f"J{i}", parent, rod, point=(i, 0, 0))
        parent = rod
    m.add_torque("J0", 0.0, name="motor")
    m.add_sensor("tip", (parent, (1, 0, 0)), "acceleration")
    m.add_sensor("speed", (parent, (1, 0, 0)), "velocity")
    m.add_sensor("held", "J0", "force")
    m.add_sensor("last", "J99", "position")
    sim = m.stepper(1e-3, record=False)
    run = m.simulate(1e-3, t_eval=[0.0, 1e-3], rtol=1e-11, atol=1e-12)
    for i in (0, 1):
        for name in m.sensors:
            size = max(1.0, np.abs(run.sensor(name).values).max())
            assert np.abs(sim.sensor(name) - run.sensor(name).values[i]).max() < 1e-8 * size, (i, name)
        sim.step()
    with pytest.raises(UnknownNameError, match="did you mean 'tip'"):
        sim.sensor("tipp")


def test_ticks_begin_in_a_singular_position_as_runs_do() -> None:
    """Four bars in line: the rates say along which branch, the first tick leaves as a run does."""
    m = four_bar([(0.0, 0.0), (0.5, 0.0), (1.5, 0.0), (1.0, 0.0)], 0.0, [1.0, 1.0, 1.0])
    start = m.assemble(rates={"A": 2.0, "B": -2.0})
    run = m.simulate(0.2, initial=start, t_eval=[0.0, 0.2], rtol=1e-10)
    sim = m.stepper(0.01, initial=start, substeps=8)
    for _ in range(2):
        for _ in range(20):
            sim.step()
        assert np.abs(sim.state.q - run.q[-1]).max() < 1e-10
        assert sim.result().success and any("along the branch" in note for note in sim.result().notes)
        sim.reset()


def test_threads_share_a_stepper_one_step_after_the_other() -> None:
    """400 steps of four threads end where 400 steps of one do."""
    alone, shared = (five_bar().stepper(DT) for _ in range(2))
    for _ in range(400):
        alone.step()

    def steps() -> None:
        for _ in range(100):
            shared.step()

    threads = [Thread(target=steps) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert np.array_equal(shared.state.q, alone.state.q) and shared.state.t == alone.state.t


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_goes_on_with_a_stepper_of_its_own() -> None:
    """The child's next step is the parent's, and moves nothing of the parent's."""
    sim = five_bar().stepper(DT)
    sim.step()
    before = sim.state.q.tobytes()
    end, child = os.pipe()
    if os.fork() == 0:
        try:
            sim.step()
            os.write(child, sim.state.q.tobytes())
        finally:
            os._exit(0)
    os.close(child)
    with os.fdopen(end, "rb") as answer:
        there = answer.read()
    os.wait()
    assert sim.state.q.tobytes() == before
    sim.step()
    assert sim.state.q.tobytes() == there


def test_a_function_may_not_step_the_stepper_that_calls_it() -> None:
    """It would wait for itself; afterwards the stepper goes on from where it stood."""
    m, steppers = five_bar(), []

    def torque(t: float, state: Any) -> float:
        for sim in steppers:
            sim.step()
        return 0.0

    m.add_torque("C", torque)
    sim = m.stepper(DT)
    sim.step()
    stood = sim.state.q
    steppers.append(sim)
    with pytest.raises(ArgumentError, match="a function of the model steps the stepper"):
        sim.step()
    steppers.clear()
    assert np.array_equal(sim.state.q, stood)
    sim.step()
    assert sim.state.t == pytest.approx(2 * DT)


@pytest.mark.parametrize("sees", [False, True])
def test_an_input_beside_a_function_of_a_joint_that_closes_a_loop(sees: bool) -> None:
    """Inputs need no coordinates but those of the tree; a function beside them reads all, as in a run."""
    m = pt.catalogue.load("four-bar")
    (cut,) = (joint["name"] for joint in m.compile().summary["joints"] if not joint["tree"])
    if sees:
        m.add_torque("A", lambda t, state: -3.0 * state.position(cut) - 0.2 * state.velocity(cut), name="spring")
    motor = m.add_torque("A", 0.7, name="motor")
    start = pt.catalogue.entry("four-bar").initial(m)
    sim = m.stepper(0.01, inputs=[motor], initial=start, substeps=4)
    for _ in range(20):
        now = sim.step([0.7])
    run = m.simulate(0.2, t_eval=[0.2], initial=start, method="rk4", step=0.0025)
    assert np.allclose(now.q, run.q[-1], rtol=0, atol=1e-12) and np.allclose(now.v, run.v[-1], rtol=0, atol=1e-11)
    assert np.allclose(sim.result().energy.kinetic[-1], run.energy.kinetic[-1], rtol=1e-9)


def commanded(level: str, coordinates: str) -> tuple[pt.Mechanism, list[str], Any]:
    """A four-bar whose crank is an input that reverses, beside a torque on its rocker."""
    m = pt.catalogue.load("four-bar")
    m.add_torque("D", 0.5, name="load")
    m.add_drive("A", **{level: 0.0}, name="crank")
    return m, ["crank", "load"], m.assemble(coordinates=coordinates)


def spun(_level: str, coordinates: str) -> tuple[pt.Mechanism, list[str], Any]:
    """A four-bar that turns under an alternating torque, so that its coordinates change."""
    m = pt.catalogue.load("four-bar")
    m.add_torque("A", 0.0, name="motor")
    return m, ["motor"], m.assemble(rates={"A": 9.0}, coordinates=coordinates)


def two_motors(_level: str, coordinates: str) -> tuple[pt.Mechanism, list[str], Any]:
    m = five_bar()
    return m, ["left", "right"], m.assemble(coordinates=coordinates)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(
    ("drawn", "level"),
    [(spun, ""), (two_motors, ""), (commanded, "position"), (commanded, "velocity"), (commanded, "acceleration")],
)
def test_machine_code_makes_the_same_steps(drawn: Any, level: str, coordinates: str) -> None:
    """To the bit, whenever a thread beside has made it, after resets and through new coordinates too."""
    m, inputs, start = drawn(level, coordinates)
    steppers = {
        compiled: m.stepper(2e-3, inputs=inputs, initial=start, coordinates=coordinates, compiled=compiled)
        for compiled in (False, True, "auto")
    }
    for turn in range(2):
        for k in range(700):
            u = [0.3 * math.sin(0.02 * k * (i + 1)) for i in range(len(inputs))]
            states = [sim.step(u) for sim in steppers.values()]
            for state in states[1:]:
                assert np.array_equal(state.q, states[0].q) and np.array_equal(state.v, states[0].v), (turn, k)
        runs = {compiled: sim.result() for compiled, sim in steppers.items()}
        assert all(run.success for run in runs.values())
        used = {compiled: run.counters["compiled_evaluations"] for compiled, run in runs.items()}
        assert used[False] == 0 and used[True] > 700
        for sim in steppers.values():
            sim.reset(start)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_stepper_that_is_reset_repeats_every_bit(coordinates: str) -> None:
    """As one that is made there: neither choices of coordinates nor their scales of the motion before remain."""
    m = five_bar()

    def go(sim: Any, steps: int) -> Any:
        for _ in range(steps):
            a, e = sim.joint("A"), sim.joint("E")
            sim.step([400 * (0.2 - a.position) - 40 * a.velocity, 400 * (-0.1 - e.position) - 40 * e.velocity])
        return sim.q.copy()

    sim = m.stepper(1e-3, coordinates=coordinates)
    once = go(sim, 150)
    later = sim.state
    go(sim, 40)
    sim.reset()
    assert np.array_equal(go(sim, 150), once)
    assert sim.result().counters["steps"] == 150 and len(sim.result().t) == 151
    sim.reset(later)  # at another time, and elsewhere
    fresh = m.stepper(1e-3, coordinates=coordinates, initial=later)
    assert np.array_equal(go(sim, 60), go(fresh, 60))


def bell(dt: float) -> Any:
    """A rod that falls onto a stop, with a torque from a table over its angle."""
    m = pt.Mechanism("bell")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_stop("A", lower=-0.02, stiffness=1e5, name="rest")
    m.add_torque("A", ([-4.0, -0.005, 4.0], [0.3, 0.3, 0.6]), over="A", name="spring")
    return m.stepper(dt)


def test_a_stop_beside_a_table_is_followed_from_the_first_tick() -> None:
    one, many = bell(0.05), bell(0.0005)
    one.step()
    for _ in range(100):
        many.step()
    assert abs(one.state.q[0] - many.state.q[0]) < 1e-5


def test_a_tick_that_leaves_a_table_names_it() -> None:
    """A step too long for the stop throws the rod out of the table."""
    s = bell(0.15)
    before = s.state.q.copy()
    with pytest.raises(ArgumentError, match=r"spring: its curve is evaluated at .*, outside \[-4, 4\]"):
        s.step()
    assert np.array_equal(s.state.q, before)
