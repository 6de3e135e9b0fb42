"""Small equations between the ends of runs, by which periodic motions are found. All mechanics is in the runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# SciPy takes longer to import than all of Partita


def least_squares(matrix: Array, right: Array, rank: float | None = None) -> Array:
    """The shortest x of all that leave the least of matrix x = right; directions with singular values below this
    fraction of the largest count as undetermined."""
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=rank)[0], dtype=np.float64)


def inverse(matrix: Array) -> Array:
    """Of a regular matrix."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def null_space(rows: Array, rank: float) -> Array:
    """Directions that none of the rows sees, in orthonormal columns; singular values below this fraction of the largest
    are zero."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, values, directions = np.linalg.svd(rows)
    count = int(np.sum(values > rank * float(values.max(initial=0.0))))
    found: Array = directions[count:].T
    return found


def least_seen(matrix: Array) -> Array:
    """The direction of unit length that a matrix takes to the shortest vector."""
    found: Array = np.linalg.svd(matrix)[2][-1]
    return found


def pivots(columns: Array) -> NDArray[np.int_]:
    """Numbers of the columns, the least dependent first."""
    from scipy.linalg import qr

    return np.asarray(qr(columns, mode="r", pivoting=True)[1], dtype=int)


def root(f: Callable[[float], float], low: float, high: float, within: float, iterations: int) -> float:
    """Where a function is zero that has different signs at both ends. Raises `ValueError` if it has not."""
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=within, maxiter=iterations))


def integral(f: Callable[[float], float], low: float, high: float, within: float, pieces: int) -> float:
    """Of a function between two numbers."""
    from scipy.integrate import quad

    # the full output comes without warnings
    return float(quad(f, low, high, epsabs=within, epsrel=0.0, limit=pieces, full_output=1)[0])
