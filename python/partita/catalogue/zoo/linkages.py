"""Four-bars, slider-cranks and their inversions, and the five-bar."""

from __future__ import annotations

from ...mechanism import Mechanism
from ..truth import planar
from .drawing import Slide, beside, linkage, meet, polar
from .member import Theme, member

MEMBERS: Theme = {}
GRASHOF = "F. Grashof, Theoretische Maschinenlehre, vol. 2, 1883; B. Paul, Kinematics and Dynamics of Planar Machinery"
NORTON = "R. L. Norton, Design of Machinery"
REULEAUX = "F. Reuleaux, Theoretische Kinematik, 1875"


def four_bar(m: Mechanism, crank: complex, ground: complex, coupler: float, rocker: float, side: int = 1) -> None:
    """A four-bar A B C D, its crank A B drawn."""
    points = {"A": 0j, "B": crank, "C": meet(crank, ground, coupler, rocker, side), "D": ground}
    linkage(m, points, {"crank": "A B", "coupler": "B C", "rocker": "D C"}, ground="A D")


@member(MEMBERS, "double-rocker", "Grashof double rocker: its shortest link is the coupler, which alone turns fully",
        planar(3, 4, GRASHOF), rates={"A": 0.5}, samples=401)  # fmt: skip
def double_rocker(m: Mechanism) -> None:
    """Coupler 0.3, opposite 1.0, rockers 0.8 and 0.7: 0.3 + 1.0 < 0.8 + 0.7."""
    four_bar(m, polar(0.8, -55.0), 1.0 + 0j, 0.3, 0.7)


@member(MEMBERS, "drag-link", "drag link: the ground is shortest, crank and follower both turn fully",
        planar(3, 4, GRASHOF), rates={"A": 10.0}, samples=601)  # fmt: skip
def drag_link(m: Mechanism) -> None:
    """Ground 0.3, longest 0.9: 0.3 + 0.9 < 0.8 + 0.7."""
    four_bar(m, polar(0.8, 50.0), 0.3 + 0j, 0.7, 0.9)


@member(MEMBERS, "parallelogram", "parallelogram that swings below its change points: its coupler only translates",
        planar(3, 4, NORTON), rates={"A": 1.5})  # fmt: skip
def parallelogram(m: Mechanism) -> None:
    """Opposite sides are equal; the cranks hang down and do not swing as far as the line of the ground."""
    four_bar(m, polar(0.6, -70.0), 1.0 + 0j, 1.0, 0.6, side=-1)


@member(MEMBERS, "antiparallelogram", "antiparallelogram: a parallelogram closed crosswise, its long links cross",
        planar(3, 4, NORTON), rates={"A": 0.6})  # fmt: skip
def antiparallelogram(m: Mechanism) -> None:
    """Long links 1.0 from a ground of 0.6: the mirror image about the line B D of the parallelogram's corner C."""
    four_bar(m, polar(1.0, -60.0), 0.6 + 0j, 0.6, 1.0, side=-1)


@member(MEMBERS, "slider-crank-offset", "slider-crank whose guide misses the crank's pivot: a slow and a fast stroke",
        planar(3, 4, NORTON), rates={"A": 15.0}, samples=801)  # fmt: skip
def slider_crank_offset(m: Mechanism) -> None:
    """Crank 0.2, rod 0.6, guide 0.1 above the pivot."""
    pin, offset = polar(0.2, 40.0), 0.1
    wrist = complex(pin.real + (0.6**2 - (offset - pin.imag) ** 2) ** 0.5, offset)
    linkage(m, {"A": 0j, "B": pin, "C": wrist}, {"crank": "A B", "rod": "B C"}, ground="A",
            slides={"piston": Slide("C", 1.0)})  # fmt: skip


@member(MEMBERS, "whitworth", "Whitworth's quick return: a crank pin slides in a slotted arm that turns fully, and "
        "moves a ram", planar(5, 7, REULEAUX), rates={"A": 12.0}, samples=801)  # fmt: skip
def whitworth(m: Mechanism) -> None:
    """The arm's pivot lies inside the circle of the crank pin: 0.1 from its centre, the crank 0.25."""
    pivot, pin = 0.1 + 0j, polar(0.25, 65.0)
    end = beside(pivot, pin, -0.2)
    ram = complex(pivot.real - ((0.7**2 - end.imag**2) ** 0.5) + (end.real - pivot.real), 0.0)
    points = {"A": 0j, "B": pin, "D": pivot, "E": end, "F": ram}
    links = {"crank": "A B", "arm": "D E", "rod": "E F"}
    slides = {"block": Slide("B", pin - pivot, on="arm", mass=0.2), "ram": Slide("F", 1.0, mass=1.0)}
    linkage(m, points, links, ground="A D", slides=slides)


@member(MEMBERS, "shaper", "quick return of a shaper: the arm that its crank pin slides in swings",
        planar(5, 7, NORTON), rates={"A": 12.0}, samples=601)  # fmt: skip
def shaper(m: Mechanism) -> None:
    """The arm's pivot lies outside the circle of the crank pin: 0.4 below its centre, the crank 0.15."""
    pivot, pin = -0.4j, polar(0.15, 30.0)
    end = beside(pivot, pin, 0.8)
    ram = complex(end.real - (0.3**2 - (0.45 - end.imag) ** 2) ** 0.5, 0.45)
    points = {"A": 0j, "B": pin, "D": pivot, "E": end, "F": ram}
    links = {"crank": "A B", "arm": "D E", "rod": "E F"}
    slides = {"block": Slide("B", pin - pivot, on="arm", mass=0.2), "ram": Slide("F", 1.0, mass=1.0)}
    linkage(m, points, links, ground="A D", slides=slides)


@member(MEMBERS, "scotch-yoke", "Scotch yoke: rotation becomes a purely sinusoidal translation",
        planar(3, 4, REULEAUX), rates={"A": 9.0}, samples=601)  # fmt: skip
def scotch_yoke(m: Mechanism) -> None:
    """The block on the crank pin slides across the yoke, the yoke along the ground."""
    pin = polar(0.3, 35.0)
    points = {"A": 0j, "B": pin, "C": complex(pin.real, 0.0)}
    slides = {"yoke": Slide("C", 1.0, mass=1.0), "block": Slide("B", 1j, on="yoke", mass=0.2)}
    linkage(m, points, {"crank": "A B"}, ground="A", slides=slides)


@member(MEMBERS, "elliptic-trammel", "trammel of Archimedes: a bar on two crossing slides, its tip draws an ellipse",
        planar(3, 4, REULEAUX), rates={"across slide": 2.0})  # fmt: skip
def elliptic_trammel(m: Mechanism) -> None:
    """Two blocks 0.5 apart; the tip 0.3 beyond."""
    a, b = complex(0.5 * 0.6, 0.0), complex(0.0, -0.5 * 0.8)
    points = {"A": a, "B": b, "C": beside(a, b, 0.8)}
    slides = {"across": Slide("A", 1.0), "up": Slide("B", 1j)}
    linkage(m, points, {"bar": "A B C"}, slides=slides)


@member(MEMBERS, "oscillating-cylinder", "oscillating cylinder: the crank drives a piston whose cylinder swings",
        planar(3, 4, REULEAUX), rates={"A": 12.0}, samples=801)  # fmt: skip
def oscillating_cylinder(m: Mechanism) -> None:
    """Crank 0.15, trunnion 0.5 away; the piston's guide lies at the trunnion."""
    pin, trunnion = polar(0.15, 60.0), 0.5 + 0j
    points = {"A": 0j, "B": pin, "D": trunnion, "P": beside(pin, trunnion, 0.7)}
    slides = {"cylinder": Slide("D", trunnion - pin, on="piston", mass=1.0)}
    linkage(m, points, {"crank": "A B", "piston": "B P"}, ground="A D", slides=slides)


@member(MEMBERS, "five-bar", "five-bar: two cranks move one pin, two degrees of freedom",
        planar(4, 5, NORTON), rates={"A": 1.0, "E": -0.5})  # fmt: skip
def five_bar(m: Mechanism) -> None:
    """Cranks 0.4 from pivots 0.5 apart, rods 0.7; all hang down."""
    b, d = polar(0.4, -110.0), 0.5 + polar(0.4, -60.0)
    points = {"A": 0j, "B": b, "C": meet(b, d, 0.7, 0.7, side=-1), "D": d, "E": 0.5 + 0j}
    linkage(m, points, {"left crank": "A B", "left rod": "B C", "right crank": "E D", "right rod": "D C"}, ground="A E")


@member(MEMBERS, "chebyshev", "Chebyshev's linkage: the middle of its coupler runs nearly straight",
        planar(3, 4, "P. L. Chebyshev, Theorie des mecanismes connus sous le nom de parallelogrammes, 1854"),
        rates={"A": 1.0})  # fmt: skip
def chebyshev(m: Mechanism) -> None:
    """Crossed rockers 5, coupler 2, ground 4 (times 0.1), hung upside down; the middle of the coupler is loaded."""
    b, d = polar(0.5, -50.0), 0.4 + 0j
    c = meet(b, d, 0.2, 0.5, side=-1)
    points = {"A": 0j, "B": b, "C": c, "D": d, "M": (b + c) / 2}
    linkage(m, points, {"left": "A B", "right": "D C", "coupler": "M B C"}, ground="A D")


@member(MEMBERS, "roberts", "Roberts' linkage: the tip of its triangle runs nearly straight between the pivots",
        planar(3, 4, "F. Reuleaux, Theoretische Kinematik, 1875; R. L. Norton, Design of Machinery"),
        rates={"A": 0.8})  # fmt: skip
def roberts(m: Mechanism) -> None:
    """Rockers and sides of the triangle 0.6, coupler 0.5, pivots 1.0 apart; hung upside down, tip on their line."""
    b, d = meet(0j, 0.5 + 0j, 0.6, 0.6, side=-1), 1.0 + 0j
    c = b + 0.5
    points = {"A": 0j, "B": b, "C": c, "D": d, "P": meet(b, c, 0.6, 0.6)}
    linkage(m, points, {"left": "A B", "right": "D C", "triangle": "P B C"}, ground="A D")


@member(MEMBERS, "hoekens", "Hoekens' linkage: a crank-rocker whose coupler point runs straight, at a nearly even pace",
        planar(3, 4, NORTON), rates={"A": 8.0}, samples=601)  # fmt: skip
def hoekens(m: Mechanism) -> None:
    """Crank 1, ground 2, rocker and both halves of the coupler 2.5 (times 0.2)."""
    b, d = polar(0.2, 100.0), 0.4 + 0j
    c = meet(b, d, 0.5, 0.5)
    points = {"A": 0j, "B": b, "C": c, "D": d, "P": beside(b, c, 1.0)}
    linkage(m, points, {"crank": "A B", "coupler": "B C P", "rocker": "D C"}, ground="A D")
