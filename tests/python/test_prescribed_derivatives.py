"""Rates and accelerations of prescribed motions: exact derivatives of what functions compute, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import partita as pt
from partita.builder.checks import Element
from partita.builder.poses import Pose
from partita.builder.taylor import Jet

# function, first and second derivative; products, quotients, powers, roots and compositions
MOTIONS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any], Callable[[Any], Any]]] = {
    "product": (
        lambda t: t * t * np.sin(3.0 * t),
        lambda t: 2.0 * t * np.sin(3.0 * t) + 3.0 * t * t * np.cos(3.0 * t),
        lambda t: (2.0 - 9.0 * t * t) * np.sin(3.0 * t) + 12.0 * t * np.cos(3.0 * t),
    ),
    "quotient": (
        lambda t: t / (1.0 + t * t),
        lambda t: (1.0 - t * t) / (1.0 + t * t) ** 2,
        lambda t: 2.0 * t * (t * t - 3.0) / (1.0 + t * t) ** 3,
    ),
    "power": (
        lambda t: (2.0 + t) ** 2.5 - 2.0**2.5,
        lambda t: 2.5 * (2.0 + t) ** 1.5,
        lambda t: 3.75 * (2.0 + t) ** 0.5,
    ),
    "composition": (
        lambda t: np.exp(np.sin(t)) - 1.0,
        lambda t: np.cos(t) * np.exp(np.sin(t)),
        lambda t: (np.cos(t) ** 2 - np.sin(t)) * np.exp(np.sin(t)),
    ),
    "root": (
        lambda t: np.sqrt(4.0 + t * t) - 2.0,
        lambda t: t / np.sqrt(4.0 + t * t),
        lambda t: 4.0 / np.sqrt(4.0 + t * t) ** 3,
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_number_carries_its_derivatives(name: str) -> None:
    function, rate, second = MOTIONS[name]
    for t in (0.1, 0.7, 1.3):
        jet = function(Jet(t, 1.0, 0.0))
        assert (jet.x, jet.d1, jet.d2) == pytest.approx((function(t), rate(t), second(t)), rel=1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_driven_shaft_moves_by_the_derivatives(name: str) -> None:
    position, rate, second = MOTIONS[name]
    m = pt.Mechanism("shaft")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_drive("A", position)
    run = m.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 5))
    assert run.success and not any("differences" in note for note in run.notes)
    found = run.joint("A")
    for mine, theirs in ((found.position, position), (found.velocity, rate), (found.acceleration, second)):
        np.testing.assert_allclose(mine[:, 0], theirs(run.t), atol=1e-9)


AXIS = np.array([1.0, 2.0, -2.0]) / 3.0
ORIENTATIONS: dict[str, Callable[[Any], Any]] = {
    "quaternion": lambda t: (np.cos(0.5 * t * t), *(np.sin(0.5 * t * t) * AXIS)),
    "rotation vector": lambda t: tuple(t * t * AXIS),
    "matrix": lambda t: turned(t * t),
    "Rotation": lambda t: Rotation.from_rotvec(float(t) ** 2 * AXIS),
}


def turned(angle: Any) -> list[list[Any]]:
    """About AXIS, of numbers that carry derivatives too."""
    c, s, (x, y, z) = np.cos(angle), np.sin(angle), AXIS
    k, n = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)), np.outer(AXIS, AXIS)
    return [[c * (i == j) + s * k[i][j] + (1.0 - c) * n[i, j] for j in range(3)] for i in range(3)]


@pytest.mark.parametrize("form", ORIENTATIONS)
def test_a_pose_carries_its_spin(form: str) -> None:
    """By t^2 about one axis: 2 t and 2 along it, in the axes that turn too."""
    orientation = ORIENTATIONS[form]
    pose = Pose(Element("drive", "D"), lambda t: ((t**3, 0.0, 0.0), orientation(t)), 3, None)
    slides, turned_by = pose.at(0.6)
    assert slides[0] == pytest.approx((0.216, 1.08, 3.6), rel=1e-7)
    assert turned_by[9:12] == pytest.approx(1.2 * AXIS, rel=1e-7) and turned_by[12:] == pytest.approx(
        2.0 * AXIS, rel=1e-5
    )


@pytest.mark.parametrize("form", ORIENTATIONS)
def test_a_prescribed_pose_turns_at_the_rate_of_its_orientation(form: str) -> None:
    """By t^2 about one axis: the spin is 2 t, its derivative 2, along that axis."""
    m = pt.Mechanism("disc")
    disc = m.add_body("disc", mass=1.0, inertia=(1, 2, 3))
    orientation = ORIENTATIONS[form]
    m.add_drive(disc, pose=lambda t: ((t**3, 0.0, 0.0), orientation(t)))
    m.add_sensor("alpha", disc, "angular_acceleration")
    run = m.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 5))
    assert run.success, run.message
    body, exact = run.body("disc"), form != "Rotation"
    np.testing.assert_allclose(body.rotation, Rotation.from_rotvec(run.t[:, None] ** 2 * AXIS).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(body.angular_velocity, 2.0 * run.t[:, None] * AXIS, atol=1e-9 if exact else 1e-7)
    np.testing.assert_allclose(run.sensor("alpha").values, np.tile(2.0 * AXIS, (5, 1)), atol=1e-8 if exact else 1e-6)
    np.testing.assert_allclose(body.velocity[:, 0], 3.0 * run.t**2, atol=1e-9)
