"""Comparisons: equivalence of what is compared, orders of the errors, nothing silent, nothing lost."""

from __future__ import annotations

import csv
import json
import signal
import threading
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import partita as pt
from partita.cli import main
from partita.comparison import Comparison, cases
from partita.options import FORMULATIONS, SELECTIONS

SURE = ["projective", "multipliers"]


def pendulum(n: int = 2) -> pt.System:
    """A point on a circle in x and y."""
    return pt.System(
        n=n,
        mass=np.eye(n),
        forces=(0.0, -9.81),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
        names=["x", "y"],
    )


@cache
def four_bar() -> Comparison:
    """Every formulation and every rule on one turn of the standing example."""
    m = pt.catalogue.load("four-bar")
    return m.compare(2.0, initial=pt.catalogue.entry("four-bar").initial(m), baumgarte=(10.0, 10.0), window=0.5)


def test_every_formulation_and_every_rule_has_a_row() -> None:
    names = [row.name for row in four_bar().rows]
    assert len(set(names)) == len(names)
    assert {name for name in names if ": " not in name} == set(FORMULATIONS)
    assert {row.selection for row in four_bar().rows} - {None} == set(SELECTIONS)
    assert {
        "projective: kantorovich",
        "projective: mass-orthogonal",
        "projective: uncorrected",
        "wehage-haug: complete-pivoting",
    } < set(names)
    assert names[0] == "projective"


def test_any_row_can_be_asked_for_by_its_name() -> None:
    """Rows that are not the plain ones are runs with options of their own, and their names say which."""
    for row in four_bar().rows:
        (case,) = cases.cases([row.name], ["collective"], {"baumgarte": (10.0, 10.0), "window": 0.5})
        assert case.name == row.name
    options = {
        name: cases.cases([name], None, {})[0].options for name in ("projective: uncorrected", "projective: greedy")
    }
    assert options["projective: uncorrected"]["correction"] == "none"
    assert options["projective: greedy"]["selection"] == "greedy"
    m = pt.catalogue.load("four-bar")
    found = m.compare(
        1.0,
        initial=pt.catalogue.entry("four-bar").initial(m),
        formulations=["projective"],
        selections=["collective"],
        corrections=["none", "partition"],
    )
    assert [row.name for row in found.rows] == ["projective", "projective: uncorrected"]
    closures = [row.closure for row in found.rows]
    assert closures[0] is not None and closures[1] is not None and closures[0] < 1e-14 < 1e-12 < closures[1]


def test_all_that_finish_compute_the_same_motion() -> None:
    """Errors of integration at rtol 1e-8 grow a hundredfold over the top of the crank; Baumgarte's loops stay open."""
    finished = [row for row in four_bar().rows if row.finished]
    assert {"projective", "multipliers"} <= {row.name for row in finished}
    for row in finished:
        assert row.error is not None and row.error < (1e-2 if row.name == "baumgarte" else 1e-4), row
        assert row.energy_drift is not None and row.energy_drift < (1e-2 if row.name == "baumgarte" else 1e-6), row
        if row.name == "projective: uncorrected":  # (S3) is a first integral: open by the error of integration
            assert row.closure is not None and 1e-14 < row.closure < 1e-7, row
        elif row.name != "baumgarte":
            assert row.closure is not None and row.closure < 1e-11, row
            assert row.velocity_closure is not None and row.velocity_closure < 1e-10, row


def test_nothing_is_missing_without_a_reason() -> None:
    for row in four_bar().rows:
        assert row.finished or row.message, row
        if row.finished:
            assert row.evaluations and row.steps and row.time and row.time_without_outputs and row.time_per_evaluation
            assert row.dense_evaluations is not None and row.corrections is not None
        assert row.name in four_bar().to_text()
    reasons = {row.name: row for row in four_bar().rows if row.status.startswith("needs ")}
    assert list(reasons) == ["user-tangent"] and reasons["user-tangent"].status == "needs tangent"
    assert "TangentVelocities" in reasons["user-tangent"].message and "needs tangent" in four_bar().to_text()


def test_cost_of_an_evaluation_knows_nothing_of_steps_and_outputs() -> None:
    """A force that counts its calls: evaluations are timed, equally many for a formulation however it is run.

    The same kernel with few steps and with many, with few outputs and with many has one cost, so the calls that a
    comparison makes for its column depend on clocks alone; here only that they are made, apart from the runs.
    """
    calls = [0]

    def force(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        calls[0] += 1
        return np.array([0.0, -9.81])

    ring = pt.System(
        n=2,
        mass=np.eye(2),
        forces=force,
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
    )
    found = pt.compare(ring, 1.0, [0.6, -0.8], [0.0, 0.0], formulations=SURE, selections=["collective"])
    total, run = calls[0], pt.simulate(ring, 1.0, [0.6, -0.8], [0.0, 0.0])
    rows = [row.time_per_evaluation for row in found.rows]
    assert all(cost is not None and 1e-8 < cost < 1e-2 for cost in rows)
    calls[0] = 0
    states = [np.array([0.3]), run.q[60:61], run.v[60:61]]
    cost = ring.evaluation_costs([run.options, {**run.options, "formulation": "multipliers"}], [0.01, 0.01], *states)
    assert len(cost) == 2 and all(1e-8 < x < 1e-2 for x in cost)
    assert 100 < calls[0] < total  # two formulations, 25 batches of at least two, at one place instead of five
    with pytest.raises(pt.errors.ContradictionError):
        ring.evaluation_costs([run.options], [0.01], [0.0], [[0.0, 0.0]], [[0.0, 0.0]])


def test_only_integrated_coordinates_count_as_switches() -> None:
    """What moves when positions are corrected is no coordinate of `multipliers`."""
    entry = pt.catalogue.entry("three-rrr")
    m = entry.mechanism()
    found = m.compare(
        entry.duration,
        initial=entry.initial(m),
        formulations=["projective", "svd", "multipliers"],
        selections=["collective"],
    )
    assert found.row("projective").switches and found.row("multipliers").switches is None
    assert found.row("svd").switches is None and found.row("multipliers").renewals is None


@pytest.mark.parametrize(
    ("formulation", "rule", "option"),
    [("baumgarte", None, "baumgarte="), ("user-tangent", None, "tangent="), ("projective", "persistence", "window=")],
)
def test_what_only_the_user_knows_is_asked_for(formulation: str, rule: str | None, option: str) -> None:
    (case,) = cases.cases([formulation], None if rule is None else [rule], {})
    assert case.needs == option[:-1] and option in case.missing
    given = {"baumgarte": (1.0, 1.0), "window": 0.1, "tangent": object()}
    (case,) = cases.cases([formulation], None if rule is None else [rule], given)
    assert case.needs is None and given[option[:-1]] in case.options.values()


def test_condition_of_the_dependent_block_is_that_of_the_worst_output() -> None:
    """One equation: C_D is a number, of condition 1, whatever is chosen."""
    found = pt.compare(pendulum(), 1.0, [0.6, -0.8], [0.0, 0.0], formulations=SURE, selections=["collective"])
    assert found.row("projective").condition == 1.0
    # k = 1 and two coordinates: the chosen one has rho = max(|x|, |y|) up to the margin of the switch
    assert found.row("projective").sigma == found.row("projective").sqrt_mu >= np.sqrt(0.5) / 1.25
    whole = found.row("multipliers")
    assert (whole.condition, whole.sigma, whole.sqrt_mu) == (None, None, None)
    assert all(row.energy_drift is None and row.error is not None and row.error < 1e-6 for row in found.rows)


def test_rules_free_of_units_are_one_rule_for_one_degree_of_freedom() -> None:
    """Greedy, one by one, by volume: all are the measure, so they switch at the same instants as the default.

    The pendulum switches x and y. The four-bar takes long steps and has inertias that change on the way: a rule that
    measured with scales of an earlier step would switch where nothing is to be gained.
    """
    m = pt.catalogue.load("four-bar")
    start = pt.catalogue.entry("four-bar").initial(m)
    runs = (
        (lambda rule: pt.simulate(pendulum(), 3.0, [1.0, 0.0], [0.0, 0.0], solver=pt.Solver(selection=rule)), True),
        (lambda rule: m.simulate(5.0, initial=start, solver=pt.Solver(selection=rule)), False),
    )
    for run, switched in runs:
        rules = ("collective", "greedy", "individual", "normalised-determinant")
        logs = [[(p.t, p.independent) for p in run(rule).partitions] for rule in rules]
        assert all(log == logs[0] for log in logs) and (len(logs[0]) > 1) == switched
    closed = m.simulate(
        5.0, initial=start, solver=pt.Solver("explicit-closing")
    )  # chooses anew now and then, by the same measure
    assert len(closed.partitions) == 1


def test_error_is_the_distance_to_the_reference_given() -> None:
    """Against itself a run has no error; against a coarse one every run has the error of that one."""
    m = pt.catalogue.load("planar-pendulum")
    times = np.linspace(0.0, 1.0, 11)
    same = m.simulate(1.0, t_eval=times)
    found = m.compare(reference=same, formulations=["projective"], selections=["collective"])
    assert found.row("projective").error == 0.0 and len(found.rows) == 1
    coarse = m.simulate(1.0, t_eval=times, method="rk4", step=0.05)
    off = m.compare(reference=coarse, formulations=["projective"], selections=["collective"]).row("projective").error
    gap = np.linalg.norm(coarse.body("bob").position - same.body("bob").position, axis=1).max()
    # The axes of the frame are 0.5 m long, the distance of bob and pivot from their middle, and drawn parallel to the
    # world with the bob at (-1, 0): the tip of y is farthest from the pivot, and a small turn moves it the most.
    assert off == pytest.approx(np.hypot(1.0, 0.5) * gap, rel=1e-3)


def test_work_and_precision_of_a_method_of_order_five() -> None:
    """Error in proportion to the tolerance, evaluations to its fifth root: slope -5 on logarithmic axes.

    Over four decades the steps follow the tolerance to a tenth or two.
    """
    found = pt.compare(
        pendulum(), 2.0, [1.0, 0.0], [0.0, 0.0], formulations=SURE, selections=["collective"], method="dopri5"
    )
    ladder = found.work_precision((1e-5, 1e-7, 1e-9))
    assert ladder.names == SURE and all(point.status == "finished" for point in ladder.points)
    for name in SURE:
        first, _, last = ladder.of(name)
        assert first.error and last.error and first.evaluations and last.evaluations
        slope = np.log(last.error / first.error) / np.log(last.evaluations / first.evaluations)
        assert -7.0 < slope < -4.0, name
        assert name in ladder.to_text()


def test_absolute_and_relative_coordinates_have_the_same_error() -> None:
    """The error is in metres of bodies, independent of coordinates: both are those of rtol 1e-8."""
    m = pt.catalogue.load("four-bar-spring")
    for coordinates in ("relative", "absolute"):
        start = m.assemble(coordinates=coordinates)
        found = m.compare(
            0.5, initial=start, coordinates=coordinates, formulations=["projective"], selections=["collective"]
        )
        assert found.rows[0].error is not None and found.rows[0].error < 1e-7


def test_a_run_that_fails_leaves_the_others() -> None:
    """Tangent velocities that break the constraints: one row reports it, the others finish."""
    wrong = pt.TangentVelocities(lambda t, q: [[q[0], q[1]]])
    words = [*SURE, "user-tangent"]
    found = pt.compare(
        pendulum(), 0.5, [1.0, 0.0], [0.0, 0.0], formulations=words, selections=["collective"], tangent=wrong
    )
    assert [row.finished for row in found.rows] == [True, True, False]
    assert found.rows[2].status == "failed" and found.rows[2].message in found.to_text()


def test_a_run_that_creeps_is_stopped_and_reported() -> None:
    m = pt.catalogue.load("four-bar")
    start = pt.catalogue.entry("four-bar").initial(m)
    found = m.compare(2.0, initial=start, formulations=SURE, selections=["collective"], max_steps=5)
    assert {row.status for row in found.rows} == {"max-steps"}
    assert all(row.steps == 5 and row.error is None and "max_steps" in row.message for row in found.rows)


def test_rows_go_to_csv_and_pandas(tmp_path: Path) -> None:
    found = four_bar()
    path = found.to_csv(tmp_path / "rows.csv")
    with path.open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["name"] for line in lines] == [row.name for row in found.rows]
    assert float(lines[0]["error"]) == found.rows[0].error
    pytest.importorskip("pandas")
    frame = found.to_pandas()
    assert list(frame.index) == [row.name for row in found.rows]
    assert frame.loc["projective", "steps"] == found.row("projective").steps


def test_figures_show_every_run_that_finished(tmp_path: Path) -> None:
    found = four_bar()
    figure = found.plot(tmp_path / "rows.png")
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == [row.name for row in found.rows if row.finished]
    ladder = found.work_precision((1e-5, 1e-6), names=SURE)
    drawn = ladder.plot(tmp_path / "work.svg")
    assert ladder.unit == "m" and drawn.axes[0].get_ylabel().endswith("[m]")
    assert len(drawn.axes[0].lines) == len(SURE)
    assert (tmp_path / "rows.png").stat().st_size and (tmp_path / "work.svg").stat().st_size


def test_progress_goes_from_nought_to_one() -> None:
    heard: list[float] = []
    pt.catalogue.load("planar-pendulum").compare(200.0, formulations=SURE, progress=heard.append)
    assert heard == sorted(heard) and heard[-1] == 1.0


def test_interrupt_keeps_the_rows_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first run ends, the second meets Ctrl-C."""
    m = pt.catalogue.load("planar-pendulum")
    simulate, done = pt.Mechanism.simulate, []

    def impatient(self: pt.Mechanism, *arguments: object, **options: object) -> object:
        solver = options["solver"]
        assert isinstance(solver, pt.Solver)
        if solver.formulation == "multipliers":
            raise KeyboardInterrupt
        done.append(solver.formulation)
        return simulate(self, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(pt.Mechanism, "simulate", impatient)
    with pytest.raises(pt.errors.Interrupted) as stopped:
        m.compare(0.5, formulations=[*SURE, "projective"], selections=["collective"])
    found = stopped.value.result
    assert found.interrupted and found.rows[0].finished
    assert found.rows[1].status == "not run" and "interrupted" in found.rows[1].message


def test_signal_ends_a_long_run_and_the_command_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate, pressed = pt.Mechanism.simulate, threading.Event()

    def endless(self: pt.Mechanism, *arguments: object, **options: object) -> pt.Result:
        if not pressed.is_set():
            pressed.set()
            threading.Timer(0.2, signal.raise_signal, (signal.SIGINT,)).start()
        return simulate(self, *arguments, **options | {"max_steps": 10**9})  # type: ignore[arg-type]

    monkeypatch.setattr(pt.Mechanism, "simulate", endless)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        code = main(["compare", "planar-pendulum", "--time", "1e7", "--formulations", "projective"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == 130
    assert "interrupted" in capsys.readouterr().out


def test_command_prints_the_table_and_writes_what_is_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / name for name in ("rows.csv", "rows.png", "work.png")]
    code = main(
        [
            "compare", "four-bar", "--time", "0.5", "--formulations", "projective,multipliers",
            "--rules", "collective,greedy", "--correction", "partition,none", "--tolerances", "1e-4,1e-6",
            "--csv", str(files[0]), "--plot", str(files[1]), "--work-precision", str(files[2]),
        ]
    )  # fmt: skip
    printed = capsys.readouterr().out
    assert code == 0
    for word in (
        "projective: greedy",
        "projective: uncorrected",
        "multipliers",
        "0.0001",
        "cond C_D",
        "reference: projective, dop853",
        *map(str, files),
    ):
        assert word in printed
    assert all(file.stat().st_size for file in files)


def test_command_compares_in_absolute_coordinates(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "compare",
        "four-bar",
        "--time",
        "0.2",
        "--formulations",
        "projective,multipliers",
        "--rules",
        "collective",
    ]
    assert main([*words, "--coordinates", "absolute"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("finished") == 2


def test_command_compares_several_mechanisms_one_after_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--time", "0.1", "--formulations", "projective,multipliers", "--rules", "collective"]
    assert main(["compare", "bennett", "scissor", *words]) == 0
    printed = capsys.readouterr().out
    assert printed.count("finished") == 4 and printed.index("bennett: 0.1 s") < printed.index("\n\nscissor-lift: 0.1 s")
    assert main(["compare", "bennett", "scissor", *words, "--json"]) == 0
    both = json.loads(capsys.readouterr().out)["comparisons"]
    assert [one["model"] for one in both] == ["bennett", "scissor"]
    assert all(row["acceleration"] < 1e-9 for one in both for row in one["rows"])
    assert main(["compare", "bennett", "scissor", *words, "--csv", "rows.csv"]) == 2
    assert "one by one" in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore::partita.errors.SuspectResultWarning")
def test_a_run_that_cannot_begin_says_why_in_a_word() -> None:
    """Largest measures that fail together, at the start or on the way, and coordinates that a form does not have."""
    entry = pt.catalogue.entry("delta")
    m = entry.mechanism()
    (alone,) = m.compare(0.1, initial=entry.initial(m), formulations=["projective: individual"]).rows
    assert alone.status == "singular" and "elbow 1a.wx" in alone.message
    # A run passes the position within a step or stops at it, by the last digits.
    for coordinates, rtol, axis in (("relative", 1e-12, "P.wx"), ("absolute", 1e-10, "coupler.wx")):
        entry = pt.catalogue.entry("rssr")
        m = entry.mechanism()
        start = m.convert(entry.initial(m), coordinates)
        names = ["projective: individual", "explicit-closing"]
        found = m.compare(1.0, initial=start, coordinates=coordinates, formulations=names, rtol=rtol)
        stopped = found.row("projective: individual")
        assert stopped.status in ("singular", "finished") and stopped.sigma < 0.05
        if stopped.status == "singular":
            assert axis in stopped.message and "mass matrix" not in stopped.message
            assert "do not determine the others" in stopped.message and "itself is not singular" in stopped.message
        assert found.row("explicit-closing").finished == (coordinates == "relative")
    assert found.row("explicit-closing").status == "not applicable"


@pytest.mark.parametrize(
    "words",
    [
        ["compare"],
        ["compare", "forbar"],
        ["compare", "nothing.toml", "--time", "1"],
        ["compare", "four-bar", "--formulations", "magic"],
        ["compare", "four-bar", "--formulations", "projective,,svd"],
        ["compare", "four-bar", "--selections", "by-dice"],
        ["compare", "four-bar", "--baumgarte", "3"],
        ["compare", "four-bar", "--coordinates", "polar"],
        ["compare", "four-bar", "--correction", "magic"],
        ["compare", "four-bar", "--tolerances", "1e-4,-1"],
        ["compare", "four-bar", "--time", "0"],
        ["compare", "four-bar", "--plot", "nowhere/a.png"],
        ["compare", "four-bar", "--work-precision", "a.doc"],
        ["compare", "four-bar", "--csv", "nowhere/a.csv"],
    ],
)
def test_impossible_request_is_one_sentence(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("partita: error: ") and captured.err.count("\n") == 1


def test_impossible_arguments_are_refused() -> None:
    m = pt.catalogue.load("planar-pendulum")
    for match, arguments in (
        ("duration", {}),
        ("magic", {"duration": 1.0, "formulations": ["magic"]}),
        ("list", {"duration": 1.0, "formulations": "projective"}),
        ("empty", {"duration": 1.0, "selections": []}),
        ("rtol", {"duration": 1.0, "rtol": -1.0}),
        ("method", {"duration": 1.0, "method": "euler"}),
        ("duration", {"duration": float("nan")}),
        ("finished", {"reference": m.simulate(1.0, max_steps=1)}),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=match):
            m.compare(**arguments)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.ArgumentError, match="its own method"):
        pt.compare(m, 1.0)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.ArgumentError, match="v0"):
        pt.compare(pendulum(), 1.0, [1.0, 0.0])
    with pytest.raises(pt.errors.UnknownNameError, match="multipliers"):
        four_bar().row("multiplier")
    with pytest.raises(pt.errors.ArgumentError, match="tolerances"):
        four_bar().work_precision(())
