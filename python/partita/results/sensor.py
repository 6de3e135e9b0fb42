"""Sensors of a run: the source of their numbers, and the result of `run.sensor`."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import driven, index_of
from ..numeric import shown
from ..sensing import Moving, Reader, SensorRecord, text_of, unit_of
from ..sensing.quantities import FORMS
from ..sensing.records import READS
from .body import BodyResult, resting
from .force import ForceResult
from .source import BODIES, ModelSource, Span

Array = NDArray[Any]

LONGEST_VARIABLE = 53
"""Characters of the name of an array in files: with the ending of its axis, `_component`, the 63 that MATLAB reads."""


@dataclass(frozen=True, repr=False)
class SensorResult:
    """Readings of one sensor over the nt outputs of a run."""

    name: str
    values: Array
    """(nt,) of a number, (nt, 3) of a vector, (nt, 3, 3) of a rotation, (nt, n) of n coordinates."""
    unit: str
    """"" where the columns differ, or where it is not known."""
    text: str
    """The long name."""

    def __repr__(self) -> str:
        unit = f" [{self.unit}]" if self.unit not in ("", "1") else ""
        return f"<sensor {self.name!r}: {self.text}{unit}, values {self.values.shape}>"


def account_of(sensors: Mapping[str, SensorRecord], summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Name, unit, long name, and the name of its array in files, of each sensor."""
    found: list[dict[str, str]] = []
    taken: set[str] = set()
    for name, record in sensors.items():
        whole = "sensor_" + re.sub(r"\W", "_", name, flags=re.ASCII)
        variable, number = whole[:LONGEST_VARIABLE], 0
        while variable in taken or variable.endswith(("_name", "_unit", "_length")):
            if len(variable) < LONGEST_VARIABLE:
                variable += "_"
                continue
            number += 1
            variable = f"{whole[: LONGEST_VARIABLE - 1 - len(str(number))]}_{number}"
        taken.add(variable)
        unit = unit_of(record, sensors, summary.get("joints", ()))
        found.append({"name": name, "variable": variable, "unit": unit, "text": text_of(record)})
    return found


class RunSignals:
    """Numbers of all outputs of a run."""

    def __init__(self, source: ModelSource) -> None:
        self._source = source
        self._model, self._motion, self._summary = source.model, source.motion, source.summary
        self._loads: dict[str, Mapping[str, Array]] = {}

    @property
    def t(self) -> Array:
        found: Array = self._motion.t
        return found

    @cached_property
    def gravity(self) -> Array:
        """That which is constant, and the varying one by the force on all masses."""
        spec = json.loads(self._model.description)
        found = np.tile(np.array(spec["gravity"], dtype=float), (len(self.t), 1))
        numbers = [i for i, force in enumerate(spec["forces"]) if force["kind"] == "gravity"]
        light = {force["body"] for force in spec["forces"] if force["kind"] == "weightless"}
        mass = sum(float(body["mass"]) for body in spec["bodies"] if body["name"] not in light)
        for number in numbers if mass > 0.0 else ():
            found = found + np.sum(self._motion.load(number)["force"], axis=1) / mass
        return found

    def body(self, name: str) -> Moving:
        if name == "ground":
            at: BodyResult = resting(name, len(self.t))
            return Moving(at.position, at.rotation, at.velocity, at.angular_velocity)
        seen = self._source.body(self._names["body"].index(name))
        return Moving(*(seen[key] for key in BODIES))

    def body_acceleration(self, name: str) -> tuple[Array, Array]:
        if name == "ground":
            return np.zeros((len(self.t), 3)), np.zeros((len(self.t), 3))
        return self._source.body_acceleration(self._names["body"].index(name))

    def joint(self, name: str) -> tuple[Array, Array]:
        found = self._source.joint(*self._place(name))
        return found["joint_position"], found["joint_velocity"]

    def joint_acceleration(self, name: str) -> Array:
        j, _, v = self._place(name)
        return self._source.joint_acceleration(j, v)

    def joint_wrench(self, name: str, reads: str, axes: str) -> Array:
        j, _, v = self._place(name)
        found = self._source.reaction(j, v)
        if axes == "world":
            return found[reads]
        return np.asarray(np.einsum("...ij,...i->...j", found["joint_rotation"], found[reads]))

    def load(self, name: str) -> Mapping[str, Array]:
        if name not in self._loads:
            number, data = self._forces[name]
            load = dict(self._motion.load(number))
            if by := self._summary.get("holding", {}).get(name):
                # what it carries, or resists with, stands along the rows by which it holds
                load["effort"] = np.sum([self.condition("drive", drive)[:, 0] for drive in by], axis=0)
                if "joint" in data:
                    load["power"] = load["effort"] * self.joint(data["joint"])[1][:, data.get("coordinate", 0)]
                else:  # where it presses its gap does not change
                    load["power"] = np.zeros(len(self.t))
            self._loads[name] = load
        return self._loads[name]

    def applied(self) -> dict[str, tuple[Array, Array]]:
        found = {}
        for name, (_, data) in self._forces.items():
            if data.get("kind") == "force":
                load = self.load(name)
                found[name] = load["point"][:, -1], load["force"][:, -1]
        return found

    def applied_force(self, name: str) -> ForceResult:
        """A force by its name, read on request."""
        about = self._forces[list(self._forces)[index_of(name, list(self._forces), "force")]][1]
        kind = str(about["kind"])
        by_rows = name in self._summary.get("holding", {})
        form = "spring" if kind == "spring" else "effort" if by_rows or "joint" in about else "load"
        data = {"of": "force", "force": name, "form": form}
        return ForceResult(name, kind, tuple(READS[form]), lambda reads: FORMS["force"](self, {**data, "reads": reads}))

    def ends(self, name: str) -> Sequence[tuple[str, Array]]:
        spring = self._forces[name][1]
        return [(spring[f"body{i}"], np.array(spring[f"point{i}"])) for i in (1, 2)]

    def condition(self, kind: str, name: str) -> Array:
        first = int(self._summary.get("closing_rows", 0))
        if kind == "drive":
            rows = driven(self._summary)[name]
        else:
            rows = next(item["rows"] for item in self._summary.get("couplings", ()) if item["name"] == name)
        return np.asarray(self._source.efforts[:, [row - first for row in rows]])

    @cached_property
    def _names(self) -> dict[str, tuple[str, ...]]:
        of = (("body", "bodies"), ("joint", "joints"))
        return {kind: tuple(item["name"] for item in self._summary.get(key, ())) for kind, key in of}

    @cached_property
    def _forces(self) -> dict[str, tuple[int, dict[str, Any]]]:
        """Forces of the description that was computed, parameters changed: their numbers and data."""
        return {force["name"]: (i, force) for i, force in enumerate(json.loads(self._model.description)["forces"])}

    def _place(self, name: str) -> tuple[int, Span, Span]:
        j = self._names["joint"].index(name)
        about = self._summary["joints"][j]
        return j, tuple(about["q"]), tuple(about["v"])


class LiveSensors:
    """Sensors read on request, from the model of the run."""

    def __init__(
        self, sensors: Mapping[str, SensorRecord], source: ModelSource, account: Sequence[Mapping[str, str]]
    ) -> None:
        self._sensors, self._source, self._account = sensors, source, account

    @property
    def records(self) -> Mapping[str, SensorRecord]:
        """What each sensor reads, by name."""
        return self._sensors

    @cached_property
    def _signals(self) -> RunSignals:
        return RunSignals(self._source)

    @cached_property
    def _reader(self) -> Reader:
        return Reader(self._sensors, self._signals)

    def read(self, name: str) -> Array:
        return self._reader.read(name)

    def force(self, name: str) -> ForceResult:
        """An applied force by its name."""
        return self._signals.applied_force(name)

    def applied(self) -> dict[str, tuple[Array, Array]]:
        """Points and forces in the world of the loads that act at a point."""
        return self._signals.applied()

    def __reduce__(self) -> tuple[type[StoredSensors], tuple[Any, ...]]:
        """Their readings, for use without a model."""
        arrays = {item["variable"]: self.read(item["name"]) for item in self._account}
        return StoredSensors, (self._account, arrays, len(self._signals.t))


class StoredSensors:
    """Sensors that were read before: arrays by the names of their variables."""

    def __init__(self, account: Sequence[Mapping[str, str]], arrays: Mapping[str, Array], outputs: int) -> None:
        self._variables = {item["name"]: item["variable"] for item in account}
        self._arrays, self._outputs = arrays, outputs

    def force(self, name: str) -> ForceResult:
        """Refused: a stored run contains the readings of its sensors, and no other loads."""
        raise ArgumentError(
            f"force {shown(name)} needs the model and a motion, which a stored or pickled result does not have; ask "
            "the result of simulate, or add a sensor of the force before storing it",
            argument="name",
        )

    def applied(self) -> dict[str, tuple[Array, Array]]:
        """None: a stored run contains the readings of its sensors, and no other loads."""
        return {}

    def read(self, name: str) -> Array:
        # arrays without entries are left out of files
        return np.asarray(self._arrays.get(self._variables[name], np.zeros(self._outputs)))


def result_of(name: Any, account: Sequence[Mapping[str, str]], values: Any) -> SensorResult:
    """One sensor by its name; `values` reads it."""
    known = [item["name"] for item in account]
    item = account[index_of(str(name) if hasattr(name, "tree") else name, known, "sensor")]
    return SensorResult(item["name"], values(item["name"]), item["unit"], item["text"])
