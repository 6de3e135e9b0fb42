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
from typing import Any

from ..errors import MissingDependencyError
from ..files import get
from .reading import Remark
from .robot import Loop, Robot
from .xmltree import refuse

SIZE = 2**20
"""Bytes of a sidecar."""
_KINDS = {"6d": "fixed", "3d": "spherical"}


def read(robot: Robot) -> bool:
    """Close the loops that the sidecar lists; False where there is none."""
    path = next((p for p in (robot.reading.path.with_suffix(end) for end in (".yaml", ".yml")) if p.is_file()), None)
    if path is None:
        return False
    said = _loaded(path)
    pairs, kinds = said.get("closed_loop", []), said.get("type")
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        refuse(path, None, f"closed_loop must be a list of pairs of frames, not {pairs!r:.80}")
    kinds = ["6d"] * len(pairs) if kinds is None else kinds
    if not isinstance(kinds, list) or len(kinds) != len(pairs):
        refuse(path, None, f"type must be a list of {len(pairs)} words, one for each closed loop, not {kinds!r:.80}")
    names = said.get("name")
    names = [f"{pair[0]} = {pair[1]}" for pair in pairs] if names is None else names
    if not isinstance(names, list) or len(names) != len(pairs):
        refuse(path, None, f"name must be a list of {len(pairs)} names, one for each closed loop, not {names!r:.80}")
    twice = [name for name, count in Counter(map(str, names)).items() if count > 1]
    if twice:
        refuse(path, None, f'name: "{twice[0]}" is there twice; loops have names of their own')
    robot.gravity = _gravity(path, said.get("gravity", robot.gravity))
    for number, (pair, kind) in enumerate(zip(pairs, kinds, strict=True), 1):
        if str(kind).lower() not in _KINDS:
            refuse(path, None, f'type {number} is "{kind}"; known: 6d (welded there), 3d (point on point)')
        close(robot, f"loop {number}", (str(pair[0]), str(pair[1])), str(kind).lower(), path, str(names[number - 1]))
    motors = said.get("name_mot")
    if motors:
        words = motors if isinstance(motors, list) else [motors]
        robot.reading.dropped.append(Remark(None, f"motors {', '.join(map(str, words))} of {path.name}: add_drive"))
    for key in sorted(set(said) - {"closed_loop", "type", "name", "name_mot", "gravity"}, key=str):
        robot.reading.dropped.append(Remark(None, f'"{key}" of {path.name} is not known'))
    return True


def _gravity(path: Path, value: Any) -> tuple[float, ...]:
    fine = isinstance(value, list | tuple) and len(value) == 3
    try:
        found = tuple(float(x) for x in value) if fine else ()
    except (TypeError, ValueError):
        found = ()
    if len(found) != 3 or not all(abs(x) < float("inf") for x in found):
        refuse(path, None, f"gravity must be three finite numbers, not {value!r:.80}")
    return found


def _loaded(path: Path) -> dict[str, Any]:
    try:
        import yaml
    except ImportError as error:
        raise MissingDependencyError(
            f'"{path}" lists the closed loops, and reading it needs PyYAML: pip install partita[robots]', package="yaml"
        ) from error
    content = get(path)
    if len(content) > SIZE:
        refuse(path, None, f"{len(content)} bytes of YAML; more than {SIZE} are not read")
    try:
        for event in yaml.parse(content, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):
                refuse(path, event.start_mark.line + 1, "an alias (*name) is not read: it may stand for very much")
        said = yaml.safe_load(content)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        refuse(path, None if mark is None else mark.line + 1, f"it is not YAML: {getattr(error, 'problem', error)}")
    if not isinstance(said, dict):
        refuse(path, None, "it holds no keys such as closed_loop")
    return said


def close(
    robot: Robot, name: str, pair: tuple[str, str], kind: str, path: Path | None, called: str | None = None
) -> None:
    """Two frames become one."""
    frames = []
    for frame in pair:
        found = robot.frame(frame)
        if found is None:
            refuse(
                path or robot.reading.path, None, f'"{frame}" closes a loop but is no link, frame or joint of the URDF'
            )
        frames.append(found)
    robot.loops.append(Loop(called or f"{pair[0]} = {pair[1]}", _KINDS[kind], frames[0], frames[1], None))
    words = "welded" if kind == "6d" else "held point on point"
    robot.reading.used.append(Remark(None, f"{name}: {pair[0]} and {pair[1]} {words}"))
