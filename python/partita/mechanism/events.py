"""Events of a run: zeros of measures, of sensors or of functions of the state, found while it runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.checks import Element
from ..builder.compiled import CompiledModel
from ..builder.joints import scalars
from ..builder.measures import Along, Coordinate, Cosine, Distance, measure
from ..builder.records import Joint
from ..builder.sensors import Reading, Sensor, known_expression
from ..errors import ArgumentError, EvaluationError
from ..limits import limit
from ..naming import index_of
from ..numeric import floats, is_list, real, shown
from ..options import count, one_of, yes_or_no
from ..results.sensor import LiveSensors
from ..results.source import ModelSource
from ..sensing import Reader, SensorRecord, StateSignals, at_once, plain
from ..state import Layout, StateView
from .models import Modelled

Array = NDArray[np.float64]
Formula = dict[str, Any]
RATES = ("position", "velocity")
DIRECTIONS = (0, 1, -1)


@dataclass(frozen=True, eq=False)
class Event:
    """An event of `simulate(events=...)` or `stepper(events=...)`: something passes a value.

    It is found wherever in a step it lies, also where it happens twice within one step, and located to rounding: the
    state there is closed like an output. A run is the same to the bit whether it is observed or not; one that ends with
    an event has its last step end there. Where a run starts exactly on the value there is no event, at its end there
    is. Events at one instant come in the order in which they were given.

    Measures (a joint, `pt.Coordinate`, `pt.Distance`, `pt.Along`, `pt.Cosine`), sensors of them, and sums, products and
    quotients of these are followed in the core, with their rates, at hardly any cost. Other sensors and functions are
    evaluated in Python, twice at every step; a function that is not smooth is found to have a zero where it has
    different signs at both ends of a step.

    Args:
        name: of its records in `run.events`.
        of: what is followed: a joint or its name (its first coordinate), another measure, a sensor or its name, an
            expression of sensors, or a function f(t, state) of the time and a state, which reads
            `state.position(joint)`, `state.velocity(joint)`, `state.sensor(name)`.
        value: the event is where it passes this value [the unit of what is followed].
        reads: "position" or "velocity" of a joint or a measure.
        direction: 1: only where it rises through the value, -1: only where it falls, 0: both.
        terminal: True: the run ends there; a number n: at the n-th time. Such a run is a success with the status
            "event", and the event is its last output.
        once: only the first time is reported.

    Raises:
        ArgumentError: an argument is not as said.

    >>> import math
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> upright = pt.Event("upright", "A", value=math.pi / 2, direction=1)
    >>> run = m.simulate(2.0, events=[upright, pt.Event("turns back", "C", reads="velocity")])
    >>> [(record.name, round(record.t, 6)) for record in run.events][:2]      # doctest: +SKIP
    """

    name: str
    of: Any
    value: float = 0.0
    reads: str = "position"
    direction: int = 0
    terminal: bool | int = False
    once: bool = False

    def __post_init__(self) -> None:
        name = self.name
        if not isinstance(name, str) or not name.strip() or name != name.strip() or not name.isprintable():
            raise ArgumentError(f"the name of an event is printable text, not {shown(name)}", argument="name")
        try:
            number = real(self.value)
        except TypeError as error:
            self._refuse("value", f"is {shown(self.value)}; it must be a number", error)
        if not np.isfinite(number):
            self._refuse("value", f"is {number}; it must be finite")
        one_of("reads", self.reads, RATES)
        if isinstance(self.direction, bool) or self.direction not in DIRECTIONS:
            self._refuse("direction", f"is {shown(self.direction)}; give 1 (rising), -1 (falling) or 0 (both)")
        if not isinstance(self.terminal, bool | np.bool_):
            count(self.terminal, f'event "{name}": terminal')
        yes_or_no(f'event "{name}": once', self.once)

    def _refuse(self, argument: str, sentence: str, cause: Exception | None = None) -> None:
        raise ArgumentError(f'event "{self.name}": {argument} {sentence}', argument=argument) from cause

    @property
    def last(self) -> int | None:
        """Which of its occurrences ends a run, counted from 1."""
        return int(self.terminal) or None


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


@dataclass(frozen=True)
class Observed:
    """The events of a run, checked: as the core takes them."""

    names: tuple[str, ...]
    text: str
    functions: list[Callable[[float, Array, Array], float]]

    @property
    def core(self) -> tuple[str, list[Callable[[float, Array, Array], float]], int]:
        """Events as text, the functions that they call, and how often they may occur."""
        return self.text, self.functions, limit("events")


def observed(
    mechanism: Modelled, model: CompiledModel, layout: Layout, events: Iterable[Any] | None
) -> Observed | None:
    """Events as given by the user, for this model; None where there are none."""
    if events is None:
        return None
    if isinstance(events, Event) or callable(events) or not is_list(events):
        raise ArgumentError(f"events must be a list of pt.Event, not {shown(events)}", argument="events")
    found = [_event(event, i) for i, event in enumerate(events)]
    names = [event.name for event in found]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ArgumentError(f'events: two events are called "{name}"', argument="events")
    if not found:
        return None
    maker = _Maker(mechanism, model, layout)
    written = [
        {
            "name": event.name,
            "formula": maker.formula(event),
            "direction": int(event.direction),
            "last": event.last,
            "most": 1 if event.once else None,
        }
        for event in found
    ]
    return Observed(tuple(names), json.dumps(written), maker.functions)


def _event(given: Any, i: int) -> Event:
    if isinstance(given, Event):
        return given
    if callable(given) and not isinstance(given, type):
        # as SciPy has them
        name = str(getattr(given, "__name__", f"event {i}"))
        direction = getattr(given, "direction", 0)
        sign = int(np.sign(direction)) if isinstance(direction, int | float) else direction
        return Event(name, given, direction=sign, terminal=getattr(given, "terminal", False))
    raise ArgumentError(f"events must be made of pt.Event or functions f(t, state), not {shown(given)}", argument="events")


class _Maker:
    """Turns what events follow into formulas of the core."""

    def __init__(self, mechanism: Modelled, model: CompiledModel, layout: Layout) -> None:
        self._mechanism, self._sensors = mechanism, model.sensors
        self._layout, self._all = layout.reading(model.core, model.summary), Sensors(model)
        self.functions: list[Callable[[float, Array, Array], float]] = []

    def formula(self, event: Event) -> Formula:
        """What is zero at the event."""
        found = self._followed(event, Element("event", event.name))
        return found if event.value == 0.0 else {"sum": [found, {"number": -float(event.value)}]}

    def _followed(self, event: Event, element: Element) -> Formula:
        of = event.of
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

        def value(t: float, q: Array, v: Array) -> float:
            given = function(ObservedState(t, q, v, layout, sensors))
            try:
                found = floats(given)
            except TypeError:
                found = np.empty(0)
            if found.size != 1:
                raise EvaluationError(
                    f'event "{name}" at t = {t:g} s: its function must return a number, not {shown(given)}',
                    t=t,
                    where=name,
                )
            return float(found.reshape(()))

        self.functions.append(value)
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
