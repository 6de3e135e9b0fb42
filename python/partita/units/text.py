"""Quantities as text: "250 mm", "3/4 inch", "0.5 N m s/rad".

    quantity := [+-] factor { [*] factor | / factor }
    factor   := (number | unit | "(" product ")") [ ^ exponent ]

A space multiplies. After "/" and a unit only another "/" may follow: "N/m s" is ambiguous, so brackets are required.
Numbers are read as decimals, without rounding.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from functools import lru_cache

from .table import PLAIN, UNITS, Unit, unknown

LONGEST = 200
"""Characters of a quantity."""
_DIGITS = 400
"""Larger powers of ten are not floats."""
_POWER = 12
"""The largest exponent of a unit."""
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<unit>[^\W\d]+|°)|(?P<sign>\*\*|[-+*/^()]))\s*"
)
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


class NotAQuantity(ValueError):
    """The text cannot be read; the sentence gives the reason."""


class NoNumber(NotAQuantity):
    """It does not begin like a quantity."""


@dataclass(frozen=True)
class Quantity:
    """A number and its unit; `named`: the text contains a unit."""

    number: Fraction
    unit: Unit
    named: bool


@lru_cache(maxsize=512)
def unit_of(text: str) -> Unit:
    """The unit named in a text; numbers in it count as part of the unit."""
    found = _Reader(text).all()
    return Unit(found.number, PLAIN.dimension) * found.unit


def quantity_of(text: str) -> Quantity:
    """The quantity expressed by a text."""
    reader = _Reader(text)
    found = reader.all()
    if not reader.has_a_number:
        raise NoNumber("it has no number")
    return found


class _Reader:
    """Reads one text from left to right."""

    def __init__(self, text: str) -> None:
        self.text = text
        if len(text) > LONGEST:
            raise NotAQuantity(f"it is {len(text)} characters long")
        plain = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+", lambda m: f"^({m[0].translate(_RAISED)})", text)
        plain = plain.replace("·", "*").replace("×", "*").replace("⋅", "*").replace("−", "-").strip()
        if not plain:
            raise NoNumber("it is empty")
        self.tokens: list[tuple[str, str]] = []
        at = 0
        while at < len(plain):
            match = _TOKEN.match(plain, at)
            if match is None:
                if plain[at] == ",":
                    raise NotAQuantity("the decimal separator is a point, not a comma")
                raise NoNumber(f"{plain[at]!r} belongs to no quantity")
            kind = str(match.lastgroup)
            self.tokens.append((kind, match[kind]))
            at = match.end()
        self.position = 0
        self.number = Fraction(1)
        self.names_a_unit = self.has_a_number = False

    def all(self) -> Quantity:
        negative = False
        if self._peek()[1] in ("+", "-"):
            negative = self._next()[1] == "-"
        found = self._product(0)
        if self.position < len(self.tokens):
            raise NotAQuantity(f"{self._peek()[1]!r} does not belong there")
        return Quantity(-self.number if negative else self.number, found, self.names_a_unit)

    def _peek(self) -> tuple[str, str]:
        return self.tokens[self.position] if self.position < len(self.tokens) else ("end", "")

    def _next(self) -> tuple[str, str]:
        found = self._peek()
        self.position += 1
        return found

    def _product(self, depth: int) -> Unit:
        found = self._factor(depth)
        over_a_unit = False
        while True:
            kind, sign = self._peek()
            if sign in ("*", "/"):
                self._next()
            elif kind == "number":
                raise NotAQuantity(f"the number {sign} does not belong there; one number comes first, powers are m^2")
            elif not (kind == "unit" or sign == "("):
                return found
            if sign != "/" and over_a_unit:
                raise NotAQuantity("a product after a / is ambiguous; write for instance N/(m s) or N s/m")
            divisor_is_unit = self._peek()[0] == "unit" or self._peek()[1] == "("
            inverse = sign == "/"
            factor = self._factor(depth, inverse)
            if inverse:
                over_a_unit = over_a_unit or divisor_is_unit
                if factor.size == 0:
                    raise NotAQuantity("it divides by zero")
                factor = factor.power(Fraction(-1))
            found = found * factor

    def _factor(self, depth: int, inverse: bool = False) -> Unit:
        kind, word = self._next()
        if kind == "number":
            self.has_a_number = True
            found = Unit(_exactly(word), PLAIN.dimension)
            if depth == 0:  # numbers are kept apart from the unit
                if inverse and found.size == 0:
                    raise NotAQuantity("it divides by zero")
                self.number = self.number / found.size if inverse else self.number * found.size
                found = PLAIN
        elif kind == "unit":
            if word not in UNITS:
                raise (NoNumber if self.position == 1 else NotAQuantity)(unknown(word))
            self.names_a_unit = True
            found = UNITS[word]
        elif word == "(" and depth < 8:
            found = self._product(depth + 1)
            if self._next()[1] != ")":
                raise NotAQuantity("a bracket is not closed")
        else:
            raise NotAQuantity(f"{word!r} does not belong there" if word else "it ends too early")
        if self._peek()[1] in ("^", "**"):
            self._next()
            exponent = self._exponent()
            if kind == "number":
                raise NotAQuantity("a number to a power; write the number itself")
            if found.size == 0 and exponent <= 0:
                raise NotAQuantity("it divides by zero")
            if found.size < 0 and exponent.denominator != 1:
                raise NotAQuantity("a root of a negative number")
            found = found.power(exponent)
        return found

    def _exponent(self) -> Fraction:
        bracket = self._peek()[1] == "("
        if bracket:
            self._next()
        negative = self._peek()[1] == "-"
        if self._peek()[1] in ("+", "-"):
            self._next()
        found = self._whole()
        if bracket:
            if self._peek()[1] == "/":
                self._next()
                below = self._whole()
                if below == 0:
                    raise NotAQuantity("it divides by zero")
                found /= below
            if self._next()[1] != ")":
                raise NotAQuantity("a bracket is not closed")
        if found > _POWER:
            raise NotAQuantity(f"an exponent beyond {_POWER}")
        return -found if negative else found

    def _whole(self) -> Fraction:
        kind, word = self._next()
        if kind != "number":
            raise NotAQuantity("an exponent must be a number")
        found = _exactly(word)
        if found.denominator > 1000:
            raise NotAQuantity(f"the exponent {word}; use one with few digits")
        return found


def _exactly(digits: str) -> Fraction:
    """A decimal number without rounding."""
    try:
        number = Decimal(digits)
    except InvalidOperation:
        raise NotAQuantity(f"{digits} cannot be represented by a float") from None
    if number and abs(number.adjusted()) > _DIGITS:
        raise NotAQuantity(f"{digits} cannot be represented by a float")
    return Fraction(number)
