"""Andrews' squeezing mechanism: seven bodies, three loops, one degree of freedom, milliseconds."""

from __future__ import annotations

import numpy as np

from ..builder import Body
from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, FloatArray, angle, largest_gap, row_at

AT_O, AT_A = np.array([0.0, 0.0, 0.0]), np.array([-0.06934, -0.00227, 0.0])
AT_B, AT_C = np.array([-0.03635, 0.03273, 0.0]), np.array([0.014, 0.072, 0.0])

START = {
    "beta": -0.0617138900142764496358948458001,
    "Theta": 0.0,
    "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609,
    "delta": 0.487364979543842550225598953530,
    "Omega": -0.222668390165885884674473185609,
    "epsilon": 1.23054744454982119249735015568,
}
JOINT_OF = {"beta": "O", "Theta": "F", "gamma": "B", "phi": "G", "delta": "A1", "Omega": "H", "epsilon": "A2"}

END = 0.03  # s
ANGLES = {
    "beta": 15.810771195153707097,
    "Theta": -15.756371058411839470,
    "gamma": 0.040822240119645804858,
    "phi": -0.53473011634207959377,
    "delta": 0.52440996587995406937,
    "Omega": 0.53473011634207959377,
    "epsilon": 1.0480807410419378731,
}
RATES = {"beta": 1139.9203022591060642, "Theta": -1424.3792951775400732, "epsilon": 0.32317914924913087499}
ACCELERATIONS = {"beta": -24631.763122874634470, "Theta": 51850.319636464231534}
# At the pin E: forces of EF on EBD, on GE, and on HE.
LAMBDA = (
    199.17534810453862819,
    -29.755309974971763324,
    23.066543611622151129,
    31.452725275771137075,
    22.642494786394378578,
    11.617392352611255907,
)
BETA_LATER = (0.05, 33.82586776695451733)


def turned(angle: float) -> FloatArray:
    """Rotation (3, 3) about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def ahead(angle: float, length: float) -> FloatArray:
    """Vector (3,) of that length along x turned by `angle`."""
    return length * turned(angle)[:, 0]


def build() -> Mechanism:
    """The drawing at the published start; every link lies along the x axis of its body."""
    s = START
    m = Mechanism("andrews-squeezer", gravity=(0, 0, 0))
    heading = {  # angle of each link's x axis
        "OF": s["beta"],
        "EF": s["beta"] + s["Theta"],
        "EBD": s["gamma"],
        "AG": s["delta"],
        "GE": s["phi"] + s["delta"] - np.pi / 2,
        "AH": s["epsilon"] - np.pi / 2,
        "HE": s["Omega"] + s["epsilon"],
    }
    at_f = AT_O + ahead(heading["OF"], 0.007)
    at_e = at_f - ahead(heading["EF"], 0.028)
    at_g = AT_A + ahead(heading["AG"], 0.04)
    at_h = AT_A + ahead(heading["AH"], 0.04)

    def link(name: str, origin: FloatArray, mass: float, x: float, y: float, inertia: float) -> Body:
        plate = (inertia / 2, inertia / 2, inertia)  # a thin plate; only the last one matters in the plane
        return m.add_body(
            name, mass=mass, inertia=plate, com=(x, y, 0), position=origin, orientation=turned(heading[name])
        )

    of = link("OF", AT_O, 0.04325, 0.00092, 0.0, 2.194e-6)
    ef = link("EF", at_e, 0.00365, 0.0165, 0.0, 4.410e-7)
    ebd = link("EBD", at_e, 0.02373, 0.01043, 0.01626, 5.255e-6)
    ag = link("AG", AT_A, 0.07050, 0.02308, 0.00916, 1.169e-5)
    ge = link("GE", at_g, 0.00706, 0.00579, 0.0, 5.667e-7)
    ah = link("AH", AT_A, 0.05498, 0.01228, -0.00449, 1.912e-5)
    he = link("HE", at_h, 0.00706, 0.00579, 0.0, 5.667e-7)
    pins = (
        ("O", m.ground, of, AT_O),
        ("F", of, ef, at_f),
        ("B", m.ground, ebd, AT_B),
        ("A1", m.ground, ag, AT_A),
        ("G", ag, ge, at_g),
        ("A2", m.ground, ah, AT_A),
        ("H", ah, he, at_h),
        ("E1", ef, ebd, at_e),
        ("E2", ef, ge, at_e),
        ("E3", ef, he, at_e),
    )
    for name, parent, child, point in pins:
        cut = "never" if name in ("O", "F") else "auto"  # beta and Theta: the only choices at the start
        m.add_revolute(name, parent, child, point=point, axis=(0, 0, 1), cut=cut)
    m.add_spring("spring", m.ground, AT_C, ebd, (0.02, 0.017, 0), stiffness=4530.0, length=0.07785)
    m.add_torque("O", value=0.033)
    return m


def start(m: Mechanism) -> State:
    """At rest as drawn."""
    return m.assemble()


def beta(result: Result) -> FloatArray:
    """Angle of the driven link OF (nt,) [rad]."""
    return angle(result, "O", START["beta"])


def beta_error(result: Result) -> float:
    return abs(float(beta(result)[row_at(result, END)]) - ANGLES["beta"])


def beta_later_error(result: Result) -> float:
    t, value = BETA_LATER
    return abs(float(beta(result)[row_at(result, t)]) - value)


def angles_error(result: Result) -> float:
    """Largest error of all seven angles."""
    row = row_at(result, END)
    found = np.array([angle(result, JOINT_OF[name], START[name])[row] for name in ANGLES])
    return largest_gap(found, np.array(list(ANGLES.values())))


def rates_error(result: Result) -> float:
    """Largest error of the three published rates, each relative to its size."""
    row = row_at(result, END)
    return max(abs(float(result.joint(JOINT_OF[name]).velocity[row, 0]) / rate - 1.0) for name, rate in RATES.items())


def pin_forces(result: Result) -> FloatArray:
    """Forces in the pin E in the order of the published multipliers (nt, 6) [N]."""
    return np.hstack([result.joint(name).force[:, :2] for name in ("E1", "E2", "E3")])


def lambda_error(result: Result) -> float:
    """Largest error of the six multipliers relative to the largest of them."""
    found = pin_forces(result)[row_at(result, END)]
    return largest_gap(found, np.array(LAMBDA)) / max(map(abs, LAMBDA))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="andrews-squeezer",
        title="Andrews' squeezing mechanism: seven bodies, three loops, a motor torque and a spring",
        source="Test Set for Initial Value Problem Solvers, Andrews' squeezing mechanism (also IFToMM A03); the "
        "values at 0.03 s recomputed in quadruple precision, since the published ones hold to 1e-10 in position "
        "and 1e-6 in acceleration and multipliers",
        duration=0.05,
        build=build,
        start=start,
        times=(END, BETA_LATER[0]),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("beta at 0.03 s [rad]", 3e-9, "relative 2e-10 of 15.8 rad at rtol 1e-11", beta_error),
            Check("seven angles at 0.03 s [rad]", 3e-9, "as beta", angles_error),
            Check("three rates at 0.03 s, relative", 1e-8, "rates of 1e3 rad/s amplify the error in time", rates_error),
            Check(
                "multipliers at 0.03 s, relative",
                1e-6,
                "accelerations of 5e4 rad/s^2 amplify the error in time; the published values are as good",
                lambda_error,
            ),
            Check("beta at 0.05 s [rad]", 3e-8, "ten times that of 0.03 s: more turns, more speed", beta_later_error),
        ),
        notes="At the start the tangent is exactly (0.8, -0.6, 0, 0, 0, 0, 0) in (beta, Theta, gamma, phi, delta, "
        "Omega, epsilon): only beta or Theta can be independent, and any other choice fails.",
    )
