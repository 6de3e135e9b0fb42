"""Periodic motions of four mechanisms, each with a known answer, and a picture of them.

Run it with `.venv/bin/python examples/cycles.py [FOLDER]`. Known are: the period of Van der Pol's oscillator, that of a
pendulum by an elliptic integral, the speed at which a five-bar doubles its period, computed in 128 bits by another
program, and where the resonance of a pendulum on a crank pin turns back, by SciPy with variational equations. The exit
code is 1 if one is missed. With FOLDER a picture is drawn there, cycles.svg.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.special import ellipk

import partita as pt

Array = NDArray[np.float64]
G = 9.81
NEAR = 1e-8
"""Known values are met to this. Scale: fraction of them. Reason: a period of Van der Pol is known to 16 digits, a
bifurcation is located to 10."""
RADIUS, LENGTH, DRAG = 0.03, 0.5, 0.02


def van_der_pol() -> pt.Mechanism:
    """x'' - (1 - x^2) x' + x = 0: a force that feeds small motions and brakes large ones."""
    m = pt.Mechanism("Van der Pol", gravity=None)
    mass = m.add_body("mass", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, mass, axis=(1, 0, 0))
    m.add_torsion_spring("S", stiffness=1.0)
    m.add_force(mass, (lambda t, s: (1.0 - s.position("S") ** 2) * s.velocity("S"), 0, 0), name="valve")
    return m


def pendulum() -> pt.Mechanism:
    """A uniform rod."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def five_bar() -> pt.Mechanism:
    """Uniform bars of 1 kg/m, one driven at a constant rate, one on a torsion spring."""
    m = pt.Mechanism("five-bar")
    b, d = np.array([0.2, 0, 0]), np.array([0.8 + 0.45 * np.cos(1.2), 0.45 * np.sin(1.2), 0])
    far = float(np.linalg.norm(d - b))
    turn = np.arctan2(d[1], d[0] - 0.2) + np.arccos((0.7**2 + far**2 - 0.75**2) / (1.4 * far))
    c = b + 0.7 * np.array([np.cos(turn), np.sin(turn), 0.0])
    ab = m.add_rod("AB", start=(0, 0, 0), end=b, mass=0.2)
    bc = m.add_rod("BC", start=b, end=c, mass=0.7)
    dc = m.add_rod("DC", start=d, end=c, mass=0.75)
    ed = m.add_rod("ED", start=(0.8, 0, 0), end=d, mass=0.45)
    m.add_revolute("A", m.ground, ab, point=(0, 0, 0))
    m.add_revolute("B", ab, bc, point=b)
    m.add_revolute("E", m.ground, ed, point=(0.8, 0, 0))
    m.add_revolute("D", ed, dc, point=d)
    m.add_revolute("C", bc, dc, point=c)
    m.add_torsion_spring("E", stiffness=40.0, damping=0.05, name="spring")
    m.add_drive("A", velocity=19.9, name="motor")
    return m


def on_a_pin() -> pt.Mechanism:
    """A pendulum that hangs on the pin of a crank."""
    m = pt.Mechanism("pendulum on a crank pin")
    disc = m.add_body("disc", mass=1.0, inertia=(1, 1, 1))
    rod = m.add_rod("rod", start=(RADIUS, 0, 0), end=(RADIUS, -LENGTH, 0), mass=1.0)
    m.add_revolute("A", m.ground, disc, point=(0, 0, 0))
    m.add_revolute("B", disc, rod, point=(RADIUS, 0, 0))
    m.add_torsion_spring("B", stiffness=0.0, damping=DRAG, name="drag")
    m.add_drive("A", velocity=6.0, name="motor")
    return m


def turned(x: Array, rate: float) -> tuple[Array, Array]:
    """That pendulum after one turn of the crank, and the derivatives by its start; without Partita."""

    def rates(t: float, y: Array) -> list[float]:
        sine, cosine = np.sin(y[0]), np.cos(y[0])
        ax, ay = -RADIUS * rate**2 * np.cos(rate * t), -RADIUS * rate**2 * np.sin(rate * t)
        bend = -1.5 / LENGTH * (G * sine + cosine * ax + sine * ay) - 3.0 * DRAG / LENGTH**2 * (y[1] - rate)
        slope = -1.5 / LENGTH * (G * cosine - sine * ax + cosine * ay)
        drag = 3.0 * DRAG / LENGTH**2
        return [y[1], bend, y[3], slope * y[2] - drag * y[3], y[5], slope * y[4] - drag * y[5]]

    end = solve_ivp(rates, (0.0, 2.0 * np.pi / rate), [*x, 1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[:2], end[2:].reshape(2, 2).T


def turns_back(near: Any) -> float:
    """The speed at which its resonance turns back."""

    def conditions(x: Array) -> list[float]:
        end, matrix = turned(x[:2], x[2])
        return [*(end - x[:2]), float(np.linalg.det(matrix - np.eye(2)))]

    state = near.cycle.state
    start = [state.position("A") + state.position("B"), state.velocity("A") + state.velocity("B"), near.value]
    return float(fsolve(conditions, start, xtol=1e-13)[2])


def main(folder: Path | None = None) -> int:
    """Compute all, compare, and draw."""
    free = van_der_pol()
    own = free.cycle(initial=free.assemble({"S": 1.0}))
    swing = pendulum()
    wide = swing.cycle(initial=swing.assemble({"A": 2.5}))
    bars = five_bar()
    start = bars.assemble({"E": -0.05}, rates={"E": -0.5})
    bent = bars.cycle(along={"motor.velocity": [19.0, 20.6]}, initial=start)
    doubling = bent.period_doublings[0]
    twice = doubling.branch([20.6])
    resonance = on_a_pin().cycle(along={"motor.velocity": [6.0, 4.0]})
    rows = [
        ("Van der Pol: period [s]", 6.663286859323130, own.period),
        ("pendulum from 2.5 rad: period [s]", 4 * float(ellipk(np.sin(1.25) ** 2)) / np.sqrt(1.5 * G), wide.period),
        ("five-bar: period doubles at [rad/s]", 20.0340519360705780, doubling.value),
        *((f"crank pin: fold {i} at [rad/s]", turns_back(x), x.value) for i, x in enumerate(resonance.folds, 1)),
    ]
    missed = 0
    for what, known, found in rows:
        off = abs(found - known) / known
        missed += off > NEAR
        print(f"{what:36s} {known:16.12f} {found:16.12f} {off:8.1e}")
    if folder is not None:
        draw(folder / "cycles.svg", own, bent, twice, resonance)
    return int(missed > 0)


def draw(path: Path, own: Any, bent: Any, twice: Any, resonance: Any) -> None:
    """Four panels."""
    from partita.plots.files import save_figure
    from partita.plots.style import COLOURS, dressed, new_figure

    figure = new_figure(9.5, 7.5)
    (a, b), (c, d) = figure.subplots(2, 2)
    dressed(a, "Van der Pol: its own period", "rate [m/s]", time_axis=False)
    a.set_xlabel("position [m]", fontsize=9)
    motion = own.result.joint("S")
    a.plot(motion.position, motion.velocity, color=COLOURS[0], linewidth=1.8, label=f"{own.period:.6f} s")
    m = van_der_pol()
    for begin in (0.1, 3.0):
        run = m.simulate(18.0, initial=m.assemble({"S": begin}), t_eval=np.linspace(0.0, 18.0, 500)).joint("S")
        a.plot(run.position, run.velocity, color=COLOURS[1], linewidth=0.7)
    dressed(b, "Five-bar: one period and two", "rate of ED [rad/s]", time_axis=False)
    b.set_xlabel("angle of ED [rad]", fontsize=9)
    for one, colour, word in ((bent[0], COLOURS[0], "19 rad/s"), (twice[0], COLOURS[1], "20.6 rad/s")):
        turning = one.result.joint("E")
        b.plot(turning.angle + 1.2, turning.velocity, color=colour, linewidth=1.4, label=word)
    dressed(c, "Five-bar: multipliers", "imaginary part", time_axis=False)
    c.set_xlabel("real part", fontsize=9)
    around = np.linspace(0.0, 2.0 * np.pi, 201)
    c.plot(np.cos(around), np.sin(around), color="#888888", linewidth=0.9)
    for family, colour, word in ((bent, COLOURS[0], "one period"), (twice, COLOURS[1], "two periods")):
        x = family.curve_multipliers
        c.plot(x.real.ravel(), x.imag.ravel(), ".", color=colour, markersize=5, label=word)
    c.set_aspect("equal")
    dressed(d, "Pendulum on a crank pin: resonance", "largest swing [rad]", time_axis=False)
    d.set_xlabel("speed of the crank [rad/s]", fontsize=9)
    speeds, swings = resonance.curve_values, swing_of(resonance)
    calm = resonance.curve_unstable == 0
    for keep, style, label in ((calm, "-", "stable"), (~calm, "--", "unstable")):
        # each part up to the next position of the other kind
        near = keep | np.roll(keep, 1)
        d.plot(np.where(near, speeds, np.nan), np.where(near, swings, np.nan), style, color=COLOURS[0], label=label)
    folds = [(x.value, np.abs(angle_of(x.cycle.result)).max()) for x in resonance.folds]
    d.plot(*np.array(folds).T, "^", color=COLOURS[1], markersize=7, label="fold")
    for ax in (a, b, c, d):
        ax.legend(fontsize=8, frameon=False)
    save_figure(figure, path)


def angle_of(run: Any) -> Array:
    """Angle of the pendulum from the vertical."""
    turning: Array = run.joint("A").angle + run.joint("B").angle
    return turning


def swing_of(family: Any) -> Array:
    """Largest angle from the vertical, in each of the positions of a family."""
    return np.array([np.abs(angle_of(run)).max() for run in family.curve])


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
