"""`import partita` takes what NumPy takes, and little more: what is slow to import is imported by what needs it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import partita as pt

HEAVY = (
    "scipy", "matplotlib", "xarray", "pandas", "pyarrow", "h5py", "h5netcdf", "zarr", "tqdm", "yaml", "mujoco",
    "jsonschema", "multiprocessing", "viser", "casadi", "jax", "sympy",
)  # fmt: skip


def test_importing_and_drawing_need_numpy_alone() -> None:
    program = """
import sys
import partita as pt
m = pt.Mechanism("pendulum")
rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
assert m.simulate(0.1).success
m.report()
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    packages = {name.partition(".")[0] for name in done.stdout.split()}
    assert "numpy" in packages and packages.isdisjoint(HEAVY), sorted(packages.intersection(HEAVY))


def test_figures_without_matplotlib_name_the_extra(tmp_path: Path) -> None:
    """In Python and on the command line, where it is reported before the run."""
    program = """
import sys
sys.modules["matplotlib"] = None
import partita as pt
from partita.cli import main
run = pt.catalogue.load("four-bar").simulate(0.1)
comparison = pt.catalogue.load("planar-pendulum").compare(0.1, formulations=["projective"], selections=["collective"])
for draw in (run.plot, lambda: pt.plots, comparison.plot):
    try:
        draw()
    except pt.errors.MissingDependencyError as error:
        assert error.package == "matplotlib" and "pip install 'partita[plots]'" in str(error), error
    else:
        raise AssertionError("no error")
assert main(["simulate", "four-bar", "--plot", "a.png", "--save", "a.json"]) == 2
assert main(["compare", "planar-pendulum", "--time", "0.1", "--formulations", "projective", "--plot", "a.png"]) == 2
assert main(["compare", "planar-pendulum", "--time", "0.1", "--formulations", "projective"]) == 0  # nothing is drawn
run.to_html("page.html")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "partita[plots]" in done.stderr and [p.name for p in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_commands_of_the_first_pages_run_with_numpy_and_scipy_alone(page: str, tmp_path: Path) -> None:
    """Or name an extra, which the page names as well, where it says how to install."""
    whole = (Path(__file__).parents[2] / page).read_text("utf-8")
    text = whole.partition("## Command line")[2]
    commands = [line.split("  ")[0].split()[1:] for line in re.findall(r"^    (partita .*)$", text, flags=re.MULTILINE)]
    assert len(commands) >= 11
    (named,) = set(re.findall(r"pip install '\.\[(.*?)\]'", whole))
    pt.catalogue.load("four-bar").save(tmp_path / "a.toml")
    program = f"""
import sys
for name in {[name for name in (*HEAVY, "shtab") if name not in ("scipy", "multiprocessing")]}:
    sys.modules[name] = None
import partita as pt
from partita.cli import main
pt.catalogue.load("four-bar").simulate(0.1).save("out.json")
for words in {commands}:
    words = [word.replace("out.nc", "out.json") if "--save" not in words else word for word in words]
    print(main(words), *words, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True)
    wanted = re.findall(r"^partita: error: .* pip install 'partita\[(\w+)\]'\n2 ", done.stderr, flags=re.MULTILINE)
    assert set(wanted) == set(named.split(","))
    ended = re.findall(r"^(\d) ", done.stderr, flags=re.MULTILINE)
    assert len(ended) == len(commands) and ended.count("2") == len(wanted) and set(ended) == {"0", "2"}, done.stderr
