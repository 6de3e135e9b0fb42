"""User functions f(t, state) in the form in which the core calls them: f(t, q, v)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import EvaluationError
from ..state import Layout, StateView
from .checks import Array, Element, takes
from .travelling import check_picklable
from .values import Function, finite, one_number


class Callback:
    """A user function with the element it belongs to, not yet bound to a compiled model."""

    def __init__(self, element: Element, function: Callable[..., Any], size: int) -> None:
        self.element, self.function, self.size = element, function, size
        self.notes: list[str] = []

    def bind(self, layout: Layout) -> Callable[[float, Array, Array], Any]:
        """The function as called by the core. `layout` may be filled in later, but before the first call."""

        def call(t: float, q: Array, v: Array) -> Any:
            # the coordinates of joints that close loops follow those of the state
            n, m = len(layout.names), len(layout.velocity_names)
            more = n + len(v) - m
            state = StateView(t, q[:n], v[:m], layout, (q[n:more], v[m:]), q[more:])
            return self._result(t, self.function(t, state))

        return call

    def __getstate__(self) -> dict[str, Any]:
        check_picklable(self.element, "function", self.function)
        return self.__dict__

    def __deepcopy__(self, memo: dict[int, Any]) -> Callback:
        """With the same function: Python copies functions as themselves."""
        return Callback(self.element, self.function, self.size)

    def _result(self, t: float, value: Any) -> Any:
        """One finite number, or a list of three."""
        try:
            numbers = [one_number(value)] if self.size == 1 else [one_number(item) for item in value]
            if len(numbers) != self.size:
                raise TypeError(f"{len(numbers)} numbers")
        except TypeError as error:
            wanted = "one number" if self.size == 1 else "three numbers"
            raise self._error(t, f"the function must return {wanted}, not {error}") from error
        if not finite(numbers):
            raise self._error(t, f"the function returned {numbers if self.size > 1 else numbers[0]}")
        return numbers[0] if self.size == 1 else np.array(numbers)

    def _error(self, t: float, sentence: str) -> EvaluationError:
        name = self.element.name
        return EvaluationError(f'{self.element.kind} "{name}" at t = {t:g} s: {sentence}', t=t, where=name)


def number_of(element: Element) -> Callable[[Callable[..., Any]], Function]:
    """Wrapper for functions that return one number."""
    return lambda function: _called(element, function, 1)


def vector_of(element: Element) -> Callable[[Callable[..., Any]], Function]:
    """Wrapper for functions that return three numbers."""
    return lambda function: _called(element, function, 3)


def _called(element: Element, function: Callable[..., Any], size: int) -> Function:
    takes(element, "its function", function, "two arguments, t and the state", 2)
    return Function(Callback(element, function, size))
