"""A periodic motion as a closed curve, its multipliers in the unit circle; families of them over a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .files import PathLike, save_figure
from .style import COLOURS, dressed, new_figure, plain

WIDEST = 1.25
"""Half the width of the picture of the multipliers. Scale: size of the largest, at least 1. Reason: a margin beside
the unit circle."""


class CycleView(Protocol):
    """Input: one cycle."""

    @property
    def result(self) -> Any: ...
    @property
    def multipliers(self) -> NDArray[np.complex128]: ...
    @property
    def period(self) -> float: ...


class CyclesView(Protocol):
    """Input: cycles over a parameter."""

    @property
    def parameter(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def values(self) -> NDArray[np.float64]: ...
    @property
    def cycles(self) -> Sequence[Any]: ...
    @property
    def curve_values(self) -> NDArray[np.float64]: ...
    @property
    def curve_low(self) -> NDArray[np.float64]: ...
    @property
    def curve_high(self) -> NDArray[np.float64]: ...
    @property
    def curve_unstable(self) -> NDArray[np.int_]: ...
    @property
    def curve_multipliers(self) -> NDArray[np.complex128]: ...
    @property
    def special(self) -> Sequence[Any]: ...


def plot_cycle(found: CycleView, coordinate: int, path: PathLike | None = None) -> Figure:
    """Rate over position of one coordinate, and the multipliers."""
    figure = new_figure(9.5, 4.5)
    left, right = figure.subplots(1, 2)
    run = found.result
    name = run.names.velocities[coordinate]
    place = list(run.names.coordinates).index(name)
    dressed(left, f"{run.title}: {found.period:.6g} s", f"rate of {name}", time_axis=False)
    left.set_xlabel(plain(name), fontsize=9)
    left.plot(run.q[:, place], run.v[:, coordinate], color=COLOURS[0], linewidth=1.5)
    left.plot(run.q[:1, place], run.v[:1, coordinate], "o", color=COLOURS[1], markersize=5, label="start")
    left.legend(fontsize=8, frameon=False)
    _circle(right, found.multipliers)
    if path is not None:
        save_figure(figure, path)
    return figure


def _circle(ax: Axes, values: NDArray[np.complex128]) -> None:
    dressed(ax, "Multipliers", "imaginary part", time_axis=False)
    ax.set_xlabel("real part", fontsize=9)
    turn = np.linspace(0.0, 2.0 * np.pi, 201)
    ax.plot(np.cos(turn), np.sin(turn), color="#888888", linewidth=0.9)
    for outside, colour, word in ((False, COLOURS[0], None), (True, COLOURS[1], "grows")):
        own = values[(np.abs(values) > 1.0) == outside]
        if own.size:
            ax.plot(own.real, own.imag, "x", color=colour, markersize=8, markeredgewidth=1.8, label=word)
    widest = WIDEST * float(np.abs(values).max(initial=1.0))
    ax.set_xlim(-widest, widest)
    ax.set_ylim(-widest, widest)
    ax.set_aspect("equal")
    if np.any(np.abs(values) > 1.0):
        ax.legend(fontsize=8, frameon=False)


def plot_cycles(found: CyclesView, coordinate: int, path: PathLike | None = None) -> Figure:
    """Least and largest value of one coordinate in each cycle over the parameter, and the sizes of the multipliers."""
    figure = new_figure(7.5, 6.5)
    upper, lower = figure.subplots(2, 1, sharex=True)
    name = found.names[coordinate]
    dressed(upper, f"{found.title}: periodic motions", f"{plain(name)}, least and largest", time_axis=False)
    dressed(lower, "", "size of the multipliers", time_axis=False)
    lower.set_xlabel(plain(found.parameter), fontsize=9)
    calm = found.curve_unstable == 0
    labelled: set[bool] = set()
    for first, last in _parts(calm):
        style = {"linewidth": 1.6} if calm[first] else {"linewidth": 1.1, "linestyle": "--"}
        for rows in (found.curve_low, found.curve_high):
            label = None if calm[first] in labelled else "stable" if calm[first] else "unstable"
            labelled.add(bool(calm[first]))
            x = found.curve_values[first : last + 1]
            upper.plot(x, rows[first : last + 1, coordinate], color=COLOURS[0], label=label, **style)
    order = np.sort(np.abs(found.curve_multipliers), axis=1)
    for column in order.T:
        lower.plot(found.curve_values, column, color=COLOURS[0], linewidth=1.3)
    lower.axhline(1.0, color="#888888", linewidth=0.9)
    marks = {"fold": "^", "period doubling": "s", "Neimark-Sacker": "o", "branch point": "D"}
    for word, mark in marks.items():
        ones = [one.value for one in found.special if one.what == word]
        if ones:
            lower.plot(ones, np.ones(len(ones)), mark, color=COLOURS[1], markersize=6, label=word)
    upper.legend(fontsize=8, frameon=False)
    if found.special:
        lower.legend(fontsize=8, frameon=False)
    upper.margins(x=0.03)
    if path is not None:
        save_figure(figure, path)
    return figure


def _parts(calm: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches of one kind, each up to the first point of the next."""
    cuts = [0, *(int(i) + 1 for i in np.flatnonzero(np.diff(calm))), len(calm)]
    return [(a, min(b, len(calm) - 1)) for a, b in pairwise(cuts)]
