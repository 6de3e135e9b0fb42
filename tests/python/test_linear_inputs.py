"""Linearisations with the accelerations of drives as inputs, against the same mechanism driven otherwise."""

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, PartitaError, UnknownNameError


def five_bar(course: tuple[float, float, float] | None, *, level: str = "position") -> pt.Mechanism:
    """A plane five-bar with a spring and a damper; its crank A moves by (position, rate, acceleration) at t = 0."""
    m = pt.Mechanism("five-bar")
    ends = {"a": ((0, 0), (-0.2, 0.5)), "b": ((-0.2, 0.5), (0.35, 0.9)), "d": ((0.35, 0.9), (0.9, 0.55))}
    ends["e"] = ((0.9, 0.55), (0.7, 0))
    for i, (name, (start, end)) in enumerate(ends.items()):
        m.add_rod(name, start=(*start, 0), end=(*end, 0), mass=1.0 + 0.3 * i)
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0))
    m.add_revolute("B", "a", "b", point=(-0.2, 0.5, 0))
    m.add_revolute("C", "b", "d", point=(0.35, 0.9, 0))
    m.add_revolute("D", "d", "e", point=(0.9, 0.55, 0))
    m.add_revolute("E", m.ground, "e", point=(0.7, 0, 0))
    m.add_spring("s", "a", (-0.1, 0.25, 0), "e", (0.8, 0.3, 0), stiffness=60.0, damping=2.0, length=0.6)
    tip = m.add_sensor("tip", ("b", (0.35, 0.9, 0)), "acceleration")
    m.add_sensor("felt", tip.norm())
    if course is not None:
        p, r, w = course
        if level == "position":
            drive = m.add_drive("A", lambda t: p + r * t + 0.5 * w * t * t, name="motor")
        else:
            drive = m.add_drive("A", velocity=lambda t: r + w * t, name="motor")
        m.add_sensor("torque", drive, "effort")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_the_motion_of_a_drive_enters_as_its_acceleration(coordinates):
    """Columns of p, p' and p'' against the same mechanism driven from beside."""
    at = np.array([0.2, -0.15, 0.7, 0.9, 1.3])  # p, E, p', E', p''
    base = five_bar((at[0], at[2], at[4]))
    chosen = ["E"] if coordinates == "relative" else ["e.turn"]

    def state(m, x):
        return m.assemble({"E": x[1]}, rates={"E": x[3]}, near=base.assemble({"E": at[1]}))

    def values(x):
        m = five_bar((x[0], x[2], x[4]))
        here = m.linearize(m.convert(state(m, x), coordinates), coordinates=coordinates, independent=chosen)
        return np.array([*here.f0[1:], *here.y0])

    lin = base.linearize(
        base.convert(state(base, at), coordinates),
        inputs={"motor": "acceleration"},
        coordinates=coordinates,
        independent=chosen,
    )
    turn = chosen[0]
    assert lin.states == (turn, "motor", f"{turn}'", "motor'") and lin.inputs == ("motor''",)
    assert lin.f0 == pytest.approx([at[3], at[2], lin.f0[2], at[4]], abs=1e-12) and not lin.steady
    order = [1, 0, 3, 2, 4]
    slopes = []
    for i in order:
        one, two = ((values(at + h * np.eye(5)[i]) - values(at - h * np.eye(5)[i])) / (2 * h) for h in (1e-3, 2e-3))
        slopes.append((4 * one - two) / 3)
    slopes = np.array(slopes).T
    found = np.vstack([np.append(lin.A[2], lin.B[2]), np.hstack([lin.C, lin.D])])
    assert found == pytest.approx(slopes, abs=1e-7 * np.abs(slopes).max())
    assert np.array_equal(lin.A[[0, 1, 3]], [[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
    assert lin.B[:, 0] == pytest.approx([0, 0, lin.B[2, 0], 1], abs=0)


def test_a_drive_of_rates_has_its_position_among_the_independent_ones():
    """The same equations as with a drive of positions, in another order."""
    at, there = (0.2, 0.7, 1.3), None
    found = {}
    for level in ("position", "velocity"):
        m = five_bar(at, level=level)
        there = m.assemble({"E": -0.15, "A": 0.2}, rates={"E": 0.9}) if level == "velocity" else None
        here = there or m.assemble({"E": -0.15}, rates={"E": 0.9})
        found[level] = m.linearize(here, inputs={"A": "acceleration"}, independent=["E"])
    one, other = found["position"], found["velocity"]
    assert one.inputs == other.inputs and set(one.states) - set(other.states) == {"motor"}
    order = [other.states.index({"motor": "A"}.get(name, name)) for name in one.states]
    assert other.A[np.ix_(order, order)] == pytest.approx(one.A, abs=1e-10)
    assert other.B[order] == pytest.approx(one.B, abs=1e-12) and other.f0[order] == pytest.approx(one.f0, abs=1e-10)
    assert other.C[:, order] == pytest.approx(one.C, abs=1e-6) and pytest.approx(one.D, abs=1e-6) == other.D


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("heavy", [False, True])
def test_a_pendulum_on_a_turning_arm_is_steady_without_weight(coordinates, heavy):
    """phi'' = -(m a b / 2 J) spin^2 sin(phi): in the centrifugal field alone it stays; weight changes with the turn."""
    spin, a, b = 5.0, 0.7, 1.2
    m = pt.Mechanism("rotor", gravity=(0, -9.81, 0) if heavy else None)
    m.add_rod("arm", start=(0, 0, 0), end=(0, -a, 0), mass=3.0)
    m.add_rod("rod", start=(0, -a, 0), end=(0, -a - b, 0), mass=2.0)
    m.add_revolute("A", m.ground, "arm", point=(0, 0, 0))
    m.add_revolute("B", "arm", "rod", point=(0, -a, 0))
    m.add_drive("A", lambda t: spin * t)
    state, chosen = (
        m.convert(m.assemble({"B": 0.0}, rates={"B": 0.0}), coordinates),
        "B" if coordinates == "relative" else "rod.turn",
    )
    lin = m.linearize(state, coordinates=coordinates, independent=[chosen])
    assert abs(lin.f0[1]) < 1e-12 * spin**2
    if heavy:
        assert not lin.steady
        with pytest.raises(ArgumentError, match="not steady"):
            lin.modes()
        return
    assert lin.steady
    # turning with the arm, or seen from space: the angle is the same but for the turn of the arm
    wanted = spin * np.sqrt(1.5 * a / b)
    assert lin.modes().eigenvalues.imag == pytest.approx([wanted, -wanted], rel=1e-12)


def test_a_machine_without_freedom_is_its_drive():
    """A driven slider-crank: two integrators, and a piston by the closed form of its ratio."""
    m, angle = pt.catalogue.load("slider-crank"), 0.8
    crank = m.add_drive("O", angle, name="motor")
    m.add_sensor("torque", crank, "effort")
    lin = m.linearize(m.assemble(), inputs={"O": "acceleration"}, outputs=["O", "torque"])
    assert lin.states == ("motor", "motor'") and np.array_equal(lin.A, [[0, 1], [0, 0]])
    assert lin.steady and not lin.conservative and lin.modes().zero == 2
    assert lin.C[0] == pytest.approx([1, 0], abs=1e-9) and np.array_equal(lin.B[:, 0], [0, 1])
    # torque per acceleration: the inertia that the crank feels
    reflected = m.compile().actuated(m.assemble(), ["O"]).M
    assert lin.D[1, 0] == pytest.approx(reflected[0, 0], rel=1e-8)


def test_what_is_no_input_is_refused():
    m = five_bar((0.2, 0.7, 1.3))
    with pytest.raises(ArgumentError, match=r"'A' is driven by 'motor', so an effort there moves nothing"):
        m.linearize(inputs=["A"])
    with pytest.raises(ArgumentError, match=r"nothing drives 'E'"):
        m.linearize(inputs={"E": "acceleration"})
    with pytest.raises(ArgumentError, match=r"acceleration"):
        m.linearize(inputs={"A": "speed"})
    with pytest.raises(UnknownNameError, match=r"known|mean"):
        m.linearize(inputs={"Z": "acceleration"})
    ball = pt.Mechanism("ball")
    ball.add_body("b", mass=1.0, inertia=(1, 1, 1))
    ball.add_spherical("S", ball.ground, "b", point=(0, 0, 0))
    ball.add_drive("S", pose=lambda t: (0, 0, t), name="turn")
    with pytest.raises(ArgumentError, match="3 coordinates"):
        ball.linearize(inputs={"turn": "acceleration"})
    with pytest.raises(ArgumentError, match=r"pose|orientation|nothing drives"):
        ball.linearize(inputs={"S.wz": "acceleration"})
    twice = five_bar((0.0, 0.0, 0.0))
    twice.add_drive("E", 0.0, name="one")
    twice.add_drive("B", 0.0, name="other")
    with pytest.raises(PartitaError, match=r"drive .* repeats other conditions here"):
        twice.linearize(inputs={"one": "acceleration", "motor": "acceleration", "other": "acceleration"})
