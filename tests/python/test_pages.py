"""Animated pages opened in a browser: the page itself is looked at. `make pages` opens all of the catalogue."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue_runs import entry_of, run_of
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import CONTRAST, EACH_ONCE, INSIDE, LAYOUT, SCREENS, faults, unreached
from test_events import oscillators, rocker
from thorough import either

import partita as pt
from partita import viewer
from partita.viewer.page import fixed_bytes
from partita.viewer.pose import is_tangled, strokes_of

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no Chromium is installed to open pages in")


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium() as opened:
        yield opened


REPRESENTATIVE = {
    "double-wishbone": "in space, springs",
    "engine-inline-four": "a row of cylinders",
    "jansen-pair": "flat, shared places, switches",
    "bennett": "reactions that are not unique",
    "agile-eye": "all hinges in one point",
    "belt-drive": "belts",
    "cam-rocker": "a cam, a rod without mass",
    "car-differential": "wheels whose axes meet, links without a picture",
    "gyroscope": "bodies known by their inertia alone",
    "hexaglide": "rods without mass, rails",
    "planetary-gear": "teeth inside and outside",
    "whipple-bicycle": "wheels that roll out of the picture",
}
"""What `make test` opens; `make pages` opens all."""
LOOKED_AT = either(EACH_ONCE, SCREENS)


@pytest.mark.parametrize("name", REPRESENTATIVE)
def test_pages_are_legible(browser: Chromium, tmp_path: Path, name: str) -> None:
    path = viewer.write_html(run_of(name), tmp_path / f"{name}.html")
    assert faults(browser, path, fixed_bytes(), screens=LOOKED_AT) == []


@pytest.mark.parametrize("name", [*REPRESENTATIVE, "heavy-top", "watt-axle"])
def test_pages_are_legible_inside_a_page_on_a_phone(browser: Chromium, tmp_path: Path, name: str) -> None:
    path = viewer.write_html(run_of(name), tmp_path / f"{name}.html")
    browser.open(path, INSIDE)
    assert browser.value(LAYOUT) == []


def test_the_questions_find_faults(browser: Chromium, tmp_path: Path) -> None:
    """The inspection of a page distinguishes a faulty page from a sound one."""
    text = viewer.html(run_of("jansen-pair"))
    pale = tmp_path / "pale.html"
    pale.write_text(text.replace("--quiet: #53606d", "--quiet: #aab4bd"), encoding="utf-8")
    browser.open(pale)
    assert any("DT" in word for word in browser.value(CONTRAST))
    heaped = tmp_path / "heaped.html"
    crowded = viewer.html(run_of("engine-radial-five"))  # whose words need every free place of a phone
    heaped.write_text(crowded.replace("if (taken.some(", "if (false && taken.some("), encoding="utf-8")
    browser.open(heaped, PHONE, at="#still")
    browser.value("document.getElementById('names').click()")
    browser.rest_a_frame()
    assert any('" on "' in word for word in browser.value(LAYOUT))
    loud = tmp_path / "loud.html"
    loud.write_text(text.replace("start();\n", "start(); console.error('said');\n"), encoding="utf-8")
    browser.open(loud)
    assert any("said" in word for word in browser.reported)


def test_keyboard_reaches_everything(browser: Chromium, tmp_path: Path) -> None:
    path = viewer.write_html(run_of("jansen-pair"), tmp_path / "keys.html")
    browser.open(path)
    assert unreached(browser) == []
    browser.value("document.activeElement.blur()")
    before = browser.value("partita.time()")
    browser.press(".")
    assert browser.value("partita.time()") > before
    browser.press(" ")
    assert "Pause" in browser.value("document.getElementById('start').textContent")
    browser.press(" ")
    browser.press("j")
    assert "force" in browser.value("document.getElementById('tip').textContent")
    browser.press("d")
    assert browser.value("document.documentElement.dataset.theme") == "dark"
    browser.value("document.querySelector('.plot canvas').focus()")
    before = browser.value("partita.time()")
    browser.press("ArrowRight")
    assert browser.value("partita.time()") > before
    assert browser.reported == []


def test_events_are_marked_listed_and_jumped_to(browser: Chromium, tmp_path: Path) -> None:
    evil = '<img src=x onerror="document.title = 1">'
    m = rocker()
    wanted = (("one", 1.0), ("zero", 0.0), (evil, -1.0), ("none", 9.0))
    events = [pt.Event(name, "A", value=value) for name, value in wanted]
    times = np.linspace(0.0, 1.8, 181)
    run = m.simulate(1.8, initial=m.assemble(rates={"A": 3.0}), t_eval=times, events=events)
    nearest = [float(times[np.abs(times - event.t).argmin()]) for event in run.events]
    path = viewer.write_html(run, tmp_path / "events.html")
    assert faults(browser, path, fixed_bytes(), screens=LOOKED_AT) == []
    browser.open(path, DESKTOP, at="#still")
    marks = browser.value(
        "[...document.querySelectorAll('#marks i')].map((e) => [e.title, parseFloat(e.style.left), e.ariaLabel])"
    )
    assert [title for title, _, _ in marks] == [label for _, _, label in marks]
    assert [title.split(":")[0] for title, _, _ in marks] == [event.name for event in run.events]
    assert np.allclose([left for _, left, _ in marks], [100 * t / 1.8 for t in nearest], atol=1e-6)
    looks = "['#marks i', '#ticks i'].map((s) => getComputedStyle(document.querySelector(s)).backgroundColor)"
    assert len(set(browser.value(looks))) == 2
    rows = "[...document.querySelectorAll('#happened li')]"
    assert browser.value("document.querySelector('#happened summary').textContent") == f"Events: {len(run.events)}"
    assert browser.value(f"{rows}.map((e) => e.textContent.split(' s: ')[1])") == [event.name for event in run.events]
    # a click in the list and on a mark, and keys to and fro
    browser.value("partita.play(true)")
    browser.value(f"{rows}[2].firstChild.click()")
    assert not browser.value("partita.playing()") and browser.value("partita.time()") == pytest.approx(nearest[2])
    browser.value("document.querySelectorAll('#marks i')[3].click()")
    assert browser.value("partita.time()") == pytest.approx(nearest[3])
    browser.value("partita.show(0); document.activeElement.blur()")
    for expected in nearest:
        browser.press("e")
        assert browser.value("partita.time()") == pytest.approx(expected)
    for expected in nearest[-2::-1]:
        browser.value("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'E', shiftKey: true }))")
        assert browser.value("partita.time()") == pytest.approx(expected)
    assert browser.reported == [] and browser.value("document.title") != "1"


def test_pages_say_what_did_not_happen_and_nothing_where_nothing_was_looked_for(
    browser: Chromium, tmp_path: Path
) -> None:
    m = pt.catalogue.load("four-bar")
    shown = "['#marks', '#happened'].map((s) => document.querySelector(s).checkVisibility())"
    for number, (events, visible) in enumerate((([], [False, False]), ([pt.Event("far", "A", 9.0)], [False, True]))):
        browser.open(viewer.write_html(m.simulate(0.5, events=events), tmp_path / f"{number}.html"))
        assert browser.value(shown) == visible
    assert "far" in browser.value("document.querySelector('#happened').textContent")


def test_very_many_events_are_marked_all_over_the_time_line(browser: Chromium, tmp_path: Path) -> None:
    m, start = oscillators()
    run = m.simulate(1500.0, initial=start, events=[pt.Event("y", "y")], t_eval=np.linspace(0.0, 1500.0, 3001))
    assert len(run.events) > 1400
    browser.open(viewer.write_html(run, tmp_path / "many.html"))
    left = browser.value("[...document.querySelectorAll('#marks i')].map((e) => parseFloat(e.style.left))")
    assert len(left) > 700 and max(b - a for a, b in pairwise(left)) < 1.0 and left[0] < 1.0 and left[-1] > 99.0
    assert "later ones" in browser.value("document.querySelector('#happened').textContent")
    assert browser.reported == []


def test_eighty_coordinates_are_ten_until_asked(browser: Chromium, tmp_path: Path) -> None:
    run = run_of("n-four-bar", loops=80, t_eval=(0.0, 0.05, 0.1))
    path = viewer.write_html(run, tmp_path / "chain.html")
    names = list(run.names.velocities)
    assert len(names) >= 80
    browser.open(path, PHONE)
    shown = (
        "[...document.querySelectorAll('.row')].filter((e) => e.checkVisibility())"
        ".map((e) => e.querySelector('.name').textContent)"
    )
    few = browser.value(shown)
    assert len(few) == 10
    assert {names[i] for i in run.independent[0]} <= set(few)  # what leads now is among them
    browser.value("document.getElementById('search').value = '17'")
    browser.value("document.getElementById('search').dispatchEvent(new Event('input'))")
    assert browser.value(shown) == [name for name in names if "17" in name]
    browser.value("document.getElementById('search').value = ''")
    browser.value("document.getElementById('search').dispatchEvent(new Event('input'))")
    browser.value("document.getElementById('all').click()")
    assert browser.value(shown) == names
    # A bar far down is filled when it is seen.
    browser.value("document.querySelector('.row:last-of-type').scrollIntoView()")
    browser.rest_a_frame()
    value = browser.value("[...document.querySelectorAll('.row')].pop().querySelector('.value').textContent")
    assert value == f"{run.measure[0, -1]:.3f}"


def test_cylinders_stand_beside_each_other(browser: Chromium, tmp_path: Path) -> None:
    path = viewer.write_html(run_of("engine-inline-four"), tmp_path / "engine.html")
    browser.open(path, DESKTOP)
    positions = browser.value("partita.joints().filter((p) => p.name.startsWith('slide')).map((p) => p.x)")
    width = browser.value("partita.size()[0]")
    assert len(positions) == 4
    positions.sort()
    assert min(b - a for a, b in pairwise(positions)) > 0.04 * width


def test_what_a_person_adds_is_drawn(browser: Chromium, tmp_path: Path) -> None:
    """Solids of every kind, points, loads, a name of 60 letters with markup in it: no error, and what is named can be
    told from joint to joint."""
    m = pt.Mechanism("cart", gravity=(0, -9.81, 0))
    cart = m.add_body("cart", mass=5.0, inertia=(1, 1, 1), position=(0, 0.3, 0))
    wheel = m.add_body("wheel", mass=2.0, inertia=(0.1, 0.1, 0.1), position=(0.4, 0.2, 0))
    m.add_prismatic("slide", m.ground, cart, point=(0, 0.3, 0), axis=(1, 0, 0))
    hub = ("<b>" + 6 * "nabe-äöü-❤ ")[:60]
    m.add_revolute(hub, cart, wheel, point=(0.4, 0.2, 0), axis=(0, 0, 1))
    m.add_force(cart, (30.0, 0.0, 0.0), point=(-0.5, 0.0, 0.0), name="push")
    shapes = {
        "cart": [{"kind": "box", "size": (1, 0.25, 0.5)}, {"kind": "ball", "radius": 0.05, "center": (0, 0.3, 0)}],
        "wheel": [{"kind": "wheel", "radius": 0.2, "length": 0.1}, {"kind": "cylinder", "radius": 0.05, "length": 0.4}],
        "ground": [
            {"kind": "plate", "points": [(0, 0, -1), (2, 0, -1), (2, 0, 1), (0, 0, 1)]},
            {"kind": "rod", "start": (0, 0, 0), "end": (0, 1, 0)},
        ],
    }
    path = viewer.write_html(
        m.simulate(1.0), tmp_path / "cart.html", shapes=shapes, points={"P": ("wheel", (0.2, 0, 0))}
    )
    assert faults(browser, path, fixed_bytes(), screens=LOOKED_AT) == []
    assert {"slide", hub, "push", "P"} <= set(browser.value("partita.joints().map((p) => p.name)"))


def test_paths_run_smoothly_through_outputs(browser: Chromium, tmp_path: Path) -> None:
    """A circle of 32 degrees from output to output is a circle, of 80 degrees dots; pages and films draw the same."""
    browser.open(viewer.write_html(run_of("four-bar"), tmp_path / "page.html"))
    t = np.linspace(0.0, 3.0, 41)
    for step, farthest in ((32.0, 0.003), (80.0, 0.0)):
        angle = np.radians(step) * np.arange(41)
        circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * t], axis=1)
        strokes = strokes_of(circle, t, 1e-3)
        assert len(strokes) == (1 if farthest else 41)
        assert np.abs(np.linalg.norm(np.concatenate(strokes), axis=1) - 1.0)[30:-30].max(initial=0.0) <= farthest
        asked = f"partita.strokes({circle.tolist()}, {t.tolist()}, 1e-3)"
        reported = browser.value(f"{asked}.map((s) => s.map(({{ p }}) => p))")
        assert [len(s) for s in reported] == [len(s) for s in strokes]
        assert np.allclose(np.concatenate(reported), np.concatenate(strokes), atol=1e-12)
        assert not is_tangled(strokes, 2.0)
    # A Lissajous figure that closes only after many turns is a tangle.
    s = np.linspace(0.0, 300.0, 6001)
    wild = np.stack([np.cos(s), np.cos(np.sqrt(2) * s), np.cos(np.sqrt(3) * s)], axis=1)
    assert is_tangled(strokes_of(wild, s, 1e-3), 4.0)
    asked = f"partita.strokes({wild[:4000].round(4).tolist()}, {s[:4000].tolist()}, 1e-3)"
    assert browser.value(f"partita.tangled({asked}, 4)") is True


INTERPOLATED = 1.5e-3
"""Of the whole picture: a pixel of 700. The cubic errs by theta^4 / 384: 2e-3 of a crank at 54 degrees an output."""


@pytest.mark.parametrize("name", ["four-bar", "engine-v-twin", "stewart-ups", "heavy-top"])
def test_poses_between_outputs_are_those_of_the_motion(browser: Chromium, tmp_path: Path, name: str) -> None:
    """At instants between the outputs of a page, bodies stand where a run with outputs at these instants has them."""
    entry = entry_of(name)
    coarse = run_of(name)
    pairs = list(zip(coarse.t[:-1], coarse.t[1:], strict=True))[3 :: max(1, len(coarse.t) // 12)]
    between = [float(a + part * (b - a)) for a, b in pairs for part in (0.25, 0.5)]
    fine = entry.simulate(t_eval=sorted({*coarse.t.tolist(), *between}))
    browser.open(viewer.write_html(coarse, tmp_path / "page.html"))
    positions = np.concatenate([coarse.body(body).position for body in coarse.names.bodies])
    size = max(float(np.linalg.norm(np.ptp(positions, axis=0))), 0.1)
    for b, body in enumerate(coarse.names.bodies):
        arm = 0.3 * max(float(np.ptp(coarse.body(body).position, axis=0).max()), 0.1)
        for point in ([0.0, 0.0, 0.0], [arm, 0.0, 0.0], [0.0, arm, 0.0]):
            wanted = fine.body(body).point(point)[np.searchsorted(fine.t, between)]
            shown = browser.value(f"{between}.map((t) => partita.place(t, {b}, {point}))")
            assert np.abs(np.array(shown) - wanted).max() < INTERPOLATED * size, (body, point)


def test_sixty_frames_a_second_and_numbers_of_outputs(browser: Chromium, tmp_path: Path) -> None:
    """A page that plays draws between outputs, more poses than there are outputs; at rest it stands in an output."""
    run = run_of("four-bar")
    browser.open(viewer.write_html(run, tmp_path / "page.html"))
    seen = browser.value(
        "new Promise((done) => { const seen = []; partita.play(true); const each = () => { seen.push(partita.time());"
        " if (seen.length < 60) requestAnimationFrame(each); else { partita.play(false); done([...new Set(seen)]); } };"
        " requestAnimationFrame(each); })"
    )
    shown = (seen[-1] - seen[0]) / np.diff(run.t)[0]
    assert len(seen) > 2 * shown and len(seen) >= 50
    assert np.abs(run.t - browser.value("partita.time()")).min() < 1e-6
    instant = float(0.3 * run.t[4] + 0.7 * run.t[5])
    browser.value(f"partita.between({instant})")
    assert browser.value("partita.time()") == pytest.approx(instant, abs=1e-6)
    kinetic = browser.value("document.querySelector('#readouts div:nth-child(3) dd').textContent")
    assert float(kinetic.split()[0]) == pytest.approx(run.energy.kinetic[5], rel=1e-3)


PAINTED = (
    "(() => { const found = [], all = [...document.querySelectorAll('canvas')];"
    " for (let i = 0; i < 30; i++) { const from = performance.now();"
    " %s;"
    " all.forEach((c) => c.getContext('2d').getImageData(0, 0, 1, 1)); found.push(performance.now() - from); }"
    " return found.sort((a, b) => a - b)[15]; })()"
)
"""Milliseconds that a frame takes, the median of thirty; pixels are waited for."""
STROKES = (
    "(() => { const g = all[0].getContext('2d'); g.save(); g.setTransform(1, 0, 0, 1, 0, 0); g.lineWidth = 3;"
    " for (let k = 0; k < 2000; k++) { const x = (k * 37) % 800, y = (k * 61) % 500;"
    " g.strokeStyle = k % 2 ? '#888' : '#777';"
    " g.beginPath(); g.moveTo(x, y); g.lineTo(x + 40, y + 25); g.arc(x, y, 6, 0, 6); g.stroke(); } g.restore(); })()"
)
"""What frames are measured by: two thousand lines with an arc each, in the same process and minute."""


@pytest.mark.parametrize(("name", "loops"), [("engine-v-twin", None), ("stewart-ups", None), ("n-four-bar", 24)])
def test_frames_are_painted_in_time(browser: Chromium, tmp_path: Path, name: str, loops: int | None) -> None:
    """A frame of up to fifty bodies costs less than two thousand lines, on a renderer without a graphics processor.

    Paths and plots painted anew in each frame took more than ten times that for an engine of a hundred turns.
    """
    run = run_of(name, loops) if loops is None else run_of(name, loops, t_eval=tuple(np.linspace(0.0, 2.0, 41)))
    for screen in (DESKTOP, PHONE):
        browser.open(viewer.write_html(run, tmp_path / "page.html"), screen)
        shown = f"partita.paint({run.t[0]} + {float(run.t[-1] - run.t[0])} * (0.1 + 0.021 * i))"
        took = browser.value(PAINTED % shown)
        drawn = browser.value(PAINTED % STROKES)
        assert took < drawn, (screen, took, drawn)


def test_a_page_inside_another_is_the_drawing_alone(browser: Chromium, tmp_path: Path) -> None:
    path = viewer.write_html(run_of("four-bar"), tmp_path / "page.html")
    for screen in (DESKTOP, PHONE):
        browser.open(path, screen, "light", "?bare#play")
        assert browser.value("partita.playing()")
        shown = "[...document.querySelectorAll('header, aside, #plots, #tools, #slider, #start')].filter((e) =>"
        assert browser.value(f"{shown} e.checkVisibility()).map((e) => e.id)") == ["start"]
        width, height = browser.value("partita.size()")
        assert width > 0.95 * screen[0] and height > 0.9 * screen[1]
        xs = browser.value("partita.joints().map((p) => p.x)")
        assert max(xs) - min(xs) > 0.4 * width
        assert browser.reported == []


def test_bodies_that_turn_far_are_shown_in_outputs_only(browser: Chromium, tmp_path: Path) -> None:
    """Two outputs per turn of a crank say nothing of what lies between: the page jumps, and invents no motion."""
    run = run_of("engine-v-twin", t_eval=tuple(np.linspace(0.0, 1.0, 22)))
    browser.open(viewer.write_html(run, tmp_path / "page.html"))
    for part in (0.2, 0.4, 0.6):
        browser.value(f"partita.between({run.t[6] + part * (run.t[7] - run.t[6])})")
        assert browser.value("partita.time()") == pytest.approx(run.t[6 if part < 0.5 else 7], abs=1e-6)
    assert browser.value("partita.speed()") == pytest.approx(0.1)  # as long as a run of a second is shown, no slower
    assert not browser.value("document.getElementById('spans').checkVisibility()")  # all dots, on all of the run


def test_two_outputs_say_nothing_of_what_lies_between(browser: Chromium, tmp_path: Path) -> None:
    """Neither a line of a plot nor a path joins them."""
    m = pt.catalogue.load("four-bar")
    run = m.simulate(10.0, initial=m.assemble(rates={"A": 6.0}), t_eval=(0.0, 10.0))
    browser.open(viewer.write_html(run, tmp_path / "page.html"))
    assert "from output to output" in browser.value("document.getElementById('note').textContent")
    two = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert [len(s) for s in strokes_of(two, np.array([0.0, 1.0]), 1e-3)] == [1, 1]
    assert browser.value(f"partita.strokes({two.tolist()}, [0, 1], 1e-3).map((s) => s.length)") == [1, 1]


def test_pages_of_modes_claim_no_more_than_the_motion(browser: Chromium, tmp_path: Path) -> None:
    m = pt.catalogue.load("four-bar-spring")
    page = m.linearize(m.equilibrium()).modes().to_html(tmp_path / "mode.html", period=3.0)
    assert faults(browser, page, fixed_bytes(), screens=LOOKED_AT) == []
    assert "shown with a period of 3 s" in browser.value("document.querySelector('h1').textContent")
    assert "the motion is given" in browser.value("document.getElementById('chosen').textContent").lower()
    plotted = browser.value("[...document.querySelectorAll('#add option')].map((e) => e.textContent)")
    assert not any(word in text for text in plotted for word in ("energy", "velocity", "force", "moment"))
    shown = "[...document.querySelectorAll('#tools input')].filter((e) => e.checkVisibility()).map((e) => e.id)"
    assert browser.value(shown) == ["names", "traces"]
    browser.open(Path(m.to_html(tmp_path / "still.html")))
    assert browser.value(shown) == ["names"]  # one position has no paths, no loads


def test_words_keep_off_gaps(browser: Chromium, tmp_path: Path) -> None:
    """A drawing that does not assemble: what is written about a gap does not lie on its line."""
    m = pt.Mechanism("too short")
    crank = m.add_rod("crank", start=(0, 0, 0), end=(0.1, 0.1, 0), mass=0.2)
    coupler = m.add_rod("coupler", start=(0.1, 0.1, 0), end=(0.2, 0.15, 0), mass=0.5)
    rocker = m.add_rod("rocker", start=(0.9, 0, 0), end=(0.8, 0.3, 0), mass=0.4)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, coupler, point=(0.1, 0.1, 0))
    m.add_revolute("C", coupler, rocker, point=(0.2, 0.15, 0), child_point=(0.8, 0.3, 0))
    m.add_revolute("D", m.ground, rocker, point=(0.9, 0, 0))
    page = Path(m.to_html(tmp_path / "gap.html"))
    for screen in (DESKTOP, PHONE):
        browser.open(page, screen)
        ends = {p["name"]: (p["x"], p["y"]) for p in browser.value("partita.joints()")}
        (p, q) = (np.array(ends[f"C on {body}"]) for body in ("coupler", "rocker"))
        on_line = [p + s * (q - p) for s in np.linspace(0.0, 1.0, 400)]
        for word in browser.value("partita.written()"):
            covered = [
                x for x in on_line if word["left"] < x[0] < word["right"] and word["top"] < x[1] < word["bottom"]
            ]
            assert not covered, (screen, word["text"])


@pytest.mark.parametrize("name", ["agile-eye", "double-wishbone", "parallel-ankle", "pantograph"])
def test_words_keep_off_springs(browser: Chromium, tmp_path: Path, name: str) -> None:
    run = run_of(name)
    page = viewer.write_html(run, tmp_path / "page.html")
    found = re.search(r'id="data">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    springs = {spring["name"] for spring in json.loads(found[1])["springs"]}
    assert springs
    for screen in (DESKTOP, PHONE):
        browser.open(page, screen)
        for part in (0.0, 0.37, 1.0):
            browser.value(f"partita.show({run.t[0] + part * (run.t[-1] - run.t[0])})")
            browser.rest_a_frame()
            hits, written = browser.value("[partita.joints(), partita.written()]")
            for spring in springs:
                p, q = (np.array([hit["x"], hit["y"]]) for hit in hits if hit["name"] == spring)
                for x, y in (p + s * (q - p) for s in np.linspace(0.12, 0.88, 100)):
                    for word in written:
                        on_it = word["left"] < x < word["right"] and word["top"] < y < word["bottom"]
                        assert not on_it, (screen, part, word["text"])


def test_notes_on_arrows_are_short_where_the_page_is_narrow(browser: Chromium, tmp_path: Path) -> None:
    page = viewer.write_html(run_of("spatial-four-bar"), tmp_path / "page.html")
    for screen, note in ((DESKTOP, "hollow: not unique, shared by least squares"), (PHONE, "hollow: not unique")):
        browser.open(page, screen)
        written = {word["text"]: word for word in browser.value("partita.written()")}
        assert written[note]["left"] > 0.5 * screen[0]


def test_what_stays_at_the_lower_edge_of_a_phone_is_low(browser: Chromium, tmp_path: Path) -> None:
    """The controls stay in sight while the page scrolls; a note about the outputs does not stay with them."""
    browser.open(viewer.write_html(run_of("heavy-top"), tmp_path / "page.html"), PHONE)
    assert "outputs are kept" in browser.value("document.getElementById('note').textContent")
    assert browser.value("document.querySelector('footer').offsetHeight") < 0.13 * PHONE[1]
    browser.value("scrollTo(0, 1e6)")
    browser.rest_a_frame()
    bottom, top = browser.value(
        "[document.querySelector('footer').getBoundingClientRect().bottom, note.getBoundingClientRect().top]"
    )
    assert bottom <= top < PHONE[1] - 20


@pytest.mark.parametrize(
    ("name", "words"),
    [("engine-v-twin", "1/20 of real time"), ("heavy-top", "of real time"), ("reference-four-bar", "real time")],
)
def test_speeds_let_a_turn_be_followed(browser: Chromium, tmp_path: Path, name: str, words: str) -> None:
    run = run_of(name)
    browser.open(viewer.write_html(run, tmp_path / "page.html"))
    assert browser.value("document.getElementById('speed').selectedOptions[0].text").endswith(words)
    rate = max(float(np.median(np.linalg.norm(run.body(b).angular_velocity, axis=1))) for b in run.names.bodies)
    assert 2 * np.pi / rate / browser.value("partita.speed()") > 1.9  # seconds on the screen that a usual turn takes


@pytest.mark.parametrize("scale", [1e-6, 1e4])
def test_very_small_and_very_large_mechanisms_are_drawn(browser: Chromium, tmp_path: Path, scale: float) -> None:
    """A four-bar of micrometres and one of kilometres look like one of metres, up to what is written."""
    shots = []
    for size in (1.0, scale):
        m = pt.Mechanism("four-bar", gravity=(0, 0, 0))
        corners = [(0.0, 0.0, 0.0), (0.3, 0.9, 0.0), (1.6, 1.3, 0.0), (2.0, 0.0, 0.0)]
        a, b, c, d = ([size * x for x in corner] for corner in corners)
        crank, coupler, rocker = (
            m.add_rod(name, start=p, end=q, mass=1.0)
            for name, p, q in (("crank", a, b), ("coupler", b, c), ("rocker", c, d))
        )
        pins = (
            ("A", m.ground, crank, a),
            ("B", crank, coupler, b),
            ("C", coupler, rocker, c),
            ("D", m.ground, rocker, d),
        )
        for name, one, other, point in pins:
            m.add_revolute(name, one, other, point=point, axis=(0, 0, 1))
        run = m.simulate(1.0, initial=m.assemble(rates={"A": 3.0}))
        assert run.success
        path = viewer.write_html(run, tmp_path / f"{size:g}.html", points={"P": (coupler, [0.5 * size, 0.2 * size, 0])})
        assert faults(browser, path, fixed_bytes(), screens=LOOKED_AT) == []
        browser.open(path, at="#still")
        shots.append(browser.value("partita.joints().map((p) => [p.x, p.y])"))
    assert np.allclose(shots[0], shots[1], atol=0.5)


def test_wheels_of_a_gear_touch_and_mesh() -> None:
    """Pitch circles of all meshes touch, and where they do a tooth of one stands in a gap of the other."""
    checked = 0
    for name in ("gear-pair", "planetary-gear"):
        run = run_of(name)
        found = re.search(r'id="data">(.*?)</script>', viewer.html(run), re.DOTALL)
        assert found is not None
        wheels = json.loads(found[1])["wheels"]
        names = list(run.names.bodies)

        def at(wheel: dict[str, Any], frame: int, word: str, run: Any = run, names: Any = names) -> np.ndarray:
            if wheel["body"] < 0:
                return np.array(wheel[word])
            body = run.body(names[wheel["body"]])
            turned = body.rotation[frame] @ wheel[word]
            return turned + body.position[frame] if word == "center" else turned

        for a, b in combinations(wheels, 2):
            for frame in (0, 7, 61):
                offset = at(b, frame, "center") - at(a, frame, "center")
                apart, inside = float(np.linalg.norm(offset)), a["ring"] or b["ring"]
                if not np.isclose(apart, abs(a["radius"] - b["radius"]) if inside else a["radius"] + b["radius"]):
                    continue
                out = offset / apart * (-1.0 if inside and b["ring"] else 1.0)
                parts = []
                for wheel, contact in ((a, out), (b, out if inside else -out)):
                    first, axis = at(wheel, frame, "first"), at(wheel, frame, "axis")
                    angle = np.arctan2(np.cross(first, contact) @ axis, first @ contact) - wheel["phase"]
                    parts.append(angle * wheel["teeth"] / (2 * np.pi) * (1 if wheel is a or inside else -1))
                gap = (parts[0] - parts[1]) % 1.0
                first_mesh = name == "gear-pair" or not inside  # a planet cannot always suit sun and ring at once
                assert not first_mesh or gap == pytest.approx(0.5, abs=1e-3), (name, frame)
                checked += first_mesh
    assert checked == 3 * (1 + 3)


def main(arguments: list[str]) -> int:
    """Open pages of all of the catalogue, or of the names given; print what is wrong. Pictures go to `--pictures`."""
    parser = argparse.ArgumentParser(prog="test_pages.py", description="animated pages of the catalogue in a browser")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--out", type=Path, default=Path("out/pages"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    wrong = 0
    with Chromium() as opened:
        for name in options.names or pt.catalogue.names():
            path = viewer.write_html(pt.catalogue.entry(name).simulate(), options.out / f"{name}.html")
            found = faults(opened, path, fixed_bytes(), options.out)
            wrong += bool(found)
            print(f"{name}: {path.stat().st_size // 1000} kB" + "".join(f"\n  {word}" for word in found), flush=True)
    print(f"{wrong} pages with something wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))


def test_impulses_flash_where_velocities_jump(browser: Chromium, tmp_path: Path) -> None:
    """A hammer that hits a stop: an arrow of the impulse beside that of the force, at the output next to it alone."""
    m = pt.Mechanism("hammer", gravity=(0, -9.81, 0))
    m.add_rod("hammer", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, "hammer", point=(0, 0, 0))
    m.add_stop("anvil", "A", lower=-1.0, restitution=0.3)
    run = m.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 101))
    hit = run.events[0]
    path = viewer.write_html(run, tmp_path / "impulse.html")
    assert faults(browser, path, fixed_bytes(), screens=LOOKED_AT) == []
    browser.open(path, DESKTOP, at="#still")
    nearest = int(np.abs(run.t - hit.t).argmin())

    def arrows(frame: int) -> int:
        browser.value(f"partita.show({run.t[frame]})")
        return int(browser.value("new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(() => "
                                 "r(partita.arrows().length))))"))  # fmt: skip

    assert (arrows(nearest - 5), arrows(nearest), arrows(nearest + 20)) == (1, 2, 1)
    assert browser.reported == []
