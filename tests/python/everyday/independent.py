"""The motion of a drawing by the independent program: six coordinates for each body, integrated by SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
from oracle.drawing import Array, Drawing
from oracle.maximal import Maximal, Pose
from scipy.integrate import solve_ivp

EVALUATIONS = 800


class TooLong(Exception):
    """More evaluations than allowed."""


def motion(
    d: Drawing, frames: dict[str, Array], start: dict[str, Any], times: Array, tolerance: float, finest: float
) -> tuple[int, dict[str, Pose]] | None:
    """The last of the times that it gets to by steps that miss nothing, and the poses there; None: not even the second
    one."""
    program, names, spent = Maximal(d, frames), [b.name for b in d.bodies], 0
    y0 = np.concatenate([
        np.concatenate([start[n].position[0], start[n].rotation[0].ravel(), start[n].velocity[0],
                        start[n].angular_velocity[0]]) for n in names
    ])  # fmt: skip

    def poses(y: Array) -> dict[str, Pose]:
        parts = y.reshape(-1, 18)
        return {
            n: Pose(x[:3], orthogonal(x[3:12].reshape(3, 3)), x[12:15], x[15:])
            for n, x in zip(names, parts, strict=True)
        }

    def rates(t: float, y: Array) -> Array:
        nonlocal spent
        spent += 1
        if spent > EVALUATIONS:
            raise TooLong
        at = poses(y)
        found = program.at(t, at)
        out = []
        for b in d.bodies:
            p, (a, alpha) = at[b.name], found.acceleration[b.name]
            arm = p.rotation @ b.com
            # of the origin, from that of the centre of mass
            origin = a - np.cross(alpha, arm) - np.cross(p.w, np.cross(p.w, arm))
            out += [p.u, np.cross(p.w, p.rotation.T).T.ravel(), origin, alpha]
        return np.concatenate(out)

    y, reached = y0, 0
    for k in range(1, len(times)):
        try:
            span, limits = (times[k - 1], times[k]), {"rtol": tolerance, "atol": tolerance, "max_step": finest}
            found = solve_ivp(rates, span, y, method="DOP853", **limits)
        except TooLong:
            break
        y, reached = found.y[:, -1], k
    return (reached, poses(y)) if reached else None


def orthogonal(r: Array) -> Array:
    left, _, right = np.linalg.svd(r)
    return left @ right
