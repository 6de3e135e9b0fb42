"""Equilibria over a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .files import PathLike, save_figure
from .style import COLOURS, dressed, new_figure, plain


class Family(Protocol):
    """Input: equilibria over a parameter."""

    @property
    def parameter(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def values(self) -> NDArray[np.float64]: ...
    @property
    def states(self) -> Sequence[Any]: ...
    @property
    def folds(self) -> Sequence[Any]: ...
    @property
    def branch_points(self) -> Sequence[Any]: ...
    @property
    def curve_values(self) -> NDArray[np.float64]: ...
    @property
    def curve_q(self) -> NDArray[np.float64]: ...
    @property
    def curve_negative(self) -> NDArray[np.int_]: ...


def plot_family(found: Family, coordinate: int, path: PathLike | None = None) -> Figure:
    """One coordinate over the parameter: stable parts solid, others dashed."""
    figure = new_figure(7.5, 4.5)
    ax = dressed(figure.subplots(), f"{found.title}: equilibria", found.names[coordinate], time_axis=False)
    ax.set_xlabel(plain(found.parameter), fontsize=9)
    # with the folds and branch points between those of the curve, at which stability changes
    passed = [(i, found.curve_values[i], q, found.curve_negative[i]) for i, q in enumerate(found.curve_q)]
    events = [(_place(found, one), one.value, one.state.q, one.after) for one in (*found.folds, *found.branch_points)]
    every = sorted([*passed, *events], key=lambda one: one[0])
    x, y = [one[1] for one in every], [one[2][coordinate] for one in every]
    calm = [one[3] == 0 for one in every]
    first = 0
    labelled: set[bool] = set()
    for i in range(1, len(x)):
        if i == len(x) - 1 or calm[i] != calm[first]:
            label = None if calm[first] in labelled else "stable" if calm[first] else "unstable"
            labelled.add(calm[first])
            style = {"linewidth": 1.6} if calm[first] else {"linewidth": 1.1, "linestyle": "--"}
            ax.plot(x[first : i + 1], y[first : i + 1], color=COLOURS[0], label=label, **style)
            first = i
    for ones, mark, word in ((found.folds, "^", "fold"), (found.branch_points, "D", "branch point")):
        if ones:
            spots = [one.value for one in ones], [one.state.q[coordinate] for one in ones]
            ax.plot(*spots, mark, color=COLOURS[1], markersize=6, label=word)
    asked = found.values, [state.q[coordinate] for state in found.states]
    ax.plot(*asked, "o", color=COLOURS[0], markersize=3.5, label="value asked for")
    ax.margins(x=0.03)
    ax.legend(fontsize=8, frameon=False)
    if path is not None:
        save_figure(figure, path)
    return figure


def _place(found: Family, one: Any) -> float:
    """Between which points of the curve a position lies."""
    q = found.curve_q
    across = np.linalg.norm(np.diff(q, axis=0), axis=1) + np.abs(np.diff(found.curve_values))
    to = np.linalg.norm(q - one.state.q, axis=1) + np.abs(found.curve_values - one.value)
    return float(np.argmin(to[:-1] + to[1:] - across)) + 0.5
