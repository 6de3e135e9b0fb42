"""Shapes as the solids that viewers draw: boxes, cylinders, balls and triangles."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..tolerance import EQUAL
from .basic import Box, Cylinder, Disc, Sphere
from .extrusion import Extrusion
from .mesh import Mesh
from .plate import Plate, corners
from .polygons import distance, inside
from .prism import Blind, circle, prism
from .shape import Array, Part, Shape, Skin, Sum
from .shell import Shell
from .triangles import MOST_TRIANGLES, simplified

DIGITS = 9
"""Of the corners of triangles."""
PIECES = 8
"""Triangles are divided until no edge is longer than a solid, over this number: what is painted from back to front one
triangle after the other is then in the right order beside other solids."""
MOST = 3000
"""With more triangles none is divided."""


def drawn(shape: Shape) -> list[dict[str, Any]]:
    """Its solids in the axes of the body, as `shapes=` of viewers has them.

    Of the holes of a sum those are drawn that go straight into a disc, a tube, a plate, an extrusion or a box, through
    it or not, with material around them; of those in a box the ones along one of its edges.

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
    if isinstance(part.shape, Shell):  # its hollow is closed
        return _solid(Part(part.shape.shape, part.position, part.orientation), holes)
    shape, turn = part.shape, np.array(part.orientation)
    center = {"center": [float(x) for x in part.position]}
    if holes:
        turned, taken = max(((one, _taken(one, holes)) for one in _turns(part)), key=lambda found: len(found[1]))
        if taken:
            return _mesh(turned, _pierced(turned.shape, taken))
    match shape:
        case Disc(radius, length) | Cylinder(radius, length, 0.0):
            return {"kind": "cylinder", "radius": radius, "length": length, **center, "axis": turn[:, 2].tolist()}
        case Sphere(radius):
            return {"kind": "ball", "radius": radius, **center}
        case Box(size):
            return {"kind": "box", "size": list(size), **center, "axes": turn.T.tolist()}
        case Mesh() if len(shape.skin.faces) > MOST_TRIANGLES:
            fewer = Skin(*simplified(*shape.skin, MOST_TRIANGLES))
            return {**_mesh(part, fewer), "of": len(shape.skin.faces), "closed": False}
    return _mesh(part, shape.skin)


def _turns(part: Part) -> list[Part]:
    """The same part with axes in other order: a box is a prism along each of its edges."""
    if not isinstance(part.shape, Box):
        return [part]
    turn, found = np.array(part.orientation), []
    for order in ([0, 1, 2], [1, 2, 0], [2, 0, 1]):
        size = [part.shape.size[k] for k in order]
        found.append(Part(Box(size), part.position, tuple(map(tuple, turn[:, order].tolist()))))
    return found


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


class _Prism(NamedTuple):
    """Outline and holes, from `low` to `high` along z."""

    outline: Array
    holes: list[Array]
    low: float
    high: float


def _prismatic(shape: Shape, beside: float | None = None) -> _Prism | None:
    """A shape that is a prism along z, in a figure that is `beside` in size."""
    match shape:
        case Disc(radius, thickness):
            return _Prism(circle((0.0, 0.0), radius, beside), [], -0.5 * thickness, 0.5 * thickness)
        case Cylinder(radius, length, inner):
            bore = [circle((0.0, 0.0), inner)] if inner else []
            return _Prism(circle((0.0, 0.0), radius, beside), bore, -0.5 * length, 0.5 * length)
        case Box(size):
            x, y = 0.5 * size[0], 0.5 * size[1]
            around = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
            return _Prism(around, [], -0.5 * size[2], 0.5 * size[2])
        case Plate(outline, long, holes) | Extrusion(outline, long, holes):
            extent = float(np.ptp(corners(outline), axis=0).max())
            low = -0.5 * long if isinstance(shape, Plate) else 0.0
            return _Prism(corners(outline, beside), [corners(hole, extent) for hole in holes], low, low + long)
    return None


def _taken(part: Part, holes: list[Part]) -> list[_Prism]:
    """Prismatic holes that begin at an end of a prism, in its axes."""
    whole = _prismatic(part.shape)
    if whole is None:
        return []
    found, extent = [], float(np.ptp(whole.outline, axis=0).max())
    margin = EQUAL * (whole.high - whole.low)
    for hole in holes:
        taken = _prismatic(hole.shape, extent)
        if taken is None or taken.holes:
            continue
        ends = []
        for z in (taken.low, taken.high):
            level = np.full((len(taken.outline), 1), z)
            ends.append(part.back(hole.placed(np.hstack([taken.outline, level]))))
        low, high = sorted(float(end[0, 2]) for end in ends)
        low = whole.low if abs(low - whole.low) <= margin else low
        high = whole.high if abs(high - whole.high) <= margin else high
        straight = all(np.ptp(end[:, 2]) <= margin for end in ends)
        meets = (low == whole.low or high == whole.high) and whole.low <= low and high <= whole.high
        ring = ends[0][:, :2]
        if straight and meets and part.shape.contains(ends[0], EQUAL * extent).all() and _within(ring, whole, extent):
            found.append(_Prism(ring, [], low, high))
    return found


def _within(ring: Array, whole: _Prism, extent: float) -> bool:
    """Whether a hole has material all around it: one that reaches the outline is a slot."""
    apart = all(distance(ring, around).min() > EQUAL * extent for around in (whole.outline, *whole.holes))
    return bool(apart and inside(ring, whole.outline).all())


def _pierced(shape: Shape, taken: list[_Prism]) -> Skin:
    whole = _prismatic(shape)
    assert whole is not None
    middle = 0.5 * (whole.low + whole.high)
    through = [hole.outline for hole in taken if (hole.low, hole.high) == (whole.low, whole.high)]
    blind = [
        Blind(hole.outline, hole.low - middle, True) if hole.high == whole.high
        else Blind(hole.outline, hole.high - middle, False)
        for hole in taken
        if (hole.low, hole.high) != (whole.low, whole.high)
    ]  # fmt: skip
    points, faces = prism(whole.outline, [*whole.holes, *through], whole.high - whole.low, blind)
    return Skin(points + np.array([0.0, 0.0, middle]), faces)
