"""Equations in C, compiled and called, against the core."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt

Numbers = np.ndarray[Any, np.dtype[np.float64]]
EXACT = 1e-12


class Compiled:
    """The functions of a file, called with arrays."""

    def __init__(self, path: Path) -> None:
        library = path.with_suffix(".so")
        warnings = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
        subprocess.run(["cc", "-O1", *warnings, "-shared", "-fPIC", "-o", library, path, "-lm"], check=True)
        self.name, self.library = path.stem, ctypes.CDLL(str(library))

    def start(self, count: int) -> Numbers:
        return np.array((ctypes.c_double * count).in_dll(self.library, f"{self.name}_start"))

    def __call__(self, name: str, *arguments: float | Numbers) -> int:
        """Its status; arrays are read and written in place."""
        given = [
            each.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            if isinstance(each, np.ndarray)
            else ctypes.c_double(each)
            for each in arguments
        ]
        return int(getattr(self.library, f"{self.name}_{name}")(*given))


def ankle(rods: str) -> pt.Mechanism:
    """Two motors on the shank move a foot: by distances, or by rods with a ball at each end."""
    m = pt.Mechanism("ankle /* of */ a leg")
    foot = m.add_body("foot", mass=1.0, inertia=(0.003, 0.004, 0.003), com=(0.03, 0.0, -0.05))
    m.add_universal("ankle", m.ground, foot, point=(0, 0, 0), axis1=(0, 1, 0), axis2=(1, 0, 0), cut="never")
    for side, y, height in (("l", 0.045, 0.28), ("r", -0.045, 0.2)):
        pivot, heel = np.array([0.0, y, height]), np.array([-0.06, y, -0.03])
        tip = pivot + np.array([-0.06, 0.0, 0.01])
        lever = m.add_rod(f"lever {side}", start=pivot, end=tip, mass=0.1)
        m.add_revolute(f"motor {side}", m.ground, lever, point=pivot, axis=(0, 1, 0), cut="never")
        if rods == "distances":
            m.add_distance(f"rod {side}", lever, (np.hypot(0.06, 0.01), 0, 0), foot, heel)
        else:
            rod = m.add_rod(f"rod {side}", start=tip, end=heel, mass=0.05)
            m.add_spherical(f"top {side}", lever, rod, point=tip)
            m.add_spherical(f"heel {side}", rod, foot, point=heel)
    return m


MOTORS = ["motor l", "motor r"]


@pytest.mark.parametrize("kind", ["distances", "balls", "catalogue"])
def test_an_actuator_map_is_that_of_the_core(kind: str, tmp_path: Path) -> None:
    m = pt.catalogue.load("parallel-ankle") if kind == "catalogue" else ankle(kind)
    c = Compiled(m.export_c(tmp_path / "ankle.c", actuators=MOTORS, joints=["ankle"]))
    if kind == "distances":
        assert (tmp_path / "ankle.c").read_text().count("\n") <= 300
    model, rng = m.compile(), np.random.default_rng(1)
    start = m.assemble()
    q = c.start(len(start.q))
    assert np.array_equal(q, start.q)
    actuated = model.actuated(start, MOTORS)
    rows = [model.names.index("ankle.turn1"), model.names.index("ankle.turn2")]
    for _ in range(30):
        motors = rng.uniform(-0.3, 0.3, 2)
        there = m.assemble(targets=dict(zip(MOTORS, motors, strict=True)))
        joints, pose = np.zeros(2), start.q.copy()
        assert c("to_joints", motors, pose, joints) == 0
        assert np.abs(joints - there.q[rows]).max() < EXACT
        back, again = np.zeros(2), start.q.copy()
        assert c("to_actuators", joints, again, back) == 0
        assert np.abs(back - motors).max() < EXACT
        known = actuated.at(there)
        jacobian, inverse = np.zeros((2, 2)), np.zeros((2, 2))
        assert c("jacobian", pose, jacobian) == 0 and c("inverse_jacobian", pose, inverse) == 0
        assert np.abs(jacobian - known.ratios[rows]).max() < EXACT * np.abs(jacobian).max()
        assert np.abs(inverse @ jacobian - np.eye(2)).max() < 10 * EXACT
        inertia, lengths2, margin = np.zeros((2, 2)), np.zeros(2), np.zeros(1)
        assert c("inertia", pose, inertia, lengths2) == 0 and c("margin", pose, margin) == 0
        assert np.abs(inertia - known.M).max() < EXACT * np.abs(known.M).max()
        assert margin[0] == pytest.approx(known.margin, abs=10 * EXACT)
        rates, joint_rates, efforts = rng.normal(size=2), np.zeros(2), np.zeros(2)
        c("joint_rates", pose, rates, joint_rates)
        c("actuator_rates", pose, joint_rates, back)
        assert np.allclose(joint_rates, known.ratios[rows] @ rates, atol=EXACT) and np.allclose(back, rates, atol=1e-11)
        torques = rng.normal(size=2)
        c("actuator_torques", pose, torques, efforts)
        c("joint_torques", pose, efforts, back)
        assert efforts @ rates == pytest.approx(torques @ joint_rates, abs=1e-11)  # the same power
        assert np.allclose(back, torques, atol=1e-11)


def test_as_many_joints_as_there_are(tmp_path: Path) -> None:
    m = pt.catalogue.load("three-rrr")
    model, start = m.compile(), m.assemble()
    motors = list(model.names[: model.mobility])
    others = [i for i, name in enumerate(model.names) if name not in motors]
    c = Compiled(m.export_c(tmp_path / "many.c", actuators=motors))
    jacobian = np.zeros((len(others), len(motors)))
    assert c("jacobian", start.q.copy(), jacobian) == 0
    known = model.actuated(start, motors)
    assert np.abs(jacobian - known.ratios[others]).max() < EXACT * max(1.0, np.abs(jacobian).max())
    assert hasattr(c.library, "many_to_actuators") == (len(others) == len(motors))


MOVING = (
    "four-bar", "andrews-squeezer", "bricard", "n-four-bar", "four-bar-spring", "spatial-four-bar",
    "parallel-ankle", "delta", "heavy-top", "rolling-ball", "whipple-bicycle", "stewart-ups",
    "double-wishbone", "screw-press"
)  # fmt: skip


@pytest.mark.parametrize("name", MOVING)
def test_accelerations_are_those_of_the_core(name: str, tmp_path: Path) -> None:
    m = pt.catalogue.load(name)
    c = Compiled(m.export_c(tmp_path / "motion.c"))
    model = m.compile()
    run = m.simulate(0.05, t_eval=np.linspace(0.0, 0.05, 4))
    compared = 0
    for t, q, v in zip(run.t, run.q, run.v, strict=True):
        vdot, qdot = np.zeros(len(v)), np.zeros(len(q))
        q, v = q.copy(), v.copy()
        if c("accelerations", float(t), q, v, vdot):
            continue  # this choice of coordinates does not serve here
        known = model.acceleration(q, v, t=t)[0]
        assert np.abs(vdot - known).max() < 1e-10 * max(1.0, np.abs(known).max())
        assert c("rates", q, v, qdot) == 0
        compared += 1
    assert compared >= 2


def test_accelerations_of_a_driven_mechanism_depend_on_time(tmp_path: Path) -> None:
    m = pt.catalogue.load("four-bar")
    t = np.linspace(0.0, 1.0, 21)
    m.add_drive("A", (t, 0.3 * np.sin(2.0 * t)))
    c = Compiled(m.export_c(tmp_path / "driven.c"))
    run = m.simulate(0.5, t_eval=[0.0, 0.23, 0.5])
    for at, q, v, vdot in zip(run.t, run.q, run.v, run.vdot, strict=True):
        found = np.zeros(len(v))
        assert c("accelerations", float(at), q.copy(), v.copy(), found) == 0
        assert np.abs(found - vdot).max() < 1e-10 * max(1.0, np.abs(vdot).max())


def test_what_cannot_be_reached_is_refused(tmp_path: Path) -> None:
    """A double rocker turns only so far, in closed form; no Newton's method reaches a position that is no number."""
    rocker = pt.catalogue.load("double-rocker")
    model, start = rocker.compile(), rocker.assemble()
    first = model.names[0]
    c = Compiled(rocker.export_c(tmp_path / "rocker.c", actuators=[first]))
    reached = []
    for angle in np.linspace(-3.0, 3.0, 25):
        pose, joints = start.q.copy(), np.zeros(len(start.q) - 1)
        refused = c("to_joints", np.array([angle]), pose, joints)
        reached.append(not refused)
        assert bool(np.abs(model.constraints(pose)).max() < EXACT) == (not refused)
    assert any(reached) and not all(reached)
    m = ankle("distances")
    d = Compiled(m.export_c(tmp_path / "ankle.c", actuators=MOTORS, joints=["ankle"]))
    assert d("to_joints", np.array([np.nan, 0.0]), m.assemble().q.copy(), np.zeros(2)) == 1


def test_a_choice_of_coordinates_that_does_not_serve_is_refused(tmp_path: Path) -> None:
    """A slider-crank by its slide, at the dead point of the slide, which its crank passes."""
    m = pt.catalogue.load("slider-crank")
    model = m.compile()
    slide = next(each["name"] for each in model.summary["joints"] if each["kind"] == "prismatic")
    crank = model.names[0]
    assert crank != slide
    by_crank = Compiled(m.export_c(tmp_path / "crank.c", actuators=[crank], joints=[slide]))
    by_slide = Compiled(m.export_c(tmp_path / "slide.c", actuators=[slide], initial=m.assemble(targets={crank: 1.0})))

    def ratio(angle: float) -> tuple[float, Numbers]:
        q, jacobian = m.assemble(targets={crank: angle}).q.copy(), np.zeros(1)
        assert by_crank("jacobian", q, jacobian) == 0
        return float(jacobian[0]), q

    angles = np.linspace(0.3, 6.0, 20)
    ratios = [ratio(angle)[0] for angle in angles]
    change = next(i for i in range(19) if ratios[i] * ratios[i + 1] < 0)
    low, high = angles[change], angles[change + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if ratio(middle)[0] * ratios[change] > 0 else (low, middle)
    others = np.zeros(len(model.names) - 1)
    assert by_slide("jacobian", ratio(angles[change])[1], others) == 0
    assert by_slide("jacobian", ratio(low)[1], others) == 1


def refused(m: pt.Mechanism, path: Path, match: str, **options: Any) -> None:
    with pytest.raises(pt.errors.PartitaError, match=match):
        m.export_c(path, **options)


def test_bad_input_is_named(tmp_path: Path) -> None:
    m, path = ankle("distances"), tmp_path / "ankle.c"
    refused(m, tmp_path / "ankle.txt", "must end in .c")
    refused(m, tmp_path / "none" / "ankle.c", "folder")
    refused(m, path, "letters", name="2 fast")
    refused(m, path, "list of joints", actuators="motor l")
    refused(m, path, "list of joints", actuators=[])
    refused(m, path, "motor x", actuators=["motor x", "motor r"])
    refused(m, path, "degrees of freedom", actuators=["motor l"])
    refused(m, path, "twice", actuators=["motor l", "motor l"])
    refused(m, path, "name actuators too", joints=["ankle"])
    four_bar = pt.catalogue.load("four-bar")
    cut = next(each["name"] for each in four_bar.compile().summary["joints"] if not each["tree"])
    refused(four_bar, path, 'cut="never"', actuators=[cut])
    refused(m, path, "State", initial=1.0)
    m.add_torque("motor l", lambda t, state: 0.0)
    refused(m, path, "function|recorded")
    assert not path.exists()


def test_names_of_a_mechanism_stay_within_their_comment(tmp_path: Path) -> None:
    m = ankle("distances")
    text = m.export_c(tmp_path / "9 lives-of.c", name="x", actuators=MOTORS).read_text()
    assert text.count("/*") == text.count("*/")
    assert (tmp_path / "9 lives-of.h").is_file()
