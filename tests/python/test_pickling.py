"""Mechanisms and compiled models travel between processes and are copied."""

import copy
import functools
import multiprocessing
import pickle
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest
from moved_drawings import as_typed

import partita as pt
from partita.builder.compiled import CompiledModel
from partita.errors import DescriptionError


def swing(t: float) -> float:
    return 0.1 * t**2


def swing_rate(t: float) -> float:
    return 0.2 * t


def swing_acceleration(t: float) -> float:
    return 0.2


def push(t: float, state: pt.State, size: float = 1.0) -> float:
    return size * float(np.cos(t)) - 0.1 * float(state.velocity("D"))


def wind(t: float, state: pt.State) -> tuple[float, float, float]:
    return (0.1, 0.0, 0.0)


def driven() -> pt.Mechanism:
    """A four-bar with every kind of user function, a table and springs, and a pendulum that nothing drives."""
    m = pt.catalogue.load("four-bar")
    bob = m.add_rod("bob", start=(1, 0, 0), end=(1, -1, 0), mass=0.2)
    m.add_revolute("P", m.ground, bob, point=(1, 0, 0))
    m.add_drive("A", swing, velocity=swing_rate, acceleration=swing_acceleration)
    m.add_torque("D", functools.partial(push, size=2.0))
    m.add_torque("D", ((0.0, 1.0, 2.0), (0.0, 1.0, 0.5)))
    m.add_force(bob, wind)
    m.add_torsion_spring("P", stiffness=3.0)
    return m


def final(m: pt.Mechanism) -> list[float]:
    """What a worker does: simulate, and return the last coordinates."""
    run = m.simulate(0.3, t_eval=[0.3])
    assert run.success
    return [float(x) for x in run.q[-1]]


def energy_matrix(model: CompiledModel) -> list[list[float]]:
    rows: list[list[float]] = model.mass_matrix(np.zeros(len(model.names))).tolist()
    return rows


def refuses(length: float) -> None:
    """A worker that fails: the error has to travel back."""
    pt.Mechanism("m").add_rod("bar", start=(0, 0, 0), end=(length, 0, 0), mass=-1.0)


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as executor:
        yield executor


@as_typed
def test_a_mechanism_travels_to_another_process(pool: ProcessPoolExecutor) -> None:
    m = driven()
    assert pool.submit(final, m).result() == final(m)


@as_typed
def test_a_model_travels_to_another_process(pool: ProcessPoolExecutor) -> None:
    for model in (driven().compile(), pt.catalogue.load("four-bar").compile("absolute")):
        assert pool.submit(energy_matrix, model).result() == energy_matrix(model)


def test_an_error_travels_back(pool: ProcessPoolExecutor) -> None:
    with pytest.raises(DescriptionError, match="mass is -1"):
        pool.submit(refuses, 1.0).result()


def test_a_pickled_mechanism_is_the_same_and_goes_on_growing() -> None:
    m = driven()
    m.compile()
    twin = pickle.loads(pickle.dumps(m))
    assert twin.to_spec() == m.to_spec() and repr(twin) == repr(m)
    assert twin.ground.mechanism is twin
    rod = twin.add_rod("more", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    twin.add_revolute("more", twin.ground, rod, point=(0, 0, 0))
    assert "more" not in m.bodies and twin.compile().mobility == m.compile().mobility + 1


def test_handles_travel_with_their_mechanism() -> None:
    m = driven()
    twin, body = pickle.loads(pickle.dumps((m, m.ground)))
    assert body.mechanism is twin and body is twin.ground


def test_a_deep_copy_is_independent_and_keeps_functions() -> None:
    m = driven()
    m.add_torque("P", lambda t, state: 0.01 * t)
    twin = copy.deepcopy(m)
    assert twin.to_spec() == m.to_spec() and final(twin) == final(m)
    twin.add_torque("P", 1.0)
    assert len(twin.forces) == len(m.forces) + 1


def test_a_model_is_its_own_copy_and_outlives_its_mechanism() -> None:
    m = driven()
    model = m.compile()
    assert copy.copy(model) is model and copy.deepcopy(model) is model
    before = energy_matrix(model)
    m.add_rod("late", start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    again = pickle.loads(pickle.dumps(model))
    assert energy_matrix(again) == before and again.names == model.names and again.notes == model.notes


@pytest.mark.parametrize("where", ["drive", "torque", "force"])
def test_a_function_that_cannot_travel_is_named(where: str) -> None:
    m = driven()
    if where == "drive":
        m.add_drive("P", lambda t: 0.1 * t, name="local")
    elif where == "torque":
        m.add_torque("P", lambda t, state: 0.1, name="local")
    else:
        m.add_force("bob", lambda t, state: (0.0, 0.0, 0.1), name="local")
    for thing in (m, m.compile()):
        with pytest.raises(DescriptionError, match=r'"local".*lambda.*top level') as caught:
            pickle.dumps(thing)
        assert caught.value.name == "local"
