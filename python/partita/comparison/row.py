"""One line of a comparison, and the computation of its numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError, PartitaError, SingularityError
from ..numeric import MaybeNone
from ..options import TANGENTS, WHOLE
from .bench import Array, Bench
from .cases import Case

if TYPE_CHECKING:
    from ..results import Result

FINISHED, FAILED, NOT_RUN = "finished", "failed", "not run"
# Before the first step: the choice of coordinates is singular at the start; the formulation does not fit the model.
_SINGULAR, _NOT_APPLICABLE = "singular", "not applicable"
NEEDS = "needs "
"""Status of a run that lacks an option: this and the option's name."""
# Formulations whose velocities are coordinates, so that C_D is defined; and those without any choice.
_CHOOSING = ("projective", "fixed", "wehage-haug", "explicit-closing")
_RENEWING = (*TANGENTS, "tangent-space")
_NEWTON = ("wehage-haug", "explicit-closing", "tangent-space")
# Multiply-adds spent on condition numbers of one run; n^3 each. Beyond it not every output is evaluated.
_WORK = 3e8


@dataclass(frozen=True)
class Row:
    """One formulation on the common mechanism. Numbers are `None` where a run cannot know them.

    `error` is given for runs that reached the end; the other numbers of a run that stopped early apply up to there.
    """

    name: str
    formulation: str
    selection: str | None
    """Rule that chose the coordinates of "projective"; None for other formulations."""
    status: str
    """"finished", "not run", why it stopped (see `Result.status`), or why there was no first step: "singular" where the
    choice is at the start, "not applicable" to this model or these coordinates, "needs" an option, else "failed"."""
    message: str = ""
    """Why it did not run or did not reach the end; else empty."""
    evaluations: int | MaybeNone = None
    """Of accelerations, for the steps; those for dense output are left out."""
    steps: int | MaybeNone = None
    rejected: int | MaybeNone = None
    switches: int | MaybeNone = None
    """Switches of integrated coordinates; None where no coordinates are chosen to be integrated."""
    renewals: int | MaybeNone = None
    """Tangent velocities made, the first included; None where there are none."""
    dense_evaluations: int | MaybeNone = None
    """Of accelerations, for outputs inside steps."""
    newton_iterations: int | MaybeNone = None
    """In all evaluations of a form that closes the loops by Newton's method; None elsewhere."""
    proximal_iterations: int | MaybeNone = None
    """In all evaluations of "proximal"; None elsewhere."""
    corrections: int | MaybeNone = None
    """Steps after which positions were corrected."""
    closure: float | MaybeNone = None
    """Largest |Phi| over the outputs."""
    velocity_closure: float | MaybeNone = None
    """Largest |C v + a| over the outputs."""
    energy_drift: float | MaybeNone = None
    """Largest |total - total[0] - work| over the largest energy exchanged; None for a `System`."""
    error: float | MaybeNone = None
    """Largest difference from the reference: see `Comparison.caption`."""
    acceleration: float | MaybeNone = None
    """Largest difference of an acceleration at the first output from that of the reference, over the largest one there:
    all formulations have the same."""
    condition: float | MaybeNone = None
    """Largest condition number of C_D, the dependent columns of the constraint Jacobian, over the outputs; in the
    units of the coordinates. None where no coordinates are dependent."""
    sigma: float | MaybeNone = None
    """Smallest sigma of the choice; None where nothing is chosen."""
    sqrt_mu: float | MaybeNone = None
    """Smallest sqrt(mu) of the choice, or of the tangent velocities; None where nothing is chosen."""
    time_per_evaluation: float | MaybeNone = None
    """Of one evaluation alone [s]: timed at states along the motion, all formulations in turn; see `Comparison`."""
    time_without_outputs: float | MaybeNone = None
    """Of the whole run with one output, at its end [s]."""
    time: float | MaybeNone = None
    """Of the whole run: set-up, steps, outputs [s]; the shortest of several where it is short."""

    @property
    def finished(self) -> bool:
        """Whether the run reached its end."""
        return self.status == FINISHED


def not_run(case: Case, why: str, status: str = NOT_RUN) -> Row:
    """The line of a run that did not take place."""
    return Row(case.name, case.formulation, case.selection, status, why)


def refused(case: Case, error: PartitaError) -> Row:
    """The line of a run that met an error before its first step."""
    status = FAILED
    if isinstance(error, SingularityError):
        status = _SINGULAR
    elif isinstance(error, ArgumentError) and error.argument in ("formulation", "coordinates"):
        status = _NOT_APPLICABLE
    return not_run(case, str(error), status)


def lacking(case: Case) -> Row:
    """The line of a run that lacks an option."""
    return not_run(case, case.missing, f"{NEEDS}{case.needs}")


def measured(case: Case, bench: Bench, result: Result, time: float, bare: float | None) -> Row:
    """The line of a run that took place, to its end or not; the cost of one evaluation is not known yet."""
    counters = result.counters
    return Row(
        name=case.name,
        formulation=case.formulation,
        selection=case.selection,
        status=FINISHED if result.success else result.status,
        message="" if result.success else result.message,
        evaluations=counters.get("evaluations"),
        steps=counters.get("steps"),
        rejected=counters.get("rejected"),
        switches=counters.get("switches") if case.formulation in _CHOOSING else None,
        renewals=counters.get("renewals") if case.formulation in _RENEWING else None,
        dense_evaluations=counters.get("dense_evaluations"),
        newton_iterations=counters.get("newton_iterations") if case.formulation in _NEWTON else None,
        proximal_iterations=counters.get("proximal_iterations") if case.formulation == "proximal" else None,
        corrections=counters.get("corrections"),
        closure=_largest(result.closure),
        velocity_closure=_largest(result.velocity_closure),
        energy_drift=result.energy.relative_balance if result.has_energy and len(result.t) else None,
        error=bench.error(result),
        acceleration=bench.acceleration(result),
        condition=_condition(bench, result) if case.formulation in _CHOOSING else None,
        sigma=None if case.formulation in WHOLE else _smallest(result.sigma),
        sqrt_mu=None if case.formulation in WHOLE else _smallest(result.sqrt_mu),
        time_without_outputs=bare,
        time=time,
    )


def _condition(bench: Bench, result: Result) -> float | None:
    """Worst condition number of C_D over the outputs, or over as many evenly spread ones as `_WORK` allows."""
    nt, n = result.v.shape
    k = result.independent.shape[1]
    if nt == 0 or k == 0 or k == n or np.any(result.independent < 0):
        return None
    stride = max(1, int(np.ceil(nt * n**3 / _WORK)))
    worst = 0.0
    for row in range(0, nt, stride):
        jacobian = bench.equations.jacobian(result.q[row], t=float(result.t[row]))
        block = np.delete(jacobian, result.independent[row], axis=1)
        worst = max(worst, float(np.linalg.cond(block)))
    return worst


def _largest(values: Array) -> float | None:
    return float(np.max(np.abs(values))) if len(values) else None


def _smallest(values: Array) -> float | None:
    """Smallest finite value; None where there is none."""
    finite = values[np.isfinite(values)]
    return float(np.min(finite)) if len(finite) else None
