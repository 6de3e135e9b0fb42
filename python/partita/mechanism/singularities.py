"""`Mechanism.singularities`: where actuators, outputs or constraints are singular."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.singularities import ACTUATORS, CONSTRAINTS, ENDS, KINDS, OUTPUTS, SingularCurve, Singularities
from ..builder.maps import ActuatedModel, singular_positions
from ..errors import ArgumentError, PartitaError
from ..numeric import shown
from ..state import State
from .goals import Goal, inputs_of
from .models import Modelled
from .ranges import Ranged, keys_of, room_of, rows_of, with_actuators

FloatArray = NDArray[np.float64]
SEEDS = 169
"""Positions at which the search begins: a grid over the range."""
OTHERS = 9
"""Positions at which other assemblies are sought."""


def singularities(
    self: Modelled,
    grid: Mapping[Any, Any],
    of: Any = None,
    kind: str = ACTUATORS,
    *,
    branch: str | None = None,
    near: State | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Singularities:
    """Find the positions within a range in which a set of measurements is singular, as curves.

    Three kinds are told apart. "actuators" (type II): a motion escapes the efforts of `of`; held, they do not hold the
    mechanism. "outputs" (type I): a motion of the mechanism leaves all of `of` at rest, such as the position of a tool.
    "constraints": the rank of the loop closures falls, and branches meet. All are zeros of one function, the least
    singular value of the measurements on the admissible motions, and each position is located to round-off.

    The range is searched on all sheets, since sheets meet where goals or actuators are singular, or on one branch.
    Drives are left out; actuators move the mechanism in their place.

    Args:
        grid: goal -> values, one goal for each degree of freedom: a joint, one of its coordinates, an axis of a point
            ("tool", (0, 0, 0), "x"), or in the plane the name of a body, whose rotation from the given position counts.
            Two goals have values over a range, of which the least and the largest count; all others have one value and
            are held. If only one has a range, there are points instead of curves.
        of: for "actuators" as in `inverse_dynamics`, None: what the drives move; for "outputs" joints, points such as
            ("tool", (0, 0, 0), "xy"), or bodies, for their orientation; as many as degrees of freedom.
        kind: "actuators", "outputs" or "constraints".
        branch: signs of the blocks in which the loops are closed, as in `assemble_many`; only this branch is searched,
            up to where the goals are singular.
        near: state on the branch that is searched, such as `m.assemble()`. If neither it nor `branch` is given, all
            sheets are searched that are connected with the drawing, and other assemblies where the loops can be solved
            in closed form.
        coordinates: "relative" or "absolute", as in `compile`.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`.

    Returns:
        `Singularities`: curves with their points, goals, and paths of any point of a body.

    Raises:
        ArgumentError: goals or measurements are too few or too many, numbers are not finite, or something is no
            measurement. UnknownNameError: a name does not exist. AssemblyError: no position of the grid can be reached.
            SingularityError: branches meet at the given position.

    The boundary of what a five-bar linkage can reach, where its two distal links are in line:

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("five-bar")
    >>> turn = np.linspace(-np.pi, np.pi, 9)
    >>> found = m.singularities({"A": turn, "E": turn}, of=("A", "E"))
    >>> bool(max(curve.measure.max() for curve in found) < 1e-12)
    True
    """
    run_options.one_of("kind", kind, KINDS)
    room = room_of(self, grid, near, branch, coordinates, parameters)
    actuated, outputs, words = _set(self, room, of, kind)
    limits = np.array([_limits(axis, i) for axis in room.axes for i in range(len(axis.goals))])
    one_branch = near is not None or branch is not None
    seeds, notes = _seeds(room, others=not one_branch)
    asked = (room.start.t, room.goals, limits, seeds, one_branch)
    found = (
        actuated.singular_positions(*asked) if actuated is not None else singular_positions(room.model, outputs, *asked)
    )
    if not found["complete"]:
        notes.append(
            f"the range holds more than the {found['samples']} positions that are searched: curves may be missing; "
            "give a smaller range"
        )
    made = [_curve(room, raw) for raw in found["curves"]]
    curves = sorted((curve for curve in made if curve.ends), key=len, reverse=True)
    return Singularities(
        title=room.model.summary["name"],
        kind=kind,
        of=words,
        keys=tuple(axis.key for axis in room.free),
        units=tuple(axis.unit for axis in room.free),
        limits=np.array([[axis.values.min(), axis.values.max()] for axis in room.free]),
        held={axis.key: float(axis.values[0]) for axis in room.axes if not axis.is_free},
        curves=tuple(curves),
        points=_joined(room, [curve for curve in made if not curve.ends]),
        samples=found["samples"],
        notes=tuple(notes),
    )


def _limits(axis: Any, i: int) -> tuple[float, float]:
    return (float(axis.values.min()), float(axis.values.max())) if i == axis.varying else (0.0, 0.0)


def _set(self: Modelled, room: Ranged, of: Any, kind: str) -> tuple[ActuatedModel | None, list[Goal], tuple[str, ...]]:
    """The measurements for the core, and their names."""
    if kind == CONSTRAINTS:
        if of is not None:
            raise ArgumentError(
                f"of = {shown(of)}: the constraints need no measurements; leave it out, or choose kind='actuators' or "
                "'outputs'",
                argument="of",
            )
        return None, [], ()
    if kind == ACTUATORS:
        actuated = with_actuators(self, room, of)
        return actuated, [], actuated.names
    if of is None:
        raise ArgumentError(
            "of: name the outputs, as many as degrees of freedom, such as of=[('tool', (0, 0, 0), 'xy')]", argument="of"
        )
    keys = keys_of("of", of)
    return None, outputs_of(room, keys), tuple(str(key[0]) if isinstance(key, tuple) else str(key) for key in keys)


def outputs_of(room: Ranged, keys: list[Any]) -> list[Goal]:
    """The numbers to which outputs refer, each once."""
    goals: list[Goal] = []
    for key in keys:
        for goal in rows_of("of", key, room.model, room.start):
            if goal[1:] in [known[1:] for known in goals]:
                raise ArgumentError(f"of names {goal[0]!r} twice; give it once", argument="of")
            goals.append(goal)
    return goals


def _seeds(room: Ranged, others: bool) -> tuple[FloatArray, list[str]]:
    """Closed positions within the range, the start's branch first, and what could not be searched."""
    each = round(SEEDS ** (1.0 / len(room.free)))
    values = [
        np.linspace(axis.values.min(), axis.values.max(), each) if axis.is_free else axis.values for axis in room.axes
    ]
    found = room.poses(room.product(values))
    reached = found["status"] == 0
    if not reached.any():
        raise room.unreachable(found)
    # the start first: it is known to be regular
    seeds = np.vstack([room.start.q, np.asarray(found["q"])[reached]])
    if not others:
        return seeds, ["searched: the branch of the given position"]
    more, notes = [], ["searched: what is connected with the drawing, and other assemblies in closed form"]
    for i in np.unique(np.linspace(0, len(seeds) - 1, OTHERS).astype(int)):
        try:
            listed, _, words = room.model.core.assemblies(room.start.t, seeds[i], inputs_of(room.goals, room.model))
        except PartitaError as error:
            return seeds, [
                "searched: what is connected with the drawing; other assemblies are not known: " + str(error)
            ]
        more += [q for q, _, _ in listed]
        notes += [note for note in words if note not in notes]
    return np.vstack([seeds, *(np.asarray(q)[None] for q in more)]), notes


def _curve(room: Ranged, raw: Mapping[str, Any]) -> SingularCurve:
    firsts = np.cumsum([0, *(len(axis.goals) for axis in room.axes)])
    goals = {axis.key: raw["goals"][:, first + axis.varying] for axis, first in zip(room.axes, firsts, strict=False)}
    ends = tuple(ENDS[end] for end in raw["ends"] or ())
    return SingularCurve(raw["q"], goals, raw["measure"], ends, room.model, room.layout, room.start.t)


def _joined(room: Ranged, points: list[SingularCurve]) -> SingularCurve:
    """Single positions together, in the order of the first goal that varies."""
    nq = room.model.core.nq
    keys = [axis.key for axis in room.axes]
    q = np.vstack([np.empty((0, nq)), *(point.q for point in points)])
    goals = {key: np.concatenate([np.empty(0), *(point.goals[key] for point in points)]) for key in keys}
    measure = np.concatenate([np.empty(0), *(point.measure for point in points)])
    order = np.argsort(goals[room.free[0].key], kind="stable")
    ordered = {key: values[order] for key, values in goals.items()}
    return SingularCurve(q[order], ordered, measure[order], (), room.model, room.layout, room.start.t)


__all__ = ["OUTPUTS", "outputs_of", "singularities"]
