"""One drawing of a mechanism, for the core and for the independent program."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import partita as pt

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)


def unit(v: ArrayLike) -> Array:
    v = np.array(v, dtype=float)
    return v / np.linalg.norm(v)


def across(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to an axis."""
    u = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    return u, np.cross(axis, u)


@dataclass(frozen=True)
class Body:
    """Axes along the world's as drawn, origin in the centre of mass."""

    name: str
    mass: float
    inertia: Array
    position: Array


@dataclass(frozen=True)
class Joint:
    """`point` and `axis` are those on the parent as drawn, `point_off` and `axis_off` what the child's differ by."""

    kind: str
    name: str
    parent: str
    child: str
    point: Array
    axis: Array = field(default_factory=lambda: Z.copy())
    axis2: Array = field(default_factory=lambda: X.copy())
    end: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    point_off: Array = field(default_factory=lambda: np.zeros(3))
    axis_off: Array = field(default_factory=lambda: np.zeros(3))

    def point_on_child(self) -> Array:
        return self.point + self.point_off

    def axis_on_child(self) -> Array:
        return unit(self.axis + self.axis_off)


class Drawing:
    """Bodies, joints, constant forces."""

    def __init__(self, gravity: ArrayLike = (0.0, -9.81, 0.0)) -> None:
        self.gravity = np.array(gravity, dtype=float)
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.forces: list[tuple[str, Array, Array]] = []

    def body(self, name: str, position: ArrayLike, mass: float = 1.0, inertia: ArrayLike = (0.1, 0.1, 0.1)) -> str:
        self.bodies.append(Body(name, mass, np.array(inertia, dtype=float), np.array(position, dtype=float)))
        return name

    def rod(self, name: str, start: ArrayLike, end: ArrayLike, mass: float = 1.0) -> str:
        """Its inertia is the same about all axes, so that a spin has some."""
        start, end = np.array(start, dtype=float), np.array(end, dtype=float)
        size = max(float(np.linalg.norm(end - start)), 0.1)
        return self.body(name, 0.5 * (start + end), mass, (0.1 * mass * size**2,) * 3)

    def joint(
        self, kind: str, name: str, parent: str, child: str, point: ArrayLike, axis: ArrayLike = Z, **more: Any
    ) -> None:
        more = {key: np.array(value, dtype=float) if key != "length" else value for key, value in more.items()}
        if "axis2" in more:
            more["axis2"] = unit(more["axis2"])
        self.joints.append(Joint(kind, name, parent, child, np.array(point, dtype=float), unit(axis), **more))

    def hinge(self, name: str, parent: str, child: str, point: ArrayLike, axis: ArrayLike = Z) -> None:
        self.joint("revolute", name, parent, child, point, axis)

    def bar(self, name: str, parent: str, start: ArrayLike, child: str, end: ArrayLike) -> None:
        """A distance between points drawn in the world."""
        length = float(np.linalg.norm(np.array(end, dtype=float) - np.array(start, dtype=float)))
        self.joint("distance", name, parent, child, start, end=end, length=length)

    def force(self, body: str, force: ArrayLike, point: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Along fixed axes of the world, on a point in body axes."""
        self.forces.append((body, np.array(force, dtype=float), np.array(point, dtype=float)))

    def copy(self) -> Drawing:
        other = Drawing(self.gravity)
        other.bodies, other.joints, other.forces = list(self.bodies), list(self.joints), list(self.forces)
        return other

    def changed(self, name: str, **more: Any) -> Drawing:
        """The same with one joint said otherwise."""
        other = self.copy()
        other.joints = [replace(j, **more) if j.name == name else j for j in self.joints]
        return other

    def size(self) -> float:
        points = np.array([j.point for j in self.joints] + [b.position for b in self.bodies])
        return float(np.ptp(points, axis=0).max())

    def extent(self) -> float:
        """The size over the least distance between joints of one body: what a point's error comes to as an angle."""
        least = self.size()
        for b in self.bodies:
            points = [j.point for j in self.joints if b.name in (j.parent, j.child)]
            apart = [float(np.linalg.norm(p - q)) for i, p in enumerate(points) for q in points[:i]]
            least = min([least, *(x for x in apart if x > 1e-3 * self.size())])
        return self.size() / least

    def off(self, rng: Any, e: float, which: str | None = None) -> Drawing:
        """Every joint's point (in parts of the size) and axis off by up to `e`; or the axis of one alone, by `e`."""
        other, size = self.copy(), self.size()
        other.joints = []
        for j in self.joints:
            if which is None:
                at, turn = size * e * rng.uniform(-1, 1, 3) / np.sqrt(3), e * rng.uniform(-1, 1, 3) / np.sqrt(3)
                j = replace(j, point_off=at, axis_off=turn)
            elif j.name == which:
                j = replace(j, axis_off=e * across(j.axis)[0])
            other.joints.append(j)
        return other

    def mechanism(self, name: str) -> pt.Mechanism:
        """For the core."""
        m = pt.Mechanism(name, gravity=tuple(self.gravity))
        reference = {"ground": np.zeros(3)}
        for b in self.bodies:
            reference[b.name] = b.position
            m.add_body(b.name, mass=b.mass, inertia=tuple(b.inertia), position=b.position)
        for j in self.joints:
            parent = m.ground if j.parent == "ground" else j.parent
            child = m.ground if j.child == "ground" else j.child
            own: dict[str, Any] = {}
            if np.any(j.point_off):
                own["child_point"] = j.point_on_child()
            if np.any(j.axis_off) and j.kind not in ("spherical", "universal"):
                own["child_axis"] = j.axis_on_child()
            match j.kind:
                case "distance":
                    start, end = j.point - reference[j.parent], j.end - reference[j.child]
                    m.add_distance(j.name, parent, start, child, end, length=j.length)
                case "rolling":
                    centre = j.point - reference[j.child]
                    m.add_rolling(j.name, child, j.length, center=centre, axis=j.axis, normal=(0, 0, 1))
                case "sliding":
                    centre = j.point - reference[j.child]
                    m.add_rolling(j.name, child, j.length, center=centre, ball=True, normal=(0, 0, 1), slips=True)
                case "spherical":
                    m.add_spherical(j.name, parent, child, point=j.point, **own)
                case "universal":
                    m.add_universal(j.name, parent, child, point=j.point, axis1=j.axis, axis2=j.axis2, **own)
                case "revolute":
                    m.add_revolute(j.name, parent, child, point=j.point, axis=j.axis, **own)
                case "prismatic":
                    m.add_prismatic(j.name, parent, child, point=j.point, axis=j.axis, **own)
                case "cylindrical":
                    m.add_cylindrical(j.name, parent, child, point=j.point, axis=j.axis, **own)
                case _:
                    raise ValueError(f'the core draws no "{j.kind}"')
        for i, (body, force, point) in enumerate(self.forces):
            m.add_force(body, tuple(force), point=tuple(point), name=f"force {i}")
        return m
