"""Families one after the other, counted."""

from __future__ import annotations

import os
import time
from collections import Counter
from types import ModuleType

from . import carts, loops, misdrawn, platforms, redundant, robots, seeming, touching
from .judge import Case, Outcome, judge

FAMILIES: dict[str, ModuleType] = {
    "platforms": platforms,
    "carts": carts,
    "misdrawn": misdrawn,
    "loops": loops,
    "seeming": seeming,
    "redundant": redundant,
    "touching": touching,
}
WORST = ("wrong", "must run", "unnamed", "refused", "right")


def verdict(outcomes: dict[str, Outcome]) -> str:
    """Of a case: the worst of both kinds of coordinates."""
    return min((o.verdict for o in outcomes.values()), key=WORST.index)


def table(name: str, count: int, seed: int) -> bool:
    """One family; true if nothing was wrong."""
    family = FAMILIES[name]
    counted: Counter[str] = Counter()
    truth = core = 0.0
    for number in range(seed, seed + count):
        began = time.process_time()
        case: Case = family.case(number)
        outcomes = judge(case)
        own = sum(o.seconds for o in outcomes.values())
        core += own
        truth += time.process_time() - began - own
        counted[verdict(outcomes)] += 1
        for coordinates, o in outcomes.items():
            if o.verdict != "right" or os.environ.get("GEOMETRY_STUDY_ALL"):
                words = f"{o.seconds:5.1f} s {case.name}: {o.words}"
                print(f"  {o.verdict:9} {number:5} {coordinates:8} {words}", flush=True)
    shown = ", ".join(f"{what} {counted[what]}" for what in ("right", "refused", "unnamed", "must run", "wrong"))
    print(f"{name}: tried {count}, {shown}; CPU {core:.0f} s core and comparison, {truth:.0f} s truth", flush=True)
    return not counted["wrong"]


def main(arguments: list[str]) -> int:
    if arguments[:1] == ["robots"]:
        return 0 if robots.study() else 1
    names = arguments[:1] or list(FAMILIES)
    seed = int(arguments[2]) if len(arguments) > 2 else 0
    held = [table(name, int(arguments[1]) if len(arguments) > 1 else int(FAMILIES[name].COUNT), seed) for name in names]
    return 0 if all(held) else 1
