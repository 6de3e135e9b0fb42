"""What questions about one position cost: linearised equations, and the equations in the rates of actuators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from poses import ankle, five_bar
from timing import fastest

import partita as pt


@dataclass(frozen=True)
class Answer:
    """Seconds of a call of the package and of its evaluation in the core, the largest that is wanted of the latter, and
    how far the numbers are from those of another way."""

    title: str
    call: float
    core: float
    aim: float
    error: float


def linearised(title: str, m: pt.Mechanism, aim: float) -> Answer:
    """A and f0 at the drawn position, beside those by differences of the accelerations."""
    model, state = m.compile(), m.assemble()
    none = np.zeros((0, model.core.nv))
    core = fastest(lambda: model.core.linearized(state.t, state.q, state.v, none, beside=False))
    found = model.core.linearized(state.t, state.q, state.v, none)
    k, v = len(found["positions"]), found["velocities"]
    slopes = [
        (model.acceleration(found["probe_q"][2 * i], found["probe_v"][2 * i])[0][v]
         - model.acceleration(found["probe_q"][2 * i + 1], found["probe_v"][2 * i + 1])[0][v])
        / (2 * found["steps"][i])
        for i in range(2 * k)
    ]  # fmt: skip
    error = np.abs(np.array(slopes).T - found["A"][k:]).max() / np.abs(found["A"]).max()
    return Answer(f"linearize, {title}", fastest(lambda: m.linearize(state)), core, aim, float(error))


def actuated(title: str, m: pt.Mechanism, motors: tuple[str, ...], aim: float) -> Answer:
    """Mass matrix, bias and ratios at a moving state, whose velocities the ratios return."""
    model = m.compile()
    state = m.assemble(rates={motor: 1.0 + 0.5 * i for i, motor in enumerate(motors)})
    a = model.actuated(state, motors)
    core = min(a._core.cost(state.t, state.q, state.v) for _ in range(40))
    error = np.abs(a.ratios @ a.rates - state.v).max() / np.abs(state.v).max()
    return Answer(f"actuated, {title}", fastest(lambda: a.at(state)), core, aim, float(error))


def answers() -> list[Answer]:
    """All of them."""
    load = pt.catalogue.load
    return [
        linearised("four-bar", load("four-bar"), 50e-6),
        linearised("chain of 200 loops", load("n-four-bar", loops=200), 20e-3),
        actuated("five-bar", five_bar(), ("A", "E"), 2e-6),
        actuated("parallel ankle", load("parallel-ankle"), ("motor l", "motor r"), 2e-6),
        actuated("ankle, rods between balls", ankle(), ("ML", "MR"), 2e-6),
    ]
