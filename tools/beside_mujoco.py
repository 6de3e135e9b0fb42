"""`python tools/beside_mujoco.py`: a four-bar by Partita and by MuJoCo, the table of docs/others.md."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import mujoco
import numpy as np

import partita as pt
from partita.results import Result

SECONDS = 10.0
EVERY = 0.01  # outputs are compared so often [s]
STEPS = (2e-3, 1e-4)
STIFF = (0.9999, 0.99999, 1e-6, 0.5, 2.0)  # solimp


def main() -> None:
    """Run both and print the rows."""
    m = pt.catalogue.load("four-bar")
    start = m.assemble(rates={"A": 2.0})
    t = np.linspace(0.0, SECONDS, round(SECONDS / EVERY) + 1)
    began = perf_counter()
    run = m.simulate(SECONDS, initial=start, rtol=1e-10, atol=1e-12, t_eval=t)
    print(f"Partita: loop open by {run.certificate.closure:.1e} m, {perf_counter() - began:.2f} s")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "four-bar.mjcf"
        m.save(path)
        for step in STEPS:
            for stiff in (False, True):
                began = perf_counter()
                opening, error = beside(path, run, step, stiff)
                print(
                    f"MuJoCo, {1e3 * step:g} ms, {'stiff' if stiff else 'as delivered'}: loop open by {opening:.1e} m, "
                    f"crank off by {error:.1e} rad, {perf_counter() - began:.2f} s"
                )


def beside(path: Path, run: Result, step: float, stiff: bool) -> tuple[float, float]:
    """Largest opening of the loop [m] and largest difference of the crank's angle [rad] at the outputs of `run`."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = step
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    if stiff:
        model.eq_solref[:] = (2 * step, 1.0)
        model.eq_solimp[:] = STIFF
    data = mujoco.MjData(model)
    names = [model.joint(i).name for i in range(model.njnt)]
    data.qvel[:] = [run.joint(name).velocity[0, 0] for name in names]
    crank = names.index("A")
    opening, error = 0.0, 0.0
    for angle in run.joint("A").position[1:, 0]:
        mujoco.mj_step(model, data, nstep=round(EVERY / step))
        opening = max(opening, float(np.abs(data.efc_pos[: data.ne]).max()))
        error = max(error, abs(float(data.qpos[crank] - angle)))
    return opening, error


if __name__ == "__main__":
    main()
