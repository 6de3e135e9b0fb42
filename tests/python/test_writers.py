"""URDF and MJCF as they are written: read back they move as drawn, in MuJoCo too; nothing is lost in silence."""

import json
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from test_urdf import drawn

import partita as pt
from partita.cli import main
from partita.state import State

ROBOTS = pytest.mark.parametrize("suffix", [".urdf", ".mjcf"])
TURN = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3.0


def there_and_back(m: pt.Mechanism, folder: Path, suffix: str) -> pt.Mechanism:
    if suffix == ".mjcf":
        pytest.importorskip("mujoco")
    assert not m.save(folder / f"robot{suffix}", strict=True).dropped
    return pt.load(folder / f"robot{suffix}")


def body(m: pt.Mechanism, name: str, position: tuple[float, float, float], turn: float = 0.7) -> object:
    """A body with a full inertia, its centre of mass off its origin, its axes off the world's."""
    axes = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]]) @ TURN
    inertia = TURN @ np.diag([0.1, 0.2, 0.25]) @ TURN.T
    return m.add_body(name, mass=1.3, inertia=0.5 * (inertia + inertia.T), com=(0.1, 0.2, -0.05), position=position,
                      orientation=axes)  # fmt: skip


PLACE = (0.2, 0.1, -0.3)
KINDS = {
    "revolute": {"axis": (1, 2, 2)},
    "prismatic": {"axis": (1, 2, 2)},
    "cylindrical": {"axis": (1, 2, 2)},
    "screw": {"axis": (1, 2, 2), "pitch": 0.3},
    "spherical": {},
    "universal": {"axis1": (1, 2, 2), "axis2": (2, 1, -2)},
    "planar": {"normal": (1, 2, 2)},
    "fixed": {},
    "free": {},
    "joint": {"free": ("x", "z", "rx", "ry", "rz"), "frame": TURN},
    "point_on_line": {"axis": (1, 2, 2)},
    "point_on_plane": {"normal": (1, 2, 2)},
    "parallel": {"axis": (1, 2, 2)},
    "perpendicular": {"axis1": (1, 2, 2), "axis2": (2, 1, -2)},
    "orientation": {},
    "pin_slot": {"axis1": (1, 2, 2), "axis2": (2, 1, -2)},
}


def carried(kind: str, reverse: bool = False) -> pt.Mechanism:
    """A joint of a kind on a swinging body, and another hinge on what it carries."""
    m = pt.Mechanism(f"{kind} & <\"others'>", gravity=(1.0, -2.0, -9.0))
    arm = body(m, "arm", (0, 0, 0), 0.3)
    held = body(m, "held", (0.4, 0.1, 0.2), 0.7)
    end = body(m, "end", (0.5, 0.5, 0.1), 1.9)
    m.add_revolute("base", m.ground, arm, point=(0.05, 0, 0), axis=(0, 1, 0.5))
    ends = (held, arm) if reverse else (arm, held)
    getattr(m, f"add_{kind}")("J", *ends, point=PLACE, **KINDS[kind])
    m.add_revolute("tip", held, end, point=(0.5, 0.4, 0.1), axis=(1, 0, 1))
    return m


def moved(m: pt.Mechanism, bodies: tuple[str, ...], initial: State | None = None) -> dict[str, np.ndarray]:
    """Where the centres of mass are, and how the bodies are turned, along a run from rest."""
    r = m.simulate(0.3, t_eval=np.linspace(0, 0.3, 4), rtol=1e-11, atol=1e-13, initial=initial)
    assert r.success
    of = m._description.bodies
    return {name: np.concatenate([r.body(name).point(of[name].com), r.body(name).rotation.reshape(4, 9)], axis=1)
            for name in bodies}  # fmt: skip


@ROBOTS
@pytest.mark.parametrize("kind", KINDS)
def test_every_joint_moves_as_it_was_drawn(kind: str, suffix: str, tmp_path: Path) -> None:
    m = carried(kind)
    back = there_and_back(m, tmp_path, suffix)
    a, b = moved(m, m.bodies), moved(back, m.bodies)
    for name in m.bodies:  # to the tolerance of the run, on ways of decimetres
        assert np.abs(a[name] - b[name]).max() < 1e-9, name
    assert np.abs(a["end"][-1] - a["end"][0]).max() > 0.1


@ROBOTS
@pytest.mark.parametrize("kind", ["revolute", "universal", "joint", "screw"])
def test_a_joint_passed_the_other_way_has_the_same_coordinates(kind: str, suffix: str, tmp_path: Path) -> None:
    m = carried(kind, reverse=True)
    back = there_and_back(m, tmp_path, suffix)
    a, b = moved(m, m.bodies), moved(back, m.bodies)
    for name in m.bodies:
        assert np.abs(a[name] - b[name]).max() < 1e-9, name
    if kind == "revolute":
        v = m.simulate(0.1, rtol=1e-11), back.simulate(0.1, rtol=1e-11)
        assert abs(v[0].joint("J").position[-1] - v[1].joint("J").position[-1]) < 1e-9


FOLDED = ("revolute", "prismatic", "cylindrical", "spherical", "universal", "planar", "free")


@pytest.mark.parametrize("kind", FOLDED)
def test_urdf_comes_back_with_the_same_joints(kind: str, tmp_path: Path) -> None:
    """Chains through links of no mass are one joint again: the same coordinates and accelerations at any state."""
    m = carried(kind)
    back = there_and_back(m, tmp_path, ".urdf")
    one, other = m.compile(), back.compile()
    assert [(j["name"], j["kind"]) for j in one.summary["joints"]] == [
        (j["name"], j["kind"]) for j in other.summary["joints"]
    ]
    assert one.names == other.names
    rng = np.random.default_rng(len(kind))
    q, v = rng.normal(size=len(one.names)), rng.normal(size=len(one.velocity_names))
    four = [i for i, name in enumerate(one.names) if name.endswith((".qw", ".qx", ".qy", ".qz"))]
    if len(four) == 4:
        q[four] /= np.linalg.norm(q[four])
    a, b = one.acceleration(q, v)[0], other.acceleration(q, v)[0]
    assert np.abs(a - b).max() < 1e-12 * np.abs(a).max()


LOOPS = {
    kind: KINDS[kind] for kind in ("revolute", "prismatic", "cylindrical", "spherical", "universal", "fixed", "planar")
}


def closed(kind: str) -> pt.Mechanism:
    """A chain of balls and hinges closed by a joint that must not be in the tree."""
    m = pt.Mechanism(f"closed by {kind}", gravity=(0.3, -0.2, -9.81))
    positions = ((0, 0, 0), (0.4, 0.1, 0.2), (0.5, 0.5, 0.1), (0.2, 0.6, 0.0))
    a, b, c, d = (
        body(m, name, position, i + 0.3) for i, (name, position) in enumerate(zip("abcd", positions, strict=True))
    )
    m.add_revolute("A", m.ground, a, point=(0, 0, 0), axis=(0, 1, 0.5))
    m.add_spherical("B", a, b, point=(0.4, 0.1, 0.2))
    m.add_universal("C", b, c, point=(0.5, 0.5, 0.1), axis1=(1, 0, 0), axis2=(0, 1, 0))
    m.add_spherical("D", c, d, point=(0.2, 0.6, 0.0))
    getattr(m, f"add_{kind}")("E", m.ground, d, point=(0.1, 0.5, 0.1), cut="always", **LOOPS[kind])
    return m


@ROBOTS
@pytest.mark.parametrize("kind", LOOPS)
def test_every_closing_joint(kind: str, suffix: str, tmp_path: Path) -> None:
    m = closed(kind)
    back = there_and_back(m, tmp_path, suffix)
    assert back.compile().mobility == m.compile().mobility
    a, b = moved(m, m.bodies), moved(back, m.bodies)
    for name in m.bodies:
        assert np.abs(a[name] - b[name]).max() < 1e-9, name
    if suffix == ".urdf":  # the link of no mass at its end is gone again
        assert set(back.bodies) == set(m.bodies)
        assert [(j["name"], j["kind"]) for j in back.compile().summary["joints"]][-1] == ("E", kind)


def four_bar() -> pt.Mechanism:
    m = drawn("revolute")
    m.add_torsion_spring("A", stiffness=2.0, damping=0.3, angle=0.2)
    m.add_torsion_spring("A", stiffness=1.0, angle=-0.4)
    return m


def at_rest(m: pt.Mechanism) -> dict[str, float]:
    r = m.simulate(1e-6, initial=m.assemble(rates={"A": 2.0}), t_eval=[0.0, 1e-6])
    return dict(zip(m.compile().velocity_names, r.vdot[0].tolist(), strict=True))


def test_a_four_bar_in_both_formats(tmp_path: Path) -> None:
    """Accelerations to 1e-12, motions of both dialects to 1e-10; springs of a joint act as one."""
    m = four_bar()
    for original, suffix in ((m, ".urdf"), (m, ".mjcf")):
        back = there_and_back(original, tmp_path, suffix)
        a, b = at_rest(original), at_rest(back)
        assert set(a) == set(b)
        assert max(abs(a[name] - b[name]) for name in a) < 1e-12 * max(map(abs, a.values()))
    both = [pt.load(tmp_path / f"robot{suffix}") for suffix in (".urdf", ".mjcf")]
    runs = [x.simulate(1.0, initial=x.assemble(rates={"A": 2.0}), rtol=1e-12, atol=1e-14) for x in both]
    for joint in "ABD":
        assert np.abs(runs[0].joint(joint).position - runs[1].joint(joint).position).max() < 1e-10


def test_mujoco_accelerates_the_tree_alike(tmp_path: Path) -> None:
    """Every kind of slide and hinge, springs between points and at joints, a body that gravity leaves alone."""
    mujoco = pytest.importorskip("mujoco")
    m = pt.Mechanism("tree", gravity=(0.5, 0.0, -9.81))
    for i, kind in enumerate(("revolute", "prismatic", "cylindrical", "universal", "planar")):
        held = body(m, f"held {i}", (i, 0.1, 0.2), i)
        getattr(m, f"add_{kind}")(f"J{i}", m.ground, held, point=(i, 0, 0), **KINDS[kind])
        m.add_revolute(f"K{i}", held, body(m, f"end {i}", (i, 0.5, 0.2), 2 * i), point=(i, 0.4, 0), axis=(1, 0, 2))
    light = m.add_body("light", mass=2.0, inertia=(1, 1, 1), gravity=False)
    m.add_revolute("L", m.ground, light, point=(0, 0, 0.5), axis=(1, 0, 0))
    m.add_spring("s", "held 0", (0.1, 0, 0), "end 1", (0, 0.2, 0), stiffness=30.0, damping=2.0, length=0.4)
    m.add_torsion_spring("J0", stiffness=3.0, damping=0.2, angle=0.3)
    for name, inertia in (("J0", 2e-4), ("K0", 3e-4), ("K1", 1e-4), ("J1", 2e-3), ("K3", 5e-4)):
        m.add_rotor(name, inertia, ratio=-30.0)
    assert not m.save(tmp_path / "tree.xml", strict=True).dropped
    back = pt.load(tmp_path / "tree.xml")
    assert sorted(back.rotors) == sorted(m.rotors)
    assert list(back.forces) == ["spring of J0", "s"] and back._description.bodies["light"].gravity is False
    native = mujoco.MjModel.from_xml_path(str(tmp_path / "tree.xml"))
    data, compiled = mujoco.MjData(native), back.compile()
    rng = np.random.default_rng(3)
    data.qpos[:], data.qvel[:] = 0.5 * rng.normal(size=(2, native.nq))
    mujoco.mj_forward(native, data)
    indices = [mujoco.mj_name2id(native, mujoco.mjtObj.mjOBJ_JOINT, name) for name in compiled.velocity_names]
    rates, _ = compiled.acceleration(data.qpos[indices], data.qvel[indices])
    assert np.abs(rates - data.qacc[indices]).max() < 1e-11 * np.abs(data.qacc).max()
    # and what was drawn: the same where its joints have one coordinate
    own = m.compile()
    q, v = np.zeros(len(own.names)), np.zeros(len(own.names))
    mujoco.mj_resetData(native, data)
    mujoco.mj_forward(native, data)
    for name in ("J0", "J1", "K0", "K3", "L"):
        there = data.qacc[mujoco.mj_name2id(native, mujoco.mjtObj.mjOBJ_JOINT, name)]
        here = own.acceleration(q, v)[0][own.velocity_names.index(name)]
        assert abs(there - here) < 1e-11 * np.abs(data.qacc).max(), name


@pytest.mark.parametrize("kind", ["revolute", "spherical", "prismatic", "fixed"])
def test_mujoco_holds_the_loop_alike(kind: str, tmp_path: Path) -> None:
    """MuJoCo's mass matrix, forces and rows of its equalities, solved without its softness, at rest."""
    mujoco = pytest.importorskip("mujoco")
    m = closed(kind)
    m.save(tmp_path / "loop.mjcf", strict=True)
    native = mujoco.MjModel.from_xml_path(str(tmp_path / "loop.mjcf"))
    native.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(native)
    mujoco.mj_forward(native, data)
    mass = np.zeros((native.nv, native.nv))
    for column, unit in zip(mass, np.eye(native.nv), strict=True):
        mujoco.mj_mulM(native, data, column, unit)
    rows = data.efc_J.reshape(-1, native.nv)
    assert np.abs(data.efc_pos).max() < 1e-12
    # v' nearest to the free one, in the metric of M, among those that the rows allow
    root = np.linalg.cholesky(mass)
    free = np.linalg.solve(root, -data.qfrc_bias)
    pressed = np.linalg.solve(root, rows.T).T
    held = free - np.linalg.pinv(pressed, rcond=1e-9) @ (pressed @ free)
    there = np.linalg.solve(root.T, held)[mujoco.mj_name2id(native, mujoco.mjtObj.mjOBJ_JOINT, "A")]
    here = at_zero(m)
    if kind == "fixed":
        assert m.compile().mobility == 3
    assert abs(there - here) < 1e-10 * max(1.0, abs(here))


def at_zero(m: pt.Mechanism) -> float:
    r = m.simulate(1e-6, t_eval=[0.0, 1e-6])
    return float(r.vdot[0][m.compile().velocity_names.index("A")])


def test_a_rough_drawing_is_written_with_its_coordinates_zero(tmp_path: Path) -> None:
    """Where a joint sits elsewhere on its child than on its parent, the tree closes it; coordinates are the same."""
    m = pt.Mechanism("rough", gravity=(0, 0, -9.81))
    arm, held = body(m, "arm", (0, 0, 0)), body(m, "held", (1, 0, 0), 0.1)
    m.add_revolute("A", m.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), child_point=(0.1, 0, 0), child_axis=(0, 1, 0.2))
    m.add_joint("B", arm, held, free=("rz",), point=(0.5, 0, 0), child_point=(0.8, 0, 0.1), frame=TURN,
                child_frame=np.eye(3))  # fmt: skip
    for suffix in (".urdf", ".mjcf"):
        back = there_and_back(m, tmp_path, suffix)
        pose = {"A": 0.3, "B": -0.4}
        a, b = moved(m, m.bodies, m.assemble(pose)), moved(back, m.bodies, back.assemble(pose))
        for name in m.bodies:
            assert np.abs(a[name] - b[name]).max() < 1e-9


@ROBOTS
def test_couplers_follow(suffix: str, tmp_path: Path) -> None:
    m = four_bar() if suffix == ".mjcf" else drawn("revolute")
    m.add_revolute("W", m.ground, body(m, "wheel", (0, 1, 0)), point=(0, 1, 0), axis=(0, 1, 0))
    m.add_gear("W", "A", -3.0, name="gear")
    back = there_and_back(m, tmp_path, suffix)
    for x in (m, back):
        assert x.compile().mobility == 1
    turns = [x.assemble(targets={"A": 0.1}).position("W") for x in (m, back)]
    assert abs(turns[0]) > 0.01 and abs(turns[0] - turns[1]) < 1e-12


def sprung() -> pt.Mechanism:
    """Springs and dampers of every kind that joints and points can have, one against its motion; a body without weight;
    frames of bodies off their joints."""
    m = pt.Mechanism("springs", gravity=(0.3, 0.0, -9.81), drawing_tolerance=2e-5)
    kinds = {"universal": 2, "cylindrical": 2, "revolute": 1, "prismatic": 1}
    for i, (kind, count) in enumerate(kinds.items()):
        held = body(m, f"held {i}", (i, 0.1, 0.2), i)
        getattr(m, f"add_{kind}")(f"J{i}", m.ground, held, point=(i, 0, 0), **KINDS[kind])
        for k in range(count):
            m.add_torsion_spring(f"J{i}", stiffness=3.0 + k, damping=0.2, angle=0.3, coordinate=k, name=f"t{i}{k}")
    m.add_torsion_spring("J2", stiffness=-0.5, damping=-0.05, name="against")
    m.add_spring("s", "held 0", (0.1, 0, 0), "held 2", (0, 0.2, 0), stiffness=30.0, damping=2.0, length=0.4)
    m.add_spring("as drawn", m.ground, (0, 1, 1), "held 3", (0.1, 0.2, 0.3), stiffness=1e-5)
    light = m.add_body("light", mass=2.0, inertia=(1, 1, 1), gravity=False, position=(0, 1, 0))
    m.add_revolute("L", m.ground, light, point=(0, 0, 0.5), axis=(1, 0, 0))
    m.add_revolute("closes", light, "held 1", point=(0.5, 1, 0), axis=(0, 0, 1))
    m.add_torsion_spring("L", stiffness=0.4, angle=0.1, name="of L")
    m.add_torsion_spring("closes", stiffness=0.7, damping=0.1, name="in the loop")
    return m


def test_urdf_and_the_file_beside_it_hold_all_springs(tmp_path: Path) -> None:
    m = sprung()
    back = there_and_back(m, tmp_path, ".urdf")
    assert sorted(back.forces) == sorted(m.forces) and [*back.joints] == [*m.joints]
    assert back.drawing_tolerance == 2e-5 and back._description.bodies["light"].gravity is False
    for name in m.forces:
        one, other = (x.forces[name] for x in (m, back))
        assert (one.stiffness, one.damping) == (other.stiffness, other.damping), name
    one, other = m.compile(), back.compile()
    assert one.names == other.names and one.velocity_names == other.velocity_names
    pose = {"J0": (0.2, -0.3), "J2": 0.1, "J3": 0.05}
    start = m.assemble(pose)
    v = m.assemble(pose, rates={"J2": 0.4, "J3": -0.3}).v
    a, b = (x.acceleration(start.q, v)[0] for x in (one, other))
    assert np.abs(a - b).max() < 1e-12 * np.abs(a).max()
    # other programs read dampers of hinges and slides in the URDF itself
    assert '<dynamics damping="0.15' in (tmp_path / "robot.urdf").read_text("utf-8")
    (tmp_path / "robot.yaml").unlink()
    assert len(pt.load(tmp_path / "robot.urdf").forces) == 7


def test_a_damper_that_was_changed_in_the_urdf_is_followed(tmp_path: Path) -> None:
    m = four_bar()
    m.save(tmp_path / "robot.urdf", strict=True)
    text = (tmp_path / "robot.urdf").read_text("utf-8")
    assert text.count('damping="0.3"') == 1
    (tmp_path / "robot.urdf").write_text(text.replace('damping="0.3"', 'damping="0.4"'), "utf-8")
    back = pt.load(tmp_path / "robot.urdf")
    forces = list(back.forces.values())
    assert sum(force.damping for force in forces) == 0.4 and sum(force.stiffness for force in forces) == 3.0
    assert "damping 0.4 of joint A is taken from the URDF" in str(back.reading)


BESIDE = {
    "springs: 3\n": "must be a list",
    "springs: [3]\n": 'names a joint, or the points "from" and "to"',
    "springs: [{joint: A, stiffness: 1.0}]\n": "has no name",
    "springs: [{name: s, joint: A, force: 1.0}]\n": "has force; its keys are",
    "springs: [{name: s, joint: A, stiffness: .inf}]\n": "not a finite number",
    "springs: [{name: s, joint: A, stiffness: true}]\n": "not a finite number",
    "springs: [{name: s, joint: A}, {name: s, joint: B}]\n": "appears twice",
    "springs: [{name: s, joint: Z, stiffness: 1.0}]\n": 'acts at "Z"',
    "springs: [{name: s, from: [crank, 0, 0], to: [rocker, 0, 0, 0]}]\n": "links of the URDF",
    "springs: [{name: s, from: [crank, 0, 0, 0], to: [nobody, 0, 0, 0]}]\n": "links of the URDF",
    "weightless: [nobody]\n": "a list of links",
    "drawing_tolerance: much\n": "must be a number",
}


@pytest.mark.parametrize("text", BESIDE)
def test_what_stands_beside_it_is_checked(text: str, tmp_path: Path) -> None:
    drawn("revolute").save(tmp_path / "robot.urdf", strict=True)
    whole = (tmp_path / "robot.yaml").read_text("utf-8")
    (tmp_path / "robot.yaml").write_text(whole + text, "utf-8")
    with pytest.raises(pt.errors.FileFormatError, match=r"robot\.yaml") as reported:
        pt.load(tmp_path / "robot.urdf")
    assert BESIDE[text] in str(reported.value) and reported.value.line == whole.count("\n") + 1


def test_a_gimbal_with_dampers_keeps_them(tmp_path: Path) -> None:
    """Hinges through one point are one joint: what acts at them acts along its coordinates, or they stay hinges."""
    head = '<robot name="r"><link name="world"/><link name="b"><inertial><origin xyz="0.1 0.2 -1"/><mass value="1"/>'
    head += '<inertia ixx="1" iyy="1.2" izz="1.5"/></inertial></link>'
    for count, kind in ((2, "universal"), (3, "revolute")):
        text, before = head, "world"
        for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")[:count]):
            after = "b" if i == count - 1 else f"i{i}"
            text += "" if after == "b" else f'<link name="{after}"/>'
            text += f"""<joint name="h{i}" type="continuous"><parent link="{before}"/><child link="{after}"/>
              <axis xyz="{axis}"/><dynamics damping="0.{i + 1}"/></joint>"""
            before = after
        path = tmp_path / "gimbal.urdf"
        path.write_text(text + "</robot>", "utf-8")
        m = pt.load(path)
        assert [j["kind"] for j in m.compile().summary["joints"]][-1] == kind and len(m.forces) == count
        assert sorted(force.damping for force in m.forces.values()) == [0.1, 0.2, 0.3][:count]


LOSSES = {
    "drive d": lambda m: m.add_drive("A", velocity=1.0, name="d"),
    "torque t": lambda m: m.add_torque("A", value=1.0, name="t"),
    "force f": lambda m: m.add_force("crank", force=(1, 0, 0), name="f"),
    "rope": lambda m: m.add_distance("rope", "crank", (0, 0, 0), "rocker", (0, 0, 0)),
    "negative": lambda m: m.add_torsion_spring("A", stiffness=-1.0, name="unstable"),
}


@ROBOTS
@pytest.mark.parametrize("words", LOSSES)
def test_what_is_lost_is_said_and_refused(words: str, suffix: str, tmp_path: Path) -> None:
    if (words, suffix) == ("negative", ".urdf"):
        pytest.skip("nothing is lost here: torsion springs stand in the file beside the URDF")
    m = drawn("revolute")
    LOSSES[words](m)
    path = tmp_path / f"robot{suffix}"
    with pytest.raises(pt.errors.FileFormatError, match=words):
        m.save(path, strict=True)
    assert not list(tmp_path.iterdir())
    with pytest.warns(pt.errors.LossyFileWarning, match=words):
        written = m.save(path)
    assert any(words in remark for remark in written.dropped) and words in str(written)
    assert json.loads(json.dumps(written.to_dict()))["dropped"] == written.dropped
    assert path in written.files and all(file.is_file() for file in written.files)


def test_names_and_old_files(tmp_path: Path) -> None:
    """Names in any letters; an old YAML beside a URDF does not close what is not closed any more."""
    odd = "a \"b\" & <c> é 😀 \\ 'd' #: [x]"
    m = pt.Mechanism(odd, gravity=(0, 0, -9.81))
    for i, name in enumerate((odd, "world", "closing_1")):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(i, 0, 0))
    m.add_revolute(odd, m.ground, odd, point=(0, 0, 0), axis=(0, 1, 0))
    m.add_revolute("B", odd, "world", point=(1, 0, 0), axis=(0, 1, 0))
    m.add_revolute("closing", "world", "closing_1", point=(2, 0, 0), axis=(0, 1, 0))
    (tmp_path / "robot.yaml").write_text("closed_loop: [[old, older]]\n", "utf-8")
    back = there_and_back(m, tmp_path, ".urdf")
    assert (back.name, [*back.bodies], [*back.joints]) == (m.name, [*m.bodies], [*m.joints])
    m.add_spherical(f"{odd} 2", m.ground, "closing_1", point=(2.5, 0, 0))
    back = there_and_back(m, tmp_path, ".urdf")
    assert ([*back.bodies], [*back.joints]) == ([*m.bodies], [*m.joints])
    back = there_and_back(m, tmp_path, ".mjcf")
    assert [*back.joints] == [*m.joints] and [*back.bodies][:2] == [odd, "body world"]


def test_what_mujoco_cannot_move_is_lost(tmp_path: Path) -> None:
    """Moments raised beyond what anybody knows of them make another mechanism; a slender rod's own hardly matter."""
    small = pt.Mechanism("watch")
    small.add_body("wheel", mass=1e-9, inertia=(1e-18, 1e-18, 2e-18))
    small.add_revolute("A", small.ground, "wheel", point=(0, 0, 0))
    with pytest.raises(pt.errors.FileFormatError, match="MuJoCo requires"):
        small.save(tmp_path / "watch.mjcf", strict=True)
    rod = pt.Mechanism("rod")
    rod.add_rod("rod", (0, 0, 0), (1, 0, 0), mass=1.0)
    rod.add_revolute("A", rod.ground, "rod", point=(0, 0, 0))
    assert any("MuJoCo requires" in remark for remark in rod.save(tmp_path / "rod.mjcf", strict=True).changed)


def test_a_file_of_that_name_that_closes_nothing_stays(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("colour: red\n", "utf-8")
    m = pt.Mechanism("rod", gravity=(0, 0, -9.81))
    m.add_rod("rod", (0, 0, 0), (1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0), axis=(0, 1, 0))
    assert m.save(tmp_path / "robot.urdf").files == [tmp_path / "robot.urdf"]
    assert (tmp_path / "robot.yaml").read_text("utf-8") == "colour: red\n"


def test_numbers_keep_their_digits(tmp_path: Path) -> None:
    m = pt.Mechanism("digits", gravity=(1e-17, -1e22, 0.1))
    inertia = ((0.1, 1e-19, 0.2 / 3), (1e-19, 1 / 3, -0.0), (0.2 / 3, -0.0, 0.3))
    m.add_body("b", mass=1e5 / 3, inertia=inertia, com=(1e-300, 0.1 + 0.2, -1 / 7))
    m.add_revolute("A", m.ground, "b", point=(0, 0, 0), axis=(0, 0, 1))
    back = there_and_back(m, tmp_path, ".urdf")
    one, other = (x._description.bodies["b"] for x in (m, back))
    assert one.mass == other.mass and back.gravity == m.gravity
    assert np.array_equal(one.com, other.com) and np.array_equal(one.inertia, other.inertia)


def test_the_command_converts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    m = drawn("revolute")
    m.add_torque("A", value=1.0, name="t")
    m.save(tmp_path / "in.toml")
    source, target = str(tmp_path / "in.toml"), str(tmp_path / "out.urdf")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["convert", source, target]) == 0
        assert "torque t" in capsys.readouterr().out
        assert main(["convert", source, target, "--json"]) == 0
        reported = json.loads(capsys.readouterr().out)
        assert reported["dropped"] == ["torque t: it no longer acts"] and len(reported["files"]) == 2
        assert main(["convert", source, target, "--strict"]) != 0
    assert "cannot represent: torque t" in capsys.readouterr().err


def test_what_cannot_be_written(tmp_path: Path) -> None:
    m = pt.Mechanism("chain")
    for i in range(520):
        m.add_body(f"b{i}", mass=1.0, inertia=(1, 1, 1), position=(i, 0, 0))
        m.add_revolute(f"j{i}", m.ground if i == 0 else f"b{i - 1}", f"b{i}", point=(i, 0, 0))
    with pytest.raises(pt.errors.FileFormatError, match="more than 500 bodies"):
        m.save(tmp_path / "chain.mjcf")
    with pytest.raises(pt.errors.MissingFileError):
        m.save(tmp_path / "none" / "chain.urdf")
    with pytest.raises(pt.errors.ArgumentError, match="strict"):
        m.save(tmp_path / "chain.urdf", strict="yes")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
