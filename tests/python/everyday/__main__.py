"""`python -m everyday 10000`: everyday cases by chance, with everything that must not matter; `python -m everyday 100
300 test` those of the numbers 100 to 299 as `make test` draws them."""

from __future__ import annotations

import logging
import os
import sys
from multiprocessing import Pool

from .chance import TEST, WIDE, Ranges
from .study import Study, report, study

FEW = 4
"""Checks of each case."""
AT_ONCE = 20


def part(work: tuple[int, int, Ranges]) -> Study:
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    first, last, ranges = work
    return study(range(first, last), ranges, few=FEW)


def main(first: int, last: int, ranges: Ranges) -> int:
    """Print what was counted and what is wrong; 1 if anything is."""
    found = Study()
    work = [(k, min(k + AT_ONCE, last), ranges) for k in range(first, last, AT_ONCE)]
    with Pool(int(os.environ.get("PROCESSES", os.cpu_count() or 1))) as pool:
        for one in pool.imap_unordered(part, work):
            for seed, verdict in one.wrong:
                print(f"{seed}: {verdict.wrong[0]}", flush=True)
            found.add(one)
    for what, number in sorted(found.counts.items()):
        print(f"{number:>10}  {what}")
    print("\nrefusals by cause")
    for what, number in found.causes.most_common():
        print(f"{number:>10}  {what}")
    print("\nlargest error over what is allowed")
    for what, error in sorted(found.worst.items()):
        print(f"{error:>10.2g}  {what}")
    for seed, verdict in sorted(found.wrong, key=lambda x: x[0])[:5]:
        print("\n" + report(seed, verdict, ranges))
    print(f"\n{last - first} everyday cases, {len(found.wrong)} wrong")
    return int(bool(found.wrong))


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)
    given = [int(x) for x in sys.argv[1:] if x.isdigit()] or [1000]
    bounds = (0, given[0]) if len(given) == 1 else (given[0], given[1])
    sys.exit(main(*bounds, TEST if "test" in sys.argv else WIDE))
