"""Accuracy of whole runs: what a user may expect at a given tolerance."""

from typing import Any

import numpy as np
import pytest
from catalogue_runs import entry_of, extent, run_of

from partita.catalogue import andrews, bricard, four_bar, n_four_bar, planar_pendulum, spatial_four_bar

TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}


def test_four_bar_and_its_closure() -> None:
    # Each loop is closed by Newton steps to the round-off of lengths of 1 m, with room for conditions up to 1e3.
    assert float(run_of("four-bar", **TIGHT).closure.max()) <= 1e-12


def test_four_bar_and_its_energy() -> None:
    # 1e-10 per step, no systematic loss; the kinetic energy is the scale.
    energy = run_of("four-bar", **TIGHT).energy
    drift = float(np.max(np.abs(energy.total - energy.total[0])))
    assert drift <= 1e-8 * float(energy.kinetic.max())


def test_four_bar_and_a_run_at_round_off() -> None:
    # Local errors of 1e-10 grow by 1e4 where the crank nearly stops at the top.
    loose, tight = run_of("four-bar", **TIGHT), run_of("four-bar", rtol=1e-13, atol=1e-14)
    gap = loose.joint("A").position - tight.joint("A").position
    assert float(np.max(np.abs(gap))) <= 1e-5
    assert four_bar.crank(tight) <= 1e-7  # the reference against the energy integral: 1e-13 times 1e4, with room


@pytest.mark.parametrize("loops", [2, 40])
def test_chain_of_four_bars_through_singular_positions(loops: int) -> None:
    # The motion through the line of all links is smooth, so errors are those of one equation of motion: 1e-10 per step,
    # growing by 1e4 in the turns of 10 s.
    result = run_of("n-four-bar", loops, **TIGHT)
    assert n_four_bar.top(result, loops) <= 1e-5
    assert float(result.closure.max()) <= 1e-12 * max(1.0, extent(result) / 10.0)


def test_andrews_angle_and_reactions() -> None:
    # beta is 15.8 rad after five turns: 3e-9 is relative 2e-10. Accelerations of 5e4 rad/s^2 amplify the error in time.
    result = run_of("andrews-squeezer", rtol=1e-11, atol=1e-12)
    assert andrews.beta_error(result) <= 3e-9
    assert andrews.lambda_error(result) <= 1e-6


@pytest.mark.parametrize("name", ["car-axis", "slider-crank"])
def test_published_answers_to_nine_digits(name: str) -> None:
    # The entries ask for 1e-12 and 1e-11: a global error of 1e-9 leaves two to three digits for what thousands of steps
    # (car axis: twenty periods of stiff springs) and the continuous extension between them add up to.
    first = entry_of(name).checks[0].run(run_of(name))
    assert first.error <= 1e-9


def test_bricard_and_its_path() -> None:
    # The reference is good to 1e-8.
    assert bricard.path(run_of("bricard")) <= 1e-7


def test_pendulum_after_forty_periods() -> None:
    # The period's error of 1e-12 adds up over 42 periods and enters with the speed of 4 m/s; some margin.
    entry = entry_of("planar-pendulum")
    m = entry.mechanism()
    times = [*planar_pendulum.PATH]
    result = m.simulate(100.0, initial=entry.initial(m), t_eval=times, rtol=1e-12, atol=1e-13)
    assert planar_pendulum.path(result) <= 1e-8


def test_spatial_four_bar_and_its_rank() -> None:
    summary = run_of("spatial-four-bar").summary
    assert (summary["joint_rows"], summary["joint_rank"], summary["mobility"]) == (20, 17, 1)
    assert len(summary["removed"]) == 3


def test_spatial_four_bar_and_its_determined_reactions() -> None:
    """In axes along and across the plane: 8 forces in the plane are unique; the 12 other components are not."""
    result = run_of("spatial-four-bar")
    flags = np.array([result.joint(name).in_frame(spatial_four_bar.plane()).determined for name in "ABCD"])
    assert flags[:, :2].all() and flags[:, :2].sum() == 8  # forces in the plane
    assert not flags[:, 2].any()  # forces along the axes
    assert not flags[:, 3:5].any()  # moments across the axes


def test_spatial_and_planar_four_bar_have_equal_reactions_in_the_plane() -> None:
    """The same linkage drawn flat, under that part of gravity that lies in the plane."""
    import partita as pt

    tilt, lengths = spatial_four_bar.plane(), spatial_four_bar.LENGTHS
    gx, gy, _ = tilt.T @ np.array([0.0, -9.81, 0.0])
    m = pt.Mechanism("flat", gravity=(gx, gy, 0.0))
    a, b, c, d = lengths.points(spatial_four_bar.CRANK_ANGLE)
    crank = m.add_rod("crank", start=a, end=b, mass=1.0)
    coupler = m.add_rod("coupler", start=b, end=c, mass=3.0)
    rocker = m.add_rod("rocker", start=d, end=c, mass=2.5)
    ends = (("A", m.ground, crank, a), ("B", crank, coupler, b), ("C", coupler, rocker, c), ("D", m.ground, rocker, d))
    for name, parent, child, point in ends:
        m.add_revolute(name, parent, child, point=point)
    spatial = run_of("spatial-four-bar")
    rows = spatial.t <= 1.0
    planar_run = m.simulate(1.0, t_eval=spatial.t[rows], **TIGHT)
    for name, *_ in ends:
        force = spatial.joint(name).force[rows] @ tilt
        # Two integrations at 1e-10 and 1e-11; forces of 50 N follow positions with slopes up to 1e2.
        np.testing.assert_allclose(force[:, :2], planar_run.joint(name).force[:, :2], rtol=0.0, atol=1e-6)
