"""One joint: its motion, force, moment, drive."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..naming import column_names, joint_units
from ..result_view import ResultView, least
from .abscissa import Abscissa, abscissa
from .events import mark_events
from .style import COLOURS, Canvas, dressed, empty, ending, legend, level, plain, unit_label


def draw_joint(result: ResultView, name: str, canvas: Canvas, axes: str = "world", x: Abscissa | None = None) -> None:
    """Position, velocity, force and moment of the joint `name` in four panels.

    Reaction components that are not unique are drawn dashed and marked in the legend.
    """
    x = x or abscissa(result, None)
    joint = result.joint(name).in_frame(axes)
    about = result.summary["joints"][result.names.joints.index(name)]
    grid = canvas.subplots(2, 2, sharex=True)
    title = f"{result.title}: joint {name} ({joint.kind}, {joint.parent} → {joint.child}){ending(result)}"
    canvas.suptitle(plain(title), fontsize=11)
    q_units, v_units = joint_units(about)

    def small(units: list[str]) -> float:
        return least(result, units[0]) if units else 0.0

    words = list(about.get("axes", ()))
    _motion(grid[0, 0], x, joint.position, column_names("", words, len(q_units)), "Position", q_units, small(q_units))
    rates = [f"{unit}/s" for unit in v_units]
    _motion(grid[0, 1], x, joint.velocity, column_names("", words, len(v_units)), "Velocity", rates, small(rates))
    grid[0, 1].set_title(f"Velocity{_effort(result, joint, rates)}", loc="left", fontsize=10, fontweight="bold")
    _wrench(
        grid[1, 0],
        x,
        joint.force,
        joint.determined[:3],
        f"Force on {joint.child}, {joint.axes} axes",
        "N",
        least(result, "N"),
    )
    title = f"Moment on {joint.child} about the joint"
    _wrench(grid[1, 1], x, joint.moment, joint.determined[3:], title, "N m", least(result, "N m"))
    panels = [ax for ax in grid.flat if ax.lines and x.is_time]
    for ax in panels:
        mark_events(ax, result, names=ax is panels[0])


def _motion(
    ax: Axes, x: Abscissa, values: NDArray[np.float64], labels: list[str], title: str, units: list[str], small: float
) -> None:
    dressed(ax, title, f"{title.lower()}{unit_label(units)}", time_axis=False)
    if values.shape[1] == 0:
        empty(ax, "this joint has no degree of freedom")
        return
    for i in range(values.shape[1]):
        x.plot(ax, values[:, i], color=COLOURS[i], lw=1.2, label=labels[i].lstrip(".") or "along the axis")
    level(ax, values, small)
    if values.shape[1] > 1:
        legend(ax, values.shape[1], values.shape[1], "coordinates")


def _wrench(
    ax: Axes, x: Abscissa, values: NDArray[np.float64], unique: NDArray[np.bool_], title: str, unit: str, small: float
) -> None:
    dressed(ax, title, f"[{unit}]")
    x.dress(ax)
    for i, letter in enumerate("xyz"):
        style = "-" if unique[i] else "--"
        label = letter if unique[i] else f"{letter} (not unique)"
        x.plot(ax, values[:, i], style, color=COLOURS[i], lw=1.2, label=label)
    legend(ax, 3, 3, "components")
    level(ax, values, small)


def _effort(result: ResultView, joint: Any, rates: list[str]) -> str:
    """For the title of the velocities: the largest effort of the drive, if there is one."""
    peaks = np.max(np.abs(joint.drive), axis=0, initial=0.0)
    units = ["N" if rate == "m/s" else "N m" for rate in rates]
    known = np.where(joint.drive_determined, "", ", not unique")
    words = [f"{peak:.3g} {unit}{more}" for peak, unit, more in zip(peaks, units, known, strict=True)
             if peak > least(result, unit)]  # fmt: skip
    return f"; drive up to {', '.join(words)}" if words else ""
