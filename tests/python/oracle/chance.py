"""Mechanisms drawn by chance: a tree of bodies, wherever it has got to, and joints that close its loops there.

Families: in space; in a plane, with loads across it; with all axes through one point; with parallel axes in groups (the
chains of Sarrus' linkage); parallelograms with more rockers, bodies held by more joints than they need; many bodies
with loops of their own. Any of them may be driven, turned, shuffled and in other units.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .drawing import GROUND, Array, Body, Drawing, Drive, Joint, Load, Spring, Torque, Torsion, unit
from .maximal import about

KINDS = ("revolute", "prismatic", "cylindrical", "spherical", "universal", "planar", "fixed", "generic")
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def rotation(rng: Any) -> Array:
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def body(rng: Any, name: str, at: Array) -> Body:
    """A solid body near a point, its principal axes anywhere."""
    mass, edges = float(rng.uniform(0.3, 2.0)), rng.uniform(0.2, 0.8, size=3)
    own = rotation(rng)
    inertia = own @ np.diag(mass * (edges @ edges - edges**2) / 12.0) @ own.T
    return Body(name, mass, 0.5 * (inertia + inertia.T), 0.2 * rng.normal(size=3), np.array(at), rotation(rng))


def joint(rng: Any, name: str, kind: str, ends: tuple[str, str], point: Array, axes: Array) -> Joint:
    """A joint between two bodies, in either direction."""
    parent, child = ends if rng.random() < 0.5 else ends[::-1]
    free: tuple[str, ...] = ()
    if kind == "generic":
        free = tuple(d for d in DIRECTIONS if rng.random() < 0.4)
    if kind == "universal" and rng.random() < 0.7:
        axes = np.linalg.qr(axes)[0]
    if kind == "generic":
        axes = np.linalg.qr(axes)[0]
        axes = axes * np.linalg.det(axes)
    return Joint(name, kind, parent, child, np.array(point), np.array(axes), free)


def drawn(rng: Any, names: list[str], joints: list[Joint], words: str, points: dict[str, Array]) -> Drawing:
    bodies = [body(rng, name, points[name]) for name in names]
    gravity = rng.normal(size=3) if rng.random() < 0.8 else np.zeros(3)
    return Drawing(gravity, tuple(bodies), tuple(joints), words=words)


def in_space(rng: Any) -> Drawing:
    """Any joints between any bodies."""
    count = int(rng.integers(1, 6))
    names = [f"b{i}" for i in range(count)]
    points = {name: rng.normal(size=3) for name in names}
    joints = []
    few = rng.random() < 0.3  # axes from a few directions, so that some are parallel

    def axes() -> Array:
        return np.eye(3)[:, rng.permutation(3)] if few else rng.normal(size=(3, 3))

    for i, name in enumerate(names):
        inner = GROUND if i == 0 else [GROUND, *names][int(rng.integers(0, i + 1))]
        kind = str(rng.choice([*KINDS, "revolute", "revolute", "free"]))
        if rng.random() < 0.04:
            continue  # floats by itself
        joints.append(joint(rng, f"j{i}", kind, (inner, name), points[name] + 0.3 * rng.normal(size=3), axes()))
    for k in range(int(rng.integers(0, 3))):
        one, other = rng.choice([GROUND, *names], size=2, replace=False)
        kind = str(rng.choice(["spherical", "spherical", "planar", "cylindrical", "universal", "generic", "revolute"]))
        joints.append(joint(rng, f"c{k}", kind, (str(one), str(other)), rng.normal(size=3), axes()))
    return drawn(rng, names, joints, "in space", points)


def in_plane(rng: Any) -> Drawing:
    """Axes along z, slides across it; loads in all directions."""
    count = int(rng.integers(2, 7))
    names = [f"b{i}" for i in range(count)]
    points = {name: rng.normal(size=3) for name in names}
    joints = []

    def axes_of(kind: str) -> Array:
        if kind == "prismatic":
            angle = rng.uniform(0.0, 2.0 * np.pi)
            return np.column_stack([[np.cos(angle), np.sin(angle), 0.0], *np.eye(3)[1:]])
        if kind == "generic":
            return about(np.array([0.0, 0.0, 1.0]), rng.uniform(0.0, 6.0))
        return np.eye(3)[:, [2, 0, 1]] * rng.choice([-1.0, 1.0])

    def add(name: str, kind: str, ends: tuple[str, str]) -> None:
        made = joint(rng, name, kind, ends, rng.normal(size=3), axes_of(kind))
        if kind == "generic":
            free = tuple(d for d in ("x", "y", "rz") if rng.random() < 0.5)
            made = replace(made, axes=axes_of(kind), free=free)
        joints.append(made)

    for i, name in enumerate(names):
        inner = GROUND if i == 0 else [GROUND, *names][int(rng.integers(0, i + 1))]
        kinds = ["revolute", "revolute", "revolute", "prismatic", "planar", "fixed", "generic"]
        add(f"j{i}", str(rng.choice(kinds)), (inner, name))
    for k in range(int(rng.integers(0, 3))):
        one, other = rng.choice([GROUND, *names], size=2, replace=False)
        add(
            f"c{k}",
            str(rng.choice(["revolute", "revolute", "prismatic", "planar", "generic", "spherical"])),
            (one, other),
        )
    return drawn(rng, names, joints, "in a plane", points)


def about_a_point(rng: Any) -> Drawing:
    """A spherical linkage: a ring of revolutes whose axes meet; it moves with more conditions than it needs."""
    count = int(rng.integers(3, 6))
    names = [f"b{i}" for i in range(count)]
    meet = 0.3 * rng.normal(size=3)
    joints = []
    for i, ends in enumerate(zip([GROUND, *names], [*names, GROUND], strict=True)):
        axis = unit(rng.normal(size=3))
        point = meet + float(rng.uniform(0.5, 1.5)) * axis
        joints.append(joint(rng, f"j{i}", "revolute", ends, point, np.column_stack([axis, np.eye(3)[:, :2]])))
    points = {name: rng.normal(size=3) for name in names}
    return drawn(rng, names, joints, "about a point", points)


def by_parallel_axes(rng: Any) -> Drawing:
    """Sarrus: two chains of three parallel axes each; the platform moves along a straight line."""
    e1, e2 = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    names = ["a", "b", "platform", "c", "d"]
    points = {name: rng.normal(size=3) for name in names}
    chains = [((GROUND, "a"), ("a", "b"), ("b", "platform")), ((GROUND, "c"), ("c", "d"), ("d", "platform"))]
    joints = []
    for k, (chain, axis) in enumerate(zip(chains, (e1, e2), strict=True)):
        for i, ends in enumerate(chain):
            axes = np.column_stack([axis, np.eye(3)[:, :2]])
            joints.append(joint(rng, f"{'uv'[k]}{i}", "revolute", ends, rng.normal(size=3), axes))
    return drawn(rng, names, joints, "by parallel axes", points)


def parallelogram(rng: Any) -> Drawing:
    """Rockers, all alike, under one coupler; any but the first two are too many."""
    rockers = int(rng.integers(2, 5))
    arm = rng.normal(size=3) * [1.0, 1.0, 0.3]
    names = [*(f"r{i}" for i in range(rockers)), "coupler"]
    joints = []
    z = np.eye(3)[:, [2, 0, 1]]
    for i in range(rockers):
        foot = rng.normal(size=3)
        low, high = rng.choice(["revolute", "revolute", "spherical"]), "revolute"
        joints.append(joint(rng, f"A{i}", str(low) if i else "revolute", (GROUND, f"r{i}"), foot, z))
        joints.append(joint(rng, f"B{i}", high, (f"r{i}", "coupler"), foot + arm, z))
    points = {name: rng.normal(size=3) for name in names}
    return drawn(rng, names, joints, "parallelogram", points)


def held_twice(rng: Any) -> Drawing:
    """Doors: bodies on several hinges in one line, the frame itself on a joint of any kind."""
    names, joints = ["frame"], []
    kind = str(rng.choice(KINDS[:6]))
    joints.append(joint(rng, "base", kind, (GROUND, "frame"), rng.normal(size=3), rng.normal(size=(3, 3))))
    for d in range(int(rng.integers(1, 3))):
        name, axis, foot = f"door{d}", unit(rng.normal(size=3)), rng.normal(size=3)
        if rng.random() < 0.3:
            axis = np.eye(3)[int(rng.integers(3))]
        names.append(name)
        for h in range(int(rng.integers(2, 4))):
            kinds = ["revolute", "revolute", "cylindrical", "spherical"]
            axes = np.column_stack([axis, np.eye(3)[:, :2]])
            at = foot + float(rng.uniform(-1.0, 1.0)) * axis
            joints.append(joint(rng, f"h{d}{h}", str(rng.choice(kinds)), ("frame", name), at, axes))
    points = {name: rng.normal(size=3) for name in names}
    return drawn(rng, names, joints, "held twice", points)


def many(rng: Any) -> Drawing:
    """Bodies, parallelograms and loops in space, one carried by another: many degrees of freedom, loops that share
    nothing."""
    names: list[str] = []
    joints: list[Joint] = []
    is_planar = rng.random() < 0.4

    def new() -> str:
        names.append(f"b{len(names)}")
        return names[-1]

    def link(kind: str, ends: tuple[str, str], point: Array, axes: Array) -> None:
        joints.append(joint(rng, f"j{len(joints)}", kind, ends, point, axes))

    for _ in range(int(rng.integers(4, 9))):
        base = str(rng.choice([GROUND, *names]))
        axes = np.eye(3)[:, [2, 0, 1]] if is_planar else rng.normal(size=(3, 3))
        feet, arm = rng.normal(size=(2, 3)), rng.normal(size=3) * [1.0, 1.0, 0.3]
        what = rng.random()
        if what < 0.5:
            kinds = (
                ["revolute", "revolute", "prismatic"]
                if is_planar
                else ["revolute", "spherical", "universal", "cylindrical"]
            )
            kind = str(rng.choice(kinds))
            if is_planar and kind == "prismatic":
                axes = axes[:, [1, 2, 0]]
            link(kind, (base, new()), feet[0], axes)
        elif what < 0.8:
            one, other, coupler = new(), new(), new()
            link("revolute", (base, one), feet[0], axes)
            link("revolute", (base, other), feet[1], axes)
            link("revolute", (one, coupler), feet[0] + arm, axes)
            link("revolute", (other, coupler), feet[1] + arm, axes)
        else:
            crank, rod, rocker = new(), new(), new()
            second = axes if is_planar else rng.normal(size=(3, 3))
            link("revolute", (base, crank), feet[0], axes)
            link("revolute", (base, rocker), feet[1], second)
            link("revolute" if is_planar else "spherical", (crank, rod), feet[0] + arm, axes)
            link("revolute" if is_planar else "universal", (rod, rocker), feet[1] + rng.normal(size=3), axes)
    points = {name: rng.normal(size=3) for name in names}
    return drawn(rng, names, joints, "many", points)


WORDS = ("many", "in space", "in a plane", "about a point", "by parallel axes", "parallelogram", "held twice")
FAMILIES = (
    many,
    in_space,
    in_space,
    in_space,
    in_plane,
    in_plane,
    about_a_point,
    by_parallel_axes,
    parallelogram,
    held_twice,
)


def loaded(rng: Any, d: Drawing) -> Drawing:
    """With springs, dampers, torques and loads."""
    names = [GROUND, *(b.name for b in d.bodies)]
    forces: list[Any] = []
    for i in range(int(rng.integers(0, 3))):
        one, other = (str(x) for x in rng.choice(names, size=2, replace=False))
        ends = rng.normal(size=(2, 3))
        damping = float(rng.uniform(0.0, 2.0)) if rng.random() < 0.7 else 0.0
        forces.append(Spring(f"s{i}", one, ends[0], other, ends[1], float(rng.uniform(1, 9)), damping, 0.5))
    for i in range(int(rng.integers(0, 3))):
        name = str(rng.choice(names[1:]))
        axes, swing = str(rng.choice(["world", "body"])), float(rng.choice([0.0, 0.0, 3.0]))
        forces.append(Load(f"f{i}", name, rng.normal(size=3), rng.normal(size=3), axes, swing))
    for i, j in enumerate(d.joints):
        scalar, speeds = j.coordinates
        if speeds and rng.random() < 0.2:
            forces.append(Torque(f"t{i}", j.name, int(rng.integers(speeds)), float(rng.normal())))
        if scalar and rng.random() < 0.1:
            numbers = rng.uniform(0.5, 3.0), rng.uniform(0.0, 1.0), rng.normal()
            forces.append(Torsion(f"k{i}", j.name, int(rng.integers(scalar)), *map(float, numbers)))
    return replace(d, forces=tuple(forces))


def driven(rng: Any, d: Drawing) -> Drawing:
    """With one motion prescribed; it begins as drawn."""
    taken = {(x.joint, x.coordinate) for x in d.drives}
    scalars = {j.name: j.coordinates[0] for j in d.joints}
    candidates = [(j, i) for j in d.joints for i in range(scalars[j.name]) if (j.name, i) not in taken]
    if not candidates:
        return d
    j, i = candidates[int(rng.integers(len(candidates)))]
    x = rng.normal(), rng.normal(), rng.uniform(0.5, 3.0)
    name = f"drive {len(d.drives)}"
    return replace(d, drives=(*d.drives, Drive(name, j.name, i, *map(float, x))))


def opened(rng: Any, d: Drawing) -> Drawing:
    """With a closing joint drawn a little elsewhere on its child, so that it takes an assembly to close it."""
    is_planar = d.words == "in a plane"
    if d.words not in ("in space", "in a plane") or rng.random() < 0.6:
        return d
    joints = []
    for j in d.joints:
        if j.name.startswith("c") and j.kind in (
            "revolute",
            "cylindrical",
            "spherical",
            "prismatic",
            "planar",
            "generic",
        ):
            shift = 0.2 * rng.normal(size=3) * ([1.0, 1.0, 0.0] if is_planar else 1.0)
            j = replace(j, child_point=j.point + shift)
            if not is_planar and j.kind in ("revolute", "cylindrical", "prismatic", "planar"):
                j = replace(j, child_axis=unit(unit(j.axes[:, 0]) + 0.2 * rng.normal(size=3)))
        joints.append(j)
    return replace(d, joints=tuple(joints))


def slender(rng: Any, d: Drawing) -> Drawing:
    """With bodies that have no inertia about one axis, or none at all."""
    if rng.random() < 0.7:
        return d

    def one(b: Body) -> Body:
        if rng.random() < 0.5:
            return b
        own = rotation(rng)
        return replace(b, inertia=own @ np.diag([0.0, 1.0, 1.0]) @ own.T * float(rng.choice([0.0, 0.1])))

    return replace(d, bodies=tuple(map(one, d.bodies)))


def cut(rng: Any, d: Drawing) -> Drawing:
    """With some joint asked to close a loop."""
    if not d.joints or rng.random() < 0.6:
        return d
    chosen = int(rng.integers(len(d.joints)))
    return replace(d, joints=tuple(replace(j, cut="always") if i == chosen else j for i, j in enumerate(d.joints)))


def shuffled(rng: Any, d: Drawing) -> Drawing:
    """Everything in another order."""
    bodies = tuple(d.bodies[i] for i in rng.permutation(len(d.bodies)))
    joints = tuple(d.joints[i] for i in rng.permutation(len(d.joints)))
    return replace(d, bodies=bodies, joints=joints)


def mechanism(seed: int) -> Drawing:
    """The mechanism of a number."""
    rng = np.random.default_rng(seed)
    return finished(rng, FAMILIES[int(rng.integers(len(FAMILIES)))](rng), seed)


def finished(rng: Any, d: Drawing, seed: int) -> Drawing:
    """With loads and drives, perhaps open, slender, cut, turned and in other units."""
    d = loaded(rng, d)
    if rng.random() < 0.25:
        d = driven(rng, d)
        if rng.random() < 0.3:
            d = driven(rng, d)
    d = shuffled(rng, cut(rng, slender(rng, opened(rng, d))))
    if rng.random() < 0.6:
        d = d.turned(rotation(rng))
    if rng.random() < 0.5:
        length, mass, time = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-1, 1)
        d = d.scaled(float(length), float(mass), float(time))
    return replace(d, seed=seed)
