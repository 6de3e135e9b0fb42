"""Closed planar loops by ruler and compass: reference solutions for motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..products import norm

FloatArray = NDArray[np.float64]


def meet(p: ArrayLike, q: ArrayLike, to_p: float, to_q: float, side: int) -> FloatArray:
    """The point (..., 2) at the distances `to_p` from p and `to_q` from q (..., 2) [m].

    Two circles meet twice: `side` 1 is the point to the left of the line from p to q, -1 that to its right. Circles
    that do not meet give NaN.
    """
    first, second = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    offset = second - first
    square = np.sum(offset**2, axis=-1, keepdims=True)
    along = (square + to_p**2 - to_q**2) / (2.0 * square)
    height = to_p**2 / square - along**2
    across = side * np.sqrt(np.where(height >= 0.0, height, np.nan))
    return np.asarray(first + along * offset + across * turned(offset))


def turned(vector: FloatArray, angle: float = np.pi / 2) -> FloatArray:
    """Plane vectors (..., 2) turned counter-clockwise by `angle` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def arms(*ends: ArrayLike) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass (3,), inertia about it (3, 3) of slender arms of 1 kg/m from the origin to `ends` (3,)."""
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for end in ends:
        p = np.asarray(end, dtype=float)
        length = float(norm(p))
        mass += length
        first += length * p / 2.0
        second += length * np.outer(p, p) / 3.0
    com = first / mass
    about_com = second - mass * np.outer(com, com)
    return mass, com, np.trace(about_com) * np.eye(3) - about_com


@dataclass(frozen=True)
class FourBar:
    """Lengths [m] of a four-bar from A = (0, 0) over B and C to D = (ground, 0)."""

    crank: float
    coupler: float
    rocker: float
    ground: float

    def angles(self, crank_angle: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angles of B-C and of D-C from the ground line A-D [rad], on the open branch, for angles of A-B.

        Open: C lies to the left of the diagonal from B to D. Two circles meet, hence the arc cosine; lengths that
        do not close give NaN.
        """
        phi = np.asarray(crank_angle, dtype=float)
        x, y = self.ground - self.crank * np.cos(phi), -self.crank * np.sin(phi)  # from B to D
        diagonal = np.hypot(x, y)
        cosine = (self.coupler**2 + diagonal**2 - self.rocker**2) / (2.0 * self.coupler * diagonal)
        coupler = np.arctan2(y, x) + np.arccos(cosine)
        rocker = np.arctan2(self.coupler * np.sin(coupler) - y, self.coupler * np.cos(coupler) - x)
        return coupler, rocker

    def points(self, crank_angle: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """A, B, C, D in the plane z = 0 (3,) [m] on the open branch."""
        coupler, _ = self.angles(crank_angle)
        a, d = np.zeros(3), np.array([self.ground, 0.0, 0.0])
        b = self.crank * np.array([np.cos(crank_angle), np.sin(crank_angle), 0.0])
        c = b + self.coupler * np.array([np.cos(coupler), np.sin(coupler), 0.0])
        return a, b, c, d
