"""`partita inverse`: the efforts that a motion needs."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..mechanism.goals import goals_of, units_of
from ..options import si
from .models import Opened, open_as_asked, settings
from .printing import print_json

if TYPE_CHECKING:
    from ..analyses.inverse import InverseDynamics

OUTPUTS = 201


def inverse(arguments: argparse.Namespace) -> int:
    """Print the largest efforts and powers of the actuators over a motion, and write a figure."""
    opened = open_as_asked(arguments.model, arguments)
    times = np.linspace(0.0, arguments.time, OUTPUTS)
    courses = _steady(opened, settings(arguments.rate), arguments.time)
    found = opened.mechanism.inverse_dynamics((times, courses) if courses else times, arguments.actuator or None)
    if arguments.json:
        print_json(_plain(found))
    else:
        print(*_lines(found), sep="\n")
    if arguments.output:
        found.plot(path=arguments.output)
        print(f"wrote {arguments.output}")
    return 0


def _steady(opened: Opened, rates: dict[str, Any], time: float) -> dict[str, Any]:
    """Courses of joints that move at a constant rate from where they are drawn."""
    courses: dict[str, Any] = {}
    model = opened.mechanism.compile() if rates else None
    for name, value in rates.items():
        goals = goals_of("rate", name, model) if model else []
        if model is None or len(goals) != 1 or isinstance(value, list):
            raise ArgumentError(f"--rate {name}: give one rate of one coordinate", argument="rate")
        rate = float(si("rate", value, f"{units_of(goals, model)[0]}/s"))
        courses[name] = ([0.0, time], [0.0, rate * time])
    return courses


def _plain(found: InverseDynamics) -> dict[str, Any]:
    peaks = found.peak()
    return {
        "actuators": {
            name: {"unit": unit, **peaks[name]} for name, unit in zip(found.actuators, found.units, strict=True)
        },
        "margin": float(np.nanmin(found.margin)) if np.isfinite(found.margin).any() else None,
        "notes": list(found.notes),
    }


def _lines(found: InverseDynamics) -> list[str]:
    width = max(len("actuator"), *map(len, found.actuators))
    lines = [f"{'actuator':<{width}}  {'largest':>12}  {'rms':>12}  {'rate':>12}  {'power [W]':>12}"]
    for (name, peak), unit in zip(found.peak().items(), found.units, strict=True):
        numbers = "  ".join(f"{peak[word]:>12.6g}" for word in ("effort", "rms", "rate", "power"))
        lines.append(f"{name:<{width}}  {numbers}  {unit}")
    known = np.isfinite(found.margin).any()
    lines.append(f"least margin {np.nanmin(found.margin):.4g}" if known else "no margin")
    return [*lines, *(f"note: {note}" for note in found.notes)]
