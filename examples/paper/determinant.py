"""The choice by determinant depends on the units; that by the measure does not.

Scaling coordinate j by s_j divides |det C_D| by s_j for every set that leaves j dependent: which determinant is the
largest is a question of metres or millimetres, radians or degrees. rho_j is a ratio of two lengths of the same vector.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.patches import Patch
from reference import ABSOLUTE, START, instant

import partita as pt
from partita.plots.style import COLOURS, new_figure

Array = np.ndarray
ANGLES = np.array([name.endswith("turn") for name in ABSOLUTE])
UNITS = {
    "m, rad": np.ones(9),
    "mm, rad": np.where(ANGLES, 1.0, 1e3),
    "m, deg": np.where(ANGLES, 180.0 / np.pi, 1.0),
}


def scores(crank: float, scale: Array) -> tuple[Array, Array]:
    """|det C_D| with each coordinate alone independent, and rho, for coordinates scaled by `scale` (9,)."""
    at = instant(crank, coordinates="absolute")
    m, c = at.M / np.outer(scale, scale), at.C / scale
    determinants = [abs(float(np.linalg.det(np.delete(c, i, axis=1)))) for i in range(9)]
    return np.array(determinants), pt.partition.measure(m, c)


def ranking(values: Array) -> list[str]:
    """Names from the largest value down."""
    return [ABSOLUTE[i] for i in np.argsort(-values, kind="stable")]


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Rank at one position, count along a turn, draw."""
    for unit, scale in UNITS.items():
        by_determinant, by_measure = scores(START, scale)
        print(f"  {unit:<8} determinant: {', '.join(ranking(by_determinant)[:4])};"
              f" measure: {', '.join(ranking(by_measure)[:4])}")  # fmt: skip
    crank = np.linspace(0.0, 2.0 * np.pi, 91 if short else 721)
    rows: dict[str, Array] = {}
    both = {unit: [scores(angle, scale) for angle in crank] for unit, scale in UNITS.items()}
    measured = {unit: np.array([rho for _, rho in values]) for unit, values in both.items()}
    for unit, values in both.items():
        rows[f"determinant, {unit}"] = np.array([int(np.argmax(determinants)) for determinants, _ in values])
    for unit, rho in measured.items():
        rows[f"measure, {unit}"] = np.argmax(rho, axis=1)
    first = {unit: ranking(scores(START, scale)[0])[0] for unit, scale in UNITS.items()}
    spread = max(float(np.max(np.abs(rho - measured["m, rad"]))) for rho in measured.values())
    found: Numbers = {
        "determinant at 0.8 rad: index of its choice in m, rad": float(ABSOLUTE.index(first["m, rad"])),
        "determinant at 0.8 rad: index of its choice in mm, rad": float(ABSOLUTE.index(first["mm, rad"])),
        "determinant at 0.8 rad: index of its choice in m, deg": float(ABSOLUTE.index(first["m, deg"])),
        "measure at 0.8 rad: index of its choice": float(np.argmax(scores(START, UNITS["m, rad"])[1])),
        "determinant: share of the turn that changes with m to mm": float(
            np.mean(rows["determinant, m, rad"] != rows["determinant, mm, rad"])
        ),
        "measure: largest change with the units": spread,
    }
    figure = new_figure(9.0, 3.4)
    ax = figure.subplots()
    used = sorted({int(i) for row in rows.values() for i in row})
    colours = {i: COLOURS[n % len(COLOURS)] for n, i in enumerate(used)}
    width = float(np.degrees(crank[1] - crank[0]))
    for place, row in enumerate(rows.values()):
        for i in used:
            at = np.degrees(crank[row == i])
            ax.broken_barh([(a - width / 2, width) for a in at], (place - 0.4, 0.8), color=colours[i], lw=0)
    ax.set_yticks(range(len(rows)), list(rows), fontsize=9)
    ax.invert_yaxis()
    ax.set_xlim(0, 360)
    ax.set_xticks(range(0, 361, 60))
    ax.tick_params(axis="x", labelsize=8)
    ax.set_xlabel("angle of the crank [deg]", fontsize=9)
    ax.set_title("Which coordinate is chosen", loc="left", fontsize=10, fontweight="bold")
    ax.legend(
        handles=[Patch(color=colours[i], label=ABSOLUTE[i]) for i in used],
        loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False,
    )  # fmt: skip
    finish("Four-bar in absolute coordinates: units and the choice", figure, folder / "determinant.png", found)
    return found


if __name__ == "__main__":
    run(main)
