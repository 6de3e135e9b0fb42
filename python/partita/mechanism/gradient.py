"""The method `gradient`: derivatives of an objective of a run."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analyses.gradient import Gradient
from ..derivatives import Objective, objective
from ..errors import ArgumentError, DescriptionError, IntegrationError
from ..limits import raised
from ..naming import index_of
from ..numeric import is_list, shown
from ..options import items, named, one_of, yes_or_no
from ..results import Result
from ..results.sensitivities import (
    Held,
    Number,
    Observable,
    Observing,
    backward,
    derivatives,
    held_of,
    largest,
    numbers_of,
    observed,
)
from ..state import State
from ..units import Quantity
from .models import Modelled
from .solve import assemble, simulate
from .through import ATOL_OF_DERIVATIVES, RTOL_OF_DERIVATIVES

Array = NDArray[np.float64]
METHODS = ("auto", "forward", "adjoint")
OPTIONS = frozenset(inspect.signature(simulate).parameters) - {
    "self", "duration", "initial", "events", "parameters", "rtol", "atol"
}  # fmt: skip
"""What `options` of a gradient may contain."""
FORWARD_STEPS = 60
"""Steps, summed over passes, up to which derivatives are carried forwards. Unit: number. Reason: measured; the
recordings of a way back take about as long as so many steps with eight derivatives each."""
TOGETHER = 8
"""Derivatives that are carried in one pass. Unit: number. Reason: the lanes of the core."""
CHECKED = 1e-4
"""Changes of numbers by which a gradient is checked. Scale: the number, or 1. Reason: extrapolated once, the error of
differences is as small as what a run at these tolerances leaves."""
INVISIBLE = 1e-8
"""Derivatives below what differences of so small values leave are not compared. Scale: value over the step of the
differences. Reason: what a run at these tolerances may be off by."""
SECOND = 1e-3
"""Changes of numbers by which gradients are differenced for second derivatives. Scale: the number, or 1. Reason: with
two extrapolations the curvature of what is differenced is as small as the noise of its last digits."""


def gradient(
    self: Modelled,
    of: Any,
    by: Any,
    *,
    duration: Quantity,
    held: Any = None,
    initial: State | None = None,
    events: Iterable[Any] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    method: str = "auto",
    second: bool = False,
    check: bool = False,
    rtol: float = RTOL_OF_DERIVATIVES,
    atol: float = ATOL_OF_DERIVATIVES,
    options: Mapping[str, Any] | None = None,
) -> Gradient:
    """Run the mechanism and compute the derivatives of an objective, through loops, exchanges, events and impacts.

    Prefer it to differences of runs, which lose half of the digits and cost a run for each number; and
    `run.sensitivities` where derivatives along the run are wanted.

    Args:
        of: a sensor, a joint or an expression of sensors (its value at the end), `pt.integral(...)`, `pt.peak(...)`,
            "t:event" (the time at which an event happens first), or sums and products of these and of numbers. Observed
            are positions and rates of joints, points and measures, forces of joints where they are determined, efforts
            of drives.
        by: numbers: parameters, lengths, `pt.start("A")`, `pt.start_rate("A")`, `pt.end_time`; see
            `Result.sensitivities`.
        duration: of the run [s].
        held: joints whose positions and rates at the start stay; see `Result.sensitivities`.
        initial, events, parameters, rtol, atol: as in `simulate`; the tolerance is tighter, as derivatives lose a
            digit or two.
        method: "forward" carries derivatives along the steps, eight numbers at a time; "adjoint" goes back through the
            steps that were taken, at a cost that hardly depends on how many numbers there are; "auto" takes the cheaper
            one, and the result says which.
        second: also second derivatives, by differences of exact gradients, extrapolated twice; for a few numbers.
        check: compare with central differences of runs.
        options: further options of `simulate`, such as {"method": "radau"}.

    Returns:
        `Gradient`, with `.value`, `.by[...]` and `.run`.

    Raises:
        ArgumentError: something has no derivative (an event that only touches zero, a function of the user, an
            undetermined reaction): the message names it.
        IntegrationError: the run stopped before its end.

    A pendulum: how the angle after one second depends on the mass, and on the start.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> g = m.gradient("A", by=["rod.mass", pt.start("A"), pt.end_time], duration=1.0, check=True)
    >>> bool(g.by[pt.end_time] == g.run.v[-1, 0]), g.agrees is not None and g.agrees < 1e-6
    (True, True)
    """
    chosen = one_of("method", method, METHODS)
    wants_second, wants_check = yes_or_no("second", second), yes_or_no("check", check)
    changed = named("parameters", parameters, '{"crank.mass": 1.0}')
    further = named("options", options, '{"method": "radau"}')
    if unknown := sorted(set(further) - OPTIONS):
        raise ArgumentError(f"options names {unknown[0]!r}; there are {', '.join(sorted(OPTIONS))}", argument="options")
    if events is not None and (isinstance(events, Mapping) or not is_list(events)):
        raise ArgumentError(f"events must be a list of pt.Event, not {shown(events)}", argument="events")
    followed = () if events is None else tuple(events)
    case = _Case(self, objective(of), duration, initial, followed, changed, rtol, atol, further)
    run = case.run({}, case.initial)
    given = items("by", by, '["crank.mass"]')
    coordinates = held_of(run, held)
    numbers = numbers_of(given, run, coordinates)
    found = case.derived(run, numbers, coordinates, chosen)
    agrees = case.checked(run, numbers, coordinates, found[1]) if wants_check else None
    hessian, error = case.second(run, numbers, coordinates, chosen) if wants_second else (None, None)
    return Gradient(
        value=found[0],
        by=_split(numbers, found[1]),
        method=found[2].method,
        notes=tuple(found[2].notes),
        run=run,
        agrees=agrees,
        hessian=hessian,
        hessian_error=error,
    )


def _split(numbers: list[Number], derivatives_of_all: Array) -> dict[Any, Any]:
    out: dict[Any, Any] = {}
    first = 0
    for number in numbers:
        count = len(number.directions)
        part = derivatives_of_all[first : first + count].reshape(number.shape)
        out[number.key] = part if number.shape else float(part)
        first += count
    return out


@dataclass(frozen=True)
class _Case:
    """A run with its objective."""

    mechanism: Modelled
    objective: Objective
    duration: Quantity
    initial: State | None
    events: tuple[Any, ...]
    parameters: Mapping[str, ArrayLike]
    rtol: float
    atol: float
    options: Mapping[str, Any]

    def run(self, changes: Mapping[str, ArrayLike], initial: State | None, duration: Quantity | None = None) -> Result:
        """The run with changed numbers."""
        # the steps of long runs stay together
        with raised(step_bytes=1 << 31):
            run = simulate(
                self.mechanism,
                self.duration if duration is None else duration,
                initial=initial,
                events=self.events or None,
                parameters={**self.parameters, **changes} or None,
                rtol=self.rtol,
                atol=self.atol,
                **self.options,
            )
        if not run.success:
            raise IntegrationError(f"the run of the gradient ended early: {run.message}")
        return run

    def derived(
        self, run: Result, numbers: list[Number], held: list[Held], method: str
    ) -> tuple[float, Array, _Leaves]:
        """Value and derivatives, and what computed them."""
        count = sum(len(number.directions) for number in numbers)
        leaves = _Leaves(run, numbers, held, count)
        leaves.gather(self.objective)
        value, along = leaves.compute(self.objective, method)
        return value, along, leaves

    def _moved(self, run: Result, number: Number, i: int, held: list[Held], by: float) -> tuple[Any, ...]:
        """Parameters, start and duration with one direction moved."""
        direction = number.directions[i]
        if "end" in direction:
            return {}, self.initial, float(run.t[-1] - run.t[0]) + by
        changes: dict[str, Any] = {}
        present = dict(run._source.model.parameters())  # type: ignore[union-attr]
        for name, seed in direction.get("parameters", ()):
            base = present.get(name) or present[name.removesuffix(".child_point") + ".point"]
            changes[name] = [x + by * s for x, s in zip(base, seed, strict=True)]
        first = run.state(float(run.t[0]))
        seeds = [direction.get(word, [0.0] * len(held)) for word in ("start", "start_rates")]
        if not any(map(any, seeds)) and not any(".point" in name or ".child_point" in name for name in changes):
            return changes, first, None
        if turning := [one.name for one in held if one.is_turn]:
            raise ArgumentError(
                f"check=True cannot move the start while {', '.join(turning)} is held, which is no coordinate; hold "
                "joints with slides and angles",
                argument="check",
            )
        wanted: list[dict[str, float]] = []
        for own, seed in zip((first.position, first.velocity), seeds, strict=True):
            wanted.append(
                {
                    one.name: float(np.ravel(own(one.joint))[one.coordinate]) + by * s
                    for one, s in zip(held, seed, strict=True)
                }
            )
        near = assemble(
            self.mechanism,
            wanted[0],
            wanted[1],
            near=first,
            t=first.t,
            parameters={**self.parameters, **changes} or None,
        )
        return changes, near, None

    def checked(self, run: Result, numbers: list[Number], held: list[Held], derivatives_of_all: Array) -> float:
        """The largest difference to central differences."""
        worst, first, step = 0.0, 0, 1.0
        value = self.derived(run, [], held, "forward")[0]
        for number in numbers:
            own = derivatives_of_all[first : first + len(number.directions)]
            first += len(number.directions)
            found = []
            for i in range(len(number.directions)):
                step = CHECKED * self._size(run, number, i)
                slopes = []
                for factor in (1.0, 2.0):
                    ends = []
                    for sign in (1.0, -1.0):
                        moved = self.run(*self._moved(run, number, i, held, sign * factor * step))
                        ends.append(self.derived(moved, [], held_of(moved, None), "forward")[0])
                    slopes.append((ends[0] - ends[1]) / (2.0 * factor * step))
                found.append((4.0 * slopes[0] - slopes[1]) / 3.0)
            size = max(float(np.abs(own).max(initial=0.0)), float(np.abs(found).max(initial=0.0)))
            if size > INVISIBLE * max(1.0, abs(value)) / step:
                worst = max(worst, float(np.abs(own - found).max()) / size)
        return worst

    def _size(self, run: Result, number: Number, i: int) -> float:
        present = dict(run._source.model.parameters())  # type: ignore[union-attr]
        sizes = [
            abs(x)
            for name, seed in number.directions[i].get("parameters", ())
            for x, s in zip(present.get(name, [0.0] * len(seed)), seed, strict=True)
            if s
        ]
        return max(sizes, default=0.0) or 1.0

    def second(self, run: Result, numbers: list[Number], held: list[Held], method: str) -> tuple[Array, float]:
        """Second derivatives by differences of gradients, and the change by the last extrapolation."""
        columns, error = [], 0.0
        names = [one.name for one in held]
        for number in numbers:
            for i in range(len(number.directions)):
                step = SECOND * self._size(run, number, i)
                rows = []
                for factor in (1.0, 2.0, 4.0):
                    ends = []
                    for sign in (1.0, -1.0):
                        moved = self.run(*self._moved(run, number, i, held, sign * factor * step))
                        ends.append(self.derived(moved, numbers, held_of(moved, names), method)[1])
                    rows.append((ends[0] - ends[1]) / (2.0 * factor * step))
                once = [(4.0 * rows[0] - rows[1]) / 3.0, (4.0 * rows[1] - rows[2]) / 3.0]
                twice = (16.0 * once[0] - once[1]) / 15.0
                error = max(error, float(np.abs(twice - once[0]).max(initial=0.0)))
                columns.append(twice)
        hessian = np.array(columns)
        return 0.5 * (hessian + hessian.T), error


class _Leaves:
    """The parts of an objective that the core computes, gathered so that one pass computes all."""

    def __init__(self, run: Result, numbers: list[Number], held: list[Held], count: int) -> None:
        self._run, self._numbers, self._held, self._count = run, numbers, held, count
        self._observing = Observing(run)
        self._ends: list[Observable] = []
        self._integrals: list[Observable] = []
        self._peaks: list[tuple[Observable, float]] = []
        self._times: list[str] = []
        self._known: dict[int, tuple[float, Array]] = {}
        self._order: list[tuple[Objective, str, int]] = []
        self.method = "forward"
        self.notes: list[str] = []

    def gather(self, of: Objective) -> None:
        """All parts of an objective."""
        match of.word:
            case "sum" | "product":
                for part in of.parts:
                    self.gather(part)
            case "end":
                self._order.append((of, "end", len(self._ends)))
                self._ends.append(self._observing.number(of.parts[0]))
            case "integral":
                self._order.append((of, "integral", len(self._integrals)))
                self._integrals.append(self._observing.number(of.parts[0]))
            case "peak":
                observable = self._observing.number(of.parts[0])
                self._order.append((of, "peak", len(self._peaks)))
                self._peaks.append((observable, largest(self._run, observable)))
            case "time":
                known = list(self._run._formulas)
                if not known:
                    raise ArgumentError(
                        f'"t:{of.parts[0]}": no events are looked for in this run; give events=', argument="objective"
                    )
                name = known[index_of(of.parts[0], known, "event")]
                self._order.append((of, "time", len(self._times)))
                self._times.append(name)

    @property
    def _is_long(self) -> bool:
        """Whether the way back costs less."""
        passes = -(-self._count // TOGETHER)
        return passes * int(self._run.counters["steps"]) > FORWARD_STEPS

    def compute(self, of: Objective, method: str) -> tuple[float, Array]:
        """Value and derivatives of the objective whose parts were gathered."""
        peaks = {t for _, t in self._peaks}
        # what is largest where something happens moves with it
        apart = peaks.isdisjoint(float(event.t) for event in self._run.events)
        if method == "adjoint" and not apart:
            raise ArgumentError(
                'the peak lies at an event, which method="adjoint" does not follow; take method="forward"',
                argument="method",
            )
        if method == "adjoint" or (method == "auto" and apart and self._is_long):
            try:
                found = self._backward(of)
            except DescriptionError as error:
                if method == "adjoint":
                    raise
                self.notes.append(f"derivatives were carried forwards, as the steps cannot be recorded: {error}")
            else:
                self.method = "adjoint"
                return found
        self._forward()
        return self.value(of)

    def _backward(self, of: Objective) -> tuple[float, Array]:
        run, end = self._run, float(self._run.t[-1])
        happened = [self._first(name) for name in self._times]
        last = self._terminal(end)
        formulas = [{"formula": run._formulas[name]} for name in self._times]
        ended_by = [] if last is None else [{"formula": run._formulas[last]}]
        observables = [*self._ends, *self._integrals, *ended_by, *(x for x, _ in self._peaks), *formulas]
        at = [(end, last is not None), *((t, False) for _, t in self._peaks), *((t, True) for t in happened)]
        both = [observed(run, observables, [t], before=flag) for t, flag in at]
        values, rates = (np.concatenate([one[i] for one in both]) for i in range(2))
        peak, first = len(self._ends) + len(self._integrals) + len(ended_by), len(observables) - len(formulas)
        gathered = []
        if self._integrals:
            still = derivatives(run, [], self._held, [], [end], integrals=self._integrals)
            gathered = [value for value, _ in still.integrals]
        none = np.zeros(self._count)
        known = {
            "end": [float(x) for x in values[0, : len(self._ends)]],
            "integral": gathered,
            "peak": [float(values[1 + i, peak + i]) for i in range(len(self._peaks))],
            "time": happened,
        }
        for part, word, i in self._order:
            self._known[id(part)] = known[word][i], none
        weights, of_integrals = np.zeros((len(at), len(observables))), np.zeros(len(self._integrals))
        ending = 0.0
        for (_, word, i), weight in zip(self._order, self._slopes(of), strict=True):
            if word == "peak":
                weights[1 + i, peak + i] += weight
            elif word == "time":
                row, column = 1 + len(self._peaks) + i, first + i
                weights[row, column] -= weight / rates[row, column]
            else:
                if word == "end":
                    weights[0, i] += weight
                    moving = weight * float(rates[0, i])
                else:
                    of_integrals[i] += weight
                    moving = weight * float(values[0, len(self._ends) + i])
                ending += moving
                if last is not None:
                    column = len(self._ends) + len(self._integrals)
                    weights[0, column] -= moving / rates[0, column]
        found = backward(
            run, self._numbers, self._held, observables, at, integrals=self._integrals, weights=(weights, of_integrals)
        )
        for i, direction in enumerate(d for n in self._numbers for d in n.directions):
            if "end" in direction and last is None:
                found[i] += ending
        return self.value(of)[0], found

    def _slopes(self, of: Objective) -> list[float]:
        """The derivative of an objective by each of its parts, in the order in which they were gathered."""
        match of.word:
            case "number":
                return []
            case "sum":
                return [x for part in of.parts for x in self._slopes(part)]
            case "product":
                one, other = of.parts
                (x, _), (y, _) = self.value(one), self.value(other)
                return [*(y * d for d in self._slopes(one)), *(x * d for d in self._slopes(other))]
        return [1.0]

    def _forward(self) -> None:
        """Values and derivatives of all parts."""
        run, end = self._run, float(self._run.t[-1])
        happened = [self._first(name) for name in self._times]
        last = self._terminal(end)
        peaks = [observable for observable, _ in self._peaks]
        formulas = [{"formula": self._run._formulas[name]} for name in self._times]
        ends = [*self._ends, *self._integrals, *([] if last is None else [{"formula": self._run._formulas[last]}])]
        observables = [*ends, *peaks]
        times = [end, *(t for _, t in self._peaks)]
        found = derivatives(
            run, self._numbers, self._held, observables, times, integrals=self._integrals, before=last is not None
        )
        along, rates = found.along, found.rates
        moved = np.zeros(self._count)
        ending = [i for i, x in enumerate(d for n in self._numbers for d in n.directions) if "end" in x]
        if last is not None:  # such a run ends where the event happens
            ended_by = len(self._ends) + len(self._integrals)
            along[0, :, ending] = 0.0
            moved = -along[0, ended_by] / rates[0, ended_by]
        parts: dict[str, list[tuple[float, Array]]] = {"end": [], "integral": [], "peak": [], "time": []}
        for i in range(len(self._ends)):
            parts["end"].append((float(found.values[0, i]), along[0, i] + rates[0, i] * moved))
        for i, (value, by) in enumerate(found.integrals):
            integrand = float(found.values[0, len(self._ends) + i])
            gained = np.array(by) + integrand * moved
            if last is None:
                gained[ending] = integrand
            parts["integral"].append((value, gained))
        for i, (_, t) in enumerate(self._peaks):
            row, column = 1 + i, len(ends) + i
            own = along[row, column].copy()
            for when, shift in found.shifts:
                if when == t:
                    own += rates[row, column] * np.array(shift)
            parts["peak"].append((float(found.values[row, column]), own))
        if self._times:
            timed = derivatives(run, self._numbers, self._held, formulas, happened, before=True)
            for i, t in enumerate(happened):
                rate = timed.rates[i, i]
                parts["time"].append((t, -timed.along[i, i] / rate))
        for of, word, i in self._order:
            self._known[id(of)] = parts[word][i]

    def _first(self, name: str) -> float:
        """When an event happens first."""
        found = [event.t for event in self._run.events if event.name == name]
        if not found:
            raise ArgumentError(
                f'the event "{name}" does not happen in this run, so that it has no time', argument="objective"
            )
        return float(found[0])

    def _terminal(self, end: float) -> str | None:
        """The event that ended the run."""
        if self._run.status != "event":
            return None
        found = [event.name for event in self._run.events if float(event.t) == end]
        return found[-1] if found else None

    def value(self, of: Objective) -> tuple[float, Array]:
        """Value and derivatives of an objective of these parts."""
        match of.word:
            case "number":
                return float(of.parts[0]), np.zeros(self._count)
            case "sum":
                found = [self.value(part) for part in of.parts]
                return sum(x for x, _ in found), np.sum([d for _, d in found], axis=0)
            case "product":
                (x, dx), (y, dy) = (self.value(part) for part in of.parts)
                return x * y, x * dy + y * dx
        return self._known[id(of)]
