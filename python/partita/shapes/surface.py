"""Triangles that enclose a volume: whether they do, its moments, and which points lie inside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL
from . import given

Array = NDArray[np.float64]
Faces = NDArray[np.int_]


HALF_SPHERE = 2.0 * float(np.pi)
"""A surface seen under a larger solid angle is all around. Scale: steradian. Reason: it is 4 pi from inside and 0 from
outside."""


AT_ONCE = 4_000_000
"""Pairs of points and boxes that are compared together."""
ONE_BY_ONE = 4
"""Points for which all triangles are looked at together."""
_ASKEW = np.array(given.rotation("Mesh", "rays", (1.0, 0.31, 0.53, 0.17)))
"""Axes along none of which parts have edges, so that rays along the last one rarely meet any."""


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
    """Whether points (k, 3) lie inside: by the triangles that a ray from each leaves through, less those that it enters
    by; where it passes an edge by a hair, by the solid angle of all triangles."""
    points, seen = surface.points @ _ASKEW, at @ _ASKEW
    corners = points[surface.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    k, i = _pairs(seen[:, :2], low[:, :2], high[:, :2])
    ray = high[i, 2] >= seen[k, 2]
    k, i = k[ray], i[ray]
    out = corners[i] - seen[k][:, None]
    a, b, c = (out[:, n] for n in range(3))
    shares = np.stack([_turn(b, c), _turn(c, a), _turn(a, b)], axis=1)
    whole = shares.sum(axis=1)
    width = np.maximum((high[i] - low[i])[:, :2].max(axis=1), np.finfo(float).tiny)
    least, most = shares.min(axis=1), shares.max(axis=1)
    hair = np.minimum(np.abs(least), np.abs(most)) <= EQUAL * width**2
    within = (least > 0.0) | (most < 0.0)
    height = np.einsum("nk,nk->n", shares, out[:, :, 2])
    through = np.where(within & (height * whole > 0.0), np.sign(whole), 0.0)
    found = np.bincount(k, through, len(at)) > 0.0
    unsure = np.unique(k[hair])
    for start in range(0, len(unsure), ONE_BY_ONE):
        some = unsure[start : start + ONE_BY_ONE]
        found[some] = _all_around(at[some], surface)
    return found


def _all_around(at: Array, surface: Surface) -> NDArray[np.bool_]:
    """Whether points (k, 3) lie inside, by the solid angle (Van Oosterom and Strackee 1983)."""
    a, b, c = (surface.points[surface.faces[:, k]][None] - at[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    volume = np.einsum("kni,kni->kn", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("kni,kni->kn", x, y) for x, y in ((a, b), (b, c), (c, a)))
    angle = 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return np.asarray(angle > HALF_SPHERE)


def near(at: Array, surface: Surface, margin: float) -> NDArray[np.bool_]:
    """Whether points (k, 3) lie nearer to the surface than `margin` [m]."""
    corners = surface.points[surface.faces]
    k, i = _pairs(at, corners.min(axis=1) - margin, corners.max(axis=1) + margin)
    found = np.zeros(len(at), dtype=bool)
    found[k[_far(at[k], corners[i]) <= margin]] = True
    return found


def _pairs(at: Array, low: Array, high: Array) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Points and boxes that contain them."""
    step, found = max(1, AT_ONCE // len(low)), []
    for start in range(0, len(at), step):
        inside = np.ones((len(at[start : start + step]), len(low)), dtype=bool)
        for n in range(at.shape[1]):
            x = at[start : start + step, n, None]
            inside &= (low[:, n] <= x) & (x <= high[:, n])
        k, i = np.nonzero(inside)
        found.append((k + start, i))
    return np.concatenate([k for k, _ in found]), np.concatenate([i for _, i in found])


def _far(at: Array, corners: Array) -> Array:
    """Distance of points (n, 3), each from its triangle (n, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(size, np.finfo(float).tiny)[:, None]
    beside = size == 0.0
    least = np.full(len(at), np.inf)
    for k in range(3):
        start, along = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        out = at - start
        beside |= np.einsum("ni,ni->n", out, np.cross(along, normal)) > 0.0
        length = np.maximum(np.einsum("ni,ni->n", along, along), np.finfo(float).tiny)
        share = np.clip(np.einsum("ni,ni->n", out, along) / length, 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(out - share[:, None] * along, axis=1))
    above = np.abs(np.einsum("ni,ni->n", at - corners[:, 0], normal))
    return np.where(beside, least, above)


def _turn(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
