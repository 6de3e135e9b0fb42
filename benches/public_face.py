"""Whole runs as people make them: `m.simulate`, one output, against the hand-written limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from limit import FIXED, Figure
from timing import fastest

import partita as pt
from partita import options as run_options

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


STEP = 1e-3
AGAIN_AIM = 15e-6
"""Largest wanted time of a run beside its steps."""


@dataclass(frozen=True)
class Again:
    """A run of a model that has run before: seconds beside those of its steps, in the core and of `m.simulate`."""

    title: str
    core: float
    face: float
    step: float


def second_run(name: str, few: int = 1, many: int = 41) -> Again:
    """Runs of few and of many fixed steps of order 5, one output each: what does not grow with the steps."""
    m, entry = pt.catalogue.load(name), pt.catalogue.entry(name)
    model, start = m.compile(), entry.initial(m)
    q, v = np.ascontiguousarray(start.q), np.ascontiguousarray(start.v)
    settings: dict[str, Any] = {"method": "dopri5", "rtol": RTOL, "atol": ATOL, "step": STEP}

    def core(steps: int) -> Callable[[], object]:
        chosen = run_options.options(start.t, STEP * steps, model.velocity_names, **settings)
        end = np.array([chosen["t_end"]])
        return lambda: model.core.simulate(chosen.core, end, q, v, None)

    def face(steps: int) -> Callable[[], object]:
        return lambda: m.simulate(STEP * steps, t_eval=[start.t + STEP * steps], initial=start, **settings)

    took = {make: [fastest(make(steps), least=300) for steps in (few, many)] for make in (core, face)}
    step = (took[core][1] - took[core][0]) / (many - few)
    return Again(name, took[core][0] - few * step, took[face][0] - few * step, step)
