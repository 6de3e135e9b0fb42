"""Result of `Mechanism.singularities`: curves and points."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..naming import goal_name, index_of
from ..notebook import names, table
from ..results import BodyResult
from ..state import Layout, State

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
ACTUATORS = "actuators"
OUTPUTS = "outputs"
CONSTRAINTS = "constraints"
KINDS = (ACTUATORS, OUTPUTS, CONSTRAINTS)
ENDS = {
    "closed": "closed",
    "range": "end of the range",
    "branch": "end of the branch",
    "limit": "limit of the loops, or no single direction further on",
    "long": "more points than are followed",
}


@dataclass(frozen=True, repr=False, eq=False)
class SingularCurve:
    """Singular positions one after the other, joined to a curve, or single ones.

    Attributes:
        q: (n, nq) coordinates of the positions.
        goals: goal -> its values (n,), as in the grid; of all goals, those that are held too.
        measure: (n,) what remains of the least singular value, which is zero at a singular position: round-off.
        ends: how it begins and ends: "closed", "end of the range", "end of the branch", or what stopped it; empty for
            single positions.
    """

    q: FloatArray
    goals: Mapping[Any, FloatArray]
    measure: FloatArray
    ends: tuple[str, ...]
    _model: CompiledModel
    _layout: Layout
    _t: float

    @property
    def closed(self) -> bool:
        """Whether the curve returns to its first point, which is not repeated."""
        return "closed" in self.ends

    def __len__(self) -> int:
        return len(self.measure)

    def state(self, i: int) -> State:
        """Position i, at rest; can be passed to `assemble` as `near`, or to a plot."""
        if not -len(self) <= i < len(self):
            raise ArgumentError(f"i = {i}: there are {len(self)} positions, 0 to {len(self) - 1}", argument="i")
        return State(self._t, self.q[i], np.zeros(self._model.core.nv), layout=self._layout)

    def path(self, body: Any, point: Any = (0.0, 0.0, 0.0)) -> FloatArray:
        """(n, 3): a point of a body, in body axes, at all positions [m]."""
        return body_at(self._model, self._t, self.q, body).point(point)

    def joint(self, name: Any) -> FloatArray:
        """Coordinates of a joint at all positions: (n,) where it has one, else (n, coordinates) [rad, m]."""
        return joint_at(self._model, self._t, self.q, name)

    def __repr__(self) -> str:
        if not self.ends:
            return f"<{len(self)} singular position{'s' * (len(self) != 1)}>"
        return f"<Curve of {len(self)} singular positions, {self._words()}>"

    def _words(self) -> str:
        return "closed" if self.closed else f"from {self.ends[0]} to {self.ends[-1]}"


def body_at(model: CompiledModel, t: float, q: FloatArray, name: Any) -> BodyResult:
    """Motion of a body at rest in the rows of q."""
    bodies = [body["name"] for body in model.summary["bodies"]]
    i = index_of(str(name), bodies, "body")
    found = model.core.motion(np.full(len(q), t), q, np.zeros((len(q), model.core.nv))).bodies([i])
    return BodyResult(
        str(name),
        np.asarray(found["body_position"])[:, 0],
        np.asarray(found["body_rotation"])[:, 0],
        np.asarray(found["body_velocity"])[:, 0],
        np.asarray(found["body_angular_velocity"])[:, 0],
    )


def joint_at(model: CompiledModel, t: float, q: FloatArray, name: Any) -> FloatArray:
    """Coordinates of a joint in the rows of q."""
    i = index_of(str(name), [joint["name"] for joint in model.summary["joints"]], "joint")
    found = model.core.motion(np.full(len(q), t), q, np.zeros((len(q), model.core.nv))).joints([i])
    values: FloatArray = np.asarray(found["joint_position"])
    return values[:, 0] if values.shape[1] == 1 else values


@dataclass(frozen=True, repr=False, eq=False)
class Singularities:
    """Singular positions of a set of measurements within a range: an iterable of curves.

    Attributes:
        title: name of the mechanism.
        kind: "actuators", "outputs" or "constraints".
        of: names of the actuators, or of the outputs.
        keys: goals that vary, as in the grid.
        units: their units.
        limits: (goals that vary, 2) the range.
        held: goals that are held -> their values.
        curves: the curves, the longest first; empty where one goal varies.
        points: single positions: all of them where one goal varies.
        samples: number of positions that cover the range.
        notes: sentences on what the list does not contain.
    """

    title: str
    kind: str
    of: tuple[str, ...]
    keys: tuple[Any, ...]
    units: tuple[str, ...]
    limits: FloatArray
    held: Mapping[Any, float]
    curves: tuple[SingularCurve, ...]
    points: SingularCurve
    samples: int
    notes: tuple[str, ...]

    def __iter__(self) -> Iterator[SingularCurve]:
        return iter(self.curves)

    def __len__(self) -> int:
        return len(self.curves)

    def __getitem__(self, i: int) -> SingularCurve:
        return self.curves[i]

    def plot(self, of: Any = None, *, ax: Any = None, path: str | os.PathLike[str] | None = None) -> Figure:
        """Plot the curves over the goals that vary; with `of` = (body, point) over the positions of that point, seen
        along the axis across which it moves least. `ax`: existing Matplotlib axes, such as those of a `Workspace`.
        `path` saves the figure.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("five-bar")
        >>> found = m.singularities({"A": np.linspace(-1, 1, 9), "E": np.linspace(-1, 1, 9)}, of=("A", "E"))
        >>> [ax.get_xlabel() for ax in found.plot().axes]
        ['A [rad]']
        """
        from ..plots.maps import plot_singularities

        return plot_singularities(self, of, ax, path)

    def to_xarray(self) -> xarray.Dataset:
        """All positions as an `xarray.Dataset` over `position`, with the number of the curve of each, -1 for single
        ones, and the values of the goals."""
        from ..extras import extra

        xarray = extra("xarray", "xarray", "to_xarray")
        parts = [*self.curves, self.points]
        numbers = np.concatenate([np.full(len(part), i) for i, part in enumerate(parts)]).astype(int)
        numbers[len(numbers) - len(self.points) :] = -1
        units = dict(zip(self.keys, self.units, strict=True))
        variables: dict[str, Any] = {
            "q": (("position", "coordinate"), np.vstack([part.q for part in parts])),
            "measure": (("position",), np.concatenate([part.measure for part in parts]), {"units": "1"}),
        }
        for key in (*self.keys, *self.held):
            values = np.concatenate([part.goals[key] for part in parts])
            variables[goal_name(key)] = (("position",), values, {"units": units.get(key, "")})
        coords = {"curve": ("position", numbers)}
        return xarray.Dataset(variables, coords=coords, attrs={"title": f"{self.title}: singular {self.kind}"})

    def _words(self) -> str:
        count = f"{len(self.curves)} curve{'s' * (len(self.curves) != 1)}"
        closed = sum(curve.closed for curve in self.curves)
        parts = [f"{count} ({closed} closed)" if closed else count] if len(self.keys) == 2 else []
        if len(self.points) or len(self.keys) == 1:
            parts.append(f"{len(self.points)} point{'s' * (len(self.points) != 1)}")
        return ", ".join(parts)

    def __repr__(self) -> str:
        what = f"{self.kind} {', '.join(self.of)}" if self.of else self.kind
        over = ", ".join(goal_name(key) for key in self.keys)
        return f"<Singularities of {self.title!r}, {what}, over {over}: {self._words()}>"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        limits = zip(self.keys, self.units, self.limits, strict=True)
        rows = [
            ("kind", f"{self.kind} {names(self.of)}" if self.of else self.kind),
            *(("range", f"{goal_name(key)}: {low:.4g} to {high:.4g} {unit}") for key, unit, (low, high) in limits),
            *(("held", f"{goal_name(key)} = {value:.6g}") for key, value in self.held.items()),
            ("found", self._words()),
            *(("curve", repr(curve)[1:-1]) for curve in self.curves[:SHOWN]),
            *(("note", note) for note in self.notes),
        ]
        return table(f"{self.title}: singular positions", rows)


SHOWN = 8
"""Curves named in a table."""
