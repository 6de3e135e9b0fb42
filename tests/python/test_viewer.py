"""The animation page: one file that asks for nothing, says what it left out, and cannot be broken by a name."""

import base64
import json
import re
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import partita as pt
from partita import viewer
from partita.errors import (
    ArgumentError,
    FileFormatError,
    MissingDependencyError,
    MissingFileError,
    UnknownNameError,
)
from partita.viewer.film import save_film
from partita.viewer.geometry import outline, view
from partita.viewer.meshes import simplified
from partita.viewer.packing import BYTES, FEWEST_FRAMES, LEVELS, MOST_FRAMES, pack_tables
from partita.viewer.page import fixed_bytes

Z = (0.0, 0.0, 1.0)


@dataclass
class Fake:
    """What the page asks of a result, for bodies given by their poses."""

    t: np.ndarray
    poses: dict[str, tuple[np.ndarray, np.ndarray]]  # origin (nt, 3), rotation (nt, 3, 3)
    joints: list[tuple[str, str, str, str, tuple[float, ...]]]  # name, kind, parent, child, point in the child
    force: float = 5.0
    planar: bool = True
    independent: Any = None
    partitions: list[Any] = field(default_factory=list)
    gravity: tuple[float, ...] = (0.0, -9.81, 0.0)
    axes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    forces: list[dict[str, Any]] = field(default_factory=list)
    coms: dict[str, tuple[float, ...]] = field(default_factory=dict)
    success: bool = True
    message: str = ""
    has_energy: bool = True
    with_spec: bool = True
    title: str = "fake"
    determined: np.ndarray = field(default_factory=lambda: np.ones(6, dtype=bool))

    def __post_init__(self) -> None:
        nt, nj = len(self.t), len(self.joints)
        names = [j[0] for j in self.joints] or ["q0", "q1"]
        self.names = SimpleNamespace(
            bodies=list(self.poses), joints=[j[0] for j in self.joints], velocities=names, coordinates=names
        )
        wave = np.sin(3.0 * self.t[:, None] + np.arange(len(names)))
        self.measure = 0.55 + 0.45 * wave
        self.q, self.v = -wave / 3.0, wave
        if self.independent is None:
            self.independent = np.zeros((nt, 1), dtype=int)
        self.closure = np.full(nt, 1e-15)
        self.sigma = 0.5 + 0.1 * np.sin(self.t)
        self.sqrt_mu = 0.7 + 0.1 * np.cos(self.t)
        kinetic = 1.0 + np.sin(self.t) ** 2
        self.energy = SimpleNamespace(kinetic=kinetic, potential=3.0 - kinetic, total=np.full(nt, 3.0))
        self.summary = {
            "name": self.title,
            "planar": self.planar,
            "joints": [
                {"name": n, "kind": k, "parent": p, "child": c, "state_v": [i, 1]}
                for i, (n, k, p, c, _) in enumerate(self.joints)
            ],
        }
        self.spec = self._spec() if self.with_spec else None
        self._loads = self.force * np.stack([np.cos(self.t), np.sin(2 * self.t), 0 * self.t], axis=1)
        self._phase = 1.0 + np.arange(nj)

    def _spec(self) -> dict[str, Any]:
        return {
            "gravity": list(self.gravity),
            "bodies": [
                {
                    "name": n,
                    "com": list(self.coms.get(n, (0, 0, 0))),
                    "orientation": r[0].tolist(),
                    "shape": {"kind": "auto"},
                }
                for n, (_, r) in self.poses.items()
            ],
            "joints": [{"name": j[0], "axis": list(self.axes.get(j[0], Z))} for j in self.joints],
            "forces": self.forces,
        }

    def body(self, name: str) -> Any:
        position, rotation = self.poses[name]
        return SimpleNamespace(position=position, rotation=rotation)

    def applied_forces(self) -> dict[str, Any]:
        return {}

    def joint(self, name: str) -> Any:
        i = self.names.joints.index(name)
        position, rotation = self.poses[self.joints[i][3]]
        point = position + rotation @ np.array(self.joints[i][4])
        force = self._loads / self._phase[i]
        found = SimpleNamespace(point=point, force=force, moment=0.1 * force[:, ::-1], determined=self.determined)
        found.in_frame = lambda axes: found
        return found


def turned(angle: np.ndarray) -> np.ndarray:
    """Rotations (nt, 3, 3) about z."""
    c, s, one, zero = np.cos(angle), np.sin(angle), np.ones_like(angle), np.zeros_like(angle)
    return np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]).transpose(2, 0, 1)


def at(x: Any, y: Any, nt: int) -> np.ndarray:
    return np.stack([np.broadcast_to(x, nt), np.broadcast_to(y, nt), np.zeros(nt)], axis=1).astype(float)


def four_bar(nt: int = 50, **options: Any) -> Fake:
    """A crank of 1, a coupler of 3 (with a point off its line), a rocker of 2.5, on a ground of 3."""
    t = np.linspace(0.0, 5.0, nt)
    crank = 1.0 + 2 * np.pi * t / 5.0
    b = at(np.cos(crank), np.sin(crank), nt)
    to_d = np.array([3.0, 0.0, 0.0]) - b
    d = np.linalg.norm(to_d, axis=1)
    coupler = np.arctan2(to_d[:, 1], to_d[:, 0]) + np.arccos((9 + d**2 - 2.5**2) / (6 * d))
    c = b + 3 * at(np.cos(coupler), np.sin(coupler), nt)
    rocker = np.arctan2(c[:, 1], c[:, 0] - 3)
    poses = {
        "crank": (at(0, 0, nt), turned(crank)),
        "coupler": (b, turned(coupler)),
        "rocker": (at(3, 0, nt), turned(rocker)),
    }
    joints = [
        ("A", "revolute", "ground", "crank", (0, 0, 0)),
        ("B", "revolute", "crank", "coupler", (0, 0, 0)),
        ("C", "revolute", "rocker", "coupler", (3, 0, 0)),
        ("D", "revolute", "ground", "rocker", (0, 0, 0)),
    ]
    return Fake(t, poses, joints, **options)


def pendulum(nt: int = 30, **options: Any) -> Fake:
    t = np.linspace(0.0, 2.0, nt)
    poses = {"bob": (at(0, 0, nt), turned(np.sin(t)))}
    return Fake(t, poses, [("A", "revolute", "ground", "bob", (0, 0, 0))], coms={"bob": (0, -1, 0)}, **options)


def data(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def unpacked(table: dict[str, Any], frames: int) -> np.ndarray:
    values = np.empty((frames, table["columns"]))
    values[:] = [np.nan if x is None else x for x in table["still"]]
    bytes_ = base64.b64decode(table["data"])
    if "low" in table:
        whole = np.frombuffer(bytes_, "<u2").reshape(frames, -1)
        stored = np.where(whole == LEVELS + 1, np.nan, np.array(table["low"]) + np.array(table["step"]) * whole)
    else:
        stored = np.frombuffer(bytes_, "<f4").reshape(frames, -1)
    values[:, table["moving"]] = stored
    return values


def placed(scene: dict[str, Any], joint: int) -> np.ndarray:
    """World points (nt, 3) of a joint, as the page finds them: fixed to its child."""
    body, point = scene["joints"][joint]["child"], np.array(scene["joints"][joint]["at"])
    if body < 0:
        return np.broadcast_to(point, (scene["frames"], 3))
    position = unpacked(scene["tables"]["position"], scene["frames"])[:, 3 * body : 3 * body + 3]
    turn = unpacked(scene["tables"]["turn"], scene["frames"])[:, 4 * body : 4 * body + 4]
    return position + Rotation.from_quat(turn).apply(point)


def test_page_loads_nothing(tmp_path: Path) -> None:
    page = viewer.write_html(four_bar(), tmp_path / "run.html").read_text("utf-8")
    for way_out in ("http:", "https:", "src=", "url(", "@import", "<link", "fetch(", "XMLHttpRequest", "import("):
        assert way_out not in page, way_out
    assert "default-src 'none'" in page
    assert "{{" not in page
    assert len(page) < 150_000


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


def test_tables_hold_the_run() -> None:
    fake = four_bar()
    scene = data(viewer.html(fake))
    frames = scene["frames"]
    assert frames == scene["outputs"] == len(fake.t)
    table = {name: unpacked(packed, frames) for name, packed in scene["tables"].items()}
    # Single precision: 6e-8 of the value, and the negligible motion that packing lets go, 1e-7 of the largest.
    assert np.allclose(table["t"][:, 0], fake.t, rtol=1e-7, atol=5e-7)
    assert np.allclose(table["measure"], fake.measure, rtol=1e-7, atol=1e-7)
    assert np.allclose(placed(scene, 2), fake.joint("C").point, atol=2e-6)
    assert np.allclose(table["force"][:, 3:6], fake.joint("B").force, rtol=1e-7, atol=1e-6)
    x, y, z, w = table["turn"][:, 4:8].T
    rotation = fake.body("coupler").rotation
    assert np.allclose(1 - 2 * (y * y + z * z), rotation[:, 0, 0], atol=1e-6)
    assert np.allclose(2 * (x * y + z * w), rotation[:, 1, 0], atol=1e-6)


def test_still_columns_cost_nothing() -> None:
    wave = np.sin(np.linspace(0, 9, 400))
    table = np.stack([wave, np.full(400, 7.0), 1e-12 * wave], axis=1)
    packed = pack_tables({"x": table})
    assert packed.tables["x"]["moving"] == [0] and len(packed.frames) == 400 and not packed.coarse
    assert packed.tables["x"]["still"] == [None, 7.0, 0.0]


@pytest.mark.parametrize(("nt", "columns", "kept"), [(50, 3, 50), (4000, 3, MOST_FRAMES), (240, 20_000, FEWEST_FRAMES)])
def test_long_and_large_runs_are_thinned(nt: int, columns: int, kept: int) -> None:
    time = np.linspace(0, 1, nt)[:, None]
    frames = pack_tables({"x": time * np.arange(1, columns + 1)}).frames
    assert len(frames) == kept and frames[0] == 0 and frames[-1] == nt - 1
    assert np.all(np.diff(frames) <= 2 * nt / kept + 2)


def test_a_bend_is_not_thinned_away() -> None:
    """What is said of the outputs left out is so, and a sudden motion among many slow ones is kept."""
    t = np.linspace(0.0, 10.0, 8001)
    table = np.stack([0.1 * t, np.exp(-(((t - 3.3) / 0.01) ** 2))], axis=1)
    packed = pack_tables({"x": table}, steering=table)
    kept = packed.frames
    between = np.stack([np.interp(t, t[kept], column[kept]) for column in table.T], axis=1)
    stray = float(np.abs(between - table).max())
    assert stray == pytest.approx(packed.strays) and stray < 0.01
    assert np.sum(np.abs(t[kept] - 3.3) < 0.02) == np.sum(np.abs(t - 3.3) < 0.02)


def test_two_bytes_keep_what_is_stated() -> None:
    """1/65534 of the range of each column, whatever lies beside it; what is not finite stays so; times stay exact."""
    random = np.random.default_rng(4)
    table = random.normal(size=(500, 900)) * 10.0 ** random.uniform(-9, 9, size=900)
    table[7, 3] = np.nan
    packed = pack_tables({"t": np.linspace(0, 1, 500)[:, None], "x": table})
    assert packed.coarse and "low" not in packed.tables["t"]
    found = unpacked(packed.tables["x"], len(packed.frames))
    wanted = table[packed.frames]
    assert np.isnan(found[7, 3] if 7 in packed.frames else np.nan)
    ranges = np.nanmax(wanted, axis=0) - np.nanmin(wanted, axis=0)
    moving = packed.tables["x"]["moving"]
    assert np.nanmax(np.abs(found - wanted)[:, moving] / ranges[moving]) < 0.51 / LEVELS
    assert sum(len(json.dumps(t)) for t in packed.tables.values()) < BYTES


def test_every_page_of_a_large_mechanism_stays_small() -> None:
    entry = pt.catalogue.entry("n-four-bar")
    m = entry.mechanism()
    run = m.simulate(0.5, t_eval=np.linspace(0.0, 0.5, 501), initial=entry.initial(m))
    page = viewer.html(run)
    assert len(page.encode()) - fixed_bytes() < 1_000_000
    assert data(page)["coarse"]


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


def test_choices_and_exchanges() -> None:
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


def test_early_stop_is_told() -> None:
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


# ---- what a person adds to the picture


@pytest.mark.parametrize(
    ("shapes", "words"),
    [
        ([1], "mapping"),
        ({"crank": []}, "empty"),
        ({"crank": {"kind": "cube"}}, "box, cylinder"),
        ({"crank": {"kind": "box"}}, "size is missing"),
        ({"crank": {"kind": "box", "size": (1, 1, -1)}}, "positive"),
        ({"crank": {"kind": "box", "size": (1, 1)}}, "three finite"),
        ({"crank": {"kind": "ball", "radius": float("nan")}}, "positive length"),
        ({"crank": {"kind": "ball", "radius": True}}, "positive length"),
        ({"crank": {"kind": "ball", "radius": 1, "colour": "red"}}, "colour is no word"),
        ({"crank": {"kind": "wheel", "radius": 1, "length": 1, "axis": (0, 0, 0)}}, "axis"),
        ({"crank": {"kind": "plate", "points": [(0, 0, 0), (1, 0, 0)]}}, "three or more"),
    ],
)
def test_bad_shapes_are_told(shapes: Any, words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        viewer.html(four_bar(nt=3), shapes=shapes)


@pytest.mark.parametrize("points", [3, {"P": "crank"}, {"P": ("crank", (0, 0))}, {"": ("crank", (0, 0, 0))}])
def test_bad_points_are_told(points: Any) -> None:
    with pytest.raises(ArgumentError, match="points"):
        viewer.html(four_bar(nt=3), points=points)


def test_unknown_bodies_are_told() -> None:
    for given in ({"shapes": {"crnk": {"kind": "ball", "radius": 1}}}, {"points": {"P": ("crnk", (0, 0, 0))}}):
        with pytest.raises(UnknownNameError, match="crank"):
            viewer.html(four_bar(nt=3), **given)


def test_applied_forces_follow_their_bodies(tmp_path: Path) -> None:
    """A force in body axes turns with its body, and both ends of its arrow are those of the motion."""
    m = pt.Mechanism("pushed", gravity=(0, 0, 0))
    arm = m.add_rod("arm", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, arm, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_force(arm, (0.0, 5.0, 0.0), point=(1, 0, 0), axes="body", name="push")
    run = m.simulate(1.0)
    places, forces = run.applied_forces()["push"]
    angle = run.joint("A").position[:, 0]
    assert np.ptp(angle) > 1.0
    along, across = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)
    assert np.allclose(places, along, atol=1e-12) and np.allclose(forces[:, :2], 5 * across, atol=1e-12)
    scene = data(viewer.html(run))
    stored = unpacked(scene["tables"]["load0"], scene["frames"])
    assert scene["loads"] == ["push"] and np.allclose(stored, np.hstack([places, forces]), atol=1e-5)


# ---- meshes


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One tetrahedron in every format, and a glTF whose data lies beside it."""
    trimesh = pytest.importorskip("trimesh")
    folder = tmp_path_factory.mktemp("part")
    corners = np.array([(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1)])
    mesh = trimesh.Trimesh(corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    for ending in ("stl", "obj", "glb"):
        mesh.export(folder / f"part.{ending}")
    (folder / "text.stl").write_text(mesh.export(file_type="stl_ascii"), encoding="utf-8")
    for name, content in trimesh.Scene(mesh).export(file_type="gltf").items():
        (folder / name).write_bytes(content)
    (folder / "below").mkdir()
    model = (folder / "model.gltf").read_text(encoding="utf-8")
    (folder / "below" / "model.gltf").write_text(model.replace('"uri":"', '"uri":"../'), encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["part.stl", "text.stl", "part.obj", "part.glb", "model.gltf"])
def test_meshes_of_every_format_are_drawn(part: Path, name: str) -> None:
    """The same solid, whatever the file: scaled, turned and placed in body axes."""
    axes = [(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    shape = {"kind": "mesh", "file": part / name, "scale": 2.0, "center": (1, 0, 0), "axes": axes}
    (solid,) = data(viewer.html(four_bar(nt=3), shapes={"crank": shape}))["solids"]
    points, faces = np.reshape(solid["parts"][0]["points"], (-1, 3)), np.reshape(solid["parts"][0]["faces"], (-1, 3))
    assert {tuple(np.round(p, 6)) for p in points} == {(1, 0, 0), (1, 0.6, 0), (0.6, 0, 0), (1, 0, 0.2)}
    a, b, c = (points[faces[:, k]] for k in range(3))
    volume = float(np.sum(np.cross(a, b) * c)) / 6.0
    assert len(faces) == 4 and volume == pytest.approx(0.3 * 0.2 * 0.1 / 6.0 * 8.0, rel=1e-5)


def test_large_meshes_become_small_and_keep_their_size() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 401)[:-1]
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.array([(*(r * p), h) for h in np.linspace(0, 2, 40) for p, r in zip(ring, [1.0] * 400, strict=True)])
    faces = np.array([(400 * i + j, 400 * i + (j + 1) % 400, 400 * (i + 1) + j) for i in range(39) for j in range(400)])
    corners, triangles = simplified(points, faces, 2000)
    assert 500 < len(triangles) <= 2000 and triangles.max() == len(corners) - 1
    assert np.allclose(np.ptp(corners, axis=0), [2, 2, 2], atol=0.06)


def test_meshes_that_cannot_be_read_are_told(part: Path, tmp_path: Path) -> None:
    def drawn(file: Any, **more: Any) -> str:
        return viewer.html(four_bar(nt=3), shapes={"crank": {"kind": "mesh", "file": file, **more}})

    with pytest.raises(MissingFileError, match=r"gone\.stl"):
        drawn(tmp_path / "gone.stl")
    with pytest.raises(FileFormatError, match="outside the folder"):
        drawn(part / "below" / "model.gltf")
    for name, content in (
        ("a.stl", b""),
        ("b.obj", b"v 1 2"),
        ("c.glb", b"glTF"),
        ("d.gltf", b"{}"),
        ("e.obj", b"v 0 0 0"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError, match=name):
            drawn(tmp_path / name)
    with pytest.raises(ArgumentError, match=r"\.stl, \.obj"):
        drawn(tmp_path / "part.step")
    for more, words in (
        ({"scale": 0.0}, "scale"),
        ({"axes": ((1, 0, 0), (1, 0, 0), (0, 0, 1))}, "square"),
        ({"size": 1}, "size"),
    ):
        with pytest.raises(ArgumentError, match=words):
            drawn(part / "part.stl", **more)
    with pytest.raises(ArgumentError, match="name of a file"):
        drawn(3)


def test_a_robot_looks_as_its_file_says(part: Path, tmp_path: Path) -> None:
    """Shapes of links, and of massless marks that became part of a link; files of strangers lead nowhere else."""
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "arm.stl").write_bytes((part / "part.stl").read_bytes())
    (tmp_path / "secret.stl").write_bytes((part / "part.stl").read_bytes())

    def visual(shape: str, place: str = "") -> str:
        return f"<visual><origin {place}/><geometry>{shape}</geometry></visual>"

    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    (folder / "arm.urdf").write_text(
        f"""<robot name="arm"><link name="base">{visual('<box size="1 1 0.1"/>')}</link>
        <link name="arm">{mass}{visual('<mesh filename="package://arm/meshes/arm.stl" scale="1 1 2"/>', 'xyz="0 0 1"')}
        {visual('<mesh filename="../secret.stl"/>')}{visual('<mesh filename="http://x.y/z.stl"/>')}
        {visual('<mesh filename="arm.dae"/>')}{visual('<sphere radius="no"/>')}</link>
        <link name="tool">{visual('<cylinder radius="0.1" length="1"/>', 'rpy="1.5707963267948966 0 0"')}</link>
        <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
        <joint name="weld" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0 0 2"/></joint>
        </robot>""",
        encoding="utf-8",
    )
    m = pt.load(folder / "arm.urdf")
    assert m.reading is not None
    shapes = m.reading.shapes
    assert shapes["ground"][0]["size"] == [1.0, 1.0, 0.1]
    mesh, cylinder = shapes["arm"]
    assert mesh["center"] == [0.0, 0.0, 1.0] and mesh["scale"] == [1.0, 1.0, 2.0]
    assert cylinder["center"] == [0.0, 0.0, 2.0] and np.allclose(cylinder["axis"], (0, -1, 0))
    told = "\n".join(map(str, m.reading.dropped))
    assert "outside the folder" in told and "nothing is fetched" in told and ".dae" in told and "radius" in told
    scene = data(viewer.html(m.simulate(0.1), shapes=shapes))
    assert {solid["body"] for solid in scene["solids"]} == {-1, 0}


# ---- films


def frames_of(path: Path) -> list[np.ndarray]:
    from PIL import Image, ImageSequence

    with Image.open(path) as film:
        return [np.asarray(frame.convert("RGB"), dtype=float) for frame in ImageSequence.Iterator(film)]


def test_a_film_shows_the_motion(tmp_path: Path) -> None:
    """So many pictures as asked, of that size; the crank is where the run says, in its colour."""
    fake = four_bar(nt=101)  # one turn of the crank in five seconds
    path = save_film(fake, tmp_path / "film.gif", fps=4, size=(400, 300), forces=False)
    pictures = frames_of(path)
    assert len(pictures) == 20 and pictures[0].shape == (300, 400, 3)
    crank = [np.argwhere(np.abs(picture - (0x8F, 0xB0, 0xD0)).max(axis=2) < 10) for picture in pictures]
    seen = [k for k, pixels in enumerate(crank) if len(pixels) > 120]  # else the coupler lies over it
    middles = np.array([crank[k].mean(axis=0)[::-1] for k in seen]) * (1.0, -1.0)
    # They lie on a circle about the pin: x^2 + y^2 = 2 a x + 2 b y + c.
    fit = np.linalg.lstsq(np.column_stack([2 * middles, np.ones(len(seen))]), (middles**2).sum(axis=1), rcond=None)[0]
    x, y = (middles - fit[:2]).T
    off = np.arctan2(y, x) - (1.0 + 2 * np.pi * np.array(seen) / 20)
    assert len(seen) > 14 and np.abs(np.angle(np.exp(1j * off))).max() < 0.1


def test_few_outputs_stand_as_long_as_they_last(tmp_path: Path) -> None:
    """Three outputs at 0, 2.5 and 5 s: three pictures, which together last as long as the run."""
    from PIL import Image

    path = save_film(four_bar(nt=3), tmp_path / "x.gif", fps=10, size=(200, 150))
    with Image.open(path) as film:
        lasts = []
        for n in range(film.n_frames):
            film.seek(n)
            lasts.append(film.info["duration"])
    assert np.allclose(lasts, [1250, 2500, 1250], atol=101)
    assert sum(lasts) == 5000


def test_a_film_of_every_kind_of_part(tmp_path: Path) -> None:
    """Gears, belts, cams, rods, slides, springs, solids, loads: a picture of each entry holds its bodies' colours."""
    for name in (
        "planetary-gear",
        "belt-drive",
        "cam-rocker",
        "rack-steering",
        "whipple-bicycle",
        "gyroscope",
        "bricard",
    ):
        entry = pt.catalogue.entry(name)
        run = entry.simulate(t_eval=np.linspace(0.0, entry.duration, 3))
        path = save_film(run, tmp_path / f"{name}.gif", fps=1, speed=entry.duration / 2, size=(200, 150))
        first = frames_of(path)[0]
        assert np.all(first[0, 0] == 255) and len(np.unique(first.reshape(-1, 3), axis=0)) > 20, name
        ink = np.argwhere(np.abs(first - 255).max(axis=2) > 40)
        assert ink.min() >= 0 and np.ptp(ink[:, 0]) > 75, name


def test_solids_and_meshes_are_filmed(part: Path, tmp_path: Path) -> None:
    shapes = {
        "crank": [{"kind": "mesh", "file": part / "part.stl", "scale": 4.0}, {"kind": "ball", "radius": 0.1}],
        "coupler": [{"kind": "box", "size": (1, 0.2, 0.2)}, {"kind": "wheel", "radius": 0.2, "length": 0.1}],
        "ground": [
            {"kind": "plate", "points": [(0, 0, 0), (1, 0, 0), (0, -1, 0)]},
            {"kind": "rod", "start": (0, 0, 0), "end": (3, 0, 0)},
        ],
    }
    points = {"P": ("coupler", (1, 1, 0))}
    path = save_film(four_bar(), tmp_path / "s.gif", fps=1, size=(200, 150), shapes=shapes, points=points)
    assert len(frames_of(path)) == 5


def test_films_that_cannot_be_made_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.gif"
    for more, words in (
        ({"fps": 0}, "fps"), ({"fps": "fast"}, "fps"), ({"speed": -1.0}, "speed"), ({"size": (10, 10)}, "pixels"),
        ({"size": 800}, "pixels"), ({"fps": 1e4}, "pictures"), ({"speed": 1e-6}, "pictures"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=words):
            save_film(four_bar(nt=5), path, **more)
    with pytest.raises(ArgumentError, match=r"\.gif or \.mp4"):
        save_film(four_bar(nt=5), tmp_path / "x.avi")
    with pytest.raises(ArgumentError, match="no bodies"):
        save_film(Fake(np.linspace(0, 1, 9), {}, [], has_energy=False), path)
    with pytest.raises(ArgumentError, match="no outputs"):
        save_film(Fake(np.empty(0), {}, []), path)
    with pytest.raises(MissingFileError, match="does not exist"):
        save_film(four_bar(nt=5), tmp_path / "nowhere" / "x.gif")
    monkeypatch.setattr("shutil.which", lambda program: None)
    with pytest.raises(MissingDependencyError, match="ffmpeg"):
        save_film(four_bar(nt=5), tmp_path / "x.mp4")
    assert not list(tmp_path.iterdir())


def test_an_mp4_is_what_ffmpeg_is_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the place of ffmpeg a program that writes down what it is given: all pictures, whole; what it says is told."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr("shutil.which", lambda name: str(program))
    path = save_film(four_bar(), tmp_path / "x.mp4", fps=2, size=(120, 120))
    assert path.stat().st_size == 10 * 120 * 120 * 3
    program.write_text('#!/bin/sh\ncat > /dev/null\necho "no such codec" >&2\nexit 1\n', encoding="utf-8")
    with pytest.raises(FileFormatError, match="no such codec"):
        save_film(four_bar(), tmp_path / "y.mp4", fps=2, size=(120, 120))
