"""What all shapes have: volume, centroid, inertia; positions; sums and holes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numeric import shown
from ..products import matmul
from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS
from . import given

Array = NDArray[np.float64]


class Moments(NamedTuple):
    """Of a shape of density 1."""

    volume: float
    centroid: Array  # (3,)
    inertia: Array  # (3, 3) about the centroid


class Skin(NamedTuple):
    """Triangles on the surface, whose corners lie on it, in order around the outward normal."""

    points: Array  # (n, 3)
    faces: NDArray[np.int_]  # (m, 3)


class Shape(ABC):
    """A shape: a value that never changes, equal to another of the same sizes.

    Its axes are those of the body that `m.add_solid` makes of it, its origin is that body's origin.
    """

    word: ClassVar[str]

    @property
    def volume(self) -> float:
        """[m^3]"""
        return self._kept.volume

    @property
    def centroid(self) -> Array:
        """Centre of mass (3,) in the axes of the shape, from its origin [m]."""
        return self._kept.centroid

    @property
    def inertia(self) -> Array:
        """Inertia (3, 3) per unit density about the centroid, in the axes of the shape [m^5]: times a density [kg/m^3]
        it is that of a body [kg m^2]."""
        return self._kept.inertia

    def at(self, position: ArrayLike = (0.0, 0.0, 0.0), orientation: Any = None) -> Sum:
        """This shape with its origin at another position [m] and its axes turned, as a part of a sum.

        Args:
            position: of its origin in the axes of the sum [m].
            orientation: its axes in those of the sum: None (parallel), a 3x3 rotation whose columns are these axes, a
                quaternion (w, x, y, z) of any length, or a SciPy `Rotation`.

        Raises `DescriptionError` where a number is impossible.

        >>> import partita as pt
        >>> ball = pt.shapes.Sphere(0.1)
        >>> dumbbell = ball.at((0.3, 0, 0)) + ball.at((-0.3, 0, 0))
        >>> dumbbell.volume == 2 * ball.volume, dumbbell.centroid.tolist()
        (True, [0.0, 0.0, 0.0])
        """
        name = type(self).__name__
        place = np.array(given.vector(name, "position", position))
        turn = np.array(given.rotation(name, "orientation", orientation))
        parts = tuple(
            Part(
                part.shape,
                tuple((place + matmul(turn, np.array(part.position))).tolist()),
                _rows(matmul(turn, np.array(part.orientation))),
                part.hole,
            )
            for part in self._parts()
        )
        return _sum(parts, ())

    def __add__(self, other: object) -> Sum:
        """Both: what two parts have in common counts twice."""
        return _sum(self._parts(), other._parts()) if isinstance(other, Shape) else NotImplemented

    def __sub__(self, other: object) -> Sum:
        """This shape without another, which must lie inside it."""
        if not isinstance(other, Shape):
            return NotImplemented
        holes = (Part(part.shape, part.position, part.orientation, not part.hole) for part in other._parts())
        return _sum(self._parts(), tuple(holes))

    def _parts(self) -> tuple[Part, ...]:
        return (Part(self),)

    @cached_property
    def _kept(self) -> Moments:
        found = self._moments()
        for array in (found.centroid, found.inertia):
            array.setflags(write=False)
        return found

    @cached_property
    def skin(self) -> Skin:
        """Triangles on the surface, for pictures."""
        return _skin_of(self)

    @cached_property
    def samples(self) -> Array:
        """Points (n, 3) on the surface: the corners of its `skin`, and middles of edges that lie on it."""
        points, faces = self.skin
        middles = 0.5 * (points[faces] + points[np.roll(faces, -1, axis=1)]).reshape(-1, 3)
        margin = EQUAL * float(np.ptp(points, axis=0).max())
        on = self.contains(middles, margin) & ~self.contains(middles, -margin)
        return np.concatenate([points, middles[on]])

    @cached_property
    def radius_about_centroid(self) -> float:
        """Of a ball about the centroid that contains its `skin` [m]."""
        return float(np.linalg.norm(self.skin.points - self.centroid, axis=1).max())

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest coordinates (3,) of the corners of its `skin` [m]."""
        return self.skin.points.min(axis=0), self.skin.points.max(axis=0)

    @abstractmethod
    def _moments(self) -> Moments:
        """The closed forms."""

    @abstractmethod
    def _skin(self) -> Skin:
        """Triangles on the surface."""

    @abstractmethod
    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""


_UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Part:
    """A shape in a sum, made by `Shape.at`: `orientation` are the rows of the matrix whose columns are its axes; a
    `hole` is taken off."""

    shape: Shape
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[tuple[float, ...], ...] = _UPRIGHT
    hole: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Shape) or isinstance(self.shape, Sum):
            given.fail("Sum", f"a part must be a shape that is no sum itself, not {shown(self.shape)}")
        object.__setattr__(self, "position", given.vector("Sum", "position", self.position))
        object.__setattr__(self, "orientation", given.rotation("Sum", "orientation", self.orientation))

    def placed(self, points: Array) -> Array:
        """Points (n, 3) of the shape in the axes of the sum."""
        return matmul(points, np.array(self.orientation).T) + np.array(self.position)

    def back(self, points: Array) -> Array:
        """Points (n, 3) of the sum in the axes of the shape."""
        return matmul(points - np.array(self.position), np.array(self.orientation))


@dataclass(frozen=True)
class Sum(Shape):
    """Shapes at positions, with holes: `a + b.at(position) - c`. What two parts have in common counts twice; a hole
    must lie inside one part.

    Raises `DescriptionError` for a hole that leaves its part, and where nothing remains.

    >>> import partita as pt
    >>> block = pt.shapes.Box((0.1, 0.06, 0.02))
    >>> drilled = block - pt.shapes.Cylinder(0.01, 0.02).at((0.03, 0, 0))
    >>> print(f"{drilled.volume / block.volume:.6f} {drilled.centroid[0]:.6f}")
    0.947640 -0.001658
    """

    word: ClassVar[str] = "sum"
    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.parts, tuple) or not all(isinstance(part, Part) for part in self.parts):
            given.fail("Sum", f"it is made of shapes by +, - and at, not of {shown(self.parts)}")
        self._check(0)

    def _check(self, checked: int) -> None:
        """Refuse what cannot be; so many parts have been together in a sum."""
        solid = [part for part in self.parts if not part.hole]
        if not solid:
            given.fail("Sum", "it has holes only; the first shape is what they are taken from")
        for part in self.parts[checked:]:
            if part.hole:
                _check_inside(part, solid)
        known = sum(part.hole for part in self.parts[:checked])
        _check_apart([part for part in self.parts if part.hole], known)
        volume, _, inertia = self._kept
        if volume <= EQUAL * sum(part.shape.volume for part in solid):
            given.fail("Sum", "nothing remains: its holes are as large as its parts")
        small, middle, large = np.linalg.eigvalsh(inertia / np.abs(inertia).max()).tolist()
        if min(small, small + middle - large) < -EQUAL_IN_SIX_DIGITS:
            given.fail("Sum", "no body has this inertia: holes have been taken twice from the same place")

    def _parts(self) -> tuple[Part, ...]:
        return self.parts

    def _moments(self) -> Moments:
        volume, first = 0.0, np.zeros(3)
        centroids = []
        for part in self.parts:
            centroids.append(part.placed(part.shape.centroid[None])[0])
            signed = -part.shape.volume if part.hole else part.shape.volume
            volume += signed
            first = first + signed * centroids[-1]
        if not abs(volume) > 0.0:
            return Moments(0.0, first, np.zeros((3, 3)))
        middle = first / volume
        inertia = np.zeros((3, 3))
        for part, centroid in zip(self.parts, centroids, strict=True):
            turn, sign = np.array(part.orientation), -1.0 if part.hole else 1.0
            own = matmul(matmul(turn, part.shape.inertia), turn.T)
            inertia = inertia + sign * (own + part.shape.volume * steiner(centroid - middle))
        return Moments(volume, middle, 0.5 * (inertia + inertia.T))

    def _skin(self) -> Skin:
        points, faces, count = [], [], 0
        for part in self.parts:
            if not part.hole:
                own = part.shape.skin
                points.append(part.placed(own.points))
                faces.append(own.faces + count)
                count += len(own.points)
        return Skin(np.concatenate(points), np.concatenate(faces))

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        inside = np.zeros(len(points), dtype=bool)
        for part in self.parts:
            if not part.hole:
                inside |= part.shape.contains(part.back(points), margin)
        for part in self.parts:
            if part.hole:
                inside &= ~part.shape.contains(part.back(points), -margin)
        return inside


@lru_cache(maxsize=256)
def _skin_of(shape: Shape) -> Skin:
    """The same for equal shapes."""
    return shape._skin()


def _sum(first: tuple[Part, ...], second: tuple[Part, ...]) -> Sum:
    """Parts that are a sum already, with further ones: only these are checked."""
    found = object.__new__(Sum)
    object.__setattr__(found, "parts", (*first, *second))
    found._check(len(first))
    return found


def _check_inside(hole: Part, solid: list[Part]) -> None:
    """Refuse a hole that is not inside a part."""
    points = hole.placed(hole.shape.samples)
    for part in solid:
        margin = EQUAL * _radius(part)
        if part.shape.contains(part.back(points), margin).all():
            own = hole.back(part.placed(part.shape.samples))  # a bore of the part within the hole
            if not hole.shape.contains(own, -margin).any():
                return
    given.fail(
        "Sum",
        f"{_called(hole)} is not inside one of its parts, and what lies outside cannot be taken off; make a hole that "
        "goes through as long as the part is thick",
    )


def _check_apart(holes: list[Part], known: int) -> None:
    """Refuse holes that overlap, as far as corners of one lie in another; so many are known not to."""
    centers = np.array([part.placed(part.shape.centroid[None])[0] for part in holes]).reshape(-1, 3)
    radii = np.array([_radius(part) for part in holes])
    for i, hole in list(enumerate(holes))[known:]:
        near = np.flatnonzero(np.linalg.norm(centers[:i] - centers[i], axis=1) < radii[:i] + radii[i])
        for other in (holes[k] for k in near):
            for one, two in ((hole, other), (other, hole)):
                own = two.back(one.placed(np.vstack([one.shape.samples, one.shape.centroid])))
                if two.shape.contains(own, -EQUAL * _radius(two)).any():
                    given.fail("Sum", f"{_called(other)} and {_called(hole)} overlap, and would be taken off twice")


def _radius(part: Part) -> float:
    """Of a ball about the centroid that contains the shape."""
    return part.shape.radius_about_centroid


def _called(hole: Part) -> str:
    place = ", ".join(f"{x:g}" for x in hole.position)
    return f"the hole {type(hole.shape).__name__} at ({place})"


def steiner(offset: Array) -> Array:
    """Inertia (3, 3) of a unit mass at an offset."""
    return float(offset @ offset) * np.eye(3) - np.outer(offset, offset)


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in matrix.tolist())
