"""Ensembles: every member is its ordinary run, whatever runs beside it."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest
from pressing import pressed_after

import partita as pt

TIMES = np.linspace(0.0, 1.0, 5)
"""Of the outputs [s]; the first is the start."""


def started(m: pt.Mechanism, widest: float, count: int) -> list[pt.State]:
    """States of the drawing, its first coordinate at rates by chance."""
    first = m.compile().velocity_names[0]
    rates = np.random.default_rng(1).uniform(-widest, widest, count)
    return [m.assemble(rates={first: float(rate)}) for rate in rates]


def agree(found, every: int, tolerance: float) -> None:
    """Members, one of so many, with their ordinary runs."""
    for i in range(0, len(found), every):
        run = found.result(i)
        assert run.success == bool(found.success[i])
        assert run.status == found.status[i]
        scale = 1.0 + np.abs(run.q).max()
        assert np.abs(run.q - found.q[i]).max() < tolerance * scale, i
        assert np.abs(run.v - found.v[i]).max() < 100 * tolerance * (1.0 + np.abs(run.v).max()), i


@pytest.mark.parametrize(
    ("name", "widest"),
    [
        ("grashof-four-bar", 9.0),  # turns over, with several choices of coordinates
        ("slider-crank", 9.0),
        ("watt-six-bar", 5.0),
        ("spatial-four-bar", 5.0),  # not planar
        ("parallelogram", 9.0),  # passes change points
    ],
)
def test_members_are_their_ordinary_runs(name, widest):
    """Errors accumulate to some hundred tolerances, in one run as in the other, where a motion turns over."""
    m = pt.catalogue.load(name)
    found = m.ensemble(states=started(m, widest, 96), t_eval=TIMES)
    assert found.success.all()
    assert found.in_lanes.sum() > 0.4 * len(found)
    assert found.q.shape == (96, len(TIMES), len(m.compile().names))
    agree(found, 8, 1e-6)


@pytest.mark.parametrize("name", ["parallel-ankle", "heavy-top", "three-rrr", "planar-pendulum"])
def test_several_degrees_of_freedom_quaternions_and_none_that_is_closed(name):
    m = pt.catalogue.load(name)
    start = m.assemble()
    states = [pt.State(0.0, start.q, start.v * f, layout=start._layout) for f in np.linspace(0.2, 1.5, 80)]
    found = m.ensemble(states=states, t_eval=TIMES[1:])
    assert found.in_lanes.any()
    agree(found, 16, 1e-6)


def test_loops_are_closed_at_every_output():
    m = pt.catalogue.load("grashof-four-bar")
    found = m.ensemble(states=started(m, 9.0, 64), t_eval=np.linspace(0.0, 1.0, 101))
    model = m.compile()
    for q in found.q[::9].reshape(-1, found.q.shape[2]):
        assert np.abs(model.constraints(q)).max() < 1e-12


@pytest.mark.parametrize(("rtol", "atol", "close"), [(1e-4, 1e-6, 1e-1), (1e-11, 1e-13, 1e-9)])
def test_loose_and_tight_tolerances(rtol, atol, close):
    m = pt.catalogue.load("grashof-four-bar")
    found = m.ensemble(states=started(m, 6.0, 64), t_eval=[1.0], rtol=rtol, atol=atol)
    agree(found, 8, close)


def test_parameters_vary_with_and_without_states():
    m = pt.catalogue.load("reference-four-bar")
    model, rng = m.compile(), np.random.default_rng(2)
    mass = float(model.parameters["coupler.mass"]) * rng.uniform(0.5, 2.0, 80)
    gravity = np.array([0.0, -9.81, 0.0]) * rng.uniform(0.2, 1.0, (80, 1))
    point = np.array(model.parameters["B.point"]) + rng.uniform(-0.02, 0.02, (80, 3)) * np.array([1.0, 1.0, 0.0])
    drawn = m.ensemble(parameters={"coupler.mass": mass, "gravity": gravity, "B.point": point}, t_eval=TIMES)
    agree(drawn, 10, 1e-6)
    both = m.ensemble(states=started(m, 3.0, 80), parameters={"coupler.mass": mass}, t_eval=TIMES)
    assert both.in_lanes.sum() > 60
    agree(both, 10, 1e-6)


def test_a_member_does_not_depend_on_those_beside_it_or_on_the_threads():
    m = pt.catalogue.load("grashof-four-bar")
    states = started(m, 9.0, 300)
    one, many = (m.ensemble(states=states, t_eval=TIMES, workers=workers) for workers in (1, 3))
    assert np.array_equal(one.q, many.q)
    assert np.array_equal(one.v, many.v)
    # the first, the middle and the last member decide on the programs; the order of the others has no influence
    shuffled = [0, *range(1, 150)[::-1], 150, *range(151, 299)[::-1], 299]
    again = m.ensemble(states=[states[i] for i in shuffled], t_eval=TIMES)
    assert np.array_equal(again.q, one.q[shuffled])


def test_equal_members_are_equal_and_numbers_that_fill_no_lanes_are_right():
    m = pt.catalogue.load("slider-crank")
    (state,) = started(m, 3.0, 1)
    for count in (1, 3, 64, 65, 257):
        found = m.ensemble(states=[state] * count, t_eval=[0.3])
        assert len(found) == count
        assert np.array_equal(found.q, np.repeat(found.q[:1], count, axis=0))
        agree(found, count, 1e-7)


def test_members_that_cannot_start_fail_alone():
    m = pt.catalogue.load("reference-four-bar")
    mass = np.linspace(1.0, 2.0, 70)
    mass[5] = -1.0
    found = m.ensemble(parameters={"crank.mass": mass}, t_eval=[0.1])
    assert found.status[5] == "evaluation-failed"
    assert found.success.sum() == 69
    assert "mass = -1 kg is negative" in found.messages[5]
    assert np.isnan(found.q[5]).all()
    with pytest.raises(pt.errors.DescriptionError, match="negative"):
        found.result(5)


def test_what_lanes_do_not_know_runs_member_by_member():
    m = pt.Mechanism("driven")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_torque("A", lambda t, state: 0.5 * t)
    states = [m.assemble(rates={"A": float(rate)}) for rate in np.linspace(0.0, 1.0, 70)]
    found = m.ensemble(states=states, t_eval=[0.2, 0.4])
    assert not found.in_lanes.any()
    assert "one by one: Python functions" in found.notes[0]
    agree(found, 30, 1e-9)


def test_absolute_states_are_converted():
    m = pt.catalogue.load("slider-crank")
    states = started(m, 2.0, 64)
    absolute = [m.convert(state, "absolute") for state in states]
    one, other = (m.ensemble(states=x, t_eval=[0.3]) for x in (states, absolute))
    assert np.abs(one.q - other.q).max() < 1e-9


def test_progress_is_reported_and_an_error_in_it_is_raised():
    m = pt.catalogue.load("slider-crank")
    states, seen = started(m, 3.0, 600), []
    m.ensemble(states=states, t_eval=[0.2], progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0

    def stop(part: float) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        m.ensemble(states=states, t_eval=[0.2], progress=stop)


@pytest.mark.parametrize("count", [96, 2])
def test_ctrl_c_stops_within_a_second(count):
    """In lanes, and member by member; a whole call would take minutes."""
    m = pt.catalogue.load("grashof-four-bar")
    states = started(m, 9.0, count)
    times = [3000.0 if count > 10 else 100_000.0]
    with pressed_after(1.0) as when, pytest.raises(KeyboardInterrupt):
        m.ensemble(states=states, t_eval=times)
    # other programs run beside this one
    assert time.monotonic() - when[0] < 3.0


def test_members_go_to_a_folder_some_at_a_time_and_are_continued(tmp_path, monkeypatch):
    m = pt.catalogue.load("slider-crank")
    states = started(m, 3.0, 150)
    monkeypatch.setattr("partita.mechanism.ensemble.AT_ONCE", 70)
    parts: list[float] = []
    found = m.ensemble(states=states, t_eval=TIMES, store=tmp_path / "runs", progress=parts.append)
    assert isinstance(found.q, np.memmap)
    assert parts == sorted(parts)
    whole = m.ensemble(states=states, t_eval=TIMES)
    for name, values in (("q", whole.q), ("v", whole.v)):
        # the programs are chosen for each part
        assert np.abs(np.load(tmp_path / "runs" / f"{name}.npy") - values).max() < 1e-9
    assert found.success.all()
    assert len(found.in_lanes) == 150

    class Stopped(Exception):
        pass

    def stop(part: float) -> None:
        if part > 0.6:
            raise Stopped

    with pytest.raises(Stopped):
        m.ensemble(states=states, t_eval=TIMES, store=tmp_path / "stopped", progress=stop)
    assert sorted(x.name for x in (tmp_path / "stopped").glob("part*")) == ["part 0.json"]
    first = (tmp_path / "stopped" / "part 0.json").stat().st_mtime_ns
    again = m.ensemble(states=states, t_eval=TIMES, store=tmp_path / "stopped")
    assert (tmp_path / "stopped" / "part 0.json").stat().st_mtime_ns == first
    for name in ("q", "v", "status", "in_lanes"):
        assert np.array_equal(getattr(again, name), getattr(found, name)), name
    assert again.steps == found.steps
    assert again.notes == found.notes
    loaded = m.ensemble(states=states, t_eval=TIMES, store=tmp_path / "runs")
    assert np.array_equal(loaded.q, found.q)
    assert loaded.messages == found.messages


def test_a_store_belongs_to_its_ensemble(tmp_path):
    m = pt.catalogue.load("slider-crank")
    states = started(m, 3.0, 5)
    given = {"states": states, "t_eval": TIMES, "store": tmp_path / "runs"}
    m.ensemble(**given)
    heavier = pt.catalogue.load("slider-crank")
    heavier.bodies["crank"].change(mass=9.0)
    for other, changes in (
        (m, {"states": [*states[:4], states[0]]}),
        (m, {"t_eval": [*TIMES[:-1], TIMES[-1] + 0.1]}),
        (m, {"rtol": 1e-6}),
        (m, {"parameters": {"crank.mass": np.ones(5)}}),
        (heavier, {}),
    ):
        with pytest.raises(pt.errors.ArgumentError, match="belongs to another ensemble"):
            other.ensemble(**given | changes)
    part = tmp_path / "runs" / "part 0.json"
    part.write_bytes(part.read_bytes().replace(b"finished", b"finishes", 1))
    with pytest.raises(pt.errors.FileFormatError, match=r"damaged: part 0\.json"):
        m.ensemble(**given)
    np.save(tmp_path / "runs" / "q.npy", np.zeros(3))
    with pytest.raises(pt.errors.FileFormatError, match=r"damaged: q\.npy"):
        m.ensemble(**given)
    (tmp_path / "file").write_text("")
    with pytest.raises(pt.errors.FileFormatError, match="is a file"):
        m.ensemble(**given | {"store": tmp_path / "file"})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("")
    with pytest.raises(pt.errors.FileFormatError, match=r"contains notes\.txt"):
        m.ensemble(**given | {"store": tmp_path / "mine"})
    with pytest.raises(pt.errors.MissingFileError, match="does not exist"):
        m.ensemble(**given | {"store": tmp_path / "nowhere" / "runs"})
    with pytest.raises(pt.errors.ArgumentError, match="store must be the name"):
        m.ensemble(**given | {"store": 3})
    m.add_force(next(iter(m.bodies)), lambda t, s: (0.0, 0.0, 0.0), point=(0, 0, 0))
    calling = given | {"store": tmp_path / "calling"}
    assert m.ensemble(**calling).success.all()
    with pytest.raises(pt.errors.ArgumentError, match="calls Python functions"):
        m.ensemble(**calling)


def test_datasets_have_members_times_and_names():
    pytest.importorskip("xarray")
    m = pt.catalogue.load("reference-four-bar")
    found = m.ensemble(parameters={"crank.mass": np.linspace(1.0, 2.0, 4)}, t_eval=[0.1, 0.2])
    data = found.to_xarray()
    assert data.q.dims == ("member", "t", "coordinate")
    assert list(data.coordinate.values) == found.names
    assert data["crank.mass"].dims == ("member",)
    assert repr(found) == "<ensemble of 4 members, 2 outputs: 4 finished>"
    assert found.initial(-1).t == 0.0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"states": [], "t_eval": [1.0]}, "needs members"),
        ({"t_eval": [1.0]}, "needs members"),
        ({"states": 3, "t_eval": [1.0]}, "must be a list of states"),
        ({"parameters": 3, "t_eval": [1.0]}, "must be a dict"),
        ({"parameters": {"crank.mass": [[1.0, 2.0]]}, "t_eval": [1.0]}, "a value for each member"),
        ({"parameters": {"crank.mass": [1.0, np.nan]}, "t_eval": [1.0]}, "of member 1 is not finite"),
        ({"parameters": {"crank.mass": ["a"]}, "t_eval": [1.0]}, "crank.mass"),
        ({"parameters": {"crank.mass": [1.0], "rocker.mass": [1.0, 2.0]}, "t_eval": [1.0]}, "members differ"),
        ({"parameters": {"crank.mass": [1.0]}, "t_eval": [0.0]}, "ends after the start"),
        ({"parameters": {"crank.mass": [1.0]}, "t_eval": [-1.0, 1.0]}, "outside the run"),
        ({"parameters": {"crank.mass": [1.0]}, "t_eval": [1.0], "workers": 0}, "workers"),
        ({"parameters": {"crank.mass": [1.0]}, "t_eval": [1.0], "rtol": -1.0}, "rtol"),
    ],
)
def test_bad_requests_are_refused(given, words):
    with pytest.raises(pt.errors.ArgumentError, match=words):
        pt.catalogue.load("reference-four-bar").ensemble(**given)


def test_unknown_parameters_and_states_of_other_times_are_refused():
    m = pt.catalogue.load("reference-four-bar")
    with pytest.raises(pt.errors.UnknownNameError, match=r"no parameter 'x\.mass'"):
        m.ensemble(parameters={"x.mass": [1.0]}, t_eval=[1.0])
    with pytest.raises(pt.errors.ArgumentError, match="member 1 starts at t = 1 s"):
        m.ensemble(states=[m.assemble(), m.assemble(t=1.0)], t_eval=[2.0])


def test_a_damaged_store_is_refused_and_what_is_returned_does_not_write_to_it(tmp_path):
    """Every part of it: one bit, cut short, emptied, zeros; a killed process leaves no drafts."""
    m = pt.catalogue.load("slider-crank")
    given = {"states": started(m, 3.0, 5), "t_eval": TIMES, "store": tmp_path / "runs"}
    found = m.ensemble(**given)
    with pytest.raises(ValueError, match="read-only"):
        found.q[:] = 0.0
    kept = {path.name: path.read_bytes() for path in (tmp_path / "runs").iterdir() if path.name != "lock"}
    rng = np.random.default_rng(58)

    def flipped(content: bytes, at: int) -> bytes:
        return content[:at] + bytes([content[at] ^ (1 << int(rng.integers(8)))]) + content[at + 1 :]

    for name, content in kept.items():
        damage = {
            "cut": content[: len(content) // 2], "empty": b"", "zeros": bytes(len(content)), "longer": content + b"x",
            **{f"bit in {at}": flipped(content, int(at)) for at in rng.integers(len(content), size=12)},
        }  # fmt: skip
        for how, damaged in damage.items():
            (tmp_path / "runs" / name).write_bytes(damaged)
            try:
                again = m.ensemble(**given)
            except pt.errors.FileFormatError as error:
                assert "is damaged" in str(error), (name, how)
            except pt.errors.ArgumentError as error:
                assert name == "ensemble.json" and "belongs to another" in str(error), (name, how)
            else:  # what nothing depends on: padding of the header of an array
                assert how not in ("cut", "empty", "zeros")
                assert np.array_equal(again.q, found.q) and np.array_equal(again.v, found.v), (name, how)
            (tmp_path / "runs" / name).write_bytes(content)
    draft = tmp_path / "runs" / ".part 0.json.0123456789abcdef.part"
    draft.write_bytes(b"half")
    assert np.array_equal(m.ensemble(**given).q, found.q)
    assert not draft.exists()


def test_drafts_of_a_killed_process_are_removed_when_the_file_is_written_again(tmp_path):
    m = pt.catalogue.load("slider-crank")
    old, new = (tmp_path / f".m[1].toml.{k * 16}.part" for k in "ab")
    for draft in (old, new):
        draft.write_bytes(b"half")
    os.utime(old, (time.time() - 7200.0,) * 2)
    m.save(tmp_path / "m[1].toml")
    assert not old.exists() and new.exists()  # which another process may be writing
