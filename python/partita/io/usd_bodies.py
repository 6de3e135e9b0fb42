"""USD physics: bodies with their places, masses and looks.

Lengths and masses become metres and kilograms; numbers in single precision are read as the decimals that they were
written as.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..products import det, matmul
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .format_table import remark
from .looks import Look
from .reading import Reading
from .request import Request
from .robot import Array, Link, Robot, inverse, nearest, placed, rotation_of
from .usd_mass import APPROXIMATED, DENSITY, Part, about, axis_of, part, together
from .usd_stage import Prim, Stage, own
from .usd_table import CONTACT, NO_MASS, OWN, PARTLY, SHELL, VELOCITY, WELDED

GROUND = " "
"""The ground among links: no prim has this name."""
_GPRIMS = ("Cube", "Sphere", "Cylinder", "Capsule", "Cone", "Plane", "Mesh")


@dataclass(frozen=True)
class Body:
    """A body, its prim and its frame in the world, in metres."""

    name: str
    prim: Prim
    frame: Array


class Bodies:
    """The bodies of a stage, the units of its numbers, and remarks on what is read."""

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
        self.made.poses, self.made.world = {}, GROUND
        self.bodies: dict[str, Body] = {}
        self.carried: dict[str, str] = {}
        self.frames: dict[str, Array] = {}

    def remark(self, at: Prim, words: str, what: str = "", kind: str = "motion") -> None:
        """Something that the model lacks, or has in another way."""
        called = f'{at.tag} "{at.get("name")}"' if at.get("name") else ""
        name = " ".join(x for x in (called, what) if x)
        found = remark(self.reading, at, words, name, kind)
        (self.reading.changed if kind == "changed" else self.reading.dropped).append(found)

    def settings(self, key: str) -> Any:
        """What the first scene states; None where it does not."""
        scene = next((prim for prim in self.prims if prim.tag == "PhysicsScene"), None)
        return None if scene is None else scene.value(key)

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

    def find(self) -> None:
        """The bodies, by their paths; what each prim is carried by."""
        found = [prim for prim in self.prims if self.is_body(prim)]
        paths = {prim.get("name") for prim in found}
        names = short(found, {GROUND})
        for prim in self.prims:
            path = prim.get("name")
            above = self.carried.get(path.rpartition("/")[0], GROUND)
            self.carried[path] = path if path in paths else above
            if path in paths:
                self.bodies[path] = Body(names[path], prim, self.frame(prim))
        self.welds = self.welded()
        for prim in self.prims:
            if prim.has("PhysicsMassAPI") and prim.get("name") not in paths and not prim.has("PhysicsCollisionAPI"):
                self.remark(prim, "a mass of what is neither a body nor a shape that collides is not used", "", "other")

    def welded(self) -> dict[str, bool]:
        """Bodies that are welded to others, by their paths, and whether to the ground in the end."""
        pairs = [
            [
                self.carried.get(found[0], GROUND) if (found := prim.value(f"physics:body{i}")) else GROUND
                for i in (0, 1)
            ]
            for prim in self.prims
            if prim.tag == "PhysicsFixedJoint" and prim.flag("physics:jointEnabled", True)
        ]
        still, more = {GROUND}, True
        while more:
            joined = {end for pair in pairs if still & set(pair) for end in pair} - still
            still, more = still | joined, bool(joined)
        return {end: end in still for one, other in pairs if one != other for end in (one, other)}

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
        if float(np.abs(matmul(axes.T, axes) - np.eye(3)).max()) > EQUAL_IN_SIX_DIGITS or float(det(axes)) < 0.0:
            prim.fail("is sheared or reflected by its transforms, so it has no axes that could be those of a body")
        found = self.frames[prim.get("name")] = placed(self.length * prim.world[:3, 3], nearest(axes))
        return found

    def scale(self, prim: Prim) -> Array:
        """The scale of a prim along its axes; 1 where it is off by rounding."""
        sizes = np.linalg.norm(prim.world[:3, :3], axis=0)
        return np.where(np.abs(sizes - 1.0) <= EQUAL_IN_SIX_DIGITS, 1.0, sizes)

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
        elif prim.tag == "Sphere" and np.ptp(sizes) <= EQUAL_IN_SIX_DIGITS * sizes[0]:
            shape = {"kind": "ball", "radius": float(sizes[0]) * prim.real("radius", 1.0)}
        elif prim.tag == "Cylinder":
            along = axis_of(prim, "Z")
            k = int(np.argmax(along))
            across = np.delete(sizes, k)
            radius, height = prim.real("radius", 1.0), prim.real("height", 2.0)
            if abs(across[0] - across[1]) <= EQUAL_IN_SIX_DIGITS * across[0]:
                shape = {"kind": "cylinder", "radius": float(across[0]) * radius, "length": float(sizes[k]) * height}
                if frame is not None:
                    frame = matmul(frame, placed(np.zeros(3), np.roll(np.eye(3), k - 2, axis=0)))
        if shape is None or frame is None:
            self.remark(prim, "this shape is not drawn", "", "looks")
            return
        pose = frame if body is None else matmul(inverse(body.frame), frame)
        self.made.looks.append(Look(GROUND if body is None else body.name, pose, shape))

    def link(self, body: Body, shapes: list[Prim]) -> Link:
        """A body with its mass; what it does not give follows from its shapes."""
        prim, length = body.prim, self.length
        mass = self.weight(prim)
        com = prim.reals("physics:centerOfMass", (-np.inf,) * 3)
        moments = prim.finite("physics:diagonalInertia", (0.0,) * 3)
        ours = prim.value(f"{OWN}:mass") is not None  # a body without mass too
        tensor = prim.value("newton:inertia")
        given_com = bool(np.all(np.isfinite(com)))
        given_moments = ours or bool(tensor) or bool(np.any(moments != 0.0))
        whole: Part | None = None
        needed = not ours and not (mass > 0.0 and given_moments)
        if needed or not given_com:
            whole = self.whole(body, shapes)
            if whole is None and needed:
                lacks = "no mass" if mass == 0.0 else "no inertia"
                if body.prim.get("name") in self.welds:
                    still = self.welds[body.prim.get("name")]
                    words = f"{lacks} is given, and it is welded to the ground" if still else WELDED.format(lacks)
                    self.remark(prim, words, "", "changed" if still else "motion")
                    com = self.precise(prim, "physics:centerOfMass", (0.0,) * 3) if given_com else np.zeros(3)
                    return Link(body.name, mass, length * self.scale(prim) * com, np.zeros((3, 3)), prim)
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
        held = prim.real("mjc:body:gravcomp", 0.0)
        found.gravity = held != 1.0 and not prim.flag("physxRigidBody:disableGravity", False)
        if held not in (0.0, 1.0):
            self.remark(prim, PARTLY, f"mjc:body:gravcomp {held:g}")
        return found

    def weight(self, prim: Prim) -> float:
        """The mass that a prim gives [kg], or 0."""
        found = float(self.precise(prim, "physics:mass", (0.0,))[0])
        return self.mass * found if found >= 0.0 else prim.fail(f"has the mass {found:g}")

    def inertia(self, prim: Prim, moments: Array) -> Array:
        """The inertia that a body gives about its centre of mass, in its own axes and the units of the file."""
        if prim.value("newton:inertia"):
            xx, yy, zz, xy, xz, yz = prim.finite("newton:inertia", (0.0,) * 6)
            return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        quaternion = prim.finite("physics:principalAxes", (0.0,) * 4)
        axes = rotation(prim, "physics:principalAxes", quaternion) if np.any(quaternion) else np.eye(3)
        found = matmul(matmul(axes, np.diag(moments)), axes.T)
        if prim.value(f"{OWN}:inertia") is None:
            return found
        exact = prim.finite(f"{OWN}:inertia", (0.0,) * 9).reshape(3, 3)
        same = np.allclose(exact, found, rtol=0.0, atol=EQUAL_IN_SIX_DIGITS * float(np.abs(found).max()))
        return np.asarray(self.agreed(prim, f"{OWN}:inertia", exact, found, same))

    def whole(self, body: Body, shapes: list[Prim]) -> Part | None:
        """All shapes of a body as one part, or None where they have no volume."""
        parts = []
        for shape in shapes:
            form = str(shape.value("physics:approximation") or "")
            if form in APPROXIMATED:
                self.remark(shape, "an approximation of the mesh, whose own volume is used", form, "changed")
            if str(shape.value("newton:massModel")) == "shell" or shape.flag("mjc:shellinertia", False):
                self.remark(shape, SHELL)
            if shape is not body.prim and shape.value("physics:mass") == 0.0:
                self.remark(shape, NO_MASS, "physics:mass 0")
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


def short(prims: list[Prim], taken: set[str]) -> dict[str, str]:
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
