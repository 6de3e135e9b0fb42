"""Numeric input: integers and floats. No words, truth values or complex numbers, which NumPy converts."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

MaybeNone: TypeAlias = Any
"""In a type beside another one: None where the docstring says so, and nobody has to check for it who knows better."""

_SHOWN = 80
_NUMBERS = frozenset({float, int, np.float64})
_DOUBLE = np.dtype(np.float64)


def floats(values: Any) -> NDArray[np.float64]:
    """`values` as a new contiguous array of floats; TypeError for anything not made of real numbers, and for
    quantities, whose units NumPy would silently drop."""
    if type(values) is np.ndarray and values.dtype is _DOUBLE:
        return values.copy()
    if _holds_quantity(values):
        raise TypeError(f"{shown(values)} has a unit, but a plain number in SI units is expected")
    return without_units(values)


def without_units(values: Any) -> NDArray[np.float64]:
    """The same for values in which no quantity is left."""
    try:
        array = np.array(values, order="C")
        if array.dtype == np.float64:
            return array
        if array.dtype.kind in "iuf" or (array.size == 0 and array.dtype.kind != "O"):
            return np.array(array, dtype=np.float64, order="C")
    except TypeError:
        raise
    except Exception as error:  # an object may raise anything when it is converted to numbers
        raise TypeError(str(error)) from error
    if array.dtype.kind == "O" and all(type(x) in (int, float) for x in array.flat):
        try:
            return np.array(array, dtype=np.float64, order="C")  # integers beyond 64 bits
        except OverflowError as error:
            raise TypeError("an integer beyond 1e308") from error
    raise TypeError(f"{array.dtype} values")


def is_list(value: Any) -> TypeGuard[Iterable[Any]]:
    """Whether it has items to go through: no text, and no array without dimensions, which NumPy makes of a number."""
    return isinstance(value, Iterable) and not isinstance(value, str | bytes) and getattr(value, "ndim", 1) != 0


def is_quantity(value: Any) -> bool:
    """Whether it is a quantity of pint or a compatible library. Nothing is imported for this test."""
    return hasattr(type(value), "to_base_units") and hasattr(type(value), "magnitude")


def foreign(value: Any) -> str | None:
    """The library of an array with a unit that is not of pint's kind; None for all else."""
    kind = type(value)
    if isinstance(value, np.ndarray) and kind is not np.ndarray and (hasattr(kind, "unit") or hasattr(kind, "units")):
        return kind.__module__.partition(".")[0]
    return None


def _holds_quantity(values: Any) -> bool:
    """Whether there is a quantity in it."""
    kind = type(values)
    if kind in _NUMBERS or (kind is np.ndarray and values.dtype.kind != "O"):
        return False
    if kind is np.ndarray:
        return any(_holds_quantity(item) for item in values.flat)
    if isinstance(values, (list, tuple)):
        return not _NUMBERS.issuperset(map(type, values)) and any(map(_holds_quantity, values))
    return is_quantity(values) or foreign(values) is not None


def real(value: Any) -> float:
    """One real number; TypeError for anything else, arrays of several numbers included."""
    if type(value) is float:
        return value
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{type(value).__name__} {value!r}")
    array = floats(value)
    if array.size != 1:
        raise TypeError(f"an array of shape {array.shape}")
    return float(array.reshape(()))


def shown(value: Any) -> str:
    """`value` in a message, of any type, shortened if long."""
    try:
        text = repr(value)
    except Exception:
        text = f"<{type(value).__name__}>"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a rotation, by the largest of the four."""
    r = rotation
    squares = np.array([1 + r[0, 0] + r[1, 1] + r[2, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2],
                        1 - r[0, 0] + r[1, 1] - r[2, 2], 1 - r[0, 0] - r[1, 1] + r[2, 2]])  # fmt: skip
    k = int(np.argmax(squares))
    w, x, y = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    rows = (
        (squares[0], w, x, y),
        (w, squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        (x, r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]),
        (y, r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]),
    )
    found = np.array(rows[k])
    w, x, y, z = (found / np.linalg.norm(found)).tolist()
    return w, x, y, z
