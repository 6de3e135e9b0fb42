"""Shapes of couplings: gears that mesh, belts, racks, cams, wheels that roll, massless rods.

A description gives ratios, not wheels. For given axes the wheels of that ratio in contact are unique, so gears are
drawn to scale, with teeth for illustration; pulleys have their radii, where there is room. A coupling without a picture
is a thin line between its parts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..tolerance import EQUAL, EQUAL_IN_SIX_DIGITS, NEGLIGIBLE, VISIBLE
from .geometry import plain

FloatArray = NDArray[np.float64]

PULLEYS = 0.42
"""Two pulleys of a belt together, relative to the distance of their axes, where there is no room for theirs."""
MOST_PULLEYS = 0.85
"""Two pulleys as large as one that is drawn must be smaller together. Scale: fraction of the distance of their axes.
Reason: a belt is seen between them."""
BESIDE = 0.2
"""A wheel farther from its bearing has a shaft to it. Scale: fraction of its radius. Reason: nearer it is covered."""
CLOSED_TURN = 1.99 * math.pi
"""The outline of a cam that turned farther is closed. Scale: rad. Reason: a turn of a run, but for its last
output."""
ROUND = 73
"""Points of a belt around a pulley: enough that no corner is visible."""
TEETH = range(16, 33)
LONGEST_PATH = 240


@dataclass(frozen=True)
class Turn:
    """A hinge as drawn: its bodies, and its axis through a point of the world."""

    parent: int
    child: int
    point: FloatArray
    axis: FloatArray


@dataclass
class Pictures:
    """Drawing of couplings; points and directions in axes of the body they move with, -1 the ground."""

    wheels: list[dict[str, Any]] = field(default_factory=list)
    lines: list[dict[str, Any]] = field(default_factory=list)
    rods: list[dict[str, Any]] = field(default_factory=list)
    links: list[list[int]] = field(default_factory=list)
    rolling: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    """Wheels and balls that roll, by body."""
    ground: dict[str, list[float]] | None = None
    """The plane of the ground on which the first of them rolls: a point and its normal, in the world."""


def pictures(
    spec: Mapping[str, Any],
    names: Sequence[str],
    joint_names: Sequence[str],
    joint_points: Mapping[str, FloatArray],
    size: float,
) -> Pictures:
    """Pictures of the couplings of a description; `places` are the coordinates (nt,) of joints with one, by name."""
    if not spec.get("couplings"):
        return Pictures()
    return _Artist(spec, names, joint_names, joint_points, size).draw()


class _Artist:
    def __init__(
        self,
        spec: Mapping[str, Any],
        names: Sequence[str],
        joint_names: Sequence[str],
        joint_points: Mapping[str, FloatArray],
        size: float,
    ) -> None:
        self.spec, self.joint_points, self.size = spec, joint_points, size
        self.body = {name: i for i, name in enumerate(names)} | {"ground": -1}
        self.joint = {name: j for j, name in enumerate(joint_names)}
        self.pose = {-1: (np.zeros(3), np.eye(3))}
        for body in spec.get("bodies", ()):
            self.pose[self.body[body["name"]]] = (np.array(body["position"]), np.array(body["orientation"]))
        self.kinds = {joint["name"]: joint["kind"] for joint in spec.get("joints", ())}
        self.turns: dict[str, Turn] = {}
        self.slides: dict[str, Turn] = {}
        for joint in spec.get("joints", ()):
            if joint["kind"] in ("revolute", "prismatic") and joint.get("axis") is not None:
                axis = np.array(joint["axis"], dtype=float)
                ends = self.body[joint["parent"]], self.body[joint["child"]]
                made = Turn(*ends, np.array(joint["point"], dtype=float), axis / np.linalg.norm(axis))
                (self.turns if joint["kind"] == "revolute" else self.slides)[joint["name"]] = made
        self.found = Pictures()
        self.pulleys: dict[tuple[int, ...], float] = {}

    def draw(self) -> Pictures:
        for coupling in self.spec.get("couplings", ()):
            if coupling["kind"] == "roll":
                self.roller(coupling)
            elif coupling.get("word") == "distance":
                self.rod(coupling["terms"][0])
            elif not self.drawn(coupling):
                self.link(coupling)
        return self.found

    def drawn(self, coupling: Mapping[str, Any]) -> bool:
        """Draw a coupling between joints, if it has a picture; return whether it has."""
        terms, word = coupling["terms"], coupling.get("word")
        joints = [term["joint"] for term in terms if term["of"] == "joint"]
        if len(joints) != len(terms):
            return False
        if all(name in self.turns for name in joints):
            if coupling["kind"] != "linear":
                return False
            if word == "belt":
                given = (coupling.get("said") or {}).get("radii")
                return self.belt(joints, coupling["factors"], given and (given["radius2"], given["radius1"]))
            return word == "gear" and self.mesh(joints, coupling["factors"])
        if len(joints) == 2 and joints[0] in self.slides and joints[1] in self.turns:
            slide, turn = self.slides[joints[0]], self.turns[joints[1]]
            if coupling["kind"] == "linear":
                radius = -coupling["factors"][1] / coupling["factors"][0]
                return self.rack(slide, turn, radius, joints[0])
            return self.cam(slide, turn, *self.law(coupling, joints))
        return False

    # ---- what moves with a body

    def local(self, body: int, point: FloatArray) -> list[float]:
        origin, turn = self.pose[body]
        return plain(turn.T @ (point - origin))

    def turned(self, body: int, direction: FloatArray) -> list[float]:
        return plain(self.pose[body][1].T @ direction)

    def rod(self, term: Mapping[str, Any]) -> None:
        """Two balls and the rod between them."""
        ends = {f"body{end}": self.body[term[f"body{end}"]] for end in (1, 2)}
        self.found.rods.append({**ends, "point1": list(term["point1"]), "point2": list(term["point2"])})

    def roller(self, coupling: Mapping[str, Any]) -> None:
        radius, centre = float(coupling["radius"]), [float(x) for x in coupling["center"]]
        part: dict[str, Any] = {"kind": "ball", "radius": radius, "center": centre}
        if coupling["axis"] is not None:
            axis = np.array(coupling["axis"], dtype=float)
            axis /= np.linalg.norm(axis)
            part = {"kind": "wheel", "radius": radius, "length": 0.08 * radius, "center": centre, "axis": axis.tolist()}
        self.found.rolling.setdefault(self.body[coupling["body"]], []).append(part)
        if self.body[coupling["on"]] < 0 and self.found.ground is None:
            self.found.ground = {word: [float(x) for x in coupling[word]] for word in ("point", "normal")}

    def link(self, coupling: Mapping[str, Any]) -> None:
        """No picture: a thin line from joint to joint indicates the coupling."""
        of = [self.joint[term["joint"]] for term in coupling["terms"] if term["of"] == "joint"]
        self.found.links += [[a, b] for a, b in pairwise(of) if a != b]

    # ---- gears

    def mesh(self, joints: Sequence[str], factors: Sequence[float]) -> bool:
        """Two wheels in contact: their rates, relative to the arm that carries both axes, have the ratio of the
        factors."""
        axes = [self.turns[name].axis for name in joints]
        parallel = all(abs(abs(axis @ axes[0]) - 1.0) < EQUAL for axis in axes)
        if not parallel:
            return len(joints) == 2 and self.bevel(joints, factors)
        weight: dict[int, float] = {}
        for name, factor in zip(joints, factors, strict=True):
            turn = self.turns[name]
            along = factor * float(np.sign(turn.axis @ axes[0]))
            weight[turn.child] = weight.get(turn.child, 0.0) + along
            weight[turn.parent] = weight.get(turn.parent, 0.0) - along
        most = max(map(abs, weight.values()))
        bodies = [body for body, w in weight.items() if abs(w) > NEGLIGIBLE * most]
        if len(bodies) != 3:
            return False
        for arm, first, second in permutations(bodies):
            if first > second:
                continue
            at = [self.axis_of(body, arm, axes[0]) for body in (first, second)]
            if at[0] is None or at[1] is None:
                continue
            apart = at[1] - at[0]
            apart = apart - (apart @ axes[0]) * axes[0]
            distance = float(np.linalg.norm(apart))
            a, b = weight[first], weight[second]
            if distance < EQUAL_IN_SIX_DIGITS * self.size or abs(a + b) < NEGLIGIBLE * most:
                continue
            scale = distance / (abs(a) + abs(b)) if a * b > 0 else distance / abs(abs(a) - abs(b))
            radii = abs(a) * scale, abs(b) * scale
            self.pair((first, second), (at[0], at[1]), radii, axes[0], apart / distance, inside=a * b < 0)
            return True
        return False

    def seat(self, turn: Turn) -> tuple[int, ...]:
        """The body of a hinge and its place there, the same for all that are in one place."""
        return turn.child, *np.round(turn.point / (EQUAL * self.size or 1.0)).astype(int).tolist()

    def axis_of(self, body: int, arm: int, along: FloatArray) -> FloatArray | None:
        """A point of the axis about which a body rotates relative to the arm: a hinge between them, or a shared
        line."""
        near = [turn for turn in self.turns.values() if abs(abs(turn.axis @ along) - 1.0) < EQUAL]
        for turn in near:
            if {turn.parent, turn.child} == {body, arm}:
                return turn.point
        for one in near:
            for other in near:
                if one is other or body not in (one.parent, one.child) or arm not in (other.parent, other.child):
                    continue
                shared = {one.parent, one.child} & {other.parent, other.child}
                beside = other.point - one.point
                if shared and np.linalg.norm(beside - (beside @ along) * along) < EQUAL * self.size:
                    return one.point
        return None

    def pair(
        self,
        bodies: tuple[int, int],
        at: tuple[FloatArray, FloatArray],
        radii: tuple[float, float],
        axis: FloatArray,
        direction: FloatArray,
        inside: bool,
    ) -> None:
        """Add two wheels in mesh; `direction` points from the first centre to the second."""
        width = 0.22 * min(radii)
        large = 0 if radii[0] >= radii[1] else 1
        side = direction if large == 0 else -direction
        contact = (side, side) if inside else (direction, -direction)
        centres = list(at)
        if inside:  # the ring is drawn next to its wheel, wherever on its axis it is hinged
            centres[large] = at[large] + ((at[1 - large] - at[large]) @ axis) * axis
        wheels = []
        for i in (0, 1):
            old = self.wheel(bodies[i], centres[i], radii[i])
            made = old or {
                "body": bodies[i],
                "center": self.local(bodies[i], centres[i]),
                "radius": radii[i],
                "width": width,
                "axis": self.turned(bodies[i], axis),
                "first": self.turned(bodies[i], contact[i]),
                "ring": inside and i == large,
            }
            wheels.append((made, old is not None))
        teeth = self.teeth(radii, [wheel.get("teeth") for wheel, _ in wheels])
        for (wheel, _), n in zip(wheels, teeth, strict=True):
            wheel.setdefault("teeth", n)
        if not wheels[0][1] and not wheels[1][1]:
            wheels[0][0]["phase"], wheels[1][0]["phase"] = 0.0, np.pi / teeth[1]
        elif wheels[0][1] != wheels[1][1]:
            known = 0 if wheels[0][1] else 1
            self.follow(wheels[known][0], wheels[1 - known][0], contact[known], axis, inside)
        self.found.wheels += [wheel for wheel, old in wheels if not old]

    def wheel(self, body: int, centre: FloatArray, radius: float) -> dict[str, Any] | None:
        here = np.array(self.local(body, centre))
        for wheel in self.found.wheels:
            same = wheel["body"] == body and abs(wheel["radius"] - radius) < EQUAL_IN_SIX_DIGITS * radius
            if same and np.linalg.norm(np.array(wheel["center"]) - here) < EQUAL_IN_SIX_DIGITS * self.size:
                return wheel
        return None

    @staticmethod
    def teeth(radii: Sequence[float], known: Sequence[int | None]) -> list[int]:
        """Numbers of teeth in proportion to the radii; for a new pair those that approximate the ratio best."""
        for i, n in enumerate(known):
            if n is not None:
                return [n if i == j else known[j] or max(5, round(n * radii[j] / radii[i])) for j in (0, 1)]
        small = 0 if radii[0] <= radii[1] else 1
        ratio = radii[1 - small] / radii[small]
        few = min(TEETH, key=lambda n: (round(abs(n * ratio - round(n * ratio)), 6), n))
        found = [few, round(few * ratio)]
        return found if small == 0 else found[::-1]

    def follow(
        self, known: Mapping[str, Any], new: dict[str, Any], contact: FloatArray, axis: FloatArray, inside: bool
    ) -> None:
        """Rotate the teeth of a new wheel so that a gap faces a tooth of the known one."""
        turn = self.pose[known["body"]][1]
        first = turn @ np.array(known["first"])
        angle = float(np.arctan2(np.cross(first, contact) @ axis, first @ contact)) - known["phase"]
        part = angle * known["teeth"] / (2.0 * np.pi)
        pitch = 2.0 * np.pi / new["teeth"]
        new["phase"] = 0.5 * pitch + (part if not inside else -part) % 1.0 * pitch

    def bevel(self, joints: Sequence[str], factors: Sequence[float]) -> bool:
        """Two wheels whose axes intersect: their pitch cones touch along the line of equal velocity."""
        a, b = (self.turns[name] for name in joints)
        if a.parent != b.parent:
            return False
        normal = np.cross(a.axis, b.axis)
        beside = b.point - a.point
        if abs(beside @ normal) > EQUAL_IN_SIX_DIGITS * self.size * np.linalg.norm(normal):
            return False  # the axes are skew
        along = np.cross(beside, b.axis) @ normal / (normal @ normal)
        apex = a.point + along * a.axis
        line = factors[1] * a.axis + factors[0] * b.axis
        line /= np.linalg.norm(line)
        arms = [turn.point - apex for turn in (a, b)]
        if line @ (arms[0] + arms[1]) < 0:
            line = -line
        lengths = [float(np.linalg.norm(np.cross(line, turn.axis))) for turn in (a, b)]
        far = max(float(np.linalg.norm(r)) for r in arms) or 0.3 * self.size
        scale = 0.6 * far / max(lengths)
        tips = []
        for turn, radius in zip((a, b), lengths, strict=True):
            centre = apex + scale * (line @ turn.axis) * turn.axis
            tips.append((centre, radius * scale, turn))
        if min(lengths) < VISIBLE * max(lengths):
            return False
        teeth = self.teeth(lengths, [None, None])
        for (centre, radius, turn), n in zip(tips, teeth, strict=True):
            if np.linalg.norm(centre - turn.point) > BESIDE * radius:  # a shaft to the wheel from its bearing
                ends = {f"body{end}": turn.child for end in (1, 2)}
                joint_points = self.local(turn.child, turn.point), self.local(turn.child, centre)
                self.found.rods.append({**ends, "point1": joint_points[0], "point2": joint_points[1]})
            towards = scale * line - (centre - apex)
            self.found.wheels.append(
                {
                    "body": turn.child,
                    "center": self.local(turn.child, centre),
                    "radius": radius,
                    "width": 0.2 * scale * min(lengths),
                    "axis": self.turned(turn.child, turn.axis),
                    "first": self.turned(turn.child, towards / np.linalg.norm(towards)),
                    "ring": False,
                    "teeth": n,
                    "phase": 0.0 if turn is a else np.pi / n,
                }
            )
        return True

    # ---- belts, racks, cams

    def belt(self, joints: Sequence[str], factors: Sequence[float], radii: Sequence[float] | None) -> bool:
        """Two pulleys and the belt around both, open or crossed by the sign of the ratio; to scale where given radii
        fit between the axes."""
        if len(joints) != 2:
            return False
        a, b = (self.turns[name] for name in joints)
        if a.parent != b.parent or abs(abs(a.axis @ b.axis) - 1.0) > EQUAL:
            return False
        axis = a.axis
        apart = b.point - a.point
        apart = apart - (apart @ axis) * axis
        distance = float(np.linalg.norm(apart))
        if distance < EQUAL_IN_SIX_DIGITS * self.size:
            return False
        x = apart / distance
        y = np.cross(axis, x)
        crossed = factors[0] * factors[1] * float(np.sign(a.axis @ b.axis)) > 0
        weights = abs(factors[0]), abs(factors[1])
        scale = PULLEYS * distance / sum(weights)
        for turn, weight in zip((a, b), weights, strict=True):  # a pulley already drawn for another belt
            known = self.pulleys.get(self.seat(turn))
            if known is not None and known / weight * sum(weights) < MOST_PULLEYS * distance:
                scale = known / weight
        drawn = list(radii) if radii and sum(radii) < distance else [weight * scale for weight in weights]
        for turn, radius in zip((a, b), drawn, strict=True):
            self.pulleys.setdefault(self.seat(turn), radius)
            self.found.wheels.append(
                {
                    "body": turn.child,
                    "center": self.local(turn.child, turn.point),
                    "radius": radius,
                    "width": 0.25 * min(drawn),
                    "axis": self.turned(turn.child, axis),
                    "first": self.turned(turn.child, x),
                    "ring": False,
                    "teeth": 0,
                    "phase": 0.0,
                }
            )
        lean = np.arccos(((drawn[0] + drawn[1]) if crossed else (drawn[0] - drawn[1])) / distance)
        # Around the first from its upper point of contact by the far side to the lower one, then around the second.
        first = np.linspace(lean, 2.0 * np.pi - lean, ROUND)
        second = np.linspace(-lean, lean, ROUND) if not crossed else np.linspace(np.pi - lean, lean - np.pi, ROUND)
        middle = b.point + ((a.point - b.point) @ axis) * axis
        ring = [a.point + drawn[0] * (np.cos(t) * x + np.sin(t) * y) for t in first]
        ring += [middle + drawn[1] * (np.cos(t) * x + np.sin(t) * y) for t in second]
        self.line(a.parent, ring, closed=True, look="belt")
        return True

    def rack(self, slide: Turn, turn: Turn, radius: float, name: str) -> bool:
        """A pinion, and a rack as long as its travel; the sign of the radius determines the side."""
        up = np.cross(slide.axis, turn.axis)
        if np.linalg.norm(up) < EQUAL_IN_SIX_DIGITS:
            return False
        up *= np.sign(radius) / np.linalg.norm(up)
        radius = abs(radius)
        n = 18
        pitch = 2.0 * np.pi * radius / n
        along = np.cross(turn.axis, up)
        self.found.wheels.append(
            {
                "body": turn.child,
                "center": self.local(turn.child, turn.point),
                "radius": radius,
                "width": 0.5 * radius,
                "axis": self.turned(turn.child, turn.axis),
                "first": self.turned(turn.child, up),
                "ring": False,
                "teeth": n,
                "phase": 0.0,
            }
        )
        travel = self.joint_points.get(name, np.zeros(1)) * float(np.sign(slide.axis @ along))
        low, high = (round(x / pitch) for x in (np.nanmin(-travel) - radius, np.nanmax(-travel) + radius))
        touch = turn.point + radius * up
        teeth = range(low - 3, min(high + 4, low + 4000))
        points = []
        for k in teeth:  # gaps at whole pitches, where the pinion has its teeth
            for part, height in ((0.18, 1.1), (0.34, -0.9), (0.66, -0.9), (0.82, 1.1)):
                points.append(touch + (k + part) * pitch * along + height * radius * 2.0 / n * up)
        self.line(slide.child, points, closed=False, look="rack")
        return True

    def law(self, coupling: Mapping[str, Any], joints: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Lifts and angles (n,) of a cam: its table, or the values of its function during a run."""
        if coupling["kind"] == "curve":
            curve = coupling["curve"]
            return np.array(curve["coefficients"])[:, -1], np.array(curve["breaks"])[:-1]
        lift, angle = (self.joint_points.get(name, np.empty(0)) for name in joints)
        return lift, angle

    def cam(self, slide: Turn, turn: Turn, lift: FloatArray, angle: FloatArray) -> bool:
        """The outline of the cam for a pointed follower on its slide, and the follower."""
        if abs(slide.axis @ turn.axis) > EQUAL_IN_SIX_DIGITS or len(lift) < 8 or not np.isfinite(lift + angle).all():
            return False
        arms = slide.point - turn.point
        up = slide.axis * (1.0 if arms @ slide.axis >= 0 else -1.0)
        beside = arms - (arms @ up) * up - (arms @ turn.axis) * turn.axis
        stroke = float(np.ptp(lift))
        if np.linalg.norm(beside) > EQUAL_IN_SIX_DIGITS * self.size or stroke == 0.0:
            return False
        rise = lift * float(np.sign(up @ slide.axis))
        base = max(2.0 * stroke, 0.3 * float(arms @ up)) - float(rise.min())
        side = np.cross(turn.axis, up)
        order = np.argsort(angle % (2.0 * np.pi))
        turned = -(angle % (2.0 * np.pi))[order]
        radius = (base + rise)[order]
        closed = float(np.ptp(angle)) > CLOSED_TURN
        step = max(1, len(order) // LONGEST_PATH)
        ring = [
            turn.point + r * (np.cos(t) * up + np.sin(t) * side)
            for t, r in zip(turned[::step], radius[::step], strict=True)
        ]
        self.line(turn.child, ring, closed=closed, look="cam")
        foot = turn.point + base * up
        self.found.rods.append(
            {
                "body1": slide.child,
                "point1": self.local(slide.child, foot),
                "body2": slide.child,
                "point2": self.local(slide.child, slide.point),
            }
        )
        return True

    def line(self, body: int, points: Sequence[FloatArray], closed: bool, look: str) -> None:
        self.found.lines.append(
            {"body": body, "points": [self.local(body, p) for p in points], "closed": closed, "look": look}
        )
