"""USD physics as Newton and MuJoCo extend it: springs, rotors, couplings and joints in series, with closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd_files import SCENE, at, body, drive, joint, points, prim, put, usd

import partita as pt

pytest.importorskip("pxr", reason="usd-core is an extra")

Y = 'uniform token physics:axis = "Y"'


def loaded(folder: Path, *parts: str, serial_joints: str = "stated") -> Any:
    return pt.load(put(folder, usd(SCENE, *parts)), serial_joints=serial_joints)


def kinds(m: Any, words: str) -> set[str]:
    """Kinds of the remarks with these words, in the text or in a name."""
    return {group.kind for group in m.remarks if words in group.text or any(words in name for name in group.names)}


def rates(m: Any, **given: float) -> dict[str, float]:
    """Accelerations of joints at the drawing, with these rates."""
    run = m.simulate(1e-7, t_eval=[0.0, 1e-7], initial=m.assemble(rates=given or None))
    return {name: float(run.joint(name).acceleration[0, 0]) for name in m.joints if run.joint(name).acceleration.size}


def locked(*axes: str) -> tuple[str, str]:
    lines = "\n".join(f"float limit:{a}:physics:low = 1\nfloat limit:{a}:physics:high = -1" for a in axes)
    return lines, " ".join(f"PhysicsLimitAPI:{a}" for a in axes)


# ---- a joint that is drawn where its slides are not zero ----


def stone(*lines: str, com: str = "(0.3, 0, 0)") -> str:
    """A body of 1 kg, I = 0.1."""
    return body("a", *lines, com=com).replace("(0.1, 0.2, 0.3)", "(0.1, 0.1, 0.1)")


@pytest.mark.parametrize("shift", [0.0, 0.5, -2.0])
def test_a_rotation_beside_a_slide_is_about_the_frame_of_the_second_body(tmp_path: Path, shift: float) -> None:
    """The hinge slides along x with the body: alpha = m g r / (I + m r^2), wherever it is drawn."""
    lines, schemas = locked("transY", "transZ", "rotX", "rotZ")
    m = loaded(tmp_path, stone(at(shift, 0, 0)), joint("Joint", "A", ("", "a"), lines, schemas=schemas))
    run = m.simulate(1e-7, t_eval=[0.0, 1e-7])
    alpha = run.body("a").angular_acceleration[0]
    assert alpha == pytest.approx([0, 9.81 * 0.3 / (0.1 + 0.09), 0], rel=1e-12)
    assert m.compile().mobility == 2


def test_a_drawn_slide_of_a_ball_keeps_its_point_and_shifts_its_spring(tmp_path: Path) -> None:
    lines, schemas = locked("transY", "transZ")
    spring = drive("transX", stiffness=10.0, targetPosition=0.2)
    one = joint("Joint", "A", ("", "a"), lines, spring, schemas=f"{schemas} PhysicsDriveAPI:transX")
    m = loaded(tmp_path, stone(at(0.5, 0, 0)), one)
    run = m.simulate(1e-7, t_eval=[0.0, 1e-7])
    # the spring pulls with 3 N at the body's frame, through its centre of mass: alpha is that of the weight alone
    assert run.body("a").angular_acceleration[0] == pytest.approx([0, 9.81 * 0.3 / 0.19, 0], rel=1e-12)
    assert run.joint("A").acceleration[0, 0] == pytest.approx(-10 * 0.3, rel=1e-12)


# ---- joints between the same two bodies ----


def hinge(name: str, axis: str, *lines: str, kind: str = "RevoluteJoint", schemas: str = "") -> str:
    return joint(kind, name, ("", "a"), f'uniform token physics:axis = "{axis}"', *lines, schemas=schemas)


SERIES = {
    "a cross": ([hinge("H", "X"), hinge("K", "Y")], 0, 2),
    "a table": ([hinge("H", "X", kind="PrismaticJoint"), hinge("K", "Y", kind="PrismaticJoint")], 0, 2),
    "a plane": (
        [hinge("H", "X", kind="PrismaticJoint"), hinge("K", "Z", kind="PrismaticJoint"), hinge("L", "Y")],
        0,
        3,
    ),
    "a floating ball": (
        [hinge(n, a, kind="PrismaticJoint") for n, a in zip("HKL", "XYZ", strict=True)]
        + [joint("SphericalJoint", "B", ("", "a"))],
        0,
        6,
    ),
}


@pytest.mark.parametrize("name", SERIES)
def test_joints_between_two_bodies_hold_at_once_or_in_series(tmp_path: Path, name: str) -> None:
    joints, at_once, in_series = SERIES[name]
    m = loaded(tmp_path, body("a"), *joints)
    (group,) = [x for x in m.remarks if "hold all at once" in x.text]
    assert group.kind == "motion" and all(f"/World/{x}" in group.names[0] for x in "HK")
    assert 'serial_joints="auto"' in group.text
    assert m.compile().mobility == at_once
    series = loaded(tmp_path, body("a"), *joints, serial_joints="auto")
    assert series.compile().mobility == in_series
    assert kinds(series, "one after the other") == {"changed"} and not kinds(series, "hold all at once")


def test_a_series_of_hinges_moves_like_a_cross_of_two(tmp_path: Path) -> None:
    both = [hinge("H", "X"), hinge("K", "Y")]
    m = loaded(tmp_path, body("a", com="(0.3, 0.2, 0.25)"), *both, serial_joints="auto")
    same = pt.Mechanism("same", gravity=(0, 0, -9.81))
    a = same.add_body("a", mass=1.0, com=(0.3, 0.2, 0.25), inertia=(0.1, 0.2, 0.3))
    same.add_universal("U", same.ground, a, point=(0, 0, 0), axis1=(1, 0, 0), axis2=(0, 1, 0))
    mine = rates(m, H=2.0, K=3.0)
    run = same.simulate(1e-7, t_eval=[0.0, 1e-7], initial=same.assemble(rates={"U": [2.0, 3.0]}))
    assert [mine["H"], mine["K"]] == pytest.approx(run.joint("U").acceleration[0], rel=1e-10)


def test_a_file_states_that_its_joints_add_mobility(tmp_path: Path) -> None:
    schemas, line = "PhysicsRigidBodyAPI PhysicsMassAPI NewtonArticulationRootAPI", "bool newton:jointsAddMobility = 1"
    one = body("a", line).replace("PhysicsRigidBodyAPI, PhysicsMassAPI", schemas)
    m = loaded(tmp_path, one, hinge("H", "X"), hinge("K", "Y"))
    assert m.compile().mobility == 2 and kinds(m, "one after the other") == {"changed"}


def test_joints_that_free_the_same_motion_are_not_in_series(tmp_path: Path) -> None:
    """A door on two hinges, a block on two rails, and two joined points, which are a hinge."""
    door = [hinge("H", "Z"), hinge("K", "Z", points("(0, 0, 1)", "(0, 0, 1)"))]
    rails = [hinge(n, "X", points(p, p), kind="PrismaticJoint") for n, p in (("H", "(0, 0, 0)"), ("K", "(0, 1, 0)"))]
    balls = [joint("SphericalJoint", n, ("", "a"), points(p, p)) for n, p in (("H", "(0, 0, 0)"), ("K", "(0, 1, 0)"))]
    for pair in (door, rails, balls):
        m = loaded(tmp_path, body("a"), *pair, serial_joints="auto")
        assert m.compile().mobility == 1 and not kinds(m, "between the same two bodies")


def test_a_series_that_is_drawn_away_from_zero_is_refused(tmp_path: Path) -> None:
    pair = [hinge("H", "X", kind="PrismaticJoint"), hinge("K", "Y", kind="PrismaticJoint")]
    with pytest.raises(pt.errors.FileFormatError, match="drawn away from where all its coordinates are zero"):
        loaded(tmp_path, body("a", at(0.1, 0, 0)), *pair, serial_joints="auto")


def test_files_of_partita_say_what_they_mean(tmp_path: Path) -> None:
    m = pt.Mechanism("crossed", gravity=None)
    a = m.add_body("a", mass=1.0, inertia=(0.1, 0.2, 0.3))
    m.add_revolute("H", m.ground, a, point=(0, 0, 0), axis=(1, 0, 0))
    m.add_revolute("K", m.ground, a, point=(0, 0, 0), axis=(0, 1, 0))
    m.save(tmp_path / "crossed.usda")
    again = pt.load(tmp_path / "crossed.usda", serial_joints="auto")
    assert again.compile().mobility == 0 and not kinds(again, "between the same two bodies")


# ---- springs, dampers and rotors of a joint ----


def along(folder: Path, kind: str, *lines: str, scene: str = "", schemas: str = "") -> Any:
    one = joint(kind, "A", ("", "a"), *lines, schemas=f"NewtonJointAPI MjcJointAPI {schemas}")
    text = usd(SCENE.replace("float physics:gravityMagnitude = 9.81", f"float physics:gravityMagnitude = 0\n{scene}"),
               body("a", com="(0, 0, 0)"), one)  # fmt: skip
    return pt.load(put(folder, text))


DEGREE = np.pi / 180
LAWS = {  # I = 0.1 about x and m = 1 along it: acceleration at x = 0 and a rate of 2
    "newton": ("RevoluteJoint", ["float newton:damping = 0.01"], -2 * 0.01 / DEGREE / 0.1),
    "newton slides": ("PrismaticJoint", ["float newton:damping = 0.01"], -2 * 0.01),
    "mujoco": ("RevoluteJoint", ["double mjc:damping = 0.3"], -2 * 0.3 / 0.1),
    "newton first": ("PrismaticJoint", ["float newton:damping = 0.01", "double mjc:damping = 7"], -2 * 0.01),
    "spring": ("RevoluteJoint", ["double mjc:stiffness = 3", "double mjc:springref = 40", "double mjc:ref = 10"],
               3 * 30 * DEGREE / 0.1),
    "spring of a slide": ("PrismaticJoint", ["double mjc:stiffness = 3", "double mjc:springref = 0.4"], 1.2),
    "rotor": ("RevoluteJoint", ["double mjc:damping = 0.3", "float newton:armature = 0.4"], -2 * 0.3 / 0.5),
    "rotor of MuJoCo": ("PrismaticJoint", ["double mjc:damping = 0.3", "double mjc:armature = 0.5"], -0.6 / 1.5),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_passive_laws_of_joints(tmp_path: Path, name: str) -> None:
    kind, lines, expected = LAWS[name]
    m = along(tmp_path, kind, *lines)
    assert rates(m, A=2.0)["A"] == pytest.approx(expected, rel=1e-7)
    assert {group.kind for group in m.remarks} <= {"used"}


def test_passive_laws_stand_beside_drives(tmp_path: Path) -> None:
    spring = drive("linear", stiffness=8.0, damping=1.0, targetPosition=0.5)
    own = ("double mjc:stiffness = 2", "double mjc:springref = -0.5", "float newton:damping = 0.5")
    m = along(tmp_path, "PrismaticJoint", spring, *own, schemas="PhysicsDriveAPI:linear")
    assert rates(m, A=2.0)["A"] == pytest.approx(8 * 0.5 - 2 * 1.0 - 2 * 0.5 - 0.5 * 2.0, rel=1e-7)


def test_settings_of_the_scene(tmp_path: Path) -> None:
    spring = "double mjc:stiffness = 3", "double mjc:springref = 0.5", "double mjc:damping = 0.7"
    in_radians = along(tmp_path, "RevoluteJoint", *spring, scene='uniform token mjc:compiler:angle = "radian"')
    assert rates(in_radians)["A"] == pytest.approx(3 * 0.5 / 0.1, rel=1e-7)
    off = along(tmp_path, "RevoluteJoint", *spring, scene="uniform bool mjc:flag:spring = 0")
    assert rates(off, A=2.0)["A"] == pytest.approx(-2 * 0.7 / 0.1, rel=1e-7)
    light = prim("PhysicsScene", "scene", "bool newton:gravityEnabled = 0", schemas="NewtonSceneAPI")
    assert pt.load(put(tmp_path, usd(light, body("a")))).gravity == pytest.approx((0, 0, 0), abs=0)


def test_a_rotor_about_a_ball_is_a_remark_of_the_motion(tmp_path: Path) -> None:
    m = along(tmp_path, "SphericalJoint", "float newton:armature = 0.4", "float newton:damping = 0.2")
    assert kinds(m, "newton:armature 0.4, newton:damping 0.2") == {"motion"}
    assert not kinds(along(tmp_path, "SphericalJoint", "float newton:armature = 0"), "rotor")


# ---- joints that follow others ----


def followed(folder: Path, kind: str, *lines: str, schemas: str, scene: str = "") -> Any:
    """A joint B that follows A."""
    text = usd(SCENE.replace("9.81", f"0\n{scene}"), body("a", com="(0, 0, 0)"), body("b", com="(0, 0, 0)"),
               joint(kind, "A", ("", "a")), joint(kind, "B", ("", "b"), *lines, schemas=schemas))  # fmt: skip
    return pt.load(put(folder, text))


NEWTON = "rel newton:mimicJoint = </World/A>"
MIMICS = {
    "newton": ("RevoluteJoint", "NewtonMimicAPI",
               [NEWTON, "float newton:mimicCoef0 = 30", "float newton:mimicCoef1 = -2"], (30 * DEGREE, -2.0)),
    "newton slides": ("PrismaticJoint", "NewtonMimicAPI", [NEWTON, "float newton:mimicCoef0 = 0.5"], (0.5, 1.0)),
    "mujoco": ("RevoluteJoint", "MjcEqualityJointAPI",
               ["rel mjc:target = </World/A>", "double mjc:coef0 = 0.5", "double mjc:coef1 = 3"], (0.5, 3.0)),
    "both": ("RevoluteJoint", "NewtonMimicAPI MjcEqualityJointAPI",
             [NEWTON, "float newton:mimicCoef0 = 30", "double mjc:coef0 = 7"], (30 * DEGREE, 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", MIMICS)
def test_a_joint_follows_another(tmp_path: Path, name: str) -> None:
    kind, schemas, lines, (offset, factor) = MIMICS[name]
    m = followed(tmp_path, kind, *lines, schemas=schemas)
    (tie,) = m.to_spec()["couplings"]
    assert tie["factors"] == [1.0, -factor] and tie["offset"] == pytest.approx(offset, rel=1e-9)
    assert m.compile().mobility == 1 and {group.kind for group in m.remarks} == {"used"}


def test_couplings_that_are_not_read_are_remarks_of_the_motion(tmp_path: Path) -> None:
    api = "NewtonMimicAPI MjcEqualityJointAPI"
    bent = followed(tmp_path, "RevoluteJoint", NEWTON, "double mjc:coef2 = 1", schemas=api)
    assert kinds(bent, "polynomial of higher order") == {"motion"}
    none = followed(tmp_path, "RevoluteJoint", "float newton:mimicCoef1 = 2", schemas=api)
    assert kinds(none, "to nothing") == {"motion"}
    off = followed(tmp_path, "RevoluteJoint", NEWTON, "bool newton:mimicEnabled = 0", schemas=api)
    assert off.compile().mobility == 2 and kinds(off, "which the file disables") == {"changed"}
    alone = followed(tmp_path, "RevoluteJoint", NEWTON, schemas="")
    assert kinds(alone, "newton:mimicJoint") == {"motion"}


# ---- masses, actuators, tendons, and what is not known ----


def test_an_inertia_of_newton_precedes_moments(tmp_path: Path) -> None:
    given = "double[] newton:inertia = [0.3, 0.2, 0.4, 0.01, 0.02, 0.03]"
    m = loaded(tmp_path, body("a", given, schemas="NewtonMassAPI"))
    expected = [[0.3, 0.01, 0.02], [0.01, 0.2, 0.03], [0.02, 0.03, 0.4]]
    assert np.array(m.bodies["a"].inertia) == pytest.approx(np.array(expected), abs=0)


def test_a_shape_with_a_mass_of_zero_counts_with_its_volume(tmp_path: Path) -> None:
    """As USD has it; MuJoCo means no mass, which a remark of the motion says."""
    box = "PhysicsCollisionAPI PhysicsMassAPI"
    cube = prim("Cube", "s", "double size = 0.1", "float physics:mass = 0", schemas=box)
    m = loaded(tmp_path, prim("Xform", "a", cube, schemas="PhysicsRigidBodyAPI"))
    assert m.bodies["a"].mass == pytest.approx(1.0) and kinds(m, "a mass of 0") == {"motion"}


def test_a_welded_body_may_have_no_mass(tmp_path: Path) -> None:
    """The base of a robot, as MuJoCo and its converter leave it; a body that moves needs mass."""
    base, tip = (prim("Xform", name, schemas="PhysicsRigidBodyAPI") for name in ("base", "tip"))
    root, end = joint("FixedJoint", "R", ("", "base")), joint("FixedJoint", "T", ("a", "tip"))
    arm = body("a"), joint("RevoluteJoint", "A", ("base", "a"))
    m = loaded(tmp_path, base, root, *arm, tip, end)
    assert m.compile().mobility == 1 and m.bodies["base"].mass == m.bodies["tip"].mass == 0.0
    assert kinds(m, "welded to the ground") == {"changed"} and kinds(m, "welded to a body that moves") == {"motion"}
    assert m.compile().mass_matrix(np.zeros(1)) == pytest.approx(
        loaded(tmp_path, body("a"), joint("RevoluteJoint", "A", ("", "a"))).compile().mass_matrix(np.zeros(1))
    )
    with pytest.raises(pt.errors.FileFormatError, match='"/World/base" has no mass, and no shape'):
        loaded(tmp_path, base, *arm)


def test_gravity_that_is_compensated(tmp_path: Path) -> None:
    line = "custom float mjc:body:gravcomp = {}"
    assert loaded(tmp_path, body("a", line.format(1))).bodies["a"].gravity is False
    assert kinds(loaded(tmp_path, body("a", line.format(0.5))), "gravcomp 0.5") == {"motion"}


def test_actuators_and_tendons_by_whether_they_act(tmp_path: Path) -> None:
    target = "rel newton:targets = </World/A>"
    parts = [
        prim("NewtonActuator", "pd", target, "float newton:kp = 3", schemas="NewtonPDControlAPI"),
        prim("NewtonActuator", "idle", target, "float newton:kp = 0", schemas="NewtonPDControlAPI"),
        prim("MjcActuator", "servo", "rel mjc:target = </World/A>", 'uniform token mjc:biasType = "affine"'),
        prim("MjcActuator", "motor", "rel mjc:target = </World/A>"),
        prim("MjcTendon", "band", "uniform double mjc:stiffness = 3"),
        prim("MjcTendon", "string", "uniform double mjc:range:max = 3"),
        prim("MjcTendon", "thread"),
    ]
    m = loaded(tmp_path, body("a"), joint("RevoluteJoint", "A", ("", "a")), *parts)
    expected = {"pd": "motion", "idle": "bounds", "servo": "motion", "motor": "bounds", "band": "motion"}
    expected |= {"string": "bounds", "thread": "other"}
    assert {name: kinds(m, f"/World/{name}") for name in expected} == {name: {x} for name, x in expected.items()}
    assert kinds(m, "add_rope") == {"bounds"}


def test_what_is_not_known_of_newton_and_mujoco_may_move(tmp_path: Path) -> None:
    m = loaded(tmp_path, body("a", "float newton:drag = 3"), joint("RevoluteJoint", "A", ("", "a"), "float mjc:x = 1"))
    assert kinds(m, "newton:drag 3") == kinds(m, "mjc:x 1") == {"motion"}


def test_limits_and_drives_without_their_schema_are_remarks_of_the_motion(tmp_path: Path) -> None:
    """USD ignores them; whoever wrote them means that they lock a direction, or act."""
    lines, _ = locked("transX", "transY", "transZ", "rotY", "rotZ")
    m = loaded(tmp_path, body("a"), joint("Joint", "A", ("", "a"), lines, drive("rotX", stiffness=3)))
    assert m.compile().mobility == 6
    assert kinds(m, "limit:transX:physics:low 1") == kinds(m, "drive:rotX:physics:stiffness 3") == {"motion"}
