"""The page: its content, its scripts and the equations of one mechanism."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

from ..webpage import part_of, whole_page
from .program import Program

COMPUTES = (
    "module.js", "linear.js", "equations.js", "reactions.js", "closing.js", "choice.js", "methods.js", "motion.js",
)  # fmt: skip
"""Scripts without reference to the page: with `tolerance.js` of the package they define `makeMotion`."""
SCRIPTS = (*COMPUTES, "address.js", "export.js", "shown.js", "live.js", "fields.js", "controls.js")


def html(
    made: Program, title: str, seen: dict[str, Any], speed: float | None, drawn_by: tuple[str, Sequence[str]]
) -> str:
    """The page as text. It contains all it needs and loads nothing; names and titles are escaped.

    `seen` is what is drawn: the scene, the model file, and the tables of its solids as bodies with
    numbers. `drawn_by`: the package whose style and scripts draw it.
    """
    about = {**made.about, **seen, "title": title, "speed": speed}
    module = base64.b64encode(made.module).decode("ascii")
    return whole_page(__package__, title, about, SCRIPTS, module, drawn_by)


def text(name: str) -> str:
    """A file beside this one."""
    return part_of(__package__, name)
