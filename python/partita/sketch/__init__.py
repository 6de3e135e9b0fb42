"""Planar mechanisms drawn with the mouse: `partita.draw`."""

from .calls import mechanism_of, script_of
from .drawing import Drawing, drawing_of
from .server import DrawingPage, draw
from .static import static_page, write_static_page

__all__ = [
    "Drawing",
    "DrawingPage",
    "draw",
    "drawing_of",
    "mechanism_of",
    "script_of",
    "static_page",
    "write_static_page",
]
