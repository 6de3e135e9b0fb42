"""A find made as short as it goes: fewer loads, bodies and options, rounder numbers, from t = 0."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from oracle import shrinking
from oracle.drawing import Drawing

import partita as pt

from .case import Case

Fails = Callable[[Case], bool]


def shrunk(case: Case, fails: Fails, most: int = 400) -> Case:
    """The shortest case found that still fails; at most so many are tried."""
    tried, going = 0, True
    while going:
        going = False
        for shorter in candidates(case):
            if shorter is case:
                continue
            tried += 1
            if tried > most:
                return case
            if still(shorter, fails):
                case, going = shorter, True
                break
    return case


def still(case: Case, fails: Fails) -> bool:
    try:
        return fails(case)
    except Exception:  # a shorter case may make no sense at all
        return False


def candidates(case: Case) -> Iterator[Case]:
    """Shorter cases, the shortest first."""
    if case.error:
        yield replace(case, drawing=case.exact, error=0.0)
    for exact, drawing in zip(shrinking.candidates(case.exact), shrinking.candidates(case.drawing), strict=False):
        yield with_drawings(case, drawing, exact)
    if case.t0:
        yield case.later(-case.t0)
    for key in case.options:
        if key != "rtol":
            yield replace(case, options={k: x for k, x in case.options.items() if k != key})
    if case.outputs > 2:
        yield replace(case, outputs=2)
    for i in range(len(case.rates)):
        yield replace(case, rates=case.rates[:i] + case.rates[i + 1 :])
    for i, (name, rate) in enumerate(case.rates):
        short = float(f"{rate:.1g}")
        if short != rate:
            yield replace(case, rates=(*case.rates[:i], (name, short), *case.rates[i + 1 :]))
    at_identity = [replace(b, rotation=np.eye(3)) for b in case.exact.bodies]
    if not case.error and any(not np.array_equal(b.rotation, np.eye(3)) for b in case.exact.bodies):
        turned = replace(case.exact, bodies=tuple(at_identity))
        yield replace(case, drawing=turned, exact=turned)


def with_drawings(case: Case, drawing: Drawing, exact: Drawing) -> Case:
    """With joints and bodies that are still there, and the freedom that the exact drawing has."""
    joints = {j.name for j in drawing.joints}
    rates = tuple((name, rate) for name, rate in case.rates if name in joints)
    nudged = tuple(name for name in case.nudged if name in joints)
    made = replace(case, drawing=drawing, exact=exact, rates=rates, nudged=nudged)
    if len(drawing.joints) != len(case.drawing.joints):
        plain: pt.Mechanism = replace(made.later(-made.t0).exact, forces=()).build()
        try:
            made = replace(made, mobility=plain.compile().mobility)
        except pt.errors.PartitaError:
            return case  # nothing is left that could move
    return made
