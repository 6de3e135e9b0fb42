"""Sweeps over a Dask cluster of processes, as in docs/sweeps.md: equal to the serial one, also where a worker dies."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

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
'''


@pytest.fixture(scope="module")
def four_bars(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The page's model and grid as a module that workers can import."""
    folder = tmp_path_factory.mktemp("sweeps")
    code = re.findall(r"^```python\n(.*?)^```\n", PAGE, re.S | re.M)[0]
    (folder / "four_bars.py").write_text(code.split("found = ")[0] + KILLER, "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.setenv("PYTHONPATH", str(folder))
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


def test_the_study_of_the_page_names_what_is_there() -> None:
    study = re.findall(r"^```py\n(.*?)^```\n", PAGE, re.S | re.M)[0]
    compile(study, "study.py", "exec")
    assert all(hasattr(distributed, name) for name in ("Client", "LocalCluster"))
