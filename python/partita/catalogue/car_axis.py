"""Car axis: two masses on springs over a wheel axle with prescribed rocking."""

from __future__ import annotations

import numpy as np

from ..builder import Along, Cosine
from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, largest_gap, row_at

EPS, M, L, L0, R, OMEGA = 1e-2, 10.0, 1.0, 0.5, 0.1, 10.0
MASS = EPS**2 * M / 2

END = 3.0
LAST = 1000.0  # of the turning wheel [s]
POSITIONS = (0.04934557842752409213, 0.49698946023000810676, 1.0417425248854261152, 0.37391102726536581936)
VELOCITIES = (-0.077058368403592084284, 0.0074468665920684164914, 0.017556815753541736630, 0.77034104377960106312)


def build() -> Mechanism:
    """The drawing: axle along x, the left mass above its pivot, the right one above its far end.

    `left` slides perpendicular to the axle, `right` is at the end of a massless rod hinged at `left`: the two
    constraints of the published equations. The far wheel point is at height r sin(omega t): r times the height of a
    point on a wheel that turns at omega. The masses of axle and wheel do not matter, since their motion is prescribed.
    """
    m = Mechanism("car-axis", gravity=(0, -1, 0))
    axle = m.add_rod("axle", start=(0, 0, 0), end=(L, 0, 0), mass=MASS)
    left = m.add_body("left", mass=MASS, inertia=(0, 0, 0), position=(0, L0, 0))
    right = m.add_body("right", mass=MASS, inertia=(0, 0, 0), position=(L, L0, 0))
    m.add_revolute("axle", m.ground, axle, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_prismatic("slide", axle, left, point=(0, L0, 0), axis=(0, 1, 0))
    m.add_revolute("rod", left, right, point=(0, L0, 0), axis=(0, 0, 1))
    wheel = m.add_body("wheel", mass=MASS, inertia=(MASS, MASS, MASS), position=(L, 0, 0))
    m.add_revolute("wheel", m.ground, wheel, point=(L, 0, 0), axis=(0, 0, 1))
    m.add_drive("wheel", ((0.0, LAST), (0.0, OMEGA * LAST)))
    height = Along(m.ground, (0, 0, 0), (0, 1, 0), axle, (L, 0, 0))
    m.add_coupler("rocking", [height, Cosine(m.ground, (0, 1, 0), wheel, (1, 0, 0))], factors=(1.0, -R), offset=0.0)
    m.add_spring("left spring", m.ground, (0, 0, 0), left, (0, 0, 0), stiffness=1.0, length=L0)
    m.add_spring("right spring", axle, (L, 0, 0), right, (0, 0, 0), stiffness=1.0, length=L0)
    return m


def start(m: Mechanism) -> State:
    """Both masses move with (-0.5, 0): the slide is at rest, and the rod's rotation cancels that of the axle."""
    return m.assemble(rates={"slide": 0.0, "rod": -R * OMEGA / L})


def positions(result: Result) -> float:
    """Largest error of xl, yl, xr, yr."""
    row = row_at(result, END)
    found = np.concatenate([result.body(name).position[row, :2] for name in ("left", "right")])
    return largest_gap(found, np.array(POSITIONS))


def velocities(result: Result) -> float:
    """Largest error of their velocities."""
    row = row_at(result, END)
    found = np.concatenate([result.body(name).velocity[row, :2] for name in ("left", "right")])
    return largest_gap(found, np.array(VELOCITIES))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="car-axis",
        title="car axis: a rheonomic mechanism, its axle rocking at 10 rad/s",
        source="Test Set for Initial Value Problem Solvers, Car axis problem; recomputed in quadruple precision",
        duration=END,
        build=build,
        start=start,
        times=(END,),
        options={"rtol": 1e-12, "atol": 1e-13},
        checks=(
            Check("positions of the masses at 3 s [m]", 1e-9, "rtol 1e-12 over 20 periods of the springs", positions),
            Check(
                "velocities of the masses at 3 s [m/s]",
                1e-8,
                "as positions; the springs oscillate at 45 rad/s",
                velocities,
            ),
        ),
        notes="The constraints hold because of the joints: xl xb + yl yb = 0 is the slide at right angles to the axle, "
        "(xl - xr)^2 + (yl - yr)^2 = L^2 is the massless rod.",
    )
