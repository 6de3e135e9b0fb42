"""`import partita` takes what NumPy takes, and little more: what is slow to import is imported by what needs it."""

import subprocess
import sys

HEAVY = ("scipy", "matplotlib", "xarray", "pandas", "pyarrow", "jsonschema")


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
