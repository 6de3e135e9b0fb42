"""Periodic motions: what `m.cycle` returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..extras import extra
from ..naming import index_of
from ..notebook import names, table
from ..results import Result
from ..state import State

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..plots.files import PathLike

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

ON_CIRCLE = 1e-6
"""A multiplier this near to the unit circle does not decide stability. Scale: its distance. Reason: far above the error
of multipliers, which is reported, and far below what a motion shows."""
AT_ONE = 1e-3
"""A multiplier this near to 1 or -1, or a pair this near to the unit circle, is called by the name of its bifurcation.
Scale: its distance. Reason: three printed digits."""
REAL = 1e-9
"""A multiplier with a smaller imaginary part is real. Scale: fraction of its size. Reason: far above rounding."""
SHOWN = 4
"""Multipliers in words before the rest is counted."""


@dataclass(frozen=True, eq=False, repr=False)
class CycleDerivative:
    """How a periodic motion changes with a parameter.

    Attributes:
        start: (m, p): change of the variables at the start, for each number of the parameter.
        period: (p,): change of the period [s].
        variables: names of the m variables.
    """

    start: Array
    period: Array
    variables: tuple[str, ...]

    def __repr__(self) -> str:
        parts = ", ".join(f"{name}: {_numbers(row)}" for name, row in zip(self.variables, self.start, strict=True))
        return f"<CycleDerivative: {parts}; period: {_numbers(self.period)}>"


def _numbers(row: Array) -> str:
    return ", ".join(f"{x:.6g}" for x in row)


@dataclass(frozen=True, eq=False, repr=False)
class Cycle:
    """A periodic motion: after its period every body is where it was, at the same velocity.

    Attributes:
        state: where it begins.
        period: the time after which it repeats [s]; of a motion of several periods of a drive all of them.
        periods: how many periods of its drives it takes; 1 of a free motion.
        multipliers: Floquet multipliers, complex (m,), the largest first: factors by which small deviations grow from
            one cycle to the next. Of a free motion without the multiplier 1 of a shift in time (of a conservative one
            without the two of a shift in time and of energy), which `trivial` has.
        matrix: monodromy matrix (m, m) in the `variables`.
        variables: names of the independent positions, then of the rates ("A'").
        stable: True or False by linearisation; None where multipliers lie on the unit circle, which does not decide.
        kind: "driven"; "free": its period is its own; "conservative": free, one of a family over the energy.
        trivial: multipliers that are 1 by nature; their distance from 1 shows how accurate the others are.
        error: estimated error of the entries of `matrix`, in natural sizes.
        method: "exact": derivatives of the steps of the run; "differences" of runs where these do not serve, as for
            spatial rotations.
        off: largest difference between end and start, in radians, characteristic lengths and the rates of these.
        history: that difference in each iteration of the search.
        by: the derivatives that were asked for, by the names of their parameters.
    """

    state: State
    period: float
    periods: int
    multipliers: ComplexArray
    matrix: Array
    variables: tuple[str, ...]
    kind: str
    trivial: ComplexArray
    error: float
    method: str
    off: float
    history: tuple[float, ...]
    by: Mapping[str, CycleDerivative]
    _run: Callable[[], Result] = field(repr=False)

    @cached_property
    def result(self) -> Result:
        """The run over one cycle, with all forces."""
        return self._run()

    @property
    def frequency(self) -> float:
        """1 / period [Hz]."""
        return 1.0 / self.period

    @property
    def stable(self) -> bool | None:
        """True or False by linearisation; None where it does not decide."""
        sizes = np.abs(self.multipliers)
        if np.any(sizes > 1.0 + self._decided):
            return False
        if self.kind == "conservative":
            return None  # deviations of the energy stay
        return None if np.any(sizes >= 1.0 - self._decided) else True

    @property
    def _decided(self) -> float:
        return max(ON_CIRCLE, self.error)

    @property
    def words(self) -> str:
        """Stability and the multipliers behind it, as a sentence."""
        found = self.multipliers
        neutral = "neutral: one of a family over its energy"
        if not len(found):
            words = {"driven": "stable: nothing is free to deviate", "conservative": neutral}
            return words.get(self.kind, "stable: no multiplier but that of a shift in time")
        critical = _critical(found)
        listed = _listed(found)
        if self.kind == "conservative" and self.stable is None:
            return f"{neutral}; {critical or 'the others on the unit circle'}; {listed}"
        if critical:
            return f"{critical}; {listed}"
        if self.stable is None:
            return f"not decided by linearisation: on the unit circle; {listed}"
        if self.stable:
            return f"stable: largest multiplier {abs(found[0]):.4g}; {listed}"
        return f"unstable, {_loss(found[0])}: largest multiplier {abs(found[0]):.4g}; {listed}"

    def plot(self, coordinate: str | None = None, path: PathLike | None = None) -> Figure:
        """The closed curve of a coordinate and its rate, and the multipliers in the unit circle.

        Args:
            coordinate: a joint with one coordinate; None: that of the first variable.
            path: also write the figure to this file.

        Returns the Matplotlib figure; `MissingDependencyError` without Matplotlib.
        """
        from ..plots.cycle import plot_cycle

        known = list(self.result.names.velocities)
        first = self.variables[0].rstrip("'") if self.variables else known[0]
        i = known.index(first) if coordinate is None else index_of(str(coordinate), known, "coordinate")
        return plot_cycle(self, i, path)

    def to_xarray(self) -> xarray.Dataset:
        """Multipliers (real and imaginary parts), monodromy matrix and start, as an `xarray.Dataset`; the motion is
        `result.to_xarray()`. `MissingDependencyError` without xarray."""
        xarray = extra("xarray", "xarray", "to_xarray")
        data = {
            "real": ("multiplier", self.multipliers.real),
            "imaginary": ("multiplier", self.multipliers.imag),
            "matrix": (("variable", "by"), self.matrix),
            "q": ("coordinate", self.state.q),
            "period": ((), self.period, {"units": "s"}),
        }
        labels = {
            "variable": np.array(self.variables, dtype=str),
            "by": np.array(self.variables, dtype=str),
            "coordinate": np.array(self.state.names, dtype=str),
        }
        return xarray.Dataset(data, coords=labels, attrs={"kind": self.kind, "words": self.words})

    def __repr__(self) -> str:
        several = f" ({self.periods} periods of its drives)" if self.periods > 1 else ""
        return f"<Cycle of {self.period:.6g} s{several}, {self.kind}: {self.words}>"

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [
            ("period", f"{self.period:.9g} s" + (f", {self.periods} of its drives" if self.periods > 1 else "")),
            ("kind", self.kind),
            ("stability", self.words),
            ("variables", names(self.variables)),
            ("comes back within", f"{self.off:.2g}"),
            ("derivatives", self.method),
        ]
        if len(self.trivial):
            rows.append(("multipliers that are 1", f"within {np.abs(self.trivial - 1.0).max():.2g}"))
        return table("Periodic motion", rows)


def _is_real(x: complex) -> bool:
    return abs(x.imag) <= REAL * max(abs(x), REAL)


def _critical(found: ComplexArray) -> str:
    """The bifurcation that the multipliers are at."""
    for x in found:
        if _is_real(x) and abs(x + 1.0) <= AT_ONE:
            return f"period doubling: a multiplier at {x.real:.3f}"
        if _is_real(x) and abs(x - 1.0) <= AT_ONE:
            return f"fold or branching: a multiplier at {x.real:.3f}"
    return ""


def _loss(x: complex) -> str:
    """How deviations grow."""
    if not _is_real(x):
        return "past a Neimark-Sacker bifurcation"
    return "past a period doubling" if x.real < 0.0 else "deviations grow in one direction"


def _listed(found: ComplexArray) -> str:
    """Multipliers in words, each pair once."""
    own = [x for x in found if _is_real(x) or x.imag > 0.0]
    texts = [
        f"{x.real:.4g}" if _is_real(x) else f"a pair {x.real:.4g} +- {abs(x.imag):.4g}i (size {abs(x):.4g})"
        for x in own[:SHOWN]
    ]
    more = f" and {len(own) - SHOWN} more" if len(own) > SHOWN else ""
    return ", ".join(texts) + more
