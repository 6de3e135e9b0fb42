"""Long steps of `make`: a line while they work, everything they print where they fail."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "quietly.py"


def ran(code: str, **more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), "Working", "a moment", sys.executable, "-c", code]
    environment = {key: value for key, value in os.environ.items() if key != "VERBOSE"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**environment, **more})


def test_what_succeeds_is_one_line() -> None:
    done = ran("print('chatter')")
    assert done.returncode == 0 and not done.stderr
    assert done.stdout.startswith("Working (a moment) ...") and done.stdout.count("\n") == 1
    assert "chatter" not in done.stdout


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_what_fails_is_shown_whole(stream: str) -> None:
    done = ran(f"import sys; print('the reason', file=sys.{stream}); sys.exit(7)")
    assert done.returncode == 7 and "failed:\nthe reason" in done.stdout and "exit code 7" in done.stderr


def test_verbose_shows_all() -> None:
    assert "chatter" in ran("print('chatter')", VERBOSE="1").stdout


def test_a_command_that_does_not_exist_fails() -> None:
    command = [sys.executable, str(TOOL), "Working", "a moment", "no-such-command"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 127 and "no-such-command" in done.stdout
