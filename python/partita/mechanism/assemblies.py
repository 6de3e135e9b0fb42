"""All assemblies of a mechanism for given inputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import notebook
from .. import options as run_options
from ..errors import ArgumentError
from ..state import State
from ..units import Quantity
from .branches import name_of
from .models import Modelled, layout_of
from .solve import assemble


@dataclass(frozen=True)
class Assembled:
    """One assembly of a mechanism.

    Attributes:
        state: the closed state on these branches; simulate from it, or pass it to `assemble` as `near`.
        branches: block of loops -> its sign, for each block that has two solutions.
        residual: largest |Phi| [m, rad].
    """

    state: State
    branches: dict[str, int]
    residual: float

    @property
    def branch(self) -> str:
        """Its name among those for the same inputs: the signs of its blocks in the order of solution, such as "+-"."""
        return name_of(self.branches.values())


@dataclass(frozen=True)
class Assemblies:
    """All assemblies, that of the given state first. Iterable.

    Attributes:
        found: the assemblies.
        blocks: how the loops were ordered and solved, in words.
        notes: what the list does not contain, in words.
    """

    found: tuple[Assembled, ...]
    blocks: tuple[str, ...]
    notes: tuple[str, ...]

    def __iter__(self) -> Iterator[Assembled]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)

    def __getitem__(self, index: int) -> Assembled:
        return self.found[index]

    def _repr_html_(self) -> str:
        """The text, in a notebook."""
        return notebook.lines(str(self))

    def __str__(self) -> str:
        lines = [f"{len(self.found)} assemblies; loops in order of solution:", *(f"  {words}" for words in self.blocks)]
        for number, one in enumerate(self.found):
            lines.append(f"assembly {number}: branch {one.branch or 'none'}; |Phi| {one.residual:.1e}")
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def assemblies(
    self: Modelled,
    targets: Mapping[Any, Any] | None = None,
    rates: Mapping[Any, Any] | None = None,
    near: State | None = None,
    *,
    inputs: Iterable[str] | None = None,
    t: Quantity | None = None,
) -> Assemblies:
    """Find all positions in which the loops close for given values of the inputs, by inverse kinematics.

    Loops are solved one after the other in closed form where they can be ordered: planar dyads of revolute and
    prismatic joints, spatial loops with a ball joint or two (a characteristic pair). Each has up to two solutions, its
    branches. Gears, racks, screws and cams connect one loop to the next. Loops that cannot be ordered are solved by
    iteration, near the given position only.

    Args:
        targets, rates, near, t: values and rates of the inputs, as in `assemble`.
        inputs: names of velocities, as many as degrees of freedom; None: those that order the most loops.

    Returns:
        The assemblies; that of `assemble(targets, rates, near)` is the first.

    Raises:
        ArgumentError: the inputs do not determine the other coordinates, there are more than 4096 combinations, or a
            coupling or drive constrains only rates. AssemblyError: as in `assemble`.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> both = m.assemblies(targets={"A": 0.5}, inputs=["A"])
    >>> [list(one.branches.values()) for one in both]
    [[-1], [1]]
    """
    model, layout = layout_of(self, "relative")
    start = assemble(self, targets, None, near, t=t)
    which = None
    if inputs is not None:
        names = run_options.velocities("inputs", inputs, model.velocity_names)
        if len(names) != model.mobility:
            raise ArgumentError(
                f"inputs names {len(names)} velocities, but the mechanism has {model.mobility} degrees of freedom; "
                "name that many",
                argument="inputs",
            )
        which = [model.velocity_names.index(name) for name in names]
    found, blocks, notes = model.core.assemblies(start.t, start.q, which)
    all_of_them = []
    for q, branches, residual in found:
        position = State(start.t, q, np.zeros(model.core.nv), layout=layout)
        state = assemble(self, None, rates, position, t=start.t)
        signs = {words: sign for words, sign in zip(blocks, branches, strict=True) if sign != 0}
        all_of_them.append(Assembled(state, signs, residual))
    return Assemblies(tuple(all_of_them), tuple(blocks), tuple(notes))
