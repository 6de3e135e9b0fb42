"""A landing gear that falls and locks: its folding side stay goes over centre into a latch."""

from __future__ import annotations

import cmath
import math

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from ..zoo.drawing import in_space, meet, polar
from .records import OPTIONS, off, times

FRAME, ARM, UPPER, LOWER = 0.7 - 0.1j, 0.8, 0.46, 0.44
"""Pivot of the side stay beside that of the leg, where it meets the leg, lengths of its two links [m]."""
RAISED, OVER = 70.0, 6.0
"""Of the leg from the vertical, and of the knee past the straight line [deg]."""
LOCKS = 0.934155636301847552
RATE = 0.777032657909664826
LOST = 0.0445184994430749923
HELD = -5.21455857569146113
LOWERED = -1.06559337814397
"""Time [s] and rate of the knee [rad/s] at which it locks, energy that the latch takes [J], torque that it holds
[N m], angle by which the leg has swung [rad]."""


def build() -> Mechanism:
    """Drawn raised; the leg falls against its snubber, a spring in the knee pulls it over centre."""
    m = Mechanism("landing-gear-downlock", gravity=(0, -9.81, 0))
    pin = polar(ARM, RAISED - 90.0)
    knee = meet(FRAME, pin, UPPER, LOWER)
    straight = -cmath.phase((pin - knee) / (knee - FRAME))
    leg = m.add_body("leg", mass=40.0, inertia=(6, 6, 6), com=in_space(0.9 * pin / ARM))
    upper = m.add_rod("upper stay", start=in_space(FRAME), end=in_space(knee), mass=3.0)
    lower = m.add_rod("lower stay", start=in_space(knee), end=in_space(pin), mass=3.0)
    m.add_revolute("trunnion", m.ground, leg, point=(0, 0, 0))
    m.add_revolute("frame", m.ground, upper, point=in_space(FRAME))
    m.add_revolute("knee", upper, lower, point=in_space(knee))
    m.add_revolute("pin", lower, leg, point=in_space(pin))
    m.add_torsion_spring("trunnion", stiffness=0.0, damping=300.0, name="snubber")
    m.add_torsion_spring("knee", stiffness=60.0, damping=8.0, angle=straight + 0.3, name="lock spring")
    m.add_latch("knee", at=straight + math.radians(OVER), direction=1, name="downlock")
    return m


def start(m: Mechanism) -> State:
    """At rest, raised."""
    return m.assemble()


def locked(result: Result) -> float:
    """Of the rate of the knee before it locks and of the energy that the latch takes."""
    lock = result.events["downlock"][0]
    return max(off(lock.before.velocity("knee"), RATE), off(lock.energy_lost, LOST))


def held(result: Result) -> float:
    """Of the torque of the latch and of the angle of the leg at the end."""
    return max(off(result.force("downlock").effort[-1], HELD), off(result.joint("trunnion").angle[-1], LOWERED))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="landing-gear-downlock",
        title="landing gear that falls and locks: its side stay folds out over centre into a latch",
        source="Lagrange's equation of the upper stay, integrated by Taylor series of 22 digits; the torque by virtual "
        "work",
        duration=1.5,
        build=build,
        start=start,
        options=OPTIONS,
        checks=(
            times([("downlock", "lock", LOCKS)]),
            Check("rate and energy where it locks, relative", 1e-8, "rtol 1e-11 over a thousand steps", locked),
            Check("torque of the latch, angle of the leg, relative", 1e-9, "a hundred times rtol", held),
        ),
        notes="Where the stay is straight the leg stands still, 8.83 degrees from the vertical: past it, what pushes "
        "the leg back up bends the knee further into its latch.",
    )
