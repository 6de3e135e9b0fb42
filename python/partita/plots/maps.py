"""Maps of workspaces, singular curves in them, and rankings of sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import goal_name
from ..numeric import shown
from ..tolerance import VISIBLE
from .files import PathLike, save_figure
from .style import COLOURS, dressed, new_figure, plain

FloatArray = NDArray[np.float64]
TITLES = {
    "margin": "Margin of the actuators",
    "constraints": "Least value of the constraints",
    "outputs": "Margin of the outputs",
    "assemblies": "Number of assemblies",
}
MOST = 10
"""Sets that are drawn."""
KIND_COLOURS = {"actuators": COLOURS[1], "outputs": COLOURS[0], "constraints": COLOURS[3]}


class Curve(Protocol):
    """Singular positions one after the other."""

    @property
    def goals(self) -> Mapping[Any, FloatArray]: ...
    @property
    def ends(self) -> tuple[str, ...]: ...
    @property
    def closed(self) -> bool: ...
    def __len__(self) -> int: ...
    def path(self, body: Any, point: Any = ...) -> FloatArray: ...


class SingularPositions(Protocol):
    """Input: singular curves and points."""

    @property
    def title(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def of(self) -> tuple[str, ...]: ...
    @property
    def keys(self) -> tuple[Any, ...]: ...
    @property
    def units(self) -> tuple[str, ...]: ...
    @property
    def limits(self) -> FloatArray: ...
    @property
    def curves(self) -> Sequence[Curve]: ...
    @property
    def points(self) -> Curve: ...


class Maps(Protocol):
    """Input: maps over a grid."""

    @property
    def title(self) -> str: ...
    @property
    def keys(self) -> tuple[Any, ...]: ...
    @property
    def axes(self) -> tuple[FloatArray, ...]: ...
    @property
    def units(self) -> tuple[str, ...]: ...
    @property
    def reached(self) -> NDArray[np.bool_]: ...
    def map(self, of: str) -> NDArray[Any]: ...


class Ranking(Protocol):
    """Input: sets of actuators or encoders, the best first."""

    @property
    def title(self) -> str: ...
    @property
    def of(self) -> str: ...
    @property
    def sets(self) -> Sequence[Any]: ...


def plot_singularities(found: SingularPositions, of: Any, ax: Any, path: PathLike | None) -> Figure:
    """The curves over the goals, or over the positions of a point."""
    figure, ax = _panel(ax)
    parts = [*found.curves, found.points]
    if of is None:
        values = [[part.goals[key] for key in found.keys] for part in parts]
        labels = [_label(key, unit) for key, unit in zip(found.keys, found.units, strict=True)]
    else:
        values, labels = _places(parts, of)
    if len(labels) == 1:
        values, labels = [[row[0], np.zeros(len(row[0]))] for row in values], [labels[0], ""]
        ax.set_yticks([])
    extent = np.ptp(found.limits, axis=1).max()
    if of is not None:
        extent = max((np.ptp(row) for pair in values for row in pair if len(row)), default=0.0)
    colour = KIND_COLOURS[found.kind]
    named = f"{found.kind}: {', '.join(found.of)}" if found.of else found.kind
    for i, (part, (x, y)) in enumerate(zip(parts, values, strict=True)):
        if not len(part):
            continue
        # where goals and point rest along a curve, it is a point of the figure
        single = not part.ends or max(np.ptp(x), np.ptp(y)) <= VISIBLE * extent
        closed = part.closed and of is not None
        joined = (np.append(x, x[:1]), np.append(y, y[:1])) if closed else _unwound(x, y, part)
        style = {"linestyle": "none", "marker": "o", "markersize": 5} if single else {"linewidth": 1.6}
        ax.plot(*joined, color=colour, label=plain(named) if i == 0 or (single and not found.curves) else None, **style)
    if not ax.get_title(loc="left"):
        dressed(ax, f"{found.title}: singular {found.kind}", labels[1], time_axis=False)
        ax.set_xlabel(plain(labels[0]), fontsize=9)
    if of is None and not ax.images and not ax.collections:
        ax.set_xlim(*found.limits[0])
        if len(found.keys) == 2:
            ax.set_ylim(*found.limits[1])
    elif of is not None:
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.05)
    handles, words = ax.get_legend_handles_labels()
    if words:
        ax.legend(handles, words, loc="upper right", fontsize=8, frameon=True, framealpha=0.9)
    if path is not None:
        save_figure(figure, path)
    return figure


def _unwound(x: FloatArray, y: FloatArray, part: Curve) -> tuple[FloatArray, FloatArray]:
    """A curve over the goals; a closed one returns to its first point unless whole turns of a goal lie between."""
    step = np.hypot(np.diff(x), np.diff(y)).max(initial=0.0)
    if part.closed and np.hypot(x[0] - x[-1], y[0] - y[-1]) <= 2 * step:
        return np.append(x, x[:1]), np.append(y, y[:1])
    return x, y


def _places(parts: list[Curve], of: Any) -> tuple[list[list[FloatArray]], list[str]]:
    if not isinstance(of, tuple) or len(of) != 2:
        raise ArgumentError(f"of must be a point (body, (x, y, z)), not {shown(of)}", argument="of")
    paths = [part.path(*of) for part in parts]
    spread = np.ptp(np.vstack(paths), axis=0) if sum(map(len, paths)) else np.array([1.0, 1.0, 0.0])
    shown_axes = sorted(np.argsort(-spread, kind="stable")[:2])
    values = [[path[:, i] for i in shown_axes] for path in paths]
    return values, [f"{'xyz'[i]} of {of[0]} [m]" for i in shown_axes]


def plot_workspace(found: Maps, of: str, ax: Any, path: PathLike | None) -> Figure:
    """One of the maps over one or two goals."""
    values = np.asarray(found.map(of), dtype=float)
    if values.ndim > 2:
        raise ArgumentError(
            f"a map over {values.ndim} goals cannot be drawn; hold {values.ndim - 2} of them in the grid", argument="of"
        )
    figure, ax = _panel(ax)
    values = np.where(found.reached, values, np.nan)
    label = _label(found.keys[0], found.units[0])
    if values.ndim == 1:
        dressed(ax, f"{found.title}: {TITLES[of].lower()}", TITLES[of], time_axis=False)
        ax.plot(found.axes[0], values, color=COLOURS[0], linewidth=1.5)
        ax.set_ylim(0.0, None)
    else:
        dressed(ax, f"{found.title}: {TITLES[of].lower()}", _label(found.keys[1], found.units[1]), time_axis=False)
        orders = [np.argsort(x) for x in found.axes]
        ordered = values[np.ix_(*orders)].T
        mesh = ax.pcolormesh(
            found.axes[0][orders[0]], found.axes[1][orders[1]], ordered, shading="nearest", cmap="viridis", vmin=0.0
        )
        ax.set_facecolor("#eeeeee")
        figure.colorbar(mesh, ax=ax, label=TITLES[of])
    ax.set_xlabel(plain(label), fontsize=9)
    if path is not None:
        save_figure(figure, path)
    return figure


def plot_placement(found: Ranking, path: PathLike | None) -> Figure:
    """Bars of the best sets."""
    sets = list(found.sets[:MOST])
    figure = new_figure(8.0, 1.2 + 0.4 * len(sets))
    ax = dressed(figure.subplots(), f"{found.title}: sets of {found.of}", "", time_axis=False)
    rows = np.arange(len(sets))[::-1]
    ax.barh(rows + 0.18, [one.typical for one in sets], 0.34, color="#c6d8ea", label="typical margin")
    ax.barh(rows - 0.18, [one.worst for one in sets], 0.34, color=COLOURS[0], label="worst margin")
    ax.set_yticks(rows, [plain(", ".join(one.names)) for one in sets])
    ax.set_xlabel("margin", fontsize=9)
    ax.legend(loc="lower right", fontsize=8, frameon=True, framealpha=0.9)
    if path is not None:
        save_figure(figure, path)
    return figure


def _label(key: Any, unit: str) -> str:
    return f"{goal_name(key)} [{unit}]" if unit else goal_name(key)


def _panel(ax: Any) -> tuple[Figure, Any]:
    if ax is None:
        figure = new_figure(7.0, 5.4)
        return figure, figure.subplots()
    if not hasattr(ax, "get_figure"):
        raise ArgumentError(f"ax must be Matplotlib axes, not {shown(ax)}", argument="ax")
    return ax.get_figure(), ax
