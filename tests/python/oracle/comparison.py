"""Partita and the independent program side by side, on one drawing."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import partita as pt

from .drawing import GROUND, Array, Drawing
from .maximal import Maximal, Motion, Pose

# Two programs on matrices of conditions up to some 1e5; multipliers are one inverse further off than accelerations.
ACCELERATION, REACTION = 1e-8, 1e-7
# Powers need no inverse: products of positions and velocities.
POWER = 1e-9
# A direction of a self-stress exists above the first and does not below the second; in between it is undecided.
LOADED, UNLOADED = 1e-6, 1e-10
# Rounding of the poses that the independent program is given, of their sizes; how often it is asked with them rounded
# in another way; and how many times the change of its answers is allowed.
ROUNDED, ASKED, DOUBTED = 1e-15, 4, 10.0
OUTPUTS = 3


@dataclass(frozen=True)
class Allowed:
    """How far the programs may be apart."""

    acceleration: float = ACCELERATION
    reaction: float = REACTION


@dataclass
class Verdict:
    """What was wrong, in words, and what was counted."""

    wrong: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)

    def seen(self, what: str, error: float, limit: float, words: str) -> None:
        self.counts[what] += 1
        self.worst[what] = max(self.worst.get(what, 0.0), error)
        if not error <= limit:
            self.wrong.append(f"{words}: {what} off by {error:.2e} (allowed {limit:.0e})")

    def add(self, other: Verdict) -> None:
        self.wrong += other.wrong
        self.counts += other.counts
        for what, error in other.worst.items():
            self.worst[what] = max(self.worst.get(what, 0.0), error)


def compare(drawing: Drawing) -> Verdict:
    """Run the mechanism for a moment in both coordinates and compare what the outputs say."""
    verdict = Verdict()
    mechanism = drawing.build()
    for f in drawing.forces:
        mechanism.add_sensor(f"power of {f.name}", mechanism.forces[f.name], "power")
    rng = np.random.default_rng(drawing.seed)
    try:
        state = moving(mechanism, drawing, rng)
    except pt.errors.PartitaError as error:
        refused(drawing, error, verdict, "")
        return verdict
    for coordinates in ("relative", "absolute"):
        try:
            run = short_run(mechanism, drawing, state, coordinates)
        except pt.errors.PartitaError as error:
            refused(drawing, error, verdict, f"{coordinates} ")
            continue
        try:
            judge(drawing, mechanism, run, coordinates, verdict, rng)
        except pt.errors.PartitaError as error:
            verdict.wrong.append(f"{coordinates}: the run is there, but not what it is asked for: {error}")
    return verdict


def judge(drawing: Drawing, mechanism: pt.Mechanism, run: Any, coordinates: str, verdict: Verdict, rng: Any) -> None:
    """One run."""
    if drawing.drives and contradictory(drawing, run):
        verdict.counts["contradiction"] += 1
        verdict.counts["contradiction that succeeds"] += run.success
        if run.success:
            verdict.wrong.append(
                f"{coordinates}: the joints allow no motion at the rates of the drives, and the run succeeds"
            )
        return
    verdict.counts[f"{coordinates} {'run' if run.success else 'stopped'}"] += 1
    look(drawing, mechanism, run, coordinates, verdict, rng)


def contradictory(drawing: Drawing, run: Any) -> bool:
    """Whether the joints allow no velocities with the rates that the drives ask for at the start."""
    seen = {b.name: run.body(b.name) for b in drawing.bodies}
    still = {name: Pose(b.position[0], b.rotation[0], np.zeros(3), np.zeros(3)) for name, b in seen.items()}
    return Maximal(drawing, frames_of(drawing, run)).open_rate(still) > 1e-9


def refused(drawing: Drawing, error: Exception, verdict: Verdict, words: str) -> None:
    """Count a refusal, and whether the drawing contradicts itself, of those that are closed and whose conditions on
    coordinates are about axes that the drawing defines. One that can move must not be refused as contradictory."""
    verdict.counts[f"{words}refused: {type(error).__name__}"] += 1
    joints = {j.name: j for j in drawing.joints}
    terms = [x for c in drawing.couplings for x in c.data.get("terms", ()) if x["of"] == "joint"]
    asked = [joints[name] for name in (*(d.joint for d in drawing.drives), *(x["joint"] for x in terms))]
    if any(j.chooses for j in asked) or any(j.child_point is not None for j in drawing.joints):
        return
    start = Maximal(drawing, {j.name: j.some for j in drawing.joints}).start(1e-9)
    verdict.counts["contradiction"] += start == "contradicts"
    if start == "moves" and isinstance(error, pt.errors.ContradictionError | pt.errors.ArgumentError):
        verdict.wrong.append(f"{words}refused though it can start to move: {type(error).__name__}: {error}")


def frames_of(drawing: Drawing, run: Any) -> dict[str, Array]:
    """Axes of the joints in the drawing, read off the first output."""
    drawn = {b.name: b.rotation for b in drawing.bodies}
    found = {}
    for k, j in enumerate(drawing.joints):
        turned = np.eye(3) if j.parent == GROUND else run.body(j.parent).rotation[0] @ drawn[j.parent].T
        found[j.name] = turned.T @ run.at_once.reactions["joint_rotation"][0, k]
    return found


def moving(mechanism: pt.Mechanism, drawing: Drawing, rng: Any) -> pt.State:
    """The drawn position with chance velocities."""
    still = mechanism.assemble()
    model = mechanism.compile()
    if model.mobility == 0:
        return still
    here = model.at(still.q)
    # the same pace at every point: slides by lengths, turns by angles
    sizes = np.where(np.abs(here.M.diagonal()) > 0, np.sqrt(drawing.mass / np.maximum(here.M.diagonal(), 1e-300)), 1.0)
    pace = drawing.size / drawing.time
    rates = {model.velocity_names[i]: float(rng.uniform(-0.5, 0.5) * pace * sizes[i]) for i in here.independent}
    return mechanism.assemble(rates=rates, near=still)


def short_run(mechanism: pt.Mechanism, drawing: Drawing, state: pt.State, coordinates: str) -> pt.results.Result:
    """A few outputs, far enough apart that nothing is where it was drawn."""
    end = (0.05, 0.1, 0.3)[drawing.seed % 3] * drawing.time
    start = state if coordinates == "relative" else mechanism.convert(state, coordinates)
    return mechanism.simulate(
        end, t_eval=np.linspace(0.0, end, OUTPUTS), initial=start, rtol=1e-6,
        atol=1e-9 * min(1.0, drawing.size), coordinates=coordinates, max_steps=400,
    )  # fmt: skip


def look(drawing: Drawing, mechanism: pt.Mechanism, run: Any, coordinates: str, verdict: Verdict, rng: Any) -> None:
    """Every output of a run against the independent program."""
    if not len(run.t):
        return
    rotations = run.at_once.reactions["joint_rotation"]
    bodies = {b.name: run.body(b.name) for b in drawing.bodies}
    own = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    own *= np.linalg.det(own)
    joints = {j.name: run.joint(j.name) for j in drawing.joints}
    flags = {
        axes: {name: joint.in_frame(own if axes == "own" else axes).determined_at for name, joint in joints.items()}
        for axes in ("world", "joint", "own")
    }
    program = Maximal(drawing, frames_of(drawing, run))
    for i, t in enumerate(run.t):
        poses = {
            name: Pose(b.position[i], b.rotation[i], b.velocity[i], b.angular_velocity[i]) for name, b in bodies.items()
        }
        found = program.at(float(t), poses)
        words = f"{coordinates}, output {i}"
        if not run.success and max(found.gap, found.rate_error) > 1e-9:
            verdict.counts["stopped with open loops"] += 1
            continue
        # a run that says success has its loops closed
        verdict.seen("closure", found.gap, 1e-9, words)
        verdict.seen("closing rate", found.rate_error, 1e-8, words)
        if found.unclear:
            verdict.counts["unclear rank"] += 1
            continue
        if not np.all(np.isfinite(run.vdot[i])):
            verdict.counts["marked as not determined"] += 1
            continue
        if found.contradiction > 1e-7:
            verdict.wrong.append(f"{words}: the conditions contradict each other by {found.contradiction:.1e}")
            continue
        verdict.counts["instants"] += 1
        verdict.counts["redundant"] += found.redundant > 0
        seen = of_motion(drawing, mechanism, run, coordinates, i, poses, found, words, Allowed())
        if seen.wrong:
            # next to a singular position rounding alone moves the answers of the independent program
            allowed = certain(program, float(t), poses, found, drawing.size)
            seen = of_motion(drawing, mechanism, run, coordinates, i, poses, found, words, allowed)
            seen.counts["own rounding of the independent program"] += not seen.wrong
        verdict.add(seen)
        powers(drawing, mechanism, run, i, poses, found, verdict, words)
        for k, j in enumerate(drawing.joints):
            for axes, turn in (("world", np.eye(3)), ("joint", rotations[i, k]), ("own", own)):
                unique(found, j.name, flags[axes][j.name][i], turn, verdict, f"{words}, joint {j.name}, {axes} axes")


def certain(program: Maximal, t: float, poses: dict[str, Pose], found: Motion, size: float) -> Allowed:
    """How far the programs may be apart where the independent one is asked at poses that are rounded in other ways."""
    rng = np.random.default_rng(0)
    top = max([np.linalg.norm(a) for a, _ in found.acceleration.values()] + [1e-300])
    top = max([top] + [np.linalg.norm(alpha) * size for _, alpha in found.acceleration.values()])
    loads = [np.abs(f).max() for f in found.force.values()] + [np.abs(m).max() / size for m in found.moment.values()]
    load = max([found.largest, *loads])
    acceleration = reaction = 0.0
    for _ in range(ASKED):
        other = program.at(t, {name: rounded(p, size, rng) for name, p in poses.items()})
        for name, (a, alpha) in found.acceleration.items():
            b, beta = other.acceleration[name]
            acceleration = max(acceleration, np.abs(a - b).max() / top, np.abs(alpha - beta).max() * size / top)
        for name, force in found.force.items():
            free = untouched(found.stress_force[name]), untouched(found.stress_moment[name])
            reaction = max(reaction, np.abs(free[0] @ (force - other.force[name])).max() / load)
            reaction = max(reaction, np.abs(free[1] @ (found.moment[name] - other.moment[name])).max() / size / load)
        for name, effort in found.effort.items():
            if not found.shared[name]:
                # directions in a plane follow the pose continuously
                reaction = max(reaction, np.abs(effort - other.effort[name]).max() / load)
    return Allowed(max(ACCELERATION, DOUBTED * acceleration), max(REACTION, DOUBTED * reaction))


def rounded(p: Pose, size: float, rng: Any) -> Pose:
    """The pose with every number rounded in another way."""
    a, b, c = ROUNDED * rng.normal(size=3)
    turn = np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]])
    return Pose(p.x + ROUNDED * size * rng.normal(size=3), turn @ p.rotation, p.u, p.w)


def of_motion(
    drawing: Drawing, mechanism: pt.Mechanism, run: Any, coordinates: str, i: int, poses: dict[str, Pose],
    found: Motion, words: str, allowed: Allowed,
) -> Verdict:  # fmt: skip
    """Accelerations, reactions and efforts at one output."""
    verdict = Verdict()
    joints = {j.name: run.joint(j.name) for j in drawing.joints}
    accelerations(drawing, mechanism, run, coordinates, i, poses, found, verdict, words, allowed)
    reactions(drawing, joints, i, found, verdict, words, allowed)
    efforts(drawing, run, i, found, verdict, words, allowed)
    return verdict


def accelerations(
    drawing: Drawing, mechanism: pt.Mechanism, run: Any, coordinates: str, i: int, poses: dict[str, Pose],
    found: Motion, verdict: Verdict, words: str, allowed: Allowed,
) -> None:  # fmt: skip
    """v' against the accelerations of the bodies, over the largest of them."""
    size = drawing.size
    pace = [np.linalg.norm(p.w) ** 2 * size for p in poses.values()] + [float(np.linalg.norm(drawing.gravity))]
    pairs = found.acceleration.values()
    top = max([np.linalg.norm(a) for a, _ in pairs] + [np.linalg.norm(x) * size for _, x in pairs] + pace)
    # where nothing moves though forces act, what they would do to a body left alone
    top = max(top, found.largest / drawing.mass, 1e-300)
    if coordinates == "absolute":
        # velocities of bodies are linear in v, and in these coordinates nothing else adds to accelerations
        core = mechanism.compile(coordinates).core
        which = list(range(len(drawing.bodies)))
        moved = core.motion(run.t[i : i + 1], run.q[i : i + 1], run.vdot[i : i + 1]).bodies(which)
        for k, b in enumerate(drawing.bodies):
            a, alpha = found.acceleration[b.name]
            mine = moved["body_angular_velocity"][0, k]
            arm = poses[b.name].rotation @ b.com
            centre = moved["body_velocity"][0, k] + np.cross(mine, arm)
            off = max(np.abs(centre - a).max(), np.abs(mine - alpha).max() * size) / top
            verdict.seen("acceleration", float(off), allowed.acceleration, f"{words}, body {b.name}")
        return
    spans = {joint["name"]: joint["state_v"] for joint in run.summary["joints"]}
    for j in drawing.joints:
        if spans[j.name] is None:
            continue
        first, count = spans[j.name]
        mine, theirs = run.vdot[i, first : first + count], found.coordinates[j.name]
        units = np.array([1.0] * (count - 3 * ball(j)) + [size] * 3 * ball(j)) if ball(j) else coordinate_units(j, size)
        backwards = found.backwards[j.name]
        if backwards is not None:
            # a ball walked from child to parent counts the parent's turns
            speeds, seen = run.v[i, first : first + count], run.joint(j.name).velocity[i]
            same = np.allclose(speeds[-3:], seen[-3:], rtol=1e-9, atol=0.0)
            if any(x.child_axis is not None for x in drawing.joints):
                # the drawing was turned to close, and with it the axes along which three turns are counted
                sizes = [float(np.linalg.norm(x)) for x in (mine[-3:], theirs[-3:], backwards)]
                nearest = min(sizes[1:], key=lambda x: abs(x - sizes[0]))
                mine, theirs = np.append(mine[:-3], sizes[0]), np.append(theirs[:-3], nearest)
                units = units[: len(mine)]
            elif not same:
                theirs = np.concatenate([theirs[:-3], backwards])
        top_here = max(top, float(np.abs(theirs * units).max(initial=0.0)))
        off = float(np.abs((mine - theirs) * units).max(initial=0.0)) / top_here
        verdict.seen("acceleration", off, allowed.acceleration, f"{words}, joint {j.name}")


def ball(j: Any) -> bool:
    return bool(j.motions(j.some)[2])


def coordinate_units(j: Any, size: float) -> Array:
    slides, turns, _ = j.motions(j.some)
    return np.array([1.0] * len(slides) + [size] * len(turns))


def reactions(
    drawing: Drawing, joints: dict[str, Any], i: int, found: Motion, verdict: Verdict, words: str, allowed: Allowed
) -> None:
    """Forces and moments along every direction that no self-stress touches."""
    size = drawing.size
    named = [(name, joint.force[i], joint.moment[i]) for name, joint in joints.items()]
    top = max([found.largest] + [max(np.abs(f).max(), np.abs(m).max() / size) for _, f, m in named])
    for name, f, m in named:
        if not (np.all(np.isfinite(f)) and np.all(np.isfinite(m))):
            verdict.wrong.append(f"{words}, joint {name}: the reaction is not finite")
            continue
        off = max(
            np.abs(untouched(found.stress_force[name]) @ (f - found.force[name])).max(initial=0.0),
            np.abs(untouched(found.stress_moment[name]) @ (m - found.moment[name])).max(initial=0.0) / size,
        )
        verdict.seen("reaction", float(off) / max(top, 1e-300), allowed.reaction, f"{words}, joint {name}")


def efforts(drawing: Drawing, run: Any, i: int, found: Motion, verdict: Verdict, words: str, allowed: Allowed) -> None:
    """Multipliers of couplings that no self-stress touches; those of the two directions in a plane by their length."""
    for c in drawing.couplings:
        mine, theirs = run.coupling(c.name).effort[i], found.effort[c.name]
        if c.kind == "roll":
            mine, theirs = (np.array([x[0], np.linalg.norm(x[1:])]) for x in (mine, theirs))
        if not found.shared[c.name]:
            top = max(found.largest, np.abs(mine).max(), 1e-300)
            verdict.seen(
                "effort", float(np.abs(mine - theirs).max()) / top, allowed.reaction, f"{words}, coupling {c.name}"
            )


def powers(
    drawing: Drawing,
    mechanism: pt.Mechanism,
    run: Any,
    i: int,
    poses: dict[str, Pose],
    found: Motion,
    verdict: Verdict,
    words: str,
) -> None:
    """Of every force whose power is sensed, over the largest force times the largest speed."""
    speed = max(float(np.linalg.norm(p.u)) + drawing.size * float(np.linalg.norm(p.w)) for p in poses.values())
    for f in drawing.forces:
        if f"power of {f.name}" not in mechanism.sensors:
            continue
        mine, theirs = float(run.sensor(f"power of {f.name}").values[i]), found.power[f.name]
        top = max(found.largest * speed, abs(mine), 1e-300)
        verdict.seen("power", abs(mine - theirs) / top, POWER, f"{words}, force {f.name}")


def untouched(stresses: Array) -> Array:
    """Directions that no row of `stresses` has a part in: projector."""
    if not len(stresses):
        return np.eye(3)
    _, s, right = np.linalg.svd(stresses)
    touched = right[: len(s)][s > UNLOADED]
    return np.eye(3) - touched.T @ touched


def unique(found: Motion, name: str, flags: Array, turn: Array, verdict: Verdict, words: str) -> None:
    """Flags of one joint along the columns of `turn`."""
    for part, stresses in enumerate((found.stress_force[name], found.stress_moment[name])):
        touched = np.abs(stresses @ turn).max(axis=0, initial=0.0)
        for k in range(3):
            if UNLOADED < touched[k] < LOADED:
                verdict.counts["unclear component"] += 1
                continue
            verdict.counts["flags"] += 1
            mine, theirs = bool(flags[3 * part + k]), bool(touched[k] <= UNLOADED)
            if mine != theirs:
                what, states = ("fx", "fy", "fz", "mx", "my", "mz")[3 * part + k], ("open", "determined")
                share = f"a self-stress has {touched[k]:.1e} of it"
                verdict.wrong.append(f"{words}: {what} is {states[theirs]} ({share}), Partita says {states[mine]}")
