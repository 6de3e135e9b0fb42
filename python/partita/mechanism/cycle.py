"""Periodic motions: `cycle`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.cycle import Cycle, CycleDerivative
from ..analyses.cycles import CycleFamily
from ..builder.compiled import CompiledModel
from ..builder.values import Constant
from ..errors import ArgumentError, PartitaError
from ..numeric import is_list, shown
from ..results import Result
from ..state import State
from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS, NEGLIGIBLE
from ..units import Quantity
from . import cycle_family, shooting
from .algebra import least_squares
from .family import Line, line_of
from .models import Modelled, layout_of
from .monodromy import Setting, chart, ended
from .periods import Known, common, repeating, repeats
from .recurrence import SEEKING, conserves, guessed
from .shooting import Kind, Start
from .solve import assemble, start_of

Array = NDArray[np.float64]

OUTPUTS = 201
"""Outputs of the run over one cycle."""
SETTLES = (0, 10, 40, 160)
"""Periods of its drives for which a driven mechanism runs before Newton's method begins, until it arrives; the first
where a start is given."""
PROBES = (0.0, 0.1237, 0.4771, 1.7133, 5.9021)
"""Times [s] at which loads are compared to see whether they depend on time."""
STATIONS = 9
"""States along a cycle at which its forces are compared with those one cycle later."""


@overload
def cycle(
    self: Modelled,
    period: Any = None,
    *,
    along: None = None,
    initial: State | None = None,
    periods: int = 1,
    guess: Quantity | None = None,
    settle: int | None = None,
    by: Iterable[str] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Cycle: ...
@overload
def cycle(
    self: Modelled,
    period: Any = None,
    *,
    along: Mapping[str, ArrayLike],
    initial: State | None = None,
    periods: int = 1,
    guess: Quantity | None = None,
    settle: int | None = None,
    by: Iterable[str] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> CycleFamily: ...
def cycle(
    self: Modelled,
    period: Any = None,
    *,
    along: Mapping[str, ArrayLike] | None = None,
    initial: State | None = None,
    periods: int = 1,
    guess: Quantity | None = None,
    settle: int | None = None,
    by: Iterable[str] | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Cycle | CycleFamily:
    """Find a periodic motion, and decide by its Floquet multipliers whether small deviations die out.

    A driven mechanism repeats with its drives. One that nothing drives over time finds its own period: self-excited
    (an escapement, a squealing brake), or conservative, where the motion with the energy of `initial` is found.
    Newton's method solves x(T) = x(0), up to whole turns of angles on which nothing depends; stable and unstable
    motions alike.

    Args:
        period: None: that of the drives and of the loads that are tables over time, or sought if there are none; the
            name of a drive or of the joint that it drives: its period; or seconds. A conservative mechanism with a
            period in seconds: the motion of that period.
        along: name of a parameter (`m.compile().parameters`, such as "motor.velocity") -> values, at least two: the
            family of periodic motions over them, as a `CycleFamily`.
        initial: state from which the search starts. None: the drawing, assembled, which first runs for some periods,
            so that a stable motion is found if it leads to one.
        periods: how many periods of the drives the motion takes; 2 after a period doubling.
        guess: about the period of a free motion [s], where it is not to be sought in a run.
        settle: for how many periods a run goes before the search begins; None: none from `initial`, else 10, and more
            if the search fails.
        by: names of parameters, for the derivatives of the motion and of its period by them.
        parameters: as in `simulate`.

    Raises:
        ArgumentError: no periodic motion was found (what fails to come back is named), the drives have no common
            period, or a run from there comes to rest.
        EvaluationError: a run over the cycle ends early, or the motion has no derivative because it only just reaches
            an event. SingularityError: it begins in a singular position.

    Cost: that of a run over the cycle with the derivatives of its steps (`Result.sensitivities`) in each iteration,
    where these do not serve of six runs for each variable; a family about ten such for each position.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("shaken mass", gravity=None)
    >>> mass = m.add_body("mass", mass=1.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, mass, axis=(1, 0, 0))
    >>> spring = m.add_torsion_spring("S", stiffness=4.0, damping=0.4)
    >>> push = m.add_force(mass, (lambda t, state: np.cos(3.0 * t), 0, 0))
    >>> c = m.cycle()
    >>> round(c.period, 9), c.stable, round(float(abs(c.multipliers[0])), 9)  # 2 pi / 3, exp(-0.2 * 2 pi / 3)
    (2.094395102, True, 0.657783769)
    """
    model, _ = layout_of(self, "relative", parameters)
    line = None if along is None else line_of(model, along)
    first = 0.0 if line is None else float(line.asked[0])
    own = _Own(self, dict(parameters or {}), line)
    start = _fitting(own, start_of(self, initial, own.model_at(first), "relative", own.parameters_at(first)), first)
    count = run_options.count(periods, "periods")
    settling = None if settle is None else _whole(settle)
    time = None if guess is None else run_options.positive("guess", guess, "s")
    duration, kind = _duration(own, start, period, first, count)
    setting = Setting(self, own.model_at, own.parameters_at, duration)
    if line is not None:
        slopes = tuple(zip(line.names, line.slope, strict=True))
        setting = setting._replace(size=float(np.ptp(line.asked)), along=slopes)
    place, history, kind, energy = _found(setting, start, first, kind, (time, initial is not None, settling))
    _repeats(setting, place, kind)
    if line is not None:
        return cycle_family.followed(
            cycle_family.Followed(setting, kind, line, energy),
            place,
            lambda at, of: described(setting, at, of, ()),
        )
    sensitive = _derivatives(own, setting, place, kind, energy, by)
    return described(setting, place, kind, history, sensitive)


def _whole(settle: Any) -> int:
    return 0 if isinstance(settle, int) and settle == 0 and settle is not False else run_options.count(settle, "settle")


class _Own:
    """The mechanism over the line of a parameter; models are kept."""

    def __init__(self, mechanism: Modelled, parameters: Mapping[str, Any], line: Line | None) -> None:
        self.mechanism, self.parameters, self.line = mechanism, parameters, line
        self._models: dict[float, CompiledModel] = {}

    def parameters_at(self, x: float) -> dict[str, Any]:
        """All parameters at x."""
        return {**self.parameters, **({} if self.line is None else self.line.at(x))}

    def model_at(self, x: float) -> CompiledModel:
        """The compiled model at x."""
        if x not in self._models:
            if len(self._models) > STATIONS:
                self._models.clear()
            self._models[x] = layout_of(self.mechanism, "relative", self.parameters_at(x) or None)[0]
        return self._models[x]


def _fitting(own: _Own, start: State, x: float) -> State:
    """The start with positions and velocities that drives and loops allow with these parameters: a start near the
    motion serves for other parameters as well."""
    core = own.model_at(x).core
    rates = core.jacobian(start.t, start.q) @ start.v + core.rate(start.t, start.q)
    off = np.concatenate([core.constraints(start.t, start.q), rates])
    if np.abs(off).max(initial=0.0) <= EQUAL * max(1.0, float(np.abs(start.v).max(initial=0.0))):
        return start
    return assemble(own.mechanism, near=start, parameters=own.parameters_at(x) or None)


def _duration(own: _Own, start: State, period: Any, x: float, count: int) -> tuple[Callable[[float], float], Kind]:
    """How long one period of the drives takes over x, and what kind of motion it is."""
    model = own.model_at(x)
    driven = Kind(count, free=False, conservative=False)
    known: Known = {}
    if period is not None and not isinstance(period, (str, int, float)) and hasattr(period, "name"):
        period = period.name
    if isinstance(period, str) and (period in model._drawn.drives or period in model._drawn.joints):
        name = period
        if not repeats(model, start, name):
            raise ArgumentError(
                f'period: nothing drives "{name}" over time; name a drive that moves, or give seconds',
                argument="period",
            )
        return lambda x: common(repeats(own.model_at(x), start, name, known)), driven
    if period is not None:
        seconds = run_options.positive("period", period, "s")
        if seconds * seconds == 0.0:
            raise ArgumentError(f"period is {seconds:g} s; nothing moves in that time", argument="period")
        still = not _drives(model) and not _depends_on_time(model, start)
        kind = Kind(1, free=True, conservative=False, timed=True) if still else driven
        return lambda _: seconds, kind
    if repeats(model, start):
        return lambda x: common(repeats(own.model_at(x), start, None, known)), driven
    if _depends_on_time(model, start):
        found = _of_loads(model, start)
        return lambda _: found, driven
    if count > 1:
        raise ArgumentError(
            "periods counts those of drives, and nothing drives this mechanism over time; its own period is sought: "
            "give about the longer one by guess=",
            argument="periods",
        )
    return lambda _: 1.0, Kind(1, free=True, conservative=False)


def _drives(model: CompiledModel) -> bool:
    """Whether a drive moves."""
    return any(
        not isinstance(drive.motion, Constant) or drive.level != "position" for drive in model._drawn.drives.values()
    )


def _pushes(model: CompiledModel, start: State, t: float) -> Array:
    found: Array = model.core.acceleration(t, start.q, start.v)[0]
    return found


def _depends_on_time(model: CompiledModel, start: State) -> bool:
    """Whether loads change with time."""
    rows = np.array([_pushes(model, start, start.t + t) for t in PROBES])
    return bool(np.ptp(rows, axis=0).max(initial=0.0) > NEGLIGIBLE * np.abs(rows).max(initial=0.0))


def _of_loads(model: CompiledModel, start: State) -> float:
    """The period of loads that are functions of time."""
    found = repeating(lambda times: np.array([_pushes(model, start, float(t)) for t in times]), start.t)
    if not found:
        raise ArgumentError(
            "loads change with time, and no time was found after which they repeat; give period= in seconds",
            argument="period",
        )
    return found


def _found(
    setting: Setting, start: State, x: float, kind: Kind, given: tuple[float | None, bool, int | None]
) -> tuple[Start, list[float], Kind, float | None]:
    """The periodic motion, how the search went, what kind it is, and the energy that it keeps."""
    time, begun, settle = given
    if kind.free:
        return _free(setting, start, x, kind, time, settle or 0)
    period = setting.duration_at(x)
    counts = [settle] if settle is not None else [SETTLES[0]] if begun else SETTLES[1:]
    here, done = start, 0
    for i, count in enumerate(counts):
        here = shooting.settled(setting, here, x, kind.periods * period, count - done, SEEKING)
        done = count
        try:
            return *shooting.closed(setting, Start(here, x, period), kind), kind, None
        except PartitaError:
            if i + 1 == len(counts):
                raise
    raise AssertionError("at least one search")


def _free(
    setting: Setting, start: State, x: float, kind: Kind, time: float | None, settle: int
) -> tuple[Start, list[float], Kind, float | None]:
    """A motion that finds its own period, or the one of a given period."""
    here = start
    at_x = setting._replace(model_at=lambda _: setting.model_at(x), parameters_at=lambda _: setting.parameters_at(x))
    period = setting.duration_at(x)
    if not kind.timed:
        here, period, kept = guessed(at_x, here, time)
        kind = kind._replace(conservative=kept)
    else:
        kind = kind._replace(conservative=conserves(shooting.run_over(setting, Start(here, x, period), kind, OUTPUTS)))
    here = shooting.settled(setting, here, x, period, settle, SEEKING)
    energy = None
    if kind.conservative and not kind.timed:
        energy = float(shooting.energies(setting.model_at(x), [here])[0])
    place, history = shooting.closed(setting, Start(here, x, period), kind, energy=energy)
    speed = np.abs(place.state.v).max(initial=0.0)
    run = shooting.run_over(setting, place, kind, OUTPUTS)
    if np.abs(run.v).max(initial=0.0) <= EQUAL_IN_SIX_DIGITS * max(
        float(np.abs(start.v).max(initial=0.0)), float(speed), 1.0
    ):
        raise ArgumentError(
            "the search arrived at a position of rest, which repeats after any time; begin with a larger motion by "
            "initial=",
            argument="initial",
        )
    return place, history, kind, energy


def _repeats(setting: Setting, place: Start, kind: Kind) -> None:
    """Refuse what comes back while the forces on it do not, or where what a drive prescribes does not."""
    model, total = setting.model_at(place.x), place.period * kind.periods
    run = shooting.run_over(setting, place, kind, STATIONS)
    end = ended(run, place.state)
    off = model.core.displacement_between(place.state.q, end.q)
    rates = (end.v - place.state.v) * total / (2.0 * np.pi) / model.core.characteristic_displacements()
    names = model.velocity_names
    for what, values in (("", off), ("the rate of ", rates)):
        i = int(np.argmax(np.abs(values)))
        if abs(values[i]) > EQUAL_IN_SIX_DIGITS * max(1.0, float(np.abs(run.v[:, i]).max()) * total):
            raise ArgumentError(
                f"after {total:.6g} s {what}{names[i]} is {values[i]:.4g} from where it began, in radians or "
                "characteristic lengths, so nothing repeats; prescribe a motion that comes back, or take another "
                "number of periods=",
                argument="period",
            )
    turned = run.q[-1] - end.q
    whose = [name for name, x in zip(model.names, turned, strict=True) if x]
    advance = f", with {', '.join(whose)} whole turns further on," if whose else ""
    met = []
    for t, q, v in zip(run.t[1:-1], run.q[1:-1], run.v[1:-1], strict=True):
        try:
            felt = [_felt(model, *at) for at in ((float(t), q, v), (float(t + total), q + turned, v))]
        except PartitaError:
            continue  # a table that ends with the cycle, or elements that hold: seen by the return alone
        met.append(felt[0][0])
        for (what, of), here, later in zip(LEVELS.items(), *felt, strict=True):
            size = float(np.abs(here).max(initial=0.0))
            i = int(np.argmax(np.abs(later - here))) if len(here) else 0
            if len(here) and abs(later[i] - here[i]) > EQUAL_IN_SIX_DIGITS * size + NEGLIGIBLE:
                whom = (names if of == "velocities" else model.row_names)[i]
                raise ArgumentError(
                    f"loads or drives do not repeat after {total:.9g} s: in the same position{advance} {what} of "
                    f"{whom} is {here[i]:.6g} at t = {t:.4g} s and {later[i]:.6g} one period later; "
                    "give a period with which all of them repeat, and let no spring or table count turns that go on",
                    argument="period",
                )
    if kind.free or not met or not _depends_on_time(model, place.state):
        return
    if np.ptp(met, axis=0).max(initial=0.0) <= EQUAL_IN_SIX_DIGITS * float(np.abs(met).max(initial=0.0)):
        raise ArgumentError(
            f"loads or drives change over time, but nothing changes within {total:.9g} s; give the period with which "
            "they repeat",
            argument="period",
        )


LEVELS = {"the acceleration": "velocities", "the closure error": "rows", "the constraint force": "rows"}
"""What is compared one cycle later, and of what."""


def _felt(model: CompiledModel, t: float, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Accelerations, what constraints leave open, and their forces: all are the same where everything repeats."""
    vdot, multipliers = model.core.acceleration(t, q, v)
    return vdot, model.core.constraints(t, q), multipliers


def described(
    setting: Setting,
    place: Start,
    kind: Kind,
    history: Iterable[float],
    by: Mapping[str, CycleDerivative] | None = None,
) -> Cycle:
    """All about a periodic motion."""
    model = setting.model_at(place.x)
    at = shooting.returned(setting, place, kind, fine=True)
    own, trivial = split(at.matrix, kind)

    def run() -> Result:
        return shooting.run_over(setting, place, kind, OUTPUTS)

    return Cycle(
        state=place.state,
        period=place.period * kind.periods,
        periods=kind.periods,
        multipliers=own,
        matrix=at.matrix,
        variables=at.variables.labels(model.velocity_names),
        kind="conservative" if kind.conservative else "free" if kind.free else "driven",
        trivial=trivial,
        error=at.shot.error,
        method=at.shot.method,
        off=at.size,
        history=tuple(history),
        by=by or {},
        _run=run,
    )


split = cycle_family.split


class _Named(NamedTuple):
    """One number of a parameter."""

    name: str
    values: list[float]
    number: int


def _derivatives(
    own: _Own, setting: Setting, place: Start, kind: Kind, energy: float | None, by: Iterable[str] | None
) -> dict[str, CycleDerivative]:
    """Derivatives of the motion by parameters: (1 - M) dx/dp = r_p + f dT/dp, with the phase kept."""
    if by is None:
        return {}
    if not is_list(by):
        raise ArgumentError(f"by must be a list of parameters, not {shown(by)}", argument="by")
    model = own.model_at(place.x)
    known = {name: np.ravel(values).astype(float).tolist() for name, values in model.parameters.items()}
    found = {}
    for name in map(str, by):
        if name not in known:
            model.with_parameters({name: 0.0})  # says which there are
        starts, times = [], []
        for i in range(len(known[name])):
            start, time = _derivative(own, setting, place, kind, energy, _Named(name, known[name], i))
            starts.append(start)
            times.append(time * kind.periods)
        labels = chart(model, place.state).labels(model.velocity_names)
        found[name] = CycleDerivative(np.array(starts).T, np.array(times), labels)
    return found


def _derivative(
    own: _Own, setting: Setting, place: Start, kind: Kind, energy: float | None, number: _Named
) -> tuple[Array, float]:
    """Change of the start and of the duration of one run."""
    value = number.values[number.number]

    def at(x: float) -> dict[str, Any]:
        values = list(number.values)
        values[number.number] = x
        return {**own.parameters, number.name: values}

    line = _Own(own.mechanism, own.parameters, None)
    line.parameters_at = at  # type: ignore[method-assign]
    slope = [float(i == number.number) for i in range(len(number.values))]
    over = setting._replace(
        model_at=line.model_at, parameters_at=at, size=abs(value) or 1.0, along=((number.name, slope),)
    )
    if not kind.free:
        base = setting.duration_at
        over = over._replace(duration_at=lambda x: _duration_with(own, line, place, x, base(place.x), value))
    here = Start(place.state, value, place.period)
    found = shooting.returned(over, here, kind, by_x=True, fine=True)
    system = shooting.equations(over, found, kind, 1.0, energy)
    matrix, column = system.matrix[:, :-1], system.matrix[:, -1]
    step = least_squares(matrix, -column, shooting.SAME_DIRECTION) * system.sizes[:-1]
    m = found.variables.width
    if kind.free and not kind.timed:
        return step[:m], float(step[m])
    if kind.free:
        return step[:m], 0.0
    h = EQUAL_IN_SIX_DIGITS * over.size
    return step[:m], (over.duration_at(value + h) - over.duration_at(value - h)) / (2.0 * h)


def _duration_with(own: _Own, line: _Own, place: Start, x: float, base: float, value: float) -> float:
    """The period of the drives with another parameter: in proportion, if it changes with it."""
    try:
        before = repeats(line.model_at(value), place.state)
        after = repeats(line.model_at(x), place.state)
    except ArgumentError:
        return base
    if not before or not after:
        return base
    return base * common(after) / common(before)
