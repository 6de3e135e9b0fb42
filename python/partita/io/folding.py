"""Chains of joints with only massless links between them, as other formats write a ball or a universal joint: folded
into one joint each."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL, LONG_ROUNDING
from .reading import Remark
from .robot import Array, Joint, Link, Robot, placed

_CROSSING = 1e-3
"""Axes of hinges that span less volume do not make a joint of two or three rotations. Scale: least singular value of
the directions. Reason: three digits of its angles are lost."""


def fold_marks(robot: Robot) -> None:
    """Massless links at the end of fixed joints are frames of their parents. One that has inertia is a body."""
    scale = max((float(np.abs(link.inertia).max()) for link in robot.links.values()), default=0.0)
    massless = robot.massless

    def is_mark(link: Link) -> bool:
        return link.mass <= massless and float(np.abs(link.inertia).max()) <= LONG_ROUNDING * scale

    while True:
        parents = {joint.parent for joint in robot.joints.values()}
        marks = [
            joint
            for joint in robot.joints.values()
            if joint.kind == "fixed" and joint.child not in parents and is_mark(robot.links[joint.child])
        ]
        if not marks:
            return
        for joint in marks:
            for name, (link, pose) in list(robot.frames.items()):
                if link == joint.child:
                    robot.frames[name] = (joint.parent, matmul(joint.pose, pose))
            robot.frames[joint.child] = robot.frames[joint.name] = (joint.parent, joint.pose)
            for loop in robot.loops:
                loop.first, loop.second = (
                    (joint.parent, matmul(joint.pose, pose)) if link == joint.child else (link, pose)
                    for link, pose in (loop.first, loop.second)
                )
            mark, parent = robot.links[joint.child], robot.links[joint.parent]
            with_mass = ""
            if parent.mass > massless:
                _add(parent, mark, joint.pose)
                with_mass = ", and its mass is added there" if mark.mass > 0.0 else ""
            elif mark.mass > 0.0:
                with_mass = f", and its mass of {mark.mass:.2g} kg is omitted, since that link has none"
            remark = f"a frame of the link to which it is fixed{with_mass}"
            robot.reading.changed.append(Remark(robot.links[joint.child].at.line, remark, f'link "{joint.child}"'))
            del robot.joints[joint.name], robot.links[joint.child]


def _add(link: Link, more: Link, pose: Array) -> None:
    """Add mass and inertia of a link that is welded to another one, at this pose."""
    mass = link.mass + more.mass
    com = matmul(pose[:3, :3], more.com) + pose[:3, 3]
    middle = (link.mass * link.com + more.mass * com) / mass
    inertia = link.inertia + matmul(matmul(pose[:3, :3], more.inertia), pose[:3, :3].T)
    for part, place in ((link.mass, link.com), (more.mass, com)):
        arm = place - middle
        inertia = inertia + part * (matmul(arm, arm) * np.eye(3) - np.outer(arm, arm))
    link.mass, link.com, link.inertia = mass, middle, inertia


def fold_hinges(robot: Robot) -> None:
    """Two or three hinges through one point with only massless links between them are a universal or a ball joint."""
    massless, tied = robot.massless, {name for tie in robot.ties for name in tie.joints}
    held = {link for loop in robot.loops for link, _ in (loop.first, loop.second)}
    held |= {link for link, _ in robot.frames.values()} | robot.sprung()
    carrying = {joint.child: joint for joint in robot.joints.values()}
    children: dict[str, list[Joint]] = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint)

    def between(name: str) -> bool:
        """Whether this link only connects two hinges through one point."""
        link, after = robot.links[name], children.get(name, [])
        if name in held or name not in carrying or len(after) != 1 or link.mass > massless or np.any(link.inertia):
            return False
        hinges = carrying[name].kind == after[0].kind == "revolute"
        before, behind = carrying[name].point, after[0].pose[:3, 3] + matmul(after[0].pose[:3, :3], after[0].point)
        far = max(float(norm(carrying[name].pose[:3, 3])), float(norm(before)), float(norm(behind)))
        return hinges and float(norm(behind - before)) <= LONG_ROUNDING * far

    for last in list(robot.joints.values()):
        if robot.joints.get(last.name) is not last:
            continue  # folded with a joint that stands before it in the file
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
            pose = matmul(pose, joint.pose)
            axes.append(matmul(pose[:3, :3], joint.axis))
        apart = np.linalg.svd(np.array(axes), compute_uv=False)[-1]
        square = len(chain) == 3 or abs(float(matmul(axes[0], axes[1]))) <= EQUAL
        if apart < _CROSSING or not square:
            continue
        kind = "spherical" if len(chain) == 3 else "universal"
        efforts = [effort for i, joint in enumerate(chain) for effort in joint.along(i)]
        if kind == "spherical" and efforts:
            continue  # a ball has no angles for springs to act along
        first, second = (matmul(pose[:3, :3].T, axis) for axis in axes[:2])
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
        remark = f"hinges with no mass between them are one {kind} joint with the name of the last"
        robot.reading.changed.append(Remark(last.at.line, remark, " - ".join(names)))


def fold_sleeves(robot: Robot) -> None:
    """A slide and a hinge along one line with only massless links between them are a cylindrical joint."""
    children = Counter(joint.parent for joint in robot.joints.values())
    carrying = {joint.child: joint for joint in robot.joints.values()}
    used = {name for tie in robot.ties for name in tie.joints}
    used |= {link for loop in robot.loops for link, _ in (loop.first, loop.second)}
    used |= {link for link, _ in robot.frames.values()} | robot.sprung()
    for turn in list(robot.joints.values()):
        slide = carrying.get(turn.parent)
        if slide is None or (slide.kind, turn.kind) != ("prismatic", "revolute") or used & {slide.name, turn.name}:
            continue
        axis = matmul(turn.pose[:3, :3], turn.axis)
        if turn.parent in used or children[turn.parent] != 1 or not _nothing(robot, turn.parent):
            continue
        if norm(axis - slide.axis) > LONG_ROUNDING:
            continue
        pose = matmul(slide.pose, turn.pose)
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
        remark = "slide and hinge with no mass between them are one cylindrical joint with the name of the hinge"
        robot.reading.changed.append(Remark(turn.at.line, remark, f"{slide.name} - {turn.name}"))


def fold_ends(robot: Robot) -> None:
    """A massless link at the end of a joint, welded to another link, is omitted: the joint closes the loop itself."""
    children = Counter(joint.parent for joint in robot.joints.values())
    carrying = {joint.child: joint for joint in robot.joints.values()}
    ends = Counter(link for loop in robot.loops for link, _ in (loop.first, loop.second))
    tied = {name for tie in robot.ties for name in tie.joints}
    marked = {link for link, _ in robot.frames.values()} | robot.sprung()
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
            back[:3, 3] = matmul(-back[:3, :3], one[1][:3, 3])
            loop.kind, loop.axis, loop.second_axis = joint.kind, joint.axis, joint.second
            loop.efforts = [replace(e, name=e.name or f"spring of {joint.name}") for e in joint.efforts]
            loop.first, loop.second = (
                (joint.parent, matmul(joint.pose, point)),
                (other[0], matmul(matmul(other[1], back), point)),
            )
            remark = "a link of no mass is omitted: its joint closes the loop directly"
            called = f'link "{one[0]}" of loop {loop.name}'
            robot.reading.changed.append(Remark(robot.links[one[0]].at.line, remark, called))
            robot.frames.pop(joint.name, None)
            del robot.joints[joint.name], robot.links[one[0]]
            break
    for loop in robot.loops:
        while loop.name in robot.joints:
            loop.name = f"closing {loop.name}"


def _nothing(robot: Robot, link: str) -> bool:
    """Whether this link has neither mass nor inertia."""
    return robot.links[link].mass == 0.0 and not np.any(robot.links[link].inertia)
