"""Loads declared once: what a kind of load needs besides the signature and the docstring of its method.

The signature has the names and the defaults, the docstring the words, the declaration units, bounds and the order of
files. The checks of a call, its record, the units of its parameters, its table in the schema of model files and what
writers of other formats report follow from these three.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ..products import norm
from ..units.door import SI
from .bodies import resolve, to_world
from .checks import Element, direction, number
from .drawing import Drawing
from .forces import coefficient, named, store
from .joints import coordinate_of, effort_of, joint_record, scalars, unit_of
from .points import point_on
from .records import Force, JointRecord, LoadRecord

M = TypeVar("M", bound=Callable[..., Force])
LOADS: dict[str, Load] = {}
"""All that are declared, by their kinds."""


@dataclass(frozen=True)
class Field:
    """An argument: `check` of the call, its name, what was given and the unit; its `rule` in the schema of model files.
    `absent` is its value where none is given, or makes one of the call; `kept`: files have it although it is the usual
    one."""

    check: Callable[[Call, str, Any, Any], Any]
    rule: Mapping[str, Any]
    unit: SI | Callable[[Call], SI] = ""
    absent: Any = None
    kept: bool = False


def side(ground: bool = True) -> Field:
    """A body, or the ground."""
    return Field(
        lambda call, what, body, _: resolve(call.drawing, call.element, what, body, ground=ground),
        {"$ref": "#/$defs/name"},
    )


def place(body: str, kept: bool = False) -> Field:
    """A point in the axes of the body that another argument names."""
    return Field(
        lambda call, what, point, _: point_on(call.drawing, call.element, what, point, call[body]),
        {"$ref": "#/$defs/vector"}, "m", kept=kept,
    )  # fmt: skip


def heading() -> Field:
    """A direction."""
    return Field(lambda call, what, value, _: direction(call.element, what, value), {"$ref": "#/$defs/vector"})


def rate(unit: SI | Callable[[Call], SI]) -> Field:
    """A stiffness or damping of a linear law."""
    return replace(amount(unit), check=lambda call, what, value, unit: coefficient(call.element, what, value, unit))


def amount(
    unit: SI | Callable[[Call], SI] = "",
    *,
    least: float | None = None,
    above: float | None = None,
    absent: Any = None,
    kept: bool = False,
) -> Field:
    """A number in its unit, which may follow from other arguments."""
    form: dict[str, Any] = {"$ref": "#/$defs/quantity"} if unit else {"type": "number"}
    return Field(
        lambda call, what, value, unit: number(call.element, what, value, unit, least=least, above=above),
        form if least is None else {**form, "minimum": int(least)}, unit, absent, kept,
    )  # fmt: skip


def joint_of(call: Call) -> JointRecord:
    """The joint along which it acts."""
    return call.drawing._description.joints[call["joint"]]


JOINT: dict[str, Any] = {
    "joint": Field(
        lambda call, what, joint, _: joint_record(call.drawing, call.element, joint).name, {"$ref": "#/$defs/name"}
    ),
    "coordinate": Field(
        lambda call, what, i, _: coordinate_of(call.element, joint_of(call), i, scalars(joint_of(call))),
        {"$ref": "#/$defs/coordinate"},
    ),
}
"""A coordinate of a joint, along which a load acts."""


def effort(call: Call) -> str:
    """Unit of an effort along it."""
    return effort_of(joint_of(call), call["coordinate"])


def unit(call: Call) -> str:
    """Its unit."""
    return unit_of(joint_of(call), call["coordinate"])


BETWEEN: dict[str, Any] = {"body1": side(), "point1": place("body1"), "body2": side(), "point2": place("body2")}
"""Ends of a load between two points."""


def as_drawn(call: Call) -> float:
    """Distance of its ends in the drawing."""
    ends = [to_world(call.drawing._description, call[f"body{i}"], call[f"point{i}"]) for i in (1, 2)]
    return float(norm(ends[1] - ends[0]))


class Load:
    """A kind of load, with which its method is decorated: its fields in the order of files. `lost`: what a mechanism is
    without it, if no other format than TOML can represent it. `sides` must be two bodies, or `apart` says why. `called`
    makes a name of that of its joint."""

    def __init__(
        self,
        kind: str,
        *,
        lost: str = "",
        sides: tuple[str, ...] = ("body1", "body2"),
        apart: str = "both ends are on {}, where the {} has no effect",
        called: str = "",
        **fields: Field,
    ) -> None:
        self.kind, self.fields, self.lost, self.called = kind, fields, lost, called
        self.sides, self.apart = () if called else sides, apart

    def __call__(self, method: M) -> M:
        self.method: Callable[..., Force] = method
        LOADS[self.kind] = self
        return method

    @cached_property
    def defaults(self) -> dict[str, Any]:
        """The arguments of its method with their defaults, `Parameter.empty` where one is needed."""
        found = inspect.signature(self.method).parameters.values()
        return {p.name: p.default for p in found if p.name != "self"}

    def checked(self, given: Mapping[str, Any]) -> Call:
        """A call of its method with these arguments, `self` included."""
        return Call(self, given)


class Call:
    """A call of the method of a load. Its items are the arguments, checked."""

    def __init__(self, load: Load, given: Mapping[str, Any]) -> None:
        self.load, self.given = load, given
        self.drawing: Drawing = given["self"]
        self.element: Element = named(self.drawing, given["name"], load.called, given.get("joint"))
        self.units: dict[str, SI] = {}
        self._checked: dict[str, Any] = {}
        sides = [self[what] for what in load.sides]
        if sides and sides[0] == sides[1]:
            why = load.apart.format(f'"{sides[0]}"', load.kind.replace("_", " "))
            self.element.fail(f"{why}; name two different bodies")
        for what in load.fields:
            self[what]

    def __getitem__(self, what: str) -> Any:
        if what not in self._checked:
            field, value = self.load.fields[what], self.given[what]
            unit = self.units[what] = field.unit(self) if callable(field.unit) else field.unit
            left_out = value is None and self.load.defaults[what] is None
            self._checked[what] = None if left_out else field.check(self, what, value, unit)
        return self._checked[what]

    def take(self, *names: str) -> dict[str, Any]:
        """Some of the arguments."""
        return {what: self[what] for what in names}

    def store(self, **means: Any) -> Force:
        """Store its record; `means` are what the core is told in place of the arguments."""
        arguments, values = {}, {}
        for what, field in self.load.fields.items():
            value, default = self[what], self.load.defaults[what]
            absent = field.absent(self) if callable(field.absent) else field.absent
            values[what] = absent if value is None else value
            usual = absent if default is None else default
            omitted = not field.kept and default is not inspect.Parameter.empty and np.array_equal(value, usual)
            arguments[what] = None if omitted else value
        record = LoadRecord(self.element.name, self.load.kind, arguments, means or values, self.units)
        return store(self.drawing, record)
