"""The equations at one instant, with all quantities of the reduction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class Instant:
    """All terms of M v' = h + C^T lambda, C v + a = 0, C v' + b = 0 at one t, q, v, and of their reduction to k
    equations.

    n velocities, m constraint rows of rank r, k = n - r. Rows and columns follow `names` of the model; `A` has its
    rows in the order of `dependent` and its columns in that of `independent`, `D` its columns in that of v.

    Attributes:
        t, q, v: the instant. Without given velocities the mechanism is at rest except for prescribed motions.
        M: mass matrix (n, n).
        h: applied and velocity-dependent forces (n,).
        C, a, b: constraint Jacobian (m, n) and the remaining terms of (S4) and (S5), (m,) each.
        A, eta, xi: v_D = A v_I + eta (r, k), (r,); v'_D = A v'_I + xi, (r,). (P1)
        D: (k, n) with D C^T = 0 and v = D^T v_I + [0; eta]. (P2)
        M_d, h_d: the equations free of reactions, M_d v'_I = h_d (k, k), (k,). (P3)
        vdot: accelerations (n,).
        multipliers: lambda (m,); with redundant rows, for a mechanism those of the reactions with the least sum of
            squares over all joints, for a user-defined system zero on the rows left out.
        rho: projective measure of every velocity (n,): 1 = not restricted by the constraints, 0 = locked. (P4)
        sigma, sqrt_mu: quality of the choice, 1 best, 0 singular; see `pt.partition.Partition`.
        independent, dependent: indices of velocities (k,) and (r,).
        rows: indices of the constraint rows kept (r,).
    """

    t: float
    q: Array
    v: Array
    M: Array
    h: Array
    C: Array
    a: Array
    b: Array
    A: Array
    D: Array
    eta: Array
    xi: Array
    M_d: Array
    h_d: Array
    vdot: Array
    multipliers: Array
    rho: Array
    sigma: float
    sqrt_mu: float
    independent: Indices
    dependent: Indices
    rows: Indices

    @classmethod
    def from_core(cls, t: float, q: Array, found: Mapping[str, Any]) -> Instant:
        """From what the core returned for (t, q)."""
        return cls(t=t, q=np.array(q), **found)

    def __repr__(self) -> str:
        return (
            f"<Instant t = {self.t:g} s: {len(self.v)} velocities, {len(self.a)} constraint rows, "
            f"{len(self.independent)} independent; sigma {self.sigma:.3g}>"
        )
