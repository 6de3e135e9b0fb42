"""What thousands of poses cost in one call: a five-bar by closed forms, an ankle of rods in space by following."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from timing import fastest

import partita as pt

POSES = 4096
AIM = 0.5


@dataclass(frozen=True)
class Sweep:
    """Seconds of one call, the poses assembled in it, and how far their loops are open at most."""

    title: str
    seconds: float
    poses: int
    assembled: int
    closure: float


def five_bar() -> pt.Mechanism:
    """Two motors on the ground, A and E."""
    m = pt.Mechanism("five-bar")
    a, b, c, d, e = (np.array([x, y, 0.0]) for x, y in ((0, 0), (-0.3, 0.8), (0.5, 1.7), (1.3, 0.8), (1, 0)))
    ends = {"left": (a, b), "one": (b, c), "two": (d, c), "right": (e, d)}
    rods = {name: m.add_rod(name, start=s, end=f, mass=1.0) for name, (s, f) in ends.items()}
    m.add_revolute("A", m.ground, rods["left"], point=a)
    m.add_revolute("B", rods["left"], rods["one"], point=b)
    m.add_revolute("C", rods["one"], rods["two"], point=c)
    m.add_revolute("D", rods["right"], rods["two"], point=d)
    m.add_revolute("E", m.ground, rods["right"], point=e)
    return m


def ankle() -> pt.Mechanism:
    """A platform on a universal joint, two cranks, two rods with a ball joint at each end."""
    m = pt.Mechanism("ankle")
    platform = m.add_body("platform", mass=1.0, inertia=(0.01, 0.01, 0.01))
    m.add_universal("U", m.ground, platform, point=(0, 0, 0), axis1=(1, 0, 0), axis2=(0, 1, 0))
    for side, name in ((1, "L"), (-1, "R")):
        c, e = np.array([-0.05, 0.06 * side, 0.25]), np.array([-0.1, 0.06 * side, 0.25])
        f = np.array([-0.06, 0.05 * side, 0.02])
        crank = m.add_rod("crank " + name, start=c, end=e, mass=0.1)
        rod = m.add_rod("rod " + name, start=e, end=f, mass=0.1)
        m.add_revolute("M" + name, m.ground, crank, point=c, axis=(0, 1, 0))
        m.add_spherical("S" + name, crank, rod, point=e)
        m.add_spherical("T" + name, rod, platform, point=f)
    return m


def sweep(title: str, m: pt.Mechanism, motors: tuple[str, str], widest: float) -> Sweep:
    """Motors at positions by chance, this far from the drawing at most."""
    angles = np.random.default_rng(1).uniform(-widest, widest, (POSES, 2))
    targets = {motor: angles[:, k] for k, motor in enumerate(motors)}
    poses = m.assemble_many(targets)
    model = m.compile()
    closure = max(float(np.max(np.abs(model.constraints(q)))) for q in poses.q[poses.ok])
    return Sweep(title, fastest(lambda: m.assemble_many(targets)), POSES, int(poses.ok.sum()), closure)


def poses_cost() -> list[Sweep]:
    """Both mechanisms."""
    return [
        sweep("five-bar", five_bar(), ("A", "E"), 1.0),
        sweep("ankle", ankle(), ("ML", "MR"), 0.8),
    ]
