"""Positions at rest: what `m.equilibrium` returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..results.body import BodyResult
from ..results.coupling import CouplingResult, DriveResult
from ..results.joint import JointResult
from ..results.run import Run
from ..results.sensor import SensorResult
from ..state import State

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium:
    """A position in which the mechanism stays at rest, with the forces that hold it.

    Attributes:
        state: the state: t, q, and v = 0.
        stable: True or False by linearisation; None where it does not decide (indifferent, or a real part that is
            rounding).
        eigenvalues: of the linearised motion about it, complex (2k,) [1/s].
        stiffness: K_d (k, k): change of the restoring efforts with independent displacements.
        independent: names of the independent velocities, in the order of K_d.
        indifferent: how many directions need no effort (zero eigenvalues of K_d): neutral equilibrium.
        iterations: steps of the search.
    """

    state: State
    stable: bool | None
    eigenvalues: ComplexArray
    stiffness: Array
    independent: tuple[str, ...]
    indifferent: int
    iterations: int
    _run: Run = field(repr=False)

    def joint(self, name: str) -> JointResult:
        """Position and reaction of a joint: arrays as of a run with one output, `joint("C").force` (1, 3)."""
        return self._run.joint(name)

    def body(self, name: str) -> BodyResult:
        """Pose of a body, as of a run with one output."""
        return self._run.body(name)

    def sensor(self, name: str) -> SensorResult:
        """Reading of a sensor, as of a run with one output."""
        return self._run.sensor(name)

    def coupling(self, name: str) -> CouplingResult:
        """Effort of a coupling, as of a run with one output."""
        return self._run.coupling(name)

    def drive(self, name: str) -> DriveResult:
        """Effort of a drive, as of a run with one output."""
        return self._run.drive(name)

    @property
    def potential(self) -> float:
        """Potential energy [J]."""
        return float(self._run.energy.potential[0])

    def __repr__(self) -> str:
        word = {True: "stable", False: "unstable", None: "not decided by linearisation"}[self.stable]
        if self.indifferent:
            word += f", {self.indifferent} indifferent direction{'s' * (self.indifferent > 1)}"
        found = np.sort(np.abs(self.eigenvalues[self.eigenvalues.imag > 0.0])) / (2.0 * np.pi)
        rest = f"; frequencies {', '.join(f'{x:.4g}' for x in found[:4])} Hz" if found.size else ""
        k = len(self.independent)
        return f"<Equilibrium: {word}{rest}; {k} degree{'s' * (k != 1)} of freedom>"
