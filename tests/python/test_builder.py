"""What the builder accepts of bodies and joints, what it refuses and with which words; compiling and assembling."""

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum
from scipy.spatial.transform import Rotation

import partita as pt
from partita.errors import (
    ArgumentError,
    DescriptionError,
    UnknownNameError,
)

INERTIA = (1.0, 1.0, 1.0)


def body_spec(**change: Any) -> dict[str, Any]:
    m = pt.Mechanism("m")
    m.add_body(**{"name": "b", "mass": 1.0, "inertia": INERTIA, **change})
    return dict(m.to_spec()["bodies"][0])


# ---------------------------------------------------------------- bodies


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"name": ""}, "cannot be a name"),
        ({"name": " b"}, "neither starts nor ends with a space"),
        ({"name": 3}, "must be text"),
        ({"name": "ground"}, "reserved"),
        ({"mass": -1.0}, "at least 0"),
        ({"mass": math.nan}, "finite"),
        ({"mass": "heavy"}, "real numbers"),
        ({"mass": [1.0]}, "one number"),
        ({"com": (0, 0)}, "3 numbers"),
        ({"com": (0, 0, math.inf)}, "NaN and infinity"),
        ({"position": [[0, 0, 0]]}, "3 numbers"),
        ({"position": [[0], [0, 1]]}, "real numbers"),
        ({"inertia": 1.0}, "(Ixx, Iyy, Izz)"),
        ({"inertia": [[1, 0], [0]]}, "(Ixx, Iyy, Izz)"),
        ({"inertia": (1, 1, -1)}, "not negative"),
        ({"inertia": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}, "not symmetric"),
        ({"inertia": (0, 0, 2.0)}, "give (1, 1, 2)"),
        ({"orientation": 2 * np.eye(3)}, "not a rotation"),
        ({"orientation": np.diag([1.0, 1.0, -1.0])}, "reflection"),
        ({"orientation": (0, 0, 0, 0)}, "zero quaternion"),
        ({"orientation": (1, 0, 0)}, "SciPy Rotation"),
        ({"orientation": [[1, 0], [0]]}, "SciPy Rotation"),
        ({"orientation": Rotation.identity(2)}, "2 rotations"),
    ],
)
def test_bad_body_is_refused_with_its_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        body_spec(**change)
    assert words in str(caught.value)
    assert caught.value.element == "body"
    assert caught.value.name == str(change.get("name", "b"))


def test_a_refused_element_leaves_no_trace() -> None:
    m = pt.Mechanism("m")
    with pytest.raises(DescriptionError):
        m.add_body("b", mass=-1.0, inertia=INERTIA)
    assert not m.bodies
    m.add_body("b", mass=1.0, inertia=INERTIA)
    with pytest.raises(DescriptionError, match="already a body"):
        m.add_rod("b", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)


@pytest.mark.parametrize("inertia", [(0, 0, 0), (0, 1, 1), (1, 2, 3), (1.0, 1.0, 2.0 * (1 + 1e-8))])
def test_limiting_inertias_are_possible(inertia: tuple[float, float, float]) -> None:
    """Point mass, slender rod, flat plate, and a plate with the rounding of printed data."""
    assert np.array_equal(body_spec(inertia=inertia)["inertia"], np.diag(inertia))


def test_the_three_forms_of_an_orientation_agree() -> None:
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9])
    x, y, z, w = turn.as_quat()
    for orientation in (turn, turn.as_matrix(), (w, x, y, z), (2 * w, 2 * x, 2 * y, 2 * z)):
        # 4 eps: a quaternion and a matrix each round once
        assert np.allclose(body_spec(orientation=orientation)["orientation"], turn.as_matrix(), rtol=0, atol=1e-15)
    assert body_spec(orientation=None)["orientation"] == np.eye(3).tolist()


def test_rotation_with_rounded_digits_becomes_the_nearest_rotation() -> None:
    exact = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    used = np.array(body_spec(orientation=np.round(exact, 10))["orientation"])
    assert np.max(np.abs(used.T @ used - np.eye(3))) < 1e-15
    with pytest.raises(DescriptionError, match="more digits"):
        body_spec(orientation=np.round(exact, 6))


@pytest.mark.parametrize("end", [(1, 0, 0), (-3, 4, 0), (0, 0, 2), (0, 0, -2), (1, 2, 3), (0.1, 0.2, 3)])
def test_rod_frame(end: tuple[float, float, float]) -> None:
    """Origin at start, x towards end, right-handed; in the x-y plane z is the world's z exactly."""
    start = np.array([0.5, -1.0, 2.0])
    m = pt.Mechanism("m")
    m.add_rod("rod", start=start, end=start + end, mass=12.0)
    rod = m.to_spec()["bodies"][0]
    length = float(np.linalg.norm(end))
    frame = np.array(rod["orientation"])
    assert np.allclose(start + frame @ [length, 0, 0], start + end, rtol=0, atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-15)
    if end[2] == 0:
        assert frame[:, 2].tolist() == [0.0, 0.0, 1.0]
    assert rod["com"] == [length / 2, 0.0, 0.0]
    assert np.allclose(rod["inertia"], np.diag([0.0, length**2, length**2]), rtol=1e-15)


def test_rod_needs_a_length() -> None:
    with pytest.raises(DescriptionError, match="same point"):
        pt.Mechanism("m").add_rod("rod", start=(1, 1, 1), end=(1, 1, 1), mass=1.0)


@pytest.mark.parametrize(
    ("name", "gravity"), [("", (0, 0, 0)), ("m", (0, 0)), ("m", (0, math.nan, 0)), (None, (0, 0, 0))]
)
def test_bad_mechanism_is_refused(name: Any, gravity: Any) -> None:
    with pytest.raises(DescriptionError) as caught:
        pt.Mechanism(name, gravity=gravity)
    assert caught.value.element == "mechanism"


# ---------------------------------------------------------------- joints

BAD_JOINTS: list[tuple[Callable[[pt.Mechanism], Any], str]] = [
    (lambda m: m.add_revolute("A", m.ground, "rod", point=(0, 0, 0)), "already a joint"),
    (lambda m: m.add_revolute("B", "rod", "rod", point=(0, 0, 0)), "two different bodies"),
    (lambda m: m.add_revolute("B", m.ground, "rod", point=(0, 0, 0), axis=(0, 0, 0)), "no direction"),
    (lambda m: m.add_revolute("B", m.ground, "rod", point=(0, 0)), "3 numbers"),
    (lambda m: m.add_revolute("B", m.ground, 7, point=(0, 0, 0)), "must be a body"),
    (lambda m: m.add_revolute("B", m.ground, "rod", point=(0, 0, 0), cut="yes"), "'auto', 'always', 'never'"),
    (lambda m: m.add_revolute("B", pendulum().ground, "rod", point=(0, 0, 0)), "belongs to the mechanism"),
    (lambda m: m.add_universal("B", "ground", "rod", (0, 0, 0), axis1=(1, 0, 0), axis2=(-2, 0, 0)), "are parallel"),
    (lambda m: m.add_joint("B", "ground", "rod", free=("x", "rq")), "'rx'"),
    (lambda m: m.add_joint("B", "ground", "rod", free=("x", "x")), "twice"),
    (lambda m: m.add_joint("B", "ground", "rod", free="x"), "list of directions"),
    (lambda m: m.add_joint("B", "ground", "rod", free=("x",), frame=np.ones((3, 3))), "not a rotation"),
]


def test_axes_of_a_universal_joint_are_parallel_for_all_or_for_none() -> None:
    """What is refused as parallel is refused where it is said, and what is taken compiles."""
    for angle, taken in ((1e-3, False), (1.9e-3, False), (2.1e-3, True), (1e-2, True)):
        m = pt.Mechanism("shaft")
        m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
        axes = {"axis1": (0.0, 1.0, 0.0), "axis2": (0.0, np.cos(angle), np.sin(angle))}
        if taken:
            m.add_universal("U", m.ground, "rod", point=(0, 0, 0), **axes)
            assert m.compile().mobility == 2
        else:
            with pytest.raises(pt.errors.DescriptionError, match="are parallel"):
                m.add_universal("U", m.ground, "rod", point=(0, 0, 0), **axes)


@pytest.mark.parametrize(("add", "words"), BAD_JOINTS)
def test_bad_joint_is_refused(add: Callable[[pt.Mechanism], Any], words: str) -> None:
    m = pendulum()
    with pytest.raises(DescriptionError) as caught:
        add(m)
    assert words in str(caught.value)
    assert caught.value.element == "joint"
    assert tuple(m.joints) == ("A",)


def test_unknown_body_is_answered_with_the_nearest_name() -> None:
    m = pendulum()
    with pytest.raises(UnknownNameError) as caught:
        m.add_revolute("B", m.ground, "rood", point=(0, 0, 0))
    assert 'did you mean "rod"?' in str(caught.value)
    assert caught.value.name == "rood" and caught.value.known == ["rod", "ground"]
    assert isinstance(caught.value, KeyError)


def test_joint_descriptions() -> None:
    """Every kind of joint in the words of the core; directions become unit vectors, handles become names."""
    m = pt.Mechanism("m")
    body = m.add_body("b", mass=1.0, inertia=INERTIA, position=(1, 2, 3))
    m.add_revolute("revolute", m.ground, body, (0, 0, 0), child_point=(0, 0, 0.1), child_axis=(0, 3, 4))
    m.add_prismatic("prismatic", m.ground, body, axis=(0, 2, 0))
    m.add_cylindrical("cylindrical", m.ground, body, (0, 0, 0), cut="always")
    m.add_spherical("spherical", m.ground, body, (0, 0, 0))
    m.add_universal("universal", "ground", "b", (0, 0, 0), axis1=(2, 0, 0), axis2=(0, 3, 0))
    m.add_planar("planar", body, m.ground, normal=(0, 5, 0))
    m.add_fixed("fixed", m.ground, body)
    m.add_free("free", m.ground, body)
    m.add_joint("generic", m.ground, body, free=("rz", "x"), frame=Rotation.from_euler("z", 90, degrees=True))
    joints = {joint["name"]: joint for joint in m.to_spec()["joints"]}
    assert all(joint["kind"] == name for name, joint in joints.items())
    assert joints["revolute"]["axis"] == [0, 0, 1]
    assert joints["revolute"]["child_point"] == [0, 0, 0.1]
    assert joints["revolute"]["child_axis"] == [0, 0.6, 0.8]
    assert joints["prismatic"]["axis"] == [0, 1, 0] and joints["prismatic"]["point"] == [1, 2, 3]
    assert joints["cylindrical"]["cut"] == "always" and joints["spherical"]["cut"] == "auto"
    assert joints["universal"]["axis"] == [1, 0, 0] and joints["universal"]["axis2"] == [0, 1, 0]
    assert joints["planar"]["axis"] == [0, 1, 0] and joints["planar"]["point"] == [1, 2, 3]
    assert joints["generic"]["free"] == ["x", "rz"]
    assert np.allclose(joints["generic"]["frame"], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], rtol=0, atol=1e-15)
    assert "free" not in joints["free"] and "frame" not in joints["fixed"]
    json.dumps(m.to_spec(), allow_nan=False)


# ---------------------------------------------------------------- compile, assemble, simulate


def test_compiled_models_are_kept_until_something_changes() -> None:
    m = pendulum()
    first = m.compile()
    assert m.compile() is first and m.compile("absolute") is not first
    m.add_torque("A", 1.0)
    assert m.compile() is not first


def test_nothing_to_compile() -> None:
    with pytest.raises(DescriptionError, match="no bodies"):
        pt.Mechanism("empty").compile()


def test_assemble_sets_targets_and_rates_by_name_or_handle() -> None:
    m = pendulum()
    state = m.assemble(targets={"A": 0.5}, rates={"A": 2.0})
    assert state.position("A") == 0.5 and state.velocity("A") == 2.0 and state.t == 0.0
    again = m.assemble(near=state)
    assert again.q.tolist() == state.q.tolist()
    copy = state.copy()
    copy.q[0] = 9.0
    assert state.position("A") == 0.5 and "A=0.5" in repr(state)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"targets": {"B": 1.0}}, UnknownNameError, "known: A"),
        ({"targets": {"A": [1.0, 2.0]}}, ArgumentError, "1 finite number"),
        ({"targets": {"A": math.nan}}, ArgumentError, "finite"),
        ({"targets": {"A": "far"}}, ArgumentError, "made of real numbers"),
        ({"targets": [1.0]}, ArgumentError, "dict"),
        ({"rates": {"B": 1.0}}, UnknownNameError, "known: A"),
        ({"tolerance": 0.0}, ArgumentError, "greater than zero"),
        ({"coordinates": "relativ"}, ArgumentError, "'relative'"),
        ({"near": np.zeros(1)}, ArgumentError, "must be a State"),
        ({"near": pt.State(0.0, [1.0, 2.0], [0.0, 0.0])}, ArgumentError, "but this model"),
        ({"t": math.inf}, ArgumentError, "finite"),
    ],
)
def test_bad_arguments_of_assemble(arguments: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error) as caught:
        pendulum().assemble(**arguments)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"duration": 0.0}, "greater than zero"),
        ({"duration": math.nan}, "finite"),
        ({"duration": "long"}, "must be made of real numbers"),
        ({"rtol": -1e-8}, "rtol"),
        ({"atol": 0.0}, "atol"),
        ({"method": "dop583"}, "'dop853'"),
        ({"solver": pt.Solver("lagrange")}, "'projective', 'fixed', 'wehage-haug'"),
        ({"coordinates": "joint"}, "'relative', 'absolute'"),
        ({"correction": "Partition"}, "'partition'"),
        ({"switch_threshold": 0.5}, "1.25 is usual"),
        ({"step": 1e-3, "max_step": 1e-2}, "give one"),
        ({"max_steps": 0}, "max_steps"),
        ({"t_eval": [0.0, 0.5, 0.5]}, "must increase"),
        ({"t_eval": [0.0, 2.0]}, "outside the run"),
        ({"t_eval": [-1.0, 0.5]}, "outside the run"),
        ({"t_eval": 10}, "np.linspace(0, 1, 201)"),
        ({"t_eval": [0.0, math.nan]}, "NaN"),
        ({"t_eval": []}, "flat array"),
        ({"progress": "yes"}, "progress"),
        ({"independent": "A"}, "['A']"),
        ({"independent": ["A", "A"]}, "twice"),
        ({"initial": "A"}, "must be a State"),
    ],
)
def test_bad_options_of_simulate(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        pendulum().simulate(**{"duration": 1.0, **arguments})
    assert words in str(caught.value)


def test_unknown_independent_velocity() -> None:
    with pytest.raises(UnknownNameError, match="known velocities: A"):
        pendulum().simulate(1.0, independent=["nothing"])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda model: model.mass_matrix([0.0, 0.0]), "flat array of 1 numbers: A"),
        (lambda model: model.forces([0.0], [math.nan]), "finite"),
        (lambda model: model.constraints("q"), "array of numbers"),
        (lambda model: model.jacobian(0.0), "flat array"),
    ],
)
def test_bad_arrays_for_a_compiled_model(call: Callable[[Any], Any], words: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        call(pendulum().compile())
    assert words in str(caught.value)


def test_report_is_words() -> None:
    text = pendulum().report()
    assert text.startswith('Mechanism "pendulum"\n')
    assert "1 degree of freedom" in text and "rho" in text and "independent" in text


# ---------------------------------------------------------------- units and errors


def test_units() -> None:
    assert pt.units.convert(1.0, "inch", "m") == pt.units.inch == 0.0254
    assert pt.units.convert([60.0], "rpm", "rad/s").tolist() == pytest.approx([2 * math.pi])
    with pytest.raises(ArgumentError, match="unit of length and 'deg' one of angle"):
        pt.units.convert(1.0, "mm", "deg")
    with pytest.raises(ArgumentError, match="did you mean 'inches' or 'inch'"):
        pt.units.convert(1.0, "inchs", "mm")


@pytest.mark.parametrize(
    "name", [n for n in pt.errors.__all__ if n not in ("PartitaError", "Interrupted") and "Warning" not in n]
)
def test_errors_carry_their_fields_through_pickle(name: str) -> None:
    import pickle

    error = getattr(pt.errors, name)("a sentence", t=1.5, path="x")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == "a sentence"
    assert again.t == 1.5 and again.path == "x" and again.fields == error.fields
    assert isinstance(error, pt.errors.PartitaError) and len(type(error).__mro__) > 5
