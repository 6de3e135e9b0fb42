"""`python -m holding 300`: that many drawn cases; with two numbers those from the first to before the second."""

import logging
import os
import sys
from collections import Counter
from multiprocessing import Pool

from . import WRONG, trial


def main(first: int, last: int) -> int:
    """Print what did not agree; the exit code is 1 if a run is wrong with success."""
    counted: Counter[str] = Counter()
    with Pool(int(os.environ.get("PARTITA_PROCESSES", os.cpu_count() or 1))) as pool:
        for seen in pool.imap_unordered(trial, range(first, last)):
            counted[seen.word] += 1
            if seen.word != "agrees":
                print(seen, flush=True)
    print(", ".join(f"{count} {word}" for word, count in counted.most_common()))
    return 1 if any(counted[word] for word in WRONG) else 0


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    given = [int(x) for x in sys.argv[1:]] or [300]
    sys.exit(main(*(given if len(given) == 2 else (0, given[0]))))
