"""Runs that several tests look at: each is computed once in a session."""

from __future__ import annotations

from functools import cache
from typing import Any

import partita as pt
from partita.catalogue import Entry
from partita.results import Result

WITHOUT_EVENTS = [name for name in pt.catalogue.names() if not pt.catalogue.entry(name).has_events]
"""Entries that every analysis and every formulation takes; `test_holding` has the others."""


@cache
def entry_of(name: str, loops: int | None = None) -> Entry:
    """The entry `name` of the catalogue, with `loops` for chains."""
    return pt.catalogue.entry(name) if loops is None else pt.catalogue.entry(name, loops=loops)


@cache
def run_of(name: str, loops: int | None = None, **options: Any) -> Result:
    """The run of an entry from its start, with its own options unless others (hashable ones) are given."""
    result = entry_of(name, loops).simulate(**options)
    assert result.success, f"{name}: {result.message}"
    return result


def extent(result: Result) -> float:
    """Largest coordinate of any body at the start [m], at least 1."""
    return max(1.0, *(float(abs(result.body(name).position[0]).max()) for name in result.names.bodies))


def column(result: Result, joint: str) -> int:
    """Column of a joint's velocity in `result.v`."""
    about = next(item for item in result.summary["joints"] if item["name"] == joint)
    return int(about["state_v"][0])
