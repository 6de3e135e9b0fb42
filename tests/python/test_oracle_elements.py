"""Couplings, sensors and model files by chance against independent programs; `make trust` looks at thousands more."""

from __future__ import annotations

import importlib.util
import warnings
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest
from oracle import chance, files
from oracle.comparison import Verdict
from oracle.coupled import compare_coupled, plain
from oracle.sensors import compare_sensors

COUPLED, SENSED, READ = range(60), range(45), range(30)
FOUND_ONCE = (344, 375, 809, 941, 1099)
"""Couplings on universal joints whose axes are not perpendicular, in redundant mechanisms."""


def together(verdicts: Iterable[tuple[int, Verdict]]) -> Counter[str]:
    """What was counted; nothing may be wrong."""
    counts, wrong = Counter[str](), list[str]()
    for seed, verdict in verdicts:
        counts += verdict.counts
        wrong += [f"{seed}: {line}" for line in verdict.wrong[:3]]
    assert not wrong, "\n".join(wrong[:20])
    return counts


def test_coupled_mechanisms_agree() -> None:
    found = {seed: compare_coupled(seed) for seed in (*COUPLED, *FOUND_ONCE)}
    counts = together((seed, verdict) for seed, (verdict, _) in found.items())
    kinds = sum((kinds for _, kinds in found.values()), Counter[str]())
    assert min(kinds[kind] for kind in ("sum", "gear", "belt", "rack", "distance", "measures", "cam", "ball")) > 5, (
        kinds
    )
    assert counts["relative run"] > 50 and counts["absolute run"] > 50 and counts["effort"] > 200, counts


def test_sensors_agree() -> None:
    """Rates and second derivatives against differences of positions; powers against what the bodies gain."""
    counts = together((seed, compare_sensors(chance.mechanism(seed))) for seed in SENSED)
    assert counts["instants"] > 90 and counts["power balance"] == counts["instants"]
    for what in ("point", "origin", "distance", "along", "cosine", "expression", "turning", "reaction"):
        assert counts[f"sensor {what}"] > 200, what
    for what in ("spring force", "load power", "effort", "torsion energy", "drive power", "function"):
        assert counts[f"sensor {what}"] > 5, what


@pytest.mark.parametrize("suffix", files.FORMATS)
def test_files_are_read_as_their_numbers_say(suffix: str, tmp_path: Path) -> None:
    if suffix == ".mjcf" and importlib.util.find_spec("mujoco") is None:
        pytest.skip("MuJoCo serves Python 3.11 and newer")
    counts = together((seed, files.compare_file(seed, suffix, tmp_path)) for seed in READ)
    assert counts["inertia"] > 60 and counts["kinetic energy"] > 20


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf"])
def test_written_files_say_what_was_drawn(suffix: str, tmp_path: Path) -> None:
    def written(seed: int) -> Verdict:
        return files.compare_written(files.replace(plain(seed), forces=()), suffix, tmp_path)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a format cannot carry is expected here
        counts = together((seed, written(seed)) for seed in READ)
    assert counts["inertia as drawn"] > 60


def test_native_files_say_the_same_to_the_last_digit(tmp_path: Path) -> None:
    counts = together((seed, files.compare_toml(plain(seed), tmp_path)) for seed in READ)
    assert counts["native files"] > 20
