"""Sensors on mechanisms drawn by chance against differences of positions and against the forces of the drawing."""

from __future__ import annotations

from oracle import chance
from oracle.sensors import compare_sensors
from oracle.study import together

SEEDS = (*range(9), *range(11, 15), 27)
"""27 is driven, which few are; `make trust` looks at thousands more."""


def test_sensors_agree() -> None:
    """Rates and second derivatives against differences of positions; powers against what the bodies gain."""
    counts = together((seed, compare_sensors(chance.mechanism(seed))) for seed in SEEDS)
    assert counts["instants"] > 2 * len(SEEDS) and counts["power balance"] == counts["instants"]
    for what in ("point", "origin", "distance", "along", "cosine", "expression", "turning", "reaction"):
        assert counts[f"sensor {what}"] > 5 * len(SEEDS), what
    for what in ("spring force", "load power", "effort", "torsion energy", "drive power", "function"):
        assert counts[f"sensor {what}"] > 5, what
