"""User functions in other processes."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

from .checks import Element


def check_picklable(element: Element, what: str, function: Callable[..., Any] | None) -> None:
    """`DescriptionError` that names the function, unless Python can pickle it."""
    if function is None:
        return
    try:
        pickle.dumps(function)
    except Exception as error:
        element.fail(
            f"its {what} {_name_of(function)} cannot be pickled ({error}); define it at the top level of a module "
            "(no lambda, no function inside a function), or give a table",
            cause=error,
        )


def _name_of(function: Callable[..., Any]) -> str:
    name = getattr(function, "__qualname__", None) or repr(function)
    return f"{getattr(function, '__module__', None) or '?'}.{name}"
