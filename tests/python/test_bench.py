"""What the bench measures is what it says: mechanisms of many degrees of freedom, and programs that meet the known
answers."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import partita as pt

BENCHES = Path(__file__).parents[2] / "benches"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The modules of the bench, imported as its script does."""
    monkeypatch.syspath_prepend(str(BENCHES))
    yield importlib.import_module("sections")
    for path in BENCHES.glob("*.py"):
        sys.modules.pop(path.stem, None)


@pytest.mark.parametrize(
    "kind, size, dof",
    [
        ("side by side", 3, 3),
        ("in series", 3, 3),
        ("ring", 5, 3),
        ("open chain", 4, 4),
        ("five-bar loops", 3, 4),
        ("four-bar chain", 3, 1),
    ],
)
def test_mechanisms_have_as_many_degrees_of_freedom(bench: ModuleType, kind: str, size: int, dof: int) -> None:
    m = sys.modules["many_dof"].MECHANISMS[kind](size)
    assert m.compile().mobility == dof
    run = m.simulate(0.01, t_eval=[0.01])
    assert run.success and run.closure.max(initial=0.0) < 1e-12


@pytest.mark.parametrize(
    "kind, size",
    [
        ("side by side", 130),
        ("in series", 100),
        ("ring", 200),
        ("open chain", 400),
        ("five-bar loops", 90),
        ("four-bar chain", 400),
    ],
)
def test_machine_code_in_loops_moves_many_parts_as_without_to_the_bit(bench: ModuleType, kind: str, size: int) -> None:
    m = sys.modules["many_dof"].MECHANISMS[kind](size)
    start = m.assemble(rates={"P0": -1.0} if kind == "four-bar chain" else None)
    plain, run = (m.simulate(0.01, t_eval=[0.0, 0.01], initial=start, step=2e-3, compiled=c) for c in (False, True))
    assert plain.counters["compiled_evaluations"] == 0 < run.counters["compiled_evaluations"]
    for name in ("q", "v", "vdot", "multipliers"):
        assert np.array_equal(getattr(run, name), getattr(plain, name)), name


ALL_COORDINATES = (
    "wehage-haug",
    "svd",
    "qr",
    "liang-lance",
    "gram-schmidt",
    "zero-eigenvalue",
    "tangent-space",
    "sparse-multipliers",
)
"""Formulations that choose or solve with one matrix for the whole mechanism."""


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize(
    "kind, size",
    [
        ("side by side", 20),
        ("in series", 20),
        ("ring", 30),
        ("open chain", 40),
        ("five-bar loops", 25),
        ("four-bar chain", 30),
    ],
)
def test_formulations_move_many_parts_alike(bench: ModuleType, kind: str, size: int, coordinates: str) -> None:
    m = sys.modules["many_dof"].MECHANISMS[kind](size)
    start = m.assemble(rates={"P0": -1.0} if kind == "four-bar chain" else None)
    start = start if coordinates == "relative" else m.convert(start, coordinates)
    options = {"initial": start, "coordinates": coordinates, "t_eval": [0.02]}
    expected = m.simulate(0.02, **options)
    for formulation in ALL_COORDINATES:
        run = m.simulate(0.02, solver=pt.Solver(formulation), **options)
        assert run.success, (formulation, run.message)
        assert np.allclose(run.q, expected.q, rtol=0.0, atol=1e-7), formulation
        assert np.allclose(run.v, expected.v, rtol=0.0, atol=1e-6), formulation


def test_programs_of_the_limit_meet_the_known_answers(bench: ModuleType, tmp_path: Path) -> None:
    limit = sys.modules["limit"]
    built = limit.compiled(tmp_path)
    if not built:
        pytest.skip("there is no C compiler here")
    assert set(built) == {"andrews", "chain", "four_bar"}
    for title, figure in limit.measured(tmp_path).items():
        # errors grow about 1e4 in 10 s of turns through the top, from rtol 1e-10
        assert figure.error < 1e-5, title
        assert figure.evaluations > 1000 and 0.0 < figure.alone < figure.seconds, title


@pytest.mark.parametrize("number", [0, 1])
def test_linkages_for_other_programs_are_the_mechanisms(bench: ModuleType, tmp_path: Path, number: int) -> None:
    """Read back from the file that the other programs read: bodies, pins, rates, and the known answer."""
    rivals, planar = importlib.import_module("rivals"), importlib.import_module("planar")
    of = rivals.LINKAGES[number]
    made, m, start = rivals.linkage(of)
    made.write(tmp_path / "linkage.json")
    problem = planar.Problem.read(str(tmp_path / "linkage.json"))
    assert problem.bodies[0] == of.first and len(problem.bodies) == len(problem.tree) == len(m.bodies)
    assert len(problem.loops) == len(m.joints) - len(m.bodies)
    velocity = np.zeros((len(problem.bodies), 2))
    for pin in problem.tree:  # outward from the ground
        for body, sign in ((pin.parent, 1.0), (pin.child, -1.0)):
            if body >= 0:
                x, y = pin.point - problem.centres[body]
                at = velocity[body] if sign > 0 else np.zeros(2)
                velocity[pin.child] += sign * at + problem.rates[body] * sign * np.array([-y, x])
    here = m.simulate(1e-6, t_eval=[0.0], initial=start)
    for i, name in enumerate(problem.bodies):
        body = here.body(name)
        arm = np.append(problem.centres[i] - body.position[0, :2], 0.0)
        known = body.velocity[0] + np.cross(body.angular_velocity[0], arm)
        np.testing.assert_allclose(velocity[i], known[:2], atol=1e-13)
    run = m.simulate(of.duration, t_eval=[of.duration], initial=start, rtol=1e-10, atol=1e-12)
    turned = run.body(of.first).rotation[-1]
    assert problem.error(np.arctan2(turned[1, 0], turned[0, 0])) < rivals.AIM
