"""What building costs: describe, compile, assemble, and load from TOML, for a thousand loops and for ten thousand."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from timing import once

import partita as pt

SIZES = (1000, 10000)
AIM = 12.0
ROUNDS = 3


@dataclass(frozen=True)
class Built:
    """Seconds of each part for a chain of `loops` four-bars, and how far the assembled loops are open."""

    loops: int
    describe: float
    compile: float
    assemble: float
    save: float
    load: float
    closure: float

    @property
    def built(self) -> float:
        """Describe, compile and assemble together."""
        return self.describe + self.compile + self.assemble


def built(loops: int) -> Built:
    """Once, from the drawing to a state, through a file and back."""
    describe, m = once(pt.catalogue.entry("n-four-bar", loops=loops).mechanism)
    compiling, model = once(m.compile)
    assembling, state = once(m.assemble)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chain.toml"
        save, _ = once(lambda: m.save(path))
        load, again = once(lambda: pt.load(path))
    if [*again.bodies, *again.joints] != [*m.bodies, *m.joints]:
        raise RuntimeError(f"the file of {loops} loops is another mechanism")
    closure = float(np.max(np.abs(model.constraints(state.q)), initial=0.0))
    return Built(loops, describe, compiling, assembling, save, load, closure)


def building_cost() -> dict[int, Built]:
    """Each size in turns; the fastest of each part counts."""
    found: dict[int, Built] = {}
    for _ in range(ROUNDS):
        for loops in SIZES:
            now = built(loops)
            before = found.get(loops, now)
            parts = {name: min(getattr(now, name), getattr(before, name)) for name in PARTS}
            found[loops] = Built(loops, closure=now.closure, **parts)
    return found


PARTS = ("describe", "compile", "assemble", "save", "load")
