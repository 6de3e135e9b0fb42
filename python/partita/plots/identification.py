"""Singular values of a regressor, and base parameters with their standard deviations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .files import PathLike, save_figure
from .style import COLOURS, dressed, legend, new_figure, plain, positive, wrapped

MOST_ROWS_SHOWN = 24
"""Base parameters in one figure."""
MOST_POINTS = 4000
"""Samples of a curve that a vector image holds; of more it holds a picture."""


class SingularValues(Protocol):
    """Input: what is identifiable."""

    @property
    def title(self) -> str: ...
    @property
    def rank(self) -> int: ...
    @property
    def labels(self) -> Sequence[str]: ...
    @property
    def measured(self) -> Sequence[str]: ...
    @property
    def singular_values(self) -> NDArray[np.float64]: ...


class Estimates(Protocol):
    """Input: what was identified."""

    @property
    def title(self) -> str: ...
    @property
    def combinations(self) -> Sequence[Any]: ...
    @property
    def t(self) -> NDArray[np.float64]: ...
    @property
    def residuals(self) -> Mapping[str, NDArray[np.float64]]: ...


def plot_singular_values(found: SingularValues, path: PathLike | None = None) -> Figure:
    """Those of determined combinations and the others in different colours."""
    figure = new_figure(7.0, 3.6)
    ax = figure.subplots()
    values = np.asarray(found.singular_values)
    values = positive(values / (values.max(initial=0.0) or 1.0))
    numbers = np.arange(1, len(values) + 1)
    dressed(ax, plain(f"{found.title}: {', '.join(found.measured)}"), "singular value / largest", time_axis=False)
    ax.set_xlabel("number", fontsize=9)
    ax.margins(x=0.03)
    for part, colour, word in (
        (slice(0, found.rank), COLOURS[0], f"determined: {found.rank}"),
        (slice(found.rank, None), COLOURS[1], f"not determined: {len(values) - found.rank}"),
    ):
        ax.semilogy(numbers[part], values[part], "o", color=colour, label=word)
    if 0 < found.rank < len(values):
        ax.axvline(found.rank + 0.5, color="0.5", linewidth=0.8, linestyle=":")
    legend(ax, 2, 2, "kinds")
    if path is not None:
        save_figure(figure, path)
    return figure


def plot_identification(found: Estimates, path: PathLike | None = None) -> Figure:
    """Change of each base parameter in its standard deviations' bars, and the residuals over time."""
    shown = list(found.combinations)[:MOST_ROWS_SHOWN]
    figure = new_figure(9.0, 3.0 + 0.26 * len(shown))
    above, below = figure.subplots(2, 1, height_ratios=[max(1.0, 0.26 * len(shown)), 2.0])
    rows = np.arange(len(shown))[::-1]
    size = np.array([one.size for one in shown])
    changes = np.array([one.estimate - one.prior for one in shown]) / size
    bars = 3.0 * np.array([one.sd for one in shown]) / size
    dressed(above, plain(f"{found.title}: identified combinations"), "", time_axis=False)
    kept = np.array([not one.drowned for one in shown])
    for which, colour, word in ((kept, COLOURS[0], "estimate, 3 sd"), (~kept, COLOURS[1], "drowned in noise")):
        if which.any():
            above.errorbar(changes[which], rows[which], xerr=bars[which], fmt="o", color=colour, capsize=3, label=word)
    above.axvline(0.0, color="0.5", linewidth=0.8, linestyle=":")
    above.set_yticks(rows, [wrapped(one.name) for one in shown], fontsize=8)
    above.set_xlabel("change from the prior / natural size", fontsize=9)
    above.margins(x=0.03)
    legend(above, 2, 2, "kinds")
    dressed(below, "Residuals", "measured less computed")
    for (name, values), colour in zip(found.residuals.items(), COLOURS, strict=False):
        image = len(values) > MOST_POINTS
        below.plot(found.t, values, color=colour, linewidth=0.6, label=wrapped(name), rasterized=image)
    legend(below, len(found.residuals), len(found.residuals), "channels")
    if path is not None:
        save_figure(figure, path)
    return figure
