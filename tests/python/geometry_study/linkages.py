"""Over-constrained linkages drawn exactly, by their theory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .drawing import Drawing, X, Z, unit

Array = NDArray[np.float64]


def turn(axis: Array, angle: float) -> Array:
    """Rotation matrix, by Rodrigues."""
    k = np.cross(np.eye(3), unit(axis))
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def direction(rng: Any) -> Array:
    return unit(rng.normal(size=3))


def cranks(rng: Any) -> Drawing:
    """Three equal parallel cranks on one bar, pins in no line."""
    d = Drawing()
    feet = [np.array([x, *rng.uniform(-0.4, 0.4, 2)]) for x in (0.0, 1.0, 2.5)]
    angle = rng.uniform(0.4, 1.2)
    arm = rng.uniform(0.4, 0.7) * np.array([np.cos(angle), np.sin(angle), 0.0])
    d.rod("bar", feet[0] + arm, feet[2] + arm)
    for i, foot in enumerate(feet):
        d.rod(f"crank{i}", foot, foot + arm)
        d.hinge(f"A{i}", "ground", f"crank{i}", foot)
        d.hinge(f"B{i}", f"crank{i}", "bar", foot + arm)
    return d


def gantry(rng: Any) -> Drawing:
    """A beam on two parallel rails of any distance."""
    width = 10.0 ** rng.uniform(-1.0, np.log10(60.0))
    along = unit([1.0, 0.0, -rng.uniform(0.2, 0.6)])
    d = Drawing((0, 0, -9.81))
    d.rod("beam", (0, 0, 0), (0, width, 0), mass=5.0)
    d.joint("prismatic", "left", "ground", "beam", (0, 0, 0), along)
    d.joint("prismatic", "right", "ground", "beam", (0, width, 0), along)
    return d


def bennett_frames(a: float, alpha: float, b: float, beta: float, first: float) -> list[Array]:
    """Poses (4 x 4) of the four hinges, z along the axis, x along the link that goes out."""
    half = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    second = 2.0 * np.arctan2(half, np.tan(first / 2))
    pose, out = np.eye(4), []
    for angle, length, twist in ((first, a, alpha), (second, b, beta), (-first, a, alpha), (-second, b, beta)):
        c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
        rows = [[c, -s * ct, s * st, length * c], [s, c * ct, -c * st, length * s], [0, st, ct, 0], [0, 0, 0, 1]]
        out.append(pose @ np.block([[turn(Z, angle), np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
        pose = pose @ np.array(rows)
    assert np.abs(pose - np.eye(4)).max() < 1e-13
    return out


def ring(hinges: list[tuple[Array, Array]], gravity: Any = (0, 0, -9.81)) -> Drawing:
    """A single closed loop of hinges (point, axis); the link behind the last one is the ground."""
    d = Drawing(gravity)
    for i in range(len(hinges) - 1):
        d.rod(f"link{i}", hinges[i][0], hinges[i + 1][0])
    names = ["ground", *(f"link{i}" for i in range(len(hinges) - 1)), "ground"]
    for i, (point, axis) in enumerate(hinges):
        d.hinge(f"H{i}", names[i], names[i + 1], point, axis)
    return d


def bennett(rng: Any) -> Drawing:
    alpha, a = rng.uniform(0.4, 0.7), 1.0
    b = rng.uniform(1.2, 1.6)
    beta = np.arcsin(b * np.sin(alpha) / a)
    frames = bennett_frames(a, alpha, b, beta, rng.uniform(0.7, 1.3))
    return ring([(f[:3, 3], f[:3, 2]) for f in frames])


def two_bennetts(rng: Any, common: tuple[float, float], other: tuple[float, float]) -> Drawing:
    """Goldberg's five hinges: Bennett's loops with a link in common, which goes, and two links made one."""
    length, twist = common
    (b, c), rate = other, np.sin(twist) / length
    one = bennett_frames(length, twist, b, np.arcsin(b * rate), rng.uniform(0.7, 1.2))
    two = bennett_frames(length, twist, c, np.arcsin(c * rate), -rng.uniform(0.7, 1.2))
    # frame 0 of each: z along the hinge, x along the common link; the same place makes the link the same
    two = [one[0] @ np.linalg.inv(two[0]) @ f for f in two]
    assert np.abs(one[1][:3, 2] - two[1][:3, 2]).max() < 1e-12 and np.abs(one[1][:3, 3] - two[1][:3, 3]).max() < 1e-12
    # one loop: the common hinge 0, then 3, 2 of the first, its link to hinge 1 welded to that of the second, 2, 3
    return ring([(f[:3, 3], f[:3, 2]) for f in (one[0], one[3], one[2], two[2], two[3])])


def goldberg(rng: Any) -> Drawing:
    return two_bennetts(rng, (1.0, rng.uniform(0.4, 0.6)), tuple(rng.uniform(1.15, 1.6, 2)))


def myard(rng: Any) -> Drawing:
    """Rectangular loops: the common link is twisted by a right angle."""
    b = rng.uniform(0.4, 0.8)
    return two_bennetts(rng, (1.0, np.pi / 2), (b, b))


def sarrus(rng: Any) -> Drawing:
    """A plate on two legs of three parallel hinges each."""
    d = Drawing((0, 0, -9.81))
    lower, upper, lean = rng.uniform(0.4, 0.7), rng.uniform(0.4, 0.7), rng.uniform(0.3, 0.8)
    out = lower * np.sin(lean)
    height = lower * np.cos(lean) + np.sqrt(upper**2 - out**2) if out < upper else lower * np.cos(lean)
    d.body("plate", (0, 0, height), 2.0)
    for leg, angle in enumerate((0.2, 0.2 + rng.uniform(1.0, 2.2))):
        radial, axis = turn(Z, angle) @ X, turn(Z, angle) @ np.array([0.0, 1.0, 0.0])
        foot, knee = 0.5 * radial, (0.5 + out) * radial + [0, 0, lower * np.cos(lean)]
        seat = np.array([*(0.5 * radial)[:2], height])
        d.rod(f"lower{leg}", foot, knee)
        d.rod(f"upper{leg}", knee, seat)
        d.hinge(f"A{leg}", "ground", f"lower{leg}", foot, axis)
        d.hinge(f"B{leg}", f"lower{leg}", f"upper{leg}", knee, axis)
        d.hinge(f"C{leg}", f"upper{leg}", "plate", seat, axis)
    return d


def cardan(rng: Any) -> Drawing:
    """Two parallel shafts, a shaft between them on two universal joints, the forks in one plane."""
    d = Drawing((0, -9.81, 0))
    bend = rng.uniform(0.2, 0.6)
    a, b = np.zeros(3), np.array([np.cos(bend), np.sin(bend), 0.0])
    middle, far = unit(b - a), b + 0.7 * X
    d.rod("input", (-0.7, 0, 0), a)
    d.rod("middle", a, b)
    d.rod("output", b, far)
    # what hangs off the axes falls
    d.body("weight", (-0.7, *(0.2 * rng.uniform(-1, 1, 2) + 0.2)), 0.5)
    start = rng.uniform(0.3, 1.2)
    fork = turn(X, start) @ np.array([0.0, 0.0, 1.0])
    cross = unit(np.cross(middle, fork))
    d.hinge("in", "ground", "input", (-0.7, 0, 0), X)
    d.joint("universal", "U", "input", "middle", a, fork, axis2=cross)
    d.joint("universal", "V", "middle", "output", b, cross, axis2=unit(np.cross(cross, X)))
    d.hinge("out", "ground", "output", far, X)
    d.bodies[0] = type(d.bodies[0])("input", 1.0, np.full(3, 0.1), d.bodies[3].position)
    del d.bodies[3]
    return d


def train(rng: Any, loops: int | None = None) -> Drawing:
    """Equal cranks in a row, a coupler between each two: parallelograms one after the other."""
    loops = int(rng.integers(2, 6)) if loops is None else loops
    d, angle = Drawing(), rng.uniform(0.4, 1.2)
    arm = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    feet = [np.array([x, 0.1 * x, 0.0]) for x in np.cumsum(rng.uniform(0.6, 1.2, loops + 1))]
    for i, foot in enumerate(feet):
        d.rod(f"crank{i}", foot, foot + arm)
        d.hinge(f"A{i}", "ground", f"crank{i}", foot)
    for i in range(loops):
        d.rod(f"coupler{i}", feet[i] + arm, feet[i + 1] + arm)
        d.hinge(f"B{i}", f"crank{i}", f"coupler{i}", feet[i] + arm)
        d.hinge(f"C{i}", f"coupler{i}", f"crank{i + 1}", feet[i + 1] + arm)
    return d


def scissors(rng: Any, units: int | None = None) -> Drawing:
    """Lazy tongs on a foot and a slide."""
    units = int(rng.integers(1, 5)) if units is None else units
    d, angle = Drawing((3.0, -9.0, 0)), rng.uniform(0.5, 0.9)
    w, h = np.cos(angle), np.sin(angle)
    d.body("slide", (0, h, 0))
    d.joint("prismatic", "guide", "ground", "slide", (0, h, 0), (0, 1, 0))
    for i in range(units):
        low, high = np.array([i * w, 0.0, 0.0]), np.array([i * w, h, 0.0])
        d.rod(f"up{i}", low, high + w * X)
        d.rod(f"down{i}", high, low + w * X)
        d.hinge(f"M{i}", f"up{i}", f"down{i}", 0.5 * (low + high) + [0.5 * w, 0, 0])
        d.hinge(f"L{i}", f"down{i - 1}" if i else "ground", f"up{i}", low)
        d.hinge(f"K{i}", f"up{i - 1}" if i else "slide", f"down{i}", high)
    return d


def three_rrr(rng: Any, out: float = 0.0) -> Drawing:
    """The planar machine of three legs, a hinge in each of its corners."""
    d = Drawing()
    d.body("platform", (0, 0, 0), 2.0)
    for leg, angle in enumerate(np.array([0.1, 2.2, 4.3]) + rng.uniform(-0.2, 0.2, 3)):
        radial = turn(Z, angle) @ X
        foot, seat = 1.2 * radial, turn(Z, angle + rng.uniform(0.1, 0.3)) @ X * 0.4
        knee = 0.5 * (foot + seat) + turn(Z, angle + 1.57) @ X * rng.uniform(0.35, 0.5)
        d.rod(f"lower{leg}", foot, knee)
        d.rod(f"upper{leg}", knee, seat)
        d.hinge(f"A{leg}", "ground", f"lower{leg}", foot)
        d.hinge(f"B{leg}", f"lower{leg}", f"upper{leg}", knee)
        d.hinge(f"C{leg}", f"upper{leg}", "platform", seat)
    return d


def delta(rng: Any) -> Drawing:
    """Clavel's robot, each forearm four hinges and two rods."""
    d = Drawing((0, 0, -9.81))
    under = np.array([*rng.uniform(-0.03, 0.03, 2), -0.61])
    d.body("platform", under, 0.35, (1e-3,) * 3)
    for leg, angle in enumerate((0.3, 0.3 + 2.0 * np.pi / 3.0, 0.3 + 4.0 * np.pi / 3.0)):
        out, side = turn(Z, angle) @ X, turn(Z, angle) @ np.array([0.0, 1.0, 0.0])
        shoulder, elbow, seat = 0.18 * out, 0.43 * out + [0, 0, -0.13], 0.07 * out + under
        half = 0.045 * side
        normal = np.cross(side, unit(seat - elbow))
        d.rod(f"arm{leg}", shoulder, elbow, 0.4)
        d.rod(f"upper{leg}", elbow - half, elbow + half, 0.04)
        d.rod(f"lower{leg}", seat - half, seat + half, 0.04)
        d.hinge(f"A{leg}", "ground", f"arm{leg}", shoulder, side)
        d.hinge(f"B{leg}", f"arm{leg}", f"upper{leg}", elbow, side)
        for sign, name in ((-1, "a"), (1, "b")):
            first, last = elbow + sign * half, seat + sign * half
            d.rod(f"rod{leg}{name}", first, last, 0.08)
            d.hinge(f"C{leg}{name}", f"upper{leg}", f"rod{leg}{name}", first, normal)
            d.hinge(f"D{leg}{name}", f"rod{leg}{name}", f"lower{leg}", last, normal)
        d.hinge(f"E{leg}", f"lower{leg}", "platform", seat, side)
    return d


EVERY: dict[str, tuple[Callable[[Any], Drawing], int]] = {
    "cranks": (cranks, 1),
    "gantry": (gantry, 1),
    "bennett": (bennett, 1),
    "sarrus": (sarrus, 1),
    "cardan": (cardan, 1),
    "train": (train, 1),
    "three_rrr": (three_rrr, 3),
    "delta": (delta, 3),
}
"""Maker and mobility."""
