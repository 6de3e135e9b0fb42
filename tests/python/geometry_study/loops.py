"""Exact drawings with one small singular value, 2e-3 to 1e-2 of the next, that is a condition all the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .drawing import Drawing, X, Z, unit
from .judge import Case
from .linkages import direction, ring, turn
from .program import Program
from .seeming import chain

COUNT = 200
BAND = (2e-3, 1e-2)
Maker = Callable[[Any, float], tuple[Drawing, int]]


def seven(rng: Any, small: float) -> tuple[Drawing, int]:
    """Seven hinges whose axes all but meet one line."""
    line, along = rng.uniform(-0.3, 0.3, 3), direction(rng)
    hinges = []
    for i in range(7):
        angle = 2.0 * np.pi * i / 7.0
        point = np.array([np.cos(angle), np.sin(angle), 0.0]) + 0.3 * rng.uniform(-1, 1, 3)
        axis = unit(line + rng.uniform(-1.5, 1.5) * along - point)
        hinges.append((point, unit(axis + small * rng.uniform(-1, 1, 3))))
    return ring(hinges), 1


def seven_parallel(rng: Any, small: float) -> tuple[Drawing, int]:
    """Seven hinges, five of them nearly parallel on purpose: 2e-3 rad and more."""
    hinges = []
    for i in range(7):
        angle = 2.0 * np.pi * i / 7.0
        point = np.array([np.cos(angle), np.sin(angle), 0.0]) + 0.3 * rng.uniform(-1, 1, 3)
        axis = Z + max(small, 2e-3) * rng.uniform(-1, 1, 3) if i not in (2, 5) else direction(rng)
        hinges.append((point, unit(axis)))
    return ring(hinges), 1


def two_parallels(rng: Any, small: float) -> tuple[Drawing, int]:
    """Seven hinges in two groups nearly parallel to two directions: nearly the linkage of Sarrus."""
    other = unit([rng.uniform(-0.3, 0.3), 1.0, 0.2])
    hinges = []
    for i in range(7):
        angle = 2.0 * np.pi * i / 7.0
        point = np.array([np.cos(angle), np.sin(angle), 0.0]) + 0.3 * rng.uniform(-1, 1, 3)
        hinges.append((point, unit((Z if i < 4 else other) + max(small, 2e-3) * rng.uniform(-1, 1, 3))))
    return ring(hinges), 1


def five_tilted(rng: Any, small: float) -> tuple[Drawing, int]:
    """As `seven_parallel`, the axes 2e-3 to 5e-3 rad out of parallel whatever the singular values."""
    return seven_parallel(rng, rng.uniform(2e-3, 5e-3))


def groups_tilted(rng: Any, small: float) -> tuple[Drawing, int]:
    """As `two_parallels`, the axes 2e-3 to 5e-3 rad out of parallel whatever the singular values."""
    return two_parallels(rng, rng.uniform(2e-3, 5e-3))


def kite(rng: Any, small: float) -> tuple[Drawing, int]:
    """A four-bar all but flat."""
    a, b, c = rng.uniform(0.3, 1.0, 3)
    off = small * rng.uniform(-1.0, 1.0, 2)
    points = [(0, 0, 0), (a, off[0], 0), (a + b, off[1], 0), (a + b - c, 0, 0)]
    return chain(points), 1


def with_balls(rng: Any, small: float) -> tuple[Drawing, int]:
    """Crank, rod with two balls, rocker; the crank nearly a dead one, its rod nearly through both axes."""
    points = [np.array(p) + 0.1 * rng.uniform(-1, 1, 3) for p in ((0, 0, 0), (0.4, 0.1, 0), (1.2, 0.3, 0), (1.6, 0, 0))]
    rod = unit(points[2] - points[1])
    axes = []
    for end, near in ((0, 1), (3, 2)):
        # the axis lies, but for `small`, in the plane of its arm and of the rod
        arm = points[near] - points[end]
        axes.append(unit(unit(arm + rng.uniform(0.3, 1.0) * rod) + small * direction(rng)))
    return chain(points, [axes[0], Z, Z, axes[1]], "RSSR"), 2


def legs(rng: Any, small: float) -> tuple[Drawing, int]:
    """A platform on five bars whose lines all but meet two lines: one degree of freedom."""
    d = Drawing((0, 0, -9.81))
    d.body("platform", (0, 0, 1.0), 2.0, (0.3, 0.4, 0.5))
    lower, upper = direction(rng), direction(rng)
    for i in range(5):
        foot = rng.uniform(-1.5, 1.5) * lower
        along = unit([0, 0, 1.0] + rng.uniform(-1.0, 1.0) * upper - foot) + small * rng.uniform(-1, 1, 3)
        d.bar(f"leg{i}", "ground", foot, "platform", foot + rng.uniform(0.8, 1.2) * along)
    return d, 1


def legs_in_line(rng: Any, small: float) -> tuple[Drawing, int]:
    """A planar machine of three legs of two links, all but stretched, their lines all but through one point."""
    d, pole = Drawing((3.0, -9.0, 0.0)), np.array([*rng.uniform(-0.3, 0.3, 2), 0.0])
    d.body("platform", (0, 0, 0), 2.0)
    for leg in range(3):
        angle = 2.1 * leg + rng.uniform(-0.3, 0.3)
        out = turn(Z, angle) @ X
        side = np.cross(Z, out)
        seat, knee, foot = (pole + x * out + small * rng.uniform(-1, 1) * side for x in (0.4, 0.9, 1.5))
        d.rod(f"lower{leg}", foot, knee)
        d.rod(f"upper{leg}", knee, seat)
        d.hinge(f"A{leg}", "ground", f"lower{leg}", foot)
        d.hinge(f"B{leg}", f"lower{leg}", f"upper{leg}", knee)
        d.hinge(f"C{leg}", f"upper{leg}", "platform", seat)
    return d, 3


def short_link(rng: Any, small: float) -> tuple[Drawing, int]:
    """Crank, two balls and rocker; the crank is 1e-3 of the others. A length is small, no singular value."""
    tip = max(0.3 * small, 1e-3) * turn(Z, rng.uniform(0, 6.28)) @ X
    points = [np.zeros(3), tip, np.array([0.8, 0.5, 0.1]), np.array([1.0, 0.0, 0.0])]
    points[2] += 0.1 * rng.uniform(-1, 1, 3)
    return chain(points, [Z, Z, Z, unit([0.3, rng.uniform(-0.3, 0.3), 1.0])], "RSSR"), 2


def two_loops(rng: Any, small: float) -> tuple[Drawing, int]:
    """A kite and a four-bar on its rocker."""
    a, b, c = rng.uniform(0.4, 0.9, 3)
    off = small * rng.uniform(-1.0, 1.0, 2)
    d = chain([(0, 0, 0), (a, off[0], 0), (a + b, off[1], 0), (a + b - c, 0, 0)])
    tip, knee, foot = (
        np.array([a + b, off[1], 0]),
        np.array([a + b + 0.6, 0.7, 0.0]),
        np.array([a + b + 0.9, -0.2, 0.0]),
    )
    d.rod("next", tip, knee)
    d.rod("last", foot, knee)
    d.hinge("K0", "link2", "next", tip)
    d.hinge("K1", "next", "last", knee)
    d.hinge("K2", "ground", "last", foot)
    return d, 1


MAKERS: tuple[Maker, ...] = (
    seven, seven_parallel, two_parallels, kite, with_balls, legs, legs_in_line, short_link, two_loops,
    five_tilted, groups_tilted,
)  # fmt: skip
PLANAR = (kite, legs_in_line, two_loops)
FREE = (short_link, five_tilted, groups_tilted)
"""Small by their dimensions, whatever the singular values."""


def least(d: Drawing, mobility: int, planar: bool) -> float:
    """The least singular value that is a condition, over the next one.

    A planar drawing in space keeps three conditions too many for each loop; the same number in every position.
    """
    s = Program(d).singular_values()
    rank = s.size - mobility
    if s[rank - 1] < 1e-7 * s[0] or (mobility and s[rank] > 1e-12 * s[0]):
        return 0.0
    assert planar or s.size - rank == mobility
    return float(s[rank - 1] / s[rank - 2])


def case(seed: int) -> Case:
    """What the maker takes for small is changed until the singular value is as small as wanted."""
    rng = np.random.default_rng([4, seed])
    make = MAKERS[seed % len(MAKERS)]
    wanted = np.exp(rng.uniform(*np.log(BAND)))
    for attempt in range(50):
        small = float(wanted)
        for _ in range(12):
            own = np.random.default_rng([4, seed, attempt])
            d, mobility = make(own, small)
            ratio = least(d, mobility, make in PLANAR)
            # stretched legs snap: their motion is stiff
            span = 0.02 if make is legs_in_line else 0.15
            if BAND[0] <= ratio <= BAND[1] or make in FREE:
                return Case(f"{make.__name__} {ratio:.1e}", d, d, mobility, span=span, clear=True, tolerance=1e-6)
            if ratio == 0.0:
                break
            small = float(np.clip(small * wanted / ratio, small / 5.0, small * 5.0))
    raise AssertionError(f"{make.__name__} {seed}: no drawing with a singular value of {wanted:.1e}")
