"""Mechanisms drawn by chance with couplings: sums, gears, belts, racks, distances, cams, balls and discs that roll."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

import partita as pt

from . import chance
from .comparison import Verdict, look, moving, short_run
from .drawing import GROUND, Coupling, Drawing, Load, unit
from .reading import drawing_of


def plain(seed: int) -> Drawing:
    """The mechanism of a number with loads that do not swing, as a closed drawing."""
    d = chance.mechanism(seed)
    closed = tuple(replace(j, child_point=None, child_axis=None) for j in d.joints)
    still = tuple(replace(f, swing=0.0) if isinstance(f, Load) else f for f in d.forces)
    return replace(d, joints=closed, forces=still, drives=())


class Chance:
    """A mechanism and couplings for it."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing, self.m = drawing, drawing.build()
        self.rng = np.random.default_rng(7000 + drawing.seed)
        self.cams: list[Coupling] = []
        slides, turns = list[tuple[str, int]](), list[tuple[str, int]]()
        for j in drawing.joints:
            lines, angles, ball = j.motions(j.some)
            count = len(lines)
            slides += [(j.name, i) for i in range(count)]
            turns += [] if ball else [(j.name, count + i) for i in range(len(angles))]
        self.slides, self.turns = slides, turns

    def one(self, of: list[Any]) -> Any:
        return of[int(self.rng.integers(len(of)))]

    def two(self, of: list[Any]) -> list[Any]:
        return [of[int(i)] for i in self.rng.permutation(len(of))[:2]]

    def factor(self) -> float:
        return float(self.rng.uniform(0.4, 2.0) * self.rng.choice([-1.0, 1.0]))

    def bodies(self) -> list[str]:
        """A body, and another or the ground."""
        names = [b.name for b in self.drawing.bodies]
        first = self.one(names)
        return [first, self.one([x for x in [GROUND, *names] if x != first])]

    def point(self) -> Any:
        return 0.5 * self.drawing.size * self.rng.normal(size=3)

    def add(self) -> bool:
        """One more coupling, if there is anything for it."""
        kind = self.one(["sum", "sum", "gear", "belt", "rack", "distance", "measures", "cam", "ball"])
        name, size = f"{kind} {len(self.m.couplings)}", self.drawing.size
        if kind in ("gear", "belt", "cam") and len(self.turns) > 1:
            (a, i), (b, k) = self.two(self.turns)
            if kind == "gear":
                self.m.add_gear(a, b, self.factor(), coordinate1=i, coordinate2=k, name=name)
            elif kind == "belt":
                if i or k:
                    return False
                radii = {"radius1": abs(self.factor()) * size, "radius2": abs(self.factor()) * size}
                self.m.add_belt(a, b, **radii, crossed=bool(self.rng.random() < 0.5), name=name)
            else:
                self.cam(name, pt.Coordinate(a, i), pt.Coordinate(b, k), 1.0)
        elif kind == "cam" and self.slides and self.turns:
            self.cam(name, pt.Coordinate(*self.one(self.slides)), pt.Coordinate(*self.one(self.turns)), size)
        elif kind == "rack" and self.slides and self.turns:
            (a, i), (b, k) = self.one(self.turns), self.one(self.slides)
            self.m.add_rack(a, b, self.factor() * size, coordinate1=i, coordinate2=k, name=name)
        elif kind == "sum" and len(self.turns) + len(self.slides) > 1:
            chosen = self.two([*((x, size) for x in self.turns), *((x, 1.0) for x in self.slides)])
            terms = [pt.Coordinate(*x) for x, _ in chosen]
            self.m.add_coupler(name, terms, [self.factor() * scale for _, scale in chosen])
        elif kind == "distance":
            one, other = self.bodies()
            self.m.add_distance(name, one, self.point(), other, self.point())
        elif kind == "measures":
            one, other = self.bodies()
            axes = self.rng.normal(size=(3, 3))
            terms = [
                pt.Along(one, self.point(), axes[0], other, self.point()),
                pt.Cosine(one, axes[1], other, axes[2]),
                pt.Distance(one, self.point(), other, self.point()),
            ]
            factors = np.array([self.factor(), self.factor() * size, self.factor()])
            drawn = sum(f * self.value(x) for f, x in zip(factors, terms, strict=True))
            self.m.add_coupler(name, terms, factors, drawn)
        elif kind == "ball":
            body, normal, radius = self.bodies()[0], unit(self.rng.normal(size=3)), abs(self.factor()) * size
            centre = self.point()
            at = next(b for b in self.drawing.bodies if b.name == body)
            point = at.position + at.rotation @ centre - radius * normal
            shape: dict[str, Any] = {"ball": True}
            if self.drawing.seed % 4 == 0:
                name, axis = name.replace("ball", "disc"), unit(np.random.default_rng(self.drawing.seed).normal(size=3))
                lying = at.rotation @ axis
                point = at.position + at.rotation @ centre - radius * unit(normal - lying * (lying @ normal))
                shape = {"axis": axis}
            self.m.add_rolling(name, body, radius, center=centre, **shape, point=point, normal=normal)
        else:
            return False
        return True

    def cam(self, name: str, follower: Any, leader: Any, size: float) -> None:
        height, pace, phase = 0.3 * self.factor() * size, abs(self.factor()), float(self.rng.uniform(0.0, 6.0))
        self.m.add_cam(follower, leader, lambda x: height * (np.sin(pace * x + phase) - np.sin(phase)), name=name)

        def law(x: float) -> tuple[float, float, float]:
            at = pace * x + phase
            return height * (np.sin(at) - np.sin(phase)), height * pace * np.cos(at), -height * pace**2 * np.sin(at)

        terms = [{"of": "joint", "joint": str(x.joint), "coordinate": x.coordinate} for x in (follower, leader)]
        self.cams.append(Coupling(name, "cam", {"terms": terms, "law": law, "counted": True}))

    def value(self, x: Any) -> float:
        """A measure as drawn."""
        at = {b.name: b for b in self.drawing.bodies}

        def place(body: str, point: Any) -> Any:
            return at[body].position + at[body].rotation @ point if body != GROUND else np.asarray(point)

        def axis(body: str, a: Any) -> Any:
            return at[body].rotation @ unit(a) if body != GROUND else unit(a)

        if isinstance(x, pt.Cosine):
            return float(axis(x.body1, x.axis1) @ axis(x.body2, x.axis2))
        gap = place(x.body2, x.point2) - place(x.body1, x.point1)
        return float(axis(x.body1, x.axis) @ gap) if isinstance(x, pt.Along) else float(np.linalg.norm(gap))


def compare_coupled(seed: int) -> tuple[Verdict, Counter[str]]:
    """Both coordinates against the independent program; and which couplings there were."""
    verdict, kinds = Verdict(), Counter[str]()
    made = Chance(plain(seed))
    for _ in range(int(made.rng.integers(1, 3))):
        made.add()
    if not made.m.couplings:
        return verdict, kinds
    found = drawing_of(made.m, known={c.name: c for c in made.cams})
    original = made.drawing
    drawing = replace(found, seed=seed, time=original.time, mass=original.mass, size=max(found.size, original.size))
    rng = np.random.default_rng(seed)
    try:
        state = moving(made.m, drawing, rng)
    except pt.errors.PartitaError as error:
        verdict.counts[f"refused: {type(error).__name__}"] += 1
        return verdict, kinds
    for coordinates in ("relative", "absolute"):
        try:
            run = short_run(made.m, drawing, state, coordinates)
        except pt.errors.PartitaError as error:
            verdict.counts[f"{coordinates} refused: {type(error).__name__}"] += 1
            continue
        verdict.counts[f"{coordinates} {'run' if run.success else 'stopped'}"] += 1
        kinds += Counter(c.name.split()[0] for c in drawing.couplings) if run.success else Counter()
        look(drawing, made.m, run, coordinates, verdict, rng)
    return verdict, kinds
