"""Measurements of a mechanism: coordinates of joints, distances, displacements, angles between axes.

Couplings, drives and user-defined constraints are given in terms of them. Wherever one is expected, a joint or its name
stands for its first coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..products import matmul, norm
from .bodies import resolve, to_world
from .checks import Array, Element, direction
from .drawing import Drawing
from .joints import coordinate_of, joint_record, scalars, unit_of
from .points import point_on
from .records import Body, Description, Joint

BodyLike = Body | str


@dataclass(frozen=True)
class Coordinate:
    """Coordinate number `coordinate` of a joint: a slide [m] or a turn [rad], zero in the drawn position.

    >>> import partita as pt
    >>> pt.Coordinate("A", 1)
    Coordinate(joint='A', coordinate=1)
    """

    joint: Joint | str
    coordinate: int = 0


@dataclass(frozen=True)
class Distance:
    """Distance [m] of a point of one body from a point of another; points in body axes, of the ground in the world.

    >>> import partita as pt
    >>> pt.Distance("ground", (0, 0, 0), "crane", (1, 0, 0)).body2
    'crane'
    """

    body1: BodyLike
    point1: ArrayLike
    body2: BodyLike
    point2: ArrayLike


@dataclass(frozen=True)
class Along:
    """Displacement [m] of a point of the second body from a point of the first, along an axis fixed on the first.

    >>> import partita as pt
    >>> pt.Along("ground", (0, 0, 0), (0, 1, 0), "hook", (0, 0, 0)).axis
    (0, 1, 0)
    """

    body1: BodyLike
    point1: ArrayLike
    axis: ArrayLike
    body2: BodyLike
    point2: ArrayLike


@dataclass(frozen=True)
class Cosine:
    """Cosine of the angle between an axis of one body and an axis of another, each in body axes.

    >>> import partita as pt
    >>> pt.Cosine("ground", (0, 0, 1), "wheel", (0, 0, 1)).body1
    'ground'
    """

    body1: BodyLike
    axis1: ArrayLike
    body2: BodyLike
    axis2: ArrayLike


Measure = Coordinate | Distance | Along | Cosine
Spec = dict[str, Any]
_UNIT_LENGTH = 1e-15
"""A direction whose length differs from one by less is a unit vector. Scale: 1. Reason: some units in the last place,
which a division would change."""


def measure(mechanism: Drawing, element: Element, value: Any) -> Spec:
    """A measure as plain data; a joint or its name is its first coordinate, a dict is plain data already."""
    if isinstance(value, dict):
        value = _from_dict(element, value)
    match value:
        case Coordinate(joint, coordinate):
            found = joint_record(mechanism, element, joint)
            number = coordinate_of(element, found, coordinate, scalars(found))
            return {"of": "joint", "joint": found.name, "coordinate": number}
        case Distance(body1, point1, body2, point2):
            ends = {"body1": body1, "point1": point1, "body2": body2, "point2": point2}
            return {"of": "distance", **_ends(mechanism, element, ends)}
        case Along(body1, point1, axis, body2, point2):
            ends = {"body1": body1, "point1": point1, "axis": axis, "body2": body2, "point2": point2}
            return {"of": "along", **_ends(mechanism, element, ends)}
        case Cosine(body1, axis1, body2, axis2):
            ends = {"body1": body1, "axis1": axis1, "body2": body2, "axis2": axis2}
            return {"of": "cosine", **_ends(mechanism, element, ends)}
        case Joint() | str():
            return measure(mechanism, element, Coordinate(value))
    element.fail(
        f"{value!r} cannot be measured; give a joint or its name, pt.Coordinate(joint, "
        "number), pt.Distance, pt.Along or pt.Cosine"
    )


def drawn(mechanism: Drawing, spec: Spec) -> float:
    """The value of a measure as drawn."""
    return valued(mechanism._description, spec)


def valued(d: Description, spec: Mapping[str, Any]) -> float:
    """The same, of a description."""
    if spec["of"] == "joint":
        return 0.0
    if spec["of"] == "cosine":
        axes = [
            to_world(d, spec[f"body{i}"], np.array(spec[f"axis{i}"])) - to_world(d, spec[f"body{i}"], np.zeros(3))
            for i in (1, 2)
        ]
        return float(matmul(axes[0], axes[1]))
    ends = [to_world(d, spec[f"body{i}"], np.array(spec[f"point{i}"])) for i in (1, 2)]
    gap = ends[1] - ends[0]
    if spec["of"] == "distance":
        return float(norm(gap))
    axis = to_world(d, spec["body1"], np.array(spec["axis"])) - to_world(d, spec["body1"], np.zeros(3))
    return float(matmul(axis, gap))


def measured_in(mechanism: Drawing, spec: Spec) -> str:
    """Unit of a measure; "" of a cosine."""
    return measure_unit(mechanism._description, spec)


def measure_unit(description: Description, spec: Mapping[str, Any]) -> str:
    """The same, of a description."""
    if spec["of"] == "joint":
        return unit_of(description.joints[spec["joint"]], spec["coordinate"])
    return "" if spec["of"] == "cosine" else "m"


def unit_vector(axis: Array) -> Array:
    """`axis` with length 1. One that has it to round-off is unchanged, so that repeating the call changes no bit."""
    length = float(norm(axis))
    return axis if abs(length - 1.0) <= _UNIT_LENGTH else np.asarray(axis / length)


def _ends(mechanism: Drawing, element: Element, values: dict[str, Any]) -> Spec:
    """Bodies by name, points and unit axes as lists."""
    found: Spec = {}
    for key, value in values.items():
        if key.startswith("body"):
            found[key] = resolve(mechanism, element, key, value)
        elif key.startswith("point"):
            found[key] = point_on(mechanism, element, key, value, found[f"body{key[5:]}"]).tolist()
        else:
            axis = direction(element, key, value)
            found[key] = unit_vector(axis).tolist()
    if found["body1"] == found["body2"]:
        element.fail(f'its two bodies are both "{found["body1"]}"; name two different ones')
    return found


_KINDS = {"joint": Coordinate, "distance": Distance, "along": Along, "cosine": Cosine}


def _from_dict(element: Element, value: dict[str, Any]) -> Any:
    kind = value.get("of", "joint")
    if kind not in _KINDS:
        element.fail(f"a measure is of {', '.join(_KINDS)}, not {kind!r}")
    try:
        return _KINDS[kind](**{key: item for key, item in value.items() if key != "of"})
    except TypeError as error:
        element.fail(f"the measure {value!r} does not fit: {error}", cause=error)
