"""Shapes as the solids that viewers draw: boxes, cylinders, balls and triangles."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..tolerance import EQUAL
from .basic import Box, Cylinder, Disc, Sphere
from .plate import Plate, corners
from .prism import circle, prism
from .shape import Array, Part, Shape, Skin, Sum

DIGITS = 9
"""Of the corners of triangles."""
PIECES = 8
"""Triangles are divided until no edge is longer than a solid, over this number: what is painted from back to front one
triangle after the other is then in the right order beside other solids."""
MOST = 3000
"""With more triangles none is divided."""


def drawn(shape: Shape) -> list[dict[str, Any]]:
    """Its solids in the axes of the body, as `shapes=` of viewers has them.

    Of the holes of a sum those are drawn that go straight through a disc, a tube, a box or a plate.

    >>> from partita import shapes
    >>> shapes.drawn(shapes.Sphere(0.1))
    [{'kind': 'ball', 'radius': 0.1, 'center': [0.0, 0.0, 0.0]}]
    """
    return [dict(solid) for solid in _drawn(shape)]


@lru_cache(maxsize=256)
def _drawn(shape: Shape) -> tuple[dict[str, Any], ...]:
    if not isinstance(shape, Sum):
        return (_solid(Part(shape)),)
    holes = [part for part in shape.parts if part.hole]
    return tuple(_solid(part, holes) for part in shape.parts if not part.hole)


def _solid(part: Part, holes: list[Part] | None = None) -> dict[str, Any]:
    shape, turn = part.shape, np.array(part.orientation)
    center = {"center": [float(x) for x in part.position]}
    through = [ring for hole in holes or () if (ring := _through(part, hole)) is not None]
    if through:
        outline, own, thickness = _prismatic(shape)  # type: ignore[misc]
        return _mesh(part, prism(outline, [*own, *through], thickness))
    match shape:
        case Disc(radius, length) | Cylinder(radius, length, 0.0):
            return {"kind": "cylinder", "radius": radius, "length": length, **center, "axis": turn[:, 2].tolist()}
        case Sphere(radius):
            return {"kind": "ball", "radius": radius, **center}
        case Box(size):
            return {"kind": "box", "size": list(size), **center, "axes": turn.T.tolist()}
    return _mesh(part, shape.skin)


def _mesh(part: Part, skin: Skin) -> dict[str, Any]:
    skin = _divided(skin)
    points = part.placed(skin.points)
    return {
        "kind": "mesh",
        "points": [float(f"{x:.{DIGITS}g}") for x in points.ravel().tolist()],
        "faces": skin.faces.ravel().tolist(),
        "of": len(skin.faces),
        "closed": True,
    }


def _divided(skin: Skin) -> Skin:
    """The same surface with shorter edges: the longest edge of each triangle is bisected."""
    points, faces = skin
    longest = float(np.linalg.norm(np.ptp(points, axis=0))) / PIECES
    while len(faces) < MOST:
        sides = np.linalg.norm(points[np.roll(faces, -1, axis=1)] - points[faces], axis=2)  # from corner k to the next
        far = sides.argmax(axis=1)
        long = np.flatnonzero(sides[np.arange(len(faces)), far] > longest)
        if not len(long):
            break
        a, b, c = (faces[long, (far[long] + k) % 3] for k in range(3))
        edges, of = np.unique(np.sort(np.stack([a, b], axis=1), axis=1), axis=0, return_inverse=True)
        middle = len(points) + of.ravel()
        points = np.concatenate([points, points[edges].mean(axis=1)])
        kept = np.delete(faces, long, axis=0)
        faces = np.concatenate([kept, np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return Skin(points, faces)


def _prismatic(shape: Shape, beside: float | None = None) -> tuple[Array, list[Array], float] | None:
    """Outline, holes and thickness along z of a shape that is a prism, in a figure that is `beside` in size."""
    match shape:
        case Disc(radius, thickness):
            return circle((0.0, 0.0), radius, beside), [], thickness
        case Cylinder(radius, length, inner):
            return circle((0.0, 0.0), radius, beside), [circle((0.0, 0.0), inner)] if inner else [], length
        case Box(size):
            x, y = 0.5 * size[0], 0.5 * size[1]
            return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), [], size[2]
        case Plate(outline, thickness, holes):
            extent = float(np.ptp(corners(outline), axis=0).max())
            return corners(outline, beside), [corners(hole, extent) for hole in holes], thickness
    return None


def _through(part: Part, hole: Part) -> Array | None:
    """The outline (n, 2), in the axes of a prism, of a prismatic hole straight through it; None for any other hole."""
    whole = _prismatic(part.shape)
    taken = None if whole is None else _prismatic(hole.shape, float(np.ptp(whole[0], axis=0).max()))
    if whole is None or taken is None or taken[1]:
        return None
    outline, half = taken[0], np.full((len(taken[0]), 1), 0.5 * taken[2])
    ends = [part.back(hole.placed(np.hstack([outline, side]))) for side in (-half, half)]
    margin, face = EQUAL * whole[2], 0.5 * whole[2]
    parallel = all(np.ptp(end[:, 2]) <= margin for end in ends)
    reached = {float(np.sign(end[0, 2])) for end in ends if abs(abs(end[0, 2]) - face) <= margin}
    inside = part.shape.contains(ends[0], EQUAL * float(np.ptp(whole[0]))).all()
    return ends[0][:, :2] if parallel and reached == {-1.0, 1.0} and inside else None
