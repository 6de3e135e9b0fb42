"""Vectors that may change: three values or one function for all; gravity is one."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..numeric import is_list, is_quantity
from . import callbacks
from .checks import Array, Element, along_an_axis, numbers, shape_of, vector
from .values import Constant, Function, Table, Value, interpolation_of, is_table, scalar, table

Changing = tuple[Value, Value, Value] | Function | None


def field(element: Element, gravity: Any) -> tuple[Array, Changing]:
    """The constant part, and the variable part."""
    if gravity is None:
        return np.zeros(3), None
    if isinstance(gravity, str):
        return _of_usual_size(element, gravity), None
    if not callable(gravity) and not is_table(gravity) and not _has_parts(gravity):
        return vector(element, "gravity", gravity, "m/s^2"), None
    changing = components(element, "gravity", gravity, "m/s^2")
    if isinstance(changing, tuple) and all(isinstance(item, Constant) for item in changing):
        return vector(element, "gravity", [item.value for item in changing if isinstance(item, Constant)]), None
    return np.zeros(3), changing


GRAVITY = 9.81
"""Size of gravity where only its direction is given [m/s^2]: that of the default."""


def _of_usual_size(element: Element, word: str) -> Array:
    """Gravity along a direction in words."""
    found = along_an_axis(word)
    if found is None:
        element.fail(
            f"gravity is {word!r}; give three numbers [m/s^2] such as (0, 0, -9.81), a direction such as '-z', or None"
        )
    return GRAVITY * found


def _has_parts(value: Any) -> bool:
    """Whether a list of three holds anything but numbers."""
    return (
        isinstance(value, tuple | list)
        and len(value) == 3
        and any(callable(item) or (is_table(item) and shape_of(item) is not None) for item in value)
    )


def components(
    element: Element, what: str, value: Any, unit: str, interpolation: Any = None
) -> tuple[Value, Value, Value] | Function:
    """Three values, or one function for all three."""
    word = interpolation_of(element, interpolation)
    if callable(value):
        return callbacks.vector_of(element)(value)
    if is_table(value):
        whole = table(element, what, value, "monotone", ("s", unit), 3, word)
        return tuple(Table(whole.times, whole.values[:, i].copy(), whole.curve) for i in range(3))  # type: ignore[return-value]
    if is_quantity(value):
        value = numbers(element, what, value, unit)
    if not is_list(value) or not isinstance(value, tuple | list | np.ndarray) or len(value) != 3:
        element.fail(f"{what} must have three components, or be a table or a function; got {value!r}")
    x, y, z = (
        scalar(element, f"{what} {label}", item, "monotone", callbacks.number_of(element), ("s", unit), word)
        for label, item in zip("xyz", value, strict=True)
    )
    return x, y, z
