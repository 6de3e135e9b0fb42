"""Loop closures of robots' files: pairs of frames that a sidecar lists, or else pairs that are named as such.

closing_NAME_1, closing_NAME_2    also _A and _B, `closedloop`, and with words before
..._3D, ..._6D, closedloop3D...   the frames are joined at their points, or welded
closing_NAME_1_z, closing_NAME_2_z    points on the z axes of the two frames: they are hinged about it

Names that do not say so: `closing` joins points, `closedloop` welds, as the programs of these names do (decision 0054).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NoReturn

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from . import sidecar
from .reading import Remark
from .robot import Array, Robot

_WORD = r"(?:.*[^a-z])?clos(?:ing|ed?_?loop)s?"
_NAME = re.compile(rf"(?P<stem>{_WORD}.*?)[_-]?(?P<side>[12AB])(?:[_-]?(?P<end>[36]D))?", re.IGNORECASE)
_KIND = re.compile(rf"{_WORD}[_-]?([36]D)", re.IGNORECASE)
_SIDE = re.compile(r"(?P<stem>.+?)(?P<side>[12AB])(?:[_-]?[36]D)?", re.IGNORECASE)
_WELDING = re.compile(r"(?:.*[^a-z])?closed?_?loop", re.IGNORECASE)
"""Names without a type that weld."""
_UNTYPED = "the names of the frames do not say how the loop is closed"
_REMEDIES = {
    "URDF": "type in a YAML file beside, or named by loops=,",
    "SDFormat": "type in a YAML file named by loops=, or a <joint> between the frames,",
}
"""What states the type of a loop, other than names."""
_IN_SIDECAR = "closed_loop in a YAML file beside the URDF closes them"
AXIS = "_z"
"""Ending of the name of a second point on the axis of a hinge."""
_TOGETHER = 1e-5
"""Frames nearer to each other were drawn in one place. Scale: fraction of the size of the robot. Reason: coordinates
in files have five digits."""


def is_closing(name: str) -> bool:
    """Whether a frame of this name closes a loop."""
    return _NAME.fullmatch(name) is not None


def close(robot: Robot) -> None:
    """Close the loops that the sidecar or the names of frames state."""
    if not sidecar.read(robot):
        close_named(robot)


def close_named(robot: Robot) -> None:
    """Close the loops that the names of frames state."""
    stated = named(robot, robot.frames)
    for stem, names in stated.items():
        if len(names) != 2:
            message = f"is one of {len(names)} frames of the closing {stem}; it has two, _1 and _2 or _A and _B"
            _fail(robot, names[0], message)
        kinds = {kind for name in names if (kind := _kind(name))}
        if len(kinds) > 1:
            _fail(robot, names[0], f"and {names[1]} are of different kinds, {' and '.join(sorted(kinds))}")
        kind = next(iter(kinds), "hinge" if _hinged(robot, names) else "")
        if not kind:
            kind = "6d" if _WELDING.match(names[0]) else "3d"
            ending = "_6D (welded) or _3D (points joined) at the end of both names"
            remark = f"{sidecar.WORDS[kind]}, since {_UNTYPED}; {ending}, or {_REMEDIES[robot.reading.kind]} states it"
            robot.reading.changed.append(Remark(None, remark, " and ".join(names)))
        sidecar.close(robot, stem, (names[0], names[1]), kind, None)


def report_open(robot: Robot, poses: Mapping[str, Array]) -> None:
    """Report pairs of frames that look like loops and are not closed: of the names above, or with names that differ
    in the side alone and drawn in one place."""

    def place(name: str) -> tuple[str, bytes]:
        link, pose = robot.frames[name]
        return link, pose.tobytes()

    taken = {place(name) for name in robot.closed if name in robot.frames}
    sides: dict[str, list[str]] = {}
    for name in robot.frames:
        found = _SIDE.fullmatch(name)
        if place(name) not in taken and found is not None:
            taken.add(place(name))  # a joint's name stands for the same frame
            sides.setdefault(name[: found.start("side")] + name[found.end("side") :], []).append(name)
    size = float(norm(np.ptp([pose[:3, 3] for pose in poses.values()], axis=0)))
    pairs = []
    for names in (sorted(names) for names in sides.values() if len(names) == 2):
        links, frames = zip(*(robot.frames[name] for name in names), strict=True)
        if links[0] == links[1] or any(link not in poses for link in links):
            continue
        one, other = ((matmul(poses[link], frame))[:3, 3] for link, frame in zip(links, frames, strict=True))
        if all(map(is_closing, names)) or float(norm(one - other)) <= _TOGETHER * size:
            pairs.append(" and ".join(names))
    if pairs:
        remedy = {"MJCF": "an <equality> closes them"}.get(robot.reading.kind, _IN_SIDECAR)
        remark = f"{', '.join(pairs)} look like ends of loops, which are open; {remedy}"
        robot.reading.dropped.append(Remark(None, remark))


def named(robot: Robot, frames: Iterable[str]) -> dict[str, list[str]]:
    """Ends of loops among links and frames, by the stem of their names. A link that carries others, or that moves and
    has mass, is none."""
    massless, parents = robot.massless, {joint.parent for joint in robot.joints.values()}
    fixed = {joint.child for joint in robot.joints.values() if joint.kind == "fixed"}
    ends = {name for name, link in robot.links.items() if name in fixed or link.mass <= massless} - parents
    sides: dict[str, list[str]] = {}
    for name in [*(link for link in robot.links if link in ends), *frames]:
        found = _NAME.fullmatch(name)
        if found is not None:
            sides.setdefault(found["stem"].rstrip("_- "), []).append(name)
    return sides


def _kind(name: str) -> str:
    found, within = _NAME.fullmatch(name), _KIND.match(name)
    end = found["end"] if found is not None else None
    return (end or (within[1] if within is not None else "")).lower()


def _hinged(robot: Robot, names: Iterable[str]) -> bool:
    """Whether each frame has a second point on its z axis."""
    for name in names:
        frame, beyond = robot.frame(name), robot.frame(name + AXIS)
        if frame is None or beyond is None:
            return False
        point = _seen(robot, beyond, frame)
        if point is None or point[2] == 0.0 or float(norm(point[:2])) > EQUAL_IN_SIX_DIGITS * abs(point[2]):
            return False
    return True


def _seen(robot: Robot, point: tuple[str, Array], frame: tuple[str, Array]) -> Array | None:
    """The origin of a frame in another one, both at ends of fixed joints of one link; else None."""
    (one, here), (other, there) = _carrier(robot, point), _carrier(robot, frame)
    return matmul(there[:3, :3].T, here[:3, 3] - there[:3, 3]) if one == other else None


def _carrier(robot: Robot, frame: tuple[str, Array]) -> tuple[str, Array]:
    """A frame at the end of a fixed joint, as one of the link that carries it."""
    link, pose = frame
    fixed = next((j for j in robot.joints.values() if j.child == link and j.kind == "fixed"), None)
    return frame if fixed is None else (fixed.parent, matmul(fixed.pose, pose))


def _fail(robot: Robot, name: str, message: str) -> NoReturn:
    link = robot.links.get(name) or next(iter(robot.links.values()))
    link.at.fail(f"{'' if name in robot.links else f'and the frame {name} '}{message}")
