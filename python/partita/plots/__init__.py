"""Figures of results, with matplotlib; nothing opens a window.

Every function returns a `matplotlib.figure.Figure`; with `path` it is saved too, in the format of the ending (.png,
.pdf, .svg). Units are on the axes; where not all lines fit, the legend counts them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..extras import missing

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise missing("matplotlib", "plots", "a figure") from error

from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import shown
from ..result_view import ResultView, checked_run
from .abscissa import Abscissa, abscissa
from .files import PathLike, figure_path, save_figure
from .joint import draw_joint
from .measure import draw_measure
from .overview import draw_overview, overview_height
from .paths import draw_bearings, draw_paths
from .reactions import draw_reactions
from .series import (
    draw_accelerations,
    draw_closure,
    draw_coordinates,
    draw_energy,
    draw_sensor,
    draw_velocities,
)
from .style import Canvas, headline, new_figure, seal

__all__ = [
    "figure_path",
    "overview",
    "plot",
    "plot_energy",
    "plot_joint",
    "plot_measure",
    "plot_reactions",
    "save_figure",
]


@dataclass(frozen=True)
class Drawn:
    """How a word is drawn, and its options."""

    draw: Callable[[ResultView, Canvas, Wanted], object]
    height: float | Callable[[ResultView, Wanted], float]
    """In inches."""
    panel: Callable[[ResultView, Axes, Wanted], object] | None = None
    """How it is drawn into given axes; None for several panels."""
    over: bool = False
    """Whether its abscissa may be other than time."""


@dataclass(frozen=True)
class Wanted:
    """Options of the request besides the words."""

    x: Abscissa
    points: Mapping[str, Any] | None = None


def _one(draw: Callable[..., object], height: float, *, over: bool = True) -> Drawn:
    """A word of one panel."""

    def panel(result: ResultView, ax: Axes, wanted: Wanted) -> object:
        return draw(result, ax, wanted.x) if over else draw(result, ax)

    return Drawn(lambda result, canvas, wanted: panel(result, canvas.subplots(), wanted), height, panel, over)


WORDS: dict[str, Drawn] = {
    "overview": Drawn(
        lambda result, canvas, wanted: draw_overview(result, canvas, wanted.x),
        lambda result, wanted: overview_height(result, wanted.x),
        over=True,
    ),
    "coordinates": _one(draw_coordinates, 3.5),
    "velocities": _one(draw_velocities, 3.5),
    "accelerations": _one(draw_accelerations, 3.5),
    "reactions": Drawn(lambda result, canvas, wanted: draw_reactions(result, canvas, wanted.x), 5.5, over=True),
    "bearings": Drawn(lambda result, canvas, wanted: draw_bearings(result, canvas), 6.5),
    "paths": Drawn(lambda result, canvas, wanted: draw_paths(result, canvas, wanted.points), 6.0),
    "energy": _one(draw_energy, 3.5),
    "measure": Drawn(lambda result, canvas, wanted: draw_measure(result, canvas, canvas.add_gridspec(1, 1)[0]), 3.8),
    "closure": _one(draw_closure, 3.0, over=False),
}
JOINT_HEIGHT = 5.5
SENSOR_HEIGHT = 3.0


def plot(
    result: ResultView,
    *what: str,
    path: PathLike | None = None,
    x: str | None = None,
    ax: Axes | None = None,
    points: Mapping[str, Any] | None = None,
) -> Figure:
    """Words among overview (the default), coordinates, velocities, accelerations, reactions, bearings, paths, energy,
    measure, closure, names of joints or sensors, below each other in one figure.

    `x` is a coordinate, joint or sensor as abscissa instead of time; angles in degrees, of one turn
    where there are more. `ax`: existing Matplotlib axes to draw a single panel into. `points` are those whose
    "paths" are drawn, {name: (body, place in body axes)}. `UnknownNameError` for another word or name,
    `ArgumentError` where a word cannot stand over `x` or in `ax`.
    """
    checked_run(result)
    words = what or ("overview",)
    parts = [_part(result, word) for word in words]
    wanted = Wanted(abscissa(result, x), points)
    if x is not None and not all(part.over for part in parts):
        word = next(word for word, part in zip(words, parts, strict=True) if not part.over)
        known = ", ".join(name for name, part in WORDS.items() if part.over)
        raise ArgumentError(
            f"plot: {word!r} has a fixed abscissa; x applies to {known}, joints and sensors", argument="x"
        )
    if points is not None and "paths" not in words:
        raise ArgumentError('plot: points belong to "paths"; request that panel too', argument="points")
    if ax is not None:
        return _saved(_into(result, words, parts, wanted, ax), path)
    heights = [part.height(result, wanted) if callable(part.height) else part.height for part in parts]
    figure = new_figure(11.0, sum(heights))
    if len(parts) == 1:
        parts[0].draw(result, figure, wanted)
    else:
        cells = figure.add_gridspec(len(parts), 1, height_ratios=heights)
        for n, part in enumerate(parts):
            part.draw(result, figure.add_subfigure(cells[n]), wanted)
    if not figure.get_suptitle():
        headline(result, figure)
    seal(result, figure)
    return _saved(figure, path)


def _into(result: ResultView, words: Sequence[str], parts: Sequence[Drawn], wanted: Wanted, ax: Any) -> Figure:
    if not isinstance(ax, Axes):
        raise ArgumentError(f"ax must be axes of matplotlib, not {shown(ax)}", argument="ax")
    panel = parts[0].panel
    if len(parts) != 1 or panel is None:
        one = ", ".join(name for name, part in WORDS.items() if part.panel is not None)
        raise ArgumentError(
            f"plot: ax takes a single panel ({one} or a sensor), not {', '.join(map(repr, words))}",
            argument="ax",
        )
    panel(result, ax, wanted)
    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def _part(result: ResultView, word: str) -> Drawn:
    if isinstance(word, str) and word in WORDS:
        return WORDS[word]
    sensors = [item["name"] for item in result.summary.get("sensors", ())]
    known = [*WORDS, *result.names.joints, *sensors]
    name = known[index_of(word, known, "plot, joint or sensor")]
    if name not in result.names.joints:
        return _one(lambda result, ax, x: draw_sensor(result, name, ax, x), SENSOR_HEIGHT)
    return Drawn(lambda result, canvas, wanted: draw_joint(result, name, canvas, x=wanted.x), JOINT_HEIGHT, over=True)


def overview(result: ResultView, path: PathLike | None = None) -> Figure:
    """The run at a glance: coordinates, velocities, accelerations, forces, speeds and forces over the crank angle if
    there is a rotating crank; then measure, closure error, energy balance."""
    return plot(result, "overview", path=path)


def plot_energy(result: ResultView, path: PathLike | None = None) -> Figure:
    """Kinetic, potential and total energy and the work put in [J]."""
    return plot(result, "energy", path=path)


def plot_measure(result: ResultView, path: PathLike | None = None) -> Figure:
    """Projective measure of the coordinates over time; a strip on top shows which were independent."""
    return plot(result, "measure", path=path)


def plot_reactions(result: ResultView, path: PathLike | None = None) -> Figure:
    """Size of force [N] and moment [N m] of every joint; of many, the most loaded."""
    return plot(result, "reactions", path=path)


def plot_joint(result: ResultView, name: str, path: PathLike | None = None, *, axes: str = "world") -> Figure:
    """Position, velocity, force and moment of the joint `name`, the last two in "world" or "joint" axes.

    Components that are not unique are dashed. `UnknownNameError` with the nearest names.
    """
    checked_run(result)
    figure = new_figure(11.0, JOINT_HEIGHT)
    draw_joint(result, name, figure, axes)
    seal(result, figure)
    return _saved(figure, path)


def _saved(figure: Figure, path: PathLike | None) -> Figure:
    if path is not None:
        save_figure(figure, path)
    return figure
