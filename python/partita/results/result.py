"""The result of a run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import options as run_options
from ..errors import ArgumentError, DoubtfulResultWarning, Interrupted
from ..naming import driven, listed
from ..numeric import shown
from ..sensing import SensorRecord
from ..state import Layout, State, finite_time
from .body import BodyResult, resting
from .certificate import Certificate, certify
from .coupling import CouplingResult, DriveResult
from .energy import EnergyResult
from .joint import AskedJoint, JointPlace, JointResult
from .names import Names, index_of
from .notebook import names, table
from .partition_log import PartitionChange, partition_changes
from .record import Record
from .self_stress import SelfStresses, self_stresses_of
from .sensor import LiveSensors, RunSignals, SensorResult, StoredSensors, account_of, result_of
from .source import BODIES, Arrays, ModelSource, Source
from .variables import units
from .verdict import DOUBTFUL, Finding, allowed, of_energy, of_reactions, unnoticed, word_of

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

INTERRUPTED = "interrupted"
AT_A_PROMPT = "sys.last_value.result"


class Result:
    """Motion and forces of one run, over nt outputs; SI units and radians, names in `names`.

    A run keeps times, coordinates and velocities. Accelerations, multipliers and closures are computed together when
    one of them is first asked for, so are measures and qualities; bodies, joints and reactions one by one; all are
    kept. A result that was stopped (`success` False, or by Ctrl-C) holds every output reached; `status` and `message`
    say why it ended. A pickled result takes along all that can be asked of it, as a stored one does, and needs no
    model where it is read.

    >>> result.joint("A").force[-1], result.energy.total[0]        # doctest: +SKIP
    """

    def __init__(
        self, record: Record, source: Source | None, sensors: LiveSensors | StoredSensors | None = None
    ) -> None:
        self._record = record
        self._source = source
        self._sensors = sensors
        self._warned = False
        arrays = record.arrays
        self.t: FloatArray = arrays["t"]
        """(nt,): times of the outputs [s]."""
        self.q: FloatArray = arrays["q"]
        """(nt, nq): coordinates [m, rad; quaternions scalar first]."""
        self.v: FloatArray = arrays["v"]
        """(nt, nv): velocities [m/s, rad/s]."""
        self.error = record.error
        """What ended the run early, for instance an `EvaluationError` raised from what a function raised; None for a
        run that ended otherwise, and in a stored result. `raise run.error` shows where."""
        self.counters = dict(record.counters)
        self.options = dict(record.options)
        self.summary = dict(record.summary)
        """What the compiled model says of itself: bodies, joints, sizes, removed rows."""

    def __copy__(self) -> Result:
        return Result(self._record, self._source, self._sensors)

    @classmethod
    def from_run(
        cls,
        raw: Mapping[str, Any],
        *,
        model: Any,
        summary: Mapping[str, Any],
        spec: str | None = None,
        options: Mapping[str, Any] | None = None,
        sensors: Mapping[str, SensorRecord] | None = None,
    ) -> Result:
        """From what the core returned: `raw` of `simulate`, the compiled `model` it came from, its `summary`.

        `sensors` are those of the description. `spec` is the description compiled, as JSON; None for a
        hand-written `System`, which has no bodies and joints. Raises `Interrupted`, with the result, for a run that
        Ctrl-C ended.
        """
        account = account_of(sensors or {}, summary)
        if account:
            summary = {**summary, "sensors": account}
        record = Record.from_raw(raw, summary, options or {}, spec)
        source, read = None, None
        if spec is not None:
            counts = len(summary.get("bodies", ())), len(summary.get("joints", ()))
            source = ModelSource(model, record.arrays, *counts, int(summary.get("closing_rows", 0)))
            read = LiveSensors(sensors or {}, RunSignals(source, model, record.arrays, summary), account)
        result = cls(record, source, read)
        result._warn(record.findings)
        if record.status == INTERRUPTED and record.error is None:
            raise Interrupted(f"{record.message}, in `result` of this error (here and now: {AT_A_PROMPT})", result)
        return result

    @property
    def success(self) -> bool:
        """Whether the run reached its end and what it returned holds: all conditions closed at every step, the
        energy balanced, reactions in balance with the motion. Of reactions it looks at the first and the last output;
        with the certificate, at all."""
        return self._record.success and self._broken is None

    @property
    def status(self) -> str:
        """How the run ended, in a word: "finished", "broken" (at its end, with a result that does not hold), ..."""
        return "broken" if self._record.success and self._broken else self._record.status

    @property
    def message(self) -> str:
        """How the run ended, in a sentence."""
        broken = self._broken if self._record.success else None
        told = self._record.message
        return told if broken is None else f"{told}, but the result is broken: {broken.sentence}"

    @property
    def _broken(self) -> Finding | None:
        """The first finding by which the run is broken, among those known."""
        known = self.certificate.findings if "certificate" in self.__dict__ else self._at_ends
        return next((finding for finding in known if finding.broken), None)

    @cached_property
    def _at_ends(self) -> list[Finding]:
        """What is known without the reactions of every output: of the steps, the energy, the first and last output."""
        known = list(self._record.findings)
        if self._source is not None and len(self.t):
            ends = [0, -1] if len(self.t) > 1 else [0]
            own = of_reactions(
                self.t[ends], self._source.residual_at(ends), self.options, self._record.misfit_of_joints
            )
            if self.has_energy:
                explained = allowed(self._record.options, self._record.misfit)
                least = unnoticed(self.spec, self._record.options)
                own += of_energy(self.t, self.energy, explained, int(self.counters.get("steps", 0)), least)
            self._warn(own)
            known += own
        return known

    def _warn(self, findings: Sequence[Finding]) -> None:
        """One warning for a result that is doubtful and not known to be broken."""
        if self._record.success and word_of(findings) == DOUBTFUL and not self._warned:
            self._warned = True
            told = "; ".join(finding.sentence for finding in findings)
            warnings.warn(f"the result is doubtful: {told}", DoubtfulResultWarning, stacklevel=4)

    @cached_property
    def names(self) -> Names:
        """Names along the axes of the arrays: of coordinates, velocities, multipliers, joints and bodies."""
        rows = int(self.summary.get("rows", 0))
        return Names.from_summary(self.summary, self.q.shape[1], self.v.shape[1], rows)

    @property
    def units(self) -> dict[str, str | tuple[str, ...]]:
        """Unit of each array by its name in files; of those whose columns differ, such as `q`, one for each column. ""
        is a number whose unit depends on the row (`axes` of the stored file name it) or is known to the author of a
        `System` alone.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.1)
        >>> run.units["t"], run.units["v"], run.units["vdot"], run.units["force"], run.units["moment"]
        ('s', ('rad/s', 'rad/s', 'rad/s'), ('rad/s^2', 'rad/s^2', 'rad/s^2'), 'N', 'N m')
        """
        return units(self)

    @property
    def vdot(self) -> FloatArray:
        """(nt, nv): accelerations [m/s^2, rad/s^2]; NaN where a singular position leaves them open."""
        return self._record.arrays["vdot"]

    @property
    def multipliers(self) -> FloatArray:
        """(nt, rows): lambda in M v' = h + C^T lambda [N, N m]; prefer `joint(name)` for reactions."""
        return self._record.arrays["multipliers"]

    @property
    def closure(self) -> FloatArray:
        """(nt,): max |Phi| over the constraints."""
        return self._record.arrays["closure"]

    @property
    def velocity_closure(self) -> FloatArray:
        """(nt,): max |C v + a| over the constraints."""
        return self._record.arrays["velocity_closure"]

    @property
    def measure(self) -> FloatArray:
        """(nt, nv): projective measure rho of every coordinate: 1 = the loops do not hinder it, 0 = locked."""
        return self._record.arrays["measure"]

    @property
    def sigma(self) -> FloatArray:
        """(nt,): quality of the choice of independent coordinates; small near singular positions."""
        return self._record.arrays["sigma"]

    @property
    def sqrt_mu(self) -> FloatArray:
        """(nt,): a second quality of the choice, in the mass metric."""
        return self._record.arrays["sqrt_mu"]

    @property
    def independent(self) -> NDArray[np.int64]:
        """(nt, k): which columns of `v` were independent; `partitions` tells it in names."""
        return self._record.arrays["independent"]

    @property
    def spec(self) -> dict[str, Any] | None:
        """Plain description of the mechanism as built, or None for a `System`."""
        return self._record.spec

    @property
    def title(self) -> str:
        """Name of the mechanism, or "system"."""
        return str(self.summary.get("name") or "system")

    @cached_property
    def partitions(self) -> list[PartitionChange]:
        """Every choice of independent coordinates, the first one included, in order of time."""
        return partition_changes(self._record.partitions, self.names.velocities)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the compiler and the run had to tell: rows dropped, repairs, passages."""
        rows: dict[str, list[str]] = {}
        for item in self.summary.get("removed", ()):
            rows.setdefault(item["why"], []).append(item["row"])
        removed = (f"row{'s' * (len(of) > 1)} {listed(of)} removed: {why}" for why, of in rows.items())
        return tuple(dict.fromkeys([*map(str, self.summary.get("notes", ())), *removed, *self._record.all_notes]))

    @cached_property
    def certificate(self) -> Certificate:
        """Worst closure, energy balance, Newton-Euler residual, quality, switches and notes of this run."""
        found = certify(self)
        self._warn(found.findings)
        return found

    @property
    def has_energy(self) -> bool:
        """Whether energies are known (not for a hand-written `System`)."""
        return self._source is not None

    @property
    def energy(self) -> EnergyResult:
        """Kinetic, potential and total energy, work and balance.

        Empty arrays for a `System`: from its matrices the potential energy is not known. See `has_energy`.
        """
        if self._source is None:
            return EnergyResult(*(np.zeros(0) for _ in range(3)))
        found = self._source.energies
        return EnergyResult(found["kinetic"], found["potential"], self._record.arrays["work"])

    def state(self, t: float | None = None) -> State:
        """The state at time `t` [s] of the run, to start another one from (`initial=`); None: at its end.

        At an output it is that output. Between two it is marched to from the one before, with the method and the
        tolerances of the run, and closed to round-off: it lies on the motion within these tolerances. So runs can be
        restarted from any instant.

        Raises `ArgumentError` outside of the run, for a stored result between its outputs, and where the tangent
        velocities of the run were the user's own functions.

        >>> import partita as pt
        >>> m = pt.catalogue.load("four-bar")
        >>> run = m.simulate(1.0, t_eval=[0.0, 1.0])
        >>> again = m.simulate(0.7, initial=run.state(0.3), t_eval=[1.0])
        >>> bool(abs(again.q[-1] - run.q[-1]).max() < 1e-6)
        True
        """
        if not len(self.t):
            raise ArgumentError("the run has no outputs, so there is no state to be had", argument="t")
        time = float(self.t[-1]) if t is None else finite_time(t)
        if not self.t[0] <= time <= self.t[-1]:
            raise ArgumentError(
                f"t = {time:g} s is outside the outputs of the run, from {self.t[0]:g} to {self.t[-1]:g} s",
                argument="t",
            )
        i = int(np.searchsorted(self.t, time, side="right")) - 1
        q, v = self.q[i], self.v[i]
        if time != self.t[i]:
            q, v = self._between(i, time)
        if self._source is not None:
            return State(time, q.copy(), v.copy(), layout=Layout(self.summary))
        return State(time, q.copy(), v.copy(), list(self.names.coordinates), list(self.names.velocities))

    def _between(self, i: int, t: float) -> tuple[FloatArray, FloatArray]:
        """Coordinates and velocities at t, behind output i."""
        model = self._source.model if isinstance(self._source, ModelSource) else None
        chosen = {key: value for key, value in self.options.items() if key != "coordinates"}
        if model is None or chosen.get("formulation") == "user-tangent":
            raise ArgumentError(
                f"t = {t:g} s lies between outputs, and what is needed to march there is not at hand; give one of the "
                f"outputs, such as {self.t[i]:.12g} s, or simulate with t there in t_eval",
                argument="t",
            )
        chosen.update(t0=float(self.t[i]), t_end=t)
        raw = run_options.run(model, chosen, np.array([t]), self.q[i], self.v[i], False)
        if not raw["success"] or not len(raw["q"]):
            raise raw["error"] or ArgumentError(
                f"the motion cannot be marched to t = {t:g} s: {raw['message']}", argument="t"
            )
        return raw["q"][-1], raw["v"][-1]

    def joint(self, name: str) -> JointResult:
        """Motion and reaction of the joint `name`, tree or cut alike.

        Raises `UnknownNameError` with the nearest names. What is read of it is computed then, for this joint alone.
        """
        source = self._source_for("joint", name)
        j = index_of(name, self.names.joints, "joint")
        about = self.summary["joints"][j]
        data = AskedJoint(source, JointPlace(j, tuple(about["q"]), tuple(about["v"])))
        return JointResult(name, about["kind"], about["parent"], about["child"], data)

    def coupling(self, name: str) -> CouplingResult:
        """Effort of the coupling `name`: a gear, a distance, a rolling contact, ... `UnknownNameError` with the nearest
        names."""
        source = self._source_for("coupling", name)
        known = self.summary.get("couplings", [])
        about = known[index_of(name, [item["name"] for item in known], "coupling")]
        first = int(self.summary.get("closing_rows", 0))
        return CouplingResult(name, about["word"], source, [row - first for row in about["rows"]])

    def drive(self, name: str) -> DriveResult:
        """Effort of the drive `name`, of a joint's coordinate, a measure or a pose; `UnknownNameError` with the nearest
        names."""
        source = self._source_for("drive", name)
        rows = driven(self.summary)
        found = list(rows.values())[index_of(name, list(rows), "drive")]
        first = int(self.summary.get("closing_rows", 0))
        return DriveResult(name, source, [row - first for row in found])

    def body(self, name: str) -> BodyResult:
        """Motion of the body `name`; `"ground"` rests. `UnknownNameError` with the nearest names."""
        source = self._source_for("body", name)
        if isinstance(name, str) and name == "ground":
            return resting(name, len(self.t))
        seen = source.body(index_of(name, self.names.bodies, "body"))
        return BodyResult(name, *(seen[key] for key in BODIES))

    def sensor(self, name: str) -> SensorResult:
        """What the sensor `name` read: `values` over time, `unit` and long name; see `Mechanism.add_sensor`.

        Computed at the outputs when it is first asked for, and kept. `UnknownNameError` with the nearest names; an
        `EvaluationError` where the function of a sensor fails.
        """
        self._source_for("sensor", name)
        read = self._sensors
        return result_of(name, self.summary.get("sensors", ()), lambda one: read.read(one) if read else np.zeros(0))

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(item["name"] for item in self.summary.get("sensors", ()))

    @property
    def observed(self) -> Arrays:
        """All bodies and joints at once, by array name (`body_position` (nt, nb, 3), ...); for tools."""
        return self._source_for("body", "all").observed

    @property
    def reactions(self) -> Arrays:
        """All reactions at once, by array name (`force` (nt, nj, 3), `moment`, ...); for tools."""
        return self._source_for("joint", "all").reactions

    def reactions_by(self, route: str) -> Arrays:
        """All reactions by another way of computing them: `force` and `moment` (nt, nj, 3), as in `reactions`.

        `"recursion"`: the Newton-Euler sweep that `joint(name)` shows. `"augmented"`: augmented joint coordinates
        (Blajer 2004), each prohibited displacement of a joint moving all that lies outboard. The two share no
        formula, so their difference measures the round-off of both. Of joints that close a loop both give the
        multipliers' wrench: cut another joint (`cut="always"` there) to have it computed through the tree.

        Raises `ArgumentError` for another word, and where no model is at hand (a stored result).

        >>> import numpy as np
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> one, other = run.reactions_by("recursion"), run.reactions_by("augmented")
        >>> bool(np.abs(one["force"] - other["force"]).max() < 1e-9)
        True
        """
        source = self._source_for("joint", "all")
        if isinstance(route, str) and route == "recursion":
            return {key: source.reactions[key] for key in ("force", "moment")}
        if not isinstance(route, str) or route != "augmented":
            raise ArgumentError(
                f'there is no route {shown(route)}; choose "recursion" or "augmented"', argument="route"
            )
        found = source.augmented
        if found is None:
            raise ArgumentError(
                "augmented joint coordinates need the model, which a stored result does not have; simulate again",
                argument="route",
            )
        return found

    @property
    def determined(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Uniqueness of all reaction components: (nt, nj, 6) in world axes and in joint axes; for tools."""
        return self._source_for("joint", "all").determined

    @property
    def checks(self) -> Arrays:
        """What the certificate holds the outputs against besides, by array name; for tools."""
        return self._source_for("joint", "all").checks

    @property
    def joint_accelerations(self) -> FloatArray:
        """Accelerations of all joints (nt, freedoms), as `joint_velocity` of `observed`; for tools."""
        return self._source_for("joint", "all").joint_accelerations

    @property
    def determined_efforts(self) -> NDArray[np.bool_]:
        """Uniqueness of `effort` in `reactions`: (nt, conditions); for tools."""
        return self._source_for("joint", "all").determined_efforts

    @property
    def determined_drive(self) -> NDArray[np.bool_]:
        """Uniqueness of the efforts of all drives: (nt, freedoms of all joints); for tools."""
        return self._source_for("joint", "all").determined_drive

    def self_stresses(self, output: int = -1) -> SelfStresses:
        """Orthonormal base of what can be added to the reactions at one output without any change of the motion.

        Raises `ArgumentError` for an output that is not there, and for a stored result, which has no model.

        >>> import partita as pt
        >>> run = pt.catalogue.load("bricard").simulate(0.1)
        >>> run.self_stresses()
        <1 self-stress of 6 joints>
        """
        source = self._source_for("joint", "all")
        nt = len(self.t)
        if isinstance(output, bool) or not isinstance(output, int | np.integer) or not -nt <= output < nt:
            raise ArgumentError(
                f"self_stresses: there is no output {shown(output)}; the {nt} outputs are numbered from 0, and from "
                "the end by -1, -2, ...",
                argument="output",
            )
        found = source.self_stress_basis(int(output) % nt)
        if found is None:
            raise ArgumentError(
                "self-stresses need the model, which a stored result does not have; simulate again", argument="output"
            )
        return self_stresses_of(self.summary, *found)

    def _source_for(self, kind: str, name: str) -> Source:
        if self._source is None:
            raise ArgumentError(
                f"no {kind} {name!r}: this is the run of a System given by matrices, which has coordinates "
                f"and multipliers only; use result.q, result.v and result.multipliers",
                argument=kind,
            )
        return self._source

    @property
    def arrays(self) -> Arrays:
        """All arrays over time that have a number or a row for each output, energies included; for writers of files."""
        if self._source is None:
            return {key: a for key, a in self._record.arrays.items() if key != "work"}
        return {**self._record.arrays, **self._source.energies}

    @property
    def record(self) -> Record:
        """Plain data of this result; for writers of files."""
        return self._record

    @property
    def is_mechanism(self) -> bool:
        """Whether this is the run of a mechanism (with bodies and joints), not of a `System`."""
        return self._source is not None

    def to_xarray(self) -> xarray.Dataset:
        """All arrays as an `xarray.Dataset`: dimensions `time`, `joint`, `body`, `axis`, `coordinate`, ... with the
        names as coordinates, `units` and `long_name` of every array, and as texts `model` (JSON) and `account`;
        attributes tell settings and certificate. `save("x.nc")` stores this dataset. `MissingDependencyError` without
        xarray.

        >>> import partita as pt
        >>> found = pt.catalogue.load("four-bar").simulate(0.5).to_xarray()
        >>> found.force.sel(joint="A", axis="x").dims
        ('time',)
        """
        from .dataset import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pandas.DataFrame:
        """One row per output, one column per number, indexed by time; `df.attrs["units"]` has the units.

        Columns are those of `save("x.csv")`: what people look at first, then rotation matrices, flags and the rest.
        `MissingDependencyError` without pandas.
        """
        from .table import to_pandas

        return to_pandas(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write to `path`, in the format of its ending, and return the path; `partita.load_result` reads all of them.

        `.nc`: NetCDF 4, the dataset of `to_xarray`, for xarray, MATLAB and the tools of the geosciences (extra
        `netcdf`). `.zarr`: the same as a folder of chunks (extra `zarr`). `.json`: one readable text. `.mat`: for
        MATLAB and Octave. `.csv`, `.parquet` (extra `parquet`): a table, one row per output, for spreadsheets.

        Every format holds everything: arrays, names, units, model, settings, certificate, version, and a checksum by
        which a later change or damage is noticed. What is there already is replaced only when the new one is complete.

        Raises `FileFormatError` for another ending and where the file cannot be written, `MissingFileError` when the
        folder does not exist, `MissingDependencyError` naming the extra where a package is not installed. Costs the
        reactions and the certificate at all outputs, if they were not asked for before.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = run.save(os.path.join(folder, "run.json"))
        ...     pt.load_result(path).title == run.title
        True
        """
        from .save import save

        return save(self, path)

    def plot(
        self,
        *what: str,
        path: str | os.PathLike[str] | None = None,
        x: str | None = None,
        ax: Axes | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Figure:
        """A matplotlib figure of `what`; several words stand below each other. `path` saves it too.

        "overview" (the default), "coordinates", "velocities", "accelerations", "reactions", "bearings" (polar: how
        much, in which direction), "paths" (of `points`, {name: (body, place in body axes)}, or of the joints),
        "energy", "measure", "closure", or the name of a joint or of a sensor. `x` names a coordinate, joint or sensor
        to stand along the bottom in the place of time: over what angle is it loaded? Angles are in degrees, of one
        turn where there are more. `ax` takes one word of one panel into axes of yours.

        Nothing is shown on the screen; in a notebook the figure displays itself. Raises `UnknownNameError` with the
        nearest names, `ArgumentError` where a word cannot stand over `x` or in `ax`.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> figure = run.plot("reactions", x="A")
        >>> figure.axes[-1].get_xlabel()
        'A [deg]'
        """
        from ..plots import plot

        return plot(self, *what, path=path, x=x, ax=ax, points=points)

    def applied_forces(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Where each load of `add_force` acts and its force, in the world: {name: (places (nt, 3) [m], (nt, 3) [N])}.

        To see loads beside reactions; for one load that is to be stored too, prefer a sensor of it. Empty for a run
        read from a file, which keeps what its sensors read. Costs an evaluation of each load at all outputs.

        >>> import partita as pt
        >>> m = pt.Mechanism("pushed")
        >>> arm = m.add_rod("arm", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        >>> A = m.add_revolute("A", m.ground, arm, point=(0, 0, 0), axis=(0, 0, 1))
        >>> push = m.add_force(arm, (0.0, 5.0, 0.0), point=(1, 0, 0), name="push")
        >>> places, forces = m.simulate(0.1).applied_forces()["push"]
        >>> forces[-1].tolist()
        [0.0, 5.0, 0.0]
        """
        return self._sensors.applied() if self._sensors else {}

    def to_html(
        self,
        path: str | os.PathLike[str],
        title: str | None = None,
        *,
        shapes: Mapping[str, Any] | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Path:
        """One self-contained page with the animated mechanism; opens from disk without a network.

        `shapes` draws bodies as boxes, cylinders, wheels, balls, plates, rods; `points` marks points and traces their
        paths. Both are told at `partita.viewer.html`. The page is on paper light or dark as its reader prefers.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.5)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = run.to_html(
        ...         os.path.join(folder, "page.html"),
        ...         shapes={"crank": {"kind": "wheel", "radius": 0.3, "length": 0.1}},
        ...         points={"P": ("coupler", (0.5, 0.2, 0.0))},
        ...     )
        ...     page.name
        'page.html'
        """
        from ..viewer import write_html

        write_html(self, path, title=title, shapes=shapes, points=points)
        return Path(path)

    def save_animation(
        self,
        path: str | os.PathLike[str],
        *,
        fps: float = 20.0,
        speed: float | None = None,
        size: tuple[int, int] = (800, 600),
        forces: bool = True,
        shapes: Mapping[str, Any] | None = None,
        points: Mapping[str, Any] | None = None,
    ) -> Path:
        """A film of the motion for slides and papers: a .gif, or an .mp4 where the program ffmpeg is installed.

        The mechanism stands as on the page of `to_html`, which is the better choice where it can be turned and asked.
        Of each picture the computed output nearest in time is shown, with the forces of the joints.

        Args:
            fps: pictures a second.
            speed: how many times faster than time; None: real time where that takes 2 to 20 s, else ten seconds.
            size: width and height in pixels.
            forces: arrows of reactions and loads?
            shapes, points: as in `to_html`.

        Needs the extra "plots". Raises `ArgumentError` for more than 900 pictures and for another ending,
        `MissingDependencyError` without ffmpeg, `MissingFileError` where the folder does not exist.

        >>> import os, tempfile
        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.2)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     run.save_animation(os.path.join(folder, "bar.gif"), fps=10, speed=0.2, size=(320, 240)).name
        'bar.gif'
        """
        from ..viewer.film import save_film

        return save_film(self, path, fps=fps, speed=speed, size=size, forces=forces, shapes=shapes, points=points)

    def __repr__(self) -> str:
        ended = self.status if self.success else f"{self.status.upper()}: {self.message}"
        return (
            f"<Result of {self.title!r}: {ended}; {len(self.t)} outputs, {self._span}; "
            f"closure {self._closed}, {self._switches} switches, "
            f"{self.counters.get('steps', 0)} steps>"
        )

    def _repr_html_(self) -> str:
        """A small table, in a notebook."""
        rows = [
            ("ended", self.status if self.success else f"{self.status}: {self.message}"),
            ("outputs", f"{len(self.t)}, {self._span}"),
            ("largest closing error", self._closed),
            ("steps", f"{self.counters.get('steps', 0)}, {self._switches} switches of coordinates"),
            ("coordinates", names(self.names.coordinates)),
        ]
        if self.is_mechanism:
            rows += [("joints", names(self.names.joints)), ("bodies", names(self.names.bodies))]
        if "certificate" in self.__dict__:
            rows.append(("certificate", self.certificate.verdict))
        return table(self.title, rows)

    @property
    def _span(self) -> str:
        return f"t = {self.t[0]:g} .. {self.t[-1]:g} s" if len(self.t) else "no outputs"

    @property
    def _closed(self) -> str:
        try:
            return f"{np.max(self.closure, initial=0.0):.1e}"
        except Exception:  # of a user's function, which also ended the run
            return "not known"

    @property
    def _switches(self) -> int:
        return sum(change.is_switch for change in self.partitions)
