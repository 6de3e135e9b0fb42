"""Linkages in the plane

Mechanisms with loops whose positions are known in closed form and whose motion follows from one equation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from drawings import EVERY, GENERAL, Array, G, four_bar, pendulum, slider_crank, stroke, swing, turning
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import partita as pt
from partita.solver import grouped

from .case import Case, Held, done, right
from .contradictions import rocker


def by_energy(height: object, inertia: object, first: float, rate: float, t: Array) -> Array:
    """Motion of one coordinate x with kinetic energy inertia(x) x'^2 / 2 and potential height(x), by SciPy."""
    step = 1e-5

    def slope(f: object, x: float) -> float:
        # of sixth order: round-off over the step is 1e-11, the remainder 1e-30
        return sum(c * (f(x + k * step) - f(x - k * step)) for k, c in ((1, 0.75), (2, -0.15), (3, 1 / 60))) / step  # type: ignore[operator]

    def acceleration(t: float, y: Array) -> list[float]:
        return [y[1], (-slope(height, y[0]) - 0.5 * slope(inertia, y[0]) * y[1] ** 2) / inertia(y[0])]  # type: ignore[operator]

    return solve_ivp(acceleration, (0, t[-1]), [first, rate], t_eval=t, rtol=1e-11, atol=1e-12).y[0]


@right(
    "a slider-crank under gravity, every formulation",
    "closed form of the slider; one equation of motion by hand, integrated by SciPy",
)
def slider() -> Iterator[Held]:
    crank, rod = 0.1, 0.3

    def sine(x: float) -> float:
        return crank * np.sin(x) / rod

    def height(x: float) -> float:
        return G * (0.5 * 0.5 * crank * np.sin(x) + 0.8 * 0.5 * crank * np.sin(x))

    def inertia(x: float) -> float:
        turn = crank * np.cos(x) / (rod * np.sqrt(1 - sine(x) ** 2))
        travel = -crank * np.sin(x) - rod * sine(x) * turn
        pin = np.array([-crank * np.sin(x), crank * np.cos(x)])
        # a rod by its ends: m (u^2 + u w + w^2) / 3
        ends = pin @ pin + pin @ [travel, 0] + travel**2
        return 0.5 * crank**2 / 3 + 0.8 * ends / 3 + travel**2

    t = np.linspace(0, 2, 41)
    known = by_energy(height, inertia, 0.0, 10.0, t)
    m = slider_crank()
    start = m.assemble(rates={"main": 10.0})
    for formulation in EVERY:
        run = done(m.simulate(2.0, initial=start, t_eval=t, solver=pt.Solver(formulation), rtol=1e-10, atol=1e-12))
        angle = run.joint("main").position[:, 0]
        yield Held(f"crank, {formulation}", angle, known, 1e-6)
        yield Held(f"slider, {formulation}", run.joint("bore").position[:, 0] + 0.4, stroke(angle), 1e-11)


@right(
    "a four-bar under gravity, both coordinates", "closed form of the rocker; energy, with heights and speeds by hand"
)
def freudenstein() -> Iterator[Held]:
    m = four_bar(GENERAL)
    start = m.assemble(rates={"A": 5.0})
    a, b, c, d = (np.array(p) for p in GENERAL)
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(3.0, initial=start, coordinates=coordinates, rtol=1e-11, atol=1e-13))
        turned = run.joint("A").position[:, 0]
        off = run.joint("D").position[:, 0] - rocker(turned)
        yield Held(f"rocker, {coordinates}", off - 2 * np.pi * np.round(off / (2 * np.pi)), 0.0, 1e-11)
        step = 1e-6
        ratio = (rocker(turned + step) - rocker(turned - step)) / (2 * step)

        def moved(base: Array, foot: Array, angle: Array) -> Array:
            cs, sn = np.cos(angle), np.sin(angle)
            x, y = base - foot
            return foot + np.stack([cs * x - sn * y, sn * x + cs * y], 1)

        pin, top = moved(b, a, turned), moved(c, d, rocker(turned))
        speed = run.joint("A").velocity[:, 0]
        u = speed[:, None] * np.stack([-pin[:, 1], pin[:, 0]], 1)
        w = (speed * ratio)[:, None] * np.stack([-(top - d)[:, 1], (top - d)[:, 0]], 1)
        kinetic = 0.3 * (u * u).sum(1) / 6 + 0.4 * (w * w).sum(1) / 6 + 0.5 * ((u * u) + (u * w) + (w * w)).sum(1) / 6
        potential = G * (0.3 * pin[:, 1] / 2 + 0.4 * top[:, 1] / 2 + 0.5 * (pin[:, 1] + top[:, 1]) / 2)
        # the ratio by differences: 1e-10
        yield Held(f"energy, {coordinates}", kinetic + potential, (kinetic + potential)[0], 1e-7)


@right(
    "reactions of a driven four-bar, every formulation",
    "Newton and Euler by hand: nine equations for eight forces and the drive, by NumPy",
)
def four_bar_reactions() -> Iterator[Held]:
    a, b, c, d = (np.array(p) for p in GENERAL)
    t = np.linspace(0.05, 0.55, 6)
    m = four_bar(GENERAL)
    m.add_drive("A", position=lambda t: 2.0 * t)
    known = {name: [] for name in "ABCD"}
    torques = []
    step = 1e-3

    def points(t: float) -> Array:
        """Pins B and C."""
        one, other = 2 * t, float(rocker(np.float64(2 * t)))

        def turn(x: float, r: Array) -> Array:
            return np.array([np.cos(x) * r[0] - np.sin(x) * r[1], np.sin(x) * r[0] + np.cos(x) * r[1]])

        return np.concatenate([turn(one, b), d + turn(other, c - d)])

    for now in t:
        # second derivatives, of eighth order in the step
        weights = [(1, 8 / 5), (2, -1 / 5), (3, 8 / 315), (4, -1 / 560)]
        second = sum(w * (points(now + k * step) + points(now - k * step)) for k, w in weights) - 205 / 72 * points(now)
        pin, top = np.split(points(now), 2)
        pin2, top2 = np.split(second / step**2, 2)
        matrix, rest = np.zeros((9, 9)), np.zeros(9)
        unknown = {"A": 0, "B": 2, "C": 4, "D": 6}
        rods = [
            (0.3, a, pin, 0 * pin, pin2, [("A", 1, a), ("B", -1, pin)]),
            (0.5, pin, top, pin2, top2, [("B", 1, pin), ("C", -1, top)]),
            (0.4, d, top, 0 * pin, top2, [("D", 1, d), ("C", 1, top)]),
        ]
        for i, (mass, start, end, start2, end2, forces) in enumerate(rods):
            centre, along, along2 = (start + end) / 2, end - start, end2 - start2
            spin = (along[0] * along2[1] - along[1] * along2[0]) / (along @ along)
            rest[3 * i : 3 * i + 2] = mass * ((start2 + end2) / 2 + [0, G])
            rest[3 * i + 2] = mass * (along @ along) / 12 * spin
            for name, sign, point in forces:
                k, arm = unknown[name], point - centre
                matrix[3 * i, k] = matrix[3 * i + 1, k + 1] = sign
                matrix[3 * i + 2, k : k + 2] = sign * np.array([-arm[1], arm[0]])
        matrix[2, 8] = 1.0
        found = np.linalg.solve(matrix, rest)
        for name, k in unknown.items():
            known[name].append(found[k : k + 2])
        torques.append(found[8])
    for formulation in EVERY:
        run = done(m.simulate(0.6, t_eval=t, solver=pt.Solver(formulation)))
        for name in "ABCD":
            yield Held(f"{name}, {formulation}", run.joint(name).force[:, :2], known[name], 1e-6)
        yield Held(f"drive, {formulation}", run.joint("A").drive[:, 0], torques, 1e-6)


def andrews(coordinates: str) -> Case:
    from dataclasses import replace

    @right(f"Andrews' squeezer to 0.03 s, {coordinates}", "published angles, to their digits")
    def ask() -> Iterator[Held]:
        entry = pt.catalogue.entry("andrews-squeezer")
        run = done(entry.simulate(rtol=1e-11, atol=1e-13, coordinates=coordinates))
        for check in entry.checks:
            yield Held(check.name, check.error(run), 0.0, check.tolerance)

    return replace(ask, name=f"andrews_{coordinates}")


CASES = [andrews("relative")]


@right("a double pendulum for 3 s, every formulation", "Lagrange's equations by hand, integrated by SciPy")
def double_pendulum() -> Iterator[Held]:
    m = pt.Mechanism("double", gravity=(0, -G, 0))
    one = m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    two = m.add_rod("two", start=(1, 0, 0), end=(1.7, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, two, point=(1, 0, 0))
    t = np.linspace(0, 2, 21)
    known = double_known(t, (1.0, 2.0), (1.0, 0.7))
    for coordinates in ("relative", "absolute"):
        for formulation in EVERY:
            if coordinates == "absolute" and formulation in ("explicit-closing", "fixed"):
                continue  # the one knows none, the other comes to a dead point
            run = done(
                m.simulate(
                    2.0, t_eval=t, coordinates=coordinates, solver=pt.Solver(formulation), rtol=1e-10, atol=1e-12
                )
            )
            angles = run.joint("A").position[:, 0], run.joint("B").position[:, 0]
            found = np.stack([angles[0], angles[0] + angles[1]], 1)
            yield Held(f"{coordinates}, {formulation}", found, known, 1e-6)


def double_known(t: Array, masses: tuple[float, float], lengths: tuple[float, float]) -> Array:
    """Angles of two uniform rods from the axis of x, let go along it."""
    (m1, m2), (l1, l2) = masses, lengths

    def rates(t: float, y: Array) -> list[float]:
        x1, x2, w1, w2 = y
        mixed, apart = 0.5 * m2 * l1 * l2, x1 - x2
        matrix = [[m1 * l1**2 / 3 + m2 * l1**2, mixed * np.cos(apart)], [mixed * np.cos(apart), m2 * l2**2 / 3]]
        right_side = [
            -mixed * np.sin(apart) * w2**2 - G * (m1 / 2 + m2) * l1 * np.cos(x1),
            mixed * np.sin(apart) * w1**2 - G * m2 / 2 * l2 * np.cos(x2),
        ]
        return [w1, w2, *np.linalg.solve(matrix, right_side)]

    return solve_ivp(rates, (0, t[-1]), [0.0] * 4, t_eval=t, rtol=1e-12, atol=1e-13, method="DOP853").y[:2].T


@right(
    "a chain of five links between two pins, at rest",
    "equilibrium by SciPy's root finding: it stays, the pins carry the horizontal pull and half the weight",
)
def hanging_chain() -> Iterator[Held]:
    # symmetric: links at angles -x1, -x2, 0, x2, x1; horizontal pull H; joints below carry what hangs further in
    span, mass = 3.5, 2.0
    tangents = (2.0, 1.0)  # of the links, in units of m g / H

    def width(pull: float) -> float:
        return 1.0 + 2.0 * sum(np.cos(np.arctan(k * mass * G / pull)) for k in tangents) - span

    pull = brentq(width, 1e-3, 1e3, xtol=1e-15)
    angles = [-np.arctan(k * mass * G / pull) for k in tangents]
    angles = [*angles, 0.0, *(-x for x in reversed(angles))]
    points = np.vstack([[0, 0], np.cumsum([[np.cos(x), np.sin(x)] for x in angles], axis=0)])
    m = pt.Mechanism("chain", gravity=(0, -G, 0))
    ends = [(*p, 0.0) for p in points]
    rods = [m.add_rod(f"rod{i}", start=ends[i], end=ends[i + 1], mass=mass) for i in range(5)]
    bodies = [m.ground, *rods, m.ground]
    for i in range(6):
        m.add_revolute(f"J{i}", bodies[i], bodies[i + 1], point=ends[i])
    run = done(m.simulate(2.0))
    yield Held("rest", run.body("rod2").position, ends[2], 1e-9)
    yield Held("accelerations", run.vdot, 0.0, 1e-6)
    yield Held("pin", run.joint("J0").force[:, :2], [-pull, 2.5 * mass * G], 1e-6)
    yield Held("lowest", run.joint("J3").force[:, :2], [-pull, -0.5 * mass * G], 1e-6)


@right("a pendulum let go 0.001 rad from the top", "elliptic functions")
def from_the_top() -> Iterator[Held]:
    amplitude = np.pi - 1e-3
    m = pendulum(drawn=amplitude)
    run = done(m.simulate(4.0, rtol=1e-12, atol=1e-14))
    # an error at the top has grown a thousandfold when the rod is down
    yield Held("angle", run.q[:, 0] + amplitude, swing(run.t, amplitude), 1e-7)


@right("a pendulum that just goes over the top, hundred times round", "elliptic functions; whole turns are counted")
def round_and_round() -> Iterator[Held]:
    m = pendulum()
    rate = 12.0
    for coordinates in ("relative", "absolute"):
        run = done(
            m.simulate(60.0, initial=m.assemble(rates={"A": rate}), rtol=1e-11, atol=1e-13, coordinates=coordinates)
        )
        yield Held(coordinates, run.joint("A").position[:, 0], turning(run.t, rate), 1e-6)
        yield Held("turns", run.joint("A").position[-1, 0] > 2 * np.pi * 90, True, 0.0)


@right(
    "a trammel: a rod whose ends slide on two walls across each other",
    "closed form: it turns as a pendulum, its middle runs on a circle",
)
def trammel() -> Iterator[Held]:
    tilt, length = 0.4, 2.0
    low, high = (length * np.sin(tilt), 0.0, 0.0), (0.0, length * np.cos(tilt), 0.0)
    m = pt.Mechanism("ladder", gravity=(0, -G, 0))
    rod = m.add_rod("rod", start=low, end=high, mass=3.0)
    shoe = [m.add_body(name, mass=0.5, inertia=(0, 0, 0), position=p) for name, p in (("foot", low), ("head", high))]
    m.add_prismatic("floor", m.ground, shoe[0], axis=(1, 0, 0))
    m.add_prismatic("wall", m.ground, shoe[1], axis=(0, 1, 0))
    m.add_revolute("P", shoe[0], rod, point=low)
    m.add_revolute("Q", shoe[1], rod, point=high)
    run = done(m.simulate(0.8, rtol=1e-10, atol=1e-12))
    # x from the wall: both shoes together move as one at L
    pace = (3.0 / 2 + 0.5) * G * length / (3.0 * length**2 / 3 + 0.5 * length**2)
    known = solve_ivp(
        lambda t, y: [y[1], pace * np.sin(y[0])], (0, 0.8), [tilt, 0], t_eval=run.t, rtol=1e-12, atol=1e-13
    ).y[0]
    middle = run.body("rod").point((0.5 * length, 0, 0))[:, :2]
    yield Held("middle", middle, 0.5 * length * np.stack([np.sin(known), np.cos(known)], 1), 1e-7)


@right("a four-bar by every rule of choice, method and correction", "closed form of the rocker; all agree on the crank")
def choices() -> Iterator[Held]:
    m = four_bar(GENERAL)
    start = m.assemble(rates={"A": 5.0})
    t = np.linspace(0, 2, 21)
    first = done(m.simulate(2.0, initial=start, t_eval=t, rtol=1e-11, atol=1e-13)).joint("A").position[:, 0]
    choices = [{"selection": x} for x in ("greedy", "individual", "determinant", "normalised-determinant")]
    choices += [
        {"selection": "complete-pivoting"},
        {"selection": "persistence", "window": 0.3},
        {"switch_threshold": 1.0},
    ]
    choices += [{"method": x} for x in ("dopri5", "tsit5")] + [{"correction": "mass-orthogonal"}, {"max_step": 1e-2}]
    choices += [{"weights": {"D": 10.0}}, {"independent": ["A"]}]
    for choice in choices:
        run = done(m.simulate(2.0, initial=start, t_eval=t, rtol=1e-10, atol=1e-12, **grouped(choice)))
        crank = run.joint("A").position[:, 0]
        off = run.joint("D").position[:, 0] - rocker(crank)
        yield Held(f"rocker, {choice}", off - 2 * np.pi * np.round(off / (2 * np.pi)), 0.0, 1e-11)
        yield Held(f"crank, {choice}", crank, first, 1e-6)


@right("two springs and a torque that swings, on a cart", "closed form: resonance grows linearly")
def resonance() -> Iterator[Held]:
    m = pt.Mechanism("cart", gravity=(0, -G, 0))
    m.add_body("cart", mass=2.0, inertia=(1, 1, 1))
    m.add_prismatic("S", m.ground, "cart", axis=(1, 0, 0))
    m.add_spring("left", "ground", (-3, 0, 0), "cart", (0, 0, 0), stiffness=5.0)
    m.add_spring("right", "ground", (3, 0, 0), "cart", (0, 0, 0), stiffness=3.0)
    m.add_torque("S", lambda t, state: 0.3 * np.cos(2.0 * t))
    run = done(m.simulate(12.0, rtol=1e-10, atol=1e-12))
    known = 0.3 / (2 * 2.0 * 2.0) * run.t * np.sin(2.0 * run.t)
    yield Held("way", run.q[:, 0], known, 1e-8)
    yield Held("work", run.energy.work, run.energy.total - run.energy.total[0], 1e-8)


@right(
    "a disc rolling on a line, by hand, as an integrable row for velocities",
    "closed form: two thirds of the slope's pull",
)
def rolling() -> Iterator[Held]:
    disc = pt.System(
        2,
        mass=np.diag([3.0, 0.5 * 3.0 * 0.2**2]),
        forces=(3.0 * G * 0.5, 0.0),
        jacobian=lambda t, q: [[1.0, -0.2]],
        bias=lambda t, q, v: [0.0],
        names=["way", "turn"],
    )
    for formulation in ("projective", "multipliers", "svd", "range-space"):
        run = pt.simulate(disc, 2.0, [0.0, 0.0], [0.0, 0.0], solver=pt.Solver(formulation))
        travel = 0.5 * run.t**2 * G * 0.5 * 2 / 3
        yield Held(formulation, done(run).q, np.stack([travel, travel / 0.2], 1), 1e-8)
        yield Held("friction", run.multipliers[:, 0], -3.0 * G * 0.5 / 3, 1e-9)


@right("a drum turned by a torque against a damper", "closed form: an exponential; torque and damper do the work")
def drum() -> Iterator[Held]:
    m = pt.Mechanism("winch", gravity=(0, -G, 0))
    m.add_body("drum", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.add_revolute("A", m.ground, "drum", point=(0, 0, 0))
    m.add_torsion_spring("A", stiffness=0.0, damping=0.7)
    m.add_torque("A", 2.1)
    run = done(m.simulate(5.0, rtol=1e-10, atol=1e-12))
    pace = 3.0 * (1 - np.exp(-7.0 * run.t))
    yield Held("rate", run.v[:, 0], pace, 1e-8)
    # a torque that stays has a potential, so that what is left is the damper's: integral of 0.7 pace^2
    fade = np.exp(-7.0 * run.t)
    yield Held("work", run.energy.work, -6.3 * (run.t - 2 * (1 - fade) / 7 + (1 - fade**2) / 14), 1e-8)
