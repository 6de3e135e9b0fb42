"""`python -m branches 2000`: that many runs through singular positions against the branches followed by themselves."""

import os
import sys
from collections import Counter
from multiprocessing import Pool

from . import FAMILIES, Seen, trial

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)


def one(number: int) -> Seen:
    """Every family at every tolerance, one after the other."""
    seed, rest = divmod(number, len(FAMILIES) * len(TOLERANCES))
    family, tolerance = divmod(rest, len(TOLERANCES))
    return trial(list(FAMILIES)[family], seed, TOLERANCES[tolerance])


def main(count: int) -> int:
    """Print what was counted and the first that went wrong; 1 if any did."""
    with Pool(os.cpu_count()) as pool:
        found = pool.map(one, range(count), chunksize=8)
    outcomes = Counter(x.outcome for x in found)
    untold = [x for x in found if x.outcome == "right" and x.told != x.passed]
    print(
        f"{count} runs through singular positions: " + ", ".join(f"{n} {what}" for what, n in sorted(outcomes.items()))
    )
    print(f"{sum(x.told for x in found)} positions told, {len(untold)} runs with more or fewer told than passed")
    for x in [*(x for x in found if x.outcome != "right"), *untold][:10]:
        print(f"  {x.outcome}, {x.told} told of {x.passed}: {x.words}")
    return int(outcomes["wrong"] > 0 or outcomes["right"] < 0.98 * count)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000))
