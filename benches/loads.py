"""What forces of engineers cost that no Python function computes: a run with them over the same run without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from timing import fastest

import partita as pt

AIM = 1.5
STEP, DURATION = 1e-3, 0.5


@dataclass(frozen=True)
class Load:
    """Seconds of a run with and without the load, each of the same steps."""

    bare: float
    loaded: float

    @property
    def ratio(self) -> float:
        """With over without."""
        return self.loaded / self.bare


def engine(loaded: bool) -> pt.Mechanism:
    """A crank and slider; gas presses on the piston by a table over the crank angle, the same each turn."""
    m = pt.Mechanism("engine")
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0, 0.05, 0), mass=2.0)
    rod = m.add_rod("rod", start=(0, 0.05, 0), end=(0, 0.25, 0), mass=0.6)
    piston = m.add_body("piston", mass=0.5, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0.25, 0))
    m.add_revolute("main", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("big end", crank, rod, point=(0, 0.05, 0))
    m.add_revolute("small end", rod, piston, point=(0, 0.25, 0))
    m.add_prismatic("bore", m.ground, piston, axis=(0, 1, 0))
    if loaded:
        angle = np.linspace(0.0, 2 * np.pi, 73)
        gas = -2000.0 * np.exp(-(((angle - np.pi) / 0.4) ** 2))
        m.add_torque("bore", (angle, gas), over="main", periodic=True, name="gas")
    return m


def wheel(loaded: bool) -> pt.Mechanism:
    """A double wishbone in the plane with its strut; a tyre stands on the road at the upright."""
    m = pt.Mechanism("suspension")
    low = m.add_rod("lower arm", start=(0, 0.2, 0), end=(0.4, 0.18, 0), mass=4.0)
    top = m.add_rod("upper arm", start=(0.05, 0.5, 0), end=(0.35, 0.48, 0), mass=3.0)
    upright = m.add_body("upright", mass=25.0, inertia=(0.5, 0.5, 0.5), position=(0.45, 0.33, 0))
    m.add_revolute("A", m.ground, low, point=(0, 0.2, 0))
    m.add_revolute("B", m.ground, top, point=(0.05, 0.5, 0))
    m.add_revolute("C", low, upright, point=(0.4, 0.18, 0))
    m.add_revolute("D", top, upright, point=(0.35, 0.48, 0))
    m.add_spring("strut", m.ground, (0.15, 0.7, 0), low, (0.25, 0, 0), stiffness=3e4, damping=2e3)
    if loaded:
        m.add_tyre(
            "tyre", upright, center=(0.1, 0, 0), axis=(0, 0, 1), radius=0.32, normal=(0, 1, 0), stiffness=2e5,
            damping=0.5, friction=0.9, longitudinal=2e4, lateral=2e4, slow_speed=0.1,
        )  # fmt: skip
    return m


def load_costs() -> dict[str, Load]:
    """Both, by fixed steps, so that the work differs by the load alone."""
    cases: dict[str, tuple[Callable[[bool], pt.Mechanism], dict[str, float]]] = {
        "gas over crank angle": (engine, {"main": 30.0}),
        "tyre on an upright": (wheel, {}),
    }
    found = {}
    for title, (make, rates) in cases.items():
        seconds = []
        for loaded in (False, True):
            m = make(loaded)
            start = m.assemble(rates=rates)
            run = lambda m=m, start=start: m.simulate(  # noqa: E731
                DURATION, initial=start, method="rk4", step=STEP, t_eval=[DURATION]
            )
            assert run().success
            seconds.append(fastest(run))
        found[title] = Load(*seconds)
    return found
