"""Exact drawings whose conditions are redundant in every position."""

from __future__ import annotations

import numpy as np

from . import linkages
from .judge import Case

MAKERS = linkages.EVERY | {
    "goldberg": (linkages.goldberg, 1),
    "myard": (linkages.myard, 1),
    "scissors": (linkages.scissors, 1),
}
COUNT = 44


def case(seed: int) -> Case:
    rng = np.random.default_rng([6, seed])
    names = [*MAKERS, "long train"]
    name = names[seed % len(names)]
    if name == "long train":
        loops = int(rng.choice([1, 6, 10, 20, 30, 60]))
        true = linkages.train(rng, loops)
        return Case(f"train of {loops} loops", true, true, 1, span=0.3, by_energy=True)
    make, mobility = MAKERS[name]
    true = make(rng)
    span = 0.15 if mobility == 3 else 0.4
    return Case(name, true, true, mobility, span=span, clear=True)
