"""Methods of a mechanism: `assemble`, `convert`, `simulate`."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from logging import INFO
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import options as run_options
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, AssemblyError, UnknownNameError
from ..logger import logger
from ..numeric import floats, is_list, shown
from ..results import Result
from ..solver import Solver
from ..state import Layout, State
from ..units import Quantity
from .branches import on_branch
from .events import observed
from .goals import Goal, asked, goals_of, inputs_of, named, state_units, units_of
from .models import Modelled, compile, layout_of
from .parting import layout_that_parts, moved, of_parting_run, parted_at_start, parting


def assemble(
    self: Modelled,
    targets: Mapping[Any, Any] | Sequence[Mapping[Any, Any]] | None = None,
    rates: Mapping[Any, Any] | None = None,
    near: State | None = None,
    *,
    fixed: Iterable[Any] = (),
    guess: Mapping[Any, Any] | None = None,
    branch: str | None = None,
    t: Quantity | None = None,
    tolerance: float = 1e-12,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> State:
    """Close the loops: compute the state that satisfies the constraints and is nearest to the drawing or to `near`.

    Args:
        targets: joint (name or handle) -> required position [rad or m]: a sequence for a joint with several
            coordinates, or a single coordinate by its name, such as "C.slide" (see `compile().names`). Joints that
            close loops are treated like all others. A point of a body, ("coupler", (0.6, 0, 0)) in body axes, -> its
            position in the world [m]; ("coupler", (0.6, 0, 0), "xy") -> two of its world coordinates; a point with the
            orientation of its body -> (position, orientation): three numbers, and a rotation matrix with the axes of
            the body in its columns, a quaternion (w, x, y, z) or a SciPy `Rotation`; or a SciPy `RigidTransform`.
            ("coupler", "rotation") -> the orientation alone. A list of such dicts sets strict priorities:
            the targets of the first dict are met; those of each later one are met as nearly as the earlier ones allow,
            in the sense of least squares (angles in radians, lengths as fractions of the size of the mechanism).
        rates: the same for velocities of joints [rad/s or m/s]. Velocities that are not given stay as near to rest (or
            to those of `near`) as possible. At a change point, where branches meet, the rates select a branch and are
            completed on it; they may deviate from it by 2e-3, as when copied from a message, and the result lies on it.
            Where drives leave no degree of freedom (a slider driven out of its dead centre), a rate only selects the
            branch, the one whose own rate lies between half and twice the given one; the drive determines its value.
        near: state from which to start, for instance to reach another branch; None: the drawing at rest.
        fixed: joints (or coordinates) that keep their starting position, drawn or guessed, while the loops are closed
            and the targets met.
        guess: joint -> starting position; the loops need not close there. Use it to reach a branch other than that of
            the drawing; prefer `near` or `branch` if the branch is known.
        branch: signs of the blocks in which the loops are closed, such as "+-", as `assemblies` reports them in
            `Assembled.branch` with the targets as inputs (one target for each degree of freedom).
        t: time [s], which matters if motions are prescribed; None: that of `near`, otherwise 0.
        tolerance: largest allowed residual |Phi|, in radians for directions and as a fraction of the length of the loop
            for points; once it is reached, the loops are closed further, to round-off.
        coordinates: "relative" or "absolute", as in `compile`.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`.

    Returns:
        The state; `state.assembly` has the residual and, for each target, the requested and the reached value; under
        "remarks", targets that look like degrees.

    Raises:
        AssemblyError: the loops cannot close, or not with these targets; the message says which targets contradict each
            other, how far a joint gets, or which closure error remains.
        UnknownNameError: a key is neither a joint nor a coordinate. ArgumentError: a value does not fit its joint.
        SingularityError: at a change point the rates select no branch; the message lists the branches.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.assemble(targets={"A": 1.0}, rates={"A": 2.0}).position("A")
    1.0
    """
    model, layout = layout_of(self, run_options.one_of("coordinates", coordinates, run_options.COORDINATES), parameters)
    start = near if near is not None else State(0.0, *model.core.initial(), layout=layout)
    _fitting("near", start, model)
    doubts: list[str] = []
    levels = [_valued("targets", level, model, doubts) for level in _levels(targets)]
    own, turns = _rates({} if rates is None else rates, model, layout)
    if not is_list(fixed):
        raise ArgumentError(f"fixed must be a list of joints such as ['A'], not {shown(fixed)}", argument="fixed")
    held = [goal for key in fixed for goal in goals_of("fixed", key, model)]
    guessed = _valued("guess", {} if guess is None else guess, model, doubts)
    for doubt in doubts:
        logger.warning("%s", doubt)
    limit = run_options.positive("tolerance", tolerance)
    time = start.t if t is None else State(run_options.si("t", t, "s"), [], []).t
    try:
        if branch is None:
            q, v, report = model.core.assemble(time, start.q, start.v, levels, own, turns, held, guessed, limit)
        else:
            q, _, report = model.core.assemble(time, start.q, start.v, levels, [], [], held, guessed, limit)
            inputs = inputs_of([goal for goal, _ in levels[0]], model) if levels[0] else None
            q = on_branch(model, time, q, branch, inputs)
            q, v, _ = model.core.assemble(time, q, start.v, [], own, turns, [], [], limit)
    except AssemblyError as error:
        doubts += model.core.suspicious()
        if not doubts:
            raise
        raise AssemblyError(f"{error.message}; suspicious: {'; '.join(doubts)}", **error.fields) from None
    except ArgumentError as error:
        if error.argument != "coordinates" or coordinates != "absolute" or near is not None:
            raise
        # a coupling holds its rates alone in these coordinates, but positions in relative ones
        also: dict[str, Any] = {"fixed": fixed, "guess": guess, "branch": branch, "t": t, "tolerance": tolerance}
        found = assemble(self, targets, rates, **also, parameters=parameters)
        there = _converted(self, found, coordinates, parameters)
        converted = State(there.t, there.q, there.v, layout=layout, assembly=found.assembly)
        converted.held = found.held
        return converted
    found = State(time, q, v, layout=layout, assembly={**json.loads(report), "remarks": doubts})
    found.held = _held(levels, rates)
    return found


def _held(levels: list[Any], rates: Any) -> tuple[str, ...]:
    """The joints whose positions or rates were asked for."""
    asked_for = [key for level in [*levels, rates or {}] for key in level]
    return tuple(dict.fromkeys(str(getattr(key, "name", key)) for key in asked_for if not isinstance(key, tuple)))


def _levels(targets: Any) -> list[Any]:
    """Targets in order of priority."""
    if targets is None or isinstance(targets, Mapping):
        return [{} if targets is None else targets]
    if isinstance(targets, (str, bytes)) or not isinstance(targets, Sequence):
        raise ArgumentError(
            "targets must be a dict such as {'A': 1.0}, or a list of them in order of priority, not "
            f"{shown(targets)}",
            argument="targets",
        )
    return list(targets) or [{}]


def _valued(what: str, wanted: Any, model: CompiledModel, doubts: list[str] | None = None) -> list[tuple[Goal, float]]:
    """Goals and their values; `doubts` gets what looks like degrees."""
    found: list[tuple[Goal, float]] = []
    for key, goals, value in asked(what, wanted, model):
        units = units_of(goals, model)
        if what == "rates":
            units = [f"{unit}/s" if unit else "1/s" for unit in units]
        numbers = _numbers(what, key, value, units)
        if doubts is not None:
            doubts += _like_degrees(what, key, value, units, numbers)
        found += zip(goals, numbers, strict=True)
    return found


FEW_TURNS = 2.0
"""A coordinate beyond this, given without a unit, may have been meant in degrees. Scale: turns. Reason: few motions
begin two turns from the drawing."""


def _like_degrees(what: str, key: Any, value: Any, units: list[str], numbers: list[float]) -> list[str]:
    """A remark on plain numbers that are many turns as radians."""
    if run_options.si(what, value, units if len(units) > 1 else units[0]) is not value:
        return []
    return [
        f"{what}[{shown(key)}] is {number:g} rad, {number / (2.0 * np.pi):.1f} turns; if degrees are meant, write "
        f"'{number:g} deg'"
        for number, unit in zip(numbers, units, strict=True)
        if unit == "rad" and abs(number) > FEW_TURNS * math.tau
    ]


def _rates(
    wanted: Any, model: CompiledModel, layout: Layout
) -> tuple[list[tuple[int, float]], list[tuple[Goal, float]]]:
    """Rates of velocities of the state, by their number, and of coordinates outside of it."""
    if not isinstance(wanted, Mapping):
        return _indexed("rates", wanted, layout.velocity_names, layout.v, layout, model), []
    wanted = {named("rates", key, model): value for key, value in wanted.items()}
    outside = {key: value for key, value in wanted.items() if _is_outside(str(key), model, layout)}
    for key in outside:
        _not_of_a_turn_in_space(str(key), model)
    inside = {key: value for key, value in wanted.items() if key not in outside}
    return _indexed("rates", inside, layout.velocity_names, layout.v, layout, model), _valued("rates", outside, model)


def _is_outside(key: str, model: CompiledModel, layout: Layout) -> bool:
    """Whether it is a joint, or a coordinate of one, that is not part of the state."""
    if key in layout.velocity_names:
        return False
    names = {joint["name"] for joint in model.summary["joints"] if joint["state_v"] is None and joint["v"][1] > 0}
    return key in names or key.rpartition(".")[0] in names


def _not_of_a_turn_in_space(key: str, model: CompiledModel) -> None:
    """Refuse rates of a spatial rotation that is not part of the state."""
    for joint in model.summary["joints"]:
        name, slides = joint["name"], joint["v"][1] - 3
        turns = joint["q"][1] != joint["v"][1] and key in (name, *(f"{name}.{axis}" for axis in joint["axes"][slides:]))
        if turns:
            raise ArgumentError(
                f"rates[{key!r}]: the spatial rotation of joint {name!r} is not part of this state, because the joint "
                f"closes a loop or the coordinates are absolute; give velocities of bodies instead, or assemble in "
                f"relative coordinates with the joint in the tree: a run in absolute coordinates accepts that state",
                argument="rates",
            )


def convert(self: Modelled, state: State, coordinates: str) -> State:
    """Convert a state to other coordinates: every body keeps its position and velocity.

    Args:
        state: as `assemble` returns it, in relative or absolute coordinates.
        coordinates: "relative" or "absolute", as in `compile`.

    Raises `ArgumentError` if the state belongs to neither model of this mechanism.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.convert(m.assemble(rates={"A": 2.0}), "absolute").v.round(12).tolist()    # centre of mass, then rotation
    [0.0, 1.0, 2.0]
    """
    return _converted(self, state, run_options.one_of("coordinates", coordinates, run_options.COORDINATES), None)


def _converted(self: Modelled, state: State, coordinates: str, parameters: Mapping[str, ArrayLike] | None) -> State:
    """The same state in other coordinates, of the mechanism with these parameters."""
    model, layout = layout_of(self, coordinates, parameters)
    if not isinstance(state, State):
        raise ArgumentError(f"convert takes a State, not {type(state).__name__}", argument="state")
    others = (layout_of(self, c, parameters)[0] for c in run_options.COORDINATES if c != coordinates)
    if state.is_of(model.summary):
        if state._layout.by_names_alone and state.names and any(state.is_of(other.summary) for other in others):
            raise ArgumentError(
                f"the state has the coordinates {', '.join(state.names)}, names of relative and of absolute ones, as "
                "joints and bodies share theirs; make it with assemble",
                argument="state",
            )
        return state
    for source in others:
        if state.is_of(source.summary):
            q, v = model.core.transferred(source.core, state.q, state.v)
            converted = State(state.t, q, v, layout=layout)
            converted.held = state.held
            return converted
    if (found := of_parting_run(self, state, model, parameters)) is not None:
        return State(found.t, found.q, found.v, layout=layout)
    raise ArgumentError(
        f"the state has the coordinates {', '.join(state.names) or state.q.size}, which belong to no model of "
        f"{self.name!r}; make it with assemble",
        argument="state",
    )


def _indexed(
    what: str, wanted: Mapping[Any, Any], names: list[str], span: Any, layout: Layout, model: CompiledModel
) -> list[tuple[int, float]]:
    """Names to indices: a coordinate by its own name, or all those of a joint."""
    if not isinstance(wanted, Mapping):
        raise ArgumentError(f"{what} must be a dict such as {{'A': 1.0}}, not {shown(wanted)}", argument=what)
    pairs: dict[int, float] = {}
    indices = {name: index for index, name in enumerate(names)} if wanted else {}
    units = state_units(model)[1] if wanted else []
    for key, value in wanted.items():
        first, count = _where(what, str(key), indices, span, layout)
        numbers = _numbers(what, key, value, units[first : first + count])
        for index, number in zip(range(first, first + count), numbers, strict=True):
            if index in pairs:
                raise ArgumentError(f"{what} sets {names[index]!r} twice; give it once", argument=what)
            pairs[index] = number
    return list(pairs.items())


def _where(what: str, key: str, indices: dict[str, int], span: Any, layout: Layout) -> tuple[int, int]:
    """First index and count of the coordinates to which `key` refers."""
    if key in indices:
        return indices[key], 1
    try:
        first, count = span(key)
    except UnknownNameError:
        known = sorted({*layout.tree_joints, *indices})
        raise UnknownNameError(
            f"{what}: {key!r} is neither a joint nor a coordinate; known: {', '.join(known)}",
            name=key,
            known=known,
        ) from None
    return int(first), int(count)


def _numbers(what: str, key: Any, value: Any, units: list[str]) -> list[float]:
    """As many finite numbers as the joint has coordinates."""
    count = len(units)
    unit = units[0] if len(set(units)) == 1 else units
    try:
        numbers = np.atleast_1d(floats(run_options.si(f"{what}[{str(key)!r}]", value, unit)))
    except TypeError as error:
        sentence = f"{what}[{str(key)!r}] must be made of numbers, not {shown(value)}"
        raise ArgumentError(sentence, argument=what) from error
    if numbers.shape != (count,) or not np.all(np.isfinite(numbers)):
        raise ArgumentError(
            f"{what}[{str(key)!r}] must be {count} finite number{'s' if count != 1 else ''}, not "
            f"{shown(value)}; one coordinate of "
            "several is set by its own name",
            argument=what,
        )
    return [float(number) for number in numbers]


def _fitting(what: str, state: Any, model: CompiledModel) -> None:
    """Refuse a state of another model or of other coordinates."""
    if not isinstance(state, State):
        raise ArgumentError(
            f"{what} must be a State as assemble() returns it, not {type(state).__name__}", argument=what
        )
    if not _as_large(state, model) or (state.names and not state.is_of(model.summary)):
        raise ArgumentError(
            f"{what} has the coordinates {', '.join(state.names) or state.q.size}, but this model "
            f"({model.coordinates}) has "
            f"{', '.join(model.names)}; make the state with assemble(..., coordinates={model.coordinates!r})",
            argument=what,
        )


def _as_large(state: State, model: CompiledModel) -> bool:
    """Whether the state has as many coordinates and velocities as the model."""
    return bool(state.q.size == model.core.nq and state.v.size == model.core.nv)


def _drawn(self: Modelled, model: CompiledModel, coordinates: str, parameters: Mapping[str, ArrayLike] | None) -> State:
    """The drawing, assembled, at rest; computed once, unless user functions affect it."""
    if model.core.calls_functions:
        return assemble(self, coordinates=coordinates, parameters=parameters)
    if model._at_rest is None:
        model._at_rest = assemble(self, coordinates=coordinates, parameters=parameters)
    return model._at_rest


def start_of(
    self: Modelled,
    initial: Any,
    model: CompiledModel,
    coordinates: str,
    parameters: Mapping[str, ArrayLike] | None,
) -> State:
    """Start of a motion: the given state, in the requested coordinates, or the drawing, assembled, at rest."""
    start = initial if initial is not None else _drawn(self, model, coordinates, parameters)
    if isinstance(start, State) and start._layout.is_like(self._compiled[coordinates][2]) and _as_large(start, model):
        return start
    if (
        isinstance(start, State)
        and not start.is_of(model.summary)
        and (start._layout.parting or any(start.is_of(compile(self, c).summary) for c in run_options.COORDINATES))
    ):
        start = _converted(self, start, coordinates, parameters)
    _fitting("initial", start, model)
    return start


def begun(
    self: Modelled,
    coordinates: str,
    parameters: Mapping[str, ArrayLike] | None,
    initial: Any,
    events: Iterable[Any] | None,
    locked: Iterable[Any] = (),
    parted: Iterable[Any] = (),
) -> tuple[CompiledModel, Layout, State, list[str]]:
    """The model of a motion with these events, its layout, its start, and remarks on its coordinates: where events part
    joints they do without these."""
    model, layout = layout_of(self, coordinates, parameters)
    apart = parting(self, events, locked, parted)
    if not apart:
        return model, layout, start_of(self, initial, model, coordinates, parameters), []
    usual, (model, layout) = model, layout_that_parts(self, coordinates, parameters, list(apart))
    found = of_parting_run(self, initial, model, parameters, parted_at_start(self, parted))
    start = found or moved(start_of(self, initial, usual, coordinates, parameters), usual, model)
    if model.names == usual.names:
        return model, layout, start, []
    who = ", ".join(f'"{name}" ({who})' for name, who in apart.items())
    space = ", in space" if usual.summary["planar"] and not model.summary["planar"] else ""
    remark = f"computed in coordinates{space} that do without the joints that may be parted: {who}"
    return model, layout, start, [remark]


def simulate(
    self: Modelled,
    duration: Quantity,
    *,
    t_eval: ArrayLike | None = None,
    initial: State | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    coordinates: str = "relative",
    progress: Any = False,
    correction: str = "partition",
    switch_threshold: float = 1.25,
    step: Quantity | None = None,
    max_step: Quantity | None = None,
    max_steps: int = 10_000_000,
    independent: Iterable[str] | None = None,
    solver: Solver | None = None,
    compiled: bool | str = "auto",
    parameters: Mapping[str, ArrayLike] | None = None,
    events: Iterable[Any] | None = None,
    locked: Iterable[Any] = (),
    parted: Iterable[Any] = (),
) -> Result:
    """Compute the motion over `duration` seconds. The loops stay closed to round-off; nothing needs tuning.

    Args:
        duration: length of the run [s], from the time of the initial state.
        t_eval: increasing times of the outputs (nt,) within the run; None: 201 evenly spaced ones. Outputs satisfy the
            constraints whatever their spacing and do not affect the steps.
        initial: state to start from, as returned by `assemble`, in relative or absolute coordinates; None: the drawing,
            assembled, at rest. At a change point the branch follows from the velocities and is recorded in the notes.
        rtol, atol: relative and absolute tolerance of the step control on each integrated quantity. `atol` is in
            radians for angles and in fractions of the characteristic length (the extent of a typical body) for
            displacements; for velocities the same per second.
        method: "dop853" (order 8; best at small tolerances), "dopri5", "tsit5" (order 5), "bs23" (order 3; for
            tolerances of 1e-3 and looser), "rk4" (order 4, fixed steps only), "adams" (a multistep method of orders 2
            to 10: two evaluations a step, for long smooth motions of large mechanisms; it begins anew at each switch of
            coordinates), "radau" (implicit, Radau IIA of order 5: for stiff springs, dampers and controllers), "auto"
            ("dop853" that changes to "radau" and back where stiffness limits its steps; the notes say when and why).
        coordinates: "relative" or "absolute", as in `compile`.
        progress: True: a progress bar on the terminal with the rate and the remaining time (needs tqdm); or a function
            of the completed fraction, 0 to 1.
        correction: how the closure error is removed after each step: "partition" (moves only dependent coordinates),
            "kantorovich" (the same by the factors of the last evaluation, in as many steps as it takes),
            "mass-orthogonal" (the smallest change in the mass metric) or "none" (the constraints drift, which the
            result reports).
        switch_threshold: independent coordinates are switched when others span a volume larger by this factor; at
            least 1.
        step: fixed step [s]; None: adaptive.
        max_step: largest adaptive step [s].
        max_steps: after this number of steps the run stops with status "max-steps".
        independent: names of velocities that stay independent throughout; None: chosen by the criterion, and switched
            when others are better. A run with a fixed choice ends where the choice becomes singular.
        solver: the formulation and the rule that chooses coordinates, where methods are compared: `pt.Solver("svd")`;
            None: "projective" by the projective criterion.
        compiled: whether evaluations of "projective" and "fixed" inside steps run as machine code, made in memory for
            each choice of coordinates. The results are the same to the bit. "auto": once a choice has served for
            1500 evaluations, unless its equations are very large; True: at once; False: never. Mechanisms with
            Python functions, reaction-dependent friction or massless bodies are evaluated as without.
            `counters["compiled_evaluations"]` counts them, and with True `notes` says where there are none.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`: for
            sweeps and gradients, where compiling again would cost more than the run. The loops must close in `initial`
            with these numbers.
        events: a list of `pt.Event`, or of functions f(t, state) as SciPy has them, with attributes `direction` and
            `terminal`; `run.events` has what happened. At most a limit, "events" in `pt.limits`, may happen. What they
            do (`then=`) divides the run into segments.
        locked: joints that are held from the start on, until an event releases them; their rates at the start are
            lost in an impulse. Measures, and `pt.Lock` of these, too.
        parted: joints that are apart from the start on, as after a `pt.Release` of a run whose state is `initial`.

    Returns:
        The result, also of a run that stopped early: check `success` and `message`.

    Raises:
        ArgumentError, AssemblyError, EvaluationError, SingularityError: the run cannot start; the message says why.
        DescriptionError: as in `compile`.
        Interrupted: Ctrl-C was pressed; `result` of the error is the run up to that time.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> run = m.simulate(1.0, rtol=1e-10)
    >>> run.success, run.t.shape
    (True, (201,))
    >>> moon = m.simulate(1.0, rtol=1e-10, parameters={"gravity": (0, -1.62, 0)})
    >>> bool(abs(moon.joint("A").angle[-1] / run.joint("A").angle[-1]) < 0.7)
    True
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, layout, start, remarks = begun(self, wanted, parameters, initial, events, locked, parted)
    chosen = run_options.options(
        start.t,
        duration,
        model.velocity_names,
        rtol=rtol,
        atol=atol,
        method=method,
        correction=correction,
        switch_threshold=switch_threshold,
        step=step,
        max_step=max_step,
        max_steps=max_steps,
        independent=independent,
        solver=solver,
        compiled=compiled,
    )
    times = run_options.output_times(t_eval, start.t, chosen["t_end"])
    watched, model = observed(self, model, layout, events, locked, parted)
    followed = None if watched is None else watched.core
    if watched is None or watched.acts is None:
        raw = run_options.run(model.core, chosen, times, start.q, start.v, progress, solver, followed)
    else:
        raw = run_options.run_segments(
            model.core,
            chosen,
            times,
            (start.q, start.v),
            progress,
            solver,
            watched.core,
            (watched.acts, watched.decisions),
        )
    if notes := (*self._remarks(), *model._sentences, *remarks):
        raw["notes"] = [*(note for note in notes if note not in raw["notes"]), *raw["notes"]]
    result = Result.from_run(
        raw,
        model=model.core,
        summary=model.summary,
        spec=model.description,
        options=chosen.of(wanted),
        sensors=model.sensors,
        events=() if watched is None else watched.names,
        looks=self._looks(),
    )
    result._held = start.held
    if watched is not None:
        result._formulas = {one["name"]: one["formula"] for one in json.loads(watched.text)}
    if logger.isEnabledFor(INFO):  # what it says is computed when it is read
        outputs, steps = len(result.t), result.counters.get("steps", 0)
        logger.info("%s: %s after %d outputs and %d steps", self.name, result.status, outputs, steps)
    return result
