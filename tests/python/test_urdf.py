"""URDF in every dialect that closes loops against the same mechanism drawn by hand; bad files in one sentence each."""

from pathlib import Path

import numpy as np
import pytest

import partita as pt

# A four-bar in the plane x z, turned out of the world's axes; links along their own x.
LENGTHS = {"crank": 0.3, "coupler": 0.9, "rocker": 0.7}
BASE = 1.0
MASS = {"crank": 0.4, "coupler": 1.1, "rocker": 0.8}
CRANK, GRAVITY = 1.1, (0.0, 0.0, -9.81)


def angles() -> tuple[float, float, float]:
    """Of crank, coupler and rocker over the base line, the loop closed."""
    b = LENGTHS["crank"] * np.array([np.cos(CRANK), np.sin(CRANK)])
    gap = np.array([BASE, 0.0]) - b
    r = float(np.hypot(*gap))
    at_b = np.arccos((LENGTHS["coupler"] ** 2 + r**2 - LENGTHS["rocker"] ** 2) / (2 * LENGTHS["coupler"] * r))
    coupler = float(np.arctan2(gap[1], gap[0]) + at_b)
    c = b + LENGTHS["coupler"] * np.array([np.cos(coupler), np.sin(coupler)])
    return CRANK, coupler, float(np.arctan2(c[1], c[0] - BASE))


def link(name: str, marks: str = "") -> str:
    """A slender bar along x; its inertia is given in axes that are turned."""
    i = MASS[name] * LENGTHS[name] ** 2 / 12
    return f"""
  <link name="{name}">
    <inertial>
      <origin xyz="{LENGTHS[name] / 2} 0 0" rpy="0 0 1.5707963267948966"/>
      <mass value="{MASS[name]}"/>
      <inertia ixx="{i}" iyy="1e-4" izz="{i}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual><geometry><box size="1 1 1"/></geometry></visual>
  </link>{marks}"""


def hinge(name: str, parent: str, child: str, x: float, angle: float, more: str = "") -> str:
    """A hinge about y: turning by -angle about y is turning by angle in the plane x z."""
    return f"""
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x!r} 0 0" rpy="0 {-angle!r} 0"/><axis xyz="0 -1 0"/>{more}
  </joint>"""


def tree(more: str = "", marks: dict[str, str] | None = None) -> str:
    """The four-bar cut at its joint between coupler and rocker."""
    marks = {} if marks is None else marks
    crank, coupler, rocker = angles()
    parts = [
        '<robot name="four-bar">\n  <link name="base"/>',
        *(link(name, marks.get(name, "")) for name in LENGTHS),
        hinge("A", "base", "crank", 0.0, crank),
        hinge("B", "crank", "coupler", LENGTHS["crank"], coupler - crank),
        hinge("D", "base", "rocker", BASE, rocker),
    ]
    return "".join(parts) + more + "\n</robot>\n"


def mark(name: str, parent: str, x: float) -> str:
    """A link of no mass at the end of another one."""
    return f"""
  <link name="{name}"/>
  <joint name="to {name}" type="fixed">
    <parent link="{parent}"/><child link="{name}"/><origin xyz="{x} 0 0"/>
  </joint>"""


def ends(one: str, other: str) -> str:
    return mark(one, "coupler", LENGTHS["coupler"]) + mark(other, "rocker", LENGTHS["rocker"])


def drawn(closing: str) -> pt.Mechanism:
    """The same four-bar by hand."""
    m = pt.Mechanism("four-bar", gravity=GRAVITY)
    crank, coupler, _ = angles()
    b = np.array([LENGTHS["crank"] * np.cos(crank), 0, LENGTHS["crank"] * np.sin(crank)])
    c = b + LENGTHS["coupler"] * np.array([np.cos(coupler), 0, np.sin(coupler)])
    d = np.array([BASE, 0, 0])
    for name, start, end in (("crank", (0, 0, 0), b), ("coupler", b, c), ("rocker", d, c)):
        along = (np.asarray(end) - start) / LENGTHS[name]
        across = np.array([0.0, 1.0, 0.0])
        i = MASS[name] * LENGTHS[name] ** 2 / 12
        axes = np.column_stack([along, across, np.cross(along, across)])
        m.add_body(name, mass=MASS[name], inertia=(1e-4, i, i), com=(LENGTHS[name] / 2, 0, 0), position=start,
                   orientation=axes)  # fmt: skip
    for name, parent, child, point in (("A", m.ground, "crank", (0, 0, 0)), ("B", "crank", "coupler", b),
                                       ("D", m.ground, "rocker", d)):  # fmt: skip
        m.add_revolute(name, parent, child, point=point, axis=(0, -1, 0))
    if closing == "revolute":
        m.add_revolute("C", "coupler", "rocker", point=c, axis=(0, -1, 0))
    else:
        m.add_spherical("C", "coupler", "rocker", point=c)
    return m


def written(folder: Path, text: str, sidecar: str | None = None) -> Path:
    path = folder / "robot.urdf"
    path.write_text(text, "utf-8")
    if sidecar is not None:
        (folder / "robot.yaml").write_text(sidecar, "utf-8")
    return path


LOOP = f"""
  <loop name="C" type="revolute">
    <predecessor link="coupler"><origin xyz="{LENGTHS["coupler"]} 0 0"/></predecessor>
    <successor link="rocker"><origin xyz="{LENGTHS["rocker"]} 0 0"/></successor>
    <axis xyz="0 -1 0"/>
  </loop>"""
LOOP_JOINT = f"""
  <loop_joint name="C" type="spherical">
    <link1 link="coupler" xyz="{LENGTHS["coupler"]} 0 0" rpy="0 0 0"/>
    <link1 link="rocker" xyz="{LENGTHS["rocker"]} 0 0" rpy="0 0 0"/>
  </loop_joint>"""
FRAMES = f"""
  <fixed_frame name="closing_top_1"><parent link="coupler"/><origin xyz="{LENGTHS["coupler"]} 0 0"/></fixed_frame>
  <fixed_frame name="other"><parent link="rocker"/><origin xyz="{LENGTHS["rocker"]} 0 0"/></fixed_frame>"""
PAIR = "closed_loop: [[here, there]]\ntype: ['3d']\nname_mot: [A]\n"

DIALECTS = {
    "loop": (LOOP, None, "revolute"),
    "loop_joint": (LOOP_JOINT, None, "spherical"),
    "sidecar": (ends("here", "there"), PAIR, "spherical"),
    "frames and sidecar": (FRAMES, "closed_loop: [[closing_top_1, other]]\ntype: [3d]\n", "spherical"),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_is_the_mechanism_built_in_python(dialect: str, tmp_path: Path) -> None:
    more, sidecar, closing = DIALECTS[dialect]
    read, expected = pt.load(written(tmp_path, tree(more), sidecar)), drawn(closing)
    assert read.compile().mobility == expected.compile().mobility == 1
    for m in (read, expected):
        m.add_torque("A", value=0.7)
    a, b = (m.simulate(1.0, initial=m.assemble(rates={"A": 2.0}), rtol=1e-11, atol=1e-13) for m in (read, expected))
    assert a.success and b.success
    for joint in ("A", "B", "D"):
        assert np.abs(a.joint(joint).position - b.joint(joint).position).max() < 1e-9
    indices = [[m.compile().velocity_names.index(joint) for joint in ("A", "B", "D")] for m in (read, expected)]
    there, here = a.vdot[0, indices[0]], b.vdot[0, indices[1]]
    assert np.abs(there - here).max() < 1e-12 * np.abs(here).max()


def test_closing_frames_are_welded_on_a_hinged_end(tmp_path: Path) -> None:
    """Frames named closing_* coincide with their axes, so the hinge stands in the tree: at a light end piece."""
    _, coupler, rocker = angles()
    piece = """
  <link name="piece"><inertial><mass value="1e-3"/><inertia ixx="1e-9" iyy="1e-9" izz="1e-9"/></inertial></link>"""
    turn = hinge("C", "coupler", "piece", LENGTHS["coupler"], rocker - coupler)
    marks = mark("closing_top_1_6D", "piece", 0.0) + mark("closing_top_2_6D", "rocker", LENGTHS["rocker"])
    m = pt.load(written(tmp_path, tree(piece + turn + marks)))
    assert m.compile().mobility == 1
    assert list(m.joints)[-1] == "closing_top_1_6D = closing_top_2_6D"
    assert m.simulate(0.5).certificate.verdict == "valid"
    # a file beside it that lists no loops leaves them to their names
    beside = pt.load(written(tmp_path, tree(piece + turn + marks), "gravity: [0.0, 0.0, -1.0]\n"))
    assert [*beside.joints] == [*m.joints] and beside.gravity[2] == -1.0


def test_nothing_is_read_in_silence(tmp_path: Path) -> None:
    more = """
  <joint name="E" type="revolute"><parent link="crank"/><child link="flag"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping="0.3" friction="0.2"/>
    <mimic joint="A" multiplier="-2" offset="0.1"/></joint>
  <link name="flag"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <transmission name="t"/><gazebo/><nonsense/>"""
    m = pt.load(written(tmp_path, tree(LOOP + more)))
    assert m.reading is not None
    reported = str(m.reading)
    for words in (
        "E = -2 x A + 0.1",
        'joint "E" limit (lower -1, upper 2, effort 1, velocity 1): limits do not act',
        'joint "E" dynamics friction 0.2: friction would resist',
        'transmission "t"',
        "<gazebo>",
        "<nonsense>: not known to URDF, and ignored",
        "3 shapes to draw",
        'link "base" is the ground',
    ):
        assert words in reported, (words, reported)
    assert m.reading.dropped[-1].line is not None and m.reading.to_dict()["kind"] == "URDF"
    assert [group.kind for group in m.remarks][:4] == ["motion", "motion", "bounds", "unknown"]
    state = m.assemble(targets={"A": 0.2})
    assert abs(state.position("E") - (-2 * 0.2 + 0.1)) < 1e-12
    free = pt.load(tmp_path / "robot.urdf", base="free")
    assert free.compile().mobility == m.compile().mobility + 6


def test_hinges_through_one_point_are_one_joint(tmp_path: Path) -> None:
    end = '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    text = '<robot name="r"><link name="world"/>' + "".join(end.format(n) for n in ("ball", "cross"))
    text += '<link name="i1"/><link name="i2"/><link name="i3"/>'
    line = (
        '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/>'
        '<axis xyz="{4}"/></joint>'
    )
    for name, parent, child, origin, axis in (
        ("x", "world", "i1", "0 0 1", "1 0 0"),
        ("y", "i1", "i2", "0 0 0", "0 1 0"),
        ("z", "i2", "ball", "0 0 0", "0 0 1"),
        ("u", "world", "i3", "1 0 0", "1 0 0"),
        ("v", "i3", "cross", "0 0 0", "0 0 1"),
    ):
        text += line.format(name, parent, child, origin, axis)
    m = pt.load(written(tmp_path, text + "</robot>"))
    assert [(j["name"], j["kind"]) for j in m.compile().summary["joints"]] == [("z", "spherical"), ("v", "universal")]
    assert "x - y - z: hinges with no mass between them are one spherical joint" in str(m.reading)


JOINT = '\n<joint name="{}" type="{}"><parent link="base"/><child link="{}"/></joint>'
BAD = [
    ("<robot", 1, "not well-formed"),
    ('<!DOCTYPE robot [<!ENTITY a "aaaa">]><robot/>', 1, "document type"),
    ("<sdf/>", 1, "not URDF"),
    ("<robot/>", 1, "no <link>"),
    ('<robot>\n<link name="a"/>\n<link name="a"/></robot>', 3, "twice"),
    ('<robot><link name="a"/><link name="b"/></robot>', 1, "one root"),
    ("<robot>\n<link/></robot>", 2, 'no attribute "name"'),
    ('<robot><link name="a"><inertial/></link></robot>', 1, "no <mass>"),
    ('<robot><link name="a"><inertial><mass value="x"/><inertia/></inertial></link></robot>', 1, "not made of numbers"),
    ('<robot><link name="a"><inertial><mass value="nan"/><inertia/></inertial></link></robot>', 1, "finite number"),
    (tree(JOINT.format("A", "fixed", "crank")), None, "twice"),
    (
        tree(JOINT.format("Z", "fixed", "crank")),
        None,
        "already the child",
    ),
    (tree(JOINT.format("Z", "fixed", "no")), None, "does not exist"),
    (tree(JOINT.format("Z", "screw", "no")), None, 'type "screw"'),
    (tree(LOOP.replace('link="rocker"', 'link="none"')), None, '"none", which does not exist'),
    (tree(LOOP.replace("0 -1 0", "0 0 0")), None, "axis of length 0"),
    (tree(LOOP.replace("revolute", "magic")), None, 'type "magic"'),
    (tree(mark("closing_a_1", "coupler", 1.0)), None, "it has two"),
]


@pytest.mark.parametrize(("text", "line", "words"), BAD)
def test_a_bad_file_says_what_and_where(text: str, line: int | None, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match="urdf") as reported:
        pt.load(written(tmp_path, text))
    assert words in str(reported.value), reported.value
    assert reported.value.line is not None and (line is None or reported.value.line == line)


def test_circles_and_crowds_end_in_one_sentence(tmp_path: Path) -> None:
    ring = '<robot><link name="r"/><link name="a"/><link name="b"/>'
    for name, parent, child in (("j", "a", "b"), ("k", "b", "a")):
        ring += f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'
    with pytest.raises(pt.errors.FileFormatError, match="form a cycle"):
        pt.load(written(tmp_path, ring + "</robot>"))
    with pytest.raises(pt.errors.FileFormatError, match="elements"):
        pt.load(written(tmp_path, "<robot>" + "<a/>" * 600_000 + "</robot>"))
    with pytest.raises(pt.errors.FileFormatError, match="nest 513 levels, more than the limit of 512"):
        pt.load(written(tmp_path, "<robot>" + "<a>" * 1000 + "</a>" * 1000 + "</robot>"))


@pytest.mark.parametrize(
    ("sidecar", "words"),
    [
        ("closed_loop: [[here, nowhere]]\ntype: ['3d']\n", '"nowhere" closes a loop'),
        ("closed_loop: [[here, there]]\ntype: ['9d']\n", '"9d"'),
        ("closed_loop: [[here]]\n", "pairs of frames"),
        ("closed_loop: [[here, there]]\ntype: []\n", "one for each closed loop"),
        ("a: [1\n", "not YAML"),
        ("- 1\n", "contains no keys"),
        ("a: &x [1]\nb: *x\n", "alias"),
    ],
)
def test_a_bad_sidecar(sidecar: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match="yaml") as reported:
        pt.load(written(tmp_path, tree(ends("here", "there")), sidecar))
    assert words in str(reported.value)


def test_a_coupling_of_two_cranks(tmp_path: Path) -> None:
    text = tree(LOOP).replace("</robot>", "") + link("crank").replace('"crank"', '"second"')
    text += hinge("E", "base", "second", -1.0, 0.3)
    text += (
        """<coupling name="gear"><predecessor link="crank"/><successor link="second"/><ratio value="-3"/></coupling>"""
    )
    m = pt.load(written(tmp_path, text + "</robot>"))
    assert abs(m.assemble(targets={"A": 0.1}).position("E") + 0.3) < 1e-12
