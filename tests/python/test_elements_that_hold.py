"""Freewheels, latches, rigid stops, contacts and ropes as elements; files, steppers and ensembles with them."""

import math
from typing import Any

import numpy as np
import pytest
from drawings import drawn_out
from test_event_actions import COORDINATES, TIGHT
from test_friction_that_sticks import kinds, sledge, wheel

import partita as pt
from partita.errors import DescriptionError


@COORDINATES
def test_a_one_way_clutch_carries_while_it_is_driven_and_overruns(coordinates: str) -> None:
    """The outer ring has the rate 2 sin 5t, the shaft a drag: engaged while the clutch has to push. Times by roots of
    the closed form of the free motion, in 45 digits."""
    m = pt.Mechanism("clutch", gravity=None)
    ring = m.add_body("ring", mass=1.0, inertia=(1, 1, 1))
    shaft = m.add_body("shaft", mass=1.0, inertia=(1, 1, 0.3))
    m.add_revolute("R", m.ground, ring, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("S", m.ground, shaft, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("C", ring, shaft, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_drive("R", position=lambda t: 0.4 * (1.0 - np.cos(5.0 * t)), name="engine")
    m.add_torsion_spring("S", stiffness=0.0, damping=0.2)
    m.add_freewheel("clutch", "C", free=1)
    run = m.simulate(4.0, coordinates=coordinates, initial=m.assemble(coordinates=coordinates), **TIGHT)
    assert run.success, run.message
    assert [event.kind for event in run.events] == ["release", "lock"] * 3
    right = [0.340669571818314128, 1.36177355424800542883, 1.59730663325423142349]
    right += [2.61841061568392272421, 2.85394369469014871887, 3.87504767711984001960]
    assert run.events.t == pytest.approx(right, rel=1e-10)
    frees, takes = run.events[:2]
    assert frees.before.velocity("S") == pytest.approx(1.98245580136526933544, rel=1e-10)
    assert frees.before.position("S") == pytest.approx(0.452865488036407182278, rel=1e-10)
    assert takes.before.velocity("S") == pytest.approx(1.00360688079395055261, rel=1e-9)
    assert takes.after.position("S") == pytest.approx(1.92113886889338535652, rel=1e-10)
    effort = run.force("clutch").effort
    assert effort[0] == pytest.approx(3.0, rel=1e-12) and effort.min() > -1e-9
    assert np.abs(effort[(run.t > 0.35) & (run.t < 1.36)]).max() == 0.0


def test_a_freewheel_that_is_hit_backwards_takes_the_impulse() -> None:
    """Two wheels, one on a freewheel: a lock of their common hinge makes both one, which would turn backwards."""
    m = wheel()
    other = m.add_body("other", mass=1.0, inertia=(1, 1, 0.6))
    m.add_revolute("B", m.ground, other, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("C", "wheel", other, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_freewheel("A", name="one-way")
    catch = pt.Event("catch", lambda t, state: t - 0.5, then=pt.Lock("C"))
    run = m.simulate(1.0, initial=m.assemble(rates={"A": 2.0, "B": -3.0}), events=[catch])
    assert run.success and np.abs(run.v[-1]).max() < 1e-12
    assert {(e.name, e.kind) for e in run.events} == {("catch", "lock"), ("one-way", "lock")}
    lost = sum(event.energy_lost for event in run.events)
    assert lost == pytest.approx(0.5 * 0.4 * 4.0 + 0.5 * 0.6 * 9.0)
    taken = run.events["one-way"][0].impulses
    assert taken["one-way"].effort == pytest.approx(0.6 * 3.0 - 0.4 * 2.0)
    assert taken["A"].moment[2] == pytest.approx(0.6 * 3.0 - 0.4 * 2.0)


def test_a_rigid_stop_is_an_element_with_its_own_records() -> None:
    """A ball between two plates, against the same by events."""
    m = sledge(1.3)
    m.gravity = (-9.81, 0, 0)
    m.add_stop("ends", "S", lower=-1.0, upper=0.5, restitution=0.5)
    start = m.assemble(rates={"S": 6.0})
    run = m.simulate(3.0, initial=start, **TIGHT)
    other = sledge(1.3)
    other.gravity = (-9.81, 0, 0)
    events = [
        pt.Event("low", "S", value=-1.0, direction=-1, then=pt.Stop(0.5)),
        pt.Event("high", "S", value=0.5, direction=1, then=pt.Stop(0.5)),
    ]
    same = other.simulate(3.0, initial=start, events=events, **TIGHT)
    assert run.events.t == pytest.approx(same.events.t, rel=1e-14)
    assert [event.kind for event in run.events] == [event.kind for event in same.events]
    assert {event.name for event in run.events} == {"ends"}
    assert [event.direction for event in run.events[:2]] == [1, -1]
    assert run.force("ends").effort[-1] == pytest.approx(1.3 * 9.81)
    assert (run.q == same.q).all()


def test_a_latch_is_an_element_that_is_released_by_its_name() -> None:
    m = pt.Mechanism("door", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1.2, 0), mass=4.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    latch = m.add_latch("A", at=0.7, direction=1, name="latch")
    for release in (latch, "latch", "A"):
        go = pt.Event("go", lambda t, state: t - 2.5, then=pt.Release(release))
        run = m.simulate(3.0, initial=m.assemble({"A": -1.1}), events=[go], **TIGHT)
        assert kinds(run) == [("latch", "lock"), ("go", "release")]
        assert run.events[0].t == pytest.approx(0.693939198568014325, rel=1e-10)
        assert run.events[0].energy_lost == pytest.approx(7.32797737458220149, rel=1e-9)
        held = (run.t > 0.7) & (run.t < 2.5)
        assert run.force("latch").effort[held] == pytest.approx(15.1674612283241981676, rel=1e-9)
    # an open latch is no matter for an equilibrium
    assert m.equilibrium().state.position("A") == pytest.approx(0.0, abs=1e-9)


def test_stops_and_friction_beside_each_other() -> None:
    """A block with friction that bounces between two rigid ends and comes to rest: velocities by the closed form of
    each flight."""
    m = sledge()
    m.add_friction("S", 1.0)
    m.add_stop("S", lower=-0.5, upper=0.5, restitution=0.8)
    run = m.simulate(20.0, initial=m.assemble(rates={"S": 2.0}), **TIGHT)
    speed, x, sense, t, hits = 2.0, 0.0, 1, 0.0, []
    while True:
        apart = abs(0.5 * sense - x)
        left = speed**2 - 2.0 * 0.5 * apart
        if left <= 0.0:
            break
        t += (speed - math.sqrt(left)) / 0.5
        hits.append(t)
        speed, x, sense = 0.8 * math.sqrt(left), 0.5 * sense, -sense
    rests = t + speed / 0.5
    assert [event.kind for event in run.events if event.kind == "impact"] == ["impact"] * len(hits)
    assert [event.t for event in run.events if event.kind == "impact"] == pytest.approx(hits, rel=1e-10)
    assert run.events[-1].kind == "stick" and run.events[-1].t == pytest.approx(rests, rel=1e-10)
    assert run.joint("S").displacement[-1] == pytest.approx(x + sense * speed**2, rel=1e-9)
    energies = run.energy.total - run.energy.work
    assert np.ptp(energies) < 1e-10


def test_bad_elements_are_refused_by_name() -> None:
    m = wheel()
    for call, words in (
        (lambda: m.add_stop("A", lower=0.0), "give a stiffness.*or a restitution"),
        (lambda: m.add_stop("A", lower=0.0, stiffness=1.0, restitution=0.5), "give a stiffness"),
        (lambda: m.add_stop("A", lower=0.0, restitution=1.5), "0 to 1"),
        (lambda: m.add_stop("A", lower=0.0, restitution=0.5, damping=1.0), "damping and exponent belong"),
        (lambda: m.add_freewheel("A", free=2), "no sense"),
        (lambda: m.add_latch("A", at=1.0, direction=3), "no sense"),
        (lambda: m.add_friction("A", coefficient=0.1, radius=0.1), "needs a stick_velocity"),
        (lambda: m.add_brake("A", -1.0), "-1"),
    ):
        with pytest.raises(DescriptionError, match=words):
            call()
    m.add_latch("A", at=1.0, name="hook")
    with pytest.raises(DescriptionError, match="an element of the mechanism has this name"):
        m.simulate(1.0, events=[pt.Event("hook", "A")])


def test_elements_are_saved_and_loaded_with_their_numbers(tmp_path: Any) -> None:
    m = wheel()
    m.add_torque("A", 1.0)
    m.add_brake("brake", "A", 0.5, static=0.7)
    m.add_stop("ends", "A", upper=3.0, lower=-3.0, restitution=0.25)
    m.add_freewheel("hub", "A", free=1)
    m.add_latch("hook", "A", at=2.9, direction=-1)
    m.save(tmp_path / "wheel.toml")
    again = pt.load(tmp_path / "wheel.toml")
    run, other = m.simulate(5.0), again.simulate(5.0)
    assert kinds(run) == kinds(other) and (run.q == other.q).all()
    # the hub does not let it bounce off the upper end, where it rests, and the brake with it
    assert kinds(run) == [("ends", "impact"), ("ends", "rest"), ("hub", "lock"), ("brake", "stick")]
    assert run.events[0].t == pytest.approx(math.sqrt(2.0 * 3.0 * 0.4 / 0.5)) and np.abs(run.v[-1]).max() < 1e-13
    changed = m.simulate(5.0, parameters={"ends.upper": 2.0, "brake.dynamic": 0.2, "ends.restitution": 0.0})
    assert changed.events[0].t == pytest.approx(math.sqrt(2.0 * 2.0 * 0.4 / 0.8))
    assert changed.joint("A").angle.max() == pytest.approx(2.0, abs=1e-9)


@COORDINATES
def test_a_rigid_ball_bounces_on_a_slope(coordinates: str) -> None:
    """A smooth ball over an inclined plane: flights are parabolas in the axes of the slope, each bounce reverses one
    component of the velocity."""
    m = pt.Mechanism("slope", gravity=(0, 0, -9.81))
    ball = m.add_body("ball", mass=0.7, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0, 1.0))
    m.add_free("F", m.ground, ball)
    normal = np.array([math.sin(0.3), 0.0, math.cos(0.3)])
    m.add_contact("floor", ball, (0, 0, 0), m.ground, (0, 0, 0), radius1=0.1, normal=normal, restitution=0.6)
    run = m.simulate(2.0, coordinates=coordinates, initial=m.assemble(coordinates=coordinates), **TIGHT)
    assert run.success, run.message
    fall = 9.81 * math.cos(0.3)
    height = math.cos(0.3) - 0.1
    first = math.sqrt(2.0 * height / fall)
    times = [first, first * 2.2, first * 2.92, first * (1.0 + 1.2 + 0.72 + 0.432)]
    assert run.events.t[:4] == pytest.approx(times, rel=1e-10)
    along = np.array([math.cos(0.3), 0.0, -math.sin(0.3)])
    slid = run.body("ball").position @ along - run.body("ball").position[0] @ along
    assert slid == pytest.approx(0.5 * 9.81 * math.sin(0.3) * run.t**2, abs=1e-9)
    assert run.events[0].energy_lost == pytest.approx(0.7 * fall * height * (1.0 - 0.36), rel=1e-9)
    assert run.events[0].impulses["floor"].effort == pytest.approx(0.7 * 1.6 * fall * first, rel=1e-9)


def test_two_rigid_balls_exchange_their_velocities_and_rest_on_the_floor() -> None:
    m = pt.Mechanism("balls", gravity=(0, 0, -9.81))
    for name, height in (("low", 0.1), ("high", 1.0)):
        body = m.add_body(name, mass=0.5, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0, height))
        m.add_prismatic(f"z of {name}", m.ground, body, axis=(0, 0, 1))
    m.add_contact("floor", "low", (0, 0, 0), m.ground, (0, 0, 0), radius1=0.1, normal=(0, 0, 1), restitution=0.0)
    m.add_contact("pair", "high", (0, 0, 0), "low", (0, 0, 0), radius1=0.1, radius2=0.1, restitution=0.0)
    run = m.simulate(1.0, **TIGHT)
    assert run.success, run.message
    lands = math.sqrt(2.0 * 0.7 / 9.81)
    assert run.events["pair"][0].t == pytest.approx(lands, rel=1e-12)
    # what rests carries what lies above it
    assert run.force("floor").effort[[0, -1]] == pytest.approx([0.5 * 9.81, 9.81], rel=1e-9)
    assert run.force("pair").effort[-1] == pytest.approx(0.5 * 9.81, rel=1e-9)
    hit = run.events["pair"][0].impulses
    assert hit["pair"].effort == pytest.approx(0.5 * 9.81 * lands, rel=1e-9)
    assert hit["floor"].effort == pytest.approx(0.5 * 9.81 * lands, rel=1e-9)


def test_a_rigid_contact_is_refused_where_it_cannot_be() -> None:
    m = sledge()
    sides: tuple[Any, ...] = ("c", "sledge", (0, 0, 0), m.ground, (1, 0, 0))
    cases: list[tuple[dict[str, Any], str]] = [
        ({"radius1": 0.1, "normal": (1, 0, 0)}, "give a stiffness.*or a restitution"),
        ({"radius1": 0.1, "normal": (1, 0, 0), "restitution": 2.0}, "0 to 1"),
        ({"radius1": 0.1, "normal": (1, 0, 0), "restitution": 0.5, "friction": 0.2, "stick_velocity": 1}, "Painleve"),
    ]
    for more, words in cases:
        with pytest.raises(DescriptionError, match=words):
            m.add_contact(*sides, **more)
    m.add_contact(*sides, radius1=0.1, normal=(-1, 0, 0), restitution=0.5)
    with pytest.raises(DescriptionError, match="rigid contact"):
        m.equilibrium()
    # it begins on the wrong side
    with pytest.raises(pt.errors.PartitaError, match="beyond the stop"):
        m.simulate(1.0, initial=m.assemble({"S": 1.2}))


@COORDINATES
@pytest.mark.parametrize("case", ["belt", "clutch", "ball", "latch", "slider-crank"])
def test_a_stepper_follows_what_a_run_follows(case: str, coordinates: str) -> None:
    """Ticks end at their own times; what happens inside is that of a run, and so is the record."""
    events: list[pt.Event] = []
    if case == "belt":
        m = pt.Mechanism("belt", gravity=None)
        m.add_body("belt", mass=1.0, inertia=(1, 1, 1))
        m.add_body("mass", mass=2.0, inertia=(1, 1, 1))
        m.add_prismatic("B", m.ground, "belt", axis=(1, 0, 0))
        m.add_prismatic("X", "belt", "mass", axis=(1, 0, 0))
        m.add_drive("B", velocity=0.3)
        m.add_spring("S", m.ground, (-5, 0, 0), "mass", (0, 0, 0), stiffness=50.0, length=5.0)
        m.add_friction("rub", "X", 5.886, static=9.81)
        start = m.assemble(rates={"B": 0.3, "X": 0.0}, coordinates=coordinates)
    elif case == "clutch":
        m = wheel()
        m.add_torque("A", lambda t, state: 3.0 * math.sin(4.0 * t))
        m.add_freewheel("A", free=1)
        m.add_torsion_spring("A", stiffness=0.0, damping=0.5)
        start = m.assemble(rates={"A": 0.5}, coordinates=coordinates)
    elif case == "ball":
        m = sledge(1.3)
        m.gravity = (-9.81, 0, 0)
        m.add_stop("S", lower=-0.3, restitution=0.4)
        start = m.assemble(coordinates=coordinates)
    elif case == "latch":
        m = wheel()
        m.add_latch("A", at=0.5, direction=1)
        events = [pt.Event("go", lambda t, state: t - 0.71, then=[pt.Release("A"), pt.SetRates({"A": -2.0})])]
        start = m.assemble(rates={"A": 2.0}, coordinates=coordinates)
    else:
        m = drawn_out()
        m.add_friction("S", 1.5, static=2.2)
        start = m.assemble({"O": -0.1}, coordinates=coordinates)
    dt, count = 0.004, 300
    times = dt * np.arange(count + 1)
    run = m.simulate(times[-1], initial=start, coordinates=coordinates, events=events, t_eval=times, **TIGHT)
    sim = m.stepper(dt, initial=start, coordinates=coordinates, events=events, substeps=4)
    for again in range(2):
        seen = []
        for i in range(count):
            sim.step()
            inside = [(event.name, event.kind, event.t) for event in sim.events]
            assert all(times[i] - 1e-12 <= t <= times[i + 1] + 1e-12 or kind == "accumulation" for _, kind, t in inside)
            seen += inside
        assert sim.time == times[-1]
        assert [x[:2] for x in seen] == [(e.name, e.kind) for e in run.events if (e.t, e.kind) != (0.0, "rest")]
        assert [x[2] for x in seen] == pytest.approx(run.events.t, rel=1e-8)
        assert sim.q == pytest.approx(run.q[-1], rel=1e-8, abs=1e-9)
        found = sim.result()
        assert found.success and found.certificate.verdict == "valid"
        assert found.q == pytest.approx(run.q, rel=1e-7, abs=1e-8) and (found.t == times).all()
        for name in m.forces:
            # loads that jump at events are compared beside them
            near = np.min(np.abs(times[:, None] - run.events.t[None]), axis=1) < 1e-9
            one, other = found.force(name), run.force(name)
            if "effort" in one.reads:
                assert one.effort[~near] == pytest.approx(other.effort[~near], rel=1e-5, abs=1e-5)
        assert [(e.name, e.kind) for e in found.events] == [(e.name, e.kind) for e in run.events]
        if not again:
            sim.reset()


def test_what_a_stepper_cannot_do_with_events_is_said() -> None:
    m = wheel()
    m.add_torque("motor", "A", 0.0)
    with pytest.raises(DescriptionError, match="an input that is given at each step"):
        m.stepper(0.01, inputs=["motor"], events=[pt.Event("e", "A", value=1.0, then=pt.SetInput("motor", 1.0))])
    with pytest.raises(pt.errors.ArgumentError, match="terminal"):
        m.stepper(0.01, events=[pt.Event("e", "A", value=1.0, terminal=True)])


@COORDINATES
def test_a_follower_lifts_off_its_cam_and_lands(coordinates: str) -> None:
    """A cam face that is driven by 6 mm (1 - cos 3a), a = 15 t^2; a follower of 0.4 kg on a spring of 900 N/m with 25 N
    of preload that rests on the face. Times by roots of closed forms, in 45 digits."""
    m = pt.Mechanism("cam", gravity=(0, -9.81, 0))
    face = m.add_body("face", mass=0.1, inertia=(1, 1, 1))
    follower = m.add_body("follower", mass=0.4, inertia=(1, 1, 1))
    m.add_prismatic("lift", m.ground, face, axis=(0, 1, 0))
    m.add_prismatic("gap", face, follower, axis=(0, 1, 0))
    m.add_drive("lift", position=lambda t: 0.006 * (1.0 - np.cos(45.0 * t * t)))
    rest = 25.0 / 900.0
    m.add_spring("spring", m.ground, (0, -1, 0), follower, (0, 0, 0), stiffness=900.0, length=1.0 - rest)
    m.add_stop("contact", "gap", lower=0.0, restitution=0.0)
    start = m.assemble(coordinates=coordinates)
    run = m.simulate(1.59, coordinates=coordinates, initial=start, **TIGHT)
    assert run.success, run.message
    right = [
        (1.46853201761439565605, "lift-off"), (1.47943808607179613487, "impact"),
        (1.51419403056774039888, "lift-off"), (1.52931440199576858086, "impact"),
        (1.55886092155541067554, "lift-off"), (1.57663745762078184106, "impact"),
    ]  # fmt: skip
    found = [event for event in run.events if event.kind != "rest"]
    assert [event.kind for event in found] == [kind for _, kind in right]
    assert [event.t for event in found] == pytest.approx([t for t, _ in right], rel=1e-10)
    lands = found[1]
    assert lands.impulses["contact"].effort == pytest.approx(0.03282792054, rel=1e-7)
    assert run.force("contact").effort.min() >= -1e-9


@pytest.mark.parametrize("workers", [None, 1])
def test_members_of_an_ensemble_are_ordinary_runs_where_something_holds(workers: int | None) -> None:
    m = wheel()
    m.add_brake("brake", "A", 2.0)
    states = [m.assemble(rates={"A": rate}) for rate in (1.0, -2.0, 3.0)]
    times = [0.0, 0.25, 1.0]
    found = m.ensemble(states=states, t_eval=times, workers=workers)
    assert found.success.all() and not found.in_lanes.any() and '"brake" holds at times' in found.notes[0]
    rates, angles = np.array([1.0, -2.0, 3.0]), 0.5 * np.array([1.0, -4.0, 9.0]) * 0.4 / 2.0
    assert found.q[:, -1, 0] == pytest.approx(angles, rel=1e-12) and np.abs(found.v[:, -1]).max() < 1e-13
    slow = np.abs(rates) - 5.0 * 0.25
    assert found.v[:, 1, 0] == pytest.approx(np.sign(rates) * np.maximum(slow, 0.0), abs=1e-12)
    assert [event.kind for event in found.result(2).events] == ["stick"]
    other = m.ensemble(parameters={"brake.dynamic": [1.0, 2.0]}, t_eval=times)
    assert not other.v.any() and other.success.all()
    m.add_stop("end", "A", upper=-1.0, restitution=0.0)
    beyond = m.ensemble(states=states, t_eval=times)
    assert not beyond.success.any() and np.isnan(beyond.q).all() and "beyond the stop" in beyond.messages[0]


@COORDINATES
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_rope_that_does_not_stretch_becomes_taut_and_swings(coordinates: str, restitution: float) -> None:
    """A ball thrown sideways on a slack rope: a parabola until it is taut, where the radial part of its velocity stops
    or is returned; then, without rebound, a pendulum."""
    m = pt.Mechanism("rope", gravity=(0, -9.81, 0))
    ball = m.add_body("ball", mass=0.8, inertia=(1e-3, 1e-3, 1e-3), position=(0, 0, 0))
    m.add_planar("P", m.ground, ball, normal=(0, 0, 1))
    m.add_rope("rope", m.ground, (0, 0, 0), ball, (0, 0, 0), length=1.0, restitution=restitution)
    start = m.assemble(rates={"P": (1.5, 0.0, 0.0)}, coordinates=coordinates)
    run = m.simulate(1.2, coordinates=coordinates, initial=start, **TIGHT)
    assert run.success and run.certificate.verdict == "valid", run.message
    # (1.5 t)^2 + (g t^2 / 2)^2 = 1
    square = (-(1.5**2) + math.sqrt(1.5**4 + 9.81**2)) / (2.0 * (9.81 / 2.0) ** 2)
    taut = math.sqrt(square)
    assert run.events[0].t == pytest.approx(taut, rel=1e-11) and run.events[0].name == "rope"
    at = np.array([1.5 * taut, -0.5 * 9.81 * square])
    before, after = np.array([1.5, -9.81 * taut]), None
    radial = before @ at
    after = before - (1.0 + restitution) * radial * at
    index = int(np.searchsorted(run.t, taut))
    moved = run.body("ball").velocity[index, :2] - np.array([0.0, -9.81]) * (run.t[index] - taut)
    assert run.events[0].energy_lost == pytest.approx(0.4 * (1.0 - restitution**2) * radial**2, rel=1e-9)
    assert run.events[0].impulses["rope"].effort == pytest.approx(-0.8 * (1.0 + restitution) * radial, rel=1e-9)
    if restitution:
        assert moved == pytest.approx(after, rel=1e-9)
        return
    assert [event.kind for event in run.events] == ["impact", "rest"]
    apart = np.linalg.norm(run.body("ball").position, axis=1)
    assert apart.max() < 1.0 + 1e-12 and np.ptp(apart[run.t > taut]) < 1e-12
    # tension of a pendulum from its energy
    place, speed = run.body("ball").position[-1], run.body("ball").velocity[-1]
    tension = 0.8 * (speed @ speed - 9.81 * place[1])
    assert run.force("rope").effort[-1] == pytest.approx(-tension, rel=1e-9)


@pytest.mark.parametrize("inertia", [2e-3, 2e-5])
def test_a_freewheel_frees_a_stuck_bolt_at_the_instant_at_which_it_would_pull(inertia: float) -> None:
    m = pt.Mechanism("ratchet", gravity=None)
    m.add_body("wrench", mass=1.0, inertia=(0.01, 0.01, 0.0083))
    m.add_body("bolt", mass=1.0, inertia=(inertia,) * 3)
    m.add_revolute("head", m.ground, "wrench", point=(0, 0, 0))
    m.add_revolute("thread", m.ground, "bolt", point=(0, 0, 0))
    m.add_revolute("ratchet", "wrench", "bolt", point=(0, 0, 0))
    m.add_torque("head", ([0.0, 0.5, 1.0], [-20.0, 20.0, -20.0]), interpolation="linear")
    m.add_friction("thread", 12.0, static=15.0, name="tight")
    m.add_freewheel("ratchet", free=1, name="pawl")
    run = m.simulate(0.9)
    assert [e.t for e in run.events if e.kind == "release"] == pytest.approx([0.75], rel=1e-12)
    assert not [note for note in run.notes if "initial state" in note]


@pytest.mark.parametrize("formulation", ["projective", "multipliers", "range-space", "proximal", "svd"])
def test_what_is_held_wholly_at_rest_is_a_success_in_every_formulation(formulation: str) -> None:
    """Nothing moves faster than rounding, of which no check makes a part of itself."""
    m = pt.Mechanism("arm", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_brake("A", 10.0, name="brake")
    run = m.simulate(1.0, solver=pt.Solver(formulation))
    assert run.success, run.message
    assert run.force("brake").effort == pytest.approx(9.81 / 2, rel=1e-9)
    assert np.abs(run.joint("A").angle).max() < 1e-7


def coupled_rods(stick_velocity: float) -> pt.Mechanism:
    """Two rods, with given friction in the first hinge and friction by the reaction in the second."""
    m = pt.Mechanism("two", gravity=(0, -9.81, 0))
    first = m.add_rod("first", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    second = m.add_rod("second", start=(1, 0, 0), end=(2, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, first, point=(0, 0, 0))
    m.add_revolute("B", first, second, point=(1, 0, 0))
    m.add_friction("A", 3.0, stick_velocity=stick_velocity, name="sticks")
    m.add_friction("B", coefficient=0.3, radius=0.2, stick_velocity=0.01, name="follows")
    return m


def test_friction_by_a_coefficient_follows_what_acts_in_each_mode() -> None:
    """Beside one that sticks, at which reactions and the balance of forces are those of the smooth law nearby."""
    times = np.linspace(0.0, 2.0, 41)
    run, smooth = (coupled_rods(v).simulate(2.0, rtol=1e-9, atol=1e-11, t_eval=times) for v in (0.0, 1e-4))
    assert run.success and run.certificate.verdict == "valid"
    assert {x.kind for x in run.events} == {"slip"}
    assert run.q == pytest.approx(smooth.q, abs=1e-4)
    found, known = run.force("follows").effort, smooth.force("follows").effort
    assert np.abs(known).max() > 1.5 and found[1:] == pytest.approx(known[1:], rel=1e-3, abs=1e-3)
    assert "2 degrees of freedom" in coupled_rods(0.0).report()


def test_a_body_that_is_let_go_hangs_from_a_locked_free_joint() -> None:
    m = pt.Mechanism("drop", gravity=(0, -9.81, 0))
    body = m.add_body("body", mass=1.0, inertia=(1, 1, 1))
    m.add_free("hangs", m.ground, body)
    go = pt.Event("go", lambda t, state: t - 0.5, then=pt.Release("hangs"))
    run = m.simulate(1.0, locked=["hangs"], events=[go])
    assert run.body("body").position[-1] == pytest.approx([0.0, -0.5 * 9.81 * 0.25, 0.0], abs=1e-9)
    held = run.t < 0.49
    assert run.joint("hangs").force[held] == pytest.approx(np.tile([0.0, 9.81, 0.0], (held.sum(), 1)), abs=1e-9)


@COORDINATES
def test_a_stop_and_a_freewheel_that_oppose_each_other_carry_in_turn(coordinates: str) -> None:
    """Friction first, up to what it can; then the one that is in the way of the torque, without chattering."""
    m = wheel()
    m.add_torque("push", "A", lambda t, state: 3.0 * np.sin(5.0 * t))
    m.add_stop("A", lower=0.0, restitution=0.9, name="end")
    m.add_freewheel("A", free=-1, name="pawl")
    m.add_friction("A", 1.0, name="rub")
    start = m.assemble(coordinates=coordinates)
    run = m.simulate(3.0, initial=start, coordinates=coordinates)
    assert run.success and len(run.events) < 20, run.message
    assert np.abs(run.joint("A").velocity).max() < 1e-9 and np.abs(run.joint("A").position).max() < 1e-9
    torque, (end, pawl, rub) = 3.0 * np.sin(5.0 * run.t), (run.force(name).effort for name in ("end", "pawl", "rub"))
    assert end + pawl + rub == pytest.approx(-torque, abs=1e-9)
    assert end.min() > -1e-9 and pawl.max() < 1e-9 and np.abs(rub).max() < 1.0 + 1e-9
    assert end.max() > 1.5 and pawl.min() < -1.5


@COORDINATES
def test_a_freewheel_that_a_dead_centre_turns_back_ends_the_run(coordinates: str) -> None:
    """No force along the slide can stop the crank there, so that nothing holds what must not go back."""
    m, free = drawn_out(gravity=0.0), drawn_out(gravity=0.0)
    m.add_freewheel("S", free=1, name="pawl")

    def moved(one: pt.Mechanism) -> pt.Result:
        start = one.assemble({"O": -0.5}, rates={"O": 4.0}, coordinates=coordinates)
        return one.simulate(0.4, initial=start, coordinates=coordinates)

    run, freely = moved(m), moved(free)
    back = int(np.argmax(freely.joint("S").velocity[:, 0] < 0.0))
    assert not run.success and "singular" in run.message
    assert run.t[-1] == pytest.approx(freely.t[back], abs=0.005)
    assert run.joint("S").velocity.min() > -1e-6
