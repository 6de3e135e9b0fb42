"""The cases of docs/trust.md: success is never wrong.

Each room is a class of cases: its docstring has a heading and says what the class is about, its `Case` objects, or
lists of them, stand in the order in which they are asked. `case` says what a case is and makes an outcome of it,
`program` asks the program in maximal coordinates, `page` writes the tables.
"""

from __future__ import annotations

from . import (
    across_the_plane,
    again,
    beside,
    branches_kept,
    contradictions,
    dead_points,
    driven,
    extremes,
    in_space,
    in_the_plane,
    input_believed,
    locked,
    outputs_there,
    raw,
    unique_reactions,
)
from .case import Case
from .page import classes

ROOMS = (
    contradictions,
    across_the_plane,
    branches_kept,
    outputs_there,
    dead_points,
    locked,
    unique_reactions,
    driven,
    input_believed,
    raw,
    in_space,
    in_the_plane,
    extremes,
    beside,
    again,
)

CLASSES = classes(ROOMS)
CASES: dict[str, Case] = {f"{c.room}.{case.name}": case for c in CLASSES for case in c.cases}
