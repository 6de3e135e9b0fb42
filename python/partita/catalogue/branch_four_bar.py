"""Grashof's four-bar through a full turn of the crank: the assembly branch must be kept."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FourBar
from .entry import Check, Entry, angle, largest_gap, row_at

LENGTHS = FourBar(crank=0.5, coupler=1.2, rocker=0.8, ground=1.0)
CRANK_ANGLE, CRANK_RATE = np.pi / 3, 2.0 * np.pi
PERIOD = 0.9012092178616646126512  # one turn [s]: integral of d(angle) / rate from the kinetic energy, in 30 digits


def build() -> Mechanism:
    """The drawing: crank at 60 degrees, open branch, rods of 1 kg/m, no gravity."""
    m = Mechanism("grashof-four-bar", gravity=(0, 0, 0))
    a, b, c, d = LENGTHS.points(CRANK_ANGLE)
    crank = m.add_rod("crank", start=a, end=b, mass=LENGTHS.crank)
    coupler = m.add_rod("coupler", start=b, end=c, mass=LENGTHS.coupler)
    rocker = m.add_rod("rocker", start=d, end=c, mass=LENGTHS.rocker)
    m.add_revolute("A", m.ground, crank, point=a, axis=(0, 0, 1), cut="never")
    m.add_revolute("B", crank, coupler, point=b, axis=(0, 0, 1))
    m.add_revolute("C", coupler, rocker, point=c, axis=(0, 0, 1))
    m.add_revolute("D", m.ground, rocker, point=d, axis=(0, 0, 1))
    return m


def start(m: Mechanism) -> State:
    """As drawn, the crank turning once a second."""
    return m.assemble(rates={"A": CRANK_RATE})


def turn(result: Result) -> float:
    """Distance of the crank from one full turn after the period."""
    return abs(float(result.joint("A").position[row_at(result, PERIOD), 0]) - 2.0 * np.pi)


def branch(result: Result) -> float:
    """Largest difference between the rocker angle and that of the open branch; on the other branch it is of order 1."""
    _, drawn = LENGTHS.angles(CRANK_ANGLE)
    _, expected = LENGTHS.angles(angle(result, "A", CRANK_ANGLE))
    return largest_gap(angle(result, "D", float(drawn)), expected)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="grashof-four-bar",
        title="Grashof four-bar through full turns of its crank on one assembly branch",
        source="ruler and compass for the branch; kinetic energy for the time of one turn, in 30 digits",
        duration=1.0,
        build=build,
        start=start,
        times=(PERIOD,),
        options={"rtol": 1e-10, "atol": 1e-12},
        checks=(
            Check("rocker angle on the open branch [rad]", 1e-11, "closure 1e-12, at most tenfold in angle", branch),
            Check("one full turn in the known time [rad]", 1e-8, "rtol 1e-10 over one turn, some margin", turn),
        ),
    )
