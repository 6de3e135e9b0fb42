"""Many cases: counted by verdict and by the causes of refusals; what is wrong is made short and printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from .chance import TEST, Ranges, case, kinds_of
from .judging import Verdict, judge
from .shrinking import shrunk


@dataclass
class Study:
    """What was counted, the largest error of each check over what is allowed, what was wrong, and what was drawn."""

    counts: Counter[str] = field(default_factory=Counter)
    causes: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    wrong: list[tuple[int, Verdict]] = field(default_factory=list)
    drawn: Counter[str] = field(default_factory=Counter)

    def add(self, other: Study) -> None:
        self.counts += other.counts
        self.causes += other.causes
        self.drawn += other.drawn
        self.wrong += other.wrong
        for what, error in other.worst.items():
            self.worst[what] = max(self.worst.get(what, 0.0), error)


def study(seeds: Iterable[int], ranges: Ranges = TEST, few: int | None = None) -> Study:
    """Cases of these numbers; `few`: so many of the checks of each, by chance."""
    found = Study()
    for seed in seeds:
        c = case(seed, ranges)
        verdict = judge(c, few=few)
        found.counts[verdict.word] += 1
        found.counts += verdict.counts
        found.drawn[c.drawing.words] += 1
        found.drawn += kinds_of(c.drawing)
        if verdict.cause:
            found.causes[verdict.cause] += 1
        for what, error in verdict.worst.items():
            found.worst[what] = max(found.worst.get(what, 0.0), error)
        if verdict.wrong:
            found.wrong.append((seed, verdict))
    return found


def kind_of(line: str) -> str:
    """Which check, without how far off."""
    return line.split(":")[0].split(" (")[0]


def report(seed: int, verdict: Verdict, ranges: Ranges = TEST) -> str:
    """What was wrong, and the shortest case that still shows it, as a program."""
    kind = kind_of(verdict.wrong[0])

    def fails(c: object) -> bool:
        return any(kind_of(line) == kind for line in judge(c, only=[kind]).wrong)  # type: ignore[arg-type]

    short = shrunk(case(seed, ranges), fails)
    again = judge(short, only=[kind]).wrong or verdict.wrong
    lines = "\n  ".join(again[:3])
    return f"case {seed} ({short.drawing.words}):\n  {lines}\n{short.lines()}"
