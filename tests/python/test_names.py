"""What is found by its name: completion, elements in one line, forces and angles of a run, the logger."""

from __future__ import annotations

import copy
import inspect
import logging
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import partita as pt
from partita.mechanism.unknown import ELSEWHERE
from partita.results.joint import ELSEWHERE as OF_JOINTS
from partita.results.result import ELSEWHERE as OF_RESULTS
from partita.units import UnitArray


def swing() -> pt.Mechanism:
    m = pt.Mechanism("swing", gravity="-y")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_spring("S", m.ground, (1, 2, 0), rod, rod.at((1, 0, 0)), stiffness=40.0, damping=0.5, length=1.5)
    m.add_torsion_spring("A", stiffness=3.0, damping=0.1, name="T")
    m.add_force(rod, (1.0, 2.0, 0.0), (0.5, 0, 0), name="F")
    return m


def test_completion_offers_public_names_alone() -> None:
    names = [name for name in dir(pt) if not name.startswith("__")]
    assert set(names) == set(pt.__all__) - {"__version__"}
    assert all(hasattr(pt, name) for name in names)


def test_elements_show_their_content() -> None:
    m = swing()
    rod, spring = m.bodies["rod"], m.forces["S"]
    assert repr(rod) == "Body('rod': rod, start=(0, 0, 0), end=(1, 0, 0), mass=1)"
    assert repr(m.joints["A"]) == "Joint('A': revolute, parent='ground', child='rod', point=(0, 0, 0))"
    assert repr(spring) == (
        "Force('S': spring, body1='ground', point1=(1, 2, 0), body2='rod', point2=(1, 0, 0), stiffness=40, "
        "damping=0.5, length=1.5)"
    )
    assert repr(m.ground) == "Body('ground': the world)" and str(rod) == "rod"
    spring.stiffness = 41.0
    assert "stiffness=41" in repr(spring)
    box = m.add_body("box", mass=1.0, inertia=(1, 2, 3), orientation=[[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert repr(box) == "Body('box': body, mass=1, inertia=(1, 2, 3), turned)"
    m.forces.remove("S")
    assert repr(spring) == "Force('S': removed)"
    push = m.add_torque("A", lambda t, state: 0.0, name="push")
    assert repr(push) == "Force('push': torque, joint='A', value=<lambda>)"


@pytest.mark.parametrize("name", pt.catalogue.names())
def test_every_element_of_the_catalogue_has_a_line(name: str) -> None:
    m = pt.catalogue.load(name)
    for table in (m.bodies, m.joints, m.couplings, m.rotors, m.drives, m.forces, m.sensors):
        for element in table.values():
            line = repr(element)
            assert line.startswith(f"{type(element).__name__}('{element.name}'") and "\n" not in line
            assert len(line) < 400 and "array" not in line


def test_forces_of_a_run_by_their_names() -> None:
    m = swing()
    for what in ("length", "rate", "force", "power", "energy"):
        m.add_sensor(f"S {what}", m.forces["S"], what)
    for what in ("effort", "power", "energy"):
        m.add_sensor(f"T {what}", m.forces["T"], what)
    for what in ("force", "moment", "position", "power", "energy"):
        m.add_sensor(f"F {what}", m.forces["F"], what)
    run = m.simulate(1.0)
    for sensor in run.sensors:
        name, what = sensor.split()
        found = run.force(m.forces[name]) if name == "S" else run.force(name)
        assert np.array_equal(getattr(found, "point" if what == "position" else what), run.sensor(sensor).values)
    angle = run.joint("A").angle
    assert np.allclose(
        run.force("T").effort, -3.0 * angle - 0.1 * run.joint("A").velocity[:, 0], rtol=1e-12, atol=1e-12
    )
    assert repr(run.force("S")) == "<force 'S': spring; length, rate, force, power, energy>"
    with pytest.raises(pt.errors.UnknownAttributeError, match=r'force "S" \(spring\) has no moment; it has: length'):
        run.force("S").moment  # noqa: B018
    assert not hasattr(run.force("F"), "effort") and hasattr(run.force("F"), "point")
    with pytest.raises(pt.errors.UnknownNameError, match="no force named 's'"):
        run.force("s")


def test_forces_need_the_model(tmp_path: Path) -> None:
    run = swing().simulate(0.1)
    for stored in (pickle.loads(pickle.dumps(run)), pt.load_result(run.save(tmp_path / "run.json"))):
        with pytest.raises(pt.errors.ArgumentError, match="add a sensor of the force before storing it"):
            stored.force("S")
    system = pt.System(n=1, mass=np.eye(1), forces=(0.0,))
    with pytest.raises(pt.errors.ArgumentError, match="System given by matrices"):
        pt.simulate(system, 0.1, [0.0], [1.0]).force("S")


def test_angles_and_displacements() -> None:
    run = pt.catalogue.load("slider-crank").simulate(0.2)
    crank, slide = run.joint("O"), run.joint("slide")
    assert np.array_equal(crank.angle, crank.position[:, 0]) and crank.angle.unit == "rad"
    assert np.array_equal(slide.displacement, slide.position[:, 0]) and slide.displacement.unit == "m"
    assert np.array_equal(crank.angle.to("deg"), crank.position[:, 0] * np.degrees(1.0))
    assert np.allclose(slide.displacement.to("mm"), 1e3 * slide.position[:, 0], rtol=1e-15)
    assert np.array_equal(crank.in_frame("joint").angle, crank.angle)
    for joint, word in ((crank, "displacement"), (slide, "angle")):
        with pytest.raises(pt.errors.UnknownAttributeError, match=f"so {word} is not defined; read its position"):
            getattr(joint, word)
        assert not hasattr(joint, word)
    with pytest.raises(pt.errors.ArgumentError, match="cannot be converted"):
        crank.angle.to("mm")
    study = pt.catalogue.load("four-bar").kinematics({"A": np.linspace(0.0, 7.0, 5)})
    assert np.allclose(study.joint("A").angle.to("rev")[-1], 7.0 / (2.0 * np.pi), rtol=1e-14)


def test_joints_of_several_coordinates() -> None:
    m = pt.Mechanism("several")
    for i, kind in enumerate(("cylindrical", "universal", "spherical")):
        m.add_body(kind, mass=1.0, inertia=(1, 1, 1), position=(i, 0, 0))
    m.add_cylindrical("cylindrical", m.ground, "cylindrical", point=(0, 0, 0))
    m.add_universal("universal", m.ground, "universal", point=(1, 0, 0), axis1=(1, 0, 0), axis2=(0, 1, 0))
    m.add_spherical("spherical", m.ground, "spherical", point=(2, 0, 0))
    run = m.simulate(0.1)
    both = run.joint("cylindrical")
    assert np.array_equal(both.displacement, both.position[:, 0]) and np.array_equal(both.angle, both.position[:, 1])
    assert not hasattr(run.joint("universal"), "angle") and not hasattr(run.joint("spherical"), "angle")


def test_numbers_that_know_their_unit() -> None:
    angle = UnitArray(np.linspace(0.0, 1.0, 5), "rad")
    for twin in (pickle.loads(pickle.dumps(angle)), copy.deepcopy(angle), angle[1:], angle.copy()):
        assert isinstance(twin, UnitArray) and twin.unit == "rad"
    for plain in (2.0 * angle, np.sin(angle), angle**2, angle - angle, angle > 0.5, -angle):
        assert type(plain) is np.ndarray
    assert type(angle.max()) is np.float64 and type(angle[0]) is np.float64 and type(angle.sum()) is np.float64
    with pytest.raises(pt.errors.ArgumentError, match="no unit"):
        np.concatenate([angle, angle]).view(UnitArray).to("deg")


def test_runs_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="partita"):
        swing().simulate(0.1)
    (line,) = (record.message for record in caplog.records if record.levelno == logging.INFO)
    assert line.startswith("swing: finished after 201 outputs and ")


def test_frames_in_units_of_choice() -> None:
    run = pt.catalogue.load("slider-crank").simulate(0.2)
    plain, chosen = run.to_pandas(), run.to_pandas(units={"rad": "deg", "m": "mm", "N": "kN", "rad/s": "rpm"})
    assert list(plain.columns) == list(chosen.columns)
    for name, factor, unit in (
        ("joint.O.position", 180.0 / np.pi, "deg"),
        ("joint.slide.position", 1e3, "mm"),
        ("joint.O.force.x", 1e-3, "kN"),
        ("joint.O.velocity", 30.0 / np.pi, "rpm"),
        ("joint.O.moment.z", 1.0, "N m"),
        ("energy.kinetic", 1.0, "J"),
        ("joint.slide.velocity", 1.0, "m/s"),
    ):
        assert np.allclose(chosen[name], factor * plain[name], rtol=1e-14, atol=0.0)
        assert chosen.attrs["units"][name] == unit
    for wrong, words in (
        ({"rad": "mm"}, "cannot be converted"),
        ({"km": "m"}, "no column is in 'km'; there are"),
        ("deg", "must be a mapping such as"),
        ({"rad": "degree of arc"}, "is not known"),
    ):
        with pytest.raises(pt.errors.ArgumentError, match=words):
            run.to_pandas(units=wrong)  # type: ignore[arg-type]


def named() -> pt.Mechanism:
    m = pt.Mechanism("pair", gravity=None)
    for i, name in enumerate(("a", "b")):
        m.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(i, 0, 0))
        m.add_revolute(name.upper(), m.ground, name, point=(i, 0, 0))
    m.add_body("c", mass=1.0, inertia=(1, 1, 1), position=(2, 0, 0))
    m.add_prismatic("C", m.ground, "c", axis=(0, 1, 0))
    return m


FIRST: dict[str, tuple[tuple[object, ...], dict[str, object]]] = {
    "add_gear": (("A", "B", 2.0), {}),
    "add_belt": (("A", "B", 0.1, 0.2), {}),
    "add_rack": (("A", "C", 0.1), {}),
    "add_cam": (("C", "A", ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])), {}),
    "add_torque": (("A", 5.0), {}),
    "add_torsion_spring": (("A",), {"stiffness": 1.0}),
    "add_force": (("a", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), {}),
    "add_friction": (("A", 1.0), {"stick_velocity": 0.1}),
    "add_stop": (("A",), {"stiffness": 1.0, "upper": 1.0}),
    "add_gas_spring": (("C",), {"force": 1.0, "length": 0.1}),
    "add_freewheel": (("A",), {}),
    "add_latch": (("A",), {"at": 0.5}),
    "add_brake": (("A", 1.0), {}),
    "add_rotor": (("A", 0.1), {"ratio": 2.0}),
    "add_drive": (("A", None, 2.0), {}),
}


@pytest.mark.parametrize("method", FIRST)
def test_the_name_may_come_first(method: str) -> None:
    arguments, more = FIRST[method]
    specs = []
    for form in ("keyword", "first", "first, handles", "first, keywords"):
        m = named()
        given: list[object] = list(arguments)
        if form == "first, handles":
            given = [
                m.joints[item] if isinstance(item, str) and item in m.joints else m.bodies["a"] if item == "a" else item
                for item in given
            ]
        call = getattr(m, method)
        if form == "keyword":
            call(*given, **more, name="own")
        elif form == "first, keywords":
            words = list(inspect.signature(call).parameters)
            call("own", **dict(zip(words, given, strict=False)), **more)
        else:
            call("own", *given, **more)
        specs.append(m.to_spec())
    assert all(spec == specs[0] for spec in specs[1:])
    m = named()
    getattr(m, method)(*arguments, **more)  # the name may be left out
    assert "name" in inspect.signature(getattr(m, method)).parameters


def test_a_name_first_and_an_unknown_joint() -> None:
    m = named()
    with pytest.raises(pt.errors.UnknownNameError, match='there is no joint "D"'):
        m.add_torque("motor", "D", 5.0)
    with pytest.raises(TypeError, match="positional arguments"):
        m.add_torque("motor", "A", 5.0, name="other")  # type: ignore[call-overload]
    assert m.add_torque("A", "5 N m").name == "torque on A"  # the second argument is no joint


def test_a_drive_given_at_another_level() -> None:
    m = named()
    with pytest.raises(
        pt.errors.DescriptionError,
        match="has the unit of its velocity; give velocity='60 rpm'",
    ):
        m.add_drive("A", "60 rpm")
    with pytest.raises(pt.errors.DescriptionError, match="'30 deg', which has the unit of its position"):
        m.add_drive("A", velocity="30 deg")
    with pytest.raises(pt.errors.DescriptionError, match="'3 kg' is a mass"):
        m.add_drive("A", velocity="3 kg")


def test_what_a_mechanism_does_not_have_is_named() -> None:
    m = named()
    for word, hint in (
        ("add_damper", "springs have a damper: damping= of add_spring and add_torsion_spring"),
        ("add_hinge", "use add_revolute"),
        ("natural_frequencies", r"use m.linearize\(m.equilibrium\(\)\).modes\(\)"),
        ("add_revolut", "did you mean 'add_revolute'"),
        ("add_motr", "add_torque applies an effort"),
        ("nonsense", r"dir\(m\) lists"),
    ):
        with pytest.raises(pt.errors.UnknownAttributeError, match=f"a mechanism has no '{word}'; {hint}"):
            getattr(m, word)
        assert not hasattr(m, word)
    assert not hasattr(m, "_private")
    texts = " ".join(ELSEWHERE.values())
    methods = set(re.findall(r"\badd_\w+", texts)) | set(re.findall(r"\bm\.(\w+)", texts))
    assert methods and all(hasattr(pt.Mechanism, method) for method in methods)
    assert not any(hasattr(pt.Mechanism, word) for word in ELSEWHERE)
    run = m.simulate(0.1)
    with pytest.raises(pt.errors.UnknownAttributeError, match="joint 'A' has no torque; use drive"):
        run.joint("A").torque  # noqa: B018
    assert all(not hasattr(type(run.joint("A")), word) for word in OF_JOINTS)


def test_what_a_result_does_not_have_is_answered_by_what_to_use() -> None:
    run = swing().simulate(0.1)
    for word, hint in (("time", "use run.t"), ("velocities", "use run.joint"), ("xyzzy", r"dir\(run\) lists")):
        with pytest.raises(pt.errors.UnknownAttributeError, match=f"a result has no '{word}'; {hint}"):
            getattr(run, word)
    assert not hasattr(run, "_private")
    assert not any(hasattr(run, word) for word in OF_RESULTS)
    named = set(re.findall(r"\brun\.(\w+)", " ".join(OF_RESULTS.values()).replace("run.csv", "")))
    assert named and all(hasattr(run, name) for name in named)
    assert np.array_equal(pickle.loads(pickle.dumps(run)).q, run.q)


def test_results_take_handles_like_names() -> None:
    m = swing()
    run = m.simulate(0.1)
    assert np.array_equal(run.joint(m.joints["A"]).force, run.joint("A").force)
    assert np.array_equal(run.body(m.bodies["rod"]).position, run.body("rod").position)
    drive = m.add_drive("A", velocity=1.0)
    other = m.add_body("other", mass=1.0, inertia=(1, 1, 1), position=(3, 0, 0))
    m.add_revolute("B", m.ground, other, point=(3, 0, 0))
    gear = m.add_gear("A", "B", ratio=2.0)
    driven = m.simulate(0.1)
    assert np.array_equal(driven.coupling(gear).effort, driven.coupling(gear.name).effort)
    assert np.array_equal(driven.drive(drive).effort, driven.drive("drive of A").effort)
    k = swing().kinematics({"A": [0.0, 0.1]})
    assert np.array_equal(k.joint(m.joints["A"]).position, k.joint("A").position)


def test_a_coordinate_of_a_joint_is_named_in_targets_and_explained_in_results() -> None:
    m = pt.Mechanism("sheet", gravity=None)
    body = m.add_body("sheet", mass=1.0, inertia=(1, 1, 1))
    plane = m.add_planar("plane", m.ground, body)
    turn = pt.Coordinate(plane, 2)
    state = m.assemble({turn: "10 deg"}, rates={pt.Coordinate("plane", 1): 2.0}, fixed=[pt.Coordinate("plane")])
    assert state.q == pytest.approx([0.0, 0.0, np.radians(10.0)], abs=1e-15) and state.v.tolist() == [0.0, 2.0, 0.0]
    k = m.kinematics({"plane.x": 0.0, "plane.y": 0.0, turn: [0.0, 0.5]}, rates={turn: 3.0})
    assert k.joint("plane").position[-1] == pytest.approx([0.0, 0.0, 0.5], abs=1e-14)
    with pytest.raises(pt.errors.ArgumentError, match=r"has 3 coordinates, counted from 0: plane\.x, plane\.y"):
        m.assemble({pt.Coordinate("plane", 3): 1.0})
    assert state.position("plane.turn") == state.position(turn) == pytest.approx(np.radians(10.0), abs=1e-15)
    assert state.velocity("plane.y") == state.velocity(pt.Coordinate("plane", 1)) == 2.0
    with pytest.raises(pt.errors.UnknownNameError, match=r"one coordinate of the joint .plane.: ask for the joint"):
        m.simulate(0.1).joint("plane.turn")


def test_forces_of_an_equilibrium_and_of_inverse_dynamics_are_those_of_a_run() -> None:
    m = swing()
    e = m.equilibrium(stable=True)
    still = m.simulate(0.1, initial=e.state)
    for name in ("S", "T"):
        word = "force" if name == "S" else "effort"
        assert getattr(e.force(name), word) == pytest.approx(getattr(still.force(name), word)[:1], rel=1e-9)
        held = m.inverse_dynamics(e.state, actuators=["A"]).force(m.forces[name])
        assert getattr(held, word) == pytest.approx(getattr(e.force(name), word), rel=1e-12)


def test_an_unknown_argument_of_an_analysis_is_answered_by_the_likely_one() -> None:
    m = swing()
    for call, words in (
        (lambda: m.simulate(1.0, dt=0.1), r"simulate\(\) has no argument 'dt'; did you mean 't_eval'\?"),
        (lambda: m.simulate(t_end=1.0), "'t_end'; did you mean 'duration'"),
        (lambda: m.assemble(velocities={"A": 1.0}), "'velocities'; did you mean 'rates'"),
        (lambda: m.linearize(state=None), "'state'; did you mean 'at'"),
        (lambda: m.equilibrium(start=None), "'start'; did you mean 'near'"),
    ):
        with pytest.raises(TypeError, match=words):
            call()


def test_what_is_not_linear_or_not_periodic_is_refused_with_a_remedy() -> None:
    m = swing()
    for stiffness in (([0.0, 1.0], [0.0, 5.0]), lambda x: 3.0 * x):
        with pytest.raises(pt.errors.DescriptionError, match=r"so that the force is linear; .* add_force_law"):
            m.add_spring("N", m.ground, (0, 1, 0), "rod", (1, 0, 0), stiffness=stiffness)
        with pytest.raises(pt.errors.DescriptionError, match="damping is one number"):
            m.add_torsion_spring("A", stiffness=1.0, damping=stiffness, name="N")
    other = m.add_body("other", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("B", m.ground, other, point=(0, 0, 0))
    with pytest.raises(pt.errors.DescriptionError, match="goes on at each turn give a table over all turns"):
        m.add_cam("B", "A", ([0.0, 3.0, 6.0], [0.0, 0.5, 1.0]), periodic=True)


def test_an_unknown_argument_is_answered_by_the_likely_one() -> None:
    m = named()
    for method, arguments, words in (
        ("add_pin_slot", {"axis": (1, 0, 0)}, r"add_pin_slot\(\) has no argument 'axis'; did you mean 'axis1'\?"),
        ("add_spring", {"parent": "a"}, "'parent'; did you mean 'body1'"),
        ("add_revolute", {"body1": "a"}, "'body1'; did you mean 'parent'"),
        ("add_body", {"colour": "red"}, "'colour'; it takes name, mass, inertia"),
        ("add_torque", {"axis": 0}, "'axis'; it takes joint, value"),
        ("add_rod", {"mas": 1.0}, "'mas'; did you mean 'mass'"),
    ):
        with pytest.raises(TypeError, match=words):
            getattr(m, method)("S", **arguments)
    assert m.to_spec() == named().to_spec()
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'mass'"):
        m.add_rod("r", (0, 0, 0), (1, 0, 0))  # type: ignore[call-arg]


ADDING = sorted(name for name in dir(pt.Mechanism) if name.startswith("add_"))
JOINED: dict[tuple[str, ...], str] = {
    ("parent", "child"): "ordered",
    ("body1", "body2"): "two ends",
    ("joint1", "joint2"): "two ends",
    ("pulley1", "pulley2"): "two ends",
    ("pinion", "slide"): "each its own",
    ("follower", "cam"): "each its own",
    ("body", "on"): "each its own",
    ("body", "ground"): "each its own",
    ("joint",): "one",
    ("body",): "one",
}
"""What an element can join, and what the order means: docs/elements.md, decision 0067."""
OTHERS = {"add_body", "add_rod", "add_solid", "add_coupler", "add_constraint", "add_force_law", "add_sensor", "add_imu"}
"""Bodies, which join nothing, and elements that take a list of what they depend on."""


@pytest.mark.parametrize("method", ADDING)
def test_elements_name_themselves_first_and_what_they_join_by_one_pair_of_words(method: str) -> None:
    """A new method that joins two things takes one of these pairs, or adds its own with a reason."""
    call = getattr(pt.Mechanism, method)
    parameters = list(inspect.signature(call).parameters.values())[1:]
    words = [p.name for p in parameters]
    if method != "add_compliance":  # a property of its joint, without a name
        optional = parameters[words.index("name")]
        assert words[0] == "name" or (method in FIRST and optional.kind is optional.KEYWORD_ONLY), words
    things = {word for pair in JOINED for word in pair}
    there = tuple(word for word in words if word in things)
    if method in OTHERS:
        assert there == (("on",) if method == "add_force_law" else ())  # the joint or bodies on which it acts
        return
    assert there in JOINED, there
    assert words[1 if words[0] == "name" else 0] == there[0]
    makes_a_joint = inspect.signature(call).return_annotation == "Joint" and method != "add_compliance"
    assert makes_a_joint == (JOINED[there] == "ordered")
    assert makes_a_joint or not any(word.startswith(("parent", "child")) for word in words)
    ends = {word[:-1] for word in words if word[-1] in "12"}
    for end in ends:
        pair = {f"{end}1", f"{end}2"}
        assert pair <= set(words) or (method, end) in ONE_END, (method, end)
    if ends - {"axis"}:
        assert JOINED[there] == "two ends" or (method, ends) == ("add_rack", {"coordinate"}), ends
    assert ("coordinate" in words) <= (there == ("joint",)) and not ("coordinate" in words and "coordinate1" in words)


ONE_END = {("add_point_on_curve", "point")}
"""The curve is on the first body, the point on the second."""


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_state_knows_joints_that_are_not_part_of_it(coordinates: str) -> None:
    """What `kinematics` says of the same position, also with other parameters and from a run; a copy knows it too."""
    m = pt.catalogue.load("four-bar")
    state = m.assemble({"A": 0.5}, rates={"A": 2.0}, coordinates=coordinates)
    k = m.kinematics({"A": 0.5}, rates={"A": 2.0})
    run = m.simulate(0.02, initial=state, coordinates=coordinates)
    for name in m.joints:
        for one in (state, copy.deepcopy(state)):
            assert one.position(name) == pytest.approx(k.joint(name).position[0, 0], abs=1e-12)
            assert one.velocity(pt.Coordinate(name)) == pytest.approx(k.joint(name).velocity[0, 0], abs=1e-12)
        assert run.state(0.02).position(name) == pytest.approx(run.joint(name).position[-1, 0], abs=1e-12)
    longer = {"D.point": np.array(m.compile().parameters["D.point"]) + np.array([0.05, 0.0, 0.0])}
    other = m.assemble({"A": 0.5}, parameters=longer, coordinates=coordinates)
    right = m.kinematics({"A": 0.5}, parameters=longer).joint("C").position[0, 0]
    assert other.position("C") == pytest.approx(right, abs=1e-12)
    assert abs(right - state.position("C")) > 1e-3
    gone = pickle.loads(pickle.dumps(state))
    if coordinates == "absolute":
        with pytest.raises(pt.errors.ArgumentError, match="not part of the state"):
            gone.position("C")
    assert gone.q.tolist() == state.q.tolist()


def test_one_velocity_of_a_joint_is_read_by_its_name() -> None:
    m = pt.Mechanism("free")
    m.add_body("body", mass=1.0, inertia=(1, 1, 1))
    m.add_free("F", m.ground, "body")
    state = m.assemble({"F.x": 0.3}, rates={"F.wz": 2.0, "F.y": -1.0})
    assert state.velocity("F.wz") == state.velocity(pt.Coordinate("F", 5)) == 2.0
    assert state.velocity("F.y") == -1.0 and state.position("F.x") == state.position(pt.Coordinate("F")) == 0.3
    assert state.velocity("F").tolist() == [0.0, -1.0, 0.0, 0.0, 0.0, 2.0]
    with pytest.raises(pt.errors.ArgumentError, match=r"has 6 velocities, counted from 0: F\.x"):
        state.velocity(pt.Coordinate("F", 6))
    with pytest.raises(pt.errors.UnknownNameError, match=r'no joint "F\.wq"; the joint "F" has F\.x'):
        state.velocity("F.wq")
    with pytest.raises(pt.errors.UnknownNameError, match=r'"F" has F\.x, F\.y, F\.z, F\.qw, F\.qx, F\.qy, F\.qz$'):
        state.position("F.wz")


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_coordinates_of_a_joint_have_one_name_in_the_state_or_not(coordinates: str) -> None:
    """Of a joint that turns about all axes too: as target, rate, reading and in functions."""
    m = pt.Mechanism("free", gravity=None)
    m.add_body("body", mass=2.0, inertia=(1, 1, 1))
    m.add_free("F", m.ground, "body")
    state = m.assemble({"F.x": 0.3, pt.Coordinate("F", 1): "4 m"}, rates={"F.z": 2.0}, coordinates=coordinates)
    assert [state.position(f"F.{axis}") for axis in ("x", "y", "z", "qw", "qx")] == [0.3, 4.0, 0.0, 1.0, 0.0]
    assert state.position("F").tolist() == [0.3, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert state.velocity("F.z") == pytest.approx(2.0, rel=1e-15)
    # a spring of 8 N/m along x, whose law reads the joint: it swings at 2 rad/s
    m.add_force("body", lambda t, s: (-8.0 * s.position("F.x"), 0.0, 0.0 * s.velocity("F.wz")), point=(0, 0, 0))
    run = m.simulate(0.5, initial=state, t_eval=[0.0, 0.5], coordinates=coordinates)
    assert run.state(0.5).position("F.x") == pytest.approx(0.3 * np.cos(1.0), abs=1e-8)
    assert run.state(0.5).position("F.z") == pytest.approx(1.0, abs=1e-8)
