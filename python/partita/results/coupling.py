"""Efforts of couplings and drives in a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..result_view import FloatArray
from .source import Source


class _Efforts:
    """Efforts of a coupling or of a drive: columns of those of all constraints. They are computed on first access."""

    def __init__(self, name: str, source: Source, conditions: Sequence[int]) -> None:
        self.name = name
        self._source, self._conditions = source, list(conditions)

    @property
    def effort(self) -> FloatArray:
        """(nt, rows): the multiplier of each constraint [N, N m]. Times the rate of the coupled or driven quantity it
        is a power."""
        return np.asarray(self._source.efforts[:, self._conditions])

    @property
    def determined_at(self) -> NDArray[np.bool_]:
        """(nt, rows): which efforts are unique at each output; others are one solution of many."""
        return np.asarray(self._source.determined_efforts[:, self._conditions])

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(rows,): which efforts are unique at every output."""
        return np.asarray(self.determined_at.all(axis=0))


class CouplingResult(_Efforts):
    """Efforts of one coupling over the outputs of a run.

    `effort` (nt, rows) is the multiplier of each of its constraints: for a gear, rack or coupler the torque or force on
    a coordinate whose factor is 1 (on others, times their factors); for a rolling contact the force on the rolling body
    along the normal, and along two directions in the plane. `determined` (rows,) and `determined_at` (nt, rows) say
    which are unique; the others are chosen by the rule for redundant joints (docs/reactions.md).

    Attributes:
        name, kind: of the coupling.

    >>> import partita as pt
    >>> m = pt.Mechanism("hook", gravity=(0, -9.81, 0))
    >>> load = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
    >>> rope = m.add_distance("rope", m.ground, (0, 0, 0), load, (0, 0, 0))
    >>> m.simulate(0.1).coupling("rope").tension[-1].round(9).item()
    19.62
    """

    def __init__(self, name: str, kind: str, source: Source, conditions: Sequence[int]) -> None:
        super().__init__(name, source, conditions)
        self.kind = kind

    @property
    def tension(self) -> FloatArray:
        """(nt,): tension [N] of the distance between two points; negative: compression."""
        if self.kind != "distance":
            raise ArgumentError(
                f'"{self.name}" is a {self.kind}, which has no tension; its multipliers are in effort',
                argument="tension",
            )
        return -self.effort[:, 0]

    def __repr__(self) -> str:
        return f"<coupling {self.name!r}: {self.kind}, {len(self._conditions)} rows>"


class DriveResult(_Efforts):
    """Efforts of one drive over the outputs of a run.

    `effort` (nt, rows) has one column for each driven coordinate: one, or, for a pose, the translations and then the
    three rotations. For a translation, a `Distance` or an `Along` it is a force [N], for an angle or a `Cosine` a
    torque [N m], positive towards larger values. For the rotations of a pose it is conjugate to the orientation error;
    use `run.joint(name).moment` instead. For a translation or an angle of a joint it equals `run.joint(name).drive`.
    `determined` (rows,) and `determined_at` (nt, rows) say which are unique: two compatible drives of one degree of
    freedom share its load by the rule for redundant joints (docs/reactions.md), which considers only the wrenches of
    joints.

    >>> import partita as pt
    >>> m = pt.Mechanism("winch", gravity=(0, 0, -9.81))
    >>> load = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, 0, -3))
    >>> rail = m.add_prismatic("rail", m.ground, load, axis=(0, 0, 1))
    >>> rope = m.add_drive(pt.Distance(m.ground, (0, 0, 0), load, (0, 0, 0)), position=lambda t: 3.0 - 0.5 * t * t)
    >>> m.simulate(1.0).drive(rope.name).effort[-1].round(6)       # it pulls, towards smaller distances
    array([-21.62])
    """

    def __repr__(self) -> str:
        return f"<drive {self.name!r}: {len(self._conditions)} rows>"
