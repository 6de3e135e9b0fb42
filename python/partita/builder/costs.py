"""Costs of one evaluation: the request checked, and passed to the core."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..errors import ArgumentError
from ..numeric import floats, shown
from ..options import positive, tangent_of

Array = NDArray[np.float64]
_OF_THE_MODEL = ("coordinates", "parameters")
"""Options of a run that do not concern its equations."""


def evaluation_costs(
    core: _core.Model | _core.System,
    options: Sequence[Mapping[str, Any]],
    steps: Sequence[float],
    states: tuple[ArrayLike, ArrayLike, ArrayLike],
    tangent: Any,
) -> list[float]:
    """See `Equations.evaluation_costs`."""
    if not isinstance(options, list | tuple) or not all(isinstance(x, Mapping) for x in options):
        raise ArgumentError(
            f"options must be a list of the options of runs, as Result.options has them, not {shown(options)}",
            argument="options",
        )
    lengths = [positive("steps", x) for x in _numbers("steps", steps, 1)]
    t, q, v = (_numbers(name, x, axes) for name, x, axes in zip("tqv", states, (1, 2, 2), strict=True))
    asked = [json.dumps({key: x[key] for key in x if key not in _OF_THE_MODEL}) for x in options]
    own = None if tangent is None else tangent_of(tangent, core.nv)
    return core.evaluation_costs(asked, lengths, t, q, v, own)


def _numbers(what: str, value: Any, axes: int) -> Array:
    """An array of finite numbers with this many axes."""
    try:
        array = np.ascontiguousarray(floats(value))
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{what} must be an array of numbers, not {shown(value)}", argument=what) from error
    if array.ndim != axes or not np.isfinite(array).all():
        raise ArgumentError(
            f"{what} has shape {array.shape}; it must contain {'a row' if axes == 2 else 'a number'} for each state, "
            f"all finite",
            argument=what,
        )
    return array
