"""Prescribed motions by chance that are not smooth at one place: jumps of value and of rate, kinks of the rate.

A jump of the value or of the rate is refused, by name and time, and nothing else is. Where the second derivative jumps
the motion goes on, and is held against the motion of the smooth functions on either side of the place (driven) or
against the quadrature of the energy integral (free): neither has seen the kink.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from drawings import ABSOLUTE, EVERY, four_bar, pendulum
from scipy.integrate import quad

import partita as pt

NOT_SMOOTH = ("value", "rate", "second")
"""Which derivative jumps."""
WHERE = ("pendulum", "four-bar", "cam driven", "cam free", "bead", "condition in time", "rate of a four-bar")
END = 1.0


@dataclass(frozen=True)
class Kinked:
    """A smooth function, and what is added to it from a place on."""

    base: Callable[[Any], Any]
    at: float
    size: float
    power: int
    both: bool
    """Whether it is taken away before that place as well."""

    def beyond(self, x: Any) -> Any:
        """The smooth function that holds after the place."""
        return self.base(x) + self.size * (x - self.at) ** self.power

    def before(self) -> Callable[[Any], Any]:
        """The smooth function that holds before it."""
        taken = -self.size if self.both else 0.0
        return Kinked(self.base, self.at, taken, self.power, False).beyond

    def __call__(self, x: Any) -> Any:
        added = self.size * (x - self.at) ** self.power
        if x > self.at:
            return self.base(x) + added
        return self.base(x) - added if self.both else self.base(x) + 0.0 * x


@dataclass(frozen=True)
class Trial:
    """What became of one: "right", "wrong", "refused" where it should not have been."""

    outcome: str
    words: str


def _smooth(rng: np.random.Generator, steep: float) -> Callable[[Any], Any]:
    a, w, p = rng.uniform(0.05, 0.2), rng.uniform(1.0, 4.0), rng.uniform(0.0, 6.0)
    start = np.sin(p)
    return lambda x: steep * x + a * (np.sin(w * x + p) - start)


def _cam(law: Callable[[Any], Any], driven: Callable[[Any], Any] | None) -> pt.Mechanism:
    m = pt.Mechanism("cam", gravity=(0, 0, 0))
    slide = m.add_body("slide", mass=1.0, inertia=(1, 1, 1))
    follower = m.add_body("follower", mass=0.5, inertia=(1, 1, 1), position=(0, 0.5, 0))
    m.add_prismatic("A", m.ground, slide, axis=(1, 0, 0))
    m.add_prismatic("B", m.ground, follower, axis=(0, 1, 0))
    m.add_cam("B", "A", law, name="the law")
    if driven is not None:
        m.add_drive("A", position=driven)
    return m


def _bead(law: Callable[[Any], Any], gravity: float) -> pt.Mechanism:
    m = pt.Mechanism("bead", gravity=(0, -gravity, 0))
    at = (0.0, float(law(0.0)), 0.0)
    carriage = m.add_body("carriage", mass=0.5, inertia=(1, 1, 1), position=(-0.5, 0, 0))
    bead = m.add_body("bead", mass=1.0, inertia=(1, 1, 1), position=at)
    m.add_prismatic("A", m.ground, carriage, point=(-0.5, 0, 0), axis=(1, 0, 0))
    m.add_prismatic("B", carriage, bead, point=at, axis=(0, 1, 0))
    m.add_point_on_curve("the law", m.ground, bead, (0, 0, 0), law)
    return m


def _condition(law: Callable[[Any], Any]) -> pt.Mechanism:
    m = pt.Mechanism("condition", gravity=(0, -9.81, 0))
    slide = m.add_body("slide", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("A", m.ground, slide, axis=(0.6, 0.8, 0))
    m.add_constraint("the law", lambda t, x: x - law(t), of=["A"])
    return m


POINTS = ((0, 0), (0.4, 0), (1.2, 0.8), (1.1, 0))


def _driven(where: str, law: Callable[[Any], Any]) -> pt.Mechanism:
    if where == "pendulum":
        m = pendulum()
        m.add_drive("A", position=law, name="the law")
    elif where == "four-bar":
        m = four_bar(POINTS)
        m.add_drive("A", position=law, name="the law")
    elif where == "rate of a four-bar":
        m = four_bar(POINTS)
        m.add_drive("A", velocity=law, name="the law")
    elif where == "condition in time":
        m = _condition(law)
    else:
        m = _cam(law, lambda t: 1.2 * t + 0.1 * np.sin(2.0 * t))
    return m


def trial(seed: int, opaque: bool = False) -> Trial:
    """One motion by chance: what became of it. `opaque`: prescribed by a function that only Python can evaluate."""
    rng = np.random.default_rng(seed)
    where, kind = str(rng.choice(WHERE)), str(rng.choice(NOT_SMOOTH))
    power = NOT_SMOOTH.index(kind)
    if where == "rate of a four-bar":
        power -= 1  # what is given is a rate already
        if power < 0:
            kind, power = "rate", 0
    size = float(10.0 ** rng.uniform(-4.0, -0.5)) * float(rng.choice((-1.0, 1.0)))
    if where in ("cam free", "bead"):
        size = abs(size) * (0.3 if power < 2 else 1.0)  # positive, so that a slow motion does not reverse
    steep = {"pendulum": 0.5, "four-bar": 1.0, "rate of a four-bar": 1.0}.get(where, 0.3)
    law = Kinked(_smooth(rng, steep), float(rng.uniform(0.1, 0.9)), size, power, bool(rng.integers(2)))
    forms = ABSOLUTE if (absolute := bool(rng.integers(2))) else EVERY
    rates = where == "rate of a four-bar"
    forms = [f for f in forms if not (rates and f in ("wehage-haug", "explicit-closing", "tangent-space"))]
    form = str(rng.choice(forms))
    options: dict[str, Any] = {"solver": pt.Solver(form), "coordinates": "absolute" if absolute else "relative"}
    case = f"seed {seed}: {where}, {kind} jumps by {size:.2e} at {law.at:.6g}, {form}, {options['coordinates']}"
    if where in ("cam free", "bead"):
        return _free(where, kind, law, options, case, float(rng.uniform(1.1, 2.0)))
    m, joint = _driven(where, (lambda x: float(law(float(x)))) if opaque else law), "A"
    run = m.simulate(END, t_eval=np.linspace(0.0, END, 21), **options)
    if kind != "second":
        t = law.at
        if where == "cam driven":
            t = _time_of(law.at)
        return _refused(run, t, case)
    if not run.success:
        return Trial("refused", f"{case}: {run.message}")
    before, after = _driven(where, law.before()), _driven(where, law.beyond)
    worst = 0.0
    kinked = _time_of(law.at) if where == "cam driven" else law.at
    for side, smooth in ((run.t < kinked, before), (run.t > kinked, after)):
        if where == "rate of a four-bar":
            continue  # its position is an integral over both sides
        clean = smooth.simulate(END, t_eval=run.t, rtol=1e-11, atol=1e-13, coordinates=options["coordinates"])
        if where != "condition in time":
            effort = np.abs(run.joint(joint).drive - clean.joint(joint).drive)[side]
            worst = max(worst, float(effort.max(initial=0.0)) / (1.0 + float(np.abs(clean.joint(joint).drive).max())))
        apart = np.abs(run.joint(joint).position - clean.joint(joint).position)[side]
        worst = max(worst, float(apart.max(initial=0.0)))
    if where == "rate of a four-bar":
        travelled = quad(law, 0.0, END, points=[law.at], epsabs=1e-13, epsrel=1e-13)[0]
        worst = abs(float(run.joint(joint).position[-1, 0]) - travelled)
    return Trial("right" if worst < 1e-6 else "wrong", f"{case}: off by {worst:.1e}")


def _time_of(x: float) -> float:
    """When the driven slide of the cam is at x."""
    t = x / 1.3
    for _ in range(50):
        t -= (1.2 * t + 0.1 * np.sin(2.0 * t) - x) / (1.2 + 0.2 * np.cos(2.0 * t))
    return float(t)


def _free(where: str, kind: str, law: Kinked, options: dict[str, Any], case: str, rate: float) -> Trial:
    """Held against the quadrature of the energy integral, t = integral of dx / x'."""
    slide, follower, gravity = (1.0, 0.5, 0.0) if where == "cam free" else (1.5, 1.0, 2.0)
    m = _cam(law, None) if where == "cam free" else _bead(law, gravity)
    before = law.before()

    def slope(x: float) -> float:
        f = law.beyond if x > law.at else before
        return float((f(x + 1e-5) - f(x - 1e-5)) / 2e-5)

    def metric(x: float) -> float:
        return 0.5 * (slide + follower * slope(x) ** 2)

    start = m.assemble(rates={"A": rate}, coordinates=options["coordinates"])
    run = m.simulate(END, initial=start, t_eval=np.linspace(0.0, END, 21), **options)
    x = run.joint("A").position[:, 0]
    begin = float(x[0])  # where the assembly has put it
    energy, level = metric(begin) * rate**2, float(law(begin))

    def time(to: float) -> float:
        def slowness(x: float) -> float:
            height = float((law.beyond if x > law.at else before)(x)) - level
            return float(np.sqrt(metric(x) / (energy - gravity * height)))

        points = [law.at] if begin < law.at < to else None
        return float(quad(slowness, begin, to, points=points, epsabs=1e-11, epsrel=1e-11, limit=200)[0])

    if kind != "second" and (kinked := time(law.at)) < END:
        return _refused(run, kinked, case)
    if not run.success:
        return Trial("refused", f"{case}: {run.message}")
    off = abs(time(float(x[-1])) - END)
    return Trial("right" if off < 1e-6 else "wrong", f"{case}: off by {off:.1e} s")


def _refused(run: pt.Result, t: float, case: str) -> Trial:
    """It must stop there, with the name of who jumps and the time."""
    if run.success:
        return Trial("wrong", f"{case}: success")
    named = re.search(r"(the law|cam|curve|constraint).* jumps by .* at t = ([0-9.e+-]+)[:,]", run.message)
    if named is None or "the law" not in run.message:
        return Trial("unnamed", f"{case}: {run.message}")
    near = abs(float(named.group(2).rstrip(".")) - t) < 1e-3
    return Trial("right" if near else "elsewhere", f"{case}: {run.message}")
