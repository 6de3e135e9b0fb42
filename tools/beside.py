"""What `tools/beside_*.py` share: mechanisms run by Partita, and what another program's run shows beside them.

The other programs are asked for by themselves (`pip install exudyn`, `mujoco`, `pin`, `drake`); no test needs them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from time import process_time
from typing import Any, NamedTuple

import numpy as np

import partita as pt
from partita.results import Result

EVERY = 0.01  # outputs are compared so often [s]
EARLY = (0.1, 1.0)  # forces are compared between these times [s]: before small differences have grown


class Case(NamedTuple):
    """A mechanism, how it starts, and how long it runs."""

    name: str
    options: dict[str, Any]
    rates: dict[str, float]
    seconds: float


FOUR_BAR = Case("four-bar", {}, {"A": 2.0}, 10.0)
BENNETT = Case("bennett", {}, {}, 10.0)


class Known(NamedTuple):
    """A case as Partita runs it."""

    case: Case
    mechanism: pt.Mechanism
    run: Result


class Reading(NamedTuple):
    """What a program shows at one output, in world axes.

    Of a body the position of its frame, its rotation, the velocity of its centre of mass and its angular velocity; of a
    joint the force on its child.
    """

    bodies: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
    forces: Mapping[str, np.ndarray]


class Row(NamedTuple):
    """What a run shows of itself.

    `force` is the largest difference of a joint's unique forces over the largest of them, `other` the largest of those
    that rigid bodies leave open [N]; None: not told.
    """

    opening: float
    drift: float
    apart: float
    force: float | None
    other: float | None


def asked(words: str, cases: Iterable[Case]) -> list[Known]:
    """The cases that the command line names, run by Partita, whose row is printed."""
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("names", nargs="*", help="mechanisms; all if none is named")
    names = parser.parse_args().names
    return [known(case) for case in cases if not names or case.name in names]


def known(case: Case) -> Known:
    """A case run by Partita, its row printed."""
    m = pt.catalogue.load(case.name, **case.options)
    start = m.assemble(rates=case.rates) if case.rates else pt.catalogue.entry(case.name).start(m)
    t = np.linspace(0.0, case.seconds, round(case.seconds / EVERY) + 1)
    began = process_time()
    run = m.simulate(case.seconds, initial=start, rtol=1e-10, atol=1e-12, t_eval=t)
    spent = process_time() - began
    found = Known(case, m, run)
    row = judged(found, list(own(found)))
    print(f"{case.name}, Partita: open {row.opening:.1e} m, energy {row.drift:.1e}, {spent:.3f} s; "
          f"{len(run.summary['removed'])} redundant")  # fmt: skip
    return found


def own(known: Known) -> Iterable[Reading]:
    """Partita's run as another program's would be seen."""
    m, run, _ = known.mechanism, known.run, known.case
    bodies = {name: run.body(name) for name in m.bodies}
    for i in range(len(run.t)):
        at = {}
        for name, b in bodies.items():
            arm = b.rotation[i] @ np.array(m.bodies[name].com)
            at[name] = (b.position[i], b.rotation[i], b.velocity[i] + np.cross(b.angular_velocity[i], arm),
                        b.angular_velocity[i])  # fmt: skip
        yield Reading(at, {name: run.joint(name).force[i] for name in m.joints})


def reported(known: Known, program: str, settings: str, runs: Callable[[bool], list[Reading] | None]) -> None:
    """The row of a program, printed. `runs(True)` is looked at, `runs(False)` is on the clock and shows nothing; None
    where it ends early."""
    seen = runs(True)
    what = "ends early"
    if seen is not None:
        began = process_time()
        runs(False)
        spent = process_time() - began
        row = judged(known, seen)
        what = f"open {row.opening:.1e} m, energy {row.drift:.1e}, apart {row.apart:.1e} m, "
        what += "" if row.force is None else f"unique forces {row.force:.1e}, "
        what += "" if row.other is None else f"others {row.other:.1e} N, "
        what += f"{spent:.2f} s"
    print(f"{known.case.name}, {program}, {settings}: {what}")


def judged(known: Known, seen: list[Reading]) -> Row:
    """What outputs of another program, as many and at the same times, show beside Partita's."""
    _, m, run = known
    drawn = {b.name: (np.array(b.position), np.array(b.orientation)) for b in m.bodies.values()}
    worst = max(opening(m, drawn, at) for at in seen)
    apart = max(
        float(np.abs(at.bodies[b][0] - run.body(b).position[i]).max()) for i, at in enumerate(seen) for b in m.bodies
    )
    energies = np.array([energy(m, at) for at in seen])
    drift = float(np.abs(energies - energies[0]).max() / np.abs(run.energy.kinetic).max())
    return Row(worst, drift, apart, *forces(run, seen))


def opening(m: pt.Mechanism, drawn: Mapping[str, tuple[np.ndarray, np.ndarray]], at: Reading) -> float:
    """Largest distance [m] between the two points of any joint."""
    worst = 0.0
    for joint in m.joints.values():
        ends = []
        for body in (joint.parent, joint.child):
            point = np.array(joint.point)
            if body != "ground":
                position, rotation = drawn[body]
                point = at.bodies[body][0] + at.bodies[body][1] @ rotation.T @ (point - position)
            ends.append(point)
        worst = max(worst, float(np.linalg.norm(ends[0] - ends[1])))
    return worst


def energy(m: pt.Mechanism, at: Reading) -> float:
    """Kinetic and potential [J]."""
    total = 0.0
    for name, body in m.bodies.items():
        position, rotation, speed, spin = at.bodies[name]
        local = rotation.T @ spin
        total += 0.5 * body.mass * speed @ speed + 0.5 * local @ np.array(body.inertia) @ local
        total -= body.mass * np.array(m.gravity) @ (position + rotation @ np.array(body.com))
    return float(total)


def forces(run: Result, seen: list[Reading]) -> tuple[float | None, float | None]:
    """How far forces that are unique differ, over the largest of them, and the others [N], in the first second."""
    unique, others, scale = [], [], 0.0
    for name in seen[0].forces:
        mine = run.joint(name)
        sure = mine.determined[:3]
        for i in np.flatnonzero((run.t > EARLY[0]) & (run.t < EARLY[1])):
            difference = np.abs(seen[i].forces[name] - mine.force[i])
            unique += list(difference[sure])
            others += list(difference[~sure])
            scale = max([scale, *np.abs(mine.force[i][sure])])
    return max(unique) / scale if unique else None, max(others) if others else None


class Hinge(NamedTuple):
    """A hinge at the start, in world axes, and its rate as the turn of `child` against `parent`."""

    name: str
    parent: str
    child: str
    point: np.ndarray
    axis: np.ndarray
    rate: float


def tree(known: Known) -> tuple[list[Hinge], list[Hinge]]:
    """The hinges of a spanning tree from the ground outwards, turned to lead there, and those that close loops."""
    m = known.mechanism
    left, reached, order = list(m.joints), {"ground"}, list[Hinge]()
    while True:
        inner = [hinge(known, name) for name in left]
        ready = [h for h in inner if (h.parent in reached) != (h.child in reached)]
        if not ready:
            return order, inner
        h = ready[0]
        if h.child in reached:
            h = h._replace(parent=h.child, child=h.parent, rate=-h.rate)
        order.append(h)
        reached.add(h.child)
        left.remove(h.name)


def hinge(known: Known, name: str) -> Hinge:
    """A joint of the mechanism, which must be a hinge."""
    _, m, run = known
    joint, at = m.joints[name], run.joint(name)
    turn = np.eye(3)
    if joint.parent != "ground":
        turn = run.body(joint.parent).rotation[0] @ np.array(m.bodies[joint.parent].orientation).T
    return Hinge(name, joint.parent, joint.child, at.point[0], turn @ np.array(joint.axis), float(at.velocity[0, 0]))
