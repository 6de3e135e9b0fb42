"""The k individually most mobile coordinates may fail together; those chosen one after the other do not.

Three exact failures of taking the k largest rho: two mechanisms side by side, a parallel robot whose base angles are
in their singular position, and coupled inertia with a single condition. "Lock and repeat" with switches avoids them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run

import partita as pt
from partita.catalogue import three_rrr
from partita.plots.style import COLOURS, dressed, new_figure

Array = np.ndarray
POSE = np.array([0.44480746107270663, -0.28272813748931336, -0.2492938366933924])


def decoupled() -> tuple[Array, Array]:
    """A pendulum at 45 degrees in x and y, beside three equal carts coupled by two rigid rods."""
    c = np.zeros((3, 5))
    c[0, :2] = np.sqrt(0.5)
    c[1, 2:4] = c[2, 3:] = 1.0, -1.0
    return np.eye(5), c


def robot(pose: Array) -> tuple[Array, Array]:
    """The 3-RRR robot of the catalogue in its joint angles, with its platform in `pose`."""
    q = three_rrr.joints(pose)
    return MODEL.mass_matrix(q), MODEL.jacobian(q)


MODEL = pt.catalogue.load("three-rrr").compile()


def coupled() -> tuple[Array, Array]:
    """Three coordinates with coupled inertia, of which the condition holds the first two together."""
    inverse = np.array([[1.0, -0.4, 0.5], [-0.4, 1.0, 0.5], [0.5, 0.5, 1.0]])
    return np.linalg.inv(inverse), np.array([[1.0, 1.0, 0.0]])


def sigma(m: Array, c: Array, independent: Array) -> float:
    """Smallest singular value of the chosen directions, normalised and projected on the tangent space."""
    d = np.linalg.svd(c)[2][c.shape[0] :]
    root = np.linalg.cholesky(d @ m @ d.T)
    b = np.linalg.solve(root, d) / np.sqrt(np.diag(np.linalg.inv(m)))
    return float(np.linalg.svd(b[:, independent], compute_uv=False)[-1])


def both(m: Array, c: Array) -> tuple[float, float, float]:
    """sigma of the k largest rho, |det C_D| of that choice, and sigma of the collective choice."""
    k = m.shape[0] - c.shape[0]
    # equal measures: the first ones, as in a table sorted by hand
    top = np.sort(np.argsort(-pt.partition.measure(m, c).round(9), kind="stable")[:k])
    return sigma(m, c, top), abs(float(np.linalg.det(np.delete(c, top, axis=1)))), pt.partition.choose(m, c).sigma


def poses(count: int) -> list[Array]:
    """Random poses that all three legs can reach."""
    random = np.random.default_rng(1994)
    found: list[Array] = []
    while len(found) < count:
        pose = random.uniform((-0.6, -0.6, -1.0), (0.6, 0.6, 1.0))
        if np.isfinite(three_rrr.points(pose)[0]).all():
            found.append(pose)
    return found


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """The three failures, then many poses of the robot; draw."""
    cases = {"pendulum and carts": decoupled(), "3-RRR robot": robot(POSE), "coupled inertia": coupled()}
    found: Numbers = {}
    bars: list[tuple[float, float]] = []
    for name, (m, c) in cases.items():
        alone, determinant, together = both(m, c)
        bars.append((alone, together))
        found[f"{name}: sigma of the k largest rho"] = alone
        found[f"{name}: |det C_D| of that choice"] = determinant
        found[f"{name}: sigma of the collective choice"] = together
    many = np.array([both(*robot(pose)) for pose in poses(200 if short else 2000)])
    found["robot, many poses: least sigma of the k largest rho"] = float(many[:, 0].min())
    found["robot, many poses: poses"] = float(len(many))
    found["robot, many poses: k largest below 0.1"] = float(np.sum(many[:, 0] < 0.1))
    found["robot, many poses: least sigma of the collective choice"] = float(many[:, 2].min())

    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2)
    dressed(left, "Three failures", "σ", time_axis=False)
    for n, values in enumerate(bars):
        for i, value in enumerate(values):
            at = n + (i - 0.5) * 0.36
            left.bar(at, value, 0.34, color=COLOURS[1 - i], label=("k largest ρ", "collective")[i] if n == 0 else None)
            left.text(at, value + 0.01, f"{value:.2g}" if value > 1e-9 else "0", ha="center", fontsize=8)
    left.set_xticks(range(3), list(cases), fontsize=8)
    left.set_xlim(-0.6, 2.6)
    left.set_ylim(0, 1.0)
    left.legend(fontsize=8, frameon=False, loc="upper left")
    dressed(right, "Random poses of the robot", "share with a smaller σ", time_axis=False)
    share = (np.arange(len(many)) + 1.0) / len(many)
    for column, colour, name in ((0, COLOURS[1], "k largest ρ"), (2, COLOURS[0], "collective")):
        right.plot(np.sort(many[:, column]), share, color=colour, lw=1.4, label=name)
    right.set_xlabel("σ", fontsize=9)
    right.set_xlim(0, None)
    right.legend(fontsize=8, frameon=False, loc="lower right")
    finish("Individually largest against collectively good", figure, folder / "individual.png", found)
    return found


if __name__ == "__main__":
    run(main)
