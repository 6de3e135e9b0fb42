"""`python -m branches 2000`: that many runs through singular positions against the branches followed by themselves."""

import logging
import os
import sys
from collections import Counter
from multiprocessing import Pool

from . import CLOSED, FAMILIES, FULL, Trial, trial

USUAL = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
"""The default tolerance and tighter ones: here no run may be wrong."""
LOOSE = (1e-4, 1e-5, 1e-6)
"""A step of these is long and inconclusive: counted and reported."""


def one(task: tuple[tuple[float, ...], int]) -> Trial:
    """Every family at every tolerance, one after the other."""
    tolerances, number = task
    seed, rest = divmod(number, len(FAMILIES) * len(tolerances))
    family, tolerance = divmod(rest, len(tolerances))
    return trial(list(FAMILIES)[family], seed, tolerances[tolerance])


EVERY = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""What forms that integrate all velocities, and those in 2k states, are tried at: no run may be wrong with success."""


def of_a_form(task: tuple[str, float, int]) -> Trial:
    """A crossed parallelogram, in a form that integrates all velocities or closes the loop in every evaluation."""
    formulation, tolerance, seed = task
    return trial("crossed parallelogram", seed, tolerance, formulation)


def in_absolute_coordinates(task: tuple[str, float, int]) -> Trial:
    """Every linkage by the positions of its bars, where dead points of the coordinates lie in singular positions."""
    family, tolerance, seed = task
    return trial(family, seed, tolerance, coordinates="absolute")


def main(count: int) -> int:
    """Print what was counted and the first that went wrong; 1 if any did at the default tolerance or tighter, or in a
    form that integrates all velocities or 2k states at any."""
    loose = count // 5
    with Pool(os.cpu_count()) as pool:
        forms = [(form, rtol) for form in (*FULL, *CLOSED) for rtol in EVERY]
        tasks = [(form, rtol, seed) for form, rtol in forms for seed in range(35)]
        full = pool.map(of_a_form, tasks, chunksize=8)
        reported("in forms of all velocities and of 2k states", full)
        if any(x.outcome == "wrong" or not x.steady for x in full):
            return 1
        tasks = [(family, rtol, seed) for family in FAMILIES for rtol in EVERY for seed in range(35)]
        absolute = pool.map(in_absolute_coordinates, tasks, chunksize=8)
        reported("in absolute coordinates", absolute)
        if any(x.outcome == "wrong" or not x.steady for x in absolute):
            return 1
        reported("at loose tolerances", pool.map(one, [(LOOSE, i) for i in range(loose)], chunksize=8))
        found = pool.map(one, [(USUAL, i) for i in range(count)], chunksize=8)
    return reported("at the default tolerance and tighter", found)


def reported(where: str, found: list[Trial]) -> int:
    """Print what was counted and the first that went wrong; 1 if any did."""
    count = len(found)
    outcomes = Counter(x.outcome for x in found)
    untold = [x for x in found if x.outcome == "right" and x.reported != x.passed]
    print(
        f"{count} runs through singular positions {where}: "
        + ", ".join(f"{n} {what}" for what, n in sorted(outcomes.items()))
    )
    print(
        f"{sum(x.reported for x in found)} positions told, {len(untold)} runs with more or fewer told than passed",
        flush=True,
    )
    for x in [*(x for x in found if x.outcome != "right"), *untold][:10]:
        print(f"  {x.outcome}, {x.reported} told of {x.passed}: {x.words}")
    return int(outcomes["wrong"] > 0 or outcomes["right"] < 0.98 * count)


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000))
