"""A motion step by step, for control loops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..events import Observed, listed
from ..naming import index_of
from ..numeric import floats, real, shown
from ..results import Result
from ..results.events import Events, events_of, written
from ..sensing import Reader, StateSignals, at_once, plain
from ..state import Layout, State
from ..tolerance import ATOL, RTOL
from ..units import Quantity
from ..viewer.hints import looking
from ..viewer.live import LiveView, Poses
from .events import observed, set_by
from .inputs import Courses, Input, chosen, inputs_of
from .models import Modelled
from .solve import begun

Array = NDArray[np.float64]

_PLACES = {"body_position": (3,), "body_rotation": (3, 3)}


def inputs(self: Modelled) -> tuple[str, ...]:
    """Names of possible inputs of a stepper: torques along joint coordinates that are numbers, components of forces
    that are (`F.x`, `F.y`, `F.z`), followed by the drives of positions, velocities and accelerations, each in the order
    in which they were added. A drive that shares its name with one of the others is "drive NAME"."""
    return tuple(inputs_of(self._description))


class JointMotion(NamedTuple):
    """A joint at the state of a stepper: floats where it has one coordinate, else arrays."""

    position: Any
    """[rad] or [m]; of a spatial rotation a quaternion, scalar first. Angles of joints that close spatial loops lie
    within half a turn either way."""
    velocity: Any
    """[rad/s] or [m/s]."""


class Stepper:
    """A mechanism that advances by `dt` at each call of `step`, made by `Mechanism.stepper`.

    It can be neither copied nor pickled. Threads may share it: their steps come one after the other. Functions of the
    model may not step the stepper that calls them.
    """

    def __init__(
        self,
        models: tuple[CompiledModel, CompiledModel],
        layout: Layout,
        start: State,
        inputs: Mapping[str, Input],
        options: run_options.Options,
        dt: float,
        substeps: int,
        record: bool,
        events: Observed | None,
        remarks: Sequence[str],
    ) -> None:
        # the second one has the drives by which events act
        model, self._model = models
        self._layout, self._options = layout, options
        self._watched, self._remarks = events, list(remarks)
        self._dt, self._record = dt, record
        self._inputs, self._courses = tuple(inputs), Courses(inputs, model)
        self._numbers, self._held = self._courses.first(self._signals(start))
        self._core = model._stepping(
            options.core,
            dt,
            substeps,
            self._courses.indices,
            self._numbers.tolist(),
            start.t,
            start.q,
            start.v,
            record,
            None if events is None else events.core,
            None if events is None or events.acts is None else (events.drives, events.acts, events.decisions),
        )
        self._start = start
        self._given: list[list[float]] = []
        self._times: list[float] = [start.t]
        self._now: State | None = None
        self._here: Result | None = None
        self._view: LiveView | None = None
        self._looks: dict[str, Any] = {}

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
        """Its current state: closed to round-off, usable as `initial` of a run."""
        if self._now is None:
            self._now = State.computed(*self._core.state(), self._layout)
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

    @property
    def events(self) -> Events:
        """What happened within the last step, in the order of time: `sim.events[0].t`, `sim.events["top"]`.

        The step ends at its own time whatever happens within it; `result().events` are those of all steps."""
        if self._watched is None:
            return events_of({}, self._layout)
        return events_of(written(self._watched.names, *self._core.occurred(), self._model.summary), self._layout)

    def joint(self, name: Any) -> JointMotion:
        """Position and velocity of a joint of the tree or of a loop; `UnknownNameError` suggests the nearest names."""
        joints = [joint["name"] for joint in self._model.summary["joints"]]
        j = index_of(str(name), joints, "joint")
        now = self.state
        found = self._model.core.motion(np.array([now.t]), now.q[None], now.v[None]).joints([j])
        return JointMotion(_part(found["joint_position"][0]), _part(found["joint_velocity"][0]))

    def sensor(self, name: Any) -> Any:
        """The value of a sensor at the current state: a float or an array, see `Mechanism.add_sensor`.

        Sensors of positions and velocities cost almost nothing. Those that need accelerations, reactions or forces use
        the inputs of the last step and cost one evaluation with multipliers, which all such sensors of one instant
        share. Raises `UnknownNameError` with the most similar names.
        """
        sensors = self._model.sensors
        names = list(sensors)
        name = names[index_of(str(name), names, "sensor")]
        if at_once(sensors[name], sensors):
            return plain(Reader(sensors, self._signals(self.state)).read(name))
        if self._here is None:
            self._here = self._reported(*self._core.here(), self.time)
        return plain(self._here.sensor(name).values[0])

    def step(self, u: ArrayLike | Mapping[str, float] | None = None) -> State:
        """Advance by `dt` with the inputs `u`, and return the new state.

        An effort is constant over the step. A drive continues from its present position, without a jump of its rate.
        For a velocity drive the rate changes linearly and has the given value at the end of the step, as in an FMU; the
        position follows. For an acceleration drive the acceleration is the given one; its rate follows. For a position
        drive the position has the given value at the end of the step, and the rate there is the mean rate of the step.

        Args:
            u: one number for each of `inputs`, in their order [N, N m; for drives the unit of what they prescribe: m,
                rad, m/s, ...]; or a dict of some of them, the others keep their values; None: all keep their values.
                Initially efforts have the values with which they were added, accelerations are 0, and positions and
                velocities those of the initial state.

        Raises:
            ArgumentError: a wrong number of inputs, NaN or infinity. UnknownNameError: there is no input of that name.
            SingularityError, EvaluationError: the step leads to a position that cannot be passed, or a function fails.

        After an error the state and the inputs are those before the call.
        """
        wanted = self._wanted(u)
        numbers = self._courses.over(self._numbers, wanted, self.state.t, self._dt)
        now = State.computed(*self._core.step(numbers), self._layout)
        self._held, self._numbers, self._now, self._here = wanted, numbers, now, None
        if self._record:
            self._given.append(numbers.tolist())
            self._times.append(now.t)
        if self._view is not None:
            self._view.moved()
        return now

    def reset(self, initial: State | None = None) -> State:
        """Start again from a state, or from the initial one, with the same results to the last bit as a stepper made
        there; the record for `result` is dropped and the inputs are reset. Angles of drives of joints that close loops
        start within half a turn.

        Raises `ArgumentError` for a state of another model.
        """
        start = self._start if initial is None else initial
        if not isinstance(start, State) or not start.is_of(self._model.summary):
            raise ArgumentError(
                f"initial must be a State with the coordinates {', '.join(self._model.names)}, as assemble() or "
                f"step() return it, not {shown(initial)}",
                argument="initial",
            )
        numbers, held = self._courses.first(self._signals(start))
        self._core.begin(numbers, start.t, np.ascontiguousarray(start.q), np.ascontiguousarray(start.v))
        self._numbers, self._held, self._now, self._here = numbers, held, None, None
        self._given, self._times = [], [self.state.t]
        if self._view is not None:
            self._view.moved()
        return self.state

    def show(self, *, shapes: Mapping[str, Any] | None = None, host: str = "127.0.0.1", port: int = 8080) -> LiveView:
        """Open a page in the browser, or in the notebook, that follows the stepper; needs the extra `live` (viser).

        Bodies and joints are drawn as on the animated page of a run. Steps are sent as they are made, at most 60 per
        second of real time, and always the last one; this adds a few microseconds to each step. A second call closes
        the first page.

        Args:
            shapes: solids to draw instead of the default shapes, as in `Result.to_html`.
            host: who has access: "127.0.0.1" only this machine, "0.0.0.0" everybody in the network.
            port: port on which it is served; if it is in use, the next free one is taken; 0: any free one.

        Raises:
            MissingDependencyError: viser is not installed. ArgumentError, UnknownNameError: host, port or a shape is
                not as said, or there is no such body.

        >>> import partita as pt
        >>> sim = pt.catalogue.load("four-bar").stepper(1e-3)
        >>> with sim.show() as view:                                  # doctest: +SKIP
        ...     print(view.url)
        ...     for _ in range(1000):
        ...         state = sim.step()
        """
        if self._view is not None:
            self._view.close()
        at = self._reported(*self._core.here(), self.time)
        view = looking(shapes, self._looks, lambda seen: LiveView(at, self._poses, seen, host, port))
        self._view = view
        return view

    def _poses(self) -> Poses:
        now = self.state
        count = len(self._model.summary["bodies"])
        found = self._model.core.motion(np.array([now.t]), now.q[None], now.v[None]).bodies()
        return Poses(now.t, *(found[key].reshape(count, *size) for key, size in _PLACES.items()))

    def result(self) -> Result:
        """All steps since the start or the last `reset` as a `Result`: its outputs are the steps, reactions and sensors
        at each are those with the inputs held from there on (at the last: up to there).

        Raises `ArgumentError` where nothing was recorded.
        """
        if not self._record:
            raise ArgumentError("nothing was recorded; make the stepper with record=True", argument="record")
        if not self._given:
            raise ArgumentError("no step has been taken yet, so there is no result; call step", argument="record")
        return self._reported(*self._core.result(self._times, self._given), self._times[0])

    def _signals(self, at: State) -> StateSignals:
        return StateSignals(self._model.core, at.t, at.q, at.v, self._model.summary)

    def _reported(self, raw: dict[str, Any], core: Any, t0: float) -> Result:
        model = self._model
        own = (*model.notes, *self._remarks)
        raw["notes"] = [*(note for note in own if note not in raw["notes"]), *raw["notes"]]
        options = {**self._options, "t0": t0, "t_end": self.time, "coordinates": model.coordinates}
        return Result.from_run(
            raw,
            model=core,
            summary=model.summary,
            spec=core.description,
            options=options,
            sensors=model.sensors,
            events=() if self._watched is None else self._watched.names,
            looks=self._looks,
        )

    def _wanted(self, u: Any) -> Array:
        if u is None:
            return self._held
        if type(u) is not np.ndarray and isinstance(u, Mapping):
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
        if not all(map(isfinite, wanted.tolist())):
            for name, value in zip(self._inputs, wanted, strict=True):
                _number(name, value)
        return wanted

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
    dt: Quantity,
    *,
    inputs: Iterable[Any] | None = None,
    initial: State | None = None,
    method: str = "rk4",
    substeps: int = 2,
    coordinates: str = "relative",
    switch_threshold: float = 1.25,
    parameters: Mapping[str, ArrayLike] | None = None,
    record: bool = True,
    compiled: bool | str = "auto",
    events: Iterable[Any] | None = None,
    locked: Iterable[Any] = (),
    parted: Iterable[Any] = (),
) -> Stepper:
    """Advance a motion step by step, for control loops: `sim.step(u)`.

    Each step takes `substeps` equal steps of a method with constant inputs; the loops are closed to round-off
    after each of them, and coordinates are switched when the criterion requires it, as in `simulate`. The work per step
    is therefore bounded; its error decreases with dt / substeps to the power of the method's order and is not
    controlled. Stiff mechanisms need short steps. Prefer `simulate` if all loads are known in advance.

    Args:
        dt: length of a step [s].
        inputs: those of `Mechanism.inputs` that `step` sets; None: all but the drives, and but what events set. Other
            drives keep their own function of time; for a drive that is an input see `Stepper.step`.
        initial: state to start from; None: the drawing, assembled, at rest.
        method: "rk4" (order 4, the default), or another one of `simulate`: "radau" for stiff mechanisms.
        substeps: number of steps of the method in each dt, 1 to 1000.
        coordinates, switch_threshold, parameters: as in `simulate`.
        record: keep every step for `result`; False: memory does not grow, however long it runs.
        compiled: whether evaluations run as machine code, with the same bits, see `simulate`. "auto": after 1500
            evaluations with the same coordinates a thread of its own makes the code, so that no step waits for it;
            True: before the first one, in the step that needs it; False: never.
        events: as in `simulate`, none of them terminal, since a step ends at its own time; `sim.events` are those of
            the last step.
        locked, parted: joints that are held, or apart, from the start on, as in `simulate`.

    Raises:
        ArgumentError: a number is out of range, the state belongs to another model, or the mechanism is a structure.
        UnknownNameError: there is no input of that name. SingularityError: the initial state is in a singular position.

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
    length = run_options.positive("dt", dt, "s")
    if isinstance(substeps, bool) or not isinstance(substeps, int | np.integer) or not 1 <= substeps <= 1000:
        raise ArgumentError(f"substeps is {shown(substeps)}; it must be an integer, 1 to 1000", argument="substeps")
    if not isinstance(record, bool | np.bool_):
        raise ArgumentError(f"record is {shown(record)}; it must be True or False", argument="record")
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    events = listed(events)
    model, layout, start, remarks = begun(self, wanted, parameters, initial, events, locked, parted)
    step = length / int(substeps)
    options = run_options.options(
        start.t,
        length,
        model.velocity_names,
        method=method,
        switch_threshold=switch_threshold,
        step=step,
        rtol=RTOL,
        atol=ATOL,
        compiled=compiled,
    )
    given = chosen(inputs_of(self._description), inputs)
    if inputs is None:
        given = {name: one for name, one in given.items() if name not in set_by(events)}
    watched, acting = observed(self, model, layout, events, locked, parted, inputs=given)
    if watched is not None and watched.ends is not None:
        raise ArgumentError(
            f'event "{watched.ends}" is terminal, but a stepper goes on for as long as it is stepped; look at '
            "sim.events after each step",
            argument="events",
        )
    models = (model, acting)
    made = Stepper(models, layout, start, given, options, length, int(substeps), bool(record), watched, remarks)
    made._looks = self._looks()
    return made
