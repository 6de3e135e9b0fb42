"""The metric geometry of a pendulum in x and y: bases, and the gradients k_x and k_y split in two.

A point of 2 kg on a circle of 1 m. The metric is the mass matrix, so that the base vectors e_x and e_y are sqrt(2) long
and the gradients of x and y, with k_i . e_j = 1 or 0, 1 / sqrt(2). Their parts along the motion are what rho measures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.axes import Axes

import partita as pt
from partita.plots.style import COLOURS, new_figure

Array = np.ndarray
MASS, LENGTH, ANGLE = 2.0, 1.0, np.radians(30.0)


def pair(angle: float) -> tuple[Array, Array]:
    """M, and C = dPhi/dq of Phi = (x^2 + y^2 - l^2) / 2, at an angle from the vertical."""
    return MASS * np.eye(2), LENGTH * np.array([[np.sin(angle), -np.cos(angle)]])


def parts(angle: float) -> tuple[Array, Array, Array]:
    """k_x and k_y by contravariant components, and their parts along the constraint and the motion: rows (2, 2)."""
    m, c = pair(angle)
    g = pt.partition.geometry(m, c)
    k = np.linalg.inv(m)  # column i has the covariant components of the unit vector i
    return k.T, (g.P_c @ k).T, (g.P_d @ k).T


def drawn(vector: Array) -> Array:
    """Contravariant components as a length on paper: e_x and e_y are sqrt(m) long and at right angles."""
    return np.sqrt(MASS) * np.asarray(vector)


def arrow(ax: Axes, start: Array, direction: Array, colour: str, name: str, beside: tuple[float, float]) -> None:
    """An arrow from `start` with its name beside its tip."""
    shape = {"arrowstyle": "-|>", "color": colour, "lw": 1.7, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", tuple(start + direction), tuple(start), arrowprops=shape)
    x, y = start + direction + np.array(beside)
    ax.text(x, y, name, color=colour, fontsize=10, ha="center", va="center")


def stage(ax: Axes, at: Array, title: str) -> None:
    """Circle, rod, point and the two lines through the point."""
    arc = np.radians(np.linspace(-35.0, 80.0, 80))
    ax.plot(LENGTH * np.sin(arc), -LENGTH * np.cos(arc), color="#bbbbbb", lw=1.0)
    ax.plot([0.0, at[0]], [0.0, at[1]], color="#999999", lw=1.0)
    ax.plot(0.0, 0.0, "o", color="#999999", ms=4)
    normal = at / LENGTH
    along = np.array([-normal[1], normal[0]])
    for direction in (normal, along):
        ends = at + np.outer((-1.0, 1.2), direction)
        ax.plot(ends[:, 0], ends[:, 1], ":", color="#999999", lw=0.9)
    for direction, far, name in ((normal, 1.2, "constraint\ndirection"), (along, -1.0, "tangent\ndirection")):
        x, y = at + far * direction + np.array([0.05, -0.08])
        ax.text(x, y, name, fontsize=8, color="#777777", va="top")
    ax.set_title(title, loc="left", fontsize=10, fontweight="bold")
    ax.set_aspect("equal")
    ax.set_xlim(-0.6, 2.3)
    ax.set_ylim(-2.25, 0.75)
    ax.set_axis_off()
    ax.plot(*at, "o", color="#333333", ms=5, zorder=5)


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Lengths against the closed formulas at many angles; draw one."""
    angles = np.linspace(0.0, np.pi, 61 if short else 361)
    lengths, right, sums = [], 0.0, 0.0
    for angle in angles:
        m, c = pair(angle)
        g = pt.partition.geometry(m, c)
        k, normal, along = parts(angle)
        lengths.append([g.k, g.k_constrained, g.k_tangential])
        right = max(right, float(np.max(np.abs(np.sum(normal @ m * along, axis=1)))))
        sums = max(sums, float(np.max(np.abs(normal + along - k))))
    table = np.array(lengths)
    formula = np.abs(np.column_stack([np.cos(angles), np.sin(angles)])) / np.sqrt(MASS)
    g = pt.partition.geometry(*pair(ANGLE))
    found: Numbers = {
        "|k_x|": float(g.k[0]),
        "at 30 deg: |k_x,d|": float(g.k_tangential[0]),
        "at 30 deg: |k_x,c|": float(g.k_constrained[0]),
        "at 30 deg: |k_y,d|": float(g.k_tangential[1]),
        "at 30 deg: |k_y,c|": float(g.k_constrained[1]),
        "at 30 deg: M_c": float(g.M_c[0, 0]),
        "at 30 deg: M_d": float(g.M_d[0, 0]),
        "largest deviation from the formulas": float(max(
            np.max(np.abs(table[:, 2] - formula)), np.max(np.abs(table[:, 1] - formula[:, ::-1]))
        )),
        "largest product of both parts of a k": right,
        "largest deviation of their sum from k": sums,
    }  # fmt: skip
    at = LENGTH * np.array([np.sin(ANGLE), -np.cos(ANGLE)])
    k, normal, along = parts(ANGLE)
    figure = new_figure(9.6, 4.9)
    left, right_ax = figure.subplots(1, 2)
    stage(left, at, "Two bases")
    arrow(left, at, drawn(np.eye(2)[0]), COLOURS[0], "$e_x$", (0.12, 0.0))
    arrow(left, at, drawn(np.eye(2)[1]), COLOURS[0], "$e_y$", (0.0, 0.12))
    arrow(left, at, drawn(g.T_cd[0]), COLOURS[1], "$e_c = C M^{-1} e_q$", (0.42, -0.06))
    arrow(left, at, drawn(g.T_cd[1]), COLOURS[2], "$e_d = D\\,e_q$", (0.3, 0.04))
    stage(right_ax, at, "The gradients of x and y, split in two")
    for i, (name, colour) in enumerate((("x", COLOURS[0]), ("y", COLOURS[4]))):
        arrow(right_ax, at, drawn(k[i]), colour, f"$k_{name}$", (0.12, 0.02) if i == 0 else (-0.02, 0.12))
        for part, letter, beside in (
            (normal[i], "c", ((0.24, -0.05), (-0.24, 0.0))[i]), (along[i], "d", ((-0.08, 0.17), (0.02, -0.1))[i]),
        ):  # fmt: skip
            arrow(right_ax, at, drawn(part), colour, f"$k_{{{name},{letter}}}$", beside)
            ends = np.array([at + drawn(k[i]), at + drawn(part)])
            right_ax.plot(ends[:, 0], ends[:, 1], "--", color=colour, lw=0.8)
    finish("Pendulum: bases, gradients and their parts", figure, folder / "geometry_pendulum.png", found)
    return found


if __name__ == "__main__":
    run(main)
