"""`python -m zoo`: the whole zoo for ten seconds; `python -m zoo bennett delta`: some of it."""

import argparse
import os
import sys
from multiprocessing import Pool

from .study import done, tasks


def main(arguments: list[str]) -> int:
    """Print what was wrong and the largest differences; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(prog="python -m zoo", description="the whole zoo for ten seconds, or some of it")
    parser.add_argument("names", nargs="*", help="mechanisms; all, if none")
    parser.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, help="at a time; all processors, if not said"
    )
    options = parser.parse_args(arguments)
    todo = [task for task in tasks() if not options.names or task[1] in options.names]
    with Pool(options.processes) as pool:
        found = pool.map(done, todo, chunksize=1)
    wrong = [judged for judged in found if judged.wrong]
    for judged in wrong:
        print(f"{judged.name}:", *dict.fromkeys(judged.wrong[:6]), sep="\n  ")
    for what in sorted({what for judged in found for what in judged.worst}):
        worst = max((judged for judged in found if what in judged.worst), key=lambda judged: judged.worst[what])
        print(f"{worst.worst[what]:>10.1e}  largest difference: {what} ({worst.name})")
    shortest = min((judged for judged in found if judged.until is not None), key=lambda judged: judged.until or 0.0)
    print(f"paths compared over {shortest.until:g} s ({shortest.name}) to 10 s")
    print(f"{len(found)} runs of {len({task[1] for task in todo})} mechanisms, {len(wrong)} with something wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
