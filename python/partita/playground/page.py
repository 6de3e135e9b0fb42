"""The page: its content, its scripts and the equations of one mechanism."""

from __future__ import annotations

import base64
from typing import Any

from ..webpage import part_of, whole_page
from .program import Program

COMPUTES = ("module.js", "linear.js", "equations.js", "closing.js", "choice.js", "methods.js", "motion.js")
"""Scripts without reference to the page: together they define `makeMotion`."""
SCRIPTS = (*COMPUTES, "drawing.js", "controls.js")


def html(made: Program, title: str, view: dict[str, Any], speed: float) -> str:
    """The page as text. It contains all it needs and loads nothing; names and titles are escaped."""
    about = {**made.about, "title": title, "view": view, "speed": speed}
    return whole_page(__package__, title, about, SCRIPTS, base64.b64encode(made.module).decode("ascii"))


def text(name: str) -> str:
    """A file beside this one."""
    return part_of(__package__, name)
