"""Planar mechanisms drawn with the mouse: `partita.draw`."""

from .calls import mechanism_of, script_of
from .drawing import Drawing, drawing_of
from .server import DrawingPage, draw

__all__ = ["Drawing", "DrawingPage", "draw", "drawing_of", "mechanism_of", "script_of"]
