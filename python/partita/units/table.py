"""The units that are known: their exact size in SI and their dimension.

A unit is a product of powers of metre, kilogram, second and radian, times a size. Sizes are fractions; pi has sixty
digits. The radian counts as a dimension of its own: so angular velocities are distinguished from frequencies, which
differ by an easily forgotten factor of 2 pi.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction

Dimension = tuple[Fraction, Fraction, Fraction, Fraction]
"""Exponents of length, mass, time and angle."""

PI = Fraction(Decimal("3.14159265358979323846264338327950288419716939937510582097494459"))
_DIGITS = Context(prec=60)
_BASE = ("m", "kg", "s", "rad")
NONE: Dimension = (Fraction(0), Fraction(0), Fraction(0), Fraction(0))


@dataclass(frozen=True)
class Unit:
    """A unit: `size` in SI, `dimension`; `rounded`: its size is not a fraction."""

    size: Fraction
    dimension: Dimension
    rounded: bool = False

    def __mul__(self, other: Unit) -> Unit:
        a, b = self.dimension, other.dimension
        sums = (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3])
        return Unit(self.size * other.size, sums, self.rounded or other.rounded)

    def power(self, exponent: Fraction) -> Unit:
        """The unit to a power. A root of a size that is not a square has sixty digits."""
        if exponent.denominator == 1:
            size = self.size ** int(exponent)
        else:
            base = _DIGITS.divide(Decimal(self.size.numerator), Decimal(self.size.denominator))
            raised = _DIGITS.divide(Decimal(exponent.numerator), Decimal(exponent.denominator))
            size = Fraction(_DIGITS.power(base, raised))
        a, b, c, d = self.dimension
        dimension = (a * exponent, b * exponent, c * exponent, d * exponent)
        return Unit(size, dimension, self.rounded or exponent.denominator != 1)

    def times(self, number: Fraction) -> float:
        """This many of them in SI: exact, then rounded once; where pi is part of the size, that is rounded before, as
        `math.radians` does."""
        return float(number) * float(self.size) if self.rounded else float(number * self.size)


PLAIN = Unit(Fraction(1), NONE)


def _unit(size: str | Fraction | int, length: int = 0, mass: int = 0, time: int = 0, angle: int = 0) -> Unit:
    return Unit(Fraction(size), (Fraction(length), Fraction(mass), Fraction(time), Fraction(angle)))


def _turn(size: Fraction, time: int = 0) -> Unit:
    return Unit(size, (Fraction(0), Fraction(0), Fraction(time), Fraction(1)), rounded=True)


_PREFIXES = {"n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
_LONG = {"nano": -9, "micro": -6, "milli": -3, "centi": -2, "kilo": 3, "mega": 6, "giga": 9}
_POUND, _STANDARD = Fraction("0.45359237"), Fraction("9.80665")

# symbol, prefixes that go with it, words, long prefixes allowed, unit
_METRIC: list[tuple[str, str, tuple[str, ...], Unit]] = [
    ("m", "nuµμmck", ("metre", "meter"), _unit(1, 1)),
    ("g", "uµμmk", ("gram",), _unit("1/1000", 0, 1)),
    ("s", "nuµμm", ("second",), _unit(1, 0, 0, 1)),
    ("rad", "uµμm", ("radian",), _unit(1, 0, 0, 0, 1)),
    ("Hz", "kM", ("hertz",), _unit(1, 0, 0, -1)),
    ("N", "uµμmkM", ("newton",), _unit(1, 1, 1, -2)),
    ("J", "mkM", ("joule",), _unit(1, 2, 1, -2)),
    ("W", "mkM", ("watt",), _unit(1, 2, 1, -3)),
    ("Pa", "kMG", ("pascal",), _unit(1, -1, 1, -2)),
]
_OTHERS: list[tuple[tuple[str, ...], Unit]] = [
    (("in", "inch", "inches"), _unit("0.0254", 1)),
    (("ft", "foot", "feet"), _unit("0.3048", 1)),
    (("yd", "yard", "yards"), _unit("0.9144", 1)),
    (("t", "tonne", "tonnes", "metric_ton"), _unit(1000, 0, 1)),
    (("lb", "lbs", "pound", "pounds"), _unit(_POUND, 0, 1)),
    (("oz", "ounce", "ounces"), _unit(_POUND / 16, 0, 1)),
    (("slug", "slugs"), _unit(_POUND * _STANDARD / Fraction("0.3048"), 0, 1)),
    (("min", "minute", "minutes"), _unit(60, 0, 0, 1)),
    (("h", "hour", "hours"), _unit(3600, 0, 0, 1)),
    (("deg", "degree", "degrees", "°"), _turn(PI / 180)),
    (("rev", "turn", "turns", "revolution", "revolutions"), _turn(2 * PI)),
    (("rpm", "revolutions_per_minute"), _turn(PI / 30, -1)),
    (("lbf", "force_pound", "pound_force"), _unit(_POUND * _STANDARD, 1, 1, -2)),
    (("kgf", "kilogram_force", "force_kilogram"), _unit(_STANDARD, 1, 1, -2)),
    (("psi",), _unit(_POUND * _STANDARD / Fraction("0.0254") ** 2, -1, 1, -2)),
    (("bar",), _unit(100_000, -1, 1, -2)),
    (("g_n", "standard_gravity"), _unit(_STANDARD, 1, 0, -2)),
    (("Nm",), _unit(1, 2, 1, -2)),
    (("kNm",), _unit(1000, 2, 1, -2)),
    (("Nmm",), _unit("1/1000", 2, 1, -2)),
    (("Ns",), _unit(1, 1, 1, -1)),
]


def _all() -> dict[str, Unit]:
    found: dict[str, Unit] = {}
    for symbol, prefixes, words, unit in _METRIC:
        for prefix, power in [("", 0), *((p, _PREFIXES[p]) for p in prefixes)]:
            found[prefix + symbol] = Unit(unit.size * Fraction(10) ** power, unit.dimension)
        for word in words:
            for prefix, power in [("", 0), *_LONG.items()]:
                scaled = Unit(unit.size * Fraction(10) ** power, unit.dimension)
                found[prefix + word] = scaled
                if word != "hertz":
                    found[f"{prefix}{word}s"] = scaled
    found.update({name: unit for names, unit in _OTHERS for name in names})
    return found


UNITS = _all()
"""By symbol and by word."""

_SHORT = [name for name in UNITS if len(name) <= 4]

_KINDS: list[tuple[str, str, tuple[int, int, int, int]]] = [
    ("a length", "m", (1, 0, 0, 0)),
    ("a mass", "kg", (0, 1, 0, 0)),
    ("a time", "s", (0, 0, 1, 0)),
    ("an angle", "rad", (0, 0, 0, 1)),
    ("a velocity", "m/s", (1, 0, -1, 0)),
    ("an acceleration", "m/s^2", (1, 0, -2, 0)),
    ("an angular velocity", "rad/s", (0, 0, -1, 1)),
    ("an angular acceleration", "rad/s^2", (0, 0, -2, 1)),
    ("a frequency", "1/s", (0, 0, -1, 0)),
    ("a force", "N", (1, 1, -2, 0)),
    ("a torque", "N m", (2, 1, -2, 0)),
    ("a stiffness", "N/m", (0, 1, -2, 0)),
    ("a torsional stiffness", "N m/rad", (2, 1, -2, -1)),
    ("a damping", "N s/m", (0, 1, -1, 0)),
    ("a torsional damping", "N m s/rad", (2, 1, -1, -1)),
    ("a moment of inertia", "kg m^2", (2, 1, 0, 0)),
    ("a compliance", "m/N", (0, -1, 2, 0)),
    ("a torsional compliance", "rad/(N m)", (-2, -1, 2, 1)),
    ("a power", "W", (2, 1, -3, 0)),
    ("a pressure", "Pa", (-1, 1, -2, 0)),
    ("an area", "m^2", (2, 0, 0, 0)),
    ("a volume", "m^3", (3, 0, 0, 0)),
]
WORDS: dict[Dimension, tuple[str, str]] = {
    (Fraction(a), Fraction(b), Fraction(c), Fraction(d)): (word, unit) for word, unit, (a, b, c, d) in _KINDS
}
"""Name of a dimension, and its unit."""


def called(dimension: Dimension) -> str:
    """The name of a quantity of this dimension in messages: "a mass"."""
    if dimension == NONE:
        return "a number without unit"
    if dimension in WORDS:
        return WORDS[dimension][0]
    return f"a quantity in {written(dimension)}"


def written(dimension: Dimension) -> str:
    """Its SI unit."""
    if dimension in WORDS:
        return WORDS[dimension][1]
    parts = [
        base if power == 1 else f"{base}^{power}" for base, power in zip(_BASE, dimension, strict=True) if power != 0
    ]
    return " ".join(parts) or "1"


def unknown(name: str) -> str:
    """The hint for an unknown unit."""
    lower = {known.lower(): known for known in UNITS}
    close = [lower[name.lower()]] if name.lower() in lower else difflib.get_close_matches(name, UNITS, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(map(repr, close))}?" if close else f"known are {', '.join(sorted(_SHORT)[:60])}"
    return f"there is no unit {name!r}; {hint}"
