"""The verdict on a run: valid, suspect or invalid, with the findings, their times and sizes.

The core judges; this module puts its findings into words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .energy import EnergyResult

VALID, SUSPECT, INVALID = "valid", "suspect", "invalid"


class Finding(NamedTuple):
    """One finding against a run: whether it makes the run invalid or merely suspect, when [s], and a sentence."""

    invalid: bool
    """Whether the run is invalid by it; otherwise it is suspect."""
    t: float
    """When [s]."""
    sentence: str
    """What was found, with its numbers."""


def findings_of(reported: Iterable[Any]) -> list[Finding]:
    """Findings from plain data."""
    return [
        Finding(bool(invalid), float("nan") if t is None else float(t), str(words)) for invalid, t, words in reported
    ]


def verdict_of(findings: Iterable[Finding]) -> str:
    """The verdict, which is that of the worst finding."""
    worst = VALID
    for finding in findings:
        if finding.invalid:
            return INVALID
        worst = SUSPECT
    return worst


def of_reactions(t: NDArray[np.float64], residual: NDArray[np.float64], options: Mapping[str, Any]) -> list[Finding]:
    """Findings from Newton-Euler residuals (nt,) with the returned reactions; NaN where a reaction has no value."""
    drifts = options.get("correction") == "none" or options.get("formulation") == "baumgarte"
    times, residuals = _columns(t, residual)
    return findings_of(_core.reaction_findings(times, residuals, (tolerance(options), drifts)))


def unnoticed(description: str | None, options: Mapping[str, Any]) -> float:
    """Smallest reference energy [J] of a balance.

    The energy of all bodies at speeds of the absolute tolerance is irrelevant, and the potentials of weights that
    balance each other contain the round-off of each.
    """
    atol = options.get("atol")
    return _core.energy_floor(description, atol) if description is not None and isinstance(atol, float) else 0.0


def of_energy(
    t: NDArray[np.float64], energy: EnergyResult, rtol: float, steps: int, least: float = 0.0
) -> list[Finding]:
    """Findings from the energy balance, relative to the energy exchanged (at least `least`) and the tolerance of the
    run."""
    kinetic, potential, work = _columns(energy.kinetic, energy.potential, energy.work)
    parts = (kinetic, potential, work)
    return findings_of(_core.energy_findings(_columns(t)[0], parts, rtol, steps, least))


def _columns(*arrays: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return [np.ascontiguousarray(a, dtype=np.float64) for a in arrays]


def tolerance(options: Mapping[str, Any]) -> float:
    """Relative tolerance of a run; 1 for fixed steps, whose tolerance is unknown."""
    return 1.0 if options.get("step") is not None else float(options.get("rtol") or 0.0)


def of_arrays(t: NDArray[np.float64], *arrays: NDArray[np.float64]) -> list[Finding]:
    """Coordinates and velocities that are not finite."""
    for array in arrays:
        spoilt = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(spoilt):
            at = float(t[spoilt[0]])
            return [Finding(True, at, f"the motion is not finite from t = {at:.6g} s on")]
    return []
