"""Extrusions: an outline in x and y, with holes, drawn out along z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..units import Quantity
from . import given
from .plate import Circle, Polygon, figures, in_prism, of_prism, on_prism
from .shape import Array, Moments, Shape, Skin


@dataclass(frozen=True)
class Extrusion(Shape):
    """An outline with holes drawn out along z, from z = 0 to `length`: profiles, beams, toothed bars.

    `outline` and `holes` are those of `Plate`, whose middle is at z = 0 where an extrusion begins.

    Raises `DescriptionError` for an outline that crosses itself or has no area, for a hole that is not inside the
    outline or meets another one, and for a length that is not positive.

    >>> import partita as pt
    >>> angle = [(0, 0), (0.04, 0), (0.04, 0.004), (0.004, 0.004), (0.004, 0.04), (0, 0.04)]
    >>> beam = pt.shapes.Extrusion(angle, length="0.5 m")
    >>> print(f"{2700 * beam.volume:.4f} kg, centre at z = {beam.centroid[2]} m")
    0.4104 kg, centre at z = 0.25 m
    """

    word: ClassVar[str] = "extrusion"
    outline: Polygon | Circle
    length: float
    holes: tuple[Polygon | Circle, ...] = ()

    if TYPE_CHECKING:

        def __init__(self, outline: Any, length: Quantity, holes: Sequence[Any] = ()) -> None: ...

    def __post_init__(self) -> None:
        length = given.length("Extrusion", "length", self.length)
        outline, holes = figures("Extrusion", self.outline, self.holes)
        for word, value in (("outline", outline), ("length", length), ("holes", holes)):
            object.__setattr__(self, word, value)

    @property
    def _middle(self) -> Array:
        return np.array([0.0, 0.0, 0.5 * self.length])

    def _moments(self) -> Moments:
        volume, centroid, inertia = of_prism(self.outline, self.holes, self.length)
        return Moments(volume, centroid + self._middle, inertia)

    def _skin(self) -> Skin:
        points, faces = on_prism(self.outline, self.holes, self.length)
        return Skin(points + self._middle, faces)

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie inside, or outside by less than `margin` [m]."""
        return in_prism(points - self._middle, self.outline, self.holes, self.length, margin)
