"""Contacts: spheres against planes and spheres, and wheels on a road.

They are compliant: bodies overlap by a depth, and the force grows with it. At first touch the derivative of the force
is discontinuous, and a run takes small steps there; the stiffer the contact, the smaller.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..shapes import Shape
from ..units import Quantity
from .bodies import radius_of
from .checks import number
from .declaration import BETWEEN, Call, Field, Load, amount, heading, place, side
from .drawing import Drawing
from .joint_loads import per_power
from .records import GROUND, Body, Force


def _radius(least: float | None = None, above: float | None = None) -> Field:
    """A radius, or the shape whose radius it is."""

    def check(call: Call, what: str, value: Any, unit: Any) -> float:
        radius = radius_of(call.element, what, value)
        return number(call.element, what, radius, unit, least=least, above=above)

    return replace(amount("m", least=least, above=above), check=check)


CONTACT = Load(
    "contact",
    **BETWEEN,
    radius1=_radius(least=0.0),
    normal=heading(),
    radius2=_radius(above=0.0),
    stiffness=amount(lambda call: per_power("N", "m", call["exponent"]), least=0.0, absent=0.0),
    exponent=amount(least=1.0, kept=True),
    damping=amount("s/m", least=0.0),
    friction=amount(least=0.0),
    static_friction=amount(least=0.0, absent=lambda call: call["friction"]),
    stick_velocity=amount("m/s", above=0.0, absent=1.0, kept=True),
    restitution=amount(least=0.0),
    lost="its bodies pass through each other",
    apart="both sides are on {}, which cannot touch itself",
)
TYRE = Load(
    "tyre",
    body=side(ground=False),
    center=place("body"),
    axis=heading(),
    radius=_radius(above=0.0),
    ground=side(),
    point=place("ground", kept=True),
    normal=heading(),
    stiffness=amount("N/m", least=0.0),
    damping=amount("s/m", least=0.0),
    friction=amount(least=0.0),
    longitudinal=amount("N", least=0.0),
    lateral=amount("N", least=0.0),
    slow_speed=amount("m/s", above=0.0, absent=1.0, kept=True),
    lost="the wheel does not touch the road",
    sides=("body", "ground"),
    apart="wheel and road are on {}",
)


@CONTACT
def add_contact(
    self: Drawing,
    name: str,
    body1: Body | str,
    point1: ArrayLike,
    body2: Body | str,
    point2: ArrayLike,
    *,
    radius1: Quantity | Shape,
    stiffness: Quantity | None = None,
    normal: ArrayLike | None = None,
    radius2: Quantity | Shape | None = None,
    restitution: float | None = None,
    exponent: float = 1.5,
    damping: Quantity = 0.0,
    friction: float = 0.0,
    static_friction: float | None = None,
    stick_velocity: Quantity | None = None,
) -> Force:
    """Add the contact of a sphere (or a point) on one body with a plane or a sphere on another.

    At the depth d the bodies push each other apart by N = stiffness d^exponent (1 + damping dd/dt), never together
    (Hunt and Crossley, J. Appl. Mech. 42, 1975); nothing acts before they touch. For elastic spheres of one material
    Hertz's law has exponent 1.5 and stiffness 4/3 E* sqrt(R), 1/R = 1/radius1 + 1/radius2. The force acts at the plane,
    or midway in the overlap of two spheres. Friction opposes sliding there with N times the law of `add_friction`.

    A shape that has a radius may stand for it, such as `ball.shape`; a disc has the contact of a sphere too.

    With a `restitution` in place of a stiffness the contact is rigid and smooth: bodies never overlap, they bounce
    (Newton's law) and rest on each other as long as they press. A run finds the impacts; `run.events` has them with the
    impulses of all joints. Other analyses, which look at one state, refuse it.

    Args:
        name: unique among the forces.
        body1: body that carries the sphere, or the ground.
        point1: its centre, in body axes [m].
        body2: body that carries the plane or the other sphere, or the ground.
        point2: a point of the plane, or the other centre, in body axes (world for the ground) [m].
        radius1: of the sphere [m]; 0: a point, on a plane only.
        stiffness: force at a depth of 1 m [N/m^exponent], not negative; None: the contact is rigid.
        normal: of the plane, towards its free side, in the axes of body 2; the plane has no edge.
        radius2: of the other sphere [m], above 0. Give either `normal` or `radius2`.
        restitution: of a rigid contact: 0: no rebound, 1: no loss.
        exponent: power of the depth, at least 1.
        damping: relative increase of the force per approach speed [s/m], not negative.
        friction: coefficient of sliding friction; 0: none.
        static_friction: coefficient of static friction; None: equal to that of sliding.
        stick_velocity: sliding speed at which static friction is reached [m/s]; required with friction.

    >>> import partita as pt
    >>> m = pt.Mechanism("ball")
    >>> ball = m.add_solid("ball", pt.shapes.Sphere("30 mm"), mass=0.1, position=(0, 0.5, 0))
    >>> contact = m.add_contact(
    ...     "floor", ball, (0, 0, 0), m.ground, (0, 0, 0), radius1=ball.shape, normal=(0, 1, 0), stiffness=1e6
    ... )
    >>> contact.radius1
    0.03
    >>> run = m.simulate(0.35)
    >>> bool(run.body("ball").velocity[-1, 1] > 2.5)   # it came down and goes up again
    True
    """
    call = CONTACT.checked(locals())
    if (normal is None) == (radius2 is None):
        call.element.fail("the other side is a plane (normal) or a sphere (radius2); give one of the two")
    rigid = call["restitution"]
    if (rigid is None) == (call["stiffness"] is None):
        call.element.fail("give a stiffness, for bodies that yield, or a restitution, for rigid ones")
    if rigid is not None:
        if rigid > 1.0:
            call.element.fail(f"restitution = {rigid:g} would return more speed than came in; give 0 to 1")
        if call["friction"] or call["static_friction"] or call["damping"]:
            call.element.fail(
                "a rigid contact has no friction and no damping here: with friction its forces might have no values, "
                "or several (Painleve's paradox); give a stiffness in place of the restitution"
            )
        return call.store()
    if stick_velocity is None and (call["friction"] or call["static_friction"]):
        call.element.fail("friction needs a stick_velocity: the sliding speed [m/s] below which it counts as sticking")
    return call.store()


@TYRE
def add_tyre(
    self: Drawing,
    name: str,
    body: Body | str,
    *,
    center: ArrayLike,
    axis: ArrayLike,
    radius: Quantity | Shape,
    normal: ArrayLike,
    stiffness: Quantity,
    ground: Body | str = GROUND,
    point: ArrayLike = (0.0, 0.0, 0.0),
    damping: Quantity = 0.0,
    friction: float = 0.0,
    longitudinal: Quantity = 0.0,
    lateral: Quantity = 0.0,
    slow_speed: Quantity | None = None,
) -> Force:
    """Add a tyre: the disc of a wheel that presses on a road, optionally with slip forces.

    The lowest point of the free disc lies below the road by the depth d; the road pushes it along the normal by
    N = stiffness d (1 + damping dd/dt), never down. Slip forces act where the radius to that point meets the road. With
    the velocity s of the wheel's material there, along the wheel and across it, and the speed V of the centre along the
    wheel, z = (longitudinal s_x, lateral s_y) / sqrt(V^2 + slow_speed^2) and the force is -z / sqrt(1 + |z|^2 /
    (friction N)^2): linear at small slip, never above friction N. `wheel.shape`, a disc, may stand for its radius.

    Args:
        name: unique among the forces.
        body: the wheel, which rotates about `axis`.
        center: centre of the wheel, in body axes [m].
        axis: axis of the wheel, in body axes; its sign does not matter.
        radius: of the free disc [m].
        normal: upward normal of the road, in the axes of `ground`; the road is an unbounded plane.
        stiffness: [N/m], not negative.
        ground: body that carries the road.
        point: a point of the road, in the axes of `ground` [m].
        damping: relative increase of the force per approach speed [s/m]; a damper of c [N s/m] at the depth d has
            damping = c / (stiffness d).
        friction: coefficient that limits the slip force; 0: the wheel slides freely.
        longitudinal, lateral: slip stiffness, the force for a slip of 1 [N].
        slow_speed: speed [m/s] below which the slip is computed as at this speed; required with a slip stiffness.

    >>> import partita as pt
    >>> m = pt.Mechanism("wheel")
    >>> wheel = m.add_body("wheel", mass=20.0, inertia=(0.5, 0.5, 0.9), position=(0, 0.3, 0))
    >>> m.add_tyre("T", wheel, center=(0, 0, 0), axis=(0, 0, 1), radius=0.3, normal=(0, 1, 0), stiffness=2e5).name
    'T'
    """
    call = TYRE.checked(locals())
    stiff = call["longitudinal"] > 0.0 or call["lateral"] > 0.0
    if stiff and call["friction"] == 0.0:
        call.element.fail("slip stiffness without friction has no effect; give the friction that limits the force")
    if call["friction"] > 0.0 and not stiff:
        call.element.fail(
            "friction limits a slip force, and there is none; give longitudinal or lateral slip stiffness"
        )
    if stiff and slow_speed is None:
        call.element.fail("slip needs a slow_speed: the speed [m/s] below which the slip is computed as at this speed")
    return call.store()
