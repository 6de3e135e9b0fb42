"""Carts on wheels, misdrawn: they go as the exact ones, the same in both kinds of coordinates, or are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .drawing import Drawing, Y, Z, unit
from .judge import Case

COUNT = 24
KINDS = ("exact", "an axis off", "a wheel that wobbles", "toe", "a height off")


def cart(rng: np.random.Generator, axles: int) -> Drawing:
    """Wheels in pairs on axles across x; with one axle a ball that slides carries the other end."""
    d, radius, half = Drawing((0, 0, -9.81)), rng.uniform(0.2, 0.4), rng.uniform(0.3, 0.6)
    length = rng.uniform(0.8, 1.4)
    d.body("frame", (0.4 * length, 0, radius + 0.1), 10.0, (1.0, 1.5, 2.0))
    for axle in range(axles):
        for side, sign in (("l", -1.0), ("r", 1.0)):
            name, at = f"{side}{axle}", np.array([axle * length, sign * half, radius])
            d.body(f"wheel {name}", at, 1.0, (0.02, 0.03, 0.02))
            d.hinge(f"hinge {name}", "frame", f"wheel {name}", at, Y)
            d.joint("rolling", f"road {name}", "ground", f"wheel {name}", at, Y, length=radius)
    if axles == 1:
        ball = np.array([length, 0.0, radius])
        d.joint("sliding", "ball", "ground", "frame", ball, Y, length=radius)
    return d


def case(seed: int) -> Case:
    """One axle leaves two degrees of freedom, more of them go straight."""
    rng = np.random.default_rng([2, seed])
    kind, axles = KINDS[seed % 5], 1 + seed // 5 % 3
    true = cart(rng, axles)
    drawn, error = true.copy(), 0.0
    last = f"r{axles - 1}"
    wheel = next(i for i, j in enumerate(drawn.joints) if j.name == f"road {last}")
    if kind == "an axis off":
        error = 5e-5
        axis = unit([error, 1.0, 0.0])
        drawn = drawn.changed(f"hinge {last}", axis=axis).changed(f"road {last}", axis=axis)
    elif kind == "a wheel that wobbles":
        error = 5e-5
        drawn = drawn.changed(f"hinge {last}", axis_off=error * np.array([1.0, 0.0, 0.0]))
    elif kind == "toe":
        error = 1e-4
        for axle in range(axles):
            for side, sign in (("l", 1.0), ("r", -1.0)):
                name, axis = f"{side}{axle}", unit([sign * error, 1.0, 0.0])
                drawn = drawn.changed(f"hinge {name}", axis=axis).changed(f"road {name}", axis=axis)
    elif kind == "a height off":
        error = 1e-5
        up = drawn.joints[wheel].point + error * Z
        drawn = drawn.changed(f"hinge {last}", point=up).changed(f"road {last}", point=up)
        drawn.bodies = [replace(b, position=up) if b.name == f"wheel {last}" else b for b in drawn.bodies]
    rates = {"hinge l0": float(rng.uniform(2.0, 6.0))}
    if axles == 1:
        # going straight half of the times
        rates["hinge r0"] = rates["hinge l0"] * float(rng.choice([1.0, rng.uniform(0.7, 1.3)]))
    return Case(
        f"cart, {axles} axles, {kind}",
        drawn,
        true,
        2 if axles == 1 else 1,
        rates=rates,
        span=0.5,
        error=error,
        may_refuse=kind != "exact",
    )
