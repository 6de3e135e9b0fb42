"""`python -m oracle 5000`: mechanisms by chance against independent programs; every element, couplings, sensors, files
and FMUs beside.

`python -m oracle 5000 "every element"` compares one part alone.
"""

from __future__ import annotations

import logging
import os
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterable
from multiprocessing import Pool
from pathlib import Path
from typing import Any

from partita.io.fmu import BINARIES

from . import chance, elements, files, fmus
from .comparison import Verdict
from .coupled import compare_coupled
from .sensors import compare_sensors
from .study import Study, report, study


def counted(seeds: Iterable[int], compare: Callable[[int], Verdict]) -> Study:
    """Verdicts of a comparison added up."""
    counts, worst, wrong = Counter[str](), dict[str, float](), []
    for seed in seeds:
        verdict = compare(seed)
        counts += verdict.counts
        for what, error in verdict.worst.items():
            worst[what] = max(worst.get(what, 0.0), error)
        if verdict.wrong:
            wrong.append((seed, verdict))
    return counts, worst, wrong


def couplings(seeds: Iterable[int]) -> Study:
    return counted(seeds, lambda seed: compare_coupled(seed)[0])


def every_element(seeds: Iterable[int]) -> Study:
    return counted(seeds, lambda seed: elements.compare_elements(seed)[0])


def stepped(seeds: Iterable[int]) -> Study:
    warnings.simplefilter("ignore")  # tolerances this tight ask for more than round-off leaves of an energy balance

    def one(seed: int) -> Verdict:
        with tempfile.TemporaryDirectory() as folder:
            return fmus.compare_fmu(seed, Path(folder))

    return counted(seeds, one)


def sensors(seeds: Iterable[int]) -> Study:
    return counted(seeds, lambda seed: compare_sensors(chance.mechanism(seed)))


def model_files(seeds: Iterable[int]) -> Study:
    warnings.simplefilter("ignore")  # what a format cannot carry is expected here
    with tempfile.TemporaryDirectory() as folder:
        return counted(seeds, lambda seed: files.compare_all(seed, Path(folder)))


PARTS: dict[str, tuple[Callable[[Iterable[int]], Study], int]] = {
    "mechanisms": (study, 1),
    "every element": (every_element, 1),
    "couplings": (couplings, 2),
    "sensors": (sensors, 4),
    "model files": (model_files, 4),
    "FMUs": (stepped, 10),
}
"""What is compared, and in which part of the number asked for."""
DRAWN = {"mechanisms": chance.mechanism, "every element": elements.mechanism}
"""What may be made as short as it goes."""


def main(asked: int, *only: str) -> int:
    """Print what was counted and the differences; 1 if there are any."""
    cores, all_wrong = os.cpu_count() or 1, 0
    for name, (compare, part) in PARTS.items():
        if only and name not in only:
            continue
        if name == "FMUs" and not list(BINARIES.glob("*partita_fmu*")):
            print("FMUs: the binary is not built (make fmu)\n")
            continue
        count = asked // part
        with Pool(cores) as pool:
            found = pool.map(compare, [range(k, count, 4 * cores) for k in range(4 * cores)])
        counts, worst, wrong = found[0]
        for more, largest, others in found[1:]:
            counts += more
            worst = {what: max(largest.get(what, 0.0), worst.get(what, 0.0)) for what in {*worst, *largest}}
            wrong = wrong + others
        for what, number in sorted(counts.items()):
            print(f"{number:>10}  {what}")
        for what, error in sorted(worst.items()):
            print(f"{error:>10.1e}  largest difference: {what}")
        for seed, verdict in wrong[:5]:
            drawn = DRAWN.get(name)
            print("\n" + (report(seed, verdict, drawn) if drawn else verdict_text(name, seed, verdict)))
        print(f"\n{name}: {count} drawn by chance, {len(wrong)} with differences\n")
        all_wrong += len(wrong)
    return int(bool(all_wrong))


def verdict_text(name: str, seed: int, verdict: Any) -> str:
    return f"{name} {seed}:\n  " + "\n  ".join(verdict.wrong[:5])


if __name__ == "__main__":
    logging.getLogger("partita").setLevel(logging.ERROR)  # remarks on what is drawn by chance
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 5000, *sys.argv[2:]))
