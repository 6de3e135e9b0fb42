"""SDFormat with nested, several, static and included models, against the same mechanism drawn by hand."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_sdf import hinge, link
from test_urdf import BASE, LENGTHS, angles, drawn

import partita as pt

Array = NDArray[np.float64]

CRANK, COUPLER, ROCKER = (float(x) for x in angles())
AXIS = '<xyz expressed_in="__model__">0 -1 0</xyz>'
TURN = 0.4  # of the nested models about y
TIP = LENGTHS["coupler"]
BACK = (float(LENGTHS["crank"] * np.cos(TURN)), float(LENGTHS["crank"] * np.sin(TURN)))  # end of the crank there


def world(content: str, version: str = "1.10") -> str:
    return f'<sdf version="{version}"><world name="w"><gravity>0 0 -9.81</gravity>{content}</world></sdf>'


def placed(name: str, content: str, pose: str = "", attributes: str = "") -> str:
    return f'<model name="{name}" {attributes}>{pose}{content}</model>'


def crank(name: str = "crank") -> str:
    return link("crank", f"<pose>0 0 0 0 {-CRANK!r} 0</pose>").replace('"crank"', f'"{name}"')


# the coupler in a model that is turned and shifted, with a frame of its own at the tip
COUPLING = placed(
    "upper",
    link("coupler", f"<pose>{BACK[0]!r} 0 {BACK[1]!r} 0 {CRANK - COUPLER - TURN!r} 0</pose>")
    + f'<frame name="tip" attached_to="coupler"><pose relative_to="coupler">{TIP} 0 0 0 0 0</pose></frame>',
    f'<pose relative_to="crank">0 0 0 0 {TURN!r} 0</pose>',
)
SWING = placed("swing", link("rocker", "") + '<frame name="foot"/>')
ROCKING = f'<sdf version="1.10">{SWING}</sdf>'
INCLUDED = f"""<include><uri>model://swing</uri><name>lower</name>
  <pose degrees="true">{BASE} 0 0 0 {-np.degrees(ROCKER):.17g} 0</pose></include>"""
JOINTS = (
    hinge("A", "world", "crank")
    + hinge("B", "crank", "upper::coupler", axis=AXIS)
    + hinge("C", "upper::coupler", "lower::rocker", '<pose relative_to="upper::tip"/>')
    + hinge("D", "world", "lower::foot")
)
NESTED = world(placed("bar", crank() + COUPLING + INCLUDED + JOINTS))


def loaded(folder: Path, text: str, **more: object) -> pt.Mechanism:
    folder.mkdir(exist_ok=True)
    (folder / "model.sdf").write_text(text, "utf-8")
    return pt.load(folder / "model.sdf", **more)  # type: ignore[arg-type]


def included(folder: Path, name: str = "swing", text: str = ROCKING) -> Path:
    """A model in a folder of its own, whose model.config names the file."""
    (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / name / "model.config").write_text(
        '<model><name>n</name><sdf version="1.4">old.sdf</sdf><sdf version="1.10">new.sdf</sdf></model>', "utf-8"
    )
    (folder / name / "new.sdf").write_text(text, "utf-8")
    return folder


HERE = (np.eye(3), np.zeros(3))


def assert_same(m: pt.Mechanism, names: dict[str, str], moved: tuple[Array, Array] = HERE) -> None:
    """Moves as the four-bar drawn by hand, turned and shifted as a whole, whose joints have these names here."""
    expected = drawn("revolute")
    assert m.compile().mobility == 1
    found, built = m.assemble(rates={names["A"]: 2.0}), expected.assemble(rates={"A": 2.0})
    rates, other = (
        dict(zip(one.compile().velocity_names, one.compile().acceleration(s.q, s.v)[0], strict=True))
        for one, s in ((m, found), (expected, built))
    )
    assert max(abs(rates[names[joint]] - other[joint]) for joint in "ABD") < 1e-12 * abs(other["A"])
    positions = {name.rpartition("::")[2]: body.position for name, body in m._description.bodies.items()}
    for name, body in expected._description.bodies.items():
        assert np.abs(positions[name] - moved[0] @ body.position - moved[1]).max() < 1e-14


def test_nested_and_included_models(tmp_path: Path) -> None:
    m = loaded(included(tmp_path), NESTED)
    assert set(m.bodies) == {"crank", "upper::coupler", "lower::rocker"} and m.name == "bar"
    assert_same(m, {joint: joint for joint in "ABD"})


def test_a_model_that_stands_elsewhere(tmp_path: Path) -> None:
    """Inside another one; both are turned about the vertical, and shifted."""
    inner = placed("bar", crank() + COUPLING + INCLUDED + JOINTS, "<pose>1 2 3 0 0 0.7</pose>")
    m = loaded(included(tmp_path), world(placed("outer", inner, "<pose>-3 5 1 0 0 0.4</pose>")))
    one, both = (np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in (0.4, 1.1))
    assert_same(m, {joint: f"bar::{joint}" for joint in "ABD"}, (both, one @ [1, 2, 3] + [-3, 5, 1]))


def test_several_models_in_a_world(tmp_path: Path) -> None:
    """Joined by the world's joints, one placed by a frame of the world, one by a frame of its own."""
    frame = f'<frame name="pivot"><pose>{BASE} 0 0 0 {-ROCKER!r} 0</pose></frame>'
    rocker = placed("c", link("rocker", "<pose>1 2 3 0 0 0.5</pose>"), '<pose relative_to="pivot"/>',
                    'placement_frame="rocker"')  # fmt: skip
    coupler = COUPLING.replace('"upper"', '"b"').replace('relative_to="crank"', 'relative_to="a::crank"')
    joints = (
        hinge("A", "world", "a::crank")
        + hinge("B", "a::crank", "b::coupler", axis=AXIS)
        + hinge("C", "b::coupler", "c::rocker", '<pose relative_to="b::tip"/>')
        + hinge("D", "pivot", "c::rocker")
    )
    m = loaded(tmp_path, world(placed("a", crank()) + frame + coupler + rocker + joints))
    assert set(m.bodies) == {"a::crank", "b::coupler", "c::rocker"} and m.name == "w"
    assert_same(m, {joint: joint for joint in "ABD"})


def test_static_models_are_the_ground(tmp_path: Path) -> None:
    """The base of the four-bar is a link of one: its frame is where the world's is, and it is drawn."""
    shape = '<visual name="v"><geometry><sphere><radius>0.1</radius></sphere></geometry></visual>'
    base = f'<link name="base"><pose>0 0 0 0 0 0.3</pose>{shape}</link><link name="other"/>'
    base = placed("stand", base + hinge("X", "base", "other"), "<static>true</static>")
    joints = JOINTS.replace("world", "stand::base")
    m = loaded(included(tmp_path), world(placed("bar", base + crank() + COUPLING + INCLUDED + joints)))
    assert set(m.bodies) == {"crank", "upper::coupler", "lower::rocker"} and set(m.joints) == set("ABCD")
    assert_same(m, {joint: joint for joint in "ABD"})
    assert 'model "stand"' in str(m.reading) and [*m.reading.shapes] == ["ground"]
    with pytest.raises(pt.errors.DescriptionError, match="nothing in the file can move"):
        loaded(tmp_path, world(placed("bar", link("crank", ""), "<static>1</static>"))).compile()


def test_a_merged_model_has_its_names_in_the_other(tmp_path: Path) -> None:
    merged = INCLUDED.replace("<include>", '<include merge="true">').replace("<name>lower</name>", "")
    text = world(placed("bar", crank() + COUPLING + merged + JOINTS)).replace("lower::", "")
    m = loaded(included(tmp_path), text)
    assert set(m.bodies) == {"crank", "upper::coupler", "rocker"}
    assert_same(m, {joint: joint for joint in "ABD"})


def test_included_files_stay_below_the_root(tmp_path: Path) -> None:
    inside = included(tmp_path / "inside")
    text = NESTED.replace("model://swing", "../outside/new.sdf")
    included(tmp_path, "outside")
    with pytest.raises(pt.errors.FileFormatError, match="lies outside the folder") as reported:
        loaded(inside, text)
    assert reported.value.line is not None
    assert_same(loaded(inside, text, root=tmp_path), {joint: joint for joint in "ABD"})
    # model:// is looked for in the folders up to the root
    beside = included(tmp_path / "deep" / "below")
    (beside / "bar").mkdir()
    assert_same(loaded(beside / "bar", NESTED, root=tmp_path), {joint: joint for joint in "ABD"})
    config = inside / "swing" / "model.config"
    config.write_text('<model><sdf version="1.10">../../outside/new.sdf</sdf></model>', "utf-8")
    with pytest.raises(pt.errors.FileFormatError, match="leads out of its folder"):
        loaded(inside, NESTED, root=tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (NESTED.replace("model://swing", "model://none"), '"model://none": there is no such file'),
        (NESTED.replace("model://swing", "http://none/swing"), "nothing is downloaded"),
        (NESTED.replace("model://swing", "model.sdf"), "which includes this file"),
        (NESTED.replace('"upper"', '"crank"'), 'has the name "crank", which is already in use'),
        (NESTED.replace("upper::coupler", "upper::nobody"), '"nobody", which moves with no link'),
        (NESTED.replace("upper::tip", "upper::nowhere"), '"nowhere", which does not exist'),
        (NESTED.replace('relative_to="crank"', 'relative_to="upper"'), "placed relative to itself: upper -> upper"),
        (NESTED.replace('attached_to="coupler"', 'attached_to="none"'), '"none"'),
        (world(placed("a", crank())).replace("</sdf>", '<world name="v"/></sdf>'), "contains 2 worlds"),
        (world(placed("a", '<frame name="f"/>')), "holds no <link>"),
        (world(placed("a", crank(), '<pose relative_to="b"/>') + placed("b", crank(), '<pose relative_to="a"/>')),
         "relative to itself"),
    ],
)  # fmt: skip
def test_bad_models(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError) as reported:
        loaded(included(tmp_path), text)
    assert words in str(reported.value) and reported.value.line is not None


def test_remarks_on_an_included_file_name_it(tmp_path: Path) -> None:
    included(tmp_path, text=ROCKING.replace("<link", "<plugin name='p' filename='f'/><nonsense/><link"))
    remarks = [remark for remark in loaded(tmp_path, NESTED).reading.dropped if "new.sdf" in remark.name]
    assert len(remarks) == 2 and all(remark.line is None for remark in remarks)


def test_a_link_called_world(tmp_path: Path) -> None:
    """Up to version 1.6 it may be one; joints that name it mean it, and it stands on what its own joint names."""
    body = link("crank", "").replace('"crank"', '"world"')
    text = f'<sdf version="1.6">{placed("m", body + crank() + hinge("A", "world", "crank"))}</sdf>'
    m = loaded(tmp_path, text)
    assert set(m.bodies) == {"world link", "crank"} and m.compile().mobility == 6 + 1
    assert "is not the world" in str(m.reading)
    with pytest.raises(pt.errors.FileFormatError, match="already in use"):
        loaded(tmp_path, text.replace("1.6", "1.7"))


def test_old_versions_know_links_from_joints(tmp_path: Path) -> None:
    """By where they are named; later ones refuse two of one name."""
    base = link("rocker", "<pose>1 2 3 0 0 0.5</pose>")
    joint = hinge("crank", "rocker", "crank", "<pose>0.1 0.2 0.3 0 0 0</pose>").replace("expressed_in", "unused")
    text = f'<sdf version="1.6">{placed("m", joint + base + crank())}</sdf>'
    m = loaded(tmp_path, text)
    expected = loaded(tmp_path, text.replace('joint name="crank"', 'joint name="other"'))
    assert list(m.joints) == ["crank"] and m.compile().mobility == 7
    points = [one._description.joints[name].point for one, name in ((m, "crank"), (expected, "other"))]
    assert points[0] is not None and points[1] is not None and np.array_equal(*points)
    with pytest.raises(pt.errors.FileFormatError, match="already in use"):
        loaded(tmp_path, text.replace("1.6", "1.7"))


def test_a_model_that_is_missing_in_a_world_is_reported(tmp_path: Path) -> None:
    """In a model a part of it would be missing."""
    sun = "<include><uri>model://sun</uri></include>"
    m = loaded(included(tmp_path), world(sun + placed("bar", crank() + COUPLING + INCLUDED + JOINTS)))
    assert_same(m, {joint: joint for joint in "ABD"})
    assert [remark.kind for remark in m.reading.dropped if '"model://sun"' in remark.text] == ["motion"]
    with pytest.raises(pt.errors.FileFormatError, match='"model://sun": there is no such file'):
        loaded(tmp_path, NESTED.replace("<include>", sun + "<include>"))


def test_names_of_folders_alone_are_models(tmp_path: Path) -> None:
    assert_same(loaded(included(tmp_path), NESTED.replace("model://swing", "swing")), {joint: joint for joint in "ABD"})


def test_models_and_frames_by_the_thousand(tmp_path: Path) -> None:
    deep = 500 * '<model name="m"><pose>0 0 1 0 0 1</pose>' + link("crank", "") + 500 * "</model>"
    frames = "".join(f'<frame name="f{i}" attached_to="f{i + 1}"/>' for i in range(3000))
    long = placed("m", link("crank", "") + frames + '<frame name="f3000" attached_to="crank"/>')
    for content in (deep, long):
        with pytest.raises(pt.errors.FileFormatError, match="by hundreds"):
            loaded(tmp_path, f'<sdf version="1.10">{content}</sdf>')
