"""What a sweep of short members costs over a Dask cluster of two processes, in CPU time of all processes.

The members are a loop of half a millisecond that measures its own CPU time: the sum of these is the work's own cost. A
serial loop over the same members, run before and after, shows how much dearer it is where processes share a core. The
cost of the cluster while it has nothing to do is Dask's own. Without psutil and Dask nothing is measured.
"""

from __future__ import annotations

import importlib.util
import os
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import partita as pt

MEMBERS = 10_000
AIM = 1.2
LOOP = 9000
"""Rounds of a member."""
SLEEP = 5.0
"""Seconds for which the cluster is watched doing nothing."""


@dataclass(frozen=True)
class Cost:
    """CPU time [s] of a sweep by all processes, by the parent, by the members; of the serial loop; of the idle cluster
    for as long as the sweep took, which is `wall`.
    """

    title: str
    cpu: float
    parent: float
    members: float
    serial: float
    idle: float
    wall: float
    same: bool

    @property
    def ratio(self) -> float:
        """The sweep over the work's own cost."""
        return self.cpu / self.members


def member(x: int) -> dict[str, float]:
    """A loop of the same length for all, and its CPU time."""
    began, total = time.thread_time(), 0.0
    for i in range(LOOP):
        total += x * i
    return {"total": total, "cpu": time.thread_time() - began}


def sweep_costs() -> list[Cost]:
    """A sweep in memory, and one with a store."""
    if not all(importlib.util.find_spec(name) for name in ("distributed", "psutil", "xarray")):
        return []
    import dask

    dask.config.set({"logging.distributed": "critical"})
    from distributed import Client, LocalCluster

    grid: dict[str, Any] = {"x": range(MEMBERS)}
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), *([before] if before else [])])
    found = []
    try:
        with (
            LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
            TemporaryDirectory() as folder,
        ):
            client.wait_for_workers(2)
            pt.sweep(member, {"x": [0, 1, 2, 3]}, executor=client.get_executor())  # imports what a first sweep imports
            began, before_sleep = time.perf_counter(), sum(_cpu().values())
            time.sleep(SLEEP)
            idle = (sum(_cpu().values()) - before_sleep) / (time.perf_counter() - began)
            for title, store in (("in memory", None), ("with a store", Path(folder) / "runs")):
                serial, parent, all_before = _serial(), time.process_time(), _cpu()
                began = time.perf_counter()
                swept = pt.sweep(member, grid, executor=client.get_executor(), store=store)
                wall, all_after = time.perf_counter() - began, _cpu()
                parent = time.process_time() - parent
                serial = 0.5 * (serial + _serial())
                same = swept.total.values.tolist() == [member(x)["total"] for x in range(MEMBERS)]
                cpu = sum(seconds - all_before.get(process, 0.0) for process, seconds in all_after.items())
                found.append(Cost(title, cpu, parent, float(swept.cpu.sum()), serial, idle * wall, wall, same))
    finally:
        os.environ.pop("PYTHONPATH")
        if before is not None:
            os.environ["PYTHONPATH"] = before
    return found


def _serial() -> float:
    began = time.process_time()
    for x in range(MEMBERS):
        member(x)
    return time.process_time() - began


def _cpu() -> dict[int, float]:
    """CPU time of this process and of those that it started."""
    import psutil

    me = psutil.Process()
    return {process.pid: sum(process.cpu_times()[:2]) for process in [me, *me.children(recursive=True)]}
