"""Stiff mechanisms: a wishbone on bushings, a rotor shaft, a valve train, an elastic slider-crank, van der Pol.

Each is drawn by a function without arguments, moves by itself from `Stiff.start`, and is still moving at the end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import partita as pt

MU = 1000.0
"""Of van der Pol's equation."""


@dataclass(frozen=True)
class Stiff:
    """A stiff mechanism and its run; positions and rates of joints at the start."""

    title: str
    draw: Callable[[], pt.Mechanism]
    duration: float
    start: dict[str, Any] = field(default_factory=dict)
    rates: dict[str, Any] = field(default_factory=dict)

    def ready(self) -> tuple[pt.Mechanism, pt.State]:
        """The mechanism and its initial state."""
        m = self.draw()
        return m, m.assemble(self.start, rates=self.rates)


def wishbone(stiffness: float, damping: float) -> pt.Mechanism:
    """A double wishbone with rubber in its inner pivots: strut, tyre and upright come to rest on them."""
    m = pt.Mechanism("wishbone")
    inner, ball, upper, pivot, centre = (
        np.array((x, y, 0.0)) for x, y in ((0.35, 0.25), (0.75, 0.22), (0.72, 0.52), (0.42, 0.50), (0.78, 0.33))
    )

    def arm(name: str, start: np.ndarray, end: np.ndarray, mass: float) -> Any:
        about = mass * float(np.sum((end - start) ** 2)) / 12.0
        inertia = (about / 2.0, about / 2.0, about)
        return m.add_body(name, mass=mass, inertia=inertia, position=(start + end) / 2.0)

    low, high = arm("lower arm", inner, ball, 3.0), arm("upper arm", pivot, upper, 2.0)
    upright = m.add_body("upright", mass=35.0, inertia=(0.4, 0.4, 0.8), position=centre)
    m.add_planar("plane", m.ground, low, point=(inner + ball) / 2.0)
    m.add_revolute("lower ball", low, upright, point=ball)
    m.add_revolute("upper ball", upright, high, point=upper)
    rubber: dict[str, Any] = {
        "stiffness": (stiffness, stiffness, 0.0, 0.0, 0.0, 0.0),
        "damping": (damping, damping, 0.0, 0.0, 0.0, 0.0),
    }
    m.add_bushing("lower bushing", m.ground, low, inner, **rubber)
    m.add_bushing("upper bushing", m.ground, high, pivot, **rubber)
    strut, tyre = low.world((0.65, 0.2275, 0.0)), upright.world((0.78, 0.03, 0.0))
    m.add_spring("strut", m.ground, (0.45, 0.80, 0.0), low, strut, stiffness=60e3, damping=3e3, length=0.64)
    m.add_spring("tyre", m.ground, (0.78, -0.47, 0.0), upright, tyre, stiffness=200e3, damping=200.0, length=0.52)
    return m


def rotor_shaft() -> pt.Mechanism:
    """An unbalanced rotor between two bearing housings, each on a stiff oil film with damping."""
    m = pt.Mechanism("rotor shaft")
    half, light = 0.25, (4e-4, 4e-4, 4e-4)
    front = m.add_body("front housing", mass=0.5, inertia=light, position=(-half, 0.0, 0.0))
    rotor = m.add_body("rotor", mass=12.0, inertia=(0.12, 0.2, 0.2), com=(0.02, 1e-3, 0.0))
    rear = m.add_body("rear housing", mass=0.5, inertia=light, position=(half, 0.0, 0.0))
    m.add_free("held by oil", m.ground, front, point=(-half, 0.0, 0.0))
    m.add_revolute("front bearing", front, rotor, point=(-half, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    m.add_revolute("rear bearing", rotor, rear, point=(half, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    film = np.array((1e9, 1e9, 1e9, 1e4, 1e4, 1e4))
    for name, housing, x in (("front oil", front, -half), ("rear oil", rear, half)):
        m.add_bushing(name, m.ground, housing, (x, 0.0, 0.0), stiffness=film, damping=5e-4 * film)
    return m


def valve_train() -> pt.Mechanism:
    """An eccentric on a flywheel lifts a rocker, which opens a valve against its spring; oil damps both contacts."""
    m = pt.Mechanism("valve train")
    cam = m.add_body("cam", mass=4.0, inertia=(0.02, 0.02, 0.02))
    rocker = m.add_body("rocker", mass=0.25, inertia=(2e-4, 2e-4, 2e-4), position=(0.03, 0.05, 0.0))
    valve = m.add_body("valve", mass=0.12, inertia=(1e-5, 1e-5, 1e-5), position=(0.07, 0.0, 0.0))
    m.add_revolute("shaft", m.ground, cam, point=(0.0, 0.0, 0.0))
    m.add_revolute("pivot", m.ground, rocker, point=(0.03, 0.05, 0.0))
    m.add_prismatic("guide", m.ground, valve, point=(0.07, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    oil: dict[str, Any] = {"stiffness": 1e9, "exponent": 1.0, "damping": 100.0}
    lobe, roller = 0.03, 0.01
    m.add_contact(
        "cam on roller",
        cam,
        cam.world((0.005, 0.0, 0.0)),
        rocker,
        rocker.world((0.0, math.sqrt((lobe + roller) ** 2 - 0.005**2) - 1e-6, 0.0)),
        radius1=lobe,
        radius2=roller,
        **oil,
    )
    m.add_contact(
        "rocker on valve",
        rocker,
        rocker.world((0.07, 0.045, 0.0)),
        valve,
        valve.world((0.07, 0.035 + 1e-6, 0.0)),
        radius1=0.01,
        normal=(0.0, 1.0, 0.0),
        **oil,
    )
    m.add_torsion_spring("guide", stiffness=40e3, damping=20.0, angle=0.025)
    return m


def elastic_slider_crank(segments: int = 4) -> pt.Mechanism:
    """A slider-crank whose rod is a steel bar of 20 mm in segments, coupled by its stiffness and damping."""
    m = pt.Mechanism("elastic slider-crank")
    crank_pin, wrist = np.array((0.1, 0.0, 0.0)), np.array((0.5, 0.0, 0.0))
    crank = m.add_body("crank", mass=5.0, inertia=(0.02, 0.02, 0.02))
    slider = m.add_body("slider", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=wrist)
    m.add_revolute("shaft", m.ground, crank, point=(0.0, 0.0, 0.0))
    m.add_prismatic("guide", m.ground, slider, point=wrist, axis=(1.0, 0.0, 0.0))
    ends = [crank_pin + (wrist - crank_pin) * i / segments for i in range(segments + 1)]
    each = float(np.linalg.norm(ends[1] - ends[0]))
    area, inertia, young, density, relaxation = 3.14e-4, 7.85e-9, 2.1e11, 7850.0, 1e-4
    along, across, bending = young * area / each, 12.0 * young * inertia / each**3, young * inertia / each
    stiffness = np.array((along, across, 0.0, 0.0, 0.0, bending))
    before = crank
    for i in range(segments):
        part = m.add_rod(f"rod {i}", ends[i], ends[i + 1], mass=density * area * each)
        if i == 0:
            m.add_revolute("crank pin", crank, part, point=crank_pin)
        else:
            m.add_planar(f"cut {i}", before, part, point=ends[i])
            m.add_bushing(f"bar {i}", before, part, ends[i], stiffness=stiffness, damping=relaxation * stiffness)
        before = part
    m.add_revolute("wrist pin", before, slider, point=wrist)
    return m


def van_der_pol() -> pt.Mechanism:
    """x'' = mu (1 - x^2) x' - x, as a slider with a force law."""
    m = pt.Mechanism("van der Pol", gravity=(0.0, 0.0, 0.0))
    body = m.add_body("slider", mass=1.0, inertia=(1.0, 1.0, 1.0))
    joint = m.add_prismatic("x", m.ground, body, point=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0))
    m.add_force_law(
        "law", lambda t, x: (MU * (1.0 - x.position**2) * x.rate - x.position, 0.0, 0.0), on=[body], sees=[joint]
    )
    return m


PROBLEMS = (
    Stiff("wishbone, 1e8 N/m", partial(wishbone, 1e8, 1e4), 0.2),
    Stiff("wishbone, 1e10 N/m", partial(wishbone, 1e10, 1e6), 0.2),
    Stiff("rotor shaft", rotor_shaft, 0.1, rates={"front bearing": 300.0, "rear bearing": -300.0}),
    Stiff("valve train", valve_train, 0.05, rates={"shaft": 300.0}),
    Stiff("elastic slider-crank", elastic_slider_crank, 0.1, rates={"shaft": 60.0}),
    Stiff("van der Pol, mu = 1000", van_der_pol, 2.0 * MU, start={"x": 2.0}, rates={"x": 0.0}),
)
