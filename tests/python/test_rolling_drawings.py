"""Carts with a wheel's axis off: within the drawing tolerance refused by name, beyond it they go as they are drawn."""

from __future__ import annotations

import numpy as np
import pytest

import partita as pt

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
RADIUS, HALF, LENGTH = 0.3, 0.4, 1.0
SPEED = 4.0


def cart(axles: int, off: float, kind: str = "axis", tolerance: float = 1e-4) -> pt.Mechanism:
    """Wheels in pairs; the axis of the last one off, or all of them toeing in. A single axle is followed by a ball."""
    m = pt.Mechanism("cart", gravity=(0, 0, -9.81), drawing_tolerance=tolerance)
    m.add_body("frame", mass=10.0, inertia=(1.0, 1.5, 2.0), position=(0.4, 0.0, RADIUS))
    for axle in range(axles):
        for side, sign in (("l", -1.0), ("r", 1.0)):
            name, at = f"{side}{axle}", (axle * LENGTH, sign * HALF, RADIUS)
            turned = -sign * off if kind == "toe" else off * (name == f"r{axles - 1}")
            axis = np.array([turned, 1.0, 0.0]) / np.hypot(turned, 1.0)
            m.add_body(f"wheel {name}", mass=1.0, inertia=(0.02, 0.03, 0.02), position=at)
            m.add_revolute(f"hinge {name}", "frame", f"wheel {name}", point=at, axis=axis)
            m.add_rolling(f"road {name}", f"wheel {name}", RADIUS, axis=axis, normal=(0, 0, 1))
    if axles == 1:
        m.add_rolling("ball", "frame", RADIUS, center=(LENGTH - 0.4, 0, 0), ball=True, normal=(0, 0, 1), slips=True)
    return m


@BOTH
@pytest.mark.parametrize("axles", [1, 2])
def test_an_exact_cart_goes_where_its_wheels_turn(axles: int, coordinates: str) -> None:
    m = cart(axles, 0.0)
    assert m.compile(coordinates=coordinates).mobility == 3 - axles
    assert m.report(coordinates=coordinates).to_dict()["mobility"] == 3 - axles
    rates = {f"hinge {side}0": SPEED for side in ("lr" if axles == 1 else "l")}
    run = m.simulate(1.0, initial=m.assemble(coordinates=coordinates, rates=rates), coordinates=coordinates)
    assert run.success and run.certificate.verdict == "holds"
    np.testing.assert_allclose(run.body("frame").position[-1], (0.4 + RADIUS * SPEED, 0.0, RADIUS), atol=1e-8)


@BOTH
@pytest.mark.parametrize("kind", ["axis", "toe"])
@pytest.mark.parametrize("axles", [1, 2])
@pytest.mark.parametrize("off", [1e-5, 5e-5, 1e-4])
def test_within_the_tolerance_it_is_refused_by_name(off: float, axles: int, kind: str, coordinates: str) -> None:
    """As drawn the wheels contradict each other, or the cart turns on the spot: neither may be what is meant."""
    m = cart(axles, off, kind)
    start = m.assemble(coordinates=coordinates)
    for ask in (
        lambda: m.simulate(0.1, initial=start, coordinates=coordinates),
        lambda: m.stepper(0.1, initial=start, coordinates=coordinates),
        lambda: m.report(coordinates=coordinates),
        lambda: m.compile(coordinates=coordinates).mobility,
    ):
        with pytest.raises(pt.errors.PartitaError, match=r'rolling contact "road .*follows.*drawing_tolerance'):
            ask()


@BOTH
@pytest.mark.parametrize(("off", "tolerance"), [(1e-3, 1e-4), (1e-2, 1e-4), (1e-5, 0.0)])
def test_beyond_the_tolerance_a_cart_turns_about_where_its_axes_meet(
    off: float, tolerance: float, coordinates: str
) -> None:
    """The axis of the right wheel meets that of the left one in the right wheel's middle."""
    m = cart(1, off, tolerance=tolerance)
    assert m.compile(coordinates=coordinates).mobility == 1
    start = m.assemble(coordinates=coordinates, rates={"hinge l0": SPEED})
    run = m.simulate(0.5, initial=start, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "holds"
    turned = run.body("frame").rotation[-1] @ run.body("frame").rotation[0].T
    angle = RADIUS * SPEED / (2.0 * HALF) * 0.5
    assert abs(np.arctan2(turned[1, 0], turned[0, 0]) - angle) < 1e-6
