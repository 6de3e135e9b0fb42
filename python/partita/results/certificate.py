"""The certificate of a run: how far it can be trusted, in numbers computed in that run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PartitaError
from ..notebook import lines
from ..numeric import MaybeNone
from ..result_view import ResultView
from .partition_log import switches_of
from .verdict import Finding, findings_of, of_arrays, of_energy, of_reactions, tolerance, unnoticed, verdict_of

NOTES = 12
"""Notes shown before the rest is counted."""
NOTE = 400
"""Letters of a note that are shown."""


@dataclass(frozen=True)
class Certificate:
    """Worst values of a run; closures over the ends of all its steps and over all outputs, the others over the outputs.
    `str(certificate)` is a summary in words.

    `None` stands for unknown values: a user-defined `System` has no energy and no bodies.
    """

    closure: float
    """Largest |Phi| [m or rad, mixed]."""
    velocity_closure: float
    """Largest |C v + a| [m/s or rad/s, mixed]."""
    energy_balance: float | MaybeNone
    """Largest |total - total[0] - work| over the largest energy exchanged."""
    newton_euler: float | MaybeNone
    """Largest Newton-Euler residual of any body under the returned reactions, over the largest force."""
    sigma: float
    """Smallest sigma, and its time: how near a singular position the choice came. NaN without constraints."""
    sigma_t: float
    sqrt_mu: float
    """Smallest sqrt(mu), and its time."""
    sqrt_mu_t: float
    switches: int
    """Switches of independent coordinates."""
    corrections: int
    """Steps after which closure errors were corrected."""
    notes: tuple[str, ...]
    """Everything that was dropped, switched, repaired or not found, in sentences."""
    closure_row: str | None = None
    """The constraint with the largest closure error at any output, and its time."""
    closure_t: float = float("nan")
    acceleration_closure: float | MaybeNone = None
    """Largest |C v' + b| at the outputs [m/s^2 or rad/s^2, mixed], its constraint, and its time."""
    acceleration_row: str | None = None
    acceleration_t: float = float("nan")
    worst_body: str | None = None
    """The body of the largest Newton-Euler residual, and when; `bodies` has all."""
    worst_body_t: float = float("nan")
    bodies: tuple[tuple[str, float, float], ...] = ()
    """Of each body: name, largest Newton-Euler residual over the largest force, and when."""
    rank: tuple[int, ...] = ()
    """Ranks of the constraints during the run, in order; one number if the rank never changed."""
    margin: float = float("nan")
    """Smallest squared sine between an accepted constraint and the others, and when: 0 in a singular position."""
    margin_t: float = float("nan")
    geometric_error: float = 0.0
    """Largest change of a joint frame (rad, fractions of the loop's length) by which the drawing was repaired; 0 where
    it fits. `notes` list the rest."""
    findings: tuple[Finding, ...] = ()
    """Findings against the run: whether each makes it invalid or suspect, when [s], and a sentence. One that makes it
    invalid ends its `success`, also where only this certificate looked."""

    @property
    def verdict(self) -> str:
        """ "valid", "suspect" or "invalid": that of the worst finding."""
        return verdict_of(self.findings)

    @classmethod
    def from_account(cls, reported: Mapping[str, Any]) -> Certificate:
        """The inverse of `vars(certificate)` after conversion to JSON."""
        known = {field.name for field in fields(cls)}
        own: dict[str, Any] = {
            "notes": tuple(map(str, reported["notes"])),
            "bodies": tuple((str(name), float(worst), float(t)) for name, worst, t in reported["bodies"]),
            "rank": tuple(int(rank) for rank in reported["rank"]),
            "findings": tuple(findings_of(reported["findings"])),
        }
        return cls(**{key: value for key, value in reported.items() if key in known} | own)

    def __str__(self) -> str:
        reported = [
            _line("verdict", self.verdict),
            *(f"{verdict_of([finding])}: {finding.sentence}" for finding in self.findings),
            _line("closure error", f"{_shown(self.closure)} m or rad{_who(self.closure_row, self.closure_t)}"),
            _line("velocity error", f"{_shown(self.velocity_closure)} m/s or rad/s"),
            _line(
                "accelerations",
                f"{_shown(self.acceleration_closure)}{_who(self.acceleration_row, self.acceleration_t)}",
            ),
            _line("energy balance", f"{_shown(self.energy_balance)} of the energy exchanged"),
            _line("Newton-Euler", f"{_shown(self.newton_euler)} of the largest force"
                                  f"{_who(self.worst_body, self.worst_body_t)}"),
            *(
                [_line("geometric error", f"{_shown(self.geometric_error)} (repaired within the drawing tolerance)")]
                * bool(self.geometric_error)
            ),
            *(
                [_line("loops' rank", f"{_ranks(self.rank)}; margin to losing one "
                                            f"{_placed(self.margin, self.margin_t)}")] * bool(self.rank)
            ),
            _line("coordinates", "all, since there are no constraints" if np.isnan(self.sigma) else
                  f"quality at worst: sigma {_placed(self.sigma, self.sigma_t)}, sqrt(mu) "
                  f"{_placed(self.sqrt_mu, self.sqrt_mu_t)} (1 is best, 0 singular)"),
            _line("switches", f"{self.switches} of coordinates; {self.corrections} corrected steps"),
        ]  # fmt: skip
        kept = _grouped(self.notes)
        notes = [f"note: {_cut(note)}" for note in kept[:NOTES]]
        if len(kept) > NOTES:
            notes.append(f"note: and {len(kept) - NOTES} more in certificate.notes")
        return "\n".join([*reported, *notes])

    def _repr_html_(self) -> str:
        """The same words, in a notebook."""
        return lines(str(self))


def certify(result: ResultView) -> Certificate:
    """Compute the certificate of a result; needs the reactions, O(outputs x bodies)."""
    notes = list(result.notes)
    newton_euler = None
    findings = [*result.record.findings, *result.record.arrays.findings, *of_arrays(result.t, result.q, result.v)]
    if result.record.status == "contradiction":
        findings.insert(0, Finding(True, float("nan"), result.record.message))
    if result.names.bodies:
        try:
            residual = result.at_once.reactions["residual"]
            newton_euler = _largest(residual)
            findings += of_reactions(result.t, residual, result.record.options)
        except PartitaError as error:
            notes.append(f"the reactions could not be computed: {error}")
    if result.has_energy:
        findings += of_energy(
            result.t,
            result.energy,
            tolerance(result.record.options),
            int(result.counters.get("steps", 0)),
            max(result.record.exchanged, unnoticed(result.record.description, result.record.options)),
        )
    grown: dict[str, Any] = _of_outputs(result) if result.names.bodies and len(result.t) else {}
    if newton_euler is not None:
        grown |= _of_bodies(result)
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
        switches=switches_of(result),
        corrections=result.counters.get("corrections", 0),
        notes=tuple(notes),
        **grown,
        geometric_error=result.record.geometric_error,
        findings=tuple(dict.fromkeys(findings)),
    )


def _of_outputs(result: ResultView) -> dict[str, Any]:
    """Largest closure error with its constraint and time, accelerations, rank and margin."""
    checks, names = result.at_once.checks, result.names.multipliers

    def row(key: str, i: int) -> str | None:
        number = checks[key][i]
        return names[int(number)] if np.isfinite(number) and int(number) < len(names) else None

    found: dict[str, Any] = {}
    if not len(result.closure):
        return found  # a given motion, which no constraint made
    if np.isfinite(checks["closure_row"]).any():
        i = int(np.argmax(np.abs(result.closure)))
        found |= {"closure_row": row("closure_row", i), "closure_t": float(result.t[i])}
    known = np.flatnonzero(np.isfinite(checks["acceleration_closure"]))
    if len(known):
        i = int(known[np.argmax(checks["acceleration_closure"][known])])
        found["acceleration_closure"] = float(checks["acceleration_closure"][i])
        found |= {"acceleration_row": row("acceleration_row", i), "acceleration_t": float(result.t[i])}
    ranks = checks["rank"][np.isfinite(checks["rank"])]
    if len(ranks):
        found["rank"] = tuple(int(rank) for i, rank in enumerate(ranks) if i == 0 or rank != ranks[i - 1])
        found["margin"], found["margin_t"] = _smallest(checks["margin"], result.t)
    return found


def _of_bodies(result: ResultView) -> dict[str, Any]:
    """Newton-Euler residual of each body; unknown at singular positions."""
    residuals = np.nan_to_num(np.abs(result.at_once.reactions["residuals"]), nan=0.0)
    if residuals.shape != (len(result.t), len(result.names.bodies)) or not residuals.size:
        return {}
    at = np.argmax(residuals, axis=0)
    bodies = tuple(
        (name, float(residuals[i, b]), float(result.t[i]))
        for b, (name, i) in enumerate(zip(result.names.bodies, at, strict=True))
    )
    worst = max(bodies, key=lambda body: body[1])
    return {"bodies": bodies, "worst_body": worst[0], "worst_body_t": worst[2]}


def _line(name: str, words: str) -> str:
    return f"{name:18}{words}"


def _grouped(notes: tuple[str, ...]) -> list[str]:
    """Notes in which redundant constraints are listed for one group, with the number of similar groups."""
    rows = [note for note in notes if note.startswith(("row ", "rows ")) and " removed: " in note]
    if not rows:
        return list(notes)
    rest = [note for note in notes if note not in rows and "loop-closure constraints are redundant" not in note]
    others = len(rows) - 1
    more = [f"and similarly {others} other group{'s' * (others > 1)} of joints, in certificate.notes"] * (others > 0)
    return [rows[0], *more, *rest]


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


def _who(name: str | None, t: float) -> str:
    return "" if name is None else f" ({name} at t = {t:.6g} s)"


def _ranks(ranks: tuple[int, ...]) -> str:
    shown = " -> ".join(map(str, ranks[:6]))
    return f"{shown} -> ... ({len(ranks)} in all)" if len(ranks) > 6 else shown


def _cut(note: str) -> str:
    return note if len(note) <= NOTE else f"{note[:NOTE]} ... (the rest in certificate.notes)"


def _placed(value: float, t: float) -> str:
    return "not known" if np.isnan(value) else f"{value:.2e} at t = {t:.6g} s"
