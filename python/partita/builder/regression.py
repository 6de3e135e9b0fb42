"""Regressors of identification and their least squares, by the compiled core."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core

Array = NDArray[np.float64]
Channel = dict[str, Any]
"""{"effort": number of the actuator}, {"ground": component} or {"joint": [number, component]}; components of a wrench:
force x, y, z, then moment."""


def regressor(
    inverse: _core.Inverse,
    measured: tuple[_core.Inverse, list[int]],
    path: Sequence[Array],
    numbers: dict[str, list[float]],
    directions: list[list[float]],
    channels: Sequence[Channel],
) -> tuple[Array, Array, list[str]]:
    """Values (nt, channels) of what is measured along a motion (t, q, v, v'), derivatives (nt, channels, n) along the
    directions of the numbers of parameters, the measured coordinates held, and why an instant has none ("" where it
    has). `measured`: the same actuators and further coordinates, and which of these are measured."""
    seen, held = measured
    t, q, v, vdot = (np.ascontiguousarray(x, dtype=float) for x in path)
    names, values = list(numbers), list(numbers.values())
    found = inverse.regressor(seen, held, t, q, v, vdot, names, values, directions, json.dumps(list(channels)))
    return found["values"], found["derivatives"], found["gaps"]


def least_squares(
    derivatives: Array, residuals: Array, sizes: Array, noise: Array, scales: Array, preference: Array
) -> dict[str, Any]:
    """Rank, base parameters, changes and standard deviations; see `_core.least_squares`."""
    arrays = (derivatives, residuals, sizes, noise, scales, preference)
    return _core.least_squares(*(np.ascontiguousarray(x, dtype=float) for x in arrays))
