"""The methods `identifiability` and `identify`: numbers of a mechanism from logs of motions and efforts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analyses.identification import (
    Identifiability,
    Identification,
    direction_in_words,
    no_measurements,
)
from ..errors import ArgumentError, AssemblyError, DescriptionError, SingularityError
from ..naming import listed
from ..numeric import shown
from ..options import positive, si
from ..state import State
from ..tolerance import EQUAL
from ..units import Quantity
from .identified import Parameters
from .logs import (
    Channel,
    Filter,
    filter_of,
    table_of,
    times_of,
)
from .models import Modelled
from .regression_study import Evaluated, MeasuredMotion, RegressionStudy, combinations_of

Array = NDArray[np.float64]
ANY, REST = "any", "rest"
MOST_STEPS = 30
"""Steps of Gauss and Newton."""
HALVINGS = 10
"""Times that a step is halved."""
STEP_SETTLED = 1e-9
"""A step of Gauss and Newton that is smaller ends the search. Scale: natural sizes of the parameters. Reason: nine
digits, more than data hold."""
FIT_SETTLED = 1e-9
"""A fit that improves by less has settled. Scale: fraction of the sum of squares. Reason: far below what noise
changes."""
CORRELATED = 0.5
"""Neighbouring residuals with a larger correlation are not independent. Scale: correlation. Reason: a third of the
samples then count."""
EXCEEDS = 1.5
"""Residuals larger than the given noise by this are no noise. Scale: ratio. Reason: far beyond the scatter of a mean
over a hundred samples."""


def identifiability(
    self: Modelled,
    motion: Any = ANY,
    by: Iterable[Any] | None = None,
    *,
    actuators: Any = None,
    measured: Iterable[str] | None = None,
    near: State | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Identifiability:
    """Find which parameters, and which combinations of parameters, efforts and forces along a motion determine.

    The regressor (derivatives of what is measured with respect to the parameters, exact to rounding, loops closed) is
    computed along the motion without noise; its rank is decided at the widest gap of its singular values in natural
    sizes. Prefer it to `identify` before anything is measured: for the choice of sensors and of motions.

    Args:
        motion: "any": random positions near the drawing with random rates and accelerations, which show what any motion
            can determine; "rest": the same positions at rest; or data as in `identify`, of which the positions, rates
            and accelerations are used.
        by: parameters, as in `identify`; None: all inertial parameters of all bodies that move.
        actuators: as in `inverse_dynamics`, one for each degree of freedom; None: what the drives prescribe.
        measured: names of channels: "effort.A" of an actuator, "ground.force.x" and "ground.moment.z" (sum over all
            joints on the ground, moments about the origin of the world), "joint.C.force.x" and "joint.C.moment.z" as
            in `Result.joint`, world axes. None: the efforts of all actuators.
        near: state that defines the branch, as in `kinematics`; None: the drawing.
        parameters: as in `simulate`.

    Returns:
        `Identifiability`: the rank, the base parameters, what is never seen, and hints on further sensors and motions.

    Raises:
        ArgumentError: actuators are fewer or more than the degrees of freedom, a reaction is not determined by the
            motion, the positions do not determine the motion. UnknownNameError: a name does not exist.

    Cost: that of some hundred evaluations of the equations with derivatives in eight directions at a time.

    References: M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots", IEEE
    Trans. Robotics and Automation 6 (1990); S. Bennis, W. Khalil, "Minimum inertial parameters of robots with
    parallelogram closed-loops", IEEE Trans. Systems, Man, and Cybernetics 21 (1991).

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> m.identifiability(actuators=["A"])
    <Identifiability of 'four-bar' by effort.A: 8 of 12 parameters; 2 never seen>
    >>> m.identifiability("rest", actuators=["A"]).rank            # at rest no inertia matters
    4
    """
    study = RegressionStudy(self, actuators, parameters, near, by)
    channels = study.channels(measured, None)
    if isinstance(motion, str) and motion in (ANY, REST):
        notes: tuple[str, ...] = ()
        found = study.random(motion == REST)
    else:
        columns = table_of("motion", motion)
        found, notes = study.closed(study.motion(columns, None, None), study.parameters)
    return study.identifiability(channels, study.evaluated(found, study.parameters, channels), notes)


def identify(
    self: Modelled,
    data: Any,
    by: Iterable[Any] | None = None,
    *,
    actuators: Any = None,
    measured: Iterable[str] | None = None,
    positions: Iterable[str] | None = None,
    noise: Mapping[str, float] | None = None,
    cutoff: Quantity | None = None,
    near: State | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Identification:
    """Identify numbers of the mechanism from a log of its motion with efforts and forces, by least squares.

    First it is found which combinations of the parameters the motion determines at all (rank of the regressor without
    noise), then their values by weighted least squares with exact derivatives: in one step where all parameters enter
    linearly (inertial parameters), by Gauss-Newton steps else (points, lengths, centres of mass). What the data do not
    determine changes least from the present numbers, in natural sizes, and is named; so are directions that the noise
    drowns.

    Args:
        data: columns by name: a dict of arrays (nt,), a DataFrame (its index is the time unless there is a column "t"),
            a Dataset, or the path of a CSV file with units in brackets, all named as results name them: "t" [s];
            "joint.A.position" (or "q.A", or "A") [rad, m], and if known "joint.A.velocity" and
            "joint.A.acceleration"; "effort.A" (or "joint.A.drive"); "ground.force.x", "joint.C.force.y", ... SI units.
        by: parameters. A body's name stands for all of its inertial parameters, which are the default, of all bodies
            that move: mass, first moment of mass and moments of inertia about the point of one of its joints, named
            "crank.mass", "crank.first_moment.x", "crank.inertia_about_A.zz" (body axes; in a planar mechanism the four
            that matter). Else names of `CompiledModel.parameters`: "crank.com.x", "B.point", "spring.stiffness".
        actuators: as in `inverse_dynamics`, one for each degree of freedom; None: what the drives prescribe, or,
            without drives, those with a column of efforts.
        measured: names of the columns that are fitted; None: all efforts of actuators and all forces.
        positions: names of the coordinates from which the motion is computed, as many as degrees of freedom; None:
            those of the actuators where they are measured, else the first ones.
        noise: column -> standard deviation of its noise [N, N m], white, before any filter; None, or not named: from
            the residuals.
        cutoff: frequency [Hz] of a low-pass filter without phase for positions, efforts and regressor alike, of which
            samples at about twice this rate are kept; it should be some times above the motion and below the noise.
            None: no filter.
        near: state that defines the branch, as in `kinematics`; None: the drawing.
        parameters: as in `simulate`; the prior.

    Rates and accelerations that are not columns are those of a spline of degree five through the positions, which
    amplifies their noise: give `cutoff` then.

    Returns:
        `Identification`: estimates, standard deviations, residuals, what is determined in combinations only.

    Raises:
        ArgumentError: columns do not fit, there is no column of efforts or forces (logs of positions alone are not
            offered), actuators are fewer or more than the degrees of freedom, a reaction is not determined by the
            motion. UnknownNameError: a name does not exist. FileFormatError, MissingFileError: of a file.

    Cost: one evaluation of the equations with derivatives for each sample and each eight parameters, on all cores:
    about a second for 10 000 samples of a leg with two loops and 24 parameters; more for each Gauss-Newton step.

    References: M. Gautier, Ph. Poignet, "Extended Kalman filtering and weighted least squares dynamic identification of
    robot", Control Engineering Practice 9 (2001), for the weights and the filter.

    A crank that turns a slider: torque and angle determine six combinations of twelve numbers.

    >>> import numpy as np
    >>> import partita as pt
    >>> m = pt.catalogue.load("slider-crank")
    >>> t = np.linspace(0.0, 1.0, 201)
    >>> true = m.inverse_dynamics((t, {"O": 10.0 * t + np.sin(9.0 * t)}), parameters={"slider.mass": 0.9})
    >>> data = {"t": t, "joint.O.position": 10.0 * t + np.sin(9.0 * t), "effort.O": true.effort("O")}
    >>> found = m.identify(data, by=["slider.mass"])
    >>> round(found.estimates["slider.mass"][0], 3)
    0.9
    """
    columns = table_of("data", data)
    study = RegressionStudy(self, _actuators(self, actuators, columns), parameters, near, by)
    channels = study.channels(measured, columns)
    if not channels:
        raise no_measurements()
    given = np.column_stack([columns[channel.name] for channel in channels])
    limit = None if cutoff is None else positive("cutoff", cutoff, "1/s")
    low_pass = None if limit is None else filter_of(times_of(columns), limit)
    path = study.motion(columns, positions, low_pass)
    return _Fit(study, channels, given, _noise(noise, channels), low_pass, path).found()


def _actuators(self: Modelled, actuators: Any, columns: Mapping[str, Array]) -> Any:
    """The given ones; without drives those with a column of efforts."""
    if actuators is not None or self._description.drives:
        return actuators
    named = [name.partition(".")[2] for name in columns if name.startswith("effort.")]
    named += [x for name in columns if name.startswith("joint.") and name.endswith(".drive") for x in [name[6:-6]]]
    if not named:
        raise no_measurements()
    return list(dict.fromkeys(named))


def _noise(noise: Any, channels: Sequence[Channel]) -> Array:
    """Standard deviation of each channel; NaN: from the residuals."""
    found = np.full(len(channels), np.nan)
    if noise is None:
        return found
    if not isinstance(noise, Mapping):
        raise ArgumentError(f"noise must be a dict of columns and numbers, not {shown(noise)}", argument="noise")
    names = [channel.name for channel in channels]
    for name, value in noise.items():
        if name not in names:
            raise ArgumentError(
                f"noise names {name!r}, which is not fitted; there are {listed(names)}", argument="noise"
            )
        size = si("noise", value, channels[names.index(name)].unit)
        if not isinstance(size, (int, float)) or not size > 0.0:
            raise ArgumentError(f"noise[{name!r}] must be a positive number, not {shown(value)}", argument="noise")
        found[names.index(name)] = float(size)
    return found


class _Fit:
    """Least squares of one log."""

    def __init__(
        self,
        study: RegressionStudy,
        channels: list[Channel],
        given: Array,
        noise: Array,
        low_pass: Filter | None,
        path: MeasuredMotion,
    ) -> None:
        self.study, self.channels, self.low_pass, self.path = study, channels, low_pass, path
        self.noise = noise if low_pass is None else low_pass.gain * noise
        self.prior = study.parameters
        if not np.isfinite(given).all() and low_pass is not None:
            raise ArgumentError(
                "data: an effort or a force is not finite, and cannot be filtered; leave such samples out, or cutoff",
                argument="data",
            )
        ends = slice(path.ends, len(given) - path.ends)
        self.kept = ends if low_pass is None else low_pass.kept(len(given))
        self.given = self._filtered(given)
        known = self.given[np.isfinite(self.given).all(axis=1)]
        if len(known) < len(self.prior.items):
            raise ArgumentError(
                f"data: {len(known)} samples for {len(self.prior.items)} parameters; give more", argument="data"
            )
        self.sizes = np.sqrt(np.mean(known**2, axis=0))
        self.evaluations = 0
        self.notes: tuple[str, ...] = ()
        self.unsettled: tuple[str, ...] = ()

    def _filtered(self, values: Array) -> Array:
        return (values if self.low_pass is None else self.low_pass.smooth(values))[self.kept]

    def _at(self, parameters: Parameters) -> Evaluated:
        closed, self.notes = self.study.closed(self.path, parameters)
        if self.low_pass is not None and not np.isfinite(closed.vdot).all():
            raise ArgumentError(
                f"data: with a filter every sample must be reached: {self.notes[-1]}", argument="cutoff"
            )
        found = self.study.evaluated(closed, parameters, self.channels)
        self.evaluations += 1
        if self.low_pass is not None and not np.isfinite(found.values).all():
            raise ArgumentError(
                "data: the motion passes a position that is singular for the actuators or the constraints, and cannot "
                "be filtered across it; leave cutoff out, or those samples",
                argument="cutoff",
            )
        return Evaluated(self._filtered(found.values), self._filtered(found.derivatives))

    def _solved(self, at: Evaluated, moved: Array) -> dict[str, Any]:
        """Least squares for the whole change from the prior, `moved` so far."""
        residuals = self.given - at.values + at.derivatives @ moved
        found = self.study.fitted(at, residuals, self.sizes, self.noise)
        if self.low_pass is not None:
            for word in ("base_deviations", "deviations", "direction_deviations"):
                found[word] = self.low_pass.widened * found[word]
        return found

    def found(self) -> Identification:
        first = self._at(self.prior)
        rank = self.study.identifiability(self.channels, first, (), self.path)
        if self.prior.linear:
            own = self._solved(first, np.zeros(len(self.prior.items)))
            moved = own["changes"]
            left = self.given - first.values - first.derivatives @ moved
            return self._result(rank, own, self.prior.changed(self.prior.values + moved), left)
        at, moved = first, np.zeros(len(self.prior.items))
        own = self._solved(at, moved)
        settled = False
        for _ in range(MOST_STEPS):
            step = own["changes"] - moved
            if np.max(np.abs(step) / self.prior.scales) < STEP_SETTLED:
                settled = True
                break
            new, why = self._shortened(at, moved, step, own["noise"])
            if new is None:
                self.unsettled = (
                    f"the search ended after {self.evaluations} evaluations: no part of the last step "
                    f"{'is possible: ' + why if why else 'improves the fit'}",
                )
                settled = True
                break
            before, (at, moved) = self._squares(at, own["noise"]), new
            gained = 1.0 - self._squares(at, own["noise"]) / before if before > 0.0 else 0.0
            own = self._solved(at, moved)
            if gained < FIT_SETTLED:
                settled = True
                break
        if not settled:
            self.unsettled = (f"the search has not settled in {MOST_STEPS} Gauss-Newton steps",)
        current = self.prior.changed(self.prior.values + moved)
        return self._result(rank, own, current, self.given - at.values)

    def _squares(self, at: Evaluated, noise: Array) -> float:
        return float(np.nansum(((self.given - at.values) / noise) ** 2))

    def _shortened(
        self, at: Evaluated, moved: Array, step: Array, noise: Array
    ) -> tuple[tuple[Evaluated, Array] | None, str]:
        """The step, halved until the mechanism exists with it and the fit is no worse; None where it never is, and why
        the mechanism does not exist."""
        before, why = self._squares(at, noise), ""
        for i in range(HALVINGS):
            new = moved + 0.5**i * step
            try:
                there = self._at(self.prior.changed(self.prior.values + new))
            except (DescriptionError, AssemblyError, SingularityError, ArgumentError) as error:
                why = error.message
                continue
            same = np.isfinite(there.values).all(axis=1) == np.isfinite(at.values).all(axis=1)
            if not same.all():
                why = "other samples are reached"
            elif self._squares(there, noise) <= before:
                return (there, new), ""
        return None, why

    def _result(
        self, rank: Identifiability, own: Mapping[str, Any], current: Parameters, left: Array
    ) -> Identification:
        p = self.prior
        names = [channel.name for channel in self.channels]
        known = np.isfinite(left).all(axis=1)
        t = self.path.t[self.kept] if self.path.timed else np.arange(len(left), dtype=float)
        rms = np.sqrt(np.mean(left[known] ** 2, axis=0))
        deviations, directions = own["direction_deviations"], own["directions"]
        words = [
            f"{direction_in_words(p.labels, parts)} (in natural sizes, sd {sd:.2g})"
            for parts, sd in zip(directions, deviations, strict=True)
        ]
        drowned = tuple(words[len(words) - own["drowned"] :][::-1])
        notes = [*self.unsettled, *self.notes]
        if missing := len(left) - int(known.sum()):
            notes.append(f"{missing} of {len(left)} samples have no efforts and are left out")
        notes += _correlations(names, left[known])
        numbers = {name: list(values) for name, values in current.numbers.items()}
        return Identification(
            title=self.study.title,
            identifiability=rank,
            estimates=numbers,
            values=dict(zip(p.labels, current.values.tolist(), strict=True)),
            priors=dict(zip(p.labels, p.values.tolist(), strict=True)),
            sd=dict(zip(p.labels, own["deviations"].tolist(), strict=True)),
            combinations=combinations_of(p, own, estimated=True),
            drowned=drowned,
            worst=words[-1] if words else "",
            t=t[known],
            residuals=dict(zip(names, left[known].T, strict=True)),
            rms=dict(zip(names, rms.tolist(), strict=True)),
            noise=dict(zip(names, own["noise"].tolist(), strict=True)),
            iterations=self.evaluations,
            warnings=(*_impossible(current, rank), *_exceeded(names, rms, self.noise)),
            notes=tuple(notes),
            _applied=self.study.given.with_parameters,
        )


def _impossible(current: Parameters, rank: Identifiability) -> Iterable[str]:
    """Bodies that cannot exist."""
    for body in current.bodies():
        mass, moments = current.mass_and_moments(body)
        rounding = EQUAL * float(np.abs(moments).max())
        exists = len(moments) == 1 or moments.max() <= moments.sum() - moments.max() + rounding
        if mass > 0.0 and moments.min() >= -rounding and moments.max() > 0.0 and exists:
            continue
        shared = [label for label in rank.together if label.startswith(f"{body}.")]
        why = (
            f"; the data determine {listed(shared)} in combinations only, so another choice within them may exist: "
            "name fewer parameters in by, or give a better prior"
            if shared
            else "; the model lacks something that acts, such as friction, or the noise is too large"
        )
        what = f"mass {mass:.6g} kg" if mass <= 0.0 else f"moments of inertia {', '.join(f'{x:.4g}' for x in moments)}"
        yield f"body {body!r} cannot exist with the estimates: {what}{why}"


def _exceeded(names: Sequence[str], rms: Array, noise: Array) -> Iterable[str]:
    """Residuals that no noise explains."""
    for name, x, sd in zip(names, rms, noise, strict=True):
        if np.isfinite(sd) and x > EXCEEDS * sd:
            yield (
                f"the residuals of {name} ({x:.3g}) exceed the given noise ({sd:.3g}): something acts that the model "
                "or the parameters in by do not contain, such as friction"
            )


def _correlations(names: Sequence[str], left: Array) -> Iterable[str]:
    """Residuals whose neighbours are not independent."""
    for name, x in zip(names, left.T, strict=True):
        squares = float(x @ x)
        if len(x) > 2 and squares > 0.0 and (found := float(x[1:] @ x[:-1]) / squares) > CORRELATED:
            yield (
                f"neighbouring residuals of {name} are correlated ({found:.2f}): standard deviations are too small; "
                "something acts that the parameters do not contain, or the data are sampled faster than their noise "
                "changes (cutoff=)"
            )
