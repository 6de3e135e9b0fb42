"""A drive that requires more than the joints allow ends the run: which joint, where it ends, what length is missing."""

import re

import numpy as np
import pytest

import partita as pt

A, B, C, D = (0, 0, 0), (0.5, 0.3, 0), (0.8, 0.6, 0), (1.2, 0, 0)


def rocker_driven_on(scale: float = 1.0, level: str = "position") -> pt.Mechanism:
    """A four-bar none of whose links can turn fully, its left link driven round by its position or its velocity."""
    a, b, c, d = (scale * np.array(p, dtype=float) for p in (A, B, C, D))
    m = pt.Mechanism("double rocker", gravity=(0, 0, 0))
    left, top, right = (
        m.add_rod(name, start=p, end=q, mass=1.0) for name, p, q in (("left", a, b), ("top", b, c), ("right", d, c))
    )
    m.add_revolute("A", m.ground, left, point=a, axis=(0, 0, 1))
    m.add_revolute("B", left, top, point=b, axis=(0, 0, 1))
    m.add_revolute("C", top, right, point=c, axis=(0, 0, 1))
    m.add_revolute("D", m.ground, right, point=d, axis=(0, 0, 1))
    if level == "position":
        m.add_drive("A", position=lambda t: -1.0 * t)
    else:
        m.add_drive("A", velocity=lambda t: -1.0)
    return m


def limit() -> float:
    """By how much the left link can turn back: then the two others lie in one line (law of cosines)."""
    l1, l2, l3, l4 = np.hypot(0.5, 0.3), np.hypot(0.3, 0.3), np.hypot(0.4, 0.6), 1.2
    at_a = np.arccos((l1**2 + l4**2 - (l2 + l3) ** 2) / (2 * l1 * l4))
    return float(np.arctan2(0.3, 0.5) + at_a)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("level", ["position", "velocity"])
def test_a_crank_driven_too_far(coordinates: str, scale: float, level: str) -> None:
    run = rocker_driven_on(scale, level).simulate(10.0, coordinates=coordinates)
    assert not run.success and run.status == "singular"
    assert "a drive exceeds what the joints allow" in run.message
    where = re.search(r"A ends at (\S+) rad; at the target, the loop .* keeps a closure error of (\S+) m", run.message)
    assert where is not None, run.message
    assert abs(-float(where[1]) - limit()) < 1e-5  # six decimals are printed
    assert 0.0 < float(where[2]) < scale
    assert np.all(run.t <= limit() + 1e-9) and run.t[-1] > limit() - 0.06  # outputs lie 0.05 s apart


def test_a_slider_driven_beyond_its_rod() -> None:
    m = pt.Mechanism("slider-crank", gravity=(0, 0, 0))
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0.0, 0.1, 0), mass=1.0)
    rod = m.add_rod("rod", start=(0.0, 0.1, 0), end=(0.3, 0, 0), mass=1.0)
    piston = m.add_body("piston", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=(0.3, 0, 0))
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("B", crank, rod, point=(0, 0.1, 0), axis=(0, 0, 1))
    m.add_revolute("C", rod, piston, point=(0.3, 0, 0), axis=(0, 0, 1))
    m.add_prismatic("S", m.ground, piston, point=(0.3, 0, 0), axis=(1, 0, 0))
    m.add_drive("S", position=lambda t: 0.1 * t)
    run = m.simulate(2.0)
    assert not run.success
    where = re.search(r"S ends at (\S+) m;", run.message)
    assert where is not None, run.message
    stretched = 0.1 + np.hypot(0.1, 0.3) - 0.3  # crank and rod in one line
    assert abs(float(where[1]) - stretched) < 1e-5


def test_a_stop_that_no_drive_explains_keeps_its_words() -> None:
    m = rocker_driven_on()
    run = m.simulate(1.0, max_steps=3)
    assert run.status == "max-steps" and "a drive exceeds" not in run.message
