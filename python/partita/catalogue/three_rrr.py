"""Planar parallel robot with three legs of two links each, moving freely: three degrees of freedom."""

from __future__ import annotations

import numpy as np

from ..mechanism import Mechanism
from ..results import Result
from ..state import State
from .dyad import FloatArray, meet, turned
from .entry import Check, Entry, angle, largest_gap, path_error

DIRECTIONS = np.radians([90.0, 210.0, 330.0])
CIRCLE = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
BASE, PLATFORM = 1.5 * CIRCLE, 0.5 * CIRCLE  # pins on the ground, and on the platform in its own axes [m]
LINK = 0.9
ELBOWS = (1, -1, 1)  # side of each elbow of the line from the ground to the platform
PLATFORM_MASS, PLATFORM_INERTIA = 1.0, 0.125
TWIST = np.array([0.3, -0.2, 0.8])  # of the platform at the start: m/s, m/s, rad/s

# t: x, y, angle of the platform. Lagrange's equations in these three, derivatives of M by complex steps, DOP853 with
# two tolerances.
PATH = {
    0.4: (0.12532981333675, -0.10122039758138, 0.31958528627236),
    0.8: (0.24508198238485, -0.23662765121474, 0.62745105807296),
}


def points(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Elbows and platform pins (..., 3 legs, 2) [m] for poses (..., 3) of the platform: x, y, angle."""
    where = np.asarray(pose, dtype=float)
    spun = np.stack([turned(PLATFORM, a) for a in np.atleast_1d(where[..., 2])]).reshape(*where.shape[:-1], 3, 2)
    pins = where[..., None, :2] + spun
    legs = [meet(np.broadcast_to(BASE[i], pins[..., i, :].shape), pins[..., i, :], LINK, LINK, ELBOWS[i])
            for i in range(3)]  # fmt: skip
    return np.stack(legs, axis=-2), pins


def base_angles(pose: FloatArray) -> FloatArray:
    """Angles (..., 3 legs) of the links on the ground from x [rad] for poses (..., 3) of the platform."""
    offset = points(pose)[0] - BASE
    return np.arctan2(offset[..., 1], offset[..., 0])


def joints(pose: FloatArray) -> FloatArray:
    """Coordinates A1 A2 A3 B1 B2 B3 C1 (7,) of the closed robot in relative coordinates for one pose (3,)."""
    (elbows, pins), (drawn_elbows, drawn_pins) = points(pose), points(np.zeros(3))
    first, drawn_first = elbows - BASE, drawn_elbows - BASE
    turns = np.arctan2(first[:, 1], first[:, 0]) - np.arctan2(drawn_first[:, 1], drawn_first[:, 0])
    offset, drawn = pins - elbows, drawn_pins - drawn_elbows
    bends = np.arctan2(offset[:, 1], offset[:, 0]) - np.arctan2(drawn[:, 1], drawn[:, 0]) - turns
    return np.array([*turns, *bends, pose[2] - turns[0] - bends[0]])


def build() -> Mechanism:
    """The drawing: platform in the middle; links of 1 kg/m; cut at the platform's second and third pin."""
    m = Mechanism("three-rrr", gravity=(0, 0, 0))
    elbows, pins = points(np.zeros(3))
    platform = m.add_body("platform", PLATFORM_MASS, (PLATFORM_INERTIA / 2, PLATFORM_INERTIA / 2, PLATFORM_INERTIA))
    for i in range(3):
        ground, elbow, pin = (np.array([*p, 0.0]) for p in (BASE[i], elbows[i], pins[i]))
        inner = m.add_rod(f"inner {i + 1}", start=ground, end=elbow, mass=LINK)
        outer = m.add_rod(f"outer {i + 1}", start=elbow, end=pin, mass=LINK)
        m.add_revolute(f"A{i + 1}", m.ground, inner, point=ground, cut="never")
        m.add_revolute(f"B{i + 1}", inner, outer, point=elbow, cut="never")
        m.add_revolute(f"C{i + 1}", outer, platform, point=pin, cut="never" if i == 0 else "always")
    return m


def start(m: Mechanism) -> State:
    """As drawn, the platform moving with TWIST; each leg gives the rate of its inner link.

    Elbow and pin have the same velocity component along the outer link, and the elbow moves perpendicular to the inner
    link.
    """
    elbows, pins = points(np.zeros(3))
    moving = TWIST[:2] + TWIST[2] * turned(pins)
    outer = elbows - pins
    rates = np.sum(outer * moving, axis=1) / np.sum(outer * turned(elbows - BASE), axis=1)
    return m.assemble(rates={f"A{i + 1}": float(rates[i]) for i in range(3)})


def pose(result: Result) -> FloatArray:
    """x, y and angle (nt, 3) of the platform."""
    platform = result.body("platform")
    turn = np.unwrap(np.arctan2(platform.rotation[:, 1, 0], platform.rotation[:, 0, 0]))
    return np.column_stack([platform.position[:, :2], turn])


def path(result: Result) -> float:
    """Largest error of the platform's pose over the tabled times."""
    return path_error(pose(result), result, PATH)


def legs(result: Result) -> float:
    """Largest difference between the angles of the inner links and those ruler and compass give for the pose."""
    drawn = base_angles(np.zeros(3))
    expected = base_angles(pose(result))
    found = np.column_stack([angle(result, f"A{i + 1}", float(drawn[i])) for i in range(3)])
    turns = np.round((found - expected) / (2.0 * np.pi))
    return largest_gap(found, expected + 2.0 * np.pi * turns)


def entry() -> Entry:
    """The catalogue entry with its checks."""
    return Entry(
        name="three-rrr",
        title="planar parallel robot with three legs (3-RRR): three degrees of freedom, two loops",
        source="ruler and compass for the legs; Lagrange's equations in the platform's pose, integrated by an "
        "unrelated program to 1e-12",
        duration=0.8,
        build=build,
        start=start,
        times=tuple(PATH),
        options={"rtol": 1e-11, "atol": 1e-12},
        checks=(
            Check("pose of the platform [m, rad]", 1e-9, "rtol 1e-11 over some tens of steps, some margin", path),
            Check("legs over pose [rad]", 1e-11, "closure 1e-12, at most tenfold in angle", legs),
        ),
        notes="Where the lines of the three outer links meet in one point or are parallel, the inner links together do "
        "not determine the motion, however large the measure of each: a choice must be judged as a whole.",
    )
