"""Bodies, joints and sensors along a motion, by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from .body import BodyResult, resting
from .joint import AskedJoint, JointIndices
from .names import Names, index_of, name_of
from .sensor import LiveSensors, SensorResult, StoredSensors, result_of
from .source import BODIES, Source

FloatArray = NDArray[np.float64]


class Motion(ABC):
    """Positions, velocities and accelerations over nt outputs: what a run and a kinematic study have in common."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    _source: Source | None
    _sensors: LiveSensors | StoredSensors | None

    @property
    @abstractmethod
    def summary(self) -> Mapping[str, Any]:
        """The model's own description: bodies, joints, sizes, removed rows."""

    @cached_property
    def names(self) -> Names:
        """Names along the axes of the arrays: of coordinates, velocities, multipliers, joints and bodies."""
        rows = int(self.summary.get("rows", 0))
        return Names.from_summary(self.summary, self.q.shape[1], self.v.shape[1], rows)

    @property
    def title(self) -> str:
        """Name of the mechanism, or "system"."""
        return str(self.summary.get("name") or "system")

    def body(self, name: Any) -> BodyResult:
        """Motion of a body by name or handle; `"ground"` rests. `UnknownNameError` with the nearest names."""
        name = name_of(name)
        source = self._source_for("body", name)
        if isinstance(name, str) and name == "ground":
            return resting(name, len(self.t))
        i = index_of(name, self.names.bodies, "body")
        position, rotation, velocity, spin = (source.body(i)[key] for key in BODIES)
        accelerations = partial(source.body_acceleration, i) if source.has_model else None
        return BodyResult(name, position, rotation, velocity, spin, accelerations)

    def sensor(self, name: str) -> SensorResult:
        """The readings of the sensor `name`: `values` over time, `unit` and long name; see `Mechanism.add_sensor`.

        Computed at the outputs on first access, and stored. `UnknownNameError` with the nearest names; an
        `EvaluationError` where the function of a sensor fails.
        """
        self._source_for("sensor", name)
        read = self._sensors
        return result_of(name, self.summary.get("sensors", ()), lambda one: read.read(one) if read else np.zeros(0))

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(item["name"] for item in self.summary.get("sensors", ()))

    @property
    def at_once(self) -> Source:
        """Arrays of all bodies and joints at once, by name, for programs that go through all of them:
        `at_once.observed["body_position"]` (nt, nb, 3), `.joint_accelerations` (nt, degrees of freedom), and of a run
        `.reactions["force"]` (nt, nj, 3), `.determined` (two of (nt, nj, 6), in world axes and in joint axes),
        `.determined_efforts`, `.determined_drive` and `.checks`. Prefer `body(name)` and `joint(name)` for one.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.1)
        >>> run.at_once.reactions["force"].shape == (201, len(run.names.joints), 3)
        True
        """
        return self._source_for("joint", "all")

    def _joint(self, name: str) -> tuple[Mapping[str, Any], AskedJoint]:
        """What the model says of the joint `name`, and its data."""
        source = self._source_for("joint", name)
        j = index_of(name, self.names.joints, "joint")
        about = self.summary["joints"][j]
        return about, AskedJoint(source, JointIndices(j, tuple(about["q"]), tuple(about["v"])))

    def _source_for(self, kind: str, name: str) -> Source:
        if self._source is None:
            raise ArgumentError(
                f"no {kind} {name!r}: this is the run of a System given by matrices, which has coordinates "
                f"and multipliers only; use result.q, result.v and result.multipliers",
                argument=kind,
            )
        return self._source
