"""Conditions that depend on each other: those that agree run, those that do not are named, and never "success"."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from trust.contradictions import user_defined

import partita as pt
from partita.errors import ContradictionError, PartitaError, SuspectResultWarning

A, B, C, D = (0.0, 0.0, 0.0), (0.5, 1.0, 0.0), (2.5, 1.6, 0.0), (2.2, 0.0, 0.0)
OPEN = 1e-6
"""Of its size: what the core calls open."""


def four_bar() -> pt.Mechanism:
    m = pt.Mechanism("four-bar", gravity=(0, -9.81, 0))
    crank = m.add_rod("crank", start=A, end=B, mass=0.3)
    coupler = m.add_rod("coupler", start=B, end=C, mass=0.5)
    rocker = m.add_rod("rocker", start=D, end=C, mass=0.4)
    m.add_revolute("A", m.ground, crank, point=A)
    m.add_revolute("B", crank, coupler, point=B)
    m.add_revolute("C", coupler, rocker, point=C)
    m.add_revolute("D", m.ground, rocker, point=D)
    return m


def truss() -> pt.Mechanism:
    m = pt.Mechanism("truss")
    one = m.add_rod("one", start=(0, 0, 0), end=(1, 1, 0), mass=1.0)
    other = m.add_rod("other", start=(2, 0, 0), end=(1, 1, 0), mass=1.0)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, other, point=(1, 1, 0))
    m.add_revolute("C", m.ground, other, point=(2, 0, 0))
    return m


def five_bar() -> pt.Mechanism:
    m = pt.Mechanism("five-bar")
    points = [(0.0, 0.0, 0.0), (-0.3, 1.0, 0.0), (1.0, 1.8, 0.0), (2.2, 1.0, 0.0), (2.0, 0.0, 0.0)]
    rods = [m.add_rod(f"rod{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(4)]
    m.add_revolute("A", m.ground, rods[0], point=points[0])
    for i, name in enumerate("BCD"):
        m.add_revolute(name, rods[i], rods[i + 1], point=points[i + 1])
    m.add_revolute("E", m.ground, rods[3], point=points[4])
    return m


def rockers(off: float, drawing_tolerance: float = 0.0) -> pt.Mechanism:
    """A platform on three parallel rockers, the third too long by `off`: closed as drawn, and to first order."""
    m = pt.Mechanism("rockers", gravity=(0, -9.81, 0), drawing_tolerance=drawing_tolerance)
    platform = m.add_rod("platform", start=(0, 0, 0), end=(4, 0, 0), mass=1.0)
    for i, x in enumerate((0.0, 2.0, 4.0)):
        length = 1.0 + off * (i == 2)
        foot = (x - 0.6 * length, -0.8 * length, 0.0)
        rod = m.add_rod(f"rod{i}", start=foot, end=(x, 0, 0), mass=0.5)
        m.add_revolute(f"foot{i}", m.ground, rod, point=foot)
        m.add_revolute(f"top{i}", rod, platform, point=(x, 0, 0))
    return m


def two_drives() -> pt.Mechanism:
    m = four_bar()
    m.add_drive("A", position=lambda t: 2.0 * t)
    m.add_drive("D", position=lambda t: 2.0 * t)
    return m


def driven_truss() -> pt.Mechanism:
    m = truss()
    m.add_drive("A", position=lambda t: 2.0 * t)
    return m


def welded_crank() -> pt.Mechanism:
    m = four_bar()
    m.add_fixed("weld", m.ground, "crank", point=A)
    m.add_drive("A", position=lambda t: 2.0 * t)
    return m


def three_drives() -> pt.Mechanism:
    m = five_bar()
    for joint, rate in (("A", 1.0), ("E", -1.0), ("B", 0.5)):
        m.add_drive(joint, position=lambda t, rate=rate: rate * t)
    return m


@pytest.mark.parametrize(
    ("make", "who", "whom"),
    [
        (two_drives, "the drive of D", ["the drive of A", 'joint "C"']),
        (driven_truss, "the drive of A", ["joint"]),
        (welded_crank, "the drive of A", ['joint "weld"']),
        (three_drives, "the drive of B", ["the drive of A", "the drive of E"]),
    ],
)
def test_drives_that_nothing_can_follow_are_refused(
    make: Callable[[], pt.Mechanism], who: str, whom: list[str]
) -> None:
    with pytest.raises(ContradictionError) as caught:
        make().simulate(1.0)
    error = caught.value
    assert error.who == who and all(words in error.whom for words in whom), str(error)
    assert error.t == 0.0 and error.gap > 0.1
    assert f"{who} contradicts" in str(error) and "remove one drive" in str(error)


def test_drives_that_part_later_end_the_run() -> None:
    """Rates and second rates agree at the start: what was computed until they part is kept."""
    m = four_bar()
    m.add_drive("A", position=lambda t: 0.1 * t**4)
    m.add_drive("D", position=lambda t: 0.1 * t**4)
    run = m.simulate(1.0)
    assert not run.success and run.status == "contradiction" and run.certificate.verdict == "invalid"
    assert "the drive of D contradicts the drive of A" in run.message
    assert len(run.t) >= 1 and np.max(run.closure) <= OPEN * 3.0  # the largest length of the loop


def followed(off: float) -> pt.Mechanism:
    """D prescribed by the table of what A's drive makes of it, `off` t^2 beside it."""
    m = four_bar()
    m.add_drive("A", position=lambda t: 2.0 * t)
    t = np.linspace(0.0, 1.2, 400)
    angle = m.simulate(1.2, t_eval=t, rtol=1e-13, atol=1e-13).joint("D").position[:, 0]
    m.add_drive("D", position=(t, angle + off * t**2), interpolation="spline")
    return m


def test_a_drive_that_follows_the_other_runs() -> None:
    # a cubic spline through 400 exact points of 1.2 s errs by (3e-3 s)^4 of the fourth derivative
    run = followed(0.0).simulate(1.0)
    assert run.success and run.certificate.verdict == "valid"
    assert np.max(run.closure) <= 1e-9


def test_a_drive_that_follows_badly_is_suspect_then_refused() -> None:
    with pytest.warns(SuspectResultWarning, match="drive of D"):
        run = followed(1e-8).simulate(1.0)
    assert run.success and run.certificate.verdict == "suspect"
    run = followed(1e-5).simulate(1.0)
    # 1e-5 t^2 is 1e-6 after 0.32 s; the step that saw it ends later
    assert not run.success and run.status == "contradiction" and run.t[-1] <= 0.33


def nothing(t: float) -> float:
    return 0.0


def test_redundant_rows_of_a_user_system() -> None:
    run = pt.simulate(user_defined(nothing, nothing, nothing), 1.0, [0.0, 0.0], [0.0, 0.0])
    assert run.success and run.certificate.verdict == "valid"
    with pytest.raises(ContradictionError, match="constraint 1 contradicts constraint 0") as caught:
        pt.simulate(user_defined(lambda t: 0.1, nothing, nothing), 1.0, [0.0, 0.0], [0.0, 0.0])
    assert caught.value.gap == pytest.approx(0.1)
    moving = user_defined(lambda t: 0.1 * t, lambda t: 0.1, nothing)
    with pytest.raises(ContradictionError, match="constraint 1 contradicts constraint 0"):
        pt.simulate(moving, 1.0, [0.0, 0.0], [0.0, 0.0])


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_redundant_rows_that_agree_run(coordinates: str) -> None:
    for name in ("four-bar", "bricard", "n-four-bar"):
        entry = pt.catalogue.entry(name)
        run = entry.mechanism().simulate(0.3, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", name
    run = rockers(0.0).simulate(0.4, coordinates=coordinates)
    assert run.success and run.certificate.verdict == "valid"


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("off", [1e-3, 1e-6, 1e-9])
def test_a_rocker_of_slightly_wrong_length(off: float, coordinates: str) -> None:
    """Turned by x the third rocker stands off by `off` x^2 / 2: within 1e-9 it counts as closed, else it is reported.

    Every digit of the drawing is meant here; within a drawing tolerance: `test_drawing_tolerance`.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SuspectResultWarning)
            run = rockers(off).simulate(0.4, coordinates=coordinates)
    except PartitaError as error:
        assert off == 1e-3 and "dependent here but not next to it" in str(error)
        return
    verdict = run.certificate.verdict
    if run.success:
        assert off <= 1e-6 and verdict in ("valid", "suspect") and np.max(run.closure) <= 1.1 * off
        assert off < 1e-6 or verdict == "suspect"
    else:
        assert run.status == "contradiction" and verdict == "invalid" and 'contradicts joint "' in run.message


def random_loop(rng: np.random.Generator) -> tuple[pt.Mechanism, list[str]]:
    """A chain of rods closed between ground points in the plane or turned out of it, and its joints."""
    rods = int(rng.integers(3, 6))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    scale = 10.0 ** rng.uniform(-3, 3)
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, rods + 1))
    while np.min(np.diff(np.append(angles, angles[0] + 2.0 * math.pi))) < 0.3:
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, rods + 1))
    in_plane = np.stack([np.cos(angles), np.sin(angles), np.zeros(rods + 1)], axis=1) * rng.uniform(
        0.7, 1.3, (rods + 1, 1)
    )
    points = scale * in_plane @ turn.T
    m = pt.Mechanism("loop", gravity=tuple(9.81 * scale * turn[:, 1]))
    bodies = [m.add_rod(f"rod{i}", start=points[i], end=points[i + 1], mass=1.0) for i in range(rods)]
    names = [f"J{i}" for i in range(rods + 1)]
    ends = [m.ground, *bodies, m.ground]
    for i, name in enumerate(names):
        first, second = (ends[i], ends[i + 1]) if i < rods else (ends[-1], ends[-2])
        m.add_revolute(name, first, second, point=points[i], axis=turn[:, 2])
    return m, names


@pytest.mark.parametrize("seed", range(150))
def test_random_contradictions(seed: int) -> None:
    """One drive more than the loop has degrees of freedom, or a weld and a drive of what it holds: refused, and rightly
    named."""
    rng = np.random.default_rng(seed)
    m, joints = random_loop(rng)
    dof = len(joints) - 3
    # the last joint closes the loop in the drawing's tree; drives stand on others
    driven = [str(name) for name in rng.permutation(joints[:-1])[: dof + 1]]
    if rng.uniform() < 0.3:
        weld = driven[0]
        index = joints.index(weld)
        ground = index == 0
        if ground:
            m.add_fixed("weld", m.ground, "rod0", point=tuple(m.to_spec()["joints"][0]["point"]))
        else:
            point = tuple(m.to_spec()["joints"][index]["point"])
            m.add_fixed("weld", f"rod{index - 1}", f"rod{index}", point=point)
        driven = driven[:1]
    for name in driven:
        shape = rng.integers(3)
        rate = float(rng.uniform(0.5, 2.0) * rng.choice([-1.0, 1.0]))
        motions: list[Callable[..., object]] = [
            lambda t, w=rate: w * t,
            lambda t, w=rate: w * t**2,
            lambda t, w=rate: np.sin(w * t),
        ]
        m.add_drive(name, position=motions[shape])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SuspectResultWarning)
            run = m.simulate(1.0)
    except ContradictionError as error:
        message = str(error)
    else:
        assert not run.success and run.status == "contradiction", (run.status, run.message, np.max(run.closure))
        message = run.message
    assert any(f"the drive of {name} contradicts" in message for name in driven), message
