"""`partita new` and `partita watch`: a model file to change, and a page that shows it as it is saved."""

from __future__ import annotations

import argparse
import sys
import webbrowser
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..files import put, target
from .models import open_as_asked

if TYPE_CHECKING:
    from ..catalogue import Entry
    from ..mechanism import Mechanism
    from ..watching.page import Drawn, Shown

FILE = "my.toml"
"""The name in the comments where no file is given."""


def new(arguments: argparse.Namespace) -> int:
    """Print or write a mechanism of the catalogue as a model file with comments."""
    from .. import catalogue
    from ..io.commented import commented, with_plates

    entry = catalogue.entry(arguments.name)
    mechanism = entry.mechanism()
    drawn = mechanism if arguments.rods else with_plates(mechanism)
    text = commented(drawn, _head(entry, mechanism, arguments.output or FILE, not arguments.rods))
    if not arguments.output:
        print(text, end="")
        return 0
    where = target(arguments.output, "a model file ")
    if where.exists():
        raise ArgumentError(f"{str(where)!r} exists already; give another name, or remove it first", argument="output")
    put(where, text.encode("utf-8"))
    print(f"wrote {where}; see it with: partita watch {where}")
    return 0


def _head(entry: Entry, mechanism: Mechanism, file: str, plates: bool) -> list[str]:
    """The comments at the beginning of the file."""
    page = Path(file).with_suffix(".html").name
    rates = "".join(f" --rate {quote(f'{name}={rate:g}')}" for name, rate in _rates(entry, mechanism).items())
    lines = [
        f"{entry.name}: {entry.title}",
        f"Made by `partita new {entry.name}`. Change what you like; then, in a terminal:",
        f"    partita watch {file}     shows it, again whenever this file is saved",
        f"    partita check {file}     degrees of freedom, redundancy, likely mistakes",
        f"    partita simulate {file} --time {entry.duration:g}{rates} --html {page}",
        'Numbers are in SI units and radians; text with a unit, such as "250 mm" or "30 deg", is converted.',
        "Points and axes of joints are those of the world in the position drawn. What lies on a body (its shape, its",
        "centre of mass, ends of springs) is in the axes of the body, which start at `position`.",
        "A pin that is moved on one of its bodies alone: `point` is where it sits on the parent, `child_point` on the",
        "child; the loops are then closed by moving the bodies.",
    ]
    if plates and any(body.rod is not None for body in mechanism._description.bodies.values()):
        lines.append("Slender rods of the catalogue are plates of the same mass here; `--rods` keeps them.")
    return lines


def _rates(entry: Entry, mechanism: Mechanism) -> dict[str, float]:
    """Rates of the start as `--rate` takes them: those of the independent coordinates."""
    start = entry.initial(mechanism)
    if not np.any(start.v) or entry.has_events:
        return {}
    model = mechanism.compile()
    names, chosen = model.velocity_names, model.at(start.q, start.v, start.t).independent
    return {names[i]: float(start.v[i]) for i in chosen if names[i] in mechanism.joints and start.v[i]}


def watch(arguments: argparse.Namespace) -> int:
    """Serve the page of a model file, drawn anew whenever it is saved, until Ctrl+C."""
    from ..watching import WatchPage

    def drawn(mechanism: Mechanism) -> Drawn:
        return _page(mechanism, arguments), mechanism.check()

    def report(shown: Shown) -> None:
        print(f"{shown.at} {'error: ' if shown.error else ''}{shown.message}", flush=True)

    path = Path(arguments.model)
    if not path.is_file():
        what = "it is a folder" if path.is_dir() else "there is no such file; partita new four-bar > my.toml makes one"
        raise ArgumentError(f"cannot watch {arguments.model!r}: {what}", argument="model")
    page = WatchPage(path, lambda: open_as_asked(arguments.model, arguments).mechanism, drawn, arguments.port)
    try:
        print(f"{path} at {page.url}\nCtrl+C ends", flush=True)
        if not arguments.no_browser:
            webbrowser.open(page.url)
        with suppress(KeyboardInterrupt):
            page.follow(report)
    finally:
        page.close()
    print(file=sys.stderr)
    return 0


def _page(mechanism: Mechanism, arguments: argparse.Namespace) -> str:
    """What is shown: the drawing, a run of so many seconds, or a page that computes."""
    if arguments.live:
        from ..mechanism.playground import playground_page

        return playground_page(mechanism)
    if arguments.time is not None:
        from ..viewer import html

        return html(mechanism.simulate(arguments.time))
    from ..mechanism.seen import still_text

    return still_text(mechanism)
