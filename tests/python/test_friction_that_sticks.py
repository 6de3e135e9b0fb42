"""Friction that sticks, brakes and clutches, also beside freewheels and stops."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from drawings import drawn_out
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


@COORDINATES
def test_a_slider_crank_swings_to_rest_where_friction_holds_it(coordinates: str) -> None:
    """Half swings by quadrature of the energy, in 45 digits."""
    m = drawn_out()
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
    m = drawn_out()
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
    m = drawn_out()
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
    m = drawn_out()
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
    m = drawn_out()
    m.add_friction("rub", "S", 1.0)
    state = m.assemble({"O": -0.5})
    model = m.compile()
    calls: dict[str, Any] = {
        "equilibrium": lambda: m.equilibrium(),
        "equilibria": lambda: m.equilibria(),
        "linearize": lambda: m.linearize(),
        "inverse_dynamics": lambda: m.inverse_dynamics((np.linspace(0, 1, 5), {"O": np.linspace(-0.5, -0.4, 5)})),
        "C source": lambda: m.export_c("rub.c"),
        "a playground": lambda: m.to_playground("rub.html"),
        "simulate": lambda: model.at(state.q, state.v),
        "state": lambda: model.acceleration(state.q, state.v),
        "one": lambda: model.forces(state.q, state.v),
    }
    for word, call in calls.items():
        with pytest.raises(DescriptionError, match=f'"rub".*{word}'):
            call()


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
