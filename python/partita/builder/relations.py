"""User-defined constraints F(t, readings) = 0 in the form in which the core calls them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import EvaluationError
from ..state import Layout
from .checks import Element
from .motion import ANOTHER, Differentiated, RoughError, differences
from .taylor import Jet
from .travelling import check_picklable
from .values import finite, one_number

_SMOOTH = 1e-3
"""Length over which a smooth function's slope hardly changes. Scale: unit of its argument. Reason: what changes
within a thousandth of a radian or a metre is a corner to a run."""
_STEEPER = 10.0
"""A slope that changes by more is not smooth. Scale: multiples of itself. Reason: over `_SMOOTH` that of a smooth
function changes by a part of it."""
_CURVATURE = 1e-6
"""Curvatures whose error is smaller are as accurate as differences of order 8. Scale: fraction of the other slopes.
Reason: their rounding over the square of the step."""
_BESIDE = (0.0, 0.1310585786)
"""Where a gradient is compared with its function: as drawn, and away from the zeros that functions have there."""


class Law:
    """F(t, x) -> [F, F_t, F'' along the motion for x'' = 0, dF/dx_1, ...].

    Derivatives are exact where F takes a `Jet` (arithmetic, NumPy functions), else central differences, and a note says
    so; a gradient that is given takes their place.
    """

    def __init__(self, element: Element, function: Callable[..., Any], gradient: Callable[..., Any] | None) -> None:
        self.element, self.function, self.gradient = element, function, gradient
        self.notes: list[str] = []
        self._answered = False

    def bind(self, layout: Layout) -> Callable[[float, Any, Any], Any]:
        """The function itself, as its arguments are complete."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        for what, function in (("function", self.function), ("gradient", self.gradient)):
            if function is not None:
                check_picklable(self.element, what, function)
        return self.__dict__

    def __deepcopy__(self, memo: dict[int, Any]) -> Law:
        twin = type(self)(self.element, self.function, self.gradient)
        twin.notes = list(self.notes)
        return twin

    def __call__(self, t: float, x: Any, rates: Any) -> list[float]:
        at, along = [float(v) for v in x], [float(v) for v in rates]
        try:
            found = self._answer(t, at, along)
        except EvaluationError:
            raise
        except Exception as error:
            # during a run the core names the function; a failure of the first evaluation is named here
            if self._answered:
                raise
            why = f"the function fails there ({type(error).__name__}: {error})"
            raise self._error(t, f"{why}; its readings are ({', '.join(f'{v:g}' for v in at)})") from error
        self._answered = True
        return found

    def _answer(self, t: float, at: list[float], along: list[float]) -> list[float]:
        paths = [self._path(lambda s, f: f(t + s, *at), t)]
        if self.gradient is None:
            paths += [
                self._path(lambda s, f, i=i: f(t, *(v + s if j == i else v for j, v in enumerate(at))), t)
                for i in range(len(at))
            ]
        rate, *slopes = (path[1] for path in paths)
        if self.gradient is not None:
            slopes = self._numbers(self.gradient(t, *at), len(at), t)
        # the size of the terms of F where it vanishes, and of their changes
        terms = sum(abs(g) * (abs(v) + abs(r)) for g, v, r in zip(slopes, at, along, strict=True))
        paths.append(
            self._path(lambda s, f: f(t + s, *(v + s * r for v, r in zip(at, along, strict=True))), t, scale=terms)
        )
        size = max(terms, *(abs(x) for x in (rate, *slopes)))
        for value, slope, _, error in paths:
            self._smooth(value, slope, error, size, t)
        value, _, bend, _ = paths[-1]
        return self._finite([value, rate, bend, *slopes], t)

    def compare(self, x: Sequence[float]) -> None:
        """Refuse a gradient that clearly belongs to another function, at x and close to it.

        A point where the function cannot be evaluated or differentiated is ignored.
        """
        if self.gradient is None:
            return
        alone = Law(self.element, self.function, None)
        for beside in _BESIDE:
            at = [float(v) + beside for v in x]
            try:
                slopes = alone(0.0, at, [0.0] * len(at))[3:]
                given = self._numbers(self.gradient(0.0, *at), len(at), 0.0)
            except Exception:  # a user's function may fail in any way at points where it need not be defined
                continue
            size = max(map(abs, [*slopes, *given]))
            for i, (slope, number) in enumerate(zip(slopes, given, strict=True)):
                if abs(slope - number) > ANOTHER * size:
                    self.element.fail(
                        f"at t = 0 s and ({', '.join(f'{v:g}' for v in at)}) entry {i} of the gradient given is "
                        f"{number:g}, but the derivative of the function is {slope:g}; omit the gradient, and it is "
                        f"computed"
                    )

    def _path(self, at: Callable[..., Any], t: float, scale: float = 0.0) -> tuple[float, float, float, float]:
        """F, F', F'' over s at s = 0, and the error of F''; `scale`: the size of the terms of F."""
        try:
            found = at(Jet(0.0, 1.0), self.function)
            found = found if isinstance(found, Jet) else Jet(one_number(found))
            return found.x, found.d1, found.d2, 0.0
        except Exception:  # whatever a user's function does when it meets a number of a kind it does not know
            found = self._differences(lambda s: self._number(at(s, self.function), t), 0.0, t, scale)
        self._note(found[3])
        return found

    def _differences(
        self, function: Callable[[float], float], x: float, t: float, scale: float = 0.0
    ) -> tuple[float, float, float, float]:
        """`differences`, with a message for a function that is rough."""
        try:
            return differences(function, x, scale)
        except RoughError as rough:
            raise self._error(t, f"the function is not smooth here: {rough}") from rough

    def _note(self, error: float) -> None:
        """Report once that derivatives are not exact."""
        if not self.notes:
            self.notes.append(
                f'{self.element.kind} "{self.element.name}": the function could not be differentiated exactly, so its '
                f"derivatives are differences of high order of its values, good to about {error:.0e} in the second "
                "derivative; use NumPy functions (np.sin instead of math.sin)"
            )

    def _smooth(self, value: float, slope: float, error: float, size: float, t: float) -> None:
        """Refuse a function with a jump or a kink. A condition and its slope along the motion are zero where it holds
        and provide no scale: `size` is that of its other slopes and of its terms."""
        if error * _SMOOTH > _STEEPER * max(abs(slope), abs(value), _CURVATURE * size):
            raise self._error(
                t,
                f"the function is not smooth here (its value is {value:g}, its slope {slope:g}, its curvature known "
                f"within {error:.0e} only); a constraint must be twice differentiable",
            )

    def _number(self, value: Any, t: float) -> float:
        try:
            return one_number(value)
        except TypeError as error:
            raise self._error(t, f"the function must return one number, not {error}") from error

    def _numbers(self, values: Any, count: int, t: float) -> list[float]:
        try:
            found = [one_number(value) for value in values]
        except TypeError as error:
            raise self._error(t, f"it must return {count} numbers, not {error}") from error
        if len(found) != count:
            raise self._error(t, f"it must return {count} numbers, not {len(found)}")
        return found

    def _finite(self, found: list[float], t: float) -> list[float]:
        if not finite(found):
            raise self._error(t, f"the function and its derivatives are {found}")
        return found

    def _error(self, t: float, sentence: str) -> EvaluationError:
        name = self.element.name
        return EvaluationError(f'{self.element.kind} "{name}" at t = {t:g} s: {sentence}', t=t, where=name)


class Follower(Law):
    """The constraint of a follower: y - law(x1, x2, ...). A law of one number is evaluated at that number, most often
    once, where a function of several is at neighbours along each."""

    def __init__(self, element: Element, law: Callable[..., Any]) -> None:
        super().__init__(element, _Left(law), None)
        self._law, self._derived = law, self._differentiated(law)

    def _differentiated(self, law: Callable[..., Any]) -> Differentiated:
        """At t = 0 where it fails: a law does not depend on time, and the core names it during a run."""
        return Differentiated(law, self._value, lambda x: self._roughly(x, 0.0))

    def __getstate__(self) -> dict[str, Any]:
        check_picklable(self.element, "function", self._law)
        return {**super().__getstate__(), "_derived": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _derived=self._differentiated(state["_law"]))

    def __deepcopy__(self, memo: dict[int, Any]) -> Follower:
        twin = Follower(self.element, self._law)
        twin.notes = list(self.notes)
        return twin

    def _answer(self, t: float, at: list[float], along: list[float]) -> list[float]:
        if len(at) != 2:
            return super()._answer(t, at, along)
        (y, x), rate = at, along[1]
        value, slope, bend, error = self._derived.at(x)
        if error is not None:
            self._note(error)
        return self._finite([y - value, 0.0, -bend * rate * rate, 1.0, -slope], t)

    def _value(self, x: float) -> float:
        return self._number(self._law(x), 0.0)

    def _roughly(self, x: float, t: float) -> tuple[float, float, float, float]:
        """By differences, if it is smooth."""
        value, slope, bend, error = self._differences(self._value, x, t)
        self._smooth(value, slope, error, abs(slope), t)
        return value, slope, bend, error


class _Left:
    """What a law leaves of the follower's coordinate."""

    def __init__(self, law: Callable[..., Any]) -> None:
        self.law = law

    def __call__(self, t: Any, y: Any, *x: Any) -> Any:
        found = self.law(*x)
        try:
            return y - found
        except TypeError:
            return found  # not a number: the caller reports it


class RateLaw(Law):
    """Coefficients g_i(t, x) and a drift g_0 of the nonholonomic constraint sum g_i x_i' + g_0 = 0."""

    def _answer(self, t: float, at: list[float], along: list[float]) -> list[float]:
        values = self._coefficients(t, at)
        n = len(at)

        def entry(i: int) -> Callable[..., Any]:
            return lambda s, f: self._entry(f(t + s, *(v + s * r for v, r in zip(at, along, strict=True))), i, n)

        weights = [*along, 1.0]
        paths = [(weight, self._path(entry(i), t)) for i, weight in enumerate(weights) if weight != 0.0]
        for _, (value, slope, _, error) in paths:
            self._smooth(value, slope, error, max(map(abs, values)), t)
        bend = sum(weight * path[1] for weight, path in paths)
        return self._finite([0.0, values[n], bend, *values[:n]], t)

    def _coefficients(self, t: float, at: Sequence[float]) -> list[float]:
        values = list(self.function(t, *at))
        if len(values) == len(at):
            values.append(0.0)
        return self._numbers(values, len(at) + 1, t)

    @staticmethod
    def _entry(values: Any, i: int, n: int) -> Any:
        listed = list(values)
        return listed[i] if i < len(listed) else 0.0


class Profile:
    """Distance of a point (x, y) from a closed curve, radius over angle, along the radius: for a cam's outline."""

    notes: list[str]

    def __init__(self, angles: Any, radii: Any) -> None:
        from scipy.interpolate import CubicSpline

        self.notes = []
        spline = CubicSpline(angles, radii, bc_type="periodic")
        self.radius, self.first, self.second = spline, spline.derivative(), spline.derivative(2)

    def bind(self, layout: Layout) -> Callable[[float, Any, Any], Any]:
        """The function itself, as its arguments are complete."""
        return self

    def __call__(self, t: float, x: Any, rates: Any) -> list[float]:
        (px, py), (vx, vy) = (float(v) for v in x), (float(v) for v in rates)
        rho, angle = float(np.hypot(px, py)), float(np.arctan2(py, px))
        r, r1, r2 = (float(f(angle)) for f in (self.radius, self.first, self.second))
        # rho' and angle' along the motion, and their second derivatives for x'' = y'' = 0
        rho1, turn = (px * vx + py * vy) / rho, (px * vy - py * vx) / rho**2
        rho2, turn2 = rho * turn**2, -2.0 * rho1 * turn / rho
        gradient = [px / rho + r1 * py / rho**2, py / rho - r1 * px / rho**2]
        return [rho - r, 0.0, rho2 - r2 * turn**2 - r1 * turn2, *gradient]
