"""The limit: programs made by hand for one mechanism each, compiled here with the C compiler that is there.

`limit/four_bar.c`, `limit/chain.c` and `limit/andrews.c` know their mechanism and nothing else: minimal coordinates,
loops in closed form, no memory that grows; the positions of a chain follow one after the other. Nothing is stored: they
are built and run beside what they are compared with.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from partita.catalogue.andrews import ANGLES
from partita.catalogue.four_bar import CRANK
from partita.catalogue.n_four_bar import lean

SOURCES = Path(__file__).with_name("limit")
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd", "-std=gnu11")


@dataclass(frozen=True)
class Figure:
    """A limit: seconds of the run (10 s, Andrews 0.03 s, DOP853 at rtol 1e-10), evaluations in it, seconds of one
    evaluation alone, and the error of the first angle at the end."""

    seconds: float
    evaluations: int
    alone: float
    error: float


PROGRAMS = {
    "four-bar": ("four_bar",),
    "Andrews' squeezer": ("andrews",),
    "chain N = 40": ("chain", "40"),
    "chain N = 1000": ("chain", "1000"),
}


def compiled(folder: Path) -> dict[str, Path]:
    """The programs, built into `folder`; empty where there is no C compiler or it cannot build them."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    built = {}
    for name in sorted({words[0] for words in PROGRAMS.values()}):
        command = [compiler, *FLAGS, "-o", str(folder / name), str(SOURCES / f"{name}.c"), "-lm"]
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            built[name] = folder / name
    return built


def commands(folder: Path) -> dict[str, list[str]]:
    """How to run the programs that could be built."""
    built = compiled(folder)
    return {title: [str(built[name]), *words] for title, (name, *words) in PROGRAMS.items() if name in built}


def measured(folder: Path) -> dict[str, Figure]:
    """What the programs need on this machine."""
    return {title: figure(title, command) for title, command in commands(folder).items()}


def at_once(folder: Path, copies: int) -> float | None:
    """How much work that many copies of the four-bar program do side by side, in that of one alone: their number where
    the machine has a core for each; None without a C compiler."""
    command = commands(folder).get("four-bar")
    if command is None:
        return None

    def seconds(count: int) -> float:
        running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(count)]
        return max(json.loads(one.communicate()[0])["seconds"] for one in running)

    return copies * min(seconds(1) for _ in range(3)) / min(seconds(copies) for _ in range(3))


def figure(title: str, command: list[str]) -> Figure:
    """One run of a program, which repeats its march for 0.3 s and takes the fastest."""
    reported = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    if title == "four-bar":
        error = abs(reported["angle"] - CRANK[10.0][0])
    elif title == "Andrews' squeezer":
        error = abs(reported["angle"] - ANGLES["beta"])
    else:
        # the catalogue counts the lean from the upright, clockwise
        lean_then = float(lean(int(command[1]), np.array([0.0, 10.0]))[-1])
        error = abs(math.remainder(math.pi / 2.0 - reported["angle"] - lean_then, 2.0 * math.pi))
    return Figure(reported["seconds"], int(reported["evaluations"]), reported["evaluation"], error)
