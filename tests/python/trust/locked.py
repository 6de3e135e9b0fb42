"""Joints that are locked

A joint locked by the loops accepts no rate, even where round-off in the drawing hides that it is locked; a mechanism
that does not close has no mobility.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from drawings import GENERAL, four_bar

import partita as pt
from partita.errors import ArgumentError, AssemblyError, DescriptionError

from .case import Case, Held, refused, right


def kite(off: float) -> pt.Mechanism:
    """Links a, a, b, b folded: the pin B lies on the pin D but for `off`, so that the crank is locked."""
    m = pt.Mechanism("kite", gravity=(0, 0, 0))
    d = (np.cos(0.3), np.sin(0.3), 0.0)
    b = (d[0] + off, d[1] + off, 0.0)
    c = (d[0] + 0.7 * np.cos(0.9), d[1] + 0.7 * np.sin(0.9), 0.0)
    m.add_rod("crank", (0, 0, 0), b, 1.0)
    m.add_rod("coupler", b, c, 1.0)
    m.add_rod("rocker", d, c, 1.0)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "coupler", point=b)
    m.add_revolute("D", m.ground, "rocker", point=d)
    m.add_revolute("C", "coupler", "rocker", point=c, cut="always")
    return m


def locked(off: float) -> Case:
    @refused(f"a folded kite, its pins apart by {off:g} m: the crank's rate", ArgumentError, "A = 2")
    def ask() -> Iterator[Held]:
        kite(off).assemble(rates={"A": 2.0})
        yield from ()

    return replace(ask, name=f"kite_{off:g}".replace("-", "_"))


CASES = [locked(off) for off in (0.0, 1e-16, 5e-16, 1e-14)]


@right("the same kites: the rocker's rate, which is free", "closed form: rocker and coupler turn as one about the pin")
def kite_free() -> Iterator[Held]:
    for off in (0.0, 1e-16, 1e-14):
        state = kite(off).assemble(rates={"D": 2.0})
        yield Held("rocker", state.velocity("D"), 2.0, 1e-12)
        yield Held("crank", state.velocity("A"), 0.0, 1e-6)
        yield Held("coupler on the crank", state.velocity("B"), 2.0, 1e-6)


@right("next to the fold, the pins apart by 1e-4 m", "closed form: the rates follow from the loop's two equations")
def kite_opened() -> Iterator[Held]:
    m = kite(1e-4)
    state = m.assemble(rates={"A": 1.0})
    d = np.array([np.cos(0.3), np.sin(0.3)])
    b = d + 1e-4
    c = d + 0.7 * np.array([np.cos(0.9), np.sin(0.9)])

    def across(x: np.ndarray) -> np.ndarray:
        return np.array([-x[1], x[0]])

    # velocity of C by way of crank and coupler, and by way of the rocker
    coupler, rocker = np.linalg.solve(np.stack([across(c - b), -across(c - d)], 1), -across(b))
    yield Held("coupler", state.velocity("B") / (coupler - 1.0), 1.0, 1e-9)
    yield Held("rocker", state.velocity("D") / rocker, 1.0, 1e-9)


@refused("the rate of a bar of a truss", ArgumentError, "A = 1")
def truss_rate() -> Iterator[Held]:
    from .contradictions import truss

    truss().assemble(rates={"A": 1.0})
    yield from ()


@refused("two rates of a four-bar that do not fit", ArgumentError, "D = 1")
def two_rates() -> Iterator[Held]:
    four_bar(GENERAL).assemble(rates={"A": 1.0, "D": 1.0})
    yield from ()


def too_short() -> pt.Mechanism:
    m = pt.Mechanism("short")
    m.add_rod("crank", (0, 0, 0), (0, 1, 0), 1.0)
    m.add_rod("rod", (0, 1, 0), (1, 1, 0), 1.0)
    m.add_rod("rocker", (9, 0, 0), (9, 1, 0), 1.0)
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "rod", point=(0, 1, 0))
    m.add_revolute("C", "rod", "rocker", point=(1, 1, 0), child_point=(9, 1, 0))
    m.add_revolute("D", m.ground, "rocker", point=(9, 0, 0))
    return m


@refused("mobility of a loop whose lengths cannot close", AssemblyError, "the mobility needs an assembled position")
def mobility() -> Iterator[Held]:
    yield Held("mobility", too_short().compile().mobility, 1, 0.0)


@refused("a run of that loop", AssemblyError, "the lengths do not fit")
def run_of_it() -> Iterator[Held]:
    too_short().simulate(1.0)
    yield from ()


@refused("a target that the crank cannot reach", AssemblyError, "A")
def target() -> Iterator[Held]:
    # the rocker is shorter than the distance of the pins less that of crank and coupler there
    m = four_bar([(0, 0), (1, 0), (1.8, 0.6), (2.0, 0)])
    m.assemble(targets={"A": np.pi})
    yield from ()


@refused('joints "P" (planar) and "P.x"', DescriptionError, "rename one")
def names() -> Iterator[Held]:
    m = pt.Mechanism("names")
    m.add_body("plate", mass=1.0, inertia=(1, 1, 1))
    m.add_body("ball", mass=1.0, inertia=(1, 1, 1))
    m.add_planar("P", m.ground, "plate")
    m.add_revolute("P.x", "plate", "ball", point=(0, 0, 0))
    m.compile()
    yield from ()
