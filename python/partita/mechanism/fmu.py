"""A mechanism as an FMU: `Mechanism.to_fmu`."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .. import options as run_options
from ..builder.records import TorqueRecord
from ..builder.values import Constant
from ..errors import ArgumentError
from ..files import target
from ..io import fmu
from ..io.fmu_description import VERSIONS
from ..solver import Solver
from ..state import State
from ..units import Quantity
from .events import followed
from .models import Modelled, layout_of
from .solve import assemble, convert


def to_fmu(
    self: Modelled,
    path: str | PathLike[str],
    inputs: Iterable[str] = (),
    outputs: Iterable[str] | None = None,
    parameters: Iterable[str] = (),
    *,
    initial: State | None = None,
    duration: Quantity = 10.0,
    communication_step: Quantity = 0.01,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    method: str = "dop853",
    solver: Solver | None = None,
    version: str = "2.0",
    events: Iterable[Any] | None = None,
    locked: Iterable[Any] = (),
) -> Path:
    """Write an FMU (co-simulation): the mechanism as a component in the simulations of other programs.

    It contains the mechanism and Partita's compiled core: no compiler is needed to write it, and neither a compiler nor
    Python to run it. An FMU runs on the operating system on which it was written (Linux, macOS, Windows; 64 bit).

    Args:
        path: the file, such as "four-bar.fmu"; an existing one is replaced.
        inputs: names of torques (`add_torque`), for their values; of drives of joint coordinates, for their motions; of
            joints with one coordinate, for an effort along it. An effort is constant over a communication step. A drive
            "lift" of positions has the inputs "lift", "lift.rate" and "lift.acceleration", one of velocities "lift",
            its rate, and "lift.acceleration": their values at the beginning of a step say where the drive is at its
            end, and it moves there without jumps of position and rate.
        outputs: "A.position", "A.velocity", "A.force", "A.moment" (reaction on the child, world axes) and "A.effort"
            (of a drive) of a joint A; "A" for position and velocity; "energy.kinetic", "energy.potential", "energy" for
            both. Of an element that holds at times "brake.effort", what it carries; of it and of an event
            "brake.count", how often something happened to it, and "brake.time", when it did last. None: all joints, the
            energies, and these counts. Angles of joints that close loops in space are reported within one turn.
        parameters: names of parameters (`m.compile().parameters`: "gravity", "BODY.mass", "JOINT.point",
            "SPRING.stiffness", ...) that each instance can set before it starts, one variable for each of their numbers
            ("gravity.x", ...). With other values the loops are closed from the initial position.
        initial: state to start from; None: the drawing, assembled, at rest.
        duration, communication_step: default values stored in the FMU [s].
        rtol, atol, method, solver: as in `simulate`; the simulation environment may set another rtol.
        events: as in `simulate`, of measures and sensors of positions and rates, none of them terminal; what they do,
            and what friction that sticks, latches, freewheels and rigid ends do, happens inside of steps, at its time.
        locked: joints that are held from the start on, as in `simulate`.
        version: of FMI, "2.0" or "3.0". Both give the same numbers; by 3.0 the numbers of one quantity that have one
            unit ("A.force", "gravity") are one variable, an array.

    Returns:
        The path.

    Raises:
        ArgumentError: a name does not exist or cannot be an input or output, or the state belongs to another mechanism.
        DescriptionError: the mechanism uses a Python function.
        AssemblyError: its loops cannot be closed.
        MissingDependencyError: this installation has no binary.

    Each step restarts the integrator, and each output that is a reaction costs an evaluation. A step that cannot be
    completed (a singular position, a contradictory drive) is discarded with the reason, and the FMU keeps its state.

    >>> import os, tempfile
    >>> import partita as pt
    >>> m = pt.catalogue.load("four-bar")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     m.to_fmu(os.path.join(folder, "four-bar.fmu"), inputs=["A"], outputs=["A", "energy"]).name
    'four-bar.fmu'
    """
    where = target(path, "an FMU ")
    if where.suffix.lower() != ".fmu":
        raise ArgumentError(f'"{where}": the name of an FMU must end in .fmu', argument="path")
    version = run_options.one_of("version", version, VERSIONS)
    if initial is not None and not isinstance(initial, State):
        raise ArgumentError(f"initial must be a State, not {type(initial).__name__}", argument="initial")
    description, known = fmu.prepared(self._description, inputs)
    start = assemble(self) if initial is None else convert(self, initial, "relative")
    changed = Modelled(self.name, (0.0, 0.0, 0.0), self.drawing_tolerance)
    changed._description = description
    model, layout = layout_of(changed, "relative")
    holding = followed(changed, model, layout, events, locked, [one.name for one in known])
    shown = fmu.outputs_of(self._description, outputs, {} if holding is None else holding.names)
    q, v = start.q, start.v
    if start.names != model.names:
        q, v = model.core.transferred(layout_of(self, "relative")[0].core, start.q, start.v)
    state = State(start.t, q, v, layout=layout)
    acting = {f"{one.name if one.name in description.forces else f'input {one.name}'}.value" for one in known}
    constant = {name: value for name, value in model.parameters.items() if name not in acting}
    numbers = fmu.parameters_of(description, parameters, constant)
    for parameter in numbers:
        if holding is not None and (owner := str(parameter.means["name"]).rpartition(".")[0]) in holding.fixed:
            raise ArgumentError(
                f'parameters: "{parameter.name}" says where "{owner}" holds; it has one value', argument="parameters"
            )
    span = run_options.positive("duration", duration)
    step = run_options.positive("communication_step", communication_step)
    options = run_options.options(
        start.t, span, model.velocity_names, rtol=rtol, atol=atol, method=method, solver=solver
    )
    reported: list[dict[str, object]] = []
    starts: list[list[float]] = []
    for one in known:
        if one.kind != "effort":
            measure = description.drives[one.name].measure
            joint, i = str(measure["joint"]), int(measure["coordinate"])
            position, rate = (_scalar(x, i) for x in (state.position(joint), state.velocity(joint)))
            reported.append({"kind": one.kind, "position": position, "rate": rate})
            starts.append([position, rate, 0.0] if one.kind == "position" else [rate, 0.0])
        else:
            force = description.forces[one.name if one.name in description.forces else f"input {one.name}"]
            value = force.value.value if isinstance(force, TorqueRecord) and isinstance(force.value, Constant) else 0.0
            reported.append({"kind": "effort", "start": value})
            starts.append([value])
    resource = {
        "fmu": 2,
        "model": fmu.model_of(description, layout, known),
        "options": options,
        "start": {"t": start.t, "q": q.tolist(), "v": v.tolist()},
        "inputs": reported,
        "outputs": [dict(x.means) for x in shown],
        "parameters": [dict(x.means) for x in numbers],
    }
    if holding is not None:
        resource["holding"] = holding.resource
    experiment = {"startTime": start.t, "stopTime": start.t + span, "stepSize": step, "tolerance": options["rtol"]}
    variables = fmu.variables_of(known, starts, shown, numbers, version)
    fmu.archive(where, self.name, version, resource, variables, experiment)
    return where


def _scalar(value: object, i: int) -> float:
    """Coordinate number i of a joint in a state."""
    return float(np.ravel(np.asarray(value, dtype=float))[i])
