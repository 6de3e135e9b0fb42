"""A valve that a cam lifts, faster and faster: it lifts off the cam and lands on it."""

from __future__ import annotations

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from .records import OPTIONS, off, times

ECCENTRICITY, RADIUS = 0.006, 0.02
EVENTS = (
    ("cam", "rest", 0.0),
    ("cam", "lift-off", 1.46853201761439566),
    ("cam", "impact", 1.47943808607179613),
    ("cam", "rest", 1.47943808607179613),
    ("cam", "lift-off", 1.51419403056774040),
    ("cam", "impact", 1.52931440199576858),
    ("cam", "rest", 1.52931440199576858),
    ("cam", "lift-off", 1.55886092155541068),
    ("cam", "impact", 1.57663745762072178),
    ("cam", "rest", 1.57663745762072178),
)
IMPULSES = (0.0328279205034995826, 0.0934724578405541552, 0.161510859446421270)
"""With which the cam stops the valve where it lands [N s]."""


def build() -> Mechanism:
    """A round cam 6 mm off its axis under a flat follower, which a spring of 900 N/m presses on it with 25 N at the
    least."""
    m = Mechanism("valve-float", gravity=(0, -9.81, 0))
    seat, above = RADIUS - ECCENTRICITY, 0.1
    shaft = m.add_body("camshaft", mass=1.0, inertia=(1e-3, 1e-3, 1e-3))
    valve = m.add_body("valve", mass=0.4, inertia=(1e-4, 1e-4, 1e-4), position=(0, seat, 0))
    m.add_revolute("bearing", m.ground, shaft, point=(0, 0, 0))
    m.add_prismatic("guide", m.ground, valve, point=(0, seat, 0), axis=(0, 1, 0))
    m.add_drive("bearing", acceleration=90.0, name="engine")
    m.add_spring(
        "spring", m.ground, (0, seat + above, 0), valve, (0, 0, 0), stiffness=900.0, length=above + 25.0 / 900.0
    )
    m.add_contact(
        "cam",
        shaft,
        (0, -ECCENTRICITY, 0),
        valve,
        (0, 0, 0),
        radius1=RADIUS,
        normal=(0, -1, 0),
        restitution=0.0,
    )
    return m


def start(m: Mechanism) -> State:
    """At rest, the valve down on its cam."""
    return m.assemble()


def landings(result: Result) -> float:
    """Largest error of the impulses where it lands."""
    hits = [event for event in result.events if event.kind == "impact"]
    found = [hit.impulses["cam"].effort for hit in hits]
    if len(found) != len(IMPULSES):
        return float("inf")
    return max(off(a or 0.0, b) for a, b in zip(found, IMPULSES, strict=True))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="valve-float",
        title="valve that floats: a cam faster and faster, from which its follower lifts off and on which it lands",
        source="closed form of the flights, harmonic under the spring, with roots in 30 digits for where they begin "
        "and end",
        duration=1.6,
        build=build,
        start=start,
        options=OPTIONS,
        checks=(
            times(EVENTS),
            Check("impulses of the landings, relative", 1e-7, "rates of the flights, times over 1e-11 of whose span",
                  landings),
        ),
        notes="The cam is round and its follower flat, so the lift is 6 mm (1 - cos angle); the shaft gains 90 rad/s "
        "each second.",
        samples=1201,
    )  # fmt: skip
