"""Spatial slider-crank: a crank, a rod between a ball joint and a universal joint, and a slider."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..products import norm
from ..results import Result
from ..state import State
from .entry import Check, Entry, FloatArray, angle, largest_gap, path_error

PIN = np.array([0.0, 0.1, 0.12])  # hinge of the crank, about x
CRANK, ROD = 0.08, 0.3
MASSES = (0.12, 0.5, 2.0)
CRANK_RATE = 6.0

# t: crank angle from the upright [rad]. From the energy integral, t = integral of d(angle) / rate, in 30 digits.
CRANK_PATH = {1.0: (10.9135907298646679988,), 2.0: (21.0727445227764765241,), 5.0: (54.3333321683131650794,)}


def ball(crank_angle: FloatArray | float) -> FloatArray:
    """The joint of crank and rod (..., 3) [m] for angles of the crank from the upright."""
    phi = np.asarray(crank_angle, dtype=float)
    return np.asarray(PIN + CRANK * np.stack([np.zeros_like(phi), -np.sin(phi), np.cos(phi)], axis=-1))


def slide(crank_angle: FloatArray | float) -> FloatArray:
    """Position of the slider on the x axis [m], by Pythagoras."""
    p = ball(crank_angle)
    return np.asarray(np.sqrt(ROD**2 - p[..., 1] ** 2 - p[..., 2] ** 2))


def build() -> Mechanism:
    """The drawing: crank upright, slider at 0.2 m. The universal joint lets the rod rotate about the slide, and about
    an axis of the rod that stays perpendicular to the slide."""
    m = Mechanism("spatial-slider-crank", gravity=(0, 0, -9.81))
    p, q = ball(0.0), np.array([float(slide(0.0)), 0.0, 0.0])
    x = np.array([1.0, 0.0, 0.0])
    along = (q - p) / ROD
    hinge = np.cross(x, along)
    hinge = hinge / norm(hinge)
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]).T  # columns: y, z, x of the world
    crank = m.add_body(
        "crank",
        mass=MASSES[0],
        inertia=(1e-4, 1e-5, 1e-4),
        com=(0, CRANK / 2, 0),
        position=PIN,
        orientation=upright,
    )
    rod = m.add_body(
        "rod",
        mass=MASSES[1],
        inertia=(4e-4, 4e-3, 4e-3),
        com=(ROD / 2, 0, 0),
        position=p,
        orientation=np.column_stack([along, hinge, np.cross(along, hinge)]),
    )
    slider = m.add_body("slider", mass=MASSES[2], inertia=(1e-4, 1e-4, 1e-4), position=q)
    m.add_revolute("A", m.ground, crank, point=PIN, axis=x, cut="never")
    m.add_spherical("B", crank, rod, point=p)
    m.add_universal("C", slider, rod, point=q, axis1=x, axis2=hinge)
    m.add_prismatic("D", m.ground, slider, point=q, axis=x)
    return m


def start(m: Mechanism) -> State:
    """As drawn, the crank turning with 6 rad/s."""
    return m.assemble(rates={"A": CRANK_RATE})


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A")[:, None], result, CRANK_PATH)


def slider(result: Result) -> float:
    """Largest distance of the slider from where Pythagoras puts it for the crank angle."""
    return largest_gap(result.body("slider").position[:, 0], slide(angle(result, "A")))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="spatial-slider-crank",
        title="spatial slider-crank with a ball joint and a universal joint on its rod",
        source="data: Library of Computational Benchmark Problems (IFToMM), spatial slider-crank; values: energy "
        "integral of its one equation of motion, in 30 digits, and Pythagoras for the slider",
        duration=5.0,
        build=build,
        start=start,
        times=tuple(CRANK_PATH),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-7, "rtol 1e-11 of 54 rad over some hundred steps, some margin", crank),
            Check("slider over crank angle [m]", 1e-11, "closure 1e-12, at most tenfold in the slide", slider),
        ),
        notes="The universal joint keeps the axis that is fixed in the rod perpendicular to the slide; with its two "
        "axes exchanged the rod would roll differently, which changes the motion.",
    )
