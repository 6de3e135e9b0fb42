"""Many curves in one panel: coincident curves are distinguished, and curves for which there is no space become a
band."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from .abscissa import Abscissa
from .style import COLOURS, legend, wrapped

FloatArray = NDArray[np.float64]

ALIKE = 0.004
"""Curves that differ by less are one line on paper. Scale: fraction of the panel's height. Reason: the width of a
line."""

BAND = "#9aa5b1"


def draw_bundle(
    ax: Axes,
    x: Abscissa,
    values: FloatArray,
    columns: Sequence[int],
    labels: Sequence[str],
    units: Sequence[str],
    left_out: Sequence[int] = (),
    right: Axes | None = None,
) -> None:
    """Columns of `values` (nt, n) as lines with a legend; over time the range of all others as a grey band.

    Of lines that lie on each other the later ones are dashed, so that every colour shows. Others make a band only where
    all columns have one unit; those `left_out` are in neither. Lengths stand in the axes `right` where these are given.
    """
    aside = {i for i in columns if right is not None and is_length(units[i])}
    height = {}
    for side in (False, True):
        shown = values[:, [i for i in columns if (i in aside) == side]]
        finite = shown[np.isfinite(shown)]
        height[side] = float(np.ptp(finite)) if finite.size else 0.0
    rest = [i for i in range(values.shape[1]) if i not in {*columns, *left_out}]
    banded = bool(rest and x.is_time and len(set(units)) == 1)
    if banded:
        low, high = np.min(values[:, rest], axis=1), np.max(values[:, rest], axis=1)
        ax.fill_between(
            x.values, low, high, color=BAND, alpha=0.3, lw=0, label=f"range of {len(rest)} other{'s' * (len(rest) > 1)}"
        )
    drawn: list[int] = []
    for n, i in enumerate(columns):
        near = ALIKE * height[i in aside]
        alike = [np.nanmax(np.abs(values[:, i] - values[:, j]), initial=0.0) <= near
                 for j in drawn if (i in aside) == (j in aside)]  # fmt: skip
        style = (4.0 * sum(alike), (4.0, 5.0)) if any(alike) else "-"
        drawn.append(i)
        where, label = (right, f"{wrapped(labels[i])} (right)") if right is not None and i in aside else (
            ax, wrapped(labels[i]))  # fmt: skip
        x.plot(where, values[:, i], ls=style, color=COLOURS[n % len(COLOURS)], lw=1.2, label=label)
    legend(ax, len(columns), len(columns) if banded else values.shape[1], "shown", right)


def is_length(unit: str) -> bool:
    """m, m/s or m/s^2."""
    return unit == "m" or unit.startswith("m/")
