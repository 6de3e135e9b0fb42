"""Exact drawings that only look misdrawn: small lengths, hinges near each other, axes nearly parallel on purpose,
drawn in a singular position."""

from __future__ import annotations

from typing import Any

import numpy as np

from .drawing import Drawing, X, Z, unit
from .judge import Case
from .linkages import turn

COUNT = 40


def chain(points: list[Any], axes: list[Any] | None = None, kinds: str = "", gravity: Any = (0, -9.81, 0)) -> Drawing:
    """A closed loop through points: "R" hinges (the default) and "S" balls; the last link is the ground."""
    points = [np.array(p, dtype=float) for p in points]
    d = Drawing(gravity)
    for i in range(len(points) - 1):
        d.rod(f"link{i}", points[i], points[i + 1])
    names = ["ground", *(f"link{i}" for i in range(len(points) - 1)), "ground"]
    for i, point in enumerate(points):
        kind = "spherical" if (kinds or "R" * len(points))[i] == "S" else "revolute"
        d.joint(kind, f"J{i}", names[i], names[i + 1], point, axes[i] if axes else Z)
    return d


def eccentric(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """A crank of 1.5e-4 of the size."""
    angle = rng.uniform(0, 2 * np.pi)
    tip = 1.5e-4 * np.array([np.cos(angle), np.sin(angle), 0.0])
    d = chain([(0, 0, 0), tip, (*rng.uniform(0.6, 0.9, 2), 0), (rng.uniform(0.9, 1.1), 0, 0)])
    return d, 1, {"J0": 6.0}


def eccentrics(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """A rod on an eccentric, and on the rod an eccentric with a rod of its own: two degrees of freedom, small ones."""
    tips = [1.5e-4 * (turn(Z, angle) @ X) for angle in rng.uniform(0, 2 * np.pi, 2)]
    b = np.array([*rng.uniform(0.6, 0.9, 2), 0.0])
    return chain([(0, 0, 0), tips[0], b, b + tips[1], (rng.uniform(1.0, 1.3), 0, 0)]), 2, {}


def short(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """A slider and a crank that is shorter than four drawing tolerances."""
    crank = rng.uniform(1e-4, 4e-4)
    angle, end = rng.uniform(0.3, 1.2), np.array([0.8, 0.1, 0.0])
    d = Drawing()
    tip = crank * np.array([np.cos(angle), np.sin(angle), 0.0])
    d.rod("crank", (0, 0, 0), tip)
    d.rod("rod", tip, end)
    d.body("slide", end)
    d.hinge("J0", "ground", "crank", (0, 0, 0))
    d.hinge("J1", "crank", "rod", tip)
    d.hinge("J2", "rod", "slide", end)
    d.joint("prismatic", "guide", "ground", "slide", end, unit([1.0, 0.3, 0.0]))
    return d, 1, {"J0": 5.0}


def near_hinges(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """Two hinges of one body 1e-4 apart: a five-bar of two degrees of freedom."""
    b = np.array([*rng.uniform(0.3, 0.5, 2), 0.0])
    away = 1e-4 * (turn(Z, rng.uniform(0, 6.28)) @ X)
    return chain([(0, 0, 0), b, b + away, (1.3, 0.8, 0), (1.1, 0, 0)]), 2, {}


def folded_parallelogram(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """A parallelogram drawn flat: one degree of freedom on each of two branches."""
    a, c = rng.uniform(0.3, 0.6), rng.uniform(0.8, 1.2)
    return chain([(0, 0, 0), (a, 0, 0), (a + c, 0, 0), (c, 0, 0)]), 1, {}


def in_line(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """Crank and coupler in line, dead but not singular; gravity moves it on."""
    a, b, c = 0.4, rng.uniform(0.7, 0.9), rng.uniform(0.6, 0.9)
    angle = rng.uniform(0.5, 1.0)
    u = np.array([np.cos(angle), np.sin(angle), 0.0])
    d = np.array([rng.uniform(1.0, 1.2), 0.0, 0.0])
    top, gap = (a + b) * u, np.linalg.norm((a + b) * u - d)
    return chain([(0, 0, 0), a * u, top, d if gap > 1e-3 else d + c * X]), 1, {}


def nearly_parallel(rng: Any) -> tuple[Drawing, int, dict[str, float]]:
    """A spatial crank, rod with two balls and rocker, axes 3e-4 rad out of parallel on purpose; the rod spins."""
    tilt = unit([3e-4, 0.0, 1.0])
    points = [(0, 0, 0), (0.3, 0.4, 0.1), (1.1, 0.9, -0.2), (1.2, 0, 0)]
    points = [np.array(p) + 0.05 * rng.uniform(-1, 1, 3) for p in points]
    return chain(points, [Z, Z, Z, tilt], "RSSR"), 2, {}


MAKERS = (eccentric, eccentrics, short, near_hinges, folded_parallelogram, in_line, nearly_parallel)


def case(seed: int) -> Case:
    rng = np.random.default_rng([5, seed])
    make = MAKERS[seed % len(MAKERS)]
    true, mobility, rates = make(rng)
    name = make.__name__.replace("_", " ")
    # drawn flat it may leave on either branch
    return Case(
        name,
        true,
        true,
        mobility,
        rates=rates,
        span=0.2,
        may_refuse=make is folded_parallelogram,
        tolerance=1e-5,
        by_energy=make is folded_parallelogram,
    )
