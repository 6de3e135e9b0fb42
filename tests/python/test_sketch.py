"""Mechanisms drawn with the mouse: what is drawn is what runs, and what cannot be is said."""

import contextlib
import http.client
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import DESKTOP, PHONE, PROGRAM, Chromium
from pages import CONTRAST

import partita as pt
from partita.errors import ArgumentError, DescriptionError
from partita.sketch import drawing_of, mechanism_of, script_of
from partita.sketch.answer import answer
from partita.sketch.drawing import EMPTY
from partita.sketch.server import MOST_BYTES, DrawingPage

TIGHT = {"rtol": 1e-13, "atol": 1e-14}
needs_browser = pytest.mark.skipif(PROGRAM is None, reason="there is no Chromium to draw in")


def drawing(**tables: Any) -> dict[str, Any]:
    """A drawing by its elements, numbered through; places are given by name."""
    data, number, ids = json.loads(json.dumps(EMPTY)), 0, dict[str, int]()
    for table in ("nodes", "bars", "slides", "motors", "springs"):
        for one in tables.get(table, ()):
            number += 1
            ids[one["name"]] = number
            links = {key: ids[one[key]] for key in ("a", "b", "node", "bar", "along") if one.get(key) is not None}
            more = {"more": [ids[x] for x in one["more"]]} if "more" in one else {}
            data[table].append({**one, **links, **more, "id": number})
    return data | {"gravity": tables.get("gravity", 9.81)}


def place(name: str, x: float, y: float, ground: bool = False) -> dict[str, Any]:
    return {"name": name, "x": x, "y": y, "ground": ground}


def bar(name: str, a: str, b: str, *more: str, mass: float = 1.0, length: float | None = None) -> dict[str, Any]:
    return {"name": name, "a": a, "b": b, "more": list(more), "mass": mass, "length": length}


def slide(name: str, node: str, along: str | None) -> dict[str, Any]:
    return {"name": name, "node": node, "along": along, "angle": 0.0, "mass": 0.4}


FOUR = {
    "nodes": [place("A", 0, 0, True), place("B", 0, 0.5), place("C", 1.8, 1.0), place("D", 1.5, 0, True)],
    "bars": [bar("crank", "A", "B"), bar("coupler", "B", "C"), bar("rocker", "D", "C")],
}
SLIDER = {
    "nodes": [place("A", 0, 0, True), place("B", 0, 0.5), place("C", 1.5, 0.0), place("E", 2.5, 0.2)],
    "bars": [bar("crank", "A", "B"), bar("rod", "B", "C")],
    "slides": [slide("guide", "C", None)],
    "motors": [{"name": "motor", "node": "A", "bar": "crank", "rate": 3.0}],
    "springs": [
        {"name": "spring", "a": "C", "b": "E", "stiffness": 40.0, "damping": 1.0, "length": 0.9},
    ],
}
# a slotted lever: the block of the crank slides along the lever
QUICK = {
    "nodes": [place("O", 0, 0, True), place("P", 0, -1, True), place("B", 0.4, 0.1), place("T", 0.7, 0.9)],
    "bars": [bar("crank", "O", "B"), bar("lever", "P", "T")],
    "slides": [slide("slot", "B", "lever")],
    "motors": [{"name": "motor", "node": "O", "bar": "crank", "rate": -2.0}],
}
# crossed bars with a pin on both, a motor between two moving bars
SCISSOR = {
    "nodes": [
        place("A", 0, 0, True),
        place("B", 1, 1),
        place("C", 0, 1),
        place("D", 1, 0),
        place("M", 0.5, 0.5),
    ],
    "bars": [bar("one", "A", "B", "M"), bar("two", "D", "C", "M")],
    "slides": [slide("floor", "D", None)],
    "motors": [{"name": "motor", "node": "M", "bar": "one", "rate": 0.3}],
}
DRAWN = {"four-bar": FOUR, "slider-crank": SLIDER, "quick return": QUICK, "scissor": SCISSOR}


def poses(m: pt.Mechanism, seconds: float) -> np.ndarray:
    run = m.simulate(seconds, **TIGHT)
    assert run.success
    return np.array([[*run.body(b).position[-1], *np.ravel(run.body(b).rotation[-1])] for b in run.names.bodies])


@pytest.mark.parametrize("name", DRAWN)
def test_a_drawing_is_a_mechanism_a_model_file_and_a_script(name: str, tmp_path: Path) -> None:
    """Each moves, and the files move as it does, to the last bit."""
    data = drawing(**DRAWN[name])
    found, m = answer(drawing_of(data)), mechanism_of(drawing_of(data))
    assert found["kind"] == "moves", found["message"]
    assert found["mobility"] == (0 if data["motors"] else 1)
    (tmp_path / "drawing.toml").write_text(found["toml"], encoding="utf-8")
    script = found["python"]
    assert script == script_of(drawing_of(data))
    known = poses(m, 1.0)
    start = np.array([m.bodies[b].mechanism._description.bodies[b].position for b in m.bodies])
    assert np.abs(known[:, :3] - start).max() > 0.05
    assert np.array_equal(poses(pt.load(tmp_path / "drawing.toml"), 1.0), known)
    names: dict[str, Any] = {}
    exec(script.split("run = ")[0], names)  # the script up to its run
    assert np.array_equal(poses(names["m"], 1.0), known)


def test_the_script_runs(tmp_path: Path) -> None:
    (tmp_path / "drawing.py").write_text(script_of(drawing_of(drawing(**SLIDER))), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "drawing.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert ran.returncode == 0, ran.stderr[-1500:]
    assert "reached t = 10" in ran.stdout
    assert (tmp_path / "drawing.html").stat().st_size > 50_000


def test_motors_turn_what_they_name() -> None:
    """The bar, against what it is pinned to, anticlockwise where the rate is above 0."""
    m = mechanism_of(drawing_of(drawing(**SCISSOR)))
    run = m.simulate(0.5)
    turned = {
        name: np.unwrap(np.arctan2(run.body(name).rotation[:, 1, 0], run.body(name).rotation[:, 0, 0]))
        for name in ("one", "two")
    }
    relative = turned["one"] - turned["two"]
    assert relative[-1] - relative[0] == pytest.approx(0.15, abs=1e-9)
    crank = mechanism_of(drawing_of(drawing(**QUICK))).simulate(0.5).body("crank").rotation
    angle = np.arctan2(crank[:, 1, 0], crank[:, 0, 0])
    assert angle[-1] - angle[0] == pytest.approx(-1.0, abs=1e-9)


def test_a_length_is_reached_by_moving() -> None:
    tables = json.loads(json.dumps(FOUR))
    tables["bars"][1]["length"] = 1.7
    data = drawing(**tables)
    closed = answer(drawing_of(data))["closed"]
    at = {node["name"]: np.array(closed[str(node["id"])]) for node in data["nodes"]}
    assert np.linalg.norm(at["C"] - at["B"]) == pytest.approx(1.7, abs=1e-11)
    assert np.linalg.norm(at["B"] - at["A"]) == pytest.approx(0.5, abs=1e-11)
    assert np.linalg.norm(at["C"] - at["D"]) == pytest.approx(np.hypot(0.3, 1.0), abs=1e-11)
    assert list(at["D"]) == [1.5, 0.0]


def test_what_does_not_assemble_is_said_with_its_gap() -> None:
    tables = json.loads(json.dumps(FOUR))
    tables["bars"][1]["length"] = 9.0
    found = answer(drawing_of(drawing(**tables)))
    assert found["kind"] == "open"
    assert 'joint "C"' in found["message"]
    (gap,) = found["gaps"]
    assert gap["label"].startswith("C: ") and gap["label"].endswith(" m apart")
    assert np.linalg.norm(np.subtract(*gap["points"])) == pytest.approx(9.0 - np.hypot(1.8, 0.5), rel=1e-9)
    assert found["toml"] and found["python"]


def test_a_triangle_is_rigid() -> None:
    tables = {
        "nodes": [place("A", 0, 0, True), place("B", 1, 0, True), place("C", 0.5, 1)],
        "bars": [bar("one", "A", "C"), bar("two", "B", "C")],
    }
    found = answer(drawing_of(drawing(**tables)))
    assert found["kind"] == "rigid" and found["mobility"] == 0


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({**FOUR, "motors": [{"name": "m", "node": "B", "bar": None, "rate": 1.0}]}, "no slide at B"),
        (
            {
                "nodes": [place("A", 0, 0), place("B", 1, 0)],
                "bars": [bar("one", "A", "B")],
                "motors": [{"name": "m", "node": "B", "bar": "one", "rate": 1.0}],
            },
            "nothing is pinned at B",
        ),
        ({**FOUR, "slides": [slide("s", "A", None)]}, "held by the ground"),
        ({**FOUR, "slides": [slide("s", "C", "rocker")]}, "a point of the bar"),
        (
            {**SLIDER, "slides": [slide("guide", "C", None), slide("again", "C", None)]},
            "on another slide",
        ),
        (
            {
                **FOUR,
                "springs": [{"name": "s", "a": "A", "b": "D", "stiffness": 1.0, "damping": 0.0, "length": None}],
            },
            "both of its ends are on ground",
        ),
        ({**FOUR, "bars": [bar("one", "A", "A")]}, "has A twice"),
        ({"nodes": [place("A", 0, 0), place("B", 0, 0)], "bars": [bar("one", "A", "B")]}, "a rod needs a length"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(tables: Any, says: str) -> None:
    found = answer(drawing_of(drawing(**tables)))
    assert found["kind"] == "refused"
    assert says in found["message"], found["message"]
    with pytest.raises(DescriptionError):
        mechanism_of(drawing_of(drawing(**tables)))


def spoilt(path: str, value: Any) -> Any:
    data: Any = drawing(**SLIDER)
    *keys, last = path.split(".")
    at = data
    for key in keys:
        at = at[int(key) if isinstance(at, list) else key]
    at[int(last) if isinstance(at, list) else last] = value
    return data


HOSTILE = {
    "a list": [],
    "text": "drawing",
    "a key too many": {**drawing(**FOUR), "__class__": "x"},
    "a key too few": {"nodes": []},
    "text for a number": spoilt("nodes.0.x", "1"),
    "true for a number": spoilt("nodes.0.x", True),
    "not a number": spoilt("nodes.0.x", float("nan")),
    "huge": spoilt("nodes.0.x", 1e300),
    "an unknown place": spoilt("bars.0.a", 99),
    "a bar for a place": spoilt("bars.0.a", 5),
    "an id twice": spoilt("bars.0.id", 1),
    "a name twice": spoilt("bars.0.name", "A"),
    "markup": spoilt("bars.0.name", "<img src=x>"),
    "a quote": spoilt("bars.0.name", 'x"); import os; ("'),
    "the ground": spoilt("bars.0.name", "ground"),
    "a line end": spoilt("bars.0.name", "x\n"),
    "no mass": spoilt("bars.0.mass", 0.0),
    "a negative stiffness": spoilt("springs.0.stiffness", -1.0),
    "too many": {**EMPTY, "nodes": [{"id": i + 1, **place(f"P{i}", i, 0)} for i in range(300)]},
    "an object": spoilt("nodes.0", {"id": 1}),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_data_that_do_not_fit_are_refused_whole(what: str) -> None:
    with pytest.raises(ArgumentError):
        drawing_of(HOSTILE[what])


def ask(page: DrawingPage, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    port = int(page.url.split(":")[2].split("/")[0])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    with contextlib.closing(connection):
        connection.request(method, path, body, {key.replace("_", "-"): x for key, x in headers.items()})
        found = connection.getresponse()
        return found.status, found.read()


def test_only_the_page_is_answered() -> None:
    """The address has a secret, and what comes from elsewhere or is too long is not read."""
    good = json.dumps(drawing(**FOUR)).encode()
    with pt.draw(browser=False) as page:
        root = "/" + page.url.split("/", 3)[3]
        own = page.url.split("/")[2]
        assert page.url.startswith("http://127.0.0.1:")
        status, body = ask(page, "GET", root)
        assert status == 200 and b"connect-src 'self'" in body
        kind = {"Content_Type": "application/json"}
        assert ask(page, "POST", root + "drawing", good, **kind)[0] == 200
        assert list(page.mechanism.bodies) == ["crank", "coupler", "rocker"]
        for path in ("/", "/x/", root[:-2] + "/", root + "../", root + "run/1", root + "etc/passwd"):
            assert ask(page, "GET", path)[0] == 404, path
        assert ask(page, "POST", "/drawing", good, **kind)[0] == 404
        assert ask(page, "POST", root + "drawing", good, **kind, Host=f"evil.example:{own.split(':')[1]}")[0] == 404
        assert ask(page, "POST", root + "drawing", good, **kind, Origin="http://evil.example")[0] == 404
        assert ask(page, "POST", root + "drawing", good, **kind, Origin=f"http://{own}")[0] == 200
        assert ask(page, "POST", root + "drawing", good, Content_Type="text/plain")[0] == 415
        assert ask(page, "POST", root + "drawing", b"{", **kind)[0] == 400
        assert ask(page, "POST", root + "drawing", b"[" * 100_000, **kind)[0] == 400
        assert ask(page, "POST", root + "drawing", b"0", **kind, Content_Length=str(MOST_BYTES + 1))[0] == 413
        assert ask(page, "PUT", root + "drawing", good, **kind)[0] == 501
        status, body = ask(page, "POST", root + "drawing", b'{"nodes": 1}', **kind)
        assert status == 200 and json.loads(body)["kind"] == "refused"
        assert list(page.mechanism.bodies) == ["crank", "coupler", "rocker"]  # as it was
    with pytest.raises(ArgumentError, match="cannot be used"), pt.draw(browser=False) as other:
        pt.draw(port=int(other.url.split(":")[2].split("/")[0]), browser=False)
    for wrong in (-1, 70_000, 1.5, True):
        with pytest.raises(ArgumentError, match="port"):
            pt.draw(port=wrong, browser=False)  # type: ignore[arg-type]


def test_from_the_command_line() -> None:
    command = [sys.executable, "-m", "partita", "draw", "--no-browser"]
    # what ignores Ctrl-C, as jobs in the background do, hands that on to its children
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        running = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, before)
    with running:
        try:
            assert running.stdout is not None
            line = running.stdout.readline()
            assert line.startswith("draw at http://127.0.0.1:")
            port = int(line.split(":")[2].split("/")[0])
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
            connection.request("GET", "/" + line.strip().split("/", 3)[3])
            assert connection.getresponse().status == 200
            connection.close()
            running.send_signal(signal.SIGINT)
            assert running.wait(30) == 0
        finally:
            running.kill()
    bad = subprocess.run([*command, "--port", "x"], capture_output=True, text=True, timeout=60, check=False)
    assert bad.returncode == 2 and "not a whole number" in bad.stderr


# ---- in the browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("there is no Chromium to draw in")
    with Chromium() as one:
        yield one


class User:
    """Someone who draws: places in metres."""

    def __init__(self, browser: Chromium, screen: tuple[int, int, bool] = DESKTOP, scheme: str = "light") -> None:
        self.browser, self.page = browser, pt.draw(browser=False)
        browser.open(self.page.url, screen, scheme)

    def __enter__(self) -> "User":
        return self

    def __exit__(self, *ended: object) -> None:
        self.browser.open("about:blank")
        self.page.close()

    def pixel(self, at: tuple[float, float]) -> tuple[float, float]:
        x, y = self.browser.value(
            f"(() => {{ const p = drawing.picture.pixel({list(at)}), view = document.getElementById('view'),"
            " b = view.getBoundingClientRect(); return [p.x + b.left, p.y + b.top]; })()"
        )
        return x, y

    def tool(self, name: str) -> None:
        self.browser.value(f"document.querySelector('[data-tool={name}]').click()")

    def drag(self, tool: str, *points: tuple[float, float]) -> None:
        self.tool(tool)
        ends = [self.pixel(at) for at in points]
        between = [((2 * a[0] + b[0]) / 3, (2 * a[1] + b[1]) / 3) for a, b in pairwise(ends)]
        self.browser.drag(ends[0], *between, *ends[1:])

    def press(self, name: str) -> None:
        self.browser.value(f"document.getElementById('{name}').click()")

    def put(self, words: str, value: float) -> None:
        self.browser.value(
            f"(() => {{ const x = document.getElementById('field-{words}'); x.value = '{value}';"
            " x.dispatchEvent(new Event('change')); })()"
        )

    def data(self) -> dict[str, Any]:
        found: dict[str, Any] = self.browser.value("drawing.sketch.data")
        return found

    def settled(self) -> None:
        """Until the core has been heard about the drawing as it is."""
        for _ in range(600):
            if not self.browser.value("drawing.link.waiting"):
                return
            self.browser.value("new Promise((r) => setTimeout(r, 50))")
        raise AssertionError("the core was not heard")

    def answer(self) -> dict[str, Any]:
        """What the core says once it has been asked about the drawing as it is."""
        self.browser.value("drawing.link.ask()")
        found: dict[str, Any] = self.browser.value("drawing.answer()")
        return found

    def four_bar(self) -> None:
        self.drag("bar", (0, 0), (0, 0.5))
        self.drag("bar", (0, 0.5), (1.5, 1.0))
        self.drag("bar", (1.5, 1.0), (1.5, 0))
        self.drag("ground", (0, 0))
        self.drag("ground", (1.5, 0))


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
        for a, b in (((0, 0), (0, 0.4)), ((0, 0.4), (1.0, 0.4))):
            user.tool("bar")
            (x0, y0), (x1, y1) = user.pixel(a), user.pixel(b)
            browser.touch([(x0, y0)], [((x0 + x1) / 2, (y0 + y1) / 2)], [(x1, y1)])
        user.tool("ground")
        browser.touch([user.pixel((0, 0))])
        data = user.data()
        positions = [(x["x"], x["y"], x["ground"]) for x in data["nodes"]]
        assert positions == [(0, 0, True), (0, 0.4, False), (1, 0.4, False)]
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
