"""Artificial tangent velocities are best where they are made, and fade as the mechanism moves on.

S = D_0 M_0 with D_0 M_0 D_0^T = 1 makes u' = S v the mass-orthonormal velocity of one position. Kept frozen, its
quality sqrt(mu_S), the cosine between the directions it measures and those the loops allow, falls from 1 towards 0.
The coordinates chosen by the measure fade as well, but cost nothing to choose again.
"""

from __future__ import annotations

from pathlib import Path

import linkage
import numpy as np
from drawing import FOLDER, Numbers, finish, run

import partita as pt
from partita.plots.style import COLOURS, dressed, new_figure

Array = np.ndarray
START = 0.8
"""Angle of the crank where the tangent is made [rad]."""


def tangent(crank: float) -> tuple[Array, Array]:
    """M (9, 9) and the tangent direction d (9,) of kinetic energy 1/2, in absolute coordinates."""
    m, c = linkage.absolute_matrices(linkage.close(crank))
    d = np.linalg.svd(c)[2][-1]
    return m, d / np.sqrt(d @ m @ d)


def quality(s: Array, crank: float) -> float:
    """sqrt(mu_S): |S d| over the length of S as a covector."""
    m, d = tangent(crank)
    return abs(float(s @ d)) / float(np.sqrt(s @ np.linalg.solve(m, s)))


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Freeze, turn the crank, watch the quality; renewed tangents and exchanged coordinates beside it; draw."""
    m0, d0 = tangent(START)
    frozen = m0 @ d0
    turned = np.linspace(0.0, 180.0, 61 if short else 361)
    crank = START + np.radians(turned)
    lasting = np.array([quality(frozen, angle) for angle in crank])
    rho = np.array([pt.partition.measure(*linkage.absolute_matrices(linkage.close(angle))) for angle in crank])
    renewed, renewals, s = [], 0, frozen
    chosen, exchanges, i = [], 0, int(np.argmax(rho[0]))
    for angle, row in zip(crank, rho, strict=True):
        if quality(s, angle) < 0.5:
            m, d = tangent(angle)
            s, renewals = m @ d, renewals + 1
        renewed.append(quality(s, angle))
        best = int(np.argmax(row))
        if row[best] > 1.25 * row[i]:
            i, exchanges = best, exchanges + 1
        chosen.append(row[i])
    found = {f"frozen tangent after {a} deg": quality(frozen, START + np.radians(a)) for a in (0, 10, 40, 80, 120)}
    found |= {
        "renewals below 0.5, in half a turn": float(renewals),
        "exchanges of coordinates with margin 1.25, in half a turn": float(exchanges),
        "least quality of the exchanged coordinates": float(min(chosen)),
    }
    figure = new_figure(9.0, 3.6)
    ax = figure.subplots()
    dressed(ax, "Quality √μ of velocities made at 0°", "√μ", time_axis=False)
    ax.plot(turned, lasting, color=COLOURS[1], lw=1.6, label="tangent frozen at 0°")
    ax.plot(turned, renewed, color=COLOURS[4], lw=1.1, ls="--", label="tangent renewed below 0.5")
    ax.plot(turned, chosen, color=COLOURS[0], lw=1.3, label="coordinate, exchanged")
    ax.set_xlabel("turn of the crank [deg]", fontsize=9)
    ax.set_ylim(0, 1.03)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    finish("Four-bar: a frozen tangent fades", figure, folder / "frozen.png", found)
    return found


if __name__ == "__main__":
    run(main)
