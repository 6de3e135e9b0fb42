"""Functions sampled as tables, to a verified error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError
from ..numeric import floats, real, shown
from .checks import LARGEST, Array

if TYPE_CHECKING:
    from typing_extensions import Self

FEWEST = 16
"""Intervals of the first table."""
MOST = 1 << 16
"""Intervals of the last: a file of two megabytes. A function that needs more has a kink or a jump."""
BETWEEN = (0.12, 0.31, 0.5, 0.69, 0.88)
"""Positions in each interval at which the table is compared with the function; the error of a cubic is largest near the
middle, in the outermost intervals aside of it."""


class JoinedTable(tuple[Any, Any]):
    """A table (times, values) with the word for how it is joined where a call gives none."""

    interpolation: str

    def __new__(cls, times: Any, values: Any, interpolation: str) -> Self:
        made = super().__new__(cls, (times, values))
        made.interpolation = interpolation
        return made

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self[0], self[1], self.interpolation


class SampledTable(JoinedTable):
    """A table (times, values) that was sampled from a function: `partita.table`.

    It is accepted wherever a table is, and joined by a twice differentiable cubic spline there.

    Attributes:
        times: (n,), in equal steps.
        values: (n,), or (n, numbers of the function).
        error: largest difference from the function that was found between the times.
        interpolation: "spline": how it is joined where `interpolation=` is not given.
    """

    error: float

    def __new__(cls, times: ArrayLike, values: ArrayLike, error: float = float("nan")) -> Self:
        made = super().__new__(cls, np.asarray(times, dtype=float), np.asarray(values, dtype=float), "spline")
        made.error = error
        return made

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self[0], self[1], self.error

    @property
    def times(self) -> Array:
        """Times, or other values of the argument."""
        times: Array = self[0]
        return times

    @property
    def values(self) -> Array:
        """Values of the function."""
        values: Array = self[1]
        return values

    def __repr__(self) -> str:
        return (
            f"<table of {len(self.times)} values, {self.times[0]:g} to {self.times[-1]:g}, within {self.error:.1e} of "
            "its function>"
        )


def table(function: Callable[[float], Any], start: float, end: float, tolerance: float = 1e-9) -> SampledTable:
    """Sample a function as a table, whose error is verified.

    A table can be written to files, playgrounds and FMUs, which cannot hold a Python function, and is evaluated without
    Python: prefer it to a function for drives, torques, forces and cams. The steps are halved until the spline through
    the samples differs from the function by at most `tolerance` at five positions in each step. Derivatives are less
    accurate: of a drive of positions the acceleration, by about the square root of the error.

    Args:
        function: of one number (time, or the argument of a cam); returns one number, or three for a force.
        start, end: range; a run that leaves it stops with an error.
        tolerance: allowed error, as a fraction of the largest value of the function.

    Returns:
        The table, with the `error` found.

    Raises:
        ArgumentError: the range is empty, or the function does not return finite numbers, or needs more than 65536
            steps: it has a kink or a jump, where two tables, or the function itself, are needed.

    >>> import numpy as np
    >>> import partita as pt
    >>> lift = pt.table(lambda t: 0.01 * np.sin(2.0 * np.pi * t), 0.0, 1.0)
    >>> bool(lift.error < 1e-11), len(lift.times)
    (True, 257)
    >>> m = pt.Mechanism("shaker")
    >>> table = m.add_body("table", mass=1.0, inertia=(1, 1, 1))
    >>> guide = m.add_prismatic("guide", m.ground, table, axis=(0, 1, 0))
    >>> m.add_drive(guide, position=lift).name
    'drive of guide'
    """
    from scipy.interpolate import CubicSpline  # takes longer to import than all of Partita

    if not callable(function):
        raise ArgumentError(f"table samples a function of one number, not {shown(function)}", argument="function")
    first, last = (_finite(name, value) for name, value in (("start", start), ("end", end)))
    if not 1.0 / LARGEST < last - first < LARGEST:
        raise ArgumentError(f"the range of a table must have a length, not {first:g} to {last:g}", argument="end")
    allowed = _finite("tolerance", tolerance)
    if not allowed > 0.0:
        raise ArgumentError(f"tolerance is {allowed:g}; it must be greater than zero", argument="tolerance")
    count = FEWEST
    times = np.linspace(first, last, count + 1)
    values = _values(function, times)
    while True:
        spline = CubicSpline(times, values)
        between = (times[:-1, None] + np.diff(times)[:, None] * np.array(BETWEEN)).ravel()
        wanted = _values(function, between)
        off = np.abs(spline(between) - wanted).reshape(len(between), -1).max(axis=1)
        size = max(float(np.abs(values).max()), float(np.abs(wanted).max()))
        error = float(off.max())
        if error <= allowed * size:
            return SampledTable(times, values, error)
        if count == MOST:
            raise ArgumentError(
                f"a table of {MOST} steps from {first:g} to {last:g} is off by {error:.1e} at "
                f"{between[off.argmax()]:g}, more than {allowed:g} of its size {size:.3g}: the function has a kink or "
                "a jump there, or varies too fast; sample it on both sides, allow a larger tolerance, or give the "
                "function itself",
                argument="function",
            )
        count *= 2
        finer = np.linspace(first, last, count + 1)
        # the function is not called again at times that are known
        values = np.concatenate([values, _values(function, finer[1::2])])[_interleaved(len(times), count)]
        times = finer


def _interleaved(old: int, count: int) -> Array:
    """Order of the old values and of those between them."""
    order = np.empty(count + 1, dtype=int)
    order[0::2], order[1::2] = np.arange(old), old + np.arange(count // 2)
    return order


def _finite(name: str, value: Any) -> float:
    try:
        number = real(value)
    except TypeError as error:
        raise ArgumentError(f"{name} must be a number, not {shown(value)}", argument=name) from error
    if not np.isfinite(number):
        raise ArgumentError(f"{name} is {number}; give a finite number", argument=name)
    return number


def _values(function: Callable[[float], Any], times: Array) -> Array:
    """Values (n,) or (n, k); `ArgumentError` for others."""
    rows: list[Array] = []
    for t in times.tolist():
        try:
            row = floats(function(t))
        except TypeError as error:
            raise ArgumentError(
                f"the function must return a number, or a list of numbers, at {t:g}: {error}", argument="function"
            ) from error
        if row.size == 1:
            row = row.reshape(())
        if row.ndim > 1 or (rows and row.shape != rows[0].shape) or not np.all(np.abs(row) < LARGEST):
            raise ArgumentError(
                f"the function must return finite numbers, equally many everywhere; at {t:g} it returned "
                f"{shown(row.tolist())}",
                argument="function",
            )
        rows.append(row)
    return np.array(rows)
