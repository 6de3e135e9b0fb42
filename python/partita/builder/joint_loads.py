"""Loads along a coordinate of a joint: springs, friction, end stops, gas springs.

Friction and stops have two laws each. Smooth ones: friction is a steep function of the speed instead of a jump, the
force of a stop a function of the depth; the smaller the stick velocity and the stiffer the stop, the shorter the steps
of a run. And the laws themselves: friction that sticks, stops that are rigid; a run finds when they hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

from numpy.typing import ArrayLike

from ..units import Quantity
from . import callbacks
from .checks import number
from .declaration import JOINT, Call, Field, Load, amount, effort, rate, unit
from .drawing import Drawing
from .name_first import name_first
from .records import Force, Joint
from .values import Constant, Value, scalar

TORSION_SPRING = Load(
    "torsion_spring",
    **JOINT,
    stiffness=rate(lambda call: f"{effort(call)}/{unit(call)}"),
    damping=rate(lambda call: f"{effort(call)} s/{unit(call)}"),
    angle=amount(unit),
    called="spring of",
)
_OF_COEFFICIENTS = ("coefficient", "static_coefficient", "radius", "length", "collar")


def _magnitude(call: Call, what: str, value: Any, unit: str) -> Value:
    """A friction magnitude, which is checked to be not negative where it is a constant."""
    magnitude = scalar(call.element, what, value, "monotone", callbacks.number_of(call.element), ("s", unit))
    if isinstance(magnitude, Constant):
        number(call.element, what, magnitude.value, least=0.0)
    return magnitude


_MAGNITUDE = Field(_magnitude, {"$ref": "#/$defs/value"}, effort)
_COEFFICIENT = replace(amount(least=0.0), rule={"$ref": "#/$defs/quantity"})
FRICTION = Load(
    "friction",
    **JOINT,
    dynamic=_MAGNITUDE,
    static=_MAGNITUDE,
    stick_velocity=amount(lambda call: f"{unit(call)}/s", least=0.0),
    coefficient=_COEFFICIENT,
    static_coefficient=_COEFFICIENT,
    radius=amount("m", above=0.0),
    length=amount("m", above=0.0),
    collar=amount("m", least=0.0),
    preload=amount("N", least=0.0),
    called="friction in",
)
STOP = Load(
    "stop",
    **JOINT,
    lower=amount(unit),
    upper=amount(unit),
    stiffness=amount(lambda call: per_power(effort(call), unit(call), call["exponent"]), least=0.0),
    damping=amount(lambda call: f"s/{unit(call)}", least=0.0),
    exponent=amount(least=1.0),
    restitution=amount(least=0.0),
    lost="the motion has no end there",
    called="stop of",
)
GAS_SPRING = Load(
    "gas_spring",
    **JOINT,
    force=amount(effort),
    length=amount(unit, above=0.0),
    exponent=amount(above=1.0),
    lost="it no longer acts",
    called="gas spring of",
)


@TORSION_SPRING
@name_first(1)
def add_torsion_spring(
    self: Drawing,
    joint: Joint | str,
    *,
    stiffness: Quantity,
    damping: Quantity = 0.0,
    angle: Quantity = 0.0,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a spring and damper along one coordinate of a joint: -stiffness (x - angle) - damping x' acts on
    the child.

    Args:
        joint: the joint or its name; its coordinate must not be part of a quaternion.
        stiffness: [N m/rad] for a rotation, [N/m] for a translation.
        damping: [N m s/rad] or [N s/m].
        angle: coordinate at which the spring is at rest [rad] or [m]; 0: the drawn position.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("flap")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.add_torsion_spring(hinge, stiffness=5.0).name
    'spring of A'
    """
    return TORSION_SPRING.checked(locals()).store()


@FRICTION
@name_first(1)
def add_friction(
    self: Drawing,
    joint: Joint | str,
    dynamic: Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any] | None = None,
    *,
    stick_velocity: Quantity = 0.0,
    static: Quantity | tuple[ArrayLike, ArrayLike] | Callable[..., Any] | None = None,
    coefficient: float | None = None,
    static_coefficient: float | None = None,
    radius: Quantity | None = None,
    length: Quantity | None = None,
    collar: Quantity | None = None,
    preload: Quantity = 0.0,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add dry friction along one coordinate of a joint: with a stick velocity smoothed below it, else the law itself.

    Without a stick velocity it resists motion with `dynamic`, and at rest carries whatever is needed up to `static`: it
    sticks, exactly. A run finds when it sticks and when it slips; `run.events` has the records. What it carries is part
    of the reaction of the joint. Other analyses, which look at one state, refuse it.

    With a stick velocity and u = rate / stick_velocity the effort on the child is

        -(dynamic 4u / sqrt(1 + 16 u^2) + (static - dynamic) u / (3/4 + u^2/4)^2).

    The second part, whose maximum 1 is at u = 1, is that of Brown and McPhee (J. Comput. Nonlinear Dynam. 11, 2016). At
    rest the effort is zero: a body that should stick creeps, more slowly than the stick velocity as long as the load is
    below `static` minus 3 per cent of `dynamic`. A small stick velocity approximates Coulomb's law and requires small
    steps.

    Give either the magnitude (`dynamic`, `static`) or a `coefficient`; with a coefficient the magnitude is coefficient
    N and depends on the reaction of this joint, which the friction affects in turn. With F and M the force and the
    moment of the joint's constraints and drives (as in `run.joint(...)`), N is |F| across the axis for a translation,
    and radius |F| across the axis for a rotation. Give the `length` L of the bearing if it carries a moment: two short
    bearings at its ends then share F and take M across the axis, N = |F/2 + M x a / L| + |F/2 - M x a / L| (times the
    radius for a rotation), with the axis a. `collar` adds collar |F along the axis| for a rotation, `radius` adds |M
    about the axis| / radius for a translation.

    For a planar mechanism the reaction in the plane is used if it is sufficient: for a rotation without collar and
    length; for a translation if no load acts across the plane (gravity, forces; force functions and contacts count as
    such loads) and, with a length, if everything lies in one plane. Otherwise the joints are treated as spatial, and
    their load distribution may not be determined.

    Prefer the coefficient if the loads change during the motion. An evaluation then solves for the accelerations once
    more, densely: (n + m)^3 / 6 multiplications for n velocities and m constraint rows.

    Args:
        joint: the joint or its name, in the tree or closing a loop; not a coordinate that is part of a quaternion.
        dynamic: magnitude of sliding friction, a torque for a rotation [N m], a force for a translation [N]: a number
            that is not negative, a table (times, values), or f(t, state).
        stick_velocity: rate at which `static` is reached [rad/s] or [m/s]; 0: the law itself, with `dynamic` alone.
        static: magnitude of static friction; None: equal to `dynamic`.
        coefficient: instead of `dynamic`: sliding friction divided by the normal force N, not negative.
        static_coefficient: the same for static friction; None: equal to `coefficient`.
        radius: for a rotation, the radius of the sliding surface (required with a coefficient); for a translation, the
            arm that prevents rotation; above 0 [m].
        length: of the bearing, above 0 [m]; None: moments cause no normal force.
        collar: mean radius of the collar that carries the axial force of a rotation [m]; None: the axial force causes
            no friction.
        preload: constant normal force, not negative [N].
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    Raises `DescriptionError` if a number violates these conditions. A run with a coefficient ends with an
    `OpenReactionError` that names the joint if its reaction is not determined (redundant joints), and with an
    `EvaluationError` if no consistent values of friction and reaction exist or more than one: jamming, Painleve's
    paradox.

    >>> import partita as pt
    >>> m = pt.Mechanism("sledge", gravity=None)
    >>> sledge = m.add_body("sledge", mass=2.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, sledge, axis=(1, 0, 0))
    >>> _ = m.add_friction(slide, 4.0, stick_velocity=1e-3)
    >>> run = m.simulate(0.5, initial=m.assemble(rates={"S": 3.0}))
    >>> round(run.joint("S").velocity[-1].item(), 3)   # 3 - 4/2 * 0.5
    2.0

    The same without a stick velocity stops after 1.5 s, and stays:

    >>> m = pt.Mechanism("sledge", gravity=None)
    >>> sledge = m.add_body("sledge", mass=2.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, sledge, axis=(1, 0, 0))
    >>> _ = m.add_friction(slide, 4.0)
    >>> run = m.simulate(2.0, initial=m.assemble(rates={"S": 3.0}))
    >>> [(event.kind, round(event.t, 9)) for event in run.events], round(run.joint("S").displacement[-1].item(), 9)
    ([('stick', 1.5)], 2.25)

    A block on an incline of 30 degrees slides with g (sin 30 - 0.3 cos 30):

    >>> m = pt.Mechanism("incline", gravity=(4.905, 0, -8.4957))
    >>> block = m.add_body("block", mass=2.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    >>> _ = m.add_friction(slide, coefficient=0.3, stick_velocity=1e-4)
    >>> run = m.simulate(1.0, initial=m.assemble(rates={"S": 1.0}))
    >>> round(run.joint("S").velocity[-1].item(), 3)   # 1 + 4.905 - 0.3 * 8.4957
    3.356
    """
    call = FRICTION.checked(locals())
    given = {what: call[what] for what in _OF_COEFFICIENTS if call[what] is not None}
    if coefficient is not None:
        if dynamic is not None or static is not None:
            call.element.fail(
                "magnitudes (dynamic, static) and a coefficient exclude one another; give magnitudes, or a "
                "coefficient, which multiplies the reaction of the joint"
            )
        if not call["stick_velocity"]:
            call.element.fail(
                "friction by a coefficient needs a stick_velocity: without one it would stick, and reaction and "
                "friction together might have no values or several; or give its magnitude (dynamic)"
            )
        follows = {**given, "preload": call["preload"]}
        return call.store(**call.take("joint", "coordinate", "stick_velocity"), follows=follows)
    if dynamic is None:
        call.element.fail("give its magnitude (dynamic), or a coefficient that multiplies the reaction of the joint")
    idle = [*given, *(["preload"] if call["preload"] else [])]
    if idle:
        call.element.fail(f"{', '.join(idle)} needs a coefficient; give one instead of dynamic")
    return call.store(**call.take("joint", "coordinate", "dynamic", "static", "stick_velocity"))


@STOP
@name_first(1)
def add_stop(
    self: Drawing,
    joint: Joint | str,
    *,
    stiffness: Quantity | None = None,
    lower: Quantity | None = None,
    upper: Quantity | None = None,
    damping: Quantity = 0.0,
    exponent: float = 1.0,
    restitution: float | None = None,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add end stops along one coordinate of a joint: springs that act only beyond its limits, or rigid ends.

    Give a `stiffness` or a `restitution`. Rigid ends are never passed: where one is hit the rate is reversed and
    multiplied by the restitution (Newton's law), and the joint rests there as long as it presses. A run finds the
    impacts; `run.events` has them with the impulses of all joints. Other analyses, which look at one state, refuse
    rigid ends.

    With a stiffness the joint is pushed back beyond a limit by the depth d with stiffness d^exponent (1 + damping
    dd/dt), never pulled (Hunt and Crossley, J. Appl. Mech. 42, 1975): no jump at the first touch. For exponent 1 a
    damper of c [N s/m] at the depth d is damping = c / (stiffness d).

    Args:
        joint: the joint or its name, in the tree or closing a loop; not a coordinate that is part of a quaternion. The
            angle of a joint that closes a loop in space (or in absolute coordinates) is known up to full turns: its
            value within half a turn of the middle of the two limits, or of the single limit, is used.
        stiffness: effort at a depth of 1 rad or 1 m, not negative; None: the ends are rigid.
        lower, upper: limits of the coordinate, from the drawn position [rad] or [m]; None: no limit.
        damping: relative increase of the effort per approach speed [s/rad] or [s/m], not negative.
        exponent: power of the depth, at least 1.
        restitution: of rigid ends: 0: they are hit without rebound, 1: without loss.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    >>> import partita as pt
    >>> m = pt.Mechanism("door", gravity=None)
    >>> leaf = m.add_rod("leaf", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    >>> hinge = m.add_revolute("A", m.ground, leaf, point=(0, 0, 0))
    >>> m.add_stop(hinge, lower=-1.5, upper=1.5, stiffness=1e4, damping=0.5).name
    'stop of A'
    """
    call = STOP.checked(locals())
    low, high = call["lower"], call["upper"]
    if low is None and high is None:
        call.element.fail("it has neither a lower nor an upper end; give one or both")
    if low is not None and high is not None and low >= high:
        call.element.fail(f"lower = {low:g} is not below upper = {high:g}")
    rigid = call["restitution"]
    if (rigid is None) == (call["stiffness"] is None):
        call.element.fail("give a stiffness, for ends that yield, or a restitution, for rigid ends")
    if rigid is not None and rigid > 1.0:
        call.element.fail(f"restitution = {rigid:g} would return more speed than came in; give 0 to 1")
    if rigid is not None and (call["damping"] or call["exponent"] != 1.0):
        call.element.fail("damping and exponent belong to a stiffness; rigid ends have a restitution alone")
    return call.store()


@GAS_SPRING
@name_first(1)
def add_gas_spring(
    self: Drawing,
    joint: Joint | str,
    *,
    force: Quantity,
    length: Quantity,
    exponent: float = 1.3,
    coordinate: int = 0,
    name: str | None = None,
) -> Force:
    """Add a gas spring along one coordinate of a joint: a closed column of gas that pushes the two sides apart.

    With x the coordinate from its drawn position the effort on the child is force / (1 + x / length)^exponent: the
    column is `length` long as drawn and grows with x. A negative force pushes the coordinate back, and the column gets
    shorter as x grows. The motion cannot compress it to zero length, since the effort would become infinite. Between
    two points, as of a lid, it is `add_gas_strut`.

    Args:
        joint: the joint or its name, in the tree or closing a loop; not a coordinate that is part of a quaternion.
        force: effort as drawn, not 0: force for a translation [N], torque for a rotation [N m].
        length: of the column as drawn: volume divided by area for a translation [m], volume divided by its change with
            the angle for a rotation [rad]; above 0.
        exponent: polytropic exponent, above 1: 1.4 for fast motions of air, near 1 for slow ones.
        coordinate: which coordinate of the joint, from 0.
        name: None: made from the joint's name.

    Raises `DescriptionError` for what is said above.

    >>> import partita as pt
    >>> m = pt.Mechanism("tailgate", gravity=None)
    >>> rod = m.add_body("rod", mass=0.5, inertia=(1e-3, 1e-3, 1e-3))
    >>> slide = m.add_prismatic("S", m.ground, rod, axis=(1, 0, 0))
    >>> m.add_gas_spring(slide, force=400.0, length=0.3).name
    'gas spring of S'
    """
    call = GAS_SPRING.checked(locals())
    if call["force"] == 0.0:
        call.element.fail("its force is 0, so it never acts; give the force in the zero position")
    return call.store()


def per_power(effort: str, unit: str, power: float) -> str:
    """Unit of a stiffness whose effort grows with a power of the depth."""
    if power == 1.0:
        return f"{effort}/{unit}"
    power = min(power, 12.0)  # as far as exponents of units go
    return f"{effort}/{unit}^({Fraction(power).limit_denominator(100)})"


class JointLoads(Drawing):
    """The methods of this module."""

    add_torsion_spring = add_torsion_spring
    add_friction = add_friction
    add_stop = add_stop
    add_gas_spring = add_gas_spring
