"""FMUs of mechanisms drawn by chance say what runs of the same mechanisms do."""

from __future__ import annotations

from pathlib import Path

import pytest
from oracle.fmus import compare_fmu
from oracle.study import together

from partita.io import fmu as archive
from partita.io.fmu_description import VERSIONS

if not list(archive.BINARIES.glob("*partita_fmu*")):
    pytest.skip("the binary for FMUs is not built (make fmu)", allow_module_level=True)

SEEDS = range(12)


@pytest.mark.filterwarnings("ignore::partita.errors.SuspectResultWarning")
def test_fmus_step_as_runs_do(tmp_path: Path) -> None:
    """Coordinates, rates, reactions and energies after each step; a torque changes from one to the next."""

    def stepped(seed: int):  # type: ignore[no-untyped-def]
        (folder := tmp_path / str(seed)).mkdir()
        return compare_fmu(seed, folder)

    counts = together((seed, stepped(seed)) for seed in SEEDS)
    assert min(counts[f"FMI {version}"] for version in VERSIONS) >= 3
    assert counts["FMUs"] >= 8 and counts["steps"] >= 3 * counts["FMUs"], counts
    assert min(counts[f"FMU {part}"] for part in ("position", "velocity", "force", "moment")) > 200, counts
