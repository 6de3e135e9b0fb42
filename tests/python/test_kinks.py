"""Some of the study's motions that are not smooth at one place; `python -m kinks 2000` looks at as many as you like."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drawings import four_bar
from kinks import POINTS, trial

from partita.errors import EvaluationError


@pytest.mark.parametrize("seed", range(24))
def test_jumps_are_refused_by_name_and_time_and_the_others_are_right(seed: int) -> None:
    found = trial(seed)
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
