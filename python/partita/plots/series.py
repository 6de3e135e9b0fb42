"""Panels of coordinates, closing errors and energy, each drawn into given axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..naming import coordinate_units
from ..readable import Readable
from .style import COLOURS, dressed, empty, legend, positive, shortened, telling, unit_label


def draw_coordinates(result: Readable, ax: Axes) -> None:
    """q over time; where there are too many, the independent ones and those that move most."""
    columns = telling(result, result.q) if result.q.shape[1] == result.v.shape[1] else _widest(result)
    units = coordinate_units(result.summary, result.names)[0]
    dressed(ax, "Coordinates", f"q{unit_label([units[i] for i in columns])}")
    for n, i in enumerate(columns):
        ax.plot(result.t, result.q[:, i], color=COLOURS[n], lw=1.2, label=shortened(result.names.coordinates[i]))
    legend(ax, len(columns), result.q.shape[1], "shown")


def _widest(result: Readable) -> list[int]:
    """With quaternions the columns of q are not those of v: choose by movement alone."""
    span = np.ptp(result.q, axis=0) if len(result.q) else np.zeros(result.q.shape[1])
    return sorted(int(i) for i in np.argsort(-span, kind="stable")[: len(COLOURS)])


def draw_sensor(result: Readable, name: str, ax: Axes) -> None:
    """What a sensor read over time: a line for each of its numbers."""
    read = result.sensor(name)
    columns = read.values.reshape(len(result.t), -1)
    dressed(ax, f"{name}: {read.text}", f"{name}{unit_label([read.unit])}")
    labels = "xyz" if columns.shape[1] == 3 else [str(i) for i in range(columns.shape[1])]
    for i in range(min(columns.shape[1], len(COLOURS))):
        ax.plot(result.t, columns[:, i], color=COLOURS[i], lw=1.2, label=labels[i])
    if columns.shape[1] > 1:
        legend(ax, min(columns.shape[1], len(COLOURS)), columns.shape[1], "components")


def draw_closure(result: Readable, ax: Axes) -> None:
    """Largest closing errors over time, on a logarithmic axis."""
    dressed(ax, "Closure of the loops", "largest error")
    if result.multipliers.shape[1] == 0:
        empty(ax, "no constraints: nothing to close")
        return
    ax.set_yscale("log")
    # Round-off jumps from output to output: dots, since lines between them would say nothing.
    for values, colour, label in (
        (result.closure, COLOURS[0], "|Φ| [m, rad]"),
        (result.velocity_closure, COLOURS[1], "|C v + a| [per s]"),
    ):
        ax.plot(result.t, positive(values), ".", color=colour, ms=2.5, label=label, rasterized=True)
    worst = float(np.max(np.concatenate([positive(result.closure), positive(result.velocity_closure)]), initial=1e-17))
    ax.set_ylim(1e-17, max(10 * worst, 1e-13))
    ax.legend(
        loc="upper right", ncols=2, fontsize=8, frameon=False, markerscale=3, handletextpad=0.2, borderaxespad=0.1
    )


def draw_balance(result: Readable, ax: Axes) -> None:
    """Energy that came or went without a cause, relative to the energy exchanged."""
    dressed(ax, "Energy balance", "imbalance / exchanged energy")
    if not result.has_energy:
        empty(ax, "a System given by matrices has no known energy")
        return
    energy = result.energy
    scale = energy.scale or 1.0
    ax.set_yscale("log")
    ax.plot(result.t, positive(energy.balance / scale), color=COLOURS[2], lw=1.0)
    ax.set_ylim(1e-17, max(10 * energy.relative_balance, 1e-13))
    ax.annotate(
        f"exchanged: {energy.scale:.3g} J", (0.99, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=8,
        color="#555555",
    )  # fmt: skip


def draw_energy(result: Readable, ax: Axes) -> None:
    """Kinetic, potential and total energy, and the work put in."""
    dressed(ax, "Energy", "energy [J]")
    if not result.has_energy:
        empty(ax, "a System given by matrices has no known energy")
        return
    energy = result.energy
    lines = (
        ("kinetic", energy.kinetic), ("potential", energy.potential), ("total", energy.total), ("work", energy.work),
    )  # fmt: skip
    for (label, values), colour in zip(lines, COLOURS, strict=False):
        ax.plot(result.t, values, color=colour, lw=1.8 if label == "total" else 1.2, label=label)
    legend(ax, 4, 4, "energies")
