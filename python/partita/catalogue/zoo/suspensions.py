"""Wheel suspensions: one wheel or one axle on a fixed body."""

from __future__ import annotations

import numpy as np

from ...mechanism import Mechanism
from ...products import norm
from ..truth import EVERYTHING, Truth
from .drawing import FloatArray, disc, link, unit
from .member import FALL, Theme, member

MEMBERS: Theme = {}
MATSCHINSKY = "W. Matschinsky, Road Vehicle Suspensions"
DIXON = "J. C. Dixon, Suspension Geometry and Computation"


def rod(m: Mechanism, name: str, near: FloatArray, far: FloatArray, carrier: str, spins: bool = False) -> None:
    """A rod from the ground to a carrier: a universal joint and a ball, or two balls about which it `spins`."""
    link(m, name, near, far, density=2.0)
    if spins:
        m.add_spherical(f"{name} in", "ground", name, point=near)
    else:
        along = unit(far - near)
        up = unit(np.cross(along, np.roll(along, 1)))
        m.add_universal(f"{name} in", "ground", name, point=near, axis1=up, axis2=np.cross(along, up))
    m.add_spherical(f"{name} out", name, carrier, point=far)


def arm(m: Mechanism, name: str, front: FloatArray, rear: FloatArray, ball: FloatArray, carrier: str) -> None:
    """A wishbone: a hinge through two points of the ground, a ball at its tip."""
    middle = (front + rear) / 2
    link(m, name, ball, front, rear, density=2.0)
    m.add_revolute(f"{name} hinge", "ground", name, point=middle, axis=rear - front, cut="never")
    m.add_spherical(f"{name} ball", name, carrier, point=ball)


def spring(m: Mechanism, top: FloatArray, body: str, bottom: FloatArray) -> None:
    """A strut between the ground and a point of a body, both given in the world, that pushes with 900 N as drawn."""
    origin = next(item["position"] for item in m.to_spec()["bodies"] if item["name"] == body)
    length, load, stiffness = float(norm(top - bottom)), 900.0, 15e3
    m.add_spring(f"strut of {body}", "ground", top, body, bottom - origin, stiffness=stiffness, damping=150.0,
                 length=length + load / stiffness)  # fmt: skip


def points(**where: tuple[float, float, float]) -> dict[str, FloatArray]:
    """Points in the world, x ahead, y to the left, z up [m]."""
    return {name: np.array(at, dtype=float) for name, at in where.items()}


@member(MEMBERS, "double-wishbone", "double wishbone: two arms and a tie rod that may spin between its balls",
        Truth(2, 0, EVERYTHING, why="Kutzbach: 6 x 4 bodies - 2 x 5 (hinges) - 4 x 3 (balls) = 2, one of them idle",
              source=MATSCHINSKY, idle=("tie rod",)), rates={"lower hinge": 0.5}, gravity=FALL)  # fmt: skip
def double_wishbone(m: Mechanism) -> None:
    """A left front wheel, its upper arm shorter and inclined."""
    p = points(lf=(0.2, 0.35, 0.2), lr=(-0.2, 0.37, 0.21), lb=(0.02, 0.72, 0.18), uf=(0.15, 0.45, 0.47),
               ur=(-0.15, 0.43, 0.45), ub=(-0.02, 0.68, 0.5), ti=(0.12, 0.38, 0.25), to=(0.14, 0.7, 0.24),
               w=(0.0, 0.78, 0.3), top=(0.0, 0.5, 0.75))  # fmt: skip
    link(m, "knuckle", p["w"], p["lb"], p["ub"], p["to"], density=20.0)
    arm(m, "lower", p["lf"], p["lr"], p["lb"], "knuckle")
    arm(m, "upper", p["uf"], p["ur"], p["ub"], "knuckle")
    rod(m, "tie rod", p["ti"], p["to"], "knuckle", spins=True)
    spring(m, p["top"], "lower", p["lb"] + (0.0, -0.08, 0.02))


@member(MEMBERS, "macpherson", "MacPherson strut: an arm below, a strut that slides and turns above",
        Truth(2, 0, EVERYTHING, why="Kutzbach: 6 x 4 bodies - 5 (hinge) - 3 x 3 (balls) - 4 (universal) - 4 (cylinder) "
              "= 2, one of them the piston's idle turn", source=MATSCHINSKY, idle=("piston",)),
        rates={"lower hinge": 0.5}, gravity=FALL)  # fmt: skip
def macpherson(m: Mechanism) -> None:
    """The tube of the strut belongs to the knuckle; its piston is attached to the car body by a ball joint."""
    p = points(lf=(0.2, 0.35, 0.2), lr=(-0.2, 0.37, 0.21), lb=(0.02, 0.72, 0.18), top=(-0.04, 0.58, 0.85),
               ti=(-0.14, 0.38, 0.25), to=(-0.13, 0.7, 0.26), w=(0.0, 0.78, 0.3), tube=(0.0, 0.68, 0.45))  # fmt: skip
    link(m, "knuckle", p["w"], p["lb"], p["tube"], p["to"], density=20.0)
    arm(m, "lower", p["lf"], p["lr"], p["lb"], "knuckle")
    rod(m, "tie rod", p["ti"], p["to"], "knuckle")
    link(m, "piston", p["top"], p["tube"], density=3.0)
    m.add_spherical("top mount", "ground", "piston", point=p["top"])
    m.add_cylindrical("strut", "piston", "knuckle", point=p["tube"], axis=p["top"] - p["tube"])
    spring(m, p["top"] + (0.0, 0.0, 0.02), "knuckle", p["tube"])


@member(MEMBERS, "trailing-arm", "semi-trailing arm: a skew hinge and a wheel, two degrees of freedom, no loop",
        Truth(2, 0, EVERYTHING, why="an open chain of one hinge each, without redundant constraints",
              source=MATSCHINSKY), rates={"pivot": 0.5, "axle": 20.0}, gravity=FALL, samples=1001)  # fmt: skip
def trailing_arm(m: Mechanism) -> None:
    """The hinge runs obliquely below the body, 20 degrees from across."""
    p = points(front=(0.4, 0.2, 0.3), rear=(0.3, 0.5, 0.28), hub=(0.0, 0.6, 0.3), top=(0.05, 0.5, 0.7))
    link(m, "arm", p["front"], p["rear"], p["hub"], density=5.0)
    disc(m, "wheel", p["hub"] + (0.0, 0.08, 0.0), (0, 1, 0), 0.3, 15.0)
    m.add_revolute("pivot", "ground", "arm", point=(p["front"] + p["rear"]) / 2, axis=p["rear"] - p["front"])
    m.add_revolute("axle", "arm", "wheel", point=p["hub"], axis=(0, 1, 0))
    spring(m, p["top"], "arm", p["hub"] + (0.05, -0.1, 0.0))


@member(MEMBERS, "five-link", "five-link suspension: five rods guide a wheel, each takes one of its six degrees of "
                              "freedom",
        Truth(1, 0, EVERYTHING, why="Kutzbach: 6 x 6 bodies - 5 x 4 (universal joints) - 5 x 3 (balls) = 1",
              source="W. Matschinsky, Road Vehicle Suspensions; J. Knapczyk and S. Dzierzek, displacement and force "
              "analysis of five-rod suspension, J. Mech. Des. 117 (1995)"), gravity=FALL)  # fmt: skip
def five_link(m: Mechanism) -> None:
    """Points of a rear wheel, rounded to centimetres."""
    p = points(w=(0.0, 0.75, 0.3), top=(0.03, 0.5, 0.75))
    near = ((0.25, 0.4, 0.2), (-0.2, 0.35, 0.19), (0.15, 0.45, 0.42), (-0.15, 0.43, 0.44), (-0.3, 0.4, 0.28))
    far = ((0.03, 0.7, 0.17), (-0.06, 0.69, 0.18), (0.05, 0.67, 0.43), (-0.04, 0.66, 0.45), (-0.16, 0.7, 0.26))
    link(m, "carrier", p["w"], *far, density=12.0)
    for i in range(5):
        rod(m, f"rod {i + 1}", np.array(near[i]), np.array(far[i]), "carrier")
    spring(m, p["top"], "carrier", np.array(far[1]))


@member(MEMBERS, "watt-axle", "rigid axle on three long rods, guided sideways by Watt's linkage: it heaves and rolls",
        Truth(2, 0, EVERYTHING, why="Kutzbach: the axle's 6 + the lever's rotation - 5 rods = 2",
              source=DIXON), gravity=FALL)  # fmt: skip
def watt_axle(m: Mechanism) -> None:
    """Two rods below, one above, and a lever on the axle between two rods that run sideways."""
    p = points(c=(0.0, 0.0, 0.3), left=(0.0, 0.6, 0.3), right=(0.0, -0.6, 0.3), up=(0.0, 0.1, 0.45),
               pin=(-0.1, 0.0, 0.3), lu=(-0.1, 0.0, 0.4), ld=(-0.1, 0.0, 0.2))  # fmt: skip
    link(m, "axle", p["c"], p["left"], p["right"], p["up"], p["pin"], density=30.0)
    link(m, "lever", p["pin"], p["lu"], p["ld"], density=3.0)
    m.add_revolute("centre", "axle", "lever", point=p["pin"], axis=(1, 0, 0))
    rod(m, "watt left", np.array((-0.1, 0.55, 0.41)), p["lu"], "lever")
    rod(m, "watt right", np.array((-0.1, -0.55, 0.19)), p["ld"], "lever")
    rod(m, "lower left", np.array((0.6, 0.45, 0.27)), p["left"] + (0.0, -0.1, -0.08), "axle")
    rod(m, "lower right", np.array((0.6, -0.45, 0.27)), p["right"] + (0.0, 0.1, -0.08), "axle")
    rod(m, "upper", np.array((0.5, 0.12, 0.47)), p["up"], "axle")
    for side, y in (("left", 0.5), ("right", -0.4)):
        m.add_spring(f"coil {side}", "ground", (0.02, y, 0.8), "axle", (0.0, y, 0.0), stiffness=12e3, damping=100.0,
                     length=0.52)  # fmt: skip
