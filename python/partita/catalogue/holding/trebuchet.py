"""A trebuchet: its sling lets the shot go where it has turned far enough."""

from __future__ import annotations

import cmath
import math

from ...builder.measures import Along
from ...events import Event, Release
from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from ..zoo.drawing import in_space
from .records import OPTIONS, off, times

AXLE = 5j
"""Over the ground [m]; x + iy of points in the plane."""
SHORT, LONG, HANGER, SLING = 1.2, 4.8, 1.0, 4.0
"""Lengths: both arms of the beam, from it to the centre of the counterweight, and of the sling [m]."""
BEAM, WEIGHT, CORD, SHOT = 150.0, 2400.0, 2.0, 25.0
"""Masses [kg]; beam and sling are uniform rods."""
DRAWN = (math.pi + 0.9, -0.5 * math.pi, 0.0)
"""Angles from the x axis of the long arm, the hanger and the sling [rad]."""
TURNED = -2.0
"""Angle by which the sling has turned on the beam where it lets go [rad]."""
RELEASED, LANDED = 1.08232220086222788, 5.12014064133840145
LANDS_WITH, LANDS_AT = (45.4646012140204165, -23.1301808287938664), 181.264091490802092
"""Times [s]; velocity [m/s] and place [m] of the shot where it lands."""


def build() -> Mechanism:
    """At rest before the throw, the sling below the beam."""
    m = Mechanism("trebuchet", gravity=(0, -9.81, 0))
    arm, hanger, sling = (cmath.rect(1.0, angle) for angle in DRAWN)
    short, long = AXLE - SHORT * arm, AXLE + LONG * arm
    beam = m.add_rod("beam", start=in_space(short), end=in_space(long), mass=BEAM)
    weight = m.add_body("weight", mass=WEIGHT, inertia=(400, 400, 400), position=in_space(short + HANGER * hanger))
    cord = m.add_rod("sling", start=in_space(long), end=in_space(long + SLING * sling), mass=CORD)
    shot = m.add_body("shot", mass=SHOT, inertia=(0.05, 0.05, 0.05), position=in_space(long + SLING * sling))
    m.add_revolute("axle", m.ground, beam, point=in_space(AXLE))
    m.add_revolute("hanger", beam, weight, point=in_space(short))
    m.add_revolute("tip", beam, cord, point=in_space(long))
    m.add_fixed("pouch", cord, shot)
    return m


def events() -> list[Event]:
    """The shot leaves its pouch; where it lands the run ends."""
    height = Along("ground", (0, 0, 0), (0, 1, 0), "shot", (0, 0, 0))
    return [
        Event("release", "tip", value=TURNED, direction=-1, then=Release("pouch")),
        Event("landing", height, direction=-1, terminal=True),
    ]


def start(m: Mechanism) -> State:
    """At rest."""
    return m.assemble()


def throw(result: Result) -> float:
    """Of the velocity with which the shot lands, and of where."""
    shot = result.body("shot")
    found = (*shot.velocity[-1, :2], shot.position[-1, 0])
    return max(off(a, b) for a, b in zip(found, (*LANDS_WITH, LANDS_AT), strict=True))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="trebuchet",
        title="trebuchet whose sling lets the shot go after it has turned by 2 rad",
        source="Lagrange's equations of three angles, by extrapolation in 34 digits, then a parabola",
        duration=10.0,
        build=build,
        start=start,
        options={**OPTIONS, "events": events()},
        checks=(
            times([("release", "release", RELEASED), ("landing", "crossing", LANDED)]),
            Check("velocity and place of the landing, relative", 1e-9, "a hundred times rtol", throw),
        ),
        notes="The pouch is a joint that parts: from there on shot and sling go on by themselves. The landing ends it.",
    )
