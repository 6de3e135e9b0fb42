"""Angles whose whole turns nothing counts, and functions that jump: no body leaves its place in silence."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, DescriptionError, EvaluationError

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])


def shafts(cut: bool = False, plane: bool = False) -> pt.Mechanism:
    """A wheel, and a slide or another wheel across it; in space unless the plane is asked for."""
    m = pt.Mechanism("shafts", gravity=None)
    for name in "ab":
        m.add_body(name, mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0), cut="always" if cut else "auto")
    m.add_revolute("B", m.ground, "b", point=(0, 0, 0), axis=(0, 0, 1) if plane else (0, 0.6, 0.8))
    if cut:
        m.add_free("flight", m.ground, "a")
    return m


def slide(cut: bool = False) -> pt.Mechanism:
    m = shafts(cut)
    m.add_body("s", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("P", m.ground, "s", axis=(1, 0, 0))
    return m


JUMPS: dict[str, Callable[[pt.Mechanism], Any]] = {
    "in time": lambda m: m.add_constraint("c", lambda t, x: x - 0.1 * t - (0.0 if t < 0.5 else 0.3), of=["P"]),
    "on the way": lambda m: m.add_cam("P", "A", lambda x: 0.1 * x + (0.0 if x < 1.0 else 0.3)),
}


@BOTH
@pytest.mark.parametrize("how", JUMPS)
def test_a_function_that_jumps_ends_the_run(how: str, coordinates: str) -> None:
    m = slide()
    JUMPS[how](m)
    start = m.assemble(rates={"A": 2.0, "B": 0.0}, coordinates=coordinates)
    run = m.simulate(1.0, initial=start, coordinates=coordinates)
    assert not run.success and run.status == "evaluation-failed"
    assert "jumps by 0.3" in run.message and run.t[-1] <= 0.5
    assert run.joint("P").position.max() < 0.11  # where it was before the jump


@BOTH
def test_a_function_of_an_angle_need_not_count_turns_where_nothing_does(coordinates: str) -> None:
    m = slide(cut=True)
    m.add_constraint("thread", lambda t, x, y: y - 0.1 * x, of=["A", "P"])
    start = m.assemble(rates={"A": 6.0, "B": 0.0}, coordinates=coordinates)
    run = m.simulate(1.0, initial=start, coordinates=coordinates)
    assert not run.success and "not periodic in an angle" in run.message
    assert run.t[-1] < np.pi / 6.0 and np.ptp(run.joint("P").position) < 0.1 * np.pi
    # one that repeats itself goes round: the angle follows from the energy
    m = slide(cut=True)
    m.add_cam("P", "A", lambda x: 0.1 * (1.0 - np.cos(x)))
    start = m.assemble(rates={"A": 6.0, "B": 0.0}, coordinates=coordinates)
    run = m.simulate(2.0, initial=start, coordinates=coordinates, rtol=1e-10)
    angle = run.joint("A").position[:, 0]
    assert run.success and angle[-1] > 10.0
    assert np.allclose(run.joint("P").position[:, 0], 0.1 * (1.0 - np.cos(angle)), atol=1e-12)
    rate = 6.0 / np.sqrt(1.0 + 0.01 * np.sin(angle) ** 2)
    assert np.allclose(run.joint("A").velocity[:, 0], rate, rtol=1e-8)  # a hundred tolerances


@pytest.mark.parametrize("ratio", [math.sqrt(2.0), 0.37, -3.0])
def test_absolute_positions_keep_the_phase_of_a_gear(ratio: float) -> None:
    m = shafts()
    m.add_gear("A", "B", ratio=ratio)
    for angle in (1.0, 4.0):
        one, other = (m.assemble({"A": angle}, rates={"A": 1.0}, coordinates=c) for c in ("relative", "absolute"))
        over = m.convert(one, "absolute")
        # q of a turn and of its opposite quaternion are one position
        assert np.allclose(np.abs(other.q), np.abs(over.q), atol=1e-9) and np.allclose(other.v, over.v, atol=1e-9)
    m.add_drive("A", position=lambda t: 0.5 + t)
    for c in ("relative", "absolute"):
        run = m.simulate(0.1, coordinates=c)
        assert run.success and np.allclose(run.joint("B").position[:, 0], ratio * (0.5 + run.t), atol=1e-9)


def test_a_gear_held_by_its_rates_does_not_slip_on_the_way_to_a_target() -> None:
    m = shafts()
    m.add_gear("A", "B", ratio=math.sqrt(2.0))
    start = m.assemble(coordinates="absolute")
    with pytest.raises(ArgumentError, match="phase would change by"):
        m.assemble({"A": 1.0}, near=start, coordinates="absolute")


WOUND: dict[str, Callable[[pt.Mechanism], Any]] = {
    "spring": lambda m: m.add_torsion_spring("A", stiffness=0.1),
    "stop": lambda m: m.add_stop("A", lower=-1.0, upper=2.0, stiffness=0.1),
    "table": lambda m: m.add_torque("A", ([-20.0, 20.0], [2.0, -2.0]), over="A"),
    "gas": lambda m: m.add_gas_spring("A", force=-0.8 * 0.6**1.5, length=20.0, exponent=1.5),
}


@pytest.mark.parametrize("what", WOUND)
def test_what_is_wound_is_not_unwound_by_other_coordinates(what: str) -> None:
    for plane in (True, False):
        m = shafts(plane=plane)
        WOUND[what](m)
        start = m.assemble({"A": 8.0})
        found = m.simulate(0.1, initial=start).joint("A").acceleration[0, 0]
        assert found == pytest.approx(-0.6 if what == "stop" else -0.8)
        if plane:
            again = m.simulate(0.1, initial=start, coordinates="absolute")
            assert again.joint("A").acceleration[0, 0] == pytest.approx(found)
            continue
        with pytest.raises(EvaluationError, match=r"its angle is .* within half a turn"):
            m.convert(start, "absolute")
        with pytest.raises(EvaluationError, match=r"its angle is .* within half a turn"):
            m.assemble({"A": 8.0}, coordinates="absolute")


def test_functions_without_exact_derivatives_are_smooth_where_they_vanish() -> None:
    found = []
    for sine in (np.sin, math.sin):
        m = slide()
        m.add_constraint("c", lambda t, x, y, sine=sine: y - 0.1 * x - 0.2 * sine(x), of=["A", "P"])
        run = m.simulate(1.0, initial=m.assemble(rates={"A": 2.0}), rtol=1e-10)
        assert run.success, run.message
        found.append(run.joint("P").position[-1, 0])
    assert found[0] == pytest.approx(found[1], abs=1e-9)
    with pytest.raises(EvaluationError, match="not smooth"):
        slide().add_constraint("c", lambda t, x, y: y - 0.1 * abs(math.sin(x)), of=["A", "P"])


def test_a_gradient_of_another_function_and_rates_of_turns_not_there_are_refused() -> None:
    m = slide()
    with pytest.raises(
        DescriptionError, match=r"entry 0 of the gradient given is -0\.1, but the derivative .* is -0\.3"
    ):
        m.add_constraint(
            "c", lambda t, x, y: y - 0.1 * x - 0.2 * np.sin(x), of=["A", "P"], gradient=lambda t, x, y: (-0.1, 1.0)
        )
    m.add_free("flight", m.ground, "s")
    for rates in ({"flight": [1, 0, 0, 0, 0, 0]}, {"flight.wx": 1.0}):
        with pytest.raises(ArgumentError, match="the spatial rotation of joint 'flight' is not part of this state"):
            m.assemble(rates=rates, coordinates="absolute")


@pytest.mark.parametrize(("tilt", "length"), [(0.0, 40.0), (0.3, 6.2)])
def test_a_table_over_an_angle_means_the_same_in_all_coordinates(tilt: float, length: float) -> None:
    """Over many turns of a planar mechanism, with loads across its plane, whose reactions are computed in space where
    turns are not counted; and within one turn, beyond half of it, in space."""
    m = pt.Mechanism("cam", gravity=None)
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0.3, 0, 0), mass=1.0)
    slide = m.add_rod("slide", start=(1, 0, 0), end=(1.4, 0, 0), mass=0.5)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0), axis=(np.sin(tilt), 0, np.cos(tilt)))
    m.add_prismatic("B", m.ground, slide, axis=(1, 0, 0))
    x = np.linspace(0.0, length, int(10 * length))
    m.add_cam("B", "A", (x, 0.002 * x + 0.05 * np.sin(x)), name="cam")
    m.add_force("slide", (1.0, 0.5, 2.0), (0.2, 0, 0))
    start = m.assemble({"A": 2.5}, rates={"A": 6.0 if tilt == 0.0 else 2.5})
    t = np.linspace(0.0, 4.0 if tilt == 0.0 else 1.0, 9)
    runs = [
        m.simulate(t[-1], initial=start, coordinates=coordinates, t_eval=t, rtol=1e-11, atol=1e-13)
        for coordinates in ("relative", "absolute")
    ]
    assert all(run.success for run in runs) and np.ptp(runs[0].joint("A").position) > (14.0 if tilt == 0.0 else 1.5)
    for name in "AB":
        one, two = (run.joint(name) for run in runs)
        assert np.abs(one.force - two.force).max() < 1e-8 and np.abs(one.moment - two.moment).max() < 1e-8
        assert (one.determined == two.determined).all()
    assert np.abs(runs[0].coupling("cam").effort - runs[1].coupling("cam").effort).max() < 1e-8
    assert runs[1].certificate.verdict == "valid"


READ_IN_SPACE: dict[str, Callable[[pt.Mechanism, Callable[[float], float]], Any]] = {
    "a torque": lambda m, f: m.add_torque("B", lambda t, s: f(s.position("A"))),
    "a force": lambda m, f: m.add_force("b", lambda t, s: (0.0, 0.0, f(s.position("A"))), point=(1, 0, 0)),
    "a law": lambda m, f: m.add_force_law(
        "law", lambda t, a: (0.0, 0.0, f(a.position)), sees=["A"], on=[("b", (1, 0, 0))]
    ),
}


@pytest.mark.parametrize("read", READ_IN_SPACE)
@pytest.mark.parametrize("rate", [4.0, -4.0])
@pytest.mark.parametrize("t0", [0.0, 50.0])
def test_loads_that_read_an_angle_count_its_turns_or_are_refused(read: str, rate: float, t0: float) -> None:
    """Absolute coordinates know an angle in space within half a turn: what is not alike a turn on would jump there."""

    def ends(f: Callable[[float], float], coordinates: str) -> pt.Result:
        m = shafts()
        READ_IN_SPACE[read](m, f)
        start = m.assemble(rates={"A": rate, "B": 0.0}, t=t0)
        return m.simulate(2.0, initial=start, t_eval=[t0, t0 + 2.0], coordinates=coordinates)

    for alike in (math.sin, lambda x: 2.0 + math.cos(3.0 * x), lambda x: 0.0):
        one, other = (ends(alike, coordinates) for coordinates in ("relative", "absolute"))
        assert one.success and other.success
        for body in "ab":
            # forward errors of both runs at the default tolerance
            assert np.abs(one.body(body).velocity[-1] - other.body(body).velocity[-1]).max() < 1e-4
            spin = one.body(body).angular_velocity[-1] - other.body(body).angular_velocity[-1]
            assert np.abs(spin).max() < 1e-4
    for other_on in (lambda x: 0.1 * x, lambda x: math.exp(-((x - math.copysign(7.5, rate)) ** 2))):
        assert ends(other_on, "relative").success
        refused = ends(other_on, "absolute")
        assert not refused.success and "is known only within half a turn" in refused.message
        assert 'cut = "never"' in refused.message
