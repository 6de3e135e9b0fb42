"""Contacts drawn by chance, with few outputs and many, against runs whose steps could miss none.

Three families: a ball that flies onto another, a pendulum that swings onto a pin, three balls of which the first may
touch both others. A run is wrong where its last velocities differ from those of the reference by more than the
tolerance allows, and it says success; `Case.growth` is how much a touch magnifies an error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from test_contacts_seen import balls, glancing, pin

FAMILIES = {"balls": balls, "pin": pin, "glancing": glancing}
TOLERANCES = (1e-4, 1e-6, 1e-8)
OUTPUTS = (2, 21, 201)
FINE = 100
"""Steps of the reference in the time of a contact."""
ALLOWED = 100.0
"""Times the tolerance and the growth."""
NUDGE = 1e-8
"""Relative change of the speed at the start by which the growth is measured."""


@dataclass(frozen=True)
class Trial:
    """One run: which, how it ended, its error over the tolerance and the growth."""

    family: str
    seed: int
    rtol: float
    outputs: int
    success: bool
    verdict: str
    error: float
    message: str = ""

    @property
    def word(self) -> str:
        """What it is counted as."""
        if not self.success:
            return "no success"
        if self.verdict == "invalid":
            return "invalid"
        return "right" if self.error <= ALLOWED else "wrong"


def trial(family: str, seed: int) -> list[Trial]:
    """A drawn case at every tolerance with every number of outputs."""
    case = FAMILIES[family](np.random.default_rng([seed, list(FAMILIES).index(family)]))
    m, start, end = case.mechanism, case.start, case.time
    tight = {"rtol": 1e-11, "atol": 1e-13, "max_step": case.contact / FINE}
    beside = start.copy()
    beside.v[:] = start.v * (1.0 + NUDGE)
    if not np.any(start.v):
        beside.q[0] += NUDGE
    reference, other = (m.simulate(end, t_eval=[end], initial=s, **tight) for s in (start, beside))
    if not (reference.success and other.success):
        return [Trial(family, seed, 0.0, 0, False, "", np.inf, f"the reference: {reference.message} {other.message}")]
    fastest = np.abs(reference.v).max()
    growth = max(1.0, float(np.abs(other.v - reference.v).max() / fastest / NUDGE))
    found = []
    for rtol in TOLERANCES:
        for outputs in OUTPUTS:
            run = m.simulate(end, t_eval=np.linspace(0, end, outputs), initial=start, rtol=rtol, atol=rtol / 100)
            error = (
                float(np.abs(run.v[-1] - reference.v[-1]).max() / fastest / rtol / growth) if run.success else np.inf
            )
            found.append(
                Trial(
                    family,
                    seed,
                    rtol,
                    outputs,
                    run.success,
                    run.certificate.verdict,
                    error,
                    "" if run.success else run.message,
                )
            )
    return found
