"""Polygons and circles in a plane: their moments by Green's theorem, whether they cross, which lies within which, and
triangles that fill them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL

Array = NDArray[np.float64]


def area_of(points: Array) -> float:
    """Area inside a polygon (n, 2), positive if it runs counterclockwise."""
    own = points - points.mean(axis=0)
    return 0.5 * float(_cross(own, np.roll(own, -1, axis=0)).sum())


def moments_of(points: Array) -> tuple[float, Array, Array]:
    """Area, centroid (2,) and second moments about it (2, 2), the integrals of x x^T, of a polygon counterclockwise."""
    middle = points.mean(axis=0)
    a = points - middle
    b = np.roll(a, -1, axis=0)
    each = _cross(a, b)
    area = 0.5 * float(each.sum())
    first = (each[:, None] * (a + b)).sum(axis=0) / (6.0 * area)
    second = np.einsum("n,ni,nj->ij", each, a, a) + np.einsum("n,ni,nj->ij", each, b, b)
    mixed = np.einsum("n,ni,nj->ij", each, a, b)
    second = (2.0 * second + mixed + mixed.T) / 24.0 - area * np.outer(first, first)
    return area, middle + first, second


_AT, _WEIGHT = np.polynomial.legendre.leggauss(3)


def boundary_integral(points: Array, i: int, j: int) -> float:
    """The integral of x^i y^j over a polygon counterclockwise, by that of x^(i+1) y^j / (i+1) along y; exact up to
    i + j = 4."""
    a, b = points, np.roll(points, -1, axis=0)
    total = 0.0
    for at, weight in zip(0.5 * (1.0 + _AT), 0.5 * _WEIGHT, strict=True):
        on = (1.0 - at) * a + at * b
        total += float(weight * (on[:, 0] ** (i + 1) * on[:, 1] ** j * (b - a)[:, 1]).sum())
    return total / (i + 1)


def inset(points: Array, width: float, still: NDArray[np.bool_] | None = None) -> Array | None:
    """The polygon counterclockwise whose edges lie inside by `width`, outside where it is negative, with sharp corners;
    None where edges vanish or meet. Edges that are `still` keep their lines."""
    along = np.roll(points, -1, axis=0) - points
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1)
    moved = np.full(len(points), width) if still is None else np.where(still, 0.0, width)
    before, shift = np.roll(along, 1, axis=0), np.roll(moved, 1)
    turn = _cross(before, along)
    straight = np.abs(turn) <= EQUAL
    # the corner c + u on both lines: u . n = its width for the edge before and the one after
    first, second = np.roll(inwards, 1, axis=0), inwards
    with np.errstate(divide="ignore", invalid="ignore"):
        out = (shift[:, None] * along - moved[:, None] * before) / np.where(straight, 1.0, turn)[:, None]
    found = points + np.where(straight[:, None], 0.5 * (shift[:, None] * first + moved[:, None] * second), out)
    if (np.einsum("ni,ni->n", np.roll(found, -1, axis=0) - found, along) <= 0.0).any():
        return None
    return None if crossing(found) is not None else found


def crossing(points: Array) -> tuple[int, int] | None:
    """Two edges of a polygon that meet although they are not neighbours, or neighbours that run back; None if there are
    none. Edge k leads from point k to the next one."""
    n, ends = len(points), np.roll(points, -1, axis=0)
    before, after = np.roll(points, 1, axis=0) - points, ends - points
    back = (_cross(before, after) == 0.0) & (np.einsum("ni,ni->n", before, after) >= 0.0)
    if back.any():
        k = int(np.argmax(back))
        return (k - 1) % n, k
    # edges from left to right: one can meet only those that begin before it ends
    low, high = np.minimum(points, ends)[:, 0], np.maximum(points, ends)[:, 0]
    order = np.argsort(low)
    last = np.searchsorted(low[order], high[order], side="right")
    for i, k in enumerate(order.tolist()):
        others = order[i + 1 : last[i]]
        others = others[(others - k) % n > 1]
        others = others[(k - others) % n > 1]
        if len(others):
            met = _meet(points[k], ends[k], points[others], ends[others])
            if met.any():
                other = int(others[np.argmax(met)])
                return min(k, other), max(k, other)
    return None


def edges_meet(a: Array, b: Array) -> bool:
    """Whether an edge of one polygon meets one of another."""
    ends, others = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    return any(bool(_meet(a[k], ends[k], b, others).any()) for k in range(len(a)))


def _meet(p: Array, q: Array, a: Array, b: Array) -> NDArray[np.bool_]:
    """Whether a segment meets others."""
    one, two = _side(p, q, a), _side(p, q, b)
    three, four = _cross(b - a, p - a), _cross(b - a, q - a)
    proper = (one * two < 0.0) & (three * four < 0.0)
    on = _on(p, q, a, one) | _on(p, q, b, two)
    on |= ((three == 0.0) & _between(p, a, b)) | ((four == 0.0) & _between(q, a, b))
    return np.asarray(proper | on)


def _side(p: Array, q: Array, points: Array) -> Array:
    return _cross(q - p, points - p)


def _on(p: Array, q: Array, points: Array, side: Array) -> NDArray[np.bool_]:
    return np.asarray((side == 0.0) & _between(points, p, q))


def _between(points: Array, a: Array, b: Array) -> NDArray[np.bool_]:
    return np.asarray(((points >= np.minimum(a, b)) & (points <= np.maximum(a, b))).all(axis=-1))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Whether points (m, 2) lie inside a polygon (n, 2), by the crossings of a ray; on its edges either."""
    found = np.zeros(len(points), dtype=bool)
    x, y = points[:, 0], points[:, 1]
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        spans = (a[1] > y) != (b[1] > y)
        if spans.any():
            with np.errstate(divide="ignore", invalid="ignore"):
                at = a[0] + (y - a[1]) * ((b[0] - a[0]) / (b[1] - a[1]))
            found ^= spans & (x < at)
    return found


def distance(points: Array, polygon: Array) -> Array:
    """Distance of points (m, 2) from the edges of a polygon."""
    least = np.full(len(points), np.inf)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        along = b - a
        at = np.clip((points - a) @ along / float(along @ along), 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(points - a - at[:, None] * along, axis=1))
    return least


def triangles(loops: list[Array]) -> NDArray[np.int_]:
    """Triangles (m, 3) that fill the first polygon, counterclockwise, without the others, clockwise: indices into all
    their points, one polygon after the other. Ears are cut off (Meisters 1975), after a bridge to each hole
    (Eberly)."""
    points = np.concatenate(loops)
    starts = np.cumsum([0, *map(len, loops)])
    ring = list(range(len(loops[0])))
    holes = [np.arange(starts[i], starts[i + 1]) for i in range(1, len(loops))]
    for hole in sorted(holes, key=lambda own: -float(points[own, 0].max())):
        first = int(np.argmax(points[hole, 0]))
        loop = [*hole[first:].tolist(), *hole[:first].tolist()]
        at = _bridge(points, ring, loop[0])
        ring[at + 1 : at + 1] = [*loop, loop[0], ring[at]]
    return _ears(points, ring)


def _bridge(points: Array, ring: list[int], start: int) -> int:
    """Position in a ring of a point that is seen from the rightmost point of a hole."""
    m, p = points[start], points[ring]
    q = np.roll(p, -1, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = p[:, 0] + (m[1] - p[:, 1]) * (q[:, 0] - p[:, 0]) / (q[:, 1] - p[:, 1])
    spans = (p[:, 1] <= m[1]) & (q[:, 1] > m[1]) & (at >= m[0])  # edges upwards have the inside on their left
    k = int(np.argmin(np.where(spans, at, np.inf)))
    hit = np.array([at[k], m[1]])
    far = k if p[k, 0] > q[k, 0] else (k + 1) % len(ring)
    corner = p[far]
    # of the points in the triangle between, the one nearest to the ray in angle hides the corner
    within = _in_triangle(p, m, hit, corner) & (p[:, 0] >= m[0]) & (np.abs(p - corner).max(axis=1) > 0.0)
    out = p - m
    slope = np.abs(out[:, 1]) / np.maximum(np.linalg.norm(out, axis=1), np.finfo(float).tiny)
    mine = float(slope[far])
    better = within & (slope < mine)
    return int(np.argmin(np.where(better, slope, np.inf))) if better.any() else far


def _in_triangle(p: Array, a: Array, b: Array, c: Array) -> NDArray[np.bool_]:
    """Whether points lie in a triangle of either orientation, its edges included."""
    sides = np.stack([_side(a, b, p), _side(b, c, p), _side(c, a, p)])
    return np.asarray((sides >= 0.0).all(axis=0) | (sides <= 0.0).all(axis=0))


def _ears(points: Array, ring: list[int]) -> NDArray[np.int_]:
    """Ears of a polygon, cut off one after the other. Corners that are convex stay so."""
    n = len(ring)
    corner = np.array(ring)
    before, after = list(range(-1, n - 1)), [*range(1, n), 0]
    before[0] = n - 1
    left = np.ones(n, dtype=bool)

    def turns(k: int) -> float:
        p, q, r = points[ring[before[k]]], points[ring[k]], points[ring[after[k]]]
        return float(_cross(q - p, r - q))

    reflex = np.array([k for k in range(n) if turns(k) <= 0.0], dtype=int)
    found: list[tuple[int, int, int]] = []
    k, tried, since, count = 0, 0, 0, n
    while count > 3:
        a, c = before[k], after[k]
        # numbers so close that no ear is found: the turn of this one decides nothing
        if tried > count or _is_ear(points, corner[reflex], ring[a], ring[k], ring[c]):
            found.append((ring[a], ring[k], ring[c]))
            after[a], before[c] = c, a
            left[k] = False
            count, tried, since = count - 1, 0, since + 1
            k = after[c]  # not beside it: ears one after the other at one corner are slivers
            if 4 * since > len(reflex):
                reflex = np.array([j for j in reflex.tolist() if left[j] and turns(j) <= 0.0], dtype=int)
                since = 0
        else:
            k, tried = c, tried + 1
    found.append((ring[before[k]], ring[k], ring[after[k]]))
    return np.array(found, dtype=int)


def _is_ear(points: Array, reflex: NDArray[np.int_], a: int, b: int, c: int) -> bool:
    p, q, r = points[a], points[b], points[c]
    turn = float(_cross(q - p, r - q))
    if turn <= 0.0:
        return turn == 0.0 and float((q - p) @ (r - q)) >= 0.0  # on a straight line
    others = points[reflex]
    apart = (np.abs(others - p).max(1) > 0.0) & (np.abs(others - q).max(1) > 0.0) & (np.abs(others - r).max(1) > 0.0)
    return not bool((_in_triangle(others, p, q, r) & apart).any())
