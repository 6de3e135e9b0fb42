"""Checks of what a run with elements that hold at times found."""

from __future__ import annotations

from collections.abc import Sequence

from ...results import Result
from ..entry import Check

Known = Sequence[tuple[str, str, float]]
"""Element, kind and time [s] of each event, in order."""
OPTIONS = {"rtol": 1e-11, "atol": 1e-12}


def times(known: Known) -> Check:
    """That a run has these events and no others, at these times."""

    def error(result: Result) -> float:
        if [(event.name, event.kind) for event in result.events] != [event[:2] for event in known]:
            return float("inf")
        return max(abs(a.t - b[2]) for a, b in zip(result.events, known, strict=True))

    return Check("times of all events [s]", 1e-10, "ten times rtol, of runs of seconds", error)


def off(value: float, known: float) -> float:
    """Relative error; infinite for NaN."""
    error = abs(float(value) / known - 1.0)
    return error if error >= 0.0 else float("inf")
