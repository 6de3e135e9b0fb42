"""Forces and drives: those that the builder accepts, the messages of those that it refuses, their description."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builder_parts import pendulum
from scipy.interpolate import CubicSpline, PchipInterpolator

import partita as pt
from partita.builder.motion import Motion, differences
from partita.builder.taylor import Jet
from partita.errors import (
    DescriptionError,
    EvaluationError,
    UnknownNameError,
)

INERTIA = (1.0, 1.0, 1.0)


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
    (lambda m: m.add_spring("S", "rod", (1, 0, 0), "rod", (0, 0, 0), stiffness=1.0), "no effect"),
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
    assert not m.forces


def test_torsion_spring_needs_an_angle() -> None:
    m = pendulum()
    m.add_body("ball", mass=1.0, inertia=INERTIA)
    m.add_spherical("S", m.ground, "ball", point=(0, 0, 0))
    m.add_torque("S", 1.0, coordinate=2)
    with pytest.raises(DescriptionError, match="no translation or angle"):
        m.add_torsion_spring("S", stiffness=1.0)


def test_names_of_unnamed_forces_differ() -> None:
    m = pendulum()
    assert [m.add_torque("A", 1.0).name for _ in range(3)] == ["torque on A", "torque on A 2", "torque on A 3"]
    assert m.add_torque("A", 1.0, name="motor").name == "motor"
    with pytest.raises(DescriptionError, match="already a force"):
        m.add_torque("A", 1.0, name="motor")


def test_tables_become_the_cubics_of_scipy() -> None:
    """PCHIP by default, not-a-knot on request. Evaluated from the description as the core does it."""
    times, values = np.array([0.0, 0.5, 1.5, 2.0, 4.0]), np.array([0.0, 1.0, -1.0, 2.0, 2.0])
    m = pendulum()
    m.add_torque("A", (times, values))
    m.add_torque("A", (times, values), interpolation="spline")
    m.add_drive("A", (times, values))
    other = pendulum()
    other.add_drive("A", (times, values), interpolation="spline")
    monotone, spline = PchipInterpolator(times, values), CubicSpline(times, values)
    for table, curve in (
        (forces(m)[0]["value"]["table"], monotone),
        (forces(m)[1]["value"]["table"], spline),
        (m.to_spec()["drives"][0]["motion"]["table"], monotone),
        (other.to_spec()["drives"][0]["motion"]["table"], spline),
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
    with pytest.raises(DescriptionError, match="derivative of the function"):
        other.add_drive("A", lambda t: t**2, velocity=lambda t: t)
    with pytest.raises(DescriptionError, match="derivative of the function"):
        other.add_drive("A", lambda t: t**2, velocity=lambda t: 2 * t, acceleration=lambda t: t)
    with pytest.raises(DescriptionError, match="derivative of the function"):
        other.add_drive("A", lambda t: t**2, acceleration=lambda t: t)
    assert not other.drives


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
        ({"position": 0.0, "velocity": lambda t: 0.0}, DescriptionError, "only if position is a function"),
        ({"position": lambda t: t, "velocity": 1.0}, DescriptionError, "must be a function of t"),
        ({"position": ([0], [0])}, DescriptionError, "at least two times"),
        ({}, DescriptionError, "no motion is prescribed"),
        ({"velocity": 1.0, "acceleration": 1.0}, DescriptionError, "not both"),
        ({"velocity": 1.0, "rate": 1.0}, DescriptionError, "the initial rate of a prescribed acceleration"),
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
    assert not m.drives


def test_a_coordinate_is_driven_once() -> None:
    m = pendulum()
    m.add_drive("A", 0.5)
    with pytest.raises(DescriptionError, match='already driven by "drive of A"'):
        m.add_drive("A", 0.6)
