"""The run at a glance."""

from __future__ import annotations

from matplotlib.gridspec import GridSpecFromSubplotSpec

from ..readable import Readable
from .measure import draw_measure
from .reactions import draw_loads
from .series import draw_accelerations, draw_balance, draw_closure, draw_coordinates, draw_velocities
from .style import Canvas, headline


def draw_overview(result: Readable, canvas: Canvas) -> None:
    """How far, how fast, how loaded; then what the solver did: measure, closure, energy balance."""
    grid = canvas.add_gridspec(3, 2)
    draw_coordinates(result, canvas.add_subplot(grid[0, 0]))
    draw_velocities(result, canvas.add_subplot(grid[0, 1]))
    draw_accelerations(result, canvas.add_subplot(grid[1, 0]))
    note = draw_loads(result, canvas.add_subplot(grid[1, 1]), "force")
    draw_measure(result, canvas, grid[2, 0])
    solver = GridSpecFromSubplotSpec(1, 2, grid[2, 1])
    draw_closure(result, canvas.add_subplot(solver[0]))
    draw_balance(result, canvas.add_subplot(solver[1]))
    headline(result, canvas)
    if note:
        canvas.supxlabel(note, fontsize=8, color="#555555")
