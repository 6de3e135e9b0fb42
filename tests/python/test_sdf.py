"""SDFormat with native loops and frames relative to each other, against the same mechanism drawn by hand."""

from pathlib import Path

import numpy as np
import pytest
from test_urdf import BASE, LENGTHS, MASS, angles, drawn

import partita as pt


def link(name: str, pose: str) -> str:
    i = MASS[name] * LENGTHS[name] ** 2 / 12
    return f"""
  <link name="{name}">{pose}<inertial><pose>{LENGTHS[name] / 2} 0 0 0 0 1.5707963267948966</pose>
    <mass>{MASS[name]}</mass><inertia><ixx>{i!r}</ixx><iyy>1e-4</iyy><izz>{i!r}</izz></inertia></inertial></link>"""


def hinge(name: str, parent: str, child: str, pose: str = "", axis: str = "<xyz>0 -1 0</xyz>") -> str:
    return f"""
  <joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child>{pose}
    <axis>{axis}</axis></joint>"""


def model(more: str = "", closing: str | None = None) -> str:
    crank, coupler, rocker = (float(x) for x in angles())
    closing = closing or hinge("C", "coupler", "rocker", '<pose relative_to="tip"/>')
    return f"""<sdf version="1.9"><world name="w"><gravity>0 0 -9.81</gravity><model name="four-bar">
  <frame name="tip" attached_to="coupler"><pose>{LENGTHS["coupler"]} 0 0 0 0 0</pose></frame>
  {link("crank", f"<pose>0 0 0 0 {-crank!r} 0</pose>")}
  {link("coupler", f'<pose relative_to="crank">{LENGTHS["crank"]} 0 0 0 {crank - coupler!r} 0</pose>')}
  {link("rocker", f"<pose degrees='true'>{BASE} 0 0 0 {-np.degrees(rocker):.17g} 0</pose>")}
  {hinge("A", "world", "crank")}{hinge("B", "crank", "coupler")}
  {hinge("D", "world", "rocker", axis='<xyz expressed_in="__model__">0 -1 0</xyz>')}
  {closing}{more}</model></world></sdf>"""


def loaded(folder: Path, text: str) -> pt.Mechanism:
    path = folder / "model.sdf"
    path.write_text(text, "utf-8")
    return pt.load(path)


def test_a_four_bar_is_the_one_built_in_python(tmp_path: Path) -> None:
    read, expected = loaded(tmp_path, model()), drawn("revolute")
    assert read.compile().mobility == 1
    a, b = (m.simulate(1.0, initial=m.assemble(rates={"A": 2.0}), rtol=1e-11, atol=1e-13) for m in (read, expected))
    assert a.success and b.success
    for joint in ("A", "B", "D"):
        assert np.abs(a.joint(joint).position - b.joint(joint).position).max() < 1e-10
    assert np.abs(a.joint("A").force - b.joint("A").force).max() < 1e-8


def test_joints_of_other_kinds(tmp_path: Path) -> None:
    body = '<link name="{0}"><pose>0 {1} 0 0 0 0</pose></link>'
    more = "".join(
        body.format(name, y) for name, y in (("nut", 1), ("ball", 2), ("fork", 3), ("slide", 4), ("weld", 5))
    )
    more += """
  <joint name="screw" type="screw"><parent>world</parent><child>nut</child><axis/>
    <screw_thread_pitch>0.01</screw_thread_pitch></joint>
  <joint name="b" type="ball"><parent>world</parent><child>ball</child></joint>
  <joint name="u" type="universal"><parent>world</parent><child>fork</child><axis><xyz>1 0 0</xyz></axis>
    <axis2><xyz>0 1 0</xyz></axis2></joint>
  <joint name="p" type="prismatic"><parent>world</parent><child>slide</child><axis><xyz>1 0 0</xyz>
    <dynamics><damping>2</damping><friction>1</friction><spring_stiffness>5</spring_stiffness></dynamics>
    <limit><lower>-1</lower></limit></axis></joint>
  <joint name="f" type="fixed"><parent>world</parent><child>weld</child></joint><plugin/>"""
    m = loaded(tmp_path, model(more))
    kinds = {j["name"]: j["kind"] for j in m.compile().summary["joints"]}
    assert [kinds[n] for n in ("screw", "b", "u", "p", "f")] == [
        "screw",
        "spherical",
        "universal",
        "prismatic",
        "fixed",
    ]
    state = m.assemble(targets={"screw.turn": 2 * np.pi})
    assert abs(state.position("screw")[0] - 0.01) < 1e-12
    reported = str(m.reading)
    for words in (
        'joint "p" axis dynamics friction (1): friction would resist',
        'joint "p" axis limit (lower -1): limits do not act',
        'model "four-bar" plugin: a plugin may drive the model',
        "1 kg and 1 kg m^2",
    ):
        assert words in reported, reported


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<a/>", "not SDFormat"),
        ("<sdf/>", "contains 0 models"),
        ('<sdf><model name="m"/></sdf>', "no <link>"),
        (model('<include/>'), "holds no <uri>"),
        (model('<link name="crank"/>'), "taken"),
        (model('<frame name="x"><pose relative_to="y"/></frame><frame name="y"><pose relative_to="x"/></frame>'
               + hinge("E", "x", "crank")), "circle"),
        (model(hinge("E", "nobody", "crank")), '"nobody"'),
        (model(hinge("E", "crank", "rocker", axis="<xyz>0 0 0</xyz>")), "length 0"),
        (model(hinge("E", "crank", "rocker", axis="<xyz>0 a 0</xyz>")), "not made of numbers"),
        (model('<joint name="E" type="odd"><parent>crank</parent><child>rocker</child></joint>'), '"odd"'),
    ],
)  # fmt: skip
def test_a_bad_file(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError) as reported:
        loaded(tmp_path, text)
    assert words in str(reported.value) and reported.value.line is not None


def one(version: str, axis: str, model_pose: str = "0 0 0 0 0 0", more: str = "") -> str:
    """A link 1 m along x of its model, on a hinge that is turned by a quarter about z."""
    return f"""<sdf version="{version}"><model name="m"><pose>{model_pose}</pose>
  <link name="a"><pose>1 0 0 0 0 0</pose>{more}<inertial><mass>1</mass>
    <inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
  <joint name="j" type="revolute"><parent>world</parent><child>a</child><pose>0 0 0 0 0 {np.pi / 2!r}</pose>
    <axis><xyz>1 0 0</xyz>{axis}</axis></joint></model></sdf>"""


@pytest.mark.parametrize(
    ("version", "axis", "along"),
    [
        ("1.4", "", (1, 0, 0)),
        ("1.5", "", (0, 1, 0)),
        ("1.5", "<use_parent_model_frame>true</use_parent_model_frame>", (1, 0, 0)),
        ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", (1, 0, 0)),
        ("1.6", "<use_parent_model_frame>false</use_parent_model_frame>", (0, 1, 0)),
        ("1.7", "", (0, 1, 0)),
        ("1.7", "<use_parent_model_frame>true</use_parent_model_frame>", (0, 1, 0)),
    ],
)
def test_axes_follow_the_rules_of_their_version(
    version: str, axis: str, along: tuple[int, ...], tmp_path: Path
) -> None:
    m = loaded(tmp_path, one(version, axis))
    (joint,) = m.to_spec()["joints"]
    assert np.abs(np.array(joint["axis"]) - along).max() < 1e-15
    assert ("unknown" in [group.kind for group in m.remarks]) == (version == "1.7" and bool(axis))


def test_the_pose_of_a_model_turns_all_of_it(tmp_path: Path) -> None:
    m = loaded(tmp_path, one("1.9", "", f"0.5 0 0 0 0 {np.pi / 2!r}", "<gravity>false</gravity>"))
    (body,), (joint,) = m.to_spec()["bodies"], m.to_spec()["joints"]
    assert np.abs(np.array(body["position"]) - (0.5, 1, 0)).max() < 1e-15
    assert np.abs(np.array(joint["axis"]) - (-1, 0, 0)).max() < 1e-15
    assert [force["kind"] for force in m.to_spec()["forces"]] == ["weightless"]


@pytest.mark.parametrize(
    ("text", "gravity"),
    [
        ("{}", (0, 0, -9.8)),
        ("<world name='w'>{}</world>", (0, 0, -9.8)),
        ("<world name='w'><gravity>0 1 2</gravity>{}</world>", (0, 1, 2)),
        ("<world name='w'><physics type='ode'><gravity>0 3 2</gravity></physics>{}</world>", (0, 0, -9.8)),
    ],
)
def test_gravity_of_the_world_or_of_the_format(text: str, gravity: tuple[float, ...], tmp_path: Path) -> None:
    whole = one("1.6", "")
    inner = whole[whole.index("<model") : whole.index("</sdf>")]
    for version in ("1.5", "1.6"):
        m = loaded(tmp_path, f'<sdf version="{version}">{text.format(inner)}</sdf>')
        by_physics = version == "1.5" and "physics" in text
        assert m.gravity == ((0, 3, 2) if by_physics else gravity)
        own = any(group.text.startswith("gravity is the format's own") for group in m.remarks)
        assert own == (gravity == (0, 0, -9.8) and not by_physics)


def test_mimic_is_a_coupler(tmp_path: Path) -> None:
    mimic = '<mimic joint="A"><multiplier>-2</multiplier><offset>0.1</offset><reference>0.3</reference></mimic>'
    more = link("crank", "<pose>0 2 0 0 0 0</pose>").replace('"crank"', '"second"')
    m = loaded(tmp_path, model(more + hinge("E", "world", "second", axis=f"<xyz>0 1 0</xyz>{mimic}")))
    assert m.compile().mobility == 1
    assert abs(m.assemble(targets={"A": 0.5}).position("E") - (-2 * (0.5 - 0.3) + 0.1)) < 1e-12


def test_the_caller_lists_the_loops(tmp_path: Path) -> None:
    """By frames of any names, and how pairs are closed whose names do not say it."""
    ends = "".join(
        f'<frame name="{name}_{side}" attached_to="{link}"><pose>{LENGTHS[link]} 0 0 0 0 0</pose></frame>'
        for name in ("closing_top", "point")
        for side, link in ((1, "coupler"), (2, "rocker"))
    )
    path, listed = tmp_path / "model.sdf", tmp_path / "loops.yaml"
    path.write_text(model(closing=ends), "utf-8")
    listed.write_text("closed_loop: [[point_1, point_2]]\ntype: [3d]\n", "utf-8")
    by_names, by_list = pt.load(path), pt.load(path, loops=listed)
    assert any("loops=" in group.text for group in by_names.remarks)
    assert not any("do not say how" in group.text for group in by_list.remarks)
    runs = [m.simulate(0.1, initial=m.assemble(rates={"A": 2.0})) for m in (by_names, by_list, drawn("revolute"))]
    for run in runs[:2]:
        assert np.abs(run.joint("B").position - runs[2].joint("B").position).max() < 1e-6
    listed.write_text("closed_loop: [[closing_top_1, closing_top_2]]\ntype: [6d]\n", "utf-8")
    assert "closing_top_2 welded, by loops.yaml" in str(pt.load(path, loops=listed).reading)
    listed.write_text("closed_loop: [[point_1, nowhere]]\n", "utf-8")
    with pytest.raises(pt.errors.FileFormatError, match=r'"nowhere" closes a loop but is not .* SDFormat'):
        pt.load(path, loops=listed)
