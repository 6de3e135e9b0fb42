"""Inertias that no body can have, replaced by the nearest possible ones.

The principal moments of a body are sums of two of the second moments of its mass along the principal axes, none of
which is negative (Wensing, Kim and Slotine, Linear matrix inequalities for physically consistent inertial parameter
identification, IEEE Robotics and Automation Letters 3, 2018). The nearest such matrix is that of the smallest
Frobenius norm of the difference: it has the same principal axes, and does not depend on the axes of the file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..products import matmul, principal
from ..tolerance import EQUAL_IN_SIX_DIGITS, LONG_ROUNDING
from .reading import Reading, Remark
from .robot import Array, Robot


def links(robot: Robot) -> None:
    """Repair the inertias of all links, if the caller did not ask for strictness."""
    if robot.request.inertia != "repair":
        return
    scale = max((float(np.abs(link.inertia).max()) for link in robot.links.values()), default=0.0)
    for link in robot.links.values():
        link.inertia, change = repaired(link.inertia, scale)
        if change:
            robot.reading.changed.append(Remark(robot.line(link.at), change, f'link "{link.name}"', "motion"))


def of_reading(reading: Reading) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Repairs the inertia among the arguments of a body, and reports it."""

    def mend(arguments: dict[str, Any]) -> dict[str, Any]:
        try:
            given = np.array(arguments["inertia"], dtype=float)
        except (KeyError, TypeError, ValueError):
            return arguments
        tensor = np.diag(given) if given.shape == (3,) else given
        if tensor.shape != (3, 3) or not np.array_equal(tensor, tensor.T) or not np.all(np.isfinite(tensor)):
            return arguments
        found, change = repaired(tensor, 0.0)
        if found is tensor:
            return arguments
        if change:
            reading.changed.append(Remark(None, change, f'body "{arguments.get("name")}"', "motion"))
        return {**arguments, "inertia": found.tolist()}

    return mend


def repaired(inertia: Array, scale: float) -> tuple[Array, str]:
    """The inertia, or the nearest that a body can have; and what was changed, unless by rounding: the last digits, or
    less than `LONG_ROUNDING` of `scale`."""
    size = float(np.abs(inertia).max())
    if size == 0.0:
        return inertia, ""
    values, axes = principal(inertia / size)
    if values[0] >= 0.0 and values[2] <= values[0] + values[1] + EQUAL_IN_SIX_DIGITS:
        return inertia, ""
    if values[0] >= -EQUAL_IN_SIX_DIGITS and values[2] <= values[0] + values[1] + EQUAL_IN_SIX_DIGITS:
        fit = np.maximum(values, 0.0)  # sums off in the last digits of a file are harmless, negative moments are not
    else:
        fit = nearest_moments(values)
    found = matmul(size * (axes * fit), axes.T)
    change = float(np.abs(fit - values).max())
    if change <= EQUAL_IN_SIX_DIGITS or change * size <= LONG_ROUNDING * scale:
        return 0.5 * (found + found.T), ""
    shown = [", ".join(f"{size * x:.6g}" for x in moments) for moments in (values, fit)]
    words = f"its inertia has the principal values {shown[0]}, which no body has; {shown[1]} kg m^2, the nearest that"
    return 0.5 * (found + found.T), f'{words} one can have, are used. inertia="strict" refuses it instead'


def nearest_moments(values: Array) -> Array:
    """The nearest (least squares) to ascending principal values that are sums of second moments of at least 0."""
    small, middle, large = values
    third = (large - small - middle) / 3.0  # on the plane where the largest is the sum of the two others
    if small + third >= 0.0:
        return np.array([small + third, middle + third, large - third]) if third > 0.0 else values
    mean = max(0.5 * (middle + large), 0.0)  # all mass on the first axis, or none
    return np.array([0.0, mean, mean])
