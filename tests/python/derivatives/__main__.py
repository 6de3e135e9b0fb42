"""`python -m derivatives`: the whole zoo; `python -m derivatives delta bennett`: some of it."""

import argparse
import os
import sys
from multiprocessing import Pool

from partita.catalogue import zoo

from .study import study


def main(arguments: list[str]) -> int:
    """Print what was wrong and the largest differences; 1 if anything was wrong."""
    parser = argparse.ArgumentParser(prog="python -m derivatives", description="linearised equations of the zoo")
    parser.add_argument("names", nargs="*", help="mechanisms; all, if none")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="at a time")
    options = parser.parse_args(arguments)
    with Pool(options.processes) as pool:
        found = pool.map(study, options.names or sorted(zoo.ENTRIES), chunksize=1)
    wrong = [judged for judged in found if judged.wrong]
    for judged in wrong:
        print(f"{judged.name}:", *dict.fromkeys(judged.wrong[:6]), sep="\n  ")
    for judged in found:
        for reason in judged.left_out:
            print(f"{judged.name}, left out: {reason[:150]}")
    for what in sorted({what for judged in found for what in judged.worst}):
        worst = max((judged for judged in found if what in judged.worst), key=lambda judged: judged.worst[what])
        print(f"{worst.worst[what]:>10.1e}  largest: {what} ({worst.name})")
    print(f"{len(found)} mechanisms, {len(wrong)} with something wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
