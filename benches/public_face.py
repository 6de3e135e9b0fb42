"""Whole runs as people make them: `m.simulate`, one output, against the hand-written limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

from limit import FIXED, Figure
from timing import fastest

import partita as pt

RTOL, ATOL = 1e-10, 1e-12


@dataclass(frozen=True)
class Run:
    """A run of the catalogue and the largest wanted ratio of its time to the limit."""

    title: str
    name: str
    loops: int | None
    duration: float
    aim: float


RUNS = (
    Run("four-bar", "four-bar", None, 10.0, 8.0),
    Run("Andrews' squeezer", "andrews-squeezer", None, 0.03, 10.0),
    Run("chain N = 40", "n-four-bar", 40, 10.0, 30.0),
    Run("chain N = 1000", "n-four-bar", 1000, 10.0, 30.0),
)


@dataclass(frozen=True)
class Face:
    """Seconds of the run; error of the catalogue's check at the end; limits: by a program here, and fixed."""

    title: str
    seconds: float
    error: float
    aim: float
    program: Figure | None
    fixed: Figure


def face_cost(run: Run, program: Figure | None) -> Face:
    """Timed with one output; checked with those that the check asks for, which change no step."""
    parameters = {} if run.loops is None else {"loops": run.loops}
    entry = pt.catalogue.entry(run.name, **parameters)
    m = entry.mechanism()
    start, end = entry.initial(m), [run.duration]
    seconds = fastest(lambda: m.simulate(run.duration, t_eval=end, initial=start, rtol=RTOL, atol=ATOL), 3.0)
    times = [t for t in entry.times if t <= run.duration]
    result = m.simulate(run.duration, t_eval=times, initial=start, rtol=RTOL, atol=ATOL)
    error = entry.checks[0].run(result).error if result.success else math.nan
    return Face(run.title, seconds, error, run.aim, program, FIXED[run.title])
