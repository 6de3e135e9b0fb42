"""Ranges of goals: axes of a map, values that are held, and closed positions within."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..builder.actuators import actuators_of
from ..builder.changes import remove
from ..builder.compiled import CompiledModel
from ..builder.maps import ActuatedModel
from ..builder.records import Handle
from ..errors import ArgumentError, AssemblyError
from ..naming import listed
from ..numeric import floats, is_list, shown
from ..options import si
from ..state import Layout, State
from ..tolerance import NEGLIGIBLE
from .branches import on_branch
from .goals import Goal, goals_of, inputs_of, orientation_goals, units_of
from .models import Modelled, compile, layout_of
from .poses import orientations_at, poses_near
from .solve import assemble

FloatArray = NDArray[np.float64]


class Axis(NamedTuple):
    """One goal of a grid."""

    key: Any
    goals: list[Goal]
    """The goal itself; for the rotation of a body in the plane all three components of its orientation."""
    varying: int
    """Which of them it is; the others rest."""
    values: FloatArray
    """Values over which it varies; one where it is held."""
    unit: str

    @property
    def name(self) -> str:
        """Its name."""
        return self.goals[self.varying][0]

    @property
    def is_free(self) -> bool:
        """Whether it varies."""
        return len(self.values) > 1

    def columns(self, values: FloatArray) -> FloatArray:
        """Values of all its goals (n, goals)."""
        found = np.zeros((len(values), len(self.goals)))
        found[:, self.varying] = values
        return found


class Ranged(NamedTuple):
    """A mechanism without drives, and the goals over which a map extends."""

    mechanism: Modelled
    model: CompiledModel
    layout: Layout
    start: State
    axes: list[Axis]
    coordinates: str = "relative"
    parameters: Mapping[str, ArrayLike] | None = None

    @property
    def goals(self) -> list[Goal]:
        """Goals of all axes."""
        return [goal for axis in self.axes for goal in axis.goals]

    @property
    def free(self) -> list[Axis]:
        """Axes that vary."""
        return [axis for axis in self.axes if axis.is_free]

    def product(self, values: list[FloatArray]) -> FloatArray:
        """(n, goals): all combinations of these values of the axes, the last axis fastest."""
        grids = np.meshgrid(*values, indexing="ij")
        return np.hstack([axis.columns(grid.ravel()) for axis, grid in zip(self.axes, grids, strict=True)])

    def poses(self, values: FloatArray) -> dict[str, Any]:
        """Positions for the rows of values on the branch of the start."""
        return self.poses_near(self.start, values)

    def poses_over(self, values: list[FloatArray]) -> dict[str, Any]:
        """The same for all combinations of these values of the axes, in the order of `product`, from neighbour to
        neighbour."""
        orders = [np.argsort(x, kind="stable") for x in values]
        rows = self.product([x[order] for x, order in zip(values, orders, strict=True)])
        shape = [len(x) for x in values]
        wanted = (self.mechanism, self.model, self.start, self.goals, rows, self.coordinates, self.parameters)
        found = poses_near(*wanted, [n for n in shape if n > 1])
        # where each combination is among the sorted ones
        back = np.arange(len(rows)).reshape(shape)[np.ix_(*[np.argsort(order) for order in orders])].ravel()
        numbers = np.empty(len(rows), dtype=int)
        numbers[back] = np.arange(len(rows))
        for key in ("q", "reached", "shortfall", "angle", "detour", "status"):
            found[key] = np.asarray(found[key])[back]
        found["reasons"] = sorted((int(numbers[i]), words) for i, words in found["reasons"])
        return found

    def poses_near(self, start: State, values: FloatArray) -> dict[str, Any]:
        """The same on the branch of another state."""
        return poses_near(self.mechanism, self.model, start, self.goals, values, self.coordinates, self.parameters)

    def unreachable(self, found: Mapping[str, Any]) -> AssemblyError:
        """Why none of these positions could be reached."""
        nearest = int(np.argmin(np.nan_to_num(found["shortfall"], nan=np.inf)))
        reason = dict(found["reasons"]).get(nearest, "its loops do not close there")
        count = len(found["status"])
        return AssemblyError(
            f"grid: none of {count} positions can be reached from the given one; the nearest, number {nearest}: "
            f"{reason}; give values that the mechanism can take, or another branch",
            residual=float(found["shortfall"][nearest]),
            iterations=0,
            loops=reason,
        )


def undriven(self: Modelled) -> Modelled:
    """The mechanism without its drives: goals and actuators move it in their place."""
    if not self._description.drives:
        return self
    released = copy.deepcopy(self)
    for name in list(released._description.drives):
        remove(released, "drives", name)
    return released


def room_of(
    self: Modelled,
    grid: Any,
    near: State | None,
    branch: str | None,
    coordinates: str,
    parameters: Mapping[str, ArrayLike] | None,
) -> Ranged:
    """What a map extends over, checked."""
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    mechanism = undriven(self)
    model, layout = layout_of(mechanism, wanted, parameters)
    start = assemble(mechanism, None, None, near, coordinates=wanted, parameters=parameters)
    axes = _axes(grid, model, start)
    dof, idle = model.core.degrees_of_freedom(start.t, start.q)
    if not dof - idle <= len(axes) <= dof:
        names = listed([axis.name for axis in axes])
        missing = dof - idle - len(axes)
        remedy = (
            f"name {missing} more: one that is to stay where it is gets one number"
            if missing > 0
            else f"leave out {len(axes) - dof}, which follow from the others"
        )
        raise ArgumentError(
            f"grid: {len(axes)} goal{'s' * (len(axes) != 1)} ({names}) for {dof - idle} degree{'s' * (dof != 1)} of "
            f"freedom; {remedy}",
            argument="grid",
        )
    if not any(axis.is_free for axis in axes):
        raise ArgumentError(
            f"grid: {listed([axis.name for axis in axes])} {'are' if len(axes) > 1 else 'is'} held, so that nothing "
            "varies; give values over a range, such as np.linspace(-1, 1, 21)",
            argument="grid",
        )
    if branch is not None:
        inputs = inputs_of([goal for axis in axes for goal in axis.goals], model)
        start = State(start.t, on_branch(model, start.t, start.q, branch, inputs), start.v, layout=layout)
    return Ranged(mechanism, model, layout, start, axes, coordinates, parameters)


def _axes(grid: Any, model: CompiledModel, start: State) -> list[Axis]:
    if not isinstance(grid, Mapping):
        raise ArgumentError(
            f"grid must be a dict such as {{'A': np.linspace(-1, 1, 21)}}, not {shown(grid)}", argument="grid"
        )
    if not grid:
        raise ArgumentError("grid is empty; name a goal for each degree of freedom", argument="grid")
    axes, seen = [], set[tuple[Any, ...]]()
    for key, value in grid.items():
        goals = rows_of("grid", key, model, start)
        index = _plane(key, goals, model, start) if goals[0][1] == "turn" else 0
        if len(goals) != 1 and goals[0][1] != "turn":
            words = f"({str(key[0])!r}, {key[1]}, 'x')" if goals[0][1] == "point" else repr(goals[0][0])
            raise ArgumentError(
                f"grid: {shown(key)} has {len(goals)} numbers; name each by itself, such as {words}", argument="grid"
            )
        goal = goals[index]
        if goal[1:] in seen:
            raise ArgumentError(f"grid names {goal[0]!r} twice; give it once", argument="grid")
        seen.add(goal[1:])
        unit = units_of([goal], model)[0]
        axes.append(Axis(key, goals, index, _values(key, value, unit), unit))
    return axes


def _plane(key: Any, goals: list[Goal], model: CompiledModel, start: State) -> int:
    """The component of the orientation of a body that varies in a planar mechanism."""
    nv = model.core.nv
    turns = model.core.motion(np.full(nv, start.t), np.tile(start.q, (nv, 1)), np.eye(nv)).bodies([goals[0][2]])
    moves = np.abs(turns["body_angular_velocity"][:, 0]).max(axis=0)
    moving = np.flatnonzero(moves > NEGLIGIBLE * float(moves.max()))
    if len(moving) != 1:
        raise ArgumentError(
            f"grid: the orientation of {str(key)!r} has {len(moving)} components that vary; name coordinates of joints "
            "in its place, or the orientation of a body of a mechanism in a plane across an axis of the world",
            argument="grid",
        )
    return int(moving[0])


def _values(key: Any, value: Any, unit: str) -> FloatArray:
    try:
        values = floats(si(f"grid[{shown(key)}]", value, unit))
    except TypeError as error:
        raise ArgumentError(f"grid[{shown(key)}] must be numbers, not {shown(value)}", argument="grid") from error
    if values.ndim > 1:
        raise ArgumentError(
            f"grid[{shown(key)}] has shape {values.shape}; give values along one axis (n,)", argument="grid"
        )
    values = np.atleast_1d(values)
    if not values.size:
        raise ArgumentError(f"grid[{shown(key)}] is empty; give values, or one number that is held", argument="grid")
    if not np.isfinite(values).all():
        i = int(np.argmin(np.isfinite(values)))
        raise ArgumentError(f"grid[{shown(key)}][{i}] is {values[i]:g}; give finite numbers", argument="grid")
    if len(np.unique(values)) < len(values):
        twice = next(x for i, x in enumerate(values) if x in values[:i])
        raise ArgumentError(f"grid[{shown(key)}] has {twice:.6g} twice; give each value once", argument="grid")
    return values


def rows_of(what: str, key: Any, model: CompiledModel, start: State) -> list[Goal]:
    """The numbers to which a key refers; the name of a body, which is no joint's, is its orientation."""
    name = str(key)
    joints = [joint["name"] for joint in model.summary["joints"]]
    bodies = [body["name"] for body in model.summary["bodies"]]
    is_body = name in bodies and name not in joints and name not in model.names
    if isinstance(key, tuple) or not is_body or (isinstance(key, Handle) and key.table != "bodies"):
        return goals_of(what, key, model)
    reference = orientations_at(model, start)(bodies.index(name))
    return orientation_goals(what, (name, (0.0, 0.0, 0.0)), model, reference)


def keys_of(what: str, wanted: Any) -> list[Any]:
    """Names of measurements, at least one, each once."""
    if isinstance(wanted, Handle) or not is_list(wanted):
        raise ArgumentError(f"{what} must be a list of names such as ('A', 'E'), not {shown(wanted)}", argument=what)
    keys = list(wanted)
    if not keys:
        raise ArgumentError(f"{what} is empty; name at least one", argument=what)
    for i, key in enumerate(keys):
        name = (*key, None)[0] if isinstance(key, tuple) else key
        if not isinstance(name, (str, Handle)):
            raise ArgumentError(
                f"{what} must hold names, or points such as ('tool', (0, 0, 0), 'xy') in a list, not {shown(key)}",
                argument=what,
            )
        if repr(key) in map(repr, keys[:i]):
            raise ArgumentError(f"{what} names {shown(key)} twice; give it once", argument=what)
    return keys


def with_actuators(self: Modelled, room: Ranged, wanted: Any) -> ActuatedModel:
    """The mechanism without drives with these actuators; None: what the drives move."""
    summary = compile(self, room.model.coordinates).summary
    return ActuatedModel(room.model, actuators_of(self._description, summary, wanted))
