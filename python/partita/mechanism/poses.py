"""Thousands of poses of a mechanism, assembled in one call on one branch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, AssemblyError
from ..naming import index_of
from ..numeric import shown
from ..results.body import BodyResult, resting
from ..state import Layout, State
from .branches import on_branch
from .goals import columns, inputs_of
from .models import Modelled, layout_of
from .solve import assemble

FloatArray = NDArray[np.float64]


class Poses:
    """Poses that `Mechanism.assemble_many` found, a row for each in the order asked for. Iterable: a `State` each.

    Attributes:
        q: coordinates (n, nq), named by `names`; NaN where a pose was not assembled.
        ok: (n,) bool: assembled on the branch.
        status: (n,) words: "closed", "open" (the loops cannot close there), "other branch" (they can, but not on this
            one), "singular" (behind a position in which branches meet) or "contradiction" (of the targets).
        reasons: why, by the number of the pose, for those that were not assembled: which loop and joints, where the
        path of the targets ended, and the closure error. shortfall: (n,) by how much the nearest position stays open
        [m]; 0 where assembled, NaN where unknown. shortfall_angle: (n,) the same for directions [rad]. reached: target
        -> how far the direct path from the state of the branch led, (n,) or (n, numbers of the target). detour: (n,)
        bool: not reached on the direct path, but on another path of the branch. branch: sign of each block of loops by
        its words, where the poses were found in closed form; else None. near: the state whose branch it is.
    """

    def __init__(
        self,
        model: CompiledModel,
        layout: Layout,
        near: State,
        found: dict[str, Any],
        places: Mapping[str, list[int]],
    ) -> None:
        self._model, self._layout = model, layout
        self.near = near
        self.q: FloatArray = found["q"]
        self.status = np.array(found["status"], dtype="U13")
        self.ok: NDArray[np.bool_] = self.status == "closed"
        self.reasons: dict[int, str] = dict(found["reasons"])
        self.shortfall: FloatArray = found["shortfall"]
        self.shortfall_angle: FloatArray = found["angle"]
        self.detour: NDArray[np.bool_] = found["detour"]
        self.branch: dict[str, int] | None = None if found["branch"] is None else dict(found["branch"])
        reached: FloatArray = found["reached"]
        self.reached: dict[str, FloatArray] = {
            key: reached[:, which[0]] if len(which) == 1 else reached[:, which] for key, which in places.items()
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
        try:
            i = range(len(self))[index]
        except TypeError:
            raise ArgumentError(
                f"the number of a pose must be an integer, not {shown(index)}", argument="index"
            ) from None
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
        found = self._model.core.bodies(*self._motion(), [i])
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
        found: FloatArray = np.asarray(self._model.core.joints(*self._motion(), [i])["joint_position"])
        return found[:, 0] if found.shape[1] == 1 else found

    def _motion(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        n = len(self)
        return np.full(n, self.near.t), self.q, np.zeros((n, self._model.core.nv))

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
    t: float | None = None,
) -> Poses:
    """Assemble the mechanism for many values of its targets at once, every pose on the branch of one state.

    A pose is found by following the motion while the targets go straight from where they are in the branch's state: in
    steps that are checked to stay on the branch, refused where a limit or a singular position (in which branches meet)
    stands in the way, and then tried with the targets going one after the other. Where several targets are inputs from
    which all loops follow in closed form (planar dyads, spatial loops with a ball joint or two), the branch is the
    sign of each block, and a pose is found wherever its loops close with these signs. Prefer it to calls of
    `assemble` in sweeps: it runs on all cores, and what it says of a pose depends on that pose and the branch's state
    alone.

    Args:
        targets: joint (name or handle) -> positions [rad or m], (n,) or (n, coordinates); one coordinate of several by
            its name; joints that close loops count as all others. A point of a body, ("coupler", (0.6, 0, 0)) in body
            axes, -> places (n, 3) in the world [m]; ("coupler", (0.6, 0, 0), "xy") -> (n, 2). One value serves all
            poses. What the targets leave free moves as little as it can.
        near: state whose branch it is, as `assemble` or `assemblies` returns it; None: that of the drawing.
        branch: signs of the blocks, such as "+-", as `Assembled.branch` tells them for the targets as inputs, instead
            of those of `near`.
        t: time [s], which matters where motion is prescribed; None: that of `near`, else 0.

    Returns:
        `Poses`: coordinates, which poses were assembled, and why the others were not.

    Raises:
        ArgumentError: shapes that do not fit, numbers that are not finite. UnknownNameError: a key is no joint,
            coordinate or body. AssemblyError: `near` cannot be closed.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> poses = m.assemble_many({"A": np.linspace(0.0, 6.0, 5)})
    >>> poses
    <5 poses: 5 closed>
    >>> poses.body("rocker").point((0, 0, 0)).shape
    (5, 3)
    """
    model, layout = layout_of(self, "relative")
    goals, values, places = columns("targets", targets, model)
    start = assemble(self, None, None, near, t=t)
    if branch is not None:
        inputs = inputs_of(goals, model)
        start = State(start.t, on_branch(model, start.t, start.q, branch, inputs), start.v, layout=layout)
    found = model.core.poses(start.t, start.q, goals, values)
    return Poses(model, layout, start, found, places)
