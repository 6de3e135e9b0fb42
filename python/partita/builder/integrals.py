"""A rate from a prescribed acceleration: rate(t) = rate at t = 0 + integral of the acceleration from 0 to t."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..products import matmul
from ..state import Layout
from .motion import Motion, RoughError
from .values import Constant, Cubics, Function, Table, Value

_PANEL = 0.125
"""Length of the pieces [s] whose integrals are kept: long against an evaluation, short against a run."""
_EXACT = 1e-15
"""Error of a cell, relative to the integral of the largest value over its panel: round-off."""
_SHORTEST = 2.0**-44
"""Length of the cell around a jump, as a fraction of its panel: its contribution is round-off."""
_CELLS = 4000
"""Cells of a panel: enough for forty jumps. A function that needs more is rough everywhere."""
_TABLE = 1e-9
"""Error of the acceleration of a smooth table, relative to its largest value: that to which `partita.table` samples."""
_RULES = tuple((0.5 * (1.0 + x), 0.5 * w) for x, w in map(np.polynomial.legendre.leggauss, (12, 8)))
"""Nodes and weights on (0, 1) of Gauss's rules of twelve and of eight nodes."""


class Integral:
    """The rate of an acceleration a(t), by adaptive quadrature.

    A function of t alone: what was integrated before is kept, but every piece begins at a multiple of the same length,
    so that the answer does not depend on what was asked before.
    """

    def __init__(self, acceleration: Motion | _Steady, rate: float) -> None:
        self.acceleration, self.rate = acceleration, rate
        self._ahead, self._behind = [0.0], [0.0]
        self._panels: dict[float, _Panel] = {}

    @property
    def notes(self) -> list[str]:
        """The notes of the acceleration."""
        return getattr(self.acceleration, "notes", [])

    def bind(self, layout: Layout) -> Callable[[float], tuple[float, float, float]]:
        """Itself: a prescribed motion does not depend on the state."""
        return self

    def __call__(self, t: float) -> tuple[float, float, float]:
        pieces, step = (self._ahead, _PANEL) if t >= 0.0 else (self._behind, -_PANEL)
        whole = int(t / step)
        while len(pieces) <= whole:
            pieces.append(pieces[-1] + _Panel(self.acceleration.alone, (len(pieces) - 1) * step, step).whole())
        acceleration, jerk, _ = self.acceleration(t)
        begin = whole * step
        if begin not in self._panels:
            self._panels = {begin: _Panel(self.acceleration.alone, begin, step)}
        return self.rate + pieces[whole] + self._panels[begin].up_to(t), acceleration, jerk


class _Panel:
    """The integral of a function from the start of a panel. Cells are halved until Gauss's rule is exact to round-off;
    around a jump they get short, and all are kept."""

    def __init__(self, function: Callable[[float], float], begin: float, length: float) -> None:
        self.function, self.begin, self.length = function, begin, length
        self.cells: dict[tuple[float, float], tuple[float, bool]] = {}
        self.size = max(abs(function(begin + length * float(x))) for x in _RULES[0][0])

    def whole(self) -> float:
        """Its integral over the whole panel."""
        return self._over(self.begin, self.length)

    def up_to(self, t: float) -> float:
        """From its start to t."""
        total, begin, length = 0.0, self.begin, self.length
        while t != begin:
            if self._cell(begin, length)[1]:
                return total + self._rule(begin, t - begin)[0]
            length *= 0.5
            if abs(t - begin) >= abs(length):
                total += self._over(begin, length)
                begin += length
        return total

    def _over(self, begin: float, length: float) -> float:
        value, exact = self._cell(begin, length)
        return value if exact else self._over(begin, 0.5 * length) + self._over(begin + 0.5 * length, 0.5 * length)

    def _cell(self, begin: float, length: float) -> tuple[float, bool]:
        """Its integral by the rule, and whether that is exact."""
        found = self.cells.get((begin, length))
        if found is None:
            if len(self.cells) >= _CELLS:
                raise RoughError("its values do not vary smoothly enough to be integrated")
            value, error = self._rule(begin, length)
            exact = not error > _EXACT * self.size * abs(self.length) or abs(length) < _SHORTEST * abs(self.length)
            found = self.cells[begin, length] = value, exact
        return found

    def _rule(self, begin: float, length: float) -> tuple[float, float]:
        fine, coarse = (float(matmul(w, [self.function(begin + length * float(s)) for s in x])) for x, w in _RULES)
        return length * fine, abs(length * (fine - coarse))


def rate_of(acceleration: Value, rate: float) -> Value:
    """The rate computed from an acceleration and the rate at t = 0: the exact integral of a linear table, cubics along
    the integral of another one."""
    match acceleration:
        case Constant(value):
            return Function(Integral(_Steady(value), rate))
        case Table(times, values, "spline" | "monotone" as curve):
            from scipy import interpolate  # takes longer to import than all of Partita

            join = interpolate.CubicSpline if curve == "spline" else interpolate.PchipInterpolator
            return _rate_of_cubics(join(times, values), rate)
        case Table(times, values):
            width = np.diff(times)
            slope = np.diff(values) / width
            reached = np.concatenate([[0.0], np.cumsum(width * (values[:-1] + 0.5 * slope * width))])
            begin = max(0, min(int(np.searchsorted(times, 0.0, side="right")) - 1, len(width) - 1))
            ahead = 0.0 - times[begin]
            reached += rate - (reached[begin] + ahead * (values[begin] + 0.5 * slope[begin] * ahead))
            zeros = np.zeros_like(slope)
            return Cubics(times, np.column_stack([zeros, 0.5 * slope, values[:-1], reached[:-1]]))
        case Function(call) if isinstance(call, Motion):
            return Function(Integral(call, rate))
        case _:
            return acceleration


def _rate_of_cubics(joined: Any, rate: float) -> Cubics:
    """Cubics that have the values and slopes of the integral of cubics, quartic between its samples. Their own slope,
    the acceleration, differs from `joined` by at most |c| h^3 / (12 sqrt 3), c its cubic coefficient; the steps h are
    as short as `_TABLE` asks."""
    from scipy import interpolate  # takes longer to import than all of Partita

    times = joined.x
    width = np.diff(times)
    allowed = _TABLE * max(float(np.abs(joined(times)).max()), np.finfo(float).tiny)
    off = np.abs(joined.c[0]) * width**3 / (12.0 * np.sqrt(3.0))
    parts = np.maximum(1, np.ceil(np.cbrt(off / allowed))).astype(int)
    within = np.concatenate([np.arange(n) / n for n in parts])
    breaks = np.append(np.repeat(times[:-1], parts) + np.repeat(width, parts) * within, times[-1])
    reached = joined.antiderivative()
    rates = rate + reached(breaks) - reached(0.0)
    return Cubics(breaks, interpolate.CubicHermiteSpline(breaks, rates, joined(breaks)).c.T)


class _Steady:
    """The same acceleration at all times."""

    def __init__(self, value: float) -> None:
        self.value = value

    def alone(self, t: float) -> float:
        """Without derivatives."""
        return self.value

    def __call__(self, t: float) -> tuple[float, float, float]:
        return self.value, 0.0, 0.0
