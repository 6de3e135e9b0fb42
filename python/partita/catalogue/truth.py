"""Results of the theory of mechanisms for a mechanism, written down independently of any program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

import numpy as np
from numpy.typing import NDArray

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
EVERYTHING = {"*": " ".join(COMPONENTS)}
"""No condition is redundant: every reaction is unique."""
IN_PLANE = {"*": "fx fy mz"}
"""A mechanism in the x-y plane drawn with joints of space. Force across the plane and moments in it go around each of
its loops at will; the plane's own three equations for each link determine the rest."""
ABOUT_AXES = {"*": "mz"}
"""A hinge carries no moment about its axis, the joint's z; nothing else is unique."""


@dataclass(frozen=True)
class Truth:
    """Mobility, redundancy and unique reactions of a mechanism, with the reason and where to read it.

    `redundant` is the number of redundant constraints of all joints. `determined` names the unique components of each
    joint's reaction, along `axes`, by patterns of joint names, of which the first match applies. `idle` names bodies,
    or groups of them joined by "+", that can spin by themselves while all others are at rest.

    >>> from partita.catalogue import Truth
    >>> truth = Truth(1, 3, {"*": "fx fy mz"}, why="3 (4 - 1) - 2 4 = 1", source="Gruebler")
    >>> truth.flags("A").tolist()
    [True, True, False, False, False, True]
    """

    mobility: int
    redundant: int
    determined: Mapping[str, str]
    why: str
    source: str
    axes: Literal["world", "joint"] = "world"
    idle: tuple[str, ...] = ()

    def flags(self, joint: str) -> NDArray[np.bool_]:
        """(6,): which of fx, fy, fz, mx, my, mz of a joint are unique."""
        fitting = (words for pattern, words in self.determined.items() if fnmatchcase(joint, pattern))
        known = next(fitting, "").split()
        return np.array([component in known for component in COMPONENTS])

    def __str__(self) -> str:
        idle = f" Idle: {', '.join(self.idle)}." if self.idle else ""
        dof = "1 degree" if self.mobility == 1 else f"{self.mobility} degrees"
        unique = "; ".join(f"{joint}: {words}" for joint, words in self.determined.items())
        return (
            f"Theory: {dof} of freedom, {self.redundant} redundant constraints ({self.why}).{idle} Unique "
            f"reactions along {self.axes} axes: {unique}."
        )


def planar(links: int, joints: int, source: str, bridges: tuple[str, ...] = ()) -> Truth:
    """A linkage in the x-y plane of `links` besides the ground and `joints` of one degree of freedom (Gruebler,
    Chebyshev).

    In the plane a link has three degrees of freedom and a joint removes two. In space a joint removes five; in each of
    the (joints - links) loops three of these constraints repeat that the loop is planar. `bridges` are joints outside
    all loops, whose constraints nothing repeats.
    """
    loops = joints - links
    return Truth(
        mobility=3 * links - 2 * joints,
        redundant=3 * loops,
        determined={**dict.fromkeys(bridges, EVERYTHING["*"]), **IN_PLANE},
        why=f"Gruebler: 3 x {links} links - 2 x {joints} joints of the plane; planarity is imposed redundantly by "
        f"three constraints in each of {loops} loops",
        source=source,
    )
