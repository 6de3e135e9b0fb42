"""Where a result gets bodies, joints and reactions from: the compiled model, or a file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]

OBSERVED = (
    "body_position", "body_rotation", "body_velocity", "body_angular_velocity",
    "joint_position", "joint_velocity", "joint_point",
)  # fmt: skip
REACTIONS = ("force", "moment", "drive", "joint_rotation", "residual")


class Source(Protocol):
    """What a result needs to know beyond the arrays of the run itself."""

    @property
    def observed(self) -> Arrays:
        """Positions and velocities of bodies and joints at every output (the `OBSERVED` arrays)."""

    @property
    def reactions(self) -> Arrays:
        """Wrench of every joint at every output (the `REACTIONS` arrays)."""

    @property
    def augmented(self) -> Arrays | None:
        """`force` and `moment` of every joint by augmented joint coordinates; None where no model is at hand."""

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which reaction components are unique: (nj, 6) in world axes, (nj, 6) in joint axes."""


class ModelSource:
    """Asks the compiled model, once, when first needed: O(outputs x bodies) each."""

    def __init__(self, model: Any, run: Arrays) -> None:
        self._model = model
        self._run = run

    @cached_property
    def observed(self) -> Arrays:
        run = self._run
        return {key: np.asarray(a) for key, a in self._model.observe(run["t"], run["q"], run["v"]).items()}

    @cached_property
    def reactions(self) -> Arrays:
        run = self._run
        found = self._model.reactions(run["t"], run["q"], run["v"], run["vdot"], run["multipliers"])
        return {key: np.asarray(a) for key, a in found.items()}

    @cached_property
    def augmented(self) -> Arrays | None:
        run = self._run
        force, moment = self._model.augmented_reactions(run["t"], run["q"], run["v"], run["vdot"], run["multipliers"])
        return {"force": np.asarray(force), "moment": np.asarray(moment)}

    @cached_property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        i = regular_output(self._run["sigma"])
        t, q = float(self._run["t"][i]), self._run["q"][i]
        world, joint = (np.asarray(self._model.determined(t, q, axes), dtype=bool) for axes in (False, True))
        return world, joint


class StoredSource:
    """Reads the same from arrays that a file brought along."""

    def __init__(self, arrays: Arrays) -> None:
        self._arrays = arrays

    @property
    def observed(self) -> Arrays:
        return {key: self._arrays[key] for key in OBSERVED}

    @property
    def reactions(self) -> Arrays:
        return {key: self._arrays[key] for key in REACTIONS}

    @property
    def augmented(self) -> Arrays | None:
        return None

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        return (
            self._arrays["determined_world"].astype(bool),
            self._arrays["determined_joint"].astype(bool),
        )


def regular_output(sigma: NDArray[np.float64]) -> int:
    """The output farthest from a singular position: there uniqueness of reactions is the general one."""
    if sigma.size == 0 or not np.any(np.isfinite(sigma)):
        return 0
    return int(np.nanargmax(np.where(np.isfinite(sigma), sigma, -np.inf)))
