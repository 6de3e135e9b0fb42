"""Products and lengths of a few numbers whose sums have one order, so that every machine finds the same bits.

NumPy leaves products of matrices to a library that has another order of summation for each kind of processor. What
leads from what the user typed to a description is computed by these instead.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def matmul(a: ArrayLike, b: ArrayLike) -> Any:
    """`a @ b` for vectors and matrices (a: stacks of them too): a sum of products from the first on."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if not a.ndim or b.ndim not in (1, 2) or a.shape[-1] != len(b):
        raise ValueError(f"shapes {a.shape} and {b.shape} have no product")
    total = a[..., 0] * b[0] if b.ndim == 1 else a[..., :1] * b[0]
    for k in range(1, len(b)):
        total = total + (a[..., k] * b[k] if b.ndim == 1 else a[..., k : k + 1] * b[k])
    return total


SQUARED = 1e140
"""Numbers beyond this, and below its reciprocal, are scaled before they are squared. Scale: unit of the numbers.
Reason: sums of a thousand squares stay finite."""


def norm(x: ArrayLike) -> float:
    """Length of a vector; no overflow, as of `np.linalg.norm` there may be."""
    return math.sqrt(_squares(x)) if 1.0 / SQUARED < (largest := _largest(x)) < SQUARED else _scaled(x, largest)


def _squares(x: ArrayLike) -> float:
    total = 0.0
    for value in np.asarray(x, dtype=float).ravel().tolist():
        total += value * value
    return total


def _largest(x: ArrayLike) -> float:
    values = np.abs(np.asarray(x, dtype=float))
    return float(values.max()) if values.size else 0.0


def _scaled(x: ArrayLike, largest: float) -> float:
    if largest == 0.0 or not math.isfinite(largest):
        return largest
    return largest * math.sqrt(_squares(np.asarray(x, dtype=float) / largest))


def norms(x: ArrayLike) -> FloatArray:
    """Lengths of the rows of a matrix."""
    return np.array([norm(row) for row in np.asarray(x, dtype=float)])


def det(m: ArrayLike) -> float:
    """Determinant of a matrix of three rows."""
    (a, b, c), (d, e, f), (g, h, i) = np.asarray(m, dtype=float).tolist()
    return float(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))


def inverse(m: ArrayLike) -> FloatArray:
    """Inverse of a matrix of three rows."""
    r = np.asarray(m, dtype=float)
    columns = [np.cross(r[1], r[2]), np.cross(r[2], r[0]), np.cross(r[0], r[1])]
    return np.array(columns).T / det(r)


def nearest_rotation(m: ArrayLike) -> FloatArray:
    """The orthonormal matrix nearest to one of three rows that nearly is: its polar factor, by Newton's method."""
    r = np.asarray(m, dtype=float)
    if det(r) == 0.0:
        return r
    for _ in range(_ITERATIONS):
        following = 0.5 * (r + inverse(r).T)
        if np.abs(following - r).max() <= _LAST_CHANGE:
            return following
        r = following
    return r


_ITERATIONS = 20
_LAST_CHANGE = 1e-15
"""A change below this ends the iteration of a rotation. Scale: 1. Reason: some units in the last place."""


def inverse_pose(m: ArrayLike) -> FloatArray:
    """Inverse of a rigid displacement, a matrix of four rows."""
    r = np.asarray(m, dtype=float)
    found = np.eye(4)
    found[:3, :3] = r[:3, :3].T
    found[:3, 3] = -matmul(r[:3, :3].T, r[:3, 3])
    return found


def principal(m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues, ascending, and eigenvectors, in columns, of a symmetric matrix of three rows (by Jacobi)."""
    a = np.asarray(m, dtype=float).tolist()
    axes = np.eye(3).tolist()
    for _ in range(_SWEEPS):
        if all(abs(a[i][j]) <= _NOTHING * math.sqrt(abs(a[i][i] * a[j][j])) for i, j in _PAIRS):
            break
        for i, j in _PAIRS:
            if a[i][j] == 0.0:
                continue
            ratio = (a[j][j] - a[i][i]) / (2.0 * a[i][j])
            tangent = math.copysign(1.0, ratio) / (abs(ratio) + math.hypot(1.0, ratio))
            cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
            sine = tangent * cosine
            for row in (*a, *axes):  # from the right
                row[i], row[j] = cosine * row[i] - sine * row[j], sine * row[i] + cosine * row[j]
            a[i], a[j] = (
                [cosine * x - sine * y for x, y in zip(a[i], a[j], strict=True)],
                [sine * x + cosine * y for x, y in zip(a[i], a[j], strict=True)],
            )
    values = [a[k][k] for k in range(3)]
    order = sorted(range(3), key=values.__getitem__)
    return np.array(values)[order], np.array(axes)[:, order]


_PAIRS, _SWEEPS = ((0, 1), (0, 2), (1, 2)), 30
_NOTHING = 1e-17
"""Entries beside the diagonal below this are zero. Scale: fraction of the geometric mean of the diagonal ones.
Reason: a tenth of a unit in the last place."""
