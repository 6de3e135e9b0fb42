"""Panels of coordinates, closure errors and energy, each drawn into given axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..naming import coordinate_units
from ..result_view import ResultView, least, scales
from .abscissa import Abscissa, abscissa
from .bundle import draw_bundle, is_length
from .events import mark_events
from .style import COLOURS, FLOOR, ROUND_OFF, dressed, empty, legend, level, plain, positive, reporting, unit_label

MOST_TURNS = 3.0
"""A coordinate that makes more turns is named, not drawn, beside others that do not. Scale: turns. Reason: beside it
the others would look constant."""


def draw_coordinates(result: ResultView, ax: Axes, x: Abscissa | None = None) -> None:
    """q over time; where there are too many, the independent ones and those that move most."""
    columns = reporting(result, result.q) if result.q.shape[1] == result.v.shape[1] else _widest(result)
    units, labels = coordinate_units(result.summary, result.names)[0], result.names.coordinates
    turning = [i for i in columns if units[i] == "rad" and float(np.ptp(result.q[:, i])) > MOST_TURNS * math.tau]
    # next to a steadily rotating crank all other curves would look constant
    if turning and len(turning) < len(columns):
        columns = [i for i in columns if i not in turning]
    else:
        turning = []
    _draw(result, ax, x, "Coordinates", "q", result.q, columns, labels, units, turning)
    if turning:
        turns = [f"{labels[i]} {np.ptp(result.q[:, i]) / (2.0 * np.pi):.0f}" for i in turning[:3]]
        more = f" and {len(turning) - 3} more" if len(turning) > 3 else ""
        words = shorten(f"not drawn, turns: {', '.join(turns)}{more}", 60, placeholder=" …")
        ax.set_title(plain(words), loc="right", fontsize=7, color="#555555")


def draw_velocities(result: ResultView, ax: Axes, x: Abscissa | None = None, names: bool = True) -> None:
    """v over time; with `names` those of events."""
    units = coordinate_units(result.summary, result.names)[1]
    labels, columns = result.names.velocities, reporting(result, result.v)
    _draw(result, ax, x, "Velocities", "v", result.v, columns, labels, units, names=names)


def draw_accelerations(result: ResultView, ax: Axes, x: Abscissa | None = None, names: bool = True) -> None:
    """dv/dt over time; gaps at singular positions, where it is undetermined; with `names` those of events."""
    units = [f"{unit}^2" if unit.endswith("/s") else unit for unit in coordinate_units(result.summary, result.names)[1]]
    vdot, labels = np.asarray(result.vdot), result.names.velocities
    _draw(result, ax, x, "Accelerations", "dv/dt", vdot, reporting(result, vdot), labels, units, names=names)


def _draw(
    result: ResultView, ax: Axes, x: Abscissa | None, title: str, symbol: str, values: NDArray[np.float64],
    columns: list[int], labels: Sequence[str], units: Sequence[str],
    left_out: Sequence[int] = (), names: bool = True,
) -> None:  # fmt: skip
    x = x or abscissa(result, None)
    lengths = [i for i in columns if is_length(units[i])]
    right = None
    if lengths and len(lengths) < len(columns):  # next to a crank in rad/s a piston in m/s would look constant
        right = ax.twinx()
        right.set_ylabel(f"{symbol}{unit_label([units[i] for i in lengths])}", fontsize=9, labelpad=1.0)
        right.tick_params(labelsize=8)
        right.spines["top"].set_visible(False)
        right.margins(x=0.0)
    rest = [i for i in columns if right is None or i not in lengths]
    dressed(ax, title, f"{symbol}{unit_label([units[i] for i in rest])}")
    x.dress(ax)
    draw_bundle(ax, x, values, columns, labels, units, left_out, right)
    for panel, own in ((ax, rest), (right, lengths)):
        if panel is not None:
            level(panel, values[:, own], least(result, units[own[0]]) if own else 0.0)
    if x.is_time:
        mark_events(ax, result, names=names, right=right)


def _widest(result: ResultView) -> list[int]:
    """With quaternions the columns of q are not those of v: choose by movement alone."""
    span = np.ptp(result.q, axis=0) if len(result.q) else np.zeros(result.q.shape[1])
    return sorted(int(i) for i in np.argsort(-span, kind="stable")[: len(COLOURS)])


def draw_sensor(result: ResultView, name: str, ax: Axes, x: Abscissa | None = None) -> None:
    """Readings of a sensor over time: a line for each of its numbers."""
    x = x or abscissa(result, None)
    read = result.sensor(name)
    columns = read.values.reshape(len(result.t), -1)
    dressed(ax, f"{name}: {read.text}", f"{name}{unit_label([read.unit])}")
    x.dress(ax)
    labels = "xyz" if columns.shape[1] == 3 else [str(i) for i in range(columns.shape[1])]
    for i in range(min(columns.shape[1], len(COLOURS))):
        x.plot(ax, columns[:, i], color=COLOURS[i], lw=1.2, label=labels[i])
    level(ax, columns, least(result, read.unit))
    if columns.shape[1] > 1:
        legend(ax, min(columns.shape[1], len(COLOURS)), columns.shape[1], "components")
    if x.is_time:
        mark_events(ax, result, names=True)


def draw_closure(result: ResultView, ax: Axes) -> None:
    """Largest closure errors over time, on a logarithmic axis."""
    dressed(ax, "Closure of the loops", "largest error")
    if result.multipliers.shape[1] == 0:
        empty(ax, "no constraints: nothing to close")
        return
    ax.set_yscale("log")
    size = 10.0 ** np.floor(np.log10(scales(result).get("m", 1.0)))  # |Φ| is rounding of lengths
    # Round-off jumps from output to output: dots, since lines between them would have no meaning.
    for values, colour, label in (
        (result.closure, COLOURS[0], "|Φ| [m, rad]"),
        (result.velocity_closure, COLOURS[1], "|C v + a| [per s]"),
    ):
        ax.plot(
            result.t,
            positive(values, size),
            ".",
            color=colour,
            ms=2.5,
            label=label,
            rasterized=True,
        )
    measured = np.concatenate([result.closure, result.velocity_closure])
    _from_floor(ax, measured, size)
    ax.legend(loc="upper right", fontsize=8, frameon=False, markerscale=3, handletextpad=0.2, borderaxespad=0.1)
    mark_events(ax, result)


def _from_floor(ax: Axes, values: NDArray[np.float64] | float, size: float = 1.0) -> None:
    """A logarithmic axis from where zero is drawn to above the largest value, and to above round-off at least."""
    worst = float(np.nanmax(values, initial=0.0))
    ax.set_ylim(FLOOR * size, max(10 * worst, ROUND_OFF * size))


def draw_balance(result: ResultView, ax: Axes) -> None:
    """Energy imbalance relative to the energy exchanged."""
    dressed(ax, "Energy balance", "")
    if not result.has_energy:
        empty(ax, "a System given by matrices has no known energy")
        return
    energy = result.energy
    scale = energy.scale or 1.0
    ax.set_yscale("log")
    ax.plot(result.t, positive(energy.balance / scale), color=COLOURS[2], lw=1.0)
    _from_floor(ax, energy.relative_balance)
    ax.set_ylabel(f"imbalance, of {energy.scale:.3g} J", fontsize=9)
    mark_events(ax, result)


def draw_energy(result: ResultView, ax: Axes, x: Abscissa | None = None) -> None:
    """Kinetic, potential and total energy, and the work put in."""
    x = x or abscissa(result, None)
    dressed(ax, "Energy", "energy [J]")
    if not result.has_energy:
        empty(ax, "a System given by matrices has no known energy")
        return
    energy = result.energy
    lines = (
        ("kinetic", energy.kinetic), ("potential", energy.potential), ("total", energy.total), ("work", energy.work),
    )  # fmt: skip
    for (label, values), colour in zip(lines, COLOURS, strict=False):
        x.plot(ax, values, color=colour, lw=1.8 if label == "total" else 1.2, label=label)
    x.dress(ax)
    level(ax, np.array([values for _, values in lines]), least(result, "J"))
    legend(ax, 4, 4, "energies")
    if x.is_time:
        mark_events(ax, result, names=True)
