"""Mechanisms drawn by chance with what holds at times: chains, loops, redundant ones, in the plane and in space."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import partita as pt

from .reference import Action, Along, Element

Draw = np.random.Generator
KINDS = (
    "chain 1", "chain 2", "chain 3", "in space 2", "in space 3", "four-bar", "slider-crank", "five-bar",
    "parallelogram", "four-bar in space",
)  # fmt: skip


@dataclass
class Drawing:
    """A mechanism, coordinates along which elements may act with whether they turn, and those whose rates are free."""

    m: pt.Mechanism
    along: list[tuple[Along, bool]]
    free: list[Along]
    pushed: str = ""
    """A body that forces push."""


@dataclass
class Case:
    """All that is drawn for a number."""

    kind: str
    build: Callable[[], pt.Mechanism]
    """The mechanism without elements and without the efforts of `efforts`."""
    elements: list[Element]
    actions: list[Action]
    rates: dict[Along, float]
    efforts: dict[Along, float]
    coordinates: str
    writable: bool
    """Whether a model file can have it: no function of Python."""

    def mechanism(self) -> pt.Mechanism:
        """The mechanism with all elements."""
        m = self.build()
        for along, effort in self.efforts.items():
            m.add_torque(f"push {along[0]}", along[0], effort, coordinate=along[1])
        for x in self.elements:
            add(m, x)
        return m

    def events(self) -> list[pt.Event]:
        """What is done at given times, and the stops that are events."""
        found = []
        for k, x in enumerate(self.actions):
            then: Any = pt.Lock(x.along[0], coordinate=x.along[1])
            if x.what == "release":
                then = pt.Release(x.along[0])
            elif x.what == "rate":
                then = pt.SetRates({pt.Coordinate(*x.along): x.value})
            elif x.what == "effort":
                then = pt.SetInput(f"push {x.along[0]}", x.value)
            found.append(pt.Event(f"act {k}", lambda t, state, x=x: t - x.t, then=then, once=True))
        for y in self.elements:
            if y.by_event:
                ((bound, sense),) = y.bounds
                of, then = pt.Coordinate(*y.along), pt.Stop(y.restitution)
                found.append(pt.Event(y.name, of, value=bound, direction=-sense, then=then))
        return found

    def start(self, m: pt.Mechanism, coordinates: str) -> pt.State:
        """The drawn position with these rates."""
        joints = m.compile().summary["joints"]
        counts = {joint["name"]: joint["v"][1] for joint in joints}
        rates: dict[str, list[float]] = {}
        for (joint, number), rate in self.rates.items():
            rates.setdefault(joint, [0.0] * counts[joint])[number] = rate
        return m.assemble(rates=rates, coordinates=coordinates)


def add(m: pt.Mechanism, x: Element) -> None:
    """Draw an element."""
    joint, number = x.along

    def given(magnitude: Any) -> Any:
        return (lambda t, state: magnitude(t)) if callable(magnitude) else magnitude

    if x.kind == "friction":
        static = None if x.static is None else given(x.static)
        m.add_friction(joint, given(x.dynamic), static=static, coordinate=number, name=x.name)
    elif x.kind == "freewheel":
        m.add_freewheel(joint, free=x.sense, coordinate=number, name=x.name)
    elif x.kind == "latch":
        m.add_latch(joint, at=x.at, direction=x.sense, coordinate=number, name=x.name)
    elif not x.by_event:
        ends = {key: value for key, value in (("lower", x.lower), ("upper", x.upper)) if value is not None}
        m.add_stop(joint, restitution=x.restitution, coordinate=number, name=x.name, **ends)


def wave(draw: Draw, size: float) -> Callable[..., float]:
    """A sine with an offset, over time."""
    a, w, phase, c = draw.normal(scale=size), draw.uniform(2, 9), draw.uniform(0, 6), draw.normal(scale=0.5 * size)
    return lambda t, state=None: a * math.sin(w * t + phase) + c


def link(m: pt.Mechanism, draw: Draw, name: str, p: Any, q: Any) -> pt.Body:
    """A body in the middle of two points."""
    middle = 0.5 * (np.array(p, float) + np.array(q, float))
    inertia = (0.06, 0.06, draw.uniform(0.02, 0.1))
    return m.add_body(name, mass=draw.uniform(0.3, 1.5), inertia=inertia, position=tuple(middle))


def planar(draw: Draw, name: str) -> pt.Mechanism:
    return pt.Mechanism(name, gravity=(0, -9.81, 0) if draw.random() < 0.7 else None)


def chain(draw: Draw, count: int, in_space: bool) -> Drawing:
    m = pt.Mechanism("chain", gravity=tuple(4.0 * draw.normal(size=3)) if in_space else (0, -9.81, 0))
    parent, x = m.ground, np.zeros(3)
    along: list[tuple[Along, bool]] = []
    for i in range(count):
        d = draw.normal(size=3)
        if not in_space:
            d[2] = 0.0
        d *= draw.uniform(0.2, 0.5) / np.linalg.norm(d)
        inertia = tuple(0.12 + 0.2 * draw.uniform(0.02, 0.2, 3))
        body = m.add_body(f"b{i}", mass=draw.uniform(0.5, 2), inertia=inertia, position=tuple(x + 0.5 * d))
        kinds = ["revolute", "revolute", "prismatic", "cylindrical", "universal"]
        kind, name = draw.choice(kinds if in_space else ["revolute"] * 3 + ["prismatic", "planar"]), f"J{i}"
        if kind == "revolute":
            axis = tuple(draw.normal(size=3)) if in_space else (0, 0, 1)
            m.add_revolute(name, parent, body, point=tuple(x), axis=axis)
            along.append(((name, 0), True))
        elif kind == "prismatic":
            m.add_prismatic(name, parent, body, point=tuple(x), axis=tuple(d))
            along.append(((name, 0), False))
        elif kind == "planar":
            m.add_planar(name, parent, body, point=tuple(x))
            along += [((name, 0), False), ((name, 1), False), ((name, 2), True)]
        elif kind == "cylindrical":
            m.add_cylindrical(name, parent, body, point=tuple(x), axis=tuple(draw.normal(size=3)))
            along += [((name, 0), False), ((name, 1), True)]
        else:
            first = draw.normal(size=3)
            second = np.cross(first, draw.normal(size=3))
            m.add_universal(name, parent, body, point=tuple(x), axis1=tuple(first), axis2=tuple(second))
            along += [((name, 0), True), ((name, 1), True)]
        parent, x = body, x + d
    return Drawing(m, along, [x[0] for x in along], "b0")


def pins(m: pt.Mechanism, *found: tuple[str, Any, Any, Any]) -> list[tuple[Along, bool]]:
    """Revolutes about z: name, bodies, point."""
    for name, one, other, point in found:
        m.add_revolute(name, one, other, point=tuple(point))
    return [((x[0], 0), True) for x in found]


def four_bar(draw: Draw) -> Drawing:
    m = planar(draw, "four-bar")
    first, last, crank, rocker = (
        (0, 0, 0),
        (1.0, draw.uniform(-0.1, 0.1), 0),
        draw.uniform(0.5, 2.5),
        draw.uniform(1.2, 1.9),
    )
    b = (0.35 * math.cos(crank), 0.35 * math.sin(crank), 0)
    c = (last[0] + 0.7 * math.cos(rocker), last[1] + 0.7 * math.sin(rocker), 0)
    one, two, three = link(m, draw, "a", first, b), link(m, draw, "b", b, c), link(m, draw, "c", last, c)
    along = pins(m, ("A", m.ground, one, first), ("B", one, two, b), ("C", two, three, c), ("D", m.ground, three, last))
    return Drawing(m, along, [("A", 0)], "c")


def slider_crank(draw: Draw) -> Drawing:
    m = planar(draw, "slider-crank")
    crank, rod = draw.uniform(0.4, 2.7), draw.uniform(0.6, 1.0)
    b = (0.3 * math.cos(crank), 0.3 * math.sin(crank), 0)
    c = (b[0] + math.sqrt(rod * rod - b[1] ** 2), 0, 0)
    one, two = link(m, draw, "a", (0, 0, 0), b), link(m, draw, "b", b, c)
    slider = m.add_body("c", mass=1.0, inertia=(0.1, 0.1, 0.1), position=c)
    along = pins(m, ("A", m.ground, one, (0, 0, 0)), ("B", one, two, b), ("C", two, slider, c))
    m.add_prismatic("S", m.ground, slider, point=c, axis=(1, 0, 0))
    return Drawing(m, [*along, (("S", 0), False)], [("A", 0)], "c")


def five_bar(draw: Draw) -> Drawing:
    m = planar(draw, "five-bar")
    first, last, left, right = (0, 0, 0), (1.0, 0, 0), draw.uniform(1.2, 2.2), draw.uniform(0.8, 1.9)
    b, d = (0.5 * math.cos(left), 0.5 * math.sin(left), 0), (1 + 0.5 * math.cos(right), 0.5 * math.sin(right), 0)
    dx, dy = d[0] - b[0], d[1] - b[1]
    far = math.hypot(dx, dy)
    arm = max(0.8, 0.55 * far)
    up = math.sqrt(arm**2 - 0.25 * far**2)
    c = (b[0] + 0.5 * dx - dy / far * up, b[1] + 0.5 * dy + dx / far * up, 0)
    ends = (("a", first, b), ("b", b, c), ("c", d, c), ("d", last, d))
    one, two, three, four = (link(m, draw, *x) for x in ends)
    along = pins(
        m, ("A", m.ground, one, first), ("B", one, two, b), ("C", two, three, c), ("D", four, three, d),
        ("E", m.ground, four, last),
    )  # fmt: skip
    return Drawing(m, along, [("A", 0), ("E", 0)], "c")


def parallelogram(draw: Draw) -> Drawing:
    m = planar(draw, "parallelogram")
    angle = draw.uniform(0.5, 2.6)
    d = np.array((0.4 * math.cos(angle), 0.4 * math.sin(angle), 0))
    grounded: list[tuple[str, Any, Any, Any]] = []
    feet = [np.array((x, 0.0, 0.0)) for x in (0.0, 0.5, 1.2)]
    cranks = [link(m, draw, f"c{i}", foot, foot + d) for i, foot in enumerate(feet)]
    bar = link(m, draw, "bar", d, feet[2] + d)
    grounded += [(f"O{i}", m.ground, crank, foot) for i, (crank, foot) in enumerate(zip(cranks, feet, strict=True))]
    grounded += [(f"P{i}", crank, bar, foot + d) for i, (crank, foot) in enumerate(zip(cranks, feet, strict=True))]
    return Drawing(m, pins(m, *grounded), [("O0", 0)], "bar")


def four_bar_in_space(draw: Draw) -> Drawing:
    """One in the plane with a fin that turns out of it, so that its joints are redundant."""
    found = four_bar(draw)
    found.m.gravity = (1.0, -9.81, 2.0)
    fin = found.m.add_body("fin", mass=0.4, inertia=(0.02, 0.03, 0.04), position=(0.3, 0.9, 0.2))
    found.m.add_revolute("F", "b", fin, point=(0.3, 0.8, 0.1), axis=(1, 0.2, 0.3))
    found.along.append((("F", 0), True))
    found.free.append(("F", 0))
    return found


LOOPS = {
    "four-bar": four_bar,
    "slider-crank": slider_crank,
    "five-bar": five_bar,
    "parallelogram": parallelogram,
    "four-bar in space": four_bar_in_space,
}


def element(draw: Draw, what: str, name: str, along: Along) -> Element:
    if what == "friction":
        dynamic = draw.uniform(0.1, 3.0)
        ratio = draw.choice([0.0, 1.0, 1.3, 2.0])
        static = None if ratio == 0.0 else dynamic * ratio
        if draw.random() < 0.15:
            f = wave(draw, 1.0)
            return Element(what, name, along, dynamic=lambda t: abs(f(t)) + 0.2)
        return Element(what, name, along, dynamic, static)
    sense = int(draw.choice([-1, 1]))
    if what == "freewheel":
        return Element(what, name, along, sense=sense)
    if what == "latch":
        return Element(what, name, along, at=draw.uniform(-0.8, 0.8), sense=sense)
    lower, upper, which = -draw.uniform(0.05, 1.0), draw.uniform(0.05, 1.0), draw.integers(3)
    ends = (None if which == 0 else lower, None if which == 1 else upper)
    by_event = bool(which < 2 and draw.random() < 0.4)
    e = float(draw.choice([0, 0.3, 0.6, 0.9]))
    return Element(what, name, along, lower=ends[0], upper=ends[1], restitution=e, by_event=by_event)


def case(number: int) -> Case:
    """That with this number."""

    def drawn() -> tuple[Draw, str, Drawing, Along | None, bool]:
        draw = np.random.default_rng([60, number])
        kind, writable = str(draw.choice(KINDS)), True
        loop = LOOPS.get(kind)
        found = chain(draw, int(kind[-1]), "space" in kind) if loop is None else loop(draw)
        for k in range(draw.integers(0, 3)):
            along, turns = found.along[draw.integers(len(found.along))]
            writable = False
            if turns:
                found.m.add_torque(f"T{k}", along[0], wave(draw, 3.0), coordinate=along[1])
            else:
                found.m.add_force(found.pushed, (wave(draw, 5.0), 0, 0), name=f"T{k}")
        drive = None
        if draw.random() < 0.15 and len(found.free) > 1:
            drive, writable = found.free[draw.integers(len(found.free))], False
            a, w = draw.uniform(0.1, 0.5), draw.uniform(2, 6)
            found.m.add_drive(pt.Coordinate(*drive), position=lambda t: a * (1 - np.cos(w * t)), name="engine")
        return draw, kind, found, drive, writable

    draw, kind, found, drive, writable = drawn()
    menu = ["friction", "friction", "friction", "freewheel", "stop", "stop", "latch"]
    elements: list[Element] = []
    for k in range(draw.integers(1, 5)):
        along, what = found.along[draw.integers(len(found.along))][0], str(draw.choice(menu))
        if what != "friction" and any((x.along, x.kind) == (along, what) for x in elements):
            continue
        if along == drive and what != "friction":
            continue  # which would stop the engine
        elements.append(element(draw, what, f"{what} {k}", along))
    writable &= not any(callable(x.dynamic) for x in elements)
    actions: list[Action] = []
    efforts: dict[Along, float] = {}
    chance, first = draw.random(), draw.uniform(0.1, 0.5)
    others = [x for x in found.along if x[0] != drive]
    along, turns = others[draw.integers(len(others))]
    if chance < 0.2:
        actions = [Action(first, "lock", along), Action(first + draw.uniform(0.1, 0.4), "release", along)]
    elif chance < 0.35:
        actions = [Action(first, "rate", along, draw.normal())]
    elif chance < 0.6 and turns:
        efforts[along] = draw.normal(scale=2.0)
        actions = [Action(first, "effort", along, draw.normal(scale=3.0))]
    rests = draw.random() < 0.25
    rates = {x: 0.0 if rests else 2.0 * draw.normal() for x in found.free if x != drive}
    coordinates = "absolute" if draw.random() < 0.3 else "relative"
    return Case(kind, lambda: drawn()[2].m, elements, actions, rates, efforts, coordinates, writable)
