"""Mechanisms of many degrees of freedom, and what one evaluation of each costs.

Each is measured in a process of its own (`python many_dof.py NAME SIZE` prints a line of JSON), so that one that
takes too long is ended and the others are told all the same.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

import partita as pt
from partita.catalogue.four_bar import CRANK_ANGLE, LENGTHS

Point = tuple[float, float, float]
STEP, SHORT, LONGEST = 1e-4, 2, 2000
"""Fixed steps of this length [s]; a longer run less a short one is what steps cost, whatever the start costs."""
ENOUGH_TO_COMPILE = 500
"""Steps after which evaluations are by machine code where they ever will be."""
PATIENCE, ROUNDS = 3.0, 7


def _four_bar(m: pt.Mechanism, base: str, offset: tuple[float, float], number: int) -> str:
    """The catalogue's four-bar on a body, moved by `offset`; the name of its rocker."""
    a, b, c, d = (tuple(np.add(p, (*offset, 0.0)).tolist()) for p in LENGTHS.points(CRANK_ANGLE))
    crank, coupler, rocker = (f"{word} {number}" for word in ("crank", "coupler", "rocker"))
    m.add_rod(crank, start=a, end=b, mass=LENGTHS.crank)
    m.add_rod(coupler, start=b, end=c, mass=LENGTHS.coupler)
    m.add_rod(rocker, start=d, end=c, mass=LENGTHS.rocker)
    m.add_revolute(f"A{number}", base, crank, point=a, cut="never")
    m.add_revolute(f"B{number}", crank, coupler, point=b)
    m.add_revolute(f"C{number}", coupler, rocker, point=c)
    m.add_revolute(f"D{number}", base, rocker, point=d)
    return rocker


def side_by_side(size: int) -> pt.Mechanism:
    """Four-bars that know nothing of each other: as many degrees of freedom, as many clusters."""
    m = pt.Mechanism(f"{size} four-bars side by side")
    for i in range(size):
        _four_bar(m, "ground", (2.0 * i, 0.0), i)
    return m


def in_series(size: int) -> pt.Mechanism:
    """Each four-bar stands on the rocker of the one before."""
    m = pt.Mechanism(f"{size} four-bars in series")
    base = "ground"
    for i in range(size):
        base = _four_bar(m, base, (0.5 * i, 0.3 * i), i)
    return m


def ring(size: int) -> pt.Mechanism:
    """A hanging ring of links: one loop with nearly as many degrees of freedom."""
    m = pt.Mechanism(f"ring of {size} links")
    turns = 2.0 * np.pi * np.arange(size + 1) / size
    corners: list[Point] = [(float(np.sin(t)), float(np.cos(t)), 0.0) for t in turns]
    corners[-1] = corners[0]
    for i in range(size):
        m.add_rod(f"link {i}", start=corners[i], end=corners[i + 1], mass=1.0)
    m.add_revolute("hook", m.ground, "link 0", point=corners[0])
    for i in range(size):
        m.add_revolute(f"P{i}", f"link {i}", f"link {(i + 1) % size}", point=corners[i + 1])
    return m


def open_chain(size: int) -> pt.Mechanism:
    """A hanging chain drawn at a slant: a tree of as many degrees of freedom as links."""
    m = pt.Mechanism(f"chain of {size} links")
    before = "ground"
    for i in range(size):
        start, end = ((0.6 * k, -0.8 * k, 0.0) for k in (i, i + 1))
        m.add_rod(f"link {i}", start=start, end=end, mass=1.0)
        m.add_revolute(f"P{i}", before, f"link {i}", point=start)
        before = f"link {i}"
    return m


def five_bars(size: int) -> pt.Mechanism:
    """Five-bar loops that share their uprights: one cluster of size + 1 degrees of freedom."""
    m = pt.Mechanism(f"{size} five-bar loops")
    for i in range(size + 1):
        m.add_rod(f"upright {i}", start=(i, 0, 0), end=(i, 1, 0), mass=1.0)
        m.add_revolute(f"P{i}", m.ground, f"upright {i}", point=(i, 0, 0))
    for i in range(size):
        knee = (i + 0.5, 1.4, 0.0)
        m.add_rod(f"left {i}", start=(i, 1, 0), end=knee, mass=0.5)
        m.add_rod(f"right {i}", start=(i + 1, 1, 0), end=knee, mass=0.5)
        m.add_revolute(f"L{i}", f"upright {i}", f"left {i}", point=(i, 1, 0))
        m.add_revolute(f"R{i}", f"upright {i + 1}", f"right {i}", point=(i + 1, 1, 0))
        m.add_revolute(f"K{i}", f"left {i}", f"right {i}", point=knee)
    return m


def four_bar_chain(size: int) -> pt.Mechanism:
    """The catalogue's chain of parallelograms: one degree of freedom."""
    return pt.catalogue.load("n-four-bar", loops=size)


MECHANISMS: dict[str, Callable[[int], pt.Mechanism]] = {
    "side by side": side_by_side,
    "in series": in_series,
    "ring": ring,
    "open chain": open_chain,
    "five-bar loops": five_bars,
    "four-bar chain": four_bar_chain,
}


@dataclass(frozen=True)
class Question:
    """Two sizes of one kind, and how much more a loop or link of the larger may cost (or an evaluation in all)."""

    kind: str
    small: int
    large: int | None
    aim: float
    """Largest ratio of the costs per loop; seconds of one evaluation where there is one size only."""


QUESTIONS = (
    Question("side by side", 10, 10_000, 1.2),
    Question("in series", 10, 10_000, 1.2),
    Question("ring", 50, None, 60e-6),
    Question("open chain", 50, 10_000, 1.2),
    Question("five-bar loops", 10, 10_000, 1.2),
    Question("four-bar chain", 10, 10_000, 1.2),
)


@dataclass(frozen=True)
class Cost:
    """Seconds of an evaluation, largest residual of the closing conditions at the end, degrees of freedom; None: not in
    time."""

    seconds: float
    closure: float
    dof: int


def cost(kind: str, size: int) -> Cost:
    """Measured in this process."""
    m = MECHANISMS[kind](size)
    start = m.assemble(rates={"P0": -1.0} if kind == "four-bar chain" else None)

    def run(steps: int) -> tuple[float, int, float]:
        end = steps * STEP
        began = perf_counter()
        found = m.simulate(end, t_eval=[end], initial=start, step=STEP)
        took = perf_counter() - began
        if not found.success:
            raise RuntimeError(found.message)
        return took, found.counters["evaluations"], float(np.max(found.closure, initial=0.0))

    run(ENOUGH_TO_COMPILE)
    long, first = 6, run(SHORT)[0]
    while long < LONGEST and run(long)[0] < 2.0 * first + 5e-3:
        long *= 3
    best = {SHORT: float("inf"), long: float("inf")}
    evaluations, closure = {SHORT: 0, long: 0}, 0.0
    began, rounds = perf_counter(), 0
    while rounds < 2 or (perf_counter() - began < PATIENCE and rounds < ROUNDS):
        for steps in best:
            took, evaluations[steps], closure = run(steps)
            best[steps] = min(best[steps], took)
        rounds += 1
    seconds = (best[long] - best[SHORT]) / (evaluations[long] - evaluations[SHORT])
    return Cost(seconds, closure, m.compile().mobility)


def apart(kind: str, size: int, limit: float) -> Cost | str:
    """Measured in a process of its own; words where it failed or took longer than `limit` seconds."""
    command = [sys.executable, str(Path(__file__)), kind, str(size)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return f"not done in {limit:g} s"
    if done.returncode != 0:
        return (done.stderr.strip().splitlines() or ["failed"])[-1]
    return Cost(**json.loads(done.stdout))


if __name__ == "__main__":
    print(json.dumps(cost(sys.argv[1], int(sys.argv[2])).__dict__))
