"""Couplings, drives and joints with conditions of their own: closed forms, in relative and in absolute coordinates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import ArgumentError, DescriptionError, EvaluationError

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
G = 9.81


def run(m: pt.Mechanism, coordinates: str, duration: float = 2.0, **options: Any) -> Any:
    r = m.simulate(duration, coordinates=coordinates, **{"rtol": 1e-11, "atol": 1e-12, **options})
    assert r.success, r.message
    # round-off of a metre
    assert r.closure.max() < 1e-12
    return r


def wheels(*inertias: float) -> pt.Mechanism:
    m = pt.Mechanism("wheels", gravity=(0, 0, 0))
    for i, inertia in enumerate(inertias, 1):
        wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(inertia, inertia, inertia), position=(i, 0, 0))
        m.add_revolute(f"A{i}", m.ground, wheel, point=(i, 0, 0))
    return m


@BOTH
@pytest.mark.parametrize("ratio", [-3.0, 0.37, 1e-3])
def test_a_gear_pair_is_one_flywheel(coordinates: str, ratio: float) -> None:
    m = wheels(2.0, 0.5)
    m.add_gear("A1", "A2", ratio=ratio)
    m.add_torque("A1", 1.0)
    r = run(m, coordinates)
    angle = 0.5 * r.t**2 / (2.0 + 0.5 * ratio**2)
    assert np.allclose(r.joint("A1").position[:, 0], angle, atol=1e-12)
    assert np.allclose(r.joint("A2").position[:, 0], ratio * angle, atol=1e-12)
    # the tooth turns the second wheel
    assert np.allclose(r.coupling(f"gear {'A1'} - {'A2'}").effort[:, 0], 0.5 * ratio * 2.0 * angle[-1] / r.t[-1] ** 2)


@BOTH
def test_a_differential_shares_its_torque(coordinates: str) -> None:
    m = wheels(1.0, 2.0, 4.0)
    m.add_coupler("gears", ["A1", "A2", "A3"], [1.0, 1.0, -2.0], word="differential")
    m.add_torque("A3", 6.0)
    r = run(m, coordinates)
    # lambda from J_i w_i' = f_i lambda + T_i and w_1' + w_2' = 2 w_3'
    effort = 2 * 6.0 / 4.0 / (1.0 + 1 / 2.0 + 4 / 4.0)
    found = np.array([r.joint(f"A{i}").velocity[-1, 0] for i in (1, 2, 3)])
    assert np.allclose(found, [2 * effort, 2 * effort / 2.0, 2 * (6.0 - 2 * effort) / 4.0], atol=1e-11)


@BOTH
def test_a_sum_of_forty_is_held(coordinates: str) -> None:
    """Flywheels of J_i = i held by the sum of f_i angles: w_i' = (f_i lambda + T_i) / J_i with sum f_i w_i' = 0."""
    inertias, factors = np.arange(1.0, 41.0), 0.5 + 0.05 * np.arange(40) * (-1.0) ** np.arange(40)
    m = wheels(*inertias)
    m.add_coupler("sum", [f"A{i}" for i in range(1, 41)], factors)
    m.add_torque("A40", 6.0)
    r = run(m, coordinates, 1.0)
    torques = np.where(np.arange(40) == 39, 6.0, 0.0)
    effort = -(factors @ (torques / inertias)) / (factors @ (factors / inertias))
    found = np.array([r.joint(f"A{i}").velocity[-1, 0] for i in range(1, 41)])
    np.testing.assert_allclose(found, (factors * effort + torques) / inertias, atol=1e-11)
    np.testing.assert_allclose(r.coupling("sum").effort[:, 0], effort, rtol=1e-11)


@BOTH
def test_a_belt_and_a_crossed_one(coordinates: str) -> None:
    m = wheels(1.0, 1.0, 1.0)
    m.add_belt("A1", "A2", radius1=0.1, radius2=0.2)
    m.add_belt("A2", "A3", radius1=0.2, radius2=0.1, crossed=True)
    m.add_drive("A1", velocity=2.0)
    r = run(m, coordinates)
    assert np.allclose([r.joint(f"A{i}").velocity[-1, 0] for i in (1, 2, 3)], [2.0, 1.0, -2.0], atol=1e-13)


@BOTH
def test_rack_and_pinion(coordinates: str) -> None:
    m = pt.Mechanism("steering", gravity=(0, 0, 0))
    pinion = m.add_body("pinion", mass=1.0, inertia=(1, 1, 2))
    rack = m.add_body("rack", mass=3.0, inertia=(1, 1, 1), position=(0, -0.5, 0))
    m.add_revolute("P", m.ground, pinion, point=(0, 0, 0))
    m.add_prismatic("R", m.ground, rack, axis=(1, 0, 0))
    m.add_rack("P", "R", radius=0.5)
    m.add_torque("P", 2.0)
    r = run(m, coordinates)
    assert np.allclose(r.joint("R").position[:, 0], 0.5 * 0.5 * 2.0 / (2.0 + 3.0 * 0.25) * r.t**2, atol=1e-12)


@BOTH
@pytest.mark.parametrize("pitch", [0.5, -0.002])
def test_a_nut_falls_down_its_screw(coordinates: str, pitch: float) -> None:
    m = pt.Mechanism("jack")
    nut = m.add_body("nut", mass=2.0, inertia=(1.0, 0.3, 1.0))
    m.add_screw("thread", m.ground, nut, point=(0, 0, 0), axis=(0, 1, 0), pitch=pitch)
    r = run(m, coordinates)
    per_radian = pitch / (2 * np.pi)
    turn = -2.0 * G * per_radian / (0.3 + 2.0 * per_radian**2)
    thread = r.joint("thread")
    assert np.allclose(thread.position[:, 0], 0.5 * per_radian * turn * r.t**2, rtol=1e-9, atol=1e-12)
    assert np.allclose(thread.force[-1], [0, 2.0 * (G + per_radian * turn), 0], rtol=1e-9)
    assert np.allclose(thread.moment[-1], [0, 0.3 * turn, 0], rtol=1e-9, atol=1e-12)


@BOTH
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_a_wire_pendulum_and_its_tension(coordinates: str, scale: float) -> None:
    m = pt.Mechanism("wire", gravity=(0, -G * scale, 0))
    bob = m.add_body("bob", mass=2.0, inertia=(1e-3 * scale**2,) * 3, position=(scale, 0, 0))
    m.add_distance("wire", m.ground, (0, 0, 0), bob, (0, 0, 0))
    r = m.simulate(2.0, coordinates=coordinates, rtol=1e-11, atol=1e-12 * scale)
    assert r.success and r.closure.max() < 1e-12 * scale
    at, rate = r.body("bob").position / scale, r.body("bob").velocity / scale
    expected = 2.0 * scale * (np.sum(rate**2, axis=1) - G * at[:, 1])
    assert np.allclose(r.coupling("wire").tension, expected, rtol=0, atol=1e-11 * scale)
    # energy of the swing, what the run's tolerance leaves
    assert np.allclose(0.5 * np.sum(rate**2, axis=1) + G * at[:, 1], 0.0, atol=1e-8)


@BOTH
def test_a_constant_velocity_joint_passes_the_spin_on(coordinates: str) -> None:
    bend = 0.5
    c, s = np.cos(bend), np.sin(bend)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    m = pt.Mechanism("half shaft", gravity=(0, 0, 0))
    first = m.add_body("in", mass=1, inertia=(0.1, 1, 1), position=(-0.5, 0, 0))
    second = m.add_body("out", mass=1, inertia=(0.3, 1, 1), position=(0.5 * c, 0.5 * s, 0), orientation=turned)
    m.add_revolute("A", m.ground, first, point=(-1, 0, 0), axis=(1, 0, 0))
    m.add_revolute("B", m.ground, second, point=(c, s, 0), axis=(c, s, 0))
    m.add_constant_velocity("CV", first, second, point=(0, 0, 0), axis=(1, 0, 0), child_frame=turned)
    m.add_torque("A", 0.8)
    r = run(m, coordinates)
    assert np.allclose(r.joint("A").velocity[:, 0], 2.0 * r.t, atol=1e-11)
    assert np.allclose(r.joint("B").velocity, r.joint("A").velocity, atol=1e-12)


@BOTH
def test_a_ball_rolls_down_an_incline(coordinates: str) -> None:
    slope, mass, radius = 0.3, 2.0, 0.1
    m = pt.Mechanism("ball", gravity=(G * np.sin(slope), -G * np.cos(slope), 0))
    ball = m.add_body("ball", mass=mass, inertia=(0.4 * mass * radius**2,) * 3, position=(0, radius, 0))
    m.add_rolling("contact", ball, radius=radius, ball=True)
    r = run(m, coordinates)
    assert np.allclose(r.body("ball").position[:, 0], 0.5 * G * np.sin(slope) / 1.4 * r.t**2, atol=1e-11)
    # normal force, and the friction that turns the ball
    assert np.allclose(r.coupling("contact").effort[-1, 0], mass * G * np.cos(slope), atol=1e-10)
    assert np.isclose(np.linalg.norm(r.coupling("contact").effort[-1, 1:]), mass * G * np.sin(slope) * 0.4 / 1.4)


def test_a_coin_rolls_on_its_edge() -> None:
    """Steady circle of a rolling disc: the lean at which it goes round follows from its rates alone."""
    radius, lean, spin = 0.5, 0.4, 9.0
    # inertias k1 = 1/4, k2 = 1/2 of m r^2; steady turn W of the axis from the moment about the contact:
    # k1 W^2 sin(lean) cos(lean) - (k2 + 1) spin W cos(lean) = (g / r) sin(lean), lean from upright
    k1, k2 = 0.25, 0.5
    a, b, c0 = k1 * np.sin(lean) * np.cos(lean), -(k2 + 1) * spin * np.cos(lean), -(G / radius) * np.sin(lean)
    turn = (-b - np.sqrt(b * b - 4 * a * c0)) / (2 * a)
    axis = np.array([0.0, np.sin(lean), np.cos(lean)])
    up = np.array([0.0, np.cos(lean), -np.sin(lean)])
    orientation = np.column_stack([np.cross(up, axis), up, axis])
    m = pt.Mechanism("coin")
    coin = m.add_body(
        "coin",
        mass=1.0,
        inertia=np.array([k1, k1, k2]) * radius**2,
        position=radius * up,
        orientation=orientation,
    )
    m.add_rolling("edge", coin, radius=radius)
    m.add_free("flight", m.ground, coin)
    # spin about the own axis in all, and the turn of the axis about the vertical without its part along the axis
    w = spin * axis + turn * (np.array([0, 1.0, 0]) - np.sin(lean) * axis)
    velocity = np.cross(w, radius * up)
    own = orientation.T @ w
    r = run(m, "relative", 3.0, initial=m.assemble(rates={"flight": [*velocity, *w]}), t_eval=np.linspace(0, 3, 31))
    axes = r.body("coin").rotation[:, :, 2]
    assert own[2] == pytest.approx(spin)
    assert np.allclose(axes[:, 1], np.sin(lean), atol=1e-8), np.ptp(axes[:, 1])
    assert np.ptp(r.energy.total) < 1e-9


COURSES: list[tuple[str, dict[str, Any], Callable[[Any], Any]]] = [
    ("number", {"velocity": 1.5}, lambda t: 1.5 * t),
    ("function", {"velocity": lambda t: np.sin(3 * t)}, lambda t: (1 - np.cos(3 * t)) / 3),
    ("table", {"velocity": ([0.0, 2.0], [0.0, 4.0])}, lambda t: t**2),
    ("constant acceleration", {"acceleration": 3.0, "rate": -1.0}, lambda t: 1.5 * t**2 - t),
    ("acceleration", {"acceleration": lambda t: np.cos(t)}, lambda t: 1 - np.cos(t)),
    ("accelerations", {"acceleration": ([0.0, 2.0], [0.0, 6.0]), "rate": 0.5}, lambda t: 0.5 * t**3 + 0.5 * t),
    ("two points", {"position": ([0.0, 2.0], [0.0, 1.0])}, lambda t: 0.5 * t),
]


@BOTH
@pytest.mark.parametrize(("words", "given", "position"), COURSES, ids=[c[0] for c in COURSES])
def test_drives_by_position_rate_and_acceleration(
    words: str, given: dict[str, Any], position: Callable[[Any], Any], coordinates: str
) -> None:
    m = pt.Mechanism("crane", gravity=(0, 0, 0))
    arm = m.add_body("arm", mass=1.0, inertia=(1, 1, 2.0))
    m.add_revolute("A", m.ground, arm, point=(0, 0, 0), axis=(1, 2, 2))
    m.add_drive("A", **given)
    r = run(m, coordinates)
    assert np.allclose(r.joint("A").position[:, 0], position(r.t), atol=1e-9)
    # its effort is the inertia about the axis times the acceleration, by differences of the rate
    inner = slice(2, -2)
    bend = np.gradient(r.joint("A").velocity[:, 0], r.t)[inner]
    assert np.allclose(r.joint("A").drive[inner, 0], (1 + 4 + 8) / 9 * bend, atol=2e-2)


def test_the_bias_of_a_distance_is_the_rate_of_its_rate() -> None:
    """For motions along the line and across it, by differences."""
    m = pt.Mechanism("table", gravity=(0, 0, 0))
    m.add_body("slide", mass=1.0, inertia=(1, 1, 1))
    m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0.3, 1.1, 0))
    m.add_prismatic("X", m.ground, "slide", axis=(1, 0, 0))
    m.add_prismatic("Y", "slide", "load", axis=(0, 1, 0))
    m.add_drive(pt.Distance(m.ground, (0, 0, 0), "load", (0, 0, 0)), position=lambda t: 1 + 0.1 * t**2)
    model, q, h = m.compile(), np.array([0.4, -0.2]), 1e-5
    for v in np.random.default_rng(4).normal(size=(5, 2)):
        rates = [model.jacobian(q + s * h * v, t=0.5 + s * h) @ v + model.rate(q, t=0.5 + s * h) for s in (-1, 1)]
        np.testing.assert_allclose(model.bias(q, v, t=0.5), (rates[1] - rates[0]) / (2 * h), atol=1e-8)


@BOTH
def test_a_distance_is_driven(coordinates: str) -> None:
    m = pt.Mechanism("winch", gravity=(0, 0, 0))
    load = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
    m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
    m.add_drive(pt.Distance(m.ground, (0, 0, 0), load, (0, 0, 0)), position=lambda t: 1 + 0.1 * t**2)
    r = run(m, coordinates)
    assert np.allclose(r.body("load").position[:, 1], -1 - 0.1 * r.t**2, atol=1e-12)


@BOTH
@pytest.mark.parametrize("law", ["function", "table"])
def test_a_cam_by_its_law(coordinates: str, law: str) -> None:
    m = pt.Mechanism("valve", gravity=(0, 0, 0))
    shaft = m.add_body("shaft", mass=1.0, inertia=(1, 1, 2))
    valve = m.add_body("valve", mass=0.1, inertia=(1, 1, 2))
    m.add_revolute("A", m.ground, shaft, point=(0, 0, 0))
    m.add_prismatic("V", m.ground, valve, axis=(0, 1, 0))
    x = np.linspace(0.0, 2 * np.pi, 2001)
    lift = (x, 0.02 * (1 - np.cos(x))) if law == "table" else lambda x: 0.02 * (1 - np.cos(x))
    m.add_cam("V", "A", lift, periodic=law == "table") if law == "table" else m.add_cam("V", "A", lift)
    m.add_drive("A", velocity=10.0)
    r = run(m, coordinates)
    exact = 1e-12 if law == "function" else 1e-11
    assert np.allclose(r.joint("V").position[:, 0], 0.02 * (1 - np.cos(10 * r.t)), atol=exact)
    assert np.allclose(r.joint("V").force[:, 1], 0.0, atol=1e-9)
    assert np.allclose(r.coupling("cam A - V").effort[:, 0], 0.1 * 2.0 * np.cos(10 * r.t), atol=2e-5)


def test_a_periodic_cam_runs_on_as_smoothly_where_it_begins_anew() -> None:
    """Slope and bend of a table that is steep at its seam, on both sides of it."""
    m = wheels(1.0, 1.0)
    x = np.linspace(0.0, 2 * np.pi, 25)
    m.add_cam("A2", "A1", (x, 0.1 * np.sin(x)), periodic=True)
    m.add_drive("A1", velocity=1.0)
    full_turn = 2 * np.pi
    r = m.simulate(7.0, t_eval=[full_turn - 1e-6, full_turn + 1e-6], rtol=1e-10, atol=1e-12)
    rate, bend = r.joint("A2").velocity[:, 0], r.vdot[:, 1]
    assert np.allclose(rate, 0.1, atol=1e-5) and abs(rate[1] - rate[0]) < 1e-9
    assert abs(bend[1] - bend[0]) < 1e-6


def test_rates_that_cannot_be_else_may_be_given() -> None:
    """A bicycle's frame rolls about the line of its contacts: the speed across, zero by itself, takes nothing away."""
    m = pt.catalogue.load("whipple-bicycle")
    state = m.assemble(rates={"frame.wx": 0.05, "frame.y": 0.0, "steer": 0.0})
    assert state.v[m.compile().velocity_names.index("frame.wx")] == pytest.approx(0.05, rel=1e-12)
    with pytest.raises(ArgumentError, match="are incompatible"):
        m.assemble(rates={"frame.wx": 0.05, "frame.y": 0.01, "steer": 0.0, "rear axle": 0.0})


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_bodies_drawn_in_a_point_do_not_say_how_large_a_mechanism_is(scale: float) -> None:
    """Three coinciding points have a mean that is off by round-off: no length to measure closings by."""
    m = pt.Mechanism("rods", gravity=(0, 0, 0))
    top = m.add_body("top", mass=1.0, inertia=(scale**2,) * 3, position=(0, 0, 0.6 * scale))
    m.add_free("pose", m.ground, top, cut="never")
    for i in range(6):
        a = 1.0 + i
        foot, head = scale * np.array([np.cos(a), np.sin(a), 0.1]), scale * np.array([0.3 * np.cos(a * i), 0.3, 0.0])
        block = m.add_body(f"foot {i}", mass=1.0, inertia=(scale**2,) * 3, position=foot)
        m.add_prismatic(f"rail {i}", m.ground, block, point=foot, axis=(1, 0, 0))
        m.add_distance(f"rod {i}", block, (0, 0, 0), top, head)
    found = m.assemble(rates={"pose": (0.1 * scale, 0, 0, 0, 0, 0)}).assembly
    assert found is not None and found["iterations"] == 0


@BOTH
def test_a_bead_on_a_parabola_and_a_constraint_of_ones_own(coordinates: str) -> None:
    """The same curve as a coupling and as a function; energy, and the same motion."""
    ends = []
    for own in (True, False):
        m = pt.Mechanism("bead")
        bead = m.add_body("bead", mass=1.0, inertia=(1, 1, 1), position=(1, 1, 0))
        m.add_joint("plane", m.ground, bead, free=("x", "y"))
        if own:
            of = [pt.Along("ground", (0, 0, 0), axis, bead, (0, 0, 0)) for axis in ((1, 0, 0), (0, 1, 0))]
            m.add_constraint("wire", lambda t, x, y: y - x**2, of=of)
        else:
            m.add_point_on_curve("wire", m.ground, bead, (0, 0, 0), lambda x: x**2)
        r = run(m, coordinates)
        assert np.allclose(r.body("bead").position[:, 1], r.body("bead").position[:, 0] ** 2, atol=1e-12)
        assert np.ptp(r.energy.total) < 1e-9
        ends.append(r.body("bead").position[-1])
    assert np.allclose(*ends, atol=1e-10)


@BOTH
def test_a_constraint_on_rates(coordinates: str) -> None:
    """A sleigh: its blade does not move sideways. On an incline it turns and drifts across, and comes back up."""
    slope, turn = 0.3, 1.5
    m = pt.Mechanism("sleigh", gravity=(0, -G * np.sin(slope), 0))
    sleigh = m.add_body("sleigh", mass=1.0, inertia=(1, 1, 0.5))
    m.add_planar("ice", m.ground, sleigh, normal=(0, 0, 1))
    at = [pt.Coordinate("ice", i) for i in range(3)]
    m.add_constraint("blade", lambda t, x, y, a: [np.sin(a), -np.cos(a), 0.0 * a], of=at, level="velocity")
    start = m.assemble(rates={"ice": [0.0, 0.0, turn]}) if coordinates == "relative" else None
    if start is None:
        return
    r = run(m, coordinates, 4.0, initial=start)
    g, a = G * np.sin(slope), turn * r.t
    x = g / turn**2 * (0.5 * a + 0.25 * np.sin(2 * a) - np.sin(a))
    y = g / turn**2 * (0.5 * np.sin(a) ** 2 - 1 + np.cos(a))
    assert np.allclose(r.joint("ice").position[:, :2], np.column_stack([x, y]), atol=1e-9)


def test_couplings_that_cannot_be() -> None:
    m = wheels(1.0, 1.0)
    for words, call in [
        ("factor 0 is 0", lambda: m.add_coupler("c", ["A1", "A2"], [0.0, 1.0])),
        ("2 terms but 1 factors", lambda: m.add_coupler("c", ["A1", "A2"], [1.0])),
        ("it has no terms", lambda: m.add_coupler("c", [], [])),
        ("13 arguments; at most 12 are allowed", lambda: m.add_constraint("c", lambda t, *x: sum(x), of=["A1"] * 13)),
        ("ratio is 0", lambda: m.add_gear("A1", "A2", 0.0)),
        ("must be positive", lambda: m.add_belt("A1", "A2", -1.0, 1.0)),
        ("points coincide", lambda: m.add_distance("d", "ground", (0, 0, 0), "wheel 1", (-1, 0, 0))),
        ("must end where it begins", lambda: m.add_cam("A1", "A2", ([0, 1, 2, 3], [0, 1, 2, 3]), periodic=True)),
        ("closes after a whole turn", lambda: m.add_point_on_curve(
            "p", "ground", "wheel 1", (0, 0, 0), ([0.0, 1.0, 2.0], [1.0, 1.0, 1.0]), polar=True)),
        ("cannot roll on itself", lambda: m.add_rolling("r", "wheel 1", 1.0, on="wheel 1")),
        ("must advance", lambda: m.add_screw("s", "wheel 1", "wheel 2", (0, 0, 0), pitch=0.0)),
    ]:  # fmt: skip
        with pytest.raises(DescriptionError, match=words):
            call()
    assert not m.couplings
    with pytest.raises(EvaluationError, match="one number"):
        m.add_constraint("c", lambda t, x: "high", of=["A1"])


@BOTH
def test_a_curve_that_is_left_says_where(coordinates: str) -> None:
    m = wheels(1.0, 1.0)
    m.add_cam("A2", "A1", ([-1.0, 0.0, 0.5, 1.0], [-1.0, 0.0, 0.5, 1.0]))
    m.add_drive("A1", velocity=1.0)
    r = m.simulate(2.0, coordinates=coordinates)
    assert not r.success and "outside [-1, 1]" in r.message and "cam A1 - A2" in r.message


def test_files_keep_couplings(tmp_path: Any) -> None:
    m = wheels(1.0, 1.0, 1.0)
    m.add_gear("A1", "A2", ratio=-0.5)
    x = np.linspace(0, 2 * np.pi, 50)
    m.add_cam("A3", "A1", (x, 0.1 * np.sin(x) ** 2), periodic=True)
    m.add_rolling("r", "wheel 3", 1.0, point=(0, -1, 0), slips=True)
    ball = m.add_body("ball", mass=1.0, inertia=(1, 1, 1), position=(0, 0.5, 0))
    m.add_rolling("b", ball, 0.5, ball=True)
    m.add_drive("A1", acceleration=([0.0, 5.0], [0.0, 1.0]), rate=0.3)
    m.add_distance("d", "ground", (0, 3, 0), ball, (0, 0, 0))
    path = tmp_path / "m.toml"
    m.save(path)
    assert pt.load(path).to_spec() == m.to_spec()


@BOTH
def test_a_gas_force_over_the_crank_angle(coordinates: str) -> None:
    """A table over an angle does the work that its area says; the same as a function of the state."""
    x = np.linspace(-np.pi, np.pi, 2001)
    m = wheels(1.0, 2.0)
    m.add_gear("A1", "A2", ratio=1.0)
    m.add_torque("A2", (x, 0.3 * np.sin(x)), over="A1", periodic=True)
    m.add_torque("A1", 0.1)
    r = run(m, coordinates, 8.0, rtol=1e-9)
    angle, rate = r.joint("A1").position[:, 0], r.joint("A1").velocity[:, 0]
    assert angle[-1] > 1.7
    # 3 w^2 / 2 = 0.1 a + 0.3 (1 - cos a); the table's own error is the square of its spacing
    assert np.allclose(1.5 * rate**2, 0.1 * angle + 0.3 * (1 - np.cos(angle)), atol=2e-6)


@BOTH
@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, 2)])
def test_a_torsion_spring_swings_wherever_its_joint_stands(coordinates: str, axis: tuple[float, ...]) -> None:
    m = pt.Mechanism("balance wheel", gravity=(0, 0, 0))
    wheel = m.add_body("wheel", mass=1.0, inertia=(2.0, 2.0, 2.0))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0), axis=axis)
    m.add_torsion_spring("A", stiffness=8.0, angle=0.5)
    r = run(m, coordinates, 5.0)
    assert np.allclose(r.joint("A").position[:, 0], 0.5 * (1 - np.cos(2.0 * r.t)), atol=1e-9)
    assert np.ptp(r.energy.total) < 1e-9


def test_a_spring_wound_beyond_what_is_known_says_so() -> None:
    """In the tree turns are counted; in absolute coordinates in space a turned wheel is known within half a turn."""
    m = pt.Mechanism("winder", gravity=(0, 0, 0))
    wheel = m.add_body("wheel", mass=1.0, inertia=(2.0, 2.0, 2.0))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0), axis=(1, 2, 2))
    # a second axis, so that the mechanism is none of the plane, where angles are counted
    fan = m.add_body("fan", mass=1.0, inertia=(2.0, 2.0, 2.0), position=(1, 0, 0))
    m.add_revolute("B", m.ground, fan, point=(1, 0, 0), axis=(1, 0, 0))
    m.add_torsion_spring("A", stiffness=1.0)
    m.add_drive("A", velocity=2.0)
    assert run(m, "relative", 4.0).joint("A").drive[-1, 0] == pytest.approx(8.0)
    r = m.simulate(4.0, coordinates="absolute")
    assert not r.success and "its angle is" in r.message and "in the tree" in r.message


def test_closing_through_a_gear() -> None:
    """A geared five-bar in both assemblies: closed in closed form it moves as with its loop closed by iteration."""
    m = pt.Mechanism("geared five-bar")
    pins = {"A": (0, 0), "B": (0.3, 0.3), "C": (0.8, 0.9), "D": (1.2, 0.25), "E": (1, 0)}
    bars = [
        m.add_rod(name, (*pins[a], 0), (*pins[b], 0), mass=1.0)
        for name, a, b in zip("abcd", "ABCD", "BCDE", strict=True)
    ]
    for name, one, other in zip("ABCDE", [m.ground, *bars], [*bars, m.ground], strict=True):
        m.add_revolute(name, one, other, point=(*pins[name], 0))
    m.add_gear("A", "E", ratio=2.0)
    both = m.assemblies(inputs=["A"])
    assert len(both) == 2 and len(both.notes) == 0
    for one in both:
        runs = {
            name: run(m, "relative", 0.8, solver=pt.Solver(name), initial=one.state, t_eval=np.linspace(0, 0.8, 20))
            for name in ("explicit-closing", "projective")
        }
        explicit, other = (r.body("c").position for r in runs.values())
        assert np.abs(explicit - other).max() < 1e-8
        turned = [runs["explicit-closing"].joint(name).position[:, 0] for name in "AE"]
        assert np.abs(turned[1] - 2.0 * turned[0]).max() < 1e-13
    m.add_drive("B", velocity=1.0)
    with pytest.raises(ArgumentError, match="constrains rates only"):
        m.assemblies(inputs=[])


def anchored(offset: float | None, name: str = "ball", at: float = 1.0) -> pt.Mechanism:
    m = pt.Mechanism("anchored")
    m.add_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1), position=(0.3, -at, 0.2))
    m.add_body("other", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(0.3, -2.5 * at, 0))
    terms = [
        pt.Distance(m.ground, (0, 0, 0), name, (0, 0, 0)),
        pt.Along(name, (0, 0, 0), (0, 1, 0), "other", (0.1, 0, 0)),
        pt.Cosine(m.ground, (1, 0, 0), "other", (0, 1, 1)),
    ]
    m.add_coupler("wire", terms[:1], [2.0], offset)
    m.add_coupler("sum", terms, [1.0, -2.0, 0.5])
    return m


@BOTH
def test_a_coupler_of_measurements_holds_what_is_drawn(coordinates: str) -> None:
    for name, at in (("ball", 1.0), ("a bob", 0.02)):
        m = anchored(None, name, at)
        assert not m.check().remarks
        start = m.assemble(coordinates=coordinates)
        drawn = m.compile(coordinates=coordinates).core.initial()[0]
        assert np.max(np.abs(start.q - drawn)) < 1e-12 and m.couplings["wire"].offset is None
        run = m.simulate(0.3, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid" and not run.notes
        away = np.linalg.norm(run.body(name).position, axis=1)
        assert np.max(np.abs(away - np.linalg.norm((0.3, -at, 0.2)))) < 1e-9


def test_a_start_far_from_the_drawing_is_remarked(tmp_path: Path) -> None:
    m = anchored(6.0)
    assert ["wire" in remark for remark in m.check().remarks] == [True]
    run = m.simulate(0.1)
    assert any('coupler "wire": its value is 2.12' in note and "far from the drawing" in note for note in run.notes)
    near = anchored(2.0 * np.linalg.norm((0.3, -1.0, 0.2)) + 1e-3)
    assert not near.check().remarks
    again = pt.load(anchored(None).save(tmp_path / "anchored.toml").path)
    assert again.to_spec() == anchored(None).to_spec()


@pytest.mark.parametrize("polar", [True, False])
def test_curves_are_saved_and_read_again(tmp_path: Path, polar: bool) -> None:
    """The outline of a cam by angle and radius, and a rail: the file gives the same motion, and is written alike."""
    m = pt.Mechanism("cam", gravity=None)
    bead = m.add_body("bead", mass=1.0, inertia=(1, 1, 1), position=(1.2, 0, 0))
    m.add_planar("P", m.ground, bead)
    if polar:
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        curve = angle, np.where(angle < 6.0, 1.0 + 0.2 * np.cos(angle), 1.0 + 0.2 * np.cos(angle - 2.0 * np.pi))
        curve[1][-1] = curve[1][0]
    else:
        curve = np.linspace(-1.0, 3.0, 41), np.linspace(-1.0, 3.0, 41) ** 2 - 1.44
    m.add_point_on_curve("line", m.ground, bead, (0, 0, 0), curve, origin=(0, 0, 0.5), polar=polar)
    m.save(tmp_path / "cam.toml")
    again = pt.load(tmp_path / "cam.toml")
    runs = [x.simulate(0.5, initial=x.assemble(rates={"P.y": 0.4})) for x in (m, again)]
    assert runs[0].success and np.array_equal(runs[0].q, runs[1].q) and np.ptp(runs[0].q[:, 1]) > 0.1
    again.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "cam.toml").read_text()
