"""The multistep method beside one-step methods: what it saves, and what a switch of coordinates costs it."""

from __future__ import annotations

import numpy as np
import pytest

import partita as pt
from partita.results import Result

RTOL, ATOL = 1e-8, 1e-10


def run(name: str, method: str, switch_threshold: float = 1.25, outputs: int | None = None, **more: str) -> Result:
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    start = entry.initial(m)
    times = list(entry.times) if outputs is None else list(np.linspace(start.t, entry.times[-1], outputs))
    found = m.simulate(
        entry.times[-1] - start.t,
        t_eval=times,
        initial=start,
        rtol=RTOL,
        atol=ATOL,
        method=method,
        switch_threshold=switch_threshold,
        **more,
    )
    assert found.success, found.message
    return found


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "andrews-squeezer", "bricard"])
def test_takes_about_half_of_the_evaluations_of_dop853(name: str) -> None:
    check = pt.catalogue.entry(name).checks[0]
    adams, other = run(name, "adams"), run(name, "dop853")
    assert adams.counters["evaluations"] < 0.65 * other.counters["evaluations"]
    assert check.run(adams).error < 100 * check.run(other).error


def test_a_switch_of_coordinates_is_free_for_one_step_methods_alone() -> None:
    """Blajer, Schiehlen, Schirm 1994, section 3: changing coordinates, one-step and multistep methods."""
    extra = {}
    for method in ("dopri5", "dop853", "adams"):
        without, with_them = run("four-bar", method, 1e9), run("four-bar", method, 1.0)
        assert without.counters["switches"] == 0 and with_them.counters["switches"] == 8
        more = with_them.counters["evaluations"] - without.counters["evaluations"]
        extra[method] = more / with_them.counters["switches"]
    assert extra["dopri5"] <= 0 and extra["dop853"] <= 0
    assert extra["adams"] > 10


def test_a_basis_renewed_each_step_leaves_nothing_to_remember() -> None:
    """Every step begins anew, at order two: far more steps, and still right."""
    kept = run("slider-crank", "adams", solver=pt.Solver("svd"))
    entry = pt.catalogue.entry("slider-crank")
    m = entry.mechanism()
    again = m.simulate(
        0.02, t_eval=[0.02], initial=entry.initial(m), rtol=1e-6, atol=1e-8, method="adams",
        solver=pt.Solver("svd", renew="each step"),
    )  # fmt: skip
    assert again.success
    per_second = kept.counters["steps"] / (kept.t[-1] - entry.initial(m).t)
    assert again.counters["steps"] / 0.02 > 5 * per_second


def test_outputs_change_no_step_and_lie_on_the_constraints() -> None:
    few, many = run("four-bar", "adams", outputs=2), run("four-bar", "adams", outputs=201)
    assert few.counters["steps"] == many.counters["steps"]
    assert few.counters["evaluations"] == many.counters["evaluations"]
    assert np.abs(many.closure).max() < 1e-13
    steady = [run("slider-crank", method, outputs=201) for method in ("adams", "dop853")]
    assert np.abs(steady[0].q - steady[1].q).max() < 1e-6


def test_a_drive_does_not_make_it_begin_anew() -> None:
    """Positions of drives are rewritten after each step; the slopes of earlier steps remain those of the motion."""
    m = pt.catalogue.load("slider-crank")
    m.add_drive("O", velocity=60.0 * pt.units.rpm)
    adams, other = (m.simulate(0.5, rtol=1e-10, method=method, max_steps=5000) for method in ("adams", "dop853"))
    assert adams.success and adams.counters["evaluations"] < other.counters["evaluations"]
    assert np.abs(adams.q - other.q).max() < 1e-8


@pytest.mark.parametrize("t0", [0.0, 0.4])
@pytest.mark.parametrize(("power", "factor"), [(1, 6.0), (2, 12.0), (3, 20.0), (4, 30.0), (6, 56.0)])
def test_the_work_of_a_force_that_grows_from_nothing(power: int, factor: float, t0: float) -> None:
    """A slide at rest under c t^p: x = t^(p+2). The order rises until this polynomial is exact, and the power is of a
    higher degree."""
    m = pt.Mechanism("slide", gravity=None)
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("A", m.ground, "b", point=(0, 0, 0), axis=(1, 0, 0))
    m.add_torque("A", lambda t, s: factor * (t - t0) ** power)
    s = m.assemble(t=t0)
    for method, outputs in (("adams", [t0, t0 + 1.0]), ("adams", np.linspace(t0, t0 + 1.0, 9)), ("dop853", [t0 + 1.0])):
        run = m.simulate(1.0, initial=s, t_eval=outputs, method=method, rtol=1e-8)
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings
        assert run.joint("A").displacement[-1] == pytest.approx(1.0, abs=1e-7)
        assert run.counters["steps"] < 400
