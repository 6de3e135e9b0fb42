"""Installing Partita where nothing else is, and using it there as a newcomer does.

python tools/install_check.py              build wheel and source archive, install each, and the folder itself
python tools/install_check.py FILE|FOLDER  install these instead (a wheel, a source archive, all in a folder)
python tools/install_check.py --pythons    name the Pythons of this machine into which wheels are installed

Each goes into an empty environment of its own: a wheel into one of every Python from 3.10 on that this machine has,
with no program on the PATH but those of the environment, so without a compiler. There must then be NumPy, SciPy and
Partita, and nothing else. The first example of the front page runs and writes its page far from this folder, the
command line answers, what needs an extra says which, and every command and block of docs/five-minutes.md does what the
page says. A wheel for Linux is smaller than 8.3 MB and gives the first page in less than a minute; from source, the
core is compiled: minutes.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import wheels

ROOT = Path(__file__).resolve().parents[1]
WINDOWS = os.name == "nt"
PROGRAMS = "Scripts" if WINDOWS else "bin"
HARD = {"numpy", "scipy", "partita"}
TOOLS = {"pip", "setuptools"}
LIMIT = 60.0
"""Seconds from an empty folder to the first page, with a wheel."""
OLDEST = (3, 10)
COMPILERS = ("cc", "gcc", "clang", "cl", "rustc", "cargo")
PYTHON = re.compile(r"^```python\n(.*?)^```\n(?:```output\n(.*?)^```\n)?", flags=re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^    (\S.*)$", flags=re.MULTILINE)

BLOCKS = """
import contextlib, io, json, sys
names = {"__name__": "page"}
for code, printed in json.load(sys.stdin):
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(code, "page", "exec"), names)
    lines = [line.rstrip() for line in said.getvalue().splitlines()]
    assert not printed or lines == printed.splitlines(), f"printed {lines} where the page says {printed!r}"
"""
EXTRAS = """
import partita as pt, pathlib, sys
assert pathlib.Path(pt.__file__).is_relative_to(sys.prefix), pt.__file__
run = pt.catalogue.load("four-bar").simulate(0.2)
for name in ("run.json", "run.csv", "run.mat"):
    assert (pt.load_result(run.save(name)).q == run.q).all()
for name in pt.catalogue.names():
    pt.catalogue.load(name).compile()
if len(sys.argv) > 1:
    pt.catalogue.load("four-bar").to_fmu(sys.argv[1])
for extra, call in {
    "plots": run.plot, "xarray": run.to_xarray, "pandas": run.to_pandas, "netcdf": lambda: run.save("run.nc"),
    "zarr": lambda: run.save("run.zarr"), "parquet": lambda: run.save("run.parquet"),
    "progress": lambda: pt.catalogue.load("four-bar").simulate(0.1, progress=True),
}.items():
    try:
        call()
    except pt.errors.MissingDependencyError as error:
        assert f"partita[{extra}]" in str(error), error
    else:
        raise AssertionError(f"{extra}: no error")
"""


class Environment:
    """An empty folder, with a new environment of one Python in it."""

    def __init__(self, folder: Path, python: str, alone: bool) -> None:
        self.folder = folder
        self.programs = folder / ".venv" / PROGRAMS
        self.variables = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
        self.variables["PIP_DISABLE_PIP_VERSION_CHECK"] = "1"
        self.variables["PYO3_PYTHON"] = str(self.programs / "python")
        if alone:
            only = folder / "programs"  # what `python` is, before there is an environment
            only.mkdir()
            if WINDOWS:
                self.variables["PATH"] = str(Path(python).parent)
            else:
                (only / "python").symlink_to(python)
                self.variables["PATH"] = os.pathsep.join((str(self.programs), str(only)))
            found = [name for name in COMPILERS if shutil.which(name, path=self.variables["PATH"])]
            assert not found, f"{found} are on the PATH"
        self.run(python, "-m", "venv", ".venv")

    def run(self, *command: str, asked: str | None = None) -> str:
        """What the command prints, once it has ended well."""
        done = subprocess.run(
            command, cwd=self.folder, env=self.variables, check=False, capture_output=True, text=True, input=asked
        )
        assert done.returncode == 0, f"{command[:4]} ended with {done.returncode}: {done.stderr[-2000:]}"
        return done.stdout

    def python(self, *arguments: str, asked: str | None = None) -> str:
        """Likewise, of the environment's Python."""
        return self.run(str(self.programs / "python"), *arguments, asked=asked)


def main(given: list[str]) -> int:
    """Try everything that is asked for; 1 if anything fails."""
    if given == ["--pythons"]:
        print("\n".join(f"{version}: {path}" for version, path in pythons().items()))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        found = [Path(word).resolve() for word in given] or [*built(Path(folder)), ROOT]
        for path in [one for given in found for one in archives(given)]:
            wheel = path.suffix == ".whl"
            if wheel and wheels.size(path):
                print(f"{path.name}: {wheels.size(path)[0]}", file=sys.stderr)
                return 1
            where_it_fits = {version: at for version, at in pythons().items() if not wheel or fits(path, version)}
            if not where_it_fits:
                print(f"{path.name}: no Python of this machine can load it", file=sys.stderr)
                return 1
            for version, python in (where_it_fits if wheel else {"": sys.executable}).items():
                try:
                    seconds, more = check(path, python)
                    assert not wheel or seconds < LIMIT, f"the first page took {seconds:.0f} s, not {LIMIT:.0f}"
                except (subprocess.CalledProcessError, AssertionError) as error:
                    print(f"{path.name} {version}: {error}", file=sys.stderr)
                    return 1
                where = f" in Python {version}" if version else ""
                print(
                    f"{path.name}: installed alone{where}; the first page after {seconds:.0f} s, all commands of the "
                    f"first five minutes and the others after {more:.0f} s",
                    flush=True,
                )
    return 0


def pythons() -> dict[str, str]:
    """Version and path of every Python of this machine that Partita supports, one of each minor version and build."""
    names = ["python3", "python", *(f"python3.{minor}{kind}" for minor in range(OLDEST[1], 30) for kind in ("", "t"))]
    kept = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = [sys.executable, *filter(None, map(shutil.which, names)), *map(str, kept.glob(f"*/{PROGRAMS}/python*"))]
    asked = (
        "import sys, sysconfig; print(*sys.version_info[:2], sysconfig.get_config_var('Py_GIL_DISABLED') or 0, "
        "sys.implementation.name, getattr(sys, '_base_executable', None) or sys.executable); import venv, ensurepip"
    )
    known: dict[tuple[int, int, bool], str] = {}
    for path in dict.fromkeys(found):
        if re.fullmatch(r"python[\d.]*t?(\.exe)?", Path(path).name) is None:
            continue
        done = subprocess.run([path, "-c", asked], capture_output=True, text=True, check=False)
        words = done.stdout.split(maxsplit=4)
        if done.returncode != 0 or len(words) != 5 or words[3] != "cpython":
            continue
        version = int(words[0]), int(words[1]), words[2] == "1"
        if version[:2] >= OLDEST:
            known.setdefault(version, words[4].strip())
    return {f"{a}.{b}{'t' if free else ''}": known[a, b, free] for a, b, free in sorted(known)}


def fits(wheel: Path, version: str) -> bool:
    """Whether a wheel is for this version: for all that have the stable interface, or for one."""
    python, abi = wheel.stem.split("-")[2:4]
    if abi.startswith("abi3"):
        return not version.endswith("t")
    return abi == "cp" + version.replace(".", "") and python == abi.rstrip("t")


def archives(path: Path) -> list[Path]:
    """The wheels and source archives in a folder; a single file, and the folder of the project, as they are."""
    if path.is_file() or path == ROOT:
        return [path]
    found = sorted([*path.glob("*.whl"), *path.glob("*.tar.gz")])
    if not found:
        raise SystemExit(f"there is no wheel and no source archive in {path}")
    return found


def built(folder: Path) -> list[Path]:
    """The wheel and the source archive of this folder."""
    wheel = [sys.executable, "tools/wheels.py", *(["--zig"] if sys.platform == "linux" else [])]
    for command in (wheel, [str(Path(sys.executable).with_name("maturin")), "sdist"]):
        subprocess.run([*command, "--out", str(folder)], cwd=ROOT, check=True)
    return [folder]


def check(path: Path, python: str) -> tuple[float, float]:
    """Install `path` into an empty environment and use it there: seconds to the first page, and to the end."""
    wheel = path.suffix == ".whl"
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        first = Environment(Path(folder), python, alone=wheel)
        first.python("-m", "pip", "install", "--quiet", str(path))
        first.python("-c", blocks("README.md")[0][0])
        assert (first.folder / "four-bar.html").stat().st_size > 10_000
        seconds = time.monotonic() - begun
        listed = json.loads(first.python("-m", "pip", "list", "--format", "json"))
        names = {item["name"].lower() for item in listed} - TOOLS
        assert names == HARD, f"installed are {sorted(names)} instead of {sorted(HARD)}"
        first.python("-c", EXTRAS, *(["four-bar.fmu"] if wheel else []))
        command = str(first.programs / "partita")
        assert "simulate" in first.run(command, "--help")
        assert "four-bar" in first.run(command, "list")
        assert "degrees of freedom" in first.run(command, "check", "four-bar")
        (listed_command,) = [command for command in commands("index.md") if not command.startswith("pip")][:1]
        first.run(*local(listed_command, first))
    if wheel:
        with tempfile.TemporaryDirectory() as folder:
            five_minutes(path, Path(folder), python)
    return seconds, time.monotonic() - begun


def five_minutes(wheel: Path, folder: Path, python: str) -> None:
    """The page of the first five minutes, followed by the letter: its commands, then its blocks; the wheel is what the
    package index would give."""
    asked = commands("five-minutes.md")
    assert [command.split()[-1] for command in asked] == [".venv", "partita"], asked
    (folder / "constraint.txt").write_text(f"partita @ {wheel.as_uri()}\n", "utf-8")
    empty = Environment(folder, python, alone=True)
    empty.variables["PIP_CONSTRAINT"] = str(folder / "constraint.txt")
    shutil.rmtree(folder / ".venv")
    for command in asked:
        empty.run(*local(command, empty))
    empty.python("-c", BLOCKS, asked=json.dumps(blocks("five-minutes.md")))
    for name in ("press.html", "press.csv"):
        assert (folder / name).stat().st_size > 1_000, name


def local(command: str, where: Environment) -> list[str]:
    """A command as it is written on Linux and macOS, on this system."""
    first, *others = command.split()
    if first == "python" and not WINDOWS:
        first = str(where.folder / "programs" / "python")
    elif first == "partita" or first.startswith(".venv/"):
        first = str(where.programs / Path(first).name)
    return [sys.executable if first == "python" else first, *others]


def commands(page: str) -> list[str]:
    """The commands on a page of docs/: indented lines."""
    text = (ROOT / "docs" / page).read_text("utf-8")
    return COMMAND.findall(re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


def blocks(page: str) -> list[tuple[str, str]]:
    """The Python blocks of a page, and what they print."""
    path = ROOT / page if page == "README.md" else ROOT / "docs" / page
    found: Iterable[tuple[str, str]] = PYTHON.findall(path.read_text("utf-8"))
    assert found, f"{page} shows no Python"
    return list(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
