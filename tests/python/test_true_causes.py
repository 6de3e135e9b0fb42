"""What readers say is what is so: causes of refusals, and what would move otherwise, each with its number."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import partita as pt

INERTIAL = """<inertial><origin xyz="0 {y} 0"/><mass value="{mass}"/>
<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>"""


def put(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, "utf-8")
    return path


def kinds(m: Any, words: str) -> set[str]:
    """Kinds of the remarks with these words, in the text or in a name."""
    return {group.kind for group in m.remarks if words in group.text or any(words in name for name in group.names)}


def refusal(path: Path, **asked: Any) -> str:
    with pytest.raises(pt.errors.FileFormatError) as reported:
        pt.load(path, **asked)
    return str(reported.value)


# ---- inertias, masses, dampers ----


def test_an_inertia_that_is_replaced_is_a_remark_of_the_motion(tmp_path: Path) -> None:
    """0.01, 0.1, 0.01 about a hinge 0.5 m away: M is 0.0725 as written, 0.0992 with the nearest possible one."""
    inertial = INERTIAL.format(y=0.5, mass=0.25, xx=0.01, yy=0.1, zz=0.01)
    path = put(
        tmp_path,
        "a.urdf",
        f"""<robot name="r"><link name="base"/><link name="arm">{inertial}</link>
    <joint name="A" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint></robot>""",
    )
    m = pt.load(path)
    assert kinds(m, "which no body has; 0.0366667, 0.0366667, 0.0733333") == {"motion"}
    (mass,) = np.ravel(m.compile().mass_matrix(np.zeros(1)))
    assert mass == pytest.approx(0.25 * 0.25 + 0.11 / 3, rel=1e-9)


SDF = """<sdf version="1.7"><model name="m">{}
<link name="b"><pose>0 0 1 0 0 0</pose><inertial><mass>1</mass>
<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
<joint name="j" type="ball"><parent>world</parent><child>b</child>{}</joint></model></sdf>"""


def test_a_damper_of_a_ball_is_a_remark_of_the_motion(tmp_path: Path) -> None:
    """Drake damps all three rotations by it."""
    law = "<axis><xyz>0 0 1</xyz><dynamics><damping>2</damping></dynamics></axis>"
    m = pt.load(put(tmp_path, "a.sdf", SDF.format("", law)))
    assert kinds(m, 'joint "j" damping 2') == {"motion"} and kinds(m, "add_bushing") == {"motion"}
    none = pt.load(put(tmp_path, "b.sdf", SDF.format("", law.replace("<damping>2", "<damping>0"))))
    assert not kinds(none, "damping")


def test_a_link_with_inertia_and_without_mass_is_a_remark_of_the_motion(tmp_path: Path) -> None:
    light = """<link name="a"><inertial><mass>0</mass>
    <inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>"""
    m = pt.load(put(tmp_path, "a.sdf", SDF.format(light, "")))
    assert kinds(m, "inertia and no mass") == {"motion"} and kinds(m, 'link "a"') == {"motion"}


# ---- files that a model names ----


def test_a_world_whose_models_are_missing_names_them_and_the_remedy(tmp_path: Path) -> None:
    world = """<sdf version="1.7"><world name="w"><include><uri>model://robot</uri></include></world></sdf>"""
    path = put(tmp_path, "worlds/w.sdf", world)
    put(tmp_path, "models/robot/model.sdf", SDF.format("", ""))
    words = refusal(path)
    assert 'includes "model://robot"' in words and 'root="..."' in words and "line 1" in words
    assert "0 models" not in words
    put(tmp_path, "robot/model.sdf", SDF.format("", ""))
    assert list(pt.load(path, root=tmp_path).bodies) == ["b"]
    assert "contains 0 models" in refusal(put(tmp_path, "e.sdf", '<sdf version="1.7"><world name="w"/></sdf>'))


def test_a_file_in_which_all_is_static_says_so(tmp_path: Path) -> None:
    static = SDF.format("<static>true</static>", "")
    with pytest.raises(pt.errors.DescriptionError, match="all models of the file are static"):
        pt.load(put(tmp_path, "a.sdf", static)).compile()
    pytest.importorskip("pxr", reason="usd-core is an extra")
    stage = put(tmp_path, "a.usda", '#usda 1.0\n(metersPerUnit = 1)\ndef Cube "c"\n{\n}\n')
    with pytest.raises(pt.errors.DescriptionError, match="no prim of the file is an enabled rigid body"):
        pt.load(stage).compile()


@pytest.mark.parametrize("inside", ["", '<body><geom size="1"/></body>'])
def test_an_mjcf_without_joints_says_so(tmp_path: Path, inside: str) -> None:
    pytest.importorskip("mujoco", reason="MuJoCo serves Python 3.11 and newer")
    path = put(tmp_path, "a.xml", f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
    with pytest.raises(pt.errors.DescriptionError, match="no <body> of the file has a <joint>"):
        pt.load(path).compile()


def test_a_file_that_is_included_twice_is_named(tmp_path: Path) -> None:
    """Within another include MuJoCo calls its line 0."""
    pytest.importorskip("mujoco", reason="MuJoCo serves Python 3.11 and newer")
    put(tmp_path, "b.xml", "<mujoco><custom/></mujoco>")
    put(tmp_path, "c.xml", '<mujoco><worldbody><include file="b.xml"/></worldbody></mujoco>')
    twice = '<mujoco><include file="b.xml"/><include file="c.xml"/></mujoco>'
    words = refusal(put(tmp_path, "a.xml", twice))
    assert "already included" in words and "line 0:" not in words


@pytest.mark.parametrize("name", ["a.xml", "a.mjcf"])
def test_what_includes_include_is_read_once(tmp_path: Path, name: str) -> None:
    put(tmp_path, "parts/c.xml", "<mujoco><custom/></mujoco>")
    put(tmp_path, "parts/b.xml", '<mujoco><include file="parts/c.xml"/><compiler angle="radian"/></mujoco>')
    m = mjcf(tmp_path, top='<include file="parts/b.xml"/>', name=name)
    assert list(m.bodies) == ["rod"]


def test_warnings_of_mujoco_are_remarks(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    m = mjcf(tmp_path, top='<compiler settotalmass="3"/>')
    assert kinds(m, "MuJoCo warns: compiler attribute 'settotalmass'") == {"changed"} and not recwarn.list


def test_the_root_of_old_versions_is_named(tmp_path: Path) -> None:
    assert "SDFormat up to 1.2" in refusal(put(tmp_path, "a.sdf", '<gazebo version="1.2"><model name="m"/></gazebo>'))


def test_a_template_of_a_model_is_named(tmp_path: Path) -> None:
    words = refusal(put(tmp_path, "robot.urdf.xacro", "<robot/>"))
    assert "xacro FILE > robot.urdf" in words and "not known" not in words


@pytest.mark.parametrize("more", ["", '<link name="tip"/><joint name="T" type="fixed"><parent link="stone"/>'
                                      '<child link="tip"/></joint>'])  # fmt: skip
def test_a_file_in_which_nothing_moves_says_how_its_root_floats(tmp_path: Path, more: str) -> None:
    inertial = INERTIAL.format(y=0, mass=1, xx=1, yy=1, zz=1)
    path = put(tmp_path, "a.urdf", f'<robot name="r"><link name="stone">{inertial}</link>{more}</robot>')
    with pytest.raises(pt.errors.DescriptionError, match=r'let the root of the file, "stone", float: base="free"'):
        pt.load(path).compile()
    assert pt.load(path, base="free").compile().mobility == 6


def test_a_massless_root_that_carries_a_weld_says_so_too(tmp_path: Path) -> None:
    inertial = INERTIAL.format(y=0, mass=1, xx=1, yy=1, zz=1)
    weld = '<joint name="T" type="fixed"><parent link="foot"/><child link="stone"/></joint>'
    text = f'<robot name="r"><link name="foot"/><link name="stone">{inertial}</link>{weld}</robot>'
    path = put(tmp_path, "a.urdf", text)
    with pytest.raises(pt.errors.DescriptionError, match=r'let the root of the file, "foot", float: base="free"'):
        pt.load(path).compile()
    assert pt.load(path, base="free").compile().mobility == 6


def test_a_file_without_mass_says_so(tmp_path: Path) -> None:
    path = put(tmp_path, "a.urdf", '<robot name="plane"><link name="floor"/></robot>')
    with pytest.raises(pt.errors.DescriptionError, match='its root, "floor", has no mass and is the ground'):
        pt.load(path).compile()


# ---- MJCF ----


def mjcf(folder: Path, inside: str = "", **more: str) -> Any:
    """A rod on a hinge "H", I = 1 about it, without gravity."""
    pytest.importorskip("mujoco", reason="MuJoCo serves Python 3.11 and newer")
    text = f"""<mujoco><option gravity="0 0 0"/>{more.get("top", "")}<worldbody><body name="rod">
    <joint name="H" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{inside}</body>
    <site name="s0" pos="0 0 1"/></worldbody>{more.get("after", "")}</mujoco>"""
    return pt.load(put(folder, more.get("name", "a.xml"), text))


@pytest.mark.parametrize("name", ["a.xml", "a.mjcf"])
def test_folders_hold_files_of_their_own_kind(tmp_path: Path, name: str) -> None:
    """A folder of textures above the model is no folder of what it includes, and textures are never opened."""
    put(tmp_path, "m/b.xml", "<mujoco><custom/></mujoco>")
    for folder in ('texturedir="../tex"', 'assetdir="../tex"'):
        looks = '<texture name="t" type="2d" file="../../no.png"/><texture name="c" type="cube" fileright="r.png" '
        looks += 'fileleft="l.png" fileup="u.png" filedown="d.png" filefront="f.png" fileback="b.png"/>'
        looks += '<material name="k" texture="t"/><skin name="s" file="../no.skn"/>'
        top = f'<compiler {folder}/><include file="b.xml"/><asset>{looks}</asset>'
        m = mjcf(tmp_path / "m", '<geom size="0.1" mass="0" material="k"/>', top=top, name=name)
        assert list(m.bodies) == ["rod"]
    with pytest.raises(pt.errors.FileFormatError, match=r'names the file "a\.stl", which leads out'):
        mjcf(tmp_path / "m", top='<compiler assetdir="../tex"/><asset><mesh name="a" file="a.stl"/></asset>')


ACTUATORS = {
    '<general joint="H" gear="3"/>': "bounds",
    '<general joint="H" dyntype="integrator"/>': "bounds",
    '<general joint="H" biastype="affine" biasprm="0 -3 0"/>': "motion",
    '<general joint="H" biastype="affine" biasprm="0 0 0"/>': "bounds",
    '<motor joint="H"/>': "bounds",
    '<damper joint="H" kv="3" ctrlrange="0 1"/>': "bounds",
    '<position joint="H" kp="3"/>': "motion",
    '<velocity joint="H" kv="3"/>': "motion",
    '<intvelocity joint="H" kp="3" actrange="-1 1"/>': "motion",
    '<cylinder joint="H"/>': "bounds",
    '<muscle joint="H" lengthrange="0 0.1"/>': "motion",
    '<dcmotor joint="H" motorconst="0.4" resistance="1.3"/>': "bounds",
}


@pytest.mark.parametrize("actuator", ACTUATORS)
def test_actuators_by_whether_they_act_at_zero_control(tmp_path: Path, actuator: str) -> None:
    """Which MuJoCo itself computes: the effort of each at a deflection of 0.3 and a speed of 5."""
    m = mjcf(tmp_path, after=f"<actuator>{actuator}</actuator>")
    import mujoco

    kind = ACTUATORS[actuator]
    tag = actuator[1:].partition(" ")[0]
    assert kinds(m, f"<{tag}>") == {kind}
    assert kinds(m, "even at zero control") == ({"motion"} if kind == "motion" else set())
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml"))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = 0.3, 5.0
    mujoco.mj_forward(model, data)
    run = m.simulate(1e-7, t_eval=[0.0, 1e-7], initial=m.assemble({"H": 0.3}, rates={"H": 5.0}))
    ours = float(run.joint("H").acceleration[0, 0])
    assert (ours == pytest.approx(float(data.qacc[0]), rel=1e-9, abs=1e-12)) == (kind == "bounds")


@pytest.mark.parametrize("gear", [1.0, -7.0])
def test_a_motor_damps_by_the_square_of_its_constant_over_its_resistance(tmp_path: Path, gear: float) -> None:
    m = mjcf(
        tmp_path, after=f'<actuator><dcmotor joint="H" gear="{gear}" motorconst="0.4" resistance="1.3"/></actuator>'
    )
    run = m.simulate(1e-7, t_eval=[0.0, 1e-7], initial=m.assemble(rates={"H": 5.0}))
    assert run.joint("H").acceleration[0, 0] == pytest.approx(-(gear**2) * 0.16 / 1.3 * 5.0, rel=1e-9)


def test_a_motor_with_more_than_resistance_is_a_remark_of_the_motion(tmp_path: Path) -> None:
    motor = '<dcmotor joint="H" motorconst="0.4" resistance="1.3" input="pos vel" controller="0 0 5"/>'
    assert kinds(mjcf(tmp_path, after=f"<actuator>{motor}</actuator>"), "<dcmotor>") == {"motion"}


def test_a_limited_tendon_is_answered_by_a_rope(tmp_path: Path) -> None:
    tendon = """<tendon><spatial name="t" range="0 1.5" limited="true"><site site="s0"/><site site="s1"/></spatial>
    </tendon>"""
    m = mjcf(tmp_path, '<site name="s1" pos="0 0 -1"/>', after=tendon)
    (group,) = [x for x in m.remarks if "range 0 to 1.5" in "".join(x.names)]
    assert group.kind == "bounds" and "add_rope" in group.text and "add_stop" not in group.text
