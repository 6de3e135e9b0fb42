"""Linearised equations of motion about a state: what `m.linearize` returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..notebook import names, table
from ..numeric import shown
from ..state import State
from .modes import Modes, Shapes

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..plots.files import PathLike

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class Linearization:
    """The linearised equations x' = f0 + A (x - x0) + B w, y = y0 + C (x - x0) + D w about one state.

    x are k independent positions and their k rates (more positions than rates where wheels roll): the loops stay
    closed, and there are no modes of constraints. Where the state moves, f0 is not zero.

    Attributes:
        A, B, C, D: arrays (nx, nx), (nx, nw), (ny, nx), (ny, nw).
        f0, y0: rates of the states (nx,) and outputs (ny,) at the state itself.
        states, inputs, outputs: names, in the order of rows and columns.
        state: where it was linearised.
        mass, stiffness, damping: M_d, and the changes of the forces in independent coordinates by positions and
            velocities, each with its sign on the left-hand side; at rest M_d u' + damping u + stiffness z = 0.
        steady: whether f0 and A remain what they are: rest, or a motion along coordinates on which nothing depends (a
            bicycle running straight, a spinning shaft), under loads that do not change with time. Only then do the
            eigenvalues of A not depend on the coordinates, but for the axes of a motion that turns: states such as
            "top.x" are measured in space, turns such as "top.wx" in axes of the body, which turn with it, and there an
            oscillation has another frequency by that of the spin. Where the body is not the same in all its positions
            (an unequal inertia in fixed bearings, a wheel on the ground in its own axes), A changes with the turn: not
            steady.
        conservative: at rest, without dissipation.
        method: "exact", or "differences" where functions given in Python or reaction-dependent frictions are
            differentiated numerically (errors of about 1e-9 of the largest entries).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    f0: Array
    y0: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state: State
    mass: Array
    stiffness: Array
    damping: Array
    steady: bool
    conservative: bool
    method: str
    _accelerates: bool = field(default=False)
    _found: Mapping[str, Any] | None = field(default=None)
    _shapes: Shapes | None = field(default=None)
    _again: Callable[[dict[str, Any]], Linearization] | None = field(default=None)

    def __repr__(self) -> str:
        size = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<Linearization: {size}; {'steady' if self.steady else 'not steady'}>"

    def modes(self) -> Modes:
        """Eigenvalues of A and the motions that belong to them.

        In real arithmetic where nothing dissipates; zero ones are counted and named. Raises `ArgumentError` where the
        state is not steady: there eigenvalues would depend on the choice of coordinates.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> modes = m.linearize().modes()
        >>> bool(np.isclose(2 * np.pi * modes.frequency[0], np.sqrt(1.5 * 9.81)))
        True
        """
        if self._found is None or self._shapes is None:
            speed = float(np.max(np.abs(self.state.v), initial=0.0))
            still = "it accelerates" if self._accelerates else "its loads or drives change with time"
            rest = still if speed == 0.0 else f"it moves (fastest {speed:.3g} rad/s or m/s)"
            raise ArgumentError(
                f"the state at t = {self.state.t:g} s is not steady: {rest}, so that eigenvalues of A would depend "
                "on the choice of coordinates; linearise about an equilibrium (m.equilibrium()) or a steady motion"
                f"{self._turning()}",
                argument="at",
            )
        return Modes.of(self._found, self._shapes)

    def _turning(self) -> str:
        """A remedy where a rate among the states is measured in axes of a body that turns."""
        rates = dict(zip(self.state.velocity_names, self.state.v.tolist(), strict=True))
        turns = [name.removesuffix("'") for name in self.states if name.endswith(("wx'", "wy'", "wz'"))]
        for name in turns:
            joint = name.rpartition(".")[0]
            if any(rates.get(f"{joint}.{axis}") for axis in ("wx", "wy", "wz")):
                return (
                    f'; "{name}" is measured in axes that turn with the body: describe the motion by a body that does '
                    'not turn, m.add_free("pose", m.ground, BODY), or choose other rates by independent='
                )
        return ""

    def to_scipy(self) -> Any:
        """A `scipy.signal.StateSpace` (A, B, C, D); f0 and y0 are not part of it."""
        from scipy.signal import StateSpace

        return StateSpace(self.A, self._columns(self.B), self._rows(self.C), self._both(self.D))

    def to_control(self) -> Any:
        """A `control.ss` system with the names of states, inputs and outputs (needs the package control)."""
        control = extra("control", "control", "a control system")
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(self.A, self.B, self.C, self.D, **names)

    def locus(self, parameter: str, values: Sequence[float]) -> tuple[ComplexArray, ...]:
        """Eigenvalues of A (complex, (nx,)) for each value of a parameter of `m.compile().parameters`, about the same
        state; NaN where it is not steady with that value.

        >>> import partita as pt
        >>> m = pt.Mechanism("pendulum")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> spring = m.add_torsion_spring("A", stiffness=2.0, damping=0.1, name="s")
        >>> soft, stiff = m.linearize().locus("s.stiffness", [1.0, 100.0])
        >>> bool(abs(stiff[0]) > abs(soft[0]))
        True
        """
        again = self._again
        if again is None or isinstance(parameter, (list, tuple)):
            raise ArgumentError(f"parameter must be a name, not {shown(parameter)}", argument="parameter")
        found: list[ComplexArray] = []
        for value in values:
            made = again({parameter: value})
            found.append(made.modes().eigenvalues if made.steady else np.full(len(self.states), np.nan + 0j))
        return tuple(found)

    def plot(self, path: PathLike | None = None) -> Figure:
        """The eigenvalues of A in the complex plane, and the shares of energy of each mode: `modes().plot()`, with its
        errors."""
        return self.modes().plot(path)

    def to_xarray(self) -> xarray.Dataset:
        """A, B, C, D, f0 and y0 with the names of states, inputs and outputs, as an `xarray.Dataset`; columns of A and
        C along "by". `MissingDependencyError` without xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")
        data = {
            "A": (("state", "by"), self.A),
            "B": (("state", "input"), self.B),
            "C": (("output", "by"), self.C),
            "D": (("output", "input"), self.D),
            "f0": ("state", self.f0),
            "y0": ("output", self.y0),
        }
        labels = {
            "state": np.array(self.states, dtype=str),
            "by": np.array(self.states, dtype=str),
            "input": np.array(self.inputs, dtype=str),
            "output": np.array(self.outputs, dtype=str),
        }
        about = {"t": self.state.t, "steady": int(self.steady), "method": self.method}
        return xarray.Dataset(data, coords=labels, attrs=about)

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [
            ("states", names(self.states)),
            ("inputs", names(self.inputs)),
            ("outputs", names(self.outputs)),
            ("steady", "yes" if self.steady else "no: eigenvalues would depend on the coordinates"),
            ("derivatives", self.method),
        ]
        if self._found is not None and self._shapes is not None:
            rows += [(f"mode {mode.number}", repr(mode)) for mode in self.modes().modes[:4]]
        return table(f"Linearised about t = {self.state.t:g} s", rows)

    # an empty system has a shape that SciPy does not take
    def _columns(self, x: Array) -> Array:
        return x if x.shape[1] else np.zeros((x.shape[0], 1))

    def _rows(self, x: Array) -> Array:
        return x if x.shape[0] else np.eye(self.A.shape[0])

    def _both(self, x: Array) -> Array:
        ny, nw = len(self.outputs) or self.A.shape[0], len(self.inputs) or 1
        return x if x.shape == (ny, nw) else np.zeros((ny, nw))

    @cached_property
    def eigenvalues(self) -> Any:
        """Eigenvalues of A, complex (nx,), the slowest first; see `modes`."""
        return self.modes().eigenvalues
