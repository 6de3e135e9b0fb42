"""Gears, racks, screws, belts, cams and rods: coupled joints."""

from __future__ import annotations

import numpy as np

from ...mechanism import Mechanism
from ...products import matmul
from ..truth import EVERYTHING, Truth
from .drawing import around, block, disc, link, meet, polar
from .member import FALL, Theme, member

MEMBERS: Theme = {}
DUBBEL = "Dubbel, Handbook of Mechanical Engineering"
MUELLER = "H. W. Mueller, Epicyclic Drive Trains"
Z = (0.0, 0.0, 1.0)


@member(MEMBERS, "gear-pair", "gear pair: a motor at constant speed turns an unbalanced wheel through a pinion",
        Truth(0, 0, EVERYTHING, why="2 rotations - 1 mesh - 1 drive = 0", source=DUBBEL),
        rates={"pinion shaft": 12.0}, samples=801)  # fmt: skip
def gear_pair(m: Mechanism) -> None:
    """Radii 0.08 and 0.2 that mesh outside; the wheel carries an arm."""
    disc(m, "pinion", (0, 0, 0), Z, 0.08, 1.0)
    link(m, "wheel", (0.28, 0.0, 0.0), (0.28, 0.2, 0.05), density=10.0)
    m.add_revolute("pinion shaft", "ground", "pinion", point=(0, 0, 0))
    m.add_revolute("wheel shaft", "ground", "wheel", point=(0.28, 0, 0))
    m.add_gear("pinion shaft", "wheel shaft", ratio=-0.08 / 0.2)
    m.add_drive("pinion shaft", velocity=12.0)


@member(MEMBERS, "planetary-gear", "planetary gear: three planets between the sun and a ring that stands still",
        Truth(1, 2, EVERYTHING, why="5 rotations; 6 meshes, of which two planets repeat the first: the distribution of "
              "load over the teeth is undetermined, which does not affect the hinges; 5 - (6 - 2) = 1", source=MUELLER),
        rates={"carrier": 5.0}, samples=801)  # fmt: skip
def planetary_gear(m: Mechanism) -> None:
    """Sun 0.06, planets 0.04, ring 0.14; the carrier lifts an arm. The rotation of a planet is relative to the
    carrier."""
    sun, planet, ring = 0.06, 0.04, 0.14
    disc(m, "sun", (0, 0, 0), Z, sun, 0.8)
    link(m, "carrier", (0, 0, 0), (0.25, 0.05, 0), density=4.0)
    m.add_revolute("sun", "ground", "sun", point=(0, 0, 0))
    m.add_revolute("carrier", "ground", "carrier", point=(0, 0, 0))
    for i in (1, 2, 3):
        at = matmul(around(Z, 120.0 * i), (sun + planet, 0.0, 0.0))
        disc(m, f"planet {i}", at, Z, planet, 0.4)
        m.add_revolute(f"planet {i}", "carrier", f"planet {i}", point=at)
        m.add_coupler(f"inner mesh {i}", ["sun", "carrier", f"planet {i}"], [sun, -sun, planet], word="gear")
        m.add_coupler(f"outer mesh {i}", ["carrier", f"planet {i}"], [ring, planet], word="gear")


@member(MEMBERS, "car-differential", "differential: a shaft drives the cage, two unlike wheels share its torque",
        Truth(2, 0, EVERYTHING, why="4 rotations - the bevel pair - the sum in the cage = 2", source=DUBBEL),
        rates={"left shaft": 6.0, "right shaft": 4.0}, gravity=FALL, samples=1001)  # fmt: skip
def car_differential(m: Mechanism) -> None:
    """The propeller shaft along x, all else along y; an engine's torque on the shaft, the left wheel unbalanced."""
    across = (0.0, 1.0, 0.0)
    disc(m, "propeller", (-0.3, 0, 0), (1, 0, 0), 0.05, 2.0)
    disc(m, "cage", (0, 0, 0), across, 0.12, 5.0)
    link(m, "left wheel", (0.0, 0.7, 0.0), (0.3, 0.72, 0.0), density=20.0)
    disc(m, "right wheel", (0.0, -0.7, 0.0), across, 0.3, 12.0)
    m.add_revolute("propeller shaft", "ground", "propeller", point=(-0.3, 0, 0), axis=(1, 0, 0))
    m.add_revolute("cage bearing", "ground", "cage", point=(0, 0, 0), axis=across)
    m.add_revolute("left shaft", "ground", "left wheel", point=(0, 0.7, 0), axis=across)
    m.add_revolute("right shaft", "ground", "right wheel", point=(0, -0.7, 0), axis=across)
    m.add_gear("propeller shaft", "cage bearing", ratio=1.0 / 3.7, name="bevel pair")
    m.add_coupler("bevel gears", ["left shaft", "right shaft", "cage bearing"], [1, 1, -2], word="differential")
    m.add_torque("propeller shaft", 0.4)


@member(MEMBERS, "rack-steering", "rack and pinion steering: tie rods from the rack turn two knuckles",
        Truth(1, 0, EVERYTHING, why="4 degrees of freedom of the joints - the rack's mesh - 2 rods = 1",
              source="W. Matschinsky, Road Vehicle Suspensions"), rates={"column": 3.0}, gravity=FALL)  # fmt: skip
def rack_steering(m: Mechanism) -> None:
    """Inclined king pins; the massless rods rise slightly outwards. A spring returns the rack."""
    link(m, "pinion", (-0.1, 0.1, 0.4), (-0.25, 0.1, 0.55), (-0.25, 0.22, 0.5), density=4.0)
    block(m, "rack", (-0.1, 0.0, 0.3), 3.0, 0.1)
    m.add_revolute("column", "ground", "pinion", point=(-0.1, 0.1, 0.4), axis=(-1, 0, 1))
    m.add_prismatic("rack guide", "ground", "rack", point=(-0.1, 0, 0.3), axis=(0, 1, 0))
    m.add_rack("column", "rack guide", radius=0.012, name="mesh")
    for side, s in (("left", 1.0), ("right", -1.0)):
        pin, hub, tip = (np.array((x, s * y, z)) for x, y, z in ((0, 0.68, 0.3), (0, 0.78, 0.31), (-0.14, 0.66, 0.33)))
        link(m, f"{side} knuckle", pin, hub, tip, density=30.0)
        m.add_revolute(f"{side} king pin", "ground", f"{side} knuckle", point=pin, axis=(-0.08, -0.2 * s, 1.0))
        m.add_distance(f"{side} tie rod", "rack", (0.0, 0.3 * s, 0.0), f"{side} knuckle", tip - pin)
    m.add_torsion_spring("rack guide", stiffness=6e3, damping=0.0)


@member(MEMBERS, "screw-press", "screw press: a flywheel turns the spindle in a nut that a guide keeps from turning",
        Truth(1, 4, {"*": "fz mz"}, why="Kutzbach: 1 + 1 + 1 degrees of freedom of the joints - 6 of the loop = -3; "
              "spindle, thread and guide on one line impose four redundant constraints across it: a self-stress has "
              "any force and any moment perpendicular to that line", source=DUBBEL),
        rates={"bearing": 20.0}, gravity=FALL, samples=801)  # fmt: skip
def screw_press(m: Mechanism) -> None:
    """The thread is not self-locking: 60 mm per turn. The ram works against a spring."""
    disc(m, "spindle", (0, 0, 1.0), Z, 0.2, 15.0)
    block(m, "ram", (0, 0, 0.4), 30.0, 0.3)
    m.add_revolute("bearing", "ground", "spindle", point=(0, 0, 1.0))
    m.add_screw("thread", "spindle", "ram", point=(0, 0, 0.5), axis=Z, pitch=0.06)
    m.add_prismatic("guide", "ground", "ram", point=(0, 0, 0.4), axis=Z)
    m.add_torsion_spring("guide", stiffness=5e3, damping=0.0)


@member(MEMBERS, "belt-drive", "belt drive: an open and a crossed belt over three pulleys",
        Truth(1, 0, EVERYTHING, why="3 rotations - 2 belts = 1", source=DUBBEL), rates={"A": 4.0})  # fmt: skip
def belt_drive(m: Mechanism) -> None:
    """Radii 0.1, 0.25 and 0.15; an arm on the last pulley swings against a torsion spring."""
    disc(m, "pulley 1", (0, 0, 0), Z, 0.1, 1.0)
    disc(m, "pulley 2", (0.8, 0.1, 0), Z, 0.25, 4.0)
    link(m, "pulley 3", (1.5, 0.0, 0.0), (1.7, 0.05, 0.02), density=5.0)
    for name, i, x, y in (("A", 1, 0.0, 0.0), ("B", 2, 0.8, 0.1), ("C", 3, 1.5, 0.0)):
        m.add_revolute(name, "ground", f"pulley {i}", point=(x, y, 0))
    m.add_belt("A", "B", radius1=0.1, radius2=0.25)
    m.add_belt("B", "C", radius1=0.25, radius2=0.15, crossed=True)
    m.add_torsion_spring("B", stiffness=3.0, damping=0.0)


@member(MEMBERS, "cam-rocker", "plate cam by a table: it lifts a tappet, and a rod without mass rocks a valve lever",
        Truth(1, 0, EVERYTHING, why="3 degrees of freedom of the joints - the cam - the rod = 1",
              source="R. L. Norton, Cam Design and Manufacturing Handbook"), rates={"camshaft": 6.0})  # fmt: skip
def cam_rocker(m: Mechanism) -> None:
    """The lift, 12 mm, sampled at each tenth of a degree; a tappet, a push rod, a lever against a spring."""
    angles = np.linspace(0.0, 2.0 * np.pi, 3601)
    top, pivot = 0.3j, 0.15 + 0.55j
    end = meet(top, pivot, 0.25, 0.12, side=1)
    disc(m, "cam", (0, 0, 0), Z, 0.05, 2.0)
    block(m, "tappet", (0.0, 0.3, 0.0), 0.3, 0.04)
    valve = pivot + polar(0.15, 10.0)
    link(m, "lever", *((z.real, z.imag, 0.0) for z in (pivot, end, valve)), density=2.0)
    m.add_revolute("camshaft", "ground", "cam", point=(0, 0, 0))
    m.add_prismatic("guide", "ground", "tappet", point=(0, 0.2, 0), axis=(0, 1, 0))
    m.add_revolute("rocker", "ground", "lever", point=(pivot.real, pivot.imag, 0))
    lift = 0.012 * np.sin(angles / 2.0) ** 4
    m.add_cam("guide", "camshaft", (angles, lift), periodic=True, name="cam face")
    m.add_distance("push rod", "tappet", (0, 0, 0), "lever", ((end - pivot).real, (end - pivot).imag, 0.0))
    m.add_torsion_spring("rocker", stiffness=20.0, damping=0.0, angle=0.1)


@member(MEMBERS, "cv-shaft", "two shafts that bend by 25 degrees, on a constant-velocity joint",
        Truth(1, 3, {"CV": "mx my mz", "*": "mz"}, axes="joint",
              why="the two axes meet at the centre of the joint, which both keep at rest: its three constraints on "
              "position are redundant; a self-stress is any force through the centre, with its moments in the bearings "
              "beside it",
              source="H. C. Seherr-Thoss, F. Schmelz, E. Aucktor, Universal Joints and Driveshafts"),
        rates={"in": 8.0}, gravity=FALL)  # fmt: skip
def cv_shaft(m: Mechanism) -> None:
    """Bearings 0.3 m from the centre; the output carries an arm."""
    bend = around(Z, 25.0)
    along = matmul(bend, (1.0, 0.0, 0.0))
    disc(m, "input", (-0.3, 0, 0), (1, 0, 0), 0.1, 2.0)
    link(m, "output", 0.3 * along, 0.35 * along + (0.0, 0.0, -0.2), density=5.0)
    m.add_revolute("in", "ground", "input", point=(-0.3, 0, 0), axis=(1, 0, 0))
    m.add_revolute("out", "ground", "output", point=0.3 * along, axis=along)
    m.add_constant_velocity("CV", "input", "output", point=(0, 0, 0), axis=(1, 0, 0), child_frame=bend)


@member(MEMBERS, "hexaglide", "Hexaglide: a platform on six rods without mass, their feet slide on three rails",
        Truth(6, 0, EVERYTHING, why="6 of the platform + 6 slides - 6 rods = 6",
              source="J.-P. Merlet, Parallel Robots; M. Honegger, A. Codourey, E. Burdet, Adaptive control of the "
              "Hexaglide, ICRA 1997"), rates={"pose": (0.2, -0.1, 0.3, 0.5, 0.3, -0.8)}, gravity=FALL,
        samples=601)  # fmt: skip
def hexaglide(m: Mechanism) -> None:
    """Rails along x, two feet on each; springs stand in for the drives."""
    heads = [np.array((0.25 * np.cos(a), 0.25 * np.sin(a), 0.6)) for a in np.radians((30, 90, 150, 210, 270, 330))]
    link(m, "platform", (0, 0, 0.6), *heads, density=6.0)
    m.add_free("pose", "ground", "platform", point=(0, 0, 0.6), cut="never")
    for i, head in enumerate(heads):
        foot = np.array((-0.5 if i in (1, 2, 3) else 0.45, (0.5, 0.1, 0.6, -0.5, -0.1, -0.6)[i], 0.0))
        block(m, f"foot {i + 1}", foot, 1.5, 0.1)
        m.add_prismatic(f"rail {i + 1}", "ground", f"foot {i + 1}", point=foot, axis=(1, 0, 0))
        m.add_distance(f"rod {i + 1}", f"foot {i + 1}", (0, 0, 0), "platform", head - (0.0, 0.0, 0.6))
        m.add_torsion_spring(f"rail {i + 1}", stiffness=800.0, damping=0.0)
