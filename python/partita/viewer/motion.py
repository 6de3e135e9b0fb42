"""Positions and velocities of bodies and joints over the outputs of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..result_view import ResultView

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Positions of nb bodies and nj joints over nt outputs; the ground is body -1."""

    position: FloatArray  # (nt, nb, 3) origins of the bodies
    rotation: FloatArray  # (nt, nb, 3, 3)
    point: FloatArray  # (nt, nj, 3) points of the joints
    rate: FloatArray  # (nt, nb, 3) velocities of the origins
    spin: FloatArray  # (nt, nb, 3) angular velocities
    size: float  # diagonal of the box around all of it, over all time; 1 when there is no extent

    def placed(self, body: int, point: FloatArray) -> FloatArray:
        """A point in the axes of a body, in the world (nt, 3)."""
        if body < 0:
            return np.broadcast_to(point, (len(self.point), 3))
        return np.asarray(self.position[:, body] + self.rotation[:, body] @ point)

    def on_body(self, body: int, points: FloatArray) -> FloatArray:
        """World points (nt, 3) in the axes of a body, (nt, 3)."""
        if body < 0:
            return points
        return np.einsum("tji,tj->ti", self.rotation[:, body], points - self.position[:, body])


def motion_of(result: ResultView) -> Motion:
    """The motion of all bodies and joints; of a single position without velocities."""
    nt = len(result.t)
    bodies = [result.body(name) for name in result.names.bodies]
    position = np.array([b.position for b in bodies], dtype=float).reshape(-1, nt, 3).transpose(1, 0, 2)
    rate = spin = np.zeros_like(position)
    if nt > 1:
        rate, spin = (
            np.array([getattr(b, word) for b in bodies], dtype=float).reshape(-1, nt, 3).transpose(1, 0, 2)
            for word in ("velocity", "angular_velocity")
        )
    rotation = np.array([b.rotation for b in bodies], dtype=float).reshape(-1, nt, 3, 3).transpose(1, 0, 2, 3)
    joints = [result.joint(name).point for name in result.names.joints]
    point = np.array(joints, dtype=float).reshape(-1, nt, 3).transpose(1, 0, 2)
    seen = np.concatenate([position.reshape(-1, 3), point.reshape(-1, 3)])
    seen = seen[np.isfinite(seen).all(axis=1)]
    size = float(np.linalg.norm(np.ptp(seen, axis=0))) if len(seen) else 0.0
    return Motion(position, rotation, point, rate, spin, size or 1.0)
