"""What the builder accepts, what it refuses and with which words, and the description it makes."""

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

import partita as pt
from partita.builder.motion import Motion, differences
from partita.builder.taylor import Jet
from partita.errors import (
    ArgumentError,
    DescriptionError,
    EvaluationError,
    UnknownNameError,
)

INERTIA = (1.0, 1.0, 1.0)


def pendulum() -> pt.Mechanism:
    """A uniform rod of 1 m and 1 kg on a hinge at the origin, drawn along x."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


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
        ({"inertia": (1, 1, -1)}, "below zero"),
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
    assert m.bodies == ()
    m.add_body("b", mass=1.0, inertia=INERTIA)
    with pytest.raises(DescriptionError, match="already a body"):
        m.add_rod("b", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)


@pytest.mark.parametrize("inertia", [(0, 0, 0), (0, 1, 1), (1, 2, 3), (1.0, 1.0, 2.0 * (1 + 1e-8))])
def test_limiting_inertias_are_possible(inertia: tuple[float, float, float]) -> None:
    """Point mass, slender rod, flat plate, and a plate with the rounding of printed data."""
    assert np.array_equal(body_spec(inertia=inertia)["inertia"], np.diag(inertia))


def test_the_three_ways_to_orient_a_body_agree() -> None:
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


@pytest.mark.parametrize(("add", "words"), BAD_JOINTS)
def test_bad_joint_is_refused(add: Callable[[pt.Mechanism], Any], words: str) -> None:
    m = pendulum()
    with pytest.raises(DescriptionError) as caught:
        add(m)
    assert words in str(caught.value)
    assert caught.value.element == "joint"
    assert m.joints == ("A",)


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


# ---------------------------------------------------------------- forces


def forces(m: pt.Mechanism) -> list[dict[str, Any]]:
    return list(m.to_spec()["forces"])


def test_spring_length_is_as_drawn_or_as_given() -> None:
    m = pendulum()
    m.add_spring("S", m.ground, (1, 1, 0), "rod", (1, 0, 0), stiffness=-3.0)
    m.add_spring("T", m.ground, (1, 1, 0), "rod", (1, 0, 0), stiffness=1.0, damping=0.5, length=0.0)
    first, second = forces(m)
    assert first["length"] == 1.0 and first["stiffness"] == -3.0 and first["damping"] == 0.0
    assert second["length"] == 0.0 and second["damping"] == 0.5


BAD_FORCES: list[tuple[Callable[[pt.Mechanism], Any], str]] = [
    (lambda m: m.add_spring("S", m.ground, (1, 0, 0), "rod", (1, 0, 0), stiffness=1.0), "same point"),
    (lambda m: m.add_spring("S", "rod", (1, 0, 0), "rod", (0, 0, 0), stiffness=1.0), "does nothing"),
    (lambda m: m.add_spring("S", m.ground, (1, 1, 0), "rod", (1, 0, 0), stiffness=math.nan), "finite"),
    (lambda m: m.add_spring("S", m.ground, (1, 1, 0), "rod", (1, 0, 0), stiffness=1.0, length=-1.0), "at least 0"),
    (lambda m: m.add_torsion_spring("A", stiffness=1.0, coordinate=1), "an integer, 0"),
    (lambda m: m.add_torsion_spring("A", stiffness=1.0, coordinate=0.0), "an integer"),
    (lambda m: m.add_torque("A", "strong"), "real numbers"),
    (lambda m: m.add_torque("A", (1.0, 2.0, 3.0)), "a table (times, values)"),
    (lambda m: m.add_torque("A", ([0, 1, 1], [0, 0, 0])), "times must increase"),
    (lambda m: m.add_torque("A", ([0, 1, 2], [0, 0])), "one value for each"),
    (lambda m: m.add_torque("A", ([0, 1], [0, math.nan])), "NaN"),
    (lambda m: m.add_torque("A", ([0, 1], ["a", "b"])), "made of numbers"),
    (lambda m: m.add_torque(m.ground, 1.0), "must be a joint"),
    (lambda m: m.add_force(m.ground, (0, 0, 1)), "does not move"),
    (lambda m: m.add_force("rod", (0, 1)), "three components"),
    (lambda m: m.add_force("rod", (0, 0, math.inf)), "force z"),
    (lambda m: m.add_force("rod", (0, 0, 1), axes="child"), "'world', 'body'"),
    (lambda m: m.add_force("rod", ([0, 1], [[0, 0], [1, 1]])), "3 values"),
]


@pytest.mark.parametrize(("add", "words"), BAD_FORCES)
def test_bad_force_is_refused(add: Callable[[pt.Mechanism], Any], words: str) -> None:
    m = pendulum()
    with pytest.raises(DescriptionError) as caught:
        add(m)
    assert words in str(caught.value)
    assert m.forces == ()


def test_torsion_spring_needs_an_angle() -> None:
    m = pendulum()
    m.add_body("ball", mass=1.0, inertia=INERTIA)
    m.add_spherical("S", m.ground, "ball", point=(0, 0, 0))
    m.add_torque("S", 1.0, coordinate=2)
    with pytest.raises(DescriptionError, match="no slide or angle"):
        m.add_torsion_spring("S", stiffness=1.0)


def test_names_of_unnamed_forces_are_told_apart() -> None:
    m = pendulum()
    assert [m.add_torque("A", 1.0).name for _ in range(3)] == ["torque on A", "torque on A 2", "torque on A 3"]
    assert m.add_torque("A", 1.0, name="motor").name == "motor"
    with pytest.raises(DescriptionError, match="already a force"):
        m.add_torque("A", 1.0, name="motor")


def test_tables_become_the_cubics_of_scipy() -> None:
    """Forces: PCHIP. Motions: not-a-knot. Evaluated from the description as the core does it."""
    times, values = np.array([0.0, 0.5, 1.5, 2.0, 4.0]), np.array([0.0, 1.0, -1.0, 2.0, 2.0])
    m = pendulum()
    m.add_torque("A", (times, values))
    m.add_drive("A", (times, values))
    for table, curve in (
        (forces(m)[0]["value"]["table"], PchipInterpolator(times, values)),
        (m.to_spec()["drives"][0]["motion"]["table"], CubicSpline(times, values)),
    ):
        breaks, rows = np.array(table["breaks"]), np.array(table["coefficients"])
        for t in np.linspace(0.0, 3.999, 41):
            i = int(np.searchsorted(breaks, t, side="right")) - 1
            assert np.polyval(rows[i], t - breaks[i]) == pytest.approx(float(curve(t)), rel=1e-14, abs=1e-14)


def test_force_as_one_table_with_three_columns() -> None:
    m = pendulum()
    m.add_force("rod", ([0.0, 1.0], [[1, 2, 3], [4, 5, 6]]))
    m.add_force("rod", (0.0, ([0.0, 1.0], [2.0, 5.0]), 3.0), point=(1, 0, 0), axes="body")
    whole, mixed = forces(m)
    assert [value["table"]["coefficients"][0][3] for value in whole["value"]] == [1, 2, 3]
    assert whole["point"] == [0.5, 0, 0] and whole["axes"] == "world"
    assert mixed["value"][0] == {"constant": 0.0} and mixed["value"][1]["table"]["breaks"] == [0, 1]
    assert mixed["point"] == [1, 0, 0] and mixed["axes"] == "body"


def test_functions_of_the_state_see_joints_by_name() -> None:
    m = pendulum()
    seen: list[Any] = []

    def torque(t: float, state: Any) -> float:
        seen.append((t, state.position("A"), state.velocity("A"), state.q.tolist()))
        return 2.0

    m.add_torque("A", torque)
    model = m.compile()
    without = pendulum().compile().forces([0.3], [0.7])
    assert (model.forces([0.3], [0.7], t=1.5) - without).tolist() == pytest.approx([2.0], abs=1e-15)
    assert seen[-1] == (1.5, 0.3, 0.7, [0.3])


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda t, state: math.nan, "nan"),
        (lambda t, state: None, "one number, not NoneType"),
        (lambda t, state: [1.0, 2.0], "one number, not list"),
        (lambda t, state: np.zeros(2), "shape (2,)"),
    ],
)
def test_useless_values_of_a_function_are_named(function: Any, words: str) -> None:
    m = pendulum()
    m.add_torque("A", function, name="motor")
    with pytest.raises(EvaluationError) as caught:
        m.compile().forces([0.0], [0.0], t=0.25)
    assert words in str(caught.value) and '"motor"' in str(caught.value)
    assert caught.value.t == 0.25 and caught.value.where == "motor"


def test_a_function_may_ask_only_for_joints_in_the_state() -> None:
    m = pendulum()
    m.add_torque("A", lambda t, state: state.position("B"))
    with pytest.raises(UnknownNameError, match='no joint "B"'):
        m.compile().forces([0.0], [0.0])


# ---------------------------------------------------------------- drives

SMOOTH: list[Callable[[Any], Any]] = [
    lambda t: np.sin(3 * t) * t**2,
    lambda t: np.exp(-t) / (1 + t) - 3 / (t + 2),
    lambda t: np.tanh(t) + np.arctan(2 * t) - np.sqrt(t + 1),
    lambda t: np.log(t + 2) ** 1.5 + 2**t + (t + 1) ** t,
    lambda t: np.hypot(t, 1.0) + np.arctan2(t, 2.0) + np.arctan2(2.0, t),
    lambda t: np.where(t < 5, t**3, 0.0),
    lambda t: np.polyval([1, 2, 3, 4], t),
    lambda t: np.dot([1.0, 2, 3], np.array([1, t, t * t])),
    lambda t: np.arcsin(t / 5) + np.arccos(t / 5) * t + np.cosh(t) + np.sinh(t) + np.tan(t / 2),
    lambda t: np.log1p(t) + np.expm1(t) + np.log2(t + 1) + np.log10(t + 1) + np.square(t),
    lambda t: t % 0.5 + abs(-t) + np.maximum(t, 0.1) + max(t, 0.2) - np.radians(t),
    lambda t: np.sum(np.sin(np.arange(3) * t)),
]


@pytest.mark.parametrize("f", SMOOTH)
def test_jet_against_differences(f: Callable[[Any], Any]) -> None:
    """Two derivations that share nothing; the tolerance is ten times the error that the differences report."""
    for t in (0.3, 0.9503617):
        jet = f(Jet(t, 1.0, 0.0))
        jet = jet[()] if isinstance(jet, np.ndarray) else jet
        x, v, a, error = differences(lambda s: float(f(s)), t)
        assert jet.x == pytest.approx(x, rel=1e-15)
        assert jet.d1 == pytest.approx(v, rel=1e-10, abs=10 * error)
        assert jet.d2 == pytest.approx(a, rel=1e-9, abs=10 * error)


@pytest.mark.parametrize("rate", [1e-2, 1.0, 30.0, 1e3, 2e4])
def test_differences_follow_slow_and_fast_motions(rate: float) -> None:
    """No aliasing: a coarse step would show a fast sine as a slow one."""
    for t in np.linspace(0.0, 7.0, 23):
        _, v, a, _ = differences(lambda s: math.sin(rate * s + 0.4), float(t))
        # noise 4 eps / h^2 at the finest step, 3e-6 s, and below; rate t eps in the argument
        assert v / rate == pytest.approx(math.cos(rate * t + 0.4), abs=1e-8)
        assert a / rate**2 == pytest.approx(-math.sin(rate * t + 0.4), abs=1e-6)


def motion(m: pt.Mechanism) -> Motion:
    """The function behind the only drive."""
    (drive,) = m._description.drives.values()
    call = drive.motion.call  # type: ignore[union-attr]
    assert isinstance(call, Motion)
    return call


def test_drive_is_differentiated_exactly() -> None:
    m = pendulum()
    m.add_drive("A", lambda t: 0.1 * np.sin(5 * t))
    x, v, a = motion(m)(0.7)
    assert (x, v, a) == pytest.approx((0.1 * math.sin(3.5), 0.5 * math.cos(3.5), -2.5 * math.sin(3.5)), rel=1e-15)
    assert motion(m).notes == [] and m.compile().notes == pendulum().compile().notes


def test_drive_by_differences_says_so() -> None:
    m = pendulum()
    m.add_drive("A", lambda t: 0.1 * math.sin(5 * t))
    assert motion(m)(0.7) == pytest.approx((0.1 * math.sin(3.5), 0.5 * math.cos(3.5), -2.5 * math.sin(3.5)), rel=1e-9)
    (note,) = (note for note in m.compile().notes if "differences" in note)
    assert '"drive of A"' in note and "np.sin" in note


def test_drive_does_not_remember_earlier_calls() -> None:
    """A branch that cannot be differentiated exactly changes nothing where the other branch is taken."""
    m = pendulum()
    m.add_drive("A", lambda t: np.sin(t) if t < 1 else math.sin(t))
    before = motion(m)(0.5)
    motion(m)(2.0)
    assert motion(m)(0.5) == before
    assert len(motion(m).notes) == 1


def test_given_derivatives_are_used_and_checked() -> None:
    m = pendulum()
    m.add_drive("A", lambda t: t**2, velocity=lambda t: 2 * t, acceleration=lambda t: 2.0)
    assert motion(m)(3.0) == (9.0, 6.0, 2.0)
    other = pendulum()
    with pytest.raises(DescriptionError, match="has the slope"):
        other.add_drive("A", lambda t: t**2, velocity=lambda t: t)
    with pytest.raises(DescriptionError, match="has the slope"):
        other.add_drive("A", lambda t: t**2, velocity=lambda t: 2 * t, acceleration=lambda t: t)
    with pytest.raises(DescriptionError, match="has the slope"):
        other.add_drive("A", lambda t: t**2, acceleration=lambda t: t)
    assert other.drives == ()


def test_a_function_that_ends_where_it_is_asked_needs_derivatives() -> None:
    m = pendulum()
    with pytest.raises(EvaluationError, match="slightly before or after") as caught:
        m.add_drive("A", lambda t: math.sqrt(t) ** 5)
    assert isinstance(caught.value.__cause__, ValueError)
    m.add_drive("A", lambda t: math.sqrt(t) ** 5, lambda t: 2.5 * math.sqrt(t) ** 3, lambda t: 3.75 * math.sqrt(t))
    assert motion(m)(4.0) == (32.0, 20.0, 7.5)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"position": 0.0, "velocity": lambda t: 0.0}, DescriptionError, "only where position is a function"),
        ({"position": lambda t: t, "velocity": 1.0}, DescriptionError, "must be a function of t"),
        ({"position": ([0, 1, 2], [0, 1, 2])}, DescriptionError, "at least 4 times"),
        ({"position": lambda t: 0.0, "coordinate": 1}, DescriptionError, "an integer, 0"),
        ({"position": lambda t: "high"}, EvaluationError, "one number, not str"),
        ({"position": lambda t: np.zeros(3)}, EvaluationError, "shape (3,)"),
    ],
)
def test_bad_drive_is_refused(arguments: dict[str, Any], error: type[Exception], words: str) -> None:
    m = pendulum()
    with pytest.raises(error) as caught:
        m.add_drive("A", **arguments)
    assert words in str(caught.value)
    assert m.drives == ()


def test_a_coordinate_is_driven_once() -> None:
    m = pendulum()
    m.add_drive("A", 0.5)
    with pytest.raises(DescriptionError, match='driven already by "drive of A"'):
        m.add_drive("A", 0.6)


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
        ({"targets": {"A": "far"}}, ArgumentError, "made of numbers"),
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
        ({"duration": "long"}, "must be a number"),
        ({"rtol": -1e-8}, "rtol"),
        ({"atol": 0.0}, "atol"),
        ({"method": "dop583"}, "'dop853'"),
        ({"formulation": "lagrange"}, "'projective', 'multipliers'"),
        ({"coordinates": "joint"}, "'relative', 'absolute'"),
        ({"correction": "Partition"}, "'partition'"),
        ({"exchange": 0.5}, "1.25 is usual"),
        ({"events": (len,)}, "does not offer events"),
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


# ---------------------------------------------------------------- systems


def circle(**change: Any) -> pt.System:
    """A point of 1 kg on the unit circle under gravity."""
    functions: dict[str, Any] = {
        "mass": np.eye(2),
        "forces": lambda t, q, v: np.array([0.0, -9.81]),
        "constraints": lambda t, q: [0.5 * (q @ q - 1)],
        "jacobian": lambda t, q: [q],
        "bias": lambda t, q, v: [v @ v],
        "names": ["x", "y"],
    }
    return pt.System(n=2, **{**functions, **change})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": ["x"]}, "2 different texts"),
        ({"names": ["x", "x"]}, "2 different texts"),
        ({"jacobian": None}, "need their jacobian"),
        ({"bias": None}, "needs bias"),
        ({"mass": "M"}, "function or an array"),
    ],
)
def test_bad_system_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        circle(**change)
    assert words in str(caught.value)


@pytest.mark.parametrize("n", [0, -1, 2.0, True])
def test_bad_size_of_a_system_is_refused(n: Any) -> None:
    with pytest.raises(DescriptionError, match="integer above zero"):
        pt.System(n, mass=np.eye(2), forces=(0.0, 0.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass": lambda t, q: np.eye(3)}, "mass at t = 0 s returned shape (3, 3) instead of (2, 2)"),
        ({"mass": lambda t, q: [[1.0, 0.5], [0.0, 1.0]]}, "not symmetric"),
        ({"forces": lambda t, q, v: [0.0, math.nan]}, "forces at t = 0 s returned nan at index [1]"),
        ({"forces": lambda t, q, v: "down"}, "no array of numbers"),
        ({"jacobian": lambda t, q: q}, "jacobian at t = 0 s returned shape (2,)"),
        ({"constraints": lambda t, q: [0.0, 0.0]}, "at most 1"),
        ({"bias": lambda t, q, v: [0.0, 0.0]}, "instead of (1,)"),
    ],
)
def test_functions_of_a_system_are_checked(change: dict[str, Any], words: str) -> None:
    with pytest.raises(EvaluationError) as caught:
        pt.simulate(circle(**change), 1.0, [1.0, 0.0], [0.0, 0.0])
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"q0": [1.0]}, "flat array of 2 numbers: x, y"),
        ({"v0": [0.0, math.inf]}, "finite"),
        ({"q0": None}, "q0 is missing"),
        ({"initial": pt.State(0.0, [1.0, 0.0], [0.0, 0.0])}, "not both"),
        ({"method": "euler"}, "method"),
    ],
)
def test_bad_start_of_a_system(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        pt.simulate(circle(), 1.0, **{"q0": [1.0, 0.0], "v0": [0.0, 0.0], **arguments})
    assert words in str(caught.value)


def test_a_mechanism_is_no_system() -> None:
    with pytest.raises(ArgumentError, match="call its own method"):
        pt.simulate(pendulum(), 1.0)  # type: ignore[arg-type]


# ---------------------------------------------------------------- partition


@pytest.mark.parametrize(
    ("mass", "jacobian", "words"),
    [
        (np.ones((2, 3)), np.ones((1, 2)), "square"),
        (np.eye(2), np.ones((1, 3)), "3 columns for 2 coordinates"),
        (np.eye(2), np.ones(2), "matrix"),
        ([[1.0, 0.5], [0.0, 1.0]], np.ones((1, 2)), "M[0, 1] and M[1, 0]"),
        ([[1.0, math.nan], [0.0, 1.0]], np.ones((1, 2)), "finite"),
    ],
)
def test_bad_matrices_for_the_criterion(mass: Any, jacobian: Any, words: str) -> None:
    for function in (pt.partition.measure, pt.partition.choose):
        with pytest.raises(ArgumentError) as caught:
            function(mass, jacobian)
        assert words in str(caught.value)


def test_bad_options_of_the_choice() -> None:
    with pytest.raises(ArgumentError, match="for ever"):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), threshold=0.5)
    with pytest.raises(ArgumentError, match="2 positive"):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), weights=[1.0, 0.0])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"selection": "largest"}, "no selection 'largest'"),
        ({"selection": "persistence"}, "needs a history"),
        ({"selection": "greedy", "threshold": 1.5}, "makes no exchanges"),
        ({"selection": "determinant", "weights": [1.0, 2.0]}, "no use for weights"),
        ({"selection": "greedy", "fixed": [0]}, "no rule"),
        ({"fixed": [0], "weights": [1.0, 2.0]}, "no weights"),
        ({"fixed": [2]}, "from 0 to 1"),
        ({"fixed": [0, 0]}, "different indices"),
        ({"fixed": ["x"]}, "must be indices"),
        ({"fixed": [0, 1]}, "1 degrees of freedom"),
    ],
)
def test_contradictory_options_of_the_choice(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        pt.partition.choose(np.eye(2), np.ones((1, 2)), **options)


def test_rules_of_choice() -> None:
    # a pendulum at 45 degrees beside three coupled carts: one by one, the two largest measures are both the pendulum's
    d = math.sqrt(0.5)
    rows = [[d, -d, 0, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 1, -1]]
    for rule in ("collective", "greedy", "normalised-determinant", "determinant", "complete-pivoting"):
        choice = pt.partition.choose(np.eye(5), rows, selection=rule)
        assert len(set(choice.independent) & {0, 1}) == 1
        assert choice.sigma == pytest.approx(1 / math.sqrt(3))
        assert np.abs(choice.D @ np.transpose(rows)).max() < 1e-14
    with pytest.raises(pt.errors.SingularityError, match=r"coordinate 0, coordinate 1.*C_D is singular"):
        pt.partition.choose(np.eye(5), rows, selection="individual")
    with pytest.raises(ArgumentError, match="coordinate 0, coordinate 1 cannot be independent"):
        pt.partition.choose(np.eye(5), rows, fixed=[0, 1])
    assert pt.partition.choose(np.eye(5), rows, fixed=[4, 1]).independent.tolist() == [1, 4]


# ---------------------------------------------------------------- units and errors


def test_units() -> None:
    assert pt.units.convert(1.0, "inch", "m") == pt.units.inch == 0.0254
    assert pt.units.convert([60.0], "rpm", "rad/s").tolist() == pytest.approx([2 * math.pi])
    with pytest.raises(ArgumentError, match="unit of length and 'deg' one of angle"):
        pt.units.convert(1.0, "mm", "deg")
    with pytest.raises(ArgumentError, match="did you mean 'inch'"):
        pt.units.convert(1.0, "inches", "mm")


@pytest.mark.parametrize("name", [name for name in pt.errors.__all__ if name != "PartitaError"])
def test_errors_carry_their_fields_through_pickle(name: str) -> None:
    import pickle

    error = getattr(pt.errors, name)("a sentence", t=1.5, path="x")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == "a sentence"
    assert again.t == 1.5 and again.path == "x" and again.fields == error.fields
    assert isinstance(error, pt.errors.PartitaError) and len(type(error).__mro__) > 5
