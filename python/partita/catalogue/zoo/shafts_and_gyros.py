"""Shafts that are not in line, loops of cylinders and balls, and spinning bodies."""

from __future__ import annotations

import numpy as np

from ...mechanism import Mechanism
from ...products import matmul
from ..truth import EVERYTHING, Truth
from .drawing import around, disc, link, unit
from .member import FALL, Theme, member

MEMBERS: Theme = {}
REST = (0.0, 0.0, 0.0)
DIMENTBERG = (
    "F. M. Dimentberg, The Determination of the Positions of Spatial Mechanisms; J. Duffy, Analysis of Mechanisms"
)
MAGNUS = "K. Magnus, Kreisel: Theorie und Anwendungen"


@member(MEMBERS, "double-cardan", "double Cardan shaft in Z: two universal joints in phase make the speeds equal",
        Truth(1, 1, {"in": "fy fz mx my", "out": "fy fz mx my", "*": "fy fz mx my mz"},
              why="the axes at each end meet at the centre of a cross, and both centres are at rest: the constraint on "
              "their distance is redundant, Kutzbach's 0 + 1; the self-stress is a force from centre to centre, along "
              "x, with a moment about z in bearings beside the centres", source="H. C. Seherr-Thoss, F. Schmelz, "
              "E. Aucktor, Universal Joints and Driveshafts"), rates={"in": 15.0}, gravity=FALL,
        samples=801)  # fmt: skip
def double_cardan(m: Mechanism) -> None:
    """Bearings drawn 0.3 m outside the crosses; both shafts at 25 degrees to the middle one, in the x-y plane."""
    p, q = np.zeros(3), np.array([0.5, 0.0, 0.0])
    lean = matmul(around((0, 0, 1), 25.0), (1.0, 0.0, 0.0))
    up, across = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    disc(m, "input", p - 0.3 * lean, lean, 0.1, 2.0)
    disc(m, "shaft", (p + q) / 2, q - p, 0.04, 3.0)
    disc(m, "output", q + 0.3 * lean, lean, 0.12, 2.0)
    m.add_revolute("in", "ground", "input", point=p - 0.3 * lean, axis=lean, cut="never")
    m.add_universal("cross 1", "input", "shaft", point=p, axis1=up, axis2=across)
    m.add_universal("cross 2", "shaft", "output", point=q, axis1=across, axis2=up)
    m.add_revolute("out", "ground", "output", point=q + 0.3 * lean, axis=lean)


@member(MEMBERS, "rscr", "spatial four-bar with a ball and a cylinder on its coupler (RSCR)",
        Truth(1, 0, EVERYTHING, why="Kutzbach: 1 + 3 + 2 + 1 degrees of freedom of the joints - 6 of the loop = 1",
              source=DIMENTBERG), rates={"R1": 3.0}, gravity=FALL)  # fmt: skip
def rscr(m: Mechanism) -> None:
    """Crank 0.3; the coupler slides and turns along a pin of the rocker."""
    ball, pin, foot = np.array([0.2, 0.2, 0.1]), np.array([0.9, 0.3, 0.6]), np.array([1.0, 0.1, 0.0])
    link(m, "crank", np.zeros(3), ball, density=3.0)
    link(m, "coupler", ball, pin)
    link(m, "rocker", foot, pin)
    m.add_revolute("R1", "ground", "crank", point=(0, 0, 0), axis=(-0.1, 0.1, 1.0), cut="never")
    m.add_spherical("S", "crank", "coupler", point=ball)
    m.add_cylindrical("C", "rocker", "coupler", point=pin, axis=(0.3, 1.0, -0.2))
    m.add_revolute("R2", "ground", "rocker", point=foot, axis=(0.2, 1.0, 0.3))


@member(MEMBERS, "rccc", "spatial four-bar of a hinge and three cylinders (RCCC)",
        Truth(1, 0, EVERYTHING, why="Kutzbach: 1 + 2 + 2 + 2 degrees of freedom of the joints - 6 of the loop = 1",
              source=DIMENTBERG), rates={"R": 3.0})  # fmt: skip
def rccc(m: Mechanism) -> None:
    """Four skew axes, their directions the corners of a spherical crank-rocker."""
    points = [np.array(x) for x in ((0.0, 0.0, 0.0), (0.3, 0.1, 0.0), (0.8, 0.6, 0.2), (0.9, 0.0, -0.1))]
    axes = [np.array((0.0, 0.0, 1.0)), matmul(around((1, 0.3, 0), 25.0), (0, 0, 1)), unit((0.6, 1.0, 0.9)),
            matmul(around((0, 1, 0), 80.0), (0, 0, 1))]  # fmt: skip
    for name, near, far in (("crank", 0, 1), ("coupler", 1, 2), ("rocker", 3, 2)):
        link(m, name, points[near], points[far])
    m.add_revolute("R", "ground", "crank", point=points[0], axis=axes[0], cut="never")
    m.add_cylindrical("C1", "crank", "coupler", point=points[1], axis=axes[1])
    m.add_cylindrical("C2", "rocker", "coupler", point=points[2], axis=axes[2])
    m.add_cylindrical("C3", "ground", "rocker", point=points[3], axis=axes[3])
    m.add_spring("rest", "ground", points[3] + 0.5 * axes[3], "rocker", (0, 0, 0), stiffness=50.0)


@member(MEMBERS, "gyroscope", "gyroscope in two gimbals, out of balance a little",
        Truth(3, 0, EVERYTHING, why="an open chain of three hinges", source=MAGNUS),
        rates={"outer": 0.3, "inner": 0.2, "spin": 60.0}, gravity=FALL, samples=1001, seconds=3.0)  # fmt: skip
def gyroscope(m: Mechanism) -> None:
    """The rotor's centre is 5 mm from the intersection of the axes; the inner frame starts tilted by 30 degrees."""
    axis = matmul(around((1, 0, 0), 30.0), (0.0, 1.0, 0.0))
    disc(m, "outer frame", REST, (0, 1, 0), 0.12, 0.3)
    disc(m, "inner frame", REST, (1, 0, 0), 0.1, 0.2)
    disc(m, "rotor", 0.005 * axis, axis, 0.07, 1.0)
    m.add_revolute("outer", "ground", "outer frame", point=REST, axis=(0, 0, 1))
    m.add_revolute("inner", "outer frame", "inner frame", point=REST, axis=(1, 0, 0))
    m.add_revolute("spin", "inner frame", "rotor", point=REST, axis=axis)


@member(MEMBERS, "heavy-top", "Lagrange's heavy top on a ball joint",
        Truth(3, 0, EVERYTHING, why="a ball joint leaves three rotations", source=MAGNUS),
        rates={"tip": (0.0, 0.5, 150.0)}, gravity=FALL, samples=1501, seconds=3.0)  # fmt: skip
def heavy_top(m: Mechanism) -> None:
    """A disc 0.1 m from its tip, leaning by 40 degrees."""
    axis = matmul(around((0, 1, 0), 40.0), (0.0, 0.0, 1.0))
    disc(m, "top", 0.1 * axis, axis, 0.06, 0.5)
    m.add_spherical("tip", "ground", "top", point=REST)


@member(MEMBERS, "gyro-pair", "two rotors against each other in a frame that flies freely",
        Truth(8, 0, EVERYTHING, why="six of the frame and one rotation of each rotor", source=MAGNUS),
        rates={"flight": (0.1, 0.0, 0.05, 0.2, 0.3, 0.1), "left": 80.0, "right": -70.0}, gravity=REST,
        samples=1501, seconds=6.0)  # fmt: skip
def gyro_pair(m: Mechanism) -> None:
    """Axes inclined to each other by 60 degrees."""
    link(m, "frame", REST, (0.2, 0, 0), (-0.2, 0, 0), (0, 0.1, 0), density=3.0)
    m.add_free("flight", "ground", "frame", point=REST)
    for side, x, lean in (("left", -0.2, -30.0), ("right", 0.2, 30.0)):
        axis = matmul(around((0, 1, 0), lean), (0.0, 0.0, 1.0))
        disc(m, f"rotor {side}", (x, 0, 0), axis, 0.08, 0.8)
        m.add_revolute(side, "frame", f"rotor {side}", point=(x, 0, 0), axis=axis)
