"""Plates: an outline in x and y, with holes, of some thickness along z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..numeric import is_list, is_quantity, shown
from ..tolerance import EQUAL
from ..units import Quantity
from . import given
from .polygons import area_of, crossing, distance, edges_meet, inside, moments_of
from .prism import circle, prism
from .shape import Array, Moments, Shape, Skin

Circle = tuple[tuple[float, float], float]
"""Centre and radius."""
Polygon = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Plate(Shape):
    """A flat plate in x and y with holes through it; z is across, 0 in the middle of its thickness.

    `outline` is a polygon, its corners (x, y) in order, or a circle ((x, y), radius); `holes` are any number of
    these. A polygon may run either way, and is closed from its last corner to its first.

    Raises `DescriptionError` for an outline that crosses itself or has no area, for a hole that is not inside the
    outline or meets another one, and for a thickness that is not positive.

    >>> import partita as pt
    >>> link = pt.shapes.Plate([(0, 0), (0.2, 0), (0.2, 0.03), (0, 0.03)], "4 mm", holes=[((0.015, 0.015), 0.006)])
    >>> round(link.volume * 1e9)
    23548
    """

    word: ClassVar[str] = "plate"
    outline: Polygon | Circle
    thickness: float
    holes: tuple[Polygon | Circle, ...] = ()

    if TYPE_CHECKING:

        def __init__(self, outline: Any, thickness: Quantity, holes: Sequence[Any] = ()) -> None: ...

    def __post_init__(self) -> None:
        thickness = given.length("Plate", "thickness", self.thickness)
        outline, holes = figures("Plate", self.outline, self.holes)
        for word, value in (("outline", outline), ("thickness", thickness), ("holes", holes)):
            object.__setattr__(self, word, value)

    def _moments(self) -> Moments:
        return of_prism(self.outline, self.holes, self.thickness)

    def _skin(self) -> Skin:
        return on_prism(self.outline, self.holes, self.thickness)

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        return in_prism(points, self.outline, self.holes, self.thickness, margin)


def figures(shape: str, outline: Any, holes: Any) -> tuple[Any, tuple[Any, ...]]:
    """An outline and the holes in it as tuples of numbers in SI, checked."""
    around = _figure(shape, "outline", outline)
    if not is_list(holes):
        given.fail(shape, f"holes must be a list of circles and polygons, not {shown(holes)}")
    found = tuple(_figure(shape, f"holes[{i}]", hole) for i, hole in enumerate(holes))
    boxes = np.array([_box(hole) for hole in found]).reshape(-1, 2, 2)
    for i, hole in enumerate(found):
        if not _within(hole, around):
            given.fail(shape, f"holes[{i}] is not inside the outline; what lies outside cannot be taken off")
        near = (boxes[:i, 0] <= boxes[i, 1]).all(axis=1) & (boxes[:i, 1] >= boxes[i, 0]).all(axis=1)
        for j in np.flatnonzero(near).tolist():
            if not _apart(hole, found[j]):
                given.fail(shape, f"holes[{j}] and holes[{i}] overlap; give one outline around both")
    return around, found


def of_prism(outline: Any, holes: tuple[Any, ...], thickness: float) -> Moments:
    """Of an outline with holes, from -thickness/2 to thickness/2."""
    parts = [(1.0, _flat(outline)), *((-1.0, _flat(hole)) for hole in holes)]
    area = sum(sign * own[0] for sign, own in parts)
    middle = sum((sign * own[0] * own[1] for sign, own in parts), np.zeros(2)) / area
    second = np.zeros((2, 2))
    for sign, (own_area, centroid, own) in parts:
        second = second + sign * (own + own_area * np.outer(centroid - middle, centroid - middle))
    volume, across = area * thickness, area * thickness**3 / 12.0
    inertia = np.zeros((3, 3))
    inertia[:2, :2] = thickness * (np.trace(second) * np.eye(2) - second) + across * np.eye(2)
    inertia[2, 2] = thickness * np.trace(second)
    return Moments(float(volume), np.array([*middle, 0.0]), inertia)


def on_prism(outline: Any, holes: tuple[Any, ...], thickness: float) -> Skin:
    """Triangles on it."""
    around = corners(outline)
    size = float(np.ptp(around, axis=0).max())
    return prism(around, [corners(hole, size) for hole in holes], thickness)


def in_prism(points: Array, outline: Any, holes: tuple[Any, ...], thickness: float, margin: float) -> NDArray[np.bool_]:
    """Whether points (n, 3) lie inside it, or outside by less than `margin`."""
    half = 0.5 * thickness
    found = np.abs(points[:, 2]) <= half + margin
    found &= _depth(points[:, :2], outline) >= -margin
    for hole in holes:
        found &= _depth(points[:, :2], hole) <= margin
    return np.asarray(found)


def corners(figure: Any, beside: float | None = None) -> Array:
    """Points (n, 2) of a polygon, or on a circle."""
    return circle(figure[0], figure[1], beside) if is_circle(figure) else np.array(figure, dtype=float)


def is_circle(figure: Any) -> bool:
    """Whether it is (centre, radius)."""
    if not isinstance(figure, tuple | list) or len(figure) != 2:
        return False
    return is_list(figure[0]) and (isinstance(figure[1], str) or is_quantity(figure[1]) or not is_list(figure[1]))


def _figure(shape: str, what: str, value: Any) -> Any:
    """A circle or a polygon that does not cross itself, as tuples of numbers in SI."""
    if is_circle(value):
        x, y = given.vector(shape, f"centre of {what}", value[0], 2)
        return (x, y), given.length(shape, f"radius of {what}", value[1])
    points = given.numbers(shape, what, value)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
        given.fail(
            shape,
            f"{what} must be a polygon of three or more corners (x, y), or a circle ((x, y), radius), not "
            f"{shown(value)}",
        )
    polygon(shape, what, points)
    return tuple((x, y) for x, y in points.tolist())


def polygon(shape: str, what: str, points: Array) -> None:
    """Refuse one that crosses itself or has no area."""
    spread = points - points.mean(axis=0)
    if np.linalg.svd(spread / (np.abs(spread).max() or 1.0), compute_uv=False)[1] <= EQUAL:
        given.fail(shape, f"{what} has no area: its corners lie on a line")
    double = np.flatnonzero((points == np.roll(points, -1, axis=0)).all(axis=1))
    if len(double):
        k = int(double[0])
        given.fail(
            shape, f"{what} has corner {k} twice in a row; it is closed by itself, so leave the last or the double out"
        )
    met = crossing(points)
    if met is not None:
        given.fail(
            shape,
            f"{what} crosses or touches itself: the edges from corner {met[0]} and from corner {met[1]} meet; give the "
            "corners in order around it",
        )


def _flat(figure: Any) -> tuple[float, Array, Array]:
    """Area, centroid, second moments about it."""
    if is_circle(figure):
        center, radius = figure
        return np.pi * radius**2, np.array(center), 0.25 * np.pi * radius**4 * np.eye(2)
    points = np.array(figure)
    return moments_of(points if area_of(points) > 0.0 else points[::-1])


def _depth(points: Array, figure: Any) -> Array:
    """Distance from the edge of points (n, 2), positive inside."""
    if is_circle(figure):
        center, radius = figure
        return np.asarray(radius - np.linalg.norm(points - np.array(center), axis=1))
    ring = np.array(figure)
    return np.where(inside(points, ring), 1.0, -1.0) * distance(points, ring)


def _box(figure: Any) -> tuple[Array, Array]:
    """Least and greatest coordinates."""
    if is_circle(figure):
        center, radius = figure
        return np.array(center) - radius, np.array(center) + radius
    points = np.array(figure)
    return points.min(axis=0), points.max(axis=0)


def _within(inner: Any, outer: Any) -> bool:
    """Whether a figure lies inside another without touching it."""
    if is_circle(inner):
        center, radius = inner
        return float(_depth(np.array([center]), outer)[0]) > radius
    points = np.array(inner)
    if bool((_depth(points, outer) <= 0.0).any()):
        return False
    return is_circle(outer) or not edges_meet(points, np.array(outer))


def _apart(a: Any, b: Any) -> bool:
    """Whether two figures have nothing in common."""
    if not is_circle(a):
        a, b = b, a
    if is_circle(a):
        center, radius = a
        return -float(_depth(np.array([center]), b)[0]) > radius
    one, two = np.array(a), np.array(b)
    return not (edges_meet(one, two) or inside(one[:1], two)[0] or inside(two[:1], one)[0])
