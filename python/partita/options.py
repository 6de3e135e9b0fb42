"""Options of a run, the same for mechanisms and systems: checked here, used by the core."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .errors import ArgumentError, UnknownNameError
from .limits import limit
from .numeric import floats, is_list, real, shown
from .progress import reporting
from .solver import Solver
from .solver import checked as checked_solver
from .tangent import TangentVelocities
from .tolerance import LONG_ROUNDING
from .units import Quantity
from .units.door import SI, QuantityError, in_si

Array = NDArray[np.float64]
METHODS, FORMULATIONS, SELECTIONS = _core.METHODS, _core.FORMULATIONS, _core.SELECTIONS
"""Words that the core knows, the default first."""
TANGENTS = ("zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt")
"""Formulations with tangent velocities that are frozen, or renewed at each step."""
WHOLE = ("multipliers", "sparse-multipliers", "range-space", "proximal", "baumgarte")
"""Formulations that integrate all velocities."""
CORRECTIONS = ("partition", "kantorovich", "mass-orthogonal", "none")
# When frozen tangent velocities are renewed, if not by their quality.
EACH_STEP = "each step"
# Evaluations are compiled where that is worth while.
AUTO = "auto"
COORDINATES = ("relative", "absolute")
BASES = ("fixed", "free")
"""What becomes of the root of a robot's file."""
INERTIAS = ("strict", "repair")
"""What becomes of an inertia in a file that no body can have."""
SERIALS = ("stated", "auto")
"""Where joints between the same two bodies of a file are one after the other."""
RESOLVED = 16
"""A run whose time, divided by this, is lost beside its start has no times of its own."""
OUTPUTS = 201


class Core(Protocol):
    """What is integrated: a compiled mechanism or system."""

    def simulate(
        self,
        options: _core.Options,
        t_eval: Array,
        q: Array,
        v: Array,
        progress: Callable[[float], None] | None,
        tangent: Any = None,
        step_bytes: int = 0,
        events: _core.EventList | None = None,
    ) -> dict[str, Any]:
        """Outputs, logs and counters of a run."""


class Options(dict[str, Any]):
    """Checked options of a run as plain data, and as the core takes them. Equal runs share one, so it is never
    changed."""

    @cached_property
    def core(self) -> _core.Options:
        """As the core takes them."""
        return _core.Options(json.dumps(self))

    @cached_property
    def _of(self) -> dict[str, dict[str, Any]]:
        """The options of runs in these coordinates."""
        return {}

    def of(self, coordinates: str) -> dict[str, Any]:
        """Those of a run in these coordinates, which its result reports."""
        if coordinates not in self._of:
            self._of[coordinates] = {**self, "coordinates": coordinates}
        return self._of[coordinates]


def options(
    t0: float,
    duration: Quantity,
    velocity_names: list[str],
    *,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    correction: str = "partition",
    switch_threshold: float = 1.25,
    step: Quantity | None = None,
    max_step: Quantity | None = None,
    max_steps: int = 10_000_000,
    independent: Iterable[Any] | None = None,
    solver: Solver | None = None,
    compiled: bool | str = AUTO,
) -> Options:
    """Checked options of a run from t0. Those without lists of names are checked once for all runs that ask the same.
    Raises `ArgumentError`."""
    by = checked_solver(solver)
    asked = (
        t0, duration, rtol, atol, method, by.formulation, correction, switch_threshold, step, max_step, max_steps,
        by.selection, by.window, by.renew, compiled,
    )  # fmt: skip
    if independent is None and by.weights is None and by.baumgarte is None:
        try:
            return _checked_once(*asked)
        except TypeError:  # an array, which no table finds again
            return _checked(*asked)
    named = None if independent is None else velocities("independent", independent, velocity_names)
    preferred = None if by.weights is None else _weights(by.weights, velocity_names)
    return _checked(*asked, named, preferred, None if by.baumgarte is None else _baumgarte(by.baumgarte))


@lru_cache(maxsize=64, typed=True)
def _checked_once(*asked: Any) -> Options:
    """Those of numbers, words and quantities, by their types too: 1 is a number of steps, True is none."""
    return _checked(*asked)


def _checked(
    t0: float,
    duration: Quantity,
    rtol: float,
    atol: float,
    method: str,
    formulation: str,
    correction: str,
    switch_threshold: float,
    step: Quantity | None,
    max_step: Quantity | None,
    max_steps: int,
    selection: str,
    window: Quantity | None,
    renew: float | str,
    compiled: bool | str,
    independent: list[str] | None = None,
    weights: list[list[Any]] | None = None,
    baumgarte: list[float] | None = None,
) -> Options:
    span = positive("duration", duration, "s")
    if t0 + span / RESOLVED == t0:
        apart = float(np.spacing(abs(t0)))
        raise ArgumentError(
            f"duration: times near t = {t0:g} s are {apart:g} s apart, too far for a run of {span:g} s; start it nearer"
            " to t = 0, with loads and drives shifted as much",
            argument="duration",
        )
    if step is not None and max_step is not None:
        raise ArgumentError(
            f"step = {step} fixes every step, so max_step = {max_step} has no effect; give one of them",
            argument="step",
        )
    return Options(
        t0=float(t0),
        t_end=t0 + span,
        rtol=tolerance("rtol", rtol),
        atol=tolerance("atol", atol),
        method=one_of("method", method, METHODS),
        formulation=one_of("formulation", formulation, FORMULATIONS),
        step=None if step is None else positive("step", step, "s"),
        max_step=None if max_step is None else positive("max_step", max_step, "s"),
        correction=one_of("correction", correction, CORRECTIONS),
        switch_threshold=_switch_threshold(switch_threshold),
        max_steps=count(max_steps),
        independent=independent,
        selection=one_of("selection", selection, SELECTIONS),
        weights=weights,
        window=None if window is None else positive("window", window, "s"),
        baumgarte=baumgarte,
        renew=_renew(renew),
        compiled=_compiled(compiled),
    )


def output_times(t_eval: ArrayLike | None, t0: float, t_end: float) -> Array:
    """Times of the outputs (nt,): as given if increasing and inside the run; None: 201 evenly spaced ones."""
    if t_eval is None:
        return np.linspace(t0, t_end, OUTPUTS)
    increasing = _core.increasing(t_eval, t0, t_end)
    if increasing is not None:
        return increasing
    given = si("t_eval", t_eval, "s")
    try:
        times = floats(given)
    except TypeError as error:
        raise ArgumentError(f"t_eval must be an array of times, not {shown(t_eval)}", argument="t_eval") from error
    if times.ndim == 1 and times.size and t0 <= times[0] and times[-1] <= t_end and (times[1:] > times[:-1]).all():
        return times
    if times.ndim != 1 or times.size == 0:
        raise ArgumentError(
            f"t_eval has shape {times.shape}; it must be a flat array of times such as "
            f"np.linspace({t0:g}, {t_end:g}, {OUTPUTS})",
            argument="t_eval",
        )
    if not np.all(np.isfinite(times)):
        raise ArgumentError("t_eval contains NaN or infinity; give finite times", argument="t_eval")
    if np.any(np.diff(times) <= 0.0):
        row = int(np.argmax(np.diff(times) <= 0.0))
        raise ArgumentError(
            f"t_eval must increase, but {times[row]:g} is followed by {times[row + 1]:g}; sort it",
            argument="t_eval",
        )
    slack = LONG_ROUNDING * max(abs(t0), abs(t_end))
    if times[0] < t0 - slack or times[-1] > t_end + slack:
        raise ArgumentError(
            f"t_eval goes from {times[0]:.12g} to {times[-1]:.12g} s, outside the run from {t0:.12g} to "
            f"{t_end:.12g} s; "
            "change the duration or the times",
            argument="t_eval",
        )
    return np.clip(times, t0, t_end)


def run(
    core: Core,
    chosen: Options,
    t_eval: Array,
    q: Array,
    v: Array,
    progress: Any,
    solver: Solver | None = None,
    events: _core.EventList | None = None,
) -> dict[str, Any]:
    """Integrate in the core, and return its result."""
    tangent = checked_solver(solver).tangent
    own = None if tangent is None else tangent_of(tangent, v.size)
    q, v = np.ascontiguousarray(q), np.ascontiguousarray(v)
    if progress is False:
        return core.simulate(chosen.core, t_eval, q, v, None, own, limit("step_bytes"), events)
    with reporting(progress, chosen["t_end"] - chosen["t0"], "s") as report:
        return core.simulate(chosen.core, t_eval, q, v, report, own, limit("step_bytes"), events)


def run_segments(
    core: _core.Model,
    chosen: Options,
    t_eval: Array,
    start: tuple[Array, Array],
    progress: Any,
    solver: Solver | None,
    events: _core.EventList,
    acts: tuple[str, list[Any]],
) -> dict[str, Any]:
    """As `run`, where events act: what they do, and the functions that decide about it."""
    if checked_solver(solver).tangent is not None:
        raise ArgumentError(
            "events act with the coordinates of the mechanism, not with tangent velocities of the user",
            argument="solver",
        )
    q, v = map(np.ascontiguousarray, start)
    if progress is False:
        return core.simulate_segments(chosen.core, t_eval, q, v, None, limit("step_bytes"), events, *acts)
    with reporting(progress, chosen["t_end"] - chosen["t0"], "s") as report:
        return core.simulate_segments(chosen.core, t_eval, q, v, report, limit("step_bytes"), events, *acts)


def si(what: str, value: Any, unit: SI) -> Any:
    """`value` with its quantities in SI; `ArgumentError` for what has another dimension."""
    try:
        return in_si(what, value, unit)
    except QuantityError as error:
        raise ArgumentError(str(error), argument=what.partition("[")[0]) from error


def positive(what: str, value: Any, unit: SI = "") -> float:
    """A finite number above zero, in its SI unit."""
    given = si(what, value, unit)
    try:
        number = real(given)
    except TypeError as error:
        raise ArgumentError(f"{what} must be a number, not {shown(value)}", argument=what) from error
    if not math.isfinite(number) or number <= 0.0:
        raise ArgumentError(f"{what} is {number:g}; it must be finite and greater than zero", argument=what)
    return number


def tolerance(what: str, value: Any) -> float:
    """A tolerance of steps: a fraction of the motion, or of what is large for each coordinate."""
    found = positive(what, value)
    if found > 1.0:
        raise ArgumentError(
            f"{what} is {found:g}; it must be at most 1, where errors are as large as the motion; ordinary runs have "
            "rtol=1e-8 and atol=1e-10",
            argument=what,
        )
    return found


def one_of(what: str, value: Any, known: Iterable[str]) -> str:
    """One of the known words."""
    words = known if isinstance(known, tuple) else list(known)
    if not isinstance(value, str) or value not in words:
        close = difflib.get_close_matches(shown(value).strip("'").lower(), words, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"choose one of {', '.join(map(repr, words))}"
        raise ArgumentError(f"{what} {shown(value)} is not known; {hint}", argument=what)
    return str(value)


def yes_or_no(what: str, value: Any) -> bool:
    """An argument that is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise ArgumentError(f"{what} is True or False, not {value!r}", argument=what)
    return bool(value)


def _switch_threshold(value: Any) -> float:
    number = positive("switch_threshold", value)
    if number < 1.0:
        raise ArgumentError(
            f"switch_threshold is {number:g}; below 1 two choices would alternate forever; 1.25 is usual",
            argument="switch_threshold",
        )
    return number


def _renew(value: Any) -> float | str:
    """A number from 0 to 1, or the words for a basis renewed after every step."""
    if isinstance(value, str) and value == EACH_STEP:
        return EACH_STEP
    try:
        number = real(value)
    except TypeError:
        number = np.nan
    if not 0.0 <= number <= 1.0:
        raise ArgumentError(
            f"renew is {shown(value)}; it must be a number from 0 to 1, or {EACH_STEP!r}", argument="renew"
        )
    return number


def _compiled(value: Any) -> bool | None:
    """Always, never, or None where the run decides."""
    if isinstance(value, str) and value == AUTO:
        return None
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise ArgumentError(f"compiled is {shown(value)}; it must be {AUTO!r}, True or False", argument="compiled")


def _weights(weights: Mapping[Any, float], velocity_names: list[str]) -> list[list[Any]]:
    """Preferences by name, above zero."""
    if not isinstance(weights, Mapping):
        raise ArgumentError(f"weights must be a dict such as {{'A': 10.0}}, not {shown(weights)}", argument="weights")
    names = velocities("weights", weights, velocity_names)
    return [
        [name, positive(f"weights[{name!r}]", weight)] for name, weight in zip(names, weights.values(), strict=True)
    ]


def _baumgarte(value: Any) -> list[float]:
    """alpha and beta [1/s]."""
    given = si("baumgarte", value, "1/s")
    try:
        alpha, beta = (real(item) for item in given)
    except (TypeError, ValueError) as error:
        raise ArgumentError(
            f"baumgarte must be the two numbers (alpha, beta) [1/s], not {shown(value)}", argument="baumgarte"
        ) from error
    if not (np.isfinite([alpha, beta]).all() and alpha >= 0.0 and beta >= 0.0):
        raise ArgumentError(
            f"baumgarte is ({alpha:g}, {beta:g}); both must be finite and not negative", argument="baumgarte"
        )
    return [alpha, beta]


def tangent_of(value: Any, n: int) -> TangentVelocities:
    """The user's tangent velocities for n velocities, checked at each call."""
    if not isinstance(value, TangentVelocities):
        raise ArgumentError(
            f"tangent must be a TangentVelocities(directions, offset, bias), not {type(value).__name__}",
            argument="tangent",
        )
    return value.checked(n)


def count(value: Any, what: str = "max_steps") -> int:
    """A number of steps, or of something else."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value < 2**63:
        raise ArgumentError(f"{what} is {shown(value)}; it must be an integer above zero and below 2^63", argument=what)
    return int(value)


def generator(seed: Any) -> np.random.Generator:
    """Random numbers from a seed; None: others in each call."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"seed must be an integer or None, not {shown(seed)}", argument="seed") from error


def items(what: str, value: Any, such_as: str) -> list[Any]:
    """One or several of something, as a list; a text is one."""
    if not is_list(value):
        return [value]
    found = list(value)
    if any(isinstance(item, np.ndarray) for item in found):
        raise ArgumentError(f"{what} must be a list such as {such_as}, not {shown(value)}", argument=what)
    return found


def named(what: str, value: Any, such_as: str) -> dict[str, Any]:
    """What is given by names; None: nothing."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise ArgumentError(f"{what} must be a dict such as {such_as}, not {shown(value)}", argument=what)
    return dict(value)


def velocities(what: str, given: Iterable[Any], velocity_names: list[str]) -> list[str]:
    """Different names of velocities, checked."""
    if not is_list(given):
        raise ArgumentError(
            f"{what} must be a list of names such as {velocity_names[:1]}, not {shown(given)}", argument=what
        )
    names = [str(item) for item in given]
    known = set(velocity_names)
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, velocity_names, n=1)
            hint = f'did you mean "{close[0]}"?' if close else f"known velocities: {', '.join(velocity_names)}"
            raise UnknownNameError(f'{what}: there is no velocity "{name}"; {hint}', name=name, known=velocity_names)
    if len(set(names)) < len(names):
        raise ArgumentError(f"{what} names a velocity twice: {', '.join(names)}", argument=what)
    return names
