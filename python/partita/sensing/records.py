"""Sensors as plain data: the quantities that exist for each kind of object."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import UnknownNameError
from ..numeric import shown

Data = Mapping[str, Any]

OF_POINT = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
OF_MOUNTED = {"specific_force": "m/s^2"}
"""Vectors in the axes of the body on which the sensor is mounted, unless others are asked for."""
OF_TURNING = {"rotation": "1", "angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
OF_FORCE = {"power": "W", "energy": "J"}
READS: dict[str, dict[str, str]] = {
    "point": {**OF_POINT, **OF_MOUNTED},
    "body": {**OF_POINT, **OF_TURNING, **OF_MOUNTED},
    "joint": {"position": "", "velocity": "", "acceleration": "", "drive": "", "force": "N", "moment": "N m"},
    "measure": {"position": "", "velocity": "", "acceleration": ""},
    "spring": {"length": "m", "rate": "m/s", "force": "N", **OF_FORCE},
    "effort": {"effort": "", **OF_FORCE},
    "load": {"force": "N", "moment": "N m", "position": "m", **OF_FORCE},
    "drive": {"effort": "", "power": "W"},
    "coupling": {"effort": ""},
}
"""Quantities, with their unit where it is the same for all; of forces by their form."""

AT_ONCE = ("position", "velocity", "rotation", "angular_velocity")
"""Quantities that follow from q and v alone."""
OPERATIONS = {"sum": 2, "product": 2, "quotient": 2, "dot": 2, "norm": 1, "component": 2}
"""Operations of expressions, and how many operands they have; sums and products may have more."""


@dataclass(frozen=True)
class SensorRecord:
    """A sensor of a description: plain data, unit and words where they were given, a function if it is one."""

    name: str
    data: Data
    unit: str | None = None
    text: str | None = None
    function: Callable[..., Any] | None = field(default=None, compare=False)


def operands(tree: Any) -> Iterator[str]:
    """Names of the sensors in an expression."""
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, list | tuple):
        for part in tree[1:]:
            yield from operands(part)


def uses(record: SensorRecord) -> list[str]:
    """Other sensors from which a sensor is computed."""
    if record.data["of"] == "expression":
        return list(dict.fromkeys(operands(record.data["expression"])))
    return list(record.data["sensors"]) if record.data["of"] == "function" else []


def known(name: Any, sensors: Mapping[str, SensorRecord], where: str) -> str:
    """The name of an existing sensor."""
    if not isinstance(name, str) or name not in sensors:
        names = list(sensors)
        raise UnknownNameError(
            f"{where}there is no sensor {shown(name)}; known: {', '.join(names) or 'none yet'}",
            name=str(name),
            known=names,
        )
    return name
