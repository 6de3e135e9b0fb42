"""USD as it is written: read back it moves the same to all digits; nothing is lost in silence."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import usd_mutations
from test_writers import KINDS, carried, moved
from thorough import either
from usd_files import SCENE, at, body, points, prim, put, usd
from usd_files import joint as joint_of

import partita as pt
from partita.cli import main

pytest.importorskip("pxr", reason="usd-core is an extra")

LOST = ("perpendicular", "pin_slot", "joint", "screw")
"""Joints of which USD has no form: two rotations beside slides, or a thread."""


def back(m: Any, folder: Path, name: str = "m.usda") -> Any:
    assert not m.save(folder / name, strict=True).dropped
    return pt.load(folder / name)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in LOST])
@pytest.mark.parametrize("reverse", [False, True])
def test_every_joint_moves_as_it_was_drawn(kind: str, reverse: bool, tmp_path: Path) -> None:
    m = carried(kind, reverse)
    again = back(m, tmp_path)
    assert {group.kind for group in again.remarks} <= {"used"}
    assert (again.name, [*again.bodies], [*again.joints]) == (m.name, [*m.bodies], [*m.joints])
    a, b = moved(m, m.bodies), moved(again, m.bodies)
    for name in m.bodies:  # to the tolerance of the run, on ways of decimetres
        assert np.abs(a[name] - b[name]).max() < 1e-9, name


@pytest.mark.parametrize("name", ["four-bar", "rssr", "bricard"])
def test_loops_have_the_same_accelerations_to_all_digits(name: str, tmp_path: Path) -> None:
    m = pt.catalogue.load(name)
    runs = [x.simulate(1e-6, t_eval=[0.0, 1e-6]) for x in (m, back(m, tmp_path))]
    for joint in m.joints:
        one, other = (run.joint(joint).acceleration[0] for run in runs)
        assert np.abs(one - other).max() < 1e-12 * (1.0 + np.abs(one).max())


def full() -> Any:
    """A mechanism with all that is carried."""
    m = pt.Mechanism("all of it", gravity=(0.1, -9.7, 1 / 3))
    inertia = (0.1, 0.2, 0.25)
    a = m.add_body("a 1", mass=4 / 3, inertia=inertia, com=(1 / 3, 0, 0), gravity=False)
    b = m.add_body("b", mass=1e-9, inertia=inertia, position=(1, 0, 0))
    c = m.add_body("c", mass=1.0, inertia=inertia, position=(2, 0, 0))
    d = m.add_body("d", mass=1.0, inertia=inertia, position=(2, 1, 0))
    m.add_revolute("A", m.ground, a, point=(0, 0, 0), axis=(1, 2, 3))
    m.add_revolute("B", a, b, point=(1, 0, 0), axis=(0, 1, 0))
    m.add_prismatic("C", m.ground, c, point=(2, 0, 0), axis=(0, 0, 1))
    m.add_cylindrical("D", m.ground, d, point=(2, 1, 0), axis=(1, 0, 0))
    for joint, which in (("A", 0), ("C", 0), ("D", 0), ("D", 1)):
        law = {"stiffness": 7 / 3, "damping": 1 / 3, "angle": 1 / 7}
        m.add_torsion_spring(joint, **law, coordinate=which, name=f"{joint}{which}")
        m.add_rotor(joint, 1 / 3, ratio=2.0, coordinate=which, name=f"r{joint}{which}")
    m.add_coupler("gear", ["B", "A"], [3.0, 1.0], 1 / 7)
    m.add_distance("rope", c, (1 / 3, 0, 0), d, (0, 1 / 3, 0), 1.1)
    return m


def numbers(m: Any) -> Any:
    """Numbers of bodies, joints and forces, without names that USD does not have."""
    spec = m.to_spec()
    for word in ("forces", "rotors", "couplings"):
        spec.setdefault(word, [])
    for word in ("forces", "rotors"):
        spec[word] = [{key: x for key, x in one.items() if key != "name"} for one in spec[word]]
    for rotor in spec["rotors"]:
        rotor["inertia"], rotor["ratio"] = rotor["inertia"] * rotor["ratio"] ** 2, 1.0
    for coupling in spec["couplings"]:
        first = coupling["factors"][0]
        coupling["factors"] = [x / first for x in coupling["factors"]]
        coupling["offset"] /= first
    return spec


def near(one: Any, other: Any) -> bool:
    """Whether all numbers agree to round-off, and all else is the same."""
    if isinstance(one, dict):
        return set(one) == set(other) and all(near(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(near, one, other))
    same = one == other
    return bool(same or (isinstance(one, float) and one == pytest.approx(other, rel=1e-14, abs=1e-15)))


def test_all_numbers_come_back(tmp_path: Path) -> None:
    m = full()
    again = back(m, tmp_path)
    one, other = numbers(m), numbers(again)
    couplings = [sorted(x.pop("couplings"), key=lambda c: c["name"]) for x in (one, other)]
    for coupling in couplings[0] + couplings[1]:
        coupling.pop("word"), coupling.pop("said", None)
    assert near(*couplings)
    assert near(one, other), (one, other)
    assert again.bodies["a 1"].gravity is False
    written = m.save(tmp_path / "m.usda")
    for words in (
        "in double",
        "weightless by a schema of PhysX",
        "rotor on coordinate 0 of joint A",
        "follows another",
    ):
        assert any(words in remark for remark in written.changed), words


def test_a_body_without_mass_is_one(tmp_path: Path) -> None:
    m = pt.Mechanism("rods")
    rod = m.add_body("rod", mass=0.0, inertia=(0, 0, 0))
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    end = m.add_body("end", mass=1.0, inertia=(0, 0, 0), position=(1, 0, 0))
    m.add_spherical("B", rod, end, point=(1, 0, 0))
    written = m.save(tmp_path / "m.usda", strict=True)
    assert sum("which only Partita reads: in USD" in remark for remark in written.changed) == 2
    again = pt.load(tmp_path / "m.usda")
    assert [again.bodies[x].mass for x in ("rod", "end")] == [0.0, 1.0] and not np.any(again.bodies["end"].inertia)


LOSSES = {
    "drive d": lambda m: m.add_drive("A", velocity=1.0, name="d"),
    "torque t": lambda m: m.add_torque("A", value=1.0, name="t"),
    "force f": lambda m: m.add_force("c", force=(1, 0, 0), name="f"),
    "spring s": lambda m: m.add_spring("s", "c", (0, 0, 0), "d", (0, 0, 0), stiffness=1.0),
    "negative": lambda m: m.add_torsion_spring("A", stiffness=-1.0, name="unstable"),
    "pin slot joint J": lambda m: m.add_pin_slot("J", "c", "d", point=(0, 0, 0)),
    "thread of screw J": lambda m: m.add_screw("J", "c", "d", point=(0, 0, 0), axis=(1, 0, 0), pitch=0.1),
    "not perpendicular": lambda m: m.add_universal("J", "c", "d", point=(0, 0, 0), axis1=(1, 0, 0), axis2=(1, 1, 0)),
    "generic joint J": lambda m: m.add_joint("J", "c", "d", free=("x", "rx", "rz")),
    "gear g": lambda m: m.add_coupler("g", ["A", "C"], [1.0, 2.0]),
    "spring of coordinate 1 of joint J": lambda m: (
        m.add_pin_slot("J", "c", "d", point=(0, 0, 0)),
        m.add_torsion_spring("J", stiffness=1.0, coordinate=1),
    ),
}


@pytest.mark.parametrize("words", LOSSES)
def test_what_is_lost_is_said_and_refused(words: str, tmp_path: Path) -> None:
    m = full()
    LOSSES[words](m)
    message = "coupler g" if words == "gear g" else words
    with pytest.raises(pt.errors.FileFormatError, match=message):
        m.save(tmp_path / "m.usda", strict=True)
    assert not list(tmp_path.iterdir())
    with pytest.warns(pt.errors.LossyFileWarning):
        written = m.save(tmp_path / "m.usda")
    assert any(message in remark for remark in written.dropped)
    pt.load(tmp_path / "m.usda")


def test_a_tolerance_of_the_drawing_is_lost(tmp_path: Path) -> None:
    m = pt.Mechanism("m", drawing_tolerance=1e-6)
    m.add_body("a", mass=1.0, inertia=(1, 1, 1))
    with pytest.raises(pt.errors.FileFormatError, match="the drawing tolerance 1e-06"):
        m.save(tmp_path / "m.usda", strict=True)


def test_numbers_that_another_program_changes_count(tmp_path: Path) -> None:
    """Beside USD's own, those in double are read only where both agree."""
    full().save(tmp_path / "m.usda")
    path = tmp_path / "m.usda"
    text = path.read_text("utf-8")
    path.write_text(text.replace("float physics:mass = 1.3333334", "float physics:mass = 2.5"), "utf-8")
    m = pt.load(path)
    assert m.bodies["a 1"].mass == 2.5
    assert "partita:mass 1.33333333: USD's own numbers differ from this and are used" in str(m.reading)


def test_names_in_any_letters(tmp_path: Path) -> None:
    odd = "a \"b\" & <c> é 😀 \\ 'd' #: [x]"
    m = pt.Mechanism(odd, gravity=(0, 0, -9.81))
    for i, name in enumerate((odd, "world", "1", "a b", "a_b")):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(i, 0, 0))
        m.add_spherical(name, m.ground, name, point=(i, 0, 1))
    again = back(m, tmp_path)
    assert again.name == odd and [*again.bodies] == [*m.bodies]
    assert [*again.joints] == [*m.joints]


def test_binary_files_and_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    four = pt.catalogue.load("four-bar")
    for name in ("m.usdc", "m.usd"):
        again = back(four, tmp_path, name)
        one, other = ([{**x, "cut": ""} for x in numbers(m)["joints"]] for m in (four, again))
        assert near(one, other)
    assert (tmp_path / "m.usdc").read_bytes().startswith(b"PXR-USDC")
    assert main(["convert", "four-bar", str(tmp_path / "c.usda"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "USD"
    assert main(["check", str(tmp_path / "c.usda")]) == 0


def test_others_read_what_is_written(tmp_path: Path) -> None:
    """USD's own reader of physics finds the bodies and joints, with their frames."""
    from pxr import Usd, UsdPhysics

    full().save(tmp_path / "m.usda")
    stage = Usd.Stage.Open(str(tmp_path / "m.usda"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # its successor is younger than versions that are served
        found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
    kinds = UsdPhysics.ObjectType
    assert len(found[kinds.RigidBody][0]) == 4
    (paths, hinges) = found[kinds.RevoluteJoint]
    one = hinges[[str(path) for path in paths].index("/all_of_it/joints/B")]
    assert str(one.body0) == "/all_of_it/a_1" and np.allclose(one.localPose0Position, (1, 0, 0), atol=1e-7)
    (drive,) = [x.drive for x in hinges if x.drive.enabled]
    assert drive.stiffness == pytest.approx(7 / 3 * np.pi / 180, rel=1e-6)
    assert drive.targetPosition == pytest.approx(180 / np.pi / 7, rel=1e-6)


def test_frames_of_joints_are_where_usd_itself_finds_them(tmp_path: Path) -> None:
    """On prims within bodies, within prims that are scaled: bodies and frames by USD's own reader of physics."""
    from pxr import Gf, Usd, UsdPhysics

    turn = "float3 xformOp:rotateXYZ = (10, 20, 30)"
    tool = prim("Xform", "tool", at(0.1, 0.2, 0.3, "float3 xformOp:rotateXYZ = (5, -7, 9)"))
    inner = body("a", at(0.5, 0, 0, "float3 xformOp:rotateXYZ = (40, 0, 0)"), tool)
    text = usd(
        SCENE,
        prim("Xform", "outer", at(1, 2, 3, turn, "double3 xformOp:scale = (2, 2, 2)"), inner),
        body("b", at(0, 1, 0, "float xformOp:rotateY = 33")),
        joint_of("RevoluteJoint", "J", ("outer/a/tool", "b"), points("(0.3, 0.1, -0.2)", "(0.4, 0.5, 0.6)"),
              "quatf physics:localRot0 = (0.8, 0, 0.6, 0)", "quatf physics:localRot1 = (0.6, 0.8, 0, 0)"),
    )  # fmt: skip
    path = put(tmp_path, text)
    stage = Usd.Stage.Open(str(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        found = UsdPhysics.LoadUsdPhysicsFromRange(stage, ["/"])
    kinds = UsdPhysics.ObjectType
    poses = {
        str(x.primPath): (Gf.Vec3d(x.position), Gf.Rotation(Gf.Quatd(x.rotation))) for x in found[kinds.RigidBody][1]
    }
    (hinge,) = found[kinds.RevoluteJoint][1]
    m = pt.load(path)
    record = m.to_spec()["joints"][0]
    for word, axis, carrier, point, rotation in (
        ("point", "axis", hinge.body0, hinge.localPose0Position, hinge.localPose0Orientation),
        ("child_point", "child_axis", hinge.body1, hinge.localPose1Position, hinge.localPose1Orientation),
    ):
        place, turned = poses[str(carrier)]
        assert np.allclose(place + turned.TransformDir(Gf.Vec3d(point)), record[word], atol=1e-6)
        along = Gf.Rotation(Gf.Quatd(rotation)).TransformDir(Gf.Vec3d(1, 0, 0))
        assert np.allclose(turned.TransformDir(along), record[axis], atol=1e-6)
    for name, (place, turned) in poses.items():
        mine = m.bodies[name.rpartition("/")[2]]
        assert np.allclose(place, mine.position, atol=1e-6)
        axes = np.transpose([turned.TransformDir(Gf.Vec3d(*x)) for x in np.eye(3)])
        assert np.allclose(axes, mine.orientation, atol=1e-6)


EVERY = either(19, 1)
"""One of so many changes is made."""


@pytest.mark.parametrize("name", usd_mutations.STAGES)
def test_every_change_of_a_stage_is_heard(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asked, found = usd_mutations.silent(name, slice(0, None, EVERY))
    assert not found and asked > 5


def test_the_stages_have_every_item_of_the_table() -> None:
    assert not usd_mutations.unused()
