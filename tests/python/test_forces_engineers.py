"""Bushings, friction, stops, contacts, tyres, time-dependent gravity and force laws, each against a closed form."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import partita as pt
from partita.builder.laws import BodyView, JointView, PointView
from partita.errors import DescriptionError, EvaluationError, UnknownNameError

G = 9.81
TIGHT: dict[str, Any] = {"rtol": 1e-10}


def balanced(run: Any, rtol: float = 1e-10) -> None:
    """Kinetic and potential energy less work stay what they were, within a hundred tolerances of the largest."""
    energy = run.energy
    size = np.max(np.abs(energy.kinetic)) + np.max(np.abs(energy.potential))
    drift = energy.total - energy.work - (energy.total[0] - energy.work[0])
    assert run.success, run.message
    assert np.max(np.abs(drift)) < 100 * rtol * size, np.max(np.abs(drift)) / size


def slider(gravity: Any = None, mass: float = 2.0) -> pt.Mechanism:
    """A block on a rail along x."""
    m = pt.Mechanism("slider", gravity=gravity)
    block = m.add_body("block", mass=mass, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    return m


# ---------------------------------------------------------------- bushing


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_bushing_is_three_oscillators_along_its_axes_and_one_about_each(coordinates: str) -> None:
    """Displaced along all three axes; and, in runs of their own, turned by a large angle about a principal axis."""
    frame = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    k, c = np.array([50.0, 80.0, 120.0, 3.0, 4.0, 5.0]), np.array([1.0, 2.0, 0.0, 0.05, 0.0, 0.02])
    mass, inertia = 2.0, np.array([0.3, 0.2, 0.4])

    def mounted() -> pt.Mechanism:
        m = pt.Mechanism("mount", gravity=None)
        m.add_body("b", mass=mass, inertia=inertia, position=(1, 2, 3), orientation=frame)
        m.add_bushing("B", m.ground, "b", (1, 2, 3), stiffness=k, damping=c, frame=frame)
        return m

    def damped(x0: float, w2: float, d: float, t: Any) -> Any:
        w = math.sqrt(w2 - d * d)
        return x0 * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t))

    t = np.linspace(0.0, 1.5, 7)
    m = mounted()
    start = m.assemble()
    shift = np.array([0.1, -0.2, 0.3])
    q = start.q.copy()
    q[:3] = frame @ shift
    run = m.simulate(1.5, initial=pt.State(0.0, q, start.v), coordinates="relative", t_eval=t, **TIGHT)
    seen = (run.body("b").position - (1, 2, 3)) @ frame
    exact = np.array([damped(shift[i], k[i] / mass, c[i] / (2 * mass), t) for i in range(3)]).T
    np.testing.assert_allclose(seen, exact, atol=1e-9)
    balanced(run)
    for axis in range(3):
        m = mounted()
        # a rate and no turn: the same equation, shifted
        v = np.zeros(6)
        v[3:] = 2.0 * frame[:, axis]
        start = m.assemble()
        run = m.simulate(1.5, initial=pt.State(0.0, start.q, v), coordinates=coordinates, t_eval=t, **TIGHT)
        w2, d = k[3 + axis] / inertia[axis], c[3 + axis] / (2 * inertia[axis])
        w = math.sqrt(w2 - d * d)
        angle = 2.0 / w * np.exp(-d * t) * np.sin(w * t)
        turn = np.einsum("ij,tjk->tik", frame.T, run.body("b").rotation)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        np.testing.assert_allclose(np.arctan2(turn[:, j, i], turn[:, i, i]), angle, atol=1e-8)
        balanced(run)


def test_a_bushing_with_a_full_matrix_keeps_energy_between_two_bodies_that_tumble() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    m = pt.Mechanism("pair", gravity=(0.3, -9.0, 1.0))
    m.add_body("a", mass=1.0, inertia=(0.3, 0.4, 0.5), com=(0.1, 0, 0))
    m.add_body("b", mass=2.0, inertia=(0.6, 0.4, 0.5), position=(0.5, 0, 0))
    m.add_bushing("B", "a", "b", (0.3, 0.1, 0), stiffness=20 * root @ root.T, damping=np.zeros((6, 6)))
    start = m.assemble()
    run = m.simulate(0.8, initial=pt.State(0.0, start.q, rng.normal(size=12)), **TIGHT)
    balanced(run)
    assert np.max(np.abs(run.energy.work)) == 0.0
    # nothing from outside turns the pair: what one body feels the other feels as well
    states = [run.body(name) for name in "ab"]
    masses, inertias = (1.0, 2.0), (np.diag([0.3, 0.4, 0.5]), np.diag([0.6, 0.4, 0.5]))
    coms = ([0.1, 0, 0], [0, 0, 0])
    centre = velocity = np.zeros(3)
    spins = []
    for s, mass, inertia, com in zip(states, masses, inertias, coms, strict=True):
        x = s.position + s.rotation @ com
        v = s.velocity + np.cross(s.angular_velocity, s.rotation @ com)
        turning = np.einsum("tij,jk,tlk,tl->ti", s.rotation, inertia, s.rotation, s.angular_velocity)
        spins.append((mass, x, v, turning))
        centre, velocity = centre + mass / 3 * x, velocity + mass / 3 * v
    total = sum(mass * np.cross(x - centre, v - velocity) + turning for mass, x, v, turning in spins)
    np.testing.assert_allclose(total, total[0] + 0 * total, atol=1e-8)


# ---------------------------------------------------------------- friction


def test_a_block_slides_to_rest_as_the_smooth_law_says() -> None:
    """With w = 4 v / stick: m v' = -F w / sqrt(1 + w^2), so that t = (m stick / 4F) (g(w0) - g(w)), g the integral of
    sqrt(1 + w^2) / w."""
    mass, force, stick, v0 = 2.0, 5.0, 0.05, 1.5

    def g(w: float) -> float:
        return math.sqrt(1 + w * w) + math.log(w / (1 + math.sqrt(1 + w * w)))

    m = slider(mass=mass)
    m.add_friction("S", force, stick_velocity=stick)
    t = np.array([0.0, 0.2, 0.5, 0.58, 0.62])
    run = m.simulate(0.62, initial=m.assemble(rates={"S": v0}), t_eval=t, **TIGHT)
    for time, v in zip(t, run.joint("S").velocity.ravel(), strict=True):
        assert mass * stick / (4 * force) * (g(4 * v0 / stick) - g(4 * v / stick)) == pytest.approx(time, abs=1e-9)
    balanced(run)
    assert run.energy.work[-1] < 0.0


def test_a_block_comes_to_rest_at_the_time_of_coulomb() -> None:
    """t = m v0 / F, in the limit of a small stick velocity: what is left of the speed there falls with it."""
    left = []
    for stick in (1e-1, 1e-2, 1e-3):
        m = slider()
        m.add_friction("S", 5.0, stick_velocity=stick)
        run = m.simulate(0.6, initial=m.assemble(rates={"S": 1.5}), rtol=1e-8)
        left.append(float(run.joint("S").velocity[-1].item()))
        assert run.joint("S").position[-1] == pytest.approx(1.5**2 * 2 / (2 * 5.0), abs=stick)
    assert left[0] > 5 * left[1] > 25 * left[2] > 0 and left[2] < 1e-3


@pytest.mark.parametrize("cut", ["auto", "always"])
def test_a_load_below_the_static_level_creeps_and_one_above_slides(cut: str) -> None:
    """Steady creep: the root of the law. Above the static level it slides with (load - dynamic) / mass."""
    stick, dynamic, static = 1e-2, 3.0, 5.0

    def law(v: float) -> float:
        u = v / stick
        return dynamic * 4 * u / math.sqrt(1 + 16 * u * u) + (static - dynamic) * u / (0.75 + 0.25 * u * u) ** 2

    def run(load: float) -> Any:
        m = pt.Mechanism("held", gravity=None)
        m.add_body("block", mass=0.5, inertia=(1.0, 1.0, 1.0))
        m.add_prismatic("S", m.ground, "block", axis=(1, 0, 0), cut=cut)
        m.add_prismatic("closing", m.ground, "block", axis=(1, 0, 0), cut="auto")
        m.add_friction("S", dynamic, static=static, stick_velocity=stick)
        m.add_force("block", (load, 0, 0))
        return m.simulate(0.5, initial=m.assemble(), rtol=1e-9)

    held = run(4.0)
    assert held.body("block").velocity[-1, 0] == pytest.approx(brentq(lambda v: law(v) - 4.0, 0, stick), rel=1e-6)
    balanced(held, 1e-9)
    free = run(6.0)
    assert free.body("block").velocity[-1, 0] == pytest.approx((6.0 - 3.0) / 0.5 * 0.5, rel=0.02)


# ---------------------------------------------------------------- stops


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("spatial", [False, True])
def test_a_stop_holds_a_load_at_its_static_deflection(coordinates: str, spatial: bool) -> None:
    """stiffness (angle - end) = moment of the weight; in the plane and with an axis a bit out of it."""
    m = pt.Mechanism("flap", gravity=(0, -G, 0))
    m.add_body("flap", mass=3.0, inertia=(0.1, 0.2, 0.2), com=(0.5, 0, 0))
    axis = (1e-6, 0, 1) if spatial else (0, 0, 1)
    m.add_revolute("A", m.ground, "flap", point=(0, 0, 0), axis=axis)
    if spatial:
        m.add_body("ball", mass=1.0, inertia=(1, 1, 1))
    stiffness, end = 200.0, -0.3
    m.add_stop("A", lower=end, stiffness=stiffness, damping=5.0)
    run = m.simulate(12.0, coordinates=coordinates, rtol=1e-8)
    deep = brentq(lambda d: stiffness * d - 3.0 * G * 0.5 * math.cos(end - d), 0.0, 1.0)
    assert run.joint("A").position[-1] == pytest.approx(end - deep, abs=1e-4)
    balanced(run, 1e-8)
    assert run.energy.work[-1] < 0.0


def test_an_elastic_stop_throws_back_with_all_energy() -> None:
    m = slider()
    m.add_stop("S", lower=-1.0, upper=1.0, stiffness=4e3)
    run = m.simulate(2.0, initial=m.assemble(rates={"S": 3.0}), **TIGHT)
    balanced(run)
    assert np.max(run.joint("S").position) == pytest.approx(1.0 + 3.0 * math.sqrt(2.0 / 4e3), rel=1e-3)
    assert np.all(run.energy.work == 0.0)


@pytest.mark.parametrize("where", ["tree", "loop", "absolute"])
@pytest.mark.parametrize("force", [90.0, -90.0])
def test_a_gas_spring_gives_back_the_work_of_its_polytropic_change(where: str, force: float) -> None:
    """With V(c) = |F| L c^(1-n) / (n - 1), c the column over its length as drawn, m v^2 / 2 is V(1) - V(c); without a
    mass that gives way the effort is F / c^n."""
    m = slider(mass=2.0)
    if where == "loop":
        m.add_body("plate", mass=1e-3, inertia=(1.0, 1.0, 1.0))
        m.add_prismatic("T", m.ground, "plate", axis=(0, 1, 0))
        m.add_joint("R", "plate", "block", free=("x", "y", "rx"))
        m.joints["S"].cut = "always"
    length, exponent = 0.4, 1.35
    m.add_gas_spring("S", force=force, length=length, exponent=exponent)
    coordinates = "absolute" if where == "absolute" else "relative"
    run = m.simulate(0.15, coordinates=coordinates, t_eval=np.linspace(0.0, 0.15, 7), **TIGHT)
    x, v = run.joint("S").position[:, 0], run.joint("S").velocity[:, 0]
    column = 1.0 + math.copysign(1.0, force) * x / length
    energy = abs(force) * length / (exponent - 1.0) * (1.0 - column ** (1.0 - exponent))
    assert column[-1] > 1.5
    assert np.max(np.abs(0.5 * 2.0 * v**2 - energy)) < 1e-8 * energy[-1]
    assert run.joint("S").acceleration[:, 0] * 2.0 == pytest.approx(force / column**exponent, rel=1e-7)
    assert np.all(run.energy.work == 0.0)
    balanced(run)


def test_a_gas_spring_is_never_pressed_to_nothing() -> None:
    """However fast the rod comes in, it is thrown back as fast."""
    m = slider()
    m.add_gas_spring("S", force=5.0, length=0.2, exponent=1.4)
    run = m.simulate(0.2, initial=m.assemble(rates={"S": -8.0}), t_eval=np.linspace(0.0, 0.2, 401), **TIGHT)
    x, v = run.joint("S").position[:, 0], run.joint("S").velocity[:, 0]
    assert -0.2 < np.min(x) < -0.199
    i = np.argmax(x[1:] > 0.0) + 1
    assert i > 1 and v[i] == pytest.approx(8.0, abs=0.02)
    balanced(run)


def test_an_end_beyond_half_a_turn_is_felt_where_the_angle_is_read_off_the_pose() -> None:
    """In absolute coordinates and in space the angle comes out of the pose, up to whole turns: an end is known within
    half a turn of the drawing, and felt as far beyond as it gives way."""
    m = pt.Mechanism("far", gravity=None)
    for name in "bc":
        m.add_body(name, mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, "b", point=(0, 0, 0))
    m.add_stop("A", lower=2.2, stiffness=50.0, exponent=3.0)
    m.add_stop("A", upper=3.1, stiffness=50.0, exponent=3.0)
    times = np.linspace(0.0, 2.0, 9)
    for angle, rate in ((1.4, 0.5), (3.0, 1.5)):
        start = m.assemble(targets={"A": angle}, rates={"A": rate})
        runs = [
            m.simulate(2.0, initial=start, coordinates=c, t_eval=times, rtol=1e-11) for c in ("relative", "absolute")
        ]
        np.testing.assert_allclose(runs[1].body("b").rotation, runs[0].body("b").rotation, atol=1e-9)
        assert np.ptp(runs[0].joint("A").velocity) > 0.1
    assert runs[0].joint("A").position.max() > 3.2
    m.add_stop("A", upper=4.5, stiffness=50.0)
    m.compile()
    with pytest.raises(DescriptionError, match="half a turn"):
        m.compile(coordinates="absolute")


def test_ends_that_cannot_be_distinguished_are_refused() -> None:
    m = pt.Mechanism("turns", gravity=None)
    m.add_body("b", mass=1.0, inertia=(1, 1, 1))
    m.add_body("c", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, "b", point=(0, 0, 0))
    m.add_stop("A", lower=-10.0, upper=10.0, stiffness=1.0)
    m.compile()
    with pytest.raises(DescriptionError, match=r'cut joint "A" .* without full turns'):
        m.compile(coordinates="absolute")


# ---------------------------------------------------------------- contact


def ball(gravity: Any = (0, 0, -G), **law: Any) -> pt.Mechanism:
    m = pt.Mechanism("ball", gravity=gravity)
    m.add_body("ball", mass=0.5, inertia=(2e-4, 2e-4, 2e-4), position=(0, 0, 0.2))
    m.add_contact("floor", "ball", (0, 0, 0), m.ground, (0, 0, 0), radius1=0.05, normal=(0, 0, 2), **law)
    return m


def test_a_sphere_rests_at_the_depth_of_hertz() -> None:
    """N = k d^1.5: d = (m g / k)^(2/3); damped at rest."""
    m = ball(stiffness=1e4, damping=2.0)
    run = m.simulate(6.0, rtol=1e-8)
    assert run.body("ball").position[-1, 2] == pytest.approx(0.05 - (0.5 * G / 1e4) ** (2 / 3), abs=1e-7)
    balanced(run, 1e-8)


def test_an_elastic_sphere_bounces_to_its_height_and_a_damped_one_loses_what_the_law_takes() -> None:
    m = ball(stiffness=1e5)
    run = m.simulate(1.2, **TIGHT)
    balanced(run)
    assert np.max(run.body("ball").position[run.t > 0.3, 2]) == pytest.approx(0.2, abs=1e-5)
    # v dv = -(k/m) d^1.5 (1 + c v) dd: v - ln(1 + c v)/c is the same at the first touch and the last
    c, v0 = 0.3, 1.7
    m = ball(gravity=None, stiffness=1e6, damping=c)
    v = np.zeros(6)
    v[2] = -v0
    run = m.simulate(0.3, initial=pt.State(0.0, m.assemble().q, v), **TIGHT)
    balanced(run)
    out = brentq(lambda u: v0 - math.log1p(c * v0) / c + u + math.log1p(-c * u) / c, 1e-3, v0)
    assert run.body("ball").velocity[-1, 2] == pytest.approx(out, abs=1e-8)
    assert run.energy.work[-1] == pytest.approx(0.25 * (out**2 - v0**2), abs=1e-8)


def test_a_sphere_that_slides_begins_to_roll_at_five_sevenths() -> None:
    """v = 5/7 v0 for a solid sphere, whatever the friction; axes off the world's by a tilt of everything."""
    mass, radius, k = 0.5, 0.05, 1e6
    inertia = 0.4 * mass * radius**2
    m = pt.Mechanism("roll", gravity=(0, 0, -G))
    depth = (mass * G / k) ** (2 / 3)
    m.add_body("ball", mass=mass, inertia=(inertia,) * 3, position=(0, 0, radius - depth))
    floor = {"normal": (0, 0, 1), "stiffness": k, "friction": 0.4, "stick_velocity": 1e-3}
    m.add_contact("floor", "ball", (0, 0, 0), m.ground, (0, 0, 0), radius1=radius, **floor)
    v = np.zeros(6)
    v[0] = 1.0
    run = m.simulate(0.6, initial=pt.State(0.0, m.assemble().q, v), rtol=1e-9)
    # the arm of friction is the radius less the depth: m v + I w / arm stays, v = w arm in the end
    arm = radius - depth
    assert run.body("ball").velocity[-1, 0] == pytest.approx(1 / (1 + inertia / (mass * arm**2)), rel=1e-5)
    balanced(run, 1e-9)


def test_two_spheres_exchange_their_speeds() -> None:
    m = pt.Mechanism("two", gravity=None)
    for name, x in (("a", 0.0), ("b", 0.3)):
        m.add_body(name, mass=0.2, inertia=(1e-4,) * 3, position=(x, 0, 0))
    m.add_contact("hit", "a", (0, 0, 0), "b", (0, 0, 0), radius1=0.05, radius2=0.1, stiffness=1e7)
    v = np.zeros(12)
    v[0] = 2.0
    run = m.simulate(0.2, initial=pt.State(0.0, m.assemble().q, v), **TIGHT)
    assert run.body("a").velocity[-1, 0] == pytest.approx(0.0, abs=1e-8)
    assert run.body("b").velocity[-1, 0] == pytest.approx(2.0, abs=1e-8)
    balanced(run)


# ---------------------------------------------------------------- tyre


def wheel(slope: float, planar: bool, depth: float = 0.0, **law: Any) -> pt.Mechanism:
    """A wheel on a slope down along x, pressed in by `depth`."""
    normal = (math.sin(slope), math.cos(slope), 0)
    m = pt.Mechanism("wheel", gravity=(0, -G, 0))
    m.add_body("w", mass=20.0, inertia=(0.5, 0.5, 0.9), position=(0.3 - depth) * np.array(normal))
    if planar:
        m.add_planar("P", m.ground, "w")
    m.add_tyre("T", "w", center=(0, 0, 0), axis=(0, 0, 1), radius=0.3, normal=normal, **law)
    return m


def test_a_wheel_stands_on_its_static_deflection() -> None:
    m = wheel(0.0, True, stiffness=2e5, damping=20.0)
    run = m.simulate(8.0, rtol=1e-9)
    assert run.body("w").position[-1, 1] == pytest.approx(0.3 - 20 * G / 2e5, abs=1e-7)
    balanced(run, 1e-9)


@pytest.mark.parametrize("planar", [True, False])
def test_a_wheel_rolls_down_with_its_slip(planar: bool) -> None:
    """m v' = m g sin - F, I w' = F r with r the loaded radius; the slip e = (v - w r) / v with F = C e / sqrt(1 +
    (C e / mu N)^2) is constant, so (1 - e) v' = r w'. A small slow speed makes a difference at the start alone."""
    slope, stiff, friction, k = 0.5, 300.0, 0.6, 1e5
    load = 20 * G * math.cos(slope)
    radius, drive = 0.3 - load / k, G * math.sin(slope)
    law = {"stiffness": k, "friction": friction, "longitudinal": stiff, "slow_speed": 1e-3}
    m = wheel(slope, planar, depth=load / k, **law)

    def force(e: float) -> float:
        return stiff * e / math.sqrt(1 + (stiff * e / (friction * load)) ** 2)

    e = brentq(lambda e: (1 - e) * (drive - force(e) / 20) - force(e) * radius**2 / 0.9, 0, 1.0)
    run = m.simulate(1.0, rtol=1e-8, t_eval=[0.0, 0.5, 1.0])
    along = run.body("w").velocity @ (math.cos(slope), -math.sin(slope), 0)
    assert (along[2] - along[1]) / 0.5 == pytest.approx(drive - force(e) / 20, rel=1e-5)
    balanced(run, 1e-8)


# ---------------------------------------------------------------- gravity


def pendulum(gravity: Any, light: bool = False) -> pt.Mechanism:
    m = pt.Mechanism("pendulum", gravity=gravity)
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=2.0, gravity=not light)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
    return m


@pytest.mark.parametrize("make", [lambda: pendulum(None), lambda: pendulum((0, -G, 0), light=True)])
def test_without_gravity_a_pendulum_turns_evenly(make: Callable[[], pt.Mechanism]) -> None:
    m = make()
    for coordinates in ("relative", "absolute"):
        run = m.simulate(2.0, initial=m.assemble(rates={"A": 1.5}), coordinates=coordinates, **TIGHT)
        np.testing.assert_allclose(run.joint("A").velocity.ravel(), 1.5 + 0 * run.t, rtol=1e-9)
        balanced(run)
        # the joint feels the centripetal force alone
        np.testing.assert_allclose(np.linalg.norm(run.joint("A").force, axis=1), 2.0 * 0.5 * 1.5**2, rtol=1e-9)


def test_gravity_that_is_switched_off_leaves_the_speed_it_has_given() -> None:
    m = pendulum(lambda t, state: (0, -G if t < 0.4 else 0.0, 0))
    run = m.simulate(1.0, rtol=1e-9)
    falling = pendulum((0, -G, 0)).simulate(0.4, rtol=1e-10)
    late = run.t > 0.41
    given = float(falling.joint("A").velocity[-1].item())
    np.testing.assert_allclose(run.joint("A").velocity[late].ravel(), given + 0 * run.t[late], rtol=1e-6)
    assert run.energy.work[-1] == pytest.approx(run.energy.kinetic[-1], rel=1e-6)


def test_gravity_that_does_not_change_may_be_given_as_if_it_did() -> None:
    times = np.linspace(0.0, 2.0, 5)
    plain = pendulum((0, -G, 0)).simulate(1.0, t_eval=[0.0, 1.0], **TIGHT)
    tables = [((0.0, 2.0), (-G, -G)), (times, np.tile([0.0, -G, 0.0], (5, 1)))]
    for gravity in ((0, tables[0], 0), tables[1], lambda t, state: (0, -G, 0)):
        m = pendulum(gravity)
        assert m.gravity == (0.0, 0.0, 0.0)
        run = m.simulate(1.0, t_eval=[0.0, 1.0], **TIGHT)
        np.testing.assert_allclose(run.q, plain.q, atol=1e-9)
        np.testing.assert_allclose(run.joint("A").force, plain.joint("A").force, rtol=1e-8)
        np.testing.assert_allclose(run.energy.work[-1], run.energy.kinetic[-1], rtol=1e-8)


# ---------------------------------------------------------------- force law


def linkage(planar: bool) -> pt.Mechanism:
    m = pt.Mechanism("linkage", gravity=(0, -G, 0))
    turn = math.atan2(0.2, 1.0)
    axes = [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
    m.add_body("a", mass=1.0, inertia=(0.02, 0.09, 0.09), com=(0.5, 0, 0), orientation=axes)
    m.add_body("b", mass=2.0, inertia=(0.2, 0.3, 0.3), com=(0.3, 0, 0), position=(1, 0.2, 0))
    m.add_revolute("A", m.ground, "a", point=(0, 0, 0), axis=(0, 0, 1) if planar else (0, 1e-6, 1))
    m.add_revolute("B", "a", "b", point=(1, 0.2, 0), axis=(0, 0, 1) if planar else (0.3, 0, 1))
    return m


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("planar", [True, False])
def test_a_law_that_says_what_a_spring_says_is_that_spring(planar: bool, coordinates: str) -> None:
    k, c, length = 30.0, 0.7, 0.4
    ends = ((0.8, 0.0, 0.1), (0.2, -0.3, 0.1))

    def pull(t: float, p: PointView, r: PointView) -> Any:
        d = r.position - p.position
        n = np.linalg.norm(d)
        f = (k * (n - length) + c * d @ (r.velocity - p.velocity) / n) / n * d
        return f, -f

    m, law = linkage(planar), linkage(planar)
    m.add_spring("S", "a", ends[0], "b", ends[1], stiffness=k, damping=c, length=length)
    law.add_force_law("S", pull, sees=[("a", ends[0]), ("b", ends[1])], on=[("a", ends[0]), ("b", ends[1])])
    x, y = m.compile(coordinates=coordinates), law.compile(coordinates=coordinates)
    rng = np.random.default_rng(1)
    v = rng.normal(size=len(x.velocity_names))
    q = m.assemble(coordinates=coordinates).q if coordinates == "absolute" else rng.normal(size=len(x.names))
    np.testing.assert_allclose(y.forces(q, v), x.forces(q, v), rtol=1e-12, atol=1e-12)
    start = m.assemble(rates={"A": 1.0, "B": -2.0})
    spring = m.simulate(0.5, initial=start, coordinates=coordinates, t_eval=[0.0, 0.5], rtol=1e-9)
    other = law.simulate(0.5, initial=start, coordinates=coordinates, t_eval=[0.0, 0.5], rtol=1e-9)
    np.testing.assert_allclose(other.q, spring.q, atol=1e-9)
    np.testing.assert_allclose(other.joint("B").force, spring.joint("B").force, rtol=1e-7, atol=1e-7)
    total = spring.energy.total - spring.energy.work
    gained = other.energy.total - other.energy.work
    np.testing.assert_allclose(gained - gained[0], total - total[0], atol=1e-7)


def test_a_law_sees_bodies_and_joints_and_gives_moments() -> None:
    """A rotary spring between the bodies, once by the joint and once by their axes."""
    seen: list[Any] = []

    def by_joint(t: float, joint: JointView, a: BodyView) -> Any:
        seen.append((joint, a))
        moment = -4.0 * joint.position - 0.3 * joint.rate
        return [((0, 0, 0), (0, 0, moment)), ((0, 0, 0), (0, 0, -moment))]

    m, law = linkage(True), linkage(True)
    m.add_torsion_spring("B", stiffness=4.0, damping=0.3)
    law.add_force_law("twist", by_joint, sees=["B", "a"], on=["b", "a"])
    q, v = [0.3, -0.8], [1.0, 2.0]
    np.testing.assert_allclose(law.compile().forces(q, v), m.compile().forces(q, v), rtol=1e-12)
    joint, a = seen[-1]
    assert (joint.position, joint.rate) == (-0.8, 2.0)
    np.testing.assert_allclose(a.angular_velocity, (0, 0, 1.0))
    drawn = math.atan2(0.2, 1.0)
    np.testing.assert_allclose(a.rotation[:, 0], (math.cos(0.3 + drawn), math.sin(0.3 + drawn), 0), atol=1e-15)


def bad_law(function: Any = lambda t: (0, 0, 0), **given: Any) -> Callable[[pt.Mechanism], Any]:
    return lambda m: m.add_force_law("L", function, **{"on": ["a"], **given})


@pytest.mark.parametrize(
    ("add", "words"),
    [
        (lambda m: m.add_bushing("B", "a", "a", (0, 0, 0), stiffness=(1,) * 6), "two different bodies"),
        (lambda m: m.add_bushing("B", "a", "b", (0, 0, 0), stiffness=(1,) * 5), "six numbers or a 6x6"),
        (lambda m: m.add_friction("A", 1.0, stick_velocity=0.0), "greater than 0"),
        (lambda m: m.add_friction("A", -1.0, stick_velocity=1.0), "at least 0"),
        (lambda m: m.add_stop("A", stiffness=1.0), "neither a lower nor an upper"),
        (lambda m: m.add_stop("A", lower=1.0, upper=0.0, stiffness=1.0), "not below"),
        (lambda m: m.add_stop("A", lower=1.0, stiffness=1.0, exponent=0.5), "at least 1"),
        (lambda m: m.add_gas_spring("A", force=1.0, length=0.0), "greater than 0"),
        (lambda m: m.add_gas_spring("A", force=1.0, length=1.0, exponent=1.0), "greater than 1"),
        (lambda m: m.add_gas_spring("A", force=0.0, length=1.0), "never acts"),
        (lambda m: m.add_contact("C", "a", (0, 0, 0), "b", (0, 0, 0), radius1=1.0, stiffness=1.0), "one of the two"),
        (
            lambda m: m.add_contact(
                "C", "a", (0, 0, 0), "b", (0, 0, 0), radius1=1.0, radius2=1.0, stiffness=1.0, friction=0.1
            ),
            "stick_velocity",
        ),
        (
            lambda m: m.add_tyre("T", "a", center=(0, 0, 0), axis=(0, 0, 0), radius=1, normal=(0, 1, 0), stiffness=1),
            "no direction",
        ),
        (bad_law(on=[]), "acts on nothing"),
        (bad_law(on=["ground"]), "does not move"),
        (bad_law(function=3), "must be a function"),
    ],
)
def test_what_cannot_be_is_refused(add: Callable[[pt.Mechanism], Any], words: str) -> None:
    m = linkage(True)
    with pytest.raises(DescriptionError) as caught:
        add(m)
    assert words in str(caught.value)
    assert not m.forces


def test_what_a_law_asks_for_must_exist_and_what_it_returns_must_be_wrenches() -> None:
    with pytest.raises(UnknownNameError, match='no body or joint "C"'):
        bad_law(sees=["C"])(linkage(True))
    for answer, words in (((1, 2), "three numbers"), ((math.nan, 0, 0), "nan"), (None, "three numbers")):
        m = linkage(True)
        m.add_force_law("L", lambda t, x=answer: x, on=["a"])
        with pytest.raises(EvaluationError, match=words):
            m.compile().forces([0.0, 0.0], [0.0, 0.0])


# ---------------------------------------------------------------- all together


def everything(scale: float = 1.0) -> pt.Mechanism:
    """All forces on one chain that moves out of every plane; lengths times `scale`, masses and times as they are.

    Smooth where they first touch, so that runs agree within their tolerance and not within that of a corner.
    """
    m = pt.Mechanism("everything", gravity=np.array([0.5, -G, 1.0]) * scale)
    s = scale
    m.add_body("a", mass=1.0, inertia=np.array([0.1, 0.2, 0.2]) * s**2, com=(0.5 * s, 0, 0))
    m.add_body("b", mass=2.0, inertia=np.array([0.2, 0.3, 0.3]) * s**2, com=(0.3 * s, 0, 0), position=(s, 0, 0))
    m.add_cylindrical("A", m.ground, "a", point=(0, 0, 0), axis=(0, 0.2, 1))
    m.add_universal("B", "a", "b", point=(s, 0, 0), axis1=(0, 0, 1), axis2=(0, 1, 0))
    k = np.diag([20.0, 20, 20, 3 * s**2, 3 * s**2, 3 * s**2])
    m.add_bushing("bushing", m.ground, "b", (1.2 * s, 0, 0), stiffness=k, damping=0.02 * k)
    m.add_friction("B", 0.4 * s**2, static=0.6 * s**2, stick_velocity=0.5, coordinate=1)
    m.add_friction("A", 0.4 * s, stick_velocity=0.5 * s, coordinate=0)
    m.add_stop("A", lower=-0.2 * s, upper=0.1 * s, stiffness=3e4 / s**2, damping=0.5 / s, exponent=3.0)
    m.add_stop("B", lower=-0.3, upper=0.3, stiffness=100.0 * s**2, exponent=3.0)
    rough = {"friction": 0.3, "static_friction": 0.4, "stick_velocity": 0.5 * s}
    floor = {"normal": (0, 1, 0), "stiffness": 1e3 / s**2, "exponent": 3.0, "damping": 0.3 / s}
    m.add_contact("floor", "b", (0.6 * s, 0, 0), m.ground, (0, -0.6 * s, 0), radius1=0.5 * s, **floor, **rough)
    m.add_tyre(
        "tyre", "a", center=(0.5 * s, 0, 0), axis=(0, 0, 1), radius=0.6 * s, normal=(0, 1, 0.1), point=(0, -0.2 * s, 0),
        stiffness=100.0, damping=0.1 / s, friction=0.5, longitudinal=5.0 * s, lateral=4.0 * s, slow_speed=0.3 * s,
    )  # fmt: skip
    m.add_force_law(
        "drag", lambda t, b: (-0.1 * b.velocity, -0.05 * s**2 * b.angular_velocity), sees=["b"], on=[("b", (0, 0, 0))]
    )
    return m


def test_all_forces_at_once_in_relative_and_absolute_coordinates() -> None:
    m = everything()
    start = m.assemble(rates={"A": (0.4, 1.0), "B": (0.5, -0.7)})
    runs = [
        m.simulate(0.6, initial=start, coordinates=c, t_eval=[0.0, 0.3, 0.6], rtol=1e-11)
        for c in ("relative", "absolute")
    ]
    for x, y in zip(*[(r.body("b").position, r.joint("B").velocity, r.energy.work) for r in runs], strict=True):
        np.testing.assert_allclose(x, y, atol=1e-9)
    # reactions at both coordinates are the same wrenches
    np.testing.assert_allclose(runs[0].joint("B").force, runs[1].joint("B").force, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(runs[0].joint("A").moment, runs[1].joint("A").moment, rtol=1e-7, atol=1e-7)
    for run in runs:
        balanced(run, 1e-11)


@pytest.mark.parametrize("scale", [1e3, 1e-6])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    """Kilometres and micrometres: the same motion, times the scale."""
    m, other = everything(), everything(scale)
    v = np.array([0.4, 1.0, 0.5, -0.7])
    q = m.assemble().q
    short = {"t_eval": [0.0, 0.2], "rtol": 1e-10}
    run = m.simulate(0.2, initial=pt.State(0.0, q, v), **short)
    there = other.simulate(0.2, initial=pt.State(0.0, q, v * (scale, 1, 1, 1)), atol=1e-13, **short)
    assert there.success, there.message
    np.testing.assert_allclose(there.body("b").position / scale, run.body("b").position, atol=1e-8)


def test_parameters_of_the_new_forces_are_those_of_a_new_mechanism() -> None:
    model = everything().compile()
    q, v = np.array([-0.25, 0.2, 0.4, 0.1]), np.ones(4)
    changes: dict[str, Any] = {}
    for name, value in model.parameters.items():
        if name.split(".")[0] in ("bushing", "floor", "tyre", "stop of A", "stop of B", "friction in B"):
            changes[name] = np.asarray(value) * 1.1
    assert len(changes) > 25
    moved = model.with_parameters(changes)
    assert not np.allclose(moved.forces(q, v), model.forces(q, v))
    back = moved.with_parameters({name: model.parameters[name] for name in changes})
    np.testing.assert_allclose(back.forces(q, v), model.forces(q, v), rtol=1e-14)
    assert moved.parameters["floor.stiffness"] == pytest.approx(1100.0)


def test_hertz_integrals_agree_with_quadrature() -> None:
    """The stored energy k d^2.5 / 2.5 is the work of k d^1.5."""
    m = ball(stiffness=1e4)
    model = m.compile()
    q = m.assemble().q
    q[2] = -0.16  # the centre at 0.04, one centimetre deep
    work = quad(lambda d: 1e4 * d**1.5, 0.0, 0.01)[0]
    run = m.simulate(1e-9, initial=pt.State(0.0, q, np.zeros(6)), t_eval=[0.0])
    assert run.energy.potential[0] == pytest.approx(work + 0.5 * G * 0.04, rel=1e-9)
    assert model.forces(q, np.zeros(6))[2] == pytest.approx(1e4 * 0.01**1.5 - 0.5 * G, rel=1e-12)


def test_all_forces_but_laws_are_written_to_a_file_and_read_again(tmp_path: Path) -> None:
    m = everything()
    with pytest.raises(DescriptionError, match="Python function"):
        m.save(tmp_path / "law.toml")
    times = ((0.0, 1.0), (-G, -1.0))
    rest = pt.Mechanism("rest", gravity=(0.5, times, 1.0))
    rest._description.bodies.update(m._description.bodies)
    rest._description.joints.update(m._description.joints)
    rest._description.forces.update({k: v for k, v in m._description.forces.items() if k != "drag"})
    rest.add_rod("light", start=(0, 0, 1), end=(1, 0, 1), mass=1.0, gravity=False)
    rest.add_body("still", mass=1.0, inertia=(1, 1, 1), gravity=False)
    rest.add_friction("A", ((0.0, 2.0), (1.0, 2.0)), stick_velocity=0.1, coordinate=1)
    rest.add_contact("balls", "light", (0, 0, 0), "still", (0, 0, 0), radius1=0.1, radius2=0.2, stiffness=5.0)
    rest.save(tmp_path / "rest.toml")
    again = pt.load(tmp_path / "rest.toml")
    for x, y in zip(rest.to_spec()["forces"], again.to_spec()["forces"], strict=True):
        assert x.keys() == y.keys()
        for key in x:
            if isinstance(x[key], list) and key in ("frame1", "frame2", "point1", "point2", "normal", "axis"):
                np.testing.assert_allclose(y[key], x[key], atol=1e-15)
            else:
                assert y[key] == x[key], key


def test_a_bushing_turned_too_far_says_so() -> None:
    m = pt.Mechanism("twisted", gravity=(0, 0, 0))
    wheel = m.add_body("wheel", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0))
    m.add_bushing("mount", m.ground, wheel, (0, 0, 0), stiffness=(1, 1, 1, 1, 1, 1))
    m.add_drive("A", velocity=2.0)
    run = m.simulate(4.0)
    assert not run.success and "mount" in run.message and "half a turn" in run.message
