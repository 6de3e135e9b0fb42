"""What derivatives of runs are taken of, and by: numbers of the start, and objectives."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

from .errors import ArgumentError
from .numeric import real, shown


@dataclass(frozen=True)
class Start:
    """The position of a joint at the start of a run, see `start`."""

    joint: str
    coordinate: int = 0

    def __str__(self) -> str:
        return f"start of {self.joint}" + (f".{self.coordinate}" if self.coordinate else "")


@dataclass(frozen=True)
class StartRate:
    """The rate of a joint at the start of a run, see `start_rate`."""

    joint: str
    coordinate: int = 0

    def __str__(self) -> str:
        return f"start rate of {self.joint}" + (f".{self.coordinate}" if self.coordinate else "")


@dataclass(frozen=True)
class EndTime:
    """The time at which a run ends, see `end_time`."""

    def __str__(self) -> str:
        return "end time"


end_time = EndTime()
"""The end time of a run [s], as a number to take derivatives by."""


def start(joint: Any, coordinate: int = 0) -> Start:
    """The position of a joint at the start of a run [rad or m], as a number to take derivatives by.

    The joint is one of those that are held (see `Result.sensitivities`): it moves, and the others stay.

    >>> import partita as pt
    >>> str(pt.start("A"))
    'start of A'
    """
    return Start(str(getattr(joint, "name", joint)), coordinate)


def start_rate(joint: Any, coordinate: int = 0) -> StartRate:
    """The rate of a joint at the start of a run [rad/s or m/s], as a number to take derivatives by.

    >>> import partita as pt
    >>> str(pt.start_rate("A"))
    'start rate of A'
    """
    return StartRate(str(getattr(joint, "name", joint)), coordinate)


class Objective:
    """A number that a run comes to: see `integral`, `peak` and `at_end`; sums, differences and products of these.

    >>> import partita as pt
    >>> pt.integral("effort") + 2.0 * pt.peak("force")
    integral(effort) + 2*peak(force)
    """

    # an operation with a sensor is one of objectives
    __array_ufunc__ = None

    def __init__(self, word: str, parts: tuple[Any, ...]) -> None:
        self.word, self.parts = word, parts

    def __add__(self, other: Any) -> Objective:
        return Objective("sum", (self, objective(other)))

    def __radd__(self, other: Any) -> Objective:
        return Objective("sum", (objective(other), self))

    def __sub__(self, other: Any) -> Objective:
        return self + -objective(other)

    def __rsub__(self, other: Any) -> Objective:
        return objective(other) + -self

    def __mul__(self, other: Any) -> Objective:
        return Objective("product", (self, objective(other)))

    def __rmul__(self, other: Any) -> Objective:
        return Objective("product", (objective(other), self))

    def __neg__(self) -> Objective:
        return Objective("product", (Objective("number", (-1.0,)), self))

    def __repr__(self) -> str:
        match self.word:
            case "number":
                return f"{self.parts[0]:g}"
            case "sum":
                return " + ".join(map(repr, self.parts))
            case "product":
                inside = [f"({x!r})" if x.word == "sum" else repr(x) for x in self.parts]
                return "*".join(inside)
        return f"{self.word}({self.parts[0]})"


def objective(value: Any) -> Objective:
    """An objective as users write it: one, a number, a sensor or an expression (its value at the end), or "t:event"."""
    if isinstance(value, Objective):
        return value
    if isinstance(value, str) and value.startswith("t:"):
        return Objective("time", (value[2:],))
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max:
        return Objective("number", (real(value),))
    return Objective("end", (_observed(value),))


def _observed(value: Any) -> Any:
    """What is observed: the name of a sensor or joint, or an expression as plain data."""
    if isinstance(value, str):
        return value
    if (tree := getattr(value, "tree", None)) is not None:
        return tree()
    if (name := getattr(value, "name", None)) is not None:
        return str(name)
    raise ArgumentError(
        f"{shown(value)} is no objective; give the name of a sensor or a joint, an expression of sensors, "
        'pt.integral(...), pt.peak(...), "t:event" for the time of an event, or sums and products of these',
        argument="objective",
    )


def at_end(of: Any) -> Objective:
    """The value of a sensor, of a joint's position, or of an expression of sensors at the end of a run.

    >>> import partita as pt
    >>> pt.at_end("tip")
    end(tip)
    """
    return Objective("end", (_observed(of),))


def integral(of: Any) -> Objective:
    """The integral of a sensor, or of an expression of sensors, over the time of a run.

    It is computed by the stages of the run's own steps, to the order of the method.

    >>> import partita as pt
    >>> pt.integral("power")
    integral(power)
    """
    return Objective("integral", (_observed(of),))


def peak(of: Any) -> Objective:
    """The largest value of a sensor, or of an expression of sensors, over the time of a run.

    >>> import partita as pt
    >>> pt.peak("force")
    peak(force)
    """
    return Objective("peak", (_observed(of),))
