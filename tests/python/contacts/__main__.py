"""`python -m contacts 1000`: that many drawn cases, at three tolerances with 2, 21 and 201 outputs each."""

import logging
import os
import sys
from collections import Counter
from multiprocessing import Pool

from . import FAMILIES, Trial, trial


def case(number: int) -> list[Trial]:
    """The families in turn."""
    seed, family = divmod(number, len(FAMILIES))
    return trial(list(FAMILIES)[family], seed)


def main(count: int) -> int:
    """Print what was seen; the exit code is 1 if a run is wrong with success, invalid, or does not end."""
    counted: Counter[tuple[str, float, str]] = Counter()
    worst: dict[tuple[str, float], float] = {}
    bad = []
    with Pool(os.cpu_count()) as pool:
        for done, runs in enumerate(pool.imap(case, range(count)), 1):
            for seen in runs:
                key = (seen.family, seen.rtol)
                counted[(*key, seen.word)] += 1
                if seen.success:
                    worst[key] = max(worst.get(key, 0.0), seen.error)
                if seen.word != "right":
                    bad.append(seen)
                    print(seen, flush=True)
            if done % 100 == 0:
                print(f"{done} of {count} cases", flush=True)
    for (family, rtol), error in worst.items():
        words = ", ".join(f"{n} {word}" for (f, r, word), n in counted.items() if (f, r) == (family, rtol))
        print(f"{family}, rtol {rtol:.0e}: {words}; error at most {error:.3g} times the tolerance and the growth")
    return 1 if bad else 0


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000))
