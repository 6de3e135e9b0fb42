"""The method `inverse_dynamics`: the motion, the actuators, and the result."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.inverse import InverseDynamics, exceeded, mixed, notes_of
from ..analyses.still import run_of
from ..builder.actuators import limits_of, preload_of, weights_of
from ..builder.changes import remove
from ..builder.compiled import CompiledModel
from ..builder.sampled import SampledTable
from ..errors import ArgumentError
from ..naming import Names, listed
from ..numeric import floats, shown
from ..options import si
from ..results import Result
from ..results.run import Run
from ..state import State
from .goals import goals_of
from .models import Modelled, compile, layout_of
from .set_valued import without_holding
from .solve import _fitting, assemble, simulate

FloatArray = NDArray[np.float64]
LEAST_USE = "least-use"


class Motion(Protocol):
    """A motion in the coordinates of a mechanism: a `Result`, or anything else with its times, coordinates, velocities
    and accelerations."""

    @property
    def t(self) -> FloatArray: ...
    @property
    def q(self) -> FloatArray: ...
    @property
    def v(self) -> FloatArray: ...
    @property
    def vdot(self) -> FloatArray: ...
    @property
    def names(self) -> Names: ...


def inverse_dynamics(
    self: Modelled,
    motion: Any = None,
    actuators: Any = None,
    *,
    weights: Mapping[str, float] | str | None = None,
    limits: Mapping[str, Any] | None = None,
    preload: Mapping[str, ArrayLike] | None = None,
    initial: State | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> InverseDynamics:
    """Compute the efforts of actuators that cause a motion, and all reactions with them.

    The set of actuators is independent of how the motion was made: drives are left out, and actuators act as forces,
    never as constraints. With as many actuators as degrees of freedom the efforts are unique; with more they are
    distributed by `weights` or `limits`; with fewer the motion is in general not possible, and the remainder says by
    how much.

    Args:
        motion: a `Result` (or anything with t, q, v, vdot and names of this mechanism); a `State` at rest, which is to
            be held; (t, {"A": values}): times (nt,) and the course of joints or their coordinates, each an array of
            positions at these times (joined by a twice differentiable cubic spline), a table (times, values) or a
            function of t, as in `add_drive`, instead of all drives of the mechanism; times (nt,) alone: the motion that
            the drives of the mechanism prescribe; None: the same at t = 0.
        actuators: names or handles: a joint with one degree of freedom, or one of several coordinates such as
            "C.slide" (in the tree or closing a loop); a drive (what it drives); a spring (along its line, in addition
            to the spring's own force); a torque of `add_torque`, or a component "push.x" of a force of `add_force`,
            whose given effort is then replaced. None: what the drives prescribe; for (t, {...}) the coordinates named
            there.
        weights: with more actuators than degrees of freedom: the least sum of weight effort^2, actuator -> weight (1
            for those not named; all 1 if None and the units agree); or "least-use": the largest effort in fractions of
            its limit is made as small as possible.
        limits: actuator -> largest magnitude, or (lower, upper) around 0 [N, N m]; for every actuator. The least
            weighted sum of squares within them is found; where none is possible, the least use is taken, and a note
            gives its factor.
        preload: actuator -> effort, constant or at each time (nt,): the least sum of squares is that of the difference
            to it.
        initial: for a motion by drives, the state near which it begins, to select a branch; None: the drawing.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`.

    Returns:
        `InverseDynamics`. At instants where the set cannot cause every motion (type II singularity), or where the
        constraints are singular, efforts are NaN, and a note names the instants.

    Raises:
        ArgumentError: the motion belongs to another mechanism or violates the constraints (the message says which,
            where and by how much), something is not an actuator, or limits, weights and preload do not fit.
        UnknownNameError: a name does not exist.

    A slider-crank: the torque of a crank turning at 10 rad/s, and the force on its pin.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("slider-crank")
    >>> t = np.linspace(0.0, 2 * np.pi / 10.0, 91)
    >>> d = m.inverse_dynamics((t, {"O": 10.0 * t}))
    >>> d.effort("O").shape, d.joint("pin").force.shape
    ((91,), (91, 3))

    The same motion by a force on the slider, which cannot pass the dead centres:

    >>> d = m.inverse_dynamics((t, {"O": 10.0 * t}), actuators=["slide"])
    >>> bool(d.margin.min() < 0.1)
    True
    """
    without_holding(self, "inverse_dynamics", state=True)
    mechanism, model, (t, q, v, vdot) = _motion(self, motion, initial, parameters)
    core, chosen = model._with_actuators(actuators)
    names, units = tuple(each.name for each in chosen), tuple(each.effort for each in chosen)
    bounds, least_use = limits_of(limits, chosen), isinstance(weights, str)
    if least_use and weights != LEAST_USE:
        raise ArgumentError(
            f'weights must be a dict such as {{"A": 1.0}} or "{LEAST_USE}", not {shown(weights)}', argument="weights"
        )
    if least_use and bounds is None:
        raise ArgumentError(f'weights="{LEAST_USE}" needs limits; give one for every actuator', argument="limits")
    shares, before = weights_of(weights, chosen), preload_of(preload, chosen, len(t))
    found = core.efforts(t, q, v, vdot, shares, before, bounds, least_use)
    distributed = len(chosen) > found["k"]
    if distributed and weights is None and len(set(units)) > 1:
        raise mixed(units)
    return InverseDynamics(
        actuators=names,
        units=units,
        efforts=found["efforts"],
        rates=found["rates"],
        margin=found["margin"],
        remainder=found["remainder"],
        null_space=found["null_space"],
        limits=bounds,
        gaps={i: gap for i, gap in enumerate(found["gaps"]) if gap},
        notes=(*notes_of(found, names, t), *exceeded(found["efforts"], bounds if distributed else None, t)),
        run=_with_efforts(mechanism, model, core.model, (t, q, v, found["vdot"]), found["multipliers"]),
    )


def _motion(
    self: Modelled, motion: Any, initial: Any, parameters: Mapping[str, ArrayLike] | None
) -> tuple[Modelled, CompiledModel, tuple[FloatArray, ...]]:
    """The mechanism in whose coordinates the motion is, its model, and t, q, v, v'."""
    if isinstance(motion, State):
        model = _model_of(self, "the state", motion.names, parameters)
        _fitting("motion", motion, model)
        if np.any(motion.v):
            raise ArgumentError(
                "motion: the state moves, and its accelerations are not known; give a state at rest, which is held, or "
                "a motion over time",
                argument="motion",
            )
        return self, model, (np.array([motion.t]), motion.q[None, :], motion.v[None, :], 0.0 * motion.v[None, :])
    if all(hasattr(motion, word) for word in ("t", "q", "v", "vdot", "names")):
        model = _model_of(self, "the motion", list(motion.names.coordinates), parameters)
        t = np.ascontiguousarray(np.atleast_1d(motion.t), dtype=float)
        found = [np.ascontiguousarray(getattr(motion, word), dtype=float) for word in ("q", "v", "vdot")]
        widths = (model.core.nq, model.core.nv, model.core.nv)
        for word, array, width in zip(("q", "v", "vdot"), found, widths, strict=True):
            if array.shape != (len(t), width):
                raise ArgumentError(
                    f"motion: {word} has shape {array.shape}; this mechanism needs ({len(t)}, {width}), a row for each "
                    "time",
                    argument="motion",
                )
        for word, array in (("t", t), ("q", found[0]), ("v", found[1])):
            if not np.isfinite(array).all():
                raise ArgumentError(f"motion: {word} has values that are not finite; leave them out", argument="motion")
        return self, model, (t, *found)
    courses: Mapping[Any, Any] | None = None
    times = motion
    if isinstance(motion, tuple) and len(motion) == 2 and isinstance(motion[1], Mapping):
        times, courses = motion
    t = _times(times)
    mechanism = self if courses is None else _driven(self, t, courses)
    run = _prescribed(self, mechanism, t, initial, parameters)
    return mechanism, layout_of(mechanism, "relative", parameters)[0], (run.t, run.q, run.v, run.vdot)


def _model_of(self: Modelled, what: str, names: list[str], parameters: Mapping[str, ArrayLike] | None) -> CompiledModel:
    """The model of this mechanism whose coordinates have these names."""
    for coordinates in run_options.COORDINATES:
        if list(compile(self, coordinates).names) == list(names):
            return layout_of(self, coordinates, parameters)[0]
    own = listed(list(compile(self).names))
    raise ArgumentError(
        f"motion: {what} has the coordinates {listed(list(names))}, but this mechanism has {own}; give a motion of "
        "this mechanism, from simulate or assemble",
        argument="motion",
    )


def _times(given: Any) -> FloatArray:
    """Increasing times of a prescribed motion."""
    if given is None:
        return np.zeros(1)
    try:
        t = np.empty((0, 0)) if isinstance(given, str) else np.atleast_1d(floats(si("motion", given, "s")))
    except TypeError:
        t = np.empty((0, 0))
    if t.ndim != 1 or not t.size:
        raise ArgumentError(
            "motion must be a Result, a State at rest, times (nt,), or (times, {'A': values, a table or a function}), "
            f"not {shown(given)}",
            argument="motion",
        )
    return run_options.output_times(t, float(t[0]), float(t[-1]))


def _driven(self: Modelled, t: FloatArray, courses: Mapping[Any, Any]) -> Modelled:
    """The mechanism with these motions in place of its drives."""
    if not courses:
        raise ArgumentError("motion names nothing that moves; give at least one joint", argument="motion")
    driven = copy.deepcopy(self)
    for name in list(driven._description.drives):
        remove(driven, "drives", name)
    joints = compile(self).summary["joints"]
    for key, course in courses.items():
        goals = goals_of("motion", key, compile(self))
        if len(goals) != 1 or goals[0][1] != "joint":
            words = ", ".join(goal[0] for goal in goals)
            raise ArgumentError(
                f"motion: {str(key)!r} is not one coordinate of a joint; name one ({words})", argument="motion"
            )
        _, _, joint, coordinate, _ = goals[0]
        driven.add_drive(joints[joint]["name"], position=_course(str(key), t, course), coordinate=coordinate)
    return driven


def _course(key: str, t: FloatArray, course: Any) -> Any:
    """A course for `add_drive`: values at the times as a table; one value is held."""
    if callable(course) or isinstance(course, tuple):
        return course
    try:
        values = floats(course)
    except TypeError:
        return course  # with a unit, or nothing that add_drive knows
    if values.shape == ():
        return float(values)
    if values.shape != t.shape:
        raise ArgumentError(
            f"motion[{key!r}] has shape {values.shape}; give a position for each of the {len(t)} times",
            argument="motion",
        )
    return float(values[0]) if len(t) == 1 else SampledTable(t, values)


def _prescribed(
    self: Modelled, mechanism: Modelled, t: FloatArray, initial: Any, parameters: Mapping[str, ArrayLike] | None
) -> Result:
    """The motion by the drives of the mechanism; what they leave free moves by the forces."""
    if not mechanism._description.drives:
        raise ArgumentError(
            "motion: the mechanism has no drives, so no motion is prescribed; give a Result, a State at rest, or (t, "
            "{'A': values})",
            argument="motion",
        )
    near = None if initial is None else _start(self, mechanism, initial, parameters)
    start = assemble(mechanism, near=near, t=float(t[0]), parameters=parameters)
    run = simulate(
        mechanism,
        float(t[-1] - t[0]) or _INSTANT,
        t_eval=t,
        initial=start,
        parameters=parameters,
    )
    if len(run.t) < len(t):
        raise run.error or ArgumentError(
            f"motion: the drives cannot move the mechanism to t = {t[-1]:g} s: {run.message}", argument="motion"
        )
    return run


def _start(self: Modelled, mechanism: Modelled, initial: Any, parameters: Mapping[str, ArrayLike] | None) -> State:
    """The initial state in the coordinates of the driven mechanism."""
    model, layout = layout_of(mechanism, "relative", parameters)
    if isinstance(initial, State) and not initial.is_of(model.summary):
        for coordinates in run_options.COORDINATES:
            own = layout_of(self, coordinates, parameters)[0]
            if initial.is_of(own.summary):
                q, v = model.core.transferred(own.core, initial.q, initial.v)
                return State(initial.t, q, v, layout=layout)
    _fitting("initial", initial, model)
    found: State = initial
    return found


_INSTANT = 1e-9
"""Length of a run for a single output. Unit: s. Reason: nothing moves in it."""


def _with_efforts(
    mechanism: Modelled, model: CompiledModel, core: Any, path: tuple[FloatArray, ...], multipliers: FloatArray
) -> Run:
    """The motion with its efforts as data of a run, from which reactions follow."""
    own = json.loads(core.summary)
    rows = {key: own[key] for key in ("rows", "rows_names", "closing_rows", "couplings")}
    changes = {**rows, "drives": [], "drive_rows": [], "notes": list(model.notes)}
    t, q, v, vdot = path
    return run_of(Run, model, t, q, v, vdot, multipliers, core=core, changes=changes)
