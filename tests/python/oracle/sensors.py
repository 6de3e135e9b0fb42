"""Sensors of every kind on mechanisms drawn by chance, against the poses of the run moved on by hand.

Next to an output the bodies move along a quadratic in time: where they are, how fast they move, how they accelerate by
the independent program. Of what is measured on bodies moved along it differences are taken, so no formula of a rate or
of a second derivative stands here. Forces are those of the drawing; powers are held against what the bodies gain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import partita as pt

from .comparison import Verdict, frames_of, moving, short_run
from .drawing import GROUND, Array, Drawing, Load, Spring, Torque, Torsion, unit
from .maximal import Maximal, Motion, Pose, about

# Central differences of a quadratic path: what is of order four in the step, and round-off over its square.
SAME = 2e-6
READS = ("position", "velocity", "acceleration")
Places = dict[str, Pose]
Value = Callable[[Places], Any]


class SensorsAsked:
    """A mechanism with sensors, and for each what it is: a value of the poses, of the order of a derivative."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing, self.mechanism = drawing, drawing.build()
        self.rng = np.random.default_rng(1000 + drawing.seed)
        self.derivatives: dict[str, tuple[Value, int, float]] = {}
        self.expressions: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {}
        self.bodies = [b.name for b in drawing.bodies]

    def any(self, *more: str) -> str:
        return str(self.rng.choice([*self.bodies, *more]))

    def point(self) -> Array:
        return self.drawing.size * 0.5 * self.rng.normal(size=3)

    def add(self, name: str, of: Any, order: int, value: Value, length: float, **more: Any) -> str:
        """A sensor whose value is the derivative of this order of `value`, a power `length` of lengths."""
        full = f"{name} {READS[order]}"
        self.mechanism.add_sensor(full, of, READS[order], **more)
        self.derivatives[full] = value, order, length
        return full

    def all(self) -> None:
        """Sensors of every quantity that follows from the motion of bodies, and expressions of them."""
        m, size = self.mechanism, self.drawing.size
        for k in range(2):
            body, point, axes = self.any(), self.point(), self.any("world")
            for order in range(3):
                self.add(f"point {k}", (body, point), order, of_point(body, point, axes), 1.0, axes=axes)
        body = self.any()
        for order in range(3):
            self.add("origin", body, order, of_point(body, np.zeros(3), "world"), 1.0)
        one, other = self.any(), self.any(GROUND)
        while other == one:
            other = self.any(GROUND)
        p, q, a, b = self.point(), self.point(), self.rng.normal(size=3), self.rng.normal(size=3)
        distance = lambda x: np.linalg.norm(at(x, other, q) - at(x, one, p))  # noqa: E731
        along = lambda x: along_axis(x, one, a) @ (at(x, other, q) - at(x, one, p))  # noqa: E731
        cosine = lambda x: along_axis(x, one, a) @ along_axis(x, other, b)  # noqa: E731
        for order in range(3):
            self.add("distance", pt.Distance(one, p, other, q), order, distance, 1.0)
            self.add("along", pt.Along(one, p, a, other, q), order, along, 1.0)
            self.add("cosine", pt.Cosine(one, a, other, b), order, cosine, 0.0)
        r, v, w = "point 0 position", "point 1 velocity", "point 0 velocity"
        more = {
            "sum": (m.sensors[r] / size + 2.0 * m.sensors[v], lambda x, y: x / size + 2.0 * y, (r, v)),
            "quotient": (
                m.sensors[r][1] / m.sensors["distance position"],
                lambda x, y: x[1] / y,
                (r, "distance position"),
            ),
            "product": (m.sensors[v][2] * m.sensors[r], lambda x, y: x[2] * y, (v, r)),
            "dot": (m.sensors[v].dot(m.sensors[w]) - 1.0, lambda x, y: x @ y - 1.0, (v, w)),
            "norm": (-m.sensors[v].norm(), lambda x: -np.linalg.norm(x), (v,)),
        }
        for name, (expression, value, of) in more.items():
            m.add_sensor(name, expression)
            self.expressions[name] = value, of
        m.add_sensor("function", [m.sensors[v], m.sensors[w]], function=lambda t, x, y: [t, *np.cross(x, y)])


def at(x: Places, body: str, point: Array) -> Array:
    return x[body].x + x[body].rotation @ point


def along_axis(x: Places, body: str, axis: Array) -> Array:
    return x[body].rotation @ unit(axis)


def of_point(body: str, point: Array, axes: str) -> Value:
    """A point's place, and axes in which its derivatives are looked at."""
    return lambda x: (at(x, body, point), axes)


def moved(drawing: Drawing, found: Motion, poses: Places, h: float) -> Places:
    """All bodies a moment later, right to second order."""
    later = {GROUND: Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))}
    for b in drawing.bodies:
        p, (centre, alpha) = poses[b.name], found.acceleration[b.name]
        arm = p.rotation @ b.com
        a = centre - np.cross(alpha, arm) - np.cross(p.w, np.cross(p.w, arm))
        by = p.w * h + 0.5 * alpha * h * h
        angle = float(np.linalg.norm(by))
        turn = about(by / angle, angle) if angle > 0.0 else np.eye(3)
        later[b.name] = Pose(p.x + p.u * h + 0.5 * a * h * h, turn @ p.rotation, p.u, p.w)
    return later


def difference(value: Value, order: int, path: Callable[[float], Places], h: float) -> Array:
    """Central differences of order four; a vector is turned into its axes at the middle."""
    here = value(path(0.0))
    axes = here[1] if isinstance(here, tuple) else "world"

    def plain(x: Places) -> Array:
        found = value(x)
        return np.asarray(found[0] if isinstance(found, tuple) else found, dtype=float)

    seen = {k: plain(path(k * h)) for k in ((-2, -1, 0, 1, 2) if order else (0,))}
    if order == 0:
        found = seen[0]
    elif order == 1:
        found = (seen[-2] - 8.0 * seen[-1] + 8.0 * seen[1] - seen[2]) / (12.0 * h)
    else:
        found = (-seen[-2] + 16.0 * seen[-1] - 30.0 * seen[0] + 16.0 * seen[1] - seen[2]) / (12.0 * h * h)
    return found if axes == "world" else path(0.0)[axes].rotation.T @ found


def compare_sensors(drawing: Drawing) -> Verdict:
    """Every sensor at every output of a short run."""
    verdict = Verdict()
    asked = SensorsAsked(drawing)
    try:
        asked.all()
        of_forces = add_force_sensors(asked)
        state = moving(asked.mechanism, drawing, np.random.default_rng(drawing.seed))
        run = short_run(asked.mechanism, drawing, state, ("relative", "absolute")[drawing.seed % 2])
    except pt.errors.PartitaError as error:
        verdict.counts[f"refused: {type(error).__name__}"] += 1
        return verdict
    if not run.success:
        verdict.counts["stopped"] += 1
        return verdict
    bodies = {b.name: run.body(b.name) for b in drawing.bodies}
    program = Maximal(drawing, frames_of(drawing, run))
    for i, t in enumerate(run.t):
        poses = {n: Pose(b.position[i], b.rotation[i], b.velocity[i], b.angular_velocity[i]) for n, b in bodies.items()}
        found = program.at(float(t), poses)
        if found.gap > 1e-9 or found.unclear or not np.all(np.isfinite(run.vdot[i])) or found.contradiction > 1e-7:
            verdict.counts["passed over"] += 1
            continue
        verdict.counts["instants"] += 1
        motions(asked, run, i, found, poses, verdict)
        of_forces.look(run, i, found, poses, verdict)
    return verdict


def pace_of(drawing: Drawing, found: Motion, poses: Places) -> float:
    """The fastest rate at which anything changes: what a moment is compared with."""
    rates = [1.0 / drawing.time]
    for name, p in poses.items():
        a, alpha = found.acceleration[name]
        rates += [float(np.linalg.norm(p.w)), float(np.linalg.norm(p.u)) / drawing.size]
        rates += [float(np.linalg.norm(alpha)) ** 0.5, (float(np.linalg.norm(a)) / drawing.size) ** 0.5]
    return max(rates)


def motions(asked: SensorsAsked, run: Any, i: int, found: Motion, poses: Places, verdict: Verdict) -> None:
    """What follows from the motion of bodies."""
    drawing, pace = asked.drawing, pace_of(asked.drawing, found, poses)
    extent = max([drawing.size, *(float(np.linalg.norm(p.x)) for p in poses.values())])
    path = lambda h: moved(drawing, found, poses, h)  # noqa: E731
    for name, (value, order, length) in asked.derivatives.items():
        mine = run.sensor(name).values[i]
        if name.startswith("distance") and difference(value, 0, path, 1.0) < 0.05 * drawing.size:
            continue  # a distance of nearly nothing has no quadratic
        theirs = difference(value, order, path, 2e-3 / pace)
        off = float(np.abs(mine - theirs).max()) / (extent**length * pace**order)
        verdict.seen(f"sensor {name.split()[0]}", off, SAME, f"output {i}, {name}")
    for name, (expression, of) in asked.expressions.items():
        parts = [run.sensor(x).values[i] for x in of]
        wanted = np.asarray(expression(*parts))
        off = float(np.abs(run.sensor(name).values[i] - wanted).max()) / max(float(np.abs(wanted).max()), 1e-300)
        verdict.seen("sensor expression", off, 1e-12, f"output {i}, {name}")
    read, (x, y) = run.sensor("function").values[i], (run.sensor(f"point {k} velocity").values[i] for k in (1, 0))
    scale = max(float(np.abs(read).max()), 1e-300)
    verdict.seen(
        "sensor function", float(np.abs(read - [run.t[i], *np.cross(x, y)]).max()) / scale, 1e-12, f"output {i}"
    )


class Forces:
    """Sensors of joints, forces and drives."""

    def __init__(self, asked: SensorsAsked) -> None:
        self.asked = asked
        self.turning: list[tuple[str, str, str]] = []

    def look(self, run: Any, i: int, found: Motion, poses: Places, verdict: Verdict) -> None:
        d, words = self.asked.drawing, f"output {i}"
        bodies = {**poses, GROUND: Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))}
        masses = {b.name: b for b in d.bodies}

        def read(name: str) -> Any:
            return run.sensor(name).values[i]

        def same(what: str, mine: Any, theirs: Any, scale: float) -> None:
            off = float(np.abs(np.asarray(mine) - theirs).max()) / max(scale, float(np.abs(theirs).max()), 1e-300)
            verdict.seen(f"sensor {what}", off, 1e-9, f"{words}, {what}")

        for name, reads, axes in self.turning:
            p, spin = bodies[name], found.acceleration[name][1] if name in found.acceleration else np.zeros(3)
            turn = np.eye(3) if axes == "world" else bodies[axes].rotation
            value = {"rotation": p.rotation, "angular_velocity": turn.T @ p.w, "angular_acceleration": turn.T @ spin}[
                reads
            ]
            size = {"rotation": 1.0, "angular_velocity": 1.0, "angular_acceleration": 1.0}[reads] * (
                pace_of(d, found, poses) ** {"rotation": 0, "angular_velocity": 1, "angular_acceleration": 2}[reads]
            )
            off = float(np.abs(read(f"{name} {reads}") - value).max()) / size
            verdict.seen("sensor turning", off, 1e-8, f"{words}, {name} {reads}")
        power = 0.0
        largest = max(found.largest, d.mass * float(np.linalg.norm(d.gravity)))
        speed = max([float(np.linalg.norm(p.u)) + d.size * float(np.linalg.norm(p.w)) for p in poses.values()])
        for f in d.forces:
            power += float(read(f"{f.name} power"))
            if isinstance(f, Spring):
                ends = [bodies[f.body1], bodies[f.body2]]
                arms = [ends[k].rotation @ (f.point1, f.point2)[k] for k in (0, 1)]
                gap = ends[1].x + arms[1] - ends[0].x - arms[0]
                rate = unit(gap) @ (ends[1].u + np.cross(ends[1].w, arms[1]) - ends[0].u - np.cross(ends[0].w, arms[0]))
                length = float(np.linalg.norm(gap))
                tension = f.stiffness * (length - f.length) + f.damping * rate
                same("spring length", read(f"{f.name} length"), length, d.size)
                same("spring rate", read(f"{f.name} rate"), rate, speed)
                same("spring force", read(f"{f.name} force"), tension, largest)
                same("spring power", read(f"{f.name} power"), -tension * rate, largest * speed)
                same("spring energy", read(f"{f.name} energy"), 0.5 * f.stiffness * (length - f.length) ** 2, 0.0)
            elif isinstance(f, Load):
                body = bodies[f.body]
                force = f.force * np.cos(f.swing * float(run.t[i]))
                force = body.rotation @ force if f.axes == "body" else force
                arm = body.rotation @ f.point
                same("load force", read(f"{f.name} force"), body.rotation.T @ force, largest)
                same("load place", read(f"{f.name} position"), body.x + arm, d.size)
                same("load power", read(f"{f.name} power"), force @ (body.u + np.cross(body.w, arm)), largest * speed)
            elif isinstance(f, Torque | Torsion):
                x = run.joint(f.joint)
                rate = float(x.velocity[i, f.coordinate])
                effort = f.value if isinstance(f, Torque) else None
                if isinstance(f, Torsion):
                    off = float(x.position[i, f.coordinate]) - f.angle
                    effort = -f.stiffness * off - f.damping * rate
                    same("torsion energy", read(f"{f.name} energy"), 0.5 * f.stiffness * off**2, 0.0)
                same("effort", read(f"{f.name} effort"), effort, 0.0)
                same("effort power", read(f"{f.name} power"), effort * rate, abs(effort) * speed / d.size)
        for drive in d.drives:
            power += float(read(f"{drive.name} power"))
            same("drive power", read(f"{drive.name} power"), read(f"{drive.name} effort") *
                 drive.derivatives(float(run.t[i]))[0], largest * speed)  # fmt: skip
        for j in d.joints:
            for reads in ("force", "moment"):
                seen, turn = getattr(run.joint(j.name), reads)[i], run.at_once.reactions["joint_rotation"][i, list(
                    run.names.joints).index(j.name)]  # fmt: skip
                same("reaction", read(f"{j.name} {reads}"), seen, largest)
                same("reaction in its axes", turn @ read(f"{j.name} {reads} joint"), seen, largest)
        # what the bodies gain is what gravity, forces and drives give them; joints give nothing
        gained, moved_at = 0.0, largest * speed
        for name, (a, alpha) in found.acceleration.items():
            b, p = masses[name], poses[name]
            inertia = p.rotation @ b.inertia @ p.rotation.T
            u = p.u + np.cross(p.w, p.rotation @ b.com)
            gained += b.mass * float((a - d.gravity) @ u) + float(
                p.w @ (inertia @ alpha + np.cross(p.w, inertia @ p.w))
            )
        verdict.seen("power balance", abs(gained - power) / max(moved_at, abs(power), 1e-300), 1e-7, words)


def add_force_sensors(asked: SensorsAsked) -> Forces:
    """Sensors of turning bodies, joints, forces and drives."""
    m, found = asked.mechanism, Forces(asked)
    for b in asked.drawing.bodies[:2]:
        for reads in ("rotation", "angular_velocity", "angular_acceleration"):
            axes = "world" if reads == "rotation" else asked.any("world")
            m.add_sensor(
                f"{b.name} {reads}", m.bodies[b.name], reads, **({} if reads == "rotation" else {"axes": axes})
            )
            found.turning.append((b.name, reads, axes))
    for f in asked.drawing.forces:
        words: tuple[str, ...] = ("effort", "power", "energy") if isinstance(f, Torsion) else ("effort", "power")
        if isinstance(f, Spring):
            words = ("length", "rate", "force", "power", "energy")
        if isinstance(f, Load):
            words = ("position", "power")
            m.add_sensor(f"{f.name} force", m.forces[f.name], "force", axes=f.body)
        for word in words:
            m.add_sensor(f"{f.name} {word}", m.forces[f.name], word)
    for j in asked.drawing.joints:
        for reads in ("force", "moment"):
            m.add_sensor(f"{j.name} {reads}", m.joints[j.name], reads)
            m.add_sensor(f"{j.name} {reads} joint", m.joints[j.name], reads, axes="joint")
    for drive in asked.drawing.drives:
        for reads in ("effort", "power"):
            m.add_sensor(f"{drive.name} {reads}", m.drives[drive.name], reads)
    return found
