"""A robot drawn as a mechanism: bodies, joints, loops, springs and shapes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..builder import Builder
from ..builder.records import GROUND
from ..errors import DescriptionError
from ..products import matmul
from . import repair
from .closings import report_open
from .folding import fold_ends, fold_hinges, fold_marks, fold_sleeves
from .looks import shapes_of
from .reading import Remark
from .robot import HEAVY, Array, Effort, Link, Robot, nearest, placed
from .xmltree import Element

_FREE = 'base="free" in partita.load'
_FLOATS = f"{_FREE} lets it float"
_STATIC = {
    "SDFormat": "all models of the file are static, so their links are the ground: <static>false</static> frees one",
    "USD": "no prim of the file is an enabled rigid body that is not kinematic: PhysicsRigidBodyAPI makes one of it",
}
"""Why a file that gives the poses of its links may have no body."""


def build(robot: Robot, mechanism: Builder) -> None:
    """Draw the robot with all its coordinates zero; the root is fixed, or floats, unless the file gives all poses."""
    base = robot.request.base
    repair.links(robot)
    _rename_ground(robot)
    _report_weightless(robot)
    if robot.poses is not None:
        _placed(robot, mechanism, robot.poses)
        robot.reading.shapes = shapes_of(robot, robot.world)
        return
    root = robot.root()
    fold_marks(robot)
    if not robot.gimbals:
        fold_hinges(robot)
        fold_sleeves(robot)
        fold_ends(robot)
    _report_massless(robot)
    order = robot.outwards(root)
    into = {joint.child: joint for joint in robot.joints.values()}
    pose = {root: np.eye(4)}
    for name in order[1:]:
        pose[name] = matmul(pose[into[name].parent], into[name].pose)
    report_open(robot, pose)
    grounded = robot.links[root].mass <= robot.massless and base == "fixed"
    body: dict[str, Any] = {root: mechanism.ground} if grounded else {}
    for name in order[int(grounded) :]:
        body[name] = _body(robot, mechanism, robot.links[name], pose[name])
    if robot.reading.kind == "MJCF":
        robot.reading.stands = "no <body> of the file has a <joint> or a <freejoint>, so all of it is the ground"
    elif grounded and len(order) == 1:
        robot.reading.stands = f'its root, "{root}", has no mass and is the ground; give a link mass'
    elif base == "fixed":
        robot.reading.stands = f'let the root of the file, "{root}", float: {_FREE}'
    if grounded:
        robot.reading.changed.append(Remark(robot.links[root].at.line, f'link "{root}" is the ground; {_FLOATS}'))
    elif base == "fixed":
        mechanism.add_fixed(f"{root} stands", mechanism.ground, body[root])
        robot.reading.changed.append(
            Remark(robot.links[root].at.line, f'the root "{root}" is fixed to the ground; {_FLOATS}')
        )
    for joint in (into[name] for name in order[1:]):
        where = matmul(pose[joint.child], placed(joint.point, np.eye(3)))
        ends = (body[joint.parent], body[joint.child])
        axes = (joint.axis, joint.second)
        _joint(mechanism, joint.name, joint.kind, ends, (where, where), axes, joint.at)
        _efforts(mechanism, joint.name, joint.efforts, joint.at)
    _loops(robot, mechanism, body, pose)
    robot.reading.shapes = shapes_of(robot, root if grounded else None)


def _loops(robot: Robot, mechanism: Builder, body: dict[str, Any], pose: dict[str, Array]) -> None:
    """Joints between frames of bodies, couplers, and springs between points."""
    for loop in robot.loops:
        (link1, frame1), (link2, frame2) = loop.first, loop.second
        if body[link1] == body[link2]:
            message = f'{loop.name} joins two frames of one link, "{link1}"; it closes nothing'
            robot.reading.dropped.append(Remark(loop.at.line if loop.at else None, message, "", "other"))
            continue
        frames = (matmul(pose[link1], frame1), matmul(pose[link2], frame2))
        if loop.kind == "distance":
            points = (frame1[:3, 3], frame2[:3, 3])
            with _refused(loop.at, "cannot be a distance"):
                mechanism.add_distance(loop.name, body[link1], points[0], body[link2], points[1], loop.length)
            continue
        axis = np.array([1.0, 0.0, 0.0]) if loop.axis is None else loop.axis
        ends = (body[link1], body[link2])
        _joint(mechanism, loop.name, loop.kind, ends, frames, (axis, loop.second_axis), loop.at, free=loop.free)
        _efforts(mechanism, loop.name, loop.efforts, loop.at)
    for tie in robot.ties:
        with _refused(tie.at, "cannot couple joints"):
            mechanism.add_coupler(tie.name, tie.joints, tie.factors, tie.offset)
    for spring in robot.springs:
        sides = [_on_body(robot, *side) for side in (spring.first, spring.second)]
        (link1, point1), (link2, point2) = sides
        data: dict[str, Any] = {"stiffness": spring.stiffness, "damping": spring.damping, "length": spring.length}
        mechanism.add_spring(spring.name, body[link1], point1, body[link2], point2, **data)


def _rename_ground(robot: Robot) -> None:
    """A link may have the name that is reserved for the ground."""
    if GROUND not in robot.links:
        return
    new = f"{GROUND} link"
    while new in robot.links:
        new += " 2"
    robot.reading.changed.append(Remark(robot.line(robot.links[GROUND].at), f'link "{GROUND}" is called "{new}" here'))
    robot.rename(GROUND, new)


def _report_massless(robot: Robot) -> None:
    """Joints beyond which nothing has mass have no motion of their own. Those that follow others move with them; a
    loop moves what it closes."""
    heavy = {name for name, link in robot.links.items() if link.mass > 0.0 or np.any(link.inertia)}
    heavy |= {link for loop in robot.loops for link, _ in (loop.first, loop.second)} | robot.sprung()
    into = {joint.child: joint for joint in robot.joints.values()}
    moving: set[str] = set()
    for name in heavy:
        while name in into and into[name].name not in moving:
            moving.add(into[name].name)
            name = into[name].parent
    for tie in [*robot.ties] * len(robot.ties):
        moving.update(tie.joints if moving.intersection(tie.joints) else ())
    still = [joint.name for joint in robot.joints.values() if joint.kind != "fixed" and joint.name not in moving]
    if still:
        remark = (
            "nothing that it moves has mass or inertia, so its motion is indeterminate: give a link mass, or fix it"
        )
        robot.reading.changed += [Remark(robot.joints[name].at.line, remark, f'joint "{name}"') for name in still]


def _report_weightless(robot: Robot) -> None:
    """Links with inertia and without mass, which no body is."""
    remark = (
        "it has inertia and no mass, which no body has: it weighs nothing, and where nothing with mass moves along, "
        "its motion is indeterminate: give it mass"
    )
    for name, link in robot.links.items():
        if link.mass == 0.0 and np.any(link.inertia):
            robot.reading.dropped.append(Remark(robot.line(link.at), remark, f'link "{name}"', "motion"))


def _on_body(robot: Robot, link: str, point: Array) -> tuple[str, Array]:
    """A point of a link that may have become a frame."""
    if link in robot.links:
        return link, point
    carrier, pose = robot.frames[link]
    return carrier, matmul(pose[:3, :3], point) + pose[:3, 3]


def _placed(robot: Robot, mechanism: Builder, poses: dict[str, Array]) -> None:
    """A model that gives the poses of its links; its joints may close loops."""
    body: dict[str, Any] = {robot.world: mechanism.ground}
    robot.reading.stands = "" if robot.links else _STATIC.get(robot.reading.kind, "")
    for name, link in robot.links.items():
        body[name] = _body(robot, mechanism, link, poses[name])
    for joint in robot.joints.values():
        ends, frames = (body[joint.parent], body[joint.child]), (joint.pose, joint.pose)
        axes, more = (joint.axis, joint.second), (joint.pitch, joint.free)
        _joint(mechanism, joint.name, joint.kind, ends, frames, axes, joint.at, *more)
        _efforts(mechanism, joint.name, joint.efforts, joint.at)
    _loops(robot, mechanism, body, {robot.world: np.eye(4), **poses})


@contextmanager
def _refused(at: Element | None, words: str) -> Iterator[None]:
    """What a mechanism refuses is an error of the element in the file that asks for it."""
    try:
        yield
    except DescriptionError as error:
        if at is None:
            raise
        at.fail(f"{words}: {error.message}")


def _efforts(mechanism: Builder, joint: str, efforts: list[Effort], at: Element | None) -> None:
    """Springs, dampers and rotors of a joint."""
    for effort in efforts:
        with _refused(at, "cannot act so"):
            _effort(mechanism, joint, effort)


def _effort(mechanism: Builder, joint: str, effort: Effort) -> None:
    """A spring with a damper, a rotor, a constant effort."""
    if effort.stiffness != 0.0 or effort.damping != 0.0:
        name = effort.name or f"spring of {joint}"
        while name in mechanism._description.forces:
            name = f"{name} of {joint}"
        law = {"stiffness": effort.stiffness, "damping": effort.damping, "angle": effort.rest}
        mechanism.add_torsion_spring(joint, **law, coordinate=effort.coordinate, name=name)
    if effort.rotor != 0.0:
        mechanism.add_rotor(joint, effort.rotor, ratio=effort.ratio, coordinate=effort.coordinate)
    if effort.constant != 0.0:
        mechanism.add_torque(joint, effort.constant, coordinate=effort.coordinate)


def _body(robot: Robot, mechanism: Builder, link: Link, pose: Array) -> Any:
    if link.mass > HEAVY:
        remark = f'link "{link.name}" of {link.mass:.3g} kg looks like a dummy; it is kept as it is'
        robot.reading.changed.append(Remark(robot.line(link.at), remark))
    with _refused(link.at, "cannot be a body"):
        return mechanism.add_body(
            link.name,
            mass=link.mass,
            inertia=link.inertia,
            com=link.com,
            position=pose[:3, 3],
            orientation=nearest(pose[:3, :3]),
            **({} if link.gravity else {"gravity": False}),
        )


def _joint(
    mechanism: Builder,
    name: str,
    kind: str,
    ends: tuple[Any, Any],
    frames: tuple[Array, Array],
    axes: tuple[Array, Array | None],
    at: Element | None,
    pitch: float = 0.0,
    free: tuple[str, ...] = (),
) -> None:
    """A joint between two frames of the world, which may differ slightly."""
    here, there = frames
    point = here[:3, 3]
    apart: dict[str, Any] = {}
    if not np.array_equal(here, there):
        apart = {"child_point": there[:3, 3]}
    axis = matmul(here[:3, :3], axes[0])
    if (apart and kind in ("revolute", "prismatic", "cylindrical")) or (apart and kind == "planar"):
        apart["child_axis"] = matmul(there[:3, :3], axes[0])
    elif apart and kind in ("fixed", "universal"):
        apart["child_frame"] = nearest(matmul(there[:3, :3], here[:3, :3].T))
    add: Any = mechanism
    with _refused(at, "cannot be a joint"):
        if kind in ("revolute", "prismatic", "cylindrical"):
            getattr(add, f"add_{kind}")(name, *ends, point=point, axis=axis, **apart)
        elif kind == "screw":
            add.add_screw(name, *ends, point=point, axis=axis, pitch=pitch)
        elif kind == "planar":
            add.add_planar(name, *ends, point=point, normal=axis, **apart)
        elif kind == "universal":
            second = matmul(here[:3, :3], axes[0] if axes[1] is None else axes[1])
            add.add_universal(name, *ends, point=point, axis1=axis, axis2=second, **apart)
        elif kind == "generic":
            if apart:
                apart["child_frame"] = nearest(there[:3, :3])
            add.add_joint(name, *ends, free=free, point=point, frame=nearest(here[:3, :3]), **apart)
        elif kind == "free":
            add.add_free(name, *ends, point=point)
        else:
            getattr(add, f"add_{kind}")(name, *ends, point=point, **apart)
