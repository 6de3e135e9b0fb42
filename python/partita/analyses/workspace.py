"""Result of `Mechanism.workspace`: maps over a grid of goals."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError, AssemblyError
from ..naming import goal_name, index_of
from ..notebook import names, table
from ..state import Layout, State
from .singularities import body_at, joint_at

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
MAPS = ("margin", "constraints", "outputs", "assemblies")


@dataclass(frozen=True, repr=False, eq=False)
class Workspace:
    """What a mechanism reaches over a grid of goals, and how well its actuators move it there.

    Arrays have the shape of the grid: one dimension for each goal that varies, in the order of the grid.

    Attributes:
        title: name of the mechanism.
        actuators: names of the actuators.
        keys: goals that vary.
        axes: values of each.
        units: their units.
        held: goals that are held -> their values.
        reached: whether the mechanism can take each position.
        reasons: index in the grid -> why not.
        q: (..., nq) coordinates; NaN where it cannot.
        positions: (..., 3) positions [m] of the point `of`; None if there is none.
        margin: how far the actuators are from a position in which a motion escapes them, as in `inverse_dynamics`:
            0 there, 1 at best, without units.
        constraints: the least singular value of the constraints in natural scales: 0 where branches meet.
        outputs: the sine of the angle between the outputs and what they cannot show: 0 where a motion leaves them at
            rest; None if there are no outputs.
        assemblies: number of assemblies with these values of the goals; None if not asked for.
        sheets: branch -> (..., nq) coordinates on it, of all assemblies; empty if not asked for.
        notes: sentences on what is not known.
    """

    title: str
    actuators: tuple[str, ...]
    keys: tuple[Any, ...]
    axes: tuple[FloatArray, ...]
    units: tuple[str, ...]
    held: Mapping[Any, float]
    reached: BoolArray
    reasons: Mapping[tuple[int, ...], str]
    q: FloatArray
    positions: FloatArray | None
    margin: FloatArray
    constraints: FloatArray
    outputs: FloatArray | None
    assemblies: NDArray[np.int64] | None
    sheets: Mapping[str, FloatArray]
    notes: tuple[str, ...]
    _model: CompiledModel
    _layout: Layout
    _start: State

    def state(self, *index: int) -> State:
        """The position at an index of the grid, at rest.

        Raises:
            ArgumentError: there is no such index. AssemblyError: the mechanism cannot take it; the reason says why.
        """
        if len(index) != self.reached.ndim or any(
            not -n <= i < n for i, n in zip(index, self.reached.shape, strict=True)
        ):
            raise ArgumentError(f"index {index}: the grid has the shape {self.reached.shape}", argument="index")
        where = tuple(i % n for i, n in zip(index, self.reached.shape, strict=True))
        if not self.reached[where]:
            raise AssemblyError(
                f"position {where}: {self.reasons[where]}",
                residual=float("nan"),
                iterations=0,
                loops=self.reasons[where],
            )
        return State(self._start.t, self.q[where], np.zeros(self._model.core.nv), layout=self._layout)

    def path(self, body: Any, point: Any = (0.0, 0.0, 0.0)) -> FloatArray:
        """(..., 3): a point of a body, in body axes, over the grid [m]; NaN where it is not reached."""
        found: FloatArray = body_at(self._model, self._start.t, self._rows(), body).point(point)
        return found.reshape(*self.reached.shape, 3)

    def joint(self, name: Any) -> FloatArray:
        """Coordinates of a joint over the grid [rad, m]; NaN where it is not reached."""
        found = joint_at(self._model, self._start.t, self._rows(), name)
        return found.reshape(*self.reached.shape, *found.shape[1:])

    def _rows(self) -> FloatArray:
        return self.q.reshape(-1, self.q.shape[-1])

    def map(self, of: str) -> NDArray[Any]:
        """One of the maps: "margin", "constraints", "outputs" or "assemblies"."""
        known = [name for name in MAPS if getattr(self, name) is not None]
        index_of(of, known, "map")
        found: NDArray[Any] = getattr(self, of)
        return found

    def plot(self, of: str = "margin", *, ax: Any = None, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw one of the maps over the goals that vary, one or two of them. `ax`: existing Matplotlib axes; singular
        curves can be drawn over it by `Singularities.plot(ax=...)`. `path` saves the figure.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("five-bar")
        >>> w = m.workspace({"A": np.linspace(-1, 1, 5), "E": np.linspace(-1, 1, 5)}, actuators=("A", "E"))
        >>> w.plot().axes[0].get_ylabel()
        'E [rad]'
        """
        from ..plots.maps import plot_workspace

        return plot_workspace(self, of, ax, path)

    def to_xarray(self) -> xarray.Dataset:
        """All maps as an `xarray.Dataset` over the goals that vary."""
        from ..extras import extra

        xarray = extra("xarray", "xarray", "to_xarray")
        dims = tuple(goal_name(key) for key in self.keys)
        variables: dict[str, Any] = {
            "reached": (dims, self.reached),
            "q": ((*dims, "coordinate"), self.q),
            "margin": (dims, self.margin, {"units": "1", "long_name": "distance of the actuators from a singularity"}),
            "constraints": (dims, self.constraints, {"units": "1", "long_name": "least value of the constraints"}),
        }
        if self.positions is not None:
            variables["positions"] = ((*dims, "axis"), self.positions, {"units": "m"})
        if self.outputs is not None:
            variables["outputs"] = (dims, self.outputs, {"units": "1"})
        if self.assemblies is not None:
            variables["assemblies"] = (dims, self.assemblies)
        axes = zip(dims, self.axes, self.units, strict=True)
        coords = {name: (name, values, {"units": unit}) for name, values, unit in axes}
        return xarray.Dataset(variables, coords=coords, attrs={"title": self.title})

    def _least(self) -> str:
        known = self.margin[np.isfinite(self.margin)]
        return f"{known.min():.3g} to {known.max():.3g}" if known.size else "not known"

    def __repr__(self) -> str:
        over = ", ".join(goal_name(key) for key in self.keys)
        margin = f"; margin of {', '.join(self.actuators)}: {self._least()}" if self.actuators else ""
        count = f"{int(self.reached.sum())} of {self.reached.size} positions reached"
        return f"<Workspace of {self.title!r} over {over}: {count}{margin}>"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        axes = zip(self.keys, self.axes, self.units, strict=True)
        rows = [
            *(
                ("goal", f"{goal_name(key)}: {x.min():.4g} to {x.max():.4g} {unit}, {len(x)} values")
                for key, x, unit in axes
            ),
            *(("held", f"{goal_name(key)} = {value:.6g}") for key, value in self.held.items()),
            ("reached", f"{int(self.reached.sum())} of {self.reached.size} positions"),
            ("actuators", names(self.actuators)),
            ("margin", self._least()),
            *(("note", note) for note in self.notes),
        ]
        return table(f"{self.title}: workspace", rows)
