"""A robot between its file and a mechanism: links, joints that form a tree, and loop closures.

The readers of URDF, SDFormat and MJCF fill it; `build` draws it. Frames are 4 x 4, in their parents' or in the world.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder import Builder
from ..errors import DescriptionError
from .looks import Look, shapes_of
from .reading import Reading, Remark
from .xmltree import Element

Array = NDArray[np.float64]

MASSLESS = 1e-9
"""A link of no more than this [kg] at a fixed joint is a frame on its parent link: the lightest screw of a watch is a
hundred times as heavy."""
HEAVY = 1e5
"""A link of more than this [kg] is a dummy: no robot weighs a hundred tonnes."""
THROUGH = 1e-12
"""Axes are through one point when the frames of their joints are at most this far apart [m]."""


@dataclass
class Link:
    """A body: its inertia about its centre of mass, in its own axes."""

    name: str
    mass: float
    com: Array
    inertia: Array
    at: Element
    gravity: bool = True


@dataclass
class Spring:
    """Spring and damper between two points, each with the link that it is on."""

    name: str
    first: tuple[str, Array]
    second: tuple[str, Array]
    stiffness: float
    damping: float
    length: float


@dataclass(frozen=True)
class Effort:
    """Spring and damper along one coordinate of a joint; without a name it is that of the joint."""

    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0
    coordinate: int = 0
    name: str = ""


@dataclass
class Joint:
    """A joint of the tree; `place` is the frame of its child in that of its parent; its point (`point`) and its `axis`
    are in that of its child."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Array
    axis: Array
    at: Element
    efforts: list[Effort] = field(default_factory=list)
    pitch: float = 0.0
    second: Array | None = None
    point: Array = field(default_factory=lambda: np.zeros(3))

    def along(self, coordinate: int) -> list[Effort]:
        """Its springs and dampers as those of a coordinate of the joint that replaces it."""
        return [replace(e, coordinate=coordinate, name=e.name or f"spring of {self.name}") for e in self.efforts]


@dataclass
class Loop:
    """A joint between two frames to be joined: (link, frame in it) of each; axes in the first frame."""

    name: str
    kind: str
    first: tuple[str, Array]
    second: tuple[str, Array]
    at: Element | None
    axis: Array | None = None
    second_axis: Array | None = None
    efforts: list[Effort] = field(default_factory=list)


@dataclass
class Tie:
    """Coordinates of joints that follow each other: sum of factor x coordinate = offset."""

    name: str
    joints: list[str]
    factors: list[float]
    offset: float
    at: Element


@dataclass
class Robot:
    """The whole robot, and the remarks on it."""

    name: str
    reading: Reading
    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    frames: dict[str, tuple[str, Array]] = field(default_factory=dict)
    looks: list[Look] = field(default_factory=list)
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    drawing_tolerance: float | None = None
    gimbals: bool = False
    poses: dict[str, Array] | None = None

    def root(self) -> str:
        """The root link, which is the child of no joint; refuses trees with none, with several, and cycles."""
        parent_joint: dict[str, Joint] = {}
        for joint in self.joints.values():
            for end in (joint.parent, joint.child):
                if end not in self.links:
                    joint.at.fail(f'names the link "{end}", which does not exist')
            if joint.child in parent_joint:
                other = parent_joint[joint.child].name
                joint.at.fail(
                    f'has the child "{joint.child}", which is already the child of joint "{other}"; in this format a '
                    "link has one parent joint: close the loop by a pair of frames"
                )
            parent_joint[joint.child] = joint
        roots = [name for name in self.links if name not in parent_joint]
        if len(roots) == 1:
            seen = self.outwards(roots[0])
            if len(seen) == len(self.links):
                return roots[0]
            lost = parent_joint[next(name for name in self.links if name not in set(seen))]
            lost.at.fail(f'joints form a cycle through the link "{lost.child}", which is not connected to the root')
        if not roots:
            next(iter(parent_joint.values())).at.fail("joints form a cycle: every link is the child of another one")
        self.links[roots[1]].at.fail(
            f'is the child of no joint, and neither is "{roots[0]}": a robot has one root; join them, by a fixed or a '
            "floating joint"
        )

    def outwards(self, name: str) -> list[str]:
        """A link and all its descendants, each after its parent."""
        children: dict[str, list[str]] = {}
        for joint in self.joints.values():
            children.setdefault(joint.parent, []).append(joint.child)
        found = [name]
        for link in found:
            found += children.get(link, [])
        return found

    def frame(self, name: str) -> tuple[str, Array] | None:
        """Link and place of a frame: a link's own, a joint's, or a mark."""
        if name in self.frames:
            return self.frames[name]
        if name in self.links:
            return name, np.eye(4)
        if name in self.joints:
            return self.joints[name].child, np.eye(4)
        return None


def placed(xyz: Any, rotation: Any) -> Array:
    """The transform of a pose."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, xyz
    return found


def turned(rpy: Any) -> Array:
    """The rotation of roll, pitch and yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def fold_marks(robot: Robot) -> None:
    """Massless links at the end of fixed joints are frames of their parents."""
    while True:
        parents = {joint.parent for joint in robot.joints.values()}
        marks = [
            joint
            for joint in robot.joints.values()
            if joint.kind == "fixed" and joint.child not in parents and robot.links[joint.child].mass <= MASSLESS
        ]
        if not marks:
            return
        for joint in marks:
            for name, (link, pose) in list(robot.frames.items()):
                if link == joint.child:
                    robot.frames[name] = (joint.parent, joint.pose @ pose)
            robot.frames[joint.child] = robot.frames[joint.name] = (joint.parent, joint.pose)
            for loop in robot.loops:
                loop.first, loop.second = (
                    (joint.parent, joint.pose @ pose) if link == joint.child else (link, pose)
                    for link, pose in (loop.first, loop.second)
                )
            mass = robot.links[joint.child].mass
            with_mass = f" and its mass of {mass:.2g} kg is omitted" if mass > 0.0 else ""
            remark = f'link "{joint.child}" is taken as a frame of "{joint.parent}"{with_mass}'
            robot.reading.changed.append(Remark(robot.links[joint.child].at.line, remark))
            del robot.joints[joint.name], robot.links[joint.child]


def fold_hinges(robot: Robot) -> None:
    """Two or three hinges through one point with only massless links between them are a universal or a ball joint."""
    tied = {name for tie in robot.ties for name in tie.joints}
    held = {link for loop in robot.loops for link, _ in (loop.first, loop.second)}
    held |= {link for link, _ in robot.frames.values()} | _sprung(robot)
    carrying = {joint.child: joint for joint in robot.joints.values()}
    children: dict[str, list[Joint]] = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint)

    def between(name: str) -> bool:
        """Whether this link only connects two hinges through one point."""
        link, after = robot.links[name], children.get(name, [])
        if name in held or name not in carrying or len(after) != 1 or link.mass > MASSLESS or np.any(link.inertia):
            return False
        hinges = carrying[name].kind == after[0].kind == "revolute"
        before, behind = carrying[name].point, after[0].pose[:3, 3] + after[0].pose[:3, :3] @ after[0].point
        return hinges and float(np.linalg.norm(behind - before)) <= THROUGH

    for last in list(robot.joints.values()):
        chain = [last]
        while between(chain[0].parent):
            chain.insert(0, carrying[chain[0].parent])
        if between(last.child) or len(chain) > 3:
            continue
        names = [joint.name for joint in chain]
        if len(chain) == 1 or tied.intersection(names):
            continue
        axes, pose = [], np.eye(4)
        for joint in chain:
            pose = pose @ joint.pose
            axes.append(pose[:3, :3] @ joint.axis)
        apart = np.linalg.svd(np.array(axes), compute_uv=False)[-1]
        square = len(chain) == 3 or abs(float(axes[0] @ axes[1])) <= 1e-9
        if apart < 1e-3 or not square:
            continue
        kind = "spherical" if len(chain) == 3 else "universal"
        efforts = [effort for i, joint in enumerate(chain) for effort in joint.along(i)]
        if kind == "spherical" and efforts:
            continue  # a ball has no angles for springs to act along
        first, second = (pose[:3, :3].T @ axis for axis in axes[:2])
        folded = Joint(
            last.name,
            kind,
            chain[0].parent,
            last.child,
            pose,
            first,
            last.at,
            efforts,
            second=second,
            point=last.point,
        )
        for joint in chain[:-1]:
            del robot.links[joint.child], robot.joints[joint.name]
        robot.joints[last.name] = folded
        remark = f"hinges {', '.join(names)} with no mass between them are one {kind} joint, {last.name}"
        robot.reading.changed.append(Remark(last.at.line, remark))


def fold_sleeves(robot: Robot) -> None:
    """A slide and a hinge along one line with only massless links between them are a cylindrical joint."""
    children = Counter(joint.parent for joint in robot.joints.values())
    carrying = {joint.child: joint for joint in robot.joints.values()}
    used = {name for tie in robot.ties for name in tie.joints}
    used |= {link for loop in robot.loops for link, _ in (loop.first, loop.second)}
    used |= {link for link, _ in robot.frames.values()} | _sprung(robot)
    for turn in list(robot.joints.values()):
        slide = carrying.get(turn.parent)
        if slide is None or (slide.kind, turn.kind) != ("prismatic", "revolute") or used & {slide.name, turn.name}:
            continue
        axis = turn.pose[:3, :3] @ turn.axis
        if turn.parent in used or children[turn.parent] != 1 or not _nothing(robot, turn.parent):
            continue
        if float(np.linalg.norm(axis - slide.axis)) > THROUGH:
            continue
        pose = slide.pose @ turn.pose
        robot.joints[turn.name] = Joint(
            turn.name,
            "cylindrical",
            slide.parent,
            turn.child,
            pose,
            turn.axis,
            turn.at,
            [*slide.along(0), *turn.along(1)],
            point=turn.point,
        )
        del robot.joints[slide.name], robot.links[turn.parent]
        remark = f"{slide.name} and {turn.name} with no mass between them are one cylindrical joint, {turn.name}"
        robot.reading.changed.append(Remark(turn.at.line, remark))


def fold_ends(robot: Robot) -> None:
    """A massless link at the end of a joint, welded to another link, is omitted: the joint closes the loop itself."""
    children = Counter(joint.parent for joint in robot.joints.values())
    carrying = {joint.child: joint for joint in robot.joints.values()}
    ends = Counter(link for loop in robot.loops for link, _ in (loop.first, loop.second))
    tied = {name for tie in robot.ties for name in tie.joints}
    marked = {link for link, _ in robot.frames.values()} | _sprung(robot)
    for loop in robot.loops:
        for one, other in ((loop.first, loop.second), (loop.second, loop.first)):
            joint = carrying.get(one[0])
            if loop.kind != "fixed" or joint is None or joint.kind in ("fixed", "free") or joint.name in tied:
                continue
            alone = ends[one[0]] == 1 and children[one[0]] == 0 and one[0] not in marked
            if not alone or not _nothing(robot, one[0]) or other[0] == joint.parent:
                continue
            point = placed(joint.point, np.eye(3))
            back = np.eye(4)
            back[:3, :3] = one[1][:3, :3].T
            back[:3, 3] = -back[:3, :3] @ one[1][:3, 3]
            loop.kind, loop.axis, loop.second_axis = joint.kind, joint.axis, joint.second
            loop.efforts = [replace(e, name=e.name or f"spring of {joint.name}") for e in joint.efforts]
            loop.first, loop.second = (joint.parent, joint.pose @ point), (other[0], other[1] @ back @ point)
            remark = f'link "{one[0]}" of no mass is omitted: {joint.name} closes the loop {loop.name} directly'
            robot.reading.changed.append(Remark(robot.links[one[0]].at.line, remark))
            robot.frames.pop(joint.name, None)
            del robot.joints[joint.name], robot.links[one[0]]
            break
    for loop in robot.loops:
        while loop.name in robot.joints:
            loop.name = f"closing {loop.name}"


def _nothing(robot: Robot, link: str) -> bool:
    """Whether this link has neither mass nor inertia."""
    return robot.links[link].mass == 0.0 and not np.any(robot.links[link].inertia)


def _sprung(robot: Robot) -> set[str]:
    """Links to which springs between points are attached."""
    return {link for spring in robot.springs for link, _ in (spring.first, spring.second)}


def build(robot: Robot, mechanism: Builder, base: str) -> None:
    """Draw the robot with all its coordinates zero; the root is fixed, or floats, unless the file gives all poses."""
    if robot.poses is not None:
        _placed(robot, mechanism, robot.poses)
        robot.reading.shapes = shapes_of(robot, None)
        return
    root = robot.root()
    fold_marks(robot)
    if not robot.gimbals:
        fold_hinges(robot)
        fold_sleeves(robot)
        fold_ends(robot)
    order = robot.outwards(root)
    into = {joint.child: joint for joint in robot.joints.values()}
    pose = {root: np.eye(4)}
    for name in order[1:]:
        pose[name] = pose[into[name].parent] @ into[name].pose
    grounded = robot.links[root].mass <= MASSLESS and base == "fixed"
    body: dict[str, Any] = {root: mechanism.ground} if grounded else {}
    for name in order[int(grounded) :]:
        body[name] = _body(robot, mechanism, robot.links[name], pose[name])
    if grounded:
        robot.reading.changed.append(Remark(robot.links[root].at.line, f'link "{root}" is the ground'))
    elif base == "fixed":
        mechanism.add_fixed(f"{root} stands", mechanism.ground, body[root])
        robot.reading.changed.append(Remark(robot.links[root].at.line, f'the root "{root}" is fixed to the ground'))
    for joint in (into[name] for name in order[1:]):
        where = pose[joint.child] @ placed(joint.point, np.eye(3))
        ends = (body[joint.parent], body[joint.child])
        axes = (joint.axis, joint.second)
        _joint(mechanism, joint.name, joint.kind, ends, (where, where), axes, joint.at)
        _springs(mechanism, joint.name, joint.efforts)
    for loop in robot.loops:
        (link1, frame1), (link2, frame2) = loop.first, loop.second
        if body[link1] == body[link2]:
            message = f'{loop.name} joins two frames of one link, "{link1}"; it closes nothing'
            robot.reading.dropped.append(Remark(loop.at.line if loop.at else None, message))
            continue
        frames = (pose[link1] @ frame1, pose[link2] @ frame2)
        axis = np.array([1.0, 0.0, 0.0]) if loop.axis is None else loop.axis
        ends = (body[link1], body[link2])
        _joint(mechanism, loop.name, loop.kind, ends, frames, (axis, loop.second_axis), loop.at)
        _springs(mechanism, loop.name, loop.efforts)
    for tie in robot.ties:
        mechanism.add_coupler(tie.name, tie.joints, tie.factors, tie.offset)
    for spring in robot.springs:
        sides = [_on_body(robot, *side) for side in (spring.first, spring.second)]
        (link1, point1), (link2, point2) = sides
        data: dict[str, Any] = {"stiffness": spring.stiffness, "damping": spring.damping, "length": spring.length}
        mechanism.add_spring(spring.name, body[link1], point1, body[link2], point2, **data)
    robot.reading.shapes = shapes_of(robot, root if grounded else None)


def _on_body(robot: Robot, link: str, point: Array) -> tuple[str, Array]:
    """A point of a link that may have become a frame."""
    if link in robot.links:
        return link, point
    carrier, pose = robot.frames[link]
    return carrier, pose[:3, :3] @ point + pose[:3, 3]


def _placed(robot: Robot, mechanism: Builder, poses: dict[str, Array]) -> None:
    """A model that gives the poses of its links; its joints may close loops."""
    body: dict[str, Any] = {"world": mechanism.ground}
    for name, link in robot.links.items():
        body[name] = _body(robot, mechanism, link, poses[name])
    for joint in robot.joints.values():
        ends, frames = (body[joint.parent], body[joint.child]), (joint.pose, joint.pose)
        _joint(mechanism, joint.name, joint.kind, ends, frames, (joint.axis, joint.second), joint.at, joint.pitch)
        _springs(mechanism, joint.name, joint.efforts)


def _springs(mechanism: Builder, joint: str, efforts: list[Effort]) -> None:
    """Springs and dampers of a joint."""
    for effort in efforts:
        name = effort.name or f"spring of {joint}"
        while name in mechanism._description.forces:
            name = f"{name} of {joint}"
        law = {"stiffness": effort.stiffness, "damping": effort.damping, "angle": effort.rest}
        mechanism.add_torsion_spring(joint, **law, coordinate=effort.coordinate, name=name)


def _body(robot: Robot, mechanism: Builder, link: Link, pose: Array) -> Any:
    if link.mass > HEAVY:
        remark = f'link "{link.name}" of {link.mass:.3g} kg looks like a dummy; it is kept as it is'
        robot.reading.changed.append(Remark(link.at.line, remark))
    try:
        return mechanism.add_body(
            link.name,
            mass=link.mass,
            inertia=link.inertia,
            com=link.com,
            position=pose[:3, 3],
            orientation=nearest(pose[:3, :3]),
            **({} if link.gravity else {"gravity": False}),
        )
    except DescriptionError as error:
        link.at.fail(f"cannot be a body: {error.message}")


def nearest(rotation: Array) -> Array:
    """The nearest rotation: products of many have some round-off."""
    left, _, right = np.linalg.svd(rotation)
    return np.asarray(left @ right)


def _joint(
    mechanism: Builder,
    name: str,
    kind: str,
    ends: tuple[Any, Any],
    frames: tuple[Array, Array],
    axes: tuple[Array, Array | None],
    at: Element | None,
    pitch: float = 0.0,
) -> None:
    """A joint between two frames of the world, which may differ slightly."""
    here, there = frames
    point = here[:3, 3]
    apart: dict[str, Any] = {}
    if not np.array_equal(here, there):
        apart = {"child_point": there[:3, 3]}
    axis = here[:3, :3] @ axes[0]
    if (apart and kind in ("revolute", "prismatic", "cylindrical")) or (apart and kind == "planar"):
        apart["child_axis"] = there[:3, :3] @ axes[0]
    elif apart and kind in ("fixed", "universal"):
        apart["child_frame"] = nearest(there[:3, :3] @ here[:3, :3].T)
    add: Any = mechanism
    try:
        if kind in ("revolute", "prismatic", "cylindrical"):
            getattr(add, f"add_{kind}")(name, *ends, point=point, axis=axis, **apart)
        elif kind == "screw":
            add.add_screw(name, *ends, point=point, axis=axis, pitch=pitch)
        elif kind == "planar":
            add.add_planar(name, *ends, point=point, normal=axis, **apart)
        elif kind == "universal":
            second = here[:3, :3] @ (axes[0] if axes[1] is None else axes[1])
            add.add_universal(name, *ends, point=point, axis1=axis, axis2=second, **apart)
        elif kind == "free":
            add.add_free(name, *ends, point=point)
        else:
            getattr(add, f"add_{kind}")(name, *ends, point=point, **apart)
    except DescriptionError as error:
        if at is None:
            raise
        at.fail(f"cannot be a joint: {error.message}")
