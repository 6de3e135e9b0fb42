"""Efforts of actuators over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..result_view import least
from .files import PathLike, save_figure
from .style import COLOURS, LIMIT, dressed, legend, level, new_figure, plain, wrapped


class Efforts(Protocol):
    """Input: the result of inverse dynamics."""

    @property
    def t(self) -> NDArray[np.float64]: ...
    @property
    def actuators(self) -> tuple[str, ...]: ...
    @property
    def units(self) -> tuple[str, ...]: ...
    @property
    def efforts(self) -> NDArray[np.float64]: ...
    @property
    def margin(self) -> NDArray[np.float64]: ...
    @property
    def limits(self) -> NDArray[np.float64] | None: ...
    @property
    def run(self) -> Any: ...


def plot_efforts(found: Efforts, chosen: Sequence[int], path: PathLike | None = None) -> Figure:
    """A panel for each unit, with the limits, and the margin below."""
    units = list(dict.fromkeys(found.units[i] for i in chosen))
    figure = new_figure(9.0, 2.4 * (len(units) + 1))
    figure.suptitle(plain(f"{found.run.title}: efforts"), fontsize=12, fontweight="bold")
    panels = figure.subplots(len(units) + 1, 1, sharex=True, squeeze=False)[:, 0]
    for ax, unit in zip(panels, units, strict=False):
        own = [i for i in chosen if found.units[i] == unit]
        dressed(ax, "Torques" if unit == "N m" else "Forces", f"effort [{unit}]", time_axis=False)
        for i, colour in zip(own[:LIMIT], COLOURS, strict=False):
            ax.plot(found.t, found.efforts[:, i], color=colour, linewidth=1.4, label=wrapped(found.actuators[i]))
            for limit in () if found.limits is None else found.limits[i]:
                ax.axhline(limit, color=colour, linewidth=0.8, linestyle=":")
        level(ax, found.efforts[:, own], least(found.run, unit))
        legend(ax, min(len(own), LIMIT), len(own), "actuators")
    dressed(panels[-1], "Margin of the set", "margin")
    panels[-1].plot(found.t, found.margin, color=COLOURS[0], linewidth=1.4)
    panels[-1].set_ylim(0.0, None)
    if path is not None:
        save_figure(figure, path)
    return figure
