"""Rolling bodies: a coin, a ball, a bicycle. Contact constrains positions; rolling constrains only velocities."""

from __future__ import annotations

import math

import numpy as np

from ...mechanism import Mechanism
from ...products import matmul
from ..truth import EVERYTHING, Truth
from .drawing import around
from .member import FALL, Theme, member

MEMBERS: Theme = {}
NEIMARK = "J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems"
WHIPPLE = (
    "J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Linearized dynamics equations for the balance and "
    "steer of a bicycle, Proc. R. Soc. A 463 (2007)"
)
DESCENT = 9.81 * math.sin(0.1), 0.0, -9.81 * math.cos(0.1)
SPEED, REAR, FRONT = 4.6, 0.3, 0.35
LEAN = math.radians(20.0)
LEANING = matmul(around((0, 1, 0), 20.0), np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Axes of the coin: it runs along y, the third axis across it, the second up, leaning."""


@member(MEMBERS, "rolling-coin", "a coin rolls on its edge, leaning by twenty degrees",
        Truth(3, 0, EVERYTHING, why="6 - 1 (contact) - 2 (rolling): three rates", source=NEIMARK),
        rates={"flight": (0.0, 3.0, 0.0, -6.0 * math.cos(LEAN), 0.0, 6.0 * math.sin(LEAN))}, gravity=FALL,
        samples=401)  # fmt: skip
def rolling_coin(m: Mechanism) -> None:
    """Radius 0.5. It wobbles, does not fall flat, and goes around."""
    m.add_body("coin", mass=2.0, inertia=(0.125, 0.125, 0.25), position=0.5 * LEANING[:, 1], orientation=LEANING)
    m.add_free("flight", "ground", "coin")
    m.add_rolling("edge", "coin", radius=0.5, normal=(0, 0, 1))


@member(MEMBERS, "rolling-ball", "a ball out of balance rolls down an incline, turning",
        Truth(3, 0, EVERYTHING, why="6 - 1 (contact) - 2 (rolling): three rates", source=NEIMARK),
        rates={"flight": (0.2, 0.3, 0.0, -3.0, 2.0, 4.0)}, gravity=DESCENT, samples=1501)  # fmt: skip
def rolling_ball(m: Mechanism) -> None:
    """The incline, 0.1 rad, is the plane z = 0; the centre of mass lies 10 mm beside the centre of the ball."""
    m.add_body("ball", mass=2.0, inertia=(9e-3, 8e-3, 8e-3), com=(0.01, 0, 0), position=(0, 0, 0.1))
    m.add_free("flight", "ground", "ball", point=(0, 0, 0.1))
    m.add_rolling("contact", "ball", radius=0.1, ball=True, normal=(0, 0, 1))


@member(MEMBERS, "whipple-bicycle", "Whipple's bicycle with a rigid rider runs by itself at 4.6 m/s",
        Truth(3, 0, EVERYTHING, why="4 bodies on 3 hinges have 9 degrees of freedom; two wheels are in contact and "
              "roll: 9 - 2 - 4 = 3 rates, forward speed, roll and steer", source=WHIPPLE),
        rates={"frame": (SPEED, 0.0, 0.0, 0.05, 0.0, 0.0), "steer": 0.0, "rear axle": -SPEED / REAR,
               "front axle": -SPEED / FRONT}, gravity=(0.0, 0.0, 9.81),
        notes="The benchmark of the paper, z down. Started upright with a roll rate of 0.05 rad/s.",
        samples=801)  # fmt: skip
def whipple_bicycle(m: Mechanism) -> None:
    """Wheelbase 1.02, trail 0.08, steer axis tilted by pi/10."""
    tilt, contact = math.pi / 10.0, 1.02
    own = np.array([[9.2, 0.0, 2.4], [0.0, 11.0, 0.0], [2.4, 0.0, 2.8]])
    m.add_body("rear frame", mass=85.0, inertia=own, com=(0.3, 0.0, -0.9), position=(0, 0, 0))
    fork = np.array([[0.05892, 0.0, -0.00756], [0.0, 0.06, 0.0], [-0.00756, 0.0, 0.00708]])
    m.add_body("fork", mass=4.0, inertia=fork, position=(0.9, 0.0, -0.7))
    m.add_body("rear wheel", mass=2.0, inertia=(0.0603, 0.12, 0.0603), position=(0, 0, -REAR))
    m.add_body("front wheel", mass=3.0, inertia=(0.1405, 0.28, 0.1405), position=(contact, 0, -FRONT))
    m.add_free("frame", "ground", "rear frame", point=(0, 0, 0))
    m.add_revolute(
        "steer", "rear frame", "fork", point=(contact + 0.08, 0, 0), axis=(math.sin(tilt), 0, math.cos(tilt))
    )
    m.add_revolute("rear axle", "rear frame", "rear wheel", point=(0, 0, -REAR), axis=(0, 1, 0))
    m.add_revolute("front axle", "fork", "front wheel", point=(contact, 0, -FRONT), axis=(0, 1, 0))
    for wheel, radius in (("rear wheel", REAR), ("front wheel", FRONT)):
        m.add_rolling(f"under {wheel}", wheel, radius=radius, axis=(0, 1, 0), normal=(0, 0, -1))
