"""What a call may use and return."""

from __future__ import annotations

from dataclasses import dataclass

SECONDS, MEGABYTES = 30.0, 2048
"""Defaults of the two limits that the command line sets."""

LEAST = 512
"""Megabytes below which a call may fail before it has begun: Python, NumPy, SciPy and Matplotlib take some 400."""

TEXT = 1_000_000
"""Characters of a model given as text: some ten thousand bodies."""

FILE = 20_000_000
"""Bytes of a model file, and of what an export writes."""

ANSWER = 1_000_000
"""Bytes of an answer: more fills the context of an assistant without being read."""

OUTPUTS, MEMBERS, NAMES = 5001, 200, 200
"""Outputs of a run, members of a sweep, entries of a listing."""

CALLS = 2
"""Calls computed at the same time; others wait."""


@dataclass(frozen=True)
class Limits:
    """Wall time [s] and memory [MB] of one call."""

    seconds: float = SECONDS
    megabytes: int = MEGABYTES
