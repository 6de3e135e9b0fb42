"""`python tools/beside_mujoco.py`: mechanisms by Partita and by MuJoCo, rows of docs/others.md."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from beside import BENNETT, EVERY, FOUR_BAR, Known, Reading, asked, reported

STEPS = (2e-3, 1e-4)
STIFF = (0.9999, 0.99999, 1e-6, 0.5, 2.0)  # solimp


def main() -> None:
    """Run and print."""
    print(f"MuJoCo {mujoco.__version__}")
    for known in asked("mechanisms by Partita and by MuJoCo", (FOUR_BAR, BENNETT)):
        for step in STEPS:
            for stiff in (False, True):
                settings = f"{'stiff' if stiff else 'as delivered'}, {1e3 * step:g} ms"
                reported(known, "MuJoCo", settings, partial(once, known, step, stiff))


def once(known: Known, step: float, stiff: bool, look: bool) -> list[Reading]:
    """One run, from the file that Partita writes."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mechanism.mjcf"
        known.mechanism.save(path)
        model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = step
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    if stiff:
        model.eq_solref[:] = (2 * step, 1.0)
        model.eq_solimp[:] = STIFF
    data = mujoco.MjData(model)
    for i in range(model.njnt):
        data.qpos[i], data.qvel[i] = (float(x[0, 0]) for x in moving(known, model.joint(i).name))
    mujoco.mj_forward(model, data)
    turns = {
        name: data.body(name).xmat.reshape(3, 3).T @ known.run.body(name).rotation[0] for name in known.mechanism.bodies
    }
    seen = []
    for i in range(len(known.run.t)):
        if i:
            mujoco.mj_step(model, data, nstep=round(EVERY / step))
        if look:
            mujoco.mj_forward(model, data)
            seen.append(shown(known, model, data, turns))
    return seen


def moving(known: Known, joint: str) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of a joint in Partita's run."""
    at = known.run.joint(joint)
    return at.position, at.velocity


def shown(known: Known, model: mujoco.MjModel, data: mujoco.MjData, turns: dict[str, np.ndarray]) -> Reading:
    """Bodies at a state; it gives no forces of joints."""
    bodies = {}
    for name, body in known.mechanism.bodies.items():
        at, speed = data.body(name), np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, at.id, speed, 0)
        rotation = at.xmat.reshape(3, 3) @ turns[name]
        bodies[name] = (at.xipos - rotation @ np.array(body.com), rotation, speed[3:], speed[:3])
    return Reading(bodies, {})


if __name__ == "__main__":
    main()
