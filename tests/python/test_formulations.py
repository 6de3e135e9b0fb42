"""Every formulation and every rule on the mechanisms of the catalogue: one motion, loops closed, energy kept, bodies
in balance, the same in absolute and in joint coordinates. Random mechanisms, orders, drift: see the core's tests.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita import options
from partita.builder.compiled import CompiledModel
from partita.catalogue import Entry
from partita.results import Result
from partita.solver import grouped
from partita.state import State

# Part of the published run that the test marches: long enough for renewals and switches, short enough for all methods.
MECHANISMS = {
    "planar-pendulum": 0.3,
    "four-bar": 0.2,
    "slider-crank": 0.3,
    "watt-six-bar": 0.3,
    "stephenson-six-bar": 0.3,
    "three-rrr": 0.3,
    "andrews-squeezer": 0.3,
    "bricard": 0.1,
    "rssr": 0.3,
}
FORMULATIONS = [name for name in options.FORMULATIONS if name != "baumgarte"]
RTOL = 1e-10
# Global error of a run at 1e-10, amplified along motions that nearly stop (1e4 for the standing four-bar).
SAME = 1e-5


def tangent(model: CompiledModel, state: State) -> pt.TangentVelocities:
    """As a user might write them, and no partition: combinations of the directions of the one chosen at the start, the
    same at all times; redundant rows are harmless."""
    chosen = pt.partition.choose(model.mass_matrix(state.q), model.jacobian(state.q))
    i, d = list(chosen.independent), list(chosen.dependent)
    k = len(i)
    mix = np.eye(k) + 0.8 / max(k, 1) * np.sin(1.0 + 3.0 * np.arange(k)[:, None] + 5.0 * np.arange(k))

    def directions(t: float, q: np.ndarray) -> np.ndarray:
        c = model.jacobian(q, t=t)
        full = np.zeros((len(i), c.shape[1]))
        full[:, i] = np.eye(len(i))
        full[:, d] = -np.linalg.lstsq(c[:, d], c[:, i], rcond=None)[0].T
        return mix @ full

    def bias(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        c = model.jacobian(q, t=t)
        delta = np.zeros(c.shape[1])
        delta[d] = -np.linalg.lstsq(c[:, d], model.bias(q, v, t=t), rcond=None)[0]
        return delta

    return pt.TangentVelocities(directions, bias=bias)


@cache
def problem(name: str) -> tuple[Entry, pt.Mechanism, State, np.ndarray]:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    duration = MECHANISMS[name] * entry.duration
    return entry, m, entry.initial(m), np.linspace(0.0, duration, 41)


def march(name: str, formulation: str, **more: Any) -> Result:
    entry, m, start, times = problem(name)
    if formulation == "user-tangent":
        more["tangent"] = tangent(m.compile(), start)
    return m.simulate(
        times[-1],
        t_eval=times,
        initial=start,
        rtol=RTOL,
        atol=RTOL * scale(entry),
        **grouped({"formulation": formulation, **more}),
    )


def scale(entry: Entry) -> float:
    """The squeezer lives in milliseconds and centimetres."""
    return 1e-2 if entry.name != "andrews-squeezer" else 1e-3


@cache
def reference(name: str) -> Result:
    return march(name, "projective")


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("name", MECHANISMS)
def test_one_motion(name: str, formulation: str) -> None:
    """Invariants (a), (b), (c), (g) of every row of the catalogue of algorithms."""
    _, m, start, _ = problem(name)
    run, known = march(name, formulation), reference(name)
    assert run.success, run.message
    # (a) accelerations at the start, where nothing was integrated yet, equal those of the full equations
    vdot, _ = m.compile().acceleration(start.q, start.v)
    assert np.abs(run.vdot[0] - vdot).max() <= 1e-10 * np.abs(vdot).max()
    # (b) loops and their rates at round-off of the lengths and speeds
    speed = 1.0 + np.abs(run.v).max()
    assert run.closure.max() <= 1e-13
    assert run.velocity_closure.max() <= 1e-13 * speed
    # (c) energy, work of drives and dampers included
    energy = run.energy
    size = np.abs(energy.kinetic).max() + np.ptp(energy.potential)
    assert np.abs(energy.balance).max() <= 1e-7 * size
    # (g) every body is in balance with what its joints are said to do
    assert run.certificate.newton_euler <= 1e-9
    # one motion: positions of all bodies
    off = np.abs(run.at_once.observed["body_position"] - known.at_once.observed["body_position"]).max()
    assert off <= SAME


@pytest.mark.parametrize("name", MECHANISMS)
def test_absolute_coordinates_give_the_same(name: str) -> None:
    """Invariant (f)."""
    _, m, start, times = problem(name)
    run = m.simulate(times[-1], t_eval=times, initial=start, coordinates="absolute", rtol=RTOL, atol=1e-2 * RTOL)
    known = reference(name)
    assert run.success, run.message
    off = np.abs(run.at_once.observed["body_position"] - known.at_once.observed["body_position"]).max()
    assert off <= SAME
    assert run.certificate.newton_euler <= 1e-9


# the user's directions of this test lose digits where they go bad, and the run says so: 4e-7 of the path
@pytest.mark.filterwarnings("ignore:.*the energy balance is off by [1-4]:partita.errors.SuspectResultWarning")
@pytest.mark.parametrize("formulation", [f for f in FORMULATIONS if f != "explicit-closing"])
def test_every_formulation_in_absolute_coordinates(formulation: str) -> None:
    _, m, start, times = problem("four-bar")
    start = m.convert(start, "absolute")
    if formulation == "user-tangent":
        # that of one coordinate, and no single coordinate of a body is free of dead points over so much motion
        times = times[times < 1.0]
    own = tangent(m.compile("absolute"), start) if formulation == "user-tangent" else None
    run = m.simulate(
        times[-1],
        t_eval=times,
        initial=start,
        coordinates="absolute",
        solver=pt.Solver(formulation, tangent=own),
        rtol=RTOL,
        atol=1e-2 * RTOL,
    )
    if formulation == "fixed":
        # nor is the one that is kept here
        assert run.status == "singular" and "coupler.x are at a dead point" in run.message
        assert 1.0 < run.t[-1] < times[-1]
    else:
        assert run.success, run.message
    known = reference("four-bar").at_once.observed["body_position"][: len(run.t)]
    assert np.abs(run.at_once.observed["body_position"] - known).max() <= SAME


@pytest.mark.parametrize("selection", options.SELECTIONS)
@pytest.mark.parametrize("name", ["four-bar", "three-rrr", "andrews-squeezer", "rssr"])
def test_every_rule_of_choice_gives_the_motion(name: str, selection: str) -> None:
    """A rule may be bad, not wrong: what it integrates is the same motion as long as its choice is admissible."""
    entry, *_ = problem(name)
    more = {"window": 0.2 * entry.duration} if selection == "persistence" else {}
    run = march(name, "projective", selection=selection, **more)
    known = reference(name)
    rows = len(run.t)
    assert rows > 1
    off = np.abs(run.at_once.observed["body_position"] - known.at_once.observed["body_position"][:rows]).max()
    assert off <= SAME
    assert run.success or selection in {"individual", "determinant", "complete-pivoting"}, run.message


def test_baumgarte_needs_its_parameters_and_says_what_it_leaves_open() -> None:
    with pytest.raises(pt.errors.ArgumentError, match="baumgarte"):
        march("four-bar", "baumgarte")
    run = march("four-bar", "baumgarte", baumgarte=(20.0, 20.0))
    assert run.success
    assert 1e-15 < run.closure.max() < 1e-6  # stabilised, not closed
    assert any("closed" in note for note in run.notes)
    off = np.abs(run.at_once.observed["body_position"] - reference("four-bar").at_once.observed["body_position"]).max()
    assert off <= SAME


@pytest.mark.parametrize("correction", options.CORRECTIONS)
@pytest.mark.parametrize("formulation", ["projective", "svd", "multipliers"])
def test_corrections(formulation: str, correction: str) -> None:
    """Closed to round-off by either correction; without one the drift stays and is seen."""
    run = march("four-bar", formulation, correction=correction)
    assert run.success
    if correction == "none":
        assert 1e-13 < run.closure.max() < 1e-6
    else:
        assert run.closure.max() < 1e-14


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_every_formulation_takes_user_systems(formulation: str) -> None:
    """The reference four-bar in link angles, its loop closed explicitly by hand for the row that asks for it."""
    run, times = user_defined(formulation)
    assert run.success, run.message
    known, _ = user_defined("projective")
    assert np.abs(run.q - known.q).max() < 1e-7
    assert run.closure.max() < 1e-13
    assert len(run.t) == len(times)


def test_the_front_sorts_words_that_the_core_knows() -> None:
    """The words come from the core; what the front says of some of them is said of words that are there."""
    assert {*options.TANGENTS, *options.WHOLE} < set(options.FORMULATIONS)
    firsts = (options.METHODS[0], options.FORMULATIONS[0], options.SELECTIONS[0])
    assert firsts == ("dop853", "projective", "collective")
    assert set(options.SELECTIONS) - set(pt.partition.SELECTIONS) == {"persistence"}


def test_a_closing_that_does_not_close_is_refused() -> None:
    """Closure is by construction, and the construction is the user's: it is looked at in every evaluation."""
    ring = pt.System(
        2,
        mass=np.eye(2),
        forces=(0.0, -9.81),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
        names=["x", "y"],
        closing=("y", lambda t, q: [-0.7]),
    )
    with pytest.raises(pt.errors.ArgumentError, match=r"closure error of .* in constraint 0"):
        pt.simulate(ring, 0.3, [0.6, -0.8], [0.0, 0.0], solver=pt.Solver("explicit-closing"))


LENGTHS, GROUND = np.array([1.0, 2.5, 2.0]), 2.2


def user_defined(formulation: str) -> tuple[Result, np.ndarray]:
    """Links of 1 kg/m in angles against the ground."""
    mass = LENGTHS.copy()
    own, centre = mass * LENGTHS**2 / 12, LENGTHS / 2
    a = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                arm = [LENGTHS[x] if x < k else centre[x] if x == k else 0.0 for x in (i, j)]
                a[i, j] += mass[k] * arm[0] * arm[1]
    first = np.array([mass[i] * centre[i] + LENGTHS[i] * mass[i + 1 :].sum() for i in range(3)])
    inertia = a + np.diag(own)

    def forces(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        swing = a * np.sin(q[:, None] - q[None, :])
        return -swing @ v**2 - 9.81 * first * np.cos(q)

    def close(t: float, q: np.ndarray) -> np.ndarray:
        r = np.array([GROUND, 0.0]) - LENGTHS[0] * np.array([np.cos(q[0]), np.sin(q[0])])
        far = np.hypot(*r)
        phi2 = np.arctan2(r[1], r[0]) + np.arccos((LENGTHS[1] ** 2 + far**2 - LENGTHS[2] ** 2) / (2 * LENGTHS[1] * far))
        rest = r - LENGTHS[1] * np.array([np.cos(phi2), np.sin(phi2)])
        return np.array([phi2, np.arctan2(rest[1], rest[0])])

    def jacobian(t: float, q: np.ndarray) -> np.ndarray:
        return np.array([-LENGTHS * np.sin(q), LENGTHS * np.cos(q)])

    def directions(t: float, q: np.ndarray) -> np.ndarray:
        s = LENGTHS[[1, 2, 0]] * LENGTHS[[2, 0, 1]] * np.sin(q[[2, 0, 1]] - q[[1, 2, 0]])
        return np.array([s / s[0]])

    system = pt.System(
        3,
        mass=lambda t, q: a * np.cos(q[:, None] - q[None, :]) + np.diag(own),
        forces=forces,
        constraints=lambda t, q: [LENGTHS @ np.cos(q) - GROUND, LENGTHS @ np.sin(q)],
        jacobian=jacobian,
        bias=lambda t, q, v: [-LENGTHS @ (np.cos(q) * v**2), -LENGTHS @ (np.sin(q) * v**2)],
        names=["crank", "coupler", "rocker"],
        closing=(["coupler", "rocker"], close),
    )
    assert np.all(np.linalg.eigvalsh(inertia) > 0)
    q = np.array([0.8, 0.0, 0.0])
    q[1:] = close(0.0, q)
    v = 1.5 * directions(0.0, q)[0]
    times = np.linspace(0.0, 1.0, 11)
    velocities = pt.TangentVelocities(directions) if formulation == "user-tangent" else None
    solver = pt.Solver(formulation, tangent=velocities)
    run = pt.simulate(system, 1.0, q, v, t_eval=times, solver=solver, rtol=RTOL, atol=1e-12)
    return run, times


def test_every_algorithm_has_a_name_a_file_and_a_test() -> None:
    """The table of algorithms in docs/formulations.md: its files exist, its names are options that run."""
    root = Path(__file__).parents[2]
    page = (root / "docs" / "formulations.md").read_text("utf-8")
    section = page.split("## Sources and tests of each algorithm")[1].split("\n## ")[0]
    rows = [line.split(" | ") for line in section.splitlines()[8:]]
    rows = [[cell.strip("| ") for cell in row] for row in rows if len(row) == 5]
    assert len(rows) >= 24 and len({row[0] for row in rows}) == len(rows)
    m = pt.catalogue.load("four-bar")
    start = pt.catalogue.entry("four-bar").initial(m)
    named: set[str] = set()
    for name, _, words, source, test in rows:
        for file in (source, test):
            crate, _, rest = file.partition("/")
            assert (
                root / (file if file.startswith("tests/python/") else f"crates/partita-{crate}/{rest}")
            ).is_file(), file
        for word in re.findall(r"`([^`]+)`", words):
            given = dict(re.findall(r'(\w+)="?([^",]+)"?', word))
            named |= set(given.values())
            if not given:  # an attribute
                where = Result if word.startswith("Result.") else pt.partition
                assert hasattr(where, word.split(".")[1]), word
                continue
            asked: dict[str, Any] = dict(given)
            if "switch_threshold" in given:
                asked["switch_threshold"] = float(given["switch_threshold"])
            if given.get("selection") == "persistence":
                asked["window"] = 0.1
            if given.get("formulation") == "baumgarte":
                asked["baumgarte"] = (10.0, 10.0)
            if given.get("formulation") != "user-tangent":
                assert m.simulate(0.1, initial=start, **grouped(asked)).success, (name, word)
    assert named >= {
        *options.FORMULATIONS,
        *options.SELECTIONS,
        "partition",
        "kantorovich",
        "mass-orthogonal",
        "each step",
    }
