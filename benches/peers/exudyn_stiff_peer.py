"""Exudyn: the wishbone on bushings, its bodies in the plane, by generalised alpha of index 3 with fixed steps."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from dataclasses import asdict
from time import perf_counter
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    Force,
    MarkerBodyPosition,
    NodeRigidBody2D,
    ObjectConnectorCartesianSpringDamper,
    ObjectConnectorSpringDamper,
    ObjectGround,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
)
from stiff_rates import Known, Tried

LONGEST = 10.0


def drawn(spec: dict[str, Any]) -> tuple[Any, list[int]]:
    """The system and the nodes of its bodies, in the order of the drawing."""
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject(ObjectGround())
    objects, nodes = {"ground": ground}, []
    for body in spec["bodies"]:
        nodes.append(mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[*body["position"][:2], 0.0])))
        objects[body["name"]] = mbs.AddObject(
            ObjectRigidBody2D(physicsMass=body["mass"], physicsInertia=body["inertia"][2][2], nodeNumber=nodes[-1])
        )
        weight = [body["mass"] * g for g in spec["gravity"]]
        mbs.AddLoad(Force(markerNumber=marker(mbs, objects[body["name"]], [0.0, 0.0]), loadVector=weight))
    positions = {body["name"]: np.array(body["position"]) for body in spec["bodies"]}
    for joint in spec["joints"]:
        if joint["kind"] == "revolute":
            sides = (joint["parent"], joint["child"])
            ends = [marker(mbs, objects[s], (joint["point"] - positions[s])[:2]) for s in sides]
            mbs.AddObject(ObjectJointRevolute2D(markerNumbers=ends))
    for force in spec["forces"]:
        ends = [marker(mbs, objects[force[f"body{i}"]], force[f"point{i}"][:2]) for i in (1, 2)]
        if force["kind"] == "bushing":
            stiff, damping = (np.diag(force[x])[:3].tolist() for x in ("stiffness", "damping"))
            mbs.AddObject(ObjectConnectorCartesianSpringDamper(markerNumbers=ends, stiffness=stiff, damping=damping))
        else:
            mbs.AddObject(
                ObjectConnectorSpringDamper(
                    markerNumbers=ends,
                    stiffness=force["stiffness"],
                    damping=force["damping"],
                    referenceLength=force["length"],
                )
            )
    return mbs, nodes


def marker(mbs: Any, body: int, point: Any) -> int:
    return mbs.AddMarker(MarkerBodyPosition(bodyNumber=body, localPosition=[*point, 0.0]))


def run(known: Known, steps: int) -> tuple[float, Any]:
    """Seconds and the end in Partita's coordinates: the lower arm's displacement and angle, angles of the balls."""
    mbs, nodes = drawn(known.planar)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps = steps
    integration.endTime = known.duration
    integration.verboseMode = 0
    integration.newton.useModifiedNewton = True
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.generalizedAlpha.computeInitialAccelerations = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
    start = perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        mbs.SolveDynamic(settings)
    seconds = perf_counter() - start
    found = []
    for what in ("Coordinates", "Coordinates_t"):
        kind = getattr(exu.OutputVariableType, what)
        (x, y, low), (_, _, upright), (_, _, high) = (mbs.GetNodeOutput(nodes[i], kind)[:3] for i in (0, 2, 1))
        found += [x, y, low, upright - low, high - upright]
    return seconds, found


if __name__ == "__main__":
    known, done = Known.read(sys.argv[1]), []
    for exponent in np.arange(2.0, 6.1, 0.5):
        steps = round(10.0**exponent)
        try:
            seconds, end = run(known, steps)
        except Exception as error:
            print(steps, error, file=sys.stderr)
            continue
        done.append(Tried("generalised alpha", f"{steps} steps", seconds, known.error(end), 0, 0, 0.0, 0.0))
        if seconds > LONGEST:
            break
    print(json.dumps({"peer": f"Exudyn {exu.__version__}", "tried": [asdict(x) for x in done]}))
