"""Bodies in space

Tops, free bodies and shafts, whose motion is known in closed form.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from drawings import ABSOLUTE, G, swing
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipj

import partita as pt

from .case import Held, done, right


def free_body(inertia: tuple[float, float, float]) -> pt.Mechanism:
    m = pt.Mechanism("free", gravity=(0, 0, 0))
    m.add_body("b", mass=2.0, inertia=inertia)
    m.add_free("F", m.ground, "b")
    return m


def spun(m: pt.Mechanism, velocities: list[float], coordinates: str = "relative") -> pt.State:
    """The drawing, moving with these."""
    start = m.assemble(coordinates=coordinates)
    return pt.State(0.0, start.q, velocities, names=start.names, velocity_names=start.velocity_names)


@right(
    "a free body with three different moments of inertia, 20 s",
    "Euler's equations by Jacobi's elliptic functions; momentum in the world",
)
def euler() -> Iterator[Held]:
    i1, i2, i3 = 3.0, 2.0, 1.0
    w1, w3 = 1.0, 0.6
    m = free_body((i1, i2, i3))
    run = done(m.simulate(20.0, initial=spun(m, [0, 0, 0, w1, 0, w3]), rtol=1e-11, atol=1e-13))
    # w2 starts at zero; 2T and L^2 determine the modulus
    energy, momentum = i1 * w1**2 + i3 * w3**2, (i1 * w1) ** 2 + (i3 * w3) ** 2
    assert momentum > energy * i2
    pace = np.sqrt((i1 - i2) * (momentum - energy * i3) / (i1 * i2 * i3))
    modulus = (i2 - i3) * (energy * i1 - momentum) / ((i1 - i2) * (momentum - energy * i3))
    sn, cn, dn, _ = ellipj(pace * run.t, modulus)
    first = np.sqrt((momentum - energy * i3) / (i1 * (i1 - i3))) * dn
    second = -np.sqrt((energy * i1 - momentum) / (i2 * (i1 - i2))) * sn
    third = np.sqrt((energy * i1 - momentum) / (i3 * (i1 - i3))) * cn
    body = run.body("b")
    own = np.einsum("nji,nj->ni", body.rotation, body.angular_velocity)
    sign = np.sign(own[1, 1] * second[1])
    yield Held("rates", own, np.stack([first, sign * second, third], 1), 1e-8)
    whole = np.einsum("nij,nj->ni", body.rotation, own * [i1, i2, i3])
    yield Held("momentum", whole, [i1 * w1, 0, i3 * w3], 1e-8)


@right(
    "a book thrown about its middle axis, which turns over, absolute coordinates",
    "momentum and energy stay; the sign of the middle rate changes as sn of the elliptic integral",
)
def middle_axis() -> Iterator[Held]:
    inertia = np.array([3.0, 2.0, 1.0])
    m = free_body(tuple(inertia))
    start = m.convert(spun(m, [0, 0, 0, 1e-3, 2.0, 0.0]), "absolute")
    run = done(m.simulate(30.0, initial=start, coordinates="absolute", rtol=1e-11, atol=1e-13))
    body = run.body("b")
    own = np.einsum("nji,nj->ni", body.rotation, body.angular_velocity)
    y = solve_ivp(
        lambda t, w: [(inertia[1] - inertia[2]) / inertia[0] * w[1] * w[2],
                      (inertia[2] - inertia[0]) / inertia[1] * w[2] * w[0],
                      (inertia[0] - inertia[1]) / inertia[2] * w[0] * w[1]],
        (0, 30), [1e-3, 2.0, 0.0], t_eval=run.t, rtol=1e-12, atol=1e-14,
    ).y.T  # fmt: skip
    # each turn-over multiplies an error by some thousand
    yield Held("rates", own, y, 1e-4)
    whole = np.einsum("nij,nj->ni", body.rotation, own * inertia)
    yield Held("momentum", whole, [3e-3, 4.0, 0.0], 1e-8)
    yield Held("it turns over", own[:, 1].min() < -1.9, True, 0.0)


@right("a stone thrown with spin, 3 s, both coordinates", "closed form: parabola and even turn")
def stone() -> Iterator[Held]:
    m = pt.Mechanism("stone", gravity=(0, 0, -G))
    m.add_body("b", mass=2.0, inertia=(0.5, 0.5, 0.5), com=(0.1, 0, 0), position=(1, 2, 3))
    m.add_free("F", m.ground, "b")
    start = spun(m, [2.0, -1.0, 5.0, 0.0, 0.0, 4.0])
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(3.0, initial=start, coordinates=coordinates, rtol=1e-11, atol=1e-13))
        body = run.body("b")
        # the origin has the velocity given; the centre of mass that and the spin's
        centre = np.array([1.1, 2, 3]) + np.outer(run.t, [2.0, -1.0 + 0.4, 5.0])
        centre[:, 2] -= 0.5 * G * run.t**2
        yield Held(f"centre, {coordinates}", body.point((0.1, 0, 0)), centre, 1e-8)
        c, s, o = np.cos(4 * run.t), np.sin(4 * run.t), 0 * run.t
        turn = np.stack([np.stack([c, -s, o], 1), np.stack([s, c, o], 1), np.stack([o, o, o + 1], 1)], 1)
        yield Held(f"turn, {coordinates}", body.rotation, turn, 1e-8)


def upright(tilt: float) -> np.ndarray:
    """Axes of a body turned by `tilt` about x."""
    return np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])


TOP = {"mass": 0.5, "arm": 0.1, "across": 0.004, "along": 0.0015}
"""Of a top on a ball joint: inertia about its centre of mass."""


def top(tilt: float) -> pt.Mechanism:
    m = pt.Mechanism("top", gravity=(0, 0, -G))
    m.add_body(
        "top",
        TOP["mass"],
        (TOP["across"], TOP["across"], TOP["along"]),
        com=(0, 0, TOP["arm"]),
        orientation=upright(tilt),
    )
    m.add_spherical("S", m.ground, "top", point=(0, 0, 0))
    return m


@right(
    "a spinning top that precesses steadily, slowly and fast, both coordinates, all but one formulation",
    "Lagrange: A p^2 cos - C n p + m g l = 0",
)
def steady_top() -> Iterator[Held]:
    tilt, spin = 0.6, 150.0
    a, c = TOP["across"] + TOP["mass"] * TOP["arm"] ** 2, TOP["along"]
    for precession in np.roots([a * np.cos(tilt), -c * spin, TOP["mass"] * G * TOP["arm"]]):
        m = top(tilt)
        # about the upright, in body axes, and about itself so that the whole along itself is `spin`
        own = [0.0, precession * np.sin(tilt), spin]
        start = spun(m, list(upright(tilt) @ own))
        # `fixed` comes to a dead point
        cases = [("relative", "projective"), *(("absolute", name) for name in ABSOLUTE if name != "fixed")]
        for coordinates, formulation in cases:
            run = done(
                m.simulate(
                    0.4, initial=start, rtol=1e-10, atol=1e-12, coordinates=coordinates, solver=pt.Solver(formulation),
                    t_eval=np.linspace(0, 0.4, 9),
                )
            )  # fmt: skip
            axis = run.body("top").rotation[:, :, 2]
            u = precession * run.t
            known = np.stack([np.sin(tilt) * np.sin(u), -np.sin(tilt) * np.cos(u), np.cos(tilt) + 0 * u], 1)
            yield Held(f"axis, {coordinates}, {formulation}", axis, known, 1e-6)


@right("a top let go with its axis at rest, which nods", "quadrature of Lagrange's integrals for one nod")
def nodding_top() -> Iterator[Held]:
    tilt, spin = 0.6, 100.0
    a, c, weight = TOP["across"] + TOP["mass"] * TOP["arm"] ** 2, TOP["along"], TOP["mass"] * G * TOP["arm"]
    m = top(tilt)
    # u = cos of the tilt between its first value and the root of the cubic
    u0, slope = np.cos(tilt), c * spin / a
    lowest = np.roots([2 * weight / a, -(slope**2), 0 * u0 - 2 * weight / a + slope**2 * u0])
    lowest = min(lowest, key=lambda x: abs(x - u0) if abs(x) < 1 else 9)

    def rest(u: float) -> float:
        return 2 * weight / a * (1 - u**2) - slope**2 * (u0 - u)

    middle, half = 0.5 * (u0 + lowest), 0.5 * (u0 - lowest)
    # u = middle + half sin x takes the roots away
    other = 2 * weight / a

    def factor(u: float) -> float:
        # rest(u) / (u - lowest), by the other root of the quadratic
        return other * (slope**2 / other - lowest - u)

    assert abs(rest(middle) - factor(middle) * (middle - lowest)) < 1e-9 * rest(middle)
    period = 2 * quad(lambda x: 1 / np.sqrt(factor(middle + half * np.sin(x))), -np.pi / 2, np.pi / 2, epsabs=1e-13)[0]
    run = done(
        m.simulate(
            5 * period,
            initial=spun(m, list(upright(tilt)[:, 2] * spin)),
            rtol=1e-11,
            atol=1e-13,
            t_eval=period * np.arange(0, 5.1, 0.5),
        )
    )
    axis = run.body("top").rotation[:, 2, 2]
    yield Held("up again after each nod", axis[::2], u0, 1e-8)
    yield Held("lowest between", axis[1::2], lowest, 1e-8)


@right("a ball joint with an arm swinging in a plane through it", "elliptic functions of the simple pendulum")
def ball_pendulum() -> Iterator[Held]:
    m = pt.Mechanism("ball", gravity=(0, 0, -G))
    direction = np.array([np.sin(1.2) * 0.6, np.sin(1.2) * 0.8, -np.cos(1.2)])
    m.add_body("bob", mass=2.0, inertia=(0.01, 0.01, 0.01), com=direction)
    m.add_spherical("S", m.ground, "bob", point=(0, 0, 0))
    run = done(m.simulate(3.0, rtol=1e-11, atol=1e-13))
    # a point at 1 m swings as a uniform rod of 1.5 m; its moment of inertia makes it slower by 0.01 / (m l^2)
    known = swing(run.t, 1.2, length=1.5 * 1.005)
    yield Held("height", run.body("bob").point(direction)[:, 2], -np.cos(known), 1e-7)


@right(
    "a spherical pendulum circling level",
    "closed form: the rate is the root of g over the height; the pull is the weight over its cosine",
)
def conical() -> Iterator[Held]:
    m = pt.Mechanism("conical", gravity=(0, 0, -G))
    tilt, length = 0.7, 0.8
    arm = length * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    m.add_body("bob", mass=3.0, inertia=(0, 0, 0), com=arm)
    m.add_universal("U", m.ground, "bob", point=(0, 0, 0), axis1=(0, 0, 1), axis2=(0, 1, 0))
    rate = np.sqrt(G / (length * np.cos(tilt)))
    run = done(m.simulate(5.0, initial=spun(m, [rate, 0.0]), rtol=1e-10, atol=1e-12))
    u = rate * run.t
    unit = np.stack([np.sin(tilt) * np.cos(u), np.sin(tilt) * np.sin(u), -np.cos(tilt) + 0 * u], 1)
    yield Held("place", run.body("bob").point(arm), length * unit, 1e-7)
    yield Held("pull", run.joint("U").force, -3.0 * G / np.cos(tilt) * unit, 1e-5)


@right(
    "an unbalanced shaft on two bearings",
    "closed form: the bearings carry the dynamic unbalance; what is along the shaft is not unique",
)
def unbalanced() -> Iterator[Held]:
    spin, product = 50.0, 0.02
    m = pt.Mechanism("shaft", gravity=(0, 0, 0))
    m.add_body("shaft", mass=4.0, inertia=[[0.5, 0, product], [0, 0.5, 0], [product, 0, 0.1]], com=(0.001, 0, 0))
    m.add_revolute("left", m.ground, "shaft", point=(0, 0, -0.5))
    m.add_joint("right", m.ground, "shaft", ("z", "rx", "ry", "rz"), point=(0, 0, 0.5))
    run = done(m.simulate(0.5, initial=m.assemble(rates={"left": spin}), rtol=1e-10, atol=1e-12))
    u = spin * run.t
    out = np.stack([np.cos(u), np.sin(u), 0 * u], 1)
    left, right_ = run.joint("left"), run.joint("right")
    yield Held("sum", left.force + right_.force, -4.0 * 0.001 * spin**2 * out, 1e-6)
    # the hinge on the left takes moments too: only force and moment together are unique
    whole = left.moment + np.cross(left.point, left.force) + np.cross(right_.point, right_.force)
    about = np.stack([-np.sin(u), np.cos(u), 0 * u], 1)
    yield Held("moment", whole, product * spin**2 * about, 1e-6)
    yield Held("not unique", left.determined[:2], False, 0.0)
