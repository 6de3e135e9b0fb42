"""Joints with conditions of their own in open parts of mechanisms whose loops are decided block by block."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import partita as pt

HELD: dict[str, tuple[Callable[[pt.Mechanism], object], int]] = {
    "screw": (lambda m: m.add_screw("J", m.ground, "e", point=(0.5, 5, 0), axis=(0, 0, 1), pitch=0.5), 1),
    "custom": (
        lambda m: m.add_custom_joint(
            "J", m.ground, "e", point=(0.5, 5, 0), free=["z"], follows={"rz": lambda z: 2 * np.sin(z), "x": lambda z: z}
        ),
        1,
    ),
    "constant velocity": (lambda m: m.add_constant_velocity("J", m.ground, "e", point=(0.5, 5, 0), axis=(0, 0, 1)), 2),
}
"""How a body is held, and its degrees of freedom."""


def beside(m: pt.Mechanism, held: str) -> None:
    m.add_body("e", mass=1.0, inertia=(1, 1, 1), position=(0, 5, 0), com=(0.1, 0.2, 0.05))
    HELD[held][0](m)


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("off", [0.0, 1e-7, 1e-5])
def test_beside_rockers_drawn_nearly_parallel(off: float, held: str) -> None:
    m = pt.Mechanism("rockers", gravity=(0, -9.81, -1))
    m.add_body("coupler", mass=1.0, inertia=(1, 1, 1), position=(1.3, 1, 0))
    for i in range(3):
        m.add_rod(f"r{i}", start=(i, 0, 0), end=(i + 0.3, 1 + off * i, 0), mass=1.0)
        m.add_revolute(f"A{i}", m.ground, f"r{i}", point=(i, 0, 0), axis=(0, off * i, 1))
        m.add_revolute(f"B{i}", f"r{i}", "coupler", point=(i + 0.3, 1 + off * i, 0))
    beside(m, held)
    assert m.report().to_dict()["mobility"] == 1 + HELD[held][1]
    run = m.simulate(0.3)
    assert run.success, run.message


@pytest.mark.parametrize("held", HELD)
def test_beside_a_drive_and_a_pair_that_is_held_twice(held: str) -> None:
    m = pt.Mechanism("pair", gravity=(0, 0, -9.81))
    for name, x in (("arm", 0.0), ("one", 3.0), ("other", 4.0)):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(x, 0, 0))
    m.add_revolute("A", m.ground, "arm", point=(0, 0, 0))
    m.add_revolute("hinge", "other", "one", point=(3.5, 0, 0))
    m.add_fixed("weld", "one", "other", point=(3.5, 1, 0.4))
    m.add_drive("A", velocity=0.3)
    beside(m, held)
    run = m.simulate(0.3)
    assert run.success, run.message
    assert run.joint("A").position[-1, 0] == pytest.approx(0.09, abs=1e-9)
