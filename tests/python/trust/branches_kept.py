"""Branches at change points

Where all links of a mechanism are in line, its branches meet. A run stays on its branch and reports the time of the
crossing; one that cannot cross stops with a message. No run changes its branch silently.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from branches import trial
from drawings import Array, four_bar, parallelogram
from oracle.drawing import Body, Drawing, Joint
from scipy.integrate import solve_ivp
from thorough import either

import partita as pt
from partita.errors import SingularityError

from .case import Case, Held, done, refused, right
from .program import as_the_program_says

LONG = 1.25
RATIO = (LONG + 1.0) / (LONG - 1.0)
"""Crossed parallelogram: tan(rocker / 2) = RATIO tan(crank / 2), from the closing condition of its coupler."""


def crossed_angle(crank: Array) -> Array:
    """Angle of the rocker, but for whole turns."""
    return 2.0 * np.arctan2(RATIO * np.sin(crank / 2), np.cos(crank / 2))


def crossed_slope(crank: Array) -> Array:
    """Its derivative by the crank's angle."""
    return RATIO / (np.cos(crank / 2) ** 2 + (RATIO * np.sin(crank / 2)) ** 2)


def crossed(angle: float = 1.0) -> pt.Mechanism:
    """Links 1.25, 1, 1.25 on ground 1, crossed."""
    other = float(crossed_angle(np.float64(angle)))
    b = (LONG * np.cos(angle), LONG * np.sin(angle))
    c = (1 + LONG * np.cos(other), LONG * np.sin(other))
    return four_bar([(0, 0), b, c, (1, 0)], gravity=0.0, masses=(1.0, 1.0, 1.0))


def crossed_motion(t: Array, rate: float, angle: float = 1.0) -> Array:
    """Crank angle without forces: the kinetic energy stays what it is."""

    def inertia(crank: float) -> float:
        slope, apart = crossed_slope(crank), crossed_angle(crank) - crank
        coupler = LONG**2 * (1 + slope * np.cos(apart) + slope**2) / 3
        return (LONG**2 + LONG**2 * slope**2) / 3 + coupler

    first = inertia(angle)
    return solve_ivp(
        lambda t, x: [rate * np.sqrt(first / inertia(x[0]))], (0, t[-1]), [angle], t_eval=t, rtol=1e-12, atol=1e-13
    ).y[0]


def crossed_run(formulation: str, rtol: float, coordinates: str = "relative") -> Iterator[Held]:
    m = crossed()
    run = m.simulate(
        5.0, initial=m.assemble(rates={"A": 4.0}), solver=pt.Solver(formulation), rtol=rtol, atol=0.01 * rtol,
        coordinates=coordinates,
    )  # fmt: skip
    crank, rod = run.body("crank").rotation, run.body("rocker").rotation
    angles = [np.unwrap(np.arctan2(r[:, 1, 0], r[:, 0, 0])) for r in (crank, rod)]
    known = crossed_motion(np.linspace(0, 5, 201), 4.0)[: len(run.t)]
    # the crank turns some three times in 5 s; near the change points errors grow by the ratio of the speeds, 9 or so
    yield Held("crank", angles[0], known, max(3e3 * rtol, 1e-8))
    yield Held("rocker", np.sin(angles[1] - crossed_angle(angles[0])), 0.0, 1e-7)
    done(run)
    passed = np.sum(np.abs(np.diff(np.floor(known / np.pi))))
    reported = sum(int(note.split()[0]) for note in run.notes if "were crossed" in note)
    if formulation == "projective":
        yield Held("positions told", reported, passed, 0.0)


def crossed_case(formulation: str, rtol: float, coordinates: str = "relative") -> Case:
    @right(
        f"crossed parallelogram without gravity, 4 rad/s, 5 s: `{formulation}`, rtol {rtol:.0e}, {coordinates}",
        "closed form of the rocker, energy integral of the crank, positions passed counted",
    )
    def ask() -> Iterator[Held]:
        yield from crossed_run(formulation, rtol, coordinates)

    return replace(ask, name=f"crossed_{formulation}_{rtol:.0e}_{coordinates}".replace("-", "_"))


REDUCED = ("fixed", "svd", "qr", "gram-schmidt", "wehage-haug")
CASES = [crossed_case("projective", rtol) for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)]
CASES += [crossed_case(name, 1e-8) for name in (*REDUCED, "multipliers", "range-space")]
CASES += [crossed_case("projective", 1e-8, "absolute")]


def followed(family: str, seed: int, rtol: float) -> Case:
    @right(
        f"{family}, drawn by chance, through its change points, rtol {rtol:.0e}",
        "the curve of its positions, followed straight on by itself; the energy",
    )
    def ask() -> Iterator[Held]:
        seen = trial(family, seed, rtol)
        yield Held(seen.words, seen.outcome == "right", True, 0.0)
        yield Held("positions told", seen.reported, seen.passed, 0.0)

    return replace(ask, name=f"{family.replace(' ', '_').replace('-', '_')}_{rtol:.0e}".replace("-", "_"))


CASES += [followed(family, 3, rtol) for family in ("kite", "folding four-bar") for rtol in (1e-4, 1e-8, 1e-12)]


def agile_eye() -> Drawing:
    """Three legs of three hinges whose axes all meet in one point, each across the next."""
    x, y, z = np.eye(3)
    bodies = [Body("platform", 2.0, np.diag([0.5, 0.6, 0.7]), np.array([0.1, 0.05, 0.2]), np.zeros(3), np.eye(3))]
    joints = []
    for i, (base, middle, top) in enumerate([(x, z, y), (y, x, z), (z, y, x)]):
        for name in ("lower", "upper"):
            com = 0.3 * (base + middle if name == "lower" else middle + top)
            bodies.append(Body(f"{name}{i}", 0.5, np.diag([0.04, 0.05, 0.06]), com, np.zeros(3), np.eye(3)))
        chain = [("ground", f"lower{i}", base), (f"lower{i}", f"upper{i}", middle), (f"upper{i}", "platform", top)]
        for k, (parent, child, axis) in enumerate(chain):
            joints.append(Joint(f"{'ABC'[k]}{i}", "revolute", parent, child, np.zeros(3), axis[:, None]))
    return Drawing(np.zeros(3), tuple(bodies), tuple(joints))


def agile_case(rtol: float) -> Case:
    @right(
        f"spherical 3-RRR without gravity, 4 s, rtol {rtol:.0e}",
        "kinetic energy; accelerations and reactions of a maximal-coordinate program at every output",
    )
    def ask() -> Iterator[Held]:
        drawing = agile_eye()
        m = drawing.build()
        start = m.assemble(rates={"A0": 1.0, "A1": -0.7, "A2": 0.4})
        run = m.simulate(4.0, initial=start, rtol=rtol, atol=1e-2 * rtol, t_eval=np.linspace(0, 4, either(6, 21)))
        yield Held("energy", run.energy.kinetic / run.energy.kinetic[0], 1.0, max(100 * rtol, 1e-9))
        yield from as_the_program_says(drawing, m, run)
        done(run)

    return replace(ask, name=f"spherical_robot_{rtol:.0e}".replace("-", "_"))


CASES += [agile_case(rtol) for rtol in (1e-6, 1e-8, 1e-10, 1e-11, 1e-12)]


def cardan_case(rtol: float) -> Case:
    bend = 0.5

    @right(
        f"double Cardan shaft, parallel ends, bent by {bend} rad, rtol {rtol:.0e}",
        "closed form: the output turns as the input; the middle's rate by the formula of the universal joint",
    )
    def ask() -> Iterator[Held]:
        along = np.array([np.cos(bend), np.sin(bend), 0.0])
        beside = (-np.sin(bend), np.cos(bend), 0.0)
        m = pt.Mechanism("double Cardan", gravity=(0, 0, 0))
        inertia = (0.2, 0.1, 0.1)
        m.add_body("in", mass=1.0, inertia=inertia)
        m.add_body(
            "middle",
            mass=1.0,
            inertia=inertia,
            position=0.5 * along,
            orientation=np.array([along, beside, (0, 0, 1)]).T,
        )
        m.add_body("out", mass=1.0, inertia=inertia, position=along)
        m.add_revolute("A", m.ground, "in", point=(0, 0, 0), axis=(1, 0, 0))
        m.add_universal("U", "in", "middle", point=(0, 0, 0), axis1=(0, 0, 1), axis2=beside)
        m.add_universal("V", "middle", "out", point=along, axis1=beside, axis2=(0, 0, 1))
        m.add_revolute("B", m.ground, "out", point=along, axis=(1, 0, 0))
        run = m.simulate(4.0, initial=m.assemble(rates={"A": 3.0}), rtol=rtol, atol=1e-2 * rtol)
        angle = run.joint("A").position[:, 0]
        yield Held("output against input", run.joint("B").position[:, 0], angle, 1e-9)
        # of the middle along itself over that of the input, whose first axis stood across the plane of the shafts
        ratio = np.cos(bend) / (1 - np.sin(bend) ** 2 * np.sin(angle) ** 2)
        spin = np.einsum("ij,ij->i", run.body("middle").angular_velocity, run.body("middle").rotation[:, :, 0])
        yield Held("rate of the middle", spin / run.joint("A").velocity[:, 0], ratio, 1e-9)
        yield Held("energy", run.energy.kinetic / run.energy.kinetic[0], 1.0, max(100 * rtol, 1e-10))
        done(run)

    return replace(ask, name=f"cardan_{rtol:.0e}".replace("-", "_"))


CASES += [cardan_case(rtol) for rtol in (1e-4, 1e-7, 1e-11)]


@refused("a parallelogram started with all links in line", SingularityError, "singular")
def start_in_line() -> Iterator[Held]:
    m = parallelogram(angle=0.0)
    done(m.simulate(1.0, initial=m.assemble(rates={"A": 1.0})))
    yield from ()
