"""One joint of a run: its motion, its reaction, and which part of the reaction is unique."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError, UnknownAttributeError
from ..numeric import floats
from ..tolerance import EQUAL
from ..units import UnitArray
from .source import Arrays, Source, Span, columns

FloatArray = NDArray[np.float64]
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
OF_REACTIONS = ("force", "moment", "drive", "drive_determined", "determined", "determined_at", "directions", "in_frame")
"""What a joint offers only where forces are computed."""
ELSEWHERE = {
    "torque": "drive, the effort of a drive, or moment, the moment of the reaction",
    "effort": "drive, the effort of a drive",
    "reaction": "force and moment",
    "plot": "run.plot(name)",
    "rate": "velocity",
    "rotation": "angle",
    "translation": "displacement",
}
"""Words that people look for at a joint, and what they mean."""
ONE_OF = {"angle": "rad", "displacement": "m"}
"""What a joint offers where exactly one of its coordinates has this unit."""


class JointIndices(NamedTuple):
    """Index of the joint, and where its coordinates are among those of all joints (first, count)."""

    number: int
    q: Span
    v: Span


class JointData(Protocol):
    """Data of a joint, known or computed on first access."""

    @property
    def motion(self) -> Arrays:
        """`joint_position`, `joint_velocity`, `joint_point` at every output."""

    @property
    def acceleration(self) -> FloatArray:
        """(nt, dof): accelerations along its degrees of freedom."""

    @property
    def reaction(self) -> Arrays:
        """`force`, `moment`, `drive`, `joint_rotation` at every output."""

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(nt, 6) in world axes and (nt, 6) in the joint's."""

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        """(nt, dof): which efforts are unique."""

    @property
    def self_stresses(self) -> FloatArray | None:
        """(nt, 2, 3, 3): directions in which self-stresses load the joint; None where the model is missing."""


class AskedJoint:
    """A joint of a result: everything comes from the result's source."""

    def __init__(self, source: Source, indices: JointIndices) -> None:
        self._source, self._indices = source, indices

    @property
    def motion(self) -> Arrays:
        return self._source.joint(*self._indices)

    @property
    def acceleration(self) -> FloatArray:
        return self._source.joint_acceleration(self._indices.number, self._indices.v)

    @property
    def reaction(self) -> Arrays:
        return self._source.reaction(self._indices.number, self._indices.v)

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        world, joint = self._source.determined
        return world[:, self._indices.number], joint[:, self._indices.number]

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        return columns(self._source.determined_drive, self._indices.v)

    @property
    def self_stresses(self) -> FloatArray | None:
        return self._source.self_stresses(self._indices.number)

    def __reduce__(self) -> tuple[Callable[..., KnownJoint], tuple[Any, ...]]:
        motion, acceleration, reaction = dict(self.motion), self.acceleration, dict(self.reaction)
        return KnownJoint, (motion, acceleration, reaction, self.determined, self.determined_drive, self.self_stresses)


class KnownJoint(NamedTuple):
    """A joint that was read before: plain arrays."""

    motion: Arrays
    acceleration: FloatArray
    reaction: Arrays
    determined: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    determined_drive: NDArray[np.bool_]
    self_stresses: FloatArray | None


class Directions(NamedTuple):
    """Orthonormal directions, as rows, in which self-stresses load a joint and in which they do not."""

    forces_open: FloatArray
    """(k, 3): directions in which the force is not unique."""
    forces_determined: FloatArray
    """(3 - k, 3): directions in which it is."""
    moments_open: FloatArray
    """(k, 3): directions in which the moment is not unique."""
    moments_determined: FloatArray
    """(3 - k, 3): directions in which it is."""


class JointKinematics:
    """Motion of one joint over nt outputs, in the tree or closing a loop.

    Its coordinates, velocities and point are computed at the first access to one of them, its accelerations at the
    first `acceleration`, each for all outputs at once.

    Attributes:
        name, kind: of the joint.
        parent, child: names of its bodies.
    """

    def __init__(
        self, name: str, kind: str, parent: str, child: str, data: JointData, units: Sequence[str] = ()
    ) -> None:
        self.name, self.kind, self.parent, self.child = name, kind, parent, child
        self._data, self._units = data, tuple(units)

    @property
    def position(self) -> FloatArray:
        """(nt, nq of the joint): its coordinates [m or rad; quaternions scalar first], zero as drawn."""
        return self._data.motion["joint_position"]

    @property
    def velocity(self) -> FloatArray:
        """(nt, dof): their velocities [m/s or rad/s]."""
        return self._data.motion["joint_velocity"]

    @property
    def acceleration(self) -> FloatArray:
        """(nt, dof): derivatives of `velocity` [m/s^2 or rad/s^2], exactly those of the equations of motion; NaN at
        singular positions, where they are undetermined."""
        return self._data.acceleration

    @property
    def angle(self) -> UnitArray:
        """(nt,): the angle of a joint with one rotation [rad], beyond one turn too; `angle.to("deg")` in degrees."""
        return self._one("angle")

    @property
    def displacement(self) -> UnitArray:
        """(nt,): the displacement of a joint with one translation [m]; `displacement.to("mm")` in millimetres."""
        return self._one("displacement")

    def _one(self, word: str) -> UnitArray:
        """The only coordinate with the unit of the word."""
        unit = ONE_OF[word]
        found = [i for i, own in enumerate(self._units) if own == unit]
        if len(found) != 1:
            raise self._undefined(word)
        return UnitArray(self.position[:, found[0]], unit)

    def _undefined(self, word: str) -> UnknownAttributeError:
        unit = ONE_OF[word]
        return UnknownAttributeError(
            f"joint {self.name!r} ({self.kind}) has {self._units.count(unit)} coordinates in {unit}, so {word} is not "
            f"defined; read its position (nt, {len(self._units)}), in {', '.join(self._units) or 'no unit'}",
            name=word,
            known=["position", "velocity", "acceleration"],
        )

    @property
    def point(self) -> FloatArray:
        """(nt, 3): the joint's point on the child, always in world axes [m]."""
        return self._data.motion["joint_point"]

    def __getattr__(self, name: str) -> Any:
        if name in ONE_OF:  # whose property raised
            raise self._undefined(name)
        if name in ELSEWHERE:
            raise UnknownAttributeError(
                f"joint {self.name!r} has no {name}; use {ELSEWHERE[name]}", name=name, known=[ELSEWHERE[name]]
            )
        if name in OF_REACTIONS:
            raise UnknownAttributeError(
                f"joint {self.name!r} has no {name} here: kinematics computes motions, not forces; simulate "
                "the motion, with drives where it is prescribed, and ask its result",
                name=name,
                known=["position", "velocity", "acceleration", "point"],
            )
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __repr__(self) -> str:
        return f"<joint {self.name!r}: {self.kind}, {self.parent} -> {self.child}, {len(self.point)} poses>"


class JointResult(JointKinematics):
    """Motion and reaction of one joint over the nt outputs of a run.

    Nothing is computed before it is accessed: the motion of this joint at the first `position`, `velocity` or `point`,
    its accelerations at the first `acceleration`, its reaction at the first `force`, `moment` or `drive`, each for all
    outputs at once.

    The reaction is the wrench of the joint's constraints on its child body, including the effort of a drive, about
    the joint's point on the child. `force` and `moment` are in world axes unless `in_frame` selected others; `axes`
    says which.

    Rigid-body dynamics does not determine all reactions: where constraints are redundant, the load distribution depends
    on elasticity. `determined_at` says for each component and output whether it is unique, `determined` whether it is
    unique at all outputs, and `drive_determined` the same for the efforts of drives. Undetermined components are chosen
    by one rule: the least sum of squares of all forces, and of all moments divided by a length, that is consistent with
    the motion; or the least elastic energy if `Mechanism.add_compliance` gave compliances. See docs/reactions.md.

    Attributes:
        name, kind: of the joint.
        parent, child: names of its bodies.
        axes: "world", "joint" or "own", the axes of `force`, `moment`, `determined` and `determined_at`.
    """

    def __init__(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        data: JointData,
        axes: str = "world",
        turn: FloatArray | None = None,
        units: Sequence[str] = (),
    ) -> None:
        super().__init__(name, kind, parent, child, data, units)
        self.axes = axes
        self._turn = turn

    @property
    def drive(self) -> FloatArray:
        """(nt, dof): effort of a drive along each degree of freedom [N or N m]; zero without a drive."""
        return self._data.reaction["drive"]

    @property
    def drive_determined(self) -> NDArray[np.bool_]:
        """(dof,): which efforts of drives are unique at every output; two drives on one motion share it by the rule."""
        return np.asarray(self._data.determined_drive.all(axis=0))

    @property
    def force(self) -> FloatArray:
        """(nt, 3): force on the child [N], in the axes named by `axes`."""
        return self._expressed(self._data.reaction["force"])

    @property
    def moment(self) -> FloatArray:
        """(nt, 3): moment on the child about the joint's point [N m], in the axes named by `axes`."""
        return self._expressed(self._data.reaction["moment"])

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(6,): which of fx, fy, fz, mx, my, mz are unique at every output, in the axes named by `axes`.

        A run through a singular position has one or two outputs with more undetermined components than elsewhere;
        `determined_at` shows which.
        """
        return np.asarray(self.determined_at.all(axis=0))

    @property
    def determined_at(self) -> NDArray[np.bool_]:
        """(nt, 6): which of fx, fy, fz, mx, my, mz are unique at each output, in the axes named by `axes`.

        At a singular position, for that instant, fewer components are unique than next to it; even the unique ones are
        NaN there, since accelerations are not determined. The answer is exact, except for user-defined axes in a result
        read from a file: there `True` is certain, while `False` may also mean that the component combines unique and
        non-unique ones of the world's or the joint's axes.
        """
        world, joint = self._data.determined
        if self.axes == "world" or self._turn is None:
            return world
        if self.axes == "joint":
            return joint
        stresses = self._data.self_stresses
        if stresses is not None:
            return _free_of(stresses, self._turn)
        return _mixed(world, self._turn) | _mixed(joint, _transposed(self._rotation) @ self._turn)

    def directions(self, output: int = -1) -> Directions:
        """Directions, in `axes`, in which the forces and moments at an output are unique and in which they are not.

        A tilted guide may have a unique force component that lies along no world axis. Raises `ArgumentError` for a
        result read from a file, which has no model.

        >>> import partita as pt
        >>> m = pt.Mechanism("tilted guides")
        >>> block = m.add_body("block", mass=1.0, inertia=(1, 1, 1))
        >>> for name, y in (("low", -1.0), ("high", 1.0)):
        ...     slide = m.add_prismatic(name, m.ground, block, point=(0, y, 0), axis=(3, 4, 0))
        >>> found = m.simulate(0.1).joint("low").directions()
        >>> found.forces_open.round(6) + 0.0                # across the guides, which could be clamped apart
        array([[ 0.8, -0.6,  0. ],
               [ 0. ,  0. ,  1. ]])
        >>> found.forces_determined.round(6) + 0.0
        array([[0.6, 0.8, 0. ]])
        """
        stresses = self._data.self_stresses
        if stresses is None:
            raise ArgumentError(
                "directions need the model, which a stored result does not have; simulate again", argument="output"
            )
        nt = len(stresses)
        if isinstance(output, bool) or not isinstance(output, int | np.integer) or not -nt <= output < nt:
            raise ArgumentError(
                f"directions: there is no output {output!r}; the {nt} outputs are numbered from 0", argument="output"
            )
        turn = np.eye(3) if self._turn is None else self._turn if self._turn.ndim == 2 else self._turn[output]
        forces, moments = (_split(part, turn) for part in stresses[output])
        return Directions(*forces, *moments)

    def in_frame(self, axes: Literal["world", "joint"] | ArrayLike) -> JointResult:
        """Return the same joint with `force`, `moment`, `determined` and `determined_at` along other axes.

        `"joint"`: the joint's axes on the parent body, moving with it: z along its axis, x along the x axis of the
        parent, projected across z (of the child where the parent is the ground; the y axis where x is within 26 degrees
        of z); of a ball joint or a weld the axes of that body. They turn with the drawing, so the components do not
        depend on the orientation of the whole mechanism. `"world"`: back again. A rotation matrix (3, 3), or one per
        output (nt, 3, 3), has the new axes as columns, in world axes. The point about which moments are taken does not
        change. Raises `ArgumentError` for anything else.

        >>> load = result.joint("A").in_frame("joint").force          # doctest: +SKIP
        """
        if isinstance(axes, str):
            if axes == "world":
                return self._seen_along("world", None)
            if axes == "joint":
                return self._seen_along("joint", self._rotation)
            raise ArgumentError(
                f'in_frame: unknown frame {axes!r}; use "world", "joint" or a 3x3 rotation matrix', argument="axes"
            )
        return self._seen_along("own", _rotation(axes, len(self.point)))

    @property
    def _rotation(self) -> FloatArray:
        """(nt, 3, 3): columns are the axes of the joint in the world."""
        return self._data.reaction["joint_rotation"]

    def _seen_along(self, axes: str, turn: FloatArray | None) -> JointResult:
        return JointResult(self.name, self.kind, self.parent, self.child, self._data, axes, turn, self._units)

    def _expressed(self, vectors: FloatArray) -> FloatArray:
        if self._turn is None:
            return vectors
        return np.einsum("...ij,...i->...j", self._turn, vectors)

    def __repr__(self) -> str:
        unique = [c for c, yes in zip(COMPONENTS, self.determined, strict=True) if yes]
        return (
            f"<joint {self.name!r}: {self.kind}, {self.parent} -> {self.child}, {len(self.point)} outputs, "
            f"reaction in {self.axes} axes, determined: {', '.join(unique) or 'none'}>"
        )


_ENTRIES = 2.0
"""Larger entries are those of no rotation. Scale: 1. Reason: they lie between -1 and 1; what is far beyond has no
product."""


_ORTHOGONAL = 1e-8
"""Columns that are less orthonormal are no axes. Scale: 1. Reason: eight digits of a direction that a program
computed."""


def _rotation(axes: ArrayLike, nt: int) -> FloatArray:
    """`axes` as a checked rotation, (3, 3) or (nt, 3, 3)."""
    try:
        turn = floats(axes)
    except TypeError:
        raise ArgumentError(
            f"in_frame: expected a 3x3 rotation matrix, got {type(axes).__name__}", argument="axes"
        ) from None
    if turn.shape not in ((3, 3), (nt, 3, 3)):
        raise ArgumentError(
            f"in_frame: a rotation must have shape (3, 3) or ({nt}, 3, 3), got {turn.shape}", argument="axes"
        )
    if not np.max(np.abs(turn), initial=0.0) < _ENTRIES:  # NaN too
        raise ArgumentError("in_frame: not a rotation matrix; its entries lie between -1 and 1", argument="axes")
    defect = float(np.max(np.abs(_transposed(turn) @ turn - np.eye(3)), initial=0.0))
    if not defect < _ORTHOGONAL or np.any(np.linalg.det(turn) < 0):
        raise ArgumentError(
            f"in_frame: not a right-handed rotation matrix (orthogonal to {defect:.1e} only, or mirrored); "
            "its columns must be three perpendicular unit axes",
            argument="axes",
        )
    return turn


def _free_of(stresses: FloatArray, turn: FloatArray) -> NDArray[np.bool_]:
    """Components along the columns of `turn` that no self-stress touches."""
    touched = np.abs(stresses @ (turn if turn.ndim == 2 else turn[:, None]))
    return np.asarray((touched <= 1.0).all(axis=2).reshape(-1, 6))  # a NaN (all is open) is not below 1


_INDEPENDENT = 0.5
"""A direction that leaves the others by more is independent of them. Scale: 1. Reason: of three orthonormal axes at
least one leaves any plane by as much."""


def _split(stresses: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The span of the given directions (3, 3, rows; zero rows are ignored), and its orthogonal complement."""
    if not np.isfinite(stresses).all():
        return np.eye(3), np.zeros((0, 3))
    lengths = np.linalg.norm(stresses, axis=1)
    there = lengths > 1.0
    found = stresses[there] @ turn
    base = np.vstack([found / lengths[there, None], np.eye(3)])
    kept: list[FloatArray] = []
    for row in base:
        rest = row - sum((np.dot(k, row) * k for k in kept), np.zeros(3))
        rest -= sum((np.dot(k, rest) * k for k in kept), np.zeros(3))
        size = float(np.linalg.norm(rest))
        if len(kept) < there.sum() or size > _INDEPENDENT:
            kept.append(_upright(rest / size))
    together = np.array(kept)
    return together[: there.sum()], together[there.sum() :]


def _upright(unit: FloatArray) -> FloatArray:
    """The sign of a direction is arbitrary: its largest entry is positive, the last of equals."""
    lead = int(np.flatnonzero(np.abs(unit) >= np.max(np.abs(unit)) - EQUAL)[-1])
    return unit if unit[lead] > 0 else -unit


def _mixed(determined: NDArray[np.bool_], turn: FloatArray) -> NDArray[np.bool_]:
    """Components along new axes are unique when every old component they draw on is."""
    used = np.broadcast_to(np.abs(turn) > EQUAL, (len(determined), 3, 3))
    parts = determined.reshape(-1, 2, 3, 1) | ~used[:, None]
    return np.asarray(parts.all(axis=2).reshape(-1, 6))


def _transposed(turn: FloatArray) -> FloatArray:
    return np.swapaxes(turn, -1, -2)
