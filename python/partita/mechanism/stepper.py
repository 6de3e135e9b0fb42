"""A motion step by step, for control loops."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..builder.compiled import CompiledModel
from ..builder.records import ForceRecord, TorqueRecord
from ..builder.values import Constant
from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import floats, real, shown
from ..results import Result
from ..state import Layout, State
from .models import Modelled, layout_of
from .solve import start_of

Array = NDArray[np.float64]
_AXES = "xyz"


def inputs(self: Modelled) -> tuple[str, ...]:
    """Names of what a stepper may be given: torques along joint coordinates that are numbers, and components of forces
    that are (`F.x`, `F.y`, `F.z`), in the order in which they were added."""
    return tuple(_places(self))


def _places(m: Modelled) -> dict[str, tuple[int, int]]:
    """Each input: number of the force, number of the component."""
    found: dict[str, tuple[int, int]] = {}
    for i, (name, record) in enumerate(m._description.forces.items()):
        match record:
            case TorqueRecord(value=Constant(), over=None):
                found[name] = i, 0
            case ForceRecord(value=tuple() as value):
                numbers = [k for k, one in enumerate(value) if isinstance(one, Constant)]
                found.update({f"{name}.{_AXES[k]}": (i, k) for k in numbers})
    return found


class JointMotion(NamedTuple):
    """A joint where a stepper stands: floats where it has one coordinate, else arrays."""

    position: Any
    """[rad] or [m]; of a turn in space a quaternion, scalar first. Angles of joints that close loops in space lie
    within half a turn either way."""
    velocity: Any
    """[rad/s] or [m/s]."""


class Stepper:
    """A mechanism that moves on by `dt` at each call of `step`, made by `Mechanism.stepper`.

    It works on a thread of its own, so it can be neither copied nor pickled and does not live on in a forked process.
    """

    def __init__(
        self,
        model: CompiledModel,
        layout: Layout,
        start: State,
        places: Mapping[str, tuple[int, int]],
        options: dict[str, Any],
        dt: float,
        substeps: int,
        record: bool,
    ) -> None:
        self._model, self._layout, self._options = model, layout, options
        self._dt, self._record = dt, record
        self._inputs = tuple(places)
        self._core = model._stepping(
            json.dumps(options), dt, substeps, list(places.values()), start.t, start.q, start.v, record
        )
        self._held = np.zeros(len(places))
        self._start = start
        self._given: list[list[float]] = []
        self._times: list[float] = [start.t]
        self._now: State | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, in the order in which `step` takes them."""
        return self._inputs

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self._dt

    @property
    def state(self) -> State:
        """Where it stands: closed to round-off, usable as `initial` of a run."""
        if self._now is None:
            t, q, v = self._core.state()
            self._now = State(t, q, v, layout=self._layout)
        return self._now

    @property
    def time(self) -> float:
        """[s]."""
        return self.state.t

    @property
    def q(self) -> Array:
        """Coordinates (nq,)."""
        return self.state.q

    @property
    def v(self) -> Array:
        """Velocities (nv,)."""
        return self.state.v

    def joint(self, name: Any) -> JointMotion:
        """Position and velocity of a joint, one that closes a loop too; `UnknownNameError` with the nearest names."""
        joints = [joint["name"] for joint in self._model.summary["joints"]]
        j = index_of(str(name), joints, "joint")
        now = self.state
        found = self._model.core.joints(np.array([now.t]), now.q[None], now.v[None], [j])
        return JointMotion(_part(found["joint_position"][0]), _part(found["joint_velocity"][0]))

    def step(self, u: ArrayLike | Mapping[str, float] | None = None) -> State:
        """Go on by `dt` with the inputs held at `u`, and return the state there.

        Args:
            u: a number for each of `inputs`, in their order; or a dict of some of them, the others stay as they are
                held; None: all stay. At the start they are 0.

        Raises:
            ArgumentError: another number of inputs, NaN or infinity. UnknownNameError: no input has that name.
            SingularityError, EvaluationError: the step leads into a position that cannot be passed, a function fails.

        After an error the state and the inputs held are those before.
        """
        wanted = self._wanted(u)
        self._core.step(wanted)
        self._held, self._now = wanted, None
        if self._record:
            self._given.append(wanted.tolist())
            self._times.append(self.state.t)
        return self.state

    def reset(self, initial: State | None = None) -> State:
        """Begin again at a state, or where it began; what was kept for `result` is dropped, the inputs are 0.

        Raises `ArgumentError` for a state of another model.
        """
        start = self._start if initial is None else initial
        if not isinstance(start, State) or start.names != self._model.names:
            raise ArgumentError(
                f"initial must be a State with the coordinates {', '.join(self._model.names)}, as assemble() or "
                f"step() return it, not {shown(initial)}",
                argument="initial",
            )
        self._core.begin(start.t, np.ascontiguousarray(start.q), np.ascontiguousarray(start.v))
        self._held, self._now = np.zeros(len(self._inputs)), None
        self._given, self._times = [], [self.state.t]
        return self.state

    def result(self) -> Result:
        """All steps since the start or the last `reset` as a `Result`: its outputs are the steps, reactions and sensors
        at each are those with the inputs held from there on (at the last: up to there).

        Raises `ArgumentError` where nothing was recorded.
        """
        if not self._record:
            raise ArgumentError("nothing was recorded; make the stepper with record=True", argument="record")
        if not self._given:
            raise ArgumentError("there is no step yet to make a result of; call step", argument="record")
        raw, core = self._core.result(self._times, self._given)
        model = self._model
        raw["notes"] = [*(note for note in model.notes if note not in raw["notes"]), *raw["notes"]]
        options = {**self._options, "t0": self._times[0], "t_end": self._times[-1], "coordinates": model.coordinates}
        return Result.from_run(
            raw, model=core, summary=model.summary, spec=core.description, options=options, sensors=model.sensors
        )

    def _wanted(self, u: Any) -> Array:
        if u is None:
            return self._held
        if isinstance(u, Mapping):
            wanted = self._held.copy()
            for name, value in u.items():
                wanted[index_of(str(name), self._inputs, "input")] = _number(str(name), value)
            return wanted
        try:
            wanted = floats(u)
        except TypeError as error:
            raise ArgumentError(f"u must be made of numbers, not {shown(u)}", argument="u") from error
        if wanted.shape != (len(self._inputs),):
            raise ArgumentError(
                f"u has the shape {wanted.shape}; it must be {len(self._inputs)} numbers: {', '.join(self._inputs)}",
                argument="u",
            )
        for name, value in zip(self._inputs, wanted, strict=True):
            _number(name, value)
        return np.ascontiguousarray(wanted)

    def __reduce__(self) -> Any:
        raise ArgumentError("a stepper cannot be pickled or copied; keep its state", argument="stepper")

    def __repr__(self) -> str:
        return f"<stepper of {self._model.summary['name']!r} at t = {self.time:g} s, inputs: {', '.join(self._inputs)}>"


def _number(name: str, value: Any) -> float:
    try:
        number = real(value)
    except TypeError as error:
        raise ArgumentError(f'input "{name}" must be a number, not {shown(value)}', argument="u") from error
    if not np.isfinite(number):
        raise ArgumentError(f'input "{name}" is {number}; give a finite number', argument="u")
    return number


def _part(values: Array) -> Any:
    return float(values[0]) if values.size == 1 else values


def stepper(
    self: Modelled,
    dt: float,
    *,
    inputs: Iterable[Any] | None = None,
    initial: State | None = None,
    method: str = "rk4",
    substeps: int = 2,
    coordinates: str = "relative",
    exchange: float = 1.25,
    parameters: Mapping[str, ArrayLike] | None = None,
    record: bool = True,
) -> Stepper:
    """A motion to be stepped by `dt` from outside, for control loops: `sim.step(u)`.

    Each step takes `substeps` equal steps of an explicit method, with the inputs held; the loops are closed to
    round-off after each of them, and coordinates are exchanged when the criterion says so, as in `simulate`. So the
    work of a step is bounded, and its error is of the order of the method in dt / substeps: nothing controls it. Stiff
    mechanisms need short steps. Prefer `simulate` where what acts is known beforehand.

    Args:
        dt: length of a step [s].
        inputs: which of `Mechanism.inputs` the steps are given; None: all of them. Drives prescribe a motion and are
            no inputs; they go on as drawn.
        initial: state to start from; None: the drawing, assembled, at rest.
        method: "rk4" (order 4, the default), "tsit5", "dopri5" (order 5), "dop853" (order 8).
        substeps: steps of the method in each dt, 1 to 1000.
        coordinates, exchange, parameters: as in `simulate`.
        record: keep every step for `result`; without, nothing grows however long it runs.

    Raises:
        ArgumentError: a number out of range, a state of another model; a structure, which cannot move.
        UnknownNameError: no input has that name. SingularityError: the start is a singular position.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> motor = m.add_torque(hinge, 0.0, name="motor")
    >>> sim = m.stepper(1e-3, inputs=[motor])
    >>> for _ in range(100):
    ...     angle, rate = sim.joint("A")
    ...     state = sim.step([4.905 - 50.0 * angle - 5.0 * rate])
    >>> bool(abs(sim.joint("A").position) < 1e-3), sim.result().success
    (True, True)
    """
    length = run_options.positive("dt", dt)
    if isinstance(substeps, bool) or not isinstance(substeps, int | np.integer) or not 1 <= substeps <= 1000:
        raise ArgumentError(f"substeps is {shown(substeps)}; it must be an integer, 1 to 1000", argument="substeps")
    if not isinstance(record, bool | np.bool_):
        raise ArgumentError(f"record is {shown(record)}; it must be True or False", argument="record")
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, layout = layout_of(self, wanted, parameters)
    start = start_of(self, initial, model, wanted, parameters)
    step = length / int(substeps)
    options = run_options.options(
        start.t, length, model.velocity_names, method=method, exchange=exchange, step=step, rtol=1e-8, atol=1e-10
    )
    places = _chosen(_places(self), inputs)
    return Stepper(model, layout, start, places, options, length, int(substeps), bool(record))


def _chosen(known: dict[str, tuple[int, int]], wanted: Any) -> dict[str, tuple[int, int]]:
    """The inputs that were asked for."""
    if wanted is None:
        return known
    if isinstance(wanted, str | bytes) or not isinstance(wanted, Iterable):
        message = f"inputs must be a list of names such as {list(known)[:2]}, not {shown(wanted)}"
        raise ArgumentError(message, argument="inputs")
    names = [str(item) for item in wanted]
    if len(set(names)) < len(names):
        raise ArgumentError(f"inputs names one twice: {', '.join(names)}", argument="inputs")
    every = list(known)
    return {name: known[every[index_of(name, every, "input")]] for name in names}
