"""`python -m kinks 200`: that many motions by chance that are not smooth at one place."""

import logging
import os
import sys
from collections import Counter
from multiprocessing import Pool

from . import Trial, trial


def main(count: int) -> int:
    """Print what was counted and what went wrong; 1 if anything did."""
    with Pool(os.cpu_count()) as pool:
        found: list[Trial] = pool.map(trial, range(count), chunksize=8)
    outcomes = Counter(x.outcome for x in found)
    print(f"{count} motions that are not smooth: " + ", ".join(f"{n} {what}" for what, n in sorted(outcomes.items())))
    for x in [x for x in found if x.outcome != "right"][:20]:
        print(f"  {x.outcome}: {x.words}")
    return int(outcomes["right"] < count)


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
