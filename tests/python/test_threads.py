"""Threads that share mechanisms, models, results and steppers get what one thread gets.

With a lock in Python they take turns in it and run side by side in the core; in a free-threaded Python, for which the
release workflow runs this file before it publishes, nothing but Partita's own care keeps them apart.
"""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest

import partita as pt

WORKERS = 6
FREE = bool(sysconfig.get_config_var("Py_GIL_DISABLED"))


def at_once(work: Callable[[int], Any]) -> list[Any]:
    """What `work(0)`, `work(1)`, ... return in threads that begin together."""
    gate = Barrier(WORKERS)

    def begin(i: int) -> Any:
        gate.wait()
        return work(i)

    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(begin, range(WORKERS)))


def driven() -> pt.Mechanism:
    """A slider-crank with Python functions in a drive and in a torque, a gear beside it, sensors and a spring."""
    m = pt.Mechanism("press", gravity=(0, -9.81, 0))
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0.1, 0, 0), mass=0.5)
    rod = m.add_rod("rod", start=(0.1, 0, 0), end=(0.4, 0, 0), mass=0.8)
    ram = m.add_body("ram", mass=1.0, inertia=(0.01, 0.01, 0.01), position=(0.4, 0, 0))
    wheel = m.add_body("wheel", mass=1.0, inertia=(0.01, 0.01, 0.01), position=(0, 0.3, 0))
    m.add_revolute("main", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("big end", crank, rod, point=(0.1, 0, 0))
    m.add_revolute("small end", rod, ram, point=(0.4, 0, 0))
    m.add_prismatic("guide", m.ground, ram, axis=(1, 0, 0))
    m.add_revolute("shaft", m.ground, wheel, point=(0, 0.3, 0))
    m.add_gear("gear", "main", "shaft", ratio=-2.0)
    m.add_torque("motor", "main", lambda t, state: 2.0 - 0.05 * state.velocity("main"))
    m.add_force("load", ram, lambda t, state: (-10.0 * np.sin(t) ** 2, 0.0, 0.0))
    m.add_sensor("travel", "guide", "position")
    return m


def taken(run: pt.Result) -> tuple[bytes, ...]:
    """Everything that was computed, with what is computed on demand."""
    forces = [run.joint(name).force.tobytes() for name in run.names.joints]
    return (
        run.q.tobytes(),
        run.v.tobytes(),
        *forces,
        run.joint("guide").position.tobytes(),
        str(run.certificate).encode(),
    )


@pytest.mark.skipif(not FREE, reason="this Python has a lock")
def test_the_lock_stays_off() -> None:
    """An extension that does not declare itself safe would switch it on for the whole process."""
    program = "import sys, partita as pt; pt.catalogue.load('four-bar').simulate(0.1); print(sys._is_gil_enabled())"
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_mechanism_compiled_and_run_by_all_at_once() -> None:
    """Nobody has compiled it before: all threads do, or wait for the one that does."""
    wanted = [taken(driven().simulate(0.2 + 0.05 * i)) for i in range(WORKERS)]
    for _ in range(3):
        m = driven()
        assert at_once(lambda i, m=m: taken(m.simulate(0.2 + 0.05 * i))) == wanted  # type: ignore[misc]


def test_states_reports_and_analyses_of_one_mechanism() -> None:
    kinds: list[Callable[[pt.Mechanism], Any]] = [
        lambda m: str(m.report()),
        lambda m: m.assemble(targets={"A": 0.3}, rates={"A": 1.0}).q.tobytes(),
        lambda m: m.linearize(m.equilibrium()).modes().eigenvalues.tobytes(),
        lambda m: m.kinematics({"A": np.linspace(0.0, 1.0, 9)}).joint("D").position.tobytes(),
        lambda m: m.inverse_dynamics(m.simulate(0.1), actuators=["A"]).efforts.tobytes(),
        lambda m: m.assemble_many({"A": np.linspace(0.0, 0.5, 20)}).q.tobytes(),
    ]
    wanted = [kind(pt.catalogue.load("four-bar-spring")) for kind in kinds]
    for _ in range(3):
        m = pt.catalogue.load("four-bar-spring")
        assert at_once(lambda i, m=m: kinds[i](m)) == wanted  # type: ignore[misc]


def test_a_result_read_by_all_at_once() -> None:
    """Reactions and energies are evaluated when they are asked for first."""
    wanted = taken(driven().simulate(0.5))
    for _ in range(3):
        run = driven().simulate(0.5)
        assert at_once(lambda i, run=run: taken(run)) == [wanted] * WORKERS  # type: ignore[misc]


def test_steppers_of_one_mechanism_side_by_side() -> None:
    m = pt.catalogue.load("four-bar")

    def steps(i: int) -> bytes:
        stepper = m.stepper(0.01 * (1 + i))
        for _ in range(30):
            stepper.step()
        return bytes(stepper.q.tobytes())

    wanted = [steps(i) for i in range(WORKERS)]
    assert at_once(steps) == wanted


def test_mechanisms_drawn_saved_and_loaded_side_by_side(tmp_path: Path) -> None:
    names = pt.catalogue.names()

    def around(i: int) -> list[Any]:
        found = []
        for name in (names * 2)[i : i + 4]:
            path = tmp_path / f"{i} {name}.toml"
            m = pt.catalogue.load(name)
            m.save(path)
            found.append(pt.load(path).to_spec())
        return found

    wanted = [around(i) for i in range(WORKERS)]
    assert at_once(around) == wanted


def test_an_error_stays_in_its_thread() -> None:
    """Functions that fail in half of the threads, the runs of the others as ever."""
    wanted = taken(driven().simulate(0.3))

    def work(i: int) -> Any:
        m = driven()
        if i % 2:
            m.add_torque("faulty", "shaft", lambda t, state: 0.0 if t < 0.1 else float("nan"))
            stopped = m.simulate(0.3)
            return stopped.status, stopped.message, stopped.q.tobytes()
        return taken(m.simulate(0.3))

    found = at_once(work)
    assert found[::2] == [wanted] * 3
    assert len(set(found[1::2])) == 1 and found[1][0] == "evaluation-failed" and '"faulty"' in found[1][1]
