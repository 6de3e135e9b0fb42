"""What the events of a mechanism follow: measures, sensors and functions of the state."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.checks import Element
from ..builder.compiled import CompiledModel
from ..builder.joints import coordinate_of, joint_record, motions, scalars
from ..builder.measures import Along, Coordinate, Cosine, Distance, measure
from ..builder.records import Joint
from ..builder.sensors import Reading, Sensor, known_expression
from ..errors import ArgumentError
from ..events import RATES, Event, Formula, Function, Lock, Observed, Release, SetRates, Stop, called, listed
from ..events import observed as written
from ..naming import index_of
from ..numeric import is_list, real, shown
from ..results.sensor import LiveSensors
from ..results.source import ModelSource
from ..sensing import Reader, SensorRecord, StateSignals, at_once, plain
from ..state import Layout, StateView
from .models import Modelled

Array = NDArray[np.float64]


class ObservedState(StateView):
    """A state as passed to the function of an event: as to force laws, and with all sensors."""

    __slots__ = ("_sensors",)

    def __init__(self, t: float, q: Array, v: Array, layout: Layout, sensors: Sensors) -> None:
        super().__init__(t, q, v, layout)
        self._sensors = sensors

    def sensor(self, name: Any) -> Any:
        """The value of a sensor: a float or an array, see `Mechanism.add_sensor`."""
        return self._sensors.read(name, self.t, self.q, self.v)


class Sensors:
    """Sensors of a model at any state."""

    def __init__(self, model: CompiledModel) -> None:
        self._model = model

    def read(self, name: Any, t: float, q: Array, v: Array) -> Any:
        """The value of one; those that need accelerations or forces cost an evaluation with multipliers."""
        model, sensors = self._model, self._model.sensors
        name = list(sensors)[index_of(str(name), list(sensors), "sensor")]
        if at_once(sensors[name], sensors):
            return plain(Reader(sensors, StateSignals(model.core, t, q, v, model.summary)).read(name))
        at = model.at(q, v, t)
        motion = model.core.motion(np.array([t]), q[None], v[None], at.vdot[None], at.multipliers[None])
        return plain(LiveSensors(sensors, ModelSource(model.core, motion, model.summary), []).read(name)[0])


def observed(
    mechanism: Modelled,
    model: CompiledModel,
    layout: Layout,
    events: Iterable[Any] | None,
    locked: Iterable[Any] = (),
) -> tuple[Observed | None, CompiledModel]:
    """Events as given by the user, for this model; None where there are none. Also the model with the drives by which
    they act, and those of the joints that are `locked` at the start."""
    found = listed(events)
    acting = _Actions(mechanism)
    at_start = [name for joint in _joints(locked) for name in acting.locked("locked", joint, None)]
    if not found and not at_start:
        return None, model
    maker = _Maker(mechanism, model, layout)
    watched = written(found, maker.formula, maker.functions)
    actions = [acting.actions(event, maker) for event in found]
    if not acting.drives:
        return watched, model
    if watched is None:
        watched = Observed((), None, "[]", [])
    acts = {"switched": list(acting.drives), "locked": at_start, "actions": actions}
    watched = replace(watched, acts=json.dumps(acts))
    return watched, model._with_more_drives(list(acting.drives.values()))


def _joints(locked: Any) -> list[Any]:
    if isinstance(locked, str | Joint):
        return [locked]
    if not is_list(locked):
        raise ArgumentError(f"locked must be a list of joints, not {shown(locked)}", argument="locked")
    return list(locked)


class _Actions:
    """Drives by which events act: what they hold."""

    def __init__(self, mechanism: Modelled) -> None:
        self._mechanism = mechanism
        self.drives: dict[str, dict[str, Any]] = {}

    def actions(self, event: Event, maker: _Maker) -> list[dict[str, Any]]:
        """What an event does, as plain data."""
        found: list[dict[str, Any]] = []
        for action in event.then:
            if isinstance(action, Lock):
                found += [{"lock": name} for name in self.locked(event.name, action.joint, action.coordinate)]
            elif isinstance(action, Release):
                found += [{"release": name} for name in self.locked(event.name, action.joint, None)]
            elif isinstance(action, SetRates):
                found.append({"rates": [self._rate(event, joint, x) for joint, x in action.rates.items()]})
            else:
                found.append({"stop": self._stop(event, action, maker)})
        return found

    def locked(self, asker: str, joint: Any, coordinate: int | None) -> list[str]:
        """The names of the drives that hold a joint, or one of its coordinates."""
        element = Element("event", asker)
        record = joint_record(self._mechanism, element, joint)
        moving = motions(record)
        chosen = range(len(moving)) if coordinate is None else [coordinate_of(element, record, coordinate, len(moving))]
        if not moving:
            element.fail(f'the joint "{record.name}" has no motion that could be held')
        names = []
        for i in chosen:
            name = f"lock of {record.name}" + (f".{i}" if len(moving) > 1 else "")
            names.append(self._drive(name, {"of": "joint", "joint": record.name, "coordinate": i}, "velocity", 0.0))
        return names

    def _rate(self, event: Event, joint: Any, rate: float) -> list[Any]:
        measured = measure(self._mechanism, Element("event", event.name), joint)
        of_joint = measured["of"] == "joint"
        name = f"rate of {measured['joint']}.{measured['coordinate']}" if of_joint else f"rate of {measured['of']}"
        while name in self.drives and self.drives[name]["measure"] != measured:
            name += "'"
        return [self._drive(name, measured, "velocity", 0.0), real(rate)]

    def _stop(self, event: Event, action: Stop, maker: _Maker) -> dict[str, Any]:
        followed = maker.formula(event).get("position")
        if followed is None:
            Element("event", event.name).fail(
                "a stop bounds a joint, pt.Distance, pt.Along or pt.Cosine, or a sensor of the position of one; "
                "not a rate, an expression or a function"
            )
        name = self._drive(f"stop {event.name}", followed, "position", float(event.value))
        return {"drive": name, "sign": -float(event.direction), "restitution": real(action.restitution)}

    def _drive(self, name: str, measured: Mapping[str, Any], level: str, value: float) -> str:
        taken = self._mechanism._description.drives
        while name in taken:
            name += "'"
        self.drives[name] = {"name": name, "measure": dict(measured), "motion": {"constant": value}, "level": level}
        return name


class _Maker:
    """Turns what events follow into formulas of the core."""

    def __init__(self, mechanism: Modelled, model: CompiledModel, layout: Layout) -> None:
        self._mechanism, self._sensors = mechanism, model.sensors
        self._layout, self._all = layout.reading(model.core, model.summary), Sensors(model)
        self.functions: list[Function] = []

    def formula(self, event: Event) -> Formula:
        """What an event follows."""
        of, element = event.of, Element("event", event.name)
        if isinstance(of, str) and of in self._sensors and of not in self._mechanism._description.joints:
            of = Sensor(of, self._mechanism)
        if isinstance(of, Reading):
            if event.reads != RATES[0]:
                element.fail("a sensor reads what it reads; give reads for joints and measures")
            tree = known_expression(self._mechanism, element, of)
            return self._expression(tree) or self._call(event.name, lambda state: self._value(tree, state))
        if isinstance(of, str | Joint | Coordinate | Distance | Along | Cosine):
            return {event.reads: measure(self._mechanism, element, of)}
        if not callable(of):
            element.fail(
                f"it cannot follow {shown(of)}; give a joint, a measure such as pt.Distance, a sensor, an expression "
                "of sensors, or a function f(t, state)"
            )
        return self._call(event.name, lambda state: of(state.t, state))

    def _call(self, name: str, function: Callable[[ObservedState], Any]) -> Formula:
        layout, sensors = self._layout, self._all
        self.functions.append(called(name, lambda t, q, v: function(ObservedState(t, q, v, layout, sensors))))
        return {"call": len(self.functions) - 1}

    def _value(self, tree: Any, state: ObservedState) -> Any:
        """An expression of sensors at a state."""
        if isinstance(tree, str):
            return state.sensor(tree)
        if not isinstance(tree, list):
            return tree
        word, *parts = tree
        if word == "component":
            return self._value(parts[0], state)[parts[1]]
        values = [np.asarray(self._value(part, state)) for part in parts]
        if word == "norm":
            return np.linalg.norm(values[0])
        if word == "dot":
            return np.dot(values[0], values[1])
        total = values[0]
        for part in values[1:]:
            total = total + part if word == "sum" else total * part if word == "product" else total / part
        return total

    def _expression(self, tree: Any) -> Formula | None:
        """An expression of sensors as a formula of the core; None where one of them is none."""
        if isinstance(tree, str):
            return self._sensor(self._sensors[tree])
        if not isinstance(tree, list):
            return {"number": float(tree)}
        word, *parts = tree
        if word not in ("sum", "product", "quotient", "norm"):
            return None
        found = [self._expression(part) for part in parts]
        if None in found:
            return None
        return {word: found[0] if word == "norm" else found}

    def _sensor(self, record: SensorRecord) -> Formula | None:
        data: Mapping[str, Any] = record.data
        if data["of"] == "expression":
            return self._expression(data["expression"])
        if data.get("reads") not in RATES:
            return None
        if data["of"] == "measure":
            return {data["reads"]: dict(data["measure"])}
        if data["of"] != "joint" or not self._is_number(data):
            return None
        coordinate = data.get("coordinate") or 0
        return {data["reads"]: {"of": "joint", "joint": data["joint"], "coordinate": coordinate}}

    def _is_number(self, data: Mapping[str, Any]) -> bool:
        """Whether a sensor of a joint reads one slide or one angle."""
        joint = self._mechanism._description.joints[data["joint"]]
        count = scalars(joint)
        return count == 1 or (count > 1 and data.get("coordinate") is not None)
