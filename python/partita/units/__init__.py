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
from typing import Any, Protocol

from .array import UnitArray
from .conversion import convert

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
    "UnitArray",
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
