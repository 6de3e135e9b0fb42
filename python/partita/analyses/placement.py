"""Result of `Mechanism.placement`: sets of actuators or encoders, the best first."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from ..notebook import table
from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS, LEAST_DIVISOR

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
COMPARED = 20_000
"""Up to this many sets all are computed; of more only the best are found, and the others excluded by bounds."""
RANKED = 10
"""Sets that are found then."""


@dataclass(frozen=True)
class PlacedSet:
    """One set of actuators or encoders.

    Attributes:
        names: its members.
        worst: the least margin over all positions.
        typical: the geometric mean of the margins.
        at: index of the position with the least one, in the grid of the workspace.
        separation: of encoders the least distance between the readings of two assemblies with the same goals, in
            radians and lengths of the mechanism; NaN if not known, infinite where there is one assembly everywhere.
    """

    names: tuple[str, ...]
    worst: float
    typical: float
    at: tuple[int, ...]
    separation: float = float("nan")

    def __repr__(self) -> str:
        return f"<{', '.join(self.names)}: margin at least {self.worst:.3g}, typically {self.typical:.3g}>"


@dataclass(frozen=True, repr=False, eq=False)
class Placement:
    """Sets of actuators or encoders, ranked by their worst margin over a workspace: an iterable of sets.

    Attributes:
        title: name of the mechanism.
        of: "actuators" or "encoders".
        sets: the sets, the best first.
        compared: number of sets that there are.
        exhaustive: whether all of them are listed; else the best, the others being excluded by bounds.
        positions: number of positions over which they are compared.
        further: the encoder to be added to the best set, with what is gained; None for actuators.
        notes: sentences.
    """

    title: str
    of: str
    sets: tuple[PlacedSet, ...]
    compared: int
    exhaustive: bool
    positions: int
    further: PlacedSet | None
    notes: tuple[str, ...]

    @property
    def best(self) -> PlacedSet:
        """The best set."""
        return self.sets[0]

    def __iter__(self) -> Iterator[PlacedSet]:
        return iter(self.sets)

    def __len__(self) -> int:
        return len(self.sets)

    @overload
    def __getitem__(self, i: int) -> PlacedSet: ...
    @overload
    def __getitem__(self, i: slice) -> tuple[PlacedSet, ...]: ...
    def __getitem__(self, i: int | slice) -> PlacedSet | tuple[PlacedSet, ...]:
        return self.sets[i]

    def plot(self, *, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw worst and typical margins of the best sets as bars. `path` saves the figure."""
        from ..plots.maps import plot_placement

        return plot_placement(self, path)

    def _words(self) -> str:
        how = "all compared" if self.exhaustive else "the best found by bounds"
        return f"{self.compared} sets over {self.positions} positions, {how}"

    def __repr__(self) -> str:
        return f"<Placement of {self.of} of {self.title!r}: best {repr(self.best)[1:-1]}; {self._words()}>"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [
            (", ".join(one.names), f"worst {one.worst:.3g}, typical {one.typical:.3g}") for one in self.sets[:RANKED]
        ]
        further = [] if self.further is None else [("further encoder", self.further.names[-1])]
        title = f"{self.title}: {self.of}, {self._words()}"
        return table(title, [*rows, *further, *(("note", note) for note in self.notes)])


def ranked(scaled: FloatArray, count: int, k: int) -> tuple[list[tuple[tuple[int, ...], FloatArray]], int, bool]:
    """Sets of `count` columns with their margins at each position, the best first; how many there are; whether all are
    in the list. `scaled` (n, motions, s): what each column does, without units; the least of `k` singular values
    counts, fewer than the motions where rotations move no other body."""
    s = scaled.shape[2]
    total = comb(s, count)
    if total <= COMPARED:
        sets = [(which, margins_of(scaled, which, k)) for which in itertools.combinations(range(s), count)]
        return sorted(sets, key=order), total, True
    return _bounded(scaled, count, k), total, False


def margins_of(scaled: FloatArray, which: Sequence[int], k: int) -> FloatArray:
    """(n,): the least singular value of these columns, as far as they can span the k motions."""
    return np.asarray(np.linalg.svd(scaled[:, :, list(which)], compute_uv=False)[:, min(len(which), k) - 1])


def order(found: tuple[tuple[int, ...], FloatArray]) -> tuple[float, float, tuple[int, ...]]:
    """The worst margin first, equal ones by the mean of the logarithms."""
    which, margins = found
    worst = float(margins.min())
    step = np.log(max(worst, LEAST_DIVISOR)) / EQUAL
    return -round(step), -typical(margins), which


def typical(margins: FloatArray) -> float:
    """The geometric mean."""
    return float(np.exp(np.log(np.maximum(margins, LEAST_DIVISOR)).mean()))


def _bounded(scaled: FloatArray, count: int, k: int) -> list[tuple[tuple[int, ...], FloatArray]]:
    """The best sets by branch and bound.

    Fewer than k columns have a least singular value not below that of k of which they are part; all that can still be
    added have one not below that of a part of them. A branch is cut where a bound is below the last of the best.
    """
    s = scaled.shape[2]
    alone = np.linalg.norm(scaled, axis=1).min(axis=0)
    columns = list(np.argsort(-alone, kind="stable"))
    best: list[tuple[tuple[int, ...], FloatArray]] = []

    def bound(which: list[int], rest: list[int]) -> float:
        small = margins_of(scaled, which, k).min() if count == k else np.inf
        large = margins_of(scaled, [*which, *rest], k).min() if len(which) + len(rest) >= k else 0.0
        return float(min(small, large))

    def search(which: list[int], start: int) -> None:
        if len(which) == count:
            best.append((tuple(sorted(which)), margins_of(scaled, which, k)))
            best.sort(key=order)
            del best[RANKED:]
            return
        for i in range(start, s - (count - len(which)) + 1):
            more = [*which, int(columns[i])]
            rest = [int(x) for x in columns[i + 1 :]]
            if len(best) < RANKED or bound(more, rest) >= float(best[-1][1].min()):
                search(more, i + 1)

    search([], 0)
    return best


def apart(readings: Sequence[FloatArray], positions: Sequence[FloatArray], turns: NDArray[np.bool_]) -> FloatArray:
    """(s,) -> the distances (pairs, s) of readings between assemblies with the same goals.

    `readings` of each sheet (n, s) in radians and lengths of the mechanism, NaN where there is no assembly; `turns`:
    readings that do not count whole turns. `positions` (n, bodies) tell whether two are different.
    """
    pairs = []
    for one, two in itertools.combinations(range(len(readings)), 2):
        both = np.isfinite(readings[one]).all(axis=1) & np.isfinite(readings[two]).all(axis=1)
        differ = np.abs(positions[one] - positions[two]).max(axis=1) > EQUAL_IN_SIX_DIGITS
        change = (readings[one] - readings[two])[both & differ]
        wrapped = np.where(turns, change - 2.0 * np.pi * np.round(change / (2.0 * np.pi)), change)
        pairs.append(np.abs(wrapped))
    return np.vstack([np.empty((0, len(turns))), *pairs])


def separation(distances: FloatArray, which: Sequence[int]) -> float:
    """How far apart the readings of a set are at least, over all pairs of assemblies."""
    if not len(distances):
        return float("inf")
    found: Any = distances[:, list(which)].max(axis=1).min()
    return float(found)
