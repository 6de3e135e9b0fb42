"""A Geneva wheel of four slots: a pin enters a slot, turns the wheel, leaves; then the wheel is locked."""

from __future__ import annotations

import math

import numpy as np

from ...builder.measures import Along
from ...events import Event, Lock, Release
from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry, largest_gap
from .records import OPTIONS, off, times

APART, SLOTS, SPEED = 0.1, 4, 2.0 * math.pi
"""Distance of the shafts [m], slots of the wheel, rate of the crank [rad/s]."""
RATIO = math.sin(math.pi / SLOTS)
INERTIA, LOAD = 1e-3, 0.2
"""Of the wheel [kg m^2], and a torque that turns it back [N m]."""
ENTRY = (APART * (RATIO**2 - 1.0), -APART * RATIO * math.sqrt(1.0 - RATIO**2), 0.0)
"""Where the pin enters and is drawn [m]."""


def build() -> Mechanism:
    """Drawn with the pin at the mouth of the first slot; the wheel turns on the origin."""
    m = Mechanism("geneva-wheel", gravity=None)
    crank = m.add_rod("crank", start=(-APART, 0, 0), end=ENTRY, mass=0.3)
    wheel = m.add_body("wheel", mass=0.5, inertia=(INERTIA, INERTIA, INERTIA))
    m.add_revolute("shaft", m.ground, crank, point=(-APART, 0, 0))
    m.add_revolute("table", m.ground, wheel, point=(0, 0, 0))
    m.add_drive("shaft", velocity=SPEED, name="motor")
    m.add_torque("table", LOAD, name="load")
    return m


def slot(k: int) -> Lock:
    """Holds the pin on the line of slot `k`, along which it slides."""
    along = math.atan2(ENTRY[1], ENTRY[0]) + 2.0 * math.pi * k / SLOTS
    across = (-math.sin(along), math.cos(along), 0.0)
    return Lock(Along("wheel", (0, 0, 0), across, "crank", (APART * RATIO, 0, 0)), name=f"slot {k}")


def events() -> list[Event]:
    """The pin is in slot k from k turns of the crank on for a quarter of one; then an arc locks the wheel."""
    found = []
    for k in range(SLOTS):
        turns = 2.0 * math.pi * k
        enters, leaves = [Release("table"), slot(k)], [Release(slot(k).name), Lock("table")]
        if k > 0:
            found.append(Event(f"enters {k}", "shaft", value=turns, once=True, then=enters))
        found.append(Event(f"leaves {k}", "shaft", value=turns + 0.5 * math.pi, once=True, then=leaves))
    return found


def start(m: Mechanism) -> State:
    """The crank turns, the wheel stands still."""
    return m.assemble(rates={"shaft": SPEED, "table": 0.0})


def known() -> list[tuple[str, str, float]]:
    """All events."""
    found = []
    for k in range(SLOTS):
        at = [(f"enters {k}", float(k))] if k > 0 else []
        for name, t in [*at, (f"leaves {k}", k + 0.25)]:
            found += [(name, "release", t), (name, "lock", t)]
    return found


def law(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle and acceleration of the wheel, distance of the pin from its axis; without one where the wheel is locked."""
    steps, part = np.floor(t), np.minimum(SPEED * (t - np.floor(t)), 0.5 * math.pi)
    angle = part - 0.25 * math.pi
    square = 1.0 + RATIO**2 - 2.0 * RATIO * np.cos(angle)
    turned = np.arctan2(RATIO * np.sin(angle), 1.0 - RATIO * np.cos(angle))
    gains = SPEED**2 * RATIO * (1.0 - RATIO**2) * np.sin(angle) / square**2
    return -0.5 * math.pi * steps - turned - 0.25 * math.pi, gains, APART * np.sqrt(square)


def angle_error(result: Result) -> float:
    """Largest error of the angle of the wheel."""
    return largest_gap(result.joint("table").angle, law(result.t)[0])


def force_error(result: Result) -> float:
    """Of what the pin pushes in the middle of each slot and of what locks the wheel between them."""
    worst = 0.0
    for k in range(SLOTS):
        row = int(np.argmin(np.abs(result.t - (k + 0.0625))))
        _, gains, lever = law(result.t[[row]])
        pushes = abs(float(result.drive(f"slot {k}").effort[row, 0]))
        held = float(result.drive("lock of table").effort[int(np.argmin(np.abs(result.t - (k + 0.5)))), 0])
        worst = max(worst, off(pushes, abs(INERTIA * gains[0] - LOAD) / lever[0]), off(held, -LOAD))
    return worst


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="geneva-wheel",
        title="Geneva wheel of four slots through a whole turn: its pin enters, turns it, leaves; then it is locked",
        source="closed form: the law of cosines, and its derivatives",
        duration=float(SLOTS),
        build=build,
        start=start,
        times=tuple(k + part for k in range(SLOTS) for part in (0.0625, 0.5)),
        options={**OPTIONS, "locked": [slot(0)], "events": events()},
        checks=(
            times(known()),
            Check("angle of the wheel [rad]", 1e-9, "a hundred times rtol of a turn", angle_error),
            Check("forces on pin and lock, relative", 1e-9, "a hundred times rtol", force_error),
        ),
        notes="Pin and slot are a lock of the displacement of the pin across the slot, from where it enters to where "
        "it leaves. It enters along the slot, so nothing is hit; the acceleration of the wheel jumps.",
        samples=401,
    )
