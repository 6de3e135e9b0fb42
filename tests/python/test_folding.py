"""Chains of joints with massless links between them are folded, whatever the order of the file."""

import re
from pathlib import Path

import numpy as np
import pytest
from test_urdf import LOOP, tree, written

import partita as pt

GIMBALS = """
  <link name="base"/><link name="i1"/><link name="i2"/><link name="i3"/><link name="i4"/>
  <link name="ball"><inertial><mass value="1"/><origin xyz="0 0 0.3"/>
    <inertia ixx="1" iyy="2" izz="2"/></inertial></link>
  <link name="rod"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <link name="tube"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <link name="tip"/>
  <joint name="x" type="continuous"><parent link="base"/><child link="i1"/><axis xyz="1 0 0"/></joint>
  <joint name="y" type="continuous"><parent link="i1"/><child link="i2"/><axis xyz="0 1 0"/></joint>
  <joint name="z" type="continuous"><parent link="i2"/><child link="ball"/><axis xyz="0 0 1"/></joint>
  <joint name="u" type="continuous"><parent link="ball"/><child link="i3"/><origin xyz="0 0 1"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="v" type="continuous"><parent link="i3"/><child link="rod"/><axis xyz="0 0 1"/></joint>
  <joint name="s" type="prismatic"><parent link="rod"/><child link="i4"/><origin xyz="0 1 0"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="w" type="continuous"><parent link="i4"/><child link="tube"/><axis xyz="0 1 0"/></joint>
  <joint name="t" type="fixed"><parent link="tube"/><child link="tip"/></joint>"""


def test_the_order_of_a_file_does_not_matter(tmp_path: Path) -> None:
    elements = [item for item in re.split(r"(?=<link|<joint)", GIMBALS.strip()) if item]
    rng = np.random.default_rng(5)
    forwards = np.arange(len(elements))
    expected: dict[str, float] = {}
    for order in (forwards, forwards[::-1], *(rng.permutation(len(elements)) for _ in range(40))):
        text = "".join(elements[i] for i in order)
        m = pt.load(written(tmp_path, f'<robot name="r">{text}</robot>'))
        compiled = m.compile()
        kinds = {joint["name"]: joint["kind"] for joint in compiled.summary["joints"]}
        assert kinds == {"z": "spherical", "v": "universal", "w": "cylindrical"}
        moving = m.assemble(rates={"v.turn1": 0.3, "v.turn2": 0.5})
        rates = compiled.acceleration(moving.q, moving.v)[0]
        found = dict(zip(compiled.velocity_names, rates, strict=True))
        expected = expected or found
        # the order of the equations changes rounding alone
        assert max(abs(found[name] - value) for name, value in expected.items()) < 1e-12 * np.abs(rates).max()


END = '<link name="end"><inertial><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}"/></inertial></link>'
FIXED = '<joint name="end" type="fixed"><parent link="crank"/><child link="end"/></joint>'


def test_a_massless_link_with_inertia_is_no_frame(tmp_path: Path) -> None:
    """Welded to the crank it adds its inertia; a frame adds nothing, nor does one whose inertia is rounding."""
    plain = pt.load(written(tmp_path, tree(LOOP)))
    inertia = plain.compile().mass_matrix(plain.assemble().q)[0, 0]
    for moment, bodies in ((0.02, 4), (0.0, 3), (1e-20, 3)):
        end = END.format(0, moment, moment, moment) + FIXED
        m = pt.load(written(tmp_path, tree(LOOP + end)))
        column = m.compile().velocity_names.index("A")
        found = m.compile().mass_matrix(m.assemble().q)[column, column]
        assert len(m.bodies) == bodies and abs(found - inertia - (moment if bodies == 4 else 0.0)) < 1e-15


def test_the_mass_of_a_frame_is_that_of_its_link(tmp_path: Path) -> None:
    """As of a body that is welded there, to the last digits; a link without mass stays so."""
    end = END.format(9e-10, 0, 0, 0) + FIXED.replace("/></joint>", '/><origin xyz="0.3 0.2 0.1" rpy="1 2 3"/></joint>')
    m = pt.load(written(tmp_path, tree(LOOP + end)))
    heavier = pt.load(written(tmp_path, tree(LOOP + end.replace("9e-10", "9e-9"))))
    plain = pt.load(written(tmp_path, tree(LOOP)))
    assert len(m.bodies) == len(heavier.bodies) - 1 == 3 and "its mass is added there" in str(m.reading)
    inertias = []
    for one in (plain, m, heavier):
        column = one.compile().velocity_names.index("A")
        inertias.append(one.compile().mass_matrix(one.assemble().q)[column, column])
    assert inertias[1] - inertias[0] == pytest.approx(0.1 * (inertias[2] - inertias[0]), rel=1e-6)  # of 1e-10 of them
    base = pt.load(written(tmp_path, tree(LOOP + end.replace('link="crank"', 'link="base"'))))
    assert len(base.bodies) == 3 and "is omitted, since that link has none" in str(base.reading)


def test_joints_that_move_no_mass_are_named(tmp_path: Path) -> None:
    """A finger that follows the crank moves with it, one that follows another such finger does not; a loop moves what
    it closes."""
    follower = '<mimic joint="{}"/></joint><link name="{}"/>'
    fingers = ""
    for name, leader in (("f", "A"), ("g", "h"), ("h", "")):
        joint = f'<joint name="{name}" type="revolute"><parent link="base"/><child link="{name}"/><axis xyz="1 0 0"/>'
        fingers += joint + (follower.format(leader, name) if leader else f'</joint><link name="{name}"/>')
    m = pt.load(written(tmp_path, tree(LOOP + fingers)))
    named = [remark.name for remark in m.reading.changed if "indeterminate" in remark.text]
    assert named == ['joint "g"', 'joint "h"']
    with pytest.raises(pt.errors.PartitaError, match="moves no mass"):
        m.simulate(0.1)
