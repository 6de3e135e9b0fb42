"""Rotors of motors that turn with a joint."""

from __future__ import annotations

from ..units import Quantity
from ..units.door import SI
from .checks import name_of, number
from .drawing import Drawing
from .forces import free_name
from .joints import coordinate_of, joint_record, scalars, unit_of
from .name_first import name_first
from .records import Description, Joint, Rotor, RotorRecord


@name_first(1)
def add_rotor(
    self: Drawing,
    joint: Joint | str,
    inertia: Quantity,
    *,
    ratio: float = 1.0,
    coordinate: int = 0,
    name: str | None = None,
) -> Rotor:
    """Add the rotor of a motor behind a gear: the joint moves ratio^2 inertia besides its bodies.

    Its kinetic energy is inertia (ratio rate)^2 / 2 with the rate of the joint coordinate: only the rotation against
    the parent counts, as usual for gears of high ratio (`armature` in MJCF). The rotor has no weight: add its mass to
    the body that carries the motor. Where the rotation of the parent matters too (a gyroscope, a gear of low ratio),
    prefer a body of its own on a revolute joint, coupled by `add_gear`.

    In the spanning tree a rotor costs one term of the mass matrix. On a joint that closes a loop, and in absolute
    coordinates, its rotation is a coordinate of its own with the name of the rotor, coupled to that of the joint.

    Args:
        joint: the joint or its name; not a coordinate that is part of a quaternion.
        inertia: of the rotor about its axis, above 0 [kg m^2].
        ratio: rate of the rotor over that of the joint, not 0; for a translation in rad/m (2 pi over the lead of a
            spindle), so that ratio^2 inertia is a mass.
        coordinate: which coordinate of the joint, from 0.
        name: unique among the rotors; None: made from the joint's name.

    Raises `DescriptionError` if a number violates these conditions.

    A motor whose rotor feels eight times as heavy behind its gear as the arm:

    >>> import partita as pt
    >>> m = pt.Mechanism("geared arm", gravity=None)
    >>> arm = m.add_body("arm", mass=1.0, inertia=(0.1, 0.1, 0.1))
    >>> hinge = m.add_revolute("A", m.ground, arm, point=(0, 0, 0))
    >>> rotor = m.add_rotor(hinge, 8e-5, ratio=100)
    >>> _ = m.add_torque(hinge, 0.9)
    >>> run = m.simulate(1.0)
    >>> round(run.joint("A").velocity[-1].item(), 9)   # 0.9 / (0.1 + 0.8)
    1.0
    """
    d = self._description
    element = name_of("rotor", free_name(self, f"rotor of {joint}", d.rotors) if name is None else name, d.rotors)
    found = joint_record(self, element, joint)
    where = coordinate_of(element, found, coordinate, scalars(found))
    units = rotor_units(d, found.name, where)
    about = number(element, "inertia", inertia, units["inertia"], above=0.0)
    geared = number(element, "ratio", ratio, units["ratio"])
    if geared == 0.0:
        element.fail("ratio is 0: the rotor would stand still; leave it out")
    d.store(d.rotors, RotorRecord(element.name, found.name, where, about, geared))
    return Rotor(element.name, self)


def rotor_units(d: Description, joint: str, coordinate: int) -> dict[str, SI]:
    """Units of the numbers of a rotor on this coordinate of a joint."""
    of_joint = unit_of(d.joints[joint], coordinate)
    return {"inertia": "kg m^2", "ratio": "" if of_joint == "rad" else "rad/m"}
