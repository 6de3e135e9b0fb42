"""The animation page: one file that loads nothing, states what it left out, and cannot be broken by a name."""

import re
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_runs import Fake, at, data, four_bar, pendulum, placed, turned, unpacked

import partita as pt
from partita import viewer
from partita.errors import ArgumentError, FileFormatError, MissingFileError
from partita.viewer.geometry import outline, view
from partita.viewer.packing import MOST_FRAMES


def test_page_loads_nothing(tmp_path: Path) -> None:
    page = viewer.write_html(four_bar(), tmp_path / "run.html").read_text("utf-8")
    for way_out in ("http:", "https:", "src=", "url(", "@import", "<link", "fetch(", "XMLHttpRequest", "import("):
        assert way_out not in page, way_out
    assert "default-src 'none'" in page
    assert "{{" not in page
    assert len(page) < 176_000


def test_scripts_never_write_markup() -> None:
    page = viewer.html(four_bar())
    for danger in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
        assert danger not in page


def test_names_cannot_carry_markup() -> None:
    evil = '</script><img src=x onerror="alert(1)">{{DATA}}'
    fake = four_bar()
    fake.names.velocities[0] = evil
    fake.summary["joints"][0]["name"] = evil
    page = viewer.html(fake, title=evil)
    assert "<img" not in page and page.count("</script>") == 2
    scene = data(page)
    assert scene["velocities"][0] == scene["joints"][0]["name"] == scene["title"] == evil
    heading = re.search(r"<h1>(.*?)</h1>", page)
    assert heading is not None and unescape(heading[1]) == evil


def test_page_knows_what_was_left_out() -> None:
    scene = data(viewer.html(pendulum(nt=3200)))
    assert (scene["outputs"], scene["frames"]) == (3200, MOST_FRAMES)


@pytest.mark.parametrize(
    ("points", "com", "kind", "count"),
    [
        ([], (0, 0, 0), "ball", 1),
        ([(0, 0, 0)], (0, 0, 0), "ball", 1),
        ([(0, 0, 0)], (0, -1, 0), "hammer", 2),
        ([(0, 0, 0), (1, 0, 0), (1, 0, 1e-9)], (0, 0, 0), "rod", 2),
        ([(0, 0, 0), (2, 0, 0), (1, 0, 0)], (0, 0, 0), "rod", 2),
        ([(0, 0, 0), (2, 0, 0), (0, 1, 0)], (0, 0, 0), "plate", 3),
        ([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (1, 1, 0)], (0, 0, 0), "plate", 4),
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], (0, 0, 0), "star", 5),
    ],
)
def test_shape_follows_the_points(points: list[Any], com: Any, kind: str, count: int) -> None:
    figure = outline(np.array(points, dtype=float).reshape(-1, 3), np.array(com, dtype=float), 1.0)
    assert (figure["kind"], len(figure["points"])) == (kind, count)


@pytest.mark.parametrize(
    ("gravity", "normal", "right", "up"),
    [
        ((0, -9.81, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((0, -9.81, 0), (0, 0, -1), (1, 0, 0), (0, 1, 0)),
        ((0, 0, -9.81), (0, 1, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, -9.81), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (None, (0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((0, 0, -9.81), (0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ],
)
def test_planar_mechanisms_are_seen_face_on(gravity: Any, normal: Any, right: Any, up: Any) -> None:
    g = None if gravity is None else np.array(gravity, dtype=float)
    seen = view(np.zeros((1, 3)), g, np.array(normal, dtype=float))
    assert np.allclose(seen["right"], right) and np.allclose(seen["up"], up)
    assert np.allclose(np.cross(seen["right"], seen["up"]), seen["back"])
    assert seen["azimuth"] == seen["elevation"] == 0.0


@pytest.mark.parametrize("gravity", [(0, -9.81, 0), (0, 0, -1), (-1, 2, 3)])
def test_spatial_mechanisms_are_seen_from_aside(gravity: Any) -> None:
    cloud = np.random.default_rng(1).normal(size=(20, 3))
    seen = view(cloud, np.array(gravity, dtype=float), None)
    assert np.allclose(np.array(seen["up"]) * np.linalg.norm(gravity), -np.array(gravity), atol=1e-6)
    assert np.allclose(np.cross(seen["right"], seen["up"]), seen["back"], atol=1e-6)
    assert seen["elevation"] > 0 and abs(seen["azimuth"]) > 0.3


def test_choices_and_switches() -> None:
    independent = np.array([[0], [0], [2], [2], [1]])
    log = [
        SimpleNamespace(t=0.0, entering=(), leaving=(), reason="first"),
        SimpleNamespace(t=1.9, entering=("C",), leaving=("A",), reason="why"),
        SimpleNamespace(t=4.8, entering=("B",), leaving=("C",), reason="why"),
    ]
    scene = data(viewer.html(four_bar(nt=5, independent=independent, partitions=log)))
    assert scene["independent"] == [[0, [0]], [2, [2]], [4, [1]]]
    assert scene["switchCount"] == 2
    assert [s["t"] for s in scene["switches"]] == [1.9, 4.8]
    assert scene["switches"][0]["entering"] == ["C"]


def occurred(times: Any, name: str = "top") -> list[Any]:
    return [SimpleNamespace(t=float(t), name=name, direction=1) for t in times]


def test_events_of_a_page() -> None:
    evil = "</script><b>top</b>"
    page = viewer.html(four_bar(events=[*occurred([1.9]), *occurred([4.8], evil), *occurred([4.9])]))
    assert "<b>top" not in page
    assert data(page)["events"] == {"names": ["top", evil], "count": 3, "rows": [[1.9, 0, 1], [4.8, 1, 1], [4.9, 0, 1]]}
    assert data(viewer.html(four_bar()))["events"] == {"names": [], "count": 0, "rows": []}


def test_a_hundred_thousand_events_make_a_small_page() -> None:
    """The first ones are listed; behind them every part of the run that has some has one."""
    times = np.linspace(0.0, 5.0, 100_000)
    page = viewer.html(four_bar(nt=500, events=occurred(times)))
    found = data(page)["events"]
    shown = [row[0] for row in found["rows"]]
    assert found["count"] == 100_000 and shown[:400] == times[:400].tolist()
    assert 1300 < len(shown) <= 1401 and shown == sorted(shown) and np.max(np.diff(shown[400:])) < 2 * 5.0 / 1000
    assert len(page) - len(viewer.html(four_bar(nt=500))) < 50_000


def test_what_is_not_unique_is_marked() -> None:
    """Of a force along x and y, and a moment along y and z: what is open counts where it is not zero."""
    for determined, expected in (
        ([1, 1, 1, 1, 1, 1], [False, False]),
        ([0, 1, 1, 1, 1, 1], [True, False]),
        ([1, 1, 0, 0, 1, 1], [False, False]),
        ([1, 1, 1, 1, 0, 1], [False, True]),
    ):
        seen = data(viewer.html(four_bar(determined=np.array(determined, dtype=bool))))
        assert all(joint["open"] == expected for joint in seen["joints"])


def test_rail_spans_the_travel() -> None:
    t = np.linspace(0, 6, 60)
    poses = {"slider": (at(2 + np.cos(t), 0, 60), turned(0 * t))}
    fake = Fake(t, poses, [("S", "prismatic", "ground", "slider", (0, 0, 0))], axes={"S": (1.0, 0.0, 0.0)})
    joint = data(viewer.html(fake))["joints"][0]
    assert joint["atParent"] is None
    (a, b) = joint["rail"]
    assert a[0] < 1.0 and b[0] > 3.0 and a[1:] == b[1:] == [0.0, 0.0]


def test_one_output_zero_reactions_and_no_spec() -> None:
    scene = data(viewer.html(four_bar(nt=1, force=0.0, with_spec=False)))
    assert scene["frames"] == 1 and scene["joints"][0]["axis"] is None
    assert unpacked(scene["tables"]["force"], 1).tolist() == [[0.0] * 12]


def test_numbers_that_are_not_finite_pass() -> None:
    fake = pendulum()
    fake._loads[3] = np.nan
    fake.sigma[:] = np.nan
    scene = data(viewer.html(fake))
    assert np.isnan(unpacked(scene["tables"]["force"], scene["frames"])[3]).all()


def test_system_without_bodies() -> None:
    fake = Fake(np.linspace(0, 1, 9), {}, [], has_energy=False)
    scene = data(viewer.html(fake))
    assert scene["bodies"] == scene["joints"] == [] and "energy" not in scene["tables"]
    assert scene["velocities"] == ["q0", "q1"]


def test_early_stop_is_reported() -> None:
    scene = data(viewer.html(pendulum(success=False, message="step too small at t = 1.2 s")))
    assert "step too small" in scene["warning"]


def test_bad_targets_are_typed_errors(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="does not exist; make it first"):
        viewer.write_html(pendulum(), tmp_path / "nowhere" / "x.html")
    with pytest.raises(FileFormatError, match="is a folder"):
        viewer.write_html(pendulum(), tmp_path)
    with pytest.raises(ArgumentError, match="no outputs"):
        viewer.html(Fake(np.empty(0), {}, []))


def test_four_bar_of_the_catalogue(tmp_path: Path) -> None:
    """The real result has the shape that the fakes imitate."""

    run = pt.catalogue.load("four-bar").simulate(1.0)
    page = viewer.write_html(run, tmp_path / "four-bar.html").read_text("utf-8")
    scene = data(page)
    assert scene["planar"] and scene["outputs"] == len(run.t)
    assert {body["kind"] for body in scene["bodies"]} == {"rod"}
    assert scene["velocities"] == list(run.names.velocities)
    for j, name in enumerate(run.names.joints):
        assert np.allclose(placed(scene, j), run.joint(name).point, atol=2e-6)
