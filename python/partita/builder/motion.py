"""Prescribed motion from a Python function: position, velocity and acceleration at a time."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import EvaluationError, PartitaError
from ..state import Layout
from ..tolerance import LEAST_DIVISOR, LONG_ROUNDING
from .checks import Element, takes
from .pieces import Pieces, Refusals
from .taylor import Jet
from .travelling import check_picklable
from .values import Cubics, finite, one_number

TimeFunction = Callable[[Any], Any]

# Central differences of order eight at offsets 1..4, and of order six at 1..3 to estimate the error.
_FIRST_8, _FIRST_6 = (4 / 5, -1 / 5, 4 / 105, -1 / 280), (3 / 4, -3 / 20, 1 / 60)
_SECOND_8, _SECOND_6 = (-205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560), (-49 / 18, 3 / 2, -3 / 20, 1 / 90)
# 3 microseconds to 0.1 s: fast and slow machines; not round numbers, because rounded values may follow a pattern.
_STEPS = tuple(0.0977 / 8.0**power for power in range(5, -1, -1))
# Seventh and eighth differences over neighbours, and their response to unit noise.
_SEVENTH, _SEVENTH_OF_NOISE = (-1.0, 7.0, -21.0, 35.0, -35.0, 21.0, -7.0, 1.0), 58.6
_EIGHTH, _EIGHTH_OF_NOISE = (1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0), 113.4
_STEADY = 4.0
"""High differences that grow by less scatter. Scale: factor from a step to one eight times as long, in the mean over
two. Reason: scatter does not grow, around a kink they grow eightfold."""
_KINK = 22.0
"""High differences that grow by less are those of a kink. Scale: as for `_STEADY`. Reason: between eight, and 64
where a second derivative jumps."""
# Coarser steps include more than the neighbourhood of t.
_FINE = 3
_ROUGH = 1e-9
"""With more scatter derivatives lose the digits that a run needs. Scale: fraction of the function. Reason: second
differences multiply it by a million."""
_BROKEN = 1e-11
"""Smaller differences next to t are no kink. Scale: fraction of the function. Reason: a kink of 1e-5 per second comes
to this at the finest step."""
_NOISE = 1e-4
"""Larger differences at two steps are a fast oscillation, sampled with steps as long as its period. Scale: fraction
of the function. Reason: far above scatter."""
# Times at which a function is tested when it is given; the second avoids zeros of functions at round times.
_PROBES = (0.0, 0.7310585786)
_ERRORS = 10.0
"""An estimated error may be exceeded by this. Scale: multiples of the estimate. Reason: it is a difference of two
orders, right in its first digit."""
ANOTHER = 1e-4
"""A derivative or a gradient that differs by more belongs to another function. Scale: fraction of its size. Reason:
it is given with five digits."""


class Derivatives(NamedTuple):
    """f, f', f'' at one place, and the error of the last; None: all are exact."""

    value: float
    first: float
    second: float
    error: float | None


class Differentiated:
    """A function of one number with its derivatives: exactly, by evaluating it on a `Jet`, and where it refuses one
    (`math.sin`, interpolators) from polynomials in `Pieces` through its values, of which one at the place itself is
    always taken. Where it is not smooth enough for these, `rough` decides. The method is selected at each place
    independently of earlier calls. `plainly`: its value, checked."""

    def __init__(
        self,
        function: Callable[[Any], Any],
        plainly: Callable[[float], float],
        rough: Callable[[float], tuple[float, float, float, float]],
    ) -> None:
        self._function, self._plainly, self._rough = function, plainly, rough
        self._refusals = Refusals(lambda s: _exactly(function, s), plainly)
        self._pieces = Pieces(lambda s: np.array([plainly(s)]), np.zeros(1))

    def at(self, t: float) -> Derivatives:
        """All of them at `t`."""
        if not self._refusals.at(t):
            try:
                return Derivatives(*_exactly(self._function, t), None)
            except Exception:  # whatever a user's function raises for a type of number that it does not know
                pass
        value = self._plainly(t)
        if not finite((value,)):
            return Derivatives(value, value, value, 0.0)
        found = self._pieces.at(t, np.array([value]))
        if found is None:
            return Derivatives(*self._rough(t))
        return Derivatives(value, float(found.first[0]), float(found.second[0]), float(found.error[0]))


class Motion:
    """f(t) -> (position, velocity, acceleration), in the form that the core needs.

    Missing derivatives are computed, see `Differentiated`; of a function that is not smooth enough for that by central
    differences with the step that shows the smallest error. `notes` reports that they are not exact.
    """

    def __init__(self, element: Element, position: TimeFunction, velocity: Any, acceleration: Any) -> None:
        self.element, self.notes = element, list[str]()
        self._derived: Differentiated | None = None
        self.position, self.velocity, self.acceleration = position, velocity, acceleration
        for function in (position, velocity, acceleration):
            if function is not None:
                takes(element, "its function", function, "one argument, t", 1)
        try:
            self._probe()
        except PartitaError:
            raise
        except Exception as error:
            raise EvaluationError(
                f'drive "{element.name}": the function fails at its first evaluation ({type(error).__name__}: {error})',
                t=_PROBES[0],
                where=element.name,
            ) from error

    def bind(self, layout: Layout) -> Callable[[float], tuple[float, float, float]]:
        """Itself: a prescribed motion does not depend on the state."""
        return self

    def cubics(self) -> Cubics | None:
        """The same as cubics between breaks, where the function is made of such (SciPy's `CubicSpline`,
        `PchipInterpolator`, `PPoly`, ...): exact derivatives, and steps that end at the breaks."""
        breaks, pieces = (getattr(self.position, name, None) for name in ("x", "c"))
        if self.velocity is not None or self.acceleration is not None:
            return None
        if not (isinstance(breaks, np.ndarray) and isinstance(pieces, np.ndarray) and pieces.ndim == 2):
            return None
        fits = pieces.shape[0] <= 4 and breaks.shape == (pieces.shape[1] + 1,) and bool(np.all(np.diff(breaks) > 0.0))
        if not fits or getattr(self.position, "extrapolate", None) == "periodic" or pieces.dtype != np.float64:
            return None
        coefficients = np.zeros((pieces.shape[1], 4))
        coefficients[:, 4 - pieces.shape[0] :] = pieces.T
        middle = 0.5 * (breaks[0] + breaks[1])
        expected = float(np.polyval(coefficients[0], middle - breaks[0]))
        # another class may give these two names another meaning
        same = bool(np.isclose(self._plain(self.position, middle), expected, rtol=LONG_ROUNDING, atol=LEAST_DIVISOR))
        return Cubics(breaks, coefficients) if same else None

    def __getstate__(self) -> dict[str, Any]:
        for what in ("position", "velocity", "acceleration"):
            check_picklable(self.element, f"function of the {what}", getattr(self, what))
        return {**self.__dict__, "_derived": None}

    def __deepcopy__(self, memo: dict[int, Any]) -> Motion:
        """With the same functions, which were tried before: Python copies functions as themselves."""
        twin = Motion.__new__(Motion)
        twin.__dict__.update(self.__dict__, notes=list(self.notes), _derived=None)
        return twin

    def __call__(self, t: float) -> tuple[float, float, float]:
        if self.velocity is not None and self.acceleration is not None:
            motion = (
                self._plain(self.position, t),
                self._plain(self.velocity, t),
                self._plain(self.acceleration, t),
            )
        elif self.velocity is not None:
            motion = (self._plain(self.position, t), *self._derive(self.velocity, t)[:2])
        else:
            x, v, a = self._derive(self.position, t)
            motion = x, v, a if self.acceleration is None else self._plain(self.acceleration, t)
        if not finite(motion):
            raise EvaluationError(
                f'drive "{self.element.name}": position, velocity, acceleration at t = {t:g} s are {motion}; '
                "the function must be smooth and defined at all times of the run, or its derivatives be given "
                "(velocity= and acceleration=)",
                t=t,
                where=self.element.name,
            )
        return motion

    def alone(self, t: float) -> float:
        """The first of them, without derivatives."""
        return self._plain(self.position, t)

    def _probe(self) -> None:
        """Test the functions: errors appear when they are given, and given derivatives are compared with the
        function."""
        if self.cubics() is not None:
            return
        self._plain(self.position, _PROBES[0])
        if self.velocity is not None:
            self._compare("velocity", self.position, self.velocity)
        elif self.acceleration is None:
            self._derive(self.position, _PROBES[0])
        if self.acceleration is not None:
            slope = self.velocity if self.velocity is not None else lambda t: self._derive(self.position, t)[1]
            self._compare("acceleration", slope, self.acceleration)

    def _compare(self, what: str, function: TimeFunction, derivative: TimeFunction) -> None:
        """Refuse a derivative that clearly belongs to another function: the drive would not move as described.

        A time at which one of the two cannot be evaluated is ignored.
        """
        seen = []
        for t in _PROBES:
            try:
                _, slope, _, error = differences(lambda s: self._plain(function, s), t)
                seen.append((t, slope, self._plain(derivative, t), error))
            except Exception:
                continue
        size = max((abs(x) for _, slope, given, _ in seen for x in (slope, given)), default=0.0)
        for t, slope, given, error in seen:
            if abs(given - slope) > ANOTHER * size + _ERRORS * error:
                self.element.fail(
                    f"at t = {t:g} s the {what} given is {given:g}, but the derivative of the function is {slope:g}; "
                    f"omit the {what}, and it is computed exactly"
                )

    def _plain(self, function: TimeFunction, t: float) -> float:
        """f(t) as a float; a function's own exceptions pass through."""
        value = function(t)
        try:
            return one_number(value)
        except TypeError as error:
            raise EvaluationError(
                f'drive "{self.element.name}": the function must return one number, not {error} (t = {t:g} s)',
                t=t,
                where=self.element.name,
            ) from error

    def _derive(self, function: TimeFunction, t: float) -> tuple[float, float, float]:
        """f, f', f'' at t. Only one of the functions has none of its derivatives given."""
        if self._derived is None:
            self._derived = Differentiated(
                function, lambda s: self._plain(function, s), lambda s: self._differences(function, s)
            )
        found = self._derived.at(t)
        if found.error is not None and not self.notes:
            self._warn(found.error, t)
        return found[:3]

    def _differences(self, function: TimeFunction, t: float) -> tuple[float, float, float, float]:
        """`differences`, with a message for a function that ends at t."""
        self._plain(function, t)
        try:
            return differences(lambda s: self._plain(function, s), t)
        except RoughError as error:
            raise EvaluationError(
                f'drive "{self.element.name}" at t = {t:g} s: the function cannot be differentiated: {error}; give a '
                "smooth function of unrounded numbers, a table (times, values), or velocity= and acceleration=",
                t=t,
                where=self.element.name,
            ) from error
        except Exception as error:
            raise EvaluationError(
                f'drive "{self.element.name}": the function works at t = {t:g} s but not slightly before or after, '
                f"where its derivatives are evaluated ({type(error).__name__}: {error}); pass velocity= and "
                "acceleration=, or use NumPy functions (np.sin instead of math.sin)",
                t=t,
                where=self.element.name,
            ) from error

    def _warn(self, error: float, t: float) -> None:
        """Report once that derivatives are not exact."""
        self.notes.append(
            f'drive "{self.element.name}": the function could not be differentiated exactly, so its derivatives are '
            f"differences of high order of its values, good to about {error:.0e} in the second derivative at "
            f"t = {t:g} s; use NumPy functions (np.sin instead of math.sin), or give velocity= and acceleration="
        )


def _exactly(function: TimeFunction, t: float) -> tuple[float, float, float]:
    """f, f', f'' of a function that takes a `Jet`."""
    jet = _as_jet(function(Jet(t, 1.0, 0.0)))
    return jet.x, jet.d1, jet.d2


def _as_jet(value: Any) -> Jet:
    """What f(Jet) returned, as a Jet."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(())[()]
    return value if isinstance(value, Jet) else Jet(one_number(value))


class RoughError(ValueError):
    """A function whose values do not vary smoothly enough for differences; the text describes the roughness."""


def differences(f: Callable[[float], float], t: float, scale: float = 0.0) -> tuple[float, float, float, float]:
    """f, f', f'' at `t` and the estimated error of f''. Costs 49 evaluations. `scale`: numbers of this size were
    subtracted to make f, so that it carries their round-off.

    Six step sizes, from the finest on. A coarser one is taken for its smaller error, but only if its result lies within
    the error of the finer one: a fast oscillation sampled coarsely looks like a slow one, perfectly smooth. The scatter
    of the values is measured by their seventh and eighth differences. The choice depends on `t` alone, never on earlier
    calls.

    Raises:
        RoughError: the values scatter, or have a kink or a jump next to t.
    """
    middle = f(t)
    samples = [([f(t + i * h) for i in range(1, 5)], [f(t - i * h) for i in range(1, 5)]) for h in _STEPS]
    scatter = _scatter(middle, samples, scale)
    slope, bend = _Best(), _Best()
    for h, (ahead, behind) in zip(_STEPS, samples, strict=True):
        odd = [(a - b) / h for a, b in zip(ahead, behind, strict=True)]
        even = [value / h**2 for value in (middle, *(a + b for a, b in zip(ahead, behind, strict=True)))]
        size = max(scale, *map(abs, [*ahead, *behind, middle])) + abs(t) * max(map(abs, odd))
        noise = max(4.0 * np.finfo(float).eps * size, scatter)  # round-off of f and of its argument
        slope.offer(_dot(_FIRST_8, odd), _dot(_FIRST_6, odd), noise / h)
        bend.offer(_dot(_SECOND_8, even), _dot(_SECOND_6, even), noise / h**2)
    return middle, slope.value, bend.value, bend.error


def _scatter(middle: float, samples: list[tuple[list[float], list[float]]], scale: float) -> float:
    """The scatter of the values. High differences of a smooth function fall to rounding at fine steps; those of
    scattered values do not depend on the step, those around a kink are proportional to it."""
    size = max(scale, abs(middle), *(abs(x) for pair in samples for side in pair for x in side))
    seen = []
    for ahead, behind in samples:
        line = [*reversed(behind), middle, *ahead]
        even = abs(_dot(_EIGHTH, line)) / _EIGHTH_OF_NOISE
        seen.append(max(even, abs(_dot(_SEVENTH, line[:8])) / _SEVENTH_OF_NOISE))
    fine = seen[:_FINE]
    first = next((i for i, x in enumerate(fine) if x > np.finfo(float).eps * size), 0)
    growth = (seen[first + 2] / seen[first]) ** 0.5 if seen[first] > 0.0 else _KINK
    if growth < _KINK and seen[first] > (_BROKEN if growth >= _STEADY else _ROUGH) * size:
        how = "do not vary smoothly" if growth < _STEADY else "have a kink or a jump there, or are rounded"
        raise RoughError(
            f"its values {how}: within {8.0 * _STEPS[first]:.0e} s they deviate from a smooth curve by "
            f"{seen[first]:.0e}"
        )
    steady = (max(pair) for pair in itertools.pairwise(seen[: _FINE + 1]) if pair[1] < _STEADY * pair[0])
    return max((x for x in steady if x < _NOISE * size), default=0.0)


class _Best:
    """The best result so far, from fine to coarse."""

    def __init__(self) -> None:
        self.value, self.error, self._closed = float("nan"), float("inf"), False

    def offer(self, high: float, low: float, noise: float) -> None:
        """A result of order 8, the one of order 6 with the same step, and the round-off in them."""
        error = abs(high - low) + noise
        first = not np.isfinite(self.error)
        self._closed = self._closed or not (first or abs(high - self.value) <= _ERRORS * (self.error + error))
        if not self._closed and (first or error < self.error):
            self.value, self.error = high, error


def _dot(weights: tuple[float, ...], samples: list[float]) -> float:
    """Sum of products over the shorter of the two."""
    return float(sum(weight * sample for weight, sample in zip(weights, samples, strict=False)))
