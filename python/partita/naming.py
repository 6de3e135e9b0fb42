"""Names of the items of a run, their units, and lookup by name."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .errors import UnknownAttributeError, UnknownNameError
from .numeric import shown

ANGULAR = ("turn", "turn1", "turn2", "rx", "ry", "rz", "wx", "wy", "wz")
LINEAR = ("slide", "x", "y", "z")
_PART_OF_POSE = re.compile(r", (slide|turn) \d+$")


@dataclass(frozen=True)
class Names:
    """Names along the axes of the arrays of a result, in the order of their columns.

    `coordinates` names the columns of `q` (nq), `velocities` those of `v`, `vdot` and `measure` (nv),
    `multipliers` those of `multipliers` (one per constraint row kept); `joints` and `bodies` what
    `result.joint(name)` and `result.body(name)` accept. A run of a `System` has no joints and no bodies.
    """

    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    multipliers: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()

    @classmethod
    def from_summary(cls, summary: Mapping[str, Any], nq: int, nv: int, rows: int) -> Names:
        """Names from a compiled model; unnamed quantities are called q0.., v0.., c0.. in order."""
        coordinates = _padded(summary.get("coordinates"), "q", nq)
        velocities = summary.get("velocities")
        if velocities is None and nq == nv:
            velocities = coordinates
        return cls(
            coordinates,
            _padded(velocities, "v", nv),
            _padded(summary.get("rows_names"), "c", rows),
            tuple(joint["name"] for joint in summary.get("joints", ())),
            tuple(body["name"] for body in summary.get("bodies", ())),
        )


def _padded(given: Sequence[str] | None, letter: str, count: int) -> tuple[str, ...]:
    """`given` when it names every column, else `letter` with the number of the column."""
    if given is not None and len(given) == count:
        return tuple(given)
    return tuple(f"{letter}{i}" for i in range(count))


def driven(summary: Mapping[str, Any]) -> dict[str, list[int]]:
    """Rows of each drive by its name: of a pose those of its translations and then of its rotations."""
    found: dict[str, list[int]] = {}
    for name, row in zip(summary.get("drives", ()), summary.get("drive_rows", ()), strict=False):
        found.setdefault(_PART_OF_POSE.sub("", name), []).append(int(row))
    return found


def name_of(item: Any) -> Any:
    """Name of an element that a method `add_...` returned; anything else as it is."""
    return str(item) if hasattr(item, "table") else item


def index_of(name: str, known: Sequence[str], kind: str) -> int:
    """Index of `name` among `known`; `UnknownNameError` with the nearest spellings otherwise."""
    if isinstance(name, str) and name in known:
        return list(known).index(name)
    folded = {other.lower(): other for other in reversed(known)}
    near = [folded[n] for n in difflib.get_close_matches(str(name).lower(), folded, n=3, cutoff=0.5)]
    if kind == "joint" and (joint := str(name).rpartition(".")[0]) in known:
        hint = f"it is one coordinate of the joint {joint!r}: ask for the joint and take that column"
    elif near:
        hint = f"did you mean {' or '.join(repr(n) for n in near)}?"
    elif known:
        hint = f"known: {listed(known)}"
    else:
        hint = f"this run has no {kind} at all"
    raise UnknownNameError(f"no {kind} named {shown(name)}; {hint}", name=str(name), known=list(known))


def missing_attribute(
    what: str, owner: type, word: str, elsewhere: Mapping[str, str], otherwise: str
) -> UnknownAttributeError:
    """The error for an attribute that `what`, of the class `owner`, does not have; `elsewhere` says what to use."""
    known = [name for name in dir(owner) if not name.startswith("_")]
    near = difflib.get_close_matches(word, [*known, *elsewhere], n=1, cutoff=0.75)
    if word in elsewhere:
        hint = elsewhere[word]
    elif near:
        hint = elsewhere[near[0]] if near[0] in elsewhere else f"did you mean {near[0]!r}?"
    else:
        hint = otherwise
    return UnknownAttributeError(f"{what} has no {word!r}; {hint}", name=word, known=known)


def listed(words: Sequence[str], limit: int = 12) -> str:
    """`a, b, c` in words; beyond `limit` the rest is counted, not hidden."""
    first = ", ".join(str(w) for w in words[:limit])
    rest = len(words) - limit
    return f"{first} and {rest} more" if rest > 0 else first


def coordinate_units(summary: Mapping[str, Any], names: Names) -> tuple[list[str], list[str]]:
    """Units of the columns of q and of v: "m", "rad", "1" (quaternion) and "m/s", "rad/s"; "" where unknown.

    The axes of a joint in the state are known; otherwise they follow from the ending of the name (`crank.x`, `A.turn`).
    Columns of a user-defined `System` have units only its author knows.
    """
    q_units = [_unit_of(name) for name in names.coordinates]
    v_units = [_unit_of(name) for name in names.velocities]
    for joint in summary.get("joints", ()):
        if joint.get("state_q") and joint.get("state_v"):
            q_axes, v_axes = joint_units(joint)
            q_start, v_start = joint["state_q"][0], joint["state_v"][0]
            q_units[q_start : q_start + len(q_axes)] = q_axes
            v_units[v_start : v_start + len(v_axes)] = v_axes
    return q_units, [f"{u}/s" if u else "" for u in v_units]


def joint_units(joint: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Units of one joint's coordinates (its q columns, its v columns before "/s")."""
    nq, nv = joint["q"][1], joint["v"][1]
    turns = [axis in ANGULAR for axis in joint.get("axes", ())]
    turns = (turns + [True] * nv)[:nv]
    v_units = ["rad" if turn else "m" for turn in turns]
    if nq == nv:
        return list(v_units), v_units
    slides = [u for u in v_units if u == "m"]
    return (slides + ["1"] * nq)[:nq], v_units


def coordinate_axes(joint: Mapping[str, Any]) -> list[str]:
    """Names of one joint's coordinates, in their order: slides, then angles or the quaternion of a spatial rotation."""
    axes, (_, nq), (_, nv) = list(joint.get("axes", ())), joint["q"], joint["v"]
    return axes if nq == nv else [*axes[: nv - 3], "qw", "qx", "qy", "qz"]


def _unit_of(name: str) -> str:
    ending = name.rsplit(".", 1)[-1] if "." in name else ""
    if ending in ANGULAR:
        return "rad"
    if ending in LINEAR:
        return "m"
    return "1" if ending in ("qw", "qx", "qy", "qz", "q0", "q1", "q2", "q3", "w") else ""


def column_names(name: str, words: list[str], count: int) -> list[str]:
    """`A` for a joint with one degree of freedom, `A.x`, `A.turn`, ... for more."""
    if count == 1:
        return [name]
    if len(words) != count or len(set(words)) != count:
        words = [str(i) for i in range(count)]
    return [f"{name}.{word}" for word in words]


def goal_name(key: Any) -> str:
    """The name of a goal in words: of a joint, a body, or an axis of a point (body, (x, y, z), axis)."""
    if not isinstance(key, tuple):
        return str(key)
    return f"{key[0]} {key[2]}" if len(key) == 3 else str(key[0])
