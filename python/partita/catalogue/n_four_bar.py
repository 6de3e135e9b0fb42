"""A chain of N four-bars: one degree of freedom, and N + 1 of them whenever all links are in line."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from ..errors import ArgumentError
from ..mechanism import Mechanism
from ..numeric import shown
from ..results import Result
from ..state import State
from .entry import Check, Entry, FloatArray, angle, largest_gap, path_error, row_at

GRAVITY = 9.81

# loops: {t: x, y of B0, the top of the first upright}; closed form below, recomputed in quadruple precision
B0 = {
    40: {
        1.0: (-0.1153568806321099, -0.9933241113004502),
        2.0: (0.03446630730040716, 0.999405860329563),
        5.0: (-0.5401900506755263, -0.8415430524644431),
        10.0: (0.1805122266867284, 0.9835727405823116),
        20.0: (0.4109011537629452, 0.9116799009719807),
    },
    2: {
        1.0: (-0.1950203019494351, -0.9807992056621738),
        2.0: (0.05781579576801143, 0.9983272678634555),
        5.0: (-0.8113104610051074, -0.5846155453489755),
        10.0: (0.3284581115408154, 0.944518538178601),
        20.0: (0.8397465743068435, 0.5429785363528847),
    },
}
MOST = 1_000_000
TIMES = (1.0, 2.0, 5.0, 10.0)
FIRST_SINGULAR_CROSSING = {2: 0.714355529292960472, 40: 0.721581024825656828}  # [s]: all links in line


def build(loops: int) -> Mechanism:
    """The drawing: uprights from (i, 0) to (i, 1), couplers between neighbouring tops."""
    m = Mechanism("double-four-bar" if loops == 2 else f"n-four-bar-{loops}", gravity=(0, -GRAVITY, 0))
    uprights = [m.add_rod(f"upright {i}", start=(i, 0, 0), end=(i, 1, 0), mass=1.0) for i in range(loops + 1)]
    couplers = [m.add_rod(f"coupler {i}", start=(i - 1, 1, 0), end=(i, 1, 0), mass=1.0) for i in range(1, loops + 1)]
    for i, upright in enumerate(uprights):
        cut = "never" if i == 0 else "auto"  # the start sets the rate of P0
        m.add_revolute(f"P{i}", m.ground, upright, point=(i, 0, 0), axis=(0, 0, 1), cut=cut)
    for i, coupler in enumerate(couplers, start=1):
        m.add_revolute(f"L{i}", uprights[i - 1], coupler, point=(i - 1, 1, 0), axis=(0, 0, 1))
        m.add_revolute(f"R{i}", uprights[i], coupler, point=(i, 1, 0), axis=(0, 0, 1))
    return m


def start(m: Mechanism) -> State:
    """The first top moves with 1 m/s in +x: the upright turns with -1 rad/s about z."""
    return m.assemble(rates={"P0": -1.0})


def lean(loops: int, t: FloatArray) -> FloatArray:
    """Angle phi from the upright [rad] at times `t`: the one equation of motion, integrated on its own.

    ((N+1)/3 + N) phi'' = ((N+1)/2 + N) g sin phi, since couplers only translate.
    """
    pull = GRAVITY * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)
    run = solve_ivp(
        lambda _, y: [y[1], pull * np.sin(y[0])],
        (0.0, float(t[-1])),
        [0.0, 1.0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
        t_eval=t,
    )
    return np.asarray(run.y[0])


def top(result: Result, loops: int) -> float:
    """Largest error of x, y of B0 over the tabled times."""
    path = result.body("upright 0").point((1, 0, 0))[:, :2]
    if loops in B0:
        return path_error(path, result, {t: B0[loops][t] for t in TIMES})
    rows = [row_at(result, t) for t in TIMES]
    phi = lean(loops, result.t[rows])
    return largest_gap(path[rows], np.column_stack([np.sin(phi), np.cos(phi)]))


def parallel(result: Result, loops: int) -> float:
    """Largest difference between the angles of the first and any other upright: zero in every output."""
    first = angle(result, "P0")
    return max(largest_gap(angle(result, f"P{i}"), first) for i in range(1, loops + 1))


def entry(loops: int = 40) -> Entry:
    """The catalogue entry for a chain of `loops` four-bars; `ArgumentError` unless that is a whole number from 1."""
    if not isinstance(loops, int) or isinstance(loops, bool) or not 1 <= loops <= MOST:
        raise ArgumentError(f"loops must be a whole number from 1 to {MOST}, not {shown(loops)}", argument="loops")
    return Entry(
        name="double-four-bar" if loops == 2 else "n-four-bar",
        title=f"chain of {loops} four-bars with an instantaneous singularity twice in each turn",
        source="Library of Computational Benchmark Problems (IFToMM), problem A02; N = 2 is the double four-bar of "
        "Bayo and Avello (1994); closed form, recomputed in quadruple precision",
        duration=10.0,
        build=lambda: build(loops),
        start=start,
        times=TIMES,
        options={"rtol": 1e-10, "atol": 1e-12},
        checks=(
            Check(
                "path of the first top B0 [m]",
                1e-5,
                "rtol 1e-10, and errors grow about 1e4 in 10 s of turns through the top",
                lambda result: top(result, loops),
            ),
            Check(
                "uprights stay parallel [rad]",
                1e-7,
                "in line, closure 1e-14 leaves the angles free to about its square root",
                lambda result: parallel(result, loops),
            ),
        ),
        notes="Planar absolute coordinates would count 6N+3 unknowns and 6N+2 rows of rank 5N+2 in line. With "
        "spatial revolutes 3N rows are redundant everywhere. The published data file is N = 40 although one page that "
        "shows it says N = 2.",
    )


def double() -> Entry:
    """The catalogue entry for two loops."""
    return entry(loops=2)
