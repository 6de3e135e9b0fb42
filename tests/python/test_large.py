"""Mechanisms of many loops: names are looked up, not searched for, and Ctrl-C is heard while the core works."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from moved_drawings import as_typed
from pressing import pressed_after
from thorough import either

import partita as pt
from partita import _core
from partita.builder.spec import Writer
from partita.state import Layout


class Counted(str):
    """A name that counts how often it is compared with another one."""

    compared = 0

    def __eq__(self, other: object) -> bool:
        Counted.compared += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


def chain(loops: int) -> pt.Mechanism:
    """A chain of parallelograms with a drive, a torque and a spring in each, all of its names counted."""
    m = pt.Mechanism("chain")
    ground, before = Counted("ground"), Counted("upright 0")
    m.add_rod(before, start=(0, 0, 0), end=(0, 1, 0), mass=1.0)
    m.add_revolute(Counted("P0"), ground, before, point=(0, 0, 0))
    for i in range(1, loops + 1):
        upright, coupler, pin = Counted(f"upright {i}"), Counted(f"coupler {i}"), Counted(f"P{i}")
        m.add_rod(upright, start=(i, 0, 0), end=(i, 1, 0), mass=1.0)
        m.add_rod(coupler, start=(i - 1, 1, 0), end=(i, 1, 0), mass=1.0)
        m.add_revolute(pin, ground, upright, point=(i, 0, 0))
        m.add_revolute(Counted(f"L{i}"), before, coupler, point=(i - 1, 1, 0))
        m.add_revolute(Counted(f"R{i}"), upright, coupler, point=(i, 1, 0))
        m.add_drive(pin, 0.0)
        m.add_torque(pin, 1.0)
        m.add_torque("P0", 1.0)
        m.add_spring(Counted(f"S{i}"), ground, (i, 0, 0), coupler, (0.5, 0, 0), stiffness=1.0)
        before = upright
    return m


def comparisons(loops: int) -> int:
    before = Counted.compared
    m = chain(loops)
    Writer(m._description, Layout()).text()
    return Counted.compared - before


def test_names_are_looked_up_however_many_there_are() -> None:
    few, many = comparisons(20), comparisons(400)
    assert many <= 20 * few + 400, "a name is compared with names of other loops"


@as_typed
def test_the_text_for_the_core_is_the_description() -> None:
    m = chain(3)
    assert json.loads(Writer(m._description, Layout()).text()) == m.to_spec()


def test_names_made_for_many_forces_on_one_joint_are_counted_on() -> None:
    m = chain(4)
    assert [name for name in m.forces if name.startswith("torque on P0")] == [
        "torque on P0", "torque on P0 2", "torque on P0 3", "torque on P0 4",
    ]  # fmt: skip


def test_a_file_of_many_loops_is_the_same_mechanism(tmp_path: Path) -> None:
    m = chain(150)
    path = tmp_path / "chain.toml"
    m.save(path)
    assert pt.load(path).to_spec() == m.to_spec()


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> tuple[pt.Mechanism, str, Path]:
    """A chain long enough for everything asked of it to take a while; its description and its file."""
    m = pt.catalogue.load("n-four-bar", loops=either(3000, 6000))
    path = tmp_path_factory.mktemp("large") / "chain.toml"
    m.save(path)
    return m, Writer(m._description, Layout()).text(), path


def work(what: str, large: tuple[pt.Mechanism, str, Path]) -> Callable[[], Any]:
    """One call of the core, or of what leads to it, that takes far longer than the delay before Ctrl-C."""
    m, text, path = large
    if what == "compile":
        return lambda: _core.Model(text, [], "relative").summary
    if what == "report":
        core = m.compile().core
        q = core.initial()[0]
        return lambda: core.report(0.0, q)
    if what == "load":
        return lambda: pt.load(path)
    core = m.compile().core
    q, v = core.initial()
    q[: len(q) // 2] += 1e-3
    return lambda: core.assemble(0.0, q, v, [], [(0, 1.0)], [], [], [], 1e-12)


@pytest.mark.parametrize("what", ["compile", "report", "load", "assemble"])
def test_control_c_is_heard_within_a_second(what: str, large: tuple[pt.Mechanism, str, Path]) -> None:
    call = work(what, large)
    with pressed_after(0.05) as when, pytest.raises(KeyboardInterrupt):
        while True:  # ends by Ctrl-C alone
            call()
    assert time.monotonic() - when[0] < 1.0


def side_by_side(size: int) -> pt.Mechanism:
    """Four-bars that share the ground alone."""
    m = pt.Mechanism(f"{size} four-bars")
    for i in range(size):
        a, b, c, d = ((x, y, float(i)) for x, y in ((0.0, 0.0), (0.3, 0.4), (1.1, 0.7), (1.0, 0.0)))
        for name, start, end in (("crank", a, b), ("coupler", b, c), ("rocker", d, c)):
            m.add_rod(f"{name} {i}", start=start, end=end, mass=1.0)
        m.add_revolute(f"A{i}", m.ground, f"crank {i}", point=a)
        m.add_revolute(f"B{i}", f"crank {i}", f"coupler {i}", point=b)
        m.add_revolute(f"C{i}", f"coupler {i}", f"rocker {i}", point=c)
        m.add_revolute(f"D{i}", m.ground, f"rocker {i}", point=d)
    return m


def test_the_start_of_a_run_costs_in_proportion_to_the_loops() -> None:
    """Ten times the loops side by side: a run of one step costs some 10 times as much; busy machines are allowed 30.

    Looking at each loop in a copy of the whole cost 500 times as much.
    """

    def seconds(size: int) -> float:
        m = side_by_side(size)
        start = m.assemble()
        spent = []
        for _ in range(either(3, 7)):
            began = time.process_time()
            assert m.simulate(1e-4, initial=start, t_eval=[0.0, 1e-4]).success
            spent.append(time.process_time() - began)
        return min(spent)

    assert seconds(1000) < 30.0 * seconds(100)


@pytest.mark.parametrize("loops", [2, 40, 200])
def test_ordinary_steps_are_not_searched_however_many_loops_there_are(loops: int) -> None:
    """The smallest singular value of all of C falls with the number of loops, what each loop is away from singular does
    not: no step before the first singular position (0.71 s) is looked into."""
    entry = pt.catalogue.entry("n-four-bar", loops=loops)
    m = entry.mechanism()
    counters = m.simulate(0.6, t_eval=[0.6], initial=entry.initial(m), rtol=1e-10, atol=1e-12).counters
    assert counters["dense_evaluations"] == 0
    assert counters["factorisations"] < counters["evaluations"] + 2 * counters["steps"]
