"""`python -m everyday 10000`: everyday cases by chance, with everything that must not matter; `python -m everyday 100
300 test` those of the numbers 100 to 299 as `make test` draws them."""

from __future__ import annotations

import logging
import os
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import Pipe, Process
from typing import Any

from .chance import MID, TEST, WIDE, Ranges
from .judging import Verdict
from .study import Study, report, study

FEW = 4
"""Checks of each case."""
AT_ONCE = 20
LONGEST = float(os.environ.get("LONGEST", "60"))
"""Seconds that one case may take."""


def judged(pipe: Any, seeds: list[int], ranges: Ranges) -> None:
    """In a process of its own, one case after the other."""
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    for seed in seeds:
        pipe.send(study([seed], ranges, few=FEW))


def part(work: tuple[list[int], Ranges]) -> Study:
    """Of some cases; one that does not end is wrong, and the next ones follow."""
    seeds, ranges = work
    found = Study()
    while seeds:
        here, there = Pipe(duplex=False)
        process = Process(target=judged, args=(there, seeds, ranges))
        process.start()
        there.close()
        while seeds:
            try:
                one = here.recv() if here.poll(LONGEST) else lost(seeds[0], "hangs")
            except EOFError:
                one = lost(seeds[0], "ends the process")
            found.add(one)
            seeds = seeds[1:]
            if one.counts["lost"]:
                break
        process.kill()
        process.join()
    return found


def lost(seed: int, how: str) -> Study:
    verdict = Verdict(wrong=[f"{how}: no answer within {LONGEST:g} s"])
    return Study(wrong=[(seed, verdict)], counts=Counter({"wrong": 1, "lost": 1}))


def main(first: int, last: int, ranges: Ranges) -> int:
    """Print what was counted and what is wrong; 1 if anything is."""
    found = Study()
    work = [(list(range(k, min(k + AT_ONCE, last))), ranges) for k in range(first, last, AT_ONCE)]
    with ThreadPoolExecutor(int(os.environ.get("PROCESSES", os.cpu_count() or 1))) as pool:
        for one in pool.map(part, work):
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
    several = sorted((x for x in found.wrong if "no answer" not in x[1].wrong[0]), key=lambda x: x[0])
    for seed, verdict in several[: int(os.environ.get("REPORTS", "5"))]:
        print("\n" + report(seed, verdict, ranges))
    print(f"\n{last - first} everyday cases, {len(found.wrong)} wrong")
    return int(bool(found.wrong))


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)
    given = [int(x) for x in sys.argv[1:] if x.isdigit()] or [1000]
    bounds = (0, given[0]) if len(given) == 1 else (given[0], given[1])
    sys.exit(main(*bounds, {"test": TEST, "mid": MID}.get(sys.argv[-1], WIDE)))
