"""A robot between its file and a mechanism: links, joints that form a tree, and loop closures.

The readers of URDF, SDFormat, MJCF and USD fill it; `robot_builder` draws it. Frames are 4 x 4, in their parents' or in
the world.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..products import SQUARED, matmul, nearest_rotation, norm
from .looks import Look
from .reading import Reading
from .request import Request
from .xmltree import Element

Array = NDArray[np.float64]

MASSLESS = 1e-9
"""A link of no more mass at a fixed joint is a frame on its parent link. Scale: kg, and `LIGHT` of the heaviest link.
Reason: the lightest screw of a watch is a hundred times as heavy."""
LIGHT = 1e-6
"""In a robot of very small links one must also be lighter than this. Scale: fraction of the mass of the heaviest
link. Reason: a millionth moves nothing."""
HEAVY = 1e5
"""A link of more mass is a dummy. Scale: kg. Reason: no robot weighs a hundred tonnes; it is said, and the link is
kept."""


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
    """Spring, damper and rotor along one coordinate of a joint; without a name it is that of the joint."""

    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0
    coordinate: int = 0
    name: str = ""
    rotor: float = 0.0
    ratio: float = 1.0
    """Inertia of a motor's rotor, and how many times as fast as the coordinate it turns."""
    constant: float = 0.0
    """A constant force or torque."""

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing."""
        return self.stiffness == self.damping == self.rotor == self.constant == 0.0


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
    free: tuple[str, ...] = ()
    """Directions of a joint of kind "generic"."""

    def along(self, coordinate: int) -> list[Effort]:
        """Its springs and dampers as those of a coordinate of the joint that replaces it."""
        return [replace(e, coordinate=coordinate, name=e.name or f"spring of {self.name}") for e in self.efforts]


@dataclass
class Loop:
    """A joint between two frames to be joined: (link, frame in it) of each; axes in the first frame. `free` are the
    directions of a joint of kind "generic"; a `distance` keeps the origins of the frames at this `length`."""

    name: str
    kind: str
    first: tuple[str, Array]
    second: tuple[str, Array]
    at: Element | None
    axis: Array | None = None
    second_axis: Array | None = None
    efforts: list[Effort] = field(default_factory=list)
    free: tuple[str, ...] = ()
    length: float = 0.0


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
    request: Request
    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    frames: dict[str, tuple[str, Array]] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    looks: list[Look] = field(default_factory=list)
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    drawing_tolerance: float | None = None
    gimbals: bool = False
    poses: dict[str, Array] | None = None
    world: str = "world"
    """The ground, as an end of joints of a model that gives all poses."""

    @property
    def massless(self) -> float:
        """Mass [kg] up to which a link at a fixed joint is a frame."""
        return massless_of(link.mass for link in self.links.values())

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

    def line(self, at: Element) -> int | None:
        """The line of an element for remarks; None in a file that the model includes."""
        return at.line if at.path == self.reading.path else None

    def sprung(self) -> set[str]:
        """Links to which springs between points are attached."""
        return {link for spring in self.springs for link, _ in (spring.first, spring.second)}

    def rename(self, old: str, new: str) -> None:
        """Give a link another name, everywhere."""

        def moved(side: tuple[str, Array]) -> tuple[str, Array]:
            return (new, side[1]) if side[0] == old else side

        self.links = {new if name == old else name: link for name, link in self.links.items()}
        self.links[new].name = new
        for joint in self.joints.values():
            joint.parent, joint.child = (new if end == old else end for end in (joint.parent, joint.child))
        pairs: list[Loop | Spring] = [*self.loops, *self.springs]
        for pair in pairs:
            pair.first, pair.second = moved(pair.first), moved(pair.second)
        self.frames = {name: moved(frame) for name, frame in self.frames.items()}
        self.looks = [replace(look, link=new) if look.link == old else look for look in self.looks]
        if self.poses is not None and old in self.poses:
            self.poses[new] = self.poses.pop(old)

    def frame(self, name: str) -> tuple[str, Array] | None:
        """Link and place of a frame: a link's own, a joint's, or a mark."""
        if name in self.frames:
            return self.frames[name]
        if name in self.links:
            return name, np.eye(4)
        if name in self.joints:
            return self.joints[name].child, np.eye(4)
        return None


def massless_of(masses: Iterable[float]) -> float:
    """Mass [kg] up to which one of several bodies is a frame where it is fixed to another."""
    return min(MASSLESS, LIGHT * max(masses, default=0.0))


def placed(xyz: Any, rotation: Any) -> Array:
    """The transform of a pose."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation, xyz
    return found


def unit(axis: Array) -> Array | None:
    """The direction of an axis, however short; None where it has none."""
    size = float(np.max(np.abs(axis)))
    if size == 0.0:
        return None
    if not 1.0 / SQUARED < size < SQUARED:  # its squares are too small, or too large
        axis = axis / size
    return axis / norm(axis)


def inverse(frame: Array) -> Array:
    """Of a frame."""
    turned = frame[:3, :3].T
    return placed(matmul(-turned, frame[:3, 3]), turned)


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


def rotation_of(quaternion: Any) -> Array:
    """The rotation of a quaternion (w, x, y, z) of any length."""
    given = np.asarray(quaternion, dtype=float)
    given = given / np.abs(given).max()  # squares of small ones are zero
    w, x, y, z = given / norm(given)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def nearest(rotation: Array) -> Array:
    """The nearest rotation: products of many have some round-off."""
    return nearest_rotation(rotation)
