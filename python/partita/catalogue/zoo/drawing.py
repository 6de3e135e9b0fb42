"""Drawing by ruler and compass. Points of a plane are complex numbers; the functions for links also work in space."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...builder import Body
from ...mechanism import Mechanism
from ...products import matmul, norm
from ..dyad import arms

FloatArray = NDArray[np.float64]
THICKNESS = 0.05
"""Radius of gyration of a link about its own axis, in parts of its length: no link is without inertia."""


def polar(length: float, degrees: float) -> complex:
    """The point at a distance and an angle from the origin."""
    return cmath.rect(length, math.radians(degrees))


def meet(p: complex, q: complex, to_p: float, to_q: float, side: int = 1) -> complex:
    """Where circles about p and q meet: to the left of the line from p to q (side 1) or to its right (-1)."""
    offset = q - p
    along = (abs(offset) ** 2 + to_p**2 - to_q**2) / (2.0 * abs(offset))
    return p + offset / abs(offset) * complex(along, side * math.sqrt(to_p**2 - along**2))


def beside(p: complex, q: complex, along: float, across: float = 0.0) -> complex:
    """The point at `along` on the way from p to q, and `across` to its left."""
    return p + (q - p) / abs(q - p) * complex(along, across)


def in_space(z: complex, height: float = 0.0) -> FloatArray:
    """A point of the plane, in space."""
    return np.array([z.real, z.imag, height])


def unit(vector: ArrayLike) -> FloatArray:
    """The direction of a vector."""
    a = np.asarray(vector, dtype=float)
    return np.asarray(a / norm(a))


def around(axis: ArrayLike, degrees: float) -> FloatArray:
    """The rotation about an axis."""
    k = unit(axis)
    cross = np.array([[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]])
    a = math.radians(degrees)
    return np.asarray(np.eye(3) + math.sin(a) * cross + matmul((1.0 - math.cos(a)) * cross, cross))


def link(m: Mechanism, name: str, *points: ArrayLike, density: float = 1.0) -> Body:
    """A link of arms from the first point to the others [m], of `density` [kg/m], axes parallel to the world."""
    first, *others = (np.asarray(point, dtype=float) for point in points)
    ends = [point - first for point in others]
    mass, com, inertia = arms(*ends)
    thick = mass * (THICKNESS * max(float(norm(end)) for end in ends)) ** 2
    return m.add_body(
        name, mass=density * mass, inertia=density * (inertia + thick * np.eye(3)), com=com, position=first
    )


def block(m: Mechanism, name: str, at: ArrayLike, mass: float, width: float) -> Body:
    """A cube about a point."""
    moment = mass * width**2 / 6.0
    return m.add_body(name, mass=mass, inertia=(moment, moment, moment), position=at)


def disc(m: Mechanism, name: str, at: ArrayLike, axis: ArrayLike, radius: float, mass: float) -> Body:
    """A round disc about a point, a fifth of its radius thick; the z axis of its frame is its own."""
    z = unit(axis)
    x = unit(np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z))
    polar_moment, width = 0.5 * mass * radius**2, 0.2 * radius
    across = 0.5 * polar_moment + mass * width**2 / 12.0
    orientation = np.column_stack([x, np.cross(z, x), z])
    return m.add_body(name, mass=mass, inertia=(across, across, polar_moment), position=at, orientation=orientation)


@dataclass(frozen=True)
class Slide:
    """A block at a point that slides along a direction on the ground or on a link."""

    at: str
    along: complex
    on: str = "ground"
    mass: float = 0.5


def linkage(
    m: Mechanism,
    points: Mapping[str, complex],
    links: Mapping[str, str],
    ground: str = "",
    slides: Mapping[str, Slide] | None = None,
    turned: FloatArray | None = None,
) -> None:
    """Links of a plane, each a list of points, pinned together wherever they share one; `ground` lists the fixed ones.

    The first of the bodies at a point is pinned to the others by P, P2, P3. The slide of the block S is the joint "S
    slide". `turned` rotates the plane in space.
    """
    turn = np.eye(3) if turned is None else turned
    positions = {name: matmul(turn, in_space(z)) for name, z in points.items()}
    width = 0.1 * max(abs(p - q) for p in points.values() for q in points.values())
    holders: dict[str, list[Body | str]] = {name: [] for name in points}
    for name in ground.split():
        holders[name].append("ground")
    for name, held in links.items():
        body = link(m, name, *(positions[p] for p in held.split()))
        for p in held.split():
            holders[p].append(body)
    for name, slide in (slides or {}).items():
        body = block(m, name, positions[slide.at], slide.mass, width)
        holders[slide.at].append(body)
    for name, (first, *others) in holders.items():
        for i, other in enumerate(others):
            pin = name if i == 0 else f"{name}{i + 1}"
            m.add_revolute(pin, first, other, point=positions[name], axis=matmul(turn, in_space(0, 1.0)))
    for name, slide in (slides or {}).items():
        m.add_prismatic(
            f"{name} slide", slide.on, name, point=positions[slide.at], axis=matmul(turn, in_space(slide.along))
        )
