"""Mechanisms whose numbers are identified, and logs of them: planar linkages with the reference pins of their links."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import partita as pt

Array = NDArray[np.float64]
Points = dict[str, tuple[Array, Array]]
Pins = dict[str, tuple[str, str, Array]]
ORIGIN = np.zeros(3)


def along(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def meeting(p: Array, near: float, q: Array, far: float) -> Array:
    """The point at these distances from p and q, left of the line from p to q."""
    line = q - p
    length = float(np.linalg.norm(line))
    angle = np.arctan2(line[1], line[0]) + np.arccos((near**2 + length**2 - far**2) / (2.0 * near * length))
    return p + near * along(angle)


def linked(name: str, rods: Points, pins: Pins, gravity: Any = "-y") -> pt.Mechanism:
    m = pt.Mechanism(name, gravity=gravity)
    bodies: dict[str, Any] = {"ground": m.ground}
    for rod, (start, end) in rods.items():
        bodies[rod] = m.add_rod(rod, start=tuple(start), end=tuple(end), mass=1.0)
    for pin, (parent, child, point) in pins.items():
        m.add_revolute(pin, bodies[parent], bodies[child], point=tuple(point))
    return m


def four_bar(crank: float = 0.3, coupler: float = 0.9, rocker: float = 0.7, ground: float = 1.0, gravity: Any = "-y"):
    b, d = crank * along(1.0), np.array([ground, 0.0, 0.0])
    c = meeting(b, coupler, d, rocker)
    rods = {"crank": (ORIGIN, b), "coupler": (b, c), "rocker": (d, c)}
    pins = {
        "A": ("ground", "crank", ORIGIN),
        "B": ("crank", "coupler", b),
        "C": ("coupler", "rocker", c),
        "D": ("ground", "rocker", d),
    }
    return linked("four-bar", rods, pins, gravity)


def five_bar() -> pt.Mechanism:
    e = np.array([0.5, 0.0, 0.0])
    b, d = 0.4 * along(2.1), e + 0.45 * along(1.0)
    c = meeting(b, 0.7, d, 0.75)
    rods = {"left": (ORIGIN, b), "upper": (b, c), "other": (d, c), "right": (e, d)}
    pins = {
        "A": ("ground", "left", ORIGIN),
        "B": ("left", "upper", b),
        "C": ("upper", "other", c),
        "D": ("other", "right", d),
        "E": ("ground", "right", e),
    }
    return linked("five-bar", rods, pins)


def slider_crank() -> pt.Mechanism:
    b = 0.08 * along(1.0)
    p = np.array([b[0] + np.sqrt(0.25**2 - b[1] ** 2), 0.0, 0.0])
    pins = {"A": ("ground", "crank", ORIGIN), "B": ("crank", "rod", b)}
    m = linked("slider-crank", {"crank": (ORIGIN, b), "rod": (b, p)}, pins)
    slider = m.add_body("slider", mass=1.0, inertia=(0.1, 0.1, 0.1), position=tuple(p))
    m.add_revolute("C", "rod", slider, point=tuple(p))
    m.add_prismatic("S", m.ground, slider, axis=(1, 0, 0), point=tuple(p))
    return m


def sines(t: Array, sizes: list[float], frequencies: list[float], phases: list[float]) -> tuple[Array, Array, Array]:
    """A sum of sines [Hz] and its derivatives."""
    w = 2.0 * np.pi * np.array(frequencies)[:, None]
    a, x = np.array(sizes)[:, None], w * t + np.array(phases)[:, None]
    return (a * np.sin(x)).sum(0), (a * w * np.cos(x)).sum(0), (-a * w * w * np.sin(x)).sum(0)


def log_of(
    m: pt.Mechanism,
    t: Array,
    courses: dict[str, tuple[Array, Array, Array]],
    parameters: Any = None,
    forces: tuple[str, ...] = (),
) -> dict[str, Array]:
    """Exact columns of a motion of joints: their levels, the efforts in them, and reactions of joints."""
    levels = [{name: course[i] for name, course in courses.items()} for i in range(3)]
    k = m.kinematics(*levels, parameters=parameters)
    assert k.reached.all()
    motion = SimpleNamespace(t=t, q=k.q, v=k.v, vdot=k.vdot, names=k.names)
    d = m.inverse_dynamics(motion, list(courses), parameters=parameters)
    data = {"t": t}
    for name, course in courses.items():
        for word, values in zip(("position", "velocity", "acceleration"), course, strict=True):
            data[f"joint.{name}.{word}"] = values
        data[f"effort.{name}"] = d.effort(name)
    for joint in forces:
        for i, axis in enumerate("xyz"):
            data[f"joint.{joint}.force.{axis}"] = d.joint(joint).force[:, i]
    return data


def other_numbers(m: pt.Mechanism, seed: int) -> dict[str, Any]:
    """Other masses, centres of mass and inertias of planar rods."""
    rng = np.random.default_rng(seed)
    found: dict[str, Any] = {}
    for body in m.bodies:
        own = m.compile().parameters
        com, moment = np.array(own[f"{body}.com"]), own[f"{body}.inertia"][8] * rng.uniform(0.8, 1.4)
        found[f"{body}.mass"] = own[f"{body}.mass"] * rng.uniform(0.7, 1.3)
        side = 0.1 * np.linalg.norm(com) * rng.uniform(-1.0, 1.0)
        found[f"{body}.com"] = (com * rng.uniform(0.8, 1.2) + [0.0, side, 0.0]).tolist()
        found[f"{body}.inertia"] = np.diag([0.6 * moment, 0.6 * moment, moment]).ravel().tolist()
    return found
