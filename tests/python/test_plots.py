"""Figures show the computed data, over time or any other abscissa."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import entry_of, run_of
from fake_runs import data
from matplotlib.figure import Figure
from test_events import rocker

import partita as pt
from partita import viewer
from partita.errors import ArgumentError, UnknownNameError
from partita.plots.abscissa import abscissa
from partita.plots.style import plain


def lines(figure: Figure, n: int = 0) -> dict[str, np.ndarray]:
    """Points (k, 2) of the lines of a panel by their labels."""
    return {str(line.get_label()): np.asarray(line.get_xydata()) for line in figure.axes[n].get_lines()}


def test_over_a_coordinate_lines_are_the_run() -> None:
    """Every output stands once, at its angle within a turn; gaps stand where a turn begins anew, and nowhere else."""
    run = run_of("four-bar")
    drawn = lines(run.plot("reactions", x="A"))["A"]
    gaps = np.isnan(drawn[:, 0])
    angle = np.degrees(run.joint("A").position[:, 0])
    assert np.array_equal(drawn[~gaps, 0], angle - 360.0 * np.floor(angle / 360.0))
    assert np.array_equal(drawn[~gaps, 1], np.linalg.norm(run.joint("A").force, axis=1))
    assert gaps.sum() == np.count_nonzero(np.diff(np.floor(angle / 360.0)))
    assert "[deg]" in run.plot("energy", x="A").axes[0].get_xlabel()
    # No joint of it carries a moment: its forces fill the figure, with ticks of the angle.
    (ax,) = run.plot("reactions", x="A").axes
    assert "[deg]" in ax.get_xlabel() and len(ax.get_xticks()) > 3


def test_few_outputs_on_a_turn_are_dots() -> None:
    entry = entry_of("engine-v-twin")
    run = entry.simulate(t_eval=np.linspace(0.0, entry.duration, round(entry.duration / 0.05) + 1))
    assert abscissa(run, "main").is_sparse and not abscissa(run_of("four-bar"), "A").is_sparse
    assert not abscissa(run_of("engine-v-twin"), None).is_sparse  # the catalogue's own outputs, over time
    for x, label in (("main", "every turn"), (None, "main turns 169 deg between outputs")):
        ax, right = run.plot("accelerations", x=x).axes
        assert all(line.get_linestyle() == "None" for line in (*ax.get_lines(), *right.get_lines()))
        assert label in ax.get_xlabel()
    assert data(viewer.html(run_of("four-bar")))["apart"] is None
    reported = data(viewer.html(run))["apart"]
    assert reported["name"] == "main" and reported["degrees"] == pytest.approx(np.degrees(60.0 * 0.05), abs=3.0)
    assert reported["step"] == pytest.approx(np.radians(10.0) / 60.0, rel=0.1)


def test_an_overview_reports_over_which_angle() -> None:
    """Where a crank turns, speeds and forces stand over its angle too; asked for x, all that can does."""
    run = run_of("four-bar")
    labels = [ax.get_xlabel() for ax in run.plot().axes]
    assert labels.count("A [deg], every turn") == 2 and labels.count("time [s]") == 7
    assert [ax.get_xlabel() for ax in run.plot(x="A").axes].count("A [deg], every turn") == 4
    rocking = run_of("roberts")
    assert not any("deg" in ax.get_xlabel() for ax in rocking.plot().axes)
    # A piston has an axis of its own beside a crank, in its unit.
    ax, right = run_of("slider-crank").plot("velocities").axes
    assert ax.get_ylabel() == "v [rad/s]" and right.get_ylabel() == "v [m/s]"
    assert [str(line.get_label()) for line in right.get_lines()] == ["slide (right)"]


def test_coordinates_that_turn_on_and_on_do_not_flatten_the_others() -> None:
    ax = run_of("engine-inline-four").plot("coordinates").axes[0]
    assert all(str(line.get_label()).startswith("slide") for line in ax.get_lines())
    assert "main 32" in ax.get_title(loc="right")
    assert not ax.collections  # in no band either


def test_alike_curves_are_distinguished() -> None:
    """Pistons of a four-cylinder engine move in pairs: of each pair one line is dashed."""
    entry = entry_of("engine-inline-four")
    m = entry.mechanism()
    run = m.simulate(0.4, initial=entry.initial(m))  # four turns of the crank
    styles = {str(line.get_label()): line.get_linestyle() for line in run.plot("coordinates").axes[0].get_lines()}
    assert np.allclose(run.joint("slide 2").position, run.joint("slide 3").position, atol=1e-9)
    assert styles["slide 2"] != styles["slide 3"]


def test_paths_are_those_of_the_body() -> None:
    run = run_of("four-bar")
    point = (0.5, 0.2, 0.0)
    figure = run.plot("paths", points={"P": ("coupler", point)})
    path = run.body("coupler").point(point)
    assert np.array_equal(lines(figure)["P"], path[:, :2])
    assert figure.axes[0].get_aspect() == 1.0


def test_bearing_loads_keep_size_and_direction() -> None:
    run = run_of("four-bar")
    figure = run.plot("bearings")
    for ax in figure.axes:
        name = ax.get_title().removesuffix(" [N]")
        angle, size = np.asarray(ax.get_lines()[0].get_xydata()).T
        force = run.joint(name).in_frame("joint").force
        assert np.allclose(np.stack([size * np.cos(angle), size * np.sin(angle)], 1), force[:, :2], atol=1e-9)


def test_a_star_says_something() -> None:
    """Where no reaction is unique a note says so once; where all are unique nothing is marked."""
    every = run_of("bennett").plot("reactions")
    assert not any("*" in label for n in (0, 1) for label in lines(every, n))
    assert "no force here is unique" in every.get_supxlabel()
    assert run_of("jansen-pair").plot("reactions").get_supxlabel() == "no joint carries a moment"


def test_own_axes_are_drawn_into() -> None:
    figure = Figure()
    ax = figure.subplots()
    assert run_of("four-bar").plot("energy", ax=ax) is figure and len(ax.get_lines()) == 4


def test_words_that_do_not_fit_are_reported() -> None:
    run, ax = run_of("four-bar"), Figure().subplots()
    refused: list[tuple[tuple[str, ...], dict[str, Any]]] = [
        (("closure",), {"x": "A"}),
        (("measure",), {"x": "A"}),
        (("overview",), {"ax": ax}),
        (("reactions",), {"ax": ax}),
        (("energy", "closure"), {"ax": ax}),
        (("energy",), {"ax": 3}),
        (("energy",), {"x": 3}),
        (("energy",), {"points": {}}),
        (("paths",), {"points": 3}),
        (("paths",), {"points": {"P": "coupler"}}),
        (("paths",), {"points": {"P": ("coupler", 1)}}),
    ]
    for words, options in refused:
        with pytest.raises(ArgumentError):
            run.plot(*words, **options)
    for options in ({"x": "Q"}, {"points": {"P": ("cuopler", (0, 0, 0))}}):
        with pytest.raises(UnknownNameError):
            run.plot("paths" if "points" in options else "energy", **options)
    with pytest.raises(ArgumentError, match="coordinates"):
        run_of("double-wishbone").plot("energy", x="lower ball")


def test_all_words_of_runs_of_every_kind() -> None:
    """Flat, spatial, with quaternions, without joints, of one output: each word draws."""
    single = pt.catalogue.entry("four-bar").mechanism().simulate(1.0, t_eval=[0.0])
    for run in (run_of("double-wishbone"), run_of("heavy-top"), run_of("rolling-ball"), single):
        run.plot("overview", "coordinates", "velocities", "accelerations", "reactions", "bearings", "paths", "energy")
    assert [line.get_marker() for line in single.plot("velocities").axes[0].get_lines()] == ["o"] * 3  # else unseen


def test_names_are_drawn_as_they_are(tmp_path: Path) -> None:
    """What stands between two dollars would be a formula, and often none: it ended the figure."""
    word = "$\\frac$"
    m = pt.Mechanism(f"M {word}")
    m.add_body(f"s{word}", mass=1.0, inertia=(1, 1, 1))
    m.add_rod(f"a{word}", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_prismatic(f"P{word}", m.ground, f"s{word}", axis=(1, 0, 0))
    m.add_revolute(f"A{word}", f"s{word}", f"a{word}", point=(0, 0, 0))
    m.add_spring(f"k{word}", m.ground, (0, 1, 0), f"a{word}", (1, 0, 0), stiffness=100.0, length=0.5)
    run = m.simulate(0.3, t_eval=np.linspace(0.0, 0.3, 16))
    goals = {f"A{word}": np.linspace(0.0, 1.0, 3), f"P{word}": np.linspace(0.0, 1.0, 3)}
    w = m.workspace(goals)
    figures = [
        run.plot("overview", "bearings", "paths", f"A{word}", f"P{word}", path=tmp_path / "run.svg"),
        run.plot("velocities", x=f"A{word}"),
        m.equilibrium(stable=True).plot(),
        m.equilibrium(along={f"k{word}.stiffness": [100.0, 200.0]}, stable=True).plot(),
        m.kinematics({f"A{word}": np.linspace(0.0, 1.0, 5), f"P{word}": 0.0}, rates={f"A{word}": 1.0}).plot(),
        w.plot(),
        m.placement(2, over=w).plot(),
        m.inverse_dynamics(run, [f"A{word}", f"P{word}"]).plot(),
        m.plot(),
    ]
    for i, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{i}.png")
    # in the legend stands the name itself
    assert "M $\\frac$" in (tmp_path / "run.svg").read_text() or figures[0].get_suptitle() == "M \\$\\frac\\$"
    assert plain("a $ b") == plain(plain("a $ b")) == "a \\$ b" and plain("no") == "no"


def marked(figure: Figure) -> list[list[float]]:
    """Times of the vertical lines of each panel."""
    return [
        [float(line.get_xdata()[0]) for line in ax.get_lines() if list(line.get_ydata()) == [0, 1]]  # type: ignore[index]
        for ax in figure.axes
    ]


def words(figure: Figure) -> list[list[str]]:
    """What stands in each panel."""
    return [[text.get_text() for text in ax.texts] for ax in figure.axes]


def observed(*events: pt.Event, duration: float = 1.8) -> pt.Result:
    m = rocker()
    return m.simulate(duration, initial=m.assemble(rates={"A": 3.0}), events=events)


def test_events_are_lines_in_figures_over_time() -> None:
    run = observed(pt.Event("one $a$ $b$", "A", value=1.0), pt.Event("zero", "A"))
    times = run.events.t.tolist()
    named = [plain(event.name) for event in run.events]
    assert len(times) == 4
    for word in ("coordinates", "velocities", "accelerations", "energy"):
        figure = run.plot(word)
        assert marked(figure)[0] == times and words(figure)[0] == named
    joint = run.plot("A")
    assert marked(joint) == [times] * 4 and words(joint) == [named, [], [], []]
    assert marked(run.plot("closure"))[0] == times and marked(run.plot("measure"))[1] == times
    overview = run.plot()
    assert sum(found == times for found in marked(overview)) == 7 and words(overview)[0] == named
    # the names lie above the curves
    ax = run.plot("coordinates").axes[0]
    low, high = ax.get_ylim()
    lowest = min(low + text.xy[1] * (high - low) for text in ax.texts)  # type: ignore[attr-defined]
    assert lowest > run.q.max()
    # none over an angle
    assert marked(run.plot("energy", x="A")) == [[]]


def test_events_that_are_many_or_none_leave_figures_as_they_are() -> None:
    many = observed(*(pt.Event(f"{x:.2f}", "A", value=float(x)) for x in np.linspace(-2.0, 2.0, 41)))
    assert (
        len(many.events) > 60 and marked(many.plot("coordinates")) == [[]] and words(many.plot("coordinates")) == [[]]
    )
    none, alone = observed(pt.Event("far", "A", value=9.0)), observed()
    assert none.plot("energy").axes[0].get_ylim() == alone.plot("energy").axes[0].get_ylim()


def test_events_at_one_instant_share_a_line_and_the_last_one_ends_the_axis() -> None:
    run = observed(
        pt.Event("one", "A", value=1.0),
        pt.Event("same", "A", value=1.0),
        pt.Event("end", "A", direction=-1, terminal=True),
    )
    figure = run.plot("coordinates")
    assert run.status == "event" and words(figure)[0] == ["one, same", "one, same", "end"]
    assert figure.axes[0].get_xlim()[1] == run.events[-1].t == run.t[-1]
    canvas, panel = figure.canvas, figure.axes[0]
    canvas.draw()
    boxes = [text.get_window_extent() for text in panel.texts]  # type: ignore[no-untyped-call]
    assert all(box.x1 <= panel.bbox.x1 + 1 for box in boxes) and not any(
        a.overlaps(b) for a, b in combinations(boxes, 2)
    )
