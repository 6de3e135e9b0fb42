"""Dead points of fixed coordinates

Coordinates fixed by the user may reach a dead point, where they no longer determine the motion. A run may end there
with a message, or pass correctly; it never continues with a wrong motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from drawings import G, pendulum, slider_crank, stroke, swing, turning
from scipy.integrate import solve_ivp

import partita as pt
from partita.errors import ArgumentError

from .case import Case, Held, done, no_success, refused, right


def turned(run: pt.results.Result) -> np.ndarray:
    """Angle of the rod from the way down."""
    r = run.body("rod").rotation
    return np.unwrap(np.arctan2(r[:, 0, 0], -r[:, 1, 0]))


def over_the_top(
    independent: list[str] | None, rtol: float = 1e-8, formulation: str = "projective", drawn: float = 0.0
) -> Iterator[Held]:
    m = pendulum(drawn=drawn)
    # as fast as if it had 9 rad/s at the bottom
    rate = float(np.sqrt(81.0 - 3.0 * G * (1.0 - np.cos(drawn))))
    run = m.simulate(
        2.0, initial=m.assemble(rates={"A": rate}), coordinates="absolute", independent=independent, rtol=rtol,
        atol=1e-2 * rtol, solver=pt.Solver(formulation),
    )  # fmt: skip
    known = solve_ivp(
        lambda t, y: [y[1], -1.5 * G * np.sin(y[0])], (0, 2), [drawn, rate], t_eval=np.linspace(0, 2, 201),
        rtol=1e-12, atol=1e-12,
    ).y[0][: len(run.t)]  # fmt: skip
    # errors grow on the way up, by some hundred; tighter than 1e-11 nothing is
    yield Held("angle", turned(run), known, max(200.0 * rtol, 1e-9))
    done(run)


def stopped(fixed: str, formulation: str, rtol: float) -> Case:
    @no_success(
        f"a pendulum turning over, `{fixed}` fixed, `{formulation}`, rtol {rtol:.0e}",
        "singular",
        "are at a dead point",
    )
    def ask() -> Iterator[Held]:
        yield from over_the_top([fixed], rtol, formulation, 0.7)

    return replace(ask, name=f"over_{fixed[-1]}_{formulation}_{rtol:.0e}".replace("-", "_"))


CASES = [stopped(fixed, "wehage-haug", rtol) for fixed in ("rod.x", "rod.y") for rtol in (1e-4, 1e-8, 1e-12)]
CASES += [
    stopped(fixed, name, rtol)
    for fixed, name, rtols in (
        ("rod.x", "projective", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
        ("rod.y", "projective", (1e-4, 1e-8, 1e-12)),
        ("rod.x", "fixed", (1e-5,)),
    )
    for rtol in rtols
]


@refused(
    "the same started hanging with `rod.y` fixed, which stands still there", ArgumentError, "cannot be independent here"
)
def fixed_where_dead() -> Iterator[Held]:
    yield from over_the_top(["rod.y"])


@right("the same with nothing fixed, absolute coordinates", "elliptic functions")
def over_freely() -> Iterator[Held]:
    yield from over_the_top(None)


@right("the same with the turn fixed, which has no dead point", "elliptic functions")
def over_by_turn() -> Iterator[Held]:
    m = pendulum()
    start = m.assemble(rates={"A": 9.0})
    run = m.simulate(2.0, initial=start, coordinates="absolute", independent=["rod.turn"], rtol=1e-10, atol=1e-12)
    yield Held("angle", turned(done(run)), turning(run.t, 9.0), 1e-7)


@right("a pendulum swinging by 0.5 rad about the bottom, x fixed, which meets no dead point", "elliptic functions")
def small_swing() -> Iterator[Held]:
    m = pendulum(drawn=0.5)
    run = m.simulate(5.0, coordinates="absolute", independent=["rod.x"], rtol=1e-10, atol=1e-12)
    yield Held("angle", turned(done(run)), swing(run.t, 0.5), 1e-7)


def ring(start: float, rate: float, independent: list[str] | None, formulation: str) -> pt.results.Result:
    """A point on a circle of 1 m by hand, from the angle `start` from the way down."""
    system = pt.System(
        n=2,
        mass=np.eye(2),
        forces=(0.0, -G),
        constraints=lambda t, q: [0.5 * (q @ q - 1.0)],
        jacobian=lambda t, q: [q],
        bias=lambda t, q, v: [v @ v],
        names=["x", "y"],
    )
    q0 = [np.sin(start), -np.cos(start)]
    v0 = [rate * np.cos(start), rate * np.sin(start)]
    return pt.simulate(
        system, 3.0, q0, v0, independent=independent, solver=pt.Solver(formulation), rtol=1e-9, atol=1e-11
    )


@no_success("a point on a circle by hand, going round with `y` fixed, `wehage-haug`", "singular", "are at a dead point")
def circle_fixed() -> Iterator[Held]:
    done(ring(0.3, 8.0, ["y"], "wehage-haug"))
    yield from ()


@no_success("the same with `x` fixed, `projective`", "singular", "are at a dead point")
def circle_fixed_in_x() -> Iterator[Held]:
    run = ring(0.0, 8.0, ["x"], "projective")
    angle = turning(run.t, 8.0, length=1.5)
    yield Held("path", run.q, np.stack([np.sin(angle), -np.cos(angle)], 1), 1e-7)
    done(run)


@right("the free pendulum tells no singular position, in absolute coordinates and 2k states", "elliptic functions")
def nothing_singular() -> Iterator[Held]:
    m = pendulum()
    for rate in (8.0, 12.0):
        for formulation in ("projective", "wehage-haug", "svd", "multipliers"):
            run = m.simulate(
                2.0,
                initial=m.assemble(rates={"A": rate}),
                coordinates="absolute",
                solver=pt.Solver(formulation),
                rtol=1e-8,
                atol=1e-10,
            )
            yield Held(f"angle, {formulation}", turned(done(run)), turning(run.t, rate), 5e-7)
            yield Held("told", sum("singular" in note for note in run.notes), 0, 0)


@right("the same with coordinates that take turns, every formulation", "elliptic functions of the simple pendulum")
def circle_free() -> Iterator[Held]:
    # a simple pendulum is a uniform rod of 1.5 times its length
    for formulation in (
        "projective",
        "svd",
        "qr",
        "gram-schmidt",
        "wehage-haug",
        "multipliers",
        "range-space",
        "proximal",
    ):
        run = done(ring(0.0, 8.0, None, formulation))
        angle = turning(run.t, 8.0, length=1.5)
        yield Held(formulation, run.q, np.stack([np.sin(angle), -np.cos(angle)], 1), 1e-6)


@right(
    "a slider-crank driven from the slider's side by gravity, crank coordinates fixed",
    "energy integral with the closed form of the slider",
)
def crank_fixed() -> Iterator[Held]:
    m = slider_crank()
    run = done(m.simulate(1.0, initial=m.assemble(rates={"main": 20.0}), independent=["main"], rtol=1e-10, atol=1e-12))
    angle = run.joint("main").position[:, 0]
    yield Held("slider", run.joint("bore").position[:, 0], stroke(angle) - 0.4, 1e-12)
    yield Held("energy", run.energy.total / run.energy.total[0], 1.0, 1e-8)


@no_success("the same with the slider fixed, which has dead points, `wehage-haug`", "singular", "are at a dead point")
def slider_fixed() -> Iterator[Held]:
    m = slider_crank()
    start = m.assemble(targets={"main": 0.7}, rates={"main": 20.0})
    done(m.simulate(1.0, initial=start, independent=["bore"], solver=pt.Solver("wehage-haug")))
    yield from ()
