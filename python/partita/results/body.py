"""One body of a run: its position, its rotation, and any point fixed to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

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
    accelerations: Callable[[], tuple[FloatArray, FloatArray]] | None = None
    """Computes those of the origin and of the rotation; None where they are not known."""

    @property
    def acceleration(self) -> FloatArray:
        """(nt, 3): acceleration of that origin [m/s^2]; NaN at singular positions, where it is undetermined.

        Raises `ArgumentError` for a body of a stored result, of poses at rest, and for one that was pickled.
        """
        return self._accelerated()[0]

    @property
    def angular_acceleration(self) -> FloatArray:
        """(nt, 3): angular acceleration [rad/s^2]; as `acceleration`."""
        return self._accelerated()[1]

    def point(self, point: ArrayLike) -> FloatArray:
        """Path (nt, 3) [m] in the world of a point fixed to the body, `point` in body axes from its origin.

        Raises `ArgumentError` unless `point` is three finite numbers.
        """
        return self.position + self.rotation @ _three(point, self.name)

    def point_velocity(self, point: ArrayLike) -> FloatArray:
        """Velocity (nt, 3) [m/s] in world axes of a point fixed to the body, `point` in body axes."""
        return self.velocity + np.cross(self.angular_velocity, self.rotation @ _three(point, self.name))

    def point_acceleration(self, point: ArrayLike) -> FloatArray:
        """Acceleration (nt, 3) [m/s^2] in world axes of a point fixed to the body, `point` in body axes."""
        (acceleration, spin), arm, omega = (
            self._accelerated(),
            self.rotation @ _three(point, self.name),
            self.angular_velocity,
        )
        return acceleration + np.cross(spin, arm) + np.cross(omega, np.cross(omega, arm))

    def _accelerated(self) -> tuple[FloatArray, FloatArray]:
        if self.accelerations is None:
            raise ArgumentError(
                f"accelerations of body {self.name!r} need the model and a motion, which stored results, poses at rest "
                "and pickled bodies do not have; ask the result of simulate or kinematics, or add a sensor before "
                "storing it",
                argument="acceleration",
            )
        return self.accelerations()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "accelerations": None}  # a model cannot be pickled

    def __repr__(self) -> str:
        return f"<body {self.name!r}: {len(self.position)} outputs>"


def _three(point: ArrayLike, body: str) -> FloatArray:
    """Three numbers, or those of a `Point` of this body."""
    if isinstance(point, tuple) and len(point) == 2 and isinstance(point[0], str):
        if point[0] != body:
            raise ArgumentError(f'the point is one of "{point[0]}", but the body is "{body}"', argument="point")
        point = point[1]
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
    return BodyResult(name, zero, np.broadcast_to(np.eye(3), (nt, 3, 3)), zero, zero, lambda: (zero, zero))
