"""Mechanisms for the tests of forces, and their energy balance."""

from typing import Any

import numpy as np

import partita as pt

G = 9.81
TIGHT: dict[str, Any] = {"rtol": 1e-10}


def balanced(run: Any, rtol: float = 1e-10) -> None:
    """Kinetic and potential energy less work stay what they were, within a hundred tolerances of the largest."""
    energy = run.energy
    size = np.max(np.abs(energy.kinetic)) + np.max(np.abs(energy.potential))
    drift = energy.total - energy.work - (energy.total[0] - energy.work[0])
    assert run.success, run.message
    assert np.max(np.abs(drift)) < 100 * rtol * size, np.max(np.abs(drift)) / size


def slider(gravity: Any = None, mass: float = 2.0) -> pt.Mechanism:
    """A block on a rail along x."""
    m = pt.Mechanism("slider", gravity=gravity)
    block = m.add_body("block", mass=mass, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    return m


def everything(scale: float = 1.0) -> pt.Mechanism:
    """All forces on one chain that moves out of every plane; lengths times `scale`, masses and times as they are.

    Smooth where they first touch, so that runs agree within their tolerance and not within that of a corner.
    """
    m = pt.Mechanism("everything", gravity=np.array([0.5, -G, 1.0]) * scale)
    s = scale
    m.add_body("a", mass=1.0, inertia=np.array([0.1, 0.2, 0.2]) * s**2, com=(0.5 * s, 0, 0))
    m.add_body("b", mass=2.0, inertia=np.array([0.2, 0.3, 0.3]) * s**2, com=(0.3 * s, 0, 0), position=(s, 0, 0))
    m.add_cylindrical("A", m.ground, "a", point=(0, 0, 0), axis=(0, 0.2, 1))
    m.add_universal("B", "a", "b", point=(s, 0, 0), axis1=(0, 0, 1), axis2=(0, 1, 0))
    k = np.diag([20.0, 20, 20, 3 * s**2, 3 * s**2, 3 * s**2])
    m.add_bushing("bushing", m.ground, "b", (1.2 * s, 0, 0), stiffness=k, damping=0.02 * k)
    m.add_friction("B", 0.4 * s**2, static=0.6 * s**2, stick_velocity=0.5, coordinate=1)
    m.add_friction("A", 0.4 * s, stick_velocity=0.5 * s, coordinate=0)
    m.add_stop("A", lower=-0.2 * s, upper=0.1 * s, stiffness=3e4 / s**2, damping=0.5 / s, exponent=3.0)
    m.add_stop("B", lower=-0.3, upper=0.3, stiffness=100.0 * s**2, exponent=3.0)
    rough = {"friction": 0.3, "static_friction": 0.4, "stick_velocity": 0.5 * s}
    floor = {"normal": (0, 1, 0), "stiffness": 1e3 / s**2, "exponent": 3.0, "damping": 0.3 / s}
    m.add_contact("floor", "b", (0.6 * s, 0, 0), m.ground, (0, -0.6 * s, 0), radius1=0.5 * s, **floor, **rough)
    m.add_tyre(
        "tyre", "a", center=(0.5 * s, 0, 0), axis=(0, 0, 1), radius=0.6 * s, normal=(0, 1, 0.1), point=(0, -0.2 * s, 0),
        stiffness=100.0, damping=0.1 / s, friction=0.5, longitudinal=5.0 * s, lateral=4.0 * s, slow_speed=0.3 * s,
    )  # fmt: skip
    m.add_force_law(
        "drag", lambda t, b: (-0.1 * b.velocity, -0.05 * s**2 * b.angular_velocity), sees=["b"], on=[("b", (0, 0, 0))]
    )
    return m
