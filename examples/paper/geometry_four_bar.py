"""The metric geometry of the reference four-bar: lengths, their two parts, the measure, and the projectors.

The measure from the constraints (20), which needs no choice, and from the tangent (21), for every choice there is, are
the same. What the constraints leave of a coordinate, |k_i,d|, is the same in joint and in absolute coordinates; |k_i|,
what it is compared with, is not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from reference import ABSOLUTE, JOINT, START, geometry, instant

import partita as pt
from partita.plots.style import COLOURS, dressed, new_figure

Array = np.ndarray
CRANK = ABSOLUTE.index("crank.turn")


def from_constraints(g: pt.partition.Geometry) -> Array:
    """Squares of rho (n,) by (20): from k_i*(c), the columns of C M^-1, in the metric M_c."""
    raised = g.T_cd[: len(g.rows)]
    return np.asarray(1.0 - np.sum(raised * np.linalg.solve(g.M_c, raised), axis=0) / g.k**2)


def from_tangent(g: pt.partition.Geometry) -> Array:
    """Squares of rho (n,) by (21): from k_i*(d), the columns of D, in the metric M_d."""
    tangent = g.T_cd[len(g.rows) :]
    return np.asarray(np.sum(tangent * np.linalg.solve(g.M_d, tangent), axis=0) / g.k**2)


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Lengths over a turn, the measure computed in two ways, projectors at the start; draw."""
    crank = np.linspace(0.0, 2.0 * np.pi, 121 if short else 721)
    along = [geometry(angle) for angle in crank]
    k, normal, tangent = (
        np.array([getattr(g, name) for g in along]) for name in ("k", "k_constrained", "k_tangential")
    )
    both = 0.0
    for angle in crank[::10]:
        at = instant(angle)
        for independent in range(3):
            if at.rho[independent] < 0.1:  # near its dead point a choice loses digits, as 1 / rho^2
                continue
            g = pt.partition.geometry(at.M, at.C, [independent])
            both = max(both, float(np.max(np.abs(from_constraints(g) - from_tangent(g)))))
    absolute = [geometry(angle, "absolute") for angle in crank[::10]]
    intrinsic = max(
        abs(one.k_tangential[CRANK] / joint.k_tangential[0] - 1.0)
        for one, joint in zip(absolute, along[::10], strict=True)
    )
    there, there_absolute = geometry(START), geometry(START, "absolute")
    units = np.outer(1.0 / there.k, there.k)
    split = np.abs(normal**2 + tangent**2 - k**2) / k**2
    P_c, P_d = there.P_c * units, there.P_d * units
    found: Numbers = {
        "largest difference of rho^2 by (20) and by (21)": both,
        "largest deviation of Pythagoras, in parts of |k|^2": float(np.max(split)),
        "P_c + P_d: largest deviation from 1": float(np.max(np.abs(P_c + P_d - np.eye(3)))),
        "P_d: largest deviation of its square": float(np.max(np.abs(P_d @ P_d - P_d))),
        "|k_A,d|^2 at 0.8 rad, joint": float(there.k_tangential[0] ** 2),
        "|k_A,d|^2 at 0.8 rad, absolute": float(there_absolute.k_tangential[CRANK] ** 2),
        "|k_A,d|: largest relative difference over a turn": float(intrinsic),
        "|k_A|^2 at 0.8 rad, joint": float(there.k[0] ** 2),
        "|k_A|^2 at 0.8 rad, absolute": float(there_absolute.k[CRANK] ** 2),
    }
    for i, name in enumerate(JOINT):
        found[f"least |k_{name}|"], found[f"largest |k_{name}|"] = float(k[:, i].min()), float(k[:, i].max())
        found[f"least |k_{name},d|"] = float(tangent[:, i].min())
        found[f"largest |k_{name},d|"] = float(tangent[:, i].max())

    figure = new_figure(10.0, 5.6)
    axes = figure.subplots(2, 3)
    degrees = np.degrees(crank)
    for i, name in enumerate(JOINT):
        ax = axes[0, i]
        dressed(ax, f"joint {name}", "length [1 / (kg$^{1/2}$ m)]" if i == 0 else "", time_axis=False)
        for values, label, style, colour in (
            (k, "|k|", "-", COLOURS[0]), (normal, "|k$_c$|, taken", "--", COLOURS[1]),
            (tangent, "|k$_d$|, left", "-", COLOURS[2]),
        ):  # fmt: skip
            ax.plot(degrees, values[:, i], style, color=colour, lw=1.4, label=label)
        ax.set_ylim(0.0, None)
    axes[0, 2].legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    ax = axes[1, 0]
    dressed(ax, "ρ = |k$_d$| / |k|", "ρ", time_axis=False)
    for i, name in enumerate(JOINT):
        ax.plot(degrees, tangent[:, i] / k[:, i], color=COLOURS[(3, 4, 5)[i]], lw=1.4)
        index = len(crank) // 4
        above = tangent[index, i] / k[index, i] + 0.03
        ax.text(90.0, above, name, fontsize=9, color=COLOURS[(3, 4, 5)[i]])
    ax.set_ylim(-0.03, 1.05)
    for ax in (*axes[0], axes[1, 0]):
        ax.set_xlim(0, 360)
        ax.set_xticks(range(0, 361, 90))
        ax.set_xlabel("angle of the crank [deg]", fontsize=9)
    for ax, matrix, title in ((axes[1, 1], P_c, "P$_c$ at 0.8 rad"), (axes[1, 2], P_d, "P$_d$ at 0.8 rad")):
        ax.imshow(matrix, cmap="RdBu", vmin=-6.0, vmax=6.0)
        for row in range(3):
            for column in range(3):
                ax.text(column, row, f"{matrix[row, column]:.3f}", ha="center", va="center", fontsize=9)
        ax.set_xticks(range(3), JOINT, fontsize=8)
        ax.set_yticks(range(3), JOINT, fontsize=8)
        ax.set_title(title, loc="left", fontsize=10, fontweight="bold")
    finish("Four-bar: lengths, measure and projectors", figure, folder / "geometry_four_bar.png", found)
    return found


if __name__ == "__main__":
    run(main)
