"""Hollow bodies: a shape of which walls of one thickness remain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError
from ..numeric import shown
from ..units import Quantity
from . import given
from .basic import Box, Cylinder, Disc, Sphere
from .extrusion import Extrusion
from .plate import Plate, is_circle
from .polygons import area_of, inset
from .revolution import Revolution
from .shape import Array, Moments, Shape, Skin

OF = (Disc, Cylinder, Box, Sphere, Plate, Extrusion, Revolution)


@dataclass(frozen=True)
class Shell(Shape):
    """A closed hollow body: of a shape remains a wall of one `thickness`, measured inwards from its surface.

    The outer dimensions are those of the shape, and the hollow is closed; corners of the hollow are sharp, as a CAD
    program makes them where faces are offset. Volume, centroid and inertia are the exact difference, not those of a
    surface. An open box or cup is a difference: `Box(...) - Box(...).at(...)`. A bore keeps a wall of its own.

    Raises `DescriptionError` for walls that leave no hollow, and for a shape that is a sum, a mesh or a shell itself.

    >>> import partita as pt
    >>> float_ball = pt.shapes.Shell(pt.shapes.Sphere("50 mm"), thickness="0.5 mm")
    >>> print(f"{8000 * float_ball.volume:.4f} kg")
    0.1244 kg
    """

    word: ClassVar[str] = "shell"
    shape: Shape
    thickness: float

    if TYPE_CHECKING:

        def __init__(self, shape: Shape, thickness: Quantity) -> None: ...

    def __post_init__(self) -> None:
        if not isinstance(self.shape, OF):
            names = ", ".join(kind.__name__ for kind in OF)
            about = f"shape must be one of {names}, not {shown(self.shape)}"
            if isinstance(self.shape, Shape):
                about += "; take the hollow off it instead: shape - hollow"
            given.fail("Shell", about)
        object.__setattr__(self, "thickness", given.length("Shell", "thickness", self.thickness))
        try:
            whole = self.shape - _hollow(self.shape, self.thickness)
        except (DescriptionError, _Full) as error:
            about = f"walls of {self.thickness:g} m meet, so not all of it is hollow; give a smaller thickness"
            given.fail("Shell", about, error)
        object.__setattr__(self, "_whole", whole)

    def _moments(self) -> Moments:
        return Moments(*self._whole._kept)  # type: ignore[attr-defined]

    def _skin(self) -> Skin:
        return self.shape.skin

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie in the wall, or outside it by less than `margin` [m]."""
        return np.asarray(self._whole.contains(points, margin))  # type: ignore[attr-defined]


class _Full(Exception):
    """There is no hollow."""


def _hollow(shape: Any, wall: float) -> Shape:
    """What is taken off."""
    both = 2.0 * wall
    match shape:
        case Disc(radius, thickness):
            return Disc(radius - wall, thickness - both)
        case Cylinder(radius, length, inner):
            return Cylinder(radius - wall, length - both, inner + wall if inner else 0.0)
        case Sphere(radius):
            return Sphere(radius - wall)
        case Box(size):
            return Box([side - both for side in size])
        case Plate(outline, thickness, holes):
            return Plate(_moved(outline, wall), thickness - both, [_moved(hole, -wall) for hole in holes])
        case Extrusion(outline, length, holes):
            inner_holes = [_moved(hole, -wall) for hole in holes]
            return Extrusion(_moved(outline, wall), length - both, inner_holes).at((0.0, 0.0, wall))
    ring = np.array(shape.profile)
    ring = ring if area_of(ring) > 0.0 else ring[::-1]
    on_axis = (ring[:, 0] == 0.0) & (np.roll(ring[:, 0], -1) == 0.0)
    found = inset(ring, wall, on_axis)
    if found is None:
        raise _Full
    # a corner between the axis and another edge is on the axis but for rounding
    found[on_axis | np.roll(on_axis, 1), 0] = 0.0
    return Revolution(found)


def _moved(figure: Any, width: float) -> Any:
    """A circle or a polygon whose edges lie inside by `width`, outside where it is negative."""
    if is_circle(figure):
        return figure[0], figure[1] - width
    ring = np.array(figure)
    found = inset(ring if area_of(ring) > 0.0 else ring[::-1], width)
    if found is None:
        raise _Full
    return found
