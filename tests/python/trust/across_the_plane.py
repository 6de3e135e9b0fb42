"""Loads across the plane

A planar mechanism has reactions across its plane too: forces along the axes of its hinges and moments about the other
two directions. They are reported in relative and in absolute coordinates and by every formulation, and components
reported as determined are unique.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from drawings import ABSOLUTE, GENERAL, four_bar
from scipy.integrate import solve_ivp

import partita as pt

from .case import Held, done, right

WEIGHT = 20.0 * 9.81


def door() -> pt.Mechanism:
    """20 kg on a vertical hinge, 0.4 m from its centre of mass."""
    m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    m.add_revolute("hinge", m.ground, "leaf", point=(0, 0, 0), axis=(0, 0, 1))
    return m


@right(
    "a 20 kg door on a vertical hinge, at rest, in both coordinates",
    "statics: (0, 0, 196.2) N and m g r about the hinge",
)
def door_at_rest() -> Iterator[Held]:
    for coordinates in ("relative", "absolute"):
        hinge = done(door().simulate(1.0, coordinates=coordinates)).joint("hinge")
        yield Held(f"force, {coordinates}", hinge.force, [0, 0, 196.2], 1e-10)
        yield Held(f"moment, {coordinates}", hinge.moment, [0, -0.4 * WEIGHT, 0], 1e-10)
        yield Held("determined", hinge.determined, [True] * 5 + [True], 0.0)


@right(
    "the same door swinging, absolute coordinates, every formulation that may change its choice",
    "closed form: weight, centripetal force and their moments",
)
def door_swinging() -> Iterator[Held]:
    m = door()
    start = m.assemble(rates={"hinge": 3.0})
    for formulation in (name for name in ABSOLUTE if name != "fixed"):
        run = done(
            m.simulate(
                1.0,
                initial=start,
                solver=pt.Solver(formulation),
                coordinates="absolute",
                t_eval=[0, 0.4, 1.0],
                rtol=1e-10,
                atol=1e-12,
            )
        )
        angle, hinge = 3.0 * run.t, run.joint("hinge")
        c, s, one = np.cos(angle), np.sin(angle), np.ones(3)
        pull = 20.0 * 0.4 * 9.0
        # a hundred tolerances of the motion
        yield Held(f"force, {formulation}", hinge.force, np.stack([-pull * c, -pull * s, WEIGHT * one], 1), 2e-6)
        yield Held(f"moment, {formulation}", hinge.moment, 0.4 * WEIGHT * np.stack([s, -c, 0 * c], 1), 2e-6)


@right(
    "a plate on a hinge, its centre of mass and its load out of the plane, products of inertia",
    "Newton and Euler by hand along SciPy's motion",
)
def plate_out_of_plane() -> Iterator[Held]:
    mass, com = 3.0, np.array([0.3, -0.1, 0.25])
    inertia = np.array([[0.5, 0.05, -0.07], [0.05, 0.6, 0.04], [-0.07, 0.04, 0.7]])
    load, at, gravity = np.array([2.0, -1.0, 7.0]), np.array([0.5, 0.2, -0.3]), np.array([1.0, -9.0, 2.0])
    m = pt.Mechanism("plate", gravity=gravity)
    m.add_body("plate", mass=mass, inertia=inertia, com=com)
    m.add_revolute("A", m.ground, "plate", point=(0, 0, 0))
    m.add_force("plate", load, point=at)
    about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))

    def turn(angle: float) -> np.ndarray:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])

    def applied(angle: float) -> np.ndarray:
        r = turn(angle)
        return np.cross(r @ com, mass * gravity) + np.cross(r @ at, load)

    t = np.linspace(0.0, 1.5, 16)
    y = solve_ivp(
        lambda t, y: [y[1], applied(y[0])[2] / about[2, 2]], (0, 1.5), [0.0, 0.0], t_eval=t, rtol=1e-12, atol=1e-13
    ).y
    forces, moments = [], []
    for angle, rate in y.T:
        r, w = turn(angle), np.array([0, 0, rate])
        spin = np.array([0, 0, applied(angle)[2] / about[2, 2]])
        arm = r @ com
        forces.append(mass * (np.cross(spin, arm) + np.cross(w, np.cross(w, arm))) - mass * gravity - load)
        whole = r @ about @ r.T
        moments.append(whole @ spin + np.cross(w, whole @ w) - applied(angle))
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(1.5, t_eval=t, coordinates=coordinates, rtol=1e-11, atol=1e-12))
        yield Held(f"angle, {coordinates}", run.joint("A").position[:, 0], y[0], 1e-9)
        yield Held(f"force, {coordinates}", run.joint("A").force, forces, 1e-7)
        yield Held(f"moment, {coordinates}", run.joint("A").moment, moments, 1e-7)


@right(
    "a double pendulum pushed along its axes, both coordinates",
    "statics across the plane: what hangs outboard, with its arms",
)
def pushed_along_the_axes() -> Iterator[Held]:
    m = pt.Mechanism("double", gravity=(0, -9.81, 0))
    one = m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    two = m.add_rod("two", start=(1, 0, 0), end=(2, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, one, point=(0, 0, 0))
    m.add_revolute("B", one, two, point=(1, 0, 0))
    m.add_force("one", (0, 0, 3.0), point=(0.25, 0, 0))
    m.add_force("two", (0, 0, -5.0), point=(1.0, 0, 0.5))
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(1.0, coordinates=coordinates, rtol=1e-10))
        b, tip = run.joint("B").point, run.body("two").point((1, 0, 0.5))
        near = run.body("one").point((0.25, 0, 0))
        forces = [np.array([0, 0, 3.0]), np.array([0, 0, -5.0])]
        yield Held("force along the axis in B", run.joint("B").force[:, 2], 5.0, 1e-9)
        yield Held("force along the axis in A", run.joint("A").force[:, 2], 2.0, 1e-9)
        # a rod that turns about z has its angular momentum along z: across the plane there is balance
        yield Held("moment in B", run.joint("B").moment[:, :2], -np.cross(tip - b, forces[1])[:, :2], 1e-9)
        whole = np.cross(near, forces[0]) + np.cross(tip, forces[1])
        yield Held("moment in A", run.joint("A").moment[:, :2], -whole[:, :2], 1e-9)


@right(
    "a four-bar loaded across its plane: what of it is unique",
    "balance of the whole: the ground's hinges together carry the load",
)
def loop_out_of_plane() -> Iterator[Held]:
    m = four_bar(GENERAL)
    m.add_force("coupler", (0, 0, 11.0), point=(0.7, 0, 0))
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(1.0, coordinates=coordinates))
        a, d = run.joint("A"), run.joint("D")
        yield Held(f"sum, {coordinates}", a.force[:, 2] + d.force[:, 2], -11.0, 1e-9)
        at = run.body("coupler").point((0.7, 0, 0))
        moments = a.moment + d.moment + np.cross(d.point, d.force) + np.cross(at, [0, 0, 11.0])
        yield Held(f"moment, {coordinates}", moments[:, :2], 0.0, 1e-9)
        # hinges with parallel axes share these in a way that only elasticity decides
        for joint in (a, d, run.joint("B"), run.joint("C")):
            yield Held(f"determined in {joint.name}", joint.determined, [1, 1, 0, 0, 0, 1], 0.0)
