"""Locks of measures: bodies that are joined where they meet, and parted again; in runs and steppers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.errors import DescriptionError

TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-13}


def puck() -> pt.Mechanism:
    """2 kg on a table, in two slides, and a post in the origin."""
    m = pt.Mechanism("puck", gravity=None)
    carriage = m.add_body("carriage", mass=0.0, inertia=(0, 0, 0))
    body = m.add_body("puck", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("x", m.ground, carriage, axis=(1, 0, 0))
    m.add_prismatic("y", carriage, body, axis=(0, 1, 0))
    return m


ROPE = pt.Distance("ground", (0, 0, 0), "puck", (0, 0, 0))


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_distance_is_held_and_let_go(coordinates: str) -> None:
    """The part of the velocity along it is lost; then a circle, then a straight line."""
    m = puck()
    start = m.assemble({"x": -0.5, "y": 0.3}, {"x": 1.5, "y": 0.0}, coordinates=coordinates)
    far, speed = 0.5, 1.5
    taut = pt.Event("taut", ROPE, value=far, direction=1, then=pt.Lock(ROPE, name="rope"))
    cut = pt.Event("cut", lambda t, state: t - 1.5, then=pt.Release("rope"))
    run = m.simulate(2.0, initial=start, coordinates=coordinates, events=[taut, cut], **TIGHT)
    assert [(x.name, x.kind) for x in run.events] == [("taut", "lock"), ("cut", "release")]
    first, _ = run.events
    across, along = speed * 0.3 / far, speed * 0.4 / far
    assert first.t == pytest.approx(0.9 / speed, rel=1e-11)
    assert first.energy_lost == pytest.approx(along**2, rel=1e-10)
    assert first.impulses["rope"].effort == pytest.approx(-2.0 * along, rel=1e-10)
    held = (run.t > first.t) & (run.t < 1.5)
    x, y = run.joint("x").displacement, run.joint("y").displacement
    turned = math.atan2(0.3, 0.4) - across / far * (run.t[held] - first.t)
    assert x[held] == pytest.approx(far * np.cos(turned), abs=1e-10)
    assert y[held] == pytest.approx(far * np.sin(turned), abs=1e-10)
    tension = run.drive("rope").effort[:, 0]
    assert tension[held] == pytest.approx(-2.0 * across**2 / far, rel=1e-9)
    assert not tension[(run.t < 0.59) | (run.t > 1.51)].any()
    leaves = math.atan2(0.3, 0.4) - across / far * (1.5 - first.t)
    gone = far * math.cos(leaves) + across * math.sin(leaves) * 0.5
    assert x[-1] == pytest.approx(gone, abs=1e-10)


def test_a_hook_catches_a_ring() -> None:
    """A rod that turns takes a ball along from where it meets it: its spin about the hinge is kept."""
    m = pt.Mechanism("hook", gravity=None)
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    ring = m.add_body("ring", mass=0.5, inertia=(0.01, 0.01, 0.01), position=(0.6, 0.8, 0))
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_planar("P", m.ground, ring, normal=(0, 0, 1))
    hook = [pt.Along(rod, (1, 0, 0), axis, ring, (0, 0, 0)) for axis in ((1, 0, 0), (0, 1, 0))]
    catches = pt.Event("catches", hook[1], direction=-1, once=True, then=[pt.Lock(one) for one in hook])
    run = m.simulate(2.0, initial=m.assemble(rates={"A": 2.0}), events=[catches], **TIGHT)
    (caught,) = run.events
    assert caught.t == pytest.approx(0.5 * math.atan2(0.8, 0.6), rel=1e-11)
    after = 2.0 * 1.0 / (1.0 + 0.5)
    assert caught.after.velocity("A") == pytest.approx(after, rel=1e-11)
    assert caught.energy_lost == pytest.approx(0.5 * 1.0 * 4.0 - 0.5 * 1.5 * after**2, rel=1e-10)
    assert run.body("ring").velocity[-1] @ run.body("ring").velocity[-1] == pytest.approx(after**2, rel=1e-9)
    assert np.linalg.norm(run.body("ring").position[-1]) == pytest.approx(1.0, abs=1e-9)
    assert run.drive("lock of along").effort[-1, 0] == pytest.approx(-0.5 * after**2, rel=1e-9)


def test_locks_of_measures_from_the_start_and_by_decision() -> None:
    m = puck()
    start = m.assemble({"x": 0.4, "y": 0.3}, {"x": 0.0, "y": 1.0})
    locked = m.simulate(1.0, initial=start, locked=[ROPE], **TIGHT)
    assert locked.drive("lock of distance").effort[-1, 0] == pytest.approx(-2.0 * 0.8**2 / 0.5, rel=1e-9)
    named = m.simulate(1.0, initial=start, locked=pt.Lock(ROPE, name="rope"), **TIGHT)
    assert (named.q == locked.q).all() and named.drive("rope").effort.any()

    def decide(t: float, state: Any) -> Any:
        return pt.Release("rope") if state.position("y") > 0.0 else None

    free = pt.Event("free", lambda t, state: t - 0.3, then=[decide])
    release = m.simulate(1.0, initial=start, locked=[pt.Lock(ROPE, name="rope")], events=[free], **TIGHT)
    assert [(x.name, x.kind) for x in release.events] == [("free", "release")]
    by_measure = pt.Event("free", lambda t, state: t - 0.3, then=pt.Release(ROPE))
    same = m.simulate(1.0, initial=start, locked=[ROPE], events=[by_measure], **TIGHT)
    assert same.q == pytest.approx(release.q, abs=1e-12)
    one = pt.Lock(pt.Coordinate("x", 0))
    assert m.simulate(1.0, initial=start, locked=[one]).joint("x").velocity[-1, 0] == 0.0


@pytest.mark.parametrize(
    ("then", "words"),
    [
        (pt.Lock(ROPE, coordinate=1), "coordinate 1 of a measure"),
        (pt.Lock("x", name="rope"), "under a name of its own"),
        (pt.Release(ROPE), "releases a measure that nothing locks"),
        ([pt.Lock(ROPE, name="a"), pt.Lock(ROPE, name="b")], 'as "b" what is locked as "a"'),
        (pt.Lock(ROPE, name="push"), "which something else has"),
    ],
)
def test_what_cannot_be_locked_is_named(then: Any, words: str) -> None:
    m = puck()
    m.add_force("puck", (0, 0, 0), name="push")
    with pytest.raises(DescriptionError, match=words) as raised:
        m.simulate(1.0, events=[pt.Event("one", "x", value=1.0, then=then)])
    assert 'event "one"' in str(raised.value)


def test_names_of_locks_are_text() -> None:
    with pytest.raises(pt.errors.ArgumentError, match="under the name 3"):
        pt.Event("one", "x", then=pt.Lock(ROPE, name=3))  # type: ignore[arg-type]


def stepped(name: str, dt: float, **options: Any) -> tuple[pt.Result, Any, list[tuple[str, str]]]:
    """A stepper of a catalogue entry beside its run: the run, the stepper at its end, what happened."""
    entry = pt.catalogue.entry(name)
    run = entry.simulate(rtol=1e-11, atol=1e-13)
    m = entry.mechanism()
    own = {key: value for key, value in entry.options.items() if key == "locked"}
    events = [event for event in entry.options["events"] if not event.terminal]
    sim = m.stepper(dt, initial=entry.initial(m), substeps=4, events=events, **own, **options)
    seen = []
    for _ in range(int(run.t[-1] / dt)):
        sim.step()
        seen += [(event.name, event.kind) for event in sim.events]
    return run, sim, seen


@pytest.mark.parametrize(
    ("name", "dt"), [("geneva-wheel", 0.0101), ("punch-press", 4.198e-4), ("punch-press", 1e-3), ("trebuchet", 0.01)]
)
def test_steppers_lock_part_and_set_inputs_as_runs_do(name: str, dt: float) -> None:
    run, sim, seen = stepped(name, dt)
    assert seen == [(x.name, x.kind) for x in run.events if x.t <= sim.time][: len(seen)]
    assert len(seen) == sum(x.name not in ("bottom", "landing") for x in run.events)
    there = run.state(sim.time)
    assert sim.q == pytest.approx(there.q, abs=1e-4 if name == "trebuchet" else 1e-6)
    found = sim.result()
    assert found.certificate.verdict == "valid"
    assert [(x.name, x.kind) for x in found.events] == seen
    if name == "punch-press":
        assert found.energy.work[-1] == pytest.approx(-13.5, rel=1e-6)
        assert sim.inputs == ("sheet.y", "sheet.z")
    sim.reset()
    sim.step()
    assert sim.time == pytest.approx(dt) and not sim.events


def test_an_input_of_a_stepper_is_not_set_by_events_as_well() -> None:
    entry = pt.catalogue.entry("punch-press")
    m = entry.mechanism()
    with pytest.raises(DescriptionError, match=r'"touches".*"sheet.x", an input that is given at each step'):
        m.stepper(1e-3, inputs=["sheet.x"], events=entry.options["events"][:2])


def test_what_is_said_of_mobility_is_said_where_nothing_is_held() -> None:
    for name in ("stick-slip", "geneva-wheel", "door-latch"):
        run = pt.catalogue.entry(name).simulate()
        model = pt.catalogue.load(name).compile()
        assert run.summary["mobility"] == model.mobility and run.summary["rank"] == model.summary["rank"]
        assert not any("removed" in note for note in run.notes)
