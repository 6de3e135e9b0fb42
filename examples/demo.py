"""A four-bar and Andrews' squeezer: simulated, checked against known answers, drawn in out/.

Run it with `make demo`, or `.venv/bin/python examples/demo.py [FOLDER]`. Everything printed is computed in that run;
the exit code is 1 if an answer is missed.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from time import perf_counter

import numpy as np

import partita as pt
from partita.catalogue import Entry
from partita.results import Result

WIDTH = 92
RUNS = {"four-bar": 1001, "andrews-squeezer": 1001}  # outputs; those at the published times are added


def main(folder: Path) -> int:
    """Simulate, print and draw each mechanism; 1 if one missed its answers."""
    folder.mkdir(parents=True, exist_ok=True)
    right = [show(pt.catalogue.entry(name), outputs, folder) for name, outputs in RUNS.items()]
    return 0 if all(right) else 1


def show(entry: Entry, outputs: int, folder: Path) -> bool:
    """Simulate, check and draw one mechanism; return whether it met its known answers."""
    began = perf_counter()
    mechanism = entry.mechanism()
    start = entry.initial(mechanism)
    ready = perf_counter()
    result = mechanism.simulate(entry.duration, t_eval=entry.t_eval(outputs), initial=start, **entry.options)
    done = perf_counter()

    head(entry, result)
    if not result.success:
        say(f"The run stopped early: {result.message}")
        return False
    section("Which coordinates describe the motion", [*choice(result), *switches(result)])
    section(*left_out(result))
    section("How far this run can be trusted", certificate(result))
    measured = entry.measure(result)
    section(f"Against known answers ({entry.source.split(',')[0]})", [f"  {m}" for m in measured])
    times = f"{1e3 * (ready - began):.0f} ms to build and assemble, {1e3 * (done - ready):.0f} ms to simulate"
    section("Work", [*counters(result), f"  {times} {len(result.t)} outputs"])
    pictures = [folder / f"{entry.name}.html", folder / f"{entry.name}.png"]
    result.to_html(pictures[0])
    result.plot(path=pictures[1])
    section("Look at it", [f"  {picture}" for picture in pictures])
    print()
    return all(m.passed for m in measured)


def head(entry: Entry, result: Result) -> None:
    """Print the name, the description and the options of the run."""
    about, options = result.summary, result.options
    print("=" * WIDTH)
    say(f"{entry.name}: {entry.title}")
    print("=" * WIDTH)
    say(
        f"{len(about['bodies'])} bodies, {len(about['joints'])} joints, mobility {about['mobility']}; "
        f"{entry.duration:g} s with {options['method']}, rtol {options['rtol']:g}, atol {options['atol']:g}"
    )


def choice(result: Result) -> list[str]:
    """The coordinates at the start with their measure, the independent ones first, and why these."""
    rho, names = result.measure[0], result.names.velocities
    chosen = [int(i) for i in result.independent[0]]
    order = sorted(range(len(rho)), key=lambda i: (i not in chosen, -rho[i]))
    width = max(map(len, names))
    lines = wrapped(
        "rho tells how mobile a coordinate is with the loops closed, relative to the loops opened: 1 where they do not "
        f"hinder it, 0 where they lock it. At t = {result.t[0]:g} s:"
    )
    for i in order:
        role = "independent" if i in chosen else "follows from the closed loops"
        lines.append(f"    {names[i]:<{width}}  rho = {rho[i]:.6f}  {role}")
    free = ", ".join(names[i] for i in chosen)
    locked = " One with rho = 0 could not be chosen here: nothing follows from it." if rho.min() < 1e-9 else ""
    lines += wrapped(f"The most mobile is chosen, and the motion is integrated in {free} alone.{locked}")
    lines += wrapped(
        "Quality of the choice (1 is best): "
        f"sigma = {result.sigma[0]:.3f} and sqrt(mu) = {result.sqrt_mu[0]:.3f} at the start; at worst "
        f"{least(result.sigma, result.t)} and {least(result.sqrt_mu, result.t)}."
    )
    return lines


def switches(result: Result) -> list[str]:
    """Every change of the choice, or why there was none."""
    changes = [change for change in result.partitions if change.is_switch]
    threshold = result.options["switch_threshold"]
    if changes:
        return [f"  Switched {len(changes)} times:", *(f"    {change}" for change in changes)]
    own = result.measure[:, result.independent[0]].min(axis=1, keepdims=True)
    gain = float(np.max(np.delete(result.measure, result.independent[0], axis=1) / own))
    return wrapped(
        f"Switches during the run: none. At no output was another coordinate more than {gain:.2f} times as mobile as "
        f"the chosen one; they are switched beyond {threshold:g}."
    )


def left_out(result: Result) -> tuple[str, list[str]]:
    """Redundant closure constraints that were dropped, grouped by reason."""
    removed = result.summary["removed"]
    reasons: dict[str, list[str]] = {}
    for row in removed:
        reasons.setdefault(row["why"], []).append(row["row"])
    total = len(removed) + result.multipliers.shape[1]
    lines = []
    for why, rows in reasons.items():
        lines += [f"  {', '.join(rows)}:", *wrapped(why, "    ")]
    return f"Closure constraints: {total}, of which {len(removed)} are redundant and left out", lines


def certificate(result: Result) -> list[str]:
    """Worst values over all outputs."""
    found = result.certificate
    rows = (
        ("closure", found.closure, "largest closure error [m, rad]"),
        ("velocity closure", found.velocity_closure, "its rate [m/s, rad/s]"),
        ("energy balance", found.energy_balance, f"relative to the {result.energy.scale:.3g} J exchanged"),
        ("Newton-Euler", found.newton_euler, "residual with the joint reactions, over the largest force"),
    )
    lines = [f"  {name:<18}{'unknown' if value is None else f'{value:.1e}'}   {what}" for name, value, what in rows]
    always = result.at_once.determined[1].all(axis=0)
    unique = f"{always.sum()} of {always.size}"
    return [*lines, f"  {'reactions':<18}{unique:<10}components follow from the motion; the rest need elasticity"]


def counters(result: Result) -> list[str]:
    """What was done, in numbers."""
    words = [(count, name.replace("_", " ")) for name, count in result.counters.items() if count]
    return wrapped(", ".join(f"{count} {name.removesuffix('s') if count == 1 else name}" for count, name in words))


def least(values: np.ndarray, t: np.ndarray) -> str:
    """Smallest value and its time."""
    i = int(np.argmin(values))
    return f"{values[i]:.3f} at t = {t[i]:.3g} s"


def wrapped(text: str, indent: str = "  ") -> list[str]:
    """Lines of at most WIDTH columns."""
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def say(text: str) -> None:
    """Print wrapped, at the margin."""
    print("\n".join(wrapped(text, "")))


def section(title: str, lines: Iterable[str]) -> None:
    """A titled paragraph."""
    print(f"\n{title}")
    print("\n".join(lines))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "out")))
