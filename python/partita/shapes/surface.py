"""Triangles that enclose a volume: whether they do, its moments, and which points lie inside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL

Array = NDArray[np.float64]
Faces = NDArray[np.int_]


HALF_SPHERE = 2.0 * float(np.pi)
"""A surface seen under a larger solid angle is all around. Scale: steradian. Reason: it is 4 pi from inside and 0 from
outside."""


class Surface(NamedTuple):
    """Corners (n, 3), and triangles (m, 3) in order around the outward normal."""

    points: Array
    faces: Faces


def welded(points: Array, faces: Faces, margin: float) -> Surface:
    """Corners in one place as one; within `margin` [m] they are. Triangles that become lines are left out."""
    keys = points + 0.0 if margin == 0.0 else np.round(points / margin)  # -0 is 0
    _, first, of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    corners = of.ravel()[faces]
    a, b, c = corners.T
    whole = corners[(a != b) & (b != c) & (c != a)]
    used, renumbered = np.unique(whole, return_inverse=True)
    return Surface(points[first][used], renumbered.reshape(-1, 3))


def open_edges(faces: Faces) -> tuple[int, int]:
    """Edges that have a triangle on one side only; and others whose triangles do not run in opposite directions."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if not len(ends):
        return 0, 0
    ordered = np.sort(ends, axis=1)
    _, of = np.unique(ordered, axis=0, return_inverse=True)
    of = of.ravel()
    count = np.bincount(of)
    along = np.bincount(of, np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0))
    single = count % 2 == 1
    return int(single.sum()), int((~single & (along != 0.0)).sum())


def moments_of(surface: Surface) -> tuple[float, Array, Array]:
    """Volume, centroid, and inertia about it per unit density: tetrahedra from one point to each triangle, with their
    signs, each integrated exactly by its corners."""
    points, faces = surface
    origin = 0.5 * (points.min(axis=0) + points.max(axis=0))
    volume, first, _ = _sums(points - origin, faces)
    if not abs(volume) > 0.0:
        return 0.0, origin, np.zeros((3, 3))
    middle = origin + first / volume
    volume, first, second = _sums(points - middle, faces)
    rest = first / volume
    second = second - volume * np.outer(rest, rest)
    return volume, middle + rest, np.trace(second) * np.eye(3) - 0.5 * (second + second.T)


def _sums(points: Array, faces: Faces) -> tuple[float, Array, Array]:
    """Integrals of 1, x and x x^T over the volume."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    each = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    total = a + b + c
    second = np.zeros((3, 3))
    for p in (a, b, c, total):
        for i in range(3):
            for j in range(i, 3):
                second[i, j] += float((each * p[:, i] * p[:, j]).sum()) / 20.0
    second = second + np.triu(second, 1).T
    return float(each.sum()), (each[:, None] * total).sum(axis=0) / 4.0, second


def components(surface: Surface) -> list[Surface]:
    """Parts that have no corner in common."""
    points, faces = surface
    least = np.arange(len(points))
    while True:  # each corner takes the least number that it is connected with
        low = least[faces].min(axis=1)
        found = least.copy()
        for k in range(3):
            np.minimum.at(found, faces[:, k], low)
        found = found[found]
        if (found == least).all():
            break
        least = found
    of = least[faces[:, 0]]
    return [Surface(points, faces[of == number]) for number in np.unique(of)]


def enclosed(at: Array, surface: Surface) -> NDArray[np.bool_]:
    """Whether points (k, 3) lie inside: the solid angle of all triangles (Van Oosterom and Strackee 1983)."""
    a, b, c = (surface.points[surface.faces[:, k]][None] - at[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    volume = np.einsum("kni,kni->kn", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("kni,kni->kn", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return np.asarray(angle > HALF_SPHERE)


def far(at: Array, surface: Surface) -> Array:
    """Distance of points (k, 3) from the nearest triangle."""
    corners = [surface.points[surface.faces[:, k]] for k in range(3)]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    size = np.linalg.norm(normal, axis=1)
    thin = size <= EQUAL * np.max(size, initial=0.0)
    normal = normal / np.where(thin, 1.0, size)[:, None]
    above = np.einsum("kni,ni->kn", at[:, None] - corners[0][None], normal)
    beside = np.broadcast_to(thin, above.shape).copy()
    least = np.full(len(at), np.inf)
    for k in range(3):
        start, along = corners[k], corners[(k + 1) % 3] - corners[k]
        out = at[:, None] - start[None]
        beside |= np.einsum("kni,ni->kn", out, np.cross(along, normal)) > 0.0
        length = np.maximum(np.einsum("ni,ni->n", along, along), np.finfo(float).tiny)
        share = np.clip(np.einsum("kni,ni->kn", out, along) / length, 0.0, 1.0)
        away = np.linalg.norm(out - share[:, :, None] * along[None], axis=2)
        least = np.minimum(least, away.min(axis=1))
    return np.minimum(least, np.where(beside, np.inf, np.abs(above)).min(axis=1))
