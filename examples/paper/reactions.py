"""Reactions by three routes over a turn of the four-bar, and what a poor choice of coordinates does to them.

The multipliers of the cut joint are its reaction (43), if the closure constraints are distances along axes that are
known. For the joints that carry coordinates there are two more routes: the Newton-Euler sweep from the leaves to the
ground, and augmented joint coordinates (44), (45). Cutting another joint turns one route into the other, so all three
can be compared in every joint. The multipliers themselves have three formulas: by the metric of the constraints (40),
by the factors of C_D (41), by least squares (42); the second amplifies errors of the accelerations by 1/sqrt(mu) at
most.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from numpy.typing import NDArray
from reference import FOUR_BAR, NAME, START, instant, state

import partita as pt
from partita.errors import SuspectResultWarning
from partita.instant import Instant
from partita.plots.style import COLOURS, dressed, new_figure, positive
from partita.results import Result

Array = NDArray[np.float64]
JOINTS = ("A", "B", "C", "D")
RATE = 6.0
"""Of the crank at the start [rad/s]: enough to turn over."""
ERROR = 1e-6
"""Of the accelerations, in the metric of M, in parts of their length: what (41) is made to amplify."""


def cut(joint: str) -> pt.Mechanism:
    """The four-bar with its loop cut at `joint`."""
    m = pt.catalogue.load(NAME)
    m.joints["D"].change(cut="never")
    m.joints[joint].change(cut="always")
    return m


MODELS = {joint: cut(joint).compile() for joint in JOINTS}


def turning(joint: str, outputs: int) -> Result:
    """A little more than a turn of the crank, with the loop cut at `joint`."""
    first = FOUR_BAR.simulate(1e-6, initial=state(START, RATE))
    at = states(first, joint)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)
        return cut(joint).simulate(1.4, initial=at, t_eval=np.linspace(0.0, 1.4, outputs), rtol=1e-10, atol=1e-12)


def states(done: Result, joint: str) -> list[pt.State]:
    """The outputs of a run in the coordinates of the four-bar cut at `joint`: joint angles, from the drawing."""
    model = MODELS[joint]
    names = list(model.velocity_names)
    q = np.column_stack([done.joint(name).position[:, 0] for name in names])
    v = np.column_stack([done.joint(name).velocity[:, 0] for name in names])
    return [pt.State(float(done.t[n]), q[n], v[n], names=names, velocity_names=names) for n in range(len(done.t))]


def by_cutting(done: Result, joint: str) -> Array:
    """Force (nt, 2) of `joint` on its child, along x and y: the multipliers of the loop cut there."""
    return np.array([MODELS[joint].at(at.q, at.v).multipliers for at in states(done, joint)])


def formulas(at: Instant, i: int) -> list[Array]:
    """lambda (2,) by (40), by (41) with coordinate `i` independent, and by (42)."""
    d = [j for j in range(len(at.v)) if j != i]
    inverse, missing = np.linalg.inv(at.M), at.M @ at.vdot - at.h
    metric = at.C @ inverse @ at.C.T
    first = -np.linalg.solve(metric, at.b + at.C @ inverse @ at.h)
    second = np.linalg.solve(at.C[:, d].T, missing[d])
    third = np.linalg.solve(metric, at.C @ inverse @ missing)
    return [np.asarray(x, dtype=np.float64) for x in (first, second, third)]


def amplified(at: Instant, i: int) -> tuple[float, float]:
    """What (41) makes of the worst error of the accelerations, and 1 / sqrt(mu), with coordinate `i` independent."""
    d = [j for j in range(len(at.v)) if j != i]
    metric = np.linalg.cholesky(at.C @ np.linalg.inv(at.M) @ at.C.T)
    root = np.linalg.cholesky(at.M)
    # from an error e of v' of length 1 in the metric of M to the length of that of lambda in the metric of M_c
    worst = metric.T @ np.linalg.solve(at.C[:, d].T, root[d])
    return float(np.linalg.norm(worst, 2)), 1.0 / pt.partition.choose(at.M, at.C, fixed=[i]).sqrt_mu


def seen(at: Instant, i: int, random: np.random.Generator) -> float:
    """The same for errors by chance."""
    root, d = np.linalg.cholesky(at.M), [j for j in range(len(at.v)) if j != i]
    metric = np.linalg.cholesky(at.C @ np.linalg.inv(at.M) @ at.C.T)
    error = random.normal(size=len(at.v))
    error *= ERROR / np.linalg.norm(error)
    change = np.linalg.solve(at.C[:, d].T, (root @ error)[d])
    return float(np.linalg.norm(metric.T @ change) / ERROR)


def power(at: Instant) -> float:
    """That of the reactions, lambda^T C v, over the sum of its terms without their signs."""
    terms = at.multipliers[:, None] * at.C * at.v
    return abs(float(terms.sum())) / float(np.abs(terms).sum())


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Turn, compute all reactions by all routes, compare; draw."""
    outputs = 41 if short else 281
    runs = {joint: turning(joint, outputs) for joint in ("D", "A")}  # of each joint one in which it is not cut
    turned = np.degrees(runs["D"].joint("A").position[:, 0])
    within = turned <= 360.0
    forces = {joint: runs["D"].joint(joint).force[:, :2] for joint in JOINTS}
    gaps: dict[str, Array] = {"cut, sweep": np.zeros(outputs), "cut, augmented": np.zeros(outputs)}
    for joint in JOINTS:
        done = runs["A" if joint == "D" else "D"]
        routes = {"cut, sweep": done.reactions_by("recursion"), "cut, augmented": done.reactions_by("augmented")}
        place, known = done.names.joints.index(joint), by_cutting(done, joint)
        largest = max(float(np.max(np.linalg.norm(force, axis=1))) for force in forces.values())
        for name, found_by in routes.items():
            gap = np.max(np.abs(found_by["force"][:, place, :2] - known), axis=1) / largest
            gaps[name] = np.maximum(gaps[name], gap)
    instants = [MODELS["D"].at(at.q, at.v) for at in states(runs["D"], "D")]
    three = np.array([[formulas(at, i) for at in instants] for i in range(3)])  # choice, output, formula, row
    size = float(np.max(np.abs(three[0, :, 0])))
    spread = np.max(np.abs(three[:, :, :2] - three[:, :, :1]), axis=(0, 2, 3)) / size
    squares = np.max(np.abs(three[0, :, 2] - three[0, :, 0]), axis=1) / size
    powers = [power(at) for at in instants]
    worst = np.array([[amplified(at, i) for at in instants] for i in range(3)])  # choice, output, worst and bound
    random = np.random.default_rng(1994)
    chance = np.array([[seen(at, i, random) for at in instants] for i in range(3)])
    at = instant(START, 1.5)
    bar = (at.M @ at.vdot - at.h)[1:]
    found: Numbers = {
        "lambda at 0.8 rad and 1.5 rad/s, x [N]": float(at.multipliers[0]),
        "lambda at 0.8 rad and 1.5 rad/s, y [N]": float(at.multipliers[1]),
        "(M v' - h)_D there, first [N m]": float(bar[0]),
        "(M v' - h)_D there, second [N m]": float(bar[1]),
        "lambda by C_D^-T (M v' - h)_D: largest difference [N]": float(
            np.max(np.abs(np.linalg.solve(at.C[:, 1:].T, bar) - at.multipliers))
        ),
        "multipliers: (41) against (40), relative": float(spread.max()),
        "multipliers: (42) against (40), relative": float(squares.max()),
        "joints: sweep against cut, relative": float(gaps["cut, sweep"].max()),
        "joints: augmented against cut, relative": float(gaps["cut, augmented"].max()),
        "bodies: Newton-Euler residual, relative": float(runs["D"].certificate.newton_euler or 0.0),
        "power of the reactions, in parts of its terms": max(powers),
        "amplification by (41): largest deviation from 1/sqrt(mu), relative": float(
            np.max(np.abs(worst[..., 0] / worst[..., 1] - 1.0))
        ),
        "amplification by (41): largest by chance over 1/sqrt(mu)": float(np.max(chance / worst[..., 1])),
    }
    for i, joint in enumerate("ABC"):
        found[f"amplification with {joint} independent: largest"] = float(worst[i, within, 0].max())
    found["amplification with C independent: least"] = float(worst[2, within, 0].min())
    for joint, force in forces.items():
        size = np.linalg.norm(force[within], axis=1)
        found[f"force in {joint}: largest over a turn [N]"] = float(size.max())
        found[f"force in {joint}: at a turn of the crank of [deg]"] = float(turned[within][np.argmax(size)])

    figure = new_figure(12.0, 3.8)
    left, middle, right = figure.subplots(1, 3)
    dressed(left, "Forces in the pins over a turn", "|force| [N]", time_axis=False)
    for n, (joint, force) in enumerate(forces.items()):
        left.plot(turned[within], np.linalg.norm(force[within], axis=1), color=COLOURS[n], lw=1.3, label=joint)
    left.set_ylim(0, None)
    left.legend(fontsize=8, frameon=False, ncols=2)
    dressed(middle, "Differences between routes, all pins", "in parts of the largest", time_axis=False)
    lines = {
        "joints: cut, Newton-Euler sweep": gaps["cut, sweep"],
        "joints: cut, augmented coordinates": gaps["cut, augmented"],
        "multipliers: (40), (41) for each choice": spread,
        "multipliers: (40), (42)": squares,
    }
    for n, (name, values) in enumerate(lines.items()):
        width = 2.4 if n == 0 else 1.0  # the second one agrees with it in most digits
        middle.semilogy(turned[within], positive(values[within]), color=COLOURS[n], lw=width, label=name)
    middle.set_ylim(1e-18, 1e-9)
    middle.legend(fontsize=8, frameon=False, loc="upper left")
    dressed(right, "What (41) makes of errors in v'", "amplification", time_axis=False)
    for i, joint in enumerate("ABC"):
        right.semilogy(
            turned[within], worst[i, within, 1], color=COLOURS[i], lw=1.3, label=f"1/√μ, {joint} independent"
        )
        right.semilogy(turned[within], chance[i, within], ".", color=COLOURS[i], ms=2.5)
    right.axhline(1.0, color="#666666", lw=0.8, ls=":")
    right.legend(fontsize=8, frameon=False, title="dots: errors by chance", title_fontsize=8, loc="upper left")
    right.set_ylim(5e-2, 1e4)
    for ax in (left, middle, right):
        ax.set_xlabel("turn of the crank [deg]", fontsize=9)
        ax.set_xticks(range(0, 361, 90))
        ax.set_xlim(0, 360)
    finish("Four-bar: reactions by three routes", figure, folder / "reactions.png", found)
    return found


if __name__ == "__main__":
    run(main)
