"""Sweeps: all executors agree; a dead worker loses nothing else; a failure is reported with its member; samples."""

import os
import signal
import sys
import time
import weakref
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pressing import heard
from scipy.stats import norm, qmc

import partita as pt

pytest.importorskip("xarray")
GRID = {"crank": [0.2, 0.25, 0.3], "mass": [0.5, 2.0]}


def four_bar(crank: float, mass: float) -> dict[str, object]:
    """Where a four-bar is after a short run, and its energy over time."""
    m = pt.Mechanism("four-bar")
    a, b, c, d = (0, 0, 0), (0, crank, 0), (0.8, 0.7, 0), (1, 0, 0)
    bodies = [m.add_rod(n, start=p, end=q, mass=mass) for n, p, q in (("l", a, b), ("t", b, c), ("r", d, c))]
    for name, parent, child, point in (("A", m.ground, bodies[0], a), ("B", bodies[0], bodies[1], b),
                                       ("C", bodies[1], bodies[2], c), ("D", m.ground, bodies[2], d)):  # fmt: skip
        m.add_revolute(name, parent, child, point=point, axis=(0, 0, 1))
    run = m.simulate(0.3, t_eval=np.linspace(0, 0.3, 5))
    return {"angle": run.joint("D").position[-1, 0], "energy": run.energy.kinetic}


def killed_once(crank: float, mass: float, marks: str) -> dict[str, object]:
    """Kills its own process the first time that it is asked for one of the points."""
    mark = Path(marks) / "mark"
    if crank == 0.25 and mass == 2.0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return four_bar(crank, mass)


def deadly(x: int) -> float:
    """One point always kills its worker, one always fails."""
    if x == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if x == 3:
        raise ValueError("three is out of reach")
    return 10.0 * x


def test_serial_threads_and_processes_agree() -> None:
    serial = pt.sweep(four_bar, GRID)
    assert serial.angle.dims == ("crank", "mass") and serial.energy.shape == (3, 2, 5)
    assert serial.angle.sel(crank=0.25, mass=2.0).item() == four_bar(0.25, 2.0)["angle"]
    assert not (serial.failed != "").any()
    for executor in ("threads", "processes"):
        assert pt.sweep(four_bar, GRID, executor=executor, workers=2).identical(serial), executor


def test_a_killed_worker_takes_nothing_along(tmp_path: Path) -> None:
    found = pt.sweep(killed_once, {**GRID, "marks": [str(tmp_path)]}, executor="processes", workers=2)
    assert (tmp_path / "mark").exists()
    assert found.isel(marks=0).drop_vars("marks").identical(pt.sweep(four_bar, GRID))


def test_points_that_fail_are_reported() -> None:
    found = pt.sweep(deadly, {"x": [1, 2, 3, 4]}, executor="processes", workers=2)
    assert np.array_equal(found.value.values, [10.0, np.nan, np.nan, 40.0], equal_nan=True)
    messages = found.failed.values.tolist()
    assert (
        messages[0] == messages[3] == ""
        and "died" in messages[1]
        and messages[2] == "ValueError: three is out of reach"
    )


def one_kills(x: int) -> int:
    """One member of many kills its worker."""
    if x == 1234:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def test_a_member_that_kills_is_found_in_a_large_batch() -> None:
    found = pt.sweep(one_kills, {"x": range(2000)}, executor="processes", workers=2, batch=500)  # type: ignore[dict-item]
    wanted = np.arange(2000.0)
    wanted[1234] = np.nan
    assert np.array_equal(found.value.values, wanted, equal_nan=True)
    assert found.failed.values[1234] == "its worker died 3 times" and (found.failed != "").sum() == 1


def unlike(x: int) -> Any:
    """A result that cannot be sent back, and one that can."""
    return (lambda: x) if x == 3 else float(x)


def test_a_result_that_cannot_be_sent_is_a_failure_of_its_member() -> None:
    found = pt.sweep(unlike, {"x": range(6)}, executor="processes", workers=1, batch=6)  # type: ignore[dict-item]
    assert [bool(why) for why in found.failed.values] == [x == 3 for x in range(6)]
    assert "pickle" in found.failed.values[3] and found.value.values[5] == 5.0
    with pytest.raises(pt.errors.ArgumentError, match=r"processes cannot import the model <function .*lambda"):
        pt.sweep(lambda x: x, {"x": [1]}, executor="processes")


def test_batches_are_sized_by_time() -> None:
    """Of members of a millisecond many go together; the long ones among them are not waited for together."""
    sizes: list[int] = []

    class Watched(ThreadPoolExecutor):
        def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Any:
            sizes.append(len(arguments[1]))
            return super().submit(function, *arguments, **options)

    def model(x: int) -> int:
        time.sleep(0.3 if 600 <= x < 605 else 0.0)
        return x

    with Watched(2) as pool:
        found = pt.sweep(model, {"x": range(20_000)}, executor=pool)  # type: ignore[dict-item]
    assert np.array_equal(found.value.values, np.arange(20_000))
    assert sizes[:2] == [1, 1] and max(sizes) > 1000 and len(sizes) < 200
    counted = Counter(sizes)
    sizes.clear()
    with Watched(2) as pool:
        pt.sweep(lambda x: time.sleep(0.3) or x, {"x": range(5)}, executor=pool)  # type: ignore[dict-item, func-returns-value]
    assert set(sizes) == {1} and counted[1] < 20


def test_samples_are_a_dimension() -> None:
    """The same members as points of a grid and as samples have the same values."""
    grid = pt.sweep(four_bar, GRID)
    samples = [{"mass": mass, "crank": crank} for crank in GRID["crank"] for mass in GRID["mass"]]
    for executor in (None, "threads"):
        found = pt.sweep(four_bar, samples, executor=executor)
        assert found.energy.dims == ("sample", "energy_axis0") and found.sample.values.tolist() == list(range(6))
        assert found.crank.dims == ("sample",) and found.crank.values.tolist() == np.repeat(GRID["crank"], 2).tolist()
        assert np.array_equal(found.energy.values.reshape(3, 2, 5), grid.energy.values)


@pytest.mark.parametrize("sampler", ["sobol", "halton", "latin hypercube"])
def test_samplers_fill_the_ranges(sampler: str) -> None:
    ranges = {"x": (1.0, 2.0), "y": (-3.0, 0.0), "z": norm(0.5, 0.01)}
    drawn = pt.samples(ranges, 64, sampler=sampler)
    assert drawn == pt.samples(ranges, 64, sampler=sampler) != pt.samples(ranges, 64, sampler=sampler, seed=1)
    x, y, z = (np.array([one[name] for one in drawn]) for name in ranges)
    # one of 64 equal intervals each, or nearly: twice the spacing
    assert np.diff(np.sort(x), prepend=1.0, append=2.0).max() < 3 / 64
    assert np.diff(np.sort(y), prepend=-3.0, append=0.0).max() < 9 / 64
    assert abs(z.mean() - 0.5) < 2e-3 and 0.005 < z.std() < 0.015
    found = pt.sweep(lambda x, y, z: x * y + z, drawn)
    assert np.array_equal(found.value.values, x * y + z)


def test_samplers_of_scipy_and_of_ones_own() -> None:
    assert pt.samples({"x": (0, 2)}, 2, sampler=Fixed([[0.0], [0.5]])) == [{"x": 0.0}, {"x": 1.0}]
    assert len(pt.samples({"x": (0, 1), "y": (0, 1)}, 4, sampler=qmc.LatinHypercube(2))) == 4
    for given, words in (
        ([[0.5, 0.5]], r"shape \(1, 2\); 1 samples of 1 parameters need \(1, 1\)"),
        ([0.5], r"shape \(1,\)"),
        ([[np.nan]], "outside of 0 to 1"),
        ([[1.5]], "outside of 0 to 1"),
        ("no", "the sampler failed"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words):
            pt.samples({"x": (0, 1)}, 1, sampler=Fixed(given))
    for ranges, words in (({}, "ranges must be a dict"), ({"x": (1, 0)}, "the lower first"), ({"x": 3}, "method ppf"),
                          ({"x": (0, np.inf)}, "finite")):  # fmt: skip
        with pytest.raises(pt.errors.ArgumentError, match=words):
            pt.samples(ranges, 1)
    with pytest.raises(pt.errors.ArgumentError, match="known: sobol, halton, latin hypercube"):
        pt.samples({"x": (0, 1)}, 1, sampler="random")


class Fixed:
    """A sampler that returns what it was given."""

    def __init__(self, cube: Any) -> None:
        self.cube = cube

    def random(self, count: int) -> Any:
        return self.cube


def test_ctrl_c_keeps_what_was_computed() -> None:
    def stopped(x: int) -> int:
        if x == 3:
            raise KeyboardInterrupt
        return x

    with pytest.raises(pt.errors.Interrupted, match="after 2 of 4 members") as reported:
        pt.sweep(stopped, {"x": [1, 2, 3, 4]})
    assert reported.value.result.value.values[:2].tolist() == [1, 2]


def test_progress_is_reported() -> None:
    parts: list[float] = []
    pt.sweep(lambda x: x, {"x": range(4)}, progress=parts.append)
    assert parts == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize(
    ("parameters", "executor", "words"),
    [
        ({}, None, "must be a dict"),
        ({"x": 3}, None, "list of values"),
        ({"x": "abc"}, None, "list of values"),
        ({"x": []}, None, "list of values"),
        ({"no name": [1]}, None, "no name"),
        ({"x": [1]}, "dask", "known: threads, processes"),
        ({"x": [1]}, 3, "submit"),
        ({"y": [1]}, None, "its parameters are x"),
        ({"x": [1], "z": [2]}, None, "parameters x, z: .*unexpected keyword argument 'z'; its parameters are x"),
        ({"x": [1.0, np.nan]}, None, r"parameters\['x'\]\[1\] is NaN"),
        ({"x": [2, 1, 2]}, None, "has 2 twice, at 0 and 2"),
        ({"failed": [1]}, None, "the dataset uses it"),
        ([], None, "must be a dict"),
        ([3], None, "sample 0 must be a dict"),
        ([{"x": 1}, {}], None, "sample 1 must be a dict"),
        (np.zeros((3, 2)), None, "must be a dict of lists for a grid, .*or a list of samples"),
        ([{"x": 1}, {"y": 1}], None, "sample 1 has the parameters y, but sample 0 has x"),
        ([{"x": 1}, {"x": 1.0}], None, r"samples 0 and 1 are equal \({'x': 1}\)"),
        ([{"x": 1}, {"x": np.nan}], None, "parameter 'x' of sample 1 is NaN"),
        ([{"sample": 1}], None, "the dataset uses it"),
    ],
)
def test_nonsense_is_refused(parameters: object, executor: object, words: str) -> None:
    with pytest.raises(pt.errors.ArgumentError, match=words):
        pt.sweep(lambda x: x, parameters, executor=executor)  # type: ignore[arg-type]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_sweep_of_many_points_by_threads_keeps_what_came_back() -> None:
    """Points are submitted a few at a time: results come from the first on, and Ctrl-C keeps them."""

    def doubled(x: float) -> float:
        if x == 5000:
            signal.raise_signal(signal.SIGINT)
        return 2.0 * x

    with heard(), pytest.raises(pt.errors.Interrupted) as stopped:
        pt.sweep(doubled, {"x": range(200_000)}, executor="threads", workers=2)
    found = stopped.value.result
    known = np.flatnonzero(np.isfinite(found["value"].values))
    assert len(known) > 100 and f"after {len(known)} of 200000 members" in str(stopped.value)
    assert np.array_equal(found["value"].values[known], 2.0 * known)


@pytest.mark.parametrize("executor", [None, "threads"])
def test_an_interrupt_that_python_drops_stops_a_sweep(executor: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """A `KeyboardInterrupt` in the callback of a weak reference is dropped, as it would be in a finaliser."""
    dropped: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda found: dropped.append(found.exc_type))

    class Gone:
        pass

    def press(part: float) -> None:
        if part > 0.5 and not dropped:
            gone = Gone()
            kept = weakref.ref(gone, lambda _: signal.raise_signal(signal.SIGINT))
            del gone
            assert kept() is None

    with heard(), pytest.raises(pt.errors.Interrupted) as stopped:
        pt.sweep(lambda x: 2.0 * x, {"x": range(100)}, executor=executor, batch=1, progress=press)
    assert dropped == [KeyboardInterrupt]
    assert 50 < np.isfinite(stopped.value.result["value"].values).sum() < 100


def test_a_sweep_leaves_handlers_of_signals_as_they_were() -> None:
    caught: list[int] = []

    def own(number: int, _: Any) -> None:
        caught.append(number)

    def model(x: float) -> float:
        if x == 3:
            signal.raise_signal(signal.SIGINT)
        return x

    with heard():
        pt.sweep(lambda x: x, {"x": range(5)})
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        signal.signal(signal.SIGINT, own)
        found = pt.sweep(model, {"x": range(5)})
        assert signal.getsignal(signal.SIGINT) is own and caught == [signal.SIGINT]
        assert np.array_equal(found["value"].values, range(5))


def test_results_that_take_names_of_parameters_are_refused() -> None:
    with pytest.raises(pt.errors.ArgumentError, match="the model returns 'x', which the dataset uses"):
        pt.sweep(lambda x: {"x": x}, {"x": [1, 2]})
    found = pt.sweep(lambda x: x or np.datetime64("2020-01-01"), {"x": [1.5, 0.0]})
    assert found.failed.values.tolist()[1].startswith("value has the type datetime64[D], elsewhere float64")
    with pytest.raises(pt.errors.ArgumentError, match="batch must be a positive integer"):
        pt.sweep(lambda x: x, {"x": [1]}, batch=0)
    with pytest.raises(pt.errors.ArgumentError, match="workers must be a positive integer"):
        pt.sweep(lambda x: x, {"x": [1]}, executor="threads", workers=0)
