"""What the events of a mechanism follow: measures, sensors and functions of the state."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.checks import Element, number
from ..builder.compiled import CompiledModel
from ..builder.joints import coordinate_of, joint_record, motions, scalars
from ..builder.measures import Along, Coordinate, Cosine, Distance, measure
from ..builder.records import Force, Joint
from ..builder.sensors import Reading, Sensor, known_expression
from ..events import (
    RATES,
    Action,
    Event,
    Formula,
    Function,
    Lock,
    Observed,
    Release,
    SetInput,
    SetRates,
    Stop,
    called,
    listed,
)
from ..events import observed as written
from ..limits import limit
from ..naming import index_of
from ..numeric import real, shown
from ..results.sensor import LiveSensors
from ..results.source import ModelSource
from ..sensing import Reader, SensorRecord, StateSignals, at_once, plain
from ..state import Layout, StateView
from .inputs import drawn_values, settable
from .models import Modelled
from .parting import is_measure, joints_of, lock_of, named_joint, parted_at_start, parting
from .set_valued import latch_of, of_elements

Array = NDArray[np.float64]
Decision = Callable[[float, Array, Array], str]
"""Of t, q, v: actions as JSON."""


DEEPEST = 50
"""Formulas nested deeper than this are evaluated in Python. Unit: levels. Reason: the core reads 128 levels of
brackets, and a formula has two of them for each of its own."""


def _depth(formula: Formula) -> int:
    """How deep a formula is nested."""
    deepest, level = 0, [formula]
    while level:
        deepest += 1
        parts = [part for one in level for part in one.values()]
        inside = [item for part in parts for item in (part if isinstance(part, list) else [part])]
        level = [item for item in inside if isinstance(item, dict) and "of" not in item]
    return deepest


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
    parted: Iterable[Any] = (),
    *,
    inputs: Iterable[str] = (),
) -> tuple[Observed | None, CompiledModel]:
    """Events as given by the user, for this model; None where there are none. Also the model with the drives by which
    they act, and those of the joints that are `locked` at the start. `inputs`: what a stepper sets at each step."""
    found = listed(events)
    apart = parted_at_start(mechanism, parted)
    acting = _Actions(mechanism, parting(mechanism, found, locked, parted), inputs)
    at_start = [name for given in joints_of("locked", locked) for name in acting.locked("locked", lock_of(given))]
    acting.name_locks(found)
    own = list(of_elements(mechanism._description, model, acting.hold, acting.hold_locked))
    if not found and not at_start and not apart and not own:
        return None, model
    for event in found:
        if any(event.name == one.element for one in own):
            Element("event", event.name).fail("an element of the mechanism has this name, and records under it")
    maker = _Maker(mechanism, model, layout, bool(acting.parting))
    watched = written([*found, *(one.event for one in own)], maker.formula, maker.functions)
    actions = [*(acting.actions(event, maker) for event in found), *([one.does] for one in own)]
    if not acting.drives and not acting.parting and not acting.inputs:
        return watched, model
    if watched is None:
        watched = Observed((), None, "[]", [])
    acts = {
        "switched": list(acting.drives), "locked": at_start, "parted": apart, "actions": actions,
        "inputs": drawn_values(mechanism._description, model, acting.inputs),
    }  # fmt: skip
    drives = list(acting.drives.values())
    watched = replace(watched, acts=json.dumps(acts), decisions=acting.decisions, drives=json.dumps(drives))
    holding: dict[str, list[str]] = {}
    for one in own:
        holding.setdefault(one.element, []).append(one.drive)
    return watched, model._with_more_drives(drives, holding) if drives else model


def _input_name(action: SetInput) -> str:
    return action.name.name if isinstance(action.name, Force) else str(action.name)


def set_by(events: Iterable[Event]) -> set[str]:
    """Names of the inputs that these events set."""
    return {_input_name(action) for event in events for action in event.then if isinstance(action, SetInput)}


@dataclass(frozen=True)
class Followed:
    """Events and elements that hold at times as plain data, for what runs without Python."""

    resource: dict[str, Any]
    names: dict[str, tuple[list[int], list[str]]]
    """Numbers of the events of each name, and the drives by which it holds."""
    fixed: set[str]
    """Elements whose places are part of the data."""


def followed(
    mechanism: Modelled,
    model: CompiledModel,
    layout: Layout,
    events: Iterable[Any] | None,
    locked: Iterable[Any],
    inputs: Iterable[str],
) -> Followed | None:
    """Events and what holds at times, without functions of Python; None where there is nothing.

    Raises a `DescriptionError` that names the event that is terminal, calls a function, or parts a joint.
    """
    found = listed(events)
    watched, acting = observed(mechanism, model, layout, found, locked, inputs=inputs)
    if watched is None:
        return None
    for event in found:
        element = Element("event", event.name)
        if event.last is not None:
            element.fail("it is terminal, but the environment of an FMU decides how long it runs")
        if any(not isinstance(action, Action) for action in event.then):
            element.fail("a function of Python decides what it does, which an FMU cannot call; give the actions")
    if watched.functions:
        called_by = next(event for event in found if _calls(mechanism, model, layout, event))
        Element("event", called_by.name).fail(
            "it follows a function of Python, or a sensor of accelerations or forces, which an FMU cannot evaluate; "
            "follow a measure or a sensor of positions and rates"
        )
    plan: dict[str, Any] = {
        "switched": [],
        "locked": [],
        "parted": [],
        "actions": [[] for _ in watched.names],
        "inputs": [],
    }
    if watched.acts is not None:
        plan = json.loads(watched.acts)
    for name, actions in zip(watched.names, plan["actions"], strict=True):
        if any("part" in action for action in actions):
            Element("event", name).fail("it parts a joint, which an FMU cannot follow; lock the joint and release it")
    holding = acting.summary.get("holding", {})
    names: dict[str, tuple[list[int], list[str]]] = {}
    for i, name in enumerate(watched.names):
        names.setdefault(name, ([], list(holding.get(name, ()))))[0].append(i)
    resource = {
        "events": json.loads(watched.text),
        "drives": json.loads(watched.drives),
        "plan": plan,
        "most": limit("events"),
    }
    forces = mechanism._description.forces
    fixed = {name for name in holding if getattr(forces.get(name), "kind", None) != "friction"}
    return Followed(resource, names, fixed)


def _calls(mechanism: Modelled, model: CompiledModel, layout: Layout, event: Event) -> bool:
    """Whether an event is evaluated in Python."""
    maker = _Maker(mechanism, model, layout, False)
    maker.formula(event)
    return bool(maker.functions)


class _Actions:
    """Drives by which events act: what they hold."""

    def __init__(self, mechanism: Modelled, parting: Mapping[str, str], taken: Iterable[str]) -> None:
        self._mechanism = mechanism
        self.drives: dict[str, dict[str, Any]] = {}
        self.decisions: list[tuple[str, Decision]] = []
        self.inputs: list[str] = []
        """Names of those that may be set."""
        self.parting, self._taken = parting, set(taken)
        self._measures: dict[str, dict[str, Any]] = {}
        """Measures that are locked, by the names of their drives."""

    def actions(self, event: Event, maker: _Maker) -> list[dict[str, Any]]:
        """What an event does, as plain data."""
        found: list[dict[str, Any]] = []
        for action in event.then:
            if callable(action):
                found.append({"decide": self._decision(event, action, maker)})
            else:
                found += self._action(event, action, maker)
        return found

    def _decision(self, event: Event, function: Callable[[float, Any], Any], maker: _Maker) -> int:
        """The number of what a function decides; all that it may hold is added."""
        for record in self._mechanism._description.joints.values():
            for i in range(len(motions(record))):
                measured = {"of": "joint", "joint": record.name, "coordinate": i}
                self.hold_locked("", measured, "velocity", 0.0)
                self._held_rate(measured)
        for name in settable(self._mechanism._description):
            if name not in self._taken:
                self._settable(name)

        def decided(t: float, q: Array, v: Array) -> str:
            found: list[dict[str, Any]] = []
            for action in event.decided(function(t, maker.state(t, q, v))):
                drives = dict(self.drives)
                found += self._action(event, action, maker)
                if self.drives != drives:
                    Element("event", event.name).fail(
                        f"its function decides on {action}; it may set rates of joints alone: give then= this action "
                        "itself"
                    )
            return json.dumps(found)

        self.decisions.append((event.name, decided))
        return len(self.decisions) - 1

    def _action(self, event: Event, action: Any, maker: _Maker) -> list[dict[str, Any]]:
        """One action, as plain data."""
        found: list[dict[str, Any]] = []
        if isinstance(action, Lock):
            found += [{"lock": name} for name in self.locked(event.name, action)]
        elif isinstance(action, Release):
            of_measure = self._lock_of_measure(event.name, action.joint) is not None
            if not of_measure and latch_of(self._mechanism, action.joint) is None:
                name = named_joint(self._mechanism, event.name, action.joint).name
                if name in self.parting:
                    return [{"part": name}]
            found += [{"release": name} for name in self._released(event, action)]
        elif isinstance(action, SetInput):
            found.append({"inputs": [self._input(event, action)]})
        elif isinstance(action, SetRates):
            found.append({"rates": [self._rate(event, joint, x) for joint, x in action.rates.items()]})
        else:
            found.append({"stop": self._stop(event, action, maker)})
        return found

    def name_locks(self, found: Iterable[Event]) -> None:
        """Add the drives by which events lock measures, so that others can release them by name."""
        for event in found:
            for action in event.then:
                if isinstance(action, Lock) and is_measure(action.joint):
                    self.locked(event.name, action)

    def locked(self, asker: str, lock: Lock) -> list[str]:
        """The names of the drives that hold a joint, one of its coordinates, or a measure."""
        element, lock = Element("event", asker), lock_of(lock)
        if is_measure(lock.joint):
            return [self._locked_measure(element, lock)]
        record = joint_record(self._mechanism, element, lock.joint)
        moving, coordinate = motions(record), lock.coordinate
        chosen = range(len(moving)) if coordinate is None else [coordinate_of(element, record, coordinate, len(moving))]
        if not moving:
            element.fail(f'the joint "{record.name}" has no motion that could be held')
        if lock.name is not None:
            element.fail(f'it locks the joint "{record.name}" under a name of its own; only a measure has one')
        names = []
        for i in chosen:
            measured = {"of": "joint", "joint": record.name, "coordinate": i}
            names.append(self.hold_locked("", measured, "velocity", 0.0))
        return names

    def _locked_measure(self, element: Element, lock: Lock) -> str:
        """The name of the drive that holds a measure."""
        if lock.coordinate is not None:
            element.fail(f"it locks coordinate {lock.coordinate} of a measure, which has none; leave it out")
        measured = measure(self._mechanism, element, lock.joint)
        known = next((name for name, x in self._measures.items() if x == measured), None)
        if known is not None and lock.name in (None, known):
            return known
        if known is not None:
            element.fail(f'it locks as "{lock.name}" what is locked as "{known}"; give one name')
        name = lock.name or f"lock of {measured['of']}"
        taken = [*self._mechanism._description.drives, *self._mechanism._description.forces, *self.drives]
        if lock.name is not None and name in taken:
            element.fail(f'it locks under the name "{name}", which something else has; give another one')
        while name in taken:
            name += "'"
        self._measures[name] = measured
        return self.hold(name, measured, "velocity", 0.0)

    def _lock_of_measure(self, asker: str, given: Any) -> str | None:
        """The drive that locks a measure, given by its name or as the measure; None for anything else."""
        if not is_measure(given):
            return given if isinstance(given, str) and given in self._measures else None
        element = Element("event", asker)
        measured = measure(self._mechanism, element, given)
        known = next((name for name, x in self._measures.items() if x == measured), None)
        return known or element.fail("it releases a measure that nothing locks; give the one of a pt.Lock")

    def _released(self, event: Event, action: Release) -> list[str]:
        """The drives that a release lets go: those of a joint, or the one of a measure or a latch."""
        if (name := self._lock_of_measure(event.name, action.joint)) is not None:
            return [name]
        latch = latch_of(self._mechanism, action.joint)
        if latch is not None:
            return self.locked(event.name, Lock(latch["joint"], latch["coordinate"]))
        return self.locked(event.name, Lock(action.joint))

    def _input(self, event: Event, action: SetInput) -> list[Any]:
        """The number of an input and its value."""
        element, known = Element("event", event.name), settable(self._mechanism._description)
        name = list(known)[index_of(_input_name(action), list(known), "input")]
        if name in self._taken:
            element.fail(f'it sets "{name}", an input that is given at each step; leave it out of inputs=')
        one = known[name]
        value = number(element, f"the value of {name}", action.value, one.unit, least=one.least)
        return [self._settable(name), value]

    def _settable(self, name: str) -> int:
        if name not in self.inputs:
            self.inputs.append(name)
        return self.inputs.index(name)

    def _rate(self, event: Event, joint: Any, rate: float) -> list[Any]:
        measured = measure(self._mechanism, Element("event", event.name), joint)
        self._refuse_parted("sets a rate of", event, measured)
        return [self._held_rate(measured), real(rate)]

    def _held_rate(self, measured: Mapping[str, Any]) -> str:
        """The name of the drive that sets a rate."""
        of_joint = measured["of"] == "joint"
        name = f"rate of {measured['joint']}.{measured['coordinate']}" if of_joint else f"rate of {measured['of']}"
        while name in self.drives and self.drives[name]["measure"] != measured:
            name += "'"
        return self.hold(name, measured, "velocity", 0.0)

    def _stop(self, event: Event, action: Stop, maker: _Maker) -> dict[str, Any]:
        followed = maker.formula(event).get("position")
        if followed is None:
            Element("event", event.name).fail(
                "a stop bounds a joint, pt.Distance, pt.Along or pt.Cosine, or a sensor of the position of one; "
                "not a rate, an expression or a function"
            )
        self._refuse_parted("stops", event, followed)
        name = self.hold(f"stop {event.name}", followed, "position", float(event.value))
        return {"drive": name, "sign": -float(event.direction), "restitution": real(action.restitution)}

    def _refuse_parted(self, does: str, event: Event, measured: Mapping[str, Any]) -> None:
        """Refuse to act along a joint that is parted in this run."""
        joint = str(measured.get("joint"))
        if joint in self.parting:
            Element("event", event.name).fail(
                f'it {does} the joint "{joint}", which {self.parting[joint]} parts; use pt.Distance or pt.Along '
                "between points of the bodies instead"
            )

    def hold_locked(self, name: str, measured: Mapping[str, Any], level: str, value: float) -> str:
        """Add the drive that holds a coordinate of a joint for all that lock it."""
        count = len(motions(self._mechanism._description.joints[measured["joint"]]))
        name = f"lock of {measured['joint']}" + (f".{measured['coordinate']}" if count > 1 else "")
        return self.hold(name, measured, level, value)

    def hold(self, name: str, measured: Mapping[str, Any], level: str, value: float) -> str:
        """Add a drive that holds at times; the name that it got."""
        taken = self._mechanism._description.drives
        while name in taken:
            name += "'"
        self.drives[name] = {"name": name, "measure": dict(measured), "motion": {"constant": value}, "level": level}
        return name


class _Maker:
    """Turns what events follow into formulas of the core."""

    def __init__(self, mechanism: Modelled, model: CompiledModel, layout: Layout, parts: bool) -> None:
        self._mechanism, self._sensors, self._parts = mechanism, model.sensors, parts
        self._layout, self._all = layout.reading(model.core, model.summary), Sensors(model)
        self.functions: list[Function] = []

    def state(self, t: float, q: Array, v: Array) -> ObservedState:
        """A state as functions of the user read it."""
        return ObservedState(t, q, v, self._layout, self._all)

    def formula(self, event: Event) -> Formula:
        """What an event follows."""
        of, element = event.of, Element("event", event.name)
        if isinstance(of, str) and of in self._sensors and of not in self._mechanism._description.joints:
            of = Sensor(of, self._mechanism)
        if isinstance(of, Reading):
            if event.reads != RATES[0]:
                element.fail("a sensor reads what it reads; give reads for joints and measures")
            tree = known_expression(self._mechanism, element, of)
            if self._parts and not all(at_once(self._sensors[name], self._sensors) for name in _sensors_in(tree)):
                element.fail(
                    "it follows a sensor of accelerations or forces in a run that parts a joint; these cannot be known "
                    "while the run computes: follow positions or velocities"
                )
            in_core = self._expression(tree)
            if in_core is not None and _depth(in_core) <= DEEPEST:
                return in_core
            return self._call(event.name, lambda state: self._value(tree, state))
        if isinstance(of, str | Joint | Coordinate | Distance | Along | Cosine):
            return {event.reads: measure(self._mechanism, element, of)}
        if not callable(of):
            element.fail(
                f"it cannot follow {shown(of)}; give a joint, a measure such as pt.Distance, a sensor, an expression "
                "of sensors, or a function f(t, state)"
            )
        return self._call(event.name, lambda state: of(state.t, state))

    def _call(self, name: str, function: Callable[[ObservedState], Any]) -> Formula:
        self.functions.append(called(name, lambda t, q, v: function(self.state(t, q, v))))
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


def _sensors_in(tree: Any) -> list[str]:
    """Names of the sensors in an expression."""
    if isinstance(tree, str):
        return [tree]
    return [name for part in tree[1:] for name in _sensors_in(part)] if isinstance(tree, list) else []
