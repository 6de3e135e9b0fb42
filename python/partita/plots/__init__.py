"""Figures of results, with matplotlib; nothing opens a window.

Every function returns a `matplotlib.figure.Figure`; with `path` it is saved too, in the format of the
ending (.png, .pdf, .svg). Units stand on the axes; where not all lines fit, the legend counts them.
"""

from __future__ import annotations

from collections.abc import Callable

from ..extras import missing

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise missing("matplotlib", "plots", "a figure") from error

from ..naming import index_of
from ..readable import Readable, checked_run
from .files import PathLike, figure_path, save_figure
from .joint import draw_joint
from .measure import draw_measure
from .overview import draw_overview
from .reactions import draw_reactions
from .series import draw_closure, draw_coordinates, draw_energy, draw_sensor
from .style import Canvas, headline, new_figure

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

WORDS: dict[str, tuple[Callable[[Readable, Canvas], object], float]] = {
    # word: (how it is drawn, height in inches)
    "overview": (draw_overview, 6.5),
    "coordinates": (lambda result, canvas: draw_coordinates(result, canvas.subplots()), 3.5),
    "closure": (lambda result, canvas: draw_closure(result, canvas.subplots()), 3.0),
    "energy": (lambda result, canvas: draw_energy(result, canvas.subplots()), 3.5),
    "measure": (lambda result, canvas: draw_measure(result, canvas, canvas.add_gridspec(1, 1)[0]), 3.8),
    "reactions": (draw_reactions, 5.5),
}
JOINT_HEIGHT = 5.5
SENSOR_HEIGHT = 3.0


def plot(result: Readable, *what: str, path: PathLike | None = None) -> Figure:
    """Words among overview (the default), coordinates, closure, energy, measure, reactions, names of joints or sensors,
    below each other in one figure. `UnknownNameError` for another word."""
    checked_run(result)
    parts = [_part(result, word) for word in what or ("overview",)]
    heights = [height for _, height in parts]
    figure = new_figure(11.0, sum(heights))
    if len(parts) == 1:
        parts[0][0](result, figure)
    else:
        places = figure.add_gridspec(len(parts), 1, height_ratios=heights)
        for n, (draw, _) in enumerate(parts):
            draw(result, figure.add_subfigure(places[n]))
    if not figure.get_suptitle():
        headline(result, figure)
    return _saved(figure, path)


def _part(result: Readable, word: str) -> tuple[Callable[[Readable, Canvas], object], float]:
    if isinstance(word, str) and word in WORDS:
        return WORDS[word]
    sensors = [item["name"] for item in result.summary.get("sensors", ())]
    known = [*WORDS, *result.names.joints, *sensors]
    name = known[index_of(word, known, "plot, joint or sensor")]
    if name not in result.names.joints:
        return (lambda result, canvas: draw_sensor(result, name, canvas.subplots())), SENSOR_HEIGHT
    return (lambda result, canvas: draw_joint(result, name, canvas)), JOINT_HEIGHT


def overview(result: Readable, path: PathLike | None = None) -> Figure:
    """The run at a glance: coordinates, measure with the independent coordinates, closure, energy balance."""
    return plot(result, "overview", path=path)


def plot_energy(result: Readable, path: PathLike | None = None) -> Figure:
    """Kinetic, potential and total energy and the work put in [J]."""
    return plot(result, "energy", path=path)


def plot_measure(result: Readable, path: PathLike | None = None) -> Figure:
    """Projective measure of the coordinates over time; a strip on top shows which were independent."""
    return plot(result, "measure", path=path)


def plot_reactions(result: Readable, path: PathLike | None = None) -> Figure:
    """Size of force [N] and moment [N m] of every joint; of many, the most loaded."""
    return plot(result, "reactions", path=path)


def plot_joint(result: Readable, name: str, path: PathLike | None = None, *, axes: str = "world") -> Figure:
    """Position, velocity, force and moment of the joint `name`, the last two in "world" or "joint" axes.

    Components that are not unique are dashed. `UnknownNameError` with the nearest names.
    """
    checked_run(result)
    figure = new_figure(11.0, JOINT_HEIGHT)
    draw_joint(result, name, figure, axes)
    return _saved(figure, path)


def _saved(figure: Figure, path: PathLike | None) -> Figure:
    if path is not None:
        save_figure(figure, path)
    return figure
