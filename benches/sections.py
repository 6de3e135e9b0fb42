"""The parts of the bench beyond bare runs: outputs, building, many degrees of freedom, the public face.

Each prints what it measures and returns it as plain data.
"""

from __future__ import annotations

import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from building import AIM, PARTS, building_cost
from ensembles import AIM as ENSEMBLE_AIM
from ensembles import FASTER, ensemble_cost
from ensembles import MEMBERS as ENSEMBLE_MEMBERS
from evaluations import AGREES, PROBLEMS, costs
from gradients import AIM as GRADIENT_AIM
from gradients import FEW, gradient_costs
from instant import answers
from limit import commands
from loads import AIM as LOADS_AIM
from loads import load_costs
from many_dof import QUESTIONS, Cost, Question, apart
from outputs import FORCE_AIMS, OUTPUTS_AIM, STATES_AIM, first_forces, outputs_cost, states_costs
from playground import AIM as FRAME_AIM
from playground import frame_costs
from poses import poses_cost
from public_face import AGAIN_AIM, RUNS, face_cost, second_run
from rivals import AIM as PEER_AIM
from rivals import LINKAGES, compared
from rivals import OUTPUTS as PEER_OUTPUTS
from stiff import AIMS as STIFF_AIMS
from stiff import measured
from stiff_chains import AIM as CHAINS_AIM
from stiff_chains import SHAPES as CHAINS
from stiff_chains import SIZES as CHAIN_SIZES
from stiff_chains import cost as chain_cost
from stiff_problems import PROBLEMS as STIFF
from sweeps import AIM as SWEEPS_AIM
from sweeps import MEMBERS, sweep_costs
from ticks import AIM as TICK_AIM
from ticks import PARTS as TICK_PARTS
from ticks import tick_costs
from timing import against, text

ENOUGH = 180.0
"""Seconds after which a mechanism of many degrees of freedom is given up."""


def outputs(_: Path) -> dict[str, Any]:
    """Many outputs against one; the first reaction; states inside a run."""
    print("\nOutputs: m.simulate(1.0) of the four-bar, and the first run.joint(name).force at 1001 outputs")
    cost = outputs_cost()
    print(f"  1 output {text(cost.one)}, {cost.outputs} outputs {text(cost.many)}: {against(cost.ratio, OUTPUTS_AIM)}")
    found: dict[str, Any] = {"run": {**asdict(cost), "ratio": cost.ratio}}
    for title, force in first_forces().items():
        aim = FORCE_AIMS[title]
        mark = "" if force.seconds <= aim else " !"
        print(
            f"  first force, {title}: {text(force.seconds)} (aim: at most {text(aim)}){mark}; "
            f"Newton-Euler residual {force.residual:.1e}"
        )
        found[title] = asdict(force)
    for title, states in states_costs().items():
        print(
            f"  {states.states} states of a run of 10 s, {title}: {text(states.array)} as an array, "
            f"{against(states.array / states.run, STATES_AIM)}; {text(states.one_by_one)} one by one"
        )
        found[f"states, {title}"] = asdict(states)
    return found


def building(_: Path) -> dict[str, Any]:
    """Describe, compile, assemble; save and load."""
    print("\nBuilding: chains of N four-bars, drawn, compiled, assembled; saved as TOML and loaded")
    found = building_cost()
    row = "  {:<10}" + "{:>12}" * (len(PARTS) + 1) + "{:>10}"
    print(row.format("", *PARTS, "built", "|Phi|"))
    for loops, cost in found.items():
        times = [text(getattr(cost, part)) for part in PARTS]
        print(row.format(f"N = {loops}", *times, text(cost.built), f"{cost.closure:.0e}"))
    small, large = found.values()
    growth = {"built": large.built / small.built, "load": large.load / small.load}
    for what, ratio in growth.items():
        print(f"  {what}, N = {large.loops} over N = {small.loops}: {against(ratio, AIM)}")
    return {"sizes": [asdict(cost) for cost in found.values()], "growth": growth}


def dof(_: Path) -> dict[str, Any]:
    """An evaluation of mechanisms of many degrees of freedom."""
    print("\nMany degrees of freedom: one evaluation within a run, and per loop or link")
    found: dict[str, Any] = {}
    for question in QUESTIONS:
        costs = {size: apart(question.kind, size, ENOUGH) for size in (question.small, question.large) if size}
        for size, cost in costs.items():
            if isinstance(cost, str):
                print(f"  {question.kind + ',':<16} N = {size:<6} {cost}", flush=True)
            else:
                print(
                    f"  {question.kind + ',':<16} N = {size:<6} k = {cost.dof:<5} {text(cost.seconds):>8}"
                    f"   {text(cost.seconds / size):>8} each   closure {cost.closure:.0e}",
                    flush=True,
                )
        found[question.kind] = {
            "costs": {str(size): cost if isinstance(cost, str) else asdict(cost) for size, cost in costs.items()},
            "verdict": _verdict(question, costs),
        }
        if (verdict := found[question.kind]["verdict"]) is not None:
            print(f"  {'':<16} {verdict['words']}")
    return found


def _verdict(question: Question, costs: dict[int, Cost | str]) -> dict[str, Any] | None:
    """The ratio per loop, or the cost where there is one size, with its aim."""
    known = {size: cost for size, cost in costs.items() if isinstance(cost, Cost)}
    if len(known) < len(costs):
        return None
    if question.large is None:
        value = known[question.small].seconds
        words = (
            f"one evaluation {text(value)} (aim: at most {text(question.aim)}){'' if value <= question.aim else ' !'}"
        )
    else:
        each = {size: cost.seconds / size for size, cost in known.items()}
        value = each[question.large] / each[question.small]
        words = f"each, N = {question.large} over N = {question.small}: {against(value, question.aim)}"
    return {"value": value, "aim": question.aim, "words": words}


def evaluations(_: Path) -> dict[str, Any]:
    """One evaluation, taken in two ways."""
    print("\nOne evaluation: the column of `compare`, and from whole runs by methods of 4 and of 12 stages")
    found: dict[str, Any] = {}
    for problem in PROBLEMS:
        print(f"  {problem.title}")
        taken = costs(problem)
        for cost in taken:
            mark = "" if abs(cost.off) <= AGREES else " !"
            print(f"    {cost.formulation:<20}{text(cost.column):>10}{text(cost.runs):>10}  {cost.off:+6.1%}{mark}")
        found[problem.title] = {cost.formulation: {**asdict(cost), "off": cost.off} for cost in taken}
    print(f"  aim: the two differ by at most {AGREES:.0%}")
    return found


def face(folder: Path) -> dict[str, Any]:
    """Runs through the public face against the limit."""
    print("\nThe public face: m.simulate with one output against hand-written C for the one mechanism at rtol 1e-10,")
    print("at equal error and in turns within the same minute; one evaluation alone against one of the program")
    programs = commands(folder / "limit")
    if not programs:
        print("  there is no C compiler here: nothing to compare with")
    found = []
    print(
        "  a run, repeated, and an evaluation: by machine code where it is chosen, and without; ratios to the program"
    )
    row = "  {:<20}{:>9}{:>9}{:>8}{:>9}{:>8}{:>9}   {:>9}{:>9}{:>8}{:>9}{:>8}   {:>6}{:>8}{:>8}"
    parts = ["code", "ratio", "without", "ratio"]
    print(row.format("", "program", *parts, "first", "program", *parts, "rtol", "error", "its"))
    for run in RUNS:
        cost = face_cost(run, programs.get(run.title))
        program, ratios = cost.program, cost.ratios or {}
        aims = {"run": run.aim, "levels": run.levels_aim, "code": run.code_aim, "evaluation": run.evaluation_aim}
        found_by = {what: ratio for what, ratio in ratios.items() if ratio == ratio}
        ratio = {what: f"{found_by[what]:.2f}{' !' if found_by[what] > aim else ''}" if what in found_by else ""
                 for what, aim in aims.items()}  # fmt: skip
        print(
            row.format(
                run.title,
                text(program.seconds) if program else "none",
                text(cost.seconds),
                ratio["run"],
                text(cost.levels),
                ratio["levels"],
                text(cost.first),
                text(program.alone) if program else "none",
                "none" if cost.code is None else text(cost.code),
                ratio["code"],
                text(cost.alone),
                ratio["evaluation"],
                f"{cost.rtol:.0e}",
                f"{cost.error:.0e}",
                f"{program.error:.0e}" if program else "",
            ),
            flush=True,
        )
        found.append({**asdict(cost), "ratios": cost.ratios})
    print("  first: of a mechanism just drawn, checked and assembled too; a mark where more than is aimed at:")
    listed = "; ".join(
        f"{run.title} {run.aim:g}, {run.levels_aim:g}, {run.code_aim:g}, {run.evaluation_aim:g}" for run in RUNS
    )
    print(f"  {listed}")
    print(
        "  a second run of a model, beside its evaluations and outputs (the core alone, its options and results handed"
        " over)"
    )
    again = [second_run(name) for name in ("four-bar", "andrews-squeezer", "bricard")]
    for x in again:
        mark = "" if x.face <= AGAIN_AIM else " !"
        face = f"m.simulate {text(x.face)} (aim: at most {text(AGAIN_AIM)}){mark}"
        print(
            f"    {x.title:<20}{face}, of which core {text(x.core)}; "
            f"an evaluation {text(x.evaluation)}, an output {text(x.output)}"
        )
    return {"runs": found, "again": [asdict(x) for x in again]}


def poses(_: Path) -> dict[str, Any]:
    """Poses by the hundred thousand in one call."""
    print("\nPoses: m.assemble_many of motors at positions by chance, one call, CPU time")
    found = poses_cost()
    for cost in found:
        each = cost.seconds / cost.poses
        print(
            f"  {cost.title:<10}{cost.assembled} of {cost.poses} assembled: {text(cost.seconds)}, {text(each)} each "
            f"(aim: at most {text(cost.aim)}){'' if each <= cost.aim else ' !'}; |Phi| {cost.closure:.0e}"
        )
    return {"sweeps": [asdict(cost) for cost in found]}


def ensembles(folder: Path) -> dict[str, Any]:
    """Thousands of four-bars side by side."""
    print(f"\nEnsembles: {ENSEMBLE_MEMBERS} four-bars of 1 s at rtol 1e-8, one output")
    cost = ensemble_cost(folder)
    mark, slow = "" if cost.cpu <= ENSEMBLE_AIM else " !", "" if cost.one / cost.two >= FASTER else " !"
    print(
        f"  {cost.in_lanes} in lanes, {cost.steps} steps: {text(cost.cpu)} of CPU on one core (aim: at most "
        f"{text(ENSEMBLE_AIM)}){mark}; two cores {cost.one / cost.two:.2g} times as fast (aim: {FASTER:g}){slow}"
    )
    if cost.copies is not None:
        print(f"  two copies of the limit at once do {cost.copies:.2g} times the work of one")
    limit = "no C compiler" if cost.limit is None else f"{text(cost.limit)}, {cost.cpu / cost.limit:.2g} of it"
    print(f"  a loop over ordinary runs {text(cost.loop)}; the limit {limit}; members differ by {cost.apart:.0e} rad")
    return asdict(cost)


def instant(_: Path) -> dict[str, Any]:
    """Questions about one position."""
    print("\nOne position: an evaluation of the core, and the call of the package; how far from another way")
    found = answers()
    for one in found:
        mark = "" if one.core <= one.aim else " !"
        print(
            f"  {one.title:<38}{text(one.core):>9} (aim: at most {text(one.aim)}){mark}; call {text(one.call)}; "
            f"{one.error:.0e}"
        )
    return {one.title: asdict(one) for one in found}


def loads(_: Path) -> dict[str, Any]:
    """Forces over a coordinate and of tyres, without Python in the loop."""
    print("\nLoads: m.simulate with a load over the same fixed steps without it")
    found = load_costs()
    for title, cost in found.items():
        print(f"  {title}: {text(cost.bare)} without, {text(cost.loaded)} with: {against(cost.ratio, LOADS_AIM)}")
    return {title: {**asdict(cost), "ratio": cost.ratio} for title, cost in found.items()}


def playground(_: Path) -> dict[str, Any]:
    """Frames of playground pages."""
    print("\nPlayground: the motion of one frame (1/60 s) in Node, CPU time; median of later frames, and the first")
    found = frame_costs()
    if not found:
        print("  there is no Node to run the scripts of the page")
    for title, cost in found.items():
        mark = "" if cost.seconds <= FRAME_AIM else " !"
        print(
            f"  {title:<27}{text(cost.seconds):>9} (aim: at most {text(FRAME_AIM)}){mark}, first {text(cost.first)}; "
            f"{cost.evaluations:.1f} evaluations; module of {cost.module / 1e3:.0f} kB"
        )
    return {title: asdict(cost) for title, cost in found.items()}


def ticks(_: Path) -> dict[str, Any]:
    """Steps of a stepper."""
    cost = tick_costs()
    print(f"\nA million steps of a stepper, as in a control loop: {cost.title}, two steps of order four in each")
    print(
        f"  fastest {text(cost.fastest)}; beside its evaluations ({text(cost.evaluation)} each) {text(cost.beside)} "
        f"(aim: at most {text(TICK_AIM)}){'' if cost.beside <= TICK_AIM else ' !'}"
    )
    for part, seconds in zip(TICK_PARTS, cost.within, strict=True):
        print(f"  {100 * part:g} % of all steps take at most {text(seconds)}")
    return {**asdict(cost), "beside": cost.beside, "parts": TICK_PARTS}


def gradients(_: Path) -> dict[str, Any]:
    """Derivatives of runs."""
    print(f"\nDerivatives of runs against the run itself: {FEW} numbers forwards, many backwards; rtol 1e-10")
    found = gradient_costs()
    for cost in found:
        print(
            f"  {cost.name:<13}run {text(cost.run)} ({cost.steps} steps); forwards {text(cost.forward)}: "
            f"{against(cost.forward / cost.run, GRADIENT_AIM)}; {cost.numbers} numbers backwards {text(cost.adjoint)}: "
            f"{against(cost.adjoint / cost.run, GRADIENT_AIM)}; both agree to {cost.agrees:.1e}"
        )
    return {"linkages": [asdict(cost) for cost in found]}


def sweeps(_: Path) -> dict[str, Any]:
    """Short members over a cluster."""
    print(f"\nSweeps: {MEMBERS} members of 0.5 ms over a Dask cluster of two processes, CPU time of all processes")
    found = sweep_costs()
    if not found:
        print("  Dask, psutil or xarray is missing")
    for cost in found:
        print(
            f"  {cost.title:<13}{text(cost.cpu)}, of it the members {text(cost.members)} and the parent "
            f"{text(cost.parent)}: {against(cost.ratio, SWEEPS_AIM)}; serial loop {text(cost.serial)}, "
            f"idle cluster {text(cost.idle)}, wall {text(cost.wall)}"
            f"{'' if cost.same else '; OTHER VALUES'}"
        )
    return {cost.title: {**asdict(cost), "ratio": cost.ratio} for cost in found}


def peers(folder: Path) -> dict[str, Any]:
    """The same linkages in other programs."""
    print(
        f"\nPeers: the same linkages in other programs, {PEER_OUTPUTS} outputs, at an error of {PEER_AIM:g} rad in the"
    )
    print("first angle at the end; where a program does not reach it, at the smallest error it reached")
    found: dict[str, Any] = {}
    row = "  {:<58}{:<34}{:>9}{:>9}   {:>9}{:>9}{:>8}"
    for linkage in LINKAGES:
        print(row.format(linkage.title, "setting", "time", "error", "Partita", "error", "slower"), flush=True)
        comparison = compared(linkage, folder / "peers")
        for x in comparison.rows:
            if isinstance(x, str):
                print(f"    {x}", flush=True)
                continue
            ends = (text(x.seconds), f"{x.error:.0e}", text(x.own), f"{x.own_error:.0e}", f"{x.ratio:.2g}")
            print(row.format(f"  {x.peer}", x.setting, *ends), flush=True)
        found[linkage.title] = {
            "rows": [x if isinstance(x, str) else {**asdict(x), "ratio": x.ratio} for x in comparison.rows],
            "curves": {title: [asdict(x) for x in tried] for title, tried in comparison.curves.items()},
        }
    return found


def stiff(folder: Path) -> dict[str, Any]:
    """Stiff mechanisms by implicit methods, here and in other programs."""
    print("\nStiff: the cheapest setting of each method that reaches an error at the end, as a part of the motion.")
    print("Cost: evaluations made; Partita's with k for each Jacobian. Least: the evaluations alone, as code in C")
    sys.stdout.flush()
    row = "  {:<48}{:<18}{:>9}{:>10}{:>7}{:>11}{:>11}"
    found: dict[str, Any] = {}
    for problem in STIFF:
        compared = measured(problem, folder / "stiff")
        print(f"  {compared.title}, k = {compared.dof}; radau and dop853 agree to {compared.agrees:.0e}")
        for aim in STIFF_AIMS:
            print(row.format(f"  at {aim:.0e}", "setting", "error", "cost", "J", "time", "least"))
            for name in compared.curves:
                few, fast = compared.at(aim, name, "cost"), compared.at(aim, name, "seconds")
                if few is None or fast is None:
                    print(f"    {name} does not reach it")
                    continue
                least = text(fast.least) if fast.least > 0.0 else ""
                cost = f"{few.cost:.0f}" if few.cost else ""
                print(
                    row.format(
                        f"    {name}", fast.setting, f"{fast.error:.0e}", cost, few.jacobians, text(fast.seconds), least
                    )
                )
        for why in compared.missing:
            print(f"    {why}")
        sys.stdout.flush()
        found[compared.title] = {
            "dof": compared.dof,
            "agrees": compared.agrees if math.isfinite(compared.agrees) else None,
            "curves": {name: [clean(asdict(x)) for x in tried] for name, tried in compared.curves.items()},
            "missing": compared.missing,
        }
    return found


def chains(_: Path) -> dict[str, Any]:
    """Implicit steps of stiff mechanisms of many loops."""
    print("\nStiff mechanisms of many loops: implicit steps, for each loop or link; the start of a run apart")
    found: dict[str, Any] = {}
    for shape, make in CHAINS.items():
        for coordinates in ("relative", "absolute"):
            costs = {size: chain_cost(make(size), coordinates) for size in CHAIN_SIZES}
            each = {size: cost.per_step() / size for size, cost in costs.items()}
            growth = each[CHAIN_SIZES[-1]] / each[CHAIN_SIZES[-2]]
            cells = ", ".join(f"{size}: {text(x)}" for size, x in each.items())
            print(f"  {shape:<7}{coordinates:<10}{cells}; the last over the one before {against(growth, CHAINS_AIM)}")
            sys.stdout.flush()
            found[f"{shape}, {coordinates}"] = {str(size): asdict(cost) for size, cost in costs.items()}
    return found


def clean(tried: dict[str, Any]) -> dict[str, Any]:
    """NaN is null in JSON."""
    return {key: None if isinstance(x, float) and not math.isfinite(x) else x for key, x in tried.items()}


SECTIONS = {
    "outputs": outputs,
    "building": building,
    "dof": dof,
    "evaluations": evaluations,
    "face": face,
    "peers": peers,
    "poses": poses,
    "ensembles": ensembles,
    "instant": instant,
    "loads": loads,
    "playground": playground,
    "gradients": gradients,
    "ticks": ticks,
    "sweeps": sweeps,
    "stiff": stiff,
    "chains": chains,
}
