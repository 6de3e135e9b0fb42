"""Sweeps over clusters, as in docs/sweeps.md: equal to the serial one, also where a worker or the parent is killed.

Dask on a local cluster of processes; MPI and Ray, where they are installed, in `make trust`.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from thorough import THOROUGH

import partita as pt

pytest.importorskip("xarray")
distributed = pytest.importorskip("distributed")
pytest.importorskip("dask").config.set({"logging.distributed": "critical"})

PAGE = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text("utf-8")
KILLER = '''

def killed_once(coupler, rocker_mass):
    """Kills its own process the first time that it is asked for one of the points."""
    import os
    import pathlib
    import signal

    mark = pathlib.Path(__file__).with_name("mark")
    if rocker_mass == 2.0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return four_bar(coupler, rocker_mass)


def written_down(x):
    """One number, after a millisecond; each call leaves a line."""
    import pathlib
    import time

    with pathlib.Path(__file__).with_name("calls").open("a") as file:
        file.write(f"{x}\\n")
    time.sleep(0.001)
    return {"twice": 2.0 * x}
'''


@pytest.fixture(scope="module")
def four_bars(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The page's model and grid as a module that workers can import."""
    folder = tmp_path_factory.mktemp("sweeps")
    code = re.findall(r"^```python\n(.*?)^```\n", PAGE, re.S | re.M)[0]
    (folder / "four_bars.py").write_text(code.split("found = ")[0] + KILLER, "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(Path(pt.__file__).parents[1])]))
        import four_bars  # type: ignore[import-not-found]

        yield four_bars
        del sys.modules["four_bars"]


@pytest.fixture(scope="module")
def client(four_bars: ModuleType) -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.filterwarnings("ignore")  # of the cluster's own
def test_a_cluster_gives_the_same_and_a_killed_worker_takes_nothing_along(client: Any, four_bars: ModuleType) -> None:
    serial = pt.sweep(four_bars.four_bar, four_bars.grid)
    assert not (serial.failed != "").any()
    assert pt.sweep(four_bars.four_bar, four_bars.grid, executor=client.get_executor()).identical(serial)
    assert pt.sweep(four_bars.killed_once, four_bars.grid, executor=client.get_executor()).identical(serial)
    assert Path(four_bars.__file__).with_name("mark").exists()


KILLED_AT_HALF = """
import os, signal, sys
from distributed import Client

import four_bars
import partita as pt

def report(part):
    if part >= 0.5:
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    with Client(sys.argv[1]) as client:
        pt.sweep(four_bars.written_down, {"x": range(2000)}, executor=client.get_executor(), store=sys.argv[2],
                 progress=report)
"""


@pytest.mark.filterwarnings("ignore")  # of the cluster's own
def test_a_killed_parent_is_continued_on_the_cluster(client: Any, four_bars: ModuleType, tmp_path: Path) -> None:
    """The first half is not computed again, but for the batches that were under way; few tasks for many members."""
    script = tmp_path / "killed.py"
    script.write_text(KILLED_AT_HALF, "utf-8")
    place = tmp_path / "runs"
    address = client.scheduler.address
    ended = subprocess.run([sys.executable, script, address, place], timeout=120, capture_output=True, text=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    known = np.flatnonzero(pt.load_sweep(place).failed.values != "not computed")
    assert 1000 <= len(known) < 2000
    given: list[int] = []

    class Watched:
        """Dask's executor, which says how many members each task has."""

        _max_workers = 2

        def submit(self, function: Any, *arguments: Any) -> Any:
            given.append(len(arguments[1]))
            return client.get_executor().submit(function, *arguments)

    found = pt.sweep(four_bars.written_down, {"x": range(2000)}, executor=Watched(), store=place)  # type: ignore[arg-type, dict-item]
    assert sum(given) >= 2000 - len(known) and len(given) < 40
    counted = np.bincount(np.loadtxt(Path(four_bars.__file__).with_name("calls"), dtype=int), minlength=2000)
    assert (counted[known] == 1).all() and (counted >= 1).all()
    assert np.array_equal(found.twice.values, 2.0 * np.arange(2000)) and not (found.failed != "").any()
    assert found.identical(pt.load_sweep(place))


OVER_MPI = """
import sys
from mpi4py.futures import MPIPoolExecutor

import four_bars
import partita as pt

if __name__ == "__main__":
    with MPIPoolExecutor() as pool:
        found = pt.sweep(four_bars.four_bar, four_bars.grid, executor=pool, store=sys.argv[1])
        assert pool.num_workers == 2 and found.identical(pt.load_sweep(sys.argv[1]))
"""


@pytest.mark.skipif(not THOROUGH, reason="processes of MPI take seconds to start: make trust")
def test_mpi_gives_the_same(four_bars: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("mpi4py", reason="mpi4py is no pinned tool: it needs an MPI of the machine")
    start = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    if start is None:
        pytest.skip("there is no mpiexec")
    script = tmp_path / "over_mpi.py"
    script.write_text(OVER_MPI, "utf-8")
    words = [start, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script), str(tmp_path / "runs")]
    ended = subprocess.run(words, timeout=120, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert pt.load_sweep(tmp_path / "runs").identical(pt.sweep(four_bars.four_bar, four_bars.grid))


@pytest.mark.skipif(not THOROUGH, reason="Ray takes half a minute to start: make trust")
@pytest.mark.filterwarnings("ignore")  # of Ray's own
def test_ray_gives_the_same(four_bars: ModuleType) -> None:
    ray = pytest.importorskip("ray", reason="ray is no pinned tool: it takes 240 MB")
    code = re.findall(r"^```py\n(.*?)^```\n", PAGE, re.S | re.M)[1]
    names: dict[str, Any] = {}
    exec(code, names)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        found = pt.sweep(four_bars.four_bar, four_bars.grid, executor=names["OnRay"](), workers=2)
    finally:
        ray.shutdown()
    assert found.identical(pt.sweep(four_bars.four_bar, four_bars.grid))


def test_the_study_of_the_page_names_what_is_there() -> None:
    study = re.findall(r"^```py\n(.*?)^```\n", PAGE, re.S | re.M)[0]
    compile(study, "study.py", "exec")
    assert all(hasattr(distributed, name) for name in ("Client", "LocalCluster"))
