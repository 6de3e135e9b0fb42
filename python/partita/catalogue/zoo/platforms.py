"""Platforms on several legs."""

from __future__ import annotations

import numpy as np

from ...mechanism import Mechanism
from ...products import matmul, norm
from ...results import Result
from ..entry import Check
from ..truth import EVERYTHING, Truth, planar
from .drawing import FloatArray, Slide, around, block, in_space, link, linkage, polar, unit
from .member import FALL, Theme, member

MEMBERS: Theme = {}
MERLET = "J.-P. Merlet, Parallel Robots"
UP = np.array([0.0, 0.0, 1.0])


def ring(radius: float, degrees: tuple[float, ...], height: float = 0.0) -> list[FloatArray]:
    """Points on a circle about the z axis."""
    return [in_space(polar(radius, angle), height) for angle in degrees]


def crossing(along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two axes of a universal joint across a leg."""
    first = unit(np.cross(along, np.roll(unit(along), 1)))
    return first, unit(np.cross(along, first))


def telescope(m: Mechanism, leg: str, foot: FloatArray, head: FloatArray, base: str, stiffness: float = 3e3) -> None:
    """A leg of two telescoping parts, its foot a universal joint or a ball (`base`), and a spring."""
    along = head - foot
    link(m, f"lower {leg}", foot, foot + 0.55 * along, density=2.0)
    link(m, f"upper {leg}", head, head - 0.55 * along, density=1.0)
    if base == "spherical":
        m.add_spherical(f"foot {leg}", "ground", f"lower {leg}", point=foot)
    else:
        axis1, axis2 = crossing(along)
        m.add_universal(f"foot {leg}", "ground", f"lower {leg}", point=foot, axis1=axis1, axis2=axis2)
    m.add_prismatic(f"slide {leg}", f"lower {leg}", f"upper {leg}", point=head, axis=along)
    m.add_spherical(f"head {leg}", f"upper {leg}", "platform", point=head)
    m.add_spring(f"actuator {leg}", "ground", foot, f"upper {leg}", (0, 0, 0), stiffness=stiffness, damping=20.0,
                 length=float(norm(along)) + 0.01)  # fmt: skip


def stewart(m: Mechanism, base: str) -> None:
    """Feet in pairs on a circle of 1 m, heads in pairs on one of 0.6 m, turned by 60 degrees."""
    feet = ring(1.0, (-10.0, 10.0, 110.0, 130.0, 230.0, 250.0))
    heads = ring(0.6, (-48.0, 48.0, 72.0, 168.0, 192.0, 288.0), 0.9)
    link(m, "platform", 0.9 * UP, *heads, density=3.0)
    m.add_free("pose", "ground", "platform", point=0.9 * UP, cut="never")
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        telescope(m, str(i + 1), foot, head, base)


PUSHED = {"pose": (0.2, -0.1, 0.3, 0.5, 0.3, -0.8)}


@member(MEMBERS, "stewart-ups", "Gough and Stewart's platform on six legs U-P-S: six degrees of freedom",
        Truth(6, 0, EVERYTHING, why="a U-P-S leg has six degrees of freedom and constrains none of the platform's; "
                                    "Kutzbach: 6 x 13 - "
              "6 x (4 + 5 + 3) = 6", source=MERLET), rates=PUSHED, gravity=FALL)  # fmt: skip
def stewart_ups(m: Mechanism) -> None:
    """Springs stand in for the actuators."""
    stewart(m, "universal")


@member(MEMBERS, "stewart-sps", "Gough and Stewart's platform on six legs S-P-S: six more degrees of freedom are "
                                "idle spins",
        Truth(12, 0, EVERYTHING, why="Kutzbach: 6 x 13 - 6 x (3 + 5 + 3) = 12; each leg spins about the line of its "
              "two balls", source=MERLET, idle=tuple(f"lower {i} + upper {i}" for i in range(1, 7))),
        rates=PUSHED, gravity=FALL)  # fmt: skip
def stewart_sps(m: Mechanism) -> None:
    """Springs stand in for the actuators."""
    stewart(m, "spherical")


@member(MEMBERS, "three-rpr", "planar platform on three telescopes (3-RPR)",
        planar(7, 9, MERLET), rates={"A1": 0.2}, gravity=(0.0, 0.0, 0.0))  # fmt: skip
def three_rpr(m: Mechanism) -> None:
    """Feet on a circle of 1 m, heads on one of 0.3 m, springs along the legs."""
    feet = [polar(1.0, angle) for angle in (90.0, 210.0, 330.0)]
    heads = [polar(0.3, angle) for angle in (110.0, 230.0, 350.0)]
    points, links, slides = {}, {"platform": "H1 H2 H3"}, {}
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        points.update({f"A{i + 1}": foot, f"H{i + 1}": head, f"E{i + 1}": foot + 0.6 * (head - foot)})
        links[f"barrel {i + 1}"] = f"A{i + 1} E{i + 1}"
        slides[f"piston {i + 1}"] = Slide(f"H{i + 1}", head - foot, on=f"barrel {i + 1}")
    linkage(m, points, links, ground="A1 A2 A3", slides=slides)
    for i, foot in enumerate(feet):
        m.add_spring(f"actuator {i + 1}", "ground", in_space(foot), f"piston {i + 1}", (0, 0, 0), stiffness=200.0)


def bars(m: Mechanism, leg: str, near: FloatArray, far: FloatArray, across: FloatArray, base: str, spins: bool) -> None:
    """The two bars of a parallelogram between a link and the platform: two balls each, or a universal joint below."""
    for side, sign in (("a", 0.5), ("b", -0.5)):
        p, q, name = near + sign * across, far + sign * across, f"bar {leg}{side}"
        link(m, name, p, q)
        if spins:
            m.add_spherical(f"elbow {leg}{side}", base, name, point=p)
        else:
            axis1, axis2 = crossing(q - p)
            m.add_universal(f"elbow {leg}{side}", base, name, point=p, axis1=axis1, axis2=axis2)
        m.add_spherical(f"wrist {leg}{side}", name, "platform", point=q)


@member(MEMBERS, "delta", "Clavel's delta robot: three arms and six bars between balls; the platform only translates",
        Truth(9, 0, EVERYTHING, why="Kutzbach: 6 x 10 - 3 x 5 (hinges) - 12 x 3 (balls) = 9, of which the spins of six "
              "bars are idle", source="R. Clavel, Conception d'un robot parallele rapide, EPFL 1991",
              idle=tuple(f"bar {leg}{side}" for leg in "123" for side in "ab")),
        rates={"shoulder 1": 0.5}, gravity=FALL)  # fmt: skip
def delta(m: Mechanism) -> None:
    """Shoulders on a circle of 0.2 m, arms 0.3 m and 20 degrees below the horizon, platform 0.06 m, bars 0.7 m."""
    link(m, "platform", np.zeros(3), *ring(0.06, (0.0, 120.0, 240.0)), density=4.0)
    height = None
    for i, angle in enumerate((0.0, 120.0, 240.0)):
        turn = around(UP, angle)
        shoulder = np.array([0.2, 0.0, 0.0])
        elbow = shoulder + matmul(around((0, 1, 0), 20.0), (0.3, 0.0, 0.0))
        height = elbow[2] - (0.7**2 - (elbow[0] - 0.06) ** 2) ** 0.5
        wrist = np.array([0.06, 0.0, height])
        leg = str(i + 1)
        lift = np.array([0.0, 0.0, height])
        link(m, f"arm {leg}", matmul(turn, shoulder - lift), matmul(turn, elbow - lift), density=2.0)
        m.add_revolute(f"shoulder {leg}", "ground", f"arm {leg}", point=matmul(turn, shoulder - lift),
                       axis=matmul(turn, (0, 1, 0)))  # fmt: skip
        bars(
            m,
            leg,
            matmul(turn, elbow - lift),
            matmul(turn, wrist - lift),
            matmul(turn, (0.0, 0.1, 0.0)),
            f"arm {leg}",
            spins=True,
        )
        m.add_spring(f"motor {leg}", "ground", matmul(turn, shoulder - lift + (0.1, 0.0, 0.3)), f"arm {leg}",
                     matmul(turn, elbow - shoulder), stiffness=150.0, damping=1.0, length=0.3)  # fmt: skip


@member(MEMBERS, "orthoglide", "three slides at right angles and three parallelograms: the platform only translates",
        Truth(3, 0, EVERYTHING, why="Kutzbach: 6 x 10 - 3 x 5 (slides) - 6 x (4 + 3) = 3: three pairs of parallel bars "
              "remove the rotations of the platform", source="P. Wenger and D. Chablat, Kinematic analysis of a new "
              "parallel machine tool: the Orthoglide, 2000"),
        rates={"slide 1": 0.3}, gravity=(0.0, 0.0, 0.0))  # fmt: skip
def orthoglide(m: Mechanism) -> None:
    """Bars of 0.5 m, as drawn along their slides; springs hold the slides."""
    tips = [0.06 * np.roll((1.0, 0.0, 0.0), i) for i in range(3)]
    link(m, "platform", np.zeros(3), *tips, density=5.0)
    for i, tip in enumerate(tips):
        leg, along, across = str(i + 1), unit(tip), np.roll((0.0, 1.0, 0.0), i)
        at = tip + 0.5 * along
        block(m, f"block {leg}", at, mass=0.5, width=0.05)
        m.add_prismatic(f"slide {leg}", "ground", f"block {leg}", point=at, axis=along, cut="never")
        bars(m, leg, at, tip, 0.08 * across, f"block {leg}", spins=False)
        m.add_spring(f"motor {leg}", "ground", at + 0.4 * along, f"block {leg}", (0, 0, 0), stiffness=80.0)


@member(MEMBERS, "three-rps", "tripod on three legs R-P-S: it heaves, rolls and pitches",
        Truth(3, 0, EVERYTHING, why="Kutzbach: 6 x 7 - 3 x (5 + 5 + 3) = 3", source="K. H. Hunt, Structural kinematics "
              "of in-parallel-actuated robot arms, J. Mech. Transm. Autom. Des. 105 (1983)"),
        rates={"slide 1": 0.4, "slide 2": -0.1}, gravity=FALL)  # fmt: skip
def three_rps(m: Mechanism) -> None:
    """Hinges along the circle of the feet, springs in the legs."""
    link(m, "platform", 0.8 * UP, *ring(0.4, (0.0, 120.0, 240.0), 0.8), density=3.0)
    feet, heads = ring(0.7, (0.0, 120.0, 240.0)), ring(0.4, (0.0, 120.0, 240.0), 0.8)
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        leg, along = str(i + 1), head - foot
        link(m, f"lower {leg}", foot, foot + 0.55 * along, density=2.0)
        link(m, f"upper {leg}", head, head - 0.55 * along, density=1.0)
        m.add_revolute(f"foot {leg}", "ground", f"lower {leg}", point=foot, axis=np.cross(UP, foot), cut="never")
        m.add_prismatic(f"slide {leg}", f"lower {leg}", f"upper {leg}", point=head, axis=along, cut="never")
        m.add_spherical(f"head {leg}", f"upper {leg}", "platform", point=head)
        m.add_spring(f"actuator {leg}", "ground", foot, f"upper {leg}", (0, 0, 0), stiffness=2e3, damping=10.0,
                     length=float(norm(along)) + 0.01)  # fmt: skip


def axes_of_the_platform(result: Result) -> float:
    """Largest cosine of what two kinds of legs keep at a right angle: the hinges of legs 1 and 2 with the line of their
    feet, whatever their lengths, and the hinge of leg 3 with the leg."""
    feet = [result.joint(f"foot {leg}").point for leg in "123"]
    head = result.joint("head 3").point
    platform = matmul(result.body("platform").rotation, np.column_stack([PARALLEL, ACROSS]))
    along, across = platform[..., 0], platform[..., 1]
    base, leg = feet[1] - feet[0], head - feet[2]
    pairs = ((across, base), (along, leg))
    return max(float(np.max(np.abs(np.sum(a * b, axis=1)) / np.linalg.norm(b, axis=1))) for a, b in pairs)


TILT = 20.0  # of the plane of legs 1 and 2 in the drawing, about x [deg]
PARALLEL, ACROSS = np.array([1.0, 0.0, 0.0]), matmul(around((1, 0, 0), TILT), (0.0, 1.0, 0.0))
"""Axes of the platform as drawn: of the hinge of leg 3, and of those of legs 1 and 2."""


@member(MEMBERS, "exechon-like", "machine tool with three telescopes, two of them U-P-R in one plane, the third S-P-R",
        Truth(3, 2, {"* 3": EVERYTHING["*"], "foot *": "fx mx", "*": "fx"},
              why="legs 1 and 2 leave three degrees of freedom in their plane, which turns about the line of their "
                  "feet; leg 3 removes one of these four: 3 = Kutzbach's 6 x 7 - 2 x (4 + 5 + 5) - (3 + 5 + 5) + 2; "
                  "the self-stresses are a force across the plane and a couple in it, perpendicular to the line of the "
                  "feet",
              source="Z. M. Bi and Y. Jin, Kinematic modeling of Exechon parallel kinematic machine, Robot. "
              "Comput.-Integr. Manuf. 27 (2011)"),
        rates={"slide 1": 0.2, "slide 2": -0.1, "slide 3": 0.3}, gravity=FALL,
        more=(Check("right angles of the platform [1]", 1e-12, "closure over the size of the machine, 1 m",
                    axes_of_the_platform),))  # fmt: skip
def exechon_like(m: Mechanism) -> None:
    """Feet 0.8 m apart, the third 0.5 m beside them; a platform of 0.3 m hangs 0.9 m below. Springs in the legs."""
    down = matmul(around((1, 0, 0), TILT), (0.0, 0.0, -0.9))
    feet = [np.array([-0.4, 0.0, 0.0]), np.array([0.4, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])]
    heads = [down - 0.15 * PARALLEL, down + 0.15 * PARALLEL, down + 0.2 * ACROSS]
    link(m, "platform", down, *heads, density=4.0)
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        leg, along = str(i + 1), head - foot
        link(m, f"lower {leg}", foot, foot + 0.55 * along, density=2.0)
        link(m, f"upper {leg}", head, head - 0.55 * along, density=1.0)
        if leg == "3":
            m.add_spherical("foot 3", "ground", "lower 3", point=foot, cut="never")
        else:
            m.add_universal(f"foot {leg}", "ground", f"lower {leg}", point=foot, axis1=PARALLEL, axis2=ACROSS,
                            cut="never")  # fmt: skip
        m.add_prismatic(f"slide {leg}", f"lower {leg}", f"upper {leg}", point=head, axis=along, cut="never")
        m.add_revolute(f"head {leg}", f"upper {leg}", "platform", point=head, axis=PARALLEL if leg == "3" else ACROSS)
        m.add_spring(f"actuator {leg}", "ground", foot, f"upper {leg}", (0, 0, 0), stiffness=300.0, damping=0.5,
                     length=float(norm(along)) - 0.05)  # fmt: skip


@member(MEMBERS, "parallel-ankle", "ankle of a walking machine: a universal joint, moved by two levers and two rods",
        Truth(2, 0, EVERYTHING, why="Kutzbach: 6 x 5 - 4 (ankle) - 2 x (5 + 4 + 3) = 2",
              source="C. Zhou and N. Tsagarakis, On the comprehensive kinematics analysis of a humanoid parallel ankle "
              "mechanism, J. Mech. Robot. 10 (2018)"), rates={"ankle": (0.5, 0.8)}, gravity=FALL,
        samples=401)  # fmt: skip
def parallel_ankle(m: Mechanism) -> None:
    """The shank is fixed; levers rotate across it at two heights, and rods connect them to the heel, left and right."""
    heel = [np.array([-0.06, y, -0.03]) for y in (0.045, -0.045)]
    link(m, "foot", np.zeros(3), (0.15, 0.0, -0.06), (-0.08, 0.0, -0.06), *heel, density=4.0)
    m.add_universal("ankle", "ground", "foot", point=(0, 0, 0), axis1=(0, 1, 0), axis2=(1, 0, 0), cut="never")
    for i, height in enumerate((0.28, 0.2)):
        side, pivot = "lr"[i], np.array([0.0, heel[i][1], height])
        tip = pivot + matmul(around((0, 1, 0), -10.0), (-0.06, 0.0, 0.0))
        link(m, f"lever {side}", pivot, tip, density=2.0)
        link(m, f"rod {side}", tip, heel[i])
        m.add_revolute(f"motor {side}", "ground", f"lever {side}", point=pivot, axis=(0, 1, 0))
        axis1, axis2 = crossing(heel[i] - tip)
        m.add_universal(f"top {side}", f"lever {side}", f"rod {side}", point=tip, axis1=axis1, axis2=axis2)
        m.add_spherical(f"heel {side}", f"rod {side}", "foot", point=heel[i])
        m.add_spring(f"spring {side}", "ground", pivot - (0.1, 0.0, 0.3), f"lever {side}", tip - pivot,
                     stiffness=300.0)  # fmt: skip
