"""Elements that hold a joint at times, as events of a run: rigid stops, freewheels, latches, friction that sticks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeGuard

import numpy as np

from ..builder.compiled import CompiledModel
from ..builder.measures import Along, Coordinate, Distance
from ..builder.records import Description, Force, LoadRecord
from ..errors import DescriptionError
from ..events import Event
from .models import Modelled

Hold = Callable[[str, dict[str, Any], str, float], str]
"""Adds a drive: its name, what it measures, the level, the value there; returns the name that it got."""


_ADVICE = {
    "friction": "friction that sticks (without a stick_velocity): give it one, which makes it smooth",
    "stop": "a rigid stop (restitution): give it a stiffness in place of it",
    "contact": "a rigid contact (restitution): give it a stiffness in place of it",
    "rope": "a rope that does not stretch (restitution): give it a stiffness in place of it",
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


def is_set_valued(record: Any) -> TypeGuard[LoadRecord]:
    """Whether a force is one by which a run holds a joint at times."""
    if not isinstance(record, LoadRecord):
        return False
    match record.kind:
        case "friction":
            return record.arguments.get("stick_velocity") in (None, 0.0)
        case "stop" | "contact" | "rope":
            return record.arguments.get("restitution") is not None
        case _:
            return record.kind in ("freewheel", "latch")


def has_set_valued(mechanism: Modelled) -> bool:
    """Whether a mechanism has elements by which a run holds joints at times."""
    return any(map(is_set_valued, mechanism._description.forces.values()))


def is_latch(record: Any) -> TypeGuard[LoadRecord]:
    """Whether a force is a latch."""
    return isinstance(record, LoadRecord) and record.kind == "latch"


def latch_of(mechanism: Modelled, given: Any) -> LoadRecord | None:
    """The latch that is meant by its name or handle; None for anything else."""
    record = mechanism._description.forces.get(given.name if isinstance(given, Force) else str(given))
    return record if is_latch(record) else None


def without_holding(mechanism: Modelled, analysis: str, state: bool = False) -> None:
    """Refuse a mechanism with elements that hold at times, which `analysis` does not follow. Of one state a latch is
    open."""
    for record in mechanism._description.forces.values():
        if is_set_valued(record) and not (state and record.kind == "latch"):
            raise DescriptionError(
                f'force "{record.name}" is {_ADVICE[record.kind]}; {analysis} cannot follow it, only simulate, '
                "steppers and FMUs can",
                element="force",
                name=record.name,
            )


def of_elements(description: Description, model: CompiledModel, hold: Hold, locked: Hold) -> Iterator[OfElement]:
    """The events of all elements; numbers are those of the model, whose parameters may have changed."""
    for record in description.forces.values():
        if is_set_valued(record):
            yield from _of(record, model, hold, locked)


def _numbers(record: LoadRecord, field: str, model: CompiledModel) -> list[float]:
    """As they are in this model."""
    changed = model._changes.get(f"{record.name}.{field}")
    return np.ravel(record[field] if changed is None else changed).astype(float).tolist()


def _between(record: LoadRecord, model: CompiledModel, hold: Hold) -> OfElement:
    """Of what bounds how far two points are apart: a rigid contact, the centre of its sphere over a plane or from
    another centre, and a rope that does not stretch."""
    name, one, other = record.name, record["body1"], record["body2"]
    point1, point2 = (_numbers(record, f"point{i}", model) for i in (1, 2))
    of: Distance | Along = Distance(one, point1, other, point2)
    measured = {"of": "distance", "body1": one, "point1": point1, "body2": other, "point2": point2}
    direction = -1
    if record.kind == "rope":
        (bound,), direction = _numbers(record, "length", model), 1
    elif record["normal"] is None:
        bound = _numbers(record, "radius1", model)[0] + _numbers(record, "radius2", model)[0]
    else:
        (bound,), axis = _numbers(record, "radius1", model), np.ravel(record["normal"]).tolist()
        of = Along(other, point2, axis, one, point1)
        measured = {"of": "along", "body1": other, "point1": point2, "axis": axis, "body2": one, "point2": point1}
    drive = hold(name, measured, "position", bound)
    law = {"drive": drive, "sign": -float(direction), "restitution": _numbers(record, "restitution", model)[0]}
    return OfElement(Event(name, of, value=bound, direction=direction), {"stop": law}, name, drive)


def _of(record: LoadRecord, model: CompiledModel, hold: Hold, locked: Hold) -> Iterator[OfElement]:
    if record.kind in ("contact", "rope"):
        yield _between(record, model, hold)
        return
    name, joint, coordinate = record.name, record["joint"], record["coordinate"]
    of, measured = Coordinate(joint, coordinate), {"of": "joint", "joint": joint, "coordinate": coordinate}

    def number(field: str) -> float:
        return _numbers(record, field, model)[0]

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
