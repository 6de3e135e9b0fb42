"""Outputs in change points

A parallelogram moves through its change points with outputs near them and at them. Times, coordinates and velocities
are right; accelerations and reactions that are not determined there are NaN, never arbitrary numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from drawings import parallelogram

import partita as pt

from .case import Case, Held, done, right

RATE = np.pi
MASSES = (0.3, 0.5, 0.4)
"""Of `four_bar`, which draws the parallelogram."""


def turning_on(drawn: float, outputs: int, coordinates: str, formulation: str) -> Iterator[Held]:
    """One turn of a parallelogram at a constant rate, drawn at `drawn` degrees."""
    crank, first = 0.5, np.radians(drawn)
    m = parallelogram(first, crank)
    run = m.simulate(
        2.0, t_eval=np.linspace(0.0, 2.0, outputs), initial=m.assemble(rates={"A": RATE}), coordinates=coordinates,
        solver=pt.Solver(formulation),
    )  # fmt: skip
    angle = first + RATE * run.t
    c, s = np.cos(angle), np.sin(angle)
    yield Held("A", run.joint("A").position[:, 0], angle - first, 1e-7)
    yield Held("rate of A", run.joint("A").velocity[:, 0], RATE, 1e-6)
    yield Held("rate of D", run.joint("D").velocity[:, 0], RATE, 1e-6)
    yield Held("place of C", run.joint("C").point[:, :2], np.stack([1 + crank * c, crank * s], 1), 1e-7)
    known = np.isfinite(run.vdot).all(axis=1)
    if coordinates == "relative":
        yield Held("accelerations", run.vdot[known], 0.0, 1e-4)
    yield Held("outputs without accelerations", np.sum(~known) <= 2, True, 0.0)
    # each pin carries half of the coupler, which only shifts; a crank needs half of its own mass besides
    inwards = -(RATE**2) * crank * np.stack([c, s], 1)
    # next to the line a reaction follows from differences of its sine: so do its errors grow
    share = np.minimum(np.abs(s)[:, None] / 0.1, 1.0)
    for name, mass in (
        ("A", 0.5 * (MASSES[0] + MASSES[1])),
        ("C", -0.5 * MASSES[1]),
        ("D", 0.5 * (MASSES[2] + MASSES[1])),
    ):
        joint = run.joint(name)
        # what has no value is NaN
        unique = joint.determined_at[:, :2] & np.isfinite(joint.force[:, :2])
        off = np.where(unique, joint.force[:, :2] - mass * inwards, 0.0)
        yield Held(f"force in {name}", share * off, 0.0, 1e-4)
        yield Held(f"marked in {name} away from the line", unique[np.abs(s) > 1e-2], True, 0.0)
        # not unique where the links lie in line, if an output is there
        yield Held(f"marked in {name} in line", unique.all(axis=1) & (np.abs(s) < 1e-9), False, 0.0)
    done(run)


def case(drawn: float, outputs: int, coordinates: str = "relative", formulation: str = "projective") -> Case:
    @right(
        f"parallelogram without gravity drawn at {drawn:g} degrees, {outputs} outputs over a turn, {coordinates}, "
        f"`{formulation}`",
        "closed form: every rate stays, each pin carries half of the coupler",
    )
    def ask() -> Iterator[Held]:
        yield from turning_on(drawn, outputs, coordinates, formulation)

    name = f"drawn_at_{drawn:g}_outputs_{outputs}_{coordinates}_{formulation}"
    return replace(ask, name=name.replace(".", "_").replace("-", "_"))


CASES = [case(60.0, 362), case(60.0, 11), case(57.29577951308232, 361), case(50.0, 362, "absolute")]
CASES += [case(60.0, 362, formulation=name) for name in ("svd", "qr", "wehage-haug")]
# an output on every whole degree, those of the change points among them
CASES += [case(drawn, 361) for drawn in (1.0, 30.0, 37.0, 45.0, 60.0, 90.0)]
CASES += [
    case(drawn, 361, formulation=name)
    for drawn in (30.0, 60.0)
    for name in ("svd", "qr", "wehage-haug", "explicit-closing", "multipliers", "range-space", "proximal")
]
CASES += [case(30.0, 361, "absolute")]
