"""The measure of a pendulum's coordinates, against the closed formulas.

A point on a circle, phi from the vertical: rho_x = |cos phi|, rho_y = |sin phi|: they change places at 45 degrees.
A rod with its centre of mass c from the pivot, in x, y and the angle: rho_theta^2 = J / (m c^2 + J) all the way round,
less than what x or y offer at their best, although the angle never fails: the measure looks at an instant, and at
inertia, not at a whole turn.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run

import partita as pt
from partita.plots.style import COLOURS, dressed, new_figure

MASS, CENTRE = 2.0, 0.5
INERTIA = MASS * CENTRE**2 / 3.0  # of a slender rod


def point(phi: float) -> np.ndarray:
    """Measure of x, y of the point at phi from the vertical."""
    return pt.partition.measure(np.eye(2), [[np.sin(phi), -np.cos(phi)]])


def rod(phi: float) -> np.ndarray:
    """Measure of x, y and the angle of the rod: rows hold the pivot still."""
    c, s = CENTRE * np.cos(phi), CENTRE * np.sin(phi)
    return pt.partition.measure(np.diag([MASS, MASS, INERTIA]), [[1.0, 0.0, -c], [0.0, 1.0, -s]])


def switches(short: bool) -> list[float]:
    """Angles from the vertical [deg] at which a swing through a quarter turn on each side changed coordinates."""
    swing = pt.System(
        n=2,
        mass=np.eye(2),
        forces=(0.0, -9.81),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
        names=["x", "y"],
    )
    step = 0.005 if short else 0.001
    # a switch threshold of 1: no margin, so that switches occur where the formula predicts them
    result = pt.simulate(swing, 2.0, [1.0, 0.0], [0.0, 0.0], method="rk4", step=step, switch_threshold=1.0)
    at = [np.interp(change.t, result.t, np.arctan2(np.abs(result.q[:, 0]), -result.q[:, 1]))
          for change in result.partitions if change.is_switch]  # fmt: skip
    return np.degrees(at).tolist()


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Measure, compare with the formulas, draw."""
    phi = np.linspace(0.0, np.pi, 61 if short else 361)
    points, rods = np.array([point(a) for a in phi]), np.array([rod(a) for a in phi])
    formula = np.abs(np.column_stack([np.cos(phi), np.sin(phi)]))
    share = MASS * CENTRE**2 / (MASS * CENTRE**2 + INERTIA)
    slender = np.sqrt(np.column_stack([share * formula**2, np.full(len(phi), 1.0 - share)]))
    angles = switches(short)
    found = {
        "point: largest deviation from |cos|, |sin|": float(np.max(np.abs(points - formula))),
        "rod: largest deviation from the formulas": float(np.max(np.abs(rods - slender))),
        "rod: rho of the angle": float(rods[0, 2]),
        "switches of x and y in two seconds": float(len(angles)),
        "first switch at [deg]": angles[0],
        "farthest switch from 45 [deg]": float(np.max(np.abs(np.array(angles) - 45.0))),
    }
    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, title, values, names in (
        (left, "A point on a circle", points, "xy"),
        (right, "A slender rod", rods, "xyθ"),
    ):
        dressed(ax, title, "ρ" if ax is left else "", time_axis=False)
        for i, name in enumerate(names):
            ax.plot(np.degrees(phi), values[:, i], color=COLOURS[i], label=name)
        for angle in (45.0, 135.0):
            ax.axvline(angle, color="#999999", lw=0.8, ls=":")
        ax.set_xticks(range(0, 181, 45))
        ax.set_xlabel("angle from the vertical [deg]", fontsize=9)
    right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    finish("Pendulum: the measure and its formulas", figure, folder / "pendulum.png", found)
    return found


if __name__ == "__main__":
    run(main)
