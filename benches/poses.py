"""What poses by the hundred thousand cost in one call: four-bar and five-bar by closed forms, an ankle by following."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import partita as pt

POSES = 100_000
ROUNDS = 5


@dataclass(frozen=True)
class Sweep:
    """CPU seconds of one call, the aim for each pose, the poses assembled, and how far their loops are open at most."""

    title: str
    seconds: float
    aim: float
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


def sweep(title: str, m: pt.Mechanism, motors: dict[str, tuple[float, float]], aim: float) -> Sweep:
    """Motors at positions by chance between bounds, relative to the drawing."""
    rng = np.random.default_rng(1)
    targets = {motor: rng.uniform(*bounds, POSES) for motor, bounds in motors.items()}
    poses = m.assemble_many(targets)
    model = m.compile()
    closure = max(float(np.max(np.abs(model.constraints(q)))) for q in poses.q[poses.ok][::100])
    found = [_cpu(lambda: m.assemble_many(targets)) for _ in range(ROUNDS)]
    return Sweep(title, min(found), aim, POSES, int(poses.ok.sum()), closure)


def _cpu(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def poses_cost() -> list[Sweep]:
    """All three."""
    return [
        sweep("four-bar", pt.catalogue.load("four-bar"), {"A": (0.0, 6.0)}, 100e-9),
        sweep("five-bar", five_bar(), {"A": (-0.5, 0.5), "E": (-0.5, 0.5)}, 200e-9),
        sweep("ankle", ankle(), {"ML": (-0.5, 0.5), "MR": (-0.5, 0.5)}, 2e-6),
    ]
