"""Some of the study's motions that are not smooth at one place; `python -m kinks 2000` looks at as many as you like."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drawings import four_bar
from kinks import POINTS, trial
from scipy.interpolate import CubicSpline

from partita.builder.motion import differences
from partita.errors import EvaluationError


@pytest.mark.parametrize("seed", [*range(24), 116])
def test_jumps_are_refused_by_name_and_time_and_the_others_are_right(seed: int) -> None:
    found = trial(seed)
    assert found.outcome == "right", found.words


@pytest.mark.parametrize("seed", [7, 13, 18, 35, 38, 48, 60, 124])
def test_the_same_holds_for_functions_that_only_python_can_evaluate(seed: int) -> None:
    found = trial(seed, opaque=True)
    assert found.outcome == "right", found.words


@pytest.mark.parametrize(
    ("added", "words"),
    [
        (lambda t: 2e-4 * abs(t - 0.3), "the rate of the drive of A jumps by 0.0004/s at t = 0.3"),
        (lambda t: 1e-5 if t > 0.3 else 0.0, "the drive of A jumps by 1e-5 at t = 0.3"),
        (lambda t: 0.2 if t > 0.3 else 0.0, "the drive of A jumps by 0.2 at t = 0.3"),
    ],
)
def test_a_stepper_refuses_the_tick_in_which_a_drive_jumps(added: Callable[[Any], Any], words: str) -> None:
    m = four_bar(POINTS)
    m.add_drive("A", position=lambda t: 0.5 * t + added(t))
    sim = m.stepper(0.02)
    with pytest.raises(EvaluationError) as caught:
        for _ in range(20):
            sim.step()
    assert words in str(caught.value), caught.value
    assert sim.state.t <= 0.3 + 1e-9


def test_a_kink_of_the_second_derivative_costs_little() -> None:
    """A trapezium of rates, as motion controllers give: the steps end at its corners instead of creeping over them."""
    m = four_bar(POINTS)
    m.add_drive("A", velocity=_trapezium)
    run = m.simulate(1.0, t_eval=[0.0, 1.0])
    assert run.success and run.joint("A").position[-1, 0] == pytest.approx(0.5 * 0.31 + 0.41 + 0.65 * 0.28, abs=1e-8)
    assert run.counters["evaluations"] < 2500


def _trapezium(t: Any) -> Any:
    if t < 0.31:
        return t / 0.31
    return 1.0 + 0.0 * t if t < 0.72 else 1.0 - 0.7 * (t - 0.72) / 0.28


def test_a_smooth_drive_is_not_taken_for_a_jump_however_steep() -> None:
    m = four_bar(POINTS)
    m.add_drive("A", position=lambda t: t + 1e-3 * np.tanh(2e3 * (t - 0.4)))
    run = m.simulate(1.0, t_eval=[0.0, 1.0])
    assert run.success, run.message


def _counted(f: Callable[[float], float], calls: list[int]) -> Callable[[float], float]:
    def counted(t: float) -> float:
        calls.append(1)
        return f(t)

    return counted


def _single(t: float) -> float:
    return float(np.float32(math.sin(3.0 * t)))


BREAKPOINTS = np.linspace(-1.0, 4.0, 26)


@pytest.mark.parametrize(
    "f",
    [
        lambda t: round(math.sin(3.0 * t), 6),
        lambda t: 0.2 + round(math.sin(3.0 * t), 9),
        _single,
        lambda t: math.fabs(t - 0.3),
        lambda t: float(np.interp(t, BREAKPOINTS, np.sin(3.0 * BREAKPOINTS))),
        lambda t: math.sin(t) + (1e-6 if t > 0.3 else 0.0),
    ],
    ids=["six digits", "nine digits", "single precision", "kink", "straight lines", "jump"],
)
def test_rough_functions_are_refused_at_once(f: Callable[[float], float]) -> None:
    m, calls = four_bar(POINTS), list[int]()
    with pytest.raises(EvaluationError, match=r"drive of A.*(cannot be differentiated|jumps by)"):
        m.add_drive("A", position=_counted(f, calls))
        run = m.simulate(1.0)
        assert not run.success
        raise EvaluationError(run.message, t=run.t[-1], where="A")
    assert len(calls) < 100_000


def test_functions_that_only_python_knows_are_differentiated_within_their_noise() -> None:
    """Twelve digits are left: derivatives from the step that fits them. A jump of the second derivative is no kink."""
    for f, second in (
        (lambda t: round(math.sin(3.0 * t), 12), lambda t: -9.0 * math.sin(3.0 * t)),
        (lambda t: math.fabs(t - 0.3) ** 3, lambda t: 6.0 * math.fabs(t - 0.3)),
    ):
        for t in (1e-7, 5e-5, 1e-3, 0.1, 0.29, 0.7):
            assert differences(f, t)[2] == pytest.approx(second(t), abs=1e-6)
    m = four_bar(POINTS)
    m.add_drive("A", position=lambda t: t + math.fabs(t - 0.3) * (t - 0.3))
    assert m.simulate(1.0).success


def test_a_spline_of_scipy_is_taken_as_the_cubics_it_is_made_of() -> None:
    spline = CubicSpline(BREAKPOINTS, np.sin(3.0 * BREAKPOINTS))
    runs = []
    for position in (spline, (BREAKPOINTS, np.sin(3.0 * BREAKPOINTS))):
        m = four_bar(POINTS)
        m.add_drive("A", position=position, interpolation="spline")
        runs.append(m.simulate(1.0, t_eval=[0.0, 0.5, 1.0]))
    for run in runs:
        assert run.success and run.counters["evaluations"] == runs[0].counters["evaluations"] < 1000
        assert np.allclose(run.joint("A").position[:, 0], spline(run.t), atol=1e-12)


def test_a_jump_of_an_acceleration_is_integrated_over() -> None:
    m, calls = four_bar(POINTS), list[int]()
    m.add_drive("A", acceleration=_counted(lambda t: 1.0 if t > 0.3 else 0.0, calls))
    run = m.simulate(1.0, t_eval=[0.0, 1.0])
    assert run.success and run.joint("A").position[-1, 0] == pytest.approx(0.5 * 0.7**2, abs=1e-9)
    assert len(calls) < 100_000
