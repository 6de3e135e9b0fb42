"""A run: its data, and everything that can be computed from them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, Interrupted, SuspectResultWarning
from ..naming import driven, joint_units, listed
from ..numeric import MaybeNone, shown
from ..partition import Geometry, geometry
from ..sensing import SensorRecord
from .certificate import Certificate, certify
from .coupling import CouplingResult, DriveResult
from .energy import EnergyResult
from .events import written
from .force import ForceResult
from .joint import JointResult
from .motion import Motion
from .names import index_of, name_of
from .partition_log import PartitionChange, partition_changes
from .record import Record
from .self_stress import SelfStresses, self_stresses_of
from .sensor import LiveSensors, StoredSensors, account_of
from .source import Arrays, ModelSource, Source
from .variables import units
from .verdict import SUSPECT, Finding, verdict_of

FloatArray = NDArray[np.float64]
R = TypeVar("R", bound="Run")

INTERRUPTED = "interrupted"
AT_A_PROMPT = "sys.last_value.result"


class Run(Motion):
    """The contents of a `Result`: its arrays, and bodies, joints, reactions and sensors by name."""

    def __init__(
        self, record: Record, source: Source | None, sensors: LiveSensors | StoredSensors | None = None
    ) -> None:
        self._record = record
        self._source = source
        self._sensors = sensors
        self._warned = False
        self._looks: Mapping[str, Any] | None = None
        self._held: tuple[str, ...] = ()
        """The joints with which the start was assembled."""
        self._formulas: Mapping[str, Any] = {}
        """What the events follow, by name, as the core does."""
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

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The model's own description: bodies, joints, sizes, removed rows."""
        return dict(self._record.summary)

    @cached_property
    def counters(self) -> dict[str, int]:
        """Counts of work: steps, evaluations, switches and other costs."""
        return dict(self._record.counters)

    @cached_property
    def options(self) -> dict[str, Any]:
        """The options of the run, defaults included."""
        return dict(self._record.options)

    def __copy__(self: R) -> R:
        copied = type(self)(self._record, self._source, self._sensors)
        copied._looks, copied._held, copied._formulas = self._looks, self._held, self._formulas
        return copied

    @classmethod
    def from_run(
        cls: type[R],
        raw: dict[str, Any],
        *,
        model: Any,
        summary: Mapping[str, Any],
        spec: str | None = None,
        options: Mapping[str, Any] | None = None,
        sensors: Mapping[str, SensorRecord] | None = None,
        events: Sequence[str] = (),
        looks: Mapping[str, Any] | None = None,
    ) -> R:
        """From what the core returned: `raw` of `simulate`, the compiled `model` it came from, its `summary`.

        `sensors` are those of the description, `events` the names of those that were looked for, `looks` how
        bodies look by the file that they were read from. `spec` is the
        description compiled, as JSON; None for a hand-written `System`, which has no bodies and joints. Raises
        `Interrupted`, with the result, for a run that Ctrl-C ended.
        """
        account = account_of(sensors, summary) if sensors else []
        if account:
            summary = {**summary, "sensors": account}
        motion = raw.pop("motion", None)
        raw["events"] = written(events, raw.pop("occurrences", ()), raw.pop("happenings", None), summary)
        record = Record.from_raw(raw, summary, options or {}, spec)
        source, read = None, None
        if spec is not None:
            source = ModelSource(model, motion, summary)
            read = LiveSensors(sensors or {}, source, account)
        result = cls(record, source, read)
        result._looks = looks
        if record.findings:
            result._warn(record.findings)
        if record.status == INTERRUPTED and record.error is None:
            raise Interrupted(f"{record.message}, in `result` of this error (here and now: {AT_A_PROMPT})", result)
        return result

    @property
    def success(self) -> bool:
        """Whether the run reached its end and nothing that was looked at makes it invalid.

        When the run ends, these are the constraints at every step and output, jumps of velocities, the energy balance
        over sixteen outputs, and the reactions of the first and the last one. A certificate, once computed, adds the
        energies, reactions and accelerations of all outputs: if its verdict is "invalid", `success` is False from then
        on.
        """
        return self._record.success

    @property
    def status(self) -> str:
        """How the run ended, in a word: "finished", "event" (at one that ends it, which is a success), "invalid" (it
        reached its end, but its result is wrong), ..."""
        return self._record.status

    @property
    def message(self) -> str:
        """How the run ended, in a sentence."""
        return self._record.message

    def _warn(self, findings: Sequence[Finding]) -> None:
        """Warn once of a suspect result, unless it is known to be invalid."""
        if self._record.success and verdict_of(findings) == SUSPECT and not self._warned:
            self._warned = True
            reported = "; ".join(finding.sentence for finding in findings)
            warnings.warn(f"the result is suspect: {reported}", SuspectResultWarning, stacklevel=4)

    @property
    def units(self) -> dict[str, str | tuple[str, ...]]:
        """Unit of each array by its name in files; of those whose columns differ, such as `q`, one for each column. ""
        means that the unit depends on the row (named in `axes` of the stored file) or is known only to the author of a
        `System`.

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.1)
        >>> run.units["t"], run.units["v"], run.units["vdot"], run.units["force"], run.units["moment"]
        ('s', ('rad/s', 'rad/s', 'rad/s'), ('rad/s^2', 'rad/s^2', 'rad/s^2'), 'N', 'N m')
        """
        return units(self)

    @property
    def vdot(self) -> FloatArray:
        """(nt, nv): accelerations [m/s^2, rad/s^2]; NaN at singular positions, where they are undetermined."""
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
        """(nt, nv): projective measure rho of every coordinate: 1 = not restricted by the loops, 0 = locked."""
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
        """(nt, k): which columns of `v` were independent; `partitions` lists their names."""
        return self._record.arrays["independent"]

    @property
    def selector(self) -> FloatArray | MaybeNone:
        """(nt, k, nv): S of the tangent velocities u = S v that were integrated, in use at each output: that of
        "zero-eigenvalue", "svd", "qr", "liang-lance", "gram-schmidt" and "tangent-space". With `renew="each step"` that
        which the rule makes at the output itself, for "liang-lance" from the one in use.

        None where no S was made: where coordinates are chosen the rows of S are those of the identity with the indices
        `independent`; the multiplier forms integrate all of v; "user-tangent" is given by D, to which many S belong;
        with no degree of freedom nothing is integrated.

        >>> import numpy as np
        >>> import partita as pt
        >>> m = pt.catalogue.load("delta")
        >>> svd, qr = (m.simulate(0.1, solver=pt.Solver(name)).selector[0] for name in ("svd", "qr"))
        >>> svd.shape == qr.shape, bool(np.allclose(svd, qr))           # different bases
        (True, False)
        >>> bool(np.allclose(svd.T @ svd, qr.T @ qr))                   # of one space
        True
        """
        found = self._record.arrays["selector"]
        return found if found.size else None

    @property
    def spec(self) -> dict[str, Any] | None:
        """Plain description of the mechanism as built, or None for a `System`."""
        return self._record.spec

    @cached_property
    def partitions(self) -> list[PartitionChange]:
        """Choices of independent coordinates, the first one included, in order of time: every one up to a thousand, and
        those in use at the outputs however many there are; `counters["switches"]` counts all, and
        `counters["unlisted_switches"]` those left out."""
        return partition_changes(self._record.partitions, self.names.velocities)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the compilation and the run: removed rows, repairs, crossings."""
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
        self._record = self._record.judged(found.findings)
        return found

    @property
    def has_energy(self) -> bool:
        """Whether energies are known (not for a user-defined `System`)."""
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

    def joint(self, name: Any) -> JointResult:
        """Motion and reaction of a joint by name or handle, in the tree or cut.

        Raises `UnknownNameError` with the nearest names. Its quantities are computed on access, for this joint
        alone.
        """
        name = name_of(name)
        about, data = self._joint(name)
        return JointResult(name, about["kind"], about["parent"], about["child"], data, units=joint_units(about)[0])

    def coupling(self, name: Any) -> CouplingResult:
        """Effort of a coupling by name or handle: a gear, a distance, a rolling contact, ... `UnknownNameError` with
        the nearest names."""
        name = name_of(name)
        source = self._source_for("coupling", name)
        known = self.summary.get("couplings", [])
        about = known[index_of(name, [item["name"] for item in known], "coupling")]
        first = int(self.summary.get("closing_rows", 0))
        return CouplingResult(name, about["word"], source, [row - first for row in about["rows"]])

    def force(self, name: Any) -> ForceResult:
        """What an applied force does, by name or handle: force, effort, length, power, energy, as its kind has them.
        `UnknownNameError` with the nearest names; `ArgumentError` for a stored or pickled result, which keeps only its
        sensors.

        >>> import partita as pt
        >>> m = pt.Mechanism("swing", gravity="-y")
        >>> rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        >>> hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
        >>> spring = m.add_spring("S", m.ground, (1, 1, 0), rod, rod.at((1, 0, 0)), stiffness=100.0, length=0.9)
        >>> found = m.simulate(0.1).force("S")
        >>> round(float(found.force[0]), 9), round(float(found.length[0]), 9)       # positive in tension
        (10.0, 1.0)
        """
        name = name_of(name)
        self._source_for("force", name)
        if self._sensors is None:
            raise ArgumentError("a run of a System given by matrices has no named forces", argument="name")
        return self._sensors.force(name)

    def drive(self, name: Any) -> DriveResult:
        """Effort of a drive by name or handle: of a joint's coordinate, a measure or a pose; `UnknownNameError` with
        the nearest names."""
        name = name_of(name)
        source = self._source_for("drive", name)
        rows = driven(self.summary)
        found = list(rows.values())[index_of(name, list(rows), "drive")]
        first = int(self.summary.get("closing_rows", 0))
        return DriveResult(name, source, [row - first for row in found])

    def reactions_by(self, route: str) -> Arrays:
        """All reactions by an independent method: `force` and `moment` (nt, nj, 3), as in `at_once.reactions`.

        `"recursion"`: the Newton-Euler sweep that `joint(name)` shows. `"augmented"`: augmented joint coordinates
        (Blajer 2004), in which each locked displacement of a joint moves everything outboard. The two share no formula,
        so their difference measures the round-off of both. For joints that close a loop both give the wrench of the
        multipliers: cut another joint (`cut="always"`) to have it computed through the tree.

        Raises `ArgumentError` for any other word, and for a stored result, which has no model.

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

    def self_stresses(self, output: int = -1) -> SelfStresses:
        """Orthonormal basis of the self-stresses at one output: of all that can be added to the reactions without
        changing the motion.

        Raises `ArgumentError` for an output that does not exist, and for a stored result, which has no model.

        >>> import partita as pt
        >>> run = pt.catalogue.load("bricard").simulate(0.1)
        >>> run.self_stresses()
        <1 self-stress of 6 joints>
        """
        source = self._source_for("joint", "all")
        found = source.self_stress_basis(self._output("self_stresses", output))
        if found is None:
            raise ArgumentError(
                "self-stresses need the model, which a stored result does not have; simulate again", argument="output"
            )
        return self_stresses_of(self.summary, *found)

    def geometry(self, output: int = -1) -> Geometry:
        """Metric geometry of what is integrated at one output: basis, volume, cosines and conditioning of the
        independent velocities, or of the tangent velocities u = S v with `selector[output]`; see `partition.Geometry`.
        For the multiplier forms and "user-tangent", which have no S, that of the choice which `partition.choose` makes
        there.

        Raises `ArgumentError` for an output that does not exist, for a stored result or the run of a `System`, which
        have no model, and for massless bodies, whose M is no metric. Costs O(n^3).

        >>> import partita as pt
        >>> run = pt.catalogue.load("four-bar").simulate(0.1)
        >>> bool(abs(run.geometry(0).volume - run.sigma[0]) < 1e-12)      # k = 1
        True
        """
        source, i = self._source_for("joint", "all"), self._output("geometry", output)
        if not isinstance(source, ModelSource):
            raise ArgumentError(
                "geometry needs the model, which a stored result does not have; simulate again", argument="output"
            )
        t, q, chosen = float(self.t[i]), self.q[i], self.independent[i]
        known = chosen.tolist() if len(chosen) and chosen.min() >= 0 else None
        at, selector = source.model.at(t, q, self.v[i]), self.selector
        M, C = at["M"], at["C"][at["rows"]]
        return geometry(M, C, known) if selector is None else geometry(M, C, selector=selector[i])

    def _output(self, asked: str, output: Any) -> int:
        """An output, numbered from 0 or from the end, by its number from 0."""
        nt = len(self.t)
        if isinstance(output, bool) or not isinstance(output, int | np.integer) or not -nt <= output < nt:
            raise ArgumentError(
                f"{asked}: there is no output {shown(output)}; the {nt} outputs are numbered from 0, and from "
                "the end by -1, -2, ...",
                argument="output",
            )
        return int(output) % nt

    @property
    def arrays(self) -> Arrays:
        """All arrays over time that have a number or a row for each output, energies included; for writers of files."""
        absent = {"work"} if self._source is None else set()
        if self.selector is None:
            absent.add("selector")
        found = {key: a for key, a in self._record.arrays.items() if key not in absent}
        return found if self._source is None else {**found, **self._source.energies}

    @property
    def record(self) -> Record:
        """Plain data of this result; for writers of files."""
        return self._record

    @property
    def is_mechanism(self) -> bool:
        """Whether this is the run of a mechanism (with bodies and joints), not of a `System`."""
        return self._source is not None

    def applied_forces(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Point of application and force of each load of `add_force`, world axes: {name: ((nt, 3) [m], (nt, 3) [N])}.

        For comparing loads with reactions; to store a load with the result, use a sensor. Empty for a run read from a
        file, which keeps only its sensors. Costs one evaluation of each load at all outputs.

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
