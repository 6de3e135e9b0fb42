"""Accelerations of trees by programs that read the same file: Pinocchio, Drake, MuJoCo. None is a dependency."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rates = dict[str, float]
"""Numbers by the names of joints of one degree of freedom."""


class Incomparable(Exception):
    """The other program does not read the file, or reads another mechanism by design."""


def pinocchio(path: Path, gravity: Array, rates: Rates) -> Rates:
    """URDF, its root standing; followers follow their leaders."""
    import pinocchio as pin

    try:
        model = pin.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError) as error:
        raise Incomparable(str(error)) from error
    model.gravity.linear = gravity
    joints = {name: model.joints[i] for i, name in enumerate(model.names) if i > 0 and model.joints[i].nv == 1}
    v = np.zeros(model.nv)
    for name, joint in joints.items():
        v[joint.idx_v] = rates.get(name, 0.0)
    found = pin.aba(model, model.createData(), pin.neutral(model), v, -np.array(model.damping) * v)
    return {name: float(found[joint.idx_v]) for name, joint in joints.items()}


def drake(path: Path, gravity: Array, rates: Rates) -> Rates:
    """SDFormat of one model."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    try:
        Parser(plant).AddModels(str(path))
        plant.mutable_gravity_field().set_gravity_vector(gravity)
        plant.Finalize()
    except RuntimeError as error:
        raise Incomparable(str(error)) from error
    context = plant.CreateDefaultContext()
    joints = {joint.name(): joint for joint in map(plant.get_joint, plant.GetJointIndices())}
    single = {name: joint for name, joint in joints.items() if joint.num_velocities() == 1}
    v = np.zeros(plant.num_velocities())
    for name, joint in single.items():
        v[joint.velocity_start()] = rates.get(name, 0.0)
    plant.SetVelocities(context, v)
    found = plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
    return {name: float(found[joint.velocity_start()]) for name, joint in single.items()}


def mujoco(path: Path, gravity: Array, rates: Rates) -> Rates:
    """MJCF without equalities, contacts, limits, actuators and friction, which MuJoCo does not solve to round-off."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    flags = mujoco.mjtDisableBit
    for flag in (flags.mjDSBL_CONTACT, flags.mjDSBL_LIMIT, flags.mjDSBL_ACTUATION, flags.mjDSBL_FRICTIONLOSS):
        model.opt.disableflags |= flag
    if model.neq:
        raise Incomparable("its loops are held softly")
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    hinges = {
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j): int(model.jnt_dofadr[j])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in single
    }
    for name, column in hinges.items():
        data.qvel[column] = rates.get(name, 0.0)
    mujoco.mj_forward(model, data)
    return {name: float(data.qacc[column]) for name, column in hinges.items()}


OTHERS: dict[str, tuple[tuple[str, ...], Callable[[Path, Array, Rates], Rates]]] = {
    "pinocchio": ((".urdf",), pinocchio),
    "drake": ((".sdf",), drake),
    "mujoco": ((".mjcf", ".xml"), mujoco),
}
"""By name: suffixes of the files that it owns, and its accelerations."""


def difference(mechanism: Any, path: Path, other: str) -> float:
    """Largest difference of accelerations, in parts of the largest, all joints of one degree of freedom moving."""
    compiled = mechanism.compile()
    if compiled.mobility != len(compiled.velocity_names):
        raise Incomparable("it has loops or couplings")
    names = list(compiled.velocity_names)
    if any("::" in name for name in mechanism.bodies):
        raise Incomparable("names of nested models are not those of the other program")
    if not all(body.gravity for body in mechanism._description.bodies.values()):
        raise Incomparable("gravity does not act on all links, as it does in the other programs")
    rng = np.random.default_rng(7)
    rates = {name: float(rng.normal()) for name in names if name in mechanism.joints}
    state = mechanism.assemble()
    v = np.array([rates.get(name, 0.0) for name in names])
    own = dict(zip(names, compiled.acceleration(state.q, v)[0], strict=True))
    theirs = OTHERS[other][1](path, np.array(mechanism.gravity), rates)
    common = [name for name in theirs if name in rates]
    if not common:
        raise Incomparable("no joint of one degree of freedom in common")
    size = max(max(abs(theirs[name]) for name in common), max(map(abs, rates.values())))
    return max(abs(own[name] - theirs[name]) for name in common) / size
