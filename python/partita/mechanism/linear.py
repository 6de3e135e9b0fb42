"""Linearised equations of motion: `linearize`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import options as run_options
from ..analyses.linear import Linearization
from ..analyses.still import run_of
from ..builder import rest
from ..builder.compiled import CompiledModel
from ..errors import ArgumentError
from ..naming import index_of
from ..numeric import shown
from ..results import Result
from ..results.run import Run
from ..state import State
from .models import Modelled, layout_of
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
        found, every = self._model.summary["joints"], range(len(self._model.summary["joints"]))
        rates = self._model.core.joints(*self._motion(displacements), list(every))["joint_velocity"]
        spans = [tuple(joint["v"]) for joint in found]
        return {joint["name"]: rates[:, first : first + n] for joint, (first, n) in zip(found, spans, strict=True)}

    def kinetic(self, displacements: Array) -> dict[str, Array]:
        """Kinetic energy of each body."""
        bodies = self._model.core.bodies(*self._motion(displacements), list(range(len(self._bodies))))
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
        motion = self._motion(displacements)
        bodies = self._model.core.bodies(*motion, list(range(len(self._bodies))))
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
        return rest.sizes(self._model.core)

    @cached_property
    def _bodies(self) -> list[dict[str, Any]]:
        return list(json.loads(self._model.core.description)["bodies"])

    def _motion(self, displacements: Array) -> tuple[Array, Array, Array]:
        count = len(displacements)
        return (
            np.full(count, self._state.t),
            np.tile(self._state.q, (count, 1)),
            np.ascontiguousarray(displacements, dtype=float),
        )


def linearize(
    self: Modelled,
    at: Any = None,
    *,
    inputs: Iterable[Any] | None = None,
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
            springs, torques, components of forces; the input is an effort [N or N m] beside all that acts. None: none.
        outputs: names of sensors, or of joints for their coordinates; None: all sensors. Their derivatives are central
            differences along exact motions (errors of about 1e-10).
        independent: names of the independent velocities; None: the choice that a run would begin with.
        coordinates, parameters: as in `simulate`.

    Raises:
        ArgumentError: the velocities of the state violate constraints, a name is no input, a choice does not serve.
        SingularityError: the position is singular. UnknownNameError: there is no output of a name.

    Cost: an evaluation with derivatives for every eight columns.

    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> m.linearize(inputs=["A"])
    <Linearization: 2 states, 1 inputs, 0 outputs; not steady>
    >>> m.linearize(inputs=["A"]).A.shape
    (2, 2)
    """
    wanted = run_options.one_of("coordinates", coordinates, run_options.COORDINATES)
    model, _ = layout_of(self, wanted, parameters)
    if at is not None and not isinstance(at, State):
        at = getattr(at, "state", at)
    start = start_of(self, at, model, wanted, parameters)
    names = model.velocity_names
    efforts, columns = _efforts(inputs, model, start)
    chosen = None
    if independent is not None:
        chosen = [names.index(name) for name in run_options.velocities("independent", independent, names)]
    found = model.core.linearized(start.t, start.q, start.v, columns, chosen)
    readings = _Readings(model, start, found)
    read = _outputs(outputs, model)
    y, changes, labels = readings.of(read)
    states = [names[i] for i in found["positions"]] + [f"{names[i]}'" for i in found["velocities"]]
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
        inputs=tuple(efforts),
        outputs=tuple(labels),
        state=start,
        mass=found["mass"],
        stiffness=found["stiffness"],
        damping=found["damping"],
        steady=found["steady"],
        conservative=found["conservative"],
        method="exact" if found["exact"] else "differences",
        _found=found["modes"],
        _shapes=ModelShapes(model, start),
        _again=again,
    )


def _names(what: str, given: Any) -> list[str]:
    if isinstance(given, (str, bytes)) or not isinstance(given, Iterable):
        raise ArgumentError(f"{what} must be a list of names such as ['A'], not {shown(given)}", argument=what)
    return [str(name) for name in given]


def _efforts(inputs: Any, model: CompiledModel, at: State) -> tuple[list[str], Array]:
    """Names of the inputs, and the column of E of each, as rows."""
    wanted = _names("inputs", () if inputs is None else inputs)
    if not wanted:
        return [], np.zeros((0, model.core.nv))
    core, chosen = model._with_actuators(wanted)
    return [each.name for each in chosen], core.columns(at.t, at.q)


def _outputs(outputs: Any, model: CompiledModel) -> list[tuple[str, str]]:
    """Kind and name of each output."""
    if outputs is None:
        return [("sensor", name) for name in model.sensors]
    joints = [joint["name"] for joint in model.summary["joints"]]
    found = []
    for name in _names("outputs", outputs):
        if name in model.sensors:
            found.append(("sensor", name))
        else:
            known = [*model.sensors, *joints]
            found.append(("joint", known[index_of(name, known, "output")]))
    return found


class _Readings:
    """Outputs at a state and beside it."""

    def __init__(self, model: CompiledModel, state: State, found: Mapping[str, Any]) -> None:
        self._steps: Array = found["steps"]
        beside = {
            "q": (state.q, found["probe_q"]),
            "v": (state.v, found["probe_v"]),
            "vdot": (found["vdot"], found["probe_vdot"]),
            "multipliers": (found["multipliers"], found["probe_multipliers"]),
        }
        rows = {name: np.vstack([here[None, :], there]) for name, (here, there) in beside.items()}
        self._run = run_of(
            Run, model, np.full(len(rows["q"]), state.t), rows["q"], rows["v"], rows["vdot"], rows["multipliers"]
        )

    def of(self, wanted: Sequence[tuple[str, str]]) -> tuple[Array, Array, list[str]]:
        """Values, changes with states and inputs, and names of their components."""
        values, changes, labels = [], [], []
        for kind, name in wanted:
            read = np.asarray(self._run.sensor(name).values if kind == "sensor" else self._run.joint(name).position)
            columns = read.reshape(len(read), -1)
            values.append(columns[0])
            changes.append((columns[1::2] - columns[2::2]).T / (2.0 * self._steps))
            one = columns.shape[1] == 1
            labels += [name if one else f"{name}[{i}]" for i in range(columns.shape[1])]
        count = len(self._steps)
        if not values:
            return np.zeros(0), np.zeros((0, count)), labels
        return np.concatenate(values), np.vstack(changes), labels
