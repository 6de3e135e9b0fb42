"""Ten-second runs of the zoo, runs at many tolerances, and runs in both kinds of coordinates."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from oracle.drawing import Array

import partita as pt
from partita.catalogue import zoo
from partita.errors import PartitaError, SuspectResultWarning
from partita.results import Result

from .judging import Judged, judge

LONG, OUTPUTS = 10.0, 21
"""Seconds of a run, also of those that the catalogue shows for a shorter time, and its outputs."""
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
MANY_TOLERANCES = ("stewart-ups", "delta", "double-cardan", "spherical-wrist", "goldberg", "myard")
"""Many degrees of freedom, or conditions that follow from others along the whole motion."""

# Two starts this far apart, in parts of the speed; paths are compared as long as they stay within this many times that.
APART, GROWTH = 1e-7, 1e2
SAME = 1e-9
"""What paths in the two kinds of coordinates may differ by, in parts of the size: rtol 1e-13 grown a hundredfold, over
some tens of steps."""
FINE = {"rtol": 1e-13, "atol": 1e-15}


def long_run(name: str, rtol: float | None = None) -> Judged:
    """Ten seconds, at the tolerance of the entry or another, with everything that must hold."""
    entry = replace(pt.catalogue.entry(name), duration=LONG)
    options = {} if rtol is None else {"rtol": rtol, "atol": 1e-2 * rtol}
    title = name if rtol is None else f"{name}, rtol {rtol:.0e}"
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", SuspectResultWarning)
        try:
            result = entry.simulate(t_eval=np.linspace(0.0, entry.duration, OUTPUTS), **options)
            found = judge(name, result)
            # integration: one number for the entry's four
            found.wrong += [str(m) for m in entry.measure(result) if not m.passed]
        except PartitaError as error:
            return Judged(title, [f"{type(error).__name__}: {error}"])
    found.name = title
    found.wrong += [str(warning.message) for warning in heard]
    # no member of the zoo comes to one: by the independent program the smallest singular value that counts stays large
    found.wrong += [note for note in result.certificate.notes if "singular positions" in note]
    return found


def both_coordinates(name: str) -> Judged:
    """One motion in relative and absolute coordinates, as long as starts next to each other stay together."""
    entry, found = replace(pt.catalogue.entry(name), duration=LONG), Judged(f"{name}, absolute")
    m = entry.mechanism()
    start = entry.initial(m)
    times = np.linspace(0.0, entry.duration, 101)

    def path(state: pt.State, until: float, coordinates: str = "relative") -> tuple[Result, Array]:
        run = m.simulate(until, initial=state, coordinates=coordinates, t_eval=times[times <= until], **FINE)
        return run, np.stack([run.body(name).position for name in run.names.bodies], axis=1)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)
        try:
            run, here = path(start, entry.duration)
            _, beside = path(nudged(m, start), entry.duration)
            size = zoo.size(run)
            common = min(len(here), len(beside))
            grown = np.abs(here[:common] - beside[:common]).max(axis=(1, 2)) / size / APART
            last = int(np.argmax(grown > GROWTH)) - 1 if np.any(grown > GROWTH) else common - 1
            other, there = path(m.convert(start, "absolute"), float(times[last]), "absolute")
        except PartitaError as error:
            found.wrong.append(f"{type(error).__name__}: {error}")
            return found
    if last < 5:
        found.wrong.append(f"nothing to compare: starts next to each other part within {times[last + 1]:g} s")
    if not run.success or not other.success:
        found.wrong.append(next(r.message for r in (run, other) if not r.success))
    found.until = float(times[last])
    common = min(len(there), last + 1)
    found.worst["path"] = float(np.abs(here[:common] - there[:common]).max()) / size
    if not found.worst["path"] <= SAME:
        found.wrong.append(f"paths differ by {found.worst['path']:.1e} of the size within {times[last]:g} s")
    return found


def nudged(m: pt.Mechanism, state: pt.State) -> pt.State:
    """The same position, every independent velocity a little larger."""
    names = m.compile().velocity_names
    speeds = {names[i]: float(state.v[i]) for i in m.compile().at(state.q).independent}
    return m.assemble(rates={name: v + APART * max(1.0, abs(v)) for name, v in speeds.items()}, near=state)


def tasks() -> list[tuple[str, str, float | None]]:
    """Everything there is to do: what, of which mechanism, at which tolerance."""
    found: list[tuple[str, str, float | None]] = [("long", name, None) for name in zoo.ENTRIES]
    found += [("long", name, rtol) for name in MANY_TOLERANCES for rtol in TOLERANCES]
    return found + [("both", name, None) for name in zoo.ENTRIES]


def done(task: tuple[str, str, float | None]) -> Judged:
    """One of `tasks`."""
    what, name, rtol = task
    return long_run(name, rtol) if what == "long" else both_coordinates(name)
