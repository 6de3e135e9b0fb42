"""A ratchet wrench that turns a bolt: dry friction in the thread, a freewheel in the head."""

from __future__ import annotations

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from .records import OPTIONS, off, times

HAND = ((0.0, 0.6, 1.2, 1.3, 1.5, 1.7, 2.3, 2.9), (0.0, 18.0, -3.0, -3.0, 3.0, 3.0, 18.0, -3.0))
"""Torque of the hand [N m] over time [s], joined by straight lines."""
EVENTS = (
    ("tight", "slip", 0.5),
    ("tight", "stick", 1.00616681035935691),
    ("pawl", "release", 1.11428571428571429),
    ("pawl", "lock", 1.64285714285714286),
    ("tight", "slip", 2.18),
    ("tight", "stick", 2.71687693251330891),
    ("pawl", "release", 2.81428571428571429),
)
TURNED = 2.18372050831721188
"""Angle of the bolt after two strokes [rad]."""


def build() -> Mechanism:
    """The thread slides with 12 N m and holds up to 15 N m; the inertia of the wrench has that of the arm in it."""
    m = Mechanism("ratchet-wrench", gravity=None)
    wrench = m.add_body("wrench", mass=0.8, com=(0.12, 0, 0), inertia=(0.15, 0.15, 0.28848))
    bolt = m.add_body("bolt", mass=2.5, inertia=(1e-3, 1e-3, 2e-3))
    m.add_revolute("head", m.ground, wrench, point=(0, 0, 0))
    m.add_revolute("thread", m.ground, bolt, point=(0, 0, 0))
    m.add_revolute("ratchet", wrench, bolt, point=(0, 0, 0))
    m.add_torque("head", HAND, interpolation="linear", name="hand")
    m.add_friction("thread", 12.0, static=15.0, name="tight")
    m.add_freewheel("ratchet", free=1, name="pawl")
    return m


def start(m: Mechanism) -> State:
    """At rest, without a torque."""
    return m.assemble()


def turned(result: Result) -> float:
    """Of the angle of the bolt at the end."""
    return off(result.joint("thread").angle[-1], TURNED)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="ratchet-wrench",
        title="ratchet wrench: two strokes turn a bolt that sticks between them",
        source="closed form: the torque is linear in pieces, so rates are parabolas and angles cubics",
        duration=2.9,
        build=build,
        start=start,
        options=OPTIONS,
        checks=(
            times(EVENTS),
            Check("angle of the bolt after two strokes, relative", 1e-10, "ten times rtol", turned),
        ),
        notes="Each stroke breaks the bolt loose, turns it until the friction stops both, and goes back free.",
    )
