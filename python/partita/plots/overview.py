"""The run at a glance."""

from __future__ import annotations

from ..readable import Readable
from .measure import draw_measure
from .series import draw_balance, draw_closure, draw_coordinates
from .style import Canvas, headline


def draw_overview(result: Readable, canvas: Canvas) -> None:
    """Coordinates, measure with the independent coordinates, closure, and energy balance."""
    grid = canvas.add_gridspec(2, 2)
    draw_coordinates(result, canvas.add_subplot(grid[0, 0]))
    draw_measure(result, canvas, grid[0, 1])
    draw_closure(result, canvas.add_subplot(grid[1, 0]))
    draw_balance(result, canvas.add_subplot(grid[1, 1]))
    headline(result, canvas)
