"""Through positions in which branches of a mechanism meet: the motion keeps its own, and each is reported."""

from __future__ import annotations

import numpy as np
import pytest
from branches import FAMILIES, FULL, FourBar, mechanism, trial
from thorough import THOROUGH, either

import partita as pt

pytestmark = pytest.mark.filterwarnings("ignore::partita.errors.SuspectResultWarning")


@pytest.mark.parametrize("rtol", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("family", FAMILIES)
def test_motions_keep_their_branch(family: str, rtol: float) -> None:
    """`make trust` does 2000 of these."""
    found = [trial(family, seed, rtol) for seed in range(2 if THOROUGH or rtol < 1e-4 else 1)]
    assert [x.words for x in found if x.outcome != "right"] == []
    assert sum(x.passed for x in found) > 0
    # where two lie close to each other the curve shows one
    assert sum(abs(x.reported - x.passed) for x in found) <= 1, [(x.reported, x.passed, x.words) for x in found]


@pytest.mark.parametrize(
    ("family", "seed", "rtol", "formulation"),
    [
        ("parallelogram", 7, 1e-3, "projective"),
        ("parallelogram", 5, 1e-4, "projective"),
        *either((), (("parallelogram", 9, 1e-4, "projective"), ("folding four-bar", 10, 1e-3, "projective"))),
        ("crossed parallelogram", 9, 1e-3, "projective"),
        ("kite", 2, 1e-3, "projective"),
        ("folding four-bar", 8, 1e-3, "projective"),
        ("parallelogram", 4, 1e-3, "qr"),
        ("parallelogram", 9, 1e-6, "multipliers"),
        ("parallelogram", 4, 1e-6, "range-space"),
    ],
)
def test_dead_points_of_coordinates_hide_no_singular_position(
    family: str, seed: int, rtol: float, formulation: str
) -> None:
    """Where the bar of a parallelogram turns back along x, the links come into one line too: C_D loses two ranks and
    its determinant keeps its sign. `make trust` does 840 of these."""
    seen = trial(family, seed, rtol, formulation, "absolute")
    assert seen.outcome == "right" and seen.steady and seen.reported == seen.passed > 0, seen.words


@pytest.mark.parametrize("formulation", ["fixed", "svd", "gram-schmidt", "wehage-haug", "multipliers", "range-space"])
@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_others_keep_it_or_stop(formulation: str, rtol: float) -> None:
    for seed, family in enumerate(FAMILIES):
        seen = trial(family, seed, rtol, formulation)
        assert seen.outcome != "wrong", seen.words


@pytest.mark.parametrize("formulation", FULL)
@pytest.mark.parametrize(("seed", "rtol"), [(10, 1e-3), *either((), ((4, 1e-4), (12, 1e-4))), (2, 1e-5)])
def test_branches_switched_at_loose_tolerances_are_no_success(formulation: str, seed: int, rtol: float) -> None:
    """Steps that end on another branch, or lose energy there. `make trust` does 525 of these."""
    seen = trial("crossed parallelogram", seed, rtol, formulation)
    assert seen.outcome != "wrong" and seen.steady, seen.words


@pytest.mark.parametrize(
    ("formulation", "seed", "rtol"),
    [
        ("wehage-haug", 33, 1e-4),
        ("explicit-closing", 33, 1e-3),
        *either((), (("tangent-space", 8, 1e-3), ("tangent-space", 22, 1e-3), ("tangent-space", 29, 1e-4))),
        ("tangent-space", 33, 1e-3),
        ("tangent-space", 33, 1e-5),
        ("tangent-space", 20, 1e-6),
    ],
)
def test_forms_in_2k_states_keep_it_at_outputs_next_to_a_passage_too(formulation: str, seed: int, rtol: float) -> None:
    """Two solutions of the closing lie next to each other there. `make trust` does 595 of these."""
    seen = trial("crossed parallelogram", seed, rtol, formulation)
    assert seen.outcome == "right" and seen.steady and seen.reported == seen.passed > 0, seen.words


def test_outputs_beside_a_position_that_is_passed_at_a_distance_are_closed() -> None:
    """Opposite bars that differ by a thousandth: the motion bends sharply where they come into one line, and a
    polynomial through places around it is open by 5e-5."""
    rng = np.random.default_rng([7, 5])
    a, e = rng.uniform(0.5, 1.5), rng.choice([3e-3, 1e-2, 3e-2, 1e-3])
    bars = FourBar(a, 1.0, a * (1 + e * rng.uniform(-1, 1)), 1.0 + e * rng.uniform(-1, 1))
    angle = rng.uniform(0.5, 2.5)
    m = mechanism(bars, np.array([angle, bars.rockers(angle)[int(rng.integers(2))]]), rng)
    start = m.assemble(rates={"A": rng.uniform(1, 4)}, coordinates="absolute")
    t = np.linspace(0.0, 4.0, 300)
    run = m.simulate(
        4.0, t_eval=t, initial=start, coordinates="absolute", rtol=1e-3, atol=1e-5, solver=pt.Solver("wehage-haug")
    )
    assert run.success and run.closure.max() < 1e-12 and run.velocity_closure.max() < 1e-11


def test_forms_in_all_velocities_that_keep_their_branch_are_a_success() -> None:
    for formulation, seed in (("multipliers", 0), ("range-space", 2), ("proximal", 5), ("sparse-multipliers", 7)):
        seen = trial("crossed parallelogram", seed, 1e-4, formulation)
        assert seen.outcome == "right" and seen.passed > 0 and seen.steady, seen.words
    assert trial("crossed parallelogram", 14, 1e-3, "baumgarte").outcome == "right"
