"""Accelerations of robots with loops by Pinocchio, and how far each program is off the solution of its own equations.

Pinocchio's model is made from the URDF, and its loops and types of joints from the YAML file beside, read here anew;
the position is that of our bodies, and so are the velocities. Both programs then have M v' = h + C^T lambda and
C v' + b = 0 in rounded numbers. Solved in extended precision they differ by the rounding of their coefficients times
the condition of the equations; what a program's accelerations differ from that solution is its own error.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .others import Incomparable

Array = NDArray[np.float64]
RANK = 1e-9
"""Of singular values of C, in parts of the largest: redundant rows have round-off, others of robots 1e-4."""
PROXIMAL = (1e-14, 1e-9, 1000)
"""Accuracy, regularisation, iterations of Pinocchio's solution, whose rows may be redundant."""
PLACED = 1e-12
"""Distance [m] and angle of bodies in the two programs."""


@dataclass(frozen=True)
class Compared:
    """How far the accelerations of joints are apart, in parts of the largest; those in extended precision; the error of
    each program; conditions of M over the free motions (diagonal of 1) and of C (rows of unit length)."""

    apart: float
    exact: float
    own_error: float
    other_error: float
    of_mass: float
    of_rows: float

    def __str__(self) -> str:
        errors = f"own error {self.own_error:.0e}, Pinocchio's {self.other_error:.0e}"
        conditions = f"conditions {self.of_mass:.0e} of M, {self.of_rows:.0e} of C"
        return f"{self.apart:.0e} (exactly solved {self.exact:.0e}; {errors}; {conditions})"


@dataclass(frozen=True)
class Equations:
    """M, h, C, b of one program, rows of full rank alone, and the accelerations that it finds."""

    mass: Array
    force: Array
    rows: Array
    rest: Array
    found: Array

    def exact(self) -> Array:
        """The accelerations from the same rounded coefficients, by Gauss's elimination in extended precision."""
        m = len(self.rest)
        left = np.block([[self.mass, -self.rows.T], [self.rows, np.zeros((m, m))]])
        whole = np.column_stack([left, np.concatenate([self.force, -self.rest])]).astype(np.longdouble)
        for i in range(len(whole)):
            best = i + int(np.argmax(np.abs(whole[i:, i])))
            whole[[i, best]] = whole[[best, i]]
            whole[i] /= whole[i, i]
            others = np.arange(len(whole)) != i
            whole[others] -= np.outer(whole[others, i], whole[i])
        return whole[: len(self.force), -1].astype(float)

    def conditions(self) -> tuple[float, float]:
        """Of M over the motions that C leaves free, and of C."""
        scale = 1.0 / np.sqrt(np.maximum(np.diag(self.mass), np.finfo(float).tiny))
        _, _, vt = np.linalg.svd(self.rows * scale)
        free = vt[len(self.rest) :]
        of_mass = float(np.linalg.cond(free @ (self.mass * np.outer(scale, scale)) @ free.T))
        lengths = np.linalg.norm(self.rows, axis=1)[:, None]
        return of_mass, float(np.linalg.cond(self.rows / lengths)) if len(lengths) else 1.0


def compare(mechanism: Any, path: Path) -> Compared:
    """At the position in which the loops close, all free motions with speeds."""
    if mechanism.couplings:
        raise Incomparable("it has couplings")
    compiled = mechanism.compile()
    names = list(compiled.velocity_names)
    start = compiled.at(mechanism.assemble().q)
    rng = np.random.default_rng(7)
    rates = {names[i]: float(rng.normal()) for i in start.independent}
    state = mechanism.assemble(rates=rates)
    here = compiled.at(state.q, state.v)
    kept = list(here.rows)
    own = Equations(here.M, here.h, here.C[kept], here.b[kept], here.vdot)
    other = _Pinocchio(mechanism, path, state)
    theirs = other.equations(np.array(mechanism.gravity))
    common = {name: (names.index(name), column) for name, column in other.single.items() if name in names}
    if not common:
        raise Incomparable("no joint of one degree of freedom in common")
    ours, its = ([pair[k] for pair in common.values()] for k in (0, 1))
    speeds = float(np.max(np.abs(np.asarray(state.v)[ours] - other.v[its])))
    if speeds > PLACED * 1e3 * float(np.max(np.abs(state.v))):
        raise Incomparable(f"joints have other speeds there, by {speeds:.1e}")
    a, b = own.exact()[ours], theirs.exact()[its]
    size = float(max(np.max(np.abs(b)), np.max(np.abs(other.v[its]))))
    return Compared(
        float(np.max(np.abs(own.found[ours] - theirs.found[its]))) / size,
        float(np.max(np.abs(a - b))) / size,
        float(np.max(np.abs(own.found[ours] - a))) / size,
        float(np.max(np.abs(theirs.found[its] - b))) / size,
        *own.conditions(),
    )


class _Pinocchio:
    """The robot in Pinocchio, in the position and with the velocities of our bodies."""

    def __init__(self, mechanism: Any, path: Path, state: Any) -> None:
        import pinocchio as pin
        import yaml  # that of a robot with loops beside its URDF

        self.pin = pin
        beside = path.with_suffix(".yaml")
        listed = (yaml.safe_load(beside.read_text("utf-8")) or {}) if beside.is_file() else {}
        types = dict(zip(listed.get("joint_name") or [], listed.get("joint_type") or [], strict=True))
        try:
            untyped = pin.buildModelFromUrdf(str(path))
        except (ValueError, RuntimeError) as error:
            raise Incomparable(str(error)) from error
        self.model = self.typed(untyped, types)
        self.data = self.model.createData()
        pairs = listed.get("closed_loop") or []
        self.loops = list(zip(pairs, listed.get("type") or ["6d"] * len(pairs), strict=True))
        run = mechanism.simulate(1e-9, t_eval=[0.0, 1e-9], initial=state)
        frames = {frame.name: i for i, frame in enumerate(self.model.frames) if frame.type == pin.FrameType.BODY}
        bodies = [name for name in mechanism.bodies if name in frames]
        self.frames = [frames[name] for name in bodies]
        moving = [run.body(name) for name in bodies]
        self.q = self.placed([pin.SE3(body.rotation[0], body.position[0]) for body in moving])
        twists = np.concatenate([np.concatenate([body.velocity[0], body.angular_velocity[0]]) for body in moving])
        jacobian = np.vstack([self.jacobian(frame) for frame in self.frames])
        self.v = np.linalg.lstsq(jacobian, twists, rcond=None)[0]
        joints = zip(self.model.names, self.model.joints, strict=True)
        self.single = {name: joint.idx_v for name, joint in joints if joint.nv == 1}

    def typed(self, model: Any, types: dict[str, str]) -> Any:
        """The model with joints of other types."""
        pin, new, fixed = self.pin, self.pin.Model(), []
        new.name = model.name
        turns = {"X": pin.JointModelRX, "Y": pin.JointModelRY, "Z": pin.JointModelRZ}
        ids = {0: 0}
        for i in range(1, model.njoints):
            name, placement, joint = model.names[i], model.jointPlacements[i], model.joints[i]
            parent, kind = ids[model.parents[i]], types.get(name, "").upper()
            if kind.startswith("UJOINT_"):
                parent = new.addJoint(parent, turns[kind[-2]](), placement, f"{name} first")
                name, joint, placement = f"{name} second", turns[kind[-1]](), pin.SE3.Identity()
            elif kind == "SPHERICAL":
                joint = pin.JointModelSpherical()
            ids[i] = new.addJoint(parent, joint, placement, name)
            new.appendBodyToJoint(ids[i], model.inertias[i], pin.SE3.Identity())
            fixed += [ids[i]] if kind == "FIXED" else []
        for frame in list(model.frames)[1:]:
            parent_frame = 0
            new.addFrame(
                pin.Frame(frame.name, ids[frame.parentJoint], parent_frame, frame.placement, frame.type), False
            )
        return pin.buildReducedModel(new, fixed, pin.neutral(new)) if fixed else new

    def jacobian(self, frame: int) -> Array:
        """Velocity of the frame's origin and angular velocity, in world axes."""
        axes = self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.asarray(self.pin.computeFrameJacobian(self.model, self.data, self.q, frame, axes))

    def placed(self, poses: list[Any]) -> Array:
        """The position in which bodies stand in these poses, by Gauss-Newton."""
        pin = self.pin
        self.q = pin.neutral(self.model)
        best = np.inf
        for _ in range(200):
            pin.framesForwardKinematics(self.model, self.data, self.q)
            apart, rows = [], []
            for frame, pose in zip(self.frames, poses, strict=True):
                at = self.data.oMf[frame]
                turn = pose.rotation @ pin.log3(at.rotation.T @ pose.rotation)
                apart += [pose.translation - at.translation, turn]
                rows.append(self.jacobian(frame))
            error, whole = np.concatenate(apart), np.vstack(rows)
            size = float(np.max(np.abs(error)))
            if size >= 0.5 * best and size < PLACED:
                return np.asarray(self.q)
            best = min(best, size)
            damping = 1e-6 * min(1.0, size) * np.eye(self.model.nv)
            step = (
                np.linalg.solve(whole.T @ whole + damping, whole.T @ error)
                if size > 1e-6
                else (np.linalg.lstsq(whole, error, rcond=None)[0])
            )
            self.q = pin.integrate(self.model, self.q, step * min(1.0, 0.5 / float(np.max(np.abs(step)))))
        raise Incomparable(f"bodies stand elsewhere, by {best:.1e}")

    def equations(self, gravity: Array) -> Equations:
        """At this position and velocity, with the accelerations by an orthogonal basis of the free motions."""
        pin, model, data = self.pin, self.model, self.data
        model.gravity.linear = gravity
        mass = pin.crba(model, data, self.q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        force = -np.array(pin.nonLinearEffects(model, data, self.q, self.v)) - np.array(model.damping) * self.v
        pin.forwardKinematics(model, data, self.q, self.v, np.zeros(model.nv))
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        rows, rest = [np.zeros((0, model.nv))], [np.zeros(0)]
        for pair, kind in self.loops:
            one, other = (model.getFrameId(name) for name in pair)
            count = 3 if str(kind).lower() == "3d" else 6
            drift = [pin.getFrameClassicalAcceleration(model, data, frame, axes).vector for frame in (one, other)]
            rest.append(np.array(drift[0] - drift[1])[:count])
            rows.append((self.jacobian(one) - self.jacobian(other))[:count])
        whole, right = np.vstack(rows), np.concatenate(rest)
        kept = _independent(whole)
        whole, right = whole[kept], right[kept]
        return Equations(mass, force, whole, right, self.accelerations())

    def accelerations(self) -> Array:
        """By Pinocchio's own constrained dynamics, without correction of errors of position."""
        pin, model, data = self.pin, self.model, self.model.createData()
        effort = -np.array(model.damping) * self.v
        constraints, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for pair, kind in self.loops:
            one, other = (model.frames[model.getFrameId(name)] for name in pair)
            word = pin.ContactType.CONTACT_3D if str(kind).lower() == "3d" else pin.ContactType.CONTACT_6D
            ends = (one.parentJoint, one.placement, other.parentJoint, other.placement)
            constraints.append(pin.RigidConstraintModel(word, model, *ends, pin.ReferenceFrame.LOCAL))
        for constraint in constraints:
            datas.append(constraint.createData())
        settings = pin.ProximalSettings(*PROXIMAL)
        pin.initConstraintDynamics(model, data, constraints, datas)
        pin.constraintDynamics(model, data, self.q, self.v, effort, constraints, datas, settings)
        return np.array(data.ddq)


def _independent(rows: Array) -> list[int]:
    """Rows of full rank, chosen by pivoting."""
    left, kept = np.array(rows), list[int]()
    first = float(np.max(np.linalg.norm(left, axis=1))) if len(left) else 0.0
    while len(kept) < min(rows.shape):
        lengths = np.linalg.norm(left, axis=1)
        i = int(np.argmax(lengths))
        if lengths[i] <= RANK * first:
            break
        unit = left[i] / lengths[i]
        left -= np.outer(left @ unit, unit)
        left -= np.outer(left @ unit, unit)
        kept.append(i)
    return sorted(kept)
