"""Artificial tangent velocities are best where they are defined, if at all, and deteriorate along the motion.

S = D_0 M_0 with D_0 M_0 D_0^T = 1 makes u' = S v the mass-orthonormal velocity of one position. Kept frozen, its
quality sqrt(mu_S), the cosine between the directions it measures and those the loops allow, falls from 1 to zero, where
the velocity fails, and rises again behind. A tangent that is orthonormal without masses, by singular values, QR or zero
eigenvalues, begins lower, at a value that depends on the units. The coordinates chosen by the measure fade as well, but
cost nothing to choose again.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from drawing import FOLDER, Numbers, finish, run
from matplotlib.axes import Axes
from reference import ABSOLUTE, FOUR_BAR, JOINT, START, geometry, instant, measures, state

import partita as pt
from partita.catalogue import reference_four_bar
from partita.catalogue.dyad import FourBar
from partita.errors import SuspectResultWarning
from partita.plots.style import COLOURS, dressed, new_figure
from partita.results import Result

Array = np.ndarray
TANGENTS = ("gram-schmidt", "tangent-space", "svd", "qr", "zero-eigenvalue")
EUCLIDEAN = ("svd", "qr", "liang-lance", "zero-eigenvalue")
"""Tangents without regard to masses: bases of the null space of C."""
CASES = tuple((coordinates, begin) for coordinates in ("absolute", "relative") for begin in (START, 0.0, 2.0))
SHOWN = (10, 40, 80, 120)
CRANK = {"relative": JOINT.index("A"), "absolute": ABSOLUTE.index("crank.turn")}
"""Column of the rate of the crank."""
RATE, TURNED = 6.0, 100.0
"""Rate of the crank in the run with frozen velocities [rad/s]; end of the comparison [deg], before they fail."""


def made(crank: float, coordinates: str = "absolute") -> Array:
    """S (n,): the mass-orthonormal tangent velocity of one position, a covector of length 1."""
    m, g = instant(crank, coordinates=coordinates).M, geometry(crank, coordinates)
    d = g.T_cd[-1] / np.sqrt(g.M_d[0, 0])
    return np.asarray(d @ m)


def quality(s: Array, crank: float, coordinates: str = "absolute") -> float:
    """sqrt(mu_S): the length of S along the possible motions divided by its total length."""
    m, g = instant(crank, coordinates=coordinates).M, geometry(crank, coordinates)
    return float(abs(g.T_cd[-1] @ s) / np.sqrt(g.M_d[0, 0] * (s @ np.linalg.solve(m, s))))


def zero(s: Array, low: float, high: float) -> float:
    """Turn of the crank [deg] between two at which the quality reaches zero: where S D^T changes its sign."""

    def signed(turned: float) -> float:
        d = geometry(START + np.radians(turned), "absolute").T_cd[-1]
        at = instant(START + np.radians(turned), RATE, "absolute").v
        return float(s @ d) * float(np.sign(d @ at))

    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if signed(low) * signed(middle) > 0.0 else (low, middle)
    return low


def least(crank: float, coordinates: str, positions: int) -> float:
    """Least quality over a turn of the tangent frozen at `crank`; zero where S D^T changes its sign."""
    s, values = made(crank, coordinates), []  # of both signs of D, the one with which the crank turns forwards
    for angle in crank + np.linspace(0.0, 2.0 * np.pi, positions):
        d = geometry(angle, coordinates).T_cd[-1]
        values.append(quality(s, angle, coordinates) * float(np.sign(s @ d) * np.sign(d[CRANK[coordinates]])))
    signed = np.array(values) * np.sign(values[0])
    return float(max(0.0, signed.min()))


def spans(short: bool) -> Numbers:
    """What runs with tangents that ignore masses have in common: sqrt(mu) of a k-dimensional space, whatever its basis;
    and what they have not: sigma, which belongs to the velocities themselves. On the delta robot, k = 9."""
    entry = pt.catalogue.entry("delta")
    m = entry.mechanism()
    start, times = entry.initial(m), np.linspace(0.0, 0.05 if short else 0.5, 6 if short else 11)
    runs = [m.simulate(times[-1], initial=start, t_eval=times, solver=pt.Solver(name, renew=0.0)) for name in EUCLIDEAN]
    mu, sigma = (np.array([getattr(done, what) for done in runs]) for what in ("sqrt_mu", "sigma"))
    return {
        "delta: sqrt(mu) of all four at the start": float(mu[0, 0]),
        "delta: largest difference of sqrt(mu) between the four": float(np.max(np.ptp(mu, axis=0))),
        "delta: least sigma of the four at the start": float(sigma[:, 0].min()),
        "delta: largest sigma of the four at the start": float(sigma[:, 0].max()),
    }


def frozen_run(tangent: str) -> Result:
    """Partita's frozen velocities, never renewed, while the crank turns by slightly more than TURNED."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SuspectResultWarning)  # how they fail is what is looked at
        return FOUR_BAR.simulate(
            0.4, initial=state(START, RATE), coordinates="absolute", solver=pt.Solver(tangent, renew=0.0), rtol=1e-9
        )


def in_millimetres() -> pt.Mechanism:
    """The same four-bar drawn in millimetres, with forces in mN."""
    lengths = reference_four_bar.LENGTHS
    scaled = FourBar(*(1e3 * length for length in (lengths.crank, lengths.coupler, lengths.rocker, lengths.ground)))
    a, b, c, d = scaled.points(START)
    m = pt.Mechanism("four-bar in mm", gravity=(0, -1e3 * reference_four_bar.GRAVITY, 0))
    crank = m.add_rod("crank", start=a, end=b, mass=lengths.crank)
    coupler = m.add_rod("coupler", start=b, end=c, mass=lengths.coupler)
    rocker = m.add_rod("rocker", start=c, end=d, mass=lengths.rocker)
    m.add_revolute("A", m.ground, crank, point=a)
    m.add_revolute("B", crank, coupler, point=b)
    m.add_revolute("C", coupler, rocker, point=c)
    m.add_revolute("D", m.ground, rocker, point=d)
    return m


def first(m: pt.Mechanism, tangent: str) -> float:
    """sqrt(mu) of velocities that a run has just renewed."""
    start = m.assemble(rates={"A": RATE})
    return float(m.simulate(1e-3, initial=start, coordinates="absolute", solver=pt.Solver(tangent)).sqrt_mu[0])


def main(short: bool = False, folder: Path = FOLDER) -> Numbers:
    """Freeze, turn the crank, record the quality, next to that of renewed tangents and switched coordinates; draw."""
    s0 = made(START)
    turned = np.linspace(0.0, 180.0, 61 if short else 361)
    crank = START + np.radians(turned)
    lasting = np.array([quality(s0, angle) for angle in crank])
    joints = made(START, "relative")
    in_joints = np.array([quality(joints, angle, "relative") for angle in crank])
    rho = measures(crank, "absolute")
    renewed, renewals, s = [], 0, s0
    chosen, switches, i = [], 0, int(np.argmax(rho[0]))
    for angle, row in zip(crank, rho, strict=True):
        if quality(s, angle) < 0.5:
            s, renewals = made(angle), renewals + 1
        renewed.append(quality(s, angle))
        best = int(np.argmax(row))
        if row[best] > 1.25 * row[i]:
            i, switches = best, switches + 1
        chosen.append(row[i])
    at_zero = zero(s0, 100.0, 140.0)
    marched = frozen_run("gram-schmidt")
    turn = np.degrees(marched.joint("A").position[:, 0])
    before = turn <= TURNED
    found = {
        "quality when made": quality(s0, START),
        **{f"frozen tangent after {a} deg": quality(s0, START + np.radians(a)) for a in SHOWN},
        "frozen tangent reaches zero after [deg]": at_zero,
        "quality there": quality(s0, START + np.radians(at_zero)),
        "frozen tangent after 180 deg": float(lasting[-1]),
        "run with frozen velocities: largest difference up to 100 deg": float(max(
            abs(value - quality(s0, START + np.radians(angle)))
            for value, angle in zip(marched.sqrt_mu[before], turn[before], strict=True)
        )),
        "renewals below 0.5, in half a turn": float(renewals),
        "switches of coordinates with margin 1.25, in half a turn": float(switches),
        "least quality of the switched coordinates": float(min(chosen)),
    }  # fmt: skip
    for coordinates, begin in CASES:
        case, s = f"{coordinates} from {begin:g} rad", made(begin, coordinates)
        for a in SHOWN:
            found[f"{case}: after {a} deg"] = quality(s, begin + np.radians(a), coordinates)
        found[f"{case}: least in a turn"] = least(begin, coordinates, 73 if short else 361)
    found |= spans(short)
    millimetres = in_millimetres()
    for tangent in TANGENTS:
        found[f"{tangent}: sqrt(mu) when made, drawn in m"] = first(FOUR_BAR, tangent)
        found[f"{tangent}: sqrt(mu) when made, drawn in mm"] = first(millimetres, tangent)
    figure = new_figure(9.0, 3.6)
    ax: Axes = figure.subplots()
    dressed(ax, "Quality √μ of velocities made with the crank at 0.8 rad", "√μ", time_axis=False)
    ax.plot(turned, lasting, color=COLOURS[1], lw=1.6, label="frozen tangent, absolute")
    ax.plot(turned, in_joints, color=COLOURS[6], lw=1.1, ls="-.", label="frozen tangent, joint coordinates")
    ax.plot(turned, renewed, color=COLOURS[4], lw=1.1, ls="--", label="renewed below 0.5, absolute")
    ax.plot(turned, chosen, color=COLOURS[0], lw=1.3, label="coordinate, switched, absolute")
    ax.plot(0.0, found["svd: sqrt(mu) when made, drawn in m"], "s", color=COLOURS[2], ms=5, clip_on=False,
            label="svd when made, in m")  # fmt: skip
    ax.plot(0.0, found["svd: sqrt(mu) when made, drawn in mm"], "D", color=COLOURS[3], ms=5, clip_on=False,
            label="svd when made, in mm")  # fmt: skip
    ax.axvline(at_zero, color="#999999", lw=0.8, ls=":")
    ax.text(at_zero + 1.5, 0.36, f"{at_zero:.1f}°", fontsize=8, color="#666666")
    ax.set_xlabel("turn of the crank [deg]", fontsize=9)
    ax.set_xlim(0, 180)
    ax.set_xticks(range(0, 181, 30))
    ax.set_ylim(0, 1.03)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    finish("Four-bar: a frozen tangent fades", figure, folder / "frozen.png", found)
    return found


if __name__ == "__main__":
    run(main)
