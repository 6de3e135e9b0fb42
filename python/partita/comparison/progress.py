"""Progress of many runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..progress import bar, checked, forward


class Progress:
    """Reports the completed fraction of many runs: not at all, to a bar on the terminal, or to a function of 0 to 1."""

    def __init__(self, progress: Any, total: int) -> None:
        self._target: Any = checked(progress)
        self._total, self._done, self._furthest = total, -1, 0.0
        self._bar: Any = bar(total, "runs") if progress is True else None

    def part(self, name: str) -> Callable[[float], None] | None:
        """Called by the next run with its own fraction."""
        self._done += 1
        if self._target is None or self._target is False:
            return None
        if self._bar is not None:
            self._bar.set_description(name)
        begun = self._done
        return lambda fraction: self._report((begun + min(max(fraction, 0.0), 1.0)) / self._total)

    def _report(self, part: float) -> None:
        # short runs are repeated
        part = self._furthest = max(self._furthest, part)
        if self._bar is not None:
            forward(self._bar, part)
        else:
            self._target(part)

    def end(self) -> None:
        """All runs are done, or were interrupted: the bar is closed."""
        if self._bar is not None:
            self._bar.close()
        elif callable(self._target) and self._done + 1 >= self._total:
            self._target(1.0)
