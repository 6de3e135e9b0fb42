"""Pinocchio: hinges in a tree, loops as constraints of points (`constraintDynamics`), RK4 of fixed steps.

Only its evaluations are timed, in a loop of their own, as if all else were free.
"""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
import pinocchio as pin
from planar import Pin, Problem, Tried, report

DAMPING = 5.0


def depth_first(tree: list[Pin], parent: int = -1) -> list[Pin]:
    """Each branch before the next, as the algorithms over the tree need it."""
    return [x for pin in tree if pin.parent == parent for x in (pin, *depth_first(tree, pin.child))]


def tried(p: Problem) -> list[Tried]:
    model, tree = pin.Model(), depth_first(p.tree)
    model.gravity = pin.Motion(np.array([*p.gravity, 0.0]), np.zeros(3))
    number = {-1: 0}
    points = {-1: np.zeros(2)}
    for x in tree:
        here = pin.SE3(np.eye(3), np.array([*(x.point - points[x.parent]), 0.0]))
        number[x.child] = model.addJoint(number[x.parent], pin.JointModelRZ(), here, f"j{x.child}")
        points[x.child] = x.point
        arm = np.array([*(p.centres[x.child] - x.point), 0.0])
        moment = p.inertias[x.child]
        inertia = pin.Inertia(p.masses[x.child], arm, np.diag([moment / 2, moment / 2, moment]))
        model.appendBodyToJoint(number[x.child], inertia, pin.SE3.Identity())
    damped = pin.BaumgarteCorrectorParameters(DAMPING**2, 2 * DAMPING)
    loops = []
    for x in p.loops:
        ends = [pin.SE3(np.eye(3), np.array([*(x.point - points[i]), 0.0])) for i in (x.child, x.parent)]
        loop = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, model, number[x.child], ends[0], number[x.parent], ends[1], pin.LOCAL
        )
        loop.setBaumgarteCorrectorParameters(damped)
        loops.append(loop)
    data, of_loops = model.createData(), [x.createData() for x in loops]
    settings = pin.ProximalSettings(1e-12, 1e-10, 20)
    pin.initConstraintDynamics(model, data, loops, of_loops)
    first = [model.joints[number[x.child]].idx_v for x in tree]
    torque = np.zeros(model.nv)
    v = np.zeros(model.nv)
    for i, x in zip(first, tree, strict=True):
        v[i] = p.relative_rate(x)
        torque[i] = p.torques.get(x.child, 0.0)
    first_body = model.joints[number[0]].idx_q

    def rate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        force = torque.copy()
        if p.springs:
            pin.computeJointJacobians(model, data, q)
            for s in p.springs:
                j = number[s.body2]
                arm = np.array([*(s.point2 - points[s.body2]), 0.0])
                at = data.oMi[j].act(arm)
                apart = at - np.array([*s.point1, 0.0])
                length = float(np.linalg.norm(apart))
                pull = -s.stiffness * (length - s.length) * apart / length
                frame = pin.getJointJacobian(model, data, j, pin.LOCAL_WORLD_ALIGNED)
                force += frame[:3].T @ pull + frame[3:].T @ np.cross(at - data.oMi[j].translation, pull)
        return pin.constraintDynamics(model, data, q, v, force, loops, of_loops, settings)

    found = []
    for per_output in (2, 8, 32):
        steps = per_output * (len(p.times) - 1)
        if steps * len(p.bodies) > 300_000:
            continue
        h = float(p.times[-1]) / steps
        q, w, spent = np.zeros(model.nq), v.copy(), 0.0
        for _ in range(steps):
            began = perf_counter()
            a1 = rate(q, w).copy()
            w2 = w + 0.5 * h * a1
            a2 = rate(q + 0.5 * h * w, w2).copy()
            w3 = w + 0.5 * h * a2
            a3 = rate(q + 0.5 * h * w2, w3).copy()
            w4 = w + h * a3
            a4 = rate(q + h * w3, w4).copy()
            spent += perf_counter() - began
            q = q + h / 6 * (w + 2 * w2 + 2 * w3 + w4)
            w = w + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        found.append(Tried(f"RK4, {steps} steps", spent, p.error(p.angles[0] + float(q[first_body]))))
    return found


if __name__ == "__main__":
    report(tried(Problem.read(sys.argv[1])), f"Pinocchio {pin.__version__}, its evaluations alone, from Python")
