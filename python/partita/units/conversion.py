"""Conversion of plain numbers between units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..numeric import floats, shown
from .door import ratio
from .table import Unit, called
from .text import NotAQuantity, unit_of


@overload
def convert(value: float, unit: str, to: str) -> float: ...
@overload
def convert(value: Sequence[Any] | NDArray[Any], unit: str, to: str) -> NDArray[np.float64]: ...
def convert(value: ArrayLike, unit: str, to: str) -> float | NDArray[np.float64]:
    """Convert `value`, a number or an array of any shape, from `unit` into the unit `to`.

    Both are written as in quantities, such as "mm", "rpm", "lbf inch" or "kg m^2". Raises `ArgumentError` for
    an unknown unit and for units of different kinds.

    >>> from partita.units import convert
    >>> convert(2.0, "inch", "mm")
    50.8
    >>> convert([0.0, 180.0], "deg", "rad").round(6).tolist()
    [0.0, 3.141593]
    """
    source, target = _unit(unit, "unit"), _unit(to, "to")
    if source.dimension != target.dimension:
        raise ArgumentError(
            f"{unit!r} is a unit of {_kind(source)} and {to!r} one of {_kind(target)}; they cannot be converted",
            argument="to",
        )
    try:
        numbers = floats(value)
    except TypeError as error:
        raise ArgumentError(
            f"value must be a number or an array of numbers, not {shown(value)}", argument="value"
        ) from error
    try:
        factor = float(ratio(source, target))
    except OverflowError:
        factor = math.inf
    with np.errstate(over="ignore", invalid="ignore"):
        result = numbers * factor
    if np.any(np.isinf(result) & np.isfinite(numbers)):
        raise ArgumentError(f"value {shown(value)} in {to} exceeds the largest floating-point number", argument="value")
    return float(result) if result.ndim == 0 else result


def _unit(name: str, argument: str) -> Unit:
    """The unit called `name`."""
    if not isinstance(name, str):
        raise ArgumentError(f"unit {shown(name)} is not known; give its name, such as 'mm'", argument=argument)
    try:
        found = unit_of(name)
    except NotAQuantity as error:
        raise ArgumentError(f"unit {shown(name)} is not known; {error}", argument=argument) from error
    if found.size <= 0:
        raise ArgumentError(f"unit {shown(name)} is not a unit; give its name, such as 'mm'", argument=argument)
    return found


def _kind(unit: Unit) -> str:
    """The quantity that a unit measures, without its article."""
    return called(unit.dimension).removeprefix("an ").removeprefix("a ")
