"""The page: template, style, scripts and the program of one mechanism."""

from __future__ import annotations

import base64
import json
import re
from html import escape
from importlib import resources
from typing import Any

from .program import Program

SCRIPTS = ("module.js", "linear.js", "motion.js", "drawing.js", "controls.js")


def html(made: Program, title: str, view: dict[str, Any], speed: float) -> str:
    """The page as text. It contains all it needs and loads nothing; names and titles are escaped."""
    about = {**made.about, "title": title, "view": view, "speed": speed}
    # Inside a script element only "<" could end the data early; JSON allows it escaped.
    data = json.dumps(about, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    parts = {
        "TITLE": escape(title),
        "STYLE": text("style.css"),
        "DATA": data,
        "MODULE": base64.b64encode(made.module).decode("ascii"),
        "SCRIPT": "\n".join(text(name) for name in SCRIPTS),
    }
    # One pass, so that nothing inserted is searched for marks again.
    return re.sub(r"\{\{(TITLE|STYLE|DATA|MODULE|SCRIPT)\}\}", lambda mark: parts[mark[1]], text("page.html"))


def text(name: str) -> str:
    """A file beside this one."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
