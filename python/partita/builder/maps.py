"""What the core computes over many positions: singular ones, and what sets of actuators can do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .actuators import Actuator, for_core
from .compiled import CompiledModel

FloatArray = NDArray[np.float64]


class ActuatedModel:
    """A model with actuators."""

    def __init__(self, model: CompiledModel, actuators: list[Actuator]) -> None:
        self.model = model
        self.names = tuple(each.name for each in actuators)
        self._core = _core.Inverse(model.core, *for_core(model.description, actuators))

    def effects(self, t: float, q: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """At the rows of q: (n, k, s) what each actuator can do, without units, (n,) the least value of the
        constraints, and the length of the mechanism."""
        found = _core.measures(self.model.core, self._core, t, np.ascontiguousarray(q))
        return found["actuators"], found["constraints"], found["length"]

    def singular_positions(
        self, t: float, goals: list[Any], limits: FloatArray, seeds: FloatArray, one_branch: bool
    ) -> dict[str, Any]:
        """Singular positions of the actuators within the limits of the goals."""
        return _core.singularities(self.model.core, self._core, [], t, goals, limits, seeds, one_branch)


def singular_positions(
    model: CompiledModel,
    outputs: list[Any],
    t: float,
    goals: list[Any],
    limits: FloatArray,
    seeds: FloatArray,
    one_branch: bool,
) -> dict[str, Any]:
    """Singular positions of outputs within the limits of the goals, or of the constraints where there are none."""
    return _core.singularities(model.core, None, outputs, t, goals, limits, seeds, one_branch)
