"""Tolerances below the rounding of stiff forces: as many evaluations as there is to gain, and a note."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawings import bushing_wishbone, four_bar

# At 0.002 s and 0.05 s, by Runge-Kutta steps in 128 bits: x, y and turn of the upright, and its upward velocity.
RIGHT = {
    0.002: (0.780010229813706693, 0.330119330981853652, 1.00233871581544450e-4, 0.118004317300928334),
    0.05: (0.780074760634483876, 0.343113079933190537, 6.30895153768029018e-3, -0.166438376634331259),
}


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("method", ["dop853", "tsit5"])
@pytest.mark.parametrize(("begin", "rtol"), [(0.0, 1e-12), (0.0, 1e-13), (-3.0, 1e-12)])
def test_steps_are_as_exact_as_they_can_be_and_no_shorter(
    begin: float, rtol: float, method: str, coordinates: str
) -> None:
    m = bushing_wishbone()
    start = m.assemble(t=begin, coordinates=coordinates)
    times = begin + np.array([0.0, *RIGHT])
    run = m.simulate(
        0.05, initial=start, t_eval=times, rtol=rtol, atol=rtol / 100, method=method, coordinates=coordinates
    )
    assert run.success
    assert run.counters["evaluations"] < 40_000 and run.counters["by_rounding"] > 0
    assert any("below the rounding of the accelerations" in note for note in run.notes)
    upright = run.body("upright")
    for i, right in enumerate(RIGHT.values(), 1):
        at, turned = upright.position[i], upright.rotation[i]
        found = (at[0], at[1], math.atan2(turned[1, 0], turned[0, 0]), upright.velocity[i, 1])
        assert found[:3] == pytest.approx(right[:3], abs=1e-14 if begin == 0.0 else 1e-12)
        assert found[3] == pytest.approx(right[3], abs=1e-12)


@pytest.mark.parametrize("stiff", [True, False])
def test_tolerances_that_can_be_met_are_met_without_it(stiff: bool) -> None:
    m, rtol = (bushing_wishbone(), 1e-8) if stiff else (four_bar(((0, 0), (0.4, 0.1), (1.2, 0.8), (1.1, 0))), 1e-12)
    run = m.simulate(0.05 if stiff else 1.0, rtol=rtol, atol=rtol / 100)
    assert run.success and run.counters["by_rounding"] == 0
    assert not any("rounding of the accelerations" in note for note in run.notes)
