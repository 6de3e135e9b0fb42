"""Linearised equations of motion: `linearize`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.linear import Linearization
from ..analyses.still import run_of
from ..builder.compiled import CompiledModel
from ..builder.drives import driven_key
from ..errors import ArgumentError
from ..naming import driven, index_of
from ..numeric import is_list, shown
from ..results import Result
from ..results.run import Run
from ..state import State
from .models import Modelled, layout_of
from .set_valued import without_holding
from .solve import start_of

Array = NDArray[np.float64]


class ModelShapes:
    """Motions of joints and bodies that belong to displacements of a state."""

    def __init__(self, model: CompiledModel, state: State) -> None:
        self._model, self._state = model, state

    @property
    def names(self) -> Sequence[str]:
        """Names of the displacements."""
        return self._model.velocity_names

    def joints(self, displacements: Array) -> dict[str, Array]:
        """Changes of the coordinates of each joint."""
        found = self._model.summary["joints"]
        rates = self._motion(displacements).joints()["joint_velocity"]
        spans = [tuple(joint["v"]) for joint in found]
        return {joint["name"]: rates[:, first : first + n] for joint, (first, n) in zip(found, spans, strict=True)}

    def kinetic(self, displacements: Array) -> dict[str, Array]:
        """Kinetic energy of each body."""
        bodies = self._motion(displacements).bodies()
        energies = {}
        for i, body in enumerate(self._bodies):
            rotation, spin = bodies["body_rotation"][:, i], bodies["body_angular_velocity"][:, i]
            inside = np.einsum("tji,tj->ti", rotation, spin)
            com = np.einsum("tij,j->ti", rotation, np.array(body["com"]))
            velocity = bodies["body_velocity"][:, i] + np.cross(spin, com)
            turning = np.einsum("ti,ij,tj->t", inside, np.array(body["inertia"]), inside)
            energies[body["name"]] = 0.5 * (body["mass"] * np.sum(velocity**2, axis=1) + turning)
        return energies

    def elastic(self, displacements: Array) -> dict[str, tuple[Array, str | None]]:
        """Strain energy of each spring by its change of length or angle, and the joint that it is in."""
        bodies = self._motion(displacements).bodies()
        numbers = {body["name"]: i for i, body in enumerate(self._bodies)}
        joints = self.joints(displacements)
        still = np.zeros((len(displacements), 3))
        energies: dict[str, tuple[Array, str | None]] = {}

        def end(body: str, point: list[float]) -> tuple[Array, Array]:
            """Position and velocity of a point."""
            if body not in numbers:
                return still + np.array(point), still
            i = numbers[body]
            arm = bodies["body_rotation"][:, i] @ np.array(point)
            moving = bodies["body_velocity"][:, i] + np.cross(bodies["body_angular_velocity"][:, i], arm)
            return bodies["body_position"][:, i] + arm, moving

        for force in json.loads(self._model.core.description)["forces"]:
            if force["kind"] == "spring":
                ends = [end(force[f"body{k}"], force[f"point{k}"]) for k in (1, 2)]
                line, rate = ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]
                lengths = np.linalg.norm(line, axis=1)
                change = np.einsum("ij,ij->i", line, rate) / np.where(lengths > 0.0, lengths, 1.0)
                joint = None
            elif force["kind"] == "torsion_spring":
                joint = str(force["joint"])
                change = joints[joint][:, int(force.get("coordinate", 0))]
            else:
                continue
            energies[str(force["name"])] = (0.5 * float(force["stiffness"]) * change**2, joint)
        return energies

    def animated(self, displacement: NDArray[np.complex128], amplitude: float, period: float) -> Result:
        """One period of the motion along a displacement, closed at every output."""
        size = amplitude / (np.abs(displacement / self._sizes).max(initial=0.0) or 1.0)
        t = np.linspace(0.0, period, 61)
        turning = np.exp(2j * np.pi * t / period)[:, None]
        moved = np.ascontiguousarray((size * displacement * turning).real)
        rates = np.ascontiguousarray((size * displacement * turning * 2j * np.pi / period).real)
        q = self._model.core.displaced(self._state.t, self._state.q, moved)
        # no law holds the amplitude, so no force belongs to the motion
        rows = np.full((len(t), self._model.core.rows), np.nan)
        return run_of(Result, self._model, t, q, rates, np.full_like(rates, np.nan), rows)

    @cached_property
    def _sizes(self) -> Array:
        """One radian, or a length."""
        return self._model.core.characteristic_displacements()

    @cached_property
    def _bodies(self) -> list[dict[str, Any]]:
        return list(json.loads(self._model.core.description)["bodies"])

    def _motion(self, displacements: Array) -> Any:
        count = len(displacements)
        q = np.tile(self._state.q, (count, 1))
        return self._model.core.motion(np.full(count, self._state.t), q, np.asarray(displacements, dtype=float))


def linearize(
    self: Modelled,
    at: Any = None,
    *,
    inputs: Iterable[Any] | Mapping[Any, str] | None = None,
    outputs: Iterable[Any] | None = None,
    independent: Iterable[str] | None = None,
    coordinates: str = "relative",
    parameters: Mapping[str, ArrayLike] | None = None,
) -> Linearization:
    """Linearise the equations of motion about a state: A, B, C, D with all loops closed.

    The derivatives are those of the equations themselves (exact to rounding), not of a simulation. Two states belong to
    each degree of freedom: a position and its rate.

    Args:
        at: state, as `assemble` returns it, or an `Equilibrium`; None: the drawing, assembled, at rest.
        inputs: actuators as in `inverse_dynamics`: joints or their coordinates (those that close loops too), lines of
            springs, torques, components of forces; the input is an effort [N or N m] beside all that acts. Or a dict of
            names with "effort" or "acceleration": the acceleration of a drive, named by itself or by what it drives.
            Its position and rate are states then (a drive of rates: its rate). None: none.
        outputs: names of sensors, or of joints for their coordinates; None: all sensors. Their derivatives are central
            differences along exact motions (errors of about 1e-10).
        independent: names of the independent velocities; None: the choice that a run would begin with.
        coordinates, parameters: as in `simulate`.

    Raises:
        ArgumentError: the velocities of the state violate constraints, a name is no input, a choice does not serve, an
            effort acts where a drive prescribes the motion, nothing drives what an acceleration is asked of; the
            equations have no derivative there, because friction sticks, or a stop, a rope, a contact or a table is
            exactly at a corner.
        SingularityError: the position is singular. UnknownNameError: there is no output of a name.

    Cost: an evaluation with derivatives for every eight columns.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> m.linearize(inputs=["A"])
    <Linearization: 2 states, 1 inputs, 0 outputs; not steady>
    >>> m.linearize(inputs=["A"]).A.shape
    (2, 2)
    >>> crank = m.add_drive("A", velocity=3.0, name="motor")
    >>> driven = m.linearize(inputs={"motor": "acceleration"}, outputs=["D"])
    >>> driven.states, driven.inputs
    (('A', "motor'"), ("motor''",))
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    without_holding(self, "linearize", state=True)
    model, _ = layout_of(self, wanted, parameters)
    if at is not None and not isinstance(at, State):
        at = getattr(at, "state", at)
    start = start_of(self, at, model, wanted, parameters)
    names = model.velocity_names
    asked = _inputs(inputs, model, start)
    chosen = None
    if independent is not None:
        chosen = [names.index(name) for name in run_options.velocities("independent", independent, names)]
    read = _outputs(outputs, model)
    found = model.core.linearized(start.t, start.q, start.v, asked.columns, chosen, asked.rows, bool(read))
    y, changes, labels = _readings(model, start, found, read)
    states = [names[i] for i in found["positions"].tolist()]
    rates = [names[i] + "'" for i in found["velocities"].tolist()]
    if asked.rows:
        drives = dict(zip(asked.rows, asked.drives, strict=True))
        states += [drives[i] for i in found["driven_positions"].tolist()]
        rates += [drives[i] + "'" for i in found["driven_rates"].tolist()]
    states += rates
    nx = len(states)

    def again(changed: dict[str, Any]) -> Linearization:
        both = {**(parameters or {}), **changed}
        return linearize(
            self, start, inputs=inputs, outputs=(), independent=independent, coordinates=coordinates, parameters=both
        )

    return Linearization(
        A=found["A"],
        B=found["B"],
        C=changes[:, :nx],
        D=changes[:, nx:],
        f0=found["f0"],
        y0=y,
        states=tuple(states),
        inputs=asked.names,
        outputs=tuple(labels),
        state=start,
        mass=found["mass"],
        stiffness=found["stiffness"],
        damping=found["damping"],
        steady=found["steady"],
        conservative=found["conservative"],
        method="exact" if found["exact"] else "differences",
        _accelerates=found["accelerates"],
        _found=found["modes"],
        _shapes=ModelShapes(model, start),
        _again=again,
    )


def _listed(what: str, given: Any) -> list[Any]:
    if not is_list(given):
        raise ArgumentError(f"{what} must be a list of names such as ['A'], not {shown(given)}", argument=what)
    return list(given)


class _Inputs(NamedTuple):
    """Names of the inputs; the column of E of each effort, as rows; rows and names of the drives behind them."""

    names: tuple[str, ...]
    columns: Array
    rows: list[int]
    drives: list[str]


def _inputs(inputs: Any, model: CompiledModel, at: State) -> _Inputs:
    if inputs is None:
        return _Inputs((), np.zeros((0, model.core.nv)), [], [])
    if isinstance(inputs, Mapping):
        kinds = [(key, run_options.one_of("inputs", kind, ("effort", "acceleration"))) for key, kind in inputs.items()]
    else:
        kinds = [(key, "effort") for key in _listed("inputs", inputs)]
    rows_of = driven(model.summary)
    efforts, rows, drives = [], [], []
    for key, kind in kinds:
        found = model._actuator(key)
        drive = model._drawn.driven.get(driven_key(found.along[0])) if found.axis is None else None
        if kind == "effort":
            if drive is not None:
                raise ArgumentError(
                    f"inputs: {found.name!r} is driven by {drive!r}, so an effort there moves nothing; take the "
                    f"acceleration of the drive, inputs={{{found.name!r}: 'acceleration'}}, or remove the drive",
                    argument="inputs",
                )
            efforts.append(key)
        elif drive is None:
            raise ArgumentError(
                f"inputs: nothing drives {found.name!r}, so it has no acceleration that is an input; add "
                f"m.add_drive({found.name!r}, ...), or take its effort",
                argument="inputs",
            )
        elif len(rows_of[drive]) > 1:
            raise ArgumentError(
                f"inputs: {drive!r} prescribes a pose, whose acceleration is not one number; drive single coordinates",
                argument="inputs",
            )
        else:
            rows += rows_of[drive]
            drives.append(drive)
    if not efforts:
        names, columns = [], np.zeros((0, model.core.nv))
    else:
        core, chosen = model._with_actuators(efforts)
        names, columns = [each.name for each in chosen], core.columns(at.t, at.q)
    return _Inputs((*names, *(f"{drive}''" for drive in drives)), columns, rows, drives)


def _outputs(outputs: Any, model: CompiledModel) -> list[tuple[str, str]]:
    """Kind and name of each output."""
    if outputs is None:
        return [("sensor", name) for name in model.sensors]
    joints = [joint["name"] for joint in model.summary["joints"]]
    found = []
    for name in map(str, _listed("outputs", outputs)):
        if name in model.sensors:
            found.append(("sensor", name))
        else:
            known = [*model.sensors, *joints]
            found.append(("joint", known[index_of(name, known, "output")]))
    return found


def _readings(
    model: CompiledModel, state: State, found: Mapping[str, Any], wanted: Sequence[tuple[str, str]]
) -> tuple[Array, Array, list[str]]:
    """Values of outputs, their changes with states and inputs, and names of their components."""
    if not wanted:
        return np.zeros(0), np.zeros((0, found["A"].shape[1] + found["B"].shape[1])), []
    steps: Array = found["steps"]
    beside = {
        "q": (state.q, found["probe_q"]),
        "v": (state.v, found["probe_v"]),
        "vdot": (found["vdot"], found["probe_vdot"]),
        "multipliers": (found["multipliers"], found["probe_multipliers"]),
    }
    rows = [np.vstack([here[None, :], there]) for here, there in beside.values()]
    run = run_of(Run, model, np.full(len(rows[0]), state.t), *rows)
    values, changes, labels = [], [], []
    for kind, name in wanted:
        read = np.asarray(run.sensor(name).values if kind == "sensor" else run.joint(name).position)
        columns = read.reshape(len(read), -1)
        values.append(columns[0])
        changes.append((columns[1::2] - columns[2::2]).T / (2.0 * steps))
        one = columns.shape[1] == 1
        labels += [name if one else f"{name}[{i}]" for i in range(columns.shape[1])]
    return np.concatenate(values), np.vstack(changes), labels
