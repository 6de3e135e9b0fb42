"""The verdict on a run: does what it returned hold, is it doubtful, is it broken; what, when and how much."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

HOLDS, DOUBTFUL, BROKEN = "holds", "doubtful", "broken"

NEWTON_EULER = 1e-7, 1e-3
"""Residual of a body over the largest force: what round-off leaves of it next to the worst position that is worked in
(1e-16 times a condition of 1e9), and where no digit is safe."""
ENERGY = 1e4
"""Tolerances that the energy may be off by: the error of a step, over the steps of a motion and grown with it."""
ENERGY_FLOOR = 1e-9
"""Part of the energy that round-off explains: a potential far larger than what is exchanged."""
ENERGY_BROKEN = 1e-2
"""Part of the energy exchanged that no tolerance explains; with loose ones, a hundred times what they do."""


class Finding(NamedTuple):
    """One thing that stands against a run: is it broken or doubtful by it, when [s], and a sentence."""

    broken: bool
    t: float
    sentence: str


def findings_of(told: Iterable[Any]) -> list[Finding]:
    """Findings out of plain data."""
    return [Finding(bool(broken), float("nan") if t is None else float(t), str(words)) for broken, t, words in told]


def word_of(findings: Iterable[Finding]) -> str:
    """The verdict in a word: that of the worst finding."""
    worst = HOLDS
    for finding in findings:
        if finding.broken:
            return BROKEN
        worst = DOUBTFUL
    return worst


def of_reactions(t: NDArray[np.float64], residual: NDArray[np.float64]) -> list[Finding]:
    """What Newton-Euler residuals (nt,) with the returned reactions say; NaN where a reaction has no value."""
    known = np.flatnonzero(np.isfinite(residual))
    if not len(known):
        return []
    i = int(known[np.argmax(np.abs(residual[known]))])
    worst, (doubtful, broken) = float(abs(residual[i])), NEWTON_EULER
    if worst <= doubtful:
        return []
    words = f"Newton-Euler with the returned reactions is off by {worst:.1e} of the largest force at t = {t[i]:.6g} s"
    return [Finding(worst > broken, float(t[i]), f"{words}; up to {doubtful:.0e} holds")]


def of_energy(t: NDArray[np.float64], balance: NDArray[np.float64], scale: float, rtol: float) -> list[Finding]:
    """What the energy balance (nt,) [J] says, held against the energy exchanged and the tolerance of the run."""
    if not len(balance) or scale <= 0.0:
        return []
    off = np.abs(balance) / scale
    i = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
    explained = max(ENERGY * rtol, ENERGY_FLOOR)
    if off[i] <= explained:
        return []
    words = f"the energy balance is off by {off[i]:.1e} of the energy exchanged at t = {t[i]:.6g} s"
    broken = bool(not off[i] <= max(ENERGY_BROKEN, 100.0 * explained))
    return [Finding(broken, float(t[i]), f"{words}; the tolerance explains {explained:.0e}")]


def of_arrays(t: NDArray[np.float64], *arrays: NDArray[np.float64]) -> list[Finding]:
    """Coordinates and velocities that are not numbers."""
    for array in arrays:
        spoilt = np.flatnonzero(~np.isfinite(array).all(axis=1)) if array.size else []
        if len(spoilt):
            at = float(t[spoilt[0]])
            return [Finding(True, at, f"the motion is not finite from t = {at:.6g} s on")]
    return []
