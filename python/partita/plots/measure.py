"""The projective measure of every coordinate, with the independent ones as a strip on top."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.gridspec import GridSpecFromSubplotSpec, SubplotSpec

from ..result_view import ResultView
from .events import mark_events
from .style import COLOURS, Canvas, dressed, empty, legend, plain, reporting, wrapped

GREY = "#bbbbbb"
WIDE = 0.06
"""A band that is longer has the name of its coordinate. Scale: fraction of the time shown. Reason: a name needs as
much."""
STRIPS = 6


def draw_measure(result: ResultView, canvas: Canvas, cell: SubplotSpec) -> None:
    """rho of each coordinate over time below, the independent ones above."""
    rows = min(result.independent.shape[1], STRIPS)
    if rows == 0 or len(result.t) == 0:
        ax = dressed(canvas.add_subplot(cell), "Projective measure", "ρ")
        empty(ax, "no independent coordinates: every position is prescribed")
        return
    grid = GridSpecFromSubplotSpec(2, 1, cell, height_ratios=[0.09 * max(rows, 1.4), 1.0], hspace=0.04)
    strip, ax = canvas.add_subplot(grid[0]), canvas.add_subplot(grid[1])
    columns = reporting(result, result.measure)
    colour = {i: COLOURS[n] for n, i in enumerate(columns)}
    dressed(ax, "", "ρ  (1 = free, 0 = locked)")
    for i in columns:
        ax.plot(result.t, result.measure[:, i], color=colour[i], lw=1.3, label=wrapped(result.names.velocities[i]))
    ax.set_ylim(-0.03, 1.05)
    if not set(np.unique(settled(result.independent)[:, :rows]).tolist()) <= set(columns):
        ax.plot([], [], color=GREY, lw=5, label="others (strip)")
    legend(ax, len(columns), result.measure.shape[1], "shown")
    mark_events(ax, result)
    _draw_strip(result, strip, colour, rows)
    strip.sharex(ax)
    strip.tick_params(labelbottom=False, length=0)


def _draw_strip(result: ResultView, ax: Axes, colour: dict[int, str], rows: int) -> None:
    """One band per independent coordinate, in the colour of its line below."""
    for row, name_of_band in enumerate(bands(result)[:rows]):
        for start, end, i in name_of_band:
            ax.broken_barh([(start, end - start)], (rows - row - 0.92, 0.84), color=colour.get(i, GREY), lw=0)
            wide = result.t[-1] > result.t[0] and (end - start) > WIDE * (result.t[-1] - result.t[0])
            if wide and rows <= 3:
                ax.text(
                    (start + end) / 2, rows - row - 0.52, plain(result.names.velocities[i]),
                    ha="center", va="center", fontsize=7, color="white" if i in colour else "black", clip_on=True,
                )  # fmt: skip
    k = result.independent.shape[1]
    hidden = f" ({rows} of {k})" if k > rows else ""
    ax.set_title(f"Measure; on top: independent{hidden}", loc="left", fontsize=10, fontweight="bold")
    ax.set_ylim(0, rows)
    ax.set_yticks([])
    for side in ("top", "right", "left", "bottom"):
        ax.spines[side].set_visible(False)


def bands(result: ResultView) -> list[list[tuple[float, float, int]]]:
    """For each position in the list of independent coordinates: spans (from, to, column of v) between the outputs.

    A coordinate that remains independent keeps its place when another one is switched.
    """
    t, chosen = result.t, settled(result.independent)
    if len(t) < 2:
        return [[(float(t[0]), float(t[0]), int(i))] for i in chosen[0]]
    found = []
    for column in chosen.T:
        changes = np.flatnonzero(np.diff(column)) + 1
        edges = [0, *changes.tolist(), len(t) - 1]
        found.append([(float(t[a]), float(t[b]), int(column[a])) for a, b in pairwise(edges) if b > a])
    return found


def settled(independent: np.ndarray) -> np.ndarray:
    """The same choices with each coordinate kept in one column for as long as it stays independent."""
    kept = independent.copy()
    for n in range(1, len(kept)):
        if np.array_equal(independent[n], independent[n - 1]):
            kept[n] = kept[n - 1]
            continue
        new = [i for i in independent[n] if i not in kept[n - 1]]
        kept[n] = [i if i in independent[n] else new.pop(0) for i in kept[n - 1]]
    return kept
