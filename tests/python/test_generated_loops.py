"""Robots in the form in which onshape-to-robot writes them: loops as pairs of frames, in URDF, SDFormat and MJCF.

A mechanism in the plane x z, drawn with its loops closed. Each link has its frame at the hinge that carries it, the
axis along z of the frame.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import partita as pt
from partita.io.robot import inverse, placed
from partita.io.urdf_writer import rpy
from partita.numeric import quaternion

Array = NDArray[np.float64]
UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes of the plane: y of a link is up in the world, z of it is -y there."""


@dataclass
class Drawing:
    """Links by parent, hinge and angle in the plane; closings by name, the two links, their point, hinged or not."""

    links: dict[str, tuple[str, tuple[float, float], float]]
    closings: list[tuple[str, str, str, tuple[float, float], bool]]

    def pose(self, link: str) -> Array:
        if link == "base":
            return np.eye(4)
        _, (x, z), angle = self.links[link]
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return placed((x, 0.0, z), UP @ turn)

    def frames(self) -> list[tuple[str, str, Array]]:
        """Name, link and pose in the link; the mates of the two sides are turned about their axes by any angle."""
        found = []
        for name, one, other, (x, z), hinged in self.closings:
            for i, link in enumerate((one, other)):
                c, s = np.cos(0.4 + i), np.sin(0.4 + i)
                mate = placed((x, 0.0, z), UP @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
                found.append((f"{name}_{i + 1}", link, inverse(self.pose(link)) @ mate))
                if hinged:
                    beyond = found[-1][2] @ placed((0.0, 0.0, 0.1), np.eye(3))
                    found.append((f"{name}_{i + 1}_z", link, beyond))
        return found

    def inertia(self, link: str) -> tuple[float, tuple[float, float, float]]:
        mass = 0.3 + 0.1 * len(link)
        return mass, (2e-3 * mass, 3e-3 * mass, 4e-3 * mass)

    def built(self, gravity: tuple[float, ...]) -> pt.Mechanism:
        m = pt.Mechanism("by calls", gravity=gravity)
        for link, (parent, (x, z), _) in self.links.items():
            mass, moments = self.inertia(link)
            pose = self.pose(link)
            m.add_body(link, mass=mass, inertia=moments, com=(0.1, 0.02, 0.0), position=pose[:3, 3],
                       orientation=pose[:3, :3])  # fmt: skip
            carrier = m.ground if parent == "base" else parent
            m.add_revolute(f"to_{link}", carrier, link, point=(x, 0.0, z), axis=(0, -1, 0))
        for name, one, other, (x, z), hinged in self.closings:
            if hinged:
                m.add_revolute(name, one, other, point=(x, 0.0, z), axis=(0, -1, 0))
            else:
                m.add_spherical(name, one, other, point=(x, 0.0, z))
        return m

    def relative(self, link: str) -> Array:
        return inverse(self.pose(self.links[link][0])) @ self.pose(link)


def numbers(values: Array | tuple[float, ...] | list[float]) -> str:
    return " ".join(f"{x:.17g}" for x in values)


def sixed(pose: Array) -> str:
    return numbers([*pose[:3, 3], *rpy(pose[:3, :3])])


def as_urdf(drawing: Drawing) -> str:
    def origin(pose: Array) -> str:
        return f'<origin xyz="{numbers(pose[:3, 3])}" rpy="{numbers(rpy(pose[:3, :3]))}" />'

    def inertial(mass: float, moments: tuple[float, ...], com: str = "0.1 0.02 0") -> str:
        x, y, z = moments
        inertia = f'<inertia ixx="{x!r}" ixy="0"  ixz="0" iyy="{y!r}" iyz="0" izz="{z!r}" />'
        return f'<inertial><origin xyz="{com}" rpy="0 0 0"/><mass value="{mass!r}" />{inertia}</inertial>'

    parts = ['<?xml version="1.0" ?><!-- a comment --><robot name="drawn">']
    parts.append(f'<link name="base">{inertial(1.0, (1e-3, 1e-3, 1e-3))}</link>')
    for link in drawing.links:
        parts.append(f'<link name="{link}">{inertial(*drawing.inertia(link))}</link>')
    for name, link, pose in drawing.frames():
        dummy = inertial(1e-9, (0.0, 0.0, 0.0), "0 0 0")
        parts.append(f'<link name="{name}">{origin(np.eye(4))}{dummy}</link>')
        ends = f'<parent link="{link}" /><child link="{name}" /><axis xyz="0 0 0"/>'
        parts.append(f'<joint name="{name}_frame" type="fixed">{origin(pose)}{ends}</joint>')
    for link, (parent, _, _) in drawing.links.items():
        ends = f'<parent link="{parent}" /><child link="{link}" /><axis xyz="0 0 1"/>'
        more = '<limit effort="10" velocity="10" lower="-3.14159" upper="3.14159" />'
        parts.append(f'<joint name="to_{link}" type="revolute">{origin(drawing.relative(link))}{ends}{more}</joint>')
    return "\n".join([*parts, "</robot>"])


def as_sdf(drawing: Drawing) -> str:
    def inertial(mass: float, moments: tuple[float, ...]) -> str:
        x, y, z = moments
        inner = f"<ixx>{x!r}</ixx><ixy>0</ixy><ixz>0</ixz><iyy>{y!r}</iyy><iyz>0</iyz><izz>{z!r}</izz>"
        return f"<inertial><pose>0.1 0.02 0 0 0 0</pose><mass>{mass!r}</mass><inertia>{inner}</inertia></inertial>"

    parts = ['<?xml version="1.0" ?><sdf version="1.7"><model name="drawn">']
    parts.append(f'<link name="base">{inertial(1.0, (1e-3, 1e-3, 1e-3))}<pose>0 0 0 0 0 0</pose></link>')
    parts.append('<joint name="base_fixed_world" type="fixed"><parent>world</parent><child>base</child></joint>')
    for link, (parent, _, _) in drawing.links.items():
        body = f'{inertial(*drawing.inertia(link))}<pose relative_to="to_{link}">0 0 0 0 0 0</pose>'
        parts.append(f'<link name="{link}">{body}</link>')
        ends = f"<parent>{parent}</parent><child>{link}</child>"
        pose = f'<pose relative_to="{parent}">{sixed(drawing.relative(link))}</pose>'
        dynamics = "<dynamics><friction>0.0</friction><damping>0.0</damping></dynamics>"
        axis = f"<axis><xyz>0 0 1</xyz><limit><effort>10</effort><velocity>10</velocity></limit>{dynamics}</axis>"
        parts.append(f'<joint name="to_{link}" type="revolute">{pose}{ends}{axis}</joint>')
    for name, link, pose in drawing.frames():
        parts.append(f'<frame name="{name}"><pose relative_to="{link}">{sixed(pose)}</pose></frame>')
    return "\n".join([*parts, "</model></sdf>"])


def as_mjcf(drawing: Drawing, equalities: bool = True) -> str:
    def place(pose: Array) -> str:
        return f'pos="{numbers(pose[:3, 3])}" quat="{numbers(quaternion(pose[:3, :3]))}"'

    def inertial(mass: float, moments: tuple[float, ...]) -> str:
        return f'<inertial pos="0.1 0.02 0" mass="{mass!r}" fullinertia="{numbers(moments)} 0 0 0" />'

    def body(link: str) -> str:
        pose, joint = drawing.relative(link), f'<joint axis="0 0 1" name="to_{link}" type="hinge" range="-3.14 3.14" />'
        return f'<body name="{link}" {place(pose)} >{joint}{inertial(*drawing.inertia(link))}{inside(link)}</body>'

    def inside(link: str) -> str:
        sites = [f'<site group="3" name="{n}" {place(pose)}  />' for n, on, pose in drawing.frames() if on == link]
        return "".join([*sites, *(body(child) for child, (parent, _, _) in drawing.links.items() if parent == link)])

    pairs = []
    for name, _, _, _, hinged in drawing.closings if equalities else ():
        pairs.append(f'<connect site1="{name}_1" site2="{name}_2" />')
        pairs += [f'<connect site1="{name}_1_z" site2="{name}_2_z" />'] if hinged else []
    base = f'<body name="base" pos="0 0 0" quat="1 0 0 0" >{inertial(1.0, (1e-3, 1e-3, 1e-3))}{inside("base")}</body>'
    settings = '<compiler angle="radian" autolimits="true" /><option gravity="0 0 -9.81"/>'
    tree = f"<worldbody>{base}</worldbody><actuator></actuator><equality>{''.join(pairs)}</equality>"
    return f'<?xml version="1.0" ?><mujoco model="drawn">{settings}{tree}</mujoco>'


FORMS = {".urdf": as_urdf, ".sdf": as_sdf, ".xml": as_mjcf}
FOUR_BAR = Drawing(
    {
        "crank": ("base", (0.0, 0.0), 1.1),
        "coupler": ("crank", (0.14, 0.27), 0.5),
        "rocker": ("base", (1.0, 0.0), 1.9),
    },
    [("closing_top", "coupler", "rocker", (0.8, 0.65), False)],
)
LEG = Drawing(
    {
        "thigh": ("base", (0.0, 0.0), -1.2),
        "shank": ("thigh", (0.15, -0.37), -1.9),
        "foot": ("shank", (0.02, -0.75), 0.1),
        "lever": ("base", (-0.1, 0.05), -2.8),
        "rod": ("lever", (-0.2, 0.01), -1.0),
        "rocker": ("thigh", (0.1, -0.2), -2.9),
        "pull": ("rocker", (-0.02, -0.24), -1.6),
    },
    [("closing_knee", "rod", "shank", (0.1, -0.45), True), ("closing_ankle", "pull", "foot", (-0.05, -0.7), False)],
)
DRAWINGS = {"four-bar": (FOUR_BAR, 1), "leg": (LEG, 3)}


@pytest.mark.parametrize("suffix", FORMS)
@pytest.mark.parametrize("name", DRAWINGS)
def test_a_generated_file_moves_as_drawn(name: str, suffix: str, tmp_path: Path) -> None:
    if suffix == ".xml":
        pytest.importorskip("mujoco")
    drawing, mobility = DRAWINGS[name]
    path = tmp_path / f"robot{suffix}"
    path.write_text(FORMS[suffix](drawing), "utf-8")
    found = pt.load(path)
    expected = drawing.built(tuple(found.gravity))  # SDFormat has its own where a model stands in no world
    assert found.compile().mobility == expected.compile().mobility == mobility
    assert found.assemble().assembly["residual"] < 1e-12
    rates = {"to_crank": 2.0} if name == "four-bar" else {"to_thigh": 1.0, "to_shank": -2.0, "to_foot": 0.5}
    at = [(m.compile(), m.assemble(rates=rates)) for m in (found, expected)]
    one, other = (dict(zip(c.velocity_names, c.acceleration(s.q, s.v)[0], strict=True)) for c, s in at)
    size = max(abs(other[f"to_{link}"]) for link in drawing.links)
    assert max(abs(one[f"to_{link}"] - other[f"to_{link}"]) for link in drawing.links) < 1e-9 * size
    remarks = [group for group in found.remarks if "names of the frames do not say how" in group.text]
    assert len(remarks) == (suffix != ".xml")
    if remarks:
        untyped = drawing.closings[-1][0]
        assert remarks[0].names == (f"{untyped}_1 and {untyped}_2",) and "joined at a point, since" in remarks[0].text
        assert {".urdf": "loops=", ".sdf": "loops=, or a <joint> between"}[suffix] in remarks[0].text


def test_types_in_names_and_joints_of_sdf(tmp_path: Path) -> None:
    """A type in the names is followed; a joint that names the frames closes the loop itself."""
    path, text = tmp_path / "robot.sdf", as_sdf(FOUR_BAR)
    path.write_text(
        text.replace("closing_top_1", "closing_top_1_6D").replace("closing_top_2", "closing_top_2_6D"), "utf-8"
    )
    kinds = {joint["name"]: joint["kind"] for joint in pt.load(path).compile().summary["joints"]}
    assert kinds["closing_top_1_6D = closing_top_2_6D"] == "fixed"
    joint = '<joint name="C" type="ball"><parent>closing_top_1</parent><child>closing_top_2</child></joint></model>'
    attached = text.replace('_1"><pose relative', '_1" attached_to="coupler"><pose relative')
    attached = attached.replace('_2"><pose relative', '_2" attached_to="rocker"><pose relative')
    path.write_text(attached.replace("</model>", joint), "utf-8")
    m = pt.load(path)
    assert [name for name in m.joints if not name.startswith("to_")] == ["base_fixed_world", "C"]
    assert m.compile().mobility == 1


def test_sites_that_nothing_joins_are_reported(tmp_path: Path) -> None:
    """As of a slider, which the program leaves open in MJCF."""
    pytest.importorskip("mujoco")
    path = tmp_path / "robot.xml"
    path.write_text(as_mjcf(FOUR_BAR, equalities=False), "utf-8")
    m = pt.load(path)
    assert m.compile().mobility == 3
    (remark,) = (group for group in m.remarks if "look like ends of loops" in group.text)
    assert remark.kind == "motion" and "an <equality> closes them" in remark.text and "closing_top_1 and" in remark.text


def test_closedloop_without_a_type_is_welded(tmp_path: Path) -> None:
    """As the loader of these names does; a list without types is the same."""
    path = tmp_path / "robot.urdf"
    path.write_text(
        as_urdf(FOUR_BAR).replace("closing_top_1", "closedloop1_A").replace("closing_top_2", "closedloop1_B")
    )
    m = pt.load(path)
    assert [joint["kind"] for joint in m.compile().summary["joints"] if " = " in joint["name"]] == ["fixed"]
    (remark,) = (group for group in m.remarks if "names of the frames do not say how" in group.text)
    assert remark.text.startswith("welded, since") and "_3D (points joined)" in remark.text


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    """No list is empty, and no error is 0: welds in place of joints, a link too long, coordinates beyond measure."""
    welded = as_urdf(LEG).replace('_ankle_1"', '_ankle_1_6D"').replace('_ankle_2"', '_ankle_2_6D"')
    long = as_urdf(FOUR_BAR).replace(f'xyz="{numbers(FOUR_BAR.relative("rocker")[:3, 3])}"', 'xyz="1e3 0 0"')
    path = tmp_path / "robot.urdf"
    for text, closing in (
        (welded.replace('_knee_1"', '_knee_1_6D"').replace('_knee_2"', '_knee_2_6D"'), ""),
        (long, "top"),
    ):
        path.write_text(text, "utf-8")
        with pytest.raises(pt.errors.AssemblyError) as caught:
            pt.load(path).assemble()
        message = str(caught.value)
        assert closing in message and re.search(
            r"not closed: joint \".*? by [1-9]|not closed: joint \".*? by 0\.0*[1-9]", message
        )
        assert not re.search(r": ;|: \.|  |by 0[ ,;]", message)
    for size, words in (("1e160", "magnitudes above 1e\\+60"), ("1e400", "finite")):
        path.write_text(as_urdf(FOUR_BAR).replace('<origin xyz="', f'<origin xyz="{size} 0 0" was="'), "utf-8")
        with pytest.raises(pt.errors.FileFormatError, match=f'<origin> has "xyz" "{size} 0 0"; .*{words}'):
            pt.load(path)


def test_an_axis_has_a_direction_however_short_it_is(tmp_path: Path) -> None:
    for suffix, form, old in ((".urdf", as_urdf, 'axis xyz="0 0 1"'), (".sdf", as_sdf, "<xyz>0 0 1</xyz>")):
        path = tmp_path / f"robot{suffix}"
        path.write_text(form(FOUR_BAR).replace(old, old.replace("0 0 1", "0 0 1e-200")), "utf-8")
        assert pt.load(path).compile().mobility == 1
