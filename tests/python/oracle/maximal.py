"""Accelerations, reactions and what of them is unique, in six coordinates for each body.

Dense NumPy, nothing shared with the core. At given poses and velocities the unknowns are the accelerations of all
centres of mass and all angular accelerations. A joint is what its geometry says: as seen from the parent, the child's
point moves along the slides and the child turns about the turns. Whatever is perpendicular to these is a row of J.
J comes apart by singular values into what the joints forbid, what they leave free, and the self-stresses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .couplings import Reading, conditions
from .drawing import GROUND, Array, Drawing, Joint, Load, Spring, Torque, Torsion, unit
from .forces import BearingFriction

# Singular values of J over the largest: below the first a row says nothing new, above the second it does.
NOTHING, SOMETHING = 1e-11, 1e-7
# Frictions that follow reactions, which follow the frictions: as long as that changes one of them.
REPEATED = 200


@dataclass(frozen=True)
class Pose:
    """Origin and axes of a body, their velocity and angular velocity, in the world."""

    x: Array
    rotation: Array
    u: Array
    w: Array


@dataclass
class Side:
    """A body as a joint sees it: its place among the unknowns (None: the ground) and where its centre of mass is."""

    at: int | None
    pose: Pose
    centre: Array
    transported: Array  # drawing to now


@dataclass(frozen=True)
class Rates:
    """How the coordinates of a joint follow from accelerations: rows over all unknowns and a constant; x' itself; the
    unit force and moment on the child of an effort along each."""

    rows: Array
    rest: Array
    velocity: Array
    position: Array
    force: Array
    moment: Array


@dataclass(frozen=True)
class Motion:
    """What the program finds at one instant. Joint wrenches act on the child, at the joint's point there.

    `effort`: multipliers of a coupling; `shared`: a self-stress has a part in them; `power`: of each force.
    """

    acceleration: dict[str, tuple[Array, Array]]
    force: dict[str, Array]
    moment: dict[str, Array]
    stress_force: dict[str, Array]
    stress_moment: dict[str, Array]
    coordinates: dict[str, Array]
    backwards: dict[str, Array | None]
    effort: dict[str, Array]
    shared: dict[str, bool]
    mobility: int
    redundant: int
    unclear: bool
    gap: float
    rate_error: float
    contradiction: float
    largest: float
    power: dict[str, float]


class Maximal:
    """A drawing, ready to be asked at any poses. `frames`: axes of the joints in the drawing."""

    def __init__(self, drawing: Drawing, frames: dict[str, Array]) -> None:
        self.drawing, self.frames = drawing, frames
        self.bodies = {b.name: b for b in drawing.bodies}
        self.joints = {j.name: j for j in drawing.joints}
        self.offset = {b.name: 6 * i for i, b in enumerate(drawing.bodies)}
        self.n = 6 * len(drawing.bodies)

    def at(self, t: float, poses: dict[str, Pose]) -> Motion:
        """The motion at these poses."""
        d, n = self.drawing, self.n
        sides = {name: self._side(name, poses) for name in [GROUND, *self.bodies]}
        rows: list[Array] = []
        rest: list[float] = []
        owners: list[tuple[str, Array, Array]] = []  # joint, force and moment on its child for a unit multiplier
        gap = rate_error = 0.0
        rates = {}
        for j in d.joints:
            found, constants, wrenches, open_by, rate_errors = self._rows(j, sides)
            rows += found
            rest += constants
            owners += [(j.name, f, m) for f, m in wrenches]
            gap, rate_error = max(gap, open_by), max(rate_error, rate_errors)
            rates[j.name] = self._rates(j, sides)
        for drive in d.drives:
            x, i = rates[drive.joint], drive.coordinate
            rate, second = drive.derivatives(t)
            rows.append(x.rows[i])
            rest.append(x.rest[i] - second)
            owners.append((drive.joint, x.force[i], x.moment[i]))
            rate_error = max(
                rate_error, abs(x.velocity[i] - rate) * (d.size if x.moment[i].any() else 1.0) * d.time / d.size
            )
            wanted = drive.position(t)
            off = 0.0 if wanted is None else x.position[i] - float(wanted)
            # of turns this program knows no whole ones
            off = np.remainder(off + np.pi, 2.0 * np.pi) - np.pi if x.moment[i].any() else off / d.size
            gap = max(gap, abs(off))
        joint_rows = len(rows)
        for c in d.couplings:
            for x in conditions(c, n, lambda item: self._reading(item, rates), sides, t):
                rows.append(x.row)
                rest.append(x.rest)
                owners.append((c.name, np.zeros(3), np.zeros(3)))
                gap = max(gap, abs(x.gap) / (d.size if x.length else 1.0))
                rate_error = max(rate_error, abs(x.opens) * d.time / (d.size if x.length else 1.0))
        mass, h, power = self._newton(t, sides, rates)
        # in units of the drawing: angular accelerations over its size, moments times it
        scale = np.tile(np.repeat([1.0, 1.0 / d.size], 3), n // 6)
        j_all = np.array(rows).reshape(-1, n) * scale
        weights = np.array([np.linalg.norm(row) for row in j_all])
        weights[weights == 0.0] = 1.0
        j_all, b = j_all / weights[:, None], np.array(rest).reshape(-1) / weights
        mass, h = mass * scale[:, None] * scale / d.mass, h * scale / d.mass
        left, s, right = np.linalg.svd(j_all, full_matrices=True) if len(j_all) else (np.eye(0), np.zeros(0), np.eye(n))
        top = s.max(initial=1.0)
        rank = int(np.sum(s > NOTHING * top))
        unclear = bool(np.any((s > NOTHING * top) & (s < SOMETHING * top)))
        inverse = right[:rank].T @ ((left[:, :rank].T) / s[:rank, None])
        free, stresses = right[rank:].T, left[:, rank:]
        given = -inverse @ b
        reduced = free.T @ mass @ free
        unclear = unclear or (free.shape[1] > 0 and np.linalg.cond(reduced) > 1e9)

        def solved(h: Array) -> tuple[Array, Array]:
            """Accelerations and multipliers, in the units of the drawing and in plain ones."""
            acc = given + free @ np.linalg.solve(reduced, free.T @ (h - mass @ given)) if free.shape[1] else given
            return acc, (inverse.T @ (mass @ acc - h)) / weights * d.mass

        acc, lam = solved(h)
        rubbing = [f for f in d.forces if isinstance(f, BearingFriction)]
        for _ in range(REPEATED if rubbing else 0):
            before = np.concatenate([acc, lam])
            more = np.zeros(n)
            for f in rubbing:
                of = [
                    (x, force, moment) for x, (name, force, moment) in zip(lam, owners, strict=True) if name == f.joint
                ]
                wrench = [sum((x * part[k] for x, *part in of), np.zeros(3)) for k in (0, 1)]
                x, axis = rates[f.joint], self._axis(self.joints[f.joint], f.coordinate, sides)
                effort = f.effort(float(x.velocity[f.coordinate]), wrench[0], wrench[1], axis)
                more += effort * x.rows[f.coordinate]
                power[f.name] = effort * float(x.velocity[f.coordinate])
            acc, lam = solved(h + more * scale / d.mass)
            # accelerations that drives give do not change, multipliers do
            after = np.concatenate([acc, lam])
            if all(
                np.abs(new - old).max(initial=0.0) <= 1e-13 * np.abs(new).max(initial=1e-300)
                for new, old in ((after[:n], before[:n]), (after[n:], before[n:]))
            ):
                break
        else:
            unclear = unclear or bool(rubbing)
        h = h + more * scale / d.mass if rubbing else h
        wanting = np.linalg.norm(j_all @ acc + b, ord=np.inf) if len(b) else 0.0
        stresses = stresses / weights[:, None]
        acc = acc * scale
        force = {name: np.zeros(3) for name in self.joints}
        moment = {name: np.zeros(3) for name in self.joints}
        stress_force = {name: np.zeros((stresses.shape[1], 3)) for name in self.joints}
        stress_moment = {name: np.zeros((stresses.shape[1], 3)) for name in self.joints}
        coupled = [name for name, _, _ in owners[joint_rows:]]
        effort = {name: lam[joint_rows:][[x == name for x in coupled]] for name in coupled}
        loads = np.abs(stresses[joint_rows:]).max(axis=1, initial=0.0)
        shared = {name: bool(loads[[x == name for x in coupled]].max() > NOTHING) for name in coupled}
        in_joints = zip(lam[:joint_rows], stresses[:joint_rows], owners[:joint_rows], strict=True)
        for x, stress, (name, f, m) in in_joints:
            force[name] += x * f
            moment[name] += x * m
            stress_force[name] += np.outer(stress, f)
            stress_moment[name] += np.outer(stress, m) / d.size
        # a friction that follows what self-stresses share is anybody's guess
        touched = [max(np.abs(x[f.joint]).max(initial=0.0) for x in (stress_force, stress_moment)) for f in rubbing]
        unclear = unclear or max(touched, default=0.0) > NOTHING
        top_force = max([np.abs(f).max() for f in force.values()], default=0.0)
        top_moment = max([np.abs(m).max() for m in moment.values()], default=0.0)
        # constants are sums of centripetal accelerations, which may cancel
        pace = max((float(p.w @ p.w) for p in poses.values()), default=0.0) * d.size
        fed = max([np.abs(h[i : i + 6]).max() * d.mass for i in range(0, n, 6)], default=0.0)
        return Motion(
            {name: (acc[i : i + 3], acc[i + 3 : i + 6]) for name, i in self.offset.items()},
            force, moment, stress_force, stress_moment,
            {name: x.rows @ acc + x.rest for name, x in rates.items()},
            {j.name: self._backwards(j, sides, acc) for j in d.joints},
            effort, shared,
            free.shape[1], stresses.shape[1], unclear, gap, rate_error,
            float(wanting) / max(pace, np.abs(b).max(initial=0.0), np.abs(acc / scale).max(initial=0.0), 1e-300),
            max(top_force, top_moment / d.size, fed), power,
        )  # fmt: skip

    def open_rate(self, poses: dict[str, Pose]) -> float:
        """Over the rates asked for: by how much the drives miss them at t = 0, however the bodies move."""
        sides = {name: self._side(name, poses) for name in [GROUND, *self.bodies]}
        held = [row for j in self.drawing.joints for row in self._rows(j, sides)[0]]
        asked = [self._rates(self.joints[d.joint], sides).rows[d.coordinate] for d in self.drawing.drives]
        speeds = np.array([d.derivatives(0.0)[0] for d in self.drawing.drives])
        scale = np.tile(np.repeat([1.0, 1.0 / self.drawing.size], 3), self.n // 6)
        rows = np.array([*held, *asked]).reshape(-1, self.n) * scale
        wanted = np.concatenate([np.zeros(len(held)), speeds])
        weights = np.linalg.norm(rows, axis=1)
        weights[weights == 0.0] = 1.0
        rows, wanted = rows / weights[:, None], wanted / weights
        v = np.linalg.lstsq(rows, wanted, rcond=NOTHING)[0]
        return float(np.abs(rows @ v - wanted).max(initial=0.0) / np.abs(wanted).max(initial=1e-300))

    def start(self, limit: float) -> str:
        """Whether the drawing, which is closed, can start to move at t = 0: "moves", "contradicts", or "unclear"."""
        still = {b.name: Pose(b.position, b.rotation, np.zeros(3), np.zeros(3)) for b in self.drawing.bodies}
        sides = {name: self._side(name, still) for name in [GROUND, *self.bodies]}
        rates = {j.name: self._rates(j, sides) for j in self.drawing.joints}
        rows = [row for j in self.drawing.joints for row in self._rows(j, sides)[0]]
        opens = [0.0] * len(rows)
        for drive in self.drawing.drives:
            rows.append(rates[drive.joint].rows[drive.coordinate])
            opens.append(-drive.derivatives(0.0)[0])
        for c in self.drawing.couplings:
            found = conditions(c, self.n, lambda item: self._reading(item, rates), sides, 0.0)
            rows += [x.row for x in found]
            opens += [x.opens for x in found]
        scale = np.tile(np.repeat([1.0, 1.0 / self.drawing.size], 3), self.n // 6)
        held = np.array(rows).reshape(-1, self.n) * scale
        weights = np.linalg.norm(held, axis=1)
        weights[weights == 0.0] = 1.0
        held, wanted = held / weights[:, None], -np.array(opens) / weights
        v = np.linalg.lstsq(held, wanted, rcond=NOTHING)[0]
        if np.abs(held @ v - wanted).max(initial=0.0) > limit * np.abs(wanted).max(initial=1e-300):
            return "contradicts"
        v = v * scale
        poses = {}
        for b in self.drawing.bodies:
            i = self.offset[b.name]
            w = v[i + 3 : i + 6]
            poses[b.name] = Pose(b.position, b.rotation, v[i : i + 3] - cross(w, b.rotation @ b.com), w)
        try:
            at = self.at(0.0, poses)
        except np.linalg.LinAlgError:  # a motion without mass
            return "unclear"
        if at.unclear:
            return "unclear"
        return "contradicts" if at.contradiction > limit else "moves"

    def motions_of(self, poses: dict[str, Pose], names: list[str], about_centres: bool = False) -> int:
        """In how many ways these bodies can move at t = 0 while all others rest; `about_centres`: their centres of
        mass rest, too, as those of bodies that spin idly do."""
        sides = {name: self._side(name, poses) for name in [GROUND, *self.bodies]}
        first = 3 if about_centres else 0
        which = [self.offset[name] + i for name in names for i in range(first, 6)]
        scale = np.tile(np.repeat([1.0, 1.0 / self.drawing.size], 3)[first:], len(names))
        rates = {j.name: self._rates(j, sides) for j in self.drawing.joints}
        rows = [row for j in self.drawing.joints for row in self._rows(j, sides)[0]]
        for c in self.drawing.couplings:
            rows += [x.row for x in conditions(c, self.n, lambda item: self._reading(item, rates), sides, 0.0)]
        held = np.array(rows)[:, which] * scale
        lengths = np.linalg.norm(held, axis=1)
        s = np.linalg.svd(held[lengths > 0.0] / lengths[lengths > 0.0, None], compute_uv=False)
        return len(which) - int(np.sum(s > NOTHING * s[0]))

    def _reading(self, item: dict[str, Any], rates: dict[str, Rates]) -> Reading:
        """A coordinate of a joint."""
        assert item["of"] == "joint", f"{item['of']} is not read"
        x, i = rates[item["joint"]], item["coordinate"]
        return Reading(x.rows[i], x.rest[i], x.velocity[i], x.position[i], not x.moment[i].any())

    def _side(self, name: str, poses: dict[str, Pose]) -> Side:
        if name == GROUND:
            return Side(None, Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)), np.zeros(3), np.eye(3))
        b, p = self.bodies[name], poses[name]
        return Side(self.offset[name], p, p.x + p.rotation @ b.com, p.rotation @ b.rotation.T)

    def _point(self, j: Joint, name: str, side: Side) -> Array:
        """The joint's point as a body carries it."""
        at = j.point if name == j.parent else j.on_child
        if name == GROUND:
            return at
        return side.pose.x + side.transported @ (at - self.bodies[name].position)

    def _axes(self, j: Joint, p: Side, c: Side) -> tuple[Array, Array, bool]:
        """Slides and turns now, as columns."""
        slides, turns, ball = j.motions(self.frames[j.name])
        now = [p.transported @ turns[0]] if turns else []
        if len(turns) == 2:
            now.append(c.transported @ turns[1])  # of such joints the drawing has the axes closed
        return np.array([p.transported @ x for x in slides]).reshape(-1, 3).T, np.array(now).reshape(-1, 3).T, ball

    def _axis(self, j: Joint, coordinate: int, sides: dict[str, Side]) -> Array:
        """Of a slide or a turn."""
        slides, turns, _ = self._axes(j, sides[j.parent], sides[j.child])
        return np.column_stack([slides, turns])[:, coordinate]

    def _rows(
        self, j: Joint, sides: dict[str, Side]
    ) -> tuple[list[Array], list[float], list[tuple[Array, Array]], float, float]:
        """What a joint forbids: rows, constants, wrench of each, how far it is open, how fast it opens."""
        p, c = sides[j.parent], sides[j.child]
        slides, turns, ball = self._axes(j, p, c)
        kinematics = self._relative(j, sides)
        rows, rest, wrenches = [], [], []
        gap = rate_error = 0.0
        size, time = self.drawing.size, self.drawing.time
        for axis in across(slides):
            row = np.zeros(self.n)
            self._add_force(row, p, c, kinematics.point, axis)
            rows.append(row)
            rest.append(axis @ kinematics.centripetal)
            wrenches.append((axis, np.zeros(3)))
            gap = max(gap, abs(axis @ kinematics.gap) / size)
            rate_error = max(rate_error, abs(axis @ kinematics.rate) * time / size)
        for axis in [] if ball else across(turns):
            row = np.zeros(self.n)
            self._add_moment(row, p, c, axis)
            rows.append(row)
            rest.append(-(axis @ self._gyration(turns, p, c, kinematics.spin)))
            wrenches.append((np.zeros(3), axis))
            rate_error = max(rate_error, abs(axis @ kinematics.spin) * time)
        if j.kind == "screw":
            x, along = self._rates(j, sides), j.pitch / (2.0 * np.pi)
            rows.append(x.rows[0] - along * x.rows[1])
            rest.append(x.rest[0] - along * x.rest[1])
            wrenches.append((x.force[0], -along * x.moment[1]))
            rate_error = max(rate_error, abs(x.velocity[0] - along * x.velocity[1]) * time / size)
        if j.kind == "constant_velocity":
            # in the plane that halves the angle between the shafts, neither turns against the other
            own = j.axes[:, 0] / np.linalg.norm(j.axes[:, 0])
            one, other = p.transported @ own, c.transported @ (own if j.bent is None else j.bent @ own)
            row = np.zeros(self.n)
            self._add_moment(row, p, c, one + other)
            rows.append(row)
            spin = kinematics.spin
            rest.append(float((cross(p.pose.w, one) + cross(c.pose.w, other)) @ spin))
            wrenches.append((np.zeros(3), one + other))
            rate_error = max(rate_error, abs((one + other) @ spin) * time)
        if j.kind == "custom":
            x = self._rates(j, sides)
            free = [j.moving.index(direction) for direction in j.free]
            for direction, law in j.follows:
                i = j.moving.index(direction)
                value, slopes, second = law.derivatives(x.position[free])
                # what follows less its function, as a sum over the coordinates
                sum_of = np.zeros(len(j.moving))
                sum_of[i], sum_of[free] = 1.0, -slopes
                rows.append(sum_of @ x.rows)
                rest.append(float(sum_of @ x.rest - x.velocity[free] @ second @ x.velocity[free]))
                wrenches.append((sum_of @ x.force, sum_of @ x.moment))
                length = 1.0 if direction.startswith("r") else size
                gap = max(gap, abs(x.position[i] - value) / length)
                rate_error = max(rate_error, abs(sum_of @ x.velocity) * time / length)
        if not ball:
            r = p.transported.T @ c.transported @ j.alignment.T
            _, drawn, _ = j.motions(self.frames[j.name])
            gap = max(gap, float(np.abs(turned_by(drawn, angles(drawn, r)) - r).max()))
        return rows, rest, wrenches, gap, rate_error

    def _relative(self, j: Joint, sides: dict[str, Side]) -> Relative:
        p, c = sides[j.parent], sides[j.child]
        on_p, on_c = self._point(j, j.parent, p), self._point(j, j.child, c)
        gap, wp, wc = on_c - on_p, p.pose.w, c.pose.w
        # velocities and accelerations of the two points, as far as they follow from angular velocities
        rate = c.pose.u + cross(wc, on_c - c.pose.x) - p.pose.u - cross(wp, on_c - p.pose.x)
        rc, rp = on_c - c.centre, on_p - p.centre
        own = cross(wc, cross(wc, rc)) - cross(wp, cross(wp, rp))
        transported = cross(wp, cross(wp, gap)) + 2.0 * cross(wp, rate)
        return Relative(on_c, gap, rate, own - transported, wc - wp)

    @staticmethod
    def _gyration(turns: Array, p: Side, c: Side, spin: Array) -> Array:
        """alpha_c - alpha_p for unchanged rates of the turns."""
        if turns.shape[1] == 0:
            return np.zeros(3)
        speeds = np.linalg.pinv(turns) @ spin
        first = cross(p.pose.w, turns[:, 0]) * speeds[0]
        return first if len(speeds) == 1 else first + cross(c.pose.w, turns[:, 1]) * speeds[1]

    def _rates(self, j: Joint, sides: dict[str, Side]) -> Rates:
        """The joint's own coordinates: slides, then turns; three turns together in the child's axes."""
        p, c = sides[j.parent], sides[j.child]
        slides, turns, ball = self._axes(j, p, c)
        x = self._relative(j, sides)
        rows, rest, velocity, position, force, moment = [], [], [], [], [], []
        for axis in np.linalg.pinv(slides) if slides.size else []:
            row = np.zeros(self.n)
            self._add_force(row, p, c, x.point, axis)
            rows.append(row)
            rest.append(axis @ x.centripetal)
            velocity.append(axis @ x.rate)
            position.append(axis @ x.gap)
            force.append(axis)
            moment.append(np.zeros(3))
        _, drawn, _ = j.motions(self.frames[j.name])
        duals = c.transported.T if ball else np.linalg.pinv(turns) if turns.size else []
        # the axes of three turns move with the child
        bias = cross(c.pose.w, x.spin) if ball else self._gyration(turns, p, c, x.spin)
        where = np.zeros(3) if ball else angles(drawn, p.transported.T @ c.transported @ j.alignment.T)
        for i, axis in enumerate(duals):
            row = np.zeros(self.n)
            self._add_moment(row, p, c, axis)
            rows.append(row)
            rest.append(-(axis @ bias))
            velocity.append(axis @ x.spin)
            position.append(where[i])
            force.append(np.zeros(3))
            moment.append(axis)
        stacked = [np.array(a).reshape(-1, w) for a, w in ((rows, self.n), (force, 3), (moment, 3))]
        return Rates(stacked[0], np.array(rest), np.array(velocity), np.array(position), stacked[1], stacked[2])

    def _backwards(self, j: Joint, sides: dict[str, Side], acc: Array) -> Array | None:
        """Acceleration of three turns seen from the child: those of the parent relative to it, in the parent's axes."""
        p, c = sides[j.parent], sides[j.child]
        if not j.motions(self.frames[j.name])[2]:
            return None
        alpha = [acc[x.at + 3 : x.at + 6] if x.at is not None else np.zeros(3) for x in (p, c)]
        return p.transported.T @ (alpha[0] - alpha[1] - cross(p.pose.w, p.pose.w - c.pose.w))

    @staticmethod
    def _add_force(row: Array, p: Side, c: Side, point: Array, axis: Array) -> None:
        for side, sign in ((c, 1.0), (p, -1.0)):
            if side.at is not None:
                row[side.at : side.at + 3] += sign * axis
                row[side.at + 3 : side.at + 6] += sign * cross(point - side.centre, axis)

    @staticmethod
    def _add_moment(row: Array, p: Side, c: Side, axis: Array) -> None:
        for side, sign in ((c, 1.0), (p, -1.0)):
            if side.at is not None:
                row[side.at + 3 : side.at + 6] += sign * axis

    def _newton(
        self, t: float, sides: dict[str, Side], rates: dict[str, Rates]
    ) -> tuple[Array, Array, dict[str, float]]:
        """Masses, those of rotors too, what acts on the bodies besides the joints, and the power of each force."""
        mass, h = np.zeros((self.n, self.n)), np.zeros(self.n)
        for name, i in self.offset.items():
            b, side = self.bodies[name], sides[name]
            inertia = side.pose.rotation @ b.inertia @ side.pose.rotation.T
            mass[i : i + 3, i : i + 3] = b.mass * np.eye(3)
            mass[i + 3 : i + 6, i + 3 : i + 6] = inertia
            h[i : i + 3] += b.mass * self.drawing.gravity
            h[i + 3 : i + 6] -= cross(side.pose.w, inertia @ side.pose.w)
        for r in self.drawing.rotors:
            row, rest = rates[r.joint].rows[r.coordinate], rates[r.joint].rest[r.coordinate]
            mass += r.inertia * r.ratio**2 * np.outer(row, row)
            h -= r.inertia * r.ratio**2 * rest * row
        power = {}
        for f in self.drawing.forces:
            at = Acting(t, sides, rates, np.zeros(self.n))
            if isinstance(f, Spring):
                (a, va), (b, vb) = at.motion_of(f.body1, f.point1), at.motion_of(f.body2, f.point2)
                along, distance = unit(b - a), float(np.linalg.norm(b - a))
                tension = f.stiffness * (distance - f.length) + f.damping * (along @ (vb - va))
                at.add_load(f.body1, a, tension * along)
                at.add_load(f.body2, b, -tension * along)
            elif isinstance(f, Load):
                force = f.force * np.cos(f.swing * t)
                force = sides[f.body].pose.rotation @ force if f.axes == "body" else force
                at.add_load(f.body, at.motion_of(f.body, f.point)[0], force)
            elif isinstance(f, Torque):
                at.along(f.joint, f.coordinate, f.value)
            elif isinstance(f, Torsion):
                x, rate = at.joint(f.joint, f.coordinate)
                at.along(f.joint, f.coordinate, -f.stiffness * (x - f.angle) - f.damping * rate)
            else:
                f.act(at)
            h += at.h
            power[f.name] = at.power
        return mass, h, power


@dataclass
class Acting:
    """The bodies at one instant, as one force sees them (`forces.Scene`), and what it does to them."""

    t: float
    sides: dict[str, Side]
    rates: dict[str, Rates]
    h: Array
    power: float = 0.0

    def motion_of(self, body: str, point: Array) -> tuple[Array, Array]:
        pose = self.sides[body].pose
        arm = pose.rotation @ point
        return pose.x + arm, pose.u + cross(pose.w, arm)

    def axes(self, body: str) -> tuple[Array, Array]:
        pose = self.sides[body].pose
        return pose.rotation, pose.w

    def joint(self, name: str, coordinate: int) -> tuple[float, float]:
        x = self.rates[name]
        return float(x.position[coordinate]), float(x.velocity[coordinate])

    def add_load(self, body: str, point: Array, force: Array, moment: Any = 0.0) -> None:
        side = self.sides[body]
        if side.at is None:
            return
        self.h[side.at : side.at + 3] += force
        self.h[side.at + 3 : side.at + 6] += cross(point - side.centre, force) + moment
        pose = side.pose
        self.power += float(force @ (pose.u + cross(pose.w, point - pose.x)) + np.sum(moment * pose.w))

    def along(self, joint: str, coordinate: int, effort: float) -> None:
        """An effort does the work of its coordinate: the same row that measures it."""
        self.h += effort * self.rates[joint].rows[coordinate]
        self.power += effort * float(self.rates[joint].velocity[coordinate])


@dataclass(frozen=True)
class Relative:
    """A joint's point on the child, its gap and the gap's rate as the parent sees it, the part of the relative
    acceleration that follows from velocities, the relative angular velocity."""

    point: Array
    gap: Array
    rate: Array
    centripetal: Array
    spin: Array


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors; NumPy's own serves stacks of them, at many times the cost."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def across(axes: Array) -> list[Array]:
    """Orthonormal directions perpendicular to the columns of `axes`."""
    if axes.size == 0:
        return list(np.eye(3))
    left, s, _ = np.linalg.svd(axes)
    return list(left[:, int(np.sum(s > 1e-9)) :].T)


def about(axis: Array, angle: float) -> Array:
    """Rotation about a unit axis."""
    k = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def turned_by(axes: list[Array], by: Array) -> Array:
    """The rotation that turns about these axes, one after the other, leave behind."""
    r = np.eye(3)
    for axis, angle in zip(axes, by, strict=True):
        r = r @ about(axis, angle)
    return r


def angles(axes: list[Array], r: Array) -> Array:
    """By how much a rotation turns about one axis, or about two one after the other."""

    def seen(axis: Array, before: Array, after: Array) -> float:
        before, after = before - axis * (axis @ before), after - axis * (axis @ after)
        return float(np.arctan2(axis @ cross(before, after), before @ after))

    if not axes:
        return np.zeros(0)
    if len(axes) == 1:
        probe = np.eye(3)[int(np.argmin(np.abs(axes[0])))]
        return np.array([seen(axes[0], probe, r @ probe)])
    return np.array([seen(axes[0], axes[1], r @ axes[1]), -seen(axes[1], axes[0], r.T @ axes[0])])
