"""Sweeps: serial, threads and processes agree; a dead worker loses nothing else; a failure is reported at its point."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from pressing import heard

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
    ],
)
def test_nonsense_is_refused(parameters: object, executor: object, words: str) -> None:
    with pytest.raises(pt.errors.ArgumentError, match=words):
        pt.sweep(lambda x: x, parameters, executor=executor)  # type: ignore[arg-type]


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
