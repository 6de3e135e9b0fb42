"""What must not matter, each compared with the reference of the case."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from oracle.chance import rotation
from oracle.comparison import Verdict as Compared
from oracle.comparison import frames_of, look
from oracle.drawing import Array
from oracle.forces import Contact, Stop

import partita as pt

from .case import between
from .independent import motion
from .judging import DRAWN_OFF, FALLS, MORE, OUTPUTS, TIGHT, Judged, crosses, finer, poses, run
from .loads import TableCourse, TableForce, TableTorque, is_function

Check = Callable[[Judged], None]
FINE = 1e-9
"""Tolerance of the independent program."""


def same(j: Judged, what: str, found: object, wanted: object, words: str) -> None:
    """To the last digit."""
    j.verdict.counts[what] += 1
    if not np.array_equal(np.asarray(found), np.asarray(wanted)):
        by = np.abs(np.asarray(found) - np.asarray(wanted)).max()
        j.verdict.wrong.append(f"{what}: {words}, off by {by:.2e}")


def outputs(j: Judged) -> None:
    """Their number changes no step, though last digits where one needs another order of elimination."""
    other = run(j.mechanism, j.case, j.start, j.case.times(23), **j.case.options)
    error = float(np.abs(poses(other, j.case)[-1] - poses(j.base, j.case)[-1]).max())
    j.verdict.seen("outputs", error, 1e-2 * j.allowed, f"{j.case.outputs} outputs and 23 end elsewhere")


def coordinates(j: Judged) -> None:
    """Relative or absolute."""
    mine = j.case.options.get("coordinates", "relative")
    other = {**j.case.options, "coordinates": "absolute" if mine == "relative" else "relative"}
    other.pop("formulation", None)
    found = run(j.mechanism, j.case, j.start, j.case.times(3), **other)
    # the zeros of repaired joints differ
    drawn = DRAWN_OFF * j.case.error * j.growth
    error = j.off(found)
    if j.allowed + drawn < error <= MORE * (j.allowed + drawn):
        left = j.off(run(j.mechanism, j.case, j.start, j.case.times(3), **{**other, **finer(j.case)}))
        if left <= max(error / FALLS, j.allowed + drawn):
            j.verdict.counts["coordinates: more than promised, and falls with the tolerance"] += 1
            return
    j.verdict.seen("coordinates", error, j.allowed + drawn, other["coordinates"])


def follows_errors(j: Judged, error: float) -> bool:
    """Whether the drawing with a hundredth of its errors moves as the exact one by so much less."""
    if not j.case.error:
        return False
    nearer = replace(j.case, drawing=between(j.case.exact, j.case.drawing, 0.01))
    exact = replace(j.case, drawing=j.case.exact)
    found = []
    for case in (nearer, exact):
        m = case.build()
        found.append(poses(run(m, case, case.start(m), case.times(OUTPUTS), max_step=case.finest, **TIGHT), case))
    return float(np.abs(found[0] - found[1]).max()) <= error / FALLS


def in_other_words(j: Judged, what: str, case: object, back: Callable[[Array], Array] | None = None) -> None:
    """A case that should move alike."""
    assert isinstance(case, type(j.case))
    m = case.build()
    found = run(m, case, case.start(m), case.times(OUTPUTS), **case.options)
    mine = poses(found, case)
    if back is not None:
        mine = back(mine)
    error = float(np.abs(mine - poses(j.reference, j.case)).max())
    # the same errors of a drawing may be parted in another way
    drawn = DRAWN_OFF * j.case.error * j.growth
    late = 4e-16 * abs(case.t0) * j.case.pace * 1e3
    if j.case.error and crosses(found):
        j.verdict.counts[f"{what}: crosses a singular position, inexact"] += 1
        return
    j.looked_closer(error)
    limit = j.allowed + drawn + late * j.growth
    if limit < error <= MORE * limit:
        options = {**j.case.options, **finer(j.case)}
        left = poses(run(m, case, case.start(m), case.times(OUTPUTS), **options), case)
        if back is not None:
            left = back(left)
        if np.abs(left - poses(j.reference, j.case)).max() <= max(error / FALLS, limit):
            j.verdict.counts[f"{what}: more than promised, and falls with the tolerance"] += 1
            return
    if limit < error <= MORE * limit and follows_errors(j, error):
        j.verdict.counts[f"{what}: more than the errors of the drawing, and falls with them"] += 1
        return
    j.verdict.seen(what, error, limit, f"growth {j.growth:.1f}")


def names(j: Judged) -> None:
    """Other names, in another order of the alphabet."""
    old = j.case.every_name
    new = {name: f"{chr(97 + int(j.rng.integers(26)))}{k}" for k, name in enumerate(old)}
    case = j.case.renamed(new)
    order = [sorted(b.name for b in case.drawing.bodies).index(new[name])
             for name in sorted(b.name for b in j.case.drawing.bodies)]  # fmt: skip

    def back(x: Array) -> Array:
        return x.reshape(len(x), -1, 18)[:, order].reshape(len(x), -1)

    in_other_words(j, "names", case, back)


def order(j: Judged) -> None:
    """Added in another order."""
    in_other_words(j, "order", j.case.shuffled(j.rng))


def place(j: Judged) -> None:
    """The whole elsewhere, in another attitude."""
    turn, by = rotation(j.rng), np.round(2.0 * j.rng.normal(size=3), 2)

    def back(x: Array) -> Array:
        parts = x.reshape(len(x), -1, 18)
        size = j.case.drawing.size
        at = (parts[..., :3] - by / size) @ turn
        attitude = (turn.T @ parts[..., 3:12].reshape(*parts.shape[:2], 3, 3)).reshape(*parts.shape[:2], 9)
        return np.concatenate([at, attitude, parts[..., 12:15] @ turn, parts[..., 15:] @ turn], axis=2).reshape(
            len(x), -1
        )

    in_other_words(j, "place", j.case.moved(turn, by), back)


def time(j: Judged) -> None:
    """All of it at another time."""
    in_other_words(j, "time", j.case.later(float(j.rng.choice(j.case.starts)) - j.case.t0))


def split(j: Judged) -> None:
    """Going on from the result at any instant."""
    part = float(j.rng.uniform(0.1, 0.9)) * j.case.duration
    middle = j.base.state(j.case.t0 + part)
    options = dict(j.case.options)
    found = run(j.mechanism, j.case, middle, [middle.t, j.case.t0 + j.case.duration], **options)
    j.verdict.seen("split", j.off(found, since=0.99 * j.case.duration), 2.0 * j.allowed, f"at {part:.6g} s")
    inside = j.reference.state(j.case.t0 + part)
    j.verdict.counts["state"] += 1
    for name in inside.names[:1]:
        assert name in middle.names or j.case.options.get("coordinates") == "absolute"


def file(j: Judged) -> None:
    """Saved and loaded: the same bits; and the result as well."""
    if not any(is_function(f) for f in (*j.case.drawing.forces, *j.case.drawing.drives)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "case.toml"
            j.mechanism.save(path)
            again = pt.load(path)
        found = run(again, j.case, j.case.start(again), j.case.times(j.case.outputs), **j.case.options)
        same(j, "file", found.q[-1], j.base.q[-1], "the mechanism of the file moves otherwise")
    again = pickle.loads(pickle.dumps(j.base))
    same(j, "pickle", poses(again, j.case), poses(j.base, j.case), "the pickled result differs")


def stepper(j: Judged) -> None:
    """Step by step; shorter steps come nearer."""
    # equal steps know nothing of corners: what they miss there falls by no rule, and later than elsewhere
    smooth = not any(isinstance(f, Stop | Contact | TableTorque | TableForce) for f in j.case.drawing.forces)
    near = (1e-4 if smooth else 1e-2) * j.growth
    errors: list[float] = []
    for steps in (1, 3) if smooth else (1, 3, 9, 27):
        length = j.case.duration / (OUTPUTS - 1)
        substeps = min(1000, steps * max(4, int(np.ceil(length / j.case.finest))))
        sim = j.mechanism.stepper(length, inputs=[], initial=j.start, method="dop853", substeps=substeps)
        for _ in range(OUTPUTS - 1):
            sim.step()
        found = sim.result()
        errors.append(float(np.abs(poses(found, j.case)[-1] - poses(j.reference, j.case)[-1]).max()))
        if errors[1:] and errors[-1] <= max(0.5 * errors[-2], near):
            break
    j.verdict.seen(
        "stepper", errors[-1], max(0.5 * errors[-2], near), f"{errors[-2]:.1e} before, growth {j.growth:.1f}"
    )


def ensemble(j: Judged) -> None:
    """Many at once."""
    starts = [j.start, j.case.start(j.mechanism, 1e-3), j.start]
    times = j.case.times(OUTPUTS)
    found = j.mechanism.ensemble(states=starts, t_eval=times, rtol=j.rtol, atol=j.rtol / 100.0, workers=1)
    j.verdict.counts["ensemble"] += 1
    if set(found.status) != {"finished"}:
        j.verdict.wrong.append(f"ensemble: {found.status}, though the case runs")
        return
    q, v = found.q[[0, 2], -1], found.v[[0, 2], -1]
    reference = j.reference
    if j.case.options.get("coordinates") == "absolute":  # which an ensemble has not
        reference = run(j.mechanism, j.case, j.start, times, max_step=j.case.finest, **TIGHT)
    scale = max(1.0, float(np.abs(reference.q[-1]).max())), max(j.case.pace, float(np.abs(reference.v[-1]).max()))
    off = max(np.abs(q - reference.q[-1]).max() / scale[0], np.abs(v - reference.v[-1]).max() / scale[1])
    j.verdict.seen("ensemble", float(off), j.allowed, f"growth {j.growth:.1f}")


def exact(j: Judged) -> None:
    """A drawing with small errors moves as the exact one."""
    if j.case.error:
        in_other_words(j, "exact", replace(j.case, drawing=j.case.exact))


def turns_over(j: Judged, found: pt.Result) -> bool:
    """Whether a joint turns by more than the independent program, which reads angles from poses, can tell."""
    hinges = [x.name for x in j.case.drawing.joints if x.kind in ("revolute", "cylindrical", "screw", "universal")]
    return any(float(np.abs(np.asarray(found.joint(name).position)).max()) > 3.0 for name in hinges)


def instants(j: Judged) -> None:
    """Accelerations, reactions and what of them is unique, by the independent program."""
    d = j.case.drawing
    if j.case.error or any(isinstance(x, TableCourse) for x in d.drives):
        return
    found = run(j.mechanism, j.case, j.start, j.case.times(3), **{**j.case.options, **TIGHT})
    if turns_over(j, found):
        return
    seen = Compared()
    look(d, j.mechanism, found, j.case.options.get("coordinates", "relative"), seen, j.rng)
    j.verdict.counts["instants"] += 1
    j.verdict.wrong += [f"instants: {line}" for line in seen.wrong[:3]]


def independent(j: Judged) -> None:
    """The motion, by the independent program, as far as a few dozen of its evaluations carry."""
    d = j.case.drawing
    if j.case.error or len(d.bodies) > 4 or any(isinstance(x, TableCourse) for x in d.drives):
        return
    if turns_over(j, j.reference):
        return
    frames = frames_of(d, j.reference)
    start = {b.name: j.reference.body(b.name) for b in d.bodies}
    reached = motion(d, frames, start, j.reference.t, FINE, j.case.finest)
    if reached is None:
        return
    k, mine = reached
    theirs = poses(j.reference, j.case)[k].reshape(-1, 18)
    size, pace = d.size, j.case.pace
    found = np.array([
        np.concatenate([p.x / size, p.rotation.ravel(), p.u / size / pace, p.w / pace])
        for p in (mine[name] for name in sorted(mine))
    ])  # fmt: skip
    j.verdict.seen("independent", float(np.abs(found - theirs).max()), 1e-5 * j.growth, f"at output {k}")


CHECKS: dict[str, Check] = {
    "outputs": outputs, "coordinates": coordinates, "names": names, "order": order, "place": place, "time": time,
    "split": split, "file": file, "stepper": stepper, "ensemble": ensemble, "exact": exact, "instants": instants,
    "independent": independent,
}  # fmt: skip
