"""Laws along a coordinate of a joint that hold it at times: freewheels, latches, brakes.

A run decides when they hold; what they carry is then found like the reaction of a joint.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from ..units import Quantity
from .checks import Element, number
from .declaration import JOINT, Call, Field, Load, amount, unit
from .drawing import Drawing
from .forces import named
from .joint_loads import add_friction
from .name_first import name_first
from .records import Force, Joint


def sense(element: Element, what: str, value: Any, allowed: tuple[int, ...]) -> int:
    """A sense along a coordinate: 1, -1, or 0 for both."""
    found = number(element, what, value)
    if found not in allowed:
        element.fail(f"{what} = {found:g} is no sense; give {', '.join(str(x) for x in allowed)}")
    return int(found)


def _senses(*allowed: int) -> Field:
    def check(call: Call, what: str, value: Any, _: Any) -> int:
        return sense(call.element, what, value, allowed)

    return Field(check, {"enum": list(allowed)})


FREEWHEEL = Load("freewheel", **JOINT, free=_senses(1, -1), lost="it turns both ways", called="freewheel of")
LATCH = Load(
    "latch",
    **JOINT,
    at=amount(unit),
    direction=_senses(0, 1, -1),
    lost="nothing holds it",
    called="latch of",
)


@FREEWHEEL
@name_first(1)
def add_freewheel(
    self: Drawing,
    joint: Joint | str,
    *,
    free: int = 1,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a one-way clutch along one coordinate of a joint: it moves freely in one sense, never in the other.

    A run finds when it engages, where the rate falls to zero, and when it frees, where what it carries would have to
    pull. Between two shafts it is added to a joint of both. Other analyses, which look at one state, refuse it.

    Args:
        joint: the joint or its name; its coordinate must not be part of a quaternion.
        free: the sense that is free: 1 where the coordinate grows, -1 where it falls.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name. Its records in `run.events` have this name, and the kinds "lock" and
            "release".

    >>> import partita as pt
    >>> m = pt.Mechanism("hub", gravity=None)
    >>> wheel = m.add_body("wheel", mass=1.0, inertia=(0.2, 0.2, 0.4))
    >>> axle = m.add_revolute("A", m.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1))
    >>> _ = m.add_torque("A", -2.0)
    >>> _ = m.add_freewheel(axle)
    >>> run = m.simulate(1.0, initial=m.assemble(rates={"A": 3.0}))   # 0.4 kg m2 against 2 N m: 0.6 s
    >>> [(event.kind, round(event.t, 9)) for event in run.events]
    [('lock', 0.6)]
    >>> round(float(run.force("freewheel of A").effort[-1]), 9)
    2.0
    """
    return FREEWHEEL.checked(locals()).store()


@LATCH
@name_first(1)
def add_latch(
    self: Drawing,
    joint: Joint | str,
    *,
    at: Quantity,
    direction: int = 0,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a latch to one coordinate of a joint: where it passes a value it is held there, until it is released.

    It closes without rebound; the impulse stands in the record of the event. An event with `then=pt.Release(latch)`
    opens it; from there on it closes again where the value is passed. Analyses of one state see it open.

    Args:
        joint: the joint or its name; its coordinate must not be part of a quaternion.
        at: where it closes [rad] or [m], from the drawn position.
        direction: 1: only where the coordinate grows, -1: only where it falls, 0: both.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name. Its records in `run.events` have this name, and the kind "lock".

    >>> import partita as pt
    >>> m = pt.Mechanism("door", gravity=None)
    >>> leaf = m.add_rod("leaf", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    >>> hinge = m.add_revolute("A", m.ground, leaf, point=(0, 0, 0))
    >>> latch = m.add_latch(hinge, at=0.5)
    >>> go = pt.Event("go", lambda t, state: t - 1.0, then=pt.Release(latch))
    >>> run = m.simulate(2.0, initial=m.assemble(rates={"A": 1.0}), events=[go])
    >>> [(event.name, event.kind, round(event.t, 9)) for event in run.events]
    [('latch of A', 'lock', 0.5), ('go', 'release', 1.0)]
    """
    return LATCH.checked(locals()).store()


@name_first(1)
def add_brake(
    self: Drawing,
    joint: Joint | str,
    torque: Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any],
    *,
    static: Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any] | None = None,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a brake or a friction clutch: dry friction along one coordinate of a joint, which stops it and holds it.

    The same as `add_friction` without a stick velocity.

    Args:
        joint: the joint or its name.
        torque: what it resists with while it slips [N m] (of a slide [N]): a number, a table (times, values) or
            f(t, state), so that it can be applied and let go.
        static: the most that it carries at rest; None: equal to `torque`.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("wheel", gravity=None)
    >>> wheel = m.add_body("wheel", mass=1.0, inertia=(0.2, 0.2, 0.4))
    >>> axle = m.add_revolute("A", m.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1))
    >>> _ = m.add_brake(axle, 2.0)
    >>> run = m.simulate(1.0, initial=m.assemble(rates={"A": 3.0}))
    >>> [(event.kind, round(event.t, 9)) for event in run.events]
    [('stick', 0.6)]
    """
    element = named(self, name, "brake of", joint)
    return add_friction(self, joint, torque, static=static, coordinate=coordinate, name=element.name)


class OneWayLaws(Drawing):
    """The methods of this module."""

    add_freewheel = add_freewheel
    add_latch = add_latch
    add_brake = add_brake
