"""The certificate of a run: how far it can be trusted, in numbers computed in that run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import PartitaError
from ..readable import Readable
from .verdict import Finding, allowed, of_arrays, of_energy, of_reactions, word_of


@dataclass(frozen=True)
class Certificate:
    """Worst values of a run; closures over the ends of all its steps and over all outputs, the others over the outputs.
    `str(certificate)` says them in words.

    `None` stands for what the run cannot know: a hand-written `System` has no energy and no bodies.
    """

    closure: float
    """Largest |Phi| [m or rad, mixed]."""
    velocity_closure: float
    """Largest |C v + a| [m/s or rad/s, mixed]."""
    energy_balance: float | None
    """Largest |total - total[0] - work| over the largest energy exchanged."""
    newton_euler: float | None
    """Largest Newton-Euler residual of any body under the returned reactions, over the largest force."""
    sigma: float
    """Smallest sigma, and where: how near a singular position the choice came. NaN without constraints."""
    sigma_t: float
    sqrt_mu: float
    """Smallest sqrt(mu), and where."""
    sqrt_mu_t: float
    switches: int
    """Exchanges of independent coordinates."""
    corrections: int
    """Steps after which the remainder of the closure was removed."""
    notes: tuple[str, ...]
    """All that was dropped, switched, repaired or not found, in sentences."""
    misfit: float = 0.0
    """Largest part of its size (of a radian, of the length of its loop) by which a closing stood open that the drawing
    tolerance bridges; 0 where the drawing fits. `notes` say what does not."""
    findings: tuple[Finding, ...] = ()
    """What stands against the run: broken or doubtful, when [s], and a sentence."""

    @property
    def verdict(self) -> str:
        """ "holds", "doubtful" or "broken": that of the worst finding."""
        return word_of(self.findings)

    def __str__(self) -> str:
        lines = [
            f"verdict           {self.verdict}",
            *(f"{word_of([finding])}: {finding.sentence}" for finding in self.findings),
            f"closure           {_shown(self.closure)}",
            f"velocity closure  {_shown(self.velocity_closure)}",
            f"energy balance    {_shown(self.energy_balance)}  (relative to the energy exchanged)",
            f"Newton-Euler      {_shown(self.newton_euler)}  (residual over the largest force)",
            f"smallest sigma    {_placed(self.sigma, self.sigma_t)}",
            f"smallest sqrt(mu) {_placed(self.sqrt_mu, self.sqrt_mu_t)}",
            *([f"drawing misfit    {_shown(self.misfit)}  (bridged by the drawing tolerance)"] if self.misfit else []),
            f"switches          {self.switches}",
            f"corrections       {self.corrections}",
        ]
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def certify(result: Readable) -> Certificate:
    """Gather the certificate of a result; asks for the reactions, O(outputs x bodies)."""
    notes = list(result.notes)
    newton_euler = None
    findings = [*result.record.findings, *result.record.arrays.findings, *of_arrays(result.t, result.q, result.v)]
    if result.record.status == "contradiction":
        findings.insert(0, Finding(True, float("nan"), result.record.message))
    if result.names.bodies:
        try:
            residual = result.reactions["residual"]
            newton_euler = _largest(residual)
            findings += of_reactions(result.t, residual, result.record.options, result.record.misfit)
        except PartitaError as error:
            notes.append(f"the reactions could not be computed: {error}")
    if result.has_energy:
        findings += of_energy(
            result.t,
            result.energy,
            allowed(result.record.options, result.record.misfit),
            int(result.counters.get("steps", 0)),
        )
    sigma, sigma_t = _smallest(result.sigma, result.t)
    sqrt_mu, sqrt_mu_t = _smallest(result.sqrt_mu, result.t)
    return Certificate(
        closure=max(_largest(result.closure), result.record.steps_open[0]),
        velocity_closure=max(_largest(result.velocity_closure), result.record.steps_open[1]),
        energy_balance=result.energy.relative_balance if result.has_energy else None,
        newton_euler=newton_euler,
        sigma=sigma,
        sigma_t=sigma_t,
        sqrt_mu=sqrt_mu,
        sqrt_mu_t=sqrt_mu_t,
        switches=sum(change.is_switch for change in result.partitions),
        corrections=result.counters.get("corrections", 0),
        notes=tuple(notes),
        misfit=result.record.misfit,
        findings=tuple(dict.fromkeys(findings)),
    )


def _largest(values: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _smallest(values: NDArray[np.float64], t: NDArray[np.float64]) -> tuple[float, float]:
    """Smallest finite value and its time; NaN when there is none (a system without constraints)."""
    if len(values) != len(t) or not np.any(np.isfinite(values)):
        return float("nan"), float("nan")
    i = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
    return float(values[i]), float(t[i])


def _shown(value: float | None) -> str:
    return "not known" if value is None else f"{value:.2e}"


def _placed(value: float, t: float) -> str:
    return "none (no constraints)" if np.isnan(value) else f"{value:.2e} at t = {t:.6g} s"
