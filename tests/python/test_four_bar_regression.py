"""The reference four-bar at its first instant: every number of its closed formulas, by the product, in two coordinates.

              C
            /   \\
          B       \\            tree:  ground -A- crank -B- coupler -C- rocker
         /         \\           cut:   D
    ---A-------------D---

Crank 1, coupler 2.5, rocker 2, ground 2.2 m, 1 kg/m, g = 9.81; crank angle 0.8 rad, rate 1.5 rad/s. The numbers were
printed with 12 digits and agree with formulas in the angles phi of the links that were worked out by hand; 1e-10 leaves
two digits to their rounding.
"""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt
from partita.builder.compiled import CompiledModel
from partita.catalogue.reference_four_bar import ACCELERATIONS, CRANK_ANGLE, ENERGY, MEASURE, REACTIONS, VELOCITIES
from partita.instant import Instant
from partita.results import Result
from partita.state import State

COORDINATES = ("relative", "absolute")
RATE = 1.5

PHI = (0.8, 0.477935466983, -1.937228058039)  # of the links against x
Q = (0.8, -0.322064533017, -2.415163525022)  # each against the link before
MASS = ((29.469902911825, 18.768030028682, -2.909793239665), (18.768030028682, 12.899490478872, -1.071088093897),
        (-2.909793239665, -1.071088093897, 2.666666666667))  # fmt: skip
JACOBIAN = ((0.0, 0.7173560908995, 1.867223496946), (2.2, 1.503293290653, -0.7165726846961))
FORCES = (-90.79193751543, -56.193111292655, 9.219518661212)
A = (-1.236935882644, 0.475210113261)
B = (-1.756448485037, -1.520768627338)
XI = (1.234029014978, 0.46658059746)
REDUCED_MASS, REDUCED_FORCE = 1.872411032139, -19.597431181463
LAMBDA = (7.546968149505, 27.999622165247)
CLOSING_EFFORTS = (47.505507711703, -5.971888165969)  # (M q'' - h) of the dependent coordinates
FREE = (0.687297813732, 1.449351602773, 0.576846391448)  # |k_i|^2
CONSTRAINED = (0.153227044635, 0.632217783591, 0.456240046009)  # |k_i,c|^2
SCALED_DELASSUS = 0.5258397533596  # smallest eigenvalue of M_c scaled to ones on its diagonal


def agree(found: object, printed: object, tolerance: float = 1e-10) -> None:
    np.testing.assert_allclose(np.asarray(found), np.asarray(printed), rtol=tolerance, atol=tolerance)


@cache
def model(coordinates: str = "relative") -> tuple[CompiledModel, State]:
    """The four-bar of the catalogue, compiled, and its start."""
    m = pt.catalogue.load("reference-four-bar")
    state = pt.catalogue.entry("reference-four-bar").initial(m)
    return m.compile(coordinates), m.convert(state, coordinates)


@cache
def instant(coordinates: str = "relative") -> Instant:
    compiled, state = model(coordinates)
    return compiled.at(state.q, state.v, state.t)


@cache
def run(coordinates: str = "relative") -> Result:
    return pt.catalogue.entry("reference-four-bar").simulate(coordinates=coordinates)


def directions(coordinates: str) -> NDArray[np.float64]:
    """Angles (3,) of the links at the start: a rod's own x points along it."""
    turns = [run(coordinates).body(name).rotation[0] for name in ("crank", "coupler", "rocker")]
    return np.array([np.arctan2(turn[1, 0], turn[0, 0]) for turn in turns])


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_angles_of_the_links_and_of_the_joints(coordinates: str) -> None:
    agree(directions(coordinates), PHI, 1e-12)
    # the joints of the product begin at zero in the drawing: these angles are differences of directions
    agree(np.diff(directions(coordinates), prepend=0.0), Q, 1e-12)
    assert [run(coordinates).joint(name).position[0, 0] for name in "ABC"] == pytest.approx([0.0] * 3, abs=1e-15)


def test_one_instant_holds_every_term() -> None:
    i = instant()
    assert model()[0].velocity_names == ["A", "B", "C"]
    assert i.independent.tolist() == [0] and i.dependent.tolist() == [1, 2]
    printed = {
        "M": MASS, "C": JACOBIAN, "a": (0.0, 0.0), "b": B, "h": FORCES, "v": VELOCITIES,
        "A": np.transpose([A]), "D": [[1.0, *A]], "xi": XI, "eta": (0.0, 0.0),
        "M_d": [[REDUCED_MASS]], "h_d": [REDUCED_FORCE], "vdot": ACCELERATIONS, "multipliers": LAMBDA,
        "rho": MEASURE["relative"],
    }  # fmt: skip
    for name, values in printed.items():
        agree(getattr(i, name), values)
    agree((i.M @ i.vdot - i.h)[1:], CLOSING_EFFORTS)
    agree(i.h_d / i.M_d[0], ACCELERATIONS[0])
    agree([i.sigma, i.sqrt_mu], [MEASURE["relative"][0]] * 2)  # k = 1: the choice is as good as its coordinate


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_conditions_hold(coordinates: str) -> None:
    i = instant(coordinates)
    compiled, state = model(coordinates)
    assert float(np.max(np.abs(compiled.constraints(state.q)))) < 1e-14
    agree(i.C @ i.v + i.a, np.zeros(len(i.a)), 1e-14)
    agree(i.C @ i.vdot + i.b, np.zeros(len(i.a)), 1e-13)
    agree(i.D @ i.C.T, np.zeros((1, len(i.a))), 1e-13)


def test_an_instant_at_rest() -> None:
    compiled, state = model()
    assert compiled.at(state.q).v.tolist() == [0.0, 0.0, 0.0]
    assert compiled.at(state.q).independent.tolist() == [0]


def test_partition_with_the_crank_independent() -> None:
    i = instant()
    choice = pt.partition.choose(i.M, i.C)
    assert choice.independent.tolist() == [0] and choice.dependent.tolist() == [1, 2]
    agree(choice.A[:, 0], A)
    agree(choice.D, [[1.0, *A]])
    agree([choice.sigma, choice.sqrt_mu], [MEASURE["relative"][0]] * 2)


@pytest.mark.parametrize("independent", [None, [0], [1], [2]])
def test_lengths_and_metrics_in_joint_coordinates(independent: list[int] | None) -> None:
    i = instant()
    g = pt.partition.geometry(i.M, i.C, independent)
    agree(g.k**2, FREE)
    agree(g.k_constrained**2, CONSTRAINED)
    agree(g.k_tangential / g.k, MEASURE["relative"])
    natural = np.sqrt(np.diag(g.M_c))
    agree(np.linalg.eigvalsh(g.M_c / np.outer(natural, natural))[0], SCALED_DELASSUS)
    if independent == [0]:
        agree(g.M_d, [[REDUCED_MASS]])


def test_measure_in_absolute_coordinates() -> None:
    """Centre of mass and turn of each link, the four pins as rows: other free bodies, another measure."""
    i = instant("absolute")
    assert model("absolute")[0].velocity_names == [
        f"{link}.{what}" for link in ("crank", "coupler", "rocker") for what in ("x", "y", "turn")
    ]
    for rho in (i.rho, pt.partition.measure(i.M, i.C), run("absolute").measure[0]):
        agree(rho, MEASURE["absolute"], 1e-9)  # printed with nine digits
        agree(rho @ rho, 1.0, 1e-12)
    # the tangential part of the crank's unit velocity is the same in both, the unit velocity itself is not
    joint, absolute = (pt.partition.geometry(instant(c).M, instant(c).C) for c in COORDINATES)
    agree(absolute.k_tangential[2], joint.k_tangential[0])
    agree([absolute.k[2] ** 2, joint.k[0] ** 2], [12.0, FREE[0]])


def test_both_coordinates_give_one_motion() -> None:
    """The turns of the links are the joint angles summed up: rates, accelerations, M_d and h_d for the crank."""
    i, j = instant("absolute"), instant()
    turns = [2, 5, 8]
    agree(i.v[turns], np.cumsum(VELOCITIES))
    agree(i.vdot[turns], np.cumsum(ACCELERATIONS))
    g = pt.partition.geometry(i.M, i.C, [2])
    agree(g.M_d, j.M_d)
    d = g.T_cd[len(i.C) :]
    bias = i.vdot - d[0] * i.vdot[2]  # [0; xi] for the crank's turn: what is left of the accelerations
    agree(d @ (i.h - i.M @ bias), [REDUCED_FORCE])


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_accelerations_and_multipliers_of_the_run(coordinates: str) -> None:
    compiled, state = model(coordinates)
    vdot, multipliers = compiled.acceleration(state.q, state.v)
    agree(vdot, instant(coordinates).vdot)
    agree(run(coordinates).vdot[0], vdot)
    # the rows of D come last; each is the force on the rocker, +lambda, as in the formulas
    agree(multipliers[-2:], LAMBDA)
    agree(run(coordinates).multipliers[0, -2:], LAMBDA)


@pytest.mark.parametrize("coordinates", COORDINATES)
@pytest.mark.parametrize("joint", "ABCD")
def test_reaction_on_the_outer_body(joint: str, coordinates: str) -> None:
    found = run(coordinates).joint(joint)
    agree(found.force[0, :2], REACTIONS[joint])
    if coordinates == "absolute":  # two rows for each pin, in the order of the chain: the multipliers are the forces
        at = 2 * "ABCD".index(joint)
        agree(instant("absolute").multipliers[at : at + 2], REACTIONS[joint])


@pytest.mark.parametrize("coordinates", COORDINATES)
def test_rates_and_energy_of_the_run(coordinates: str) -> None:
    agree([run(coordinates).joint(name).velocity[0, 0] for name in "ABC"], VELOCITIES)
    agree(run(coordinates).energy.total[0], ENERGY, 1e-14)
    assert VELOCITIES[0] == RATE and PHI[0] == CRANK_ANGLE


def test_the_catalogue_meets_its_answers_in_absolute_coordinates() -> None:
    assert not [str(m) for m in pt.catalogue.entry("reference-four-bar").measure(run("absolute")) if not m.passed]
