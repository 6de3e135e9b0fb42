"""`model.at` and `partition.geometry`: identities on random matrices, one instant against single functions."""

import numpy as np
import pytest

import partita as pt

# condition of the random matrices up to 1e3, a dozen operations an entry
ROUND_OFF = 1e-10


def random_pair(seed: int, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """M in random units and C with independent rows."""
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(n, n))
    units = 10.0 ** rng.uniform(-2, 2, size=n)
    mass = (factor @ factor.T + n * np.eye(n)) * np.outer(units, units)
    return mass, rng.normal(size=(m, n)) * units


@pytest.mark.parametrize("seed", range(12))
def test_identities_of_the_metric_geometry(seed: int) -> None:
    n = 3 + seed % 5
    m = 1 + seed % (n - 1)
    M, C = random_pair(seed, n, m)
    g = pt.partition.geometry(M, C)
    inverse = np.linalg.inv(M)
    np.testing.assert_allclose(g.k**2, np.diag(inverse), rtol=ROUND_OFF)
    np.testing.assert_allclose(g.k_constrained**2 + g.k_tangential**2, g.k**2, rtol=ROUND_OFF)  # Pythagoras (22)
    np.testing.assert_allclose(g.k_tangential / g.k, pt.partition.measure(M, C), rtol=ROUND_OFF)
    # in units of the coordinates the matrices have entries of one size
    scale = np.outer(1.0 / g.k, g.k)
    P_c, P_d = g.P_c * scale, g.P_d * scale
    np.testing.assert_allclose(P_c + P_d, np.eye(n), atol=ROUND_OFF)
    np.testing.assert_allclose(P_c @ P_c, P_c, atol=ROUND_OFF)
    np.testing.assert_allclose(P_d @ P_c, np.zeros((n, n)), atol=ROUND_OFF)
    metric = M * np.outer(g.k, g.k)
    np.testing.assert_allclose(metric @ P_d, (metric @ P_d).T, atol=ROUND_OFF)  # self-adjoint in the mass metric
    np.testing.assert_allclose(np.trace(P_d), n - m, atol=ROUND_OFF)
    blocks = g.T_cd @ M @ g.T_cd.T  # (15)
    np.testing.assert_allclose(blocks[:m, :m], g.M_c, rtol=1e-8)
    np.testing.assert_allclose(blocks[m:, m:], g.M_d, rtol=1e-8)
    size = np.sqrt(np.outer(np.diag(g.M_c), np.diag(g.M_d)))
    np.testing.assert_allclose(blocks[:m, m:] / size, np.zeros((m, n - m)), atol=ROUND_OFF)
    np.testing.assert_allclose(g.T_cd[:m], C @ inverse, rtol=1e-8, atol=0.0)


def test_lengths_and_projectors_do_not_depend_on_the_choice() -> None:
    M, C = random_pair(5, 4, 2)
    choices = [pt.partition.geometry(M, C, pair) for pair in ([0, 1], [1, 3], [2, 3])]
    for g in choices[1:]:
        for name in ("k", "k_constrained", "k_tangential", "P_c", "P_d", "M_c"):
            np.testing.assert_allclose(getattr(g, name), getattr(choices[0], name), rtol=1e-8)
    assert [g.independent.tolist() for g in choices] == [[0, 1], [1, 3], [2, 3]]


def test_dependent_rows_are_left_out_and_free_coordinates_have_none() -> None:
    M, C = random_pair(3, 4, 2)
    g, more = pt.partition.geometry(M, C), pt.partition.geometry(M, np.vstack([C, C[0] + C[1]]))
    np.testing.assert_allclose(more.P_d, g.P_d, rtol=1e-8)
    assert len(more.rows) == 2 and more.T_cd.shape == (4, 4)
    free = pt.partition.geometry(M, np.zeros((0, 4)))
    np.testing.assert_allclose(free.k_tangential, free.k, rtol=ROUND_OFF)
    assert free.k_constrained.tolist() == [0.0] * 4


def test_geometry_refuses_what_makes_no_sense() -> None:
    M, C = random_pair(3, 4, 2)
    for independent in ([0], [0, 0], [0, 9], [0.5, 1.0]):
        with pytest.raises(pt.errors.ArgumentError):
            pt.partition.geometry(M, C, independent)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.ArgumentError, match="positive definite"):
        pt.partition.geometry(-M, C)


@pytest.mark.parametrize("name", ["four-bar", "rssr", "andrews-squeezer", "bricard"])
def test_an_instant_agrees_with_the_functions_one_by_one(name: str) -> None:
    entry = pt.catalogue.entry(name)
    run = entry.simulate()
    model = entry.mechanism().compile()
    q, v, t = run.q[5], run.v[5], float(run.t[5])
    i = model.at(q, v, t)
    for found, other in [
        (i.M, model.mass_matrix(q, t=t)), (i.h, model.forces(q, v, t=t)), (i.C, model.jacobian(q, t=t)),
        (i.a, model.rate(q, t=t)), (i.b, model.bias(q, v, t=t)),
    ]:  # fmt: skip
        np.testing.assert_array_equal(found, other)
    vdot, _ = model.acceleration(q, v, t=t)
    size = float(np.abs(vdot).max())
    np.testing.assert_allclose(i.vdot, vdot, atol=1e-8 * size)
    np.testing.assert_allclose(i.rho, model.measure(q, t=t), rtol=1e-8)
    np.testing.assert_allclose(i.M @ i.vdot, i.h + i.C.T @ i.multipliers, atol=1e-8 * float(np.abs(i.h).max()))
    np.testing.assert_allclose(i.D[:, i.dependent], i.A.T)
    np.testing.assert_allclose(i.M_d @ i.vdot[i.independent], i.h_d, atol=1e-8 * float(np.abs(i.h).max()))


def test_an_instant_of_a_system_with_prescribed_motion() -> None:
    slide = pt.System(
        n=2,
        mass=np.diag([2.0, 3.0]),
        forces=lambda t, q, v: [-q[0], 0.5],
        constraints=lambda t, q: [q[0] - q[1] - np.sin(t)],
        jacobian=lambda t, q: [[1.0, -1.0]],
        constraint_rate=lambda t, q: [-np.cos(t)],
        bias=lambda t, q, v: [np.sin(t)],
    )
    t, q = 0.4, np.array([1.0, 1.0 - np.sin(0.4)])
    i = slide.at(q, t=t)
    assert i.v[i.independent].tolist() == [0.0]
    np.testing.assert_allclose(i.C @ i.v + i.a, [0.0], atol=1e-15)
    np.testing.assert_allclose(i.C @ i.vdot + i.b, [0.0], atol=1e-15)
    np.testing.assert_allclose(i.M @ i.vdot, i.h + i.C.T @ i.multipliers, atol=1e-15)
