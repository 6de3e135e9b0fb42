"""Ctrl-C on the command line: the results up to then are shown and written."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from ..errors import Interrupted

Answer = TypeVar("Answer")


def so_far(computed: Callable[[], Answer]) -> Answer:
    """The result of `computed`, or the part that existed when Ctrl-C ended it."""
    try:
        return computed()
    except Interrupted as stopped:
        answer: Answer = stopped.result
        return answer
