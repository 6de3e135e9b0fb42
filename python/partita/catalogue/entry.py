"""An entry of the catalogue: a mechanism, its start, and numbers that its motion must reproduce."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..mechanism.set_valued import has_set_valued
from ..numeric import MaybeNone, is_list

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..results import Result
    from ..state import State
    from .truth import Truth

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Measurement:
    """Result of a check in one run: `error` and `tolerance`, both in the unit that the check names."""

    name: str
    error: float
    tolerance: float

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance; false for NaN."""
        return self.error <= self.tolerance

    def __str__(self) -> str:
        verdict = "ok" if self.passed else "FAILED"
        return f"{self.name}: error {self.error:.1e}, tolerance {self.tolerance:.0e}: {verdict}"


@dataclass(frozen=True)
class Check:
    """A known answer: `error(result)` is its largest deviation, `reason` gives the origin of `tolerance`."""

    name: str
    tolerance: float
    reason: str
    error: Callable[[Result], float]

    def run(self, result: Result) -> Measurement:
        """Measure the error in `result`, which must hold the outputs the check asks for (`Entry.t_eval` does)."""
        return Measurement(self.name, float(self.error(result)), self.tolerance)


@dataclass(frozen=True)
class Entry:
    """A problem with a known answer.

    `title` and `source` are descriptions for readers; `duration` [s] is the length of the run to which `checks` apply,
    with `options` of `Mechanism.simulate`; `times` [s] are the outputs that the checks need, `samples` the number of
    other outputs; `notes` states conventions and pitfalls. A member of the zoo has `truth`: its mobility, redundancy
    and unique reactions by the theory of mechanisms.

    >>> import partita as pt
    >>> entry = pt.catalogue.entry("planar-pendulum")
    >>> all(m.passed for m in entry.measure(entry.simulate()))
    True
    """

    name: str
    title: str
    source: str
    duration: float
    build: Callable[[], Mechanism]
    start: Callable[[Mechanism], State]
    checks: Sequence[Check]
    times: Sequence[float] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    notes: str = ""
    truth: Truth | MaybeNone = None
    samples: int = 201

    def mechanism(self) -> Mechanism:
        """A new mechanism, drawn closed in its starting position: all joint coordinates begin at zero."""
        return self.build()

    @property
    def has_events(self) -> bool:
        """Whether it has elements that hold a joint at times, or its run has events that act. Then what looks at one
        state or exports it refuses the mechanism, or knows nothing of them.

        >>> import partita as pt
        >>> pt.catalogue.entry("door-latch").has_events, pt.catalogue.entry("four-bar").has_events
        (True, False)
        """
        return bool(self.options.get("events")) or has_set_valued(self.mechanism())

    def initial(self, mechanism: Mechanism) -> State:
        """The starting state of `mechanism`, which `mechanism()` made: drawn position, published rates."""
        return self.start(mechanism)

    def t_eval(self, samples: int | None = None) -> FloatArray:
        """Output times [s]: `samples` equal ones over the duration, as many as the entry has unless said otherwise, and
        exactly those the checks need."""
        even = np.linspace(0.0, self.duration, self.samples if samples is None else samples)
        wanted = np.array([t for t in self.times if t <= self.duration], dtype=float)
        near = np.abs(even[:, None] - wanted) <= 1e-9 * self.duration
        return np.sort(np.concatenate([even[~near.any(axis=1)], wanted]))

    def simulate(self, **options: Any) -> Result:
        """Run the problem from its start; `options` of `Mechanism.simulate` override those of the entry."""
        mechanism = self.mechanism()
        own: dict[str, Any] = {"t_eval": self.t_eval(), "initial": self.initial(mechanism), **self.options}
        return mechanism.simulate(self.duration, **{**own, **options})

    def measure(self, result: Result) -> list[Measurement]:
        """Every check of the entry on `result`, in order."""
        return [check.run(result) for check in self.checks]

    @property
    def settings(self) -> str:
        """Its run in words: duration, and those options that are numbers.

        >>> import partita as pt
        >>> pt.catalogue.entry("punch-press").settings
        '0.2 s, rtol 1e-11, atol 1e-12, events: touches, breaks, bottom'
        """
        numbers = {key: value for key, value in self.options.items() if not is_list(value)}
        found = f"{self.duration:g} s" + "".join(f", {key} {value:g}" for key, value in numbers.items())
        names = [event.name for event in self.options.get("events", ())]
        return found + (f", events: {', '.join(names)}" if names else "")

    def about(self) -> str:
        """Description of the entry: title, source, run, checks with their tolerances and reasons, notes."""
        checks = [f"  {check.name}: within {check.tolerance:.0e} ({check.reason})" for check in self.checks]
        parts = [f"{self.name}: {self.title}", f"Source: {self.source}", f"Run: {self.settings}", "Checks:", *checks]
        known = [str(self.truth)] if self.truth is not None else []
        return "\n".join([*parts, *known, *([self.notes] if self.notes else [])])


def row_at(result: Result, t: float) -> int:
    """Row of the output at time `t` [s]; `ArgumentError` when the run has none there."""
    row = int(np.argmin(np.abs(result.t - t))) if len(result.t) else 0
    if not len(result.t) or abs(result.t[row] - t) > 1e-12 * max(1.0, abs(t)):
        raise ArgumentError(
            f"the run has no output at t = {t:g} s, which this check needs ({len(result.t)} outputs); "
            "simulate with t_eval=entry.t_eval()",
            argument="t_eval",
        )
    return row


def angle(result: Result, joint: str, drawn: float = 0.0) -> FloatArray:
    """Angle (nt,) [rad] of a revolute joint: `drawn`, its value in the drawing, plus the joint's coordinate."""
    return drawn + result.joint(joint).position[:, 0]


def largest_gap(values: FloatArray, reference: FloatArray) -> float:
    """Largest absolute difference; infinite if any value is not a number, so that no check passes by it."""
    gap = float(np.max(np.abs(values - reference)))
    return gap if np.isfinite(gap) else float("inf")


def path_error(values: FloatArray, result: Result, table: Mapping[float, Sequence[float]]) -> float:
    """Largest deviation of `values` (nt, ...) from a `table` of published rows by time."""
    rows = [row_at(result, t) for t in table]
    return largest_gap(values[rows], np.array(list(table.values()), dtype=float))
