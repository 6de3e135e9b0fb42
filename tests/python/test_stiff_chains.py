"""Implicit steps of chains of many loops, which are solved for without a matrix of all degrees of freedom."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import partita as pt

sys.path.append(str(Path(__file__).parents[2] / "benches"))

from stiff_chains import SHAPES

SIZE, DURATION = 12, 0.004


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_a_chain_moves_as_by_an_explicit_method(shape: str, coordinates: str) -> None:
    m = SHAPES[shape](SIZE)
    expected = m.simulate(DURATION, t_eval=[0.0, DURATION], coordinates=coordinates, rtol=1e-11, atol=1e-13)
    found = m.simulate(
        DURATION, t_eval=[0.0, DURATION], coordinates=coordinates, method="radau", rtol=1e-10, atol=1e-12
    )
    assert found.success and expected.success
    assert found.counters["jacobians"] > 0 and found.counters["differenced_jacobians"] == 0
    assert np.abs(found.q[-1] - expected.q[-1]).max() < 1e-9
    assert np.abs(found.v[-1] - expected.v[-1]).max() < 1e-6 * (1.0 + np.abs(expected.v[-1]).max())


def test_auto_finds_a_chain_stiff_without_a_matrix() -> None:
    # bending of the whole chain is slow, its joints change at up to thousands per second
    m = SHAPES["links"](30)
    kwargs = {"t_eval": [0.0, 0.05], "rtol": 1e-6, "atol": 1e-8}
    auto, radau = (m.simulate(0.05, method=method, **kwargs) for method in ("auto", "radau"))
    assert any("the method changes to radau" in note for note in auto.notes), auto.notes
    assert auto.q[-1] == pytest.approx(radau.q[-1], abs=1e-4)
    assert auto.counters["evaluations"] < m.simulate(0.05, **kwargs).counters["evaluations"] / 3


def test_a_chain_of_100_links_swings_as_the_beam_that_it_stands_for() -> None:
    # cantilever: cosh b cos b = -1; dampers end all other motions, of the swinging they take three parts in a thousand
    size, length, mass, stiffness, b = 100, 2.0, 4.0, 5e4, 1.8751040687
    each = length / size
    m = pt.Mechanism("cantilever", gravity=(0.0, 0.0, 0.0))
    before = m.ground
    for i in range(size):
        link = m.add_rod(f"link {i}", start=(each * i, 0.0, 0.0), end=(each * (i + 1), 0.0, 0.0), mass=mass / size)
        m.add_revolute(f"J{i}", before, link, point=(each * i, 0.0, 0.0))
        m.add_torsion_spring(f"J{i}", stiffness=stiffness, damping=1e-4 * stiffness)
        before = link
    ratio = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))
    x = b * np.arange(size) / size
    bend = np.cosh(x) + np.cos(x) - ratio * (np.sinh(x) + np.sin(x))
    start = m.assemble({f"J{i}": angle for i, angle in enumerate(0.05 * bend / bend.sum())})
    frequency = b**2 / length**2 * math.sqrt(stiffness * each / (mass / length))
    half = math.pi / frequency
    run = m.simulate(half, initial=start, t_eval=[0.0, half / 2.0, half], method="radau", rtol=1e-5, atol=1e-7)
    assert run.success
    tip = run.body(before).position[:, 1]
    assert tip[2] == pytest.approx(-tip[0], rel=0.02)
    assert abs(tip[1]) < 0.02 * abs(tip[0])
    assert run.counters["steps"] < 200
