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

from ..products import norm
from ..tolerance import EQUAL
from ..units import Quantity
from . import callbacks
from .bodies import resolve, to_world
from .checks import Element, choice, name_of, number, switch
from .drawing import Drawing
from .joints import coordinate_of, effort_of, joint_record, scalars, speeds, unit_of
from .measures import measure, measured_in
from .name_first import name_first
from .points import point_on
from .records import (
    Body,
    Force,
    ForceLike,
    ForceRecord,
    Joint,
    SpringRecord,
    TorqueRecord,
    TorsionSpringRecord,
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


def both_ends(
    self: Drawing, element: Element, kind: str, one: tuple[Any, ArrayLike], two: tuple[Any, ArrayLike]
) -> tuple[tuple[str, Any], tuple[str, Any], float]:
    """Body and point of both ends, and their distance as drawn."""
    first, second = resolve(self, element, "body1", one[0]), resolve(self, element, "body2", two[0])
    if first == second:
        element.fail(f'both ends are on "{first}", where the {kind} has no effect; name two different bodies')
    end1, end2 = (
        point_on(self, element, what, point, body)
        for what, point, body in (("point1", one[1], first), ("point2", two[1], second))
    )
    d = self._description
    return (first, end1), (second, end2), float(norm(to_world(d, second, end2) - to_world(d, first, end1)))


def add_spring(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    stiffness: Quantity,
    damping: Quantity = 0.0,
    length: Quantity | None = None,
) -> Force:
    """Add a linear spring and damper between two points. For other laws of the length see `add_force_law`.

    The force along the line is stiffness (distance - length) + damping d(distance)/dt, positive in tension. Negative
    stiffness or damping is allowed, as for some controllers and magnets.

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground.
        point1, point2: in the axes of their body (world for the ground) [m].
        stiffness: [N/m].
        damping: [N s/m].
        length: free length [m], not negative; None: the drawn distance, so that the spring is unloaded as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("swing")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> m.add_spring("S", m.ground, (0, 1, 0), rod, (1, 0, 0), stiffness=100.0).name
    'S'
    """
    element = name_of("force", name, self._description.forces)
    (first, end1), (second, end2), drawn = both_ends(self, element, "spring", (body1, point1), (body2, point2))
    if drawn == 0.0:
        element.fail(
            "both ends are at the same point as drawn, where the direction of the force is undefined; move one end"
        )
    record = SpringRecord(
        name=name,
        body1=first,
        point1=end1,
        body2=second,
        point2=end2,
        stiffness=coefficient(element, "stiffness", stiffness, "N/m"),
        damping=coefficient(element, "damping", damping, "N s/m"),
        length=None if length is None else number(element, "length", length, "m", least=0.0),
    )
    return store(self, record)


@name_first(1)
def add_torsion_spring(
    self: Drawing,
    joint: Joint | str,
    *,
    stiffness: Quantity,
    damping: Quantity = 0.0,
    angle: Quantity = 0.0,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a spring and damper along one coordinate of a joint: -stiffness (x - angle) - damping x' acts on
    the child.

    Args:
        joint: the joint or its name; its coordinate must not be part of a quaternion.
        stiffness: [N m/rad] for a rotation, [N/m] for a translation.
        damping: [N m s/rad] or [N s/m].
        angle: coordinate at which the spring is at rest [rad] or [m]; 0: the drawn position.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("flap")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.add_torsion_spring(hinge, stiffness=5.0).name
    'spring of A'
    """
    element = named(self, name, "spring of", joint)
    found = joint_record(self, element, joint)
    which = coordinate_of(element, found, coordinate, scalars(found))
    unit, effort = unit_of(found, which), effort_of(found, which)
    record = TorsionSpringRecord(
        name=element.name,
        joint=found.name,
        coordinate=which,
        stiffness=coefficient(element, "stiffness", stiffness, f"{effort}/{unit}"),
        damping=coefficient(element, "damping", damping, f"{effort} s/{unit}"),
        angle=number(element, "angle", angle, unit),
    )
    return store(self, record)


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
