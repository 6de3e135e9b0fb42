"""Forces of engineers drawn by chance: what they do to free bodies against potentials and Jacobians by differences.

Of a bushing and of contacts only what is displaced is written here, as a function of the poses; how force and moment
follow from it is found by moving each body a little. Of loads along joints the laws are written as one reads them, and
the body gains what they and gravity give.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from oracle.chance import rotation
from oracle.maximal import about
from scipy.spatial.transform import Rotation

import partita as pt

Array = Any
SEEDS = range(12)
STEP = 1e-6
"""Of central differences: what they miss is of the order of its square, round-off over it 1e-10."""


class Body:
    """A solid body, moved from where it is drawn."""

    def __init__(self, rng: Any, name: str, at: Array) -> None:
        own, edges = rotation(rng), rng.uniform(0.5, 1.0, size=3)
        self.name, self.mass = name, float(rng.uniform(0.5, 2.0))
        self.inertia = own @ np.diag(self.mass * (edges @ edges - edges**2)) @ own.T
        self.inertia = 0.5 * (self.inertia + self.inertia.T)
        self.com, self.at, self.turn = 0.3 * rng.normal(size=3), at, rotation(rng)
        self.u, self.w = rng.normal(size=3), rng.normal(size=3)

    def add(self, m: pt.Mechanism) -> None:
        m.add_body(self.name, self.mass, self.inertia, com=self.com, position=self.at, orientation=self.turn)


Poses = dict[str, tuple[Array, Array]]


def place(poses: Poses, body: str, point: Array) -> Array:
    x, turn = poses[body]
    return x + turn @ point


def drawn(bodies: list[Body]) -> Poses:
    return {"ground": (np.zeros(3), np.eye(3))} | {b.name: (b.at, b.turn) for b in bodies}


def shifted(poses: Poses, body: str, k: int, h: float) -> Poses:
    """One body moved along an axis of the world, or turned about one through its origin."""
    x, turn = poses[body]
    axis = np.eye(3)[k % 3]
    return poses | {body: (x + h * axis, turn) if k < 3 else (x, about(axis, h) @ turn)}


def jacobian(value: Callable[[Poses], Array], poses: Poses, body: str) -> Array:
    """(n, 6): change of the value with the body's velocity and angular velocity."""
    columns = [value(shifted(poses, body, k, STEP)) - value(shifted(poses, body, k, -STEP)) for k in range(6)]
    return np.array(columns).T / (2.0 * STEP)


def wrenches(
    bodies: list[Body], value: Callable[[Poses], Array], effort: Callable[[Array, Array], Array]
) -> dict[str, Array]:
    """Force, and moment about its origin, on each body, of efforts that follow from a value and its rate."""
    poses = drawn(bodies)
    slopes = {x.name: jacobian(value, poses, x.name) for x in bodies}
    rate = sum(slopes[x.name] @ np.concatenate([x.u, x.w]) for x in bodies)
    found = effort(value(poses), rate)
    return {name: slope.T @ found for name, slope in slopes.items()}


def started(m: pt.Mechanism, bodies: list[Body], rest: Poses, coordinates: str) -> pt.Result:
    """From where the bodies are now, at their velocities, with sensors of all that they do."""
    for b in bodies:
        m.add_sensor(f"{b.name} a", m.bodies[b.name], "acceleration")
        m.add_sensor(f"{b.name} alpha", m.bodies[b.name], "angular_acceleration")
    model = m.compile()
    q, v = np.zeros(len(model.names)), np.zeros(len(model.velocity_names))
    spans = {joint["name"]: joint for joint in model.summary["joints"]}
    for b in bodies:
        x, turn = rest[b.name]
        moved = b.turn @ turn.T
        first, count = spans[b.name]["state_q"]
        q[first : first + count] = [*(b.at - x), *Rotation.from_matrix(moved).as_quat()[[3, 0, 1, 2]]]
        first, count = spans[b.name]["state_v"]
        v[first : first + count] = [*b.u, *(moved.T @ b.w)]
    # joints and bodies share their names here: names do not identify the numbers of a state
    state = m.convert(pt.State(0.0, q, v, layout=m.assemble()._layout), coordinates)
    run = m.simulate(1e-5, t_eval=[0.0, 1e-5], initial=state, coordinates=coordinates)
    for b in bodies:
        body = run.body(b.name)
        assert np.abs(body.position[0] - b.at).max() < 1e-12 and np.abs(body.rotation[0] - b.turn).max() < 1e-12
        assert np.abs(body.velocity[0] - b.u).max() < 1e-11 and np.abs(body.angular_velocity[0] - b.w).max() < 1e-11
    return run


def needed(b: Body, run: pt.Result) -> Array:
    """Force, and moment about the origin, that the motion at the start requires."""
    a, alpha = (run.sensor(f"{b.name} {x}").values[0] for x in ("a", "alpha"))
    arm, inertia = b.turn @ b.com, b.turn @ b.inertia @ b.turn.T
    force = b.mass * (a + np.cross(alpha, arm) + np.cross(b.w, np.cross(b.w, arm)))
    return np.concatenate([force, inertia @ alpha + np.cross(b.w, inertia @ b.w) + np.cross(arm, force)])


def pair(rng: Any) -> tuple[pt.Mechanism, list[Body], Poses]:
    m, bodies = pt.Mechanism("pair", gravity=None), [Body(rng, name, rng.normal(size=3)) for name in "ab"]
    for b in bodies:
        b.add(m)
        m.add_free(b.name, m.ground, b.name, point=b.at)
    return m, bodies, drawn(bodies)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_bushing_follows_from_what_is_displaced(seed: int, coordinates: str) -> None:
    """Drawn at rest it does nothing: one body is moved and turned away from there."""
    rng = np.random.default_rng(seed)
    m, bodies, rest = pair(rng)
    b = bodies[1]
    point, axes, roots = rng.normal(size=3), rotation(rng), rng.normal(size=(2, 6, 6))
    stiffness, damping = roots[0] @ roots[0].T, roots[1] @ roots[1].T
    if seed % 3 == 0:
        stiffness = roots[0]  # without a potential
    m.add_bushing("B", "a", "b", point, stiffness=stiffness, damping=damping, frame=axes)
    m.add_sensor("power", m.forces["B"], "power")
    m.add_sensor("energy", m.forces["B"], "energy")
    ends, frames = [x.turn.T @ (point - x.at) for x in bodies], [x.turn.T @ axes for x in bodies]
    b.at = b.at + 0.3 * rng.normal(size=3)
    b.turn = about(rotation(rng)[:, 0], float(rng.uniform(0.2, 2.0))) @ b.turn

    def displaced(poses: Poses) -> Array:
        one = poses["a"][1] @ frames[0]
        gap = place(poses, "b", ends[1]) - place(poses, "a", ends[0])
        return np.concatenate([one.T @ gap, Rotation.from_matrix(one.T @ poses["b"][1] @ frames[1]).as_rotvec()])

    wanted = wrenches(bodies, displaced, lambda x, rate: -(stiffness @ x + damping @ rate))
    run = started(m, bodies, rest, coordinates)
    for body in bodies:
        scale = float(np.abs(wanted[body.name]).max())
        assert np.abs(needed(body, run) - wanted[body.name]).max() < 1e-7 * scale
    x, done = displaced(drawn(bodies)), sum(float(wanted[k.name] @ np.concatenate([k.u, k.w])) for k in bodies)
    stored = 0.5 * x @ stiffness @ x
    assert run.sensor("energy").values[0] == pytest.approx(stored, rel=1e-9, abs=1e-12)
    assert run.sensor("power").values[0] == pytest.approx(done, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("other", ["plane", "sphere"])
def test_a_contact_follows_from_its_depth(other: str, seed: int, coordinates: str) -> None:
    """Without friction: N = k depth^e (1 + c rate), along the depth's own slope, whatever moves."""
    rng = np.random.default_rng(100 + seed)
    m, bodies, rest = pair(rng)
    a, b = bodies
    one, radius, k, e, c = rng.normal(size=3), 0.6, float(rng.uniform(50, 90)), float(rng.uniform(1.0, 2.0)), 0.05
    centre, normal = a.at + a.turn @ one, rotation(rng)[:, 0]
    if other == "plane":
        # the plane lies 0.4 below the centre, wherever its point is
        point = centre - 0.4 * normal + np.cross(normal, rng.normal(size=3))
        shape, two, axis = {"normal": b.turn.T @ normal}, b.turn.T @ (point - b.at), b.turn.T @ normal

        def depth(poses: Poses) -> Array:
            gap = place(poses, "a", one) - place(poses, "b", two)
            return np.array([radius - gap @ (poses["b"][1] @ axis)])
    else:
        shape, two = {"radius2": 0.5}, b.turn.T @ (centre + 0.9 * normal - b.at)

        def depth(poses: Poses) -> Array:
            return np.array([radius + 0.5 - np.linalg.norm(place(poses, "a", one) - place(poses, "b", two))])

    law = {"radius1": radius, "stiffness": k, "exponent": e, "damping": c}
    m.add_contact("C", "a", one, "b", two, **law, **shape)
    m.add_sensor("power", m.forces["C"], "power")
    m.add_sensor("energy", m.forces["C"], "energy")
    wanted = wrenches(bodies, depth, lambda x, rate: k * x**e * np.maximum(1.0 + c * rate, 0.0))
    run, x = started(m, bodies, rest, coordinates), float(depth(drawn(bodies))[0])
    assert x == pytest.approx(0.2)
    # a contact's effort is along the depth, which it lessens
    wanted = {name: -w for name, w in wanted.items()}
    for body in bodies:
        scale = float(np.abs(wanted[body.name]).max())
        assert np.abs(needed(body, run) - wanted[body.name]).max() < 1e-7 * scale
    assert run.sensor("energy").values[0] == pytest.approx(k * x ** (e + 1.0) / (e + 1.0), rel=1e-9)


def sleeve(rng: Any) -> pt.Mechanism:
    """A body on a cylindrical joint, at a speed."""
    m = pt.Mechanism("sleeve", gravity=rng.normal(size=3))
    b = Body(rng, "b", rng.normal(size=3))
    b.add(m)
    m.add_cylindrical("J", m.ground, "b", point=rng.normal(size=3), axis=rng.normal(size=3))
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("seed", SEEDS)
def test_loads_along_a_joint_follow_their_laws(seed: int, coordinates: str) -> None:
    rng = np.random.default_rng(200 + seed)
    m, i = sleeve(rng), seed % 2
    force, length, exponent = float(rng.uniform(5, 9)), float(rng.uniform(0.8, 2.0)), float(rng.uniform(1.1, 1.6))
    k, c, e, level, slow = float(rng.uniform(30, 50)), 0.1, float(rng.uniform(1.0, 2.0)), 0.7, 0.2
    m.add_gas_spring("J", force=force, length=length, exponent=exponent, coordinate=i, name="gas")
    m.add_stop("J", stiffness=k, lower=-0.1, upper=0.2, damping=c, exponent=e, coordinate=1 - i, name="stop")
    m.add_friction("J", level, stick_velocity=slow, coordinate=i, name="friction")
    m.add_torsion_spring("J", stiffness=4.0, damping=0.3, angle=0.2, coordinate=i, name="spring")
    loads = ("gas", "stop", "friction", "spring")
    for name in loads:
        for word in ("effort", "power", "energy"):
            m.add_sensor(f"{name} {word}", m.forces[name], word)
    x = [float(rng.uniform(0.3, 0.5)) * (1 if seed % 4 < 2 else -1), float(rng.uniform(0.3, 0.5))]
    x = x if i else x[::-1]
    rates = rng.uniform(0.5, 1.0, size=2) * rng.choice([-1.0, 1.0], size=2)
    start = m.convert(m.assemble({"J": x}, rates={"J": rates}), coordinates)
    run = m.simulate(1e-5, t_eval=[0.0, 1e-5], initial=start, coordinates=coordinates)
    seen = run.joint("J")
    assert np.abs(seen.position[0] - x).max() < 1e-12 and np.abs(seen.velocity[0] - rates).max() < 1e-12

    def read(name: str, word: str) -> float:
        return float(run.sensor(f"{name} {word}").values[0])

    y, v = x[i], float(rates[i])
    column = 1.0 + y / length
    assert read("gas", "effort") == pytest.approx(force * column**-exponent, rel=1e-10)
    assert read("gas", "energy") == pytest.approx(
        force * length * column ** (1.0 - exponent) / (exponent - 1.0), rel=1e-10
    )
    assert read("spring", "effort") == pytest.approx(-4.0 * (y - 0.2) - 0.3 * v, rel=1e-10)
    z, w = x[1 - i], float(rates[1 - i])
    depth, inward = (z - 0.2, w) if z > 0.0 else (-0.1 - z, -w)
    push = k * depth**e * max(1.0 + c * inward, 0.0)
    assert read("stop", "effort") == pytest.approx(-push if z > 0.0 else push, rel=1e-9)
    assert read("stop", "energy") == pytest.approx(k * depth ** (e + 1.0) / (e + 1.0), rel=1e-9)
    # sliding faster than it sticks, friction has its level and the direction against the motion
    assert read("friction", "effort") == pytest.approx(-level * np.sign(v), rel=1e-2)
    assert read("friction", "power") == pytest.approx(read("friction", "effort") * v, rel=1e-10)
    # what the body gains is what all of them and gravity give
    m_b = m.to_spec()["bodies"][0]
    body, j = run.body("b"), run.joint("J")
    effort = [0.0, 0.0]
    for name, at in (("gas", i), ("friction", i), ("spring", i), ("stop", 1 - i)):
        effort[at] += read(name, "effort")
    turn, com = body.rotation[0], body.rotation[0] @ np.array(m_b["com"])
    axis = j._data.reaction["joint_rotation"][0][:, 2]
    spin, rate = axis * rates[1], axis * rates[0]
    arm = body.position[0] + com - j.point[0]
    u = rate + np.cross(spin, arm)
    accelerations = j.acceleration[0]
    a = axis * accelerations[0] + np.cross(axis * accelerations[1], arm) + np.cross(spin, np.cross(spin, arm))
    inertia = turn @ np.array(m_b["inertia"]) @ turn.T
    gained = m_b["mass"] * float((a - np.array(m.to_spec()["gravity"])) @ u) + float(spin @ (inertia @ axis)) * float(
        accelerations[1]
    )
    assert gained == pytest.approx(effort[0] * rates[0] + effort[1] * rates[1], rel=1e-8)
