"""The choice of independent coordinates by the projective criterion, for any mass matrix and constraint
Jacobian.

A mechanism chooses by itself; these functions are for studying the criterion and for user-defined systems.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from operator import index

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .errors import ArgumentError
from .numeric import floats, shown
from .options import positive

__all__ = ["Geometry", "Partition", "choose", "geometry", "measure"]

Array = NDArray[np.float64]
# Rules that need one instant only.
SELECTIONS = tuple(rule for rule in _core.SELECTIONS if rule != "persistence")
# Those that compare the measure, in scales that can be chosen.
_MEASURING = ("collective", "greedy", "normalised-determinant", "individual")
_SYMMETRY = 1e-10
"""A mass matrix that is less symmetric is wrong. Scale: fraction of its largest entry. Reason: entries computed in
two ways agree to rounding; a larger difference is an error in the formulas."""


@dataclass(frozen=True, eq=False)
class Partition:
    """A choice of k independent coordinates among n. With n velocities, m rows, rank r, k = n - r.

    Attributes:
        independent: indices (k,).
        dependent: indices (n - k,).
        A: v_D = A v_I + eta, (n - k, k), rows in the order of `dependent`, columns in that of `independent`.
        D: (k, n) with D C^T = 0 and v = D^T v_I + [0; eta]; columns in the order of the coordinates.
        rho: projective measure of every coordinate (n,), 0 to 1.
        sigma: smallest singular value of the normalised chosen coordinate directions, projected onto the possible
            motions: 1 best, 0 singular. It bounds the condition number of the reduced equations. For the best choice it
            may be as small as 1 / sqrt(1 + k m), but no smaller if M is diagonal.
        sqrt_mu: smallest principal cosine between the chosen directions and the possible motions: 1 best, 0
            singular. Its inverse bounds the amplification of constraint errors in the dependent coordinates.
        rows: indices (r,) of the constraint rows that were kept.
    """

    independent: NDArray[np.int64]
    dependent: NDArray[np.int64]
    A: Array
    D: Array
    rho: Array
    sigma: float
    sqrt_mu: float
    rows: NDArray[np.int64]


def measure(M: ArrayLike, C: ArrayLike, *, scales: str | ArrayLike = "inertia") -> Array:
    """Projective measure rho (n,) of every coordinate (P4).

    The mobility of a coordinate with the constraints, relative to that without: 1 = not restricted, 0 = locked.
    Computed in the mass metric, so it is the same in all units. Redundant rows do no harm. Costs O(n^3).

    Args:
        M: mass matrix (n, n), symmetric and positive definite.
        C: constraint Jacobian (m, n); m may be zero.
        scales: lengths s_i by which the length of k_i along the possible motions is divided:

            * "inertia": its whole length, sqrt of [M^-1]_ii: the projective measure.
            * "diagonal": 1 / sqrt(M_ii), which needs no inverse. The values may exceed 1; for a diagonal M both agree.
            * positive numbers (n,), in the units of the velocities: displacements, such as 1 for lengths and the
              inverse of a length for angles, or tolerances of an integrator.

            The ranking of the coordinates depends on them, but not on units as long as they change with the units.

    Raises:
        ArgumentError: wrong shapes, NaN, or M not symmetric and positive definite.

    >>> import partita as pt
    >>> pt.partition.measure([[1.0, 0.0], [0.0, 1.0]], [[3.0, 4.0]]).round(12).tolist()
    [0.8, 0.6]
    >>> pt.partition.measure([[1.0, 0.0], [0.0, 1.0]], [[3.0, 4.0]], scales=[1.0, 0.5]).round(12).tolist()
    [0.8, 1.2]
    """
    mass, jacobian = _checked(M, C)
    rho = _core.measure(mass, jacobian)
    factors = _scales(scales, mass)
    return rho if factors is None else rho * factors


def choose(
    M: ArrayLike,
    C: ArrayLike,
    *,
    selection: str = "collective",
    threshold: float = 1.0,
    weights: ArrayLike | None = None,
    scales: str | ArrayLike = "inertia",
    fixed: Iterable[int] | None = None,
) -> Partition:
    """Choose independent coordinates by a rule, at one instant.

    Args:
        M: mass matrix (n, n), symmetric and positive definite.
        C: constraint Jacobian (m, n).
        selection: the rule. Independent of units:

            * "collective": greedily by the measure (P5), then by exchanges (P6). Recommended.
            * "greedy": by the measure, each choice locked before the next (P5), without exchanges.
            * "normalised-determinant": largest volume of the choice. Up to 50 000 partitions all of them are compared
              (a few milliseconds); beyond, the result cannot be improved by a single exchange.
            * "individual": the k largest measures, each judged separately; with k > 1 they may not be independent
              together.
            * "geometric": as "greedy", with displacements relative to a characteristic one instead of the coordinate's
              inertia. For plain matrices the characteristic displacement is 1, so the result depends on units here;
              mechanisms and systems have their own.

            For comparison, dependent on units:

            * "determinant": largest determinant of C_D, searched as above.
            * "complete-pivoting": Gaussian elimination with complete pivoting; the columns of the pivots are dependent.
        threshold: for "collective": a dependent coordinate replaces an independent one when this multiplies the
            volume of the choice by more than `threshold`; at least 1. With 1, no single exchange can improve the
            result.
        weights: positive factors (n,) on the measures, to express preferences; None: all equal. Not for "determinant"
            and "complete-pivoting", which do not use the measure.
        scales: of the measure by which "collective", "greedy", "normalised-determinant" and "individual" choose, as in
            `measure`. rho, sigma and sqrt_mu of the result are those of "inertia" in any case.
        fixed: the k independent coordinates themselves, by index, instead of a rule.

    Raises:
        ArgumentError: wrong shapes, NaN, M not symmetric and positive definite, threshold below 1, options that
            contradict each other, `fixed` coordinates that cannot be independent.
        SingularityError: the rule chooses coordinates that cannot be independent; the message names them.

    >>> import partita as pt
    >>> choice = pt.partition.choose([[1.0, 0.0], [0.0, 1.0]], [[3.0, 4.0]])
    >>> choice.independent.tolist(), choice.A.tolist()
    ([0], [[-0.75]])
    >>> pt.partition.choose([[1.0, 0.0], [0.0, 1.0]], [[3.0, 4.0]], fixed=[1]).independent.tolist()
    [1]

    Centimetres for the second coordinate turn the determinant over, and nothing else:

    >>> M, C = [[1.0, 0.0], [0.0, 1e-4]], [[3.0, 0.04]]
    >>> rules = ["collective", "determinant", "complete-pivoting"]
    >>> [pt.partition.choose(M, C, selection=rule).independent.tolist() for rule in rules]
    [[0], [1], [1]]
    """
    mass, jacobian = _checked(M, C)
    limit = positive("threshold", threshold)
    if limit < 1.0:
        raise ArgumentError(
            f"threshold is {limit:g}; below 1 two choices would alternate forever",
            argument="threshold",
        )
    if not isinstance(selection, str) or selection not in SELECTIONS:
        persists = isinstance(selection, str) and selection == "persistence"
        more = "; persistence needs a history, so it is available for runs only" if persists else ""
        raise ArgumentError(
            f"there is no selection {shown(selection)} for one instant; choose among {', '.join(SELECTIONS)}{more}",
            argument="selection",
        )
    if limit > 1.0 and selection != "collective":
        raise ArgumentError(
            f'threshold has no meaning for selection "{selection}", which makes no switches; leave it out',
            argument="threshold",
        )
    preference = None if weights is None else _positive("weights", weights, mass.shape[0])
    if preference is not None and selection in ("determinant", "complete-pivoting"):
        raise ArgumentError(
            f'selection "{selection}" measures no coordinates and has no use for weights; leave them out',
            argument="weights",
        )
    factors = _scales(scales, mass)
    if factors is not None:
        if selection not in _MEASURING:
            raise ArgumentError(
                f'selection "{selection}" does not divide by scales; leave them out, or choose among '
                f"{', '.join(_MEASURING)}",
                argument="scales",
            )
        preference = factors if preference is None else factors * preference
    own = None if fixed is None else _fixed("fixed", fixed, mass.shape[0])
    if own is not None and (selection != "collective" or preference is not None):
        raise ArgumentError(
            "fixed names the independent coordinates, so no rule, weights or scales choose any; give one or the other",
            argument="fixed",
        )
    found = _core.choose(mass, jacobian, limit, preference, selection, own)
    return Partition(
        independent=np.asarray(found["independent"], dtype=np.int64),
        dependent=np.asarray(found["dependent"], dtype=np.int64),
        A=np.asarray(found["A"], dtype=np.float64),
        D=np.asarray(found["D"], dtype=np.float64),
        rho=np.asarray(found["rho"], dtype=np.float64),
        sigma=float(found["sigma"]),
        sqrt_mu=float(found["sqrt_mu"]),
        rows=np.asarray(found["rows"], dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class Geometry:
    """Metric geometry of n coordinates with the mass matrix as metric, under r independent constraint rows; k = n - r.

    k_i is the gradient of coordinate i: q'_i = q' . k_i. Its parts normal and tangential to the possible motions are
    orthogonal in the mass metric, so k^2 = k_constrained^2 + k_tangential^2, and rho = k_tangential / k.

    Attributes:
        k: lengths |k_i| (n,): square roots of the diagonal of M^-1. (19)
        k_constrained: lengths of the components normal to the possible motions (n,). (20)
        k_tangential: lengths of the components along them (n,). (21)
        P_c, P_d: projectors (n, n) of velocities onto the constrained directions and onto the possible motions; P_c +
            P_d = 1. Their transposes act on forces.
        M_c: metric of the constrained space, C M^-1 C^T (r, r). (15)
        M_d: metric of the tangent space, D M D^T (k, k): the reduced mass matrix. (13)
        T_cd: (n, n), the rows of C M^-1, then those of D: T_cd M T_cd^T is block-diagonal in M_c and M_d. (11), (15)
        S: (k, n), what is integrated: u = S v. Rows of the identity for independent coordinates. D belongs to it, S D^T
            = 1; lengths and projectors do not depend on it. (36)
        M_s: S M^-1 S^T (k, k): products of the directions that S chooses, covectors.
        sqrt_mu: smallest principal cosine between these directions and the possible motions, as in `Partition`; 1 where
            no velocity is independent. (27)
        independent, dependent: the choice; None where S was given, whose rows may combine all coordinates.
        rows: indices (r,) of the independent constraint rows; the others are redundant.

        M, C: as given (n, n), (m, n).

    Its properties judge the choice, or S, as a whole. They belong to it and to the space of the possible motions: with
    another basis of that space in place of D they are the same. Of several S that span one space, `sqrt_mu` and
    `cosine_product` are the same; `stretches`, `volume`, `sigma` and `condition` belong to its rows.
    """

    k: Array
    k_constrained: Array
    k_tangential: Array
    P_c: Array
    P_d: Array
    M_c: Array
    M_d: Array
    T_cd: Array
    S: Array
    M_s: Array
    sqrt_mu: float
    independent: NDArray[np.int64] | None
    dependent: NDArray[np.int64] | None
    rows: NDArray[np.int64]
    M: Array
    C: Array

    @property
    def D(self) -> Array:
        """(k, n): basis of the possible motions that belongs to S: v = D^T u where nothing is prescribed; the identity
        in the columns of independent coordinates. (9), (36)"""
        return self.T_cd[len(self.rows) :]

    @property
    def stretches(self) -> Array:
        """(k,): singular values, from the largest down, of the chosen directions, the rows of S, normalised and
        projected onto the possible motions: for a choice those of block I of B = L^-1 D diag(1/k) with L L^T = M_d.
        (25) The last one is sigma. (26)"""
        return 1.0 / np.sqrt(np.linalg.eigvalsh(self._natural))

    @property
    def volume(self) -> float:
        """Volume that these directions span, the product of `stretches`: 1 best, 0 singular. With one degree of freedom
        it equals rho of the chosen coordinate. Exchanging coordinate i for j multiplies it by |A_ji| k_i / k_j. (28)"""
        return float(np.exp(-0.5 * np.linalg.slogdet(self._natural)[1]))

    @property
    def sigma(self) -> float:
        """Smallest of `stretches`, as in `Partition`; 1 where no velocity is independent. (26)"""
        return float(np.min(self.stretches, initial=1.0))

    @property
    def cosine_product(self) -> float:
        """Product of all these cosines, 1 / sqrt(det M_d det(S M^-1 S^T)): between sqrt_mu^k and sqrt_mu. For a choice
        |det C_D| / sqrt(det M_c det M_DD). (29)"""
        units = 1.0 / np.sqrt(np.diag(self.M_s))
        logs = [float(np.linalg.slogdet(matrix)[1]) for matrix in (self._natural, self.M_s * np.outer(units, units))]
        return float(np.exp(-0.5 * sum(logs)))

    @property
    def condition(self) -> float:
        """Condition number of M_d in natural units: for independent velocities 1/k, for u those of S M^-1 S^T. (30)"""
        return float((np.max(self.stretches, initial=self.sigma) / self.sigma) ** 2)

    @property
    def condition_bound(self) -> float:
        """k / sigma^2, which `condition` does not exceed. (30)"""
        return max(1, len(self.S)) / self.sigma**2

    @property
    def _natural(self) -> Array:
        """M_d in natural units: its inverse is the product of block I of B with itself."""
        units = np.sqrt(np.diag(self.M_s))
        return self.M_d * units * units[:, None]


def geometry(
    M: ArrayLike,
    C: ArrayLike,
    independent: Iterable[int] | None = None,
    *,
    selector: ArrayLike | None = None,
) -> Geometry:
    """The metric geometry behind the measure: lengths, metrics and projectors. Dense, O(n^3).

    Args:
        M: mass matrix (n, n), symmetric and positive definite.
        C: constraint Jacobian (m, n). Of dependent rows only independent ones are used: `rows`.
        independent: the k independent coordinates by index, to which D, M_d and T_cd refer; None: as `choose` does.
        selector: S (k, n) of tangent velocities u = S v instead, such as one of `Result.selector`.

    Raises:
        ArgumentError: wrong shapes, NaN, M not symmetric and positive definite, coordinates that cannot be independent,
            an S whose rows depend on each other or on those of C, `independent` and `selector` both given.

    >>> import partita as pt
    >>> g = pt.partition.geometry([[2.0, 0.0], [0.0, 2.0]], [[3.0, 4.0]])
    >>> (g.k_tangential / g.k).round(12).tolist()      # rho
    [0.8, 0.6]
    >>> abs(g.k_constrained**2 + g.k_tangential**2 - g.k**2).round(12).tolist()
    [0.0, 0.0]
    >>> g.P_d.round(12).tolist()
    [[0.64, -0.48], [-0.48, 0.36]]
    >>> round(g.volume, 12), round(g.cosine_product, 12)      # k = 1: both are rho of the choice
    (0.8, 0.8)
    >>> g = pt.partition.geometry([[2.0, 0.0], [0.0, 2.0]], [[3.0, 4.0]], selector=[[4.0, -3.0]])
    >>> round(g.volume, 12), g.D.round(12).tolist()                 # along the motion itself
    (1.0, [[0.16, -0.12]])
    """
    mass, jacobian = _checked(M, C)
    n = mass.shape[0]
    if selector is not None:
        if independent is not None:
            raise ArgumentError(
                "independent coordinates and a selector were both given; each determines D, so give one of them",
                argument="selector",
            )
        chosen = _matrix("selector", selector)
        found = _core.geometry(mass, jacobian, None, chosen)
        return Geometry(**found, S=chosen, independent=None, dependent=None, M=mass, C=jacobian)
    own = None if independent is None else _fixed("independent", independent, n)
    found = _core.geometry(mass, jacobian, own)
    return Geometry(**found, S=np.eye(n)[found["independent"]], M=mass, C=jacobian)


def _checked(M: ArrayLike, C: ArrayLike) -> tuple[Array, Array]:
    """Both as finite arrays that fit together."""
    mass, jacobian = _matrix("M", M), _matrix("C", C)
    n = mass.shape[0]
    if mass.shape != (n, n) or n == 0:
        raise ArgumentError(f"M must be square, not of shape {mass.shape}", argument="M")
    if jacobian.shape[1] != n:
        raise ArgumentError(
            f"C has {jacobian.shape[1]} columns for {n} coordinates; it must be of shape (m, {n})",
            argument="C",
        )
    skew = float(np.max(np.abs(mass - mass.T)))
    if skew > _SYMMETRY * float(np.max(np.abs(mass))):
        row, column = np.unravel_index(int(np.argmax(np.abs(mass - mass.T))), mass.shape)
        raise ArgumentError(
            f"M is not symmetric: M[{row}, {column}] and M[{column}, {row}] differ by {skew:.3g}",
            argument="M",
        )
    return mass, jacobian


def _matrix(what: str, values: ArrayLike) -> Array:
    try:
        array = floats(values)
    except TypeError as error:
        raise ArgumentError(f"{what} must be a matrix of numbers, not {shown(values)}", argument=what) from error
    if array.ndim != 2:
        raise ArgumentError(f"{what} must be a matrix, not of shape {array.shape}", argument=what)
    if not np.all(np.isfinite(array)):
        row, column = np.argwhere(~np.isfinite(array))[0]
        raise ArgumentError(f"{what}[{row}, {column}] is {array[row, column]}; give finite numbers", argument=what)
    return array


def _scales(scales: str | ArrayLike, mass: Array) -> Array | None:
    """(n,): by what the measure is multiplied in these scales; None: by nothing."""
    if isinstance(scales, str) and scales not in ("inertia", "diagonal"):
        raise ArgumentError(
            f'scales must be "inertia", "diagonal" or {mass.shape[0]} positive numbers, not {shown(scales)}',
            argument="scales",
        )
    if isinstance(scales, str) and scales == "inertia":
        return None
    own = 1.0 / np.sqrt(np.diag(mass)) if isinstance(scales, str) else _positive("scales", scales, mass.shape[0])
    return np.asarray(geometry(mass, np.zeros((0, mass.shape[0]))).k / own)


def _positive(what: str, values: ArrayLike, n: int) -> Array:
    """n positive finite numbers."""
    try:
        array = floats(values)
    except TypeError as error:
        raise ArgumentError(f"{what} must be {n} numbers, not {shown(values)}", argument=what) from error
    if array.shape != (n,) or not np.all(np.isfinite(array)) or np.any(array <= 0.0):
        raise ArgumentError(
            f"{what} must be {n} positive finite numbers, not {shown(array.tolist())}",
            argument=what,
        )
    return array


def _fixed(what: str, fixed: Iterable[int], n: int) -> list[int]:
    try:
        if isinstance(fixed, str | bytes):
            raise TypeError("text")
        indices = [index(i) for i in fixed]
    except TypeError as error:
        raise ArgumentError(f"{what} must be indices of coordinates, not {shown(fixed)}", argument=what) from error
    wrong = [i for i in indices if not 0 <= i < n]
    if wrong or len(set(indices)) < len(indices):
        raise ArgumentError(
            f"{what} must be different indices from 0 to {n - 1}, not {indices}",
            argument=what,
        )
    return indices
