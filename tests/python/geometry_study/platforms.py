"""Platforms on three to six equal parallel legs, drawn exactly. Three legs leave the twist free; more lock it, at the
second order or, feet on a circle, at the fourth. The platform then moves on a sphere and does not turn."""

from __future__ import annotations

import numpy as np

from .drawing import Drawing, Z, unit
from .judge import Case
from .linkages import turn

COUNT = 36
KINDS = ("bars", "balls", "universal")


def feet_of(rng: np.random.Generator, number: int) -> tuple[str, list[np.ndarray]]:
    """In a plane, on a circle, or anywhere."""
    where = str(rng.choice(["plane", "circle", "space"]))
    while True:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, number))
        gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
        if gaps.min() > 0.5 and gaps.max() < 3.0:
            break
    radii = np.ones(number) if where == "circle" else rng.uniform(0.5, 1.2, number)
    heights = rng.uniform(-0.3, 0.3, number) if where == "space" else np.zeros(number)
    return where, [np.array([r * np.cos(a), r * np.sin(a), h]) for r, a, h in zip(radii, angles, heights, strict=True)]


def platform(kind: str, feet: list[np.ndarray], leg: np.ndarray) -> Drawing:
    d = Drawing((0.0, 0.0, -9.81))
    d.body("platform", leg + 0.1 * Z, 2.0, (0.3, 0.4, 0.5))
    for i, foot in enumerate(feet):
        top = foot + leg
        if kind == "bars":
            d.bar(f"leg{i}", "ground", foot, "platform", top)
            continue
        d.rod(f"leg{i}", foot, top, 0.3)
        if kind == "balls":
            d.joint("spherical", f"foot{i}", "ground", f"leg{i}", foot)
        else:
            first = unit(np.cross(leg, Z))
            d.joint("universal", f"foot{i}", "ground", f"leg{i}", foot, first, axis2=np.cross(unit(leg), first))
        d.joint("spherical", f"top{i}", f"leg{i}", "platform", top)
    return d


def case(seed: int) -> Case:
    rng = np.random.default_rng([1, seed])
    kind, number = KINDS[seed % 3], 3 + (seed // 3) % 4
    where, feet = feet_of(rng, number)
    lean, angle = rng.uniform(0.3, 0.9), rng.uniform(0.0, 2.0 * np.pi)
    leg = turn(Z, angle) @ np.array([np.sin(lean), 0.0, np.cos(lean)])
    drawn = platform(kind, feet, leg)
    pulled = seed // 12 % 3
    if pulled == 1:
        drawn.force("platform", rng.normal(size=3))
    if pulled == 2:
        # a couple that would twist it, about the vertical and about any axis
        drawn.force("platform", (0.0, 6.0, 1.0), (0.8, 0.0, 0.0))
        drawn.force("platform", (0.0, -6.0, -1.0), (-0.8, 0.0, 0.0))
    spins = number if kind == "balls" else 0
    true = drawn
    if number > 3:
        true = drawn.copy()
        true.joint("lock", "no turn", "ground", "platform", (0, 0, 0))
    name = f"{number} {kind}, feet in {where}, {('falls', 'pulled', 'twisted')[pulled]}"
    return Case(name, drawn, true, (2 if number > 3 else 3) + spins, may_refuse=number > 3, span=0.4)
