"""A function of the user that fails during a run ends it with what was computed, the time and the cause."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import EvaluationError

LATE = 0.5


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def late(good: Any, bad: Callable[[], Any]) -> Callable[..., Any]:
    """`good` up to the time `LATE`, then what `bad` makes."""
    return lambda t, *state: (good(t, *state) if callable(good) else good) if t < LATE else bad()


def mistake() -> Any:
    raise ZeroDivisionError("my own mistake")


NONSENSE: dict[str, Callable[[], Any]] = {
    "raises": mistake,
    "None": lambda: None,
    "NaN": lambda: math.nan,
    "infinite": lambda: math.inf,
    "text": lambda: "fast",
    "complex": lambda: 1.0 + 2.0j,
    "a wrong shape": lambda: np.zeros((2, 3)),
    "bool": lambda: True,
    "an object": object,
    "an empty list": lambda: [],
}


def with_torque(bad: Callable[[], Any]) -> Any:
    m = pendulum()
    m.add_torque("A", value=late(0.1, bad), name="motor")
    return lambda **more: m.simulate(1.0, **more)


def with_force(bad: Callable[[], Any]) -> Any:
    m = pendulum()
    m.add_force("rod", force=late((0.1, 0.0, 0.0), bad), name="wind")
    return lambda **more: m.simulate(1.0, **more)


def with_drive(bad: Callable[[], Any]) -> Any:
    m = pendulum()
    m.add_drive("A", position=late(lambda t: 0.1 * np.sin(t), bad), name="crank")
    return lambda **more: m.simulate(1.0, **more)


def with_system(which: str) -> Callable[[Callable[[], Any]], Any]:
    functions: dict[str, Callable[..., Any]] = {
        "mass": lambda t, q: np.eye(2),
        "forces": lambda t, q, v: [0.0, -9.81],
        "constraints": lambda t, q: [0.5 * (q @ q - 1.0)],
        "jacobian": lambda t, q: [q],
        "constraint_rate": lambda t, q: [0.0],
        "bias": lambda t, q, v: [v @ v],
    }

    def make(bad: Callable[[], Any]) -> Any:
        s = pt.System(2, **{**functions, which: late(functions[which], bad)})
        return lambda **more: pt.simulate(s, 1.0, [1.0, 0.0], [0.0, 0.0], **more)

    return make


CALLERS: dict[str, tuple[str, Callable[[Callable[[], Any]], Any]]] = {
    "torque": ("motor", with_torque),
    "force": ("wind", with_force),
    "drive": ("crank", with_drive),
    **{
        name: (name, with_system(name))
        for name in ("mass", "forces", "constraints", "jacobian", "constraint_rate", "bias")
    },
}


@pytest.mark.parametrize("caller", CALLERS)
@pytest.mark.parametrize("kind", NONSENSE)
def test_what_was_computed_is_kept(caller: str, kind: str) -> None:
    name, make = CALLERS[caller]
    run = make(NONSENSE[kind])(t_eval=np.linspace(0.0, 1.0, 101))
    assert not run.success and run.status == "evaluation-failed"
    assert 0.0 <= run.t[-1] < LATE and len(run.t) > 1 and np.isfinite(run.q).all()
    assert name in run.message and "t = " in run.message
    assert isinstance(run.error, EvaluationError) and run.error.t == pytest.approx(run.t[-1], abs=LATE)
    assert name in run.error.where
    cause = run.error.__cause__
    if kind == "raises":
        assert isinstance(cause, ZeroDivisionError) and "my own mistake" in run.message
    else:
        assert isinstance(cause, EvaluationError) and name in str(cause)
    assert np.isfinite(run.vdot).all() and repr(run).startswith("<Result") and str(run.certificate)


def test_a_failed_run_is_stored_and_pickled_with_its_message(tmp_path: Path) -> None:
    run = with_torque(mistake)(t_eval=np.linspace(0.0, 1.0, 101))
    for other in (pickle.loads(pickle.dumps(run)), pt.results.load_result(run.save(tmp_path / "run.json"))):
        assert other.message == run.message and not other.success and np.array_equal(other.t, run.t)


def test_progress_that_fails_ends_the_run() -> None:
    def progress(fraction: float) -> None:
        raise RuntimeError("no more")

    run = pt.catalogue.load("four-bar").simulate(2e5, t_eval=np.linspace(0.0, 2e5, 501), progress=progress)
    assert not run.success and run.status == "interrupted" and 0.0 < len(run.t) < 501
    assert "progress" in run.message and isinstance(run.error.__cause__, RuntimeError)


def test_a_failure_at_the_very_start_is_raised_as_it_is() -> None:
    m = pendulum()
    m.add_torque("A", value=lambda t, state: mistake())
    with pytest.raises(ZeroDivisionError, match="my own mistake"):
        m.simulate(1.0)


def test_a_function_that_fails_ever_after_leaves_a_result_that_can_be_looked_at() -> None:
    calls = [0]

    def torque(t: float, state: Any) -> float:
        calls[0] += 1
        return mistake() if calls[0] > 200 else 0.0

    m = pendulum()
    m.add_torque("A", value=torque)
    run = m.simulate(5.0)
    assert not run.success and "my own mistake" in run.message and len(run.t) > 1
    assert "not known" in repr(run) and any("cannot be computed" in note for note in run.notes)
    assert np.isfinite(run.body("rod").position).all()


def test_what_ends_the_program_is_not_kept_back() -> None:
    def torque(t: float, state: Any) -> float:
        if t > LATE:
            raise SystemExit(3)
        return 0.0

    m = pendulum()
    m.add_torque("A", value=torque)
    with pytest.raises(SystemExit):
        m.simulate(1.0)


TWO_LEVERS: dict[str, Callable[[pt.Mechanism, Any], Any]] = {
    "a cam": lambda m, f: m.add_cam("A", "B", f),
    "a drive": lambda m, f: m.add_drive("A", f),
    "a rate": lambda m, f: m.add_drive("A", velocity=f),
    "a condition": lambda m, f: m.add_constraint("C", f, of=["A"]),
    "a torque": lambda m, f: m.add_torque("A", f),
    "a force": lambda m, f: m.add_force("one", f),
    "a law": lambda m, f: m.add_force_law("L", f, sees=["one"], on=["one"]),
    "a sensor": lambda m, f: m.add_sensor("S", [m.add_sensor("angle", "A", "position")], function=f),
    "a joint of one's own": lambda m, f: m.add_custom_joint(
        "J", m.ground, m.add_body("more", mass=1.0, inertia=(1, 1, 1)), point=(0, 0, 0), free=["rz"], follows={"x": f}
    ),
}


def two_levers() -> pt.Mechanism:
    m = pt.Mechanism("two levers")
    for name, body, x in (("A", "one", 0.0), ("B", "other", 2.0)):
        m.add_rod(body, start=(x, 0, 0), end=(x + 1.0, 0, 0), mass=1.0)
        m.add_revolute(name, m.ground, body, point=(x, 0, 0))
    return m


@pytest.mark.parametrize("what", TWO_LEVERS)
@pytest.mark.parametrize("function", [lambda: 1.0, lambda a, b, c, d, e: 1.0], ids=["no argument", "five arguments"])
def test_a_function_of_other_arguments_is_refused_at_the_door(what: str, function: Any) -> None:
    with pytest.raises(pt.errors.DescriptionError, match="which it does not take"):
        TWO_LEVERS[what](two_levers(), function)


@pytest.mark.parametrize("mistaken", [lambda x: x + "a", lambda x: mistake(), len, lambda x: x.angle, lambda x: {}[x]])
def test_a_cam_that_fails_where_it_is_asked_first_is_named(mistaken: Any) -> None:
    for asked in ("assemble", "report"):
        m = two_levers()
        m.add_cam("B", "A", mistaken, name="lift")
        with pytest.raises(EvaluationError, match='"lift" at t = 0 s: the function fails there'):
            getattr(m, asked)()
    with pytest.raises(EvaluationError, match='drive "turn": the function fails'):
        two_levers().add_drive("A", mistaken, name="turn")


def test_what_is_no_pose_is_reported_without_inner_names() -> None:
    m = pt.Mechanism("disc")
    disc = m.add_body("disc", mass=1.0, inertia=(1, 1, 1))
    with pytest.raises(EvaluationError) as caught:
        m.add_drive(disc, pose=lambda t: ((0, 0, t), np.zeros(5)))
    assert type(caught.value) is EvaluationError
    m.add_drive(disc, pose=lambda t: ((0, 0, t), (0, 0, t) if t < 0.5 else np.zeros(5)))
    run = m.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 11))
    assert not run.success and "_" not in run.message.replace("0_", "")
    assert type(run.error.__cause__) is EvaluationError
