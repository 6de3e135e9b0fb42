"""Time-dependent gravity, and bodies on which it does not act."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from force_mechanisms import TIGHT, G, balanced

import partita as pt


def pendulum(gravity: Any, light: bool = False) -> pt.Mechanism:
    m = pt.Mechanism("pendulum", gravity=gravity)
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=2.0, gravity=not light)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
    return m


@pytest.mark.parametrize("make", [lambda: pendulum(None), lambda: pendulum((0, -G, 0), light=True)])
def test_without_gravity_a_pendulum_turns_evenly(make: Callable[[], pt.Mechanism]) -> None:
    m = make()
    for coordinates in ("relative", "absolute"):
        run = m.simulate(2.0, initial=m.assemble(rates={"A": 1.5}), coordinates=coordinates, **TIGHT)
        np.testing.assert_allclose(run.joint("A").velocity.ravel(), 1.5 + 0 * run.t, rtol=1e-9)
        balanced(run)
        # the joint feels the centripetal force alone
        np.testing.assert_allclose(np.linalg.norm(run.joint("A").force, axis=1), 2.0 * 0.5 * 1.5**2, rtol=1e-9)


def test_gravity_that_is_switched_off_leaves_the_speed_it_has_given() -> None:
    m = pendulum(lambda t, state: (0, -G if t < 0.4 else 0.0, 0))
    run = m.simulate(1.0, rtol=1e-9)
    falling = pendulum((0, -G, 0)).simulate(0.4, rtol=1e-10)
    late = run.t > 0.41
    given = float(falling.joint("A").velocity[-1].item())
    np.testing.assert_allclose(run.joint("A").velocity[late].ravel(), given + 0 * run.t[late], rtol=1e-6)
    assert run.energy.work[-1] == pytest.approx(run.energy.kinetic[-1], rel=1e-6)


def test_gravity_that_does_not_change_may_be_given_as_if_it_did() -> None:
    times = np.linspace(0.0, 2.0, 5)
    plain = pendulum((0, -G, 0)).simulate(1.0, t_eval=[0.0, 1.0], **TIGHT)
    tables = [((0.0, 2.0), (-G, -G)), (times, np.tile([0.0, -G, 0.0], (5, 1)))]
    for gravity in ((0, tables[0], 0), tables[1], lambda t, state: (0, -G, 0)):
        m = pendulum(gravity)
        assert m.gravity == (0.0, 0.0, 0.0)
        run = m.simulate(1.0, t_eval=[0.0, 1.0], **TIGHT)
        np.testing.assert_allclose(run.q, plain.q, atol=1e-9)
        np.testing.assert_allclose(run.joint("A").force, plain.joint("A").force, rtol=1e-8)
        np.testing.assert_allclose(run.energy.work[-1], run.energy.kinetic[-1], rtol=1e-8)
