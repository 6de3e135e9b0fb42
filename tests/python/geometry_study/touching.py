"""Misdrawn loops of joints that a rolling or sliding disc, a ball and bars are coupled to: they move as the exact ones.

What is coupled hangs on a bar and adds motions, so that it takes none from the loop.
"""

from __future__ import annotations

import numpy as np

from .drawing import Drawing, unit
from .judge import Case
from .linkages import EVERY
from .misdrawn import ONE_AXIS, WITHIN

COUNT = 72
ERRORS = (0.0, *WITHIN[:-1])
"""At the tolerance itself, which the last one is, some would have to be changed by more."""
KINDS = {"a disc that rolls": 2, "a ball that slides": 4, "two bars": 4}
"""What is added, and its degrees of freedom."""


def with_more(d: Drawing, kind: str, rng: np.random.Generator) -> Drawing:
    """A body on bars beside the last body of the mechanism, on the floor z = 0 or on one more bar."""
    d, size, last = d.copy(), d.size(), d.bodies[-1]
    at = last.position + size * np.array([0.6, 0.5, 0.0]) * rng.uniform(0.8, 1.2, 3)
    at[2] = 0.3 * size
    tip = last.position + 0.2 * size * rng.uniform(-1, 1, 3)
    d.body("extra", at, last.mass, 0.05 * last.mass * size**2 * np.array([1.0, 1.2, 1.4]))
    off = 0.1 * size * rng.uniform(-1, 1, 3)
    d.bar("bar", last.name, tip, "extra", at + off)
    if kind == "two bars":
        d.bar("other bar", "ground", at + size * rng.uniform(0.3, 0.6, 3), "extra", at - off)
    elif kind == "a ball that slides":
        d.joint("sliding", "floor", "ground", "extra", at, length=at[2])
    else:
        axis = unit([*rng.uniform(-1, 1, 2), 0.0])
        d.joint("rolling", "floor", "ground", "extra", at, axis, length=at[2])
    return d


def case(seed: int) -> Case:
    """Each linkage with each error in turn."""
    names, kinds = list(EVERY), list(KINDS)
    name, error = names[seed % len(names)], ERRORS[seed // len(names) % len(ERRORS)]
    rng = np.random.default_rng([8, seed])
    kind = kinds[int(rng.integers(3))]
    make, mobility = EVERY[name]
    true = with_more(make(rng), kind, rng)
    loop = [j.name for j in true.joints if j.kind not in ("distance", "rolling", "sliding")]
    alone = ONE_AXIS.get(name) if rng.random() < 0.5 else None
    drawn, moved = true.copy(), true.off(rng, error, alone)
    drawn.joints = [m if m.name in loop else j for j, m in zip(true.joints, moved.joints, strict=True)]
    return Case(
        name=f"{name} {'an axis' if alone else 'all'} off by {error:.0e}, {kind}",
        drawn=drawn,
        true=true,
        mobility=mobility + KINDS[kind],
        span=0.12,
        error=error,
        may_refuse=error > 0,
        clear=True,
    )
