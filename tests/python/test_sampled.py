"""Functions sampled as tables: the stated error holds, and files, playgrounds and FMUs take them."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.builder import SampledTable


@pytest.mark.parametrize(
    ("function", "end", "tolerance"),
    [
        (np.sin, 10.0, 1e-9),
        (np.exp, 3.0, 1e-10),
        (lambda t: 1.0 / (1.0 + 50.0 * (t - 0.3) ** 2), 1.0, 1e-7),
        (lambda t: 2.0 * t - 1.0, 1.0, 1e-12),
        (lambda t: 0.0, 1.0, 1e-9),
        (lambda t: [np.sin(t), 1.0, t], 2.0, 1e-8),
        (lambda t: abs(t), 1.0, 1e-9),
    ],
)
def test_the_error_holds_between_the_samples(function, end, tolerance) -> None:  # type: ignore[no-untyped-def]
    from scipy.interpolate import CubicSpline

    found = pt.table(function, 0.0, end, tolerance)
    at = np.random.default_rng(3).uniform(0.0, end, 4000)
    wanted = np.array([function(t) for t in at])
    off = np.abs(CubicSpline(found.times, found.values)(at) - wanted).max()
    size = np.abs(wanted).max()
    assert off <= 1.02 * max(tolerance * size, 1e-16) and found.error <= tolerance * max(size, 1e-300)
    assert np.array_equal(found.values, [function(t) for t in found.times])


def test_steps_are_as_few_as_halving_finds() -> None:
    counts = [len(pt.table(np.sin, 0.0, 10.0, 10.0**-k).times) - 1 for k in (3, 6, 9, 12)]
    assert counts == sorted(counts) and counts[-1] <= 256 * counts[0]  # errors are of order 4: 1e9 is 178^4
    calls: list[float] = []
    pt.table(lambda t: calls.append(t) or np.sin(t), 0.0, 10.0, 1e-9)  # type: ignore[func-returns-value]
    assert len(calls) < 12 * counts[2]


KINKS = (lambda t: abs(t - 1.0 / 3.0), lambda t: float(t > 0.5))


@pytest.mark.parametrize("function", KINKS)
def test_kinks_and_jumps_are_refused_where_they_are(function) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(pt.errors.ArgumentError, match=r"65536 steps from 0 to 1 is off by .* kink or a jump"):
        pt.table(function, 0.0, 1.0)


def shaker(law: object) -> pt.Mechanism:
    m = pt.Mechanism("shaker", gravity=None)
    m.add_body("plate", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("guide", m.ground, "plate", axis=(0, 1, 0))
    m.add_torque("guide", law, name="push")  # type: ignore[arg-type]
    return m


def force(t: float) -> float:
    return float(3.0 * np.cos(4.0 * t))


def test_a_load_is_joined_smoothly_also_from_files_and_after_changes(tmp_path: Path) -> None:
    law = pt.table(force, 0.0, 2.0, 1e-9)
    m = shaker(law)
    exact = -3.0 / 2.0 / 16.0 * (np.cos(8.0) - 1.0)
    options = {"rtol": 1e-11, "atol": 1e-13}
    run = m.simulate(2.0, **options)
    assert abs(run.joint("guide").displacement[-1] - exact) < 1e-8
    plain = shaker((law.times, law.values)).simulate(2.0, **options)
    off = [np.abs(one.force("push").effort - 3.0 * np.cos(4.0 * one.t)).max() for one in (run, plain)]
    assert off[0] < 4e-9 and off[1] > 1e-6  # plain tables of loads are joined without overshoot
    again = pt.load(m.save(tmp_path / "shaker.toml").path)
    assert again.to_spec() == m.to_spec() and 'interpolation = "spline"' in (tmp_path / "shaker.toml").read_text()
    m.bodies["plate"].mass = 3.0
    m.bodies["plate"].mass = 2.0
    assert again.to_spec() == m.to_spec()
    assert isinstance(m.forces["push"].value, SampledTable)
    vector = pt.table(lambda t: (force(t), 0.0, 1.0), 0.0, 2.0, 1e-9)
    other = shaker(0.0)
    other.add_force("plate", vector, name="F")
    assert pt.load(other.save(tmp_path / "other.toml").path).to_spec() == other.to_spec()


def test_a_drive_and_a_cam() -> None:
    lift = pt.table(lambda t: 0.01 * np.sin(2.0 * t), 0.0, 3.0)
    m = pt.Mechanism("cam")
    for name in ("plate", "valve"):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("guide", m.ground, "plate", axis=(0, 1, 0))
    m.add_prismatic("lift", m.ground, "valve", axis=(0, 1, 0))
    m.add_drive("guide", position=lift)
    m.add_cam("lift", "guide", pt.table(lambda x: x + 5.0 * x**2, -0.02, 0.02))
    run = m.simulate(3.0)
    x = 0.01 * np.sin(2.0 * run.t)
    assert np.abs(run.joint("guide").displacement - x).max() < 1e-10
    assert np.abs(run.joint("lift").displacement - x - 5.0 * x**2).max() < 1e-9
    drive = next(iter(m.drives.values()))
    drive.change(position=None, velocity=pt.table(lambda t: 0.01 * np.cos(t), 0.0, 3.0))
    assert np.abs(m.simulate(3.0).joint("guide").displacement - 0.01 * np.sin(run.t)).max() < 1e-9
    assert isinstance(drive.velocity, SampledTable)


def accelerated(law: Any, rate: float = 0.1) -> pt.Mechanism:
    m = pt.Mechanism("shaker", gravity=None)
    m.add_body("plate", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("guide", m.ground, "plate", axis=(0, 1, 0))
    m.add_drive("motor", "guide", acceleration=law, rate=rate)
    return m


def test_a_drive_of_accelerations_keeps_the_error_of_its_table(tmp_path: Path) -> None:
    """Its rate is made of cubics, the integral of a spline of quartics: the steps between are as short as that asks."""
    law = pt.table(lambda t: 3.0 * np.cos(4.0 * t), -0.5, 2.0)
    m = accelerated(law)
    run = m.simulate(2.0, rtol=1e-11, atol=1e-13)
    guide, t = run.joint("guide"), run.t
    assert np.abs(guide.acceleration[:, 0] - 3.0 * np.cos(4.0 * t)).max() < 2e-9 * 3.0
    assert np.abs(guide.velocity[:, 0] - 0.1 - 0.75 * np.sin(4.0 * t)).max() < 1e-9
    assert np.abs(guide.displacement - 0.1 * t - 3.0 / 16.0 * (1.0 - np.cos(4.0 * t))).max() < 1e-9
    straight = accelerated((law.times, law.values))
    coarse = straight.simulate(2.0).joint("guide").acceleration[:, 0]
    assert np.abs(coarse - 3.0 * np.cos(4.0 * t)).max() > 1e-6  # plain tables are joined by straight lines
    for each in (m, straight):
        path = each.save(tmp_path / "shaker.toml").path
        assert pt.load(path).to_spec() == each.to_spec()
        assert ('interpolation = "spline"' in path.read_text("utf-8")) == (each is m)
        assert isinstance(each.drives["motor"].acceleration, SampledTable) == (each is m)
        wanted = each.to_spec()
        each.bodies["plate"].mass = 3.0
        each.bodies["plate"].mass = 2.0  # tables of accelerations are made again as they are
        assert each.to_spec() == wanted
    assert m.to_playground(tmp_path / "x.html").stat().st_size > 10_000
    few = accelerated(SampledTable([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0])).to_spec()
    assert 300 < len(few["drives"][0]["motion"]["table"]["breaks"]) < 3000  # of a spline that is far from a parabola
    assert accelerated(SampledTable([0.0, 1.0], [0.0, 0.0]), 0.0).simulate(0.5).joint("guide").displacement.max() == 0.0


def test_pages_and_copies_take_tables(tmp_path: Path) -> None:
    m = shaker(pt.table(force, 0.0, 2.0, 1e-6))
    assert m.to_playground(tmp_path / "x.html").stat().st_size > 10_000
    assert copy.deepcopy(m).to_spec() == pickle.loads(pickle.dumps(m)).to_spec() == m.to_spec()
    law = pt.table(force, 0.0, 2.0, 1e-6)
    for twin in (copy.deepcopy(law), pickle.loads(pickle.dumps(law))):
        assert isinstance(twin, SampledTable) and twin.error == law.error and np.array_equal(twin.values, law.values)
    assert repr(law).startswith(f"<table of {len(law.times)} values, 0 to 2, within ")


def test_what_is_no_function_is_refused() -> None:
    for arguments, words in (
        ((3.0, 0.0, 1.0), "a function of one number"),
        ((np.sin, 1.0, 1.0), "must have a length, not 1 to 1"),
        ((np.sin, "0", 1.0), "start must be a number"),
        ((np.sin, 0.0, np.inf), "end is inf"),
        ((np.sin, 0.0, 1.0, 0.0), "greater than zero"),
        ((lambda t: "x", 0.0, 1.0), "must return a number"),
        ((lambda t: np.nan, 0.0, 1.0), "finite numbers"),
        ((lambda t: [1.0] * (1 + (t > 0.5)), 0.0, 1.0), "equally many everywhere"),
        ((lambda t: np.eye(2), 0.0, 1.0), "finite numbers"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words):
            pt.table(*arguments)  # type: ignore[arg-type]
