"""A slider-crank that coasts: its dead centres, and where its rod is square to its crank, found while it runs.

Run it with `.venv/bin/python examples/events.py [FOLDER]`. Without friction and gravity the crank angle is known by one
integral: 1/2 J(a) (da/dt)^2 stays as it is, with the inertia J(a) of crank, rod and piston seen by the crank. So the
time of each event is known without a step of integration; the exit code is 1 if one is missed. With FOLDER the motion
is drawn there, in events.svg.
"""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import quad

import partita as pt
from partita.results import Result

CRANK, ROD = 0.05, 0.15
"""Lengths [m]."""
CRANK_MASS, ROD_MASS, PISTON_MASS = 0.8, 0.4, 0.6
"""[kg]; crank and rod are uniform."""
START, RATE = 0.5 * math.pi, 20.0
"""Angle of the crank from the outer dead centre [rad], and its rate [rad/s], at the start."""
TURNS = 3
SQUARE = math.atan2(ROD, CRANK)
"""Angle at which crank and rod include a right angle [rad]."""
TOLERANCE = 1e-12
NEAR = 1e-10
"""Known times are met to this [s]. Reason: a hundred tolerances, of a run of a second."""

ANSWERS = sorted(
    [("dead centre", math.pi * k, 1 if k % 2 else -1) for k in range(1, 2 * TURNS + 1)]
    + [("square", 2.0 * math.pi * k + side * SQUARE, -side) for k in range(1, TURNS + 1) for side in (-1, 1)]
    + [("third turn", START + 2.0 * math.pi * TURNS, 1)],
    key=lambda answer: answer[1],
)
"""What happens, at which angle of the crank, and whether what is followed rises (1) or falls (-1) there."""


def mechanism() -> pt.Mechanism:
    """The slider-crank, its crank upright."""
    m = pt.Mechanism("slider-crank", gravity=(0, 0, 0))
    pin, wrist = (0.0, CRANK, 0.0), (math.sqrt(ROD**2 - CRANK**2), 0.0, 0.0)
    crank = m.add_rod("crank", start=(0, 0, 0), end=pin, mass=CRANK_MASS)
    rod = m.add_rod("rod", start=pin, end=wrist, mass=ROD_MASS)
    piston = m.add_body("piston", mass=PISTON_MASS, inertia=(1e-3, 1e-3, 1e-3), position=wrist)
    m.add_revolute("main", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("big end", crank, rod, point=pin)
    m.add_revolute("small end", rod, piston, point=wrist)
    bore = m.add_prismatic("bore", m.ground, piston, point=wrist, axis=(1, 0, 0))
    m.add_sensor("piston", bore, "position")
    m.add_sensor("speed", bore, "velocity")
    return m


def observed() -> Result:
    """The run with its events."""
    m = mechanism()
    events = [
        pt.Event("dead centre", "bore", reads="velocity"),
        pt.Event("square", pt.Distance("ground", (0, 0, 0), "piston", (0, 0, 0)), value=math.hypot(CRANK, ROD)),
        pt.Event("third turn", "main", value=2.0 * math.pi * TURNS, terminal=True),
    ]
    start = m.assemble(rates={"main": RATE})
    times = np.linspace(0.0, 2.0, 801)
    return m.simulate(2.0, initial=start, events=events, rtol=TOLERANCE, atol=TOLERANCE, t_eval=times)


def inertia(angle: float) -> float:
    """Inertia seen by the crank [kg m^2]: twice the kinetic energy at 1 rad/s."""
    lean = math.asin(CRANK / ROD * math.sin(angle))
    pin = CRANK * np.array([-math.sin(angle), math.cos(angle)])
    piston = np.array([-CRANK * math.sin(angle) - CRANK * math.cos(angle) * math.tan(lean), 0.0])
    rod = float(pin @ pin + pin @ piston + piston @ piston) / 3.0
    return CRANK_MASS * CRANK**2 / 3.0 + ROD_MASS * rod + PISTON_MASS * float(piston @ piston)


def time_at(angle: float) -> float:
    """When the crank is at an angle [s], by quadrature over quarter turns."""
    edges = [*np.arange(START, angle, 0.5 * math.pi), angle]
    parts = [
        quad(lambda a: math.sqrt(inertia(a)), low, high, epsabs=0.0, epsrel=1e-13)[0] for low, high in pairwise(edges)
    ]
    return math.fsum(parts) / (math.sqrt(inertia(START)) * RATE)


def main(folder: Path | None = None) -> int:
    """Print each event beside its known time; 1 if one is missed."""
    run = observed()
    right = run.status == "event" and len(run.events) == len(ANSWERS)
    print(f"{'event':<12} {'crank':>8} {'known [s]':>16} {'found [s]':>16} {'error [s]':>10}")
    for event, (name, angle, direction) in zip(run.events, ANSWERS, strict=False):
        known = time_at(angle)
        right &= (event.name, event.direction) == (name, direction) and abs(event.t - known) < NEAR
        turned = math.degrees(angle)
        print(f"{event.name:<12} {turned:>8.2f} {known:>16.12f} {event.t:>16.12f} {event.t - known:>10.1e}")
    print(f"{run.status}: {run.message}" if right else "an event was missed")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        draw(run, folder / "events.svg")
    return 0 if right else 1


def draw(run: Result, path: Path) -> None:
    """Position and speed of the piston, with the events."""
    from matplotlib import rc_context

    figure = run.plot("piston", "speed")
    figure.set_size_inches(8.0, 5.0)
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
