"""A bicycle on a trainer: cranks, chain, a freewheel in the hub, and a heavy drum with a brake under the wheel."""

from __future__ import annotations

from ...mechanism import Mechanism
from ...results import Result
from ...state import State
from ..entry import Check, Entry, path_error
from .records import OPTIONS, times

CADENCE = ((0.0, 4.0, 6.0, 14.0, 18.0), (0.0, 8.0, 8.0, 0.0, 8.0))
"""Rate of the cranks [rad/s] over time [s], joined by straight lines."""
EVENTS = (("pawls", "release", 7.98308342945021146), ("pawls", "lock", 14.945768739224025))
RATE = {5.0: (20.0,), 9.0: (12.7032272801451388,), 12.0: (7.71573560409643313,), 14.0: (5.53374976387261854,)}
"""Of the wheel [rad/s], by time."""
CARRIED = {5.0: (5.202,), 9.0: (0.0,), 12.0: (0.0,), 14.0: (0.0,), 16.0: (10.426,)}
"""Torque of the freewheel [N m], by time."""
WHEEL, DRUM = 0.34, 0.2
"""Radii [m]."""


def build() -> Mechanism:
    """One turn of the cranks is two and a half of the wheel; axes point to the right of the rider."""
    right, axle, below, bracket = (0, 0, -1), (0, WHEEL, 0), (0, -DRUM, 0), (0.43, 0.28, 0)
    m = Mechanism("bicycle-hub", gravity=None)
    wheel = m.add_body("wheel", mass=2.0, inertia=(0.06, 0.06, 0.12), position=axle)
    drum = m.add_body("drum", mass=25.0, inertia=(0.3, 0.3, 0.5), position=below)
    sprocket = m.add_body("sprocket", mass=0.3, inertia=(1e-4, 1e-4, 2e-4), position=axle)
    cranks = m.add_body("cranks", mass=1.0, inertia=(1e-2, 1e-2, 1e-2), position=bracket)
    m.add_revolute("axle", m.ground, wheel, point=axle, axis=right)
    m.add_revolute("drum", m.ground, drum, point=below, axis=right)
    m.add_revolute("pedals", m.ground, cranks, point=bracket, axis=right)
    m.add_revolute("driver", m.ground, sprocket, point=axle, axis=right)
    m.add_revolute("hub", sprocket, wheel, point=axle, axis=right)
    m.add_belt("pedals", "driver", radius1=0.1, radius2=0.04, name="chain")
    m.add_gear("axle", "drum", ratio=-WHEEL / DRUM, name="tyre")
    m.add_torsion_spring("drum", stiffness=0.0, damping=0.09, name="eddy brake")
    m.add_drive("pedals", velocity=CADENCE, name="rider")
    m.add_freewheel("hub", free=1, name="pawls")
    return m


def start(m: Mechanism) -> State:
    """At rest."""
    return m.assemble()


def rate(result: Result) -> float:
    """Largest error over the tabled times."""
    return path_error(result.joint("axle").velocity, result, RATE)


def carried(result: Result) -> float:
    """Largest error over the tabled times."""
    return path_error(result.force("pawls").effort[:, None], result, CARRIED)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="bicycle-hub",
        title="bicycle on a trainer: its rider pedals, lets it coast on the freewheel of its hub, pedals again",
        source="closed form: J w' + c w = 0 while it coasts, which begins where the chain would have to push, and ends "
        "where the sprocket is as fast as the wheel",
        duration=18.0,
        build=build,
        start=start,
        times=tuple(sorted({*RATE, *CARRIED})),
        options=OPTIONS,
        checks=(
            times(EVENTS),
            Check("rate of the wheel [rad/s]", 1e-9, "ten times rtol of 20 rad/s", rate),
            Check("torque of the freewheel [N m]", 1e-8, "a hundred times rtol of 10 N m", carried),
        ),
        samples=1201,
    )
