"""Figures of comparisons: cost and error of each formulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ..tolerance import VISIBLE
from .files import PathLike, save_figure
from .style import COLOURS, FLOOR, dressed, empty, new_figure, plain

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


class Compared(Protocol):
    """Input from a comparison: its rows, each with name, formulation, error, evaluations and time."""

    @property
    def title(self) -> str: ...
    @property
    def rows(self) -> Sequence[Any]: ...
    @property
    def reference(self) -> Any: ...


class Precision(Protocol):
    """Input from runs over several tolerances: the points of each name, each with error, evaluations and time."""

    @property
    def title(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def names(self) -> Sequence[str]: ...

    def of(self, name: str) -> Sequence[Any]:
        """The finished runs of one name."""


def plot_comparison(comparison: Compared, path: PathLike | None = None) -> Figure:
    """Error, evaluations and time of every row that finished, one line of dots each; `path` saves it too."""
    rows = [row for row in comparison.rows if row.finished]
    figure = new_figure(11.0, 1.8 + 0.28 * max(len(rows), 3))
    figure.suptitle(plain(f"{comparison.title}: formulations compared"), fontsize=12, fontweight="bold")
    axes = figure.subplots(1, 3, sharey=True)
    columns: tuple[tuple[str, str, list[float | None]], ...] = (
        ("Error", _error_unit(comparison), [row.error for row in rows]),
        ("Evaluations", "number", [row.evaluations for row in rows]),
        ("Time of the run", "[ms]", [None if row.time is None else 1e3 * row.time for row in rows]),
    )
    for ax, (title, unit, values) in zip(axes, columns, strict=True):
        dressed(ax, title, "", time_axis=False)
        known = [(index, value) for index, value in enumerate(values) if value is not None]
        if not known:
            empty(ax, "no run finished" if not rows else "not known")
            continue
        for index, value in known:
            colour = COLOURS[0] if rows[index].formulation == "projective" else COLOURS[1]
            ax.plot([max(value, FLOOR)], [index], "o", color=colour, ms=5)
        ax.set_xlabel(unit, fontsize=9)
        _logarithmic(ax, "x", [max(value, FLOOR) for _, value in known])
    if rows:
        axes[0].set_yticks(range(len(rows)), [plain(row.name) for row in rows], fontsize=8)
        axes[0].set_ylim(len(rows) - 0.5, -0.5)
    if path is not None:
        save_figure(figure, path)
    return figure


def _error_unit(comparison: Compared) -> str:
    """Displacements of bodies are lengths; coordinates of a system have the units of its author."""
    mechanism = comparison.reference is not None and comparison.reference.is_mechanism
    return "against the reference [m]" if mechanism else "against the reference"


NEAR = 1.2
"""On a shorter logarithmic axis the numbers between powers of ten have labels too. Scale: decades, half of the axis.
Reason: two powers of ten are no scale."""


def _logarithmic(ax: Axes, which: str, values: Sequence[float]) -> None:
    """A logarithmic axis with room around the values, and few labels that do not collide, however near they lie."""
    low, high = min(values), max(values)
    middle, half = np.log10(low * high) / 2.0, 0.55 * max(1.0, np.log10(high / low))
    axis = ax.xaxis if which == "x" else ax.yaxis
    (ax.set_xscale if which == "x" else ax.set_yscale)("log")
    (ax.set_xlim if which == "x" else ax.set_ylim)(10.0 ** (middle - half), 10.0 ** (middle + half))
    near = half < NEAR
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if near else (1.0,), numticks=8))
    axis.set_minor_formatter(NullFormatter())
    if near and low > VISIBLE:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def plot_work_precision(found: Precision, path: PathLike | None = None) -> Figure:
    """Error over evaluations and over time, a line for each formulation; `path` saves it too."""
    figure = new_figure(11.0, 4.6)
    figure.suptitle(plain(f"{found.title}: error against work"), fontsize=12, fontweight="bold")
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, title, unit in ((left, "Evaluations", "number"), (right, "Time of the run", "[ms]")):
        label = f"error against the reference{f' [{found.unit}]' if found.unit else ''}"
        dressed(ax, title, label if ax is left else "", time_axis=False)
        ax.set_xlabel(unit, fontsize=9)
    errors: list[float] = []
    work: tuple[list[float], list[float]] = ([], [])
    for number, name in enumerate(found.names):
        points = [p for p in found.of(name) if p.error is not None and p.evaluations and p.time]
        if points:
            error = [max(p.error or 0.0, FLOOR) for p in points]
            errors += error
            both = [float(p.evaluations or 0) for p in points], [1e3 * (p.time or 0.0) for p in points]
            for ax, every, values in zip((left, right), work, both, strict=True):
                every += values
                _line(ax, values, error, number, name)
    if errors:
        for ax, every in zip((left, right), work, strict=True):
            _logarithmic(ax, "x", every)
            _logarithmic(ax, "y", errors)
        right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    else:
        empty(left, "no run finished")
        empty(right, "no run finished")
    if path is not None:
        save_figure(figure, path)
    return figure


def _line(ax: Axes, x: list[float], y: list[float], number: int, label: str) -> None:
    """Colours and markers are cycled; in the second cycle the line is dashed."""
    style = "-" if number < len(COLOURS) else "--"
    marker = MARKERS[(number + number // len(COLOURS)) % len(MARKERS)]
    ax.plot(x, y, style, color=COLOURS[number % len(COLOURS)], marker=marker, ms=4, lw=1.1, label=plain(label))
