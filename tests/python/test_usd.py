"""USD physics: bodies, masses, joints, drives and units as the schema has them; layers as USD composes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd_files import SCENE, at, body, drive, four_bar, joint, points, prim, put, usd

import partita as pt

pytest.importorskip("pxr", reason="usd-core is an extra")


def loaded(folder: Path, *parts: str, **metadata: str) -> Any:
    return pt.load(put(folder, usd(*parts, **metadata)))


def record(m: Any, table: str, name: str) -> dict[str, Any]:
    return next(x for x in m.to_spec()[table] if x["name"] == name)


def remarks(m: Any) -> str:
    return str(m.reading)


def test_a_four_bar_moves_like_the_same_one_by_calls(tmp_path: Path) -> None:
    m = pt.load(put(tmp_path, four_bar()))
    assert m.gravity == pytest.approx((0, 0, -9.81), abs=0) and len(m.joints) == 4
    same = pt.Mechanism("same", gravity=(0, 0, -9.81))
    up = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    inertia = (0.1, 0.2, 0.3)
    bodies = [
        same.add_body("crank", mass=1.5, inertia=inertia, com=(0.25, 0, 0), position=(0, 0, 0), orientation=up),
        same.add_body("coupler", mass=2.0, inertia=inertia, com=(0.7, 0, 0.1), position=(0, 0, 0.5)),
        same.add_body(
            "rocker", mass=0.75, inertia=inertia, com=(0.375, 0, 0), position=(1.5, 0, -0.25), orientation=up
        ),
    ]
    ends = [(same.ground, bodies[0]), (bodies[0], bodies[1]), (bodies[1], bodies[2]), (same.ground, bodies[2])]
    at_points = [(0, 0, 0), (0, 0, 0.5), (1.5, 0, 0.5), (1.5, 0, -0.25)]
    for name, pair, point in zip("ABCD", ends, at_points, strict=True):
        same.add_revolute(name, *pair, point=point, axis=(0, 1, 0))
    runs = [x.simulate(1e-6, t_eval=[0.0, 1e-6], initial=x.assemble(rates={"A": 3.0})) for x in (m, same)]
    for name in "ABCD":
        mine, other = (float(run.joint(name).acceleration[0, 0]) for run in runs)
        assert mine == pytest.approx(other, rel=1e-12)
    assert not [group for group in m.remarks if group.kind not in ("used",)]


@pytest.mark.parametrize(("up", "axis"), [("Z", 2), ("Y", 1)])
def test_units_and_the_direction_up_are_those_of_the_stage(tmp_path: Path, up: str, axis: int) -> None:
    """Centimetres, grams and degrees: a spring of 1 g cm^2/s^2 a degree is 1e-7 N m a degree."""
    m = loaded(
        tmp_path,
        body("rod", at(100, 0, 0), mass=500.0, com="(50, 0, 0)"),
        joint(
            "RevoluteJoint",
            "A",
            ("", "rod"),
            "point3f physics:localPos0 = (100, 0, 0)",
            drive("angular", stiffness=2.0, damping=0.5, targetPosition=30.0),
            schemas="PhysicsDriveAPI:angular",
        ),
        metersPerUnit="0.01",
        kilogramsPerUnit="0.001",
        upAxis=f'"{up}"',
    )
    down = [0.0, 0.0, 0.0]
    down[axis] = -9.81
    assert list(m.gravity) == down
    rod, spring = record(m, "bodies", "rod"), record(m, "forces", "spring of A")
    assert rod["mass"] == 0.5 and rod["com"] == [0.5, 0.0, 0.0] and rod["position"] == [1.0, 0.0, 0.0]
    assert np.diag(rod["inertia"]) == pytest.approx([1e-8, 2e-8, 3e-8], rel=1e-12)
    assert spring["stiffness"] == pytest.approx(2e-7 * 180 / np.pi, rel=1e-12)
    assert spring["damping"] == pytest.approx(0.5e-7 * 180 / np.pi, rel=1e-12)
    assert spring["angle"] == pytest.approx(np.pi / 6, rel=1e-12)
    assert record(m, "joints", "A")["point"] == [1.0, 0.0, 0.0]


def test_without_units_lengths_are_in_centimetres_with_y_up(tmp_path: Path) -> None:
    m = loaded(tmp_path, body("stone", at(100, 0, 0)), metersPerUnit="", kilogramsPerUnit="", upAxis="")
    assert m.bodies["stone"].position == pytest.approx([1, 0, 0], abs=0)
    assert list(m.gravity) == [0.0, -9.81, 0.0]
    assert "no metersPerUnit is given" in remarks(m) and "no scene is given" in remarks(m)


def test_gravity_of_a_scene(tmp_path: Path) -> None:
    def of(*lines: str, **metadata: str) -> list[float]:
        return list(loaded(tmp_path, prim("PhysicsScene", "scene", *lines), body("stone"), **metadata).gravity)

    assert of() == [0.0, 0.0, -9.81]
    assert of("vector3f physics:gravityDirection = (0, 2, 0)") == [0.0, 9.81, 0.0]
    assert of("float physics:gravityMagnitude = 162", metersPerUnit="0.01") == pytest.approx([0, 0, -1.62], rel=1e-15)
    assert of("float physics:gravityMagnitude = 0") == [0.0, 0.0, 0.0]
    two = loaded(tmp_path, SCENE, SCENE.replace('"scene"', '"other"').replace("9.81", "1"), body("stone"))
    assert two.gravity[2] == -9.81 and "more than one scene" in remarks(two)


BOX = "PhysicsCollisionAPI PhysicsMassAPI"
SHAPES = {
    "cube": (prim("Cube", "s", "double size = 0.2", schemas=BOX), 8.0, (8 * 0.08 / 12,) * 3),
    "sphere": (prim("Sphere", "s", "double radius = 0.1", schemas=BOX), 4000 / 3 * np.pi * 1e-3, None),
    "cylinder": (
        prim("Cylinder", "s", "double radius = 0.1", "double height = 0.3", schemas=BOX),
        1000 * np.pi * 0.003,
        (np.pi * 3 * (0.01 / 4 + 0.09 / 12), np.pi * 3 * (0.01 / 4 + 0.09 / 12), np.pi * 3 * 0.005),
    ),
    "cone": (
        prim("Cone", "s", "double radius = 0.1", "double height = 0.3", 'uniform token axis = "X"', schemas=BOX),
        np.pi,
        (0.3 * np.pi * 0.01, np.pi * (0.0015 + 3 / 80 * 0.09), np.pi * (0.0015 + 3 / 80 * 0.09)),
    ),
    "density of its own": (
        prim("Cube", "s", "double size = 0.2", "float physics:density = 500", schemas=BOX),
        4.0,
        (4 * 0.08 / 12,) * 3,
    ),
    "mass of its own": (
        prim("Cube", "s", "double size = 0.2", "float physics:mass = 3", schemas=BOX),
        3.0,
        (3 * 0.08 / 12,) * 3,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_body_without_mass_has_that_of_its_shapes(tmp_path: Path, name: str) -> None:
    shape, mass, moments = SHAPES[name]
    m = loaded(tmp_path, prim("Xform", "a", shape, schemas="PhysicsRigidBodyAPI"))
    found = record(m, "bodies", "a")
    assert found["mass"] == pytest.approx(mass, rel=1e-12)
    expected = (0.4 * mass * 0.01,) * 3 if moments is None else moments
    assert np.diag(found["inertia"]) == pytest.approx(expected, rel=1e-12)
    assert found["com"] == pytest.approx([-0.075 if name == "cone" else 0.0, 0, 0], abs=1e-16)


def test_a_capsule_is_a_cylinder_and_two_halves_of_a_ball(tmp_path: Path) -> None:
    shape = prim("Capsule", "s", "double radius = 0.1", "double height = 0.3", schemas="PhysicsCollisionAPI")
    found = record(loaded(tmp_path, prim("Xform", "a", shape, schemas="PhysicsRigidBodyAPI")), "bodies", "a")
    r, h = 0.1, 0.3
    z = np.linspace(-h / 2 - r, h / 2 + r, 400001)
    beyond = np.maximum(np.abs(z) - h / 2, 0.0)
    disc = 1000 * np.pi * (r**2 - beyond**2)
    assert found["mass"] == pytest.approx(np.trapezoid(disc, z), rel=1e-9)
    about = np.trapezoid(disc * ((r**2 - beyond**2) / 4 + z**2), z)
    assert found["inertia"][0][0] == pytest.approx(about, rel=1e-8)
    assert found["inertia"][2][2] == pytest.approx(np.trapezoid(disc * (r**2 - beyond**2) / 2, z), rel=1e-8)


CORNERS = "point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (0,0,1), (1,0,1), (1,1,1), (0,1,1)]"
FACES = "int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]"
AROUND = "int[] faceVertexIndices = [3,2,1,0, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7]"


@pytest.mark.parametrize("form", ["none", "convexHull", "boundingCube", "convexDecomposition"])
def test_a_mesh_has_the_mass_of_its_volume(tmp_path: Path, form: str) -> None:
    approximation = f'uniform token physics:approximation = "{form}"'
    schemas = "PhysicsCollisionAPI PhysicsMeshCollisionAPI"
    mesh = prim("Mesh", "s", CORNERS, FACES, AROUND, approximation, "double3 xformOp:scale = (0.1, 0.2, 0.3)",
                'uniform token[] xformOpOrder = ["xformOp:scale"]', schemas=schemas)  # fmt: skip
    m = loaded(tmp_path, prim("Xform", "a", mesh, schemas="PhysicsRigidBodyAPI"))
    found = record(m, "bodies", "a")
    assert found["mass"] == pytest.approx(6.0, rel=1e-12)
    assert found["com"] == pytest.approx([0.05, 0.1, 0.15], rel=1e-12)
    assert np.diag(found["inertia"]) == pytest.approx([0.5 * 0.13, 0.5 * 0.10, 0.5 * 0.05], rel=1e-12)
    assert ("an approximation of the mesh" in remarks(m)) == (form == "convexDecomposition")
    assert np.abs(found["inertia"] - np.diag(np.diag(found["inertia"]))).max() < 1e-15


def test_what_a_body_gives_precedes_what_its_shapes_say(tmp_path: Path) -> None:
    """Mass of a body is spread over its shapes; density: of a shape, of its body, of its material, 1000."""
    cubes = [prim("Cube", f"s{i}", "double size = 0.1", at(i, 0, 0), schemas="PhysicsCollisionAPI") for i in (0, 1)]
    bodies = "PhysicsRigidBodyAPI PhysicsMassAPI"
    m = loaded(tmp_path, prim("Xform", "a", "float physics:mass = 4", *cubes, schemas=bodies))
    found = record(m, "bodies", "a")
    assert found["mass"] == 4.0 and found["com"] == pytest.approx([0.5, 0, 0], rel=1e-14)
    assert np.diag(found["inertia"]) == pytest.approx([4 * 0.01 / 6, 4 * (0.01 / 6 + 0.25), 4 * (0.01 / 6 + 0.25)])
    shifted = loaded(
        tmp_path, prim("Xform", "a", "float physics:mass = 4", "point3f physics:centerOfMass = (0, 0, 0)", *cubes,
                       schemas=bodies))  # fmt: skip
    assert record(shifted, "bodies", "a")["inertia"][1][1] == pytest.approx(4 * (0.01 / 6 + 0.5))
    material = prim("Material", "steel", "float physics:density = 7800", schemas="PhysicsMaterialAPI")
    bound = prim(
        "Cube", "s", "double size = 0.1", "rel material:binding:physics = </World/steel>",
        schemas="PhysicsCollisionAPI MaterialBindingAPI")  # fmt: skip
    assert record(loaded(tmp_path, material, prim("Xform", "a", bound, schemas="PhysicsRigidBodyAPI")), "bodies", "a")[
        "mass"
    ] == pytest.approx(7.8)
    dense = prim("Xform", "a", "float physics:density = 2000", bound, schemas=bodies)
    assert record(loaded(tmp_path, material, dense), "bodies", "a")["mass"] == pytest.approx(2.0)


STEEL = "rel material:binding:physics = </World/steel>"
MASSES = {
    "nothing": ((), "", ""),
    "a density": (("float physics:density = 500",), "", ""),
    "a mass": (("float physics:mass = 3",), "", ""),
    "a mass and its centre": (("float physics:mass = 3", "point3f physics:centerOfMass = (0, 0, 0)"), "", ""),
    "the mass of a shape": ((), "float physics:mass = 2", ""),
    "a density of a shape and a material": ((), "float physics:density = 2000", STEEL),
    "a density and a material": (("float physics:density = 500",), "", STEEL),
    "an inertia": (("float3 physics:diagonalInertia = (0.1, 0.2, 0.25)",), "", ""),
    "masses of both": (("float physics:mass = 3",), "float physics:mass = 2", ""),
}


@pytest.mark.parametrize("name", MASSES)
def test_masses_are_those_that_usd_itself_computes(tmp_path: Path, name: str) -> None:
    """By the rules in USD's own library, which takes volumes and computes in single precision."""
    from pxr import Gf, Usd, UsdPhysics

    lines, first, second = MASSES[name]
    steel = prim("Material", "steel", "float physics:density = 7800", schemas="PhysicsMaterialAPI")
    shapes = [
        prim("Cube", "s", "double size = 0.2", at(0.3, 0.1, 0), first, schemas=BOX),
        prim("Cube", "t", "double size = 0.1", at(-0.3, 0.2, 0.4), second, schemas=f"{BOX} MaterialBindingAPI"),
    ]
    a = prim("Xform", "a", *lines, *shapes, schemas="PhysicsRigidBodyAPI PhysicsMassAPI")
    path = put(tmp_path, usd(SCENE, steel, a))

    def volume(shape: Any) -> Any:
        found, edge = UsdPhysics.RigidBodyAPI.MassInformation(), shape.GetAttribute("size").Get()
        found.volume, found.inertia = edge**3, Gf.Matrix3f(edge**5 / 6)
        found.centerOfMass, found.localRot = Gf.Vec3f(0), Gf.Quatf(1)
        found.localPos = Gf.Vec3f(shape.GetAttribute("xformOp:translate").Get())
        return found

    stage = Usd.Stage.Open(str(path))
    of = UsdPhysics.RigidBodyAPI(stage.GetPrimAtPath("/World/a"))
    mass, moments, center, _ = of.ComputeMassProperties(volume)
    body_a = pt.load(path).bodies["a"]
    assert body_a.mass == pytest.approx(mass, rel=1e-6)
    assert body_a.com == pytest.approx(np.array(center), abs=1e-6)
    own = np.linalg.eigvalsh(np.array(body_a.inertia))
    assert own == pytest.approx(sorted(moments), rel=2e-6)


def test_principal_axes_and_scales_of_a_body(tmp_path: Path) -> None:
    turn = "quatf physics:principalAxes = (0.70710678, 0, 0, 0.70710678)"
    place = at(0, 0, 0, "float3 xformOp:scale = (2, 3, 4)")
    m = loaded(
        tmp_path,
        body("a", turn, place, com="(1, 1, 1)"),
        joint("SphericalJoint", "A", ("", "a"), points("(2, 3, 4)", "(1, 1, 1)")),
    )
    found = record(m, "bodies", "a")
    assert np.diag(found["inertia"]) == pytest.approx([0.2, 0.1, 0.3], rel=1e-14)
    assert found["com"] == [2.0, 3.0, 4.0]
    assert record(m, "joints", "A") == {
        "name": "A", "kind": "spherical", "parent": "ground", "child": "a", "point": [2.0, 3.0, 4.0], "cut": "auto"
    }  # fmt: skip


def locked(*axes: str) -> tuple[str, str]:
    """Lines and schemas of locked directions."""
    lines = "\n".join(f"float limit:{a}:physics:low = 1\nfloat limit:{a}:physics:high = -1" for a in axes)
    return lines, " ".join(f"PhysicsLimitAPI:{a}" for a in axes)


JOINTS: dict[str, tuple[str, tuple[str, ...], dict[str, Any]]] = {
    "fixed": ("FixedJoint", (), {"kind": "fixed"}),
    "revolute": ("RevoluteJoint", (), {"kind": "revolute", "axis": [1, 0, 0]}),
    "prismatic": ("PrismaticJoint", (), {"kind": "prismatic", "axis": [1, 0, 0]}),
    "spherical": ("SphericalJoint", (), {"kind": "spherical"}),
    "all but one turn": (
        "Joint",
        ("transX", "transY", "transZ", "rotX", "rotZ"),
        {"kind": "revolute", "axis": [0, 1, 0]},
    ),
    "all but one slide": (
        "Joint",
        ("transX", "transY", "rotX", "rotY", "rotZ"),
        {"kind": "prismatic", "axis": [0, 0, 1]},
    ),
    "slides": ("Joint", ("transX", "transY", "transZ"), {"kind": "spherical"}),
    "all": ("Joint", ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"), {"kind": "fixed"}),
    "none": ("Joint", (), {"kind": "free"}),
    "a sleeve": ("Joint", ("transX", "transY", "rotX", "rotY"), {"kind": "cylindrical", "axis": [0, 0, 1]}),
    "a plane": ("Joint", ("transZ", "rotX", "rotY"), {"kind": "generic", "free": ["x", "y", "rz"]}),
    "a line": ("Joint", ("transY", "transZ"), {"kind": "generic", "free": ["x", "rx", "ry", "rz"]}),
    "a cross": (
        "Joint",
        ("transX", "transY", "transZ", "rotZ"),
        {"kind": "universal", "axis": [0, 1, 0], "axis2": [1, 0, 0]},
    ),
}


@pytest.mark.parametrize("name", JOINTS)
def test_each_joint(tmp_path: Path, name: str) -> None:
    kind, axes, expected = JOINTS[name]
    lines, schemas = locked(*axes)
    m = loaded(tmp_path, SCENE, body("a"), joint(kind, "A", ("", "a"), lines, schemas=schemas))
    found = record(m, "joints", "A")
    assert {key: found[key] for key in expected} == expected
    assert ("order" in remarks(m)) == (name == "a cross")


def test_a_joint_drawn_away_from_zero_keeps_its_place_and_shifts_its_spring(tmp_path: Path) -> None:
    """Frames 90 degrees and 2 m apart along the coordinates: the bodies stay, springs rest where the file says."""
    spring = drive("angular", stiffness=1.0, targetPosition=120.0)
    m = loaded(
        tmp_path,
        SCENE,
        body("a", at(0, 0, 0, "float xformOp:rotateX = 90")),
        joint("RevoluteJoint", "A", ("", "a"), spring, schemas="PhysicsDriveAPI:angular"),
        body("b", at(3, 0, 0)),
        joint("PrismaticJoint", "B", ("", "b"), "point3f physics:localPos0 = (1, 0, 0)",
              drive("linear", stiffness=10, targetPosition=2.5), schemas="PhysicsDriveAPI:linear"),
    )  # fmt: skip
    assert record(m, "forces", "spring of A")["angle"] == pytest.approx(np.pi / 6, rel=1e-7)
    assert record(m, "forces", "spring of B")["angle"] == 0.5
    assert not any("apart" in key or "child_" in key for x in m.to_spec()["joints"] for key in x)
    state = m.assemble()
    assert np.max(np.abs(state.q)) == 0.0
    assert "closed" not in remarks(m)


def test_a_joint_that_is_not_closed_as_drawn_is_reported_and_assembled(tmp_path: Path) -> None:
    m = loaded(tmp_path, SCENE, body("a", at(0.01, 0, 0)), joint("SphericalJoint", "A", ("", "a")))
    assert "open by 0.01 m, 0 deg: not closed as drawn; assembly closes it" in remarks(m)
    bad = joint("PrismaticJoint", "B", ("", "b"), "quatf physics:localRot0 = (0.999, 0.04, 0, 0)")
    m = loaded(tmp_path, SCENE, body("b"), bad)
    assert record(m, "joints", "B")["kind"] == "generic" and "deg: not closed" in remarks(m)


def test_drives_are_springs_dampers_and_constant_efforts(tmp_path: Path) -> None:
    def of(kind: str, **numbers: object) -> Any:
        axis = "angular" if kind == "RevoluteJoint" else "linear"
        one = joint(kind, "A", ("", "a"), drive(axis, **numbers), schemas=f"PhysicsDriveAPI:{axis}")
        return loaded(tmp_path, SCENE, body("a"), one)

    both = record(
        of("PrismaticJoint", stiffness=8, damping=2, targetPosition=0.5, targetVelocity=3), "forces", "spring of A"
    )
    assert (both["stiffness"], both["damping"], both["angle"]) == (8.0, 2.0, 0.5 + 2 * 3 / 8)
    damped = of("RevoluteJoint", damping=2, targetVelocity=90)
    assert record(damped, "forces", "torque on A")["value"] == {"constant": pytest.approx(180.0)}
    assert record(damped, "forces", "spring of A")["damping"] == pytest.approx(360 / np.pi)
    none = of("RevoluteJoint", stiffness=5, type='"acceleration"')
    assert not none.to_spec()["forces"] and "a drive would give an acceleration" in remarks(none)
    assert "a bound of the drive's effort" in remarks(of("PrismaticJoint", stiffness=5, maxForce=10))
    other = joint("SphericalJoint", "A", ("", "a"), drive("rotX", stiffness=5), schemas="PhysicsDriveAPI:rotX")
    (group, _) = loaded(tmp_path, SCENE, body("a"), other).remarks
    assert group.kind == "motion" and "an axis that is not a coordinate" in group.text


def test_drives_of_chosen_directions(tmp_path: Path) -> None:
    lines, schemas = locked("transZ", "rotX", "rotY")
    one = joint(
        "Joint", "A", ("", "a"), lines,
        drive("transY", stiffness=3), drive("rotZ", damping=1), drive("rotX", damping=1),
        schemas=f"{schemas} PhysicsDriveAPI:transY PhysicsDriveAPI:rotZ PhysicsDriveAPI:rotX")  # fmt: skip
    m = loaded(tmp_path, SCENE, body("a"), one)
    forces = {x["coordinate"]: x for x in m.to_spec()["forces"]}
    assert forces[1]["stiffness"] == 3.0 and forces[2]["damping"] == pytest.approx(180 / np.pi)
    assert "a direction that is not a coordinate" in remarks(m)


def test_distances(tmp_path: Path) -> None:
    def of(least: float, most: float) -> Any:
        lines = f"float physics:minDistance = {least}", f"float physics:maxDistance = {most}"
        return loaded(tmp_path, SCENE, body("a", at(0, 0, 2)), joint("DistanceJoint", "D", ("", "a"), *lines))

    assert of(2, 2).to_spec()["couplings"][0]["offset"] == 2.0
    assert not of(1, 3).to_spec().get("couplings") and "distance 1 to 3: limits do not act" in remarks(of(1, 3))
    assert "without distances holds nothing" in remarks(of(-1, -1))


def test_rotors_and_mimics_of_physx(tmp_path: Path) -> None:
    rotor = "PhysxJointAPI", "float physxJoint:armature = 0.2"
    follows = "\n".join([
        "float physxMimicJoint:rotX:gearing = -2", "float physxMimicJoint:rotX:offset = 90",
        "rel physxMimicJoint:rotX:referenceJoint = </World/A>"])  # fmt: skip
    m = loaded(
        tmp_path,
        SCENE,
        body("a", schemas="PhysxRigidBodyAPI"),
        body("b"),
        joint("RevoluteJoint", "A", ("", "a"), rotor[1], "float physxJoint:jointFriction = 0.1", schemas=rotor[0]),
        joint("RevoluteJoint", "B", ("", "b"), follows, schemas="PhysxMimicJointAPI:rotX"),
        'def Xform "c" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysxRigidBodyAPI", "PhysicsMassAPI"])\n{\n'
        "bool physxRigidBody:disableGravity = 1\nfloat physics:mass = 1\nfloat3 physics:diagonalInertia = (1, 1, 1)\n}",
    )
    assert record(m, "rotors", "rotor of A")["inertia"] == 0.2
    tie = m.to_spec()["couplings"][0]
    assert tie["factors"] == [1.0, -2.0] and tie["offset"] == pytest.approx(-np.pi / 2)
    assert m.bodies["c"].gravity is False
    assert "jointFriction 0.1: friction would resist" in remarks(m)


def test_bodies_that_do_not_move_by_themselves(tmp_path: Path) -> None:
    m = loaded(
        tmp_path,
        SCENE,
        body("moved", "bool physics:kinematicEnabled = 1", at(1, 0, 0)),
        body("still", "bool physics:rigidBodyEnabled = 0"),
        body("a", "bool physics:startsAsleep = 1", "vector3f physics:velocity = (1, 0, 0)"),
        joint("RevoluteJoint", "A", ("moved", "a"), points("(0, 0, 0)", "(1, 0, 0)")),
        joint("RevoluteJoint", "off", ("", "a"), "bool physics:jointEnabled = 0"),
        joint("RevoluteJoint", "none", ("", "still")),
    )
    assert list(m.bodies) == ["a"] and list(m.joints) == ["A"]
    assert record(m, "joints", "A")["parent"] == "ground" and record(m, "joints", "A")["point"] == [1.0, 0.0, 0.0]
    for words in ("stands still as part of the ground", "not enabled as a body", "until something touches",
                  "with this velocity", "not enabled in the file", "two frames of the same body"):  # fmt: skip
        assert words in remarks(m), words


def test_joints_say_whether_the_base_of_an_articulation_floats(tmp_path: Path) -> None:
    arm = body("arm", at(0, 0, 1)), joint("RevoluteJoint", "A", ("base", "arm"), points("(0, 0, 1)", "(0, 0, 0)"))
    free = loaded(tmp_path, SCENE, body("base", schemas="PhysicsArticulationRootAPI"), *arm)
    assert free.compile().mobility == 7
    root = joint("FixedJoint", "root", ("", "base"), schemas="PhysicsArticulationRootAPI")
    fixed = loaded(tmp_path, SCENE, body("base"), root, *arm)
    assert fixed.compile().mobility == 1 and {group.kind for group in fixed.remarks} == {"used"}


def test_looks_alone_are_no_remarks(tmp_path: Path) -> None:
    shader = prim("Shader", "paint", 'uniform token info:id = "UsdPreviewSurface"',
                  "color3f inputs:diffuseColor = (1, 0, 0)", "token outputs:surface")  # fmt: skip
    shape = prim(
        "Cube", "s", "double size = 0.1", "color3f[] primvars:displayColor = [(1, 0, 0)]",
        "rel material:binding = </World/look>", schemas="MaterialBindingAPI")  # fmt: skip
    camera = prim("Camera", "eye", "float focalLength = 20", at(0, 0, 5))
    light = prim("SphereLight", "lamp", "float inputs:intensity = 100")
    m = loaded(tmp_path, SCENE, prim("Material", "look", shader), camera, light, body("a", shape))
    assert {group.kind for group in m.remarks} == {"used"}


def test_limits_breaks_and_contacts_are_reported(tmp_path: Path) -> None:
    m = loaded(
        tmp_path,
        SCENE,
        body("a", prim("Cube", "box", "double size = 0.1", schemas="PhysicsCollisionAPI")),
        joint("RevoluteJoint", "A", ("", "a"), "float physics:lowerLimit = -30", "float physics:breakForce = 10"),
        body("b"),
        joint("SphericalJoint", "B", ("", "b"), "float physics:coneAngle0Limit = 45"),
        body("c"),
        joint("Joint", "C", ("", "c"), "float limit:transX:physics:low = -1", "float limit:transX:physics:high = 2",
              schemas="PhysicsLimitAPI:transX"),
        prim("PhysicsCollisionGroup", "group"),
    )  # fmt: skip
    for words in ("lowerLimit -30", "breakForce 10", "coneAngle0Limit 45", "transX -1 to 2", "contacts are not read"):
        assert words in remarks(m), words
    assert m.reading.shapes["a"] == [
        {"kind": "box", "size": [0.1] * 3, "center": [0, 0, 0], "axes": np.eye(3).tolist()}
    ]


# ---- layers and composition ----


def arm(name: str = "Arm") -> str:
    return f'#usda 1.0\n(defaultPrim = "{name}")\n' + body(name, at(0, 0, 1))


def test_references_payloads_sublayers_and_classes_are_composed(tmp_path: Path) -> None:
    put(tmp_path, arm(), "arm.usda")
    (tmp_path / "parts").mkdir()
    put(tmp_path / "parts", "#usda 1.0\n" + usd(body("under")).partition(")\n")[2], "under.usda")
    text = usd(
        SCENE,
        prim("Xform", "one", more="prepend references = @./arm.usda@"),
        prim("Xform", "two", more="prepend payload = @arm.usda@\ninstanceable = true"),
        'class Xform "_kind"\n{\nfloat physics:mass = 7\n}',
        prim("Xform", "three", more="prepend references = @./arm.usda@\nprepend inherits = </World/_kind>"),
        prim("Xform", "four", "", more="active = false\nprepend references = @./arm.usda@"),
        'over "five"\n{\n}',
    ).replace("(\n    meters", "(\n    subLayers = [@./parts/under.usda@]\n    meters")
    m = pt.load(put(tmp_path, text))
    masses = {x["name"]: x["mass"] for x in m.to_spec()["bodies"]}
    assert masses == {"one": 1.0, "two": 1.0, "three": 7.0, "under": 1.0}
    assert 'Xform "/World/four": not active in the file' in remarks(m)
    assert '"/World/five": only changes a prim that is not there' in remarks(m)


def test_bodies_within_instances_and_variants(tmp_path: Path) -> None:
    put(tmp_path, '#usda 1.0\n(defaultPrim = "R")\ndef Xform "R"\n{\n' + body("arm")
        + joint("RevoluteJoint", "A", ("", "arm")).replace("/World/", "/R/") + "}\n", "robot.usda")  # fmt: skip
    both = [prim("Xform", name, at(i, 0, 0), more="instanceable = true\nprepend references = @robot.usda@")
            for i, name in enumerate(("first", "second"))]  # fmt: skip
    m = pt.load(put(tmp_path, usd(SCENE, *both)))
    assert list(m.bodies) == ["World/first/arm", "World/second/arm"]
    assert [x["child"] for x in m.to_spec()["joints"]] == list(m.bodies)
    variants = (
        'def Xform "v" (\nprepend variantSets = "size"\nvariants = { string size = "small" }\n)\n{\n'
        'variantSet "size" = {\n"big" {\n' + body("big") + '}\n"small" {\n' + body("small") + "}\n}\n}\n"
    )
    assert list(loaded(tmp_path, SCENE, variants).bodies) == ["small"]


def test_what_changes_with_time_is_read_at_its_first_time(tmp_path: Path) -> None:
    moving = "double3 xformOp:translate.timeSamples = { 1: (5, 0, 0), 2: (6, 0, 0) }"
    place = f'{moving}\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    m = loaded(tmp_path, SCENE, body("a", place))
    assert m.bodies["a"].position[0] == 5.0 and "changes with time" in remarks(m)


def test_binary_files_and_either_suffix(tmp_path: Path) -> None:
    from pxr import Sdf

    layer = Sdf.Layer.FindOrOpen(str(put(tmp_path, four_bar())))
    for name in ("a.usdc", "b.usd"):
        layer.Export(str(tmp_path / name))
        assert len(pt.load(tmp_path / name).joints) == 4
    assert len(pt.load(put(tmp_path, four_bar(), "c.usd")).joints) == 4


def test_names_that_are_taken(tmp_path: Path) -> None:
    m = loaded(
        tmp_path, SCENE, body("ground"), body("world"), prim("Xform", "x", body("b")), prim("Xform", "y", body("b"))
    )
    assert list(m.bodies) == ["ground link", "world", "World/x/b", "World/y/b"]


def test_a_body_within_a_body_is_one_of_its_own(tmp_path: Path) -> None:
    inner = body("a", at(0, 0, 1), body("b", at(0, 0, 1)))
    weld = joint("FixedJoint", "A", ("a", "a/b"), points("(0, 0, 1)", "(0, 0, 0)"))
    m = loaded(tmp_path, SCENE, inner, weld)
    assert m.bodies["b"].position[2] == 2.0 and m.remarks[0].kind == "used"
