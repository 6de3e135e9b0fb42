"""Files of robots by the programs that own or know their formats: MuJoCo (MJCF), Drake (SDFormat), Pinocchio (URDF).

`python tests/python/owners.py` compares with the programs that are installed; `--write` stores what they say, for tests
that run without them. Of each file: where its bodies are drawn, and the accelerations of its joints, in a position and
with speeds where the file has no loops, else at rest as drawn with the loops held exactly.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt

FILES = Path(__file__).parent / "format_files"
STORED = Path(__file__).parent / "format_reference.json"
SAME = 1e-9
"""Of accelerations, in parts of the largest, and of positions in m: files have some ten digits."""

Numbers = dict[str, list[float]]


def state(names: list[str], loops: bool) -> tuple[dict[str, float], dict[str, float]]:
    """Positions and speeds of joints of one coordinate."""
    positions = {name: (0.0 if loops else 0.3 * np.cos(1.0 + i)) for i, name in enumerate(sorted(names))}
    speeds = {name: (0.0 if loops else np.sin(2.0 + 3.0 * i)) for i, name in enumerate(sorted(names))}
    return positions, speeds


def partita(path: Path, joints: list[str], loops: bool) -> tuple[Numbers, Numbers]:
    """Poses as drawn, and accelerations, by Partita."""
    m = pt.load(path)
    poses = {
        body["name"]: [*body["position"], *np.ravel(m.bodies[body["name"]].orientation)]
        for body in m.to_spec()["bodies"]
    }
    if loops:
        run = m.simulate(1e-6, t_eval=[0.0, 1e-6], initial=m.assemble())
        return poses, {name: [float(run.joint(name).acceleration[0, 0])] for name in joints}
    model = m.compile()
    q, v = np.array(m.assemble().q), np.zeros(len(model.velocity_names))
    names = list(model.velocity_names)
    positions, speeds = state(joints, loops)
    # programs differ in the model to which a joint between two of them belongs
    at = {name: next(i for i, x in enumerate(names) if x.split("::")[-1] == name.split("::")[-1]) for name in joints}
    for name, i in at.items():
        q[model.names.index(names[i])], v[i] = positions[name], speeds[name]
    rates, _ = model.acceleration(q, v)
    return poses, {name: [float(rates[i])] for name, i in at.items()}


def by_mujoco(path: Path, loops: bool) -> tuple[Numbers, Numbers]:
    """MuJoCo's; equalities held exactly, by its mass matrix and its Jacobian."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    poses = {model.body(i).name: [*data.xpos[i], *data.xmat[i]] for i in range(1, model.nbody)}
    kinds = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    single = [i for i in range(model.njnt) if int(model.jnt_type[i]) in kinds]
    names = [model.joint(i).name for i in single]
    positions, speeds = state(names, loops)
    for i, name in zip(single, names, strict=True):
        data.qpos[model.jnt_qposadr[i]] += positions[name]
        data.qvel[model.jnt_dofadr[i]] = speeds[name]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass) if version("mujoco") >= "4" else mujoco.mj_fullM(model, mass, data.qM)
    forces = data.qfrc_passive - data.qfrc_bias
    rates = np.linalg.solve(mass, forces)
    if loops:
        rows = data.efc_J.reshape(-1, model.nv)[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)]
        inverse = np.linalg.solve(mass, rows.T)
        rates -= inverse @ np.linalg.lstsq(rows @ inverse, rows @ rates, rcond=1e-10)[0]
    return poses, {name: [float(rates[model.jnt_dofadr[i]])] for i, name in zip(single, names, strict=True)}


def by_drake(path: Path, loops: bool) -> tuple[Numbers, Numbers]:
    """Drake's, of joints of one coordinate; the others stand still as drawn."""
    import logging

    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ModelInstanceIndex

    logging.getLogger("drake").setLevel(logging.ERROR)
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().Add(FILES.name, str(FILES))
    parser.AddModels(str(path))
    plant.mutable_gravity_field().set_gravity_vector(pt.load(path).gravity)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    models = [ModelInstanceIndex(i) for i in range(2, plant.num_model_instances())]

    def called(item: Any) -> str:
        """Its name, in several models with that of its own."""
        own = plant.GetModelInstanceName(item.model_instance())
        return f"{own}::{item.name()}" if len(models) > 1 else item.name()

    poses: Numbers = {}
    for body in (plant.get_body(index) for model in models for index in plant.GetBodyIndices(model)):
        pose = plant.EvalBodyPoseInWorld(context, body)
        poses[called(body)] = [*pose.translation(), *np.ravel(pose.rotation().matrix())]
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    single = {called(x): x for x in joints if x.num_velocities() == 1 and x.type_name() != "screw"}
    positions, speeds = state(list(single), loops)
    q, v = plant.GetPositions(context).copy(), plant.GetVelocities(context).copy()
    for name, joint in single.items():
        q[joint.position_start()], v[joint.velocity_start()] = positions[name], speeds[name]
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    rates = plant.EvalTimeDerivatives(context).CopyToVector()[plant.num_positions() :]
    return poses, {name: [float(rates[joint.velocity_start()])] for name, joint in single.items()}


def by_pinocchio(path: Path, loops: bool) -> tuple[Numbers, Numbers]:
    """Pinocchio's, with the dampers of the file."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path))
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    q, v = pin.neutral(model), np.zeros(model.nv)
    pin.framesForwardKinematics(model, data, q)
    links = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    poses = {x.name: [*data.oMf[model.getFrameId(x.name)].translation,
                      *np.ravel(data.oMf[model.getFrameId(x.name)].rotation)] for x in links}  # fmt: skip
    names = list(model.names)[1:]
    positions, speeds = state(names, loops)
    for name in names:
        joint = model.joints[model.getJointId(name)]
        v[joint.idx_v] = speeds[name]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = np.cos(positions[name]), np.sin(positions[name])
        else:
            q[joint.idx_q] = positions[name]
    rates = pin.aba(model, data, q, v, -np.asarray(model.damping) * v)
    return poses, {name: [float(rates[model.joints[model.getJointId(name)].idx_v])] for name in names}


PROGRAMS: dict[str, tuple[str, str, Callable[[Path, bool], tuple[Numbers, Numbers]]]] = {
    ".mjcf": ("mujoco", "mujoco", by_mujoco),
    ".sdf": ("drake", "pydrake", by_drake),
    ".urdf": ("pin", "pinocchio", by_pinocchio),
}
CASES = {
    "dynamics.mjcf": False,
    "closed.mjcf": True,
    "compiler.mjcf": False,
    "inertia.mjcf": False,
    "disabled.mjcf": False,
    "unconstrained.mjcf": False,
    "dynamics.urdf": False,
    "dynamics-1.9.sdf": False,
    "machine-1.6.sdf": False,
    "machine-1.4.sdf": False,
    "nested-1.12.sdf": False,
}
"""Files whose motion is read in full, and whether they have loops."""


def asked(name: str) -> dict[str, Any]:
    """What the program that knows the format says of a file."""
    package, _, program = PROGRAMS[Path(name).suffix]
    poses, rates = program(FILES / name, CASES[name])
    return {"program": f"{package} {version(package)}", "poses": poses, "accelerations": rates}


def differences(name: str, answer: dict[str, Any]) -> tuple[float, float]:
    """By how much poses and accelerations of Partita differ from these."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        poses, rates = partita(FILES / name, list(answer["accelerations"]), CASES[name])
    apart = [np.abs(np.subtract(poses[body], pose)).max() for body, pose in answer["poses"].items() if body in poses]
    assert len(apart) > 1 or len(poses) < 3, (sorted(poses), sorted(answer["poses"]))
    largest = max(1.0, *(abs(x[0]) for x in answer["accelerations"].values()))
    off = [abs(rates[joint][0] - x[0]) / largest for joint, x in answer["accelerations"].items()]
    return float(max(apart)), float(max(off))


def main() -> None:
    """Compare, or store, what the programs say that are installed."""
    stored, wrong = json.loads(STORED.read_text("utf-8")) if STORED.exists() else {}, False
    for name in CASES:
        try:
            answer = asked(name)
        except ImportError as error:
            print(f"{name:<20} not compared: {error}")
            continue
        if "--write" in sys.argv:
            stored[name] = answer
        apart, off = differences(name, answer)
        wrong |= max(apart, off) > SAME
        print(f"{name:<20} {answer['program']:<14} poses {apart:.1e} m, accelerations {off:.1e}")
    if "--write" in sys.argv:
        STORED.write_text(json.dumps(stored, indent=1) + "\n", "utf-8")
    sys.exit(wrong)


if __name__ == "__main__":
    main()
