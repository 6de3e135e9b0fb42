"""A YAML file beside a URDF that lists which frames close its loops.

closed_loop: [[frame_A, frame_B], ...]     names of links, frames or joints
type: ["6d", "3d", ...]                    the two links are welded there, or held point on point
name: [knee closes, ...]                   what the loops are called; else "frame_A = frame_B"
name_mot: [knee, ...]                      joints that are driven; told, not used
gravity: [0.0, 0.0, -9.81]                 in the axes of the root, where it is another one
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, NoReturn

from ..errors import FileFormatError, MissingDependencyError
from ..files import get, other
from .reading import Remark
from .robot import Loop, Robot
from .xmltree import refuse

SIZE = 2**20
"""Bytes of a sidecar."""
DEPTH = 32
"""Lists within each other: pairs of frames are three deep."""
_KINDS = {"6d": "fixed", "3d": "spherical"}


def read(robot: Robot) -> bool:
    """Close the loops that the sidecar lists; False where there is none."""
    path = next((p for p in (robot.reading.path.with_suffix(end) for end in (".yaml", ".yml")) if p.is_file()), None)
    if path is None:
        return False
    said, lines = _loaded(path)

    def wrong(key: str, message: str) -> NoReturn:
        refuse(path, lines.get(key), message)

    pairs, kinds = said.get("closed_loop", []), said.get("type")
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        wrong("closed_loop", f"closed_loop must be a list of pairs of frames, not {pairs!r:.80}")
    kinds = ["6d"] * len(pairs) if kinds is None else kinds
    if not isinstance(kinds, list) or len(kinds) != len(pairs):
        wrong("type", f"type must be a list of {len(pairs)} words, one for each closed loop, not {kinds!r:.80}")
    names = said.get("name")
    names = [f"{pair[0]} = {pair[1]}" for pair in pairs] if names is None else names
    if not isinstance(names, list) or len(names) != len(pairs):
        wrong("name", f"name must be a list of {len(pairs)} names, one for each closed loop, not {names!r:.80}")
    twice = [name for name, count in Counter(map(str, names)).items() if count > 1]
    if twice:
        wrong("name", f'name: "{twice[0]}" is there twice; loops have names of their own')
    gravity = _gravity(said.get("gravity", robot.gravity))
    if gravity is None:
        wrong("gravity", f"gravity must be three finite numbers, not {said['gravity']!r:.80}")
    robot.gravity = gravity
    for number, (pair, kind) in enumerate(zip(pairs, kinds, strict=True), 1):
        if str(kind).lower() not in _KINDS:
            wrong("type", f'type {number} is "{kind}"; known: 6d (welded there), 3d (point on point)')
        close(
            robot,
            f"loop {number}",
            (str(pair[0]), str(pair[1])),
            str(kind).lower(),
            (path, lines.get("closed_loop")),
            str(names[number - 1]),
        )
    motors = said.get("name_mot")
    if motors:
        words = motors if isinstance(motors, list) else [motors]
        robot.reading.dropped.append(Remark(None, f"motors {', '.join(map(str, words))} of {path.name}: add_drive"))
    for key in sorted(set(said) - {"closed_loop", "type", "name", "name_mot", "gravity"}, key=str):
        robot.reading.dropped.append(Remark(None, f'"{key}" of {path.name} is not known'))
    return True


def _gravity(value: Any) -> tuple[float, ...] | None:
    """Three finite numbers, or None."""
    fine = isinstance(value, list | tuple) and len(value) == 3
    try:
        found = tuple(float(x) for x in value) if fine else ()
    except (TypeError, ValueError):
        found = ()
    return found if len(found) == 3 and all(abs(x) < float("inf") for x in found) else None


def _loaded(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """What the file says by its keys, and the line of each."""
    try:
        import yaml
    except ImportError as error:
        raise MissingDependencyError(
            f'"{path}" lists the closed loops, and reading it needs PyYAML: pip install partita[robots]', package="yaml"
        ) from error
    content = get(path)
    if len(content) > SIZE:
        refuse(path, None, f"{len(content)} bytes of YAML; more than {SIZE} are not read")
    if (kind := other(content)) is not None:
        refuse(path, None, kind)
    lines: dict[str, int] = {}
    try:
        depth = 0
        for event in yaml.parse(content, Loader=yaml.SafeLoader):
            line = event.start_mark.line + 1
            if isinstance(event, yaml.AliasEvent):
                refuse(path, line, "an alias (*name) is not read: it may stand for very much")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > DEPTH:
                refuse(path, line, f"lists nest more than {DEPTH} deep")
        root = yaml.compose(content, Loader=yaml.SafeLoader)
        for key, _ in root.value if isinstance(root, yaml.MappingNode) else ():
            line = key.start_mark.line + 1
            if lines.setdefault(key.value, line) != line:
                refuse(path, line, f'"{key.value}" is there twice; the first one stands in line {lines[key.value]}')
        said = yaml.safe_load(content)
    except (yaml.YAMLError, ValueError) as error:
        if isinstance(error, FileFormatError):
            raise
        mark = getattr(error, "problem_mark", None)
        words = " ".join(str(getattr(error, "problem", None) or error).split())
        refuse(path, None if mark is None else mark.line + 1, f"it is not YAML: {words}")
    if not isinstance(said, dict):
        refuse(path, None, "it holds no keys such as closed_loop")
    return said, lines


def close(
    robot: Robot,
    name: str,
    pair: tuple[str, str],
    kind: str,
    place: tuple[Path, int | None] | None,
    called: str | None = None,
) -> None:
    """Two frames become one."""
    frames = []
    for frame in pair:
        found = robot.frame(frame)
        if found is None:
            path, line = place or (robot.reading.path, None)
            refuse(path, line, f'"{frame}" closes a loop but is no link, frame or joint of the URDF')
        frames.append(found)
    robot.loops.append(Loop(called or f"{pair[0]} = {pair[1]}", _KINDS[kind], frames[0], frames[1], None))
    words = "welded" if kind == "6d" else "held point on point"
    robot.reading.used.append(Remark(None, f"{name}: {pair[0]} and {pair[1]} {words}"))
