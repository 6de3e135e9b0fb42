"""Turned parts: a profile that revolves about z."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numeric import shown
from . import given
from .plate import polygon
from .polygons import area_of, boundary_integral, distance, inside
from .prism import CORNERS
from .shape import Array, Moments, Shape, Skin

TRIANGLES = 4000
"""Triangles of a turned part in a picture, about."""


@dataclass(frozen=True)
class Revolution(Shape):
    """A turned part: a polygon of corners (r, z), its distance r from the axis never negative, revolved about z.

    Raises `DescriptionError` for a profile that crosses itself, has no area or lies beyond the axis.

    >>> import partita as pt
    >>> cone = pt.shapes.Revolution([(0, 0), (0.03, 0), (0, 0.1)])
    >>> print(f"{cone.centroid[2]:.9f} {cone.volume / (3.141592653589793 * 0.03**2 * 0.1 / 3):.9f}")
    0.025000000 1.000000000
    """

    word: ClassVar[str] = "revolution"
    profile: tuple[tuple[float, float], ...]

    if TYPE_CHECKING:

        def __init__(self, profile: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        points = given.numbers("Revolution", "profile", self.profile)
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
            given.fail(
                "Revolution", f"profile must be three or more corners (r, z) in order, not {shown(self.profile)}"
            )
        if (points[:, 0] < 0.0).any():
            given.fail(
                "Revolution",
                f"profile has a corner at r = {points[:, 0].min():g} m; r is the distance from the axis, at least 0",
            )
        polygon("Revolution", "profile", points)
        object.__setattr__(self, "profile", tuple((r, z) for r, z in points.tolist()))

    @property
    def _ring(self) -> Array:
        """The profile counterclockwise."""
        points = np.array(self.profile)
        return points if area_of(points) > 0.0 else points[::-1]

    def _moments(self) -> Moments:
        ring = self._ring
        base = np.array([0.0, ring[:, 1].mean()])
        own = ring - base
        volume = 2.0 * np.pi * boundary_integral(own, 1, 0)
        middle = 2.0 * np.pi * boundary_integral(own, 1, 1) / volume
        own = own - np.array([0.0, middle])
        axial = 2.0 * np.pi * boundary_integral(own, 3, 0)
        across = 0.5 * axial + 2.0 * np.pi * boundary_integral(own, 1, 2)
        return Moments(volume, np.array([0.0, 0.0, base[1] + middle]), np.diag([across, across, axial]))

    def _skin(self) -> Skin:
        ring = self._ring
        count = int(np.clip(TRIANGLES / (2 * len(ring)), 12, CORNERS))
        angle = np.linspace(0.0, 2.0 * np.pi, count + 1)[:-1]
        points: list[tuple[float, float, float]] = []
        at = []
        for r, z in ring:
            on = np.array([0.0]) if r == 0.0 else angle
            at.append(len(points) + np.arange(count) % len(on))
            points += [(r * np.cos(a), r * np.sin(a), z) for a in on]
        faces = []
        for i in range(len(ring)):
            own, other = at[i], at[(i + 1) % len(ring)]
            turned, far = np.roll(own, -1), np.roll(other, -1)
            faces += [np.stack([own, turned, far], axis=1), np.stack([own, far, other], axis=1)]
        found = np.concatenate(faces)
        a, b, c = found.T
        return Skin(np.array(points), found[(a != b) & (b != c) & (c != a)])

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        plane = np.stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]], axis=1)
        ring = self._ring
        deep = np.where(inside(plane, ring), 1.0, -1.0) * distance(plane, ring)
        return np.asarray(deep >= -margin)
