"""How the end of a run depends on its start and on parameters: its monodromy matrix in independent coordinates.

All else about periodic motions needs nothing but `Chart` and `monodromy`. The derivatives are those of the steps of the
run; where these do not serve, as for spatial rotations, extrapolated central differences of tight runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..builder.records import DriveRecord
from ..errors import EvaluationError, PartitaError, SingularityError
from ..limits import advice, limit
from ..naming import joint_units
from ..results import Result
from ..results.sensitivities import Held, Number, derivatives
from ..state import State
from ..tolerance import SUM_ROUNDING
from .algebra import inverse, null_space, pivots
from .models import Modelled
from .solve import simulate

Array = NDArray[np.float64]

TIGHT = 1e-12
"""Relative tolerance of the runs of a cycle. Scale: fraction of what is integrated. Reason: differences of runs keep
nine digits, and a periodic motion closes to eleven."""
TIGHT_NEAR_ZERO = 1e-14
"""Absolute tolerance of the runs of a cycle. Scale: radians; characteristic length. Reason: a hundredth of `TIGHT`, so
that it matters next to zero only."""
FIRST_DIFFERENCE = 1e-2
"""Largest change of the start in a difference; further ones are halved. Scale: radians; characteristic lengths; for
rates the same in a radian of the cycle; for parameters fraction of their size. Reason: three steps cancel errors up to
the sixth power, which meet rounding at nine digits."""
ROUGH_DIFFERENCE = 1e-4
"""Change of the start in a single difference, for iterations. Scale: as of `FIRST_DIFFERENCE`. Reason: seven digits,
with which Newton's method gains as many in each iteration."""
DURATION_STEP = 1e-4
"""Change of a parameter by which the duration of a cycle is differentiated. Scale: fraction of the size of the
parameter. Reason: eight digits of what is a smooth formula."""
HALVINGS = 3
"""Differences of one derivative."""
CLOSINGS = 8
"""Corrections of a displaced start."""
UNUSABLE = 1e-8
"""Coordinates whose motion is less determined by the others than this are no choice. Scale: fraction of the best.
Reason: half of the digits are left."""


class Chart(NamedTuple):
    """Independent positions and rates about a state: the variables of a cycle.

    Attributes:
        positions, velocities: numbers of the velocities whose positions and whose rates are the variables.
        tangent: (nv, k): displacements for each independent position, then for each held one.
        held: velocities whose rate a drive prescribes: their positions begin at the same place.
        sizes: (nv,): natural displacements of all velocities, 1 for an angle.
    """

    positions: NDArray[np.int_]
    velocities: NDArray[np.int_]
    tangent: Array
    held: tuple[int, ...]
    sizes: Array

    @property
    def width(self) -> int:
        """Number of variables."""
        return len(self.positions) + len(self.velocities)

    def scales(self, time: float) -> Array:
        """Natural sizes of the variables, rates in this time."""
        return np.concatenate([self.sizes[self.positions], self.sizes[self.velocities] / time])

    def labels(self, names: Sequence[str]) -> tuple[str, ...]:
        """Names of the variables."""
        return (*(names[i] for i in self.positions), *(f"{names[i]}'" for i in self.velocities))

    def between(self, model: CompiledModel, start: State, end: State) -> Array:
        """Difference of two states in the variables; angles up to whole turns, where these do not count."""
        moved = model.core.displacement_between(start.q, end.q) * self.sizes
        return np.concatenate([moved[self.positions], end.v[self.velocities] - start.v[self.velocities]])

    def rates(self, v: Array, vdot: Array) -> Array:
        """Rates of the variables."""
        return np.concatenate([v[self.positions], vdot[self.velocities]])


def chart(model: CompiledModel, at: State, like: Chart | None = None) -> Chart:
    """The best choice of variables at a state; with `like` the variables of that one."""
    core = model.core
    sizes = core.characteristic_displacements()
    rates = np.asarray(core.at(at.t, at.q, None)["D"]).T
    # rows of positions come before those of rates alone
    count = len(core.constraints(at.t, at.q))
    positions = (
        rates
        if count == core.rows
        else null_space(core.jacobian(at.t, at.q)[:count] * sizes, UNUSABLE) * sizes[:, None]
    )
    held = like.held if like is not None else tuple(_held(model))
    free = positions
    if held:
        # what keeps the driven coordinates where they begin
        free = positions @ null_space(positions[list(held)], UNUSABLE)
        if (rank := positions.shape[1] - free.shape[1]) < len(held):
            held = tuple(held[i] for i in sorted(pivots(positions[list(held)].T)[:rank]))
    chosen = _best(free, sizes) if like is None else like.positions
    driven = _best(rates, sizes) if like is None else like.velocities
    own = [*chosen, *held]
    block = positions[own]
    if block.size and np.linalg.cond(block / sizes[own, None]) > 1.0 / UNUSABLE:
        raise SingularityError(
            f"at t = {at.t:g} s the cycle cannot be described by "
            f"{', '.join(model.velocity_names[i] for i in chosen)}: the position is singular in them"
        )
    tangent = positions @ inverse(block) if block.size else positions
    return Chart(chosen, driven, tangent, held, sizes)


def _held(model: CompiledModel) -> Iterable[int]:
    """Velocities of the state whose rate alone is prescribed."""
    spans = {joint["name"]: joint["state_v"] for joint in model.summary["joints"]}
    for drive in model._drawn.drives.values():
        if isinstance(drive, DriveRecord) and drive.level in ("velocity", "acceleration"):
            span = spans.get(drive.measure.get("joint", ""))
            if drive.measure["of"] == "joint" and span is not None:
                yield int(span[0]) + int(drive.measure["coordinate"])


def _best(basis: Array, sizes: Array) -> NDArray[np.int_]:
    """As many rows as columns, by pivots."""
    if not basis.shape[1]:
        return np.zeros(0, dtype=int)
    return np.sort(pivots((basis / sizes[:, None]).T)[: basis.shape[1]])


def moved(model: CompiledModel, at: State, by: Chart, change: Array) -> State:
    """The state whose variables differ by `change`, with all loops closed, of this model."""
    core = model.core
    count = len(by.positions)
    own = [*by.positions, *by.held]
    wanted = np.concatenate([change[:count], np.zeros(len(by.held))])
    q, left = at.q, by.tangent @ wanted
    for _ in range(CLOSINGS):
        q = core.displaced(at.t, q, left[None, :])[0]
        off = wanted - (core.displacement_between(at.q, q) * by.sizes)[own]
        if np.abs(off / by.sizes[own]).max(initial=0.0) <= SUM_ROUNDING:
            break
        left = by.tangent @ off
    return State(at.t, q, _rated(model, at.t, q, by, at.v[by.velocities] + change[count:]), layout=at._layout)


def _rated(model: CompiledModel, t: float, q: Array, by: Chart, wanted: Array) -> Array:
    """Velocities with these independent ones."""
    here = model.core.at(t, q, None)
    offset = np.zeros(model.core.nv)
    offset[here["dependent"]] = here["eta"]
    directions = np.asarray(here["D"])
    if not len(by.velocities):
        return offset
    own = inverse(directions[:, by.velocities].T) @ (wanted - offset[by.velocities])
    found: Array = directions.T @ own + offset
    return found


class Shot(NamedTuple):
    """A run and how its end depends on its start.

    Attributes:
        run: the run.
        end: state at its end, at the time of the start.
        matrix: (m, m): derivatives of the variables at the end by those at the start.
        by: (m, p): derivatives by the parameters.
        rates: (m,): rates of the variables at the end.
        error: estimated error of `matrix`, in natural sizes.
        method: "exact": derivatives of the steps of the run, or "differences".
    """

    run: Result
    end: State
    matrix: Array
    by: Array
    rates: Array
    error: float
    method: str


Along = Callable[[float], Mapping[str, Any]]
"""Parameters at a place x along their line."""


class Setting(NamedTuple):
    """The mechanism with its parameters as functions of a number, and how long a run takes with them."""

    mechanism: Modelled
    model_at: Callable[[float], CompiledModel]
    parameters_at: Along
    duration_at: Callable[[float], float]
    """Of one run, at x."""
    size: float = 1.0
    """Natural size of a change of x."""
    along: tuple[tuple[str, Sequence[float]], ...] = ()
    """Changes of parameters with x."""
    t_eval: int = 0
    """Outputs of a run between its start and its end."""


def ran(setting: Setting, start: State, x: float, duration: float, rtol: float = TIGHT) -> Result:
    """One run, which must arrive."""
    times = np.linspace(start.t, start.t + duration, setting.t_eval + 2)
    atol = rtol * TIGHT_NEAR_ZERO / TIGHT
    run = simulate(
        setting.mechanism,
        duration,
        t_eval=times,
        initial=start,
        rtol=rtol,
        atol=atol,
        parameters=setting.parameters_at(x) or None,
        max_steps=limit("cycle_steps"),
    )
    if run.status == "max-steps":
        raise EvaluationError(
            f"a run over the cycle, {duration:g} s, comes in {run.counters['steps']} steps to t = {run.t[-1]:g} s "
            f"only: is that its period? If it is, {advice('cycle_steps', 10 * limit('cycle_steps'))}",
            t=float(run.t[-1]),
            where="cycle",
        )
    if not run.success:
        raise EvaluationError(
            f"a run over the cycle ends early, at t = {run.t[-1]:g} s: {run.message}; begin nearer to the cycle with "
            "initial=",
            t=float(run.t[-1]),
            where="cycle",
        )
    return run


def ended(run: Result, start: State, like: State | None = None) -> State:
    """The end of a run as a start: at its time, angles turned back by whole turns to be near those of the start, or of
    another state."""
    q = run.q[-1].copy()
    angles = angles_of(run.summary)
    near = (start if like is None else like).q[angles]
    q[angles] -= 2.0 * np.pi * np.round((q[angles] - near) / (2.0 * np.pi))
    return State(start.t, q, run.v[-1], layout=start._layout)


def angles_of(summary: Mapping[str, Any]) -> list[int]:
    """Coordinates of the state that are angles."""
    found: list[int] = []
    for joint in summary["joints"]:
        if joint["state_q"] is not None:
            units = joint_units(joint)[0]
            found += [joint["state_q"][0] + i for i, unit in enumerate(units) if unit == "rad"]
    return found


def monodromy(
    setting: Setting,
    start: State,
    variables: Chart,
    x: float,
    duration: float,
    *,
    by_x: bool = False,
    fine: bool = True,
) -> Shot:
    """Run for this duration, and differentiate its end by the variables at its start, and by x where it is asked for:
    along with x the duration of a run changes as `setting.duration_at` says.

    The derivatives are those of the steps that the run took. Where these do not serve, they are central differences,
    `fine=False` with one step alone.
    """
    base = ran(setting, start, x, duration)
    held = _coordinates(setting.model_at(x), variables)
    if held is not None:
        try:
            return _by_steps(setting, base, start, variables, held, (x, duration), by_x)
        except PartitaError:
            if len(base.events):
                raise
    return by_differences(setting, base, start, variables, x, duration, by_x=by_x, fine=fine)


def _coordinates(model: CompiledModel, variables: Chart) -> list[Held] | None:
    """The variables as joints with their coordinates; None where some are spatial rotations, or positions and rates
    differ."""
    if not np.array_equal(variables.positions, variables.velocities):
        return None
    found = []
    for i in variables.positions.tolist():
        for joint in model.summary["joints"]:
            span, own = joint["state_v"], joint["state_q"]
            if span is not None and span[0] <= i < span[0] + span[1]:
                if own[1] != span[1]:
                    return None
                found.append(Held(model.velocity_names[i], joint["name"], i - span[0], {"velocity": i}))
    return found if len(found) == len(variables.positions) else None


def _by_steps(
    setting: Setting,
    base: Result,
    start: State,
    variables: Chart,
    held: Sequence[Held],
    at: tuple[float, float],
    by_x: bool,
) -> Shot:
    """The end of a run by its start and by x, by the steps that it took."""
    x, duration = at
    unit = np.eye(len(held)).tolist()
    directions: list[dict[str, Any]] = [{word: row} for word in ("start", "start_rates") for row in unit]
    if by_x:
        directions.append({"parameters": [(name, list(row)) for name, row in setting.along]})
    numbers = [Number(i, (), (one,)) for i, one in enumerate(directions)]
    measures = [{"of": "joint", "joint": one.joint, "coordinate": one.coordinate} for one in held]
    observables = [{"formula": {reads: measure}} for reads in ("position", "velocity") for measure in measures]
    found = derivatives(base, numbers, held, observables, base.t[-1:]).along[0]
    width = variables.width
    rates = variables.rates(base.v[-1], base.vdot[-1])
    by = np.zeros((width, int(by_x)))
    if by_x:
        h = DURATION_STEP * (min(setting.size, abs(x)) if x else setting.size)
        change = (setting.duration_at(x + h) - setting.duration_at(x - h)) / (2.0 * h)
        by[:, 0] = found[:, width] + rates * duration * change / setting.duration_at(x)
    scales = variables.scales(duration / (2.0 * np.pi))
    size = float(np.abs(found[:, :width] * scales / scales[:, None]).max(initial=1.0))
    return Shot(base, ended(base, start), found[:, :width], by, rates, TIGHT * size, "exact")


def by_differences(
    setting: Setting,
    base: Result,
    start: State,
    variables: Chart,
    x: float,
    duration: float,
    *,
    by_x: bool = False,
    fine: bool = True,
) -> Shot:
    """The end of a run by its start and by x, by central differences with three steps, extrapolated to none;
    `fine=False`: with one step."""
    model = setting.model_at(x)
    end = ended(base, start)
    time = duration / (2.0 * np.pi)
    scales = variables.scales(time)
    events = len(base.events)
    steps = [FIRST_DIFFERENCE * 0.5**i for i in range(HALVINGS)] if fine else [ROUGH_DIFFERENCE]

    def beside(change: Array, dx: float) -> Array:
        at = setting.model_at(x + dx) if dx else model
        own = duration * (setting.duration_at(x + dx) / setting.duration_at(x)) if dx else duration
        run = ran(setting, moved(at, start, variables, change), x + dx, own)
        if len(run.events) != events:
            raise EvaluationError(
                f"the motion has no derivative by its start: beside it {len(run.events)} events happen and not "
                f"{events}, so one of them is only just reached (it grazes); change a parameter a little, or the "
                "initial state",
                t=start.t,
                where="cycle",
            )
        return variables.between(model, end, ended(run, start, end))

    def derivative(of: Callable[[float], tuple[Array, float]], size: float) -> tuple[Array, Array]:
        """And the change by the last extrapolation."""
        rows = [(beside(*of(h * size)) - beside(*of(-h * size))) / (2.0 * h * size) for h in steps]
        last = rows[-1]
        for order in range(1, len(rows)):
            factor = 4.0**order
            rows = [(factor * b - a) / (factor - 1.0) for a, b in pairwise(rows)]
            last, before = rows[-1], last
        return last, (np.abs(last - before) if len(steps) > 1 else np.full(len(last), np.nan))

    columns, errors = [], [0.0]
    none = np.zeros(variables.width)
    for j in range(variables.width):
        one = np.zeros(variables.width)
        one[j] = 1.0
        column, off = derivative(lambda h, one=one: (h * one, 0.0), float(scales[j]))  # type: ignore[misc]
        columns.append(column)
        errors.append(float(np.max(off * scales[j] / scales)))
    size = min(setting.size, abs(x)) if x else setting.size
    by = [derivative(lambda h: (none, h), size)[0]] if by_x else []
    matrix = np.array(columns).T.reshape(variables.width, variables.width)
    rates = variables.rates(base.v[-1], base.vdot[-1])
    slopes = np.array(by).T.reshape(variables.width, len(by))
    return Shot(base, end, matrix, slopes, rates, max(errors), "differences")


def not_there(names: Sequence[str], variables: Chart, off: Array, time: float) -> str:
    """Which variable fails to come back, and by how much."""
    i = int(np.argmax(np.abs(off) / variables.scales(time)))
    label = variables.labels(names)[i]
    what = f"the rate of {label[:-1]}" if i >= len(variables.positions) else label
    return f"{what} comes back off by {off[i]:.3g}"
