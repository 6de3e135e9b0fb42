"""A mechanism in the form of robots' files: a tree of bodies drawn with all coordinates zero, and its loop closures.

The joints of the tree are decomposed into translations, rotations and balls. A joint that the tree traverses from its
child to its parent has its motions in reverse order along opposite axes, so that its coordinates are unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..builder import Builder
from ..builder.calls import kind_of
from ..builder.checks import Array
from ..builder.joints import motions
from ..builder.records import GROUND, CouplingRecord, Description, JointRecord, TorqueRecord
from ..products import matmul, norm
from ..tolerance import SUM_ROUNDING
from .robot import inverse, nearest, placed
from .writing import Writing
from .writing_table import DROPPED, TABLE

_ALWAYS_CUT = 6
_LAST = 5
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Motion:
    """One translation, one rotation, or a ball; `axis` in the axes of the body that moves. `coordinate` is its number
    in the joint of the mechanism."""

    kind: str
    axis: Array
    name: str
    coordinate: int


@dataclass(frozen=True)
class Branch:
    """A body on its parent; `point`, the position of the joint, in its own axes. Without motions it is welded; `floats`
    where it is free."""

    body: str
    parent: str
    joint: JointRecord | None
    pose: Array
    point: Array
    motions: tuple[Motion, ...]
    floats: bool = False
    name: str = ""


@dataclass(frozen=True)
class Closure:
    """A joint that closes a loop, between a frame of its parent and one of its child; axes of the motions in these."""

    joint: JointRecord
    here: Array
    there: Array
    motions: tuple[Motion, ...]


@dataclass
class Skeleton:
    """The tree, each body after the one that carries it, and the closures."""

    branches: list[Branch]
    closures: list[Closure]
    poses: dict[str, Array]
    names: Names = field(repr=False)

    def motion(self, joint: str, coordinate: int) -> Motion | None:
        """The motion that represents a coordinate of a joint."""
        of = [b.motions for b in self.branches if b.joint is not None and b.joint.name == joint]
        of += [c.motions for c in self.closures if c.joint.name == joint]
        return next((m for motions in of for m in motions if m.coordinate == coordinate and m.kind != "ball"), None)


class Names:
    """The names in use; `new` returns an unused one."""

    def __init__(self, used: Iterable[str]) -> None:
        self.used = set(used)

    def new(self, wanted: str) -> str:
        """The wanted name, with a number behind it where it is taken."""
        name, number = wanted, 1
        while name in self.used:
            number += 1
            name = f"{wanted} {number}"
        self.used.add(name)
        return name


def skeleton(mechanism: Builder, report: Writing) -> Skeleton:
    """The tree and the closures; what translations and rotations cannot represent is listed in the report."""
    d = mechanism._description
    names = Names([GROUND, "world", *d.bodies, *d.joints, *d.couplings])
    chosen = _tree(d)
    beside: dict[str, list[tuple[str, JointRecord]]] = {}
    for joint in chosen:
        beside.setdefault(joint.parent, []).append((joint.child, joint))
        beside.setdefault(joint.child, []).append((joint.parent, joint))
    drawn = {name: placed(body.position, body.rotation) for name, body in d.bodies.items()} | {GROUND: np.eye(4)}
    poses = {GROUND: np.eye(4)}
    branches: list[Branch] = []
    rough: set[str] = set()

    def outwards(root: str) -> None:
        queue = [root]
        for parent in queue:
            for body, joint in beside.get(parent, []):
                if body not in poses:
                    branches.append(_branch(d, joint, parent, body, drawn, poses, rough, names, report))
                    queue.append(body)

    outwards(GROUND)
    for body in d.bodies:
        if body not in poses:
            poses[body] = drawn[body]
            name = names.new(f"{body} floats")
            branches.append(Branch(body, GROUND, None, drawn[body], np.zeros(3), (), True, name))
            report.changed.append(f'body "{body}", which is attached to nothing, is given a free joint, {name}')
            outwards(body)
    kept = {joint.name for joint in chosen}
    closures = [_closure(d, j, drawn, names) for j in d.joints.values() if j.name not in kept and _closes(j, report)]
    return Skeleton(branches, closures, poses, names)


def _closes(joint: JointRecord, report: Writing) -> bool:
    if joint.kind == "free":
        report.changed.append(f"free joint {joint.name}, which constrains nothing, is omitted")
    return joint.kind not in ("constant_velocity", "free")


def loaded(d: Description) -> set[str]:
    """Names of joints whose coordinates forces, couplings, rotors or drives refer to."""
    terms = [term for c in d.couplings.values() for term in c.terms] + [drive.measure for drive in d.drives.values()]
    found = {str(term["joint"]) for term in terms if term.get("of") == "joint"} | {r.joint for r in d.rotors.values()}
    efforts = {f.joint for f in d.forces.values() if isinstance(f, TorqueRecord)}
    return found | efforts | {f["joint"] for f in d.loads("torsion_spring")}


def _tree(d: Description) -> list[JointRecord]:
    """Joints that form a tree: first required ones, loaded ones, those that are not single points; among them in the
    order of description."""
    of, bound = loaded(d), list(d.joints.values())

    def rank(joint: JointRecord) -> int:
        if joint.kind in ("constant_velocity", "free"):
            return _ALWAYS_CUT if joint.kind == "constant_velocity" else _LAST
        if joint.cut != "auto":
            return 0 if joint.cut == "never" else _LAST - 1
        return 1 if joint.name in of else 3 if joint.kind in ("revolute", "spherical", "fixed") else 2

    up = {name: name for name in (GROUND, *d.bodies)}

    def top(name: str) -> str:
        while up[name] != name:
            up[name] = up[up[name]]
            name = up[name]
        return name

    chosen = []
    for joint in sorted(bound, key=rank):
        one, other = top(joint.parent), top(joint.child)
        if one != other and rank(joint) != _ALWAYS_CUT:
            up[one] = other
            chosen.append(joint)
    return chosen


def axes_of(joint: JointRecord) -> tuple[tuple[str, Array], ...]:
    """Motions of a joint from its parent to its child, in world axes as drawn on the side of the parent.

    A joint that constrains nothing has none.
    """
    if joint.kind == "free":
        return ()
    unit = {word: axis if word == "frame" else axis / norm(axis) for word, axis in joint.geometry.items()}
    axis = next((unit[word] for word in ("axis", "normal", "axis1") if word in unit), None)
    frame = unit.get("frame", np.eye(3)) if axis is None else np.column_stack([*across(axis), axis])
    along = {**dict(zip("xyz", frame.T, strict=True)), "1": axis, "2": unit.get("axis2")}
    moving = motions(joint)
    slides = [("slide", along[item]) for item in moving if not item.startswith("r")]
    turns = [("turn", along[item[1:]]) for item in moving if item.startswith("r")]
    return (*slides, *(turns if len(turns) < 3 else [("ball", _Z)]))


def across(axis: Array) -> tuple[Array, Array]:
    """Two directions perpendicular to an axis and to each other."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= norm(x)
    return x, np.cross(axis, x)


def turn_of_child(joint: JointRecord) -> Array:
    """Rotation of the joint frame on the child relative to that on the parent, as drawn."""
    if joint.child_frame is not None:
        return np.asarray(matmul(joint.child_frame, joint.geometry.get("frame", np.eye(3)).T))
    if joint.child_axis is None:
        return np.eye(3)
    axis = next((joint.geometry[word] for word in ("axis", "normal") if word in joint.geometry), None)
    return np.eye(3) if axis is None else _between(axis, joint.child_axis)


def _between(one: Array, other: Array) -> Array:
    """The smallest rotation that brings one direction to another."""
    a, b = one / norm(one), other / norm(other)
    w, cosine = np.cross(a, b), float(matmul(a, b))
    turned = norm(w) > SUM_ROUNDING
    if cosine >= 0.0:
        factor = 1.0 / (1.0 + cosine)
    else:  # opposite directions do not determine the axis of rotation
        w = w if turned else across(a)[0]
        factor = (1.0 - cosine) / float(matmul(w, w))
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]]) if turned else np.zeros((3, 3))
    return cosine * np.eye(3) + cross + factor * np.outer(w, w)


def point_of(joint: JointRecord, drawn: dict[str, Array]) -> Array:
    if joint.point is not None:
        return joint.point
    return drawn[joint.parent if joint.child == GROUND else joint.child][:3, 3]


def _named(joint: JointRecord, turn: Array, names: Names, reverse: bool) -> tuple[Motion, ...]:
    """The motions of a joint, their axes turned by `turn`; the last one bears its name, for its coordinate."""
    order = list(enumerate(axes_of(joint)))
    motions: list[Motion] = []
    for kind_axis in reversed(order) if reverse else order:
        i, (kind, axis) = kind_axis
        last = len(motions) == len(order) - 1
        name = joint.name if last else names.new(f"{joint.name} {kind} {i}")
        motions.append(Motion(kind, matmul(turn, -axis if reverse else axis), name, i))
    return tuple(motions)


def _branch(
    d: Description,
    joint: JointRecord,
    parent: str,
    body: str,
    drawn: dict[str, Array],
    poses: dict[str, Array],
    rough: set[str],
    names: Names,
    report: Writing,
) -> Branch:
    """A body with the joint that carries it, all coordinates zero."""
    point, reverse = point_of(joint, drawn), body != joint.child
    apart = joint.child_point is not None or joint.child_axis is not None or joint.child_frame is not None
    if apart:
        there = placed(point if joint.child_point is None else joint.child_point, turn_of_child(joint))
        moved = matmul(
            placed(point, np.eye(3)), inverse(there)
        )  # the transformation of the child to the joint on the parent
        pose = matmul(matmul(inverse(drawn[joint.parent]), moved), drawn[joint.child])
        pose = inverse(pose) if reverse else pose
        pose[:3, :3] = nearest(pose[:3, :3])
    else:
        pose = matmul(inverse(drawn[parent]), drawn[body])
    same = not apart and parent not in rough
    poses[body] = drawn[body] if same else matmul(poses[parent], pose)
    if not same:
        rough.add(body)
    if reverse:
        remark = f'joint {joint.name} is reversed: from "{joint.child}" to "{joint.parent}", about the opposite axis'
        report.changed.append(f"{remark}: its coordinates are the same, its reactions have the other sign")
        if any(kind == "ball" for kind, _ in axes_of(joint)):
            report.changed[-1] += ", its quaternion is the conjugate"
    # axes and point in the moving body
    at = inverse(drawn[joint.parent])[:3, :3]
    in_parent = placed(matmul(at, point - drawn[joint.parent][:3, 3]), at)
    seen = in_parent if reverse else matmul(inverse(pose), in_parent)
    floats = joint.kind == "free"
    motions = () if floats else _named(joint, seen[:3, :3], names, reverse)
    return Branch(body, parent, joint, pose, seen[:3, 3], motions, floats, joint.name)


def _closure(d: Description, joint: JointRecord, drawn: dict[str, Array], names: Names) -> Closure:
    point = point_of(joint, drawn)
    other = point if joint.child_point is None else joint.child_point
    here = matmul(inverse(drawn[joint.parent]), placed(point, np.eye(3)))
    there = matmul(inverse(drawn[joint.child]), placed(other, turn_of_child(joint)))
    return Closure(joint, here, there, _named(joint, np.eye(3), names, False))


def ties(d: Description, tree: Skeleton, report: Writing) -> list[tuple[str, str, str, float, float]]:
    """Couplers of two joints as (name, follower, leader, factor, offset): follower = factor x leader + offset; threads
    among them. What couples otherwise is dropped."""
    found: list[tuple[str, str, str, float, float]] = []
    for joint in d.joints.values():
        if joint.kind == "screw" and joint.pitch is not None:
            slide, turn = tree.motion(joint.name, 0), tree.motion(joint.name, 1)
            if slide is not None and turn is not None:
                factor = joint.pitch / (2.0 * np.pi)
                found.append((tree.names.new(f"{joint.name} thread"), slide.name, turn.name, factor, 0.0))
                report.changed.append(f"screw {joint.name} becomes a slide and a coupled rotation")
        if joint.kind == "custom":
            what = f"joint {joint.name}: {', '.join(joint.follows)} no longer depend on the others"
            report.dropped.append(f"{what}: functions of its other coordinates cannot be represented in this format")
    for coupling in d.couplings.values():
        if TABLE[kind_of(coupling)][report.kind].rule == DROPPED:
            continue
        pair = _pair(coupling, tree)
        if pair is None:
            what = f"{coupling.word} {coupling.name}"
            report.dropped.append(f"{what}: only two joint coordinates in a fixed ratio can be coupled in this format")
        else:
            found.append(pair)
    return found


def _pair(coupling: CouplingRecord, tree: Skeleton) -> tuple[str, str, str, float, float] | None:
    if coupling.kind != "linear" or len(coupling.terms) != 2 or any(t.get("of") != "joint" for t in coupling.terms):
        return None
    motions = [tree.motion(str(term["joint"]), int(term["coordinate"])) for term in coupling.terms]
    first, second = coupling.data["factors"]
    if motions[0] is None or motions[1] is None:
        return None
    offset = float(coupling.data["offset"]) / first
    return coupling.name, motions[0].name, motions[1].name, -second / first, offset


@dataclass(frozen=True)
class Spring:
    """Springs and dampers of one coordinate, as one."""

    stiffness: float
    damping: float
    rest: float


def springs(d: Description, report: Writing) -> dict[tuple[str, int], Spring]:
    """By joint and coordinate; several at one coordinate act as one. Negative ones are dropped."""
    found: dict[tuple[str, int], Spring] = {}
    for force in d.loads("torsion_spring"):
        own, where = Spring(force["stiffness"], force["damping"], force["angle"]), (force["joint"], force["coordinate"])
        if own.stiffness < 0.0 or own.damping < 0.0:
            report.dropped.append(f"spring {force.name}, whose stiffness or damping is negative")
            continue
        one = found.get(where, Spring(0.0, 0.0, 0.0))
        stiffness, rest = one.stiffness + own.stiffness, one.rest
        if own.stiffness > 0.0:
            pull = one.stiffness * one.rest + own.stiffness * own.rest
            rest = own.rest if one.stiffness == 0.0 else pull / stiffness
        found[where] = Spring(stiffness, one.damping + own.damping, rest)
    return found


def text(value: float) -> str:
    """The shortest text of a number that gives the same one back."""
    return repr(float(value) + 0.0)


def words(values: Iterable[float]) -> str:
    """Several of them."""
    return " ".join(text(value) for value in values)


def quoted(name: str) -> str:
    """A name as the value of an attribute, quotes included."""
    for sign, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")):
        name = name.replace(sign, entity)
    return f'"{name}"'
