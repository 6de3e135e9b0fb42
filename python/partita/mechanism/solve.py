"""What a mechanism can be asked: `assemble`, `convert`, `simulate`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import options as run_options
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, AssemblyError, DescriptionError, UnknownNameError
from ..numeric import floats, shown
from ..results import Result
from ..state import Layout, State
from ..tangent import TangentVelocities
from .models import Modelled, compile, layout_of


def assemble(
    self: Modelled,
    targets: Mapping[Any, Any] | None = None,
    rates: Mapping[Any, Any] | None = None,
    near: State | None = None,
    *,
    t: float | None = None,
    tolerance: float = 1e-12,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> State:
    """Close the loops: a state that satisfies the constraints, nearest to the drawing or to `near`.

    Args:
        targets: joint (name or handle) -> position [rad or m] that it shall have; a sequence for a joint with
            several coordinates, or a single one by its name, such as "C.slide" (see `compile().names`).
        rates: the same for velocities [rad/s or m/s]. What is not given stays as near to rest (to `near`) as
            it can.
        near: where to start, for another branch; None: the drawing at rest.
        t: time [s], which matters where motion is prescribed; None: that of `near`, else 0.
        tolerance: largest residual |Phi| allowed, in radians for directions and in parts of the loop's own length for
            points; what is closed is then closed further, to round-off.
        coordinates: as in `compile`; a run with "absolute" needs a state of that kind.
        parameters: numbers other than the drawn ones, as `CompiledModel.with_parameters` takes them.

    Returns:
        The state; `state.assembly` says what residual was reached.

    Raises:
        AssemblyError: the lengths cannot close, or not with these targets.
        UnknownNameError: a key is no joint and no coordinate. ArgumentError: the joint closes a loop, or a
            value does not fit it.

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
    wanted = _indexed("targets", {} if targets is None else targets, layout.names, layout.q, layout)
    speeds = _indexed("rates", {} if rates is None else rates, layout.velocity_names, layout.v, layout)
    limit = run_options.positive("tolerance", tolerance)
    time = start.t if t is None else State(t, [], []).t
    try:
        q, v, said = model.core.assemble(time, start.q, start.v, wanted, speeds, limit)
    except AssemblyError as error:
        doubts = model.core.suspicious()
        if not doubts:
            raise
        raise AssemblyError(f"{error.message}; suspicious: {'; '.join(doubts)}", **error.fields) from None
    return State(time, q, v, layout=layout, assembly=json.loads(said))


def convert(self: Modelled, state: State, coordinates: str) -> State:
    """The same state in other coordinates: every body is and moves as before.

    Args:
        state: as `assemble` returns it, in relative or absolute coordinates.
        coordinates: "relative" or "absolute", as in `compile`.

    Raises `ArgumentError` if the state belongs to neither model of this mechanism.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> m.convert(m.assemble(rates={"A": 2.0}), "absolute").v.round(12).tolist()    # centre of mass, then the turn
    [0.0, 1.0, 2.0]
    """
    return _converted(self, state, run_options.one_of("coordinates", coordinates, run_options.COORDINATES), None)


def _converted(self: Modelled, state: State, coordinates: str, parameters: Mapping[str, ArrayLike] | None) -> State:
    """The same state in other coordinates, of the mechanism with these parameters."""
    model, layout = layout_of(self, coordinates, parameters)
    if not isinstance(state, State):
        raise ArgumentError(f"convert takes a State, not {type(state).__name__}", argument="state")
    if state.names == model.names:
        return state
    for other in run_options.COORDINATES:
        source, _ = layout_of(self, other, parameters)
        if other != coordinates and state.names == source.names:
            q, v = model.core.carried_over(source.core, state.q, state.v)
            return State(state.t, q, v, layout=layout)
    raise ArgumentError(
        f"the state has the coordinates {', '.join(state.names) or state.q.size}, which belong to no model of "
        f"{self.name!r}; make it with assemble",
        argument="state",
    )


def _indexed(
    what: str, wanted: Mapping[Any, Any], names: list[str], span: Any, layout: Layout
) -> list[tuple[int, float]]:
    """Names to indices: a coordinate by its own name, or all those of a joint."""
    if not isinstance(wanted, Mapping):
        raise ArgumentError(f"{what} must be a dict such as {{'A': 1.0}}, not {shown(wanted)}", argument=what)
    pairs: dict[int, float] = {}
    place = {name: index for index, name in enumerate(names)} if wanted else {}
    for key, value in wanted.items():
        first, count = _where(what, str(key), place, span, layout)
        numbers = _numbers(what, key, value, count)
        for index, number in zip(range(first, first + count), numbers, strict=True):
            if index in pairs:
                raise ArgumentError(f"{what} sets {names[index]!r} twice; give it once", argument=what)
            pairs[index] = number
    return list(pairs.items())


def _where(what: str, key: str, place: dict[str, int], span: Any, layout: Layout) -> tuple[int, int]:
    """First index and count of the coordinates that `key` means."""
    if key in place:
        return place[key], 1
    try:
        first, count = span(key)
    except UnknownNameError:
        known = sorted({*layout.tree_joints, *place})
        raise UnknownNameError(
            f"{what}: {key!r} is neither a joint nor a coordinate; known: {', '.join(known)}",
            name=key,
            known=known,
        ) from None
    return int(first), int(count)


def _numbers(what: str, key: Any, value: Any, count: int) -> list[float]:
    """As many finite numbers as the joint has coordinates."""
    try:
        numbers = np.atleast_1d(floats(value))
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
    fits = state.q.size == model.core.nq and state.v.size == model.core.nv
    if not fits or (state.names and state.names != model.names):
        raise ArgumentError(
            f"{what} has the coordinates {', '.join(state.names) or state.q.size}, but this model "
            f"({model.coordinates}) has "
            f"{', '.join(model.names)}; make the state with assemble(..., coordinates={model.coordinates!r})",
            argument=what,
        )


def simulate(
    self: Modelled,
    duration: float,
    *,
    t_eval: ArrayLike | None = None,
    initial: State | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "dop853",
    formulation: str = "projective",
    coordinates: str = "relative",
    events: Iterable[Any] = (),
    progress: Any = False,
    correction: str = "partition",
    exchange: float = 1.25,
    step: float | None = None,
    max_step: float | None = None,
    max_steps: int = 10_000_000,
    independent: Iterable[str] | None = None,
    selection: str = "collective",
    weights: Mapping[str, float] | None = None,
    window: float | None = None,
    baumgarte: tuple[float, float] | None = None,
    renew: float | str = 0.5,
    tangent: TangentVelocities | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Result:
    """Compute the motion over `duration` seconds. The loops stay closed to round-off; nothing needs tuning.

    Args:
        duration: [s], from the time of the initial state.
        t_eval: increasing times of the outputs (nt,) inside the run; None: 201 evenly spaced ones. Outputs
            satisfy the constraints whatever their spacing and do not change the steps.
        initial: state to start from, as `assemble` returns it, in whatever coordinates; None: the drawing,
            assembled, at rest.
        rtol, atol: tolerances of the step control on each integrated quantity. `atol` is in radians for angles and in
            parts of the characteristic length (the extent of a typical body) for displacements; the same per second
            for velocities.
        method: "dop853" (order 8; best at small tolerances), "dopri5", "tsit5" (order 5), "rk4" (order 4).
        formulation: "projective" (equations without reactions in independent coordinates; the default and the
            fastest), or one of those it can be held against: "fixed" (the same, its coordinates kept throughout),
            "wehage-haug" (2k states, the dependent coordinates solved for at every stage), "explicit-closing" (2k
            states, the loops closed by inverse kinematics), "zero-eigenvalue", "svd", "qr", "liang-lance",
            "gram-schmidt" (frozen tangent velocities, renewed when they have gone bad), "tangent-space" (2k
            states in a tangent chart), "user-tangent" (velocities of your own, needs `tangent`), "multipliers"
            (all accelerations and multipliers from one matrix), "sparse-multipliers" (the same, eliminated with
            its sparsity), "range-space" (the same by way of the constraints), "proximal" (the same regularised,
            for redundant rows), "baumgarte" (stabilised, never exactly closed; needs `baumgarte`).
        coordinates: "relative" or "absolute", as in `compile`.
        events: not offered by this version; anything but an empty sequence raises `ArgumentError`.
        progress: True: a line on stderr; or a function of the fraction done, 0 to 1.
        correction: how the remainder of the constraints is removed after each step: "partition" (dependent
            coordinates only), "mass-orthogonal" or "none" (a drift then remains, and the result shows it).
        exchange: a coordinate choice is replaced when another is this much better; at least 1.
        step: fixed step [s]; None: adaptive.
        max_step: largest adaptive step [s].
        max_steps: the run stops with status "max-steps" after so many.
        independent: names of velocities to be kept independent throughout; None: chosen, and exchanged when
            others serve better. A fixed choice fails where it becomes singular.
        selection: the rule that chooses the independent coordinates of "projective": "collective" (the
            projective criterion with lock and repeat, then exchanges), "greedy" (without exchanges),
            "normalised-determinant", "persistence" (the least volume over `window`), and those the criterion is held
            against: "individual", "determinant", "complete-pivoting".
        weights: preferences, velocity name -> factor on its measure; 1 for those not named.
        window: length of the window of "persistence" [s].
        baumgarte: (alpha, beta) [1/s] of that formulation; there is no default, because no value fits all.
        renew: frozen tangent velocities are renewed when their sqrt_mu falls below this part of what it was when they
            were frozen, 0 to 1; 0: never; "each step": after every step, whatever their quality. Bases made are counted
            in `counters["renewals"]`.
        tangent: `TangentVelocities` for "user-tangent".
        parameters: numbers other than the drawn ones, name -> value, as `CompiledModel.with_parameters` takes them: for
            sweeps and gradients, where compiling anew would cost more than the run. `initial` must close their loops.

    Returns:
        A result, also for a run that stopped early: look at `success` and `message`.

    Raises:
        ArgumentError, AssemblyError, EvaluationError, SingularityError; DescriptionError from `compile`.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> run = m.simulate(1.0, rtol=1e-10)
    >>> run.success, run.t.shape
    (True, (201,))
    >>> moon = m.simulate(1.0, rtol=1e-10, parameters={"gravity": (0, -1.62, 0)})
    >>> bool(abs(moon.joint("A").position[-1, 0] / run.joint("A").position[-1, 0]) < 0.7)
    True
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, _ = layout_of(self, wanted, parameters)
    start = initial if initial is not None else assemble(self, coordinates=coordinates, parameters=parameters)
    if (
        isinstance(start, State)
        and start.names != model.names
        and any(start.names == compile(self, other).names for other in run_options.COORDINATES)
    ):
        start = _converted(self, start, wanted, parameters)
    _fitting("initial", start, model)
    chosen = run_options.options(
        start.t,
        duration,
        model.velocity_names,
        rtol=rtol,
        atol=atol,
        method=method,
        formulation=formulation,
        events=events,
        correction=correction,
        exchange=exchange,
        step=step,
        max_step=max_step,
        max_steps=max_steps,
        independent=independent,
        selection=selection,
        weights=weights,
        window=window,
        baumgarte=baumgarte,
        renew=renew,
    )
    times = run_options.output_times(t_eval, start.t, chosen["t_end"])
    try:
        raw = run_options.run(model.core, chosen, times, start.q, start.v, progress, tangent)
    except DescriptionError as error:
        who = model.core.weightless() if "mass matrix" in error.message else None
        if who is None:
            raise
        raise DescriptionError(f"{error.message}; {who}", **error.fields) from None
    raw["notes"] = [*(note for note in model.notes if note not in raw["notes"]), *raw["notes"]]
    chosen["coordinates"] = coordinates
    return Result.from_run(raw, model=model.core, summary=model.summary, spec=model.description, options=chosen)
