"""One body of a run: its position, its rotation, and any point fixed to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..numeric import floats, shown

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class BodyResult:
    """Motion of one body over the nt outputs of a run, all in world axes.

    The ground may be asked for too, as `"ground"`: it rests at the origin.
    """

    name: str
    position: FloatArray
    """(nt, 3): the origin of the body's axes [m]."""
    rotation: FloatArray
    """(nt, 3, 3): columns are the body's axes in the world."""
    velocity: FloatArray
    """(nt, 3): velocity of that origin [m/s]."""
    angular_velocity: FloatArray
    """(nt, 3): angular velocity [rad/s]."""

    def point(self, point: ArrayLike) -> FloatArray:
        """Path (nt, 3) [m] in the world of a point fixed to the body, `point` in body axes from its origin.

        Raises `ArgumentError` unless `point` is three finite numbers.
        """
        return self.position + self.rotation @ _three(point)

    def point_velocity(self, point: ArrayLike) -> FloatArray:
        """Velocity (nt, 3) [m/s] in world axes of a point fixed to the body, `point` in body axes."""
        return self.velocity + np.cross(self.angular_velocity, self.rotation @ _three(point))

    def __repr__(self) -> str:
        return f"<body {self.name!r}: {len(self.position)} outputs>"


def _three(point: ArrayLike) -> FloatArray:
    try:
        p = floats(point)
    except TypeError:
        p = np.empty(0)
    if p.shape != (3,) or not np.all(np.isfinite(p)):
        raise ArgumentError(
            f"a point is three finite numbers (x, y, z) in body axes, in metres; got {shown(point)}", argument="point"
        )
    return p


def resting(name: str, nt: int) -> BodyResult:
    """The ground as a body."""
    zero = np.zeros((nt, 3))
    return BodyResult(name, zero, np.broadcast_to(np.eye(3), (nt, 3, 3)), zero, zero)
