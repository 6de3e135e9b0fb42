"""Masses of USD: what a body does not give follows from the volume of its shapes and their density.

A mass of a body is that of all its shapes; a shape's own mass or density precedes that of its body, and its material
comes last. A shape may be scaled unevenly: its second moments follow from the map of its points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..products import det, matmul
from .robot import Array, inverse
from .usd_stage import Prim

DENSITY = 1000.0
"""Density [kg/m^3] of a shape where nothing gives one, which is USD's."""
_FLAT = 1e-9
"""A mesh of less volume is empty. Scale: cube of its size. Reason: seven digits of coordinates."""
APPROXIMATED = ("convexDecomposition", "meshSimplification", "sdf")
"""Approximations of a mesh that follow it: its own volume is what they approach."""
_GIVE = "give physics:mass, physics:centerOfMass and physics:diagonalInertia of its body"


@dataclass(frozen=True)
class Solid:
    """A shape of density 1: its volume, the centre of it, and its second moments about that centre."""

    volume: float
    center: Array
    moments: Array

    def mapped(self, linear: Array, shift: Array) -> Solid:
        """The same after a linear map of its points, and a shift."""
        factor = abs(float(det(linear)))
        moments = matmul(matmul(factor * linear, self.moments), linear.T)
        return Solid(factor * self.volume, matmul(linear, self.center) + shift, moments)


def solid(prim: Prim) -> Solid | None:
    """A shape in its own axes; None where it has no volume."""
    zero = np.zeros(3)
    if prim.tag == "Cube":
        edge = prim.real("size", 2.0)
        return Solid(edge**3, zero, edge**5 / 12.0 * np.eye(3))
    if prim.tag == "Mesh":
        return _mesh(prim)
    if prim.tag == "Plane":
        return None
    r = prim.real("radius", 0.5 if prim.tag == "Capsule" else 1.0)
    ball = 4.0 / 3.0 * np.pi * r**3
    if prim.tag == "Sphere":
        return Solid(ball, zero, ball * r**2 / 5.0 * np.eye(3))
    h = prim.real("height", 1.0 if prim.tag == "Capsule" else 2.0)
    axis = axis_of(prim, "Z")
    volume = np.pi * r**2 * h
    center, along, across = 0.0, volume * h**2 / 12.0, volume * r**2 / 4.0
    if prim.tag == "Cone":
        volume /= 3.0
        center, along, across = -0.25 * h, 3.0 / 80.0 * volume * h**2, 3.0 / 20.0 * volume * r**2
    elif prim.tag == "Capsule":
        along += ball * (r**2 / 5.0 + 3.0 / 8.0 * r * h + h**2 / 4.0)
        across, volume = across + ball * r**2 / 5.0, volume + ball
    moments = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    return Solid(volume, center * axis, moments)


def axis_of(prim: Prim, otherwise: str, key: str = "axis") -> Array:
    """The axis that a token names."""
    word = str(prim.value(key) or otherwise)
    if word not in ("X", "Y", "Z"):
        prim.fail(f'has the {key} "{word}"; it is X, Y or Z')
    return np.eye(3)["XYZ".index(word)]


def _mesh(prim: Prim) -> Solid | None:
    """The volume within a mesh, or within its convex hull."""
    form = str(prim.value("physics:approximation") or "none")
    try:
        points = np.array(prim.value("points"), dtype=float).reshape(-1, 3)
        counts = np.array(prim.value("faceVertexCounts"), dtype=int).reshape(-1)
        corners = np.array(prim.value("faceVertexIndices"), dtype=int).reshape(-1)
    except (TypeError, ValueError):
        return None
    good = counts.size > 0 and int(counts.sum()) == corners.size and bool(np.all(counts >= 0))
    if not good or np.any(corners < 0) or np.any(corners >= len(points)) or not np.all(np.isfinite(points)):
        prim.fail("is not a mesh: its faces do not fit its points, or these are not finite")
    if form == "boundingCube":
        return _box(points)
    if form == "convexHull":
        triangles = _hull(points)
    elif form in ("none", *APPROXIMATED):
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        faces = [corners[i : i + n] for i, n in zip(starts, counts, strict=True)]
        triangles = np.array([(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)], dtype=int)
        if not _closed(points, triangles):
            prim.fail(f"is open, or its faces do not all look outwards, so it has no volume: {_GIVE}")
    else:
        prim.fail(f'has the approximation "{form}", whose size each program chooses: {_GIVE}')
    return None if triangles is None or not len(triangles) else _within(points, triangles)


def _box(points: Array) -> Solid | None:
    """The box around points, along their axes."""
    low, sizes = points.min(axis=0), np.ptp(points, axis=0)
    volume = float(np.prod(sizes))
    return Solid(volume, low + 0.5 * sizes, volume / 12.0 * np.diag(sizes**2)) if volume > 0.0 else None


def _closed(points: Array, triangles: Array) -> bool:
    """Whether each edge is passed in both directions the same number of times. Points in one place are one."""
    _, indices = np.unique(points, axis=0, return_inverse=True)
    found = indices.reshape(-1)[triangles]
    edges = np.concatenate([found[:, [0, 1]], found[:, [1, 2]], found[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    passed = np.zeros(len(edges))
    np.add.at(passed, which.reshape(-1), np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
    return not np.any(passed)


def _hull(points: Array) -> Array | None:
    """Triangles around the convex hull of points, all seen from outside the same way; None where it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    found: Array = hull.simplices.copy()
    a, b, c = (points[found[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    found[inwards] = found[inwards][:, ::-1]
    return found


def _within(points: Array, triangles: Array) -> Solid | None:
    """Volume and moments by tetrahedra from one point."""
    origin = points.mean(axis=0)
    a, b, c = (points[triangles[:, i]] - origin for i in range(3))
    parts = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(parts.sum())
    size = float(np.ptp(points, axis=0).max())
    if abs(volume) <= _FLAT * size**3:
        return None
    first = np.einsum("i,ij->j", parts, a + b + c) / 4.0
    total = a + b + c
    square = sum(np.einsum("i,ij,ik->jk", parts, x, x) for x in (a, b, c, total)) / 20.0
    center = first / volume
    moments = square - volume * np.outer(center, center)
    sign = np.sign(volume)
    return Solid(abs(volume), center + origin, sign * moments)


@dataclass(frozen=True)
class Part:
    """A shape of a body: its mass, the centre of it and its inertia about that, in the frame of the body."""

    mass: float
    com: Array
    inertia: Array


def part(prim: Prim, frame: Array, length: float, density: float, mass: float) -> Part | None:
    """A shape with its mass, in the frame (world, SI) of its body; None where it has no volume."""
    found = solid(prim)
    if found is None or found.volume <= 0.0:
        return None
    into = inverse(frame)
    linear = matmul(into[:3, :3], length * prim.world[:3, :3])
    shift = matmul(into[:3, :3], length * prim.world[:3, 3]) + into[:3, 3]
    here = found.mapped(linear, shift)
    if here.volume <= 0.0:
        return None
    weight = mass if mass > 0.0 else density * here.volume
    moments = weight / here.volume * here.moments
    return Part(weight, here.center, np.trace(moments) * np.eye(3) - moments)


def together(parts: list[Part]) -> Part:
    """All parts as one."""
    mass = sum(one.mass for one in parts)
    com = sum((one.mass * one.com for one in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for one in parts:
        inertia = inertia + about(one.inertia, one.mass, one.com - com)
    return Part(mass, com, inertia)


def about(inertia: Array, mass: float, arm: Array) -> Array:
    """An inertia about the centre of mass, about a point at this arm from it."""
    return np.asarray(inertia + mass * (matmul(arm, arm) * np.eye(3) - np.outer(arm, arm)))
