"""The limit: programs made by hand for one mechanism each, compiled here with the C compiler that is there.

`limit/four_bar.c` and `limit/chain.c` know their mechanism and nothing else: minimal coordinates, loops in closed form,
no memory that grows; the positions of a chain follow one after the other. The fixed figures are those of programs that
are vectorised by hand throughout, measured elsewhere on a quiet machine; they stand where there is no compiler, and
beside the measured ones where there is.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from partita.catalogue.four_bar import CRANK
from partita.catalogue.n_four_bar import lean

SOURCES = Path(__file__).with_name("limit")
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd", "-std=gnu11")


@dataclass(frozen=True)
class Figure:
    """A limit: of the run and of one evaluation; `error` is that of the first angle at the end, if it was measured."""

    seconds: float
    per_evaluation: float
    error: float | None = None
    evaluations: int | None = None


FIXED = {
    "four-bar": Figure(0.24e-3, 45e-9),
    "chain N = 40": Figure(0.55e-3, 0.27e-6),
    "chain N = 1000": Figure(17e-3, 9.7e-6),
    "Andrews' squeezer": Figure(0.12e-3, 77e-9),
}
"""10 s runs (Andrews 0.03 s) at rtol 1e-10 with DOP853."""

PROGRAMS = {"four-bar": ("four_bar",), "chain N = 40": ("chain", "40"), "chain N = 1000": ("chain", "1000")}


def compiled(folder: Path) -> dict[str, Path]:
    """The programs, built into `folder`; empty where there is no C compiler or it cannot build them."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    built = {}
    for name in ("four_bar", "chain"):
        command = [compiler, *FLAGS, "-o", str(folder / name), str(SOURCES / f"{name}.c"), "-lm"]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            built[name] = folder / name
    return built


def measured(folder: Path) -> dict[str, Figure]:
    """What the programs need on this machine."""
    built = compiled(folder)
    return {
        title: _run(title, [str(built[name]), *words]) for title, (name, *words) in PROGRAMS.items() if name in built
    }


def _run(title: str, command: list[str]) -> Figure:
    reported = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    if title == "four-bar":
        error = abs(reported["angle"] - CRANK[10.0][0])
    else:
        # the catalogue counts the lean from the upright, clockwise
        lean_then = float(lean(int(command[1]), np.array([0.0, 10.0]))[-1])
        error = abs(math.remainder(math.pi / 2.0 - reported["angle"] - lean_then, 2.0 * math.pi))
    evaluations = int(reported["evaluations"])
    return Figure(reported["seconds"], reported["seconds"] / evaluations, error, evaluations)
