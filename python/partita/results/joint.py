"""One joint of a run: its motion, its reaction, and which part of the reaction is unique."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError

FloatArray = NDArray[np.float64]
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True)
class JointWrench:
    """Reaction in world axes with what is needed to express it elsewhere; sizes for nt outputs."""

    force: FloatArray  # (nt, 3) [N]
    moment: FloatArray  # (nt, 3) [N m]
    rotation: FloatArray  # (nt, 3, 3) columns: axes of the joint in the world
    determined_world: NDArray[np.bool_]  # (6,)
    determined_joint: NDArray[np.bool_]  # (6,)


@dataclass(frozen=True)
class JointResult:
    """Motion and reaction of one joint over the nt outputs of a run.

    The reaction is the action of the joint's constraints on its *child* body, a drive's effort included,
    reduced to the joint's point on the child. `force` and `moment` stand in world axes unless `in_frame`
    asked for others; `axes` tells which.

    Some reactions cannot be known from rigid bodies: where constraints are redundant, their share is a
    matter of elasticity. `determined` says of each component whether it is unique. It is judged at the
    output farthest from a singular position, since *in* a singular position more becomes indeterminate
    for an instant. Components that are not determined are one possible answer among infinitely many.
    """

    name: str
    kind: str
    parent: str
    child: str
    position: FloatArray
    """(nt, nq of the joint): its coordinates [m or rad; quaternions scalar first], zero as drawn."""
    velocity: FloatArray
    """(nt, dof): their velocities [m/s or rad/s]."""
    drive: FloatArray
    """(nt, dof): effort of a drive along each freedom [N or N m]; zero where nothing drives."""
    point: FloatArray
    """(nt, 3): the joint's point on the child, always in world axes [m]."""
    wrench: JointWrench
    axes: str = "world"
    _turn: FloatArray | None = None

    @property
    def force(self) -> FloatArray:
        """(nt, 3): force on the child [N], in the axes named by `axes`."""
        return self._expressed(self.wrench.force)

    @property
    def moment(self) -> FloatArray:
        """(nt, 3): moment on the child about the joint's point [N m], in the axes named by `axes`."""
        return self._expressed(self.wrench.moment)

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(6,): which of fx, fy, fz, mx, my, mz are unique, in the axes named by `axes`.

        In world and joint axes the answer is exact. In axes of your own, `True` is certain; `False` may
        also mean that the component mixes a unique and a non-unique one of the world's and joint's axes.
        """
        if self.axes == "world":
            return self.wrench.determined_world
        if self.axes == "joint":
            return self.wrench.determined_joint
        assert self._turn is not None
        from_world = _mixed(self.wrench.determined_world, self._turn)
        from_joint = _mixed(self.wrench.determined_joint, _transposed(self.wrench.rotation) @ self._turn)
        return from_world | from_joint

    def in_frame(self, axes: Literal["world", "joint"] | ArrayLike) -> JointResult:
        """The same joint with `force`, `moment` and `determined` along other axes.

        `"joint"`: the joint's axes on the parent body, moving with it. `"world"`: back again. A rotation
        matrix (3, 3), or one per output (nt, 3, 3), has the wanted axes as columns, given in the world.
        The point of reduction stays where it is. Raises `ArgumentError` for anything else.

        >>> load = result.joint("A").in_frame("joint").force          # doctest: +SKIP
        """
        if isinstance(axes, str):
            if axes == "world":
                return replace(self, axes="world", _turn=None)
            if axes == "joint":
                return replace(self, axes="joint", _turn=self.wrench.rotation)
            raise ArgumentError(
                f'in_frame: unknown frame {axes!r}; use "world", "joint" or a 3x3 rotation matrix', argument="axes"
            )
        return replace(self, axes="own", _turn=_rotation(axes, len(self.point)))

    def _expressed(self, vectors: FloatArray) -> FloatArray:
        if self._turn is None:
            return vectors
        return np.einsum("...ij,...i->...j", self._turn, vectors)

    def __repr__(self) -> str:
        unique = [c for c, yes in zip(COMPONENTS, self.determined, strict=True) if yes]
        return (
            f"<joint {self.name!r}: {self.kind}, {self.parent} -> {self.child}, {len(self.position)} outputs, "
            f"reaction in {self.axes} axes, determined: {', '.join(unique) or 'none'}>"
        )


def _rotation(axes: ArrayLike, nt: int) -> FloatArray:
    """`axes` as a checked rotation, (3, 3) or (nt, 3, 3)."""
    try:
        turn = np.asarray(axes, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"in_frame: expected a 3x3 rotation matrix, got {type(axes).__name__}", argument="axes"
        ) from None
    if turn.shape not in ((3, 3), (nt, 3, 3)):
        raise ArgumentError(
            f"in_frame: a rotation must have shape (3, 3) or ({nt}, 3, 3), got {turn.shape}", argument="axes"
        )
    defect = float(np.max(np.abs(_transposed(turn) @ turn - np.eye(3)), initial=0.0))
    if not defect < 1e-8 or np.any(np.linalg.det(turn) < 0):
        raise ArgumentError(
            f"in_frame: not a right-handed rotation matrix (orthogonal to {defect:.1e} only, or mirrored); "
            "its columns must be three perpendicular unit axes",
            argument="axes",
        )
    return turn


def _mixed(determined: NDArray[np.bool_], turn: FloatArray) -> NDArray[np.bool_]:
    """Components along new axes are unique when every old component they draw on is."""
    used = np.abs(turn) > 1e-9
    used = np.asarray(used.reshape(-1, 3, 3).any(axis=0))
    force, moment = determined[:3], determined[3:]
    return np.array(
        [force[used[:, j]].all() for j in range(3)] + [moment[used[:, j]].all() for j in range(3)], dtype=bool
    )


def _transposed(turn: FloatArray) -> FloatArray:
    return np.swapaxes(turn, -1, -2)
