"""Every array of a result with its axes and units: one list from which all writers of files work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..naming import column_names, coordinate_axes, coordinate_units, joint_units
from ..result_view import MotionView, ResultView
from .joint import COMPONENTS
from .source import Arrays


@dataclass(frozen=True)
class Variable:
    """An array, the names of its axes, its unit ("" where columns differ, see the axis) and its description."""

    name: str
    values: NDArray[Any]
    axes: tuple[str, ...]
    unit: str
    text: str


@dataclass(frozen=True)
class Axis:
    """Labels along an axis and, where its entries differ in kind, the unit of each."""

    name: str
    labels: tuple[str, ...]
    units: tuple[str, ...] = ()


# name: (axes after time, unit, text)
RUN: dict[str, tuple[tuple[str, ...], str, str]] = {
    "t": ((), "s", "time"),
    "q": (("coordinate",), "", "coordinates; units along the axis `coordinate`"),
    "v": (("velocity",), "", "velocities; units along the axis `velocity`"),
    "vdot": (("velocity",), "", "accelerations; units of `velocity` per second"),
    "multipliers": (("multiplier",), "", "lambda in M vdot = h + C^T lambda; N for lengths, N m for angles"),
    "measure": (("velocity",), "1", "projective measure rho: 1 = not restricted by the loops, 0 = locked"),
    "independent": (("choice",), "1", "indices along `velocity` (from 0) of the independent coordinates"),
    "selector": (("choice", "velocity"), "", "S of the tangent velocities u = S v, frozen or of a tangent chart"),
    "closure": ((), "", "largest closure error of the constraints, m or rad"),
    "velocity_closure": ((), "", "largest closure error in velocities, m/s or rad/s"),
    "sigma": ((), "", "quality of the choice of independent coordinates, small near singular positions"),
    "sqrt_mu": ((), "", "quality of the choice in the mass metric"),
    "kinetic": ((), "J", "kinetic energy"),
    "potential": ((), "J", "potential energy of gravity and springs"),
    "work": ((), "J", "work of dampers, torques, forces and drives since the run began"),
}

OBSERVED: dict[str, tuple[tuple[str, ...], str, str]] = {
    "body_position": (("body", "axis"), "m", "origin of the body, world axes"),
    "body_rotation": (("body", "axis", "body_axis"), "1", "columns are the axes of the body in the world"),
    "body_velocity": (("body", "axis"), "m/s", "velocity of the origin of the body, world axes"),
    "body_angular_velocity": (("body", "axis"), "rad/s", "angular velocity of the body, world axes"),
    "joint_position": (("joint_coordinate",), "", "coordinates of all joints, cut ones too; zero as drawn"),
    "joint_velocity": (("joint_freedom",), "", "velocities of all joints, cut ones too"),
    "joint_point": (("joint", "axis"), "m", "point of the joint on its child body, world axes"),
}

ACCELERATIONS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "joint_acceleration": (("joint_freedom",), "", "accelerations of all joints; units of `joint_freedom` per second"),
}

REACTIONS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "force": (("joint", "axis"), "N", "force of the joint on its child body, world axes"),
    "moment": (("joint", "axis"), "N m", "moment of the joint on its child body about joint_point, world axes"),
    "drive": (("joint_freedom",), "", "effort of the drive along each degree of freedom: N, or N m for rotations"),
    "joint_rotation": (("joint", "axis", "joint_axis"), "1", "columns are the axes of the joint in the world"),
    "residual": ((), "1", "largest Newton-Euler residual of a body over the largest force"),
    "residuals": (("body",), "1", "Newton-Euler residual of each body over the largest force"),
    "effort": (("condition",), "", "efforts of couplings and drives that belong to the reactions, N or N m"),
}

CHECKS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "acceleration_closure": ((), "", "largest closure error in accelerations, m/s^2 or rad/s^2"),
    "acceleration_row": ((), "1", "its index along `multiplier` (from 0)"),
    "closure_row": ((), "1", "index along `multiplier` (from 0) of the constraint with the largest closure error"),
    "rank": ((), "1", "independent constraints"),
    "margin": (
        (),
        "1",
        "smallest squared sine between an accepted constraint and the others; 0 in a singular position",
    ),
}

DETERMINED = {
    "determined_world": "1 where the component is unique, world axes",
    "determined_joint": "1 where the component is unique, axes of the joint",
}


def variables(result: ResultView) -> list[Variable]:
    """All arrays of `result`, bodies and reactions included. Arrays the run does not have are left out."""
    nt = len(result.t)
    found = [v for v in _over_time(RUN, result.arrays) if len(v.values) == nt]
    if result.is_mechanism:
        found += _over_time(OBSERVED, result.at_once.observed) + _over_time(REACTIONS, result.at_once.reactions)
        found += _over_time(ACCELERATIONS, {"joint_acceleration": result.at_once.joint_accelerations})
        found += _over_time(CHECKS, result.at_once.checks)
        flags = zip(DETERMINED.items(), result.at_once.determined, strict=True)
        found += [Variable(name, a, ("t", "joint", "component"), "1", text) for (name, text), a in flags]
        text = "1 where the effort of the drive along the degree of freedom is unique"
        found.append(Variable("determined_drive", result.at_once.determined_drive, ("t", "joint_freedom"), "1", text))
        text = "1 where the effort is unique"
        found.append(Variable("determined_effort", result.at_once.determined_efforts, ("t", "condition"), "1", text))
        found += [variable for variable, _ in sensors(result)]
    return found


def sensors(result: MotionView) -> list[tuple[Variable, Axis | None]]:
    """Readings of sensors, each with an axis of its own where its columns are not x, y, z."""
    found: list[tuple[Variable, Axis | None]] = []
    for item in result.summary.get("sensors", ()):
        read, own = result.sensor(item["name"]), None
        along: tuple[str, ...] = ()
        if read.values.ndim == 3:
            along = ("axis", "body_axis")
        elif read.values.ndim == 2 and read.values.shape[1] == 3:
            along = ("axis",)
        elif read.values.ndim == 2:
            own = Axis(f"{item['variable']}_component", tuple(str(i) for i in range(read.values.shape[1])))
            along = (own.name,)
        found.append(
            (Variable(item["variable"], read.values, ("t", *along), read.unit, f"{item['name']}: {read.text}"), own)
        )
    return found


def units(result: ResultView) -> dict[str, str | tuple[str, ...]]:
    """Unit of every array by its name; where columns differ, one for each. Nothing is computed for it."""
    tables = [RUN] if not result.is_mechanism else [RUN, OBSERVED, ACCELERATIONS, REACTIONS, CHECKS]
    columns = _own_axes(result)
    found: dict[str, str | tuple[str, ...]] = {}
    for name, (along, unit, _) in ((name, entry) for table in tables for name, entry in table.items()):
        own = columns[along[0]].units if along and not unit else ()
        if name in ("vdot", "joint_acceleration"):
            own = tuple(f"{u}^2" if u else "" for u in own)  # "m/s" to "m/s^2"
        if name == "drive":
            own = tuple("N" if u.startswith("m") else "N m" for u in own)
        found[name] = own or unit
    found.update({item["variable"]: item["unit"] for item in result.summary.get("sensors", ())})
    return found


def of_motion(motion: MotionView) -> list[Variable]:
    """Coordinates, bodies, joints and sensors over time, without what needs forces."""
    states = {name: RUN[name] for name in ("q", "v", "vdot")}
    return [
        *_over_time(states, {"q": motion.q, "v": motion.v, "vdot": motion.vdot}),
        *_over_time(OBSERVED, motion.at_once.observed),
        *_over_time(ACCELERATIONS, {"joint_acceleration": motion.at_once.joint_accelerations}),
        *(variable for variable, _ in sensors(motion)),
    ]


def _over_time(table: dict[str, tuple[tuple[str, ...], str, str]], arrays: Arrays) -> list[Variable]:
    return [
        Variable(name, arrays[name], ("t", *axes), unit, text)
        for name, (axes, unit, text) in table.items()
        if name in arrays
    ]


def axes(result: ResultView) -> dict[str, Axis]:
    """Labels of every axis the variables use, except time."""
    found = _own_axes(result)
    if result.is_mechanism:
        found.update({axis.name: axis for _, axis in sensors(result) if axis is not None})
    return found


def _own_axes(result: ResultView) -> dict[str, Axis]:
    """Those of a run itself, for which no sensor is read."""
    names = result.names
    listed = [
        Axis("multiplier", names.multipliers),
        Axis("condition", names.multipliers[int(result.summary.get("closing_rows", 0)) :]),
        Axis("choice", tuple(str(i) for i in range(result.independent.shape[1]))),
    ]
    return {**axes_of_motion(result), **{axis.name: axis for axis in listed}}


def axes_of_motion(motion: MotionView) -> dict[str, Axis]:
    """Axes of what has bodies and joints, with or without forces."""
    names = motion.names
    q_units, v_units = coordinate_units(motion.summary, names)
    q_labels, q_kinds, v_labels, v_kinds = _joint_axes(motion)
    xyz = ("x", "y", "z")
    listed = [
        Axis("coordinate", names.coordinates, tuple(q_units)),
        Axis("velocity", names.velocities, tuple(v_units)),
        Axis("body", names.bodies),
        Axis("joint", names.joints),
        Axis("joint_coordinate", tuple(q_labels), tuple(q_kinds)),
        Axis("joint_freedom", tuple(v_labels), tuple(f"{u}/s" for u in v_kinds)),
        Axis("axis", xyz),
        Axis("body_axis", xyz),
        Axis("joint_axis", xyz),
        Axis("component", COMPONENTS),
    ]
    return {axis.name: axis for axis in listed}


def _joint_axes(result: MotionView) -> tuple[list[str], list[str], list[str], list[str]]:
    """Labels and units of the columns of joint_position and joint_velocity."""
    q_labels: list[str] = []
    q_units: list[str] = []
    v_labels: list[str] = []
    v_units: list[str] = []
    for joint in result.summary.get("joints", ()):
        qs, vs = joint_units(joint)
        q_units += qs
        v_units += vs
        words = list(joint.get("axes", ()))
        v_labels += column_names(joint["name"], words, len(vs))
        q_labels += column_names(joint["name"], coordinate_axes(joint), len(qs))
    return q_labels, q_units, v_labels, v_units
