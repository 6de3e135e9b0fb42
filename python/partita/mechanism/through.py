"""A run as a function of numbers, with derivatives backwards: what the doors of other packages are made of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..derivatives import Start, StartRate, objective
from ..errors import ArgumentError, IntegrationError
from ..limits import raised
from ..results import Result
from ..results.sensitivities import Held, Number, Observing, backward, grown, held_of, numbers_of, observed
from ..state import State
from .goals import asked, units_of
from .models import Modelled, compile
from .solve import assemble, simulate

Array = NDArray[np.float64]
RTOL_OF_DERIVATIVES = 1e-10
"""Relative tolerance of a run that is differentiated. Scale: as of `RTOL`. Reason: derivatives lose a digit or two."""
ATOL_OF_DERIVATIVES = 1e-12
"""Absolute tolerance of a run that is differentiated. Scale: as of `ATOL`. Reason: a hundredth of the relative one."""


def _with_unit(name: str, position: float, model: CompiledModel) -> Any:
    """The position of a joint as a target."""
    goals = next(goals for _, goals, _ in asked("targets", {name: position}, model))
    return f"{position!r} rad" if units_of(goals, model)[0] == "rad" else position


@dataclass
class Passed:
    """A run with what its derivatives are asked by."""

    run: Result
    values: Array
    """What was observed: times, observables."""
    numbers: list[Number] = field(repr=False)
    held: list[Held] = field(repr=False)
    observables: list[Any] = field(repr=False)


@dataclass(frozen=True)
class Through:
    """What is observed of a mechanism at given times, as a function of numbers."""

    mechanism: Modelled
    keys: tuple[Any, ...]
    of: tuple[Any, ...]
    duration: float
    times: Array
    initial: State | None = None
    events: tuple[Any, ...] = ()
    held: tuple[str, ...] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key in self.keys:
            if not isinstance(key, str | Start | StartRate):
                raise ArgumentError(
                    f"{key!r} is no number of a run; give parameters by name, pt.start(...) or pt.start_rate(...)",
                    argument="by",
                )

    @property
    def shape(self) -> tuple[int, int]:
        """Of what is observed."""
        return len(self.times), len(self.of)

    def forward(self, values: Sequence[Array]) -> Passed:
        """The run with these values."""
        changes: dict[str, Any] = {}
        starts: dict[str, float] = {}
        rates: dict[str, float] = {}
        sizes: dict[str, float] = {}
        model = compile(self.mechanism, self.options.get("coordinates", "relative"))
        present = model.parameters
        for key, value in zip(self.keys, values, strict=True):
            if isinstance(key, Start | StartRate):
                (starts if isinstance(key, Start) else rates)[key.joint] = float(value)
            elif key in present:
                changes[key] = np.ravel(value).tolist() if np.ndim(value) else float(value)
            else:
                sizes[key] = float(value)
        changes = grown(model.description, sizes) | changes if sizes else changes
        start = self.initial
        if starts or rates or start is not None:
            # with their unit: what was computed has not been meant in degrees
            targets: dict[str, Any] = {name: _with_unit(name, x, model) for name, x in starts.items()}
            speeds: dict[str, Any] = dict(rates)
            for name in self.held or (start.held if start is not None else ()):
                if start is not None:
                    targets.setdefault(name, start.position(name))
                    speeds.setdefault(name, start.velocity(name))
            start = assemble(
                self.mechanism, targets, speeds, near=start, parameters=changes or None,
                coordinates=self.options.get("coordinates", "relative"),
            )  # fmt: skip
        with raised(step_bytes=1 << 31):
            run = simulate(
                self.mechanism, self.duration, t_eval=self.times, initial=start, events=self.events or None,
                parameters=changes or None, **self.options,
            )  # fmt: skip
        if not run.success or run.status == "event":
            raise IntegrationError(f"the run ended early, so that what is observed is not known: {run.message}")
        held = held_of(run, self.held)
        observing = Observing(run)
        observables = [observing.number(objective(one).parts[0]) for one in self.of]
        found, _ = observed(run, observables, self.times)
        return Passed(run, found, numbers_of(self.keys, run, held), held, observables)

    def back(self, passed: Passed, weights: Array) -> list[Array]:
        """The derivatives of the weighed sum of what was observed by each number, in its shape."""
        at = [(float(t), False) for t in self.times]
        found = backward(
            passed.run, passed.numbers, passed.held, passed.observables, at, integrals=(),
            weights=(np.asarray(weights, dtype=float).reshape(self.shape), np.zeros(0)),
        )  # fmt: skip
        out, first = [], 0
        for number in passed.numbers:
            count = len(number.directions)
            out.append(found[first : first + count].reshape(number.shape))
            first += count
        return out


def through(
    mechanism: Modelled,
    by: Iterable[Any],
    of: Any,
    duration: float,
    t_eval: Any,
    options: Mapping[str, Any],
) -> Through:
    """A run as a function of the numbers `by`; `options` are those of `simulate`, and `held`."""
    own = dict(options)
    held = own.pop("held", None)
    initial, events = own.pop("initial", None), own.pop("events", None)
    if unknown := {"parameters", "t_eval"} & own.keys():
        raise ArgumentError(
            f"{', '.join(sorted(unknown))} cannot be given here: numbers come as tensors, times as t_eval",
            argument="options",
        )
    own.setdefault("rtol", RTOL_OF_DERIVATIVES)
    own.setdefault("atol", ATOL_OF_DERIVATIVES)
    start = 0.0 if initial is None else float(initial.t)
    times = np.array([start + duration]) if t_eval is None else np.asarray(t_eval, dtype=float)
    observed_ones = [of] if isinstance(of, str) or not isinstance(of, Iterable) else list(of)
    return Through(
        mechanism=mechanism,
        keys=tuple(by),
        of=tuple(observed_ones),
        duration=duration,
        times=np.atleast_1d(times),
        initial=initial,
        events=tuple(events or ()),
        held=None if held is None else (held,) if isinstance(held, str) else tuple(held),
        options=own,
    )
