"""A number that carries its first two derivatives in time, to differentiate a user's f(t) exactly.

`f(Jet(t, 1.0, 0.0))` yields f, f', f'' by the chain rule, with the round-off of f itself: no step size, no
cancellation. Arithmetic, comparisons (by value) and the usual NumPy functions work; anything else raises
TypeError, `math.sin(jet)` included, because a silent float would lose the derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np


class Jet:
    """Value `x` with first and second derivative `d1`, `d2`."""

    __slots__ = ("d1", "d2", "x")

    def __init__(self, x: float, d1: float = 0.0, d2: float = 0.0) -> None:
        self.x, self.d1, self.d2 = float(x), float(d1), float(d2)

    def __repr__(self) -> str:
        return f"Jet({self.x!r}, {self.d1!r}, {self.d2!r})"

    def chain(self, f: float, f1: float, f2: float) -> Jet:
        """g(self) for a function with value f and derivatives f1, f2 at `self.x`."""
        return Jet(f, f1 * self.d1, f2 * self.d1 * self.d1 + f1 * self.d2)

    def __add__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else Jet(self.x + b.x, self.d1 + b.d1, self.d2 + b.d2)

    def __sub__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else Jet(self.x - b.x, self.d1 - b.d1, self.d2 - b.d2)

    def __mul__(self, other: Any) -> Jet:
        b = _jet(other)
        if b is None:
            return NotImplemented
        return Jet(self.x * b.x, self.d1 * b.x + self.x * b.d1, self.d2 * b.x + 2.0 * self.d1 * b.d1 + self.x * b.d2)

    def __truediv__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else self * b.reciprocal()

    def __pow__(self, other: Any) -> Jet:
        b = _jet(other)
        if b is None:
            return NotImplemented
        if b.d1 == 0.0 and b.d2 == 0.0:
            return self._power(b.x)
        return (b * self.log()).exp()

    def _power(self, n: float) -> Jet:
        """x^n with constant n. A factor 0 in front ends the term, so that t**1 works at t = 0."""
        first = n * self.x ** (n - 1.0) if n != 0.0 else 0.0
        second = n * (n - 1.0) * self.x ** (n - 2.0) if n not in (0.0, 1.0) else 0.0
        return self.chain(self.x**n, first, second)

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else b - self

    def __rtruediv__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else b / self

    def __rpow__(self, other: Any) -> Jet:
        b = _jet(other)
        return NotImplemented if b is None else b**self

    def __floordiv__(self, other: Any) -> Jet:
        return (self / other).floor()

    def __mod__(self, other: Any) -> Jet:
        return self - (self // other) * other

    def __neg__(self) -> Jet:
        return Jet(-self.x, -self.d1, -self.d2)

    def __pos__(self) -> Jet:
        return self

    def __abs__(self) -> Jet:
        return -self if self.x < 0.0 else self

    def __lt__(self, other: Any) -> bool:
        return bool(self.x < _value(other))

    def __le__(self, other: Any) -> bool:
        return bool(self.x <= _value(other))

    def __gt__(self, other: Any) -> bool:
        return bool(self.x > _value(other))

    def __ge__(self, other: Any) -> bool:
        return bool(self.x >= _value(other))

    def __eq__(self, other: object) -> bool:
        return bool(self.x == _value(other))

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        return self.x != 0.0

    # NumPy calls a method of the function's name on the elements of an object array; `__array_ufunc__` uses
    # the same ones.
    def reciprocal(self) -> Jet:
        r = 1.0 / self.x
        return self.chain(r, -r * r, 2.0 * r * r * r)

    def sqrt(self) -> Jet:
        r = math.sqrt(self.x)
        return self.chain(r, 0.5 / r, -0.25 / (r * self.x))

    def square(self) -> Jet:
        return self * self

    def exp(self) -> Jet:
        e = math.exp(self.x)
        return self.chain(e, e, e)

    def expm1(self) -> Jet:
        e = math.exp(self.x)
        return self.chain(math.expm1(self.x), e, e)

    def log(self) -> Jet:
        return self.chain(math.log(self.x), 1.0 / self.x, -1.0 / (self.x * self.x))

    def log1p(self) -> Jet:
        u = 1.0 / (1.0 + self.x)
        return self.chain(math.log1p(self.x), u, -u * u)

    def log2(self) -> Jet:
        return self.log() / math.log(2.0)

    def log10(self) -> Jet:
        return self.log() / math.log(10.0)

    def sin(self) -> Jet:
        s, c = math.sin(self.x), math.cos(self.x)
        return self.chain(s, c, -s)

    def cos(self) -> Jet:
        s, c = math.sin(self.x), math.cos(self.x)
        return self.chain(c, -s, -c)

    def tan(self) -> Jet:
        y = math.tan(self.x)
        return self.chain(y, 1.0 + y * y, 2.0 * y * (1.0 + y * y))

    def arcsin(self) -> Jet:
        u = 1.0 / math.sqrt(1.0 - self.x * self.x)
        return self.chain(math.asin(self.x), u, self.x * u**3)

    def arccos(self) -> Jet:
        return math.pi / 2.0 - self.arcsin()

    def arctan(self) -> Jet:
        u = 1.0 / (1.0 + self.x * self.x)
        return self.chain(math.atan(self.x), u, -2.0 * self.x * u * u)

    def sinh(self) -> Jet:
        s, c = math.sinh(self.x), math.cosh(self.x)
        return self.chain(s, c, s)

    def cosh(self) -> Jet:
        s, c = math.sinh(self.x), math.cosh(self.x)
        return self.chain(c, s, c)

    def tanh(self) -> Jet:
        y = math.tanh(self.x)
        return self.chain(y, 1.0 - y * y, -2.0 * y * (1.0 - y * y))

    def arctan2(self, other: Any) -> Jet:
        b = other if isinstance(other, Jet) else Jet(other)
        turn = (self / b).arctan() if abs(b.x) >= abs(self.x) else -(b / self).arctan()
        return Jet(math.atan2(self.x, b.x), turn.d1, turn.d2)

    def hypot(self, other: Any) -> Jet:
        return (self * self + other * other).sqrt()

    def radians(self) -> Jet:
        return self * (math.pi / 180.0)

    def degrees(self) -> Jet:
        return self * (180.0 / math.pi)

    def sign(self) -> Jet:
        return Jet(np.sign(self.x))

    def floor(self) -> Jet:
        return Jet(math.floor(self.x))

    def ceil(self) -> Jet:
        return Jet(math.ceil(self.x))

    deg2rad, rad2deg = radians, degrees

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method != "__call__" or kwargs:
            return NotImplemented
        if any(isinstance(item, np.ndarray) and item.ndim > 0 for item in inputs):
            return ufunc(*(_objects(item) for item in inputs))
        first, *rest = (item.item() if isinstance(item, np.ndarray | np.generic) else item for item in inputs)
        rule = _RULES.get(ufunc.__name__) or getattr(Jet, ufunc.__name__, None)
        if rule is None:
            return NotImplemented
        return rule(first if isinstance(first, Jet) else Jet(first), *rest)


_RULES: dict[str, Callable[..., Any]] = {
    "add": Jet.__add__,
    "subtract": Jet.__sub__,
    "multiply": Jet.__mul__,
    "divide": Jet.__truediv__,
    "true_divide": Jet.__truediv__,
    "floor_divide": Jet.__floordiv__,
    "remainder": Jet.__mod__,
    "power": Jet.__pow__,
    "float_power": Jet.__pow__,
    "negative": Jet.__neg__,
    "positive": Jet.__pos__,
    "absolute": Jet.__abs__,
    "fabs": Jet.__abs__,
    "less": Jet.__lt__,
    "less_equal": Jet.__le__,
    "greater": Jet.__gt__,
    "greater_equal": Jet.__ge__,
    "equal": Jet.__eq__,
    "maximum": lambda a, b: a if a >= b else b,
    "minimum": lambda a, b: a if a <= b else b,
}


def _jet(other: Any) -> Jet | None:
    """`other` as a Jet; None if it is not a real number."""
    if isinstance(other, Jet):
        return other
    return Jet(float(other)) if isinstance(other, int | float | np.integer | np.floating) else None


def _value(other: Any) -> Any:
    return other.x if isinstance(other, Jet) else other


def _objects(item: Any) -> Any:
    """`item` as an array of Python objects: NumPy then works element by element through the operators
    above."""
    array = np.empty((), dtype=object)
    if isinstance(item, Jet):
        array[()] = item
        return array
    return np.asarray(item).astype(object)
