"""Loops closed in closed form: the dyads of a mechanism, one after the other, against Newton's method.

Theo Jansen's leg has three loops. With the angle of its crank given, the knee T of the first dyad is the meeting point
of two circles, then that of the second, then that of the third, whose circles are about points of the first two.
Written with circles here, the same positions, A and xi come out as those of Partita, which are computed from the
constraint Jacobian. Newton's method needs a start, and from a start too far away it finds another branch, or none.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.axes import Axes
from numpy.typing import NDArray

import partita as pt
from partita.catalogue.dyad import meet, turned
from partita.catalogue.zoo.six_bars_and_legs import jansen
from partita.plots.style import COLOURS, dressed, new_figure

Array = NDArray[np.float64]
NAME = "jansen-leg"
LEG = pt.catalogue.load(NAME)
MODEL = LEG.compile()
INPUT = "O"
NAMES = list(MODEL.velocity_names)
DEPENDENT = [i for i, name in enumerate(NAMES) if name != INPUT]
CRANK = NAMES.index(INPUT)
WITHIN, ITERATIONS = 1e-12, 30  # of Newton's method: largest |Phi| [m], iterations at most
DERIVATIVE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0  # of five equally spaced values, and the second derivative
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0
STEP = 1e-3  # of those values [rad]: errors of the formulas and of round-off are about equal


COUNTED = {"four-bar": "four-bar", "slider-crank": "slider-crank", "Watt's six-bar": "watt-six-bar",
           "Andrews' squeezer": "andrews-squeezer", "3-RRR": "three-rrr", "Jansen's leg": NAME,
           "chain of 40": "n-four-bar"}  # fmt: skip
"""Mechanisms whose operations are counted, and their names in the catalogue."""


@dataclass(frozen=True)
class Dyad:
    """Two links between three hinges, in the words of `Assemblies.blocks`."""

    words: str
    joints: tuple[str, ...]
    links: tuple[str, ...]


def drawn() -> dict[str, Array]:
    """Joint -> its point in the drawing (2,) [m]."""
    start = LEG.simulate(1e-6, initial=LEG.assemble())
    return {name: start.joint(name).point[0, :2] for name in start.names.joints}


POINTS = drawn()
ENDS = {joint["name"]: (joint["parent"], joint["child"]) for joint in MODEL.summary["joints"]}


def dyads() -> list[Dyad]:
    """The dyads in the order in which the inverse kinematics closes them; a link of one has two of its joints."""
    found = []
    for words in LEG.assemblies(inputs=[INPUT]).blocks:
        joints = tuple(re.findall(r'"([^"]+)"', words))
        bodies = [body for name in joints for body in ENDS[name]]
        links = tuple(dict.fromkeys(body for body in bodies if bodies.count(body) == 2))
        found.append(Dyad(words, joints, links))
    return found


def length(a: str, b: str) -> float:
    """Distance of two points of the drawing [m]."""
    return float(np.linalg.norm(POINTS[b] - POINTS[a]))


def side(p: str, q: str, x: str) -> int:
    """1 where x lies to the left of the line from p to q in the drawing, else -1."""
    (a, b), (c, d) = POINTS[q] - POINTS[p], POINTS[x] - POINTS[p]
    return 1 if a * d - b * c > 0.0 else -1


def circles(crank: Array) -> dict[str, Array]:
    """Points (..., 2) of the leg for turns of the crank from the drawing (...) [rad]: (37), by two circles for each."""
    p = turned_by(POINTS["P"], crank)
    b = np.broadcast_to(POINTS["B"], p.shape)
    t = meet(p, b, length("P", "T"), length("B", "T"), side("P", "B", "T"))
    low = meet(p, b, length("P", "L"), length("B", "L"), side("P", "B", "L"))
    s = b + turned_by(POINTS["S"] - POINTS["B"], heading(t - b) - heading(POINTS["T"] - POINTS["B"]))
    k = meet(s, low, length("S", "K"), length("L", "K"), side("S", "L", "K"))
    return {"P": p, "B": b, "T": t, "L": low, "S": s, "K": k}


def turned_by(vector: Array, angle: Array) -> Array:
    """A vector (2,) turned by angles (...)."""
    return np.cos(angle)[..., None] * vector + np.sin(angle)[..., None] * turned(vector)


def heading(vector: Array) -> Array:
    """Angles of vectors (..., 2) [rad]."""
    return np.asarray(np.arctan2(vector[..., 1], vector[..., 0]))


def closed(crank: Array) -> Array:
    """q (..., 7) for turns of the crank (...), without whole turns: g of (37)."""
    now, then = circles(crank), {name: POINTS[name] for name in "PBTLSK"}

    def turn(a: str, b: str) -> Array:
        return heading(now[b] - now[a]) - heading(then[b] - then[a])

    upper, lower, j, k = turn("B", "T"), turn("B", "L"), turn("P", "T"), turn("P", "L")
    angles = {INPUT: crank, "B": upper, "B2": lower, "P": j - crank, "P2": k - crank, "S": turn("S", "K") - upper,
              "L2": turn("L", "K") - k}  # fmt: skip
    q = np.stack([angles[name] for name in NAMES], axis=-1)
    return np.concatenate([q[..., :1], np.mod(q[..., 1:] + np.pi, 2.0 * np.pi) - np.pi], axis=-1)


def pivots(crank: float) -> Array:
    """The determinant of each dyad (3,): (X - P) x (X - Q) of its knee X and its outer points P, Q. [m^2]"""
    at = circles(np.array(crank))

    def cross(x: str, p: str, q: str) -> float:
        (a, b), (c, d) = at[x] - at[p], at[x] - at[q]
        return float(a * d - b * c)

    return np.array([cross("T", "P", "B"), cross("L", "P", "B"), cross("K", "S", "L")])


def kinematics(crank: float, rate: float = 1.0) -> tuple[float, float, float]:
    """Largest difference of A and of xi (38) from those of the Jacobian, and of |det C_D| from the product of the
    pivots, relative."""
    positions: Array = crank + STEP * np.arange(-2.0, 3.0)
    around = np.unwrap(closed(positions), axis=0)[:, DEPENDENT]
    slope, bend = DERIVATIVE @ around / STEP, SECOND @ around / STEP**2
    q = closed(np.array(crank))
    c = MODEL.jacobian(q)
    v = pt.partition.choose(MODEL.mass_matrix(q), c, fixed=[CRANK]).D[0] * rate
    block = c[:, DEPENDENT]
    a, xi = -np.linalg.solve(block, c[:, CRANK]), -np.linalg.solve(block, MODEL.bias(q, v))
    product = float(np.prod(pivots(crank)))
    determinant = abs(float(np.linalg.det(block)))
    return (
        float(np.max(np.abs(a - slope))),
        float(np.max(np.abs(xi - bend * rate**2))),
        abs(determinant / abs(product) - 1.0),
    )


def newton(crank: float, start: Array) -> tuple[Array, int]:
    """q_D <- q_D - C_D^-1 Phi (34) from the position `start` (7,): where it ends, and the number of iterations."""
    q = start.copy()
    q[CRANK] = crank
    for n in range(ITERATIONS):
        phi = MODEL.constraints(q)
        if float(np.max(np.abs(phi))) < WITHIN:
            return q, n
        q[DEPENDENT] -= np.linalg.solve(MODEL.jacobian(q)[:, DEPENDENT], phi)
    return np.full_like(q, np.nan), ITERATIONS


def jumps(degrees: Array, starts: Array) -> tuple[Array, Array]:
    """For jumps of the crank (nj,): share of the starts from which Newton's method ends on the branch of the closed
    form, on another one, nowhere (3, nj); and its iterations where it ends on the same (nj,)."""
    shares, needed = np.zeros((3, len(degrees))), np.zeros(len(degrees))
    for n, jump in enumerate(np.radians(degrees)):
        counted = []
        for start in starts:
            q, iterations = newton(start + jump, closed(np.array(start)))
            gap = np.mod(q - closed(np.array(start + jump)) + np.pi, 2.0 * np.pi) - np.pi
            where = 2 if np.isnan(q).any() else int(np.max(np.abs(gap)) > 1e-6)
            shares[where, n] += 1.0 / len(starts)
            counted += [iterations] if where == 0 else []
        needed[n] = np.mean(counted) if counted else np.nan
    return shares, needed


def placed(ax: Axes, done: list[str], new: list[str], title: str) -> None:
    """The leg with the bodies that are placed so far, those just placed, and a shadow of the others."""
    bodies: dict[str, list[Array]] = {}
    for name, ends in ENDS.items():
        for body in ends:
            bodies.setdefault(body, []).append(POINTS[name])
    bodies["triangle ghi"].append(FOOT)
    ground = bodies.pop("ground")
    for body, points in bodies.items():
        colour = COLOURS[1] if body in new else COLOURS[0] if body in done else "#cccccc"
        ring = np.array([*points, points[0]] if len(points) > 2 else points)
        if len(points) > 2:
            ax.fill(*ring.T, color=colour, alpha=0.25 if colour != "#cccccc" else 0.0, lw=0)
        ax.plot(*ring.T, color=colour, lw=2.0 if body in new else 1.4, zorder=3 if body in new else 2,
                solid_capstyle="round")  # fmt: skip
    for point in POINTS.values():
        ax.plot(*point, "o", color="white", mec="#444444", ms=3.5, zorder=4)
    for point in ground:
        ax.plot(*point, "^", color="#444444", ms=6, zorder=5)
    ax.set_title(title, fontsize=9, loc="left")
    ax.set_aspect("equal")
    ax.set_axis_off()


def foot() -> Array:
    """The foot of the leg (2,) [m]: the corner of the last triangle that is no joint, from the drawing."""
    points: dict[str, complex] = {"P": complex(*POINTS["P"])}
    jansen(points, {}, "", mirrored=False)
    return np.array([points["F"].real, points["F"].imag])


FOOT = foot()


def pattern(ax: Axes, found: list[Dyad]) -> float:
    """C_D with its columns and rows in the order of the dyads; the largest entry above its blocks, relative."""
    columns = [i for dyad in found for i in DEPENDENT if NAMES[i] in dyad.joints]
    rows = [i for dyad in found for i, name in enumerate(MODEL.row_names) if name.split(".")[0] in dyad.joints]
    block = MODEL.jacobian(closed(np.array(0.0)))[np.ix_(rows, columns)]
    above = 0.0
    for i in range(len(rows)):
        for j in range(len(columns)):
            if i // 2 == j // 2:
                ax.fill_between([j, j + 1], i, i + 1, color=COLOURS[1], alpha=0.35, lw=0)
            elif block[i, j] != 0.0:
                ax.fill_between([j, j + 1], i, i + 1, color=COLOURS[0], alpha=0.35, lw=0)
            if j // 2 > i // 2:
                above = max(above, abs(float(block[i, j])))
    ax.set_xticks(np.arange(len(columns)) + 0.5, [NAMES[j] for j in columns], fontsize=8)
    ax.set_yticks(np.arange(len(rows)) + 0.5, [MODEL.row_names[i] for i in rows], fontsize=8)
    ax.tick_params(length=0)
    ax.set_xlim(0, len(columns))
    ax.set_ylim(len(rows), 0)
    ax.set_aspect("equal")
    ax.set_title("$C_D$ in the order of the dyads", loc="left", fontsize=10, fontweight="bold")
    return above / float(np.max(np.abs(block)))


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Close by circles, by Partita and by Newton's method; count; draw."""
    order = dyads()
    turn = np.linspace(0.0, 2.0 * np.pi, 37 if short else 361)
    closures = [float(np.max(np.abs(MODEL.constraints(q)))) for q in closed(turn)]
    compared = np.array([kinematics(angle) for angle in turn])
    entry = pt.catalogue.entry(NAME)
    options = {"independent": [INPUT], "t_eval": np.linspace(0.0, 2.0, 41), **entry.options}
    forms = ("explicit-closing", "wehage-haug")
    runs = {form: LEG.simulate(2.0, initial=entry.initial(LEG), solver=pt.Solver(form), **options) for form in forms}
    tops = [runs[form].joint("K").point[:, :2] for form in forms]
    expected = circles(runs[forms[0]].joint(INPUT).position[:, 0])["K"]
    degrees = np.array([1.0, 10.0, 30.0, 60.0, 90.0] if short else np.arange(0.0, 91.0, 2.0) + (np.arange(46) == 0))
    starts = np.linspace(0.0, 2.0 * np.pi, 13 if short else 37)[:-1]
    shares, needed = jumps(degrees, starts)
    found: Numbers = {
        "dyads": float(len(order)),
        "assemblies for one angle of the crank": float(len(LEG.assemblies(inputs=[INPUT]))),
        "circles: largest |Phi| over a turn": max(closures),
        "A: largest difference from that of the Jacobian": float(compared[:, 0].max()),
        "xi: largest difference from that of the Jacobian": float(compared[:, 1].max()),
        "|det C_D| over the product of the pivots: largest deviation from 1": float(compared[:, 2].max()),
        "least pivot over a turn, in parts of the largest": least_pivot(turn),
        "run: largest distance of the knee from the circles": float(np.max(np.abs(tops[0] - expected))),
        "runs: largest distance of the knees of the two": float(np.max(np.abs(tops[0] - tops[1]))),
        "Newton: jump that loses the branch somewhere [deg]": float(degrees[np.flatnonzero(shares[0] < 1.0 - 1e-9)[0]]),
        "Newton: largest jump that keeps it everywhere [deg]": float(
            degrees[np.flatnonzero(shares[0] < 1.0 - 1e-9)[0] - 1]
        ),
        "Newton: positions": float(len(starts)),
        "Newton: share that loses it, largest": float(1.0 - shares[0].min()),
        "Newton: iterations for a jump of 1 deg": float(needed[0]),
        **counts(),
    }
    for form in forms:
        counters = runs[form].counters
        evaluations = counters["evaluations"] + counters["dense_evaluations"]
        found[f"{form}: evaluations"] = float(evaluations)
        found[f"{form}: Newton iterations for each"] = counters["newton_iterations"] / evaluations
        found[f"{form}: largest |Phi|"] = float(np.max(runs[form].closure))

    figure = new_figure(11.0, 6.4)
    halves = np.ravel(np.asarray(figure.subfigures(2, 1, height_ratios=[1.0, 1.15]), dtype=object))
    steps = halves[0].subplots(1, len(order) + 1)
    placed(steps[0], [], ["crank"], "the crank is given")
    done = ["crank"]
    for n, dyad in enumerate(order):
        placed(steps[n + 1], done, list(dyad.links), f"{n + 1}.  dyad {', '.join(dyad.joints)}")
        done += dyad.links
    left, middle, right = halves[1].subplots(1, 3)
    found["C_D: largest entry above the blocks"] = pattern(left, order)
    dressed(middle, "Pivots of the dyads", "|pivot| [m²]", time_axis=False)
    each = np.abs([pivots(angle) for angle in turn])
    for n, dyad in enumerate(order):
        middle.plot(np.degrees(turn), each[:, n], color=COLOURS[n], lw=1.3, label=", ".join(dyad.joints))
    middle.set_xlabel("turn of the crank [deg]", fontsize=9)
    middle.set_xticks(range(0, 361, 90))
    middle.set_ylim(0, None)
    middle.legend(fontsize=8, frameon=False, title="dyad", title_fontsize=8)
    dressed(right, "Newton's method after a jump", "share of the starts", time_axis=False)
    labels = ("same branch", "another branch", "no solution")
    right.stackplot(degrees, shares, colors=(COLOURS[0], COLOURS[1], "#999999"), alpha=0.6, labels=labels, lw=0)
    right.set_xlabel("jump of the crank [deg]", fontsize=9)
    right.set_ylim(0, 1)
    right.set_xticks(range(0, 91, 30))
    right.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    finish("Jansen's leg: closed form against Newton's method", figure, folder / "closing.png", found)
    return found


def counts() -> Numbers:
    """Arithmetic operations of one evaluation, all coordinates integrated and the loops closed in it, and of one
    iteration of Newton's method; those among them that are sines, cosines and angles."""
    found: Numbers = {}
    ratios, saved = [], []
    for title, name in COUNTED.items():
        entry = pt.catalogue.entry(name, **({"loops": 40} if name == "n-four-bar" else {}))
        m = entry.mechanism()
        start = entry.initial(m)
        each = m.compile().operation_counts(start.q, t=start.t)
        whole, closed_form, iteration = (each[key]["total"] for key in ("projective", "explicit-closing", "iteration"))
        found |= {
            f"operations, {title}: projective": float(whole),
            f"operations, {title}: explicit-closing": float(closed_form),
            f"operations, {title}: ratio": closed_form / whole,
            f"operations, {title}: iteration": float(iteration),
            f"operations, {title}: functions, projective": float(each["projective"]["functions"]),
            f"operations, {title}: functions, explicit-closing": float(each["explicit-closing"]["functions"]),
        }
        ratios.append(closed_form / whole)
        saved.append((closed_form - whole) / iteration)
    return found | {
        "operations: least ratio": min(ratios),
        "operations: largest ratio": max(ratios),
        "operations: closing over an iteration, least": min(saved),
        "operations: closing over an iteration, largest": max(saved),
    }


def least_pivot(turn: Array) -> float:
    """How near a dead point of any dyad comes: its least pivot over its largest."""
    each = np.abs([pivots(angle) for angle in turn])
    return float(np.min(each.min(axis=0) / each.max(axis=0)))


if __name__ == "__main__":
    run(main)
