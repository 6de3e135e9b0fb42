"""Which reactions are unique, at each output

The directions in which self-stresses load a joint move with the mechanism. Each output is judged separately, in world
axes and in those of the joint, and determined components do not change when a redundant joint is removed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from oracle.drawing import Body, Drawing, Joint

import partita as pt

from .case import Held, done, right
from .program import as_the_program_says

UP = np.array([0.0, 0.0, 1.0])


def door(free: bool = False) -> pt.Mechanism:
    """A leaf on two hinges in a frame that rolls; `free`: the upper hinge left out."""
    m = pt.Mechanism("door", gravity=(0, 0, -9.81))
    m.add_body("frame", mass=5.0, inertia=(1.0, 1.2, 1.4))
    m.add_body("leaf", mass=20.0, inertia=(5.3, 4.3, 1.1), com=(0.4, 0, 0))
    m.add_revolute("roll", m.ground, "frame", point=(0, 0, 0), axis=(1, 0, 0))
    m.add_revolute("low", "frame", "leaf", point=(0, 0, -0.8))
    if not free:
        m.add_revolute("high", "frame", "leaf", point=(0, 0, 0.8))
    return m


@right(
    "a door on two hinges in a rolling frame",
    "by hand: only the moment along the hinges' own axis is unique, in its own axes",
)
def rolling_door() -> Iterator[Held]:
    m = door()
    start = m.assemble(rates={"roll": 1.5, "low": 2.0})
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(2.0, initial=start, coordinates=coordinates, t_eval=np.linspace(0, 2, 21)))
        axis = run.body("frame").rotation[:, :, 2]
        # the two hinges can push and twist each other any way but about their common axis
        along = np.abs(axis) > 1 - 1e-12
        for name in ("low", "high"):
            joint = run.joint(name)
            yield Held(f"world, {name}", joint.determined_at, np.hstack([0 * along, along]), 0.0)
            own = joint.in_frame("joint").determined_at
            yield Held(f"own, {name}", own, np.tile([0, 0, 0, 0, 0, 1], (21, 1)), 0.0)


@right("the same without the upper hinge: what was unique is what it was", "the statically determinate door")
def one_hinge() -> Iterator[Held]:
    runs = []
    for m in (door(), door(free=True)):
        start = m.assemble(rates={"roll": 1.5, "low": 2.0})
        runs.append(done(m.simulate(2.0, initial=start, rtol=1e-11, atol=1e-12, t_eval=np.linspace(0, 2, 21))))
    both, one = runs
    roll = [run.joint("roll") for run in runs]
    yield Held("determined at the frame", roll[0].determined, [True] * 6, 0.0)
    yield Held("force at the frame", roll[0].force, roll[1].force, 1e-6)
    yield Held("moment at the frame", roll[0].moment, roll[1].moment, 1e-6)
    low, high, alone = both.joint("low"), both.joint("high"), one.joint("low")
    yield Held("force of both", low.force + high.force, alone.force, 1e-6)
    whole = low.moment + high.moment + np.cross(high.point - low.point, high.force)
    yield Held("moment of both", whole, alone.moment, 1e-6)
    yield Held("alone is determined", alone.determined, [True] * 6, 0.0)


def sarrus() -> Drawing:
    """A plate lifted by two folding pairs of leaves, hinges along y and along x."""
    bodies = [Body("plate", 2.0, np.diag([0.1, 0.1, 0.2]), np.zeros(3), np.array([0.0, 0.0, 0.8]), np.eye(3))]
    joints = []
    for i, (out, axis) in enumerate([((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0))]):
        out_, hinge = np.array(out, dtype=float), np.array(axis, dtype=float)[:, None]
        foot, top = 0.5 * out_, 0.5 * out_ + [0, 0, 0.8]
        knee = 0.8 * out_ + [0, 0, 0.4]
        for name, start, end in (("lower", foot, knee), ("upper", knee, top)):
            bodies.append(Body(f"{name}{i}", 0.5, np.diag([0.01, 0.02, 0.02]), 0.5 * (end - start), start, np.eye(3)))
        chain = [("ground", f"lower{i}", foot), (f"lower{i}", f"upper{i}", knee), (f"upper{i}", "plate", top)]
        for k, (parent, child, point) in enumerate(chain):
            joints.append(Joint(f"{'ABC'[k]}{i}", "revolute", parent, child, point, hinge))
    return Drawing(np.array([1.0, 2.0, -9.81]), tuple(bodies), tuple(joints))


@right(
    "Sarrus linkage, reactions in world, joint and oblique axes",
    "a maximal-coordinate program: self-stresses by singular values",
)
def sarrus_linkage() -> Iterator[Held]:
    drawing = sarrus()
    m = drawing.build()
    for coordinates in ("relative", "absolute"):
        run = done(m.simulate(0.3, t_eval=np.linspace(0, 0.3, 9), coordinates=coordinates))
        yield from as_the_program_says(drawing, m, run, coordinates)
        yield Held("the plate only shifts", run.body("plate").rotation, np.eye(3), 1e-9)


@right(
    "a stool on three legs and one on four, standing on ball feet",
    "statics: three ball feet share the weight by thirds; of four, only sums are unique",
)
def stools() -> Iterator[Held]:
    for legs in (3, 4):
        m = pt.Mechanism("stool", gravity=(0, 0, -9.81))
        m.add_body("seat", mass=6.0, inertia=(0.1, 0.1, 0.2), position=(0, 0, 0.5))
        for i in range(legs):
            angle = 2 * np.pi * i / legs
            foot = (0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.0)
            # a foot slides on the floor but for the first two, which hold the stool in place
            free = ("x", "y", "rx", "ry", "rz") if i else ("rx", "ry", "rz")
            if i == 1:
                free = ("x", "rx", "ry", "rz")
            m.add_joint(f"foot{i}", m.ground, "seat", free, point=foot)
        run = done(m.simulate(1.0))
        lifts = np.array([run.joint(f"foot{i}").force[0, 2] for i in range(legs)])
        unique = np.array([run.joint(f"foot{i}").determined[2] for i in range(legs)])
        yield Held("weight", lifts.sum(), 6.0 * 9.81, 1e-9)
        yield Held("unique", unique, legs == 3, 0.0)
        if legs == 3:
            yield Held("thirds", lifts, 2.0 * 9.81, 1e-9)


@right(
    "a beam on a hinge and two rollers",
    "statics: the hinge's and the rollers' sum and moment; none of the three is unique",
)
def beam() -> Iterator[Held]:
    m = pt.Mechanism("beam", gravity=(0, -9.81, 0))
    beam = m.add_rod("beam", start=(0, 0, 0), end=(4, 0, 0), mass=10.0)
    m.add_revolute("A", m.ground, beam, point=(0, 0, 0))
    for name, x in (("B", 1.5), ("C", 4.0)):
        m.add_joint(name, m.ground, beam, ("x", "rz"), point=(x, 0, 0))
    m.add_force("beam", (7.0, -20.0, 0.0), point=(1.0, 0, 0))
    run = done(m.simulate(0.5))
    a, b, c = (run.joint(name) for name in "ABC")
    weight = 98.1
    yield Held("along", a.force[:, 0], -7.0, 1e-9)
    yield Held("along is unique", a.determined[0], True, 0.0)
    yield Held("sum", a.force[:, 1] + b.force[:, 1] + c.force[:, 1], weight + 20.0, 1e-9)
    yield Held("moment", 1.5 * b.force[:, 1] + 4.0 * c.force[:, 1], 2.0 * weight + 20.0, 1e-9)
    yield Held("none unique", [x.determined[1] for x in (a, b, c)], False, 0.0)
