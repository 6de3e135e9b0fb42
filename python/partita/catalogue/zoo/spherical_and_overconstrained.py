"""Linkages that move because of their proportions: spherical linkages and the named overconstrained chains."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ...mechanism import Mechanism
from ...products import inverse_pose, matmul
from ..truth import ABOUT_AXES, Truth
from .drawing import FloatArray, around, link, unit
from .member import DOWN, FALL, Theme, member

MEMBERS: Theme = {}
PHILLIPS = "J. Phillips, Freedom in Machinery; K. H. Hunt, Kinematic Geometry of Mechanisms"
SPHERICAL = "any force through the common point of all axes can act around a loop; no moment about that point can"


def ring(m: Mechanism, points: list[FloatArray], axes: list[FloatArray], names: str) -> None:
    """A single loop of hinges with a link between successive hinges; the ground closes the loop."""
    bodies = [f"link {a}{b}" for a, b in itertools.pairwise(names)]
    for body, (near, far) in zip(bodies, itertools.pairwise(points), strict=True):
        link(m, body, near, far)
    pairs = itertools.pairwise(["ground", *bodies, "ground"])
    for name, (parent, child), point, axis in zip(names, pairs, points, axes, strict=True):
        m.add_revolute(name, parent, child, point=point, axis=axis)


def pole(polar: float, azimuth: float) -> FloatArray:
    """A direction by its angle from z and that about it [deg]."""
    return np.asarray(matmul(matmul(around((0, 0, 1), azimuth), around((0, 1, 0), polar)), (0.0, 0.0, 1.0)))


@member(MEMBERS, "spherical-four-bar", "spherical four-bar: four hinges whose axes meet in one point",
        Truth(1, 3, ABOUT_AXES, axes="joint", why="every link turns about one point: 3 x 3 degrees of freedom - 4 x "
                                                  "2 = 1; the loop fixes the point redundantly", source="C. H. "
                                                  "Chiang, Kinematics of Spherical Mechanisms. "
              + SPHERICAL), rates={"A": 4.0}, gravity=FALL)  # fmt: skip
def spherical_four_bar(m: Mechanism) -> None:
    """A spherical crank-rocker on a ball of 0.5 m: arcs of 25, 70, 60 and 80 degrees."""
    a, d = pole(0.0, 0.0), pole(80.0, 0.0)
    b = pole(25.0, 60.0)
    axes = [a, b, meeting(b, d, 70.0, 60.0), d]
    ring(m, [0.5 * axis for axis in axes], axes, "ABCD")


def meeting(b: FloatArray, d: FloatArray, to_b: float, to_d: float) -> FloatArray:
    """The direction at these angles [deg] from two others, on the left of the arc from b to d."""
    cosines, between = np.cos(np.radians((to_b, to_d))), float(matmul(b, d))
    x = (cosines[0] - between * cosines[1]) / (1.0 - between**2)
    y = (cosines[1] - between * cosines[0]) / (1.0 - between**2)
    in_plane = x * b + y * d
    across = np.cross(b, d)
    return np.asarray(in_plane + across * math.sqrt((1.0 - matmul(in_plane, in_plane)) / (matmul(across, across))))


def wrist(m: Mechanism, axes: list[tuple[FloatArray, FloatArray, FloatArray]], radius: float) -> None:
    """A platform on three legs of two links, all axes through the origin; joints `radius` away from it."""
    size = 0.2
    link(m, "platform", np.zeros(3), *(size * leg[2] for leg in axes), density=4.0)
    for i, (base, elbow, top) in enumerate(axes):
        leg = str(i + 1)
        link(m, f"inner {leg}", size * base, size * elbow)
        link(m, f"outer {leg}", size * elbow, size * top)
        m.add_revolute(f"A{leg}", "ground", f"inner {leg}", point=radius * base, axis=base)
        m.add_revolute(f"B{leg}", f"inner {leg}", f"outer {leg}", point=radius * elbow, axis=elbow)
        m.add_revolute(f"C{leg}", f"outer {leg}", "platform", point=radius * top, axis=top)
        m.add_spring(f"motor {leg}", "ground", 0.3 * base + 0.2 * elbow, f"inner {leg}", size * (elbow - base),
                     stiffness=60.0)  # fmt: skip


@member(MEMBERS, "spherical-wrist", "spherical wrist on three legs (3-RRR), all nine axes through one point",
        Truth(3, 6, ABOUT_AXES, axes="joint", why="every link turns about one point: 3 x 7 degrees of freedom - 9 x "
                                                  "2 = 3; each of two loops fixes the point redundantly", source="C. "
                                                  "M. Gosselin and J. Angeles, The optimum "
              "kinematic design of a spherical three-degree-of-freedom parallel manipulator, 1989. " + SPHERICAL),
        rates={"A1": 0.8}, gravity=FALL, samples=401)  # fmt: skip
def spherical_wrist(m: Mechanism) -> None:
    """Base axes 40 degrees from the vertical, elbows outwards, platform axes 60 degrees from the vertical, below."""
    legs = [(pole(140.0, 120.0 * i), pole(95.0, 120.0 * i + 55.0), pole(50.0, 120.0 * i + 20.0)) for i in range(3)]
    wrist(m, legs, 0.2)


@member(MEMBERS, "agile-eye", "Agile eye: a spherical wrist with right angles throughout, joints drawn in the centre",
        Truth(3, 6, {"*": "mx my mz"}, why="as the spherical wrist; about the common point no self-stress has a moment",
              source="C. M. Gosselin and J.-F. Hamel, The Agile Eye, IEEE ICRA 1994. " + SPHERICAL),
        rates={"A1": 0.7, "A2": -0.4}, gravity=(0.0, 0.0, 0.0))  # fmt: skip
def agile_eye(m: Mechanism) -> None:
    """Each leg's axes are x, y, z in cyclic order."""
    e = list(np.eye(3))
    wrist(m, [(e[i], e[(i + 1) % 3], e[(i + 2) % 3]) for i in range(3)], 0.0)


def turn(angle: float) -> FloatArray:
    """Motion of a hinge about its own z axis."""
    found = np.eye(4)
    found[:3, :3] = around((0, 0, 1), math.degrees(angle))
    return found


def bar(length: float, twist: float) -> FloatArray:
    """From the axis at one end of a link to that at the other: along their common normal x, then about it."""
    found = np.eye(4)
    found[:3, :3] = around((1, 0, 0), math.degrees(twist))
    found[0, 3] = length
    return found


def bennett_angle(angle: float, twist: float, other: float) -> float:
    """Angle at the second hinge of Bennett's loop for that at the first; `twist` lies between the two."""
    ratio = math.sin((other + twist) / 2) / math.sin((other - twist) / 2)
    return 2.0 * math.atan2(ratio, math.tan(angle / 2))


@member(MEMBERS, "bennett", "Bennett's linkage: four hinges in space, lengths as the sines of the twists",
        Truth(1, 3, ABOUT_AXES, axes="joint", why="its four axes span a system of three screws, not of four: "
              "Kutzbach's -2 + 3 = 1; forces along the other lines of the hyperboloid of the axes meet all four",
              source="G. T. Bennett, A new mechanism, Engineering 76 (1903); " + PHILLIPS),
        rates={"A": 4.0}, gravity=DOWN)  # fmt: skip
def bennett(m: Mechanism) -> None:
    """Twists 40 and 75 degrees, long bars 1 m."""
    alpha, beta = math.radians(40.0), math.radians(75.0)
    a, b = math.sin(alpha) / math.sin(beta), 1.0
    first = math.radians(70.0)
    second = bennett_angle(first, alpha, beta)
    frames = [np.eye(4)]
    for angle, (length, twist) in zip((first, second, -first), ((a, alpha), (b, beta), (a, alpha)), strict=True):
        frames.append(matmul(matmul(frames[-1], turn(angle)), bar(length, twist)))
    ring(m, [f[:3, 3] for f in frames], [f[:3, 2] for f in frames], "ABCD")


def two_bennetts(m: Mechanism, alpha: float, gamma: float, beta: float, between: float) -> None:
    """Five hinges: two of Bennett's loops that shared a link of twist beta, which is removed; twists in degrees.

    Frame 2 has the common hinge of the two links that are merged at the angle `between`; hinge 3 is the other end of
    the common link. Hinges 1, 4 of the first loop, 3, and 6, 5 of the second remain.
    """
    al, be, ga, shift = (math.radians(x) for x in (alpha, beta, gamma, between))
    a, b, c = math.sin(al), math.sin(be), math.sin(ga)
    at_second = math.radians(65.0)
    two = np.eye(4)
    one = matmul(two, inverse_pose(bar(a, al)))
    five = matmul(matmul(two, turn(-shift)), inverse_pose(bar(c, ga)))
    three = matmul(matmul(two, turn(at_second)), bar(b, be))
    four = matmul(matmul(three, turn(bennett_angle(at_second, be, al))), bar(a, al))
    six = matmul(matmul(three, turn(bennett_angle(at_second + shift, be, ga))), bar(c, ga))
    frames = [one, four, three, six, five]
    # joints a little along their axes: two of these may meet
    ring(m, [f[:3, 3] + 0.2 * f[:3, 2] for f in frames], [f[:3, 2] for f in frames], "ABCDE")


FIVE = "Kutzbach's 6 x 4 - 5 x 5 = -1; it moves like the two Bennett loops it consists of: two redundant constraints"


@member(MEMBERS, "goldberg", "Goldberg's five-bar: two of Bennett's loops joined at a link, five hinges in space",
        Truth(1, 2, ABOUT_AXES, axes="joint", why=FIVE,
              source="M. Goldberg, New five-bar and six-bar linkages in three dimensions, Trans. ASME 65 (1943); "
              + PHILLIPS), rates={"A": 1.0})  # fmt: skip
def goldberg(m: Mechanism) -> None:
    """Twists 40, 75 and 55 degrees; the two links that become one stand in line."""
    two_bennetts(m, 40.0, 55.0, 75.0, between=180.0)


@member(MEMBERS, "myard", "Myard's five-bar: mirror images of one of Bennett's loops, folded onto each other",
        Truth(1, 2, ABOUT_AXES, axes="joint", why=FIVE,
              source="F. E. Myard, Bull. Soc. Math. France 59 (1931); " + PHILLIPS), rates={"A": 1.0})  # fmt: skip
def myard(m: Mechanism) -> None:
    """Twists 40 and 90 degrees, mirrored 140: the two links that become one lie upon each other, two axes meet."""
    two_bennetts(m, 40.0, 140.0, 90.0, between=0.0)


@member(MEMBERS, "bricard-plane-symmetric", "Bricard's plane-symmetric loop: six hinges, two in a plane, two pairs of "
        "mirror images", Truth(1, 1, ABOUT_AXES, axes="joint",
                               why="half of it has three rotations, and the line of its last hinge must lie in the "
                               "plane of symmetry, two constraints: 1; Kutzbach's 0 + 1, the self-stress a force in "
                               "the plane",
                               source="R. Bricard, Lecons de cinematique, 1927; " + PHILLIPS),
        rates={"A": 1.0}, gravity=FALL)  # fmt: skip
def bricard_plane_symmetric(m: Mechanism) -> None:
    """Hinges A and D in a plane, which moves on with the links."""
    mirror = np.array([1.0, -1.0, 1.0])
    half = [(0.0, 0.0, 0.0), (0.4, 0.5, -0.1), (0.9, 0.45, -0.3), (1.3, 0.0, -0.2)]
    axes = [unit(x) for x in ((0.4, 0.0, 1.0), (0.2, 0.5, 1.0), (-0.3, 0.8, 0.6), (1.0, 0.0, 0.5))]
    points = [np.array(x) for x in half]
    points += [mirror * points[2], mirror * points[1]]
    axes += [mirror * axes[2], mirror * axes[1]]
    # rotated, so that no component is unique along an axis of the world or of a joint by chance
    turned = around((1.0, 2.0, 3.0), 50.0)
    ring(m, [matmul(turned, p) for p in points], [matmul(turned, a) for a in axes], "ABCDEF")


@member(MEMBERS, "sarrus", "Sarrus' linkage: two chains of parallel hinges lift a platform straight up",
        Truth(1, 1, {"*": "fx fy fz mx my"}, why="what both chains allow is the translation across both directions of "
              "axes: 1 = Kutzbach's 0 + 1; the self-stress is a couple about that direction, the world's z",
              source="P. F. Sarrus, C. R. Acad. Sci. Paris 36 (1853); " + PHILLIPS), rates={"x1": 0.5},
        gravity=FALL)  # fmt: skip
def sarrus(m: Mechanism) -> None:
    """Axes along x in one chain, along y in the other; a spring carries the platform."""
    chains = {"x": (np.array([1.0, 0.0, 0.0]), np.array([0.0, -0.3, 0.0]), np.array([0.0, -0.5, 0.25])),
              "y": (np.array([0.0, 1.0, 0.0]), np.array([0.3, 0.0, 0.0]), np.array([0.5, 0.0, 0.25]))}  # fmt: skip
    rise = np.array([0.0, 0.0, 0.5])
    link(m, "platform", rise, *(foot + rise for _, foot, _ in chains.values()), density=3.0)
    for name, (axis, foot, knee) in chains.items():
        link(m, f"lower {name}", foot, knee)
        link(m, f"upper {name}", knee, foot + rise)
        m.add_revolute(f"{name}1", "ground", f"lower {name}", point=foot, axis=axis)
        m.add_revolute(f"{name}2", f"lower {name}", f"upper {name}", point=knee, axis=axis)
        m.add_revolute(f"{name}3", f"upper {name}", "platform", point=foot + rise, axis=axis)
    m.add_spring("lift", "ground", (0, 0, 0), "platform", (0, 0, 0), stiffness=400.0, length=0.55)
