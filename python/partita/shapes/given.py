"""Checks of the sizes that are given: numbers in metres, or a `DescriptionError` that names the shape."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError
from ..numeric import shown, without_units
from ..products import det, matmul, nearest_rotation
from ..tolerance import EQUAL, SUM_ROUNDING
from ..units.door import QuantityError, in_si

Array = NDArray[np.float64]

LARGEST_SIZE = 1e50
"""Sizes of shapes beyond this, or below its reciprocal, are typing errors. Scale: m. Reason: five of them multiplied
stay within the range of numbers."""


def fail(shape: str, sentence: str, cause: BaseException | None = None) -> NoReturn:
    """Raise `DescriptionError`: 'shape "Disc": sentence'."""
    raise DescriptionError(f'shape "{shape}": {sentence}', element="shape", name=shape) from cause


def numbers(shape: str, what: str, value: Any, unit: str = "m") -> Array:
    """An array of finite numbers in SI."""
    try:
        found = without_units(in_si(what, value, unit))
    except QuantityError as error:
        fail(shape, str(error), error)
    except (TypeError, ValueError) as error:
        fail(shape, f"{what} must be made of real numbers, not {shown(value)}", error)
    if not np.isfinite(found).all():
        fail(shape, f"{what} is {shown(value)}; give finite numbers")
    if found.size and np.abs(found).max() > LARGEST_SIZE:
        fail(shape, f"{what} contains a number above {LARGEST_SIZE:g}; use other units")
    return found


def length(shape: str, what: str, value: Any, zero: bool = False) -> float:
    """A positive length; with `zero` 0 is one too."""
    found = numbers(shape, what, value)
    if found.ndim != 0:
        fail(shape, f"{what} must be one number, not {shown(value)}")
    number = float(found)
    if number < 0.0 or (number == 0.0 and not zero):
        fail(shape, f"{what} is {number:g} m; it must be {'at least' if zero else 'greater than'} 0")
    if 0.0 < number < 1.0 / LARGEST_SIZE:
        fail(shape, f"{what} is {number:g} m, which is too small for a body")
    return number


def vector(shape: str, what: str, value: Any, size: int = 3) -> tuple[float, ...]:
    """So many numbers."""
    found = numbers(shape, what, value)
    if found.shape != (size,):
        fail(shape, f"{what} must be {size} numbers, not {shown(value)}")
    return tuple(found.tolist())


def rotation(shape: str, what: str, value: Any) -> tuple[tuple[float, ...], ...]:
    """Axes of a shape given by None, a matrix whose columns they are, a quaternion (w, x, y, z) or a SciPy `Rotation`;
    as rows of the matrix."""
    if value is None:
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if hasattr(value, "as_matrix"):
        value = np.asarray(value.as_matrix(), dtype=float)
    found = numbers(shape, what, value, "")
    if found.shape == (4,):
        size = float(np.abs(found).max())
        if size == 0.0:
            fail(shape, f"{what} is the zero quaternion, which is not a rotation; the identity is (1, 0, 0, 0)")
        found = _turned(found / size)
    if found.shape != (3, 3):
        fail(shape, f"{what} must be a 3x3 rotation matrix, a quaternion (w, x, y, z) or a SciPy Rotation")
    error = float(np.abs(matmul(found.T, found) - np.eye(3)).max())
    if error > EQUAL:
        fail(shape, f"{what} is not a rotation: its columns are not orthonormal; give more digits, or a quaternion")
    if det(found) < 0.0:
        fail(shape, f"{what} is a reflection (determinant -1), not a rotation; change the sign of one column")
    if error > SUM_ROUNDING:
        found = nearest_rotation(found)
    return tuple(tuple(row) for row in found.tolist())


def _turned(q: Array) -> Array:
    """The rotation of a quaternion of any length, scalar first."""
    w, x, y, z = q.tolist()
    matrix = np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )
    return matrix / (w * w + x * x + y * y + z * z)
