"""A mechanism as USD physics: bodies where they are drawn, and every joint, loops included, between two of them.

USD has single precision where it matters; attributes of our own beside its own have the same numbers in double, and
names that are no identifiers. Loops need no tree, so nothing is cut.
"""

from __future__ import annotations

import json
import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..builder import Builder
from ..builder.calls import kind_of
from ..builder.checks import Array
from ..builder.records import GROUND, BodyRecord, CouplingRecord, JointRecord
from ..extras import extra
from ..files import put
from ..numeric import quaternion
from ..products import det, matmul, norm
from ..tolerance import EQUAL
from . import writing_table
from .robot import inverse, placed
from .skeleton import Spring, across, point_of, springs, text, turn_of_child
from .usd_table import AXES, OWN
from .writing import Writing

_SLIDES = ("x", "y", "z")
_PRECISION = "numbers that USD has in single precision stand beside in double, which only Partita reads"


def write(mechanism: Builder, path: Path, strict: bool) -> Writing:
    """Write the file; the report lists the differences."""
    writer = _Writer(mechanism, Writing(path, "USD"))
    stage = writer.text()
    content = _binary(stage) if path.suffix.lower() == ".usdc" else stage.encode("utf-8")
    writer.report.judge(strict)
    writer.report.files.append(put(path, content))
    return writer.report


def _binary(stage: str) -> bytes:
    """The binary form of a text."""
    sdf = extra("pxr.Sdf", "usd", "writing binary USD")
    layer = sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(stage)
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / "stage.usdc"
        layer.Export(str(draft))
        return draft.read_bytes()


@dataclass(frozen=True)
class _Form:
    """A joint as USD has it: the type of its prim, the frame of the joint as drawn on its parent, the axis, the
    directions that are locked, and the axes of its coordinates."""

    kind: str
    frame: Array
    axis: str = ""
    locked: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = ()
    own: str = ""


@dataclass
class _Writer:
    mechanism: Builder
    report: Writing
    paths: dict[str, str] = field(default_factory=dict)
    joints: dict[str, str] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)

    def text(self) -> str:
        """The stage."""
        d, report = self.mechanism._description, self.report
        self.springs = springs(d, report)
        self.rotors: dict[tuple[str, int], float] = {}
        for rotor in d.rotors.values():
            key = (rotor.joint, rotor.coordinate)
            self.rotors[key] = self.rotors.get(key, 0.0) + rotor.ratio**2 * rotor.inertia
        self.followers = {one.name: one for one in d.couplings.values() if self.follows(one)}
        root = _identifier(d.name, set())
        self.root = f"/{root}"
        bodies = [line for body in d.bodies.values() for line in self.body(body)]
        used: set[str] = set()
        for joint in d.joints.values():
            called = _identifier(joint.name, used)
            used.add(called)
            self.joints[joint.name] = f"{self.root}/joints/{called}"
        joints = [line for joint in d.joints.values() for line in self.joint(joint)]
        for coupling in d.couplings.values():
            joints += self.coupling(coupling, used)
        for what, left in (("spring", self.springs), ("rotor", self.rotors)):
            report.dropped += [f"{what} of coordinate {i} of joint {name}" for name, i in left]
        writing_table.visit(d, report)
        report.changed.append(_PRECISION)
        up = "Y" if d.gravity[1] < 0.0 and d.gravity[0] == d.gravity[2] == 0.0 else "Z"
        head = ["#usda 1.0", "(", f'    defaultPrim = "{root}"', "    kilogramsPerUnit = 1", "    metersPerUnit = 1"]
        head += [f'    upAxis = "{up}"', ")", "", f'def Xform "{root}"', "{"]
        inner = [*_name(d.name, root), *self.scene(), *bodies, 'def Scope "joints"', "{", *_indented(joints), "}"]
        return "\n".join([*head, *_indented(inner), "}", ""])

    def scene(self) -> list[str]:
        """Gravity."""
        gravity = np.array(self.mechanism._description.gravity)
        size = float(norm(gravity))
        along = gravity / size if size > 0.0 else np.zeros(3)
        lines = [
            f"vector3f physics:gravityDirection = {_singles(along)}",
            f"float physics:gravityMagnitude = {_single(size)}",
            f"custom double3 {OWN}:gravity = {_doubles(gravity)}",
        ]
        return _prim("PhysicsScene", "scene", lines)

    def body(self, body: BodyRecord) -> list[str]:
        """A body, where it is drawn."""
        used = {path.rpartition("/")[2] for path in self.paths.values()} | {"joints", "scene"}
        called = _identifier(body.name, used)
        self.paths[body.name] = f"{self.root}/{called}"
        schemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
        moments, axes = np.linalg.eigh(body.inertia)
        if np.array_equal(body.inertia, np.diag(np.diag(body.inertia))):
            moments, axes = np.diag(body.inertia), np.eye(3)
        elif det(axes) < 0.0:
            axes[:, 0] *= -1.0
        rows = ", ".join(_doubles(row) for row in placed(body.position, body.rotation).T)
        lines = [
            *_name(body.name, called),
            f"matrix4d xformOp:transform = ( {rows} )",
            'uniform token[] xformOpOrder = ["xformOp:transform"]',
            f"float physics:mass = {_single(body.mass)}",
            f"custom double {OWN}:mass = {text(body.mass)}",
            f"point3f physics:centerOfMass = {_singles(body.com)}",
            f"custom double3 {OWN}:centerOfMass = {_doubles(body.com)}",
            f"float3 physics:diagonalInertia = {_singles(moments)}",
            f"quatf physics:principalAxes = {_singles(quaternion(axes))}",
            f"custom double[] {OWN}:inertia = [{', '.join(text(x) for x in np.ravel(body.inertia))}]",
        ]
        if np.float32(body.mass) == 0.0 or not np.any(moments.astype(np.float32)):
            lacks = "mass" if np.float32(body.mass) == 0.0 else "inertia"
            self.report.changed.append(
                f'body "{body.name}" has no {lacks}, which only Partita reads: in USD this means that of its shapes'
            )
        if not body.gravity:
            schemas.append("PhysxRigidBodyAPI")
            lines.append("bool physxRigidBody:disableGravity = 1")
            self.report.changed.append(f'body "{body.name}" is weightless by a schema of PhysX')
        return _prim("Xform", called, lines, schemas)

    def frames(self, joint: JointRecord, form: _Form) -> list[str]:
        """Lines with the two bodies of a joint, and its frames on them."""
        d = self.mechanism._description
        drawn = {name: placed(body.position, body.rotation) for name, body in d.bodies.items()} | {GROUND: np.eye(4)}
        point = point_of(joint, drawn)
        here = placed(point, form.frame)
        beyond = point if joint.child_point is None else joint.child_point
        there = placed(beyond, matmul(turn_of_child(joint), form.frame))
        if not np.array_equal(here, there):
            self.report.changed.append(
                f"joint {joint.name}: its coordinates are zero as drawn, where its frames are apart"
            )
        lines = []
        for side, (body, frame) in enumerate(((joint.parent, here), (joint.child, there))):
            lines += self.end(side, body, frame if body == GROUND else matmul(inverse(drawn[body]), frame))
        return lines

    def end(self, side: int, body: str, frame: Array) -> list[str]:
        """Lines with one body of a joint, and the frame on it."""
        turn = quaternion(frame[:3, :3])
        lines = [] if body == GROUND else [f"rel physics:body{side} = <{self.paths[body]}>"]
        return [
            *lines,
            f"point3f physics:localPos{side} = {_singles(frame[:3, 3])}",
            f"custom double3 {OWN}:localPos{side} = {_doubles(frame[:3, 3])}",
            f"quatf physics:localRot{side} = {_singles(turn)}",
            f"custom double4 {OWN}:localRot{side} = {_doubles(turn)}",
        ]

    def joint(self, joint: JointRecord) -> list[str]:
        """A joint."""
        form = self.form(joint)
        if form is None:
            return []
        called = self.joints[joint.name].rpartition("/")[2]
        lines, schemas = [*_name(joint.name, called), *self.frames(joint, form)], list[str]()
        if form.axis:
            lines.append(f'uniform token physics:axis = "{form.axis}"')
        if form.own:
            lines.append(f'custom token {OWN}:kind = "{form.own}"')
        if joint.cut == "always":
            lines.append("bool physics:excludeFromArticulation = 1")
        for axis in form.locked:
            schemas.append(f"PhysicsLimitAPI:{axis}")
            lines += [f"float limit:{axis}:physics:low = 1", f"float limit:{axis}:physics:high = -1"]
        for i, axis in enumerate(form.coordinates):
            spring, rotor = self.springs.pop((joint.name, i), None), self.rotors.pop((joint.name, i), None)
            if spring is not None:
                schemas.append(f"PhysicsDriveAPI:{axis}")
                lines += _drive(axis, spring)
            if rotor is not None:
                lines.append(f"custom double {OWN}:{axis}:rotor = {text(rotor)}")
                known = "which only Partita reads"
                if len(form.coordinates) == 1:
                    schemas.append("PhysxJointAPI")
                    lines.append(f"float physxJoint:armature = {_single(rotor)}")
                    known = "by a schema of PhysX"
                self.report.changed.append(f"rotor on coordinate {i} of joint {joint.name}, {known}")
        for coupling in self.followers.values():
            if coupling.terms[0]["joint"] == joint.name:
                schemas.append(f"PhysxMimicJointAPI:rot{form.axis}")
                lines += self.mimic(coupling, f"rot{form.axis}")
        return _prim(form.kind, called, lines, schemas)

    def follows(self, coupling: CouplingRecord) -> bool:
        """Whether a coupling is of two hinges, the first of which follows no other one yet."""
        joints = self.mechanism._description.joints
        hinges = [str(term["joint"]) for term in coupling.terms if term.get("of") == "joint"]
        if coupling.kind != "linear" or not len(hinges) == len(coupling.terms) == 2 or hinges[0] in self.taken:
            return False
        if any(joints[name].kind != "revolute" for name in hinges):
            return False
        self.taken.add(hinges[0])
        return True

    def mimic(self, coupling: CouplingRecord, axis: str) -> list[str]:
        """Lines of a hinge that follows another one: x + gearing y + offset = 0, in degrees."""
        self.report.changed.append(
            f"{coupling.word} {coupling.name} is a joint that follows another by a schema of PhysX"
        )
        first, second = (float(x) for x in coupling.data["factors"])
        gearing, offset = second / first, -float(coupling.data["offset"]) / first
        return [
            f"float physxMimicJoint:{axis}:gearing = {_single(gearing)}",
            f"float physxMimicJoint:{axis}:offset = {_single(float(np.degrees(offset)))}",
            f"rel physxMimicJoint:{axis}:referenceJoint = <{self.joints[str(coupling.terms[1]['joint'])]}>",
            f"custom double {OWN}:{axis}:gearing = {text(gearing)}",
            f"custom double {OWN}:{axis}:offset = {text(offset)}",
            *_name(coupling.name, "", f"{axis}:name"),
        ]

    def form(self, joint: JointRecord) -> _Form | None:
        """The form of a joint; None where USD has none."""
        unit = {word: x if word == "frame" else x / norm(x) for word, x in joint.geometry.items()}
        axis = next((unit[word] for word in ("axis", "normal", "axis1") if word in unit), np.array([1.0, 0.0, 0.0]))
        if joint.kind == "fixed":
            return _Form("PhysicsFixedJoint", np.eye(3))
        if joint.kind == "spherical":
            return _Form("PhysicsSphericalJoint", np.eye(3))
        if joint.kind in ("revolute", "prismatic"):
            frame, token = _along(axis)
            name = "angular" if joint.kind == "revolute" else "linear"
            return _Form(f"Physics{joint.kind.capitalize()}Joint", frame, token, coordinates=(name,))
        if joint.kind == "free":
            return _Form("PhysicsJoint", np.eye(3), coordinates=AXES[:3])
        if joint.kind == "universal":
            return self.crossed(joint, axis, unit["axis2"])
        frame, along = unit.get("frame", np.eye(3)), np.column_stack([*across(axis), axis])
        if joint.kind == "screw":
            self.report.dropped.append(f"thread of screw {joint.name}: its slide and its turn are free of each other")
        free = {
            "cylindrical": ("z", "rz"),
            "screw": ("z", "rz"),
            "planar": ("x", "y", "rz"),
            "point_on_line": ("z", "rx", "ry", "rz"),
            "point_on_plane": ("x", "y", "rx", "ry", "rz"),
            "parallel": ("x", "y", "z", "rz"),
            "orientation": ("x", "y", "z"),
            "generic": joint.free,
        }.get(joint.kind)
        turns = [word for word in free or () if word not in _SLIDES]
        if joint.kind == "generic" and len(turns) == len(free or ()) == 2:
            axes = [frame[:, "xyz".index(word[1])] for word in turns]
            return self.crossed(joint, axes[0], axes[1])
        if free is None or len(turns) == 2:
            what = joint.kind.replace("_", " ")
            if writing_table.TABLE[what][self.report.kind].rule != writing_table.DROPPED:
                self.report.dropped.append(f"{what} joint {joint.name}, whose motions USD cannot represent")
            return None
        names = dict(zip(("x", "y", "z", "rx", "ry", "rz"), AXES, strict=True))
        moving = tuple(names[word] for word in names if word in free)
        some = moving if len(turns) < 3 else tuple(x for x in moving if x.startswith("trans"))
        locked = tuple(x for x in AXES if x not in moving)
        return _Form("PhysicsJoint", frame if joint.kind in ("generic", "orientation") else along, "", locked, some)

    def crossed(self, joint: JointRecord, first: Array, second: Array) -> _Form | None:
        """A universal joint: a swing about y of the frame, then a twist about x, as PhysX has it."""
        if abs(float(matmul(first, second))) > EQUAL:
            self.report.dropped.append(f"universal joint {joint.name}, whose axes are not perpendicular")
            return None
        self.report.changed.append(
            f"universal joint {joint.name} has a free twist and swing, in the order of PhysX's D6 joint"
        )
        frame = np.column_stack([second, first, np.cross(second, first)])
        locked = ("transX", "transY", "transZ", "rotZ")
        return _Form("PhysicsJoint", frame, "", locked, ("rotY", "rotX"), "universal")

    def coupling(self, coupling: CouplingRecord, used: set[str]) -> list[str]:
        """A distance between two points; other couplings are dropped."""
        if coupling.name in self.followers:
            return []
        term = coupling.terms[0] if len(coupling.terms) == 1 else {}
        if writing_table.TABLE[kind_of(coupling)][self.report.kind].rule == writing_table.DROPPED:
            return []
        if coupling.word != "distance" or term.get("of") != "distance":
            self.report.dropped.append(
                f"{coupling.word} {coupling.name}: only two hinges in a fixed ratio can be coupled"
            )
            return []
        length = float(coupling.data["offset"]) / float(coupling.data["factors"][0])
        called = _identifier(coupling.name, used)
        used.add(called)
        lines = _name(coupling.name, called)
        for side in (0, 1):
            frame = np.eye(4)
            frame[:3, 3] = term[f"point{side + 1}"]
            lines += self.end(side, str(term[f"body{side + 1}"]), frame)[:-2]
        for word in ("min", "max"):
            lines.append(f"float physics:{word}Distance = {_single(length)}")
        lines.append(f"custom double {OWN}:length = {text(length)}")
        return _prim("PhysicsDistanceJoint", called, lines)


def _drive(axis: str, spring: Spring) -> list[str]:
    """Lines of a spring and a damper, per degree where they turn."""
    per = np.pi / 180.0 if axis == "angular" or axis.startswith("rot") else 1.0
    numbers = {
        "stiffness": per * spring.stiffness,
        "damping": per * spring.damping,
        "targetPosition": spring.rest / per,
    }
    return [
        f'uniform token drive:{axis}:physics:type = "force"',
        *(f"float drive:{axis}:physics:{key} = {_single(x)}" for key, x in numbers.items()),
        f"custom double {OWN}:{axis}:stiffness = {text(spring.stiffness)}",
        f"custom double {OWN}:{axis}:damping = {text(spring.damping)}",
        f"custom double {OWN}:{axis}:rest = {text(spring.rest)}",
    ]


def _along(axis: Array) -> tuple[Array, str]:
    """A frame, and which of its axes is along this one."""
    for i, unit in enumerate(np.eye(3)):
        if np.array_equal(axis, unit):
            return np.eye(3), "XYZ"[i]
    return np.column_stack([*across(axis), axis]), "Z"


def _prim(kind: str, name: str, lines: list[str], schemas: list[str] | None = None) -> list[str]:
    """A prim."""
    head = [f'def {kind} "{name}"']
    if schemas:
        head = [f"{head[0]} (", f"    prepend apiSchemas = [{', '.join(json.dumps(x) for x in schemas)}]", ")"]
    return [*head, "{", *_indented(lines), "}"]


def _name(name: str, called: str, key: str = "name") -> list[str]:
    """Lines with a name that is no identifier."""
    return [] if name == called else [f"custom string {OWN}:{key} = {json.dumps(name, ensure_ascii=False)}"]


def _identifier(name: str, used: set[str]) -> str:
    """A name that a prim can have, and that no other one has."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name) or "_"
    plain = f"_{plain}" if plain[0].isdigit() else plain
    found, number = plain, 1
    while found in used:
        number += 1
        found = f"{plain}_{number}"
    return found


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" if line else line for line in lines]


def _single(value: float) -> str:
    """A number in single precision, with the fewest digits that give it back."""
    return text(float(str(np.float32(value))))


def _singles(values: Any) -> str:
    return f"({', '.join(_single(x) for x in values)})"


def _doubles(values: Any) -> str:
    return f"({', '.join(text(x) for x in values)})"
