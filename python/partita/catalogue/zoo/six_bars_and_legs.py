"""Six-bars, named by their fixed link, and walking linkages."""

from __future__ import annotations

from ...mechanism import Mechanism
from ..truth import planar
from .drawing import beside, linkage, meet, polar
from .member import Theme, member

MEMBERS: Theme = {}
SIX_BARS = "A. S. Hall, Kinematics and Linkage Design; J. M. McCarthy, Geometric Design of Linkages"


@member(MEMBERS, "watt-one", "Watt I: two ternary links pinned together, the ground one of the binary links",
        planar(5, 7, SIX_BARS), rates={"A": 8.0}, samples=601)  # fmt: skip
def watt_one(m: Mechanism) -> None:
    """A crank-rocker whose coupler and rocker carry two more links between them."""
    b, d = polar(0.25, 70.0), 0.8 + 0j
    c = meet(b, d, 0.7, 0.6)
    e, f = beside(b, c, 0.35, 0.4), beside(d, c, 0.8, -0.2)
    g = meet(e, f, 0.5, 0.45)
    points = {"A": 0j, "B": b, "C": c, "D": d, "E": e, "F": f, "G": g}
    links = {"crank": "A B", "coupler": "B C E", "rocker": "D C F", "upper": "E G", "side": "F G"}
    linkage(m, points, links, ground="A D")


@member(MEMBERS, "stephenson-one", "Stephenson I: the ground joins two ternary links that two more paths connect",
        planar(5, 7, SIX_BARS), rates={"A": 1.0})  # fmt: skip
def stephenson_one(m: Mechanism) -> None:
    """Two bell cranks: one path of one link, one of two."""
    a, d = 0j, 0.6 + 0j
    b, e = polar(0.3, -100.0), d + polar(0.35, -75.0)
    c, f = polar(0.3, -20.0), d + polar(0.3, 30.0)
    points = {"A": a, "B": b, "C": c, "D": d, "E": e, "F": f, "G": meet(c, f, 0.5, 0.5)}
    links = {"left": "A B C", "right": "D E F", "tie": "B E", "upper left": "C G", "upper right": "F G"}
    linkage(m, points, links, ground="A D")


@member(MEMBERS, "stephenson-two", "Stephenson II: the ground lies in the long path between two ternary links",
        planar(5, 7, SIX_BARS), rates={"D": 6.0})  # fmt: skip
def stephenson_two(m: Mechanism) -> None:
    """A crank at D moves the floating ternary link, whose two connecting links swing the other one about A."""
    d, a = 0j, 0.7 - 0.1j
    g = polar(0.12, 40.0)
    e, f = g + 0.45 + 0.1j, g + 0.5 + 0.45j
    b = meet(e, a, 0.25, 0.3, side=-1)
    c = beside(a, b, 0.15, -0.35)
    points = {"A": a, "B": b, "C": c, "D": d, "E": e, "F": f, "G": g}
    links = {"crank": "D G", "floating": "G E F", "swinging": "A B C", "tie 1": "B E", "tie 2": "C F"}
    linkage(m, points, links, ground="A D")


@member(MEMBERS, "klann-leg", "Klann's leg: a crank lifts and sets down a foot, six links",
        planar(5, 7, "J. C. Klann, US patent 6260862, 2001"), rates={"M": 10.0})  # fmt: skip
def klann_leg(m: Mechanism) -> None:
    """In units of 0.1 m about the crank's pivot, own proportions; the crank makes full turns: 1 + 3.07 < 2.8 + 1.7."""
    unit, crank = 0.1, polar(1.0, 30.0)
    lower, upper = -2.9 - 1.0j, -2.0 + 3.0j
    elbow = meet(crank, lower, 2.8, 1.7, side=-1)
    hip = beside(crank, elbow, 4.6, -0.6)
    knee = meet(hip, upper, 2.4, 2.0, side=-1)
    foot = beside(knee, hip, 7.5, 0.6)
    points = {"M": 0j, "C": crank, "E": elbow, "A": lower, "H": hip, "K": knee, "B": upper, "F": foot}
    links = {"crank": "M C", "connecting arm": "C E H", "lower rocker": "A E", "upper rocker": "B K",
             "leg": "K H F"}  # fmt: skip
    linkage(m, {name: unit * z for name, z in points.items()}, links, ground="M A B")


JANSEN = {"a": 38.0, "b": 41.5, "c": 39.3, "d": 40.1, "e": 55.8, "f": 39.4, "g": 36.7, "h": 65.7, "i": 49.0,
          "j": 50.0, "k": 61.9, "l": 7.8, "m": 15.0}  # fmt: skip
"""Jansen's eleven numbers and the place of the crank."""


def jansen(points: dict[str, complex], links: dict[str, str], name: str, mirrored: bool) -> None:
    """One leg on the crank pin P, to the left or mirrored to the right; its points and links get `name`."""
    n, unit = JANSEN, 0.01

    def seen(z: complex) -> complex:
        return complex(-z.real, z.imag) if mirrored else z

    pin = seen(points["P"]) / unit
    pivot = complex(-n["a"], -n["l"])
    top = meet(pin, pivot, n["j"], n["b"], side=-1)
    low = meet(pin, pivot, n["k"], n["c"], side=1)
    back = meet(top, pivot, n["e"], n["d"], side=-1)
    knee = meet(back, low, n["f"], n["g"], side=-1)
    foot = meet(knee, low, n["h"], n["i"], side=-1)
    here = {"B": pivot, "T": top, "L": low, "S": back, "K": knee, "F": foot}
    points.update({f"{letter}{name}": seen(z) * unit for letter, z in here.items()})
    held = {"j": "P T", "k": "P L", "triangle bde": "B T S", "c": "B L", "f": "S K", "triangle ghi": "L K F"}
    for link, ends in held.items():
        links[f"{link} {name}".strip()] = " ".join(end if end == "P" else f"{end}{name}" for end in ends.split())


@member(MEMBERS, "jansen-leg", "Theo Jansen's leg: the eleven holy numbers of the beach animals",
        planar(7, 10, "T. Jansen, The Great Pretender, 2007"), rates={"O": 10.0}, samples=601)  # fmt: skip
def jansen_leg(m: Mechanism) -> None:
    """In parts of 0.01 m, the crank 0.15."""
    points, links = {"O": 0j, "P": polar(0.15, 20.0)}, {"crank": "O P"}
    jansen(points, links, "", mirrored=False)
    linkage(m, points, links, ground="O B")


@member(MEMBERS, "jansen-pair", "two of Jansen's legs, mirror images on one crank",
        planar(13, 19, "T. Jansen, The Great Pretender, 2007"), rates={"O": 10.0}, samples=801)  # fmt: skip
def jansen_pair(m: Mechanism) -> None:
    """As the beach animals have them: fore and hind leg."""
    points, links = {"O": 0j, "P": polar(0.15, 20.0)}, {"crank": "O P"}
    jansen(points, links, "l", mirrored=False)
    jansen(points, links, "r", mirrored=True)
    linkage(m, points, links, ground="O Bl Br")
