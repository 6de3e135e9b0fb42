"""`import partita` takes what NumPy takes, and little more: what is slow to import is imported by what needs it."""

import subprocess
import sys
from pathlib import Path

HEAVY = (
    "scipy", "matplotlib", "xarray", "pandas", "pyarrow", "h5py", "h5netcdf", "zarr", "tqdm", "yaml", "mujoco",
    "jsonschema", "multiprocessing", "viser",
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
run.to_html("page.html")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "partita[plots]" in done.stderr and [p.name for p in tmp_path.iterdir()] == ["page.html"]
