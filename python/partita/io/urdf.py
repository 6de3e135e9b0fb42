"""URDF: a tree of links and joints, with the dialects for loop closures.

Loops come from `<loop>` and `<coupling>` (URDF+), from `<loop_joint>` with two links, from frames named
`closing_NAME_1` and `closing_NAME_2`, and from a YAML file of the same name beside it that lists pairs of frames
(`sidecar`). `urdf_table` lists what becomes of each element and attribute.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..products import matmul
from . import closings
from .format_table import content
from .looks import Look, mesh_file
from .reading import Reading, Remark
from .request import Request
from .robot import Array, Effort, Joint, Link, Loop, Robot, Tie, placed, turned, unit
from .urdf_table import URDF
from .xmltree import Element, is_zero, parse

_KINDS = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "floating": "free",
    "planar": "planar",
    "spherical": "spherical",
}
_LOOPS = {**_KINDS, "ball": "spherical", "6d": "fixed", "3d": "spherical"}


_MOTOR = "motors are not mechanics: add_drive prescribes motions, add_torque efforts"
WORLD = "world"
"""Link that other readers know without its definition."""


def read(path: Path, request: Request) -> Robot:
    """The robot in a file. Raises `FileFormatError` with the line of what is wrong."""
    root = parse(path)
    if root.tag != "robot":
        root.fail("is not <robot>: this is not URDF")
    robot = Robot(root.get("name") or path.stem, Reading(path, "URDF"), request)
    idle = _idle(root)
    URDF.visit(root, robot.reading)
    for item in root.all("link"):
        _link(robot, item)
    for item in root.all("joint"):
        _joint(robot, item)
    for item in root.all("transmission"):
        _transmission(robot, item, idle)
    if not robot.links:
        root.fail("holds no <link>")
    _world(robot)
    for item in root.all("fixed_frame", "frame"):
        _frame(robot, item)
    for item in root.all("loop", "loop_joint"):
        robot.loops.append(_loop(robot, item))
    closings.close(robot)
    for item in root.all("joint"):
        _mimic(robot, item)
    for item in root.all("coupling"):
        robot.ties.append(_coupling(robot, item))
    robot.reading.used.append(Remark(None, f"{len(robot.links)} links, {len(robot.joints)} joints"))
    return robot


def _link(robot: Robot, item: Element) -> None:
    name = item.must("name")
    if name in robot.links:
        item.fail(f"appears twice; the first one is in line {robot.links[name].at.line}")
    for child in item.all("visual"):
        try:
            _look(robot, name, child)
        except FileFormatError as error:  # how a robot looks does not decide whether it is read
            robot.reading.dropped.append(Remark(child.line, error.message, f'link "{name}"', "looks"))
    mass, com, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    inertial = item.first("inertial")
    if inertial is not None:
        mass = inertial.the("mass").number("value")
        pose = origin(inertial.first("origin"))
        moments = inertial.the("inertia")
        entries = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        of = {key: moments.number(key, 0.0) for key in entries}
        if missing := [key for key in entries if not moments.get(key)]:
            text = (
                f"{', '.join(missing)} of its inertia are missing and taken as 0; other readers leave it without mass"
            )
            robot.reading.changed.append(Remark(moments.line, text, f'link "{name}"'))
        inertia = np.array(
            [[of["ixx"], of["ixy"], of["ixz"]], [of["ixy"], of["iyy"], of["iyz"]], [of["ixz"], of["iyz"], of["izz"]]]
        )
        com, axes = pose[:3, 3], pose[:3, :3]
        inertia = matmul(matmul(axes, inertia), axes.T)
    robot.links[name] = Link(name, mass, com, 0.5 * (inertia + inertia.T), item)


def _look(robot: Robot, link: str, item: Element) -> None:
    """Appearance of a link; shapes that cannot be drawn are omitted and reported."""
    geometry = item.first("geometry")
    if geometry is None or not geometry.children:
        robot.reading.dropped.append(Remark(item.line, "a <visual> without a shape", f'link "{link}"', "looks"))
        return
    of = geometry.children[0]
    shape: dict[str, Any] | None = None
    if of.tag == "box":
        shape = {"kind": "box", "size": list(of.numbers("size", 3))}
    elif of.tag == "cylinder":
        shape = {"kind": "cylinder", "radius": of.number("radius"), "length": of.number("length")}
    elif of.tag == "sphere":
        shape = {"kind": "ball", "radius": of.number("radius")}
    elif of.tag == "mesh":
        file, why = mesh_file(robot.request, of.path, of.must("filename"))
        if file is None:
            robot.reading.dropped.append(
                Remark(of.line, f"the mesh {of.get('filename')}: {why}", f'link "{link}"', "looks")
            )
            return
        shape = {"kind": "mesh", "file": str(file), "scale": list(of.numbers("scale", 3, (1.0, 1.0, 1.0)))}
    if shape is None:
        robot.reading.dropped.append(Remark(of.line, f"a <{of.tag}>", f'link "{link}"', "looks"))
        return
    robot.looks.append(Look(link, origin(item.first("origin")), shape))


def origin(item: Element | None) -> Array:
    """The frame of an `<origin xyz="..." rpy="..."/>`, or of an element with these attributes."""
    if item is None:
        return np.eye(4)
    zero = (0.0, 0.0, 0.0)
    return placed(item.numbers("xyz", 3, zero), turned(item.numbers("rpy", 3, zero)))


def _axis(item: Element, otherwise: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Array:
    found = item.first("axis")
    axis = np.array(otherwise if found is None else found.numbers("xyz", 3))
    direction = unit(axis)
    return direction if direction is not None else item.fail("has an axis of length 0")


def _joint(robot: Robot, item: Element) -> None:
    name, kind = item.must("name"), item.must("type")
    if name in robot.joints:
        item.fail(f"appears twice; the first one is in line {robot.joints[name].at.line}")
    if kind not in _KINDS:
        item.fail(f'has the type "{kind}"; known: {", ".join(_KINDS)}')
    pose = origin(item.first("origin"))
    ends = [item.the(tag).must("link") for tag in ("parent", "child")]
    axis = _axis(item) if kind not in ("fixed", "floating", "spherical") else np.array([1.0, 0.0, 0.0])
    joint = Joint(name, _KINDS[kind], ends[0], ends[1], pose, axis, item)
    dynamics = item.first("dynamics")
    if dynamics is not None:
        damping = dynamics.number("damping", 0.0)
        if damping < 0.0:
            dynamics.fail(f"has the damping {damping:g}; it must be 0 or more")
        if damping > 0.0 and joint.kind in ("revolute", "prismatic"):
            joint.efforts = [Effort(damping=damping)]
    robot.joints[name] = joint


def _idle(root: Element) -> set[str]:
    """Joints whose motors have no effort: Drake puts none there."""
    found = ((item.get("name"), limit) for item in root.all("joint") if (limit := item.first("limit")) is not None)
    return {name for name, limit in found if is_zero(limit.get("effort"))}


def _transmission(robot: Robot, item: Element, idle: set[str]) -> None:
    """A motor behind a gear: its rotor, as Drake reads it, turns with the joint; the rest is not mechanics."""
    robot.reading.dropped.append(Remark(item.line, _MOTOR, content(item), "other"))
    actuator, end = item.first("actuator"), item.first("joint")
    rotor = None if actuator is None else actuator.first("drake:rotor_inertia")
    if actuator is None or end is None or rotor is None:
        return
    gear, name, kind = actuator.first("drake:gear_ratio"), end.must("name"), item.first("type")
    inertia, ratio = rotor.number("value"), 1.0 if gear is None else gear.number("value")
    word, joint = item.get("type") or ("" if kind is None else kind.text), robot.joints.get(name)
    if joint is None:
        item.fail(f'moves the joint "{name}", which does not exist')
    if inertia < 0.0:
        rotor.fail(f"has the inertia {inertia:g}; it must be 0 or more")
    single = joint.kind in ("revolute", "prismatic")
    if name in idle or not single or "SimpleTransmission" not in word:
        why = "it has no effort" if name in idle else "it is no simple transmission" if single else "of this type"
        text = f"no rotor turns with the joint of this transmission: {why}"
        robot.reading.dropped.append(Remark(rotor.line, text, f'joint "{name}" rotor_inertia {inertia:g}', "other"))
    elif inertia > 0.0 and ratio != 0.0:
        joint.efforts.append(Effort(rotor=inertia, ratio=ratio))
        text = f"a rotor of {inertia:g} turns {ratio:g} times as fast"
        robot.reading.used.append(Remark(rotor.line, text, f'joint "{name}"'))


def _mimic(robot: Robot, item: Element) -> None:
    mimic = item.first("mimic")
    if mimic is None:
        return
    name, other = item.must("name"), mimic.must("joint")
    if robot.joints[name].kind == "fixed":
        remark = "a fixed joint follows no other one"
        robot.reading.dropped.append(Remark(mimic.line, remark, f'joint "{name}" mimic {other}', "other"))
        return
    for joint in (name, other):
        if joint not in robot.joints:
            mimic.fail(f'follows the joint "{joint}", which does not exist')
        if robot.joints[joint].kind not in ("revolute", "prismatic"):
            mimic.fail(f'follows or leads joint "{joint}", which does not have exactly one coordinate')
    factor, offset = mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)
    if factor == 0.0:
        mimic.fail("has the multiplier 0; fix the joint instead")
    robot.ties.append(Tie(f"{name} follows {other}", [name, other], [1.0, -factor], offset, mimic))
    robot.reading.used.append(Remark(mimic.line, f"joint {name} = {factor:g} x {other} + {offset:g}, a coupler"))


def _world(robot: Robot) -> None:
    """A link "world" that joints name and the file does not define is the world."""
    by = next((joint for joint in robot.joints.values() if joint.parent == WORLD), None)
    if by is not None and WORLD not in robot.links:
        robot.links[WORLD] = Link(WORLD, 0.0, np.zeros(3), np.zeros((3, 3)), by.at)
        robot.reading.changed.append(Remark(by.at.line, 'link "world", which the file does not define, is the world'))


def _frame(robot: Robot, item: Element) -> None:
    """`<fixed_frame>` or `<frame>`: a mark on a link."""
    name = item.must("name")
    parent = item.first("parent")
    link = parent.must("link") if parent is not None else item.get("attached_to") or item.must("link")
    if link not in robot.links:
        item.fail(f'is attached to the link "{link}", which does not exist')
    robot.frames[name] = (link, origin(item.first("origin") or item))


def _side(robot: Robot, item: Element) -> tuple[str, Array]:
    link = item.must("link")
    if link not in robot.links:
        item.fail(f'names the link "{link}", which does not exist')
    pose = item.first("origin")
    return link, origin(pose if pose is not None else item)


def _loop(robot: Robot, item: Element) -> Loop:
    """`<loop>` with predecessor and successor, or `<loop_joint>` with two links; an origin of the loop itself is that
    in the predecessor, the successor's frame being its link's."""
    name, kind = item.must("name"), item.get("type") or "revolute"
    if kind not in _LOOPS or _LOOPS[kind] == "free":
        known = ", ".join(word for word in _LOOPS if word != "floating")
        item.fail(f'has the type "{kind}"; a loop is closed by: {known}')
    sides = [child for tag in ("predecessor", "successor") for child in item.all(tag)]
    sides = sides or list(item.all("link1", "link2"))
    plain = not sides
    sides = sides or [item.the("parent"), item.the("child")]
    if len(sides) != 2:
        item.fail(f"names {len(sides)} links by <predecessor>, <successor> or <link1>, <link2>; a loop joins two")
    first, second = (_side(robot, side) for side in sides)
    for tag, pose in (("origin", 0), ("parent_origin", 0), ("child_origin", 1)):
        if (own := item.first(tag)) is not None:
            link, frame = (first, second)[pose]
            moved = (link, matmul(frame, origin(own)))
            first, second = (moved, second) if pose == 0 else (first, moved)
    if plain and item.first("child_origin") is None:
        robot.reading.changed.append(
            Remark(item.line, f"loop {name}: no frame in {second[0]} is given, so the frame of the link is used")
        )
    axis = _axis(item) if _LOOPS[kind] in ("revolute", "prismatic", "planar") else None
    robot.reading.used.append(Remark(item.line, f"loop {name} closed by a {_LOOPS[kind]} joint"))
    return Loop(name, _LOOPS[kind], first, second, item, axis)


def _coupling(robot: Robot, item: Element) -> Tie:
    """`<coupling>`: the branch of the successor rotates `ratio` times as fast as that of the predecessor, both relative
    to the link where the branches separate."""
    name, ratio = item.must("name"), item.the("ratio").number("value")
    into = {joint.child: joint for joint in robot.joints.values()}

    def joints_along(tag: str) -> list[str]:
        link, found = item.the(tag).must("link"), list[str]()
        if link not in robot.links:
            item.fail(f'names the link "{link}", which does not exist')
        while link in into and len(found) <= len(into):
            found.append(into[link].name)
            link = into[link].parent
        return found

    before, after = joints_along("predecessor"), joints_along("successor")
    shared = set(before) & set(after)
    terms = [(joint, 1.0) for joint in after if joint not in shared]
    terms += [(joint, -ratio) for joint in before if joint not in shared]
    moving = [(joint, factor) for joint, factor in terms if robot.joints[joint].kind != "fixed"]
    if len(moving) < 2 or ratio == 0.0 or any(robot.joints[j].kind not in ("revolute", "prismatic") for j, _ in moving):
        item.fail("must couple joints of one coordinate each, at least one on each side, by a nonzero ratio")
    robot.reading.used.append(Remark(item.line, f"coupling {name} of {', '.join(joint for joint, _ in moving)}"))
    return Tie(name, [joint for joint, _ in moving], [factor for _, factor in moving], 0.0, item)
