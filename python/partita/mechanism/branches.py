"""Branches by name: the signs of the blocks in which loops are closed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..numeric import shown

Array = NDArray[np.float64]


def name_of(signs: Any) -> str:
    """ "+-" for 1, -1: the blocks in the order of solution, without those with one solution."""
    return "".join("+" if sign > 0 else "-" for sign in signs if sign != 0)


def on_branch(model: CompiledModel, t: float, q: Array, branch: Any, inputs: list[int] | None) -> Array:
    """The closed position q with other signs of its blocks, at the present values of its inputs (velocities; None:
    chosen)."""
    if not isinstance(branch, str) or set(branch) - set("+-"):
        message = f"branch must be signs such as '+-', one for each block, not {shown(branch)}"
        raise ArgumentError(message, argument="branch")
    found, blocks, notes = model.core.assemblies(t, q, inputs)
    for there, signs, _ in found:
        if name_of(signs) == branch:
            return there
    names = ", ".join(repr(name_of(signs)) for _, signs, _ in found)
    words = "; ".join(blocks) or "no loops"
    noted = f" ({'; '.join(notes)})" if notes else ""
    raise ArgumentError(
        f"there is no branch {branch!r} at these inputs; those that close: {names}, by the signs of {words}{noted}",
        argument="branch",
    )
