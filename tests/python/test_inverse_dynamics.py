"""Inverse dynamics: efforts of any set of actuators, against forward dynamics, closed forms and another optimiser."""

import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize
from test_assemble_many import POINTS, five_bar
from thorough import THOROUGH, either

import partita as pt
from partita import cli
from partita.analyses import InverseDynamics
from partita.catalogue.zoo import platforms
from partita.errors import ArgumentError, DescriptionError, UnknownNameError

Array = NDArray[np.float64]


@dataclass
class Moved:
    """Any motion of a mechanism."""

    t: Array
    q: Array
    v: Array
    vdot: Array
    names: Any


def actuated(m: pt.Mechanism) -> dict[str, str]:
    """A torque along every coordinate of every joint, without effort: name of the coordinate -> of the torque."""
    found = {}
    for joint in m.compile().summary["joints"]:
        for i, axis in enumerate(joint["axes"]):
            name = joint["name"] if len(joint["axes"]) == 1 else f"{joint['name']}.{axis}"
            m.add_torque(joint["name"], 0.0, coordinate=i, name=f"motor {name}")
            found[name] = f"motor {name}"
    return found


def wanted(m: pt.Mechanism, run: pt.Result, seed: int = 1) -> Moved:
    """The states of a run with other accelerations, which the constraints allow."""
    rng = np.random.default_rng(seed)
    model = m.compile()
    vdot = []
    for q, v in zip(run.q, run.v, strict=True):
        i = model.at(q, v)
        vdot.append(i.vdot + i.D.T @ rng.normal(size=len(i.h_d), scale=3.0))
    return Moved(run.t, run.q, run.v, np.array(vdot), run.names)


def caused(m: pt.Mechanism, d: InverseDynamics, motors: dict[str, str], row: int) -> Array:
    """Accelerations by forward dynamics under the efforts."""
    efforts = {f"{motors[name]}.value": d.effort(name)[row] for name in d.actuators}
    return m.compile().with_parameters(efforts).acceleration(d.q[row], d.v[row])[0]


def moving(name: str) -> tuple[pt.Mechanism, dict[str, str], pt.State]:
    """A mechanism with motors, and a state in motion."""
    if name == "five-bar":
        m = five_bar()
        return m, actuated(m), m.assemble(rates={"A": 1.3, "E": -0.7})
    entry = pt.catalogue.entry(name)
    m = entry.mechanism()
    motors = actuated(m)
    return m, motors, entry.initial(m)


@pytest.mark.parametrize(("name", "most", "least"), [("five-bar", 10, 15), ("three-rrr", 84, 120), ("delta", 60, 12)])
def test_every_admissible_set_returns_the_motion(name: str, most: int, least: int) -> None:
    """Inverse, then forward dynamics; also with more actuators. The rods of the delta robot spin about their axes."""
    m, motors, start = moving(name)
    k = m.compile().mobility
    run = m.simulate(0.3, initial=start, t_eval=[0.0, 0.3])
    path = wanted(m, run)
    rng = np.random.default_rng(2)
    sets = list(itertools.combinations(motors, k)) if len(motors) < 10 else []
    sets = sets or [tuple(rng.permutation(list(motors))[:k]) for _ in range(most)]
    larger = [tuple(dict.fromkeys((*one, *other))) for one, other in itertools.pairwise(sets[:6])]
    admissible = 0
    for chosen in (*sets, *larger):
        units = {name: 1.0 + 0.5 * i for i, name in enumerate(chosen)}
        d = m.inverse_dynamics(path, chosen, weights=units)
        for row in np.flatnonzero(d.margin > 1e-3):
            admissible += 1
            there = caused(m, d, motors, int(row))
            scale = np.abs(path.vdot[row]).max()
            assert np.abs(there - path.vdot[row]).max() < 1e-9 * scale, (chosen, row, d.margin[row])
            assert d.remainder[row] < 1e-9
    assert admissible >= least
    best = max(sets, key=lambda chosen: m.inverse_dynamics(path, chosen).margin.min())
    d = m.inverse_dynamics(path, best)
    assert d.at_once.reactions["residual"].max() < 1e-9
    assert d.run.certificate.newton_euler < 1e-9 and d.run.certificate.acceleration_closure is None
    other = d.run.reactions_by("augmented")["force"]
    assert np.abs(other - d.at_once.reactions["force"]).max() < 1e-8 * (1.0 + np.abs(other).max())


@pytest.mark.parametrize("part", range(either(1, 20)))
def test_every_set_of_a_delta_robot_whose_bars_do_not_spin(part: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three of its 33 coordinates, 5456 sets in all: each that is admissible returns the motion."""
    bars = platforms.bars
    monkeypatch.setattr(platforms, "bars", lambda *given, spins: bars(*given, spins=False))
    m = pt.Mechanism("delta", gravity=(0, 0, -9.81))
    platforms.delta(m)
    motors = actuated(m)
    assert m.compile().mobility == 3 and len(motors) == 33
    path = wanted(m, m.simulate(0.2, initial=m.assemble(rates={"shoulder 1": 0.5}), t_eval=[0.0, 0.2]))
    path = Moved(path.t[1:], path.q[1:], path.v[1:], path.vdot[1:], path.names)
    sets = list(itertools.combinations(motors, 3))
    order = np.random.default_rng(3).permutation(len(sets))
    admissible, errors = 0, []
    for i in np.array_split(order, 20)[part] if THOROUGH else order[:60]:
        d = m.inverse_dynamics(path, sets[i])
        if d.margin[0] > 1e-3:
            admissible += 1
            errors.append(np.abs(caused(m, d, motors, 0) - path.vdot[0]).max() / np.abs(path.vdot[0]).max())
            assert d.remainder[0] < 1e-9
    assert max(errors) < 1e-9
    print(f"{admissible} admissible sets, worst {max(errors):.1e}")


def test_a_delta_robot_is_moved_by_its_shoulders() -> None:
    """Torques of the shoulders, from the motion that they cause: the spins of its rods need no effort."""
    m, motors, start = moving("delta")
    torques = {"shoulder 1": 0.7, "shoulder 2": -1.1, "shoulder 3": 2.3}
    run = m.simulate(0.2, initial=start, parameters={f"{motors[name]}.value": x for name, x in torques.items()})
    d = m.inverse_dynamics(run, torques)
    assert np.abs(d.efforts - [*torques.values()]).max() < 1e-9 and d.remainder.max() < 1e-8 and not d.notes
    assert d.margin.min() > 0.05


def test_idle_bars_spin_as_they_will() -> None:
    """A motion whose idle spins no effort causes: the platform moves as asked, and nothing is said to be impossible."""
    m = pt.catalogue.load("delta")
    shoulders = ("shoulder 1", "shoulder 2", "shoulder 3")
    torques = {name: m.add_torque(name, 0.0, name=f"torque of {name}").name for name in shoulders}
    m.add_sensor("tool", m.bodies["platform"], "acceleration")
    tool, s = ("platform", (0, 0, 0)), np.linspace(0.0, 1.0, 5)
    offset = np.array([0.06, 0.02, 0.03])
    k = m.kinematics(
        {tool: np.outer(s**2, offset)},
        rates={tool: np.outer(2 * s, offset)},
        accelerations={tool: np.tile(2 * offset, (5, 1))},
    )
    d = m.inverse_dynamics(k, shoulders)
    assert d.remainder.max() < 1e-12 and not d.notes and d.at_once.reactions["residual"].max() < 1e-9
    for row in range(5):
        efforts = {f"{torques[name]}.value": d.effort(name)[row] for name in shoulders}
        start = pt.State(0.0, d.q[row], d.v[row])
        run = m.simulate(1e-3, initial=start, t_eval=[0.0], parameters=efforts)
        assert np.abs(run.sensor("tool").values[0] - 2 * offset).max() < 1e-9


R, L, M1, M2, M3, SPEED = 0.05, 0.17, 0.8, 0.5, 0.6, 120.0


def engine() -> pt.Mechanism:
    """Crank, rod and piston along x, with a gas force that depends on the time."""
    m = pt.Mechanism("engine")
    crank = m.add_rod("crank", start=(0, 0, 0), end=(R, 0, 0), mass=M1)
    rod = m.add_rod("rod", start=(R, 0, 0), end=(R + L, 0, 0), mass=M2)
    piston = m.add_body("piston", mass=M3, inertia=(1e-3, 1e-3, 1e-3), position=(R + L, 0, 0))
    m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
    m.add_revolute("B", crank, rod, point=(R, 0, 0))
    m.add_revolute("C", rod, piston, point=(R + L, 0, 0))
    m.add_prismatic("D", m.ground, piston, point=(R + L, 0, 0), axis=(1, 0, 0))
    m.add_force(piston, (gas, 0.0, 0.0), name="gas")
    return m


def gas(t: Any, state: Any = None) -> Any:
    return -4000.0 * (0.5 + 0.5 * np.cos(SPEED * t)) ** 3


def test_torque_and_pin_forces_of_an_engine_by_virtual_power() -> None:
    """d'Alembert's forces on the closed form of a slider-crank: their power, and each body's balance."""
    m = engine()
    t = np.linspace(0.0, 2.0 * np.pi / SPEED, 73)
    d = m.inverse_dynamics((t, {"A": lambda t: SPEED * t}))
    a, w = SPEED * t, SPEED
    b = np.arcsin(-R * np.sin(a) / L)
    b1 = -R * np.cos(a) * w / (L * np.cos(b))
    b2 = (R * np.sin(a) * w**2 / L + np.sin(b) * b1**2) / np.cos(b)
    at, along, g = np.array([np.cos(a), np.sin(a)]), np.array([np.cos(b), np.sin(b)]), np.array([[0.0], [-9.81]])
    across = np.array([-along[1], along[0]])
    v2 = R * w * np.array([-at[1], at[0]]) + L / 2 * b1 * across
    a2 = -R * w**2 * at + L / 2 * (b2 * across - b1**2 * along)
    v3, a3 = 2 * v2[0] - R * w * -at[1], 2 * a2[0] - -R * w**2 * at[0]
    v1 = R / 2 * w * np.array([-at[1], at[0]])
    spin = M2 * L**2 / 12 * b2
    needed = M2 * ((a2 - g) * v2).sum(axis=0) + spin * b1 + M3 * a3 * v3 - gas(t) * v3 - M1 * (g * v1).sum(axis=0)
    assert np.abs(d.power("A") - needed).max() < 1e-10 * np.abs(needed).max()
    assert np.abs(d.effort("A") - d.joint("A").drive[:, 0]).max() == 0.0
    wrist = M3 * a3 - gas(t)  # along x, on the piston
    pin = M2 * (a2 - g)  # on the rod, with that of the wrist
    # about the middle of the rod: L/2 along x (-W) - L/2 along x P = spin, with P = pin + W
    rest = spin + L / 2 * (along[0] * pin[1] - along[1] * (pin[0] + 2 * wrist))
    up = -rest / (L * along[0])
    force = d.joint("C").force
    scale = np.abs(force).max()
    assert np.abs(force[:, 0] - wrist).max() < 1e-10 * scale
    assert np.abs(force[:, 1] - up).max() < 1e-10 * scale
    of_pin = np.array([pin[0] + wrist, pin[1] + up]).T
    assert np.abs(d.joint("B").force[:, :2] - of_pin).max() < 1e-10 * scale
    assert d.joint("C").in_frame("world").determined[[0, 1]].all()


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
@pytest.mark.parametrize("name", ["A", "B", "C", "D", "gas.x"])
def test_a_motion_by_forces_alone_needs_no_effort(name: str, coordinates: str) -> None:
    """Whether the actuator is in the tree, closes the loop, or replaces the force that acts; in any coordinates."""
    m = engine()
    start = m.assemble(targets={"A": 0.7}, rates={"A": 20.0})
    run = m.simulate(0.01, initial=start, t_eval=[0.0, 0.004, 0.01], coordinates=coordinates)
    d = m.inverse_dynamics(run, [name])
    expected = gas(run.t) if name == "gas.x" else np.zeros(3)
    assert np.abs(d.effort(name) - expected).max() < 1e-10 * 4000.0
    for joint in "ABCD":
        force, other = d.joint(joint).force, run.joint(joint).force
        assert np.abs(force - other).max() < 1e-9 * (1.0 + np.abs(other).max())


def straight() -> tuple[pt.Mechanism, pt.State]:
    """A five-bar whose distal rods lie in one line: forces along it are not in the motors' power."""
    m = five_bar()
    b, c, d = (np.array(POINTS[x]) for x in "bcd")
    inward, outward = b - c, d - c
    angle = np.arctan2(inward[0] * outward[1] - inward[1] * outward[0], inward @ outward)
    near = m.assemble(guess={"A": 0.5})
    return m, m.assemble(targets={"C": np.sign(angle) * (np.pi - abs(angle))}, near=near)


def test_the_margin_is_zero_where_the_rods_of_a_five_bar_lie_in_one_line() -> None:
    """The closed form of type II; there the efforts have no value, and the other sets have."""
    m, state = straight()
    there = m.compile().core.motion(np.zeros(1), state.q[None], 0 * state.v[None]).joints([1, 2, 3])
    pin = there["joint_point"][0]
    cross = np.cross(pin[1] - pin[0], pin[2] - pin[1])[2]
    assert abs(cross) < 1e-12
    d = m.inverse_dynamics(state, ("A", "E"))
    assert d.margin[0] < 1e-7 and np.isnan(d.efforts).all() and d.gaps == {0: "actuators"}
    assert "type II singularity" in d.notes[0] and "A, E" in d.notes[0]
    assert np.isnan(d.joint("C").force).all()
    other = m.inverse_dynamics(state, ("A", "B"))
    assert other.margin[0] > 0.05 and np.isfinite(other.efforts).all() and not other.notes
    # beside it, by first order: the margin changes its sign there, so that its size grows with the angle
    beside = [m.assemble(targets={"C": state_angle(m, state) + x}, near=state) for x in (1e-3, 2e-3)]
    near = [m.inverse_dynamics(s, ("A", "E")).margin[0] for s in beside]
    assert near[1] / near[0] == pytest.approx(2.0, rel=0.02)


def state_angle(m: pt.Mechanism, state: pt.State) -> float:
    found = m.compile().core.motion(np.zeros(1), state.q[None], 0 * state.v[None]).joints([2])["joint_position"]
    return float(found[0, 0])


def test_the_margin_does_not_depend_on_units() -> None:
    """A slider-crank in metres and millimetres, in kilograms and grams."""
    margins = []
    for length, mass in ((1.0, 1.0), (1000.0, 1000.0), (0.3, 2.0)):
        m = pt.Mechanism("crank", gravity=(0, -9.81 * length, 0))
        crank = m.add_rod("crank", start=(0, 0, 0), end=(0.1 * length, 0.2 * length, 0), mass=mass)
        rod = m.add_rod("rod", start=(0.1 * length, 0.2 * length, 0), end=(0.6 * length, 0, 0), mass=2 * mass)
        inertia = (mass * length**2,) * 3
        piston = m.add_body("piston", mass=mass, inertia=inertia, position=(0.6 * length, 0, 0))
        m.add_revolute("A", m.ground, crank, point=(0, 0, 0))
        m.add_revolute("B", crank, rod, point=(0.1 * length, 0.2 * length, 0))
        m.add_revolute("C", rod, piston, point=(0.6 * length, 0, 0))
        m.add_prismatic("D", m.ground, piston, point=(0.6 * length, 0, 0), axis=(1, 0, 0))
        margins.append([m.inverse_dynamics(m.assemble(), [name]).margin[0] for name in "ABCD"])
    assert np.ptp(margins, axis=0).max() < 1e-12 and 0.0 < np.min(margins) <= np.max(margins) <= 1.0


def redundant() -> tuple[pt.Mechanism, Moved]:
    """A five-bar with motors on four joints."""
    m, _, start = moving("five-bar")
    return m, wanted(m, m.simulate(0.5, initial=start, t_eval=np.linspace(0.0, 0.5, 6)), seed=4)


FOUR = ("A", "B", "D", "E")


def needed(m: pt.Mechanism, path: Moved, row: int) -> tuple[Array, Array]:
    """B (k x s) and tau_d of the four motors, from the equations at one instant."""
    i = m.compile().at(path.q[row], path.v[row])
    d = i.D @ (i.M @ path.vdot[row] - i.h)
    e = np.zeros((len(i.v), 4))
    joints = m.compile().core
    for j, number in enumerate((0, 1, 3, 4)):
        for column in range(len(i.v)):
            unit = np.zeros((1, len(i.v)))
            unit[0, column] = 1.0
            e[column, j] = joints.motion(np.zeros(1), path.q[row][None], unit).joints([number])["joint_velocity"][0, 0]
    return i.D @ e, d


@pytest.mark.parametrize("limit", [None, "some", "least-use"])
def test_distributed_efforts_against_another_optimiser(limit: str | None) -> None:
    """The least weighted squares, the same within limits, and the least use, by SciPy's SLSQP and HiGHS."""
    m, path = redundant()
    weights = {"A": 1.0, "B": 3.0, "D": 0.5, "E": 2.0}
    preload = {"A": 0.4, "D": -0.2}
    free = m.inverse_dynamics(path, FOUR, weights=weights, preload=preload)
    assert free.null_space.shape == (6, 4, 2) and free.remainder.max() < 1e-12
    w, before = np.array([*weights.values()]), np.array([0.4, 0.0, -0.2, 0.0])
    probe = m.inverse_dynamics(path, FOUR, limits=dict.fromkeys(FOUR, 1.0), weights="least-use")
    bound = np.full(4, 1.05 * np.max(probe.use))
    kept = {name: float(x) for name, x in zip(FOUR, bound, strict=True)}
    d = free
    if limit == "some":
        d = m.inverse_dynamics(path, FOUR, weights=weights, preload=preload, limits=kept)
        assert d.use is not None and d.use.max() <= 1.0 + 1e-12 and np.abs(d.efforts - free.efforts).max() > 1e-3
    if limit == "least-use":
        d = m.inverse_dynamics(path, FOUR, weights="least-use", limits=kept)
    for row in range(6):
        b, tau_d = needed(m, path, row)
        assert np.abs(b @ d.efforts[row] - tau_d).max() < 1e-10 * (1.0 + np.abs(tau_d).max())
        assert np.abs(b @ free.null_space[row]).max() < 1e-12
        assert np.abs(free.null_space[row].T @ np.diag(w) @ free.null_space[row] - np.eye(2)).max() < 1e-12
        if limit == "least-use":
            cost = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
            rows = np.block([[np.eye(4), -bound[:, None]], [-np.eye(4), -bound[:, None]]])
            equal = np.hstack([b, np.zeros((2, 1))])
            best = optimize.linprog(cost, A_ub=rows, b_ub=np.zeros(8), A_eq=equal, b_eq=tau_d, bounds=(None, None))
            assert d.use is not None and d.use[row] == pytest.approx(best.fun, rel=1e-9)
            continue
        ends = [(-x, x) for x in bound] if limit else [(None, None)] * 4
        best = optimize.minimize(
            lambda x: np.sum(w * (x - before) ** 2), d.efforts[row] + 0.01, jac=lambda x: 2 * w * (x - before),
            bounds=ends, constraints={"type": "eq", "fun": lambda x, b=b, d=tau_d: b @ x - d, "jac": lambda x, b=b: b},
            method="SLSQP", options={"ftol": 1e-16, "maxiter": 300},
        )  # fmt: skip
        assert np.abs(best.x - d.efforts[row]).max() < 1e-6


def test_limits_that_no_distribution_keeps_are_reported() -> None:
    m, path = redundant()
    d = m.inverse_dynamics(path, FOUR, limits=dict.fromkeys(FOUR, 1e-3))
    assert d.use is not None and d.use.min() > 1.0
    assert "the limits do not allow this motion: at 6 of 6 instants" in d.notes[0]
    # with as many actuators as freedoms nothing can be distributed, and the use says the same
    assert not m.inverse_dynamics(path, ("A", "E"), limits={"A": 1e-3, "E": 1.0}).notes


def test_fewer_actuators_leave_a_remainder_in_words() -> None:
    """A run by forces alone needs none; another motion is not possible with one motor."""
    m, _, start = moving("five-bar")
    run = m.simulate(0.2, initial=start, t_eval=[0.0, 0.2])
    assert m.inverse_dynamics(run, ["A"]).remainder.max() < 1e-9
    d = m.inverse_dynamics(wanted(m, run), ["A"])
    assert 0.01 < d.remainder.max() <= 1.0
    assert "this motion is not possible with A alone: 1 actuator for 2 degrees of freedom" in d.notes[0]
    assert "add 1 more" in d.notes[0]


def test_a_force_in_body_axes_turns_with_its_body() -> None:
    """A thruster at the end of a pendulum: moment = arm times the component across it, in any position."""
    m = pt.Mechanism("pendulum")
    rod = m.add_rod("rod", start=(0, 0, 0), end=(2, 0, 0), mass=3.0)
    m.add_revolute("A", m.ground, rod, point=(0, 0, 0))
    m.add_force(rod, (1.0, 2.0, 0.0), point=(2, 0, 0), axes="body", name="push")
    m.add_force(rod, (0.0, 0.0, 0.0), point=(2, 0, 0), name="pull")
    for angle in (0.0, 0.4, 2.0):
        state = m.assemble(targets={"A": angle})
        weight = 3.0 * 9.81 * np.cos(angle)
        d = m.inverse_dynamics(state, ["push.y"])
        assert d.effort("push.y")[0] == pytest.approx(weight / 2.0, abs=1e-12)
        # the pin carries the rest: the weight, the thrust, and the other component, which still acts
        c, s = np.cos(angle), np.sin(angle)
        thrust = np.array([c * 1.0 - s * weight / 2.0, s * 1.0 + c * weight / 2.0, 0.0])
        assert np.abs(d.joint("A").force[0] - ([0.0, 3.0 * 9.81, 0.0] - thrust)).max() < 1e-12
        other = m.inverse_dynamics(state, ["pull.y"]).effort("pull.y")[0] * 2.0 * np.cos(angle)
        assert other == pytest.approx(weight - 2.0 * 2.0, abs=1e-12)
    # along the rod it moves nothing: a direction that is singular everywhere
    assert np.isnan(m.inverse_dynamics(state, ["push.x"]).efforts).all()


def test_a_spring_line_adds_to_its_spring() -> None:
    """A strut between two points carries the weight together with the spring that is there."""
    m = pt.Mechanism("flap", gravity=(0, -9.81, 0))
    flap = m.add_rod("flap", start=(0, 0, 0), end=(1, 0, 0), mass=2.0)
    m.add_revolute("A", m.ground, flap, point=(0, 0, 0))
    m.add_spring("strut", m.ground, (0, 1, 0), flap, (0.5, 0, 0), stiffness=30.0, length=0.0)
    d = m.inverse_dynamics(m.assemble(), ["strut"])
    line = np.hypot(1.0, 0.5)
    # moment about A: weight at 0.5 m, and along the line with arm 0.5 / line; positive efforts push apart
    total = -9.81 / (0.5 * 1.0 / line)
    assert d.effort("strut")[0] == pytest.approx(total + 30.0 * line, rel=1e-12)
    assert d.units == ("N",)


def test_a_ball_joint_is_moved_about_three_axes() -> None:
    m = pt.Mechanism("top", gravity=(0, 0, -9.81))
    top = m.add_body("top", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.3, 0.1, 0.5))
    m.add_spherical("S", m.ground, top, point=(0, 0, 0))
    for name in "xyz":
        m.add_torque("S", 0.0, coordinate="xyz".index(name), name=f"motor S.w{name}")
    run = m.simulate(0.2, initial=m.assemble(rates={"S": (1.0, 2.0, -1.0)}), t_eval=[0.0, 0.2])
    path = wanted(m, run)
    chosen = ("S.wx", "S.wy", "S.wz")
    d = m.inverse_dynamics(path, chosen)
    for row in range(2):
        there = caused(m, d, {name: f"motor {name}" for name in chosen}, row)
        assert np.abs(there - path.vdot[row]).max() < 1e-10 * np.abs(path.vdot[row]).max()
    assert d.units == ("N m",) * 3


@pytest.mark.parametrize("coordinates", ["relative", "absolute"])
def test_actuators_determine_no_reaction_and_hide_none(coordinates: str) -> None:
    """Two motors on one motion: the pins are determined as without motors, whereas two drives leave them open."""
    m = pt.catalogue.load("four-bar")
    run = m.simulate(0.3, t_eval=[0.0, 0.3], coordinates=coordinates)
    d = m.inverse_dynamics(run, ("A", "D"))
    for joint in "ABCD":
        mine, own = d.joint(joint), run.joint(joint)
        assert (mine.determined_at == own.determined_at).all()
        assert np.abs(mine.force - own.force).max() < 1e-8 * (1.0 + np.abs(own.force).max())


def test_a_course_moves_what_it_names_and_drives_move_themselves() -> None:
    """Tables, functions, the drives of the mechanism, and a state that is held."""
    m = engine()
    t = np.linspace(0.0, 0.02, 11)
    by_function = m.inverse_dynamics((t, {"A": lambda t: 30.0 * t}))
    by_values = m.inverse_dynamics((t, {"A": 30.0 * t}))
    by_table = m.inverse_dynamics((t, {"A": ([0.0, 0.02], [0.0, 0.6])}))
    held = m.inverse_dynamics(m.assemble(targets={"A": 0.7}), ["D"])
    assert held.v.tolist() == [[0.0] * held.v.shape[1]] and np.isfinite(held.efforts).all()
    m.add_drive("A", position=lambda t: 30.0 * t, name="motor")
    by_drive = m.inverse_dynamics(t)
    again = m.inverse_dynamics((t, {"A": lambda t: 30.0 * t}))  # in place of the drive
    assert np.abs(again.efforts - by_drive.efforts).max() < 1e-8 * np.abs(by_drive.efforts).max()
    for d in (by_values, by_table, by_drive):
        assert np.abs(d.effort("A") - by_function.effort("A")).max() < 1e-8 * np.abs(by_function.effort("A")).max()
    assert np.abs(m.simulate(0.02, t_eval=t).joint("A").drive[:, 0] - by_drive.effort("A")).max() < 1e-7
    assert m.inverse_dynamics().t.tolist() == [0.0]


def test_results_are_shown_and_kept() -> None:
    m = engine()
    t = np.linspace(0.0, 0.05, 21)
    d = m.inverse_dynamics((t, {"A": SPEED * t}), limits={"A": 500.0})
    assert repr(d).startswith("<Inverse dynamics of 'engine': 21 instants; A up to ")
    assert "A" in d._repr_html_() and d.use is not None
    figure = d.plot("A")
    assert figure.axes[0].get_ylabel() == "effort [N m]"
    found = d.to_xarray()
    assert found.effort.dims == ("t", "actuator") and found.actuator_unit.values.tolist() == ["N m"]
    assert d.peak()["A"]["rate"] == pytest.approx(SPEED)
    assert np.abs(d.power("A") - d.effort("A") * d.rate("A")).max() == 0.0
    with pytest.raises(AttributeError):
        d.efforts = t  # type: ignore[misc]


def bad(m: pt.Mechanism, kind: type[Exception], words: str, *arguments: Any, **options: Any) -> None:
    with pytest.raises(kind) as caught:
        m.inverse_dynamics(*arguments, **options)
    assert words in str(caught.value), str(caught.value)


def test_bad_input_is_refused_with_names_numbers_and_a_remedy() -> None:
    m = engine()
    m.add_spring("s", m.ground, (0, 1, 0), "rod", (0, 0, 0), stiffness=1.0)
    m.add_friction("A", 1.0, stick_velocity=0.1, name="rub")
    run = m.simulate(0.01, t_eval=[0.0, 0.01])
    bad(m, UnknownNameError, "did you mean 'A'", run, ["a"])
    bad(m, ArgumentError, "actuators must be a list", run, "A")
    bad(m, ArgumentError, "name at least one", run, [])
    bad(m, ArgumentError, "names 'A' twice", run, ["A", "A"])
    bad(m, ArgumentError, "name one of them: gas.x, gas.y, gas.z", run, ["gas"])
    bad(m, ArgumentError, "its force follows from the motion", run, ["rub"])
    bad(m, ArgumentError, "the mechanism has no drives, so name the actuators", run)
    bad(m, ArgumentError, "no motion is prescribed", None, ["A"])
    bad(m, ArgumentError, "motion must be a Result", "fast", ["A"])
    bad(m, ArgumentError, "is not one coordinate", ([0.0, 1.0], {("rod", (0, 0, 0)): [0.0, 1.0]}), ["A"])
    bad(m, ArgumentError, "give a position for each of the 2 times", ([0.0, 1.0], {"A": [0.0, 1.0, 2.0]}), ["A"])
    bad(m, ArgumentError, "names nothing that moves", ([0.0, 1.0], {}), ["A"])
    other = pt.catalogue.load("delta")
    bad(m, ArgumentError, "give a motion of this mechanism", other.simulate(0.1, t_eval=[0.1]), ["A"])
    bad(m, ArgumentError, "the state moves", m.assemble(rates={"A": 1.0}), ["A"])
    bad(m, ArgumentError, "weights['A'] = -1 must be greater than 0", run, ["A"], weights={"A": -1.0})
    bad(m, ArgumentError, "lower < 0 < upper", run, ["A"], limits={"A": (1.0, 2.0)})
    bad(m, ArgumentError, "none is given for D", run, ["A", "D"], limits={"A": 1.0})
    bad(m, ArgumentError, "needs limits", run, ["A", "D"], weights="least-use")
    bad(m, ArgumentError, "different units (N m, N)", run, ["A", "D"])
    bad(m, ArgumentError, "one for each of the 2 times", run, ["A"], preload={"A": [1.0, 2.0, 3.0]})
    for what, by, words in (
        ("q", 1e-3, "positions of the motion do not fit the constraints: at t = 0.010000 s constraint"),
        ("v", 1.0, "velocities of the motion do not fit"),
        ("vdot", 3e3, "accelerations of the motion do not fit"),
    ):
        arrays = {key: np.array(getattr(run, key)) for key in ("q", "v", "vdot")}
        arrays[what][1, 0] += by
        bad(m, ArgumentError, words, Moved(run.t, names=run.names, **arrays), ["A"])
    m.add_friction("B", coefficient=0.1, radius=0.01, stick_velocity=0.1, name="dry")
    bad(m, ArgumentError, 'the friction "dry" follows the reaction', m.assemble(), ["A"])


def test_a_mechanism_without_freedom_is_refused() -> None:
    m = pt.Mechanism("frame")
    for i, (a, b) in enumerate((((0, 0, 0), (1, 1, 0)), ((2, 0, 0), (1, 1, 0)))):
        m.add_rod(f"rod {i}", start=a, end=b, mass=1.0)
        m.add_revolute(f"foot {i}", m.ground, f"rod {i}", point=a)
    m.add_revolute("top", "rod 0", "rod 1", point=(1, 1, 0))
    with pytest.raises((ArgumentError, DescriptionError), match=r"no degree of freedom|nothing can move"):
        m.inverse_dynamics(m.assemble(), ["top"])


def test_the_command_line_prints_what_motors_must_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["inverse", "four-bar", "--rate", "A=60rpm", "--time", "1"]
    assert cli.main([*command, "-o", "torque.png"]) == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[1].startswith("A") and printed.splitlines()[1].endswith("N m")
    assert "least margin" in printed and (tmp_path / "torque.png").stat().st_size > 1000
    assert cli.main([*command, "--actuator", "D", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["actuators"]) == ["D"] and found["actuators"]["D"]["unit"] == "N m"
    assert cli.main([*command, "--actuator", "Z"]) == 2
    assert "no actuator named 'Z'" in capsys.readouterr().err
    assert cli.main(["inverse", "four-bar"]) == 2
    assert "the mechanism has no drives" in capsys.readouterr().err


def test_the_root_of_the_mean_square_is_over_time_whatever_the_instants() -> None:
    """A force that grows as t from 0 to 2 N in 2 s: sqrt(4/3) N, also from instants that crowd at the start, and with a
    gap in which nothing is known."""
    m = pt.Mechanism("slide", gravity=None)
    m.add_body("load", mass=1.0, inertia=(1, 1, 1))
    m.add_prismatic("A", m.ground, "load", axis=(1, 0, 0))
    for t in (np.linspace(0, 2, 5), np.concatenate([np.linspace(0, 0.2, 50), [0.5, 1.0, 2.0]])):
        found = m.inverse_dynamics((t, {"A": t**3 / 6}), actuators=("A",))
        assert found.peak()["A"]["rms"] == pytest.approx(np.sqrt(4.0 / 3.0), rel=1e-9)
    rest, names = np.zeros((1, 1)), ("A",)
    one = m.inverse_dynamics(Moved(t[:1], rest, rest, rest + 3.0, found.names), actuators=names)
    assert one.peak()["A"]["rms"] == pytest.approx(3.0)
    found.efforts[10:20] = np.nan
    assert np.isfinite(found.peak()["A"]["rms"])
