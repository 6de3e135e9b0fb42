"""Whole runs as people make them: `m.simulate`, one output, against the hand-written limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from limit import Figure, figure
from timing import fastest, once

import partita as pt
from partita import options as run_options

RTOL, ATOL = 1e-10, 1e-12
LOOSER = (1e-7, 5e-8, 2e-8, 1e-8, 5e-9, 2e-9, 1e-9, 5e-10, 2e-10)
"""Relative tolerances that are tried before RTOL: the first whose error is not above the program's counts; absolute
ones are a hundredth."""


@dataclass(frozen=True)
class Run:
    """A run of the catalogue, a stretch of it over which one evaluation is timed, and the largest wanted ratios to the
    limit: of the run, of the run without machine code, of an evaluation by machine code, and of one without."""

    title: str
    name: str
    loops: int | None
    duration: float
    stretch: float
    aim: float
    levels_aim: float
    code_aim: float = 1.6
    evaluation_aim: float = 4.0


RUNS = (
    Run("four-bar", "four-bar", None, 10.0, 2.0, 2.5, 4.0),
    Run("Andrews' squeezer", "andrews-squeezer", None, 0.03, 0.01, 2.5, 4.0),
    Run("chain N = 40", "n-four-bar", 40, 10.0, 0.4, 6.0, 6.0),
    Run("chain N = 1000", "n-four-bar", 1000, 10.0, 0.4, 6.0, 6.0),
)
TURNS = 3
"""How often the run and the program take turns."""


@dataclass(frozen=True)
class Face:
    """Seconds of the run, repeated until its evaluations are compiled, of the same without machine code, of the first
    run of a new mechanism, of one evaluation by machine code (where it is chosen) and of one without; error of the
    catalogue's check at the end; the program beside."""

    title: str
    rtol: float
    seconds: float
    levels: float
    first: float
    evaluations: int
    code: float | None
    alone: float
    error: float
    program: Figure | None

    @property
    def ratios(self) -> dict[str, float] | None:
        """Of the run, the run without machine code, an evaluation by machine code and one without, to the program."""
        if self.program is None:
            return None
        return {
            "run": self.seconds / self.program.seconds,
            "levels": self.levels / self.program.seconds,
            "code": math.nan if self.code is None else self.code / self.program.alone,
            "evaluation": self.alone / self.program.alone,
        }


def face_cost(run: Run, command: list[str] | None) -> Face:
    """The run with one output and the program in turns, at equal error: the loosest tolerance whose error is not above
    the program's. Errors are checked with the outputs that the check asks for, which change no step."""
    parameters = {} if run.loops is None else {"loops": run.loops}
    entry = pt.catalogue.entry(run.name, **parameters)
    m = entry.mechanism()
    start, end = entry.initial(m), [run.duration]
    times = [t for t in entry.times if t <= run.duration]
    programs = [] if command is None else [figure(run.title, command)]
    for rtol in (*LOOSER, RTOL) if programs else (RTOL,):
        result = m.simulate(run.duration, t_eval=times, initial=start, rtol=rtol, atol=rtol / 100.0)
        error = entry.checks[0].run(result).error if result.success else math.nan
        if programs and error <= programs[0].error:
            break

    def call(m: pt.Mechanism = m, compiled: bool | str = "auto") -> pt.Result:
        return m.simulate(run.duration, t_eval=end, initial=start, rtol=rtol, atol=rtol / 100.0, compiled=compiled)

    seconds, levels, alone, first = float("inf"), float("inf"), float("inf"), float("inf")
    for _ in range(TURNS):
        first = min(first, once(partial(call, entry.mechanism()))[0])
        seconds = min(seconds, fastest(call, 1.0))
        levels = min(levels, fastest(partial(call, compiled=False), 1.0))
        alone = min(alone, evaluation(m, start, run.stretch))
        programs += [] if command is None else [figure(run.title, command)]
    program = None
    if programs:
        best = min(programs, key=lambda x: x.seconds)
        program = replace(best, alone=min(x.alone for x in programs))
    counters = call().counters
    code = by_code(m, start, run.stretch) if counters["compiled_evaluations"] > 0 else None
    return Face(run.title, rtol, seconds, levels, first, counters["evaluations"], code, alone, error, program)


FEW, MANY, STEPS = "rk4", "dop853", 200


def by_code(m: pt.Mechanism, start: pt.State, stretch: float) -> float:
    """Seconds of one evaluation by machine code, with what its method adds up: what eight more evaluations in each step
    take. Both methods have one in each that is not by machine code."""

    def run(method: str) -> pt.Result:
        return m.simulate(stretch, t_eval=[stretch], initial=start, method=method, step=stretch / STEPS, compiled=True)

    few, many = (fastest(partial(run, method)) for method in (FEW, MANY))
    counts = [run(method).counters["evaluations"] for method in (FEW, MANY)]
    return (many - few) / (counts[1] - counts[0])


def evaluation(m: pt.Mechanism, start: pt.State, stretch: float) -> float:
    """Seconds of one evaluation alone, as `compare` measures it."""
    found = m.compare(
        stretch, initial=start, formulations=["projective"], selections=["collective"], rtol=1e-8, atol=1e-10
    )
    return found.row("projective").time_per_evaluation or math.nan


STEP = 1e-3
AGAIN_AIM = 15e-6
"""Largest wanted time of a run beside its evaluations and outputs."""


@dataclass(frozen=True)
class Again:
    """A run of a model that has run before: seconds beside its evaluations and outputs, in the core and of
    `m.simulate`; seconds of one evaluation, with its part of a step, and of one output."""

    title: str
    core: float
    face: float
    evaluation: float
    output: float


def second_run(name: str, few: int = 1, many: int = 41) -> Again:
    """Runs of few and of many fixed steps of order 5, with one output and with one at the end of each step: what grows
    neither with the evaluations nor with the outputs."""
    m, entry = pt.catalogue.load(name), pt.catalogue.entry(name)
    model, start = m.compile(), entry.initial(m)
    q, v = np.ascontiguousarray(start.q), np.ascontiguousarray(start.v)
    settings: dict[str, Any] = {"method": "dopri5", "rtol": RTOL, "atol": ATOL, "step": STEP}

    def times(steps: int, outputs: int) -> Any:
        return start.t + STEP * np.arange(steps - outputs + 1, steps + 1)

    def core(steps: int, outputs: int = 1) -> Callable[[], object]:
        chosen = run_options.options(start.t, STEP * steps, model.velocity_names, **settings)
        ends = run_options.output_times(times(steps, outputs), start.t, chosen["t_end"])
        return lambda: model.core.simulate(chosen.core, ends, q, v, None)

    def face(steps: int) -> Callable[[], object]:
        ends = list(times(steps, 1))
        return lambda: m.simulate(STEP * steps, t_eval=ends, initial=start, **settings)

    def evaluations(steps: int) -> int:
        return m.simulate(STEP * steps, initial=start, **settings).counters["evaluations"]

    took = {
        key: fastest(make, least=300)
        for key, make in {"core": core(few), "long": core(many), "all": core(many, many), "face": face(few)}.items()
    }
    counted = evaluations(few), evaluations(many)
    output = (took["all"] - took["long"]) / (many - 1)
    evaluation = (took["long"] - took["core"]) / (counted[1] - counted[0])
    beside = counted[0] * evaluation + output
    return Again(name, took["core"] - beside, took["face"] - beside, evaluation, output)
