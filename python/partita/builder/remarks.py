"""Remarks on a drawing: what is surely, or nearly surely, a mistake although it can be compiled."""

from __future__ import annotations

from itertools import chain

from .calls import references
from .gaps import far_from_drawn
from .points import misplaced
from .records import Description
from .unlikely import unlikely


def remarks(d: Description) -> list[str]:
    """Points that seem to be given in the world, bodies on which nothing acts, starts far from the drawing, contacts
    that begin deep, joints far off their bodies."""
    return [*misplaced(d), *(_sentence(name) for name in unconnected(d)), *far_from_drawn(d), *unlikely(d)]


def unconnected(d: Description) -> list[str]:
    """Bodies to which nothing but a sensor refers, where others are joined."""
    if not d.joints:
        return []
    joined = {body for joint in d.joints.values() for body in (joint.parent, joint.child)}
    alone = [name for name in d.bodies if name not in joined]
    if not alone:
        return []
    acting = chain(d.couplings.values(), d.drives.values(), d.forces.values())
    touched = {name for record in acting for table, name in references(record) if table == "bodies"}
    return [name for name in alone if name not in touched]


def _sentence(name: str) -> str:
    return (
        f'body "{name}" is connected to nothing: no joint, coupling or force acts on it; add a joint, or '
        f'add_free("{name} floats", m.ground, "{name}") if it is meant to float'
    )
