"""Files that are refused without need: inertias off by rounding or more, mimics of fixed joints, names, paths."""

from pathlib import Path

import numpy as np
import pytest
from test_urdf import LOOP, link, tree, written

import partita as pt
from partita.io.repair import nearest_moments, repaired

TENSOR = 'ixx="{}" iyy="{}" izz="{}"'
GIVEN = 'ixx="1" iyy="2" izz="2"'
PENDULUM = f"""<robot name="r"><link name="base"/>
<link name="a"><inertial><origin xyz="1 0 0"/><mass value="3"/><inertia {GIVEN}/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/></joint>
</robot>
"""


def moments(m: pt.Mechanism, name: str = "a") -> np.ndarray:
    return np.linalg.eigvalsh(m._description.bodies[name].inertia)


def second_moments(values: np.ndarray) -> np.ndarray:
    """Of the mass along the principal axes."""
    return 0.5 * values.sum() - values


def test_the_nearest_moments_are_possible_and_no_other_is_nearer() -> None:
    """By the conditions of a projection on a cone: the rest is normal to what was found, and points out of it."""
    rng = np.random.default_rng(1)
    edges = 1.0 - np.eye(3)
    for values in np.sort(rng.normal(0.3, 1.0, (500, 3))):
        found = nearest_moments(values)
        assert second_moments(found).min() >= -1e-15 and found.min() >= 0.0
        assert abs((values - found) @ found) < 1e-14 and np.max(edges @ (values - found)) < 1e-14


def test_the_axes_of_the_file_do_not_matter() -> None:
    turned = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    plain, words = repaired(np.diag([1.0, 2.0, 4.5]), 0.0)
    assert np.abs(plain - np.diag([1.5, 2.5, 4.0])).max() < 1e-14
    other = repaired(turned @ np.diag([1.0, 2.0, 4.5]) @ turned.T, 0.0)
    assert np.abs(other[0] - turned @ plain @ turned.T).max() < 1e-14 and other[1] == words


@pytest.mark.parametrize(
    ("given", "expected", "reported"),
    [
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), False),
        ((1.0, 2.0, 3.000001), (1.0, 2.0, 3.000001), False),
        ((-5e-20, 1e-4, 1e-4), (0.0, 1e-4, 1e-4), False),
        ((1.0, 2.0, 3.3), (1.1, 2.1, 3.2), True),
        ((-1.0, 2.0, 2.0), (0.0, 2.0, 2.0), True),
        ((-1.0, -1.0, -1.0), (0.0, 0.0, 0.0), True),
    ],
)
def test_inertias_of_robots(
    given: tuple[float, ...], expected: tuple[float, ...], reported: bool, tmp_path: Path
) -> None:
    path = written(tmp_path, PENDULUM.replace(GIVEN, TENSOR.format(*given)))
    m = pt.load(path)
    assert moments(m) == pytest.approx(expected, rel=1e-14, abs=1e-17)
    remarks = [str(remark) for remark in m.reading.changed if "principal values" in remark.text]
    assert len(remarks) == reported
    if reported:
        shown = ", ".join(f"{x:.6g}" for x in sorted(given))
        assert remarks[0].startswith(f'line 2: link "a": its inertia has the principal values {shown}')
        with pytest.raises(pt.errors.FileFormatError, match="inertia"):
            pt.load(path, inertia="strict")


def test_rounding_beside_the_moments_of_other_links(tmp_path: Path) -> None:
    """Negative in full by its own size; zero by that of the robot."""
    text = PENDULUM.replace("</robot>", "").replace(GIVEN, TENSOR.format(-5e-20, 0, 0))
    text += '<joint name="k" type="fixed"><parent link="a"/><child link="crank"/></joint>' + link("crank")
    m = pt.load(written(tmp_path, text + "</robot>"))
    assert not np.any(m._description.bodies["a"].inertia) and "principal values" not in str(m.reading)


def test_inertias_of_our_own_files(tmp_path: Path) -> None:
    m = pt.Mechanism("m")
    m.add_revolute("A", m.ground, m.add_body("a", mass=1.0, inertia=(1, 2, 2.5)), point=(0, 0, 0))
    path = m.save(tmp_path / "m.toml").files[0]
    path.write_text("".join(x for x in path.read_text("utf-8").replace("2.5", "3.3").splitlines(True) if x[0] != "#"))
    with pytest.raises(pt.errors.FileFormatError, match="principal values"):
        pt.load(path)
    found = pt.load(path, inertia="repair")
    assert moments(found) == pytest.approx([1.1, 2.1, 3.2], rel=1e-14)
    assert 'body "a": its inertia has the principal values 1, 2, 3.3' in str(found.reading)
    with pytest.raises(pt.errors.ArgumentError, match="inertia 'mend' is not known"):
        pt.load(path, inertia="mend")


def test_a_fixed_joint_follows_nothing(tmp_path: Path) -> None:
    follower = """
  <joint name="E" type="fixed"><parent link="crank"/><child link="flag"/><mimic joint="A"/></joint>
  <link name="flag"/>"""
    m = pt.load(written(tmp_path, tree(LOOP + follower)))
    assert m.compile().mobility == 1 and "a fixed joint follows no other one" in str(m.reading)


def test_links_called_ground_and_world(tmp_path: Path) -> None:
    """Only a massless root is the ground; the world is, where the file does not define it."""
    text = tree(LOOP).replace('"crank"', '"ground"').replace('"rocker"', '"world"')
    m, expected = pt.load(written(tmp_path, text)), pt.load(written(tmp_path, tree(LOOP)))
    assert set(m.bodies) == {"ground link", "coupler", "world"}
    assert m.reading.shapes.keys() == {"ground link", "coupler", "world"}
    found, same = (one.assemble(rates={"A": 2.0}) for one in (m, expected))
    assert np.array_equal(m.compile().acceleration(found.q, found.v)[0],
                          expected.compile().acceleration(same.q, same.v)[0])  # fmt: skip
    undefined = tree(LOOP).replace('\n  <link name="base"/>', "").replace('"base"', '"world"')
    assert pt.load(written(tmp_path, undefined)).compile().mobility == 1
    heavy = tree(LOOP).replace('<link name="base"/>', link("crank").replace('"crank"', '"base"'))
    standing = pt.load(written(tmp_path, heavy.replace('"base"', '"ground"')))
    assert "ground link stands" in standing.joints and standing.compile().mobility == 1


def test_meshes_under_a_root(tmp_path: Path) -> None:
    """Nothing outside it is opened, by whatever name."""
    files = tmp_path / "robots" / "arm_description"
    (files / "urdf").mkdir(parents=True)
    (files / "meshes").mkdir()
    for file in (files / "meshes" / "part.stl", tmp_path / "outside.stl"):
        file.write_bytes(b"solid part")
    names = ("../meshes/part.stl", "package://arm_description/meshes/part.stl", "../../../outside.stl",
             "package://../outside.stl")  # fmt: skip
    for name in names:
        shape = f'<box size="1 1 1"/>|<mesh filename="{name}"/>'.split("|")
        path = written(files / "urdf", tree(LOOP).replace(*shape))
        assert not pt.load(path).reading.shapes
        for root in (tmp_path / "robots", files):
            m = pt.load(path, root=root)
            assert bool(m.reading.shapes) == (name in names[:2])
    with pytest.raises(pt.errors.ArgumentError, match="must be a folder that the model") as reported:
        pt.load(path, root=files / "meshes")
    assert reported.value.argument == "root"


def test_includes_under_a_root(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    inside = tmp_path / "robot" / "mjcf"
    inside.mkdir(parents=True)
    body = '<body name="{}"><joint axis="0 1 0"/><inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/></body>'
    (tmp_path / "robot" / "leg.xml").write_text(f"<mujoco><worldbody>{body.format('leg')}</worldbody></mujoco>")
    (tmp_path / "outside.xml").write_text("<mujoco/>")
    sub = inside / "sub.xml"

    def model(file: str, more: str = "") -> Path:
        path = inside / "robot.xml"
        path.write_text(f"<mujoco>\n<include file='{file}'/>{more}<worldbody>{body.format('arm')}</worldbody></mujoco>")
        return path

    with pytest.raises(pt.errors.FileFormatError, match=r'leads out of the folder of the model; root="..."'):
        pt.load(model("../leg.xml"))
    assert set(pt.load(model("../leg.xml"), root=tmp_path / "robot").bodies) == {"leg", "arm"}
    with pytest.raises(pt.errors.FileFormatError, match=r"outside.xml\", which leads out of the root"):
        pt.load(model("../../outside.xml"), root=tmp_path / "robot")
    # a model inside the model, whose own files may not lie elsewhere either
    sub.write_text('<mujoco><asset><mesh name="m" file="../../x.stl"/></asset></mujoco>')
    with pytest.raises(pt.errors.FileFormatError, match=r"x.stl\", which leads out of the root"):
        pt.load(model("../leg.xml", '<asset><model name="s" file="sub.xml"/></asset>'), root=tmp_path / "robot")
