"""A trebuchet: how far it throws, for several angles of the sling at which the shot is released.

Run it with `.venv/bin/python examples/trebuchet.py`. Until the release its motion is known by Lagrange's equations of
three angles, written down and integrated here; after it, the shot flies a parabola. Times, speeds and ranges of both
are compared; the exit code is 1 if one is missed.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import partita as pt
from partita.results import Result

Array = NDArray[np.float64]

G = 9.81
AXLE = 5.0
"""Height of the axle over the ground [m]."""
SHORT, LONG, HANGER, SLING = 1.2, 4.8, 1.0, 4.0
"""Lengths: both arms of the beam, from it to the centre of the counterweight, and of the sling [m]."""
BEAM_MASS, WEIGHT, SLING_MASS, SHOT = 150.0, 2400.0, 2.0, 25.0
"""[kg]; beam and sling are uniform rods, the shot is a ball in the end of the sling."""
WEIGHT_INERTIA, SHOT_INERTIA = 400.0, 0.05
"""About their centres [kg m^2]."""
START = (math.pi + 0.9, -0.5 * math.pi, 0.0)
"""Angles from the x axis of the long arm, the hanger and the sling, at rest before the throw [rad]."""
RELEASED = (-1.8, -2.0, -2.2)
"""Turns of the sling on the beam after which the shot leaves it [rad]."""
TOLERANCE = 1e-12
NEAR = 1e-8
"""Known values are met to this. Scale: fraction of them. Reason: both integrate to 1e-12, and the sling whips."""


def unit(angle: float) -> Array:
    """The direction at this angle from the x axis."""
    return np.array([math.cos(angle), math.sin(angle)])


def mechanism() -> pt.Mechanism:
    """The trebuchet at rest, its sling below the beam."""
    m = pt.Mechanism("trebuchet", gravity=(0, -G, 0))
    arm, hanger, sling = (unit(angle) for angle in START)

    def at(point: Array) -> tuple[float, float, float]:
        return float(point[0]), float(point[1]) + AXLE, 0.0

    weight_at, shot_at = HANGER * hanger - SHORT * arm, LONG * arm + SLING * sling
    beam = m.add_rod("beam", start=at(-SHORT * arm), end=at(LONG * arm), mass=BEAM_MASS)
    weight = m.add_body("weight", mass=WEIGHT, inertia=(WEIGHT_INERTIA,) * 3, position=at(weight_at))
    rope = m.add_rod("sling", start=at(LONG * arm), end=at(shot_at), mass=SLING_MASS)
    shot = m.add_body("shot", mass=SHOT, inertia=(SHOT_INERTIA,) * 3, position=at(shot_at))
    m.add_revolute("axle", m.ground, beam, point=(0, AXLE, 0))
    m.add_revolute("hanger", beam, weight, point=at(-SHORT * arm))
    m.add_revolute("tip", beam, rope, point=at(LONG * arm))
    m.add_fixed("pouch", rope, shot)
    return m


def thrown(released: float) -> Result:
    """The run until the shot lands."""
    m = mechanism()
    height = pt.Along("ground", (0, 0, 0), (0, 1, 0), "shot", (0, 0, 0))
    events = [
        pt.Event("release", "tip", value=released, direction=-1, then=pt.Release("pouch")),
        pt.Event("landing", height, direction=-1, terminal=True),
    ]
    return m.simulate(20.0, events=events, rtol=TOLERANCE, atol=TOLERANCE)


def known(released: float) -> tuple[float, float, float]:
    """Time of the release, speed of the shot there, and where it lands, by Lagrange's equations and a parabola."""
    middle = 0.5 * (LONG - SHORT)
    # mass, and how far each angle moves it
    parts = (
        (BEAM_MASS, np.array([middle, 0.0, 0.0])),
        (WEIGHT, np.array([-SHORT, HANGER, 0.0])),
        (SLING_MASS, np.array([LONG, 0.0, 0.5 * SLING])),
        (SHOT, np.array([LONG, 0.0, SLING])),
    )
    own = np.diag([BEAM_MASS * (LONG + SHORT) ** 2 / 12.0, WEIGHT_INERTIA, SLING_MASS * SLING**2 / 12.0 + SHOT_INERTIA])
    coupled = sum(mass * np.outer(arms, arms) for mass, arms in parts)
    loads = sum(mass * G * arms for mass, arms in parts)

    def rates(t: float, x: Array) -> Array:
        a, w = x[:3], x[3:]
        apart = a[:, None] - a[None, :]
        force = -loads * np.cos(a) - (coupled * np.sin(apart)) @ w**2
        return np.concatenate([w, np.linalg.solve(own + coupled * np.cos(apart), force)])

    def leaves(t: float, x: Array) -> float:
        return float(x[2] - x[0]) - (START[2] - START[0]) - released

    leaves.terminal = True  # type: ignore[attr-defined]
    options: dict[str, Any] = {"method": "DOP853", "rtol": TOLERANCE, "atol": TOLERANCE, "events": leaves}
    found = solve_ivp(rates, (0.0, 10.0), [*START, 0.0, 0.0, 0.0], **options)
    t, x = float(found.t_events[0][0]), found.y_events[0][0]
    place = LONG * unit(x[0]) + SLING * unit(x[2])
    speed = LONG * x[3] * unit(x[0] + 0.5 * math.pi) + SLING * x[5] * unit(x[2] + 0.5 * math.pi)
    flight = (speed[1] + math.sqrt(speed[1] ** 2 + 2.0 * G * (place[1] + AXLE))) / G
    return t, float(np.hypot(*speed)), float(place[0] + speed[0] * flight)


def main() -> int:
    """Print each throw beside the known one; 1 if one is missed."""
    right = True
    print(f"{'sling [rad]':>11} {'released [s]':>13} {'speed [m/s]':>12} {'lands at [m]':>13} {'error':>8}")
    for released in RELEASED:
        run = thrown(released)
        away, landing = run.events["release"][0], run.events["landing"][0]
        i = int(np.argmax(run.t > away.t))
        speed = run.body("shot").velocity[i] - (run.t[i] - away.t) * np.array([0.0, -G, 0.0])
        found = (away.t, float(np.linalg.norm(speed)), float(run.body("shot").position[-1, 0]))
        error = max(abs(a / b - 1.0) for a, b in zip(found, known(released), strict=True))
        right &= error < NEAR and run.status == "event" and run.t[-1] == landing.t
        print(f"{released:>11.1f} {found[0]:>13.6f} {found[1]:>12.4f} {found[2]:>13.4f} {error:>8.0e}")
    print("all as known" if right else "a throw was missed")
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
