"""How far joints give: `Mechanism.add_compliance`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from .checks import Array, Element, number, shape_of, vector
from .drawing import Drawing
from .joints import joint_record
from .records import Joint


def add_compliance(self: Drawing, joint: Joint | str, translation: ArrayLike = 0.0, rotation: ArrayLike = 0.0) -> Joint:
    """Specify the compliance of a joint, by which redundant joints share loads that rigid bodies leave indeterminate.

    Neither the motion nor any determined reaction changes. Of all load distributions the one with the least energy
    stored in the joints is returned, as for rigid bodies on elastic joints. A joint without compliance is then rigid,
    and so is a direction given as 0. Without any compliance the rule is the least sum of squares of forces and of
    moments divided by a length.

    Args:
        joint: the joint or its name.
        translation: [m/N], one number or three along the axes of the joint (z is the axis of a hinge).
        rotation: [rad/(N m)], one number or three about them.

    Raises:
        DescriptionError: a number is negative or not finite, or all are 0. UnknownNameError: no such joint.

    >>> import partita as pt
    >>> m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    >>> leaf = m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    >>> low = m.add_revolute("low", m.ground, leaf, point=(0, 0, -0.8))
    >>> high = m.add_revolute("high", m.ground, leaf, point=(0, 0, 0.8))
    >>> _ = m.add_compliance("low", translation=1e-8, rotation=1e-6)
    >>> _ = m.add_compliance("high", translation=3e-8, rotation=1e-6)
    >>> run = m.simulate(0.1)
    >>> [round(float(run.joint(name).force[0, 2]), 3) for name in ("low", "high")]    # as 3 to 1
    [147.15, 49.05]
    """
    element = Element("compliance", str(joint))
    record = joint_record(self, element, joint)
    both = np.concatenate(
        [_three(element, "translation", translation, "m/N"), _three(element, "rotation", rotation, "rad/(N m)")]
    )
    if not both.any():
        element.fail("all entries are 0, which is a rigid joint; give compliances [m/N], [rad/(N m)], or omit it")
    self._description.store(self._description.joints, replace(record, compliance=both))
    return Joint(record.name, self)


def _three(element: Element, what: str, value: ArrayLike, unit: str) -> Array:
    """One number for all directions, or three; none negative."""
    if shape_of(value) == ():
        return np.full(3, number(element, what, value, unit, least=0.0))
    found = vector(element, what, value, unit)
    if found.min() < 0.0:
        element.fail(f"{what} is {found.tolist()}; a compliance must not be negative: give 0 or more")
    return found
