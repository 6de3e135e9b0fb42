"""One case judged: right, refused with its cause, or wrong with success.

A reference of the same case takes steps too short to miss anything; a third run, started a little faster, says how much
a motion magnifies errors. What magnifies them beyond `CHAOS`, or so much that more than `SENSITIVE` had to be allowed,
is not compared.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from oracle.drawing import Array

import partita as pt
from partita.solver import grouped

from .case import Case
from .chance import TEST, Ranges, case

TIGHT = {"rtol": 1e-10, "atol": 1e-12}
LOOSE = 1e-7
"""How far two runs at the tight tolerance may be apart, of sizes and paces."""
ALLOWED = 100.0
"""Times the tolerance and the growth: what the step control promises, added up over a run."""
NUDGE = 1e-5
"""Of the pace, at the start."""
CHAOS, SENSITIVE = 50.0, 2e-3
DRAWN_OFF = 100.0
"""Times the error of a drawing and the growth."""
MORE, FALLS = 50.0, 10.0
"""What is off by more than that is right if it is off by no more than `MORE` times that, and falls by as much as
`FALLS` with its cause a hundredth as large: what was missed does not."""
MOST_STEPS = 20_000
OUTPUTS = 9
COSTLY = ("independent", "instants", "stepper")
"""Checks of which a few are enough, where some are chosen by chance."""


@dataclass
class Verdict:
    """What was found of one case."""

    cause: str = ""
    """Of a refusal; empty: it ran."""
    wrong: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)

    @property
    def word(self) -> str:
        return "wrong" if self.wrong else "refused" if self.cause else "right"

    def seen(self, what: str, error: float, limit: float, words: str = "") -> None:
        self.counts[what] += 1
        self.worst[what] = max(self.worst.get(what, 0.0), error / limit)
        if not error <= limit:
            self.wrong.append(f"{what}: off by {error:.2e} (allowed {limit:.1e}) {words}".rstrip())


MAY_REFUSE = {"whole turns not known", "singular position"}
"""Causes for which a check may be refused though the case runs: whether an angle that is known within half a turn comes
to its end, and whether a step falls on a singular position, hangs on the last digits."""


class Refused(Exception):
    """A run that did not reach its end, and why."""


@dataclass
class Judged:
    """A case with the runs that every check compares with."""

    case: Case
    rng: Any
    verdict: Verdict
    mechanism: pt.Mechanism
    start: pt.State
    base: Any
    reference: Any
    growth: float
    coarse: float = 0.0
    """Twice what the tolerance of the case leaves, where that is more than step control promises."""

    def looked_closer(self, error: float) -> None:
        """Whether an error of the case at its tolerance is what this leaves: it falls with the tolerance."""
        if not self.allowed < error <= MORE * self.allowed:
            return
        c, times = self.case, self.case.times(OUTPUTS)
        own, left = (self.off(run(self.mechanism, c, self.start, times, **{**c.options, **x})) for x in ({}, finer(c)))
        if self.allowed < own <= MORE * self.allowed and left <= max(own / FALLS, self.allowed):
            self.verdict.counts["tolerance: more than promised, and falls with it"] += 1
            self.coarse = 2.0 * own

    @property
    def rtol(self) -> float:
        return float(self.case.options["rtol"])

    @property
    def allowed(self) -> float:
        return max(ALLOWED * self.rtol * self.growth + LOOSE, self.coarse)

    @property
    def tight(self) -> float:
        return LOOSE * self.growth

    def at_outputs(self, run: Any, times: Array, case: Case | None = None) -> Array:
        return poses(run, times, case or self.case)

    def off(self, run: Any, case: Case | None = None, since: float = 0.0) -> float:
        """The largest difference from the reference, of sizes and paces, at the outputs that both have."""
        case = case or self.case
        times = self.case.times(OUTPUTS) - self.case.t0
        seen = [(k, i) for k, t in enumerate(times) for i, s in enumerate(run.t - case.t0)
                if abs(s - t) <= 1e-9 * self.case.duration + 4e-16 * abs(case.t0) and t >= since]  # fmt: skip
        assert seen, "no output in common"
        mine = poses(run, case)[[i for _, i in seen]]
        return float(np.abs(mine - poses(self.reference, self.case)[[k for k, _ in seen]]).max())


def poses(run: Any, case: Case) -> Array:
    """Places, attitudes, velocities and spins of all bodies at the outputs, over size and pace: (nt, numbers)."""
    size, pace = case.drawing.size, case.pace
    names = sorted(b.name for b in case.drawing.bodies)
    found = []
    for name in names:
        b = run.body(name)
        found += [b.position / size, b.rotation.reshape(len(run.t), 9), b.velocity / (size * pace),
                  b.angular_velocity / pace]  # fmt: skip
    return np.hstack(found)


def run(m: pt.Mechanism, case: Case, start: pt.State, times: Any = None, **options: Any) -> Any:
    """To its end, or `Refused`."""
    try:
        named = {"max_steps": MOST_STEPS, **options}
        found = m.simulate(case.t0 + case.duration - start.t, initial=start, t_eval=times, **grouped(named))
    except pt.errors.PartitaError as error:
        raise Refused(f"{type(error).__name__}: {error}") from error
    if not found.success:
        raise Refused(f"{found.status}: {found.message}")
    return found


def finer(c: Case) -> dict[str, float]:
    """Its tolerances, a hundredth as large."""
    return {key: c.options[key] / 100.0 for key in ("rtol", "atol") if key in c.options}


def nudged(c: Case, m: pt.Mechanism) -> pt.State:
    """A little faster; refused in a position where what is nudged cannot move."""
    try:
        return c.start(m, NUDGE)
    except pt.errors.PartitaError as error:
        raise Refused(f"{type(error).__name__}: {error}") from error


PASSES = "singular positions of the mechanism were crossed", "the motion comes as near as"


def crosses(found: Any) -> bool:
    """Whether a run passed a position where branches meet, or would with other errors of the dimensions."""
    seen = [*found.notes, *(finding.sentence for finding in found.certificate.findings)]
    return any(words in line for words in PASSES for line in seen)


CAUSES = {
    "not by this formulation": r"ArgumentError: (\"[a-z-]+\"|explicit closing) (parametr|integrates|computes|works)",
    "left a table": r"outside \[",
    "whole turns not known": r"within half a turn",
    "more steps than allowed": r"max-steps|steps before",
    "singular position": r"singular|change point|dead point",
    "locked drawing": r"structure|locked|no degree of freedom|cannot move|mobility",
    "contradiction": r"contradict|ContradictionError",
    "loops not closed": r"AssemblyError",
    "the step size fell": r"step size",
}


def cause_of(message: str) -> str:
    """A refusal in a few words."""
    for words, pattern in CAUSES.items():
        if re.search(pattern, message):
            return words
    return message[:80]


def judge(c: Case, only: Iterable[str] | None = None, few: int | None = None) -> Verdict:
    """`only` these checks; None: all. `few`: so many of them, by chance."""
    from .checks import CHECKS

    verdict = Verdict()
    rng = np.random.default_rng([c.seed, 58])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a suspect result is looked at here
        try:
            judged = prepared(c, rng, verdict)
        except Refused as error:
            verdict.cause = cause_of(str(error))
            verdict.counts[f"refused: {verdict.cause}"] += 1
            return verdict
        if judged is None or verdict.wrong:
            return verdict
        names = [name for name in CHECKS if only is None or name in only]
        if few is not None:
            cheap = [name for name in names if name not in COSTLY]
            picked = [cheap[i] for i in rng.permutation(len(cheap))[:few]]
            # costly ones seldom, and on small mechanisms
            dear = [name for name in names if name in COSTLY and len(c.drawing.bodies) <= 6]
            names = picked + ([dear[int(rng.integers(len(dear)))]] if dear and rng.random() < 0.15 else [])
        for name in names:
            try:
                CHECKS[name](judged)
            except Refused as error:
                refused(name, error, verdict)
            except pt.errors.PartitaError as error:
                refused(name, error, verdict)
    return verdict


def refused(check: str, error: Exception, verdict: Verdict) -> None:
    cause = cause_of(str(error))
    verdict.counts[f"{check} refused: {cause}"] += 1
    if cause not in MAY_REFUSE:
        verdict.wrong.append(f"{check}: refused though the case runs: {error}")


def prepared(c: Case, rng: Any, verdict: Verdict) -> Judged | None:
    """With base, reference and growth; None where it cannot be compared."""
    try:
        m = c.build()
        # counted in the drawing as it is at t = 0, which drives that begin later would leave
        counted = c.later(-c.t0).build() if c.t0 and c.drawing.drives else m
        found = counted.compile(c.options.get("coordinates", "relative")).mobility
    except pt.errors.PartitaError as error:
        raise Refused(f"{type(error).__name__}: {error}") from error
    if found != c.mobility:
        verdict.wrong.append(f"mobility {found}, right {c.mobility} (drawn off by {c.error:.1e})")
        return None
    try:
        start = c.start(m)
    except pt.errors.PartitaError as error:
        raise Refused(f"{type(error).__name__}: {error}") from error
    base = run(m, c, start, c.times(c.outputs), **c.options)
    if base.certificate.verdict == "invalid":
        verdict.wrong.append(f"success, and invalid: {base.certificate}")
    verdict.counts[f"verdict {base.certificate.verdict}"] += 1
    times = c.times(OUTPUTS)
    try:
        tight = {"max_step": c.finest, **TIGHT, **{k: x for k, x in c.options.items() if k == "coordinates"}}
        reference = run(m, c, start, times, **tight)
        beside = run(m, c, nudged(c, m), times, **tight)
    except Refused as error:
        verdict.counts[f"no reference: {cause_of(str(error))}"] += 1
        return None
    growth = 1.0
    if c.mobility:
        moved = np.abs(poses(beside, c) - poses(reference, c)).max()
        growth = max(1.0, float(moved) / NUDGE)
    judged = Judged(c, rng, verdict, m, start, base, reference, growth)
    if c.error and (crosses(base) or crosses(reference)):
        # with the dimensions of such a drawing branches that meet in the exact one may pass each other
        verdict.counts["crosses a singular position, inexact"] += 1
        return None
    if growth > CHAOS or judged.allowed > SENSITIVE:
        verdict.counts["chaotic"] += 1
        return None
    verdict.counts["compared"] += 1
    error = judged.off(base)
    judged.looked_closer(error)
    verdict.seen("tolerance", error, judged.allowed, f"growth {growth:.1f}")
    return judged


def judged_case(seed: int, ranges: Ranges = TEST, few: int | None = None) -> Verdict:
    return judge(case(seed, ranges), few=few)
