"""Ctrl-C on the command line: what was computed until then is shown and written all the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ..errors import Interrupted

Answer = TypeVar("Answer")


def so_far(computed: Callable[[], Answer]) -> Answer:
    """What `computed` returns, or what it had when Ctrl-C ended it."""
    try:
        return computed()
    except Interrupted as stopped:
        answer: Answer = stopped.result
        return answer
