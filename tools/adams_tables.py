"""`python tools/adams_tables.py FOLDER`: tables of pendulums computed by MSC ADAMS, column by column.

FOLDER holds the tables as CSV files. All bodies weigh 1 kg, with a moment of inertia of 0.04 kg m^2 about the line from
the joint to the centre of mass and 0.1 across it; gravity is 9.80665 along -z. ADAMS printed six digits at its default
tolerance: 1e-4 of a column's largest value is all that can be asked for, twice that of accelerations and forces (those
of the straight slide waver by as much, where the true ones are constant). A table whose own energy drifts by more has
errors of its own that have added up: it is told, and each of its rows is reached from the row before it instead, to the
same limits. A table of a distance is drawn as one; where a table is of a massless link between a hinge and a ball, so
is the link.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import partita as pt
from partita.results import Result

Array = NDArray[np.float64]
GRAVITY = np.array([0.0, 0.0, -9.80665])
ALONG, ACROSS = 0.04, 0.1
TOLERANCE, DERIVED = 1e-4, 2e-4
"""Of a group's largest value, at least of 1; for accelerations and forces."""


@dataclass(frozen=True)
class Table:
    """One table: how it is drawn, and at which point of the ground its forces and moments are taken."""

    draw: Callable[[pt.Mechanism, Array, Array], None]
    joint: ArrayLike
    columns: Callable[[Result, Array], dict[str, Array]]
    state: Callable[[Array, Array], tuple[Array, Array]] | None = None
    """The joint's coordinates and rates from the turn since the drawing and the angular velocity: to start at a row."""


def pendulum(m: pt.Mechanism, com: Array, start: Array, joint: ArrayLike) -> None:
    """The body: its frame is that of the table, its centre of mass the origin."""
    offset = com - np.asarray(joint)
    axes = quaternion_rotation(start)
    length = float(np.linalg.norm(offset))
    along = axes.T @ (offset / length) if length > 0.0 else np.array([1.0, 0.0, 0.0])
    inertia = ACROSS * np.eye(3) + (ALONG - ACROSS) * np.outer(along, along)
    m.add_body("body", mass=1.0, inertia=inertia, position=com, orientation=start)


def quaternion_rotation(q: Array) -> Array:
    """The rotation of a quaternion, scalar first."""
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross) if abs(q @ q - 1) < 1e-5 else np.eye(3)


def tilted(degrees: float) -> Array:
    """The rotation about x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


HERE, THERE = (0.0, 0.0, 0.0), (1.0, 2.0, 3.0)
AXES, PLAIN, FLAT = tilted(-45.0), np.eye(3), tilted(-90.0)


def revolute(m: pt.Mechanism, com: Array, start: Array) -> None:
    pendulum(m, com, start, THERE)
    m.add_revolute("joint", m.ground, "body", point=THERE, axis=AXES[:, 2])


def spherical(m: pt.Mechanism, com: Array, start: Array) -> None:
    pendulum(m, com, start, THERE)
    m.add_spherical("joint", m.ground, "body", point=THERE)


def prismatic(m: pt.Mechanism, com: Array, start: Array) -> None:
    pendulum(m, com, start, THERE)
    m.add_prismatic("joint", m.ground, "body", point=THERE, axis=AXES[:, 2])


def cylindrical(m: pt.Mechanism, com: Array, start: Array) -> None:
    pendulum(m, com, start, HERE)
    m.add_cylindrical("joint", m.ground, "body", point=HERE, axis=FLAT[:, 2])


def universal(m: pt.Mechanism, com: Array, start: Array) -> None:
    pendulum(m, com, start, HERE)
    m.add_universal("joint", m.ground, "body", point=HERE, axis1=PLAIN[:, 0], axis2=PLAIN[:, 2])


def distance(m: pt.Mechanism, com: Array, start: Array) -> None:
    """A massless rod from the ground to the centre of mass."""
    pendulum(m, com, start, HERE)
    m.add_distance("rod", m.ground, HERE, "body", (0, 0, 0))


def hinge_and_ball(m: pt.Mechanism, com: Array, start: Array) -> None:
    """A massless rod on a hinge about z, the body on a ball at its end."""
    ball = np.array([2.0, 0.0, 0.0])
    pendulum(m, com, start, ball)
    m.add_rod("rod", start=HERE, end=ball, mass=0.0)
    m.add_revolute("near", m.ground, "rod", point=HERE, axis=PLAIN[:, 2])
    m.add_spherical("joint", "rod", "body", point=ball)


def actuator(m: pt.Mechanism, com: Array, start: Array) -> None:
    """Driven up at 1 m/s."""
    pendulum(m, com, start, HERE)
    m.add_prismatic("joint", m.ground, "body", point=HERE, axis=PLAIN[:, 2])
    m.add_drive("joint", lambda t: 1.0 * t)


def spring(m: pt.Mechanism, com: Array, start: Array) -> None:
    """10 N/m and 0.5 N s/m without free length, on a straight line: along the slide of a free joint."""
    pendulum(m, com, start, HERE)
    m.add_free("joint", m.ground, "body", point=HERE)
    m.add_torsion_spring("joint", stiffness=10.0, damping=0.5, coordinate=2)


def motion(run: Result, force: Array, moment: Array, at: Array) -> dict[str, Array]:
    """The content of every table; accelerations are those of the Newton-Euler equations for these forces."""
    body, weight = run.body("body"), GRAVITY[None, :]
    inertia = np.array(run_spec(run)["inertia"])
    turns = np.einsum("tij,jk,tlk->til", body.rotation, inertia, body.rotation)
    spin = np.einsum("tij,tj->ti", turns, body.angular_velocity)
    about = moment + np.cross(at - body.position, force) - np.cross(body.angular_velocity, spin)
    quaternion = np.array([as_quaternion(r) for r in body.rotation])
    return {
        "Pos": body.position,
        "Quat": quaternion,
        "Vel": body.velocity,
        "Avel": body.angular_velocity,
        "Acc": force + weight,
        "Aacc": np.array([np.linalg.lstsq(j, x, rcond=None)[0] for j, x in zip(turns, about, strict=True)]),
    }


def run_spec(run: Result) -> dict[str, object]:
    """The body as described."""
    return next(item for item in (run.spec or {})["bodies"] if item["name"] == "body")


def as_quaternion(r: Array) -> Array:
    """Scalar first; of either sign."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r.trace()]]) / 3.0  # fmt: skip
    v = np.linalg.eigh(k)[1][:, -1]
    return np.array([v[3], v[0], v[1], v[2]])


def on_ground(run: Result, at: Array) -> dict[str, Array]:
    """Tables whose forces act on the ground at the joint as it stands there."""
    joint = run.joint("joint")
    force, moment = joint.force, joint.moment
    here = moment + np.cross(joint.point - at, force)
    return {**motion(run, force, moment, joint.point), "Rforce": -force, "Rtorque": -here}


def of_distance(run: Result, at: Array) -> dict[str, Array]:
    """The rod's pull on the ground."""
    body = run.body("body")
    offset = at - body.position
    pull = run.coupling("rod").tension[:, None] * offset / np.linalg.norm(offset, axis=1)[:, None]
    zero = np.zeros_like(pull)
    return {**motion(run, pull, zero, body.position), "Rforce": -pull, "Rtorque": zero}


def of_link(run: Result, at: Array) -> dict[str, Array]:
    """Forces of the massless link on the ground and on the body."""
    joint = run.joint("joint")
    return {**motion(run, joint.force, joint.moment, joint.point), "Rforce_Body1": -joint.force,
            "Rforce_Body2": joint.force}  # fmt: skip


def of_actuator(run: Result, at: Array) -> dict[str, Array]:
    """The drive's force, and what the guide holds besides."""
    joint = run.joint("joint")
    effort = joint.drive * PLAIN[:, 2]
    here = joint.moment + np.cross(joint.point - at, joint.force)
    return {**motion(run, joint.force, joint.moment, joint.point), "RforceA": effort,
            "RforceP": effort - joint.force, "RtorqueA": np.zeros_like(effort), "RtorqueP": -here}  # fmt: skip


def of_spring(run: Result, at: Array) -> dict[str, Array]:
    """The spring is an applied force, and no reaction: it is what the acceleration requires besides weight."""
    first = next(item["state_v"][0] for item in run.summary["joints"] if item["name"] == "joint")
    force = run.vdot[:, first : first + 3] - GRAVITY
    zero = np.zeros_like(force)
    return {**motion(run, force, zero, run.body("body").position), "Rforce": -force, "Rtorque": zero}


def crossed(turn: Array, spin: Array) -> tuple[Array, Array]:
    """Of the universal joint: a rotation about x, followed by one about the rotated z."""
    first, second = np.arctan2(-turn[1, 2], turn[2, 2]), np.arctan2(-turn[0, 1], turn[0, 0])
    return np.array([first, second]), np.array([spin[0], spin @ turn[:, 2]])


TABLES = {
    "Revolute_Case02": Table(revolute, THERE, on_ground),
    "Spherical_Case02": Table(spherical, THERE, on_ground),
    "Prismatic_Case02": Table(prismatic, THERE, on_ground),
    "Cylindrical_Case02": Table(cylindrical, HERE, on_ground),
    "Universal_Case01": Table(universal, HERE, on_ground, crossed),
    "LinActuator_Case01": Table(actuator, HERE, of_actuator),
    "TranSpring_Case01": Table(spring, HERE, of_spring),
    "Distance_Case01": Table(distance, HERE, of_distance),
    "RevSpherical_Case01": Table(hinge_and_ball, HERE, of_link),
}


def compared(path: Path) -> bool:
    """One table: a line for each group of columns with the largest difference of each; whether all are small enough."""
    table = TABLES[path.stem]
    with path.open(encoding="utf-8") as lines:
        names = lines.readline().strip().split(",")
        rows = np.array([[float(word) for word in line.split(",")] for line in lines if line.strip()])
    known = dict(zip(names, rows.T, strict=True))
    m = pt.Mechanism(path.stem, gravity=tuple(GRAVITY))
    start = rows[0, names.index("Quat0") : names.index("Quat0") + 4]
    table.draw(m, rows[0, 1:4], start / np.linalg.norm(start))
    print(f"\n{path.stem}")
    lost = drift(known) if table.columns in (on_ground, of_distance) else 0.0
    apart = lost > TOLERANCE and table.state is not None
    if lost > TOLERANCE:
        print(f"  the table's own energy drifts by {lost:.1e} of the largest kinetic energy")
    try:
        if apart:
            found, rows = row_by_row(m, table, known), rows[1:]
            known = dict(zip(names, rows.T, strict=True))
            print("  each row from the one before it:")
        else:
            initial = m.assemble(rates={"joint": 1.0}) if table.draw is actuator else m.assemble()
            found = table.columns(ran(m, rows[:, 0], initial), np.asarray(table.joint))
    except pt.errors.PartitaError as error:
        print(f"  {type(error).__name__}: {error}")
        return False
    fine = True
    for group, values in found.items():
        theirs = np.column_stack([known[f"{group}{i}"] for i in range(values.shape[1])])
        if group == "Quat":
            values = values * np.where(np.sum(values * theirs, axis=1) < 0.0, -1.0, 1.0)[:, None]
        off = np.abs(values - theirs).max(axis=0)
        largest = max(float(np.abs(theirs).max()), 1.0)
        allowed = DERIVED if group[0] in "AR" and group != "Avel" else TOLERANCE
        small = bool(np.all(off <= allowed * largest))
        mark = "" if small else f"  <- more than {allowed:.0e} of it"
        fine = fine and small
        print(f"  {group:<13}" + "".join(f"{x:>10.1e}" for x in off) + f"   of {largest:.3g}{mark}")
    return fine


def ran(m: pt.Mechanism, at: Array, initial: pt.State) -> Result:
    """The run from the first to the last of these times; what ends early is an error."""
    run = m.simulate(float(at[-1] - at[0]), t_eval=at - at[0], initial=initial, rtol=1e-11, atol=1e-13)
    if not run.success:
        raise pt.errors.PartitaError(run.message)
    return run


def row_by_row(m: pt.Mechanism, table: Table, known: dict[str, Array]) -> dict[str, Array]:
    """All rows but the first, each computed from the printed position and velocity of the row before it."""
    assert table.state is not None
    quaternion = np.column_stack([known[f"Quat{i}"] for i in range(4)])
    turned = [quaternion_rotation(q / np.linalg.norm(q)) for q in quaternion]
    spin = np.column_stack([known[f"Avel{i}"] for i in range(3)])
    ends: list[dict[str, Array]] = []
    for k in range(len(turned) - 1):
        where, rates = table.state(turned[k] @ turned[0].T, spin[k])
        initial = m.assemble({"joint": where}, rates={"joint": rates})
        found = table.columns(ran(m, known["t"][k : k + 2], initial), np.asarray(table.joint))
        ends.append({group: values[-1] for group, values in found.items()})
    return {group: np.array([end[group] for end in ends]) for group in ends[0]}


def drift(known: dict[str, Array]) -> float:
    """By how much the energy of a free pendulum drifts in a table, over the largest kinetic energy.

    It turns across the line to the joint, as all of these do; the one on a link may spin, and is not asked.
    """
    speed = sum(known[f"Vel{i}"] ** 2 for i in range(3))
    spin = sum(known[f"Avel{i}"] ** 2 for i in range(3))
    kinetic = 0.5 * speed + 0.5 * ACROSS * spin
    total = kinetic - GRAVITY[2] * known["Pos2"]
    return float(np.ptp(total) / np.max(kinetic))


def main() -> int:
    """Compare every table of the folder; 1 if a column differs by more than ADAMS can be trusted with."""
    parser = argparse.ArgumentParser(description="Joint pendulums against tables of MSC ADAMS.")
    parser.add_argument("folder", type=Path, help="holds the tables")
    folder = parser.parse_args().folder
    paths = sorted(folder.glob("*.csv"))
    unknown = [path.name for path in paths if path.stem not in TABLES]
    if not paths or unknown:
        parser.error(f"{folder}: {', '.join(unknown) or 'no tables'}")
    found = [compared(path) for path in paths]
    print(f"\n{sum(found)} of {len(found)} tables are met")
    return int(not all(found))


if __name__ == "__main__":
    sys.exit(main())
