"""The page on which mechanisms are drawn, in a browser: mouse, fingers, keys, numbers, undo."""

import json
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import CONTRAST
from sketches import FOUR, User, drawing, poses

import partita as pt

needs_browser = pytest.mark.skipif(PROGRAM is None, reason="there is no Chromium to draw in")


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("there is no Chromium to draw in")
    with Chromium() as one:
        yield one


@needs_browser
def test_a_four_bar_is_drawn_and_runs_as_in_the_core(browser: Chromium, tmp_path: Path) -> None:
    with User(browser) as user:
        user.four_bar()
        found, data = user.answer(), user.data()
        assert [(x["x"], x["y"], x["ground"]) for x in data["nodes"]] == [
            (0, 0, True), (0, 0.5, False), (1.5, 1, False), (1.5, 0, True),
        ]  # fmt: skip
        assert found["kind"] == "moves" and found["mobility"] == 1
        assert user.page.mechanism.compile().mobility == 1
        user.drag("spring", (0.75, 0.75), (0.75, 1.5))  # from the coupler to an anchor of its own
        user.put("stiffness", 60.0)
        user.drag("motor", (0, 0))
        user.put("rate", 2.0)
        assert user.answer()["message"] == "0 degrees of freedom besides 1 motor."
        browser.value("drawing.run()")
        for _ in range(100):
            if browser.value("Boolean(document.getElementById('running').contentWindow.playground)"):
                break
            browser.value("new Promise((r) => setTimeout(r, 100))")
        bodies = browser.value(
            "(() => { const { motion, about } = document.getElementById('running').contentWindow.playground;"
            " motion.accuracy.relative = 1e-13; motion.accuracy.absolute = 1e-14; motion.reset(about.start);"
            " motion.advance(2.0); return [...motion.look().bodies]; })()"
        )
        (tmp_path / "drawing.toml").write_text(user.answer()["toml"], encoding="utf-8")
        known = poses(pt.load(tmp_path / "drawing.toml"), 2.0)
        assert np.abs(np.reshape(bodies, (-1, 12)) - known).max() < 1e-9
        user.press("back")
        assert browser.value("document.getElementById('draw').checkVisibility()")
        assert browser.reported == []


@needs_browser
def test_slides_motors_and_deleting(browser: Chromium) -> None:
    with User(browser) as user:
        user.drag("bar", (0, 0), (0, 0.5))
        user.drag("bar", (0, 0.5), (1.5, 0))
        user.drag("ground", (0, 0))
        user.drag("slide", (1.5, 0), (1.8, 0.02))
        user.drag("motor", (1.5, 0))
        data = user.data()
        assert data["slides"][0] | {"id": 0, "name": ""} == {
            "id": 0, "name": "", "node": data["bars"][1]["b"], "along": None, "angle": 0, "mass": 0.1,
        }  # fmt: skip
        assert data["motors"][0]["bar"] is None
        assert user.answer()["kind"] == "moves"
        user.drag("delete", (0.75, 0.25))  # the second bar; the slide and its motor stay
        assert [len(user.data()[table]) for table in ("nodes", "bars", "slides", "motors")] == [3, 1, 1, 1]
        user.drag("delete", (1.5, 0))
        assert [len(user.data()[table]) for table in ("nodes", "bars", "slides", "motors")] == [2, 1, 0, 0]
        # along a bar
        user.drag("bar", (1, 0.5), (1, -0.5))
        user.drag("slide", (0, 0.5), (1, 0.1))
        data = user.data()
        assert data["slides"][0]["along"] == data["bars"][1]["id"]
        assert browser.reported == []


@needs_browser
def test_moving_merging_undo_and_redo(browser: Chromium) -> None:
    with User(browser) as user:
        states = [user.data()]
        user.drag("bar", (0, 0), (0, 1))
        states.append(user.data())
        user.drag("bar", (1, 0), (1, 1))
        states.append(user.data())
        user.drag("pin", (0, 0.5))
        states.append(user.data())
        user.drag("select", (0, 1), (0.5, 1))  # the pin on the bar goes along
        states.append(user.data())
        pin = next(node for node in states[-1]["nodes"] if node["name"] == "E")
        assert (pin["x"], pin["y"]) == (pytest.approx(0.25), pytest.approx(0.5))
        user.drag("select", (1, 1), (0.5, 1))  # dropped on another: one place
        states.append(user.data())
        assert len(states[-1]["nodes"]) == 4 and states[-1]["bars"][1]["b"] == states[-1]["bars"][0]["b"]
        user.drag("select", (1, 0.0))
        browser.value("document.activeElement.blur()")
        browser.press("ArrowRight")
        browser.press("ArrowRight")  # one change
        states.append(user.data())
        assert states[-1] != states[-2]
        user.press("remove")
        states.append(user.data())
        assert len(states[-1]["bars"]) == 1
        for before in reversed(states[:-1]):
            user.press("undo")
            assert user.data() == before
        assert browser.value("document.getElementById('undo').disabled")
        for after in states[1:]:
            user.press("redo")
            assert user.data() == after
        assert browser.value("document.getElementById('redo').disabled")
        # a change that changes nothing leaves nothing to be undone, and what could be redone
        user.press("undo")
        count = browser.value("[drawing.sketch.past.length, drawing.sketch.future.length]")
        user.drag("bar", (0, 0), (0, 0.01))
        user.drag("select", (0, 0))
        user.put("x", 0.0)
        assert browser.value("[drawing.sketch.past.length, drawing.sketch.future.length]") == count
        assert browser.reported == []


@needs_browser
def test_lengths_are_typed_and_gaps_drawn(browser: Chromium) -> None:
    with User(browser) as user:
        user.four_bar()
        user.drag("select", (0.75, 0.75))
        user.put("length", 1.75)
        user.settled()
        b, c = (browser.value(f"drawing.sketch.node({i})") for i in (2, 4))
        assert np.hypot(c["x"] - b["x"], c["y"] - b["y"]) == pytest.approx(1.75, abs=1e-9)
        assert user.data()["bars"][1]["length"] is None
        user.put("length", 9.0)
        user.settled()
        message = browser.value(
            "(({ textContent, dataset }) => [textContent, dataset.kind])(document.getElementById('said'))"
        )
        assert 'joint "C"' in message[0] and message[1] == "open"
        assert browser.value("document.getElementById('run').disabled")
        (label,) = browser.value("drawing.picture.gaps.map(({ label }) => label)")
        assert label in browser.value("drawing.picture.labels.written.map(({ text }) => text)")
        user.press("undo")
        assert user.answer()["kind"] == "moves" and browser.value("drawing.picture.gaps.length") == 0
        user.put("length", -1.0)
        assert "above 0" in browser.value("document.getElementById('said').textContent")
        assert browser.reported == []


@needs_browser
def test_files_are_shown_and_a_page_loaded_anew_has_the_drawing(browser: Chromium) -> None:
    with User(browser) as user:
        user.four_bar()
        found = user.answer()
        for kind in ("toml", "python"):
            user.press(kind)
            assert browser.value("document.getElementById('text').value") == found[kind]
            user.press("close")
        data = user.data()
        browser.open(user.page.url)
        assert user.data() == data
        user.press("clear")
        assert user.answer()["kind"] == "empty"
        assert browser.reported == []


@needs_browser
def test_a_finger_draws_and_two_move_the_view(browser: Chromium) -> None:
    with User(browser, PHONE) as user:
        for a, b in (((0, 0), (0, 0.5)), ((0, 0.5), (1.0, 0.5))):
            user.tool("bar")
            (x0, y0), (x1, y1) = user.pixel(a), user.pixel(b)
            browser.touch([(x0, y0)], [((x0 + x1) / 2, (y0 + y1) / 2)], [(x1, y1)])
        user.tool("ground")
        browser.touch([user.pixel((0, 0))])
        data = user.data()
        positions = [(x["x"], x["y"], x["ground"]) for x in data["nodes"]]
        assert positions == [(0, 0, True), (0, 0.5, False), (1, 0.5, False)]
        assert user.answer()["mobility"] == 2
        scale = browser.value("drawing.picture.camera.scale")
        x, y = user.pixel((0.5, 0.2))
        browser.touch([(x - 20, y), (x + 20, y)], [(x - 40, y), (x + 40, y)], [(x - 60, y), (x + 60, y)])
        assert browser.value("drawing.picture.camera.scale") > 1.5 * scale
        assert user.data() == data
        assert browser.reported == []


@needs_browser
@pytest.mark.parametrize("screen", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_has_contrast_and_fits(browser: Chromium, screen: tuple[int, int, bool], scheme: str) -> None:
    with User(browser, screen, scheme) as user:
        user.four_bar() if not screen[2] else None
        user.answer()
        assert browser.value(CONTRAST) == []
        wide = browser.value("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]
        assert browser.reported == []


@needs_browser
def test_why_a_drawing_does_not_close_is_read_whole_on_a_phone(browser: Chromium) -> None:
    four = drawing(**FOUR)
    four["bars"][1]["length"] = 9.0
    with User(browser, PHONE) as user:
        browser.value(f"drawing.sketch.data = {json.dumps(four)}")
        assert 'joint "C"' in user.answer()["message"]
        user.settled()
        browser.rest_a_frame()
        shown, needed = browser.value("(({ clientHeight, scrollHeight }) => [clientHeight, scrollHeight])(said)")
        assert needed <= shown


@needs_browser
def test_words_keep_clear_of_motors_and_ground(browser: Chromium) -> None:
    with User(browser) as user:
        user.four_bar()
        user.drag("motor", (0, 0))
        user.settled()
        browser.rest_a_frame()
        written = {x["text"]: x for x in browser.value("drawing.picture.labels.written")}
        for name, at in {"A": (0, 0), "D": (1.5, 0)}.items():
            x, y = browser.value(f"(() => {{ const p = drawing.picture.pixel({list(at)}); return [p.x, p.y]; }})()")
            box = written[name]
            assert box["right"] < x - 17 or box["left"] > x + 17 or box["bottom"] < y - 8 or box["top"] > y + 30


@needs_browser
def test_undo_forgets_a_line_that_was_begun(browser: Chromium) -> None:
    """What a line began at may be gone with the change that is taken back."""
    with User(browser) as user:
        user.drag("bar", (0, 0), (1, 0))
        user.drag("bar", (1, 0))  # a click: the next one is the end
        user.press("undo")
        assert user.data()["bars"] == []
        browser.drag(user.pixel((1, 1)))
        assert user.data()["bars"] == []  # it began a line anew
        browser.drag(user.pixel((0, 1)))
        (bar,) = user.data()["bars"]
        ends = {node["id"]: (node["x"], node["y"]) for node in user.data()["nodes"]}
        assert [ends[bar["a"]], ends[bar["b"]]] == [(1, 1), (0, 1)]
        # a point that is dragged while it goes
        user.tool("select")
        x, y = user.pixel((0, 1))
        browser.mouse("mousePressed", (x, y), True)
        browser.mouse("mouseMoved", (x + 40, y), True)
        user.press("undo")
        user.press("undo")
        browser.mouse("mouseMoved", (x + 80, y), True)
        browser.mouse("mouseReleased", (x + 80, y), False)
        assert user.data()["nodes"] == []
        assert browser.reported == []


@needs_browser
def test_other_buttons_and_fingers_that_rest_draw_nothing(browser: Chromium) -> None:
    with User(browser) as user:
        user.four_bar()
        data = user.data()
        for tool in ("delete", "ground", "motor", "pin"):
            user.tool(tool)
            browser.drag(user.pixel((0, 0.5)), button="right")
            assert user.data() == data, tool
    with User(browser, PHONE) as user:
        user.tool("bar")
        (x0, y0), (x1, y1) = user.pixel((0, 0)), user.pixel((1, 0))
        browser.touch([(x0, y0)], [(x0 + 30, y0)], [(x1, y1)])
        data = user.data()
        user.tool("delete")
        x, y = user.pixel((0.5, 0))
        # the second finger moves, the first rests on the bar and is lifted last
        browser.touch([(x, y)], [(x, y), (x + 60, y + 60)], [(x, y), (x + 90, y + 90)], [(x, y)])
        assert user.data() == data and len(data["bars"]) == 1
        assert browser.reported == []


@needs_browser
def test_what_is_on_bars_stays_on_them(browser: Chromium) -> None:
    with User(browser) as user:
        user.drag("bar", (0, 0), (1, 1))
        user.drag("bar", (0, 1), (1, 0))
        user.drag("pin", (0.52, 0.5))
        data = user.data()
        pin = data["nodes"][-1]
        assert (pin["x"], pin["y"]) == (pytest.approx(0.5), pytest.approx(0.5))
        assert [bar["more"] for bar in data["bars"]] == [[pin["id"]]] * 2
        before = browser.value("drawing.sketch.past.length")
        user.drag("select", (0.5, 0.5), (0.9, 0.9))  # it is where they cross
        assert user.data() == data and browser.value("drawing.sketch.past.length") == before
        user.drag("select", (1, 1), (1.5, 1))
        cross = next(node for node in user.data()["nodes"] if node["id"] == pin["id"])
        assert (cross["x"], cross["y"]) == (pytest.approx(0.6), pytest.approx(0.4))
        # bars that cross far from the pointer are not pinned to each other there
        user.press("clear")
        user.drag("bar", (0, 0), (2, 0))
        browser.value(
            "drawing.sketch.data.bars.push({...drawing.sketch.data.bars[0], id: 90, name: 'low', more: [],"
            " a: drawing.sketch.addNode([0, -0.004]).id, b: drawing.sketch.addNode([2, 0.0005]).id})"
        )
        user.drag("pin", (0.5, 0.0))
        pin = user.data()["nodes"][-1]
        assert pin["x"] == pytest.approx(0.5, abs=0.01) and abs(pin["y"]) < 0.01
        assert sum(pin["id"] in bar["more"] for bar in user.data()["bars"]) == 1
        assert browser.reported == []


@needs_browser
def test_points_that_cannot_become_one_stay_apart(browser: Chromium) -> None:
    """Two points that lie upon each other look like a pin; what cannot be one is put back, with the reason."""
    with User(browser) as user:
        user.drag("bar", (0, 0), (1, 0))
        user.drag("bar", (1, 1), (0, 1))
        user.drag("slide", (0, 1), (0.5, 0))
        data = user.data()
        assert data["slides"][0]["along"] == data["bars"][0]["id"]
        hint = "document.getElementById('hint').textContent"
        for at, to, why in [((1, 0), (0, 0), "points of bar 1"), ((0, 1), (1, 0), "slides along a bar of the other")]:
            user.drag("select", at, to)
            assert why in browser.value(hint)
            assert user.data() == data
        # a pin on a bar that is dropped beside it, on another point: that one comes to the bar
        user.press("clear")
        user.drag("bar", (0, 0), (1, 0))
        user.drag("pin", (0.5, 0))
        user.drag("bar", (0.75, 0.5), (1.5, 0.5))
        end = user.data()["bars"][1]["a"]
        browser.value(f"drawing.sketch.move({end}, [0.75, 0.02])")
        user.drag("select", (0.5, 0), (0.75, 0.02))
        data = user.data()
        assert data["bars"][0]["more"] == [data["bars"][1]["a"]]
        joint = next(node for node in data["nodes"] if node["id"] == data["bars"][1]["a"])
        assert joint["y"] == pytest.approx(0, abs=1e-12) and joint["x"] == pytest.approx(0.75, abs=0.06)  # a grid point
        assert browser.reported == []


@needs_browser
def test_numbers_keep_the_keyboard(browser: Chromium) -> None:
    """Tab goes from a number to the next one although the change is carried out between, and again after undo."""
    with User(browser) as user:
        user.drag("bar", (0, 0), (1, 0))
        user.drag("select", (0.5, 0))
        browser.value("document.getElementById('field-length').focus()")
        browser.value("document.getElementById('field-length').select()")
        for key in "2.5":
            browser.press(key)
        browser.press("Tab")
        assert browser.value("document.activeElement.id") == "field-mass"
        assert user.data()["bars"][0]["length"] == 2.5
        for key in "7":
            browser.press(key)
        user.settled()  # the answer moves the nodes; what is being typed stays
        assert browser.value("document.activeElement.value").endswith("7")
        browser.press("Tab")
        assert user.data()["bars"][0]["mass"] != 1.0
        user.press("undo")
        assert browser.value("document.getElementById('field-mass').value") == "1"
        user.put("mass", 4.0)  # of the element that undo put in place of the other
        assert user.data()["bars"][0]["mass"] == 4.0
        # gravity that is no number is said, and undo clears the mark
        browser.value("(() => { const g = document.getElementById('gravity'); g.value = ''; "
                      "g.dispatchEvent(new Event('change')); })()")  # fmt: skip
        assert "gravity needs a number" in browser.value("document.getElementById('said').textContent")
        user.press("undo")
        assert not browser.value("document.getElementById('gravity').classList.contains('bad')")
        assert browser.reported == []


@needs_browser
@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_small_and_large_drawings_fill_the_page(browser: Chromium, size: float) -> None:
    with User(browser) as user:
        user.four_bar()
        browser.value(
            f"drawing.sketch.data.nodes.forEach((n) => {{ n.x *= {size}; n.y *= {size}; }}),"
            "document.getElementById('reset').click()"
        )
        xs = [user.pixel((x, 0))[0] for x in (0, 1.5 * size)]
        ys = [user.pixel((0, y))[1] for y in (size, 0)]
        width, height = browser.value("[drawing.picture.camera.width, drawing.picture.camera.height]")
        assert max((xs[1] - xs[0]) / width, (ys[1] - ys[0]) / height) > 0.4
        cell = browser.value("drawing.picture.cell")
        assert f"{cell / 10 ** np.floor(np.log10(cell) + 1e-9):.6g}" in ("1", "2", "5")
        # zooming has ends, at which all is still finite
        for key in ("-", "+"):
            for _ in range(200):
                browser.press(key)
            assert browser.value("Number.isFinite(drawing.picture.cell) && drawing.picture.cell > 0")
            assert np.isfinite(user.pixel((0, 0))).all()
        assert browser.reported == []


@needs_browser
def test_slides_on_bars_and_their_motors_are_picked(browser: Chromium) -> None:
    with User(browser) as user:
        user.drag("bar", (0, 0), (2, 0))
        user.drag("bar", (1, 0.5), (1, 1.5))
        user.drag("slide", (1, 0.5), (1, 0))
        user.drag("motor", (1, 0.5))
        slide, motor = user.data()["slides"][0], user.data()["motors"][0]
        assert slide["along"] is not None and motor["bar"] is None
        user.tool("select")
        x, y = user.pixel((1, 0.5))
        browser.drag((x + 12, y))
        assert browser.value("drawing.picture.selected") == slide["id"]
        browser.drag((x - 30, y + 20.4))
        assert browser.value("drawing.picture.selected") == motor["id"]
        browser.drag((x, y))
        assert browser.value("drawing.picture.selected") == slide["node"]
        user.tool("delete")
        browser.drag((x + 12, y))
        data = user.data()
        assert (len(data["slides"]), len(data["motors"]), len(data["bars"])) == (0, 0, 2)
        assert browser.reported == []


@needs_browser
def test_one_question_at_a_time(browser: Chromium) -> None:
    """While the core answers, the drawings in between are not sent; the last one is."""
    with User(browser):
        sent = browser.value(
            "(async () => { const { link } = drawing, post = link.post.bind(link); let sent = 0, open = 0, most = 0;"
            " await link.ask();"  # what the page asks by itself when it is opened
            " link.post = async (what) => { sent += 1; most = Math.max(most, ++open);"
            " await new Promise((r) => setTimeout(r, 50)); const found = await post(what); open -= 1; return found; };"
            " const first = link.ask(); await new Promise((r) => setTimeout(r, 10));"
            " await Promise.all([first, ...[1, 2, 3, 4].map(() => link.ask())]); "
            " return [sent, most, link.waiting]; })()"
        )
        assert sent == [2, 1, False]
        assert browser.reported == []


LOOKS_JOINED = 4.0
"""Pixels: a point that is drawn nearer to another, or to the line of a bar, looks as if it were one with it."""
GEOMETRY = (
    "(({ data }, { picture }) => ({ nodes: Object.fromEntries(data.nodes.map(({ id }) => {"
    " const p = picture.pixelOf(id); return [id, [p.x, p.y]]; })),"
    " bars: data.bars.map(({ a, b, more }) => [a, b, ...more]), slides: data.slides.length }))(drawing.sketch, drawing)"
)


def not_joined(seen: dict[str, Any]) -> list[str]:
    """What looks joined in a picture and is not: points upon each other that no bar holds both, points on bars."""
    at = {int(node): np.array(p) for node, p in seen["nodes"].items()}
    held = [set(nodes) for nodes in seen["bars"]]
    found = [
        f"nodes {i} and {j}"
        for i, j in combinations(at, 2)
        if np.hypot(*(at[i] - at[j])) < LOOKS_JOINED and not any({i, j} <= nodes for nodes in held)
    ]
    for nodes in seen["bars"]:
        a, u = at[nodes[0]], at[nodes[1]] - at[nodes[0]]
        for i in at.keys() - set(nodes):
            foot = a + np.clip((at[i] - a) @ u / (u @ u), 0.0, 1.0) * u
            if np.hypot(*(at[i] - foot)) < LOOKS_JOINED:
                found.append(f"node {i} and the bar of {nodes}")
    return found


def come_apart(user: User) -> float:
    """How far points that bars share come apart in a run of the mechanism [m]."""
    m, data = user.page.mechanism, user.data()
    run = m.simulate(0.2, t_eval=[0.0, 0.2], rtol=1e-9)
    assert run.success
    at = {node["id"]: (node["x"], node["y"], 0.0) for node in data["nodes"]}
    apart = 0.0
    for node, point in at.items():
        held = [bar["name"] for bar in data["bars"] if node in (bar["a"], bar["b"], *bar["more"])]
        ends = [run.body(name).point(m.bodies[name].world(point)[1])[-1] for name in held]
        ends += [np.array(point)] * next(x["ground"] for x in data["nodes"] if x["id"] == node)
        apart = max([apart, *(float(np.abs(end - ends[0]).max()) for end in ends)])
    return apart


@needs_browser
def test_what_looks_joined_is_joined_in_a_hundred_drawings(browser: Chromium) -> None:
    """Bars drawn by someone who aims at points and bars that are there, and misses by half a cell of the grid."""
    rng = np.random.default_rng(58)
    shared = 0
    with User(browser) as user:
        for number in range(100):
            user.press("clear")
            width, height = browser.value("[drawing.picture.camera.width, drawing.picture.camera.height]")
            box = browser.value(
                "(({ left, top }) => [left, top])(document.getElementById('view').getBoundingClientRect())"
            )
            low, high = np.array([60.0, 130.0]), np.array([width - 60.0, height - 60.0])
            points = [low + rng.random(2) * (high - low)]

            def aim(points: list[Any] = points, low: Any = low, high: Any = high) -> Any:
                at = points[rng.integers(len(points))] + rng.uniform(-24.0, 24.0, 2)
                if rng.random() < 0.3:
                    at = 0.5 * (at + points[rng.integers(len(points))])  # on a bar, perhaps
                if rng.random() < 0.4:
                    at = low + rng.random(2) * (high - low)
                return np.clip(at, low, high)

            def by_pointer(name: str, *pixels: Any, corner: Any = box) -> None:
                user.tool(name)
                browser.drag(*((float(x + corner[0]), float(y + corner[1])) for x, y in pixels))

            for _ in range(rng.integers(2, 5)):
                ends = [aim(), aim()]
                by_pointer("bar", *ends)
                points += ends
            by_pointer("ground", aim())
            if number % 2:
                start = aim()
                by_pointer("select", start, 0.5 * (start + points[-1]), aim())
            seen = browser.value(GEOMETRY)
            assert not_joined(seen) == [], number
            shared += sum(sum(node in bar for bar in seen["bars"]) > 1 for node in map(int, seen["nodes"]))
            if seen["bars"] and number % 5 == 0:
                assert user.answer()["kind"] in ("moves", "rigid"), number
                assert come_apart(user) < 1e-6, number
        assert browser.reported == []
    assert shared > 100  # many did aim at what was there


@needs_browser
def test_points_typed_or_moved_by_keys_onto_others_are_joined(browser: Chromium) -> None:
    with User(browser) as user:
        user.drag("bar", (0, 0), (0.5, 0))
        user.drag("bar", (1, 0.5), (1, 1))
        user.drag("select", (1, 0.5))
        user.put("x", 0.5)
        assert len(user.data()["nodes"]) == 4
        user.put("y", 0.0)
        data = user.data()
        assert len(data["nodes"]) == 3 and data["bars"][1]["a"] == data["bars"][0]["b"]
        user.press("undo")
        user.put("y", 1e-4)  # a tenth of a millimetre beside it is meant, though it cannot be seen here
        assert len(user.data()["nodes"]) == 4
        user.press("clear")
        user.drag("bar", (0, 0), (1, 0))
        user.drag("bar", (0.5, 0.5), (0.5, 1))
        user.drag("select", (0.5, 0.5))
        browser.value("document.activeElement.blur()")
        for _ in range(20):
            browser.press("ArrowDown")
            if user.data()["bars"][0]["more"]:
                break
        (pin,) = user.data()["bars"][0]["more"]
        assert user.data()["bars"][1]["a"] == pin
        assert browser.reported == []


@needs_browser
def test_a_new_drawing_is_seen_whole(browser: Chromium) -> None:
    with User(browser) as user:
        first = browser.value("drawing.picture.camera.scale")
        user.drag("bar", (0, 0), (1, 0))
        for _ in range(12):
            browser.press("+")
        assert browser.value("drawing.picture.camera.scale") > 5 * first
        user.press("clear")
        assert browser.value("drawing.picture.camera.scale") == pytest.approx(first)


@needs_browser
def test_degrees_of_freedom_are_those_in_the_plane(browser: Chromium) -> None:
    """Three bars, two of them pinned to each other: 3 in the plane each, less 2 for the pin; none of it in calls."""
    with User(browser) as user:
        user.drag("bar", (0, 0), (0.5, 0.5))
        user.drag("bar", (0.5, 0.5), (1, 0))
        user.drag("bar", (1.5, 0), (1.5, 1))
        found = user.answer()
        assert found["message"] == "7 degrees of freedom." and found["mobility"] == 7
        assert not [remark for remark in found["remarks"] if "add_" in remark or "m." in remark.split()]
        user.drag("ground", (0, 0))
        assert user.answer()["mobility"] == 5
        user.drag("slide", (1.5, 0), (1.9, 0))
        assert user.answer()["mobility"] == 4


@needs_browser
def test_bars_of_a_phone_cover_neither_the_drawing_nor_the_run(browser: Chromium) -> None:
    with User(browser, PHONE) as user:
        user.four_bar()
        user.settled()
        boxes = (
            "['footer', '#stage'].map((e) => document.querySelector(e).getBoundingClientRect())"
            ".map(({ top, bottom }) => [top, bottom])"
        )
        footer, stage = browser.value(boxes)
        assert footer[0] >= stage[1] - 1
        browser.value("drawing.run()")
        browser.rest_a_frame()
        (top, bottom), _ = browser.value(boxes)
        assert bottom == browser.value("innerHeight") and bottom - top < 60
