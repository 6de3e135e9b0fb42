"""A door that its closer swings into its latch."""

from __future__ import annotations

import math

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from .records import OPTIONS, off, times

CLOSED = 0.5 * math.pi
CLOSES = 1.53594858368234847
RATE = 1.71677064004945082
LOST = 22.3442289702495417
HELD = 4.8
"""Time [s] and rate [rad/s] at which the latch is hit, energy that it takes [J], torque that it holds then [N m]."""


def build() -> Mechanism:
    """The door stands open by a right angle; its closer would turn it 0.4 rad further than closed."""
    m = Mechanism("door-latch", gravity=(0, -9.81, 0))
    leaf = m.add_body("leaf", mass=25.0, com=(0.45, 0, 0), inertia=(8.4, 10.1, 1.7))
    m.add_revolute("hinge", m.ground, leaf, point=(0, 0, 0), axis=(0, 1, 0))
    m.add_torsion_spring("hinge", stiffness=12.0, angle=CLOSED + 0.4, name="closer")
    m.add_latch("hinge", at=CLOSED, direction=1, name="latch")
    return m


def start(m: Mechanism) -> State:
    """At rest, open."""
    return m.assemble()


def impact(result: Result) -> float:
    """Of the rate before the latch closes and of the energy that it takes."""
    closed = result.events["latch"][0]
    return max(off(closed.before.velocity("hinge"), RATE), off(closed.energy_lost, LOST))


def held(result: Result) -> float:
    """Of the torque of the latch at the end."""
    return off(result.force("latch").effort[-1], -HELD)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="door-latch",
        title="door that its closer swings into its latch, which holds it",
        source="closed form: angle = (1 - cos(t sqrt(k / J))) times that at which the closer is at rest",
        duration=2.5,
        build=build,
        start=start,
        options=OPTIONS,
        checks=(
            times([("latch", "lock", CLOSES)]),
            Check("rate and energy of the impact, relative", 1e-9, "a hundred times rtol", impact),
            Check("torque that the latch holds, relative", 1e-9, "a hundred times rtol", held),
        ),
    )
