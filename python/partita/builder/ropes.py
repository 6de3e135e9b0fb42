"""Ropes: two points that pull each other where they are farther apart than the length between them."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..units import Quantity
from .checks import name_of, number
from .drawing import Drawing
from .forces import both_ends, store
from .joint_loads import per_power
from .records import Body, Force, LoadRecord


def add_rope(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    stiffness: Quantity,
    length: Quantity | None = None,
    exponent: float = 1.0,
    damping: Quantity = 0.0,
) -> Force:
    """Add a rope, cable or chain without mass between two points: it pulls, never pushes, and goes slack.

    Where the points are farther apart than `length`, by the stretch s, they are pulled together by
    stiffness s^exponent (1 + damping ds/dt), never apart; nothing acts where they are nearer. A step of a run ends
    where the rope becomes taut or slack. Prefer `add_distance` for a rope that is always taut and does not stretch,
    `add_spring` where compression acts too. A rope over a wheel is a rack (`add_rack`) or a belt (`add_belt`).

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground.
        point1, point2: in the axes of their body (world for the ground) [m].
        stiffness: tension at a stretch of 1 m [N/m^exponent], not negative; of a rope E A / length.
        length: without tension [m], above 0; None: the drawn distance.
        exponent: power of the stretch, at least 1.
        damping: relative increase of the tension per speed of stretching [s/m], not negative.

    Raises `DescriptionError` for two ends on one body and for numbers out of range.

    >>> import partita as pt
    >>> m = pt.Mechanism("anchor")
    >>> load = m.add_body("load", mass=2.0, inertia=(0.01, 0.01, 0.01), position=(0, -1, 0))
    >>> guide = m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
    >>> rope = m.add_rope("rope", m.ground, (0, 0, 0), load, (0, 0, 0), stiffness=2000.0, length=1.5)
    >>> run = m.simulate(1.0)
    >>> bool(run.joint("guide").displacement.min() > -0.61), bool(run.energy.relative_balance < 1e-6)
    (True, True)
    """
    element = name_of("force", name, self._description.forces)
    (first, end1), (second, end2), drawn = both_ends(self, element, "rope", (body1, point1), (body2, point2))
    if length is None and drawn == 0.0:
        element.fail("both ends are at the same point as drawn, which is no length; give length")
    power = number(element, "exponent", exponent, least=1.0)
    units = {"stiffness": per_power("N", "m", power), "damping": "s/m", "length": "m"}
    means = {
        "body1": first,
        "point1": end1,
        "body2": second,
        "point2": end2,
        "length": drawn if length is None else number(element, "length", length, "m", above=0.0),
        "stiffness": number(element, "stiffness", stiffness, units["stiffness"], least=0.0),
        "exponent": power,
        "damping": number(element, "damping", damping, "s/m", least=0.0),
    }
    arguments = {
        **means,
        "length": None if length is None else means["length"],
        "exponent": None if power == 1.0 else power,
        "damping": means["damping"] or None,
    }
    return store(self, LoadRecord(name, "rope", arguments, means, units))
