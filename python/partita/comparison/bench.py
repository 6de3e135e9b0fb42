"""Input of a comparison: one mechanism or system, its start, its outputs, and the reference run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import PartitaError
from ..options import SELECTIONS
from ..solver import Solver, grouped
from .cases import DEFAULT, Case

if TYPE_CHECKING:
    from ..builder.compiled import Equations
    from ..results import Result

Array = NDArray[np.float64]
Simulate = Callable[..., "Result"]
OUTPUTS = 101
REFERENCE_METHOD = "dop853"
_REPEATS = 5  # runs of one case at most
_ENOUGH = 0.1
"""After this time no other run of a case begins. Scale: s on the clock. Reason: long runs scatter little."""
# A run that takes this many times the steps of the tight reference approaches a point it cannot pass. With the same
# method a coarser tolerance needs fewer steps; order 4 at 1e-10 needs up to twenty times those of order 8 at 1e-13.
_CREEPING, _CREEPING_OTHERS, _LEAST_STEPS = 10, 50, 2000
_REFERENCE_STEPS = 200_000  # a reference that needs more gives way to a coarser one
# From the tightest above round-off to one that suffices as a reference of coarse runs only.
_TIGHT = ((1e-13, 1e-14), (1e-12, 1e-13), (1e-11, 1e-12), (1e-10, 1e-11))


@dataclass(frozen=True)
class Reference:
    """The reference run, and its description."""

    result: Result | None
    words: str


@dataclass(frozen=True)
class Bench:
    """`simulate(**options)` runs it from its start over its duration; `equations` are those it integrates."""

    title: str
    simulate: Simulate
    equations: Equations
    t_eval: Array
    duration: float
    rtol: float
    atol: float
    method: str
    max_steps: int | None = None
    tangent: Any = None
    """The user's tangent velocities, checked, for the core."""
    reference: Reference | None = None

    def run(self, case: Case, progress: Any, rtol: float | None = None, *, bare: bool = False) -> tuple[Result, float]:
        """The result of one case and the time it took [s]: set-up, steps and outputs. `rtol` takes atol along; `bare`
        leaves one output, at the end.

        The same run takes longer at times, when the machine is busy: short ones are repeated, and the shortest time
        counts.
        """
        options = grouped(
            {
                "t_eval": self.t_eval[-1:] if bare else self.t_eval,
                "rtol": self.rtol if rtol is None else rtol,
                "atol": self.atol if rtol is None else self.atol * rtol / self.rtol,
                "method": self.method,
                "max_steps": self._most_steps(),
                "formulation": case.formulation,
                "progress": progress,
                # formulations are compared by the same kind of evaluations
                "compiled": False,
                **case.options,
            }
        )
        times: list[float] = []
        while True:
            began = perf_counter()
            result = self.simulate(**options)
            times.append(perf_counter() - began)
            if len(times) == _REPEATS or sum(times) > _ENOUGH or not result.success:
                return result, min(times)

    def costs(self, results: Sequence[Result], dearest: float) -> list[float | None]:
        """Seconds of one evaluation for each of the runs, at states of the first; None where none could be taken. If
        the `dearest` takes long [s], one state is used."""
        first = results[0]
        sound = np.flatnonzero(np.all(np.isfinite(first.vdot), axis=1))
        rows = sound[np.unique((len(sound) * _PLACES).astype(int))] if len(sound) else sound
        if dearest > _DEAR and len(rows) > 1:
            rows = rows[len(rows) // 2 :][:1]
        steps = [float(x.t[-1] - x.t[0]) / max(1, x.counters.get("steps", 1)) for x in results]
        taken = self.equations.evaluation_costs(
            [x.options for x in results], steps, first.t[rows], first.q[rows], first.v[rows], self.tangent
        )
        return [None if np.isnan(x) else x for x in taken]

    def _most_steps(self) -> int:
        """Steps after which a run is stopped: as given, else by those of the reference."""
        if self.max_steps is not None:
            return self.max_steps
        found = self.reference.result if self.reference is not None else None
        factor = _CREEPING if self.method == REFERENCE_METHOD else _CREEPING_OTHERS
        return max(_LEAST_STEPS, factor * (found.counters.get("steps", 0) if found is not None else 0))

    def with_reference(self, given: Result | None, progress: Any) -> Bench:
        """With the reference run: `given`, or the tightest of "projective" that finishes."""
        if given is not None:
            options = ", ".join(
                f"{key} {given.options[key]}" for key in _REPORTED if given.options.get(key) is not None
            )
            return replace(self, reference=Reference(given, f"the run given ({options or 'options not known'})"))
        why = ""
        for rtol, atol in _TIGHT:
            atol = min(atol, self.atol)
            try:
                result = self.simulate(
                    t_eval=self.t_eval,
                    rtol=rtol,
                    atol=atol,
                    method=REFERENCE_METHOD,
                    max_steps=_REFERENCE_STEPS,
                    solver=Solver(DEFAULT, selection=SELECTIONS[0]),
                    progress=progress,
                )
            except PartitaError as error:
                why = str(error)
                continue
            if result.success:
                words = f"{DEFAULT}, {REFERENCE_METHOD}, rtol {rtol:g}, atol {atol:g}"
                return replace(self, reference=Reference(result, words))
            why = result.message
        return replace(self, reference=Reference(None, f"none, since no tight run finished ({why})"))

    def error(self, result: Result) -> float | None:
        """Largest difference from the reference over all outputs: [m] of bodies, or that of q for a `System`.

        A body counts with its origin and with the tips of its three axes drawn as long as the mechanism is large
        (`size`), so that turns count as well.
        """
        if self.reference is None or self.reference.result is None or not result.success:
            return None
        expected = self.reference.result
        if not result.is_mechanism:
            return float(np.max(np.abs(result.q - expected.q), initial=0.0))
        gap = _frames(result, self.size) - _frames(expected, self.size)
        return float(np.sqrt(np.max(np.sum(gap**2, axis=-1), initial=0.0)))

    def acceleration(self, result: Result) -> float | None:
        """Largest difference of v' at the first output from that of the reference, over the largest of all v' there."""
        if self.reference is None or self.reference.result is None or not len(result.t):
            return None
        expected, found = self.reference.result.vdot[0], result.vdot[0]
        if not (np.isfinite(expected).all() and np.isfinite(found).all()):
            return None
        size, gap = float(np.max(np.abs(expected), initial=0.0)), float(np.max(np.abs(found - expected), initial=0.0))
        return gap / size if size > 0.0 else gap

    @property
    def unit(self) -> str:
        """Of the errors: [m] of bodies; empty for coordinates of a `System`, or without a reference."""
        found = self.reference.result if self.reference is not None else None
        return "m" if found is not None and found.is_mechanism else ""

    @property
    def size(self) -> float:
        """Largest distance of a body or a joint from their middle at the start of the reference [m]; 1 if they are all
        in one point."""
        if self.reference is None or self.reference.result is None or not self.reference.result.is_mechanism:
            return 1.0
        seen = self.reference.result.at_once.observed
        points = np.concatenate([seen["body_position"][0], seen["joint_point"][0]])
        far = float(np.max(np.linalg.norm(points - points.mean(axis=0), axis=1)))
        return far if far > 0.0 else 1.0


_PLACES = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
"""Times along a run at which evaluations are timed, as fractions of it."""
_DEAR = 2e-3
"""Where an evaluation takes longer one state is enough. Scale: s. Reason: longer than the clock scatters."""
_REPORTED = ("formulation", "method", "rtol", "atol")


def _frames(result: Result, size: float) -> Array:
    """Origins of all bodies and tips of their axes (nt, bodies, 4, 3)."""
    seen: Mapping[str, Array] = result.at_once.observed
    origin = seen["body_position"][:, :, None, :]
    tips = np.swapaxes(seen["body_rotation"], -1, -2)
    return np.concatenate([origin, origin + size * tips], axis=2)
