"""Closing a planar four-bar with ruler and compass: the answer its motion is checked against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


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
