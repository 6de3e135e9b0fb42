"""Elements that hold a joint at times, as events of every run: rigid stops, freewheels, latches, friction that sticks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..builder.compiled import CompiledModel
from ..builder.measures import Coordinate
from ..builder.records import Description, LoadRecord
from ..errors import DescriptionError
from ..events import Event
from .models import Modelled

Hold = Callable[[str, dict[str, Any], str, float], str]
"""Adds a drive: its name, what it measures, the level, the value there; returns the name that it got."""


_ADVICE = {
    "friction": "friction that sticks (without a stick_velocity): give it one, which makes it smooth",
    "stop": "a rigid stop (restitution): give it a stiffness in place of it",
    "freewheel": "a freewheel: leave it out, or lock the joint",
    "latch": "a latch: leave it out, or lock the joint",
}


@dataclass(frozen=True)
class OfElement:
    """An event of an element, what it does as plain data, and the drive by which it holds."""

    event: Event
    does: dict[str, Any]
    element: str
    drive: str


def is_set_valued(record: Any) -> bool:
    """Whether a force is one by which a run holds a joint at times."""
    if not isinstance(record, LoadRecord):
        return False
    match record.kind:
        case "friction":
            return record.arguments.get("stick_velocity") in (None, 0.0)
        case "stop":
            return record.arguments.get("restitution") is not None
        case _:
            return record.kind in ("freewheel", "latch")


def without_holding(mechanism: Modelled, analysis: str, state: bool = False) -> None:
    """Refuse a mechanism with elements that hold at times: `analysis` does not follow them. Of one state a latch is open."""
    for record in mechanism._description.forces.values():
        if is_set_valued(record) and not (state and record.kind == "latch"):
            raise DescriptionError(
                f'force "{record.name}" is {_ADVICE[record.kind]}; {analysis} cannot follow it, only simulate can',
                element="force",
                name=record.name,
            )


def of_elements(description: Description, model: CompiledModel, hold: Hold, locked: Hold) -> Iterator[OfElement]:
    """The events of all elements; numbers are those of the model, whose parameters may have changed."""
    for record in description.forces.values():
        if isinstance(record, LoadRecord) and is_set_valued(record):
            yield from _of(record, model, hold, locked)


def _of(record: LoadRecord, model: CompiledModel, hold: Hold, locked: Hold) -> Iterator[OfElement]:
    name, joint, coordinate = record.name, record["joint"], record["coordinate"]
    of, measured = Coordinate(joint, coordinate), {"of": "joint", "joint": joint, "coordinate": coordinate}

    def number(field: str) -> float:
        """As it is in this model."""
        changed = model._changes.get(f"{name}.{field}")
        return float(record[field] if changed is None else changed[0])

    def event(value: float, direction: int, reads: str = "position") -> Event:
        return Event(name, of, value=value, reads=reads, direction=direction)

    match record.kind:
        case "friction":
            drive = hold(name, measured, "velocity", 0.0)
            yield OfElement(event(0.0, 0, "velocity"), {"friction": {"drive": drive, "force": name}}, name, drive)
        case "freewheel":
            free = int(number("free"))
            drive = hold(name, measured, "velocity", 0.0)
            does = {"freewheel": {"drive": drive, "sign": float(free)}}
            yield OfElement(event(0.0, -free, "velocity"), does, name, drive)
        case "latch":
            drive = locked(name, measured, "velocity", 0.0)
            yield OfElement(event(number("at"), int(number("direction"))), {"lock": drive}, name, drive)
        case _:
            for end, direction in (("lower", -1), ("upper", 1)):
                if record.means.get(end) is None:
                    continue
                drive = hold(f"{name}, {end}", measured, "position", number(end))
                law = {"drive": drive, "sign": -float(direction), "restitution": number("restitution")}
                yield OfElement(event(number(end), direction), {"stop": law}, name, drive)
