"""What events do: locks, releases, rates, rigid stops, and the accounts of a run across them."""

import itertools
import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawings import GENERAL, drawn_out, four_bar
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import partita as pt
from partita.errors import ArgumentError, DescriptionError, UnknownNameError

Array = NDArray[np.float64]
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
COORDINATES = pytest.mark.parametrize("coordinates", ["relative", "absolute"])


def door() -> pt.Mechanism:
    """A rod of 1.2 m and 4 kg that hangs from the hinge A."""
    m = pt.Mechanism("door", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -1.2, 0), mass=4.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


LATCH = [
    pt.Event("latch", "A", value=0.7, direction=1, then=pt.Lock("A")),
    pt.Event("opens", lambda t, state: t - 2.5, once=True, then=pt.Release("A")),
    pt.Event("catch", "A", value=-0.5, direction=-1, then=[pt.Lock("A")]),
]


@COORDINATES
@pytest.mark.parametrize(("rtol", "error"), [(1e-6, 1e-4), (1e-9, 1e-7), (1e-12, 1e-10)])
def test_a_latch_that_locks_holds_releases_and_locks_again(coordinates: str, rtol: float, error: float) -> None:
    """Times, impulses and forces of the door by quadrature in 46 digits."""
    m = door()
    start = m.assemble({"A": -1.1}, coordinates=coordinates)
    times = np.linspace(0.0, 4.0, 401)
    run = m.simulate(4.0, initial=start, coordinates=coordinates, t_eval=times, rtol=rtol, atol=rtol, events=LATCH)
    assert run.success and run.status == "finished" and (run.t == times).all()
    assert [(x.name, x.kind) for x in run.events] == [("latch", "lock"), ("opens", "release"), ("catch", "lock")]
    locks, opens, again = run.events
    close = {"rel": error, "abs": error}
    assert [x.t for x in run.events] == pytest.approx([0.693939198568014325, 2.5, 3.19551735461506524], **close)
    assert locks.before.velocity("A") == pytest.approx(2.76284450615480588, **close)
    assert abs(locks.after.velocity("A")) < 1e-14
    assert locks.impulses["lock of A"].effort == pytest.approx(-5.30466145181722730, **close)
    hinge_impulse = -5.07153608451449755, -4.27169591508578056
    assert locks.impulses["A"].force[:2] == pytest.approx(hinge_impulse, **close)
    assert locks.impulses["A"].moment[2] == pytest.approx(-5.30466145181722730, **close)
    assert locks.energy_lost == pytest.approx(7.32797737458220149, **close)
    assert again.energy_lost == pytest.approx(2.65435937972093972, **close)
    held = (run.t > 0.75) & (run.t < 2.45)
    hinge = run.joint("A")
    assert np.abs(hinge.angle[held] - 0.7).max() < 1e-9
    assert run.drive("lock of A").effort[held, 0] == pytest.approx(15.1674612283241981676, rel=1e-9)
    assert hinge.force[held] == pytest.approx(np.tile([0.0, 39.24, 0.0], (held.sum(), 1)), abs=1e-9)
    # what the lock carries is part of the reaction of the joint
    assert hinge.moment[held, 2] == pytest.approx(15.1674612283241981676, rel=1e-9)
    free = (run.t < 0.69) | ((run.t > 2.5) & (run.t < 3.19))
    assert not run.drive("lock of A").effort[free].any()
    assert run.drive("lock of A").effort[-1, 0] == pytest.approx(-11.2875948808973554, rel=1e-7)
    assert run.certificate.verdict == "valid" and opens.energy_lost == 0.0
    balance = run.energy.total - run.energy.work
    assert np.ptp(balance) < 10 * error * (1.0 + abs(balance[0]))


def test_what_is_locked_at_the_start_holds_until_it_is_released() -> None:
    m = door()
    start = m.assemble({"A": 0.3}, rates={"A": 1.0})
    run = m.simulate(
        2.0, initial=start, locked=["A"], events=[pt.Event("go", lambda t, state: t - 1.0, then=pt.Release("A"))]
    )
    angle = run.joint("A").angle
    assert np.abs(angle[run.t <= 1.0] - 0.3).max() < 1e-12 and np.ptp(angle[run.t > 1.0]) > 0.1
    free = m.simulate(1.0, initial=m.assemble({"A": 0.3}))
    assert run.state().position("A") == pytest.approx(free.state().position("A"), abs=1e-7)
    still = m.simulate(1.0, initial=start, locked="A")
    assert np.abs(still.joint("A").angle - 0.3).max() < 1e-12 and still.success
    assert still.drive("lock of A").effort[:, 0] == pytest.approx(4.0 * 9.81 * 0.6 * math.sin(0.3), rel=1e-12)


OF_JOINTS = {
    "A": (0.638486675081557387820, 0.353961657162822876351),
    "B": (0.829201602357369114128, 0.163708059636494666898),
    "C": (1.812604523296477083588, -0.457279682689440608756),
}
"""Of the first impact, on the crank, the rod and the slider."""
HITS = (
    (0.145256706343241033564, 8.97952082720133141959519, -3.31639368292505414523, 1.03899101446737267282),
    (0.294464676478600034597, 4.48976041360066570979760, -1.65819684146252707262, 0.25974775361684316821),
    (0.372000578656913342748, 2.24488020680033285489880, -0.82909842073126353631, None),
)
"""A slider-crank that bounces on a stop with e = 1/2: times, rates of the crank after, impulses, energies lost."""
ACCUMULATED, PUSHED = 0.450851796314741002777, -13.97550585


def crank() -> pt.Mechanism:
    m = pt.Mechanism("crank", gravity=(9.81, 0, 0))
    one = m.add_body("crank", mass=0.5, com=(0.02, 0, 0), inertia=(1e-3, 1e-3, 0.0012))
    two = m.add_body("rod", mass=0.6, com=(0.08, 0, 0), inertia=(0.00175, 0.00175, 0.0035), position=(0.08, 0, 0))
    slider = m.add_body("slider", mass=0.8, inertia=(1e-3, 1e-3, 1e-3), position=(0.33, 0, 0))
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, two, point=(0.08, 0, 0))
    m.add_revolute("C", two, slider, point=(0.33, 0, 0))
    m.add_prismatic("S", m.ground, slider, axis=(1, 0, 0))
    return m


@COORDINATES
@pytest.mark.parametrize("measured", ["joint", "along", "distance"])
def test_a_slider_crank_that_bounces_until_it_rests(coordinates: str, measured: str) -> None:
    m = crank()
    followed: dict[str, tuple[Any, float]] = {
        "joint": ("S", -0.03),
        "along": (pt.Along("ground", (0, 0, 0), (1, 0, 0), "slider", (0, 0, 0)), 0.30),
        "distance": (pt.Distance("ground", (0, 0, 0), "slider", (0, 0, 0)), 0.30),
    }
    of, value = followed[measured]
    stop = pt.Event("wall", of, value=value, direction=1, then=pt.Stop(0.5))
    start = m.assemble({"A": 2.0}, coordinates=coordinates)
    run = m.simulate(0.6, initial=start, coordinates=coordinates, events=[stop], **TIGHT)
    hits = [record for record in run.events if record.kind == "impact"]
    for record, (t, rate, impulse, lost) in zip(hits, HITS, strict=False):
        assert record.t == pytest.approx(t, rel=1e-11)
        assert record.impulses["stop wall"].effort == pytest.approx(impulse, rel=1e-10)
        if coordinates == "relative":
            assert record.after.velocity("A") == pytest.approx(rate, rel=1e-10)
        if lost is not None:
            assert record.energy_lost == pytest.approx(lost, rel=1e-10)
    assert [record.kind for record in run.events][-2:] == ["rest", "accumulation"] and len(hits) > 15
    assert run.events[-1].t == pytest.approx(ACCUMULATED, rel=1e-9 if measured == "joint" else 1e-8)
    resting = run.t > 0.4509
    assert run.drive("stop wall").effort[resting, 0] == pytest.approx(PUSHED, rel=1e-8)
    assert run.joint("S").position.max() < -0.03 + 1e-11
    assert run.certificate.verdict == "valid"
    first = hits[0]
    for joint, impulse in OF_JOINTS.items():
        assert first.impulses[joint].force[:2] == pytest.approx(impulse, rel=1e-9)
        assert first.impulses[joint].determined[:2].all()
    assert first.impulses["S"].force[1] == pytest.approx(-OF_JOINTS["C"][1], rel=1e-9)
    assert first.before.t == first.after.t and (first.before.q == first.after.q).all()


@pytest.mark.parametrize("e", [0.0, 0.5, 0.8, 0.95, 1.0])
def test_a_ball_that_bounces(e: float) -> None:
    m = pt.Mechanism("ball", gravity=(0, 0, -9.81))
    ball = m.add_body("ball", mass=1.3, inertia=(1e-2, 1e-2, 1e-2), position=(0, 0, 1))
    m.add_prismatic("z", m.ground, ball, axis=(0, 0, 1))
    floor = pt.Event("floor", "z", value=-1.0, direction=-1, then=pt.Stop(e))
    run = m.simulate(20.0 if e < 1.0 else 5.0, events=[floor], **TIGHT)
    first = math.sqrt(2.0 / 9.81)
    hits = [record.t for record in run.events if record.kind == "impact"]
    expected = first + 2.0 * first * np.concatenate([[0.0], np.cumsum(e ** np.arange(1.0, len(hits)))])
    assert np.allclose(hits, expected, rtol=1e-10, atol=0.0)
    assert run.success and run.certificate.verdict == "valid" and run.joint("z").position.min() > -1.0 - 1e-11
    if 0.0 < e < 1.0:
        limit = first * (1.0 + e) / (1.0 - e)
        assert run.events[-1].kind == "accumulation" and run.events[-1].t == pytest.approx(limit, rel=1e-10)
    if e < 1.0:
        assert run.drive("stop floor").effort[-1, 0] == pytest.approx(1.3 * 9.81, rel=1e-12)
        assert abs(run.joint("z").position[-1] + 1.0) < 1e-11


def test_a_contact_that_rests_ends_when_it_no_longer_presses() -> None:
    """A ball on a table that falls away with 12 m/s^2 from 2 s on."""
    m = pt.Mechanism("table", gravity=(0, 0, -9.81))
    table = m.add_body("table", mass=2.0, inertia=(1, 1, 1))
    ball = m.add_body("ball", mass=1.3, inertia=(1, 1, 1))
    m.add_prismatic("T", m.ground, table, axis=(0, 0, 1))
    m.add_prismatic("z", m.ground, ball, axis=(0, 0, 1))
    m.add_drive("T", velocity=([0.0, 2.0, 3.0], [0.0, 0.0, -12.0]))
    gap = pt.Along("table", (0, 0, 0), (0, 0, 1), "ball", (0, 0, 0))
    rest = pt.Event("rest", gap, direction=-1, then=pt.Stop(0.0))
    run = m.simulate(2.5, events=[rest], t_eval=[0.0, 1.0, 1.9, 2.5], **TIGHT)
    assert [record.kind for record in run.events] == ["rest", "lift-off"]
    assert run.events[1].t == pytest.approx(2.0, abs=1e-9)
    gaps = run.joint("z").position[:, 0] - run.joint("T").position[:, 0]
    assert gaps[:3] == pytest.approx(0.0, abs=1e-12) and gaps[3] == pytest.approx((12.0 - 9.81) / 2.0 * 0.25, rel=1e-8)
    assert run.drive("stop rest").effort[:3, 0] == pytest.approx(1.3 * 9.81, rel=1e-12)


def sliders(masses: Array) -> pt.Mechanism:
    """Bodies that slide one on another along x: the velocities couple by the masses carried."""
    m = pt.Mechanism("sliders", gravity=(0, 0, 0))
    carrier: Any = m.ground
    for i, mass in enumerate(masses):
        body = m.add_body(f"b{i}", mass=float(mass), inertia=(1, 1, 1))
        m.add_prismatic(f"x{i}", carrier, body, axis=(1, 0, 0))
        carrier = body
    return m


def moreau(mass: Array, v: Array, normals: Array, e: Array) -> Array:
    """Velocities after, by trying which stops push."""
    inverse = np.linalg.inv(mass)
    wanted = -e * np.minimum(normals @ v, 0.0)
    for count in range(len(normals) + 1):
        for pushing in itertools.combinations(range(len(normals)), count):
            n = normals[list(pushing)]
            system = n @ inverse @ n.T
            if count and np.linalg.matrix_rank(system) < count:
                continue
            impulses = np.linalg.solve(system, wanted[list(pushing)] - n @ v) if count else np.zeros(0)
            after = v + inverse @ n.T @ impulses
            if (impulses >= -1e-12).all() and (normals @ after >= wanted - 1e-12).all():
                return np.asarray(after)
    raise AssertionError("there is always one")


@COORDINATES
def test_stops_that_are_hit_at_once_are_one_problem_of_least_change(coordinates: str) -> None:
    rng = np.random.default_rng(11)
    for case in range(25):
        n = int(rng.integers(2, 5))
        masses, rates, e = rng.uniform(0.2, 3.0, n), rng.uniform(-2.0, -0.1, n), rng.uniform(0.0, 1.0, n)
        if case % 3 == 0:
            e[:] = e[0]
        m = sliders(masses)
        events = [
            pt.Event(
                f"s{i}",
                pt.Along("ground", (0, 0, 0), (1, 0, 0), f"b{i}", (0, 0, 0)),
                value=-0.5 * float(-rates[: i + 1].sum()),
                direction=-1,
                then=pt.Stop(float(e[i])),
            )
            for i in range(n)
        ]
        start = m.assemble(rates={f"x{i}": float(rates[i]) for i in range(n)}, coordinates=coordinates)
        run = m.simulate(0.50001, initial=start, coordinates=coordinates, events=events, rtol=1e-10, atol=1e-10)
        sums = np.tril(np.ones((n, n)))
        expected = moreau(sums.T @ np.diag(masses) @ sums, rates, sums, e)
        hits = [record for record in run.events if record.kind == "impact"]
        assert {record.t for record in hits} == {hits[0].t} and hits[0].t == pytest.approx(0.5, abs=1e-9)
        after = np.array([run.joint(f"x{i}").velocity[-1, 0] for i in range(n)])
        assert np.allclose(after, expected, rtol=0.0, atol=1e-9), (case, after, expected)
        before, now = (0.5 * x @ sums.T @ np.diag(masses) @ sums @ x for x in (rates, expected))
        assert sum(record.energy_lost for record in hits) == pytest.approx(before - now, abs=1e-9)
        assert now <= before + 1e-12


def test_a_beam_that_falls_flat_on_three_stops() -> None:
    """Two freedoms, three stops: velocities are determined, the impulses by their sum and first moment alone."""
    m = pt.Mechanism("beam", gravity=(0, -9.81, 0))
    beam = m.add_rod("beam", start=(-1, 1, 0), end=(1, 1, 0), mass=6.0)
    m.add_planar("P", m.ground, beam, point=(0, 1, 0))
    ends = {"left": (0, 0, 0), "middle": (1, 0, 0), "right": (2, 0, 0)}
    stops = [
        pt.Event(
            name,
            pt.Along("ground", (0, 0, 0), (0, 1, 0), "beam", ends[name]),
            direction=-1,
            then=pt.Stop(0.5),
        )
        for name in ends
    ]
    run = m.simulate(0.6, events=stops, rtol=1e-11, atol=1e-11)
    hits = [record for record in run.events if record.kind == "impact"]
    speed = math.sqrt(2.0 * 9.81)
    assert len(hits) == 3 and len({record.t for record in hits}) == 1
    pushed = [x.effort for name, x in hits[0].impulses.items() if name.startswith("stop ")]
    assert sum(pushed) == pytest.approx(6.0 * 1.5 * speed, rel=1e-9)
    assert np.allclose(hits[0].after.v, -0.5 * hits[0].before.v, rtol=0.0, atol=1e-9)
    long = m.simulate(5.0, events=stops, rtol=1e-9, atol=1e-9)
    pressed = sum(long.drive(f"stop {name}").effort[-1, 0] for name in ends)
    assert long.success and pressed == pytest.approx(6.0 * 9.81, rel=1e-9)
    assert abs(long.state().position("P")[1] + 1.0) < 1e-9


def double_pendulum() -> pt.Mechanism:
    m = pt.Mechanism("double", gravity=(0, -9.81, 0))
    one = m.add_rod("one", start=(0, 0, 0), end=(0, -1, 0), mass=1.0)
    two = m.add_rod("two", start=(0, -1, 0), end=(0, -1.8, 0), mass=0.7)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, two, point=(0, -1, 0))
    return m


def own_motion(start: Array, limits: tuple[float, float], e: float, end: float) -> tuple[list[float], Array]:
    """The double pendulum with a stop for B on either side, from its own equations: times of impacts, and the end."""
    (m1, l1), (m2, l2) = (1.0, 1.0), (0.7, 0.8)
    j1, j2 = m1 * l1**2 / 3.0 + m2 * l1**2, m2 * l2**2 / 3.0

    def matrices(y: Array) -> tuple[Array, Array]:
        a, b, c = y[0], y[1], m2 * l1 * l2 / 2.0  # absolute angles
        mass = np.array([[j1, c * math.cos(a - b)], [c * math.cos(a - b), j2]])
        turn = c * math.sin(a - b)
        load = [
            -turn * y[3] ** 2 - 9.81 * (m1 * l1 / 2.0 + m2 * l1) * math.sin(a),
            turn * y[2] ** 2 - 9.81 * m2 * l2 / 2.0 * math.sin(b),
        ]
        return mass, np.array(load)

    def slope(t: float, y: Array) -> Array:
        mass, load = matrices(y)
        return np.concatenate([y[2:], np.linalg.solve(mass, load)])

    def stop(limit: float, sign: float) -> Any:
        def gap(t: float, y: Array) -> float:
            return sign * (limit - (y[1] - y[0]))

        gap.terminal, gap.direction = True, -1.0  # type: ignore[attr-defined]
        return gap

    y, t, times = start.copy(), 0.0, []
    while True:
        found = solve_ivp(
            slope, (t, end), y, "DOP853", events=[stop(limits[0], -1.0), stop(limits[1], 1.0)], rtol=1e-12, atol=1e-13
        )
        y, t = found.y[:, -1], float(found.t[-1])
        if found.status != 1 or len(times) > 6:
            return times, y
        times.append(t)
        mass, _ = matrices(y)
        row = np.array([-1.0, 1.0])
        rate = row @ y[2:]
        y[2:] -= (1.0 + e) * rate / (row @ np.linalg.solve(mass, row)) * np.linalg.solve(mass, row)
        t = np.nextafter(t, end)
        y[1] += 1e-13 * np.sign(-rate)


@COORDINATES
@pytest.mark.parametrize("seed", range(12))
def test_a_double_pendulum_between_stops_moves_as_its_own_equations_do(coordinates: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    e = float(rng.uniform(0.3, 1.0))
    limits = float(rng.uniform(-0.9, -0.2)), float(rng.uniform(0.2, 0.9))
    angles = float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.5)), float(rng.uniform(*limits)) * 0.9
    m = double_pendulum()
    start = m.assemble({"A": angles[0], "B": angles[1]}, coordinates=coordinates)
    events = [
        pt.Event("low", "B", value=limits[0], direction=-1, then=pt.Stop(e)),
        pt.Event("high", "B", value=limits[1], direction=1, then=pt.Stop(e)),
    ]
    end = 2.0
    run = m.simulate(end, initial=start, coordinates=coordinates, events=events, **TIGHT)
    times, y = own_motion(np.array([angles[0], sum(angles), 0.0, 0.0]), limits, e, end)
    hits = [record.t for record in run.events if record.kind == "impact"]
    count = min(len(times), len(hits), 6)
    assert np.allclose(hits[:count], times[:count], rtol=0.0, atol=1e-7)
    if len(times) == len(hits) <= 6:
        assert run.joint("A").angle[-1] == pytest.approx(y[0], abs=1e-5)
    b = run.joint("B").angle
    assert b.min() > limits[0] - 1e-9 and b.max() < limits[1] + 1e-9
    assert run.success and run.certificate.verdict == "valid"
    total = run.energy.total
    assert total.max() <= total[0] + 1e-9 * (1.0 + abs(total[0]))


@COORDINATES
def test_rates_that_are_set_change_the_rest_least(coordinates: str) -> None:
    m = double_pendulum()
    start = m.assemble({"A": 0.5, "B": -0.3}, rates={"A": 1.0, "B": 0.5}, coordinates=coordinates)
    kick = pt.Event("kick", lambda t, state: t - 0.3, then=pt.SetRates({"B": 4.0}))
    run = m.simulate(0.6, initial=start, coordinates=coordinates, events=[kick], **TIGHT)
    (record,) = run.events
    assert record.kind == "rates" and record.t == pytest.approx(0.3, abs=1e-12)
    model = m.compile(coordinates)
    i = model.at(record.after.q, record.after.v, record.t)
    # the momentum along every motion but that of B is the same
    change = i.M @ (record.after.v - record.before.v)
    free = i.D @ change
    row = i.D @ np.array([0.0, 1.0]) if coordinates == "relative" else None
    if row is not None:
        assert record.after.velocity("B") == pytest.approx(4.0, rel=1e-12)
        assert abs(change[0]) < 1e-12 and free.shape == (2,)
        assert record.impulses["rate of B.0"].effort == pytest.approx(change[1], rel=1e-11)
    assert -record.energy_lost == pytest.approx(
        0.5 * record.after.v @ i.M @ record.after.v - 0.5 * record.before.v @ i.M @ record.before.v, rel=1e-10
    )
    assert run.certificate.verdict == "valid"


@COORDINATES
def test_a_four_bar_that_is_locked_in_any_joint_stands_still(coordinates: str) -> None:
    """The impulses of all joints follow: the momentum of each body is that before and after."""
    m = four_bar(GENERAL)
    for joint in "ABCD":
        lock = pt.Event("lock", lambda t, state: t - 0.4, then=pt.Lock(joint))
        run = m.simulate(
            1.0, coordinates=coordinates, initial=m.assemble(coordinates=coordinates), events=[lock], **TIGHT
        )
        (record,) = run.events
        assert record.kind == "lock" and np.abs(record.after.v).max() < 1e-12
        held = run.t > 0.4
        assert np.ptp(run.joint("A").angle[held]) < 1e-10
        # statics: the lock carries what holds the position there
        assert run.certificate.verdict == "valid" and run.success
        assert record.energy_lost == pytest.approx(run.energy.kinetic[run.t < 0.4][-1], rel=0.05)


def test_a_latch_that_closes_a_hundred_times() -> None:
    """It holds from where the pendulum comes to its lowest point until the next whole second, and is kicked then."""
    m = door()
    clock = pt.Event("go", lambda t, state: math.sin(math.pi * t), then=[pt.Release("A"), pt.SetRates({"A": 3.0})])
    latch = pt.Event("latch", "A", value=0.0, direction=-1, then=pt.Lock("A"))
    run = m.simulate(100.99, events=[clock, latch], t_eval=np.arange(0.25, 100.9, 0.25))
    kinds = [record.kind for record in run.events]
    assert run.success and kinds.count("lock") == kinds.count("rates") == 100
    locks = run.events["latch"].t
    # every swing is the first one again
    assert np.ptp(locks - locks[0] - np.arange(100)) < 1e-6
    assert run.certificate.verdict in ("valid", "suspect")


def test_observing_acting_and_terminal_events_beside_each_other() -> None:
    m = pt.Mechanism("ball", gravity=(0, 0, -9.81))
    ball = m.add_body("ball", mass=1.0, inertia=(1, 1, 1), position=(0, 0, 1))
    m.add_prismatic("z", m.ground, ball, axis=(0, 0, 1))
    events = [
        pt.Event("floor", "z", value=-1.0, direction=-1, then=pt.Stop(0.5)),
        pt.Event("half", "z", value=-0.5),
        pt.Event("top", "z", reads="velocity", direction=-1, terminal=2),
    ]
    run = m.simulate(10.0, events=events, **TIGHT)
    assert run.status == "event" and run.success
    first = math.sqrt(2.0 / 9.81)
    assert run.t[-1] == pytest.approx(2.25 * first, rel=1e-10)
    assert [record.name for record in run.events] == ["half", "floor", "top", "floor", "top"]
    assert run.events["top"].t == pytest.approx([1.5 * first, 2.25 * first], rel=1e-10)


def test_outputs_at_an_impact_are_those_after_it() -> None:
    m = pt.Mechanism("bead", gravity=(0, 0, 0))
    bead = m.add_body("bead", mass=1.0, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("x", m.ground, bead, axis=(1, 0, 0))
    start = m.assemble({"x": 1.0}, rates={"x": -2.0})
    stop = pt.Event("stop", "x", direction=-1, then=pt.Stop(0.5))
    run = m.simulate(1.0, initial=start, t_eval=[0, 0.25, 0.5, 0.75, 1], events=[stop])
    assert run.t.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert run.joint("x").position[:, 0] == pytest.approx([1, 0.5, 0, 0.25, 0.5], abs=1e-12)
    (record,) = run.events
    assert record.t == pytest.approx(0.5, abs=1e-13)
    assert (record.before.velocity("x"), record.after.velocity("x")) == pytest.approx((-2.0, 1.0), rel=1e-12)
    assert run.joint("x").velocity[[1, 3], 0] == pytest.approx([-2.0, 1.0], rel=1e-12)
    assert run.state(0.3).velocity("x") == pytest.approx(-2.0) and run.state(0.7).position("x") == pytest.approx(0.2)
    states = run.state([0.1, 0.6, 0.9])
    assert [x.position("x") for x in states] == pytest.approx([0.8, 0.1, 0.4])


def test_starts_at_a_stop() -> None:
    """One that closes there is hit at once, one that is pressed rests, one that opens is left; beyond it is refused."""
    m = pt.Mechanism("bead", gravity=(-9.81, 0, 0))
    bead = m.add_body("bead", mass=2.0, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("x", m.ground, bead, axis=(1, 0, 0))
    stop = pt.Event("stop", "x", direction=-1, then=pt.Stop(0.5))
    hit = m.simulate(0.05, initial=m.assemble({"x": 0.0}, rates={"x": -2.0}), events=[stop])
    assert hit.events[0].kind == "impact" and hit.events[0].t == 0.0
    assert hit.joint("x").velocity[-1, 0] == pytest.approx(1.0 - 9.81 * 0.05)
    rests = m.simulate(0.5, initial=m.assemble({"x": 0.0}), events=[stop])
    assert [record.kind for record in rests.events] == ["rest"]
    assert rests.drive("stop stop").effort[:, 0] == pytest.approx(2.0 * 9.81) and np.abs(rests.q).max() < 1e-12
    leaves = m.simulate(0.1, initial=m.assemble({"x": 0.0}, rates={"x": 2.0}), events=[stop])
    assert len(leaves.events) == 0
    with pytest.raises(ArgumentError, match='beyond the stop of event "stop"'):
        m.simulate(0.1, initial=m.assemble({"x": -0.1}), events=[stop])


@pytest.mark.parametrize("suffix", [".nc", ".mat", ".zarr", ".json"])
def test_stored_runs_have_their_impulses(tmp_path: Path, suffix: str) -> None:
    m = door()
    run = m.simulate(4.0, initial=m.assemble({"A": -1.1}), events=LATCH)
    run.save(tmp_path / f"run{suffix}")
    read = pt.load_result(tmp_path / f"run{suffix}")
    for one, other in zip(run.events, read.events, strict=True):
        assert (one.t, one.kind, one.energy_lost) == (other.t, other.kind, other.energy_lost)
        assert list(one.impulses) == list(other.impulses)
        for name, impulse in one.impulses.items():
            there = other.impulses[name]
            assert impulse.effort == there.effort
            assert impulse.force is None or (impulse.force == there.force).all()
            assert impulse.moment is None or (impulse.moment == there.moment).all()
            assert impulse.determined is None or (impulse.determined == there.determined).all()
        assert (one.after.v == other.after.v).all()
    assert read.certificate.verdict == "valid"
    copied = pickle.loads(pickle.dumps(run))
    assert (copied.events[0].impulses["A"].force == run.events[0].impulses["A"].force).all()
    assert (copied.multipliers == run.multipliers).all()


def test_numbers_of_actions_may_be_those_of_numpy() -> None:
    m = door()
    start = m.assemble({"A": -1.1})
    runs = [
        m.simulate(1.0, initial=start, events=[pt.Event("e", "A", value, direction=1, then=then)])
        for value, then in ((-1.0, pt.SetRates({"A": 2})), (np.float32(-1), pt.SetRates({"A": np.int64(2)})))
    ]
    assert np.array_equal(runs[0].q, runs[1].q) and len(runs[0].events) == 1
    bounced = [
        m.simulate(1.0, initial=start, events=[pt.Event("e", "A", -1.0, direction=1, then=pt.Stop(number))])
        for number in (0.5, np.float32(0.5), np.array([0.5]))
    ]
    assert all(np.array_equal(run.q, bounced[0].q) for run in bounced)


def test_bad_actions_are_refused_by_name() -> None:
    m = door()
    for make, words in (
        (lambda: pt.Event("e", "A", then="lock"), "then"),
        (lambda: pt.Event("e", "A", then=[pt.Lock("A"), 3]), "then"),
        (lambda: pt.Event("e", "A", then=pt.Stop(0.5)), "direction"),
        (lambda: pt.Event("e", "A", direction=1, then=pt.Stop(1.5)), "between 0 and 1"),
        (lambda: pt.Event("e", "A", direction=1, then=pt.Stop(True)), "between 0 and 1"),
        (lambda: pt.Event("e", "A", direction=1, then=[pt.Stop(0.5), pt.Stop(0.1)]), "two stops"),
        (lambda: pt.Event("e", "A", then=pt.SetRates({})), "rates"),
        (lambda: pt.Event("e", "A", then=pt.SetRates({"A": math.nan})), "finite"),
        (lambda: pt.Event("e", "A", then=pt.SetRates({"A": 10**400})), "finite"),
        (lambda: m.simulate(1.0, locked=3), "locked"),
    ):
        with pytest.raises(ArgumentError, match=words):
            make()
    with pytest.raises(UnknownNameError, match="B"):
        m.simulate(1.0, events=[pt.Event("e", "A", then=pt.Lock("B"))])
    with pytest.raises(UnknownNameError, match="B"):
        m.simulate(1.0, locked=["B"])
    with pytest.raises(DescriptionError, match="a stop bounds"):
        m.simulate(1.0, events=[pt.Event("e", lambda t, state: t, direction=1, then=pt.Stop())])
    with pytest.raises(DescriptionError, match="a stop bounds"):
        m.simulate(1.0, events=[pt.Event("e", "A", reads="velocity", direction=1, then=pt.Stop())])


def test_rates_that_contradict_each_other_end_the_run_with_their_names() -> None:
    m = four_bar(GENERAL)
    kick = pt.Event("kick", lambda t, state: t - 0.2, then=pt.SetRates({"A": 3.0, "D": -100.0}))
    run = m.simulate(1.0, events=[kick])
    assert not run.success and run.t[-1] <= 0.2 and len(run.t) > 10
    assert "contradict" in run.message and ("rate of A" in run.message or "rate of D" in run.message)


@COORDINATES
@pytest.mark.parametrize("restitution", [0.0, 0.4])
def test_rates_set_into_a_closed_stop_bounce_off_it(coordinates: str, restitution: float) -> None:
    """A four-bar rests on a stop; its other pivot is given a rate that only the stop can stop."""
    m = four_bar(GENERAL)
    start = m.assemble(coordinates=coordinates)
    free = m.simulate(1.0, initial=start, coordinates=coordinates)
    angles = free.joint("A").angle
    side = 1 if angles[len(angles) // 4] > angles[0] else -1
    stop = pt.Event("s", "A", value=float(angles[0]) + side * 0.1, direction=side, then=pt.Stop(restitution))
    options = {"initial": start, "coordinates": coordinates, **TIGHT}
    rested = m.simulate(3.0, events=[stop], **options)
    assert rested.events[-1].kind in ("rest", "accumulation") and abs(rested.v[-1]).max() < 1e-9
    late = rested.events[-1].t + 0.5
    for rate in (1.5, -1.5):
        kick = pt.Event("k", lambda t, state: t - late, then=pt.SetRates({"D": rate}))
        run = m.simulate(late + 0.5, events=[stop, kick], **options)
        record = run.events["k"][0]
        assert run.success and run.certificate.verdict == "valid"
        from_stop = -side * record.after.velocity("A")
        away = record.after.velocity("D") / rate
        if away > 0.5:
            assert away == pytest.approx(1.0, rel=1e-9) and from_stop > 0.0
        else:
            assert away == pytest.approx(-restitution, abs=1e-9)
            assert bool(from_stop > 0.1) == (restitution > 0.0)
            assert bool(np.abs(run.v[run.t > late]).max() < 1e-9) == (restitution == 0.0)
        assert np.max(side * (run.joint("A").angle - stop.value)) < 1e-9


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_drive_that_moves_into_a_stop_ends_the_run_with_its_name(restitution: float) -> None:
    m = double_pendulum()
    m.add_drive("A", position=lambda t: 0.4 * np.sin(3.0 * t))
    for side, value in ((1, 0.2), (-1, -0.3)):
        stop = pt.Event("s", "A", value=value, direction=side, then=pt.Stop(restitution))
        run = m.simulate(2.0, events=[stop])
        assert not run.success and "stop s" in run.message and "in the way" in run.message
        assert run.joint("A").angle[-1] == pytest.approx(value, abs=0.05) and len(run.t) > 5


def test_all_motions_of_a_joint_in_space_are_held_or_one_of_them() -> None:
    m = pt.Mechanism("top", gravity=(0, 0, -9.81))
    top = m.add_body("top", mass=1.0, com=(0.1, 0.2, 0.5), inertia=(0.05, 0.06, 0.02))
    m.add_spherical("S", m.ground, top, point=(0, 0, 0))
    start = m.assemble(rates={"S": (0.3, -0.2, 5.0)})
    stop = pt.Event("stop", lambda t, state: t - 0.3, then=pt.Lock("S"))
    go = pt.Event("go", lambda t, state: t - 0.6, then=pt.Release("S"))
    run = m.simulate(1.0, initial=start, events=[stop, go], **TIGHT)
    assert run.success and [record.kind for record in run.events] == ["lock", "release"]
    held = (run.t > 0.3) & (run.t < 0.6)
    assert np.ptp(run.body("top").rotation[held], axis=0).max() < 1e-11 and np.abs(run.v[held]).max() < 1e-12
    assert run.certificate.verdict == "valid" and np.ptp(run.body("top").rotation[run.t > 0.7], axis=0).max() > 0.1
    one = m.simulate(
        0.5, initial=start, events=[pt.Event("s", lambda t, state: t - 0.2, then=pt.Lock("S", 2))], **TIGHT
    )
    after = one.v[one.t > 0.2]
    assert np.abs(after[:, 2]).max() < 1e-11 < np.abs(after[:, 0]).max() and one.certificate.verdict == "valid"


def test_a_lock_against_a_drive_ends_the_run_with_its_name() -> None:
    m = door()
    m.add_drive("A", velocity=1.0)
    run = m.simulate(1.0, events=[pt.Event("lock", lambda t, state: t - 0.5, then=pt.Lock("A"))])
    assert not run.success and run.t[-1] <= 0.5 and "lock of A" in run.message


def test_the_rate_of_a_distance_is_set() -> None:
    m = double_pendulum()
    to_tip = pt.Distance("ground", (0, 0, 0), "two", (0, -0.8, 0))
    length = m.add_sensor("length", to_tip, "velocity")
    kick = pt.Event("kick", lambda t, state: t - 0.2, then=pt.SetRates({to_tip: -1.0}))
    run = m.simulate(0.3, initial=m.assemble({"A": 0.4, "B": 0.9}), events=[kick], t_eval=[0.1, 0.2, 0.3], **TIGHT)
    assert run.success and run.sensor(length.name).values[1] == pytest.approx(-1.0, rel=1e-10)


def test_a_function_decides_what_an_event_does() -> None:
    """A door that is pushed on its first passage, held on its second, and passes then as it is released."""
    m = door()
    seen: list[float] = []

    def decide(t: float, state: Any) -> Any:
        seen.append(state.velocity("A"))
        return [pt.SetRates({"A": -1.0}), [pt.Lock("A")], None][len(seen) - 1]

    low = pt.Event("low", "A", value=0.0, then=decide)
    start = m.assemble({"A": -1.0})
    run = m.simulate(3.0, initial=start, events=[low], **TIGHT)
    assert run.success and run.certificate.verdict == "valid"
    assert [(event.kind, event.name) for event in run.events] == [("rates", "low"), ("lock", "low")]
    assert seen == [event.before.velocity("A") for event in run.events]
    plain = m.simulate(1.0, initial=start, events=[pt.Event("low", "A", value=0.0)], **TIGHT)
    assert run.events[0].t == plain.events[0].t
    push = m.simulate(2.0, initial=run.events[0].after, events=[pt.Event("low", "A", direction=1)], **TIGHT)
    assert run.events[1].t == pytest.approx(push.events[0].t, rel=1e-11)
    assert run.events[0].impulses["A"].moment[2] == pytest.approx((-1.0 - seen[0]) * 4.0 * 1.2**2 / 3.0, rel=1e-9)
    assert np.abs(run.v[-1]).max() < 1e-13


def test_decisions_that_cannot_be_end_a_run_with_the_name_of_the_event() -> None:
    m = door()
    cases: list[tuple[Any, str]] = [
        (lambda t, state: pt.Stop(0.1), "decides on a stop"),
        (lambda t, state: 3, "then is 3, returned by its function"),
        (lambda t, state: pt.Lock("Q"), 'no joint "Q"'),
        (lambda t, state: pt.SetRates({pt.Distance("ground", (0, 0, 0), "rod", (0, 1, 0)): 1.0}), "joints alone"),
        (lambda t, state: 1 // 0, "ZeroDivisionError"),
    ]
    for function, words in cases:
        run = m.simulate(2.0, initial=m.assemble({"A": -1.0}), events=[pt.Event("low", "A", then=function)])
        assert not run.success and run.status == "evaluation-failed" and 'event "low"' in run.message
        assert words in run.message and 0.4 < run.t[-1] < 0.5
    with pytest.raises(ArgumentError, match="or a function of"):
        pt.Event("low", "A", then=pt.Lock)


def press() -> pt.Mechanism:
    """A slider crank with a flywheel, without gravity, whose slider pushes against a sheet."""
    m = drawn_out(flywheel=0.35, gravity=0.0)
    m.add_force("slider", (0.0, 0.0, 0.0), (0, 0, 0), name="sheet")
    return m


@COORDINATES
@pytest.mark.parametrize("by_functions", [False, True])
def test_a_sheet_breaks_away_under_a_press(coordinates: str, by_functions: bool) -> None:
    """The sheet resists with 900 N over 15 mm and breaks: rates by energy, times by quadrature in 45 digits."""
    m = press()
    on: Any = pt.SetInput("sheet.x", 900.0)
    off: Any = pt.SetInput("sheet.x", 0.0)
    if by_functions:
        on, off = (lambda t, state: pt.SetInput("sheet.x", "0.9 kN")), (lambda t, state: [pt.SetInput("sheet.x", 0.0)])
    events = [
        pt.Event("touches", "S", value=0.20 - 0.33, direction=-1, once=True, then=on),
        pt.Event("breaks", "S", value=0.185 - 0.33, direction=-1, once=True, then=off),
        pt.Event("bottom", "O", value=math.pi),
        pt.Event("next turn", "O", value=1.5 + 2.0 * math.pi, terminal=True),
    ]
    start = m.assemble({"O": 1.5}, rates={"O": 12.0}, coordinates=coordinates)
    times = [0.0, 0.06, 0.0798205437, 0.1]
    run = m.simulate(1.0, initial=start, coordinates=coordinates, events=events, t_eval=times, **TIGHT)
    assert run.success and run.certificate.verdict == "valid", run.message
    assert [event.kind for event in run.events] == ["input", "input", "crossing", "crossing"]
    touches, breaks, bottom, again = run.events
    assert touches.t == pytest.approx(0.0497245859313159323555, rel=1e-10)
    assert touches.before.velocity("O") == pytest.approx(12.0580600737165491217575851445, rel=1e-10)
    assert breaks.t == pytest.approx(0.0798205437879685300482, rel=1e-10)
    assert breaks.before.position("O") == pytest.approx(2.40241123420968590248, rel=1e-10)
    assert breaks.before.velocity("O") == pytest.approx(8.37557022008187297327, rel=1e-10)
    assert bottom.t == pytest.approx(0.167920851816639143888, rel=1e-10)
    assert bottom.before.velocity("O") == pytest.approx(8.39755767440925871631, rel=1e-9)
    assert again.t == pytest.approx(0.723564554835704680008, rel=1e-10)
    assert (run.t[-1], len(run.t)) == (again.t, 5)
    assert run.force("sheet").force[:, 0] == pytest.approx([0.0, 900.0, 900.0, 0.0, 0.0])
    # just before the sheet breaks the wrist pin carries it
    assert abs(run.joint("W").force[2, 0]) == pytest.approx(893.493744572958433192, rel=1e-6)
    assert run.energy.work[-1] - run.energy.work[0] == pytest.approx(-13.5, rel=1e-9)
    assert run.energy.kinetic[-1] - run.energy.kinetic[0] == pytest.approx(-13.5, rel=1e-9)


def test_inputs_of_torques_and_brakes_are_set_and_stay_set() -> None:
    """A wheel that a motor drives from 1 s on and a brake stops from 2 s on: by hand."""
    m = pt.Mechanism("wheel", gravity=None)
    wheel = m.add_body("wheel", mass=1.0, inertia=(0.2, 0.2, 0.4))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_torque("motor", "A", 0.0)
    m.add_brake("brake", "A", 0.0)
    at = [pt.Event(f"at {i}", lambda t, state, i=i: t - i, then=then) for i, then in (
        (1.0, pt.SetInput("motor", 0.8)), (2.0, [pt.SetInput("motor", 0.2), pt.SetInput("brake", 1.2)]),
    )]  # fmt: skip
    for coordinates in ("relative", "absolute"):
        run = m.simulate(4.0, events=at, coordinates=coordinates, t_eval=np.linspace(0.0, 4.0, 17), **TIGHT)
        assert run.success and run.certificate.verdict == "valid", run.message
        # rate 2 rad/s at 2 s, then -1.0 N m: at rest 0.8 s later
        assert [event.kind for event in run.events] == ["input", "slip", "input", "stick"]
        assert run.events[-1].t == pytest.approx(2.8, rel=1e-11)
        assert run.joint("A").angle[-1] == pytest.approx(1.0 + 0.8, rel=1e-10)
        assert run.force("motor").effort == pytest.approx(np.where(run.t < 1.0, 0.0, np.where(run.t < 2.0, 0.8, 0.2)))
        assert run.force("brake").effort[-1] == pytest.approx(-0.2, rel=1e-11)
        balance = run.energy.total - run.energy.work
        assert np.ptp(balance) < 1e-11
    for name, words in (("moter", "motor"), ("drive", "no input")):
        with pytest.raises(UnknownNameError, match=words):
            m.simulate(1.0, events=[pt.Event("e", "A", value=1.0, then=pt.SetInput(name, 1.0))])
    with pytest.raises(DescriptionError, match="-1"):
        m.simulate(1.0, events=[pt.Event("e", "A", value=1.0, then=pt.SetInput("brake", -1.0))])
