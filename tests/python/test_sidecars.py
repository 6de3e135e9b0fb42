"""Joint types and loops that stand beside a URDF, or in the names of its frames, against mechanisms drawn by hand."""

from pathlib import Path

import numpy as np
import pytest
from test_urdf import BASE, GRAVITY, LENGTHS, LOOP, PAIR, angles, drawn, ends, mark, tree, written

import partita as pt

TURNED = "1.5707963267948966 0 0"  # z of such a frame is -y of its link


def frame(name: str, link: str, x: float, z: float = 0.0) -> str:
    """A link of no mass on another one, z along the axis of the hinges."""
    return f"""
  <link name="{name}"/>
  <joint name="{name}_joint" type="fixed"><parent link="{link}"/><child link="{name}"/>
    <origin xyz="{x} {-z} 0" rpy="{TURNED}"/></joint>"""


def pair(one: str, other: str, z: float = 0.0) -> str:
    return frame(one, "coupler", LENGTHS["coupler"], z) + frame(other, "rocker", LENGTHS["rocker"], z)


def kinds(m: pt.Mechanism) -> dict[str, str]:
    return {joint["name"]: joint["kind"] for joint in m.compile().summary["joints"]}


def rates(m: pt.Mechanism) -> dict[str, float]:
    """Accelerations as drawn, all independent joints in motion."""
    compiled, state = m.compile(), m.assemble(rates={"A": 2.0})
    return dict(zip(compiled.velocity_names, compiled.acceleration(state.q, state.v)[0], strict=True))


@pytest.mark.parametrize(
    ("types", "axes", "turned_by"),
    [
        (("UJOINT_ZY", "SPHERICAL"), "zy", {"A": 2.0, "D.turn1": 0.7}),
        (("ujoint_yx", "SPHERICAL"), "yx", {"A": 2.0, "D.turn2": 0.7}),
    ],
)
def test_types_replace_those_of_the_tree(
    types: tuple[str, str], axes: str, turned_by: dict[str, float], tmp_path: Path
) -> None:
    """The crank turns a coupler on a ball joint; the rocker stands on a universal joint by axes of its frame."""
    text = tree(ends("here", "there"), {})
    m = pt.load(written(tmp_path, text, f"{PAIR}joint_name: [D, B]\njoint_type: [{', '.join(types)}]\n"))
    expected = pt.Mechanism("the same", gravity=GRAVITY)
    built = drawn("spherical")
    for body in built._description.bodies.values():
        expected.add_body(body.name, mass=body.mass, inertia=body.inertia, com=body.com, position=body.position,
                          orientation=body.rotation)  # fmt: skip
    points = {name: joint.point for name, joint in built._description.joints.items()}
    turned = built._description.bodies["rocker"].rotation
    first, second = (turned[:, "xyz".index(axis)] for axis in axes)
    expected.add_revolute("A", expected.ground, "crank", point=points["A"], axis=(0, -1, 0))
    expected.add_spherical("B", "crank", "coupler", point=points["B"])
    expected.add_universal("D", expected.ground, "rocker", point=points["D"], axis1=first, axis2=second)
    expected.add_spherical("C", "coupler", "rocker", point=points["C"])
    assert m.compile().mobility == expected.compile().mobility == 1 + 3 + 2 - 3
    assert m.assemble().assembly["residual"] < 1e-12
    moving = [one.assemble(rates=turned_by) for one in (m, expected)]
    found, by_rates = (
        dict(zip(one.compile().velocity_names, one.compile().acceleration(s.q, s.v)[0], strict=True))
        for one, s in zip((m, expected), moving, strict=True)
    )
    names = ("A", "D.turn1", "D.turn2")
    assert max(abs(found[name] - by_rates[name]) for name in names) < 1e-10 * max(map(abs, by_rates.values()))
    assert f'joint "D": {types[0]}, by robot.yaml' in str(m.reading)


def test_fixed_joints_and_dampers_of_others(tmp_path: Path) -> None:
    damped = tree(ends("here", "there")).replace(
        '<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0"/><dynamics damping="0.5"/>'
    )
    m = pt.load(written(tmp_path, damped, "joint_name: [B, D]\njoint_type: [FIXED, SPHERICAL]\n"))
    assert kinds(m) == {"A": "revolute", "B": "fixed", "D": "spherical"} and m.compile().mobility == 4
    assert [str(remark).partition(": ")[2] for remark in m.reading.dropped if "damping" in remark.text] == [
        'joint "B" damping 0.5: FIXED in robot.yaml, whose damping is not read: add_torsion_spring',
        'joint "D" damping 0.5: SPHERICAL in robot.yaml, whose damping is not read: add_torsion_spring',
    ]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("joint_name: [B]\n", "1 joints and joint_type 0 types"),
        ("joint_name: B\njoint_type: FIXED\n", "list of words"),
        ("joint_name: [b]\njoint_type: [FIXED]\n", 'there is no joint "b"'),
        ("joint_name: [B, B]\njoint_type: [FIXED, FIXED]\n", '"B" appears twice'),
        ("joint_name: [B]\njoint_type: [UJOINT_XX]\n", 'of joint "B" is "UJOINT_XX"; known: SPHERICAL, FIXED, UJOINT_'),
    ],
)
def test_bad_types(lines: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match="yaml") as reported:
        pt.load(written(tmp_path, tree(ends("here", "there")), PAIR + lines))
    assert words in str(reported.value) and reported.value.line in (4, 5)


BY_NAME = {
    "point": (pair("closedloop0_A_3D", "closedloop0_B_3D"), "spherical"),
    "weld": (pair("closedloop0_B_6D", "closedloop0_A_6D"), "fixed"),
    "in the middle": (pair("closedloop3D_1A", "closedloop3D_1B"), "spherical"),
    "words before": (pair("left_closing_knee_1", "left_closing_knee_2"), "spherical"),
    "closed loop": (pair("left_closedloop0_A", "left_closedloop0_B"), "fixed"),
    "hinge": (
        pair("closing_top_1", "closing_top_2") + pair("closing_top_1_z", "closing_top_2_z", 0.1),
        "revolute",
    ),
}


@pytest.mark.parametrize("case", BY_NAME)
def test_names_of_frames_close_loops(case: str, tmp_path: Path) -> None:
    frames, kind = BY_NAME[case]
    m = pt.load(written(tmp_path, tree(frames)))
    closed = [joint for joint in m.compile().summary["joints"] if " = " in joint["name"]]
    assert [joint["kind"] for joint in closed] == [kind]
    assert "by their names" in str(m.reading)
    # an assumption is reported, what the names say is not
    assert ("do not say how the loop is closed" in str(m.reading)) == (case in ("words before", "closed loop"))
    if kind != "fixed":
        expected = drawn(kind)
        assert m.compile().mobility == expected.compile().mobility == 1
        assert rates(m)["A"] == pytest.approx(rates(expected)["A"], rel=1e-12)


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        (pair("closing_a_1_3D", "closing_a_2_6D"), "different kinds, 3d and 6d"),
        (frame("closedloop_1A", "coupler", 1.0), "it has two"),
    ],
)
def test_names_that_do_not_agree(frames: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(pt.errors.FileFormatError, match=words):
        pt.load(written(tmp_path, tree(frames)))


def test_links_that_move_and_have_mass_are_no_frames(tmp_path: Path) -> None:
    """Whatever they are called."""
    text = tree(LOOP).replace('"crank"', '"closing_crank_1"')
    assert pt.load(written(tmp_path, text)).compile().mobility == 1


def test_a_sidecar_of_another_name(tmp_path: Path) -> None:
    model = written(tmp_path, tree(ends("here", "there")))
    other, third = tmp_path / "loops.yaml", tmp_path / "again.yml"
    (tmp_path / "settings.yaml").write_text("- closed_loop\n", "utf-8")
    (tmp_path / "broken.yaml").write_text("closed_loop: [\n", "utf-8")
    assert pt.load(model).compile().mobility == 3
    other.write_text(PAIR, "utf-8")
    found = pt.load(model)
    assert found.compile().mobility == 1 and "joined at a point, by loops.yaml" in str(found.reading)
    # of another robot, by its frames, by its name, or because it says so
    other.write_text(PAIR.replace("there", "elsewhere"), "utf-8")
    assert pt.load(model).compile().mobility == 3
    other.write_text(f"urdf: other.urdf\n{PAIR}", "utf-8")
    assert pt.load(model).compile().mobility == 3
    other.write_text(PAIR, "utf-8")
    (tmp_path / "loops.urdf").write_text(tree(), "utf-8")
    assert pt.load(model).compile().mobility == 3
    (tmp_path / "loops.urdf").unlink()
    third.write_text(f"urdf: robot.urdf\n{PAIR}", "utf-8")
    both = pt.load(model)
    assert both.compile().mobility == 3 and "again.yml, loops.yaml all list loops of this robot" in str(both.reading)
    assert pt.load(model, loops=third).compile().mobility == 1


def test_the_caller_names_the_sidecar(tmp_path: Path) -> None:
    model = written(tmp_path, tree(ends("here", "there")), "name_mot: [A]\n")
    (tmp_path / "elsewhere").mkdir()
    listed = tmp_path / "elsewhere" / "loops.txt"
    listed.write_text(PAIR, "utf-8")
    assert pt.load(model).compile().mobility == 3
    assert pt.load(model, loops=str(listed)).compile().mobility == 1
    with pytest.raises(pt.errors.MissingFileError, match=r"none\.yaml"):
        pt.load(model, loops=tmp_path / "none.yaml")
    drawn("revolute").save(tmp_path / "drawn.toml")
    with pytest.raises(pt.errors.ArgumentError, match="TOML states its own") as reported:
        pt.load(tmp_path / "drawn.toml", loops=listed)
    assert reported.value.argument == "loops"
    with pytest.raises(pt.errors.ArgumentError, match="loops must be the name of a file"):
        pt.load(model, loops=3)  # type: ignore[arg-type]


def test_pairs_that_are_open_are_reported(tmp_path: Path) -> None:
    """By their names, or drawn in one place; what is closed, or lies apart, is not."""
    apart = mark("far_A", "coupler", 0.1) + mark("far_B", "rocker", 0.1)
    text = tree(LOOP + pair("closing_top_1", "closing_top_2") + ends("tip_A", "tip_B") + apart)
    m = pt.load(written(tmp_path, text, "closed_loop: []\n"))
    remarks = [remark.text for remark in m.reading.dropped if "open" in remark.text]
    assert len(remarks) == 1 and "closing_top_1 and closing_top_2, tip_A and tip_B look like" in remarks[0]
    closed = pt.load(written(tmp_path, tree(pair("tip_A", "tip_B")), "closed_loop: [[tip_B, tip_A]]\ntype: [3d]\n"))
    assert not [remark for remark in closed.reading.dropped if "open" in remark.text]
    assert np.isclose(BASE, 1.0) and len(angles()) == 3


def test_links_that_lead_elsewhere(tmp_path: Path) -> None:
    """No sidecar is read through them, unless the caller names it."""
    inside = tmp_path / "robot"
    inside.mkdir()
    model, outside = written(inside, tree(ends("here", "there"))), tmp_path / "outside.yaml"
    outside.write_text(PAIR, "utf-8")
    try:
        (inside / "loops.yaml").symlink_to(outside)
    except OSError:
        pytest.skip("no links here")
    assert pt.load(model).compile().mobility == 3
    assert pt.load(model, root=tmp_path).compile().mobility == 1
    (inside / "loops.yaml").rename(inside / "robot.yaml")
    with pytest.raises(pt.errors.FileFormatError, match="a link that leads out of"):
        pt.load(model)
    assert pt.load(model, loops=inside / "robot.yaml").compile().mobility == 1
