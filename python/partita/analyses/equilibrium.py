"""Positions at rest: what `m.equilibrium` returns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..extras import extra
from ..notebook import NAMES, table
from ..results.body import BodyResult
from ..results.coupling import CouplingResult, DriveResult
from ..results.force import ForceResult
from ..results.joint import JointResult
from ..results.run import Run
from ..results.sensor import SensorResult
from ..state import State

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..plots.files import PathLike

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


SHOWN = 3
"""Coordinates in one line."""


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

    def joint(self, name: Any) -> JointResult:
        """Position and reaction of a joint: arrays as of a run with one output, `joint("C").force` (1, 3)."""
        return self._run.joint(name)

    def body(self, name: Any) -> BodyResult:
        """Pose of a body, as of a run with one output."""
        return self._run.body(name)

    def sensor(self, name: str) -> SensorResult:
        """Reading of a sensor, as of a run with one output."""
        return self._run.sensor(name)

    def coupling(self, name: Any) -> CouplingResult:
        """Effort of a coupling, as of a run with one output."""
        return self._run.coupling(name)

    def force(self, name: Any) -> ForceResult:
        """What an applied force does, as of a run with one output.

        >>> import partita as pt
        >>> m = pt.Mechanism("balance")
        >>> load = m.add_body("load", mass=2.0, inertia=(1, 1, 1), position=(0, -1, 0))
        >>> guide = m.add_prismatic("guide", m.ground, load, axis=(0, 1, 0))
        >>> spring = m.add_spring("S", m.ground, (0, 0, 0), load, (0, 0, 0), stiffness=100.0)
        >>> m.equilibrium().force("S").force.round(9)     # the weight
        array([19.62])
        """
        return self._run.force(name)

    def drive(self, name: Any) -> DriveResult:
        """Effort of a drive, as of a run with one output."""
        return self._run.drive(name)

    @property
    def potential(self) -> float:
        """Potential energy [J]."""
        return float(self._run.energy.potential[0])

    def plot(self, path: PathLike | None = None) -> Figure:
        """The eigenvalues of the linearised motion about it, in the complex plane.

        Args:
            path: also write the figure to this file.

        Returns the Matplotlib figure; `MissingDependencyError` without Matplotlib.
        """
        from ..plots.modes import plot_poles

        return plot_poles(self._run.title, self.eigenvalues, path)

    def to_xarray(self) -> xarray.Dataset:
        """Bodies with their positions, and joints with the force and moment on the child, as an `xarray.Dataset`.
        `MissingDependencyError` without xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")
        joints, bodies = list(self._run.names.joints), list(self._run.names.bodies)
        found = [self.joint(name) for name in joints]

        def rows(values: Iterable[Array]) -> Array:
            return np.array([value[0] for value in values]).reshape(-1, 3)

        data: dict[str, Any] = {
            "q": ("coordinate", self.state.q),
            "stiffness": (("independent", "by"), self.stiffness),
            "body_position": (("body", "axis"), rows(self.body(name).position for name in bodies), {"units": "m"}),
            "joint_force": (("joint", "axis"), rows(one.force for one in found), {"units": "N"}),
            "joint_moment": (("joint", "axis"), rows(one.moment for one in found), {"units": "N m"}),
            "potential": ((), self.potential, {"units": "J"}),
        }
        labels = {
            "coordinate": list(self._run.names.coordinates),
            "independent": list(self.independent),
            "by": list(self.independent),
            "body": np.array(bodies, dtype=str),
            "joint": np.array(joints, dtype=str),
            "axis": ["x", "y", "z"],
        }
        about = {"title": self._run.title, "stable": {True: "yes", False: "no", None: "not decided"}[self.stable]}
        return xarray.Dataset(data, coords=labels, attrs=about)

    def _words(self) -> str:
        word = {True: "stable", False: "unstable", None: "not decided by linearisation"}[self.stable]
        if self.indifferent:
            word += f", {self.indifferent} indifferent direction{'s' * (self.indifferent > 1)}"
        return word

    def _frequencies(self) -> str:
        found = np.sort(np.abs(self.eigenvalues[self.eigenvalues.imag > 0.0])) / (2.0 * np.pi)
        return f"{', '.join(f'{x:.4g}' for x in found[:4])} Hz" if found.size else ""

    def __repr__(self) -> str:
        rest = f"; frequencies {self._frequencies()}" if self._frequencies() else ""
        k = len(self.independent)
        return f"<Equilibrium{self._where()}: {self._words()}{rest}; {k} degree{'s' * (k != 1)} of freedom>"

    def _where(self) -> str:
        """Its first coordinates, enough to tell several apart."""
        names = self._run.names.coordinates
        pairs = zip(names[:SHOWN], self.state.q[:SHOWN], strict=True)
        shown = ", ".join(f"{name} = {value:.4g}" for name, value in pairs)
        return f" at {shown}{', ...' * (len(names) > SHOWN)}" if shown else ""

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        at = [
            (name, f"{value:.6g}")
            for name, value in zip(self._run.names.coordinates[:NAMES], self.state.q[:NAMES], strict=True)
        ]
        rows = [
            ("stability", self._words()),
            ("frequencies", self._frequencies() or "none"),
            ("potential energy", f"{self.potential:.6g} J"),
        ]
        more = len(self.state.q) - NAMES
        left = [("", f"and {more} coordinates more")] if more > 0 else []
        return table(f"{self._run.title}: equilibrium", [*rows, *at, *left])
