"""Thousands of poses of a mechanism, assembled in one call on one branch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analyses.still import place
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, AssemblyError
from ..naming import index_of
from ..results.body import BodyResult, resting
from ..state import Layout, State
from ..units import Quantity
from .branches import on_branch
from .goals import Goal, columns, inputs_of, relative_to
from .models import Modelled, layout_of
from .solve import _converted, assemble

FloatArray = NDArray[np.float64]


class Poses:
    """Poses found by `Mechanism.assemble_many`, one row for each, in the given order. Iterating yields a `State` for
    each.

    Attributes:
        q: coordinates (n, nq), named by `names`; NaN where a pose was not assembled.
        ok: (n,) bool: assembled on the branch.
        status: (n,) words: "closed", "open" (the loops cannot close there), "other branch" (they can, but not on this
            one), "singular" (behind a position in which branches meet) or "contradiction" (of the targets).
        reasons: index of a pose -> why it was not assembled: the loop and its joints, where the path of the targets
            ended, and the closure error.
        shortfall: (n,) closure error of the nearest position [m]; 0 where assembled, NaN where unknown.
        shortfall_angle: (n,) the same for directions [rad].
        reached: target -> how far the direct path from the state of the branch led, (n,) or (n, numbers of the target);
            of an orientation, after the position, the rotation vector relative to that state [rad].
        detour: (n,) bool: reached not on the direct path, but on another path of the branch.
        branch: block of loops -> its sign, if the poses were found in closed form; otherwise None.
        near: the state whose branch it is."""

    def __init__(
        self,
        model: CompiledModel,
        layout: Layout,
        near: State,
        found: dict[str, Any],
        indices: Mapping[str, list[int]],
    ) -> None:
        self._model, self._layout = model, layout
        self.near = near
        self.q: FloatArray = found["q"]
        self.status: NDArray[np.str_] = found["status"]
        self.ok: NDArray[np.bool_] = found["ok"]
        self.reasons: dict[int, str] = dict(found["reasons"])
        self.shortfall: FloatArray = found["shortfall"]
        self.shortfall_angle: FloatArray = found["angle"]
        self.detour: NDArray[np.bool_] = found["detour"]
        self.branch: dict[str, int] | None = None if found["branch"] is None else dict(found["branch"])
        reached: FloatArray = found["reached"]
        self.reached: dict[str, FloatArray] = {
            key: reached[:, which[0]] if len(which) == 1 else reached[:, which] for key, which in indices.items()
        }

    @property
    def names(self) -> list[str]:
        """Names of the columns of `q`."""
        return list(self._model.names)

    def __len__(self) -> int:
        return len(self.ok)

    def __getitem__(self, index: int) -> State:
        return self.state(index)

    def __iter__(self) -> Iterator[State]:
        return (self.state(i) for i in range(len(self)))

    def state(self, index: int) -> State:
        """Pose number `index`, at rest. Raises `AssemblyError`, with the reason, where it was not assembled."""
        i = place(index, len(self), "a pose")
        if not self.ok[i]:
            raise AssemblyError(
                f"pose {i}: {self.reasons[i]}", residual=float(self.shortfall[i]), iterations=0, loops=self.reasons[i]
            )
        return State(self.near.t, self.q[i], np.zeros(self._model.core.nv), layout=self._layout)

    def body(self, name: Any) -> BodyResult:
        """Positions (n, 3) and rotations (n, 3, 3) of a body in all poses, by name or handle; NaN where a pose was not
        assembled. Its `point` gives that of any point fixed to it."""
        if str(name) == "ground":
            return resting("ground", len(self))
        bodies = [body["name"] for body in self._model.summary["bodies"]]
        i = index_of(str(name), bodies, "body")
        found = self._motion().bodies([i])
        one = {key: np.asarray(array)[:, 0] if np.ndim(array) > 1 else array for key, array in found.items()}
        return BodyResult(
            str(name),
            one["body_position"].reshape(-1, 3),
            one["body_rotation"].reshape(-1, 3, 3),
            one["body_velocity"].reshape(-1, 3),
            one["body_angular_velocity"].reshape(-1, 3),
        )

    def joint(self, name: Any) -> FloatArray:
        """Coordinates of a joint in all poses, also of one that closes a loop: (n,) where it has one, else
        (n, coordinates) [rad, m]."""
        joints = self._model.summary["joints"]
        i = index_of(str(name), [joint["name"] for joint in joints], "joint")
        found: FloatArray = np.asarray(self._motion().joints([i])["joint_position"])
        return found[:, 0] if found.shape[1] == 1 else found

    def _motion(self) -> Any:
        core, n = self._model.core, len(self)
        return core.motion(np.full(n, self.near.t), self.q, np.zeros((n, core.nv)))

    def __repr__(self) -> str:
        kinds, counts = np.unique(self.status, return_counts=True)
        words = ", ".join(f"{count} {kind}" for kind, count in zip(kinds, counts, strict=True))
        return f"<{len(self)} poses: {words or 'none'}>"


def assemble_many(
    self: Modelled,
    targets: Mapping[Any, Any],
    near: State | None = None,
    *,
    branch: str | None = None,
    t: Quantity | None = None,
) -> Poses:
    """Assemble the mechanism for many values of its targets at once, every pose on the branch of one state.

    A pose is found by continuation: the targets vary linearly from their values in the branch's state, in steps that
    are checked to stay on the branch and that end at a limit or a singular position, where branches meet; then the
    targets are varied one after the other. Poses whose targets are coordinates share such steps up to positions 0.2 rad
    (or lengths of the mechanism) apart, and each takes the last one alone. If the targets are inputs from which all
    loops follow in closed form (planar dyads, spatial loops with one or two ball joints), the branch is the sign of
    each block, and a pose is found wherever its loops close with these signs. Prefer it to repeated calls of
    `assemble`: it runs on all cores, and the result for a pose depends only on that pose and the branch's state.

    Args:
        targets: joint (name or handle) -> positions [rad or m], (n,) or (n, coordinates); one coordinate of several by
            its name; joints that close loops are treated like all others. A point of a body, ("coupler", (0.6, 0, 0))
            in body axes, -> positions (n, 3) in the world [m]; ("coupler", (0.6, 0, 0), "xy") -> (n, 2). A point with
            the orientation of its body -> (positions, orientations): positions (n, 3), and rotation matrices (n, 3, 3),
            quaternions (n, 4) or a SciPy `Rotation`; or a SciPy `RigidTransform`. A single value applies to all poses.
            Coordinates that the targets leave free move as little as possible.
        near: state that defines the branch, as returned by `assemble` or `assemblies`; None: the drawing.
        branch: signs of the blocks, such as "+-", instead of those of `near`, as reported in `Assembled.branch` with
            the targets as inputs.
        t: time [s], which matters if motions are prescribed; None: that of `near`, otherwise 0.

    Returns:
        `Poses`: coordinates, which poses were assembled, and why the others were not.

    Raises:
        ArgumentError: shapes do not match, or numbers are not finite. UnknownNameError: a key is not a joint,
            coordinate or body. AssemblyError: the loops cannot be closed at `near`.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> poses = m.assemble_many({"A": np.linspace(0.0, 6.0, 5)})
    >>> poses
    <5 poses: 5 closed>
    >>> poses.body("rocker").point((0, 0, 0)).shape
    (5, 3)
    """
    found = found_poses(self, targets, near, branch, t)
    return Poses(found.model, found.layout, found.start, found.raw, {str(key): i for key, i in found.indices.items()})


class PosesFound(NamedTuple):
    """Poses as the core found them, and what was asked for."""

    model: CompiledModel
    layout: Layout
    start: State
    goals: list[Goal]
    values: FloatArray
    """(n, goals)."""
    indices: dict[Any, list[int]]
    raw: dict[str, Any]


def found_poses(
    self: Modelled,
    targets: Mapping[Any, Any],
    near: State | None,
    branch: str | None,
    t: Quantity | None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
    check: Callable[[CompiledModel, State, list[Goal]], None] | None = None,
) -> PosesFound:
    """Poses for many values of the targets on one branch; `check` may refuse the goals before they are sought."""
    model, layout = layout_of(self, coordinates, parameters)
    start = assemble(self, None, None, near, t=t, coordinates=coordinates, parameters=parameters)
    framed = relative_to(orientations_at(model, start), model)
    goals, values, indices = columns("targets", targets, model, framed)
    if check is not None:
        check(model, start, goals)
    if branch is not None:
        inputs = inputs_of(goals, model)
        start = State(start.t, on_branch(model, start.t, start.q, branch, inputs), start.v, layout=layout)
    raw = poses_near(self, model, start, goals, values, coordinates, parameters)
    numbers = raw["status"]
    raw["ok"], raw["status"] = numbers == 0, np.array(raw["words"], dtype="U13")[numbers]
    return PosesFound(model, layout, start, goals, values, indices, raw)


def poses_near(
    self: Modelled,
    model: CompiledModel,
    start: State,
    goals: list[Goal],
    values: FloatArray,
    coordinates: str,
    parameters: Mapping[str, ArrayLike] | None,
    grid: Sequence[int] | None = None,
) -> dict[str, Any]:
    """Poses for the rows of values on the branch of a state; those of a grid from neighbour to neighbour. Where a
    coupling constrains rates alone in absolute coordinates, its phase is known in relative ones, in which they are
    found then."""
    try:
        return model.core.poses(start.t, start.q, goals, values, grid)
    except ArgumentError as error:
        if error.argument != "coordinates" or coordinates != "absolute":
            raise
    relative, _ = layout_of(self, "relative", parameters)
    near = _converted(self, start, "relative", parameters)
    raw = relative.core.poses(near.t, near.q, goals, values, grid)
    rows = np.full((len(values), start.q.size), np.nan)
    rest = np.zeros(near.v.size)
    for i in np.flatnonzero(raw["status"] == 0):
        rows[i], _ = model.core.transferred(relative.core, raw["q"][i], rest)
    raw["q"] = rows
    return raw


def orientations_at(model: CompiledModel, state: State) -> Callable[[int], FloatArray]:
    """Orientation (3, 3) of a body, by its number, in a state."""

    def of(body: int) -> FloatArray:
        found = model.core.motion(np.array([state.t]), state.q[None], np.zeros((1, state.v.size))).bodies([body])
        return np.asarray(found["body_rotation"][0, 0])

    return of
