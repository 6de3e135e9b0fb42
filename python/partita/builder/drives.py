"""Prescribed motion: `Mechanism.add_drive`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from .checks import Element, name_of
from .drawing import Drawing
from .forces import coordinate_of, free_name, joint_record
from .joints import scalars
from .motion import Motion
from .records import Drive, DriveRecord, Joint
from .values import Function, Table, scalar


def add_drive(
    self: Drawing,
    joint: Joint | str,
    position: float | tuple[ArrayLike, ArrayLike] | Callable[..., Any],
    velocity: Callable[..., Any] | None = None,
    acceleration: Callable[..., Any] | None = None,
    *,
    coordinate: int = 0,
    name: str | None = None,
) -> Drive:
    """Prescribe the motion of one joint coordinate over time; the effort it takes is part of the joint's
    reaction.

    Args:
        joint: the joint or its name; the coordinate must be a slide or an angle, not part of a quaternion.
        position: [m] or [rad], measured from the drawn position: a number (the coordinate is held there), a
            table (times, values) joined by a twice differentiable not-a-knot cubic spline, or f(t).
        velocity, acceleration: its derivatives as functions of t. Where they are not given, they are found
            exactly by evaluating f on a number that carries its derivatives; f may use arithmetic and NumPy
            functions. For other functions (`math.sin`, interpolators) central differences of order 8 take
            their place, and a note in the result says so with their accuracy.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

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
    element = name_of("drive", name if name is not None else free_name(self, f"drive of {joint}", drives), drives)
    found = joint_record(self, element, joint)
    number = coordinate_of(element, found, coordinate, scalars(found))
    if (other := self._description.driven.get((found.name, number))) is not None:
        element.fail(
            f'coordinate {number} of joint "{found.name}" is driven already by "{other}"; remove one of the two'
        )

    def wrap(function: Callable[..., Any]) -> Function:
        return Function(Motion(element, function, velocity, acceleration))

    _check_derivatives(element, position, velocity, acceleration)
    motion = scalar(element, "position", position, "smooth", wrap)
    if isinstance(motion, Table) and motion.times.size < 4:
        element.fail(f"position: a smooth motion needs a table of at least 4 times, not {motion.times.size}")
    self._description.store(drives, DriveRecord(element.name, found.name, number, motion))
    self._description.driven[found.name, number] = element.name
    return Drive(element.name, self)


def _check_derivatives(element: Element, position: Any, velocity: Any, acceleration: Any) -> None:
    """Derivatives belong to functions only, and are functions."""
    for what, derivative in (("velocity", velocity), ("acceleration", acceleration)):
        if derivative is None:
            continue
        if not callable(position):
            element.fail(
                f"{what} can be given only where position is a function; a number or a table has its own derivatives"
            )
        if not callable(derivative):
            element.fail(f"{what} must be a function of t, not {derivative!r}")
