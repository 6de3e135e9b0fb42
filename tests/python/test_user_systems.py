"""Equations by hand and choices from matrices: what is accepted, what is refused and with which words."""

import math
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum
from trust.input_believed import swinging

import partita as pt
from partita.errors import (
    ArgumentError,
    DescriptionError,
    EvaluationError,
)

# ---------------------------------------------------------------- systems


def circle(**change: Any) -> pt.System:
    """A point of 1 kg on the unit circle under gravity."""
    functions: dict[str, Any] = {
        "mass": np.eye(2),
        "forces": lambda t, q, v: np.array([0.0, -9.81]),
        "constraints": lambda t, q: [0.5 * (q @ q - 1)],
        "jacobian": lambda t, q: [q],
        "bias": lambda t, q, v: [v @ v],
        "names": ["x", "y"],
    }
    return pt.System(n=2, **{**functions, **change})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": ["x"]}, "2 different texts"),
        ({"names": ["x", "x"]}, "2 different texts"),
        ({"jacobian": None}, "need their jacobian"),
        ({"bias": None}, "needs bias"),
        ({"mass": "M"}, "function or an array"),
    ],
)
def test_bad_system_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        circle(**change)
    assert words in str(caught.value)


@pytest.mark.parametrize("n", [0, -1, 2.0, True])
def test_bad_size_of_a_system_is_refused(n: Any) -> None:
    with pytest.raises(DescriptionError, match="integer above zero"):
        pt.System(n, mass=np.eye(2), forces=(0.0, 0.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass": lambda t, q: np.eye(3)}, "mass at t = 0 s returned shape (3, 3) instead of (2, 2)"),
        ({"mass": lambda t, q: [[1.0, 0.5], [0.0, 1.0]]}, "not symmetric"),
        ({"forces": lambda t, q, v: [0.0, math.nan]}, "forces at t = 0 s returned nan at index [1]"),
        ({"forces": lambda t, q, v: "down"}, "not an array of numbers"),
        ({"jacobian": lambda t, q: q}, "jacobian at t = 0 s returned shape (2,)"),
        ({"constraints": lambda t, q: [0.0, 0.0]}, "at most 1"),
        ({"bias": lambda t, q, v: [0.0, 0.0]}, "instead of (1,)"),
    ],
)
def test_functions_of_a_system_are_checked(change: dict[str, Any], words: str) -> None:
    with pytest.raises(EvaluationError) as caught:
        pt.simulate(circle(**change), 1.0, [1.0, 0.0], [0.0, 0.0])
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"q0": [1.0]}, "flat array of 2 numbers: x, y"),
        ({"v0": [0.0, math.inf]}, "finite"),
        ({"q0": None}, "q0 is missing"),
        ({"initial": pt.State(0.0, [1.0, 0.0], [0.0, 0.0])}, "not both"),
        ({"method": "euler"}, "method"),
    ],
)
def test_bad_start_of_a_system(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        pt.simulate(circle(), 1.0, **{"q0": [1.0, 0.0], "v0": [0.0, 0.0], **arguments})
    assert words in str(caught.value)


def test_a_mechanism_is_no_system() -> None:
    with pytest.raises(ArgumentError, match="call its own method"):
        pt.simulate(pendulum(), 1.0)  # type: ignore[arg-type]


# ---------------------------------------------------------------- partition


@pytest.mark.parametrize(
    ("mass", "jacobian", "words"),
    [
        (np.ones((2, 3)), np.ones((1, 2)), "square"),
        (np.eye(2), np.ones((1, 3)), "3 columns for 2 coordinates"),
        (np.eye(2), np.ones(2), "matrix"),
        ([[1.0, 0.5], [0.0, 1.0]], np.ones((1, 2)), "M[0, 1] and M[1, 0]"),
        ([[1.0, math.nan], [0.0, 1.0]], np.ones((1, 2)), "finite"),
    ],
)
def test_bad_matrices_for_the_criterion(mass: Any, jacobian: Any, words: str) -> None:
    for function in (pt.partition.measure, pt.partition.choose):
        with pytest.raises(ArgumentError) as caught:
            function(mass, jacobian)
        assert words in str(caught.value)


def test_bad_options_of_the_choice() -> None:
    with pytest.raises(ArgumentError, match="alternate forever"):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), threshold=0.5)
    with pytest.raises(ArgumentError, match="2 positive"):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), weights=[1.0, 0.0])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"selection": "largest"}, "no selection 'largest'"),
        ({"selection": "persistence"}, "needs a history"),
        ({"selection": "greedy", "threshold": 1.5}, "makes no switches"),
        ({"selection": "determinant", "weights": [1.0, 2.0]}, "no use for weights"),
        ({"selection": "greedy", "fixed": [0]}, "no rule"),
        ({"fixed": [0], "weights": [1.0, 2.0]}, "no rule, weights or scales"),
        ({"fixed": [2]}, "from 0 to 1"),
        ({"fixed": [0, 0]}, "different indices"),
        ({"fixed": ["x"]}, "must be indices"),
        ({"fixed": [0, 1]}, "number of degrees of freedom is 1"),
    ],
)
def test_contradictory_options_of_the_choice(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), **options)


def test_rules_of_choice() -> None:
    # a pendulum at 45 degrees beside three coupled carts: one by one, the two largest measures are both the pendulum's
    d = math.sqrt(0.5)
    rows = [[d, -d, 0, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 1, -1]]
    for rule in ("collective", "greedy", "normalised-determinant", "determinant", "complete-pivoting"):
        choice = pt.partition.choose(np.eye(5), rows, selection=rule)
        assert len(set(choice.independent) & {0, 1}) == 1
        assert choice.sigma == pytest.approx(1 / math.sqrt(3))
        assert np.abs(choice.D @ np.transpose(rows)).max() < 1e-14
    with pytest.raises(pt.errors.SingularityError, match=r"coordinate 0, coordinate 1.*C_D is singular"):
        pt.partition.choose(np.eye(5), rows, selection="individual")
    with pytest.raises(ArgumentError, match="coordinate 0, coordinate 1 cannot be independent"):
        pt.partition.choose(np.eye(5), rows, fixed=[0, 1])
    assert pt.partition.choose(np.eye(5), rows, fixed=[4, 1]).independent.tolist() == [1, 4]


# ------------------------------------------------- redundant rows beside rows that hold for velocities only

MASS = np.diag([1.0, 1.0, 0.5, 2.0])
PUSH = np.array([0.2, -0.1, 0.3, -9.81])


def edge(t: float, q: np.ndarray) -> np.ndarray:
    """A sleigh (x, y, turn) that stays on the paraboloid z = (x^2 + y^2)/2, said twice; its edge does not slip, said
    with the height's own rate mixed in; and the rate of the height once more."""
    x, y, turn, _ = q
    height = np.array([-x, -y, 0.0, 1.0])
    slip = np.array([-np.sin(turn), np.cos(turn), 0.0, 0.0])
    return np.array([height, -2.0 * height, height, slip + 3.0 * height, slip])


def edge_bias(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    height = -(v[0] ** 2) - v[1] ** 2
    slip = -v[2] * (np.cos(q[2]) * v[0] + np.sin(q[2]) * v[1])
    return np.array([height, -2.0 * height, height, slip + 3.0 * height, slip])


def edge_height(t: float, q: np.ndarray) -> np.ndarray:
    gap = q[3] - 0.5 * (q[0] ** 2 + q[1] ** 2)
    return np.array([gap, -2.0 * gap])


@pytest.mark.parametrize(
    "formulation",
    ["projective", "fixed", "zero-eigenvalue", "svd", "qr", "gram-schmidt", "multipliers", "range-space", "proximal"],
)
def test_redundant_rows_beside_nonholonomic_ones(formulation: str) -> None:
    sleigh = pt.System(
        4,
        mass=MASS,
        forces=PUSH,
        constraints=edge_height,
        jacobian=edge,
        bias=edge_bias,
        names=["x", "y", "turn", "z"],
    )
    q0 = [0.3, 0.4, 0.0, 0.125]
    run = pt.simulate(sleigh, 1.5, q0, [1.0, 0.0, 0.2, 0.3], solver=pt.Solver(formulation))
    assert run.success and run.closure.max() < 1e-12 and run.velocity_closure.max() < 1e-12
    for q, v, vdot, multipliers in zip(run.q, run.v, run.vdot, run.multipliers, strict=True):
        # of least norm, so that no choice of rows enters; the rank is 2 of 5
        c, b = edge(0.0, q), edge_bias(0.0, q, v)
        saddle = np.block([[MASS, -c.T], [c, np.zeros((5, 5))]])
        exact = np.linalg.lstsq(saddle, np.concatenate([PUSH, -b]), rcond=1e-12)[0]
        assert np.allclose(vdot, exact[:4], rtol=0, atol=1e-10)  # rounding times the condition of the saddle
        assert np.allclose(c.T @ multipliers, c.T @ exact[4:], rtol=0, atol=1e-10)


def test_rows_with_positions_are_kept_before_those_without() -> None:
    """The rate of the height, given as a velocity row, must not displace the row that holds the position."""
    first = pt.System(4, MASS, PUSH, edge_height, edge, bias=edge_bias)
    run = pt.simulate(first, 5.0, [0.3, 0.4, 0.0, 0.125], [1.0, 0.0, 0.2, 0.3], rtol=1e-4, atol=1e-6)
    # a height that followed from its rate alone would drift by the tolerance
    assert run.success and run.closure.max() < 1e-12


# ------------------------------------------------- derivatives held against differences


START = ([1.2, -1.6], [0.6, 0.0])
WRONG: dict[str, tuple[str, dict[str, Any]]] = {
    "jacobian of the wrong sign": ("jacobian[0, ", {"jacobian": lambda t, q: [-(q - [0.3 * np.sin(2 * t), 0.0])]}),
    "jacobian with one entry doubled": (
        "jacobian[0, 1]",
        {"jacobian": lambda t, q: [[q[0] - 0.3 * np.sin(2 * t), 2.0 * q[1]]]},
    ),
    "jacobian with one entry off by a thousandth": (
        "jacobian[0, 1]",
        {"jacobian": lambda t, q: [[q[0] - 0.3 * np.sin(2 * t), 1.001 * q[1]]]},
    ),
    "no constraint rate": ("constraint_rate[0]", {"constraint_rate": None}),
    "constraint rate of the wrong sign": (
        "constraint_rate[0]",
        {"constraint_rate": lambda t, q: [(q[0] - 0.3 * np.sin(2 * t)) * 0.6 * np.cos(2 * t)]},
    ),
    "bias left zero": ("bias[0]", {"bias": lambda t, q, v: [0.0]}),
    "bias without the pivot's acceleration": (
        "bias[0]",
        {"bias": lambda t, q, v: [(v - [0.6 * np.cos(2 * t), 0.0]) @ (v - [0.6 * np.cos(2 * t), 0.0])]},
    ),
    "bias of the wrong sign": ("bias[0]", {"bias": lambda t, q, v: [-(v @ v)]}),
}


def test_right_derivatives_are_believed() -> None:
    run = pt.simulate(swinging(), 3.0, *START)
    assert run.success and run.closure.max() < 1e-12 and not run.notes


@pytest.mark.parametrize("name", WRONG)
def test_wrong_derivatives_are_named(name: str) -> None:
    words, change = WRONG[name]
    # the acceleration of the pivot is zero at t = 0: what does not show at the start is found where the run has been
    try:
        run = pt.simulate(swinging(**change), 3.0, *START)
    except pt.errors.DerivativeError as caught:
        error = caught
    else:
        assert not run.success and "the result is wrong" in run.message and words in run.message
        error = run.error  # type: ignore[assignment]
    assert isinstance(error, pt.errors.DerivativeError) and words in str(error)
    assert error.function == words.partition("[")[0] and error.row == 0
    assert abs(error.given - error.found) > 1e-5 and f"{error.given:.9e}"[:8] in str(error)
    trusting = swinging(**change, check_derivatives=False)
    assert pt.simulate(trusting, 0.01, *START).message  # it goes its way


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_derivatives_are_checked_in_any_unit(size: float) -> None:
    def ring(bias: float, jacobian: float) -> pt.System:
        return pt.System(
            n=2,
            mass=np.eye(2),
            forces=(0.0, -9.81 * size),
            constraints=lambda t, q: [q @ q - size**2],
            jacobian=lambda t, q: [2.0 * jacobian * q],
            bias=lambda t, q, v: [2.0 * bias * (v @ v)],
        )

    start = [size, 0.0], [0.0, 0.0]
    run = pt.simulate(ring(1.0, 1.0), 1.0, *start)
    assert run.success
    unit = pt.simulate(ring(1.0, 1.0), 1.0, *start, atol=1e-10)
    assert np.allclose(run.q, unit.q)
    for bias, jacobian in ((0.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.01)):
        with pytest.raises(pt.errors.DerivativeError):
            pt.simulate(ring(bias, jacobian), 1.0, *start)


def test_lengths_are_given_or_estimated() -> None:
    def ring(size: float, **more: Any) -> pt.System:
        return pt.System(
            n=2,
            mass=np.eye(2),
            forces=(0.0, -9.81 * size),
            constraints=lambda t, q: [q @ q / size - size],
            jacobian=lambda t, q: [2.0 * q / size],
            bias=lambda t, q, v: [2.0 * v @ v / size],
            **more,
        )

    one = pt.simulate(ring(1.0), 2.0, [1.0, 0.0], [0.0, 0.0])
    for size in (1e-6, 1e-3, 1e3, 1e6):
        for more in ({}, {"lengths": size}, {"lengths": [size, size]}):
            other = pt.simulate(ring(size, **more), 2.0, [size, 0.0], [0.0, 0.0])
            assert other.counters["steps"] == one.counters["steps"]
            assert np.allclose(other.q / size, one.q, rtol=0, atol=1e-9)
    for bad in (0.0, -1.0, math.nan, [1.0, 2.0, 3.0], "x", None.__class__):
        with pytest.raises(DescriptionError, match="lengths"):
            ring(1.0, lengths=bad)


def test_mass_that_is_not_positive_is_named() -> None:
    with pytest.raises(pt.errors.PartitaError, match="positive definite"):
        pt.simulate(circle(mass=np.diag([1.0, -1.0])), 1.0, [1.0, 0.0], [0.0, 0.0])
    with pytest.raises(EvaluationError, match="not symmetric"):
        pt.simulate(circle(mass=lambda t, q: [[1.0, 0.3], [0.2, 1.0]]), 1.0, [1.0, 0.0], [0.0, 0.0])


def test_functions_that_end_near_the_start_are_no_wrong_derivatives() -> None:
    """A square root ends where the point is: one-sided functions cannot be differenced, and are believed."""
    slide = pt.System(
        n=2,
        mass=np.eye(2),
        forces=(0.0, 1.0),
        constraints=lambda t, q: [q[0] - math.sqrt(q[1]) ** 2],
        jacobian=lambda t, q: [[1.0, -1.0]],
        bias=lambda t, q, v: [0.0],
    )
    run = pt.simulate(slide, 1.0, [0.0, 0.0], [0.0, 0.0])
    assert run.success and run.q[-1, 0] == pytest.approx(0.25, rel=1e-9)


# ------------------------------------------------- starts that do not satisfy the constraints


def reported(run: pt.results.Result) -> str:
    return " ".join(note for note in run.notes if "initial state violates" in note)


def test_an_inconsistent_start_is_reported() -> None:
    assert not reported(pt.simulate(circle(), 1.0, [1.0, 0.0], [0.0, 1.0]))
    run = pt.simulate(circle(), 1.0, [1.0 + 1e-6, 0.0], [0.0, 1.0])
    assert "constraint 0 has a closure error of 1e-6" in reported(run) and "positions by up to" in reported(run)
    with pytest.raises(
        ArgumentError, match=r"constraint 0 has a closure error of 2; start from the state that assemble"
    ):
        pt.simulate(circle(), 1.0, [1.0, 2.0], [0.0, 0.0])
    run = pt.simulate(circle(), 1.0, [1.0, 0.0], [0.25, 1.0])
    assert "rate error of 0.25 per second" in reported(run) and "velocities by up to 0.25 (x)" in reported(run)


def test_an_inconsistent_start_of_a_mechanism_is_reported() -> None:
    m = pt.catalogue.load("four-bar")
    state = m.assemble(rates={"A": 1.0})
    assert not reported(m.simulate(0.1, initial=state))
    v = state.v.copy()
    v[1] += 0.125
    moved = pt.State(state.t, state.q, v, names=state.names, velocity_names=state.velocity_names)
    run = m.simulate(0.1, initial=moved)
    assert "velocities by up to" in reported(run)
    q = state.q.copy()
    q[1] += 1e-5
    off = pt.State(state.t, q, state.v, names=state.names, velocity_names=state.velocity_names)
    run = m.simulate(0.1, initial=off)
    assert "has a closure error of" in reported(run)
    assert run.success and run.certificate.verdict == "valid"  # closed before it starts, which changes no energy
