"""Switching coordinates costs nothing and loses nothing: runs of Partita on the reference four-bar.

`switch_threshold=` is the factor by which another coordinate must be better before it replaces one. Close to 1 it
forces a switch wherever two change places; "kept" is the crank's turn kept independent throughout.
Absolute coordinates, in which six switches belong to a turn of the crank. Two motions: the crank turning, pushed by a
force across it and held by two dashpots, so that errors die out; and the free swing of the catalogue, where they stay.
"""

from __future__ import annotations

import time
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.ticker import NullLocator
from reference import ABSOLUTE, NAME

import partita as pt
from partita.errors import SuspectResultWarning
from partita.plots.style import COLOURS, dressed, new_figure
from partita.results import Result
from partita.state import State

Array = np.ndarray
THRESHOLDS = (1.0001, 1.01, 1.1, 1.25, 1.5, 2.0, 3.0, 5.0)
NEVER = 1e6
"""A threshold that no switch reaches: coordinates are switched only when a step with them fails."""
KEPT = "crank.turn"
RATE, DAMPING = 3.0, 100.0  # of the crank [rad/s], of each dashpot [N s/m]
OUTPUT = 0.25  # [s]: every step below ends there, so that no interpolation adds to the error
STEP = 1.0 / 400.0  # of the table [s]
LOW = (1.0001, 1.01)
# method: order, motion, steps per second from where its leading error term dominates to where round-off begins. The
# term of order 5 of dopri5 is so small that for the damped turns the next one hides it down to round-off.
ORDERS = {
    "rk4": (4, "turning", (200, 240, 280, 320, 400, 480, 560, 640, 800)),
    "dopri5": (5, "swing", (400, 440, 480, 520, 560, 640, 720, 800, 960)),
    "dop853": (8, "turning", (80, 84, 88, 92, 96, 100, 104, 108, 112)),
}
REFERENCE = {"turning": 400, "swing": 1000}
"""Steps per second of the reference, by "dop853" in joint coordinates; round-off is all that is left of its error."""


@cache
def motion(name: str) -> tuple[pt.Mechanism, State, float]:
    """Mechanism, start and length [s] of "turning", eleven turns, or of "swing"."""
    m = pt.catalogue.load(NAME)
    if name == "swing":
        return m, pt.catalogue.entry(NAME).initial(m), 18.0
    tip = (1.0, 0.0, 0.0)
    m.add_force("crank", (0.0, DAMPING * RATE, 0.0), point=tip, axes="body")
    m.add_spring("along x", m.ground, (-50.0, 0.0, 0.0), "crank", tip, stiffness=0.0, damping=DAMPING)
    m.add_spring("along y", m.ground, (0.0, -50.0, 0.0), "crank", tip, stiffness=0.0, damping=DAMPING)
    return m, m.assemble(rates={"A": RATE}), 23.0


def march(name: str, **options: Any) -> Result:
    """A run of the motion with outputs every OUTPUT, in absolute coordinates unless others are asked for."""
    m, start, duration = motion(name)
    times = np.linspace(0.0, duration, round(duration / OUTPUT) + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)  # a run without switches fails, and that is counted
        return m.simulate(duration, **{"initial": start, "t_eval": times, "coordinates": "absolute", **options})


def succeeded(done: Result) -> bool:
    """Whether a run succeeded; it may still be suspect, which the error shows."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)
        return done.success


@cache
def exact(name: str) -> Array:
    """Centres of all links at all outputs, from a tight run in joint coordinates."""
    done = march(name, method="dop853", step=1.0 / REFERENCE[name], coordinates="relative")
    return np.asarray(done.at_once.observed["body_position"])


def error(name: str, done: Result) -> float:
    """Root mean square of the distance of all links from the exact motion at all outputs [m]."""
    gap = done.at_once.observed["body_position"] - exact(name)
    return float(np.sqrt(np.mean(np.sum(gap**2, axis=-1))))


def choices() -> dict[str, dict[str, Any]]:
    """Options of the runs of the table."""
    return {
        **{f"{threshold:g}": {"switch_threshold": threshold} for threshold in (*THRESHOLDS, NEVER)},
        "kept": {"independent": [KEPT]},
    }


def table(rounds: int, method: str) -> dict[str, dict[str, float]]:
    """Per choice: switches, evaluations, least time of a run over evaluations [us], error [m], whether it succeeds.

    Runs are timed in turn, so that what slows the machine down for a while slows all of them.
    """
    rows: dict[str, dict[str, float]] = {}
    for _ in range(rounds):
        for name, options in choices().items():
            begun = time.perf_counter()
            done = march("turning", method=method, step=STEP, **options)
            cost = 1e6 * (time.perf_counter() - begun) / done.counters["evaluations"]
            row = rows.setdefault(name, {"cost": cost})
            row["cost"] = min(cost, row["cost"])
            if "error" not in row:
                row["switches"] = float(sum(change.is_switch for change in done.partitions))
                row["evaluations"] = float(done.counters["evaluations"])
                row["success"] = float(succeeded(done))
                row["error"] = error("turning", done) if succeeded(done) else float("nan")
    return rows


def errors(method: str, threshold: float) -> tuple[list[float], int]:
    """Errors for the steps of ORDERS, and the least number of switches in a run."""
    _, name, rates = ORDERS[method]
    runs = [march(name, method=method, step=1.0 / rate, switch_threshold=threshold) for rate in rates]
    least = min(sum(change.is_switch for change in done.partitions) for done in runs)
    return [error(name, done) for done in runs], least


def handed_over() -> dict[str, float]:
    """Effect of a switch on (q, v), observed from outside, at every switch of some turns.

    An output at the time of a switch is told in the old coordinates. A new run starts from it with the new ones
    kept: what it is then compared with is what the marching run goes on with behind the switch.
    """
    m, start, _ = motion("turning")
    step = 2.0**-9  # sums of it are exact, so that both runs step at the same times
    first = m.simulate(8.0, initial=start, coordinates="absolute", method="dopri5", step=step, switch_threshold=1.0001)
    log = [change for change in first.partitions if change.is_switch]
    jump, position, velocity, equal = 0.0, 0.0, 0.0, 0
    for change in log:
        both = np.array([change.t, change.t + step])
        through = m.simulate(both[1], initial=start, t_eval=both, coordinates="absolute", method="dopri5", step=step,
                             switch_threshold=1.0001)  # fmt: skip
        at = State(change.t, through.q[0], through.v[0], names=list(through.names.coordinates),
                   velocity_names=list(through.names.velocities))  # fmt: skip
        anew = m.simulate(step, initial=at, t_eval=both, coordinates="absolute", method="dopri5", step=step,
                          independent=list(change.independent))  # fmt: skip
        i = ABSOLUTE.index(change.independent[0])
        equal += int(np.array_equal(anew.q[0], through.q[0]) and anew.v[0, i] == through.v[0, i])
        jump = max(jump, float(np.max(np.abs(anew.v[0] - through.v[0]))))
        position = max(position, float(np.max(np.abs(anew.q[1] - through.q[1]))))
        velocity = max(velocity, float(np.max(np.abs(anew.v[1] - through.v[1]))))
    return {
        "handed over: switches looked at": float(len(log)),
        "handed over: q and the new independent velocity equal in every bit": float(equal),
        "handed over: largest difference of the other velocities": jump,
        "handed over: one step later, largest difference of q": position,
        "handed over: one step later, largest difference of v": velocity,
    }


ADAPTIVE = ("dopri5", "dop853", "adams")
FORCED = {"none": NEVER, "forced": 1.0}


def adaptive(method: str) -> dict[str, dict[str, float]]:
    """Switches, evaluations, error [m] of the free swing in joint coordinates, steps by rtol 1e-8: with no switch, and
    with a switch wherever two coordinates change places."""
    rows = {}
    for name, threshold in FORCED.items():
        done = march("swing", method=method, coordinates="relative", rtol=1e-8, atol=1e-10, switch_threshold=threshold)
        switches = float(sum(change.is_switch for change in done.partitions))
        evaluations = float(done.counters["evaluations"])
        rows[name] = {"switches": switches, "evaluations": evaluations, "error": error("swing", done)}
    return rows


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Table of thresholds, orders, what a switch hands over; draw."""
    found: Numbers = {}
    print("turning, 23 s, rk4, 2.5 ms; least time of interleaved runs over their evaluations")
    print("threshold  switches  evaluations  us/evaluation  over kept  error [m]")
    rows = table(1 if short else 9, "rk4")
    for name, row in rows.items():
        ratio = row["cost"] / rows["kept"]["cost"]
        printed = f"{row['error']:.1e}" if row["success"] else "does not hold"
        print(
            f"{name:<11}{row['switches']:<11.0f}{row['evaluations']:<13.0f}{row['cost']:<15.3f}{ratio:<11.3f}{printed}"
        )
        for what in ("switches", "evaluations", "error", "success"):
            found[f"turning, threshold {name}: {what}"] = row[what]
        found[f"turning, threshold {name}: cost per evaluation over kept"] = ratio
    turned = march("turning", method="dop853", step=1.0 / REFERENCE["turning"], coordinates="relative")
    found["turning: turns of the crank"] = float(np.ptp(turned.joint("A").position)) / (2.0 * np.pi)
    longer = table(1 if short else 9, "dop853")
    found["turning by dop853, threshold 1.25: cost per evaluation over kept"] = (
        longer["1.25"]["cost"] / longer["kept"]["cost"]
    )
    curves: dict[tuple[str, float], list[float]] = {}
    for method in ORDERS:
        for threshold in (*LOW, 1.25):
            curves[method, threshold], least = errors(method, threshold)
            steps = 1.0 / np.array(ORDERS[method][2])
            slope = float(np.polyfit(np.log(steps), np.log(curves[method, threshold]), 1)[0])
            found[f"{method}, threshold {threshold:g}: order"] = slope
            found[f"{method}, threshold {threshold:g}: least number of switches"] = float(least)
    found |= handed_over()
    print("free swing in joint coordinates, adaptive steps, rtol 1e-8\nmethod  switches        evaluations  error [m]")
    for method in ADAPTIVE:
        for name, row in adaptive(method).items():
            print(f"{method:<8}{name:<10}{row['switches']:<6.0f}{row['evaluations']:<13.0f}{row['error']:.1e}")
            for what, value in row.items():
                found[f"adaptive, {method}, {name}: {what}"] = value
    more = found["adaptive, adams, forced: evaluations"] - found["adaptive, adams, none: evaluations"]
    found["adaptive, adams: evaluations of a switch"] = more / found["adaptive, adams, forced: switches"]

    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    names = [name for name in rows if rows[name]["success"] and name != f"{NEVER:g}"]
    dressed(left, "Eleven turns of the crank, rk4", "relative to keeping the crank's turn", time_axis=False)
    for n, (what, label) in enumerate((("cost", "cost of an evaluation"), ("error", "error"))):
        values = [rows[name][what] / rows["kept"][what] for name in names]
        left.semilogy(range(len(names)), values, "os"[n] + "-", color=COLOURS[n], ms=4, lw=1.2, label=label)
    left.set_xticks(range(len(names)), [f"{name}\n{rows[name]['switches']:.0f}" for name in names], fontsize=7)
    left.set_xlabel("switch threshold, and number of switches", fontsize=9)
    left.legend(fontsize=8, frameon=False, loc="upper left")
    dressed(right, "Orders, with at least 50 switches in each run", "error [m]", time_axis=False)
    for n, method in enumerate(ORDERS):
        _, name, rates = ORDERS[method]
        steps = 1.0 / np.array(rates)
        for threshold, style in zip(LOW, ("o-", "s--"), strict=True):
            slope = found[f"{method}, threshold {threshold:g}: order"]
            right.loglog(steps, curves[method, threshold], style, color=COLOURS[n], ms=3, lw=1.1,
                         label=f"{method}, {name}, {threshold:g}: {slope:.2f}")  # fmt: skip
    right.set_xticks([0.001, 0.002, 0.005, 0.01, 0.02], ["1", "2", "5", "10", "20"])
    right.xaxis.set_minor_locator(NullLocator())
    right.set_xlabel("step [ms]", fontsize=9)
    right.legend(fontsize=7, frameon=False, title="measured order", title_fontsize=7, alignment="left",
                 loc="upper left", bbox_to_anchor=(1.0, 1.0))  # fmt: skip
    finish("Four-bar: the price of switching coordinates", figure, folder / "switching.png", found)
    return found


if __name__ == "__main__":
    run(main)
