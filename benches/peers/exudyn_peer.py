"""Exudyn: rigid bodies in the plane with pins, generalized-alpha of index 3 with its fast settings."""

from __future__ import annotations

import contextlib
import io
import sys
from functools import partial
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    Force,
    MarkerBodyPosition,
    MarkerBodyRigid,
    NodeRigidBody2D,
    ObjectConnectorSpringDamper,
    ObjectGround,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
    SensorNode,
    Torque,
)
from planar import Problem, Tried, report, timed


def run(p: Problem, steps: int) -> float:
    """Angle of the first body at the end."""
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    ground = mbs.AddObject(ObjectGround())
    nodes, bodies = [], []
    velocity = velocities(p)
    for i in range(len(p.bodies)):
        nodes.append(
            mbs.AddNode(
                NodeRigidBody2D(referenceCoordinates=[*p.centres[i], 0.0], initialVelocities=[*velocity[i], p.rates[i]])
            )
        )
        bodies.append(
            mbs.AddObject(ObjectRigidBody2D(physicsMass=p.masses[i], physicsInertia=p.inertias[i], nodeNumber=nodes[i]))
        )
        mbs.AddLoad(Force(markerNumber=marker(mbs, p, bodies, ground, i, p.centres[i]), loadVector=weight(p, i)))
    for pin in (*p.tree, *p.loops):
        ends = [marker(mbs, p, bodies, ground, i, pin.point) for i in (pin.parent, pin.child)]
        mbs.AddObject(ObjectJointRevolute2D(markerNumbers=ends))
    for s in p.springs:
        ends = [marker(mbs, p, bodies, ground, i, x) for i, x in ((s.body1, s.point1), (s.body2, s.point2))]
        mbs.AddObject(
            ObjectConnectorSpringDamper(markerNumbers=ends, stiffness=s.stiffness, damping=0, referenceLength=s.length)
        )
    for i, torque in p.torques.items():
        rigid = mbs.AddMarker(MarkerBodyRigid(bodyNumber=bodies[i]))
        mbs.AddLoad(Torque(markerNumber=rigid, loadVector=[0, 0, torque]))
    sensor = mbs.AddSensor(
        SensorNode(nodeNumber=nodes[0], storeInternal=True, outputVariableType=exu.OutputVariableType.Rotation)
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps = steps
    integration.endTime = float(p.times[-1])
    integration.verboseMode = 0
    integration.newton.useModifiedNewton = False
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.generalizedAlpha.computeInitialAccelerations = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = float(p.times[1] - p.times[0])
    settings.linearSolver.solverType = (
        exu.LinearSolverType.EigenSparse if len(p.bodies) > 10 else exu.LinearSolverType.EXUdense
    )
    with contextlib.redirect_stdout(io.StringIO()):
        mbs.SolveDynamic(settings)
    return float(p.angles[0] + np.ravel(mbs.GetSensorValues(sensor))[-1])


def velocities(p: Problem) -> np.ndarray:
    """Of the centres of mass at the start."""
    found = np.zeros((len(p.bodies), 2))
    for pin in p.tree:
        at = np.zeros(2)
        if pin.parent >= 0:
            x, y = pin.point - p.centres[pin.parent]
            at = found[pin.parent] + p.rates[pin.parent] * np.array([-y, x])
        x, y = p.centres[pin.child] - pin.point
        found[pin.child] = at + p.rates[pin.child] * np.array([-y, x])
    return found


def weight(p: Problem, i: int) -> list[float]:
    return [*(p.masses[i] * p.gravity), 0.0]


def marker(mbs: Any, p: Problem, bodies: list[int], ground: int, i: int, point: np.ndarray) -> int:
    """A point of the drawing on a body."""
    if i < 0:
        return mbs.AddMarker(MarkerBodyPosition(bodyNumber=ground, localPosition=[*point, 0.0]))
    return mbs.AddMarker(MarkerBodyPosition(bodyNumber=bodies[i], localPosition=[*(point - p.centres[i]), 0.0]))


def tried(p: Problem) -> list[Tried]:
    found = []
    for per_output in (1, 5, 25, 125):
        steps = per_output * (len(p.times) - 1)
        try:
            seconds, angle = timed(partial(run, p, steps))
        except Exception as error:
            print(error, file=sys.stderr)
            continue
        found.append(Tried(f"generalized-alpha, {steps} steps", seconds, p.error(angle)))
    return found


if __name__ == "__main__":
    report(tried(Problem.read(sys.argv[1])), f"Exudyn {exu.__version__}")
