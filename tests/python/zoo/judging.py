"""One mechanism of the zoo: theory, the independent program and Partita side by side."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from oracle.comparison import Verdict, frames_of, look
from oracle.drawing import Array, Drawing
from oracle.maximal import Maximal, Pose
from oracle.reading import drawing_of

import partita as pt
from partita.catalogue import Truth
from partita.results import Result

# A self-stress has a part in a component above the first and none below the second.
LOADED, UNLOADED = 1e-6, 1e-10
AGREED = 1e-7
"""Accelerations and reactions of the two programs, over the largest of them."""


@dataclass
class Judged:
    """What was wrong, in words, the largest differences, and until when paths were compared [s]."""

    name: str
    wrong: list[str] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)
    until: float | None = None


def judge(name: str, result: Result, given: Truth | None = None) -> Judged:
    """A run of the mechanism `name` in relative coordinates at all its outputs; `given`: the truth, if not its own."""
    entry = pt.catalogue.entry(name)
    truth, mechanism, found = given or entry.truth, entry.mechanism(), Judged(name)
    assert truth is not None
    if not result.success:
        found.wrong.append(f"{result.status}: {result.message}")
    drawing = drawing_of(mechanism)
    program = Maximal(drawing, frames_of(drawing, result))
    for i, t in enumerate(result.t):
        against_theory(found, program, truth, drawing, result, i, float(t))
    verdict = Verdict()
    look(drawing, mechanism, result, "relative", verdict, np.random.default_rng(0))
    found.wrong += verdict.wrong
    found.wrong += [f"{what}: {n}" for what, n in verdict.counts.items() if what.startswith(("unclear", "marked"))]
    found.worst = {
        what: verdict.worst[what] for what in ("acceleration", "reaction", "effort") if what in verdict.worst
    }
    found.wrong += [f"{what} off by {off:.1e}" for what, off in found.worst.items() if not off <= AGREED]
    return found


def against_theory(
    found: Judged, program: Maximal, truth: Truth, drawing: Drawing, result: Result, i: int, t: float
) -> None:
    """What the independent program finds at one output, against what was written down."""
    poses = poses_at(drawing, result, i)
    at = program.at(t, poses)
    if (at.mobility, at.redundant) != (truth.mobility, truth.redundant):
        found.wrong.append(f"t = {t:g}: theory says {truth.mobility} degrees of freedom, {truth.redundant} redundant "
                           f"conditions, the independent program {at.mobility} and {at.redundant}")  # fmt: skip
    turns = result.at_once.reactions["joint_rotation"][i]
    for k, joint in enumerate(drawing.joints):
        turn = turns[k] if truth.axes == "joint" else np.eye(3)
        touched = np.concatenate([parts(at.stress_force[joint.name], turn), parts(at.stress_moment[joint.name], turn)])
        if np.any((touched > UNLOADED) & (touched < LOADED)):
            found.wrong.append(f"t = {t:g}, joint {joint.name}: a self-stress hardly loads it, {touched}")
        elif not np.array_equal(touched <= UNLOADED, truth.flags(joint.name)):
            found.wrong.append(f"t = {t:g}, joint {joint.name}: parts of the self-stresses {touched}, theory says "
                               f"{truth.flags(joint.name)}")  # fmt: skip
    for group in truth.idle:
        if (free := program.motions_of(poses, group.split(" + "))) != 1:
            found.wrong.append(f"t = {t:g}: {group} can move by itself in {free} ways instead of one")


def poses_at(drawing: Drawing, result: Result, i: int) -> dict[str, Pose]:
    """Where the bodies are at an output, and how they move."""
    seen = {b.name: result.body(b.name) for b in drawing.bodies}
    return {name: Pose(b.position[i], b.rotation[i], b.velocity[i], b.angular_velocity[i]) for name, b in seen.items()}


def parts(stresses: Array, turn: Array) -> Array:
    """(3,): the largest part that any self-stress has along the columns of `turn`."""
    return np.abs(stresses @ turn).max(axis=0, initial=0.0)
