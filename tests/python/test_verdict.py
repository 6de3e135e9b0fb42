"""The verdict on a run: what is right is valid, what is not is suspect or invalid, and this is reported everywhere."""

from __future__ import annotations

import copy
import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from catalogue_runs import WITHOUT_EVENTS
from thorough import either
from verdicts import judged

import partita as pt
from partita import results
from partita.cli import main
from partita.errors import PartitaError, SuspectResultWarning
from partita.results import Result
from partita.results.energy import EnergyResult
from partita.results.verdict import Finding, of_arrays, of_energy, of_reactions, verdict_of

CLOSED = ["projective", "wehage-haug", "explicit-closing", "zero-eigenvalue", "svd", "qr", "gram-schmidt"]
PROBLEMS = [name for name in WITHOUT_EVENTS if pt.catalogue.entry(name).truth is None]
TOLERANCES = (1e-4, 1e-8, 1e-12)
STORED = [(ending, invalid) for ending in ("json", "nc") for invalid in (True, False)]
CLOSED += ["tangent-space", "multipliers", "range-space", "proximal"]


@pytest.mark.filterwarnings("ignore::partita.errors.SuspectResultWarning")
def test_mechanisms_by_chance_are_judged_rightly() -> None:
    """`make trust` judges a thousand of these, at tolerances from 1e-4 to 1e-12."""
    found = [judged(seed) for seed in range(either(40, 60))]
    assert sum(x.outcome == "right" for x in found) > len(found) // 2
    assert [x.words for x in found if x.outcome in ("wrong", "doubted", "stopped")] == []


@pytest.mark.parametrize("formulation", CLOSED)
@pytest.mark.parametrize("name", PROBLEMS)
def test_what_is_right_is_valid(name: str, formulation: str) -> None:
    """Short runs of the catalogue at loose, usual and tight tolerances; a warning would be an error here."""
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    start = entry.initial(m)
    span, own = min(entry.duration, 0.5), PROBLEMS.index(name) + CLOSED.index(formulation)
    for rtol in either((TOLERANCES[own % 3],), TOLERANCES):
        run = m.simulate(
            span,
            initial=start,
            rtol=rtol,
            atol=1e-2 * rtol,
            solver=pt.Solver(formulation),
            t_eval=np.linspace(0, span, 21),
        )
        assert run.success and run.certificate.verdict == "valid", (rtol, run.message, run.certificate.findings)
        assert max(run.record.gaps) <= 1e-9


@pytest.mark.parametrize("formulation", ["projective", "multipliers"])
def test_drift_that_was_asked_for_is_valid(formulation: str) -> None:
    for rtol in (1e-4, 1e-8):
        run = pt.catalogue.entry("four-bar").simulate(rtol=rtol, solver=pt.Solver(formulation), correction="none")
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings


def four_bar_run() -> Result:
    return pt.catalogue.entry("four-bar").simulate(t_eval=np.linspace(0.0, 0.5, 6))


def spoilt(run: Result, invalid: bool) -> Result:
    """A run as the core returns it where it is found invalid or suspect at its end."""
    finding = Finding(invalid, 0.25, "the closing of C stands open by 0.1 m")
    record = replace(run.record, findings=[finding])
    if invalid:
        words = f"{record.message}, but the result is invalid: {finding.sentence}"
        record = replace(record, success=False, status="invalid", message=words)
    return Result(record, run._source)


def test_an_invalid_run_is_no_success() -> None:
    run = spoilt(four_bar_run(), True)
    assert not run.success and run.status == "invalid"
    assert run.message == "reached t = 10, but the result is invalid: the closing of C stands open by 0.1 m"
    assert run.certificate.verdict == "invalid"
    assert "verdict           invalid" in str(run.certificate)
    assert "invalid: the closing of C" in str(run.certificate) and "INVALID" in repr(run)


def test_a_suspect_run_warns_once() -> None:
    run = spoilt(four_bar_run(), False)
    with pytest.warns(SuspectResultWarning, match=r"the closing of C") as reported:
        assert run.certificate.verdict == "suspect"
        assert run.success and run.status == "finished"
        str(run.certificate)
    assert len(reported) == 1


@pytest.mark.parametrize(("ending", "invalid"), either([("json", True), ("nc", False)], STORED))
def test_stored_results_keep_the_verdict(tmp_path: Path, ending: str, invalid: bool) -> None:
    run = spoilt(four_bar_run(), invalid)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)
        run.save(tmp_path / f"run.{ending}")
        back = results.load_result(tmp_path / f"run.{ending}")
        assert back.success is run.success and back.status == run.status and back.message == run.message
        assert back.certificate.findings == run.certificate.findings
        assert back.record.findings == run.record.findings  # what is saved again


def test_the_command_line_fails_where_the_run_is_invalid(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = pt.Mechanism.simulate
    for invalid, code, words in ((True, 1, "but the result is invalid"), (False, 0, "the result is suspect")):
        monkeypatch.setattr(pt.Mechanism, "simulate", lambda *a, b=invalid, **o: spoilt(whole(*a, **o), b))
        assert main(["simulate", "four-bar", "--time", "0.1", "--outputs", "3", "--quiet"]) == code
        assert words in capsys.readouterr().err


def test_words() -> None:
    fine, suspect, invalid = [], [Finding(False, 0.0, "x")], [Finding(False, 0.0, "x"), Finding(True, 1.0, "y")]
    assert [verdict_of(x) for x in (fine, suspect, invalid)] == ["valid", "suspect", "invalid"]


@pytest.mark.parametrize(("residual", "word"), [(0.9e-7, "valid"), (1.1e-7, "suspect"), (1.1e-3, "invalid")])
def test_newton_euler_from_both_sides(residual: float, word: str) -> None:
    t = np.array([0.0, 1.0, 2.0])
    found = of_reactions(t, np.array([1e-15, residual, np.nan]), {})
    assert verdict_of(found) == word and all(x.t == 1.0 for x in found)


@pytest.mark.parametrize(
    ("off", "rtol", "steps", "word"),
    [
        (0.9e-8, 1e-12, 100, "valid"),
        (1.1e-8, 1e-12, 100, "suspect"),
        (3.9e-2, 1e-11, 2000, "invalid"),
        (1.9e-6, 1e-8, 100, "valid"),
        (2.1e-6, 1e-8, 100, "suspect"),
        (1.1e-2, 1e-8, 100, "invalid"),
        (1.9e-1, 1e-4, 100, "suspect"),
        (2.1e-1, 1e-4, 100, "invalid"),
        (4.9e-2, 1e-2, 100, "valid"),
        (5.1e-2, 1e-2, 100, "suspect"),
        (5.1e-1, 1e-2, 100, "invalid"),
        (5.1e-2, 1.0, 100, "suspect"),
    ],
)
def test_energy_from_both_sides(off: float, rtol: float, steps: int, word: str) -> None:
    for scale in (1e-9, 1.0, 1e9):
        kinetic = scale * np.array([1.0, 0.5, 0.2])
        energy = EnergyResult(kinetic, scale * np.array([0.0, 0.5, 0.8 - off]), np.zeros(3))
        assert verdict_of(of_energy(np.arange(3.0), energy, rtol, steps)) == word


def test_numbers_that_are_none() -> None:
    values = np.array([[0.0, 1.0], [np.nan, 1.0]])
    assert of_arrays(np.array([0.0, 0.5]), values) == [Finding(True, 0.5, "the motion is not finite from t = 0.5 s on")]


def pendulum() -> pt.Mechanism:
    m = pt.Mechanism("pendulum", gravity=(0, -9.81, 0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def linkage() -> pt.Mechanism:
    return pt.catalogue.entry("four-bar").mechanism()


@pytest.mark.parametrize("make", [pendulum, linkage])
@pytest.mark.parametrize("formulation", ["projective", "multipliers", "svd"])
def test_a_drive_that_jumps_teleports_nothing(make: object, formulation: str) -> None:
    m = make()  # type: ignore[operator]
    m.add_drive("A", position=lambda t: 0.0 if t < 0.5 else 0.4)
    try:
        run = m.simulate(1.0, solver=pt.Solver(formulation))
    except PartitaError as error:
        assert "drive of A" in str(error)
        return
    assert not run.success
    assert run.t[-1] <= 0.5 and np.max(np.abs(run.joint("A").position)) <= 1e-9
    assert "the drive of A jumps by 0.4 at" in run.message and "at t = 0.5" in run.message


def test_a_table_ends_where_it_ends() -> None:
    m = pendulum()
    t = np.linspace(0.0, 3.0, 61)
    m.add_drive("A", position=(t, np.sin(t)))
    run = m.simulate(3.001)
    assert not run.success and run.t[-1] <= 3.0 < run.t[-1] + 0.02
    assert "the table of the drive of A ends at 3 s" in run.message
    assert m.simulate(3.0).success
    torque = pendulum()
    torque.add_torque("A", value=(t, np.cos(t)), name="motor")
    run = torque.simulate(4.0)
    assert not run.success and 'the table of force "motor" ends at 3 s' in run.message and run.t[-1] > 2.97


@pytest.mark.parametrize("formulation", ["projective", "multipliers", "wehage-haug"])
@pytest.mark.parametrize("make", [pendulum, linkage])
def test_work_of_drives_where_nothing_else_moves(make: object, formulation: str) -> None:
    """Where no degree of freedom is left the work is all there is to integrate: its error follows the tolerance."""
    m = make()  # type: ignore[operator]
    m.add_drive("A", position=lambda t: 2.0 * t + 0.5 * np.sin(3.0 * t))
    for rtol in (1e-4, 1e-8, 1e-12):
        run = m.simulate(2.0, initial=m.assemble(), rtol=rtol, atol=1e-2 * rtol, solver=pt.Solver(formulation))
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings
        assert run.energy.relative_balance <= 20.0 * rtol + 1e-12


def test_a_start_that_misses_its_conditions_is_reported() -> None:
    m = pendulum()
    m.add_drive("A", position=lambda t: math.pi * t)
    rest = m.assemble()
    still = pt.State(0.0, rest.q, 0.0 * rest.v, rest.names, rest.velocity_names)
    run = m.simulate(0.1, initial=still)
    assert any("drive of A has a rate error of 3.142 per second" in note for note in run.notes), run.notes
    assert not any("violates the constraints" in note for note in m.simulate(0.1, initial=rest).notes)


@pytest.mark.parametrize("name", ["three-rpr", "engine-boxer"])
def test_what_rests_is_valid(name: str) -> None:
    """Rounding moves a mechanism at rest by nothing that anybody asked about: its energy balance breaks no run."""
    run = pt.catalogue.entry(name).mechanism().simulate(1.0)
    assert run.success and run.certificate.verdict == "valid"
    assert np.abs(run.q - run.q[0]).max() < 1e-12


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("stiffness", [1.0, 50.0, 1e4])
def test_forces_that_are_rounding_break_no_balance(stiffness: float, coordinates: str) -> None:
    """Nothing moves and nothing pulls: springs near their free lengths, and springs whose pulls cancel."""
    for free in (0.9, None):
        m = pt.Mechanism("rests", gravity=None)
        m.add_body("b", mass=1.0, inertia=(0.1, 0.2, 0.3), position=(0.3, 0.2, -0.1))
        m.add_free("F", m.ground, "b")
        for i, angle in enumerate((0.3, 0.3 + 2 * math.pi / 3, 0.3 + 4 * math.pi / 3)):
            far = np.array([0.3, 0.2, -0.1]) + 1.1 * np.array([math.cos(angle), math.sin(angle), 0.0])
            near = 0.1 * np.array([math.cos(angle), math.sin(angle), 0.0])
            m.add_spring(f"s{i}", m.ground, far, "b", near, stiffness=stiffness, length=free)
        run = m.simulate(0.5, coordinates=coordinates)
        assert run.success and run.certificate.verdict == "valid", run.certificate.findings


def test_a_gyro_pair_rests_in_its_own_equilibrium() -> None:
    m = pt.catalogue.load("gyro-pair")
    for i, (x, y, z) in enumerate(((0.2, 0, 0), (-0.2, 0, 0), (0, 0.1, 0))):
        m.add_spring(f"s{i}", m.ground, (2 * x, 2 * y, 0.3), "frame", (x, y, z), stiffness=40.0 + 10 * i, length=0.3)
    for side in ("left", "right"):
        m.add_torsion_spring(side, stiffness=3.0)
    state = m.equilibrium().state
    start = pt.State(0.0, state.q, 0 * state.v, state.names, state.velocity_names)
    for outputs in ([0.0, 1.0], None):
        run = m.simulate(1.0, initial=start, t_eval=outputs)
        assert run.success and run.certificate.verdict in ("valid", "suspect"), run.certificate.findings


@pytest.mark.parametrize("ending", ["json", "csv"])
def test_no_run_is_both_successful_and_invalid(ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a certificate finds beyond the checks of the run ends its success, also in what is stored."""
    m = pt.catalogue.load("four-bar")
    run = m.simulate(0.1)
    assert run.success and run.certificate.verdict == "valid" and run.success
    found = [Finding(True, 0.05, "the Newton-Euler residual is 5.0e-1")]
    monkeypatch.setattr("partita.results.certificate.of_reactions", lambda *_: found)
    spoilt, stored = m.simulate(0.1), m.simulate(0.1)
    assert spoilt.success  # nobody has looked
    assert spoilt.certificate.verdict == "invalid"
    stored.save(tmp_path / f"run.{ending}")
    for judged_run in (spoilt, stored, copy.copy(spoilt), pt.load_result(tmp_path / f"run.{ending}")):
        assert not judged_run.success and judged_run.status == "invalid"
        assert "the result is invalid: the Newton-Euler residual is 5.0e-1" in judged_run.message
