"""Four designs by exact derivatives: a coupler curve, a valve train, the toe of a wheel, a pendulum swung up.

Run it with `.venv/bin/python examples/synthesis.py [FOLDER]`. Each is solved by SciPy in seconds, with derivatives of runs
through closed loops; what is known about its answer is checked, and the exit code is 1 if something is missed. With a
folder it draws what was found, and writes a page of each run.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

import partita as pt
from partita.results import Result

Array = NDArray[np.float64]
Z = (0, 0, 1)
POINTS = 100
"""Precision points of the coupler curve."""
TRIED = 8
"""Flings of a coarse grid from which a better one is sought."""
CLOSE = 1e-7
"""A rod that is as near to upright and to rest is so. Scale: rad, rad/s. Reason: runs are integrated to 1e-10."""


@dataclass(frozen=True)
class Design:
    """What was found."""

    name: str
    before: Result
    after: Result
    number: float
    """What is known about it."""
    bound: float
    """At most this."""
    evaluations: int
    said: str
    curves: Callable[[Result], tuple[Array, Array]]
    axes: tuple[str, str]
    target: tuple[Array, Array] | None = None


def four_bar(lengths: tuple[float, ...] = (0.3, 0.9, 0.7)) -> pt.Mechanism:
    """A crank-rocker on grounds 1 m apart, whose crank makes a turn in a second; drawn at crank angle 1 rad."""
    near, far = np.zeros(3), np.array([1.0, 0.0, 0.0])
    crank = lengths[0] * np.array([np.cos(1.0), np.sin(1.0), 0.0])
    gap = far - crank
    size = float(np.linalg.norm(gap))
    along = (lengths[1] ** 2 - lengths[2] ** 2 + size**2) / (2 * size)
    across = np.array([-gap[1], gap[0], 0.0]) / size * np.sqrt(lengths[1] ** 2 - along**2)
    joint = crank + gap / size * along + across
    m = pt.Mechanism("four-bar", gravity=None)
    one = m.add_rod("crank", start=tuple(near), end=tuple(crank), mass=0.3)
    two = m.add_rod("coupler", start=tuple(crank), end=tuple(joint), mass=0.9)
    three = m.add_rod("rocker", start=tuple(far), end=tuple(joint), mass=0.7)
    m.add_revolute("O", m.ground, one, point=tuple(near), axis=Z)
    m.add_revolute("A", one, two, point=tuple(crank), axis=Z)
    m.add_revolute("B", two, three, point=tuple(joint), axis=Z)
    m.add_revolute("D", m.ground, three, point=tuple(far), axis=Z)
    m.add_drive("O", ([0.0, 1.0], [0.0, 2 * np.pi]), interpolation="spline")
    m.add_sensor("tracer", (two, (0.4, 0.3, 0.0)), "position")
    return m


def coupler_curve() -> Design:
    """Lengths of links for which a point of the coupler passes through a hundred points; another four-bar gave them, so
    that the answer is known."""
    m = four_bar()
    names = ("crank.length", "coupler.length", "rocker.length")
    right = np.array([0.28, 0.95, 0.73])
    times = np.linspace(0.0, 1.0, POINTS)

    def run(x: Array) -> Result:
        return m.simulate(1.0, t_eval=times, parameters=pt.lengths(m, dict(zip(names, x.tolist(), strict=True))))

    def path(result: Result) -> tuple[Array, Array]:
        found = np.asarray(result.sensor("tracer").values)
        return found[:, 0], found[:, 1]

    target = path(run(right))
    wanted = np.concatenate(target)

    def off(x: Array) -> Array:
        return np.concatenate(path(run(x))) - wanted

    def slopes(x: Array) -> Array:
        found = run(x).sensitivities(names).sensor("tracer")
        return np.column_stack([np.concatenate([found[name][:, 0], found[name][:, 1]]) for name in names])

    begin = np.array([0.3, 0.9, 0.7])
    found = least_squares(off, begin, jac=slopes, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return Design(
        "coupler curve", run(begin), run(found.x), float(np.abs(found.x - right).max()), 1e-7, int(found.nfev),
        f"links of {', '.join(f'{x:.6f}' for x in found.x)} m; the curve was drawn with 0.28, 0.95, 0.73 m",
        path, ("x [m]", "y [m]"), target,
    )  # fmt: skip


def valve_train() -> Design:
    """A spring and a damper for which a valve follows the lift of its cam best: between a pushrod that is elastic and the
    seat, at an engine speed where it would float."""
    lift = np.linspace(0.0, 0.03, 61)
    course = 0.004 * (1.0 - np.cos(2 * np.pi * lift / 0.03))
    m = pt.Mechanism("valve train", gravity=None)
    tappet = m.add_body("tappet", mass=0.08, inertia=(1e-5,) * 3)
    valve = m.add_body("valve", mass=0.12, inertia=(1e-5,) * 3, position=(0, 0.1, 0))
    m.add_prismatic("guide", m.ground, tappet, point=(0, 0, 0), axis=(0, 1, 0))
    m.add_prismatic("stem", m.ground, valve, point=(0, 0.1, 0), axis=(0, 1, 0))
    m.add_drive("guide", (lift, course), interpolation="spline")
    m.add_spring("pushrod", tappet, (0, 0, 0), valve, (0, 0, 0), stiffness=1.2e5, damping=20.0, length=0.1)
    m.add_spring("seat spring", m.ground, (0, 0.2, 0), valve, (0, 0, 0), stiffness=2e4, damping=5.0, length=0.1)
    lag = m.add_sensor("lag", m.add_sensor("valve lift", "stem", "position") - m.add_sensor("cam lift", "guide", "position"))
    names = ("seat spring.stiffness", "seat spring.damping", "pushrod.damping")
    scale = np.array([2e4, 10.0, 40.0])
    runs: list[Result] = []

    def cost(x: Array) -> tuple[float, Array]:
        values = dict(zip(names, (x * scale).tolist(), strict=True))
        g = m.gradient(1e6 * pt.integral(lag * lag), by=names, duration=0.03, parameters=values, rtol=1e-9, atol=1e-11)
        runs.append(g.run)
        return g.value, g.flat * scale

    begin = np.array([1.0, 0.5, 0.5])
    bounds = [(0.05, 3.0), (0.05, 12.0), (0.05, 12.0)]
    found = minimize(cost, begin, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-12, "gtol": 1e-8})
    free = [i for i, (low, high) in enumerate(bounds) if low < found.x[i] < high]
    before, after = cost(begin), cost(found.x)
    still = float(np.abs(after[1][free]).max(initial=0.0)) / before[0]

    def motion(result: Result) -> tuple[Array, Array]:
        return 1e3 * result.t, 1e6 * np.asarray(result.sensor("lag").values)

    return Design(
        "valve train", runs[-2], runs[-1], max(still, after[0] / before[0] / 0.5), 1.0, len(runs) - 2,
        f"the lag falls to {100 * after[0] / before[0]:.0f} % of what it was in the mean square",
        motion, ("t [ms]", "lag of the valve [µm]"),
    )  # fmt: skip


def toe() -> Design:
    """Where the inner end of a tie rod must be for a wheel to keep its toe over its travel."""
    m = pt.catalogue.load("double-wishbone")
    travel = np.linspace(-0.2, 0.2, 41)
    m.add_drive("lower hinge", (np.linspace(0.0, 1.0, 41), travel), interpolation="spline")
    m.add_sensor("toe", pt.Cosine("ground", (1, 0, 0), "knuckle", (0, 1, 0)), "position")
    times = np.linspace(0.0, 1.0, 41)
    drawn = np.array(m.compile().parameters["tie rod in.point"])

    def run(x: Array) -> Result:
        return m.simulate(1.0, t_eval=times, parameters={"tie rod in.point": (drawn[0], *x)})

    def course(result: Result) -> Array:
        return np.asarray(result.sensor("toe").values) * 180.0 / np.pi

    def off(x: Array) -> Array:
        found = course(run(x))
        return found - found.mean()

    def slopes(x: Array) -> Array:
        found = run(x).sensitivities("tie rod in.point").sensor("toe", by="tie rod in.point") * 180.0 / np.pi
        return (found - found.mean(axis=0))[:, 1:]

    found = least_squares(off, drawn[1:], jac=slopes, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    before, after = float(np.ptp(course(run(drawn[1:])))), float(np.ptp(course(run(found.x))))
    angles = np.degrees(travel)
    return Design(
        "toe of a wheel", run(drawn[1:]), run(found.x), after / before, 0.2, int(found.nfev),
        f"the toe changes by {after:.4f} degrees over the travel instead of {before:.4f}",
        lambda result: (angles, course(result) - course(result).mean()), ("angle of the lower arm [°]", "toe [°]"),
    )  # fmt: skip


def swing_up() -> Design:
    """With what speed a crank with a flywheel must be let go, and when to look, so that a pendulum on its pin stands upright
    and at rest there."""
    m = pt.Mechanism("swing-up", gravity=(0, -9.81, 0))
    crank = m.add_body("crank", mass=4.0, inertia=(0.2, 0.2, 0.2))
    rod = m.add_rod("rod", start=(0.25, 0, 0), end=(0.25, -0.5, 0), mass=0.4)
    m.add_revolute("axle", m.ground, crank, point=(0, 0, 0), axis=Z)
    m.add_revolute("pin", crank, rod, point=(0.25, 0, 0), axis=Z)
    turn = pt.Cosine("ground", (0, 1, 0), rod, (0, -1, 0))
    m.add_sensor("height", turn, "position")
    spin = m.add_sensor("axle rate", "axle", "velocity") + m.add_sensor("pin rate", "pin", "velocity")
    m.add_sensor("rate", spin)
    m.add_sensor("angle", m.add_sensor("axle angle", "axle", "position") + m.add_sensor("pin angle", "pin", "position"))
    def start(rate: float) -> pt.State:
        return m.assemble({"axle": 0.0, "pin": 0.0}, {"axle": rate, "pin": -rate})

    def passed(x: Array, of: str) -> Any:
        """With the rod at rest where the crank is let go."""
        both = [pt.start_rate("axle"), pt.start_rate("pin"), pt.end_time]
        return m.gradient(of, by=both, duration=float(x[1]), initial=start(float(x[0])), rtol=1e-10, atol=1e-12)

    def off(x: Array, upright: float) -> Array:
        return np.array([passed(x, "angle").value - upright, 0.3 * passed(x, "rate").value])

    def slopes(x: Array, upright: float) -> Array:
        rows = []
        for of, factor in (("angle", 1.0), ("rate", 0.3)):
            rate, pin, end = passed(x, of).by.values()
            rows.append([factor * (rate - pin), factor * end])
        return np.array(rows)

    # flings that come near, on a coarse grid, the nearest one first
    near = []
    for rate in np.arange(4.0, 16.0, 0.25):
        run = m.simulate(2.5, initial=start(float(rate)), t_eval=np.linspace(0.0, 2.5, 501))
        angle, speed = (np.asarray(run.sensor(name).values) for name in ("angle", "rate"))
        for upright in (np.pi, -np.pi):
            far = np.hypot(angle - upright, 0.3 * speed)
            i = int(far.argmin())
            near.append((float(far[i]), float(rate), float(run.t[i]), upright))
    for _, rate, end, upright in sorted(near)[:TRIED]:
        begin = np.array([rate, end])
        found = least_squares(
            off, begin, jac=slopes, args=(upright,), bounds=((2.0, 0.1), (20.0, 4.0)), xtol=1e-14, ftol=1e-14, gtol=1e-14
        )
        missed = float(np.abs(off(found.x, upright)).max())
        if missed < CLOSE:
            break
    runs = [m.simulate(float(x[1]), initial=start(float(x[0]))) for x in (begin, found.x)]
    return Design(
        "swing-up", runs[0], runs[1], missed, CLOSE, int(found.nfev),
        f"let go at {found.x[0]:.4f} rad/s, upright and at rest after {found.x[1]:.4f} s",
        lambda run: (run.t, np.degrees(np.asarray(run.sensor("angle").values))), ("t [s]", "angle of the rod [°]"),
    )  # fmt: skip


DESIGNS = (coupler_curve, valve_train, toe, swing_up)


def draw(found: list[Design], folder: Path) -> None:
    """What was found, and a page of each run."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    for axes, design in zip(figure.subplots(2, 2).flat, found, strict=True):
        if design.target is not None:
            axes.plot(*design.target, ".", color="0.7", label="wanted")
        axes.plot(*design.curves(design.before), "--", color="#8c4a3a", label="before")
        axes.plot(*design.curves(design.after), color="#1f5f8b", label="after")
        axes.set(title=design.name, xlabel=design.axes[0], ylabel=design.axes[1])
        axes.legend(frameon=False)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "synthesis.svg")
    for design in found:
        design.after.to_html(folder / f"{design.name.replace(' ', '-')}.html")


def main(folder: Path | None = None) -> int:
    """Solve all, say what was found, and whether it is as known."""
    found = [design() for design in DESIGNS]
    for design in found:
        met = "met" if design.number <= design.bound else "MISSED"
        print(f"{design.name}: {design.said} ({design.evaluations} runs with derivatives; {met})")
    if folder is not None:
        draw(found, folder)
    return int(any(not design.number <= design.bound for design in found))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
