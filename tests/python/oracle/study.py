"""Many mechanisms: counted, and those on which the programs differ made short and printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

from . import chance
from .comparison import Verdict, compare
from .drawing import Drawing
from .shrinking import shrunk


def kind_of(line: str) -> str:
    """What was off, without where and by how much."""
    return line.split(" off by")[0].split(": ")[-1].split(" is ")[-1].split(" (")[0]


def report(seed: int, verdict: Verdict, mechanism: Callable[[int], Drawing] = chance.mechanism) -> str:
    """The first difference on a mechanism, and the shortest drawing that still shows it."""
    kind = kind_of(verdict.wrong[0])
    short = shrunk(mechanism(seed), lambda d: any(kind_of(line) == kind for line in compare(d).wrong))
    reported = "\n  ".join(compare(short).wrong[:5] or verdict.wrong[:5])
    return f"mechanism {seed} ({short.words}): {len(verdict.wrong)} differences, such as\n  {reported}\n{short.lines()}"


Study = tuple[Counter[str], dict[str, float], list[tuple[int, Verdict]]]
"""What was counted, the largest difference of each kind, and what was wrong."""


def study(seeds: Iterable[int]) -> Study:
    """What was counted, the largest difference of each kind, and what was wrong."""
    counts, worst, wrong = Counter[str](), dict[str, float](), []
    for seed in seeds:
        verdict = compare(chance.mechanism(seed))
        counts += verdict.counts
        counts["mechanisms"] += 1
        for what, error in verdict.worst.items():
            worst[what] = max(worst.get(what, 0.0), error)
        if verdict.wrong:
            wrong.append((seed, verdict))
    return counts, worst, wrong


def together(verdicts: Iterable[tuple[int, Verdict]]) -> Counter[str]:
    """What was counted; nothing may be wrong."""
    counts, wrong = Counter[str](), list[str]()
    for seed, verdict in verdicts:
        counts += verdict.counts
        wrong += [f"{seed}: {line}" for line in verdict.wrong[:3]]
    assert not wrong, "\n".join(wrong[:20])
    return counts
