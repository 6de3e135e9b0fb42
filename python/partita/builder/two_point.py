"""Loads along the line between two points: springs with dampers, ropes, gas struts."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ..units import Quantity
from .declaration import BETWEEN, Load, amount, as_drawn, rate
from .drawing import Drawing
from .joint_loads import per_power
from .records import Body, Force

SPRING = Load(
    "spring",
    **BETWEEN,
    stiffness=rate("N/m"),
    damping=rate("N s/m"),
    length=amount("m", least=0.0, absent=as_drawn, kept=True),
)
ROPE = Load(
    "rope",
    **BETWEEN,
    length=amount("m", above=0.0, absent=as_drawn, kept=True),
    stiffness=amount(lambda call: per_power("N", "m", call["exponent"]), least=0.0, absent=0.0),
    exponent=amount(least=1.0),
    damping=amount("s/m", least=0.0),
    restitution=amount(least=0.0),
    lost="nothing holds its ends together",
)
GAS_STRUT = Load(
    "gas_strut",
    **BETWEEN,
    force=amount("N", above=0.0),
    progression=amount(above=1.0),
    stroke=amount("m", above=0.0),
    length=amount("m", above=0.0, absent=as_drawn, kept=True),
    exponent=amount(above=1.0),
    damping=amount("N s/m", least=0.0),
    end_stiffness=amount("N/m", least=0.0),
    lost="it no longer acts",
)


@SPRING
def add_spring(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    stiffness: Quantity,
    damping: Quantity = 0.0,
    length: Quantity | None = None,
) -> Force:
    """Add a linear spring and damper between two points. For other laws of the length see `add_force_law`.

    The force along the line is stiffness (distance - length) + damping d(distance)/dt, positive in tension. Negative
    stiffness or damping is allowed, as for some controllers and magnets.

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground.
        point1, point2: in the axes of their body (world for the ground) [m].
        stiffness: [N/m].
        damping: [N s/m].
        length: free length [m], not negative; None: the drawn distance, so that the spring is unloaded as drawn.

    >>> import partita as pt
    >>> m = pt.Mechanism("swing")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> m.add_spring("S", m.ground, (0, 1, 0), rod, (1, 0, 0), stiffness=100.0).name
    'S'
    """
    call = SPRING.checked(locals())
    if as_drawn(call) == 0.0:
        call.element.fail(
            "both ends are at the same point as drawn, where the direction of the force is undefined; move one end"
        )
    return call.store()


@ROPE
def add_rope(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    stiffness: Quantity | None = None,
    length: Quantity | None = None,
    exponent: float = 1.0,
    damping: Quantity = 0.0,
    restitution: float | None = None,
) -> Force:
    """Add a rope, cable or chain without mass between two points: it pulls, never pushes, and goes slack.

    Where the points are farther apart than `length`, by the stretch s, they are pulled together by
    stiffness s^exponent (1 + damping ds/dt), never apart; nothing acts where they are nearer. A step of a run ends
    where the rope becomes taut or slack.

    With a `restitution` in place of a stiffness it does not stretch: where it becomes taut velocities jump
    (`run.events` has the impulses of all joints), it stays taut as long as it pulls, and `run.force(name).effort` is
    minus its tension. Analyses of one state refuse it.

    Prefer `add_distance` for a rope that is always taut and does not stretch, `add_spring` where compression acts too.
    A rope over a wheel is a rack (`add_rack`) or a belt (`add_belt`).

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground.
        point1, point2: in the axes of their body (world for the ground) [m].
        stiffness: tension at a stretch of 1 m [N/m^exponent], not negative; of a rope E A / length. None: it does not
            stretch.
        length: without tension [m], above 0; None: the drawn distance.
        exponent: power of the stretch, at least 1.
        damping: relative increase of the tension per speed of stretching [s/m], not negative.
        restitution: of a rope that does not stretch: 0: it becomes taut without rebound, 1: without loss.

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
    call = ROPE.checked(locals())
    if length is None and as_drawn(call) == 0.0:
        call.element.fail("both ends are at the same point as drawn, which is no length; give length")
    rigid = call["restitution"]
    if (rigid is None) == (call["stiffness"] is None):
        call.element.fail("give a stiffness, for a rope that stretches, or a restitution, for one that does not")
    if rigid is not None and rigid > 1.0:
        call.element.fail(f"restitution = {rigid:g} would return more speed than came in; give 0 to 1")
    if rigid is not None and (call["damping"] or call["exponent"] != 1.0):
        call.element.fail("damping and exponent belong to a stiffness; a rope that does not stretch has none")
    return call.store()


@GAS_STRUT
def add_gas_strut(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    force: Quantity,
    progression: float,
    stroke: Quantity,
    length: Quantity | None = None,
    exponent: float = 1.3,
    damping: Quantity = 0.0,
    end_stiffness: Quantity | None = None,
) -> Force:
    """Add a gas strut between two points, such as that of a tailgate: it pushes them apart. Its data sheet has the
    numbers.

    At the distance d of the points the force is F = force / (1 - (length - d) / c)^exponent, where c is such that F =
    progression force at d = length - stroke; damping dd/dt resists the motion. The same law holds beyond the stroke,
    unless there are stops. For gas in a coordinate of a joint see `add_gas_spring`.

    Args:
        name: unique among the forces.
        body1, body2: two different bodies or the ground; the tube is drawn on body 1.
        point1, point2: in the axes of their body (world for the ground) [m].
        force: at full extension [N], above 0: F1 of a data sheet.
        progression: force at full compression divided by `force`, above 1.
        stroke: from full extension to full compression [m], above 0 and below `length`.
        length: distance of the points at full extension [m]; None: the drawn distance.
        exponent: polytropic exponent, above 1.
        damping: [N s/m], not negative.
        end_stiffness: of stops at both ends of the stroke [N/m], not negative; None: no stops. A step of a run ends
            where it comes to a stop or leaves it.

    Raises `DescriptionError` for two ends on one body and for numbers out of range.

    >>> import partita as pt
    >>> m = pt.Mechanism("tailgate", gravity=(0, -9.81, 0))
    >>> gate = m.add_rod("gate", start=(0, 0, 0), end=(1, 0, 0), mass=8.0)
    >>> hinge = m.add_revolute("hinge", m.ground, gate, point=(0, 0, 0))
    >>> strut = m.add_gas_strut("strut", m.ground, (0, -0.4, 0), gate, (0.2, 0, 0), force="400 N", progression=1.35,
    ...                         stroke="200 mm", length="500 mm", damping=300.0)
    >>> run = m.simulate(1.0)
    >>> bool(run.joint("hinge").angle[-1] > 0.1)   # it lifts the gate
    True
    """
    call = GAS_STRUT.checked(locals())
    full = as_drawn(call) if length is None else call["length"]
    if call["stroke"] >= full:
        call.element.fail(f"its stroke is {call['stroke']:g} m, but its length only {full:g} m; the stroke is shorter")
    return call.store()


class TwoPointLoads(Drawing):
    """The methods of this module."""

    add_spring = add_spring
    add_rope = add_rope
    add_gas_strut = add_gas_strut
