"""Paths of points, and directions of bearing loads: figures in space rather than over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import shown
from ..result_view import ResultView
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .style import COLOURS, LIMIT, Canvas, dressed, empty, legend, plain, wrapped

FloatArray = NDArray[np.float64]

MOST_BEARINGS = 6
TURNING = ("revolute", "cylindrical")


def draw_paths(result: ResultView, canvas: Canvas, points: Mapping[str, Any] | None = None) -> None:
    """Paths of `points`, {name: (body, point in body axes)}, or of joints that travel, true to scale in their plane."""
    ax = dressed(canvas.subplots(), "Paths of points" if points else "Paths of joints", "", time_axis=False)
    found = _asked(result, points) if points else {name: result.joint(name).point for name in result.names.joints}
    travel = {
        name: float(np.max(np.ptp(path, axis=0), initial=0.0) if len(path) else 0.0) for name, path in found.items()
    }
    size = max(travel.values(), default=0.0)
    seen = (name for name in found if travel[name] > EQUAL_IN_SIX_DIGITS * size)
    moving = sorted(seen, key=lambda name: -travel[name])[:LIMIT]
    if not moving:
        empty(ax, "nothing moves" if found else "no joints and no points")
        return
    across, up, words = _plane(np.concatenate([found[name] for name in moving]))
    for n, name in enumerate(moving):
        x, y = found[name] @ across, found[name] @ up
        ax.plot(x, y, color=COLOURS[n], lw=1.3, label=wrapped(name))
        ax.plot(x[:1], y[:1], "o", color=COLOURS[n], ms=4)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.06)
    ax.set_xlabel(f"{words[0]} [m]", fontsize=9)
    ax.set_ylabel(f"{words[1]} [m]", fontsize=9)
    legend(ax, len(moving), len(found), "shown; dots: start")


def _asked(result: ResultView, points: Any) -> dict[str, FloatArray]:
    if not isinstance(points, Mapping):
        raise ArgumentError(
            f"points must be a mapping from names to (body, point), not {shown(points)}", argument="points"
        )
    found = {}
    for name, given in points.items():
        if not isinstance(given, tuple | list) or len(given) != 2:
            raise ArgumentError(
                f"points: {name!r} must be (body, point in body axes), not {shown(given)}", argument="points"
            )
        body: Any = getattr(given[0], "name", given[0])
        known = list(result.names.bodies)
        found[str(name)] = np.asarray(result.body(known[index_of(body, known, "body")]).point(given[1]))
    return found


IN_PLANE = 0.98
"""A plane of paths nearer to one of the world is shown as that. Scale: cosine of the angle. Reason: ten degrees
shorten nothing that is seen."""


def _plane(points: FloatArray) -> tuple[FloatArray, FloatArray, tuple[str, str]]:
    """The two directions in which paths spread most: world axes if these do, else other directions."""
    points = points[np.isfinite(points).all(axis=1)]
    _, extent, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    normal = axes[2] if len(axes) > 2 else np.array([0.0, 0.0, 1.0])
    least = int(np.abs(normal).argmax())
    if abs(normal[least]) > IN_PLANE or extent[1] < EQUAL_IN_SIX_DIGITS * extent[0]:
        i, j = ((1, 2), (0, 2), (0, 1))[least]
        return np.eye(3)[i], np.eye(3)[j], ("xyz"[i], "xyz"[j])
    return axes[0], axes[1], ("along the widest direction", "across it")


def draw_bearings(result: ResultView, canvas: Canvas) -> None:
    """The force of each bearing as a polar curve: magnitude over direction across its axis; the most loaded ones.

    Directions are those of the joint's axes on its parent, so that a curve shows which part of the seat wears.
    """
    loads = []
    for name in result.names.joints:
        joint = result.joint(name).in_frame("joint")
        if joint.kind in TURNING:
            loads.append((float(np.nanmax(np.hypot(*joint.force.T[:2]), initial=0.0)), name, joint))
    loads = sorted((load for load in loads if load[0] > 0.0), key=lambda load: -load[0])
    if not loads:
        empty(dressed(canvas.subplots(), "Loads of bearings", "", time_axis=False), "no revolute joint is loaded")
        return
    kept = loads[:MOST_BEARINGS]
    columns = min(3, len(kept))
    for n, (_, name, joint) in enumerate(kept):
        ax = canvas.add_subplot(-(-len(kept) // columns), columns, n + 1, projection="polar")
        assert isinstance(ax, PolarAxes)
        unique = bool(joint.determined[:2].all())
        x, y = joint.force[:, 0], joint.force[:, 1]
        ax.plot(np.arctan2(y, x), np.hypot(x, y), "-" if unique else "--", color=COLOURS[n], lw=1.2)
        ax.set_title(f"{plain(name)} [N]{'' if unique else ', not unique'}", fontsize=10, fontweight="bold")
        ax.tick_params(labelsize=7)
        ax.grid(True, color="#dddddd", linewidth=0.6)
        ax.yaxis.set_major_locator(MaxNLocator(4))
    more = "" if len(loads) == len(kept) else f"the {len(kept)} most loaded of {len(loads)}; "
    canvas.supxlabel(f"{more}direction across the axis, in the joint's axes on its parent", fontsize=8, color="#555555")
