"""A case against its truth, in both kinds of coordinates."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

import partita as pt

from .drawing import Drawing
from .program import Program

Array = NDArray[np.float64]
BOTH = ("relative", "absolute")
FACTOR = 30.0
"""A motion may differ from the exact one by so many times the error of the drawing, in links a third of the size; in
shorter ones a point's error is a larger angle."""


@dataclass(frozen=True)
class Case:
    """What is drawn, what that means, and what must come out."""

    name: str
    drawn: Drawing
    true: Drawing
    """Moves as it should, bodies as in `drawn`; may have other closings."""
    mobility: int
    """The mobility that model and report must give; the null directions of `true`."""
    structure: bool = False
    """It must not move, and the report must say so."""
    may_refuse: bool = False
    """A refusal by name is as right as a right motion."""
    rates: dict[str, float] = field(default_factory=dict)
    span: float = 0.2
    error: float = 0.0
    """Of the drawing, in parts of its size and in radians."""
    tolerance: float = 3e-6
    """Of positions in parts of the size and of directions, where the drawing is exact."""
    clear: bool = False
    """The span ends before the motion comes to a singular position."""
    by_energy: bool = False
    """One degree of freedom, no path needed: closure and energy determine the motion. For large ones."""


@dataclass
class Outcome:
    """How a case came out in one kind of coordinates: "right", "refused", "must run" (it was refused),
    "unnamed" (refused, but no joint is named) or "wrong"."""

    verdict: str
    words: str
    seconds: float = 0.0
    difference: float = 0.0


def times(case: Case) -> Array:
    """The first after a millisecond: velocities there are accelerations at the start."""
    return np.concatenate([[0.0, 1e-3], np.linspace(0.0, case.span, 6)[1:]])


def judge(case: Case) -> dict[str, Outcome]:
    program = Program(case.true)
    truth = None
    if not case.structure and not case.by_energy:
        if case.clear:
            case = replace(case, span=max(0.8 * program.clear(case.span, case.mobility, case.rates), 2e-3))
        truth = program.motion(times(case), case.mobility, case.rates)
    return {coordinates: outcome(case, coordinates, program, truth) for coordinates in BOTH}


def outcome(case: Case, coordinates: str, program: Program, truth: tuple[Array, Array, Array] | None) -> Outcome:
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = _outcome(case, coordinates, program, truth)
    found.seconds = time.process_time() - began
    return found


def _outcome(case: Case, coordinates: str, program: Program, truth: tuple[Array, Array, Array] | None) -> Outcome:
    m = case.drawn.mechanism(case.name)
    faults: list[str] = []
    try:
        of_model = m.compile(coordinates=coordinates).mobility
        report = m.report(coordinates=coordinates)
        reported = report.to_dict()["mobility"]
    except pt.errors.PartitaError as error:
        return refusal(case, faults, f"{type(error).__name__}: {error}")
    if of_model != case.mobility:
        faults.append(f"mobility {of_model}, truth {case.mobility}")
    if reported != of_model:
        faults.append(f"report {reported}, model {of_model}")
    if case.structure:
        words = str(report)
        if not any(j.name in words for j in case.drawn.joints):
            faults.append("the report names no joint")
        return Outcome("wrong" if faults else "right", "; ".join(faults))
    try:
        start = m.assemble(coordinates=coordinates, rates=case.rates or None)
        run = m.simulate(case.span, t_eval=times(case), initial=start, coordinates=coordinates)
        verdict = run.certificate.verdict
        if not run.success or verdict != "valid":
            return refusal(case, faults, " ".join([str(run.message), verdict, *map(str, run.certificate.findings)]))
        difference = compare(case, run, program, truth, faults)
        if case.error or case.may_refuse:
            stepped(case, m, start, run, coordinates, faults)
    except pt.errors.PartitaError as error:
        return refusal(case, faults, f"{type(error).__name__}: {error}")
    return Outcome("wrong" if faults else "right", "; ".join(faults)[:300], difference=difference)


def refusal(case: Case, faults: list[str], words: str) -> Outcome:
    """Counts as right where a refusal is allowed and names a joint; earlier findings are listed with it."""
    verdict = "refused" if case.may_refuse or case.structure else "must run"
    if not any(j.name in words for j in case.drawn.joints):
        verdict, faults = "unnamed", [*faults, "names no joint"]
    return Outcome(verdict, "; ".join([*faults, words])[:220])


def poses(case: Case, run: pt.Result) -> tuple[Array, Array, Array]:
    parts = [run.body(body.name) for body in case.drawn.bodies]
    x = np.stack([p.position for p in parts], axis=1)
    r = np.stack([p.rotation for p in parts], axis=1)
    v = np.stack([np.hstack([p.velocity, p.angular_velocity]) for p in parts], axis=1)
    return x, r, v.reshape(len(x), -1)


def compare(
    case: Case, run: pt.Result, program: Program, truth: tuple[Array, Array, Array] | None, faults: list[str]
) -> float:
    """Adds what differs from the true motion; returns the largest difference of places over the allowed one."""
    size = case.drawn.size()
    factor = FACTOR * max(1.0, case.true.extent() / 3.0)
    allowed = case.tolerance + factor * case.error
    x, r, v = poses(case, run)
    if len(x) != len(times(case)):
        faults.append(f"{len(x)} outputs of {len(times(case))}")
        return np.inf
    worst = 0.0
    for i in range(len(x)):
        phi, c, _ = program.closing(x[i], r[i])
        worst = max(worst, np.abs(phi).max() / max(size, 1.0) / allowed)
        fast = max(1.0, float(np.abs(v[i]).max()))
        worst = max(worst, np.abs(c @ v[i]).max() / max(size, 1.0) / fast / allowed)
    if worst > 1.0:
        faults.append(f"open by {worst:.1e} of what is allowed")
    if truth is None:
        energies = np.array([program.energy(x[i], r[i], v[i]) for i in range(len(x))])
        swing = max(float(np.ptp(program.mass @ (x @ program.drawing.gravity).T)), abs(energies[0]) * 1e-3, 1e-6)
        if np.ptp(energies) > (1e-5 + FACTOR * case.error) * swing:
            faults.append(f"energy changes by {np.ptp(energies) / swing:.1e} of its parts")
        if np.abs(x[-1] - x[0]).max() < 1e-3 * size:
            faults.append("does not move")
        return worst
    positions = float(np.abs(x - truth[0]).max()) / size
    turns = float(np.abs(r - truth[1]).max())
    for what, value in (("places", positions), ("directions", turns)):
        if value > allowed:
            faults.append(f"{what} off by {value:.1e}, allowed {allowed:.1e}")
    begun, true = v[1] - v[0], truth[2][1] - truth[2][0]
    scale = float(np.abs(true).max())
    # accelerations may be small: what gravity gives in a millisecond is the least to compare with
    share = float(np.abs(begun - true).max()) / max(scale, 1e-3)
    if share > 1e-3 + 10.0 * factor * case.error:
        faults.append(f"accelerations off by {share:.1e}")
    return max(worst, positions / allowed, turns / allowed)


def stepped(case: Case, m: pt.Mechanism, start: pt.State, run: pt.Result, coordinates: str, faults: list[str]) -> None:
    """The stepper must come to the same end."""
    ticks = 200
    stepper = m.stepper(case.span / ticks, initial=start, coordinates=coordinates)
    for _ in range(ticks):
        stepper.step()
    end = stepper.result()
    size = case.drawn.size()
    for body in case.drawn.bodies:
        here, there = end.body(body.name), run.body(body.name)
        apart = float(np.abs(here.position[-1] - there.position[-1]).max()) / size
        apart = max(apart, float(np.abs(here.rotation[-1] - there.rotation[-1]).max()))
        if apart > 1e-6:
            faults.append(f"stepper and run differ by {apart:.1e} in {body.name}")
            return
