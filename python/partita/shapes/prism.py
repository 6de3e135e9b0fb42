"""Triangles on a prism: an outline with holes, of some thickness along z."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .polygons import area_of, triangles
from .shape import Array, Skin

CORNERS = 48
"""Corners of a circle in a picture."""


def circle(center: Sequence[float], radius: float, beside: float | None = None) -> Array:
    """Points (n, 2) on a circle; fewer on a small one in a figure that is `beside` in size."""
    finer = 1.0 if beside is None else float(np.sqrt(min(1.0, 2.0 * radius / beside)))
    angle = np.linspace(0.0, 2.0 * np.pi, 4 * max(2, round(finer * CORNERS / 4)) + 1)[:-1]
    return np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def prism(outline: Array, holes: Sequence[Array], thickness: float) -> Skin:
    """Its triangles, from -thickness/2 to thickness/2."""
    loops = [_turned(outline, 1.0), *(_turned(hole, -1.0) for hole in holes)]
    plane = np.concatenate(loops)
    count = len(plane)
    half = np.full((count, 1), 0.5 * thickness)
    points = np.concatenate([np.hstack([plane, -half]), np.hstack([plane, half])])
    cap = triangles(loops)
    sides, start = [], 0
    for loop in loops:
        i = start + np.arange(len(loop))
        j = start + (np.arange(len(loop)) + 1) % len(loop)
        sides += [np.stack([i, j, j + count], axis=1), np.stack([i, j + count, i + count], axis=1)]
        start += len(loop)
    return Skin(points, np.concatenate([cap[:, ::-1], cap + count, *sides]))


def _turned(loop: Array, sign: float) -> Array:
    """The polygon counterclockwise (1), or clockwise (-1)."""
    return loop if area_of(loop) * sign > 0.0 else loop[::-1]
