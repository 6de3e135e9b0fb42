"""A press that punches a sheet: the sheet resists, then breaks."""

from __future__ import annotations

import math

import numpy as np

from ...events import Event, SetInput
from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry
from .records import OPTIONS, off, times

THROW, ROD, SHEET = 0.08, 0.25, 900.0
"""Lengths of crank and rod [m], force of the sheet [N]."""
TOUCHES, BREAKS = 0.20, 0.185
"""Places of the ram, from the crankshaft [m]."""
EVENTS = (
    ("touches", "input", 0.0497245859313159624),
    ("breaks", "input", 0.0798205437879685300),
    ("bottom", "crossing", 0.167920851816639144),
)
SIDES = (EVENTS[1][2] - 1e-10, EVENTS[1][2] + 1e-10)
"""Times just before and just after the sheet breaks [s]."""
RATES = (12.0580600737165191, 8.37557022008187297, 8.39755767440925872)
"""Of the crank at these events [rad/s]."""
FORCES = (-893.493744572958433, 3.12680230059805499)
"""Of the rod on the ram along its guide, before and after the break [N]."""


def build() -> Mechanism:
    """Drawn with the ram as far out as it goes; the crank has a flywheel."""
    m = Mechanism("punch-press", gravity=None)
    crank = m.add_body("crank", mass=0.5, com=(0.02, 0, 0), inertia=(0.2, 0.2, 0.3512))
    rod = m.add_body("rod", mass=0.6, com=(0.08, 0, 0), inertia=(2e-3, 2e-3, 0.0035), position=(THROW, 0, 0))
    ram = m.add_body("ram", mass=0.8, inertia=(1e-3, 1e-3, 1e-3), position=(THROW + ROD, 0, 0))
    m.add_revolute("main", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("big end", crank, rod, point=(THROW, 0, 0))
    m.add_revolute("small end", rod, ram, point=(THROW + ROD, 0, 0))
    m.add_prismatic("guide", m.ground, ram, point=(THROW + ROD, 0, 0), axis=(1, 0, 0))
    m.add_force(ram, (0, 0, 0), name="sheet")
    return m


def events() -> list[Event]:
    """The sheet resists from where the ram touches it until it breaks; the run ends at the bottom."""
    drawn = THROW + ROD
    return [
        Event("touches", "guide", TOUCHES - drawn, direction=-1, once=True, then=SetInput("sheet.x", SHEET)),
        Event("breaks", "guide", BREAKS - drawn, direction=-1, once=True, then=SetInput("sheet.x", 0.0)),
        Event("bottom", "main", math.pi, terminal=True),
    ]


def start(m: Mechanism) -> State:
    """The crank at 1.5 rad, with 12 rad/s."""
    return m.assemble({"main": 1.5}, rates={"main": 12.0})


def rates(result: Result) -> float:
    """Largest relative error of the rates at the events."""
    return max(off(a.after.velocity("main"), b) for a, b in zip(result.events, RATES, strict=True))


def force(result: Result) -> float:
    """Of the rod on the ram, just before and just after the break."""
    rows = [int(np.argmin(np.abs(result.t - t))) for t in SIDES]
    found = result.joint("small end").force[rows, 0]
    return max(off(a, b) for a, b in zip(found, FORCES, strict=True))


def work(result: Result) -> float:
    """Of the work of the sheet: its force times the thickness that it resists."""
    return off(result.energy.work[-1], -SHEET * (TOUCHES - BREAKS))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="punch-press",
        title="punch press with a flywheel: the sheet resists with 900 N over 15 mm and breaks",
        source="rates by the energy, times by one integral over the angle of the crank, forces by the acceleration "
        "there, all in 45 digits",
        duration=0.2,
        build=build,
        start=start,
        times=SIDES,
        options={**OPTIONS, "events": events()},
        checks=(
            times(EVENTS),
            Check("rates of the crank at the events, relative", 1e-10, "ten times rtol", rates),
            Check("force on the ram where the sheet breaks, relative", 1e-8, "0.1 ns from the jump", force),
            Check("work of the sheet, relative", 1e-9, "a hundred times rtol", work),
        ),
        notes="The force in the rod jumps from 893 N to 3 N where the sheet breaks; the rates do not.",
    )
