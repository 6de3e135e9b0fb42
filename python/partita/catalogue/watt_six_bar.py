"""Watt's six-bar, second kind: a crank-rocker whose rocker drives a second pair of links."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FloatArray, FourBar, arms, meet, turned
from .entry import Check, Entry, angle, largest_gap, path_error

LENGTHS = FourBar(crank=0.3, coupler=0.9, rocker=0.7, ground=1.0)
ARM, ARM_ANGLE = 0.6, -np.pi * 70.0 / 180.0  # second arm D-E of the rocker [m], from its first one D-C [rad]
LINK, LEVER, PIN = 0.7, 0.6, (2.0, 0.0)  # lengths E-F and G-F, and the pin G [m]
CRANK_ANGLE, CRANK_RATE = np.pi / 3, 8.0

# t: crank angle [rad]. From the energy integral, t = integral of d(angle) / rate, in 30 digits.
CRANK = {1.0: (8.41055541553277600502,), 2.0: (16.1792498377712430365,), 5.0: (39.975050026601665583,)}


def points(crank_angle: FloatArray | float) -> dict[str, FloatArray]:
    """Pins B, C, E, F (..., 2) [m] for angles of the crank, by ruler and compass: two dyads, one after the other."""
    phi = np.asarray(crank_angle, dtype=float)
    d = np.array([LENGTHS.ground, 0.0])
    b = LENGTHS.crank * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    c = meet(b, np.broadcast_to(d, b.shape), LENGTHS.coupler, LENGTHS.rocker, 1)
    e = d + ARM / LENGTHS.rocker * turned(c - d, ARM_ANGLE)
    f = meet(e, np.broadcast_to(PIN, e.shape), LINK, LEVER, 1)
    return {"B": b, "C": c, "E": e, "F": f}


def build() -> Mechanism:
    """The drawing: crank at 60 degrees; links of 1 kg/m, the rocker made of two such arms."""
    m = Mechanism("watt-six-bar", gravity=(0, -9.81, 0))
    at = {name: np.array([*p, 0.0]) for name, p in points(CRANK_ANGLE).items()}
    a, d, g = np.zeros(3), np.array([LENGTHS.ground, 0.0, 0.0]), np.array([*PIN, 0.0])
    crank = m.add_rod("crank", start=a, end=at["B"], mass=LENGTHS.crank)
    coupler = m.add_rod("coupler", start=at["B"], end=at["C"], mass=LENGTHS.coupler)
    mass, com, inertia = arms(at["C"] - d, at["E"] - d)
    rocker = m.add_body("rocker", mass=mass, inertia=inertia, com=com, position=d)
    link = m.add_rod("link", start=at["E"], end=at["F"], mass=LINK)
    lever = m.add_rod("lever", start=g, end=at["F"], mass=LEVER)
    m.add_revolute("A", m.ground, crank, point=a, cut="never")
    m.add_revolute("B", crank, coupler, point=at["B"])
    m.add_revolute("C", coupler, rocker, point=at["C"])
    m.add_revolute("D", m.ground, rocker, point=d)
    m.add_revolute("E", rocker, link, point=at["E"])
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
    found_c = result.body("coupler").point((LENGTHS.coupler, 0, 0))[:, :2]
    found_f = result.body("lever").point((LEVER, 0, 0))[:, :2]
    return max(largest_gap(found_c, drawn["C"]), largest_gap(found_f, drawn["F"]))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="watt-six-bar",
        title="Watt's six-bar: a crank-rocker whose rocker drives a second pair of links",
        source="ruler and compass for the pins; energy integral of its one equation of motion, in 30 digits",
        duration=5.0,
        build=build,
        start=start,
        times=tuple(CRANK),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-7, "rtol 1e-11 of 40 rad over some hundred steps, some margin", crank),
            Check("pins over crank angle [m]", 1e-11, "closure 1e-12, at most tenfold in the pins", pins),
        ),
        notes="Second kind of Watt's chain: the ground and the rocker are the links with three pins. The loops can be "
        "closed one after the other, each with one pair of circles.",
    )
