"""Pages, figures and films say what a run is worth, and draw nothing that is not there."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import run_of
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import CONTRAST, INSIDE, LAYOUT

import partita as pt
from partita.plots.style import level, new_figure, wrapped
from partita.result_view import least, scales
from partita.viewer.hints import solids
from partita.viewer.pose import Pose
from partita.viewer.scene import describe
from partita.viewer.stage import Stage, font_of

needs_browser = pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("no Chromium is installed to open pages in")
    with Chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def suspect() -> Any:
    """A run at tolerances that are too coarse for it."""
    m = pt.catalogue.load("four-bar")
    with pytest.warns(pt.errors.SuspectResultWarning):
        run = m.simulate(10.0, rtol=1e-2, atol=1e-2, initial=m.assemble(rates={"A": 2.0}))
    assert run.certificate.verdict == "suspect"
    return run


def sliding_block() -> pt.Mechanism:
    """A body that slides along the ground, which is the child of its joint."""
    m = pt.Mechanism("block", gravity=(0.0, -9.81, 0.0))
    body = m.add_body("block", mass=1.0, inertia=(0.1, 0.1, 0.1))
    rod = m.add_rod("rod", (0.0, 0.0, 0.0), (0.5, -1.0, 0.0), mass=1.0)
    m.add_prismatic("S", body, m.ground, axis=(1.0, 0.0, 0.0))
    m.add_revolute("P", body, rod, point=(0.0, 0.0, 0.0))
    return m


@needs_browser
@pytest.mark.parametrize(
    ("screen", "scheme"), [(DESKTOP, "light"), (DESKTOP, "dark"), (PHONE, "light"), (PHONE, "dark")]
)
def test_the_seal_of_a_page_opens_the_certificate(
    browser: Chromium, tmp_path: Path, suspect: Any, screen: Any, scheme: str
) -> None:
    browser.open(suspect.to_html(tmp_path / "suspect.html"), screen, scheme)
    assert browser.value("seal.textContent + ' ' + seal.dataset.verdict") == "? suspect suspect"
    assert browser.value("seal.closest('header') !== null && seal.checkVisibility()")
    assert str(suspect.certificate.findings[0].sentence) in browser.value("trust.textContent")
    assert browser.value(CONTRAST) == [] and browser.value(LAYOUT) == []
    browser.value("seal.click()")
    assert browser.value("certificate.open && certificate.querySelector('pre').textContent") == str(suspect.certificate)
    assert browser.value("certificate.getBoundingClientRect().right <= innerWidth")
    browser.value("document.getElementById('close').click()")
    assert not browser.value("certificate.open")
    assert browser.reported == []


@needs_browser
def test_a_valid_run_says_so_and_a_position_nothing(browser: Chromium, tmp_path: Path) -> None:
    browser.open(run_of("four-bar").to_html(tmp_path / "run.html"))
    assert browser.value("seal.textContent") == "✓ valid"
    browser.open(pt.catalogue.load("four-bar").to_html(tmp_path / "still.html"))
    assert not browser.value("seal.checkVisibility()") and not browser.value("trust.checkVisibility()")


def test_figures_and_films_have_the_verdict(suspect: Any, tmp_path: Path) -> None:
    for words in ((), ("A",), ("energy", "closure")):
        for run, verdict in ((suspect, "suspect"), (run_of("four-bar"), "valid")):
            figure = run.plot(*words)
            assert [text.get_text().split(",")[0] for text in figure.texts if "run:" in text.get_text()] == [
                f"run: {verdict}"
            ]
    alike = [Stage(Pose(describe(run, "x", solids(None, []), (), packed=False)), (400, 300), False, 1.0)
             for run in (suspect, run_of("four-bar"))]  # fmt: skip
    corners = [np.asarray(stage.picture(0))[20:50, 250:].astype(int) for stage in alike]
    red, green = (corner - corner.max(axis=(0, 1)) for corner in corners)
    assert (red[..., 0] - red[..., 1]).max() > 50 and (green[..., 1] - green[..., 0]).max() > 50


@needs_browser
def test_a_page_moves_when_it_is_opened(browser: Chromium, tmp_path: Path) -> None:
    path = run_of("four-bar").to_html(tmp_path / "run.html")
    for at, moves in (("", True), ("#still", False), ("#t=1.5", False), ("#t=1.5&play", True)):
        browser.open(path, at=at)
        assert browser.value("partita.playing()") == moves, at


@needs_browser
def test_reading_the_page_hides_no_coordinate(browser: Chromium, tmp_path: Path) -> None:
    browser.open(run_of("jansen-pair").to_html(tmp_path / "run.html"))
    seen = (
        "[...document.querySelectorAll('#bars .row')].filter((e) => e.checkVisibility()"
        " && e.getBoundingClientRect().bottom <= bars.getBoundingClientRect().bottom + 1).length"
    )
    before = browser.value(seen)
    browser.value("[...document.querySelectorAll('details')].at(-1).open = true")
    assert browser.value(seen) == before > 3


@needs_browser
@pytest.mark.parametrize("screen", [PHONE, INSIDE, (720, 620, False), (1000, 620, False)])
def test_the_play_bar_covers_no_plot(browser: Chromium, tmp_path: Path, screen: Any) -> None:
    browser.open(run_of("andrews-squeezer").to_html(tmp_path / "run.html"), screen)
    footer, *plots = browser.value(
        "[document.querySelector('footer'), ...document.querySelectorAll('.plot')]"
        ".map((e) => e.getBoundingClientRect()).map(({ top, bottom }) => [top, bottom])"
    )
    assert len(plots) == 3 and all(bottom <= footer[0] + 1 or top >= footer[1] - 1 for top, bottom in plots)
    assert browser.value(LAYOUT) == []


@needs_browser
def test_efforts_that_are_not_unique_say_so_whole(browser: Chromium, tmp_path: Path) -> None:
    """Two drives on one degree of freedom share the load; what is round-off has no bar."""
    m = pt.catalogue.load("four-bar")
    m.add_drive("A", velocity=2.0)
    other = pt.Mechanism("crank", gravity=(0.0, 0.0, 0.0))
    rod = other.add_rod("rod", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), mass=1.0)
    other.add_revolute("A", other.ground, rod, (0.0, 0.0, 0.0))
    other.add_drive("A", velocity=2.0)
    browser.open(other.simulate(1.0).to_html(tmp_path / "still.html"), at="#t=0.5")
    assert browser.value("document.querySelector('#efforts .value').textContent") == "0 N m"
    assert browser.value("document.querySelector('#efforts .fill').style.transform") == "scaleX(0)"
    text = m.simulate(1.0).to_html(tmp_path / "run.html").read_text("utf-8")
    shared = tmp_path / "shared.html"
    assert '"unit":"N m","open":false' in text
    shared.write_text(text.replace('"unit":"N m","open":false', '"unit":"N m","open":true'), encoding="utf-8")
    for screen in (DESKTOP, PHONE):
        browser.open(shared, screen)
        assert "Not unique, shared by least squares: A." in browser.value("efforts.textContent")
        assert browser.value(LAYOUT) == []


@needs_browser
def test_only_the_ground_is_hatched_and_it_rests(browser: Chromium, tmp_path: Path) -> None:
    m = sliding_block()
    run = m.simulate(1.0, initial=m.assemble(rates={"S": 1.0}))
    assert np.ptp(run.body("block").position[:, 0]) > 0.3
    browser.open(run.to_html(tmp_path / "run.html"), at="#still")
    seen = []
    for t in (0.0, 0.5, 1.0):
        browser.value(f"partita.show({t})")
        browser.rest_a_frame()
        seen.append(browser.value("partita.hatched().map(([p, q]) => [p.x, p.y, q.x, q.y])"))
    assert len(seen[0]) > 0 and np.allclose(seen, seen[0])
    stage = Stage(Pose(describe(run, "x", solids(None, []), (), packed=False)), (400, 300), False, 1.0)
    films: list[list[Any]] = []
    stage.hatch = lambda sheet, p, q, r: films[-1].append([*p, *q])  # type: ignore[method-assign]
    for frame in (0, 100, 200):
        films.append([])
        stage.picture(frame)
    assert len(films[0]) > 0 and np.allclose(films, films[0])


@needs_browser
def test_a_drive_of_a_playground_has_its_unit(browser: Chromium, tmp_path: Path) -> None:
    m = pt.Mechanism("crank")
    rod = m.add_rod("rod", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), mass=1.0)
    m.add_revolute("A", m.ground, rod, (0.0, 0.0, 0.0))
    m.add_drive("A", velocity=2.0)
    browser.open(m.to_playground(tmp_path / "play.html"))
    units = browser.value("[...document.querySelectorAll('.field .unit')].map((e) => e.textContent)")
    assert "rad/s" in units and "/s" not in units


def test_films_have_signs_for_all_they_write() -> None:
    font = font_of(24)
    box = bytes(font.getmask("\uffff"))
    assert all(bytes(font.getmask(sign)) != box for sign in "×µ…ρφαéßЖ")


def test_round_off_is_measured_by_one_rule() -> None:
    """Moments of 1e-14 N m of a planar mechanism are nothing beside its forces times its length."""
    run = run_of("andrews-squeezer")
    scale = scales(run)
    forces = float(np.abs(run.at_once.reactions["force"]).max())
    assert forces <= scale["N"] and 0.05 < scale["m"] < 0.5
    assert 0.0 < float(np.abs(run.at_once.reactions["moment"]).max()) < least(run, "N m") < 1e-6 * forces
    figure = run.plot("O")
    moment = figure.axes[3]
    low, high = moment.get_ylim()
    assert high - low > 1e3 * least(run, "N m") and low < 0.0 < high
    assert scales(pt.simulate(pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -q), 1.0, [1.0], [0.0])) == {}
    ax = new_figure(3, 2).subplots()
    level(ax, 7.0 + 1e-13 * np.sin(np.arange(50.0)), 1e-9)
    assert ax.get_ylim()[1] - ax.get_ylim()[0] > 1.0
    ax.plot(np.sin(np.arange(50.0)))
    before = ax.get_ylim()
    level(ax, np.sin(np.arange(50.0)), 1e-9)
    assert ax.get_ylim() == before


def test_names_in_figures_are_whole() -> None:
    name = "right_hand.upper arm of_the_third robot"
    assert wrapped(name).replace("\n", "").replace(" ", "") == name.replace(" ", "")
    assert all(len(line) <= 22 for line in wrapped(name).split("\n"))
    assert wrapped("A") == "A" and len(wrapped("x" * 400).split("\n")) == 4


def test_an_empty_panel_has_no_frame_and_its_words_fit() -> None:
    figure = pt.simulate(pt.System(1, mass=[[1.0]], forces=lambda t, q, v: -q), 1.0, [1.0], [0.0]).plot()
    figure.draw_without_rendering()
    empty = [ax for ax in figure.axes if ax.texts and "no" in ax.texts[0].get_text().split()]
    assert len(empty) >= 3
    for ax in empty:
        assert not any(spine.get_visible() for spine in ax.spines.values())
        words, box = ax.texts[0].get_window_extent(), ax.get_window_extent()
        assert box.x0 <= words.x0 and words.x1 <= box.x1


@pytest.mark.parametrize("name", ["four-bar", "andrews-squeezer"])
def test_words_of_the_overview_stand_beside_each_other(name: str) -> None:
    """Titles, labels of axes, their numbers and the seal."""
    figure = run_of(name).plot()
    figure.draw_without_rendering()
    boxes = []
    for ax in figure.axes:
        for text in (ax.title, ax._left_title, ax._right_title, ax.xaxis.label, ax.yaxis.label):  # type: ignore[attr-defined]
            if text.get_text() and text.get_visible():
                boxes.append((text.get_text(), text.get_window_extent()))
        for axis, (low, high) in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            for tick in axis.get_major_ticks():
                if tick.label1.get_visible() and tick.label1.get_text() and low <= tick.get_loc() <= high:
                    boxes.append((tick.label1.get_text(), tick.label1.get_window_extent()))
    boxes += [(text.get_text(), text.get_window_extent()) for text in figure.texts]
    found = [
        (one, other)
        for i, (one, a) in enumerate(boxes)
        for other, b in boxes[i + 1 :]
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 1 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1
    ]
    assert found == []
