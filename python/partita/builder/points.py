"""Points given by the user: plain numbers, or a `Point` that says on which body it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..products import matmul, norm
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .bodies import to_world
from .checks import Array, Element, vector
from .drawing import Drawing
from .records import GROUND, BodyRecord, Description, ForceRecord, LoadRecord, Point

OUTSIDE = 0.25
"""A point farther from its body lies outside of it. Scale: fraction of the body's extent. Reason: pins stand out by
less."""


def point_on(mechanism: Drawing, element: Element, what: str, value: Any, body: str) -> Array:
    """A point in the axes of `body` [m] (of the world for the ground)."""
    explicit, key = mechanism._description.explicit, (element.kind, element.name, what)
    if not isinstance(value, Point):
        explicit.pop(key, None)
        return vector(element, what, value, "m")
    if value.body != body:
        element.fail(
            f'{what} is a point of "{value.body}", but the body beside it is "{body}"; give a point of "{body}"'
        )
    explicit[key] = True
    return np.array(value.coordinates)


def point_in_world(mechanism: Drawing, element: Element, what: str, value: Any) -> Array:
    """A point in the world of the drawing [m]."""
    if not isinstance(value, Point):
        return vector(element, what, value, "m")
    known = mechanism._description.bodies
    if value.body != GROUND and value.body not in known:
        element.fail(f'{what} is a point of "{value.body}", which is no body of this mechanism')
    return to_world(mechanism._description, value.body, np.array(value.coordinates))


class _Given(NamedTuple):
    """A point in body axes, as it was given."""

    kind: str
    name: str
    what: str
    body: str
    point: Array


def misplaced(d: Description) -> list[str]:
    """Remarks on points that lie outside their body and would lie on it if they were points of the world."""
    extents: dict[str, tuple[Array, Array]] = {}
    size = _size(d)
    joints = _joints_of(d)
    found = []
    for given in _given(d):
        if given.body == GROUND or (given.kind, given.name, given.what) in d.explicit:
            continue
        record = d.bodies[given.body]
        other = matmul(record.rotation.T, given.point - record.position)
        if max(abs(x) for x in (other - given.point).tolist()) <= EQUAL_IN_SIX_DIGITS * size:
            continue
        if given.body not in extents:
            extents[given.body] = _extent(record, joints.get(given.body, ()))
        low, high = extents[given.body]
        inside = EQUAL_IN_SIX_DIGITS * size
        if _away(given.point, low, high) > OUTSIDE * float(norm(high - low)) + inside and (
            _away(other, low, high) <= inside
        ):
            x = f"({', '.join(f'{c:g}' for c in given.point)})"
            found.append(
                f'{given.kind} "{given.name}": {given.what} {x} is in the axes of "{given.body}", where it lies '
                f"outside of the body; as a point of the world it would lie on it: if that is meant, give "
                f'm.bodies["{given.body}"].world({x}), else .at({x})'
            )
    return found


def as_given(d: Description) -> None:
    """Take all points as they are given, as in a file that was written from a mechanism: it knew on which bodies they
    are."""
    d.explicit.update({(given.kind, given.name, given.what): True for given in _given(d)})


def _size(d: Description) -> float:
    points = [body.position for body in d.bodies.values()]
    points += [body.to_world(body.com) for body in d.bodies.values()]
    points += [joint.point for joint in d.joints.values() if joint.point is not None]
    return norm(np.ptp(np.array(points), axis=0)) if points else 0.0


def _joints_of(d: Description) -> dict[str, list[Array]]:
    """Points in the world of the joints on each body."""
    found: dict[str, list[Array]] = {}
    for joint in d.joints.values():
        if joint.point is not None:
            found.setdefault(joint.parent, []).append(joint.point)
            found.setdefault(joint.child, []).append(joint.point if joint.child_point is None else joint.child_point)
    return found


def _extent(record: BodyRecord, joints: Sequence[Array]) -> tuple[Array, Array]:
    """The box, in body axes, around the centre of mass, the ends of a rod, a shape, and the joints."""
    points = [record.com, *(matmul(record.rotation.T, point - record.position) for point in joints)]
    if record.rod is not None:
        points += [np.zeros(3), np.array([record.rod[2], 0.0, 0.0])]
    if record.solid is not None:
        points += record.solid.shape.bounds
    return np.min(points, axis=0), np.max(points, axis=0)


def _away(point: Array, low: Array, high: Array) -> float:
    """Distance from a box."""
    return float(norm(np.maximum(0.0, np.maximum(low - point, point - high))))


def _given(d: Description) -> Iterator[_Given]:
    """All points in body axes."""
    for force in d.forces.values():
        if isinstance(force, ForceRecord) and not force.at_center:
            yield _Given("force", force.name, "point", force.body, force.point)
        elif isinstance(force, LoadRecord) and force.kind != "bushing":  # drawn in the world
            yield from _pairs("force", force.name, force.means)
    for coupling in d.couplings.values():
        for term in coupling.terms:
            yield from _pairs("coupling", coupling.name, term)
        yield from _pairs("coupling", coupling.name, coupling.data)
    for sensor in d.sensors.values():
        data = sensor.data
        if data["of"] == "point":
            yield _Given("sensor", sensor.name, "the point", data["body"], np.array(data["point"]))
        elif data["of"] == "measure":
            yield from _pairs("sensor", sensor.name, data["measure"])


_PAIRS = (("body1", "point1"), ("body2", "point2"), ("body", "center"), ("on", "point"), ("ground", "point"))


def _pairs(kind: str, name: str, data: Any) -> Iterator[_Given]:
    """Points beside their bodies in the data of an element."""
    for body, what in _PAIRS:
        if isinstance(data.get(body), str) and what in data and data[what] is not None:
            yield _Given(kind, name, what, data[body], np.array(data[what], dtype=float))
