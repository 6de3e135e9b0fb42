"""Bushings, friction, stops and gas springs, each against a closed form."""

import math
from typing import Any

import numpy as np
import pytest
from force_mechanisms import TIGHT, G, balanced, slider
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import partita as pt
from partita.errors import DescriptionError

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


def test_a_bushing_takes_the_energy_of_the_rates_of_its_rotation_vector() -> None:
    """Turned far about one axis and spun about another: the rates are those of the rotation vectors."""
    damping = np.array([0.3, 0.7, 0.5])
    m = pt.Mechanism("damped", gravity=(0, 0, 0))
    m.add_body("b", mass=1.0, inertia=(0.4, 0.5, 0.6))
    m.add_bushing("B", m.ground, "b", (0, 0, 0), stiffness=(1, 1, 1, 2, 2, 2), damping=(0, 0, 0, *damping))
    start = m.assemble()
    q = start.q.copy()
    q[np.abs(q).argmax() :][:4] = [np.cos(0.7), np.sin(0.7), 0.0, 0.0]
    run = m.simulate(1.0, initial=pt.State(0.0, q, [0, 0, 0, 0.2, 1.0, -2.0]), t_eval=np.linspace(0, 1, 401), **TIGHT)
    turned = Rotation.from_matrix(run.body("b").rotation).as_rotvec()
    assert np.linalg.norm(turned[0]) > 1.3
    rates = CubicSpline(run.t, turned).derivative()(run.t)
    taken = CubicSpline(run.t, np.sum(damping * rates**2, axis=1)).antiderivative()(1.0)
    energy = run.energy.total
    assert energy[0] - energy[-1] > 0.5
    np.testing.assert_allclose(energy[0] - energy[-1], taken, rtol=1e-6)


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
    """The rod rebounds with its speed, however fast it comes in."""
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


def test_a_bushing_turned_too_far_says_so() -> None:
    m = pt.Mechanism("twisted", gravity=(0, 0, 0))
    wheel = m.add_body("wheel", mass=1.0, inertia=(1, 1, 1))
    m.add_revolute("A", m.ground, wheel, point=(0, 0, 0))
    m.add_bushing("mount", m.ground, wheel, (0, 0, 0), stiffness=(1, 1, 1, 1, 1, 1))
    m.add_drive("A", velocity=2.0)
    run = m.simulate(4.0)
    assert not run.success and "mount" in run.message and "half a turn" in run.message
