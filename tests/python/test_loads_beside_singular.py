"""What acts abruptly shortly before or after a position where branches meet: none of it is lost in the step across.

A parallelogram without gravity has a constant inertia in its crank's rate, so this follows from the work of what acts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import partita as pt

CRANK, BASE, DRAWN, RATE = 0.3, 0.7, 1.1, 5.0
INERTIA = 0.2 + 2.0 * CRANK**2
FLAT = np.pi - DRAWN
"""How far the crank turns from where it is drawn until all links lie in line."""
ENOUGH = 1e3
"""Times the tolerance."""


def parallelogram() -> pt.Mechanism:
    m = pt.Mechanism("parallelogram", gravity=None)
    tip, base = CRANK * np.array([np.cos(DRAWN), np.sin(DRAWN), 0.0]), np.array([BASE, 0.0, 0.0])
    for name, mass, at in (("crank", 1.0, np.zeros(3)), ("rocker", 1.0, base), ("coupler", 2.0, tip)):
        m.add_body(name, mass, (0.1, 0.1, 0.1), position=at)
    m.add_revolute("A", m.ground, "crank", (0, 0, 0))
    m.add_revolute("B", "crank", "coupler", tip)
    m.add_revolute("C", "coupler", "rocker", base + tip)
    m.add_revolute("D", m.ground, "rocker", base)
    return m


def ends(m: pt.Mechanism, coordinates: str, rtol: float, t0: float = 0.0) -> tuple[Any, float]:
    start = m.assemble(rates={"A": RATE}, t=t0)
    run = m.simulate(0.8, initial=start, t_eval=[t0, t0 + 0.8], rtol=rtol, atol=rtol / 100.0, coordinates=coordinates)
    return run, float(run.joint("A").velocity[-1, 0])


def pulse(at: float, width: float, top: float, last: float) -> tuple[list[float], list[float]]:
    """A trapezoid: `top` within a width, flanks of half a width."""
    return [-1.0, at - width, at - width / 2, at + width / 2, at + width, last], [0.0, 0.0, top, top, 0.0, 0.0]


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("over", ["time", "angle"])
def test_a_pulse_beside_a_flat_position_does_its_work(coordinates: str, over: str) -> None:
    wrong, refused = [], []
    for beside in (-0.1, -0.02, -0.005, 0.001, 0.01, 0.05, 0.1):
        for width in (0.05, 3e-3, 3e-4):
            m = parallelogram()
            if over == "time":
                top = 0.3 * INERTIA / width
                m.add_torque("A", pulse((FLAT + beside) / RATE, width, top, 9.0))
                right = RATE + 0.45
            else:
                top = 1.0 / width
                m.add_torque("A", pulse(FLAT + beside, width, top, 9.0), over="A")
                right = float(np.sqrt(RATE**2 + 2.0 * 1.5 / INERTIA))
            run, rate = ends(m, coordinates, 1e-7)
            if not run.success:
                refused.append((beside, width, run.message))
            elif abs(rate - right) > ENOUGH * 1e-7 * RATE:
                wrong.append((beside, width, rate - right))
    assert not wrong
    # only so near that no step across leaves it out
    assert all(abs(beside) < 2.0 * width + 0.02 for beside, width, _ in refused), refused
    assert all("acts abruptly" in message or "singular position" in message for _, _, message in refused)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_stop_beside_a_flat_position_sends_it_back(coordinates: str) -> None:
    wrong, refused = [], []
    for beside in (-0.1, -0.03, 0.01, 0.03, 0.1):
        for stiffness in (1e4, 1e7):
            m = parallelogram()
            m.add_stop("A", upper=FLAT + beside, stiffness=stiffness)
            run, rate = ends(m, coordinates, 1e-7)
            if not run.success:
                refused.append((beside, stiffness, run.message))
            elif abs(rate + RATE) > ENOUGH * 1e-7 * RATE:
                wrong.append((beside, stiffness, rate + RATE))
    assert not wrong
    # a soft one lets it turn back at, or next to, the position itself
    assert all(abs(beside) < 0.05 for beside, _, _ in refused), refused


@pytest.mark.parametrize("t0", [0.0, -5.0, 1000.0])
@pytest.mark.parametrize("extent", [0.05, 0.1, 0.15])
def test_times_that_are_rounded_hold_up_no_contact(t0: float, extent: float) -> None:
    """A cart driven by a table past a plane: a step cannot end nearer to a touch than times can say."""
    m = pt.Mechanism("cart", gravity=None)
    m.add_body("cart", 1.0, (0.1, 0.1, 0.1))
    m.add_prismatic("rail", m.ground, "cart", (0, 0, 0), (1, 0, 0))
    times = np.array([0.0, 0.2448, 0.4896, 0.7344, 0.9792, 1.224])
    m.add_drive("rail", position=(t0 + times, [0.0, 0.1989, 0.2111, -0.1795, 0.203, 0.0275]))
    m.add_contact("plane", "cart", (0, 0, 0), m.ground, (-extent, 0, 0), radius1=0.03, normal=(1, 0, 0), stiffness=3e4)
    for rtol in 10.0 ** -np.arange(6.0, 9.6, 0.5):
        run = m.simulate(1.02, initial=m.assemble(t=t0), t_eval=[t0, t0 + 1.02], rtol=rtol, atol=rtol / 100.0)
        assert run.success, (rtol, run.message)
        assert run.counters["steps"] + run.counters["rejected"] < 1000
