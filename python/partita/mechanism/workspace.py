"""`Mechanism.workspace`: what is reached over a grid, and how well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.singularities import body_at
from ..analyses.workspace import Workspace
from ..errors import ArgumentError, PartitaError
from ..numeric import shown
from ..state import State
from .branches import name_of
from .goals import goals_of, inputs_of
from .models import Modelled
from .ranges import Ranged, keys_of, room_of, with_actuators
from .singularities import outputs_of

FloatArray = NDArray[np.float64]
SEEDS = 25
"""Positions at which the branches are listed."""


def workspace(
    self: Modelled,
    grid: Mapping[Any, Any],
    of: Any = None,
    actuators: Any = None,
    *,
    outputs: Any = None,
    assemblies: bool = False,
    branch: str | None = None,
    near: State | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Workspace:
    """Compute over a grid of goals which positions the mechanism takes, and how well its actuators move it there.

    All positions lie on the branch of one state. Where the loops follow from the goals in closed form they are found as
    by `assemble_many`; otherwise each from its neighbours in the grid, so that what lies behind a hole is found too.
    For the curves on which a margin is zero use `singularities`; for the best set of actuators pass the result to
    `placement`.

    Args:
        grid: goal -> values, as in `singularities`, with any number of goals that vary: the maps are over all
            combinations of their values. One goal for each degree of freedom.
        of: (body, (x, y, z)) in body axes: the point whose positions are returned as `positions`; None: none.
        actuators: as in `inverse_dynamics`: as many as degrees of freedom, or more; None: what the drives move, or,
            without drives, the goals that are coordinates of joints.
        outputs: measurements as in `singularities`, whose margin is wanted too.
        assemblies: whether to count the assemblies at each position, where the loops can be solved in closed form.
        branch: signs of the blocks in which the loops are closed, as in `assemble_many`.
        near: state that defines the branch; None: the drawing.
        coordinates: "relative" or "absolute", as in `compile`.
        parameters: name -> value, numbers that replace those of the drawing, as in `CompiledModel.with_parameters`.

    Returns:
        `Workspace`: maps in the shape of the grid.

    Raises:
        ArgumentError: goals are too few or too many, numbers are not finite, or something is no actuator.
            UnknownNameError: a name does not exist. AssemblyError: no position of the grid can be reached.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("five-bar")
    >>> w = m.workspace({"A": np.linspace(-1, 1, 5), "E": np.linspace(-1, 1, 5)}, actuators=("A", "E"))
    >>> w.margin.shape
    (5, 5)
    """
    counted = run_options.yes_or_no("assemblies", assemblies)
    room = room_of(self, grid, near, branch, coordinates, parameters)
    if actuators is None and not self._description.drives:
        actuators = [axis.name for axis in room.axes if axis.goals[0][1] in ("joint", "own")]
        if len(actuators) < len(room.axes):
            raise ArgumentError(
                "actuators: the mechanism has no drives, and not all goals are coordinates of joints, so name the "
                "actuators, such as actuators=('A', 'E')",
                argument="actuators",
            )
    actuated = with_actuators(self, room, actuators)
    values = room.product([axis.values for axis in room.axes])
    found = room.poses_over([axis.values for axis in room.axes])
    reached = found["status"] == 0
    if not reached.any():
        raise room.unreachable(found)
    shape = tuple(len(axis.values) for axis in room.free)
    q = np.where(reached[:, None], np.asarray(found["q"]), np.nan)
    effects, constraints, _ = actuated.effects(room.start.t, q)
    dof, idle = room.model.core.degrees_of_freedom(room.start.t, room.start.q)
    margin = least_value(effects, dof - idle)
    sheets, notes = _sheets(room, values, np.asarray(found["q"])[reached]) if counted else ({}, [])
    count = np.sum([np.isfinite(rows[:, 0]) for rows in sheets.values()], axis=0) if sheets else None
    reasons = dict(found["reasons"])
    positions = None if of is None else _point(room, of, q)
    return Workspace(
        title=room.model.summary["name"],
        actuators=actuated.names,
        keys=tuple(axis.key for axis in room.free),
        axes=tuple(axis.values for axis in room.free),
        units=tuple(axis.unit for axis in room.free),
        held={axis.key: float(axis.values[0]) for axis in room.axes if not axis.is_free},
        reached=reached.reshape(shape),
        reasons={
            tuple(int(x) for x in np.unravel_index(i, shape)): reasons.get(int(i), "its loops do not close")
            for i in np.flatnonzero(~reached)
        },
        q=q.reshape(*shape, -1),
        positions=None if positions is None else positions.reshape(*shape, 3),
        margin=margin.reshape(shape),
        constraints=constraints.reshape(shape),
        outputs=None if outputs is None else _outputs(room, outputs, q).reshape(shape),
        assemblies=None if count is None else count.reshape(shape),
        sheets={name: rows.reshape(*shape, -1) for name, rows in sheets.items()},
        notes=tuple(notes),
        _model=room.model,
        _layout=room.layout,
        _start=room.start,
    )


def least_value(scaled: FloatArray, k: int) -> FloatArray:
    """(...,): the least of k singular values of matrices (..., motions, s); NaN where they have one."""
    known = np.isfinite(scaled).all(axis=(-2, -1))
    margin = np.full(scaled.shape[:-2], np.nan)
    if known.any() and scaled.shape[-2] and scaled.shape[-1]:
        margin[known] = np.linalg.svd(scaled[known], compute_uv=False)[..., min(k, scaled.shape[-1]) - 1]
    return margin


def _point(room: Ranged, of: Any, q: FloatArray) -> FloatArray:
    """Positions of a point given as (body, (x, y, z))."""
    if not isinstance(of, tuple) or len(of) != 2:
        raise ArgumentError(
            f"of must be a point (body, (x, y, z)) in body axes, such as ('tool', (0, 0, 0)), not {shown(of)}",
            argument="of",
        )
    ((_, _, body, _, point), *_) = goals_of("of", of, room.model)
    name = room.model.summary["bodies"][body]["name"]
    found: FloatArray = body_at(room.model, room.start.t, q, name).point(point)
    return found


def _outputs(room: Ranged, wanted: Any, q: FloatArray) -> FloatArray:
    """The margin of the outputs at the rows of q."""
    goals = outputs_of(room, keys_of("outputs", wanted))
    still = np.zeros((len(q), len(goals)))
    found: FloatArray = room.model.core.rates(room.start.t, room.start.q, np.ascontiguousarray(q), goals, still, still)[
        "margin"
    ]
    return found


def _sheets(room: Ranged, values: FloatArray, seeds: FloatArray) -> tuple[dict[str, FloatArray], list[str]]:
    """Coordinates on each branch of the loops for these values; none where they are not solved in closed form."""
    core, start = room.model.core, room.start
    inputs = inputs_of(room.goals, room.model)
    if inputs is None:
        return {}, ["the assemblies are not counted: the goals are not coordinates of the state"]
    first: dict[str, FloatArray] = {}
    notes: list[str] = []
    for i in np.unique(np.linspace(0, len(seeds) - 1, SEEDS).astype(int)):
        try:
            listed, _, words = core.assemblies(start.t, seeds[i], inputs)
        except PartitaError as error:
            return {}, [f"the assemblies are not counted: {error}"]
        for q, signs, _ in listed:
            first.setdefault(name_of(signs), q)
        notes += [f"assemblies: {note}" for note in words if f"assemblies: {note}" not in notes]
    sheets = {}
    for name, q in sorted(first.items()):
        found = room.poses_near(State(start.t, q, start.v, layout=room.layout), values)
        reached = found["status"] == 0
        sheets[name] = np.where(reached[:, None], np.asarray(found["q"]), np.nan)
    return sheets, notes
