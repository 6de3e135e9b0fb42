"""Bricard's mechanism: six hinges and five rods in space, overconstrained everywhere, and yet it moves."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, path_error

POINTS = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], dtype=float)
AXES = np.array([(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)], dtype=float)
SECTION = 0.1  # side of the square section [m]

# t: x, y, z of P2, accurate to 1e-8
P2 = {
    1.0: (0.274481319265, -0.886707938735, -0.462330002687),
    2.0: (-0.778135373033, -0.980352683443, -0.197252670617),
    5.0: (0.999932742302, -0.999999997738, -0.000067255436),
    10.0: (0.999730987304, -0.999999963826, -0.000268976512),
}


def build() -> Mechanism:
    """The drawing: rods of 1 m and 1 kg along the edges of a cube; body axes parallel to the world."""
    m = Mechanism("bricard", gravity=(0, -9.81, 0))
    across, along = (1.0 + SECTION**2) / 12.0, SECTION**2 / 6.0
    rods = [m.ground]
    for i in range(1, 6):
        edge = POINTS[i] - POINTS[i - 1]
        inertia = np.where(edge != 0.0, along, across)
        rods.append(m.add_body(f"rod {i}", mass=1.0, inertia=inertia, com=edge / 2, position=POINTS[i - 1]))
    for i in range(5):
        m.add_revolute(f"P{i}", rods[i], rods[i + 1], point=POINTS[i], axis=AXES[i])
    m.add_revolute("P5", m.ground, rods[5], point=POINTS[5], axis=AXES[5])
    return m


def start(m: Mechanism) -> State:
    """At rest as drawn."""
    return m.assemble()


def path(result: Result) -> float:
    """Largest error of x, y, z of P2, the end of the second rod, over the tabled times."""
    return path_error(result.body("rod 2").point(POINTS[2] - POINTS[1]), result, P2)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="bricard",
        title="Bricard's mechanism: 30 constraint rows of rank 29 everywhere, one degree of freedom",
        source="Library of Computational Benchmark Problems (IFToMM), problem A04, with rods of square section; "
        "recomputed by two unrelated programs to 1e-8",
        duration=10.0,
        build=build,
        start=start,
        times=tuple(P2),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(Check("path of P2 [m]", 1e-7, "ten times the accuracy of the reference itself", path),),
        notes="The published reference belongs to thin rods without axial inertia: another motion, up to 1e-2 away.",
    )
