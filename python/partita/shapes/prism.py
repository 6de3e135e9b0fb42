"""Triangles on a prism: an outline with holes, of some thickness along z."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .polygons import area_of, triangles
from .shape import Array, Skin

CORNERS = 48
"""Corners of a circle in a picture."""


def circle(center: Sequence[float], radius: float, beside: float | None = None) -> Array:
    """Points (n, 2) on a circle; fewer on a small one in a figure that is `beside` in size."""
    finer = 1.0 if beside is None else float(np.sqrt(min(1.0, 2.0 * radius / beside)))
    angle = np.linspace(0.0, 2.0 * np.pi, 4 * max(2, round(finer * CORNERS / 4)) + 1)[:-1]
    return np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


class Blind(NamedTuple):
    """A hole from one end of a prism, the `upper` one or the lower, to its floor at z = `floor`."""

    outline: Array
    floor: float
    upper: bool


def prism(outline: Array, holes: Sequence[Array], thickness: float, blind: Sequence[Blind] = ()) -> Skin:
    """Its triangles, from -thickness/2 to thickness/2."""
    half = 0.5 * thickness
    points: list[Array] = []
    faces: list[NDArray[np.int_]] = []

    def put(loop: Array, z: float) -> NDArray[np.int_]:
        points.append(np.hstack([loop, np.full((len(loop), 1), z)]))
        end = sum(map(len, points))
        return np.arange(end - len(loop), end)

    def wall(low: NDArray[np.int_], high: NDArray[np.int_]) -> None:
        i, j, over_i, over_j = low, np.roll(low, -1), high, np.roll(high, -1)
        faces.extend([np.stack([i, j, over_j], axis=1), np.stack([i, over_j, over_i], axis=1)])

    loops = [_turned(outline, 1.0), *(_turned(hole, -1.0) for hole in holes)]
    below = [(loop, put(loop, -half)) for loop in loops]
    above = [(loop, put(loop, half)) for loop in loops]
    for (_, low), (_, high) in zip(below, above, strict=True):
        wall(low, high)
    for hole in blind:
        loop = _turned(hole.outline, -1.0)
        mouth, floor = put(loop, half if hole.upper else -half), put(loop, hole.floor)
        (above if hole.upper else below).append((loop, mouth))
        wall(*((floor, mouth) if hole.upper else (mouth, floor)))
        filled = floor[::-1][triangles([loop[::-1]])]
        faces.append(filled if hole.upper else filled[:, ::-1])
    for cap, upper in ((below, False), (above, True)):
        filled = np.concatenate([at for _, at in cap])[triangles([loop for loop, _ in cap])]
        faces.append(filled if upper else filled[:, ::-1])
    return Skin(np.concatenate(points), np.concatenate(faces))


def _turned(loop: Array, sign: float) -> Array:
    """The polygon counterclockwise (1), or clockwise (-1)."""
    return loop if area_of(loop) * sign > 0.0 else loop[::-1]
