"""Events of a run: zeros of what is followed, found while it runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .errors import ArgumentError, EvaluationError
from .limits import limit
from .numeric import floats, is_list, real, shown
from .options import count, one_of, yes_or_no
from .state import Layout, StateView

Array = NDArray[np.float64]
Formula = dict[str, Any]
Function = Callable[[float, Array, Array], float]
"""Of t, q, v."""
RATES = ("position", "velocity")
DIRECTIONS = (0, 1, -1)


@dataclass(frozen=True)
class Lock:
    """An action of an event: a joint is held from there on, all its coordinates or one; plastic, without rebound.

    What the lock carries is part of the reaction of the joint; the impulse stands in the record of the event. A measure
    (`pt.Along`, `pt.Distance`, `pt.Cosine`) is held at the value that it has there: so bodies are joined where they
    meet, as a pin that enters its slot. What such a lock carries stands under its `name`, which releases it, too.

    >>> import partita as pt
    >>> pt.Lock("A")
    Lock(joint='A', coordinate=None, name=None)
    >>> slot = pt.Along("wheel", (0, 0, 0), (0, 1, 0), "crank", (0.1, 0, 0))
    >>> pt.Lock(slot, name="slot").name
    'slot'
    """

    joint: Any
    coordinate: int | None = None
    name: str | None = None


@dataclass(frozen=True)
class Release:
    """An action of an event: a joint that is locked is free again, or a joint is parted.

    If anything in the run locks the joint (a `Lock` of any event, or `locked=`), the lock ends; so does that of a
    measure, given by its name or as the measure. Otherwise the joint itself ends: all of its constraints act no longer,
    and its bodies go on with their velocities. What is parted stays parted.

    >>> import partita as pt
    >>> pt.Release("A")
    Release(joint='A')
    """

    joint: Any


@dataclass(frozen=True)
class SetRates:
    """An action of an event: joints get these rates at once, by the impulses along them that this takes.

    Everything else follows with the least change in the mass metric: as if hit along those coordinates alone. What is
    set into a closed stop that alone can stop it bounces off it at once.

    >>> import partita as pt
    >>> pt.SetRates({"A": 2.0})
    SetRates(rates={'A': 2.0})
    """

    rates: Mapping[Any, float]


@dataclass(frozen=True)
class SetInput:
    """An action of an event: an effort has this value from there on: a torque that is a number, a component of a force
    (`"push.x"`), the torque of a brake or of friction that sticks. In a run whose events may set it, it counts as work.

    >>> import partita as pt
    >>> pt.SetInput("motor", 2.5)
    SetInput(name='motor', value=2.5)
    """

    name: Any
    value: Any


@dataclass(frozen=True)
class Stop:
    """An action of an event with a direction: what is followed never passes the value: a rigid stop.

    Where it is hit, its rate is reversed and multiplied by the coefficient of `restitution` (Newton's law); at most
    a bounce that lifts it by less than 1e-12 of its size is followed by rest. It stays closed as long as it presses.
    Several stops that close at once are one problem of least change (Moreau), whose velocities are unique; the energy
    never grows.

    >>> import partita as pt
    >>> pt.Event("floor", "z", value=0.0, direction=-1, then=pt.Stop(0.5)).then
    (Stop(restitution=0.5),)
    """

    restitution: float = 0.0


Action = Lock | Release | SetRates | SetInput | Stop


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
        once: only the first time is reported, and acts.
        then: what is done there: `pt.Lock`, `pt.Release`, `pt.SetRates`, `pt.SetInput`, `pt.Stop`, or a list of these;
            or a function f(t, state) of the state before, which returns one of the first four, a list, or None.

    Raises:
        ArgumentError: an argument is not as said.

    >>> import math
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> half = pt.Event("half a turn", "A", value=-math.pi, direction=-1)
    >>> run = m.simulate(1.0, events=[half, pt.Event("turns back", "D", reads="velocity")])
    >>> [(record.name, round(record.t, 4)) for record in run.events]
    [('turns back', 0.2254), ('half a turn', 0.5635), ('turns back', 0.5807)]
    """

    name: str
    of: Any
    value: float = 0.0
    reads: str = "position"
    direction: int = 0
    terminal: bool | int = False
    once: bool = False
    then: Any = ()

    def __post_init__(self) -> None:
        name = self.name
        if not _is_name(name):
            raise ArgumentError(f"the name of an event is printable text, not {shown(name)}", argument="name")
        number = _number(self.value)
        if number is None:
            self._refuse("value", f"is {shown(self.value)}; it must be a number")
        if not np.isfinite(number):
            self._refuse("value", f"is {number}; it must be finite")
        one_of("reads", self.reads, RATES)
        object.__setattr__(self, "value", number)
        whole = isinstance(self.direction, int | np.integer) and not isinstance(self.direction, bool)
        if not whole or self.direction not in DIRECTIONS:
            self._refuse("direction", f"is {shown(self.direction)}; give 1 (rising), -1 (falling) or 0 (both)")
        if not isinstance(self.terminal, bool | np.bool_):
            count(self.terminal, f'event "{name}": terminal')
        yes_or_no(f'event "{name}": once', self.once)
        given = (self.then,) if isinstance(self.then, Action) else self.then
        actions = tuple(given) if is_list(given) else (given,)
        for action in actions:
            if not callable(action) or isinstance(action, type):
                self._check(action)
        object.__setattr__(self, "then", actions)

    def decided(self, given: Any) -> tuple[Action, ...]:
        """What its function returned, checked: actions that can begin where an event happens."""
        actions = () if given is None else tuple(given) if is_list(given) else (given,)
        for action in actions:
            if isinstance(action, Stop):
                self._refuse("then", "decides on a stop; a stop acts from the start on: give it as then= itself")
            self._check(action, ", returned by its function")
        return actions

    def _check(self, action: Any, how: str = "") -> None:
        if not isinstance(action, Action):
            self._refuse(
                "then",
                f"is {shown(action)}{how}; give pt.Lock, pt.Release, pt.SetRates, pt.SetInput, pt.Stop, a list of "
                "these, or a function of (t, state)",
            )
        if isinstance(action, Stop):
            if self.direction == 0:
                self._refuse(
                    "direction", "is 0, but a stop has one side: 1 stops what rises to the value, -1 what falls"
                )
            if len([x for x in self.then if isinstance(x, Stop)] if is_list(self.then) else ()) > 1:
                self._refuse("then", "has two stops; give one")
            number = _number(action.restitution)
            if number is None or not 0.0 <= number <= 1.0:
                self._refuse("then", f"has a restitution of {shown(action.restitution)}; it lies between 0 and 1")
        if isinstance(action, Lock) and action.name is not None and not _is_name(action.name):
            self._refuse("then", f"locks under the name {shown(action.name)}; give printable text")
        if isinstance(action, SetRates):
            if not isinstance(action.rates, Mapping) or not action.rates:
                self._refuse("then", f"sets the rates {shown(action.rates)}; give a dict of joints and numbers")
            for joint, rate in action.rates.items():
                number = _number(rate)
                if number is None or not np.isfinite(number):
                    self._refuse("then", f"sets the rate of {joint} to {shown(rate)}; it must be a finite number")

    def _refuse(self, argument: str, sentence: str) -> NoReturn:
        raise ArgumentError(f'event "{self.name}": {argument} {sentence}', argument=argument)

    @property
    def last(self) -> int | None:
        """Which of its occurrences ends a run, counted from 1."""
        return int(self.terminal) or None


def _is_name(name: Any) -> bool:
    """Whether it is printable text without blanks around it."""
    return isinstance(name, str) and bool(name.strip()) and name == name.strip() and name.isprintable()


def _number(value: Any) -> float | None:
    """One real number, whatever library it is of; None for all else."""
    try:
        return real(value)
    except (TypeError, ValueError):
        return None


@dataclass(frozen=True)
class Observed:
    """The events of a run, checked: as the core takes them."""

    names: tuple[str, ...]
    ends: str | None
    """The first one that is terminal."""
    text: str
    functions: list[Function]
    acts: str | None = None
    """What the events do, as JSON; None where they only observe."""
    drives: str = "[]"
    """The drives by which they act, as JSON."""
    decisions: list[tuple[str, Callable[[float, Array, Array], str]]] = field(default_factory=list)
    """What functions decide: the names of their events, and of t, q, v actions as JSON."""

    @property
    def core(self) -> tuple[str, list[Function], int]:
        """Events as text, the functions that they call, and how often they may occur."""
        return self.text, self.functions, limit("events")


def listed(events: Iterable[Any] | None) -> list[Event]:
    """Events as given by the user, checked."""
    if events is None:
        return []
    if isinstance(events, Event) or callable(events) or not is_list(events):
        raise ArgumentError(f"events must be a list of pt.Event, not {shown(events)}", argument="events")
    found = [_event(event, i) for i, event in enumerate(events)]
    names = [event.name for event in found]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ArgumentError(f'events: two events are called "{name}"', argument="events")
    return found


def _event(given: Any, i: int) -> Event:
    if isinstance(given, Event):
        return given
    if callable(given) and not isinstance(given, type):
        # as SciPy has them
        name = str(getattr(given, "__name__", f"event {i}"))
        direction = getattr(given, "direction", 0)
        number = _number(direction)
        sign = direction if number is None or np.isnan(number) else int(np.sign(number))
        return Event(name, given, direction=sign, terminal=getattr(given, "terminal", False))
    raise ArgumentError(
        f"events must be made of pt.Event or functions f(t, state), not {shown(given)}", argument="events"
    )


def observed(found: list[Event], formula: Callable[[Event], Formula], functions: list[Function]) -> Observed | None:
    """Events by the formulas of what is zero at them, and the functions that these call; None where there are none."""
    if not found:
        return None
    written = [
        {
            "name": event.name,
            "formula": passing(event, formula(event)),
            "direction": int(event.direction),
            "last": event.last,
            "most": 1 if event.once else None,
        }
        for event in found
    ]
    ends = next((event.name for event in found if event.last is not None), None)
    return Observed(tuple(event.name for event in found), ends, json.dumps(written), functions)


def passing(event: Event, followed: Formula) -> Formula:
    """What is zero where what is followed passes the value of an event."""
    return followed if event.value == 0.0 else {"sum": [followed, {"number": -float(event.value)}]}


def called(name: str, function: Callable[[float, Array, Array], Any]) -> Function:
    """A function of an event whose result is checked."""

    def value(t: float, q: Array, v: Array) -> float:
        given = function(t, q, v)
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

    return value


def of_functions(events: Iterable[Any] | None, layout: Layout) -> Observed | None:
    """Events of functions f(t, state) alone, for a system that has no joints and no sensors."""
    functions: list[Function] = []

    def formula(event: Event) -> Formula:
        function = event.of
        if not callable(function):
            raise ArgumentError(
                f'event "{event.name}": a System has no joints and no sensors; give a function f(t, state), not '
                f"{shown(function)}",
                argument="events",
            )
        functions.append(called(event.name, lambda t, q, v: function(t, StateView(t, q, v, layout))))
        return {"call": len(functions) - 1}

    return observed(listed(events), formula, functions)
