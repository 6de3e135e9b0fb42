"""What other tools replay: the tapes of one mechanism, with the names and present values of all arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..numeric import shown
from ..state import State
from .tape import Tape

Array = NDArray[np.float64]


class Output(NamedTuple):
    """A further output: its name, the part of the tape that holds it, where in it, and its shape."""

    name: str
    part: str
    first: int
    shape: tuple[int, ...]


@dataclass(frozen=True)
class Recorded:
    """The tapes and their arguments.

    Attributes:
        mechanism: its name.
        tapes: "motion" and "closed" of (t, x, u, p), "residual" of (t, q, v, u, p).
        q_names, v_names: names of the coordinates and of the velocities.
        v_independent: indices of the independent velocities.
        inputs, parameters: names of the numbers of u and of p.
        outputs: further outputs.
        rows: names of the constraint rows, those of Phi first.
        t0, x0, u0, p0: present values.
        fits: whether a state is one of this mechanism.
    """

    mechanism: str
    tapes: Mapping[str, Tape]
    q_names: tuple[str, ...]
    v_names: tuple[str, ...]
    v_independent: tuple[int, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[Output, ...]
    rows: tuple[str, ...]
    t0: float
    x0: Array
    u0: Array
    p0: Array
    fits: Callable[[State], bool]

    @property
    def sizes(self) -> dict[str, int | None]:
        """Numbers in each argument; None: one number alone."""
        nq, nv = len(self.q_names), len(self.v_names)
        found = {"x": len(self.x0), "q": nq, "v": nv, "u": len(self.inputs), "p": len(self.parameters)}
        return {"t": None, **found}


class Replayed:
    """Names, sizes and present values of the arguments of equations that another tool evaluates.

    Attributes:
        q_names, v_names: names of the coordinates q (nq,) and of the velocities v (nv,).
        independent: names of the independent velocities, v_I in x = (q, v_I).
        state_names: names of x: coordinates, then independent velocities, marked by '.
        inputs, parameters: names of the numbers of u and p.
        outputs: names of the further outputs.
        t0, x0, u0, p0: time [s], state, inputs and parameters where it was recorded.
        operations: operations of arithmetic of each function.
    """

    def __init__(self, recorded: Recorded, closing_rate: float) -> None:
        self._recorded, self._closing_rate = recorded, closing_rate
        self.q_names, self.v_names = recorded.q_names, recorded.v_names
        self.independent = tuple(recorded.v_names[i] for i in recorded.v_independent)
        self.state_names = (*recorded.q_names, *(f"{name}'" for name in self.independent))
        self.inputs, self.parameters = recorded.inputs, recorded.parameters
        self.outputs = tuple(output.name for output in recorded.outputs)
        self.t0, self.x0, self.u0, self.p0 = recorded.t0, recorded.x0, recorded.u0, recorded.p0

    @property
    def operations(self) -> dict[str, int]:
        """Operations of arithmetic of each function: what compiling costs grows with them."""
        motion, closed, residual = (self._recorded.tapes[name] for name in ("motion", "closed", "residual"))
        rates = [*motion.of_part("qdot"), *motion.of_part("udot")]
        if self._closing_rate:
            rates += motion.of_part("closing")
        wanted = {"rates": (motion, rates), "velocities": (motion, motion.of_part("v"))}
        wanted["close"] = closed, closed.of_part("q")
        wanted["residual"] = residual, [int(i) for i in residual.outputs]

        def count(tape: Tape, entries: list[int]) -> int:
            return sum(entry.operation not in ("input", "constant") for entry in tape.needed(entries))

        return {name: count(*what) for name, what in wanted.items()}

    def state(self, state: State) -> Array:
        """x = (q, v_I) of a state, as `assemble` returns it or a result holds it.

        Raises `ArgumentError` for a state of another mechanism or in other coordinates.
        """
        if not isinstance(state, State) or not self._recorded.fits(state):
            raise ArgumentError(
                f"state must be a State of {self._recorded.mechanism!r} in joint coordinates, as assemble returns it, "
                f"not {shown(state)}",
                argument="state",
            )
        return np.concatenate([state.q, state.v[list(self._recorded.v_independent)]])

    def __repr__(self) -> str:
        sizes = f"x ({len(self.x0)}), u ({len(self.u0)}), p ({len(self.p0)})"
        return f"<{type(self).__name__} of {self._recorded.mechanism!r}: t, {sizes}>"
