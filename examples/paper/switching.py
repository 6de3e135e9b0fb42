"""Exchanging coordinates costs nothing and passes no error on.

A pendulum that turns over, in x and y, by Runge-Kutta 4 on the k + n equations, written out here: once with the better
coordinate, once forced to exchange after every step in which the other one has rho > 0.3. The exchange maps (q, q') to
itself; so the order stays 4 and the error does not grow with the number of exchanges, which here is most of the number
of steps.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.ticker import NullLocator

from partita.plots.style import COLOURS, dressed, new_figure

Array = np.ndarray
GRAVITY, START, DURATION = 9.81, (0.0, 7.0), 10.0
LEAST = 0.3
"""Coordinates below this measure are never taken."""


def rates(state: Array, i: int) -> Array:
    """(x', y', v') of the unit pendulum with coordinate i independent, v its velocity; j depends on it."""
    j = 1 - i
    slope = -state[i] / state[j]  # C = [x y]
    q_rate = np.empty(2)
    q_rate[i], q_rate[j] = state[2], slope * state[2]
    xi = -(q_rate @ q_rate) / state[j]
    force = np.array([0.0, -GRAVITY])
    reduced = force[i] + slope * (force[j] - xi)
    return np.array([q_rate[0], q_rate[1], reduced / (1.0 + slope**2)])


def march(h: float, forced: bool) -> tuple[Array, int, float]:
    """q at the end, number of exchanges, and the largest jump of q' at one."""
    phi, rate = START
    state = np.array([np.sin(phi), -np.cos(phi), np.cos(phi) * rate])
    i, exchanges, jump = 0, 0, 0.0
    for _ in range(round(DURATION / h)):
        k1 = rates(state, i)
        k2 = rates(state + h / 2.0 * k1, i)
        k3 = rates(state + h / 2.0 * k2, i)
        k4 = rates(state + h * k3, i)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        j = 1 - i
        state[j] -= 0.5 * (state[0] ** 2 + state[1] ** 2 - 1.0) / state[j]  # dependent coordinate alone
        own, other = abs(state[j]), abs(state[i])  # rho of i and of j: the share of the other coordinate in the rod
        if other > (LEAST if forced else own):
            before = rates(state, i)[:2]
            state[2], i, exchanges = before[j], j, exchanges + 1
            jump = max(jump, float(np.max(np.abs(rates(state, i)[:2] - before))))
    return state[:2], exchanges, jump


def exact() -> Array:
    """q at the end, from the one equation for the angle with steps so small that only round-off is left."""
    y, steps = np.array(START), 40_000
    h = DURATION / steps

    def slope(y: Array) -> Array:
        return np.array([y[1], -GRAVITY * np.sin(y[0])])

    for _ in range(steps):
        k1 = slope(y)
        k2 = slope(y + h / 2.0 * k1)
        k3 = slope(y + h / 2.0 * k2)
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + slope(y + h * k3))
    return np.array([np.sin(y[0]), -np.cos(y[0])])


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """March with several steps, compare errors and orders, draw."""
    steps = [0.02, 0.005, 0.00125] if short else [0.04, 0.02, 0.01, 0.005, 0.0025, 0.00125]
    end = exact()
    errors: dict[bool, list[float]] = {False: [], True: []}
    counts: dict[tuple[float, bool], int] = {}
    jump = 0.0
    for h in steps:
        for forced in (False, True):
            q, counts[h, forced], largest = march(h, forced)
            errors[forced].append(float(np.linalg.norm(q - end)))
            jump = max(jump, largest)
    orders = {forced: float(np.polyfit(np.log(steps), np.log(errors[forced]), 1)[0]) for forced in errors}
    found: Numbers = {
        "steps at h = 0.005": DURATION / 0.005,
        "exchanges among them, the better coordinate": float(counts[0.005, False]),
        "exchanges among them, forced": float(counts[0.005, True]),
        "order, the better coordinate": orders[False],
        "order, forced": orders[True],
        "error at the smallest step, the better coordinate": errors[False][-1],
        "error at the smallest step, forced": errors[True][-1],
        "largest jump of q' at an exchange": jump,
    }
    figure = new_figure(7.0, 3.8)
    ax = figure.subplots()
    dressed(ax, "Error after 10 s", "distance from the exact motion [m]", time_axis=False)
    for forced, name in ((False, "the better coordinate"), (True, "forced exchanges")):
        label = f"{name}: {counts[0.005, forced]} in 2000 steps"
        ax.loglog(steps, errors[forced], "o-", color=COLOURS[int(forced)], ms=4, lw=1.2, label=label)
    guide = errors[False][0] * (np.array(steps) / steps[0]) ** 4
    ax.loglog(steps, guide, ":", color="#888888", lw=1.0, label="order 4")
    ax.set_xticks(steps, [f"{h:g}" for h in steps])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.margins(x=0.04)
    ax.set_xlabel("step [s]", fontsize=9)
    ax.legend(fontsize=8, frameon=False)
    finish("Pendulum: the price of exchanging coordinates", figure, folder / "switching.png", found)
    return found


if __name__ == "__main__":
    run(main)
