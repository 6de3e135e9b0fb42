"""The standard example: a crank-rocker driven over the top by its own speed."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FourBar
from .entry import Check, Entry, angle, largest_gap, path_error

LENGTHS = FourBar(crank=0.3, coupler=0.9, rocker=0.7, ground=1.0)
CRANK_ANGLE, CRANK_RATE = np.pi / 3, 2.0

# t: crank angle [rad]. From the energy integral, t = integral of d(angle) / rate, in 30 digits.
CRANK = {
    1.0: (1.40608521715845694792,),
    2.0: (6.13249524819388012701,),
    5.0: (13.9188544149679428906,),
    10.0: (26.5480692166022295623,),
}
PERIOD = 2.24079235920257864240  # one turn of the crank [s]


def build() -> Mechanism:
    """The drawing: crank at 60 degrees, open branch, rods of 1 kg/m."""
    m = Mechanism("four-bar", gravity=(0, -9.81, 0))
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
    """As drawn, the crank turning with 2 rad/s."""
    return m.assemble(rates={"A": CRANK_RATE})


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A", CRANK_ANGLE)[:, None], result, CRANK)


def rocker(result: Result) -> float:
    """Largest difference between the rocker angle and the one ruler and compass give for the crank angle."""
    _, drawn = LENGTHS.angles(CRANK_ANGLE)
    _, expected = LENGTHS.angles(angle(result, "A", CRANK_ANGLE))
    return largest_gap(angle(result, "D", float(drawn)), expected)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="four-bar",
        title="crank-rocker four-bar under gravity whose crank nearly stops at the top",
        source="energy integral of its one equation of motion, evaluated in 30 digits",
        duration=10.0,
        build=build,
        start=start,
        times=tuple(CRANK),
        options={"rtol": 1e-10, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-5, "rtol 1e-10; passages over the top let errors grow by 1e4", crank),
            Check("rocker angle over crank angle [rad]", 1e-11, "closure 1e-12, at most tenfold in angle", rocker),
        ),
    )
