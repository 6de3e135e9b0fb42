"""Forces: springs, torques and forces on a mechanism.

A value may be a number, a table or a Python function f(t, state). `state` offers `.t`, `.q`,
`.v` and, for joints of the spanning tree, `.position(joint)` and `.velocity(joint)` by name. A table is (times [s],
values), joined by monotone cubics (PCHIP), which between two samples never leave their range, or as `interpolation=`
says; a run that leaves the table stops with `EvaluationError`. A function is called several times per step from the
compiled core and is by far the most expensive part of an evaluation; numbers and tables cost almost nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..tolerance import EQUAL
from ..units import Quantity
from . import callbacks
from .bodies import resolve
from .checks import Element, choice, name_of, number, switch
from .drawing import Drawing
from .joints import coordinate_of, effort_of, joint_record, speeds
from .measures import measure, measured_in
from .name_first import name_first
from .points import point_on
from .records import (
    Body,
    Force,
    ForceLike,
    ForceRecord,
    Joint,
    TorqueRecord,
)
from .values import Table, scalar
from .vectors import components


def coefficient(element: Element, what: str, value: Any, unit: str) -> float:
    """A stiffness or damping, which is one number."""
    if callable(value) or isinstance(value, tuple | list):
        element.fail(
            f"{what} is one number, so that the force is linear; a force that follows another law of the length or of "
            "the rate is add_force_law(name, f, sees, on), along a joint add_torque(joint, (x, effort), over=joint)"
        )
    return number(element, what, value, unit)


@name_first(1)
def add_torque(
    self: Drawing,
    joint: Joint | str,
    value: Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any],
    *,
    over: Any = None,
    periodic: bool = False,
    coordinate: int = 0,
    interpolation: str | None = None,
    name: str | None = None,
) -> Force:
    """Add an effort along one coordinate of a joint; it acts on the child, its opposite on the parent.

    Args:
        joint: the joint or its name.
        value: torque for a rotation [N m], force for a translation [N]: a number, a table (times, values), or f(t,
            state) that returns a number.
        over: abscissa of a table instead of time: a joint (its first coordinate) or a measurement such as
            `pt.Distance`, for example for a gas force over the crank angle. Computed without Python.
        periodic: this table repeats after its last entry; its first and last value must be equal.
        coordinate: which velocity of the joint, from 0.
        interpolation: how a table is joined: "monotone" (the default), "linear" or "spline", as in `add_drive`.
        name: None: made from the joint's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("motor")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.add_torque(hinge, lambda t, state: 5.0 - 0.1 * state.velocity("A")).name
    'torque on A'
    """
    element = named(self, name, "torque on", joint)
    found = joint_record(self, element, joint)
    which = coordinate_of(element, found, coordinate, speeds(found))
    along = None if over is None else measure(self, element, over)
    units = ("s" if along is None else measured_in(self, along), effort_of(found, which))
    record = TorqueRecord(
        name=element.name,
        joint=found.name,
        coordinate=which,
        value=scalar(element, "value", value, "monotone", callbacks.number_of(element), units, interpolation),
        over=along,
        periodic=switch(element, "periodic", periodic),
        interpolation=interpolation,
    )
    if record.over is None and record.periodic:
        element.fail("periodic applies to a table over a coordinate; give over=")
    if record.over is not None:
        if not isinstance(record.value, Table):
            element.fail("over= belongs to a table (x, values); a function can read the state itself")
        ends = record.value.values[[0, -1]]
        if record.periodic and abs(ends[1] - ends[0]) > EQUAL * float(np.abs(record.value.values).max()):
            element.fail(f"a periodic table must end where it begins: {ends[0]:g} first, {ends[1]:g} last")
    return store(self, record)


@name_first(1)
def add_force(
    self: Drawing,
    body: Body | str,
    force: ArrayLike | tuple[Any, ...] | Callable[..., Any],
    point: ArrayLike | None = None,
    *,
    axes: str = "world",
    interpolation: str | None = None,
    name: str | None = None,
) -> Force:
    """Add a force on a point of a body.

    Args:
        body: the body or its name, not the ground.
        force: [N] three components, each a number, a table (times, values) or f(t, state); or one table
            (times (n,), values (n, 3)); or one function f(t, state) that returns three numbers.
        point: point of application in body axes [m]; None: the centre of mass.
        axes: "world": components along the world axes; "body": along the axes of the body, which rotate with it.
        interpolation: how tables are joined: "monotone" (the default), "linear" or "spline", as in `add_drive`.
        name: None: made from the body's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("stone")
    >>> stone = m.add_body("stone", mass=1.0, inertia=(1, 1, 1))
    >>> m.add_force(stone, (0, 0, 2.5)).name
    'force on stone'
    """
    element = named(self, name, "force on", body)
    found = self._description.bodies[resolve(self, element, "body", body, ground=False)]
    record = ForceRecord(
        name=element.name,
        body=found.name,
        point=found.com.copy() if point is None else point_on(self, element, "point", point, found.name),
        value=components(element, "force", force, "N", interpolation),
        axes=choice(element, "axes", axes, ("world", "body")),
        at_center=point is None,
        interpolation=interpolation,
    )
    return store(self, record)


def named(mechanism: Drawing, name: str | None, words: str, owner: Any) -> Element:
    """The element with the user's name, or with one made from its owner's; a second one becomes "... 2"."""
    taken = mechanism._description.forces
    return name_of("force", name if name is not None else free_name(mechanism, f"{words} {owner}", taken), taken)


def free_name(mechanism: Drawing, wanted: str, taken: dict[str, Any]) -> str:
    """`wanted`, or the first of "wanted 2", "wanted 3", ... that is free."""
    if wanted not in taken:
        return wanted
    # names are never reused: the search continues where it last ended
    numbers = mechanism._description.numbers
    count = numbers.get(wanted, 2)
    while f"{wanted} {count}" in taken:
        count += 1
    numbers[wanted] = count
    return f"{wanted} {count}"


def store(mechanism: Drawing, record: ForceLike) -> Force:
    mechanism._description.store(mechanism._description.forces, record)
    return Force(record.name, mechanism)
