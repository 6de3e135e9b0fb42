"""Mechanisms that several cases draw."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

import partita as pt

Array = NDArray[np.float64]
G = 9.81

EVERY = ["projective", "fixed", "zero-eigenvalue", "svd", "qr", "gram-schmidt"]
EVERY += ["wehage-haug", "explicit-closing", "tangent-space", "multipliers", "range-space", "proximal"]
"""Formulations that close the loops."""

ABSOLUTE = [name for name in EVERY if name != "explicit-closing"]
"""Those that know absolute coordinates."""


def pendulum(length: float = 1.0, mass: float = 1.0, gravity: float = G, drawn: float = 0.0) -> pt.Mechanism:
    """A uniform rod on a hinge at the origin, drawn at the angle `drawn` from the way down; gravity along -y."""
    m = pt.Mechanism("pendulum", gravity=(0, -gravity, 0))
    end = (length * np.sin(drawn), -length * np.cos(drawn), 0)
    rod = m.add_rod("rod", start=(0, 0, 0), end=end, mass=mass)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    return m


def swing(t: Array, amplitude: float, length: float = 1.0, gravity: float = G) -> Array:
    """Angle of a uniform rod let go at rest at `amplitude`, by elliptic functions."""
    w, k = np.sqrt(1.5 * gravity / length), np.sin(0.5 * amplitude)
    sn = ellipj(ellipk(k**2) + w * t, k**2)[0]
    return 2.0 * np.arcsin(k * sn)


def turning(t: Array, rate: float, length: float = 1.0, gravity: float = G) -> Array:
    """Angle of a uniform rod that goes over the top, with `rate` at the bottom at t = 0, by elliptic functions."""
    m = 6.0 * gravity / length / rate**2
    assert m < 1.0
    return 2.0 * ellipj(0.5 * rate * t, m)[3]


def four_bar(
    points: Sequence[Sequence[float]], gravity: float = G, masses: Sequence[float] = (0.3, 0.5, 0.4)
) -> pt.Mechanism:
    """Crank AB, coupler BC, rocker DC in the plane."""
    a, b, c, d = [(*p, 0.0)[:3] for p in points]
    m = pt.Mechanism("four-bar", gravity=(0, -gravity, 0))
    crank = m.add_rod("crank", start=a, end=b, mass=masses[0])
    coupler = m.add_rod("coupler", start=b, end=c, mass=masses[1])
    rocker = m.add_rod("rocker", start=d, end=c, mass=masses[2])
    m.add_revolute("A", m.ground, crank, point=a)
    m.add_revolute("B", crank, coupler, point=b)
    m.add_revolute("C", coupler, rocker, point=c)
    m.add_revolute("D", m.ground, rocker, point=d)
    return m


GENERAL = ((0.0, 0.0), (0.5, 1.0), (2.5, 1.6), (2.2, 0.0))
"""A, B, C, D of a four-bar without anything special."""


def parallelogram(angle: float = 1.0, crank: float = 0.5, gravity: float = 0.0) -> pt.Mechanism:
    """Ground and coupler 1, both cranks `crank` long, drawn at `angle`."""
    b = np.array([crank * np.cos(angle), crank * np.sin(angle)])
    return four_bar([(0, 0), tuple(b), (1 + b[0], b[1]), (1, 0)], gravity)


def slider_crank(crank: float = 0.1, rod: float = 0.3, gravity: float = G, rod_mass: float = 0.8) -> pt.Mechanism:
    """Crank drawn along x, slider on the axis of x."""
    m = pt.Mechanism("slider-crank", gravity=(0, -gravity, 0))
    one = m.add_rod("crank", start=(0, 0, 0), end=(crank, 0, 0), mass=0.5)
    two = m.add_rod("rod", start=(crank, 0, 0), end=(crank + rod, 0, 0), mass=rod_mass)
    piston = m.add_body("piston", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=(crank + rod, 0, 0))
    m.add_revolute("main", m.ground, one, point=(0, 0, 0))
    m.add_revolute("big end", one, two, point=(crank, 0, 0))
    m.add_revolute("small end", two, piston, point=(crank + rod, 0, 0))
    m.add_prismatic("bore", m.ground, piston, axis=(1, 0, 0))
    return m


def drawn_out(flywheel: float = 0.0, gravity: float = G) -> pt.Mechanism:
    """Crank 0.08 m with a flywheel [kg m^2], rod 0.25 m, slider 0.8 kg, drawn out; gravity along -y."""
    m = pt.Mechanism("slider-crank", gravity=(0, -gravity, 0))
    crank = m.add_body("crank", mass=0.5, com=(0.02, 0, 0), inertia=(0.2, 0.2, 0.0012 + flywheel))
    rod = m.add_body("rod", mass=0.6, com=(0.08, 0, 0), inertia=(2e-3, 2e-3, 0.0035), position=(0.08, 0, 0))
    slider = m.add_body("slider", mass=0.8, inertia=(1e-3, 1e-3, 1e-3), position=(0.33, 0, 0))
    m.add_revolute("O", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("P", crank, rod, point=(0.08, 0, 0))
    m.add_revolute("W", rod, slider, point=(0.33, 0, 0))
    m.add_prismatic("S", m.ground, slider, point=(0.33, 0, 0), axis=(1, 0, 0))
    return m


def stroke(angle: Array, crank: float = 0.1, rod: float = 0.3) -> Array:
    """Where the slider is."""
    return crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2)


def bushing_wishbone(stiffness: float = 1e8, damping: float = 1e4) -> pt.Mechanism:
    """Two arms on bushings [N/m, N s/m], an upright between them, a strut and a tyre."""
    m = pt.Mechanism("wishbone", gravity=(0, -9.81, 0))
    lower = m.add_rod("lower", start=(0.35, 0.25, 0), end=(0.75, 0.22, 0), mass=3.0)
    upper = m.add_rod("upper", start=(0.42, 0.50, 0), end=(0.72, 0.52, 0), mass=2.0)
    upright = m.add_body("upright", mass=35.0, inertia=(0.8, 0.8, 0.8), position=(0.78, 0.33, 0))
    m.add_planar("plane", m.ground, lower, (0.35, 0.25, 0), normal=(0, 0, 1))
    m.add_revolute("B", lower, upright, point=(0.75, 0.22, 0))
    m.add_revolute("C", upright, upper, point=(0.72, 0.52, 0))
    stiff, damped = (stiffness, stiffness, 0, 0, 0, 0), (damping, damping, 0, 0, 0, 0)
    m.add_bushing("front", m.ground, lower, (0.35, 0.25, 0), stiffness=stiff, damping=damped)
    m.add_bushing("rear", m.ground, upper, (0.42, 0.50, 0), stiffness=stiff, damping=damped)
    seat = (0.75 * math.hypot(0.4, 0.03), 0, 0)
    m.add_spring("strut", m.ground, (0.45, 0.8, 0), lower, seat, stiffness=60e3, damping=3e3, length=0.64)
    m.add_spring("tyre", m.ground, (0.78, -0.47, 0), upright, (0, -0.3, 0), stiffness=200e3, damping=200.0, length=0.52)
    return m
