"""What is installed, by which name, and what a release builds: the places that say so agree."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from partita.cli import main

ROOT = Path(__file__).parents[2]
SYSTEMS = {"linux-x86_64", "linux-aarch64", "macos-x86_64", "macos-aarch64", "windows-x86_64"}


def project() -> dict[str, Any]:
    tomllib = pytest.importorskip("tomllib")
    found: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return found


def packages(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=\[ ;]", requirement)[0].lower() for requirement in requirements}


def test_numpy_and_scipy_are_all_that_is_needed() -> None:
    assert packages(project()["dependencies"]) == {"numpy", "scipy"}


def test_every_extra_that_an_error_names_exists_and_is_pinned() -> None:
    extras = project()["optional-dependencies"]
    named: set[str] = set()
    for path in (ROOT / "python" / "partita").rglob("*.py"):
        text = path.read_text("utf-8")
        named |= set(re.findall(r"partita\[(\w+)\]", text)) | set(
            re.findall(r'(?:extra|missing)\("[\w.]+", "(\w+)"', text)
        )
    assert {"plots", "netcdf", "zarr", "parquet", "progress", "xarray", "pandas", "robots", "mujoco"} <= named
    assert named <= set(extras)
    pinned = packages((ROOT / "constraints.txt").read_text("utf-8").splitlines())
    for name, wanted in extras.items():
        assert name == "all" or packages(wanted) <= pinned, name
    (everything,) = extras["all"]
    assert set(everything.removeprefix("partita[").removesuffix("]").split(",")) == set(extras) - {"all"}


def test_every_extra_stands_among_the_dependencies() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text("utf-8")
    rows = [row for row in page.splitlines() if row.startswith("| ")]
    for name, wanted in project()["optional-dependencies"].items():
        for package in packages(wanted) - {"partita"}:
            assert any(package in row.lower() and name in row for row in rows), (name, package)


def test_a_release_builds_every_system_and_tries_what_it_can_run() -> None:
    yaml = pytest.importorskip("yaml")
    release = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text("utf-8"))
    jobs = release["jobs"]
    rows = jobs["wheels"]["strategy"]["matrix"]["include"]
    assert {row["name"] for row in rows} == SYSTEMS
    assert {row["name"] for row in rows if row["native"]} == SYSTEMS - {"macos-x86_64"}
    for name in ("wheels", "sdist"):
        assert any("tools/install_check.py dist" in step.get("run", "") for step in jobs[name]["steps"])
    assert set(jobs["publish"]["needs"]) == {"wheels", "sdist"}
    assert jobs["publish"]["permissions"] == {"id-token": "write"} and release["permissions"] == {"contents": "read"}


def test_the_check_of_an_installation_refuses_what_it_cannot_find(tmp_path: Path) -> None:
    tool = ROOT / "tools" / "install_check.py"
    done = subprocess.run([sys.executable, tool, tmp_path], capture_output=True, text=True)
    assert done.returncode == 1 and "no wheel and no source archive" in done.stderr


def test_the_first_animation_is_one_command_or_ten_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As they stand on the page, in an empty folder."""
    page = (ROOT / "docs" / "index.md").read_text("utf-8").partition("## First animation")[2].partition("\n## ")[0]
    monkeypatch.chdir(tmp_path)
    command = re.search(r"^    partita (.*)$", page, flags=re.MULTILINE)
    lines = re.search(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert command is not None and lines is not None
    assert main(command[1].split()) == 0
    assert lines[1].count("\n") <= 10
    exec(compile(lines[1], "index.md", "exec"), {})
    assert capsys.readouterr().err == ""
    for name in ("four-bar.html", "mine.html"):
        assert "<canvas" in (tmp_path / name).read_text("utf-8")
