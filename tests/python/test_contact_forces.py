"""Contacts and tyres, each against a closed form."""

import math
from typing import Any

import numpy as np
import pytest
from force_mechanisms import TIGHT, G, balanced
from scipy.integrate import quad
from scipy.optimize import brentq

import partita as pt

# ---------------------------------------------------------------- contact


def ball(gravity: Any = (0, 0, -G), **law: Any) -> pt.Mechanism:
    m = pt.Mechanism("ball", gravity=gravity)
    m.add_body("ball", mass=0.5, inertia=(2e-4, 2e-4, 2e-4), position=(0, 0, 0.2))
    m.add_contact("floor", "ball", (0, 0, 0), m.ground, (0, 0, 0), radius1=0.05, normal=(0, 0, 2), **law)
    return m


def test_a_sphere_rests_at_the_depth_of_hertz() -> None:
    """N = k d^1.5: d = (m g / k)^(2/3); damped at rest."""
    m = ball(stiffness=1e4, damping=2.0)
    run = m.simulate(6.0, rtol=1e-8)
    assert run.body("ball").position[-1, 2] == pytest.approx(0.05 - (0.5 * G / 1e4) ** (2 / 3), abs=1e-7)
    balanced(run, 1e-8)


def test_an_elastic_sphere_bounces_to_its_height_and_a_damped_one_loses_what_the_law_takes() -> None:
    m = ball(stiffness=1e5)
    run = m.simulate(1.2, **TIGHT)
    balanced(run)
    assert np.max(run.body("ball").position[run.t > 0.3, 2]) == pytest.approx(0.2, abs=1e-5)
    # v dv = -(k/m) d^1.5 (1 + c v) dd: v - ln(1 + c v)/c is the same at the first touch and the last
    c, v0 = 0.3, 1.7
    m = ball(gravity=None, stiffness=1e6, damping=c)
    v = np.zeros(6)
    v[2] = -v0
    run = m.simulate(0.3, initial=pt.State(0.0, m.assemble().q, v), **TIGHT)
    balanced(run)
    out = brentq(lambda u: v0 - math.log1p(c * v0) / c + u + math.log1p(-c * u) / c, 1e-3, v0)
    assert run.body("ball").velocity[-1, 2] == pytest.approx(out, abs=1e-8)
    assert run.energy.work[-1] == pytest.approx(0.25 * (out**2 - v0**2), abs=1e-8)


def test_a_sphere_that_slides_begins_to_roll_at_five_sevenths() -> None:
    """v = 5/7 v0 for a solid sphere, whatever the friction; axes off the world's by a tilt of everything."""
    mass, radius, k = 0.5, 0.05, 1e6
    inertia = 0.4 * mass * radius**2
    m = pt.Mechanism("roll", gravity=(0, 0, -G))
    depth = (mass * G / k) ** (2 / 3)
    m.add_body("ball", mass=mass, inertia=(inertia,) * 3, position=(0, 0, radius - depth))
    floor = {"normal": (0, 0, 1), "stiffness": k, "friction": 0.4, "stick_velocity": 1e-3}
    m.add_contact("floor", "ball", (0, 0, 0), m.ground, (0, 0, 0), radius1=radius, **floor)
    v = np.zeros(6)
    v[0] = 1.0
    run = m.simulate(0.6, initial=pt.State(0.0, m.assemble().q, v), rtol=1e-9)
    # the arm of friction is the radius less the depth: m v + I w / arm stays, v = w arm in the end
    arm = radius - depth
    assert run.body("ball").velocity[-1, 0] == pytest.approx(1 / (1 + inertia / (mass * arm**2)), rel=1e-5)
    balanced(run, 1e-9)


def test_two_spheres_exchange_their_speeds() -> None:
    m = pt.Mechanism("two", gravity=None)
    for name, x in (("a", 0.0), ("b", 0.3)):
        m.add_body(name, mass=0.2, inertia=(1e-4,) * 3, position=(x, 0, 0))
    m.add_contact("hit", "a", (0, 0, 0), "b", (0, 0, 0), radius1=0.05, radius2=0.1, stiffness=1e7)
    v = np.zeros(12)
    v[0] = 2.0
    run = m.simulate(0.2, initial=pt.State(0.0, m.assemble().q, v), **TIGHT)
    assert run.body("a").velocity[-1, 0] == pytest.approx(0.0, abs=1e-8)
    assert run.body("b").velocity[-1, 0] == pytest.approx(2.0, abs=1e-8)
    balanced(run)


# ---------------------------------------------------------------- tyre


def wheel(slope: float, planar: bool, depth: float = 0.0, **law: Any) -> pt.Mechanism:
    """A wheel on a slope down along x, pressed in by `depth`."""
    normal = (math.sin(slope), math.cos(slope), 0)
    m = pt.Mechanism("wheel", gravity=(0, -G, 0))
    m.add_body("w", mass=20.0, inertia=(0.5, 0.5, 0.9), position=(0.3 - depth) * np.array(normal))
    if planar:
        m.add_planar("P", m.ground, "w")
    m.add_tyre("T", "w", center=(0, 0, 0), axis=(0, 0, 1), radius=0.3, normal=normal, **law)
    return m


def test_a_wheel_stands_on_its_static_deflection() -> None:
    m = wheel(0.0, True, stiffness=2e5, damping=20.0)
    run = m.simulate(8.0, rtol=1e-9)
    assert run.body("w").position[-1, 1] == pytest.approx(0.3 - 20 * G / 2e5, abs=1e-7)
    balanced(run, 1e-9)


@pytest.mark.parametrize("planar", [True, False])
def test_a_wheel_rolls_down_with_its_slip(planar: bool) -> None:
    """m v' = m g sin - F, I w' = F r with r the loaded radius; the slip e = (v - w r) / v with F = C e / sqrt(1 +
    (C e / mu N)^2) is constant, so (1 - e) v' = r w'. A small slow speed makes a difference at the start alone."""
    slope, stiff, friction, k = 0.5, 300.0, 0.6, 1e5
    load = 20 * G * math.cos(slope)
    radius, drive = 0.3 - load / k, G * math.sin(slope)
    law = {"stiffness": k, "friction": friction, "longitudinal": stiff, "slow_speed": 1e-3}
    m = wheel(slope, planar, depth=load / k, **law)

    def force(e: float) -> float:
        return stiff * e / math.sqrt(1 + (stiff * e / (friction * load)) ** 2)

    e = brentq(lambda e: (1 - e) * (drive - force(e) / 20) - force(e) * radius**2 / 0.9, 0, 1.0)
    run = m.simulate(1.0, rtol=1e-8, t_eval=[0.0, 0.5, 1.0])
    along = run.body("w").velocity @ (math.cos(slope), -math.sin(slope), 0)
    assert (along[2] - along[1]) / 0.5 == pytest.approx(drive - force(e) / 20, rel=1e-5)
    balanced(run, 1e-8)


def test_hertz_integrals_agree_with_quadrature() -> None:
    """The stored energy k d^2.5 / 2.5 is the work of k d^1.5."""
    m = ball(stiffness=1e4)
    model = m.compile()
    q = m.assemble().q
    q[2] = -0.16  # the centre at 0.04, one centimetre deep
    work = quad(lambda d: 1e4 * d**1.5, 0.0, 0.01)[0]
    run = m.simulate(1e-9, initial=pt.State(0.0, q, np.zeros(6)), t_eval=[0.0])
    assert run.energy.potential[0] == pytest.approx(work + 0.5 * G * 0.04, rel=1e-9)
    assert model.forces(q, np.zeros(6))[2] == pytest.approx(1e4 * 0.01**1.5 - 0.5 * G, rel=1e-12)
