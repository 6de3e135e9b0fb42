"""What a step of a stepper costs beside its evaluations, and how much that varies over a million of them."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from time import perf_counter_ns

import numpy as np

import partita as pt

TICKS = 1_000_000
DT, SUBSTEPS = 1e-3, 2
AIM = 3e-6
"""Largest wanted time of a step beside its evaluations."""
PARTS = (0.5, 0.99, 0.9999, 1.0)
"""Parts of all steps that took at most the time given."""
EVALUATIONS = 4 * SUBSTEPS + 1
"""Of the method of order four, and the one at the start, where the inputs may have changed."""


@dataclass(frozen=True)
class Ticks:
    """Times of steps [s]: the fastest, at most for each of `PARTS`; an evaluation; the fastest step beside those."""

    title: str
    ticks: int
    fastest: float
    within: tuple[float, ...]
    evaluation: float

    @property
    def beside(self) -> float:
        """The fastest step without its evaluations."""
        return self.fastest - EVALUATIONS * self.evaluation


def tick_costs(ticks: int = TICKS) -> Ticks:
    """The four-bar under a torque that changes at each step, as in a control loop; nothing is recorded."""
    m = pt.catalogue.load("four-bar")
    motor = m.add_torque("A", 0.0, name="motor")
    start = pt.catalogue.entry("four-bar").initial(m)
    run = m.simulate(0.1, initial=start, t_eval=[0.05], method="rk4", step=DT / SUBSTEPS)
    evaluation = m.compile().evaluation_costs([run.options], [DT / SUBSTEPS], run.t, run.q, run.v, None)[0]
    sim = m.stepper(DT, inputs=[motor], initial=start, substeps=SUBSTEPS, record=False)
    took, inputs = np.zeros(ticks, dtype=np.int64), 0.1 * np.sin(0.01 * np.arange(1000))[:, None]
    gc.collect()
    for i in range(ticks):
        u = inputs[i % 1000]
        began = perf_counter_ns()
        sim.step(u)
        took[i] = perf_counter_ns() - began
    took.sort()
    within = tuple(1e-9 * float(took[max(0, round(part * ticks) - 1)]) for part in PARTS)
    return Ticks("four-bar", ticks, 1e-9 * float(took[0]), within, evaluation)
