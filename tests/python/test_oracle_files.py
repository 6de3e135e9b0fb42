"""Model files drawn by chance against small programs that evaluate their numbers; what is written, by the same."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from oracle import files
from oracle.comparison import Verdict
from oracle.coupled import plain
from oracle.study import together

SEEDS = range(30)


@pytest.mark.parametrize("suffix", files.FORMATS)
def test_files_are_read_as_their_numbers_say(suffix: str, tmp_path: Path) -> None:
    if suffix == ".mjcf" and importlib.util.find_spec("mujoco") is None:
        pytest.skip("MuJoCo serves Python 3.11 and newer")
    counts = together((seed, files.compare_file(seed, suffix, tmp_path)) for seed in SEEDS)
    assert counts["inertia"] > 60 and counts["kinetic energy"] > 20


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf"])
def test_written_files_say_what_was_drawn(suffix: str, tmp_path: Path) -> None:
    def written(seed: int) -> Verdict:
        return files.compare_written(replace(plain(seed), forces=()), suffix, tmp_path)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a format cannot carry is expected here
        counts = together((seed, written(seed)) for seed in SEEDS)
    assert counts["inertia as drawn"] > 60


def test_native_files_say_the_same_to_the_last_digit(tmp_path: Path) -> None:
    counts = together((seed, files.compare_toml(plain(seed), tmp_path)) for seed in SEEDS)
    assert counts["native files"] > 20
