"""What a program in maximal coordinates, which shares nothing with the core, says of the outputs of a run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from oracle.comparison import Verdict, look
from oracle.drawing import Drawing

import partita as pt
from partita.results import Result

from .case import Held


def as_the_program_says(
    drawing: Drawing, m: pt.Mechanism, run: Result, coordinates: str = "relative"
) -> Iterator[Held]:
    """Closure, accelerations, reactions and what of them is unique, at every output; tolerances are the program's."""
    verdict = Verdict()
    look(drawing, m, run, coordinates, verdict, np.random.default_rng(0))
    yield Held("; ".join(verdict.wrong[:3]) or "the program", len(verdict.wrong), 0, 0.0)
    yield Held("outputs looked at", verdict.counts["instants"] > 0.8 * len(run.t), True, 0.0)
