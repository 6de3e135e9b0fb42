"""Eigenvalues in the complex plane, and where the energy of modes is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .files import PathLike, save_figure
from .style import COLOURS, LIMIT, dressed, empty, new_figure, wrapped

MOST = 12
"""Modes with a bar of their own."""


class ModesView(Protocol):
    """Input: modes with their energies."""

    @property
    def eigenvalues(self) -> NDArray[np.complex128]: ...
    @property
    def modes(self) -> Sequence[Any]: ...
    def energy(self, number: int, of: str = "bodies") -> dict[str, float]: ...


def plot_poles(title: str, eigenvalues: NDArray[np.complex128], path: PathLike | None = None) -> Figure:
    """Eigenvalues in the complex plane."""
    figure = new_figure(5.5, 4.5)
    _poles(figure.subplots(), f"{title}: eigenvalues", eigenvalues)
    if path is not None:
        save_figure(figure, path)
    return figure


def plot_modes(found: ModesView, path: PathLike | None = None) -> Figure:
    """Eigenvalues, and a bar for each mode with its shares of energy."""
    count = min(len(found.modes), MOST)
    figure = new_figure(12.0, max(4.0, 1.6 + 0.35 * count))
    panels = figure.subplots(1, 3)
    _poles(panels[0], "Eigenvalues", found.eigenvalues)
    _shares(panels[1], found, "bodies", "kinetic", count)
    _shares(panels[2], found, "springs", "strain", count)
    if path is not None:
        save_figure(figure, path)
    return figure


def _poles(ax: Axes, title: str, values: NDArray[np.complex128]) -> None:
    dressed(ax, title, "imaginary part [rad/s]", time_axis=False)
    ax.set_xlabel("real part [1/s]", fontsize=9)
    ax.axhline(0.0, color="#888888", linewidth=0.8)
    ax.axvline(0.0, color="#888888", linewidth=0.8)
    for grows, colour, word in ((False, COLOURS[0], None), (True, COLOURS[1], "growing")):
        own = values[(values.real > 0.0) == grows]
        if own.size:
            ax.plot(own.real, own.imag, "x", color=colour, markersize=7, markeredgewidth=1.6, label=word)
    # round-off of real parts is not spread over the axis
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    widest = max(float(np.abs(values.real).max(initial=0.0)), 0.05 * size)
    ax.set_xlim(-1.2 * widest, 1.2 * widest)
    ax.set_ylim(-1.15 * size, 1.15 * size)
    if np.any(values.real > 0.0):
        ax.legend(fontsize=8, frameon=False)


def _shares(ax: Axes, found: ModesView, of: str, kind: str, count: int) -> None:
    dressed(ax, f"{kind.capitalize()} energy of {of}", "", time_axis=False)
    ax.set_xlabel(f"share of the {kind} energy", fontsize=9)
    shares = [found.energy(i, of) for i in range(count)]
    total = {name: sum(one[name] for one in shares) for name in (shares[0] if shares else {})}
    first = sorted(total, key=lambda name: -total[name])[: LIMIT - 1 if len(total) > LIMIT else LIMIT]
    if not first:
        empty(ax, f"no {of}")
        return
    left = np.zeros(count)
    rows = np.arange(count)
    for name, colour in zip(first, COLOURS, strict=False):
        width = np.array([one[name] for one in shares])
        ax.barh(rows, width, left=left, height=0.7, color=colour, label=wrapped(name))
        left += width
    others = np.array([sum(one.values()) for one in shares]) - left
    if len(total) > len(first):
        ax.barh(rows, others, left=left, height=0.7, color="#bbbbbb", label=f"{len(total) - len(first)} others")
    words = [
        f"{mode.number}: {mode.frequency:.3g} Hz" if mode.frequency else f"{mode.number}: {mode.kind}"
        for mode in found.modes[:count]
    ]
    ax.set_yticks(rows, words, fontsize=8)
    ax.set_xlim(0.0, 1.0)
    ax.invert_yaxis()
    # below the bars, which fill the panel
    ax.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
