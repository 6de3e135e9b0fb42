"""Self-stresses: reactions that can be added without changing the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .names import index_of


@dataclass(frozen=True, eq=False, repr=False)
class SelfStresses:
    """Orthonormal self-stresses of a mechanism at one position: a basis of the indeterminate reactions.

    Each is a set of joint wrenches, and of efforts of drives, that balance one another without any load. They are
    orthonormal in the metric of the rule by which loads are shared: the sum over all joints of squares of forces and of
    moments divided by `length`, or the elastic energy if compliances were given. The order depends only on the
    mechanism: the first loads some component along the joint axes as heavily as possible; the next does not load this
    component and loads another one as heavily as then possible.

    Attributes:
        joints: names of the joints (nj).
        wrenches: force and moment of each joint on its child about the joint's point, world axes (s, nj, 6).
        drives: names of the drives.
        efforts: effort of each drive (s, drives).
        length: the length by which moments are divided [m].
    """

    joints: tuple[str, ...]
    wrenches: NDArray[np.float64]
    drives: tuple[str, ...]
    efforts: NDArray[np.float64]
    length: float

    def __len__(self) -> int:
        return len(self.wrenches)

    def joint(self, name: str) -> NDArray[np.float64]:
        """Force and moment of one joint in each self-stress (s, 6); `UnknownNameError` with the nearest names."""
        return self.wrenches[:, index_of(name, self.joints, "joint")]

    def __repr__(self) -> str:
        count = len(self)
        return f"<{count} self-stress{'' if count == 1 else 'es'} of {len(self.joints)} joints>"


def self_stresses_of(
    summary: Mapping[str, Any], wrenches: NDArray[np.float64], efforts: NDArray[np.float64], length: float
) -> SelfStresses:
    """From what the core returned and the names of its model."""
    joints = tuple(str(joint["name"]) for joint in summary.get("joints", ()))
    drives = tuple(str(name) for name in summary.get("drives", ()))
    return SelfStresses(joints, wrenches, drives, efforts, length)
