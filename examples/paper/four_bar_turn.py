"""The measure over a full turn of a four-bar, in joint and in absolute coordinates, with the switches.

In joint coordinates two of three are good all the way round. In absolute ones the most mobile changes again and again,
and only the angle of the crank never fails, although it is never the most mobile: a margin saves some switches, a
look at the whole turn would save all.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from reference import ABSOLUTE, JOINT, measures

from partita.plots.style import COLOURS, dressed, new_figure

Array = np.ndarray
MARGINS = (1.0, 1.2, 1.5, 2.0, 3.0)


def follow(rho: Array, margin: float) -> list[int]:
    """The independent coordinate at each position: another one replaces it where it is `margin` times as mobile."""
    chosen = [int(np.argmax(rho[0]))]
    for row in rho[1:]:
        best = int(np.argmax(row))
        chosen.append(best if row[best] > margin * row[chosen[-1]] else chosen[-1])
    return chosen


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Measure, follow the choice with several margins, draw."""
    crank = np.linspace(0.0, 2.0 * np.pi, 3601 if short else 7201)
    joint = measures(crank, "relative")
    absolute = measures(crank, "absolute")
    found: Numbers = {}
    for i, name in enumerate(JOINT):
        found[f"joint: least rho of {name}"] = float(joint[:, i].min())
        found[f"joint: largest rho of {name}"] = float(joint[:, i].max())
    for i, name in enumerate(ABSOLUTE):
        found[f"absolute: least rho of {name}"] = float(absolute[:, i].min())
    found["absolute: largest rho of crank.turn"] = float(absolute[:, ABSOLUTE.index("crank.turn")].max())
    for kind, rho in (("joint", joint), ("absolute", absolute)):
        for margin in MARGINS:
            chosen = follow(rho, margin)
            found[f"{kind}: switches, margin {margin:g}"] = float(np.count_nonzero(np.diff(chosen)))
            found[f"{kind}: least rho of the chosen, margin {margin:g}"] = float(
                np.min(rho[np.arange(len(crank)), chosen])
            )
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[0.12, 1.0, 0.12, 1.0])
    names = ([f"joint {name}" for name in JOINT], ABSOLUTE)
    for n, (kind, rho) in enumerate((("joint", joint), ("absolute", absolute))):
        strip, ax = axes[2 * n], axes[2 * n + 1]
        shown = range(len(names[n]))
        colours = {i: COLOURS[i % len(COLOURS)] for i in shown}
        dressed(ax, "", "ρ", time_axis=False)
        for i in shown:
            style = "-" if i < len(COLOURS) else "--"
            ax.plot(np.degrees(crank), rho[:, i], style, color=colours[i], lw=1.3, label=names[n][i])
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.05), fontsize=8, frameon=False)
        ax.set_ylim(-0.03, 1.05)
        chosen = follow(rho, 1.2)
        for i in sorted(set(chosen)):
            strip.fill_between(np.degrees(crank), 0, 1, where=np.array(chosen) == i, color=colours[i], lw=0, step="mid")
        strip.set_title(
            f"{kind.capitalize()} coordinates; on top: the choice with a margin of 1.2",
            loc="left", fontsize=10, fontweight="bold",
        )  # fmt: skip
        strip.set_axis_off()
    axes[-1].set_xticks(range(0, 361, 60))
    axes[-1].set_xlabel("angle of the crank [deg]", fontsize=9)
    finish("Four-bar: the measure along a full turn", figure, folder / "four_bar_turn.png", found)
    return found


if __name__ == "__main__":
    run(main)
