"""Events of a run in figures over time: thin lines, and their names above the curves."""

from __future__ import annotations

from textwrap import shorten
from typing import Any

from matplotlib.axes import Axes

from ..result_view import happened
from .style import plain

MOST = 24
"""Instants with events that have lines; more would hide the curves."""
ONE = 0.004
"""Events that are nearer to each other share a line. Scale: fraction of the time shown. Reason: the width of a line."""
ROWS = 3
"""Rows of names above the curves; those without space are left out."""
LONGEST = 24
"""Letters at a line."""
LETTER, HEIGHT, LEGEND = 3.7, 9.5, 0.85
"""Width of a letter and height of a row [points], and the part of a panel's width that its legend leaves."""


def mark_events(ax: Axes, result: Any, *, names: bool = False, right: Axes | None = None) -> None:
    """A thin line at every event of a panel over time, where there are few. With `names` these stand above the curves,
    also above those of the axes `right`, for which both make room."""
    found = instants(result)
    if not 0 < len(found) <= MOST:
        return
    for t, _ in found:
        ax.axvline(t, color="#6b7785", lw=0.8, ls=(0, (2, 2)), zorder=0.9, clip_on=False)
    if names:
        _write(ax, found, float(result.t[0]), float(result.t[-1] - result.t[0]), right)


def _write(ax: Axes, found: list[tuple[float, list[str]]], first: float, span: float, right: Axes | None) -> None:
    """Names beside their lines, each in the lowest row that has space for it."""
    root = ax.get_figure(root=True)
    assert root is not None
    width, height = LEGEND * ax.bbox.width * 72.0 / root.dpi, ax.bbox.height * 72.0 / root.dpi
    ends = [-1.0] * ROWS
    placed = []
    for t, words in found:
        text = shorten(", ".join(words), LONGEST, placeholder=" …")
        size, at = (len(text) + 1) * LETTER / width, (t - first) / span
        before = at + size > 1.0  # it would leave the panel
        start = at - size if before else at
        row = next((i for i, end in enumerate(ends) if start >= end), None)
        if row is not None:
            ends[row] = start + size
            placed.append((t, text, row, before))
    rows = 1 + max((row for _, _, row, _ in placed), default=-1)
    part = HEIGHT / height
    for panel in [ax] if right is None else [ax, right]:
        low, high = panel.get_ylim()
        panel.set_ylim(low, low + (high - low) / (1.0 - rows * part))
    for t, text, row, before in placed:
        ax.annotate(
            plain(text),
            (t, 1.0 - (rows - 1 - row + 0.5) * part),
            (-2.0 if before else 2.0, 0.0),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            ha="right" if before else "left",
            va="center",
            fontsize=6.5,
            color="#4b5563",
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
        )


def instants(result: Any) -> list[tuple[float, list[str]]]:
    """Times at which something happened, and the names of what did, each once; none of a run of one instant."""
    events = happened(result)
    if len(result.t) < 2 or not len(events):
        return []
    near = ONE * float(result.t[-1] - result.t[0])
    found: list[tuple[float, list[str]]] = []
    for event in events:
        if not found or event.t - found[-1][0] > near:
            found.append((float(event.t), []))
        if event.name not in found[-1][1]:
            found[-1][1].append(str(event.name))
        if len(found) > MOST:
            break
    return found
