"""Runs of segments beside a program that decides what holds by looking at every combination; `make trust` has more."""

from __future__ import annotations

import pytest
from holding import trial
from thorough import either

FEW = (0, 1, 2, 3, 5, 6, 7, 9)


@pytest.mark.parametrize("number", either(FEW, range(40)))
def test_what_holds_is_what_every_combination_says(number: int) -> None:
    seen = trial(number)
    assert seen.word not in ("differs", "breaks a law", "refused"), seen
    assert seen.word != "ended" or "singular" in seen.why or "cannot" in seen.why or "in the way" in seen.why, seen
