"""The page on speed, its figure and that of stiff mechanisms, from one run of the bench; `make speed` writes them."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from timing import text

FIGURE, STIFF_FIGURE = "pictures/speed.svg", "pictures/stiff.svg"
HEAD = """# Speed

Measured by `make bench` on one machine ({machine}) in one sitting; this page and its figure are written from its
numbers by `make speed`. Ratios hold from machine to machine, times do not. Speed is error *and* cost through
`m.simulate`, outputs included.

## Against programs by hand

Programs in C that know one mechanism and nothing else (`benches/limit`): minimal coordinates, loops in closed form,
DOP853 at a relative tolerance of 1e-10, no outputs, no checks. They run in turns with Partita, at equal error: the
loosest tolerance whose error is not above the program's. Runs are repeated, so that evaluations are machine code, made
in memory; the same run without it stands beside. The first run is that of a mechanism just drawn, with all checks of
the drawing. An evaluation by machine code is one inside a step, with what the method adds up; one without is alone.
Ratios to the program are in brackets.

| | program | run | without code | first run | program's evaluation | by code | without |
|---|---|---|---|---|---|---|---|
"""
PEERS = """
## Against other programs

The same linkages, 201 outputs, each program with the settings that are best for it here. What is compared is the time
at an error of 1e-6 rad of the first angle at the end; where a program does not reach it, at the smallest error that it
reached. Scripts and pinned versions are in `benches/peers`; `make peers` installs them.

![Time against error, each program on each linkage](pictures/speed.svg)

| linkage | program | setting | time | error | Partita | slower by |
|---|---|---|---|---|---|---|
"""
NOTES = """
Where the last column is below 1, that program is faster: code that is generated for one mechanism, compiled by a C
compiler and integrated by a loop in C is what the programs by hand are, and it writes no outputs. What it takes to
generate and compile is not counted, nor are outputs; Partita's runs are judged, closed to rounding and ready for any
question about forces.
Pinocchio is called from Python here and only its evaluations are timed. Drake and MuJoCo are made for contact at
interactive rates, not for small errors. The links of the chain come in line again and again: equations for multipliers
lose rank there, which costs the programs that solve them their digits or the run.
"""
STIFF_AIM = 1e-6
STIFF = """
## Stiff mechanisms

The same [stiff mechanisms](stiff.md) at an error of 1e-6 at the end, as a part of how much positions and rates change.
Solvers that need rates get Partita's equations as C and make Jacobians by differences; evaluations are those made, and
Partita's are those of its steps and k for each Jacobian (J). Their times hold the calls from Python; the last column
has their evaluations alone, at the speed of C. Van der Pol's law is a function in Python for all. Of tolerances in
decades the fastest that reaches the error counts.

| mechanism | method | setting | error | evaluations | J | time | evaluations alone |
|---|---|---|---|---|---|---|---|
"""
MANY = """
## Many parts

One evaluation within a run at fixed steps, by machine code, shared out among the N four-bars, five-bars or links of a
mechanism. It should not grow with their number.

| mechanism | N | degrees of freedom | each | N | degrees of freedom | each | ratio |
|---|---|---|---|---|---|---|---|
"""


def write(record: dict[str, Any], docs: Path) -> None:
    """`speed.md` and its figure into `docs`."""
    lines = [HEAD.format(machine=record["machine"])]
    for run in record["face"]["runs"]:
        program, ratios = run["program"], run["ratios"]
        if program is None:
            continue
        lines.append(
            f"| {run['title']} | {text(program['seconds'])} | {text(run['seconds'])} ({ratios['run']:.1f}) | "
            f"{text(run['levels'])} ({ratios['levels']:.1f}) | {text(run['first'])} | {text(program['alone'])} | "
            + ("none" if run["code"] is None else f"{text(run['code'])} ({ratios['code']:.1f})")
            + f" | {text(run['alone'])} ({ratios['evaluation']:.1f}) |\n"
        )
    again = ", ".join(f"{x['title']} {text(x['face'])}" for x in record["face"]["again"])
    lines.append(f"\nA second run of the same model costs, beside its evaluations and outputs: {again}.\n")
    lines.append(PEERS)
    for title, found in record["peers"].items():
        for x in found["rows"]:
            if isinstance(x, str):
                lines.append(f"| {title} | {x} | | | | | |\n")
                continue
            lines.append(
                f"| {title} | {x['peer']} | {x['setting']} | {text(x['seconds'])} | {x['error']:.0e} | "
                f"{text(x['own'])} | {float(format(x['ratio'], '.2g')):g} |\n"
            )
    lines.append(NOTES)
    lines += stiff_lines(record["stiff"])
    ensembles, poses = record["ensembles"], record["poses"]["sweeps"]
    lines.append(
        f"\n## Many at once\n\n4096 four-bars of 1 s at a relative tolerance of 1e-8 (`m.ensemble`): "
        f"{text(ensembles['cpu'])} of CPU on one core,\n"
        f"{ensembles['one'] / ensembles['two']:.2g} times as fast on two (two copies of the program by hand at once do "
        f"{ensembles['copies'] or math.nan:.2g} times the work of one); "
        f"a loop over `m.simulate` {text(ensembles['loop'])}.\nPoses (`m.assemble_many`), a second and core: "
        + ", ".join(f"{x['title']} {x['poses'] / x['seconds'] / 1e6:.1f} million" for x in poses)
        + ".\n"
    )
    lines.append(MANY)
    for kind, question in record["dof"].items():
        if len(question["costs"]) != 2 or question["verdict"] is None:
            continue
        sizes = [(int(n), cost["seconds"] / int(n), cost["dof"]) for n, cost in question["costs"].items()]
        costs = " | ".join(f"{n} | {dof} | {text(each)}" for n, each, dof in sizes)
        lines.append(f"| {kind} | {costs} | {question['verdict']['value']:.2f} |\n")
    building = record["building"]
    small, large = (size["loops"] for size in building["sizes"])
    levels = {int(n): value for n, value in record["growth"]["ns_per_evaluation"].items() if value}
    lines.append(
        f"\nA chain of {large} four-bars takes {building['growth']['built']:.1f} times the time of one of {small} "
        f"to draw, compile and assemble,\nand {building['growth']['load']:.1f} times to load from its file. "
        "Without machine code an evaluation\ncosts each loop of a chain "
        + ", ".join(f"{value / n:.0f} ns (N = {n})" for n, value in levels.items())
        + ".\n"
    )
    (docs / "speed.md").write_text("".join(lines), encoding="utf-8")
    drawn(record["peers"], docs / FIGURE)
    stiff_drawn(record["stiff"], docs / STIFF_FIGURE)


def stiff_lines(record: dict[str, Any]) -> list[str]:
    """The part on stiff mechanisms."""
    lines = [STIFF]
    for title, found in record.items():
        for name, tried in found["curves"].items():
            good = [x for x in tried if x["error"] <= STIFF_AIM]
            if not good:
                if tried:
                    least = min(x["error"] for x in tried)
                    lines.append(f"| {title} | {name} | not reached | {least:.0e} | | | | |\n")
                continue
            x = min(good, key=lambda x: x["seconds"])
            cost = f"{x['cost']:.0f} | {x['jacobians'] or ''}" if x["cost"] else " | "
            lines.append(
                f"| {title} | {name} | {x['setting']} | {x['error']:.0e} | {cost} | {text(x['seconds'])} | "
                f"{text(x['least']) if x['least'] else ''} |\n"
            )
        lines += [f"| {title} | {why} | | | | | | |\n" for why in found["missing"]]
    return lines


def stiff_drawn(record: dict[str, Any], path: Path) -> None:
    """Cost against error of stiff mechanisms, one panel each."""
    shown = {title: found for title, found in record.items() if found["curves"]["dop853"]}
    titles = list(dict.fromkeys(name for found in shown.values() for name in found["curves"]))
    titles = [name for name in titles if "alpha" not in name]
    styles = {"radau": ("black", "-", 2.4), "auto": ("black", ":", 2.0), "dop853": ("0.5", "-", 2.0)}
    rows = 2 if len(shown) > 3 else 1
    columns = -(-len(shown) // rows)
    figure, grid = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.6 * rows), sharey=True, squeeze=False, layout="constrained"
    )
    for panel in grid.flat[len(shown) :]:
        panel.set_axis_off()
    for panel, (title, found) in zip(grid.flat, shown.items(), strict=False):
        for k, name in enumerate(titles):
            color, line, width = styles.get(name, (f"C{k}", "-", 1.2))
            points = [(max(x["error"], 1e-12), x["cost"]) for x in found["curves"].get(name, [])]
            if name == "dop853" and points:
                # stability asks for as much at any error
                points.insert(0, (1e-3, min(cost for _, cost in points)))
            if points:
                panel.loglog(*zip(*points, strict=True), line, marker=".", linewidth=width, color=color, label=name)
        panel.set(title=title, xlabel="error at the end, as a part of the motion", xlim=(1e-10, 1e-3), ylim=(1e2, 2e6))
        panel.grid(alpha=0.3)
    for row in grid:
        row[0].set_ylabel("evaluations, and k for each Jacobian")
    handles = dict(pair for panel in grid.flat for pair in zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def drawn(peers: dict[str, Any], path: Path) -> None:
    """Time against error, one panel for each linkage."""
    titles = list(dict.fromkeys(name for found in peers.values() for name in found["curves"]))
    figure, panels = plt.subplots(1, len(peers), figsize=(4.2 * len(peers), 4.4), sharey=True, layout="constrained")
    for panel, (title, found) in zip(panels, peers.items(), strict=True):
        for k, name in enumerate(titles):
            points = sorted((max(x["error"], 1e-13), x["seconds"]) for x in found["curves"].get(name, []))
            if points:
                own = name == "Partita"
                panel.loglog(
                    *zip(*points, strict=True),
                    marker="o",
                    markersize=4,
                    linewidth=2.4 if own else 1.2,
                    color="black" if own else f"C{k}",
                    label=name,
                )
        panel.set(title=title, xlabel="error of the first angle at the end [rad]")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("time of a run with 201 outputs [s]")
    handles = dict(pair for panel in panels for pair in zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    write(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
