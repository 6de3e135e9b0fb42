"""Numbers, tables and functions of time: the forms of a force, a torque or a prescribed motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, cast

import numpy as np

from ..numeric import floats, shown
from ..state import Layout
from ..units.door import QuantityError, in_si
from .checks import Array, Element, choice, number, shape_of
from .sampled import JoinedTable

Curve = Literal["monotone", "spline", "periodic", "linear"]
INTERPOLATIONS: tuple[Curve, ...] = ("monotone", "linear", "spline")
"""The words of `interpolation=`."""
BY_DEFAULT: Mapping[str, Curve] = {"position": "monotone", "velocity": "linear", "acceleration": "linear"}
"""How tables of drives are joined at each level: the motion has continuous rates and stays within the samples."""
Units = tuple[str, str]
"""SI units of the abscissa of a table, and of its values."""


@dataclass(frozen=True)
class Constant:
    """The same number at all times."""

    value: float


@dataclass(frozen=True)
class Table:
    """Samples interpolated by piecewise cubics.

    "monotone" is PCHIP, which between two samples never leaves their range; "linear" joins them by straight lines;
    "spline" is the not-a-knot spline, twice differentiable, which may leave it; "periodic" is the spline that is so
    where it begins anew, too.
    """

    times: Array
    values: Array
    curve: Curve

    def spec(self) -> dict[str, Any]:
        """Breaks (n+1) and coefficients (n, 4), highest power of (t - break) first."""
        from scipy import interpolate  # takes longer to import than all of Partita

        if self.curve == "monotone":
            joined = interpolate.PchipInterpolator(self.times, self.values)
        elif self.curve == "spline":
            joined = interpolate.CubicSpline(self.times, self.values)
        elif self.curve == "linear":
            return Cubics(self.times, straight(self.times, self.values)).spec()
        else:
            closed = np.append(self.values[:-1], self.values[0])
            joined = interpolate.CubicSpline(self.times, closed, bc_type="periodic")
        return {"table": {"breaks": self.times.tolist(), "coefficients": joined.c.T.tolist()}}


def straight(times: Array, values: Array) -> Array:
    """Coefficients (n, 4) of straight lines between samples."""
    slopes = np.diff(values) / np.diff(times)
    none = np.zeros_like(slopes)
    return np.column_stack([none, none, slopes, values[:-1]])


@dataclass(frozen=True)
class Cubics:
    """Cubics between breaks: (n+1,) and (n, 4), highest power of (t - break) first."""

    breaks: Array
    coefficients: Array

    def spec(self) -> dict[str, Any]:
        """Breaks and coefficients."""
        return {"table": {"breaks": self.breaks.tolist(), "coefficients": self.coefficients.tolist()}}


@dataclass(frozen=True)
class Function:
    """A Python function, with the data needed to bring it into the form that the core calls."""

    call: Binding


class Binding(Protocol):
    """A user function that can be bound to a compiled model."""

    @property
    def notes(self) -> list[str]:
        """Notes for the user on how it is evaluated; may grow during a run."""

    def bind(self, layout: Layout) -> Callable[..., Any]:
        """The function as called by the core. `layout` may be filled in later, but before the first call."""


Value = Constant | Table | Cubics | Function


def scalar(
    element: Element,
    what: str,
    value: Any,
    curve: Curve,
    wrap: Callable[[Callable[..., Any]], Function],
    units: Units = ("", ""),
    interpolation: Any = None,
) -> Value:
    """`value` as a number, a table (times, values) or a function, which `wrap` brings into the core's form. `units`: of
    the abscissa of a table, and of its values. `curve`: how a table is joined for which `interpolation`, the user's
    word, is None."""
    word = interpolation_of(element, interpolation)
    if callable(value):
        return wrap(value)
    if is_table(value):
        return table(element, what, value, curve, units, interpolation=word)
    if isinstance(value, tuple | list | np.ndarray):
        element.fail(f"{what} must be a number, a function or a table (times, values), not {shown(value)}")
    return Constant(number(element, what, value, units[1]))


def is_table(value: Any) -> bool:
    """Whether `value` looks like (times, values): a pair of sequences."""
    return isinstance(value, tuple | list) and len(value) == 2 and all(shape_of(part) != () for part in value)


def interpolation_of(element: Element, word: Any) -> Curve | None:
    """The user's word for how tables are joined, checked; None: by default."""
    return None if word is None else cast(Curve, choice(element, "interpolation", word, INTERPOLATIONS))


def table(
    element: Element,
    what: str,
    value: Sequence[Any],
    curve: Curve,
    units: Units = ("", ""),
    columns: int | None = None,
    interpolation: Curve | None = None,
) -> Table:
    """A checked table: times (n,) increasing, values (n,) or (n, columns), n >= 2."""
    try:
        parts = (("what it is over", value[0], units[0]), ("its value", value[1], units[1]))
        times, values = (floats(in_si(words, part, unit)) for words, part, unit in parts)
    except QuantityError as error:
        element.fail(f"{what}: a table is (times, values) made of numbers: {error}", cause=error)
    except (TypeError, ValueError) as error:
        element.fail(f"{what}: a table is (times, values) made of numbers", cause=error)
    shape = (times.size,) if columns is None else (times.size, columns)
    if times.ndim != 1 or times.size < 2 or values.shape != shape:
        per_time = "one value" if columns is None else f"{columns} values"
        element.fail(
            f"{what}: a table needs at least two times and {per_time} for each; "
            f"times have shape {times.shape}, values {values.shape}"
        )
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values))):
        element.fail(f"{what}: the table contains NaN or infinity; remove those rows")
    steps = np.diff(times)
    if not np.all(steps > 0.0):
        row = int(np.argmin(steps > 0.0))
        element.fail(
            f"{what}: times must increase, but t = {times[row]:g} is followed by t = {times[row + 1]:g}; sort the table"
        )
    if interpolation is None and isinstance(value, JoinedTable) and curve in INTERPOLATIONS:
        interpolation = interpolation_of(element, value.interpolation)
    return Table(times, values, interpolation or curve)


def one_number(value: Any) -> float:
    """What a function returned, as a float; TypeError if it is not one real number. A size-one array
    counts."""
    if isinstance(value, np.ndarray):
        if value.size != 1:
            raise TypeError(f"an array of shape {value.shape}")
        value = value.reshape(())[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise TypeError(f"{type(value).__name__} {shown(value)}")
    try:
        return float(value)
    except OverflowError as error:
        raise TypeError("an integer beyond 1e308") from error


def finite(values: Sequence[float]) -> bool:
    """Whether all are finite; quicker than NumPy for three numbers."""
    return all(math.isfinite(value) for value in values)
