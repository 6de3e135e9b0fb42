"""Energy of a run and its balance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class EnergyResult:
    """Energies over the nt outputs of a run, each (nt,) in joules.

    `potential` includes constant gravity, springs, bushings, the energy stored in contacts, tyres and stops, and
    torques and world forces that are constant; `work` is that of dampers, friction, drives and all other torques and
    forces since the run began. The arrays are empty for a `System`, whose potential is not known.
    """

    kinetic: FloatArray
    potential: FloatArray
    work: FloatArray

    @property
    def total(self) -> FloatArray:
        """Kinetic plus potential energy (nt,) [J]."""
        return self.kinetic + self.potential

    @property
    def balance(self) -> FloatArray:
        """total - total[0] - work (nt,) [J], from the first output on: the error of the energy."""
        total = self.total
        return total - total[:1] - (self.work - self.work[:1])

    @property
    def scale(self) -> float:
        """Largest energy exchanged [J]: the greatest of kinetic energy, change of potential, and work.

        It does not depend on the zero of the potential.
        """
        parts = (self.kinetic, self.potential - self.potential[:1], self.work)
        return max(float(np.max(np.abs(part), initial=0.0)) for part in parts)

    @property
    def relative_balance(self) -> float:
        """Largest |balance| over `scale`; 0 when no energy moved at all."""
        worst = float(np.max(np.abs(self.balance), initial=0.0))
        return worst / self.scale if self.scale > 0 else worst

    def __repr__(self) -> str:
        if len(self.kinetic) == 0:
            return "<energy: not known>"
        return (
            f"<energy: {len(self.kinetic)} outputs, exchanged up to {self.scale:.3e} J, "
            f"relative balance {self.relative_balance:.1e}>"
        )
