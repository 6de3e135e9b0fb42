"""Inputs of a stepper: efforts, which are constant over a step, and drives, whose motion continues without a jump."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..builder.joints import effort_of
from ..builder.records import Description, Drive, ForceRecord, TorqueRecord
from ..builder.values import Constant
from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import is_list, shown
from ..sensing import Signals, measured
from .set_valued import is_set_valued

Array = NDArray[np.float64]
_AXES = "xyz"


class Input(NamedTuple):
    """One input: the force and its component, or the drive (`component` None), what it prescribes, and of what."""

    name: str
    component: int | None
    level: str = "effort"
    measure: Mapping[str, Any] = {}


def inputs_of(d: Description) -> dict[str, Input]:
    """All inputs, forces before drives; a drive that shares its name with one of them is "drive NAME"."""
    found: dict[str, Input] = {}
    for name, record in d.forces.items():
        match record:
            case TorqueRecord(value=Constant(), over=None):
                found[name] = Input(name, 0)
            case ForceRecord(value=tuple() as value):
                numbers = [k for k, one in enumerate(value) if isinstance(one, Constant)]
                found.update({f"{name}.{_AXES[k]}": Input(name, k) for k in numbers})
    for name, drive in d.drives.items():
        if drive.level != "pose":
            found[_free(name, found)] = Input(name, None, drive.level, drive.measure)
    return found


def _free(name: str, taken: Mapping[str, Input]) -> str:
    while name in taken:
        name = f"drive {name}"
    return name


def chosen(known: Mapping[str, Input], wanted: Any) -> dict[str, Input]:
    """The requested inputs; by default all efforts."""
    if wanted is None:
        return {name: one for name, one in known.items() if one.component is not None}
    if not is_list(wanted):
        message = f"inputs must be a list of names such as {list(known)[:2]}, not {shown(wanted)}"
        raise ArgumentError(message, argument="inputs")
    every = list(known)
    drives = {one.name: name for name, one in known.items() if one.component is None}
    names = [drives.get(item.name, item.name) if isinstance(item, Drive) else str(item) for item in wanted]
    names = [every[index_of(name, every, "input")] for name in names]
    if len(set(names)) < len(names):
        raise ArgumentError(f"inputs names one twice: {', '.join(names)}", argument="inputs")
    return {name: known[name] for name in names}


class Settable(NamedTuple):
    """An effort that events may set: its force and component, its unit, and its least value."""

    force: str
    component: int | None
    unit: str
    least: float | None = None


def settable(d: Description) -> dict[str, Settable]:
    """All efforts that events may set, by the names of inputs; friction that sticks by its own."""
    found: dict[str, Settable] = {}
    for name, one in inputs_of(d).items():
        if one.component is None:
            continue
        record = d.forces[one.name]
        if isinstance(record, TorqueRecord):
            found[name] = Settable(one.name, None, effort_of(d.joints[record.joint], record.coordinate))
        else:
            found[name] = Settable(one.name, one.component, "N")
    for name, record in d.forces.items():
        if is_set_valued(record) and record.kind == "friction" and isinstance(record["dynamic"], Constant):
            found[name] = Settable(name, None, effort_of(d.joints[record["joint"]], record["coordinate"]), 0.0)
    return found


def drawn_values(d: Description, model: CompiledModel, names: Sequence[str]) -> list[Any]:
    """For the core: number and component of the force, and its value at the start, of each of these inputs."""
    if not names:
        return []
    known, forces = settable(d), json.loads(model.description)["forces"]
    numbers = {force["name"]: i for i, force in enumerate(forces)}
    found = []
    for name in names:
        one = known[name]
        data = forces[numbers[one.force]]
        value = data.get("value", data.get("dynamic"))
        found.append([[numbers[one.force], one.component], _constant(value, one.component or 0)])
    return found


def _constant(value: Any, component: int) -> float:
    """The number that was drawn, of a torque or of a component of a force."""
    return float((value[component] if isinstance(value, list) else value)["constant"])


class Courses:
    """Values of the inputs over a step. Efforts: a number. Drives: the start time, and a cubic of the time since then
    that continues the motion: the position, or of velocities and accelerations the rate.

    Over a step of length h from position x at rate r, with u given:

    - of a velocity: acceleration (u - r) / h, so that the rate is u at the end;
    - of an acceleration: acceleration u;
    - of a position: the cubic that ends at u with the mean rate (u - x) / h.

    So positions and rates are continuous for any input, as a constraint requires (S3, S4).
    """

    def __init__(self, inputs: Mapping[str, Input], model: CompiledModel) -> None:
        self._inputs = list(inputs.values())
        described = json.loads(model.description)
        numbers = {kind: {one["name"]: i for i, one in enumerate(described[kind])} for kind in ("forces", "drives")}
        self.indices: list[tuple[int, int | None]] = [
            (numbers["drives" if one.component is None else "forces"][one.name], one.component) for one in self._inputs
        ]
        self._drives = any(one.component is None for one in self._inputs)
        self._drawn = [0.0 if k is None else _constant(described["forces"][at]["value"], k) for at, k in self.indices]

    def first(self, signals: Signals) -> tuple[Array, Array]:
        """The present values of all inputs. Initially efforts have the values of the drawing, and drives continue at
        their rates."""
        held, u = list[float](), list[float]()
        for one, drawn in zip(self._inputs, self._drawn, strict=True):
            if one.component is not None:
                held.append(drawn)
                u.append(drawn)
                continue
            rate = float(measured(signals, one.measure, "velocity"))
            if one.level == "position":
                at = float(measured(signals, one.measure, "position"))
                held += [float(signals.t), at, rate, 0.0, 0.0]
                u.append(at)
            else:
                held += [float(signals.t), rate, 0.0, 0.0, 0.0]
                u.append(rate if one.level == "velocity" else 0.0)
        return np.array(held), np.array(u)

    def over(self, held: Array, u: Array, t: float, h: float) -> Array:
        """Coefficients for the step that starts at t, given those of the previous step."""
        if not self._drives:
            return u
        new, start = held.copy(), 0
        for one, value in zip(self._inputs, u, strict=True):
            if one.component is not None:
                new[start] = value
                start += 1
                continue
            since, a, b, c, d = held[start : start + 5]
            x = t - since
            at, rate = a + (b + (c + d * x) * x) * x, b + (2.0 * c + 3.0 * d * x) * x
            if one.level == "position":
                jump = (value - at) / h - rate
                new[start : start + 5] = t, at, rate, 2.0 * jump / h, -jump / h**2
            else:
                growth = (value - at) / h if one.level == "velocity" else value
                new[start : start + 5] = t, at, growth, 0.0, 0.0
            start += 5
        return new
