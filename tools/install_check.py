"""Installing Partita where nothing else is, and running the first example of the front page there.

python tools/install_check.py              build wheel and source archive, install each, and the folder itself
python tools/install_check.py FILE|FOLDER  install these instead (a wheel, a source archive, all in a folder)

Each goes into an empty environment of its own. There must then be NumPy, SciPy and Partita, and nothing else; the
example runs far from this folder; what needs an extra says which. Compiles the core for each but a wheel: minutes.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HARD = {"numpy", "scipy", "partita"}
TOOLS = {"pip", "setuptools"}

EXTRAS = """
import partita as pt, pathlib, sys
assert pathlib.Path(pt.__file__).is_relative_to(sys.prefix), pt.__file__
run = pt.catalogue.load("four-bar").simulate(0.2)
for name in ("run.json", "run.csv", "run.mat"):
    assert (pt.load_result(run.save(name)).q == run.q).all()
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


def main(given: list[str]) -> int:
    """Try everything that is asked for; 1 if anything fails."""
    with tempfile.TemporaryDirectory() as folder:
        found = [Path(word).resolve() for word in given] or [*built(Path(folder)), ROOT]
        for path in [one for given in found for one in archives(given)]:
            begun = time.monotonic()
            try:
                check(path)
            except (subprocess.CalledProcessError, AssertionError) as error:
                print(f"{path.name}: {error}", file=sys.stderr)
                return 1
            print(
                f"{path.name}: installed alone, the first example runs ({time.monotonic() - begun:.0f} s)", flush=True
            )
    return 0


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
    maturin = str(Path(sys.executable).with_name("maturin"))
    for command in (["build", "--release", "--locked"], ["sdist"]):
        subprocess.run([maturin, *command, "--out", str(folder)], cwd=ROOT, check=True)
    return [folder]


def check(path: Path) -> None:
    """Install `path` into an empty environment and use it there."""
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        venv.create(base / "env", with_pip=True)
        programs = base / "env" / ("Scripts" if os.name == "nt" else "bin")
        python, work = str(programs / "python"), base / "work"
        work.mkdir()
        kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
        kept["PYO3_PYTHON"] = python

        def run(*command: str) -> str:
            done = subprocess.run(command, cwd=work, env=kept, check=False, capture_output=True, text=True)
            assert done.returncode == 0, f"{command[:4]} ended with {done.returncode}: {done.stderr[-2000:]}"
            return done.stdout

        run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(path))
        listed = json.loads(run(python, "-m", "pip", "list", "--format", "json", "--disable-pip-version-check"))
        names = {item["name"].lower() for item in listed} - TOOLS
        assert names == HARD, f"installed are {sorted(names)} instead of {sorted(HARD)}"
        run(python, "-c", first_example())
        assert (work / "four-bar.html").stat().st_size > 10_000
        run(python, "-c", EXTRAS)
        assert "degrees of freedom" in run(str(programs / "partita"), "check", "four-bar")


def first_example() -> str:
    """The first Python block of the front page."""
    found = re.search(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert found is not None, "the front page shows no Python"
    return found[1]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
