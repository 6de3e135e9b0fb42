"""Linkages of many links: straight lines, copies, lifts, presses, and machines that dig, crush, wipe and sew."""

from __future__ import annotations

from ...mechanism import Mechanism
from ..truth import planar
from .drawing import Slide, beside, in_space, linkage, meet, polar
from .member import FALL, Theme, member

MEMBERS: Theme = {}
NORTON = "R. L. Norton, Design of Machinery"
KEMPE = "A. B. Kempe, How to Draw a Straight Line, 1877"
ARTOBOLEVSKY = "I. I. Artobolevsky, Mechanisms in Modern Engineering Design"


@member(MEMBERS, "peaucellier", "Peaucellier and Lipkin's inversor: eight bars draw an exact straight line",
        planar(7, 10, KEMPE), rates={"Q": 0.8})  # fmt: skip
def peaucellier(m: Mechanism) -> None:
    """Arms 0.9 from O, a rhombus of 0.4, and a crank whose pivot Q is as far from O as from P: R runs across O Q."""
    o, q = 0j, -0.3j
    p = q + polar(0.3, -75.0)
    a, c = (meet(o, p, 0.9, 0.4, side) for side in (1, -1))
    points = {"O": o, "Q": q, "P": p, "A": a, "C": c, "R": a + c - p}
    links = {"crank": "Q P", "arm 1": "O A", "arm 2": "O C", "side 1": "P A", "side 2": "P C", "side 3": "A R",
             "side 4": "C R"}  # fmt: skip
    linkage(m, points, links, ground="O Q")


@member(MEMBERS, "hart-inversor", "Hart's inversor: a crossed parallelogram on a fixed point draws a straight line",
        planar(5, 7, KEMPE), rates={"Q": 0.5})  # fmt: skip
def hart_inversor(m: Mechanism) -> None:
    """Long bars l, short bars s: diagonals and legs of a trapezoid with parallel sides 2u, 2w, where 4 u w = l^2 - s^2.

    O, P and R divide three bars in the ratio 1 : 2, on a line parallel to these sides; P moves about Q on a circle
    through O.
    """
    u, long, short = 0.35, 0.9, 0.4
    w = (long**2 - short**2) / (4.0 * u)
    h = (short**2 - (u - w) ** 2) ** 0.5
    a, b, c, d = complex(-u, 0), complex(w, -h), complex(u, 0), complex(-w, -h)
    o, p, r = a + (b - a) / 3, a + (d - a) / 3, c + (b - c) / 3
    points = {"A": a, "B": b, "C": c, "D": d, "O": o, "P": p, "R": r, "Q": (o + p) / 2 + 0.1j}
    links = {"crank": "Q P", "long 1": "A O B", "long 2": "C D", "short 1": "A P D", "short 2": "C R B"}
    linkage(m, points, links, ground="O Q")
    m.add_spring("hold", "ground", in_space(d - 0.3j), "short 1", in_space(d - a), stiffness=60.0)


@member(MEMBERS, "pantograph", "pantograph: its pen draws twice what its tracer is led along, two degrees of freedom",
        planar(4, 5, "C. Scheiner, Pantographice, 1631; L. Burmester, Lehrbuch der Kinematik", bridges=("O",)),
        rates={"O": 0.6, "A": 0.4}, gravity=FALL)  # fmt: skip
def pantograph(m: Mechanism) -> None:
    """A parallelogram A B C T on bars twice as long; O, the tracer T and the pen P stay in one line.

    It lies on a table; a rubber band across the parallelogram keeps it from folding flat.
    """
    a, arm = polar(0.3, -60.0), polar(0.3, -120.0)
    points = {"O": 0j, "A": a, "B": 2 * a, "C": 2 * a + arm, "P": 2 * a + 2 * arm, "T": a + arm}
    links = {"long 1": "O A B", "long 2": "B C P", "short 1": "A T", "short 2": "C T"}
    linkage(m, points, links, ground="O")
    m.add_spring("band", "short 1", (0, 0, 0), "short 2", (0, 0, 0), stiffness=30.0)


@member(MEMBERS, "scissor-lift", "scissor lift of three stages: seven bars, two blocks and a platform on a spring",
        planar(9, 13, ARTOBOLEVSKY), rates={"L0": 0.3})  # fmt: skip
def scissor_lift(m: Mechanism) -> None:
    """Stages of crossed bars of 1 m at 35 degrees; one foot and one hinge of the platform slide."""
    stages, bar = 3, polar(1.0, 35.0)
    points = {f"L{i}": complex(0.0, i * bar.imag) for i in range(stages + 1)}
    points.update({f"R{i}": complex(bar.real, i * bar.imag) for i in range(stages + 1)})
    points.update({f"M{i}": complex(bar.real / 2, (i - 0.5) * bar.imag) for i in range(1, stages + 1)})
    points["edge"] = points[f"L{stages}"] + 1.2
    links = {}
    for i in range(1, stages + 1):
        links[f"rising {i}"] = f"L{i - 1} M{i} R{i}"
        links[f"falling {i}"] = f"R{i - 1} M{i} L{i}"
    links["platform"] = f"L{stages} edge"
    slides = {"foot": Slide("R0", 1.0), "shoe": Slide(f"R{stages}", 1.0, on="platform")}
    linkage(m, points, links, ground="L0", slides=slides)
    m.add_spring("lift", "ground", in_space(points["L0"] + 0.1), "platform", (0.1, 0, 0), stiffness=400.0, damping=0.0,
                 length=1.95)  # fmt: skip


@member(MEMBERS, "toggle-press", "toggle press: a crank straightens a knee above the ram",
        planar(5, 7, ARTOBOLEVSKY), rates={"A": 8.0}, samples=401)  # fmt: skip
def toggle_press(m: Mechanism) -> None:
    """Crank 0.1, rod 0.6 to the knee, two links of 0.4 between the frame and the ram; the knee stays bent."""
    pin, frame = -0.75 + polar(0.1, 60.0), 0.4j
    knee = meet(pin, frame, 0.6, 0.4, side=-1)
    ram = complex(0.0, knee.imag - (0.4**2 - knee.real**2) ** 0.5)
    points = {"A": -0.75 + 0j, "B": pin, "C": knee, "D": frame, "E": ram}
    links = {"crank": "A B", "rod": "B C", "upper": "D C", "lower": "C E"}
    linkage(m, points, links, ground="A D", slides={"ram": Slide("E", 1j, mass=2.0)})


@member(MEMBERS, "jaw-crusher", "Blake's jaw crusher: an eccentric lifts a pitman, two toggles push the jaw",
        planar(5, 7, ARTOBOLEVSKY), rates={"A": 20.0}, samples=801)  # fmt: skip
def jaw_crusher(m: Mechanism) -> None:
    """Eccentric 0.03, pitman 0.7, toggles 0.35 and 0.3, jaw 0.9 hung above."""
    b, d = polar(0.03, 30.0), 0.33 - 0.8j
    c = meet(b, d, 0.7, 0.35, side=-1)
    jaw = -0.35 + 0.1j
    e = meet(c, jaw, 0.3, 0.85, side=-1)
    points = {"A": 0j, "B": b, "C": c, "D": d, "E": e, "F": jaw}
    links = {"eccentric": "A B", "pitman": "B C", "rear toggle": "D C", "front toggle": "C E", "jaw": "F E"}
    linkage(m, points, links, ground="A D F")


@member(MEMBERS, "windscreen-wiper", "windscreen wiper: one crank swings two blades side by side",
        planar(5, 7, NORTON), rates={"A": 10.0}, samples=801)  # fmt: skip
def windscreen_wiper(m: Mechanism) -> None:
    """A crank-rocker moves the first blade, and a parallelogram transmits its motion to the second."""
    pin, first = polar(0.05, 80.0), 0.3 + 0.02j
    arm = meet(pin, first, 0.29, 0.08) - first
    offset = 0.45 + 0j
    blade = arm / abs(arm) * 0.4
    points = {"A": 0j, "B": pin, "C": first + arm, "D": first, "E": first - 0.8 * arm, "T": first + blade,
              "F": first + offset - 0.8 * arm, "G": first + offset, "U": first + offset + blade}  # fmt: skip
    links = {"crank": "A B", "rod": "B C", "blade 1": "D C E T", "tie": "E F", "blade 2": "G F U"}
    linkage(m, points, links, ground="A D G")


@member(MEMBERS, "needle-bar", "sewing machine: needle bar and thread lever on one crank",
        planar(5, 7, ARTOBOLEVSKY), rates={"A": 30.0}, samples=801, seconds=3.0)  # fmt: skip
def needle_bar(m: Mechanism) -> None:
    """A slider-crank and a four-bar share the crank pin (times 0.1: crank 0.15, rod 0.4, lever 0.3 and 0.25)."""
    pin, pivot = polar(0.015, 20.0), 0.03 + 0.02j
    eye = meet(pin, pivot, 0.03, 0.025)
    needle = complex(0.0, pin.imag - (0.04**2 - pin.real**2) ** 0.5)
    points = {"A": 0j, "B": pin, "C": needle, "D": pivot, "E": eye, "T": beside(pin, eye, 0.07)}
    links = {"crank": "A B", "rod": "B C", "thread lever": "B E T", "stay": "D E"}
    linkage(m, points, links, ground="A D", slides={"needle bar": Slide("C", 1j, mass=0.02)})


@member(MEMBERS, "excavator", "excavator: boom, stick and bucket with a cylinder each, three degrees of freedom",
        planar(11, 15, ARTOBOLEVSKY),
        rates={"A": 0.1, "B": -0.2, "C": 0.2})  # fmt: skip
def excavator(m: Mechanism) -> None:
    """Each cylinder is a barrel in which a piston slides, supported by oil: a stiff spring and a damper."""
    boom, stick, bucket = 2.6 + 1.6j, 3.6 - 0.2j, 4.0 - 0.8j
    crook, horn, toe = 1.2 + 1.5j, 2.2 + 2.1j, beside(boom, stick, 0.35, 0.35)
    rocker = beside(boom, stick, 1.65)
    ear = beside(stick, bucket, 0.25, 0.3)
    knee = meet(rocker, ear, 0.45, 0.45)
    points = {"A": 0j, "B": boom, "C": stick, "D": rocker, "E": knee, "F": ear, "T": bucket, "G": 0.5 - 0.2j,
              "H": crook, "I": horn, "J": beside(boom, stick, -0.5), "K": toe}  # fmt: skip
    cylinders = {"boom": ("G", "H", "ground", "boom"), "stick": ("I", "J", "boom", "stick"),
                 "bucket": ("K", "E", "stick", "rocker")}  # fmt: skip
    links = {"boom": "A H I B", "stick": "B J K D C", "bucket": "C F T", "rocker": "D E", "link": "E F"}
    slides = {}
    for name, (foot, head, _, _) in cylinders.items():
        points[f"{name}-end"] = 0.4 * points[foot] + 0.6 * points[head]
        links[f"{name} barrel"] = f"{foot} {name}-end"
        slides[f"{name} piston"] = Slide(head, points[head] - points[foot], on=f"{name} barrel", mass=2.0)
    linkage(m, points, links, ground="A G", slides=slides)
    for name, (foot, head, on, held) in cylinders.items():
        near = in_space(points[foot] - (points[links[on].split()[0]] if on != "ground" else 0))
        far = in_space(points[head] - points[links[held].split()[0]])
        m.add_spring(f"{name} oil", on, near, held, far, stiffness=4e3, damping=60.0)


@member(MEMBERS, "landing-gear", "landing gear: a strut with a folding brace and a sprung wheel",
        planar(4, 5, "N. S. Currey, Aircraft Landing Gear Design", bridges=("wheel slide",)),
        rates={"A": 0.4, "wheel slide": 0.3})  # fmt: skip
def landing_gear(m: Mechanism) -> None:
    """The strut hangs from A, the brace folds at C; the wheel slides in the strut on a spring with a damper."""
    strut, pivot = polar(1.0, -80.0), 0.9 + 0j
    on_strut = 0.6 * strut
    knee = meet(on_strut, pivot, 0.45, 0.55, side=-1)
    points = {"A": 0j, "B": on_strut, "C": knee, "D": pivot, "E": strut, "W": strut}
    links = {"strut": "A B E", "lower brace": "B C", "upper brace": "D C"}
    linkage(m, points, links, ground="A D", slides={"wheel": Slide("W", strut, on="strut", mass=3.0)})
    m.add_spring("shock", "strut", (0, 0, 0), "wheel", (0, 0, 0), stiffness=3e3, damping=10.0, length=0.99)
    m.add_spring("retraction", "ground", in_space(1.2 - 0.6j), "strut", in_space(on_strut), stiffness=50.0)
