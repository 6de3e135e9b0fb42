"""Units at the door: inside Partita everything is SI and radians.

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

import difflib
import math
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ArgumentError
from .numeric import floats, shown

__all__ = [
    "cm",
    "convert",
    "deg",
    "foot",
    "gram",
    "inch",
    "kN",
    "kg",
    "km",
    "lb",
    "lbf",
    "metre",
    "minute",
    "mm",
    "ms",
    "newton",
    "rad",
    "rev",
    "rpm",
    "second",
]

metre, km, cm, mm, inch, foot = 1.0, 1e3, 1e-2, 1e-3, 0.0254, 0.3048
kg, gram, lb = 1.0, 1e-3, 0.45359237
second, ms, minute = 1.0, 1e-3, 60.0
rad, deg, rev = 1.0, math.pi / 180.0, 2.0 * math.pi
rpm = 2.0 * math.pi / 60.0
newton, kN, lbf = 1.0, 1e3, 4.4482216152605

_TABLE: dict[str, tuple[str, float]] = {
    **{n: ("length", s) for n, s in {"m": metre, "km": km, "cm": cm, "mm": mm, "inch": inch, "foot": foot}.items()},
    **{n: ("mass", s) for n, s in {"kg": kg, "gram": gram, "lb": lb}.items()},
    **{n: ("time", s) for n, s in {"s": second, "ms": ms, "minute": minute}.items()},
    **{n: ("angle", s) for n, s in {"rad": rad, "deg": deg, "rev": rev}.items()},
    **{n: ("angular velocity", s) for n, s in {"rad/s": 1.0, "deg/s": deg, "rpm": rpm}.items()},
    **{n: ("force", s) for n, s in {"N": newton, "kN": kN, "lbf": lbf}.items()},
    **{n: ("torque", s) for n, s in {"N m": 1.0, "N mm": 1e-3, "lbf inch": lbf * inch}.items()},
}


@overload
def convert(value: float, unit: str, to: str) -> float: ...
@overload
def convert(value: ArrayLike, unit: str, to: str) -> float | NDArray[np.float64]: ...
def convert(value: ArrayLike, unit: str, to: str) -> float | NDArray[np.float64]:
    """Convert `value`, a number or an array of any shape, from `unit` into the unit `to`.

    Both are names: m km cm mm inch foot, kg gram lb, s ms minute, rad deg rev, "rad/s" "deg/s" rpm, N kN lbf,
    "N m" "N mm" "lbf inch". Raises `ArgumentError` for an unknown unit and for units of different kinds.

    >>> from partita.units import convert
    >>> convert(2.0, "inch", "mm")
    50.8
    >>> convert([0.0, 180.0], "deg", "rad").round(6).tolist()
    [0.0, 3.141593]
    """
    kind, size = _unit(unit, "unit")
    kind_to, size_to = _unit(to, "to")
    if kind != kind_to:
        raise ArgumentError(
            f"{unit!r} is a unit of {kind} and {to!r} one of {kind_to}; they cannot be converted",
            argument="to",
        )
    try:
        numbers = floats(value)
    except TypeError as error:
        raise ArgumentError(
            f"value must be a number or an array of numbers, not {shown(value)}", argument="value"
        ) from error
    with np.errstate(over="ignore"):
        result = numbers * (size / size_to)
    if np.any(np.isinf(result) & np.isfinite(numbers)):
        raise ArgumentError(f"value {shown(value)} in {to} is beyond the largest number there is", argument="value")
    return float(result) if result.ndim == 0 else result


def _unit(name: str, argument: str) -> tuple[str, float]:
    """Kind and size of the unit called `name`."""
    if isinstance(name, str) and name in _TABLE:
        return _TABLE[name]
    close = difflib.get_close_matches(shown(name).strip("'"), _TABLE, n=1)
    hint = f"did you mean {close[0]!r}?" if close else "known units: " + ", ".join(_TABLE)
    raise ArgumentError(f"unit {shown(name)} is not known; {hint}", argument=argument)
