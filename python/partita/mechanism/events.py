"""What the events of a mechanism follow: measures, sensors and functions of the state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.checks import Element
from ..builder.compiled import CompiledModel
from ..builder.joints import scalars
from ..builder.measures import Along, Coordinate, Cosine, Distance, measure
from ..builder.records import Joint
from ..builder.sensors import Reading, Sensor, known_expression
from ..events import RATES, Event, Formula, Function, Observed, called, listed
from ..events import observed as written
from ..naming import index_of
from ..numeric import shown
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
    mechanism: Modelled, model: CompiledModel, layout: Layout, events: Iterable[Any] | None
) -> Observed | None:
    """Events as given by the user, for this model; None where there are none."""
    found = listed(events)
    if not found:
        return None
    maker = _Maker(mechanism, model, layout)
    return written(found, maker.formula, maker.functions)


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
