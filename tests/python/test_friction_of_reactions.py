"""Friction whose level follows the reaction of its own joint: closed forms, independent integrations, equivalence."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import partita as pt
from partita.errors import DescriptionError, EvaluationError, OpenReactionError

G = 9.81
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13}


def smooth(rate: float, stick: float) -> float:
    """The law of `add_friction` for one level of 1."""
    u = rate / stick
    return 4.0 * u / math.sqrt(1.0 + 16.0 * u * u)


def balanced(run: Any, tolerance: float = 1e-9) -> None:
    energy = run.energy
    size = np.max(np.abs(energy.kinetic)) + np.max(np.abs(energy.potential))
    drift = energy.total - energy.work - (energy.total[0] - energy.work[0])
    assert run.success, run.message
    assert energy.work[-1] < -1e-4 * size  # there is something to account for
    assert np.max(np.abs(drift)) < tolerance * size, np.max(np.abs(drift)) / size


# ---------------------------------------------------------------- slides in closed form


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_block_on_an_incline_under_a_tilted_load(coordinates: str) -> None:
    """m a = m g sin - mu |m g cos - P_n| + P_t for a load P; out of any plane that the world's axes span."""
    mass, mu, angle, v0, stick = 2.0, 0.3, 0.5, 1.0, 1e-3
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    along, normal, side = turn
    load = 3.0 * along + 4.0 * normal - 7.0 * side
    m = pt.Mechanism("incline", gravity=G * (math.sin(angle) * along - math.cos(angle) * normal))
    block = m.add_body("block", mass=mass, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("S", m.ground, block, axis=along)
    m.add_force(block, load, (0, 0, 0))
    m.add_friction("S", coefficient=mu, stick_velocity=stick)
    run = m.simulate(1.0, initial=m.assemble(rates={"S": v0}), coordinates=coordinates, **TIGHT)
    across = math.hypot(4.0 - mass * G * math.cos(angle), 7.0)
    a = (mass * G * math.sin(angle) + 3.0 - mu * across) / mass
    # the smooth law is 1 but for (stick/4v)^2/2
    assert run.joint("S").velocity[-1, 0] == pytest.approx(v0 + a, abs=mu * across / mass * (stick / 4.0) ** 2)
    assert np.linalg.norm(run.joint("S").force[-1]) == pytest.approx(across, rel=1e-12)
    balanced(run)


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_slide_whose_mass_is_beside_it_is_pressed_by_its_own_braking(share: float, coordinates: str) -> None:
    """|a| (m - 2 mu m e / L) = mu P for the preload P: the friction acts back on what presses it."""
    mass, mu, length, preload, v0 = 2.0, 0.3, 0.2, 5.0, 3.0
    e = share * length / (2.0 * mu)
    m = pt.Mechanism("drawer", gravity=None)
    block = m.add_body("block", mass=mass, inertia=(1.0, 1.0, 1.0), com=(0.0, 0.6 * e, 0.8 * e))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    m.add_friction("S", coefficient=mu, length=length, preload=preload, stick_velocity=1e-4)
    a = -mu * preload / mass / (1.0 - share)
    t = 0.5 * v0 / abs(a)
    run = m.simulate(t, initial=m.assemble(rates={"S": v0}), coordinates=coordinates, **TIGHT)
    assert run.joint("S").velocity[-1, 0] == pytest.approx(0.5 * v0, rel=1e-8)
    balanced(run)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_slide_that_presses_itself_more_than_it_brakes_is_reported(direction: float) -> None:
    """2 mu e / L = 1.2 (Painleve): the run ends with the joint and the coefficient, and no motion is made up."""
    m = pt.Mechanism("drawer", gravity=None)
    block = m.add_body("block", mass=2.0, inertia=(1.0, 1.0, 1.0), com=(0.0, 0.4, 0.0))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    m.add_friction("S", coefficient=0.3, length=0.2, preload=5.0, stick_velocity=1e-4)
    with pytest.raises(EvaluationError) as caught:
        m.simulate(1.0, initial=m.assemble(rates={"S": direction}))
    assert caught.value.where == "friction in S"
    for words in ('joint "S" jams', "coefficient 0.3", "a further 1.200 N", "Painleve"):
        assert words in str(caught.value)


def test_a_slide_pushed_too_far_from_its_axis_holds() -> None:
    """Pushed from rest it creeps up to the speed where the friction is all of the push."""
    m = pt.Mechanism("drawer", gravity=None)
    block = m.add_body("block", mass=2.0, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("S", m.ground, block, axis=(1, 0, 0))
    length, arm, stick = 0.2, 0.4, 1e-3
    m.add_force(block, (7.0, 0.0, 0.0), (0.0, arm, 0.0))
    m.add_friction("S", coefficient=0.3, length=length, stick_velocity=stick)
    run = m.simulate(2.0)
    # 2 mu arm / length = 1.2: it holds at the speed where the law gives 1/1.2 of the coefficient
    speed = brentq(lambda v: smooth(v, stick) - 1.0 / 1.2, 0.0, stick)
    assert run.joint("S").velocity[-1, 0] == pytest.approx(speed, rel=1e-6)


def test_a_slide_that_comes_to_jam_on_its_way_ends_there_by_its_joint() -> None:
    """The mass is driven away from the slide until 2 mu e / L is 1 over its share: the braking grows without bounds."""
    m = pt.Mechanism("drawer", gravity=None)
    m.add_body("block", mass=0.1, inertia=(1e-3, 1e-3, 1e-3))
    m.add_body("mass", mass=2.0, inertia=(1e-3, 1e-3, 1e-3))
    m.add_prismatic("S", m.ground, "block", axis=(1, 0, 0))
    m.add_prismatic("T", "block", "mass", axis=(0, 1, 0))
    m.add_drive("T", ((0.0, 2.0), (0.0, 0.6)))
    m.add_friction("S", coefficient=0.3, length=0.2, preload=0.5, stick_velocity=1e-3)
    run = m.simulate(2.0, initial=m.assemble(rates={"S": 300.0}))
    assert run.status == "evaluation-failed"
    assert 'joint "S" jams' in run.message and "Painleve" in run.message
    # 0.3 t = e with 2 mu e / L = 2.1 / 2
    assert float(run.message.split("stopped at t = ")[1].split(" s")[0]) == pytest.approx(0.35 / 0.3, abs=1e-6)


@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_a_wedge_locks_itself_where_the_angle_is_below_that_of_friction(mu: float) -> None:
    """A load on a wedge of angle alpha on a rough floor drives it out if tan alpha > 2 mu / (1 - mu^2)."""
    alpha, wedge, load = 0.5, 1.0, 3.0
    m = pt.Mechanism("wedge", gravity=(0.0, -G, 0.0))
    m.add_body("wedge", mass=wedge, inertia=(1.0, 1.0, 1.0))
    m.add_body("load", mass=load, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("floor", m.ground, "wedge", axis=(1, 0, 0))
    m.add_prismatic("face", "wedge", "load", axis=(math.cos(alpha), -math.sin(alpha), 0.0))
    m.add_prismatic("guide", m.ground, "load", axis=(0, 1, 0))
    stick = 1e-3
    for joint in ("floor", "face"):
        m.add_friction(joint, coefficient=mu, stick_velocity=stick)
    run = m.simulate(0.5)
    assert run.success
    speed = abs(run.joint("floor").velocity[-1, 0])
    if mu > 0.3:
        assert 0.0 < speed < stick
        return
    # the guide's force has no friction: floor N0 = (M + m g - m a_y ...): three equations in a, F (face) and N0
    s, c = math.sin(alpha), math.cos(alpha)
    # wedge goes by a along -x, load down by a tan: face presses F across, mu F along
    matrix = np.array(
        [
            [wedge, -(s - mu * c), mu],  # wedge along its way: F s - mu F c - mu N0
            [0.0, c + mu * s, -1.0],  # wedge upright: N0 = w + F c + mu F s
            [load * math.tan(alpha), c + mu * s, 0.0],  # load: m g - F c - mu F s
        ]
    )
    a = np.linalg.solve(matrix, [0.0, -wedge * G, load * G])[0]
    assert speed == pytest.approx(a * 0.5, rel=5e-3)  # the first steps creep below the stick velocity


# ---------------------------------------------------------------- turns against an independent integration


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_pendulum_in_a_plain_bearing_decays_as_an_independent_integration_says(coordinates: str) -> None:
    mass, length, mu, radius, stick = 3.0, 1.2, 0.25, 0.06, 0.2
    i = mass * length**2 / 3.0
    arm = 0.5 * length

    def acceleration(angle: float, rate: float) -> float:
        """The one root of the balance of moments, in which the bearing force is that of the same acceleration."""

        def open_(a: float) -> float:
            # along the rod and across it
            along = mass * arm * rate**2 + mass * G * math.cos(angle)
            across = mass * arm * a + mass * G * math.sin(angle)
            normal = math.hypot(along, across)
            return i * a + mass * G * arm * math.sin(angle) + mu * radius * normal * smooth(rate, stick)

        return brentq(open_, -200.0, 200.0, xtol=1e-14, rtol=1e-15)

    m = pt.Mechanism("pendulum", gravity=(0.0, -G, 0.0))
    rod = m.add_rod("rod", start=(0, 0, 0), end=(0, -length, 0), mass=mass)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_friction("A", coefficient=mu, radius=radius, stick_velocity=stick)
    start = m.assemble({"A": 1.0}, rates={"A": 0.5}, coordinates=coordinates)
    run = m.simulate(3.0, initial=start, coordinates=coordinates, **TIGHT)
    truth = solve_ivp(
        lambda t, y: (y[1], acceleration(*y)), (0.0, 3.0), (1.0, 0.5), method="DOP853", rtol=1e-11, atol=1e-12
    )
    assert run.joint("A").position[-1, 0] == pytest.approx(truth.y[0, -1], abs=1e-8)
    assert run.joint("A").velocity[-1, 0] == pytest.approx(truth.y[1, -1], abs=1e-8)
    balanced(run)


def slider_crank(scale: float = 1.0, mu: float = 0.3) -> pt.Mechanism:
    """A crank of 0.3, a rod of 0.8, a piston with its pin beside its axis; lengths times `scale`."""
    s = scale
    m = pt.Mechanism("slider crank", gravity=(0.0, -G * s, 0.0))
    m.add_rod("crank", start=(0, 0, 0), end=(0.3 * s, 0, 0), mass=1.0)
    m.add_rod("rod", start=(0.3 * s, 0, 0), end=(1.1 * s, 0, 0), mass=0.6)
    m.add_body("piston", mass=0.8, inertia=(0.01 * s**2,) * 3, position=(1.1 * s, -0.02 * s, 0))
    m.add_revolute("A", m.ground, "crank", point=(0, 0, 0))
    m.add_revolute("B", "crank", "rod", point=(0.3 * s, 0, 0))
    m.add_revolute("C", "rod", "piston", point=(1.1 * s, 0, 0))
    m.add_prismatic("S", m.ground, "piston", axis=(1, 0, 0), point=(1.1 * s, -0.02 * s, 0))
    m.add_force("piston", (-6.0 * s, 0.0, 0.0), (0.0, 0.02 * s, 0.0))
    m.add_friction(
        "S", coefficient=mu, static_coefficient=1.5 * mu, length=0.1 * s, preload=2.0 * s, stick_velocity=0.1 * s
    )
    return m


def test_a_slider_crank_agrees_with_an_independent_program_in_maximal_coordinates() -> None:
    """Nine coordinates, eight multipliers with the friction in the law; its steps are another program's."""
    mu, length, preload, stick = 0.3, 0.1, 2.0, 0.1
    mass = np.array([1.0, 1.0, 0.09 / 12.0, 0.6, 0.6, 0.6 * 0.64 / 12.0, 0.8, 0.8, 0.01])

    def side(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C and b of: crank on ground, crank on rod, rod on piston, piston upright and level."""
        q, v = y[:9], y[9:]

        def point(body: int, at: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
            c, s = math.cos(q[3 * body + 2]), math.sin(q[3 * body + 2])
            r = np.array([c * at[0] - s * at[1], s * at[0] + c * at[1]])
            rows = np.zeros((2, 9))
            rows[:, 3 * body : 3 * body + 2] = np.eye(2)
            rows[:, 3 * body + 2] = (-r[1], r[0])
            return rows, -r * v[3 * body + 2] ** 2

        pins = [((0, (-0.15, 0)), None), ((1, (-0.4, 0)), (0, (0.15, 0))), ((2, (0, 0.02)), (1, (0.4, 0)))]
        rows, bias = [], []
        for child, parent in pins:
            j, b = point(*child)
            if parent is not None:
                other, less = point(*parent)
                j, b = j - other, b - less
            rows.append(j)
            bias.append(b)
        guide = np.zeros((2, 9))
        guide[0, 7] = guide[1, 8] = 1.0
        return np.vstack([*rows, guide]), np.concatenate([*bias, [0.0, 0.0]])

    def rates(_t: float, y: np.ndarray) -> np.ndarray:
        v = y[9:]
        jacobian, b = side(y)
        h = np.zeros(9)
        h[1::3] = -G * mass[1::3]
        h[6] -= 6.0
        h[8] += 6.0 * 0.02  # the force acts at the pin
        u = v[6] / stick
        coefficient = mu * (smooth(v[6], stick) + 0.5 * u / (0.75 + 0.25 * u * u) ** 2)
        matrix = np.block([[np.diag(mass), -jacobian.T], [jacobian, np.zeros((8, 8))]])
        inverse = np.linalg.inv(matrix)
        unit = np.zeros(17)
        unit[6] = 1.0
        without, one = inverse @ np.concatenate([h, -b]), inverse @ unit

        def open_(friction: float) -> float:
            force, moment = (without + friction * one)[-2:]
            normal = preload + abs(force / 2 + moment / length) + abs(force / 2 - moment / length)
            return friction + coefficient * normal

        x = without + brentq(open_, -1e4, 1e4, xtol=1e-13, rtol=1e-14) * one
        return np.concatenate([v, x[:9]])

    m = slider_crank(mu=mu)
    start = m.assemble({"A": 0.7}, rates={"A": 8.0})
    run = m.simulate(0.5, initial=start, **TIGHT)
    a, rate = 0.7, 8.0
    rod = -math.asin(0.3 * math.sin(a) / 0.8)
    turn = -0.3 * math.cos(a) * rate / (0.8 * math.cos(rod))
    x = 0.3 * math.cos(a) + 0.8 * math.cos(rod)
    slide = -0.3 * math.sin(a) * rate - 0.8 * math.sin(rod) * turn
    half = np.array([0.4 * math.cos(rod), 0.4 * math.sin(rod)])
    q = [0.15 * math.cos(a), 0.15 * math.sin(a), a, x - half[0], -half[1], rod, x, -0.02, 0.0]
    v = [-0.15 * math.sin(a) * rate, 0.15 * math.cos(a) * rate, rate]
    v += [slide + half[1] * turn, -half[0] * turn, turn, slide, 0.0, 0.0]
    # drifting coordinates: half a second at this tolerance opens nothing that counts
    truth = solve_ivp(rates, (0.0, 0.5), [*q, *v], method="DOP853", rtol=1e-10, atol=1e-11)
    assert run.joint("A").position[-1, 0] == pytest.approx(truth.y[2, -1], abs=3e-7)
    assert run.joint("S").velocity[-1, 0] == pytest.approx(truth.y[15, -1], abs=3e-7)
    balanced(run)


# ---------------------------------------------------------------- all formulations, coordinates, cuts


def four_bar(cut: str | None = None, mu: float = 0.3) -> pt.Mechanism:
    m = pt.Mechanism("four bar", gravity=(0.0, -G, 0.0))
    at = {"A": (0, 0, 0), "B": (0, 1, 0), "C": (2.5, 2, 0), "D": (3, 0, 0)}
    m.add_rod("a", start=at["A"], end=at["B"], mass=1.0)
    m.add_rod("b", start=at["B"], end=at["C"], mass=2.0)
    m.add_rod("c", start=at["D"], end=at["C"], mass=1.5)
    for joint, (one, two) in {"A": ("ground", "a"), "B": ("a", "b"), "C": ("b", "c"), "D": ("ground", "c")}.items():
        how = "auto" if cut is None else ("always" if joint == cut else "never")
        m.add_revolute(joint, one, two, point=at[joint], cut=how)
        m.add_friction(joint, coefficient=mu, radius=0.05, stick_velocity=0.05, static_coefficient=1.2 * mu)
    return m


def test_a_four_bar_with_friction_in_all_hinges_is_the_same_in_all_formulations_and_coordinates() -> None:
    runs = {"reference": four_bar().simulate(1.0, **TIGHT)}
    balanced(runs["reference"])
    for name in ("multipliers", "explicit-closing", "tangent-space", "wehage-haug", "sparse-multipliers"):
        runs[name] = four_bar().simulate(1.0, solver=pt.Solver(name), **TIGHT)
    runs["absolute"] = four_bar().simulate(1.0, coordinates="absolute", **TIGHT)
    runs["absolute, sparse"] = four_bar().simulate(
        1.0, coordinates="absolute", solver=pt.Solver("sparse-multipliers"), **TIGHT
    )
    for cut in "ABCD":
        runs[f"cut {cut}"] = four_bar(cut).simulate(1.0, **TIGHT)
    for name, run in runs.items():
        assert run.success, name
        for joint in "ABCD":
            mine, other = run.joint(joint), runs["reference"].joint(joint)
            np.testing.assert_allclose(mine.position, other.position, atol=1e-9, err_msg=name)
            np.testing.assert_allclose(mine.force, other.force, atol=1e-6, err_msg=name)
    # and the friction is that of the reaction the run reports
    run = runs["cut C"]
    power = sum(
        -0.05
        * np.linalg.norm(run.joint(j).force, axis=1)
        * np.array([level(v) * v for v in run.joint(j).velocity[:, 0]])
        for j in "ABCD"
    )
    np.testing.assert_allclose(
        np.gradient(run.energy.work, run.t, edge_order=2)[5:-5], power[5:-5], rtol=2e-2, atol=0.01
    )


def level(rate: float) -> float:
    u = rate / 0.05
    return 0.3 * (smooth(rate, 0.05) + 0.2 * u / (0.75 + 0.25 * u * u) ** 2)


def test_another_method_a_restart_and_a_second_call_give_the_same() -> None:
    m = four_bar()
    whole = m.simulate(1.0, **TIGHT)
    again = m.simulate(1.0, **TIGHT)
    assert np.array_equal(whole.joint("A").position, again.joint("A").position)
    half = m.simulate(0.5, **TIGHT)
    near = m.assemble()
    for share in (0.5, 1.0):  # along the branch
        near = m.assemble({"A": share * half.joint("A").position[-1, 0]}, near=near)
    start = m.assemble({"A": near.q[0]}, rates={"A": half.joint("A").velocity[-1, 0]}, near=near)
    rest = m.simulate(0.5, initial=start, **TIGHT)
    other = m.simulate(1.0, method="tsit5", rtol=1e-10, atol=1e-12)
    for run in (rest, other):
        assert run.joint("A").position[-1, 0] == pytest.approx(whole.joint("A").position[-1, 0], abs=1e-8)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_of_length_are_no_matter(scale: float) -> None:
    """Micrometres for millimetres or kilometres for metres: lengths times `scale`, forces with them."""
    small, large = slider_crank(), slider_crank(scale)
    runs = [x.simulate(0.4, initial=x.assemble({"A": 0.7}, rates={"A": 8.0}), rtol=1e-10) for x in (small, large)]
    a, b = (run.joint("A").position[-1, 0] for run in runs)
    assert b == pytest.approx(a, abs=1e-8)
    forces = [run.joint("S").force[-1] for run in runs]
    np.testing.assert_allclose(forces[1], forces[0] * scale, rtol=1e-6, atol=1e-6 * scale)


def test_a_driven_mechanism_has_the_efforts_of_its_friction() -> None:
    """A block driven along a rail: no degree of freedom is left, and the drive takes what the friction takes."""
    m = pt.Mechanism("driven", gravity=(0.0, 0.0, -G))
    m.add_body("block", mass=2.0, inertia=(1.0, 1.0, 1.0))
    m.add_prismatic("S", m.ground, "block", axis=(1, 0, 0))
    m.add_friction("S", coefficient=0.25, stick_velocity=1e-5)
    m.add_drive("S", ((0.0, 1.0), (0.0, 1.0)))
    run = m.simulate(1.0)
    assert run.success
    np.testing.assert_allclose(run.joint("S").drive[5:-5, 0], 0.25 * 2.0 * G, rtol=1e-6)


# ---------------------------------------------------------------- what is not determined, and what is said


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_reaction_that_is_held_twice_is_refused_by_its_joint(coordinates: str) -> None:
    """A parallelogram with three cranks: which of them carries the coupler is nobody's to say."""
    m = pt.Mechanism("three cranks", gravity=(0.0, -G, 0.0))
    m.add_rod("coupler", start=(0, 1, 0), end=(2, 1, 0), mass=1.0)
    for i, name in enumerate("abc"):
        m.add_rod(name, start=(i, 0, 0), end=(i, 1, 0), mass=1.0)
        m.add_revolute(f"{name}0", m.ground, name, point=(i, 0, 0))
        m.add_revolute(f"{name}1", name, "coupler", point=(i, 1, 0))

    def run() -> Any:
        start = m.assemble({"a0": 0.3}, rates={"a0": 1.0}, coordinates=coordinates)
        return m.simulate(0.1, initial=start, coordinates=coordinates)

    assert run().success  # as long as nothing depends on it
    m.add_friction("b1", coefficient=0.1, radius=0.01, stick_velocity=0.1)
    with pytest.raises(OpenReactionError) as caught:
        run()
    assert (caught.value.where, caught.value.joint) == ("friction in b1", "b1")
    assert 'reaction of joint "b1", which is not determined' in str(caught.value)


def test_a_slide_under_a_load_across_the_plane_asks_for_what_the_plane_does_not_say() -> None:
    """Pushed out of its plane a slider-crank shares the load in no determined way; a single slide has no choice."""
    m = slider_crank()
    m.add_force("rod", (0.0, 0.0, 5.0))
    with pytest.raises(OpenReactionError, match='reaction of joint "S", which is not determined'):
        m.simulate(0.1)


@pytest.mark.parametrize("beside", [0.0, 0.1])
def test_a_spring_beside_the_plane_presses_as_a_force_does_there(beside: float) -> None:
    """It tilts a slide with a length out of the plane, whose reaction to that is not determined."""

    def loaded(spring: bool) -> pt.Mechanism:
        m = slider_crank()
        if spring:
            m.add_spring(
                "spring", m.ground, (2.0, 0.0, beside), "piston", (0.0, 0.0, beside), stiffness=3.0, length=0.0
            )
        else:
            m.add_force("piston", (3.0, 0.0, 0.0), point=(0.0, 0.0, beside))
        return m

    for spring in (True, False):
        if beside:
            with pytest.raises(OpenReactionError):
                loaded(spring).simulate(0.01)
        else:
            assert loaded(spring).simulate(0.01).success


def test_the_collar_of_a_turn_carries_the_force_along_the_axis() -> None:
    """A disk on an upright spindle: collar mu m g, and the length carries a moment."""
    mass, inertia, mu, collar = 2.0, 0.5, 0.2, 0.03
    m = pt.Mechanism("disk", gravity=(0.0, 0.0, -G))
    m.add_body("disk", mass=mass, inertia=(0.3, 0.3, inertia))
    m.add_revolute("A", m.ground, "disk", point=(0, 0, 0), axis=(0, 0, 1))
    m.add_friction("A", coefficient=mu, radius=0.01, collar=collar, stick_velocity=1e-4)
    run = m.simulate(1.0, initial=m.assemble(rates={"A": 5.0}), **TIGHT)
    assert run.joint("A").velocity[-1, 0] == pytest.approx(5.0 - mu * collar * mass * G / inertia, rel=1e-8)
    # with the weight beside the axis, on a bearing of length L: two forces m g e / L, that follow the turn
    e, length, radius = 0.1, 0.25, 0.01
    m = pt.Mechanism("disk", gravity=(0.0, 0.0, -G))
    m.add_body("disk", mass=mass, inertia=(0.3, 0.3, inertia), com=(e, 0, 0))
    m.add_revolute("A", m.ground, "disk", point=(0, 0, 0), axis=(0, 0, 1))
    m.add_friction("A", coefficient=mu, radius=radius, length=length, stick_velocity=1e-4)
    run = m.simulate(0.5, initial=m.assemble(rates={"A": 5.0}), **TIGHT)

    def rate(_t: float, y: Any) -> list[float]:
        w = y[0]

        def open_(a: float) -> float:
            # mass x acceleration of the centre, in its axes; the weight's couple is across the arm
            force = np.array([-mass * e * w * w, mass * e * a])
            couple = np.array([mass * G * e / length, 0.0])  # sense along the arm
            normal = np.linalg.norm(force / 2 + couple) + np.linalg.norm(force / 2 - couple)
            return float((inertia + mass * e * e) * a + mu * radius * normal * smooth(w, 1e-4))

        return [brentq(open_, -1e3, 1e3, xtol=1e-14)]

    truth = solve_ivp(rate, (0.0, 0.5), [5.0], method="DOP853", rtol=1e-11, atol=1e-12)
    assert run.joint("A").velocity[-1, 0] == pytest.approx(truth.y[0, -1], abs=1e-8)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"dynamic": 1.0, "coefficient": 0.1, "radius": 0.1}, "exclude one another"),
        ({"static": 1.0, "coefficient": 0.1, "radius": 0.1}, "exclude one another"),
        ({}, "give its magnitude"),
        ({"dynamic": 1.0, "radius": 0.1}, "radius needs a coefficient"),
        ({"dynamic": 1.0, "preload": 0.1}, "preload needs a coefficient"),
        ({"coefficient": -0.1, "radius": 0.1}, "at least 0"),
        ({"coefficient": 0.1, "radius": 0.0}, "greater than 0"),
        ({"coefficient": 0.1, "radius": 0.1, "length": 0.0}, "greater than 0"),
        ({"coefficient": 0.1, "radius": 0.1, "preload": -1.0}, "at least 0"),
        ({"coefficient": math.nan, "radius": 0.1}, "finite"),
        ({"coefficient": "x", "radius": 0.1}, "coefficient"),
        ({"coefficient": 0.1}, "radius"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], words: str) -> None:
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=1.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    with pytest.raises(DescriptionError) as caught:
        m.add_friction("A", stick_velocity=0.1, **given)
        m.compile()
    assert words in str(caught.value)


def test_joints_whose_reaction_does_not_press_are_refused() -> None:
    m = pt.Mechanism("screw")
    m.add_body("nut", mass=1.0, inertia=(1, 1, 1))
    m.add_screw("T", m.ground, "nut", point=(0, 0, 0), axis=(0, 0, 1), pitch=0.1)
    with pytest.raises(DescriptionError, match="give the friction magnitude itself"):
        m.add_friction("T", coefficient=0.1, stick_velocity=0.1)
        m.compile()


def test_coefficients_are_parameters_and_stand_in_files(tmp_path: Path) -> None:
    m = slider_crank(mu=0.1)
    m.save(tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert "coefficient = 0.1" in text and "preload = 2" in text
    read = pt.load(tmp_path / "m.toml")
    model, other = m.compile(), slider_crank(mu=0.3).compile()
    assert model.parameters["friction in S.coefficient"] == 0.1
    changed = model.with_parameters({"friction in S.coefficient": 0.3, "friction in S.static_coefficient": 0.45})
    state = m.assemble({"A": 0.7}, rates={"A": 8.0})
    h = [x.forces(state.q, state.v) for x in (model, read.compile(), changed, other)]
    assert np.array_equal(h[0], h[1]) and np.array_equal(h[2], h[3]) and not np.array_equal(h[0], h[2])
    with pytest.raises(DescriptionError):
        model.with_parameters({"friction in S.coefficient": -1.0})
    with pytest.raises(DescriptionError, match="out of the plane"):
        model.with_parameters({"gravity": (0.0, -9.81, 1.0)})


def test_the_report_names_frictions_whose_reaction_is_open() -> None:
    """Ahead of a run, all of them, in all its forms; and says no such thing where every reaction is determined."""
    m = pt.Mechanism("three cranks", gravity=(0.0, -G, 0.0))
    m.add_rod("coupler", start=(0, 1, 0), end=(2, 1, 0), mass=1.0)
    for i, name in enumerate("abc"):
        m.add_rod(name, start=(i, 0, 0), end=(i, 1, 0), mass=1.0)
        m.add_revolute(f"{name}0", m.ground, name, point=(i, 0, 0))
        m.add_revolute(f"{name}1", name, "coupler", point=(i, 1, 0))
    before = m.report(m.assemble({"a0": 0.3}))
    for joint in ("b1", "c1"):
        m.add_friction(joint, coefficient=0.1, radius=0.01, stick_velocity=0.1)
    m.add_friction("a0", dynamic=0.1, stick_velocity=0.1)
    report = m.report(m.assemble({"a0": 0.3}))
    listed = [{"friction": f"friction in {joint}", "joint": joint} for joint in ("b1", "c1")]
    found = report.to_dict()["open_frictions"]
    assert sorted(found, key=lambda item: item["joint"]) == listed
    for text in (report.text, report.markdown):
        assert "friction in b1" in text and "friction in c1" in text and "friction in a0" not in text
        assert "a run would be refused" in " ".join(text.split())
    assert report.to_dict()["reactions"] == before.to_dict()["reactions"]
    assert before.to_dict()["open_frictions"] == [] and "Friction" not in before
    assert slider_crank().report().to_dict()["open_frictions"] == []


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_effort_and_power_follow_the_reaction_at_every_output(coordinates: str) -> None:
    """A swinging rod: the force of its hinge changes, and with it what friction does."""
    mu, radius, stick = 0.2, 0.05, 1e-3
    m = pt.Mechanism("swing", gravity=(0, -G, 0))
    m.add_rod("rod", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, "rod", point=(0, 0, 0))
    friction = m.add_friction("A", coefficient=mu, radius=radius, stick_velocity=stick)
    for word in ("effort", "power"):
        m.add_sensor(word, friction, word)
    start = m.convert(m.assemble(rates={"A": -1.0}), coordinates)
    run = m.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 5), initial=start, coordinates=coordinates)
    hinge = run.joint("A")
    rate, pressed = hinge.velocity[:, 0], np.linalg.norm(hinge.force[:, :2], axis=1)
    assert np.ptp(pressed) > 20.0
    effort = [-mu * radius * n * smooth(w, stick) for n, w in zip(pressed, rate, strict=True)]
    assert run.sensor("effort").values == pytest.approx(effort, rel=1e-9)
    assert run.sensor("power").values == pytest.approx(np.array(effort) * rate, rel=1e-9)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_what_acts_along_other_coordinates_of_the_joint_does_not_press(coordinates: str) -> None:
    """A pin in a slot: a motor along the slot acts beside the joint's constraints, whose force is across it."""
    mu, radius, stick, push, mass = 0.2, 0.05, 1e-3, 100.0, 2.0
    m = pt.Mechanism("slot", gravity=(0, -G, 0))
    m.add_body("body", mass=mass, inertia=(0.1, 0.1, 0.1))
    m.add_joint("J", m.ground, "body", free=("x", "rz"), point=(0, 0, 0))
    m.add_torque("J", push, coordinate=0)
    m.add_friction("J", coefficient=mu, radius=radius, stick_velocity=stick, coordinate=1)
    start = m.convert(m.assemble(rates={"J": [0.0, 3.0]}), coordinates)
    run = m.simulate(0.2, initial=start, coordinates=coordinates, **TIGHT)
    assert np.linalg.norm(run.joint("J").force[-1]) == pytest.approx(mass * G, rel=1e-10)
    slowed = mu * radius * mass * G / 0.1
    assert run.joint("J").velocity[-1, 1] == pytest.approx(3.0 - 0.2 * slowed, abs=1e-6)


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_a_drive_of_another_coordinate_presses(coordinates: str) -> None:
    """A sleeve whose turn is driven slides on its key: the torque I alpha presses with I alpha / r at the radius r. A
    torque that is applied, and is no reaction, presses nothing."""
    inertia, mass, radius, alpha, mu = 0.3, 2.0, 0.05, 4.0, 0.2
    slowed = []
    for driven in (True, False):
        m = pt.Mechanism("sleeve", gravity=None)
        sleeve = m.add_body("sleeve", mass=mass, inertia=(0.2, 0.2, inertia))
        m.add_cylindrical("C", m.ground, sleeve, point=(0, 0, 0), axis=(0, 0, 1))
        m.add_friction("C", coefficient=mu, radius=radius, stick_velocity=1e-5, coordinate=0)
        if driven:
            m.add_drive("C", lambda t: 0.5 * alpha * t**2, coordinate=1)
        else:
            m.add_torque("C", inertia * alpha, coordinate=1)
        start = m.convert(m.assemble(rates={"C.slide": 100.0}), coordinates)
        run = m.simulate(0.01, initial=start, coordinates=coordinates)
        assert run.success, run.message
        slowed.append(run.joint("C").acceleration[:, 0])
        assert np.abs(run.joint("C").acceleration[:, 1] - alpha).max() < 1e-9
    assert np.abs(slowed[0] + mu * inertia * alpha / radius / mass).max() < 1e-9
    assert np.abs(slowed[1]).max() < 1e-9
