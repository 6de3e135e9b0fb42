"""Telling how far many runs have come."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any


class Progress:
    """Hands the fraction done of many runs on: to nobody, to a line on stderr, or to a function of 0 to 1."""

    def __init__(self, progress: Any, total: int) -> None:
        self._target: Any = progress
        self._total, self._done = total, -1

    def part(self, name: str) -> Callable[[float], None] | None:
        """What the next run calls with its own fraction."""
        self._done += 1
        if self._target is None or self._target is False:
            return None
        begun = self._done
        if self._target is True:
            sys.stderr.write(f"\r{begun + 1:>3} of {self._total}: {name:<40}")
            sys.stderr.flush()
            return None
        return lambda fraction: self._target((begun + min(max(fraction, 0.0), 1.0)) / self._total)

    def end(self) -> None:
        """Close the line."""
        if self._target is True:
            sys.stderr.write("\n")
            sys.stderr.flush()
        elif callable(self._target) and self._done + 1 >= self._total:
            self._target(1.0)
