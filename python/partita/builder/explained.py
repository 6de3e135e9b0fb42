"""Calls with arguments that a method does not take: the message names what it takes."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable
from typing import Any

INSTEAD = {
    "parent": ("body1",),
    "child": ("body2",),
    "body1": ("parent",),
    "body2": ("child",),
    "direction": ("axis",),
    "position": ("point",),
    "speed": ("velocity", "rates"),
    "dt": ("t_eval",),
    "steps": ("t_eval",),
    "outputs": ("t_eval",),
    "t_end": ("duration",),
    "t_final": ("duration",),
    "time": ("duration", "t"),
    "positions": ("targets",),
    "velocities": ("rates",),
    "state": ("initial", "near", "at"),
    "start": ("initial", "near", "at"),
    "tolerance": ("rtol",),
    "solver": ("method",),
    "integrator": ("method",),
}
"""Words that mean another argument, where the method has that one."""


def explain(owner: type, *names: str) -> None:
    """Let methods of a class, all `add_...` where none is named, answer an unknown keyword by the one that was probably
    meant."""
    for name in names or (name for name in dir(owner) if name.startswith("add_")):
        setattr(owner, name, _explained(getattr(owner, name)))


def _explained(method: Callable[..., Any]) -> Callable[..., Any]:
    known = list(inspect.signature(method).parameters)[1:]

    @functools.wraps(method)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return method(*args, **kwargs)
        except TypeError:
            unknown = next((word for word in kwargs if word not in known), None)
            if unknown is None:
                raise
        likely = [*INSTEAD.get(unknown, ()), *(word for word in known if word.startswith(unknown))]
        near = [word for word in likely if word in known] or difflib.get_close_matches(unknown, known, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise TypeError(f"{method.__name__}() has no argument {unknown!r}; {hint}it takes {', '.join(known)}")

    return call
