"""`model.at` and `partition.geometry`: identities on random matrices, one instant against single functions.

The random matrices have conditions of M up to 1e6 and coordinates and rows in units from 1e-3 to 1e3. Whatever solves
with M cannot be better than some 1e6 times round-off, 2e-10, in the natural unit of each quantity: |k_i| for lengths,
sqrt(M_ii) for velocities, the diagonal of a metric for its entries. 1e-9 is asked of all of them.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from thorough import either

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


WITHIN = 1e-9
SEEDS = range(either(80, 200))
Rational = list[list[Fraction]]


def hard_pair(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """M of a condition up to 1e6 and C, in mixed units; n from 2 to 10."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 11))
    m = int(rng.integers(1, n))
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    metric = (turn * np.geomspace(1.0, 10.0 ** -rng.uniform(0.0, 6.0), n)) @ turn.T
    units = 10.0 ** rng.uniform(-3.0, 3.0, size=n)
    rows = 10.0 ** rng.uniform(-3.0, 3.0, size=(m, 1))
    return 0.5 * (metric + metric.T) * np.outer(units, units), rng.normal(size=(m, n)) * units * rows


def small(found: np.ndarray, size: np.ndarray | float) -> None:
    """Zero within WITHIN of its size."""
    assert float(np.max(np.abs(found) / size)) < WITHIN


@pytest.mark.parametrize("seed", SEEDS)
def test_identities_in_mixed_units(seed: int) -> None:
    M, C = hard_pair(seed)
    m, n = C.shape
    g = pt.partition.geometry(M, C)
    assert g.rows.tolist() == list(range(m))
    assert g.independent is not None and g.dependent is not None
    D = g.T_cd[m:]
    energy, rows, motions = np.sqrt(np.diag(M)), np.sqrt(np.diag(g.M_c)), np.sqrt(np.diag(g.M_d))
    # T_cd splits the metric (11), (15); D C^T = 0; C M^-1 are the covariant components in the base of the rows
    both = np.concatenate([rows, motions])
    blocks = np.block([[g.M_c, np.zeros((m, n - m))], [np.zeros((n - m, m)), g.M_d]])
    small(g.T_cd @ M @ g.T_cd.T - blocks, np.outer(both, both))
    small(D @ C.T, np.outer(motions, rows))
    small(g.T_cd[:m] @ M - C, np.outer(rows, energy))
    # D and M_d by the choice (13), and the determinants of all metrics (24)
    a = D[:, g.dependent].T
    small(D[:, g.independent] - np.eye(n - m), 1.0)
    i, d = g.independent, g.dependent
    cross = M[np.ix_(i, d)] @ a
    small(M[np.ix_(i, i)] + cross + cross.T + a.T @ M[np.ix_(d, d)] @ a - g.M_d, np.outer(motions, motions))
    logs = [np.linalg.slogdet(matrix)[1] for matrix in (C[:, d], g.M_d, M, g.M_c)]
    small(2.0 * logs[0] + logs[1] - logs[2] - logs[3], 1.0)
    # lengths from both sides (20), (21), their sum (22) and their ratio (23)
    normal = np.sum(g.T_cd[:m] * np.linalg.solve(g.M_c, g.T_cd[:m]), axis=0)
    along = np.sum(D * np.linalg.solve(g.M_d, D), axis=0)
    small(normal - g.k_constrained**2, g.k**2)
    small(along - g.k_tangential**2, g.k**2)
    small(normal + along - g.k**2, g.k**2)
    small(g.k_constrained**2 + g.k_tangential**2 - g.k**2, g.k**2)
    small(g.k_tangential / g.k - pt.partition.measure(M, C), 1.0)
    # projectors: both together are 1, each is idempotent and self-adjoint in the mass metric, and they know their space
    units = np.outer(energy, 1.0 / energy)
    P_c, P_d, metric = g.P_c * units, g.P_d * units, M / np.outer(energy, energy)
    size = float(np.max(np.abs(P_c)) + np.max(np.abs(P_d)))
    small(P_c + P_d - np.eye(n), size)
    small(P_c @ P_c - P_c, size**2)
    small(P_d @ P_d - P_d, size**2)
    small(P_c @ P_d, size**2)
    small(metric @ P_d - (metric @ P_d).T, size)
    small(np.trace(g.P_d) - (n - m), size)
    small(C @ g.P_d / np.outer(rows, 1.0 / energy), size)
    small(g.P_d @ D.T - D.T, np.outer(1.0 / energy, motions) * size)
    # products of two vectors by co- and contravariant components, in the old base and in the new one
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(2, n)) / energy
    x_new, y_new = g.T_cd @ (M @ x), g.T_cd @ (M @ y)
    product = x_new[:m] @ np.linalg.solve(g.M_c, y_new[:m]) + x_new[m:] @ np.linalg.solve(g.M_d, y_new[m:])
    small(product - x @ M @ y, np.sqrt((x @ M @ x) * (y @ M @ y)))


@pytest.mark.parametrize("seed", SEEDS)
def test_geometry_against_rational_numbers(seed: int) -> None:
    """The same quantities computed from the same M and C without any rounding."""
    M, C = hard_pair(seed)
    g = pt.partition.geometry(M, C)
    n, rows = len(M), rational(C)
    inverse = solved(rational(M), rational(np.eye(n)))
    raised = times(rows, inverse)  # C M^-1
    delassus = times(raised, turned(rows))
    coefficients = solved(delassus, raised)
    k = [inverse[i][i] for i in range(n)]
    normal = [sum((row[i] * other[i] for row, other in zip(raised, coefficients, strict=True)), Fraction(0))
              for i in range(n)]  # fmt: skip
    along = [whole - part for whole, part in zip(k, normal, strict=True)]
    small(g.k**2 - floats(k), floats(k))
    small(g.k_constrained**2 - floats(normal), floats(k))
    small(g.k_tangential**2 - floats(along), floats(k))
    ratio = floats([part / whole for part, whole in zip(along, k, strict=True)])
    small(pt.partition.measure(M, C) - np.sqrt(ratio), 1.0)
    metric = np.array([floats(row) for row in delassus])
    small(g.M_c - metric, np.sqrt(np.outer(np.diag(metric), np.diag(metric))))
    energy = np.sqrt(np.diag(M))
    units = np.outer(energy, 1.0 / energy)
    exact = np.array([floats(row) for row in times(turned(raised), solved(delassus, rows))])
    small((g.P_c - exact) * units, float(np.max(np.abs(exact * units))))
    small((g.P_d - (np.eye(n) - exact)) * units, float(np.max(np.abs((np.eye(n) - exact) * units))))


def rational(matrix: np.ndarray) -> Rational:
    return [[Fraction(value) for value in row] for row in matrix.tolist()]


def floats(values: Iterable[Fraction]) -> np.ndarray:
    return np.array([float(value) for value in values])


def turned(matrix: Rational) -> Rational:
    return [list(column) for column in zip(*matrix, strict=True)]


def times(left: Rational, right: Rational) -> Rational:
    columns = turned(right)
    return [[sum((a * b for a, b in zip(row, column, strict=True)), Fraction(0)) for column in columns] for row in left]


def solved(matrix: Rational, right: Sequence[Sequence[Fraction]]) -> Rational:
    """matrix^-1 right, by Gauss and Jordan."""
    rows = [list(a) + list(b) for a, b in zip(matrix, right, strict=True)]
    size = len(rows)
    for column in range(size):
        pivot = next(row for row in range(column, size) if rows[row][column] != 0)
        rows[column], rows[pivot] = rows[pivot], rows[column]
        scale = rows[column][column]
        rows[column] = [value / scale for value in rows[column]]
        for row in range(size):
            factor = rows[row][column]
            if row != column and factor != 0:
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[column], strict=True)]
    return [row[size:] for row in rows]


@pytest.mark.parametrize("seed", SEEDS[::4])
def test_what_units_and_recombined_rows_leave_alone(seed: int) -> None:
    """q'_i = s_i q_i scales k_i; C' = X C leaves everything but the base of the rows."""
    M, C = hard_pair(seed)
    m, n = C.shape
    rng = np.random.default_rng(seed)
    s = 10.0 ** rng.uniform(-3.0, 3.0, size=n)
    g, scaled = pt.partition.geometry(M, C), pt.partition.geometry(M / np.outer(s, s), C / s)
    for name in ("k", "k_constrained", "k_tangential"):
        small(getattr(scaled, name) / s - getattr(g, name), g.k)
    small(pt.partition.measure(M / np.outer(s, s), C / s) - pt.partition.measure(M, C), 1.0)
    natural = np.sqrt(np.diag(g.M_c))
    mixing = np.linalg.qr(rng.normal(size=(m, m)))[0] + np.eye(m) * 2.0
    mixed = pt.partition.geometry(M, mixing @ (C / natural[:, None]))
    small(mixed.k_constrained - g.k_constrained, g.k)
    small(mixed.k_tangential - g.k_tangential, g.k)
    energy = np.sqrt(np.diag(M))
    units = np.outer(energy, 1.0 / energy)
    small((mixed.P_d - g.P_d) * units, float(np.max(np.abs(g.P_d * units))))


@pytest.mark.parametrize("seed", SEEDS[::4])
def test_effective_masses(seed: int) -> None:
    """|k_i|^2 is the acceleration of q_i by a unit force on it alone; |k_i,d|^2 the same with the constraints."""
    M, C = hard_pair(seed)
    m, n = C.shape
    g = pt.partition.geometry(M, C)
    energy, rows = np.sqrt(np.diag(M)), np.sqrt(np.diag(g.M_c))
    # M v' - C^T lambda = e_i, C v' = 0, in natural units
    metric, jacobian = M / np.outer(energy, energy), C / np.outer(rows, energy)
    system = np.block([[metric, -jacobian.T], [jacobian, np.zeros((m, m))]])
    answers = np.linalg.solve(system, np.vstack([np.eye(n), np.zeros((m, n))]))[:n]
    small(np.diag(answers) / energy**2 - g.k_tangential**2, g.k**2)
    free = np.diag(M)
    diagonal = pt.partition.geometry(np.diag(free), C)
    small(np.sum((diagonal.k_tangential / diagonal.k) ** 2) - (n - m), 1.0)  # the sum of rho^2 is k


def test_lengths_and_projectors_do_not_depend_on_the_choice() -> None:
    M, C = random_pair(5, 4, 2)
    choices = [pt.partition.geometry(M, C, pair) for pair in ([0, 1], [1, 3], [2, 3])]
    for g in choices[1:]:
        for name in ("k", "k_constrained", "k_tangential", "P_c", "P_d", "M_c"):
            np.testing.assert_allclose(getattr(g, name), getattr(choices[0], name), rtol=1e-8)
    for g, pair in zip(choices, ([0, 1], [1, 3], [2, 3]), strict=True):
        assert np.array_equal(g.S, np.eye(4)[pair])


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


@pytest.mark.parametrize("seed", SEEDS[:60])
def test_volume_cosines_and_conditioning_of_a_choice(seed: int) -> None:
    """(25)-(30), for the collective choice and for one by chance, against the matrices themselves."""
    M, C = hard_pair(seed)
    best = pt.partition.choose(M, C)
    for choice in (best, pt.partition.choose(M, C, selection="complete-pivoting")):
        g = pt.partition.geometry(M, C, choice.independent)
        assert g.independent is not None and g.dependent is not None
        i, d, k = g.independent, g.dependent, len(g.independent)
        assert g.D.tolist() == choice.D.tolist()
        inverse = np.linalg.inv(M)
        block = np.linalg.solve(np.linalg.cholesky(g.M_d), g.D) / g.k  # (25)
        np.testing.assert_allclose(np.linalg.norm(block, axis=0), choice.rho, atol=WITHIN)
        known = np.linalg.svd(block[:, i], compute_uv=False)
        # by M_d squared, so to the square root of its condition
        np.testing.assert_allclose(np.sort(g.stretches)[::-1], known, rtol=WITHIN * g.condition**0.5)
        assert g.sigma == pytest.approx(choice.sigma, rel=WITHIN * g.condition**0.5)
        assert g.sqrt_mu == pytest.approx(choice.sqrt_mu, rel=1e-6)
        assert g.volume == pytest.approx(abs(np.prod(known)), rel=1e-6)
        logs = {name: np.linalg.slogdet(matrix)[1] for name, matrix in (
            ("C_D", C[:, d]), ("M", M), ("M_c", g.M_c), ("M_DD", M[np.ix_(d, d)]), ("inverse", inverse[np.ix_(i, i)]),
            ("M_d", g.M_d))}  # fmt: skip
        volume = logs["C_D"] - 0.5 * (logs["M"] + logs["M_c"] + np.log(np.diag(inverse)[i]).sum())
        assert np.log(g.volume) == pytest.approx(volume, abs=1e-6)  # (28)
        cosines = -0.5 * (logs["M_d"] + logs["inverse"])
        assert np.log(g.cosine_product) == pytest.approx(cosines, abs=1e-6)  # (29)
        assert g.sqrt_mu**k * (1.0 - 1e-6) <= g.cosine_product <= g.sqrt_mu * (1.0 + 1e-6)
        natural = g.M_d * np.outer(g.k[i], g.k[i])
        assert g.condition == pytest.approx(np.linalg.cond(natural), rel=1e-4)  # (30)
        assert g.condition <= g.condition_bound * (1.0 + WITHIN)
        assert g.volume <= pt.partition.geometry(M, C, best.independent).volume * (1.0 + WITHIN) or k > 1


@pytest.mark.parametrize("seed", SEEDS[:60])
def test_no_exchange_improves_a_choice_in_its_own_scales(seed: int) -> None:
    """What an exchange multiplies the volume by is |A_ji| s_i / s_j, whatever the scales; (32) holds in diag(M)."""
    M, C = hard_pair(seed)
    own = 10.0 ** np.random.default_rng(seed).uniform(-2.0, 2.0, size=M.shape[0])
    lengths = pt.partition.geometry(M, C).k_tangential
    for scales, sizes in (("diagonal", np.diag(M) ** -0.5), (own, own)):
        np.testing.assert_allclose(pt.partition.measure(M, C, scales=scales), lengths / sizes, rtol=1e-6)
        choice = pt.partition.choose(M, C, scales=scales)
        i, d = choice.independent, choice.dependent
        assert np.max(np.abs(choice.A) * sizes[i] / sizes[d][:, None]) <= 1.0 + 1e-6
        rho = pt.partition.measure(M, C, scales=scales)
        first = pt.partition.choose(M, C, selection="individual", scales=scales) if len(i) == 1 else None
        assert first is None or rho[first.independent[0]] == pytest.approx(rho.max())
    i = pt.partition.choose(M, C, scales="diagonal").independent
    bound = (1.0 + len(i) * (M.shape[0] - len(i))) ** -0.5
    assert pt.partition.geometry(np.diag(np.diag(M)), C, i).sigma >= bound * (1.0 - 1e-6)


def test_scales_change_with_the_units_and_the_choice_does_not() -> None:
    M, C = random_pair(3, 6, 3)
    lengths = np.array([1.0, 1.0, 0.2, 1.0, 1.0, 0.5])
    unit = 10.0 ** np.array([3.0, 0.0, -2.0, 3.0, 0.0, 1.0])
    changed = M / np.outer(unit, unit), C / unit
    for here, there in (("diagonal", "diagonal"), (lengths, lengths * unit)):
        np.testing.assert_allclose(
            pt.partition.measure(*changed, scales=there), pt.partition.measure(M, C, scales=here), rtol=1e-9
        )
        chosen = [pt.partition.choose(*changed, scales=there), pt.partition.choose(M, C, scales=here)]
        assert chosen[0].independent.tolist() == chosen[1].independent.tolist()


@pytest.mark.parametrize(
    "options",
    [
        {"scales": "mass"},
        {"scales": [1.0]},
        {"scales": [1.0, 0.0]},
        {"scales": [1.0, float("nan")]},
        {"scales": "diagonal", "selection": "determinant"},
        {"scales": "diagonal", "selection": "geometric"},
        {"scales": "diagonal", "fixed": [0]},
    ],
)
def test_impossible_scales_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(pt.errors.ArgumentError, match="scales"):
        pt.partition.choose(np.eye(2), [[3.0, 4.0]], **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", SEEDS[:60])
def test_geometry_of_any_selector(seed: int) -> None:
    """(36): D_S, and (25)-(30) with the rows of S in place of the chosen directions."""
    M, C = hard_pair(seed)
    m, n = C.shape
    whole = pt.partition.geometry(M, C)
    # rows of S: any combinations of the gradients of the tangent vectors, tilted out of their space
    rng = np.random.default_rng(seed)
    S = rng.normal(size=(n - m, n - m)) @ np.linalg.solve(np.linalg.cholesky(whole.M_d), whole.D) @ M
    S += 0.3 * rng.normal(size=S.shape) * np.sqrt(np.diag(M)) / n
    g = pt.partition.geometry(M, C, selector=S)
    assert g.independent is None and g.dependent is None and np.array_equal(g.S, S)
    motions = np.sqrt(np.diag(g.M_d))
    small(S @ g.D.T - np.eye(n - m), np.outer(np.linalg.norm(S / np.sqrt(np.diag(M)), axis=1), motions))
    small(g.D @ C.T, np.outer(motions, np.sqrt(np.diag(g.M_c))))
    for name in ("k", "k_constrained", "k_tangential"):
        np.testing.assert_allclose(getattr(g, name), getattr(whole, name), rtol=WITHIN)
    inverse = np.linalg.inv(M)
    lengths = np.sqrt(np.sum((S @ inverse) * S, axis=1))
    natural = g.M_d * np.outer(lengths, lengths)
    known = 1.0 / np.sqrt(np.linalg.eigvalsh(natural))
    np.testing.assert_allclose(g.stretches, known, rtol=1e-6)
    assert g.volume == pytest.approx(np.prod(known), rel=1e-6) and g.sigma == pytest.approx(known[-1], rel=1e-6)
    assert g.condition == pytest.approx((known[0] / known[-1]) ** 2, rel=1e-5) and g.condition <= g.condition_bound
    # principal angles in the mass metric, between S as vectors M^-1 S^T and the possible motions
    half = np.linalg.cholesky(M)
    one, other = (np.linalg.qr(x)[0] for x in (np.linalg.solve(half, S.T), half.T @ whole.D.T))
    cosines = np.linalg.svd(one.T @ other, compute_uv=False)
    assert g.sqrt_mu == pytest.approx(cosines[-1], rel=1e-6)
    assert g.cosine_product == pytest.approx(np.prod(cosines), rel=1e-6)


def test_a_choice_is_a_selector_of_rows_of_the_identity() -> None:
    M, C = random_pair(5, 6, 2)
    for independent in ([0, 1, 2, 3], [1, 2, 4, 5]):
        one = pt.partition.geometry(M, C, independent)
        other = pt.partition.geometry(M, C, selector=np.eye(6)[independent])
        for name in ("S", "D", "M_d", "T_cd", "stretches", "volume", "sigma", "sqrt_mu", "cosine_product", "condition"):
            np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=1e-12 * one.M_d.max())


def test_a_selector_that_does_not_serve_is_refused() -> None:
    M, C = np.diag([1.0, 2.0, 3.0]), [[1.0, 1.0, 1.0]]
    for selector, words in (
        ([[1.0, 0.0, 0.0]], "selector is 1 x 3; with 2 degrees of freedom it must be 2 x 3"),
        ([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "leaves a motion undetermined"),
        ([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0]], "leaves a motion undetermined"),
        ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "leaves a motion undetermined"),
        ([[np.nan, 0.0, 0.0], [1.0, 0.0, 0.0]], r"selector\[0, 0\] is nan"),
        ([1.0, 0.0, 0.0], "selector must be a matrix"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words):
            pt.partition.geometry(M, C, selector=selector)
    with pytest.raises(pt.errors.ArgumentError, match="give one of them"):
        pt.partition.geometry(M, C, [0, 1], selector=np.eye(3)[:2])


@pytest.mark.parametrize("name", ["bricard", "cv-shaft", "delta", "scissor-lift", "three-rrr"])
def test_a_run_gives_the_geometry_of_its_choice(name: str) -> None:
    """Of each output, with the choice in use there; redundant rows are those of the run."""
    entry = pt.catalogue.entry(name)
    run = entry.simulate(t_eval=np.linspace(0.0, min(1.0, entry.duration), 6))
    for output in range(6):
        g = run.geometry(output)
        assert np.array_equal(g.S, np.eye(run.v.shape[1])[run.independent[output]])
        assert g.sigma == pytest.approx(run.sigma[output], abs=WITHIN)
        assert g.sqrt_mu == pytest.approx(run.sqrt_mu[output], abs=WITHIN)
        np.testing.assert_allclose(g.k_tangential / g.k, run.measure[output], atol=WITHIN)
    with pytest.raises(pt.errors.ArgumentError, match="no output 6"):
        run.geometry(6)


def test_a_run_without_a_model_has_no_geometry(tmp_path: Path) -> None:
    run = pt.catalogue.load("four-bar").simulate(0.1)
    stored = pt.load_result(run.save(tmp_path / "run.json"))
    with pytest.raises(pt.errors.ArgumentError, match="simulate again"):
        stored.geometry()
    nothing = pt.catalogue.entry("gear-pair").simulate(t_eval=[0.0, 0.1])
    g = nothing.geometry()
    assert (g.volume, g.sigma, g.condition, len(g.stretches)) == (1.0, 1.0, 1.0, 0)
