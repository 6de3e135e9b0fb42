"""Stiff mechanisms of many loops: what an implicit step costs for each of them, however many there are.

Three shapes: four-bars side by side, coupled by stiff bushings; four-bars in series, each on the coupler of the one
before, with stiff torsion springs; a chain of links with the same. `python stiff_chains.py` prints a table in relative
and in absolute coordinates; names and sizes may be given, as in `python stiff_chains.py side 25 100`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

from timing import once

import partita as pt

SIZES = (25, 50, 100, 200)
DURATION, RTOL = 0.1, 1e-6
"""Of a run [s], and its tolerance."""
AIM = 1.5
"""Growth of the cost of a loop from one size to the next, twice as large; the smallest have their matrix formed."""


def side(size: int) -> pt.Mechanism:
    """Four-bars side by side on the ground, each coupled to the next by a stiff bushing."""
    m = pt.Mechanism(f"{size} four-bars coupled by bushings", gravity=(0.0, -9.81, 0.0))
    before = None
    for i in range(size):
        x = 0.6 * i
        crank = m.add_rod(f"crank {i}", start=(x, 0.0, 0.0), end=(x, 0.2, 0.0), mass=0.3)
        coupler = m.add_rod(f"coupler {i}", start=(x, 0.2, 0.0), end=(x + 0.4, 0.3, 0.0), mass=0.5)
        rocker = m.add_rod(f"rocker {i}", start=(x + 0.4, 0.3, 0.0), end=(x + 0.4, 0.0, 0.0), mass=0.4)
        m.add_revolute(f"A{i}", m.ground, crank, point=(x, 0.0, 0.0))
        m.add_revolute(f"B{i}", crank, coupler, point=(x, 0.2, 0.0))
        m.add_revolute(f"C{i}", coupler, rocker, point=(x + 0.4, 0.3, 0.0))
        m.add_revolute(f"D{i}", m.ground, rocker, point=(x + 0.4, 0.0, 0.0))
        if before is not None:
            rubber = (1e6, 1e6, 0.0, 0.0, 0.0, 0.0)
            damping = (1e3, 1e3, 0.0, 0.0, 0.0, 0.0)
            m.add_bushing(f"bushing {i}", before, crank, (x, 0.1, 0.0), stiffness=rubber, damping=damping)
        before = rocker
    return m


def series(size: int) -> pt.Mechanism:
    """Four-bars in series: each stands on the coupler of the one before."""
    m = pt.Mechanism(f"{size} four-bars in series", gravity=(0.0, -9.81, 0.0))
    base = m.ground
    for i in range(size):
        x = 0.4 * i
        lower = m.add_rod(f"lower {i}", start=(x, 0.0, 0.0), end=(x + 0.4, 0.0, 0.0), mass=0.3)
        upper = m.add_rod(f"upper {i}", start=(x, 0.1, 0.0), end=(x + 0.38, 0.11, 0.0), mass=0.3)
        end = m.add_rod(f"end {i}", start=(x + 0.4, 0.0, 0.0), end=(x + 0.38, 0.11, 0.0), mass=0.3)
        m.add_revolute(f"A{i}", base, lower, point=(x, 0.0, 0.0))
        m.add_revolute(f"B{i}", base, upper, point=(x, 0.1, 0.0))
        m.add_revolute(f"C{i}", lower, end, point=(x + 0.4, 0.0, 0.0))
        m.add_revolute(f"D{i}", upper, end, point=(x + 0.38, 0.11, 0.0))
        m.add_torsion_spring(f"A{i}", stiffness=1e4, damping=10.0)
        base = end
    return m


def links(size: int) -> pt.Mechanism:
    """A chain of links with stiff torsion springs in its joints."""
    m = pt.Mechanism(f"{size} links", gravity=(0.0, -9.81, 0.0))
    before = m.ground
    for i in range(size):
        link = m.add_rod(f"link {i}", start=(0.1 * i, 0.0, 0.0), end=(0.1 * i + 0.1, 0.0, 0.0), mass=0.1)
        m.add_revolute(f"J{i}", before, link, point=(0.1 * i, 0.0, 0.0))
        m.add_torsion_spring(f"J{i}", stiffness=1e4, damping=10.0)
        before = link
    return m


SHAPES: dict[str, Callable[[int], pt.Mechanism]] = {"side": side, "series": series, "links": links}


@dataclass(frozen=True)
class Cost:
    """Of a run: seconds, steps, matrices of Newton's method, their factors, and evaluations."""

    seconds: float
    start: float
    steps: int
    jacobians: int
    factored: int
    evaluations: int

    def per_step(self) -> float:
        """Seconds of a step."""
        return (self.seconds - self.start) / self.steps


def cost(m: pt.Mechanism, coordinates: str) -> Cost:
    """The fastest of three runs, less the start of a run without steps of its own."""

    def run(duration: float) -> tuple[float, pt.Result]:
        return once(
            lambda: m.simulate(
                duration,
                t_eval=[0.0, duration],
                method="radau",
                coordinates=coordinates,
                rtol=RTOL,
                atol=RTOL / 100.0,
            )
        )

    run(DURATION)  # what a model keeps is made here
    start = min(run(1e-9)[0] for _ in range(3))
    seconds, result = min((run(DURATION) for _ in range(3)), key=lambda x: x[0])
    if not result.success:
        raise RuntimeError(result.message)
    c = result.counters
    return Cost(seconds, start, c["steps"], c["jacobians"], c["factored_jacobians"], c["evaluations"])


def main(names: list[str], sizes: list[int]) -> None:
    """Print a row for each shape, kind of coordinates and size."""
    print(
        f"{'shape':8} {'coordinates':12} {'loops':>5} {'steps':>6} {'matrices':>8} {'ms/step':>8} {'µs/step/loop':>12}"
    )
    for name in names or list(SHAPES):
        for coordinates in ("relative", "absolute"):
            for size in sizes or SIZES:
                x = cost(SHAPES[name](size), coordinates)
                each = 1e6 * x.per_step() / size
                row = f"{name:8} {coordinates:12} {size:5d} {x.steps:6d} {x.jacobians:8d}"
                print(f"{row} {1e3 * x.per_step():8.3g} {each:12.3g}  (start {1e3 * x.start:.3g} ms)", flush=True)


if __name__ == "__main__":
    given = sys.argv[1:]
    main([x for x in given if not x.isdigit()], [int(x) for x in given if x.isdigit()])
