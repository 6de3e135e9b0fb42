"""One applied force of a run: what it does, its power, its energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownAttributeError

FloatArray = NDArray[np.float64]


class ForceResult:
    """A spring, a torque, a contact or another force over the nt outputs of a run.

    Everything is computed when it is read. Which quantities there are depends on the kind of force: a spring between
    points has a length and one number as its force, a torque an effort, any other force three components.

    Attributes:
        name: of the force.
        kind: as the description has it: "spring", "torque", "contact", ...
        reads: names of the quantities that it has.
    """

    def __init__(self, name: str, kind: str, reads: tuple[str, ...], read: Callable[[str], Any]) -> None:
        self.name, self.kind, self.reads = name, kind, reads
        self._read = read

    @property
    def force(self) -> FloatArray:
        """Of a spring (nt,): the force along its line, positive in tension. Of others (nt, 3): the force on the first
        body, in world axes [N]."""
        return self._of("force")

    @property
    def moment(self) -> FloatArray:
        """(nt, 3): the moment on the first body about the point of application, in world axes [N m]."""
        return self._of("moment")

    @property
    def point(self) -> FloatArray:
        """(nt, 3): the point of application on the first body, in the world [m]."""
        return self._of("position", "point")

    @property
    def effort(self) -> FloatArray:
        """(nt,): of a load along a coordinate of a joint, on its child [N m] or [N]."""
        return self._of("effort")

    @property
    def length(self) -> FloatArray:
        """(nt,): distance of the two ends of a spring [m]."""
        return self._of("length")

    @property
    def rate(self) -> FloatArray:
        """(nt,): derivative of `length` [m/s]."""
        return self._of("rate")

    @property
    def power(self) -> FloatArray:
        """(nt,): power delivered to the bodies [W]."""
        return self._of("power")

    @property
    def energy(self) -> FloatArray:
        """(nt,): potential energy [J]; zero for a force that has none."""
        return self._of("energy")

    def _of(self, quantity: str, word: str = "") -> FloatArray:
        if quantity not in self.reads:
            known = ["point" if name == "position" else name for name in self.reads]
            raise UnknownAttributeError(
                f'force "{self.name}" ({self.kind}) has no {word or quantity}; it has: {", ".join(known)}',
                name=word or quantity,
                known=known,
            )
        return np.asarray(self._read(quantity), dtype=np.float64)

    def __repr__(self) -> str:
        known = ", ".join("point" if name == "position" else name for name in self.reads)
        return f"<force {self.name!r}: {self.kind}; {known}>"
