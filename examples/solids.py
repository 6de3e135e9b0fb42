"""Ten mechanisms of bodies with form: discs, plates, boxes, extrusions, shells and turned parts.

Run it with `.venv/bin/python examples/solids.py [FOLDER]`. Each mechanism has one number that textbooks know, worked
out here from the lengths alone, without the package; the exit code is 1 if one is missed. With a folder it writes a
page of each run.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

import partita as pt
from partita.results import Result

G = 9.81
STEEL, ALUMINIUM, OAK = 7850.0, 2700.0, 700.0
NEAR = 1e-8
"""Known values are met to this. Scale: fraction of them. Reason: runs are integrated to 1e-10."""
TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}
UPRIGHT = (0.0, -G, 0.0)
s = pt.shapes


class Case(NamedTuple):
    """A mechanism, its run, and what is compared."""

    mechanism: pt.Mechanism
    run: Result
    what: str
    found: float
    known: float


def frequency(m: pt.Mechanism, near: float) -> float:
    """The natural frequency [Hz] of the drawing that is nearest to another one."""
    found = m.linearize().modes().frequency
    return float(found[np.argmin(np.abs(found - near))])


def pendulum() -> Case:
    """A plate swings on a pin through its upper hole."""
    long, wide, thick, hole = 0.3, 0.04, 0.005, 0.006
    m = pt.Mechanism("plate pendulum", gravity=UPRIGHT)
    outline = [(-wide / 2, -long + 0.02), (wide / 2, -long + 0.02), (wide / 2, 0.02), (-wide / 2, 0.02)]
    plate = m.add_solid("plate", s.Plate(outline, thick, holes=[((0, 0), hole)]), material="steel")
    m.add_revolute("pin", m.ground, plate, point=(0, 0, 0))
    whole, drilled = STEEL * long * wide * thick, STEEL * math.pi * hole**2 * thick
    below = long / 2 - 0.02
    inertia = whole * ((long**2 + wide**2) / 12 + below**2) - drilled * hole**2 / 2
    known = math.sqrt(whole * G * below / inertia) / (2 * math.pi)
    run = m.simulate(3.0, initial=m.assemble(targets={"pin": 0.4}), **TIGHT)
    return Case(m, run, "frequency [Hz]", frequency(m, known), known)


def flywheel() -> Case:
    """A disc speeds up under a torque."""
    radius, thick, torque, time = 0.1, 0.02, 2.0, 3.0
    m = pt.Mechanism("flywheel", gravity=None)
    wheel = m.add_solid("wheel", s.Disc(radius, thick), material="steel")
    axle = m.add_revolute("axle", m.ground, wheel, point=(0, 0, 0))
    m.add_torque(axle, torque)
    run = m.simulate(time, **TIGHT)
    known = torque * time / (STEEL * math.pi * radius**2 * thick * radius**2 / 2)
    return Case(m, run, "speed [rad/s]", float(run.joint("axle").velocity[-1, 0]), known)


def slider_crank() -> Case:
    """A disc as crank, a plate with two holes as rod, a box as slider: the speed follows from the kinetic energy."""
    r, rod_length, start = 0.05, 0.2, 30.0
    m = pt.Mechanism("slider-crank", gravity=None)
    wheel = m.add_solid("wheel", s.Disc(0.08, 0.012), material="steel")
    link = s.Plate([(-0.02, -0.012), (0.22, -0.012), (0.22, 0.012), (-0.02, 0.012)], 0.006,
                   holes=[((0, 0), 0.005), ((rod_length, 0), 0.005)])  # fmt: skip
    rod = m.add_solid("rod", link, material="aluminium", position=(r, 0, 0.01))
    block = m.add_solid("block", s.Box((0.06, 0.04, 0.03)), mass="0.4 kg", position=(r + rod_length, 0, 0.03))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0))
    m.add_revolute("B", wheel, rod, point=(r, 0, 0.01))
    m.add_revolute("C", rod, block, point=(r + rod_length, 0, 0.01))
    m.add_prismatic("D", m.ground, block, point=(r + rod_length, 0, 0.03), axis="x")
    run = m.simulate(0.5, initial=m.assemble(rates={"A": start}), **TIGHT)
    disc = STEEL * math.pi * 0.08**2 * 0.012 * 0.08**2 / 2
    whole, hole = ALUMINIUM * 0.24 * 0.024 * 0.006, ALUMINIUM * math.pi * 0.005**2 * 0.006
    mass = whole - 2 * hole
    inertia = whole * (0.24**2 + 0.024**2) / 12 - 2 * hole * (0.005**2 / 2 + (rod_length / 2) ** 2)

    def moved(angle: float) -> float:
        """The inertia that the crank moves."""
        lean = -r * math.cos(angle) / math.sqrt(rod_length**2 - (r * math.sin(angle)) ** 2)
        x = -r * math.sin(angle) + r * math.sin(angle) * lean
        middle = (-r * math.sin(angle) + r * math.sin(angle) * lean / 2, r * math.cos(angle) / 2)
        return disc + inertia * lean**2 + mass * (middle[0] ** 2 + middle[1] ** 2) + 0.4 * x**2

    known = start * math.sqrt(moved(0.0) / moved(float(run.joint("A").angle[-1])))
    return Case(m, run, "speed [rad/s]", float(run.joint("A").velocity[-1, 0]), known)


def rolling_tube() -> Case:
    """A tube rolls down a plane at 17 degrees."""
    outer, inner, slope, time = 0.05, 0.04, 0.3, 1.0
    m = pt.Mechanism("rolling tube", gravity=(G * math.sin(slope), -G * math.cos(slope), 0.0))
    tube = m.add_solid("tube", s.Cylinder(outer, 0.2, inner_radius=inner), material="brass", position=(0, outer, 0))
    m.add_planar("upright", m.ground, tube, point=(0, outer, 0), normal="z")
    m.add_rolling("road", tube, radius=tube.shape)
    run = m.simulate(time, **TIGHT)
    known = 0.5 * time**2 * G * math.sin(slope) / (1.0 + 0.5 * (outer**2 + inner**2) / outer**2)
    return Case(m, run, "way [m]", float(run.body("tube").position[-1, 0]), known)


def balance() -> Case:
    """A square tube as beam, and a box on each of its ends, swings on a knife-edge above."""
    long, side, wall, up, box, out = 1.0, 0.03, 0.002, 0.05, (0.08, 0.1, 0.06), 0.45
    m = pt.Mechanism("balance", gravity=UPRIGHT)
    half, hollow = side / 2, side / 2 - wall
    square = [(-half, -half), (half, -half), (half, half), (-half, half)]
    bore = [(-hollow, -hollow), (hollow, -hollow), (hollow, hollow), (-hollow, hollow)]
    along = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # its z is the x of the world
    profile = s.Extrusion(square, long, holes=[bore])
    beam = m.add_solid("beam", profile, material="aluminium", position=(-long / 2, 0, 0), orientation=along)
    for name, x in (("left", -out), ("right", out)):
        pan = m.add_solid(name, s.Box(box), material="oak", position=(x, -half - box[1] / 2, 0))
        m.add_fixed(f"{name} glue", beam, pan, point=(x, -half, 0))
    m.add_revolute("edge", m.ground, beam, point=(0, up, 0))
    area = side**2 - (side - 2 * wall) ** 2
    mass, pan_mass = ALUMINIUM * area * long, OAK * box[0] * box[1] * box[2]
    across = ALUMINIUM * long * (side**4 - (side - 2 * wall) ** 4) / 12
    low = up + half + box[1] / 2
    inertia = mass * long**2 / 12 + across + mass * up**2
    inertia += 2 * pan_mass * ((box[0] ** 2 + box[1] ** 2) / 12 + out**2 + low**2)
    known = math.sqrt(G * (mass * up + 2 * pan_mass * low) / inertia) / (2 * math.pi)
    run = m.simulate(5.0, initial=m.assemble(targets={"edge": 0.1}), **TIGHT)
    return Case(m, run, "frequency [Hz]", frequency(m, known), known)


def gears() -> Case:
    """A small disc drives a large one."""
    small, large, thick, torque, time = 0.03, 0.09, 0.01, 0.05, 2.0
    m = pt.Mechanism("gears", gravity=None)
    first = m.add_solid("pinion", s.Disc(small, thick), material="steel")
    second = m.add_solid("wheel", s.Disc(large, thick), material="steel", position=(small + large, 0, 0))
    m.add_revolute("A", m.ground, first, point=(0, 0, 0))
    m.add_revolute("B", m.ground, second, point=(small + large, 0, 0))
    m.add_gear("A", "B", ratio=-small / large)
    m.add_torque("A", torque)
    run = m.simulate(time, **TIGHT)
    inertia = STEEL * math.pi * thick / 2 * (small**4 + large**4 * (small / large) ** 2)
    return Case(m, run, "speed [rad/s]", float(run.joint("A").velocity[-1, 0]), torque * time / inertia)


def top() -> Case:
    """A cone turns freely about its centre of mass: its axis goes around the angular momentum, |L| / I."""
    radius, height, time = 0.04, 0.12, 1.0
    m = pt.Mechanism("free top", gravity=None)
    cone = m.add_solid("cone", s.Revolution([(0, 0), (radius, 0), (0, height)]), material="brass")
    m.add_spherical("centre", m.ground, cone, point=(0, 0, height / 4))
    start = np.array([3.0, 0.0, 25.0])
    run = m.simulate(time, initial=m.assemble(rates={"centre": start}), **TIGHT)
    across, axial = 3 / 20 * radius**2 + 3 / 80 * height**2, 0.3 * radius**2  # per mass
    momentum = np.array([across, across, axial]) * start
    size = float(np.linalg.norm(momentum))
    around, turn = momentum / size, size / across * time
    axis = np.array([0.0, 0.0, 1.0])
    beside = np.cross(around, axis) * math.sin(turn) + around * (around @ axis) * (1 - math.cos(turn))
    known = axis * math.cos(turn) + beside
    return Case(m, run, "axis, its x", float(run.body("cone").rotation[-1, 0, 2]), float(known[0]))


def tailgate() -> Case:
    """A hollow lid on a hinge, held up by a gas strut."""
    long, wide, thick, wall = 0.8, 1.0, 0.04, 0.001
    foot, eye = (0.05, -0.3), 0.3
    sheet: dict[str, Any] = {"force": 84.0, "progression": 1.3, "stroke": 0.25, "length": 0.55}
    m = pt.Mechanism("tailgate", gravity=UPRIGHT)
    hollow = s.Shell(s.Box((long, thick, wide)), wall)
    lid = m.add_solid("lid", hollow, material="aluminium", position=(long / 2, 0, 0))
    m.add_revolute("hinge", m.ground, lid, point=(0, 0, 0))
    m.add_gas_strut("strut", m.ground, (*foot, 0.4), lid, (eye - long / 2, 0, 0.4), **sheet, damping=200.0)
    whole = long * wide * thick - (long - 2 * wall) * (wide - 2 * wall) * (thick - 2 * wall)
    column = sheet["stroke"] / (1.0 - sheet["progression"] ** (-1.0 / 1.3))

    def moment(angle: float) -> float:
        """Of the weight and the gas about the hinge."""
        tip = eye * np.array([math.cos(angle), math.sin(angle)])
        line = tip - foot
        length = float(np.linalg.norm(line))
        push = sheet["force"] * (1.0 - (sheet["length"] - length) / column) ** -1.3
        lift = push / length * (tip[0] * line[1] - tip[1] * line[0])
        return float(lift - ALUMINIUM * whole * G * long / 2 * math.cos(angle))

    run = m.simulate(8.0, **TIGHT)
    found = m.equilibrium(run.state(8.0)).state.position("hinge")
    return Case(m, run, "opens to [rad]", float(found), float(brentq(moment, 0.1, 0.6, xtol=1e-14)))


def dumbbell() -> Case:
    """Two balls on a bar turn against a torsion spring."""
    ball, out, bar, stiffness = 0.03, 0.15, 0.006, 0.8
    m = pt.Mechanism("torsion pendulum", gravity=None)
    weight = s.Sphere(ball)
    turned = s.Cylinder(bar, 2 * (out - ball)).at(orientation=[[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    both = m.add_solid("dumbbell", turned + weight.at((out, 0, 0)) + weight.at((-out, 0, 0)), material="steel")
    wire = m.add_revolute("wire", m.ground, both, point=(0, 0, 0), axis="z")
    m.add_torsion_spring(wire, stiffness=stiffness)
    mass, rod = STEEL * 4 / 3 * math.pi * ball**3, STEEL * math.pi * bar**2 * 2 * (out - ball)
    inertia = 2 * mass * (0.4 * ball**2 + out**2) + rod * (bar**2 / 4 + (2 * (out - ball)) ** 2 / 12)
    known = math.sqrt(stiffness / inertia) / (2 * math.pi)
    run = m.simulate(3.0, initial=m.assemble(targets={"wire": 0.5}), **TIGHT)
    return Case(m, run, "frequency [Hz]", frequency(m, known), known)


def bifilar() -> Case:
    """A board hangs by two long threads, and turns about the upright between them: how inertias are measured."""
    size, out, long = (0.4, 0.02, 0.2), 0.15, 1.2
    m = pt.Mechanism("bifilar pendulum", gravity=UPRIGHT)
    board = m.add_solid("board", s.Box(size), material="oak")
    for name, x in (("left", -out), ("right", out)):
        m.add_distance(name, m.ground, (x, long, 0), board, (x, 0, 0))
    known = math.sqrt(G * out**2 / (long * (size[0] ** 2 + size[2] ** 2) / 12)) / (2 * math.pi)
    run = m.simulate(4.0, initial=m.assemble(rates={"board.wy": 0.4}), **TIGHT)
    return Case(m, run, "frequency [Hz]", frequency(m, known), known)


CASES: tuple[Callable[[], Case], ...] = (
    pendulum, flywheel, slider_crank, rolling_tube, balance, gears, top, tailgate, dumbbell, bifilar,
)  # fmt: skip


def main(folder: Path | None) -> int:
    """Print each number beside the known one; 1 if one is missed."""
    right = True
    for make in CASES:
        case = make()
        error = abs(case.found / case.known - 1.0)
        right &= error < NEAR and case.run.success
        print(f"{case.mechanism.name:<18} {case.what:<16} {case.found:>13.9f} {case.known:>13.9f} {error:>8.0e}")
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            case.run.to_html(folder / f"{case.mechanism.name.replace(' ', '-')}.html")
    print("all as known" if right else "one was missed")
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
