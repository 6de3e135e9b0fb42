"""Ctrl-C stops a loop of runs and loses nothing; progress shows rate and remaining time, and is silent in logs."""

from __future__ import annotations

import contextlib
import io
import pickle
import sys
import time

import numpy as np
import pytest
from pressing import pressed_after

import partita as pt
from partita.cli import main

MONTHS = 1e7


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def ring() -> pt.System:
    return pt.System(1, mass=np.eye(1), forces=lambda t, q, v: -q)


class Terminal(io.StringIO):
    """Where bars are shown."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("kind", ["mechanism", "system"])
def test_one_ctrl_c_stops_a_loop_of_runs_and_keeps_the_run(kind: str) -> None:
    times = np.arange(0.0, MONTHS, 50.0)
    begun = 0
    m, s = pendulum(), ring()
    with pressed_after(0.3) as when, pytest.raises(pt.errors.Interrupted) as stopped:
        for _ in range(3):
            begun += 1
            try:  # who expects errors does not catch it
                if kind == "mechanism":
                    m.simulate(MONTHS, t_eval=times)
                else:
                    pt.simulate(s, MONTHS, [1.0], [0.0], t_eval=times)
            except Exception:
                pass
    assert begun == 1 and time.monotonic() - when[0] < 5.0
    run = stopped.value.result
    assert isinstance(run, pt.Result) and not run.success and run.status == "interrupted"
    assert 1 < len(run.t) < len(times) and np.array_equal(run.t, times[: len(run.t)])
    assert "interrupted at t = " in str(stopped.value) and "sys.last_value.result" in str(stopped.value)
    # the outputs are those of the same run without the interruption
    few = slice(0, min(5, len(run.t)))
    again = (m.simulate if kind == "mechanism" else lambda d, **o: pt.simulate(s, d, [1.0], [0.0], **o))(
        float(times[few][-1]), t_eval=times[few]
    )
    assert again.q[:-1] == pytest.approx(run.q[few][:-1], abs=1e-9)  # its last step alone is another


def test_what_it_carries_travels() -> None:
    error = pt.errors.Interrupted("interrupted at t = 1", {"a": 1})
    other = pickle.loads(pickle.dumps(error))
    assert type(other) is type(error) and str(other) == str(error) and other.result == {"a": 1}
    assert issubclass(pt.errors.Interrupted, KeyboardInterrupt) and not issubclass(pt.errors.Interrupted, Exception)


def test_a_work_precision_that_is_interrupted_keeps_its_points(monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = pt.Mechanism.simulate
    ladder: list[object] = []

    def impatient(self: pt.Mechanism, *arguments: object, **options: object) -> object:
        if options["rtol"] in ladder:
            raise KeyboardInterrupt
        return simulate(self, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(pt.Mechanism, "simulate", impatient)
    found = pendulum().compare(0.2, formulations=["projective"], selections=["collective"])
    ladder.append(1e-6)
    with pytest.raises(pt.errors.Interrupted) as stopped:
        found.work_precision((1e-4, 1e-5, 1e-6, 1e-7))
    assert stopped.value.result.interrupted and len(stopped.value.result.points) == 2


def test_the_bar_reports_rate_and_remaining_time_and_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("tqdm")
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    with pressed_after(0.6), pytest.raises(pt.errors.Interrupted):
        pendulum().simulate(MONTHS, t_eval=[MONTHS], progress=True)
    lines = shown.getvalue().split("\r")
    assert any("of 1e+07 s" in line and " left, " in line and "s/s" in line for line in lines)
    assert not lines[-1].strip()  # cleared


@pytest.mark.parametrize("words", [["simulate", "four-bar", "--time", "0.1"], ["compare", "four-bar", "--time", "0.1"]])
def test_the_command_line_draws_it_on_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    pytest.importorskip("tqdm")
    if words[0] == "compare":
        words = [*words, "--formulations", "projective", "--rules", "collective"]
    for stream, drawn in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        assert main(words) == 0
        assert (" left, " in stream.getvalue()) is drawn and not stream.getvalue().split("\r")[-1].strip()
    monkeypatch.setitem(sys.modules, "tqdm", None)  # nobody asked for it: the run goes on without
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert main(words) == 0


@pytest.mark.parametrize("what", ["run", "sweep", "comparison"])
def test_nothing_of_it_is_written_into_a_log(monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    pytest.importorskip("tqdm")
    log = io.StringIO()
    monkeypatch.setattr(sys, "stderr", log)
    if what == "run":
        pendulum().simulate(100.0, progress=True)
    elif what == "sweep":
        pt.sweep(lambda x: x, {"x": [1.0, 2.0]}, progress=True)
    else:
        pendulum().compare(0.2, formulations=["projective"], selections=["collective"], progress=True)
    assert log.getvalue() == ""


@pytest.mark.parametrize("what", ["run", "sweep", "comparison"])
def test_bars_without_their_library_name_the_extra(monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    monkeypatch.setitem(sys.modules, "tqdm", None)
    with pytest.raises(pt.errors.MissingDependencyError, match=r"partita\[progress\]"):
        if what == "run":
            pendulum().simulate(0.1, progress=True)
        elif what == "sweep":
            pt.sweep(lambda x: x, {"x": [1.0]}, progress=True)
        else:
            pendulum().compare(0.1, progress=True)


def folded_sheet(across: int, along: int, digits: int) -> pt.Mechanism:
    """A Miura sheet of equal parallelograms, half folded, each a body hinged to its neighbours; rounded."""
    gamma, theta = np.radians(65.0), 0.6
    cosine, tangent = np.cos(theta), np.tan(gamma)
    width = cosine * tangent / np.hypot(1.0, cosine * tangent)
    shift, length = 1.0 / np.hypot(1.0, cosine * tangent), np.sqrt(1.0 - (np.sin(theta) * np.sin(gamma)) ** 2)
    height = np.sin(theta) * np.sin(gamma)
    turn = np.linalg.qr(np.array([[0.3, -1.0, 0.2], [0.9, 0.4, 0.5], [-0.2, 0.6, 1.1]]))[0]
    spots = np.array(
        [
            [turn @ [i * width, j * length + i % 2 * shift, j % 2 * height] for j in range(along + 1)]
            for i in range(across + 1)
        ]
    ).round(digits)
    m = pt.Mechanism("sheet", gravity=None)
    sheets = {}
    for i in range(across):
        for j in range(along):
            middle = spots[i : i + 2, j : j + 2].mean(axis=(0, 1))
            first = i == j == 0
            sheets[i, j] = m.ground if first else m.add_body(f"{i}{j}", 1.0, (0.1, 0.1, 0.1), position=middle)
    for i in range(across):
        for j in range(along):
            for di, dj, p, q in (
                (1, 0, spots[i + 1, j], spots[i + 1, j + 1]),
                (0, 1, spots[i, j + 1], spots[i + 1, j + 1]),
            ):
                if (i + di, j + dj) in sheets:
                    m.add_revolute(f"{di}{i}{j}", sheets[i, j], sheets[i + di, j + dj], (p + q) / 2, axis=q - p)
    return m


def test_ctrl_c_stops_a_compilation(caplog: pytest.LogCaptureFixture) -> None:
    """Of a sheet of 36 parts, which would take long; the compilation that nobody waits for ends soon as well."""
    m = folded_sheet(4, 4, 4)
    with pressed_after(0.3) as when, pytest.raises(KeyboardInterrupt):
        m.compile()
    assert time.monotonic() - when[0] < 1.0
    begun = time.process_time()
    time.sleep(1.5)
    used = time.process_time()
    time.sleep(0.3)
    assert used - begun < 1.5 and time.process_time() - used < 0.2
    # it moves by one, however it was rounded, and that is found out within a bound
    small = folded_sheet(3, 3, 4)
    begun = time.process_time()
    assert small.compile().mobility == 1
    assert time.process_time() - begun < 10.0


@pytest.mark.parametrize("far", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_joints_far_from_their_bodies_are_compiled_at_once(coordinates: str, far: float) -> None:
    """A point elsewhere on its own axis changes nothing of a hinge, nor does the rounding of its axis over that arm."""
    turn = np.linalg.qr(np.array([[0.3, -1.0, 0.2], [0.9, 0.4, 0.5], [-0.2, 0.6, 1.1]]))[0]
    points = [turn @ p for p in ((0, 0, 0), (0, 1, 0), (3, 2, 0), (3, 0, 0))]
    m = pt.Mechanism("four-bar", gravity=None)
    bodies = [m.ground] + [m.add_rod(n, points[i], points[i + 1], 1.0) for i, n in enumerate("abc")] + [m.ground]
    for i, name in enumerate("ABCD"):
        point = points[i] + (far if name == "C" else 0.0) * turn[:, 2]
        m.add_revolute(name, bodies[i], bodies[i + 1], point=point, axis=turn[:, 2])
    begun = time.process_time()
    assert m.compile(coordinates).mobility == 1
    assert time.process_time() - begun < 2.0
    # a head of a platform on six legs, far away: another mechanism, with a leg of that length
    platform = pt.catalogue.load("stewart-sps")
    platform.joints["head 5"].point = (far, 0.3 * far, -0.7 * far)
    begun = time.process_time()
    with contextlib.suppress(pt.errors.PartitaError):
        platform.compile(coordinates)
    assert time.process_time() - begun < 4.0
