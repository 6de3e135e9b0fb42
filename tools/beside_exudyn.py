"""`python tools/beside_exudyn.py`: mechanisms by Partita and by Exudyn, rows of docs/others.md.

Exudyn is asked for by itself (`pip install exudyn`); no test needs it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import exudyn
import numpy as np
from beside import BENNETT, EVERY, FOUR_BAR, Case, Known, Reading, asked, hinge, reported
from exudyn.rigidBodyUtilities import RigidBodyInertia

CASES = (FOUR_BAR, BENNETT, Case("bricard", {}, {}, 10.0), Case("n-four-bar", {"loops": 10}, {}, 10.0))
STEPS = (1e-2, 1e-3)


def main() -> None:
    """Run and print."""
    print(f"Exudyn {exudyn.config.Version()}")
    for known in asked("mechanisms by Partita and by Exudyn", CASES):
        for step in STEPS:
            for label, full in variants():
                reported(known, "Exudyn", f"{1e3 * step:g} ms, {label}", partial(once, known, step, full))


def variants() -> Iterator[tuple[str, bool]]:
    """Settings: as delivered, and as its examples of redundant mechanisms set them."""
    yield "as delivered", False
    yield "redundancy allowed", True


def once(known: Known, step: float, full: bool, look: bool) -> list[Reading] | None:
    """One run."""
    case, m, run = known
    exudyn.config.printToConsole = False
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    bodies: dict[str, Any] = {"ground": system.CreateGround()}
    for name, body in m.bodies.items():
        at = run.body(name)
        turn = at.rotation[0]
        inertia = RigidBodyInertia(body.mass, np.array(body.inertia), np.array(body.com), inertiaTensorAtCOM=True)
        bodies[name] = system.CreateRigidBody(
            referencePosition=at.position[0], referenceRotationMatrix=turn, initialVelocity=at.velocity[0],
            initialAngularVelocity=at.angular_velocity[0], inertia=inertia, gravity=list(m.gravity),
        )  # fmt: skip
    joints: dict[str, Any] = {}
    for joint in m.joints.values():
        made = hinge(known, joint.name)
        joints[joint.name] = system.CreateRevoluteJoint(
            itemNumbers=[bodies[joint.parent], bodies[joint.child]], position=made.point, axis=made.axis
        )
    system.Assemble()
    asked_for = exudyn.SimulationSettings()
    asked_for.solution.file.write = False
    asked_for.show.computationTime = asked_for.show.statistics = False
    asked_for.timeIntegration.verboseMode = 0
    asked_for.timeIntegration.numberOfSteps = round(case.seconds / step)
    asked_for.timeIntegration.endTime = case.seconds
    if full:
        asked_for.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
        asked_for.linearSolver.ignoreSingularJacobian = True
    every = round(EVERY / step)
    found, counted = list[Reading](), [0]
    kinds = exudyn.OutputVariableType

    def watch(system: Any, t: float) -> bool:
        if counted[0] % every == 0:
            found.append(seen(system))
        counted[0] += 1
        return True

    def seen(system: Any) -> Reading:
        def of(body: str, kind: Any, point: Any) -> np.ndarray:
            return np.array(system.GetObjectOutputBody(bodies[body], kind, [float(x) for x in point]))

        def turn(body: str) -> np.ndarray:
            return np.eye(3) if body == "ground" else of(body, kinds.RotationMatrix, (0, 0, 0)).reshape(3, 3)

        forces = {}
        for name, made in joints.items():  # its force is that on the first body
            marker = system.GetMarker(system.GetObject(made)["markerNumbers"][0])
            axes = turn(m.joints[name].parent) @ np.array(marker["localHT"])[:3, :3]
            forces[name] = -axes @ np.array(system.GetObjectOutput(made, kinds.ForceLocal))
        return Reading(
            {
                name: (of(name, kinds.Position, (0, 0, 0)), turn(name), of(name, kinds.Velocity, body.com),
                       of(name, kinds.AngularVelocity, body.com))
                for name, body in m.bodies.items()
            }, forces,
        )  # fmt: skip

    if look:
        system.SetPreStepUserFunction(watch)
    try:
        done = system.SolveDynamic(asked_for)
    except Exception as error:  # its errors have no common class
        print(f"  {str(error).splitlines()[0][:100]}")
        return None
    if done is False or (look and counted[0] < round(case.seconds / step)):
        return None
    return found


if __name__ == "__main__":
    main()
