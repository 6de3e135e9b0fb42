"""The live view: what a browser is sent is where the stepper stands."""

import sys
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.viewer import LiveView


def settled(view: LiveView, t: float) -> bool:
    """Whether the last step is shown before long."""
    until = monotonic() + 5.0
    while view.time != t and monotonic() < until:
        sleep(0.01)
    return view.time == t


@pytest.mark.parametrize("name", ["double-wishbone", "slider-crank"])
def test_it_shows_where_the_bodies_are(name: str) -> None:
    """Springs, plates, slides: the last step is shown, bodies are where the run has them, and it is not sent more often
    than anybody sees."""
    sim = pt.catalogue.load(name).stepper(1e-3)
    began = monotonic()
    with sim.show(port=0) as view:
        for _ in range(150):
            sim.step()
        assert settled(view, sim.time)
        assert 2 <= view.sent <= 3 + 61 * (monotonic() - began)
        run = sim.result()
        assert list(view.poses) == list(run.names.bodies)
        for body, (position, turn) in view.poses.items():
            there = run.body(body)
            w, x, y, z = turn
            rotation = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ])  # fmt: skip
            # viser leaves out what nobody sees: a change by less than 1e-5.
            assert np.abs(position - there.position[-1]).max() < 2e-5
            assert np.abs(rotation - there.rotation[-1]).max() < 4e-5
        sim.reset()
        assert settled(view, 0.0)
    assert "closed" in repr(view)
    sim.step()  # without a page it goes on
    assert view.time == 0.0


def test_a_browser_is_sent_the_bodies_and_their_motion(capfd: pytest.CaptureFixture[str]) -> None:
    """A client of the page's own protocol hears where every body is, up to the last step."""
    import viser
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    sim = pt.catalogue.load("four-bar").stepper(1e-3)
    with sim.show(port=0) as view:
        assert view.url in view._repr_html_() and view.url.startswith("http://localhost:")
        address = view.url.replace("http", "ws").replace("localhost", "127.0.0.1")
        with connect(address, subprotocols=[Subprotocol(f"viser-v{viser.__version__}")], max_size=None) as client:
            for _ in range(200):
                sim.step()
            assert settled(view, sim.time)
            wanted, heard = view.poses["coupler"][0], np.full(3, np.nan)
            until = monotonic() + 5.0
            while not np.abs(heard - wanted).max() < 1e-6 and monotonic() < until:
                message = client.recv(timeout=5.0)
                assert isinstance(message, bytes)
                heard = dict(positions(message)).get("/bodies/1 coupler", heard)
            assert np.abs(heard - wanted).max() < 1e-6
    reported = capfd.readouterr()
    assert reported.out == "" and "Traceback" not in reported.err


def positions(message: bytes) -> list[tuple[str, np.ndarray]]:
    """Names and places in a message: a head of two lengths, then msgpack, squeezed."""
    import msgspec
    import zstandard

    reported = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(message[16:]))
    placed = [one for one in reported["messages"] if "name" in one and "position" in one]
    return [(one["name"], np.array(one["position"], dtype=float)) for one in placed]


def test_a_second_page_ends_the_first() -> None:
    sim = pt.catalogue.load("four-bar").stepper(1e-3)
    first = sim.show(port=0)
    with sim.show(port=0, shapes={"crank": {"kind": "box", "size": (0.3, 0.05, 0.05)}}) as second:
        assert "closed" in repr(first) and "closed" not in repr(second)
        first.update()
        first.close()


def test_solids_are_sent_as_they_are_drawn_on_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes, and boxes with their axes."""
    import viser

    sent: dict[str, list[dict[str, Any]]] = {"add_mesh_simple": [], "add_box": []}
    for method, calls in sent.items():
        add = getattr(viser.SceneApi, method)

        def spy(self: Any, name: str, *given: Any, add: Any = add, calls: Any = calls, **more: Any) -> Any:
            calls.append({"name": name, "given": given, **more})
            return add(self, name, *given, **more)

        monkeypatch.setattr(viser.SceneApi, method, spy)
    turn = pt.shapes.Box((0.1, 0.2, 0.3)).at((0.5, 0, 0), (1, 0, 0, 1))
    link = pt.shapes.Plate([(0, 0), (0.4, 0), (0.4, 0.1)], 0.01, holes=[((0.3, 0.04), 0.02)])
    m = pt.Mechanism("solids")
    m.add_solid("arm", turn, material="steel")
    m.add_solid("plate", link, material="PLA")
    for name in m.bodies:
        m.add_revolute(f"J {name}", m.ground, name, point=(0, 0, 0))
    with m.stepper(1e-3).show(port=0):
        (box,), (mesh,) = sent["add_box"], sent["add_mesh_simple"]
        assert box["dimensions"] == (0.1, 0.2, 0.3) and box["position"] == (0.5, 0.0, 0.0)
        assert np.abs(np.abs(box["wxyz"]) - [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]).max() < 1e-12
        points, faces = mesh["given"]
        assert mesh["name"].startswith("/bodies/1 plate/") and len(faces) > 48
        assert points.min(axis=0) == pytest.approx(link.bounds[0]) and points.max(axis=0) == pytest.approx(
            link.bounds[1]
        )


def test_what_is_wrong_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = pt.catalogue.load("four-bar").stepper(1e-3)
    for argument, value in [
        ("host", ""), ("host", 3), ("host", "999.1.1.1"), ("port", -1), ("port", 65536), ("port", "8080"),
        ("port", True), ("port", np.nan), ("shapes", 5), ("shapes", {"crank": {"kind": "cone"}}),
    ]:  # fmt: skip
        given = {"port": 0, argument: value}
        with pytest.raises(pt.errors.ArgumentError) as reported:
            sim.show(**given)  # type: ignore[arg-type]
        assert reported.value.argument == argument
    with pytest.raises(pt.errors.UnknownNameError, match="crank"):
        sim.show(port=0, shapes={"crnk": {"kind": "ball", "radius": 1.0}})
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(pt.errors.MissingDependencyError, match=r"partita\[live\]"):
        sim.show()
    sim.step()
