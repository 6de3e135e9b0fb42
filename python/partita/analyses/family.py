"""Families of equilibria over a parameter: what `m.equilibrium(along=...)` returns."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..naming import index_of
from ..notebook import table
from ..numeric import shown
from ..state import State
from .equilibrium import Equilibrium
from .still import place

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
SHOWN = 4
"""Folds and branch points that are shown before the rest is counted."""


@dataclass(frozen=True, eq=False, repr=False)
class BranchPoint:
    """A position of a family at which another family branches off: buckling, for instance.

    Attributes:
        value: the parameter there (of several: how far from their first to their last values, 0 to 1).
        parameters: all parameters of the family there, as `parameters=` takes them.
        state: the position.
        motion: name of the displacement that moves most along the branch.
        direction: displacement (nv,) along which efforts do not change: the branch leaves along it, both ways.
        unstable: number of directions of negative curvature before and after, in the order of the family.
    """

    value: float
    parameters: Mapping[str, list[float]]
    state: State
    motion: str
    direction: Array
    before: int
    after: int

    @property
    def unstable(self) -> tuple[int, int]:
        """How many directions have negative curvature before and after it."""
        return self.before, self.after

    def __repr__(self) -> str:
        return f"<branch point at {self.value:.10g}, along {self.motion}; {_change(self.before, self.after)}>"


@dataclass(frozen=True, eq=False, repr=False)
class Fold:
    """A position at which the parameter turns back along a family: beyond it no equilibrium is near.

    Attributes:
        value: the parameter there (of several: how far from their first to their last values, 0 to 1).
        parameters: all parameters of the family there, as `parameters=` takes them.
        state: the position.
        motion: name of the displacement that moves most.
        direction: displacement (nv,) along which efforts do not change.
        unstable: number of directions of negative curvature before and after, in the order of the family.
    """

    value: float
    parameters: Mapping[str, list[float]]
    state: State
    motion: str
    direction: Array
    before: int
    after: int
    _snap: Callable[[], Equilibrium | None] | None = field(default=None)

    @property
    def unstable(self) -> tuple[int, int]:
        """How many directions have negative curvature before and after it."""
        return self.before, self.after

    @cached_property
    def snaps_to(self) -> Equilibrium | None:
        """The stable equilibrium at this value of the parameter to which the forces lead from here, down the potential:
        where a mechanism snaps to when the parameter is changed slowly beyond the fold. Its inertia may carry it on to
        another one. None where a stable family does not end here, or where the forces lead to no equilibrium."""
        return None if self._snap is None else self._snap()

    def __repr__(self) -> str:
        return f"<fold at {self.value:.10g}, along {self.motion}; {_change(self.before, self.after)}>"


def _change(before: int, after: int) -> str:
    if before == 0 or after == 0:
        return f"{'loses' if before == 0 else 'gains'} stability"
    return f"{before} unstable directions become {after}"


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumPath:
    """Equilibria over a parameter, in their order along the family; one entry for each passage of a value asked for.

    Items are `Equilibrium`; `len` counts them. The same value appears as often as the family passes it, not at all
    where it does not.

    Attributes:
        parameter: the number that varies; of several, that they are given by a fraction of their line.
        asked: (n,) the values asked for; of several numbers 0 for the first row and 1 for the last.
        which: (m,) index into `asked` of each entry.
        equilibria: the m entries.
        folds: positions at which the parameter turns back, located to round-off.
        branch_points: positions at which another family branches off, likewise; it is not followed: begin on it,
            `near=` a state displaced along its direction.
        ends: why the family ends at its beginning and at its end.
        curve_values, curve_q: the parameter (p,) and the coordinates (p, nq) at all positions computed along it.
        curve_negative: (p,) number of directions of negative curvature; 0 is stable where forces are conservative.
        names: of the coordinates.

    >>> import partita as pt
    >>> m = pt.Mechanism("column", gravity=None)          # a bar on a torsion spring, pressed from above
    >>> bar = m.add_rod("bar", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    >>> foot = m.add_revolute("foot", m.ground, bar, point=(0, 0, 0))
    >>> spring = m.add_torsion_spring("foot", stiffness=3.0)
    >>> load = m.add_force(bar, (0, -1.0, 0), (1, 0, 0), name="load")
    >>> path = m.equilibrium(along={"load.value": [(0, -1.0, 0), (0, -2.0, 0), (0, -5.0, 0)]})
    >>> path.parameter, round(path.branch_points[0].value, 12)    # buckles at stiffness / length
    ('load.value[1]', -3.0)
    >>> path.stable.tolist()
    [True, True, False]
    """

    parameter: str
    asked: Array
    which: NDArray[np.int_]
    equilibria: tuple[Equilibrium, ...]
    folds: tuple[Fold, ...]
    branch_points: tuple[BranchPoint, ...]
    ends: tuple[str, str]
    curve_values: Array
    curve_q: Array
    curve_negative: NDArray[np.int_]
    names: tuple[str, ...]
    title: str

    @property
    def values(self) -> Array:
        """(m,): the parameter of each entry."""
        return self.asked[self.which]

    @property
    def missed(self) -> Array:
        """Values asked for that the family does not pass."""
        return np.delete(self.asked, np.unique(self.which))

    @property
    def states(self) -> tuple[State, ...]:
        """The state of each entry."""
        return tuple(one.state for one in self.equilibria)

    @property
    def stable(self) -> NDArray[np.object_]:
        """(m,): True or False by linearisation; None where it does not decide."""
        return np.array([one.stable for one in self.equilibria], dtype=object)

    def __len__(self) -> int:
        return len(self.equilibria)

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self.equilibria)

    def __getitem__(self, index: int) -> Equilibrium:
        return self.equilibria[place(index, len(self), "an entry")]

    def at(self, value: float) -> tuple[Equilibrium, ...]:
        """Entries at one of the values asked for, in their order along the family; none where it is not passed."""
        found = np.flatnonzero(self.asked == value)
        if not len(found):
            raise ArgumentError(f"{shown(value)} is none of the values asked for", argument="value")
        return tuple(one for one, i in zip(self.equilibria, self.which, strict=True) if i == found[0])

    def position(self, name: str) -> Array:
        """(m,): a coordinate of the state in each entry, by its name."""
        i = index_of(str(name), list(self.names), "coordinate")
        return np.array([one.state.q[i] for one in self.equilibria])

    def plot(self, coordinate: str | None = None, path: str | os.PathLike[str] | None = None) -> Figure:
        """A coordinate over the parameter, stable parts solid and others dashed, with folds and branch points.

        Args:
            coordinate: name of a coordinate of the state; None: the one that moves most.
            path: also write the figure to this file.

        Returns the Matplotlib figure; `MissingDependencyError` without Matplotlib.
        """
        from ..plots.family import plot_family

        spans = np.ptp(self.curve_q, axis=0)
        shown_one = (
            int(np.argmax(spans)) if coordinate is None else index_of(coordinate, list(self.names), "coordinate")
        )
        return plot_family(self, shown_one, path)

    def to_xarray(self) -> xarray.Dataset:
        """Entries as an `xarray.Dataset` along "entry": coordinates, stability, potential, indifferent directions; the
        folds along "fold". Needs the package xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")
        rows = np.array([one.state.q for one in self.equilibria]).reshape(len(self), len(self.names))
        # 1, 0, and -1 where it is not decided: a file holds no None
        stable = np.array([-1 if one is None else int(one) for one in self.stable], dtype=np.int8)
        data = {
            "q": (("entry", "coordinate"), rows),
            "stable": ("entry", stable, {"long_name": "1 stable, 0 unstable, -1 not decided by linearisation"}),
            "potential": ("entry", np.array([one.potential for one in self.equilibria]), {"units": "J"}),
            "indifferent": ("entry", np.array([one.indifferent for one in self.equilibria], dtype=int)),
            "fold_q": (("fold", "coordinate"), np.array([f.state.q for f in self.folds]).reshape(-1, len(self.names))),
        }
        labels = {
            "value": ("entry", self.values, {"long_name": self.parameter}),
            "coordinate": np.array(self.names, dtype=str),
            "fold": np.array([f.value for f in self.folds]),
        }
        return xarray.Dataset(data, coords=labels, attrs={"title": self.title, "parameter": self.parameter})

    def __repr__(self) -> str:
        passed = len(np.unique(self.which))
        return (
            f"<EquilibriumPath over {self.parameter}: {len(self)} equilibria for {passed} values, "
            f"{sum(one is True for one in self.stable)} stable; {_listed(self.folds, 'fold')}"
            + (f"; {_listed(self.branch_points, 'branch point')}" if self.branch_points else "")
            + (f"; {len(self.missed)} values are not passed" if len(self.missed) else "")
            + ">"
        )

    def _repr_html_(self) -> str:
        rows = [
            ("values", f"{len(self.asked)}, from {self.asked.min():.6g} to {self.asked.max():.6g}"),
            ("equilibria", f"{len(self)}, of them {sum(one is True for one in self.stable)} stable"),
            *((f"fold {i}", repr(one)) for i, one in enumerate(self.folds[:SHOWN])),
            *((f"branch point {i}", repr(one)) for i, one in enumerate(self.branch_points[:SHOWN])),
            ("ends", "; ".join(self.ends)),
        ]
        return table(f"{self.title}: equilibria over {self.parameter}", rows)


def _listed(found: tuple[Fold, ...] | tuple[BranchPoint, ...], word: str) -> str:
    if not found:
        return f"no {word}s"
    first = ", ".join(f"{one.value:.6g}" for one in found[:SHOWN])
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return f"{word}{'s' * (len(found) > 1)} at {first}{more}"
