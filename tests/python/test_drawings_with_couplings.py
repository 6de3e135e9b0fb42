"""Couplings that nearly follow from other conditions: wheels with an axis off, bars nearly equal, rings of gears.

Within the drawing tolerance they are refused by name, beyond it they are what is drawn.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
RADIUS, HALF, LENGTH = 0.3, 0.4, 1.0
SPEED = 4.0
Array = NDArray[np.float64]


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
    assert run.success and run.certificate.verdict == "valid"
    np.testing.assert_allclose(run.body("frame").position[-1], (0.4 + RADIUS * SPEED, 0.0, RADIUS), atol=1e-8)


@BOTH
@pytest.mark.parametrize("kind", ["axis", "toe"])
@pytest.mark.parametrize("axles", [1, 2])
@pytest.mark.parametrize("off", [1e-5, 5e-5, 1e-4])
def test_within_the_tolerance_it_is_refused_by_name(off: float, axles: int, kind: str, coordinates: str) -> None:
    """As drawn the wheels contradict each other, or the cart turns on the spot: neither may be intended."""
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
    assert run.success and run.certificate.verdict == "valid"
    turned = run.body("frame").rotation[-1] @ run.body("frame").rotation[0].T
    angle = RADIUS * SPEED / (2.0 * HALF) * 0.5
    assert abs(np.arctan2(turned[1, 0], turned[0, 0]) - angle) < 1e-6


def bars(off: float, tolerance: float = 1e-4) -> pt.Mechanism:
    """A plate on two equal cranks, and on a bar that is longer than they by a part of its length."""
    m = pt.Mechanism("bars", gravity=(0, -9.81, 0), drawing_tolerance=tolerance)
    arm = np.array([0.3, 0.6, 0.0])
    feet = [np.array(p) for p in ((0.0, 0.0, 0.0), (1.0, 0.1, 0.0), (2.2, -0.2, 0.0))]
    m.add_body("plate", mass=2.0, inertia=(0.2, 0.2, 0.4), position=feet[1] + arm)
    for i in (0, 1):
        m.add_rod(f"crank {i}", start=feet[i], end=feet[i] + arm, mass=1.0)
        m.add_revolute(f"A{i}", m.ground, f"crank {i}", point=feet[i])
        m.add_revolute(f"B{i}", f"crank {i}", "plate", point=feet[i] + arm)
    m.add_distance("bar", m.ground, feet[2], "plate", feet[2] - feet[1], length=float(np.hypot(0.3, 0.6)) * (1.0 + off))
    return m


def gears(off: float, tolerance: float = 1e-4) -> pt.Mechanism:
    """A ring of three gear pairs, the last ratio off by a part of itself."""
    m = pt.Mechanism("gears", gravity=(0, -9.81, 0), drawing_tolerance=tolerance)
    for i in range(3):
        m.add_body(f"wheel {i}", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(i, 0.1, 0))
        m.add_revolute(f"A{i}", m.ground, f"wheel {i}", point=(i, 0, 0))
    for first, second, ratio in (("A0", "A1", -2.0), ("A1", "A2", -1.5), ("A0", "A2", 3.0 * (1.0 + off))):
        m.add_gear(first, second, ratio=ratio)
    return m


@BOTH
@pytest.mark.parametrize("make", [bars, gears])
def test_couplings_that_fit_turn_as_they_are_driven(make: Callable[..., pt.Mechanism], coordinates: str) -> None:
    m = make(0.0)
    assert m.compile(coordinates=coordinates).mobility == 1
    start = m.assemble(coordinates=coordinates, rates={"A0": SPEED})
    run = m.simulate(0.2, initial=start, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid"
    assert run.joint("A0").velocity[0, 0] == pytest.approx(SPEED, abs=1e-12)


@BOTH
@pytest.mark.parametrize(("make", "owner"), [(bars, 'distance "bar"'), (gears, 'gear "gear A')])
@pytest.mark.parametrize("off", [1e-7, 1e-5, 5e-5])
def test_couplings_that_nearly_fit_are_refused_by_name(
    make: Callable[..., pt.Mechanism], owner: str, off: float, coordinates: str
) -> None:
    """As drawn they hold a structure, which a drawing off by so little is not intended to be."""
    m = make(off)
    for ask in (lambda: m.simulate(0.1, coordinates=coordinates), lambda: m.report(coordinates=coordinates)):
        with pytest.raises(pt.errors.PartitaError, match=f"{owner}.*follows.*drawing_tolerance"):
            ask()


@BOTH
@pytest.mark.parametrize(("off", "tolerance"), [(1e-2, 1e-4), (1e-4, 0.0)])
@pytest.mark.parametrize("make", [bars, gears])
def test_couplings_that_do_not_fit_hold_a_structure(
    make: Callable[..., pt.Mechanism], off: float, tolerance: float, coordinates: str
) -> None:
    m = make(off, tolerance)
    assert m.compile(coordinates=coordinates).mobility == 0
    assert m.report(coordinates=coordinates).to_dict()["mobility"] == 0


def four_bar(tilt: float, kind: str, count: int = 1) -> pt.Mechanism:
    """A four-bar whose axes are out of parallel by `tilt`, on a lift, with a ball on its coupler that touches the floor
    or hangs on a rod; side by side with others, balls joined by rods."""
    m = pt.Mechanism("four-bar", gravity=(0, 0, -9.81))
    for k in range(count):
        add_four_bar(m, tilt, kind, f" {k}" if k else "", np.array([0.0, float(k), 0.0]))
        if k:
            m.add_distance(
                f"to {k}", f"ball {k - 1}" if k > 1 else "ball", (0.05, 0, 0.02), f"ball {k}", (0, 0.03, -0.04)
            )
    return m


def add_four_bar(m: pt.Mechanism, tilt: float, kind: str, more: str, at: Array) -> None:
    off = tilt * np.array([[0.3, 0, -1.0], [-0.8, 0, 0.5], [1.0, 0, 0.2], [-0.2, 0, 0.9]])
    tilts = dict(zip("ABCD", off, strict=True))

    def point(*x: float) -> Array:
        return at + np.array(x)

    frame, a, b, c, ball = bodies = [name + more for name in ("frame", "a", "b", "c", "ball")]
    for name, x in zip(bodies, ((0, 0, 0.5), (0, 0, 0.6), (0.3, 0, 0.4), (0.5, 0, 0.6), (0.3, 0, 0.2)), strict=True):
        m.add_body(name, mass=1.0 + (name == frame), inertia=(0.05, 0.05, 0.05), position=at + np.array(x))
    m.add_prismatic("lift" + more, m.ground, frame, point=point(0, 0, 0.5), axis=(0, 0, 1))
    for name, one, other, x in (
        ("A", frame, a, (0, 0, 0.7)),
        ("B", a, b, (0.1, 0, 0.45)),
        ("C", b, c, (0.55, 0, 0.4)),
        ("D", frame, c, (0.5, 0, 0.7)),
    ):
        m.add_revolute(name + more, one, other, point=point(*x), axis=np.array([0.0, 1.0, 0.0]) + tilts[name])
    m.add_spherical("E" + more, b, ball, point=point(0.3, 0, 0.2))
    if kind == "rod":
        m.add_distance("rod" + more, m.ground, point(0.7, 0.3, 0.1), ball, (0.05, 0, 0))
    else:
        m.add_rolling("floor" + more, ball, 0.2, ball=True, normal=(0, 0, 1), slips=kind == "slides")


@BOTH
@pytest.mark.parametrize(("kind", "mobility"), [("rolls", 2), ("slides", 4), ("rod", 4)])
@pytest.mark.parametrize("tilt", [1e-9, 1e-7, 1e-6, 1e-5, 5e-5])
def test_a_misdrawn_loop_moves_beside_a_coupling(tilt: float, kind: str, mobility: int, coordinates: str) -> None:
    """The axes were intended to be parallel, whatever else holds its bars."""
    exact, m = (four_bar(x, kind) for x in (0.0, tilt))
    assert m.compile(coordinates=coordinates).mobility == exact.compile(coordinates=coordinates).mobility == mobility
    runs = [x.simulate(0.2, coordinates=coordinates) for x in (exact, m)]
    assert all(run.success and run.certificate.verdict == "valid" for run in runs)
    angles = [run.joint("A").position[-1, 0] for run in runs]
    assert abs(angles[0]) > 0.005 and abs(angles[1] - angles[0]) < 1e-8 + tilt


@BOTH
def test_many_misdrawn_loops_that_couplings_join(coordinates: str) -> None:
    """More joints in one block than changes are sought for: its loops of joints are small."""
    exact, m = (four_bar(x, "slides", 9) for x in (0.0, 1e-6))
    assert m.compile(coordinates=coordinates).mobility == 9 * 4 - 8
    runs = [x.simulate(0.05, t_eval=[0.0, 0.02, 0.05], coordinates=coordinates) for x in (exact, m)]
    assert all(run.success and run.certificate.verdict == "valid" for run in runs)
    assert abs(runs[0].joint("A 4").position[-1, 0] - runs[1].joint("A 4").position[-1, 0]) < 1e-6


@BOTH
def test_a_loop_with_axes_beyond_the_tolerance_is_locked_beside_a_coupling(coordinates: str) -> None:
    """The axes lock the bars, and the ball alone moves."""
    assert four_bar(1e-2, "slides").compile(coordinates=coordinates).mobility == 3


@BOTH
@pytest.mark.parametrize("tilt", [1e-8, 1e-6, 3e-5])
@pytest.mark.parametrize("off", [0.0, 1e-5])
def test_bars_on_axes_out_of_parallel(off: float, tilt: float, coordinates: str) -> None:
    """Joints are repaired, a bar that does not fit is not."""
    m = bars(off)
    for k, joint in enumerate(m.joints.values()):
        joint.axis = np.array([tilt * (-1) ** k, tilt * (k - 1.5), 1.0])
    if off:
        with pytest.raises(pt.errors.PartitaError, match="bar"):
            m.simulate(0.1, coordinates=coordinates)
        return
    start = m.assemble(coordinates=coordinates, rates={"A0": SPEED})
    run = m.simulate(0.2, initial=start, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid" and abs(run.joint("A0").position[-1, 0]) > 0.5


def steered(angles: tuple[float, float, float]) -> pt.Mechanism:
    """A frame on three wheels that are steered freely: their axes meet in a point, or the frame rests."""
    m = pt.Mechanism("steered", gravity=(0, 0, -9.81))
    m.add_body("frame", mass=10.0, inertia=(1, 1, 1), position=(0, 0, 0.5))
    m.add_planar("floor", m.ground, "frame", point=(0, 0, 0.5), normal=(0, 0, 1))
    for i, (at, angle) in enumerate(zip([(1, 0.3), (0, -0.5), (-1, 0.4)], angles, strict=True)):
        axle, middle = (-np.sin(angle), np.cos(angle), 0.0), (*at, 0.2)
        m.add_body(f"fork {i}", mass=1.0, inertia=(0.01, 0.01, 0.01), position=(*at, 0.4))
        m.add_body(f"wheel {i}", mass=1.0, inertia=(0.01, 0.02, 0.01), position=middle)
        m.add_revolute(f"steer {i}", "frame", f"fork {i}", point=middle, axis=(0, 0, 1))
        m.add_revolute(f"axle {i}", f"fork {i}", f"wheel {i}", point=middle, axis=axle)
        m.add_rolling(f"road {i}", f"wheel {i}", 0.2, axis=axle, normal=(0, 0, 1))
    return m


@BOTH
def test_wheels_that_follow_from_each_other_in_one_position_alone_are_no_redundancy(coordinates: str) -> None:
    """Straight ahead one wheel follows from the others, steered it does not."""
    with pytest.raises(pt.errors.SingularityError, match="singular position"):
        steered((0.0, 0.0, 0.0)).simulate(0.1, coordinates=coordinates)
    m = steered((0.4, -0.2, 0.3))
    assert m.compile(coordinates=coordinates).mobility == 3
    run = m.simulate(0.1, initial=m.assemble(coordinates=coordinates), coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid"
