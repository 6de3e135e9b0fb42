"""What measurements determine of the parameters of a mechanism, and their values by least squares."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import index_of
from ..notebook import table
from ..tolerance import EQUAL

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
SHOWN_TERMS = 6
"""Terms of a combination that are shown before the rest is counted."""
LARGE_PART = 0.3
"""A parameter has a large part in a direction from this on. Scale: fraction of its largest part. Reason: smaller ones
change the direction by a tenth in length."""
SHARP = 1e3
"""A rank is decided sharply where the last singular value kept exceeds the first one dropped by this. Scale: ratio.
Reason: below it a weak excitation and rounding look alike."""


@dataclass(frozen=True, eq=False)
class Combination:
    """A combination of parameters that the measurements determine: a base parameter.

    Attributes:
        name: the parameter that stands for it.
        terms: label -> factor, with 1 for the parameter itself.
        unit: of its value.
        size: natural size of the parameter that stands for it, in this unit.
        prior: its value by the parameters of the mechanism.
        estimate: its value by the data; NaN where only the rank was asked for.
        sd: standard deviation of the estimate; NaN likewise.
        drowned: whether the noise of the data leaves less than its order of magnitude.

    >>> import partita as pt
    >>> m = pt.Mechanism("pendulum")
    >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    >>> [str(c) for c in m.identifiability(actuators=["A"]).combinations]
    ['rod.first_moment.x', 'rod.first_moment.y', 'rod.inertia_about_A.zz']
    """

    name: str
    terms: Mapping[str, float]
    unit: str
    size: float
    prior: float
    estimate: float = float("nan")
    sd: float = float("nan")
    drowned: bool = False

    def __str__(self) -> str:
        words: list[str] = []
        for label, factor in list(self.terms.items())[:SHOWN_TERMS]:
            size = abs(factor)
            term = label if abs(size - 1.0) < EQUAL else f"{size:.6g} {label}"
            words.append(f"{'-' if factor < 0.0 else '+'} {term}" if words else term)
        more = len(self.terms) - SHOWN_TERMS
        return " ".join(words) + (f" and {more} more" if more > 0 else "")


@dataclass(frozen=True, repr=False, eq=False)
class Identifiability:
    """Which parameters some measurements determine along a motion, without noise.

    Attributes:
        labels: names of the n parameters.
        measured: names of the channels.
        rank: number of combinations that are determined.
        combinations: the base parameters, `rank` of them.
        never: parameters that no measurement depends on.
        together: parameters that are determined in combinations only.
        alone: parameters that are determined by themselves.
        singular_values: (n,) of the regressor in natural sizes of the parameters, channels of equal weight.
        gap: ratio of the last singular value kept to the first one dropped; infinite where none is dropped.
        attainable: rank that the same channels reach on rich motions (random positions, rates and accelerations).
        candidates: further channel or motion -> rank with it on rich motions.
        hints: sentences: which further sensor or motion determines more.
        notes: sentences on what was left out.
    """

    title: str
    labels: tuple[str, ...]
    measured: tuple[str, ...]
    rank: int
    combinations: tuple[Combination, ...]
    never: tuple[str, ...]
    together: tuple[str, ...]
    alone: tuple[str, ...]
    singular_values: Array
    gap: float
    attainable: int
    candidates: Mapping[str, int]
    hints: tuple[str, ...]
    notes: tuple[str, ...]

    def plot(self, *, path: str | os.PathLike[str] | None = None) -> Figure:
        """Plot the singular values, with the gap at which the rank is decided. `path` saves the figure.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> len(m.identifiability(actuators=["A"]).plot().axes)
        1
        """
        from ..plots.identification import plot_singular_values

        return plot_singular_values(self, path)

    def __repr__(self) -> str:
        return (
            f"<Identifiability of {self.title!r} by {', '.join(self.measured)}: {self.rank} of {len(self.labels)} "
            f"parameters{'' if not self.never else f'; {len(self.never)} never seen'}>"
        )

    def _repr_html_(self) -> str:
        rows = [("rank", f"{self.rank} of {len(self.labels)}"), ("never seen", ", ".join(self.never) or "none")]
        rows += [("determined", str(one)) for one in self.combinations]
        rows += [("hint", hint) for hint in self.hints] + [("note", note) for note in self.notes]
        return table(f"{self.title}: what {', '.join(self.measured)} determine", rows)


@dataclass(frozen=True, repr=False, eq=False)
class Identification:
    """Parameters of a mechanism by least squares from a log.

    Attributes:
        identifiability: the rank without noise, and what is determined in combinations only.
        estimates: parameter of the model -> numbers, as `with_parameters` and `parameters=` take them.
        values: label -> value of each identified parameter. What the data do not determine, or drown in noise, has
            changed least from the prior, in natural sizes.
        priors: label -> value before.
        sd: label -> standard deviation; infinite for a parameter that is not determined alone.
        combinations: base parameters with estimate, standard deviation and prior.
        drowned: sentences: directions of parameters that the noise leaves undetermined, the worst first.
        worst: the worst determined direction in words, with its standard deviation in natural sizes.
        t: (nt,) times of the residuals [s]; indices where the data have no times.
        residuals: channel -> measured less computed (nt,), [N, N m]; filtered if the data were.
        rms: channel -> root mean square of its residuals.
        noise: channel -> standard deviation of its noise, given or from the residuals; filtered if the data were.
        iterations: evaluations of the regressor.
        warnings: sentences: bodies that cannot exist, noise that the residuals exceed.
        notes: sentences: how rates were made, what was left out.
    """

    title: str
    identifiability: Identifiability
    estimates: Mapping[str, list[float]]
    values: Mapping[str, float]
    priors: Mapping[str, float]
    sd: Mapping[str, float]
    combinations: tuple[Combination, ...]
    drowned: tuple[str, ...]
    worst: str
    t: Array
    residuals: Mapping[str, Array]
    rms: Mapping[str, float]
    noise: Mapping[str, float]
    iterations: int
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    _applied: Callable[[Mapping[str, list[float]]], Any] = field(repr=False)

    @property
    def rank(self) -> int:
        """Number of combinations that the data determine without noise."""
        return self.identifiability.rank

    @property
    def hints(self) -> tuple[str, ...]:
        """Which further sensor or motion determines more."""
        return self.identifiability.hints

    def combination(self, name: str) -> Combination:
        """The base parameter of a name."""
        names = [one.name for one in self.combinations]
        return self.combinations[index_of(str(name), names, "combination")]

    def apply(self) -> Any:
        """The compiled model with the estimates: `m.compile().with_parameters(result.estimates)`.

        Raises `DescriptionError` where a body with these numbers cannot exist; `warnings` names it before."""
        return self._applied(self.estimates)

    def plot(self, *, path: str | os.PathLike[str] | None = None) -> Figure:
        """Plot the changes of the base parameters with their standard deviations, and the residuals. `path` saves the
        figure."""
        from ..plots.identification import plot_identification

        return plot_identification(self, path)

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each base parameter: unit, prior, estimate, sd, whether it is drowned, and the combination."""
        from ..extras import extra

        pandas = extra("pandas", "pandas", "to_pandas")
        rows = [
            {
                "parameter": one.name,
                "unit": one.unit,
                "prior": one.prior,
                "estimate": one.estimate,
                "sd": one.sd,
                "drowned": one.drowned,
                "combination": str(one),
            }
            for one in self.combinations
        ]
        return pandas.DataFrame(rows).set_index("parameter")

    def __repr__(self) -> str:
        fit = ", ".join(f"{name} to {x:.3g}" for name, x in self.rms.items())
        left = f"; {len(self.warnings)} warnings" if self.warnings else ""
        drowned = f", {len(self.drowned)} drowned in noise" if self.drowned else ""
        return (
            f"<Identification of {self.title!r}: {self.rank} combinations of {len(self.values)} parameters"
            f"{drowned}; residuals of {fit}{left}>"
        )

    def _repr_html_(self) -> str:
        rows = [
            (str(one), f"{one.estimate:.6g} ± {one.sd:.2g} {one.unit} (before: {one.prior:.6g})")
            for one in self.combinations
        ]
        rows += [("never seen", ", ".join(self.identifiability.never) or "none"), ("worst", self.worst)]
        rows += [("warning", x) for x in self.warnings] + [("hint", x) for x in self.hints]
        return table(f"{self.title}: identified", [*rows, *(("note", x) for x in self.notes)])


def direction_in_words(labels: Sequence[str], parts: Array) -> str:
    """The parameters with a large part in a direction."""
    size = np.abs(parts)
    order = [int(i) for i in np.argsort(-size) if size[i] >= LARGE_PART * size.max()]
    words = [f"{parts[i] / size.max():+.2f} {labels[i]}" for i in order[:SHOWN_TERMS]]
    more = len(order) - SHOWN_TERMS
    return ", ".join(words) + (f" and {more} more" if more > 0 else "")


def no_measurements() -> ArgumentError:
    """A log without efforts and forces."""
    return ArgumentError(
        "data hold no effort and no force: logs of positions alone determine inertias only in proportion to known "
        "forces, which is not offered; add a column such as 'effort.A' (of an actuator; zeros where it is passive), "
        "'ground.force.x' or 'joint.A.force.x', or ask identifiability what such columns would determine",
        argument="data",
    )
