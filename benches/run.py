"""Accuracy and cost of whole runs, and how the cost grows with the mechanism; then outputs, building, many degrees of
freedom and the public face.

Run it with `make bench`, best on a machine that does nothing else; `python benches/run.py FOLDER SECTION ...` runs some
sections only (runs, outputs, building, chains, dof, evaluations, face, gradients, peers, poses, ensembles, instant,
loads, playground, stiff, sweeps, ticks). Tables are printed, and the same numbers are written to out/bench.json. Times
of the bare runs are those of one call of the core, which reads no Python and gives one output, at the end: rank of the
constraints, choice of coordinates, every step with its closing. The exit code is 1 if an answer is missed; a time above
its aim is marked but is no failure, since machines differ.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from sections import SECTIONS

import partita as pt
from partita import options as run_options
from partita.catalogue import Entry

RTOL, ATOL = 1e-10, 1e-12
PATIENCE = 3.0
"""Seconds spent on the repetitions of one problem, of which there are at least three."""


@dataclass(frozen=True)
class Problem:
    """A run of the catalogue."""

    title: str
    name: str
    duration: float
    parameters: dict[str, int] = field(default_factory=dict)

    def entry(self) -> Entry:
        """Its entry in the catalogue."""
        return pt.catalogue.entry(self.name, **self.parameters)


PROBLEMS = (
    Problem("four-bar", "four-bar", 10.0),
    Problem("double four-bar", "double-four-bar", 10.0),
    Problem("chain N = 40", "n-four-bar", 10.0, {"loops": 40}),
    Problem("chain N = 1000", "n-four-bar", 10.0, {"loops": 1000}),
    Problem("Andrews' squeezer", "andrews-squeezer", 0.03),
)
GROWTH = (250, 500, 1000, 2000)
STRETCH, STEP, ROUNDS = (0.1, 0.6), 0.005, 9
"""Growth is measured by steps of this length between these times [s]: free of what is done once at the start, with the
same steps for all, and before the links come in line for the first time."""


STEEPEST = 1.15


@dataclass(frozen=True)
class Cost:
    """One problem, measured; what its run did, and how far it is from the known answer."""

    title: str
    best_ms: float
    median_ms: float
    runs: int
    steps: int
    evaluations: int
    ns_per_evaluation: float
    error_of: str
    error: float | None
    tolerance: float
    message: str

    @property
    def right(self) -> bool:
        """Whether the known answer was met."""
        return self.error is not None and self.error <= self.tolerance


def main(folder: Path, wanted: list[str]) -> int:
    """Measure, print, write; 1 if an answer was missed."""
    known = ["runs", *SECTIONS]
    if unknown := [name for name in wanted if name not in known]:
        print(f"there is no section {', '.join(unknown)}; sections: {', '.join(known)}", file=sys.stderr)
        return 2
    print(f"Partita {pt.__version__} on {machine()}; Python {platform.python_version()}")
    record: dict[str, Any] = {"version": pt.__version__, "machine": machine(), "rtol": RTOL, "atol": ATOL}
    right = True
    if "runs" in (wanted or known):
        bare, right = bare_runs()
        record |= bare
    record |= {name: section(folder) for name, section in SECTIONS.items() if name in (wanted or known)}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "bench.json").write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    print(f"\nwrote {folder / 'bench.json'}")
    return 0 if right else 1


def bare_runs() -> tuple[dict[str, Any], bool]:
    """Whole runs of the core and the growth of their cost; whether every known answer was met."""
    print(f"DOP853, rtol {RTOL:g}, atol {ATOL:g}, one output at the end; one core\n")
    print("Whole runs")
    print(ROW.format("", "fastest", "median", "runs", "steps", "evaluations", "per eval.", "error", ""))
    costs = []
    for problem in PROBLEMS:
        costs.append(measured(problem))
        print(cost_line(problem, costs[-1]), flush=True)
    print("  per eval.: fastest run over its evaluations, so all else that a run does is in it")
    for title, what in errors_of(costs).items():
        print(f"  error of {what}: {title}")
    span = f"{STRETCH[0]:g} s to {STRETCH[1]:g} s in steps of {STEP:g} s"
    print(f"\nGrowth of the cost of an evaluation without machine code: chains of N four-bars, {span}")
    grown = growth()
    for loops, ns in grown.items():
        print(f"  N = {loops:<5} {ns / 1e3:9.1f} us   {ns / loops:6.1f} ns per loop")
    known = all(np.isfinite(ns) for ns in grown.values())
    exponent = float(np.polyfit(np.log(list(grown)), np.log(list(grown.values())), 1)[0]) if known else None
    if exponent is None:
        print("  no exponent: a run stopped early")
    else:
        print(f"  fitted exponent {exponent:.3f}, aim: at most {STEEPEST}" + ("" if exponent <= STEEPEST else " !"))

    record = {
        "runs": [{**asdict(c), "right": c.right} for c in costs],
        "growth": {
            "ns_per_evaluation": {str(n): ns if known else None for n, ns in grown.items()},
            "exponent": exponent,
        },
    }
    return record, all(c.right for c in costs)


def measured(problem: Problem) -> Cost:
    """Time the run, then compute the error with the outputs that the check asks for (they change no step)."""
    run = prepared(problem.entry(), problem.duration)
    seconds, raw = timed(run)
    counters = raw["log"].counters()
    check = problem.entry().checks[0]
    error, message = None, raw["message"]
    if raw["success"]:
        entry = problem.entry()
        m = entry.mechanism()
        outputs = [t for t in entry.times if t <= problem.duration]
        start = entry.initial(m)
        result = m.simulate(problem.duration, t_eval=outputs, initial=start, rtol=RTOL, atol=ATOL)
        error, message = (check.run(result).error if result.success else None), result.message
    return Cost(
        title=problem.title,
        best_ms=1e3 * min(seconds),
        median_ms=1e3 * statistics.median(seconds),
        runs=len(seconds),
        steps=counters["steps"],
        evaluations=counters["evaluations"],
        ns_per_evaluation=1e9 * min(seconds) / counters["evaluations"],
        error_of=check.name,
        error=error,
        tolerance=check.tolerance,
        message=message,
    )


def growth() -> dict[int, float]:
    """Cost [ns] of an evaluation within the run of each chain: what the longer of two runs adds to the shorter one.

    All are run in turns, several times, and the fastest of each counts, so that a disturbance of the machine does not
    fall on one length alone. NaN where a run stopped early.
    """
    runs = {
        (loops, end): prepared(pt.catalogue.entry("n-four-bar", loops=loops), end, step=STEP, compiled=False)
        for loops in GROWTH
        for end in STRETCH
    }
    seconds = dict.fromkeys(runs, float("inf"))
    evaluations = dict.fromkeys(runs, 0)
    for _ in range(ROUNDS):
        for key, run in runs.items():
            start = perf_counter()
            raw = run()
            seconds[key] = min(seconds[key], perf_counter() - start) if raw["success"] else float("nan")
            evaluations[key] = raw["log"].counters()["evaluations"]
    less, more = STRETCH
    return {
        n: 1e9 * (seconds[n, more] - seconds[n, less]) / (evaluations[n, more] - evaluations[n, less]) for n in GROWTH
    }


def prepared(
    entry: Entry, duration: float, step: float | None = None, compiled: bool | str = "auto"
) -> Callable[[], dict[str, Any]]:
    """The call of the core that carries out a run, with everything around it done beforehand."""
    mechanism = entry.mechanism()
    start, model = entry.initial(mechanism), mechanism.compile()
    chosen = run_options.options(
        start.t, duration, model.velocity_names, rtol=RTOL, atol=ATOL, max_steps=200_000, step=step, compiled=compiled
    )
    end = np.array([chosen["t_end"]])
    core, q, v = model.core, start.q.copy(), start.v.copy()
    return lambda: core.simulate(chosen.core, end, q, v, None)


def timed(run: Callable[[], dict[str, Any]]) -> tuple[list[float], dict[str, Any]]:
    """Seconds of each of several runs after a first one that is not counted, and what the last one returned.

    A run that stops early is repeated once only: its time means little.
    """
    began = perf_counter()
    raw = run()
    seconds: list[float] = []
    while len(seconds) < (3 if raw["success"] else 1) or (perf_counter() - began < PATIENCE and len(seconds) < 1000):
        start = perf_counter()
        raw = run()
        seconds.append(perf_counter() - start)
    return seconds, raw


ROW = "  {:<25} {:>10} {:>10} {:>5} {:>6} {:>11} {:>10} {:>8} {}"


def cost_line(problem: Problem, cost: Cost) -> str:
    """One row of the first table."""
    verdict = "ok" if cost.right else "MISSED"
    if cost.error is None:
        verdict = f"STOPPED: {cost.message.split(';')[0]}"
    return ROW.format(
        f"{cost.title}, {problem.duration:g} s",
        f"{cost.best_ms:.3f} ms",
        f"{cost.median_ms:.3f} ms",
        cost.runs,
        cost.steps,
        cost.evaluations,
        f"{cost.ns_per_evaluation:.0f} ns",
        "none" if cost.error is None else f"{cost.error:.1e}",
        verdict,
    )


def errors_of(costs: list[Cost]) -> dict[str, str]:
    """What the errors are of, with the problems that have it."""
    found: dict[str, list[str]] = {}
    for c in costs:
        found.setdefault(f"{c.error_of}, at most {c.tolerance:.0e}", []).append(c.title)
    return {", ".join(titles): what for what, titles in found.items()}


def machine() -> str:
    """Processor and system, as far as they are known."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        name = models[0] if models else name
    return f"{name} ({os.cpu_count()} cores), {platform.system()}"


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"), sys.argv[2:]))
