"""A rhombus of rods hung from a spring and damper: motion near its equilibrium."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, FloatArray

ROCKER_ANGLE = 2.2343310190175859  # equilibrium, from the ground line [rad]
MASS, DAMPING, STIFFNESS = 5 / 3, 0.807952697701684, 7.68752490594741  # linearised there, in the rocker angle
EIGENVALUE = complex(-0.242385809310505, 2.13395502834838)
RATE = 1e-6  # small enough that the square of the motion is below the tolerance [rad/s]


def build() -> Mechanism:
    """The drawing in equilibrium: all sides 1 m, all rods 1 kg."""
    m = Mechanism("four-bar-spring", gravity=(0, -9.81, 0))
    a, d = np.zeros(3), np.array([1.0, 0.0, 0.0])
    arm = np.array([np.cos(ROCKER_ANGLE), np.sin(ROCKER_ANGLE), 0.0])
    b, c = a + arm, d + arm
    crank = m.add_rod("crank", start=a, end=b, mass=1.0)
    coupler = m.add_rod("coupler", start=b, end=c, mass=1.0)
    rocker = m.add_rod("rocker", start=d, end=c, mass=1.0)
    m.add_revolute("A", m.ground, crank, point=a, axis=(0, 0, 1))
    m.add_revolute("B", crank, coupler, point=b, axis=(0, 0, 1))
    m.add_revolute("C", coupler, rocker, point=c, axis=(0, 0, 1))
    m.add_revolute("D", m.ground, rocker, point=d, axis=(0, 0, 1), cut="never")
    m.add_spring("diagonal", m.ground, a, rocker, (1, 0, 0), stiffness=25.0, damping=1.0, length=np.sqrt(2.0))
    return m


def start(m: Mechanism) -> State:
    """In equilibrium, with a small velocity."""
    return m.assemble(rates={"D": RATE})


def linear(t: FloatArray) -> FloatArray:
    """Rocker angle from equilibrium of the linearised motion with the same start (nt,) [rad]."""
    return np.asarray(RATE / EIGENVALUE.imag * np.exp(EIGENVALUE.real * t) * np.sin(EIGENVALUE.imag * t))


def deviation(result: Result) -> float:
    """Largest difference from the linearised motion, relative to the largest displacement."""
    expected = linear(result.t)
    gap = np.max(np.abs(result.joint("D").position[:, 0] - expected))
    return float(gap / np.max(np.abs(expected)))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="four-bar-spring",
        title="four-bar with a diagonal spring and damper, near its equilibrium",
        source="Library of Computational Benchmark Problems (IFToMM), linearisation of the four-bar; closed form",
        duration=6.0,
        build=build,
        start=start,
        options={"rtol": 1e-9, "atol": 1e-15},
        checks=(
            Check(
                "motion from equilibrium, relative to the linearised one",
                1e-5,
                "the square of a motion of 5e-7 rad, and round-off of balanced forces of 10 N over it",
                deviation,
            ),
        ),
        notes="Joint angles start at zero here, so atol must stay far below the motion of 5e-7 rad.",
    )
