"""The verdict on a run: does what it returned hold, is it doubtful, is it broken; what, when and how much."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .energy import EnergyResult

HOLDS, DOUBTFUL, BROKEN = "holds", "doubtful", "broken"

DRIFT = 1e4, 1e-6, 1e-3
"""Conditions that are not closed on purpose drift by so many tolerances, at least and at most this far."""
NEWTON_EULER = 1e-7, 1e-3
"""Residual of a body over the largest force: what round-off leaves of it next to the worst position that is worked in
(1e-16 times a condition of 1e9), and where no digit is safe."""
ENERGY = 100
"""Tolerances that the energy may be off by besides one for each step: errors grow with the motion."""
ENERGY_FLOOR = 1e-8
"""Part of the energy exchanged that round-off explains, over the steps of a run and past singular positions."""
ROUND_OFF = 1e-12
"""The same of the potential itself, which may be far larger than what is exchanged: a few thousand roundings of it."""
ENERGY_TAKEN = 5e-2
"""Part of the energy exchanged that no tolerance, however loose, and no fixed step explains in silence."""
ENERGY_BROKEN = 1e-2
"""Part of the energy exchanged that breaks a run; with loose tolerances, ten times what they explain."""


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


def of_reactions(t: NDArray[np.float64], residual: NDArray[np.float64], options: Mapping[str, Any]) -> list[Finding]:
    """What Newton-Euler residuals (nt,) with the returned reactions say; NaN where a reaction has no value."""
    known = np.flatnonzero(np.isfinite(residual))
    if not len(known):
        return []
    i = int(known[np.argmax(np.abs(residual[known]))])
    worst, (doubtful, broken) = float(abs(residual[i])), NEWTON_EULER
    if options.get("correction") == "none" or options.get("formulation") == "baumgarte":
        times, least, most = DRIFT
        doubtful = min(max(times * tolerance(options), least), most)
        broken = max(broken, 10.0 * doubtful)
    broken = max(broken, 10.0 * doubtful)
    if worst <= doubtful:
        return []
    words = f"Newton-Euler with the returned reactions is off by {worst:.1e} of the largest force at t = {t[i]:.6g} s"
    return [Finding(worst > broken, float(t[i]), f"{words}; up to {doubtful:.0e} holds")]


def unnoticed(spec: Mapping[str, Any] | None, options: Mapping[str, Any]) -> float:
    """Energy [J] against which a balance is held at the least.

    That of all bodies at speeds of the absolute tolerance is below what anybody asked about; and weights that balance
    each other are added up with the round-off of each.
    """
    atol = options.get("atol")
    if spec is None or not isinstance(atol, float):
        return 0.0
    weights = (float(b["mass"]) + float(np.trace(np.array(b["inertia"], dtype=float))) for b in spec.get("bodies", ()))
    points = [b["position"] for b in spec.get("bodies", ())] + [j["point"] for j in spec.get("joints", ())]
    extent = float(np.linalg.norm(np.ptp(np.array(points, dtype=float), axis=0))) if points else 0.0
    gravity = spec.get("gravity", (0.0, 0.0, 0.0))
    pull = float(np.linalg.norm(gravity)) if np.ndim(gravity) == 1 else 0.0
    heavy = pull * extent * sum(float(b["mass"]) for b in spec.get("bodies", ()))
    return (0.5 * sum(weights) * atol * atol + ROUND_OFF * heavy) / ENERGY_FLOOR


def of_energy(
    t: NDArray[np.float64], energy: EnergyResult, rtol: float, steps: int, least: float = 0.0
) -> list[Finding]:
    """What the energy balance says, held against the energy exchanged (`least` at the least) and the tolerance of the
    run."""
    scale = max(energy.scale, least, ROUND_OFF / ENERGY_FLOOR * float(np.max(np.abs(energy.potential), initial=0.0)))
    if not len(energy.balance) or scale <= 0.0:
        return []
    off = np.abs(energy.balance) / scale
    i = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
    explained = min(max((ENERGY + steps) * rtol, ENERGY_FLOOR), ENERGY_TAKEN)
    if off[i] <= explained:
        return []
    words = f"the energy balance is off by {off[i]:.1e} of the energy exchanged at t = {t[i]:.6g} s"
    broken = bool(not off[i] <= max(ENERGY_BROKEN, 10.0 * explained))
    return [Finding(broken, float(t[i]), f"{words}; the tolerance explains {explained:.0e}")]


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
