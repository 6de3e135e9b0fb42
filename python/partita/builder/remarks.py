"""Remarks on a drawing: what is surely, or nearly surely, a mistake although it can be compiled."""

from __future__ import annotations

from .calls import referring
from .points import misplaced
from .records import Description


def remarks(d: Description) -> list[str]:
    """Points that seem to be given in the world, and bodies on which nothing acts."""
    return [*misplaced(d), *(_sentence(name) for name in unconnected(d))]


def unconnected(d: Description) -> list[str]:
    """Bodies to which nothing but a sensor refers, where others are joined."""
    if not d.joints:
        return []
    joined = {body for joint in d.joints.values() for body in (joint.parent, joint.child)}
    alone = [name for name in d.bodies if name not in joined]
    return [name for name in alone if all(table == "sensors" for table, _ in referring(d, "bodies", name))]


def _sentence(name: str) -> str:
    return (
        f'body "{name}" is connected to nothing: no joint, coupling or force acts on it; add a joint, or '
        f'add_free("{name} floats", m.ground, "{name}") if it is meant to float'
    )
