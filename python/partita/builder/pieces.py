"""Functions of time that only Python can evaluate, as polynomials in pieces: derivatives without further calls.

A function is sampled where it is asked for, and one polynomial serves all times of its piece. A piece is as long as
its values follow a polynomial to their own noise; it ends where a value or a derivative jumps, and where the function
is no longer defined. Pieces depend on the function alone, not on what was asked before: they are halves of halves of
fixed intervals, or end where the function breaks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..tolerance import ROUNDING
from .checks import Array

Sampled = Callable[[float], Array]

FIRST = 4.0
"""Length of the first interval [s]; the next ones end at 8, 16, 32, ... s: few of them, however long a run."""
FEW, MANY = 8, 16
"""Degrees of the polynomials that are tried, with one value more each; the second reuses the values of the first."""
_TAIL = {FEW: 3, MANY: 4}
"""Highest coefficients that must vanish in the noise."""
_HOPE = 1e-5
"""With a larger tail at the first degree values for the second would be lost. Scale: fraction of the function.
Reason: the tail of a smooth function falls at least as its square from the first degree to the second."""
_OF_TIME = 0.25
"""The part of it that a function has in its argument."""
_LEAST = 1.0 / 16.0
"""The part of it that the coefficients have at least."""
_FALLS = 6.0
"""A tail that falls by less from a piece to its half is that of a jump, or noise. Scale: factor. Reason: that of a
smooth function falls by 2^8, that of a jump of the second derivative by 4, noise not at all."""
_NOISE_OF = 4.0
"""Coefficients and values beyond this are no noise. Scale: multiples of its measured size. Reason: four
deviations."""
NOISIEST = 1e-9
"""With more noise derivatives lose the digits that a run needs. Scale: fraction of a function. Reason: as for
`_ROUGH` in `motion`."""
_AGAIN = 3
"""Halvings until noise is measured anew."""
_WINDOWS = (0.03, 0.43, 0.91)
"""Where noise is measured, in fractions of a piece: what breaks at one place leaves two of the three undisturbed."""
_WINDOW = 0.0391
"""Length of each: smooth functions have no eighth difference there."""
_EIGHTH, _EIGHTH_OF_NOISE = np.array([1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0]), 113.4
_ACCEPTED = 8.0
"""A value that deviates from a polynomial by more is none of its values. Scale: multiples of its noise. Reason: twice
what noise does; something is between samples."""
SHORTEST = 2.0**-19
"""Shorter pieces have no digits left in their second derivatives. Scale: s. Reason: two microseconds, whose square
times the largest derivative is rounding."""
_DIGITS = 1e6
"""Pieces in which fewer times lie are not halved. Scale: multiples of the rounding of time. Reason: six digits of
time in a piece."""
_CHAIN = 16
"""Halvings in search of a break until a smooth piece beyond it must have begun."""
_PARTS = 32
"""Parts of a first interval: an eighth of a second at first."""
_NEAR = (0.5, 0.1, 0.02)
"""Lengths of the pieces next to a break, as fractions of those from which it was found: the first that are smooth."""
_PASSES = 3
"""Number of such searches."""
_NARROWER = 1e-3
"""Searches with short pieces go on while each narrows the place of a break by this. Scale: fraction of its width.
Reason: continued less far, they see more."""
_KEPT = 4096
"""Pieces that are kept; beyond, all are found anew when they are asked for."""


def _coefficients(n: int) -> Array:
    """Matrix from the values at cos(pi j / n), j = 0..n, to Chebyshev coefficients."""
    j = np.arange(n + 1)
    ends = np.where((j == 0) | (j == n), 0.5, 1.0)
    matrix: Array = 2.0 / n * np.cos(np.pi * np.outer(j, j) / n) * ends[:, None] * ends[None, :]
    return matrix


def _slopes(n: int) -> Array:
    """Matrix from the values at cos(pi j / n) to the slopes of their polynomial there."""
    rising = np.polynomial.chebyshev.chebder(np.eye(n + 1), axis=0)
    matrix: Array = np.polynomial.chebyshev.chebvander(_NODES[n], n - 1) @ rising @ _coefficients(n)
    return matrix


_NODES = {n: np.cos(np.pi * np.arange(n + 1) / n) for n in (FEW, MANY)}
_TO_COEFFICIENTS = {n: _coefficients(n) for n in (FEW, MANY)}
_TO_SLOPES = {n: _slopes(n) for n in (FEW, MANY)}
_ORDER = np.arange(MANY + 1)


class Piece:
    """An interval, and the polynomial that holds there if the function is smooth: Chebyshev coefficients of the values
    and of two derivatives (3, count, numbers), with the noise of each number."""

    __slots__ = ("begin", "count", "end", "measured", "noise", "smooth", "split", "table", "tails", "whole")

    def __init__(self, begin: float, end: float) -> None:
        self.begin, self.end = begin, end
        self.smooth, self.whole = False, (False, False)
        self.split: tuple[float, float] | None = None
        self.tails: dict[int, Array] = {}
        self.measured: tuple[int, Array] | None = None
        self.table, self.noise, self.count = np.zeros((3, 0, 0)), np.zeros(0), 0

    def at(self, t: float) -> Array:
        """Values and two derivatives (3, numbers) at a time inside."""
        x = self.place(t)
        powers = np.cos(_ORDER[: self.count] * np.arccos(min(1.0, max(-1.0, x))))
        found: Array = powers @ self.table
        return found

    def beyond(self, t: float) -> tuple[Array, float]:
        """The values at a time outside, and the growth of noise until there."""
        x = self.place(t)
        growth = self.count * float(np.cosh((self.count - 1) * np.arccosh(max(abs(x), 1.0))))
        return np.polynomial.chebyshev.chebval(x, self.table[0]), growth

    def place(self, t: float) -> float:
        """A time inside, as a number between -1 and 1: no digits are lost however late it is."""
        return ((t - self.begin) - (self.end - t)) / (self.end - self.begin)

    def series(self, t: float) -> Array:
        """The polynomial about any time (4, numbers): value and three derivatives."""
        scale = 2.0 / (self.end - self.begin)
        steep = [np.polynomial.chebyshev.chebder(self.table[0], k, scl=scale, axis=0) for k in range(4)]
        return np.array([np.polynomial.chebyshev.chebval(self.place(t), c) for c in steep])

    def error(self) -> Array:
        """Noise in the second derivative, at its largest at the ends."""
        degree = max(self.count - 1, 1)
        worst: Array = self.noise * degree**4 / 3.0 * (2.0 / (self.end - self.begin)) ** 2
        return worst


class Derived(NamedTuple):
    """Values, first and second derivatives, and the noise in the latter; arrays (numbers,)."""

    value: Array
    first: Array
    second: Array
    error: Array


class _Change(NamedTuple):
    """An interval in which a function goes over from one piece to another, and whether both have its values there."""

    begin: float
    end: float
    both: bool


class Pieces:
    """A function of time in pieces. `scales`: numbers of these sizes were subtracted to make its values, which carry
    their round-off."""

    def __init__(self, function: Sampled, scales: Array) -> None:
        self.function, self.scales = function, scales
        self._kept: dict[tuple[float, float], Piece] = {}

    def at(self, t: float, value: Array) -> Derived | None:
        """The derivatives at `t`, where the function is `value`: by the longest piece that has this value. None where
        the function is not smooth enough for any."""
        if len(self._kept) > _KEPT:
            self._kept.clear()
        with np.errstate(all="ignore"):  # functions overflow outside the times for which they were written
            return self._derived(t, value)

    def _derived(self, t: float, value: Array) -> Derived | None:
        piece: Piece | None = self._piece(*first_interval(t), None)
        while piece is not None:
            if piece.smooth:
                found = piece.at(t)
                if np.all(np.abs(found[0] - value) <= _ACCEPTED * piece.noise):
                    return Derived(value, found[1], found[2], piece.error())
            piece = self._part(piece, t)
        return None

    def _part(self, piece: Piece, t: float) -> Piece | None:
        """The part of a piece that contains t."""
        if piece.end - piece.begin < 2 * max(SHORTEST, _DIGITS * ROUNDING * abs(t)):
            return None
        if piece.split is None:
            piece.split = self._split(piece)
        left, right = piece.split
        begin, end = (piece.begin, left) if t <= left and t < right else (right, piece.end)
        return self._piece(begin, end, piece) if begin <= t <= end and begin < end else None

    def _split(self, piece: Piece) -> tuple[float, float]:
        """Where a piece is divided: the ends of both parts, next to each other where something jumps."""
        middle = 0.5 * (piece.begin + piece.end)
        if not piece.smooth:
            if piece.whole[0] != piece.whole[1]:
                return self._edge(piece)
            if piece.tails and (found := self._break(piece)) is not None:
                return found
        return middle, middle

    def _edge(self, piece: Piece) -> tuple[float, float]:
        """The last time at which a function is defined, and the next, at which it is not; or the other way round."""
        left, right = piece.begin, piece.end
        while (middle := _between(left, right)) is not None:
            if (self._value(middle) is not None) == piece.whole[0]:
                left = middle
            else:
                right = middle
        return left, right

    def _break(self, piece: Piece) -> tuple[float, float] | None:
        """The only place in a piece that is not smooth, if there is one. Where one half is smooth, its polynomial is
        continued into the other one until the function leaves it; beyond, another smooth piece must begin."""
        middle = 0.5 * (piece.begin + piece.end)
        halves = self._piece(piece.begin, middle, piece), self._piece(middle, piece.end, piece)
        if halves[0].smooth == halves[1].smooth:
            return None
        ahead = halves[0].smooth
        known, far = (halves[0], piece.end) if ahead else (halves[1], piece.begin)
        followed, left = middle, far
        for _ in range(_CHAIN):
            between = 0.5 * (followed + left)
            value = self._value(between)
            if value is None:
                return None
            if _follows(known, between, value):
                followed = between
            else:
                left = between
            if abs(left - far) >= abs(left - followed):
                other = self._piece(min(left, far), max(left, far), piece)
                if not other.smooth:
                    return None
                sides = (known, other) if ahead else (other, known)
                return self._located(piece, sides, min(followed, left), max(followed, left))
        return None

    def _located(
        self, piece: Piece, sides: tuple[Piece, Piece], begin: float, end: float
    ) -> tuple[float, float] | None:
        """Where a function goes over from one smooth piece to another: first by the two pieces that are known, then by
        two that end next to the place, which are hardly continued."""
        found = self._changed(sides, begin, end)
        if found is None:
            return None
        for _ in range(_PASSES):
            width = found.end - found.begin
            near = self._beside(piece, sides, found)
            if near is None:
                break
            sides, found = near, self._changed(near, found.begin, found.end)
            if found is None:
                return None
            if not found.both or found.end - found.begin > _NARROWER * width:
                break
        if not found.both:
            return found.begin, found.end
        place = _crossing(*sides, 0.5 * (found.begin + found.end), (found.begin, found.end))
        return place, place

    def _beside(self, piece: Piece, sides: tuple[Piece, Piece], found: _Change) -> tuple[Piece, Piece] | None:
        """The longest smooth pieces that end next to a place, of the lengths that are tried."""
        lengths = [side.end - side.begin for side in sides]
        for part in _NEAR:
            near = (
                self._piece(max(piece.begin, found.begin - part * lengths[0]), found.begin, piece),
                self._piece(found.end, min(piece.end, found.end + part * lengths[1]), piece),
            )
            if near[0].smooth and near[1].smooth:
                return near
        return None

    def _changed(self, sides: tuple[Piece, Piece], begin: float, end: float) -> _Change | None:
        """Where a function follows the one of two pieces no longer and the other one already. None where it follows
        neither."""
        while (middle := _between(begin, end)) is not None:
            value = self._value(middle)
            if value is None:
                return None
            match _follows(sides[0], middle, value), _follows(sides[1], middle, value):
                case True, True:
                    return _Change(begin, end, True)
                case True, False:
                    begin = middle
                case False, True:
                    end = middle
                case _:
                    return None
        return _Change(begin, end, False)

    def _piece(self, begin: float, end: float, of: Piece | None) -> Piece:
        """A piece, examined once."""
        key = begin, end
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = self._examined(begin, end, of)
        return found

    def _examined(self, begin: float, end: float, of: Piece | None) -> Piece:
        piece = Piece(begin, end)
        ends = self._value(end), self._value(begin)
        piece.whole = ends[1] is not None, ends[0] is not None
        values: dict[int, Array] = {}
        for j, known in ((0, ends[0]), (MANY, ends[1])):
            if known is None:
                return piece
            values[j] = known
        level = None if of is None or of.measured is None else (of.measured[0] + 1, of.measured[1])
        piece.measured = level
        for n in (FEW, MANY):
            for j in range(0, MANY + 1, MANY // n):
                if j not in values:
                    value = self._value(_node(begin, end, j))
                    if value is None:
                        return piece
                    values[j] = value
            samples = np.array([values[j] for j in sorted(values)])
            # times are rounded: the values between them
            apart = np.array([piece.place(_node(begin, end, j)) for j in sorted(values)]) - _NODES[n]
            samples = samples - apart[:, None] * (_TO_SLOPES[n] @ samples)
            coefficients = _TO_COEFFICIENTS[n] @ samples
            tail = piece.tails[n] = np.abs(coefficients[-_TAIL[n] :]).max(axis=0)
            size = np.maximum(np.abs(samples).max(axis=0), self.scales)
            slope = np.abs(_TO_SLOPES[n] @ samples).max(axis=0) * 2.0 / (end - begin)
            noise = ROUNDING * (size + _OF_TIME * max(abs(begin), abs(end)) * slope)
            if level is not None:
                noise = np.maximum(noise, level[1])
            if not np.all(tail <= noise) and of is not None and n in of.tails:
                steady = (tail > noise) & (tail * _FALLS >= of.tails[n]) & (tail <= _NOISE_OF * NOISIEST * size)
                if np.any(steady) and (piece.measured is None or piece.measured[0] >= _AGAIN):
                    measured = self._measured(begin, end)
                    if measured is not None:
                        # what falls within the piece is no noise, and where it is too large none is taken for it
                        taken = np.where((measured >= tail) & (measured <= NOISIEST * size), measured, 0.0)
                        noise = np.maximum(noise, taken)
                        piece.measured = 0, taken
            if np.all(tail <= noise):
                self._complete(piece, coefficients, noise, np.maximum(tail, _LEAST * noise))
                return piece
            if n == FEW and not np.all(tail <= np.maximum(_HOPE * size, noise)):
                return piece
        return piece

    def _measured(self, begin: float, end: float) -> Array | None:
        """Noise of the values, by their eighth differences at three places: the middle one of the three."""
        length = end - begin
        seen = []
        for window in _WINDOWS:
            times = begin + length * (window + _WINDOW * np.arange(9) / 8.0)
            line = [self._value(t) for t in times.tolist()]
            if any(value is None for value in line):
                return None
            seen.append(np.abs(_EIGHTH @ np.array(line)) / _EIGHTH_OF_NOISE)
        noise: Array = _NOISE_OF * np.median(seen, axis=0)
        return noise

    def _complete(self, piece: Piece, coefficients: Array, noise: Array, cut: Array) -> None:
        """Its polynomial, without the last coefficients below `cut`, and those of the derivatives."""
        above = np.nonzero(np.any(np.abs(coefficients) > cut, axis=1))[0]
        count = int(above[-1]) + 1 if len(above) else 1
        table = np.zeros((3, count, coefficients.shape[1]))
        table[0] = coefficients[:count]
        for k in (1, 2):
            if count > k:
                steep = np.polynomial.chebyshev.chebder(table[0], k, scl=2.0 / (piece.end - piece.begin), axis=0)
                table[k, : count - k] = steep
        piece.table, piece.count, piece.noise, piece.smooth = table, count, noise, True

    def _value(self, t: float) -> Array | None:
        """The value, or None where the function is not defined."""
        try:
            value = self.function(t)
        except Exception:  # whatever a user's function raises outside the times for which it was written
            return None
        return value if bool(np.all(np.isfinite(value))) else None


def _follows(piece: Piece, t: float, value: Array) -> bool:
    """Whether a function that has this value outside a piece still follows its polynomial."""
    continued, growth = piece.beyond(t)
    return bool(np.all(np.abs(continued - value) <= growth * piece.noise))


def _crossing(left: Piece, right: Piece, near: float, within: tuple[float, float]) -> float:
    """Where one smooth piece goes over into the other, both of which have the same values within their noise: where
    the last derivative that is continuous agrees, which depends linearly on time."""
    for order in (3, 2, 1):
        t = near
        for _ in range(3):
            apart = left.series(t) - right.series(t)
            most = int(np.argmax(np.abs(apart[order])))
            if apart[order, most] == 0.0:
                break
            t -= float(apart[order - 1, most] / apart[order, most])
            if abs(t - near) > within[1] - within[0]:
                break
        else:
            return t
    return near


class Refusals:
    """Where a function refuses exact derivatives, so that they are not asked for in vain at every time: in parts of the
    first intervals, by the middle of each. Like pieces, these depend on the function alone."""

    def __init__(self, exactly: Callable[[float], Any], plainly: Callable[[float], Any]) -> None:
        self._exactly, self._plainly = exactly, plainly
        self._known: dict[tuple[float, int], bool] = {}

    def at(self, t: float) -> bool:
        """Whether the function has a value in the middle of the part around t, but no exact derivatives."""
        begin, end = first_interval(t)
        width = (end - begin) / _PARTS
        key = begin, int((t - begin) / width)
        if key not in self._known:
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[key] = self._found(begin + (key[1] + 0.5) * width)
        return self._known[key]

    def _found(self, middle: float) -> bool:
        try:
            self._exactly(middle)
        except Exception:  # whatever a user's function raises for a type of number that it does not know
            try:
                self._plainly(middle)
            except Exception:  # or outside the times for which it was written
                return False
            return True
        return False


def first_interval(t: float) -> tuple[float, float]:
    """The interval of 0, 4, 8, 16, ... s, or of its mirror image, that contains t."""
    far = max(abs(t), 0.5 * FIRST)
    end = FIRST
    while end <= far:
        end *= 2.0
    begin = 0.0 if end == FIRST else 0.5 * end
    return (begin, end) if t >= 0.0 else (-end, -begin)


def _node(begin: float, end: float, j: int) -> float:
    """Node number j of `MANY`, from the end to the beginning."""
    if j in (0, MANY):
        return end if j == 0 else begin
    return float(0.5 * (begin + end) + 0.5 * (end - begin) * np.cos(np.pi * j / MANY))


def _between(begin: float, end: float) -> float | None:
    """The middle of an interval; None where no number lies between its ends."""
    middle = 0.5 * (begin + end)
    return middle if begin < middle < end else None
