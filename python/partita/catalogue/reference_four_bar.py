"""The four-bar on which the criterion is explained: every number of one instant by closed formulas, and its swing."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FloatArray, FourBar
from .entry import Check, Entry, angle, largest_gap, path_error, row_at

LENGTHS = FourBar(crank=1.0, coupler=2.5, rocker=2.0, ground=2.2)
CRANK_ANGLE, CRANK_RATE = 0.8, 1.5
GRAVITY = 9.81

# t: crank angle [rad]. The closed formulas below, integrated by extrapolation in 34 digits with two steps.
CRANK = {
    0.5: (0.58102280644924650945,),
    1.0: (-0.70950607772678637951,),
    2.0: (-4.02705243591339541848,),
    3.0: (-0.31184127561814458580,),
}

# At the start. With angles phi of the links against x: Phi = sum of l u(phi) - (ground, 0),
# M_ij = a_ij cos(phi_i - phi_j), h_i = -sum of a_ij sin(phi_i - phi_j) phi_j'^2 - g Gamma_i cos phi_i, then (12)-(14),
# C_D^T lambda = (M q'' - h)_D, and Newton's equations of the links for the pins. In the joint angles A, B, C.
VELOCITIES = (1.5, -1.855403823966, 0.712815169891)
ACCELERATIONS = (-10.466415143407, 14.180313468504, -4.507165728272)
REACTIONS = {  # on the link outboard of the pin, x and y [N]
    "A": (5.975764412228, 8.554094290154),
    "B": (3.00548613374, 3.197130719028),
    "C": (-6.157297666382, -9.18658040682),
    "D": (7.546968149505, 27.999622165247),
}
ENERGY = 55.63596373801568  # kinetic and potential, with zero at the height of the ground pins [J]
MEASURE = {
    "relative": (0.881509349986, 0.750861289725, 0.457251342070),
    # x, y, rotation angle of crank, coupler and rocker
    "absolute": (0.262122438, 0.254577139, 0.210964209, 0.671499115, 0.501167177, 0.197583026,
                 0.229909960, 0.088231108, 0.142177493),
}  # fmt: skip


def build() -> Mechanism:
    """The drawing: crank at 0.8 rad, open branch, rods of 1 kg/m, the tree A-B-C cut at the ground pin D."""
    m = Mechanism("reference-four-bar", gravity=(0, -GRAVITY, 0))
    a, b, c, d = LENGTHS.points(CRANK_ANGLE)
    crank = m.add_rod("crank", start=a, end=b, mass=LENGTHS.crank)
    coupler = m.add_rod("coupler", start=b, end=c, mass=LENGTHS.coupler)
    rocker = m.add_rod("rocker", start=c, end=d, mass=LENGTHS.rocker)
    m.add_revolute("A", m.ground, crank, point=a, axis=(0, 0, 1), cut="never")
    m.add_revolute("B", crank, coupler, point=b, axis=(0, 0, 1), cut="never")
    m.add_revolute("C", coupler, rocker, point=c, axis=(0, 0, 1), cut="never")
    m.add_revolute("D", m.ground, rocker, point=d, axis=(0, 0, 1), cut="always")
    return m


def start(m: Mechanism) -> State:
    """As drawn, the crank turning with 1.5 rad/s."""
    return m.assemble(rates={"A": CRANK_RATE})


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A", CRANK_ANGLE)[:, None], result, CRANK)


def rocker(result: Result) -> float:
    """Largest difference between the rocker angle and the one ruler and compass give for the crank angle.

    A turn of the crank may be counted by joint B or by joint C, so whole turns are disregarded.
    """
    _, drawn = LENGTHS.angles(CRANK_ANGLE)
    _, expected = LENGTHS.angles(angle(result, "A", CRANK_ANGLE))
    found = angle(result, "D", float(drawn))
    turns = np.round((found - expected) / (2.0 * np.pi))
    return largest_gap(found, expected + 2.0 * np.pi * turns)


def motion(result: Result) -> float:
    """Largest error of the rates of A, B, C at the start, read from the joints: valid in any coordinates."""
    row = row_at(result, 0.0)
    return largest_gap(np.array([result.joint(name).velocity[row, 0] for name in "ABC"]), np.array(VELOCITIES))


def pins(result: Result) -> float:
    """Largest error of the forces in the pins at the start."""
    row = row_at(result, 0.0)
    found = np.array([result.joint(name).force[row, :2] for name in REACTIONS])
    return largest_gap(found, np.array(list(REACTIONS.values())))


def measure(result: Result) -> float:
    """Largest error of rho at the start."""
    known: FloatArray = np.array(MEASURE["relative" if len(result.names.velocities) == 3 else "absolute"])
    return largest_gap(result.measure[row_at(result, 0.0)], known)


def energy(result: Result) -> float:
    """Error of the energy at the start."""
    return abs(float(result.energy.total[row_at(result, 0.0)]) - ENERGY)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="reference-four-bar",
        title="the four-bar on which the criterion is explained, with every number of its first instant",
        source="closed formulas in the angles of the links, to 12 digits; the same integrated by extrapolation in "
        "34 digits",
        duration=3.0,
        build=build,
        start=start,
        times=(0.0, *CRANK),
        options={"rtol": 1e-10, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-9, "rtol 1e-10 over a swing of five radians, some margin", crank),
            Check("rocker angle over crank angle [rad]", 1e-11, "closure 1e-12, at most tenfold in angle", rocker),
            Check("rates of A, B, C at the start [rad/s]", 1e-11, "12 printed digits", motion),
            Check("forces of the pins at the start [N]", 1e-9, "12 printed digits, round-off of 30 N", pins),
            Check("rho at the start", 1e-9, "printed with 9 digits in absolute coordinates", measure),
            Check("energy at the start [J]", 1e-11, "16 printed digits", energy),
        ),
        notes="Crank 1, coupler 2.5, rocker 2, ground 2.2 m, crank at 0.8 rad and 1.5 rad/s. The lengths, masses and "
        "the start are this project's own; the paper's example is a four-bar whose numbers were not available.",
    )
