"""Joints and bodies driven by their pose: any angle, in the tree, closing a loop, in absolute coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import partita as pt
from partita.errors import DescriptionError, EvaluationError

BOTH = pytest.mark.parametrize("coordinates", ["relative", "absolute"])
TIMES = np.linspace(0.0, 3.0, 13)
INERTIA, MASS, COM = np.diag([0.1, 0.2, 0.25]), 2.0, np.array([0.1, 0.05, -0.02])
SPIN, TILT = np.array([0.4, -0.7, 0.9]), np.array([0.3, -0.4, 0.5])


def place(t: Any) -> list[Any]:
    return [0.2 * np.sin(3.0 * t), 0.1 * t * t, 0.05 * np.cos(t)]


def turn(t: Any) -> list[Any]:
    """About one axis, faster and faster, by more than two turns: the angular velocity is its rate at every time."""
    return [x * (2.0 * t + t * t) for x in SPIN]


def wrench(t: float, drawn: Rotation, origin: np.ndarray, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Newton and Euler: what must act on the body, its moment about its origin."""
    r = Rotation.from_rotvec(turn(t)) * drawn
    w, alpha = SPIN * (2.0 + 2.0 * t), SPIN * 2.0
    arm = r.apply(COM)
    a = np.array([-1.8 * np.sin(3.0 * t), 0.2, -0.05 * np.cos(t)])
    a = a + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
    force = MASS * (a - gravity)
    inertia = r.as_matrix() @ INERTIA @ r.as_matrix().T
    return force, inertia @ alpha + np.cross(w, inertia @ w) + np.cross(arm, force)


def forms(drawn: Rotation) -> dict[str, Any]:
    def quaternion(t: Any) -> list[Any]:
        angle, axis = (2.0 * t + t * t) * np.linalg.norm(SPIN) / 2.0, SPIN / np.linalg.norm(SPIN)
        return [np.cos(angle), *(x * np.sin(angle) for x in axis)]

    def matrix(t: Any) -> Any:
        w, x, y, z = quaternion(t)
        return [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]

    return {
        "vector": turn,
        "quaternion": quaternion,
        "matrix": matrix,
        "rotation": lambda t: Rotation.from_rotvec(np.array(turn(float(t)))),
    }


@BOTH
@pytest.mark.parametrize(("cut", "form"), [("auto", "vector"), ("always", "quaternion"), ("auto", "matrix")])
def test_a_free_joint_goes_through_its_poses(coordinates: str, cut: str, form: str) -> None:
    drawn, gravity = Rotation.from_rotvec(TILT), np.array([0.0, 0.0, -9.81])
    m = pt.Mechanism("flight", gravity=gravity)
    kite = m.add_body("kite", mass=MASS, inertia=INERTIA, com=COM, position=(1, 2, 3), orientation=drawn)
    if cut == "always":
        m.add_free("carrier", m.ground, kite, cut="never")
    joint = m.add_free("F", m.ground, kite, cut=cut)
    law = forms(drawn)[form]
    m.add_drive(joint, pose=lambda t: (place(t), law(t)))
    run = m.simulate(3.0, t_eval=TIMES, coordinates=coordinates)
    assert run.success and not any("differences" in str(w) for w in run.notes)
    read = run.joint("F")
    assert np.abs(read.position[:, :3] - np.array([place(t) for t in TIMES])).max() < 1e-12
    away = Rotation.from_quat(read.position[:, [4, 5, 6, 3]]).inv() * Rotation.from_rotvec([turn(t) for t in TIMES])
    assert away.magnitude().max() < 1e-12
    own = Rotation.from_rotvec([turn(t) for t in TIMES])
    assert np.abs(own.apply(read.velocity[:, 3:]) - np.outer(2.0 + 2.0 * TIMES, SPIN)).max() < 1e-11
    wanted = [wrench(t, drawn, np.zeros(3), gravity) for t in TIMES]
    # of forces of some hundred newtons, round-off
    assert np.abs(read.force - [f for f, _ in wanted]).max() < 1e-10
    assert np.abs(read.moment - [n for _, n in wanted]).max() < 1e-10
    # efforts along the degrees of freedom: slides in the world, turns in the axes of the child
    assert np.abs(own.apply(read.drive[:, 3:]) - read.moment).max() < 1e-10
    assert np.abs(read.drive[:, :3] - read.force).max() < 1e-10


@BOTH
def test_a_body_is_driven_in_the_world(coordinates: str) -> None:
    drawn = Rotation.from_rotvec(TILT)
    m = pt.Mechanism("hand", gravity=(0, 0, -9.81))
    gripper = m.add_body("hand", mass=MASS, inertia=INERTIA, com=COM, position=(1, 2, 3), orientation=drawn)
    m.add_drive(gripper, pose=lambda t: (place(t), Rotation.from_rotvec(np.array(turn(float(t)))) * drawn))
    run = m.simulate(0.5, t_eval=TIMES[:3], coordinates=coordinates)
    assert run.success and any("differences" in str(note) for note in run.notes)
    assert np.abs(run.body("hand").position - np.array([place(t) for t in TIMES[:3]])).max() < 1e-12
    wanted = [wrench(t, drawn, np.zeros(3), np.array([0, 0, -9.81])) for t in TIMES[:3]]
    # second derivatives by differences are good to about 1e-11 of what they are of
    assert np.abs(run.joint("pose of hand").force - [f for f, _ in wanted]).max() < 1e-8
    assert np.abs(run.joint("pose of hand").moment - [n for _, n in wanted]).max() < 1e-8


@BOTH
def test_two_rows_of_a_table_are_a_steady_motion(coordinates: str) -> None:
    m = pt.Mechanism("tool", gravity=(0, 0, 0))
    tool = m.add_body("tool", mass=MASS, inertia=INERTIA)
    m.add_drive(tool, pose=([0.0, 2.0], [(0, 0, 0), (1, 0, 2)], Rotation.from_rotvec([(0, 0, 0), (0, 3.0, 0)])))
    run = m.simulate(2.0, t_eval=[0.0, 0.7, 2.0], coordinates=coordinates)
    assert run.success
    assert np.abs(run.joint("pose of tool").velocity - [0.5, 0, 1, 0, 1.5, 0]).max() < 1e-12
    # nothing is accelerated, and the body turns about a principal axis: nothing pushes
    assert np.abs(run.joint("pose of tool").drive).max() < 1e-10


@BOTH
def test_a_table_follows_what_it_was_sampled_from(coordinates: str) -> None:
    # a rotation spline of 400 rows errs by the fourth power of 1/400 in angles, by the second in accelerations
    times = np.linspace(0.0, 3.0, 400)
    m = pt.Mechanism("ball")
    ball = m.add_body("ball", mass=MASS, inertia=INERTIA, com=COM)
    m.add_spherical("S", m.ground, ball, point=(0, 0, 0))
    law = Rotation.from_rotvec([[np.sin(t), 0.4 * t * t, np.cos(2 * t)] for t in times])
    m.add_drive("S", pose=(times, law), interpolation="spline")
    run = m.simulate(3.0, t_eval=TIMES[2:10], coordinates=coordinates)
    assert run.success
    quaternion = run.joint("S").position
    there = Rotation.from_rotvec([[np.sin(t), 0.4 * t * t, np.cos(2 * t)] for t in TIMES[2:10]])
    assert (Rotation.from_quat(quaternion[:, [1, 2, 3, 0]]).inv() * there).magnitude().max() < 1e-7
    # the law by a function, through which the accelerations are exact
    twin = pt.Mechanism("twin")
    ball = twin.add_body("ball", mass=MASS, inertia=INERTIA, com=COM)
    twin.add_spherical("S", twin.ground, ball, point=(0, 0, 0))
    twin.add_drive("S", pose=lambda t: [np.sin(t), 0.4 * t * t, np.cos(2 * t)])
    other = twin.simulate(3.0, t_eval=TIMES[2:10], coordinates=coordinates)
    for kind in ("velocity", "moment", "force"):
        mine, exact = getattr(run.joint("S"), kind), getattr(other.joint("S"), kind)
        assert np.abs(mine - exact).max() < 2e-4 * np.abs(exact).max(), kind


@BOTH
@pytest.mark.parametrize("angle", [3.0, np.pi])
@pytest.mark.parametrize("cut", ["auto", "always"])
def test_a_drawing_is_turned_to_where_it_is_driven(coordinates: str, angle: float, cut: str) -> None:
    """From as drawn up to the opposite orientation, and not to the one in which a sine vanishes as well."""
    m = pt.Mechanism("turned")
    ball = m.add_body("ball", mass=1.0, inertia=(1, 2, 2.5))
    if cut == "always":
        m.add_free("carrier", m.ground, ball, cut="never")
    m.add_spherical("S", m.ground, ball, point=(0, 0, 0), cut=cut)
    held = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8]))
    m.add_drive("S", pose=held)
    run = m.simulate(0.1, coordinates=coordinates)
    assert run.success
    q = run.joint("S").position[-1]
    assert (Rotation.from_quat(q[[1, 2, 3, 0]]).inv() * held).magnitude() < 1e-9


@BOTH
def test_a_ball_from_the_body_to_the_ground(coordinates: str) -> None:
    """The joint walked from child to parent: its pose is how the ground is turned, seen from the body."""
    runs = []
    for parent, child, sign in (("ground", "ball", 1.0), ("ball", "ground", -1.0)):
        m = pt.Mechanism("ball")
        m.add_body("ball", mass=MASS, inertia=INERTIA, com=COM, position=(0.1, 0, 0))
        m.add_spherical("S", parent, child, point=(0, 0, 0))
        m.add_drive("S", pose=lambda t, sign=sign: [sign * x for x in turn(t)])
        runs.append(m.simulate(3.0, t_eval=TIMES, coordinates=coordinates))
    there, back = runs
    assert there.success and back.success
    assert np.abs(there.body("ball").position - back.body("ball").position).max() < 1e-12
    assert np.abs(there.joint("S").moment).max() > 1.0
    assert np.abs(there.joint("S").moment + back.joint("S").moment).max() < 1e-10
    assert np.abs(there.joint("S").force + back.joint("S").force).max() < 1e-10


@BOTH
def test_angular_velocities_of_a_ball_are_driven(coordinates: str) -> None:
    """A top that is held to a steady precession by its rates alone, two of them driven and one free."""
    m = pt.Mechanism("top")
    top = m.add_body("top", mass=1.0, inertia=(0.2, 0.2, 0.3))
    m.add_spherical("S", m.ground, top, point=(0, 0, 0))
    m.add_drive("S", velocity=lambda t: 2.0 * np.cos(t), coordinate=0)
    m.add_drive("S", velocity=lambda t: 2.0 * np.sin(t), coordinate=1, name="second")
    start = m.assemble(rates={"S": [2.0, 0.0, 1.0]})
    run = m.simulate(2.0, initial=start, t_eval=[0.0, 1.0, 2.0], coordinates=coordinates)
    assert run.success
    w = run.joint("S").velocity
    assert np.abs(w - np.column_stack([2 * np.cos(run.t), 2 * np.sin(run.t), np.ones(3)])).max() < 1e-8
    # Euler's equations in the axes of the body
    a, b, c = 0.2, 0.2, 0.3
    needed = np.column_stack(
        [
            a * -2 * np.sin(run.t) + (c - b) * w[:, 1] * w[:, 2],
            b * 2 * np.cos(run.t) + (a - c) * w[:, 2] * w[:, 0],
            0 * run.t,
        ]
    )
    assert np.abs(run.joint("S").drive - needed).max() < 1e-7


FEET = np.array([[np.cos(x), np.sin(x), 0.0] for x in np.radians([-10, 10, 110, 130, 230, 250])])
BALLS = 0.6 * np.array([[np.cos(x), np.sin(x), 0.0] for x in np.radians([-50, 50, 70, 170, 190, 290])])


def platform_pose(t: Any) -> tuple[list[Any], list[Any]]:
    return [0.1 * np.sin(2 * t), 0.05 * t, 0.9 + 0.1 * np.cos(3 * t)], [0.2 * np.sin(t), 0.1 * np.sin(3 * t), 0.3 * t]


def length(i: int) -> Any:
    """Length of leg i at a pose, by the formula of Rodrigues, in arithmetic that carries derivatives."""

    def law(t: Any) -> Any:
        p, r = platform_pose(t)
        angle2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + 1e-300
        angle = np.sqrt(angle2)
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2
        b = BALLS[i]
        cross = lambda u, v: [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]  # noqa: E731
        one = cross(r, b)
        two = cross(r, one)
        gap = [p[k] + b[k] + s * one[k] + c * two[k] - FEET[i][k] for k in range(3)]
        return np.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])

    return law


@BOTH
def test_inverse_dynamics_of_a_stewart_platform(coordinates: str) -> None:
    """The effort of the pose, shared by six legs: their forces by the transposed inverse of the legs' Jacobian, and by
    six driven lengths."""
    times = np.linspace(0.2, 1.4, 5)

    def platform() -> tuple[pt.Mechanism, Any]:
        m = pt.Mechanism("platform", gravity=(0, 0, -9.81))
        return m, m.add_body("table", mass=20.0, inertia=(1.0, 1.2, 2.0), com=(0.02, -0.03, 0.05), position=(0, 0, 1))

    m, table = platform()
    m.add_drive(table, pose=platform_pose)
    posed = m.simulate(1.5, t_eval=times, coordinates=coordinates)
    assert posed.success
    force, moment = posed.joint("pose of table").force, posed.joint("pose of table").moment
    legs, body = platform()
    for i in range(6):
        legs.add_drive(pt.Distance(legs.ground, FEET[i], body, BALLS[i]), position=length(i), name=f"leg {i}")
    # the drawing lies above the start, on the branch of the pose
    driven = legs.simulate(1.5, t_eval=times, coordinates=coordinates)
    assert driven.success
    assert np.abs(driven.body("table").position - posed.body("table").position).max() < 1e-10
    lifts = []
    for k, t in enumerate(times):
        p, r = platform_pose(t)
        arms = Rotation.from_rotvec(r).apply(BALLS)
        units = np.array(p) + arms - FEET
        units /= np.linalg.norm(units, axis=1)[:, None]
        jacobian = np.hstack([units, np.cross(arms, units)])
        lifts.append(np.linalg.solve(jacobian.T, np.concatenate([force[k], moment[k]])))
    model = legs.compile(coordinates=coordinates)
    efforts = np.array(
        [model.acceleration(q, v, t=t)[1][-6:] for t, q, v in zip(times, driven.q, driven.v, strict=True)]
    )
    assert np.abs(efforts - lifts).max() < 1e-8 * np.abs(lifts).max()


def test_poses_in_files(tmp_path: Path) -> None:
    m = pt.Mechanism("kept")
    first = m.add_body("first", mass=1.0, inertia=(1, 1, 1))
    second = m.add_body("second", mass=1.0, inertia=(1, 1, 1))
    m.add_spherical("S", m.ground, first, point=(0, 0, 0))
    m.add_drive("S", pose=([0.0, 1.0, 2.0], Rotation.from_rotvec([(0, 0, 0), (1, 2, 0), (0, 2, 2)])))
    m.add_free("F", first, second)
    m.add_drive("F", pose=((1, 2, 3), (0, 0, 1)))
    m.save(tmp_path / "kept.toml")
    again = pt.load(tmp_path / "kept.toml")
    assert again.to_spec() == m.to_spec()
    m.add_body("third", mass=1.0, inertia=(1, 1, 1))
    m.add_drive("third", pose=lambda t: ((t, 0, 0), (0, 0, t)))
    with pytest.raises(DescriptionError, match="Python function, which a file cannot contain"):
        m.save(tmp_path / "no.toml")


def test_poses_that_cannot_be() -> None:
    m = pt.Mechanism("no")
    body = m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("R", m.ground, body, point=(0, 0, 0))
    other = m.add_body("c", mass=1.0, inertia=(1, 1, 1))
    m.add_spherical("S", m.ground, other, point=(0, 0, 0))
    refused = [
        ({"joint": "R", "pose": (0, 0, 1)}, "does not rotate about all axes"),
        ({"joint": "S", "pose": ((1, 2, 3), (0, 0, 1), (0, 0, 1), (0, 0, 0))}, "pose must be"),
        ({"joint": "S", "pose": ([0, 1], Rotation.from_rotvec([(0, 0, 0), (0, 0, np.pi)]))}, "half a turn"),
        ({"joint": "S", "pose": ([0, 1, 2], Rotation.from_rotvec([(0, 0, 0), (0, 0, 1)]))}, "3 times but 2"),
        ({"joint": "S", "pose": np.diag([1, 1, -1])}, "reflection"),
        ({"joint": "S", "pose": (0, 0, 1), "velocity": 1.0}, "omit position, velocity"),
        ({"joint": "S", "position": 1.0}, "give its pose"),
        ({"joint": body, "position": 1.0}, "no single coordinate"),
        ({"joint": m.ground, "pose": ((0, 0, 0), (0, 0, 1))}, "does not move"),
    ]
    for given, words in refused:
        with pytest.raises(DescriptionError, match=words):
            m.add_drive(**given)
    with pytest.raises(EvaluationError, match="must return an orientation"):
        m.add_drive("S", pose=lambda t: (t, t))
    with pytest.raises(EvaluationError, match="not a rotation"):
        m.add_drive("S", pose=lambda t: np.diag([1.0, 2.0, 1.0]))
    m.add_drive("S", pose=(0, 0, 1))
    with pytest.raises(DescriptionError, match="already driven"):
        m.add_drive("S", velocity=1.0, coordinate=2)
