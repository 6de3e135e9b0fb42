"""Runs whose evaluations are compiled: the same to the bit as those without, and named in the counters."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
from catalogue_runs import WITHOUT_EVENTS
from oracle import chance, elements
from oracle.comparison import moving

import partita as pt
from partita.errors import ArgumentError, PartitaError

PART = 0.03
"""Part of an entry's motion that is run twice."""

SEEDS = range(20)
"""Mechanisms by chance, half of them with every element."""


def compiled(run: Any) -> int:
    return run.counters["compiled_evaluations"]


def same(m: pt.Mechanism, duration: float, **options: Any) -> Any:
    """The run with compiled evaluations, after it was found to be the one without."""
    plain = m.simulate(duration, compiled=False, **options)
    run = m.simulate(duration, compiled=True, **options)
    assert compiled(plain) == 0
    assert (run.status, run.message) == (plain.status, plain.message)
    for name in ("t", "q", "v", "vdot", "multipliers"):
        x, y = getattr(run, name), getattr(plain, name)
        assert np.array_equal(x, y, equal_nan=True), (name, np.nanmax(np.abs(x - y)))
    assert np.array_equal(run.energy.work, plain.energy.work)
    counts = {name: count for name, count in run.counters.items() if name != "compiled_evaluations"}
    assert counts == {name: plain.counters[name] for name in counts}
    refused = [note for note in run.notes if "not compiled" in note or "does not use compiled" in note]
    assert [note for note in run.notes if note not in refused] == list(plain.notes)
    assert bool(refused) == (compiled(run) == 0), run.notes
    assert [p.independent for p in run.partitions] == [p.independent for p in plain.partitions]
    return run


@pytest.mark.parametrize("name", WITHOUT_EVENTS)
def test_the_catalogue_moves_as_without_to_the_bit(name: str) -> None:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    end = PART * entry.duration
    run = same(m, end, initial=entry.initial(m), t_eval=np.linspace(0.0, end, 5))
    assert compiled(run) > 0


def test_mechanisms_by_chance_move_as_without_to_the_bit() -> None:
    served = 0
    for seed in SEEDS:
        drawing = chance.mechanism(seed) if seed % 2 else elements.mechanism(seed)
        try:
            m = drawing.build()
            start = moving(m, drawing, np.random.default_rng(seed))
        except PartitaError:
            continue
        end = 0.05 * drawing.time
        for coordinates in ("relative", "absolute"):
            there = start if coordinates == "relative" else m.convert(start, coordinates)
            options = {"t_eval": [0.0, 0.5 * end, end], "initial": there, "coordinates": coordinates, "max_steps": 200}
            try:
                m.simulate(end, compiled=False, **options)
            except PartitaError as error:
                with pytest.raises(type(error)):
                    m.simulate(end, compiled=True, **options)
                continue
            served += compiled(same(m, end, rtol=1e-6, **options)) > 0
    assert served > len(SEEDS) // 2


@pytest.mark.parametrize("breaks", [2, 3, 40, 4000])
def test_tables_are_looked_up_whatever_their_length(breaks: int) -> None:
    """Over time, over an angle that turns on and back, and a cam whose follower another table acts along."""
    m = pt.catalogue.load("four-bar")
    follower = m.add_body("follower", mass=0.2, com=(3, 0, 0), inertia=(0.01, 0.01, 0.01))
    lift = m.add_prismatic("lift", m.ground, follower, point=(3, 0, 0), axis=(0, 1, 0))
    m.add_cam(lift, "A", (np.linspace(0.0, 2.0 * np.pi, breaks), 0.1 * np.sin(np.arange(breaks)) ** 2), name="cam")
    times = np.linspace(0.0, 2.0, breaks)
    m.add_torque("A", (times, 3.0 * np.cos(5.0 * times)), name="motor")
    heights = np.linspace(-1.0, 1.0, breaks)
    m.add_torque(lift, (heights, -20.0 * heights**3), over=lift, name="stiffer")
    start = m.assemble(rates={"A": 2.0})
    run = same(m, 1.5, initial=start, t_eval=[0.0, 0.4, 1.5], max_steps=400)
    assert compiled(run) > 0.5 * run.counters["evaluations"]


@pytest.mark.parametrize("options", [{"method": "dopri5"}, {"method": "adams"}, {"step": 1e-3, "method": "rk4"}])
def test_every_method_steps_by_compiled_evaluations(options: dict[str, Any]) -> None:
    m = pt.catalogue.load("grashof-four-bar")
    crank = m.compile().velocity_names[0]
    run = same(m, 1.0, initial=m.assemble(rates={crank: 9.0}), t_eval=[0.0, 0.4, 1.0], **options)
    assert compiled(run) > 0.5 * run.counters["evaluations"]


def test_switches_of_coordinates_and_crossings_are_those_without() -> None:
    """A crank that turns over switches coordinates; a parallelogram crosses its change points."""
    for name in ("grashof-four-bar", "parallelogram"):
        m = pt.catalogue.load(name)
        run = same(m, 3.0, initial=m.assemble(rates={m.compile().velocity_names[0]: 9.0}), t_eval=[0.0, 1.5, 3.0])
        assert run.counters["switches"] > 2 or any("singular positions" in note for note in run.notes)
        assert compiled(run) > 0.5 * run.counters["evaluations"]


COUNT = 8
"""Four-bars side by side: more degrees of freedom than one dense mass matrix is made for."""


def side_by_side(right: float) -> pt.Mechanism:
    """Cranks of 1 and couplers of 2; links on the right of this length, 1 for parallelograms."""
    m = pt.Mechanism("four-bars side by side")
    for i in range(COUNT):
        a, b, c, d = ((4.0 * i + x, y, 0.0) for x, y in ((0.0, 0.0), (0.0, 1.0), (2.0, right), (2.0, 0.0)))
        for name, start, end in ((f"a{i}", a, b), (f"b{i}", b, c), (f"c{i}", d, c)):
            m.add_rod(name, start=start, end=end, mass=1.0)
        m.add_revolute(f"A{i}", m.ground, f"a{i}", point=a)
        m.add_revolute(f"B{i}", f"a{i}", f"b{i}", point=b)
        m.add_revolute(f"C{i}", f"b{i}", f"c{i}", point=c)
        m.add_revolute(f"D{i}", m.ground, f"c{i}", point=d)
    assert m.compile().mobility == COUNT
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("driven", [False, True])
def test_ends_of_steps_of_many_parts_are_those_without(coordinates: str, driven: bool) -> None:
    """Springs, frictions, ropes that tighten, and a drive whose acceleration jumps; ends of steps are compiled too."""
    m = side_by_side(right=1.4)
    for i in range(0, COUNT, 2):
        m.add_torsion_spring(f"D{i}", stiffness=2.0, damping=0.3)
        m.add_friction(f"A{i + 1}", 0.2, stick_velocity=1e-2)
        tip = (4.0 * i + 2.0, 1.4, 0.0)
        above = (tip[0], 2.2, 0.0)
        held = m.bodies[f"c{i}"].world(tip)
        m.add_rope(f"rope {i}", m.ground, above, f"c{i}", held, stiffness=300.0, length=0.83, damping=2.0)
    if driven:
        m.add_drive("A3", acceleration=([0.0, 0.1, 0.1000001, 1.0], [0.0, 3.0, -2.0, 1.0]))
    every: tuple[dict[str, Any], ...] = ({}, {"method": "dopri5"}, {"method": "adams"}, {"step": 1e-3, "method": "rk4"})
    for options in every:
        run = same(m, 0.4, coordinates=coordinates, t_eval=[0.0, 0.2, 0.4], **options)
        assert run.success and compiled(run) > 0.95 * run.counters["evaluations"]


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_many_parts_cross_their_change_points_as_without(coordinates: str) -> None:
    m = side_by_side(right=1.0)
    start = m.assemble(rates={f"A{i}": 8.0 + 0.3 * i for i in range(COUNT)})
    there = start if coordinates == "relative" else m.convert(start, coordinates)
    for options in ({}, {"method": "dopri5"}, {"step": 2e-3}):
        run = same(m, 1.0, coordinates=coordinates, initial=there, t_eval=[0.0, 0.5, 1.0], **options)
        assert compiled(run) > 0 and any("singular positions" in note for note in run.notes)


def test_a_long_run_is_compiled_by_itself_and_the_next_one_from_its_start() -> None:
    m = pt.catalogue.load("double-rocker")
    start = m.assemble(rates={m.compile().velocity_names[0]: 3.0})
    short = m.simulate(0.01, initial=start, t_eval=[0.01])
    assert compiled(short) == 0
    long = m.simulate(60.0, initial=start, t_eval=[60.0])
    assert 0 < compiled(long) < long.counters["evaluations"]
    again = m.simulate(60.0, initial=start, t_eval=[60.0])
    assert compiled(again) > compiled(long)
    assert np.array_equal(long.q, again.q) and np.array_equal(long.v, again.v)


def test_what_cannot_be_compiled_is_evaluated_as_without() -> None:
    """Functions of the user; formulations that are not the projective one; systems."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    assert compiled(same(m, 0.5)) > 0
    assert compiled(same(m, 0.5, solver=pt.Solver("multipliers"))) == 0
    assert compiled(same(m, 0.5, correction="kantorovich")) == 0
    m.add_torque(hinge, lambda t, state: 0.1 * t)
    assert compiled(same(m, 0.5)) == 0
    spring = pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -4.0 * q)
    run = pt.simulate(spring, 1.0, [1.0], [0.0], compiled=True)
    assert compiled(run) == 0 and any("not compiled" in note for note in run.notes)


def test_a_table_that_ends_stops_the_run_as_without() -> None:
    """A load over the angle is defined on a part of it: beyond, the evaluation fails with its own error."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    hinge = m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    angles = np.linspace(-0.6, 0.6, 9)
    m.add_torque(hinge, (angles, 0.1 * angles), over=hinge)
    run = same(m, 2.0, t_eval=[0.0, 0.2, 0.3])
    assert not run.success and compiled(run) > 0


def test_a_stepper_compiles_beside_its_steps() -> None:
    """A thread makes the code, and no step waits for it; one that says so compiles nothing, or at once."""
    m = pt.catalogue.load("grashof-four-bar")
    start = m.assemble(rates={m.compile().velocity_names[0]: 9.0})
    for asked in (False, True, "auto"):
        sim, end = m.stepper(1e-3, initial=start, substeps=10, compiled=asked), time.monotonic() + 60.0
        while time.monotonic() < end:
            for _ in range(300):
                sim.step()
            counters = sim.result().counters
            if counters["compiled_evaluations"] > 0 or asked is False:
                break
        assert counters["factorisations"] > 10000
        assert (counters["compiled_evaluations"] > 0) == (asked is not False), asked
    with pytest.raises(ArgumentError, match="compiled is 1; it must be 'auto', True or False"):
        m.stepper(1e-3, compiled=1)


@pytest.mark.parametrize("value", ["yes", 1, None, 0.5])
def test_other_words_are_refused(value: Any) -> None:
    with pytest.raises(ArgumentError, match=r"compiled is .*'auto', True or False"):
        pt.catalogue.load("four-bar").simulate(0.1, compiled=value)


FORBIDDEN = """
import ctypes, sys
import partita as pt
m = pt.catalogue.load("four-bar")
if ctypes.CDLL(None).prctl(65, 1, 0, 0, 0):  # memory that was written does not become executable
    sys.exit(3)
run = m.simulate(0.1, compiled=True)
assert run.success and run.counters["compiled_evaluations"] == 0
print(*run.notes)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the test forbids executable memory by a call of Linux")
def test_where_executable_memory_is_forbidden_the_run_says_so() -> None:
    found = subprocess.run([sys.executable, "-c", FORBIDDEN], capture_output=True, text=True)
    if found.returncode == 3:
        pytest.skip("this kernel cannot forbid executable memory")
    assert found.returncode == 0, found.stderr
    assert "evaluations were not compiled" in found.stdout
