"""Source of the numbers of position and velocity sensors at one state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .laws import GROUND, Unseen
from .quantities import Array, Moving

_BODIES = ("body_position", "body_rotation", "body_velocity", "body_angular_velocity")


class StateSignals(Unseen):
    """Signals of one state of a compiled model, without accelerations and forces."""

    def __init__(self, model: Any, t: float, q: Array, v: Array, summary: Mapping[str, Any]) -> None:
        self.t, self._summary = t, summary
        self._motion = model.motion(np.array([t]), np.asarray(q)[None], np.asarray(v)[None])

    def body(self, name: str) -> Moving:
        if name == "ground":
            return GROUND
        found = self._motion.bodies([self._number("bodies", name)])
        return Moving(*(found[key][0, 0] for key in _BODIES))

    def joint(self, name: str) -> tuple[Array, Array]:
        found = self._motion.joints([self._number("joints", name)])
        return found["joint_position"][0], found["joint_velocity"][0]

    def _number(self, kind: str, name: str) -> int:
        return next(i for i, item in enumerate(self._summary[kind]) if item["name"] == name)
