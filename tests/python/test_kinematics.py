"""Kinematic studies against closed forms, other coordinates, driven runs and finer grids."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from drawings import GENERAL, four_bar, parallelogram, slider_crank
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import partita as pt
from partita.analyses import Kinematics
from partita.errors import ArgumentError, AssemblyError, SingularityError, UnknownNameError

Array = NDArray[np.float64]

CRANK_ROCKER = ((0.0, 0.0), (0.3, 0.1), (1.1, 0.9), (1.2, 0.0))
DOUBLE_ROCKER = ((0.0, 0.0), (0.1, 0.9), (0.5, 0.8), (1.2, 0.0))


class Linkage:
    """Angles, rates and accelerations of a planar four-bar from its crank, by its loop closure (Freudenstein)."""

    def __init__(self, points: Any) -> None:
        a, b, c, d = (complex(*p) for p in points)
        self.a, self.d = a, d
        self.ab, self.bc, self.dc = b - a, c - b, c - d
        self.side = np.sign(((b - d).conjugate() * (c - d)).imag)

    def at(self, turn: Array, rate: float = 0.0, change: float = 0.0) -> dict[str, tuple[Array, Array, Array]]:
        """Angle from the drawing, rate and acceleration of crank, coupler and rocker, all in the world."""
        b = self.a + self.ab * np.exp(1j * turn)
        span, long, short = b - self.d, abs(self.bc), abs(self.dc)
        inner = np.arccos((abs(span) ** 2 + short**2 - long**2) / (2.0 * abs(span) * short))
        c = self.d + span / abs(span) * short * np.exp(1j * self.side * inner)
        turned = {"coupler": np.angle((c - b) / self.bc), "rocker": np.angle((c - self.d) / self.dc)}
        crank, coupler, rocker = b - self.a, c - b, c - self.d
        # i (w2 ab + w3 bc - w4 dc) = 0, and its derivative, each two real equations
        cross = coupler.real * rocker.imag - coupler.imag * rocker.real

        def solve(right: Array) -> tuple[Array, Array]:
            x = -(right.real * rocker.imag - right.imag * rocker.real) / cross
            y = -(right.real * coupler.imag - right.imag * coupler.real) / cross
            return x, y

        w3, w4 = solve(rate * crank)
        known = change * crank + 1j * (rate**2 * crank + w3**2 * coupler - w4**2 * rocker)
        e3, e4 = solve(known)
        one = np.ones_like(turn)
        return {
            "crank": (turn, rate * one, change * one),
            "coupler": (np.unwrap(turned["coupler"]), w3, e3),
            "rocker": (np.unwrap(turned["rocker"]), w4, e4),
        }


def test_a_four_bar_moves_as_its_loop_closure_says() -> None:
    m, turn = four_bar(CRANK_ROCKER), np.linspace(0.0, 2.0 * np.pi, 73)
    k = m.kinematics({"A": turn}, rates={"A": 3.0}, accelerations={"A": -2.0})
    known = Linkage(CRANK_ROCKER).at(turn, 3.0, -2.0)
    assert k.reached.all() and k.success and not k.notes
    for i, size in enumerate((1.0, 10.0, 100.0)):
        crank, coupler, rocker = (known[name][i] for name in ("crank", "coupler", "rocker"))
        joints = {"A": crank, "B": coupler - crank, "C": rocker - coupler, "D": rocker}
        for name, expected in joints.items():
            seen = k.joint(name)
            found = (seen.position, seen.velocity, seen.acceleration)[i][:, 0]
            # each differentiation multiplies round-off by the rates
            assert np.abs(found - expected).max() < 1e-13 * size, (name, i)
    assert np.abs(k.ratio("D", "A") - known["rocker"][1] / 3.0).max() < 1e-12
    assert np.abs(k.ratio("D", "B") - known["rocker"][1] / (known["coupler"][1] - 3.0)).max() < 1e-10
    spin = k.body("coupler").angular_acceleration[:, 2]
    assert np.abs(spin - known["coupler"][2]).max() < 1e-11


def test_a_slider_crank_moves_as_its_triangle_says() -> None:
    r, rod, w = 0.1, 0.3, 30.0
    m, a = slider_crank(r, rod), np.linspace(0.0, 2.0 * np.pi, 61)
    k = m.kinematics({"main": a}, rates={"main": w})
    slide = k.joint("bore")
    root = np.sqrt(rod**2 - (r * np.sin(a)) ** 2)
    slope = -r * np.sin(a) - r**2 * np.sin(a) * np.cos(a) / root
    bend = -r * np.cos(a) - r**2 * np.cos(2 * a) / root - (r**2 * np.sin(a) * np.cos(a)) ** 2 / root**3
    assert np.abs(slide.position[:, 0] - (r * np.cos(a) + root - r - rod)).max() < 1e-15
    assert np.abs(slide.velocity[:, 0] - w * slope).max() < 1e-13
    assert np.abs(slide.acceleration[:, 0] - w**2 * bend).max() < 1e-11
    # the coupler pushes along the rod: the sine of the pressure angle is r sin(a) / rod
    pressure = np.arcsin(r * np.abs(np.sin(a)) / rod)
    assert np.abs(k.transmission("big end", "bore") - (np.pi / 2 - pressure)).max() < 1e-12
    # dead centres at 0, pi and 2 pi, where the piston stands still
    dead = [point for point in k.dead_points if point.joint == "bore"]
    assert np.abs(np.array([point.goals["main"] for point in dead]) - [0.0, np.pi, 2.0 * np.pi]).max() < 1e-8
    assert np.abs(np.array([point.value for point in dead]) - [0.0, -2 * r, 0.0]).max() < 1e-15


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_transmission_angle_of_a_crank_rocker_is_that_between_coupler_and_rocker(coordinates: str) -> None:
    """By the law of cosines in the triangle of coupler, rocker and diagonal, acute and obtuse."""
    a, b, c, d = (np.array(p) for p in CRANK_ROCKER)
    crank, coupler, rocker, ground = (np.linalg.norm(x) for x in (b - a, c - b, c - d, d - a))
    turn = np.linspace(0.0, 2.0 * np.pi, 37)
    k = four_bar(CRANK_ROCKER).kinematics({"A": turn}, coordinates=coordinates)
    angle = turn + np.arctan2(*(b - a)[::-1]) - np.arctan2(*(d - a)[::-1])
    diagonal = crank**2 + ground**2 - 2.0 * crank * ground * np.cos(angle)
    expected = np.arccos((coupler**2 + rocker**2 - diagonal) / (2.0 * coupler * rocker))
    assert np.abs(k.transmission("B", "D") - expected).max() < 1e-12
    assert expected.min() < np.pi / 2 < expected.max()


def test_dead_points_of_a_crank_rocker_are_where_crank_and_coupler_line_up() -> None:
    a, b, c, d = (np.array(p) for p in CRANK_ROCKER)
    crank, coupler, rocker, ground = (np.linalg.norm(x) for x in (b - a, c - b, c - d, d - a))
    k = four_bar(CRANK_ROCKER).kinematics({"A": np.linspace(0.0, 2.0 * np.pi, 32)})
    dead = [point for point in k.dead_points if point.joint == "D"]
    found = sorted(point.goals["A"] for point in dead)
    drawn = np.arctan2(*(b - a)[::-1])
    # A, C, D are a triangle with the side coupler -+ crank
    expected = []
    for extent, flip in ((coupler + crank, 0.0), (coupler - crank, np.pi)):
        angle = np.arccos((extent**2 + ground**2 - rocker**2) / (2.0 * extent * ground))
        expected.append((angle + flip - drawn) % (2.0 * np.pi))
    assert np.abs(np.array(found) - sorted(expected)).max() < 1e-13
    for point in dead:
        there = four_bar(CRANK_ROCKER).kinematics({"A": point.goals["A"]})
        assert abs(there.ratio("D")[0]) < 1e-13 and abs(there.joint("D").position[0, 0] - point.value) < 1e-15


@pytest.mark.parametrize("points, goal", [(DOUBLE_ROCKER, "A"), (CRANK_ROCKER, "D")])
def test_limits_are_where_the_other_links_line_up(points: Any, goal: str) -> None:
    m = four_bar(points)
    a, b, c, d = (np.array(p) for p in points)
    crank, coupler, rocker, ground = (np.linalg.norm(x) for x in (b - a, c - b, c - d, d - a))
    k = m.kinematics({goal: np.linspace(-np.pi, np.pi, 64)}, rates={goal: 1.0})
    assert 5 < k.reached.sum() < 60
    ends = np.sort([limit.goals[goal] for limit in k.limits])
    assert len(ends) == 2 and all(limit.located for limit in k.limits)
    for limit in k.limits:
        again = m.kinematics({goal: limit.goals[goal]}, near=limit.state)
        assert again.status[0] == "undetermined" and np.isnan(again.v).all() and "do not determine" in again.notes[0]
    inside = k._study.values[k.reached, 0]
    assert ends[0] < inside.min() and ends[1] > inside.max()
    # the driven link closes a triangle with the ground and the other two links in line, stretched or folded
    own, other = (crank, rocker) if goal == "A" else (rocker, crank)
    link = (b - a) if goal == "A" else (c - d)
    drawn = np.arctan2(link[1], link[0])
    axis = 0.0 if goal == "A" else np.pi
    expected = []
    for extent in (coupler + other, abs(coupler - other)):
        cosine = (own**2 + ground**2 - extent**2) / (2.0 * own * ground)
        if abs(cosine) <= 1.0:
            expected += [axis + np.arccos(cosine) - drawn, axis - np.arccos(cosine) - drawn]
    gap = [min(abs((end - x + np.pi) % (2 * np.pi) - np.pi) for x in expected) for end in ends]
    assert max(gap) < 1e-14 * 10
    # unreached poses are NaN everywhere, and say why
    out = int(np.flatnonzero(~k.reached)[0])
    assert np.isnan(k.v[out]).all() and np.isnan(k.joint("D").velocity[out]).all() and np.isnan(k.ratio("C", goal)[out])
    assert "cannot be reached" in k.reasons[out]
    with pytest.raises(ArgumentError, match="was not reached"):
        k.state(out)


def test_relative_and_absolute_coordinates_agree() -> None:
    m, turn = four_bar(GENERAL), np.linspace(0.0, 0.6, 7)
    one, other = (
        m.kinematics({"A": turn}, rates={"A": 2.0}, accelerations={"A": 1.0}, coordinates=word)
        for word in ("relative", "absolute")
    )
    for name in "ABCD":
        a, b = one.joint(name), other.joint(name)
        assert np.abs(a.position - b.position).max() < 1e-12
        assert np.abs(a.velocity - b.velocity).max() < 1e-11
        assert np.abs(a.acceleration - b.acceleration).max() < 1e-10
    assert np.abs(one.ratio("D", "A") - other.ratio("D", "A")).max() < 1e-12


def test_a_driven_run_moves_like_the_study_of_the_same_motion() -> None:
    turn, t = (lambda t: 0.4 * np.sin(3.0 * t)), np.linspace(0.0, 1.0, 21)
    m = four_bar(GENERAL)
    k = m.kinematics({"A": turn(t)}, rates={"A": 1.2 * np.cos(3.0 * t)}, accelerations={"A": -3.6 * np.sin(3.0 * t)})
    m.add_drive("A", position=turn)
    run = m.simulate(1.0, t_eval=t, initial=m.assemble(rates=None))
    for name in "ABCD":
        a, b = k.joint(name), run.joint(name)
        assert np.abs(a.position - b.position).max() < 1e-10
        assert np.abs(a.velocity - b.velocity).max() < 1e-10
        assert np.abs(a.acceleration - b.acceleration).max() < 1e-10
    coupler = run.body("coupler")
    assert np.abs(coupler.point_acceleration((0.6, 0, 0)) - k.point("coupler", (0.6, 0, 0)).acceleration).max() < 1e-10


def test_accelerations_are_the_differences_of_velocities() -> None:
    m, h, w = four_bar(CRANK_ROCKER), 1e-4, 2.0
    turn = np.linspace(0.0, 6.0, 13)
    many = (turn[:, None] + w * h * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])).ravel()
    k = m.kinematics({"A": many}, rates={"A": w})
    curve = k.point("coupler", (0.5, 0.2, 0.0))
    for value, rate in ((curve.position, curve.velocity), (curve.velocity, curve.acceleration)):
        at = value.reshape(len(turn), 5, 3)
        slope = (at[:, 0] - 8.0 * at[:, 1] + 8.0 * at[:, 3] - at[:, 4]) / (12.0 * h)
        assert np.abs(slope - rate.reshape(len(turn), 5, 3)[:, 2]).max() < 1e-9


def test_goals_may_be_joints_that_close_loops_and_points() -> None:
    m, turn = four_bar(CRANK_ROCKER), np.linspace(0.0, 0.25, 6)  # before the first dead point of D
    k = m.kinematics({"A": turn}, rates={"A": 2.0}, accelerations={"A": 0.5})
    for name in "BCD":
        seen = k.joint(name)
        x, v, a = (part[:, 0] for part in (seen.position, seen.velocity, seen.acceleration))
        other = m.kinematics({name: x}, rates={name: v}, accelerations={name: a})
        assert np.abs(other.joint("A").position[:, 0] - turn).max() < 1e-11
        assert np.abs(other.joint("A").velocity[:, 0] - 2.0).max() < 1e-10
        assert np.abs(other.joint("A").acceleration[:, 0] - 0.5).max() < 1e-9
    tip = ("coupler", (0.4, 0.1, 0.0), "y")
    curve = k.point("coupler", (0.4, 0.1, 0.0))
    x, v, a = (part[:, 1] for part in (curve.position, curve.velocity, curve.acceleration))
    other = m.kinematics({tip: x}, rates={tip: v}, accelerations={tip: a})
    assert np.abs(other.joint("A").acceleration[:, 0] - 0.5).max() < 1e-9
    assert np.abs(other.ratio("A", tip) * k.ratio(tip, "A") - 1.0).max() < 1e-11
    # rates of joints that are no goals determine the motion as well
    same = m.kinematics({"A": turn}, rates={"D": k.joint("D").velocity[:, 0]})
    assert np.abs(same.joint("A").velocity[:, 0] - 2.0).max() < 1e-11
    assert np.abs(same.ratio("D", "A") - k.ratio("D", "A")).max() < 1e-12


def five_bar() -> pt.Mechanism:
    m = pt.Mechanism("five-bar")
    a, b, c, d, e = (0, 0, 0), (-0.3, 0.8, 0), (0.5, 1.7, 0), (1.3, 0.8, 0), (1, 0, 0)
    rods = [m.add_rod(n, start=s, end=t, mass=1.0) for n, s, t in (("l", a, b), ("p", b, c), ("q", d, c), ("r", e, d))]
    joints = (("A", m.ground, rods[0], a), ("B", rods[0], rods[1], b), ("C", rods[1], rods[2], c))
    for name, parent, child, point in (*joints, ("D", rods[3], rods[2], d), ("E", m.ground, rods[3], e)):
        m.add_revolute(name, parent, child, point=point)
    return m


def test_ratios_of_several_goals_hold_the_others() -> None:
    m, h = five_bar(), 1e-5
    k = m.kinematics({"A": 0.1 + h * np.array([0, 1, -1, 0, 0]), "E": 0.2 + h * np.array([0, 0, 0, 1, -1])})
    c = k.joint("C").position[:, 0]
    assert abs(k.ratio("C", "A")[0] - (c[1] - c[2]) / (2 * h)) < 1e-9
    assert abs(k.ratio("C", "E")[0] - (c[3] - c[4]) / (2 * h)) < 1e-9
    assert np.abs(k.ratio("A", "A") - 1.0).max() < 1e-14 and np.abs(k.ratio("A", "E")).max() < 1e-14
    moving = m.kinematics({"A": 0.1, "E": 0.2}, rates={"A": 2.0, "E": -1.0})
    assert abs(moving.joint("C").velocity[0, 0] - 2.0 * k.ratio("C", "A")[0] + k.ratio("C", "E")[0]) < 1e-12
    with pytest.raises(ArgumentError, match="say by which"):
        k.ratio("C")
    with pytest.raises(ArgumentError, match="none of the 2 goals"):
        k.ratio("C", "B")
    # the limit of one goal, the other held: the rods p and q in line
    reached = m.kinematics({"A": np.linspace(0.0, 2.0, 16), "E": -0.5})
    (limit,) = reached.limits
    there = m.kinematics(limit.goals, near=limit.state)
    gap = np.linalg.norm(there.joint("B").point[0] - there.joint("D").point[0])
    assert limit.located and abs(gap - 2.0 * np.hypot(0.8, 0.9)) < 1e-14


def stewart() -> tuple[pt.Mechanism, Array, Array]:
    """A platform on six legs with universal, prismatic and ball joints; and both ends of the legs."""
    m = pt.Mechanism("platform", gravity=(0, 0, -9.81))
    angle = np.radians([10, 110, 130, 230, 250, 350])
    base = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], 1)
    angle = np.radians([50, 70, 170, 190, 290, 310])
    top = np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.zeros(6)], 1)
    plate = m.add_body("plate", mass=5.0, inertia=(1, 1, 2), position=(0, 0, 1.2))
    for i in range(6):
        start, end = base[i], top[i] + [0, 0, 1.2]
        axis = (end - start) / np.linalg.norm(end - start)
        middle = start + 0.5 * (end - start)
        low = m.add_rod(f"low{i}", start=start, end=middle, mass=0.3)
        high = m.add_rod(f"high{i}", start=middle, end=end, mass=0.3)
        across = np.cross(axis, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        m.add_universal(f"U{i}", m.ground, low, point=start, axis1=across, axis2=np.cross(axis, across))
        m.add_prismatic(f"leg{i}", low, high, point=middle, axis=axis)
        m.add_spherical(f"S{i}", high, plate, point=end)
    return m, base, top


def test_a_platform_is_placed_by_its_frame() -> None:
    m, base, top = stewart()
    drawn = np.linalg.norm(top + np.array([0, 0, 1.2]) - base, axis=1)
    s = np.linspace(0.0, 1.0, 9)
    place = np.stack([0.1 * np.sin(2 * s), 0.15 * s, 1.2 + 0.1 * s], 1)
    turn = Rotation.from_rotvec(np.stack([0.3 * s, -0.2 * s, 0.4 * s], 1))
    frame = ("plate", (0, 0, 0))

    def legs(turn: Rotation, place: Array) -> Array:
        return np.linalg.norm(turn.apply(top) + place - base, axis=1) - drawn

    poses = m.assemble_many({frame: (place, turn)})
    assert poses.ok.all()
    for i in range(len(s)):
        found = np.array([poses.joint(f"leg{j}")[i] for j in range(6)])
        assert np.abs(found - legs(turn[i], place[i])).max() < 1e-12
    assert np.abs(poses.body("plate").rotation - turn.as_matrix()).max() < 1e-12
    state = m.assemble({frame: (place[4], turn[4].as_quat()[[3, 0, 1, 2]])})
    assert np.abs([state.position(f"leg{j}") - legs(turn[4], place[4])[j] for j in range(6)]).max() < 1e-12
    assert max(abs(x["reached"] - x["asked"]) for x in state.assembly["targets"]) < 1e-11
    # rates: the velocity of each end of a leg along the leg
    omega, velocity = np.array([0.3, -0.5, 0.7]), np.array([0.2, 0.1, -0.4])
    k = m.kinematics({frame: (place, turn)}, rates={frame: (velocity, omega)})
    assert k.reached.all() and (k.status == "reached").all()
    for i in (0, 8):
        arms = turn[i].apply(top)
        line = arms + place[i] - base
        line /= np.linalg.norm(line, axis=1)[:, None]
        expected = np.sum(line * (velocity + np.cross(omega, arms)), axis=1)
        found = np.array([k.joint(f"leg{j}").velocity[i, 0] for j in range(6)])
        assert np.abs(found - expected).max() < 1e-11
    plate = k.body("plate")
    assert np.abs(plate.angular_velocity - omega).max() < 1e-12 and np.abs(plate.velocity - velocity).max() < 1e-12
    assert np.abs(plate.angular_acceleration).max() < 1e-10 and np.abs(plate.acceleration).max() < 1e-10


def test_a_rigid_transform_is_a_pose() -> None:
    """One or many, as goals and as drives: what SciPy has since 1.16."""
    transform = pytest.importorskip("scipy.spatial.transform")
    if not hasattr(transform, "RigidTransform"):
        pytest.skip("this SciPy has no RigidTransform")
    make = transform.RigidTransform.from_components
    m, _, _ = stewart()
    s = np.linspace(0.0, 1.0, 3)
    place = np.stack([0.1 * s, 0.15 * s, 1.2 + 0.1 * s], 1)
    turn = Rotation.from_rotvec(np.stack([0.3 * s, -0.2 * s, 0.4 * s], 1))
    frame = ("plate", (0, 0, 0))
    many, pairs = m.assemble_many({frame: make(place, turn)}), m.assemble_many({frame: (place, turn)})
    assert many.ok.all() and np.array_equal(many.q, pairs.q)
    one, pair = m.assemble({frame: make(place[2], turn[2])}), m.assemble({frame: (place[2], turn[2])})
    assert np.array_equal(one.q, pair.q)

    def driven(pose: Any) -> Array:
        plate = pt.Mechanism("plate")
        plate.add_drive(plate.add_body("p", mass=1.0, inertia=(1, 1, 1)), pose=pose)
        return np.asarray(plate.simulate(1.0, t_eval=[0.0, 0.3, 1.0]).body("p").rotation)

    assert np.array_equal(driven(make(place[2], turn[2])), driven((place[2], turn[2])))
    assert np.array_equal(driven((s, make(place, turn))), driven((s, place, turn)))

    def course(t: float) -> tuple[Array, Rotation]:
        return np.array([0.1 * t, 0.0, 0.0]), Rotation.from_rotvec([0.3 * t, -0.2 * t, 0.4 * t])

    assert np.abs(driven(lambda t: make(*course(t))) - driven(course)).max() < 1e-12


def test_orientations_may_turn_by_more_than_half_a_turn() -> None:
    m = pt.Mechanism("wrist")
    tool = m.add_body("tool", mass=1.0, inertia=(1, 1, 1))
    m.add_free("pose", m.ground, tool)
    for axis in ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.3, -0.5, 0.2)):
        unit = np.array(axis) / np.linalg.norm(axis)
        turn = Rotation.from_rotvec(np.linspace(-3.14, 3.14, 25)[:, None] * unit)
        poses = m.assemble_many({("tool", (0.1, 0.2, 0.3)): ((1.0, 0.0, 0.0), turn)})
        assert poses.ok.all()
        assert np.abs(poses.body("tool").rotation - turn.as_matrix()).max() < 1e-12


def test_a_rotation_that_moves_no_other_body_needs_no_goal() -> None:
    m = pt.catalogue.load("rssr")
    first = m.compile().names[0]
    k = m.kinematics({first: np.linspace(0.0, 0.5, 6)}, rates={first: 2.0})
    assert k.reached.all() and np.isfinite(k.vdot).all()
    assert any("move" in note and "no other body" in note for note in k.notes)


def test_singular_positions_have_no_rates_and_are_named() -> None:
    m = parallelogram(1.0)
    in_line = -1.0
    k = m.kinematics({"A": np.array([0.0, -0.5, in_line])}, rates={"A": 1.0})
    assert k.status[0] == k.status[1] == "reached"
    assert k.status[2] in ("undetermined", "singular", "open", "other branch")
    assert np.isnan(k.v[2]).all() and 2 in k.reasons


BAD: list[tuple[dict[Any, Any], dict[str, Any], str]] = [
    ({}, {}, "targets is empty"),
    ({"A": [0.0, np.nan]}, {}, "give finite numbers"),
    ({"A": 0.0, "D": 0.0}, {}, "2 goals .* for 1 degree of freedom"),
    ({"A": [0.0, 0.1]}, {"rates": {"A": [1.0, 2.0, 3.0]}}, "rates has 3 rows for 2 poses"),
    ({"A": [0.0, 0.1]}, {"rates": {"A": [1.0, np.inf]}}, "give finite numbers"),
    ({"A": [0.0, 0.1]}, {"rates": 3.0}, "must be a dict"),
    ({"A": [0.0, 0.1]}, {"rates": {"A": 1.0, "D": 5.0}}, "rates contradict each other at pose 0"),
    ({"A": [0.0, 0.1]}, {"rates": {"A": 1.0}, "accelerations": {"D": 1.0}}, "'D' has no rate"),
    ({("coupler", (0, 0, 0)): (np.eye(3), (0, 0, 0))}, {}, "position first"),
    ({("coupler", (0, 0, 0)): ((0, 0, 0), 2.0 * np.eye(3))}, {}, "not a rotation"),
]


@pytest.mark.parametrize("targets, more, words", BAD)
def test_what_does_not_fit_is_refused(targets: dict[Any, Any], more: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        four_bar(GENERAL).kinematics(targets, **more)


def test_other_refusals() -> None:
    m = five_bar()
    with pytest.raises(ArgumentError, match=r"1 goal .* for 2 degrees of freedom; name 1 more"):
        m.kinematics({"A": 0.0})
    with pytest.raises(ArgumentError, match=r"1 rate .* for 2 degrees of freedom"):
        m.kinematics({"A": 0.0, "E": 0.0}, rates={"C": 1.0})
    with pytest.raises(UnknownNameError, match="neither a joint"):
        m.kinematics({"Q": 0.0, "E": 0.0})
    k = m.kinematics({"A": 0.0, "E": 0.0})
    with pytest.raises(AttributeError, match="not forces"):
        _ = k.joint("A").force
    with pytest.raises(ArgumentError, match="transmission"):
        k.transmission("A", "E")
    with pytest.raises(ArgumentError, match="not 'reactions'"):
        k.plot("reactions")
    with pytest.raises(UnknownNameError):
        k.joint("Z")
    with pytest.raises((SingularityError, AssemblyError, ArgumentError)):
        parallelogram(0.0).kinematics({"A": 0.1})


def test_a_study_is_read_and_shown_like_a_result() -> None:
    m = four_bar(CRANK_ROCKER)
    m.add_sensor("tip", m.bodies["coupler"], "velocity")
    m.add_sensor("push", m.joints["C"], "force")
    k = m.kinematics({"A": np.linspace(0.0, 6.0, 25)}, rates={"A": 2.0})
    assert isinstance(k, Kinematics) and len(k) == 25 and k.title == "four-bar"
    assert k.sensor("tip").values.shape == (25, 3)
    with pytest.raises(ArgumentError, match="not forces"):
        k.sensor("push")
    assert "25 reached" in repr(k) and "margin" in k._repr_html_()
    assert [ax.get_xlabel() for ax in k.plot("coordinates").axes][-1] == "A [deg]"
    assert k.plot("paths", points={"P": ("coupler", (0.4, 0.1, 0.0))}).axes
    state = k.state(3)
    assert m.simulate(0.01, initial=state).success
    with pytest.raises(AttributeError):
        k.q = np.zeros(3)  # type: ignore[misc]


def geared(ratio: float, names: tuple[str, str, str] = ("A", "G", "K"), late: bool = False) -> pt.Mechanism:
    """A crank, a wheel that it turns by a gear, and a rack on the wheel; the joints in either order."""
    m = pt.Mechanism("gear", gravity=None)
    for name, at in (("a", (0, 0, 0)), ("g", (1, 0, 0)), ("k", (0, 0, 1))):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=at)
    calls = [
        lambda: m.add_revolute(names[0], m.ground, "a", (0, 0, 0)),
        lambda: m.add_revolute(names[1], m.ground, "g", (1, 0, 0), axis=(0, 0, 1)),
        lambda: m.add_prismatic(names[2], m.ground, "k", axis=(0, 0, 1)),
    ]
    for call in reversed(calls) if late else calls:
        call()
    m.add_gear(names[0], names[1], ratio=ratio)
    m.add_rack(names[1], names[2], radius=0.2)
    return m


@pytest.mark.parametrize("ratio", [0.7137, -1.6180339887, 0.5, math.pi])
def test_a_gear_without_a_common_period_keeps_its_phase(ratio: float) -> None:
    """In absolute coordinates whole turns are not known, so that such a gear constrains rates alone there."""
    for late, end in ((False, 0.3), (True, 2.0), (False, -9.0)):
        m, turn = geared(ratio, ("crank", "wheel", "rack") if late else ("A", "G", "K"), late), np.linspace(0.0, end, 7)
        crank, wheel, rack = m.joints
        crank, wheel, rack = (rack, wheel, crank) if late else (crank, wheel, rack)
        for coordinates in ("relative", "absolute"):
            k = m.kinematics({crank: turn}, rates={crank: 1.0}, coordinates=coordinates)
            assert k.success
            off = k.joint(wheel).position[:, 0] - ratio * turn
            assert np.max(np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)))) < 1e-9
            assert np.max(np.abs(k.joint(rack).position[:, 0] - 0.2 * ratio * turn)) < 1e-9
            assert np.max(np.abs(k.joint(wheel).velocity[:, 0] - ratio)) < 1e-9
            found = m.workspace({crank: turn}, actuators=[crank], coordinates=coordinates, of=("k", (0, 0, 0)))
            assert np.max(np.abs(found.positions[:, 2] - 1.0 - 0.2 * ratio * turn)) < 1e-9


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(("angle", "end"), [(0.8, 0.8), (-0.3, 0.8), (1.1, 0.4), (2.5, 0.4)])
def test_goals_next_to_a_dead_point_are_met(angle: float, end: float, coordinates: str) -> None:
    """A piston 1e-7 m before its dead point has its crank 0.05 degrees from it: far from singular."""
    crank, rod = 0.2, 0.6
    pin = np.array([crank * math.cos(angle), crank * math.sin(angle), 0.0])
    piston = np.array([pin[0] + math.sqrt(rod**2 - pin[1] ** 2), 0.0, 0.0])
    m = pt.Mechanism("slider-crank", gravity=None)
    m.add_rod("crank", start=(0, 0, 0), end=pin, mass=1.0)
    m.add_rod("rod", start=pin, end=piston, mass=1.0)
    m.add_body("piston", mass=1.0, inertia=(1, 1, 1), position=piston)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "rod", point=pin)
    m.add_revolute("C", "rod", "piston", point=piston)
    m.add_prismatic("P", m.ground, "piston", point=piston, axis=(1, 0, 0))
    short = 10.0 ** -np.arange(3, 8)
    at = end + np.sign(0.6 - end) * short
    k = m.kinematics({"P": at - piston[0]}, rates={"P": 1.0}, coordinates=coordinates)
    assert k.reached.all()
    # the law of cosines, without cancellation next to the dead point
    along = (crank**2 + at**2 - rod**2) / (2.0 * crank * at)
    right = np.arccos(along)
    assert np.abs(angle + k.joint("A").position[:, 0]) == pytest.approx(right, abs=1e-9)
    near = m.assemble({"P": at[-1] - piston[0]}, coordinates=coordinates)
    assert abs(angle + near.position("A")) == pytest.approx(right[-1], abs=1e-9)
    # beyond it nothing is reached
    beyond = m.kinematics({"P": 2.0 * end - at[:2] - piston[0]}, coordinates=coordinates)
    assert not beyond.reached.any()
