"""`Mechanism.kinematics`: positions, rates and accelerations over a range of goals."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.kinematics import Kinematics, KinematicSource, Study
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..naming import listed
from ..results.sensor import LiveSensors, account_of
from ..state import State
from ..units import Quantity
from .goals import Goal, columns, goals_of, is_framed, is_turn, rates_of_frames, units_of
from .models import Modelled
from .poses import PosesFound, found_poses

FloatArray = NDArray[np.float64]
SHOWN = 5
"""Poses named in a note."""


def kinematics(
    self: Modelled,
    targets: Mapping[Any, Any],
    rates: Mapping[Any, Any] | None = None,
    accelerations: Mapping[Any, Any] | None = None,
    *,
    branch: str | None = None,
    near: State | None = None,
    t: Quantity | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Kinematics:
    """Compute positions, velocities and accelerations of everything over a range of positions, without dynamics.

    As many goals as degrees of freedom determine the motion. Every pose lies on the branch of one state and is found as
    by `assemble_many`; its velocities follow exactly from the rates of the goals (P2), its accelerations from their
    accelerations. Prefer it to `simulate` where the motion is prescribed and forces do not matter: ratios, coupler
    curves, transmission angles, limits, dead points. For reactions simulate the motion with `add_drive`.

    Args:
        targets: goals, as in `assemble_many`: joint -> positions (n,), point of a body -> positions (n, 3), point with
            the orientation of its body -> (orientations, positions). A single value applies to all poses.
        rates: goal -> rates [rad/s or m/s], (n,) or one for all; of a point its velocity; of a point with orientation
            (velocity, angular velocity), both along the axes of the world. Goals that are not named are at rest; None:
            all are. If joints or points other than the goals are named, the rates named are the only ones, and must
            determine the motion as well.
        accelerations: the same for accelerations [rad/s^2 or m/s^2], of what has rates.
        branch: signs of the blocks in which the loops are closed, as in `assemble_many`.
        near: state that defines the branch; None: the drawing.
        t: time [s] at which prescribed motions are evaluated; None: that of `near`, otherwise 0.
        coordinates: "relative" or "absolute", as in `compile`.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`.

    Returns:
        `Kinematics`: joints, bodies and sensors by name, ratios, limits, dead points, and which poses were reached.

    Raises:
        ArgumentError: there are fewer goals than degrees of freedom, or more; rates contradict each other; shapes do
            not match, or numbers are not finite. UnknownNameError: a key is not a joint, coordinate or body.
            AssemblyError: the loops cannot be closed at `near`. SingularityError: branches meet there.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> k = m.kinematics({"A": np.linspace(0.0, 2.0 * np.pi, 361)}, rates={"A": 30.0})
    >>> k
    <Kinematics of 'four-bar' over A: 361 poses: 361 reached>
    >>> k.joint("D").velocity.shape, k.body("coupler").acceleration.shape
    ((361, 1), (361, 3))
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    found = found_poses(self, targets, near, branch, t, wanted, parameters, _as_many_as_needed)
    model, n = found.model, len(found.values)
    rows, speeds, changes = _rates(found, targets, rates, accelerations)
    raw = model.core.rates(found.start.t, found.start.q, found.raw["q"], rows, speeds, changes)
    _refuse_contradictions(found, rows, speeds, changes, raw)
    status = found.raw["status"].copy()
    reached = status == "closed"
    determined = np.array(raw["determined"]) == "determined"
    status[reached] = np.where(determined[reached], "reached", "undetermined")
    reasons = dict(found.raw["reasons"])
    for i in np.flatnonzero(reached & ~determined):
        reasons[int(i)] = (
            f"{_at(found, i)}: the rates of the goals do not determine the motion (margin {raw['margin'][i]:.1e}): a "
            "limit of the goals, or a position in which branches meet"
        )
    ratios = raw["ratios"]
    if [goal[1:] for goal in rows] != [goal[1:] for goal in found.goals]:
        still = np.zeros_like(found.values)
        ratios = model.core.rates(found.start.t, found.start.q, found.raw["q"], found.goals, still, still)["ratios"]
    arrays = {"t": np.full(n, found.start.t), "q": found.raw["q"], "v": raw["v"], "vdot": raw["vdot"]}
    account = account_of(model.sensors, model.summary) if model.sensors else []
    summary = {**model.summary, "sensors": account} if account else model.summary
    source = KinematicSource(model.core, model.core.motion(*arrays.values()), summary)
    resolve = partial(_resolved, model)
    study = Study(
        model.core, summary, found.layout, found.start, found.goals, found.values, found.indices, ratios, resolve
    )
    return Kinematics(
        **arrays,
        reached=reached,
        status=status,
        reasons=reasons,
        margin=raw["margin"],
        notes=_notes(found, reached & ~determined, reasons),
        _source=source,
        _sensors=LiveSensors(model.sensors or {}, source, account),
        _study=study,
    )


def _resolved(model: CompiledModel, what: str, key: Any) -> list[Goal]:
    return goals_of(what, key, model)


def _as_many_as_needed(model: CompiledModel, start: State, goals: list[Goal]) -> None:
    """Refuse fewer goals than degrees of freedom, and more."""
    dof, idle = model.core.degrees_of_freedom(start.t, start.q)
    given = f"{_count(len(goals), 'goal')} ({listed([goal[0] for goal in goals])})"
    if len(goals) < dof - idle:
        raise ArgumentError(
            f"targets: {given} for {_count(dof - idle, 'degree')} of freedom; name "
            f"{dof - idle - len(goals)} more: a joint that keeps its position is a goal with one value for all",
            argument="targets",
        )
    if len(goals) > dof:
        driven = (
            "; drives prescribe the motion of their joints: draw the mechanism without that of a joint to move it"
            if model.summary.get("drives")
            else ""
        )
        raise ArgumentError(
            f"targets: {given} for {_count(dof, 'degree')} of freedom; leave out {len(goals) - dof}, whose "
            f"positions follow from the others{driven}",
            argument="targets",
        )


def _count(n: int, word: str) -> str:
    return f"{n} {word}{'s' * (n != 1)}"


def _rates(
    found: PosesFound, targets: Mapping[Any, Any], rates: Any, accelerations: Any
) -> tuple[list[Goal], FloatArray, FloatArray]:
    """The goals that have rates, their rates and their accelerations, (n, goals) each."""
    model, n = found.model, len(found.values)
    frames = {
        key: [found.goals[i] for i in found.indices[key]]
        for key, value in targets.items()
        if is_turn(key) or is_framed(key, value)
    }

    def given(what: str, wanted: Any, unit: str) -> tuple[list[Goal], FloatArray]:
        if wanted is None or (isinstance(wanted, Mapping) and not wanted):
            return [], np.zeros((1, 0))
        goals, values, _ = columns(what, wanted, model, rates_of_frames(frames, unit), per=unit, frames=frames)
        if len(values) not in (1, n):
            raise ArgumentError(f"{what} has {len(values)} rows for {n} poses; give {n}, or one for all", argument=what)
        return goals, values

    own, speeds = given("rates", rates, "/s")
    rows = list(found.goals)
    known = [goal[1:] for goal in rows]
    if any(goal[1:] not in known for goal in own):
        rows = own
        dof, idle = model.core.degrees_of_freedom(found.start.t, found.start.q)
        if len(rows) < dof - idle:
            raise ArgumentError(
                f"rates: {_count(len(rows), 'rate')} ({listed([goal[0] for goal in rows])}) for "
                f"{_count(dof - idle, 'degree')} of freedom; name {dof - idle - len(rows)} more, or rates of "
                "the goals alone, of which those not named are at rest",
                argument="rates",
            )
    changing, changes = given("accelerations", accelerations, "/s^2")
    return rows, _spread("rates", rows, own, speeds, n), _spread("accelerations", rows, changing, changes, n)


def _spread(what: str, rows: list[Goal], own: list[Goal], values: FloatArray, n: int) -> FloatArray:
    """Columns for all rows, zero where none is given."""
    known = [goal[1:] for goal in rows]
    found = np.zeros((n, len(rows)))
    for k, goal in enumerate(own):
        if goal[1:] not in known:
            raise ArgumentError(
                f"{what}: {goal[0]!r} has no rate; those with rates are {listed([row[0] for row in rows])}: name it in "
                "rates as well",
                argument=what,
            )
        found[:, known.index(goal[1:])] = values[:, k]
    return found


def _refuse_contradictions(
    found: PosesFound, rows: list[Goal], speeds: FloatArray, changes: FloatArray, raw: Mapping[str, Any]
) -> None:
    for i, word in enumerate(raw["determined"]):
        if "contradict" not in word:
            continue
        what, given, unit = ("rates", speeds, "/s") if word == "contradiction" else ("accelerations", changes, "/s^2")
        k, short = raw["missed"][i]
        size = units_of([rows[k]], found.model)[0] or "1"
        others = listed([f"{row[0]} at {x:.6g}" for row, x in zip(rows, given[i], strict=True) if row is not rows[k]])
        message = (
            f"{what} contradict each other at pose {i} ({_at(found, i)}): no motion has {rows[k][0]} at "
            f"{given[i, k]:.6g} {size}{unit} together with {others}; the nearest one misses it by {short:.3g}: leave "
            "it out, or give those of the goals alone"
        )
        raise ArgumentError(message, argument=what)


def _at(found: PosesFound, i: Any) -> str:
    return ", ".join(f"{goal[0]} = {value:.6g}" for goal, value in zip(found.goals, found.values[i], strict=True))


def _notes(found: PosesFound, undetermined: NDArray[np.bool_], reasons: Mapping[int, str]) -> tuple[str, ...]:
    notes = []
    dof, idle = found.model.core.degrees_of_freedom(found.start.t, found.start.q)
    if idle and len(found.goals) < dof:
        left = dof - len(found.goals)
        notes.append(
            f"{left} rotation{'s' * (left > 1)} that move{'s' * (left == 1)} no other body "
            f"{'are' if left > 1 else 'is'} left free by the goals and as small as possible; m.report() names "
            f"{'them' if left > 1 else 'it'}"
        )
    which = np.flatnonzero(undetermined)
    if len(which):
        first = "; ".join(f"pose {i} ({reasons[int(i)]})" for i in which[:SHOWN])
        more = f", and {len(which) - SHOWN} more" if len(which) > SHOWN else ""
        notes.append(f"rates are undetermined (NaN) at {first}{more}")
    return (*found.model._sentences, *notes)
