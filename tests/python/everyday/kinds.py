"""Readable mechanisms of engineers, exact as drawn: each function draws one with dimensions by chance.

In its own axes a plane mechanism moves across z; `chance` turns the whole. What is doubled left and right has the same
joints at two heights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from oracle.drawing import GROUND, Array, Body, Coupling, Drawing, Joint, unit

X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Kind:
    """A mechanism without loads: its degrees of freedom, the joints that may be moved with the pace of each, and
    points far out on bodies (body, point in its axes)."""

    words: str
    drawing: Drawing
    mobility: int
    inputs: tuple[tuple[str, float], ...]
    tips: tuple[tuple[str, Array], ...]
    pairs: tuple[tuple[str, str], ...] = ()
    """Bodies whose tips may strike each other."""


@dataclass
class Sketch:
    """A drawing under way."""

    rng: Any
    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)

    def number(self, low: float, high: float) -> float:
        """With three digits, as one draws."""
        return float(f"{self.rng.uniform(low, high):.3g}")

    def maybe(self, chance: float) -> bool:
        return bool(self.rng.random() < chance)

    def body(self, name: str, *points: Any, mass: float | None = None) -> str:
        """A box about the points; its origin is the first of them."""
        at = np.array([np.asarray(p, dtype=float) for p in points])
        mass = self.number(0.5, 3.0) if mass is None else mass
        edges = np.ptp(at, axis=0) + 0.12
        inertia = np.diag(np.round(mass * (edges @ edges - edges**2) / 12.0, 6))
        self.bodies.append(Body(name, mass, inertia, np.round(at.mean(axis=0) - at[0], 4), at[0], np.eye(3)))
        return name

    def joint(
        self, kind: str, name: str, parent: str, child: str, point: Any, axis: Any = Z, second: Any = None
    ) -> str:
        a = np.asarray(axis, dtype=float)
        rest = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))]) if second is None else np.asarray(second, dtype=float)
        axes = np.column_stack([a, rest, np.cross(a, rest)])
        self.joints.append(Joint(name, kind, parent, child, np.asarray(point, dtype=float), axes))
        return name

    def hinge(self, name: str, parent: str, child: str, point: Any, axis: Any = Z, width: float = 0.0) -> str:
        """One hinge, or two on one axis at both ends of a width."""
        if not width:
            return self.joint("revolute", name, parent, child, point, axis)
        half = 0.5 * width * np.asarray(axis, dtype=float)
        self.joint("revolute", f"{name} left", parent, child, np.asarray(point) - half, axis)
        second = str(self.rng.choice(["revolute", "revolute", "revolute", "cylindrical", "spherical"]))
        self.joint(second, f"{name} right", parent, child, np.asarray(point) + half, axis)
        return f"{name} left"

    def kind_of(self, joint: str) -> str:
        return next(j.kind for j in self.joints if j.name == joint)

    def gear(self, name: str, first: str, second: str, ratio: float) -> None:
        self.couple(name, first, second, ratio, "add_gear", (ratio,))

    def belt(self, name: str, first: str, second: str, radius1: float, radius2: float) -> None:
        self.couple(name, first, second, radius1 / radius2, "add_belt", (radius1, radius2))

    def rack(self, name: str, pinion: str, slide: str, radius: float) -> None:
        self.couple(name, pinion, slide, radius, "add_rack", (radius,))

    def couple(self, name: str, first: str, second: str, ratio: float, call: str, numbers: tuple[float, ...]) -> None:
        """The rate of the second is so many times that of the first."""
        terms = [{"of": "joint", "joint": joint, "coordinate": 0} for joint in (second, first)]
        data = {"terms": terms, "factors": [1.0, -ratio], "offset": 0.0}
        self.couplings.append(Coupling(name, "linear", data, (call, (first, second, *numbers), {"name": name})))

    def kind(
        self, words: str, mobility: int, inputs: list[tuple[str, float]], tips: list[tuple[str, Any]],
        gravity: Any = (0.0, -9.81, 0.0), pairs: tuple[tuple[str, str], ...] = (),
    ) -> Kind:  # fmt: skip
        """Finished; `tips` as points of the drawing."""
        origin = {b.name: b.position for b in self.bodies}
        drawing = Drawing(
            np.array(gravity), tuple(self.bodies), tuple(self.joints), words=words, couplings=tuple(self.couplings)
        )
        seen = tuple((name, np.round(np.asarray(p, dtype=float) - origin[name], 6)) for name, p in tips)
        return Kind(words, drawing, mobility, tuple(inputs), seen, pairs)


def far(p: Any, length: float, angle: float) -> Array:
    """A point so far from another one, in the plane."""
    return np.asarray(p, dtype=float) + length * np.array([np.cos(angle), np.sin(angle), 0.0])


def beside(p: Any, x: float, y: float = 0.0, z: float = 0.0) -> Array:
    """A point so much further along the axes."""
    return np.asarray(p, dtype=float) + np.array([x, y, z])


def met(p: Array, r: float, q: Array, s: float, side: float) -> Array:
    """The point at distance r from p and s from q, in the plane."""
    d = q - p
    length = float(np.linalg.norm(d))
    x = (length**2 + r**2 - s**2) / (2.0 * length)
    e = d / length
    return p + x * e + side * float(np.sqrt(r**2 - x**2)) * np.array([-e[1], e[0], 0.0])


def door(rng: Any) -> Kind:
    """A leaf, or a lid, on two or three hinges in line; perhaps a flap on it."""
    s = Sketch(rng)
    wide, high = s.number(0.4, 1.2), s.number(0.6, 2.0)
    s.body("leaf", (0, 0, -high / 2), (wide, 0, high / 2), mass=s.number(2, 8))
    lower = s.hinge("hinge", GROUND, "leaf", (0, 0, 0), Z, 0.8 * high)
    if s.maybe(0.3):
        s.joint("revolute", "hinge middle", GROUND, "leaf", (0, 0, 0), Z)
    inputs, tips, mobility = [(lower, 3.0)], [("leaf", (wide, 0, 0))], 1
    if s.maybe(0.4):
        s.body("flap", (wide, 0, -high / 3), (wide + 0.4, 0.0, high / 3))
        inputs.append((s.hinge("edge", "leaf", "flap", (wide, 0, 0), Z, 0.5 * high), 3.0))
        tips.append(("flap", (wide + 0.4, 0, 0)))
        mobility = 2
    gravity = (0.0, 0.0, -9.81) if s.maybe(0.5) else (0.0, -9.81, 0.0)
    return s.kind("door", mobility, inputs, tips, gravity)


def shafts(rng: Any) -> Kind:
    """Shafts in two bearings each, geared one to the other."""
    s = Sketch(rng)
    count = int(rng.integers(1, 4))
    y, inputs, tips = 0.0, [], []
    previous = ""
    for i in range(count):
        name = s.body(f"shaft {i}", (0, y, -0.3), (0.05, y + 0.2, 0.3))
        inputs.append((s.hinge(f"bearing {i}", GROUND, name, (0, y, 0), Z, 0.6), 10.0))
        tips.append((name, (0.2, y, 0.1)))
        if previous:
            s.gear(f"gear {i}", previous, inputs[-1][0], -s.number(0.4, 2.0))
        previous, y = inputs[-1][0], y + 0.5
    return s.kind("shafts", 1, inputs[:1], tips)


def four_bar(rng: Any) -> Kind:
    """Crank, coupler and rocker, perhaps every joint a clevis."""
    s = Sketch(rng)
    width = 0.3 if s.maybe(0.5) else 0.0
    crank, base = s.number(0.2, 0.4), s.number(0.9, 1.2)
    a = np.round(far((0, 0, 0), crank, s.number(0.5, 2.5)), 3)
    d = np.array([base, 0.0, 0.0])
    b = met(a, s.number(0.9, 1.3), d, s.number(0.7, 1.0), 1.0)
    s.body("crank", (0, 0, 0), a)
    s.body("coupler", a, b)
    s.body("rocker", d, b)
    first = s.hinge("A", GROUND, "crank", (0, 0, 0), Z, width)
    s.hinge("B", "crank", "coupler", a, Z, width)
    s.hinge("C", "coupler", "rocker", b, Z, width)
    last = s.hinge("D", GROUND, "rocker", d, Z, width)
    return s.kind("four-bar", 1, [(first, 5.0), (last, 2.0)], [("coupler", b), ("rocker", b)])


def slider_crank(rng: Any) -> Kind:
    """A crank in one or two bearings, a rod and a piston."""
    s = Sketch(rng)
    crank, rod, offset = s.number(0.1, 0.3), s.number(0.6, 1.0), s.number(-0.05, 0.05)
    a = np.round(far((0, 0, 0), crank, s.number(0.4, 2.6)), 3)
    b = np.array([a[0] + float(np.sqrt(rod**2 - (a[1] - offset) ** 2)), offset, 0.0])
    width = 0.2 if s.maybe(0.5) else 0.0
    s.body("crank", (0, 0, 0), a)
    s.body("rod", a, b)
    s.body("piston", b, beside(b, 0.1, 0.05))
    first = s.hinge("A", GROUND, "crank", (0, 0, 0), Z, width)
    s.hinge("B", "crank", "rod", a, Z, width if s.maybe(0.5) else 0.0)
    s.hinge("C", "rod", "piston", b, Z, 0.0)
    slide = s.joint(str(rng.choice(["prismatic", "cylindrical"])), "bore", GROUND, "piston", b, X)
    if s.maybe(0.3):
        s.joint("prismatic", "guide", GROUND, "piston", beside(b, 0.0, 0.2), X)
    inputs = [(first, 6.0)] + (
        [(slide, 1.0)] if s.joints[-1].kind == "prismatic" and s.joints[-1].name == "bore" else []
    )
    return s.kind("slider-crank", 1, inputs, [("piston", beside(b, 0.1)), ("rod", b)])


def scissor(rng: Any) -> Kind:
    """A lift of one or two stages, its left and right side between the ground and one platform."""
    s = Sketch(rng)
    stages, sides = int(rng.integers(1, 3)), "lr" if s.maybe(0.6) else "l"
    c, h, w = s.number(0.6, 1.0), s.number(0.3, 0.6), s.number(0.3, 0.6)
    top = stages * h
    s.body("platform", (0, top, 0), (c, top, w), mass=s.number(2, 6))
    first = ""
    for k, side in enumerate(sides):

        def at(x: float, y: float, z: float = w * k) -> Array:
            return np.array([x, y, z])

        for i in range(stages):
            a, b = f"a{i}{side}", f"b{i}{side}"
            s.body(a, at(0, i * h), at(c, (i + 1) * h))
            s.body(b, at(c, i * h), at(0, (i + 1) * h))
            s.hinge(f"X{i}{side}", a, b, at(c / 2, (i + 0.5) * h))
            if i:
                s.hinge(f"L{i}{side}", f"b{i - 1}{side}", a, at(0, i * h))
                s.hinge(f"R{i}{side}", f"a{i - 1}{side}", b, at(c, i * h))
        foot = s.hinge(f"A{side}", GROUND, f"a0{side}", at(0, 0))
        first = first or foot
        s.body(f"shoe{side}", at(c, 0), at(c + 0.05, 0.05))
        s.hinge(f"S{side}", f"shoe{side}", f"b0{side}", at(c, 0))
        s.joint("prismatic", f"P{side}", GROUND, f"shoe{side}", at(c, 0), X)
        s.hinge(f"T{side}", f"b{stages - 1}{side}", "platform", at(0, top))
        s.body(f"roller{side}", at(c, top), at(c + 0.05, top + 0.05))
        s.hinge(f"U{side}", f"a{stages - 1}{side}", f"roller{side}", at(c, top))
        s.joint("prismatic", f"V{side}", "platform", f"roller{side}", at(c, top), X)
    return s.kind("scissor lift", 1, [(first, 0.4), ("Pl", 0.3)], [("platform", (c, top, 0))])


def parallelogram(rng: Any) -> Kind:
    """Two to four rockers, all alike, under one coupler, or two pairs of them left and right."""
    s = Sketch(rng)
    arm = np.round(far((0, 0, 0), s.number(0.4, 0.8), s.number(0.9, 2.2)), 3)
    count, rows = int(rng.integers(2, 4)), (0.0, 0.4) if s.maybe(0.5) else (0.0,)
    step, first = s.number(0.5, 0.9), ""
    s.body("coupler", arm, beside(arm, step * (count - 1), 0.0, rows[-1]))
    for z in rows:
        for i in range(count):
            foot, name = np.array([i * step, 0.0, z]), f"rocker {i}{' right' if z else ''}"
            s.body(name, foot, foot + arm)
            low = s.hinge(f"low of {name}", GROUND, name, foot)
            s.hinge(f"high of {name}", name, "coupler", foot + arm)
            first = first or low
    return s.kind("parallelogram", 1, [(first, 1.5)], [("coupler", beside(arm, step))])


def pendulum(rng: Any) -> Kind:
    """One or two rods in a row, whose hinges may be doubled."""
    s = Sketch(rng)
    p, base, inputs, tips = np.zeros(3), GROUND, [], []
    for i in range(int(rng.integers(1, 3))):
        q = np.round(far(p, s.number(0.4, 1.0), s.number(-2.6, -0.5)), 3)
        name = s.body(f"rod {i}", p, q)
        inputs.append((s.hinge(f"A{i}", base, name, p, Z, 0.2 if s.maybe(0.4) else 0.0), 4.0))
        tips.append((name, q))
        p, base = q, name
    return s.kind("pendulum", len(inputs), inputs, tips)


def arms(rng: Any) -> Kind:
    """Two to four arms on hinges side by side, whose tips may strike."""
    s = Sketch(rng)
    inputs, tips = [], []
    count = int(rng.integers(2, 5))
    for i in range(count):
        foot = np.array([1.9 * i, 0.0, 0.0])
        tip = np.round(far(foot, s.number(0.9, 1.1), s.number(0.0, 6.2)), 3)
        name = s.body(f"arm {i}", foot, tip)
        inputs.append((s.hinge(f"A{i}", GROUND, name, foot), 8.0))
        tips.append((name, tip))
    pairs = tuple((f"arm {i}", f"arm {i + 1}") for i in range(count - 1))
    return s.kind("arms", count, inputs, tips, (0.0, -9.81, 0.0) if s.maybe(0.5) else (0.0, 0.0, 0.0), pairs)


def flywheel(rng: Any) -> Kind:
    """A wheel at speed, perhaps with a second one on it by a shaft that twists."""
    s = Sketch(rng)
    s.body("wheel", (0, 0, 0), (0.5, 0.5, 0.05), mass=s.number(2, 6))
    inputs = [(s.hinge("A", GROUND, "wheel", (0, 0, 0), Z, 0.3 if s.maybe(0.4) else 0.0), 30.0)]
    tips = [("wheel", (0.4, 0, 0))]
    if s.maybe(0.4):
        s.body("second", (0, 0, 0.2), (0.3, 0.3, 0.25))
        inputs.append((s.hinge("B", "wheel", "second", (0, 0, 0.2)), 10.0))
        tips.append(("second", (0.2, 0.1, 0.2)))
    # the wheels turn about their middle
    s.bodies = [Body(b.name, b.mass, b.inertia, np.array([0.01, 0.0, 0.0]), b.position, b.rotation) for b in s.bodies]
    return s.kind("flywheel", len(inputs), inputs, tips)


def cart(rng: Any) -> Kind:
    """A cart on one or two rails, perhaps with a pendulum that hangs from it."""
    s = Sketch(rng)
    s.body("cart", (0, 0, 0), (0.5, 0.2, 0.3), mass=s.number(1, 4))
    inputs, tips = [(s.joint("prismatic", "rail", GROUND, "cart", (0, 0, 0), X), 2.0)], [("cart", (0.5, 0.1, 0))]
    if s.maybe(0.5):
        kind = str(rng.choice(["prismatic", "cylindrical"]))
        s.joint(kind, "rail right", GROUND, "cart", (0, 0, 0.3), X)
    if s.maybe(0.6):
        q = np.round(far((0.2, 0, 0), s.number(0.3, 0.8), s.number(-2.4, -0.6)), 3)
        s.body("bob", (0.2, 0, 0), q)
        inputs.append((s.hinge("H", "cart", "bob", (0.2, 0, 0)), 3.0))
        tips.append(("bob", q))
    return s.kind("cart", len(inputs), inputs, tips)


def corner(rng: Any) -> Kind:
    """The corner of a car: an arm on two bushes, a knuckle whose strut slides, and a tie rod."""
    s = Sketch(rng)
    ball = np.array([0.0, s.number(0.3, 0.4), s.number(-0.05, 0.05)])
    top = np.array([s.number(-0.05, 0.0), s.number(0.15, 0.2), s.number(0.5, 0.6)])
    inner = np.array([s.number(0.1, 0.15), 0.05, s.number(-0.05, 0.05)])
    outer = np.array([s.number(0.1, 0.15), s.number(0.3, 0.35), s.number(-0.02, 0.05)])
    along = np.round(unit(top - ball), 6)
    middle = ball + 0.5 * (top - ball)
    s.body("arm", (0, 0, 0), ball)
    s.body("knuckle", ball, middle, mass=s.number(5, 15))
    s.body("rod", middle, top)
    s.body("tie", inner, outer, mass=s.number(0.3, 0.8))
    bush = s.hinge("bush", GROUND, "arm", (0, 0, 0), X, 0.2)
    s.joint("spherical", "ball", "arm", "knuckle", ball)
    s.joint("cylindrical", "strut", "knuckle", "rod", middle, along)
    s.joint("universal", "top", GROUND, "rod", top, X)
    s.joint("universal", "inner", GROUND, "tie", inner, Z)
    s.joint("spherical", "outer", "tie", "knuckle", outer)
    return s.kind("corner", 1, [(bush, 1.0)], [("knuckle", beside(ball, 0, 0.1))], (0.0, 0.0, -9.81))


def bonnet(rng: Any) -> Kind:
    """A lid on two hinges of four bars each, left and right."""
    s = Sketch(rng)
    a0, b0 = np.zeros(3), np.array([s.number(0.08, 0.15), s.number(-0.05, 0.02), 0.0])
    a1 = np.round(far(a0, s.number(0.15, 0.2), s.number(0.9, 1.4)), 3)
    b1 = np.round(far(b0, s.number(0.15, 0.22), s.number(0.7, 1.2)), 3)
    width, first = s.number(0.8, 1.2), ""
    s.body("lid", a1, beside(b1, s.number(0.5, 1.0), 0.0, width), mass=s.number(4, 10))
    for side, z in (("left", 0.0), ("right", width)):
        for name, p, q in (("front", a0, a1), ("rear", b0, b1)):
            low, high = beside(p, 0, 0, z), beside(q, 0, 0, z)
            link = s.body(f"{name} {side}", low, high, mass=s.number(0.3, 0.6))
            joint = s.hinge(f"low of {link}", GROUND, link, low)
            s.hinge(f"high of {link}", link, "lid", high)
            first = first or joint
    return s.kind("bonnet", 1, [(first, 0.5)], [("lid", beside(b1, 0.5))])


def gimbals(rng: Any) -> Kind:
    """A rotor in two rings, each in two bearings."""
    s = Sketch(rng)
    s.body("outer", (0, 0, 0), (0.0, 0.4, 0.4))
    s.body("inner", (0, 0, 0), (0.3, 0.0, 0.3))
    s.body("rotor", (0, 0, 0), (0.2, 0.2, 0.02))
    s.bodies = [Body(b.name, b.mass, b.inertia, np.zeros(3), b.position, b.rotation) for b in s.bodies]
    first = s.hinge("outer axis", GROUND, "outer", (0, 0, 0), X, 0.8)
    second = s.hinge("inner axis", "outer", "inner", (0, 0, 0), Y, 0.6)
    third = s.hinge("spin", "inner", "rotor", (0, 0, 0), Z, 0.4)
    tips = [("rotor", (0.2, 0, 0)), ("inner", (0.3, 0, 0))]
    return s.kind("gimbals", 3, [(third, 30.0), (first, 0.5), (second, 0.5)], tips)


def belts(rng: Any) -> Kind:
    """Pulleys and wheels, each driven by the one before, and a weight on a rack."""
    s = Sketch(rng)
    x, previous, first, tips = 0.0, "", "", []
    for i in range(int(rng.integers(2, 5))):
        name = s.body(f"pulley {i}", (x, 0, 0), (x + 0.15, 0.15, 0.05))
        joint = s.hinge(f"axle {i}", GROUND, name, (x, 0, 0), Z, 0.2 if s.maybe(0.4) else 0.0)
        if previous:
            s.belt(f"belt {i}", previous, joint, s.number(0.05, 0.2), s.number(0.05, 0.2))
        tips.append((name, (x + 0.1, 0.1, 0)))
        first, previous, x = first or joint, joint, x + 0.6
    if s.maybe(0.5):
        s.body("weight", (x, 0, 0), (x + 0.1, 0.3, 0.1))
        s.joint("prismatic", "guide", GROUND, "weight", (x, 0, 0), Y)
        s.rack("rack", previous, "guide", s.number(0.03, 0.1))
    return s.kind("belts", 1, [(first, 8.0)], tips)


def robot(rng: Any) -> Kind:
    """A turning base, an arm, and a forearm that is held by a parallel linkage."""
    s = Sketch(rng)
    shoulder = np.array([0.1, s.number(0.4, 0.6), 0.0])
    elbow = np.round(far(shoulder, s.number(0.6, 0.9), s.number(0.9, 1.5)), 3)
    back = np.array([-s.number(0.2, 0.3), s.number(-0.1, 0.1), 0.0])
    wrist = np.round(far(elbow, s.number(0.6, 0.9), s.number(-0.5, 0.3)), 3)
    s.body("base", (0, 0, 0), (0.3, 0.5, 0.3), mass=10.0)
    s.body("arm", shoulder, elbow, mass=s.number(3, 6))
    s.body("crank", shoulder, shoulder + back)
    s.body("link", shoulder + back, elbow + back)
    s.body("forearm", elbow, elbow + back, wrist, mass=s.number(2, 4))
    turn = s.hinge("turn", GROUND, "base", (0, 0, 0), Y, 0.4 if s.maybe(0.4) else 0.0)
    lift = s.hinge("lift", "base", "arm", shoulder, Z, 0.2 if s.maybe(0.4) else 0.0)
    pull = s.hinge("pull", "base", "crank", shoulder)
    s.hinge("elbow", "arm", "forearm", elbow, Z, 0.2 if s.maybe(0.3) else 0.0)
    s.hinge("low", "crank", "link", shoulder + back)
    s.hinge("high", "link", "forearm", elbow + back)
    return s.kind("robot arm", 3, [(turn, 1.5), (lift, 0.8), (pull, 0.8)], [("forearm", wrist)])


def excavator(rng: Any) -> Kind:
    """A boom that a cylinder holds, perhaps two of them left and right."""
    s = Sketch(rng)
    eye = np.round(far((0, 0, 0), s.number(0.8, 1.2), s.number(0.3, 0.9)), 3)
    foot = np.array([s.number(0.3, 0.5), s.number(-0.4, -0.2), 0.0])
    tip = np.round(far((0, 0, 0), s.number(1.5, 2.2), s.number(0.2, 0.6)), 3)
    s.body("boom", (0, 0, 0), eye, tip, mass=s.number(10, 30))
    hinge = s.hinge("boom hinge", GROUND, "boom", (0, 0, 0), Z, 0.4 if s.maybe(0.5) else 0.0)
    along, first = np.round(unit(eye - foot), 9), ""
    for side, z in (("", 0.0), (" right", 0.3)) if s.maybe(0.5) else (("", 0.0),):
        low, high = beside(foot, 0, 0, z), beside(eye, 0, 0, z)
        s.body(f"tube{side}", low, low + 0.5 * (eye - foot))
        s.body(f"rod{side}", high, high - 0.4 * (eye - foot))
        s.hinge(f"foot{side}", GROUND, f"tube{side}", low)
        stroke = s.joint("prismatic", f"stroke{side}", f"tube{side}", f"rod{side}", 0.5 * (low + high), along)
        s.hinge(f"eye{side}", f"rod{side}", "boom", high)
        first = first or stroke
    return s.kind("excavator", 1, [(first, 0.3), (hinge, 0.5)], [("boom", tip)])


def toggle(rng: Any) -> Kind:
    """A press: a crank whose rod straightens two links above a ram."""
    s = Sketch(rng)
    knee = np.array([s.number(0.1, 0.2), s.number(-0.5, -0.4), 0.0])
    ram = np.array([0.0, knee[1] - s.number(0.45, 0.6), 0.0])
    axle = np.array([s.number(0.8, 1.0), knee[1] + s.number(-0.1, 0.1), 0.0])
    pin = np.round(far(axle, s.number(0.06, 0.09), s.number(0.5, 2.5)), 3)
    s.body("upper", (0, 0, 0), knee)
    s.body("lower", knee, ram)
    s.body("ram", ram, beside(ram, 0.1, -0.2), mass=s.number(2, 8))
    s.body("crank", axle, pin)
    s.body("rod", pin, knee)
    s.hinge("frame", GROUND, "upper", (0, 0, 0))
    s.hinge("knee", "upper", "lower", knee)
    s.hinge("foot", "lower", "ram", ram)
    s.joint("prismatic", "guide", GROUND, "ram", ram, Y)
    first = s.hinge("axle", GROUND, "crank", axle, Z, 0.3 if s.maybe(0.5) else 0.0)
    s.hinge("pin", "crank", "rod", pin)
    s.hinge("rod end", "rod", "upper", knee)
    return s.kind("toggle press", 1, [(first, 5.0)], [("ram", beside(ram, 0.1, -0.2)), ("lower", ram)])


def cardan(rng: Any) -> Kind:
    """Two shafts that are not in line, joined by universal joints and a telescope."""
    s = Sketch(rng)
    a, b = np.array([0.5, 0.0, 0.0]), np.array([1.5, s.number(0.1, 0.4), s.number(-0.3, 0.3)])
    end, along = np.round(unit(np.array([1.0, s.number(-0.3, 0.3), 0.0])), 9), np.round(unit(b - a), 9)
    across = np.round(unit(np.cross(along, X)), 9)
    s.body("input", (0, 0, 0), a)
    s.body("sleeve", a, a + 0.5 * (b - a))
    s.body("spline", b, b - 0.5 * (b - a))
    s.body("output", b, b + 0.4 * end)
    first = s.hinge("bearing", GROUND, "input", (0, 0, 0), X, 0.3 if s.maybe(0.5) else 0.0)
    s.joint("universal", "first", "input", "sleeve", a, across)
    s.joint("prismatic", "telescope", "sleeve", "spline", 0.5 * (a + b), along)
    s.joint("universal", "second", "spline", "output", b, across)
    last = s.hinge("far bearing", GROUND, "output", b + 0.4 * end, end)
    return s.kind(
        "cardan shaft", 1, [(first, 8.0), (last, 8.0)], [("output", beside(b, 0, 0.1)), ("input", (0.2, 0.1, 0))]
    )


KINDS: tuple[Callable[[Any], Kind], ...] = (
    door, shafts, four_bar, slider_crank, scissor, parallelogram, pendulum, arms, flywheel, cart, corner, bonnet,
    gimbals, belts, robot, excavator, toggle, cardan,
)  # fmt: skip
