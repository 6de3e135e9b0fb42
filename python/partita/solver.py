"""What only comparisons need: the formulation that is integrated, and the rule that chooses coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, fields
from typing import Any

from .errors import ArgumentError
from .numeric import shown
from .tangent import TangentVelocities
from .units import Quantity


@dataclass(frozen=True)
class Solver:
    """How the equations of motion are reduced and integrated. Nothing of it needs choosing: the default is the best one
    known. Prefer another to compare methods, or to reproduce a paper.

    Attributes:
        formulation: "projective" (equations without reactions in independent coordinates; the default and the fastest),
            or, for comparison: "fixed" (the same without switches of coordinates), "wehage-haug" (2k states, dependent
            coordinates by Newton's method at every stage), "explicit-closing" (2k states, the loops closed by inverse
            kinematics), "zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt" (frozen tangent velocities,
            renewed when their quality has fallen), "tangent-space" (2k states in a tangent chart), "user-tangent"
            (user-defined velocities, needs `tangent`), "multipliers" (all accelerations and multipliers from one
            matrix), "sparse-multipliers" (the same with sparse elimination), "range-space" (the same by eliminating the
            accelerations first), "proximal" (the same with regularisation; loads are shared among redundant rows),
            "baumgarte" (stabilised, closed only approximately; needs `baumgarte`).
        selection: the rule that chooses the independent coordinates of "projective": "collective" (the projective
            criterion, one coordinate after the other, then exchanges), "greedy" (without exchanges),
            "normalised-determinant", "persistence" (the largest minimum volume over `window`), "geometric" (as
            "greedy", but by displacements only), and, for comparison, "individual", "determinant" and
            "complete-pivoting".
        weights: velocity name -> factor on its measure, to express preferences; 1 for those not named.
        window: time over which "persistence" looks back [s].
        renew: frozen tangent velocities are renewed when sqrt_mu has fallen to this fraction of its value when they
            were frozen, 0 to 1; 0: never; "each step": after every step, whatever their quality. `counters["renewals"]`
            counts the renewals.
        tangent: `TangentVelocities` for "user-tangent".
        baumgarte: (alpha, beta) [1/s] of the formulation "baumgarte"; there is no default, because no value suits all
            mechanisms.

    What it holds is checked by the run that uses it, which knows the names: `ArgumentError`, `UnknownNameError`.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> run = m.simulate(0.1, solver=pt.Solver("svd", renew="each step"))
    >>> run.success, run.options["formulation"]
    (True, 'svd')
    """

    formulation: str = "projective"
    _: KW_ONLY
    selection: str = "collective"
    weights: Mapping[str, float] | None = None
    window: Quantity | None = None
    renew: float | str = 0.5
    tangent: TangentVelocities | None = None
    baumgarte: tuple[float, float] | None = None


DEFAULT = Solver()
OPTIONS = tuple(field.name for field in fields(Solver))
"""Names of what a solver holds."""


def checked(solver: Any) -> Solver:
    """The solver that is asked for; None: the default."""
    if solver is None:
        return DEFAULT
    if not isinstance(solver, Solver):
        word = shown(solver) if isinstance(solver, str) else '"svd"'
        raise ArgumentError(f"solver must be a pt.Solver({word}), not {shown(solver)}", argument="solver")
    return solver


def grouped(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options by name, as those of a run: what a solver holds is in its `solver`."""
    own = {name: value for name, value in options.items() if name in OPTIONS}
    others = {name: value for name, value in options.items() if name not in OPTIONS}
    return {**others, "solver": Solver(**own)} if own else others
