"""Sensors that a force law may read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..naming import index_of
from .quantities import Array, Moving
from .reader import Reader, plain
from .records import AT_ONCE, SensorRecord, uses


def refusal(record: SensorRecord, sensors: Mapping[str, SensorRecord]) -> str | None:
    """Why a force law cannot read a sensor; None where it can."""
    for name in uses(record):
        why = refusal(sensors[name], sensors)
        if why is not None:
            return why
    data, of = record.data, record.data["of"]
    if of in ("expression", "function"):
        return None
    if of in ("force", "drive", "coupling") or data["reads"] in ("force", "moment", "drive"):
        return (
            f'"{record.name}" reads a force, and forces depend on the value of this law; read positions and '
            "velocities (the length and rate of a spring as pt.Distance of its points)"
        )
    if data["reads"] not in AT_ONCE:
        return f'"{record.name}" reads an acceleration, which depends on the value of this law'
    return None


def at_once(record: SensorRecord, sensors: Mapping[str, SensorRecord]) -> bool:
    """Whether a sensor follows from q and v alone."""
    return refusal(record, sensors) is None


def seen_by_laws(sensors: Mapping[str, SensorRecord]) -> tuple[list[str], list[str]]:
    """Bodies and joints that laws must read for the sensors they may use."""
    bodies: dict[str, None] = {}
    joints: dict[str, None] = {}
    for record in sensors.values():
        if refusal(record, sensors) is not None:
            continue
        data = record.data
        measure = data.get("measure", {})
        for part in (data, measure):
            if "joint" in part:
                joints[part["joint"]] = None
            for key in ("body", "body1", "body2"):
                if key in part:
                    bodies[part[key]] = None
            axes = part.get("axes", "world")
            if axes != "world" and "joint" not in part:
                bodies[axes] = None
    bodies.pop("ground", None)
    return list(bodies), list(joints)


GROUND = Moving(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


class Unseen:
    """Quantities that are unknown before the forces."""

    @property
    def gravity(self) -> Array:
        raise self._unseen("gravity")

    def body_acceleration(self, name: str) -> tuple[Array, Array]:
        raise self._unseen(name)

    def joint_acceleration(self, name: str) -> Array:
        raise self._unseen(name)

    def joint_wrench(self, name: str, reads: str, axes: str) -> Array:
        raise self._unseen(name)

    def load(self, name: str) -> Mapping[str, Array]:
        raise self._unseen(name)

    def ends(self, name: str) -> Sequence[tuple[str, Array]]:
        raise self._unseen(name)

    def condition(self, kind: str, name: str) -> Array:
        raise self._unseen(name)

    @staticmethod
    def _unseen(name: str) -> ArgumentError:
        return ArgumentError(
            f"what acts at {name!r} depends on the values of force laws, so they cannot read it", argument="name"
        )


class Sighted(Unseen):
    """Signals of one state as read by a force law: numbers of bodies and coordinates of joints, side by side."""

    def __init__(self, t: float, numbers: Array, bodies: Sequence[str], joints: Mapping[str, int]) -> None:
        self.t, self._numbers = t, numbers
        self._bodies, self._joints = bodies, joints

    def body(self, name: str) -> Moving:
        if name == "ground":
            return GROUND
        x = self._numbers[18 * self._bodies.index(name) :][:18]
        return Moving(x[:3], x[3:12].reshape(3, 3), x[12:15], x[15:])

    def joint(self, name: str) -> tuple[Array, Array]:
        at, names = 18 * len(self._bodies), list(self._joints)
        at += 2 * sum(self._joints[other] for other in names[: names.index(name)])
        x = self._numbers[at : at + 2 * self._joints[name]]
        return x[::2], x[1::2]


class Senses:
    """The sensors that functions of the state may read, and their values."""

    def __init__(self, sensors: Mapping[str, SensorRecord], joints: Mapping[str, int]) -> None:
        self._sensors = sensors
        self.bodies, names = seen_by_laws(sensors)
        self._turning = [name for name in names if joints.get(name, 0) == 0]
        self.joints = {name: joints[name] for name in names if joints.get(name, 0) > 0}

    def read(self, name: str, t: float, numbers: Array) -> Any:
        """The value of a sensor at one state: a float or an array."""
        if not isinstance(name, str) and hasattr(name, "name"):
            name = str(name)
        if name not in self._sensors:
            index_of(name, list(self._sensors), "sensor")
        record = self._sensors[name]
        why = refusal(record, self._sensors)
        if why is not None:
            raise ArgumentError(f"a force law cannot read the sensor {why}", argument="name")
        turning = next((joint for joint in self._joints_of(record) if joint in self._turning), None)
        if turning is not None:
            raise ArgumentError(
                f'a force law cannot read the sensor "{name}": joint "{turning}" has no coordinate that is a slide or '
                "an angle; let a sensor read its body",
                argument="name",
            )
        return plain(Reader(self._sensors, Sighted(t, numbers, self.bodies, self.joints)).read(name))

    def _joints_of(self, record: SensorRecord) -> Iterator[str]:
        for part in (record.data, record.data.get("measure", {})):
            if "joint" in part:
                yield part["joint"]
        for name in uses(record):
            yield from self._joints_of(self._sensors[name])
