"""Positions at rest of compiled models, as the core finds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core

Array = NDArray[np.float64]


def searched(core: Any, t: float, q: Array, stable: bool, known: Sequence[Array] = ()) -> dict[str, Any]:
    """The equilibrium that a search from the closed position q arrives at, none of the known ones."""
    beside = np.ascontiguousarray(known, dtype=float) if len(known) else np.zeros((0, len(q)))
    return _core.equilibrium(core, t, q, stable, beside)


def resting(core: Any, t: float, q: Array) -> dict[str, Any]:
    """The same of a position at rest that is known."""
    return _core.resting(core, t, q)


def family(
    core: Any, t: float, q: Array, along: Sequence[tuple[str, list[float], list[float]]], x: float, asked: Array
) -> dict[str, Any]:
    """Equilibria through q, where parameters have the first numbers plus x times the second ones."""
    return _core.equilibrium_family(core, t, q, list(along), x, asked)


def preloaded(core: Any, t: float, q: Array, unknown: Sequence[tuple[str, tuple[int, int]]]) -> list[list[float]]:
    """Numbers of parameters with which q is a position of rest; each with the powers of length and energy of its
    natural size."""
    return _core.preload(core, t, q, list(unknown))


def sizes(core: Any) -> Array:
    """Size of a large displacement of each velocity: 1 for an angle, a length otherwise."""
    return _core.characteristic_displacements(core)


def apart(core: Any, one: Array, other: Array) -> float:
    """Largest displacement between two positions, in these sizes, without whole turns on which nothing depends."""
    return float(np.abs(_core.displacement_between(core, one, other)).max(initial=0.0))
