"""Discs, cylinders, balls and boxes: their axis is z, their origin their centre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..units import Quantity
from . import given
from .prism import circle, prism
from .shape import Array, Moments, Shape, Skin

ROWS = 24
"""Rows of triangles from pole to pole of a ball."""


@dataclass(frozen=True)
class Disc(Shape):
    """A flat cylinder, its axis along z, its origin at its centre.

    Raises `DescriptionError` for a size that is not positive.

    >>> import partita as pt
    >>> disc = pt.shapes.Disc(radius=0.1, thickness="10 mm")
    >>> print(f"{disc.inertia[2, 2] / (disc.volume * 0.1**2 / 2):.9f}")
    1.000000000
    """

    word: ClassVar[str] = "disc"
    radius: float
    thickness: float

    if TYPE_CHECKING:

        def __init__(self, radius: Quantity, thickness: Quantity) -> None: ...

    def __post_init__(self) -> None:
        for what in ("radius", "thickness"):
            object.__setattr__(self, what, given.length("Disc", what, getattr(self, what)))

    def _moments(self) -> Moments:
        return _round(self.radius, 0.0, self.thickness)

    def _skin(self) -> Skin:
        return prism(circle((0.0, 0.0), self.radius), [], self.thickness)

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        return _in_round(points, self.radius, 0.0, self.thickness, margin)


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder or a tube, its axis along z, its origin at its centre.

    Raises `DescriptionError` for a size that is not positive, and a bore that is as wide as the cylinder.

    >>> import partita as pt
    >>> tube = pt.shapes.Cylinder(radius="20 mm", length="0.3 m", inner_radius="15 mm")
    >>> round(2700 * tube.volume, 6)
    0.445321
    """

    word: ClassVar[str] = "cylinder"
    radius: float
    length: float
    inner_radius: float = 0.0

    if TYPE_CHECKING:

        def __init__(self, radius: Quantity, length: Quantity, inner_radius: Quantity = 0.0) -> None: ...

    def __post_init__(self) -> None:
        for what in ("radius", "length", "inner_radius"):
            value = given.length("Cylinder", what, getattr(self, what), zero=what == "inner_radius")
            object.__setattr__(self, what, value)
        if self.inner_radius >= self.radius:
            given.fail(
                "Cylinder",
                f"inner_radius is {self.inner_radius:g} m and radius {self.radius:g} m: it must be smaller, or "
                "nothing remains",
            )

    def _moments(self) -> Moments:
        return _round(self.radius, self.inner_radius, self.length)

    def _skin(self) -> Skin:
        bore = [circle((0.0, 0.0), self.inner_radius)] if self.inner_radius else []
        return prism(circle((0.0, 0.0), self.radius), bore, self.length)

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        return _in_round(points, self.radius, self.inner_radius, self.length, margin)


@dataclass(frozen=True)
class Sphere(Shape):
    """A ball, its origin at its centre.

    Raises `DescriptionError` for a radius that is not positive.

    >>> import partita as pt
    >>> round(1000 * pt.shapes.Sphere("10 cm").volume, 6)
    4.18879
    """

    word: ClassVar[str] = "sphere"
    radius: float

    if TYPE_CHECKING:

        def __init__(self, radius: Quantity) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", given.length("Sphere", "radius", self.radius))

    def _moments(self) -> Moments:
        volume = 4.0 / 3.0 * np.pi * self.radius**3
        return Moments(volume, np.zeros(3), 0.4 * volume * self.radius**2 * np.eye(3))

    def _skin(self) -> Skin:
        polar = np.linspace(0.0, np.pi, ROWS + 1)[1:-1]
        around = np.linspace(0.0, 2.0 * np.pi, 2 * ROWS + 1)[:-1]
        ring = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=1)
        rows = [np.sin(a) * ring + [0.0, 0.0, np.cos(a)] for a in polar]
        points = self.radius * np.concatenate([[[0.0, 0.0, 1.0]], *rows, [[0.0, 0.0, -1.0]]])
        n, last = len(around), len(points) - 1
        k = np.arange(n)
        after = (k + 1) % n
        faces = [np.stack([np.zeros_like(k), 1 + k, 1 + after], axis=1)]
        for row in range(len(polar) - 1):
            a, b = 1 + row * n, 1 + (row + 1) * n
            faces += [np.stack([a + k, b + k, b + after], axis=1), np.stack([a + k, b + after, a + after], axis=1)]
        bottom = last - n
        faces.append(np.stack([np.full_like(k, last), bottom + after, bottom + k], axis=1))
        return Skin(points, np.concatenate(faces))

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        return np.asarray(np.linalg.norm(points, axis=1) <= self.radius + margin)


@dataclass(frozen=True)
class Box(Shape):
    """A cuboid of three lengths along x, y and z, its origin at its centre.

    Raises `DescriptionError` for a size that is not positive.

    >>> import partita as pt
    >>> bar = pt.shapes.Box(("200 mm", "20 mm", "5 mm"))
    >>> round(7850 * bar.volume, 6)
    0.157
    """

    word: ClassVar[str] = "box"
    size: tuple[float, float, float]

    if TYPE_CHECKING:

        def __init__(self, size: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        size = given.vector("Box", "size", self.size)
        object.__setattr__(self, "size", tuple(given.length("Box", f"size[{i}]", x) for i, x in enumerate(size)))

    def _moments(self) -> Moments:
        x, y, z = self.size
        volume = x * y * z
        return Moments(volume, np.zeros(3), volume / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y]))

    def _skin(self) -> Skin:
        x, y, z = (0.5 * side for side in self.size)
        return prism(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), [], 2.0 * z)

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        half = 0.5 * np.array(self.size)
        return np.asarray((np.abs(points) <= half + margin).all(axis=1))


def _round(radius: float, inner: float, length: float) -> Moments:
    """Of a tube."""
    volume = np.pi * (radius - inner) * (radius + inner) * length
    squares = radius**2 + inner**2
    across = volume * (0.25 * squares + length**2 / 12.0)
    return Moments(float(volume), np.zeros(3), np.diag([across, across, 0.5 * volume * squares]))


def _in_round(points: Array, radius: float, inner: float, length: float, margin: float) -> NDArray[np.bool_]:
    out, half = np.hypot(points[:, 0], points[:, 1]), 0.5 * length
    within = (out <= radius + margin) & (np.abs(points[:, 2]) <= half + margin)
    return np.asarray(within & (out >= inner - margin) if inner else within)
