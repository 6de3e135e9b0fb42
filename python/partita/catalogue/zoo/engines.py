"""Cranks, rods and pistons: in line, opposed, in a V, radial, and on a wobble plate."""

from __future__ import annotations

import cmath
import math

import numpy as np

from ...mechanism import Mechanism
from ...products import matmul
from ..truth import EVERYTHING, Truth, planar
from .drawing import FloatArray, around, block, disc, in_space, link, polar
from .member import Theme, member

MEMBERS: Theme = {}
HEYWOOD = "J. B. Heywood, Internal Combustion Engine Fundamentals; C. F. Taylor, The Internal Combustion Engine"
THROW, ROD, SPACING = 0.04, 0.14, 0.1


def shaft(m: Mechanism, throws: list[FloatArray]) -> None:
    """A crankshaft along z with its crank pins, on one bearing."""
    link(m, "crankshaft", np.zeros(3), *throws, density=4.0)
    m.add_revolute("main", "ground", "crankshaft", point=(0, 0, 0), cut="never")


def cylinder(m: Mechanism, name: str, pin: FloatArray, direction: complex, holder: str = "crankshaft",
             rod: float = ROD) -> None:  # fmt: skip
    """Rod and piston on a crank pin; the piston runs through the shaft's axis along `direction`."""
    z = complex(pin[0], pin[1]) / direction
    wrist = in_space(direction * (z.real + math.sqrt(rod**2 - z.imag**2)), pin[2])
    link(m, f"rod {name}", pin, wrist, density=3.0)
    block(m, f"piston {name}", wrist, mass=0.4, width=0.06)
    m.add_revolute(f"big end {name}", holder, f"rod {name}", point=pin)
    m.add_revolute(f"wrist {name}", f"rod {name}", f"piston {name}", point=wrist)
    m.add_prismatic(f"slide {name}", "ground", f"piston {name}", point=wrist, axis=in_space(direction))


def in_line(m: Mechanism, angles: tuple[float, ...], directions: tuple[complex, ...] = ()) -> None:
    """One cylinder behind the other, crank pins at these angles [deg]."""
    middle = (len(angles) - 1) / 2
    pins = [in_space(polar(THROW, angle), (i - middle) * SPACING) for i, angle in enumerate(angles)]
    shaft(m, pins)
    for i, pin in enumerate(pins):
        cylinder(m, str(i + 1), pin, directions[i] if directions else 1j)


@member(MEMBERS, "engine-inline-two", "two cylinders in line, crank pins opposite",
        planar(5, 7, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def inline_two(m: Mechanism) -> None:
    """Rods and pistons 0.1 m apart along the shaft."""
    in_line(m, (35.0, 215.0))


@member(MEMBERS, "engine-inline-three", "three cylinders in line, crank pins in thirds",
        planar(7, 10, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def inline_three(m: Mechanism) -> None:
    """Pins at 120 degrees."""
    in_line(m, (35.0, 155.0, 275.0))


@member(MEMBERS, "engine-inline-four", "four cylinders in line, crank pins in a plane",
        planar(9, 13, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def inline_four(m: Mechanism) -> None:
    """The outer pins on one side, the inner on the other."""
    in_line(m, (35.0, 215.0, 215.0, 35.0))


@member(MEMBERS, "engine-boxer", "boxer twin: opposite cylinders move against each other",
        planar(5, 7, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def boxer(m: Mechanism) -> None:
    """Crank pins opposite, cylinders as well."""
    in_line(m, (35.0, 215.0), (1.0 + 0j, -1.0 + 0j))


@member(MEMBERS, "engine-v-twin", "V twin: two rods side by side on one crank pin, cylinders at a right angle",
        planar(5, 7, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def v_twin(m: Mechanism) -> None:
    """Cylinders 45 degrees to either side of the upright."""
    pin = in_space(polar(THROW, 20.0))
    shaft(m, [pin])
    cylinder(m, "left", pin, polar(1.0, 135.0))
    cylinder(m, "right", pin, polar(1.0, 45.0))


@member(MEMBERS, "engine-radial-five", "radial engine: a master rod carries four others, five cylinders in a star",
        planar(11, 16, HEYWOOD), rates={"main": 60.0}, samples=1201, seconds=3.0)  # fmt: skip
def radial_five(m: Mechanism) -> None:
    """Knuckle pins 0.03 from the crank pin, in fifths about it; the other rods shorter by as much."""
    pin, up = polar(THROW, 25.0), 1j
    shaft(m, [in_space(pin)])
    z = pin / up
    wrist = up * (z.real + math.sqrt(ROD**2 - z.imag**2))
    along = (wrist - pin) / abs(wrist - pin)
    fifth = [cmath.exp(2j * math.pi * i / 5) for i in range(5)]
    knuckles = [pin + 0.03 * along * turn for turn in fifth]
    link(m, "master rod", in_space(pin), in_space(wrist), *map(in_space, knuckles[1:]), density=3.0)
    block(m, "piston 1", in_space(wrist), mass=0.4, width=0.06)
    m.add_revolute("big end", "crankshaft", "master rod", point=in_space(pin))
    m.add_revolute("wrist 1", "master rod", "piston 1", point=in_space(wrist))
    m.add_prismatic("slide 1", "ground", "piston 1", point=in_space(wrist), axis=in_space(up))
    for i in range(1, 5):
        cylinder(m, str(i + 1), in_space(knuckles[i]), up * fifth[i], holder="master rod", rod=ROD - 0.03)


@member(MEMBERS, "wobble-plate", "wobble plate: an inclined journal tilts a plate round and round, four pistons follow",
        Truth(1, 0, EVERYTHING,
              why="shaft and plate have two rotations, of which the plane of the peg removes one; a P-U-S chain has "
              "six degrees of freedom and removes none from the plate",
              source="K. Kutzbach, Mechanische Leitungsverzweigung, 1929"),
        rates={"main": 20.0}, samples=401, seconds=3.0)  # fmt: skip
def wobble_plate(m: Mechanism) -> None:
    """Shaft along z, journal inclined by 15 degrees about a point of its axis; a peg of the plate stays in a plane."""
    tilt = around((1, 0, 0), 15.0)
    disc(m, "shaft", (0, 0, 0), (0, 0, 1), 0.08, 2.0)
    disc(m, "plate", (0, 0, 0), matmul(tilt, (0, 0, 1)), 0.1, 1.0)
    m.add_revolute("main", "ground", "shaft", point=(0, 0, -0.1), cut="never")
    m.add_revolute("journal", "shaft", "plate", point=(0, 0, 0), axis=matmul(tilt, (0, 0, 1)))
    peg = matmul(tilt, (0, 0.12, 0))
    m.add_joint("guide", "ground", "plate", free=("y", "z", "rx", "ry", "rz"), point=peg)
    for i in range(4):
        ball = matmul(matmul(tilt, around((0, 0, 1), 45.0 + 90.0 * i)), (0.09, 0, 0))
        x, y = around((0, 0, 1), 45.0 + 90.0 * i)[:2, 0] * 0.09
        wrist = np.array([x, y, ball[2] + math.sqrt(0.15**2 - (x - ball[0]) ** 2 - (y - ball[1]) ** 2)])
        link(m, f"rod {i + 1}", ball, wrist, density=2.0)
        block(m, f"piston {i + 1}", wrist, mass=0.2, width=0.05)
        m.add_spherical(f"ball {i + 1}", "plate", f"rod {i + 1}", point=ball)
        m.add_universal(f"wrist {i + 1}", f"piston {i + 1}", f"rod {i + 1}", point=wrist, axis1=(1, 0, 0),
                        axis2=(0, 1, 0))  # fmt: skip
        m.add_prismatic(f"slide {i + 1}", "ground", f"piston {i + 1}", point=wrist, axis=(0, 0, 1))
