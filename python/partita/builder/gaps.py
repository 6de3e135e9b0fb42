"""Where a drawing is not yet a mechanism: points of a joint apart, sums of measurements other than asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..products import norm
from .bodies import to_world
from .checks import Array
from .measures import measure_unit, valued
from .records import GROUND, CouplingRecord, Description, JointRecord

FAR = 0.1
"""With a larger gap a mechanism starts elsewhere than it was drawn. Scale: fraction of the size of the drawing;
radians. Reason: a tenth is seen."""


class Unmet(NamedTuple):
    """A coupling and its sum, as drawn and as asked for."""

    coupling: CouplingRecord
    drawn: float
    asked: float
    unit: str


def point_of(d: Description, joint: JointRecord) -> Array:
    """Point of a joint in the world of the drawing."""
    if joint.point is not None:
        return joint.point
    return to_world(d, joint.parent if joint.child == GROUND else joint.child, np.zeros(3))


def size_of(d: Description) -> float:
    """Diagonal of the box around bodies and joints as drawn."""
    positions = [body.position for body in d.bodies.values()] + [point_of(d, joint) for joint in d.joints.values()]
    return norm(np.ptp(np.array(positions), axis=0)) if positions else 0.0


def unmet(d: Description) -> Iterator[Unmet]:
    """Weighted sums that contain a measurement between two bodies and have another value as drawn."""
    for coupling in d.couplings.values():
        if coupling.kind == "linear" and any(term["of"] != "joint" for term in coupling.terms):
            weights = zip(coupling.data["factors"], coupling.terms, strict=True)
            drawn = sum(factor * valued(d, term) for factor, term in weights)
            asked = float(coupling.data["offset"])
            if drawn != asked:
                yield Unmet(coupling, drawn, asked, measure_unit(d, coupling.terms[0]))


def far_from_drawn(d: Description) -> Iterator[str]:
    """Sentences on what makes a motion start far from the drawing."""
    size = size_of(d)
    for name, joint in d.joints.items():
        if joint.child_point is None:
            continue
        gap = float(norm(joint.child_point - point_of(d, joint)))
        if gap > FAR * max(size, gap):
            yield (
                f'joint "{name}": its points on "{joint.parent}" and "{joint.child}" are drawn {gap:.4g} m apart, so a '
                "motion starts far from the drawing; draw the bodies where they meet"
            )
    for coupling, drawn, asked, unit in unmet(d):
        if abs(drawn - asked) > FAR * (max(size, abs(asked)) if unit == "m" else 1.0):
            unit = f" {unit}" if unit else ""
            yield (
                f'{coupling.word} "{coupling.name}": its value is {drawn:.4g}{unit} as drawn, but {asked:.4g}{unit} is '
                "asked for, so a motion starts far from the drawing; leave the value out to keep the drawn one, or "
                "move the bodies"
            )
