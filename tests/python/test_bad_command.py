"""Bad input on the command line: exit code 2, one clear message on stderr, nothing on stdout, no traceback."""

import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from thorough import THOROUGH

from partita.cli import main

BROKEN = """\
partita = 1
name = "invalid"

[[bodies]
name = "rod"
"""

COMMANDS = [
    (["simulate", "no-such.toml"], "no-such.toml"),
    (["simulate", "four-bra"], "four-bar"),
    (["simulate", "model.docx"], "docx"),
    (["simulate", "broken.toml"], "4"),
    (["simulate", "empty.toml"], "empty.toml"),
    (["simulate", "four-bar", "--time", "-1"], "-1"),
    (["simulate", "four-bar", "--time", "nan"], "nan"),
    (["simulate", "four-bar", "--time", "soon"], "soon"),
    (["simulate", "four-bar", "--time", "0.1", "--save", "run.docx"], "docx"),
    (["simulate", "four-bar", "--time", "0.1", "--save", "no-such-folder/run.json"], "no-such-folder"),
    (["simulate", "four-bar", "--speed", "9"], "--speed"),
    (["report", "no-such.toml"], "no-such.toml"),
    (["plot", "no-such.nc"], "no-such.nc"),
    (["view", "no-such.nc"], "no-such.nc"),
    (["simulate"], "simulate"),
    (["mcp"], "--root"),
    (["dance"], "dance"),
    (["simulat", "four-bar"], "did you mean 'simulate'?"),
    (["simulate", "four-bar", "--method", "dopri"], "did you mean 'dopri5'?"),
    (["simulate", "xyzzy"], "`partita list`"),
]


ALONE = (["simulate", "four-bra"], ["simulate", "broken.toml"], ["dance"])
"""Commands that `make test` starts as processes of their own, as `make trust` starts all; the others it calls."""


def partita(*arguments: str, folder: Path, alone: bool = True) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "partita", *arguments]
    if alone:
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error), pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        code = main(arguments)
    return subprocess.CompletedProcess(command, code, out.getvalue(), error.getvalue())


@pytest.mark.parametrize(("arguments", "word"), COMMANDS, ids=[" ".join(arguments) for arguments, _ in COMMANDS])
def test_bad_command(arguments: list[str], word: str, tmp_path: Path) -> None:
    (tmp_path / "model.docx").write_text("x", "utf-8")
    (tmp_path / "broken.toml").write_text(BROKEN, "utf-8")
    (tmp_path / "empty.toml").write_text("", "utf-8")
    done = partita(*arguments, folder=tmp_path, alone=THOROUGH or arguments in ALONE)
    assert done.returncode == 2, done.stderr
    assert word in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert done.stdout == ""
    assert sum("error" in line.lower() for line in done.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("run*"))


def test_loop_that_cannot_close(tmp_path: Path) -> None:
    import partita as pt

    m = pt.Mechanism("open")
    bar = m.add_rod("bar", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, bar, point=(0, 0, 0))
    m.add_revolute("B", m.ground, bar, point=(2, 0, 0), child_point=(1, 0, 0))
    m.save(tmp_path / "open.toml")
    done = partita("simulate", "open.toml", "--time", "1", folder=tmp_path)
    assert done.returncode == 2, done.stderr
    assert '"B"' in done.stderr or "B" in done.stderr.split()
    assert "Traceback" not in done.stderr


def test_without_a_command_it_shows_what_can_be_done(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    printed = capsys.readouterr()
    assert not printed.err
    for word in ("simulate", "draw", "partita list", "partita simulate four-bar"):
        assert word in printed.out
