"""A YAML file, beside a URDF or named by the caller, that lists which frames close loops.

closed_loop: [[frame_A, frame_B], ...]     names of links, frames or joints
type: ["6d", "3d", ...]                    the two links are welded there, or joined at a point
name: [knee closes, ...]                   what the loops are called; else "frame_A = frame_B"
name_mot: [knee, ...]                      joints that are driven; reported, not used
joint_name: [ankle, ...]                   joints of the tree that are of another type than in the URDF,
joint_type: [SPHERICAL, ...]               by the axes of their frames: UJOINT_XY turns about x, then about y; FIXED
urdf: robot.urdf                           the file that this one belongs to, where their names differ
gravity: [0.0, 0.0, -9.81]                 in the axes of the root, where it is another one
springs:                                   what URDF has no words for
  - {name: s, joint: knee, stiffness: 3.0, damping: 0.1, angle: 0.2}
  - {name: t, from: [hip, 0.0, 0.0, 0.1], to: [foot, 0.0, 0.0, 0.0], stiffness: 200.0, damping: 1.0, length: 0.3}
weightless: [float, ...]                   links that gravity leaves alone
drawing_tolerance: 1.0e-4                  of the mechanism, where it is another one

Dampers of joints stand in the URDF too, as the sum of what is listed here; where the two do not agree, the URDF is
followed, for other programs read that.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..builder.checks import LARGEST, find
from ..errors import FileFormatError, MissingDependencyError, UnknownNameError
from ..files import get, other
from ..limits import exceeded, limit
from ..tolerance import LONG_ROUNDING
from .reading import Remark
from .robot import Array, Effort, Loop, Robot, Spring
from .xmltree import refuse

_KEYS = {
    "closed_loop",
    "type",
    "name",
    "name_mot",
    "joint_name",
    "joint_type",
    "gravity",
    "springs",
    "weightless",
    "drawing_tolerance",
    "urdf",
}
_KINDS = {"6d": "fixed", "3d": "spherical", "hinge": "revolute"}
_LISTED = ("6d", "3d")
"""Kinds that a sidecar lists."""
WORDS = {"6d": "welded", "3d": "joined at a point", "hinge": "hinged about z"}
_TURNED = {f"UJOINT_{a}{b}": ("universal", "XYZ".index(a), "XYZ".index(b)) for a in "XYZ" for b in "XYZ" if a != b}
"""Universal joints by the axes of the joint's frame about which they turn."""
TYPES: dict[str, tuple[str, int, int]] = {"SPHERICAL": ("spherical", 0, 1), "FIXED": ("fixed", 0, 1), **_TURNED}
"""Types of joints: kind and axes of the joint's frame."""
_BESIDE = 64
"""Files of YAML in one folder in which loops are looked for, at most."""
_ENDINGS = (".yaml", ".yml")


def read(robot: Robot) -> bool:
    """Read the sidecar; False where it lists no loop closures, or does not exist."""
    path = _path(robot)
    if path is None:
        return False
    entries, lines = _loaded(path)

    def wrong(key: str, message: str) -> NoReturn:
        refuse(path, lines.get(key), message)

    _types(robot, path, entries, wrong)
    pairs, kinds = entries.get("closed_loop", []), entries.get("type")
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        wrong("closed_loop", f"closed_loop must be a list of pairs of frames, not {pairs!r:.80}")
    kinds = ["6d"] * len(pairs) if kinds is None else kinds
    if not isinstance(kinds, list) or len(kinds) != len(pairs):
        wrong("type", f"type must be a list of {len(pairs)} words, one for each closed loop, not {kinds!r:.80}")
    names = entries.get("name")
    names = [f"{pair[0]} = {pair[1]}" for pair in pairs] if names is None else names
    if not isinstance(names, list) or len(names) != len(pairs):
        wrong("name", f"name must be a list of {len(pairs)} names, one for each closed loop, not {names!r:.80}")
    twice = [name for name, count in Counter(map(str, names)).items() if count > 1]
    if twice:
        wrong("name", f'name: "{twice[0]}" appears twice; loops have names of their own')
    gravity = _gravity(entries.get("gravity", robot.gravity))
    if gravity is None:
        wrong("gravity", f"gravity must be three finite numbers, not {entries['gravity']!r:.80}")
    robot.gravity = gravity
    for number, (pair, kind) in enumerate(zip(pairs, kinds, strict=True), 1):
        if str(kind).lower() not in _LISTED:
            wrong("type", f'type {number} is "{kind}"; known: 6d (welded there), 3d (point on point)')
        close(
            robot,
            f"loop {number}",
            (str(pair[0]), str(pair[1])),
            str(kind).lower(),
            (path, lines.get("closed_loop")),
            str(names[number - 1]),
        )
    _springs(robot, entries.get("springs", []), wrong)
    weightless = entries.get("weightless", [])
    if not isinstance(weightless, list) or not all(str(name) in robot.links for name in weightless):
        wrong("weightless", f"weightless must be a list of links of the robot, not {weightless!r:.80}")
    for name in weightless:
        robot.links[str(name)].gravity = False
    if "drawing_tolerance" in entries:
        robot.drawing_tolerance = _number(entries["drawing_tolerance"])
        if robot.drawing_tolerance is None:
            wrong("drawing_tolerance", f"drawing_tolerance must be a number, not {entries['drawing_tolerance']!r:.80}")
    motors = entries.get("name_mot")
    if motors:
        words = motors if isinstance(motors, list) else [motors]
        remark = f"a motor in {path.name}: add_drive prescribes a motion, add_torque an effort"
        robot.reading.dropped += [Remark(None, remark, f'joint "{word}"', "bounds") for word in words]
    for key in sorted(set(entries) - _KEYS, key=str):
        robot.reading.dropped.append(Remark(lines.get(key), f"not known in {path.name}", f'"{key}"', "unknown"))
    return "closed_loop" in entries


def _path(robot: Robot) -> Path | None:
    """The sidecar: the one that the caller named; that of the same name; else the only one in the folder that says
    that it belongs to this URDF, or lists frames that all are of it."""
    model = robot.reading.path
    if robot.request.loops is not None:
        return robot.request.loops
    if robot.reading.kind != "URDF":
        return None  # joints of other formats close loops: a file that happens to be there adds none
    root = robot.request.root
    named = [p for p in (model.with_suffix(end) for end in _ENDINGS) if p.is_file()]
    if named:
        if not named[0].resolve().is_relative_to(root):
            refuse(named[0], None, f'it is a link that leads out of "{root}"; loops="..." in partita.load names it')
        return named[0]
    try:
        files = sorted(p for p in model.parent.iterdir() if p.suffix.lower() in _ENDINGS and p.is_file())
    except OSError:  # a folder may be searched but not listed
        files = []
    files = [p for p in files if p.resolve().is_relative_to(root)][:_BESIDE]
    found = [p for p in files if not p.with_suffix(model.suffix).is_file() and _belongs(robot, p)]
    if len(found) > 1:
        names = ", ".join(p.name for p in found)
        remark = f'{names} all list loops of this robot, and none is used: loops="..." in partita.load names one'
        robot.reading.dropped.append(Remark(None, remark))
    return found[0] if len(found) == 1 else None


def _belongs(robot: Robot, path: Path) -> bool:
    """Whether a file of YAML of another name lists loops of this robot."""
    try:
        with path.open("rb") as file:
            if b"closed_loop" not in file.read(limit("sidecar_bytes")):
                return False
        entries, _ = _loaded(path)
    except (OSError, FileFormatError):
        return False
    if "urdf" in entries:
        return str(entries["urdf"]) == robot.reading.path.name
    pairs = entries.get("closed_loop")
    frames = [frame for pair in pairs for frame in (pair if isinstance(pair, list) else [None])] if pairs else []
    return bool(frames) and all(isinstance(frame, str) and robot.frame(frame) is not None for frame in frames)


def _types(robot: Robot, path: Path, entries: dict[str, Any], wrong: Callable[[str, str], NoReturn]) -> None:
    """Joints that are of another type than in the URDF, which knows no ball and no universal joint."""
    names, types = entries.get("joint_name", []), entries.get("joint_type", [])
    for key, words in (("joint_name", names), ("joint_type", types)):
        if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
            wrong(key, f"{key} must be a list of words, not {words!r:.80}")
    if len(names) != len(types):
        key = "joint_type" if types else "joint_name"
        wrong(key, f"joint_name has {len(names)} joints and joint_type {len(types)} types; each joint has one")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        wrong("joint_name", f'joint_name: "{twice[0]}" appears twice')
    for name, word in zip(names, types, strict=True):
        try:
            joint = robot.joints[find("joint", name, robot.joints)]
        except UnknownNameError as error:
            wrong("joint_name", f"joint_name: {error.message}")
        if word.upper() not in TYPES:
            wrong("joint_type", f'the type of joint "{name}" is "{word}"; known: {", ".join(TYPES)}')
        kind, first, second = TYPES[word.upper()]
        if joint.efforts and kind != joint.kind:
            for effort in joint.efforts:
                if effort.damping != 0.0:
                    remark = f"{word} in {path.name}, whose damping is not read: add_torsion_spring"
                    called = f'joint "{name}" damping {effort.damping:g}'
                    robot.reading.dropped.append(Remark(joint.at.line, remark, called))
                if effort.rotor != 0.0:
                    remark = f"{word} in {path.name}, which has no coordinate with which a rotor turns"
                    called = f'joint "{name}" rotor {effort.rotor:g}'
                    robot.reading.dropped.append(Remark(joint.at.line, remark, called))
            joint.efforts = []
        joint.kind, joint.axis = kind, np.eye(3)[first]
        joint.second = np.eye(3)[second] if kind == "universal" else None
        robot.reading.changed.append(Remark(joint.at.line, f"{word}, by {path.name}", f'joint "{name}"'))


def _springs(robot: Robot, items: Any, wrong: Callable[[str, str], NoReturn]) -> None:
    """Springs and dampers at joints and between points."""
    if not isinstance(items, list):
        wrong("springs", f"springs must be a list, not {items!r:.80}")
    listed: dict[str, list[Effort]] = {}
    named: set[str] = set()
    for number, item in enumerate(items, 1):
        if not isinstance(item, dict) or ("joint" in item) == ("from" in item):
            wrong("springs", f'spring {number} names a joint, or the points "from" and "to": {item!r:.80}')
        at_joint = "joint" in item
        words = ("name", "joint") if at_joint else ("name", "from", "to")
        numbers = ("stiffness", "damping", "angle" if at_joint else "length")
        unknown = sorted(map(str, set(item) - {*words, *numbers}))
        if unknown or "name" not in item:
            wrong(
                "springs",
                f"spring {number} has {', '.join(unknown) or 'no name'}; its keys are {', '.join((*words, *numbers))}",
            )
        if str(item["name"]) in named:
            wrong("springs", f'spring "{item["name"]}" appears twice; springs have names of their own')
        named.add(str(item["name"]))
        law = [_number(item.get(key, 0.0)) for key in numbers]
        if None in law:
            wrong("springs", f'spring "{item["name"]}" has a value that is not a finite number: {item!r:.80}')
        stiffness, damping, rest = (x or 0.0 for x in law)
        if at_joint:
            joint = robot.joints.get(str(item["joint"]))
            if joint is None or joint.kind not in ("revolute", "prismatic"):
                wrong(
                    "springs",
                    f'spring "{item["name"]}" acts at "{item["joint"]}", which is neither a hinge nor a slide here',
                )
            listed.setdefault(joint.name, []).append(Effort(stiffness, damping, rest, 0, str(item["name"])))
            continue
        ends = [_end(robot, item.get(key)) for key in ("from", "to")]
        if ends[0] is None or ends[1] is None:
            wrong("springs", f'spring "{item["name"]}" goes from [link, x, y, z] to [link, x, y, z], links of the URDF')
        robot.springs.append(Spring(str(item["name"]), ends[0], ends[1], stiffness, damping, rest))
    for name, efforts in listed.items():
        joint = robot.joints[name]
        own, reported = (sum(e.damping for e in x) for x in (joint.efforts, efforts))
        rotors = [e for e in joint.efforts if e.rotor != 0.0]
        if own != 0.0 and abs(own - reported) > LONG_ROUNDING * max(abs(own), abs(reported)):
            ignored = f"the value {reported:g} in the sidecar file is ignored"
            remark = f"damping {own:g} of joint {name} is taken from the URDF; {ignored}"
            robot.reading.changed.append(Remark(joint.at.line, remark))
            joint.efforts = [replace(e, name=f"damper of {name}") for e in joint.efforts]
            joint.efforts += [replace(e, damping=0.0) for e in efforts if e.stiffness != 0.0]
        else:
            joint.efforts = [*rotors, *efforts]
    if items:
        robot.reading.used.append(Remark(None, f"{len(items)} springs and dampers of the sidecar file"))


def _end(robot: Robot, value: Any) -> tuple[str, Array] | None:
    """A link and a point in its axes."""
    if not isinstance(value, list) or len(value) != 4 or str(value[0]) not in robot.links:
        return None
    point = [_number(x) for x in value[1:]]
    return None if None in point else (str(value[0]), np.array(point, dtype=float))


def _number(value: Any) -> float | None:
    """A finite number, or None; integers have any size."""
    fine = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST
    return float(value) if fine else None


def _gravity(value: Any) -> tuple[float, ...] | None:
    """Three finite numbers, or None."""
    found = [_number(x) for x in value] if isinstance(value, list | tuple) and len(value) == 3 else [None]
    return None if None in found else tuple(float(x) for x in found if x is not None)


def _loaded(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """The content of the file by its keys, and the line of each."""
    try:
        import yaml
    except ImportError as error:
        raise MissingDependencyError(
            f'"{path}" lists the closed loops, and reading it needs PyYAML: pip install partita[robots]', package="yaml"
        ) from error
    content = get(path, "sidecar_bytes")
    if (kind := other(content)) is not None:
        refuse(path, None, kind)
    lines: dict[str, int] = {}
    try:
        depth = 0
        for event in yaml.parse(content, Loader=yaml.SafeLoader):
            line = event.start_mark.line + 1
            if isinstance(event, yaml.AliasEvent):
                refuse(path, line, "aliases (*name) are not read, because they can expand without limit")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if (words := exceeded("list_depth", depth)) is not None:
                refuse(path, line, f"lists nest {words}")
        root = yaml.compose(content, Loader=yaml.SafeLoader)
        for key, _ in root.value if isinstance(root, yaml.MappingNode) else ():
            line = key.start_mark.line + 1
            if lines.setdefault(key.value, line) != line:
                refuse(path, line, f'"{key.value}" appears twice; the first one is in line {lines[key.value]}')
        entries = yaml.safe_load(content)
    except (yaml.YAMLError, ValueError) as error:
        if isinstance(error, FileFormatError):
            raise
        mark = getattr(error, "problem_mark", None)
        words = " ".join(str(getattr(error, "problem", None) or error).split())
        refuse(path, None if mark is None else mark.line + 1, f"it is not YAML: {words}")
    if not isinstance(entries, dict):
        refuse(path, None, "it contains no keys such as closed_loop")
    return entries, lines


def close(
    robot: Robot,
    name: str,
    pair: tuple[str, str],
    kind: str,
    location: tuple[Path, int | None] | None,
    called: str | None = None,
) -> None:
    """Join two frames, named in the sidecar at this location, or by their own names."""
    frames = []
    for frame in pair:
        found = robot.frame(frame)
        if found is None:
            path, line = location or (robot.reading.path, None)
            refuse(
                path,
                line,
                f'"{frame}" closes a loop but is not a link, frame or joint of the {robot.reading.kind} file',
            )
        frames.append(found)
    loop = Loop(called or f"{pair[0]} = {pair[1]}", _KINDS[kind], frames[0], frames[1], None)
    if kind == "hinge":
        loop.axis = np.array([0.0, 0.0, 1.0])
    robot.loops.append(loop)
    robot.closed.update(pair)
    source = "their names" if location is None else location[0].name
    robot.reading.used.append(Remark(None, f"{name}: {pair[0]} and {pair[1]} {WORDS[kind]}, by {source}"))
