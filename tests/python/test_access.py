"""Elements read, changed and removed after they were added: a changed mechanism is the one drawn so from the start."""

import json
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

import partita as pt
from partita.builder import Expression
from partita.builder.calls import call_of
from partita.errors import DescriptionError, UnknownAttributeError, UnknownNameError

Call = tuple[str, str, dict[str, Any]]
TABLE = ([0.0, 0.5, 1.0, 2.0], [0.0, 0.1, 0.3, 0.2])
OTHER = ([0.0, 0.5, 1.0, 2.5], [0.1, 0.1, -0.3, 0.2])
TURN = [[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
BACK = [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]
TILTED = (1.0, 2.0, 3.0)


def law(x: Any) -> Any:
    return 0.1 * x


def effort(t: float, state: Any) -> float:
    return 2.0


def motion(t: Any) -> Any:
    return 0.1 * t * t


def wind(t: float, *seen: Any) -> tuple[float, float, float]:
    return 1.0, 0.0, 0.0


def calm(t: float, *seen: Any) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def half(x: Any) -> Any:
    return 0.5 * x


def twice(x: Any) -> Any:
    return 2.0 * x


def condition(t: Any, x: Any) -> Any:
    return x - 0.1 * t


def level(t: Any, x: Any) -> Any:
    return x


def turning(t: Any) -> Any:
    return (0.1 * t, 0.0 * t, 0.0 * t), (0.0 * t, 0.0 * t, t)


def standing(t: Any) -> Any:
    return (0.2 * t, 0.0 * t, 0.0 * t), (0.0 * t, 0.0 * t, 2.0 * t)


ALONG = pt.Along("ground", (0, 0, 0), TILTED, "b", (0, 0, 0.3))
BESIDE = pt.Along("ground", (0, 0, 0.1), (3.0, 1.0, 2.0), "b", (0, 0, 0.3))
APART = pt.Distance("a", (0, 0, 0), "c", (0, 0.1, 0))
CARRIED = {"parent": "ground", "child": "c", "point": (0.5, 0.25, 0.125)}
ONE_AXIS = {"axis": TILTED, "child_point": (0.5, 0.25, 0.126), "child_axis": (1.0, 2.0, 3.01), "cut": "always"}
NEW_AXIS = {"axis": (0, 1, 1), "child_point": None, "child_axis": (0, 1, 1.01), "cut": "auto"}
NEW_PLACE = {"parent": "a", "child": "b", "point": (0, 0.5, 0)}

# method, name, arguments and, for each of them, another value
CALLS: list[tuple[Call, dict[str, Any]]] = [
    (
        ("add_body", "a", {"mass": 2.0, "inertia": (0.1, 0.2, 0.25), "position": (1, 0, 0), "orientation": TURN}),
        {"mass": 3, "inertia": (0.2, 0.2, 0.3), "com": (0, 0.1, 0), "position": (1, 2, 0), "orientation": None},
    ),
    (("add_body", "b", {"mass": 1.0, "inertia": np.eye(3), "com": (0.1, 0, 0)}), {"gravity": False, "com": (0, 0, 1)}),
    (
        ("add_rod", "c", {"start": (0, 0, 0), "end": (1, 2, 3), "mass": 0.3}),
        {"start": (0, 1, 0), "end": (3, 1, 1), "mass": 0.0, "gravity": False},
    ),
    (
        ("add_solid", "s", {"shape": pt.shapes.Disc(0.1, 0.02), "density": "8 g/cm^3", "position": (4, 0, 0)}),
        {"shape": pt.shapes.Box((1, 2, 3)), "density": 700.0, "orientation": TURN, "gravity": False},
    ),
    (("add_body", "d", {"mass": 1.0, "inertia": (1, 1, 1), "position": (0, 3, 0)}), {"position": (0, 4, 1)}),
    (("add_body", "e", {"mass": 1.0, "inertia": (1, 1, 1), "orientation": BACK}), {"orientation": TURN}),
    (("add_revolute", "R", {**CARRIED, **ONE_AXIS}), {**NEW_PLACE, **NEW_AXIS}),
    (("add_prismatic", "P", {"parent": "ground", "child": "a", "axis": TILTED}), {"axis": (0, 1, 1), "point": TILTED}),
    (("add_cylindrical", "C", {**CARRIED, **ONE_AXIS}), {**NEW_PLACE, **NEW_AXIS}),
    (("add_spherical", "S", {**CARRIED, "child_frame": TURN}), {**NEW_PLACE, "child_frame": None}),
    (
        ("add_universal", "U", {**CARRIED, "axis1": (1, 0, 0), "axis2": (0, 2, 1)}),
        {**NEW_PLACE, "axis1": (2, 0, 1), "axis2": (0, 0, 1)},
    ),
    (("add_planar", "E", {"parent": "ground", "child": "b", "normal": TILTED}), {"normal": (0, 1, 0), "cut": "never"}),
    (("add_fixed", "F", {"parent": "a", "child": "b"}), {**NEW_PLACE, "parent": "c"}),
    (("add_free", "free", {"parent": "ground", "child": "d"}), {"point": (0, 0, 1), "cut": "never"}),
    (
        ("add_joint", "G", {**CARRIED, "free": ("x", "rz"), "frame": TURN}),
        {**NEW_PLACE, "free": ("y", "rz"), "frame": BACK},
    ),
    (
        ("add_custom_joint", "knee", {**CARRIED, "free": ("rz",), "follows": {"x": half}, "frame": TURN}),
        {**NEW_PLACE, "free": ("ry",), "follows": {"z": twice}, "frame": BACK},
    ),
    (("add_screw", "W", {**CARRIED, "axis": TILTED, "pitch": 0.01}), {**NEW_PLACE, "pitch": -0.02}),
    (("add_constant_velocity", "V", {**CARRIED, "axis": TILTED}), {**NEW_PLACE, "axis": (0, 1, 0)}),
    (("add_point_on_line", "L", {**CARRIED, "axis": TILTED}), {**NEW_PLACE, "axis": (0, 1, 0)}),
    (("add_point_on_plane", "N", {**CARRIED, "normal": TILTED}), {**NEW_PLACE, "normal": (0, 1, 0)}),
    (("add_parallel", "par", {**CARRIED, "axis": TILTED}), {**NEW_PLACE, "axis": (0, 1, 0)}),
    (
        ("add_perpendicular", "perp", {**CARRIED, "axis1": (1, 0, 0), "axis2": (0, 2, 0)}),
        {"axis1": (1, 0, 1), "axis2": (0, 1, 0)},
    ),
    (("add_orientation", "O", {**CARRIED}), {**NEW_PLACE, "cut": "always"}),
    (
        ("add_pin_slot", "pin", {**CARRIED, "axis1": (1, 0, 0), "axis2": (0, 2, 0)}),
        {**NEW_PLACE, "axis1": (1, 0, 1), "axis2": (0, 1, 0), "child_frame": TURN},
    ),
    (
        ("add_coupler", "sum", {"terms": ["R", APART, ALONG], "factors": [1, 2, 3], "offset": 0.1}),
        {"terms": ["R", ALONG, APART], "factors": [1, 2, -3], "offset": 0.2, "word": "mix"},
    ),
    (("add_rotor", "rotor", {"joint": "R", "inertia": 2e-3, "ratio": 7, "coordinate": 0}), {"ratio": 3, "joint": "W"}),
    (("add_gear", "gear", {"joint1": "R", "joint2": "C", "ratio": -2, "coordinate2": 1}), {"ratio": 3, "joint1": "W"}),
    (
        ("add_belt", "belt", {"pulley1": "R", "pulley2": "W", "radius1": 0.1, "radius2": 0.3}),
        {"radius1": 0.2, "crossed": True, "pulley2": "C"},
    ),
    (("add_rack", "rack", {"pinion": "R", "slide": "P", "radius": 0.1}), {"radius": -0.2, "slide": "C"}),
    (
        ("add_distance", "wire", {"body1": "ground", "point1": (0, 0, 0), "body2": "a", "point2": (0, 1, 0)}),
        {"body1": "c", "point1": (0, 0, 1), "point2": (1, 1, 0), "length": 2.0},
    ),
    (("add_cam", "cam", {"follower": "P", "cam": "R", "law": TABLE}), {"law": law, "follower": ALONG, "word": "lift"}),
    (("add_cam", "cam by f", {"follower": BESIDE, "cam": APART, "law": law}), {"law": TABLE, "cam": ALONG}),
    (
        ("add_point_on_curve", "slot", {"body1": "ground", "body2": "b", "point2": (0, 0, 1), "curve": law}),
        {"curve": TABLE, "origin": (0, 0, 1), "x_axis": TILTED, "y_axis": (3, 0, -1), "point2": (1, 0, 0)},
    ),
    (("add_rolling", "rolls", {"body": "d", "radius": 0.5}), {"radius": 1, "ball": True, "on": "a", "slips": True}),
    (
        ("add_constraint", "own", {"function": condition, "of": [ALONG]}),
        {"function": level, "of": [APART], "word": "wish"},
    ),
    (("add_drive", "held", {"joint": "R", "position": 0.25}), {"position": TABLE, "joint": "W"}),
    (("add_drive", "moved", {"joint": "C", "coordinate": 1, "position": motion}), {"position": law, "coordinate": 0}),
    (("add_drive", "rate", {"joint": APART, "velocity": TABLE}), {"velocity": motion, "joint": BESIDE}),
    (("add_drive", "pushed", {"joint": "P", "acceleration": 0.5, "rate": 0.1}), {"acceleration": 1, "rate": 0.2}),
    (
        ("add_drive", "posed", {"joint": "d", "pose": ((0.1, 0.2, 0.3), (0.1, 0.2, 0.3))}),
        {"pose": turning, "joint": "a"},
    ),
    (("add_drive", "posed by f", {"joint": "e", "pose": turning}), {"pose": standing}),
    (
        ("add_drive", "table", {"joint": "S", "pose": ([0.0, 1.0, 2.0], [(0, 0, 0), (0, 0, 1), (0, 1, 1)])}),
        {"pose": ([0.0, 1.0, 2.5], [(0, 0, 0), (0, 0, 1), (0, 1, 1)])},
    ),
    (
        ("add_spring", "coil", {"body1": "a", "point1": (0, 0, 1), "body2": "b", "point2": (1, 0, 0), "stiffness": 9}),
        {"body1": "ground", "point1": (0, 0, 2), "stiffness": -9, "damping": 1, "length": 0.5},
    ),
    (
        ("add_torsion_spring", "torsion", {"joint": "R", "stiffness": 5.0}),
        {"stiffness": 6, "damping": 1, "angle": 0.1, "joint": "W"},
    ),
    (("add_torque", "motor", {"joint": "C", "value": 1.0, "coordinate": 1}), {"value": TABLE, "coordinate": 0}),
    (("add_torque", "gas", {"joint": "P", "value": TABLE, "over": "R"}), {"over": ALONG, "value": OTHER}),
    (("add_torque", "by f", {"joint": "P", "value": effort}), {"value": 3}),
    (("add_force", "push", {"body": "b", "force": (1, effort, TABLE)}), {"force": TILTED, "axes": "body", "body": "c"}),
    (("add_force", "wind", {"body": "b", "force": wind, "point": (0, 0, 1)}), {"point": None, "force": calm}),
    (
        ("add_bushing", "rubber", {"body1": "a", "body2": "b", "point": (0, 0, 1), "stiffness": [1, 2, 3, 4, 5, 6]}),
        {"stiffness": np.eye(6) + 0.1, "damping": [1] * 6, "frame": TURN, "point": (1, 0, 0), "body1": "ground"},
    ),
    (
        ("add_friction", "rubs", {"joint": "R", "dynamic": 0.4, "stick_velocity": 0.1}),
        {"dynamic": TABLE, "static": 1, "stick_velocity": 1},
    ),
    (
        ("add_stop", "stop", {"joint": "C", "upper": 0.5, "stiffness": 1e3, "coordinate": 1}),
        {"upper": 0.7, "lower": -1, "exponent": 1.5, "damping": 1, "stiffness": 9},
    ),
    (
        ("add_freewheel", "freewheel", {"joint": "C", "coordinate": 1}),
        {"free": -1, "coordinate": 0},
    ),
    (
        ("add_latch", "latch", {"joint": "C", "at": 0.2}),
        {"at": 0.7, "direction": -1, "coordinate": 1},
    ),
    (
        ("add_gas_spring", "air spring", {"joint": "C", "force": 3.0, "length": 0.5, "coordinate": 1}),
        {"force": -4.0, "length": 0.7, "exponent": 1.4, "coordinate": 0},
    ),
    (
        ("add_contact", "floor", {"body1": "b", "point1": (0, 0, 0), "body2": "ground", "point2": (0, 0, -9)}
         | {"radius1": 0.1, "stiffness": 1e5, "normal": TILTED}),
        {"radius1": 0.2, "stiffness": 9, "normal": (0, 0, 1), "exponent": 1, "damping": 1, "stick_velocity": 2},
    ),
    (
        ("add_rope", "rope", {"body1": "b", "point1": (0, 0, 0), "body2": "ground", "point2": (0, 0, -9)}
         | {"stiffness": 1e3, "length": 8.0}),
        {"stiffness": 9, "length": 7.0, "exponent": 2, "damping": 1, "body1": "c", "point2": (0, 1, 0)},
    ),
    (
        ("add_gas_strut", "strut", {"body1": "b", "point1": (0, 0, 0), "body2": "ground", "point2": (0, 0, -9)}
         | {"force": 300.0, "progression": 1.3, "stroke": 0.2, "length": 8.0}),
        {"force": 9, "progression": 1.2, "stroke": 1.0, "length": 7.0, "exponent": 2, "damping": 1, "end_stiffness": 5},
    ),
    (
        ("add_tyre", "tyre", {"body": "d", "center": (0, 0, 0), "axis": (0, 0, 1), "radius": 0.3}
         | {"normal": TILTED, "stiffness": 2e5}),
        {"radius": 0.4, "center": (0, 0, 1), "axis": (0, 1, 1), "point": (0, -3, 0), "ground": "a", "damping": 1},
    ),
    (
        ("add_force_law", "air", {"function": wind, "on": ["b", ("c", TILTED)], "sees": ["R", "b", ("a", TILTED)]}),
        {"function": calm, "on": ["c"], "sees": []},
    ),
    (
        ("add_sensor", "tip", {"of": ("c", ("1 m", 0, 0)), "reads": "velocity", "axes": "b"}),
        {"of": ("c", (0, "300 mm", 0)), "reads": "acceleration", "axes": "d", "text": "of the tip", "unit": "g"},
    ),
    (("add_sensor", "felt", {"of": ("c", (1, 0, 0)), "reads": "specific_force"}), {"axes": "world"}),
    (("add_sensor", "at rest", {"of": "ground", "reads": "rotation"}), {"of": "b"}),
    (("add_sensor", "slid", {"of": "C", "reads": "position", "coordinate": 1}), {"coordinate": 0, "reads": "drive"}),
    (("add_sensor", "borne", {"of": "S", "reads": "force", "axes": "joint"}), {"axes": "world", "reads": "moment"}),
    (("add_sensor", "apart", {"of": APART, "reads": "velocity"}), {"of": ALONG, "reads": "acceleration"}),
    (("add_sensor", "pull", {"of": "coil", "reads": "force"}), {"reads": "power", "of": "torsion"}),
    (("add_sensor", "blown", {"of": "air", "reads": "force"}), {"coordinate": 1}),
    (("add_sensor", "turned by", {"of": "held", "reads": "effort"}), {"of": "moved", "reads": "power"}),
    (("add_sensor", "meshing", {"of": "gear", "reads": "effort"}), {"of": "belt"}),
    (
        ("add_sensor", "worth", {"of": Expression(["product", 2.0, "pull", ["component", "tip", 1]])}),
        {"of": {"expression": ["norm", "tip"]}},
    ),
    (("add_sensor", "made", {"of": ["tip", "pull"], "function": wind}), {"of": ["pull"], "function": calm}),
]  # fmt: skip


def handled(m: pt.Mechanism, word: str, value: Any) -> Any:
    """A body where a pose is that of one: its name alone would be taken for a joint's."""
    return m.bodies[value] if word == "joint" and value in ("d", "e") else value


def add(m: pt.Mechanism, call: Call) -> None:
    method, name, arguments = call
    getattr(m, method)(name=name, **{word: handled(m, word, value) for word, value in arguments.items()})


def draw(changed: int | None = None, **arguments: Any) -> pt.Mechanism:
    """A mechanism of every element; the call number `changed` has other arguments."""
    m = pt.Mechanism("everything")
    for i, (call, _) in enumerate(CALLS):
        add(m, (call[0], call[1], {**call[2], **arguments}) if i == changed else call)
    m.add_compliance("R", translation=1e-8, rotation=(1e-6, 0, 0))
    return m


def spec(m: pt.Mechanism) -> str:
    """The description passed to the core, and the Python functions in it."""
    d = m._description
    records = [*d.couplings.values(), *d.rotors.values(), *d.drives.values(), *d.forces.values(), *d.sensors.values()]
    return json.dumps(m.to_spec()) + repr([call_of(record) for record in records])


def element(m: pt.Mechanism, i: int) -> Any:
    name = CALLS[i][0][1]
    return next(table[name] for table in tables(m) if name in table)


def tables(m: pt.Mechanism) -> list[Any]:
    return [m.bodies, m.joints, m.couplings, m.rotors, m.drives, m.forces, m.sensors]


def test_every_method_is_among_the_calls() -> None:
    methods = {name for name in dir(pt.Mechanism) if name.startswith("add_")}
    # a compliance is no element, an IMU is two sensors, a brake is friction
    assert methods - {call[0] for call, _ in CALLS} == {"add_compliance", "add_imu", "add_brake"}


@pytest.fixture(scope="module")
def drawn() -> pt.Mechanism:
    return draw()


@pytest.mark.parametrize("i", range(len(CALLS)), ids=[call[1] for call, _ in CALLS])
def test_changed_is_drawn_so_from_the_start(i: int, drawn: pt.Mechanism) -> None:
    """To the last bit, with all that follows from it, and in the same order; and back again."""
    m, changes = drawn, CALLS[i][1]
    before, old = spec(m), {}
    for word, value in changes.items():
        old[word] = getattr(element(m, i), word)
        setattr(element(m, i), word, handled(m, word, value))
    assert spec(m) == spec(draw(i, **changes)) != before
    for word in reversed(changes):
        setattr(element(m, i), word, old[word])
    assert spec(m) == before


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_what_is_read_can_be_said_again(name: str) -> None:
    """Every argument of every element of the catalogue, set to what it is: nothing changes, to the last bit."""
    m = pt.catalogue.load(name, **({"loops": 2} if name == "n-four-bar" else {}))
    before = spec(m)
    for table in tables(m):
        for handle in list(table.values())[:6]:
            for word in [word for word in m._words(handle) if word not in ("kind", "length", "compliance")]:
                if handle.kind == "rod" and word in ("inertia", "com", "position", "orientation"):
                    continue
                setattr(handle, word, getattr(handle, word))
    assert spec(m) == before


def test_removed_is_never_drawn(drawn: pt.Mechanism) -> None:
    """Taken out one by one from the end, each leaves the mechanism that was drawn up to there."""
    m = deepcopy(drawn)
    m.joints["R"].compliance = None
    for i in range(len(CALLS) - 1, -1, -1):
        name = CALLS[i][0][1]
        table = next(table for table in tables(m) if name in table)
        table.remove(name)
        if i % 7 == 0:
            less = pt.Mechanism("everything")
            for call, _ in CALLS[:i]:
                add(less, call)
            assert spec(m) == spec(less)
    assert not any(tables(m))


def test_removal_is_refused_by_name_while_others_refer_to_it(drawn: pt.Mechanism) -> None:
    m = deepcopy(drawn)
    before = spec(m)
    for table, name, word in [
        (m.bodies, "a", 'joint "P"'),
        (m.joints, "P", 'coupling "rack", coupling "cam", drive "pushed", force "gas"'),
        (m.joints, "pose of e", 'drive "posed by f" refers'),
        (m.bodies, "e", 'drive "posed by f"'),
    ]:
        with pytest.raises(DescriptionError, match=word):
            del table[name]
    assert spec(m) == before
    m.drives.remove("posed by f")
    assert "pose of e" not in m.joints
    del m.bodies["e"]


def test_a_refused_change_leaves_everything_as_it_was(drawn: pt.Mechanism) -> None:
    m = deepcopy(drawn)
    before, version = spec(m), m._description.version
    for handle, word, value, words in [
        (m.bodies["a"], "mass", -1.0, "at least 0"),
        (m.bodies["a"], "mass", np.nan, "finite"),
        (m.joints["R"], "child", "b a", 'no body "b a"'),
        (m.joints["R"], "point", (0, 0), "3 numbers"),
        (m.joints["G"], "free", ("x", "x"), "twice"),
        (m.joints["C"], "name", "D", "cannot be changed"),
        (m.bodies["c"], "com", (0, 0, 0), "start, end and mass"),
        (m.drives["rate"], "joint", "R", "already driven"),
        (m.bodies["b"], "position", (0, 0, np.inf), "NaN and infinity"),
        (m.couplings["wire"], "length", -1.0, "positive"),
        (m.forces["coil"], "body2", "a", "two different"),
    ]:
        with pytest.raises((DescriptionError, UnknownNameError), match=words):
            setattr(handle, word, value)
        assert spec(m) == before and m._description.version == version
    spring = pt.Mechanism("m")
    body = spring.add_body("b", mass=1.0, inertia=(1, 1, 1), position=(1, 0, 0))
    spring.add_spring("s", spring.ground, (0, 0, 0), body, (0, 0, 0), stiffness=1.0)
    with pytest.raises(DescriptionError, match='force "s": both ends are at the same point'):
        body.position = (0, 0, 0)
    assert body.position.tolist() == [1.0, 0.0, 0.0]


def test_several_at_once() -> None:
    """What one alone would not fit: all or none."""
    m = pt.catalogue.load("four-bar")
    drive = m.add_drive("A", position=0.5)
    with pytest.raises(DescriptionError, match="accompany position"):
        drive.velocity = 2.0
    with pytest.raises(DescriptionError, match="finite"):
        drive.change(position=None, velocity=np.inf)
    assert drive.position == 0.5 and drive.velocity is None
    drive.change(position=None, velocity="60 rpm")
    other = pt.catalogue.load("four-bar")
    other.add_drive("A", velocity=pt.units.rpm * 60)
    assert spec(m) == spec(other)
    m.joints["A"].change(point=(0, 0, "1 mm"), compliance=[1e-8] * 6)
    assert m.joints["A"].point[2] == 1e-3 and m.joints["A"].compliance.tolist() == [1e-8] * 6


def test_compiled_models_follow() -> None:
    """m L^2 / 3 of a rod, before and after; a state of before serves after."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=3.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    model = m.compile()
    start = m.assemble(targets={"A": 0.5})
    assert model.mass_matrix([0.0]).item() == pytest.approx(1.0, rel=1e-15)
    rod.mass = "6 kg"
    assert m.compile() is not model
    assert m.compile().mass_matrix([0.0]).item() == pytest.approx(2.0, rel=1e-15)
    assert model.mass_matrix([0.0]).item() == pytest.approx(1.0, rel=1e-15)  # what is compiled never changes
    assert m.simulate(0.1, initial=start).success


def test_mappings() -> None:
    m = pt.catalogue.load("four-bar")
    assert list(m.joints) == ["A", "B", "C", "D"] and len(m.bodies) == 3 and "A" in m.joints and "E" not in m.joints
    crank = m.bodies["crank"]
    assert m.bodies[crank] == crank and crank in m.bodies.values() and crank != m.bodies["coupler"]
    assert crank != deepcopy(m).bodies["crank"] and {crank: 1}[m.bodies["crank"]] == 1
    assert m.joints.get("E") is None
    with pytest.raises(UnknownNameError, match='did you mean "crank"'):
        m.bodies["crnk"]
    for wrong in (0, None, m.joints["A"], ("crank",), deepcopy(m).bodies["crank"]):
        with pytest.raises(UnknownNameError):
            m.bodies[wrong]  # type: ignore[index]
    with pytest.raises(DescriptionError, match="add_body"):
        m.bodies["new"] = crank
    with pytest.raises(UnknownAttributeError, match='did you mean "mass"') as caught:
        crank.masss  # noqa: B018
    assert caught.value.name == "masss" and "mass" in caught.value.known and not hasattr(crank, "masss")
    with pytest.raises(UnknownAttributeError):
        crank.masss = 1.0
    with pytest.raises(UnknownAttributeError, match="ground"):
        m.ground.mass  # noqa: B018
    assert m.joints["A"].kind == "revolute" and crank.kind == "rod" and "mass" in dir(crank)
    with pytest.raises(ValueError, match="read-only"):
        m.joints["A"].point[0] = 1.0
    b = m.joints["B"]
    extra = m.add_body("extra", mass=1.0, inertia=(1, 1, 1))
    m.bodies.remove(extra)
    with pytest.raises(UnknownNameError, match='no body "extra"'):
        extra.mass  # noqa: B018
    assert b.point.tolist() == pt.catalogue.load("four-bar").joints["B"].point.tolist()


def test_what_a_sensor_looks_at_stays() -> None:
    """A body, a joint, a spring and a sensor of a sensor are not taken away under it; nor a sensor under a law."""
    m = pt.catalogue.load("four-bar")
    spring = m.add_spring("coil", m.ground, (0, 1, 0), "coupler", (0, 0, 0), stiffness=9.0)
    tip = m.add_sensor("tip", ("coupler", ("100 mm", 0, 0)), "velocity", axes="rocker")
    m.add_sensor("pull", spring, "force")
    m.add_sensor("turn", "A", "position")
    m.add_sensor("speed", tip.norm())
    wanted = "turn"
    m.add_torque("A", lambda t, state: -state.sensor("speed") if t > 1 else 0.0, name="brake")
    m.add_torque("D", lambda t, state: -state.sensor(wanted), name="helper")
    assert (
        list(m.sensors) == ["tip", "pull", "turn", "speed"] and repr(m.sensors) == "<sensors: tip, pull, turn, speed>"
    )
    assert tip.kind == "sensor" and tip.of[0] == "coupler" and tip.of[1].tolist() == [0.1, 0.0, 0.0]
    assert tip.axes == m.bodies["rocker"] and m.sensors["pull"].of == spring and tip.unit is None
    for table, name, words in [
        (m.forces, "coil", 'sensor "pull" refers'),
        (m.joints, "A", 'force "brake", sensor "turn"'),
        (m.bodies, "coupler", 'force "coil", sensor "tip"'),
        (m.bodies, "rocker", 'sensor "tip"'),
        (m.sensors, "tip", 'sensor "speed"'),
        (m.sensors, "speed", 'force "brake"'),
        (m.sensors, "turn", 'force "helper"'),
    ]:
        with pytest.raises(DescriptionError, match=words):
            table.remove(name)
    before = spec(m)
    for handle, word, value, words in [
        (tip, "of", {"expression": "speed"}, "an expression is complete by itself"),
        (tip, "reads", "rotation", "must be one of"),
        (tip, "of", ("coupler", ("1 kg", 0, 0)), "the point is a length"),
        (m.sensors["turn"], "coordinate", 1, "integer, 0"),
    ]:
        with pytest.raises((DescriptionError, UnknownNameError), match=words):
            setattr(handle, word, value)
        assert spec(m) == before
    for of, words in (({"expression": "speed"}, 'before "speed"'), ({"expression": "tip"}, "no sensor 'tip'")):
        with pytest.raises((DescriptionError, UnknownNameError), match=words):
            tip.change(of=of, reads=None, axes=None)
        assert spec(m) == before
    run = m.simulate(0.1)
    tip.change(reads="acceleration", axes=None)
    assert run.sensor("tip").unit == "m/s" and m.simulate(0.1).sensor("speed").unit == "m/s^2"
    del m.forces["brake"]
    m.sensors.remove("speed")
    m.sensors.remove(tip)
    assert list(m.sensors) == ["pull", "turn"]
    with pytest.raises(DescriptionError, match="the method that makes such a sensor"):
        m.sensors["x"] = tip  # type: ignore[index]
