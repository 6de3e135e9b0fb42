"""Inputs changed by chance: each is read, or refused by a typed error; none ends the process."""

from __future__ import annotations

import damaged
import pytest
from thorough import either


@pytest.mark.parametrize("kind", sorted(damaged.kinds()))
def test_changed_inputs_are_read_or_refused(kind: str) -> None:
    """The same inputs on every machine; in `make trust` more."""
    count = either(6, 100)
    counts, wrong = damaged.examined([kind], count, seed=58)
    assert not wrong, "\n\n".join(wrong)
    assert counts[kind]["read"] + counts[kind]["refused"] == count
