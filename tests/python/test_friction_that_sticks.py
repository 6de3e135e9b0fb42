"""Friction that sticks, brakes, clutches, freewheels, latches and rigid stops as elements."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_event_actions import COORDINATES, TIGHT

import partita as pt
from partita.errors import DescriptionError


def wheel(inertia: float = 0.4) -> pt.Mechanism:
    m = pt.Mechanism("wheel", gravity=None)
    body = m.add_body("wheel", mass=1.0, inertia=(0.5 * inertia, 0.5 * inertia, inertia))
    m.add_revolute("A", m.ground, body, point=(0, 0, 0), axis=(0, 0, 1))
    return m


def sledge(mass: float = 2.0) -> pt.Mechanism:
    m = pt.Mechanism("sledge", gravity=None)
    body = m.add_body("sledge", mass=mass, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, body, axis=(1, 0, 0))
    return m


def kinds(run: pt.Result) -> list[tuple[str, str]]:
    return [(event.name, event.kind) for event in run.events]


@COORDINATES
@pytest.mark.parametrize(("rtol", "error"), [(1e-6, 1e-5), (1e-9, 1e-8), (1e-12, 1e-11)])
def test_stick_and_slip_on_a_belt(coordinates: str, rtol: float, error: float) -> None:
    """A mass on a moving belt, held by a spring: sticks until the spring carries what friction can, then slips through
    a part of a harmonic oscillation. Closed forms."""
    m = pt.Mechanism("belt", gravity=None)
    belt = m.add_body("belt", mass=1.0, inertia=(1, 1, 1))
    mass = m.add_body("mass", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("B", m.ground, belt, axis=(1, 0, 0))
    m.add_prismatic("X", belt, mass, axis=(1, 0, 0))
    m.add_drive("B", velocity=0.3)
    spring = m.add_spring("S", m.ground, (-5, 0, 0), mass, (0, 0, 0), stiffness=50.0, length=5.0)
    static, dynamic = 0.5 * 2.0 * 9.81, 0.3 * 2.0 * 9.81
    m.add_friction("rub", "X", dynamic, static=static)
    start = m.assemble(rates={"B": 0.3, "X": 0.0}, coordinates=coordinates)
    run = m.simulate(5.0, initial=start, coordinates=coordinates, rtol=rtol, atol=rtol)
    assert run.success and run.certificate.verdict == "valid"
    breaks, returns = static / 50.0, dynamic / 50.0 - (static - dynamic) / 50.0
    omega, arm, speed = 5.0, (static - dynamic) / 50.0, 0.3
    slip = (2.0 * math.pi - 2.0 * math.atan2(arm, speed / omega)) / omega
    times, t = [], breaks / speed
    for _ in range(3):
        times += [t, t + slip]
        t += slip + (breaks - returns) / speed
    assert kinds(run) == [("rub", "slip"), ("rub", "stick")] * 3 + [("rub", "slip")]
    assert run.events.t[:6] == pytest.approx(times, rel=error, abs=error)
    assert run.events["rub"][1].before.velocity("X") == pytest.approx(0.0, abs=error)
    sticks = run.t < 0.65
    at_spring = run.force(spring).force
    assert np.abs(run.v[sticks] - run.v[0]).max() < 1e-12
    # while it sticks friction carries what the spring pulls, while it slips its own force, in the sense of the pull
    assert run.force("rub").effort[sticks] == pytest.approx(at_spring[sticks], abs=1e-10)
    slips = (run.t > times[0]) & (run.t < times[1])
    assert slips.sum() > 20
    assert run.force("rub").effort[slips] == pytest.approx(dynamic, abs=1e-12)
    assert run.joint("X").force[slips, 0] == pytest.approx(dynamic, abs=1e-12)
    balance = run.energy.total - run.energy.work
    assert np.ptp(balance) < 100 * error


def slider_crank() -> pt.Mechanism:
    """Crank 0.08 m, rod 0.25 m, from the outer dead centre; gravity along -y."""
    m = pt.Mechanism("slider-crank", gravity=(0, -9.81, 0))
    crank = m.add_body("crank", mass=0.5, com=(0.02, 0, 0), inertia=(1e-3, 1e-3, 0.0012))
    rod = m.add_body("rod", mass=0.6, com=(0.08, 0, 0), inertia=(2e-3, 2e-3, 0.0035), position=(0.08, 0, 0))
    slider = m.add_body("slider", mass=0.8, inertia=(1e-3, 1e-3, 1e-3), position=(0.33, 0, 0))
    m.add_revolute("O", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("P", crank, rod, point=(0.08, 0, 0))
    m.add_revolute("W", rod, slider, point=(0.33, 0, 0))
    m.add_prismatic("S", m.ground, slider, point=(0.33, 0, 0), axis=(1, 0, 0))
    return m


@COORDINATES
def test_a_slider_crank_swings_to_rest_where_friction_holds_it(coordinates: str) -> None:
    """Half swings by quadrature of the energy, in 45 digits."""
    m = slider_crank()
    m.add_friction("S", 1.5, static=2.2)
    start = m.assemble({"O": -0.1}, coordinates=coordinates)
    run = m.simulate(1.2, initial=start, coordinates=coordinates, **TIGHT)
    assert run.success and run.certificate.verdict == "valid"
    assert [(event.kind, event.direction) for event in run.events] == [("slip", 1), ("stick", -1)]
    turns, rests = run.events
    assert turns.t == pytest.approx(0.437092332957285468, rel=1e-10)
    assert turns.before.position("O") == pytest.approx(-2.46440933014005237643, rel=1e-10)
    assert rests.t == pytest.approx(0.867590337514773241, rel=1e-10)
    assert rests.before.position("O") == pytest.approx(-1.19923401532868649694, rel=1e-9)
    held = run.t > 0.87
    effort = run.force("friction in S").effort
    assert effort[held] == pytest.approx(1.81635031952501329829, rel=1e-8)
    assert set(np.round(effort[run.t < 0.43], 12)) <= {1.5, -1.5}
    assert np.abs(run.v[held]).max() < 1e-12


@COORDINATES
def test_a_clutch_slips_sticks_and_slips_again(coordinates: str) -> None:
    """Two rotors; the clutch of 6 N m engages at 0.5 s, breaks away at 7.5 N m under a motor torque that grows from 3 s
    on. Rational closed forms."""
    m = pt.Mechanism("clutch", gravity=None)
    one = m.add_body("one", mass=1.0, inertia=(1, 1, 0.4))
    two = m.add_body("two", mass=1.0, inertia=(1, 1, 1.1))
    m.add_revolute("A", m.ground, one, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("B", m.ground, two, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("C", two, one, point=(0, 0, 0), axis=(0, 0, 1))
    engaged = 0.5
    m.add_brake("clutch", "C", lambda t, state: 6.0 * (t >= engaged), static=lambda t, state: 7.5 * (t >= engaged))
    m.add_torque("motor", "A", ([0.0, 3.0, 20.0], [0.0, 0.0, 34.0]), interpolation="linear")
    start = m.assemble(rates={"A": 10.0, "B": -3.0}, coordinates=coordinates)
    t_eval = [0.0, 0.4, 4.0, 9.0, 9.11363636363636363636]
    run = m.simulate(10.0, initial=start, coordinates=coordinates, t_eval=t_eval, **TIGHT)
    assert run.success and kinds(run) == [("clutch", "stick"), ("clutch", "slip")], run.message
    sticks, slips = run.events
    assert sticks.t == pytest.approx(1.13555555555555555556, rel=1e-10)
    assert sticks.after.velocity("A") == pytest.approx(0.466666666666666666667, rel=1e-9)
    assert slips.t == pytest.approx(8.11363636363636363636, rel=1e-10)
    assert slips.before.velocity("A") == pytest.approx(17.8995179063360881542699724518, rel=1e-10)
    rates = run.joint("A").velocity[-1], run.joint("B").velocity[-1]
    assert np.ravel(rates) == pytest.approx([30.9676997245179063361, 23.3540633608815426997], rel=1e-10)
    assert abs(run.force("clutch").effort[2]) == pytest.approx(1.46666666666666666667, rel=1e-9)
    assert run.energy.total == pytest.approx(run.energy.total[0] + run.energy.work - run.energy.work[0], rel=1e-10)
    free = m.simulate(1.2, initial=start, coordinates=coordinates, t_eval=[0.0, 1.2], **TIGHT)
    heat = free.energy.total[0] - free.energy.total[-1]
    assert heat == pytest.approx(24.7866666666666666667, rel=1e-10)


def test_a_brake_stops_a_rotor_and_holds_it() -> None:
    m = wheel(1.1)
    m.add_torque("outside", "A", 0.8)
    m.add_brake("A", 5.0, name="brake")
    start = m.assemble(rates={"A": -3.0})
    run = m.simulate(2.0, initial=start, **TIGHT)
    assert kinds(run) == [("brake", "stick")]
    assert run.events[0].t == pytest.approx(1.1 * 3.0 / 5.8, rel=1e-12)
    assert run.joint("A").angle[-1] == pytest.approx(-0.5 * 3.0 * 1.1 * 3.0 / 5.8, rel=1e-12)
    assert run.force("brake").effort[-1] == pytest.approx(-0.8, rel=1e-12)
    assert run.drive("brake").effort[-1, 0] == pytest.approx(-0.8, rel=1e-12)
    assert run.force("brake").power[0] == pytest.approx(-15.0) and run.force("brake").power[-1] == 0.0


@pytest.mark.parametrize("sense", [1, -1])
def test_friction_at_rest_carries_any_load_up_to_its_own(sense: int) -> None:
    """A load that grows linearly: nothing moves until it reaches the static magnitude, at a known time."""
    m = sledge()
    m.add_force("sledge", (lambda t, state: 2.0 * sense * t, 0.0, 0.0))
    m.add_friction("S", 4.0, static=5.0)
    run = m.simulate(4.0, **TIGHT)
    assert [(event.kind, event.direction) for event in run.events] == [("slip", sense)]
    assert run.events[0].t == pytest.approx(2.5, rel=1e-12)
    # m x'' = 2 t - 4 from there on
    tau = run.t[-1] - 2.5
    assert run.joint("S").velocity[-1] == pytest.approx(sense * (tau**2 + tau) / 2.0, rel=1e-10)


def test_a_mechanism_at_rest_under_no_load_stays_there_for_any_time() -> None:
    m = slider_crank()
    m.gravity = (0, 0, 0)
    m.add_friction("S", 1.5)
    m.add_friction("O", 0.2)
    run = m.simulate(50.0, initial=m.assemble({"O": 0.7}))
    assert run.success and not run.events and np.ptp(run.q, axis=0).max() == 0.0


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_frictions_on_one_degree_of_freedom_hold_with_both(order: tuple[int, int]) -> None:
    """Frictions of 1 and 2 N m about one axis carry 3 N m at rest and resist with 3 N m in motion."""
    m = wheel()
    for i in order:
        m.add_friction("A", (1.0, 2.0)[i], name=("one", "two")[i])
    m.add_torque("A", lambda t, state: 1.5 * t)
    run = m.simulate(3.0, **TIGHT)
    assert run.success and run.events.t == pytest.approx([2.0] * len(run.events), rel=1e-9)
    total = run.force("one").effort + run.force("two").effort
    rests = run.t < 2.0
    assert total[rests] == pytest.approx(-1.5 * run.t[rests], abs=1e-12)
    assert total[run.t > 2.001] == pytest.approx(-3.0)
    assert run.joint("A").velocity[-1] == pytest.approx(0.75 / 0.4, rel=1e-9)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_frictions_with_more_at_rest_hold_with_the_sum_of_what_each_can(order: tuple[int, int]) -> None:
    """1 N m and 2 N m in motion, 1.5 N m and 3.2 N m at rest: a load of 1.5 t moves them at 4.7 N m,
    then against 3 N m."""
    m = wheel()
    for i in order:
        m.add_friction("A", (1.0, 2.0)[i], static=(1.5, 3.2)[i], name=("one", "two")[i])
    m.add_torque("A", lambda t, state: 1.5 * t)
    run = m.simulate(4.0, **TIGHT)
    breaks = 4.7 / 1.5
    assert run.success and run.events.t == pytest.approx([breaks] * 2, rel=1e-9)
    total = run.force("one").effort + run.force("two").effort
    rests = run.t < breaks
    assert total[rests] == pytest.approx(-1.5 * run.t[rests], abs=1e-12)
    assert total[~rests] == pytest.approx(-3.0, rel=1e-12)
    speed = (0.75 * (16.0 - breaks**2) - 3.0 * (4.0 - breaks)) / 0.4
    assert run.joint("A").velocity[-1] == pytest.approx(speed, rel=1e-9)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
@pytest.mark.parametrize("more", [1.0, 1.4])
def test_frictions_on_one_degree_of_freedom_hold_a_load_that_goes_up_and_down(
    order: tuple[int, int, int], more: float
) -> None:
    """0.5, 1 and 2 N m in motion, `more` times that at rest: a load that swings to 98 per cent of the sum, to both
    sides, moves nothing; then it goes beyond, down."""
    m = wheel()
    for i in order:
        m.add_friction("A", (0.5, 1.0, 2.0)[i], static=more * (0.5, 1.0, 2.0)[i], name=f"rub {i}")
    most = 3.5 * more
    times, load = [0.0, 1.0, 2.0, 3.0, 4.0, 6.0], [0.0, 0.98 * most, -0.98 * most, 0.98 * most, 0.0, -2.0 * most]
    m.add_torque("A", (times, load), interpolation="linear")
    run = m.simulate(5.2, t_eval=np.linspace(0.0, 5.2, 105), **TIGHT)
    assert run.success and [event.direction for event in run.events] == [-1] * len(run.events)
    assert {event.name for event in run.events} == {"rub 0", "rub 1", "rub 2"}
    assert run.events.t == pytest.approx([5.0] * len(run.events), rel=1e-9)
    efforts = [run.force(f"rub {i}").effort for i in range(3)]
    rests = run.t < 5.0
    assert np.sum(efforts, axis=0)[rests] == pytest.approx(-np.interp(run.t[rests], times, load), abs=1e-11)
    for effort, level in zip(efforts, (0.5, 1.0, 2.0), strict=True):
        assert np.abs(effort).max() <= more * level * (1.0 + 1e-9)
        assert effort[-1] == pytest.approx(level, rel=1e-12)
    assert np.ptp(run.q[rests]) < 1e-13
    # inertia times speed: the load falls at `most` N m a second
    assert run.joint("A").velocity[-1] == pytest.approx((-0.2 * (most - 3.5) - 0.02 * most) / 0.4, rel=1e-8)


def test_the_sense_in_which_friction_slips_is_that_of_the_motion() -> None:
    """A block thrown up a slope turns at once, as friction cannot hold it, and slides down."""
    m = sledge()
    m.gravity = (-9.81, 0, 0)
    m.add_friction("S", 3.0)
    run = m.simulate(1.0, initial=m.assemble(rates={"S": 2.0}), **TIGHT)
    assert [(event.kind, event.direction) for event in run.events] == [("slip", -1)]
    assert run.events[0].t == pytest.approx(2.0 / (9.81 + 1.5), rel=1e-12)


@COORDINATES
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_freewheel_beside_friction_pushes_and_never_pulls(coordinates: str, order: tuple[int, int]) -> None:
    """Free in the positive sense, friction of 1 N m: a load down to -3 N m moves nothing, one of 1.5 t - 3 moves it up
    at t = 8/3."""
    m = wheel()
    adds = [lambda: m.add_freewheel("A", free=1, name="hub"), lambda: m.add_friction("A", 1.0, name="rub")]
    for i in order:
        adds[i]()
    m.add_torque("A", ([0.0, 4.0], [-3.0, 3.0]), interpolation="linear")
    run = m.simulate(3.0, coordinates=coordinates, initial=m.assemble(coordinates=coordinates), **TIGHT)
    assert run.success and {event.name for event in run.events} == {"hub", "rub"}
    assert run.events.t == pytest.approx([8.0 / 3.0] * len(run.events), rel=1e-9)
    hub, rub = run.force("hub").effort, run.force("rub").effort
    assert hub.min() >= -1e-12 and np.abs(rub).max() <= 1.0 + 1e-9
    rests = run.t < 8.0 / 3.0
    assert (hub + rub)[rests] == pytest.approx(3.0 - 1.5 * run.t[rests], abs=1e-10)
    assert (hub + rub)[~rests] == pytest.approx(-1.0, rel=1e-12)
    assert run.joint("A").velocity[-1] == pytest.approx(0.75 * (3.0 - 8.0 / 3.0) ** 2 / 0.4, rel=1e-8)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_what_is_locked_needs_no_freewheel_and_no_stop(e: float) -> None:
    """A lock, a freewheel, a stop and friction on one joint are redundant while the lock holds."""
    m = wheel()
    m.add_freewheel("A", free=-1, name="hub")
    m.add_friction("A", 0.5)
    m.add_stop("A", upper=0.0, restitution=e)
    m.add_torque("A", ([0.0, 1.0, 4.0], [2.0, 2.0, -4.0]), interpolation="linear")
    events = [
        pt.Event("hold", lambda t, state: t - 0.3, then=pt.Lock("A")),
        pt.Event("go", lambda t, state: t - 0.7, then=pt.Release("A")),
    ]
    run = m.simulate(3.0, events=events, **TIGHT)
    assert run.success, run.message
    # it moves down where the load falls below -0.5, at t = 2.25
    late = run.t > 2.26
    assert np.abs(run.v[run.t < 2.25]).max() < 1e-12
    assert run.v[late, 0] == pytest.approx(-((run.t[late] - 2.25) ** 2) / 0.4, rel=1e-6)


@COORDINATES
@pytest.mark.parametrize("rate", [1.0, 1.7, 2.3])
def test_a_freewheel_holds_a_four_bar_where_it_swings_back(coordinates: str, rate: float) -> None:
    """Where the whole mechanism turns back all its rates are zero at once: none of them gets the other sign."""
    m = slider_crank()
    m.add_freewheel("W", free=1, name="hub")
    start = m.assemble({"O": -1.2}, rates={"O": rate}, coordinates=coordinates)
    for t_end in (0.5, 0.8, 1.0, 1.3):
        run = m.simulate(t_end, initial=start, coordinates=coordinates)
        assert run.success or "singular" in str(run.message), run.message
        assert run.joint("W").velocity.min() > -1e-7


def test_a_brake_that_an_event_makes_stronger_holds_at_rest_with_no_less() -> None:
    m = wheel()
    brake = m.add_brake("A", 1.0, static=2.0, name="brake")
    m.add_torque("A", ([0.0, 10.0], [0.0, 10.0]))
    tighter = pt.Event("tighter", lambda t, state: t - 1.0, then=pt.SetInput(brake, 6.0))
    run = m.simulate(8.0, events=[tighter], **TIGHT)
    assert run.success and [event.kind for event in run.events] == ["input", "slip"]
    assert run.events[1].t == pytest.approx(6.0, rel=1e-9)


def test_frictions_of_several_joints_of_a_loop_hold_together() -> None:
    """At rest a parallelogram of massless effect carries the sum of its four frictions about its hinges; it begins to
    move where the load exceeds them all, by virtual work."""
    m = slider_crank()
    m.gravity = (0, 0, 0)
    start = m.assemble({"O": 1.0})
    levels = {"O": 0.3, "P": 0.2, "W": 0.1, "S": 2.0}
    for name, level in levels.items():
        m.add_friction(name, level)
    m.add_torque("load", "O", ([0.0, 100.0], [0.0, 100.0]))
    # rates of all joints for a unit rate of the crank
    rates = m.assemble({"O": 1.0}, rates={"O": 1.0})
    ratio = {name: float(np.ravel(rates.velocity(name))[0]) for name in levels}
    most = sum(level * abs(ratio[name]) for name, level in levels.items())
    run = m.simulate(most + 0.05, initial=start, t_eval=np.linspace(0.0, most + 0.05, 50), **TIGHT)
    first = [event for event in run.events if event.kind == "slip"]
    assert run.success and {event.name for event in first} == {f"friction in {name}" for name in levels}
    assert max(event.t for event in first) == pytest.approx(most, rel=1e-9)
    at_rest = run.t < most
    assert np.ptp(run.q[at_rest], axis=0).max() < 1e-13
    for name, level in levels.items():
        effort = run.force(f"friction in {name}").effort
        assert np.abs(effort).max() <= level * (1.0 + 1e-9)
        assert effort[-1] == pytest.approx(-math.copysign(level, ratio[name]), rel=1e-9)
    power = sum(run.force(f"friction in {name}").effort[at_rest] * ratio[name] for name in levels)
    assert power == pytest.approx(-run.t[at_rest], abs=1e-9)


@COORDINATES
def test_friction_of_a_driven_coordinate_turns_with_its_rate(coordinates: str) -> None:
    """A driven slide that moves to and fro: the drive overcomes friction in the sense of the motion."""
    m = sledge()
    m.add_drive("S", position=lambda t: np.sin(2.0 * t))
    m.add_friction("S", 3.0)
    run = m.simulate(3.0, coordinates=coordinates, t_eval=np.linspace(0.0, 3.0, 61), **TIGHT)
    assert run.success, run.message
    velocity = 2.0 * np.cos(2.0 * run.t)
    clear = np.abs(velocity) > 1e-3
    assert run.force("friction in S").effort[clear] == pytest.approx(-3.0 * np.sign(velocity[clear]))
    drive = -8.0 * np.sin(2.0 * run.t) + 3.0 * np.sign(velocity)
    assert run.drive("drive of S").effort[clear, 0] == pytest.approx(drive[clear], rel=1e-9, abs=1e-8)
    turns = [0.25 * math.pi, 0.75 * math.pi]
    assert run.events.t == pytest.approx(turns, rel=1e-10)


def test_friction_of_a_coordinate_that_a_drive_starts_from_rest() -> None:
    m = sledge()
    m.add_drive("S", velocity=([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0]))
    m.add_friction("S", 3.0)
    run = m.simulate(3.0, t_eval=[0.5, 1.5, 2.5])
    assert run.success, run.message
    assert run.force("friction in S").effort == pytest.approx([0.0, -3.0, -3.0])
    assert run.drive("drive of S").effort[:, 0] == pytest.approx([0.0, 5.0, 3.0])


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


@pytest.mark.parametrize("seed", range(12))
def test_smooth_friction_comes_near_to_the_law_itself(seed: int) -> None:
    """Random double pendulums with dry friction: steep smooth laws, integrated by another program, approach it."""
    rng = np.random.default_rng(seed)
    m = pt.Mechanism("chain", gravity=(0, -9.81, 0))
    parent, x = m.ground, np.zeros(3)
    levels = rng.uniform(0.2, 1.5, 2)
    for i in range(2):
        end = x + np.array([*rng.normal(size=2), 0.0])
        rod = m.add_rod(f"rod {i}", start=x, end=end, mass=rng.uniform(0.5, 2.0))
        m.add_revolute(f"J{i}", parent, rod, point=x)
        parent, x = rod, end
    plain = m.compile()
    rates = {f"J{i}": rng.normal() for i in range(2)}
    start = m.assemble(rates=rates)

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:2], y[2:]
        effort = -levels * np.tanh(v / 2e-4)
        vdot = np.linalg.solve(plain.mass_matrix(q), plain.forces(q, v) + effort)
        return np.concatenate([v, vdot])

    times = np.linspace(0.0, 1.0, 21)
    smooth = solve_ivp(slope, (0.0, 1.0), [*start.q, *start.v], method="Radau", t_eval=times, rtol=1e-8, atol=1e-9)
    for i in range(2):
        m.add_friction(f"J{i}", levels[i])
    run = m.simulate(1.0, initial=m.assemble(rates=rates), t_eval=times, rtol=1e-9)
    assert run.success and run.certificate.verdict == "valid"
    assert np.abs(run.q - smooth.y[:2].T).max() < 2e-3
    for first, second in pairwise(run.energy.total):
        assert second <= first + 1e-9


def test_what_sticks_is_refused_where_only_a_run_can_follow_it() -> None:
    m = slider_crank()
    m.add_friction("rub", "S", 1.0)
    state = m.assemble({"O": -0.5})
    model = m.compile()
    calls: dict[str, Any] = {
        "equilibrium": lambda: m.equilibrium(),
        "equilibria": lambda: m.equilibria(),
        "linearize": lambda: m.linearize(),
        "inverse_dynamics": lambda: m.inverse_dynamics((np.linspace(0, 1, 5), {"O": np.linspace(-0.5, -0.4, 5)})),
        "C source": lambda: m.export_c("rub.c"),
        "an FMU": lambda: m.to_fmu("rub.fmu"),
        "a playground": lambda: m.to_playground("rub.html"),
        "simulate": lambda: model.at(state.q, state.v),
        "state": lambda: model.acceleration(state.q, state.v),
        "one": lambda: model.forces(state.q, state.v),
    }
    for word, call in calls.items():
        with pytest.raises(DescriptionError, match=f'"rub".*{word}'):
            call()


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
        m = slider_crank()
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


def test_a_stepper_sticks_until_its_input_exceeds_what_friction_can_carry() -> None:
    m = wheel()
    m.add_torque("motor", "A", 0.0)
    m.add_brake("brake", "A", 2.0, static=2.5)
    sim = m.stepper(0.01)
    for torque, moves in ((1.0, False), (2.4, False), (2.6, True)):
        for _ in range(10):
            sim.step({"motor": torque})
        assert (abs(sim.state.velocity("A")) > 0.0) == moves
    assert sim.state.velocity("A") == pytest.approx(0.6 * 0.1 / 0.4, rel=1e-9)
    found = sim.result()
    assert found.force("brake").effort[[5, 15, 25]] == pytest.approx([-1.0, -2.4, -2.0])
    assert [(e.name, e.kind) for e in found.events] == [("brake", "slip")]
    # a function that fails leaves it as it was
    before = sim.state
    with pytest.raises(pt.errors.ArgumentError):
        sim.step({"motor": math.nan})
    assert sim.time == before.t and (sim.q == before.q).all()


def test_what_a_stepper_cannot_do_with_events_is_said() -> None:
    m = wheel()
    with pytest.raises(pt.errors.ArgumentError, match="which only simulate can"):
        m.stepper(0.01, events=[pt.Event("e", "A", value=1.0, then=pt.Release("A"))])
    m.add_torque("motor", "A", 0.0)
    with pytest.raises(DescriptionError, match="give them to sim"):
        m.stepper(0.01, events=[pt.Event("e", "A", value=1.0, then=pt.SetInput("motor", 1.0))])
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


def test_frictions_in_a_redundant_platform_keep_its_velocities() -> None:
    """A leg of a platform whose joints are redundant has a constraint that is zero but for rounding: transitions leave
    velocities as they are, and frictions of mirrored joints act alike."""
    m = pt.catalogue.load("exechon-like")
    for name in ("head 1", "head 2"):
        m.add_friction(name, 0.022, static=0.0285)
    run = m.simulate(0.3, t_eval=np.linspace(0.0, 0.3, 61))
    assert run.success and run.certificate.verdict == "valid"
    assert np.ravel(run.joint("head 1").velocity) == pytest.approx(-np.ravel(run.joint("head 2").velocity), abs=1e-7)
    for i in (10, 46, 50):
        again = m.simulate(0.3 - run.t[i], initial=run.state(run.t[i]), t_eval=run.t[i:])
        assert np.abs(again.v[0] - run.v[i]).max() < 1e-11
        assert again.q[-1] == pytest.approx(run.q[-1], abs=1e-7)


@pytest.mark.parametrize("order", [0, 1])
def test_friction_yields_to_what_never_yields(order: int) -> None:
    """A stuck bolt that a driven wrench takes along by a freewheel: it slips as soon as the wrench turns forwards."""
    m = pt.Mechanism("ratchet", gravity=None)
    for name in ("wrench", "bolt"):
        m.add_body(name, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    m.add_revolute("head", m.ground, "wrench", point=(0, 0, 0))
    m.add_revolute("thread", m.ground, "bolt", point=(0, 0, 0))
    m.add_revolute("ratchet", "wrench", "bolt", point=(0, 0, 0))
    m.add_drive("head", velocity=([0.0, 1.0, 2.0], [-1.0, 1.0, 3.0]), name="arm")
    if order:
        m.add_freewheel("ratchet", free=1, name="pawl")
    m.add_friction("thread", 12.0, name="tight")
    if not order:
        m.add_freewheel("ratchet", free=1, name="pawl")
    run = m.simulate(2.0, initial=m.assemble(rates={"head": -1.0, "thread": 0.0}), **TIGHT)
    assert run.success, run.message
    assert {(e.name, e.kind) for e in run.events} == {("pawl", "lock"), ("tight", "slip")}
    assert run.events.t == pytest.approx([0.5, 0.5], abs=1e-9)
    assert run.joint("thread").angle[-1] == pytest.approx(1.5**2, rel=1e-9)
    assert run.force("tight").effort[-1] == pytest.approx(-12.0) and run.force("tight").effort[0] == 0.0
    assert run.force("pawl").effort[-1] == pytest.approx(12.0 + 2.0 * 2e-3, rel=1e-9)


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
