"""Stages of USD with one property, schema or prim more or less, or another number: nothing may be ignored in silence.

`python tests/python/usd_mutations.py` makes every change of the stages below, which have each item of the table once;
`mutations.py` does so for files in XML.
"""

from __future__ import annotations

import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mutations import UNKNOWN, heard
from usd_files import at, body, drive, joint, points, prim, put, usd

import partita as pt
from partita.io.format_table import APPLIED, COMPILED, LOOKS, NO_EFFECT, REFUSED
from partita.io.usd_stage import plain, text
from partita.io.usd_table import OWN, USD

NOT_CHANGED = ("limit:", "drive:rotX", "xformOpOrder", "partita:name", "partita:kind")
"""Numbers of which another one says the same: of locked directions, and of a drive that acts along none."""


NOT_MISSED = ("partita:localPos1", "partita:localRot1")
"""Numbers without which nothing changes: frames of a joint that agree in single precision are one, the first."""
LEFT_OUT = ("K", "moved", "off")
"""Prims that are disabled, or belong to the ground."""


def machine() -> str:
    """A stage with bodies, shapes, joints of each kind, and everything that is reported."""
    locks = ["transX", "transZ", "rotX", "rotY"]
    lines = [f"float limit:{a}:physics:low = 1\nfloat limit:{a}:physics:high = -1" for a in locks]
    own = "PhysicsCollisionAPI PhysicsMassAPI"
    rigid = [
        "bool physxRigidBody:disableGravity = 1",
        "float physxRigidBody:linearDamping = 0.1",
        "float physxRigidBody:angularDamping = 0.1",
        "int physxRigidBody:lockedPosAxis = 1",
        "int physxRigidBody:lockedRotAxis = 1",
        "float physxRigidBody:maxLinearVelocity = 1",
        "float physxRigidBody:maxAngularVelocity = 1",
        "float physxRigidBody:maxDepenetrationVelocity = 1",
        "float physxRigidBody:maxContactImpulse = 1",
        "float physxRigidBody:contactSlopCoefficient = 1",
        "bool physxRigidBody:enableGyroscopicForces = 0",
    ]
    bodies = [
        body("a", "quatf physics:principalAxes = (0.8, 0.6, 0, 0)", *rigid, at(0, 0, 1), schemas="PhysxRigidBodyAPI"),
        body("b", at(1, 0, 1), "bool physics:startsAsleep = 1", "vector3f physics:velocity = (1, 0, 0)",
             "vector3f physics:angularVelocity = (1, 0, 0)", "bool physxArticulation:enabledSelfCollisions = 1",
             schemas="PhysxArticulationAPI"),
        body("moved", "bool physics:kinematicEnabled = 1", at(0, 2, 0)),
        body("off", "bool physics:rigidBodyEnabled = 0"),
        prim("Xform", "c", prim("Cube", "s", "double size = 0.3", "float physics:density = 700", schemas=own),
             schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "d", prim("Sphere", "s", "double radius = 0.2", "float physics:mass = 3",
             "bool physics:collisionEnabled = 0", "float physxCollision:contactOffset = 0.1",
             schemas=f"{own} PhysxCollisionAPI"),
             schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "e", prim("Cylinder", "s", "double radius = 0.2", "double height = 0.7",
             'uniform token axis = "X"', "rel material:binding:physics = </World/steel>",
             schemas="PhysicsCollisionAPI MaterialBindingAPI"), schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "f", prim("Capsule", "s", "double radius = 0.2", "double height = 0.7",
             'uniform token axis = "X"', schemas="PhysicsCollisionAPI"), schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "g", prim("Cone", "s", "double radius = 0.2", "double height = 0.7",
             'uniform token axis = "X"', schemas="PhysicsCollisionAPI"), schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "h", prim("Mesh", "s",
             "point3f[] points = [(0,0,0), (1,0,0), (0,1,0), (0,0,1), (0.1, 0.1, 0.1)]",
             "int[] faceVertexCounts = [3, 3, 3, 3]", "int[] faceVertexIndices = [0,2,1, 0,1,3, 1,2,3, 0,3,2]",
             'uniform token physics:approximation = "convexHull"', "int physxConvexHullCollision:hullVertexLimit = 8",
             schemas="PhysicsCollisionAPI PhysicsMeshCollisionAPI PhysxConvexHullCollisionAPI"),
             schemas="PhysicsRigidBodyAPI"),
        prim("Material", "steel", "float physics:density = 7800", "float physics:dynamicFriction = 0.5",
             "float physics:staticFriction = 0.5", "float physics:restitution = 0.5",
             "float physxMaterial:dampingCombineMode = 1", schemas="PhysicsMaterialAPI PhysxMaterialAPI"),
    ]  # fmt: skip
    full = {"stiffness": 3, "damping": 2, "targetPosition": 5, "targetVelocity": 7, "maxForce": 9}
    hinge = [
        'uniform token physics:axis = "Y"',
        "float physics:lowerLimit = -30",
        "float physics:upperLimit = 30",
        points("(0, 0, 1)", "(0, 0, 0)"),
        "quatf physics:localRot0 = (0.8, 0, 0.6, 0)",
        "quatf physics:localRot1 = (0.8, 0, 0.6, 0)",
        "float physics:breakForce = 10",
        "float physics:breakTorque = 10",
        "float physxJoint:armature = 0.1",
        "float physxJoint:jointFriction = 0.1",
        "float physxJoint:maxJointVelocity = 10",
        drive("angular", **full),
        "float state:angular:physics:position = 1",
        "float state:angular:physics:velocity = 1",
        "float physxLimit:angular:stiffness = 1",
    ]
    follows = [
        "float physxMimicJoint:rotY:gearing = 2",
        "float physxMimicJoint:rotY:offset = 3",
        "rel physxMimicJoint:rotY:referenceJoint = </World/A>",
        "float physxMimicJoint:rotY:naturalFrequency = 3",
        "float physxMimicJoint:rotY:dampingRatio = 3",
        'uniform token physics:axis = "Y"',
        points("(1, 0, 0)", "(0, 0, 0)"),
    ]
    schemas = "PhysicsDriveAPI:angular PhysxJointAPI PhysicsJointStateAPI:angular PhysxLimitAPI:angular"
    joints = [
        joint("RevoluteJoint", "A", ("", "a"), *hinge, schemas=schemas),
        joint("RevoluteJoint", "B", ("a", "b"), *follows, schemas="PhysxMimicJointAPI:rotY"),
        joint("PrismaticJoint", "C", ("", "c"), "float physics:lowerLimit = -3",
              drive("linear", stiffness=4, type='"force"'), schemas="PhysicsDriveAPI:linear"),
        joint("PrismaticJoint", "K", ("d", "c"), "bool physics:jointEnabled = 0",
              drive("linear", damping=4, type='"acceleration"'), schemas="PhysicsDriveAPI:linear"),
        joint("PrismaticJoint", "L", ("", "d"), drive("linear", damping=4, type='"acceleration"'),
              schemas="PhysicsDriveAPI:linear"),
        joint("SphericalJoint", "E", ("", "e"), "float physics:coneAngle0Limit = 30",
              "float physics:coneAngle1Limit = 30", 'uniform token physics:axis = "Y"'),
        joint("DistanceJoint", "F", ("", "f"), "float physics:minDistance = 1", "float physics:maxDistance = 1",
              points("(1, 0, 0)", "(0, 0, 0)")),
        joint("Joint", "G", ("", "g"), *lines,
              "float limit:rotZ:physics:low = -20", "float limit:rotZ:physics:high = 20",
              drive("transY", **full), drive("rotZ", damping=1),
              "float limit:distance:physics:low = 1", "float limit:distance:physics:high = 3",
              schemas=" ".join(f"PhysicsLimitAPI:{a}" for a in (*locks, "rotZ", "distance"))
              + " PhysicsDriveAPI:transY PhysicsDriveAPI:rotZ"),
        joint("FixedJoint", "H", ("", "h")),
    ]  # fmt: skip
    scene = prim("PhysicsScene", "scene", "float physics:gravityMagnitude = 5", "bool physxScene:enableCCD = 1",
                 schemas="PhysxSceneAPI")  # fmt: skip
    return usd(scene, *bodies, *joints, kilogramsPerUnit="2", metersPerUnit="0.5")


def others() -> str:
    """A stage with what Newton and MuJoCo add to USD."""
    scene = prim("PhysicsScene", "scene", "float physics:gravityMagnitude = 5", "bool newton:gravityEnabled = 1",
                 'uniform token mjc:compiler:angle = "radian"', "uniform bool mjc:flag:constraint = 0",
        *(f"uniform bool mjc:flag:{flag} = 1" for flag in ("gravity", "spring", "damper", "equality")),
                 "double mjc:option:density = 1", "double mjc:option:viscosity = 1",
                 "double3 mjc:option:wind = (1, 0, 0)", "double mjc:compiler:setTotalMass = 3",
                 "bool mjc:compiler:balanceInertia = 1", "double mjc:compiler:boundMass = 1",
                 "double mjc:compiler:boundInertia = 1", 'uniform token mjc:compiler:inertiaFromGeom = "true"',
                 schemas="NewtonSceneAPI MjcSceneAPI")  # fmt: skip
    cube = prim("Cube", "s", "double size = 0.3", 'uniform token newton:massModel = "shell"',
                'uniform token mjc:inertia = "shell"', schemas="PhysicsCollisionAPI NewtonMassAPI")  # fmt: skip
    tube = prim("Cube", "t", "double size = 0.3", "uniform bool mjc:shellinertia = 1", schemas="PhysicsCollisionAPI")
    ball = [
        line
        for key in ("stiffness", "damping", "targetPosition", "targetVelocity", "maxForce")
        for line in [f"float drive:rotX:physics:{key} = 1"]
    ]
    laws = [
        "float newton:armature = 0.1", "float newton:damping = 0.2", "double mjc:stiffness = 3",
        "double mjc:springref = 0.4", "double mjc:ref = 0.1", "double mjc:springdamper = 1",
        "float newton:friction = 0.1", "double mjc:frictionloss = 0.1", "float newton:velocityLimit = 3",
        "float newton:limitStiffness = 3", "float newton:limitDamping = 3", "double mjc:margin = 0.1",
        "double mjc:solreflimit = 3", "double mjc:solimplimit = 3", "double mjc:solreffriction = 3",
        "double mjc:solimpfriction = 3", 'uniform token mjc:actuatorfrclimited = "true"',
        "double mjc:actuatorfrcrange:min = -1", "double mjc:actuatorfrcrange:max = 1",
        "bool mjc:actuatorgravcomp = 1",
    ]  # fmt: skip
    follows = [
        "rel newton:mimicJoint = </World/A>", "float newton:mimicCoef0 = 20", "float newton:mimicCoef1 = 2",
        "double mjc:armature = 0.1", "double mjc:damping = 0.1",
    ]  # fmt: skip
    bends = ["rel mjc:target = </World/A>", "double mjc:coef0 = 0.3", "double mjc:coef1 = 2", "double mjc:coef2 = 1",
             "double mjc:coef3 = 1", "double mjc:coef4 = 1", "bool newton:mimicEnabled = 1"]  # fmt: skip
    off = ["rel newton:mimicJoint = </World/A>", "bool newton:mimicEnabled = 0"]
    joints = [
        joint("RevoluteJoint", "A", ("", "a"), *laws, schemas="NewtonJointAPI MjcJointAPI"),
        joint("RevoluteJoint", "B", ("a", "b"), *follows, schemas="NewtonMimicAPI"),
        joint("RevoluteJoint", "C", ("b", "c"), *bends, schemas="MjcEqualityJointAPI"),
        joint("RevoluteJoint", "D", ("b", "d"), *off, schemas="NewtonMimicAPI"),
        joint("FixedJoint", "E", ("", "e"), "double mjc:solref = 3", "double mjc:solimp = 3",
              "float mjc:torqueScale = 2", schemas="MjcEqualityWeldAPI"),
        joint("SphericalJoint", "F", ("", "f"), *ball, schemas="PhysicsDriveAPI:rotX"),
        joint("PrismaticJoint", "G", ("f", "g"), 'uniform token physics:axis = "Y"'),
        joint("RevoluteJoint", "H", ("f", "g"), 'uniform token physics:axis = "Z"'),
    ]  # fmt: skip
    bodies = [
        body("a", "double[] newton:inertia = [0.3, 0.2, 0.4, 0.01, 0.02, 0.03]", schemas="NewtonMassAPI").replace(
            "float3 physics:diagonalInertia = (0.1, 0.2, 0.3)", ""
        ),
        body("b", "float mjc:body:gravcomp = 0.5"), body("c"), body("d"),
        prim("Xform", "e", cube, schemas="PhysicsRigidBodyAPI"),
        prim("Xform", "f", tube, schemas="PhysicsRigidBodyAPI"),
        body("g", "bool newton:jointsAddMobility = 1", "float newton:x = 1", "float mjc:x = 1",
             schemas="NewtonArticulationRootAPI"),
    ]  # fmt: skip
    target = "rel newton:targets = </World/A>"
    acting = [
        prim("NewtonActuator", "P", target, "float newton:kp = 3", "float newton:kd = 3", "float newton:ki = 3",
             "float newton:constEffort = 3", schemas="NewtonPIDControlAPI"),
        prim("NewtonActuator", "N", target, schemas="NewtonNeuralControlAPI"),
        prim("MjcActuator", "M", "rel mjc:target = </World/A>", 'uniform token mjc:biasType = "affine"'),
        prim("MjcTendon", "T", "double mjc:stiffness = 1", "double mjc:damping = 1", "double mjc:armature = 1",
             "double mjc:frictionloss = 1"),
        prim("MjcTendon", "R", "double mjc:range:min = 1", "double mjc:range:max = 2"),
        prim("MjcKeyframe", "K", "double[] mjc:qpos = [1]"),
    ]  # fmt: skip
    return usd(scene, *bodies, *joints, *acting, metersPerUnit="0.5")


def written() -> str:
    """A stage as Partita writes it, with all that stands beside USD's own."""
    m = pt.Mechanism("the machine", gravity=(1 / 3, 0, -29 / 3))
    turn = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3.0
    data: dict[str, Any] = {"inertia": turn @ np.diag([0.1, 0.2, 0.25]) @ turn.T, "com": (1 / 3, 0.1, 2 / 3)}
    data["inertia"] = 0.5 * (data["inertia"] + data["inertia"].T)
    a, b, c, d = (m.add_body(f"{x} 1", mass=4 / 3, position=(i, 0, 0), orientation=turn, **data)
                  for i, x in enumerate("abcd"))  # fmt: skip
    m.add_revolute("A", m.ground, a, point=(1 / 3, 1 / 3, 0), axis=(1, 2, 3))
    m.add_torsion_spring("A", stiffness=7 / 3, damping=1 / 3, angle=1 / 7)
    m.add_rotor("A", 1 / 3)
    m.add_revolute("D", m.ground, d, point=(10 / 3, 0, 0), axis=(1, 1, 3))
    m.add_coupler("D like A", ["D", "A"], [3.0, 1.0], 1 / 7)
    m.add_universal("U", a, b, point=(2 / 3, 0, 0), axis1=(1, 2, 2), axis2=(2, 1, -2))
    m.add_torsion_spring("U", stiffness=7 / 3, damping=1 / 3, angle=1 / 7, coordinate=1)
    m.add_rotor("U", 1 / 3)
    m.add_prismatic("P", m.ground, c, point=(1 / 3, 0, 0), axis=(1, 2, 3))
    m.add_torsion_spring("P", stiffness=7 / 3, damping=1 / 3, angle=1 / 7)
    m.add_rotor("P", 1 / 3)
    m.add_distance("L", c, (1 / 3, 0, 0), d, (0, 1 / 3, 0))
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = m.save(Path(folder) / "a.usda").files[0]
        return path.read_text("utf-8")


STAGES: dict[str, Callable[[], str]] = {"machine": machine, "others": others, "written": written}


def changes(layer: Any) -> Iterator[tuple[str, Callable[[Any], None]]]:
    """Every change of a layer of which something must be heard, with what it is called."""
    from pxr import Sdf

    up = [] if "gravityDirection" in layer.ExportToString() else ["upAxis"]  # which is that of gravity without one
    for key in ("metersPerUnit", "kilogramsPerUnit", *up):
        if layer.pseudoRoot.HasInfo(key) and layer.pseudoRoot.GetInfo(key) not in (0.01, 1.0, "Y"):
            yield f"remove {key}", lambda it, key=key: it.pseudoRoot.ClearInfo(key)
    paths: list[Any] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, lambda path: paths.append(path) if path.IsPrimPath() else None)
    for path in sorted(paths):
        if path.name in LEFT_OUT:
            continue
        spec = layer.GetPrimAtPath(path)
        context = USD.items("prim").get(f"{spec.typeName}")
        items = USD.items(_context(spec.typeName))
        assert context is not None, spec.typeName
        yield (
            f"add attribute at {path}",
            lambda it, path=path: Sdf.AttributeSpec(
                it.GetPrimAtPath(path), UNKNOWN, Sdf.ValueTypeNames.Float
            ).__setattr__("default", 1.0),
        )
        yield f"add schema at {path}", lambda it, path=path: _schemas(it.GetPrimAtPath(path), UNKNOWN, "")
        yield (
            f"add type at {path}",
            lambda it, path=path: Sdf.PrimSpec(
                it.GetPrimAtPath(path), UNKNOWN, Sdf.SpecifierDef, "UnheardOf"
            ).__setattr__("hidden", False),
        )
        for schema in [*spec.GetInfo("apiSchemas").prependedItems]:
            item = items.get(f"@{schema}")
            if item is None or item.rule not in (LOOKS, NO_EFFECT):
                yield (
                    f"remove {schema} at {path}",
                    lambda it, path=path, s=schema: _schemas(it.GetPrimAtPath(path), "", s),
                )
        for found in spec.properties:
            key = found.name
            item = items.get(f"@{key}") or items.get(f"@{key.partition(':')[0]}:")
            value = found.default if isinstance(found, Sdf.AttributeSpec) else None
            if item is not None and (item.rule in (LOOKS, NO_EFFECT) or item.is_default(shown(value))):
                continue
            if key != "xformOpOrder" and key not in NOT_MISSED:
                yield (
                    f"remove {path}.{key}",
                    lambda it, path=path, key=key: it.GetPrimAtPath(path).RemoveProperty(
                        it.GetPrimAtPath(path).properties[key]
                    ),
                )
            numeric = item is not None and item.rule in (APPLIED, COMPILED) and changed(value) is not None
            if numeric and not key.startswith(NOT_CHANGED):
                yield (
                    f"change {path}.{key}",
                    lambda it, path=path, key=key: (
                        it.GetPrimAtPath(path)
                        .properties[key]
                        .__setattr__("default", changed(it.GetPrimAtPath(path).properties[key].default))
                    ),
                )


def _context(kind: str) -> str:
    item = USD.items("prim").get(kind)
    return item.context if item is not None else "prim"


def _schemas(spec: Any, more: str, less: str) -> None:
    """Add or remove a schema."""
    from pxr import Sdf

    items = [x for x in spec.GetInfo("apiSchemas").prependedItems if x != less] + ([more] if more else [])
    spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=items))


def shown(value: Any) -> str:
    """A value as the reader shows it."""
    return "\0" if value is None else text(plain(value, True))


def changed(value: Any) -> Any:
    """Another number; what is positive stays so."""
    if isinstance(value, float):
        return 1.1 * value + 0.013
    if hasattr(value, "imaginary"):
        return type(value)(1.1 * value.real + 0.2, *(x + 0.1 for x in value.imaginary))
    if re.fullmatch(r"Vec\d\w", type(value).__name__):
        return type(value)(*(1.1 * x + 0.013 * (i + 1) for i, x in enumerate(value)))
    return None


def silent(name: str, chosen: slice) -> tuple[int, list[str]]:
    """How many changes of a stage were made, and those of which nothing is heard."""
    from pxr import Sdf

    asked, found, original = 0, [], STAGES[name]()
    with tempfile.TemporaryDirectory() as folder:
        path = put(Path(folder), original)
        before = heard(path)
        assert not before.startswith("refused"), before
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.ImportFromString(original)
        for called, change in [*changes(layer)][chosen]:
            asked += 1
            changing = Sdf.Layer.CreateAnonymous(".usda")
            changing.ImportFromString(original)
            change(changing)
            path.write_text(changing.ExportToString(), "utf-8")
            if heard(path) == before:
                found.append(f"{name}: {called}")
    return asked, found


def unused() -> list[str]:
    """Items of the table of which something must be heard, and that no stage has."""
    from pxr import Sdf

    seen: set[str] = {"@subLayers", "@prototypes", "@PhysicsLimitAPI:distance"}
    for make in STAGES.values():
        layer, paths = Sdf.Layer.CreateAnonymous(".usda"), list[Any]()
        layer.ImportFromString(make())
        seen |= {f"@{key}" for key in layer.pseudoRoot.ListInfoKeys()}
        layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
        for path in paths:
            if path.IsPrimPath():
                spec = layer.GetPrimAtPath(path)
                seen |= {spec.typeName, *(f"@{x}" for x in spec.GetInfo("apiSchemas").prependedItems)}
            elif path.IsPropertyPath():
                seen |= {f"@{path.name}", f"@{path.name.partition(':')[0]}:"}
    wanted = {
        item.name
        for items in USD.contexts.values()
        for item in items
        if item.rule not in (LOOKS, NO_EFFECT, REFUSED) and not item.name.startswith((f"@{OWN}:", "@xform"))
    }
    return sorted(_kinds(wanted) - _kinds(seen) - {"@name", "Plane", "Prim", "Scope"})


def _kinds(names: set[str]) -> set[str]:
    """Names of items, without the axis of those that each axis has."""
    words = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ", "angular", "linear")
    return {":".join("AXIS" if word in words else word for word in name.split(":")) for name in names}


def main() -> None:
    """Every change of every stage."""
    total, wrong = 0, []
    for name in STAGES:
        asked, found = silent(name, slice(None))
        total, wrong = total + asked, wrong + found
    print(*wrong, f"{total} changes, {len(wrong)} unheard", *(f"no stage has {x}" for x in unused()), sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
