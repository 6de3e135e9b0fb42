"""Prescribed motion: `Mechanism.add_drive`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from ..units import Quantity
from ..units.door import QuantityError, in_si
from .bodies import resolve
from .checks import Element, name_of, number
from .drawing import Drawing
from .forces import free_name
from .joints import add_free, coordinate_of, joint_record, scalars, speeds
from .measures import Measure, measure, measured_in
from .motion import Motion
from .name_first import name_first
from .poses import as_given, pose_value
from .records import Body, Drive, DriveRecord, Joint, Ref
from .values import BY_DEFAULT, Curve, Function, Table, interpolation_of, scalar

Course = Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any]


@name_first(1)
def add_drive(
    self: Drawing,
    joint: Joint | str | Body | Measure,
    position: Course | None = None,
    velocity: Course | None = None,
    acceleration: Course | None = None,
    *,
    pose: Any = None,
    coordinate: int = 0,
    rate: Quantity = 0.0,
    interpolation: str | None = None,
    name: str | None = None,
) -> Drive:
    """Prescribe a motion over time: of a joint coordinate, a distance, a displacement, or the whole pose of a body.

    Its effort is part of the joint's reaction. Give the position, or the velocity alone, or the acceleration alone. A
    drive of velocity or acceleration prescribes rates: it starts from the current position of the mechanism. A joint
    with spatial rotation is driven by its pose. To make a coordinate a function of another one instead of time, use
    `add_cam`.

    Args:
        joint: the joint or its name (in the tree, closing a loop, or in absolute coordinates); the coordinate must be a
            translation or an angle; of a spatial rotation the three angular velocities can be driven, in child axes
            [rad/s]. Or `pt.Distance`, `pt.Along`, `pt.Cosine`. With a pose it may be a body: a free joint "pose of ..."
            from the ground is then added, whose `force`, `moment` and `drive` are the efforts of the drive.
        position: [m] or [rad], measured from the drawn position (distances and displacements: their own values): a
            number (constant), a table (times, values), or f(t).
        velocity, acceleration: with a position that is a function, its derivatives as functions of t; alone, the
            prescribed quantity, as number, table or f(t).
        pose: (position, orientation), constant; a table (times, positions, orientations); or f(t) that returns
            (position, orientation). For a joint these are its coordinates, zero as drawn: as many
            translations [m] as it has (none: the orientation alone), and the rotation of the child. For a body they are
            its position and orientation in the world. Orientations are rotation vectors [rad], quaternions (w, x, y,
            z), matrices or a SciPy `Rotation`, through any angle and any number of turns; a SciPy `RigidTransform` is
            both at once.
        coordinate: which coordinate of the joint, from 0.
        rate: with an acceleration alone, the rate at t = 0 [rad/s or m/s].
        interpolation: how tables are joined. "monotone" (the default of positions and poses): cubics with continuous
            rates that never leave the range of two samples between them; accelerations may jump at samples, where steps
            end. "linear" (the default of velocities and accelerations): straight lines, so that a trapezoid of rates is
            one. "spline" (the default of `pt.table`): twice differentiable cubics through samples of a smooth motion
            (two make a straight line, three a parabola), which overshoot where the samples turn abruptly.
        name: None: made from the joint's name.

    Derivatives of a function that are not given are computed exactly, by automatic differentiation, if f uses only
    arithmetic and NumPy functions. Other functions (`math.sin`, interpolators) are followed by polynomials in pieces,
    each as long as the values follow one to their own rounding or noise; pieces end where a derivative jumps and where
    the function is no longer defined. The position at every instant is the function's own value, and a note in the
    result reports the accuracy of the derivatives. The same applies to a pose: rotation vectors, quaternions and
    matrices are differentiated exactly, a SciPy `Rotation` is not.

    Raises:
        DescriptionError: the coordinate does not exist or is already driven; a given derivative contradicts the
            function.
        EvaluationError: the function returns anything but a finite number (here or during a run), or a run leaves the
            table.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("shaker")
    >>> table = m.add_body("table", mass=1.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, table, axis=(0, 1, 0))
    >>> m.add_drive(slide, position=lambda t: 0.01 * np.sin(20.0 * t)).name
    'drive of S'
    >>> half = lambda t: ((0, 0, 0.1 * np.sin(t)), (0, 0, np.pi * t))
    >>> m.add_drive(m.add_body("disc", mass=1.0, inertia=(1, 1, 1)), pose=half).name
    'drive of pose of disc'
    """
    if pose is not None:
        return _drive_pose(self, joint, pose, (position, velocity, acceleration), coordinate, rate, interpolation, name)
    drives = self._description.drives
    what = joint if isinstance(joint, Joint | str) else type(joint).__name__.lower()
    element = name_of("drive", name if name is not None else free_name(self, f"drive of {what}", drives), drives)
    level, course = _level(element, position, velocity, acceleration)
    if isinstance(joint, Joint | str):
        found = _coordinate(self, element, joint, coordinate, level)
    elif isinstance(joint, Body):
        element.fail(
            "a body has no single coordinate; give its pose (pose=...), or drive a joint or a measurement of it"
        )
    else:
        found = measure(self, element, joint)
    _alone(self, element, found)
    unit = measured_in(self, found)
    units = {"position": unit, "velocity": f"{unit or '1'}/s", "acceleration": f"{unit or '1'}/s^2"}
    start = number(element, "rate", rate, units["velocity"])
    if start != 0.0 and level != "acceleration":
        element.fail("rate is the initial rate of a prescribed acceleration; positions and velocities define their own")

    def wrap(function: Callable[..., Any]) -> Function:
        given = (velocity, acceleration) if level == "position" else (None, None)
        return Function(Motion(element, function, *given))

    _not_of_another_level(element, level, course, units)
    motion = scalar(element, level, course, BY_DEFAULT[level], wrap, ("s", units[level]), interpolation)
    if level == "position" and isinstance(motion, Table):
        _rates_continue(element, motion.curve)
    record = DriveRecord(element.name, found, motion, level, start, interpolation=interpolation)
    self._description.store(drives, record)
    self._description.driven[driven_key(found)] = element.name
    return Drive(element.name, self)


def _drive_pose(
    mechanism: Drawing,
    joint: Any,
    pose: Any,
    others: tuple[Any, ...],
    coordinate: int,
    rate: Quantity,
    interpolation: str | None,
    name: str | None,
) -> Drive:
    """A drive of all translations and of the spatial rotation of a joint, or of a body relative to the ground."""
    d = mechanism._description
    is_body = isinstance(joint, Body) or (isinstance(joint, str) and joint in d.bodies and joint not in d.joints)
    what = f"pose of {joint}" if is_body else joint if isinstance(joint, Joint | str) else type(joint).__name__.lower()
    default = free_name(mechanism, f"drive of {what}", d.drives)
    element = name_of("drive", default if name is None else name, d.drives)
    curve = interpolation_of(element, interpolation) or BY_DEFAULT["position"]
    _rates_continue(element, curve)
    if any(x is not None for x in others) or coordinate != 0 or rate != 0.0:
        element.fail("a pose prescribes all coordinates; omit position, velocity, acceleration, coordinate and rate")
    if is_body:
        body = resolve(mechanism, element, "the body", joint, ground=False)
        record = d.bodies[body]
        value = pose_value(element, pose, 3, (record.position, record.rotation), curve)
        arguments = {"joint": Ref("bodies", body), "pose": as_given(element, pose, 3)}
        carrier = free_name(mechanism, f"pose of {body}", d.joints)
        found, slides = add_free(mechanism, carrier, mechanism.ground, body).name, 3
        arguments["carrier"] = carrier
    elif isinstance(joint, Joint | str):
        driven = joint_record(mechanism, element, joint)
        slides = scalars(driven)
        if speeds(driven) != slides + 3 or any(item.startswith("r") for item in driven.free[:slides]):
            element.fail(
                f'the {driven.kind} joint "{driven.name}" does not rotate about all axes; a pose is for joints that do '
                f"(free, spherical, ...): drive its {speeds(driven)} coordinates one by one (coordinate=...)"
            )
        found = driven.name
        for i in range(slides + 3):
            _alone(mechanism, element, {"of": "joint", "joint": found, "coordinate": i})
        value = pose_value(element, pose, slides, None, curve)
        arguments = {"joint": found, "pose": as_given(element, pose, slides)}
    else:
        element.fail(f"a pose belongs to a joint or a body, not to {what}")
    measures = [{"of": "joint", "joint": found, "coordinate": i} for i in range(slides + 3)]
    arguments["interpolation"] = interpolation
    drive = DriveRecord(element.name, measures[0], value, "pose", 0.0, slides, interpolation, arguments)
    d.store(d.drives, drive)
    d.driven.update({driven_key(each): element.name for each in measures})
    return Drive(element.name, mechanism)


def _rates_continue(element: Element, curve: Curve) -> None:
    """Refuse positions on straight lines."""
    if curve == "linear":
        element.fail(
            "positions joined by straight lines have rates that jump at every sample, which no finite force can cause; "
            'use interpolation="monotone" or "spline", or give the velocity as a table'
        )


def driven_key(found: Mapping[str, Any]) -> str:
    """A measurement as text, by which existing drives are found."""
    return json.dumps(found, sort_keys=True)


def _alone(mechanism: Drawing, element: Element, found: dict[str, Any]) -> None:
    """Refuse a coordinate that is already driven."""
    if (other := mechanism._description.driven.get(driven_key(found))) is not None:
        driven = f'coordinate {found["coordinate"]} of joint "{found["joint"]}"' if found["of"] == "joint" else "it"
        element.fail(f'{driven} is already driven by "{other}"; remove one of them')


def _coordinate(
    mechanism: Drawing, element: Element, joint: Joint | str, coordinate: Any, level: str
) -> dict[str, Any]:
    """A coordinate; a spatial rotation has no position coordinate, but its angular velocities can be driven."""
    found = joint_record(mechanism, element, joint)
    single = scalars(found)
    if level == "position" and single < speeds(found) and not (isinstance(coordinate, int) and coordinate < single):
        element.fail(
            f'the {found.kind} joint "{found.name}" rotates about all axes, which no single coordinate describes; give '
            "its pose (pose=...), or drive its angular velocities (velocity=, acceleration=)"
        )
    number = coordinate_of(element, found, coordinate, speeds(found))
    return {"of": "joint", "joint": found.name, "coordinate": number}


def _not_of_another_level(element: Element, level: str, course: Any, units: dict[str, str]) -> None:
    """Refuse a text whose unit is that of another level: position="60 rpm"."""
    if not isinstance(course, str):
        return
    for other, unit in units.items():
        try:
            in_si(other, course, unit)
        except QuantityError:
            continue
        if other != level:
            element.fail(f"{level} is given as {course!r}, which has the unit of its {other}; give {other}={course!r}")
        return


def _level(element: Element, position: Any, velocity: Any, acceleration: Any) -> tuple[str, Any]:
    """The prescribed motion over time; derivatives belong to functions only, and are functions."""
    if position is None:
        if velocity is not None and acceleration is not None:
            element.fail(
                "give velocity or acceleration, not both, unless position is a function and they are its derivatives"
            )
        if velocity is not None:
            return "velocity", velocity
        if acceleration is not None:
            return "acceleration", acceleration
        element.fail("no motion is prescribed; give position, velocity or acceleration")
    for what, derivative in (("velocity", velocity), ("acceleration", acceleration)):
        if derivative is None:
            continue
        if not callable(position):
            element.fail(
                f"{what} can accompany position only if position is a function; a number or a table has its own "
                f"derivatives"
            )
        if not callable(derivative):
            element.fail(f"{what} must be a function of t, not {derivative!r}")
    return "position", position
