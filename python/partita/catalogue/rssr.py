"""Spatial four-bar with two ball joints on its coupler, which is free to spin about its own axis."""

from __future__ import annotations

import numpy as np

from ..builder import Body
from ..mechanism import Mechanism
from ..products import matmul, norm
from ..results import Result
from ..state import State
from .entry import Check, Entry, FloatArray, angle, largest_gap, path_error

CRANK, COUPLER, ROCKER = 0.3, 0.9, 0.6
PIVOT, AXIS = np.array([0.8, 0.2, 0.0]), np.array([0.28, -0.96, 0.0])  # hinge of the rocker
COUPLER_MASS, SPIN_INERTIA = 1.0, 1e-3
CRANK_ANGLE, CRANK_RATE, SPIN = np.pi / 3, 8.0, 5.0

# t: crank angle [rad]. From the energy integral, t = integral of d(angle) / rate, in 30 digits. The spin takes no part
# in it: its energy is constant, and a term linear in the one speed left does no work.
CRANK_PATH = {1.0: (11.5175034609800365514,), 2.0: (21.4484713783164988354,), 5.0: (52.3168940436016138091,)}


def points(crank_angle: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Centres P and Q (..., 3) [m] of the balls for angles of the crank.

    |Q - P| = COUPLER does not contain the rotations of the two balls: one equation a cos(psi) + b sin(psi) + c = 0
    remains for the angle psi of the rocker from the world's z axis.
    """
    phi = np.asarray(crank_angle, dtype=float)
    p = CRANK * np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=-1)
    arm = np.array([0.0, 0.0, ROCKER])
    across = np.cross(AXIS, arm)
    r = PIVOT - p
    a, b = matmul(2.0 * r, arm), matmul(2.0 * r, across)
    c = np.sum(r**2, axis=-1) + ROCKER**2 - COUPLER**2
    psi = np.arctan2(b, a) + np.arccos(-c / np.hypot(a, b))
    return p, PIVOT + np.cos(psi)[..., None] * arm + np.sin(psi)[..., None] * across


def build() -> Mechanism:
    """The drawing: crank at 60 degrees in the x-y plane; the frame of the coupler has its x axis from P to Q."""
    m = Mechanism("rssr", gravity=(0, 0, -9.81))
    p, q = points(CRANK_ANGLE)
    crank = _round_rod(m, "crank", np.zeros(3), p, CRANK)
    rocker = _round_rod(m, "rocker", PIVOT, q, ROCKER)
    coupler = _round_rod(m, "coupler", p, q, COUPLER_MASS)
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0), axis=(0, 0, 1), cut="never")
    m.add_spherical("P", crank, coupler, point=p, cut="never")
    m.add_revolute("D", m.ground, rocker, point=PIVOT, axis=AXIS)
    m.add_spherical("Q", rocker, coupler, point=q)
    return m


def _round_rod(m: Mechanism, name: str, near: FloatArray, far: FloatArray, mass: float) -> Body:
    """A uniform rod that resists spin about its own axis, which is the x axis of its frame.

    Only the coupler spins; the others rotate about axes perpendicular to their own, so their small axial inertia
    affects no motion. It makes the mass matrix in absolute coordinates regular.
    """
    length = float(norm(far - near))
    x = (far - near) / length
    y = np.cross((0.0, 0.0, 1.0), x)
    y = y / norm(y)
    across = mass * length**2 / 12.0
    return m.add_body(
        name,
        mass=mass,
        inertia=(SPIN_INERTIA, across, across),
        com=(length / 2, 0, 0),
        position=near,
        orientation=np.column_stack([x, y, np.cross(x, y)]),
    )


def start(m: Mechanism) -> State:
    """As drawn, the crank at 8 rad/s and the coupler spinning about its own axis at 5 rad/s.

    The ball at P measures rotations relative to the crank, in axes that are parallel to the world's as drawn. Rotating
    the coupler about its own axis moves neither ball: the missing spin is added to the rates that the loop requires.
    """
    p, q = points(CRANK_ANGLE)
    axis = (q - p) / COUPLER
    moving = m.assemble(rates={"A": CRANK_RATE}).velocity("P")
    lacking = SPIN - float(matmul(moving, axis)) - CRANK_RATE * axis[2]
    return m.assemble(rates={"A": CRANK_RATE, "P": moving + lacking * axis})


def crank(result: Result) -> float:
    """Largest error of the crank angle over the tabled times."""
    return path_error(angle(result, "A", CRANK_ANGLE)[:, None], result, CRANK_PATH)


def balls(result: Result) -> float:
    """Largest distance of the ball Q from where the closed form puts it for the crank angle."""
    _, expected = points(angle(result, "A", CRANK_ANGLE))
    return largest_gap(result.body("rocker").point((ROCKER, 0, 0)), expected)


def spin(result: Result) -> float:
    """Largest change of the coupler's spin: forces through its axis have no moment about it, and it is round."""
    coupler = result.body("coupler")
    along = np.sum(coupler.rotation[:, :, 0] * coupler.angular_velocity, axis=1)
    return largest_gap(along, np.full(len(result.t), SPIN))


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="rssr",
        title="spatial four-bar with two ball joints: crank, rocker, and a coupler that spins about itself",
        source="one equation for the angle of the rocker; energy integral of the crank's motion, in 30 digits; the "
        "spin is constant",
        duration=5.0,
        build=build,
        start=start,
        times=tuple(CRANK_PATH),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("crank angle [rad]", 1e-7, "rtol 1e-11 of 52 rad over some hundred steps, some margin", crank),
            Check("ball Q over crank angle [m]", 1e-11, "closure 1e-12, at most tenfold in the ball", balls),
            Check("spin of the coupler [rad/s]", 1e-7, "rtol 1e-11 of 5 rad/s over 8 turns of the crank", spin),
        ),
        notes="Two degrees of freedom: the crank, and the idle spin of the coupler, which affects no loop.",
    )
