"""Rotors of motors and gearboxes in robots' files, with numbers by hand.

Rotors stand in Drake's dialect: the inertia of a rotor that turns gear_ratio times as fast adds gear_ratio^2 times that
inertia to the joint. The gearbox of SDFormat: theta_2 = -gearbox_ratio theta_1, angles of its child and its parent from
the reference body about axis2 and axis.
"""

from pathlib import Path

import pytest

import partita as pt

DRAKE = 'xmlns:drake="http://drake.mit.edu"'
INERTIA, M, L = 0.02, 1.5, 0.3
"""Moment of inertia [kg m^2], mass [kg] and distance of the centre of mass [m] of a pendulum, drawn along x."""
ROTOR, RATIO = 4e-4, 30.0


def urdf(actuator: str, limit: str = "", more: str = "", kind: str = "continuous") -> str:
    inertia = f'<inertia ixx="0.01" ixy="0" ixz="0" iyy="{INERTIA}" iyz="0" izz="{INERTIA}"/>'
    inertial = f'<inertial><origin xyz="{L} 0 0"/><mass value="{M}"/>{inertia}</inertial>'
    motor = f'<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="A"/>{actuator}'
    return f"""<robot name="r" {DRAKE}><link name="base"/><link name="arm">{inertial}</link>
      <joint name="A" type="{kind}"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>{limit}</joint>
      {motor}{more}</transmission></robot>"""


def sdf(joint: str, limit: str = "", kind: str = "revolute") -> str:
    inertia = f"<inertia><ixx>0.01</ixx><iyy>{INERTIA}</iyy><izz>{INERTIA}</izz></inertia>"
    link = f'<link name="arm"><inertial><pose>{L} 0 0 0 0 0</pose><mass>{M}</mass>{inertia}</inertial></link>'
    axis = f"<axis><xyz>0 1 0</xyz>{limit}</axis>"
    joint = f'<joint name="A" type="{kind}"><parent>world</parent><child>arm</child>{axis}{joint}</joint>'
    return f"""<sdf version="1.9" {DRAKE}><world name="w"><gravity>0 0 -9.81</gravity>
      <model name="m">{link}{joint}</model></world></sdf>"""


BOTH = {
    ".urdf": urdf(
        f'<actuator name="a"><drake:rotor_inertia value="{ROTOR}"/><drake:gear_ratio value="{RATIO}"/></actuator>'
    ),
    ".sdf": sdf(f"<drake:rotor_inertia>{ROTOR}</drake:rotor_inertia><drake:gear_ratio>{RATIO}</drake:gear_ratio>"),
}
ALONE = {
    ".urdf": urdf(f'<actuator name="a"><drake:rotor_inertia value="{ROTOR}"/></actuator>'),
    ".sdf": sdf(f"<drake:rotor_inertia>{ROTOR}</drake:rotor_inertia>"),
}


def loaded(folder: Path, suffix: str, text: str) -> pt.Mechanism:
    path = folder / f"robot{suffix}"
    path.write_text(text, "utf-8")
    return pt.load(path)


def falls(m: pt.Mechanism, joint: str = "A") -> float:
    """Acceleration of a joint from rest as drawn."""
    compiled, state = m.compile(), m.assemble()
    return float(compiled.acceleration(state.q, state.v)[0][list(compiled.velocity_names).index(joint)])


@pytest.mark.parametrize("suffix", BOTH)
def test_a_rotor_adds_its_inertia_behind_the_gear(suffix: str, tmp_path: Path) -> None:
    bare = M * 9.81 * L / (INERTIA + M * L**2)
    for text, ratio in ((BOTH[suffix], RATIO), (ALONE[suffix], 1.0)):
        m = loaded(tmp_path, suffix, text)
        (rotor,) = m._description.rotors.values()
        assert (rotor.joint, rotor.inertia, rotor.ratio) == ("A", ROTOR, ratio)
        assert falls(m) == pytest.approx(M * 9.81 * L / (INERTIA + M * L**2 + ratio**2 * ROTOR), rel=1e-14)
        assert abs(falls(m) - bare) > 1e-4
        assert f"a rotor of {ROTOR:g} turns {ratio:g} times as fast" in str(m.reading)
        assert not [group for group in m.remarks if group.kind in ("motion", "unknown")]


@pytest.mark.parametrize("suffix", BOTH)
def test_a_joint_without_effort_has_no_motor(suffix: str, tmp_path: Path) -> None:
    """As Drake has it; the remark says so."""
    text = BOTH[suffix]
    if suffix == ".sdf":
        text = text.replace("</xyz></axis>", "</xyz><limit><effort>0</effort></limit></axis>")
    else:
        text = text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><limit effort="0" velocity="1"/>')
    m = loaded(tmp_path, suffix, text)
    assert not m._description.rotors and falls(m) == pytest.approx(M * 9.81 * L / (INERTIA + M * L**2), rel=1e-14)
    found = [group for group in m.remarks if group.kind == "other" and "no rotor" in group.text]
    assert len(found) == 1 and "effort" in found[0].text


def test_an_effort_without_bounds_has_a_motor(tmp_path: Path) -> None:
    for effort in ("inf", "1e308", "-1", ""):
        text = BOTH[".sdf"].replace("</xyz></axis>", f"</xyz><limit><effort>{effort}</effort></limit></axis>")
        assert loaded(tmp_path, ".sdf", text)._description.rotors


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            BOTH[".urdf"].replace(f'inertia value="{ROTOR}"', 'inertia value="-1"'),
            "has the inertia -1; it must be 0 or",
        ),
        (BOTH[".urdf"].replace('<joint name="A"/>', '<joint name="B"/>'), 'moves the joint "B", which does not exist'),
        (BOTH[".urdf"].replace(f' value="{RATIO}"', ""), 'has no attribute "value"'),
    ],
)
def test_bad_rotors(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match=words):
        loaded(tmp_path, ".urdf", text)
    with pytest.raises(pt.errors.FileFormatError, match="has a rotor of the inertia -1"):
        loaded(tmp_path, ".sdf", BOTH[".sdf"].replace(f"inertia>{ROTOR}", "inertia>-1"))


@pytest.mark.parametrize(
    "text",
    [
        BOTH[".urdf"].replace("SimpleTransmission", "DifferentialTransmission"),
        BOTH[".urdf"].replace('type="continuous"', 'type="floating"'),
    ],
)
def test_other_transmissions_are_reported(text: str, tmp_path: Path) -> None:
    m = loaded(tmp_path, ".urdf", text)
    assert not m._description.rotors and "no rotor turns with the joint of this transmission" in str(m.reading)


def geared(first: str, second: str, ratio: float, axis2: str = "0 0 1") -> str:
    """Two wheels on a case, each hinge in the direction asked for."""

    def link(name: str, inertia: float, x: float) -> str:
        moments = f"<inertia><ixx>1</ixx><iyy>1</iyy><izz>{inertia}</izz></inertia>"
        return f'<link name="{name}"><pose>{x} 0 0 0 0 0</pose><inertial><mass>1</mass>{moments}</inertial></link>'

    def hinge(name: str, ends: str, wheel: str, axis: str) -> str:
        parent, child = ("case", wheel) if ends == "out" else (wheel, "case")
        pose = f'<pose relative_to="{wheel}">0 0 0 0 0 0</pose><parent>{parent}</parent><child>{child}</child>'
        return f'<joint name="{name}" type="revolute">{pose}<axis><xyz>{axis}</xyz></axis></joint>'

    joint = f"""<joint name="gears" type="gearbox"><parent>one</parent><child>two</child>
      <gearbox_ratio>{ratio}</gearbox_ratio><gearbox_reference_body>case</gearbox_reference_body>
      <axis><xyz>0 0 1</xyz></axis><axis2><xyz>{axis2}</xyz></axis2></joint>"""
    return f"""<sdf version="1.9"><model name="m">{link("case", 1, 0)}{link("one", 0.1, 0)}{link("two", 0.5, 0.3)}
      <joint name="stands" type="fixed"><parent>world</parent><child>case</child></joint>
      {hinge("A", first, "one", "0 0 1")}{hinge("B", second, "two", axis2)}{joint}</model></sdf>"""


@pytest.mark.parametrize("ratio", [3.0, -0.5])
@pytest.mark.parametrize(("first", "second"), [("out", "out"), ("in", "out"), ("out", "in"), ("in", "in")])
@pytest.mark.parametrize("axis2", ["0 0 1", "0 0 -1"])
def test_a_gearbox_gears_its_hinges(first: str, second: str, ratio: float, axis2: str, tmp_path: Path) -> None:
    """A torque of 1 N m turns wheel one, of 0.1 kg m^2, and -ratio times as fast wheel two, of 0.5."""
    m = loaded(tmp_path, ".sdf", geared(first, second, ratio, axis2))
    assert m.compile().mobility == 1 and "a gear: B turns" in str(m.reading)
    sign = 1.0 if first == "out" else -1.0
    m.add_torque("A", value=sign)  # on wheel one, about z
    one = sign * falls(m)
    assert one == pytest.approx(1.0 / (0.1 + ratio**2 * 0.5), rel=1e-12)
    two = (1.0 if second == "out" else -1.0) * falls(m, "B")  # from the case, about axis2
    assert two == pytest.approx(-ratio * one, rel=1e-12)


def test_a_gearbox_without_hinges_is_reported(tmp_path: Path) -> None:
    text = geared("out", "out", 3.0).replace("<xyz>0 0 1</xyz></axis></joint>", "<xyz>0 1 0</xyz></axis></joint>", 1)
    m = loaded(tmp_path, ".sdf", text)
    (remark,) = (group for group in m.remarks if "it would gear hinges" in group.text)
    assert remark.kind == "motion" and m.compile().mobility == 2
    with pytest.raises(pt.errors.FileFormatError, match="holds no <axis2>"):
        loaded(tmp_path, ".sdf", geared("out", "out", 3.0).replace("<axis2><xyz>0 0 1</xyz></axis2>", ""))
    with pytest.raises(pt.errors.FileFormatError, match="is 0; fix the joint"):
        loaded(tmp_path, ".sdf", geared("out", "out", 0.0))


@pytest.mark.parametrize("suffix", [".urdf", ".mjcf", ".toml"])
def test_rotors_are_written_and_read_again(suffix: str, tmp_path: Path) -> None:
    """Of hinges and slides, in the tree and where a loop is closed; two of one joint add up."""
    if suffix == ".mjcf":
        pytest.importorskip("mujoco")
    m = pt.Mechanism("slider-crank", gravity=(0, 0, -9.81))
    m.add_rod("crank", (0, 0, 0), (0.3, 0, 0.4), mass=1.0)
    m.add_rod("rod", (0.3, 0, 0.4), (1.5, 0, 0), mass=2.0)
    m.add_body("block", mass=3.0, inertia=(0.1, 0.1, 0.1), position=(1.5, 0, 0))
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("B", "crank", "rod", point=(0.3, 0, 0.4), axis=(0, 1, 0))
    m.add_cylindrical("C", "rod", "block", point=(1.5, 0, 0), axis=(0, 1, 0))
    m.add_prismatic("S", m.ground, "block", point=(1.5, 0, 0), axis=(1, 0, 0))
    m.add_rotor("A", 2e-4, ratio=-20.0)
    m.add_rotor("A", 0.01)
    m.add_rotor("C", 0.02, ratio=3.0, coordinate=1)
    m.add_rotor("S", 0.5)
    path = tmp_path / f"written{suffix}"
    assert not m.save(path, strict=True).dropped
    back = pt.load(path)
    assert falls(back) == pytest.approx(falls(m), rel=1e-11)
    assert sum(rotor.ratio**2 * rotor.inertia for rotor in back._description.rotors.values()) == pytest.approx(
        20.0**2 * 2e-4 + 0.01 + 3.0**2 * 0.02 + 0.5, rel=1e-14
    )
