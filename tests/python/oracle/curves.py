"""Curves of the independent program: functions whose derivatives are written by hand, and tables joined by cubics.

The cubics are found by their conditions, all at once in one dense system; slopes of curves that never overshoot by the
formula of Fritsch and Butland.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from .drawing import Array


@dataclass(frozen=True)
class Wave:
    """y0 + c . u + u . B u / 2 + a (sin(w . u + p) - sin p), with u = (x - x0) / unit and all of it times `height`."""

    slope: Array
    bend: Array
    frequency: Array
    amplitude: float
    phase: float
    origin: Array
    unit: Array
    start: float
    height: float

    @cached_property
    def numbers(self) -> tuple[Any, ...]:
        """Of Python, which what Partita differentiates by multiplies much faster than those of NumPy."""
        arrays = self.slope, self.bend, self.frequency, self.origin, self.unit
        return *(x.tolist() for x in arrays), float(np.sin(self.phase))

    def __call__(self, *x: Any) -> Any:
        """As Partita calls it, with numbers or what it differentiates by."""
        slope, bend, frequency, origin, scales, rest = self.numbers
        whole, turn, u = 0.0, self.phase, list[Any]()
        for i, value in enumerate(x):
            u.append((value - origin[i]) * (1.0 / scales[i]))
            steep = slope[i] + 0.5 * bend[i][i] * u[i]
            for k in range(i):
                steep = steep + bend[i][k] * u[k]
            whole = whole + steep * u[i]
            turn = turn + frequency[i] * u[i]
        return self.start + self.height * (whole + self.amplitude * (np.sin(turn) - rest))

    def scaled(self, height: float, unit: Array) -> Wave:
        """In other units."""
        return replace(
            self, start=self.start * height, height=self.height * height, origin=self.origin * unit,
            unit=self.unit * unit,
        )  # fmt: skip

    def derivatives(self, x: Array) -> tuple[float, Array, Array]:
        """Value, gradient and second derivatives."""
        u = (np.asarray(x) - self.origin) / self.unit
        turn = float(self.frequency @ u) + self.phase
        value = float(self.slope @ u + 0.5 * u @ self.bend @ u + self.amplitude * (np.sin(turn) - np.sin(self.phase)))
        gradient = self.slope + self.bend @ u + self.amplitude * np.cos(turn) * self.frequency
        second = self.bend - self.amplitude * np.sin(turn) * np.outer(self.frequency, self.frequency)
        over = np.outer(self.unit, self.unit)
        return self.start + self.height * value, self.height * gradient / self.unit, self.height * second / over


@dataclass(frozen=True)
class Spline:
    """The cubics through a table with two continuous derivatives: `periodic`, or with the third one continuous at the
    second entry and at the last but one (two entries: a straight line, three: a parabola)."""

    x: Array
    y: Array
    periodic: bool = False
    interpolation: ClassVar[str | None] = "spline"

    @cached_property
    def cubics(self) -> Array:
        """(n, 4): value, slope, half the second and a sixth of the third derivative at the start of each piece."""
        h, n = np.diff(self.x), len(self.x) - 1
        scale = float(np.mean(h))
        h = h / scale
        rows, right = [], []

        def say(value: float, *terms: tuple[int, Array]) -> None:
            row = np.zeros(4 * n)
            for piece, factors in terms:
                row[4 * piece : 4 * piece + 4] += factors
            rows.append(row)
            right.append(value)

        def derivative(order: int, s: float) -> Array:
            powers = [s**k for k in range(4)]
            return np.array(
                [
                    powers,
                    [0.0, 1.0, 2.0 * s, 3.0 * s**2],
                    [0.0, 0.0, 2.0, 6.0 * s],
                    [0.0, 0.0, 0.0, 6.0],
                ][order]
            )

        for k in range(n):
            say(float(self.y[k]), (k, derivative(0, 0.0)))
            say(float(self.y[k + 1]), (k, derivative(0, float(h[k]))))
        inner = [(k, k + 1) for k in range(n - 1)] + ([(n - 1, 0)] if self.periodic else [])
        for one, other in inner:
            for order in (1, 2):
                say(0.0, (one, derivative(order, float(h[one]))), (other, -derivative(order, 0.0)))
        if not self.periodic:
            if n > 2:
                for one, other in ((0, 1), (n - 2, n - 1)):
                    say(0.0, (one, derivative(3, 0.0)), (other, -derivative(3, 0.0)))
            else:
                for piece in range(n):
                    say(0.0, (piece, derivative(3, 0.0)))
                if n == 1:
                    say(0.0, (0, derivative(2, 0.0)))
        found = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0].reshape(n, 4)
        return found / scale ** np.arange(4)

    def derivatives(self, x: float) -> tuple[float, float, float]:
        """Value, slope and second derivative."""
        if self.periodic:
            x = self.x[0] + (x - self.x[0]) % (self.x[-1] - self.x[0])
        return of_cubics(self.x, self.cubics, x)


@dataclass(frozen=True)
class Monotone:
    """The cubics through a table that go up and down with it: slopes are weighted harmonic means of the two beside."""

    x: Array
    y: Array
    periodic: bool = False
    interpolation: ClassVar[str | None] = None

    def value(self, x: float) -> float:
        return self.derivatives(x)[0]

    def derivatives(self, x: float) -> tuple[float, float, float]:
        """Value, slope and second derivative."""
        if self.periodic:
            x = self.x[0] + (x - self.x[0]) % (self.x[-1] - self.x[0])
        return of_cubics(self.x, self.cubics, x)

    @cached_property
    def cubics(self) -> Array:
        h = np.diff(self.x)
        d = np.diff(self.y) / h
        if len(d) == 1:
            return np.array([[self.y[0], d[0], 0.0, 0.0]])
        slopes = [self._end(h[0], h[1], d[0], d[1])]
        for k in range(1, len(d)):
            if d[k - 1] * d[k] <= 0.0:
                slopes.append(0.0)
            else:
                a, b = h[k - 1] + 2.0 * h[k], 2.0 * h[k - 1] + h[k]
                slopes.append((a + b) / (a / d[k - 1] + b / d[k]))
        slopes.append(self._end(h[-1], h[-2], d[-1], d[-2]))
        s = np.array(slopes)
        second = (3.0 * d - 2.0 * s[:-1] - s[1:]) / h
        third = (s[:-1] + s[1:] - 2.0 * d) / h**2
        return np.column_stack([self.y[:-1], s[:-1], second, third])

    @staticmethod
    def _end(h: float, beside: float, d: float, next_one: float) -> float:
        """Of the parabola through three entries, unless it overshoots."""
        slope = ((2.0 * h + beside) * d - h * next_one) / (h + beside)
        if slope * d <= 0.0:
            return 0.0
        return 3.0 * d if d * next_one <= 0.0 and abs(slope) > 3.0 * abs(d) else slope


@dataclass(frozen=True)
class Straight:
    """Straight lines through a table."""

    x: Array
    y: Array
    interpolation: ClassVar[str | None] = None

    def derivatives(self, x: float) -> tuple[float, float, float]:
        """Value, slope and second derivative."""
        slopes = np.diff(self.y) / np.diff(self.x)
        none = np.zeros_like(slopes)
        return of_cubics(self.x, np.column_stack([self.y[:-1], slopes, none, none]), x)


def of_cubics(breaks: Array, cubics: Array, x: float) -> tuple[float, float, float]:
    i = int(np.clip(np.searchsorted(breaks, x, side="right") - 1, 0, len(cubics) - 1))
    a, b, c, d = cubics[i]
    s = x - breaks[i]
    return (
        float(a + s * (b + s * (c + s * d))),
        float(b + s * (2.0 * c + 3.0 * s * d)),
        float(2.0 * c + 6.0 * s * d),
    )
