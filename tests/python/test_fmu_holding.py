"""FMUs of mechanisms that hold at times, and with events: what happens inside of steps is what happens in a run."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracle.slave import Instance

import partita as pt
from partita.errors import ArgumentError, DescriptionError
from partita.io import fmu as archive

if not list(archive.BINARIES.glob("*partita_fmu*")):
    pytest.skip("the binary for FMUs is not built (make fmu)", allow_module_level=True)


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Any]:
    """Writes FMUs, opens them, and frees them."""
    made: list[Instance] = []

    def make(m: pt.Mechanism, **options: Any) -> Instance:
        path = m.to_fmu(tmp_path / "model.fmu", rtol=1e-11, atol=1e-13, **options)
        made.append(Instance(path, tmp_path / f"unpacked {len(made)}"))
        return made[-1]

    yield make
    for one in made:
        one.free()


CASES = [
    ("door-latch", "hinge", "latch", "2.0"),
    ("ratchet-wrench", "thread", "tight", "3.0"),
    ("bicycle-hub", "axle", "pawls", "2.0"),
    ("stick-slip", "slide", "rub", "3.0"),
    ("landing-gear-downlock", "knee", "downlock", "2.0"),
]


@pytest.mark.parametrize(("name", "joint", "element", "version"), CASES)
def test_elements_hold_inside_of_steps(name: str, joint: str, element: str, version: str, opened: Any) -> None:
    entry = pt.catalogue.entry(name)
    m, steps = entry.mechanism(), 60
    h = entry.duration / steps
    times = h * np.arange(steps + 1)
    run = entry.simulate(t_eval=times, rtol=1e-11, atol=1e-13)
    shown = [f"{joint}.position", f"{joint}.velocity", f"{element}.effort", f"{element}.count", f"{element}.time"]
    one = opened(m, outputs=shown, initial=entry.initial(m), version=version)
    one.begin()
    records = run.events[element]
    effort = np.ravel(run.force(element).effort)
    for i, t in enumerate(times[:-1]):
        assert one.step(float(t), h) == 0, one.messages
        position, rate, carried, count, last = one.get(0, 1, 2, 3, 4)
        t = float(times[i + 1])
        assert position == pytest.approx(run.joint(joint).position[i + 1, 0], rel=1e-7, abs=1e-8)
        assert rate == pytest.approx(run.joint(joint).velocity[i + 1, 0], rel=1e-6, abs=1e-7)
        assert carried == pytest.approx(effort[i + 1], rel=1e-6, abs=1e-6)
        before = [event.t for event in records if event.t <= t]
        assert count == len(before) and last == pytest.approx(before[-1] if before else 0.0, abs=1e-8)


def test_events_act_and_are_counted(opened: Any) -> None:
    """A Geneva wheel over four steps: its locks open and close inside of steps."""
    entry = pt.catalogue.entry("geneva-wheel")
    m = entry.mechanism()
    shown = ["table.position", "leaves 0.count", "enters 1.time"]
    options = {key: entry.options[key] for key in ("events", "locked")}
    one = opened(m, outputs=shown, initial=entry.initial(m), **options)
    one.begin()
    for i in range(100):
        assert one.step(0.01 * i, 0.01) == 0, one.messages
    assert one.get(0)[0] == pytest.approx(-0.5 * np.pi, abs=1e-8) and one.get(1) == [2.0]
    assert one.step(1.0, 0.03) == 0 and one.get(2)[0] == pytest.approx(1.0, abs=1e-9)
    assert one.step(1.03, 0.22) == 0 and one.step(1.25, 0.5) == 0
    assert one.get(0)[0] == pytest.approx(-np.pi, abs=1e-8)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_state_knows_what_holds(version: str, opened: Any, tmp_path: Path) -> None:
    """After the latch has closed: what is come back to, and taken to another instance as bytes."""
    entry = pt.catalogue.entry("door-latch")
    m = entry.mechanism()
    one = opened(m, outputs=["hinge.position", "latch.effort", "latch.count"], version=version)
    one.begin()
    assert one.step(0.0, 1.0) == 0
    early = ctypes.c_void_p()
    assert one.call("GetFMUState", ctypes.byref(early)) == 0
    assert one.step(1.0, 1.0) == 0 and one.get(1)[0] == pytest.approx(-4.8, rel=1e-8)
    held = one.get(0, 1, 2)
    late = ctypes.c_void_p()
    assert one.call("GetFMUState", ctypes.byref(late)) == 0
    assert one.call("SetFMUState", early) == 0 and one.get(2) == [0.0]
    assert one.step(1.0, 1.0) == 0 and one.get(0, 1, 2) == held
    size = ctypes.c_size_t()
    assert one.call("SerializedFMUStateSize", late, ctypes.byref(size)) == 0
    data = (ctypes.c_ubyte * size.value)()
    assert one.call("SerializeFMUState", late, data, size) == 0
    other = opened(m, outputs=["hinge.position", "latch.effort", "latch.count"], version=version)
    other.begin()
    taken = ctypes.c_void_p()
    assert (
        other.call(
            "DeSerializeFMUState" if version == "2.0" else "DeserializeFMUState", data, size, ctypes.byref(taken)
        )
        == 0
    )
    assert other.call("SetFMUState", taken) == 0 and other.get(0, 1, 2) == held
    assert other.step(2.0, 0.5) == 0 and other.get(0)[0] == pytest.approx(held[0], abs=1e-9)
    assert other.get(1)[0] == pytest.approx(-4.8, rel=1e-8)
    for instance, states in ((one, (early, late)), (other, (taken,))):
        for state in states:
            assert instance.call("FreeFMUState", ctypes.byref(state)) == 0


def test_inputs_and_parameters_beside_what_holds(opened: Any) -> None:
    """A block with friction and a mass: it sticks until the input pulls harder, then slides by Newton's law."""
    m = pt.Mechanism("block", gravity=None)
    block = m.add_body("block", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("x", m.ground, block, axis=(1, 0, 0))
    m.add_friction("x", 3.0, static=4.0, name="rub")
    m.add_stop("x", upper=2.0, restitution=0.0, name="end")
    one = opened(m, inputs=["x"], outputs=["x", "rub.effort", "rub.count"], parameters=["block.mass"])
    one.enter()
    assert one.set(5, 4.0) == 0
    assert one.call("ExitInitializationMode") == 0
    assert one.set(0, 3.9) == 0 and one.step(0.0, 1.0) == 0
    assert one.get(1, 2, 3, 4) == pytest.approx([0.0, 0.0, -3.9, 0.0], abs=1e-12)
    assert one.set(0, 5.0) == 0 and one.step(1.0, 1.0) == 0
    assert one.get(1, 2, 3, 4) == pytest.approx([0.25, 0.5, -3.0, 1.0], rel=1e-9)
    assert one.set(0, 2.0) == 0 and one.step(2.0, 2.5) == 0
    assert one.get(1, 2, 3, 4) == pytest.approx([0.75, 0.0, -2.0, 2.0], abs=1e-9)


def test_what_an_fmu_cannot_follow_is_named(tmp_path: Path) -> None:
    m = pt.catalogue.load("door-latch")

    def write(*events: pt.Event, **options: Any) -> None:
        m.to_fmu(tmp_path / "m.fmu", events=events, **options)

    with pytest.raises(DescriptionError, match=r'\"far".*terminal'):
        write(pt.Event("far", "hinge", value=1.0, terminal=True))
    with pytest.raises(DescriptionError, match=r'\"late".*function of Python'):
        write(pt.Event("late", lambda t, state: t - 1.0))
    with pytest.raises(DescriptionError, match=r'\"far".*decides'):
        write(pt.Event("far", "hinge", value=1.0, then=lambda t, state: None))
    with pytest.raises(DescriptionError, match=r'\"far".*parts a joint'):
        trebuchet = pt.catalogue.load("trebuchet")
        trebuchet.to_fmu(tmp_path / "m.fmu", events=[pt.Event("far", "tip", value=-1.0, then=pt.Release("pouch"))])
    with pytest.raises(ArgumentError, match=r'\"latch" holds'):
        write(parameters=["latch.at"])
    with pytest.raises(ArgumentError, match=r'"far" carries nothing'):
        write(pt.Event("far", "hinge", value=1.0), outputs=["far.effort"])
