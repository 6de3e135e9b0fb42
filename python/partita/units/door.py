"""From quantities to numbers in SI: texts such as "250 mm" and the quantities of pint, alone and in lists.

One conversion, one rounding: 0.25, "250 mm", "25 cm" and a quantity of pint of 250 mm are the same float. Degrees and
turns are multiplied by the float nearest to their size, so that "30 deg" is `math.radians(30)`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Union

import numpy as np

from ..numeric import foreign, is_quantity, shown
from .table import NONE, PLAIN, UNITS, Dimension, Unit, called
from .text import NoNumber, NotAQuantity, quantity_of, unit_of

SI = Union[str, Sequence["SI"]]  # noqa: UP007, a type that names itself
"""The SI unit that is expected: one for all, or one for each entry along the first axis. "" is a number without
unit."""

_NUMBERS = frozenset({float, int, np.float64})


class QuantityError(TypeError):
    """A quantity that does not fit; the sentence states what was expected."""


def in_si(what: str, value: Any, unit: SI) -> Any:
    """`value` with every quantity in it as a float in SI; a value without quantities is returned unchanged."""
    kind = type(value)
    if kind in _NUMBERS:
        return value
    if kind is np.ndarray:
        return in_si(what, value.tolist(), unit) if value.dtype.kind in "OU" else value
    if isinstance(value, str):
        return _of_text(what, value, _one(unit))
    if is_quantity(value):
        return _of_pint(what, value, unit)
    if isinstance(value, (list, tuple)):
        if _NUMBERS.issuperset(map(type, value)):
            return value
        units: SI = [unit] * len(value) if isinstance(unit, str) else unit
        if len(units) != len(value):
            units = [_one(unit)] * len(value)  # the shape is wrong, which the later check reports
        new = [in_si(what, item, each) for item, each in zip(value, units, strict=True)]
        return value if all(a is b for a, b in zip(new, value, strict=True)) else new
    if (library := foreign(value)) is not None:
        raise QuantityError(
            f"{what} is a quantity of {library}, whose unit would be lost; give text such as '250 mm', a quantity of "
            "pint, or its number in SI"
        )
    return value


def bare(value: Any) -> Any:
    """`value` with its quantities replaced by their numbers, to determine its shape."""
    if is_quantity(value):
        return value.magnitude
    if isinstance(value, (list, tuple)) and not _NUMBERS.issuperset(map(type, value)):
        return [bare(item) for item in value]
    return value


def ratio(found: Unit, other: Unit) -> Fraction:
    """Size of one unit in another."""
    return found.size / other.size


def agree(wanted: Dimension, given: Dimension) -> bool:
    """Whether it is the same kind. A radian may be omitted where it does not distinguish rotation from anything else: N
    m for a torsional stiffness; never for an angle or an angular velocity, where 1/s might mean revolutions."""
    if wanted == given:
        return True
    return wanted[:3] == given[:3] and given[3] == 0 and (wanted[0] != 0 or wanted[1] != 0)


def _one(unit: SI) -> str:
    """The first unit of a list of units, or the unit itself."""
    while not isinstance(unit, str):
        unit = unit[0]
    return unit


def _of_text(what: str, text: str, unit: str) -> float:
    try:
        found = quantity_of(text)
    except NoNumber as error:
        example = f"2.5 {unit}" if unit else "2.5"
        more = f" or of texts with a unit such as {example!r}" if unit else ""
        raise QuantityError(f"{what} must be made of real numbers{more}, not {shown(text)}: {error}") from error
    except NotAQuantity as error:
        raise QuantityError(f"{what} is {shown(text)}, which cannot be read: {error}") from error
    if not found.named:
        if unit:
            raise QuantityError(
                f"{what} is {shown(text)}, a text without unit; write {text.strip() + ' ' + unit!r}, or the number"
            )
        raise QuantityError(f"{what} must be made of real numbers, not of the text {shown(text)}")
    _check(what, shown(text), found.unit.dimension, unit)
    return _float(what, shown(text), found.number, found.unit)


def _check(what: str, text: str, given: Dimension, unit: str) -> None:
    wanted = unit_of(unit).dimension if unit else NONE
    if not agree(wanted, given):
        bracket = f" [{unit}]" if unit else ""
        more = "; turns per second are rev/s" if wanted[3] != 0 and given == unit_of("1/s").dimension else ""
        raise QuantityError(f"{what} is {called(wanted)}{bracket}; {text} is {called(given)}{more}")


def _float(what: str, text: str, number: Fraction, unit: Unit) -> float:
    try:
        return unit.times(number)
    except OverflowError:
        raise QuantityError(f"{what} is {text}, which no float can represent") from None


def _of_pint(what: str, value: Any, unit: SI) -> Any:
    """A quantity of pint: its number times its unit, by the table here; by pint's own where it knows more units."""
    scale = _named(value)
    if scale is None:
        try:
            value = value.to_base_units()
            scale = _named(value)
        except Exception as error:  # whatever a unit without a base does
            raise QuantityError(f"{what} is {shown(value)}: {error}") from error
    if scale is None:
        raise QuantityError(f"{what} is {shown(value)}, whose unit is not known")
    return _scaled(what, value.magnitude, scale, unit, shown(str(value)))


def _named(value: Any) -> Unit | None:
    """The unit of a quantity of pint; None where it is not in the table."""
    items = value.unit_items() if hasattr(value, "unit_items") else dict(value._units).items()
    found = PLAIN
    for name, power in items:
        if name not in UNITS:
            return None
        found = found * UNITS[name].power(Fraction(str(power)))
    return found


def _scaled(what: str, number: Any, scale: Unit, unit: SI, text: str) -> Any:
    if np.ndim(number) > 0:
        rows = number.tolist() if isinstance(number, np.ndarray) else list(number)
        units = [unit] * len(rows) if isinstance(unit, str) else unit
        if len(units) != len(rows):
            units = [_one(unit)] * len(rows)
        return [_scaled(what, row, scale, each, text) for row, each in zip(rows, units, strict=True)]
    one = _one(unit)
    _check(what, text, scale.dimension, one)
    if isinstance(number, np.ndarray):
        number = number.item()
    try:
        if isinstance(number, (bool, np.bool_)):
            raise TypeError("a truth value")
        if isinstance(number, (float, np.floating)):
            if not math.isfinite(number):
                return float(number)
            number = Fraction(repr(float(number)))  # a float stands for the shortest decimal that gives it back
        exact = Fraction(int(number) if isinstance(number, np.integer) else number)
    except (TypeError, ValueError, OverflowError) as error:
        raise QuantityError(f"{what} is {text}, which is not made of real numbers ({error})") from error
    return _float(what, text, exact, scale)
