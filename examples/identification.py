"""A leg with two loops and two motors: its masses, centres and inertias from ten seconds of encoders and torques.

Run it with `.venv/bin/python examples/identification.py [FOLDER]`. A leg with other numbers than drawn is moved by its
two motors; encoders of 20 bits and torques with noise are logged at 1 kHz. Of 24 numbers the log determines 16
combinations, and no log of torques more; the exit code is 1 if one of them is missed by more than three standard
deviations. With FOLDER the estimates are drawn there, in identification.svg.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import partita as pt
from partita.analyses import Identification

Array = NDArray[np.float64]
THIGH, SHANK, FOOT = 0.42, 0.40, 0.10
LEVER, ROD, HEEL = 0.12, 0.40, 0.11
LINK, GUIDE = 0.78, 0.06
"""Lengths [m]."""
THIGH_ANGLE, SHANK_ANGLE, GUIDE_ANGLE = -1.2, -2.0, 0.2
"""Directions as drawn [rad]."""
RATE, DURATION = 1000.0, 10.0
"""Samples per second, and time [s]."""
ENCODER = 2.0 * math.pi / 2**20
"""Step of the encoders [rad]."""
NOISE = 0.05
"""Standard deviation of the noise of torques [N m]."""
CUTOFF = 15.0
"""Cut-off of the filter [Hz]: above the motion, whose fastest part has 2.9 Hz."""
COURSES = {
    "hip": ((0.08, 0.05, 0.03), (0.4, 1.1, 2.3), (0.0, 1.0, 2.0)),
    "motor": ((0.07, 0.05, 0.03), (0.5, 0.9, 2.9), (0.5, 2.0, 0.0)),
}
"""Of each motor amplitudes [rad], frequencies [Hz] and phases [rad] of sines."""
FAR = 3.0
"""An estimate may miss by as many standard deviations."""


def along(angle: float) -> Array:
    """A direction."""
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def meeting(p: Array, near: float, q: Array, far: float) -> Array:
    """The point at these distances from p and q, left of the line from p to q."""
    line = q - p
    length = float(np.linalg.norm(line))
    turned = math.acos((near**2 + length**2 - far**2) / (2.0 * near * length))
    return np.asarray(p + near * along(math.atan2(line[1], line[0]) + turned))


def mechanism() -> pt.Mechanism:
    """Thigh and lever turn about the hip; the lever's rod moves the shank by its heel, the thigh's link the foot."""
    m = pt.Mechanism("leg", gravity="-y")
    hip = np.zeros(3)
    knee = THIGH * along(THIGH_ANGLE)
    heel, ankle = knee - HEEL * along(SHANK_ANGLE), knee + SHANK * along(SHANK_ANGLE)
    guide = GUIDE * along(GUIDE_ANGLE)
    pin, toe = meeting(hip, LEVER, heel, ROD), meeting(ankle, FOOT, guide, LINK)
    rods = {
        "thigh": (hip, knee),
        "lever": (hip, pin),
        "rod": (pin, heel),
        "shank": (knee, ankle),
        "foot": (ankle, toe),
        "link": (guide, toe),
    }
    bodies = {name: m.add_rod(name, start=start, end=end, mass=1.0) for name, (start, end) in rods.items()}
    m.add_revolute("hip", m.ground, bodies["thigh"], point=hip)
    m.add_revolute("motor", m.ground, bodies["lever"], point=hip)
    m.add_revolute("pin", bodies["lever"], bodies["rod"], point=pin)
    m.add_revolute("knee", bodies["thigh"], bodies["shank"], point=knee)
    m.add_revolute("heel", bodies["rod"], bodies["shank"], point=heel)
    m.add_revolute("ankle", bodies["shank"], bodies["foot"], point=ankle)
    m.add_revolute("guide", bodies["thigh"], bodies["link"], point=guide)
    m.add_revolute("toe", bodies["link"], bodies["foot"], point=toe)
    return m


def true_numbers(m: pt.Mechanism, seed: int = 7) -> dict[str, Any]:
    """Numbers of the leg that is measured: masses, centres and inertias up to 40 per cent from those drawn."""
    rng = np.random.default_rng(seed)
    drawn: dict[str, Any] = dict(m.compile().parameters)
    found: dict[str, Any] = {}
    for body in m.bodies:
        com, moment = np.array(drawn[f"{body}.com"]), drawn[f"{body}.inertia"][8] * rng.uniform(0.8, 1.4)
        aside = 0.1 * float(np.linalg.norm(com)) * rng.uniform(-1.0, 1.0)
        found[f"{body}.mass"] = drawn[f"{body}.mass"] * rng.uniform(0.7, 1.3)
        found[f"{body}.com"] = (com * rng.uniform(0.8, 1.2) + np.array([0.0, aside, 0.0])).tolist()
        found[f"{body}.inertia"] = np.diag([0.6 * moment, 0.6 * moment, moment]).ravel().tolist()
    return found


def log(m: pt.Mechanism, numbers: dict[str, Any], seed: int = 11) -> dict[str, Array]:
    """What encoders and torque sensors record of a leg with these numbers."""
    t = np.arange(int(RATE * DURATION) + 1) / RATE
    levels: list[dict[str, Array]] = [{}, {}, {}]
    for name, (sizes, frequencies, phases) in COURSES.items():
        a, w = np.array(sizes)[:, None], 2.0 * math.pi * np.array(frequencies)[:, None]
        x = w * t + np.array(phases)[:, None]
        for level, terms in zip(levels, (a * np.sin(x), a * w * np.cos(x), -a * w**2 * np.sin(x)), strict=True):
            level[name] = terms.sum(axis=0)
    k = m.kinematics(*levels)
    motion = SimpleNamespace(t=t, q=k.q, v=k.v, vdot=k.vdot, names=k.names)
    d = m.inverse_dynamics(motion, list(COURSES), parameters=numbers)
    rng = np.random.default_rng(seed)
    data = {"t": t}
    for name in COURSES:
        data[f"joint.{name}.position"] = np.round(levels[0][name] / ENCODER) * ENCODER
        data[f"effort.{name}"] = d.effort(name) + NOISE * rng.standard_normal(len(t))
    return data


def truth(m: pt.Mechanism, numbers: dict[str, Any], found: Identification) -> Array:
    """The combinations of the leg that was measured, by the mechanism with its numbers as the prior."""
    prior = m.identifiability(actuators=list(COURSES), parameters=numbers)
    own = {one.name: one.prior for one in prior.combinations}
    return np.array([own[one.name] for one in found.combinations])


def main(folder: Path | None = None) -> int:
    """Print each combination beside its true value; 1 if one is missed."""
    m = mechanism()
    numbers = true_numbers(m)
    found = m.identify(log(m, numbers), cutoff=CUTOFF)
    print(f"{len(found.values)} parameters, {found.rank} combinations")
    right = found.rank == 16 and len(found.values) == 24
    print(f"{'combination':<30} {'drawn':>9} {'true':>9} {'found':>9} {'sd':>9}")
    for one, true in zip(found.combinations, truth(m, numbers, found), strict=True):
        right &= abs(one.estimate - true) < FAR * one.sd
        print(f"{one.name:<30} {one.prior:>9.5f} {true:>9.5f} {one.estimate:>9.5f} {one.sd:>9.5f}")
    print("never seen: " + ", ".join(found.identifiability.never))
    print(found.hints[0] if right else "a combination was missed")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        draw(found, folder / "identification.svg")
    return 0 if right else 1


def draw(found: Identification, path: Path) -> None:
    """Estimates with their standard deviations, and the residuals."""
    from matplotlib import rc_context

    figure = found.plot()
    with rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
