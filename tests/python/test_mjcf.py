"""MJCF through MuJoCo's own parser: trees against MuJoCo's accelerations, loops against the same model as URDF."""

import math
from pathlib import Path

import numpy as np
import pytest
from test_urdf import BASE, LENGTHS, LOOP, MASS, angles, tree, written

import partita as pt

mujoco = pytest.importorskip("mujoco")

HINGE = '<joint name="{}" axis="0 -1 0"{}/>'


def bar(name: str, position: str, angle: float, inside: str) -> str:
    """A slender bar along its x, turned by -angle about y."""
    i = MASS[name] * LENGTHS[name] ** 2 / 12
    return f"""
  <body name="{name}" pos="{position}" quat="{math.cos(angle / 2)!r} 0 {-math.sin(angle / 2)!r} 0">
    <inertial pos="{LENGTHS[name] / 2} 0 0" mass="{MASS[name]}" diaginertia="1e-4 {i!r} {i!r}"/>
    {inside}
  </body>"""


def model(equality: str, more: str = "", joint: str = "") -> str:
    """The four-bar of `test_urdf`, cut at its joint between coupler and rocker."""
    crank, coupler, rocker = (float(x) for x in angles())
    inner = bar("coupler", f"{LENGTHS['crank']} 0 0", coupler - crank, HINGE.format("B", ""))
    return f"""<mujoco model="four-bar">
  <compiler angle="radian"/><option gravity="0 0 -9.81"/>
  <worldbody>{bar("crank", "0 0 0", crank, HINGE.format("A", joint) + inner)}
  {bar("rocker", f"{BASE} 0 0", rocker, HINGE.format("D", ""))}{more}
  </worldbody>
  <equality>{equality}</equality>
</mujoco>
"""


END = LENGTHS["coupler"]
CONNECT = f'<connect name="{{}}" body1="coupler" body2="rocker" anchor="{END} {{}} 0"/>'
CLOSED = CONNECT.format("C", 0)


def loaded(folder: Path, text: str) -> pt.Mechanism:
    path = folder / "model.xml"
    path.write_text(text, "utf-8")
    return pt.load(path)


@pytest.mark.parametrize("joint", ["", ' damping="0.3" stiffness="2" springref="0.2"'])
def test_a_tree_accelerates_as_in_mujoco(joint: str, tmp_path: Path) -> None:
    more = """
  <body name="slider" pos="0 1 2" euler="0.1 0.2 0.3"><inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/>
    <joint name="s" type="slide" axis="1 1 0"/><joint name="t" pos="0 0.1 0.2" axis="0 0 1"/>
    <body name="ball" pos="0.3 0 0"><inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>
      <joint name="u" pos="-0.1 0 0" axis="0 1 0"/><joint name="w" pos="-0.1 0 0.05" axis="1 0 0"/></body></body>"""
    m = loaded(tmp_path, model("", more, joint))
    native = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data, compiled = mujoco.MjData(native), m.compile()
    rng = np.random.default_rng(3)
    data.qpos[:], data.qvel[:] = rng.normal(size=(2, native.nq))
    mujoco.mj_forward(native, data)
    position = [mujoco.mj_name2id(native, mujoco.mjtObj.mjOBJ_JOINT, name) for name in compiled.velocity_names]
    rates, _ = compiled.acceleration(data.qpos[position], data.qvel[position])
    assert np.abs(rates - data.qacc[position]).max() < 1e-11 * np.abs(data.qacc).max()


def test_a_loop_moves_as_its_urdf(tmp_path: Path) -> None:
    read = loaded(tmp_path, model(CLOSED + CONNECT.format("C2", 0.2)))
    other = pt.load(written(tmp_path, tree(LOOP)))
    assert [j["kind"] for j in read.compile().summary["joints"] if j["name"] == "C"] == ["revolute"]
    assert "C and C2 join points of a line: a hinge" in str(read.reading)
    a, b = (m.simulate(1.0, initial=m.assemble(rates={"A": 2.0}), rtol=1e-11, atol=1e-13) for m in (read, other))
    assert a.success and b.success
    for joint in ("A", "B", "D"):
        assert np.abs(a.joint(joint).position - b.joint(joint).position).max() < 1e-10


def test_one_connect_is_a_ball_three_are_a_weld(tmp_path: Path) -> None:
    one = loaded(tmp_path, model(CLOSED))
    assert [j["kind"] for j in one.compile().summary["joints"] if j["name"] == "C"] == ["spherical"]
    three = CLOSED + "".join(
        f'<connect name="C{i}" body1="coupler" body2="rocker" anchor="{x} {y} 0"/>'
        for i, (x, y) in enumerate([(END, 0.2), (END - 0.3, 0.1)])
    )
    welded = loaded(tmp_path, model(three))
    same = loaded(tmp_path, model('<weld name="C" body1="coupler" body2="rocker"/>'))
    for m in (welded, same):
        assert [j["kind"] for j in m.compile().summary["joints"] if j["name"] == "C"] == ["fixed"]
        assert m.compile().mobility == 0


def test_joints_that_follow_and_what_is_left_out(tmp_path: Path) -> None:
    more = """
  <body name="wheel" pos="0 2 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="W" axis="0 1 0" armature="0.1" frictionloss="0.2" range="-1 1" limited="true"/>
    <geom size="0.1"/></body>"""
    tie = '<joint name="gear" joint1="W" joint2="A" polycoef="0.1 -3 0 0 0"/>'
    higher = '<joint name="cam" joint1="W" joint2="D" polycoef="0 1 2 0 0"/>'
    m = loaded(tmp_path, model(CLOSED + tie + higher, more))
    assert m.compile().mobility == 1 and m.rotors["rotor of W"].inertia == 0.1
    assert abs(m.assemble(targets={"A": 0.2}).position("W") - (0.1 - 3 * 0.2)) < 1e-12
    reported = str(m.reading)
    for words in (
        'joint "W" frictionloss 0.2: friction would resist the motion',
        'joint "W" range -1 to 1: limits do not act',
        "1 geoms: contacts are not read",
        'joint "cam" (joint1 W, joint2 D, polycoef 0 1 2 0 0): a polynomial of higher order',
    ):
        assert words in reported, reported


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco><worldbody><nonsense/></worldbody></mujoco>", "MuJoCo cannot read it"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "document type"),
        ('<mujoco><include file="../../etc/passwd"/></mujoco>', "leads out of the folder"),
        ('<mujoco><asset><mesh name="a" file="/etc/passwd"/></asset></mujoco>', "leads out of the folder"),
        (r'<mujoco><compiler meshdir="..\x"/><asset><mesh file="a.stl"/></asset></mujoco>', "leads out of the folder"),
        ('<mujoco><include file="model.xml"/></mujoco>', "are circular"),
        ("<what/>", "neither <robot>"),
    ],
)
def test_a_bad_file(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError) as reported:
        loaded(tmp_path, text)
    assert words in str(reported.value) and "model.xml" in str(reported.value)
