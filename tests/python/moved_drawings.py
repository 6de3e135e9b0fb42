"""Every number of a drawing moved by one unit in its last place, as if another processor had computed it.

With the environment variable PARTITA_MOVED_DRAWINGS=SEED the tests compile drawings whose masses, places and directions
are moved up or down at random; the same drawing is always moved in the same way. What a test asserts then holds on
every processor, or a decision hangs on rounding. Ratios, teeth and tables stay: their last digit has a meaning.
"""

from __future__ import annotations

import itertools
import json
import os
import random
from typing import Any

import numpy as np
import pytest

SEED = os.environ.get("PARTITA_MOVED_DRAWINGS")
PLACES = ("position", "point", "point1", "point2", "child_point", "com", "length")
DIRECTIONS = ("orientation", "axis", "child_axis", "normal", "direction", "frame", "frame1", "frame2", "child_frame")
MOVED = frozenset({"mass", "inertia", *PLACES, *DIRECTIONS})

as_typed = pytest.mark.skipif(SEED is not None, reason="its drawing is moved: it compares bits with numbers as typed")
"""For tests that compare two ways to the same numbers, of which one is not a drawing."""


def moved(text: str, seed: str) -> str:
    """A description as JSON whose numbers of `MOVED` are one unit in the last place off; zeros stay."""
    description = json.loads(text)
    chance = random.Random(seed)

    def move(value: Any) -> Any:
        if isinstance(value, list):
            rows = [move(x) for x in value]
            if rows and all(isinstance(row, list) for row in rows) and len(rows) == len(rows[0]):
                for i, j in itertools.combinations(range(len(rows)), 2):
                    if value[i][j] == value[j][i]:  # inertia stays symmetric
                        rows[i][j] = rows[j][i]
            return rows
        if isinstance(value, float) and value != 0.0:
            return float(np.nextafter(value, chance.choice((-np.inf, np.inf))))
        return value

    def visit(value: Any) -> Any:
        if isinstance(value, dict):
            return {
                key: item if key == "shape" else (move if key in MOVED else visit)(item) for key, item in value.items()
            }
        return [visit(item) for item in value] if isinstance(value, list) else value

    return json.dumps({key: visit(value) for key, value in description.items()})


def install(patch: pytest.MonkeyPatch) -> None:
    """Move every drawing that is compiled from now on, where the variable asks for it."""
    if SEED is None:
        return
    from partita.builder.spec import Writer

    text = Writer.text
    patch.setattr(Writer, "text", lambda self: moved(text(self), SEED))
