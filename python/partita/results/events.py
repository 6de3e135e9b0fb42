"""Events of a run: what happened, when, and the state there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ..naming import driven, index_of
from ..notebook import MOST_ROWS, names, table
from ..numeric import MaybeNone
from ..state import Layout, State

FloatArray = NDArray[np.float64]
CROSSING = "crossing"


@dataclass(frozen=True, eq=False)
class Impulse:
    """An impulse at an event: of a joint on its child, or along what a lock, a stop or another drive holds."""

    effort: float | MaybeNone = None
    """Along what is held [N s] or [N m s], positive where it drives it up; None for a joint."""
    force: FloatArray | MaybeNone = None
    """(3,): of a joint, in world axes [N s]; None for others."""
    moment: FloatArray | MaybeNone = None
    """(3,): about the joint's point [N m s], what is held along its coordinates included."""
    determined: NDArray[np.bool_] | MaybeNone = None
    """(6,): whether each component of force and moment is determined by the mechanism."""


@dataclass(frozen=True, eq=False)
class EventRecord:
    """An event that happened."""

    t: float
    """When [s]."""
    name: str
    kind: str
    """"crossing": what is followed passes a value."""
    direction: int
    """1 where it rises through the value, -1 where it falls."""
    before: State
    """The state there, which a run can start from (`initial=`)."""
    after: State
    """The state from which the motion goes on: the same where nothing acts on it."""
    impulses: Mapping[str, Impulse] = field(default_factory=dict)
    """Where velocities jump: the impulses of all joints by name, and those of what holds: "lock of A", "stop wall",
    elements by their names."""
    energy_lost: float = 0.0
    """Loss of kinetic energy [J]."""

    @property
    def sense(self) -> str:
        """The direction as a word."""
        return "rising" if self.direction > 0 else "falling"

    def __repr__(self) -> str:
        return f"<event {self.name!r} at t = {self.t:.9g} s: {self.kind}, {self.sense}>"


class Events(Sequence[EventRecord]):
    """The events of a run in the order of time, those of one instant in the order in which they were given.

    `events[0]` is a record, `events["top"]` the list of those of that name.
    """

    def __init__(self, names: Sequence[str], records: Sequence[EventRecord]) -> None:
        self.names = tuple(names)
        """Names of all events that were looked for, also of those that did not happen."""
        self._records = tuple(records)

    @property
    def t(self) -> Any:
        """(n,): times [s]."""
        return np.array([record.t for record in self._records])

    def __len__(self) -> int:
        return len(self._records)

    @overload
    def __getitem__(self, key: int) -> EventRecord: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[EventRecord]: ...
    @overload
    def __getitem__(self, key: str) -> Events: ...

    def __getitem__(self, key: int | slice | str) -> EventRecord | Sequence[EventRecord]:
        """A record by its number, or those of a name; `UnknownNameError` with the nearest name."""
        if isinstance(key, str):
            name = self.names[index_of(key, list(self.names), "event")]
            return Events((name,), [record for record in self._records if record.name == name])
        return self._records[key]

    def __iter__(self) -> Iterator[EventRecord]:
        return iter(self._records)

    def __repr__(self) -> str:
        if not self.names:
            return "<no events were looked for>"
        if not self._records:
            return f"<none of the events happened: {', '.join(dict.fromkeys(self.names))}>"
        lines = [repr(record) for record in self._records[:MOST_ROWS]]
        return "\n".join([*lines, *([f"<and {self._left_out} later ones>"] if self._left_out else [])])

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [(f"t = {record.t:.9g} s", f"{record.name}, {record.sense}") for record in self._records[:MOST_ROWS]]
        if self._left_out:
            rows.append(("later", f"{self._left_out} more"))
        occurred = {record.name for record in self._records}
        never = [name for name in self.names if name not in occurred]
        if never:
            rows.append(("did not happen", names(never)))
        return table(f"{len(self)} event{'s' * (len(self) != 1)}", rows)

    @property
    def _left_out(self) -> int:
        """Number of records that a table does not show."""
        return max(0, len(self._records) - MOST_ROWS)


def written(
    names: Sequence[str],
    occurred: Sequence[tuple[int, bool, float, list[float], list[float]]],
    happened: Sequence[tuple[Any, ...]] | None,
    summary: Mapping[str, Any],
) -> dict[str, Any]:
    """Events as plain data, for files: those that only observe, or those of a run in which events act."""
    if happened is None:
        found = [
            {"name": names[event], "kind": CROSSING, "direction": 1 if rises else -1, "t": t, "q": q, "v": v}
            for event, rises, t, q, v in occurred
        ]
        return {"names": list(names), "records": found}
    drives = driven(summary)
    records = []
    joints = [joint["name"] for joint in summary.get("joints", ())]
    for event, kind, rises, t, q, before, after, (impulses, of_joints, lost) in happened:
        item = {"name": names[event], "kind": kind, "direction": 1 if rises else -1, "t": t, "q": q, "v": before}
        if after != before:
            item["after"] = after
        if impulses:
            along = {name: impulses[rows[0]] for name, rows in drives.items() if len(rows) == 1}
            for element, by in summary.get("holding", {}).items():
                # both ends of a stop are one element
                along[element] = sum(along.pop(name) if name.startswith(f"{element}, ") else along[name] for name in by)
            item["impulses"] = {name: x for name, x in along.items() if x != 0.0}
            item["joints"] = {name: [list(w), list(known)] for name, (w, known) in zip(joints, of_joints, strict=True)}
            item["energy_lost"] = lost
        records.append(item)
    return {"names": list(names), "records": records}


def events_of(data: Mapping[str, Any], layout: Layout) -> Events:
    """The inverse of `written`."""
    records = []
    for item in data.get("records", ()):
        q, v = np.array(item["q"], dtype=float), np.array(item["v"], dtype=float)
        before = after = State.computed(float(item["t"]), q, v, layout)
        if "after" in item:
            after = State.computed(before.t, q.copy(), np.array(item["after"], dtype=float), layout)
        name, kind, direction = str(item["name"]), str(item["kind"]), int(item["direction"])
        lost = float(item.get("energy_lost", 0.0))
        impulses = {str(name): Impulse(effort=float(x)) for name, x in item.get("impulses", {}).items()}
        for joint, (wrench, known) in item.get("joints", {}).items():
            force, moment = np.array(wrench[:3], dtype=float), np.array(wrench[3:], dtype=float)
            impulses[str(joint)] = Impulse(None, force, moment, np.array(known, dtype=bool))
        records.append(EventRecord(before.t, name, kind, direction, before, after, impulses, lost))
    return Events([str(name) for name in data.get("names", ())], records)
