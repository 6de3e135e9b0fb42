"""Families of periodic motions over a parameter: what `m.cycle(along=...)` returns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..extras import extra
from ..naming import index_of
from ..notebook import table
from ..numeric import shown
from ..results import Result
from .cycle import Cycle
from .still import place

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..plots.files import PathLike

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SHOWN = 4
"""Special positions of one kind that are shown before the rest is counted."""


@dataclass(frozen=True, eq=False, repr=False)
class Bifurcation:
    """A position of a family at which a multiplier crosses the unit circle.

    Attributes:
        what: "fold", "period doubling", "Neimark-Sacker" or "branch point".
        value: the parameter there (of several: how far from their first to their last values, 0 to 1).
        parameters: all parameters of the family there, as `parameters=` takes them.
        cycle: the periodic motion.
        multiplier: the one that crosses.
        before, after: how many multipliers lie outside of the unit circle before and after, along the family.
    """

    what: str
    value: float
    parameters: Mapping[str, list[float]]
    cycle: Cycle
    multiplier: complex
    before: int
    after: int
    _branch: Callable[[ArrayLike | None], CycleFamily] | None = field(default=None)

    def branch(self, values: ArrayLike | None = None) -> CycleFamily:
        """The family of motions of twice the period that leaves a period doubling here.

        Args:
            values: of the parameter; None: those of this family.

        Raises `ArgumentError` at other bifurcations, whose branches are not followed.
        """
        if self._branch is None:
            raise ArgumentError(
                f"the branches of a {self.what} are not followed; only those of a period doubling are",
                argument="branch",
            )
        return self._branch(values)

    def __repr__(self) -> str:
        x = self.multiplier
        pair = f"a pair {x.real:.4g} +- {abs(x.imag):.4g}i" if self.what == "Neimark-Sacker" else f"{x.real:.6g}"
        return (
            f"<{self.what} at {self.value:.10g}: multiplier {pair}; {self.before} outside the unit circle become "
            f"{self.after}>"
        )


@dataclass(frozen=True, eq=False, repr=False)
class CycleFamily:
    """Periodic motions over a parameter, in their order along the family; one entry for each passage of a value asked
    for.

    Items are `Cycle`; `len` counts them. The same value appears as often as the family passes it, not at all where it
    does not.

    Attributes:
        parameter: the number that varies; of several, that they are given by a fraction of their line.
        asked: (n,) the values asked for; of several numbers 0 for the first row and 1 for the last.
        which: (m,) index into `asked` of each entry.
        cycles: the m entries.
        bifurcations: positions at which a multiplier crosses the unit circle, in their order along the family.
        ends: why the family ends at its beginning and at its end.
        curve_values: (p,) the parameter at all positions computed along it.
        curve_periods: (p,) periods there [s].
        curve: (p,) the runs over one cycle there, with 61 outputs each.
        curve_multipliers: (p, k) multipliers there.
        names: of the coordinates.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.Mechanism("shaken mass", gravity=None)
    >>> mass = m.add_body("mass", mass=1.0, inertia=(1, 1, 1))
    >>> slide = m.add_prismatic("S", m.ground, mass, axis=(1, 0, 0))
    >>> spring = m.add_torsion_spring("S", stiffness=4.0, damping=0.4, name="s")
    >>> push = m.add_force(mass, (lambda t, state: np.cos(3.0 * t), 0, 0))
    >>> m.cycle(along={"s.stiffness": [4.0, 6.0]})
    <CycleFamily over s.stiffness: 2 cycles for 2 values, 2 stable; no bifurcations>
    """

    parameter: str
    asked: Array
    which: NDArray[np.int_]
    cycles: tuple[Cycle, ...]
    bifurcations: tuple[Bifurcation, ...]
    ends: tuple[str, str]
    curve_values: Array
    curve_periods: Array
    curve: tuple[Result, ...]
    curve_multipliers: ComplexArray
    names: tuple[str, ...]
    title: str

    @property
    def folds(self) -> tuple[Bifurcation, ...]:
        """Where the parameter turns back: a stable and an unstable motion meet and vanish beyond it."""
        return self._of("fold")

    @property
    def period_doublings(self) -> tuple[Bifurcation, ...]:
        """Where a multiplier is -1, and motions of twice the period branch off."""
        return self._of("period doubling")

    @property
    def neimark_sackers(self) -> tuple[Bifurcation, ...]:
        """Where a pair of multipliers crosses the unit circle: beyond it the motion has a second frequency."""
        return self._of("Neimark-Sacker")

    @property
    def branch_points(self) -> tuple[Bifurcation, ...]:
        """Where a multiplier is 1 and the parameter does not turn back: another family of motions crosses, such as one
        that is less symmetric."""
        return self._of("branch point")

    def _of(self, what: str) -> tuple[Bifurcation, ...]:
        return tuple(one for one in self.bifurcations if one.what == what)

    @property
    def special(self) -> tuple[Bifurcation, ...]:
        """All bifurcations, for pictures."""
        return self.bifurcations

    @property
    def curve_low(self) -> Array:
        """(p, nq): least value of each coordinate in one cycle."""
        return np.array([run.q.min(axis=0) for run in self.curve])

    @property
    def curve_high(self) -> Array:
        """(p, nq): largest value of each coordinate in one cycle."""
        return np.array([run.q.max(axis=0) for run in self.curve])

    @property
    def curve_unstable(self) -> NDArray[np.int_]:
        """(p,): how many multipliers lie outside of the unit circle."""
        return np.sum(np.abs(self.curve_multipliers) > 1.0, axis=1)

    @property
    def values(self) -> Array:
        """(m,): the parameter of each entry."""
        return self.asked[self.which]

    @property
    def missed(self) -> Array:
        """Values asked for that the family does not pass."""
        return np.delete(self.asked, np.unique(self.which))

    @property
    def stable(self) -> NDArray[np.object_]:
        """(m,): True or False by linearisation; None where it does not decide."""
        return np.array([one.stable for one in self.cycles], dtype=object)

    @property
    def periods(self) -> Array:
        """(m,): period of each entry [s]."""
        return np.array([one.period for one in self.cycles])

    def __len__(self) -> int:
        return len(self.cycles)

    def __iter__(self) -> Iterator[Cycle]:
        return iter(self.cycles)

    def __getitem__(self, index: int) -> Cycle:
        return self.cycles[place(index, len(self), "an entry")]

    def at(self, value: float) -> tuple[Cycle, ...]:
        """Entries at one of the values asked for, in their order along the family; none where it is not passed."""
        found = np.flatnonzero(self.asked == value)
        if not len(found):
            raise ArgumentError(f"{shown(value)} is none of the values asked for", argument="value")
        return tuple(one for one, i in zip(self.cycles, self.which, strict=True) if i == found[0])

    def plot(self, coordinate: str | None = None, path: PathLike | None = None) -> Figure:
        """Least and largest value of a coordinate in each cycle over the parameter, stable parts solid and others
        dashed; and the sizes of the multipliers, with bifurcations.

        Args:
            coordinate: name of a coordinate of the state; None: the one whose range changes most.
            path: also write the figure to this file.

        Returns the Matplotlib figure; `MissingDependencyError` without Matplotlib.
        """
        from ..plots.cycle import plot_cycles

        spans = np.ptp(self.curve_high - self.curve_low, axis=0)
        shown_one = (
            int(np.argmax(spans)) if coordinate is None else index_of(str(coordinate), list(self.names), "coordinate")
        )
        return plot_cycles(self, shown_one, path)

    def to_xarray(self) -> xarray.Dataset:
        """Entries along "entry" (starts, periods, multipliers, stability) and bifurcations along "bifurcation", as an
        `xarray.Dataset`. Needs the package xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")
        rows = np.array([one.state.q for one in self.cycles]).reshape(len(self), len(self.names))
        stable = np.array([-1 if one is None else int(one) for one in self.stable], dtype=np.int8)
        found = np.array([one.multipliers for one in self.cycles]).reshape(len(self), -1)
        data: dict[str, Any] = {
            "q": (("entry", "coordinate"), rows),
            "period": ("entry", self.periods, {"units": "s"}),
            "stable": ("entry", stable, {"long_name": "1 stable, 0 unstable, -1 not decided by linearisation"}),
            "real": (("entry", "multiplier"), found.real),
            "imaginary": (("entry", "multiplier"), found.imag),
            "what": ("bifurcation", np.array([one.what for one in self.bifurcations], dtype=str)),
        }
        labels = {
            "value": ("entry", self.values, {"long_name": self.parameter}),
            "coordinate": np.array(self.names, dtype=str),
            "bifurcation": np.array([one.value for one in self.bifurcations]),
        }
        return xarray.Dataset(data, coords=labels, attrs={"title": self.title, "parameter": self.parameter})

    def __repr__(self) -> str:
        passed = len(np.unique(self.which))
        kinds = dict.fromkeys(one.what for one in self.bifurcations)
        words = "; ".join(_listed(self._of(what), what) for what in kinds) or "no bifurcations"
        return (
            f"<CycleFamily over {self.parameter}: {len(self)} cycles for {passed} values, "
            f"{sum(one is True for one in self.stable)} stable; {words}"
            + (f"; {len(self.missed)} values are not passed" if len(self.missed) else "")
            + ">"
        )

    def _repr_html_(self) -> str:
        rows = [
            ("values", f"{len(self.asked)}, from {self.asked.min():.6g} to {self.asked.max():.6g}"),
            ("cycles", f"{len(self)}, of them {sum(one is True for one in self.stable)} stable"),
            *((one.what, repr(one)) for one in self.bifurcations[: 2 * SHOWN]),
            ("ends", "; ".join(self.ends)),
        ]
        return table(f"{self.title}: periodic motions over {self.parameter}", rows)


def _listed(found: tuple[Bifurcation, ...], what: str) -> str:
    values = ", ".join(f"{one.value:.6g}" for one in found[:SHOWN])
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return f"{what} at {values}{more}"
