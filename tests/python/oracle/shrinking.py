"""A drawing on which the two programs differ, made as short as it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from .drawing import Drawing, Load, Spring


def shrunk(drawing: Drawing, fails: Callable[[Drawing], bool]) -> Drawing:
    """Leave out forces, drives, joints and bodies, then straighten numbers, as long as it fails."""
    going = True
    while going:
        going = False
        for shorter in candidates(drawing):
            if still(shorter, fails):
                drawing, going = shorter, True
                break
    return drawing


def still(drawing: Drawing, fails: Callable[[Drawing], bool]) -> bool:
    try:
        return fails(drawing)
    except Exception:  # a shorter drawing may make no sense at all
        return False


def candidates(d: Drawing) -> Iterator[Drawing]:
    """Shorter drawings, the shortest first."""
    for b in d.bodies:
        yield without_body(d, b.name)
    for j in d.joints:
        yield without_joint(d, j.name)
    for i in range(len(d.forces)):
        yield replace(d, forces=d.forces[:i] + d.forces[i + 1 :])
    for i in range(len(d.drives)):
        yield replace(d, drives=d.drives[:i] + d.drives[i + 1 :])
    for i in range(len(d.couplings)):
        yield replace(d, couplings=d.couplings[:i] + d.couplings[i + 1 :])
    for i in range(len(d.rotors)):
        yield replace(d, rotors=d.rotors[:i] + d.rotors[i + 1 :])
    for i, j in enumerate(d.joints):
        if j.cut != "auto":
            yield replace(d, joints=(*d.joints[:i], replace(j, cut="auto"), *d.joints[i + 1 :]))
    if np.any(d.gravity):
        yield replace(d, gravity=np.zeros(3))
    for i, b in enumerate(d.bodies):
        for simpler in (
            replace(b, com=np.zeros(3)) if np.any(b.com) else None,
            replace(b, inertia=np.eye(3)) if not np.array_equal(b.inertia, np.eye(3)) else None,
            replace(b, rotation=np.eye(3)) if not np.array_equal(b.rotation, np.eye(3)) else None,
        ):
            if simpler is not None:
                yield replace(d, bodies=(*d.bodies[:i], simpler, *d.bodies[i + 1 :]))


def without_body(d: Drawing, name: str) -> Drawing:
    d = replace(d, bodies=tuple(b for b in d.bodies if b.name != name))
    for j in [j.name for j in d.joints if name in (j.parent, j.child)]:
        d = without_joint(d, j)

    def on(f: Any) -> bool:
        if isinstance(f, Load | Spring):
            return f.body == name if isinstance(f, Load) else name in (f.body1, f.body2)
        return name in getattr(f, "bodies", ())

    couplings = tuple(
        c for c in d.couplings if not any(name in (x.get("body1"), x.get("body2")) for x in c.data.get("terms", ()))
    )
    return replace(d, forces=tuple(f for f in d.forces if not on(f)), couplings=couplings)


def without_joint(d: Drawing, name: str) -> Drawing:
    return replace(
        d,
        joints=tuple(j for j in d.joints if j.name != name),
        forces=tuple(f for f in d.forces if getattr(f, "joint", None) != name),
        couplings=tuple(c for c in d.couplings if all(x.get("joint") != name for x in c.data.get("terms", ()))),
        drives=tuple(x for x in d.drives if x.joint != name),
        rotors=tuple(x for x in d.rotors if x.joint != name),
    )
