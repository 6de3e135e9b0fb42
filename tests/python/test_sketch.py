"""Mechanisms drawn with the mouse: what is drawn is what runs, and what cannot be is said."""

import contextlib
import http.client
import json
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sketches import DRAWN, FOUR, QUICK, SCISSOR, SLIDER, bar, drawing, place, poses, slide

import partita as pt
from partita.cli import main
from partita.errors import ArgumentError, DescriptionError
from partita.serving import CONNECTIONS, HOST, MOST_BYTES
from partita.sketch import drawing_of, mechanism_of, script_of, static
from partita.sketch.answer import answer
from partita.sketch.drawing import EMPTY, MOST
from partita.sketch.server import DrawingPage


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


def on_the_wire(page: DrawingPage, content: bytes) -> socket.socket:
    """A connection that has sent this."""
    wire = socket.create_connection((HOST, page._server.server_address[1]), timeout=30)
    wire.sendall(content)
    return wire


def test_slow_connections_keep_nobody_out() -> None:
    """Few are served at a time; one that has not shown yet that it knows the address makes room for a new one."""
    with DrawingPage() as page:
        before = threading.active_count()
        slow = [on_the_wire(page, b"GET /") for _ in range(5 * CONNECTIONS)]
        connection = http.client.HTTPConnection(HOST, page._server.server_address[1], timeout=30)
        path = page.url.split("/", 3)[3]
        connection.request("GET", f"/{path}", headers={"Host": page.url.split("/")[2]})
        assert connection.getresponse().status == 200
        assert len(page._server._open) <= CONNECTIONS
        assert slow[0].recv(1) == b""  # the oldest was closed
        for wire in slow:
            wire.close()
        connection.close()
        end = time.monotonic() + 20
        while threading.active_count() > before and time.monotonic() < end:
            time.sleep(0.05)
        assert threading.active_count() <= before


def test_requests_that_break_off_print_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    reset = struct.pack("ii", 1, 0)
    with DrawingPage() as page:
        host, path = page.url.split("/")[2], page.url.split("/", 3)[3]
        head = f"Host: {host}\r\nContent-Type: application/json\r\n"
        asked = f"GET /{path} HTTP/1.1\r\n{head}\r\n"
        sent = f"POST /{path}drawing HTTP/1.1\r\n{head}Content-Length: 9\r\n\r\n"
        for request in (asked, sent):
            for _ in range(5):
                wire = on_the_wire(page, request.encode())
                wire.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
                wire.close()
        end = time.monotonic() + 20
        while page._server._open and time.monotonic() < end:
            time.sleep(0.05)
        assert not page._server._open
    assert capfd.readouterr() == ("", "")


def test_a_drawing_that_is_out_of_date_is_not_computed() -> None:
    """What is sent last is the drawing, even while another one is examined."""
    with DrawingPage() as page:
        answers: list[dict[str, Any]] = []
        with page._computing:  # as while a large drawing is examined
            asked = [threading.Thread(target=lambda: answers.append(page._judge(drawing(**FOUR)))) for _ in range(3)]
            for one in asked:
                one.start()
            end = time.monotonic() + 20
            while page._asked < 3 and time.monotonic() < end:
                time.sleep(0.01)
            assert len(page.mechanism.bodies) == 3  # nobody waits for the other one
        for one in asked:
            one.join()
        assert sorted(found["kind"] for found in answers) == ["moves", "superseded", "superseded"]


def test_a_drawing_has_few_enough_elements_to_be_examined_at_once() -> None:
    nodes = [place(f"n{i}", float(i), 0.0) for i in range(MOST + 1)]
    with pytest.raises(ArgumentError, match=f"nodes must be a list of at most {MOST}"):
        drawing_of(drawing(nodes=nodes))


def test_without_a_core_for_pages_the_static_page_says_how_to_get_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(static, "MODULE", tmp_path / "none.wasm")
    assert main(["draw", "--static", str(tmp_path / "draw.html")]) == 2
    words = capsys.readouterr().err
    assert "no core for pages" in words and "make web" in words
    assert not (tmp_path / "draw.html").exists()
