"""Drift of the closure constraints: k + n equations against all accelerations, both without correction.

Where v_I and all q are integrated, Phi is a first integral: only errors of the steps add up, |Phi| grows like t, and
the rates fit the closed loops at any time, because they are computed. Where all accelerations are integrated, only the
second derivative of Phi is held at zero: rates drift like t, positions like t^2.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from reference import FOUR_BAR, START, state

import partita as pt
from partita.errors import SuspectResultWarning
from partita.plots.style import COLOURS, FLOOR, dressed, new_figure
from partita.results import Result

STEPS = (0.02, 0.01, 0.005)
RATE = 6.0
"""Of the crank at the start [rad/s]: enough to turn over."""
METHODS = {"k + n": "projective", "accelerations": "multipliers"}


def march(formulation: str, duration: float, step: float) -> Result:
    """From the crank at 0.8 rad and 6 rad/s, so that it turns over, with RK4 and no correction."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)  # the drift is what is looked at
        return FOUR_BAR.simulate(
            duration, initial=state(START, RATE), method="rk4", step=step, solver=pt.Solver(formulation),
            correction="none", t_eval=np.linspace(0.0, duration, 161),
        )  # fmt: skip


def growth(t: np.ndarray, values: np.ndarray) -> float:
    """Exponent of the largest value so far over time, fitted over the last three quarters of the run."""
    late = t >= t[-1] / 4.0
    envelope = np.maximum.accumulate(values)
    return float(np.polyfit(np.log(t[late]), np.log(np.maximum(envelope[late], FLOOR)), 1)[0])


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Integrate both ways with several steps, fit the exponents, draw."""
    duration = 16.0 if short else 32.0
    runs = {(name, h): march(f, duration, h) for name, f in METHODS.items() for h in (STEPS[1:] if short else STEPS)}
    found: Numbers = {}
    for name in METHODS:
        run_ = runs[name, 0.01]
        found[f"{name}: largest |Phi| up to 4 s"] = float(np.max(run_.closure[run_.t <= 4.0]))
        found[f"{name}: largest |Phi|"] = float(np.max(run_.closure))
        found[f"{name}: largest |C v|"] = float(np.max(run_.velocity_closure))
        found[f"{name}: |Phi| grows like t to the"] = growth(run_.t, run_.closure)
    found["accelerations: |C v| grows like t to the"] = growth(run_.t, run_.velocity_closure)
    coarse, fine = runs["k + n", 0.01], runs["k + n", 0.005]
    found["k + n: |Phi| falls with the step to the"] = float(np.log2(np.max(coarse.closure) / np.max(fine.closure)))

    figure = new_figure(10.0, 4.4)
    axes = figure.subplots(1, 2, sharex=True)
    panels = (("|Φ|, largest so far", "[m]", "|Phi|"), ("|C v|, largest so far", "[m/s]", "|C v|"))
    for ax, (title, unit, what) in zip(axes, panels, strict=True):
        dressed(ax, title, unit)
        ax.set_xscale("log")
        ax.set_yscale("log")
        for n, name in enumerate(METHODS):
            power = found.get(f"{name}: {what} grows like t to the")
            for h, style in ((0.02, ":"), (0.01, "-"), (0.005, "--")):
                if (name, h) in runs:
                    run_ = runs[name, h]
                    values = run_.closure if what == "|Phi|" else run_.velocity_closure
                    envelope = np.maximum(np.maximum.accumulate(values[1:]), FLOOR)
                    grown = f": like t to the {power:.2f}" if h == 0.01 and power is not None else ""
                    label = f"{name}, h = {1e3 * h:g} ms{grown}"
                    ax.plot(run_.t[1:], envelope, style, color=COLOURS[n], lw=1.3, label=label)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=7, frameon=False)
    finish("Four-bar: drift without correction, RK4", figure, folder / "drift.png", found)
    return found


if __name__ == "__main__":
    run(main)
