"""`python -m oracle 5000`: that many mechanisms against the independent program."""

import os
import sys
from multiprocessing import Pool

from .study import report, study


def main(count: int) -> int:
    """Print what was counted and the differences; 1 if there are any."""
    cores = os.cpu_count() or 1
    with Pool(cores) as pool:
        parts = pool.map(study, [range(k, count, 4 * cores) for k in range(4 * cores)])
    counts, worst, wrong = parts[0]
    for more, largest, others in parts[1:]:
        counts += more
        worst = {what: max(largest.get(what, 0.0), worst.get(what, 0.0)) for what in {*worst, *largest}}
        wrong = wrong + others
    for what, number in sorted(counts.items()):
        print(f"{number:>10}  {what}")
    for what, error in sorted(worst.items()):
        print(f"{error:>10.1e}  largest difference: {what}")
    for seed, verdict in wrong[:5]:
        print("\n" + report(seed, verdict))
    print(f"\n{count} mechanisms, {len(wrong)} with differences")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 5000))
