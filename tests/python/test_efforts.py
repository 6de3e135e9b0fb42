"""Efforts of couplings and drives as results show them: of joints, measures and poses, shared where drives agree."""

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from thorough import either

import partita as pt
from partita.errors import UnknownNameError
from partita.files import BLANK, sealed
from partita.results import Result, load_result

COORDINATES = ("relative", "absolute")
STORED = ("run.json", "run.nc")
G = 9.81


def agreeing(run: Result, case: Any) -> None:
    """Drives that agree: the result holds, by both routes, and says that shares are open."""
    assert run.success, (case, run.message)
    assert run.at_once.reactions["residual"].max() < 1e-9, (case, run.at_once.reactions["residual"].max())
    force = run.at_once.reactions["force"]
    assert np.abs(run.reactions_by("augmented")["force"] - force).max() < 1e-8 * (1.0 + np.abs(force).max()), case


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_a_joint_and_a_measure_driven_alike_share_one_load(coordinates: str) -> None:
    """A block on a rail along (3, 0, 4) / 5, in the plane and, turned about the rail by a second body, in space."""
    positions: dict[str, Callable[[float], Any]] = {"position": lambda t: 0.1 * t * t, "velocity": lambda t: 0.2 * t}
    axis = np.array([0.6, 0.0, 0.8])
    for in_space in (False, True):
        for first in positions:
            for second in positions:
                m = pt.Mechanism("over-driven", gravity=(0, 0, -G))
                m.add_body("block", mass=2.0, inertia=(1, 1, 1), com=(0.1, 0.2, 0.0))
                m.add_prismatic("S", m.ground, "block", axis=axis)
                if in_space:  # a rotor on the block, so that no plane holds all motion
                    m.add_body("rotor", mass=1e-3, inertia=(1e-6, 1e-6, 1e-6))
                    m.add_revolute("spin", "block", "rotor", point=(0, 0, 0), axis=(0, 1, 0.3))
                m.add_drive("S", **{first: positions[first]}, name="jack")
                rod = pt.Along(m.ground, (0, 0, 0), axis, "block", (0, 0, 0))
                m.add_drive(rod, **{second: positions[second]}, name="rod")
                run = m.simulate(1.0, t_eval=[0.0, 0.5, 1.0], coordinates=coordinates)
                case = (in_space, first, second)
                agreeing(run, case)
                jack, rod_effort = run.drive("jack"), run.drive("rod")
                mass = 2.001 if in_space else 2.0
                both = jack.effort + rod_effort.effort
                # an angle that joins neither drive may move along; what it does lies below 1e-5
                assert np.abs(both - mass * (0.2 + 0.8 * G)).max() < 1e-5, (case, both)
                assert np.abs(run.joint("S").drive - jack.effort).max() == 0.0
                assert not jack.determined.any() and not rod_effort.determined_at.any(), case
                assert not run.joint("S").in_frame("joint").determined.all()
                # of all possible shares the joint's is least where the rod takes all
                assert np.abs(jack.effort).max() < 1e-9, case


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_a_motor_and_a_rod_on_one_crank(coordinates: str) -> None:
    """Motor torque + rod force x its lever = what a motor alone takes; the hinge carries the rod's force too."""
    angle = lambda t: 0.5 + 0.3 * t * t  # noqa: E731
    length = lambda t: np.sqrt(5.0 - 4.0 * np.cos(0.5 + 0.3 * t * t))  # noqa: E731
    for axis in ((0, 0, 1), (0, 0, -1e3)):
        efforts = []
        for rod in (False, True):
            m = pt.Mechanism("crank", gravity=(0, -G, 0))
            m.add_body("crank", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.5, 0.1, 0))
            m.add_revolute("A", m.ground, "crank", point=(0, 0, 0), axis=axis)
            sign = 1.0 if axis[2] > 0.0 else -1.0
            m.add_drive("A", position=lambda t, sign=sign: sign * angle(t), name="motor")
            if rod:
                m.add_drive(pt.Distance(m.ground, (2, 0, 0), "crank", (1, 0, 0)), position=length, name="rod")
            efforts.append(m.simulate(1.0, t_eval=np.linspace(0, 1, 5), coordinates=coordinates))
        alone, run = efforts
        agreeing(run, axis)
        theta = angle(run.t)
        lever = 2.0 * np.sin(theta) / length(run.t)
        both = run.drive("motor").effort[:, 0] + sign * lever * run.drive("rod").effort[:, 0]
        assert np.abs(both - alone.drive("motor").effort[:, 0]).max() < 1e-9
        assert alone.drive("motor").determined.all() and not run.drive("rod").determined.any()
        # on the crank act hinge, rod and gravity
        tip = np.array([np.cos(theta), np.sin(theta)]).T
        pull = (tip - [2.0, 0.0]) / length(run.t)[:, None] * run.drive("rod").effort
        free = alone.joint("A").force[:, :2] - (run.joint("A").force[:, :2] + pull)
        assert np.abs(free).max() < 1e-9


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_two_driven_shafts_with_a_gear_between(coordinates: str) -> None:
    """One self-stress goes through both motors and the gear; it is the gear's force too that is shared."""
    for axis in ((0.0, 0.0, 1.0), (0.0, 0.6, 0.8)):
        m = pt.Mechanism("geared", gravity=(0, -G, 0))
        for name, x in (("a", 0.0), ("b", 1.0)):
            m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(x, 0, 0))
            m.add_revolute(f"R{name}", m.ground, name, point=(x, 0, 0), axis=axis)
        m.add_coupler("gear", ["Ra", "Rb"], [1.0, -2.0])
        m.add_drive("Ra", position=lambda t: t * t, name="one")
        m.add_drive("Rb", position=lambda t: 0.5 * t * t, name="other")
        run = m.simulate(1.0, t_eval=[0.0, 0.5, 1.0], coordinates=coordinates)
        agreeing(run, axis)
        one, other, gear = run.drive("one"), run.drive("other"), run.coupling("gear")
        assert np.abs(one.effort + gear.effort - 2.0).max() < 1e-9
        assert np.abs(other.effort - 2.0 * gear.effort - 1.0).max() < 1e-9
        assert not (one.determined.any() or other.determined.any() or gear.determined.any())
        # (2 - x)^2 + (1 + 2 x)^2 is least without a force in the gear: they move as the gear lets them anyway
        assert np.abs(gear.effort).max() < 1e-9


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_drives_of_measures_alone(coordinates: str, tmp_path: Path) -> None:
    """A pendulum whose tip keeps a course: force by a distance, torque by a cosine, each by virtual power."""
    theta = lambda t: 0.5 + 0.3 * t * t  # noqa: E731

    def crank() -> pt.Mechanism:
        m = pt.Mechanism("crank", gravity=(0, -G, 0))
        m.add_body("crank", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.5, 0, 0))
        m.add_revolute("A", m.ground, "crank", point=(0, 0, 0), axis=(0, 0, 1))
        return m

    measures: dict[str, tuple[Any, Callable[[Any], Any], Callable[[Any], Any]]] = {
        "distance": (
            lambda m: pt.Distance(m.ground, (2, 0, 0), "crank", (1, 0, 0)),
            lambda x: np.sqrt(5.0 - 4.0 * np.cos(x)),
            lambda x: 2.0 * np.sin(x) / np.sqrt(5.0 - 4.0 * np.cos(x)),
        ),
        "along": (lambda m: pt.Along(m.ground, (0, 0, 0), (0, 1, 0), "crank", (1, 0, 0)), np.sin, np.cos),
        "cosine": (
            lambda m: pt.Cosine(m.ground, (1, 0, 0), "crank", (1, 0, 0)),
            np.cos,
            lambda x: -np.sin(x),
        ),
    }
    for what, (measure, value, slope) in measures.items():
        m = crank()
        m.add_drive(measure(m), position=lambda t, value=value: value(theta(t)), name="actuator")
        start = m.assemble(guess={"A": 0.5}, coordinates=coordinates)
        run = m.simulate(1.0, initial=start, t_eval=np.linspace(0, 1, 4), coordinates=coordinates)
        assert run.success, (what, run.message)
        x = theta(run.t)
        torque = (0.3 + 2.0 * 0.25) * 0.6 + 2.0 * G * 0.5 * np.cos(x)
        found = run.drive("actuator")
        assert np.abs(found.effort[:, 0] * slope(x) - torque).max() < 1e-8, what
        assert found.determined.tolist() == [True] and found.determined_at.shape == (4, 1)
        assert not run.joint("A").drive.any()
        for file in either(("run.nc",) if (what, coordinates) == ("along", "absolute") else ("run.json",), STORED):
            run.save(tmp_path / file)
            back = load_result(tmp_path / file).drive("actuator")
            assert np.array_equal(back.effort, found.effort) and back.determined.all()
        sent = pickle.loads(pickle.dumps(found))
        assert np.array_equal(sent.effort, found.effort) and sent.determined.all() and sent.name == "actuator"
        with pytest.raises(UnknownNameError, match="did you mean 'actuator'"):
            run.drive("aktuator")


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_a_driven_pose_has_a_column_for_each_coordinate(coordinates: str) -> None:
    m = pt.Mechanism("held", gravity=(0, 0, -G))
    m.add_body("plate", mass=3.0, inertia=(1, 1, 1))
    m.add_drive("plate", pose=lambda t: ((0.1 * t * t, 0, 0), (0, 0, 0)), name="robot")
    run = m.simulate(0.5, t_eval=[0.0, 0.5], coordinates=coordinates)
    effort = run.drive("robot").effort
    assert effort.shape == (2, 6) and run.drive("robot").determined.all()
    assert np.abs(effort[:, :3] - [0.6, 0.0, 3.0 * G]).max() < 1e-8 and np.abs(effort[:, 3:]).max() < 1e-8


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_measures_out_of_the_plane_of_a_motion_are_read_in_full(coordinates: str) -> None:
    """Of an axis that leaves the plane, and of cosines, the plane keeps a part: such a mechanism is one in space."""
    measures: dict[str, tuple[Any, Callable[[Any], Any]]] = {
        "oblique": (
            lambda m: pt.Along(m.ground, (0, 0, 0), (0, 0.6, 0.8), "crank", (1, 0, 0.5)),
            lambda x: 0.6 * np.sin(x) + 0.4,
        ),
        "cosine": (lambda m: pt.Cosine(m.ground, (0, 1, 0), "crank", (1, 0, 0)), np.sin),
        "in the plane": (
            lambda m: pt.Along(m.ground, (0, 0, -1), (0, 1, 0), "crank", (1, 0, 0.5)),
            np.sin,
        ),
        "distance": (
            lambda m: pt.Distance(m.ground, (2, 0, 0), "crank", (1, 0, 0.5)),
            lambda x: np.sqrt(5.25 - 4.0 * np.cos(x)),
        ),
    }
    for what, (measure, value) in measures.items():
        for wish in ("drive", "torque"):
            m = pt.Mechanism("crank", gravity=(0, -G, 0))
            m.add_body("crank", mass=2.0, inertia=(0.1, 0.2, 0.3))
            m.add_revolute("A", m.ground, "crank", point=(0, 0, 0), axis=(0, 0, 1))
            if wish == "drive":
                m.add_drive(measure(m), position=lambda t, value=value: value(0.5 + t))
            else:
                m.add_torque("A", ([-9.0, 9.0], [-27.0, 27.0]), over=measure(m))
            model = m.compile(coordinates=coordinates)
            assert model.summary["planar"] == (what in ("in the plane", "distance")), what
            start = m.assemble(near=None, guess={"A": 0.5}, coordinates=coordinates)
            if wish == "torque":
                start = m.assemble(targets={"A": 0.5}, coordinates=coordinates)
            run = m.simulate(0.4, initial=start, t_eval=[0.0, 0.2, 0.4], coordinates=coordinates)
            assert run.success, (what, run.message)
            x = run.joint("A").position[:, 0]
            if wish == "drive":
                assert np.abs(x - 0.5 - run.t).max() < 1e-9, (what, x)
            else:
                assert np.abs(0.3 * run.joint("A").acceleration[:, 0] - 3.0 * value(x)).max() < 1e-9, what


@pytest.mark.parametrize("coordinates", COORDINATES)
@pytest.mark.parametrize("size", [1.0, 1e3, 1e-6])
def test_a_rod_beside_two_motors_in_space(size: float, coordinates: str) -> None:
    """A universal joint driven about both axes, and the length of a rod that follows, in kilometres and micrometres."""
    axes = np.array([1.0, 0.0, 0.5]) / np.sqrt(1.25), np.array([0.0, 1.0, 0.2]) / np.sqrt(1.04)
    tip, foot = np.array([size, 0.0, size]), np.array([2.0 * size, 0.0, 0.0])

    def turned(axis: Any, x: Any, v: Any) -> Any:
        c, s = np.cos(x), np.sin(x)
        return v * c + np.cross(axis, v) * s + axis * (axis @ v) * (1.0 - c)

    def length(t: Any) -> Any:
        gap = turned(axes[0], 0.3 * t * t, turned(axes[1], 0.2 * t * t, tip)) - foot
        return np.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])

    runs = []
    for rod in (False, True):
        m = pt.Mechanism("gimbal", gravity=(0, 0, -G))
        inertia = (0.1 * size**2, 0.2 * size**2, 0.25 * size**2)
        m.add_body("dish", mass=1.0, inertia=inertia, com=(0.2 * size, -0.1 * size, 0.15 * size))
        m.add_universal("J", m.ground, "dish", point=(0, 0, 0), axis1=axes[0], axis2=axes[1])
        m.add_drive("J", position=lambda t: 0.3 * t * t, coordinate=0, name="first")
        m.add_drive("J", position=lambda t: 0.2 * t * t, coordinate=1, name="second")
        if rod:
            m.add_drive(pt.Distance(m.ground, foot, "dish", tip), position=length, name="rod")
        runs.append(m.simulate(1.0, t_eval=[0.0, 0.5, 1.0], coordinates=coordinates))
    alone, run = runs
    agreeing(run, size)
    assert np.abs(run.joint("J").acceleration - [0.6, 0.4]).max() < 1e-9
    assert not any(run.drive(name).determined.any() for name in ("first", "second", "rod"))
    assert alone.drive("first").determined.all()
    # what the joint and the rod do together is what the joint does alone: of the dish, the same motion
    point = run.body("dish").point(tip)
    pull = (point - foot) / np.linalg.norm(point - foot, axis=1)[:, None] * run.drive("rod").effort
    assert np.abs(pull).max() > 0.1
    assert np.abs(run.joint("J").force + pull - alone.joint("J").force).max() < 1e-8
    moment = run.joint("J").moment + np.cross(point, pull)
    assert np.abs(moment - alone.joint("J").moment).max() < 1e-8 * size


def test_files_from_before_there_were_efforts(tmp_path: Path) -> None:
    """Efforts are then the multipliers, with nothing claimed of them; accelerations are not known."""
    m = pt.Mechanism("hook", gravity=(0, -G, 0))
    load_ = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
    m.add_distance("rope", m.ground, (0, 0, 0), load_, (0, 0, 0))
    m.add_free("any", m.ground, load_)
    run = m.simulate(0.1, t_eval=[0.0, 0.1])
    document = json.loads(run.save(tmp_path / "old.json").read_text())
    for name in ("effort", "determined_effort", "joint_acceleration"):
        del document["arrays"][name]
    for key in ("closing_rows", "drive_rows"):
        del document["account"]["summary"][key]
    document["checksum"] = BLANK
    (tmp_path / "old.json").write_bytes(sealed(json.dumps(document).encode("utf-8")))
    old = load_result(tmp_path / "old.json")
    assert np.abs(old.coupling("rope").tension - 2.0 * G).max() < 1e-9
    assert not old.coupling("rope").determined.any() and run.coupling("rope").determined.all()
    assert np.isnan(old.joint("any").acceleration).all() and old.joint("any").acceleration.shape == (2, 6)
