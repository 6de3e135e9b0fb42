"""Stages of USD as text, for tests."""

from __future__ import annotations

from pathlib import Path

UNITS = {"metersPerUnit": "1", "kilogramsPerUnit": "1", "upAxis": '"Z"'}


def usd(*parts: str, **metadata: str) -> str:
    """A stage of these parts, in SI with z up unless the metadata say otherwise."""
    units = {**UNITS, **metadata}
    head = "\n".join(f"    {key} = {value}" for key, value in units.items() if value)
    return f'#usda 1.0\n(\n{head}\n)\ndef Xform "World"\n{{\n' + "\n".join(parts) + "\n}\n"


def prim(kind: str, name: str, *lines: str, schemas: str = "", more: str = "") -> str:
    """A prim with its schemas, attributes and children, each of which is a line."""
    listed = ", ".join(f'"{schema}"' for schema in schemas.split())
    head = "\n".join(([f"prepend apiSchemas = [{listed}]"] if listed else []) + ([more] if more else []))
    return f'def {kind} "{name}" (\n{head}\n)\n{{\n' + "\n".join(lines) + "\n}\n"


def at(x: float, y: float, z: float, *more: str) -> str:
    """Lines that place a prim."""
    order = ", ".join(f'"{op}"' for op in ("xformOp:translate", *(line.split()[1] for line in more)))
    return "\n".join(
        [f"double3 xformOp:translate = ({x!r}, {y!r}, {z!r})", *more, f"uniform token[] xformOpOrder = [{order}]"]
    )


def body(name: str, *lines: str, mass: float = 1.0, com: str = "(0, 0, 0.25)", schemas: str = "") -> str:
    """A body with inertia."""
    given = (
        f"float physics:mass = {mass!r}",
        f"point3f physics:centerOfMass = {com}",
        "float3 physics:diagonalInertia = (0.1, 0.2, 0.3)",
    )
    return prim("Xform", name, *given, *lines, schemas=f"PhysicsRigidBodyAPI PhysicsMassAPI {schemas}")


def joint(kind: str, name: str, bodies: tuple[str, str], *lines: str, schemas: str = "") -> str:
    """A joint between two prims of the world; "" is the ground."""
    ends = [f"rel physics:body{i} = </World/{end}>" for i, end in enumerate(bodies) if end]
    return prim(f"Physics{kind}", name, *ends, *lines, schemas=schemas)


def points(first: str, second: str) -> str:
    """Lines with the points of a joint on its two bodies."""
    return f"point3f physics:localPos0 = {first}\npoint3f physics:localPos1 = {second}"


def drive(axis: str, **numbers: object) -> str:
    """Lines of a drive."""
    words = {"type": "uniform token"}
    return "\n".join(f"{words.get(key, 'float')} drive:{axis}:physics:{key} = {x}" for key, x in numbers.items())


def put(folder: Path, text: str, name: str = "stage.usda") -> Path:
    """The text as a file."""
    path = folder / name
    path.write_text(text, "utf-8")
    return path


SCENE = prim(
    "PhysicsScene", "scene", "vector3f physics:gravityDirection = (0, 0, -1)", "float physics:gravityMagnitude = 9.81"
)
"""Gravity along -z."""


def four_bar() -> str:
    """A four-bar in the plane x, z, whose last hinge closes a loop; its rods lie along x of their frames."""
    turned = {"coupler": (0.5, 0.0), "rocker": (1.5, 0.25)}
    axis = 'uniform token physics:axis = "Y"'
    crank = body("crank", at(0, 0, 0, "float xformOp:rotateY = -90"), mass=1.5, com="(0.25, 0, 0)")
    coupler = body("coupler", at(0, 0, 0.5), mass=2.0, com="(0.7, 0, 0.1)")
    rocker = body("rocker", at(1.5, 0, -0.25, "float xformOp:rotateY = -90"), mass=0.75, com="(0.375, 0, 0)")
    del turned
    along = "quatf physics:localRot1 = (0.70710678, 0, 0.70710678, 0)"
    back = "quatf physics:localRot0 = (0.70710678, 0, 0.70710678, 0)"
    return usd(
        SCENE,
        crank,
        coupler,
        rocker,
        joint("RevoluteJoint", "A", ("", "crank"), axis, along),
        joint("RevoluteJoint", "B", ("crank", "coupler"), axis, points("(0.5, 0, 0)", "(0, 0, 0)"), back),
        joint("RevoluteJoint", "C", ("coupler", "rocker"), axis, points("(1.5, 0, 0)", "(0.75, 0, 0)"), along),
        joint(
            "RevoluteJoint",
            "D",
            ("", "rocker"),
            axis,
            "point3f physics:localPos0 = (1.5, 0, -0.25)",
            "bool physics:excludeFromArticulation = 1",
        ),
    )
