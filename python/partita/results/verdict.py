"""The verdict on a run: does what it returned hold, is it doubtful, is it broken; what, when and how much.

The core judges; here its findings become words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .energy import EnergyResult

HOLDS, DOUBTFUL, BROKEN = "holds", "doubtful", "broken"


class Finding(NamedTuple):
    """One thing that stands against a run: is it broken or doubtful by it, when [s], and a sentence."""

    broken: bool
    t: float
    sentence: str


def findings_of(reported: Iterable[Any]) -> list[Finding]:
    """Findings out of plain data."""
    return [Finding(bool(broken), float("nan") if t is None else float(t), str(words)) for broken, t, words in reported]


def word_of(findings: Iterable[Finding]) -> str:
    """The verdict in a word: that of the worst finding."""
    worst = HOLDS
    for finding in findings:
        if finding.broken:
            return BROKEN
        worst = DOUBTFUL
    return worst


def of_reactions(t: NDArray[np.float64], residual: NDArray[np.float64], options: Mapping[str, Any]) -> list[Finding]:
    """What Newton-Euler residuals (nt,) with the returned reactions say; NaN where a reaction has no value."""
    drifts = options.get("correction") == "none" or options.get("formulation") == "baumgarte"
    times, residuals = _columns(t, residual)
    return findings_of(_core.reaction_findings(times, residuals, (tolerance(options), drifts)))


def unnoticed(description: str | None, options: Mapping[str, Any]) -> float:
    """Energy [J] against which a balance is held at the least.

    That of all bodies at speeds of the absolute tolerance is below what anybody asked about; and weights that balance
    each other are added up with the round-off of each.
    """
    atol = options.get("atol")
    return _core.energy_floor(description, atol) if description is not None and isinstance(atol, float) else 0.0


def of_energy(
    t: NDArray[np.float64], energy: EnergyResult, rtol: float, steps: int, least: float = 0.0
) -> list[Finding]:
    """What the energy balance says, held against the energy exchanged (`least` at the least) and the tolerance of the
    run."""
    kinetic, potential, work = _columns(energy.kinetic, energy.potential, energy.work)
    parts = (kinetic, potential, work)
    return findings_of(_core.energy_findings(_columns(t)[0], parts, rtol, steps, least))


def _columns(*arrays: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return [np.ascontiguousarray(a, dtype=np.float64) for a in arrays]


def tolerance(options: Mapping[str, Any]) -> float:
    """Relative tolerance that a run was asked for; of fixed steps nobody knows it."""
    return 1.0 if options.get("step") is not None else float(options.get("rtol") or 0.0)


def of_arrays(t: NDArray[np.float64], *arrays: NDArray[np.float64]) -> list[Finding]:
    """Coordinates and velocities that are not numbers."""
    for array in arrays:
        spoilt = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(spoilt):
            at = float(t[spoilt[0]])
            return [Finding(True, at, f"the motion is not finite from t = {at:.6g} s on")]
    return []
