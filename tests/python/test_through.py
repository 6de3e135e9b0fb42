"""Runs as functions of other packages: PyTorch and JAX."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_sensitivities import BY, END, four_bar

import partita as pt
from partita.errors import ArgumentError, IntegrationError, MissingDependencyError
from partita.extras import extra
from partita.mechanism.through import through

NUMBERS = {"l2": 0.9, "m1": 0.3, "rate": 6.0}
TIGHT = {"rtol": 1e-12, "atol": 1e-13}


def module(name: str) -> object:
    """The package, or the test is skipped."""
    try:
        return extra(name, name, "the test")
    except MissingDependencyError:
        pytest.skip(f"{name} is no pinned tool; the function behind it is tested without")


def test_a_run_is_a_function_with_a_way_back() -> None:
    m, by = four_bar()
    m.add_sensor("w", "O", "velocity")
    options = {"initial": m.assemble({"O": 0.0}, {"O": 6.0}), **TIGHT}
    made = through(m, [by[name] for name in NUMBERS], ["O", "w"], 2.0, [1.0, 2.0], options)
    passed = made.forward([np.array(x) for x in NUMBERS.values()])
    assert passed.values.shape == made.shape == (2, 2)
    assert_allclose(passed.values[1] + [1.0, 0.0], END, rtol=1e-9)
    for i in range(2):
        weights = np.zeros((2, 2))
        weights[1, i] = 1.0
        assert_allclose(made.back(passed, weights), [BY[name][i] for name in NUMBERS], rtol=1e-8)


def test_numbers_and_runs_that_do_not_fit_are_refused() -> None:
    m, by = four_bar()
    with pytest.raises(ArgumentError, match="no number of a run"):
        through(m, [pt.end_time], ["O"], 1.0, None, {})
    with pytest.raises(ArgumentError, match="no parameter, nor the length"):
        through(m, ["wheel.length"], ["O"], 1.0, None, {}).forward([np.array(1.0)])
    end = pt.Event("end", "O", value=0.5, terminal=True)
    options = {"initial": m.assemble({"O": 0.0}, {"O": 6.0}), "events": [end]}
    with pytest.raises(IntegrationError, match="ended early"):
        through(m, [by["m1"]], ["O"], 2.0, None, options).forward([np.array(0.3)])


def test_lengths_of_neighbours_change_independently() -> None:
    m, _ = four_bar()
    wanted = {"crank.length": 0.28, "coupler.length": 0.95, "rocker.length": 0.73}
    run = m.simulate(0.1, t_eval=[0.0, 0.1], parameters=pt.lengths(m, wanted))
    points = [np.asarray(run.joint(name).point[-1]) for name in "OABD"]
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert_allclose(gaps, list(wanted.values()), rtol=1e-12)


def test_gradients_in_torch() -> None:
    torch = module("torch")
    import partita.torch

    m, by = four_bar()
    start = m.assemble({"O": 0.0}, {"O": 6.0})
    x = {by[k]: torch.tensor(v, dtype=torch.float64, requires_grad=True) for k, v in NUMBERS.items()}  # type: ignore[attr-defined]
    angle = partita.torch.simulate(m, x, "O", duration=2.0, initial=start, **TIGHT)
    angle.sum().backward()
    assert_allclose([t.grad.item() for t in x.values()], [BY[k][0] for k in NUMBERS], rtol=1e-8)


def example(name: str) -> Any:
    """An example as a module."""
    path = Path(__file__).parents[2] / "examples" / f"{name}.py"
    found = importlib.util.spec_from_file_location(f"{name}_example", path)
    assert found is not None and found.loader is not None
    made = importlib.util.module_from_spec(found)
    sys.modules[found.name] = made
    found.loader.exec_module(made)
    return made


def test_a_policy_is_learned_in_torch() -> None:
    """The example: the way back goes through all runs that follow each other."""
    torch = module("torch")
    policy = example("torch_policy")
    m, network = policy.linkage(), policy.network()
    policy.missed(m, network, 0.8).backward()
    weight, step = network[0].weight, 1e-4
    ends = []
    for move in (step, -2.0 * step):
        with torch.no_grad():  # type: ignore[attr-defined]
            weight[3, 1] += move
        ends.append(policy.missed(m, network, 0.8).item())
    assert_allclose(weight.grad[3, 1].item(), (ends[0] - ends[1]) / (2.0 * step), rtol=1e-4)
    left = policy.learned(m, network, 12)
    assert left[-1] < 0.2 * left[0]


def test_gradients_in_jax() -> None:
    jax = module("jax")
    import partita.jax

    jax.config.update("jax_enable_x64", True)  # type: ignore[attr-defined]
    m, by = four_bar()
    start = m.assemble({"O": 0.0}, {"O": 6.0})

    def angle(values: tuple[float, ...]) -> object:
        x = dict(zip([by[k] for k in NUMBERS], values, strict=True))
        return partita.jax.simulate(m, x, "O", duration=2.0, initial=start, **TIGHT)[0, 0]

    found = jax.jit(jax.grad(angle))(tuple(NUMBERS.values()))  # type: ignore[attr-defined]
    assert_allclose(found, [BY[k][0] for k in NUMBERS], rtol=1e-8)


def test_four_designs_come_out_as_known() -> None:
    """The example: a coupler curve, a valve train, the toe of a wheel, a swing-up."""
    assert example("synthesis").main() == 0
