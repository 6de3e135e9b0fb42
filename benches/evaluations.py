"""The column us/eval of `compare` against another way of taking it.

The other way knows whole runs only. Two methods with the same fixed steps do the same after each step and differ in
how many evaluations a step takes, 4 and 12: the difference of their times over that of their evaluations is the cost
of one, with what a method of more stages has to add up. Forms that iterate need more iterations in longer steps: theirs
are as long as those that the column is taken over. Those of the others are shorter, so that the method of fewer stages
leaves nothing to be corrected that the other does not. `compare` takes its column without machine code, which not all
forms have, and so do the runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

import partita as pt

FEW, MANY = "rk4", "dop853"
ROUNDS, SPAN = (12, 400), 1.0
"""Rounds at least and at most, and the time for those in between [s] for each formulation."""
SHORTER = 6
AGREES = 0.15
"""Largest wanted difference of the two."""
FORMULATIONS = (
    "projective",
    "fixed",
    "wehage-haug",
    "explicit-closing",
    "svd",
    "gram-schmidt",
    "tangent-space",
    "multipliers",
    "sparse-multipliers",
    "range-space",
)


@dataclass(frozen=True)
class Problem:
    """A mechanism of the catalogue and a stretch of its motion that keeps away from singular positions."""

    title: str
    name: str
    duration: float
    coordinates: str = "relative"
    loops: int | None = None


PROBLEMS = (
    Problem("four-bar", "four-bar", 2.0),
    Problem("four-bar, absolute", "four-bar", 2.0, coordinates="absolute"),
    Problem("3-RRR", "three-rrr", 0.5),
    Problem("chain N = 40", "n-four-bar", 0.4, loops=40),
    Problem("Andrews' squeezer", "andrews-squeezer", 0.01),
    Problem("RSSR, in space", "rssr", 1.0),
)


@dataclass(frozen=True)
class Cost:
    """Seconds of one evaluation: by `compare`, and from whole runs."""

    formulation: str
    column: float
    runs: float

    @property
    def off(self) -> float:
        """Relative difference."""
        return self.column / self.runs - 1.0


def costs(problem: Problem) -> list[Cost]:
    """Both, for all formulations that march this mechanism."""
    entry = pt.catalogue.entry(problem.name, **({} if problem.loops is None else {"loops": problem.loops}))
    m = entry.mechanism()
    start = entry.initial(m)
    if problem.coordinates == "absolute":
        start = m.convert(start, problem.coordinates)
    forms = [f for f in FORMULATIONS if f != "explicit-closing" or problem.coordinates == "relative"]
    found = m.compare(
        problem.duration,
        initial=start,
        coordinates=problem.coordinates,
        formulations=forms,
        selections=["collective"],
        rtol=1e-12,
        atol=1e-14,
    )
    steps = {}
    for name in forms:
        row = found.row(name)
        steps[name] = (row.steps or 1) * (1 if row.newton_iterations else SHORTER)
    best: dict[tuple[str, str], float] = {}
    evaluations: dict[tuple[str, str], int] = {}
    began_at = perf_counter()
    for turn in range(ROUNDS[1]):
        if turn >= ROUNDS[0] and perf_counter() - began_at > SPAN * len(forms):
            break
        for name in forms:
            for method in (FEW, MANY):
                began = perf_counter()
                run = m.simulate(
                    problem.duration,
                    t_eval=np.array([problem.duration]),
                    initial=start,
                    coordinates=problem.coordinates,
                    solver=pt.Solver(name),
                    method=method,
                    step=problem.duration / steps[name],
                    compiled=False,
                )
                took = perf_counter() - began
                best[name, method] = min(took, best.get((name, method), np.inf))
                evaluations[name, method] = run.counters["evaluations"]
    return [
        Cost(
            name,
            found.row(name).time_per_evaluation or np.nan,
            (best[name, MANY] - best[name, FEW]) / (evaluations[name, MANY] - evaluations[name, FEW]),
        )
        for name in forms
        if evaluations[name, MANY] > evaluations[name, FEW]
    ]
