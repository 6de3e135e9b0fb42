"""Inputs changed by chance: each is read, or refused by a typed error; none ends the process."""

from __future__ import annotations

import damaged
import pytest
from thorough import either

GROUPS = {
    "models": ["toml", "urdf", "sdf", "mjcf", "yaml", "usda", "usdc"],
    "results and stores": ["json", "csv", "mat", "nc", "zarr", "parquet", "ensemble", "sweep"],
    "servers": ["drawing", "mcp"],
}


def test_every_kind_is_in_a_group() -> None:
    assert set(damaged.kinds()) <= {kind for group in GROUPS.values() for kind in group}


@pytest.mark.parametrize("group", GROUPS)
def test_changed_inputs_are_read_or_refused(group: str) -> None:
    """The same inputs on every machine; in `make trust` more."""
    known = damaged.kinds()
    names, count = [kind for kind in GROUPS[group] if kind in known], either(8, 100)
    counts, wrong = damaged.examined(names, count, seed=58, at_once=len(names))
    assert not wrong, "\n\n".join(wrong)
    assert all(counts[kind]["read"] + counts[kind]["refused"] == count for kind in names)
