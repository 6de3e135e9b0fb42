"""How much costly tests look at: in `make test` a part, with PARTITA_THOROUGH=1, as in `make trust`, everything."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import combinations, product
from typing import Any, TypeVar

THOROUGH = bool(os.environ.get("PARTITA_THOROUGH"))
T = TypeVar("T")


def either(few: T, everything: T) -> T:
    """What a test looks at in `make test`, and in `make trust`."""
    return everything if THOROUGH else few


def pairs(*axes: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Cases of a product of `axes` in which every two values of two axes meet; in `make trust` the whole product."""
    every = list(product(*axes))
    if THOROUGH:
        return every
    found: list[tuple[Any, ...]] = []
    met: set[tuple[int, Any, int, Any]] = set()

    def new(case: tuple[Any, ...]) -> set[tuple[int, Any, int, Any]]:
        return {(i, case[i], j, case[j]) for i, j in combinations(range(len(case)), 2)} - met

    while True:
        best = max(every, key=lambda case: len(new(case)))
        if not new(best):
            return found
        found.append(best)
        met |= new(best)
