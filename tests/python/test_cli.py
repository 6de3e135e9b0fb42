"""The command line: exit codes, one message per error, files that can be read again."""

from __future__ import annotations

import signal
import threading
import time
import webbrowser
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import partita as pt
from partita import results
from partita.cli import main
from partita.solver import grouped


def run(*words: object) -> int:
    return main([str(word) for word in words])


def test_run_of_the_catalogue_reports_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {end: tmp_path / f"run{end}" for end in (".nc", ".png", ".html")}
    code = run(
        "simulate", "four-bar", "--time", 1, "--outputs", 51,
        "--save", files[".nc"], "--plot", files[".png"], "--html", files[".html"],
    )  # fmt: skip
    printed = capsys.readouterr().out
    assert code == 0
    for word in (
        "independent",
        "rho",
        "Switches",
        "closure error",
        "energy balance",
        "steps",
        *map(str, files.values()),
    ):
        assert word in printed
    stored = results.load_result(files[".nc"])
    assert len(stored.t) == 51 and stored.t[-1] == 1.0
    assert files[".png"].read_bytes().startswith(b"\x89PNG")
    assert "<html" in files[".html"].read_text().lower()


def test_published_run_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("simulate", "planar-pendulum") == 0
    printed = capsys.readouterr().out
    assert "Against known answers" in printed and "FAILED" not in printed


def test_command_and_function_agree(tmp_path: Path) -> None:
    """The same run from the command line and from Python is the same to the last bit."""
    path = tmp_path / "run.json"
    words = (
        "--rtol",
        "1e-9",
        "--method",
        "tsit5",
        "--target",
        "A=30deg",
        "--rate",
        "A=2",
        "--time",
        1,
        "--outputs",
        11,
    )
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.save(tmp_path / "pendulum.toml")
    assert run("simulate", tmp_path / "pendulum.toml", *words, "--quiet", "--save", path) == 0
    start = m.assemble(targets={"A": np.radians(30.0)}, rates={"A": 2.0})
    expected = m.simulate(1.0, t_eval=np.linspace(0, 1, 11), initial=start, rtol=1e-9, method="tsit5")
    assert np.array_equal(results.load_result(path).q, expected.q)


def test_every_option_of_the_equations_reaches_them(tmp_path: Path) -> None:
    """Each run from the command line is, bit for bit, the run from Python with that option, and no other."""
    m = pt.catalogue.load("four-bar")
    start, path, times = pt.catalogue.entry("four-bar").initial(m), tmp_path / "run.json", np.linspace(0.0, 0.5, 11)
    common = ("simulate", "four-bar", "--time", 0.5, "--outputs", 11, "--rtol", "1e-6", "--atol", "1e-8")
    plain = m.simulate(0.5, t_eval=times, initial=start, rtol=1e-6, atol=1e-8)
    for words, options in (
        (("--independent", "D"), {"independent": ["D"]}),
        (("--selection", "determinant"), {"selection": "determinant"}),
        (("--selection", "persistence", "--window", "0.1"), {"selection": "persistence", "window": 0.1}),
        (("--correction", "none"), {"correction": "none"}),
        (("--formulation", "baumgarte", "--baumgarte", "10,10"), {"formulation": "baumgarte", "baumgarte": (10, 10)}),
    ):
        assert run(*common, *words, "--quiet", "--save", path) == 0
        expected = m.simulate(0.5, t_eval=times, initial=start, rtol=1e-6, atol=1e-8, **grouped(options))
        assert np.array_equal(results.load_result(path).q, expected.q), words
        reported = {key: value for key, value in results.load_result(path).options.items() if key in options}
        assert reported.keys() == options.keys()
        if "selection" not in options:  # which may choose what the default chooses
            assert not np.array_equal(expected.q, plain.q)


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ((), "1 of 3 independent, chosen by the measure rho"),
        (("--independent", "D"), "1 of 3 independent, as asked for"),
        (("--selection", "determinant"), "1 of 3 independent, chosen by the rule determinant"),
        (("--formulation", "svd"), "none independent, tangent velocities integrated"),
        (("--formulation", "multipliers"), "none independent, all accelerations integrated"),
    ],
)
def test_account_says_who_chose(words: tuple[str, ...], reported: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("simulate", "four-bar", "--time", 0.1, "--outputs", 5, *words) == 0
    assert reported in capsys.readouterr().out


def test_stored_results_can_be_plotted_and_viewed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that was not named is never replaced; a page that is looked at is opened."""
    path = tmp_path / "run.json"
    assert run("simulate", "four-bar", "--time", 0.5, "--outputs", 11, "--quiet", "--save", path) == 0
    assert capsys.readouterr().out == ""
    assert run("plot", path) == 0 and (tmp_path / "run.png").exists()
    assert run("plot", path, "--what", "A", "--what", "energy", "-o", tmp_path / "two.svg") == 0
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    kept = tmp_path / "run.html"  # of another command
    kept.write_text("mine", encoding="utf-8")
    assert run("view", path) == 0 and len(opened) == 1 and kept.read_text("utf-8") == "mine"
    assert "-o FILE keeps it" in capsys.readouterr().out
    figure = (tmp_path / "run.png").read_bytes()
    assert run("plot", path) == 2 and "-o" in capsys.readouterr().err
    assert (tmp_path / "run.png").read_bytes() == figure
    assert run("view", path, "-o", kept) == 0 and kept.read_text("utf-8").startswith("<!DOCTYPE html>")
    film = tmp_path / "run.gif"
    assert run("view", path, "-o", film) == 0 and film.read_bytes()[:3] == b"GIF"
    before = path.read_bytes()
    assert run("plot", path, "-o", path) == 2 and path.read_bytes() == before


def test_report_list_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("report", "spatial-four-bar") == 0
    assert "17" in capsys.readouterr().out
    assert run("list") == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in pt.catalogue.names())
    assert run("--version") == 0
    assert capsys.readouterr().out == f"partita {pt.__version__}\n"
    assert run("--help") == 0


def test_convert_keeps_the_model(tmp_path: Path) -> None:
    first, second = tmp_path / "a.toml", tmp_path / "b.toml"
    pt.catalogue.load("slider-crank").save(first)
    assert run("convert", first, second) == 0
    assert pt.load(first).to_spec() == pt.load(second).to_spec()


@pytest.mark.parametrize(
    "words",
    [
        ["nonsense"],
        ["simulate"],
        ["simulate", "forbar"],
        ["simulate", "nothing.toml", "--time", "1"],
        ["simulate", "four-bar", "--time", "soon"],
        ["simulate", "four-bar", "--time", "-1"],
        ["simulate", "four-bar", "--time", "nan"],
        ["simulate", "four-bar", "--rtol", "0"],
        ["simulate", "four-bar", "--outputs", "1"],
        ["simulate", "four-bar", "--method", "euler"],
        ["simulate", "four-bar", "--formulation", "magic"],
        ["simulate", "four-bar", "--formulation", "baumgarte"],
        ["simulate", "four-bar", "--formulation", "user-tangent"],
        ["simulate", "four-bar", "--selection", "by-dice"],
        ["simulate", "four-bar", "--selection", "persistence"],
        ["simulate", "four-bar", "--window", "1"],
        ["simulate", "four-bar", "--independent", "Z"],
        ["simulate", "four-bar", "--independent", "A,D"],
        ["simulate", "four-bar", "--correction", "twice"],
        ["simulate", "four-bar", "--baumgarte", "3"],
        ["simulate", "four-bar", "--target", "A"],
        ["simulate", "four-bar", "--target", "Q=1"],
        ["simulate", "four-bar", "--target", "A=1", "--target", "A=2"],
        ["simulate", "four-bar", "--save", "nowhere/run.nc"],
        ["simulate", "four-bar", "--save", "run.xyz"],
        ["simulate", "four-bar", "--plot", "run.doc"],
        ["simulate", "four-bar", "--html", "nowhere/run.html"],
        ["report", "forbar"],
        ["plot", "nothing.nc"],
        ["view", "nothing.json"],
        ["plot", "nothing.csv"],
        ["convert", "nothing.toml", "b.toml"],
    ],
)
def test_bad_input_is_one_message_and_code_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("partita: error: ") and captured.err.count("\n") == 1
    assert "Traceback" not in captured.err


def test_length_of_a_file_must_be_given(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pt.catalogue.load("four-bar").save(tmp_path / "m.toml")
    assert run("simulate", tmp_path / "m.toml") == 2
    assert "--time" in capsys.readouterr().err


def test_bad_model_file_reports_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.toml").write_text('name = "m"\n\nbodies = [\n')
    assert run("report", tmp_path / "m.toml") == 2
    assert "m.toml" in capsys.readouterr().err


def test_lengths_that_cannot_close(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("simulate", "four-bar", "--target", "B=3.0", "--target", "C=3.0", "--target", "A=3.0") == 2
    assert capsys.readouterr().err.startswith("partita: error: ")


def _early(monkeypatch: pytest.MonkeyPatch, status: str) -> None:
    """Runs end half-way, as the core reports it."""
    whole = pt.Mechanism.simulate

    def half(self: pt.Mechanism, *args: object, **options: object) -> results.Result:
        result = whole(self, *args, **options)  # type: ignore[arg-type]
        ended = replace(result.record, success=False, status=status, message="it could not go on")
        return results.Result(ended, result._source)

    monkeypatch.setattr(pt.Mechanism, "simulate", half)


@pytest.mark.parametrize("status, code", [("singular", 1), ("interrupted", 130)])
def test_run_that_stops_early_is_saved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], status: str, code: int
) -> None:
    _early(monkeypatch, status)
    path = tmp_path / "run.csv"
    assert run("simulate", "four-bar", "--time", 0.1, "--outputs", 3, "--save", path) == code
    captured = capsys.readouterr()
    assert "it could not go on" in captured.err and captured.err.count("\n") == 1
    assert "closure error" in captured.out and path.exists()


def test_control_c_keeps_what_was_computed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run of months, interrupted after a second, ends soon and is saved."""
    path = tmp_path / "run.nc"
    pressed: list[float] = []

    def press() -> None:
        pressed.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(1.0, press)
    # where the tests run in the background the signal may come ignored, as no terminal's would
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer.start()
    try:
        code = run("simulate", "n-four-bar", "--time", "1e7", "--outputs", 20001, "--rtol", "1e-12", "--save", path)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    assert code == 130 and pressed
    # The run itself stops within a second; the rest is for reactions and the file.
    assert time.monotonic() - pressed[0] < 10.0
    assert "interrupted" in capsys.readouterr().err
    stored = results.load_result(path)
    assert not stored.success and stored.status == "interrupted" and len(stored.t) >= 1
