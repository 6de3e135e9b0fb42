"""`partita bench`: cost and accuracy of tolerances on a model."""

from __future__ import annotations

import argparse
import statistics
import time
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import SuspectResultWarning
from ..solver import grouped
from .models import length_of, open_model, start_of
from .printing import print_json

REFERENCE = 100.0
"""Factor by which the reference run is tighter than the tightest row; not below rtol 1e-13."""
TIGHTEST = 1e-13
"""No reference run has a smaller relative tolerance. Scale: fraction of what is integrated. Reason: below it steps
are rounding."""
ATOL = 1e-2
"""Absolute over relative tolerance, as in the defaults of `simulate`."""


@dataclass(frozen=True)
class Line:
    """One tolerance: its cost, and the deviation of its outputs from those of the tightest run."""

    rtol: float
    status: str
    steps: int
    evaluations: int
    seconds: float
    """Median of CPU time over the repetitions."""
    per_evaluation: float
    error: float
    """Largest difference of any coordinate [rad or m] at any output; NaN where there is nothing to compare."""
    closure: float


def bench(arguments: argparse.Namespace) -> int:
    """Run the model at several tolerances, and print errors and costs."""
    opened = open_model(arguments.model)
    duration = length_of(opened, arguments.model, arguments.time)
    start = start_of(opened, arguments.target, arguments.rate, arguments.coordinates)
    at = np.linspace(0.0, duration, arguments.outputs) + (start.t if start else 0.0)
    options = {"method": arguments.method, "formulation": arguments.formulation}
    options = grouped({name: value for name, value in options.items() if value is not None})
    options["coordinates"] = arguments.coordinates

    def run(rtol: float) -> Any:
        tolerances: dict[str, Any] = {"rtol": rtol, "atol": ATOL * rtol}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SuspectResultWarning)  # its state is shown in the column of states
            return opened.mechanism.simulate(duration, t_eval=at, initial=start, **tolerances, **options)

    exact = run(max(min(arguments.tolerances) / REFERENCE, TIGHTEST))
    lines = []
    for rtol in arguments.tolerances:
        spent = []
        for _ in range(arguments.repeat):
            begin = time.process_time()
            found = run(rtol)
            spent.append(time.process_time() - begin)
        same = exact.success and len(found.t) == len(exact.t)
        evaluations, seconds = int(found.counters["evaluations"]), statistics.median(spent)
        lines.append(
            Line(
                rtol,
                found.status if found.certificate.verdict != "suspect" else "suspect",
                int(found.counters["steps"]),
                evaluations,
                seconds,
                seconds / max(evaluations, 1),
                float(np.abs(found.q - exact.q).max(initial=0.0)) if same else float("nan"),
                found.certificate.closure,
            )
        )
    if arguments.json:
        print_json({"model": arguments.model, "duration": duration, "options": options, "rows": lines})
        return 0
    print(f"{arguments.model}: {duration:g} s, {arguments.outputs} outputs, median of {arguments.repeat}; CPU time")
    heads = f"{'steps':>7} {'evaluations':>12} {'ms':>9} {'us each':>8} {'error':>9} {'|Phi|':>9}"
    print(f"{'rtol':>8}  {'status':<10} {heads}")
    for line in lines:
        print(
            f"{line.rtol:>8.0e}  {line.status:<10} {line.steps:>7} {line.evaluations:>12} {1e3 * line.seconds:>9.3g} "
            f"{1e6 * line.per_evaluation:>8.3g} {line.error:>9.1e} {line.closure:>9.1e}"
        )
    print("error: the largest over coordinates and outputs, against a run with tolerances a hundred times smaller")
    return 0
