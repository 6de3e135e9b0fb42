"""What derivatives of runs cost, as multiples of the run: forwards along eight numbers, backwards by a hundred."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from timing import fastest

import partita as pt
from partita.results.sensitivities import Observing, backward, derivatives, held_of, numbers_of

AIM = 6.0
"""Times the run."""
MANY, FEW = 100, 8
LINKAGES = {"four-bar": ("A", 20.0), "jansen-leg": ("crank", 30.0), "delta": ("shoulder 1", 40.0)}
"""With the joint that is observed, and seconds."""


@dataclass(frozen=True)
class GradientCost:
    """Seconds of a run with its steps kept, and of derivatives of its end."""

    name: str
    steps: int
    numbers: int
    run: float
    forward: float
    adjoint: float
    agrees: float


def gradient_costs() -> list[GradientCost]:
    """One for each linkage; all in one sitting."""
    found = []
    for name, (joint, duration) in LINKAGES.items():
        m = pt.catalogue.load(name)
        start = m.assemble()

        def run(m: pt.Mechanism = m, duration: float = duration, start: pt.State = start) -> pt.Result:
            return m.simulate(duration, t_eval=[0.0, duration], initial=start, rtol=1e-10, atol=1e-12)

        done = run()
        joint = joint if joint in done.names.joints else done.names.joints[0]
        names = [p for p in m.compile().parameters if p.endswith((".mass", ".com", ".inertia", ".point"))]
        held = held_of(done, None)
        all_numbers = numbers_of(names, done, held)
        many, count = [], 0
        for number in all_numbers:
            if count < MANY:
                many.append(number)
                count += len(number.directions)
        few, eight = [], 0
        for number in all_numbers:
            if len(number.directions) + eight <= FEW:
                few.append(number)
                eight += len(number.directions)
        observables = [Observing(done).joint(joint, "position")]
        end = float(done.t[-1])
        at = [(end, False)]
        back = backward(done, many, held, observables, at, integrals=(), weights=(np.ones((1, 1)), np.zeros(0)))
        ahead = derivatives(done, many, held, observables, [end]).along[0, 0]

        def forward(d: pt.Result = done, n: Any = few, h: Any = held, o: Any = observables, e: float = end) -> Any:
            return derivatives(d, n, h, o, [e])

        def adjoint(d: pt.Result = done, n: Any = many, h: Any = held, o: Any = observables, a: Any = at) -> Any:
            return backward(d, n, h, o, a, integrals=(), weights=(np.ones((1, 1)), np.zeros(0)))

        found.append(
            GradientCost(
                name=name,
                steps=done.counters["steps"],
                numbers=count,
                run=fastest(run),
                forward=fastest(forward),
                adjoint=fastest(adjoint),
                agrees=float(np.abs(back - ahead).max() / np.abs(ahead).max()),
            )
        )
    return found
