"""What a coupling does in a run."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import ArgumentError
from ..readable import FloatArray


@dataclass(frozen=True)
class CouplingResult:
    """The effort of one coupling.

    `effort` (nt, rows) is the multiplier of each of its conditions: for a gear, rack or coupler the torque or force on
    a coordinate whose factor is 1 (on others, times their factors); of a rolling contact the force on what rolls along
    the normal, and along two directions in the plane. Undetermined ones are one possibility among many.

    >>> import partita as pt
    >>> m = pt.Mechanism("hook", gravity=(0, -9.81, 0))
    >>> load = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
    >>> rope = m.add_distance("rope", m.ground, (0, 0, 0), load, (0, 0, 0))
    >>> m.simulate(0.1).coupling("rope").tension[-1].round(9).item()
    19.62
    """

    name: str
    kind: str
    effort: FloatArray

    @property
    def tension(self) -> FloatArray:
        """(nt,): force [N] by which a held distance pulls its two points together; negative: it pushes them apart."""
        if self.kind != "distance":
            raise ArgumentError(
                f'"{self.name}" is a {self.kind}, which has no tension; its multipliers are in effort',
                argument="tension",
            )
        return -self.effort[:, 0]
