"""Stephenson's six-bar, third kind: a crank-rocker whose coupler drives a second pair of links."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FloatArray, FourBar, arms, meet, turned
from .entry import Check, Entry, angle, largest_gap, path_error

LENGTHS = FourBar(crank=0.3, coupler=0.9, rocker=0.7, ground=1.0)
ARM, ARM_ANGLE = 0.6, np.pi * 50.0 / 180.0  # second arm B-P of the coupler [m], from its first one B-C [rad]
LINK, LEVER, PIN = 0.8, 0.7, (-0.9, 0.4)  # lengths P-F and G-F, and the pin G [m]
CRANK_ANGLE, CRANK_RATE = np.pi / 3, 8.0

# t: crank angle [rad]. From the energy integral, t = integral of d(angle) / rate, in 30 digits.
CRANK = {1.0: (9.96343544693690340275,), 2.0: (20.0837557072377211726,), 5.0: (48.4201238100860146247,)}


def points(crank_angle: FloatArray | float) -> dict[str, FloatArray]:
    """Pins B, C, P, F (..., 2) [m] for angles of the crank, by ruler and compass."""
    phi = np.asarray(crank_angle, dtype=float)
    b = LENGTHS.crank * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    c = meet(b, np.broadcast_to([LENGTHS.ground, 0.0], b.shape), LENGTHS.coupler, LENGTHS.rocker, 1)
    p = b + ARM / LENGTHS.coupler * turned(c - b, ARM_ANGLE)
    f = meet(p, np.broadcast_to(PIN, p.shape), LINK, LEVER, -1)
    return {"B": b, "C": c, "P": p, "F": f}


def build() -> Mechanism:
    """The drawing: crank at 60 degrees; links of 1 kg/m, the coupler made of two such arms."""
    m = Mechanism("stephenson-six-bar", gravity=(0, -9.81, 0))
    at = {name: np.array([*p, 0.0]) for name, p in points(CRANK_ANGLE).items()}
    a, d, g = np.zeros(3), np.array([LENGTHS.ground, 0.0, 0.0]), np.array([*PIN, 0.0])
    crank = m.add_rod("crank", start=a, end=at["B"], mass=LENGTHS.crank)
    mass, com, inertia = arms(at["C"] - at["B"], at["P"] - at["B"])
    coupler = m.add_body("coupler", mass=mass, inertia=inertia, com=com, position=at["B"])
    rocker = m.add_rod("rocker", start=d, end=at["C"], mass=LENGTHS.rocker)
    link = m.add_rod("link", start=at["P"], end=at["F"], mass=LINK)
    lever = m.add_rod("lever", start=g, end=at["F"], mass=LEVER)
    m.add_revolute("A", m.ground, crank, point=a, cut="never")
    m.add_revolute("B", crank, coupler, point=at["B"])
    m.add_revolute("C", coupler, rocker, point=at["C"])
    m.add_revolute("D", m.ground, rocker, point=d)
    m.add_revolute("P", coupler, link, point=at["P"])
    m.add_revolute("F", link, lever, point=at["F"])
    m.add_revolute("G", m.ground, lever, point=g)
    return m


def start(m: Mechanism) -> State:
    """As drawn, the crank turning with 8 rad/s."""
    return m.assemble(rates={"A": CRANK_RATE})


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A", CRANK_ANGLE)[:, None], result, CRANK)


def pins(result: Result) -> float:
    """Largest distance of pins C and F from where ruler and compass put them for the crank angle."""
    drawn = points(angle(result, "A", CRANK_ANGLE))
    found_c = result.body("rocker").point((LENGTHS.rocker, 0, 0))[:, :2]
    found_f = result.body("lever").point((LEVER, 0, 0))[:, :2]
    return max(largest_gap(found_c, drawn["C"]), largest_gap(found_f, drawn["F"]))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="stephenson-six-bar",
        title="Stephenson's six-bar: a crank-rocker whose coupler drives a second pair of links",
        source="ruler and compass for the pins; energy integral of its one equation of motion, in 30 digits",
        duration=5.0,
        build=build,
        start=start,
        times=tuple(CRANK),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-7, "rtol 1e-11 of 48 rad over some hundred steps, some margin", crank),
            Check("pins over crank angle [m]", 1e-11, "closure 1e-12, at most tenfold in the pins", pins),
        ),
        notes="Third kind of Stephenson's chain: the ground and the coupler are the links with three pins.",
    )
