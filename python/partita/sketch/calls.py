"""What a drawing means: the calls of the builder that make its mechanism, run here or written as a Python script."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from math import cos, hypot, sin
from typing import Any

from ..errors import DescriptionError
from ..mechanism import Mechanism
from .drawing import Bar, Drawing, Motor, Slide, Spring

GROUND = "ground"
NAME = "drawing"
BLOCK = 0.1
"""Edge of the square block of a slide [m], which gives it its inertia."""
SECONDS = 10.0
"""Length of the run in a script."""
Flat = tuple[float, float]


@dataclass(frozen=True)
class OnBody:
    """A point of a body, where it is drawn in the world."""

    body: str
    point: tuple[float, float, float]

    def __str__(self) -> str:
        point = written(self.point)
        return point if self.body == GROUND else f"m.bodies[{written(self.body)}].world({point})"


@dataclass(frozen=True)
class Call:
    """A call of a method of the mechanism."""

    method: str
    values: tuple[Any, ...]
    named: dict[str, Any] = field(default_factory=dict)

    def make(self, m: Mechanism) -> None:
        values = [
            (m.bodies[x.body].world(x.point) if x.body != GROUND else x.point) if isinstance(x, OnBody) else x
            for x in self.values
        ]
        getattr(m, self.method)(*values, **self.named)

    def __str__(self) -> str:
        words = [written(x) for x in self.values] + [f"{key}={written(x)}" for key, x in self.named.items()]
        return f"m.{self.method}({', '.join(words)})"


def written(x: Any) -> str:
    """A value as Python has it."""
    return json.dumps(x) if isinstance(x, str) else str(x)


def mechanism_of(drawing: Drawing) -> Mechanism:
    """The mechanism. Raises `DescriptionError` where an element of the drawing has no meaning."""
    m = Mechanism(NAME, gravity=(0.0, -drawing.gravity, 0.0))
    for call in calls(drawing):
        call.make(m)
    return m


def script_of(drawing: Drawing) -> str:
    """A Python script that makes the mechanism, runs it and writes its page."""
    return "\n".join(
        [
            '"""A mechanism drawn with Partita."""',
            "",
            "import partita as pt",
            "",
            f'm = pt.Mechanism("{NAME}", gravity={written((0.0, -drawing.gravity, 0.0))})',
            *map(str, calls(drawing)),
            "",
            f"run = m.simulate({SECONDS})",
            "print(run.message)",
            f'run.to_html("{NAME}.html")',
            "",
        ]
    )


def calls(drawing: Drawing) -> list[Call]:
    """The calls, in order."""
    return _Meaning(drawing).calls()


class _Meaning:
    """Which bodies meet at which node."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing = drawing
        self.nodes = {node.id: node for node in drawing.nodes}
        self.bars = {bar.id: bar for bar in drawing.bars}
        self.at: dict[int, list[Bar]] = {node.id: [] for node in drawing.nodes}
        for bar in drawing.bars:
            for node in (bar.a, bar.b, *bar.more):
                if bar in self.at[node]:
                    _fail("bar", bar.name, f"it has {self.nodes[node].name} twice; draw it between two points")
                self.at[node].append(bar)
        self.slides = dict[int, Slide]()
        for slide in drawing.slides:
            at = self.nodes[slide.node]
            if slide.node in self.slides:
                _fail("slide", slide.name, f"{at.name} is on another slide; remove one")
            if at.ground:
                _fail("slide", slide.name, f"{at.name} is held by the ground; remove the ground or the slide")
            if any(bar.id == slide.along for bar in self.at[slide.node]):
                _fail("slide", slide.name, f"{at.name} is a point of the bar it should slide along; choose another")
            self.slides[slide.node] = slide
        self.joints = dict[tuple[int, int], str]()  # (node, bar that is held there) -> joint

    def calls(self) -> list[Call]:
        drawing = self.drawing
        made = [self.bar(bar) for bar in drawing.bars]
        for slide in drawing.slides:
            made += self.slide(slide)
        for node in drawing.nodes:
            made += self.pins(node.id)
        made += self.planes()
        made += [self.spring(spring) for spring in drawing.springs]
        return made + [self.motor(motor) for motor in drawing.motors]

    def world(self, node: int) -> Flat:
        at = self.nodes[node]
        return at.x, at.y

    def on(self, bar: Bar, node: int) -> Flat:
        """Where a bar has its point of a node: beside it where the bar is given another length than drawn."""
        if bar.length is None or node != bar.b:
            return self.world(node)
        (x0, y0), (x1, y1) = self.world(bar.a), self.world(bar.b)
        part = bar.length / (hypot(x1 - x0, y1 - y0) or 1.0)
        return x0 + part * (x1 - x0), y0 + part * (y1 - y0)

    def bar(self, bar: Bar) -> Call:
        start, end = self.on(bar, bar.a), self.on(bar, bar.b)
        return Call("add_rod", (bar.name,), {"start": _three(start), "end": _three(end), "mass": bar.mass})

    def slide(self, slide: Slide) -> list[Call]:
        at, body = self.world(slide.node), self.block(slide)
        moment = slide.mass * BLOCK**2 / 6.0
        if slide.along is None:
            parent, axis = GROUND, (cos(slide.angle), sin(slide.angle))
        else:
            guide = self.bars[slide.along]
            (x0, y0), (x1, y1) = self.world(guide.a), self.world(guide.b)
            size = hypot(x1 - x0, y1 - y0) or 1.0
            parent, axis = guide.name, ((x1 - x0) / size, (y1 - y0) / size)
        return [
            Call(
                "add_body",
                (body,),
                {"mass": slide.mass, "inertia": (moment, moment, moment), "position": _three(at)},
            ),
            Call("add_prismatic", (slide.name, parent, body), {"point": _three(at), "axis": _three(axis)}),
        ]

    def block(self, slide: Slide) -> str:
        return f"block of {slide.name}"

    def hub(self, node: int) -> tuple[str, Bar | None]:
        """The body to which the others at a node are pinned, and its bar, if it is one."""
        if node in self.slides:
            return self.block(self.slides[node]), None
        if self.nodes[node].ground or not self.at[node]:
            return GROUND, None
        return self.at[node][0].name, self.at[node][0]

    def pins(self, node: int) -> list[Call]:
        parent, own = self.hub(node)
        held = [bar for bar in self.at[node] if bar is not own]
        where = self.world(node) if own is None else self.on(own, node)
        made = []
        for bar in held:
            name = self.nodes[node].name if len(held) == 1 else f"{self.nodes[node].name} {bar.name}"
            self.joints[node, bar.id] = name
            named: dict[str, Any] = {"point": _three(where)}
            if self.on(bar, node) != where:
                named["child_point"] = _three(self.on(bar, node))
            made.append(Call("add_revolute", (name, parent, bar.name), named))
        return made

    def planes(self) -> list[Call]:
        """A joint to the plane of the drawing for each group of bodies that nothing joins to the ground."""
        groups = {GROUND: {GROUND}} | {bar.name: {bar.name} for bar in self.drawing.bars}
        groups |= {(block := self.block(slide)): {block} for slide in self.drawing.slides}

        def join(one: str, other: str) -> None:
            both = groups[one] | groups[other]
            for body in both:
                groups[body] = both

        for slide in self.drawing.slides:
            join(self.block(slide), GROUND if slide.along is None else self.bars[slide.along].name)
        for node in self.nodes:
            for bar in self.at[node]:
                join(self.hub(node)[0], bar.name)
        first = dict[int, str]()
        for body, group in groups.items():
            if GROUND not in group:
                first.setdefault(id(group), body)
        return [Call("add_planar", (f"plane of {body}", GROUND, body)) for body in first.values()]

    def spring(self, spring: Spring) -> Call:
        ends = []
        for node in (spring.a, spring.b):
            body, bar = self.hub(node)
            ends.append(OnBody(body, _three(self.world(node) if bar is None else self.on(bar, node))))
        if ends[0].body == ends[1].body:
            _fail("spring", spring.name, f"both of its ends are on {ends[0].body}; move one to another body")
        named: dict[str, Any] = {"stiffness": spring.stiffness, "damping": spring.damping}
        if spring.length is not None:
            named["length"] = spring.length
        first, second = ends
        return Call("add_spring", (spring.name, first.body, first, second.body, second), named)

    def motor(self, motor: Motor) -> Call:
        where = self.nodes[motor.node].name
        if motor.bar is None:
            if motor.node not in self.slides:
                _fail("motor", motor.name, f"there is no slide at {where}; put it on a pin or a slide")
            return self.drive(motor, self.slides[motor.node].name, motor.rate)
        joint = self.joints.get((motor.node, motor.bar))
        if joint is not None:
            return self.drive(motor, joint, motor.rate)
        own = self.hub(motor.node)[1]
        others = [name for (node, _), name in self.joints.items() if node == motor.node]
        if own is None or own.id != motor.bar or not others:
            _fail("motor", motor.name, f"nothing is pinned at {where} that it could turn; pin two bars, or ground it")
        return self.drive(motor, others[0], -motor.rate)  # the bar itself is what the other one is pinned to

    def drive(self, motor: Motor, joint: str, rate: float) -> Call:
        return Call("add_drive", (joint,), {"velocity": rate, "name": motor.name})

    def local(self) -> dict[int, tuple[str, Flat]]:
        """The body that carries each node, and where it is drawn on it."""
        found = {}
        for node in self.nodes:
            body, bar = self.hub(node)
            found[node] = (body, self.world(node) if bar is None else self.on(bar, node))
        return found


def carriers(drawing: Drawing) -> dict[int, tuple[str, Flat]]:
    """The body that carries each node, and where it is drawn on it in the world."""
    return _Meaning(drawing).local()


def _three(x: Flat) -> tuple[float, float, float]:
    return (x[0], x[1], 0.0)


def _fail(element: str, name: str, why: str) -> None:
    raise DescriptionError(f'{element} "{name}": {why}', element=element, name=name)
