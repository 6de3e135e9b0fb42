"""A planar four-bar drawn in space: four parallel revolutes in a tilted plane, three rows of closure redundant."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..products import matmul
from ..results import Result
from ..state import State
from .dyad import FourBar
from .entry import Check, Entry, FloatArray, angle, largest_gap, path_error

LENGTHS = FourBar(crank=1.0, coupler=3.0, rocker=2.5, ground=3.0)
CRANK_ANGLE = np.pi / 3
TURNS = (0.4, 0.5, 0.7)  # of the plane about world z, then its own y, then its own x [rad]

# t: crank angle [rad]. One equation of motion with the gravity in the plane, extrapolated in extended precision.
CRANK = {
    1.0: (2.01293056109065854,),
    2.0: (6.70343788241931090,),
    5.0: (1.05759580296340900,),
    10.0: (1.09054475121115000,),
}


def plane() -> FloatArray:
    """Rotation (3, 3): columns are the mechanism's x, y and its normal, the direction of all four axes."""
    (cz, cy, cx), (sz, sy, sx) = np.cos(TURNS), np.sin(TURNS)
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    return np.asarray(matmul(matmul(about_z, about_y), about_x))


def build() -> Mechanism:
    """The drawing: crank at 60 degrees in the tilted plane, open branch."""
    m = Mechanism("spatial-four-bar", gravity=(0, -9.81, 0))
    tilt = plane()
    a, b, c, d = (matmul(tilt, point) for point in LENGTHS.points(CRANK_ANGLE))
    normal = tilt[:, 2]
    crank = m.add_rod("crank", start=a, end=b, mass=1.0)
    coupler = m.add_rod("coupler", start=b, end=c, mass=3.0)
    rocker = m.add_rod("rocker", start=d, end=c, mass=2.5)
    m.add_revolute("A", m.ground, crank, point=a, axis=normal, cut="never")
    m.add_revolute("B", crank, coupler, point=b, axis=normal)
    m.add_revolute("C", coupler, rocker, point=c, axis=normal)
    m.add_revolute("D", m.ground, rocker, point=d, axis=normal)
    return m


def start(m: Mechanism) -> State:
    """Released at rest."""
    return m.assemble()


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A", CRANK_ANGLE)[:, None], result, CRANK)


def out_of_plane(result: Result) -> float:
    """Largest distance of the two moving pins from the plane."""
    normal = plane()[:, 2]
    pins = (result.body("crank").point((LENGTHS.crank, 0, 0)), result.body("rocker").point((LENGTHS.rocker, 0, 0)))
    return max(largest_gap(matmul(pin, normal), np.zeros(len(result.t))) for pin in pins)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="spatial-four-bar",
        title="four parallel revolutes in a tilted plane: 20 constraint rows of rank 17",
        source="one equation of motion with the gravity in the plane, extrapolated in extended precision",
        duration=10.0,
        build=build,
        start=start,
        times=tuple(CRANK),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-7, "rtol 1e-11 over a few hundred steps with a hundredfold growth", crank),
            Check("pins stay in the plane [m]", 1e-12, "round-off of the closure", out_of_plane),
        ),
        notes="Of the 20 reaction components only the 8 forces in the plane are determined; the forces along the axes "
        "and the moments across them depend on the elasticity of the links.",
    )
