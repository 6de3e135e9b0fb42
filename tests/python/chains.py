"""`python -m chains`: chains of four-bars through the positions in which all links are in line, at every tolerance.

A chain has one equation of motion, which is integrated on its own (`lean`); the angle of its first upright is held
against that. An error may be a hundred times the tolerance and what the motion makes of it, as two tight runs show
that start beside each other, or ten times what rounding alone makes of it: where all links are in line the motion is
that of N + 1 degrees of freedom, and two runs that start 1e-14 apart differ by 1e-8 and more behind it.
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


def apart(loops: int, nudge: float, rtol: float) -> float:
    """How far two tight runs are apart at most whose initial rates differ by this part."""
    m = pt.catalogue.load("n-four-bar", loops=loops)
    ends = []
    for rate in (-1.0, -1.0 * (1.0 + nudge)):
        run = m.simulate(10.0, initial=m.assemble(rates={"P0": rate}), t_eval=TIMES, rtol=rtol, atol=rtol / 100)
        assert run.success, run.message
        ends.append(run.joint("P0").position[:, 0])
    return float(np.abs(ends[1] - ends[0]).max())


@cache
def growth(loops: int) -> float:
    """How much larger a small change of the initial rate is later, at most, in the angle."""
    return max(1.0, apart(loops, NUDGE, 1e-11) / NUDGE)


@cache
def rounding(loops: int) -> float:
    """What a change of the last digits makes of the angle."""
    return max(apart(loops, nudge, TOLERANCES[-1]) for nudge in (1e-14, 2e-14))


def trial(loops: int, rtol: float) -> tuple[float, str]:
    """The error over tolerance and growth, and what is wrong, if anything."""
    m = pt.catalogue.load("n-four-bar", loops=loops)
    run = m.simulate(10.0, initial=start(m), t_eval=TIMES, rtol=rtol, atol=rtol / 100)
    if not run.success:
        return float("inf"), run.message
    off = float(np.abs(-run.joint("P0").position[:, 0] - lean(loops, TIMES)).max())
    error = off / rtol / growth(loops)
    return error, "" if error <= ALLOWED or off <= 10.0 * rounding(loops) else "off"


def main(loops: Sequence[int]) -> int:
    """Print a line for each chain; 1 if a run does not end or is off."""
    bad = 0
    for n in loops:
        found = [trial(n, rtol) for rtol in TOLERANCES]
        bad += sum(bool(wrong) for _, wrong in found)
        errors = " ".join(f"{error:8.2g}" for error, _ in found)
        about = f"N = {n:4d}, growth {growth(n):5.1f}, rounding {rounding(n):.0e}"
        print(f"{about}: error in tolerances and growth {errors}", flush=True)
        for rtol, (_, wrong) in zip(TOLERANCES, found, strict=True):
            if wrong:
                print(f"    {rtol:.0e}: {wrong}")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main([int(x) for x in sys.argv[1:]] or LOOPS))
