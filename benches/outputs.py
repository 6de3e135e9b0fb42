"""What outputs cost: many against one, the first reaction that is asked for, and states inside a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from timing import fastest

import partita as pt
from partita.results import Result

OUTPUTS_AIM = 2.0
STATES_AIM = 1.0
STATES = 1000
FORCE_AIMS = {"four-bar": 2e-3, "chain N = 200": 60e-3}


@dataclass(frozen=True)
class Outputs:
    """Seconds of a run of 1 s with one output and with the default 201, and how often the second is the first."""

    one: float
    many: float
    outputs: int

    @property
    def ratio(self) -> float:
        """Many over one."""
        return self.many / self.one


@dataclass(frozen=True)
class FirstForce:
    """Seconds of the first `run.joint(name).force` at so many outputs, and the residual of its equations of motion."""

    seconds: float
    outputs: int
    residual: float


def outputs_cost() -> Outputs:
    """The four-bar of the catalogue, through the public face."""
    entry = pt.catalogue.entry("four-bar")
    m = entry.mechanism()
    start = entry.initial(m)
    return Outputs(
        one=fastest(lambda: m.simulate(1.0, t_eval=[1.0], initial=start)),
        many=fastest(lambda: m.simulate(1.0, initial=start)),
        outputs=len(m.simulate(1.0, initial=start).t),
    )


def first_force(name: str, joint: str, duration: float, **parameters: int) -> FirstForce:
    """A fresh run each time; reading the force alone is timed."""
    entry = pt.catalogue.entry(name, **parameters)
    m = entry.mechanism()
    start, times = entry.initial(m), np.linspace(0.0, duration, 1001)
    runs: list[Result] = []

    def anew() -> None:
        runs[:] = [m.simulate(duration, t_eval=times, initial=start)]

    seconds = fastest(lambda: runs[0].joint(joint).force, 0.3, 5, anew)
    residual = float(np.max(np.abs(runs[0].at_once.reactions["residual"]), initial=0.0))
    return FirstForce(seconds, len(times), residual)


@dataclass(frozen=True)
class StatesCost:
    """Seconds of a run, and of so many of its states: at scattered times one by one, and as one array."""

    run: float
    one_by_one: float
    array: float
    states: int


def states_cost(name: str, duration: float, **parameters: int) -> StatesCost:
    """A fresh run each time; reading the states alone is timed."""
    entry = pt.catalogue.entry(name, **parameters)
    m = entry.mechanism()
    start = entry.initial(m)
    scattered = np.random.default_rng(0).uniform(start.t, start.t + duration, STATES)
    times = scattered.tolist()
    runs: list[Result] = []

    def anew() -> None:
        runs[:] = [m.simulate(duration, initial=start)]

    return StatesCost(
        run=fastest(anew),
        one_by_one=fastest(lambda: [runs[0].state(t) for t in times], 0.3, 5, anew),
        array=fastest(lambda: runs[0].state(scattered), 0.3, 5, anew),
        states=STATES,
    )


def states_costs() -> dict[str, StatesCost]:
    """A small and a large mechanism."""
    return {
        "four-bar": states_cost("four-bar", 10.0),
        "chain N = 20": states_cost("n-four-bar", 10.0, loops=20),
    }


def first_forces() -> dict[str, FirstForce]:
    """One joint of a small and of a large mechanism."""
    return {
        "four-bar": first_force("four-bar", "A", 1.0),
        "chain N = 200": first_force("n-four-bar", "P100", 1.0, loops=200),
    }
