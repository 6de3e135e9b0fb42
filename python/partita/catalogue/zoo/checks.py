"""What must hold for every run of a mechanism whose truth is known."""

from __future__ import annotations

import numpy as np

from ...results import Result
from ..entry import Check
from ..truth import Truth


def checks(truth: Truth) -> tuple[Check, ...]:
    """The counts, the flags of the reactions, closed loops, conserved energy."""

    def counts(result: Result) -> float:
        rows, rank = result.summary["joint_rows"], result.summary["joint_rank"]
        return float(abs(result.summary["mobility"] - truth.mobility) + abs(rows - rank - truth.redundant))

    def judged(result: Result) -> float:
        joints = {name: result.joint(name).in_frame(truth.axes) for name in result.names.joints}
        return float(sum((joint.determined_at != truth.flags(name)).sum() for name, joint in joints.items()))

    return (
        Check("degrees of freedom and redundant constraints", 0.0, "whole numbers", counts),
        Check("reactions judged otherwise", 0.0, "whole numbers, over all components and outputs", judged),
        Check("closure over size", 1e-12, "round-off over the few joints of a loop", closure),
        Check("energy balance over rtol", 100.0, "errors of some thousand steps, some of them alike", energy),
    )


def size(result: Result) -> float:
    """Diagonal of the box around all joints and origins of bodies at the first output, or a radius that rolls [m]."""
    points = [result.joint(name).point[0] for name in result.names.joints]
    points += [result.body(name).position[0] for name in result.names.bodies]
    couplings = (result.spec or {}).get("couplings", [])
    radius = max((item["radius"] for item in couplings if item["kind"] == "roll"), default=0.0)
    return max(radius, float(np.linalg.norm(np.ptp(np.array(points), axis=0))))


def closure(result: Result) -> float:
    """Largest closure error over outputs and steps, as a fraction of the size; zero without loops."""
    open_by = max(float(result.closure.max(initial=0.0)), float(result.record.steps_open[0]))
    return open_by / size(result) if open_by > 0.0 else 0.0


def energy(result: Result) -> float:
    """Largest energy imbalance over the largest energy exchanged, as a multiple of the tolerance of the run."""
    return result.energy.relative_balance / float(result.record.options["rtol"])
