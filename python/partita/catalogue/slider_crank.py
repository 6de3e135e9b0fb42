"""Slider-crank with a spring-damper between crank and rod, after the DAE example shipped with SUNDIALS IDA."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .entry import Check, Entry, angle, path_error

CRANK, ROD = 0.5, 1.0
J1, J2, M2 = 1.0, 2.0, 1.0
STIFFNESS, DAMPING, LENGTH, FORCE = 1.0, 1.0, 1.0, 1.0
Q0, P0 = np.pi / 2, -np.pi / 6  # crank and rod angle of the drawing; sin P0 = -CRANK

# t: crank angle q, slide x, rod angle p
PATH = {
    2.0: (0.579038812048806712, 1.38033527196118937, -0.277144095738981133),
    5.0: (-1.42999696764722737, 0.939030613578266226, 0.517894756489886248),
    10.0: (1.27567584865023941, 1.0235785589798395, -0.498813049182498749),
}


def build() -> Mechanism:
    """The drawing: crank upright on the origin, slider on the x axis.

    The published kinetic energy is J1 q'^2 / 2 + J2 p'^2 / 2 + m2 x'^2 / 2: the centre of mass of the crank is at its
    pivot, the rod has rotational inertia only, the slider is a point mass. The published generalized forces hold F
    twice: F along x, and again F d(cos p)/dp = -F sin p along p. The second is a couple on the rod, +F at its slider
    end and -F at its crank end.
    """
    m = Mechanism("slider-crank", gravity=(0, 0, 0))
    pin, slider_at = (0.0, CRANK, 0.0), (ROD * np.cos(P0), 0.0, 0.0)
    turned = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    c, s = np.cos(P0), np.sin(P0)
    crank = m.add_body("crank", mass=1.0, inertia=(J1 / 2, J1 / 2, J1), orientation=turned)
    rod = m.add_body(
        "rod",
        mass=0.0,
        inertia=(J2 / 2, J2 / 2, J2),
        position=pin,
        orientation=((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)),
    )
    slider = m.add_body("slider", mass=M2, inertia=(0, 0, 0), position=slider_at)
    m.add_revolute("O", m.ground, crank, point=(0, 0, 0), axis=(0, 0, 1))
    m.add_revolute("pin", crank, rod, point=pin, axis=(0, 0, 1))
    m.add_revolute("wrist", slider, rod, point=slider_at, axis=(0, 0, 1))
    m.add_prismatic("slide", m.ground, slider, point=slider_at, axis=(1, 0, 0))
    m.add_spring("spring", crank, (CRANK / 2, 0, 0), rod, (ROD / 2, 0, 0),
                 stiffness=STIFFNESS, damping=DAMPING, length=LENGTH)  # fmt: skip
    m.add_force(slider, force=(FORCE, 0, 0))
    m.add_force(rod, force=(FORCE, 0, 0), point=(ROD, 0, 0))
    m.add_force(rod, force=(-FORCE, 0, 0), point=(0, 0, 0))
    return m


def start(m: Mechanism) -> State:
    """At rest as drawn."""
    return m.assemble()


def path(result: Result) -> float:
    """Largest error of q, x, p over the tabled times."""
    x = result.body("slider").position[:, 0]
    found = np.column_stack([angle(result, "O", Q0), x, angle(result, "wrist", P0)])
    return path_error(found, result, PATH)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="slider-crank",
        title="slider-crank with a spring-damper between the midpoints of crank and rod",
        source="slider-crank DAE example shipped with SUNDIALS IDA (R. Serban); recomputed in quadruple precision",
        duration=10.0,
        build=build,
        start=start,
        times=tuple(PATH),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(Check("crank angle, slide, rod angle [rad, m]", 1e-9, "rtol 1e-11, damped: errors grow little", path),),
        notes="The published forces count F twice: on the slider and as a couple -F sin p on the rod.",
    )
