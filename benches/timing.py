"""How calls are timed: several times, the fastest counts."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")


def fastest(
    call: Callable[[], T], patience: float = 1.0, least: int = 3, prepare: Callable[[], None] | None = None
) -> float:
    """Seconds of the fastest of several calls, after a first one that is not counted; `prepare` runs before each."""
    began, best, count = perf_counter(), float("inf"), -1
    while count < least or (perf_counter() - began < patience and count < 1000):
        if prepare is not None:
            prepare()
        start = perf_counter()
        call()
        took = perf_counter() - start
        count += 1
        if count > 0:
            best = min(best, took)
    return best


def once(call: Callable[[], T]) -> tuple[float, T]:
    """Seconds of one call, and what it returned."""
    start = perf_counter()
    found = call()
    return perf_counter() - start, found


def text(seconds: float) -> str:
    """A time in the unit that suits it."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1.0:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def against(found: float, aim: float) -> str:
    """A ratio with its aim; marked where it is missed, which is no failure: machines differ."""
    return f"{found:.3g} (aim: at most {aim:g}){'' if found <= aim else ' !'}"
