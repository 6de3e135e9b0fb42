"""Force laws that are Python functions, and what forces refuse."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from force_mechanisms import G

import partita as pt
from partita.builder.laws import BodyView, JointView, PointView
from partita.errors import DescriptionError, EvaluationError, UnknownNameError


def linkage(planar: bool) -> pt.Mechanism:
    m = pt.Mechanism("linkage", gravity=(0, -G, 0))
    turn = math.atan2(0.2, 1.0)
    axes = [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
    m.add_body("a", mass=1.0, inertia=(0.02, 0.09, 0.09), com=(0.5, 0, 0), orientation=axes)
    m.add_body("b", mass=2.0, inertia=(0.2, 0.3, 0.3), com=(0.3, 0, 0), position=(1, 0.2, 0))
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0), axis=(0, 0, 1) if planar else (0, 1e-6, 1))
    m.add_revolute("B", "a", "b", point=(1, 0.2, 0), axis=(0, 0, 1) if planar else (0.3, 0, 1))
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("planar", [True, False])
def test_a_law_that_says_what_a_spring_says_is_that_spring(planar: bool, coordinates: str) -> None:
    k, c, length = 30.0, 0.7, 0.4
    ends = ((0.8, 0.0, 0.1), (0.2, -0.3, 0.1))

    def pull(t: float, p: PointView, r: PointView) -> Any:
        d = r.position - p.position
        n = np.linalg.norm(d)
        f = (k * (n - length) + c * d @ (r.velocity - p.velocity) / n) / n * d
        return f, -f

    m, law = linkage(planar), linkage(planar)
    m.add_spring("S", "a", ends[0], "b", ends[1], stiffness=k, damping=c, length=length)
    law.add_force_law("S", pull, sees=[("a", ends[0]), ("b", ends[1])], on=[("a", ends[0]), ("b", ends[1])])
    x, y = m.compile(coordinates=coordinates), law.compile(coordinates=coordinates)
    rng = np.random.default_rng(1)
    v = rng.normal(size=len(x.velocity_names))
    q = m.assemble(coordinates=coordinates).q if coordinates == "absolute" else rng.normal(size=len(x.names))
    np.testing.assert_allclose(y.forces(q, v), x.forces(q, v), rtol=1e-12, atol=1e-12)
    start = m.assemble(rates={"A": 1.0, "B": -2.0})
    spring = m.simulate(0.5, initial=start, coordinates=coordinates, t_eval=[0.0, 0.5], rtol=1e-9)
    other = law.simulate(0.5, initial=start, coordinates=coordinates, t_eval=[0.0, 0.5], rtol=1e-9)
    np.testing.assert_allclose(other.q, spring.q, atol=1e-9)
    np.testing.assert_allclose(other.joint("B").force, spring.joint("B").force, rtol=1e-7, atol=1e-7)
    total = spring.energy.total - spring.energy.work
    gained = other.energy.total - other.energy.work
    np.testing.assert_allclose(gained - gained[0], total - total[0], atol=1e-7)


def test_a_law_sees_bodies_and_joints_and_gives_moments() -> None:
    """A rotary spring between the bodies, once by the joint and once by their axes."""
    seen: list[Any] = []

    def by_joint(t: float, joint: JointView, a: BodyView) -> Any:
        seen.append((joint, a))
        moment = -4.0 * joint.position - 0.3 * joint.rate
        return [((0, 0, 0), (0, 0, moment)), ((0, 0, 0), (0, 0, -moment))]

    m, law = linkage(True), linkage(True)
    m.add_torsion_spring("B", stiffness=4.0, damping=0.3)
    law.add_force_law("twist", by_joint, sees=["B", "a"], on=["b", "a"])
    q, v = [0.3, -0.8], [1.0, 2.0]
    np.testing.assert_allclose(law.compile().forces(q, v), m.compile().forces(q, v), rtol=1e-12)
    joint, a = seen[-1]
    assert (joint.position, joint.rate) == (-0.8, 2.0)
    np.testing.assert_allclose(a.angular_velocity, (0, 0, 1.0))
    drawn = math.atan2(0.2, 1.0)
    np.testing.assert_allclose(a.rotation[:, 0], (math.cos(0.3 + drawn), math.sin(0.3 + drawn), 0), atol=1e-15)


def bad_law(function: Any = lambda t: (0, 0, 0), **given: Any) -> Callable[[pt.Mechanism], Any]:
    return lambda m: m.add_force_law("L", function, **{"on": ["a"], **given})


@pytest.mark.parametrize(
    ("add", "words"),
    [
        (lambda m: m.add_bushing("B", "a", "a", (0, 0, 0), stiffness=(1,) * 6), "two different bodies"),
        (lambda m: m.add_bushing("B", "a", "b", (0, 0, 0), stiffness=(1,) * 5), "six numbers or a 6x6"),
        (lambda m: m.add_friction("A", 1.0, stick_velocity=-1.0), "at least 0"),
        (lambda m: m.add_friction("A", -1.0, stick_velocity=1.0), "at least 0"),
        (lambda m: m.add_stop("A", stiffness=1.0), "neither a lower nor an upper"),
        (lambda m: m.add_stop("A", lower=1.0, upper=0.0, stiffness=1.0), "not below"),
        (lambda m: m.add_stop("A", lower=1.0, stiffness=1.0, exponent=0.5), "at least 1"),
        (lambda m: m.add_gas_spring("A", force=1.0, length=0.0), "greater than 0"),
        (lambda m: m.add_gas_spring("A", force=1.0, length=1.0, exponent=1.0), "greater than 1"),
        (lambda m: m.add_gas_spring("A", force=0.0, length=1.0), "never acts"),
        (lambda m: m.add_contact("C", "a", (0, 0, 0), "b", (0, 0, 0), radius1=1.0, stiffness=1.0), "one of the two"),
        (
            lambda m: m.add_contact(
                "C", "a", (0, 0, 0), "b", (0, 0, 0), radius1=1.0, radius2=1.0, stiffness=1.0, friction=0.1
            ),
            "stick_velocity",
        ),
        (
            lambda m: m.add_tyre("T", "a", center=(0, 0, 0), axis=(0, 0, 0), radius=1, normal=(0, 1, 0), stiffness=1),
            "no direction",
        ),
        (bad_law(on=[]), "acts on nothing"),
        (bad_law(on=["ground"]), "does not move"),
        (bad_law(function=3), "must be a function"),
    ],
)
def test_what_cannot_be_is_refused(add: Callable[[pt.Mechanism], Any], words: str) -> None:
    m = linkage(True)
    with pytest.raises(DescriptionError) as caught:
        add(m)
    assert words in str(caught.value)
    assert not m.forces


def test_what_a_law_asks_for_must_exist_and_what_it_returns_must_be_wrenches() -> None:
    with pytest.raises(UnknownNameError, match='no body or joint "C"'):
        bad_law(sees=["C"])(linkage(True))
    for answer, words in (((1, 2), "three numbers"), ((math.nan, 0, 0), "nan"), (None, "three numbers")):
        m = linkage(True)
        m.add_force_law("L", lambda t, x=answer: x, on=["a"])
        with pytest.raises(EvaluationError, match=words):
            m.compile().forces([0.0, 0.0], [0.0, 0.0])
