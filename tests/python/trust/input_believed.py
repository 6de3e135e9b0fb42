"""Input that is wrong

An initial state that violates the constraints is corrected, with a report of the change, or refused; derivatives of a
user-defined system that do not match its constraints are named, at the start or at a later position.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from drawings import pendulum
from scipy.integrate import solve_ivp

import partita as pt
from partita.errors import ArgumentError, DerivativeError, DescriptionError, EvaluationError

from .case import Case, Held, done, no_success, refused, right


def swinging(**change: Any) -> pt.System:
    """A point at distance 2 from a pivot that moves as 0.3 sin 2t along x."""

    def gap(t: float, q: np.ndarray) -> np.ndarray:
        return q - np.array([0.3 * np.sin(2 * t), 0.0])

    def pace(t: float) -> np.ndarray:
        return np.array([0.6 * np.cos(2 * t), 0.0])

    functions: dict[str, Any] = {
        "n": 2,
        "mass": np.eye(2),
        "forces": (0.0, -9.81),
        "constraints": lambda t, q: [0.5 * (gap(t, q) @ gap(t, q) - 4.0)],
        "jacobian": lambda t, q: [gap(t, q)],
        "constraint_rate": lambda t, q: [-gap(t, q) @ pace(t)],
        "bias": lambda t, q, v: [(v - pace(t)) @ (v - pace(t)) + gap(t, q) @ np.array([1.2 * np.sin(2 * t), 0.0])],
        "names": ["x", "y"],
        **change,
    }
    return pt.System(**functions)


START = [1.2, -1.6], [0.6, 0.0]


@right("a pendulum on a moving pivot by hand, right derivatives", "the equation of its angle, integrated by SciPy")
def moving_pivot() -> Iterator[Held]:
    run = done(pt.simulate(swinging(), 3.0, *START, rtol=1e-10, atol=1e-12))
    angle = solve_ivp(
        lambda t, y: [y[1], -9.81 / 2 * np.sin(y[0]) + 1.2 / 2 * np.sin(2 * t) * np.cos(y[0])], (0, 3),
        [np.arctan2(1.2, 1.6), 0.0], t_eval=run.t, rtol=1e-12, atol=1e-13,
    ).y[0]  # fmt: skip
    known = np.stack([2 * np.sin(angle) + 0.3 * np.sin(2 * run.t), -2 * np.cos(angle)], 1)
    yield Held("x, y", run.q, known, 1e-7)


def wrong(name: str, title: str, words: str, change: dict[str, Any]) -> Case:
    @refused(title, DerivativeError, words)
    def ask() -> Iterator[Held]:
        done(pt.simulate(swinging(**change), 3.0, *START))
        yield from ()

    return replace(ask, name=name)


CASES = [
    wrong(
        "sign",
        "its Jacobian of the wrong sign",
        "jacobian[0, 1] is",
        {"jacobian": lambda t, q: [-(q - [0.3 * np.sin(2 * t), 0.0])]},
    ),
    wrong(
        "thousandth",
        "its Jacobian with one entry off by a thousandth",
        "jacobian[0, 1]",
        {"jacobian": lambda t, q: [[q[0] - 0.3 * np.sin(2 * t), 1.001 * q[1]]]},
    ),
    wrong("no_rate", "its constraint rate left out", "constraint_rate[0]", {"constraint_rate": None}),
    wrong("no_bias", "its bias left zero", "bias[0]", {"bias": lambda t, q, v: [0.0]}),
    wrong("bias_sign", "its bias of the wrong sign", "bias[0]", {"bias": lambda t, q, v: [-(v @ v)]}),
]  # fmt: skip


@no_success(
    "its bias without the pivot's acceleration, which is zero at the start",
    "evaluation-failed",
    "the result is wrong: bias[0]",
)
def late_bias() -> Iterator[Held]:
    change = {"bias": lambda t, q, v: [(v - [0.6 * np.cos(2 * t), 0.0]) @ (v - [0.6 * np.cos(2 * t), 0.0])]}
    done(pt.simulate(swinging(**change), 3.0, *START))
    yield from ()


@refused("a Jacobian of wrong sign on a circle of a micrometre", DerivativeError, "jacobian[0, 0]")
def small_circle() -> Iterator[Held]:
    done(pt.simulate(circle(1e-6, -1.0), 1.0, [1e-6, 0.0], [0.0, 0.0]))
    yield from ()


def circle(size: float = 1.0, sign: float = 1.0) -> pt.System:
    return pt.System(
        n=2,
        mass=np.eye(2),
        forces=(0.0, -9.81 * size),
        constraints=lambda t, q: [q @ q - size**2],
        jacobian=lambda t, q: [2.0 * sign * q],
        bias=lambda t, q, v: [2.0 * (v @ v)],
    )


@refused("a start far from its conditions", ArgumentError, "constraint 0 has a closure error of 2;")
def far_start() -> Iterator[Held]:
    pt.simulate(circle(), 1.0, [1.0, math.sqrt(2.0)], [0.0, 0.0])
    yield from ()


@right(
    "a start that misses its circle by 1e-6 and its tangent by 0.25 m/s",
    "the notes tell both; the motion from the closed start by SciPy",
)
def near_start() -> Iterator[Held]:
    run = done(pt.simulate(circle(), 1.0, [1.0 + 1e-6, 0.0], [0.25, 1.0], rtol=1e-10, atol=1e-12))
    reported = " ".join(run.notes)
    yield Held(
        "told",
        ["error of 1.9" in reported or "error of 2e-6" in reported, "velocities by up to 0.25" in reported],
        True,
        0.0,
    )
    angle = solve_ivp(
        lambda t, y: [y[1], -9.81 * np.cos(y[0])], (0, 1), [0.0, 1.0], t_eval=run.t, rtol=1e-12, atol=1e-13
    ).y[0]
    # the radius was off by 1e-6, and so may be the rate
    yield Held("x, y", run.q, np.stack([np.cos(angle), np.sin(angle)], 1), 1e-5)


@right("a four-bar whose start has one velocity changed by hand", "the notes tell by how much; the loops stay closed")
def changed_velocity() -> Iterator[Held]:
    m = pt.catalogue.load("four-bar")
    state = m.assemble(rates={"A": 1.0})
    v = state.v.copy()
    v[1] += 0.125
    run = done(
        m.simulate(0.5, initial=pt.State(0.0, state.q, v, names=state.names, velocity_names=state.velocity_names))
    )
    yield Held("told", any("velocities by up to" in note for note in run.notes), True, 0.0)
    yield Held("closure", run.velocity_closure, 0.0, 1e-12)


@refused("a mass matrix with a negative entry", DescriptionError, "positive definite")
def negative_mass() -> Iterator[Held]:
    m = pt.System(2, mass=np.diag([1.0, -1.0]), forces=(0.0, 0.0))
    pt.simulate(m, 1.0, [0.0, 0.0], [0.0, 0.0])
    yield from ()


@refused("a mass matrix that is not symmetric, as a function", EvaluationError, "not symmetric")
def crooked_mass() -> Iterator[Held]:
    m = pt.System(2, mass=lambda t, q: [[1.0, 0.3], [0.2, 1.0]], forces=(0.0, 0.0))
    pt.simulate(m, 1.0, [0.0, 0.0], [0.0, 0.0])
    yield from ()


@refused("a spatial point on a sphere whose second row is dPhi/dq of another", DerivativeError, "jacobian[1, ")
def second_row() -> Iterator[Held]:
    m = pt.System(
        3,
        mass=np.eye(3),
        forces=(0.0, 0.0, -9.81),
        constraints=lambda t, q: [0.5 * (q @ q - 1), q[0] - q[1]],
        jacobian=lambda t, q: [q, [1.0, 1.0, 0.0]],
        bias=lambda t, q, v: [v @ v, 0.0],
    )
    pt.simulate(m, 1.0, [0.0, 0.0, -1.0], [0.0, 0.0, 0.0])
    yield from ()


@right(
    "a sleigh on a paraboloid: redundant rows beside rows for velocities only",
    "accelerations of least norm by NumPy at every output",
)
def sleigh() -> Iterator[Held]:
    mass, push = np.diag([1.0, 1.0, 0.5, 2.0]), np.array([0.2, -0.1, 0.3, -9.81])

    def rows(t: float, q: np.ndarray) -> np.ndarray:
        x, y, turn, _ = q
        height = np.array([-x, -y, 0.0, 1.0])
        slip = np.array([-np.sin(turn), np.cos(turn), 0.0, 0.0])
        return np.array([height, -2.0 * height, height, slip + 3.0 * height, slip])

    def bias(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        height = -(v[0] ** 2) - v[1] ** 2
        slip = -v[2] * (np.cos(q[2]) * v[0] + np.sin(q[2]) * v[1])
        return np.array([height, -2.0 * height, height, slip + 3.0 * height, slip])

    def gaps(t: float, q: np.ndarray) -> np.ndarray:
        gap = q[3] - 0.5 * (q[0] ** 2 + q[1] ** 2)
        return np.array([gap, -2.0 * gap])

    m = pt.System(4, mass, push, gaps, rows, bias=bias)
    for formulation in ("projective", "svd", "multipliers", "proximal"):
        run = done(pt.simulate(m, 1.5, [0.3, 0.4, 0.0, 0.125], [1.0, 0.0, 0.2, 0.3], solver=pt.Solver(formulation)))
        for q, v, vdot in zip(run.q[::20], run.v[::20], run.vdot[::20], strict=True):
            c = rows(0.0, q)
            saddle = np.block([[mass, -c.T], [c, np.zeros((5, 5))]])
            exact = np.linalg.lstsq(saddle, np.concatenate([push, -bias(0.0, q, v)]), rcond=1e-12)[0]
            yield Held(f"acceleration, {formulation}", vdot, exact[:4], 1e-10)


@right(
    "a knife edge on an inclined plane",
    "closed form: the sleigh goes back and forth and drifts sideways along a cycloid",
)
def knife_edge() -> Iterator[Held]:
    pull, spin = 3.0, 2.0

    m = pt.System(
        3,
        mass=np.diag([1.0, 1.0, 0.3]),
        forces=(pull, 0.0, 0.0),
        jacobian=lambda t, q: [[-np.sin(q[2]), np.cos(q[2]), 0.0]],
        bias=lambda t, q, v: [-v[2] * (np.cos(q[2]) * v[0] + np.sin(q[2]) * v[1])],
    )
    for formulation in ("projective", "multipliers", "gram-schmidt", "proximal"):
        run = done(pt.simulate(m, 4.0, [0, 0, 0], [0, 0, spin], solver=pt.Solver(formulation), rtol=1e-10, atol=1e-12))
        u = spin * run.t
        known = pull / (2 * spin**2) * np.stack([np.sin(u) ** 2, u - 0.5 * np.sin(2 * u)], 1)
        yield Held(formulation, run.q, np.column_stack([known, u]), 1e-8)


def failing(name: str, title: str, words: str, bad: Any) -> Case:
    @no_success(title, "evaluation-failed", words)
    def ask() -> Iterator[Held]:
        m = pendulum()
        m.add_torque("A", value=lambda t, state: 0.1 if t < 0.5 else bad(), name="motor")
        run = m.simulate(1.0)
        yield Held("what was computed is kept", 0.3 < run.t[-1] < 0.5, True, 0.0)
        same = pendulum()
        same.add_torque("A", value=0.1)
        yield Held("and right", run.q, same.simulate(1.0).q[: len(run.t)], 1e-7)
        done(run)

    return replace(ask, name=name)


def mistake() -> float:
    raise ZeroDivisionError("my own mistake")


CASES += [
    failing("raises", "a torque whose function raises at 0.5 s", "my own mistake", mistake),
    failing("returns_nan", "a torque whose function returns NaN from 0.5 s on", "nan", lambda: math.nan),
    failing(
        "returns_text", "a torque whose function returns text from 0.5 s on", "must return one number", lambda: "fast"
    ),
]
