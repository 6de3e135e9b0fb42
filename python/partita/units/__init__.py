"""Units in the interface; internally everything is in SI units and radians.

Where a number with a dimension is expected, text with a unit and pint quantities are accepted as well:

>>> import partita as pt
>>> m = pt.Mechanism("pendulum")
>>> rod = m.add_rod("rod", start=(0, 0, 0), end=("250 mm", 0, 0), mass="8 oz")
>>> m.to_spec()["bodies"][0]["shape"]["length"]
0.25

Every way of giving a quantity yields the same number: it is read as a decimal, multiplied exactly and rounded once; for
degrees it equals `math.radians`. Other dimensions are refused. A bare number is in SI.

A constant is the size of its unit in SI, so that a multiplication converts in and a division converts out:

>>> from partita.units import deg, inch, mm, rpm
>>> 250 * mm, round(3 * inch, 6)
(0.25, 0.0762)
>>> round(1.5707963267948966 / deg, 12)
90.0
>>> round(60 * rpm, 6)
6.283185

`convert` does the same with names and refuses to mix what does not belong together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..numeric import floats, shown
from .door import ratio
from .table import Unit, called
from .text import NotAQuantity, unit_of

__all__ = [
    "cm",
    "convert",
    "deg",
    "foot",
    "gram",
    "inch",
    "kg",
    "km",
    "kN",
    "lb",
    "lbf",
    "metre",
    "minute",
    "mm",
    "ms",
    "newton",
    "Quantity",
    "rad",
    "rev",
    "rpm",
    "second",
]


class WithUnit(Protocol):
    """A quantity of pint: a number and its unit."""

    @property
    def magnitude(self) -> Any: ...
    @property
    def units(self) -> Any: ...
    def __hash__(self) -> int: ...


Quantity = float | str | WithUnit
"""A number in SI, text with a unit such as "250 mm", or a quantity of pint: the type of arguments with a dimension."""

metre, km, cm, mm, inch, foot = 1.0, 1e3, 1e-2, 1e-3, 0.0254, 0.3048
kg, gram, lb = 1.0, 1e-3, 0.45359237
second, ms, minute = 1.0, 1e-3, 60.0
rad, deg, rev = 1.0, math.pi / 180.0, 2.0 * math.pi
rpm = 0.10471975511965978  # pi / 30, rounded once
newton, kN, lbf = 1.0, 1e3, 4.4482216152605


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
