"""The four-bar of the theory at one instant: crank 1, coupler 2.5, rocker 2, ground 2.2 m, 1 kg/m, g = 9.81.

              C
            /   \\
          B       \\            tree:  ground -A- crank -B- coupler -C- rocker
         /         \\           cut:   D
    ---A-------------D---

Crank angle 0.8 rad, rate 1.5 rad/s. Relative angles q = (A, B, C). The numbers were printed with 12 digits and agree
with formulas in absolute angles that were worked out by hand; 1e-10 leaves two digits to their rounding.
"""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt
from partita import Mechanism
from partita.results import Result
from partita.state import State

LENGTHS, GROUND, G = (1.0, 2.5, 2.0), 2.2, 9.81
DIRECTIONS = (0.8, 0.477935466983, -1.937228058039)  # of the links, in the world
RATE = 1.5

MASS = ((29.469902911825, 18.768030028682, -2.909793239665), (18.768030028682, 12.899490478872, -1.071088093897),
        (-2.909793239665, -1.071088093897, 2.666666666667))  # fmt: skip
FORCES = (-90.79193751543, -56.193111292655, 9.219518661212)
A = (-1.236935882644, 0.475210113261)
VELOCITIES = (1.5, -1.855403823966, 0.712815169891)
ACCELERATIONS = (-10.466415143407, 14.180313468504, -4.507165728272)
XI = (1.234029014978, 0.46658059746)
REDUCED_MASS, REDUCED_FORCE = 1.872411032139, -19.597431181463
LAMBDA = (7.546968149505, 27.999622165247)
CLOSING_EFFORTS = (47.505507711703, -5.971888165969)  # (M q'' - h) of the dependent coordinates
REACTIONS = {
    "A": (5.975764412228, 8.554094290154),
    "B": (3.00548613374, 3.197130719028),
    "C": (-6.157297666382, -9.18658040682),
    "D": LAMBDA,
}
FREE_LENGTHS = (0.687297813732, 1.449351602773, 0.576846391448)  # |k_i|^2, the diagonal of M^-1
RHO = (0.881509349986, 0.750861289725, 0.457251342070)
RHO_ABSOLUTE = (0.262122438, 0.254577139, 0.210964209, 0.671499115, 0.501167177, 0.197583026,
                0.229909960, 0.088231108, 0.142177493)  # fmt: skip
ENERGY = 55.63596373801568


def agree(found: object, printed: object, tolerance: float = 1e-10) -> None:
    np.testing.assert_allclose(np.asarray(found), np.asarray(printed), rtol=tolerance, atol=tolerance)


@cache
def closed() -> tuple[NDArray[np.float64], ...]:
    """The pins A, B, C, D at crank angle 0.8: C where the circles about B and D meet, above the diagonal."""
    a, d = np.zeros(3), np.array([GROUND, 0.0, 0.0])
    b = LENGTHS[0] * np.array([np.cos(DIRECTIONS[0]), np.sin(DIRECTIONS[0]), 0.0])
    across = d - b
    diagonal = float(np.linalg.norm(across))
    along = across / diagonal
    foot = (LENGTHS[1] ** 2 + diagonal**2 - LENGTHS[2] ** 2) / (2.0 * diagonal)
    height = np.sqrt(LENGTHS[1] ** 2 - foot**2)
    return a, b, b + foot * along + height * np.array([-along[1], along[0], 0.0]), d


@cache
def linkage() -> tuple[Mechanism, State]:
    m = pt.Mechanism("four-bar", gravity=(0, -G, 0))
    a, b, c, d = closed()
    crank = m.add_rod("crank", start=a, end=b, mass=LENGTHS[0])
    coupler = m.add_rod("coupler", start=b, end=c, mass=LENGTHS[1])
    rocker = m.add_rod("rocker", start=c, end=d, mass=LENGTHS[2])
    m.add_revolute("A", m.ground, crank, point=a, cut="never")
    m.add_revolute("B", crank, coupler, point=b, cut="never")
    m.add_revolute("C", coupler, rocker, point=c, cut="never")
    m.add_revolute("D", m.ground, rocker, point=d, cut="always")
    return m, m.assemble(rates={"A": RATE})


@cache
def result() -> Result:
    m, state = linkage()
    return m.simulate(1e-3, t_eval=[0.0, 1e-3], initial=state, rtol=1e-12, atol=1e-13)


def order() -> list[int]:
    """Columns of A, B, C in the compiled model."""
    names = linkage()[0].compile().velocity_names
    return [names.index(name) for name in "ABC"]


def mass_and_jacobian() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    m, state = linkage()
    model, columns = m.compile(), order()
    return model.mass_matrix(state.q)[np.ix_(columns, columns)], model.jacobian(state.q)[:, columns]


def test_drawing_and_printed_angles() -> None:
    a, b, c, d = closed()
    directions = [np.arctan2(*(end - start)[1::-1]) for start, end in ((a, b), (b, c), (c, d))]
    agree(directions, DIRECTIONS, 1e-12)


def test_mass_matrix() -> None:
    agree(mass_and_jacobian()[0], MASS)
    agree(np.diag(np.linalg.inv(mass_and_jacobian()[0])), FREE_LENGTHS)


def test_forces() -> None:
    m, state = linkage()
    agree(m.compile().forces(state.q, state.v)[order()], FORCES)


def test_velocities_follow_the_crank() -> None:
    agree(linkage()[1].v[order()], VELOCITIES)


def test_partition_with_the_crank_independent() -> None:
    mass, jacobian = mass_and_jacobian()
    choice = pt.partition.choose(mass, jacobian)
    assert choice.independent.tolist() == [0] and choice.dependent.tolist() == [1, 2]
    agree(choice.A[:, 0], A)
    agree(choice.D, [[1.0, *A]])
    agree(choice.sigma, RHO[0])  # one degree of freedom: sigma, sqrt(mu) and rho are the same
    agree(choice.sqrt_mu, RHO[0])
    agree(choice.D @ jacobian.T, np.zeros((1, len(jacobian))), 1e-13)


def test_measure_from_the_model_and_from_matrices() -> None:
    m, state = linkage()
    agree(pt.partition.measure(*mass_and_jacobian()), RHO)
    agree(m.compile().measure(state.q)[order()], RHO)
    agree(result().measure[0, order()], RHO)


def test_measure_in_absolute_coordinates() -> None:
    """x, y, angle of each mass centre, pins as rows: the same mechanism, other free bodies, another measure."""
    masses = np.array(LENGTHS)
    inertias = masses * np.array(LENGTHS) ** 2 / 12.0
    mass = np.diag(np.column_stack([masses, masses, inertias]).ravel())
    points, rows = closed(), np.zeros((8, 9))
    for pin, point in enumerate(points):
        for body, sign in ((pin, 1.0), (pin - 1, -1.0)):  # the pin starts one link and ends the one before
            if 0 <= body < 3:
                arm = point - 0.5 * (points[body] + points[body + 1])
                block = np.array([[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]])
                rows[2 * pin : 2 * pin + 2, 3 * body : 3 * body + 3] = sign * block
    rho = pt.partition.measure(mass, rows)
    agree(rho, RHO_ABSOLUTE, 1e-9)  # printed with nine digits
    agree(np.sum(rho**2), 1.0, 1e-12)


def test_reduced_equation_of_motion() -> None:
    m, state = linkage()
    mass, jacobian = mass_and_jacobian()
    model, columns = m.compile(), order()
    xi = -np.linalg.solve(jacobian[:, 1:], model.bias(state.q, state.v))
    direction = np.array([1.0, *A])
    reduced_force = direction @ (model.forces(state.q, state.v)[columns] - mass @ np.array([0.0, *xi]))
    agree(xi, XI)
    agree(direction @ mass @ direction, REDUCED_MASS)
    agree(reduced_force, REDUCED_FORCE)
    agree(reduced_force / REDUCED_MASS, ACCELERATIONS[0])


def test_accelerations_and_multipliers() -> None:
    m, state = linkage()
    model, columns = m.compile(), order()
    vdot, multipliers = model.acceleration(state.q, state.v)
    agree(vdot[columns], ACCELERATIONS)
    agree(result().vdot[0, columns], ACCELERATIONS)
    mass, jacobian = mass_and_jacobian()
    efforts = mass @ vdot[columns] - model.forces(state.q, state.v)[columns]
    agree(efforts[1:], CLOSING_EFFORTS)
    agree(jacobian.T @ multipliers, efforts)


@pytest.mark.parametrize("joint", "ABCD")
def test_reaction_on_the_outer_body(joint: str) -> None:
    agree(result().joint(joint).force[0, :2], REACTIONS[joint])


def test_energy() -> None:
    agree(result().energy.total[0], ENERGY)


def test_one_instant_holds_every_term() -> None:
    m, state = linkage()
    i = m.compile().at(state.q, state.v, state.t)
    choice = m.compile().at(state.q).independent.tolist()
    assert i.independent.tolist() == choice == [0] and i.dependent.tolist() == [1, 2]
    printed = {
        "M": MASS, "h": FORCES, "v": VELOCITIES, "A": np.transpose([A]), "D": [[1.0, *A]], "xi": XI, "eta": (0.0, 0.0),
        "M_d": [[REDUCED_MASS]], "h_d": [REDUCED_FORCE], "vdot": ACCELERATIONS, "multipliers": LAMBDA, "rho": RHO,
    }  # fmt: skip
    for name, values in printed.items():
        agree(getattr(i, name), values)
    agree(i.C @ i.v + i.a, np.zeros(2))
    agree(i.C @ i.vdot + i.b, np.zeros(2))
    agree((i.M @ i.vdot - i.h)[1:], CLOSING_EFFORTS)
    agree(i.sigma, RHO[0])  # k = 1: the choice is as good as its coordinate
    assert m.compile().at(state.q).v.tolist() == [0.0, 0.0, 0.0]


def test_geometry_of_the_criterion() -> None:
    m, state = linkage()
    i = m.compile().at(state.q)
    for independent in (None, [0], [1], [2]):
        g = pt.partition.geometry(i.M, i.C, independent)
        agree(g.k**2, FREE_LENGTHS)
        agree(g.k_tangential / g.k, RHO)
        agree(g.k_constrained**2 + g.k_tangential**2, g.k**2)
    agree(pt.partition.geometry(i.M, i.C, [0]).M_d, [[REDUCED_MASS]])
