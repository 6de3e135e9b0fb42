"""A program that ends while threads are in the core: it ends as others do, without a word."""

from __future__ import annotations

import subprocess
import sys

import pytest

BEGIN = """
import sys, threading, time
import partita as pt
m = pt.Mechanism("m")
m.add_rod("r", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
m.add_revolute("A", m.ground, "r", point=(0, 0, 0))
begun = threading.Event()

def threads(work, count=3):
    def forever():
        while True:
            work()
    for _ in range(count):
        threading.Thread(target=forever, daemon=True).start()
    assert begun.wait(30)
    time.sleep(0.1)
"""
PROGRAMS = {
    "in a function of the user": """
def torque(t, state):
    begun.set()
    return 1.0
m.add_torque("A", torque)
threads(lambda: m.simulate(1e5, t_eval=[0, 1e5]))
""",
    "in a function that waits": """
def torque(t, state):
    begun.set()
    time.sleep(0.2)
    return 1.0
m.add_torque("A", torque)
threads(lambda: m.simulate(1.0))
""",
    "with progress": """
threads(lambda: m.simulate(1e6, t_eval=[0, 1e6], progress=lambda part: begun.set()))
""",
    "with a system of functions": """
def forces(t, q, v):
    begun.set()
    return -q
threads(lambda: pt.simulate(pt.System(1, mass=[[1.0]], forces=forces), 1e5, [1.0], [0.0], t_eval=[0, 1e5]))
""",
    "in compilation and assembly": """
def work():
    begun.set()
    pt.catalogue.load("andrews").assemble()
threads(work)
""",
}


def ended(program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", BEGIN + program], capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("where", PROGRAMS)
def test_daemon_threads_end_with_the_program(where: str) -> None:
    found = ended(PROGRAMS[where])
    assert (found.returncode, found.stderr) == (0, "")


def test_a_run_in_a_finaliser_is_refused_in_words() -> None:
    found = ended("""
class Last:
    def __del__(self):
        try:
            m.simulate(1.0)
        except pt.errors.PartitaError as error:
            sys.stdout.write(str(error))

import builtins
builtins.last = Last()
""")
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.startswith("the interpreter is ending, so nothing can be computed")


def test_a_run_at_exit_is_computed() -> None:
    found = ended("import atexit\natexit.register(lambda: print(m.simulate(1.0).success))")
    assert (found.returncode, found.stdout, found.stderr) == (0, "True\n", "")


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="this system has no fork")
def test_a_forked_process_ends_at_once() -> None:
    """Threads of its parent are not in it, and nobody waits for them."""
    found = ended("""
import os
def torque(t, state):
    begun.set()
    time.sleep(0.05)
    return 1.0
m.add_torque("A", torque)
threads(lambda: m.simulate(1.0))
child = os.fork()
if child == 0:
    sys.exit(7)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
""")
    assert (found.returncode, found.stdout, found.stderr) == (0, "7\n", "")
