"""Mechanisms seen before any run: pages, figures, notebooks; also drawings that do not assemble."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from chromium import PROGRAM, Chromium
from pages import EACH_ONCE, faults

import partita as pt
from partita import webpage
from partita.mechanism.seen import still
from partita.viewer.page import fixed_bytes

NAMES = ("four-bar", "bricard", "car-differential", "double-wishbone", "andrews-squeezer")


def open_loop() -> pt.Mechanism:
    """A four-bar linkage whose rocker stands 4 m too far away."""
    m = pt.Mechanism("open <loop>")
    crank = m.add_rod("crank", (0, 0, 0), (0.3, 0, 0), mass=1.0)
    coupler = m.add_rod("coupler", (0.3, 0, 0), (1.0, 0.5, 0), mass=1.0)
    rocker = m.add_rod("rocker", (5.0, 0, 0), (5.0, 0.4, 0), mass=1.0)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, coupler, point=(0.3, 0, 0))
    m.add_revolute("C", coupler, rocker, point=(1.0, 0.5, 0), child_point=(5.0, 0.4, 0))
    m.add_revolute("D", m.ground, rocker, point=(5.0, 0, 0))
    return m


def scene_of(html: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    data: dict[str, object] = json.loads(found[1])
    return data


@pytest.mark.parametrize("name", NAMES)
def test_a_position_is_that_of_a_run_from_it(name: str) -> None:
    m = pt.catalogue.load(name)
    state = pt.catalogue.entry(name).initial(m)
    found, run = still(m, state), m.simulate(1e-3, initial=state, t_eval=[state.t])
    for body in run.names.bodies:
        assert np.array_equal(found.body(body).position, run.body(body).position)
        assert np.array_equal(found.body(body).rotation, run.body(body).rotation)
    for joint in run.names.joints:
        assert np.array_equal(found.joint(joint).point, run.joint(joint).point)
        assert np.array_equal(found.joint(joint).position, run.joint(joint).position)
    assert np.allclose(found.measure, run.measure, rtol=0, atol=1e-12)
    assert found.names == pt.results.Names(
        run.names.coordinates, run.names.velocities, (), run.names.joints, run.names.bodies
    )


def test_absolute_states_are_seen_too() -> None:
    m = pt.catalogue.load("four-bar")
    relative, absolute = m.assemble({"A": 0.4}), m.assemble({"A": 0.4}, coordinates="absolute")
    first, second = (still(m, state) for state in (relative, absolute))
    for body in first.bodies:
        assert np.allclose(first.body(body).position, second.body(body).position, atol=1e-10)


def test_an_open_drawing_is_drawn_with_its_gap(tmp_path: Path) -> None:
    m = open_loop()
    with pytest.raises(pt.errors.AssemblyError):
        m.assemble()
    found = still(m, None)
    (gap,) = found.gaps
    assert gap.label == "C: 4.001 m apart"
    assert np.array_equal(gap.ends, [(1.0, 0.5, 0), (5.0, 0.4, 0)])
    assert {"C on coupler", "C on rocker"} < set(found.joints) and "C" not in found.joints
    assert 'closed by joint "C"' in found.message and not found.success
    page = m.to_html(tmp_path / "open.html").read_text("utf-8")
    scene = scene_of(page)
    assert str(scene["warning"]).startswith("As drawn, not assembled: ")
    assert "C: 4.001 m apart" in page and "open <loop>" not in page
    labels = [text.get_text() for text in m.plot().axes[0].texts]
    assert "C: 4.001 m apart" in labels and "C on rocker" in labels and found.message in labels
    assert "does not close" in m._repr_html_() and "open &lt;loop&gt;" in m._repr_html_()


def test_a_distance_that_cannot_be_kept_is_a_gap() -> None:
    m = pt.Mechanism("wire")
    bar = m.add_rod("bar", (0, 0, 0), (1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, bar, point=(0, 0, 0))
    m.add_distance("W", m.ground, (0, 3, 0), bar, (1, 0, 0), length=1.0)
    assert [gap.label for gap in still(m, None).gaps] == ["W: 3.162 m as drawn, 1 m asked for"]


def test_a_drawing_that_closes_has_no_gap_although_it_was_drawn_with_one() -> None:
    m = pt.Mechanism("nearly")
    bar = m.add_rod("bar", (0, 0, 0), (1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, bar, point=(0, 0, 0))
    m.add_distance("W", m.ground, (0, 3, 0), bar, (1, 0, 0), length=3.0)
    found = still(m, None)
    assert found.success and not found.gaps and found.closure[0] < 1e-12


def test_figures_are_true_to_scale() -> None:
    m = pt.catalogue.load("four-bar")
    figure = m.plot()
    (ax,) = figure.axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    image = np.asarray(ax.images[0].get_array())
    left, right, low, high = ax.images[0].get_extent()
    assert np.isclose((right - left) / image.shape[1], (high - low) / image.shape[0], rtol=1e-12)
    # the pin of joint C is drawn where C is: its eye is darker than the disc around it
    x, y, _ = still(m, None).joint("C").point[0]
    column = round((x - left) / (right - left) * image.shape[1])
    row = round((high - y) / (high - low) * image.shape[0])
    assert image[row, column, :3].max() < 120
    assert image[row, column + 8, :3].min() > 200


def test_a_figure_goes_into_given_axes_and_a_file(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    m = pt.catalogue.load("four-bar")
    assert m.plot(tmp_path / "a.svg", ax=ax) is ax.figure and (tmp_path / "a.svg").stat().st_size > 1000
    with pytest.raises(pt.errors.ArgumentError, match="axes of matplotlib"):
        m.plot(ax=3)  # type: ignore[arg-type]


def test_show_opens_the_browser_or_leaves_it_to_the_notebook(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webpage.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(webpage.webbrowser, "open", opened.append)
    m = pt.catalogue.load("four-bar")
    for show in (m.show, m.simulate(0.1).show):
        page = show()
        assert opened.pop() == page.path.as_uri() and page.path.is_file()
    monkeypatch.setattr(webpage, "in_notebook", lambda: True)
    page = m.show('a "title"')
    assert not opened
    frame = page._repr_html_()
    assert frame.startswith("<iframe srcdoc=") and frame.count('"') == 6 and "<script" not in frame


def test_what_cannot_be_shown_is_refused(tmp_path: Path) -> None:
    empty = pt.Mechanism("empty")
    for call in (empty.show, empty.plot, lambda: empty.to_html(tmp_path / "x.html")):
        with pytest.raises(pt.errors.ArgumentError, match='mechanism "empty" has no body to show; add one'):
            call()
    m = pt.catalogue.load("four-bar")
    other = pt.catalogue.load("bricard").assemble()
    for state in (other, "drawn"):
        with pytest.raises(pt.errors.ArgumentError, match="state"):
            m.to_html(tmp_path / "x.html", state=state)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.ArgumentError, match="title must be text"):
        m.to_html(tmp_path / "x.html", title=3)  # type: ignore[arg-type]
    with pytest.raises(pt.errors.MissingFileError):
        m.to_html(tmp_path / "none" / "x.html")
    assert not (tmp_path / "x.html").exists()


def test_notebooks_show_a_picture_and_a_table() -> None:
    empty = pt.Mechanism("empty & new")
    assert "<img" not in empty._repr_html_() and "empty &amp; new" in empty._repr_html_()
    m = pt.catalogue.load("four-bar")
    text = m._repr_html_()
    assert "data:image/png;base64," in text and "3: crank, coupler, rocker" in text and "degrees of freedom" in text
    assert len(text) < 60_000
    state = m.assemble({"A": 0.5}, {"A": 2.0})._repr_html_()
    assert "0.5 rad<" in state and "2 rad/s<" in state
    assert m.report()._repr_html_().startswith("<pre")
    long = pt.State(0.0, np.arange(100.0), np.zeros(3))._repr_html_()
    assert "76 more" in long and long.count("<tr>") < 40


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium")
def test_the_page_of_a_drawing_has_no_fault(tmp_path: Path) -> None:
    paths = [open_loop().to_html(tmp_path / "open.html"), pt.catalogue.load("bricard").to_html(tmp_path / "b.html")]
    with Chromium() as browser:
        for path in paths:
            assert not faults(browser, path, fixed_bytes(), screens=EACH_ONCE)
        assert not browser.reported
