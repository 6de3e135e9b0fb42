"""FMUs of mechanisms drawn by chance, stepped by their C functions, against runs of the same mechanisms.

What a run computes is held against the independent program elsewhere; here an FMU has to say the same.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import partita as pt
from partita.io.fmu_description import VERSIONS

from . import elements
from .comparison import Verdict, moving
from .drawing import Drawing, Load, TableDrive, Torque
from .slave import Instance

STEPS = 3
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
SAME = 1e-6
"""Of two runs of such tolerances over a short time, over the largest value of each output."""
NOTHING = 1e-6
"""Smaller displacements and rates, of the size of the drawing and per its time, are measured by these."""


def mechanism(seed: int) -> Drawing:
    """That of a number without Python functions, which an FMU cannot hold."""
    d = elements.mechanism(seed)
    joints = tuple(replace(j, kind="generic", free=j.moving, follows=()) if j.follows else j for j in d.joints)
    forces = tuple(replace(f, swing=0.0) if isinstance(f, Load) else f for f in d.forces)
    couplings = tuple(c for c in d.couplings if c.kind == "cam")
    drives = tuple(x for x in d.drives if isinstance(x, TableDrive))
    return replace(d, joints=joints, forces=forces, couplings=couplings, drives=drives)


def compare_fmu(seed: int, folder: Path) -> Verdict:
    """A few communication steps, with a torque that changes from one to the next where there is one."""
    verdict, d = Verdict(), mechanism(seed)
    m, rng = d.build(), np.random.default_rng(seed)
    ends = (0.05, 0.1, 0.3)[seed % 3] * d.time * np.linspace(0.0, 1.0, STEPS + 1)
    moved = [j.name for j in d.joints if j.coordinates[1]]
    outputs = [*moved, *(f"{j.name}.{part}" for j in d.joints for part in ("force", "moment")), "energy"]
    try:
        state = moving(m, d, rng)
        # about a joint that closes a loop a torque has no potential
        tree = {j["name"] for j in m.compile().summary["joints"] if j["tree"]}
        torque = next((f for f in d.forces if isinstance(f, Torque) and f.joint in tree), None)
        version = str(np.random.default_rng((seed, len(VERSIONS))).choice(VERSIONS))
        m.to_fmu(folder / "it.fmu", [torque.name] if torque else [], outputs, initial=state, version=version, **TIGHT)
    except pt.errors.PartitaError as error:
        verdict.counts[f"refused: {type(error).__name__}"] += 1
        return verdict
    one = Instance(folder / "it.fmu", folder / "unpacked")
    try:
        one.begin()
        for k in range(STEPS):
            begin, end = float(ends[k]), float(ends[k + 1])
            value = 0.0 if torque is None else torque.value * float(rng.uniform(-1.0, 1.0))
            try:
                run = m.simulate(end - begin, t_eval=[begin, end], initial=state, max_steps=2000, **TIGHT,
                                 parameters={f"{torque.name}.value": value} if torque else None)  # fmt: skip
            except pt.errors.PartitaError as error:
                verdict.counts[f"run refused: {type(error).__name__}"] += 1
                return verdict
            if torque is not None:
                assert one.set(one.references[torque.name], value) == 0
            stepped = one.step(begin, end - begin) == 0
            if stepped != run.success:
                why = run.message if stepped else one.messages[-1:]
                verdict.wrong.append(f"step {k}: the FMU {'steps' if stepped else 'does not step'}, the run says {why}")
            if not (stepped and run.success):
                verdict.counts["stopped"] += 1
                return verdict
            verdict.counts["steps"] += 1
            look(one, d, run, torque, value, verdict, f"step {k}")
            state = run.state()
    finally:
        one.free()
    verdict.counts["FMUs"] += 1
    verdict.counts[f"FMI {version}"] += 1
    return verdict


def look(
    one: Instance, d: Drawing, run: Any, torque: Torque | None, value: float, verdict: Verdict, words: str
) -> None:
    """Every output at the end of a step, over the largest of its kind at both ends; loads over those of all joints."""
    joints = {j.name: j for j in d.joints}
    largest = max(max(np.abs(x.force).max(), np.abs(x.moment).max() / d.size) for x in map(run.joint, joints))
    names = [name for name in one.references if "." in name]
    mine = dict(zip(names, one.get(*(one.references[name] for name in names)), strict=True))
    for name, found in mine.items():
        owner, part, *component = name.split(".")
        if owner == "energy":
            of = getattr(run.energy, part)
            scale = float(np.abs([run.energy.kinetic, run.energy.potential]).max())
            # a constant torque has a potential, one that is an input does work
            theirs = float(of[-1])
            if part == "potential" and torque is not None:
                scalar = torque.coordinate < joints[torque.joint].coordinates[0]
                theirs += value * float(run.joint(torque.joint).position[-1, torque.coordinate]) if scalar else 0.0
        else:
            whole = getattr(run.joint(owner), part)
            i = (
                "xyz".index(component[0])
                if component and component[0] in "xyz"
                else int(component[0])
                if component
                else 0
            )
            theirs, scale = float(whole[-1, i]), float(np.abs(whole).max())
            scale = {"force": largest, "moment": largest * d.size}.get(part, scale)
            # what does not move is zero to rounding alone
            still = {"position": NOTHING * min(d.size, 1.0), "velocity": NOTHING * min(d.size, 1.0) / d.time}
            scale = max(scale, still.get(part, 0.0))
        verdict.seen(f"FMU {part}", abs(found - theirs) / max(scale, 1e-300), SAME, f"{words}, {name}")
