"""The page of a playground: undo, search, themes, links that carry numbers, and files of what was set."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import unreached

import partita as pt
from partita.mechanism.models import layout_of

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pt.catalogue.load("four-bar-spring").to_playground(tmp_path_factory.mktemp("pages") / "four-bar.html")


def shown(browser: Chromium, path: Path, at: str = "", screen: tuple[int, int, bool] = DESKTOP) -> None:
    browser.open(path, screen, "light", at)
    browser.value("(async () => { while (!window.playground) await new Promise((r) => setTimeout(r, 10)); })()")


def put(browser: Chromium, words: str, value: str) -> str:
    """Type a number into the field of that name; what the page says is wrong with it."""
    fault: str = browser.value(
        f"(() => {{ const box = [...document.querySelectorAll('.field')].find((f) => f.dataset.words === {words!r});"
        f" const input = box.querySelector('input'); input.value = {value!r}; input.dispatchEvent(new Event('change'));"
        " const fault = document.getElementById('fault'); return fault.hidden ? '' : fault.textContent; })()"
    )
    return fault


def number(browser: Chromium, name: str) -> list[float]:
    values: list[float] = browser.value(f"window.playground.motion.get({name!r})")
    return values


def click(browser: Chromium, name: str) -> None:
    browser.value(f"document.getElementById({name!r}).click()")


def test_changes_are_taken_back_and_made_again(browser: Chromium, page: Path) -> None:
    shown(browser, page)
    assert browser.value("document.getElementById('undo').disabled")
    assert put(browser, "crank: mass", "3") == ""
    assert put(browser, "coupler: length", "1.2") == ""
    assert "stays open by" in put(browser, "coupler: length", "30")  # is no change
    assert number(browser, "crank.mass") == [3.0]
    click(browser, "undo")
    assert browser.value("playground.address()") != ""
    click(browser, "undo")
    assert number(browser, "crank.mass") == [1.0]
    assert browser.value("document.getElementById('undo').disabled") and browser.value("playground.address()") == ""
    click(browser, "redo")
    click(browser, "redo")
    assert number(browser, "crank.mass") == [3.0]
    assert browser.value("document.getElementById('redo').disabled")
    long = browser.value("document.querySelectorAll('#lengths input[type=number]')[2].value")
    assert long == "1.2" and browser.reported == []


def test_dragging_a_slider_is_one_change(browser: Chromium, page: Path) -> None:
    shown(browser, page)
    browser.value(
        "(() => { const s = document.querySelectorAll('#masses input[type=range]')[1]; for (const x of [1.5, 2, 2.5]) {"
        " s.value = x; s.dispatchEvent(new Event('input')); } s.dispatchEvent(new Event('change')); })()"
    )
    assert number(browser, "crank.mass") == pytest.approx([2.5], abs=0.01)
    click(browser, "undo")
    assert number(browser, "crank.mass") == [1.0]


def test_numbers_are_found_by_name(browser: Chromium, page: Path) -> None:
    shown(browser, page)
    visible = "[...document.querySelectorAll('.field')].filter((f) => f.checkVisibility()).map((f) => f.dataset.words)"

    def find(text: str) -> list[str]:
        browser.value(f"document.getElementById('search').value = {text!r}")
        browser.value("document.getElementById('search').dispatchEvent(new Event('input'))")
        words: list[str] = browser.value(visible)
        return words

    before = browser.value(visible)
    assert find("Mass") == ["crank: mass", "coupler: mass", "rocker: mass"]
    assert find("rocker.inertia xx") == ["rocker.inertia xx"]
    assert find("nothing like this") == []
    assert browser.value("document.getElementById('nothing').checkVisibility()")
    assert set(before) <= set(find(""))


def test_a_link_carries_the_numbers(browser: Chromium, page: Path) -> None:
    shown(browser, page)
    put(browser, "crank: mass", "3.25")
    put(browser, "rocker: length", "1.1")
    values = {name: number(browser, name) for name in ("crank.mass", "D.child_point", "C.child_point", "gravity")}
    click(browser, "share")
    address = browser.value("location.hash")
    assert address == browser.value("playground.address()") and address.startswith("#p=")
    shown(browser, page, address, PHONE)
    assert {name: number(browser, name) for name in values} == values
    assert browser.value("document.querySelectorAll('#masses input[type=number]')[1].value") == "3.25"
    assert browser.value("document.getElementById('fault').hidden") and browser.reported == []


def test_a_link_carries_drives_and_is_refused_whole(browser: Chromium, tmp_path: Path) -> None:
    path = pt.catalogue.load("gear-pair").to_playground(tmp_path / "gears.html")
    drive = "drive of pinion shaft"
    shown(browser, path)
    assert put(browser, f"{drive}: velocity", "7") == ""
    address = browser.value("playground.address()")
    shown(browser, path, address)
    assert browser.value("playground.motion.rates[0].value") == 7.0
    assert browser.value("playground.motion.v[0]") == pytest.approx(7.0)
    shown(browser, path, written({"v": 1, "numbers": {"pinion.mass": [2.0]}, "drives": {drive: "fast"}}))
    assert "not a number" in browser.value("document.getElementById('fault').innerText")
    assert browser.value("playground.address()") == "" and browser.value("playground.motion.rates[0].value") == 12.0


def written(data: Any) -> str:
    text = data if isinstance(data, str) else json.dumps(data)
    return "#p=" + base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


NUMBERS = {"crank.mass": [2.0]}
HOSTILE = {
    "no base 64": "#p=<img src=x onerror=alert(1)>",
    "no text": "#p=" + base64.urlsafe_b64encode(b"\xff\xfe\x00").decode().rstrip("="),
    "no JSON": written("{"),
    "a list": written([1, 2]),
    "null": written("null"),
    "another version": written({"v": 2, "numbers": NUMBERS, "drives": {}}),
    "an unknown number": written({"v": 1, "numbers": {"<b>x</b>.mass": [1.0]}, "drives": {}}),
    "the prototype": written('{"v": 1, "numbers": {"__proto__": [1]}, "drives": {}}'),
    "a method of objects": written({"v": 1, "numbers": {"constructor": [1.0]}, "drives": {}}),
    "too few": written({"v": 1, "numbers": {"gravity": [0.0, -1.0]}, "drives": {}}),
    "text for a number": written({"v": 1, "numbers": {"crank.mass": ["2"]}, "drives": {}}),
    "an object for a number": written({"v": 1, "numbers": {"crank.mass": [{"valueOf": 1}]}, "drives": {}}),
    "infinite": written('{"v": 1, "numbers": {"crank.mass": [1e999]}, "drives": {}}'),
    "huge": written({"v": 1, "numbers": {"crank.mass": [1e300]}, "drives": {}}),
    "a negative mass": written({"v": 1, "numbers": {"crank.mass": [-2.0]}, "drives": {}}),
    "a hidden spring": written({"v": 1, "numbers": {"pull crank.stiffness": [1e9]}, "drives": {}}),
    "an unknown drive": written({"v": 1, "numbers": NUMBERS, "drives": {"toString": 1.0}}),
    "too long": "#p=" + 30_000 * "A",
    "what cannot close": written({"v": 1, "numbers": {"C.point": [9.0, 9.0, 0.0]}, "drives": {}}),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_addresses_of_strangers_change_nothing(browser: Chromium, page: Path, what: str) -> None:
    """What is not a list of numbers of this mechanism is refused whole, with a sentence, and the page runs as drawn."""
    shown(browser, page, HOSTILE[what])
    fault = browser.value("document.getElementById('fault').innerText")
    assert fault and "<" not in fault
    assert browser.value("playground.address()") == ""
    assert number(browser, "crank.mass") == [1.0] and number(browser, "pull crank.stiffness") == [0.0]
    assert browser.value("document.querySelectorAll('img, b:not([aria-hidden])').length") == 0
    assert browser.value("({}).polluted === undefined && Array.isArray([])")
    browser.value("new Promise((r) => setTimeout(r, 50))")
    assert browser.value("playground.motion.t") > 0.0
    assert browser.reported == []


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("four-bar-spring", {"crank: mass": "2.5", "rocker: length": "1.05", "diagonal: stiffness": "31"}),
        ("gear-pair", {"drive of pinion shaft: velocity": "7", "wheel: mass": "0.4"}),
        ("double-wishbone", {"knuckle: mass": "21"}),
        ("planetary-gear", {"carrier: mass": "0.9"}),
    ],
)  # fmt: skip
def test_files_hold_the_numbers_of_the_page(
    browser: Chromium, tmp_path: Path, name: str, changes: dict[str, str]
) -> None:
    """The model file, read by the core, has every number of the page; the script runs from its position."""
    entry = pt.catalogue.entry(name)
    mechanism = entry.mechanism()
    shown(browser, mechanism.to_playground(tmp_path / "x.html", initial=entry.initial(mechanism)))
    for words, value in changes.items():
        assert put(browser, words, value) == "", words
    inertia = number(browser, f"{changes and next(iter(mechanism.bodies))}.inertia")
    inertia[0] *= 1.25
    browser.value(f"playground.motion.change({{ {next(iter(mechanism.bodies)) + '.inertia'!r}: {inertia} }})")
    made = browser.value("playground.toml()")
    assert made["missing"] == []
    (tmp_path / "x.toml").write_text(made["text"], encoding="utf-8")
    loaded = pt.load(tmp_path / "x.toml")
    known = dict(layout_of(loaded, "relative")[0].core.parameters())
    values = browser.value("playground.numbers.now().values")
    assert len(values) > 5
    for parameter, numbers in values.items():
        assert np.allclose(known[parameter], numbers, rtol=1e-15, atol=1e-15), parameter
    for drive in loaded.drives:
        assert f"{drive}: velocity" in changes
    made = browser.value("playground.python()")
    (tmp_path / "x.py").write_text(made["text"], encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "x.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert ran.returncode == 0, ran.stderr[-1500:]
    assert "reached t = 10" in ran.stdout


def test_solids_whose_numbers_are_changed_become_bodies(browser: Chromium, tmp_path: Path) -> None:
    """A shape of steel has no place for another mass; the other solid keeps its shape."""
    m = pt.Mechanism("two pendulums")
    for name, x in (("disc", 0.0), ("bar", 0.5)):
        shape = pt.shapes.Disc(0.05, 0.01) if name == "disc" else pt.shapes.Box((0.02, 0.2, 0.01))
        m.add_solid(name, shape, material="steel", position=(x, -0.1, 0))
        m.add_revolute(f"pin of {name}", m.ground, name, point=(x, 0, 0))
    shown(browser, m.to_playground(tmp_path / "x.html"))
    assert browser.value("playground.toml().text").count("[[solid]]") == 2
    assert put(browser, "disc: mass", "2.5") == ""
    made = browser.value("playground.toml()")
    assert made["missing"] == []
    (tmp_path / "x.toml").write_text(made["text"], encoding="utf-8")
    loaded = pt.load(tmp_path / "x.toml")
    assert loaded.bodies["disc"].mass == 2.5 and loaded.bodies["disc"].kind == "body"
    assert np.array_equal(loaded.bodies["disc"].inertia, m.bodies["disc"].inertia)
    assert loaded.bodies["bar"].shape == m.bodies["bar"].shape
    for parameter, numbers in browser.value("playground.numbers.now().values").items():
        known = dict(layout_of(loaded, "relative")[0].core.parameters())
        assert np.allclose(known[parameter], numbers, rtol=1e-15, atol=1e-15), parameter


def test_keys_and_themes(browser: Chromium, page: Path) -> None:
    shown(browser, page)
    assert unreached(browser) == []
    browser.value("document.activeElement.blur()")
    browser.press("d")
    assert browser.value("document.documentElement.dataset.theme") == "dark"
    browser.press(" ")
    assert browser.value("document.getElementById('play').textContent") == "Run"
    scale = browser.value("playground.drawing.scene.camera.scale")
    browser.press("+")
    assert browser.value("playground.drawing.scene.camera.scale") > scale
    browser.press("0")
    assert browser.value("playground.drawing.scene.camera.scale") == pytest.approx(scale, rel=0.2)
    assert browser.reported == []


def test_links_are_pulled_and_leave_paths(browser: Chromium, tmp_path: Path) -> None:
    """The pointer takes the link under it; paths and plots grow; what moves stays in the picture."""
    entry = pt.catalogue.entry("four-bar")
    mechanism = entry.mechanism()
    shown(browser, mechanism.to_playground(tmp_path / "x.html", initial=entry.initial(mechanism)))
    browser.value("new Promise((r) => setTimeout(r, 400))")
    found = browser.value(
        "(() => { const { drawing, motion } = playground, { scene } = drawing, p = scene.camera.project("
        "scene.run.placed(0, 1, scene.run.scene.bodies[1].points[0])); return [drawing.pick(p.x, p.y) !== null,"
        " scene.traced.map((t) => t.points.length), playground.plots.run.t.length, motion.t]; })()"
    )
    assert found[0] and min(found[1]) > 5 and found[2] > 5
    browser.value("(() => { const p = playground; for (let i = 0; i < 40; i++) { p.motion.advance(p.motion.t + 0.05);"
                  " p.drawing.scene.draw(0, true); } })()")  # fmt: skip
    inside = browser.value(
        "(() => { const { scene } = playground.drawing, c = scene.camera, { run } = scene;"
        " return run.scene.joints.map((_, j) => c.project(run.seatOf(0, j)))"
        ".every((p) => p.x >= 0 && p.y >= 0 && p.x <= c.width && p.y <= c.height); })()"
    )
    assert inside and browser.reported == []


@pytest.mark.parametrize("screen", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_the_first_view_holds_the_arrows(browser: Chromium, tmp_path: Path, screen: tuple[int, int, bool]) -> None:
    """Reactions of the first seconds neither leave the drawing nor lie under the tools."""
    path = pt.catalogue.load("slider-crank").to_playground(tmp_path / "slider-crank.html")
    shown(browser, path, screen=screen)
    browser.rest_a_frame()
    ends = browser.value("playground.drawing.scene.shafts.flat().map(({ x, y }) => [x, y])")
    width, height = browser.value("[playground.drawing.scene.camera.width, playground.drawing.scene.camera.height]")
    assert len(ends) > 6
    covered = browser.value("playground.drawing.scene.covered")
    for x, y in ends:
        assert 0 <= x <= width and 0 <= y <= height
        assert not any(box["left"] < x < box["right"] and box["top"] < y < box["bottom"] for box in covered)


def test_blocks_stay_on_their_rails(browser: Chromium, tmp_path: Path) -> None:
    """A rail, and the end of a link that it shapes, reach as far as the block has slid."""
    entry = pt.catalogue.entry("scotch-yoke")
    mechanism = entry.mechanism()
    shown(browser, mechanism.to_playground(tmp_path / "x.html", initial=entry.initial(mechanism)))
    click(browser, "play")
    first, found = browser.value(
        "(() => { const { drawing, motion } = playground, { scene } = drawing, { run } = scene, found = [];"
        " const yoke = run.scene.joints.find((j) => j.name === 'block slide'), body = run.scene.bodies[yoke.parent];"
        " for (let i = 0; i < 40; i++) { const z = run.scene.joints.indexOf(yoke), block = run.seatOf(0, z);"
        " found.push([...yoke.rail, run.within(yoke.parent, block), body.points]);"
        " motion.advance(motion.t + 0.05); scene.draw(0, true); }"
        " return [run.about.scene.joints.find((j) => j.name === 'block slide').rail, found]; })()"
    )
    lengths = []
    for *ends, block, shape in found:
        a, b = (np.array(end) for end in ends)
        lengths.append(np.linalg.norm(b - a))
        at = (np.array(block) - a) @ (b - a) / lengths[-1]
        assert 0.02 < at < lengths[-1] - 0.02
        assert np.linalg.norm(np.array(shape) - b, axis=1).min() < 1e-9
    assert max(lengths) > 5 * np.linalg.norm(np.subtract(*first))
    # Points of a page are rounded; a link follows its length all the same.
    assert put(browser, "crank: length", "0.2") == ""
    browser.rest_a_frame()
    shape = browser.value("playground.drawing.scene.run.scene.bodies[0].points")
    assert np.linalg.norm(np.subtract(*shape)) == pytest.approx(0.2, abs=1e-6)


def test_rates_of_points_are_shown_as_arrows_and_a_lecture_alone(browser: Chromium, tmp_path: Path) -> None:
    """The tip of a bar of r = 0.5 m that a drive turns at w = 2 rad/s: speed w r along the circle, acceleration w^2 r
    to its middle, and ghosts on the circle."""
    m = pt.Mechanism("bar")
    bar = m.add_rod("bar", start=(0, 0, 0), end=(0.5, 0, 0), mass=1.0)
    m.add_drive(m.add_revolute("A", m.ground, bar, point=(0, 0, 0)), velocity=2.0)
    shown(browser, m.to_playground(tmp_path / "bar.html", speed=1.0))
    for name in ("velocities", "accelerations", "ghosts"):
        click(browser, name)
    browser.value("new Promise((r) => setTimeout(r, 900))")
    browser.value("document.getElementById('play').click()")
    rates, ghosts = browser.value(
        "(() => { const { shown } = playground.drawing.scene, [list] = shown.samples;"
        " return [{ ...shown.constructor.rates(list), p: list[list.length - 1].p },"
        " shown.ghosts.map((g) => g.bodies[0].lines[0][1])]; })()"
    )
    p = np.array(rates["p"])
    assert np.linalg.norm(p) == pytest.approx(0.5, abs=1e-9)
    assert np.array(rates["velocity"]) == pytest.approx([-2.0 * p[1], 2.0 * p[0], 0.0], abs=1e-5)
    assert np.array(rates["acceleration"]) == pytest.approx(-4.0 * p, abs=2e-3)
    assert len(ghosts) >= 2 and np.linalg.norm(ghosts, axis=1) == pytest.approx(np.full(len(ghosts), 0.5), abs=1e-9)
    browser.value("document.activeElement.blur()")
    browser.press("p")
    assert browser.value("getComputedStyle(document.querySelector('aside')).display") == "none"
    browser.press("p")
    assert browser.value("getComputedStyle(document.querySelector('aside')).display") != "none"
    assert browser.reported == []
