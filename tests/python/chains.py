"""`python -m chains`: chains of four-bars through the positions in which all links are in line, at every tolerance.

A chain has one equation of motion, which is integrated on its own (`lean`); the angle of its first upright is held
against that. An error may be a hundred times the tolerance and what the motion makes of it, as two tight runs show
that start beside each other.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

import partita as pt
from partita.catalogue.n_four_bar import lean, start

LOOPS = (2, 5, 10, 20, 40, 100, 200, 1000)
TOLERANCES = tuple(10.0**-i for i in range(3, 13))
TIMES: NDArray[np.float64] = np.linspace(0.0, 10.0, 101)
NUDGE = 1e-8
ALLOWED = 100.0


@cache
def growth(loops: int) -> float:
    """How much larger a small change of the initial rate is at the end, at most, in the angle."""
    m = pt.catalogue.load("n-four-bar", loops=loops)
    ends = []
    for rate in (-1.0, -1.0 * (1.0 + NUDGE)):
        run = m.simulate(10.0, initial=m.assemble(rates={"P0": rate}), t_eval=TIMES, rtol=1e-11, atol=1e-13)
        assert run.success, run.message
        ends.append(run.joint("P0").position[:, 0])
    return max(1.0, float(np.abs(ends[1] - ends[0]).max()) / NUDGE)


def trial(loops: int, rtol: float) -> tuple[float, str]:
    """The error over tolerance and growth, and what is wrong, if anything."""
    m = pt.catalogue.load("n-four-bar", loops=loops)
    run = m.simulate(10.0, initial=start(m), t_eval=TIMES, rtol=rtol, atol=rtol / 100)
    if not run.success:
        return float("inf"), run.message
    error = float(np.abs(-run.joint("P0").position[:, 0] - lean(loops, TIMES)).max()) / rtol / growth(loops)
    return error, "" if error <= ALLOWED else "off"


def main(loops: Sequence[int]) -> int:
    """Print a line for each chain; 1 if a run does not end or is off."""
    bad = 0
    for n in loops:
        found = [trial(n, rtol) for rtol in TOLERANCES]
        bad += sum(bool(wrong) for _, wrong in found)
        errors = " ".join(f"{error:8.2g}" for error, _ in found)
        print(f"N = {n:4d}, growth {growth(n):7.1f}: error in tolerances and growth {errors}", flush=True)
        for rtol, (_, wrong) in zip(TOLERANCES, found, strict=True):
            if wrong not in ("", "off"):
                print(f"    {rtol:.0e}: {wrong}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main([int(x) for x in sys.argv[1:]] or LOOPS))
