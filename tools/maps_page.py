"""The figure of docs/placement.md: the map of an ankle with its singular curves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from partita import catalogue

MOTORS = ("motor l", "motor r")
ANKLE = ("ankle.turn1", "ankle.turn2")


def ankle(path: Path, short: bool) -> None:
    """As the page draws it; `short`: a coarse map over a part of the range."""
    m = catalogue.load("parallel-ankle")
    pitch, roll = (
        (np.linspace(-1.1, -0.8, 5), np.linspace(-0.2, 0.2, 5))
        if short
        else (np.linspace(-1.3, 1.2, 101), np.linspace(-0.9, 0.9, 73))
    )
    grid = dict(zip(ANKLE, (pitch, roll), strict=True))
    figure = m.workspace(grid, actuators=MOTORS).plot()
    ax = figure.axes[0]
    m.singularities(grid, of=MOTORS, near=m.assemble()).plot(ax=ax)
    m.singularities(grid, of=ANKLE, kind="outputs", near=m.assemble()).plot(ax=ax, path=path)


FIGURES: dict[str, Callable[[Path, bool], None]] = {"ankle": ankle}
"""Name -> how it is drawn."""


def draw(name: str, folder: Path, short: bool) -> None:
    """Draw one of the figures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    FIGURES[name](folder / f"{name}.png", short)
