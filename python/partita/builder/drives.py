"""Prescribed motion: `Mechanism.add_drive`."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from .checks import Element, name_of, number
from .drawing import Drawing
from .forces import free_name
from .measures import Measure, measure
from .motion import Motion
from .records import Drive, DriveRecord, Joint
from .values import Function, scalar

Course = float | tuple[ArrayLike, ArrayLike] | Callable[..., Any]


def add_drive(
    self: Drawing,
    joint: Joint | str | Measure,
    position: Course | None = None,
    velocity: Course | None = None,
    acceleration: Course | None = None,
    *,
    coordinate: int = 0,
    rate: float = 0.0,
    name: str | None = None,
) -> Drive:
    """Prescribe a motion over time: of one joint coordinate, a distance, a displacement; the effort it takes is part of
    the joint's reaction.

    Give the position, or the velocity alone, or the acceleration alone. A drive of velocity or acceleration prescribes
    rates: it starts wherever the mechanism is.

    Args:
        joint: the joint or its name (in the tree, closing a loop, or in absolute coordinates); the coordinate must be a
            slide or an angle, not part of a quaternion. Or `pt.Distance`, `pt.Along`, `pt.Cosine`.
        position: [m] or [rad], measured from the drawn position (distances and displacements as they are): a number
            (it is held there), a table (times, values) joined by a twice differentiable cubic spline (two points make
            a straight line, three a parabola), or f(t).
        velocity, acceleration: beside a position that is a function, its derivatives as functions of t; alone, what is
            prescribed, as number, table or f(t). A table of accelerations is joined by straight lines.
        coordinate: which coordinate of the joint, from 0.
        rate: with an acceleration alone, the rate at t = 0 [rad/s or m/s].
        name: None: made from the joint's name.

    Where derivatives of a function are not given, they are found exactly by evaluating f on a number that carries its
    derivatives; f may use arithmetic and NumPy functions. For other functions (`math.sin`, interpolators) central
    differences of order 8 take their place, and a note in the result says so with their accuracy.

    Raises:
        DescriptionError: the coordinate does not exist or is driven already; a derivative contradicts the
            function.
        EvaluationError: the function returns anything but a finite number (here or during a run); a run
            leaves the table.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("shaker")
    >>> table = m.add_body("table", mass=1.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, table, axis=(0, 1, 0))
    >>> m.add_drive(slide, position=lambda t: 0.01 * np.sin(20.0 * t)).name
    'drive of S'
    """
    drives = self._description.drives
    what = joint if isinstance(joint, Joint | str) else type(joint).__name__.lower()
    element = name_of("drive", name if name is not None else free_name(self, f"drive of {what}", drives), drives)
    if isinstance(joint, Joint | str):
        found = measure(self, element, {"of": "joint", "joint": joint, "coordinate": coordinate})
    else:
        found = measure(self, element, joint)
    key = json.dumps(found, sort_keys=True)
    if (other := self._description.driven.get(key)) is not None:
        said = f'coordinate {found["coordinate"]} of joint "{found["joint"]}"' if found["of"] == "joint" else "it"
        element.fail(f'{said} is driven already by "{other}"; remove one of the two')
    level, course = _level(element, position, velocity, acceleration)
    start = number(element, "rate", rate)
    if start != 0.0 and level != "acceleration":
        element.fail("rate is where an acceleration begins; positions and velocities have their own")

    def wrap(function: Callable[..., Any]) -> Function:
        given = (velocity, acceleration) if level == "position" else (None, None)
        return Function(Motion(element, function, *given))

    motion = scalar(element, level, course, "smooth", wrap)
    self._description.store(drives, DriveRecord(element.name, found, motion, level, start))
    self._description.driven[key] = element.name
    return Drive(element.name, self)


def _level(element: Element, position: Any, velocity: Any, acceleration: Any) -> tuple[str, Any]:
    """What is prescribed, and how it runs; derivatives belong to functions only, and are functions."""
    if position is None:
        if velocity is not None and acceleration is not None:
            element.fail(
                "give velocity or acceleration, not both; beside a position as a function both are its derivatives"
            )
        if velocity is not None:
            return "velocity", velocity
        if acceleration is not None:
            return "acceleration", acceleration
        element.fail("it prescribes nothing; give position, velocity or acceleration")
    for what, derivative in (("velocity", velocity), ("acceleration", acceleration)):
        if derivative is None:
            continue
        if not callable(position):
            element.fail(
                f"{what} beside a position can be given only where position is a function; a number or a table has its "
                "own derivatives"
            )
        if not callable(derivative):
            element.fail(f"{what} must be a function of t, not {derivative!r}")
    return "position", position
