"""What thousands of four-bars cost side by side, in CPU time: in lanes, in a loop over ordinary runs, and by the limit.

The limit is an evaluation of the C program written by hand for one four-bar, measured in the same minute, times the
evaluations that the members' steps take: twelve for each, and two for its start.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from limit import at_once, measured

import partita as pt

MEMBERS = 4096
RTOL = 1e-8
AIM = 0.08
"""Seconds of CPU for all members on one core."""
FASTER = 1.8
"""How much sooner two cores are done."""
SAMPLE = 64
"""Members that run alone, of which the cost of all is taken."""
ROUNDS = 5


@dataclass(frozen=True)
class Cost:
    """CPU time [s] of all members on one core, wall time on one and on two; of a loop over ordinary runs, and of the
    limit (None without a C compiler). What two copies of the limit do side by side, in the work of one. How far members
    are from their ordinary runs [rad].
    """

    cpu: float
    one: float
    two: float
    loop: float
    limit: float | None
    copies: float | None
    steps: int
    in_lanes: int
    apart: float


def _fastest(call: Callable[[], object], clock: Callable[[], float]) -> float:
    found = []
    for _ in range(ROUNDS):
        began = clock()
        call()
        found.append(clock() - began)
    return min(found)


def ensemble_cost(folder: Path) -> Cost:
    """Four-bars of one second that start at crank rates between 1.5 and 2.5 rad/s: some turn over, others do not."""
    m = pt.catalogue.load("four-bar")
    unit = m.assemble(rates={"A": 1.0})
    rates = np.random.default_rng(1).uniform(1.5, 2.5, MEMBERS)
    states = [pt.State(0.0, unit.q, unit.v * rate, names=unit.names) for rate in rates]

    def on(workers: int) -> pt.mechanism.ensemble.Ensemble:
        return m.ensemble(states=states, t_eval=[1.0], rtol=RTOL, workers=workers)

    found = on(1)
    chosen = range(0, MEMBERS, MEMBERS // SAMPLE)

    def alone() -> list[pt.Result]:
        return [m.simulate(1.0, t_eval=[1.0], initial=states[i], rtol=RTOL) for i in chosen]

    loop = _fastest(alone, time.process_time) / SAMPLE * MEMBERS
    apart = max(float(np.abs(run.q - found.q[i]).max()) for i, run in zip(chosen, alone(), strict=True))
    limit = measured(folder).get("four-bar")
    evaluations = 12 * found.steps + 2 * MEMBERS
    return Cost(
        cpu=_fastest(lambda: on(1), time.process_time),
        one=_fastest(lambda: on(1), time.perf_counter),
        two=_fastest(lambda: on(2), time.perf_counter),
        loop=loop,
        limit=None if limit is None else limit.seconds / limit.evaluations * evaluations,
        copies=at_once(folder, 2),
        steps=found.steps,
        in_lanes=int(found.in_lanes.sum()),
        apart=apart,
    )
