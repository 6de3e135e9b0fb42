"""`python tools/beside_exudyn.py`: mechanisms by Partita and by Exudyn, rows of docs/others.md.

Exudyn is asked for by itself (`pip install exudyn`); no test needs it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from time import process_time
from typing import Any, NamedTuple

import exudyn
import numpy as np
from exudyn.rigidBodyUtilities import RigidBodyInertia

import partita as pt
from partita.results import Result

EVERY = 0.01  # outputs are compared so often [s]


class Case(NamedTuple):
    """A mechanism, how it starts, how long it runs, and what its loops hold too often."""

    name: str
    options: dict[str, Any]
    rates: dict[str, float]
    seconds: float


CASES = (
    Case("four-bar", {}, {"A": 2.0}, 10.0),
    Case("bricard", {}, {}, 10.0),
    Case("n-four-bar", {"loops": 10}, {}, 10.0),
)
STEPS = (1e-2, 1e-3)


class Row(NamedTuple):
    """What a run shows of itself."""

    opening: float
    drift: float
    apart: float
    force: float
    seconds: float


def main() -> None:
    """Run and print."""
    said = argparse.ArgumentParser(description="mechanisms by Partita and by Exudyn")
    said.add_argument("names", nargs="*", default=[case.name for case in CASES])
    names = said.parse_args().names
    for case in CASES:
        if case.name not in names:
            continue
        m = pt.catalogue.load(case.name, **case.options)
        start = m.assemble(rates=case.rates) if case.rates else pt.catalogue.entry(case.name).start(m)
        t = np.linspace(0.0, case.seconds, round(case.seconds / EVERY) + 1)
        began = process_time()
        run = m.simulate(case.seconds, initial=start, rtol=1e-10, atol=1e-12, t_eval=t)
        spent = process_time() - began
        balance = run.energy.balance if run.has_energy else np.zeros(1)
        scale = float(np.abs(run.energy.kinetic).max())
        print(f"{case.name}, Partita: open {openings(run, m).max():.1e} m, energy {np.abs(balance).max() / scale:.1e}, "
              f"{spent:.3f} s; {len(run.summary['removed'])} redundant")  # fmt: skip
        for step in STEPS:
            for label, settings in ways():
                row = beside(m, run, case, step, settings)
                what = "ends early" if row is None else (
                    f"open {row.opening:.1e} m, energy {row.drift:.1e}, apart {row.apart:.1e} m, "
                    + (f"forces in the plane {row.force:.1e}, " if run.summary["planar"] else "")
                    + f"{row.seconds:.2f} s"
                )  # fmt: skip
                print(f"{case.name}, Exudyn, {1e3 * step:g} ms, {label}: {what}")


def ways() -> Iterator[tuple[str, dict[str, Any]]]:
    """Settings: as delivered, and as its examples of redundant mechanisms set them."""
    yield "as delivered", {}
    yield "redundancy allowed", {"full": True}


def openings(run: Result, m: pt.Mechanism) -> np.ndarray:
    """Largest distance [m] between the two points of any joint, at every output."""
    poses = [
        {b: (run.body(b).position[i], run.body(b).rotation[i]) for b in run.names.bodies} for i in range(len(run.t))
    ]
    return np.array([opening(at, m) for at in poses])


def opening(at: dict[str, tuple[np.ndarray, np.ndarray]], m: pt.Mechanism) -> float:
    """The same of one instant."""
    at = {**at, "ground": (np.zeros(3), np.eye(3))}
    drawn = {b.name: (np.array(b.position), np.array(b.orientation)) for b in m.bodies.values()}
    drawn["ground"] = at["ground"]
    worst = 0.0
    for joint in m.joints.values():
        ends = []
        for body in (joint.parent, joint.child):
            origin, turn = drawn[body]
            local = turn.T @ (np.array(joint.point) - origin)
            ends.append(at[body][0] + at[body][1] @ local)
        worst = max(worst, float(np.linalg.norm(ends[0] - ends[1])))
    return worst


def beside(m: pt.Mechanism, run: Result, case: Case, step: float, settings: dict[str, Any]) -> Row | None:
    """The same mechanism from the same start by Exudyn, looked at, and once more alone on the clock; None where it ends
    early."""
    row = once(m, run, case, step, settings, watched=True)
    alone = row and once(m, run, case, step, settings, watched=False)
    return row._replace(seconds=alone.seconds) if row and alone else None


def once(m: pt.Mechanism, run: Result, case: Case, step: float, settings: dict[str, Any], watched: bool) -> Row | None:
    """One run."""
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
    planar = run.summary["planar"]
    for joint in m.joints.values():
        where = run.joint(joint.name)
        parent = np.eye(3) if joint.parent == "ground" else run.body(joint.parent).rotation[0] @ np.array(
            m.bodies[joint.parent].orientation).T  # fmt: skip
        joints[joint.name] = system.CreateRevoluteJoint(
            itemNumbers=[bodies[joint.parent], bodies[joint.child]], position=where.point[0], axis=parent @ joint.axis
        )
    system.Assemble()
    told = exudyn.SimulationSettings()
    told.solution.file.write = False
    told.show.computationTime = told.show.statistics = False
    told.timeIntegration.verboseMode = 0
    told.timeIntegration.numberOfSteps = round(case.seconds / step)
    told.timeIntegration.endTime = case.seconds
    if settings.get("full"):
        told.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
        told.linearSolver.ignoreSingularJacobian = True
    every = round(EVERY / step)
    worst = {"opening": 0.0, "apart": 0.0, "force": 0.0}
    energies: list[float] = []
    counted = [0]

    def look(system: Any, t: float) -> bool:
        if counted[0] % every == 0 and (i := counted[0] // every) < len(run.t):
            at = {
                name: (
                    np.array(system.GetObjectOutputBody(bodies[name], exudyn.OutputVariableType.Position, [0, 0, 0])),
                    np.array(system.GetObjectOutputBody(bodies[name], exudyn.OutputVariableType.RotationMatrix,
                                                        [0, 0, 0])).reshape(3, 3),
                )
                for name in m.bodies
            }  # fmt: skip
            worst["opening"] = max(worst["opening"], opening(at, m))
            apart = max(float(np.abs(at[b][0] - run.body(b).position[i]).max()) for b in m.bodies)
            worst["apart"] = max(worst["apart"], apart)
            energies.append(energy(system, at))
            if planar and 0.1 < t < 1.0:  # before small differences have grown
                for name, made in joints.items():
                    local = np.array(system.GetObjectOutput(made, exudyn.OutputVariableType.ForceLocal))
                    across = float(np.hypot(local[0], local[1]) - np.linalg.norm(run.joint(name).force[i, :2]))
                    worst["force"] = max(worst["force"], abs(across))
        counted[0] += 1
        return True

    def energy(system: Any, at: dict[str, tuple[np.ndarray, np.ndarray]]) -> float:
        total = 0.0
        for name, body in m.bodies.items():
            com = [float(x) for x in body.com]
            kinds = exudyn.OutputVariableType
            place = np.array(system.GetObjectOutputBody(bodies[name], kinds.Position, com))
            speed = np.array(system.GetObjectOutputBody(bodies[name], kinds.Velocity, com))
            spin = at[name][1].T @ np.array(system.GetObjectOutputBody(bodies[name], kinds.AngularVelocity, com))
            total += 0.5 * body.mass * speed @ speed + 0.5 * spin @ np.array(body.inertia) @ spin
            total -= body.mass * np.array(m.gravity) @ place
        return float(total)

    if watched:
        system.SetPreStepUserFunction(look)
    began = process_time()
    try:
        done = system.SolveDynamic(told)
    except Exception as error:  # its errors have no common class
        print(f"  {str(error).splitlines()[0][:100]}")
        return None
    spent = process_time() - began
    if done is False or (watched and counted[0] < round(case.seconds / step)):
        return None
    if not watched:
        return Row(0.0, 0.0, 0.0, 0.0, spent)
    scale = float(np.abs(run.energy.kinetic).max())
    drift = float(np.abs(np.array(energies) - energies[0]).max()) / scale
    largest = max(float(np.abs(run.joint(name).force[:100, :2]).max()) for name in m.joints)
    return Row(worst["opening"], drift, worst["apart"], worst["force"] / largest, spent)


if __name__ == "__main__":
    main()
