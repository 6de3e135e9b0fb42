"""A rate from a prescribed acceleration: rate(t) = rate at t = 0 + integral of the acceleration from 0 to t."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from ..state import Layout
from .motion import Motion
from .values import Constant, Cubics, Function, Table, Value

_PANEL = 0.125
"""Length of the pieces [s] whose integrals are kept: long against an evaluation, short against a run."""


class Integral:
    """The rate of an acceleration a(t), by adaptive quadrature.

    A function of t alone: what was integrated before is kept, but every piece begins at a multiple of the same length,
    so that the answer does not depend on what was asked before.
    """

    def __init__(self, acceleration: Callable[[float], tuple[float, float, float]], rate: float) -> None:
        self.acceleration, self.rate = acceleration, rate
        self._ahead, self._behind = [0.0], [0.0]

    @property
    def notes(self) -> list[str]:
        """Those of the acceleration."""
        return getattr(self.acceleration, "notes", [])

    def bind(self, layout: Layout) -> Callable[[float], tuple[float, float, float]]:
        """Itself: a prescribed motion looks at no state."""
        return self

    def __call__(self, t: float) -> tuple[float, float, float]:
        pieces, step = (self._ahead, _PANEL) if t >= 0.0 else (self._behind, -_PANEL)
        whole = int(t / step)
        while len(pieces) <= whole:
            begin = (len(pieces) - 1) * step
            pieces.append(pieces[-1] + self._integral(begin, begin + step))
        acceleration, jerk, _ = self.acceleration(t)
        return self.rate + pieces[whole] + self._integral(whole * step, t), acceleration, jerk

    def _integral(self, begin: float, end: float) -> float:
        from scipy.integrate import IntegrationWarning, quad

        if begin == end:
            return 0.0
        with warnings.catch_warnings():
            # the tolerance is at round-off, which quad remarks upon
            warnings.simplefilter("ignore", IntegrationWarning)
            return float(quad(lambda t: self.acceleration(t)[0], begin, end, epsabs=0.0, epsrel=1e-13, limit=200)[0])


def rate_of(acceleration: Value, rate: float) -> Value:
    """The rate that an acceleration makes of the one at t = 0. A table is joined by straight lines, whose integral is
    exact."""
    match acceleration:
        case Constant(value):
            return Function(Integral(_Steady(value), rate))
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


class _Steady:
    """The same acceleration at all times."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __call__(self, t: float) -> tuple[float, float, float]:
        return self.value, 0.0, 0.0
