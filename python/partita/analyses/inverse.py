"""Result of `Mechanism.inverse_dynamics`: efforts, what they cost, and the reactions with them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..naming import Names, index_of
from ..notebook import table
from ..numeric import MaybeNone
from ..results import BodyResult, CouplingResult, EnergyResult, JointResult
from ..results.force import ForceResult
from ..results.run import Run
from ..results.sensor import SensorResult
from ..results.source import Source
from ..tolerance import NEGLIGIBLE

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, repr=False, eq=False)
class InverseDynamics:
    """Efforts of actuators that cause a given motion, over nt instants, and everything else that acts with them.

    Attributes:
        actuators: names of the s actuators.
        units: unit of each effort, "N" or "N m".
        efforts: (nt, s) the efforts; NaN where they are not determined: see `gaps`.
        rates: (nt, s) rate along each actuator [m/s, rad/s]; times the effort it is a power.
        margin: (nt,) how far the set is from a position in which it cannot cause every motion (type II singularity),
            without units: 1 best, 0 there. The smallest singular value of L^-1 D E diag(1/|k_s|), M_d = L L^T; with
            fewer actuators than degrees of freedom, how far they are from doing the same. NaN where the constraints
            themselves are singular.
        remainder: (nt,) the generalised force that no effort provides, as a fraction of the larger of the applied and
            the inertial one, in the metric M_d^-1. It is round-off with enough actuators.
        null_space: (nt, s, s - k) efforts that cause no motion, of more actuators than the k degrees of freedom:
            orthonormal in the metric of the weights, and continuous in time. Any multiple can be added, for instance
            against backlash.
        limits: (s, 2) lower and upper limit of each effort, or None.
        gaps: instant -> why it has no efforts: "constraints" (they are singular), "actuators" (the set is), "motion"
            (its accelerations are not known).
        notes: sentences on instants without efforts, what the set cannot do, and exceeded limits.

    `joint`, `body`, `coupling`, `sensor` and `energy` are those of a `Result`, with the efforts acting:
    `joint("A").force` includes all loads, `joint("A").drive` the effort of an actuator in the joint. Which reactions
    are determined follows from the constraints alone: no actuator is one.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> run = m.simulate(0.5)                                     # falls freely, so that no effort is needed
    >>> d = m.inverse_dynamics(run, actuators=["A"])
    >>> bool(abs(d.effort("A")).max() < 1e-9)
    True
    >>> d.joint("C").force.shape
    (201, 3)
    """

    actuators: tuple[str, ...]
    units: tuple[str, ...]
    efforts: FloatArray
    rates: FloatArray
    margin: FloatArray
    remainder: FloatArray
    null_space: FloatArray
    limits: FloatArray | None
    gaps: Mapping[int, str]
    notes: tuple[str, ...]
    run: Run
    """The motion with all forces, as data of a run; for tools."""

    @property
    def t(self) -> FloatArray:
        """(nt,): times [s]."""
        return self.run.t

    @property
    def q(self) -> FloatArray:
        """(nt, nq): coordinates."""
        return self.run.q

    @property
    def v(self) -> FloatArray:
        """(nt, nv): velocities."""
        return self.run.v

    @property
    def vdot(self) -> FloatArray:
        """(nt, nv): accelerations."""
        return self.run.vdot

    @property
    def names(self) -> Names:
        """Names of the coordinates, velocities, joints and bodies."""
        return self.run.names

    def effort(self, actuator: Any) -> FloatArray:
        """(nt,): effort of one actuator [N, N m], positive towards larger values of what it moves."""
        return self.efforts[:, self._index(actuator)]

    def rate(self, actuator: Any) -> FloatArray:
        """(nt,): rate along one actuator [m/s, rad/s]."""
        return self.rates[:, self._index(actuator)]

    def power(self, actuator: Any) -> FloatArray:
        """(nt,): power of one actuator [W]; negative where it brakes."""
        i = self._index(actuator)
        return np.asarray(self.efforts[:, i] * self.rates[:, i])

    @property
    def use(self) -> FloatArray | MaybeNone:
        """(nt,): the largest fraction of a limit that is used; above 1 no distribution of the efforts stays within.
        None without limits."""
        return None if self.limits is None else use_of(self.efforts, self.limits)

    def peak(self) -> dict[str, dict[str, float]]:
        """For the choice of motors, of each actuator: "effort" (largest magnitude), "rms" (root of the mean square over
        time, the effort being linear between the instants), "rate" (fastest) and "power" (largest); NaN where no
        instant has efforts.

        >>> import partita as pt
        >>> m = pt.Mechanism("lift", gravity=(0, 0, -9.81))
        >>> load = m.add_body("load", mass=2.0, inertia=(1, 1, 1))
        >>> rail = m.add_prismatic("rail", m.ground, load, axis=(0, 0, 1))
        >>> d = m.inverse_dynamics(([0.0, 1.0], {"rail": [0.0, 0.5]}))
        >>> {word: round(x, 6) for word, x in d.peak()["rail"].items()}
        {'effort': 19.62, 'rms': 19.62, 'rate': 0.5, 'power': 9.81}
        """
        found = {}
        for i, name in enumerate(self.actuators):
            known = np.isfinite(self.efforts[:, i])
            effort, rate = self.efforts[known, i], self.rates[known, i]
            if not known.any():
                found[name] = dict.fromkeys(("effort", "rms", "rate", "power"), float("nan"))
                continue
            found[name] = {
                "effort": float(np.abs(effort).max()),
                "rms": _root_mean_square(self.t, self.efforts[:, i]),
                "rate": float(np.abs(rate).max()),
                "power": float(np.abs(effort * rate).max()),
            }
        return found

    def joint(self, name: Any) -> JointResult:
        """Motion and reaction of a joint with the efforts acting, as `Result.joint`."""
        return self.run.joint(str(name))

    def body(self, name: Any) -> BodyResult:
        """Motion of a body, as `Result.body`."""
        return self.run.body(str(name))

    def coupling(self, name: Any) -> CouplingResult:
        """Efforts of a coupling, as `Result.coupling`."""
        return self.run.coupling(str(name))

    def force(self, name: Any) -> ForceResult:
        """What an applied force does along the motion, as `Result.force`; an actuator's own effort is `effort`."""
        return self.run.force(str(name))

    def sensor(self, name: Any) -> SensorResult:
        """Readings of a sensor, as `Result.sensor`."""
        return self.run.sensor(str(name))

    @property
    def energy(self) -> EnergyResult:
        """Kinetic and potential energy, as `Result.energy`; the work is not known."""
        return self.run.energy

    @property
    def at_once(self) -> Source:
        """All reactions at once, as those of a run: see `Result.at_once`."""
        return self.run.at_once

    def plot(self, *actuators: Any, path: str | os.PathLike[str] | None = None) -> Figure:
        """Plot efforts over time, one panel for each unit, and the margin; all actuators, or some. `path` saves it.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> figure = m.inverse_dynamics(m.simulate(0.2), actuators=["A"]).plot()
        >>> [ax.get_ylabel() for ax in figure.axes]
        ['effort [N m]', 'margin']
        """
        from ..plots.efforts import plot_efforts

        chosen = [self._index(one) for one in actuators] or list(range(len(self.actuators)))
        return plot_efforts(self, chosen, path)

    def to_xarray(self) -> xarray.Dataset:
        """Efforts, rates, margin, remainder and null space as an `xarray.Dataset` over `time`, `actuator` and
        `null`."""
        from ..extras import extra

        xarray = extra("xarray", "xarray", "to_xarray")
        of = {"units": " or ".join(dict.fromkeys(self.units))}
        variables: dict[str, Any] = {
            "effort": (("t", "actuator"), self.efforts, {**of, "long_name": "efforts of the actuators"}),
            "rate": (("t", "actuator"), self.rates, {"long_name": "rates along the actuators"}),
            "margin": (("t",), self.margin, {"units": "1", "long_name": "distance of the set from a singularity"}),
            "remainder": (("t",), self.remainder, {"units": "1", "long_name": "part that no effort provides"}),
            "null_space": (("t", "actuator", "null"), self.null_space, {"long_name": "efforts without motion"}),
        }
        coords = {
            "t": ("t", self.t, {"units": "s"}),
            "actuator": list(self.actuators),
            "actuator_unit": ("actuator", list(self.units)),
        }
        return xarray.Dataset(variables, coords=coords, attrs={"title": self.run.title})

    def _index(self, actuator: Any) -> int:
        return index_of(str(actuator), self.actuators, "actuator")

    def __repr__(self) -> str:
        known = np.isfinite(self.efforts).all(axis=1)
        words = ", ".join(
            f"{name} up to {peak['effort']:.4g} {unit}"
            for (name, peak), unit in zip(self.peak().items(), self.units, strict=True)
        )
        margin = f"margin at least {np.nanmin(self.margin):.2g}" if np.isfinite(self.margin).any() else "no margin"
        gaps = "" if known.all() else f"; {int((~known).sum())} instants without efforts"
        left = f"; {self.notes[0]}" if self.notes and known.all() else ""
        return f"<Inverse dynamics of {self.run.title!r}: {len(self.t)} instants; {words}; {margin}{gaps}{left}>"

    def _repr_html_(self) -> str:
        rows = [
            (name, f"{peak['effort']:.4g} {unit}, rms {peak['rms']:.4g}, power up to {peak['power']:.4g} W")
            for (name, peak), unit in zip(self.peak().items(), self.units, strict=True)
        ]
        least = float(np.nanmin(self.margin)) if np.isfinite(self.margin).any() else float("nan")
        return table(f"{self.run.title}: efforts", [*rows, ("least margin", f"{least:.3g}"), *_numbered(self.notes)])


def _numbered(notes: Sequence[str]) -> list[tuple[str, str]]:
    return [("note", note) for note in notes]


def use_of(efforts: FloatArray, limits: FloatArray) -> FloatArray:
    """(nt,): the largest fraction of a limit."""
    return np.asarray((efforts / np.where(efforts < 0.0, limits[:, 0], limits[:, 1])).max(axis=1))


def notes_of(found: Mapping[str, Any], names: Sequence[str], t: FloatArray) -> list[str]:
    """Sentences on what the efforts cannot do."""
    notes = []
    gaps = np.array(found["gaps"])
    why = {
        "constraints": "the constraints are singular: the motion is not unique there; the efforts are NaN",
        "actuators": "{who} cannot cause every motion (type II singularity); the efforts are NaN",
        "motion": "the accelerations of the motion are not known; the efforts are NaN",
    }
    who = f"the actuator{'s' * (len(names) > 1)} {', '.join(names)}"
    for word, sentence in why.items():
        where = np.flatnonzero(gaps == word)
        if len(where):
            times = ", ".join(f"{t[i]:.6g}" for i in where[:3]) + (" ..." if len(where) > 3 else "")
            notes.append(f"at {len(where)} of {len(t)} instants (t = {times} s) {sentence.format(who=who)}")
    remainder = np.nan_to_num(found["remainder"])
    if len(remainder) and len(names) < found["k"] and remainder.max() > NEGLIGIBLE:
        worst = int(np.argmax(remainder))
        notes.append(
            f"this motion is not possible with {', '.join(names)} alone: {len(names)} actuator"
            f"{'s' * (len(names) > 1)} for {found['k']} degrees of freedom leave up to "
            f"{100.0 * remainder[worst]:.3g} % of the acting forces (at t = {t[worst]:.6g} s); the efforts are those "
            f"that leave the least; add {found['k'] - len(names)} more"
        )
    return notes


def exceeded(efforts: FloatArray, limits: FloatArray | None, t: FloatArray) -> list[str]:
    """A sentence where no distribution stays within the limits."""
    if limits is None:
        return []
    use = use_of(efforts, limits)
    over = np.flatnonzero(np.nan_to_num(use) > 1.0 + NEGLIGIBLE)
    if not len(over):
        return []
    worst = int(over[np.argmax(use[over])])
    return [
        f"the limits do not allow this motion: at {len(over)} of {len(t)} instants every distribution of the efforts "
        f"exceeds one, by the factor {use[worst]:.4g} at t = {t[worst]:.6g} s"
    ]


def _root_mean_square(t: FloatArray, effort: FloatArray) -> float:
    """Over the time between neighbouring instants with an effort, linear between them; over the instants where no time
    lies between any."""
    a, b, step = effort[:-1], effort[1:], np.diff(t)
    known = np.isfinite(a) & np.isfinite(b) & (step > 0.0)
    if not known.any():
        return float(np.sqrt(np.mean(effort[np.isfinite(effort)] ** 2)))
    a, b, step = a[known], b[known], step[known]
    return float(np.sqrt((step * (a * a + a * b + b * b)).sum() / (3.0 * step.sum())))


def mixed(units: Sequence[str]) -> ArgumentError:
    """Efforts of different units cannot be added without weights."""
    return ArgumentError(
        f"weights: more actuators than degrees of freedom share the load, and their efforts have different units "
        f"({', '.join(dict.fromkeys(units))}), so that the least sum of squares has no meaning; give a weight for "
        "each, such as the inverse square of what a motor can do, or limits with weights='least-use'",
        argument="weights",
    )
