"""The run at a glance."""

from __future__ import annotations

from matplotlib.gridspec import GridSpecFromSubplotSpec

from ..result_view import ResultView
from .abscissa import Abscissa, abscissa, crank
from .measure import draw_measure
from .reactions import draw_loads
from .series import draw_accelerations, draw_balance, draw_closure, draw_coordinates, draw_velocities
from .style import Canvas, headline, plain

ROW = 3.0
"""Height of a row of panels, in inches."""


def overview_height(result: ResultView, x: Abscissa) -> float:
    """Height in inches, with one more row if a crank rotates."""
    return ROW * (4 if x.is_time and crank(result) else 3)


def draw_overview(result: ResultView, canvas: Canvas, x: Abscissa) -> None:
    """Displacements, velocities, loads over time and over the angle of a crank; then data of the solver: measure,
    closure, energy balance, over time."""
    turning = crank(result) if x.is_time else None
    grid = canvas.add_gridspec(4 if turning else 3, 2)
    draw_coordinates(result, canvas.add_subplot(grid[0, 0]), x)
    draw_velocities(result, canvas.add_subplot(grid[0, 1]), x, names=False)
    draw_accelerations(result, canvas.add_subplot(grid[1, 0]), x, names=False)
    notes = {draw_loads(result, canvas.add_subplot(grid[1, 1]), "force", x)}
    if turning:
        angle = abscissa(result, turning)
        panels = [canvas.add_subplot(grid[2, i]) for i in (0, 1)]
        draw_velocities(result, panels[0], angle)
        notes.add(draw_loads(result, panels[1], "force", angle))
        for ax, word in zip(panels, ("Velocities", "Forces of the joints"), strict=True):
            ax.set_title(f"{word} over the angle of {plain(turning)}", loc="left", fontsize=10, fontweight="bold")
    draw_measure(result, canvas, grid[-1, 0])
    solver = GridSpecFromSubplotSpec(1, 2, grid[-1, 1])
    draw_closure(result, canvas.add_subplot(solver[0]))
    draw_balance(result, canvas.add_subplot(solver[1]))
    headline(result, canvas)
    if notes - {""}:
        canvas.supxlabel("; ".join(sorted(notes - {""})), fontsize=8, color="#555555")
