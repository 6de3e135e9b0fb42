"""A rate from a prescribed acceleration: rate(t) = rate at t = 0 + integral of the acceleration from 0 to t."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..products import matmul
from ..state import Layout
from .motion import Motion, RoughError
from .values import Constant, Cubics, Function, Table, Value

_PANEL = 0.125
"""Length of the pieces [s] whose integrals are kept: long against an evaluation, short against a run."""
_EXACT = 1e-15
"""Error of a cell that is exact. Scale: fraction of the integral of the largest value over its panel. Reason: some
units in the last place."""
_SHORTEST_CELL = 2.0**-44
"""Cells around a jump are not halved below this. Scale: fraction of their panel. Reason: their contribution is
rounding."""
_CELLS = 4000
"""Cells of a panel: enough for forty jumps. A function that needs more is rough everywhere."""
_TABLE = 1e-9
"""Error of the acceleration of a smooth table. Scale: fraction of its largest value. Reason: that to which
`partita.table` samples."""
_RULES = tuple((0.5 * (1.0 + x), 0.5 * w) for x, w in map(np.polynomial.legendre.leggauss, (12, 8)))
"""Nodes and weights on (0, 1) of Gauss's rules of twelve and of eight nodes."""
_KEPT = 32
"""Panels whose cells are kept: more than a step spans."""
_BLOCK, _BLOCKS = 256, 8
"""Panels of a block, and blocks whose panels are kept one by one: of a long run one number for half a minute."""
_LAST = 2
"""Coefficients of the polynomial through the nodes that must vanish where parts of a cell are to be exact, too."""


def _to_legendre() -> NDArray[np.float64]:
    """Matrix from values at the twelve nodes to the coefficients of their polynomial."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    values = np.polynomial.legendre.legvander(nodes, 11)
    return np.asarray((np.arange(12)[:, None] + 0.5) * values.T * weights, dtype=float)


_TO_LEGENDRE = _to_legendre()


class Integral:
    """The rate of an acceleration a(t), by adaptive quadrature.

    A function of t alone: what was integrated before is kept, but every piece begins at a multiple of the same length,
    so that the answer does not depend on what was asked before.
    """

    def __init__(self, acceleration: Motion | _Steady, rate: float) -> None:
        self.acceleration, self.rate = acceleration, rate
        self._marks = {_PANEL: [0.0], -_PANEL: [0.0]}
        self._blocks: dict[tuple[int, float], list[float]] = {}
        self._panels: dict[tuple[float, float], _Panel] = {}

    @property
    def notes(self) -> list[str]:
        """The notes of the acceleration."""
        return getattr(self.acceleration, "notes", [])

    def bind(self, layout: Layout) -> Callable[[float], tuple[float, float, float]]:
        """Itself: a prescribed motion does not depend on the state."""
        return self

    def __call__(self, t: float) -> tuple[float, float, float]:
        step = _PANEL if t >= 0.0 else -_PANEL
        whole = int(t / step)
        acceleration, jerk, _ = self.acceleration(t)
        integral = self._until(whole, step) + self._panel(whole * step, step).up_to(t)
        return self.rate + integral, acceleration, jerk

    def _until(self, whole: int, step: float) -> float:
        """From 0 over whole panels. What is kept are the integrals at every `_BLOCK` panels, and those between them
        where they were asked for last."""
        number, within = divmod(whole, _BLOCK)
        marks = self._marks[step]
        while len(marks) <= number:
            marks.append(self._block(len(marks) - 1, step, _BLOCK)[_BLOCK])
        return self._block(number, step, within)[within]

    def _block(self, number: int, step: float, within: int) -> list[float]:
        found = self._blocks.get((number, step))
        if found is None:
            if len(self._blocks) >= _BLOCKS:
                self._blocks.clear()
            found = self._blocks[number, step] = [self._marks[step][number]]
        while len(found) <= within:
            begin = (number * _BLOCK + len(found) - 1) * step
            found.append(found[-1] + self._panel(begin, step).whole())
        return found

    def _panel(self, begin: float, step: float) -> _Panel:
        found = self._panels.get((begin, step))
        if found is None:
            if len(self._panels) >= _KEPT:
                self._panels.clear()
            found = self._panels[begin, step] = _Panel(self.acceleration.alone, begin, step)
        return found


class _Cell(NamedTuple):
    """The integral over a cell by the rule, whether it is exact, in parts as well, and the polynomial integrated."""

    value: float
    exact: bool
    coefficients: NDArray[np.float64]


class _Panel:
    """The integral of a function from the start of a panel. Cells are halved until Gauss's rule is exact to round-off;
    around a jump they get short, and all are kept. Parts of a cell are those of its polynomial, without calls."""

    def __init__(self, function: Callable[[float], float], begin: float, length: float) -> None:
        self.function, self.begin, self.length = function, begin, length
        self.cells: dict[tuple[float, float], _Cell] = {}
        self.size: float | None = None

    def whole(self) -> float:
        """Its integral over the whole panel."""
        return self._over(self.begin, self.length)

    def up_to(self, t: float) -> float:
        """From its start to t."""
        total, begin, length = 0.0, self.begin, self.length
        while t != begin:
            cell = self._cell(begin, length)
            if cell.exact:
                part = np.polynomial.legendre.legval(2.0 * (t - begin) / length - 1.0, cell.coefficients)
                return total + length * float(part)
            length *= 0.5
            if abs(t - begin) >= abs(length):
                total += self._over(begin, length)
                begin += length
        return total

    def _over(self, begin: float, length: float) -> float:
        cell = self._cell(begin, length)
        if cell.exact:
            return cell.value
        return self._over(begin, 0.5 * length) + self._over(begin + 0.5 * length, 0.5 * length)

    def _cell(self, begin: float, length: float) -> _Cell:
        """The cell with this start and length."""
        found = self.cells.get((begin, length))
        if found is None:
            if len(self.cells) >= _CELLS:
                raise RoughError("its values do not vary smoothly enough to be integrated")
            values = [np.array([self.function(begin + length * float(s)) for s in x]) for x, _ in _RULES]
            fine, coarse = (float(matmul(w, seen)) for (_, w), seen in zip(_RULES, values, strict=True))
            if self.size is None:
                self.size = float(np.abs(values[0]).max())
            series = matmul(_TO_LEGENDRE, values[0])
            part = float(np.abs(series[-_LAST:]).max()) / len(series)
            error = abs(length) * max(abs(fine - coarse), part)
            # times are rounded, and the function with them
            rounding = float(np.finfo(float).eps) * abs(begin) * float(np.ptp(values[0]))
            allowed = _EXACT * self.size * abs(self.length) + rounding
            exact = not error > allowed or abs(length) < _SHORTEST_CELL * abs(self.length)
            reached = np.polynomial.legendre.legint(series, scl=0.5, lbnd=-1)
            found = self.cells[begin, length] = _Cell(length * fine, exact, reached)
        return found


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
