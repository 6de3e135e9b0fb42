"""USD physics: bodies with their places, joints that may close loops, drives as springs and dampers.

`usd_stage` composes the stage, `usd_table` lists what becomes of each schema and attribute. Lengths, masses and angles
become metres, kilograms and radians; numbers in single precision are read as the decimals that they were written as.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .format_table import remark
from .looks import Look
from .reading import Reading
from .request import Request
from .robot import Array, Effort, Joint, Link, Loop, Robot, Tie, inverse, nearest, placed, rotation_of
from .usd_joints import CLOSED, Frames, Kind, apart, kind_of, limited, split
from .usd_mass import APPROXIMATED, DENSITY, Part, about, axis_of, part, together
from .usd_stage import Prim, Stage, opened, own
from .usd_table import ACCELERATION, AXES, CONTACT, LIMITS, OWN, USD, VELOCITY

EARTH = 9.81
"""Gravity [m/s^2] where a scene gives none: that of the earth."""
_EVEN = 1e-6
"""Relative error of a scale, and sine of a shear, in single precision: less is none."""
_GROUND = " "
"""The ground among links: no prim has this name."""
_GPRIMS = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone", "Plane", "Mesh")


def read(path: Path, request: Request) -> Robot:
    """The mechanism in a file. Raises `FileFormatError` with the path of the prim that is wrong."""
    reading = Reading(path, "USD")
    with opened(path, request, reading) as stage:
        USD.visit(stage.root, reading)
        return _Reader(stage, reading, request).robot()


@dataclass(frozen=True)
class _Body:
    """A body, its prim and its frame in the world, in metres."""

    name: str
    prim: Prim
    frame: Array


class _Reader:
    def __init__(self, stage: Stage, reading: Reading, request: Request) -> None:
        self.stage, self.reading, root = stage, reading, stage.root
        self.length = root.real("metersPerUnit", 0.01)
        self.mass = root.real("kilogramsPerUnit", 1.0)
        for key, unit in (("metersPerUnit", self.length), ("kilogramsPerUnit", self.mass)):
            if not 0.0 < unit < np.inf:
                root.fail(f"has {key} {unit:g}; it is positive")
        if "metersPerUnit" not in root.attributes:
            self.remark(root, "no metersPerUnit is given, so lengths are in centimetres", "", "changed")
        self.up = axis_of(root, "Y", "upAxis")
        self.prims = list(descendants(root))
        self.made = Robot(self.called(root), reading, request)
        self.made.poses, self.made.world = {}, _GROUND
        self.bodies: dict[str, _Body] = {}
        self.kinds: dict[str, tuple[str, Prim, Kind]] = {}
        self.carried: dict[str, str] = {}
        self.frames: dict[str, Array] = {}

    def remark(self, at: Prim, words: str, what: str = "", kind: str = "motion") -> None:
        """Something that the model lacks, or has in another way."""
        called = f'{at.tag} "{at.get("name")}"' if at.get("name") else ""
        name = " ".join(x for x in (called, what) if x)
        found = remark(self.reading, at, words, name, kind)
        (self.reading.changed if kind == "changed" else self.reading.dropped).append(found)

    def precise(self, prim: Prim, key: str, otherwise: tuple[float, ...]) -> Array:
        """Finite numbers, with all digits where an attribute of ours has them and agrees."""
        found = prim.finite(key, otherwise)
        beside = own(key)
        if prim.value(beside) is None:
            return found
        exact = prim.finite(beside, otherwise)
        return self.agreed(
            prim, beside, exact, found, np.array_equal(exact.astype(np.float32), found.astype(np.float32))
        )

    def agreed(self, prim: Prim, beside: str, exact: Any, found: Any, same: bool) -> Any:
        """The exact numbers beside others, or those where another program has changed them."""
        if not same:
            self.remark(
                prim, "USD's own numbers differ from this and are used", f"{beside} {prim.get(beside)}", "changed"
            )
        return exact if same else found

    def called(self, root: Prim) -> str:
        """The name of the mechanism: that of the prim that stands for the stage."""
        word = str(root.values.get("defaultPrim") or "")
        first = self.stage.prims.get(f"/{word}")
        given = first.value(f"{OWN}:name") if first is not None else None
        return str(given or word or self.reading.path.stem)

    def robot(self) -> Robot:
        robot = self.made
        robot.gravity = self.gravity()
        self.find()
        shapes = self.shapes()
        for path, body in self.bodies.items():
            robot.links[body.name] = self.link(body, shapes.get(path, []))
            assert robot.poses is not None
            robot.poses[body.name] = body.frame
        joints = [prim for prim in self.prims if prim.tag.startswith("Physics") and prim.tag.endswith("Joint")]
        names = _short(joints, set())
        for prim in joints:
            self.joint(prim, names[prim.get("name")])
        for found in self.kinds.values():
            self.mimic(*found)
        count = f"{len(self.bodies)} bodies, {len(robot.joints) + len(robot.loops)} joints"
        self.reading.used.append(remark(self.reading, self.stage.root, count, "", "used"))
        return robot

    def gravity(self) -> tuple[float, ...]:
        """Gravity of the first scene [m/s^2]; without a scene that of the earth."""
        scenes = [prim for prim in self.prims if prim.tag == "PhysicsScene"]
        for other in scenes[1:]:
            self.remark(other, "more than one scene; the gravity of the first acts on all bodies")
        if not scenes:
            self.remark(self.stage.root, f"no scene is given, so gravity is {EARTH} m/s^2 downwards", "", "changed")
            return tuple((-EARTH * self.up).tolist())
        scene = scenes[0]
        along = scene.finite("physics:gravityDirection", (0.0, 0.0, 0.0))
        size = scene.real("physics:gravityMagnitude", -np.inf)
        if size == np.inf:
            scene.fail("has an infinite physics:gravityMagnitude")
        norm = float(np.linalg.norm(along))
        along = along / norm if norm > 0.0 else -self.up
        # a negative magnitude is none, whatever its size
        found = along * (size * self.length if size >= 0.0 else EARTH)
        exact = scene.finite(f"{OWN}:gravity", found)
        same = np.allclose(exact, found, rtol=0.0, atol=_EVEN * float(np.linalg.norm(found)))
        return tuple(self.agreed(scene, f"{OWN}:gravity", exact, found, same).tolist())

    def find(self) -> None:
        """The bodies, by their paths; what each prim is carried by."""
        found = [prim for prim in self.prims if self.is_body(prim)]
        paths = {prim.get("name") for prim in found}
        names = _short(found, {_GROUND})
        for prim in self.prims:
            path = prim.get("name")
            above = self.carried.get(path.rpartition("/")[0], _GROUND)
            self.carried[path] = path if path in paths else above
            if path in paths:
                self.bodies[path] = _Body(names[path], prim, self.frame(prim))
        for prim in self.prims:
            if prim.has("PhysicsMassAPI") and prim.get("name") not in paths and not prim.has("PhysicsCollisionAPI"):
                self.remark(prim, "a mass of what is neither a body nor a shape that collides is not used", "", "other")

    def is_body(self, prim: Prim) -> bool:
        """Whether a prim is a body that moves."""
        if not prim.has("PhysicsRigidBodyAPI"):
            return False
        if any(step == "PointInstancer" for step in _types(prim)):
            prim.fail("is a body that a PointInstancer repeats, which is not read: write each as a prim")
        if not prim.flag("physics:rigidBodyEnabled", True):
            self.remark(prim, "not enabled as a body, so it belongs to what carries it", "", "changed")
            return False
        if prim.flag("physics:kinematicEnabled", False):
            self.remark(
                prim, "moved by the user in the file, it stands still as part of the ground: add_drive", "", "other"
            )
            return False
        for key in ("physics:velocity", "physics:angularVelocity"):
            if np.any(prim.finite(key, (0.0, 0.0, 0.0))):
                self.remark(prim, VELOCITY, f"{key} {prim.get(key)}")
        return True

    def frame(self, prim: Prim) -> Array:
        """The frame of a prim in the world, in metres. Scales stay behind; a shear or a reflection is refused."""
        known = self.frames.get(prim.get("name"))
        if known is not None:
            return known
        linear = prim.world[:3, :3]
        sizes = np.linalg.norm(linear, axis=0)
        if not np.all(np.isfinite(prim.world)) or np.any(sizes == 0.0):
            prim.fail("has a transform that is not finite, or has no size")
        axes = linear / sizes
        if float(np.abs(axes.T @ axes - np.eye(3)).max()) > _EVEN or float(np.linalg.det(axes)) < 0.0:
            prim.fail("is sheared or reflected by its transforms, so it has no axes that could be those of a body")
        found = self.frames[prim.get("name")] = placed(self.length * prim.world[:3, 3], nearest(axes))
        return found

    def scale(self, prim: Prim) -> Array:
        """The scale of a prim along its axes; 1 where it is off by rounding."""
        sizes = np.linalg.norm(prim.world[:3, :3], axis=0)
        return np.where(np.abs(sizes - 1.0) <= _EVEN, 1.0, sizes)

    # ---- masses ----

    def shapes(self) -> dict[str, list[Prim]]:
        """Shapes that collide, by the path of the body that carries them; all shapes are looks."""
        found: dict[str, list[Prim]] = {}
        for prim in self.prims:
            if prim.tag not in _GPRIMS:
                continue
            carrier = self.carried[prim.get("name")]
            if prim.has("PhysicsCollisionAPI"):
                found.setdefault(carrier, []).append(prim)
                if prim.flag("physics:collisionEnabled", True):
                    self.remark(prim, CONTACT, "", "bounds")
            self.look(prim, carrier)
        return found

    def look(self, prim: Prim, carrier: str) -> None:
        """A shape to draw."""
        if prim.get("visibility") == "invisible" or prim.get("purpose") == "guide":
            return
        body = self.bodies.get(carrier)
        try:
            frame = self.frame(prim)
        except ValueError:
            frame = None  # a reflected or sheared shape
        sizes = self.length * self.scale(prim)
        shape: dict[str, Any] | None = None
        if prim.tag == "Cube":
            shape = {"kind": "box", "size": [float(x) for x in sizes * prim.real("size", 2.0)]}
        elif prim.tag == "Sphere" and np.ptp(sizes) <= _EVEN * sizes[0]:
            shape = {"kind": "ball", "radius": float(sizes[0]) * prim.real("radius", 1.0)}
        elif prim.tag == "Cylinder":
            along = axis_of(prim, "Z")
            k = int(np.argmax(along))
            across = np.delete(sizes, k)
            radius, height = prim.real("radius", 1.0), prim.real("height", 2.0)
            if abs(across[0] - across[1]) <= _EVEN * across[0]:
                shape = {"kind": "cylinder", "radius": float(across[0]) * radius, "length": float(sizes[k]) * height}
                if frame is not None:
                    frame = frame @ placed(np.zeros(3), np.roll(np.eye(3), k - 2, axis=0))
        if shape is None or frame is None:
            self.remark(prim, "this shape is not drawn", "", "looks")
            return
        pose = frame if body is None else inverse(body.frame) @ frame
        self.made.looks.append(Look(_GROUND if body is None else body.name, pose, shape))

    def link(self, body: _Body, shapes: list[Prim]) -> Link:
        """A body with its mass; what it does not give follows from its shapes."""
        prim, length = body.prim, self.length
        mass = self.weight(prim)
        com = prim.reals("physics:centerOfMass", (-np.inf,) * 3)
        moments = prim.finite("physics:diagonalInertia", (0.0,) * 3)
        ours = prim.value(f"{OWN}:mass") is not None  # a body without mass too
        given_com, given_moments = bool(np.all(np.isfinite(com))), ours or bool(np.any(moments != 0.0))
        whole: Part | None = None
        needed = not ours and not (mass > 0.0 and given_moments)
        if needed or not given_com:
            whole = self.whole(body, shapes)
            if whole is None and needed:
                lacks = "no mass" if mass == 0.0 else "no inertia"
                prim.fail(
                    f"has {lacks}, and no shape that collides whose volume gives it: "
                    "give physics:mass and physics:diagonalInertia"
                )
        total = mass if mass > 0.0 or ours or whole is None else whole.mass
        center = np.zeros(3)
        if given_com:
            center = length * self.scale(prim) * self.precise(prim, "physics:centerOfMass", (0.0,) * 3)
        elif whole is not None:
            center = whole.com
        if given_moments:
            inertia = self.mass * length**2 * self.inertia(prim, moments)
        else:
            assert whole is not None
            inertia = total / whole.mass * about(whole.inertia, whole.mass, center - whole.com)
        found = Link(body.name, total, center, 0.5 * (inertia + inertia.T), prim)
        found.gravity = not prim.flag("physxRigidBody:disableGravity", False)
        return found

    def weight(self, prim: Prim) -> float:
        """The mass that a prim gives [kg], or 0."""
        found = float(self.precise(prim, "physics:mass", (0.0,))[0])
        return self.mass * found if found >= 0.0 else prim.fail(f"has the mass {found:g}")

    def inertia(self, prim: Prim, moments: Array) -> Array:
        """The inertia that a body gives about its centre of mass, in its own axes and the units of the file."""
        quaternion = prim.finite("physics:principalAxes", (0.0,) * 4)
        axes = rotation(prim, "physics:principalAxes", quaternion) if np.any(quaternion) else np.eye(3)
        found = axes @ np.diag(moments) @ axes.T
        if prim.value(f"{OWN}:inertia") is None:
            return found
        exact = prim.finite(f"{OWN}:inertia", (0.0,) * 9).reshape(3, 3)
        same = np.allclose(exact, found, rtol=0.0, atol=_EVEN * float(np.abs(found).max()))
        return np.asarray(self.agreed(prim, f"{OWN}:inertia", exact, found, same))

    def whole(self, body: _Body, shapes: list[Prim]) -> Part | None:
        """All shapes of a body as one part, or None where they have no volume."""
        parts = []
        for shape in shapes:
            form = str(shape.value("physics:approximation") or "")
            if form in APPROXIMATED:
                self.remark(shape, "an approximation of the mesh, whose own volume is used", form, "changed")
            weight = self.weight(shape) if shape is not body.prim else 0.0
            found = part(shape, body.frame, self.length, self.density(shape, body.prim), weight)
            if found is not None:
                parts.append(found)
        return together(parts) if parts else None

    def density(self, shape: Prim, body: Prim) -> float:
        """Of a shape [kg/m^3]: its own, that of what is around it up to its body, that of its material, or of water."""
        path, unit = shape.get("name"), self.mass / self.length**3
        while path:
            found = self.stage.prims.get(path)
            if found is not None and (given := float(found.finite("physics:density", (0.0,))[0])) > 0.0:
                return given * unit
            if path == body.get("name"):
                break
            path = path.rpartition("/")[0]
        material = self.material(shape)
        given = float(material.finite("physics:density", (0.0,))[0]) if material is not None else 0.0
        return given * unit if given > 0.0 else DENSITY

    def material(self, shape: Prim) -> Prim | None:
        """The material that is bound to a shape for physics, or for all purposes."""
        binding = self.stage.usd.UsdShade.MaterialBindingAPI(shape.handle)
        found, _ = binding.ComputeBoundMaterial("physics")
        return self.stage.prims.get(str(found.GetPath())) if found else None

    # ---- joints ----

    def joint(self, prim: Prim, name: str) -> None:
        """A joint, which may close a loop."""
        if not prim.flag("physics:jointEnabled", True):
            self.remark(prim, "not enabled in the file, so it holds nothing", "", "changed")
            return
        ends = [self.end(prim, i) for i in (0, 1)]
        here, there = (frame for _, frame in ends)
        kind = kind_of(prim)
        first, second = (link for link, _ in ends)
        if first == second:
            what = "the ground" if first == _GROUND else f'one body, "{first}"'
            self.remark(prim, "it joins two frames of the same body, so it holds nothing", f"of {what}", "other")
            return
        if prim.tag == "PhysicsDistanceJoint":
            self.distance(prim, name, (first, second), Frames(here, there))
            return
        frames, drawn = split(prim, kind, Frames(here, there))
        gap, angle = apart(frames)
        if gap > CLOSED or angle > CLOSED:
            words = "not closed as drawn; assembly closes it"
            self.remark(prim, words, f"open by {_length(frames):.2g} m, {np.degrees(angle):.2g} deg", "changed")
        if kind.word == "universal" and prim.value(f"{OWN}:kind") != "universal":
            words = "USD does not say in which order it turns: a universal joint, as PhysX's D6 has it, first about "
            self.remark(prim, words + f"{kind.free[-1][1]} of the frame of body 0", "", "changed")
        for axis, low, high in limited(prim):
            self.remark(prim, LIMITS, f"{axis} {low:g} to {high:g}", "bounds")
        word = "generic" if kind.word == "prismatic" and angle > CLOSED else kind.word
        efforts, along = self.efforts(prim, name, kind, drawn), kind.axis
        if frames.here is frames.there:
            some = np.array([1.0, 0.0, 0.0]) if along is None else along
            made = Joint(name, word, first, second, frames.here, some, prim, efforts)
            made.second, made.free = kind.second, kind.free
            self.made.joints[name] = made
        else:
            sides = (self.side(first, frames.here), self.side(second, frames.there))
            self.made.loops.append(Loop(name, word, *sides, prim, along, kind.second, efforts, kind.free))
        self.kinds[prim.get("name")] = (name, prim, replace(kind, drawn=tuple(drawn.items())))

    def side(self, link: str, frame: Array) -> tuple[str, Array]:
        """A link, and a frame of the world in it."""
        assert self.made.poses is not None
        return link, frame if link == _GROUND else inverse(self.made.poses[link]) @ frame

    def end(self, prim: Prim, side: int) -> tuple[str, Array]:
        """The link on one side of a joint, and the frame of the joint in the world."""
        key = f"physics:body{side}"
        targets = prim.value(key) or []
        if len(targets) > 1:
            prim.fail(f"has {len(targets)} targets of {key}; a joint has one body on each side")
        point = self.precise(prim, f"physics:localPos{side}", (0.0,) * 3)
        word = f"physics:localRot{side}"
        turn = rotation(prim, word, self.precise(prim, word, (1.0, 0.0, 0.0, 0.0)))
        if not targets:
            return _GROUND, placed(self.length * point, turn)
        at = self.stage.prims.get(targets[0])
        if at is None:
            prim.fail(f"joins {targets[0]} ({key}), which is not there")
        carrier = self.carried[targets[0]]
        frame = self.frame(at) @ placed(self.length * self.scale(at) * point, turn)
        return (_GROUND if carrier == _GROUND else self.bodies[carrier].name), frame

    def distance(self, prim: Prim, name: str, links: tuple[str, str], frames: Frames) -> None:
        """Two points at a constant distance."""
        least, most = prim.real("physics:minDistance", -1.0), prim.real("physics:maxDistance", -1.0)
        if least != most or least < 0.0:
            if max(least, most) >= 0.0:
                self.remark(prim, LIMITS, f"distance {least:g} to {most:g}", "bounds")
            else:
                self.remark(prim, "a distance joint without distances holds nothing", "", "other")
            return
        if least == 0.0:
            prim.fail("holds two points at the distance 0: use PhysicsSphericalJoint")
        exact = float(prim.finite(f"{OWN}:length", (most,))[0])
        same = np.float32(exact) == np.float32(most)
        length = self.length * float(self.agreed(prim, f"{OWN}:length", exact, most, bool(same)))
        sides = (self.side(links[0], frames.here), self.side(links[1], frames.there))
        self.made.loops.append(Loop(name, "distance", *sides, prim, length=length))

    def efforts(self, prim: Prim, name: str, kind: Kind, drawn: dict[str, float]) -> list[Effort]:
        """Springs, dampers and rotors along the coordinates of a joint."""
        found: list[Effort] = []
        armature = prim.real("physxJoint:armature", 0.0)
        for axis in (*AXES, "angular", "linear"):
            acts = prim.has(f"PhysicsDriveAPI:{axis}")
            turned = f"{OWN}:{axis}:rotor"
            if not acts and not prim.has(turned):
                continue
            if axis not in kind.coordinates:
                if acts:
                    words = "a drive would act along a direction that is not a coordinate of this joint"
                    self.remark(prim, words, f"drive {axis}")
                continue
            effort = self.drive(prim, axis, drawn.get(axis, 0.0)) if acts else None
            effort = effort or Effort()
            rotor = prim.real(turned, 0.0)
            if prim.has(turned) and prim.has("PhysxJointAPI") and len(kind.coordinates) == 1:
                rotor = self.agreed(prim, turned, rotor, 0.0, bool(np.float32(rotor) == np.float32(armature)))
            several = len(kind.coordinates) > 1
            label = f"spring of {name} {axis}" if several else ""
            if not effort.is_empty or rotor != 0.0:
                found.append(replace(effort, coordinate=kind.coordinates[axis], rotor=rotor, name=label))
        if armature != 0.0:
            if len(kind.coordinates) == 1:
                (axis,) = kind.coordinates
                unit = self.mass * (self.length**2 if turns(axis) else 1.0)
                if not any(effort.rotor for effort in found):
                    found.append(Effort(rotor=armature * unit))
            else:
                words = "the inertia of rotors would add to the mass matrix: add_rotor on a coordinate"
                self.remark(prim, words, f"armature {armature:g}")
        return found

    def drive(self, prim: Prim, axis: str, drawn: float) -> Effort | None:
        """A drive: stiffness (target - x) + damping (target rate - rate)."""

        def read(key: str) -> float:
            return float(prim.finite(f"drive:{axis}:physics:{key}", (0.0,))[0])

        stiffness, damping, target, rate = map(read, ("stiffness", "damping", "targetPosition", "targetVelocity"))
        kind = str(prim.value(f"drive:{axis}:physics:type") or "force")
        law = f"drive {axis}: stiffness {stiffness:g}, damping {damping:g}, target {target:g}, rate {rate:g}"
        if stiffness == 0.0 and damping == 0.0:
            return None
        if kind != "force":
            self.remark(prim, ACCELERATION, f"{law}, type {kind}")
            return None
        turn = turns(axis)
        per = self.mass * self.length**2 * 180.0 / np.pi if turn else self.mass
        unit = np.pi / 180.0 if turn else self.length
        found = (per * stiffness, per * damping, unit * target)
        words = [f"{OWN}:{axis}:{word}" for word in ("stiffness", "damping", "rest")]
        stiffness, damping, target = (
            float(self.agreed(prim, word, exact, value, bool(np.isclose(exact, value, rtol=_EVEN, atol=_EVEN * unit))))
            for word, value in zip(words, found, strict=True)
            for exact in (float(prim.finite(word, (value,))[0]),)
        )
        target, torque = target - drawn, damping * unit * rate
        if stiffness != 0.0:
            return Effort(stiffness, damping, target + torque / stiffness)
        return Effort(0.0, damping, 0.0, constant=torque)

    def mimic(self, name: str, prim: Prim, kind: Kind) -> None:
        """Joints that follow others: coordinate + gearing x the other's + offset = 0, in degrees."""
        for axis in AXES[3:]:
            if not prim.has(f"PhysxMimicJointAPI:{axis}"):
                continue
            key = f"physxMimicJoint:{axis}"
            gearing, offset = (
                float(prim.finite(f"{key}:{word}", (x,))[0]) for word, x in (("gearing", 1.0), ("offset", 0.0))
            )
            targets = prim.value(f"{key}:referenceJoint") or []
            other = self.kinds.get(targets[0]) if len(targets) == 1 else None
            law = f"{axis}: gearing {gearing:g}, offset {offset:g}, to {', '.join(targets) or 'nothing'}"
            if other is None or kind.word != "revolute" or other[2].word != "revolute":
                self.remark(prim, "it would follow another joint: add_coupler", law)
                continue
            ours = f"{OWN}:{axis}"
            turn = -np.radians(offset)
            for word, value in (("gearing", gearing), ("offset", -turn)):
                exact = float(prim.finite(f"{ours}:{word}", (value,))[0])
                same = bool(np.isclose(exact, value, rtol=_EVEN, atol=1e-12))
                value = float(self.agreed(prim, f"{ours}:{word}", exact, value, same))
                gearing, turn = (value, turn) if word == "gearing" else (gearing, -value)
            title = str(prim.value(f"{ours}:name") or f"{name} mimic")
            (mine,), (its,) = (dict(one.drawn).values() for one in (kind, other[2]))
            rest = turn - mine - gearing * its
            self.made.ties.append(Tie(title, [name, other[0]], [1.0, gearing], rest, prim))


def _length(frames: Frames) -> float:
    return float(np.linalg.norm(frames.here[:3, 3] - frames.there[:3, 3]))


def turns(axis: str) -> bool:
    """Whether a drive acts about an axis."""
    return axis.startswith("rot") or axis == "angular"


def rotation(prim: Prim, key: str, found: Array) -> Array:
    """The rotation of a quaternion, real part first."""
    if not np.any(found):
        prim.fail(f"has {key} 0 0 0 0, which is no rotation")
    return rotation_of(found)


def descendants(root: Prim) -> Any:
    """All prims below this one, each after what it stands in, in the order of the file."""
    waiting = list(reversed(root.children))
    while waiting:
        prim = waiting.pop()
        yield prim
        waiting += reversed(prim.children)


def _types(prim: Prim) -> Any:
    """Types of what a prim stands in."""
    handle = prim.handle.GetParent()
    while handle and handle.GetPath().pathString != "/":
        yield str(handle.GetTypeName())
        handle = handle.GetParent()


def _short(prims: list[Prim], taken: set[str]) -> dict[str, str]:
    """Names by paths: the last word where no other one has it, else the whole path."""
    last = [str(prim.value(f"{OWN}:name") or prim.get("name").rpartition("/")[2]) for prim in prims]
    times, used = Counter(last), set(taken)
    found: dict[str, str] = {}
    for prim, word in zip(prims, last, strict=True):
        name = word if times[word] == 1 and word not in used else prim.get("name").lstrip("/")
        while name in used:
            name += "_"
        used.add(name)
        found[prim.get("name")] = name
    return found
