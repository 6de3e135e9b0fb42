"""Latches, ratchets, brakes, stops: nine mechanisms that hold at times, each with its known answer.

Run it with `.venv/bin/python examples/holding.py [FOLDER]`. All are of the catalogue. What is known of each follows
from closed forms, an integral or an equation of Lagrange, computed here without Partita. The exit code is 1 if one is
missed. With FOLDER a picture of all nine is drawn there, holding.svg.
"""

from __future__ import annotations

import cmath
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import trebuchet
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import partita as pt
from partita.results import Result

Array = NDArray[np.float64]
G = 9.81
TOLERANCE = 1e-12
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-12}
NEAR = 1e-8
"""Known values are met to this. Scale: fraction of them. Reason: a thousand tolerances; what is integrated here has one
of 1e-12."""


@dataclass(frozen=True)
class Shown:
    """One mechanism: rows (what, known, found), and its panel: a curve over time, with the events of the run."""

    title: str
    rows: Sequence[tuple[str, float, float]]
    run: Result
    curve: tuple[Array, str]


def times_of(run: Result, name: str, kind: str) -> list[float]:
    """When this happened [s]."""
    return [event.t for event in run.events[name] if event.kind == kind]


def door() -> Shown:
    """The angle of a door with a closer is 1 - cos until it is in its latch."""
    run = pt.catalogue.entry("door-latch").simulate()
    inertia, rest = 10.1 + 25.0 * 0.45**2, 0.5 * math.pi + 0.4
    rate = math.sqrt(12.0 / inertia)
    closes = math.acos(0.4 / rest) / rate
    lost = 0.5 * inertia * (rest * rate * math.sin(rate * closes)) ** 2
    (latch,) = run.events["latch"]
    rows = [
        ("closes [s]", closes, latch.t),
        ("energy lost [J]", lost, latch.energy_lost),
        ("latch holds [N m]", -12.0 * 0.4, run.force("latch").effort[-1]),
    ]
    return Shown("Door latch", rows, run, (np.degrees(run.joint("hinge").angle), "door [deg]"))


def ratchet() -> Shown:
    """Torque linear in pieces: its integrals by Gauss, piece by piece."""
    run = pt.catalogue.entry("ratchet-wrench").simulate()
    at, torque = (0.0, 0.6, 1.2, 1.3, 1.5, 1.7, 2.3, 2.9), (0.0, 18.0, -3.0, -3.0, 3.0, 3.0, 18.0, -3.0)
    both, slides = 0.302, 12.0

    def integral(of: Callable[[float], float], low: float, high: float) -> float:
        edges = [low, *(t for t in at if low < t < high), high]
        return math.fsum(quad(of, a, b)[0] for a, b in pairwise(edges))

    def pulls(t: float) -> float:
        return float(np.interp(t, at, torque))

    def turns(start: float, stop: float) -> float:
        return integral(lambda t: (stop - t) * (pulls(t) - slides) / both, start, stop)

    def stops(start: float, near: float) -> float:
        return float(brentq(lambda t: integral(lambda s: pulls(s) - slides, start, t), near, near + 0.3, xtol=1e-14))

    first, second = 15.0 / 30.0, 1.7 + 0.6 * (15.0 - 3.0) / (18.0 - 3.0)
    frees = 0.6 + 0.6 * 18.0 / 21.0
    takes = float(brentq(lambda t: integral(pulls, frees, t), 1.5, 1.8, xtol=1e-14))
    sticks = [stops(first, 0.9), stops(second, 2.6)]
    found = {kind: times_of(run, name, kind) for name, kind in
             (("tight", "slip"), ("tight", "stick"), ("pawl", "release"), ("pawl", "lock"))}  # fmt: skip
    rows = [
        ("breaks loose [s]", second, found["slip"][1]),
        ("sticks [s]", sticks[0], found["stick"][0]),
        ("pawl frees [s]", frees, found["release"][0]),
        ("pawl takes [s]", takes, found["lock"][0]),
        ("bolt turns [rad]", turns(first, sticks[0]) + turns(second, sticks[1]), run.joint("thread").angle[-1]),
    ]
    return Shown("Ratchet wrench", rows, run, (np.degrees(run.joint("thread").angle), "bolt [deg]"))


def hub() -> Shown:
    """Coasting, the wheel decays: released where the chain would push, taken up where the sprocket is as fast."""
    run = pt.catalogue.entry("bicycle-hub").simulate()
    through = 0.34 / 0.2
    inertia, drag = 0.12 + 0.5 * through**2, 0.09 * through**2
    frees = 14.0 - inertia / drag

    def coasts(t: float) -> float:
        return 2.5 * (14.0 - frees) * math.exp(-drag / inertia * (t - frees))

    takes = float(brentq(lambda t: coasts(t) - 5.0 * (t - 14.0), 14.0, 16.0, xtol=1e-14))
    rows = [
        ("coasts from [s]", frees, times_of(run, "pawls", "release")[0]),
        ("taken up [s]", takes, times_of(run, "pawls", "lock")[0]),
        ("at 12 s [rad/s]", coasts(12.0), run.state(12.0).velocity("axle")),
    ]
    return Shown("Bicycle hub", rows, run, (run.joint("axle").velocity[:, 0], "wheel [rad/s]"))


def belt() -> Shown:
    """Stick-slip: a straight line, then a piece of a circle in the phase plane."""
    run = pt.catalogue.entry("stick-slip").simulate()
    mass, spring, speed, static, sliding = 2.0, 50.0, 0.3, 0.5, 0.3
    beyond, swing = (static - sliding) * mass * G / spring, math.sqrt(spring / mass)
    slips = static * mass * G / spring / speed
    lasts = (2.0 * math.pi - 2.0 * math.atan(beyond * swing / speed)) / swing
    period = lasts + 2.0 * beyond / speed
    slip, stick = times_of(run, "rub", "slip"), times_of(run, "rub", "stick")
    rows = [
        ("slips [s]", slips, slip[0]),
        ("sticks [s]", slips + lasts, stick[0]),
        ("period [s]", period, slip[2] - slip[1]),
    ]
    pull = run.force("rub").effort
    return Shown("Stick-slip", rows, run, (pull, "friction [N]"))


def valve() -> Shown:
    """The cam presses until the valve would have to be pulled; then it flies under its spring."""
    run = pt.catalogue.entry("valve-float").simulate()
    mass, spring, preload, lift, gains = 0.4, 900.0, 25.0, 0.006, 90.0
    swing, rest = math.sqrt(spring / mass), -(preload + mass * G) / spring

    def cam(t: float) -> tuple[float, float, float]:
        """Lift, rate, acceleration."""
        angle, rate = 0.5 * gains * t**2, gains * t
        bent = gains * math.sin(angle) + rate**2 * math.cos(angle)
        return lift * (1.0 - math.cos(angle)), lift * rate * math.sin(angle), lift * bent

    def presses(t: float) -> float:
        return mass * (cam(t)[2] + G) + spring * cam(t)[0] + preload

    known: list[tuple[float, float, float]] = []
    landed = 1.4
    for _ in range(3):
        grid = np.arange(landed + 1e-4, 1.7, 2e-4)
        first = next(i for i, t in enumerate(grid) if presses(t) < 0.0)
        off = float(brentq(presses, grid[first - 1], grid[first], xtol=1e-15))
        y, rate, _ = cam(off)

        def flies(t: float, off: float = off, y: float = y, rate: float = rate) -> tuple[float, float]:
            c, s = math.cos(swing * (t - off)), math.sin(swing * (t - off))
            return rest + (y - rest) * c + rate / swing * s, rate * c - (y - rest) * swing * s

        grid = np.arange(off + 1e-3, off + 0.1, 2e-4)
        first = next(i for i, t in enumerate(grid) if flies(t)[0] < cam(t)[0])
        landed = float(brentq(lambda t: flies(t)[0] - cam(t)[0], grid[first - 1], grid[first], xtol=1e-15))
        known.append((off, landed, mass * (cam(landed)[1] - flies(landed)[1])))
    offs, landings = times_of(run, "cam", "lift-off"), times_of(run, "cam", "impact")
    hits = [event for event in run.events["cam"] if event.kind == "impact"]
    rows = [
        ("lifts off [s]", known[0][0], offs[0]),
        ("lands [s]", known[0][1], landings[0]),
        ("lands third [s]", known[2][1], landings[2]),
        ("its impulse [N s]", known[2][2], hits[2].impulses["cam"].effort or math.nan),
    ]
    near = run.t > 1.44
    gap = np.where(near, 1e3 * (run.joint("guide").displacement - lift * (1.0 - np.cos(45.0 * run.t**2))), np.nan)
    return Shown("Valve float", rows, run, (gap, "over the cam [mm]"))


def gear() -> Shown:
    """Lagrange's equation of one angle: that of the upper stay."""
    run = pt.catalogue.entry("landing-gear-downlock").simulate()
    frame, arm, upper, lower, leg, stay = 0.7 - 0.1j, 0.8, 0.46, 0.44, 40.0, 3.0
    raised, over = math.radians(70.0), math.radians(6.0)
    pin = -1j * arm * cmath.exp(1j * raised)
    away = abs(pin - frame)
    bent = math.acos((away**2 + upper**2 - lower**2) / (2.0 * away * upper))
    knee = frame + upper * (pin - frame) / away * cmath.exp(1j * bent)
    start = [cmath.phase(knee - frame), cmath.phase(pin - knee), raised, 0.0]

    def terms(y: Sequence[float]) -> tuple[float, float, float, float, float]:
        """Mass, its derivative, generalized force; rates of lower stay and leg for one of the upper stay."""
        one, two, three = (upper * cmath.exp(1j * y[0]), lower * cmath.exp(1j * y[1]), -1j * arm * cmath.exp(1j * y[2]))
        loop = np.array([[two.real, -three.real], [two.imag, -three.imag]])

        def solved(z: complex) -> Array:
            return np.linalg.solve(loop, [z.real, z.imag])

        b, c = solved(-one)
        bb, cc = solved(1j * (c**2 * three - one - b**2 * two))
        middle, turned = one + 0.5 * b * two, 1j * one + 0.5j * b**2 * two + 0.5 * bb * two
        big, light = 6.0 + leg * 0.9**2, stay * lower**2 / 12.0
        mass = big * c**2 + stay * upper**2 / 3.0 + stay * abs(middle) ** 2 + light * b**2
        slope = 2.0 * (big * c * cc + stay * (middle.conjugate() * turned).real + light * b * bb)
        lowered = leg * 0.9 / arm * (1j * c * three).imag + stay * (0.5j * one + 1j * middle).imag
        bend = y[1] - y[0]
        force = -G * lowered - 300.0 * c**2 * y[3] - (8.0 * (b - 1.0) * y[3] + 60.0 * (bend - 0.3)) * (b - 1.0)
        return mass, slope, force, b, c

    def rates(t: float, y: Sequence[float]) -> list[float]:
        mass, slope, force, b, c = terms(y)
        return [y[3], b * y[3], c * y[3], (force - 0.5 * slope * y[3] ** 2) / mass]

    def locks(t: float, y: Sequence[float]) -> float:
        return y[1] - y[0] - over

    locks.terminal = True  # type: ignore[attr-defined]
    options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "events": locks}
    found = solve_ivp(rates, (0.0, 2.0), start, **options)
    end = found.y_events[0][0]
    mass, _, _, b, _ = terms(end)
    force = terms([*end[:3], 0.0])[2]
    (lock,) = run.events["downlock"]
    rows = [
        ("locks [s]", float(found.t_events[0][0]), lock.t),
        ("energy lost [J]", 0.5 * mass * end[3] ** 2, lock.energy_lost),
        ("downlock [N m]", -force / (b - 1.0), run.force("downlock").effort[-1]),
        ("leg swings [rad]", end[2] - raised, run.joint("trunnion").angle[-1]),
    ]
    bend = start[1] - start[0] + run.joint("knee").angle
    return Shown("Landing gear", rows, run, (np.degrees(bend), "knee [deg]"))


def geneva() -> Shown:
    """Four steps of a Geneva wheel of four slots: the wheel by the law of cosines."""
    run = pt.catalogue.entry("geneva-wheel").simulate()
    apart, speed, load, inertia, ratio = 0.1, 2.0 * math.pi, 0.2, 1e-3, math.sqrt(0.5)
    # a sixteenth of a turn after the pin entered the third slot
    at = int(np.argmin(np.abs(run.t - 2.0625)))
    angle = speed * 0.0625 - 0.25 * math.pi
    square = 1.0 + ratio**2 - 2.0 * ratio * math.cos(angle)
    rate = -speed * ratio * (math.cos(angle) - ratio) / square
    gains = speed**2 * ratio * (1.0 - ratio**2) * math.sin(angle) / square**2
    pushed = (inertia * gains - load) / (apart * math.sqrt(square))
    locked = int(np.argmin(np.abs(run.t - 2.5)))
    rows = [
        ("enters third [s]", 2.0, times_of(run, "enters 2", "lock")[0]),
        ("leaves it [s]", 2.25, times_of(run, "leaves 2", "release")[0]),
        ("four steps [deg]", -360.0, math.degrees(run.joint("table").angle[-1])),
        ("wheel [rad/s]", rate, run.joint("table").velocity[at, 0]),
        ("pin pushes [N]", abs(pushed), abs(run.drive("slot 2").effort[at, 0])),
        ("lock holds [N m]", -load, run.drive("lock of table").effort[locked, 0]),
    ]
    return Shown("Geneva wheel", rows, run, (np.degrees(run.joint("table").angle), "wheel [deg]"))


def press() -> Shown:
    """A press whose sheet resists with 900 N over 15 mm and breaks: rates by energy, times by quadrature."""
    throw, long, sheet = 0.08, 0.25, 900.0
    first, last = 0.20, 0.185
    run = pt.catalogue.entry("punch-press").simulate()

    def ram_at(angle: float) -> float:
        return throw * math.cos(angle) + math.sqrt(long**2 - (throw * math.sin(angle)) ** 2)

    def mass(angle: float) -> float:
        """Inertia seen by the crank."""
        lean = -math.asin(throw / long * math.sin(angle))
        leans = -throw * math.cos(angle) / (long * math.cos(lean))
        pin = 1j * throw * cmath.exp(1j * angle)
        middle, end = (pin + 1j * arm * leans * cmath.exp(1j * lean) for arm in (0.08, long))
        own = 0.3512 + 0.5 * 0.02**2 + 0.0035 * leans**2
        return own + 0.6 * abs(middle) ** 2 + 0.8 * abs(end) ** 2

    def lasts(low: float, high: float, energy: float, force: float) -> float:
        """Time from angle to angle [s]; the energy is that at the first of them."""

        def slowness(angle: float) -> float:
            return math.sqrt(0.5 * mass(angle) / (energy + force * (ram_at(angle) - ram_at(low))))

        return float(quad(slowness, low, high, epsabs=0.0, epsrel=1e-13)[0])

    def angle_of(x: float) -> float:
        return float(brentq(lambda a: ram_at(a) - x, 1.5, 3.0, xtol=1e-15))

    touched, broke = angle_of(first), angle_of(last)
    energy = 0.5 * mass(1.5) * 12.0**2
    less = energy - sheet * (first - last)
    touches = lasts(1.5, touched, energy, 0.0)
    breaks = touches + lasts(touched, broke, energy, sheet)
    rows = [
        ("touches [s]", touches, run.events["touches"][0].t),
        ("breaks [s]", breaks, run.events["breaks"][0].t),
        ("then [rad/s]", math.sqrt(2.0 * less / mass(broke)), run.events["breaks"][0].after.velocity("main")),
        ("bottom [s]", breaks + lasts(broke, math.pi, less, 0.0), run.events["bottom"][0].t),
    ]
    return Shown("Punch press", rows, run, (run.joint("main").velocity[:, 0], "crank [rad/s]"))


def throws() -> Shown:
    """The throw of `examples/trebuchet.py` whose sling turns 2 rad."""
    run = pt.catalogue.entry("trebuchet").simulate()
    released, _, landed = trebuchet.known(-2.0)
    rows = [
        ("releases [s]", released, run.events["release"][0].t),
        ("lands [m]", landed, float(run.body("shot").position[-1, 0])),
    ]
    return Shown("Trebuchet", rows, run, (run.body("shot").position[:, 1], "shot [m]"))


ALL = (door, ratchet, hub, belt, valve, gear, geneva, press, throws)


def main(folder: Path | None = None) -> int:
    """Print what was found beside what is known; 1 if one is missed."""
    right, shown = True, [make() for make in ALL]
    print(f"{'mechanism':<15} {'what':<18} {'known':>16} {'found':>16} {'error':>8}")
    for one in shown:
        right &= one.run.success and one.run.certificate.verdict == "valid"
        for i, (what, known, found) in enumerate(one.rows):
            error = abs(found / known - 1.0)
            right &= error < NEAR
            print(f"{one.title if i == 0 else '':<15} {what:<18} {known:>16.10f} {found:>16.10f} {error:>8.0e}")
    print("all as known" if right else "something was missed")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        draw(shown, folder / "holding.svg")
    return 0 if right else 1


def draw(shown: Sequence[Shown], path: Path) -> None:
    """Nine panels, each with the times at which something begins or ends to hold."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    for ax, one in zip(figure.subplots(3, 3).flat, shown, strict=True):
        values, label = one.curve
        seen = np.isfinite(values)
        for t in {event.t for event in one.run.events}:
            ax.axvline(t, color="0.75", lw=0.8)
        ax.plot(one.run.t[seen], values[seen], color="#2b6cb0", lw=1.3)
        ax.set_title(one.title, fontsize=10, loc="left", fontweight="bold")
        ax.set_ylabel(label, fontsize=8)
        ax.set_xlabel("time [s]", fontsize=8)
        ax.tick_params(labelsize=8)
        ax.set_xlim(one.run.t[seen][0], one.run.t[-1])
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
