"""What a person, or a robot's file, adds to the picture: solids, points, loads, meshes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_runs import data, four_bar, unpacked
from mesh_files import tetrahedra

import partita as pt
from partita import viewer
from partita.errors import ArgumentError, FileFormatError, MissingFileError, UnknownNameError
from partita.shapes.triangles import simplified


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
def test_bad_shapes_are_reported(shapes: Any, words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        viewer.html(four_bar(nt=3), shapes=shapes)


@pytest.mark.parametrize("points", [3, {"P": "crank"}, {"P": ("crank", (0, 0))}, {"": ("crank", (0, 0, 0))}])
def test_bad_points_are_reported(points: Any) -> None:
    with pytest.raises(ArgumentError, match="points"):
        viewer.html(four_bar(nt=3), points=points)


def test_unknown_bodies_are_reported() -> None:
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
    points, forces = run.applied_forces()["push"]
    angle = run.joint("A").position[:, 0]
    assert np.ptp(angle) > 1.0
    along, across = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)
    assert np.allclose(points, along, atol=1e-12) and np.allclose(forces[:, :2], 5 * across, atol=1e-12)
    scene = data(viewer.html(run))
    stored = unpacked(scene["tables"]["load0"], scene["frames"])
    assert scene["loads"] == ["push"] and np.allclose(stored, np.hstack([points, forces]), atol=1e-5)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tetrahedra(tmp_path_factory.mktemp("part"))


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


def test_meshes_that_cannot_be_read_are_reported(part: Path, tmp_path: Path) -> None:
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
        drawn(tmp_path / "part.iges")
    for more, words in (
        ({"scale": 0.0}, "scale"),
        ({"axes": ((1, 0, 0), (1, 0, 0), (0, 0, 1))}, "perpendicular"),
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

    def visual(shape: str, origin: str = "") -> str:
        return f"<visual><origin {origin}/><geometry>{shape}</geometry></visual>"

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
    reported = "\n".join(map(str, m.reading.dropped))
    assert (
        "outside the folder" in reported
        and "nothing is downloaded" in reported
        and ".dae" in reported
        and "radius" in reported
    )
    run = m.simulate(0.1)
    scene = data(viewer.html(run, shapes=shapes))
    assert {solid["body"] for solid in scene["solids"]} == {-1, 0}
    # without being asked, unless there is nothing to read
    assert data(run.to_html(tmp_path / "run.html").read_text("utf-8"))["solids"] == scene["solids"]
    assert data(m.to_html(tmp_path / "m.html").read_text("utf-8"))["solids"] == scene["solids"]
    plain = data(run.to_html(tmp_path / "run.html", shapes={}).read_text("utf-8"))["solids"]
    assert plain != scene["solids"]
    (folder / "meshes" / "arm.stl").write_bytes(b"no mesh")
    with pytest.warns(UserWarning, match=r"without the looks of its file: .*arm\.stl"):
        assert data(run.to_html(tmp_path / "run.html").read_text("utf-8"))["solids"] == plain
    del m.joints["turn"]
    del m.bodies["arm"]
    m.add_rod("other", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    assert [solid["body"] for solid in data(m.to_html(tmp_path / "m.html").read_text("utf-8"))["solids"]] == [-1]


GEOMS = """<mujoco><asset><mesh name="wedge" vertex="0 0 0  0.3 0 0  0 0.2 0  0 0 0.1"/>
<material name="glass" rgba="1 1 1 0"/></asset><worldbody><geom type="plane" size="5 5 1"/>
<body name="arm" pos="0 0 1"><joint axis="0 1 0"/>
  <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="0 0 90" density="500"/>
  <geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4"/>
  <geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 2 0"/>
  <geom type="mesh" mesh="wedge" pos="0 0 3"/>
  <geom type="sphere" size="0.5" group="3"/><geom type="sphere" size="0.6" material="glass"/>
  <body name="tool" pos="0 0 -1"><joint type="slide"/><geom type="cylinder" size="0.1 0.2" group="4"/>
    <geom type="sphere" size="0.15" pos="0.1 0.2 0.3" group="3"/></body>
</body></worldbody></mujoco>"""


def test_geoms_of_mjcf_are_drawn(tmp_path: Path) -> None:
    """Those that MuJoCo's viewer shows; of a body without any those of its contacts."""
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "a.xml").write_text(GEOMS, "utf-8")
    m = pt.load(tmp_path / "a.xml")
    assert m.reading is not None
    box, tube, *ends, oval, wedge = m.reading.shapes["arm"]
    assert box["size"] == [0.2, 0.4, 0.6] and np.allclose(box["axes"], [(0, 1, 0), (-1, 0, 0), (0, 0, 1)])
    assert box["center"] == [1.0, 0.0, 0.0] and tube["length"] == pytest.approx(0.4) and tube["radius"] == 0.05
    assert {tuple(np.round(end["center"], 12)) for end in ends} == {(0, 0, 0), (0, 0, -0.4)}
    assert [x["kind"] for x in m.reading.shapes["tool"]] == ["cylinder", "ball"]
    assert np.allclose(np.abs(oval["points"]).max(axis=0), [0.1, 0.2, 0.3], rtol=1e-2)
    # its corners where the file has them, whatever frame MuJoCo gives it
    placed = np.asarray(wedge["points"]) @ np.array(wedge["axes"]) + wedge["center"]
    corners = {(0, 0, 3), (0.3, 0, 3), (0, 0.2, 3), (0, 0, 3.1)}
    assert {tuple(float(x) for x in np.round(p, 6) + 0.0) for p in placed} == corners
    dropped = [str(x) for x in m.reading.dropped]
    assert any("plane of 1 geoms" in x for x in dropped) and not any("not drawn" in x for x in dropped)
    scene = data(viewer.html(m.simulate(0.01), shapes=m.reading.shapes))
    assert {solid["body"] for solid in scene["solids"]} == {0, 1}
    assert m.reading.to_dict()["shapes"]["arm"][-1]["points"] == 4  # type: ignore[index]
    # mass and inertia of what MuJoCo makes of geoms, beside the same bodies as shapes
    native = mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml"))
    solid = pt.shapes.Cylinder(0.1, 0.4) + pt.shapes.Sphere(0.15).at((0.1, 0.2, 0.3))
    tool = m.bodies["tool"]
    assert tool.mass == native.body_mass[2] == pytest.approx(1000 * solid.volume, rel=1e-12)
    assert np.allclose(tool.com, solid.centroid, rtol=0, atol=1e-12)
    assert np.allclose(tool.inertia, 1000 * solid.inertia, rtol=0, atol=1e-12 * tool.inertia.max())


@pytest.mark.parametrize(
    "more", [{"faces": [(0, 1, 3)]}, {"points": [(0, 0)] * 3}, {"faces": [(0, 1)]}, {"points": [(0, 0, np.nan)] * 3}]
)
def test_meshes_that_are_given_themselves_are_checked(more: Any) -> None:
    mesh = {"kind": "mesh", "points": [(0, 0, 0), (1, 0, 0), (0, 1, 0)], "faces": [(0, 1, 2)]}
    assert data(viewer.html(four_bar(nt=3), shapes={"crank": mesh}))["solids"][0]["parts"][0]["of"] == 1
    with pytest.raises(ArgumentError, match=next(iter(more))):
        viewer.html(four_bar(nt=3), shapes={"crank": {**mesh, **more}})


def test_pulleys_have_their_radii_where_there_is_room() -> None:
    """Axes 0.5 m apart: wheels of 0.1 and 0.3 m stand beside each other, of 0.2 and 0.6 m they show the ratio."""
    for part, seen in ((1.0, [0.1, 0.3]), (2.0, [0.0525, 0.1575])):
        m = pt.Mechanism("belt")
        for i in (1, 2):
            wheel = m.add_body(f"wheel {i}", mass=1.0, inertia=(1, 1, 2), position=(0.5 * i, 0, 0))
            m.add_revolute(f"A{i}", m.ground, wheel, point=(0.5 * i, 0, 0))
        m.add_belt("A1", "A2", radius1=0.1 * part, radius2=0.3 * part)
        wheels = data(viewer.html(m.simulate(0.1)))["wheels"]
        assert sorted(wheel["radius"] for wheel in wheels) == pytest.approx(seen)
