"""States inside a run: read from the dense output of its steps, closed, with the bits of outputs at these times."""

from __future__ import annotations

import copy
import pickle
import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import entry_of, run_of
from test_singular_starts import ALONG, stretched

import partita as pt
from partita.errors import ArgumentError
from partita.results import Result

SEED = 20
"""Of the times at which states are asked."""

WITHOUT = ("wehage-haug", "explicit-closing", "tangent-space")
"""Formulations whose runs keep no steps."""


def times_of(run: Result, count: int) -> np.ndarray:
    return np.sort(np.random.default_rng(SEED).uniform(run.t[0], run.t[-1], count))


def rows(states: list[pt.State]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([state.q for state in states]), np.array([state.v for state in states])


def agrees(found: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    return bool((np.abs(found - expected) <= tolerance * (1.0 + np.abs(expected).max(initial=0.0))).all())


def keeps_all(run: Result) -> bool:
    return run.counters["kept_steps"] == run.counters["steps"] > 0


def same_bits(simulate: Any, count: int = 20, **options: Any) -> tuple[Result, Result]:
    """The run with a few outputs, and the same with outputs where its states are read, which must have their bits."""
    run = simulate(**options)
    at = times_of(run, count)
    outputs = simulate(**options, t_eval=at)
    q, v = rows(run.state(at))
    assert (q == outputs.q).all() and (v == outputs.v).all()
    one = run.state(float(at[count // 2]))
    assert (one.q == q[count // 2]).all() and one.t == at[count // 2]
    return run, outputs


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_states_of_the_catalogue_are_closed_and_agree_with_outputs(name: str) -> None:
    run, model = run_of(name), entry_of(name).mechanism().compile()
    at = times_of(run, 8)
    if run.status == "event":
        at = at[:-1]  # the event is its last output besides
    outputs = entry_of(name).simulate(t_eval=at)
    states = run.state(at)
    # an output may make a new plan, and the steps after it other rounding errors
    q, v = rows(states)
    here = slice(len(at))
    assert agrees(q, outputs.q[here], 1e-10) and agrees(v, outputs.v[here], 1e-9)
    for state, closure in zip(states, outputs.closure[here], strict=True):
        if len(state.q) != len(model.names):
            break  # a joint may part, so that its coordinates are others
        gap = model.constraints(state.q, t=state.t)
        turned = gap - 2.0 * np.pi * np.round(gap / (2.0 * np.pi))  # some couple whole turns
        gap = np.where(np.abs(gap) > 1.0, turned, gap)
        assert np.abs(gap).max(initial=0.0) <= 2.0 * closure + 1e-13
    # its own outputs are read with their last digits from its own steps
    log = outputs.record.arrays.log
    assert log is not None
    t, q, v = log.states(at)
    first = outputs.record.arrays.log.span()[0]
    inside = at > first  # before is the step out of a singular start
    assert (t[inside] == at[inside]).all() and inside.any()
    assert agrees(q[inside], outputs.q[here][inside], 1e-14) and agrees(v[inside], outputs.v[here][inside], 1e-13)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "tsit5", "bs23", "adams"])
def test_every_method_reads_its_own_dense_output(method: str) -> None:
    run, _ = same_bits(lambda **given: pt.catalogue.load("four-bar").simulate(2.0, method=method, **given))
    assert keeps_all(run)


@pytest.mark.parametrize("method", ["dop853", "rk4", "adams"])
def test_fixed_steps(method: str) -> None:
    run, _ = same_bits(lambda **given: pt.catalogue.load("four-bar").simulate(2.0, method=method, step=0.01, **given))
    assert keeps_all(run)


@pytest.mark.parametrize(
    "options",
    [
        {"solver": pt.Solver("svd")},
        {"solver": pt.Solver("svd", renew="each step")},
        {"solver": pt.Solver("liang-lance")},
        {"solver": pt.Solver("multipliers")},
        {"solver": pt.Solver("range-space")},
        {"correction": "kantorovich"},
        {"correction": "mass-orthogonal"},
        {"correction": "none"},
        {"coordinates": "absolute"},
        {"compiled": True},
        {"compiled": False},
    ],
    ids=str,
)
def test_formulations_and_coordinates(options: dict[str, Any]) -> None:
    run, _ = same_bits(lambda **given: pt.catalogue.load("four-bar").simulate(1.5, **options, **given))
    assert keeps_all(run)


@pytest.mark.parametrize("formulation", WITHOUT)
def test_formulations_that_solve_for_coordinates_are_integrated_between_outputs(formulation: str) -> None:
    m = pt.catalogue.load("four-bar")
    run = m.simulate(1.0, solver=pt.Solver(formulation))
    assert run.counters["kept_steps"] == run.counters["kept_step_bytes"] == 0
    assert agrees(run.state(0.3337).q, m.simulate(1.0, t_eval=[0.3337]).q[0], 1e-6)


def test_changes_of_coordinates_whole_turns_and_singular_positions() -> None:
    fast = pt.catalogue.load("four-bar")
    start = fast.assemble({"A": 0.3}, rates={"A": 60.0})
    run, _ = same_bits(lambda **given: fast.simulate(1.5, initial=start, **given), 60)
    assert abs(run.state(1.49).position("A")) > 60.0  # whole turns are there
    spatial, _ = same_bits(lambda **given: pt.catalogue.load("rssr").simulate(4.0, **given), 60)
    for found in (run, spatial, run_of("parallelogram")):
        # at a change the choice before serves, and both are the same (q, v)
        changes = [change.t for change in found.partitions if found.t[0] < change.t < found.t[-1]][:20]
        for t in changes:
            here, before, after = found.state(t), found.state(np.nextafter(t, 0.0)), found.state(np.nextafter(t, 9e9))
            assert agrees(before.q, here.q, 1e-12) and agrees(after.q, here.q, 1e-12)
            assert agrees(before.v, here.v, 1e-7) and agrees(after.v, here.v, 1e-7)


def test_singular_positions_are_read_from_both_sides_and_singular_starts_integrated() -> None:
    m = stretched()
    start = m.assemble(rates=ALONG)
    run = m.simulate(8.0, initial=start, t_eval=[0.0, 8.0])
    assert any("were crossed" in note for note in run.notes) and keeps_all(run) is False
    assert run.counters["steps"] == run.counters["kept_steps"] + 1  # the step out of the start
    zeros = np.arange(1, 6) * np.pi / 2.0
    beside = [zeros + apart for apart in (-1e-2, -1e-6, -1e-9, 0.0, 1e-12, 1e-9, 1e-4)]
    at = np.sort(np.concatenate([[1e-3, 0.1], times_of(run, 30), *beside]))
    outputs = m.simulate(8.0, initial=start, t_eval=at)
    q, v = rows(run.state(at))
    assert agrees(q, outputs.q, 1e-9) and agrees(v, outputs.v, 1e-8)
    assert np.abs(q[:, 0] - 2.0 * at).max() < 1e-6 and np.abs(v[:, 0] - 2.0).max() < 1e-6


def swing() -> pt.Mechanism:
    m = pt.Mechanism("swing", gravity="-y")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def test_drives_tables_and_stops() -> None:
    driven = swing()
    driven.add_drive("motor", "A", position=pt.table(np.sin, 0.0, 3.0))
    same_bits(lambda **given: driven.simulate(2.0, **given))
    stopped = swing()
    stopped.add_stop("stop", "A", lower=-2.0, stiffness=1e5, damping=10.0)
    same_bits(lambda **given: stopped.simulate(3.0, **given), 60)


def test_functions_of_the_user_are_called_when_a_state_is_read_and_not_before() -> None:
    calls: list[float] = []

    def torque(t: float, state: Any) -> float:
        calls.append(t)
        return float(np.sin(t))

    m = swing()
    m.add_torque("motor", "A", torque)
    run = m.simulate(1.0, t_eval=[0.0, 1.0])
    with pt.limits.raised(step_bytes=1):
        before = len(calls)
        m.simulate(1.0, t_eval=[0.0, 1.0])
        alone = len(calls) - before
    before = len(calls)
    m.simulate(1.0, t_eval=[0.0, 1.0])
    assert len(calls) - before == alone  # no evaluation is spent on steps that nobody reads
    before = len(calls)
    run.state(0.5)
    first = len(calls) - before
    assert first > 0
    run.state(0.5)
    assert len(calls) - before - first < first  # the slopes of dense output are kept


def test_a_system_given_by_functions_has_states_between_outputs() -> None:
    pendulum = pt.System(
        n=2,
        mass=np.eye(2),
        forces=(0.0, -9.81),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
        names=["x", "y"],
    )

    def simulate(**given: Any) -> Result:
        return pt.simulate(pendulum, 1.0, q0=[1.0, 0.0], v0=[0.0, 0.0], **given)

    run, _ = same_bits(simulate)
    assert run.state(0.3).names == ["x", "y"] and abs(np.hypot(*run.state(0.3).q) - 1.0) < 1e-15


@pytest.mark.parametrize("t", [0.0, 0.5, 1.0])
def test_a_time_of_an_output_is_that_output(t: float) -> None:
    run = pt.catalogue.load("four-bar").simulate(1.0, t_eval=[0.0, 0.5, 1.0])
    state, i = run.state(t), int(2 * t)
    assert (state.q == run.q[i]).all() and (state.v == run.v[i]).all()
    state.q[:] = 7.0
    assert (run.q != 7.0).all() and (run.state(t).q == run.q[i]).all()


def test_the_whole_run_is_known_whatever_the_outputs() -> None:
    m = pt.catalogue.load("four-bar")
    run, all_of_it = m.simulate(1.0, t_eval=[0.4, 0.5]), m.simulate(1.0, t_eval=[0.0, 0.2, 0.45, 0.7, 1.0])
    q, v = rows(run.state(all_of_it.t))
    assert (q == all_of_it.q).all() and (v == all_of_it.v).all()
    assert run.state().t == 0.5


@pytest.mark.parametrize("t", [-0.1, 1.0 + 1e-9, [0.5, 1.1], np.array([-1.0])])
def test_times_outside_are_refused(t: Any) -> None:
    run = pt.catalogue.load("four-bar").simulate(1.0)
    with pytest.raises(ArgumentError, match="outside the run, from 0 to 1 s"):
        run.state(t)


@pytest.mark.parametrize("t", ["now", [0.1, "now"], [[0.1, 0.2]], [np.nan], [0.1, np.inf], None])
def test_what_is_no_time_is_refused(t: Any) -> None:
    run = pt.catalogue.load("four-bar").simulate(1.0)
    if t is None:
        assert run.state(t).t == 1.0
        return
    with pytest.raises(ArgumentError):
        run.state(t)


def test_arrays_have_their_own_order() -> None:
    run = pt.catalogue.load("four-bar").simulate(1.0, t_eval=[0.0, 0.25, 1.0])
    asked = [0.9, 0.1, 0.25, 0.9, 0.0]
    states = run.state(asked)
    assert [state.t for state in states] == asked
    assert all((state.q == run.state(t).q).all() for state, t in zip(states, asked, strict=True))
    assert run.state([]) == run.state(np.zeros(0)) == []


def test_steps_take_no_more_than_they_may_and_a_note_says_so() -> None:
    m = pt.catalogue.load("four-bar")
    free = m.simulate(4.0, t_eval=[0.0, 4.0])
    taken = free.counters["kept_step_bytes"]
    assert keeps_all(free) and not [note for note in free.notes if "step_bytes" in note]
    at = times_of(free, 40)
    expected, _ = rows(free.state(at))
    for part in (2, 5, 40):
        with pt.limits.raised(step_bytes=taken // part):
            run = m.simulate(4.0, t_eval=[0.0, 4.0])
        kept, steps = run.counters["kept_steps"], run.counters["steps"]
        assert 0 < run.counters["kept_step_bytes"] <= taken // part
        assert steps // (4 * part) <= kept < steps
        (note,) = (note for note in run.notes if "step_bytes" in note)
        (every,) = (int(number) for number in re.findall(r"one in (\d+) is kept", note))
        assert kept == -(-steps // every) and every == 2 ** round(np.log2(every))
        q, _ = rows(run.state(at))
        # what is kept is read, what is not is integrated from there
        assert kept / steps - 0.2 < (q == expected).all(axis=1).mean() < kept / steps + 0.2
        assert agrees(q, expected, 1e-6)
        assert all(np.abs(m.compile().constraints(x, t=t)).max() < 1e-13 for x, t in zip(q, at, strict=True))
    with pt.limits.raised(step_bytes=1):
        run = m.simulate(4.0, t_eval=[0.0, 4.0])
    assert run.counters["kept_steps"] == run.counters["kept_step_bytes"] == 0
    assert [note for note in run.notes if "none is kept" in note]
    assert agrees(run.state(2.0).q, free.state(2.0).q, 1e-6)


def test_a_run_that_ended_early_is_known_up_to_there() -> None:
    m = pt.catalogue.load("four-bar")
    run = m.simulate(5.0, max_steps=30, t_eval=[0.0, 5.0])
    assert not run.success and len(run.t) == 1
    whole = m.simulate(5.0, t_eval=[0.0, 0.3, 5.0])
    assert (run.state(0.3).q == whole.q[1]).all()
    with pytest.raises(ArgumentError, match="outside the run"):
        run.state(4.9)


def test_copies_share_the_steps_and_files_have_none(tmp_path: Path) -> None:
    run = pt.catalogue.load("four-bar").simulate(1.0, t_eval=[0.0, 0.5, 1.0])
    q = run.state(0.3).q
    for other in (copy.copy(run), copy.deepcopy(run)):
        assert (other.state(0.3).q == q).all()
    run.save(tmp_path / "run.json")
    for other in (pickle.loads(pickle.dumps(run)), pt.load_result(tmp_path / "run.json")):
        assert (other.state(0.5).q == run.q[1]).all()
        with pytest.raises(ArgumentError, match="between outputs"):
            other.state(0.3)


def test_threads_read_the_same_run() -> None:
    run = pt.catalogue.load("four-bar").simulate(2.0)
    at = times_of(run, 200)
    expected, _ = rows(run.state(at))
    found: dict[int, np.ndarray] = {}

    def read(number: int) -> None:
        found[number] = rows([run.state(float(t)) for t in at] if number % 2 else run.state(at))[0]

    threads = [threading.Thread(target=read, args=(i,)) for i in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((q == expected).all() for q in found.values()) and len(found) == 6


def test_a_stepper_keeps_no_steps() -> None:
    sim = pt.catalogue.load("four-bar").stepper(1e-2)
    for _ in range(20):
        sim.step()
    result = sim.result()
    assert result.counters["kept_steps"] == 0
    assert agrees(result.state(0.105).q, pt.catalogue.load("four-bar").simulate(0.2, t_eval=[0.105]).q[0], 1e-4)
