"""Words of the command line as values: numbers, quantities, lists, settings."""

from __future__ import annotations

import argparse
import math

from ..units.door import QuantityError, in_si
from ..units.text import NotAQuantity, quantity_of


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not finite")
    return value


def seconds(text: str) -> float:
    """A time above zero [s], or one with its unit."""
    try:
        value = float(text)
    except ValueError:
        try:
            value = in_si("it", text, "s")
        except QuantityError as error:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number: {error}") from None
    return positive(repr(value))


def ladder(text: str) -> list[float]:
    """Several numbers above zero, with commas."""
    return [positive(part) for part in text.split(",")]


def positive(text: str) -> float:
    """A finite number above zero."""
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not greater than zero")
    return value


def count(text: str) -> int:
    """Two or more."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if value < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is too few: the start and the end are two outputs")
    return value


def port(text: str) -> int:
    """A port of TCP; 0 is a free one."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if not 0 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port: they go from 0 to 65535")
    return value


def repeats(text: str) -> int:
    """One or more."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not at least 1")
    return value


def listed(text: str) -> list[str]:
    """Names with commas between them."""
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form A,B,C")
    return names


def pair(text: str) -> tuple[float, float]:
    """Two finite numbers with a comma between them."""
    values = [number(part) for part in text.split(",")]
    if len(values) != 2:
        raise argparse.ArgumentTypeError(f"{text!r} are not two numbers with a comma between them")
    return values[0], values[1]


def setting(text: str) -> tuple[str, list[float | str]]:
    """`JOINT=VALUE`; several values for a joint with several coordinates are separated by commas. Units are interpreted
    once the joint is known."""
    name, equals, values = text.rpartition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form JOINT=VALUE, such as A=0.5 or A=30deg")
    return name, [_number_or_quantity(value) for value in values.split(",")]


def _number_or_quantity(text: str) -> float | str:
    try:
        found = quantity_of(text)
    except NotAQuantity as error:
        try:
            return number(text)
        except argparse.ArgumentTypeError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number: {error}") from None
    return text if found.named else number(text)
