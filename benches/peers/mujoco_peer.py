"""MuJoCo: hinges in a tree, loops by `connect` as stiff as the step allows, RK4; a run is one call (rollout)."""

from __future__ import annotations

import sys
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from planar import Pin, Problem, Tried, report, timed


def xml(p: Problem, step: float) -> str:
    """Bodies with their axes along the world's at the start; the plane is x, y."""

    def body(pin: Pin, at: np.ndarray) -> str:
        here = pin.point - at
        arm = p.centres[pin.child] - pin.point
        inside = "".join(body(x, pin.point) for x in p.tree if x.parent == pin.child)
        moment = p.inertias[pin.child]
        return (
            f'<body name="b{pin.child}" pos="{here[0]:.17g} {here[1]:.17g} 0"><joint name="j{pin.child}" axis="0 0 1"/>'
            f'<inertial pos="{arm[0]:.17g} {arm[1]:.17g} 0" mass="{p.masses[pin.child]:.17g}" '
            f'diaginertia="{moment / 2:.17g} {moment / 2:.17g} {moment:.17g}"/>{inside}</body>'
        )

    tree = "".join(body(pin, np.zeros(2)) for pin in p.tree if pin.parent < 0)
    points = {pin.child: pin.point for pin in p.tree}
    loops = ""
    for pin in p.loops:
        x, y = pin.point - points[pin.child]
        other = "world" if pin.parent < 0 else f"b{pin.parent}"
        loops += f'<connect body1="b{pin.child}" body2="{other}" anchor="{x:.17g} {y:.17g} 0"/>'
    springs = ""
    sites = ""
    for k, s in enumerate(p.springs):
        x, y = s.point2 - points[s.body2]
        mark = f'<body name="b{s.body2}"'
        head, tail = tree.split(mark, 1)
        cut = tail.index(">") + 1
        tree = head + mark + tail[:cut] + f'<site name="s{k}" pos="{x:.17g} {y:.17g} 0"/>' + tail[cut:]
        sites += f'<site name="g{k}" pos="{s.point1[0]:.17g} {s.point1[1]:.17g} 0"/>'
        springs += (
            f'<spatial stiffness="{s.stiffness}" springlength="{s.length}"><site site="g{k}"/>'
            f'<site site="s{k}"/></spatial>'
        )
    tendon = f"<tendon>{springs}</tendon>" if springs else ""
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{step:.17g}" integrator="RK4" iterations="50" '
        f'tolerance="1e-14" gravity="{p.gravity[0]} {p.gravity[1]} 0"><flag contact="disable"/></option>'
        f'<default><equality solref="{2 * step:.17g} 1" solimp="0.9999 0.9999 0.001"/></default>'
        f"<worldbody>{sites}{tree}</worldbody><equality>{loops}</equality>{tendon}</mujoco>"
    )


def tried(p: Problem) -> list[Tried]:
    found = []
    between = p.times[1] - p.times[0]
    for per_output in (5, 20, 80, 320):
        model = mujoco.MjModel.from_xml_string(xml(p, between / per_output))
        data = mujoco.MjData(model)
        for pin in p.tree:
            data.joint(f"j{pin.child}").qvel = p.relative_rate(pin)
        for i, torque in p.torques.items():
            data.joint(f"j{i}").qfrc_applied = torque
        spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.zeros(mujoco.mj_stateSize(model, spec))
        mujoco.mj_getState(model, data, start, spec)
        steps = per_output * (len(p.times) - 1)
        applied = np.tile(data.qfrc_applied, (steps, 1))

        def call(model: Any = model, start: Any = start, applied: Any = applied, data: Any = data) -> Any:
            return rollout.rollout(
                model, data, start[None], applied[None], control_spec=mujoco.mjtState.mjSTATE_QFRC_APPLIED
            )[0]

        seconds, states = timed(call)
        first = model.joint(f"j{0}").qposadr[0]
        found.append(Tried(f"RK4, {steps} steps", seconds, p.error(p.angles[0] + float(states[0, -1, 1 + first]))))
    return found


if __name__ == "__main__":
    report(tried(Problem.read(sys.argv[1])), f"MuJoCo {mujoco.__version__}")
