"""`python -m verdicts 1000`: is what holds called so? Mechanisms drawn by chance, at tolerances from 1e-4 to 1e-12.

Each runs at one tolerance and at the tightest. Where the paths agree as far as the one allows, the run is right: it
shall say success, and its certificate "valid". Where they do not it shall not.
"""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections import Counter
from dataclasses import dataclass
from multiprocessing import Pool

import numpy as np
from catalogue_runs import WITHOUT_EVENTS
from oracle import chance
from oracle.comparison import moving

from partita import Mechanism, State, catalogue
from partita.errors import PartitaError, SuspectResultWarning
from partita.results import Result

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
ALLOWED = 1e3
"""Tolerances of a step that a path over a part of a turn may be off by."""
FLOOR = 1e-9
"""What the tightest run leaves, in parts of the size."""


@dataclass(frozen=True)
class Judged:
    """What came of one mechanism."""

    outcome: str
    words: str


def judged(seed: int) -> Judged:
    """One mechanism drawn by chance."""
    drawing = chance.mechanism(seed)
    rtol = TOLERANCES[seed % len(TOLERANCES)]
    absolute = seed % 3 == 0
    try:
        m = drawing.build()
        start = moving(m, drawing, np.random.default_rng(seed))
        if absolute:
            start = m.convert(start, "absolute")
        words = f"seed {seed}, {'absolute' if absolute else 'relative'}, {drawing.words}"
        return compared(m, start, 0.3 * drawing.time, drawing.size, rtol, words)
    except PartitaError as error:
        return Judged(f"refused: {type(error).__name__}", str(error))


def of_catalogue(task: tuple[str, float]) -> Judged:
    """One entry of the catalogue over a second of its motion at the most."""
    name, rtol = task
    entry = catalogue.entry(name)
    m = entry.mechanism()
    start = entry.initial(m)
    here = m.simulate(1e-9, t_eval=[start.t], initial=start).at_once.observed["body_position"]
    size = float(np.abs(here).max())
    return compared(m, start, min(1.0, entry.duration), size, rtol, name)


def compared(m: Mechanism, start: State, end: float, size: float, rtol: float, words: str) -> Judged:
    """Right, "doubted" or "stopped" though right, "wrong" with success; or nothing to judge."""

    def march(tolerance: float) -> Result:
        return m.simulate(
            end, t_eval=np.linspace(0.0, end, 7), initial=start, rtol=tolerance,
            atol=1e-2 * tolerance * min(1.0, size), max_steps=4000,
            coordinates="relative" if start.names == m.compile().names else "absolute",
        )  # fmt: skip

    known = march(1e-13)
    if not known.success:
        return Judged(f"no reference: {known.status}", known.message)
    run = march(rtol)
    at = f"{words}, rtol {rtol:.0e}"
    rows = len(run.t)
    off = np.abs(run.at_once.observed["body_position"] - known.at_once.observed["body_position"][:rows]).max() / size
    if not off <= ALLOWED * rtol + FLOOR:
        word = "wrong" if run.success and run.certificate.verdict == "valid" else "off, and told"
        return Judged(word, f"{at}: off by {off:.1e}; {run.message}")
    if not run.success:
        return Judged("stopped", f"{at}: {run.message}")
    found = run.certificate.findings
    return Judged("doubted" if found else "right", f"{at}: off by {off:.1e}; {'; '.join(x.sentence for x in found)}")


def main(count: int) -> int:
    """Print what was counted and the first that was misjudged; 1 if any was."""
    warnings.simplefilter("ignore", SuspectResultWarning)
    with Pool(os.cpu_count()) as pool:
        found = pool.map(judged, range(count), chunksize=16)
        entries = [(name, rtol) for name in WITHOUT_EVENTS for rtol in TOLERANCES]
        found += pool.map(of_catalogue, entries, chunksize=4)
    outcomes = Counter(x.outcome for x in found)
    print(
        f"{count} mechanisms and {len(entries)} runs of the catalogue: "
        + ", ".join(f"{n} {what}" for what, n in sorted(outcomes.items()))
    )
    misjudged = [x for x in found if x.outcome in ("wrong", "doubted", "stopped")]
    for x in misjudged[:12]:
        print(f"  {x.outcome}: {x.words}")
    return int(bool(misjudged))


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000))
