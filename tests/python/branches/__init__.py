"""Linkages that pass positions in which their branches meet, held against the branch followed by itself.

Two angles tell where a four-bar stands: those of its crank and its rocker. The length of the coupler is one equation
between them, a curve in their plane; in a singular position two branches of it cross. Followed step by step along its
own tangent the curve goes straight on there, and so must a motion without forces: its crank cannot turn back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from drawings import four_bar
from numpy.typing import NDArray

import partita as pt

Array = NDArray[np.float64]
Drawn = tuple[float, ...]

STEP = 4e-3
"""Length of a step along the curve [rad]; its prediction is good to the cube of it."""
BELIEVED = 0.5 * STEP**2
"""Corrections of that prediction beyond this belong to another branch."""
SETTLED = 1e-14
"""Corrections as small as the round-off of angles of some radians end the search for a point [rad]."""
BESIDE = 0.03
"""Outputs farther than this from the curve are on another branch [rad]."""
LOST = 1e-2
"""Part of the energy that no tolerance up to 1e-4 explains."""
ALLOWED = 100.0
"""Energy may be off by so many times a looser tolerance: on the right branch, an output inside a step of 1e-3 is."""
NEAR = 0.06
"""Gradient of the equation at a crossing that lies between two points of the curve."""


@dataclass(frozen=True)
class FourBar:
    """Crank, coupler, rocker and the distance of the two pivots, which lie on the axis of x."""

    crank: float
    coupler: float
    rocker: float
    ground: float

    def points(self, x: Array) -> list[Array]:
        """A, B, C, D for the angles of crank and rocker."""
        b = self.crank * np.array([np.cos(x[0]), np.sin(x[0])])
        d = np.array([self.ground, 0.0])
        c = d + self.rocker * np.array([np.cos(x[1]), np.sin(x[1])])
        return [np.zeros(2), b, c, d]

    def open(self, x: Array) -> float:
        """By how much the coupler does not fit (squared lengths)."""
        _, b, c, _ = self.points(x)
        return float((c - b) @ (c - b) - self.coupler**2)

    def gradient(self, x: Array) -> Array:
        """Of `open`: zero where branches cross."""
        _, b, c, _ = self.points(x)
        turned = (
            self.crank * np.array([-np.sin(x[0]), np.cos(x[0])]),
            self.rocker * np.array([-np.sin(x[1]), np.cos(x[1])]),
        )
        return 2.0 * np.array([-(c - b) @ turned[0], (c - b) @ turned[1]])

    def rockers(self, angle: float) -> tuple[float, float]:
        """The two angles of the rocker for one of the crank; NaN where none fits."""
        _, b, _, d = self.points(np.array([angle, 0.0]))
        r = b - d
        length = float(np.hypot(*r))
        cosine = (self.rocker**2 + length**2 - self.coupler**2) / (2.0 * self.rocker * length)
        middle = float(np.arctan2(r[1], r[0]))
        half = float(np.arccos(cosine)) if abs(cosine) <= 1.0 else np.nan
        return middle + half, middle - half


def crossed(rng: np.random.Generator) -> FourBar:
    """A parallelogram, begun crossed."""
    a = rng.choice([rng.uniform(0.4, 0.9), rng.uniform(1.1, 2.0)])
    return FourBar(a, 1.0, a, 1.0)


def kite(rng: np.random.Generator) -> FourBar:
    """Two pairs of equal neighbours: it folds onto itself."""
    a = rng.uniform(0.3, 0.8)
    return FourBar(a, a, 1.0, 1.0) if rng.random() < 0.5 else FourBar(a, 1.0, 1.0, a)


def folding(rng: np.random.Generator) -> FourBar:
    """The shortest and the longest as long as the other two: all four come into one line."""
    s, p, q = rng.uniform(0.3, 0.8), rng.uniform(0.85, 1.2), rng.uniform(0.85, 1.2)
    orders = ((s, p, p + q - s, q), (s, p + q - s, p, q), (p, s, q, p + q - s), (q, p + q - s, s, p))
    return FourBar(*orders[rng.integers(4)])


FULL = ("multipliers", "sparse-multipliers", "range-space", "proximal", "baumgarte")
"""Forms that integrate all velocities: a step over a position in which branches meet may end on either."""

CLOSED = ("wehage-haug", "tangent-space", "explicit-closing")
"""Forms in 2k states: a loop that is closed in every evaluation has two solutions next to a singular position."""

FAMILIES: dict[str, Callable[[np.random.Generator], FourBar]] = {
    "parallelogram": crossed,
    "crossed parallelogram": crossed,
    "kite": kite,
    "folding four-bar": folding,
}


def start(family: str, rng: np.random.Generator) -> tuple[FourBar, Array]:
    """A linkage of a family in a position away from its singular ones."""
    while True:
        bars = FAMILIES[family](rng)
        angle = rng.uniform(-np.pi, np.pi)
        both = sorted(bars.rockers(angle), key=lambda x: abs(np.exp(1j * x) - np.exp(1j * angle)))
        side = {"parallelogram": 0, "crossed parallelogram": 1}.get(family, int(rng.integers(2)))
        x = np.array([angle, both[side]])
        if np.isfinite(x).all() and abs(bars.gradient(x)).min() > 0.15:
            return bars, x


def follow(bars: FourBar, x: Array, sign: float, length: float) -> Array:
    """The branch through x, begun with a turn of the crank of this sign."""
    g = bars.gradient(x)
    along = np.array([-g[1], g[0]]) / np.hypot(*g)
    along *= sign * np.sign(along[0])
    points = [x]
    for _ in range(int(length / STEP)):
        # points so far are continued by a parabola, and the next one is moved across the way until it fits
        ahead = points[-1] - points[-2] if len(points) > 1 else STEP * along
        bend = points[-1] - 2.0 * points[-2] + points[-3] if len(points) > 2 else np.zeros(2)
        guess = points[-1] + ahead + bend
        across = np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
        moved = 0.0
        for _ in range(8):
            slope = float(bars.gradient(guess + moved * across) @ across)
            step = bars.open(guess + moved * across) / slope if slope else 0.0
            moved -= step
            if abs(step) < SETTLED:
                break
        # in the crossing itself nothing says where the curve is but the way so far
        believed = abs(moved) < BELIEVED or len(points) < 6
        after = guess + (moved if believed else 0.0) * across - points[-1]
        points.append(points[-1] + after * (STEP / np.hypot(*after)))
    return np.array(points)


@lru_cache(maxsize=64)
def branch(bars: FourBar, x: tuple[float, ...], sign: float, length: int) -> tuple[Array, Array]:
    """Result of `follow`, and the size of the gradient at each point: computed once for all runs along it."""
    curve = follow(bars, np.array(x), sign, length)
    return curve, np.array([np.hypot(*bars.gradient(p)) for p in curve])


def mechanism(bars: FourBar, x: Array, rng: np.random.Generator) -> pt.Mechanism:
    """The linkage at x, with rods of masses drawn by chance; no forces act."""
    return four_bar([(float(p[0]), float(p[1])) for p in bars.points(x)], 0.0, rng.uniform(0.5, 2.0, 3))


@dataclass(frozen=True)
class Trial:
    """What a run did: "right", "stopped" (with a message), "wrong" (with success); singular positions reported and
    crossed; whether its success is the same after the certificate was read."""

    outcome: str
    reported: int
    passed: int
    words: str
    steady: bool = True


def trial(family: str, seed: int, rtol: float, formulation: str = "projective", coordinates: str = "relative") -> Trial:
    """One linkage, moved for some seconds without forces."""
    rng = np.random.default_rng([seed, list(FAMILIES).index(family)])
    bars, x = start(family, rng)
    rate, duration = rng.uniform(1.0, 5.0) * rng.choice([-1.0, 1.0]), rng.uniform(3.0, 6.0)
    m = mechanism(bars, x, rng)
    run = m.simulate(
        duration,
        t_eval=np.linspace(0.0, duration, 400),
        initial=m.assemble(rates={"A": rate}, coordinates=coordinates),
        coordinates=coordinates,
        rtol=rtol,
        atol=0.01 * rtol,
        solver=pt.Solver(formulation, baumgarte=(20.0, 20.0) if formulation == "baumgarte" else None),
    )
    success = run.success
    steady = bool(run.certificate.verdict) and run.success is success
    turns = [np.arctan2(r[:, 1, 0], r[:, 0, 0]) for r in (run.body("crank").rotation, run.body("rocker").rotation)]
    angles = np.unwrap(np.array(turns).T, axis=0)
    angles += x - angles[0]
    distance = float(np.hypot(*np.diff(angles, axis=0).T).sum())
    curve, gradients = branch(bars, tuple(x.tolist()), float(np.sign(rate)), math.ceil(1.02 * distance + 0.1))
    at, beside = 0, 0.0
    for before, now in zip(angles[:1].tolist() + angles[:-1].tolist(), angles, strict=True):
        last = at + int(3.0 * np.hypot(*(now - before)) / STEP) + 10
        distances = np.hypot(*(curve[max(0, at - 5) : last] - now).T)
        at = max(0, at - 5) + int(np.argmin(distances))
        beside = max(beside, float(distances.min()))
    sizes = gradients[: at + 1]
    least = (sizes[1:-1] < sizes[:-2]) & (sizes[1:-1] <= sizes[2:]) & (sizes[1:-1] < NEAR)
    energy = run.energy.total
    lost = float(np.ptp(energy) / abs(energy[0]))
    wrong = beside > BESIDE or lost > max(LOST, ALLOWED * rtol)
    outcome = "stopped" if not run.success else "wrong" if wrong else "right"
    name = f"{family} {seed}, rtol {rtol:g}, {formulation}, {coordinates}"
    words = f"{name}: {beside:.1e} beside, {lost:.1e} lost; {run.message}"
    reported = sum(int(note.split()[0]) for note in run.notes if "were crossed" in note)
    return Trial(outcome, reported, int(least.sum()), words, steady)
