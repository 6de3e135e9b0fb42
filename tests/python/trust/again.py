"""The same again

A result depends on its arguments alone: not on what was asked before, on threads, on the way through a file or
another process, on whether numbers were changed in a model or in its drawing.
"""

from __future__ import annotations

import copy
import pickle
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from drawings import GENERAL, G, four_bar, parallelogram, pendulum, swing
from oracle import chance

import partita as pt
from partita import results

from .case import Held, done, right
from .in_the_plane import double_known


@right("the same run twice, others with other options in between", "the first, to the last bit")
def twice() -> Iterator[Held]:
    m = four_bar(GENERAL)
    start = m.assemble(rates={"A": 3.0})
    first = done(m.simulate(2.0, initial=start))
    for formulation in ("svd", "multipliers", "wehage-haug"):
        m.simulate(0.3, initial=start, solver=pt.Solver(formulation), rtol=1e-4)
    m.simulate(1.0, coordinates="absolute")
    second = done(m.simulate(2.0, initial=start))
    yield Held("q", second.q, first.q, 0.0)
    yield Held("forces", second.joint("B").force, first.joint("B").force, 0.0)


@right("eight threads, four mechanisms, one model each", "the same one after the other, to the last bit")
def threads() -> Iterator[Held]:
    drawn = [four_bar(GENERAL), pendulum(drawn=1.0), parallelogram(gravity=G), four_bar(GENERAL, masses=(1, 2, 3))]
    alone = [done(m.simulate(1.0)).q for m in drawn]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda i: drawn[i % 4].simulate(1.0).q, range(16)))
    for i, q in enumerate(together):
        yield Held(f"mechanism {i % 4}", q, alone[i % 4], 0.0)


@right(
    "a result saved as JSON and as NetCDF and loaded, pickled, copied",
    "itself, to the last bit; the motion by elliptic functions",
)
def stored() -> Iterator[Held]:
    run = done(pendulum(drawn=1.0).simulate(2.0, rtol=1e-10, atol=1e-12))
    yield Held("angle", run.q[:, 0] + 1.0, swing(run.t, 1.0), 1e-8)
    with tempfile.TemporaryDirectory() as folder:
        others = [results.load_result(run.save(Path(folder) / f"run{ending}")) for ending in (".json", ".nc")]
    for other in (*others, pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        done(other)
        for what in ("t", "q", "v", "vdot"):
            yield Held(what, getattr(other, what), getattr(run, what), 0.0)
        yield Held("force", other.joint("A").force, run.joint("A").force, 0.0)
        yield Held("energy", other.energy.total, run.energy.total, 0.0)


@right("a run that ended early, saved and loaded", "no success, with its sentence")
def stored_failure() -> Iterator[Held]:
    m = pendulum()
    m.add_drive("A", position=(np.linspace(0, 1, 11), np.sin(np.linspace(0, 1, 11))))
    run = m.simulate(2.0)
    with tempfile.TemporaryDirectory() as folder:
        other = results.load_result(run.save(Path(folder) / "run.json"))
    yield Held("success", [run.success, other.success], False, 0.0)
    yield Held(
        "words", [other.message == run.message, other.status == run.status, "ends at 1 s" in run.message], True, 0.0
    )


@right("a model with other masses, gravity and points, and a mechanism drawn so", "the second, at chance states")
def parameters() -> Iterator[Held]:
    changed = [(0.0, 0.0), (0.5, 1.0), (2.5, 1.6), (2.2, 0.0)]
    model = four_bar(changed).compile()
    other = four_bar(changed, gravity=3.0, masses=(0.3, 0.5, 0.4))
    third = model.with_parameters({"gravity": (0, -3.0, 0), "coupler.mass": 5.0})
    alone = other.compile().with_parameters({"coupler.mass": 5.0})
    state = other.assemble(rates={"A": 2.0})
    found, known = third.acceleration(state.q, state.v), alone.acceleration(state.q, state.v)
    yield Held("accelerations", found[0], known[0], 1e-12)
    # the mass alone was changed, not the moment of inertia: by hand, a rod of 5 kg with the moment of one of 0.5
    length = np.hypot(2.0, 0.6)
    user_defined = pt.Mechanism("by hand", gravity=(0, -3.0, 0))
    a, b, c, d = [(*p, 0.0) for p in changed]
    user_defined.add_rod("crank", a, b, 0.3)
    along = np.array([2.0, 0.6]) / length
    moment = 0.5 * length**2 / 12
    turn = [[along[0], -along[1], 0], [along[1], along[0], 0], [0, 0, 1]]
    user_defined.add_body("coupler", 5.0, (0, moment, moment), com=(length / 2, 0, 0), position=b, orientation=turn)
    user_defined.add_rod("rocker", d, c, 0.4)
    user_defined.add_revolute("A", "ground", "crank", point=a)
    user_defined.add_revolute("B", "crank", "coupler", point=b)
    user_defined.add_revolute("C", "coupler", "rocker", point=c)
    user_defined.add_revolute("D", "ground", "rocker", point=d)
    yield Held("by hand", found[0], user_defined.compile().acceleration(state.q, state.v)[0], 1e-11)


@right("a mechanism saved as a model file and loaded", "the same run, to the last bit")
def model_file() -> Iterator[Held]:
    m = four_bar(GENERAL)
    m.add_torque("A", (np.linspace(0, 2, 9), np.sin(np.linspace(0, 2, 9))))
    m.add_spring("S", "ground", (1, 2, 0), "coupler", (0.5, 0, 0), stiffness=10.0, damping=0.3)
    with tempfile.TemporaryDirectory() as folder:
        m.save(Path(folder) / "m.toml")
        other = pt.load(Path(folder) / "m.toml")
    yield Held("q", done(other.simulate(2.0)).q, done(m.simulate(2.0)).q, 0.0)


@right("a run in two halves, the second from the end of the first", "the run in one go, and Lagrange's equations")
def halves() -> Iterator[Held]:
    m = pt.Mechanism("double", gravity=(0, -G, 0))
    m.add_rod("one", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_rod("two", start=(1, 0, 0), end=(1.7, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, "one", point=(0, 0, 0))
    m.add_revolute("B", "one", "two", point=(1, 0, 0))
    first = done(m.simulate(0.7, rtol=1e-11, atol=1e-13))
    model = m.compile()
    middle = pt.State(0.7, first.q[-1], first.v[-1], names=model.names, velocity_names=model.velocity_names)
    second = done(m.simulate(0.8, initial=middle, rtol=1e-11, atol=1e-13))
    yield Held("time", [second.t[0], second.t[-1]], [0.7, 1.5], 1e-15)
    known = double_known(np.linspace(0, 1.5, 3), (1.0, 2.0), (1.0, 0.7))[-1]
    yield Held("angles", np.cumsum(second.q[-1]), known, 1e-8)


@right("a conservative motion there and back: velocities turned round half-way", "it comes back to where it was let go")
def back_again() -> Iterator[Held]:
    m = four_bar(GENERAL)
    there = done(m.simulate(1.5, rtol=1e-12, atol=1e-14))
    model = m.compile()
    turned = pt.State(0.0, there.q[-1], -there.v[-1], names=model.names, velocity_names=model.velocity_names)
    back = done(m.simulate(1.5, initial=turned, rtol=1e-12, atol=1e-14))
    yield Held("place", back.q[-1], there.q[0], 1e-8)
    yield Held("rest", back.v[-1], 0.0, 1e-7)


@right("outputs in other places", "the same motion: they change no step")
def outputs() -> Iterator[Held]:
    m = four_bar(GENERAL)
    few = done(m.simulate(2.0, t_eval=[0.0, 1.0, 2.0]))
    many = done(m.simulate(2.0, t_eval=np.linspace(0, 2, 2001)))
    yield Held("q", many.q[[0, 1000, 2000]], few.q, 0.0)


@right("a mechanism turned in space and drawn in millimetres", "the motion of the drawing as it was")
def turned_and_scaled() -> Iterator[Held]:
    drawing = chance.mechanism(5)
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    runs = []
    for one, time in ((drawing, 1.0), (drawing.turned(turn), 1.0), (drawing.scaled(1e3, 1.0, 1.0), 1.0)):
        runs.append(
            done(one.build().simulate(0.2 * time, t_eval=np.linspace(0, 0.2 * time, 5), rtol=1e-11, atol=1e-13))
        )
    whole, turned, scaled = runs
    for body in drawing.bodies:
        known = whole.body(body.name).position
        yield Held(f"turned {body.name}", turned.body(body.name).position @ turn, known, 1e-7 * drawing.size)
        yield Held(f"scaled {body.name}", scaled.body(body.name).position / 1e3, known, 1e-7 * drawing.size)


@right("a run goes on from its own end, made closed again by assemble(near=)", "the same run in one")
def goes_on() -> Iterator[Held]:
    m = four_bar(GENERAL)
    whole = done(m.simulate(2.0, initial=m.assemble(rates={"A": 3.0}), rtol=1e-11, atol=1e-13))
    first = done(m.simulate(1.0, initial=m.assemble(rates={"A": 3.0}), rtol=1e-11, atol=1e-13))
    middle = m.assemble(near=pt.State(1.0, first.q[-1], first.v[-1], names=first.names.coordinates,
                                      velocity_names=first.names.velocities))  # fmt: skip
    second = done(m.simulate(1.0, initial=middle, rtol=1e-11, atol=1e-13))
    yield Held("velocities taken over", middle.v, first.v[-1], 1e-12)
    yield Held("the end", second.joint("A").position[-1], whole.joint("A").position[-1], 1e-8)
