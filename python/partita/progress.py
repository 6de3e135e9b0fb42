"""Progress of a run, a sweep or a comparison: a bar on the terminal, or a function of the fraction done."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from .errors import ArgumentError
from .extras import extra

ReportProgress = Callable[[float], None]

_BAR = (
    "{desc}{percentage:3.0f} %|{bar}| {n:.4g} of {total:.4g} {unit}, {elapsed} gone, {remaining} left, {rate_noinv_fmt}"
)


def checked(progress: Any) -> Any:
    """`progress` when it is one of True, False, None and a function; True needs tqdm."""
    if progress is True:
        extra("tqdm", "progress", "progress=True")
    elif progress is not None and progress is not False and not callable(progress):
        raise ArgumentError(
            f"progress must be True, False or a function of the fraction done, not {progress!r}",
            argument="progress",
        )
    return progress


def has_bars() -> bool:
    """Whether tqdm is installed, for a command that draws a bar by default."""
    return importlib.util.find_spec("tqdm") is not None


@contextmanager
def reporting(progress: Any, total: float, unit: str, title: str = "") -> Iterator[ReportProgress | None]:
    """What is called with the part done, 0 to 1: nothing, the user's function, or a bar of `total` in `unit`.

    The bar shows the rate and the remaining time, and disappears at the end. It shows on a terminal and in a
    notebook; in a log there is nothing of it.
    """
    checked(progress)
    if progress is not True:
        yield progress if callable(progress) else None
        return
    with bar(total, unit, title) as shown:
        yield lambda part: forward(shown, part)


def bar(total: float, unit: str, title: str = "") -> Any:
    """tqdm's bar, which is also a context."""
    tqdm = extra("tqdm", "progress", "progress=True").tqdm
    seen = sys.stderr.isatty() or "ipykernel" in sys.modules
    return tqdm(
        total=total, unit=unit, desc=title or None, bar_format=_BAR, leave=False, disable=not seen, file=sys.stderr
    )


def forward(shown: Any, part: float) -> None:
    """Move a bar to the part done."""
    if shown.total:
        shown.update(min(max(part, 0.0), 1.0) * shown.total - shown.n)
