"""Checks of arguments: the values given by the user become numbers, or an error with a next step.

Each function names the element it was called for, so that the message can: `Element("body", "crank")`.
"""

from __future__ import annotations

import difflib
import inspect
import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError, UnknownNameError
from ..numeric import shown, without_units
from ..units.door import SI, QuantityError, bare, in_si

Array = NDArray[np.float64]
LARGEST = 1e60
"""Numbers of a description beyond this are typing errors. Scale: SI units. Reason: products of five such numbers stay
finite."""


@dataclass(frozen=True)
class Element:
    """The subject of an error: kind "body", "joint", "force", "drive" or "mechanism", and its name."""

    kind: str
    name: str

    def fail(self, sentence: str, cause: BaseException | None = None) -> NoReturn:
        """Raise `DescriptionError`: 'body "crank": sentence'."""
        raise DescriptionError(f'{self.kind} "{self.name}": {sentence}', element=self.kind, name=self.name) from cause


def name_of(kind: str, name: Any, taken: Collection[str] = (), reserved: Collection[str] = ()) -> Element:
    """A usable name: text, not blank, without line breaks, not in `taken` (a dict or set), not in `reserved`."""
    element = Element(kind, str(name))
    if not isinstance(name, str):
        element.fail(f"a name must be text, not {type(name).__name__} {name!r}")
    if not name.strip() or name != name.strip() or not name.isprintable():
        element.fail(f"{name!r} cannot be a name; give printable text that neither starts nor ends with a space")
    if name in reserved:
        element.fail("this name is reserved; choose another one")
    if name in taken:
        element.fail(f"there is already a {kind} of this name; names must be unique among {_plural(kind)}")
    return element


def _plural(kind: str) -> str:
    return "bodies" if kind == "body" else kind + "s"


def takes(element: Element, what: str, function: Callable[..., Any], arguments: str, count: int) -> None:
    """Refuse a function that cannot be called with `count` arguments; `arguments` says which these are. The signature
    of a function written in C may be unknown."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(*range(count))
    except TypeError as error:
        element.fail(f"{what} is called with {arguments}, which it does not take ({error})", cause=error)


def find(kind: str, name: str, known: Collection[str], *more: str, where: str = "") -> str:
    """`name` if it is among `known` (a dict or set) or `more`; else `UnknownNameError` with the nearest name."""
    if name in known or name in more:
        return name
    names = [*known, *more]
    close = difflib.get_close_matches(str(name), names, n=1)
    hint = (
        f'did you mean "{close[0]}"?'
        if close
        else f"known {_plural(kind)}: {', '.join(names) if names else 'none yet'}"
    )
    raise UnknownNameError(f'{where}there is no {kind} "{name}"; {hint}', name=str(name), known=names)


def number(
    element: Element,
    what: str,
    value: Any,
    unit: SI = "",
    *,
    least: float | None = None,
    above: float | None = None,
) -> float:
    """A finite number, optionally `>= least` or `> above`, in its SI unit ("" if it has none)."""
    if type(value) is float:
        result = value
    else:
        array = numbers(element, what, value, unit)
        if array.ndim != 0:
            element.fail(f"{what} must be one number, not an array of shape {array.shape}")
        result = float(array)
    if not math.isfinite(result):
        element.fail(f"{what} is {result}; give a finite number")
    _in_range(element, what, abs(result))
    if least is not None and result < least:
        element.fail(f"{what} is {result:g}; it must be at least {least:g}")
    if above is not None and result <= above:
        element.fail(f"{what} is {result:g}; it must be greater than {above:g}")
    return result


def vector(element: Element, what: str, value: Any, unit: SI = "", size: int = 3) -> Array:
    """A finite vector of `size` numbers in their SI unit."""
    array = _finite(element, what, _vector(element, what, value, size, unit))
    _in_range(element, what, max(map(abs, array.tolist())))
    return array


def _vector(element: Element, what: str, value: Any, size: int, unit: SI = "") -> Array:
    array = numbers(element, what, value, unit)
    if array.shape != (size,):
        element.fail(f"{what} must be {size} numbers, not {_shape(array)}")
    return array


def matrix(element: Element, what: str, value: Any, unit: SI = "", size: int = 3) -> Array:
    """A finite matrix of `size` rows and columns in their SI unit."""
    array = numbers(element, what, value, unit)
    if array.shape != (size, size):
        element.fail(f"{what} must be a {size}x{size} matrix, not {_shape(array)}")
    _in_range(element, what, float(np.max(np.abs(_finite(element, what, array)))))
    return array


def _in_range(element: Element, what: str, size: float) -> None:
    """Refuse numbers whose products leave the range of double precision."""
    if size > LARGEST:
        element.fail(f"{what} contains {size:g}; magnitudes above {LARGEST:g} are not supported: use other units")


def along_an_axis(word: str) -> Array | None:
    """The unit vector along "x", "y" or "z", or against it: "-z"; None for another text."""
    axis = word.lstrip("+-")
    if len(word) - len(axis) > 1 or axis not in ("x", "y", "z"):
        return None
    size = -1.0 if word.startswith("-") else 1.0
    return np.array([size if axis == own else 0.0 for own in "xyz"])


def direction(element: Element, what: str, value: Any) -> Array:
    """A vector that is not zero, or "x", "-z" and the like; its length does not matter and is kept."""
    if isinstance(value, str):
        found = along_an_axis(value)
        if found is None:
            element.fail(f"{what} is {value!r}; give three numbers such as (0, 0, 1), or a direction such as '-z'")
        return found
    array = _finite(element, what, _vector(element, what, value, 3))
    size = max(map(abs, array.tolist()))
    if size == 0.0:
        element.fail(f"{what} is (0, 0, 0) and has no direction; give for instance (0, 0, 1)")
    return array if 1.0 / LARGEST < size < LARGEST else array / size


def index(element: Element, what: str, value: Any, size: int) -> int:
    """An integer in 0..size-1."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value < size:
        last = "0" if size == 1 else f"0 to {size - 1}"
        element.fail(f"{what} is {value!r}; it must be an integer, {last}")
    return int(value)


def choice(element: Element, what: str, value: Any, options: Iterable[str]) -> str:
    """One of `options`."""
    known = list(options)
    if not isinstance(value, str) or value not in known:
        close = difflib.get_close_matches(shown(value).strip("'"), known, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        element.fail(f"{what} is {shown(value)}; it must be one of {', '.join(map(repr, known))}{hint}")
    return str(value)


def switch(element: Element, what: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, bool | np.bool_):
        element.fail(f"{what} is {shown(value)}; it must be True or False")
    return bool(value)


def shape_of(value: Any) -> tuple[int, ...] | None:
    """Shape of a number or of nested sequences; None where rows differ in length."""
    try:
        return np.shape(bare(value))
    except ValueError:
        return None


def numbers(element: Element, what: str, value: Any, unit: SI = "") -> Array:
    """`value` as a new float array, in its SI unit."""
    try:
        return without_units(in_si(what, value, unit))
    except QuantityError as error:
        element.fail(str(error), cause=error)
    except TypeError as error:
        element.fail(f"{what} must be made of real numbers, not {shown(value)}", cause=error)


def _finite(element: Element, what: str, array: Array) -> Array:
    if not all(map(math.isfinite, array.ravel().tolist())):  # for a few numbers quicker than NumPy
        element.fail(f"{what} is {array.tolist()}; NaN and infinity are not allowed")
    return array


def _shape(array: Array) -> str:
    return "one number" if array.ndim == 0 else f"an array of shape {array.shape}"
