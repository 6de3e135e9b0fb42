"""Over-constrained mechanisms off by up to e: within the tolerance they move as intended, beyond it
they are structures."""

from __future__ import annotations

import numpy as np

from .judge import Case
from .linkages import EVERY

WITHIN = (1e-8, 1e-7, 1e-6, 1e-5, 5e-5, 1e-4)
BEYOND = (1e-3, 1e-2)
ONE_AXIS = {"cranks": "B2", "bennett": "H1", "sarrus": "B0", "train": "B0", "gantry": "right"}
"""A joint to tilt alone."""
TURNING = {"cranks": {"A0": 6.0}, "train": {"A0": 3.0}, "bennett": {"H0": 1.0}, "cardan": {"in": 2.0}}
COUNT = 160


def case(seed: int) -> Case:
    """Each error of each mechanism in turn; every other time around of one axis alone."""
    names, errors = list(EVERY), WITHIN + BEYOND
    around, which = divmod(seed, len(names) * len(errors))
    name, error = names[which % len(names)], errors[which // len(names)]
    rng = np.random.default_rng([3, seed])
    make, mobility = EVERY[name]
    true = make(rng)
    alone = ONE_AXIS.get(name) if around % 2 else None
    return Case(
        name=f"{name} {'an axis' if alone else 'all'} off by {error:.0e}",
        drawn=true.off(rng, error, alone),
        true=true,
        mobility=0 if error in BEYOND else mobility,
        structure=error in BEYOND,
        rates=TURNING.get(name, {}),
        span=0.15 if name in ("delta", "three_rrr") else 0.4,
        error=error,
        clear=True,
    )
