"""Shape of a body from its known points, and the view of a mechanism."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL_IN_SIX_DIGITS, NEARLY_ALONG, VISIBLE

FloatArray = NDArray[np.float64]

MOSTLY_SEEN = 0.25
"""A planar mechanism of which more is hidden face-on is viewed obliquely. Scale: fraction of its parts. Reason: a
quarter is missed."""


BEHIND = 0.03
"""Parts nearer in a picture hide each other. Scale: fraction of what is shown. Reason: the width of a link."""
APART = 0.08
"""Parts farther apart in space are not one. Scale: fraction of what is shown. Reason: more than the width of a
link."""
SHORTENED = 0.1
"""A direction of which less is left in the picture is not the upward one. Scale: fraction of its length. Reason: six
degrees."""
MIRRORED = 0.5
"""A determinant of directions that differs from -1 by less is that of a reflection. Scale: 1. Reason: it is 1 or
-1."""
DEEP = 0.2
"""A planar mechanism that extends farther across its plane is viewed obliquely too. Scale: fraction of its extent.
Reason: an engine does, a linkage does not."""


def solid_of(mass: float, com: FloatArray, inertia: FloatArray) -> dict[str, Any] | None:
    """The uniform solid with this mass and inertia, about its centre: ball, cylinder or box in body axes [m].

    None where there is none: no mass, or moments that no solid has by so little extent.
    """
    if not mass > 0.0 or not np.isfinite(inertia).all():
        return None
    moments, axes = np.linalg.eigh(inertia / mass)
    if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + EQUAL_IN_SIX_DIGITS):
        return None
    if np.ptp(moments) <= EQUAL_IN_SIX_DIGITS * moments[2]:
        return {"kind": "ball", "radius": float(np.sqrt(2.5 * moments.mean())), "center": plain(com)}
    for alone, pair in ((2, (0, 1)), (0, (1, 2))):
        across = moments[list(pair)]
        if np.ptp(across) > EQUAL_IN_SIX_DIGITS * moments[2]:
            continue
        radius = np.sqrt(2.0 * moments[alone])
        length = np.sqrt(max(0.0, 12.0 * (across.mean() - 0.5 * moments[alone])))
        axis = axes[:, alone]
        return {
            "kind": "cylinder", "radius": float(radius), "length": float(max(length, 0.02 * radius)),
            "center": plain(com), "axis": plain(axis),
        }  # fmt: skip
    if abs(np.linalg.det(axes) + 1.0) < MIRRORED:
        axes = axes * [1.0, 1.0, -1.0]
    sides = np.sqrt(np.maximum(0.0, 6.0 * (moments.sum() - 2.0 * moments)))
    sides = np.maximum(sides, 0.02 * sides.max())
    return {"kind": "box", "size": plain(sides), "center": plain(com), "axes": [plain(axes[:, k]) for k in range(3)]}


def outline(points: FloatArray, com: FloatArray, size: float) -> dict[str, Any]:
    """Shape of a body from points (np, 3) in body axes: kind and the points that draw it, in order.

    `rod` between two points or the ends of a line, `plate` around points in a plane, `star` from the middle
    to points in space, `hammer` from a single point to the centre of mass, `ball` when there is no extent.
    Points as near as six digits of `size` are one.
    """
    near = EQUAL_IN_SIX_DIGITS * size
    distinct: list[FloatArray] = []
    for point in points:
        if all(np.linalg.norm(point - other) > near for other in distinct):
            distinct.append(point)
    if len(distinct) < 2:
        ends = [end for end in (com, np.zeros(3)) if distinct and np.linalg.norm(end - distinct[0]) > near]
        if ends:
            return {"kind": "hammer", "points": [plain(distinct[0]), plain(ends[0])]}
        return {"kind": "ball", "points": [plain(distinct[0] if distinct else com)]}

    cloud = np.array(distinct)
    middle = cloud.mean(axis=0)
    _, extent, axes = np.linalg.svd(cloud - middle, full_matrices=False)
    thin = VISIBLE * extent[0]
    if len(distinct) == 2 or extent[1] <= thin:
        along = (cloud - middle) @ axes[0]
        return {"kind": "rod", "points": [plain(cloud[along.argmin()]), plain(cloud[along.argmax()])]}
    if len(extent) < 3 or extent[2] <= thin:
        ring = hull((cloud - middle) @ axes[:2].T)
        return {"kind": "plate", "points": [plain(cloud[i]) for i in ring]}
    return {"kind": "star", "points": [plain(middle), *(plain(p) for p in cloud)]}


def view(
    points: FloatArray, gravity: FloatArray | None, normal: FloatArray | None, layers: FloatArray | None = None
) -> dict[str, Any]:
    """Axes of the first view: `right`, `up` and `back` (towards the viewer), a right-handed set in the world.

    Up is opposite to gravity; without gravity, y for a mechanism seen along z and z otherwise. `normal` is
    the normal of a planar mechanism, seen face-on; None asks for a three-quarter view of a spatial one, as
    `azimuth` and `elevation` [rad] about these axes. Of several such views the one is taken in which `points`
    (np, 3) spread most and hide each other least. `layers` (nl, 3) are places of different parts at one instant:
    where such parts of a planar mechanism lie behind each other, it is seen from aside too, so that cylinders of
    an engine stand in a row.
    """
    if normal is None:
        up = _up(gravity, None)
        back = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < NEARLY_ALONG else np.array([0.0, -1.0, 0.0])
    else:
        back = normal / np.linalg.norm(normal)
        up = _up(gravity, back)
    back = _unit(back - (back @ up) * up)
    right = np.cross(up, back)
    if normal is not None and right[np.abs(right).argmax()] < 0:
        right, back = -right, -back  # world axes should run to the right
    chosen = {"right": plain(right), "up": plain(up), "back": plain(back), "azimuth": 0.0, "elevation": 0.0}
    parts = points[:: max(1, len(points) // 60)] if layers is None or len(layers) < 2 else layers
    deep = normal is not None and float(np.ptp(parts @ back)) > DEEP * float(np.linalg.norm(np.ptp(parts, axis=0)))
    if normal is None or deep or _hidden(parts, right, up, back, 0.0, 0.0) > MOSTLY_SEEN:
        trials = [(azimuth, tilt) for tilt in (0.38, 0.6) for azimuth in (0.6, -0.6, 1.0, -1.0, 0.35, -0.35)]
        spread = [_area(points, right, up, back, *trial) for trial in trials]
        widest = max(spread) or 1.0
        worth = [
            area / widest - 2.0 * _hidden(parts, right, up, back, *trial) - 0.01 * n
            for n, (area, trial) in enumerate(zip(spread, trials, strict=True))
        ]
        chosen["azimuth"], chosen["elevation"] = trials[int(np.argmax(worth))]
    return chosen


def _hidden(
    parts: FloatArray, right: FloatArray, up: FloatArray, back: FloatArray, azimuth: float, elevation: float
) -> float:
    """Fraction of the parts (np, 3) that lie behind another one, apart in space but not in the picture."""
    across, towards = _seen(right, up, back, azimuth, elevation)
    apart = np.linalg.norm(parts[:, None] - parts[None], axis=2)
    size = float(apart.max(initial=0.0))
    if size == 0.0:
        return 0.0
    picture = np.stack([parts @ across, parts @ np.cross(towards, across)], axis=1)
    near = np.linalg.norm(picture[:, None] - picture[None], axis=2) < BEHIND * size
    return float((near & (apart > APART * size)).any(axis=1).mean())


def plane_normal(points: FloatArray) -> FloatArray | None:
    """Normal of the plane in which points (np, 3) lie best; None when they lie on a line or in one place."""
    _, extent, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(extent) < 3 or extent[1] <= EQUAL_IN_SIX_DIGITS * extent[0]:
        return None
    normal: FloatArray = axes[2]
    return normal


def _up(gravity: FloatArray | None, back: FloatArray | None) -> FloatArray:
    """Unit vector shown upwards; perpendicular to `back` when that is given."""
    wanted = [] if gravity is None else [-gravity]
    if back is None:
        wanted.append(np.array([0.0, 0.0, 1.0]))
        return next(_unit(w) for w in wanted if np.linalg.norm(w) > 0)
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    wanted += [y, z] if abs(back[2]) > NEARLY_ALONG else [z, y]
    thin = [w - (w @ back) * back for w in wanted]
    left = (np.linalg.norm(f) > SHORTENED * np.linalg.norm(w) for f, w in zip(thin, wanted, strict=True))
    return next(_unit(f) for f, seen in zip(thin, left, strict=True) if seen)


def _area(
    points: FloatArray, right: FloatArray, up: FloatArray, back: FloatArray, azimuth: float, elevation: float
) -> float:
    """Measure of how widely points spread over the picture: product of their two spreads."""
    across, towards = _seen(right, up, back, azimuth, elevation)
    picture = np.stack([points @ across, points @ np.cross(towards, across)])
    return float(np.prod(np.linalg.svd(picture - picture.mean(axis=1, keepdims=True), compute_uv=False)))


def _seen(
    right: FloatArray, up: FloatArray, back: FloatArray, azimuth: float, elevation: float
) -> tuple[FloatArray, FloatArray]:
    """Directions of a view in the world: to the right of the picture, and towards the viewer."""
    across: FloatArray = np.cos(azimuth) * right - np.sin(azimuth) * back
    towards: FloatArray = (
        np.cos(elevation) * (np.cos(azimuth) * back + np.sin(azimuth) * right) + np.sin(elevation) * up
    )
    return across, towards


def hull(thin: FloatArray) -> list[int]:
    """Indices of the convex hull of points (np, 2), around (Andrew's monotone chain)."""
    order = np.lexsort((thin[:, 1], thin[:, 0]))

    def half(indices: list[int]) -> list[int]:
        chain: list[int] = []
        for i in indices:
            while len(chain) > 1:
                a, b = thin[chain[-1]] - thin[chain[-2]], thin[i] - thin[chain[-1]]
                if a[0] * b[1] - a[1] * b[0] > 0:
                    break
                chain.pop()
            chain.append(i)
        return chain[:-1]

    forward = [int(i) for i in order]
    return half(forward) + half(forward[::-1])


def _unit(vector: FloatArray) -> FloatArray:
    scaled: FloatArray = vector / np.linalg.norm(vector)
    return scaled


def plain(vector: FloatArray) -> list[float]:
    """A list for JSON, without invisible digits."""
    return [float(f"{x:.7g}") for x in vector]
