"""Starts in change points and dead centres: along the branch that rates single out, else refused with the branches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from test_singular_drawings import LINKAGES, crank_slider, line, linkage

import partita as pt
from partita.errors import SingularityError

BOTH = ("relative", "absolute")
ALONG, ACROSS = {"A": 2.0, "D": 2.0}, {"A": 2.0, "D": -4.0}
"""The parallelogram goes on as one, or its rocker turns back."""


def stretched(unit: float = 1.0, gravity: tuple[float, float] = (0.0, 0.0), beside: float = 0.0) -> pt.Mechanism:
    """A parallelogram drawn in line, crank and rocker a tenth and coupler three tenths of the unit long."""
    m = pt.Mechanism("flat", gravity=(unit * gravity[0], unit * gravity[1], 0.0))
    lift = unit * 0.1 * np.array([math.cos(beside), math.sin(beside), 0.0])
    base = np.array([unit * 0.3, 0.0, 0.0])
    points = [np.zeros(3), lift, base + lift, base]
    rods = [m.add_rod(f"rod{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(3)]
    for name, parent, child, point in zip(
        "ABCD", [m.ground, *rods[:-1], m.ground], [*rods, rods[-1]], points, strict=True
    ):
        m.add_revolute(name, parent, child, point=point)
    return m


def started(m: pt.Mechanism, rates: dict[str, float], duration: float, coordinates: str, **options: Any) -> pt.Result:
    start = m.assemble(rates=rates, coordinates=coordinates)
    run = m.simulate(duration, initial=start, coordinates=coordinates, **options)
    assert run.success, run.message
    assert any("leaves it along the branch" in note for note in run.notes)
    return run


def pendulum(gravity: tuple[float, float], rate: float, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle and rate of the cranks while the coupler only shifts: three rods of mass 1, cranks of length 0.1."""
    inertia = 2.0 * 0.1**2 / 3.0 + 0.1**2

    def slope(_: float, y: NDArray[np.float64]) -> list[float]:
        moment = 2.0 * 0.1 * (gravity[1] * math.cos(y[0]) - gravity[0] * math.sin(y[0]))
        return [y[1], moment / inertia]

    found = solve_ivp(slope, (0.0, t[-1]), [0.0, rate], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t)
    return np.asarray(found.y)


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("gravity", [(0.0, 0.0), (0.0, -9.81), (9.81, 0.0), (-9.81, 0.0)])
def test_a_flat_parallelogram_goes_as_a_pendulum(coordinates: str, unit: float, gravity: tuple[float, float]) -> None:
    # before it comes back to the position where gravity acts across it
    t = np.linspace(0.0, 0.15, 31)
    angle, rate = pendulum(gravity, 2.0, t)
    for rtol in (1e-6, 1e-8, 1e-10):
        run = started(stretched(unit, gravity), ALONG, t[-1], coordinates, rtol=rtol, atol=1e-2 * rtol, t_eval=t)
        for joint in ("A", "D"):
            # 20 steps, of a motion that doubles its errors
            assert np.abs(run.joint(joint).position[:, 0] - angle).max() < 20 * rtol + 1e-11
            assert np.abs(run.joint(joint).velocity[:, 0] - rate).max() < 200 * rtol + 1e-10
        assert run.certificate.verdict == "valid"


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("rates", [ALONG, ACROSS])
def test_it_goes_on_as_a_run_that_passes_through(coordinates: str, rates: dict[str, float]) -> None:
    m = stretched(gravity=(3.0, -9.81))
    back = {name: -rate for name, rate in rates.items()}
    away = started(m, back, 0.1, coordinates, rtol=1e-11, atol=1e-13)
    # turned round it comes back to the position at 0.1 s and goes through
    end = pt.State(0.0, away.q[-1], -away.v[-1], names=m.assemble(coordinates=coordinates, rates=rates).names)
    t = np.linspace(0.1, 0.2, 11)
    through = m.simulate(0.2, initial=end, coordinates=coordinates, rtol=1e-11, atol=1e-13, t_eval=t[1:])
    begun = started(m, rates, 0.1, coordinates, rtol=1e-11, atol=1e-13, t_eval=t - 0.1)
    assert through.success
    for joint in ("A", "D"):
        # the way back and the passage: round-off over the square of the distance, then grown with the motion
        assert np.abs(through.joint(joint).position - begun.joint(joint).position[1:]).max() < 1e-8
        assert np.abs(through.joint(joint).velocity - begun.joint(joint).velocity[1:]).max() < 1e-7


def test_signs_mirror_each_other() -> None:
    for rates in (ALONG, ACROSS):
        m = stretched(gravity=(3.0, 0.0))
        one = started(m, rates, 0.2, "relative")
        two = started(m, {name: -rate for name, rate in rates.items()}, 0.2, "relative")
        for joint in ("A", "B", "D"):
            assert np.abs(one.joint(joint).position + two.joint(joint).position).max() < 1e-8


def test_the_other_branch_keeps_its_energy_and_its_lengths() -> None:
    for coordinates in BOTH:
        run = started(stretched(gravity=(0.0, -9.81)), ACROSS, 0.25, coordinates)
        assert run.energy.relative_balance < 1e-7 and run.certificate.verdict == "valid"
        # coupler from the end of the crank to that of the rocker
        a, d = run.joint("A").position[:, 0], run.joint("D").position[:, 0]
        ends = np.hypot(0.3 + 0.1 * (np.cos(d) - np.cos(a)), 0.1 * (np.sin(d) - np.sin(a)))
        assert np.abs(ends - 0.3).max() < 1e-12
        # at first the rocker turns back twice as fast as the crank goes
        assert abs(d[20] + 2.0 * a[20]) < 1e-2 * abs(d[20] - a[20])


def test_outputs_in_the_first_step() -> None:
    m, t = stretched(gravity=(0.0, -9.81)), np.array([0.0, 1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.04, 0.05])
    run = started(m, ALONG, 0.05, "relative", t_eval=t)
    angle, rate = pendulum((0.0, -9.81), 2.0, t)
    assert np.abs(run.joint("A").position[:, 0] - angle).max() < 1e-9
    assert np.abs(run.joint("A").velocity[:, 0] - rate).max() < 1e-8
    assert run.closure.max() < 1e-12
    # what the start itself leaves open is said, not made up
    assert np.isnan(run.vdot[0]).all() and np.isfinite(run.vdot[4:]).all()
    assert any("not determined" in note for note in run.notes)
    second = (rate[5] - rate[4]) / (t[5] - t[4])
    assert run.vdot[5, 0] == pytest.approx(second, rel=0.1)


def test_work_of_the_first_step_counts() -> None:
    m = stretched()
    m.add_torque("A", lambda t, state: 0.05 * math.cos(3.0 * t))
    for coordinates in BOTH:
        run = started(m, ALONG, 0.2, coordinates)
        assert run.energy.relative_balance < 1e-7
        assert run.energy.work[-1] == pytest.approx(run.energy.total[-1] - run.energy.total[0], rel=1e-6)


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ({}, "at rest the branch is undetermined"),
        ({"A": 2.0}, "the rates A = 2 belong to more than one branch; give the rate of one more joint"),
        ({"A": 2.0, "D": -1.0}, "the rates A = 2, D = -1 belong to no branch; on the nearest one A = 0.8, D = -1.6"),
    ],
)
def test_what_singles_out_no_branch_is_refused(coordinates: str, rates: dict[str, float], words: str) -> None:
    m = stretched()
    with pytest.raises(SingularityError, match="2 branches meet") as reported:
        m.simulate(0.1, initial=m.assemble(rates=rates, coordinates=coordinates), coordinates=coordinates)
    assert words in str(reported.value)


@pytest.mark.parametrize("coordinates", BOTH)
def test_rates_are_completed_on_their_branch(coordinates: str) -> None:
    for rates in (ALONG, ACROSS, {"B": -2.0, "D": 2.0}, {"A": 2.0001, "D": -4.0}):
        state = stretched().assemble(rates=rates, coordinates=coordinates)
        run = stretched().simulate(0.01, initial=state, coordinates=coordinates, t_eval=[0.0, 0.01])
        a, b, d = (run.joint(joint).velocity[0, 0] for joint in "ABD")
        assert (b, d) == pytest.approx((-a, a)) or (b, d) == pytest.approx((-2.0 * a, -2.0 * a))
        for name, rate in rates.items():
            assert run.joint(name).velocity[0, 0] == pytest.approx(rate, rel=2e-3)


@pytest.mark.parametrize("name", LINKAGES)
def test_each_branch_starts_with_the_rates_reported(name: str) -> None:
    for unit in (1.0, 1e3):
        m = linkage(*line(*LINKAGES[name]), unit=unit)
        for branch in m.report().to_dict()["singular"]["branches"]:
            for sign in (0.5, -0.5):
                rates = {joint: sign * rate for joint, rate in branch["rates"].items()}
                one, two = (started(m, rates, 0.3, coordinates) for coordinates in BOTH)
                assert one.certificate.verdict == two.certificate.verdict == "valid"
                for joint in ("A", "B", "Z"):
                    assert np.abs(one.joint(joint).position - two.joint(joint).position).max() < 1e-7
                    assert one.joint(joint).velocity[0, 0] == pytest.approx(rates.get(joint, 0.0), abs=1e-8)


def test_velocities_on_no_branch_do_not_start() -> None:
    m = stretched()
    state = m.assemble(rates=ALONG)
    off = pt.State(0.0, state.q, state.v * [1.0, 1.0, 1.001], names=state.names)
    with pytest.raises(SingularityError, match="belong to no branch; on the nearest one"):
        m.simulate(0.1, initial=off)


FORMULATIONS = [
    *("projective", "fixed", "wehage-haug", "explicit-closing", "zero-eigenvalue", "svd", "qr", "liang-lance"),
    *("gram-schmidt", "tangent-space", "multipliers", "sparse-multipliers", "range-space", "proximal"),
]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_every_formulation_starts(formulation: str) -> None:
    m, t = stretched(gravity=(0.0, -9.81)), np.linspace(0.0, 0.1, 11)
    angle, _ = pendulum((0.0, -9.81), 2.0, t)
    run = started(m, ALONG, t[-1], "relative", solver=pt.Solver(formulation), t_eval=t)
    assert np.abs(run.joint("A").position[:, 0] - angle).max() < 1e-6


@pytest.mark.parametrize("coordinates", BOTH)
@pytest.mark.parametrize("rates", [ALONG, ACROSS])
@pytest.mark.parametrize("beside", [1e-9, 1e-7])
def test_beside_the_position_it_takes_the_same_branch(coordinates: str, rates: dict[str, float], beside: float) -> None:
    exactly = started(stretched(gravity=(0.0, -9.81)), rates, 0.1, coordinates)
    for sign in (1.0, -1.0):
        run = started(stretched(gravity=(0.0, -9.81), beside=sign * beside), rates, 0.1, coordinates)
        for joint in ("A", "D"):
            # the drawing has its zero there: angles count from it, and rates change with accelerations of some hundred
            assert np.abs(run.joint(joint).position - exactly.joint(joint).position).max() < 10 * beside + 1e-8
            assert np.abs(run.joint(joint).velocity - exactly.joint(joint).velocity).max() < 100 * beside + 1e-7


@pytest.mark.parametrize("coordinates", BOTH)
def test_other_degrees_of_freedom_beside_it(coordinates: str) -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    bob = m.add_rod("bob", start=(0, 5, 0), end=(1, 5, 0), mass=1.0)
    m.add_revolute("P", m.ground, bob, point=(0, 5, 0))
    alone = linkage(*line(*LINKAGES["parallelogram"]))
    for rates in ({"A": 1.0, "Z": 1.0}, {"A": 1.0, "Z": -2.0}):
        of = started(alone, rates, 0.3, coordinates)
        for more in ({}, {"P": 2.0}):
            run = started(m, rates | more, 0.3, coordinates)
            assert np.abs(run.joint("Z").position - of.joint("Z").position).max() < 1e-7
            assert run.joint("P").velocity[0, 0] == pytest.approx(more.get("P", 0.0), abs=1e-12)
    with pytest.raises(SingularityError, match="more than one branch"):
        m.assemble(rates={"P": 2.0}, coordinates=coordinates)


def five_bar() -> pt.Mechanism:
    m = pt.Mechanism("five-bar")
    points = [(x, 0.0, 0.0) for x in (0.0, 1.0, 3.2, 4.1, 2.0)]
    rods = [m.add_rod(f"rod{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(4)]
    for name, parent, child, point in zip("ABCD", [m.ground, *rods[:-1]], rods, points, strict=False):
        m.add_revolute(name, parent, child, point=point)
    m.add_revolute("Z", m.ground, rods[-1], point=points[-1])
    return m


def test_a_cone_of_branches() -> None:
    """A five-bar in line: the ways out are no planes but a cone, and its curvature is infinite in the position."""
    m = five_bar()
    found = m.report().to_dict()["singular"]
    assert found["many"]
    for branch in found["branches"][:2]:
        for sign in (1.0, -1.0):
            rates = {name: sign * rate for name, rate in branch["rates"].items()}
            one, two = (started(m, rates, 0.3, coordinates) for coordinates in BOTH)
            for joint in ("A", "C", "Z"):
                assert np.abs(one.joint(joint).position - two.joint(joint).position).max() < 1e-6
            assert max(one.energy.relative_balance, two.energy.relative_balance) < 1e-6
    # two rates leave two ways, three that are on none say so
    with pytest.raises(SingularityError, match="belong to more than one branch"):
        m.assemble(rates={"A": 1.0, "B": 0.3})
    with pytest.raises(SingularityError, match="belong to no branch"):
        m.assemble(rates={"A": 1.0, "B": 0.3, "D": 5.0})


def test_where_more_is_lost_at_once_it_is_said() -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    points = [(9.0 + x, y, 0.0) for x, y, _ in line(0.0, 1.0, 3.0, 2.0)]
    rods = [m.add_rod(f"more{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(3)]
    for name, parent, child, point in zip(
        "EFGH", [m.ground, *rods[:-1], m.ground], [*rods, rods[-1]], points, strict=True
    ):
        m.add_revolute(name, parent, child, point=point)
    with pytest.raises(SingularityError, match="the rank drops by 2 here"):
        m.assemble(rates={"A": 2.0, "Z": 2.0, "E": 1.0, "H": 1.0})


def stroke(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of a crank of length 1 whose rod of length 3 has its end at x."""
    return np.arccos(np.clip((x * x - 8.0) / (2.0 * x), -1.0, 1.0))


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_slider_driven_out_of_dead_centre_starts(coordinates: str) -> None:
    m = crank_slider(position=lambda t: -0.2 * t * t)
    # x = 4 - (1 + 1/3) A^2 / 2 to second order: A' = sqrt(0.6 * 0.5)
    exact = math.sqrt(0.3)
    for asked in (0.3, 0.5, exact, 1.0):
        for sign in (1.0, -1.0):
            run = started(m, {"A": sign * asked}, 1.0, coordinates)
            assert run.joint("A").velocity[0, 0] == pytest.approx(sign * exact, rel=1e-6)
            assert np.abs(run.joint("A").position[:, 0] - sign * stroke(4.0 - 0.2 * run.t**2)).max() < 1e-7
            assert run.energy.relative_balance < 1e-7
    for rates in ({}, {"A": 0.2}, {"A": -1.2}):
        with pytest.raises(SingularityError, match=r"0\.5477"):
            m.simulate(0.1, initial=m.assemble(rates=rates, coordinates=coordinates), coordinates=coordinates)


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (lambda t: -0.2 * t, "the drive of S prescribes -0.2 m/s"),
        (lambda t: 0.2 * t * t, "an acceleration outwards"),
        (lambda t: -0.2 * t**3, "depends on higher orders"),
    ],
)
def test_what_no_joint_can_follow_is_said(course: Callable[[float], float], words: str) -> None:
    with pytest.raises(SingularityError, match="a dead centre") as reported:
        crank_slider(position=course).assemble(rates={"A": 0.5})
    assert words in str(reported.value)


@pytest.mark.parametrize("coordinates", BOTH)
def test_a_crank_driven_in_a_change_point(coordinates: str) -> None:
    m = linkage(*line(*LINKAGES["parallelogram"]))
    m.add_drive("A", position=lambda t: 0.3 * t)
    for rocker in (0.3, -0.6):
        run = started(m, {"Z": rocker}, 1.0, coordinates)
        assert np.abs(run.joint("A").position[:, 0] - 0.3 * run.t).max() < 1e-10
        assert run.joint("Z").velocity[0, 0] == pytest.approx(rocker)
        if rocker == 0.3:
            assert np.abs(run.joint("Z").position[:, 0] - 0.3 * run.t).max() < 1e-9
    with pytest.raises(SingularityError, match="2 branches meet"):
        m.simulate(0.1, coordinates=coordinates)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_rate_that_cannot_be_at_a_dead_point_is_refused(coordinates: str) -> None:
    rng = np.random.default_rng(21)
    for _ in range(6):
        crank, coupler, rocker = rng.uniform(0.2, 0.4), rng.uniform(0.6, 0.9), rng.uniform(0.5, 0.8)
        far = coupler + rocker
        base = rng.uniform(far - 0.8 * crank, far + 0.8 * crank)
        # the crank pin is as far from the hinge of the rocker as both links are long
        angle = math.acos((crank**2 + base**2 - far**2) / (2 * crank * base))
        b, d = np.array([crank * math.cos(angle), crank * math.sin(angle), 0]), np.array([base, 0.0, 0.0])
        c = b + (d - b) * coupler / far
        m = pt.Mechanism("in line", gravity=(0, 0, 0))
        one = m.add_rod("crank", start=(0, 0, 0), end=b, mass=1.0)
        two = m.add_rod("coupler", start=b, end=c, mass=2.0)
        three = m.add_rod("rocker", start=d, end=c, mass=1.5)
        joints = [("A", m.ground, one, (0, 0, 0)), ("B", one, two, b), ("C", two, three, c), ("D", m.ground, three, d)]
        for i in rng.permutation(4):
            name, first, second, point = joints[i]
            m.add_revolute(name, first, second, point=point)
        with pytest.raises(pt.errors.ArgumentError, match="A = 2"):
            m.assemble(rates={"A": 2.0}, coordinates=coordinates)
        state = m.assemble(rates={"D": 2.0}, coordinates=coordinates)
        assert np.abs(state.v).max() < 10 * 2.0 * far / coupler
