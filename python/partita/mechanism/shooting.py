"""Newton's method for periodic motions: x(T) = x(0) up to whole turns, with T known or sought.

driven   (M - 1) dx + r = 0                              r = x(T) - x(0) in the variables of a chart
free     (M - 1) dx + f dT + r = 0,  f0^T dx = 0         f the rates of the variables
family   the same with r_p dp, and one more equation that says where on the family
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..analyses.still import run_of
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, PartitaError
from ..results import Result
from ..results.run import Run
from ..state import State
from ..tolerance import EQUAL_IN_SIX_DIGITS
from .algebra import least_squares
from .monodromy import Chart, Setting, Shot, chart, ended, monodromy, moved, not_there, ran

Array = NDArray[np.float64]

CLOSED = 1e-11
"""A motion that comes back within this is periodic. Scale: radians; characteristic lengths; rates in a radian of the
cycle. Reason: ten times the tolerance of its run."""
CLOSED_AT_LEAST = 1e-8
"""A motion whose return no longer improves is periodic within this. Scale: as of `CLOSED`. Reason: chaotic and nearly
singular cycles amplify rounding."""
NO_PROGRESS = 0.5
"""An iteration that leaves more than this of the error has ended its descent. Scale: fraction of the error before.
Reason: Newton's method gains digits where it converges."""
LONGEST_STEP = 0.5
"""Largest change of the start in an iteration. Scale: as of `CLOSED`. Reason: half a radian, within which a motion
stays alike."""
TIME_STEP = 0.2
"""Largest change of the period in an iteration. Scale: fraction of the period. Reason: the motion beyond is another."""
SAME_DIRECTION = 1e-7
"""Equations that say less than this beside the others say nothing. Scale: fraction of the largest singular value.
Reason: the errors of single differences."""
ITERATIONS, TRIALS = 40, 8
BETTER = 1.0 - 1e-4
"""A step is accepted if it leaves less than this of the error. Scale: fraction of the error. Reason: any descent above
rounding."""


class Kind(NamedTuple):
    """What is known of a periodic motion: how many runs make it up, whether its time is sought, its energy kept."""

    periods: int
    free: bool
    conservative: bool
    timed: bool = False
    """Free, with the time given."""


class Start(NamedTuple):
    """A start of a periodic motion: the state, the parameter, the duration of one run."""

    state: State
    x: float
    period: float


class Returned(NamedTuple):
    """What happened over one cycle from a place."""

    place: Start
    variables: Chart
    duration: float
    shot: Shot
    off: Array
    """Difference of the end from the start, in the variables."""

    @property
    def time(self) -> float:
        """Of a radian of the cycle."""
        return self.duration / (2.0 * np.pi)

    @property
    def matrix(self) -> Array:
        """Monodromy matrix."""
        return self.shot.matrix

    @property
    def scales(self) -> Array:
        """Natural sizes of the variables."""
        return self.variables.scales(self.time)

    @property
    def size(self) -> float:
        """Largest error of the return, in natural sizes."""
        return float(np.abs(self.off / self.scales).max(initial=0.0))


def returned(
    setting: Setting,
    place: Start,
    kind: Kind,
    variables: Chart | None = None,
    *,
    by_x: bool = False,
    fine: bool = False,
) -> Returned:
    """Run once around, and differentiate."""
    model = setting.model_at(place.x)
    variables = chart(model, place.state) if variables is None else chart(model, place.state, variables)
    duration = kind.periods * place.period
    shot = monodromy(setting, place.state, variables, place.x, duration, by_x=by_x, fine=fine)
    off = variables.between(model, place.state, shot.end)
    return Returned(place, variables, duration, shot, off)


def gone(setting: Setting, place: Start, kind: Kind, variables: Chart) -> Array:
    """Run once around: difference of the end from the start, in the variables."""
    end = ended(ran(setting, place.state, place.x, kind.periods * place.period), place.state)
    return variables.between(setting.model_at(place.x), place.state, end)


class System(NamedTuple):
    """The equations for [dx, dT, dp], in natural sizes, and the sizes of these unknowns."""

    matrix: Array
    right: Array
    sizes: Array


def equations(setting: Setting, at: Returned, kind: Kind, span: float, energy: float | None) -> System:
    """All but the one that says where on a family; `span`: the natural size of the parameter, 0 where it is fixed."""
    m, scales = at.variables.width, at.scales
    columns = [(at.matrix - np.eye(m)) * scales]
    sizes = [scales]
    if kind.free and not kind.timed:
        columns.append((at.shot.rates * at.duration)[:, None])
        sizes.append(np.array([at.place.period]))
    if span:
        columns.append(at.shot.by * span)
        sizes.append(np.array([span]))
    matrix = np.hstack(columns) / scales[:, None]
    right = -at.off / scales
    rows = [(matrix, right)]
    if kind.free:
        first = at.shot.run
        begun = at.variables.rates(first.v[0], first.vdot[0]) / scales
        phase = np.zeros((1, matrix.shape[1]))
        phase[0, :m] = begun / (np.linalg.norm(begun) or 1.0)
        rows.append((phase, np.zeros(1)))
    if kind.conservative and energy is not None:
        own, slope = _energy(setting, at)
        row = np.zeros((1, matrix.shape[1]))
        size = float(np.abs(slope * scales).max(initial=0.0)) or 1.0
        row[0, :m] = slope * scales / size
        rows.append((row, np.array([(energy - own) / size])))
    return System(np.vstack([a for a, _ in rows]), np.concatenate([b for _, b in rows]), np.concatenate(sizes))


def _energy(setting: Setting, at: Returned) -> tuple[float, Array]:
    """Energy at the start, and its derivatives by the variables."""
    model, state = setting.model_at(at.place.x), at.place.state
    scales = at.variables.scales(at.time)
    states = [state]
    for j in range(at.variables.width):
        for sign in (1.0, -1.0):
            change = np.zeros(at.variables.width)
            change[j] = sign * ENERGY_STEP * scales[j]
            states.append(moved(model, state, at.variables, change))
    found = energies(model, states)
    return float(found[0]), (found[1::2] - found[2::2]) / (2.0 * ENERGY_STEP * scales)


ENERGY_STEP = 1e-5
"""Change of a state by which its energy is differentiated. Scale: natural sizes of the variables. Reason: ten digits of
a central difference."""


def energies(model: CompiledModel, states: list[State]) -> Array:
    """Total energy of each state."""
    q, v = np.array([one.q for one in states]), np.array([one.v for one in states])
    t = np.array([one.t for one in states])
    run = run_of(Run, model, t, q, v, np.zeros_like(v), np.full((len(t), model.core.rows), np.nan))
    return np.asarray(run.energy.total)


def solved(system: System) -> Array:
    """The least change that satisfies the equations, in units."""
    step = least_squares(system.matrix, system.right, SAME_DIRECTION)
    longest = float(np.abs(step).max(initial=0.0))
    if longest > LONGEST_STEP:
        step *= LONGEST_STEP / longest
    found: Array = step * system.sizes
    return found


def taken(setting: Setting, at: Returned, kind: Kind, step: Array, span: float, part: float = 1.0) -> Start:
    """The place after a part of a step of the unknowns."""
    m = at.variables.width
    place, rest = at.place, part * step[m:]
    period, x = place.period, place.x
    if kind.free and not kind.timed:
        period += float(np.clip(rest[0], -TIME_STEP * period, TIME_STEP * period))
        rest = rest[1:]
    if span:
        x += float(rest[0])
    if not kind.free:
        period = setting.duration_at(x)
    state = moved(setting.model_at(x), place.state, at.variables, part * step[:m])
    return Start(state, x, period)


def closed(
    setting: Setting, place: Start, kind: Kind, *, energy: float | None = None, iterations: int = ITERATIONS
) -> tuple[Start, list[float]]:
    """The periodic motion that Newton's method arrives at from a place, with the errors on the way.

    Raises `ArgumentError` naming what fails to come back.
    """
    history: list[float] = []
    model = setting.model_at(place.x)
    variables: Chart | None = None
    for _ in range(iterations):
        at = returned(setting, place, kind, variables)
        variables = at.variables if variables is None else variables
        history.append(at.size)
        if at.size <= CLOSED or (
            at.size <= CLOSED_AT_LEAST and len(history) > 1 and at.size > NO_PROGRESS * min(history[:-1])
        ):
            return at.place, history
        step = solved(equations(setting, at, kind, 0.0, energy))
        part, best = 1.0, at.size
        for _ in range(TRIALS):
            try:
                new = taken(setting, at, kind, step, 0.0, part)
                size = float(np.abs(gone(setting, new, kind, variables) / at.scales).max(initial=0.0))
            except PartitaError:
                size = np.inf
            if size < BETTER * best or size <= CLOSED:
                break
            part *= 0.5
        else:
            if at.size <= CLOSED_AT_LEAST:
                return at.place, history
            break
        place, variables = new, None
    at = returned(setting, place, kind)
    words = not_there(model.velocity_names, at.variables, at.off, at.time)
    raise ArgumentError(
        f"no periodic motion was found: after {len(history)} iterations and {kind.periods * place.period:.6g} s "
        f"{words} (errors in natural sizes: first {history[0]:.2g}, smallest {min(history):.2g}); "
        "begin nearer to it with initial=, let it settle for more periods with settle=, or take another "
        "number of periods=",
        argument="initial",
    )


def settled(setting: Setting, state: State, x: float, period: float, count: int, rtol: float) -> State:
    """The state after so many periods, at the time of the start."""
    here, core = state, setting.model_at(x).core
    for _ in range(count):
        here = ended(ran(setting, here, x, period, rtol), here)
        if np.abs(core.constraints(here.t, here.q)).max(initial=0.0) > EQUAL_IN_SIX_DIGITS:
            off = core.displacement_between(state.q, here.q)
            i = int(np.argmax(np.abs(off)))
            raise ArgumentError(
                f"after {period:.6g} s {setting.model_at(x).velocity_names[i]} is {off[i]:.4g} from where it began, in "
                "radians or characteristic lengths, and couplings or drives do not let it begin there anew; take "
                "another number of periods=, after which all gears are back, or another period=",
                argument="periods",
            )
    return here


def run_over(setting: Setting, place: Start, kind: Kind, outputs: int) -> Result:
    """The run over a whole cycle, with so many outputs."""
    return ran(setting._replace(t_eval=outputs - 2), place.state, place.x, kind.periods * place.period)
