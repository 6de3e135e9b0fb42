"""Runs of mechanisms that hold at times, drawn by chance, beside a program that decides by brute force.

`python -m holding 300` compares that many. Each is run with one of several tolerances, from a file where it can be
written, with states read inside the run; in every one friction, freewheels and stops obey their laws, and energy is
accounted for.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt
from partita.errors import PartitaError

from .drawn import Case, case
from .reference import NotDecided, Reference

DURATION = 1.0
OUTPUTS = 21
INSIDE = (0.1234567, 0.4142136, 0.7320508)
"""Times at which states are read [s]."""
AGREES = 1e-4
"""Positions that differ by less are the same, in m or rad. Reason: both integrate to 1e-9, and what bounces or breaks
loose amplifies it."""
LOOSE = 3e-2
"""The same for a run with the tolerance of 1e-5."""
TOLERANCES = (1e-9, 1e-9, 1e-12, 1e-5)
WRONG = ("differs", "breaks a law")


@dataclass(frozen=True)
class Comparison:
    """What came of a case: a word, and why."""

    number: int
    kind: str
    word: str
    why: str = ""
    events: int = 0


def violations(found: Case, run: pt.Result, room: float) -> list[str]:
    """Laws that the outputs of a run break."""
    wrong: list[str] = []
    for x in found.elements:
        if x.by_event:
            effort = run.drive(f"stop {x.name}").effort[:, 0]
        else:
            effort = np.ravel(run.force(x.name).effort)
        joint = run.joint(x.along[0])
        rate, at = np.atleast_2d(joint.velocity)[:, x.along[1]], joint.position[:, x.along[1]]
        if x.kind == "friction":
            sliding, sticking = (np.array([f(t) for t in run.t]) for f in (x.sliding, x.sticking))
            if (np.abs(effort) > np.maximum(sliding, sticking) * (1.0 + 1e-6) + 1e-9).any():
                wrong.append(f"{x.name} carries too much")
            slips = np.abs(rate) > 1e-6
            if (np.abs(effort + np.sign(rate) * sliding)[slips] > 1e-6 * (1.0 + sliding[slips])).any():
                wrong.append(f"{x.name} slips with another force")
        elif x.kind == "freewheel":
            if (rate * x.sense).min() < -1e-7 or (effort * x.sense).min() < -1e-6:
                wrong.append(f"{x.name} turns or carries in the wrong sense")
            if np.abs(effort * rate).max() > 1e-5:
                wrong.append(f"{x.name} has power")
        elif x.kind == "stop":
            for bound, sense in x.bounds:
                if (sense * (bound - at)).max() > room:
                    wrong.append(f"{x.name} is passed by {(sense * (bound - at)).max():.1e}")
            if len(x.bounds) == 1 and (x.bounds[0][1] * effort).min() < -1e-6:
                wrong.append(f"{x.name} pulls")
    balance = run.energy.total - run.energy.work
    if np.ptp(balance) > 100.0 * room * (1.0 + np.abs(balance).max()):
        wrong.append(f"energy is off by {np.ptp(balance):.1e}")
    return wrong


def mechanism(found: Case, written: bool) -> pt.Mechanism:
    m = found.mechanism()
    if not written:
        return m
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "m.toml"
        m.save(path)
        return pt.load(path)


def trial(number: int) -> Comparison:
    """One case."""
    found, rtol = case(number), TOLERANCES[number % len(TOLERANCES)]
    times = sorted({*np.linspace(0.0, DURATION, OUTPUTS).tolist(), *INSIDE})
    outputs = [t for t in times if t not in INSIDE]

    def seen(word: str, why: Any = "", events: int = 0) -> Comparison:
        return Comparison(number, found.kind, word, str(why)[:240], events)

    plain = found.build()
    m = mechanism(found, found.writable and number % 2 == 1)
    settings: dict[str, Any] = {"coordinates": found.coordinates, "rtol": rtol, "atol": min(rtol, 1e-7)}
    try:
        start = found.start(m, found.coordinates)
        run = m.simulate(DURATION, initial=start, t_eval=outputs, events=found.events(), **settings)
    except PartitaError as error:
        return seen("refused", f"{type(error).__name__}: {error}")
    count = len(run.events)
    if wrong := violations(found, run, max(1e-7, rtol)):
        return seen("breaks a law" if run.success else "ended", f"{wrong}; {run.message}", count)
    reference = Reference(plain, found.elements, found.actions)
    state = found.start(plain, "relative")
    try:
        known = reference.run(DURATION, state.q, state.v, times, found.efforts)
    except NotDecided as error:
        return seen("not decided" if run.success else "ended", run.message if not run.success else error, count)
    most, other = AGREES if rtol < 1e-6 else LOOSE, "differs"
    if reference.several:
        other = "several ways"
    elif any("were crossed" in note for note in run.notes):
        other = "crosses"  # singular positions, at which the reference is less exact
    for i, (joint, k) in enumerate(reference.coordinates):
        place = 2 * reference.n + i
        for row, t in enumerate(run.t):
            if t not in known:
                continue  # where it ended early
            off = run.joint(joint).position[row, k] - known[t][place]
            if abs(off) > most:
                return seen(other, f"{joint} at t = {t} by {off:.1e}", count)
        for t in INSIDE:
            if t < run.t[-1] and run.success:
                off = float(np.ravel(run.state(t).position(joint))[k]) - known[t][place]
                if found.coordinates == "absolute":
                    off = math.remainder(off, math.tau)  # a state in space knows no whole turns
                if abs(off) > most:
                    return seen(other, f"state({t}) of {joint} by {off:.1e}", count)
    return seen("agrees" if run.success else "ended", "" if run.success else run.message, count)
