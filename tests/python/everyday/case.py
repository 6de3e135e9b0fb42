"""A case: a drawing, how it starts, how it is run; and the same case in other words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from oracle.drawing import GROUND, Array, Drawing, words

import partita as pt
from partita.solver import grouped

from . import loads


@dataclass(frozen=True)
class Case:
    """`exact`: what `drawing` was before it was rounded or shaken, by `error` at most. `rates`: of joints at the start,
    t0. `finest`: no step of a reference is longer. `size`, `pace`: what lengths and rates are compared with."""

    drawing: Drawing
    exact: Drawing
    error: float
    mobility: int
    rates: tuple[tuple[str, float], ...]
    t0: float
    duration: float
    finest: float
    pace: float
    options: dict[str, Any] = field(default_factory=dict)
    outputs: int = 2
    seed: int = 0
    nudged: tuple[str, ...] = ()
    """Joints that a nudge sets going a little faster."""
    starts: tuple[float, ...] = (0.0,)
    """Times at which it may begin as well."""

    def build(self) -> pt.Mechanism:
        return self.drawing.build()

    def start(self, m: pt.Mechanism, nudge: float = 0.0) -> pt.State:
        """As drawn, or started by so much of the pace faster."""
        wanted = dict(self.rates)
        for name in self.nudged if nudge else ():
            wanted[name] = wanted.get(name, 0.0) + nudge * self.pace
        return m.assemble(rates=wanted, t=self.t0)

    def times(self, outputs: int) -> Array:
        return self.t0 + np.linspace(0.0, self.duration, outputs)

    def lines(self) -> str:
        """As a program."""
        given = grouped(self.options).items()
        called = ", ".join(f"{key}={'pt.' if key == 'solver' else ''}{value!r}" for key, value in given)
        return "\n".join([
            self.drawing.lines(),
            f"start = m.assemble(rates={dict(self.rates)!r}, t={self.t0!r})",
            f"times = {self.t0!r} + np.linspace(0, {self.duration!r}, {self.outputs})",
            f"run = m.simulate({self.duration!r}, initial=start, t_eval=times, {called})",
        ])  # fmt: skip

    def moved(self, turn: Array, by: Array) -> Case:
        """The whole, gravity and all, at another place in another attitude."""
        return replace(self, drawing=moved(self.drawing, turn, by), exact=moved(self.exact, turn, by))

    def later(self, by: float) -> Case:
        """The same at another time."""

        def one(d: Drawing) -> Drawing:
            forces, drives = (tuple(loads.later(f, by) for f in x) for x in (d.forces, d.drives))
            return replace(d, forces=forces, drives=drives)

        return replace(self, drawing=one(self.drawing), exact=one(self.exact), t0=self.t0 + by)

    def renamed(self, names: dict[str, str]) -> Case:
        rates = tuple((names.get(name, name), rate) for name, rate in self.rates)
        nudged = tuple(names.get(name, name) for name in self.nudged)
        drawings = {"drawing": renamed(self.drawing, names), "exact": renamed(self.exact, names)}
        return replace(self, **drawings, rates=rates, nudged=nudged)

    def shuffled(self, rng: Any) -> Case:
        """Added in another order."""
        d = self.drawing
        parts = {key: getattr(d, key) for key in ("bodies", "joints", "forces", "drives", "couplings")}
        mixed = {key: tuple(x[i] for i in rng.permutation(len(x))) for key, x in parts.items()}
        return replace(self, drawing=replace(d, **mixed))

    @property
    def every_name(self) -> list[str]:
        d = self.drawing
        return [x.name for x in (*d.bodies, *d.joints, *d.forces, *d.drives, *d.couplings)]


def moved(d: Drawing, turn: Array, by: Array) -> Drawing:
    """Turned, then shifted."""
    bodies = [replace(b, position=turn @ b.position + by, rotation=turn @ b.rotation) for b in d.bodies]
    joints = [replace(j, point=turn @ j.point + by, axes=turn @ j.axes) for j in d.joints]
    forces = tuple(loads.moved(f, turn, by) for f in d.forces)
    return replace(d, gravity=turn @ d.gravity, bodies=tuple(bodies), joints=tuple(joints), forces=forces)


def renamed(d: Drawing, names: dict[str, str]) -> Drawing:
    new = {**names, GROUND: GROUND}

    def one(name: str) -> str:
        return new.get(name, name)

    couplings = []
    for c in d.couplings:
        terms = [{**x, "joint": one(x["joint"])} for x in c.data["terms"]]
        assert c.call is not None
        method, positional, named = c.call
        call = (method, tuple(one(x) if isinstance(x, str) else x for x in positional), {**named, "name": one(c.name)})
        couplings.append(replace(c, name=one(c.name), data={**c.data, "terms": terms}, call=call))
    return replace(
        d,
        bodies=tuple(replace(b, name=one(b.name)) for b in d.bodies),
        joints=tuple(replace(j, name=one(j.name), parent=one(j.parent), child=one(j.child)) for j in d.joints),
        forces=tuple(loads.renamed(f, new) for f in d.forces),
        drives=tuple(loads.renamed(f, new) for f in d.drives),
        couplings=tuple(couplings),
    )


def rounded(d: Drawing, digits: int) -> Drawing:
    """Every place and axis with so many decimals, as files of drawings hold them."""
    bodies = [replace(b, position=np.round(b.position, digits), com=np.round(b.com, digits)) for b in d.bodies]
    joints = [replace(j, point=np.round(j.point, digits), axes=np.round(j.axes, digits)) for j in d.joints]
    return replace(d, bodies=tuple(bodies), joints=tuple(joints))


def shaken(d: Drawing, by: float, rng: Any) -> Drawing:
    """Points and axes of joints off by so much at most."""
    joints = [
        replace(
            j, point=j.point + by * rng.uniform(-1.0, 1.0, size=3), axes=j.axes + by * rng.uniform(-1, 1, size=(3, 3))
        )
        for j in d.joints
    ]
    return replace(d, joints=tuple(joints))


def between(one: Drawing, other: Drawing, part: float) -> Drawing:
    """Between two drawings, so much nearer to the other: bodies, points and axes of joints."""

    def mixed(a: Array, b: Array) -> Array:
        return a + part * (b - a)

    bodies = [replace(a, position=mixed(a.position, b.position), com=mixed(a.com, b.com))
              for a, b in zip(one.bodies, other.bodies, strict=True)]  # fmt: skip
    joints = [replace(a, point=mixed(a.point, b.point), axes=mixed(a.axes, b.axes))
              for a, b in zip(one.joints, other.joints, strict=True)]  # fmt: skip
    return replace(one, bodies=tuple(bodies), joints=tuple(joints))


def off(one: Drawing, other: Drawing) -> float:
    """The largest difference of places and axes."""
    pairs: Iterable[tuple[Array, Array]] = [
        *((a.point, b.point) for a, b in zip(one.joints, other.joints, strict=True)),
        *((a.axes[:, 0], b.axes[:, 0]) for a, b in zip(one.joints, other.joints, strict=True)),
    ]
    return max((float(np.abs(a - b).max()) for a, b in pairs), default=0.0)


__all__ = ["Case", "between", "moved", "off", "renamed", "rounded", "shaken", "words"]
