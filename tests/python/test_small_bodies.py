"""Small bodies between two joints in one point: forces through them do not rotate them, whatever the rounding.

A planar delta of rigid hinges, a ball of no size between two of its three legs and the platform, drawn as programs do:
each point by products of frames along its own way, and where the loops close off by 5e-13 m.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import partita as pt

TURN = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3.0
BASE, ARM, FORE, PLATFORM = 0.11, 0.07, 0.093, 0.031
ORIGIN = np.array([0.4, -0.7, 1.3])
GEOMETRIC_ERROR = 5e-13


def at(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def elbow(leg: int, end: np.ndarray) -> tuple[float, float]:
    """Angles of arm and forearm that lead from the base to the platform."""
    gap = (end - at(2.1 * leg) @ (BASE, 0, 0))[:2]
    far, along = float(np.hypot(*gap)), float(np.arctan2(gap[1], gap[0]))
    bend = np.arccos((ARM**2 + far**2 - FORE**2) / (2 * ARM * far))
    tip = gap - ARM * np.array([np.cos(along + bend), np.sin(along + bend)])
    return along + bend, float(np.arctan2(tip[1], tip[0]))


def delta() -> pt.Mechanism:
    m = pt.Mechanism("delta", gravity=(1.0, -3.0, -9.0))
    axis = TURN @ (0, 0, 1)
    centre, turned = np.array([0.004, -0.006, 0.0]), 0.1
    platform = m.add_body("platform", mass=0.004, inertia=(1e-7, 2e-7, 2.5e-7), position=ORIGIN + TURN @ centre,
                          orientation=TURN @ at(turned))  # fmt: skip
    for leg in range(3):
        corner = at(2.1 * leg + turned) @ (PLATFORM, 0, 0)
        arm, fore = elbow(leg, centre + corner)
        foot = ORIGIN + TURN @ at(2.1 * leg) @ (BASE, 0, 0)
        knee = foot + TURN @ at(arm) @ (ARM, 0, 0)
        # the same point along two ways
        end = knee + (TURN @ at(fore)) @ (FORE, 0, 0)
        again = (ORIGIN + TURN @ (at(2.1 * leg) @ (BASE, 0, 0) + at(arm) @ (ARM, 0, 0))) + TURN @ (
            at(fore) @ (FORE, 0, 0)
        )
        for name, length, origin, angle in ((f"arm{leg}", ARM, foot, arm), (f"fore{leg}", FORE, knee, fore)):
            m.add_body(name, mass=0.003, inertia=(3e-8, 5e-7, 5e-7), com=(length / 2, 0, 0.001), position=origin,
                       orientation=TURN @ at(angle))  # fmt: skip
        m.add_revolute(f"A{leg}", m.ground, f"arm{leg}", point=foot, axis=axis)
        m.add_revolute(f"B{leg}", f"arm{leg}", f"fore{leg}", point=knee, axis=axis)
        there = ORIGIN + TURN @ (centre + corner + GEOMETRIC_ERROR * np.array([1.0, -leg, 0.0]))
        if leg == 0:
            m.add_revolute("C0", "fore0", platform, point=again, child_point=there, axis=axis)
            continue
        ball = m.add_body(f"ball{leg}", mass=6.5e-6, inertia=1.6e-11 * np.eye(3), position=end)
        m.add_revolute(f"C{leg}", f"fore{leg}", ball, point=end, axis=axis)
        m.add_revolute(f"D{leg}", ball, platform, point=again, child_point=there, axis=axis)
    return m


def accelerations(m: pt.Mechanism, pose: dict[str, float]) -> dict[str, float]:
    """By velocity, at rest in a pose."""
    model = m.compile()
    found, _ = model.acceleration([pose[name] for name in model.names], np.zeros(len(model.velocity_names)))
    return dict(zip(model.velocity_names, found.tolist(), strict=True))


def off(m: pt.Mechanism, other: pt.Mechanism) -> float:
    """How far accelerations are apart, in parts of the largest."""
    start = m.assemble()
    pose = dict(zip(m.compile().names, start.q.tolist(), strict=True))
    here, there = accelerations(m, pose), accelerations(other, pose)
    assert set(here) == set(there)
    return max(abs(here[name] - there[name]) for name in here) / max(map(abs, here.values()))


def shaken(m: pt.Mechanism, seed: int) -> pt.Mechanism:
    """The same drawing, another last digit in each coordinate of each point."""
    rng = np.random.default_rng(seed)

    def other(point: np.ndarray | None) -> np.ndarray | None:
        return None if point is None else point * (1.0 + np.finfo(float).eps * rng.choice([-1.0, 0.0, 1.0], 3))

    for name, joint in list(m._description.joints.items()):
        m._description.joints[name] = replace(joint, point=other(joint.point), child_point=other(joint.child_point))
    return m


def test_accelerations_do_not_hang_on_the_last_digits_of_the_drawing() -> None:
    m = delta()
    points = m._description.joints
    assert any(not np.array_equal(points[f"C{leg}"].point, points[f"D{leg}"].point) for leg in (1, 2))
    assert m.compile().mobility == 5  # three of the platform, and each ball may spin
    for seed in range(3):
        assert off(m, shaken(delta(), seed)) < 1e-12


def test_the_balls_do_not_spin() -> None:
    """No moment acts on a ball that hinges hold in its centre: at rest its own acceleration is nothing."""
    m = delta()
    start = m.assemble()
    found = accelerations(m, dict(zip(m.compile().names, start.q.tolist(), strict=True)))
    for leg in (1, 2):
        turned = sum(found[f"{word}{leg}"] for word in "ABC")
        assert abs(turned) < 1e-12 * max(map(abs, found.values()))


def test_parameters_that_are_said_again_change_no_digit() -> None:
    model = delta().compile()
    start, still = delta().assemble(), np.zeros(len(model.velocity_names))
    here, _ = model.acceleration(start.q, still)
    for name in ("C1.point", "D2.point", "ball1.com", "arm0.mass"):
        there, _ = model.with_parameters({name: model.parameters[name]}).acceleration(start.q, still)
        assert np.array_equal(here, there), name


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf"])
def test_files_bring_it_back(suffix: str, tmp_path: Path) -> None:
    if suffix == ".mjcf":
        pytest.importorskip("mujoco")
    m = delta()
    m.save(tmp_path / f"delta{suffix}", strict=True)
    assert off(m, pt.load(tmp_path / f"delta{suffix}")) < 1e-12


def test_both_dialects_move_alike(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    m, runs = delta(), []
    for suffix in (".urdf", ".mjcf"):
        m.save(tmp_path / f"delta{suffix}", strict=True)
        back = pt.load(tmp_path / f"delta{suffix}")
        runs.append(back.simulate(0.02, initial=back.assemble(), t_eval=[0.0, 0.02], rtol=1e-10, atol=1e-12))
    one, other = (np.array([run.joint(f"{word}{leg}").position for word in "AB" for leg in range(3)]) for run in runs)
    assert np.abs(one[:, -1] - one[:, 0]).max() > 1e-3
    assert np.abs(one[:, -1] - other[:, -1]).max() < 1e-10


# ---------------------------------------------------------------- small bodies far apart

FALL = 0.5 * 9.81 * 0.1**2


def satellites(apart: float, mass: float, inertia: tuple[float, float, float], count: int = 2) -> pt.Mechanism:
    m = pt.Mechanism("satellites")
    for i in range(count):
        m.add_body(f"b{i}", mass=mass, inertia=inertia, position=(i * apart, 0, 0))
        m.add_free(f"f{i}", m.ground, f"b{i}")
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("apart", [1.0, 1e3, 1e5, 1e7])
def test_small_bodies_far_apart_move_as_beside_one_another(apart: float, coordinates: str) -> None:
    """A body that is held in its centre has the arm of its own inertia, not that of the mechanism."""
    for mass, inertia in ((1.0, (4e-5, 4e-5, 4e-5)), (1000.0, (100.0, 120.0, 150.0))):
        m = satellites(apart, mass, inertia)
        run = m.simulate(0.1, t_eval=[0.0, 0.1], coordinates=coordinates)
        assert run.success, run.message
        fallen = run.body("b1").position[0] - run.body("b1").position[-1]
        assert fallen == pytest.approx([0.0, FALL, 0.0], abs=1e-9 * max(apart, 1.0))


@pytest.mark.parametrize("apart", [1.0, 1e4, 1e6])
def test_a_ball_far_from_a_post(apart: float) -> None:
    m = pt.Mechanism("ball and post")
    m.add_body("ball", mass=1.0, inertia=(4e-5, 4e-5, 4e-5))
    m.add_body("post", mass=1.0, inertia=(1, 1, 1), position=(apart, 0, 0))
    m.add_spherical("S", m.ground, "ball", point=(0, 0, 0))
    m.add_revolute("P", m.ground, "post", point=(apart, 0, 0))
    run = m.simulate(0.1, initial=m.assemble(rates={"P": 2.0}), t_eval=[0.0, 0.1])
    assert run.success and run.joint("P").angle[-1] == pytest.approx(0.2, abs=1e-9)


def test_a_body_without_mass_is_found_among_many() -> None:
    """Motions that share mass are examined together, and others apart: one of two hundred bodies moves none."""
    m = satellites(3.0, 2.0, (1.0, 1.2, 1.5), count=120)
    m.add_body("nothing", mass=0.0, inertia=(0, 0, 0), position=(0, 5, 0))
    m.add_prismatic("slide", m.ground, "nothing", point=(0, 5, 0), axis=(1, 0, 0))
    with pytest.raises(pt.errors.PartitaError, match="nothing"):
        m.simulate(0.01)


def test_a_length_that_is_rounding_is_none() -> None:
    """A body drawn in the point of its joint but for the last place of a number."""
    found = []
    for x in (0.3, 0.1 + 0.2):
        m = pt.Mechanism("one point", gravity=(3.0, 0, 0))
        m.add_body("b", mass=1.0, inertia=(1, 1, 1), position=(x, 0, 0))
        m.add_prismatic("A", m.ground, "b", point=(0.3, 0, 0), axis=(1, 0, 0))
        run = m.simulate(1.0, t_eval=[0.0, 1.0])
        assert run.success and run.certificate.verdict == "valid"
        found.append((run.joint("A").displacement[-1], run.counters["steps"]))
    assert found[0][0] == pytest.approx(1.5, abs=1e-7) and found[1][0] == pytest.approx(1.5, abs=1e-7)
    assert found[0][1] == found[1][1]


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-14, 1e-11, 1e-8, 1e-6])
@pytest.mark.parametrize("parts", [1, 2])
def test_a_centre_of_mass_off_by_rounding_moves_as_a_centred_one(parts: int, off: float, coordinates: str) -> None:
    """A slender body that flies, alone or of two welded halves: its angular velocity turns about its line at
    (I - J) / I of the rate about it, while its centre falls."""
    slim, wide, mass = 0.0026, 0.52, 4.32
    m = pt.Mechanism("flying", gravity=(0, -9.81, 0))
    names = ["body", "half"][:parts]
    for name in names:
        inertia = tuple(x / parts for x in (slim, wide, wide))
        m.add_body(name, mass=mass / parts, inertia=inertia, com=(off, 0, 0))
    if parts == 2:
        m.add_fixed("weld", *names, point=(0, 0, 0))
    m.add_free("F", m.ground, "body")
    spin, across, end = 3.0, 0.5, 0.4
    start = m.convert(m.assemble(rates={"F.wx": spin, "F.wz": across}), coordinates)
    run = m.simulate(end, initial=start, coordinates=coordinates, rtol=1e-10, atol=1e-12)
    assert run.success and run.certificate.verdict == "valid"
    assert m.compile(coordinates).mobility == 6
    body = run.body("body")
    angle = (wide - slim) / wide * spin * end
    rates = body.rotation[-1].T @ body.angular_velocity[-1]
    assert rates == pytest.approx([spin, across * math.sin(angle), across * math.cos(angle)], abs=1e-8)
    assert body.position[-1] == pytest.approx([0.0, -0.5 * 9.81 * end**2, 0.0], abs=1e-8 + 2.0 * off)
