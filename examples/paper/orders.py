"""Orders of convergence: error over step, for several formulations under Runge-Kutta methods of order 4, 5 and 8.

Whatever is integrated, and however the loops are closed after a step, the error falls with the power of the step that
the method promises: removing what a step leaves open costs no order. The motion is driven and damped, so that errors of
the energy die out. In a free swing they stay, the phase that goes with them grows like t squared, and methods of even
order, which lose energy with the next power of the step only, look one order better than they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.ticker import NullLocator
from reference import NAME

import partita as pt
from partita.plots.style import COLOURS, dressed, new_figure
from partita.state import State

Array = np.ndarray
FORMULATIONS = ("projective", "wehage-haug", "explicit-closing", "gram-schmidt", "tangent-space", "multipliers")
MARKERS = ("o", "s", "^", "D", "v", "P")
DURATION, OUTPUTS = 1.0, 5
"""Length of the motion [s], and outputs where every step below ends, so that no interpolation adds to the error."""
# method: order, steps per second; from where its leading error term dominates to about a hundred times round-off
METHODS = {
    "rk4": (4, (100, 200, 400, 800)),
    "dopri5": (5, (160, 240, 320, 480)),
    "dop853": (8, (24, 32, 40, 48)),
}
REFERENCE = 400
"""Steps per second of the reference, by "dop853"; round-off is all that is left of its error."""


def motion() -> tuple[pt.Mechanism, State]:
    """The reference four-bar, its crank driven and damped, started 3.3 rad on from the drawing."""
    m = pt.catalogue.load(NAME)
    m.add_torque("A", value=40.0)
    m.add_torsion_spring("A", stiffness=0.0, damping=17.0)
    return m, m.assemble(targets={"A": 3.3}, rates={"A": -0.4})


def positions(m: pt.Mechanism, start: State, **options: Any) -> Array:
    """Centres of all links at all outputs (nt, 3, 3)."""
    done = m.simulate(DURATION, t_eval=np.linspace(0.0, DURATION, OUTPUTS), initial=start, **options)
    if not done.success:
        raise RuntimeError(f"{options}: {done.message}")
    return done.at_once.observed["body_position"]


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Integrate with several steps, fit the orders, draw."""
    found: Numbers = {}
    m, start = motion()
    exact = positions(m, start, method="dop853", step=1.0 / REFERENCE)
    figure = new_figure(11.0, 4.0)
    axes = figure.subplots(1, len(METHODS))
    for ax, (method, (order, rates)) in zip(axes, METHODS.items(), strict=True):
        steps = 1e3 / np.array(rates)
        dressed(ax, f"{method}, order {order}", "error of the links [m]" if ax is axes[0] else "", time_axis=False)
        all_errors: list[float] = []
        for n, name in enumerate(FORMULATIONS):
            errors = []
            for rate in rates:
                gap = positions(m, start, method=method, solver=pt.Solver(name), step=1.0 / rate) - exact
                errors.append(float(np.sqrt(np.mean(np.sum(gap**2, axis=-1)))))
            slope = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
            found[f"{method} of order {order}, {name}: order"] = slope
            all_errors += errors
            style = {"color": COLOURS[n], "marker": MARKERS[n], "ms": 4, "lw": 1.1}
            ax.loglog(steps, errors, "-", label=f"{name}: {slope:.2f}", **style)
        slopes = [found[f"{method} of order {order}, {name}: order"] for name in FORMULATIONS]
        found |= {
            f"{method}: shortest step [ms]": float(steps.min()), f"{method}: longest step [ms]": float(steps.max()),
            f"{method}: least error": min(all_errors), f"{method}: largest error": max(all_errors),
            f"{method}: least order": min(slopes), f"{method}: largest order": max(slopes),
        }  # fmt: skip
        ax.loglog(steps, errors[0] * (steps / steps[0]) ** order, ":", color="#888888", lw=1.0, label=f"order {order}")
        ax.set_xticks(steps, [f"{step:.3g}" for step in steps])
        ax.xaxis.set_minor_locator(NullLocator())
        ax.margins(x=0.05)
        ax.set_xlabel("step [ms]", fontsize=9)
        ax.legend(
            fontsize=7, frameon=False, loc="upper left", title="measured order", title_fontsize=7, alignment="left"
        )
    finish("Four-bar: orders of convergence", figure, folder / "orders.png", found)
    return found


if __name__ == "__main__":
    run(main)
